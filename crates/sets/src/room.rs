//! Tests for room: boxes of what is placed, against the boxes and the triangles of what is there.

use crate::lock;
use engine::scene::Mesh;
use glam::{DAffine3, DMat3, DVec3, Vec3};
use std::collections::HashMap;
use std::sync::{Arc, Mutex};

/// A box in the world, in any orientation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Solid {
    pub centre: DVec3,
    /// Its axes, unit vectors in the world.
    pub axes: DMat3,
    /// From its centre to its faces, m.
    pub half: DVec3,
}

impl Solid {
    /// The smallest box with these axes around `points`; `None` without points.
    pub fn around(axes: DMat3, points: impl Iterator<Item = DVec3>) -> Option<Solid> {
        let own = axes.transpose();
        let (low, high) =
            points.map(|point| own * point).map(|p| (p, p)).reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))?;
        Some(Solid { centre: axes * (0.5 * (low + high)), axes, half: 0.5 * (high - low) })
    }

    /// A box with the axes of the world.
    #[cfg(test)]
    fn upright(low: DVec3, high: DVec3) -> Solid {
        Solid { centre: 0.5 * (low + high), axes: DMat3::IDENTITY, half: 0.5 * (high - low) }
    }

    pub fn corners(&self) -> [DVec3; 8] {
        std::array::from_fn(|k| {
            let side = |axis: usize| if k >> axis & 1 == 0 { -1.0 } else { 1.0 };
            self.centre + self.axes * (DVec3::new(side(0), side(1), side(2)) * self.half)
        })
    }

    /// The smallest box, with its axes rotated accordingly, around this one after `moved`, which may scale it.
    pub fn moved(&self, moved: &DAffine3) -> Solid {
        let axis = |k: usize| (moved.matrix3 * self.axes.col(k)).normalize_or(DVec3::AXES[k]);
        let x = axis(0);
        let z = x.cross(axis(1)).normalize_or(DVec3::Z);
        let axes = DMat3::from_cols(x, z.cross(x), z);
        let corners = self.corners().into_iter().map(|corner| moved.transform_point3(corner));
        Solid::around(axes, corners).unwrap_or(*self)
    }

    /// The point below its centre at the height of its lowest corner.
    pub fn foot(&self) -> DVec3 {
        let corners = self.corners();
        self.centre.with_z(corners.iter().map(|corner| corner.z).fold(f64::INFINITY, f64::min))
    }

    pub fn top(&self) -> f64 {
        self.corners().iter().map(|corner| corner.z).fold(f64::NEG_INFINITY, f64::max)
    }

    /// This box, larger by `by` m on all sides except below, where it is smaller by `lifted` m.
    pub fn widened(&self, by: f64, lifted: f64) -> Solid {
        let lifted = lifted.min(1.9 * self.half.z + by);
        Solid {
            centre: self.centre + self.axes.z_axis * (0.5 * (by + lifted)),
            half: self.half + DVec3::new(by, by, 0.5 * (by - lifted)),
            ..*self
        }
    }

    fn radius(&self) -> f64 {
        self.half.length()
    }

    /// Whether it and `other` have more than a point in common, by the separating axis test (Gottschalk, Lin and
    /// Manocha 1996, OBBTree).
    pub fn meets(&self, other: &Solid) -> bool {
        let between = other.centre - self.centre;
        if between.length() >= self.radius() + other.radius() {
            return false;
        }
        let reach = |solid: &Solid, along: DVec3| {
            (0..3).map(|k| (solid.axes.col(k).dot(along) * solid.half[k]).abs()).sum::<f64>()
        };
        let apart = |along: DVec3| {
            // Parallel edges give no axis.
            along.length_squared() > 1e-12 && between.dot(along).abs() >= reach(self, along) + reach(other, along)
        };
        let faces = (0..3).any(|k| apart(self.axes.col(k)) || apart(other.axes.col(k)));
        !faces && !(0..9).any(|k| apart(self.axes.col(k / 3).cross(other.axes.col(k % 3))))
    }

    /// From the world to the frame in which it is centred at the origin, along the axes.
    fn own_from_world(&self) -> DAffine3 {
        let turned = self.axes.transpose();
        DAffine3 { matrix3: turned, translation: -(turned * self.centre) }
    }
}

