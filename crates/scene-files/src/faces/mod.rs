//! Polygons as read from files, and the parts built from them.

mod parts;
pub(super) mod polygon;

use ground::shown;
use model::RawScene;
pub(super) use parts::PartMaker;
use std::ops::Range;
use std::path::Path;

/// Index of a face corner without texture coordinate or normal.
pub(super) const NONE: u32 = u32::MAX;

/// Polygons with the indices of their corners.
#[derive(Default)]
pub(super) struct Faces {
    /// File units.
    pub positions: Vec<[f64; 3]>,
    /// v upwards.
    pub texcoords: Vec<[f32; 2]>,
    /// Of unit length; zero for normals without a direction.
    pub normals: Vec<[f32; 3]>,
    /// Corners of all faces.
    pub corners: Vec<Corner>,
    /// End in `corners` of each face, which has three corners or more and starts at the end of the previous one.
    pub face_ends: Vec<usize>,
}

/// A face corner: indices from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Corner {
    /// Index into [`Faces::positions`], in range.
    pub position: u32,
    /// Index into [`Faces::texcoords`]; out of range where there is none.
    pub texcoord: u32,
    /// Index into [`Faces::normals`]; out of range where there is none.
    pub normal: u32,
}

impl Faces {
    /// Checks that 32 bits suffice to count the vertices of the parts: a corner can become three, as it may start three
    /// triangles.
    pub fn check_size(&self) -> Result<(), String> {
        const MOST: usize = NONE as usize / 3;
        for (count, what) in [(self.positions.len(), "vertices"), (self.corners.len(), "face corners")] {
            if count > MOST {
                return Err(format!("the file holds {count} {what}; allowed: {MOST}"));
            }
        }
        Ok(())
    }

    /// Corners of each face of `run`.
    pub fn of(&self, run: &Range<usize>) -> impl Iterator<Item = &[Corner]> {
        let mut start = if run.start == 0 { 0 } else { self.face_ends[run.start - 1] };
        self.face_ends[run.clone()].iter().map(move |&end| &self.corners[std::mem::replace(&mut start, end)..end])
    }
}

impl PartMaker<'_> {
    /// Adds warnings about what was left out to `scene`, read from `path`.
    pub fn report_to(&self, path: &Path, scene: &mut RawScene) {
        scene.degenerate_triangles = self.degenerate_triangles;
        for (number, what, fate) in [
            (self.degenerate_triangles, "triangle", "without area left out"),
            (self.tangled_polygons, "polygon", "crossing itself or folded: the triangles there are a guess"),
        ] {
            if number > 0 {
                scene.report.warn(format!("{}: {} {fate}", shown::path(path), shown::count(number, what)));
            }
        }
    }
}
