//! Wavefront OBJ with MTL.
//!
//! The format is that of the appendix "Object Files (.obj)" of Alias|Wavefront's Advanced Visualizer manual, read as
//! exporters write it.

mod files;
mod mtl;
mod statements;
mod text;

use super::FileOptions;
use super::faces::PartMaker;
pub(super) use files::Files;
use ground::error::{Error, Result};
use ground::read::{self, Limit};
use ground::shown;
use model::material::{Channel, Material, Texture, TextureBudget, TextureRef, Wrap};
use model::{Mesh, RawObject, RawScene};
use statements::{FaceRun, Names, Statements};
use std::collections::hash_map::Entry;
use std::collections::{HashMap, HashSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Reads the OBJ file at `path` and the MTL files and images it names.
///
/// Every `o`, or in files without `o` every name of a `g`, is an object, even if its faces are not consecutive; faces
/// before the first belong to an object named after the file.
///
/// # Errors
/// A file that cannot be read; a line without a number where one is required or with a vertex that does not exist; no
/// faces; an image that is missing or damaged. A missing MTL file or material is a warning.
pub(super) fn read(path: &Path, options: &FileOptions, images: &mut TextureBudget) -> Result<RawScene> {
    options.check_units()?;
    let file = statements(path)?;
    scene_of(path, file, options, images)
}

/// Reads only the shapes of the OBJ file at `path`, as [`read`] does, z up and in metres; materials are ignored.
///
/// # Errors
/// As [`read`].
pub fn read_shapes(path: &Path) -> Result<RawScene> {
    let mut file = statements(path)?;
    file.libraries = Names::default();
    file.runs.iter_mut().for_each(|run| run.material = 0);
    let options = FileOptions { scale: 1.0, ..FileOptions::default() };
    scene_of(path, file, &options, &mut TextureBudget::new(0))
}

fn statements(path: &Path) -> Result<Statements> {
    Statements::parse(path, &read::bytes(path, Limit::SCENE)?)
}

/// Builds the scene from the statements of the file at `path`.
fn scene_of(path: &Path, mut file: Statements, options: &FileOptions, images: &mut TextureBudget) -> Result<RawScene> {
    let mut scene = RawScene::default();
    file.warnings.drain(..).for_each(|warning| scene.report.warn(warning));
    let mut materials = ObjMaterials::read(path, &file, options, images, &mut scene)?;

    let by_group = file.objects.iter().next().is_none();
    let (names, object_of): (_, fn(&FaceRun) -> usize) =
        if by_group { (&file.groups, |run| run.group) } else { (&file.objects, |run| run.object) };
    let mut runs = file.runs.clone();
    runs.sort_by_key(|run| (object_of(run), run.material));

    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let mut maker = PartMaker::new(&file.faces, options.keeps_sources);
    let faces = |runs: &[FaceRun]| runs.iter().map(FaceRun::faces).collect::<Vec<_>>();
    let mut objects = Vec::new();
    for runs in runs.chunk_by(|a, b| object_of(a) == object_of(b)) {
        let middle = maker.middle(&faces(runs));
        let mut parts = Vec::new();
        for runs in runs.chunk_by(|a, b| a.material == b.material) {
            let material = materials.choose(&file, runs[0].material, &mut scene)?;
            let textured = material.as_ref().is_some_and(|material| material.images().next().is_some());
            parts.extend(maker.part(&faces(runs), middle, textured).map(|part| part.material(material)));
        }
        if parts.is_empty() {
            continue;
        }
        let name = match object_of(&runs[0]) {
            0 => stem.to_string(),
            number => names.list[number].clone(),
        };
        objects.push(RawObject {
            name: name.clone(),
            mesh: Arc::new(Mesh::trusted(name, parts).with_source(maker.source(middle))),
            world_from_object: options.world_from_mesh(middle),
            up: options.up,
            category: None,
            part: None,
            motion: None,
            ancestors: Arc::default(),
            has_node: false,
        });
    }

    materials.warn(path, &mut scene);
    maker.report_to(path, &mut scene);
    Ok(RawScene { objects, ..scene })
}

/// The materials of the MTL files, and which of them the scene uses.
struct ObjMaterials<'a> {
    files: Files<'a>,
    entries: HashMap<String, mtl::MtlMaterial>,
    /// The material of each `usemtl` name, by its number.
    chosen: HashMap<usize, Arc<Material>>,
    /// Image of each file.
    textures: HashMap<PathBuf, Arc<Texture>>,
    /// Masks, by image and channel.
    masks: HashMap<(*const Texture, Channel), Arc<Texture>>,
    /// Materials whose mask carries no information.
    maskless: Vec<String>,
    /// Reasons why masks cannot be read.
    unread: Vec<String>,
    budget: &'a mut TextureBudget,
    unknown: Vec<String>,
}

