//! Beams through rotating wedge prisms.

use super::check_count;
use super::fan::check_above_zero;
use crate::{BeamTable, FiringOrder};
use glam::DVec3;
use ground::error::{Error, Result};
use ground::read::bounds::Bounds;
use serde::{Deserialize, Serialize};

/// Beams along x, bent by wedge prisms that each rotate at their own speed (Risley 1889; the Livox sensors): the
/// pattern continues from scan to scan and fills its field of view over time. Rows of the table are lines, columns
/// pulses.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Risley {
    /// Pulses per second of each line, above 0; all lines fire together.
    pub pulse_rate_hz: f64,
    /// Scans per second, above 0; 10 when not given. A scan has as many whole pulses as fit.
    #[serde(default = "super::ten")]
    pub rate_hz: f64,
    /// Elevations at which the lines enter the first prism, degrees, -45 to 45; one line at 0 when not given.
    #[serde(default = "one_line")]
    pub line_elevation_deg: Vec<f64>,
    /// The prisms, 1 to 8, in the order in which light passes them.
    pub prisms: Vec<Prism>,
}

/// A wedge prism that rotates about the x axis.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Prism {
    /// Angle between its faces, degrees, -60 to 60. A positive one tilts the normal of the tilted face, along the
    /// light, to +y at phase 0.
    pub wedge_deg: f64,
    /// Index of refraction, 1 to 4.
    pub ior: f64,
    /// Turns per minute, -1e6 to 1e6, positive from +y to +z.
    pub rpm: f64,
    /// Phase at time 0, degrees, -360 to 360.
    #[serde(default)]
    pub phase_deg: f64,
    /// Face that the light meets first; the other one is of the other kind.
    pub first_face: Face,
}

/// Face of a wedge prism.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Face {
    /// At a right angle to the axis.
    Flat,
    /// The one that makes it a wedge.
    Tilted,
}

fn one_line() -> Vec<f64> {
    vec![0.0]
}

/// Most prisms that light passes.
const MOST_PRISMS: usize = 8;

impl Risley {
    /// Pulses of a scan.
    fn pulses(&self) -> u64 {
        // Quotients of decimal fractions may miss a whole number by a rounding error.
        ((self.pulse_rate_hz / self.rate_hz + 1e-6).floor() as u64).max(1)
    }

    pub(super) fn check(&self, bounds: &mut Bounds) -> Result<()> {
        check_above_zero(bounds, "pattern.pulse_rate_hz", self.pulse_rate_hz)?;
        check_above_zero(bounds, "pattern.rate_hz", self.rate_hz)?;
        let lengths = [
            ("line_elevation_deg", self.line_elevation_deg.len(), usize::from(u16::MAX) + 1),
            ("prisms", self.prisms.len(), MOST_PRISMS),
        ];
        for (name, count, most) in lengths {
            if count == 0 || count > most {
                let key = format!("pattern.{name}");
                return Err(Error::invalid(key, format!("a list of {count}"), format!("1 to {most} of them")));
            }
        }
        for (i, &elevation) in self.line_elevation_deg.iter().enumerate() {
            bounds.within(format_args!("pattern.line_elevation_deg[{i}]"), elevation, -45.0, 45.0)?;
        }
        for (i, prism) in self.prisms.iter().enumerate() {
            let numbers = [
                ("wedge_deg", prism.wedge_deg, -60.0, 60.0),
                ("ior", prism.ior, 1.0, 4.0),
                ("rpm", prism.rpm, -1e6, 1e6),
                ("phase_deg", prism.phase_deg, -360.0, 360.0),
            ];
            for (name, value, low, high) in numbers {
                bounds.within(format_args!("pattern.prisms[{i}].{name}"), value, low, high)?;
            }
        }
        check_count("pattern.pulse_rate_hz", self.line_elevation_deg.len() as u64, self.pulses())
    }

    /// The beams of the scan that starts at `start_time`, s.
    ///
    /// # Errors
    /// A start that is not finite; a beam that a prism reflects totally.
    pub(super) fn beams(&self, start_time: f64) -> Result<BeamTable> {
        let (lines, pulses) = (self.line_elevation_deg.len(), self.pulses() as usize);
        let mut table = BeamTable::with_size(lines, pulses, FiringOrder::Columns, 1.0 / self.rate_hz)?;
        self.draw(start_time, &mut table)?;
        Ok(table)
    }

