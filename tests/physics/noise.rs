use super::{assert_near, scan, scan_at, vector};
use echocast::cloud::FIELDS;
use echocast::{BuiltScene, Field, Frame, PointCloud, Pose, Profile, ScanOptions, Sensor};
use echocast_tests::reference::{SceneBuilder, Shape};
use glam::DVec3;

/// A camera of 300 x 300 pixels and a tilted wall that fills its view, 7 to 30 m away.
fn wall() -> BuiltScene {
    let mut scene = SceneBuilder::new();
    let paint = scene.reflector(0.5);
    scene.stand(Shape::plate(12.0 * DVec3::X, DVec3::new(-1.0, 0.5, 0.3).normalize(), 200.0), Some(paint));
    scene.finish().build().unwrap()
}

fn camera(sections: &str) -> Sensor {
    let pattern = "name: camera\nkind: lidar\npattern: {type: pinhole, resolution: [300, 300], fov_deg: [60, 60]}\n";
    Sensor::from_yaml(&format!("{pattern}{sections}\n"), "").unwrap()
}

/// Error of each measured range.
fn errors(cloud: &PointCloud) -> Vec<f64> {
    assert_eq!(cloud.len(), 90_000);
    let pairs = cloud.columns().range().iter().zip(cloud.columns().true_range());
    pairs.map(|(&measured, &truth)| f64::from(measured) - f64::from(truth)).collect()
}

fn mean(sample: &[f64]) -> f64 {
    sample.iter().sum::<f64>() / sample.len() as f64
}

fn sigma(sample: &[f64]) -> f64 {
    let mean = mean(sample);
    (sample.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / sample.len() as f64).sqrt()
}

/// Checks that `sample` is Gaussian with `mean` and `sigma`, within 3 standard errors of mean, deviation and tails.
#[track_caller]
pub(super) fn assert_gaussian(sample: &[f64], expected_mean: f64, expected_sigma: f64) {
    let n = sample.len() as f64;
    let error = expected_sigma / n.sqrt();
    assert_near("mean", mean(sample), expected_mean, 3.0 * error);
    assert_near("sigma", sigma(sample), expected_sigma, 3.0 * error / 2f64.sqrt());
    for (limit, probability) in [(1.0, 0.317_310_5), (2.0, 0.045_500_3), (3.0, 0.002_699_8)] {
        let outside = sample.iter().filter(|x| (**x - expected_mean).abs() > limit * expected_sigma).count() as f64 / n;
        assert_near("share of the tails", outside, probability, 3.0 * (probability * (1.0 - probability) / n).sqrt());
    }
    let above = sample.iter().filter(|x| **x > expected_mean).count() as f64 / n;
    assert_near("share above the mean", above, 0.5, 3.0 * 0.5 / n.sqrt());
}

#[test]
fn gaussian_noise_has_its_mean_and_sigma() {
    let cloud =
        scan(&wall(), &camera("noise: {range_sigma_m: 0.03, range_mean_m: 0.1}"), ScanOptions::default().seed(1));
    assert_gaussian(&errors(&cloud), 0.1, 0.03);
}

#[test]
fn timing_noise_grows_as_the_signal_falls() {
    let sections = "detection: {model: radar_equation, reflectance: 0.8, at_m: 80}\n\
                    noise: {range_sigma_m: 0.02, range_snr_sigma_m: 0.5}";
    let cloud = scan(&wall(), &camera(sections), ScanOptions::default().seed(2));
    let c = cloud.columns();
    let expected: Vec<f64> = (0..cloud.len())
        .map(|row| {
            let rho_eff = 0.5 * f64::from(c.cos_incidence()[row]);
            let relative_snr = rho_eff / f64::from(c.true_range()[row]).powi(2) / (0.8 / 80f64.powi(2));
            0.02f64.hypot(0.5 / relative_snr)
        })
        .collect();
    let spread = expected.iter().fold((f64::MAX, 0.0f64), |(least, most), s| (least.min(*s), most.max(*s)));
    assert!(spread.1 > 3.0 * spread.0, "the scene tells near from far: {spread:?}");
    let scaled: Vec<f64> = errors(&cloud).iter().zip(expected).map(|(error, sigma)| error / sigma).collect();
    assert_gaussian(&scaled, 0.0, 1.0);
}

