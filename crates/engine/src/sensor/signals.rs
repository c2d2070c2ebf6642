//! How the echoes of a beam become returns.

use super::{SensorKind, SensorSpec, SubRays};
use crate::detect::{ReturnMode, ReturnRule};
use crate::echo::Pulse;
use emitter::Footprint;
use emitter::pattern::Pattern;
use std::sync::Arc;

/// Sub-rays of a pixel that covers more than one surface.
const RAYS_OF_A_PIXEL: usize = 25;

/// How beams of several sub-rays or returns are simulated; the same for the whole scan.
#[derive(Debug, Default)]
pub(crate) struct Signals {
    /// None: one ray along the beam.
    pub footprint: Option<Footprint>,
    /// How the beams are found whose footprints cover more than one surface and which need all sub-rays; all others
    /// have one ray. None: all beams have all sub-rays.
    pub adaptive: Option<Adaptive>,
    /// Standard deviation of the pulse, m of range.
    pub sigma: f64,
    pub rule: ReturnRule,
}

/// How footprints that cover more than one surface are found.
#[derive(Debug)]
pub(crate) struct Adaptive {
    /// One sub-ray per beam, at the rim of its footprint.
    pub rim: Footprint,
    /// How all other beams are simulated.
    pub one_ray: Arc<Signals>,
    /// For each sub-ray all of them, the nearest first.
    pub near: Vec<Vec<u8>>,
    /// Most sub-rays of a beam.
    pub most: u32,
}

impl Signals {
    /// The signals of a sensor.
    pub fn new(spec: &SensorSpec) -> Signals {
        let SensorSpec { beam, returns, .. } = spec;
        // A pixel has one range.
        let mode = if spec.tof.is_some() { ReturnMode::Strongest } else { returns.mode };
        let rule = ReturnRule { mode, max: returns.max.into(), separation: returns.separation_m as f32 };
        let (diameter, divergence) = (beam.exit_diameter_mm * 1e-3, beam.divergence_mrad.map(|mrad| mrad * 1e-3));
        let footprint = match (beam.sub_rays, &spec.pattern) {
            (SubRays::Count(1) | SubRays::AdaptiveUpTo(1), _) => None,
            (count, Pattern::Pinhole(camera)) if spec.kind == SensorKind::Tof => {
                let count = if let SubRays::Count(count) = count { count as usize } else { RAYS_OF_A_PIXEL };
                Some(Footprint::of_pixel(count, camera.pixel()))
            }
            (SubRays::Count(count), _) => Some(Footprint::new(count as usize, diameter, divergence)),
            (SubRays::Adaptive | SubRays::AdaptiveUpTo(_), _) => Some(Footprint::in_rounds(diameter, divergence)),
        };
        let sigma = Pulse::new(beam.pulse_shape, beam.pulse_ns).sigma();
        let adaptive = footprint.as_ref().zip(beam.sub_rays.most_adaptive()).map(|(footprint, most)| Adaptive {
            rim: footprint.rim(),
            near: footprint.neighbours(),
            most: most.min(footprint.count() as u32),
            one_ray: Arc::new(Signals { footprint: None, adaptive: None, sigma, rule }),
        });
        Signals { footprint, adaptive, sigma, rule }
    }

    /// Whether beams of one ray have one return, for which there is a shortcut.
    pub fn are_simple(&self) -> bool {
        let single = match self.rule.mode {
            ReturnMode::Strongest => true,
            ReturnMode::First | ReturnMode::Last => self.rule.separation == 0.0,
            _ => false,
        };
        (self.footprint.is_none() || self.adaptive.is_some()) && single
    }

    /// Sub-rays of a beam that has several.
    pub fn rays(&self) -> usize {
        self.footprint.as_ref().map_or(1, Footprint::count)
    }
}
