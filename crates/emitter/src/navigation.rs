//! Errors of navigation: where a surveyor's processing believes the sensor to be, beside where it is.

use super::drift::GaussMarkov;
use super::trajectory::{Accuracy, Trajectory, navigated};
use glam::{DQuat, DVec3};
use ground::error::{Error, Result};
use ground::pose::Pose;
use ground::read::bounds::Bounds;
use ground::read::yaml::Document;
use ground::rng::{Draw, Rng};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::f64::consts::{FRAC_PI_2, PI};
use std::path::Path;
use std::sync::Arc;

/// Errors of the trajectory and of the mounting that processing uses; each is the estimate less the truth. Angles are
/// those of navigators: roll, starboard down; pitch, nose up; heading, clockwise from above.
///
/// The estimated position is the true one, with the drift and the bias of `position` to the north (y), to the east (x)
/// and up; the estimated attitude is the true one, turned by roll and pitch errors about the carrier's own axes and by the
/// heading error about the vertical. The sensor is then taken to be where the mounting, with its own errors, puts it on that
/// carrier. With all zero, estimate and truth are the same.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct Navigation {
    /// Errors of the position.
    pub position: PositionError,
    /// Errors of the attitude.
    pub attitude: AttitudeError,
    /// Boresight: by how much the sensor is taken to be turned on its carrier from how it is, roll, pitch and heading about
    /// the carrier's axes, degrees, each -180 to 180.
    pub boresight_deg: [f64; 3],
    /// Lever arm: by how much the sensor is taken to be from where it is on its carrier, x ahead, y to port, z up, m, each
    /// -1000 to 1000.
    pub lever_arm_m: [f64; 3],
    /// By how much the time stamps of pulses are late, s, -10 to 10: the pose of that much later is used.
    pub time_offset_s: f64,
}

/// Errors of a position.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct PositionError {
    /// Standard deviation of the drift, to the north and to the east each, m, 0 to 1000.
    pub horizontal_m: f64,
    /// Of the height, likewise.
    pub vertical_m: f64,
    /// Correlation time of the drift, s, 0.01 to 1e6.
    pub tau_s: f64,
    /// Standard deviation, from seed to seed, of an error that is constant over a flight, to the north and to the east each,
    /// m, 0 to 1000.
    pub horizontal_bias_m: f64,
    /// Of the height, likewise.
    pub vertical_bias_m: f64,
}

impl Default for PositionError {
    fn default() -> Self {
        PositionError { horizontal_m: 0.0, vertical_m: 0.0, tau_s: 100.0, horizontal_bias_m: 0.0, vertical_bias_m: 0.0 }
    }
}

/// Errors of an attitude.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct AttitudeError {
    /// Standard deviation of the drift of roll and pitch each, degrees, 0 to 10.
    pub roll_pitch_deg: f64,
    /// Of the heading, likewise.
    pub heading_deg: f64,
    /// Correlation time of the drift, s, 0.01 to 1e6.
    pub tau_s: f64,
    /// Standard deviation, from seed to seed, of an error that is constant over a flight, of roll and pitch each, degrees, 0
    /// to 10.
    pub roll_pitch_bias_deg: f64,
    /// Of the heading, likewise.
    pub heading_bias_deg: f64,
}

impl Default for AttitudeError {
    fn default() -> Self {
        AttitudeError {
            roll_pitch_deg: 0.0,
            heading_deg: 0.0,
            tau_s: 100.0,
            roll_pitch_bias_deg: 0.0,
            heading_bias_deg: 0.0,
        }
    }
}

/// What processing makes of a flight.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct NavigationSolution {
    /// Where the carrier is.
    pub truth: Trajectory,
    /// Where it is estimated to be: what an SBET holds.
    pub carrier: Trajectory,
    /// Where the sensor is taken to be: the estimated carrier with the assumed mounting.
    pub sensor: Arc<Trajectory>,
    /// By how much the clock that pulses are stamped with is late, s.
    pub clock_offset: f64,
    /// Standard deviations of the estimate, every second.
    pub accuracy: Vec<Accuracy>,
}

/// Most poses of an estimated trajectory.
const MOST_POSES: f64 = 2e7;

/// Most records of accuracy.
const MOST_RECORDS: f64 = 1e7;

