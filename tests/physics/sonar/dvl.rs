//! Doppler velocity logs: what their beams measure of a bed that is met analytically, and the velocity that follows.

use super::{flat, nothing, set, sonar, water};
use crate::assert_near;
use echocast::emitter::lobe::{Lobe, Piston, Shape as LobeShape};
use echocast::{BuiltScene, Engine, Field, LiveScene, Ping, Pose, ScanOptions, Sensor, Track, Trajectory};
use echocast_tests::reference::{SceneBuilder, Shape};
use glam::{DAffine3, DQuat, DVec3};

/// Height of the sonar above the bed, m.
const HEIGHT: f64 = 20.0;

const JANUS: f64 = 30.0;

fn log(more: &str) -> Sensor {
    let sensor = sonar("type: dvl, beam_deg: 4, rays: 4096", "range.max_m=40");
    set(sensor, more)
}

/// Unit vectors along the axes of its beams.
fn axes(ping: &Ping) -> [DVec3; 4] {
    std::array::from_fn(|beam| {
        let [azimuth, elevation] = ping.layout().axes[beam].map(f64::from);
        DVec3::new(elevation.cos() * azimuth.cos(), elevation.cos() * azimuth.sin(), elevation.sin())
    })
}

/// A way with this velocity, at `pose` at 0 s.
fn under_way(pose: Pose, velocity: DVec3) -> Trajectory {
    let keys = [-10.0, 10.0].map(|time| (time, Pose { position: pose.position + velocity * time, ..pose }));
    Trajectory::new(keys.to_vec()).unwrap()
}

fn options(more: &str) -> ScanOptions {
    ScanOptions::default().environment(water(more))
}

fn ping(scene: &BuiltScene, sensor: &Sensor, velocity: DVec3, options: &ScanOptions) -> Ping {
    scene.ping(sensor, &under_way(Pose::at(0.0, 0.0, HEIGHT), velocity), options).unwrap()
}

fn radial(track: &Track) -> [f64; 4] {
    track.radial.map(f64::from)
}

/// Mean and standard deviation.
fn statistics(values: &[f64]) -> [f64; 2] {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    [mean, (values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (count - 1.0)).sqrt()]
}

/// Mean direction of the energy that a beam gets back from a flat bed of Lambert's law: a steradian at the angle `a` from
/// straight down meets `r^2 / cos a` of it, which returns `cos^2 a / r^4`, and `r = h / cos a`; so `b^4 cos^3 a`.
fn mean_direction(axis: DVec3, width_deg: f64) -> DVec3 {
    let lobe = Lobe::Shape(LobeShape::Piston(Piston::Width(width_deg))).at(1.0);
    let across = [axis.cross(DVec3::Z).normalize(), axis.cross(axis.cross(DVec3::Z)).normalize()];
    let (mut sum, mut weight) = (DVec3::ZERO, 0.0);
    let steps = 400;
    let most = 3.0 * width_deg.to_radians();
    for ring in 0..steps {
        let beside = most * (f64::from(ring) + 0.5) / f64::from(steps);
        for turn in 0..64 {
            let (sin, cos) = (f64::from(turn) * std::f64::consts::TAU / 64.0).sin_cos();
            let direction = axis * beside.cos() + (across[0] * cos + across[1] * sin) * beside.sin();
            let energy = lobe.amplitude(beside.sin()).powi(4) * (-direction.z).max(0.0).powi(3) * beside.sin();
            sum += direction * energy;
            weight += energy;
        }
    }
    sum / weight
}

#[test]
fn beams_measure_the_velocity_along_the_sound_that_they_hear() {
    let bed = flat(50.0);
    for width in [2.0, 4.0, 8.0] {
        let sensor = log(&format!("pattern.beam_deg={width} pattern.rays=16384"));
        for velocity in [DVec3::new(2.0, 0.0, 0.0), DVec3::new(-1.0, 3.0, 0.4)] {
            let ping = ping(&bed, &sensor, velocity, &options(""));
            assert_eq!(ping.soundings().len(), 4, "{width}");
            let track = ping.bottom_track.unwrap();
            for (axis, measured) in axes(&ping).into_iter().zip(radial(&track)) {
                let expected = -velocity.dot(mean_direction(axis, width));
                // A beam of 8 degrees is 1 % off its axis.
                assert_near("radial velocity", measured, expected, 1e-3 * velocity.length());
            }
            // A beam is broad: the mean of its directions is shorter than one, and leans towards the near bed.
            let error = (track.velocity.as_dvec3() - velocity).length() / velocity.length();
            assert!(error < 0.01 * (width / 4.0).powi(2), "{width}: {error}");
            assert!(track.error.abs() < 2e-3, "{}", track.error);
            assert_eq!(ping.water_track, None);
        }
    }
}

