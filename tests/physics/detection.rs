use super::{assert_near, scan, target};
use echocast::material::{Reflectance, RetroSample, Scattering};
use echocast::medium::{Dust, Placed, Rain, Region};
use echocast::scene::Material;
use echocast::{BuiltScene, Cause, Environment, Profile, ScanOptions, Sensor};
use echocast_tests::reference::{SceneBuilder, Shape, Table, one_beam};
use glam::DVec3;
use std::collections::BTreeMap;

/// How many points a target gives.
fn seen(sections: &str, [reflectance, range, angle]: [f64; 3], profile: Profile) -> usize {
    let options = ScanOptions::default().profile(profile);
    scan(&target(reflectance, range, angle), &one_beam(sections), options).len()
}

#[test]
fn targets_are_seen_up_to_the_range_of_the_radar_equation() {
    let table = Table::parse(include_str!("../data/detection_range.csv"), ',');
    let radar = "detection: {model: radar_equation, reflectance: 0.8, at_m: 200}";
    for row in (0..table.len()).filter(|&row| table.text(row, "medium") == "none") {
        let (rho, limit) = (table.number(row, "rho"), table.number(row, "R_max_m"));
        let capped = table.number(row, "R_max_capped_200_m");
        for (sections, limit) in [(radar.to_owned(), limit), (format!("{radar}\nrange: {{max_m: 200}}"), capped)] {
            assert_eq!(
                seen(&sections, [rho, limit * (1.0 - 1e-4), 0.0], Profile::Physical),
                1,
                "{rho} before {limit} m"
            );
            assert_eq!(
                seen(&sections, [rho, limit * (1.0 + 1e-4), 0.0], Profile::Physical),
                0,
                "{rho} behind {limit} m"
            );
        }
        // Turned by 60 degrees, half of the light comes back.
        let turned = limit * 0.5f64.sqrt();
        assert_eq!(seen(radar, [rho, turned * (1.0 - 1e-4), 60.0], Profile::Physical), 1);
        assert_eq!(seen(radar, [rho, turned * (1.0 + 1e-4), 60.0], Profile::Physical), 0);
    }
}

/// The least power seen by a sensor specified to see 0.9 at 200 m: 0.9 / (pi R^2) = 7.1620e-6 (Goodin et al. 2019).
#[test]
fn the_data_sheet_line_is_the_least_power() {
    let line = "detection: {model: radar_equation, reflectance: 0.9, at_m: 200}\nintensity: {encoding: power}";
    for [rho, range] in [[0.9, 199.99], [0.1, 66.66], [0.05, 47.137]] {
        let cloud = scan(&target(rho, range, 0.0), &one_beam(line), ScanOptions::default());
        assert_near("least power", f64::from(cloud.columns().intensity()[0]) / 7.162_0e-6, 1.0, 3e-4);
        assert_eq!(seen(line, [rho, range * 1.0005, 0.0], Profile::Physical), 0);
    }
}

/// The `detection` section of row `row`.
fn limit_section(table: &Table, row: usize) -> String {
    let number = |column| table.number(row, column);
    format!(
        "detection: {{model: reflectivity_limit, lower: {{reflectance: {}, at_m: {}}}, upper: {{reflectance: {}, at_m: {}}}}}",
        number("r_min"),
        number("d_min"),
        number("r_max"),
        number("d_max")
    )
}

#[test]
fn the_linear_limit_is_that_of_its_table() {
    let table = Table::parse(include_str!("../data/reflectivity_threshold.csv"), ',');
    assert_eq!(table.len(), 30);
    for row in 0..table.len() {
        let (sections, range) = (limit_section(&table, row), table.number(row, "d"));
        // Where the limit jumps, from there on: what is met there is, on some processors, a last bit nearer.
        let range = if range == table.number(row, "d_min") { range * (1.0 + 1e-6) } else { range };
        for (profile, column) in
            [(Profile::Physical, "r_threshold_linear_correct"), (Profile::Blainder, "r_threshold_BLAINDER_code")]
        {
            let limit = table.number(row, column);
            // The intensity of undetected points is 0 where they are kept at all.
            let detected = |rho: f64| {
                let options = ScanOptions::default().profile(profile);
                let cloud = scan(&target(rho, range, 0.0), &one_beam(&sections), options);
                assert!(profile == Profile::Physical || cloud.len() == 1, "the program keeps undetected points");
                cloud.columns().intensity().iter().any(|&intensity| intensity > 0.0)
            };
            assert!(limit + 1e-5 > 1.0 || detected(limit + 1e-5), "row {row}: {limit} at {range} m");
            assert!(limit == 0.0 || !detected((limit - 1e-5).min(1.0)), "row {row}: {limit} at {range} m");
        }
    }
}

