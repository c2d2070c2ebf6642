//! The beams of a Doppler velocity log: down and outwards, like the two faces of Janus.

use super::fan::check_above_zero;
use super::sonar::{check_rays, one_ping, round};
use crate::beams::direction;
use crate::{BeamTable, Lobe};
use ground::error::{Error, Result};
use ground::read::bounds::Bounds;
use serde::{Deserialize, Serialize};

/// Beams of a Janus configuration: one more than a velocity has components, so that they check each other.
pub const JANUS_BEAMS: usize = 4;

/// Four round beams at the same angle from straight down, towards all sides. x is forward, y to port, z up.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Janus {
    /// Angle of each beam from straight down, degrees, 5 to 60.
    #[serde(default = "thirty_degrees")]
    pub janus_deg: f64,
    /// Azimuths of the beams, degrees, counter-clockwise from ahead, each at least 10 from the others; by default the
    /// corners of an X.
    #[serde(default = "corners")]
    pub azimuths_deg: [f64; JANUS_BEAMS],
    /// Width of each beam, the same for transmission and reception.
    pub beam_deg: Lobe,
    /// Rays of each beam, 8 to 1000000.
    #[serde(default = "beam_rays")]
    pub rays: u32,
    /// Pings per second.
    #[serde(default = "super::ten")]
    pub rate_hz: f64,
}

fn thirty_degrees() -> f64 {
    30.0
}

fn corners() -> [f64; JANUS_BEAMS] {
    [45.0, 135.0, 225.0, 315.0]
}

fn beam_rays() -> u32 {
    1024
}

impl Janus {
    pub(super) fn check(&self, bounds: &mut Bounds) -> Result<()> {
        bounds.within("pattern.janus_deg", self.janus_deg, 5.0, 60.0)?;
        for (index, &azimuth) in self.azimuths_deg.iter().enumerate() {
            bounds.within(format_args!("pattern.azimuths_deg[{index}]"), azimuth, -360.0, 360.0)?;
            /// Closer together, three beams hardly determine a velocity.
            const LEAST: f64 = 10.0;
            let apart = |other: f64| (azimuth - other + 180.0).rem_euclid(360.0) - 180.0;
            if let Some(near) = self.azimuths_deg[..index].iter().find(|other| apart(**other).abs() < LEAST) {
                let allowed = format!("at least {LEAST} from those of other beams, such as {near}");
                return Err(Error::invalid(format!("pattern.azimuths_deg[{index}]"), azimuth, allowed));
            }
        }
        self.beam_deg.check(bounds, "pattern.beam_deg")?;
        check_rays(bounds, self.rays, [8.0, 1e6], JANUS_BEAMS as u32)?;
        check_above_zero(bounds, "pattern.rate_hz", self.rate_hz)
    }

    /// The lobe of each beam; a number is the width of a piston.
    #[doc(hidden)]
    pub fn lobe(&self) -> Lobe {
        round(&self.beam_deg)
    }

    /// Unit vectors along the axes of the beams, sensor frame.
    #[doc(hidden)]
    pub fn axes(&self) -> [[f64; 3]; JANUS_BEAMS] {
        self.azimuths_deg.map(|azimuth| direction(azimuth, self.elevation_deg().to_radians().sin_cos()))
    }

    fn elevation_deg(&self) -> f64 {
        self.janus_deg - 90.0
    }

    pub(super) fn beams(&self) -> Result<BeamTable> {
        one_ping(self.azimuths_deg.iter().map(|&azimuth| [azimuth, self.elevation_deg()]), self.rate_hz)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn beams_point_down_and_outwards() {
        let janus =
            Janus { janus_deg: 30.0, azimuths_deg: corners(), beam_deg: Lobe::Width(2.0), rays: 8, rate_hz: 5.0 };
        let table = janus.beams().unwrap();
        assert_eq!((table.rows, table.columns, table.period), (1, 4, 0.2));
        // sin 30 cos 45 and cos 30.
        for (beam, [x, y]) in [[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]].into_iter().enumerate() {
            let found = [table.dir_x[beam], table.dir_y[beam], table.dir_z[beam]];
            let expected = [x * 0.353_553_4f32, y * 0.353_553_4, -0.866_025_4];
            assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6), "{found:?}");
        }
        let near = Janus { azimuths_deg: [0.0, 90.0, 180.0, 355.0], ..janus };
        let error = near.check(&mut Bounds::none()).unwrap_err().to_string();
        assert!(error.contains("pattern.azimuths_deg[3] is 355; allowed: at least 10 from those"), "{error}");
    }
}