#[test]
fn offsets_are_constant_or_a_share_of_the_range() {
    let cloud =
        scan(&wall(), &camera("noise: {range_offset_m: -0.25, range_offset_percent: 2}"), ScanOptions::default());
    for (&measured, &truth) in cloud.columns().range().iter().zip(cloud.columns().true_range()) {
        assert_near("range", measured.into(), 1.02 * f64::from(truth) - 0.25, 1e-5);
    }
}

#[test]
fn ranges_are_whole_steps_and_the_nearest_of_them() {
    let step = 0.004;
    let cloud = scan(&wall(), &camera("range: {resolution_m: 0.004}"), ScanOptions::default());
    for &range in cloud.columns().range() {
        assert_near("steps", f64::from(range) / step, (f64::from(range) / step).round(), 1e-3);
    }
    let errors = errors(&cloud);
    assert!(errors.iter().all(|error| error.abs() <= 0.501 * step));
    // Uniform over a step: sigma = step / sqrt(12), and the standard error of the variance of a uniform distribution.
    assert_near("sigma", sigma(&errors), step / 12f64.sqrt(), 3.0 * step / 12f64.sqrt() * (0.8 / 4.0 / 9e4f64).sqrt());

    // Noise comes before rounding.
    let noisy = "range: {resolution_m: 0.004}\nnoise: {range_sigma_m: 0.03}";
    let cloud = scan(&wall(), &camera(noisy), ScanOptions::default());
    for &range in cloud.columns().range() {
        assert_near("steps", f64::from(range) / step, (f64::from(range) / step).round(), 1e-3);
    }
}

#[test]
fn noise_moves_points_along_their_beams() {
    let camera = camera("noise: {range_sigma_m: 0.2}");
    let cloud = scan(&wall(), &camera, ScanOptions::default().seed(3));
    let (c, beams) = (cloud.columns(), camera.beams());
    for row in 0..cloud.len() {
        let along = vector(&beams.dir_x, &beams.dir_y, &beams.dir_z, row);
        let measured = f64::from(c.range()[row]) * along;
        assert!((cloud.position(row) - measured).length() < 1e-5);
        let truth = f64::from(c.true_range()[row]) * along;
        assert!((vector(c.true_x(), c.true_y(), c.true_z(), row) - truth).length() < 1e-5);
        assert_near("depth", c.depth()[row].into(), measured.x, 1e-5);
    }
}

/// Switching noise on changes what is measured and nothing else, bit by bit.
#[test]
fn truth_and_labels_do_not_feel_noise() {
    let radar = "detection: {model: radar_equation, reflectance: 0.8, at_m: 50}\n";
    let quiet = scan(&wall(), &camera(radar), ScanOptions::default());
    let noise = "range: {resolution_m: 0.01}\nnoise: {range_sigma_m: 0.05, range_offset_m: 1, range_snr_sigma_m: 0.1}";
    let noisy = scan(&wall(), &camera(&format!("{radar}{noise}")), ScanOptions::default());
    assert!(quiet.len() > 50_000);
    let measured = [Field::X, Field::Y, Field::Z, Field::Range, Field::Depth];
    for info in FIELDS {
        let equal = quiet.column(info.field).bytes() == noisy.column(info.field).bytes();
        assert_eq!(equal, !measured.contains(&info.field), "{}", info.name);
    }
    for (truth, range) in
        [(quiet.columns().true_range(), quiet.columns().range()), (quiet.columns().true_x(), quiet.columns().x())]
    {
        assert_eq!(truth, range, "without noise the truth is measured");
    }
}

