use super::{assert_near, scan, target};
use echocast::material::Reflectance;
use echocast::medium::{PerLength, Rain, RainModel};
use echocast::scene::{Filter, Material, Texture, TextureRef};
use echocast::{Environment, Profile, ReflectanceSource, ScanOptions, Scene};
use echocast_tests::reference::{SceneBuilder, Shape, Table, one_beam, sensor};
use glam::{DAffine3, DVec3};
use std::sync::Arc;

fn profile(profile: Profile) -> ScanOptions {
    ScanOptions::default().profile(profile)
}

/// Dims by `extinction`, 1/m, and does nothing else.
fn dimming(extinction: f64) -> Environment {
    let model = Some(RainModel::PowerLaw { a: extinction, b: 0.0, unit: PerLength::PerM });
    let rain = Rain::new(1.0).model(model).drops(false).range_noise(false);
    Environment::default().rain(vec![rain.into()])
}

/// Pulses of 1 uJ into an opening of 20 mm and optics of 0.7: received energy, J, and photons at 905 nm, computed with
/// numpy.
#[test]
fn a_microjoule_gives_thousands_of_photons() {
    let power = one_beam("intensity: {encoding: power}");
    let opening = std::f64::consts::PI * 0.01f64.powi(2);
    let photon = 6.626_070_15e-34 * 299_792_458.0 / 905e-9;
    for (rho, range, alpha, theta, joule, photons) in [
        (0.1, 50.0, 0.0, 0.0, 2.8000e-15, 12_756.5),
        (0.1, 100.0, 1e-4, 0.0, 6.8614e-16, 3_125.96),
        (0.8, 200.0, 0.0, 60.0, 7.0000e-16, 3_189.11),
        (0.8, 200.0, 1e-4, 0.0, 1.3451e-15, 6_128.13),
    ] {
        let options = ScanOptions::default().environment(dimming(alpha));
        let cloud = scan(&target(rho, range, theta), &power, options);
        let received = f64::from(cloud.columns().intensity()[0]) * 1e-6 * opening * 0.7;
        assert_near("energy", received / joule, 1.0, 3e-5);
        assert_near("photons", received / photon / photons, 1.0, 5e-6);
    }
}

#[test]
fn received_energy_is_that_of_the_radar_equation() {
    let table = Table::parse(include_str!("../data/pn_vs_range.csv"), ',');
    let power = one_beam("intensity: {encoding: power}");
    assert_eq!(table.len(), 450);
    for row in 0..table.len() {
        let number = |column| table.number(row, column);
        let scene = target(number("gamma"), number("R_m"), number("theta_deg"));
        let environment = dimming(number("alpha_1_per_m"));
        for (options, expected) in [
            (ScanOptions::default(), number("P_n_with_cos")),
            (profile(Profile::Paper), number("P_n_paper_eq5_no_cos")),
        ] {
            let cloud = scan(&scene, &power, options.environment(environment.clone()));
            assert_eq!(cloud.len(), 1);
            assert_near("intensity", cloud.columns().intensity()[0].into(), expected, 1e-5 * expected);
        }
    }
}

#[test]
fn energy_falls_with_the_square_of_range_and_the_cosine_of_incidence() {
    let power = one_beam("intensity: {encoding: power}");
    let energy = |range: f64, angle: f64| {
        f64::from(scan(&target(0.4, range, angle), &power, ScanOptions::default()).columns().intensity()[0])
    };
    for range in [3.0, 17.0, 110.0] {
        assert_near("ratio", energy(range, 0.0) / energy(2.0 * range, 0.0), 4.0, 4e-5);
        for angle in [10.0f64, 45.0, 75.0, 85.0] {
            let cos = angle.to_radians().cos();
            assert_near("ratio", energy(range, angle) / energy(range, 0.0), cos, 1e-5);
        }
    }
}