/// Least reflectivities by range, falling and rising; outside the points that of the nearest.
#[test]
fn a_table_limits_what_is_seen() {
    let sections = "detection: {model: table, points: [{reflectance: 0.4, at_m: 2}, {reflectance: 0.1, at_m: 10}, \
                    {reflectance: 0.7, at_m: 70}]}";
    for (range, limit) in [(1.0, 0.4), (2.0, 0.4), (6.0, 0.25), (10.0, 0.1), (40.0, 0.4), (70.0, 0.7), (500.0, 0.7)] {
        for (rho, expected) in [(limit - 1e-4, 0), (limit + 1e-4, 1)] {
            assert_eq!(seen(sections, [rho, range, 0.0], Profile::Physical), expected, "{rho} at {range} m");
        }
    }
}

/// The table of detection ranges behind rain and fog.
#[test]
fn weather_shortens_the_range_of_the_radar_equation() {
    let table = Table::parse(include_str!("../data/detection_range.csv"), ',');
    assert_eq!(table.len(), 54);
    let sensor = one_beam("detection: {model: radar_equation, reflectance: 0.8, at_m: 200}");
    for row in 0..table.len() {
        let yaml = match table.text(row, "medium") {
            "none" => "{}",
            "clear_V23km_kruse905" => "{clear_air: {visibility_m: 23000}}",
            "rain10_ITU_mu0" => "{rain: {rate_mm_h: 10, drops: false}}",
            "rain10_goodin" => "{rain: {rate_mm_h: 10, model: paper, drops: false}}",
            "fog_MOR200" => "{fog: {mor_m: 200}}",
            "fog_MOR50" => "{fog: {mor_m: 50}}",
            other => panic!("{other}"),
        };
        let environment = Environment::from_yaml(yaml).unwrap();
        let (rho, limit) = (table.number(row, "rho"), table.number(row, "R_max_m"));
        for (range, expected) in [(limit * (1.0 - 1e-4), 1), (limit * (1.0 + 1e-4), 0)] {
            let options = ScanOptions::default().environment(environment.clone());
            assert_eq!(scan(&target(rho, range, 0.0), &sensor, options).len(), expected, "{rho} {yaml} at {range} m");
        }
    }
}

#[test]
fn profile_blainder_gives_what_the_program_gives() {
    let table = Table::parse(include_str!("../data/blainder_compat.csv"), ',');
    assert_eq!(table.len(), 13);
    for row in 0..table.len() {
        let environment = program_weather(&table, row);
        let options = ScanOptions::default().profile(Profile::Blainder).environment(environment.clone());
        let number = |column| table.number(row, column);
        let scene = target(number("pixel_alpha"), number("distance_m"), number("theta_deg"));
        let cloud = scan(&scene, &one_beam(&limit_section(&table, row)), options);
        assert_eq!(cloud.len(), 1, "undetected points are kept");
        assert_near("intensity", cloud.columns().intensity()[0].into(), number("stored_intensity"), 1e-6);
        let range = number("reported_distance_m_no_noise");
        assert_near("range", cloud.columns().range()[0].into(), range, 1e-6 * range);
        let noise = environment.rain.first().map_or(0.0, |rain| rain.what.range_sigma() * number("distance_m"));
        assert_near("sigma of rain", noise, number("rain_noise_sigma_m"), 1e-6 * noise);
    }
}

/// Rain and dust of a row; rain without its range noise.
fn program_weather(table: &Table, row: usize) -> Environment {
    let there = |column| !table.text(row, column).is_empty();
    let number = |column| table.number(row, column);
    let mut environment = Environment::default();
    if there("rain_mm_h") {
        environment.rain = vec![Rain::new(number("rain_mm_h")).range_noise(false).into()];
    }
    if there("dust_n") {
        let what = Dust::new(number("dust_r_um"), number("dust_n"));
        let region = Region::Shell { start_m: number("dust_start_m"), length_m: number("dust_L_m") };
        environment.dust = vec![Placed { what, region }];
    }
    environment
}

