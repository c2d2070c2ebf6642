//! What a scanner covers below it, and how densely.

use emitter::BeamTable;
use emitter::pattern::{LineScan, Pattern};
use glam::{DQuat, DVec3};
use ground::error::{Error, Result};

/// What a scanner covers to both sides of its track, from straight down to the left, by angle.
#[derive(Clone, Debug)]
pub struct SurveySwath {
    /// Angles across of directions that look down, rad, rising. Pulses are spread evenly over the intervals.
    angles: Vec<f64>,
    /// Pulses per second of an interval between two of them.
    each_hz: f64,
    /// Angles between which the swath lies, rad.
    pub edges_rad: [f64; 2],
    /// How far the scanner looks back and ahead, as parts of the height.
    pub reach: [f64; 2],
    /// Pulses per second while the laser fires, Hz.
    pub pulse_rate_hz: f64,
    /// Pulses per second on average, Hz.
    pub fired_hz: f64,
    /// Lines per second, Hz, of a line scanner.
    pub lines_hz: Option<f64>,
    /// Least and greatest range, m.
    pub range_m: [f64; 2],
    /// Steps of a scanner whose head turns, rad: from pulse to pulse, from line to line; and duration of a turn, s.
    pub panorama: Option<([f64; 2], f64)>,
}

/// Widest angle from straight down that counts as swath unless the plan says otherwise, degrees.
const USUAL_HALF_DEG: f64 = 60.0;

/// Farthest ahead or back that a beam meets the ground, in heights.
const FLATTEST: f64 = 8.0;

/// Farthest from straight down that anything of the ground is expected, rad.
const STEEPEST: f64 = 1.48;

impl SurveySwath {
    /// That of a sensor with this `pattern`, `beams` and range, m, turned by `mount` on its carrier; `half_angle_deg`: see
    /// [`PlanSpec::half_angle_deg`](crate::PlanSpec::half_angle_deg).
    ///
    /// # Errors
    /// No beam looks down, and no head turns.
    pub fn new(
        pattern: &Pattern,
        beams: &BeamTable,
        mount: DQuat,
        range_m: [f64; 2],
        half_angle_deg: Option<f64>,
    ) -> Result<SurveySwath> {
        /// Directions of a line.
        const STEPS: u32 = 4097;
        let (directions, intervals, fired_hz, pulse_rate_hz): (Vec<DVec3>, f64, f64, f64) = match pattern {
            Pattern::LineScan(scan) => {
                let outline = scan.outline(STEPS);
                let lines = outline.len() as f64 / f64::from(STEPS);
                let rate = scan.pulse_rate_hz;
                let intervals = outline.len() as f64 - lines;
                (outline, intervals, rate * scan.duty(), rate)
            }
            _ => {
                let all = (0..beams.len()).map(|beam| beams.direction(beam).as_dvec3()).collect();
                let rate = beams.len() as f64 / beams.period;
                (all, beams.len() as f64, rate, rate)
            }
        };
        let panorama = match pattern {
            Pattern::LineScan(scan) => panorama(scan),
            _ => None,
        };
        let lines_hz = match pattern {
            Pattern::LineScan(scan) => Some(scan.lines_hz),
            _ => None,
        };
        let limit = half_angle_deg.unwrap_or(USUAL_HALF_DEG).to_radians();
        let mut reach = [0.0_f64; 2];
        let mut angles = Vec::with_capacity(directions.len());
        for direction in directions {
            let DVec3 { x, y, z } = mount * direction;
            let angle = y.atan2(-z);
            if angle.abs() <= STEEPEST && x.abs() < -FLATTEST * z {
                angles.push(angle);
                if angle.abs() <= limit {
                    reach = [reach[0].min(x / -z), reach[1].max(x / -z)];
                }
            }
        }
        angles.sort_by(f64::total_cmp);
        let within = |angle: &&f64| angle.abs() <= limit + 1e-9;
        let ends = angles.iter().find(within).zip(angles.iter().rev().find(within));
        let edges_rad = match ends {
            // The limit is between two directions, unless the scanner's own comes before.
            Some((&from, &to)) => {
                let first = if angles[0] < -limit { -limit } else { from };
                let last = if angles[angles.len() - 1] > limit { limit } else { to };
                [first, last]
            }
            None if panorama.is_some() => [0.0; 2],
            None => {
                let allowed =
                    "a sensor that looks down, as line scanners do with plane: across, or a mount that turns it";
                return Err(Error::invalid("trajectory.plan", "for a sensor that does not look down", allowed));
            }
        };
        Ok(SurveySwath {
            angles,
            each_hz: fired_hz / intervals.max(1.0),
            edges_rad,
            reach,
            pulse_rate_hz,
            fired_hz,
            lines_hz,
            range_m,
            panorama,
        })
    }

