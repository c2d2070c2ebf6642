use super::{assert_near, scan, target};
use echocast::medium::{Dust, Placed, Rain, Region};
use echocast::{Environment, Profile, ScanOptions};
use echocast_tests::reference::{SceneBuilder, Shape, Table, one_beam};
use glam::DVec3;

/// How many points a target gives.
fn seen(sections: &str, [reflectance, range, angle]: [f64; 3], profile: Profile) -> usize {
    let options = ScanOptions { profile, ..ScanOptions::default() };
    scan(&target(reflectance, range, angle), &one_beam(sections), options).len
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
        for (profile, column) in
            [(Profile::Physical, "r_threshold_linear_correct"), (Profile::Blainder, "r_threshold_BLAINDER_code")]
        {
            let limit = table.number(row, column);
            // The intensity of what is not detected is 0 where such points are kept at all.
            let detected = |rho: f64| {
                let options = ScanOptions { profile, ..ScanOptions::default() };
                let cloud = scan(&target(rho, range, 0.0), &one_beam(&sections), options);
                assert!(profile == Profile::Physical || cloud.len == 1, "the program keeps undetected points");
                cloud.columns.intensity.iter().any(|&intensity| intensity > 0.0)
            };
            assert!(limit + 1e-5 > 1.0 || detected(limit + 1e-5), "row {row}: {limit} at {range} m");
            assert!(limit == 0.0 || !detected((limit - 1e-5).min(1.0)), "row {row}: {limit} at {range} m");
        }
    }
}

/// The same table behind rain and fog.
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
            let options = ScanOptions { environment: environment.clone(), ..ScanOptions::default() };
            assert_eq!(scan(&target(rho, range, 0.0), &sensor, options).len, expected, "{rho} {yaml} at {range} m");
        }
    }
}

#[test]
fn profile_blainder_gives_what_the_program_gives() {
    let table = Table::parse(include_str!("../data/blainder_compat.csv"), ',');
    assert_eq!(table.len(), 13);
    for row in 0..table.len() {
        let options = || ScanOptions {
            profile: Profile::Blainder,
            environment: program_weather(&table, row),
            ..ScanOptions::default()
        };
        let number = |column| table.number(row, column);
        let scene = target(number("pixel_alpha"), number("distance_m"), number("theta_deg"));
        let cloud = scan(&scene, &one_beam(&limit_section(&table, row)), options());
        assert_eq!(cloud.len, 1, "undetected points are kept");
        assert_near("intensity", cloud.columns.intensity[0].into(), number("stored_intensity"), 1e-6);
        let range = number("reported_distance_m_no_noise");
        assert_near("range", cloud.columns.range[0].into(), range, 1e-6 * range);
    }
}

/// Rain and dust of a row; rain without its range noise.
fn program_weather(table: &Table, row: usize) -> Environment {
    let there = |column| !table.text(row, column).is_empty();
    let number = |column| table.number(row, column);
    let mut environment = Environment::default();
    if there("rain_mm_h") {
        environment.rain = vec![Rain { range_noise: Some(false), ..Rain::new(number("rain_mm_h")) }.into()];
    }
    if there("dust_n") {
        let what = Dust { radius_um: number("dust_r_um"), per_m3: number("dust_n"), q_ext: 1.0 };
        let region = Region::Shell { start_m: number("dust_start_m"), length_m: number("dust_L_m") };
        environment.dust = vec![Placed { what, region }];
    }
    environment
}

/// Two plates behind each other: the ray stops at the first, seen or not.
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
        assert_eq!(cloud.len, usize::from(reported), "{sections}");
        for &range in &cloud.columns.range {
            assert_near("range", range.into(), 5.0, 1e-6);
        }
    }
}