/// Two plates one behind the other: the ray stops at the first, seen or not.
#[test]
fn ranges_outside_the_limits_are_not_reported_and_still_block() {
    let mut scene = SceneBuilder::new();
    for range in [5.0, 9.0] {
        let corners = [DVec3::new(range, -1.0, -1.0), DVec3::new(range, 1.0, -1.0), DVec3::new(range, 0.1, 1.0)];
        scene.stand(Shape::triangle(corners), None);
    }
    let built = scene.finish().build().unwrap();
    for (sections, reported) in [
        ("", true),
        ("range: {min_m: 4.9, max_m: 5.1}", true),
        ("range: {max_m: 4.9}", false),
        ("range: {min_m: 5.1}", false),
        ("detection: {model: radar_equation, reflectance: 1, at_m: 4}", false),
    ] {
        let cloud = scan(&built, &one_beam(sections), ScanOptions::default());
        assert_eq!(cloud.len(), usize::from(reported), "{sections}");
        for &range in cloud.columns().range() {
            assert_near("range", range.into(), 5.0, 1e-6);
        }
    }
}

/// A camera of 300 x 300 pixels.
fn camera(sections: &str) -> Sensor {
    let pattern = "name: camera\nkind: lidar\npattern: {type: pinhole, resolution: [300, 300], fov_deg: [60, 60]}\n";
    Sensor::from_yaml(&format!("{pattern}{sections}\n"), "").unwrap()
}

/// A tilted wall, 7 to 30 m away, that fills the camera's view.
fn wall() -> BuiltScene {
    let mut scene = SceneBuilder::new();
    let paint = scene.reflector(0.5);
    scene.stand(Shape::plate(12.0 * DVec3::X, DVec3::new(-1.0, 0.5, 0.3).normalize(), 200.0), Some(paint));
    scene.finish().build().unwrap()
}

/// A scene that no beam of the camera meets.
fn nothing_ahead() -> BuiltScene {
    let mut scene = SceneBuilder::new();
    scene.stand(Shape::plate(-5.0 * DVec3::X, DVec3::X, 1.0), None);
    scene.finish().build().unwrap()
}

/// The normal distribution by its series (Marsaglia 2004), for |x| < 7.
fn normal_distribution(x: f64) -> f64 {
    let (mut term, mut sum) = (x, x);
    for n in 1..200 {
        term *= x * x / f64::from(2 * n + 1);
        sum += term;
    }
    0.5 + sum * (-0.5 * x * x).exp() / (2.0 * std::f64::consts::PI).sqrt()
}

/// Checks that `found` of many chances came true, within three standard errors.
#[track_caller]
fn assert_count(what: &str, found: usize, chances: impl Iterator<Item = f64>) {
    let (sum, variance) = chances.fold((0.0, 0.0), |(sum, variance), p| (sum + p, variance + p * (1.0 - p)));
    assert_near(what, found as f64, sum, 3.0 * f64::sqrt(variance));
}

/// Each echo is seen with the probability Phi(SNR - TNR), and nothing else about it changes.
#[test]
fn noise_decides_what_is_seen() {
    let (rho, at_m, tnr) = (0.1, 7.0, 5.0);
    let sections = format!("detection: {{model: statistical, reflectance: {rho}, at_m: {at_m}, tnr: {tnr}}}");
    let all = scan(&wall(), &camera(""), ScanOptions::default());
    let cloud = scan(&wall(), &camera(&sections), ScanOptions::default().seed(3));
    let c = all.columns();
    let chance = |row: usize| {
        let strength = 0.5 * f64::from(c.cos_incidence()[row]) / f64::from(c.true_range()[row]).powi(2);
        normal_distribution((tnr + 1.281_551_566) * strength / (rho / (at_m * at_m)) - tnr)
    };
    assert!(cloud.len() > 20_000 && cloud.len() < 80_000, "{}", cloud.len());
    assert_count("echoes", cloud.len(), (0..all.len()).map(chance));
    // Not only in total: those seen with one chance in ten to nine in ten.
    let between: Vec<usize> = (0..all.len()).filter(|&row| (0.1..0.9).contains(&chance(row))).collect();
    let seen: BTreeMap<u32, usize> = (0..cloud.len()).map(|row| (cloud.columns().beam()[row], row)).collect();
    let found = between.iter().filter(|&&row| seen.contains_key(&c.beam()[row])).count();
    assert!(between.len() > 5000);
    assert_count("uncertain echoes", found, between.iter().map(|&row| chance(row)));
    for (beam, &row) in &seen {
        assert_eq!(cloud.columns().range()[row], c.range()[*beam as usize]);
    }
    // The paper's program uses the line alone.
    let program = ScanOptions::default().profile(Profile::Blainder);
    let seen = |sections: &str| {
        let cloud = scan(&wall(), &camera(sections), program.clone());
        cloud.columns().intensity().iter().filter(|&&intensity| intensity > 0.0).count()
    };
    assert_eq!(
        seen(&sections),
        seen(&format!("detection: {{model: radar_equation, reflectance: {rho}, at_m: {at_m}}}"))
    );
}

