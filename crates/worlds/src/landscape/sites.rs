//! Where plants and rocks are, and which of the meshes of their kind each has.

use glam::DVec2;

/// Meshes of each kind of plant.
pub(super) const VARIANTS: usize = 3;
/// Meshes of rocks.
pub(super) const ROCKS: usize = 8;
/// Tufts of a patch of grass, and its radius, m.
pub(super) const TUFTS: usize = 24;
pub(super) const PATCH: f64 = 0.75;

/// The place of a plant or rock.
#[derive(Clone, Copy, Debug)]
pub(super) struct Site {
    pub at: DVec2,
    /// About the z axis.
    pub turn: f64,
    /// Scale of its mesh, or the size of a rock, m.
    pub size: f64,
    /// Kind of tree, or 0.
    pub kind: usize,
    /// Number among the meshes of its kind.
    pub variant: usize,
}

/// Positions of all plants and rocks.
pub(super) struct Sites {
    pub trees: Vec<Site>,
    pub bushes: Vec<Site>,
    pub rocks: Vec<Site>,
    pub grass: Vec<Site>,
}
