//! A resolved scene: what the files said, with references resolved.
//!
//! What [`Scene`] promises to the rooms below:
//! * z is up, lengths are metres, the frame is right-handed;
//! * world positions are `f64`; mesh vertices are `f32` in the mesh's own frame;
//! * every index is in range, every vertex finite, no triangle degenerate;
//! * a mesh that many objects use is stored once;
//! * every object and part carries label numbers, and [`Labels`] names them.

mod camera;
mod gltf;
mod label;
mod merge;
mod mesh;
mod obj;
mod texture;

pub use camera::Camera;
pub use label::{LabelRules, Labels, NameTable};
pub use mesh::{Mesh, Part};
pub(crate) use texture::srgb_byte;
pub use texture::{Filter, Texture, TextureRef, Wrap};

use crate::error::{Error, Result};
pub use crate::material::Material;
use crate::report::Report;
use crate::trace::BuiltScene;
use glam::{DAffine3, DVec3};
use std::collections::{BTreeMap, HashMap};
use std::path::Path;
use std::sync::Arc;

/// Which axis of a file points up, for formats that do not say.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum UpAxis {
    /// The file is y up: (x, y, z) becomes (x, -z, y).
    Y,
    /// The file is z up, as echocast is.
    #[default]
    Z,
}

/// How to read a scene file.
#[derive(Clone, Debug)]
pub struct LoadOptions {
    /// Up axis of formats that do not say (OBJ). glTF is always y up.
    pub up: UpAxis,
    /// Metres per unit of formats that do not say (OBJ).
    pub scale: f64,
    /// Names to numbers and patterns to names.
    pub labels: LabelRules,
}

impl Default for LoadOptions {
    fn default() -> Self {
        LoadOptions { up: UpAxis::Z, scale: 1.0, labels: LabelRules::default() }
    }
}

/// An object: one mesh placed in the world.
#[derive(Clone, Debug)]
pub struct Object {
    /// Name in the file.
    pub name: String,
    /// Index into [`Scene::meshes`].
    pub mesh: usize,
    /// Placement, metres.
    pub world_from_object: DAffine3,
    /// Semantic class number, 0 = unlabelled.
    pub category_id: u32,
    /// Part number of each part of the mesh, in their order.
    pub part_ids: Vec<u32>,
    /// Number of this very object, from 1.
    pub instance_id: u32,
}

/// A scene ready to be built; see the module's promises.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// Meshes, each kept once.
    pub meshes: Vec<Arc<Mesh>>,
    /// Objects, each places one mesh.
    pub objects: Vec<Object>,
    /// Surface materials; parts refer to them by index.
    pub materials: Vec<Material>,
    /// Decoded images that materials use.
    pub textures: Vec<Arc<Texture>>,
    /// Camera nodes, places for a sensor.
    pub cameras: Vec<Camera>,
    /// Names of the label numbers.
    pub labels: Labels,
    /// Names of the file's animations (not played yet).
    pub animations: Vec<String>,
    /// Triangles without area that were left out.
    pub degenerate_triangles: usize,
    /// What the reader noticed.
    pub report: Report,
}

impl Scene {
    /// Reads a scene file; the format is chosen by the extension (`.glb`, `.gltf`, `.obj`).
    ///
    /// # Errors
    /// A missing or damaged file, a feature that is not supported, nothing to scan. The message
    /// names file and place.
    pub fn load(path: impl AsRef<Path>) -> Result<Scene> {
        Scene::load_with(path, &LoadOptions::default())
    }

    /// [`Scene::load`] with options.
    ///
    /// # Errors
    /// As [`Scene::load`].
    pub fn load_with(path: impl AsRef<Path>, options: &LoadOptions) -> Result<Scene> {
        let path = path.as_ref();
        let reader = FORMATS.iter().find(|format| format.reads(path)).ok_or_else(|| Error::Unsupported {
            what: format!("{}: scene format", path.display()),
            instead: format!(
                "scenes are read from {}",
                FORMATS.iter().flat_map(|f| f.extensions).map(|e| format!(".{e}")).collect::<Vec<_>>().join(", ")
            ),
        })?;
        (reader.read)(path, options)?.checked(path)
    }

    /// Reads the bytes of a `.glb` file, or of a `.gltf` file whose buffers and images are data URIs.
    ///
    /// # Errors
    /// As [`Scene::load`]; messages say `glTF data` in place of the path. Also a URI that leads to a file.
    pub fn from_glb_bytes(bytes: &[u8], options: &LoadOptions) -> Result<Scene> {
        let origin = Path::new("glTF data");
        gltf::read_bytes(bytes, origin, None, options)?.checked(origin)
    }

    /// The scene as read from `origin` if there is something to scan in it.
    fn checked(mut self, origin: &Path) -> Result<Scene> {
        if self.triangle_count() == 0 {
            return Err(Error::parse(origin, "", "no triangle to scan: the file holds no mesh with area"));
        }
        if !self.animations.is_empty() {
            self.report.warn(format!(
                "{}: {} animation(s) are not played: the scene stands still at time 0",
                origin.display(),
                self.animations.len()
            ));
        }
        Ok(self)
    }

    /// Builds the ray-tracing structure.
    ///
    /// # Errors
    /// Embree's: out of memory, library too old or too new.
    pub fn build(&self) -> Result<BuiltScene> {
        BuiltScene::new(self)
    }

    /// Triangles, each mesh counted as often as it is placed.
    pub fn triangle_count(&self) -> usize {
        self.objects.iter().map(|object| self.meshes[object.mesh].triangle_count()).sum()
    }

