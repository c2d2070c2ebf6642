//! Boxes, balls and the like as triangles.

use crate::robot::LinkShape;
use glam::DVec3;
use model::Part;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// How far triangles may be inside the true surface, metres.
const TOLERANCE_M: f64 = 1e-3;

/// Most edges of a circle: with it, circles of up to 26 m in radius keep the tolerance.
const MOST_EDGES: usize = 512;

/// Fewest edges of a circle.
const FEWEST_EDGES: usize = 12;

/// The surface of a primitive as triangles of which none is more than 1 mm inside the true surface, with the normals of
/// that; `None`: a mesh, whose triangles are in its file.
pub fn primitive_mesh(shape: &LinkShape) -> Option<Part> {
    match *shape {
        LinkShape::Mesh { .. } => None,
        LinkShape::Box { size } => Some(cuboid(size)),
        LinkShape::Plane { size: [x, y] } => {
            let corners = [[-x, -y], [x, -y], [x, y], [-x, y]];
            let positions: Vec<[f32; 3]> =
                corners.iter().map(|[x, y]| [(x / 2.0) as f32, (y / 2.0) as f32, 0.0]).collect();
            Some(Part::default().positions(positions.into()).triangles(vec![[0, 1, 2], [0, 2, 3]].into()))
        }
        LinkShape::Sphere { radius } => Some(revolved(&arc(radius, 0.0, -FRAC_PI_2, FRAC_PI_2), radius, DVec3::ONE)),
        LinkShape::Ellipsoid { radii } => {
            let largest = radii.max_element();
            let unit: Vec<ProfilePoint> = arc(largest, 0.0, -FRAC_PI_2, FRAC_PI_2);
            Some(revolved(&unit, largest, radii / largest))
        }
        LinkShape::Cylinder { radius, length } => {
            let half = length / 2.0;
            let profile = [
                ProfilePoint { at: [0.0, -half], normal: [0.0, -1.0] },
                ProfilePoint { at: [radius, -half], normal: [0.0, -1.0] },
                ProfilePoint { at: [radius, -half], normal: [1.0, 0.0] },
                ProfilePoint { at: [radius, half], normal: [1.0, 0.0] },
                ProfilePoint { at: [radius, half], normal: [0.0, 1.0] },
                ProfilePoint { at: [0.0, half], normal: [0.0, 1.0] },
            ];
            Some(revolved(&profile, radius, DVec3::ONE))
        }
        LinkShape::Capsule { radius, length } => {
            let mut profile = arc(radius, -length / 2.0, -FRAC_PI_2, 0.0);
            profile.extend(arc(radius, length / 2.0, 0.0, FRAC_PI_2));
            Some(revolved(&profile, radius, DVec3::ONE))
        }
    }
}

/// A point of the outline that is turned about z, by its distance from the axis and its height, metres.
struct ProfilePoint {
    at: [f64; 2],
    normal: [f64; 2],
}

/// How many edges a circle needs so that its chords are half the tolerance inside of it: `r (1 - cos(pi / n))`. The
/// other half is for the other direction.
fn edges(radius: f64) -> usize {
    let inside = (TOLERANCE_M / 2.0 / radius).min(1.0);
    let needed = (PI / (1.0 - inside).acos()).ceil() as usize;
    needed.clamp(FEWEST_EDGES, MOST_EDGES)
}

/// The part of a circle about (0, `height`) from one elevation to another, radians.
fn arc(radius: f64, height: f64, from: f64, to: f64) -> Vec<ProfilePoint> {
    let steps = ((edges(radius) as f64 * (to - from) / TAU).ceil() as usize).max(2);
    let point = |step: usize| {
        let elevation = from + (to - from) * step as f64 / steps as f64;
        // Exactly on the axis at the poles.
        let along = if elevation.abs() == FRAC_PI_2 { 0.0 } else { elevation.cos() };
        let normal = [along, elevation.sin()];
        ProfilePoint { at: [radius * normal[0], height + radius * normal[1]], normal }
    };
    (0..=steps).map(point).collect()
}

