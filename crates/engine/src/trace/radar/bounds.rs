//! How strong the echoes of facets are at most: of most facets of a mesh this already shows that they do not matter.

use crate::scene::Part;
use glam::{DAffine3, DMat3, DVec3, Vec3};
use radar::optics::Ends;

/// Of each triangle of a part, in the mesh's frame, what limits its echo.
#[derive(Clone, Debug, Default)]
pub struct FacetBounds {
    middle: [Vec<f32>; 3],
    /// Unit normal; 0 of triangles without area.
    normal: [Vec<f32>; 3],
    area: Vec<f32>,
    /// Length of all edges.
    edges: Vec<f32>,
}

/// Triangles that are looked at together.
const LANES: usize = 64;

/// Rounding of single precision: of directions, and of squares of sines.
const ROUNDED: [f32; 2] = [1e-5, 1e-5];

impl FacetBounds {
    pub(super) fn new(part: &Part) -> FacetBounds {
        let mut bounds = FacetBounds::default();
        for corners in part.triangles.iter() {
            let [a, b, c] = corners.map(|corner| DVec3::from_array(part.positions[corner as usize].map(f64::from)));
            let across = (b - a).cross(c - a);
            let (middle, normal) = ((a + b + c) / 3.0, across.normalize_or_zero());
            for axis in 0..3 {
                bounds.middle[axis].push(middle[axis] as f32);
                bounds.normal[axis].push(normal[axis] as f32);
            }
            bounds.area.push(0.5 * across.length() as f32);
            bounds.edges.push(((b - a).length() + (c - b).length() + (a - c).length()) as f32);
        }
        bounds
    }

    /// Adds the triangles to `found` whose [`Ends::bound`] may be `least`, 1/m, or more and which may be nearer than `reach`
    /// m, for the wave number `k`, rad/m. `place` is world from mesh, which must not change any angle.
    pub fn strong(&self, place: &DAffine3, ends: &Ends, k: f64, (least, reach): (f64, f64), found: &mut Vec<u32>) {
        let scale = place.matrix3.x_axis.length();
        let back = place.inverse();
        let [source, observer] = [ends.source, ends.observer].map(|end| (back.transform_point3(end) * scale).as_vec3());
        let (k, scale) = (k as f32, scale as f32);
        let (least, reach) = (0.99 * least as f32, 1.001 * reach as f32);
        let count = self.area.len();
        let mut keep = [false; LANES];
        for first in (0..count).step_by(LANES) {
            let lanes = first..(first + LANES).min(count);
            let [x, y, z] = self.middle.each_ref().map(|axis| &axis[lanes.clone()]);
            let [u, v, w] = self.normal.each_ref().map(|axis| &axis[lanes.clone()]);
            let (areas, edges) = (&self.area[lanes.clone()], &self.edges[lanes.clone()]);
            for lane in 0..areas.len() {
                let middle = scale * Vec3::new(x[lane], y[lane], z[lane]);
                let normal = Vec3::new(u[lane], v[lane], w[lane]);
                let [to_source, to_observer] = [source - middle, observer - middle];
                let [r, s] = [to_source.length().max(1e-6), to_observer.length().max(1e-6)];
                let [up, down] = [normal.dot(to_source) / r, normal.dot(to_observer) / s];
                let half = to_source / r + to_observer / s;
                let cos = (up + down).abs();
                let tilt = (half.length_squared() - cos * cos - ROUNDED[1]).max(0.0).sqrt();
                let edges = scale * edges[lane];
                let area = (scale * scale * areas[lane]).min(edges / (k * tilt).max(f32::MIN_POSITIVE));
                let obliquity = 0.5 * cos + ROUNDED[0];
                let strength = (k / std::f32::consts::TAU * obliquity * area / (r * s)).min(2.0 / (r + s));
                keep[lane] = up * down > -ROUNDED[0] && strength >= least && 0.5 * (r + s) - edges < reach;
            }
            let kept = (0..).zip(&keep[..lanes.len()]).filter(|(_, keep)| **keep);
            found.extend(kept.map(|(lane, _): (u32, _)| first as u32 + lane));
        }
    }
}

/// Whether a matrix changes no angle.
pub(super) fn keeps_angles(matrix: &DMat3) -> bool {
    /// Relative to its square.
    const NEAR: f64 = 1e-4;
    let DMat3 { x_axis, y_axis, z_axis } = *matrix;
    let square = x_axis.length_squared();
    let off = [x_axis.dot(y_axis), y_axis.dot(z_axis), z_axis.dot(x_axis)];
    let more = [y_axis.length_squared() - square, z_axis.length_squared() - square];
    off.into_iter().chain(more).all(|it| it.abs() <= NEAR * square)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DQuat;

    /// What is left out is weaker than `least` by the exact bound, and what is far above it is found.
    #[test]
    fn bounds_are_those_of_the_facets() {
        let mut state = 7_u64;
        let mut random = |low: f64, high: f64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            low + (high - low) * (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        let mut place = |size: f64| DVec3::new(random(-size, size), random(-size, size), random(-size, size));
        let mut positions: Vec<[f32; 3]> = Vec::new();
        for _ in 0..400 {
            let middle = place(4.0);
            positions.extend([0.3; 3].map(|size| (middle + place(size)).as_vec3().to_array()));
        }
        let triangles: Vec<[u32; 3]> = (0..400).map(|it| [3 * it, 3 * it + 1, 3 * it + 2]).collect();
        let mut part = Part::default();
        (part.positions, part.triangles) = (positions.into(), triangles.into());
        let bounds = FacetBounds::new(&part);
        let turn = DQuat::from_euler(glam::EulerRot::XYZ, 0.4, -1.1, 2.0);
        let to_world = DAffine3::from_scale_rotation_translation(DVec3::splat(1.7), turn, DVec3::new(3.0, 20.0, -4.0));
        assert!(keeps_angles(&to_world.matrix3) && !keeps_angles(&DMat3::from_diagonal(DVec3::new(1.0, 1.0, 1.01))));
        let (near, far) = (DVec3::new(1.0, 2.0, 0.5), DVec3::new(-30.0, 10.0, 2.0));
        for (source, observer) in [(near, near), (far, far), (near, far)] {
            let ends = Ends { source, observer };
            let bound = |triangle: u32| {
                let corner = |corner: u32| DVec3::from(part.positions[corner as usize].map(f64::from));
                let corners = part.triangles[triangle as usize].map(|it| to_world.transform_point3(corner(it)));
                let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
                let sides =
                    [source, observer].map(|end| normal.dot(end - (corners[0] + corners[1] + corners[2]) / 3.0));
                if sides[0] * sides[1] > 0.0 { ends.bound(corners, 1600.0) } else { 0.0 }
            };
            for least in [1e-4, 1e-3, 1e-2] {
                let mut found = Vec::new();
                bounds.strong(&to_world, &ends, 1600.0, (least, 1e3), &mut found);
                for triangle in 0..400 {
                    let (bound, found) = (bound(triangle), found.contains(&triangle));
                    assert!(found || bound < least, "{triangle}: {bound} of {least}");
                    assert!(!found || bound > 0.5 * least || bound == 0.0, "{triangle}: {bound} of {least}");
                }
            }
        }
    }
}