/// Bounding volume hierarchy of the triangles of a mesh.
#[derive(Debug)]
pub(super) struct TriangleTree {
    nodes: Vec<TriangleNode>,
    triangles: Vec<[Vec3; 3]>,
}

#[derive(Clone, Copy, Debug)]
struct TriangleNode {
    low: Vec3,
    high: Vec3,
    /// First of a leaf's triangles; of an inner node, the index of its second child: its first child is the next node.
    first: u32,
    /// Number of triangles; 0 for an inner node.
    count: u32,
}

/// Maximum number of triangles of a leaf.
const LEAF: usize = 4;

impl TriangleTree {
    fn new(mesh: &Mesh) -> TriangleTree {
        let triangles = mesh.parts.iter().flat_map(|part| {
            part.triangles.iter().map(|triangle| triangle.map(|corner| Vec3::from(part.positions[corner as usize])))
        });
        let mut tree = TriangleTree { nodes: Vec::new(), triangles: triangles.collect() };
        let count = tree.triangles.len();
        if count > 0 {
            tree.divide(0, count);
        }
        tree
    }

    /// Adds the node of the triangles from `first` to `end`, and its children.
    fn divide(&mut self, first: usize, end: usize) {
        let own = &mut self.triangles[first..end];
        let corners = || own.iter().flatten();
        let (low, high) =
            (corners().fold(Vec3::INFINITY, |a, b| a.min(*b)), corners().fold(Vec3::NEG_INFINITY, |a, b| a.max(*b)));
        let node = self.nodes.len();
        self.nodes.push(TriangleNode { low, high, first: first as u32, count: (end - first) as u32 });
        if end - first <= LEAF {
            return;
        }
        let size = high - low;
        let axis = if size.x >= size.y.max(size.z) {
            0
        } else if size.y >= size.z {
            1
        } else {
            2
        };
        let middle = own.len() / 2;
        own.select_nth_unstable_by(middle, |a, b| {
            let centre = |t: &[Vec3; 3]| t[0][axis] + t[1][axis] + t[2][axis];
            centre(a).total_cmp(&centre(b))
        });
        self.divide(first, first + middle);
        let second = self.nodes.len() as u32;
        self.divide(first + middle, end);
        (self.nodes[node].first, self.nodes[node].count) = (second, 0);
    }

    /// Passes the triangles of all nodes that `enters` accepts to `found`, until it returns true.
    fn walk(&self, mut enters: impl FnMut(&TriangleNode) -> bool, mut found: impl FnMut(&[Vec3; 3]) -> bool) -> bool {
        let mut open = Vec::new();
        open.extend((!self.nodes.is_empty()).then_some(0));
        while let Some(index) = open.pop() {
            let node = &self.nodes[index as usize];
            if !enters(node) {
                continue;
            }
            if node.count == 0 {
                open.extend([index + 1, node.first]);
            } else if self.triangles[node.first as usize..][..node.count as usize].iter().any(&mut found) {
                return true;
            }
        }
        false
    }

    /// Whether any triangle, placed by `world_from_object`, reaches into `solid`.
    fn meets(&self, world_from_object: &DAffine3, solid: &Solid) -> bool {
        let own_from_object = solid.own_from_world() * *world_from_object;
        let half = solid.half;
        let enters = |node: &TriangleNode| {
            let centre = own_from_object.transform_point3((0.5 * (node.low + node.high)).as_dvec3());
            let size = (0.5 * (node.high - node.low)).as_dvec3();
            let m = &own_from_object.matrix3;
            let reach = m.x_axis.abs() * size.x + m.y_axis.abs() * size.y + m.z_axis.abs() * size.z;
            centre.abs().cmple(reach + half).all()
        };
        let inside = |triangle: &[Vec3; 3]| {
            reaches_into(half, triangle.map(|corner| own_from_object.transform_point3(corner.as_dvec3())))
        };
        self.walk(enters, inside)
    }

