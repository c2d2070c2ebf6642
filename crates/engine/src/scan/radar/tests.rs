//! What scenes of a few plates return, against textbooks.

use super::paths::{FrameLimits, FramePaths};
use crate::echo::radar::{CentreGrid, RadarRoute, RadarSurfaces, WaveField};
use crate::medium::RadioAir;
use crate::scene::{Mesh, Object, Part, Scene};
use crate::trace::{BuiltScene, Engine};
use glam::{DAffine3, DMat3, DQuat, DVec3};
use model::material::Material;
use num_complex::Complex64;
use radar::ElementPattern;
use std::f64::consts::PI;
use std::sync::Arc;

const WAVELENGTH: f64 = 3.893_409e-3;

/// An object of quads, each two triangles, of `material`.
fn quads(name: &str, corners: &[[[f32; 3]; 4]], material: &str) -> Object {
    let triangles: Vec<[u32; 3]> = (0..corners.len() as u32)
        .flat_map(|quad| [[0, 1, 2], [0, 2, 3]].map(|it| it.map(|at: u32| 4 * quad + at)))
        .collect();
    triangles_of(name, corners.iter().flatten().copied().collect(), triangles, material)
}

fn triangles_of(name: &str, positions: Vec<[f32; 3]>, triangles: Vec<[u32; 3]>, material: &str) -> Object {
    let material = Material::from_yaml(&format!("name: {material}")).unwrap();
    let part =
        Part::default().positions(positions.into()).triangles(triangles.into()).material(Some(Arc::new(material)));
    Object::new(name, Arc::new(Mesh::new(name, vec![part]).unwrap()))
}

fn built(objects: Vec<Object>) -> BuiltScene {
    let mut scene = Scene::default();
    objects.into_iter().for_each(|object| scene.objects.push(object));
    scene.build_with(&Engine::new().unwrap()).unwrap()
}

fn moved(mut object: Object, to: DAffine3) -> Object {
    object.world_from_object = to * object.world_from_object;
    object
}

/// What a radar at `place` that looks along x receives.
fn paths(scene: &BuiltScene, place: DVec3, mirrors: usize) -> FramePaths {
    let surfaces = RadarSurfaces::new(&scene.0.surfaces, 77e9).unwrap();
    let (pattern, air) = (ElementPattern::default().table(), RadioAir::default());
    let half = 60f64.to_radians();
    let field = WaveField {
        scene: &scene.0,
        surfaces: &surfaces,
        place: place - scene.origin(),
        axes: DMat3::IDENTITY,
        velocity: DVec3::ZERO,
        time: 0.0,
        wavelength: WAVELENGTH,
        polarisation: radar::Polarisation::Vertical,
        tx: &pattern,
        rx: &pattern,
        power: 1.0,
        air: &air,
        reach: 1e5,
        sector: [[-half, half], [-0.5 * half, 0.5 * half]],
        floor: 1e-14,
    };
    let centres = CentreGrid::new(0.2, 0.1, [0.1; 2]);
    let limits = FrameLimits { time: 0.0, mask: u32::MAX, mirrors, resolution: 0.2, centres, clutter: None };
    let mut found = FramePaths::default();
    found.find(&field, &limits);
    found
}

/// Sum of all amplitudes, as a strength, 1/m.
fn strength(found: &FramePaths) -> Complex64 {
    let sum: Complex64 = found.echoes.paths.amplitude.iter().map(|it| Complex64::new(it.re.into(), it.im.into())).sum();
    sum * (4.0 * PI / WAVELENGTH)
}

/// Radar cross-section, dB re 1 m^2, as seen from `range` m.
fn cross_section_db(found: &FramePaths, range: f64) -> f64 {
    10.0 * (4.0 * PI * range.powi(4) * strength(found).norm_sqr()).log10()
}