/// Seed, frame and beam: each gives different numbers, uncorrelated with the others'.
#[test]
fn draws_of_other_seeds_frames_and_beams_are_uncorrelated() {
    let camera = camera("noise: {range_sigma_m: 0.05}");
    let draw = |seed, frame| {
        let options = ScanOptions::default().seed(seed).frame(frame);
        errors(&scan(&wall(), &camera, options)).iter().map(|error| error / 0.05).collect::<Vec<_>>()
    };
    let first = draw(7, 0);
    assert_eq!(first, draw(7, 0));
    let correlation = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>() / a.len() as f64;
    let limit = 3.0 / (first.len() as f64).sqrt();
    for (seed, frame) in [(8, 0), (7, 1), (7 << 32, 0), (0, 7)] {
        assert_near("correlation", correlation(&first, &draw(seed, frame)), 0.0, limit);
    }
    for lag in [1, 2, 4, 8, 16, 256, 300, 2048] {
        assert_near("correlation", correlation(&first[lag..], &first[..first.len() - lag]), 0.0, limit);
    }
}

/// Points of a wall all round: the reported azimuth, and with it the point, is off; range and elevation are not.
#[test]
fn azimuth_noise_turns_points_about_the_sensors_axis() {
    let mut sensor = camera("noise: {azimuth_sigma_deg: 0.2}");
    for frame in [Frame::World, Frame::Sensor] {
        let pose = Pose::at(1.0, 2.0, 3.0).with_rpy_deg(10.0, -20.0, 30.0);
        let options = ScanOptions::default().seed(3).coordinates(frame);
        let cloud = scan_at(&wall(), &sensor, pose, options);
        let c = cloud.columns();
        let to_sensor = |point: DVec3| match frame {
            Frame::World => pose.orientation.inverse() * (point - pose.position),
            Frame::Sensor => point,
        };
        let angles: Vec<f64> = (0..cloud.len())
            .map(|row| {
                let measured = to_sensor(cloud.position(row));
                let truth = to_sensor(cloud.origin + vector(c.true_x(), c.true_y(), c.true_z(), row));
                assert_near("range", measured.length(), truth.length(), 1e-4);
                assert_near("height", measured.z, truth.z, 1e-4);
                assert_near("azimuth", c.azimuth()[row].into(), measured.y.atan2(measured.x), 1e-5);
                (measured.y.atan2(measured.x) - truth.y.atan2(truth.x)).to_degrees()
            })
            .collect();
        assert_gaussian(&angles, 0.0, 0.2);
    }
    sensor.set("noise.azimuth_sigma_deg", "11").unwrap_err();
}

#[test]
fn dropout_loses_its_part_of_the_returns() {
    let cloud = scan(&wall(), &camera("noise: {dropout: 0.3}"), ScanOptions::default().seed(4));
    let kept = cloud.len() as f64 / 90_000.0;
    assert_near("part that is kept", kept, 0.7, 3.0 * (0.3f64 * 0.7 / 90_000.0).sqrt());
    assert_eq!(scan(&wall(), &camera("noise: {dropout: 1}"), ScanOptions::default()).len(), 0);
}

/// An instrument reports no range outside its limits, whatever the truth.
#[test]
fn measured_ranges_keep_to_the_limits() {
    let sections = "range: {min_m: 8, max_m: 20}\nnoise: {range_sigma_m: 0.5, range_offset_m: -1}";
    let cloud = scan(&wall(), &camera(sections), ScanOptions::default());
    let c = cloud.columns();
    assert!(c.range().iter().all(|range| (8.0..=20.0).contains(range)));
    assert!(c.true_range().iter().any(|range| *range > 19.9), "the truth reaches as far as the beam");
    let near = scan(&wall(), &camera("noise: {range_offset_m: -15}"), ScanOptions::default());
    assert!(near.columns().range().iter().all(|range| *range > 0.0) && near.len() < 90_000);
}

/// Echoes below the threshold, which the paper's program keeps, have no signal to time: their error is that at the
/// threshold.
#[test]
fn errors_of_undetected_echoes_stay_finite() {
    let sections = "detection: {model: radar_equation, reflectance: 0.9, at_m: 2}\nnoise: {range_snr_sigma_m: 0.02}";
    let options = ScanOptions::default().profile(Profile::Blainder);
    let cloud = scan(&wall(), &camera(sections), options);
    assert!(cloud.columns().intensity().iter().all(|intensity| *intensity == 0.0));
    assert_gaussian(&errors(&cloud), 0.0, 0.02);
}