    /// Adds the beams of the scan that starts at `start_time`, s, to `table`, an empty one of its size.
    ///
    /// # Errors
    /// As [`Risley::beams`].
    pub(super) fn draw(&self, start_time: f64, table: &mut BeamTable) -> Result<()> {
        if !start_time.is_finite() {
            return Err(Error::invalid("start_time", start_time, "finite numbers"));
        }
        let mut prisms = [None; MOST_PRISMS];
        for (to, prism) in prisms.iter_mut().zip(&self.prisms) {
            *to = Some(prism.spin(start_time, self.pulse_rate_hz));
        }
        for (line, elevation) in self.line_elevation_deg.iter().enumerate() {
            let (z, x) = elevation.to_radians().sin_cos();
            let mut turning = prisms;
            for pulse in 0..self.pulses() {
                let beam = turning.iter().flatten().try_fold(DVec3::new(x, 0.0, z), |beam, prism| prism.bend(beam));
                let beam = beam.ok_or_else(|| {
                    let found = "prisms that reflect beams totally";
                    Error::invalid("pattern.prisms", found, "wedges and indices that let them pass at every phase")
                })?;
                table.push(beam.into(), pulse as f64 / self.pulse_rate_hz, line as u16);
                turning.iter_mut().flatten().for_each(Spin::turn);
            }
        }
        Ok(())
    }
}

impl Prism {
    /// The prism at `start_time`, s, to be rotated from pulse to pulse.
    fn spin(&self, start_time: f64, pulse_rate_hz: f64) -> Spin {
        let turns_s = self.rpm / 60.0;
        // Whole turns are dropped before they cost digits.
        let start = (turns_s * start_time).fract() * 360.0 + self.phase_deg;
        let (sin_wedge, cos_wedge) = self.wedge_deg.to_radians().sin_cos();
        Spin {
            wedge: [cos_wedge, sin_wedge],
            phase: rotation(start),
            step: rotation(360.0 * turns_s / pulse_rate_hz),
            ior: self.ior,
            first_face: self.first_face,
        }
    }
}

/// A prism at one moment.
#[derive(Clone, Copy)]
struct Spin {
    /// Cosine and sine of the wedge.
    wedge: [f64; 2],
    /// Cosine and sine of the phase.
    phase: [f64; 2],
    /// Likewise for the angle of rotation from pulse to pulse.
    step: [f64; 2],
    ior: f64,
    first_face: Face,
}

/// Cosine and sine.
fn rotation(angle_deg: f64) -> [f64; 2] {
    let (sin, cos) = angle_deg.to_radians().sin_cos();
    [cos, sin]
}

impl Spin {
    /// Rotates it to the next pulse.
    fn turn(&mut self) {
        let ([cos, sin], [step_cos, step_sin]) = (self.phase, self.step);
        self.phase = [cos * step_cos - sin * step_sin, sin * step_cos + cos * step_sin];
    }

    /// Direction behind the prism of a beam in air; `None` if it is totally reflected.
    fn bend(&self, beam: DVec3) -> Option<DVec3> {
        let ([cos_wedge, sin_wedge], [cos, sin]) = (self.wedge, self.phase);
        let tilted = DVec3::new(cos_wedge, sin_wedge * cos, sin_wedge * sin);
        let [first, second] = match self.first_face {
            Face::Flat => [DVec3::X, tilted],
            Face::Tilted => [tilted, DVec3::X],
        };
        refract(refract(beam, first, 1.0 / self.ior)?, second, self.ior)
    }
}

