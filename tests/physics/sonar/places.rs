//! Where things are heard.

use super::*;
use echocast::medium::Absorption;
use echocast::{Pings, Sounding};

/// Water of 1500 m/s, where the sonar assumes a different speed.
fn believing(speed: f64) -> Environment {
    water(&format!(", assumed_speed_m_s: {speed}"))
}

fn echo_sounder(more: &str) -> Sensor {
    sonar("type: single_beam, beam_deg: 2, rays: 512", more)
}

fn first(ping: &Ping) -> Sounding {
    assert_eq!(ping.soundings().len(), 1);
    ping.soundings()[0]
}

#[test]
fn ranges_are_times_at_the_speed_that_is_believed() {
    let scene = flat(100.0);
    for believed in [1400.0, 1450.0, 1500.0, 1600.0] {
        let found = ping(&scene, &echo_sounder(""), Pose::at(0.0, 0.0, 30.0), &options(believing(believed)));
        let sounding = first(&found);
        let range = 30.0 * believed / 1500.0;
        assert_eq!(found.layout().believed_speed, believed);
        // The echo of a round footprint comes a centimetre later in its middle than at its start.
        assert_near(&format!("range at {believed} m/s"), sounding.range.into(), range, 0.02);
        let cell = sounding.cell as usize;
        let c = found.cells();
        // Times are true, whatever is assumed; so is the position, within a cell.
        assert_near("time", c.time()[cell], 2.0 * 30.0 / 1500.0, 0.05 / 1500.0);
        assert_near("the way there", c.true_range()[cell].into(), 30.0, 0.03);
        assert_near("height", f64::from(c.true_z()[cell]) + found.origin.z, 0.0, 0.03);
    }
    // Through layers: time is the sum of times.
    let layers =
        "{layers: [{depth_m: 0, speed_m_s: 1500}, {depth_m: 30, speed_m_s: 1450}, {depth_m: 40, speed_m_s: 1550}]}";
    let yaml = format!("water: {{surface_z_m: 50, absorption: none, wind_m_s: 0, profile: {layers}}}");
    let found =
        ping(&scene, &echo_sounder(""), Pose::at(0.0, 0.0, 30.0), &options(Environment::from_yaml(&yaml).unwrap()));
    let time = 10.0 / 1500.0 + 10.0 / 1450.0 + 10.0 / 1550.0;
    assert_near("range through layers", first(&found).range.into(), 1500.0 * time, 0.02);
}

/// An approaching sonar has a shorter return path: by `v.d t / 2` of one-way range.
#[test]
fn a_moving_sonar_hears_from_where_it_is_by_then() {
    let scene = flat(100.0);
    let start = Pose::at(0.0, 0.0, 30.0);
    // 2 degrees about the vertical: its cosine changes nothing.
    for speed in [-10.0, 10.0] {
        let end = Pose::at(0.0, 0.0, 30.0 + speed);
        let trajectory = Trajectory::new(vec![(0.0, start), (1.0, end)]).unwrap();
        let hear = |more: &str| scene.ping(&echo_sounder(more), &trajectory, &options(water(""))).unwrap();
        let moved = first(&hear("")).range - first(&hear("acoustics.stop_and_hop=true")).range;
        let time = 2.0 * 30.0 / 1500.0;
        assert_near(&format!("{speed} m/s up"), moved.into(), 0.5 * speed * time, 0.01);
        let found = hear("");
        let cell = first(&found).cell as usize;
        let arrives = 2.0 * f64::from(first(&found).range) / 1500.0;
        assert_near("time of the echo", found.cells().time()[cell], arrives, 0.05 / 1500.0);
        // Where the sonar goes after the last ping is unknown: it continues as before.
        let hear_last = |more: &str| {
            let last = options(water("")).start_time(1.0);
            scene.ping(&echo_sounder(more), &trajectory, &last).unwrap()
        };
        let moved = first(&hear_last("")).range - first(&hear_last("acoustics.stop_and_hop=true")).range;
        let time = 2.0 * (30.0 + speed) / 1500.0;
        assert_near(&format!("{speed} m/s up, the last ping"), moved.into(), 0.5 * speed * time, 0.02);
    }
}

