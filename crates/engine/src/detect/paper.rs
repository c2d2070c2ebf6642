//! Detection as computed by the paper's program: every hit is reported, and what is not detected has intensity 0.

use super::{Gate, LaneEchoes, Threshold};
use crate::echo::Air;
use ground::cause::Cause;
use ground::lanes::LANES;

/// Sets the `intensity` of what is not detected to 0. Rain and dust do not change the intensity of what is; a dust
/// cloud may be reported in place of a surface.
pub(super) fn detect_lanes(gate: &Gate, air: Option<&Air>, intensity: &mut [f32; LANES], echoes: &mut LaneEchoes) {
    let open = *gate.threshold == Threshold::Open;
    let Some(air) = air else {
        if !open {
            let detected = gate.detects_all(echoes.beams, echoes.rho_eff, echoes.range, None);
            for lane in 0..LANES {
                intensity[lane] = if detected[lane] { intensity[lane] } else { 0.0 };
            }
        }
        return;
    };
    for lane in 0..echoes.beams.len() {
        let (range, rho_eff) = (&mut echoes.range[lane], echoes.rho_eff[lane]);
        let limit = gate.threshold.limit_of_the_program(*range);
        let (tested, cloud) = air.as_the_program(*range, rho_eff, limit);
        if let Some((start, backscatter)) = cloud {
            (*range, intensity[lane]) = (start, backscatter);
            echoes.cause[lane] = Cause::Dust as u8;
        }
        if !open && tested <= limit {
            intensity[lane] = 0.0;
        }
    }
}
