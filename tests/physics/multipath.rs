//! Echoes over reflections, and of sonars that turn while they listen.

use super::assert_near;
use echocast::emitter::lobe::{Lobe, Piston, Shape as Aperture};
use echocast::medium::Absorption;
use echocast::scene::Material;
use echocast::{BuiltScene, Cause, Engine, Environment, FieldSet, Ping, Pose, ScanOptions, Sensor, Trajectory};
use echocast_tests::reference::{SceneBuilder, Shape};
use glam::{DAffine3, DVec3};

/// Depth of the bottom, m, below a surface at z = 0.
const BOTTOM: f64 = 30.0;

/// Balls of target strength 0 dB at `places`, and a bottom that mirrors everything and scatters nothing back.
fn targets(places: &[DVec3], radius: f64, bottom: bool) -> BuiltScene {
    behind_a_wall(places, radius, bottom, None)
}

/// The same and a wall that returns nothing.
fn behind_a_wall(places: &[DVec3], radius: f64, bottom: bool, wall: Option<Shape>) -> BuiltScene {
    let mut scene = SceneBuilder::new();
    let dead = "{name: dead, sound: {law: facet, mu_db: -100, slope_sigma_deg: 0.1, reflection_loss_db: 100}}";
    let dead = scene.material(Material::from_yaml(dead).unwrap());
    if let Some(wall) = wall {
        scene.stand(wall, Some(dead));
    }
    let ball = scene.material(Material::from_yaml("{name: ball, sound: {law: target, strength_db: 0}}").unwrap());
    let mirror = "{name: mirror, sound: {law: facet, mu_db: -100, slope_sigma_deg: 0.1, reflection_loss_db: 0}}";
    let mirror = scene.material(Material::from_yaml(mirror).unwrap());
    let mesh = scene.mesh([(Shape::sphere(radius, 24), Some(ball))]);
    for &place in places {
        scene.place(mesh, DAffine3::from_translation(place));
    }
    if bottom {
        let corner = DVec3::new(-500.0, -500.0, -BOTTOM);
        scene.stand(Shape::quad(corner, 1000.0 * DVec3::X, 1000.0 * DVec3::Y), Some(mirror));
    }
    scene.finish().build().unwrap()
}

/// Calm water of 1500 m/s without absorption; `more`: further keys.
fn water(more: &str) -> ScanOptions {
    water_that_swallows("none", more)
}

/// The same with a law of absorption.
fn water_that_swallows(law: &str, more: &str) -> ScanOptions {
    let yaml = format!("water: {{absorption: {law}, wind_m_s: 0{more}}}");
    let environment = Environment::from_yaml(&yaml).unwrap();
    ScanOptions::default().fields(FieldSet::all()).environment(environment)
}

const STRAIGHT: &str = ", profile: {constant: {speed_m_s: 1500}}";

fn sensor(pattern: &str, more: &str) -> Sensor {
    let yaml = format!(
        "
name: test
kind: sonar
pattern: {{{pattern}, rate_hz: 4}}
acoustics: {{frequency_khz: 100, source_level_db: 200, pulse_ms: 0.25, bin_m: 0.1875, noise_level_db: -200, speckle: off{more}}}
range: {{max_m: 150}}
"
    );
    Sensor::from_yaml(&yaml, "").unwrap()
}

/// A thin fan ahead, equally loud everywhere within it.
fn fan(bounces: u32) -> Sensor {
    let pattern = "type: single_beam, tilt_deg: 0, rays: 400000, beam_deg: {shape: box, width_deg: 0.6}, vertical_deg: \
                   {shape: box, width_deg: 120}";
    sensor(pattern, &format!(", bounces: {bounces}"))
}

/// Energy of the bins about `range`, dB, of which one within a bin of `range` must be the strongest.
fn level_at(ping: &Ping, beam: usize, range: f64) -> f64 {
    let bin_m = ping.layout().bin_m;
    let at = (range / bin_m) as usize;
    let power = |bin: usize| 10f64.powf(f64::from(ping.levels(beam)[bin]) / 10.0);
    let near = at - 3..=at + 3;
    let peak = near.clone().max_by(|&a, &b| power(a).total_cmp(&power(b))).unwrap();
    assert!(peak.abs_diff(at) <= 1, "the peak near {range} m is {} bins away", peak as f64 - at as f64);
    10.0 * near.map(power).sum::<f64>().log10()
}