impl Navigation {
    /// Reads the YAML file at `path`: the section `navigation` of a scenario, or only its keys.
    ///
    /// # Errors
    /// A file that cannot be read; an unknown key or a number out of bounds, with its line.
    pub fn load(path: impl AsRef<Path>) -> Result<Navigation> {
        Navigation::read(&Document::load(path.as_ref())?)
    }

    /// [`Navigation::load`] from `text`.
    ///
    /// # Errors
    /// As [`Navigation::load`].
    pub fn from_yaml(text: &str) -> Result<Navigation> {
        Navigation::read(&Document::parse("YAML text", text)?)
    }

    fn read(document: &Document) -> Result<Navigation> {
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct NavigationFile {
            navigation: Navigation,
        }
        let (navigation, section) = match document.value() {
            Value::Null => (Navigation::default(), ""),
            Value::Object(keys) if keys.contains_key("navigation") => {
                (document.read::<NavigationFile>()?.navigation, "navigation")
            }
            Value::Object(_) => (document.read()?, ""),
            _ => return Err(document.error("", "is not a section of keys")),
        };
        let mut bounds = Bounds::none();
        let checked = match section {
            "" => navigation.check(&mut bounds),
            section => bounds.section(section, |bounds| navigation.check(bounds)),
        };
        checked.map_err(|error| document.locate(error))?;
        Ok(navigation)
    }

    /// Checks that all numbers are within their bounds.
    ///
    /// # Errors
    /// The key, what it is and what is allowed.
    pub fn check(&self, bounds: &mut Bounds) -> Result<()> {
        let Navigation { position, attitude, boresight_deg, lever_arm_m, time_offset_s } = self;
        for (key, value, least, most) in [
            ("position.horizontal_m", position.horizontal_m, 0.0, 1000.0),
            ("position.vertical_m", position.vertical_m, 0.0, 1000.0),
            ("position.tau_s", position.tau_s, 0.01, 1e6),
            ("position.horizontal_bias_m", position.horizontal_bias_m, 0.0, 1000.0),
            ("position.vertical_bias_m", position.vertical_bias_m, 0.0, 1000.0),
            ("attitude.roll_pitch_deg", attitude.roll_pitch_deg, 0.0, 10.0),
            ("attitude.heading_deg", attitude.heading_deg, 0.0, 10.0),
            ("attitude.tau_s", attitude.tau_s, 0.01, 1e6),
            ("attitude.roll_pitch_bias_deg", attitude.roll_pitch_bias_deg, 0.0, 10.0),
            ("attitude.heading_bias_deg", attitude.heading_bias_deg, 0.0, 10.0),
            ("time_offset_s", *time_offset_s, -10.0, 10.0),
        ] {
            bounds.within(key, value, least, most)?;
        }
        for axis in 0..3 {
            bounds.within(format_args!("boresight_deg[{axis}]"), boresight_deg[axis], -180.0, 180.0)?;
            bounds.within(format_args!("lever_arm_m[{axis}]"), lever_arm_m[axis], -1000.0, 1000.0)?;
        }
        Ok(())
    }

    /// What processing makes of the flight of `carrier`, with a sensor at `mount` on it, from `start` to `end`, s, and
    /// throughout the trajectory. Drifts are functions of `seed` and time alone, whatever part of a flight is scanned.
    ///
    /// # Errors
    /// A flight so long and a correlation time so short that the estimate has more than 20 million poses.
    pub fn solve(
        &self,
        seed: u64,
        carrier: &Trajectory,
        mount: &Pose,
        [start, end]: [f64; 2],
    ) -> Result<NavigationSolution> {
        let (first, last) = carrier.span();
        let times = self.times(carrier, [first.min(start), last.max(end)])?;
        let mut drift = NavigationDrift::new(self, seed);
        let estimate = |time: f64| {
            // On the clock of its file: a part of a flight has the errors that it has in the whole.
            let (position, [roll, pitch, heading]) = drift.at(time + carrier.time_zero());
            let truth = carrier.at(time);
            let about_own = DQuat::from_rotation_x(roll) * DQuat::from_rotation_y(-pitch);
            let orientation = DQuat::from_rotation_z(-heading) * truth.orientation * about_own;
            Pose { position: truth.position + position, orientation }
        };
        let keys: Vec<(f64, Pose)> = times.iter().copied().zip(times.iter().copied().map(estimate)).collect();
        let [roll, pitch, heading] = self.boresight_deg.map(f64::to_radians);
        // Of a carrier that heads along its own x axis.
        let boresight = navigated([roll, pitch, heading + FRAC_PI_2]);
        let assumed = Pose {
            position: mount.position + DVec3::from_array(self.lever_arm_m),
            orientation: boresight * mount.orientation,
        };
        let like = |keys| Trajectory::new(keys).map(|made| made.alongside(carrier));
        Ok(NavigationSolution {
            truth: carrier.clone(),
            sensor: Arc::new(like(keys.clone())?.mounted(&assumed)?),
            carrier: like(keys)?,
            clock_offset: self.time_offset_s,
            accuracy: self.accuracy([first.min(start), last.max(end)], carrier.time_zero()),
        })
    }

