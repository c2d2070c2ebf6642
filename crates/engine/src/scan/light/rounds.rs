//! What is known of beams of as many rays as it takes before and while these are sent in rounds.

use crate::echo::{Contribution, MOST_EXPECTED};
use crate::trace::HitBatch;
use emitter::SubRayFan;
use ground::lanes::{LANES, MISS, RayBatch, boxed};

/// What hits around the axis of a beam show: surfaces and their triangles.
#[derive(Clone, Copy, Default)]
pub(super) struct Evidence {
    seen: [(u32, u32); Evidence::MOST],
    count: usize,
}

/// Buffers to send rays in rounds.
#[derive(Default)]
pub(super) struct Rounds {
    /// The rays of all points of each beam.
    pub fans: Vec<SubRayFan>,
    /// The lanes of the beams that go on.
    pub active: Vec<u8>,
    /// Those rays from whose surfaces light continues.
    pub going_on: Vec<Box<GoingOn>>,
    /// How many of these are in use.
    pub kept: usize,
    /// Beams whose last round showed something new.
    pub news: Vec<bool>,
    /// Beams for which rays that meet the same surface may differ: light continues from it, or it has holes.
    pub divided: Vec<bool>,
}

/// Rays from whose surfaces light continues.
pub(super) struct GoingOn {
    pub rays: RayBatch,
    pub hits: HitBatch,
    pub surfaces: Contribution,
    /// Lane of the beam, and number of the patch.
    pub beams: [u8; LANES],
    pub patches: [u32; LANES],
    pub count: usize,
}

impl Default for GoingOn {
    fn default() -> Self {
        GoingOn {
            rays: RayBatch::default(),
            hits: HitBatch::new(),
            surfaces: Contribution::new(),
            beams: [0; LANES],
            patches: [0; LANES],
            count: 0,
        }
    }
}

impl Evidence {
    const MOST: usize = MOST_EXPECTED;

    /// The surfaces and triangles.
    pub fn seen(&self) -> &[(u32, u32)] {
        &self.seen[..self.count]
    }

    /// Adds a `triangle` of a `surface`.
    pub fn add(&mut self, surface: u32, triangle: u32) {
        let known = &self.seen[..self.count];
        if surface != MISS && self.count < Evidence::MOST && !known.contains(&(surface, triangle)) {
            self.seen[self.count] = (surface, triangle);
            self.count += 1;
        }
    }
}

impl Rounds {
    /// The rays of all points of the beam at `lane`.
    pub fn fan(&self, lane: usize) -> &SubRayFan {
        &self.fans[lane]
    }

    /// Keeps the ray at `lane`, of the `beam` at that lane; returns block and lane.
    pub fn keep(
        &mut self,
        rays: &RayBatch,
        hits: &HitBatch,
        surfaces: &Contribution,
        lane: usize,
        beam: u8,
    ) -> (usize, usize) {
        if self.kept == 0 || self.going_on[self.kept - 1].count == LANES {
            if self.going_on.len() == self.kept {
                self.going_on.push(boxed());
            }
            self.going_on[self.kept].count = 0;
            self.kept += 1;
        }
        let kept = &mut self.going_on[self.kept - 1];
        let to = kept.count;
        kept.rays.fill(to..to + 1, rays, lane);
        kept.hits.take(to, hits, lane);
        kept.surfaces.take(to, surfaces, lane);
        kept.beams[to] = beam;
        kept.count += 1;
        (self.kept - 1, to)
    }
}