    /// Width of the swath on level ground from a height, m.
    pub fn width_m(&self, height_m: f64) -> f64 {
        let [from, to] = self.edges_rad;
        height_m * (to.tan() - from.tan())
    }

    /// Width that is covered even if the platform rolls by `roll_rad` to either side, m.
    pub fn safe_width_m(&self, height_m: f64, roll_rad: f64) -> f64 {
        let [from, to] = self.edges_rad;
        height_m * ((to - roll_rad).tan() - (from + roll_rad).tan()).max(0.0)
    }

    /// Intervals up to an angle, with parts of them.
    fn intervals_to(&self, angle: f64) -> f64 {
        let after = self.angles.partition_point(|known| *known <= angle);
        let Some(&next) = self.angles.get(after) else { return self.angles.len().saturating_sub(1) as f64 };
        let Some(before) = after.checked_sub(1) else { return 0.0 };
        let known = self.angles[before];
        before as f64 + (angle - known) / (next - known)
    }

    /// Pulses per second between two angles, rad.
    pub fn pulses_between_hz(&self, from: f64, to: f64) -> f64 {
        (self.intervals_to(to) - self.intervals_to(from)).max(0.0) * self.each_hz
    }

    /// Pulses per second and rad at an angle, rad.
    pub fn pulses_per_rad_hz(&self, angle: f64) -> f64 {
        /// Half of the width over which the mean is taken, rad.
        const HALF: f64 = 0.005;
        let (Some(&first), Some(&last)) = (self.angles.first(), self.angles.last()) else { return 0.0 };
        let (from, to) = ((angle - HALF).max(first), (angle + HALF).min(last));
        if to > from { self.pulses_between_hz(from, to) / (to - from) } else { 0.0 }
    }

    /// Pulses per m^2 of level ground at a distance across, m, from a height, m, at a speed, m/s: the pulses of an angle
    /// over the area that they are spread over, h d(tan a) wide and v long in a second.
    pub fn density_at(&self, across_m: f64, height_m: f64, speed_m_s: f64) -> f64 {
        if height_m <= 0.0 {
            return 0.0;
        }
        let angle = across_m.atan2(height_m);
        let slant = height_m / angle.cos();
        if !(self.range_m[0]..=self.range_m[1]).contains(&slant) {
            return 0.0;
        }
        self.pulses_per_rad_hz(angle) * angle.cos().powi(2) / (height_m * speed_m_s)
    }

    /// Spacing across of the points of a line at an angle, rad, from a height, m; `None`: no line scanner. h step / cos^2 a
    /// (survey practice; flat ground).
    pub fn spacing_m(&self, angle: f64, height_m: f64) -> Option<f64> {
        let step = self.lines_hz? / self.pulses_per_rad_hz(angle);
        Some(height_m * step / angle.cos().powi(2))
    }

    /// Points per second on level ground below a height, m, within range.
    pub fn points_hz(&self, height_m: f64) -> f64 {
        let steepest = (height_m / self.range_m[1]).clamp(0.0, 1.0).acos();
        let between = self.pulses_between_hz(-steepest, steepest);
        if height_m < self.range_m[0] { 0.0 } else { between }
    }
}

