use super::{assert_near, in_weather, nothing, scan, target};
use echocast::medium::{ClearAir, Dust, Fog, Placed, Rain, RainModel, Region, Snow, VisibilityModel};
use echocast::scene::Material;
use echocast::{Cause, Environment, Field, PointCloud, Profile, ScanOptions, Sensor};
use echocast_tests::reference::{SceneBuilder, Shape, Table, one_beam};
use glam::DVec3;
use std::f64::consts::PI;

const RADAR: &str = "detection: {model: radar_equation, reflectance: 0.8, at_m: 200}";

fn env(yaml: &str) -> Environment {
    Environment::from_yaml(yaml).unwrap()
}

/// Many beams of 3 x 1.5 mrad, ahead.
fn lidar(sections: &str) -> Sensor {
    let yaml = format!(
        "name: many\nkind: lidar\npattern: {{type: raster, azimuth: {{fov_deg: 40, step_deg: 0.1}}, elevation: {{fov_deg: \
         40, step_deg: 0.1}}}}\nrange: {{max_m: 200}}\n{RADAR}\n{sections}"
    );
    Sensor::from_yaml(&yaml, "").unwrap()
}

fn is(cloud: &PointCloud, cause: Cause) -> usize {
    cloud.columns().cause().iter().filter(|&&value| value == cause as u8).count()
}

/// Beer and Lambert, there and back: everywhere, and on part of the path.
#[test]
fn what_is_left_behind_weather_falls_exponentially() {
    let scene = target(0.5, 30.0, 0.0);
    let alpha = Rain::new(10.0).extinction(Default::default());
    for (yaml, depth) in [
        ("{rain: {rate_mm_h: 10, drops: false}}", alpha * 30.0),
        ("{rain: {rate_mm_h: 10, drops: false, start_m: 10, length_m: 5}}", alpha * 5.0),
        ("{rain: {rate_mm_h: 10, drops: false, start_m: 25, length_m: 50}}", alpha * 5.0),
        ("{rain: {rate_mm_h: 10, drops: false, start_m: 31, length_m: 5}}", 0.0),
        ("{rain: {rate_mm_h: 10, drops: false, box: {min_m: [5, -1, -1], max_m: [12, 1, 1]}}}", alpha * 7.0),
        ("{rain: {rate_mm_h: 10, drops: false, box: {min_m: [5, 1, -1], max_m: [12, 2, 1]}}}", 0.0),
        ("{rain: {rate_mm_h: 10, drops: false, sphere: {center_m: [10, 3, 0], radius_m: 5}}}", alpha * 8.0),
        ("{rain: {rate_mm_h: 10, drops: false, half_space: {point_m: [20, 0, 0], normal: [-3, 0, 0]}}}", alpha * 10.0),
        ("{rain: {rate_mm_h: 10, drops: false, half_space: {point_m: [20, 0, 0], normal: [1, 0, 0]}}}", alpha * 20.0),
        ("{rain: {rate_mm_h: 10, drops: false, half_space: {point_m: [0, 0, 2], normal: [0, 0, 1]}}}", alpha * 30.0),
        ("{rain: [{rate_mm_h: 10, drops: false}, {rate_mm_h: 10, drops: false}]}", alpha * 60.0),
        ("{environment: {rain: {rate_mm_h: 0}}}", 0.0),
    ] {
        let cloud = in_weather(&scene, &one_beam(""), yaml);
        assert_near(yaml, cloud.columns().intensity()[0].into(), 0.5 * (-2.0 * depth).exp(), 2e-6);
        assert_near("range", cloud.columns().range()[0].into(), 30.0, 1e-5);
        assert_eq!(cloud.columns().cause()[0], 0);
    }
}