#[test]
fn velocities_are_those_of_the_sonar_s_own_frame() {
    let bed = flat(50.0);
    let turned = DQuat::from_rotation_z(0.7) * DQuat::from_rotation_y(0.1) * DQuat::from_rotation_x(-0.15);
    let pose = Pose { orientation: turned, ..Pose::at(0.0, 0.0, HEIGHT) };
    let velocity = DVec3::new(1.2, -0.5, 0.3);
    let ping = bed.ping(&log("pattern.beam_deg=1"), &under_way(pose, velocity), &options("")).unwrap();
    let found = ping.bottom_track.unwrap().velocity.as_dvec3();
    assert!((turned * found - velocity).length() < 2e-3, "{found}");
}

#[test]
fn errors_of_many_pings_have_the_sigma_that_was_asked_for() {
    let bed = flat(400.0);
    let sigma = 0.01;
    let sensor = log(&format!("pattern.rays=64 dvl.sigma_m_s={sigma}"));
    let exact = log("pattern.rays=64");
    let velocity = DVec3::new(1.0, 0.5, 0.0);
    let mut errors = vec![Vec::new(); 6];
    for frame in 0..600 {
        let options = options("").frame(frame);
        let [found, truth] =
            [&sensor, &exact].map(|sensor| ping(&bed, sensor, velocity, &options).bottom_track.unwrap());
        let beyond = (found.velocity - truth.velocity).as_dvec3();
        let (noisy, clear) = (radial(&found), radial(&truth));
        for (list, error) in errors.iter_mut().zip([
            noisy[0] - clear[0],
            noisy[3] - clear[3],
            beyond.x,
            beyond.y,
            beyond.z,
            f64::from(found.error - truth.error),
        ]) {
            list.push(error);
        }
    }
    let (sin, cos) = JANUS.to_radians().sin_cos();
    let level = sigma / (2f64.sqrt() * sin);
    for (error, expected) in errors.iter().zip([sigma, sigma, level, level, sigma / (2.0 * cos), level]) {
        let [mean, spread] = statistics(error);
        assert_near("standard deviation", spread, expected, 0.1 * expected);
        assert_near("mean", mean, 0.0, 4.0 * expected / 600f64.sqrt());
    }
    let [a, b] = [0, 1].map(|beam| &errors[beam]);
    let together = a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>() / 600.0 / sigma.powi(2);
    assert!(together.abs() < 0.2, "beams err on their own: {together}");
}

#[test]
fn an_instrument_has_a_scale_and_biases_of_its_own() {
    let bed = flat(400.0);
    let velocity = DVec3::X * 2.0;
    let truth = radial(&ping(&bed, &log("pattern.rays=256"), velocity, &options("")).bottom_track.unwrap());
    let errors: Vec<f64> = (0..300)
        .map(|number| {
            let sensor = log(&format!("pattern.rays=256 dvl.scale_sigma=0.01 dvl.instrument={number}"));
            let track = ping(&bed, &sensor, velocity, &options("")).bottom_track.unwrap();
            let scales: Vec<f64> = radial(&track).iter().zip(truth).map(|(is, was)| is / was - 1.0).collect();
            assert!(scales.iter().all(|scale| (scale - scales[0]).abs() < 1e-5), "{scales:?}");
            scales[0]
        })
        .collect();
    let [_, spread] = statistics(&errors);
    assert_near("scale", spread, 0.01, 0.001);
    // Pings do not change it.
    let biased = log("pattern.rays=256 dvl.bias_sigma_m_s=0.02");
    let tracks = [0, 1].map(|frame| {
        let options = options("").frame(frame);
        ping(&bed, &biased, velocity, &options).bottom_track.unwrap()
    });
    assert_eq!(tracks[0], tracks[1]);
    assert!(radial(&tracks[0]).iter().zip(truth).all(|(is, was)| (is - was).abs() > 1e-4), "{tracks:?}");
}