/// Steps of a scanner whose head turns, rad, and the duration of a turn, s.
fn panorama(scan: &LineScan) -> Option<([f64; 2], f64)> {
    let (head, turn) = scan.head.zip(scan.turn_s())?;
    let outline = scan.outline(3);
    let swept = outline[0].angle_between(outline[1]) + outline[1].angle_between(outline[2]);
    let step = swept / (scan.pulse_rate_hz / scan.lines_hz * scan.duty());
    Some(([step, (head.rate_deg_s / scan.lines_hz).to_radians()], turn))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(yaml: &str) -> SurveySwath {
        let pattern = Pattern::from_yaml(yaml).unwrap();
        let beams = pattern.beams(0.0).unwrap();
        SurveySwath::new(&pattern, &beams, DQuat::IDENTITY, [0.0, 1e9], None).unwrap()
    }

    fn rotating(rate: f64, lines: f64, half: f64, sweep: f64) -> SurveySwath {
        of(&format!(
            "{{type: line_scan, pulse_rate_hz: {rate}, lines_hz: {lines}, mechanism: {{type: rotating, window_deg: \
             [-{half}, {half}], sweep_deg: {sweep}}}}}"
        ))
    }

    /// Check values 1, 2 and 3: widths of swaths, and what remains of one when the aircraft rolls by 2 degrees.
    #[test]
    fn widths_are_those_of_angle_and_height() {
        let (thirty, sixty) = (rotating(1e6, 100.0, 30.0, 90.0), rotating(550e3, 200.0, 60.0, 360.0));
        for (found, expected) in [
            (thirty.width_m(500.0), 577.350_3),
            (sixty.width_m(80.0), 277.128_1),
            (thirty.width_m(1000.0), 1154.701),
            (thirty.safe_width_m(1000.0, 2_f64.to_radians()), 1063.419),
        ] {
            assert!((found / expected - 1.0).abs() < 1e-6, "{found} {expected}");
        }
    }

    /// Check values 4 and 5: spacings of points and densities.
    #[test]
    fn densities_follow_from_pulses_and_speed() {
        let swath = rotating(550e3, 200.0, 60.0, 360.0);
        let close = |found: f64, expected: f64| assert!((found / expected - 1.0).abs() < 1e-6, "{found} {expected}");
        close(swath.spacing_m(0.0, 80.0).unwrap(), 0.182_783_6);
        close(swath.spacing_m(45_f64.to_radians(), 80.0).unwrap(), 0.365_567_1);
        close(swath.density_at(0.0, 80.0, 8.0), 136.773_8);
        let high = rotating(1e6, 100.0, 30.0, 90.0);
        let [from, to] = high.edges_rad;
        close(high.pulses_between_hz(from, to) / (60.0 * high.width_m(1000.0)), 9.622_504);
    }

    /// Check value 6: density of a mirror that swings as a pendulum at 0.9 and 0.95 of its angle against the middle.
    #[test]
    fn pendulums_are_dense_at_their_edges() {
        let swath = of(
            "{type: line_scan, pulse_rate_hz: 1e5, lines_hz: 100, mechanism: {type: oscillating, half_deg: 20, law: sine}}",
        );
        let at = |part: f64| swath.pulses_per_rad_hz((20.0 * part).to_radians());
        for (part, expected) in [(0.9, 2.294_157), (0.95, 3.202_563)] {
            assert!((at(part) / at(0.0) / expected - 1.0).abs() < 0.05, "{}", at(part) / at(0.0));
        }
    }

    /// Check value 11: steps of 0.04 degrees at 10, 50 and 100 m, and the time of a panorama.
    #[test]
    fn panoramas_have_steps_and_durations() {
        let swath =
            of("{type: line_scan, pulse_rate_hz: 122e3, lines_hz: 48.8, lines: 10, plane: upright, mechanism: \
                        {type: rotating, window_deg: [-40, 60], sweep_deg: 100}, head: {rate_deg_s: 1.952}}");
        let ([pulse, line], turn) = swath.panorama.unwrap();
        for step in [pulse, line] {
            for (range, expected) in [(10.0, 6.981_317), (50.0, 34.906_59), (100.0, 69.813_17)] {
                assert!((1e3 * step * range / expected - 1.0).abs() < 1e-6, "{step}");
            }
        }
        assert!((turn - 184.426_2).abs() < 1e-4, "{turn}");
        assert!((turn * swath.fired_hz / 22.5e6 - 1.0).abs() < 1e-9);
    }

    #[test]
    fn scanners_must_look_down() {
        let ahead = Pattern::from_yaml("{type: pinhole, resolution: [4, 3], fov_deg: [10, 8]}").unwrap();
        let beams = ahead.beams(0.0).unwrap();
        let error = SurveySwath::new(&ahead, &beams, DQuat::IDENTITY, [0.0, 1e9], None).unwrap_err();
        assert!(error.to_string().contains("does not look down"), "{error}");
        let down = DQuat::from_rotation_y(std::f64::consts::FRAC_PI_2);
        let swath = SurveySwath::new(&ahead, &beams, down, [0.0, 1e9], None).unwrap();
        assert!(swath.width_m(100.0) > 10.0 && swath.width_m(100.0) < 18.0);
    }
}