/// UTM-30LX after Friedman 2013: mean and sigma by range.
#[test]
fn errors_follow_a_table() {
    let table = "noise: {range_table: [{at_m: 2, mean_m: 0.0114, sigma_m: 0.00933}, {at_m: 10.5, mean_m: 0.00735, \
                 sigma_m: 0.0175}, {at_m: 30, mean_m: 0.0009, sigma_m: 0.065}]}";
    let cloud = scan(&wall(), &camera(table), ScanOptions::default().seed(5));
    let scaled: Vec<f64> = (errors(&cloud).iter().zip(cloud.columns().true_range()))
        .map(|(error, &range)| {
            let range = f64::from(range);
            let (part, from, to) = if range < 10.5 {
                ((range - 2.0) / 8.5, [0.0114, 0.009_33], [0.007_35, 0.0175])
            } else {
                ((range - 10.5) / 19.5, [0.007_35, 0.0175], [0.0009, 0.065])
            };
            let [mean, sigma] = [0, 1].map(|k| from[k] + (to[k] - from[k]) * part.min(1.0));
            (error - mean) / sigma
        })
        .collect();
    assert_gaussian(&scaled, 0.0, 1.0);
}

#[test]
fn errors_may_grow_with_range() {
    let sensor = camera("noise: {range_sigma_m: 0.01, range_sigma_per_m: 0.002}");
    let cloud = scan(&wall(), &sensor, ScanOptions::default().seed(6));
    let scaled = errors(&cloud).into_iter().zip(cloud.columns().true_range());
    let scaled: Vec<f64> = scaled.map(|(error, &range)| error / (0.01 + 0.002 * f64::from(range))).collect();
    assert_gaussian(&scaled, 0.0, 1.0);
}

/// 1000 channels, each with its own error: the same in every scan, different in another instrument.
#[test]
fn channels_are_off_by_amounts_of_their_own() {
    let elevations = (0..1000).map(|channel| format!("{}", f64::from(channel) * 0.02 - 10.0)).collect::<Vec<_>>();
    let scan = |instrument: u32, seed: u64| {
        let yaml = format!(
            "name: many\nkind: lidar\npattern:\n  type: spinning\n  azimuth: {{fov_deg: 20, rate_hz: 10, step_deg: 5}}\n  \
             channels: {{elevation_deg: [{}]}}\n\
             noise: {{channel_bias_sigma_m: 0.04, channel_gain_sigma: 0.002, instrument: {instrument}}}\n",
            elevations.join(", ")
        );
        let options = ScanOptions::default().seed(seed).frame(seed as u32);
        scan(&wall(), &Sensor::from_yaml(&yaml, "").unwrap(), options)
    };
    let of = |cloud: &PointCloud| -> Vec<(u16, f64, f64)> {
        let c = cloud.columns();
        let row = |row: usize| {
            (c.channel()[row], c.true_range()[row].into(), f64::from(c.range()[row]) - f64::from(c.true_range()[row]))
        };
        (0..cloud.len()).map(row).collect()
    };
    let rows = of(&scan(1, 1));
    // From the nearest and the farthest point of each channel, its gain and bias.
    let mut channels = vec![[(f64::MAX, 0.0), (0.0, 0.0)]; 1000];
    for &(channel, range, error) in &rows {
        let [near, far] = &mut channels[usize::from(channel)];
        *near = if range < near.0 { (range, error) } else { *near };
        *far = if range > far.0 { (range, error) } else { *far };
    }
    let line = |[near, far]: [(f64, f64); 2]| {
        let gain = (far.1 - near.1) / (far.0 - near.0);
        (gain, near.1 - gain * near.0)
    };
    let (gains, biases): (Vec<f64>, Vec<f64>) = channels.into_iter().map(line).unzip();
    // Three standard errors; single precision leaves 1e-6 of a range.
    for (sample, expected) in [(&gains, 0.002), (&biases, 0.04)] {
        assert_near("mean", mean(sample), 0.0, 3.0 * expected / 1000f64.sqrt());
        assert_near("sigma", sigma(sample), expected, 3.0 * expected / 2000f64.sqrt());
    }
    for (channel, range, error) in rows.iter().copied() {
        let channel = usize::from(channel);
        assert_near("error", error, gains[channel] * range + biases[channel], 1e-4);
    }
    assert_eq!(rows, of(&scan(1, 2)), "the scan's seed and frame do not matter");
    assert_ne!(rows, of(&scan(2, 1)));
}