/// What is seen in a mirror, and dust in the air, are detected by chance as surfaces are, once each.
#[test]
fn noise_decides_what_is_seen_of_mirrors_and_dust() {
    let mut scene = SceneBuilder::new();
    let metal = Material::default().reflectance(Reflectance::Constant(0.9)).metallic(1.0).roughness(0.0);
    let (mirror, paint) = (scene.material(metal), scene.reflector(0.5));
    scene.stand(Shape::plate(5.0 * DVec3::X, DVec3::new(-1.0, 0.1, 0.0).normalize(), 50.0), Some(mirror));
    scene.stand(Shape::plate(-3.0 * DVec3::X, DVec3::X, 100.0), Some(paint));
    let dust = "{dust: {radius_um: 50, per_m3: 1e6, start_m: 4, length_m: 10}}";
    let cases = [
        (scene.finish().build().unwrap(), Cause::Mirror, "{}", "reflectance: 0.3, at_m: 14"),
        (nothing_ahead(), Cause::Dust, dust, "reflectance: 0.001, at_m: 3.6"),
    ];
    for (scene, cause, weather, line) in cases {
        let seen = |detection: &str| {
            let environment = Environment::from_yaml(weather).unwrap();
            let options = ScanOptions::default().seed(7).environment(environment);
            scan(&scene, &camera(&format!("beam: {{pulse_ns: 5}}\ndetection: {{model: {detection}}}")), options)
        };
        let (all, cloud) = (seen("none"), seen(&format!("statistical, {line}, tnr: 5")));
        assert!(cloud.columns().cause().iter().all(|&found| found == cause as u8));
        let numbers: Vec<f64> = line.split([' ', ',']).filter_map(|word| word.parse().ok()).collect();
        let strength =
            |row: usize| f64::from(all.columns().intensity()[row]) / f64::from(all.columns().true_range()[row]).powi(2);
        let snr = |row: usize| 6.281_551_566 * strength(row) / (numbers[0] / numbers[1].powi(2));
        assert!(cloud.len() > 5000 && cloud.len() + 5000 < all.len(), "{cause:?} {} of {}", cloud.len(), all.len());
        assert_count(line, cloud.len(), (0..all.len()).map(|row| normal_distribution(snr(row) - 5.0)));
    }
}

