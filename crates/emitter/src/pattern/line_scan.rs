//! Laser scanners that measure line by line: one beam that a mirror sweeps, on aircraft, vehicles or tripods.

use super::check_count;
use super::fan::check_above_zero;
use super::sweep::LineSweep;
use crate::{BeamTable, FiringOrder};
use glam::DVec3;
use ground::error::{Error, Result};
use ground::read::bounds::Bounds;
use serde::{Deserialize, Serialize};

/// One beam that a mechanism sweeps line by line, a pulse at a time; the pulses and the mechanism each keep their own time
/// from scan to scan. Rows of the table are lines, columns pulses. A scanner that flies or drives measures the next line
/// wherever its carrier is by then; one whose head turns covers the sphere.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct LineScan {
    /// Pulses per second, above 0: as often as the laser fires while it fires.
    pub pulse_rate_hz: f64,
    /// Lines per second, above 0.
    pub lines_hz: f64,
    /// Lines of a scan, 1 to 1000000: as many as a tenth of a second has when not given, or a turn of the head.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lines: Option<u32>,
    /// What sweeps the beam.
    pub mechanism: LineSweep,
    /// The plane of the lines.
    #[serde(default)]
    pub plane: LinePlane,
    /// A head that turns the lines about the z axis.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub head: Option<TurningHead>,
    /// What the instrument can be set to.
    #[serde(default)]
    pub settings: LineSettings,
}

/// The plane in which angles are counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LinePlane {
    /// Across the direction of flight: from straight down to the left.
    #[default]
    Across,
    /// Upright, ahead: from the horizon ahead upwards.
    Upright,
}

/// A head that turns evenly, to the left, and starts again.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct TurningHead {
    /// Degrees per second, above 0.
    pub rate_deg_s: f64,
    /// Where a turn starts and ends, degrees from x to the left, -720 to 720; a whole turn from 0 when not given.
    #[serde(default)]
    pub from_deg: f64,
    /// See `from_deg`, which it is greater than.
    #[serde(default = "whole_turn")]
    pub to_deg: f64,
}

fn whole_turn() -> f64 {
    360.0
}

/// What an instrument can be set to; empty: anything.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct LineSettings {
    /// Its pulse rates, Hz.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub pulse_rates_hz: Vec<f64>,
    /// Least and most lines per second.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lines_hz: Option<[f64; 2]>,
    /// Widest angle from the middle of a line, degrees.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub angle_deg: Option<f64>,
}

/// Most lines of a scan.
const MOST_LINES: u32 = 1_000_000;

impl LineScan {
    /// Duration of a turn of the head, s.
    fn turn(&self) -> Option<f64> {
        self.head.map(|head| (head.to_deg - head.from_deg) / head.rate_deg_s)
    }

    /// Lines of a scan.
    pub fn lines(&self) -> u32 {
        let whole = |duration: f64| ((duration * self.lines_hz + 1e-6).floor() as u32).clamp(1, MOST_LINES);
        self.lines.unwrap_or_else(|| whole(self.turn().unwrap_or(0.1)))
    }

    /// Pulses of a line: those of the part of its time in which the laser fires.
    pub fn pulses(&self) -> u64 {
        ((self.pulse_rate_hz / self.lines_hz * self.mechanism.used() + 1e-6).floor() as u64).max(1)
    }

    /// Part of the time of a line in which the laser fires, 0 to 1.
    pub fn duty(&self) -> f64 {
        self.mechanism.used()
    }

    /// Duration of a turn of the head, s, if it has one.
    pub fn turn_s(&self) -> Option<f64> {
        self.turn()
    }

    /// Directions in which the mechanism looks while the laser fires, `count` of each line, 2 or more, evenly in time from
    /// one end to the other, of as many lines as differ; with the head at 0 degrees. Unit vectors, x ahead, y left, z up.
    pub fn outline(&self, count: u32) -> Vec<DVec3> {
        let used = self.mechanism.used();
        let lines = 0..self.mechanism.lines_until_same() as u32;
        let along = |line: u32| {
            let lane = self.mechanism.line(line.into());
            (0..count).map(move |step| {
                let part = 0.5 + used * (f64::from(step) / f64::from(count.max(2) - 1) - 0.5);
                lane.direction(part, step.into())
            })
        };
        lines.flat_map(along).map(|direction| self.turned(direction, None, 0.0)).collect()
    }

    /// Angle between the ends of a line, degrees.
    pub fn width_deg(&self) -> f64 {
        2.0 * self.mechanism.widest_deg()
    }

