//! Step 8 for instruments with blooming: the light of bright surfaces in the beams around them.

use crate::detect::Blooming;
use crate::echo::Provenance;
use emitter::BeamTable;
use glam::Vec3;
use ground::lanes::LANES;
use std::cell::Cell;

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
    pub beam: u32,
    /// Direction of the beam, sensor frame.
    pub direction: Vec3,
    pub range: f32,
    /// Returned light, `rho_eff T / R^2` in 1/m^2.
    pub power: f32,
    pub provenance: Provenance,
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
    /// No bright surfaces, in the memory that an earlier scan of this thread left.
    pub fn none() -> Vec<Bright> {
        let mut bright = FOUND.try_with(Cell::take).unwrap_or_default();
        bright.clear();
        bright
    }

    /// The halos of `bright` surfaces. `just_detected`: light that is just detected, `rho_eff / R^2` in 1/m^2; `sigma`:
    /// standard deviation of the pulse, m.
    pub fn new(mut bright: Vec<Bright>, blooming: Blooming, just_detected: f32, sigma: f64) -> Halos {
        bright.sort_unstable_by(|a, b| a.range.total_cmp(&b.range).then(a.beam.cmp(&b.beam)));
        Halos { blooming, least: FAINT * just_detected, together: TOGETHER * sigma as f32, bright }
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