/// 100 MHz at a ratio of 4 over 200 m: 0.0258418 for each beam (computed with numpy), anywhere and without labels.
#[test]
fn false_alarms_come_evenly() {
    let receiver = |max_m: f64, rest: &str| {
        camera(&format!(
            "range: {{max_m: {max_m}}}\nreturns: {{mode: {rest}}}\n\
             detection: {{model: statistical, reflectance: 0.8, at_m: 100, tnr: 4, bandwidth_mhz: 100}}"
        ))
    };
    let cloud = scan(&nothing_ahead(), &receiver(200.0, "last"), ScanOptions::default().seed(3));
    let per_m = 0.025_841_8 / 200.0;
    assert_count("alarms", cloud.len(), (0..90_000).map(|_| 1.0 - (-0.025_841_8f64).exp()));
    let c = cloud.columns();
    assert!(c.cause().iter().all(|&cause| cause == Cause::FalseAlarm as u8));
    assert!(
        c.category_id().iter().chain(c.instance_id()).all(|&id| id == 0) && c.normal_x().iter().all(|x| x.is_nan())
    );
    assert!(c.range() == c.true_range() && c.range().iter().all(|range| (0.0..200.0).contains(range)));
    // The last of one or more: slightly beyond the middle. Three standard errors of a uniform distribution.
    let mean = c.range().iter().map(|&range| f64::from(range)).sum::<f64>() / cloud.len() as f64;
    let expected = 100.0 * (1.0 + per_m * 200.0 / 6.0);
    assert_near("mean range", mean, expected, 3.0 * 200.0 / (12.0 * cloud.len() as f64).sqrt());
    // At least as strong as the threshold.
    let unit = 0.8 / 1e4 / (4.0 + 1.281_551_566);
    let strengths =
        c.intensity().iter().zip(c.range()).map(|(&rho, &range)| f64::from(rho) / f64::from(range).powi(2) / unit);
    assert!(strengths.into_iter().all(|strength| strength > 4.0 - 1e-4));

    // In front of a wall: in mode first each beam up to the wall; in mode strongest never, the wall's echo being
    // stronger.
    let plain = scan(&wall(), &camera(""), ScanOptions::default());
    for (mode, before) in [("first", true), ("strongest", false)] {
        let cloud = scan(&wall(), &receiver(40.0, mode), ScanOptions::default().seed(2));
        assert_eq!(cloud.len(), 90_000);
        let c = cloud.columns();
        let alarms = c.cause().iter().filter(|&&cause| cause == Cause::FalseAlarm as u8).count();
        let ranges = plain.columns().range().iter().map(|&range| f64::from(range));
        assert_count(mode, alarms, ranges.map(|range| if before { 1.0 - (-per_m * range).exp() } else { 0.0 }));
        for row in (0..cloud.len()).filter(|&row| c.cause()[row] == Cause::Surface as u8) {
            assert_eq!(c.range()[row], plain.columns().range()[row], "surfaces stay where they are");
        }
    }
}

/// Computed by hand from section values made with scipy: 0.1 at 8 m returns 89.69 photons of 1.8e-4 uJ, 71.76
/// electrons, of which the noise in darkness is the 6.28155th part, 11.42; 51.80 photons of the sun add 124.3 to its
/// square: 1.3973 times the noise. A threshold that follows costs range, a fixed one blurs it and raises false alarms.
#[test]
fn sunlight_costs_range_or_adds_alarms() {
    let (noise, plain) = (1.3973, scan(&wall(), &camera(""), ScanOptions::default()));
    let c = plain.columns();
    let snr = |row: usize| {
        let strength = 0.5 * f64::from(c.cos_incidence()[row]) / f64::from(c.true_range()[row]).powi(2);
        6.281_551_566 * strength / (0.1 / 64.0)
    };
    let sections = |bandwidth: f64, sun: &str| {
        format!(
            "beam: {{pulse_ns: 5}}\nrange: {{max_m: 40}}\n\
             detection: {{model: statistical, reflectance: 0.1, at_m: 8, tnr: 5, bandwidth_mhz: {bandwidth}{sun}}}"
        )
    };
    let sun = ", sunlight: {pulse_uj: 1.8e-4, aperture_mm: 20, field_of_view_mrad: [3, 1.5], filter_nm: 40, adaptive: ";
    let (follows, fixed) = (format!("{sun}true}}"), format!("{sun}false}}"));
    let chances: [&dyn Fn(f64) -> f64; 3] =
        [&|snr| normal_distribution(snr - 5.0), &|snr| normal_distribution(snr / noise - 5.0), &|snr| {
            normal_distribution((snr - 5.0) / noise)
        }];
    for (sun, chance) in ["", &follows, &fixed].into_iter().zip(chances) {
        let cloud = scan(&wall(), &camera(&sections(0.0, sun)), ScanOptions::default().seed(6));
        assert_count(sun, cloud.len(), (0..plain.len()).map(|row| chance(snr(row))));
    }
    for (sun, tnr) in [("", 5.0), (&follows, 5.0), (&fixed, 5.0 / noise)] {
        let cloud = scan(&nothing_ahead(), &camera(&sections(100.0, sun)), ScanOptions::default().seed(6));
        let mean = 1e8 / 3f64.sqrt() * f64::exp(-tnr * tnr / 2.0) * 2.0 * 40.0 / 299_792_458.0;
        assert_count(sun, cloud.len(), (0..90_000).map(|_| 1.0 - (-mean).exp()));
    }
}