    /// Height of the highest point below `from`, with the upward unit normal there.
    fn below(&self, world_from_object: &DAffine3, from: DVec3) -> Option<(f64, DVec3)> {
        let object_from_world = world_from_object.inverse();
        let start = object_from_world.transform_point3(from).as_vec3();
        let ahead = (object_from_world.matrix3 * DVec3::NEG_Z).as_vec3();
        let mut nearest: Option<(f64, DVec3)> = None;
        let enters = |node: &TriangleNode| {
            let (mut enter, mut leave) = (0.0_f32, f32::INFINITY);
            for axis in 0..3 {
                let [a, b] =
                    [node.low[axis] - 1e-4, node.high[axis] + 1e-4].map(|end| (end - start[axis]) / ahead[axis]);
                if ahead[axis] == 0.0 {
                    if !(node.low[axis] - 1e-4..=node.high[axis] + 1e-4).contains(&start[axis]) {
                        return false;
                    }
                    continue;
                }
                (enter, leave) = (enter.max(a.min(b)), leave.min(a.max(b)));
            }
            enter <= leave
        };
        self.walk(enters, |triangle| {
            let [a, b, c] = triangle.map(|corner| world_from_object.transform_point3(corner.as_dvec3()));
            if let Some((z, normal)) = height(a, b, c, from)
                && z <= from.z
                && nearest.is_none_or(|(highest, _)| z > highest)
            {
                nearest = Some((z, normal));
            }
            false
        });
        nearest
    }
}

/// Height of a triangle at the horizontal position of `from`, and its upward unit normal.
fn height(a: DVec3, b: DVec3, c: DVec3, from: DVec3) -> Option<(f64, DVec3)> {
    let normal = (b - a).cross(c - a);
    let normal = if normal.z < 0.0 { -normal } else { normal };
    let across = |p: DVec3, q: DVec3| (q - p).truncate().perp_dot((from - p).truncate());
    let (u, v, w) = (across(a, b), across(b, c), across(c, a));
    let inside = (u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0);
    if !inside || normal.z <= 1e-9 * normal.length() {
        return None;
    }
    let flat = from.with_z(0.0) - a.with_z(0.0);
    Some((a.z - (normal.x * flat.x + normal.y * flat.y) / normal.z, normal.normalize()))
}

/// Whether a triangle has more than a point in common with the box from `-half` to `half`, by the separating axis test
/// (Akenine-Möller 2001, Fast 3D triangle-box overlap testing).
fn reaches_into(half: DVec3, [a, b, c]: [DVec3; 3]) -> bool {
    let apart = |along: DVec3| {
        if along.length_squared() < 1e-18 {
            return false;
        }
        let [p, q, r] = [a, b, c].map(|corner| corner.dot(along));
        let reach = half.dot(along.abs());
        p.min(q).min(r) >= reach || p.max(q).max(r) <= -reach
    };
    let edges = [b - a, c - b, a - c];
    let faces = DVec3::AXES.into_iter().any(apart) || apart(edges[0].cross(edges[1]));
    !faces && !edges.into_iter().any(|edge| DVec3::AXES.into_iter().any(|axis| apart(edge.cross(axis))))
}

/// Hierarchies of the meshes of a scene and its models, built when first needed.
#[derive(Debug, Default)]
pub(super) struct MeshTrees {
    /// By the address of the mesh.
    trees: Mutex<HashMap<usize, CachedTree>>,
}

/// A mesh, kept so that its address is not reused, and its tree.
type CachedTree = (Arc<Mesh>, Arc<TriangleTree>);

