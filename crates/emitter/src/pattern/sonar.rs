//! Transducers of sonars: where they transmit to and receive from.
//!
//! For all of them x is forward, y to port, z up; a tilt is below the horizontal. A width is a number, the full width
//! of a uniform line at -3 dB in degrees, or a section that specifies the aperture that forms the beam ([`Lobe`]).

use super::fan::{check_above_zero, check_fov};
use super::{Fan, check_count};
use crate::beams::direction;
use crate::lobe::{Piston, Shape};
use crate::{BeamTable, FiringOrder, Lobe};
use ground::error::{Error, Result};
use ground::read::bounds::Bounds;
use serde::{Deserialize, Serialize};

/// Two fans across the track, thin along it: port is beam 0, starboard beam 1; a single side is beam 0.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Sidescan {
    /// Which sides.
    #[serde(default)]
    pub sides: Sides,
    /// Axis of each fan below the horizontal, degrees, 0 to 90.
    #[serde(default = "side_tilt")]
    pub tilt_deg: f64,
    /// Width of each fan across the track.
    #[serde(default = "fan_width")]
    pub vertical_deg: Lobe,
    /// Width along the track, for transmission.
    #[serde(default = "along_width")]
    pub along_deg: Lobe,
    /// Likewise for reception; defaults to that for transmission.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub heard_along_deg: Option<Lobe>,
    /// Rays of each side, 8 to 1000000.
    #[serde(default = "side_rays")]
    pub rays: u32,
    /// Two fans from straight down, each extending half this angle to its side, degrees, as in the paper's system;
    /// replaces tilt, width and rays.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub down_fov_deg: Option<f64>,
    /// Angle from ray to ray of such fans, degrees.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub step_deg: Option<f64>,
    /// Lays out the points of the profile of the paper's program as in its 2D modes; otherwise they are on the
    /// surfaces.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub flat: Option<Flat>,
    /// Pings per second.
    #[serde(default = "super::ten")]
    pub rate_hz: f64,
}

/// How points of a side-scan sonar are laid out in one plane, as in its images: at the length of their path (Reitmann,
/// Neumann, Jung, Sensors 2021, 21, 2144, Figure 15).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Flat {
    /// A straight line for each ping, all of them parallel, whatever the course.
    Waterfall,
    /// Lines in plan view, from the position of the sonar in the direction in which it looks.
    Plan,
}

/// Sides of a side-scan sonar.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Sides {
    /// Port and starboard.
    #[default]
    Both,
    /// Port only.
    Port,
    /// Starboard only.
    Starboard,
}

/// A Mills cross that looks down: transmits a fan that is thin along the track, receives with beams side by side across
/// it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Multibeam {
    /// Number of beams, 2 to 4096, from port to starboard.
    pub beams: u32,
    /// Angle between the outermost beams, degrees, above 0, at most 170.
    pub swath_deg: f64,
    /// How the beams are spaced.
    #[serde(default)]
    pub spacing: Spacing,
    /// Width along the track, for transmission.
    #[serde(default = "one_degree")]
    pub along_deg: Lobe,
    /// Width across the track, for reception, straight down.
    #[serde(default = "one_degree")]
    pub across_deg: Lobe,
    /// Rays of each beam, 2 to 10000, at most 4 million for all beams.
    #[serde(default = "swath_rays")]
    pub rays: u32,
    /// Pings per second.
    #[serde(default = "super::ten")]
    pub rate_hz: f64,
}

/// How the beams of a swath are spaced.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Spacing {
    /// Even angles.
    #[default]
    Equiangle,
    /// Even distances on a flat bottom.
    Equidistant,
}

/// A forward-looking sonar: beams side by side from port to starboard, each as high as the transducer's vertical
/// pattern.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Imaging {
    /// Number of beams, 2 to 4096.
    pub beams: u32,
    /// Angle between the outermost beams, degrees, above 0, at most 180.
    pub fov_deg: f64,
    /// Width of a beam straight ahead, for reception.
    #[serde(default = "one_degree")]
    pub beam_deg: Lobe,
    /// Vertical width of the beams, for both transmission and reception.
    #[serde(default = "twenty_degrees")]
    pub vertical_deg: Lobe,
    /// Axis below the horizontal, degrees, -90 to 90.
    #[serde(default)]
    pub tilt_deg: f64,
    /// Rays of each beam, 8 to 100000, at most 4 million for all beams.
    #[serde(default = "imaging_rays")]
    pub rays: u32,
    /// Pings per second.
    #[serde(default = "super::ten")]
    pub rate_hz: f64,
}