/// Points and azimuths lie on the encoder's steps.
#[test]
fn an_encoder_has_steps() {
    let (step, sensor) = (0.36, camera("noise: {azimuth_step_deg: 0.36}"));
    let cloud = scan(&wall(), &sensor, ScanOptions::default());
    let (c, beams) = (cloud.columns(), sensor.beams());
    let mut errors = Vec::new();
    for row in 0..cloud.len() {
        let reported = f64::from(c.azimuth()[row]).to_degrees();
        assert_near("steps", reported / step, (reported / step).round(), 1e-4);
        let point = cloud.position(row);
        assert_near("azimuth", point.y.atan2(point.x).to_degrees(), reported, 1e-4);
        assert_near("height", point.z, f64::from(c.true_z()[row]), 1e-4);
        let nominal = f64::from(beams.dir_y[row]).atan2(beams.dir_x[row].into()).to_degrees();
        errors.push(reported - nominal);
    }
    assert!(errors.iter().all(|error| error.abs() < 0.5 * step + 1e-4));
    assert!(sigma(&errors) > 0.25 * step, "not all beams are on steps");
}

/// The traced ray goes elsewhere than the reported beam.
#[test]
fn pointing_noise_moves_rays_and_not_what_is_reported() {
    let sensor = camera("noise: {pointing_sigma_deg: 0.1}");
    let beams = sensor.beams();
    for frame in [Frame::World, Frame::Sensor] {
        let pose = Pose::at(0.5, 0.2, 0.3).with_rpy_deg(4.0, -5.0, 6.0);
        let options = ScanOptions::default().seed(9).coordinates(frame);
        let cloud = scan_at(&wall(), &sensor, pose, options);
        assert_eq!(cloud.len(), 90_000);
        let c = cloud.columns();
        let [to_sensor, to_world]: [&dyn Fn(DVec3) -> DVec3; 2] = match frame {
            Frame::World => [&|point| pose.orientation.inverse() * (point - pose.position), &|point| point],
            Frame::Sensor => [&|point| point, &|point| pose.orientation * point + pose.position],
        };
        let (mut left, mut up) = (Vec::new(), Vec::new());
        for row in 0..cloud.len() {
            let nominal = vector(&beams.dir_x, &beams.dir_y, &beams.dir_z, row);
            let (measured, truth) =
                (cloud.position(row), cloud.origin + vector(c.true_x(), c.true_y(), c.true_z(), row));
            assert!((to_sensor(measured) - f64::from(c.range()[row]) * nominal).length() < 1e-4);
            assert_near("azimuth", c.azimuth()[row].into(), nominal.y.atan2(nominal.x), 1e-6);
            let wall = (to_world(truth) - 12.0 * DVec3::X).dot(DVec3::new(-1.0, 0.5, 0.3).normalize());
            assert_near("distance of the true point from the wall", wall, 0.0, 1e-4);
            let across = DVec3::Z.cross(nominal).normalize();
            let direction = to_sensor(truth).normalize();
            left.push(direction.dot(across).to_degrees());
            up.push(direction.dot(nominal.cross(across)).to_degrees());
        }
        assert_gaussian(&left, 0.0, 0.1);
        assert_gaussian(&up, 0.0, 0.1);
        let correlation = left.iter().zip(&up).map(|(a, b)| a * b).sum::<f64>() / 9e4 / 0.01;
        assert_near("correlation", correlation, 0.0, 3.0 / 300.0);
    }
}