impl MeshTrees {
    pub(super) fn tree(&self, mesh: &Arc<Mesh>) -> Arc<TriangleTree> {
        let key = Arc::as_ptr(mesh) as usize;
        let known = || lock(&self.trees);
        if let Some((_, tree)) = known().get(&key) {
            return tree.clone();
        }
        // Built without holding the lock: other threads need other meshes meanwhile.
        let tree = Arc::new(TriangleTree::new(mesh));
        known().entry(key).or_insert((mesh.clone(), tree)).1.clone()
    }

    /// Drops meshes that nothing else uses any more.
    pub fn forget_unused(&self) {
        lock(&self.trees).retain(|_, (mesh, _)| Arc::strong_count(mesh) > 1);
    }

    /// Whether a mesh, placed by `world_from_object`, reaches into `solid`.
    pub fn meets(&self, mesh: &Arc<Mesh>, world_from_object: &DAffine3, solid: &Solid) -> bool {
        self.tree(mesh).meets(world_from_object, solid)
    }

    /// Height of the highest point of a mesh below `from`, with the normal there.
    pub fn below(&self, mesh: &Arc<Mesh>, world_from_object: &DAffine3, from: DVec3) -> Option<(f64, DVec3)> {
        self.tree(mesh).below(world_from_object, from)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use engine::scene::Part;
    use glam::DQuat;

    fn mesh(positions: Vec<[f32; 3]>, triangles: Vec<[u32; 3]>) -> Arc<Mesh> {
        let part = Part::default().positions(positions.into()).triangles(triangles.into());
        Arc::new(Mesh::new("", vec![part]).unwrap())
    }

    /// Pseudo-random numbers in [0, 1).
    fn numbers() -> impl FnMut() -> f64 {
        let mut state = 1_u64;
        move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        }
    }

    fn turned(next: &mut impl FnMut() -> f64) -> DMat3 {
        DMat3::from_quat(DQuat::from_xyzw(next() - 0.5, next() - 0.5, next() - 0.5, next() - 0.5).normalize())
    }

    /// Whether random sampling finds a point in both.
    fn both(a: &Solid, b: &Solid, next: &mut impl FnMut() -> f64) -> bool {
        (0..4000).any(|_| {
            let within = DVec3::new(next(), next(), next()) * 2.0 - 1.0;
            let point = a.centre + a.axes * (within * a.half);
            (b.axes.transpose() * (point - b.centre)).abs().cmplt(b.half).all()
        })
    }

    #[test]
    fn boxes_meet_where_they_share_points() {
        let mut next = numbers();
        let (mut met, mut clear) = (0, 0);
        for _ in 0..300 {
            let mut solid = |far: f64| Solid {
                centre: DVec3::new(next() - 0.5, next() - 0.5, next() - 0.5) * far,
                axes: turned(&mut next),
                half: DVec3::new(next(), next(), next()) + 0.1,
            };
            let (a, b) = (solid(0.0), solid(4.0));
            assert_eq!(a.meets(&b), b.meets(&a));
            if a.meets(&b) {
                met += 1;
            } else {
                clear += 1;
                assert!(!both(&a, &b, &mut next) && !both(&b, &a, &mut next));
            }
            // Boxes that share points do meet.
            if both(&a, &b, &mut next) {
                assert!(a.meets(&b));
            }
        }
        assert!(met > 50 && clear > 50, "{met} {clear}");
    }

    #[test]
    fn triangles_reach_into_boxes_where_points_of_them_do() {
        let mut next = numbers();
        let mut met = 0;
        for _ in 0..2000 {
            let half = DVec3::new(next(), next(), next()) + 0.1;
            let triangle = [(); 3].map(|()| (DVec3::new(next(), next(), next()) - 0.5) * 5.0);
            let found = (0..40).flat_map(|u| (0..40 - u).map(move |v| (f64::from(u) / 39.0, f64::from(v) / 39.0))).any(
                |(u, v)| {
                    let point = triangle[0] + (triangle[1] - triangle[0]) * u + (triangle[2] - triangle[0]) * v;
                    point.abs().cmplt(half).all()
                },
            );
            let reaches = reaches_into(half, triangle);
            assert!(reaches || !found);
            met += usize::from(reaches);
            // A triangle that reaches in without a sampled point inside does not reach into a smaller box.
            if !found && reaches {
                assert!(!reaches_into(half * 0.6, triangle) || half.min_element() < 0.4, "{triangle:?} {half}");
            }
        }
        assert!((200..1800).contains(&met), "{met}");
    }