    /// Times of the poses of the estimate, s: those of the carrier, and those of the nodes of what drifts fastest.
    fn times(&self, carrier: &Trajectory, [start, end]: [f64; 2]) -> Result<Vec<f64>> {
        let Navigation { position, attitude, .. } = self;
        let drifts = [
            ("position", position.horizontal_m + position.vertical_m, position.tau_s),
            ("attitude", attitude.roll_pitch_deg + attitude.heading_deg, attitude.tau_s),
        ];
        let fastest = drifts.iter().filter(|drift| drift.1 > 0.0).min_by(|a, b| a.2.total_cmp(&b.2));
        let mut times: Vec<f64> = carrier.keys().iter().map(|key| key.0).collect();
        if let Some((of, _, tau)) = fastest {
            let step = GaussMarkov::step(*tau);
            let [first, last] = [(start / step).floor(), (end / step).ceil()];
            if last - first > MOST_POSES {
                let allowed =
                    format!("at least {:e} for a flight of {} s", (end - start) / MOST_POSES * tau / step, end - start);
                return Err(Error::invalid(format!("navigation.{of}.tau_s"), tau, allowed));
            }
            times.extend((0..=(last - first) as u64).map(|node| (first + node as f64) * step));
            times.sort_by(f64::total_cmp);
            // Two poses at the same time, but for its last digits, would be a jump.
            let apart = 8.0 * f64::EPSILON * end.abs().max(start.abs());
            times.dedup_by(|later, before| *later - *before <= apart);
        }
        Ok(times)
    }

    /// Standard deviations from `start` to `end`, s, every second, on a clock that is `zero` later. Those of velocities are of
    /// the mean over one second: a Gauss-Markov process of first order has none at a moment.
    fn accuracy(&self, [start, end]: [f64; 2], zero: f64) -> Vec<Accuracy> {
        let Navigation { position, attitude, .. } = self;
        let over_second = |sigma: f64| sigma * (2.0 * (1.0 - (-1.0 / position.tau_s).exp())).sqrt();
        let both = |drift: f64, bias: f64| drift.hypot(bias);
        let level = both(position.horizontal_m, position.horizontal_bias_m);
        let tilt = 60.0 * both(attitude.roll_pitch_deg, attitude.roll_pitch_bias_deg);
        let heading = 60.0 * both(attitude.heading_deg, attitude.heading_bias_deg);
        let (slow, up) = (over_second(position.horizontal_m), over_second(position.vertical_m));
        let count = (end - start).ceil().clamp(0.0, MOST_RECORDS) as u64;
        let record = |second: u64| Accuracy {
            time: start + second as f64 + zero,
            position_m: [level, level, both(position.vertical_m, position.vertical_bias_m)],
            velocity_m_s: [slow, slow, up],
            attitude_arcmin: [tilt, tilt, heading],
        };
        (0..=count).map(record).collect()
    }
}

/// The errors of an estimate over time.
struct NavigationDrift {
    /// To the east, to the north and up, and of roll, pitch and heading.
    processes: [GaussMarkov; 6],
    /// Standard deviations, m and rad.
    sigmas: [f64; 6],
    /// What is constant, likewise.
    biases: [f64; 6],
}

