//! Scenes made by rules and a seed, written as binary glTF.
//!
//! ```no_run
//! use echocast::generate::Seabed;
//!
//! Seabed { boulders: 50, ..Seabed::default() }.scene(7)?.write("lake.glb")?;
//! # Ok::<(), echocast::Error>(())
//! ```

mod bed;
mod glb;
mod noise;
mod seabed;
mod shapes;
#[cfg(test)]
mod tests;

pub use seabed::{Ripples, Seabed};

use crate::export::{self, Pending};
use crate::ground::error::Result;
use crate::scene::{LoadOptions, Scene};
use std::fmt;
use std::path::Path;

/// A generated scene: a complete binary glTF file in memory. Same parameters, same seed: the same bytes.
#[derive(Clone)]
pub struct GeneratedScene {
    /// Triangles, each mesh counted as often as it is placed.
    pub triangles: usize,
    /// Categories and how many objects each has.
    pub categories: Vec<(&'static str, usize)>,
    /// What was made, lines for people.
    pub details: Vec<String>,
    glb: Vec<u8>,
}

impl GeneratedScene {
    /// The file.
    pub fn bytes(&self) -> &[u8] {
        &self.glb
    }

    /// Writes the file, which appears under its name only when it is complete.
    ///
    /// # Errors
    /// The system's: a missing folder, a full disk.
    pub fn write(&self, path: impl AsRef<Path>) -> Result<()> {
        let pending = Pending::create(path.as_ref())?;
        export::write_bytes(pending.path(), &self.glb).map_err(|source| export::failed(path.as_ref(), source))?;
        pending.commit()
    }

    /// The scene, as [`Scene::load`] reads it from the written file.
    ///
    /// # Errors
    /// Rules in `options` that no label can follow.
    pub fn load(&self, options: &LoadOptions) -> Result<Scene> {
        Scene::from_glb_bytes(&self.glb, options)
    }
}

impl fmt::Debug for GeneratedScene {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let GeneratedScene { triangles, categories, details, glb } = self;
        let bytes = format_args!("{} bytes", glb.len());
        f.debug_struct("GeneratedScene")
            .field("triangles", triangles)
            .field("categories", categories)
            .field("details", details)
            .field("glb", &bytes)
            .finish()
    }
}
