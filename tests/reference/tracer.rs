//! The oracle: every triangle against every ray, one by one, in f64.
//!
//! It looks along the ray: projected on the plane across the ray, a triangle is hit when the ray's own point (0, 0)
//! lies inside it. The same projection says how near the ray passes the edges, so the oracle knows itself which answers
//! single precision may turn over.

use echocast::Scene;
use echocast::scene::Material;
use glam::{DMat3, DVec2, DVec3};

/// Rounding that single precision may add up to, relative to the coordinates that enter: 16 half steps of f32.
const ROUNDING: f64 = 1e-6;

struct Triangle {
    corners: [DVec3; 3],
    /// Shading normals of the corners, of any length.
    normals: Option<[DVec3; 3]>,
    object: usize,
    part: usize,
    /// Number in its part.
    index: usize,
    longest_edge: f64,
    /// Unit normal.
    normal: DVec3,
    /// Least altitude.
    altitude: f64,
}

/// A ray meets a triangle.
#[derive(Clone, Copy, Debug)]
pub struct Hit {
    triangle: usize,
    /// Slant range, m.
    pub range: f64,
    /// What the range may be off in single precision, m.
    pub range_tolerance: f64,
    /// Barycentric weights of the corners.
    pub weights: [f64; 3],
    /// What the weights may be off in single precision.
    pub weight_tolerance: f64,
}

/// What a ray meets.
#[derive(Clone, Debug, Default)]
pub struct Answer {
    /// The nearest triangle that it surely hits.
    pub nearest: Option<Hit>,
    /// What may come before it in single precision: triangles whose edges it passes closely, and such that lie within
    /// the tolerance of the nearest.
    pub doubtful: Vec<Hit>,
}

impl Answer {
    /// Whether single precision leaves no choice.
    pub fn is_sure(&self) -> bool {
        self.doubtful.is_empty()
    }

    /// Everything that single precision may answer, but a miss.
    pub fn candidates(&self) -> impl Iterator<Item = &Hit> {
        self.nearest.iter().chain(&self.doubtful)
    }
}

/// The surface at a hit.
pub struct Surface<'a> {
    /// Number of the semantic class.
    pub category_id: u32,
    /// Number of the part.
    pub part_id: u32,
    /// Number of the object.
    pub instance_id: u32,
    /// What it is made of; none: nothing is said.
    pub material: Option<&'a Material>,
    /// Unit normal of the triangle, either side.
    pub geometric_normal: DVec3,
    /// Interpolated unit normal, that of the triangle on flat parts, either side.
    pub normal: DVec3,
    /// What `normal` may be off in single precision.
    pub normal_tolerance: f64,
}

/// All triangles of a scene in the world.
pub struct Tracer<'a> {
    scene: &'a Scene,
    triangles: Vec<Triangle>,
    /// Origin of the single-precision coordinates.
    local_origin: DVec3,
    /// Greatest coordinate relative to it.
    size: f64,
    /// How far corners may be from where they are here, m.
    slack: f64,
}

impl<'a> Tracer<'a> {
    /// `local_origin`: what single-precision coordinates are relative to, world.
    pub fn new(scene: &'a Scene, local_origin: DVec3) -> Self {
        let mut triangles = Vec::new();
        let mut size: f64 = 0.0;
        for (object_index, object) in scene.objects.iter().enumerate() {
            let m = object.world_from_object;
            // Inverse transpose: right for every map that has an inverse.
            let normals_to_world: DMat3 = m.matrix3.inverse().transpose();
            for (part_index, part) in object.mesh.parts.iter().enumerate() {
                let vector = |p: [f32; 3]| DVec3::from_array(p.map(f64::from));
                for (index, corners) in part.triangles.iter().enumerate() {
                    let local = corners.map(|vertex| vector(part.positions[vertex as usize]));
                    let corners_in_world = local.map(|p| m.transform_point3(p));
                    let [a, b, c] = corners_in_world;
                    let longest_edge = (b - a).length().max((c - b).length()).max((a - c).length());
                    let cross = (b - a).cross(c - a);
                    for (p, q) in corners_in_world.iter().zip(local) {
                        size = size.max((*p - local_origin).abs().max_element()).max(q.abs().max_element());
                    }
                    triangles.push(Triangle {
                        corners: corners_in_world,
                        normals: part
                            .normals
                            .as_ref()
                            .map(|normals| corners.map(|vertex| normals_to_world * vector(normals[vertex as usize]))),
                        object: object_index,
                        part: part_index,
                        index,
                        longest_edge,
                        normal: cross.normalize(),
                        altitude: cross.length() / longest_edge,
                    });
                }
            }
        }
        Tracer { scene, triangles, local_origin, size, slack: 0.0 }
    }

    /// The same where single precision is not all: corners may be `slack` m off.
    #[must_use]
    pub fn within(self, slack: f64) -> Self {
        Tracer { slack, ..self }
    }

    /// Number of triangles.
    pub fn len(&self) -> usize {
        self.triangles.len()
    }

    /// Whether there are no triangles.
    pub fn is_empty(&self) -> bool {
        self.triangles.is_empty()
    }

    /// Centre of triangle `index`.
    pub fn centre(&self, index: usize) -> DVec3 {
        self.triangles[index].corners.iter().sum::<DVec3>() / 3.0
    }

    /// A point on triangle `index`, the corners weighted by `weights`.
    pub fn point(&self, index: usize, weights: [f64; 3]) -> DVec3 {
        self.triangles[index].corners.iter().zip(weights).map(|(corner, weight)| *corner * weight).sum()
    }