/// Lengths of the direct path to a target `level` m away and of those over its images in surface and bottom, m; depths
/// in m.
fn image_ways(sonar: f64, target: f64, level: f64) -> [f64; 3] {
    let way = |depth: f64| level.hypot(depth);
    [way(target - sonar), way(target + sonar), way(2.0 * BOTTOM - target - sonar)]
}

/// Directly, over the surface and over the bottom: three paths out and back, six echoes, of which those between two
/// reflections are not followed.
#[test]
fn first_order_echoes_are_those_of_the_images() {
    for (sonar, target, level) in [(20.0, 14.0, 30.0), (6.0, 9.0, 30.0)] {
        let scene = targets(&[DVec3::new(level, 0.0, -target)], 0.09, true);
        let pose = Trajectory::fixed(Pose::at(0.0, 0.0, -sonar));
        let ping = scene.ping(&fan(1), &pose, &water(STRAIGHT)).unwrap();
        let alone = scene.ping(&fan(0), &pose, &water(STRAIGHT)).unwrap();
        let ways = image_ways(sonar, target, level);
        for out in 0..3 {
            for back in 0..=out {
                let (a, b) = (ways[out], ways[back]);
                if out == back || back == 0 {
                    // Out one way and back the other, and the other way round: in phase.
                    let twice = if out == back { 0.0 } else { 20.0 * 2f64.log10() };
                    let expected = 200.0 - 20.0 * a.log10() - 20.0 * b.log10() + twice;
                    let range = 0.5 * (a + b);
                    // The near side of the ball.
                    let found = level_at(&ping, 0, range - 0.06);
                    assert_near(&format!("{out} and {back}, {range} m"), found, expected, 0.3);
                    let cell = ((range - 0.06) / ping.layout().bin_m) as usize;
                    let orders: Vec<u8> = (cell - 1..=cell + 1).map(|cell| ping.cells().bounces()[cell]).collect();
                    assert!(orders.contains(&u8::from(out > 0)), "{orders:?}");
                }
            }
        }
        // Without bounces only the first.
        assert!(level_at(&alone, 0, ways[0] - 0.06) > 120.0);
        let second = (0.5 * (ways[0] + ways[1]) / alone.layout().bin_m) as usize;
        let loudest = alone.levels(0)[second - 3..].iter().copied().fold(f32::MIN, f32::max);
        // That far above the sonar a calm sea has few bubbles.
        assert!(loudest < 70.0, "{loudest} dB");
    }
}

/// On each path as much is absorbed as the law says, straight or by a ray that is found: `a (out + back)`.
#[test]
fn mixed_ways_lose_what_the_water_swallows() {
    let (sonar, target, level) = (20.0, 14.0, 30.0);
    let scene = targets(&[DVec3::new(level, 0.0, -target)], 0.09, true);
    let pose = Trajectory::fixed(Pose::at(0.0, 0.0, -sonar));
    // So little changes with depth that the paths stay those of the images.
    let bent = ", assumed_speed_m_s: 1500, profile: {cast: [{depth_m: 0, speed_m_s: 1500}, {depth_m: 40, speed_m_s: \
                1500.001}]}";
    let ways = image_ways(sonar, target, level);
    for (law, absorption) in [("thorp", Absorption::Thorp), ("francois_garrison", Absorption::FrancoisGarrison)] {
        // At 30 m Francois and Garrison's is 0.4 % less than at the surface.
        let swallowed = absorption.db_per_km(100e3, 10.0, 35.0, 8.0, 15.0) * 1e-3;
        for profile in [STRAIGHT, bent] {
            let ping = scene.ping(&fan(1), &pose, &water_that_swallows(law, profile)).unwrap();
            for (out, back) in [(0, 0), (1, 0), (1, 1), (2, 0), (2, 2)] {
                let (a, b) = (ways[out], ways[back]);
                // Out one way and back the other, and the other way round: in phase.
                let twice = if out == back { 0.0 } else { 20.0 * 2f64.log10() };
                let spreading = 20.0 * a.log10() + 20.0 * b.log10();
                let expected = 200.0 - spreading + twice - swallowed * (a + b);
                let found = level_at(&ping, 0, 0.5 * (a + b) - 0.06);
                assert_near(&format!("{law}: {out} and {back}, {profile}"), found, expected, 0.3);
            }
            assert!(swallowed * 2.0 * ways[2] > 2.0);
        }
    }
}