/// The surface that `profile`, from below upwards, describes about z, each axis then multiplied by `scale`.
fn revolved(profile: &[ProfilePoint], radius: f64, scale: DVec3) -> Part {
    let around = edges(radius);
    let (mut positions, mut normals) = (Vec::new(), Vec::new());
    for ProfilePoint { at: [distance, height], normal } in profile {
        for step in 0..around {
            let (sin, cos) = (TAU * step as f64 / around as f64).sin_cos();
            let at = DVec3::new(distance * cos, distance * sin, *height) * scale;
            let normal = DVec3::new(normal[0] * cos, normal[0] * sin, normal[1]) / scale;
            positions.push(at.as_vec3().to_array());
            normals.push(normal.normalize().as_vec3().to_array());
        }
    }
    let mut triangles = Vec::new();
    for (ring, pair) in profile.windows(2).enumerate() {
        let [low, high] = [&pair[0], &pair[1]];
        if low.at == high.at {
            continue;
        }
        for step in 0..around {
            let next = (step + 1) % around;
            let [a, b] = [ring * around + step, ring * around + next].map(|index| index as u32);
            let [c, d] = [a + around as u32, b + around as u32];
            if low.at[0] > 0.0 {
                triangles.push([a, b, if high.at[0] > 0.0 { d } else { c }]);
            }
            if high.at[0] > 0.0 {
                triangles.push([a, d, c]);
            }
        }
    }
    Part::default().positions(positions.into()).normals(Some(normals.into())).triangles(triangles.into())
}

/// A box with its centre at the origin.
fn cuboid(size: DVec3) -> Part {
    let corner = |index: usize| {
        let side = |axis: usize| (if index >> axis & 1 == 1 { 0.5 } else { -0.5 } * size[axis]) as f32;
        [side(0), side(1), side(2)]
    };
    let positions: Vec<[f32; 3]> = (0..8).map(corner).collect();
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles: Vec<[u32; 3]> = faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    Part::default().positions(positions.into()).triangles(triangles.into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DAffine3, Vec3};

    /// Volume and area of a closed surface.
    fn measures(shape: &LinkShape) -> (f64, f64) {
        let part = primitive_mesh(shape).unwrap();
        assert!(shape == &LinkShape::Plane { size: [1.0, 1.0] } || part.is_closed() || part.normals.is_some());
        let corner = |index: u32| Vec3::from(part.positions[index as usize]).as_dvec3();
        let volumes = part.triangles.iter().map(|t| corner(t[0]).dot(corner(t[1]).cross(corner(t[2]))) / 6.0);
        (volumes.sum(), part.area(&DAffine3::IDENTITY))
    }

    #[test]
    fn surfaces_face_outwards_and_enclose_their_volumes() {
        let close = |found: f64, true_one: f64| assert!((found / true_one - 1.0).abs() < 0.01, "{found}, {true_one}");
        let cases = [
            (LinkShape::Box { size: DVec3::new(1.0, 2.0, 3.0) }, 6.0, 22.0),
            (LinkShape::Sphere { radius: 0.5 }, PI / 6.0, PI),
            (LinkShape::Cylinder { radius: 0.5, length: 2.0 }, PI / 2.0, 2.5 * PI),
            (LinkShape::Capsule { radius: 0.5, length: 2.0 }, PI / 2.0 + PI / 6.0, 3.0 * PI),
        ];
        for (shape, volume, area) in cases {
            let found = measures(&shape);
            close(found.0, volume);
            close(found.1, area);
        }
        let ellipsoid = LinkShape::Ellipsoid { radii: DVec3::new(0.5, 1.0, 1.5) };
        close(measures(&ellipsoid).0, 4.0 / 3.0 * PI * 0.75);
        close(measures(&LinkShape::Plane { size: [1.0, 1.0] }).1, 1.0);
    }

    #[test]
    fn triangles_are_within_a_millimetre_of_the_true_surface() {
        for radius in [0.001, 0.05, 0.5, 5.0, 20.0] {
            let part = primitive_mesh(&LinkShape::Sphere { radius }).unwrap();
            let deepest = part.triangles.iter().map(|&[a, b, c]| {
                let [a, b, c] = [a, b, c].map(|index| Vec3::from(part.positions[index as usize]).as_dvec3());
                radius - ((a + b + c) / 3.0).length()
            });
            let deepest = deepest.fold(0.0, f64::max);
            assert!(deepest < TOLERANCE_M, "{radius}: {deepest}");
        }
    }

    #[test]
    fn normals_are_those_of_the_true_surface() {
        let radii = DVec3::new(0.3, 0.2, 0.1);
        let part = primitive_mesh(&LinkShape::Ellipsoid { radii }).unwrap();
        for (at, normal) in part.positions.iter().zip(part.normals.as_ref().unwrap().iter()) {
            // The gradient of x^2 / a^2 + y^2 / b^2 + z^2 / c^2.
            let gradient = Vec3::from(*at).as_dvec3() / (radii * radii);
            assert!(gradient.normalize().dot(Vec3::from(*normal).as_dvec3()) > 1.0 - 1e-6);
        }
    }
}