/// Extinction by rain in every model, and what 100 m of it leave.
#[test]
fn rain_dims_as_its_table_says() {
    use RainModel::{Itu, MarshallPalmer, Paper, PaperLewandowski};
    let table = Table::parse(include_str!("../data/rain_extinction.csv"), ',');
    assert_eq!(table.len(), 10);
    let wall = target(0.5, 100.0, 0.0);
    for row in 0..table.len() {
        let number = |column| table.number(row, column);
        let rain = Rain::new(number("R_mm_per_h"));
        for (model, mu, column) in [
            (Paper, 0, "alpha_goodin_0.01_R^0.6_1/m"),
            (PaperLewandowski, 0, "same_if_1/km_in_1/m"),
            (MarshallPalmer, 0, "alpha_MP_Qext2_analytic_1/m"),
            (Itu, -2, "alpha_ITU_P1814-1_mu-2_1/m"),
            (Itu, 0, "alpha_ITU_mu0_1/m"),
            (Itu, 2, "alpha_ITU_mu2_1/m"),
        ] {
            let found = rain.mu(mu).extinction(model);
            assert_near(column, found / number(column), 1.0, 1e-6);
        }
        // Drops of twice their area are up to 0.8 % brighter than Mie series at 905 nm.
        let twice = rain.extinction(MarshallPalmer);
        assert_near("Mie", twice / number("alpha_MP_Mie_905_1/m"), 1.0, 0.008);
        let lewandowski = rain.model(PaperLewandowski);
        for (rain, profile, column) in [
            (rain, Profile::Physical, "T2way_100m_ITU_mu0"),
            (rain, Profile::Paper, "T2way_100m_goodin"),
            (lewandowski, Profile::Physical, "T2way_100m_lewand_1/km"),
        ] {
            let rain = rain.drops(false).range_noise(false);
            let environment = Environment::default().rain(vec![rain.into()]);
            let cloud = scan(&wall, &one_beam(""), ScanOptions::default().profile(profile).environment(environment));
            let clear = if profile == Profile::Paper { 0.5 / (PI * 1e4) } else { 0.5 };
            assert_near(column, f64::from(cloud.columns().intensity()[0]) / clear / number(column), 1.0, 1e-5);
        }
    }
}

/// The paper's eq. 15 as a standard deviation.
#[test]
fn rain_scatters_as_its_table_says() {
    let table = Table::parse(include_str!("../data/rain_range_noise.csv"), ',');
    assert_eq!(table.len(), 40);
    for row in 0..table.len() {
        let expected = table.number(row, "sigma_m_eq15_as_std(correct_reading)");
        let found = Rain::new(table.number(row, "R_f_mm_per_h")).range_sigma() * table.number(row, "R_m");
        assert_near("sigma", found / expected, 1.0, 1e-6);
    }
}

/// Extinction of haze and fog by visibility, at six wavelengths.
#[test]
fn fog_dims_as_its_table_says() {
    let table = Table::parse(include_str!("../data/visibility_extinction.csv"), ',');
    assert_eq!(table.len(), 84);
    for row in 0..table.len() {
        let number = |column| table.number(row, column);
        let (sight, wavelength) = (Some(1e3 * number("V_km")), number("lambda_nm"));
        let air = ClearAir::default().visibility_m(sight);
        let fog = Fog::default().visibility_m(sight);
        let other = |model| air.model(model).extinction(wavelength);
        for (found, column) in [
            (air.extinction(550.0), "alpha_550_koschmieder_2pct_1/m"),
            (air.extinction(wavelength), "alpha_kruse_1/m"),
            (other(VisibilityModel::Kruse), "alpha_kruse_1/m"),
            (other(VisibilityModel::Kim), "alpha_kim_1/m"),
            (fog.extinction(wavelength), "alpha_kim_1/m"),
            (fog.visibility_m(None).mor_m(sight).extinction(550.0), "alpha_MOR_5pct_1/m"),
        ] {
            assert_near(&format!("{column} of row {row}"), found / number(column), 1.0, 1e-6);
        }
    }
}