/// A fan that is louder in some directions sends one path as loudly as in its direction, and hears the other likewise.
#[test]
fn lobes_weigh_both_ways() {
    let (sonar, target, level) = (10.0, 14.0, 30.0);
    let scene = targets(&[DVec3::new(level, 0.0, -target)], 0.09, false);
    let pattern =
        "type: single_beam, tilt_deg: 8, rays: 1000000, beam_deg: {shape: box, width_deg: 0.6}, vertical_deg: 50";
    let pose = Trajectory::fixed(Pose::at(0.0, 0.0, -sonar));
    let ping = scene.ping(&sensor(pattern, ", bounces: 1"), &pose, &water(STRAIGHT)).unwrap();
    let lobe = Lobe::Width(50.0).at(1500.0 / 100e3);
    let [a, b, _] = image_ways(sonar, target, level);
    let one_way = |way: f64, rise: f64| {
        let angle = rise.atan2(level) + 8f64.to_radians();
        20.0 * lobe.amplitude(angle.sin()).abs().log10() - 20.0 * way.log10()
    };
    let (direct, over) = (one_way(a, sonar - target), one_way(b, sonar + target));
    assert!(direct - over > 10.0);
    // In phase.
    let twice = 20.0 * 2f64.log10();
    for (range, expected) in [(a, 2.0 * direct), (0.5 * (a + b), direct + over + twice), (b, 2.0 * over)] {
        assert_near(&format!("level at {range} m"), level_at(&ping, 0, range - 0.06), 200.0 + expected, 0.3);
    }
}

#[test]
fn a_wall_takes_mixed_ways_away_that_it_stands_in() {
    let (sonar, target, level) = (10.0, 14.0, 40.0);
    let ways = image_ways(sonar, target, level);
    let pose = Trajectory::fixed(Pose::at(0.0, 0.0, -sonar));
    let wall = |top: f64| Shape::quad(DVec3::new(30.0, -10.0, -25.0), 20.0 * DVec3::Y, (25.0 - top) * DVec3::Z);
    let heard = |top: f64| {
        let scene = behind_a_wall(&[DVec3::new(level, 0.0, -target)], 0.09, false, Some(wall(top)));
        let ping = scene.ping(&fan(1), &pose, &water(STRAIGHT)).unwrap();
        [2.0 * ways[0], ways[0] + ways[1], 2.0 * ways[1]].map(|way| {
            let bin = ((0.5 * way - 0.06) / ping.layout().bin_m) as usize;
            ping.levels(0)[bin - 1..=bin + 1].iter().any(|&level| level > 100.0)
        })
    };
    // At the wall the direct path is 13 m deep, the other 8.
    assert_eq!(heard(14.0), [true, true, true]);
    assert_eq!(heard(12.0), [false, false, true]);
    assert_eq!(heard(7.0), [false, false, false]);
}

/// Half of a mixed echo comes from each of its paths, and each beam hears its own.
#[test]
fn beams_hear_mixed_echoes_from_where_they_come() {
    let (sonar, target, level) = (10.0, 14.0, 40.0);
    let ways = image_ways(sonar, target, level);
    let scene = targets(&[DVec3::new(level, 0.0, -target)], 0.09, false);
    let pattern = "type: imaging, beams: 4001, fov_deg: 120, beam_deg: 1.5, rays: 150, vertical_deg: {shape: box, \
                   width_deg: 0.6}";
    // Its array stands upright: port is up.
    let pose = Trajectory::fixed(Pose::at(0.0, 0.0, -sonar).with_rpy_deg(90.0, 0.0, 0.0));
    let ping = scene.ping(&sensor(pattern, ", bounces: 1"), &pose, &water(STRAIGHT)).unwrap();
    let ranges = [ways[0], 0.5 * (ways[0] + ways[1]), ways[1]].map(|range| range - 0.06);
    let lines = [(sonar - target).atan2(level), (sonar + target).atan2(level)].map(|angle| {
        let beside = |beam: &usize| (f64::from(ping.layout().axes[*beam][0]) - angle).abs();
        (0..4001).min_by(|a, b| beside(a).total_cmp(&beside(b))).unwrap()
    });
    for (line, own) in [(lines[0], 0), (lines[1], 2)] {
        let difference = level_at(&ping, line, ranges[1]) - level_at(&ping, line, ranges[own]);
        let expected = 20.0 * (ways[own / 2] / ways[1 - own / 2]).log10();
        assert_near(&format!("beam {line}: mixed echo"), difference, expected, 0.3);
    }
    // In between nobody does.
    let bin = (ranges[1] / ping.layout().bin_m) as usize;
    let (between, direct) = ((lines[0] + lines[1]) / 2, level_at(&ping, lines[0], ranges[1]));
    assert!(f64::from(ping.levels(between)[bin]) < direct - 20.0);
}