#[test]
fn reflectivity_does_not_depend_on_range() {
    for (encoding, scale, tolerance) in [("reflectivity", 1.0, 1e-5), ("reflectivity8", 100.0, 0.5)] {
        let sensor = one_beam(&format!("intensity: {{encoding: {encoding}}}"));
        for range in [1.0, 30.0, 250.0] {
            for angle in [0.0f64, 33.0, 60.0] {
                let cloud = scan(&target(0.7, range, angle), &sensor, ScanOptions::default());
                let intensity = f64::from(cloud.columns().intensity()[0]);
                assert_near("intensity", intensity, scale * 0.7 * angle.to_radians().cos(), tolerance);
                assert!(scale == 1.0 || intensity.fract() == 0.0, "8 bits hold whole numbers, not {intensity}");
            }
        }
    }
}

/// The intensity of head-on hits on `material`.
fn head_on(material: Material, options: ScanOptions) -> f64 {
    let mut scene = SceneBuilder::new();
    let paint = scene.material(material);
    scene.stand(
        Shape::triangle([DVec3::new(5.0, -1.0, -1.0), DVec3::new(5.0, 1.0, -1.0), DVec3::new(5.0, 0.1, 1.0)]),
        Some(paint),
    );
    f64::from(scan(&scene.finish().build().unwrap(), &one_beam(""), options).columns().intensity()[0])
}

#[test]
fn reflectance_comes_from_the_material_then_the_library_then_the_colour() {
    let base_color = [0.1, 0.6, 0.3, 0.45];
    let plain = Material::default().name("no such thing").base_color(base_color);
    let with = |reflectance_source| ScanOptions::default().reflectance_source(reflectance_source);
    let luminance = 0.2126 * 0.1 + 0.7152 * 0.6 + 0.0722 * 0.3;
    let by_luminance = with(Some(ReflectanceSource::Luminance));
    assert_near("luminance", head_on(plain.clone(), by_luminance.clone()), luminance, 1e-6);
    assert_near("alpha", head_on(plain.clone(), with(Some(ReflectanceSource::Alpha))), 0.45, 1e-6);
    assert_near("the program's alpha", head_on(plain.clone(), profile(Profile::Blainder)), 0.45, 1e-6);
    let both = profile(Profile::Blainder).reflectance_source(ReflectanceSource::Luminance);
    assert_near("the program with luminance", head_on(plain.clone(), both), luminance, 1e-6);

    // The estimate at 905 nm: 0.094 + 0.131 Y + 0.646 max + 0.197 S + 0.591 G, S = 0.2 / 0.35, G = 0.1 / 0.35.
    let dull = plain.clone().base_color([0.1, 0.3, 0.2, 1.0]);
    let of_dull = 0.2126 * 0.1 + 0.7152 * 0.3 + 0.0722 * 0.2;
    let estimate = 0.094 + 0.131 * of_dull + 0.646 * 0.3 + 0.197 * 0.2 / 0.35 + 0.591 * 0.1 / 0.35;
    assert_near("the estimate", head_on(dull.clone(), with(None)), estimate, 1e-6);
    // The colour of metals is their reflectance.
    let metal = dull.metallic(1.0);
    assert_near("metal", head_on(metal, with(None)), of_dull, 1e-6);

    let known = f64::from(Material::library("concrete").unwrap().reflectance.unwrap().at(905.0));
    assert!((known - luminance).abs() > 0.01);
    for name in ["Concrete.001", "OldConcreteWall"] {
        let library = plain.clone().name(name);
        assert_near("library", head_on(library.clone(), with(None)), known, 1e-6);
        assert_near("not asked", head_on(library.clone(), by_luminance.clone()), luminance, 1e-6);
        let own = library.reflectance(Reflectance::Constant(0.123));
        assert_near("the material's own", head_on(own, with(None)), 0.123, 1e-6);
    }
}