/// Clouds of dust, the paper's eq. 16 and 17: what they take from a wall behind them, and what they return.
#[test]
fn dust_dims_and_answers_as_its_table_says() {
    let table = Table::parse(include_str!("../data/dust.csv"), ',');
    assert_eq!(table.len(), 24);
    let wall = target(0.5, 70.0, 0.0);
    let far = one_beam("beam: {pulse_ns: 5, pulse_shape: rectangular, exit_diameter_mm: 1000}\nreturns: {mode: first}");
    for row in 0..table.len() {
        let number = |column| table.number(row, column);
        let dust = Dust::new(number("r_um"), number("n_per_m3"));
        assert_near("extinction", dust.extinction() / number("alpha_Qext1_1/m"), 1.0, 1e-8);
        assert_near("backscatter", dust.backscatter() / number("beta_eq17_1/(m sr)"), 1.0, 1e-8);
        let lidar_ratio = dust.extinction() / dust.backscatter();
        assert_near("lidar ratio", lidar_ratio, number("lidar_ratio_sr"), 1e-7);
        let cloud = |q_ext, start_m| {
            let region = Region::Shell { start_m, length_m: number("L_d_m") };
            let dust = vec![Placed { what: dust.q_ext(q_ext), region }];
            ScanOptions::default().environment(Environment::default().dust(dust))
        };
        for (q_ext, column) in [(1.0, "T_eq16(two_way_Qext1)"), (2.0, "T_two_way_Qext2")] {
            let left = scan(&wall, &one_beam(""), cloud(q_ext, 5.0)).columns().intensity()[0];
            assert_near(column, f64::from(left) / 0.5 / number(column), 1.0, 1e-5);
        }
        // A pulse 0.749 m long fills with dust, slightly hidden by its own front part.
        let c = scan(&nothing(), &far, cloud(1.0, 1000.0)).into_columns();
        assert_eq!(c.cause(), [Cause::Dust as u8]);
        let depth = 2.0 * dust.extinction() * 0.749_481;
        let expected = number("equivalent_lambert_reflectance_5ns_rect_pulse") * -f64::exp_m1(-depth) / depth;
        assert_near("as a wall", f64::from(c.intensity()[0]) / expected, 1.0, 5e-4);
    }
}

/// Fog answers at 1.677 m when the receiver sees its beam from 1 m on and the pulse lasts 20 ns; a wall at 10 m is
/// stronger above a reflectance of 0.57597. Values computed with scipy (MOR 99.86 m, pulse sin^2, lidar ratio 18.8 sr). The
/// beam is wide, for little fluctuates where droplets are many.
#[test]
fn fog_hides_dark_walls() {
    let sensor = one_beam("beam: {pulse_ns: 20, pulse_shape: sin2, overlap_m: [0.9, 1.0], exit_diameter_mm: 1000}");
    let fog = "{fog: {mor_m: 99.86, model: kim}}";
    for (rho, seen) in [(0.57597 * 1.003, Cause::Surface), (0.57597 * 0.997, Cause::Fog)] {
        let cloud = in_weather(&target(rho, 10.0, 0.0), &sensor, fog);
        assert_eq!(cloud.columns().cause(), [seen as u8], "{rho}");
        let expected = if seen == Cause::Fog { 1.67707 } else { 10.0 };
        assert_near("range", cloud.columns().range()[0].into(), expected, 0.02);
        assert_eq!(cloud.columns().category_id()[0] == 0, seen == Cause::Fog);
    }
    let mut last = sensor.clone();
    last.set("returns.mode", "last").unwrap();
    assert_eq!(is(&in_weather(&target(0.1, 10.0, 0.0), &last, fog), Cause::Surface), 1);
    let mut first = sensor.clone();
    first.set("returns.mode", "first").unwrap();
    assert_eq!(is(&in_weather(&target(0.9, 10.0, 0.0), &first, fog), Cause::Fog), 1);
    // Nothing stands there, but the fog is seen; a wall nearer than its echo hides it.
    assert_eq!(is(&in_weather(&nothing(), &sensor, fog), Cause::Fog), 1);
    assert_eq!(is(&in_weather(&target(0.01, 1.7, 0.0), &first, fog), Cause::Surface), 1);
}