/// A trajectory shorter than the sound's travel time, and one that is over.
#[test]
fn a_sonar_moves_as_long_as_its_trajectory_says() {
    let scene = flat(100.0);
    let start = Pose::at(0.0, 0.0, 30.0);
    let hear = |seconds: f64, time: f64, more: &str| {
        let trajectory = Trajectory::new(vec![(0.0, start), (seconds, Pose::at(0.0, 0.0, 30.0 - 10.0 * seconds))]);
        let options = options(water("")).start_time(time);
        first(&scene.ping(&echo_sounder(more), &trajectory.unwrap(), &options).unwrap()).range
    };
    let moved = |seconds: f64, time: f64| hear(seconds, time, "") - hear(seconds, time, "acoustics.stop_and_hop=true");
    // The farthest echo takes 0.13 s.
    let expected = -0.5 * 10.0 * 2.0 * 30.0 / 1500.0;
    assert_near("a short trajectory", moved(0.01, 0.0).into(), expected, 0.02);
    assert_near("after its end", moved(0.01, 0.5).into(), 0.0, 1e-6);
}

/// The gain used for drawing pictures: `spreading log10(r) + 2 absorption r + gain`, r 1 m at least.
#[test]
fn gain_over_range_follows_its_law() {
    let scene = flat(100.0);
    let sensor = sidescan("acoustics.tvg.spreading=40 acoustics.tvg.absorption_db_m=0.07 acoustics.tvg.gain_db=-3");
    let layout = ping(&scene, &sensor, Pose::at(0.0, 0.0, 20.0), &options(water(""))).layout().clone();
    for bin in [0, 10, 100, 3000] {
        let range = (bin as f64 + 0.5) * layout.bin_m;
        let expected = 40.0 * range.max(1.0).log10() + 0.14 * range - 3.0;
        assert_near(&format!("gain at {range} m"), layout.tvg_db[bin].into(), expected, 1e-4);
    }
    // Without its own absorption it uses that of the water at the sonar.
    let salty = Environment::from_yaml("water: {surface_z_m: 50, profile: {constant: {speed_m_s: 1500}}}").unwrap();
    let layout = ping(&scene, &sidescan(""), Pose::at(0.0, 0.0, 20.0), &options(salty)).layout().clone();
    let swallowed = Absorption::FrancoisGarrison.db_per_km(450e3, 10.0, 35.0, 8.0, 30.0) * 1e-3;
    let expected = 30.0 * 80.0125f64.log10() + 2.0 * swallowed * 80.0125;
    assert_near("gain of the water", layout.tvg_db[3200].into(), expected, 0.01);
}

/// Beams narrower than any step: as loud as wider ones of the same solid angle times source.
#[test]
fn needle_beams_hear_what_is_below_them() {
    let scene = flat(100.0);
    for pattern in ["type: single_beam, beam_deg: 0.01", "type: single_beam, beam_deg: 0.01, vertical_deg: 1"] {
        let found = ping(&scene, &sonar(pattern, ""), Pose::at(0.0, 0.0, 30.0), &options(water("")));
        let narrow = first(&found);
        assert_near("range", narrow.range.into(), 30.0, 0.03);
        // On one of its sides, or all round it.
        let louder = if pattern.contains("vertical") { -20.0 } else { -40.0 };
        let wider = pattern.replace("0.01", "1");
        let wider = first(&ping(&scene, &sonar(&wider, ""), Pose::at(0.0, 0.0, 30.0), &options(water(""))));
        assert_near(pattern, f64::from(narrow.level_db - wider.level_db), louder, 0.1);
    }
    // 10 log(2 L / lambda) of a long line, and 3 dB as nothing is behind it.
    let length = 0.442_946_47 / 0.005f64.to_radians().sin();
    let directivity = |pattern: &str| {
        let noisy = sonar(pattern, "acoustics.noise_level_db=0");
        -f64::from(ping(&scene, &noisy, Pose::at(0.0, 0.0, 30.0), &options(water(""))).layout().noise_db)
    };
    let line = directivity("type: multibeam, beams: 2, swath_deg: 10, across_deg: 0.01");
    assert_near("a line", line, db(4.0 * length), 0.01);
    // Elements so far apart that each hears for itself, as a unit mistake may place them: 10 log(N), and 3 dB.
    let slip = "{shape: array, elements: 32, pitch_m: 20}";
    let sparse = directivity(&format!("type: multibeam, beams: 2, swath_deg: 10, across_deg: {slip}"));
    assert_near("a sparse line", sparse, db(2.0 * 32.0), 0.05);
    let sparse = directivity(&format!("type: single_beam, beam_deg: {slip}, vertical_deg: 10"));
    let tall = directivity("type: multibeam, beams: 2, swath_deg: 10, across_deg: 10");
    assert_near("a sparse face", sparse, db(32.0) + tall, 2.0);
    // 20 log(ka), ka = 1.616340 / sin of half the width.
    let round = directivity("type: single_beam, beam_deg: 0.01");
    assert_near("a piston", round, 2.0 * db(1.616_34 / 0.005f64.to_radians().sin()), 0.01);
}

