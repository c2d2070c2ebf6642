//! What rides along with a sensor: an inertial measurement unit, and odometry.
//!
//! Both are computed from a trajectory. The Earth does not turn here, and gravity is the same everywhere: MEMS gyroscopes
//! drift by about as much as the Earth turns.

use super::drift::GaussMarkov;
use super::{Pose, Trajectory};
use glam::DVec3;
use ground::named;
use ground::rng::{Draw, Rng};

/// Standard acceleration of gravity, m/s² (3rd General Conference on Weights and Measures, 1901).
pub const STANDARD_GRAVITY: f64 = 9.806_65;

/// Correlation time of the drift of a bias, s: that of gnss-ins-sim 2242a80, gnss_ins_sim/sim/imu_model.py (`b_corr`); data
/// sheets name none.
const BIAS_TAU_S: f64 = 100.0;

/// Inertial measurement units with known errors.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum ImuModel {
    /// Xsens MTi-10: what vehicles and field robots carry; 100 Hz.
    #[default]
    XsensMti10,
    /// VectorNav VN-200, quieter; 200 Hz.
    VectornavVn200,
    /// Without errors; 200 Hz.
    Ideal,
}

named! { ImuModel: XsensMti10 "xsens_mti10", VectornavVn200 "vectornav_vn200", Ideal "ideal" }

/// Errors of an axis of an accelerometer (m/s²) or a gyroscope (rad/s).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct InertialNoise {
    /// Density of white noise, per root Hz: the deviation of the mean over 1 s.
    pub density: f64,
    /// Bias instability: standard deviation of the bias while it drifts.
    pub instability: f64,
}

impl ImuModel {
    /// Measurements per second.
    pub fn rate_hz(self) -> f64 {
        match self {
            ImuModel::XsensMti10 => 100.0,
            ImuModel::VectornavVn200 | ImuModel::Ideal => 200.0,
        }
    }

    /// Errors of the accelerometer, m/s². Data sheets of MTi-10 series (60 ug per root Hz, in-run bias stability 15 ug) and
    /// VN-200 (0.14 mg per root Hz, 0.04 mg), as public repositories quote them.
    pub fn accelerometer(self) -> InertialNoise {
        let of = |density: f64, instability: f64| InertialNoise {
            density: density * STANDARD_GRAVITY,
            instability: instability * STANDARD_GRAVITY,
        };
        match self {
            ImuModel::XsensMti10 => of(60e-6, 15e-6),
            ImuModel::VectornavVn200 => of(0.14e-3, 0.04e-3),
            ImuModel::Ideal => InertialNoise::default(),
        }
    }

    /// Errors of the gyroscope, rad/s, from the same data sheets: 0.03 deg/s per root Hz and 18 deg/h; 0.0035 deg/s per root
    /// Hz and 10 deg/h.
    pub fn gyroscope(self) -> InertialNoise {
        let of = |density_deg: f64, deg_per_h: f64| InertialNoise {
            density: density_deg.to_radians(),
            instability: (deg_per_h / 3600.0).to_radians(),
        };
        match self {
            ImuModel::XsensMti10 => of(0.03, 18.0),
            ImuModel::VectornavVn200 => of(0.0035, 10.0),
            ImuModel::Ideal => InertialNoise::default(),
        }
    }

    /// Variances of the noise of one measurement, per axis: of the angular velocity, (rad/s)², and of the specific force,
    /// (m/s²)².
    pub fn variances(self) -> [f64; 2] {
        [self.gyroscope(), self.accelerometer()]
            .map(|noise| noise.sigma(self.rate_hz()).powi(2) + noise.instability * noise.instability)
    }
}

impl InertialNoise {
    /// Standard deviation of the white noise of measurements at `rate_hz`: density times the root of the rate (Woodman, "An
    /// introduction to inertial navigation", University of Cambridge, UCAM-CL-TR-696, 2007, section 3.2.2).
    pub fn sigma(self, rate_hz: f64) -> f64 {
        self.density * rate_hz.sqrt()
    }
}

