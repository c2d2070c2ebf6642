//! Files that samples share: models and images.

use super::lock;
use super::room::{MeshTrees, Solid};
use engine::scene::{LabelRules, LoadOptions, Scene};
use glam::DMat3;
use ground::error::{Error, Result};
use ground::read::{self, Limit};
use ground::shown;
use model::material::{Texture, TextureBudget, TextureRef};
use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

/// A model file that is placed in scenes.
#[derive(Debug)]
pub(super) struct ModelFile {
    pub path: PathBuf,
    pub scene: Scene,
    /// Bounding box of the whole model in its file's coordinates, along the file's axes.
    pub solid: Solid,
    /// Approximate memory use, bytes.
    bytes: usize,
}

/// Files read so far. Models are kept until they take more than [`MOST_BYTES`]; then those that no sample uses are
/// dropped, and read again when needed.
#[derive(Debug, Default)]
pub(super) struct Assets {
    models: Mutex<HashMap<PathBuf, Arc<ModelFile>>>,
    images: Mutex<HashMap<PathBuf, TextureRef>>,
    pub room: MeshTrees,
}

/// Maximum memory for models and, roughly, for what is built from them, bytes.
const MOST_BYTES: usize = 2 << 30;

/// Maximum memory for an image, MiB.
const MOST_IMAGE_MIB: u64 = 1024;

impl Assets {
    /// The model in the file `path`.
    ///
    /// # Errors
    /// As [`Scene::load`].
    pub fn model(&self, path: &Path, labels: &LabelRules) -> Result<Arc<ModelFile>> {
        if let Some(known) = lock(&self.models).get(path) {
            return Ok(known.clone());
        }
        // Read without holding the lock: other samples need other models.
        let options = LoadOptions::default().labels(labels.clone());
        let scene = Scene::load_with(path, &options)?;
        let solid = Solid::around(DMat3::IDENTITY, scene.world_points())
            .ok_or_else(|| Error::parse(path, "", "holds no mesh"))?;
        let bytes = scene.meshes().iter().map(|mesh| mesh.bytes()).sum();
        let model = Arc::new(ModelFile { path: path.to_owned(), scene, solid, bytes });
        let mut models = lock(&self.models);
        let kept: usize = models.values().map(|model| model.bytes).sum();
        if kept + bytes > MOST_BYTES {
            models.retain(|_, model| Arc::strong_count(model) > 1);
            self.room.forget_unused();
        }
        Ok(models.entry(path.to_owned()).or_insert(model).clone())
    }

    /// The image in the file `path`.
    ///
    /// # Errors
    /// A missing file; a file that is not an image of a known format.
    pub fn image(&self, path: &Path) -> Result<TextureRef> {
        if let Some(known) = lock(&self.images).get(path) {
            return Ok(known.clone());
        }
        let bytes = read::bytes(path, Limit::SCENE)?;
        let texture = Texture::decode(&bytes, &shown::path(path), &mut TextureBudget::new(MOST_IMAGE_MIB))?;
        Ok(lock(&self.images).entry(path.to_owned()).or_insert(TextureRef::plain(Arc::new(texture))).clone())
    }
}

/// The files that `models` names, relative to `folder`, with their weights; the files of a folder share its weight.
///
/// # Errors
/// A missing file, a folder without models. `key` names the rule.
pub(super) fn files(models: &[(PathBuf, f64)], folder: &Path, key: &str) -> Result<Vec<(PathBuf, f64)>> {
    let mut all = Vec::new();
    for (name, weight) in models {
        let path = folder.join(name);
        let failed = |source| Error::Io { path: path.clone(), source };
        if !fs::metadata(&path).map_err(failed)?.is_dir() {
            all.push((path, *weight));
            continue;
        }
        let entries = fs::read_dir(&path).map_err(failed)?;
        let mut files: Vec<PathBuf> =
            entries.map(|entry| entry.map(|entry| entry.path())).collect::<Result<_, _>>().map_err(failed)?;
        files.retain(|file| scene_files::is_readable(file));
        // Directory listings have no defined order.
        files.sort();
        if files.is_empty() {
            let found = format!("{}, a folder without models", shown::path(&path));
            return Err(Error::invalid(key, found, format!("folders with files of {}", scene_files::extensions())));
        }
        let each = weight / files.len() as f64;
        all.extend(files.into_iter().map(|file| (file, each)));
    }
    Ok(all)
}