/// Every firing has one reported time; the sensor is where it is at the true one.
#[test]
fn times_are_reported_with_an_error() {
    let yaml = |noise: &str| {
        let pattern = "{type: spinning, azimuth: {fov_deg: 60, rate_hz: 10, step_deg: 0.003}, channels: \
                       {elevation_deg: [0, 1], fire_time_us: [0, 2]}}";
        Sensor::from_yaml(&format!("name: spinning\nkind: lidar\npattern: {pattern}\n{noise}\n"), "").unwrap()
    };
    let cloud = scan(&wall(), &yaml("noise: {time_sigma_us: 5}"), ScanOptions::default().seed(4));
    let plain = scan(&wall(), &yaml(""), ScanOptions::default().seed(4));
    assert!(cloud.len() > 20_000 && cloud.columns().x() == plain.columns().x());
    let late =
        cloud.columns().time().iter().zip(plain.columns().time()).map(|(a, b)| (a - b) * 1e6).collect::<Vec<_>>();
    let (first, second) = late.split_at(cloud.len() / 2);
    assert_gaussian(first, 0.0, 5.0);
    for (a, b) in first.iter().zip(second) {
        assert_near("of one firing", *a, *b, 1e-9);
    }
}

/// Returns of low reflectivity are lost more often: 0.4 (1 - I / 0.3) of them.
#[test]
fn weak_returns_get_lost_more_often() {
    let all = scan(&wall(), &camera(""), ScanOptions::default());
    let cloud =
        scan(&wall(), &camera("noise: {dropout_weak: {below: 0.3, at_zero: 0.4}}"), ScanOptions::default().seed(8));
    let chance = |intensity: f32| 0.4 * (1.0 - f64::from(intensity) / 0.3).max(0.0);
    let weak = |cloud: &PointCloud| cloud.columns().intensity().iter().filter(|&&intensity| intensity < 0.3).count();
    let (lost, variance) = (all.columns().intensity().iter().map(|&intensity| chance(intensity)))
        .fold((0.0, 0.0), |(sum, variance), p| (sum + p, variance + p * (1.0 - p)));
    assert!(lost > 500.0, "{lost}");
    assert_near("lost", (all.len() - cloud.len()) as f64, lost, 3.0 * f64::sqrt(variance));
    assert_eq!(weak(&all) - weak(&cloud), all.len() - cloud.len(), "strong ones stay");
}

/// What one kind of noise draws does not depend on the others.
#[test]
fn switching_a_noise_on_does_not_move_the_others() {
    let radar = "range: {max_m: 60}\ndetection: {model: radar_equation, reflectance: 0.5, at_m: 60}";
    let scan = |noise: &str, sections: &str| {
        let sensor = camera(&format!("{sections}\nnoise: {{range_sigma_m: 0.02, azimuth_sigma_deg: 0.1, {noise}}}"));
        scan(&wall(), &sensor, ScanOptions::default().seed(12))
    };
    let plain = scan("dropout: 0", radar);
    assert_eq!(plain.len(), 90_000);
    let chance = "range: {max_m: 60}\n\
                  detection: {model: statistical, reflectance: 0.1, at_m: 15, tnr: 4, bandwidth_mhz: 100}";
    let cases = [
        ("dropout: 0.2", radar),
        ("dropout_weak: {below: 0.5, at_zero: 0.4}", radar),
        ("time_sigma_us: 3", radar),
        ("dropout: 0", chance),
    ];
    for (noise, sections) in cases {
        let cloud = scan(noise, sections);
        let (c, p) = (cloud.columns(), plain.columns());
        let surfaces = (0..cloud.len()).filter(|&row| c.cause()[row] == 0);
        for row in surfaces {
            let beam = c.beam()[row] as usize;
            let of =
                |c: &echocast::cloud::Columns, row: usize| (c.x()[row], c.y()[row], c.range()[row], c.azimuth()[row]);
            assert_eq!(of(c, row), of(p, beam), "{noise} {sections}");
        }
        assert!(noise.starts_with("time") || cloud.len() < plain.len());
    }
    // Pointing noise changes what is hit; the range error stays the same.
    let pointed = scan("pointing_sigma_deg: 0.05", radar);
    for (a, b) in errors(&pointed).iter().zip(errors(&plain)) {
        assert_near("error", *a, b, 1e-5);
    }
    // A hundred-thousandth of a pointing error hits the same place: random decisions stay the same.
    let quiet = scan("dropout: 0", chance);
    assert_eq!(scan("pointing_sigma_deg: 1.0e-9", chance).columns().beam(), quiet.columns().beam());
}