/// The four regimes of a dust cloud in front of a wall at 30 m: the wall alone, the wall before the cloud, the cloud
/// alone, nothing. The cloud lies around the sensor, or in a box of the world.
#[test]
fn dust_has_four_regimes() {
    let places = ["start_m: 5, length_m: 12.5", "box: {min_m: [5, -9, -9], max_m: [17.5, 9, 9]}"];
    for place in places {
        for (per_m3, rho, mode, seen) in [
            (1e5, 0.5, "first", Some(Cause::Surface)),
            (1e6, 0.5, "strongest", Some(Cause::Surface)),
            (1e6, 0.5, "first", Some(Cause::Dust)),
            (1e7, 0.5, "strongest", Some(Cause::Dust)),
            (1e7, 0.05, "last", Some(Cause::Dust)),
            (2e5, 0.01, "first", None),
        ] {
            let sensor = one_beam(&format!(
                "{RADAR}\nreturns: {{mode: {mode}}}\nbeam: {{pulse_ns: 5, pulse_shape: sin2, overlap_m: [0, 0.1], \
                 exit_diameter_mm: 1000}}"
            ));
            let yaml = format!("{{dust: {{radius_um: 50, per_m3: {per_m3:e}, {place}}}}}");
            let cloud = in_weather(&target(rho, 30.0, 0.0), &sensor, &yaml);
            let found = cloud.columns().cause().first().copied();
            assert_eq!(found, seen.map(|cause| cause as u8), "{per_m3} {rho} {mode} {place}");
            if found == Some(Cause::Dust as u8) {
                let expected = if per_m3 == 1e6 { 5.51253 } else { 5.47695 };
                let within = if place == places[0] { 0.1 } else { 0.06 };
                assert_near("range", cloud.columns().range()[0].into(), expected, within);
            }
        }
    }
}

/// Greatest ranges in weather are in the table of `detection.rs`; this is its counterpart for what returns: the echo of
/// a dust cloud over that of a wall, 5.61957 for 10^7 grains and a reflectance of 0.5.
#[test]
fn dust_is_as_bright_as_its_backscatter_says() {
    let beam = "{pulse_ns: 5, pulse_shape: sin2, overlap_m: [0, 0.1], exit_diameter_mm: 1000}";
    let sensor = one_beam(&format!("beam: {beam}\nintensity: {{encoding: power}}"));
    let dust = "{dust: {radius_um: 50, per_m3: 1e7, start_m: 5, length_m: 12.5}}";
    let cloud = in_weather(&target(0.5, 30.0, 0.0), &sensor, dust).columns().intensity()[0];
    let wall = 0.5 * (-2.0 * Dust::new(50.0, 1e7).extinction() * 12.5).exp() / (PI * 900.0);
    assert_near("ratio", f64::from(cloud) / wall, 5.61957, 2e-3);
}