    /// Time from scan to scan, s.
    fn period(&self) -> f64 {
        match (self.turn(), self.lines) {
            (Some(turn), None) => turn,
            _ => f64::from(self.lines()) / self.lines_hz,
        }
    }

    /// Whether every scan has the same beams.
    pub(super) fn repeats(&self) -> bool {
        let is_whole = |value: f64| (value - value.round()).abs() < 1e-9 * value.abs().max(1.0);
        let period = self.period();
        self.turn().is_none_or(|turn| is_whole(period / turn))
            && is_whole(period * self.lines_hz / self.mechanism.lines_until_same() as f64)
            && is_whole(period * self.pulse_rate_hz)
    }

    pub(super) fn check(&self, bounds: &mut Bounds) -> Result<()> {
        check_above_zero(bounds, "pattern.pulse_rate_hz", self.pulse_rate_hz)?;
        check_above_zero(bounds, "pattern.lines_hz", self.lines_hz)?;
        if let Some(lines) = self.lines {
            bounds.within("pattern.lines", f64::from(lines), 1.0, f64::from(MOST_LINES))?;
        }
        self.mechanism.check(bounds)?;
        if let Some(head) = &self.head {
            check_above_zero(bounds, "pattern.head.rate_deg_s", head.rate_deg_s)?;
            bounds.within("pattern.head.from_deg", head.from_deg, -720.0, 720.0)?;
            bounds.within("pattern.head.to_deg", head.to_deg, -720.0, 720.0)?;
            if head.to_deg <= head.from_deg {
                let allowed = format!("more than pattern.head.from_deg, {}", head.from_deg);
                return Err(Error::invalid("pattern.head.to_deg", head.to_deg, allowed));
            }
        }
        self.settings.check(self, bounds)?;
        check_count("pattern.pulse_rate_hz and pattern.lines_hz", self.lines().into(), self.pulses())
    }

    /// The beams of the scan that starts at `start_time`, s.
    ///
    /// # Errors
    /// A start that is not finite; no memory.
    pub(super) fn beams(&self, start_time: f64) -> Result<BeamTable> {
        let (lines, pulses) = (self.lines() as usize, self.pulses() as usize);
        let mut table = BeamTable::with_size(lines, pulses, FiringOrder::Beams, self.period())?;
        self.draw(start_time, &mut table)?;
        Ok(table)
    }

    /// Adds the beams of the scan that starts at `start_time`, s, to `table`, an empty one of its size.
    ///
    /// # Errors
    /// As [`LineScan::beams`].
    pub(super) fn draw(&self, start_time: f64, table: &mut BeamTable) -> Result<()> {
        if !start_time.is_finite() {
            return Err(Error::invalid("start_time", start_time, "finite numbers"));
        }
        let (rate, lines_hz, pulses) = (self.pulse_rate_hz, self.lines_hz, self.pulses());
        let first_line = (start_time * lines_hz - 1e-6).ceil();
        let unused = 1.0 - self.mechanism.used();
        let head = self.head.zip(self.turn());
        for line in 0..self.lines() {
            let number = first_line + f64::from(line);
            // The laser fires at its own times, from the first one on at which the mechanism is where it is used.
            let begin = (number + 0.5 * unused) / lines_hz;
            let first = (begin * rate - 1e-6).ceil();
            let lane = self.mechanism.line(number);
            for pulse in 0..pulses {
                let time = (first + pulse as f64) / rate;
                let angle_part = (time * lines_hz - number).clamp(0.0, 1.0);
                let direction = self.turned(lane.direction(angle_part, pulse), head, time);
                table.push(direction.into(), (time - start_time).max(0.0), 0);
            }
        }
        Ok(())
    }

    /// A direction of the mechanism, which looks along its line from straight down, in the sensor frame at a time, s. `head`
    /// comes with the duration of its turn, s.
    fn turned(&self, direction: DVec3, head: Option<(TurningHead, f64)>, time: f64) -> DVec3 {
        let DVec3 { x, y, z } = direction;
        let direction = match self.plane {
            LinePlane::Across => direction,
            // Down becomes ahead, left becomes up, what was ahead is right.
            LinePlane::Upright => DVec3::new(-z, -x, y),
        };
        let Some((head, turn)) = head else { return direction };
        let angle = head.from_deg + head.rate_deg_s * time.rem_euclid(turn);
        let (sin, cos) = angle.to_radians().sin_cos();
        DVec3::new(direction.x * cos - direction.y * sin, direction.x * sin + direction.y * cos, direction.z)
    }
}