/// Sound speed of 1500 m/s at the surface, and 1 m/s more with every metre: rays are arcs, and times known.
#[test]
fn mixed_ways_bend() {
    let (sonar, target, level) = (10.0, 14.0, 60.0);
    let scene = targets(&[DVec3::new(level, 0.0, -target)], 0.09, false);
    let pose = Trajectory::fixed(Pose::at(0.0, 0.0, -sonar));
    let profile = ", assumed_speed_m_s: 1500, profile: {cast: [{depth_m: 0, speed_m_s: 1500}, {depth_m: 40, speed_m_s: \
                   1540}]}";
    let ping = scene.ping(&fan(1), &pose, &water(profile)).unwrap();
    // From one depth to another in a linear gradient of 1/s, s.
    let time = |a: f64, b: f64, level: f64| {
        let square = level * level + (a - b) * (a - b);
        (1.0 + square / (2.0 * (1500.0 + a) * (1500.0 + b))).acosh()
    };
    // Over the surface where the time is least (Fermat).
    let over = |x: f64| time(sonar, 0.0, x) + time(0.0, target, level - x);
    let fermat = (0..60_000).map(|step| over(f64::from(step) * 1e-3)).fold(f64::INFINITY, f64::min);
    let (direct, over) = (1500.0 * time(sonar, target, level), 1500.0 * fermat);
    let levels = [direct, 0.5 * (direct + over), over].map(|range| level_at(&ping, 0, range - 0.06));
    let [a, b, _] = image_ways(sonar, target, level);
    assert_near("direct level", levels[0], 200.0 - 40.0 * a.log10(), 0.3);
    // The surface side of such water is a duct: it focuses.
    assert_near("level over the surface", levels[2], 200.0 - 40.0 * b.log10(), 1.0);
    let mean = 0.5 * (levels[0] + levels[2]);
    assert_near("mixed level", levels[1], mean + 20.0 * 2f64.log10(), 0.2);
}

/// The mean of the path out and the path back may be within reach where one of them is not.
#[test]
fn mixed_echoes_are_heard_up_to_the_last_bin() {
    let (sonar, target, level) = (20.0, 60.0, 80.0);
    let ways = image_ways(sonar, target, level);
    let scene = targets(&[DVec3::new(level, 0.0, -target)], 0.3, false);
    let pose = Trajectory::fixed(Pose::at(0.0, 0.0, -sonar));
    let mut fan = fan(1);
    let range = 0.5 * (ways[0] + ways[1]);
    fan.set("range.max_m", &format!("{}", range + 1.0)).unwrap();
    assert!(ways[1] > range + 1.0);
    let ping = scene.ping(&fan, &pose, &water(STRAIGHT)).unwrap();
    let expected = 200.0 - 20.0 * (ways[0] * ways[1]).log10() + 20.0 * 2f64.log10();
    assert_near("level", level_at(&ping, 0, range - 0.2), expected, 0.3);
}

#[test]
fn mixed_echoes_do_not_depend_on_threads() {
    let mut scene = SceneBuilder::new();
    let sand = scene.material(Material::from_yaml("{name: sand, sound: {law: lambert, mu_db: -15}}").unwrap());
    scene.stand(Shape::quad(DVec3::new(-200.0, -200.0, -20.0), 400.0 * DVec3::X, 400.0 * DVec3::Y), Some(sand));
    let scene = scene.finish();
    let pattern = "type: sidescan, along_deg: 1, vertical_deg: 60, tilt_deg: 20, rays: 3000";
    let mut sensor = sensor(pattern, ", bounces: 3");
    sensor.set("acoustics.speckle", "frozen").unwrap();
    let path = Trajectory::new(vec![
        (0.0, Pose::at(0.0, 0.0, -5.0)),
        (1.0, Pose::at(1.0, 0.2, -5.5).with_rpy_deg(3.0, 2.0, 20.0)),
    ]);
    let path = path.unwrap();
    for water in
        [water(STRAIGHT), water(", profile: {cast: [{depth_m: 0, speed_m_s: 1510}, {depth_m: 30, speed_m_s: 1480}]}")]
    {
        let pings = [1, 2, 7].map(|threads| {
            let engine = Engine::with_threads(threads).unwrap();
            scene.clone().build_with(&engine).unwrap().ping(&sensor, &path, &water).unwrap()
        });
        assert!(
            pings.iter().all(|ping| bits(ping) == bits(&pings[0]) && ping.cells().cause() == pings[0].cells().cause())
        );
        assert!(pings[0].cells().cause().contains(&(Cause::Multipath as u8)));
    }
}

