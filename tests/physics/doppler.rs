//! Measured radial velocities.

use super::noise::assert_gaussian;
use super::{assert_near, scan, vector};
use echocast::cloud::FIELDS;
use echocast::{
    BuiltScene, Cause, Engine, Environment, Field, FieldSet, LiveScene, PointCloud, Pose, ScanOptions, Sensor,
    Trajectory,
};
use echocast_tests::reference::{SceneBuilder, Shape};
use glam::{DAffine3, DVec3};

/// 90,000 beams ahead.
fn fmcw(sections: &str) -> Sensor {
    let pattern = "name: fmcw\nkind: lidar\npattern: {type: pinhole, resolution: [300, 300], fov_deg: [60, 60]}\n";
    Sensor::from_yaml(&format!("{pattern}{sections}\n"), "").unwrap()
}

fn wall() -> BuiltScene {
    let mut scene = SceneBuilder::new();
    scene.stand(Shape::plate(12.0 * DVec3::X, -DVec3::X, 200.0), None);
    scene.finish().build().unwrap()
}

/// A sensor on its way, with a velocity that it keeps.
fn drive(velocity: DVec3) -> Trajectory {
    let keys = [0.0, 1.0].map(|time| (time, Pose { position: velocity * time, ..Pose::IDENTITY }));
    Trajectory::new(keys.to_vec()).unwrap()
}

/// Measured minus true velocity, of every row.
fn errors(cloud: &PointCloud) -> Vec<f64> {
    let c = cloud.columns();
    c.doppler().iter().zip(c.radial_velocity()).map(|(&is, &truth)| f64::from(is) - f64::from(truth)).collect()
}

#[test]
fn the_error_is_gaussian() {
    let options = || ScanOptions::default().seed(3).fields(FieldSet::all());
    let cloud = wall().scan(&fmcw("doppler: {sigma_m_s: 0.05}"), &drive(DVec3::X), &options()).unwrap();
    assert_eq!(cloud.len(), 90_000);
    assert_gaussian(&errors(&cloud), 0.0, 0.05);
    // The noise changes no other column, and an exact instrument measures the truth.
    let exact = wall().scan(&fmcw("doppler: {}"), &drive(DVec3::X), &options()).unwrap();
    assert_eq!(exact.columns().doppler(), cloud.columns().radial_velocity());
    for info in FIELDS.iter().filter(|info| info.field != Field::Doppler) {
        assert_eq!(exact.column(info.field).bytes(), cloud.column(info.field).bytes(), "{}", info.name);
    }
    let alone = options().fields(FieldSet::EMPTY.with(Field::Doppler));
    let alone = wall().scan(&fmcw("doppler: {sigma_m_s: 0.05}"), &drive(DVec3::X), &alone).unwrap();
    assert_eq!(alone.columns().doppler(), cloud.columns().doppler());
    assert!(alone.columns().radial_velocity().is_empty());
}

/// The world stands still: it approaches a sensor that drives by `-v cos`, at every angle.
#[test]
fn a_still_world_approaches_a_driving_sensor() {
    let velocity = DVec3::new(21.0, -4.0, 1.0);
    let options = ScanOptions::default().fields(FieldSet::all());
    let cloud = wall().scan(&fmcw("doppler: {}"), &drive(velocity), &options).unwrap();
    let (c, beams) = (cloud.columns(), fmcw("").beams().clone());
    for row in 0..cloud.len() {
        let along = vector(&beams.dir_x, &beams.dir_y, &beams.dir_z, c.beam()[row] as usize);
        assert_near("doppler", c.doppler()[row].into(), -velocity.dot(along), 1e-5);
    }
}

/// 21 m/s and less wrap at 10 m/s: with the noise, and into a half-open interval.
#[test]
fn velocities_wrap_after_the_noise() {
    let scan = |doppler: &str| {
        let options = ScanOptions::default().fields(FieldSet::all());
        wall().scan(&fmcw(&format!("doppler: {doppler}")), &drive(21.0 * DVec3::X), &options).unwrap()
    };
    let wrapped = scan("{sigma_m_s: 0.5, ambiguity_m_s: 10}");
    let endless = scan("{sigma_m_s: 0.5}");
    let mut turns = 0;
    for (&is, &whole) in wrapped.columns().doppler().iter().zip(endless.columns().doppler()) {
        assert!((-5.0..5.0).contains(&is), "{is}");
        let turn = f64::from(whole - is) / 10.0;
        assert_near("turns", turn, turn.round(), 1e-6);
        turns = turns.min(turn.round() as i32);
    }
    assert_eq!(turns, -2);
    assert_eq!(wrapped.columns().radial_velocity(), endless.columns().radial_velocity());
}