/// One beam: an echo sounder, or one that turns from ping to ping.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct SingleBeam {
    /// Width of the beam.
    pub beam_deg: Lobe,
    /// Width for reception; defaults to the same.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub heard_deg: Option<Lobe>,
    /// Vertical width of the beam, for both transmission and reception; without it the beam is round.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub vertical_deg: Option<Lobe>,
    /// Axis below the horizontal, degrees, -90 to 90: 90 is straight down.
    #[serde(default = "down")]
    pub tilt_deg: f64,
    /// Azimuths that the beam turns to, one per ping; without it the beam is fixed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub turn: Option<Fan>,
    /// Rays of the beam, 8 to 1000000.
    #[serde(default = "beam_rays")]
    pub rays: u32,
    /// Pings per second.
    #[serde(default = "super::ten")]
    pub rate_hz: f64,
}

fn side_tilt() -> f64 {
    25.0
}

fn down() -> f64 {
    90.0
}

fn side_rays() -> u32 {
    2048
}

fn swath_rays() -> u32 {
    16
}

fn imaging_rays() -> u32 {
    256
}

fn beam_rays() -> u32 {
    1024
}

fn fan_width() -> Lobe {
    Lobe::Width(50.0)
}

fn along_width() -> Lobe {
    Lobe::Width(0.5)
}

fn one_degree() -> Lobe {
    Lobe::Width(1.0)
}

fn twenty_degrees() -> Lobe {
    Lobe::Width(20.0)
}

impl Sidescan {
    pub(super) fn check(&self, bounds: &mut Bounds) -> Result<()> {
        bounds.within("pattern.tilt_deg", self.tilt_deg, 0.0, 90.0)?;
        self.vertical_deg.check(bounds, "pattern.vertical_deg")?;
        self.along_deg.check(bounds, "pattern.along_deg")?;
        if let Some(received) = &self.heard_along_deg {
            received.check(bounds, "pattern.heard_along_deg")?;
        }
        bounds.within("pattern.rays", f64::from(self.rays), 8.0, 1e6)?;
        check_above_zero(bounds, "pattern.rate_hz", self.rate_hz)?;
        match (self.down_fov_deg, self.step_deg) {
            (None, None) => Ok(()),
            (Some(fov), Some(step)) => {
                self.check_no_other_fan()?;
                check_fov(bounds, "pattern.down_fov_deg", fov, 180.0)?;
                check_above_zero(bounds, "pattern.step_deg", step)?;
                check_count("pattern.down_fov_deg and pattern.step_deg", 2, (0.5 * fov / step) as u64 + 1)
            }
            (Some(_), None) => Err(Error::invalid("pattern.step_deg", "missing", "a value with pattern.down_fov_deg")),
            (None, Some(step)) => Err(Error::invalid("pattern.step_deg", step, "with pattern.down_fov_deg only")),
        }
    }

    /// Checks that no other key specifies where a fan with `down_fov_deg` looks, as it would have no effect.
    fn check_no_other_fan(&self) -> Result<()> {
        let check = |name: &str, same: bool, found: String| {
            let allowed = "none together with pattern.down_fov_deg";
            if same { Ok(()) } else { Err(Error::invalid(format!("pattern.{name}"), found, allowed)) }
        };
        check("tilt_deg", self.tilt_deg == side_tilt(), self.tilt_deg.to_string())?;
        check("vertical_deg", self.vertical_deg == fan_width(), "given".to_owned())?;
        check("rays", self.rays == side_rays(), self.rays.to_string())
    }

    /// Elevation of each side's axis, degrees.
    #[doc(hidden)]
    pub fn axis_deg(&self) -> f64 {
        self.down_fov_deg.map_or(-self.tilt_deg, |fov| -90.0 + 0.25 * fov)
    }

    /// Azimuths of the sides in beam order, degrees.
    #[doc(hidden)]
    pub fn azimuths_deg(&self) -> &'static [f64] {
        match self.sides {
            Sides::Both => &[90.0, -90.0],
            Sides::Port => &[90.0],
            Sides::Starboard => &[-90.0],
        }
    }

    pub(super) fn beams(&self) -> Result<BeamTable> {
        one_ping(self.azimuths_deg().iter().map(|&azimuth| [azimuth, self.axis_deg()]), self.rate_hz)
    }
}

