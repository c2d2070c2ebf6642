//! The planes of meshes: facets that lie in one mirror waves as a whole.

use crate::scene::Part;
use glam::DVec3;
use std::collections::HashMap;

/// The largest planes of a part, in the mesh's frame.
#[derive(Clone, Debug, Default)]
pub struct PartPlanes {
    /// For each triangle its plane, or [`PartPlanes::NONE`].
    of_triangle: Vec<u8>,
    /// For each triangle a bit for each edge, from its first, second and third corner on, that another one of its plane
    /// continues.
    inner: Vec<u8>,
    planes: Vec<MeshPlane>,
}

/// Coplanar triangles.
#[derive(Clone, Copy, Debug)]
pub struct MeshPlane {
    /// Unit normal of the first triangle.
    pub normal: DVec3,
    /// A point of the plane: the middle of its largest triangle.
    pub point: DVec3,
    /// Total area of its triangles.
    pub area: f64,
    /// Greatest distance of a corner from the point.
    pub radius: f64,
    /// The largest triangle.
    pub largest: u32,
}

/// Steps in which normals and places of planes count as the same. They are offset by a fraction that round numbers do not
/// have, so that rounding does not part triangles of one plane.
const STEP: f64 = 1e-4;
const OFFSET: f64 = 0.3137;

impl PartPlanes {
    /// The number of a triangle that is part of no large plane.
    const NONE: u8 = u8::MAX;

    /// The planes of a part.
    pub(in crate::trace) fn new(part: &Part) -> PartPlanes {
        let size = part.positions.iter().flatten().fold(0.0_f32, |most, value| most.max(value.abs()));
        let step = STEP * f64::from(size).max(1e-9);
        let round = |value: f64, step: f64| (value / step + OFFSET).floor() as i64;
        let mut known: HashMap<[i64; 4], u32> = HashMap::new();
        let mut planes: Vec<(MeshPlane, f64)> = Vec::new();
        let number = |(index, corners): (usize, &[u32; 3])| {
            let [a, b, c] = corners.map(|corner| DVec3::from_array(part.positions[corner as usize].map(f64::from)));
            let across = (b - a).cross(c - a);
            let Some(normal) = across.try_normalize() else { return u32::MAX };
            let (area, middle) = (0.5 * across.length(), (a + b + c) / 3.0);
            let [x, y, z] = normal.to_array().map(|value| round(value, STEP));
            let key = [x, y, z, round(normal.dot(middle), step)];
            let number = *known.entry(key).or_insert(planes.len() as u32);
            if number as usize == planes.len() {
                planes.push((MeshPlane { normal, point: middle, area: 0.0, radius: 0.0, largest: index as u32 }, 0.0));
            }
            let (plane, largest) = &mut planes[number as usize];
            plane.area += area;
            if area > *largest {
                (plane.point, plane.largest, *largest) = (middle, index as u32, area);
            }
            number
        };
        let numbers: Vec<u32> = part.triangles.iter().enumerate().map(number).collect();
        let inner = inner_edges(&part.triangles, &numbers);
        for (corners, &number) in part.triangles.iter().zip(&numbers) {
            let Some((plane, _)) = planes.get_mut(number as usize) else { continue };
            for corner in corners {
                let place = DVec3::from_array(part.positions[*corner as usize].map(f64::from));
                plane.radius = plane.radius.max((place - plane.point).length());
            }
        }
        let mut order: Vec<u32> = (0..planes.len() as u32).collect();
        let area = |number: u32| planes[number as usize].0.area;
        order.sort_by(|&a, &b| area(b).total_cmp(&area(a)).then(a.cmp(&b)));
        order.truncate(usize::from(PartPlanes::NONE));
        let mut place = vec![PartPlanes::NONE; planes.len()];
        order.iter().enumerate().for_each(|(at, &number)| place[number as usize] = at as u8);
        let at = |&number: &u32| place.get(number as usize).copied().unwrap_or(PartPlanes::NONE);
        let of_triangle = numbers.iter().map(at).collect();
        PartPlanes { of_triangle, inner, planes: order.iter().map(|&number| planes[number as usize].0).collect() }
    }

    /// All of them, the largest first.
    pub fn all(&self) -> &[MeshPlane] {
        &self.planes
    }

    /// Which edges of a triangle, from its first, second and third corner on, are between triangles of one plane.
    pub fn inner(&self, triangle: u32) -> [bool; 3] {
        let bits = self.inner.get(triangle as usize).copied().unwrap_or_default();
        [0, 1, 2].map(|edge| bits >> edge & 1 != 0)
    }

    /// The number of the plane of a triangle, if it is a large one.
    pub fn of(&self, triangle: u32) -> Option<usize> {
        let number = *self.of_triangle.get(triangle as usize)?;
        (number != PartPlanes::NONE).then_some(usize::from(number))
    }
}

/// For each triangle the bits of [`PartPlanes::inner`]: edges that two triangles of the same plane share, which pass it in
/// opposite directions.
fn inner_edges(triangles: &[[u32; 3]], planes: &[u32]) -> Vec<u8> {
    let edges = |[a, b, c]: [u32; 3]| [(a, b), (b, c), (c, a)];
    // By plane and ends: triangle, which edge of it, and how many have it.
    let mut known: HashMap<[u32; 3], [usize; 3]> = HashMap::new();
    for (index, (&corners, &plane)) in triangles.iter().zip(planes).enumerate() {
        for (edge, (from, to)) in edges(corners).into_iter().enumerate() {
            known.entry([plane, from, to]).and_modify(|known| known[2] += 1).or_insert([index, edge, 1]);
        }
    }
    let mut inner = vec![0; triangles.len()];
    for (&[plane, from, to], &[index, edge, count]) in &known {
        let back = known.get(&[plane, to, from]);
        if plane != u32::MAX && count == 1 && back.is_some_and(|back| back[2] == 1) {
            inner[index] |= 1 << edge;
        }
    }
    inner
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square of two triangles, a third beside it that is tilted, and one that meets two others at one edge.
    #[test]
    fn diagonals_are_inner_edges() {
        let triangles = [[0, 1, 2], [0, 2, 3], [1, 4, 2]];
        assert_eq!(inner_edges(&triangles, &[0, 0, 1]), [0b100, 0b001, 0]);
        assert_eq!(inner_edges(&triangles, &[0, 0, 0]), [0b110, 0b001, 0b100]);
        assert_eq!(inner_edges(&[[0, 1, 2], [0, 2, 3], [0, 2, 4]], &[0; 3]), [0; 3]);
        assert_eq!(inner_edges(&triangles, &[u32::MAX; 3]), [0; 3]);
    }
}