/// Three channels side by side, two of which use only a part of the light.
#[test]
fn weak_channels_see_less_far() {
    let sensor = |sections: &str| {
        let pattern = "pattern: {type: spinning, azimuth: {fov_deg: 60, rate_hz: 10, step_deg: 0.5}, channels: \
                       {elevation_deg: [-0.1, 0, 0.1]}}";
        Sensor::from_yaml(&format!("name: three\nkind: lidar\n{pattern}\n{sections}\n"), "").unwrap()
    };
    let per_channel = |sections: &str| {
        let cloud = scan(&wall(), &sensor(sections), ScanOptions::default());
        let mut sums = [(0, 0.0); 3];
        for (&channel, &intensity) in cloud.columns().channel().iter().zip(cloud.columns().intensity()) {
            let (count, sum) = &mut sums[usize::from(channel)];
            (*count, *sum) = (*count + 1, *sum + f64::from(intensity));
        }
        sums
    };
    // Power shows what a channel makes use of; a calibrated reflectivity does not, with one ray and with several.
    for sections in ["", "\nbeam: {divergence_mrad: 1, pulse_ns: 5, sub_rays: 5}"] {
        for (encoding, expected) in [("power", [1.0, 0.5, 0.25]), ("reflectivity", [1.0; 3])] {
            let sections = format!("intensity: {{encoding: {encoding}}}{sections}");
            let plain = per_channel(&sections);
            let part =
                per_channel(&format!("{sections}\ndetection: {{model: none, channel_efficiency: [1, 0.5, 0.25]}}"));
            for ((plain, part), expected) in plain.iter().zip(part).zip(expected) {
                assert_eq!(plain.0, part.0);
                assert_near("intensity", part.1, expected * plain.1, 1e-5 * plain.1);
            }
        }
    }
    // A quarter of the light: as far as a radar equation of half the range.
    let line = |at_m: f64| format!("detection: {{model: radar_equation, reflectance: 0.5, at_m: {at_m}");
    let quarter = per_channel(&format!("{}, channel_efficiency: [1, 0.25, 0]}}", line(30.0)));
    let [near, far] = [15.0, 30.0].map(|at_m| per_channel(&format!("{}}}", line(at_m))));
    assert!(near[1].0 > 10 && near[1].0 + 10 < far[1].0);
    assert_eq!(quarter.map(|(count, _)| count), [far[0].0, near[1].0, 0]);
}

/// Ten times the power at the threshold of 0.8 at 100 m, 8e-4: what is nearer than 25 m at 0.5 is reported darker.
#[test]
fn strong_echoes_saturate() {
    let line = "detection: {model: radar_equation, reflectance: 0.8, at_m: 100, saturation: 10}";
    for (range, expected) in [(1.0, 8e-4), (10.0, 0.08), (24.0, 0.4608), (26.0, 0.5), (60.0, 0.5)] {
        for (encoding, scale) in
            [("reflectivity", 1.0), ("reflectivity8", 100.0), ("power", 1.0 / (std::f64::consts::PI * range * range))]
        {
            let sensor = one_beam(&format!("{line}\nintensity: {{encoding: {encoding}}}"));
            let cloud = scan(&target(0.5, range, 0.0), &sensor, ScanOptions::default());
            let expected = if encoding == "reflectivity8" { (scale * expected).round() } else { scale * expected };
            assert_near(encoding, cloud.columns().intensity()[0].into(), expected, 1e-5 * expected);
            assert_near("range", cloud.columns().range()[0].into(), range, 1e-5 * range);
        }
    }
}

/// Beams are traced in blocks; the last one is not full here.
#[test]
fn the_last_echoes_of_a_scan_saturate_too() {
    let yaml = "name: row\nkind: lidar\npattern: {type: pinhole, resolution: [301, 1], fov_deg: [2, 0.05]}\n\
                detection: {model: radar_equation, reflectance: 0.8, at_m: 100, saturation: 10}\n\
                intensity: {encoding: reflectivity}\n";
    for sections in ["", "beam: {divergence_mrad: 1, pulse_ns: 5, sub_rays: 5}\n"] {
        let sensor = Sensor::from_yaml(&format!("{yaml}{sections}"), "").unwrap();
        let cloud = scan(&target(0.5, 5.0, 0.0), &sensor, ScanOptions::default());
        assert_eq!(cloud.len(), 301);
        let shown = cloud.columns().intensity();
        assert!(shown.iter().all(|shown| *shown > 0.0 && *shown < 0.1), "{shown:?}");
    }
}

