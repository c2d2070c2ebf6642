//! Step 8 of instruments that bloom: the light of bright surfaces in the beams around them.

use super::block::Block;
use super::run::Scan;
use crate::detect::Blooming;
use crate::emitter::BeamTable;
use crate::parallel;
use crate::trace::{CHUNK, LANES, MISS};
use glam::Vec3;
use pulp::Arch;

/// Reflectance of what is called bright: whiter than white.
const BRIGHT: f32 = 1.0;

/// Part of what is just seen that adds nothing, though many of it come together.
const FAINT: f32 = 1e-3;

/// The bright surfaces that the beams of a scan meet.
pub(super) struct Halos {
    blooming: Blooming,
    /// Light below which nothing is added, as `rho_eff / R^2` in 1/m^2.
    least: f32,
    pub bright: Vec<Bright>,
}

/// A bright surface where a beam meets it.
pub(super) struct Bright {
    beam: u32,
    /// The beam's, in the sensor frame.
    direction: Vec3,
    pub range: f32,
    /// What comes back, `rho_eff T / R^2` in 1/m^2.
    power: f32,
    pub cos_incidence: f32,
    pub surface: u32,
    pub triangle: u32,
    pub uv: [f32; 2],
    pub normal: Vec3,
}

impl Halos {
    /// Looks along all beams of `scan`. What is bright in a mirror or through glass alone does not bloom.
    pub fn new(scan: &Scan, blooming: Blooming) -> Halos {
        let least = FAINT * scan.threshold.least_power().unwrap_or(0.0) as f32;
        let bright = scan.scene.engine.install(|| {
            let together = |mut some: Vec<Bright>, more: Vec<Bright>| {
                some.extend(more);
                some
            };
            parallel::map_reduce(scan.beams.len(), CHUNK, |beams| find(scan, beams), together)
        });
        Halos { blooming, least, bright }
    }

    /// Tells of the light of bright surfaces in `beams` of `table`: lane, surface, `rho_eff T / R^2` in 1/m^2.
    pub fn shine(&self, table: &BeamTable, beams: &[u32], mut tell: impl FnMut(usize, &Bright, f32)) {
        let direction = |lane: usize| table.direction(beams[lane] as usize);
        let middle = (0..beams.len()).map(direction).sum::<Vec3>().normalize_or(Vec3::X);
        let widest = (0..beams.len()).map(|lane| angle(direction(lane), middle)).fold(0.0, f32::max);
        for bright in &self.bright {
            let reach = self.blooming.reach(self.least / bright.power);
            if angle(bright.direction, middle) > widest + reach {
                continue;
            }
            for lane in (0..beams.len()).filter(|&lane| beams[lane] != bright.beam) {
                let power = bright.power * self.blooming.part(angle(direction(lane), bright.direction));
                if power > self.least {
                    tell(lane, bright, power);
                }
            }
        }
    }
}

/// Angle between two directions, rad; exact where it is small.
#[inline(always)]
fn angle(a: Vec3, b: Vec3) -> f32 {
    2.0 * (0.5 * (a - b).length()).min(1.0).asin()
}

/// The bright surfaces that `beams` meet.
fn find(scan: &Scan, beams: std::ops::Range<usize>) -> Vec<Bright> {
    let (mut block, mut found) = (Block::new(), Vec::new());
    for first in beams.clone().step_by(LANES) {
        let count = LANES.min(beams.end - first);
        block.lanes.start_at(first);
        Arch::new().dispatch(|| {
            block.aim(scan, first, count);
            block.trace(scan, count);
        });
        let Block { rays, hits, surfaces, scratch, .. } = &mut block;
        scratch.fill(1.0);
        if let Some(air) = &scan.air {
            air.dim(rays, &hits.range, count, scratch);
        }
        for lane in 0..count {
            let (surface, range) = (hits.surface[lane], hits.range[lane]);
            let rho_eff = surfaces.reflectance[lane] * surfaces.cos_incidence[lane];
            if surface != MISS && rho_eff > BRIGHT && !scan.goes_on(surface) {
                found.push(Bright {
                    beam: (first + lane) as u32,
                    direction: scan.beams.direction(first + lane),
                    range,
                    power: rho_eff * scratch[lane] / (range * range),
                    cos_incidence: surfaces.cos_incidence[lane],
                    surface,
                    triangle: hits.triangle[lane],
                    uv: [hits.u[lane], hits.v[lane]],
                    normal: hits.normal(lane),
                });
            }
        }
    }
    found
}