#[test]
fn what_the_instrument_believes_of_sound_scales_its_velocities() {
    let bed = flat(400.0);
    let velocity = DVec3::new(1.5, -0.4, 0.0);
    let track = |more: &str| ping(&bed, &log(""), velocity, &options(more)).bottom_track.unwrap();
    let [right, wrong] = ["", ", assumed_speed_m_s: 1450"].map(|more| radial(&track(more)));
    for (right, wrong) in right.into_iter().zip(wrong) {
        assert_near("ratio", wrong / right, 1450.0 / 1500.0, 1e-4);
    }
}

#[test]
fn velocities_beyond_the_ambiguity_wrap() {
    let bed = flat(400.0);
    let fast = DVec3::X * 10.0;
    let [whole, wrapped] = ["", "dvl.ambiguity_m_s=6"]
        .map(|more| radial(&ping(&bed, &log(more), fast, &options("")).bottom_track.unwrap()));
    for (whole, wrapped) in whole.into_iter().zip(wrapped) {
        assert_near("wrapped", wrapped, whole - 6.0 * (whole / 6.0).round(), 1e-5);
        assert!(whole.abs() > 3.0);
    }
}

/// A bed that drifts, as ice does over a sonar that looks up, or a barge's hull.
#[test]
fn the_bed_s_own_velocity_counts() {
    let mut builder = SceneBuilder::new();
    builder.stand(Shape::plate(DVec3::ZERO, DVec3::Z, 200.0), None);
    let mut scene = LiveScene::new(&Engine::new().unwrap());
    let objects = scene.add_scene(&builder.finish()).unwrap();
    let drift = DVec3::new(0.8, 0.3, 0.0);
    let keys = [0.0, 2.0].map(|time| (time, DAffine3::from_translation(drift * time)));
    scene.set_motion(objects[0], &keys).unwrap();
    let sensor = log("pattern.beam_deg=1");
    scene.set_time(0.0, sensor.scan_time()).unwrap();
    let own = DVec3::new(0.5, 0.0, 0.0);
    let found = ping(&scene.commit().unwrap(), &sensor, own, &options("")).bottom_track.unwrap();
    assert!((found.velocity.as_dvec3() - (own - drift)).length() < 2e-3, "{found:?}");
}

#[test]
fn water_is_tracked_where_it_scatters_and_is_free_of_the_bottom() {
    let (bed, sea) = (flat(400.0), nothing());
    let layer = |from: f64, to: f64| {
        let layer = format!("{{from_m: {from}, to_m: {to}, sigma_m_s: 0}}");
        let mut sensor = log("pattern.beam_deg=1");
        sensor.set("dvl.water", &layer).unwrap();
        sensor
    };
    let scatter = ", volume_backscatter_db: -80, current_m_s: [0.3, -0.6, 0.1]";
    let current = DVec3::new(0.3, -0.6, 0.1);
    let own = DVec3::new(1.0, 0.0, 0.0);
    for scene in [&bed, &sea] {
        let track = ping(scene, &layer(4.0, 10.0), own, &options(scatter)).water_track.unwrap();
        assert!((track.velocity.as_dvec3() - (own - current)).length() < 1e-3, "{track:?}");
    }
    // The bed is not moved by it.
    let over = ping(&bed, &layer(4.0, 10.0), own, &options(scatter)).bottom_track.unwrap();
    assert!((over.velocity.as_dvec3() - own).length() < 2e-3, "{over:?}");
    // Straight down a sidelobe hears the bed at 20 m, before a beam has come 18 m down, 20.8 m far.
    for (to, heard) in [(17.0, true), (18.0, false)] {
        let track = ping(&bed, &layer(10.0, to), own, &options(scatter)).water_track.unwrap();
        assert_eq!(track.velocity.is_nan(), !heard, "{to}: {track:?}");
    }
    // Nothing in it scatters; too little does.
    assert_eq!(
        ping(&bed, &layer(4.0, 10.0), own, &options("")).water_track.unwrap().radial.map(f32::is_nan),
        [true; 4]
    );
    let mut deaf = layer(4.0, 10.0);
    deaf.set("acoustics.noise_level_db", "150").unwrap();
    assert!(ping(&bed, &deaf, own, &options(scatter)).water_track.unwrap().velocity.is_nan());
}