/// Drops that the sensor detects, counted by brute force: the mean number of a beam by small steps of range.
#[test]
fn drops_and_flakes_show_as_often_as_they_should() {
    let [start, h, v] = [0.012, 3e-3, 1.5e-3];
    let k = 0.8 / 200f64.powi(2);
    let rain = (8000.0, 4.1 * 10f64.powf(-0.21), 0.0225, Rain::new(10.0).extinction(Default::default()));
    let growth = 10f64.cbrt();
    let melted = 2.29 * 2f64.powf(-0.45);
    let snow = (2.5e3 * 2f64.powf(-0.94) / growth, melted / growth, 0.9, Snow::new(2.0).extinction());
    let sensor = lidar(
        "beam: {divergence_mrad: [3, 1.5], exit_diameter_mm: 12, pulse_ns: 5, overlap_m: [0.5, 2]}\nreturns: {mode: first}",
    );
    for (yaml, (number, slope, rho, alpha), cause) in
        [("{rain: {rate_mm_h: 10}}", rain, Cause::Rain), ("{snow: {rate_mm_h: 2}}", snow, Cause::Snow)]
    {
        let (mut mean, step) = (0.0f64, 1e-3);
        let mut nearest = 0.0;
        for i in 0..200_000 {
            let r = (f64::from(i) + 0.5) * step;
            let square = (start + h * r) * (start + v * r);
            let gain = ((r - 0.5) / 1.5).clamp(0.0, 1.0) * (-2.0 * alpha * r).exp();
            let fill = k * r * r / (rho * gain);
            if fill < 1.0 {
                let least = ((fill * square).sqrt() * 1e3).max(1.0);
                let rate = PI / 4.0 * square * number / slope * (-slope * least).exp() * step;
                nearest += (-mean).exp() * rate * r;
                mean += rate;
            }
        }
        let cloud = in_weather(&nothing(), &sensor, yaml);
        let beams = sensor.beams().len() as f64;
        let expected = 1.0 - (-mean).exp();
        let found = is(&cloud, cause) as f64 / beams;
        let error = (expected * (1.0 - expected) / beams).sqrt();
        assert!((found - expected).abs() < 3.0 * error + 0.01 * expected, "{yaml}: {found} {expected}");
        let mean_range = cloud.columns().range().iter().map(|&r| f64::from(r)).sum::<f64>() / cloud.len() as f64;
        assert_near("mean range of the nearest", mean_range, nearest / expected, 0.05);
        // The mean is measured, no noise is requested.
        assert_eq!(cloud.columns().range(), cloud.columns().true_range());
    }
}

/// Eq. 15 as a standard deviation, and off unless requested.
#[test]
fn rain_scatters_ranges_if_asked() {
    let mut scene = SceneBuilder::new();
    scene.stand(Shape::sphere(50.0, 256).flat(), None);
    let scene = scene.finish().build().unwrap();
    let sensor = lidar("");
    let spread = |yaml: &str, profile| {
        let options = ScanOptions::default().environment(env(yaml)).profile(profile);
        let cloud = scan(&scene, &sensor, options);
        let errors: Vec<f64> = (cloud.columns().range().iter())
            .zip(cloud.columns().true_range())
            .map(|(measured, truth)| f64::from(measured - truth) / f64::from(*truth))
            .collect();
        (errors.iter().map(|error| error * error).sum::<f64>() / errors.len() as f64).sqrt()
    };
    for (rate, expected) in [(1.0, 0.399_576_4 / 50.0), (10.0, 0.999_909_2 / 50.0)] {
        let yaml = format!("{{rain: {{rate_mm_h: {rate}, drops: false, range_noise: true, model: itu}}}}");
        // Three standard errors of the spread of 160,801 points.
        let within = 3.0 / (2.0 * 160_801f64).sqrt();
        assert!((spread(&yaml, Profile::Physical) / expected - 1.0).abs() < within);
        for profile in [Profile::Paper, Profile::Blainder] {
            let found = spread(&yaml.replace("range_noise: true, ", ""), profile);
            assert!((found / expected - 1.0).abs() < within, "{profile:?}: {found}");
        }
    }
    assert_eq!(spread("{rain: {rate_mm_h: 10, drops: false}}", Profile::Physical), 0.0);
}

/// Rain does not change the errors of the points that are left.
#[test]
fn rain_leaves_the_noise_of_others_alone() {
    let mut scene = SceneBuilder::new();
    let paint = scene.reflector(0.9);
    scene.stand(Shape::plate(DVec3::new(12.0, 0.0, 0.0), -DVec3::X, 40.0), Some(paint));
    let scene = scene.finish().build().unwrap();
    let sensor = lidar(
        "beam: {divergence_mrad: 3, pulse_ns: 5}\nreturns: {mode: first}\nnoise: {range_sigma_m: 0.03, dropout: 0.1}",
    );
    let [dry, wet] = ["{}", "{rain: {rate_mm_h: 20}}"].map(|yaml| in_weather(&scene, &sensor, yaml));
    let mut same = 0;
    let mut dry_rows = dry.columns().beam().iter().zip(dry.columns().range()).peekable();
    for ((beam, range), cause) in wet.columns().beam().iter().zip(wet.columns().range()).zip(wet.columns().cause()) {
        while dry_rows.next_if(|(dry_beam, _)| *dry_beam < beam).is_some() {}
        if *cause == Cause::Surface as u8 {
            assert_eq!(dry_rows.next(), Some((beam, range)));
            same += 1;
        }
    }
    assert!(same > 100_000 && is(&wet, Cause::Rain) > 1000, "{same} {}", is(&wet, Cause::Rain));
}