impl NavigationDrift {
    fn new(navigation: &Navigation, seed: u64) -> NavigationDrift {
        let Navigation { position, attitude, .. } = navigation;
        let rad = PI / 180.0;
        let (tilt, heading) = (attitude.roll_pitch_deg * rad, attitude.heading_deg * rad);
        let (tilt_bias, heading_bias) = (attitude.roll_pitch_bias_deg * rad, attitude.heading_bias_deg * rad);
        let (level, level_bias) = (position.horizontal_m, position.horizontal_bias_m);
        let mut biases = [level_bias, level_bias, position.vertical_bias_m, tilt_bias, tilt_bias, heading_bias];
        for (number, bias) in (0..).zip(&mut biases) {
            *bias *= f64::from(Rng::new(seed, 0).normal(number, Draw::NavigationBias, 0));
        }
        let process = |number: usize| {
            let tau = if number < 3 { position.tau_s } else { attitude.tau_s };
            GaussMarkov::new(seed, number as u32, tau)
        };
        NavigationDrift {
            processes: std::array::from_fn(process),
            sigmas: [level, level, position.vertical_m, tilt, tilt, heading],
            biases,
        }
    }

    /// The error of the position, m, and those of roll, pitch and heading, rad, at `time`, s.
    fn at(&mut self, time: f64) -> (DVec3, [f64; 3]) {
        let mut errors = self.biases;
        for ((error, process), sigma) in errors.iter_mut().zip(&mut self.processes).zip(self.sigmas) {
            if sigma > 0.0 {
                *error += sigma * process.at(time);
            }
        }
        let [east, north, up, roll, pitch, heading] = errors;
        (DVec3::new(east, north, up), [roll, pitch, heading])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Straight and level, to the north, at 60 m/s.
    fn flight() -> Trajectory {
        let pose = |y: f64| Pose { orientation: navigated([0.0; 3]), ..Pose::at(0.0, y, 1000.0) };
        Trajectory::new(vec![(0.0, pose(0.0)), (600.0, pose(36_000.0))]).unwrap()
    }

    fn solve(yaml: &str, seed: u64) -> NavigationSolution {
        Navigation::from_yaml(yaml).unwrap().solve(seed, &flight(), &Pose::IDENTITY, [0.0, 600.0]).unwrap()
    }

    #[test]
    fn without_errors_the_estimate_is_the_truth() {
        let solution = solve("", 0);
        assert_eq!(solution.carrier, flight());
        for time in [0.0, 1.7, 300.0, 600.0] {
            assert!(solution.sensor.at(time).orientation.angle_between(flight().at(time).orientation) < 1e-7);
            assert_eq!(solution.sensor.at(time).position, flight().at(time).position);
        }
    }

    #[test]
    fn constant_errors_are_the_estimate_less_the_truth() {
        let solution =
            solve("navigation: {boresight_deg: [0.5, 0, 0], lever_arm_m: [0, 0.25, 0], time_offset_s: 0.5}", 0);
        // Half a second is 30 m farther north, port is to the west.
        let (truth, found) = (flight().at(10.0), solution.sensor.at(10.0 + solution.clock_offset));
        assert!((found.position - truth.position - DVec3::new(-0.25, 30.0, 0.0)).length() < 1e-9);
        // Starboard, the east, is down.
        let angle = 0.5f64.to_radians();
        assert!((found.orientation * DVec3::NEG_Y - DVec3::new(angle.cos(), 0.0, -angle.sin())).length() < 1e-12);
        // The trajectory itself has none of these errors.
        assert_eq!(solution.carrier.at(10.0), truth);
        let turned = |boresight: &str| solve(&format!("boresight_deg: {boresight}"), 0).sensor.at(0.0).orientation;
        let small = angle.sin();
        assert!((turned("[0, 0.5, 0]") * DVec3::X - DVec3::new(0.0, angle.cos(), small)).length() < 1e-12);
        assert!((turned("[0, 0, 0.5]") * DVec3::X - DVec3::new(small, angle.cos(), 0.0)).length() < 1e-12);
    }

    #[test]
    fn drifts_have_their_deviations_and_biases_stay() {
        let yaml = "position: {horizontal_m: 0.02, vertical_m: 0.03, tau_s: 5}\nattitude: {roll_pitch_deg: 0.005, heading_deg: 0.01, tau_s: 5}";
        let (mut sums, mut count) = ([0.0; 6], 0.0);
        for seed in 0..8 {
            let solution = solve(yaml, seed);
            for second in (0..600).step_by(5) {
                let time = f64::from(second);
                let (truth, found) = (flight().at(time), solution.carrier.at(time));
                let off = found.position - truth.position;
                let turn = (truth.orientation.conjugate() * found.orientation).to_scaled_axis();
                // Axes ahead, to port and up.
                let all = [off.x, off.y, off.z, turn.x.to_degrees(), turn.y.to_degrees(), turn.z.to_degrees()];
                sums.iter_mut().zip(all).for_each(|(sum, value)| *sum += value * value);
                count += 1.0;
            }
        }
        for (sum, sigma) in sums.iter().zip([0.02, 0.02, 0.03, 0.005, 0.005, 0.01]) {
            // 960 values a correlation time apart.
            assert!(((sum / count).sqrt() / sigma - 1.0).abs() < 0.12, "{sums:?} of {count}");
        }
        let biased = solve("{position: {vertical_bias_m: 0.1}, attitude: {heading_bias_deg: 0.1}}", 3);
        let off = |time: f64| biased.carrier.at(time).position.z - 1000.0;
        assert!(off(0.0) != 0.0 && (off(0.0) - off(555.0)).abs() < 1e-9);
        let other = solve("{position: {vertical_bias_m: 0.1}}", 4).carrier.at(0.0).position.z - 1000.0;
        assert!((other - off(0.0)).abs() > 1e-6);
    }

    /// Of a flight that goes on longer, the first part has the same errors.
    #[test]
    fn drifts_are_functions_of_time() {
        let navigation = Navigation::from_yaml("position: {horizontal_m: 1, tau_s: 10}").unwrap();
        let still = Trajectory::fixed(Pose::IDENTITY);
        let solve = |span| navigation.solve(7, &still, &Pose::IDENTITY, span).unwrap().sensor;
        let (short, long) = (solve([20.0, 30.0]), solve([0.0, 500.0]));
        assert!(short.constant().is_none());
        for step in 0..100 {
            let time = 20.0 + 0.1 * f64::from(step);
            assert_eq!(short.at(time).position, long.at(time).position);
        }
    }

    #[test]
    fn accuracy_is_that_of_the_errors() {
        let solution =
            solve("{position: {horizontal_m: 0.03, horizontal_bias_m: 0.04}, attitude: {heading_deg: 0.01}}", 0);
        assert_eq!(solution.accuracy.len(), 601);
        let Accuracy { time, position_m, velocity_m_s, attitude_arcmin } = solution.accuracy[600];
        assert_eq!((time, position_m[2], attitude_arcmin[0]), (600.0, 0.0, 0.0));
        assert!((position_m[0] - 0.05).abs() < 1e-15 && (attitude_arcmin[2] - 0.6).abs() < 1e-15);
        assert!((velocity_m_s[0] - 0.03 * 0.02f64.sqrt()).abs() < 2e-5);
    }

    #[test]
    fn wrong_keys_are_named_with_their_line() {
        for (yaml, expected) in [
            ("position: {tau: 1}", "YAML text: line 1: position.tau: unknown key \"tau\""),
            (
                "navigation:\n  attitude: {tau_s: 0}",
                "line 2: navigation.attitude.tau_s: is 0; allowed: 0.01 to 1000000",
            ),
            ("boresight_deg: [0, 200, 0]", "line 1: boresight_deg[1]: is 200; allowed: -180 to 180"),
            ("time_offset_s: 11", "time_offset_s: is 11; allowed: -10 to 10"),
            ("3", "is not a section of keys"),
        ] {
            let message = Navigation::from_yaml(yaml).unwrap_err().to_string();
            assert!(message.contains(expected), "{message}");
        }
        let fast = Navigation::from_yaml("position: {horizontal_m: 1, tau_s: 0.01}").unwrap();
        let message = fast.solve(0, &flight(), &Pose::IDENTITY, [0.0, 1e5]).unwrap_err().to_string();
        assert!(message.starts_with("navigation.position.tau_s is 0.01; allowed: at least "), "{message}");
    }
}
