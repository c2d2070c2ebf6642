//! What surfaces are made of: how they scatter, where they have holes, how glass shows itself.

use super::{assert_near, scan};
use echocast::material::{Reflectance, RetroSample, Scattering};
use echocast::scene::Material;
use echocast::{Profile, ScanOptions};
use echocast_tests::reference::{SceneBuilder, Shape, one_beam, sensor};
use glam::DVec3;

fn paint(reflectance: f32, scattering: Scattering) -> Material {
    Material {
        name: "paint".into(),
        reflectance: Some(Reflectance::Constant(reflectance)),
        scattering,
        ..Material::default()
    }
}

fn retro(r_a: f32) -> Scattering {
    Scattering::RetroReflector { samples: vec![RetroSample { angle_deg: 70.0, cd_lx_m2: r_a }] }
}

/// A board of `material` 10 m off, turned by `angle_deg` from head-on.
fn board(material: Material, angle_deg: f64) -> SceneBuilder {
    let (sin, cos) = angle_deg.to_radians().sin_cos();
    let mut scene = SceneBuilder::new();
    let material = scene.material(material);
    scene.stand(Shape::plate(DVec3::new(10.0, 0.0, 0.0), DVec3::new(-cos, sin, 0.0), 2.0), Some(material));
    scene
}

/// Effective reflectances head-on and at 60 degrees, made with numpy from the formulas of the models.
#[test]
fn boards_are_as_bright_as_their_model_says() {
    let oren_nayar = |s: f32| Scattering::OrenNayar { slope_sigma_deg: s.to_degrees() };
    for (model, rho, head_on, inclined) in [
        (Scattering::Lambert, 0.5, 0.5, 0.25),
        (Scattering::Constant, 0.5, 0.5, 0.5),
        (oren_nayar(0.3), 0.5, 0.446_429, 0.307_589),
        (oren_nayar(0.5), 0.5, 0.392_241, 0.320_202),
        (Scattering::Phong { specular: 0.15, exponent: 20.0 }, 0.35, 2.0, 0.175),
        (Scattering::Ggx { f0: 0.04, alpha: 0.3 }, 0.4, 0.511_111, 0.202_677),
        (retro(250.0), 0.0, 785.398, 1570.796),
        (retro(70.0), 0.0, 219.911, 439.823),
    ] {
        for (angle, expected) in [(0.0, head_on), (60.0, inclined)] {
            let built = board(paint(rho, model.clone()), angle).finish().build().unwrap();
            let cloud = scan(&built, &one_beam(""), ScanOptions::default());
            assert_near(&format!("{model:?}"), cloud.columns.intensity[0].into(), expected, 1e-5 * expected);
            let power = scan(&built, &one_beam("intensity: {encoding: power}"), ScanOptions::default());
            let expected = expected / (std::f64::consts::PI * 100.0);
            assert_near("power", power.columns.intensity[0].into(), expected, 1e-5 * expected);
            // The paper knows Lambert surfaces only.
            let paper = ScanOptions { profile: Profile::Blainder, ..ScanOptions::default() };
            let cos = angle.to_radians().cos();
            assert_near(
                "program",
                scan(&built, &one_beam(""), paper).columns.intensity[0].into(),
                f64::from(rho) * cos,
                1e-6,
            );
        }
    }
}

/// A plate of a retro-reflector is seen beyond the range of a white wall, in a mirror too, though that takes most.
#[test]
fn retro_reflectors_are_seen_from_afar() {
    let sections = "detection: {model: radar_equation, reflectance: 1.0, at_m: 5}";
    let far = |scattering| {
        let built = board(paint(0.0, scattering), 0.0).finish().build().unwrap();
        scan(&built, &one_beam(sections), ScanOptions::default()).len
    };
    // (10 / 5)^2 = 4 = pi R_A.
    assert_eq!([far(Scattering::Constant), far(retro(1.26)), far(retro(1.28))], [0, 0, 1]);

    let half = 0.5f64.sqrt();
    let mut scene = SceneBuilder::new();
    let plate = scene.material(paint(0.0, retro(250.0)));
    scene.stand(Shape::plate(DVec3::new(5.0, 7.0, 0.0), -DVec3::Y, 2.0), Some(plate));
    let mirror = scene.material(Material {
        name: "mirror".into(),
        metallic: 1.0,
        roughness: 0.0,
        ..paint(0.1, Scattering::Lambert)
    });
    scene.stand(Shape::plate(DVec3::new(5.0, 0.0, 0.0), DVec3::new(-half, half, 0.0), 1.0), Some(mirror));
    let cloud = scan(&scene.finish().build().unwrap(), &one_beam(sections), ScanOptions::default());
    assert_eq!(cloud.len, 1);
    assert_near("intensity", cloud.columns.intensity[0].into(), 785.398 * 0.01, 1e-4);
}

/// A surface that scatters otherwise leaves Lambert surfaces beside it as they are.
#[test]
fn others_keep_their_bits() {
    let walls = |second: Scattering| {
        let mut scene = board(paint(0.7, Scattering::Lambert), 25.0);
        let material = scene.material(paint(0.3, second));
        scene.stand(Shape::plate(DVec3::new(0.0, 10.0, 0.0), DVec3::new(0.2, -1.0, 0.1), 2.0), Some(material));
        let aims: Vec<DVec3> =
            (0..40).map(|i| if i % 2 == 0 { DVec3::new(10.0, 0.02 * f64::from(i), 0.1) } else { DVec3::Y }).collect();
        scan(&scene.finish().build().unwrap(), &sensor(&aims), ScanOptions::default()).columns.intensity
    };
    let (plain, mixed) = (walls(Scattering::Lambert), walls(Scattering::Constant));
    assert_eq!((plain.len(), mixed.len()), (40, 40));
    for row in 0..40 {
        assert_eq!(plain[row].to_bits() == mixed[row].to_bits(), row % 2 == 0);
    }
}