/// A trajectory that turns by `yaw` degrees in a second.
fn turning(yaw: f64) -> Trajectory {
    let at = |yaw: f64| Pose::at(0.0, 0.0, -30.0).with_rpy_deg(0.0, 0.0, yaw);
    Trajectory::new(vec![(0.0, at(0.0)), (1.0, at(yaw))]).unwrap()
}

fn bits(ping: &Ping) -> Vec<u32> {
    ping.cells().intensity().iter().map(|level| level.to_bits()).collect()
}

#[test]
fn a_sonar_that_turns_hears_targets_where_it_looks_by_then() {
    let pattern = "type: imaging, beams: 121, fov_deg: 120, beam_deg: 1.5, rays: 1000, vertical_deg: {shape: box, \
                   width_deg: 10}";
    let places = [DVec3::new(75.0, 0.0, -30.0), DVec3::new(30.0, 20.0, -30.0)];
    let scene = targets(&places, 0.5, false);
    let heard = |sensor: &Sensor, yaw: f64, place: DVec3| {
        let ping = scene.ping(sensor, &turning(yaw), &water(STRAIGHT)).unwrap();
        let range = place.with_z(0.0).length() - 0.4;
        let bins = ((range - 0.5) / ping.layout().bin_m) as usize..((range + 0.5) / ping.layout().bin_m) as usize;
        let power = |beam: usize| {
            let levels = ping.levels(beam)[bins.clone()].iter();
            levels.map(|&level| 10f64.powf(f64::from(level) / 10.0)).sum::<f64>()
        };
        let peak = (0..121).max_by(|&a, &b| power(a).total_cmp(&power(b))).unwrap();
        let (mut sum, mut lean) = (0.0, 0.0);
        for beam in peak.saturating_sub(2)..(peak + 3).min(121) {
            sum += power(beam);
            lean += power(beam) * f64::from(ping.layout().axes[beam][0]).to_degrees();
        }
        lean / sum
    };
    let moving = sensor(pattern, "");
    for place in places {
        let range = place.with_z(0.0).length() - 0.4;
        let azimuth = place.y.atan2(place.x).to_degrees();
        for yaw in [-50.0, 0.0, 20.0, 50.0] {
            let expected = azimuth - yaw * 2.0 * range / 1500.0;
            assert_near(&format!("azimuth at {range} m, {yaw} deg/s"), heard(&moving, yaw, place), expected, 0.15);
        }
    }
    let still = sensor(pattern, ", stop_and_hop: true");
    assert_near("azimuth of one that hops", heard(&still, 50.0, places[0]), 0.0, 0.1);
}

/// A beam that has turned away hears less, according to its lobe; for a side-scan sonar, for one beam and for a round
/// one.
#[test]
fn a_beam_that_turns_away_hears_less() {
    let thin = "vertical_deg: {shape: box, width_deg: 10}, tilt_deg: 0";
    for (pattern, place) in [
        (
            format!("type: sidescan, sides: starboard, along_deg: 2, rays: 200000, {thin}"),
            DVec3::new(0.0, -75.0, -30.0),
        ),
        (format!("type: single_beam, beam_deg: 2, rays: 200000, {thin}"), DVec3::new(75.0, 0.0, -30.0)),
        (
            "type: single_beam, beam_deg: {shape: piston, width_deg: 2}, rays: 200000, tilt_deg: 0".to_owned(),
            DVec3::new(75.0, 0.0, -30.0),
        ),
    ] {
        let (scene, sensor) = (targets(&[place], 0.15, false), sensor(&pattern, ""));
        let round = pattern.contains("piston");
        let lobe: Lobe = if round { Lobe::Shape(Aperture::Piston(Piston::Width(2.0))) } else { Lobe::Width(2.0) };
        let lobe = lobe.at(1500.0 / 100e3);
        let still = scene.ping(&sensor, &turning(0.0), &water(STRAIGHT)).unwrap();
        for yaw in [4.0, -8.0, 12.0] {
            let ping = scene.ping(&sensor, &turning(yaw), &water(STRAIGHT)).unwrap();
            let fainter = level_at(&ping, 0, 74.9) - level_at(&still, 0, 74.9);
            let away = (yaw * 2.0 * 74.9 / 1500.0).to_radians();
            let expected = 20.0 * lobe.amplitude(away.sin()).abs().log10();
            assert_near(&format!("{pattern}: level at {yaw} deg/s"), fainter, expected, 0.3);
        }
    }
}