impl Multibeam {
    pub(super) fn check(&self, bounds: &mut Bounds) -> Result<()> {
        bounds.within("pattern.beams", f64::from(self.beams), 2.0, 4096.0)?;
        check_fov(bounds, "pattern.swath_deg", self.swath_deg, 170.0)?;
        self.along_deg.check(bounds, "pattern.along_deg")?;
        self.across_deg.check(bounds, "pattern.across_deg")?;
        check_rays(bounds, self.rays, [2.0, 1e4], self.beams)?;
        check_above_zero(bounds, "pattern.rate_hz", self.rate_hz)
    }

    /// Angles of the beams from straight down, degrees, positive to port, from port to starboard.
    pub(crate) fn angles_deg(&self) -> impl Iterator<Item = f64> {
        let half = 0.5 * self.swath_deg;
        let steps = f64::from(self.beams - 1);
        let spacing = self.spacing;
        (0..self.beams).map(move |beam| {
            let part = 1.0 - 2.0 * f64::from(beam) / steps;
            match spacing {
                Spacing::Equiangle => half * part,
                Spacing::Equidistant => (half.to_radians().tan() * part).atan().to_degrees(),
            }
        })
    }

    pub(super) fn beams(&self) -> Result<BeamTable> {
        let axis = |angle: f64| if angle < 0.0 { [-90.0, -90.0 - angle] } else { [90.0, -90.0 + angle] };
        one_ping(self.angles_deg().map(axis), self.rate_hz)
    }
}

impl Imaging {
    pub(super) fn check(&self, bounds: &mut Bounds) -> Result<()> {
        bounds.within("pattern.beams", f64::from(self.beams), 2.0, 4096.0)?;
        check_fov(bounds, "pattern.fov_deg", self.fov_deg, 180.0)?;
        self.beam_deg.check(bounds, "pattern.beam_deg")?;
        self.vertical_deg.check(bounds, "pattern.vertical_deg")?;
        bounds.within("pattern.tilt_deg", self.tilt_deg, -90.0, 90.0)?;
        check_rays(bounds, self.rays, [8.0, 1e5], self.beams)?;
        check_above_zero(bounds, "pattern.rate_hz", self.rate_hz)
    }

    /// Bearings of the beams within the transducer's plane, degrees, positive to port, from port to starboard.
    pub(crate) fn bearings_deg(&self) -> impl Iterator<Item = f64> {
        let (half, steps) = (0.5 * self.fov_deg, f64::from(self.beams - 1));
        (0..self.beams).map(move |beam| half * (1.0 - 2.0 * f64::from(beam) / steps))
    }

    pub(super) fn beams(&self) -> Result<BeamTable> {
        let tilt = self.tilt_deg.to_radians();
        one_ping(
            self.bearings_deg().map(|bearing| {
                let (sin, cos) = bearing.to_radians().sin_cos();
                let [x, y, z] = [cos * tilt.cos(), sin, -cos * tilt.sin()];
                [y.atan2(x).to_degrees(), z.atan2(x.hypot(y)).to_degrees()]
            }),
            self.rate_hz,
        )
    }
}

impl SingleBeam {
    pub(super) fn check(&self, bounds: &mut Bounds) -> Result<()> {
        self.beam_deg.check(bounds, "pattern.beam_deg")?;
        if let Some(received) = &self.heard_deg {
            received.check(bounds, "pattern.heard_deg")?;
        }
        if let Some(vertical) = &self.vertical_deg {
            vertical.check(bounds, "pattern.vertical_deg")?;
        }
        bounds.within("pattern.tilt_deg", self.tilt_deg, -90.0, 90.0)?;
        if let Some(turn) = &self.turn {
            turn.check(bounds, "pattern.turn", 360.0)?;
        }
        bounds.within("pattern.rays", f64::from(self.rays), 8.0, 1e6)?;
        check_above_zero(bounds, "pattern.rate_hz", self.rate_hz)
    }

    /// The lobes for transmission and reception. For a round beam, a number is the width of a piston.
    #[doc(hidden)]
    pub fn lobes(&self) -> [Lobe; 2] {
        let received = self.heard_deg.as_ref().unwrap_or(&self.beam_deg);
        [&self.beam_deg, received].map(|lobe| if self.vertical_deg.is_none() { round(lobe) } else { lobe.clone() })
    }

