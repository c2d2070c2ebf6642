//! Scene files: one module per format, and the table of formats.
#![forbid(unsafe_code)]

mod collada;
mod faces;
#[cfg(feature = "fbx")]
mod fbx;
pub mod gltf;
mod hierarchy;
mod notes;
mod number;
pub mod obj;
mod ply;
mod properties;
mod stl;

use glam::{DAffine3, DVec3};
use ground::error::{Error, Result};
use ground::read;
use ground::shown;
use model::material::TextureBudget;
use model::{RawScene, UpAxis};
use std::path::{Component, Path, PathBuf};

/// How to read a file.
#[derive(Clone, Copy, Default)]
pub struct FileOptions<'o> {
    /// Up axis of formats that do not specify it.
    pub up: UpAxis,
    /// Metres per unit of formats that do not specify it.
    pub scale: f64,
    /// Name of the animation to play; `None`: all of them at once.
    pub animation: Option<&'o str>,
    /// Whether each animation loops at the time of its last key.
    pub looped: bool,
    /// Whether files that the scene references may be outside its folder.
    pub allow_outside_paths: bool,
    /// Whether meshes record which vertices of the file theirs come from.
    pub keeps_sources: bool,
    /// Whether the up axis that a COLLADA file specifies is ignored.
    pub ignores_axes: bool,
}

impl FileOptions<'_> {
    /// Checks the options that formats without units use.
    pub fn check_units(&self) -> Result<()> {
        if self.scale.is_finite() && self.scale > 0.0 {
            return Ok(());
        }
        Err(Error::invalid("scale", self.scale, "finite numbers above 0"))
    }

    /// World from mesh for formats without axes or units; the mesh is relative to `origin`, in the file's units.
    pub fn world_from_mesh(&self, origin: DVec3) -> DAffine3 {
        let world_from_file = self.up.world_from_file() * self.scale;
        DAffine3::from_mat3_translation(world_from_file, world_from_file * origin)
    }
}

/// A kind of scene file.
#[derive(Clone, Copy)]
pub struct SceneFormat {
    /// Short name.
    pub name: &'static str,
    /// File name extensions, lower case, without the dot.
    pub extensions: &'static [&'static str],
    /// One-line description.
    pub description: &'static str,
    /// Reads a file of this kind.
    #[doc(hidden)]
    pub read: fn(&Path, &FileOptions, &mut TextureBudget) -> Result<RawScene>,
}

impl SceneFormat {
    /// Whether the name of `path` has one of its extensions, in upper or lower case.
    #[doc(hidden)]
    pub fn reads(&self, path: &Path) -> bool {
        self.extensions.contains(&&*read::ending(path))
    }
}

/// Every scene format that can be read.
pub const FORMATS: &[SceneFormat] = &[
    SceneFormat {
        name: "gltf",
        extensions: &["glb", "gltf"],
        description: "glTF 2.0, binary or text: hierarchy, instances, materials, textures, cameras, animations, skins, \
                      morph targets, labels in extras",
        read: gltf::read,
    },
    SceneFormat {
        name: "obj",
        extensions: &["obj"],
        description: "Wavefront OBJ with MTL: polygons, groups and objects, materials, textures",
        read: obj::read,
    },
    SceneFormat {
        name: "ply",
        extensions: &["ply"],
        description: "PLY meshes, text or binary: polygons, normals, textures, labels of faces or vertices",
        read: ply::read,
    },
    SceneFormat {
        name: "stl",
        extensions: &["stl"],
        description: "STL, text or binary: triangles, an object for each solid",
        read: stl::read,
    },
    SceneFormat {
        name: "collada",
        extensions: &["dae"],
        description: "COLLADA: hierarchy, instances, polygons, materials, textures, cameras; its unit and its up axis",
        read: collada::read,
    },
    #[cfg(feature = "fbx")]
    SceneFormat {
        name: "fbx",
        extensions: &["fbx"],
        description: "Autodesk FBX, binary or text: hierarchy, instances, materials, textures, cameras, animations, \
                      skins, blend shapes, labels in user properties",
        read: fbx::read,
    },
];

/// The file name extensions of scene files, for messages.
pub fn extensions() -> String {
    FORMATS.iter().flat_map(|f| f.extensions).map(|e| format!(".{e}")).collect::<Vec<_>>().join(", ")
}

/// Whether there is a reader for `path`.
pub fn is_readable(path: &Path) -> bool {
    FORMATS.iter().any(|format| format.reads(path))
}

/// Reads one scene file.
pub fn read(path: &Path, options: &FileOptions, images: &mut TextureBudget) -> Result<RawScene> {
    let reader = FORMATS.iter().find(|format| format.reads(path)).ok_or_else(|| Error::Unsupported {
        what: format!("{}: scene format", shown::path(path)),
        instead: format!("scenes are read from {}", extensions()),
    })?;
    (reader.read)(path, options, images)
}

/// `path` with its `..` resolved, if it leads into `folder` as spelled. Symbolic links may lead anywhere, as the scene
/// does not specify their targets.
pub fn inside(folder: &Path, path: &Path) -> Option<PathBuf> {
    let mut found = folder.to_owned();
    let mut depth = 0;
    for step in path.strip_prefix(folder).ok()?.components() {
        match step {
            Component::Normal(name) => {
                found.push(name);
                depth += 1;
            }
            Component::CurDir => {}
            Component::ParentDir if depth > 0 => {
                found.pop();
                depth -= 1;
            }
            Component::ParentDir | Component::RootDir | Component::Prefix(_) => return None,
        }
    }
    Some(found)
}

/// The error message for a path that a scene must not reference.
pub fn outside(name: &str) -> String {
    format!(
        "{:?} leads out of the folder of the scene; allowed: paths in it, or any with allow_outside_paths \
         (--allow-outside-paths)",
        shown::name(name)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_format_has_endings_of_scenes() {
        let endings = FORMATS.iter().flat_map(|format| format.extensions);
        assert!(endings.clone().count() > 5);
        for ending in endings {
            assert!(model::ENDINGS.contains(ending), "{ending}");
        }
    }
}