/// Snell's law for unit vectors: `normal` along the light, `ratio` the index before the face over that behind; `None`
/// beyond the critical angle.
fn refract(beam: DVec3, normal: DVec3, ratio: f64) -> Option<DVec3> {
    let cosine = beam.dot(normal);
    let behind = 1.0 - ratio * ratio * (1.0 - cosine * cosine);
    (behind > 0.0).then(|| ratio * beam + (behind.sqrt() - ratio * cosine) * normal)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn prism(wedge_deg: f64, ior: f64, rpm: f64, first_face: Face) -> Prism {
        Prism { wedge_deg, ior, rpm, phase_deg: 0.0, first_face }
    }

    fn pattern(prisms: Vec<Prism>) -> Risley {
        Risley { pulse_rate_hz: 100_000.0, rate_hz: 10.0, line_elevation_deg: one_line(), prisms }
    }

    fn mid40() -> Risley {
        pattern(vec![prism(-18.0, 1.5089, 7294.0, Face::Flat), prism(18.0, 1.5089, -4664.0, Face::Tilted)])
    }

    fn direction(table: &BeamTable, beam: usize) -> DVec3 {
        DVec3::new(table.dir_x[beam].into(), table.dir_y[beam].into(), table.dir_z[beam].into())
    }

    #[track_caller]
    fn assert_near(is: DVec3, expected: DVec3, tolerance: f64) {
        assert!((is - expected).length() <= tolerance, "{is} is not {expected}");
    }

    /// Snell in one plane: entering through the flat face, the beam leaves the tilted one at asin(n sin a) from its
    /// normal; the other way round, it is bent at both. Where the normal of the entry turns the beam to +y, that of the
    /// exit turns it to -y.
    #[test]
    fn a_prism_bends_by_snells_law() {
        let (wedge, n) = (18f64.to_radians(), 1.5089);
        let bend = |first_face| {
            let spin = prism(18.0, n, 0.0, first_face).spin(0.0, 1.0);
            spin.bend(DVec3::X).unwrap()
        };
        let out = wedge - (n * wedge.sin()).asin();
        assert_near(bend(Face::Flat), DVec3::new(out.cos(), out.sin(), 0.0), 1e-15);
        let out = (n * (wedge - (wedge.sin() / n).asin()).sin()).asin();
        assert_near(bend(Face::Tilted), DVec3::new(out.cos(), out.sin(), 0.0), 1e-15);
    }

    #[test]
    fn prisms_turn_from_y_to_z() {
        let one = pattern(vec![prism(-10.0, 1.5, 600.0, Face::Flat)]);
        let table = one.beams(0.0).unwrap();
        // 10 turns a second: a quarter turn after 25 ms, a cone about the axis.
        assert!(table.dir_y[0] > 0.08 && table.dir_z[0] == 0.0);
        for (beam, turned) in [(2500, [0, 1]), (5000, [-1, 0]), (7500, [0, -1])] {
            let [y, z] = turned.map(|part| f64::from(part) * f64::from(table.dir_y[0]));
            assert_near(direction(&table, beam), DVec3::new(table.dir_x[0].into(), y, z), 1e-7);
        }
    }

    /// A wedge of index 1 is air; equal wedges face to face are a plate.
    #[test]
    fn prisms_without_refraction_leave_beams_straight() {
        let air = pattern(vec![prism(30.0, 1.0, 7294.0, Face::Tilted)]).beams(0.3).unwrap();
        let plate = pattern(vec![prism(20.0, 1.6, 900.0, Face::Flat), prism(20.0, 1.6, 900.0, Face::Tilted)]);
        let plate = plate.beams(0.3).unwrap();
        for beam in [0, 1, 777, 9999] {
            assert_near(direction(&air, beam), DVec3::X, 1e-15);
            assert_near(direction(&plate, beam), DVec3::X, 1e-7);
        }
    }

    #[test]
    fn a_scan_goes_on_where_the_one_before_ended() {
        let risley = mid40();
        let long = Risley { rate_hz: 2.0, ..risley.clone() }.beams(0.0).unwrap();
        assert_eq!((long.rows, long.columns, long.period), (1, 50_000, 0.5));
        for scan in 0..5 {
            let table = risley.beams(f64::from(scan) * 0.1).unwrap();
            table.check().unwrap();
            assert_eq!((table.rows, table.columns, table.firing(77), table.period), (1, 10_000, 77, 0.1));
            assert_eq!((table.time[0], table.time[77]), (0.0, 77e-5));
            for beam in [0, 1, 5000, 9999] {
                assert_near(direction(&table, beam), direction(&long, scan as usize * 10_000 + beam), 2e-7);
            }
        }
        assert_eq!(risley.beams(12.3).unwrap(), risley.beams(12.3).unwrap());
    }

    /// A start may count from 1970: at 1.8e9 s the resolution is 2e-7 s, in which the faster prism turns by 0.01 deg.
    #[test]
    fn late_starts_are_as_good_as_early_ones() {
        let (risley, start) = (mid40(), 1.8e9);
        // After 30 s both prisms have made whole turns.
        let (late, early) = (risley.beams(start).unwrap(), risley.beams(0.0).unwrap());
        for beam in [0, 5000, 9999] {
            assert_near(direction(&late, beam), direction(&early, beam), 1e-6);
        }
    }

    #[test]
    fn lines_fire_together() {
        let lines = Risley { line_elevation_deg: vec![-3.0, 0.0, 3.0], pulse_rate_hz: 45.0, ..mid40() };
        let table = lines.beams(0.0).unwrap();
        // Four whole pulses in a tenth of a second.
        assert_eq!((table.rows, table.columns, table.len()), (3, 4, 12));
        assert_eq!((table.channel[3], table.channel[4], table.channel[11]), (0, 1, 2));
        assert_eq!((table.firing(2), table.firing(6), table.time[2], table.time[6]), (2, 2, 2.0 / 45.0, 2.0 / 45.0));
        assert!(table.dir_z[0] < table.dir_z[4] && table.dir_z[4] < table.dir_z[8]);
    }

    #[test]
    fn beams_that_do_not_get_through_are_an_error() {
        let steep = pattern(vec![prism(50.0, 1.5, 600.0, Face::Flat)]);
        steep.check(&mut Bounds::none()).unwrap();
        let error = steep.beams(0.0).unwrap_err().to_string();
        assert!(error.starts_with("pattern.prisms is prisms that reflect beams totally; allowed: wedges"), "{error}");
        for start in [f64::NAN, f64::INFINITY] {
            let error = mid40().beams(start).unwrap_err().to_string();
            assert!(error.starts_with("start_time is "), "{error}");
        }
    }
}