#[test]
fn without_a_bottom_in_range_there_is_no_velocity() {
    let sensor = log("");
    let lost = ping(&nothing(), &sensor, DVec3::X, &options(""));
    assert!(lost.soundings().is_empty());
    let track = lost.bottom_track.unwrap();
    assert!(track.velocity.is_nan() && track.error.is_nan() && track.radial.iter().all(|rate| rate.is_nan()));
    // Rows of an organised cloud say so, too.
    let options = options("").organised(true).fields(sensor.default_fields());
    let cloud = nothing().scan(&sensor, &under_way(Pose::at(0.0, 0.0, HEIGHT), DVec3::X), &options).unwrap();
    assert_eq!(cloud.len(), 4);
    assert!(cloud.columns().bottom_track_x().iter().chain(cloud.columns().doppler()).all(|value| value.is_nan()));
    assert!(cloud.columns().water_track_x().is_empty(), "it tracks none");
}

#[test]
fn three_beams_are_enough_and_two_are_not() {
    let part = |corner: DVec3, size: [f64; 2]| Shape::quad(corner, DVec3::X * size[0], DVec3::Y * size[1]);
    let scene = |shapes: Vec<Shape>| {
        let mut builder = SceneBuilder::new();
        for shape in shapes {
            builder.stand(shape, None);
        }
        builder.finish().build().unwrap()
    };
    let port = || part(DVec3::new(-100.0, 0.0, 0.0), [200.0, 100.0]);
    let astern = || part(DVec3::new(-100.0, -100.0, 0.0), [100.0, 100.0]);
    // Without sidelobes, which would lock onto the rest of the bed.
    let mut sensor = log("acoustics.noise_level_db=0");
    sensor.set("pattern.beam_deg", "{shape: gaussian, width_deg: 1}").unwrap();
    let velocity = DVec3::new(1.0, 0.2, 0.0);
    let three = ping(&scene(vec![port(), astern()]), &sensor, velocity, &options(""));
    let track = three.bottom_track.unwrap();
    let beams: Vec<u32> = three.soundings().iter().map(|sounding| sounding.beam).collect();
    assert_eq!(beams, [0, 1, 2]);
    assert!((track.velocity.as_dvec3() - velocity).length() < 2e-3 && track.error.is_nan(), "{track:?}");
    let two = ping(&scene(vec![port()]), &sensor, velocity, &options("")).bottom_track.unwrap();
    assert_eq!(two.radial.map(f32::is_nan), [false, false, true, true]);
    assert!(two.velocity.is_nan());
}

#[test]
fn points_carry_the_velocities_of_their_ping() {
    let sensor = log("");
    let path = under_way(Pose::at(0.0, 0.0, HEIGHT), DVec3::X);
    let options = options("").fields(sensor.default_fields());
    let bed = flat(400.0);
    let (cloud, ping) = (bed.scan(&sensor, &path, &options).unwrap(), bed.ping(&sensor, &path, &options).unwrap());
    let track = ping.bottom_track.unwrap();
    let columns = cloud.columns();
    assert!(cloud.fields().contains(Field::Doppler) && cloud.fields().contains(Field::BottomTrackError));
    assert_eq!(columns.doppler(), track.radial);
    assert_eq!(columns.bottom_track_x(), [track.velocity.x; 4]);
    assert_eq!(columns.bottom_track_y(), [track.velocity.y; 4]);
    assert_eq!(columns.bottom_track_z(), [track.velocity.z; 4]);
    assert_eq!(columns.bottom_track_error(), [track.error; 4]);
    assert!(columns.doppler()[0] < -0.3, "ahead, the bed comes nearer: {}", columns.doppler()[0]);
}

#[test]
fn what_makes_no_sense_is_refused() {
    let refused = |key: &str, value: &str| log("").set(key, value).unwrap_err().to_string();
    for (key, value, expected) in [
        ("pattern.janus_deg", "80", "pattern.janus_deg: is 80; allowed: 5 to 60"),
        (
            "pattern.azimuths_deg",
            "[45, 135, 225, 50]",
            "pattern.azimuths_deg[3]: is 50; allowed: at least 10 from those of other beams, such as 45",
        ),
        ("dvl.sigma_m_s", "-1", "dvl.sigma_m_s: is -1; allowed: 0 to 10"),
        (
            "dvl.water",
            "{from_m: 5, to_m: 38, sigma_m_s: 0.1}",
            "dvl.water.to_m: is 38; allowed: at most 34.64, where beams reach range.max_m",
        ),
        ("dvl.watr", "{}", "near: water"),
    ] {
        let found = refused(key, value);
        assert!(found.contains(expected), "{key}: {value}\n gives {found}\n not   {expected}");
    }
    let error = sonar("type: single_beam, beam_deg: 2", "").set("dvl", "{}").unwrap_err().to_string();
    assert!(error.contains("dvl: is given; allowed: with pattern.type: dvl only"), "{error}");
}
