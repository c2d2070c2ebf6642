//! Bodies of a few numbers are met where their equations say.

use super::{assert_near, scan, vector};
use echocast::scene::{Mesh, Object, PrimitiveShape};
use echocast::{ScanOptions, Scene};
use echocast_tests::reference::{raster, sensor};
use glam::{DAffine3, DQuat, DVec3};
use std::sync::Arc;

type Inside = fn(DVec3) -> bool;

/// Text of a shape, and whether a place is in it: straight from its definition.
const SHAPES: [(&str, Inside); 6] = [
    ("{box: {size_m: [1, 2, 0.6]}}", |p| p.abs().cmple(DVec3::new(0.5, 1.0, 0.3)).all()),
    ("{sphere: {radius_m: 0.8}}", |p| p.length() <= 0.8),
    ("{ellipsoid: {radii_m: [0.5, 1, 0.3]}}", |p| (p / DVec3::new(0.5, 1.0, 0.3)).length() <= 1.0),
    ("{capsule: {radius_m: 0.4, length_m: 1.2}}", |p| (p - DVec3::Z * p.z.clamp(-0.6, 0.6)).length() <= 0.4),
    ("{cylinder: {radius_m: 0.5, length_m: 1.4}}", |p| p.truncate().length() <= 0.5 && p.z.abs() <= 0.7),
    ("{cone: {radius_m: 0.7, length_m: 1.4}}", |p| p.z.abs() <= 0.7 && p.truncate().length() <= 0.5 * (0.7 - p.z)),
];

/// Distance along a ray at which it enters a body, by steps and bisection.
fn entered(inside: Inside, origin: DVec3, along: DVec3) -> Option<f64> {
    const STEP: f64 = 2e-3;
    let at = |range: f64| inside(origin + along * range);
    let far = (1..4000).map(|step| STEP * f64::from(step)).find(|&range| at(range))?;
    let (mut near, mut far) = (far - STEP, far);
    for _ in 0..40 {
        let middle = 0.5 * (near + far);
        if at(middle) { far = middle } else { near = middle }
    }
    Some(far)
}

/// Away from edges and outlines, ranges have no error of tessellation, and normals neither: alone or as copies, stretched and
/// mirrored or not.
#[test]
fn primitives_are_met_where_their_equations_say() {
    let turn = DQuat::from_rotation_z(0.7) * DQuat::from_rotation_x(0.5);
    for (text, inside) in SHAPES {
        for (scale, copies) in [(DVec3::ONE, 1), (DVec3::new(1.0, -1.5, 0.8), 2)] {
            let placed = DAffine3::from_scale_rotation_translation(scale, turn, DVec3::new(4.0, 0.1, 0.2));
            let mesh: Arc<Mesh> = Arc::new(PrimitiveShape::from_yaml(text).unwrap().mesh("body", 1e-3).unwrap());
            let mut scene = Scene::default();
            for copy in 0..copies {
                let away = DAffine3::from_translation(-100.0 * f64::from(copy) * DVec3::X);
                let mut object = Object::new("body", mesh.clone());
                object.world_from_object = away * placed;
                scene.objects.push(object);
            }
            let built = scene.build().unwrap();
            let sensor = sensor(&raster(80, 80, 0.5));
            let cloud = scan(&built, &sensor, ScanOptions::default());
            let object_from_world = placed.inverse();
            let meet = |along: DVec3| {
                let origin = object_from_world.translation;
                entered(inside, origin, object_from_world.transform_vector3(along))
            };
            let (c, beams) = (cloud.columns(), sensor.beams());
            let mut checked = 0;
            for row in 0..cloud.len() {
                let beam = c.beam()[row] as usize;
                let along = vector(&beams.dir_x, &beams.dir_y, &beams.dir_z, beam).normalize();
                let Some(range) = meet(along) else { continue };
                // The normal by what is met beside it at these angles, rad, which is far off the line between across an edge.
                let normal_by = |angle: f64, most: f64| {
                    let beside = [DVec3::Y, -DVec3::Y, DVec3::Z, -DVec3::Z].map(|way| {
                        let along = (along + angle * way).normalize();
                        meet(along).map(|range| range * along)
                    });
                    let [left, right, up, down] = beside.map(|place| place.unwrap_or(DVec3::INFINITY));
                    let bend = |a: DVec3, b: DVec3| (0.5 * (a + b) - range * along).length();
                    let normal = (left - right).cross(up - down).normalize();
                    (bend(left, right) < most && bend(up, down) < most).then(|| normal * -normal.dot(along).signum())
                };
                // Not within 2 mm of an edge or the outline.
                let (Some(_), Some(normal)) = (normal_by(5e-4, 1e-4), normal_by(1e-5, 2e-8)) else { continue };
                if normal.dot(along) > -0.2 {
                    continue;
                }
                checked += 1;
                assert_near(text, c.range()[row].into(), range, 3e-7 * range + 1e-8);
                let is = vector(c.normal_x(), c.normal_y(), c.normal_z(), row);
                assert!((is - normal).length() < 2e-3, "{text}: normal {is} is not {normal}");
            }
            assert!(checked > 500, "{text}: {checked}");
        }
    }
}