    /// Traces the ray from `origin` along the unit vector `direction`, up to `range_max`.
    pub fn trace(&self, origin: DVec3, direction: DVec3, range_max: f64) -> Answer {
        self.trace_past(origin, direction, range_max, &|_| false)
    }

    /// [`Tracer::trace`] through the triangles that `passes` lets pass, by object, part and number in the part.
    pub fn trace_past(
        &self,
        origin: DVec3,
        direction: DVec3,
        range_max: f64,
        passes: &dyn Fn([usize; 3]) -> bool,
    ) -> Answer {
        let (across_u, across_v) = direction.any_orthonormal_pair();
        let size = self.size + (origin - self.local_origin).abs().max_element();
        let mut sure = Vec::new();
        let mut doubtful = Vec::new();
        for (number, triangle) in self.triangles.iter().enumerate() {
            if passes([triangle.object, triangle.part, triangle.index]) {
                continue;
            }
            let relative = triangle.corners.map(|corner| corner - origin);
            let [a, b, c] = relative.map(|p| DVec2::new(p.dot(across_u), p.dot(across_v)));
            // Twice the areas that the ray's point spans with the edges, and of the whole, positive inside.
            let mut areas = [b.perp_dot(c), c.perp_dot(a), a.perp_dot(b)];
            let mut whole: f64 = areas.iter().sum();
            if whole < 0.0 {
                areas = areas.map(|area| -area);
                whole = -whole;
            }
            let along = relative.map(|p| p.dot(direction));
            let reach = along.iter().fold(0.0f64, |reach, t| reach.max(t.abs()));
            let slack = self.slack + ROUNDING * (size + reach);
            let area_slack = slack * triangle.longest_edge;
            let inmost = areas[0].min(areas[1]).min(areas[2]);
            if inmost < -area_slack || along.iter().all(|t| *t < -slack) {
                continue;
            }
            let cos = whole / (triangle.longest_edge * triangle.altitude);
            let mut hit = Hit {
                triangle: number,
                range: f64::NAN,
                range_tolerance: (slack + ROUNDING * triangle.longest_edge.powi(2) / triangle.altitude) / cos,
                weights: areas.map(|area| area / whole),
                weight_tolerance: area_slack / whole,
            };
            hit.range = hit.weights.iter().zip(along).map(|(weight, t)| weight * t).sum();
            if inmost <= area_slack {
                // The weights may be anything there; the range is somewhere along the triangle.
                let (near, far) = along.iter().fold((f64::MAX, f64::MIN), |(n, f), t| (n.min(*t), f.max(*t)));
                if !(near..=far).contains(&hit.range) {
                    hit.range = hit.range.clamp(near, far);
                    hit.range_tolerance += far - near;
                }
                doubtful.push(hit);
            } else if hit.range > hit.range_tolerance && hit.range < range_max - hit.range_tolerance {
                sure.push(hit);
            } else if hit.range > -hit.range_tolerance && hit.range < range_max + hit.range_tolerance {
                doubtful.push(hit);
            }
        }
        let nearest = sure.iter().copied().min_by(|a, b| a.range.total_cmp(&b.range));
        let limit = nearest.map_or(range_max, |hit| hit.range + hit.range_tolerance);
        let is_nearest = |hit: &Hit| nearest.is_some_and(|nearest| nearest.triangle == hit.triangle);
        doubtful.extend(sure.iter().copied().filter(|hit| !is_nearest(hit)));
        doubtful.retain(|hit| hit.range - hit.range_tolerance <= limit && hit.range + hit.range_tolerance >= 0.0);
        Answer { nearest, doubtful }
    }

    /// The surface at `hit`.
    pub fn surface(&self, hit: &Hit) -> Surface<'a> {
        let triangle = &self.triangles[hit.triangle];
        let object = &self.scene.objects[triangle.object];
        let part = &object.mesh.parts[triangle.part];
        let off = 2.0 * self.slack + ROUNDING * (self.size + triangle.longest_edge);
        let flat_tolerance = off / triangle.altitude;
        let (normal, normal_tolerance) = match triangle.normals {
            None => (triangle.normal, flat_tolerance),
            Some(normals) => {
                let sum: DVec3 = normals.iter().zip(hit.weights).map(|(normal, weight)| *normal * weight).sum();
                let longest = normals.iter().fold(0.0f64, |longest, normal| longest.max(normal.length()));
                let spread = normals.iter().fold(0.0f64, |spread, normal| spread.max((*normal - sum).length()));
                let wrong = 2.0 * spread * hit.weight_tolerance + 10.0 * ROUNDING * longest;
                (sum.normalize(), wrong / sum.length())
            }
        };
        Surface {
            category_id: object.category_id,
            part_id: object.part_ids[triangle.part],
            instance_id: object.instance_id,
            material: part.material.as_deref(),
            geometric_normal: triangle.normal,
            normal,
            normal_tolerance,
        }
    }

    /// Where the spot of `hit`, of a tracer with the same triangles, is in this one.
    pub fn place(&self, hit: &Hit) -> DVec3 {
        self.point(hit.triangle, hit.weights)
    }

    /// Object, part and number of the triangle in the part.
    pub fn address(&self, hit: &Hit) -> [usize; 3] {
        let triangle = &self.triangles[hit.triangle];
        [triangle.object, triangle.part, triangle.index]
    }
}