/// A measurement of an IMU, in its own frame: x forward, y left, z up.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct ImuSample {
    /// When, s since the start of the run.
    pub time: f64,
    /// Angular velocity, rad/s.
    pub angular_velocity: DVec3,
    /// Specific force, m/s²: acceleration less gravity, so that 9.80665 upwards is measured at rest.
    pub specific_force: DVec3,
    /// Variances of the noise per axis: of the angular velocity, (rad/s)², and of the specific force, (m/s²)²; 0: there is
    /// none.
    pub variances: [f64; 2],
}

/// An inertial measurement unit at the origin of what moves along a trajectory, with its axes.
pub struct Imu {
    model: ImuModel,
    seed: u64,
    /// Drifts of the biases, of variance 1: of the gyroscope's axes, then of the accelerometer's.
    drifts: [GaussMarkov; 6],
}

impl Imu {
    /// With the errors of `model`; those of equal seeds are the same.
    pub fn new(model: ImuModel, seed: u64) -> Imu {
        let drift = |axis: usize| GaussMarkov::new(seed, axis as u32, BIAS_TAU_S).drawing(Draw::ImuBias);
        Imu { model, seed, drifts: std::array::from_fn(drift) }
    }

    /// Its model.
    pub fn model(&self) -> ImuModel {
        self.model
    }

    /// When it takes its measurement with this number, s since the start of the run.
    pub fn time_of(&self, number: i64) -> f64 {
        number as f64 / self.model.rate_hz()
    }

    /// Number of the first measurement at or after `time`, s since the start of the run.
    pub fn first_from(&self, time: f64) -> i64 {
        (time * self.model.rate_hz() - 1e-6).ceil() as i64
    }

    /// Its measurement with this number. Errors are functions of the number and the seed alone. The specific force is the
    /// acceleration less gravity, in its own frame (Groves, "Principles of GNSS, inertial, and multisensor integrated
    /// navigation systems", 2nd ed. 2013, eq. 2.78); see [`Trajectory::acceleration`].
    pub fn sample(&mut self, trajectory: &Trajectory, number: i64) -> ImuSample {
        self.sample_at(trajectory, number, self.time_of(number))
    }

    /// The same on a trajectory whose clock reads `on_trajectory`, s, at that time: one that counts from a time nearby is not
    /// rounded, whenever the run is.
    pub fn sample_at(&mut self, trajectory: &Trajectory, number: i64, on_trajectory: f64) -> ImuSample {
        let time = self.time_of(number);
        let to_own = trajectory.at(on_trajectory).orientation.conjugate();
        let gravity = DVec3::new(0.0, 0.0, -STANDARD_GRAVITY);
        let acceleration = trajectory.acceleration(on_trajectory);
        let truths = [to_own * trajectory.turning(on_trajectory), to_own * (acceleration - gravity)];
        let rng = Rng::new(self.seed, (number >> 32) as u32);
        let mut measured = truths;
        for (part, noise) in [self.model.gyroscope(), self.model.accelerometer()].into_iter().enumerate() {
            if noise == InertialNoise::default() {
                continue;
            }
            let sigma = noise.sigma(self.model.rate_hz());
            for axis in 0..3 {
                let which = 3 * part + axis;
                let white = f64::from(rng.normal(number as u32, Draw::ImuNoise, which as u32));
                measured[part][axis] += sigma * white + noise.instability * self.drifts[which].at(time);
            }
        }
        let [angular_velocity, specific_force] = measured;
        ImuSample { time, angular_velocity, specific_force, variances: self.model.variances() }
    }
}

/// Where something on a trajectory is, and how it moves.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct OdometrySample {
    /// When, s since the start of the run.
    pub time: f64,
    /// Its pose in the world.
    pub pose: Pose,
    /// Its velocity over ground, in its own frame, m/s.
    pub linear_velocity: DVec3,
    /// Its angular velocity, likewise, rad/s.
    pub angular_velocity: DVec3,
}