#[test]
fn echoes_after_the_next_ping_are_refused_or_folded() {
    let scene = flat(100.0);
    // 0.04 s: 30 m.
    let sensor = echo_sounder("pattern.rate_hz=25 range.max_m=55");
    let ask = |sensor: &Sensor| scene.ping(sensor, &Trajectory::fixed(Pose::at(0.0, 0.0, 45.0)), &options(water("")));
    let error = ask(&sensor).unwrap_err().to_string();
    assert!(error.contains("range.max_m") && error.contains("30"), "{error}");
    let folding = set(sensor, "acoustics.allow_ambiguity=true");
    let found = ask(&folding).unwrap();
    assert_near("folded range", first(&found).range.into(), 15.0, 0.02);
    assert_near("reach of the bins", found.layout().reach(), 30.0, 0.03);
    let cell = first(&found).cell as usize;
    assert_near("the way there", found.cells().true_range()[cell].into(), 45.0, 0.03);
    assert_near("when it arrives", found.cells().time()[cell], 2.0 * 45.0 / 1500.0, 0.05 / 1500.0);
    let error = ask(&set(folding, "range.max_m=61")).unwrap_err().to_string();
    assert!(error.contains("range.max_m") && error.contains("60"), "{error}");
    assert!(ask(&echo_sounder("pattern.rate_hz=12.5 range.max_m=60")).is_ok());
}

/// How beams range a flat bottom: amplitude below 35 degrees, then where it crosses the axis.
fn swath(more: &str) -> Sensor {
    sonar(
        "type: multibeam, beams: 121, swath_deg: 120, along_deg: 1, across_deg: 1, rays: 64",
        &format!("range.max_m=80 {more}"),
    )
}

#[test]
fn a_beamformer_that_believes_another_speed_turns_its_beams() {
    let scene = flat(100.0);
    for array in [1440.0, 1560.0] {
        let sensor = swath(&format!("acoustics.array_speed_m_s={array}"));
        let found = ping(&scene, &sensor, Pose::at(0.0, 0.0, 20.0), &options(water("")));
        for sounding in found.soundings() {
            let set_to = (60.0 - f64::from(sounding.beam)).to_radians();
            let truly = set_to.sin() * 1500.0 / array;
            // An edge beam may look where its sidelobes do.
            if truly.abs() < 60f64.to_radians().sin() {
                let expected = 20.0 / (1.0 - truly * truly).sqrt();
                let what = format!("beam {} at {array} m/s", sounding.beam);
                assert_near(&what, sounding.range.into(), expected, 0.05 + 2e-3 * expected);
            }
        }
        assert_eq!(found.soundings().len(), 121);
    }
}

