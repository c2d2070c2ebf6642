//! Files that samples share: models and images.

use super::lock;
use super::variation::{Models, Room, Solid};
use crate::ground::error::{Error, Result};
use crate::ground::shown;
use crate::material::{Texture, TextureBudget, TextureRef};
use crate::read::{self, Limit};
use crate::scene::{self, LabelRules, LoadOptions, Scene};
use glam::DMat3;
use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

/// A file that is placed in scenes.
#[derive(Debug)]
pub(super) struct Model {
    pub path: PathBuf,
    pub scene: Scene,
    /// Around all of it as it lies in its file, with the axes of that.
    pub solid: Solid,
    /// Memory that it takes, about.
    bytes: usize,
}

/// What has been read so far. Models are kept until they take more than [`MOST_BYTES`]; then those that no sample uses
/// are forgotten, and read again when they are needed.
#[derive(Debug, Default)]
pub(super) struct Assets {
    models: Mutex<HashMap<PathBuf, Arc<Model>>>,
    images: Mutex<HashMap<PathBuf, TextureRef>>,
    pub room: Room,
}

/// Most memory for models, and about what is made of them.
const MOST_BYTES: usize = 2 << 30;

/// Most memory for an image, MiB.
const MOST_IMAGE_MIB: u64 = 1024;

impl Assets {
    /// The model in the file `path`.
    ///
    /// # Errors
    /// As [`Scene::load`].
    pub fn model(&self, path: &Path, labels: &LabelRules) -> Result<Arc<Model>> {
        if let Some(known) = lock(&self.models).get(path) {
            return Ok(known.clone());
        }
        // Read without the lock: other samples need other models.
        let options = LoadOptions { labels: labels.clone(), ..LoadOptions::default() };
        let scene = Scene::load_with(path, &options)?;
        let solid = Solid::around(DMat3::IDENTITY, scene.world_points())
            .ok_or_else(|| Error::parse(path, "", "holds no mesh"))?;
        let bytes = scene.meshes().iter().map(|mesh| mesh.bytes()).sum();
        let model = Arc::new(Model { path: path.to_owned(), scene, solid, bytes });
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
    /// A missing file, one that is no image of a known format.
    pub fn image(&self, path: &Path) -> Result<TextureRef> {
        if let Some(known) = lock(&self.images).get(path) {
            return Ok(known.clone());
        }
        let bytes = read::bytes(path, Limit::SCENE)?;
        let texture = Texture::decode(&bytes, &shown::path(path), &mut TextureBudget::new(MOST_IMAGE_MIB))?;
        Ok(lock(&self.images).entry(path.to_owned()).or_insert(TextureRef::plain(Arc::new(texture))).clone())
    }
}

/// The files that `models` names, relative to `folder`; those of a folder share its weight.
///
/// # Errors
/// A missing file, a folder without models. `key` names the rule.
pub(super) fn files(models: &Models, folder: &Path, key: &str) -> Result<Vec<(PathBuf, f64)>> {
    let mut all = Vec::new();
    for (name, weight) in &models.0 {
        let path = folder.join(name);
        let failed = |source| Error::Io { path: path.clone(), source };
        if !fs::metadata(&path).map_err(failed)?.is_dir() {
            all.push((path, *weight));
            continue;
        }
        let entries = fs::read_dir(&path).map_err(failed)?;
        let mut files: Vec<PathBuf> =
            entries.map(|entry| entry.map(|entry| entry.path())).collect::<Result<_, _>>().map_err(failed)?;
        files.retain(|file| scene::is_scene(file));
        // Folders have no order of their own.
        files.sort();
        if files.is_empty() {
            let found = format!("{}, a folder without models", shown::path(&path));
            return Err(Error::invalid(key, found, format!("folders with files of {}", scene::extensions())));
        }
        let each = weight / files.len() as f64;
        all.extend(files.into_iter().map(|file| (file, each)));
    }
    Ok(all)
}