impl Trajectory {
    /// Pose and velocities at `time`, s.
    pub fn odometry(&self, time: f64) -> OdometrySample {
        let pose = self.at(time);
        let to_own = pose.orientation.conjugate();
        let [linear_velocity, angular_velocity] = [to_own * self.velocity(time), to_own * self.turning(time)];
        OdometrySample { time, pose, linear_velocity, angular_velocity }
    }

    /// Acceleration in the world at `time`, s, in m/s².
    ///
    /// The velocity is constant from key to key. Its change at a key is spread over the halves of both neighbours: at the
    /// key the acceleration is the change divided by the time from the middle of one to that of the other, and between keys
    /// it is linear. Its integral is thus the change of the velocity. Before the first and after the last key, and at these
    /// two, it is 0: a trajectory begins and ends without a jolt.
    pub fn acceleration(&self, time: f64) -> DVec3 {
        let keys = self.keys();
        let after = keys.partition_point(|(key, _)| *key <= time);
        if after == 0 || after == keys.len() {
            return DVec3::ZERO;
        }
        let at_key = |index: usize| {
            if index == 0 || index + 1 == keys.len() {
                return DVec3::ZERO;
            }
            let [(t0, a), (t1, b), (t2, c)] = [keys[index - 1], keys[index], keys[index + 1]];
            let change = (c.position - b.position) / (t2 - t1) - (b.position - a.position) / (t1 - t0);
            change / (0.5 * (t2 - t0))
        };
        let (from, to) = (keys[after - 1].0, keys[after].0);
        at_key(after - 1).lerp(at_key(after), (time - from) / (to - from))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A circle of this radius, m, at this rate, rad/s, counter-clockwise, heading along it; a pose every 10 ms.
    fn circle(radius: f64, rate: f64) -> Trajectory {
        let pose = |time: f64| {
            let angle = rate * time;
            Pose::at(radius * angle.cos(), radius * angle.sin(), 1.0).with_rpy_deg(0.0, 0.0, angle.to_degrees() + 90.0)
        };
        let key = |step: u32| (f64::from(step) / 100.0, pose(f64::from(step) / 100.0));
        Trajectory::new((0..=1000).map(key).collect()).unwrap()
    }

    fn assert_near(found: DVec3, expected: [f64; 3], tolerance: f64) {
        assert!((found - DVec3::from(expected)).length() < tolerance, "{found} is not {expected:?}");
    }

    #[test]
    fn at_rest_it_measures_g_upwards_and_no_rotation() {
        let mut imu = Imu::new(ImuModel::Ideal, 0);
        let tilted = Trajectory::fixed(Pose::IDENTITY.with_rpy_deg(0.0, 30.0, 77.0));
        for number in [-5, 0, 1 << 40] {
            let found = imu.sample(&tilted, number);
            // Nose down: the force that holds it up points backwards in its frame.
            assert_near(found.specific_force, [-0.5 * 9.806_65, 0.0, 0.75f64.sqrt() * 9.806_65], 1e-9);
            assert_eq!(found.angular_velocity, DVec3::ZERO);
        }
    }

    #[test]
    fn on_a_circle_it_measures_the_centripetal_force_and_the_rate() {
        let (radius, rate) = (5.0, 0.8);
        let path = circle(radius, rate);
        let mut imu = Imu::new(ImuModel::Ideal, 0);
        for number in 10..1980 {
            let found = imu.sample(&path, number);
            // The centre is to the left.
            assert_near(found.specific_force, [0.0, rate * rate * radius, STANDARD_GRAVITY], 0.015);
            assert_near(found.angular_velocity, [0.0, 0.0, rate], 1e-6);
            let odometry = path.odometry(found.time);
            assert_near(odometry.linear_velocity, [rate * radius, 0.0, 0.0], 0.02);
            assert_near(odometry.angular_velocity, [0.0, 0.0, rate], 1e-6);
            assert_eq!(odometry.pose, path.at(found.time));
        }
    }

    /// Whatever the poses.
    #[test]
    fn the_integral_of_the_acceleration_is_the_velocity() {
        let places = [(0.0, 0.0), (1.0, 1.0), (1.5, 1.0), (3.5, 9.0), (4.0, 8.0), (4.1, 8.0)];
        let path = Trajectory::new(places.map(|(time, x)| (time, Pose::at(x, 2.0 * x, 0.0))).to_vec()).unwrap();
        let (steps, end) = (400_000, 4.1);
        let step = end / f64::from(steps);
        let total: f64 = (0..steps).map(|i| path.acceleration((f64::from(i) + 0.5) * step).x * step).sum();
        let expected = path.velocity(4.05).x - path.velocity(0.5).x;
        assert!((total - expected).abs() < 1e-4, "{total} is not {expected}");
    }

    #[test]
    fn noise_has_the_deviation_that_the_preset_says() {
        let still = Trajectory::fixed(Pose::IDENTITY);
        for model in [ImuModel::XsensMti10, ImuModel::VectornavVn200] {
            let mut imu = Imu::new(model, 3);
            let count = 40_000;
            let all: Vec<ImuSample> = (0..count).map(|number| imu.sample(&still, number)).collect();
            let rest = DVec3::new(0.0, 0.0, STANDARD_GRAVITY);
            for axis in 0..3 {
                for (noise, values) in [
                    (model.gyroscope(), all.iter().map(|it| it.angular_velocity[axis]).collect::<Vec<f64>>()),
                    (model.accelerometer(), all.iter().map(|it| (it.specific_force - rest)[axis]).collect()),
                ] {
                    // Half the mean square difference of neighbours is free of the bias, which hardly drifts meanwhile.
                    let squares: f64 = values.windows(2).map(|pair| (pair[1] - pair[0]).powi(2)).sum();
                    let sigma = (0.5 * squares / (values.len() - 1) as f64).sqrt();
                    assert!((sigma / noise.sigma(model.rate_hz()) - 1.0).abs() < 0.02, "{sigma}");
                }
            }
            assert_eq!(all[17], Imu::new(model, 3).sample(&still, 17));
            assert_ne!(all[17], Imu::new(model, 4).sample(&still, 17));
            let [turn, _] = all[0].variances;
            assert!((turn.sqrt() / model.gyroscope().sigma(model.rate_hz()) - 1.0).abs() < 0.01);
        }
    }

    /// Means over five seconds, a correlation time and more apart, vary by the bias instability and what is left of the white
    /// noise.
    #[test]
    fn biases_drift_by_their_instability() {
        let still = Trajectory::fixed(Pose::IDENTITY);
        let model = ImuModel::VectornavVn200;
        let (mut sum, mut count) = (0.0, 0);
        for seed in 0..60 {
            let mut imu = Imu::new(model, seed);
            for part in 0..3 {
                let first = 60_000 * part;
                let mean =
                    (first..first + 1000).map(|n| imu.sample(&still, n).angular_velocity.x).sum::<f64>() / 1000.0;
                sum += mean * mean;
                count += 1;
            }
        }
        let noise = model.gyroscope();
        let expected = (noise.instability.powi(2) + noise.density.powi(2) / 5.0).sqrt();
        let found = (sum / f64::from(count)).sqrt();
        // Five standard errors, and the drift within five seconds.
        assert!((found / expected - 1.0).abs() < 5.0 / (2.0 * f64::from(count)).sqrt() + 0.05, "{found} {expected}");
    }

    #[test]
    fn measurements_are_numbered_from_the_start_of_the_run() {
        let imu = Imu::new(ImuModel::XsensMti10, 0);
        assert_eq!([0.0, 0.01, 0.0101, -0.005, 1.0].map(|time| imu.first_from(time)), [0, 1, 2, 0, 100]);
        assert_eq!(imu.time_of(250), 2.5);
    }
}