impl LineSettings {
    fn check(&self, scan: &LineScan, bounds: &mut Bounds) -> Result<()> {
        let rates = &self.pulse_rates_hz;
        for (index, &rate) in rates.iter().enumerate() {
            check_above_zero(bounds, format_args!("pattern.settings.pulse_rates_hz[{index}]"), rate)?;
        }
        for (index, &rate) in self.lines_hz.iter().flatten().enumerate() {
            check_above_zero(bounds, format_args!("pattern.settings.lines_hz[{index}]"), rate)?;
        }
        if let Some(angle) = self.angle_deg {
            bounds.within("pattern.settings.angle_deg", angle, 1e-3, 180.0)?;
        }
        if !rates.is_empty() && !rates.contains(&scan.pulse_rate_hz) {
            let allowed: Vec<String> = rates.iter().map(f64::to_string).collect();
            let allowed = format!("the instrument's: {}", allowed.join(", "));
            return Err(Error::invalid("pattern.pulse_rate_hz", scan.pulse_rate_hz, allowed));
        }
        if let Some([least, most]) = self.lines_hz
            && !(least..=most).contains(&scan.lines_hz)
        {
            let allowed = format!("the instrument's: {least} to {most}");
            return Err(Error::invalid("pattern.lines_hz", scan.lines_hz, allowed));
        }
        let widest = scan.mechanism.widest_deg();
        if let Some(most) = self.angle_deg
            && widest > most + 1e-9
        {
            let allowed = format!("the instrument's: up to {most} deg from the middle");
            return Err(Error::invalid("pattern.mechanism", format!("a line that reaches {widest} deg"), allowed));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pattern::Pattern;

    fn of(yaml: &str) -> LineScan {
        match Pattern::from_yaml(yaml).unwrap() {
            Pattern::LineScan(scan) => scan,
            other => panic!("{other:?}"),
        }
    }

    /// Angle of a beam from straight down to the left, degrees.
    fn angle_deg(table: &BeamTable, beam: usize) -> f64 {
        f64::from(table.dir_y[beam]).atan2(f64::from(-table.dir_z[beam])).to_degrees()
    }

    /// Check value 4: 550 kHz and 200 lines per second are steps of 0.1309091 degrees, 0.1827836 m at 80 m below.
    #[test]
    fn mirrors_step_from_pulse_to_pulse() {
        let scan = of(
            "{type: line_scan, pulse_rate_hz: 550e3, lines_hz: 200, lines: 3, mechanism: {type: rotating, window_deg: [-60, 60]}}",
        );
        let table = scan.beams(0.0).unwrap();
        assert_eq!((table.rows, table.columns, table.period), (3, 916, 0.015));
        let middle = 916 + 458;
        let step = angle_deg(&table, middle + 1) - angle_deg(&table, middle);
        assert!((step - 0.130_909_1).abs() < 1e-5, "{step}");
        assert!((80.0 * step.to_radians() - 0.182_783_6).abs() < 1e-5);
        for beam in [0, 916, 2 * 916] {
            assert!((angle_deg(&table, beam) + 60.0).abs() < 0.131, "{}", angle_deg(&table, beam));
        }
        // Pulses and lines each keep their own time.
        assert!(table.time.iter().all(|time| (time * 550e3 - (time * 550e3).round()).abs() < 1e-6));
        assert!(scan.repeats());
        let odd = of(
            "{type: line_scan, pulse_rate_hz: 550e3, lines_hz: 199, mechanism: {type: rotating, window_deg: [-60, 60]}}",
        );
        assert!(!odd.repeats());
        table.check().unwrap();
    }

    /// Check value 5: 1 MHz of which 60 of 90 degrees are used, from 1 km at 60 m/s: 9.622504 pulses per m^2.
    #[test]
    fn densities_are_those_of_plans() {
        let scan = of(
            "{type: line_scan, pulse_rate_hz: 1e6, lines_hz: 100, mechanism: {type: rotating, window_deg: [-30, 30], sweep_deg: 90}}",
        );
        let (table, swath) = (scan.beams(0.0).unwrap(), 2.0 * 1000.0 * f64::tan(30_f64.to_radians()));
        let density = table.len() as f64 / table.period / (60.0 * swath);
        assert!((density / 9.622_504 - 1.0).abs() < 1e-3, "{density}");
        assert_eq!((scan.lines(), scan.pulses()), (10, 6666));
    }

    /// Check value 9: a cone of 20 degrees from 75 m is a circle of 27.29777 m, with steps of 0.2366934 m.
    #[test]
    fn cones_draw_circles() {
        let scan =
            of("{type: line_scan, pulse_rate_hz: 50e3, lines_hz: 69, lines: 1, mechanism: {type: cone, half_deg: 20}}");
        let table = scan.beams(0.0).unwrap();
        let place = |beam: usize| {
            let direction = table.direction(beam).as_dvec3();
            direction * (75.0 / -direction.z)
        };
        assert!((place(100).truncate().length() - 27.297_77).abs() < 1e-4);
        assert!(((place(101) - place(100)).length() - 0.236_693_4).abs() < 1e-4);
    }

    /// A head that turns draws a panorama: steps as set both ways, 250 by 900 of them; see check value 11.
    #[test]
    fn heads_turn_lines() {
        let scan =
            of("{type: line_scan, pulse_rate_hz: 90e3, lines_hz: 100, plane: upright, mechanism: {type: rotating, \
                       window_deg: [-40, 60]}, head: {rate_deg_s: 40}}");
        assert_eq!((scan.lines(), scan.pulses()), (900, 250));
        let table = scan.beams(0.0).unwrap();
        assert!((table.period - 9.0).abs() < 1e-12);
        let spherical = |beam: usize| {
            let [x, y, z] = table.direction(beam).as_dvec3().to_array();
            [y.atan2(x).to_degrees(), z.asin().to_degrees()]
        };
        let [[azimuth, elevation], [later, higher]] = [spherical(10), spherical(11)];
        assert!((higher - elevation - 0.4).abs() < 1e-4 && (later - azimuth - 40.0 / 90e3).abs() < 1e-5);
        assert!((spherical(0)[1] + 40.0).abs() < 0.4 && (spherical(249)[1] - 60.0).abs() < 0.8);
        let turned = spherical(250 * 100 + 10)[0] - azimuth;
        assert!((turned - 40.0).abs() < 1e-3, "{turned}");
        // The next turn is the same.
        assert!(scan.repeats());
    }

    /// One scan goes on where the last one ended.
    #[test]
    fn scans_go_on() {
        let scan = of(
            "{type: line_scan, pulse_rate_hz: 33e3, lines_hz: 70, lines: 7, mechanism: {type: oscillating, half_deg: 20, law: triangle}}",
        );
        let (first, second) = (scan.beams(0.0).unwrap(), scan.beams(0.1).unwrap());
        let [last, next] = [first.time[first.len() - 1], 0.1 + second.time[0]];
        assert!(next > last && next - last < 2.0 / 33e3 + 1e-9, "{last} {next}");
        // Seven lines further, the mirror swings the other way.
        assert!(angle_deg(&first, 100) < -8.0 && angle_deg(&second, 100) > 8.0);
    }

    #[test]
    fn errors_name_what_the_instrument_has() {
        let error = |yaml: &str| Pattern::from_yaml(yaml).unwrap_err().to_string();
        let rotating = "mechanism: {type: rotating, window_deg: [-50, 50]}";
        for (yaml, found) in [
            (
                format!("{{type: line_scan, pulse_rate_hz: 2e5, lines_hz: 50, {rotating}, settings: {{pulse_rates_hz: [1e5, 3e5]}}}}"),
                "pattern.pulse_rate_hz is 200000; allowed: the instrument's: 100000, 300000",
            ),
            (
                format!("{{type: line_scan, pulse_rate_hz: 2e5, lines_hz: 5, {rotating}, settings: {{lines_hz: [10, 200]}}}}"),
                "pattern.lines_hz is 5; allowed: the instrument's: 10 to 200",
            ),
            (
                format!("{{type: line_scan, pulse_rate_hz: 2e5, lines_hz: 50, {rotating}, settings: {{angle_deg: 30}}}}"),
                "pattern.mechanism is a line that reaches 50 deg; allowed: the instrument's: up to 30 deg from the middle",
            ),
            (
                "{type: line_scan, pulse_rate_hz: 2e5, lines_hz: 50, mechanism: {type: rotating, window_deg: [10, -10]}}".into(),
                "pattern.mechanism.window_deg is 10 to -10; allowed: two angles that rise by up to pattern.mechanism.sweep_deg, 360",
            ),
            (
                format!("{{type: line_scan, pulse_rate_hz: 2e5, lines_hz: 50, {rotating}, head: {{rate_deg_s: 3, from_deg: 90, to_deg: 0}}}}"),
                "pattern.head.to_deg is 0; allowed: more than pattern.head.from_deg, 90",
            ),
        ] {
            assert!(error(&yaml).contains(found), "{}", error(&yaml));
        }
        let unknown = error("{type: line_scan, pulse_rate_hz: 1, lines_hz: 1, mechanism: {type: spiral}}");
        assert!(unknown.contains("spiral") && unknown.contains("palmer"), "{unknown}");
    }
}
