//! Step 8 for instruments with blooming: the light of bright surfaces in the beams around them.

use super::block::{Block, with_block};
use super::run::ScanPlan;
use crate::detect::Blooming;
use crate::emitter::BeamTable;
use crate::ground::lanes::{CHUNK, LANES, MISS};
use crate::ground::parallel;
use glam::Vec3;
use std::cell::Cell;
use std::ops::Range;
use std::sync::{Mutex, PoisonError};

/// Effective reflectance above which a surface is bright: brighter than white.
const BRIGHT: f32 = 1.0;

/// Light below this fraction of what is just detected is negligible.
const FAINT: f32 = 1e-3;

/// Bright points are merged while their ranges differ by less, in sigmas of the pulse.
const TOGETHER: f32 = 0.1;

/// The bright surfaces that the beams of a scan hit.
pub(super) struct Halos {
    blooming: Blooming,
    /// Light below which nothing is added, as `rho_eff / R^2` in 1/m^2.
    least: f32,
    /// Difference in range up to which they are merged, m.
    together: f32,
    /// In order of range.
    bright: Vec<Bright>,
}

thread_local! {
    /// Buffer for the bright surfaces of scans that this thread starts.
    static FOUND: Cell<Vec<Bright>> = const { Cell::new(Vec::new()) };
}

impl Drop for Halos {
    fn drop(&mut self) {
        // A thread at its end has none any more.
        let _ = FOUND.try_with(|memory| memory.set(std::mem::take(&mut self.bright)));
    }
}

/// A bright surface where the centre of a beam hits it.
#[derive(Clone, Copy)]
pub(super) struct Bright {
    beam: u32,
    /// Direction of the beam, sensor frame.
    direction: Vec3,
    pub range: f32,
    /// Returned light, `rho_eff T / R^2` in 1/m^2.
    pub power: f32,
    pub cos_incidence: f32,
    pub surface: u32,
    pub triangle: u32,
    pub uv: [f32; 2],
    pub normal: Vec3,
}

/// Light of neighbouring bright points in one beam.
#[derive(Clone, Copy)]
struct HaloCluster {
    /// Range of the nearest of them, m.
    from: f32,
    power: f32,
    /// Sum of range times power.
    moment: f32,
    /// Index of the strongest, and its power.
    strongest: usize,
    most: f32,
}

impl HaloCluster {
    const NONE: HaloCluster = HaloCluster { from: f32::NEG_INFINITY, power: 0.0, moment: 0.0, strongest: 0, most: 0.0 };
}

impl Halos {
    /// Traces the centres of all beams of `scan`, whose pulse has the standard deviation `sigma` m of range. What is
    /// bright only in a mirror or through glass does not bloom.
    pub fn new(scan: &ScanPlan, blooming: Blooming, sigma: f64) -> Halos {
        let least = FAINT * scan.detect.threshold.faintest();
        let mut bright = FOUND.try_with(Cell::take).unwrap_or_default();
        bright.clear();
        let all = Mutex::new(bright);
        scan.world.scene.engine.install(|| {
            parallel::for_each_range(scan.aim.beams.len(), CHUNK, |beams| {
                with_block(scan, |block| find(scan, block, beams, &all));
            });
        });
        let mut bright = all.into_inner().unwrap_or_else(PoisonError::into_inner);
        bright.sort_unstable_by(|a, b| a.range.total_cmp(&b.range).then(a.beam.cmp(&b.beam)));
        Halos { blooming, least, together: TOGETHER * sigma as f32, bright }
    }

    /// Reports the light of bright surfaces in `beams` of `table`: lane, and the surface that contributes most of it,
    /// with the range and the light, `rho_eff T / R^2` in 1/m^2, of all that are near it in range.
    pub fn shine(&self, table: &BeamTable, beams: &[u32], mut report: impl FnMut(usize, Bright)) {
        let direction = |lane: usize| table.direction(beams[lane] as usize);
        let middle = (0..beams.len()).map(direction).sum::<Vec3>().normalize_or(Vec3::X);
        let widest = (0..beams.len()).map(|lane| angle(direction(lane), middle)).fold(0.0, f32::max);
        let mut groups = [HaloCluster::NONE; LANES];
        let mut finish = |lane: usize, group: &HaloCluster| {
            if group.power > self.least {
                let range = group.moment / group.power;
                report(lane, Bright { range, power: group.power, ..self.bright[group.strongest] });
            }
        };
        // The light of all of them may add up.
        let least = self.least / self.bright.len() as f32;
        for (index, bright) in self.bright.iter().enumerate() {
            if angle(bright.direction, middle) > widest + self.blooming.reach(least / bright.power) {
                continue;
            }
            for (lane, group) in groups[..beams.len()].iter_mut().enumerate() {
                if bright.range - group.from > self.together {
                    finish(lane, group);
                    *group = HaloCluster { from: bright.range, ..HaloCluster::NONE };
                }
                if beams[lane] != bright.beam {
                    let power = bright.power * self.blooming.part(angle(direction(lane), bright.direction));
                    group.power += power;
                    group.moment += power * bright.range;
                    if power > group.most {
                        (group.strongest, group.most) = (index, power);
                    }
                }
            }
        }
        groups[..beams.len()].iter().enumerate().for_each(|(lane, group)| finish(lane, group));
    }
}

/// Angle between two directions, rad, from its chord by the series of the arcsine: accurate to 1e-7 up to 10 degrees,
/// 0.3 % at 90.
fn angle(a: Vec3, b: Vec3) -> f32 {
    let square = (a - b).length_squared();
    square.sqrt() * (1.0 + square * (1.0 / 24.0 + square * (3.0 / 640.0 + square * (5.0 / 7168.0))))
}

/// Adds the bright surfaces that `beams` hit to `all`.
fn find(scan: &ScanPlan, block: &mut Block, beams: Range<usize>, all: &Mutex<Vec<Bright>>) {
    for first in beams.clone().step_by(LANES) {
        let count = LANES.min(beams.end - first);
        block.lanes.start_at(first);
        block.aim(scan, first, count);
        block.trace(scan, count);
        let Block { rays, hits, surfaces, scratch, .. } = &mut *block;
        scratch.fill(1.0);
        if let Some(air) = scan.world.air {
            air.dim(rays, &hits.range, count, scratch);
        }
        let mut found = None;
        for lane in 0..count {
            let (surface, range) = (hits.surface[lane], hits.range[lane]);
            let rho_eff = surfaces.reflectance[lane] * surfaces.cos_incidence[lane];
            let power = rho_eff * scratch[lane] / (range * range);
            if surface != MISS && rho_eff > BRIGHT && power.is_finite() && !scan.goes_on(surface) {
                // One thread at a time, for the rest of the block.
                let all = found.get_or_insert_with(|| all.lock().unwrap_or_else(PoisonError::into_inner));
                all.push(Bright {
                    beam: (first + lane) as u32,
                    direction: scan.aim.beams.direction(first + lane),
                    range,
                    power,
                    cos_incidence: surfaces.cos_incidence[lane],
                    surface,
                    triangle: hits.triangle[lane],
                    uv: [hits.u[lane], hits.v[lane]],
                    normal: hits.normal(lane),
                });
            }
        }
    }
}