/// Nothing answers from behind a surface, even if that is too dark or too near to be reported, or a mirror.
#[test]
fn surfaces_end_what_is_seen_of_the_air() {
    let dust = "{dust: {radius_um: 50, per_m3: 1e8, box: {min_m: [20, -5, -5], max_m: [30, 5, 5]}}}";
    let beam = "beam: {pulse_ns: 5, overlap_m: [0, 0.1]}";
    let sensor = one_beam(&format!("{RADAR}\n{beam}\nrange: {{min_m: 2}}"));
    assert_eq!(is(&in_weather(&nothing(), &sensor, dust), Cause::Dust), 1);
    assert_eq!(in_weather(&target(0.0, 10.0, 0.0), &sensor, dust).len(), 0);
    assert_eq!(in_weather(&target(0.5, 1.0, 0.0), &sensor, dust).len(), 0);
    let mut scene = SceneBuilder::new();
    let mirror = Material::default().name("mirror").metallic(1.0).roughness(0.0);
    let mirror = scene.material(mirror);
    scene.stand(Shape::plate(DVec3::new(5.0, 0.0, 0.0), DVec3::new(-1.0, 1.0, 0.0).normalize(), 1.0), Some(mirror));
    assert_eq!(in_weather(&scene.finish().build().unwrap(), &sensor, dust).len(), 0);
}

/// Fog up to a height answers a sensor inside it like fog everywhere; a thin sheet answers from its middle.
#[test]
fn fog_in_places_answers_as_fog_everywhere() {
    let sensor = one_beam("beam: {pulse_ns: 5, exit_diameter_mm: 1000}\nintensity: {encoding: power}");
    let fog = |place: &str| {
        let yaml = format!("{{fog: {{mor_m: 99.86, model: kim{place}}}}}");
        let cloud = in_weather(&nothing(), &sensor, &yaml);
        (f64::from(cloud.columns().range()[0]), f64::from(cloud.columns().intensity()[0]))
    };
    let (range, power) = fog("");
    for place in
        [", half_space: {point_m: [0, 0, 3], normal: [0, 0, 1]}", ", box: {min_m: [-9, -9, -9], max_m: [90, 9, 9]}"]
    {
        let (found, as_bright) = fog(place);
        assert_near("range", found, range, 0.02);
        assert_near("power", as_bright / power, 1.0, 0.05);
    }
    assert_near("thin", fog(", box: {min_m: [10, -9, -9], max_m: [10.2, 9, 9]}").0, 10.1, 1e-3);
    // Grazing a face of the box counts as inside.
    assert_near("grazing", fog(", box: {min_m: [-9, -9, 0], max_m: [90, 9, 9]}").0, range, 0.02);
}

/// In mode last a drop counts behind the fog that answers first.
#[test]
fn the_last_echo_of_the_air_may_be_a_drop() {
    let sensor = lidar("beam: {divergence_mrad: 3, pulse_ns: 5}\nreturns: {mode: last}");
    let cloud = in_weather(&nothing(), &sensor, "{fog: {visibility_m: 100}, snow: {rate_mm_h: 2}}");
    assert!(is(&cloud, Cause::Snow) > 1000 && is(&cloud, Cause::Fog) > 1000);
    // Other weather leaves the flakes unchanged.
    let more = in_weather(&nothing(), &sensor, "{clear_air: {visibility_m: 1e9}, snow: {rate_mm_h: 2}}");
    let less = in_weather(&nothing(), &sensor, "{snow: {rate_mm_h: 2}}");
    let same = more.columns().beam().iter().zip(less.columns().beam()).filter(|(a, b)| a == b).count();
    assert!(same * 1000 > less.len() * 999, "{same} of {}", less.len());
}

