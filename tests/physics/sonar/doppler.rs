//! What motion does to ranges of pulses that sweep their frequency: the range-Doppler coupling, in closed form.

use super::{options, set, sonar, water};
use crate::assert_near;
use echocast::{BuiltScene, Engine, LiveScene, Ping, Pose, Sensor, Trajectory};
use echocast_tests::reference::{SceneBuilder, Shape};
use glam::{DAffine3, DQuat, DVec3};

/// Distance of the wall, m.
const AHEAD: f64 = 30.0;

/// `f T / B` of a pulse of 10 ms, 450 kHz and a bandwidth of 15 kHz, s.
const LEAD: f64 = 0.3;

fn wall() -> SceneBuilder {
    let mut builder = SceneBuilder::new();
    builder.stand(Shape::plate(DVec3::ZERO, -DVec3::X, 60.0), None);
    builder
}

fn still_wall() -> BuiltScene {
    let mut builder = SceneBuilder::new();
    builder.stand(Shape::plate(DVec3::X * AHEAD, -DVec3::X, 60.0), None);
    builder.finish().build().unwrap()
}

/// An echo sounder that looks ahead, with the `pulse` if any.
fn ahead(pulse: &str) -> Sensor {
    set(sonar("type: single_beam, tilt_deg: 0, beam_deg: 1, rays: 4096", ""), pulse)
}

fn ping(scene: &BuiltScene, sensor: &Sensor, velocity: DVec3, yaw: f64) -> Ping {
    let turned = DQuat::from_rotation_z(yaw);
    let pose = |time: f64| Pose { position: velocity * time, orientation: turned };
    let path = Trajectory::new([-5.0, 5.0].map(|time| (time, pose(time))).to_vec()).unwrap();
    scene.ping(sensor, &path, &options(water(""))).unwrap()
}

fn range(ping: &Ping) -> f64 {
    assert_eq!(ping.soundings().len(), 1);
    ping.soundings()[0].range.into()
}

#[test]
fn what_comes_nearer_appears_nearer_by_the_lead_of_the_pulse() {
    let wall = still_wall();
    let (plain, up, down) =
        (ahead(""), ahead("acoustics.pulse_ms=10"), ahead("acoustics.pulse_ms=10 acoustics.sweep=down"));
    for speed in [-3.0, 0.5, 2.0] {
        let [plain, up, down] = [&plain, &up, &down].map(|sensor| range(&ping(&wall, sensor, DVec3::X * speed, 0.0)));
        // A bin is 25 mm.
        assert_near("rising sweep", up - plain, -speed * LEAD, 0.01);
        assert_near("falling sweep", down - plain, speed * LEAD, 0.01);
    }
    // Passing by, it does not come nearer; the two sides of the beam smear the echo within a bin.
    let [plain, up] = [&plain, &up].map(|sensor| range(&ping(&wall, sensor, DVec3::Y * 2.0, 0.0)));
    assert_near("abreast", up - plain, 0.0, 0.02);
    // At an angle the cosine of it counts.
    let [plain, up] =
        [ahead(""), ahead("acoustics.pulse_ms=10")].map(|sensor| range(&ping(&wall, &sensor, DVec3::X * 2.0, 0.5)));
    assert_near("aside", up - plain, -2.0 * LEAD * 0.5f64.cos(), 0.02);
}

#[test]
fn walls_that_move_appear_elsewhere_too() {
    let mut scene = LiveScene::new(&Engine::new().unwrap());
    let objects = scene.add_scene(&wall().finish()).unwrap();
    let speed = -1.5;
    let keys = [0.0, 2.0].map(|time| (time, DAffine3::from_translation(DVec3::X * (AHEAD + speed * time))));
    scene.set_motion(objects[0], &keys).unwrap();
    let [plain, up] = ["", "acoustics.pulse_ms=10"].map(|pulse| {
        let sensor = ahead(pulse);
        scene.set_time(0.0, sensor.scan_time()).unwrap();
        let still = Trajectory::fixed(Pose::IDENTITY);
        range(&scene.commit().unwrap().ping(&sensor, &still, &options(water(""))).unwrap())
    });
    assert_near("moving wall", up - plain, speed * LEAD, 0.01);
}

#[test]
fn where_nothing_moves_or_sweeps_nothing_changes() {
    let wall = still_wall();
    let level = |sensor: &Sensor, velocity: DVec3| ping(&wall, sensor, velocity, 0.0).cells().intensity().to_vec();
    let [up, down] = ["up", "down"].map(|sweep| ahead(&format!("acoustics.pulse_ms=10 acoustics.sweep={sweep}")));
    assert_eq!(level(&up, DVec3::ZERO), level(&down, DVec3::ZERO));
    assert_ne!(level(&up, DVec3::X), level(&down, DVec3::X));
    // A sonar that is taken to stand has no Doppler.
    let stands = |sensor: &Sensor| set(sensor.clone(), "acoustics.stop_and_hop=true");
    assert_eq!(level(&stands(&up), DVec3::X), level(&stands(&down), DVec3::X));
    let error = ahead("").set("acoustics.sweep", "down").unwrap_err().to_string();
    assert!(
        error.contains("acoustics.sweep: is down; allowed: with acoustics.bandwidth_khz and pulse_ms only"),
        "{error}"
    );
}