/// Depth errors, m: mean and standard deviation of the beams `which`, by where their axes meet the truth.
fn depth_errors(ping: &Ping, which: impl Fn(f64) -> bool, truth: impl Fn(f64) -> f64, height: f64) -> [f64; 2] {
    let errors: Vec<f64> = ping
        .soundings()
        .iter()
        .filter_map(|sounding| {
            let angle = (60.0 - f64::from(sounding.beam)).to_radians();
            let (y, z) = (f64::from(sounding.range) * angle.sin(), height - f64::from(sounding.range) * angle.cos());
            which(angle.to_degrees()).then(|| z - truth(y))
        })
        .collect();
    let n = errors.len() as f64;
    assert!(n > 5.0);
    let mean = errors.iter().sum::<f64>() / n;
    [mean, (errors.iter().map(|error| (error - mean).powi(2)).sum::<f64>() / n).sqrt()]
}

#[test]
fn soundings_lie_on_the_bottom() {
    let height = 20.0;
    let hear = |scene: &BuiltScene, more: &str, frame: u32| {
        let options = options(water("")).frame(frame);
        ping(scene, &swath(more), Pose::at(f64::from(frame), 0.0, height), &options)
    };
    let inner = |angle: f64| angle.abs() < 34.0;
    let outer = |angle: f64| angle.abs() > 36.0;
    let level = flat(100.0);
    let (sin, cos) = 10f64.to_radians().sin_cos();
    let mut tilted = SceneBuilder::new();
    let paint = tilted.material(sounding_material(Sound::Lambert { mu_db: -10.0 }));
    tilted.stand(Shape::plate(DVec3::ZERO, DVec3::new(0.0, -sin, cos), 200.0), Some(paint));
    let tilted = tilted.finish().build().unwrap();
    let slope = sin / cos;
    // Without speckle; with it single depths scatter, but not their mean.
    for (name, scene, truth) in [("flat", &level, 0.0), ("tilted", &tilted, slope)] {
        let found = hear(scene, "", 0);
        assert_eq!(found.soundings().len(), 121, "{name}");
        for (which, tolerance) in [(&inner as &dyn Fn(f64) -> bool, [0.03, 0.04]), (&outer, [0.04, 0.08])] {
            let [mean, sigma] = depth_errors(&found, which, |y| truth * y, height);
            assert_near(&format!("{name}: mean error"), mean, 0.0, tolerance[0]);
            assert!(sigma < tolerance[1], "{name}: {sigma}");
        }
        let mut all = [[0.0; 2]; 2];
        for frame in 0..20 {
            let found = hear(scene, "acoustics.speckle=frozen", frame);
            for (sum, which) in all.iter_mut().zip([&inner as &dyn Fn(f64) -> bool, &outer]) {
                let [mean, sigma] = depth_errors(&found, which, |y| truth * y, height);
                (sum[0], sum[1]) = (sum[0] + mean / 20.0, sum[1] + sigma * sigma / 20.0);
            }
        }
        let [inner, outer] = all.map(|[mean, square]| [mean, square.sqrt()]);
        assert_near(&format!("{name}: mean error with speckle, amplitude"), inner[0], 0.0, 0.04);
        assert_near(&format!("{name}: mean error with speckle, crossing"), outer[0], 0.0, 0.06);
        // A resolution of 5 cm and footprints of 0.35 to 1.4 m.
        assert!(inner[1] < 0.12 && outer[1] < 0.3, "{name}: {inner:?} {outer:?}");
    }
    // A step of 2 m to port.
    let step = with_bottom(
        Sound::Lambert { mu_db: -10.0 },
        100.0,
        [Shape::cuboid(DVec3::new(-50.0, 5.0, -1.0), DVec3::new(50.0, 60.0, 2.0))],
    );
    let found = hear(&step, "", 0);
    for (side, z) in [(-1.0, 0.0), (1.0, 2.0)] {
        // Away from the edge, whose sides and shadow are also heard.
        let here = |angle: f64| angle * side > 0.0 && !(0.0..=20.0).contains(&angle) && angle.abs() < 50.0;
        let [mean, sigma] = depth_errors(&found, here, |_| z, height);
        assert_near(&format!("step to {side}"), mean, 0.0, 0.05);
        assert!(sigma < 0.1, "{sigma}");
    }
    let cell = |beam: usize| found.soundings().iter().find(|s| s.beam as usize == beam).unwrap().cell as usize;
    assert_eq!([30, 90].map(|beam| found.cells().category_id()[cell(beam)]), [2, 1]);
}