/// A sheet with a picture of `width` x 1 pixels from y = 0 (left, u = 0) to y = -`width`, 4 m in front of the sensor.
fn picture(pixels: &[[u8; 4]], filter: Filter, copies: usize) -> Scene {
    let width = pixels.len() as f64;
    let mut sheet = Shape::quad(DVec3::new(4.0, 0.0, 1.0), -width * DVec3::Y, -2.0 * DVec3::Z);
    sheet.uvs = Some(vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]);
    let image = Texture::new(pixels.len() as u32, 1, pixels.to_vec());
    let mut scene = SceneBuilder::new();
    let paint = scene.material(
        Material::default()
            .name("print")
            .base_color([0.5, 1.0, 1.0, 0.8])
            .base_color_texture(TextureRef::plain(Arc::new(image)).filter(filter)),
    );
    let mesh = scene.mesh([(sheet, Some(paint))]);
    for copy in 0..copies {
        scene.place(mesh, DAffine3::from_translation(-100.0 * copy as f64 * DVec3::X));
    }
    scene.finish()
}

fn linear(byte: u8) -> f64 {
    let encoded = f64::from(byte) / 255.0;
    if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

#[test]
fn pictures_colour_surfaces_and_say_their_reflectance() {
    let pixels = [[255, 0, 0, 255], [10, 200, 30, 128], [0, 0, 250, 64], [255, 255, 255, 0]];
    // Off the diagonal, where two triangles meet.
    let aims: Vec<DVec3> = (0..pixels.len()).map(|i| DVec3::new(4.0, -0.5 - i as f64, 0.97)).collect();
    for copies in [1, 2] {
        let built = picture(&pixels, Filter::Nearest, copies).build().unwrap();
        let by_luminance = ScanOptions::default().reflectance_source(ReflectanceSource::Luminance);
        let bright = scan(&built, &sensor(&aims), by_luminance);
        let infrared = scan(&built, &sensor(&aims), ScanOptions::default());
        let opaque = scan(&built, &sensor(&aims), profile(Profile::Blainder));
        assert_eq!((bright.len(), opaque.len()), (4, 4));
        for (row, pixel) in pixels.into_iter().enumerate() {
            let [red, green, blue] = [0, 1, 2].map(|channel| linear(pixel[channel]));
            let cos = 4.0 / aims[row].length();
            let luminance = 0.2126 * 0.5 * red + 0.7152 * green + 0.0722 * blue;
            assert_near("luminance", bright.columns().intensity()[row].into(), luminance * cos, 1e-5);
            let (most, least) = ((0.5 * red).max(green).max(blue), (0.5 * red).min(green).min(blue));
            let greenness = (green - blue.max(0.5 * red)).max(0.0) / (most + 0.05);
            let color = (most - least) / (most + 0.05);
            let estimate = 0.094 + 0.131 * luminance + 0.646 * most + 0.197 * color + 0.591 * greenness;
            let estimate = estimate.clamp(0.02, 0.95) * cos;
            assert_near("infrared", infrared.columns().intensity()[row].into(), estimate, 1e-5);
            let alpha = 0.8 * f64::from(pixel[3]) / 255.0;
            assert_near("alpha", opaque.columns().intensity()[row].into(), alpha * cos, 1e-5);
            assert_eq!((bright.columns().green()[row], bright.columns().blue()[row]), (pixel[1], pixel[2]));
            assert_near("red, halved in linear light", linear(bright.columns().red()[row]), 0.5 * red, 0.004);
        }
    }
}

#[test]
fn between_pixels_light_is_mixed_linearly() {
    let built = picture(&[[0, 0, 0, 0], [0, 255, 0, 255]], Filter::Linear, 1).build().unwrap();
    let options = ScanOptions::default().reflectance_source(ReflectanceSource::Alpha);
    // From the centre of the first pixel (y = -0.5) to that of the second.
    for share in [0.0, 0.25, 0.5, 0.8, 1.0] {
        let aim = DVec3::new(4.0, -0.5 - share, 0.9);
        let cloud = scan(&built, &sensor(&[aim]), options.clone());
        assert_near("alpha", f64::from(cloud.columns().intensity()[0]) * aim.length() / 4.0, 0.8 * share, 1e-5);
        assert_near("green", linear(cloud.columns().green()[0]), share, 0.005);
    }
}
