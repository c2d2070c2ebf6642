//! Hits of the rays of a block's beams, and which rays belong to which beam.

use super::patchwork::{Patch, Patchwork};
use crate::trace::HitBatch;
use emitter::{ROUND, SubRayFan};
use glam::Vec3;
use ground::lanes::{LANES, MISS};

/// Distance from a plane that counts as off it, in sigmas of the pulse.
pub(crate) const OFF_SURFACE: f32 = 0.1;

/// Most batches of the rays of patchworks: all but the last of each of five rounds have at least `LANES - 15` rays.
const MOST_BATCHES: usize = LANES * SubRayFan::MOST / (LANES - ROUND + 1) + 6;

/// Hits of [`LANES`] rays.
pub(crate) struct Batch {
    pub hits: HitBatch,
    pub cos_incidence: [f32; LANES],
    /// What each adds to the signal, `rho_eff / R^2` in 1/m^2, including its share of the beam; 0 for nothing.
    pub power: [f32; LANES],
}

/// The rays of a block's beams.
///
/// If all beams of a block are as many rays, batch `i` has ray `i` of every beam, in the beam's lane: all lanes are
/// processed at once. If only some beams are several rays, and those as many as it takes, each beam is a patchwork.
#[derive(Default)]
pub(crate) struct BeamRays {
    pub batches: Vec<Batch>,
    /// Rays per beam, or points of its footprint.
    pub each: usize,
    /// One for each beam, if they are patchworks.
    pub patchworks: Vec<Patchwork>,
    pub is_patched: bool,
}

/// Hit of one ray; the patch that it stands for, if its beam is a patchwork.
#[derive(Clone, Copy)]
pub(crate) struct Met<'a> {
    pub batch: &'a Batch,
    pub lane: usize,
    patch: Option<&'a Patch>,
}

impl Batch {
    pub fn new() -> Self {
        Batch { hits: HitBatch::new(), cos_incidence: [0.0; LANES], power: [0.0; LANES] }
    }
}

impl<'a> Met<'a> {
    /// Row of the surface, or [`MISS`].
    pub fn surface(&self) -> u32 {
        self.batch.hits.surface[self.lane]
    }

    /// Its mean range, m.
    pub fn range(&self) -> f32 {
        self.patch.map_or(self.batch.hits.range[self.lane], |patch| patch.range)
    }

    /// What it adds to the signal, `rho_eff / R^2` in 1/m^2.
    pub fn power(&self) -> f32 {
        self.patch.map_or(self.batch.power[self.lane], |patch| patch.power() * patch.points() as f32)
    }

    pub(crate) fn cos_incidence(&self) -> f32 {
        self.batch.cos_incidence[self.lane]
    }

    /// Range at which it ends, m.
    fn end(&self) -> f32 {
        if self.surface() == MISS { f32::INFINITY } else { self.range() }
    }

    /// Least and greatest range, m.
    pub fn ends(&self) -> [f32; 2] {
        self.patch.map_or([self.range(); 2], |patch| patch.ends)
    }

    /// How many rays, or points of the footprint, it stands for.
    pub fn points(&self) -> u32 {
        self.patch.map_or(1, Patch::points)
    }

    /// The middle of its points, if it stands for a patch.
    pub fn place(&self) -> Option<Vec3> {
        self.patch.map(|patch| patch.place)
    }
}

impl BeamRays {
    /// Makes room for beams of `each` rays.
    pub fn fit(&mut self, each: usize) {
        (self.each, self.is_patched) = (each, false);
        self.make_room(each);
    }

    /// Starts patchworks of beams of `each` points, one beam for each of the ranges `farthest`, m, beyond which nothing is
    /// traced.
    pub fn patch_up(&mut self, each: usize, farthest: &[f32]) {
        (self.each, self.is_patched) = (each, true);
        // For any block, so that later ones need no memory.
        self.patchworks.resize_with(LANES, Patchwork::default);
        self.make_room(MOST_BATCHES);
        self.patchworks.iter_mut().zip(farthest).for_each(|(patchwork, &farthest)| patchwork.start(each, farthest));
    }

    /// Makes room for as many batches.
    pub fn make_room(&mut self, batches: usize) {
        if self.batches.len() < batches {
            self.batches.resize_with(batches, Batch::new);
        }
    }

    /// Ray `index` of the beam at `lane`, or the ray that stands for its patch `index`.
    pub fn get(&self, index: u32, lane: usize) -> Option<Met<'_>> {
        if !self.is_patched {
            let batch = self.batches[..self.each].get(index as usize)?;
            return Some(Met { batch, lane, patch: None });
        }
        let patch = self.patchworks[lane].patches.get(index as usize)?;
        let (batch, lane) = patch.ray?;
        Some(Met { batch: &self.batches[batch as usize], lane: lane as usize, patch: Some(patch) })
    }

    /// Range of the farthest place that a ray of the beam at `lane` gets to, m.
    pub fn end(&self, lane: usize) -> f32 {
        if self.is_patched {
            return self.patchworks[lane].end();
        }
        self.of_beam(lane).map(|(_, met)| met.end()).fold(0.0, f32::max)
    }

    /// The part of the rays of the beam at `lane` that get beyond `range` m.
    pub fn part_beyond(&self, lane: usize, range: f32) -> f32 {
        let on = if self.is_patched {
            self.patchworks[lane].points_beyond(range)
        } else {
            self.of_beam(lane).filter(|(_, met)| met.end() > range).count() as u32
        };
        on as f32 / self.each as f32
    }

    /// Whether the beam at `lane` is a patchwork of several planes, more than `off` m apart, or surfaces.
    pub fn is_mixed(&self, lane: usize, off: f32) -> bool {
        self.is_patched && !self.patchworks[lane].is_one_plane(off)
    }

    /// The number of the first ray of the beam at `lane`.
    pub fn first_of(&self, lane: usize) -> u32 {
        self.of_beam(lane).next().map_or(0, |(ray, _)| ray)
    }

    /// All rays of the beam at `lane`, in order, or those that stand for its patches, and their numbers.
    pub(crate) fn of_beam(&self, lane: usize) -> impl Iterator<Item = (u32, Met<'_>)> + Clone {
        let count = if self.is_patched { self.patchworks[lane].patches.len() } else { self.each };
        (0..count as u32)
            .filter_map(move |index| Some((index, self.get(index, lane)?)))
            .filter(|(_, met)| met.points() > 0)
    }
}
