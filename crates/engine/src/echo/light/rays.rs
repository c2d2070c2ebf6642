//! Hits of the rays of a block's beams, and which rays belong to which beam.

use crate::trace::HitBatch;
use ground::lanes::{LANES, MISS};

/// Distance from a plane that counts as off it, in sigmas of the pulse.
pub(crate) const OFF_SURFACE: f32 = 0.1;

/// Hits of [`LANES`] rays.
pub(crate) struct Batch {
    pub hits: HitBatch,
    pub cos_incidence: [f32; LANES],
    /// What each adds to the signal, `rho_eff / R^2` in 1/m^2, including its share of the beam; 0 for nothing.
    pub power: [f32; LANES],
    /// Offset of its plane along its normal, m; only if beams are packed.
    pub offset: [f32; LANES],
}

/// The rays of a block's beams.
///
/// If all beams of a block are several rays, batch `i` has ray `i` of every beam, in the beam's lane: all lanes are
/// processed at once. If only some are, beams are packed, ray after ray and beam after beam: batches are full, and the
/// rays of a beam, which mostly hit the same surface, are traced together.
#[derive(Default)]
pub(crate) struct BeamRays {
    pub batches: Vec<Batch>,
    /// Rays per beam.
    pub each: usize,
    /// Whether beams are packed, ray after ray and beam after beam.
    pub packed: bool,
}

/// Hit of one ray.
#[derive(Clone, Copy)]
pub(crate) struct Met<'a> {
    pub batch: &'a Batch,
    pub lane: usize,
}

impl Batch {
    pub fn new() -> Self {
        Batch { hits: HitBatch::new(), cos_incidence: [0.0; LANES], power: [0.0; LANES], offset: [0.0; LANES] }
    }
}

impl Met<'_> {
    /// Whether `other` is on the same plane of the same surface, to within `off` m.
    pub(crate) fn is_beside(&self, other: &Met, off: f32) -> bool {
        /// Cosine of an angle of 0.06 degrees, within which all of a footprint is on one plane.
        const PARALLEL: f32 = 1.0 - 5e-7;
        self.surface() == other.surface()
            && (self.batch.offset[self.lane] - other.batch.offset[other.lane]).abs() <= off
            && self.batch.hits.normal(self.lane).dot(other.batch.hits.normal(other.lane)) >= PARALLEL
    }

    /// Row of the surface, or [`MISS`].
    pub fn surface(&self) -> u32 {
        self.batch.hits.surface[self.lane]
    }

    pub fn range(&self) -> f32 {
        self.batch.hits.range[self.lane]
    }

    pub fn power(&self) -> f32 {
        self.batch.power[self.lane]
    }

    pub(crate) fn cos_incidence(&self) -> f32 {
        self.batch.cos_incidence[self.lane]
    }

    /// Range of the first surface, m.
    pub fn end(&self) -> f32 {
        if self.surface() == MISS { f32::INFINITY } else { self.range() }
    }
}

impl BeamRays {
    /// Makes room for `count` beams of `each` rays.
    pub fn fit(&mut self, each: usize, packed: bool, count: usize) {
        (self.each, self.packed) = (each, packed);
        let batches = if packed { count.div_ceil(self.beams_of_batch()) } else { each };
        if self.batches.len() < batches {
            self.batches.resize_with(batches, Batch::new);
        }
    }

    /// Beams per batch if beams are packed.
    pub(crate) fn beams_of_batch(&self) -> usize {
        LANES / self.each
    }

    /// Batch and lane of the first ray of the beam at `lane`, and the steps to the next ones.
    fn start(&self, lane: usize) -> ([usize; 2], [usize; 2]) {
        if self.packed {
            let beams = self.beams_of_batch();
            ([lane / beams, lane % beams * self.each], [0, 1])
        } else {
            ([0, lane], [1, 0])
        }
    }

    /// Ray `index` of the beam at `lane`, if it exists.
    pub fn get(&self, index: u32, lane: usize) -> Option<Met<'_>> {
        let index = index as usize;
        let ([batch, lane], [batches, lanes]) = self.start(lane);
        (index < self.each).then(|| Met { batch: &self.batches[batch + index * batches], lane: lane + index * lanes })
    }

    /// All rays of the beam at `lane`, in order.
    pub(crate) fn of_beam(&self, lane: usize) -> impl Iterator<Item = Met<'_>> {
        let ([batch, lane], [batches, lanes]) = self.start(lane);
        (0..self.each)
            .map(move |index| Met { batch: &self.batches[batch + index * batches], lane: lane + index * lanes })
    }
}