impl<'a> ObjMaterials<'a> {
    fn read(
        path: &'a Path,
        file: &Statements,
        options: &FileOptions,
        budget: &'a mut TextureBudget,
        scene: &mut RawScene,
    ) -> Result<Self> {
        let folder = path.parent().unwrap_or(Path::new(""));
        let files = Files { folder, allow_outside: options.allow_outside_paths };
        let mut entries = HashMap::new();
        let (mut read, mut missing) = (HashSet::new(), Vec::new());
        for names in file.libraries.iter() {
            let libraries = files.libraries(path, names).map_err(|message| Error::parse(path, "mtllib", message))?;
            for (name, library) in libraries {
                match library {
                    // Many names may refer to one file.
                    Some(library) => {
                        if read.insert(fs::canonicalize(&library).unwrap_or(library.clone())) {
                            mtl::read(&library, &mut entries)?;
                        }
                    }
                    None => missing.push(name),
                }
            }
        }
        if !missing.is_empty() {
            let missing = shown::some_of(&missing);
            scene.report.warn(format!("{}: material files not found: {missing}", shown::path(path)));
        }
        let (chosen, textures, masks) = (HashMap::new(), HashMap::new(), HashMap::new());
        Ok(ObjMaterials {
            files,
            entries,
            chosen,
            textures,
            masks,
            maskless: Vec::new(),
            unread: Vec::new(),
            budget,
            unknown: Vec::new(),
        })
    }

    /// The scene's material for the `usemtl` name `number`.
    fn choose(&mut self, file: &Statements, number: usize, scene: &mut RawScene) -> Result<Option<Arc<Material>>> {
        if number == 0 {
            return Ok(None);
        }
        if let Some(known) = self.chosen.get(&number) {
            return Ok(Some(known.clone()));
        }
        let name = &file.materials.list[number];
        let material = match self.entries.remove(name) {
            Some(mtl::MtlMaterial { fault: Some(error), .. }) => return Err(error),
            Some(entry) => {
                let base_color_texture = entry.map.map(|map| self.texture(&map)).transpose()?;
                let mut material = entry.material.base_color_texture(base_color_texture);
                match &entry.mask {
                    Some(mask) => self.mask(&mut material, mask)?,
                    None => material.let_through(),
                }
                material
            }
            None => {
                self.unknown.push(name.clone());
                Material::default().name(name.clone())
            }
        };
        let material = Arc::new(material);
        scene.materials.push(material.clone());
        self.chosen.insert(number, material.clone());
        Ok(Some(material))
    }

    /// A reference to an image, which is read when first needed.
    fn texture(&mut self, map: &mtl::TextureMap) -> Result<TextureRef> {
        let path = map.path(self.files)?;
        let texture = match self.textures.entry(fs::canonicalize(&path).unwrap_or(path.clone())) {
            Entry::Occupied(known) => known.get().clone(),
            Entry::Vacant(new) => {
                let bytes = read::bytes(&path, Limit::IMAGE)?;
                let image = Texture::decode(&bytes, &shown::path(&path), self.budget)?;
                new.insert(Arc::new(image)).clone()
            }
        };
        let wrap = if map.clamp { Wrap::ClampToEdge } else { Wrap::Repeat };
        let ([su, sv], [ou, ov]) = (map.scale, map.offset);
        // v is 0 at the bottom of the image in OBJ, at the top in echocast.
        let transform = [[su, 0.0, ou], [0.0, -sv, 1.0 - ov]];
        Ok(TextureRef::plain(texture).wrap_u(wrap).wrap_v(wrap).transform(transform))
    }

    /// Applies `mask` to `material`.
    fn mask(&mut self, material: &mut Material, mask: &mtl::Mask) -> Result<()> {
        let image = match self.texture(&mask.map) {
            Ok(image) => image,
            Err(error) => {
                self.unread.push(error.to_string());
                material.let_through();
                return Ok(());
            }
        };
        let of_color =
            material.base_color_texture.as_ref().is_some_and(|color| Arc::ptr_eq(&color.texture, &image.texture));
        let channel = match mask.channel {
            Some(channel) => channel,
            None if !image.texture.opaque => Channel::Alpha,
            // The colours of a surface are not its mask.
            None if of_color => {
                self.maskless.push(material.name.clone());
                material.let_through();
                return Ok(());
            }
            None => Channel::Luminance,
        };
        let key = (Arc::as_ptr(&image.texture), channel);
        let texture = match self.masks.get(&key) {
            Some(known) => known.clone(),
            None => {
                let made = Arc::new(image.texture.as_mask(channel, &mask.map.file, self.budget)?);
                self.masks.insert(key, made.clone());
                made
            }
        };
        material.mask(image.texture(texture));
        Ok(())
    }

    fn warn(&self, path: &Path, scene: &mut RawScene) {
        let path = shown::path(path);
        if !self.unread.is_empty() {
            scene.report.warn(format!(
                "{path}: masks (map_d) that cannot be read are left out: {}",
                shown::some_of(&self.unread)
            ));
        }
        if !self.maskless.is_empty() {
            let names = shown::some_of(&self.maskless);
            scene
                .report
                .warn(format!("{path}: a map_d that is the image of map_Kd and has no alpha is not used: {names}"));
        }
        if !self.unknown.is_empty() {
            let unknown = shown::some_of(&self.unknown);
            scene.report.warn(format!("{path}: materials without definition are taken as white: {unknown}"));
        }
        // Those in use have been removed.
        let mut faults: Vec<_> =
            self.entries.values().filter_map(|entry| Some(entry.fault.as_ref()?.to_string())).collect();
        faults.sort();
        if !faults.is_empty() {
            scene.report.warn(format!("{path}: unused materials are faulty: {}", shown::some_of(&faults)));
        }
    }
}