    /// Azimuth of ping `number`, degrees.
    #[doc(hidden)]
    pub fn azimuth_deg(&self, number: u32) -> f64 {
        self.turn.map_or(0.0, |turn| turn.angle_deg((u64::from(number) % turn.len()) as usize))
    }

    pub(super) fn beams(&self) -> Result<BeamTable> {
        one_ping([[self.azimuth_deg(0), -self.tilt_deg]].into_iter(), self.rate_hz)
    }
}

/// Checks that `rays` for each of `beams` stay far below what fits into memory.
pub(super) fn check_rays(bounds: &mut Bounds, rays: u32, [least, most]: [f64; 2], beams: u32) -> Result<()> {
    const MOST: u32 = 4_000_000;
    let most = most.min(f64::from(MOST / beams.max(1)));
    let allowed = format!("{least} to {most} with {beams} beams");
    bounds.number("pattern.rays", f64::from(rays), [least, most], allowed)
}

/// The lobe of a round beam: a number is the width of a piston.
pub(super) fn round(lobe: &Lobe) -> Lobe {
    match lobe {
        &Lobe::Width(width_deg) => Lobe::Shape(Shape::Piston(Piston::Width(width_deg))),
        other => other.clone(),
    }
}

/// The beams of one ping: azimuth and elevation of each, degrees.
pub(super) fn one_ping(beams: impl Iterator<Item = [f64; 2]>, rate_hz: f64) -> Result<BeamTable> {
    let beams: Vec<_> = beams.collect();
    let mut table = BeamTable::with_size(1, beams.len(), FiringOrder::Frame, 1.0 / rate_hz)?;
    for (channel, [azimuth, elevation]) in (0..).zip(beams) {
        table.push(direction(azimuth, elevation.to_radians().sin_cos()), 0.0, channel);
    }
    Ok(table)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn swaths_go_from_port_to_starboard() {
        let mut swath = Multibeam {
            beams: 5,
            swath_deg: 120.0,
            spacing: Spacing::Equiangle,
            along_deg: one_degree(),
            across_deg: one_degree(),
            rays: 4,
            rate_hz: 10.0,
        };
        assert_eq!(swath.angles_deg().collect::<Vec<_>>(), [60.0, 30.0, 0.0, -30.0, -60.0]);
        let table = swath.beams().unwrap();
        assert_eq!((table.rows, table.columns, table.period), (1, 5, 0.1));
        assert!((table.dir_y[0] - 0.866_025_4).abs() < 1e-6 && (table.dir_z[0] + 0.5).abs() < 1e-6);
        assert!((table.dir_z[2] + 1.0).abs() < 1e-6 && (table.dir_y[3] + 0.5).abs() < 1e-6);
        swath.spacing = Spacing::Equidistant;
        let tangents: Vec<_> = swath.angles_deg().map(|angle| angle.to_radians().tan()).collect();
        assert!(tangents.windows(2).all(|pair| (pair[0] - pair[1] - 3f64.sqrt() / 2.0).abs() < 1e-12));
    }

    #[test]
    fn tilted_arrays_look_down_ahead() {
        let array = Imaging {
            beams: 3,
            fov_deg: 120.0,
            beam_deg: one_degree(),
            vertical_deg: twenty_degrees(),
            tilt_deg: 30.0,
            rays: 8,
            rate_hz: 10.0,
        };
        let table = array.beams().unwrap();
        // The array's plane is tilted; its ends look sideways and less far down.
        for (beam, expected) in [(0, [0.433, 0.866, -0.25]), (1, [0.866, 0.0, -0.5]), (2, [0.433, -0.866, -0.25])] {
            let found = [table.dir_x[beam], table.dir_y[beam], table.dir_z[beam]];
            assert!(found.iter().zip(expected).all(|(a, b)| (a - b as f32).abs() < 1e-3), "{found:?}");
        }
    }

    #[test]
    fn a_turning_beam_starts_again_after_its_last_azimuth() {
        let turn = Some(Fan { fov_deg: 360.0, step_deg: 90.0, centre_deg: 0.0 });
        let sonar = SingleBeam {
            beam_deg: one_degree(),
            heard_deg: None,
            vertical_deg: None,
            tilt_deg: 0.0,
            turn,
            rays: 8,
            rate_hz: 1.0,
        };
        assert_eq!([0, 1, 2, 3, 4].map(|ping| sonar.azimuth_deg(ping)), [-180.0, -90.0, 0.0, 90.0, -180.0]);
    }
}