/// The unlabelled points of the air have no surface: no label, no side, no colour.
#[test]
fn echoes_of_the_air_have_no_surface() {
    let sensor = lidar("beam: {divergence_mrad: 3, pulse_ns: 5}");
    let cloud = in_weather(&target(0.02, 60.0, 0.0), &sensor, "{fog: {visibility_m: 60}}");
    assert!(is(&cloud, Cause::Fog) > 100_000);
    for (row, &cause) in cloud.columns().cause().iter().enumerate() {
        if cause == Cause::Fog as u8 {
            assert!(cloud.columns().normal_x()[row].is_nan() && cloud.columns().cos_incidence()[row].is_nan());
            assert_eq!(cloud.columns().material_id()[row] + u32::from(cloud.columns().red()[row]), 0);
            assert!(cloud.columns().intensity()[row] > 0.0);
        }
    }
    assert!(cloud.fields().contains(Field::Cause));
}

#[test]
fn weather_is_read_as_it_is_written() {
    let environment = Environment::default()
        .rain(vec![
            Rain::new(10.0).into(),
            Placed { what: Rain::new(2.0), region: Region::Shell { start_m: 1.0, length_m: 2.0 } },
        ])
        .fog(vec![Placed {
            what: Fog::default().visibility_m(200.0),
            region: Region::HalfSpace { point_m: [0.0, 0.0, 2.0], normal: [0.0, 0.0, 1.0] },
        }])
        .snow(vec![Snow::new(1.0).into()]);
    assert_eq!(env(&environment.to_yaml().unwrap()), environment);
    assert!(env("{}").is_empty() && env("").is_empty());
    assert_eq!(env(&Environment::default().to_yaml().unwrap()), Environment::default());
}

#[test]
fn wrong_weather_is_named() {
    for (yaml, expected) in [
        ("rain: {rate_mm_h: -1}", "line 1: rain.rate_mm_h: is -1; allowed: 0 to 500"),
        ("rain: {rate: 1}", "line 1: rain.rate: unknown key \"rate\"; near: rate_mm_h; allowed: rate_mm_h, model"),
        (
            "rain:\n- {rate_mm_h: 1}\n- {rate_mm_h: 1, model: itv}",
            "line 3: rain[1].model: unknown value \"itv\"; near: itu",
        ),
        ("fog: {}", "line 1: fog: is without visibility_m, mor_m and spectrum; allowed: one of them"),
        ("fog: {visibility_m: 0}", "line 1: fog.visibility_m: is 0; allowed: 0.1 or more"),
        ("fog: {visibility_m: 5, mor_m: 4}", "line 1: fog.mor_m: is 4; allowed: none together with visibility_m"),
        (
            "dust: {radius_um: 50, per_m3: 1e5, start_m: 5, length_m: -1}",
            "line 1: dust.length_m: is -1; allowed: above 0",
        ),
        ("dust: {radius_um: 50, per_m3: 1e5, start_m: 5}", "the key `length_m` is missing"),
        (
            "dust: {radius_um: 50, per_m3: 1e5, start_m: 5, box: {min_m: [0, 0, 0], max_m: [1, 1, 1]}}",
            "allowed: one region",
        ),
        (
            "snow: {rate_mm_h: 1, box: {min_m: [0, 0, 3], max_m: [1, 1, 1]}}",
            "line 1: snow.box.max_m[2]: is 1; allowed: above",
        ),
        ("environment: {rain: {rate_mm_h: 501}}", "line 1: environment.rain.rate_mm_h: is 501; allowed: 0 to 500"),
        ("- rain", "line 1: is not a section of keys"),
        ("hail: {}", "unknown key \"hail\"; allowed: clear_air, rain"),
        ("spray: {spectrum: light}", "spray.spectrum: unknown value \"light\""),
    ] {
        let error = Environment::from_yaml(yaml).unwrap_err().to_string();
        assert!(error.contains(expected), "{yaml}\n  gives {error}\n  not   {expected}");
    }
}