/// Behind a wall of height `a` at a horizontal distance `x`, seen from `h`, there is nothing up to `x h / (h - a)`.
#[test]
fn walls_throw_shadows() {
    let (height, wall, at) = (12.0, 3.0, 25.0);
    let scene = with_bottom(
        Sound::Lambert { mu_db: -10.0 },
        100.0,
        // Thin: its top cannot be distinguished from its face.
        [Shape::quad(DVec3::new(-20.0, -at, 0.0), DVec3::X * 40.0, DVec3::Z * wall)],
    );
    let found = ping(&scene, &sidescan(""), Pose::at(0.0, 0.0, height), &options(water("")));
    let slant = |y: f64, z: f64| y.hypot(height - z);
    let end = at * height / (height - wall);
    let (top, foot, back) = (slant(at, wall), slant(at, 0.0), slant(end, 0.0));
    assert!(top < foot && foot < back);
    let c = found.cells();
    let layout = &found.layout().clone();
    let mut seen = [0; 4];
    for bin in 0..layout.bins {
        let (range, level) = (layout.range(bin), found.levels(0)[bin]);
        let what = (c.cause()[bin], c.category_id()[bin]);
        if range < height - 0.5 {
            assert_eq!(what, (7, 0), "water at {range} m");
            assert!(level < 60.0 && c.true_range()[bin].is_nan() && c.azimuth()[bin].is_nan());
            seen[0] += 1;
        } else if range > height + 0.3 && range < top - 0.3 {
            assert_eq!(what, (0, 1), "bottom at {range} m");
            seen[1] += 1;
        } else if range > top + 0.1 && range < foot - 0.1 {
            // The wall faces the sonar, the bottom in front of it hardly.
            assert_eq!(what, (0, 2), "wall at {range} m");
            assert_near("normal of the wall", c.normal_y()[bin].into(), 1.0, 1e-4);
            seen[2] += 1;
        } else if range > foot + 0.5 && range < back - 0.5 {
            assert_eq!(what, (7, 0), "shadow at {range} m");
            // Sidelobes of the pulse reach 8.5 resolutions.
            assert!(level < -100.0, "{level} in the shadow at {range} m");
            seen[3] += 1;
        } else if range > back + 0.3 && range < 90.0 {
            assert_eq!(what, (0, 1), "bottom behind the shadow at {range} m");
        }
        if what.0 == 0 {
            let place =
                DVec3::new(c.true_x()[bin].into(), c.true_y()[bin].into(), c.true_z()[bin].into()) + found.origin;
            let far = place.distance(DVec3::new(0.0, 0.0, height));
            assert_near("cell of a place", far, range, 0.03);
            let expected = if what.1 == 1 { place.z } else { place.y + at };
            assert_near("distance from the surface", expected, 0.0, 0.03);
            assert_near(
                "grazing",
                c.cos_incidence()[bin].into(),
                if what.1 == 1 { height / far } else { at / far },
                0.01,
            );
        }
    }
    assert!(seen.iter().all(|&count| count > 20), "{seen:?}");
}

/// Assumed speed, bins and gain are those of the start, so that the pings of a dive fit together.
#[test]
fn pings_of_a_dive_have_one_layout() {
    let keys = [(0.0, Pose::at(0.0, 0.0, 40.0)), (10.0, Pose::at(10.0, 0.0, 20.0))];
    let dive = Trajectory::new(keys.to_vec()).unwrap();
    let water =
        "water: {surface_z_m: 50, profile: {cast: [{depth_m: 0, speed_m_s: 1500}, {depth_m: 60, speed_m_s: 1460}]}}";
    let options = options(Environment::from_yaml(water).unwrap());
    let mut pings = Pings::default();
    for frame in 0..3 {
        let options = options.clone().frame(frame).start_time(5.0 * f64::from(frame));
        pings.push(flat(100.0).ping(&sidescan(""), &dive, &options).unwrap()).unwrap();
    }
    assert_near("speed", pings.all()[2].layout().believed_speed, 1500.0 - 10.0 * 40.0 / 60.0, 1e-9);
}