    /// World-space box around all objects, metres; `None` for an empty scene.
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        self.object_bounds().into_iter().flatten().reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
    }

    /// World-space box around each object, metres; `None` for one without triangles.
    pub(crate) fn object_bounds(&self) -> Vec<Option<(DVec3, DVec3)>> {
        let of_mesh: Vec<_> = self.meshes.iter().map(|mesh| mesh.bounds()).collect();
        let of_object = |object: &Object| {
            let (low, high) = of_mesh[object.mesh]?;
            let corners = (0..8).map(|corner| {
                let pick = |axis: usize| f64::from(if corner >> axis & 1 == 0 { low[axis] } else { high[axis] });
                object.world_from_object.transform_point3(DVec3::new(pick(0), pick(1), pick(2)))
            });
            corners.map(|p| (p, p)).reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
        };
        self.objects.iter().map(of_object).collect()
    }

    /// The camera node called `name`.
    ///
    /// # Errors
    /// [`Error::Missing`] with near names.
    pub fn camera(&self, name: &str) -> Result<&Camera> {
        self.cameras
            .iter()
            .find(|camera| camera.name == name)
            .ok_or_else(|| Error::missing("camera node", name, self.cameras.iter().map(|camera| &camera.name)))
    }
}

/// An object as a reader found it, before its labels have numbers.
pub(crate) struct RawObject {
    /// Name in the file.
    pub name: String,
    /// Index of the mesh.
    pub mesh: usize,
    /// Placement, metres.
    pub world_from_object: DAffine3,
    /// `categoryID` of the node or its nearest ancestor.
    pub category: Option<String>,
    /// `partID` of the node or its nearest ancestor.
    pub part: Option<String>,
}

/// An object whose labels are words: what gets numbers next.
struct NamedObject {
    name: String,
    mesh: usize,
    world_from_object: DAffine3,
    category: String,
    /// One for each part of the mesh; empty = unlabelled.
    parts: Vec<String>,
}

impl Scene {
    /// Gives every object and part its label numbers; the last step of every reader.
    pub(crate) fn assemble(self, objects: Vec<RawObject>, rules: &LabelRules) -> Scene {
        let material_name = |part: &Part| part.material.map_or("", |index| self.materials[index].name.as_str());
        let named = objects
            .into_iter()
            .map(|object| NamedObject {
                category: rules
                    .category(&object.name)
                    .or(object.category.as_deref())
                    .unwrap_or(&object.name)
                    .to_owned(),
                parts: self.meshes[object.mesh]
                    .parts
                    .iter()
                    .map(|part| {
                        let material = material_name(part);
                        rules.part(material).or(object.part.as_deref()).unwrap_or(material).to_owned()
                    })
                    .collect(),
                name: object.name,
                mesh: object.mesh,
                world_from_object: object.world_from_object,
            })
            .collect();
        self.number(named, &rules.numbers)
    }

    /// Numbers the labels of `objects`, which become this scene's.
    fn number(mut self, objects: Vec<NamedObject>, numbers: &BTreeMap<String, u32>) -> Scene {
        let category = NameTable::number(objects.iter().map(|object| object.category.clone()), numbers);
        let part = NameTable::number(objects.iter().flat_map(|object| object.parts.iter().cloned()), numbers);
        let material = NameTable::number(self.materials.iter().map(|m| m.name.clone()), &BTreeMap::new());

        // Instances are numbered in sorted order of their names; equal names keep the file's order.
        let mut order: Vec<usize> = (0..objects.len()).collect();
        order.sort_by(|&a, &b| objects[a].name.cmp(&objects[b].name));
        let mut instance_ids = vec![0; objects.len()];
        for (position, &index) in order.iter().enumerate() {
            instance_ids[index] = position as u32 + 1;
        }
        let instance = NameTable {
            ids: (1..=objects.len() as u32).collect(),
            names: order.iter().map(|&index| objects[index].name.clone()).collect(),
        };

        let (category_ids, part_ids) = (category.to_map(), part.to_map());
        let number = |ids: &HashMap<&str, u32>, name: &str| ids.get(name).copied().unwrap_or(0);
        self.objects = objects
            .into_iter()
            .zip(instance_ids)
            .map(|(object, instance_id)| Object {
                category_id: number(&category_ids, &object.category),
                part_ids: object.parts.iter().map(|name| number(&part_ids, name)).collect(),
                name: object.name,
                mesh: object.mesh,
                world_from_object: object.world_from_object,
                instance_id,
            })
            .collect();
        self.labels = Labels { category, part, material, instance };
        self
    }
}

/// A kind of scene file.
pub struct SceneFormat {
    /// Short name.
    pub name: &'static str,
    /// File name endings, lower case, without the dot.
    pub extensions: &'static [&'static str],
    /// One line for people.
    pub description: &'static str,
    read: fn(&Path, &LoadOptions) -> Result<Scene>,
}

impl SceneFormat {
    fn reads(&self, path: &Path) -> bool {
        path.extension()
            .and_then(|e| e.to_str())
            .is_some_and(|e| self.extensions.contains(&e.to_ascii_lowercase().as_str()))
    }
}

/// Every scene format that can be read.
pub const FORMATS: &[SceneFormat] = &[
    SceneFormat {
        name: "gltf",
        extensions: &["glb", "gltf"],
        description: "glTF 2.0, binary or text: hierarchy, instances, materials, textures, cameras, labels in extras",
        read: gltf::read,
    },
    SceneFormat {
        name: "obj",
        extensions: &["obj"],
        description: "Wavefront OBJ with MTL: polygons, groups and objects, materials, textures",
        read: obj::read,
    },
];