/// Echoes of 5 ns at 2, 10 and 100 times the threshold seem nearer by 0.374741, 0.683008 and 0.965919 m where their
/// leading edge is timed. Computed with numpy.
#[test]
fn the_leading_edge_of_strong_echoes_comes_early() {
    let built = target(0.8, 20.0, 0.0);
    for (over, walk) in [(1.0f64, 0.0), (2.0, 0.374_741), (10.0, 0.683_008), (100.0, 0.965_919)] {
        let at_m = 20.0 * over.sqrt() * (1.0 + 1e-6);
        let sections = format!(
            "beam: {{pulse_ns: 5}}\ndetection: {{model: radar_equation, reflectance: 0.8, at_m: {at_m}, timing: leading_edge}}"
        );
        let cloud = scan(&built, &one_beam(&sections), ScanOptions::default());
        assert_near("range", cloud.columns().range()[0].into(), 20.0 - walk, 1e-3);
        assert_near("true range", cloud.columns().true_range()[0].into(), 20.0, 1e-4);
    }
}

/// A retro-reflector shines in the beams beside it, by as much as the angles to those that meet it predict; a white
/// plate does not.
#[test]
fn bright_surfaces_bloom() {
    let sections = "beam: {pulse_ns: 5}\nintensity: {encoding: reflectivity}\n\
                    detection: {model: radar_equation, reflectance: 0.8, at_m: 200, blooming: {weight: 1e-3, width_deg: 0.3}}";
    let pattern = "name: row\nkind: lidar\npattern: {type: pinhole, resolution: [401, 1], fov_deg: [20, 0.05]}";
    let sensor = Sensor::from_yaml(&format!("{pattern}\n{sections}\n"), "").unwrap();
    let look = |scattering: Scattering| {
        let mut scene = SceneBuilder::new();
        let paint = Material::default().reflectance(Reflectance::Constant(1.0)).scattering(scattering);
        let paint = scene.material(paint);
        scene.stand(Shape::plate(DVec3::X * 20.0, -DVec3::X, 0.5), Some(paint));
        scan(&scene.finish().build().unwrap(), &sensor, ScanOptions::default().organised(true))
    };
    let white = look(Scattering::Lambert);
    let met = |beam: usize| white.columns().range()[beam].is_finite();
    let plate: Vec<usize> = (0..401).filter(|&beam| met(beam)).collect();
    assert!((50..60).contains(&plate.len()), "{}", plate.len());
    let cloud = look(Scattering::RetroReflector { samples: vec![RetroSample { angle_deg: 70.0, cd_lx_m2: 250.0 }] });
    let beams = sensor.beams();
    let direction =
        |beam: usize| DVec3::new(beams.dir_x[beam].into(), beams.dir_y[beam].into(), beams.dir_z[beam].into());
    let (threshold, mut halo) = (0.8 / 200f64.powi(2), 0);
    for beam in 0..401 {
        // 785.4 is pi times the coefficient of retro-reflection.
        let mut expected = if met(beam) { 785.4 } else { 0.0 };
        for &other in plate.iter().filter(|&&other| other != beam) {
            expected += 785.4 * 1e-3 * (-direction(beam).angle_between(direction(other)).to_degrees() / 0.3).exp();
        }
        let seen = cloud.columns().range()[beam].is_finite();
        if (expected / 400.0 / threshold - 1.0).abs() > 0.02 {
            assert_eq!(seen, expected / 400.0 > threshold, "{beam}");
        }
        if seen {
            assert_near("intensity", cloud.columns().intensity()[beam].into(), expected, 0.02 * expected);
            assert_near("range", cloud.columns().range()[beam].into(), 20.0, 0.01);
            let cause = if met(beam) { Cause::Surface } else { Cause::Multipath };
            assert_eq!((cloud.columns().cause()[beam], cloud.columns().category_id()[beam]), (cause as u8, 1));
            halo += usize::from(!met(beam));
        }
    }
    assert!(halo > 60, "{halo}");
}