/// A wall that comes nearer at 30 m/s.
#[test]
fn presets_see_a_wall_approach() {
    let mut builder = SceneBuilder::new();
    builder.stand(Shape::plate(DVec3::ZERO, -DVec3::X, 200.0), None);
    let mut scene = LiveScene::new(&Engine::new().unwrap());
    let wall = scene.add_scene(&builder.finish()).unwrap()[0];
    let at = |time: f64| (time, DAffine3::from_translation(DVec3::X * (40.0 - 30.0 * time)));
    scene.set_motion(wall, &[at(0.0), at(1.0)]).unwrap();
    scene.set_time(0.0, 0.1).unwrap();
    let built = scene.commit().unwrap();
    for name in ["aeva_aeries_ii", "voyant_carbon"] {
        let sensor = Sensor::preset(name).unwrap();
        let sigma = sensor.spec().doppler.unwrap().sigma_m_s;
        assert!(sigma > 0.0, "{name}");
        let fields = sensor.default_fields();
        assert!(fields.contains(Field::Doppler) && !fields.contains(Field::RadialVelocity), "{name}");
        let options = ScanOptions::default().fields(fields.with(Field::Beam));
        let cloud = built.scan(&sensor, &Trajectory::fixed(Pose::IDENTITY), &options).unwrap();
        assert!(cloud.len() > 10_000, "{name}: {}", cloud.len());
        let c = cloud.columns();
        let beams = sensor.beams();
        let errors = (0..cloud.len())
            .map(|row| f64::from(c.doppler()[row]) + 30.0 * f64::from(beams.dir_x[c.beam()[row] as usize]));
        assert_gaussian(&errors.collect::<Vec<_>>(), 0.0, sigma);
    }
}

/// What is in the air stands still, and approaches a driving sensor as the world does; noise is anywhere.
#[test]
fn drops_stand_still_and_false_alarms_do_anything() {
    let rain = ScanOptions::default()
        .environment(Environment::from_yaml("{rain: {rate_mm_h: 50}}").unwrap())
        .fields(FieldSet::all());
    let receiver = "range: {max_m: 150}\nbeam: {pulse_ns: 5, divergence_mrad: 3}\ndetection: {model: statistical, \
                    reflectance: 0.1, at_m: 100, tnr: 3.5, bandwidth_mhz: 300}\n";
    for (ambiguity, mode) in [("ambiguity_m_s: 40", "strongest"), ("ambiguity_m_s: 40", "all"), ("", "strongest")] {
        let sensor = fmcw(&format!("{receiver}returns: {{mode: {mode}}}\ndoppler: {{{ambiguity}}}"));
        let empty = SceneBuilder::new().finish().build().unwrap();
        let cloud = empty.scan(&sensor, &drive(7.0 * DVec3::X), &rain).unwrap();
        let (c, beams) = (cloud.columns(), sensor.beams());
        let (mut drops, mut alarms) = (0, Vec::new());
        for row in 0..cloud.len() {
            let ahead = f64::from(beams.dir_x[c.beam()[row] as usize]);
            assert_near("true velocity", c.radial_velocity()[row].into(), -7.0 * ahead, 1e-5);
            if c.cause()[row] == Cause::FalseAlarm as u8 {
                alarms.push(f64::from(c.doppler()[row]));
            } else {
                drops += 1;
                assert_eq!(c.doppler()[row], c.radial_velocity()[row]);
            }
        }
        let n = alarms.len() as f64;
        assert!(drops > 100 && n > 500.0, "{drops} drops, {n} false alarms");
        if ambiguity.is_empty() {
            assert!(alarms.iter().all(|velocity| velocity.is_nan()));
        } else {
            // Mean and variance of a uniform distribution, within three standard errors.
            let mean = alarms.iter().sum::<f64>() / n;
            let variance = alarms.iter().map(|velocity| velocity * velocity).sum::<f64>() / n;
            assert!(alarms.iter().all(|velocity| (-20.0..20.0).contains(velocity)));
            assert_near("mean", mean, 0.0, 3.0 * 40.0 / (12.0 * n).sqrt());
            assert_near("variance", variance, 1600.0 / 12.0, 3.0 * 1600.0 / (180.0 * n).sqrt());
        }
    }
}

#[test]
fn instruments_without_doppler_say_so() {
    let mut sensor = fmcw("");
    let cloud = scan(&wall(), &sensor, ScanOptions::default());
    assert!(cloud.len() == 90_000 && cloud.columns().doppler().iter().all(|velocity| velocity.is_nan()));
    assert_eq!(sensor.default_fields(), FieldSet::default());
    assert!(!FieldSet::default().contains(Field::Doppler));
    let explain = |sensor: &Sensor| {
        wall().explain(sensor, &drive(2.0 * DVec3::X), &ScanOptions::default(), 150 * 300 + 150).unwrap()
    };
    assert!(!explain(&sensor).contains("m/s"));

    sensor.set("doppler.sigma_m_s", "0").unwrap();
    let text = explain(&sensor);
    assert!(text.contains("doppler -2.0000 m/s, true radial velocity -2.0000 m/s"), "{text}");
    let list = FieldSet::parse_with("default,beam", sensor.default_fields()).unwrap();
    assert_eq!(list, FieldSet::default().with(Field::Doppler).with(Field::Beam));
    sensor.set("doppler", "null").unwrap();
    assert_eq!(sensor.spec().doppler, None);
}