#[test]
fn what_does_not_move_sounds_as_what_stands() {
    let scene = targets(&[DVec3::new(40.0, 10.0, -20.0)], 0.5, true);
    for pattern in [
        "type: imaging, beams: 61, fov_deg: 120, rays: 64, vertical_deg: 60",
        "type: sidescan, rays: 2000",
        "type: multibeam, beams: 64, swath_deg: 120",
        "type: single_beam, beam_deg: 20, rays: 2000, tilt_deg: 20",
    ] {
        let still = Pose::at(0.0, 0.0, -30.0 + 12.0);
        let fixed = Trajectory::fixed(still);
        // It starts to turn after everything has been heard.
        let late =
            Trajectory::new(vec![(0.0, still), (1.0, still), (2.0, still.with_rpy_deg(0.0, 0.0, 90.0))]).unwrap();
        let now = Trajectory::new(vec![(0.0, still), (1.0, still.with_rpy_deg(4.0, 3.0, 30.0))]).unwrap();
        for bounces in ["0", "1"] {
            let water = water(STRAIGHT);
            let moving = sensor(pattern, &format!(", bounces: {bounces}"));
            let hopping = sensor(pattern, &format!(", bounces: {bounces}, stop_and_hop: true"));
            let expected = bits(&scene.ping(&moving, &fixed, &water).unwrap());
            assert!(bits(&scene.ping(&moving, &late, &water).unwrap()) == expected, "{pattern}");
            assert!(bits(&scene.ping(&hopping, &now, &water).unwrap()) == expected, "{pattern}");
            assert!(bits(&scene.ping(&moving, &now, &water).unwrap()) != expected, "{pattern}");
        }
    }
}

/// A bottom of Lambert's law: between two directions that is `mu sin(in) sin(out)`.
#[test]
fn mixed_echoes_of_a_bottom_have_the_level_of_the_sonar_equation() {
    let mut scene = SceneBuilder::new();
    let sand = scene.material(Material::from_yaml("{name: sand, sound: {law: lambert, mu_db: -10}}").unwrap());
    let corner = DVec3::new(-300.0, -300.0, -BOTTOM);
    scene.stand(Shape::quad(corner, 600.0 * DVec3::X, 600.0 * DVec3::Y), Some(sand));
    let scene = scene.finish().build().unwrap();
    let (depth, height) = (10.0, BOTTOM - 10.0);
    let pose = Trajectory::fixed(Pose::at(0.0, 0.0, -depth));
    let [one, none] = [1, 0].map(|bounces| scene.ping(&fan(bounces), &pose, &water(STRAIGHT)).unwrap());
    let bin_m = one.layout().bin_m;
    let (half, around) = (0.3f64.to_radians().sin(), 0.5);
    for range in [42.0, 55.0, 80.0, 120.0] {
        let near = |way: f64| (way - range).abs() < around;
        let step = 1e-3;
        let mut expected = 0.0;
        for x in (10_000..150_000).map(|index| f64::from(index) * step) {
            let (straight, over) = (x.hypot(height), x.hypot(height + 2.0 * depth));
            let (sin, sin_over) = (height / straight, (height + 2.0 * depth) / over);
            // Both paths must lie within the fan: half its width is a sine to its side, not an azimuth.
            let width = |cosine: f64| 2.0 * (half / cosine).asin();
            let echo = |sines: f64, ways: f64, azimuth: f64| 0.1 * sines * azimuth * x * step / (ways * ways);
            if near(over) && sin_over < 60f64.to_radians().sin() {
                expected += echo(sin_over * sin_over, over * over, width(x / over));
            }
            if near(0.5 * (straight + over)) && sin_over < 60f64.to_radians().sin() {
                expected += 4.0 * echo(sin * sin_over, straight * over, width(x / straight));
            }
        }
        let bins = ((range - around) / bin_m).round() as usize..((range + around) / bin_m).round() as usize;
        let energy = |ping: &Ping| {
            let powers = ping.levels(0)[bins.clone()].iter().map(|&level| 10f64.powf(f64::from(level) / 10.0));
            powers.sum::<f64>() * 2.0 * around / (bins.len() as f64 * bin_m)
        };
        let found = 10.0 * (energy(&one) - energy(&none)).log10();
        assert_near(&format!("level at {range} m"), found, 200.0 + 10.0 * expected.log10(), 0.15);
    }
}