    /// On a bumpy sheet: what is below a point, and what reaches into a box, compared with testing all triangles one by
    /// one.
    #[test]
    fn a_tree_finds_what_a_list_finds() {
        let (side, mut next) = (30_u32, numbers());
        let vertex = |k: u32| (f64::from(k % side), f64::from(k / side));
        let positions: Vec<[f32; 3]> =
            (0..side * side).map(|k| [vertex(k).0 as f32, vertex(k).1 as f32, next() as f32]).collect();
        let cells = (0..(side - 1) * (side - 1)).map(|k| k / (side - 1) * side + k % (side - 1));
        let triangles: Vec<[u32; 3]> =
            cells.flat_map(|k| [[k, k + 1, k + side], [k + 1, k + side + 1, k + side]]).collect();
        let mesh = mesh(positions.clone(), triangles.clone());
        let placed = DAffine3::from_scale_rotation_translation(
            DVec3::new(1.0, 2.0, 1.5),
            DQuat::from_rotation_z(0.4) * DQuat::from_rotation_x(0.1),
            DVec3::new(5.0, -3.0, 2.0),
        );
        let room = MeshTrees::default();
        let world: Vec<[DVec3; 3]> = triangles
            .iter()
            .map(|t| t.map(|k| placed.transform_point3(Vec3::from(positions[k as usize]).as_dvec3())))
            .collect();
        let (mut hits, mut met) = (0, 0);
        for _ in 0..300 {
            let from = DVec3::new(next() * 40.0 - 10.0, next() * 70.0 - 10.0, next() * 20.0);
            let found = room.below(&mesh, &placed, from).map(|(z, _)| z);
            let heights = world.iter().filter_map(|&[a, b, c]| height(a, b, c, from)).map(|(z, _)| z);
            let should = heights.filter(|z| *z <= from.z).reduce(f64::max);
            assert_eq!(found, should);
            hits += usize::from(found.is_some());
            let solid = Solid { centre: from, axes: turned(&mut next), half: DVec3::new(next(), next(), 0.5) + 0.1 };
            let own = solid.own_from_world();
            let should = world.iter().any(|t| reaches_into(solid.half, t.map(|corner| own.transform_point3(corner))));
            assert_eq!(room.meets(&mesh, &placed, &solid), should);
            met += usize::from(should);
        }
        assert!(hits > 50 && met > 20, "{hits} {met}");
    }

    #[test]
    fn boxes_move_with_their_contents() {
        let solid = Solid::upright(DVec3::new(-1.0, -2.0, 0.0), DVec3::new(1.0, 2.0, 3.0));
        assert_eq!(solid.foot(), DVec3::ZERO);
        let moved = DAffine3::from_scale_rotation_translation(
            DVec3::splat(2.0),
            DQuat::from_rotation_z(0.7),
            DVec3::new(10.0, 0.0, 1.0),
        );
        let there = solid.moved(&moved);
        assert!((there.half - DVec3::new(2.0, 4.0, 3.0)).length() < 1e-12);
        assert!((there.foot() - DVec3::new(10.0, 0.0, 1.0)).length() < 1e-12);
        assert!((there.top() - 7.0).abs() < 1e-12);
        let wide = solid.widened(0.5, 0.1);
        assert!((wide.foot().z - 0.1).abs() < 1e-12 && (wide.top() - 3.5).abs() < 1e-12);
        assert_eq!(wide.half.truncate(), glam::DVec2::new(1.5, 2.5));
    }
}
