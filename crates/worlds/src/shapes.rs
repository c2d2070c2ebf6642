//! Closed shapes: balls, rocks and prisms.

use super::noise::Dice;
use glam::DVec3;
use std::collections::HashMap;

/// Triangles that share vertices, seen counter-clockwise from outside.
#[derive(Default)]
pub(super) struct ClosedShape {
    pub vertices: Vec<DVec3>,
    pub triangles: Vec<[u32; 3]>,
}

impl ClosedShape {
    /// A ball of radius 1 about the origin: an icosahedron whose triangles are divided in four `divisions` times.
    pub fn ball(divisions: u32) -> Self {
        let mut ball = ClosedShape::icosahedron();
        for _ in 0..divisions {
            ball.divide();
        }
        ball
    }

    fn icosahedron() -> Self {
        // The corners of three golden rectangles, each in a plane of two axes; edges are 2 long.
        let golden = f64::midpoint(1.0, 5f64.sqrt());
        let mut corners = Vec::new();
        for short in [-1.0, 1.0] {
            for long in [-golden, golden] {
                corners.extend([[short, long, 0.0], [0.0, short, long], [long, 0.0, short]].map(DVec3::from_array));
            }
        }
        let touch = |a: usize, b: usize| corners[a].distance(corners[b]) < 2.1;
        let mut triangles = Vec::new();
        for a in 0..corners.len() {
            for b in (a + 1..corners.len()).filter(|&b| touch(a, b)) {
                for c in (b + 1..corners.len()).filter(|&c| touch(a, c) && touch(b, c)) {
                    let outward = corners[a].cross(corners[b]).dot(corners[c]) > 0.0;
                    triangles.push(if outward { [a, b, c] } else { [a, c, b] }.map(|corner| corner as u32));
                }
            }
        }
        ClosedShape { vertices: corners.into_iter().map(DVec3::normalize).collect(), triangles }
    }

    /// Divides each triangle in four, the new corners on the ball of radius 1.
    fn divide(&mut self) {
        let mut middles = HashMap::new();
        let vertices = &mut self.vertices;
        let mut middle = |a: u32, b: u32| {
            *middles.entry([a.min(b), a.max(b)]).or_insert_with(|| {
                vertices.push((vertices[a as usize] + vertices[b as usize]).normalize());
                vertices.len() as u32 - 1
            })
        };
        self.triangles = self
            .triangles
            .iter()
            .flat_map(|&[a, b, c]| {
                let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
                [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
            })
            .collect();
    }

    /// An irregular rock that just fits into the ball of radius 1: a ball with flat facets cut off and a rough surface.
    pub fn rock(dice: &mut Dice) -> Self {
        /// Number of facets, and their least distance from the centre.
        const CUTS: usize = 14;
        const DEEPEST: f64 = 0.6;
        /// Depth of the roughness over the radius.
        const ROUGHNESS: f64 = 0.03;
        let mut rock = ClosedShape::ball(2);
        let cuts: Vec<(DVec3, f64)> = (0..CUTS).map(|_| (direction(dice), dice.between(DEEPEST, 0.95))).collect();
        for vertex in &mut rock.vertices {
            // The nearest cut in this direction, or the ball.
            let reach = |(normal, distance): &(DVec3, f64)| {
                let cosine = normal.dot(*vertex);
                if cosine > *distance { distance / cosine } else { 1.0 }
            };
            let radius = cuts.iter().map(reach).fold(1.0, f64::min);
            *vertex *= radius * (1.0 - dice.between(0.0, ROUGHNESS));
        }
        let largest = rock.vertices.iter().map(|vertex| vertex.length()).fold(0.0, f64::max);
        rock.vertices.iter_mut().for_each(|vertex| *vertex /= largest);
        rock
    }

    /// Adds a prism: `bottom` and `top` are convex outlines with equally many corners, counter-clockwise from above.
    pub fn add_prism<const N: usize>(&mut self, bottom: [DVec3; N], top: [DVec3; N]) {
        let first = self.vertices.len() as u32;
        self.vertices.extend(bottom);
        self.vertices.extend(top);
        let low = |corner: u32| first + corner % N as u32;
        let high = |corner: u32| low(corner) + N as u32;
        for corner in 0..N as u32 {
            let next = corner + 1;
            self.triangles.push([low(corner), low(next), high(next)]);
            self.triangles.push([low(corner), high(next), high(corner)]);
        }
        for corner in 1..N as u32 - 1 {
            self.triangles.push([low(0), low(corner + 1), low(corner)]);
            self.triangles.push([high(0), high(corner), high(corner + 1)]);
        }
    }

    /// Adds a box, given by its lowest and highest corner.
    pub fn add_box(&mut self, low: DVec3, high: DVec3) {
        let outline =
            |z| [[low.x, low.y], [high.x, low.y], [high.x, high.y], [low.x, high.y]].map(|[x, y]| DVec3::new(x, y, z));
        self.add_prism(outline(low.z), outline(high.z));
    }

    /// The vertices in single precision.
    pub fn positions(&self) -> Vec<[f32; 3]> {
        self.vertices.iter().map(|vertex| vertex.as_vec3().to_array()).collect()
    }
}

/// A random direction, uniform (Archimedes: heights on a sphere are uniform).
pub(super) fn direction(dice: &mut Dice) -> DVec3 {
    let z = dice.between(-1.0, 1.0);
    let (sin, cos) = dice.between(0.0, std::f64::consts::TAU).sin_cos();
    let radius = (1.0 - z * z).sqrt();
    DVec3::new(radius * cos, radius * sin, z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use ground::rng::Draw;
    use std::f64::consts::PI;

    /// Checks that every edge has one triangle on each side, and returns the volume inside.
    fn volume_inside(shape: &ClosedShape) -> f64 {
        let mut edges = HashMap::new();
        for &[a, b, c] in &shape.triangles {
            for edge in [[a, b], [b, c], [c, a]] {
                *edges.entry(edge).or_insert(0) += 1;
            }
        }
        for ([a, b], count) in &edges {
            assert_eq!((*count, edges.get(&[*b, *a])), (1, Some(&1)), "edge {a} {b}");
        }
        let corner = |index: u32| shape.vertices[index as usize];
        shape.triangles.iter().map(|&[a, b, c]| corner(a).cross(corner(b)).dot(corner(c)) / 6.0).sum()
    }

    #[test]
    fn shapes_are_closed_and_face_outwards() {
        for (divisions, triangles) in [(0, 20), (1, 80), (2, 320), (3, 1280)] {
            let ball = ClosedShape::ball(divisions);
            assert_eq!((ball.triangles.len(), ball.vertices.len()), (triangles, triangles / 2 + 2));
            let part = volume_inside(&ball) / (4.0 / 3.0 * PI);
            assert!((0.6..1.0).contains(&part), "{divisions}: {part}");
        }
        let mut shape = ClosedShape::default();
        shape.add_box(DVec3::new(1.0, 2.0, 3.0), DVec3::new(2.0, 4.0, 6.0));
        assert!((volume_inside(&shape) - 6.0).abs() < 1e-12);
    }

    #[test]
    fn rocks_are_irregular_and_fit() {
        for item in 0..20 {
            let rock = ClosedShape::rock(&mut Dice::new(5, Draw::Boulder, item));
            let radii: Vec<f64> = rock.vertices.iter().map(|vertex| vertex.length()).collect();
            assert!(radii.iter().all(|radius| (0.5..=1.0 + 1e-12).contains(radius)));
            assert!(radii.iter().any(|radius| *radius < 0.9));
            assert!(volume_inside(&rock) > 1.0);
        }
    }
}