/// A plate of side `a`, m, in the plane x = 0 with its middle at the origin.
fn plate(a: f32, parts: usize) -> Object {
    let at = |index: usize| a * (index as f32 / parts as f32 - 0.5);
    let mut all = Vec::new();
    for row in 0..parts {
        for column in 0..parts {
            let ([y, v], [z, w]) = ([at(column), at(column + 1)], [at(row), at(row + 1)]);
            all.push([[0.0, y, z], [0.0, v, z], [0.0, v, w], [0.0, y, w]]);
        }
    }
    quads("plate", &all, "metal")
}

/// Two plates at right angles along the z axis, which open towards -x.
fn dihedral(a: f32) -> Object {
    let (s, h) = (a * 0.5f32.sqrt(), 0.5 * a);
    let face = |y: f32| [[0.0, 0.0, -h], [-s, y, -h], [-s, y, h], [0.0, 0.0, h]];
    quads("dihedral", &[face(s), face(-s)], "metal")
}

/// Three triangles at right angles with edges of `a`, m, that open towards -x.
fn trihedral(a: f32) -> Object {
    let axis = DVec3::new(1.0, 1.0, 1.0).normalize();
    let turn = DQuat::from_rotation_arc(axis, DVec3::NEG_X);
    let at = |place: DVec3| (turn * place * f64::from(a)).as_vec3().to_array();
    let positions = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z].map(at).to_vec();
    triangles_of("trihedral", positions, vec![[0, 1, 2], [0, 2, 3], [0, 3, 1]], "metal")
}

fn at(x: f64, y: f64, z: f64, degrees: f64) -> DAffine3 {
    DAffine3::from_rotation_translation(DQuat::from_rotation_z(degrees.to_radians()), DVec3::new(x, y, z))
}

/// Check values 7 to 9, with facets of any size and plates anywhere.
#[test]
fn plates_return_what_textbooks_say() {
    for (parts, degrees, y) in [(1, 0.0, 0.0), (8, 0.0, 0.3), (1, 0.5, -2.0), (8, 1.0, 0.1), (40, 2.0, 0.7)] {
        let range: f64 = 60.0;
        let heading = f64::atan(y / range);
        let place = at(range * heading.cos(), range * heading.sin(), 0.2, degrees + heading.to_degrees());
        let scene = built(vec![moved(plate(0.1, parts), place)]);
        let found = paths(&scene, DVec3::new(0.0, 0.0, 0.2), 3);
        let k = 2.0 * PI / WAVELENGTH;
        let u = k * 0.1 * degrees.to_radians().sin();
        let pattern = if u == 0.0 { 1.0 } else { (u.sin() / u).powi(2) * degrees.to_radians().cos().powi(2) };
        let truth = 10.0 * (4.0 * PI * 1e-4 / (WAVELENGTH * WAVELENGTH) * pattern).log10();
        let error = cross_section_db(&found, range) - truth;
        assert!(error.abs() < 0.3, "{parts} parts at {degrees} degrees: {error} dB");
    }
}

/// Check values 4 and 6, and their patterns over 20 degrees: products of projected areas.
#[test]
fn corners_return_what_textbooks_say() {
    let range: f64 = 40.0;
    for (degrees, limit) in [(0.0, 0.3), (3.0, 1.0), (7.0, 1.0), (12.0, 1.0), (20.0, 1.0)] {
        for (y, parts) in [(0.0, "flat"), (1.3, "aside")] {
            let heading = f64::atan(y / range);
            let place = |turn: f64| at(range * heading.cos(), range * heading.sin(), 0.0, turn + heading.to_degrees());
            // A dihedral of faces a x b at an angle t off its bisector: 4 pi (2 a b sin(45 - t))^2 / lambda^2.
            let scene = built(vec![moved(dihedral(0.1), place(degrees))]);
            let found = paths(&scene, DVec3::ZERO, 3);
            let area = 2.0 * 0.01 * (PI / 4.0 - f64::to_radians(degrees)).sin();
            let truth = 10.0 * (4.0 * PI * area * area / (WAVELENGTH * WAVELENGTH)).log10();
            let error = cross_section_db(&found, range) - truth;
            assert!(
                error.abs() < limit,
                "dihedral {parts} at {degrees} degrees: {error} dB, {:?}",
                found.search.targets
            );
        }
    }
    let scene = built(vec![moved(trihedral(0.1), at(range, 0.0, 0.0, 0.0))]);
    let found = paths(&scene, DVec3::ZERO, 3);
    let error = cross_section_db(&found, range) - 14.41429;
    assert!(error.abs() < 0.3, "trihedral: {error} dB ");
}

