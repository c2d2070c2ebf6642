//! PLY meshes, as text or binary.
//!
//! The format is that of "The PLY Polygon File Format" (Turk, Stanford 1994), read as scanner software, editors and
//! data sets write it.

mod rows;
mod values;

use super::FileOptions;
use super::faces::PartMaker;
use super::obj::Files;
use ground::error::{Error, Result};
use ground::read::ply::{Encoding, PlyHeader};
use ground::read::{self, Limit};
use ground::shown;
use model::material::{Material, Texture, TextureBudget, TextureRef, linear_from_srgb};
use model::{Mesh, RawObject, RawScene};
use rows::{Key, PlyLabels, PlyRows};
use std::collections::{HashMap, HashSet};
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;
use values::{Binary, PlyText};

/// Most objects that the labels of a file may create.
const MOST_OBJECTS: usize = 100_000;

/// Reads the PLY file at `path` and the images that it names.
///
/// The result is one object, named after the file, or one for each pair of labels that its faces or vertices carry.
///
/// # Errors
/// A file that cannot be read or ends too early; no faces; a vertex that does not exist or is not finite; a damaged
/// image. A missing image is a warning.
pub(super) fn read(path: &Path, options: &FileOptions, images: &mut TextureBudget) -> Result<RawScene> {
    options.check_units()?;
    let bytes = read::bytes(path, Limit::SCENE)?;
    let header =
        PlyHeader::parse(&bytes).map_err(|(line, message)| Error::parse(path, format!("line {line}"), message))?;
    let body = &bytes[header.length..];
    let mut rows = match header.encoding {
        Encoding::Text => rows::read(path, &header, PlyText { bytes: body, at: 0, line: header.lines + 1 }),
        Encoding::Little => rows::read(path, &header, Binary::<false> { bytes: body }),
        Encoding::Big => rows::read(path, &header, Binary::<true> { bytes: body }),
    }?;
    let mut scene = RawScene::default();
    if rows.small > 0 {
        let faces = shown::count(rows.small, "face");
        scene.report.warn(format!("{}: {faces} with fewer than 3 corners skipped", shown::path(path)));
    }
    let known: HashSet<PlyLabels> = rows.keys.iter().map(|key| key.labels).collect();
    if known.len() > MOST_OBJECTS {
        let message = format!("{} labels are not used; allowed: {MOST_OBJECTS}", known.len());
        scene.report.warn(format!("{}: {message}", shown::path(path)));
        rows.keys.iter_mut().for_each(|key| key.labels = PlyLabels::default());
    }
    let textures = textures(path, &header, options, images, &mut scene)?;
    let objects = objects(path, &rows, &textures, options, &mut scene);
    Ok(RawScene { objects, ..scene })
}

/// The images that the file names; `None` for missing ones.
fn textures(
    path: &Path,
    header: &PlyHeader,
    options: &FileOptions,
    images: &mut TextureBudget,
    scene: &mut RawScene,
) -> Result<Vec<Option<Arc<Texture>>>> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let files = Files { folder, allow_outside: options.allow_outside_paths };
    let mut known: HashMap<&str, Option<Arc<Texture>>> = HashMap::new();
    for name in &header.textures {
        if known.contains_key(name.as_str()) {
            continue;
        }
        let found = files.find(path, name).map_err(|message| Error::parse(path, "TextureFile", message))?;
        let texture = match found {
            Some(file) => {
                let bytes = read::bytes(&file, Limit::IMAGE)?;
                Some(Arc::new(Texture::decode(&bytes, &shown::path(&file), images)?))
            }
            None => {
                scene.report.warn(format!("{}: there is no image {:?}", shown::path(path), shown::name(name)));
                None
            }
        };
        known.insert(name, texture);
    }
    Ok(header.textures.iter().map(|name| known[name.as_str()].clone()).collect())
}