/// Check value 28: the two-ray pattern over a road.
#[test]
fn roads_give_four_paths() {
    let ground =
        quads("road", &[[[-50.0, -30.0, 0.0], [250.0, -30.0, 0.0], [250.0, 30.0, 0.0], [-50.0, 30.0, 0.0]]], "metal");
    let sphere_like = plate(0.006, 1);
    let mut least = f64::INFINITY;
    for range in [60.0, 64.2072, 75.0, 85.6119, 128.42] {
        let scene = built(vec![ground.clone(), moved(sphere_like.clone(), at(range, 0.0, 0.5, 0.0))]);
        let found = paths(&scene, DVec3::new(0.0, 0.0, 0.5), 1);
        let free = built(vec![moved(sphere_like.clone(), at(range, 0.0, 0.5, 0.0))]);
        let alone = paths(&free, DVec3::new(0.0, 0.0, 0.5), 1);
        let plate_only = |found: &FramePaths| {
            let echoes = &found.echoes;
            (0..echoes.row.len())
                .filter(|&index| (f64::from(echoes.place[index].x) - range).abs() < 0.1)
                .map(|index| {
                    let it = echoes.paths.amplitude[index];
                    Complex64::new(it.re.into(), it.im.into())
                })
                .sum::<Complex64>()
        };
        let factor = plate_only(&found).norm() / plate_only(&alone).norm();
        // The road reflects vertical waves nearly with +1.
        let (h, k) = (0.5, 2.0 * PI / WAVELENGTH);
        let bounced = (range * range + 4.0 * h * h).sqrt();
        let road = RadarSurfaces::new(&scene.0.surfaces, 77e9).unwrap();
        let reflected = road.of(&scene.0.surfaces, 0).reflect((2.0 * h / bounced) as f32).p;
        let reflected = Complex64::new(reflected.re.into(), reflected.im.into());
        let truth = (Complex64::ONE + reflected * Complex64::cis(-k * (bounced - range))).norm_sqr();
        least = least.min(truth);
        assert!((factor - truth).abs() < 0.05, "{range} m: {factor}, not {truth}");
        assert!(found.echoes.route.contains(&RadarRoute::Back));
    }
    assert!(least < 0.1, "{least}");
}

/// A target beside a wall is seen in it, at its mirror image.
#[test]
fn walls_show_ghosts() {
    let wall = quads("wall", &[[[0.0, 5.0, -2.0], [60.0, 5.0, -2.0], [60.0, 5.0, 6.0], [0.0, 5.0, 6.0]]], "metal");
    let scene = built(vec![wall, moved(trihedral(0.2), at(30.0, 0.0, 0.0, 0.0))]);
    let found = paths(&scene, DVec3::ZERO, 1);
    let ghost = (30f64.powi(2) + 10f64.powi(2)).sqrt();
    let both = (0..found.echoes.row.len())
        .filter(|&index| found.echoes.route[index] == RadarRoute::Both)
        .max_by(|&a, &b| {
            let power = |index: usize| found.echoes.paths.amplitude[index].norm_sqr();
            power(a).total_cmp(&power(b))
        })
        .expect("an echo both ways by way of the wall");
    assert!((found.echoes.paths.range[both] - ghost).abs() < 0.2, "{}", found.echoes.paths.range[both]);
    let [x, y, _] = found.echoes.paths.rx_direction[both];
    assert!((f64::from(y).atan2(f64::from(x)) - (10f64 / 30.0).atan()).abs() < 0.01);
}