/// The objects of a file.
fn objects(
    path: &Path,
    rows: &PlyRows,
    textures: &[Option<Arc<Texture>>],
    options: &FileOptions,
    scene: &mut RawScene,
) -> Vec<RawObject> {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let mut runs = runs(rows);
    runs.sort_by_key(|(key, _)| *key);
    let mut maker = PartMaker::new(&rows.faces, options.keeps_sources);
    let mut materials = PlyMaterials { textures, known: HashMap::new(), varies: false };
    let mut objects = Vec::new();
    for runs in runs.chunk_by(|(a, _), (b, _)| a.labels == b.labels) {
        let faces: Vec<Range<usize>> = runs.iter().map(|(_, faces)| faces.clone()).collect();
        let middle = maker.middle(&faces);
        let mut parts = Vec::new();
        for runs in runs.chunk_by(|(a, _), (b, _)| a == b) {
            let faces: Vec<Range<usize>> = runs.iter().map(|(_, faces)| faces.clone()).collect();
            let material = materials.choose(rows, &faces, runs[0].0.texture, scene);
            let textured = material.as_ref().is_some_and(|material| material.base_color_texture.is_some());
            parts.extend(maker.part(&faces, middle, textured).map(|part| part.material(material)));
        }
        if parts.is_empty() {
            continue;
        }
        let [category, instance] = runs[0].0.labels;
        let mut name = stem.to_string();
        for label in [category, instance].into_iter().flatten() {
            name += &format!("_{label}");
        }
        objects.push(RawObject {
            name: name.clone(),
            mesh: Arc::new(Mesh::trusted(name, parts).with_source(maker.source(middle))),
            world_from_object: options.world_from_mesh(middle),
            up: options.up,
            category: category.map(|category| category.to_string()),
            part: None,
            motion: None,
            ancestors: Arc::default(),
            has_node: false,
        });
    }
    if materials.varies {
        let what = "vertex colours that change over a mesh are not used";
        scene.report.warn(format!("{}: {what}", shown::path(path)));
    }
    maker.report_to(path, scene);
    objects
}

/// Runs of consecutive faces with the same key.
fn runs(rows: &PlyRows) -> Vec<(Key, Range<usize>)> {
    if rows.keys.is_empty() {
        return vec![(Key::default(), 0..rows.faces.face_ends.len())];
    }
    let mut start = 0;
    let run = |keys: &[Key]| {
        let faces = start..start + keys.len();
        start = faces.end;
        (keys[0], faces)
    };
    rows.keys.chunk_by(|a, b| a == b).map(run).collect()
}

/// Materials made from images and colours.
struct PlyMaterials<'a> {
    textures: &'a [Option<Arc<Texture>>],
    /// By image number and bits of the colour.
    known: HashMap<(u32, [u32; 4]), Arc<Material>>,
    /// Whether a mesh with varying colours was found.
    varies: bool,
}

impl PlyMaterials<'_> {
    /// The material of `faces`; `None` if the file specifies none.
    fn choose(
        &mut self,
        rows: &PlyRows,
        faces: &[Range<usize>],
        image: u32,
        scene: &mut RawScene,
    ) -> Option<Arc<Material>> {
        let texture = self.textures.get(image as usize).cloned().flatten();
        let texture = texture.filter(|_| !rows.faces.texcoords.is_empty());
        // Colours given in addition to an image repeat what it shows.
        let color = if texture.is_none() { self.color(rows, faces) } else { None };
        if texture.is_none() && color.is_none() {
            return None;
        }
        let color = color.unwrap_or([1.0; 4]);
        let key = (if texture.is_some() { image } else { u32::MAX }, color.map(f32::to_bits));
        let known = self.known.entry(key).or_insert_with(|| {
            // v is 0 at the bottom of the image in PLY, at the top in echocast.
            let upright = |image| TextureRef::plain(image).transform([[1.0, 0.0, 0.0], [0.0, -1.0, 1.0]]);
            let material = Arc::new(Material::default().base_color(color).base_color_texture(texture.map(upright)));
            scene.materials.push(material.clone());
            material
        });
        Some(known.clone())
    }

    /// The linear colour that all corners of `faces` share.
    fn color(&mut self, rows: &PlyRows, faces: &[Range<usize>]) -> Option<[f32; 4]> {
        if rows.colors.is_empty() {
            return None;
        }
        let mut corners = faces.iter().flat_map(|run| rows.faces.of(run)).flatten();
        let first = rows.colors[corners.next()?.position as usize];
        if corners.any(|corner| rows.colors[corner.position as usize] != first) {
            self.varies = true;
            return None;
        }
        let [r, g, b, a] = first;
        let [r, g, b] = [r, g, b].map(linear_from_srgb);
        Some([r, g, b, a])
    }
}
