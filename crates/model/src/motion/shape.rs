//! Meshes that change their shape: skins, morph targets, caches.

use super::timeline::Branch;
use super::{AnimationTrack, Cache, MOST_BENDS, Span, Timeline};
use echocast_kernels::tree::Tree;
use glam::{DAffine3, DMat3, DVec3, Vec3};
use ground::array::Array;
use ground::math::cofactors;
use std::sync::{Arc, OnceLock};

/// Steps shorter than this, s, are not cut further: a jump happens within it.
const SHORTEST_S: f64 = 1e-6;

/// A deformation that jumps more often, other than at its bends, is noise.
const MOST_JUMPS: usize = 64;

/// Most steps: what takes longer is not worth waiting for.
const MOST_STEPS: usize = 1 << 16;

/// How an object's mesh changes its shape over time.
#[derive(Clone, Debug)]
pub struct Deformation {
    /// Its vertices before they move; shared by all objects with this mesh.
    pub vertices: Arc<Vertices>,
    /// Weights of the morph targets, where no track says otherwise.
    pub weights: Vec<f64>,
    /// Weights of the morph targets over time.
    pub weights_track: Option<AnimationTrack>,
    /// The skeleton that moves the vertices after morph targets; `None`: none does.
    pub skin: Option<Arc<Skin>>,
    /// Positions of all vertices over time, which replace those of skin and morph targets; `None`: none do.
    pub cache: Option<Arc<Cache>>,
}

/// The vertices of a mesh as they were modelled, part by part.
#[derive(Clone, Debug, Default)]
pub struct Vertices {
    /// In the order of the mesh's parts.
    pub parts: Vec<PartVertices>,
    /// How far joints and morph targets move them, once needed.
    reach: OnceLock<VertexReach>,
    /// Their triangles in the form that rays need, once required.
    pub layout: OnceLock<MeshLayout>,
}

/// How far joints and morph targets move vertices.
#[derive(Clone, Debug)]
struct VertexReach {
    /// Lowest and highest corner of the box around the vertices that each joint moves, m; `None`: it moves none.
    joints: Vec<Option<[DVec3; 2]>>,
    /// Greatest displacement of a vertex, m, for each morph target.
    targets: Vec<f64>,
}

/// The triangles of a mesh that changes its shape, those of all parts together.
#[derive(Clone, Debug)]
pub struct MeshLayout {
    /// Which triangles are in which of the nested boxes that rays search.
    pub tree: Tree,
    /// Where the vertices of each part begin among all; parts may share theirs.
    pub first_vertex: Vec<usize>,
    /// Where the triangles of each part begin among all.
    pub first_triangle: Vec<u32>,
    /// Number of all vertices.
    pub vertices: usize,
}

/// What deforms vertices at one time.
#[derive(Clone, Debug, Default)]
pub struct Pull {
    /// Weights of the morph targets.
    pub weights: Vec<f64>,
    /// Matrices of the joints, see [`Skin::palette`].
    pub palette: Vec<DAffine3>,
}

/// The vertices of a part, in the order of `Part::positions`.
#[derive(Clone, Debug, Default)]
pub struct PartVertices {
    /// As modelled, m.
    pub positions: Array<[f32; 3]>,
    /// Unit normals, where the surface is smooth.
    pub normals: Option<Array<[f32; 3]>>,
    /// Morph targets.
    pub targets: Vec<MorphTarget>,
    /// Sets of four joints that move each vertex, numbers in [`Skin::joints`]; one or two sets, or none without skin.
    pub joints: Vec<Array<[u16; 4]>>,
    /// How much each joint contributes, all sets together 1.
    pub weights: Vec<Array<[f32; 4]>>,
}

/// How a morph target displaces the vertices of a part at weight 1.
#[derive(Clone, Debug, Default)]
pub struct MorphTarget {
    /// m; `None`: not at all.
    pub positions: Option<Array<[f32; 3]>>,
    /// What it adds to the normals.
    pub normals: Option<Array<[f32; 3]>>,
}

/// A skeleton that moves vertices.
#[derive(Clone, Debug)]
pub struct Skin {
    /// Nodes of the timeline.
    pub joints: Vec<usize>,
    /// From the mesh as modelled to each joint's own frame.
    pub joint_from_mesh: Vec<DAffine3>,
    /// The joints in their timeline, once needed.
    branch: OnceLock<Branch>,
}

impl Deformation {
    /// The deformation by a `cache` of so many `parts` that share their vertices, which rest at `positions`.
    pub fn baked(parts: usize, positions: &Array<[f32; 3]>, cache: Cache) -> Deformation {
        let part = PartVertices { positions: positions.clone(), ..PartVertices::default() };
        let vertices = Arc::new(Vertices::new(vec![part; parts]));
        Deformation { vertices, weights: Vec::new(), weights_track: None, skin: None, cache: Some(Arc::new(cache)) }
    }

    /// Weights of the morph targets at `time`, s.
    pub(crate) fn weights_at(&self, time: f64) -> Vec<f64> {
        let mut weights = self.weights.clone();
        if let Some(track) = &self.weights_track {
            track.at(time, &mut weights);
        }
        weights
    }

    /// What deforms its vertices at `time`, s: weights of the morph targets, and [`Skin::palette`].
    pub fn pull(&self, timeline: &Timeline, time: f64, world_from_object: &DAffine3) -> Pull {
        let mut palette = Vec::new();
        if let Some(skin) = &self.skin {
            skin.palette(timeline, time, world_from_object, &mut palette);
        }
        Pull { weights: self.weights_at(time), palette }
    }

    /// Whether it stays as it is at all times from `from` to `to`, s.
    pub fn stays(&self, timeline: &Timeline, from: f64, to: f64) -> bool {
        let weights = self.weights_track.as_ref().is_none_or(|track| track.is_still(from, to));
        let cache = self.cache.as_ref().is_none_or(|cache| cache.is_still(from, to));
        let skin = self.skin.as_ref().is_none_or(|skin| skin.branch(timeline).stays(timeline, from, to));
        weights && cache && skin
    }

    /// Times, s, from the start to the end of `span`, between which no vertex is farther than `tolerance` m from the
    /// straight line between its places at both, and what deforms them then; `world_from_object` as in
    /// [`PartVertices::pose`]. `None`: it is noise, or there are more than `most`, at least 1.
    pub fn steps(
        &self,
        timeline: &Timeline,
        span: Span,
        world_from_object: &DAffine3,
        tolerance: f64,
        most: usize,
    ) -> Option<Vec<(f64, Pull)>> {
        let (start, end) = (span.start, span.start + span.length);
        let pull = |time: f64| self.pull(timeline, time, world_from_object);
        let mut steps = vec![(start, pull(start))];
        if span.length == 0.0 || self.stays(timeline, start, end) {
            return Some(steps);
        }
        if self.most_bends(timeline, start, end) > MOST_BENDS {
            return None;
        }
        let mut bends = Vec::new();
        self.cache.iter().for_each(|cache| cache.bends(start, end, &mut bends));
        let baked = bends.len();
        self.weights_track.iter().for_each(|track| track.bends(start, end, &mut bends));
        self.skin.iter().for_each(|skin| skin.branch(timeline).bends(timeline, start, end, &mut bends));
        let mut marks = bends[..baked].to_vec();
        marks.extend([start, end]);
        marks.sort_by(f64::total_cmp);
        marks.dedup();
        bends.sort_by(f64::total_cmp);
        bends.dedup();
        let most = most.min(MOST_STEPS);
        let mut jumps = 0;
        // Where the next steps may be, the last first.
        let mut ends = Vec::new();
        for &mark in &marks[1..] {
            ends.push((mark, pull(mark)));
            while let Some((to, b)) = ends.pop() {
                let (from, ref a) = steps[steps.len() - 1];
                let middle = 0.5 * (from + to);
                let error = self.error(a, &pull(middle), &b);
                // Coordinates are single precision: differences that it cannot resolve need no steps.
                let fits = error <= tolerance || error <= self.extent(a).max(self.extent(&b)) * f64::from(f32::EPSILON);
                if fits || to - from <= SHORTEST_S {
                    jumps += usize::from(!fits);
                    if steps.len() >= most || jumps > MOST_JUMPS + bends.len() {
                        return None;
                    }
                    steps.push((to, b));
                    continue;
                }
                // An error falls with the square of the length; where it bends in between, it is better cut there.
                let near = |bend: &&f64| (*bend - middle).abs() < 0.3 * (to - from);
                let nearest =
                    bends.iter().filter(near).min_by(|a, b| (*a - middle).abs().total_cmp(&(*b - middle).abs()));
                let parts =
                    if nearest.is_some() { 2 } else { ((error / tolerance).sqrt().ceil() as usize).clamp(2, 16) };
                let cut = |part: usize| match nearest {
                    Some(bend) => *bend,
                    None => from + (to - from) * part as f64 / parts as f64,
                };
                ends.push((to, b));
                ends.extend((1..parts).rev().map(|part| (cut(part), pull(cut(part)))));
            }
        }
        Some(steps)
    }

    /// Upper bound on the number of times at which it may bend between `from` and `to`, s.
    fn most_bends(&self, timeline: &Timeline, from: f64, to: f64) -> f64 {
        let cache = self.cache.as_ref().map_or(0.0, |cache| cache.most_bends(from, to));
        let weights = self.weights_track.as_ref().map_or(0.0, |track| track.most_bends(from, to));
        cache + weights + self.skin.as_ref().map_or(0.0, |skin| skin.branch(timeline).most_bends(timeline, from, to))
    }

    /// Memory of a [`Pull`] of it.
    pub fn pull_bytes(&self) -> usize {
        size_of::<Pull>()
            + self.weights.len() * size_of::<f64>()
            + self.skin.as_ref().map_or(0, |skin| skin.joints.len() * size_of::<DAffine3>())
    }

    /// Greatest distance of vertices deformed by `middle` from halfway between where `a` and `b` put them, m.
    fn error(&self, a: &Pull, middle: &Pull, b: &Pull) -> f64 {
        let reach = self.vertices.reach();
        let targets = reach.targets.iter().enumerate().map(|(k, way)| {
            let [a, middle, b] = [a, middle, b].map(|pull| pull.weights.get(k).copied().unwrap_or(0.0));
            (middle - 0.5 * (a + b)).abs() * way
        });
        let joints = reach.joints.iter().enumerate().filter_map(|(k, extent)| Some((k, (*extent)?)));
        let joints = joints.map(|(k, [low, high])| {
            let [Some(a), Some(middle), Some(b)] = [a, middle, b].map(|pull| pull.palette.get(k)) else { return 0.0 };
            let matrix = middle.matrix3 - (a.matrix3 + b.matrix3) * 0.5;
            let offset = middle.translation - (a.translation + b.translation) * 0.5;
            // The error is affine in the position: greatest at a corner of the box.
            let centre = offset + matrix * (0.5 * (low + high));
            let half = 0.5 * (high - low);
            let spread = matrix.x_axis.abs() * half.x + matrix.y_axis.abs() * half.y + matrix.z_axis.abs() * half.z;
            (centre.abs() + spread).length()
        });
        targets.sum::<f64>() + joints.fold(0.0, f64::max)
    }

    /// How far from the origin vertices deformed by `pull` may be along an axis, m.
    fn extent(&self, pull: &Pull) -> f64 {
        let reach = self.vertices.reach();
        let targets: f64 = reach.targets.iter().zip(&pull.weights).map(|(way, weight)| way * weight.abs()).sum();
        let joints = reach.joints.iter().zip(&pull.palette).filter_map(|(extent, joint)| {
            let [low, high] = (*extent)?;
            Some(joint.transform_point3(low).abs().max(joint.transform_point3(high).abs()).max_element())
        });
        joints.fold(targets, f64::max)
    }

    /// The same on a timeline whose nodes have numbers `shift` higher.
    pub(super) fn shifted(self, shift: usize) -> Deformation {
        let skin = self.skin.map(|skin| {
            let Skin { joints, joint_from_mesh, .. } = Arc::unwrap_or_clone(skin);
            Arc::new(Skin::new(joints.into_iter().map(|joint| joint + shift).collect(), joint_from_mesh))
        });
        Deformation { skin, ..self }
    }
}

impl MeshLayout {
    /// Memory of one step.
    pub fn step_bytes(&self) -> usize {
        self.vertices * size_of::<[f32; 4]>() + self.tree.box_bytes()
    }

    /// Part of a `triangle` counted over all parts, and its number within that part.
    pub fn of(&self, triangle: u32) -> (usize, u32) {
        let part = self.first_triangle.partition_point(|first| *first <= triangle) - 1;
        (part, triangle - self.first_triangle[part])
    }
}

impl Vertices {
    /// The vertices of these parts.
    pub fn new(parts: Vec<PartVertices>) -> Vertices {
        Vertices { parts, ..Vertices::default() }
    }

    fn reach(&self) -> &VertexReach {
        self.reach.get_or_init(|| {
            let mut reach = VertexReach { joints: Vec::new(), targets: Vec::new() };
            for part in &self.parts {
                reach.targets.resize(reach.targets.len().max(part.targets.len()), 0.0);
                for (way, target) in reach.targets.iter_mut().zip(&part.targets) {
                    let ways = target.positions.iter().flat_map(|ways| ways.iter());
                    *way = ways.map(|way| DVec3::from(way.map(f64::from)).length()).fold(*way, f64::max);
                }
            }
            let most: f64 = reach.targets.iter().sum();
            for part in &self.parts {
                for (joints, weights) in part.joints.iter().zip(&part.weights) {
                    for ((joints, weights), place) in joints.iter().zip(weights.iter()).zip(part.positions.iter()) {
                        let place = DVec3::from(place.map(f64::from));
                        for (&joint, _) in joints.iter().zip(weights).filter(|(_, weight)| **weight > 0.0) {
                            let joint = usize::from(joint);
                            reach.joints.resize(reach.joints.len().max(joint + 1), None);
                            let [low, high] = reach.joints[joint].get_or_insert([place; 2]);
                            (*low, *high) = (low.min(place - most), high.max(place + most));
                        }
                    }
                }
            }
            reach
        })
    }
}

impl Skin {
    /// The skin of these joints; see its fields.
    pub fn new(joints: Vec<usize>, joint_from_mesh: Vec<DAffine3>) -> Skin {
        Skin { joints, joint_from_mesh, branch: OnceLock::new() }
    }

    fn branch(&self, timeline: &Timeline) -> &Branch {
        self.branch.get_or_init(|| timeline.branch(&self.joints))
    }

    /// Sets `palette` to the transforms from the mesh as modelled to where each joint moves it at `time`, s, in the
    /// frame of an object at `world_from_object`.
    pub fn palette(&self, timeline: &Timeline, time: f64, world_from_object: &DAffine3, palette: &mut Vec<DAffine3>) {
        palette.clear();
        palette.extend(self.palette_of(timeline.world_from_ends(self.branch(timeline), time), world_from_object));
    }

    /// [`Skin::palette`] where the joints are at `world_from_joints`.
    pub fn palette_of(
        &self,
        world_from_joints: impl IntoIterator<Item = DAffine3>,
        world_from_object: &DAffine3,
    ) -> impl Iterator<Item = DAffine3> {
        let object_from_world = world_from_object.inverse();
        let joints = world_from_joints.into_iter().zip(&self.joint_from_mesh);
        joints.map(move |(world_from_joint, joint_from_mesh)| object_from_world * world_from_joint * *joint_from_mesh)
    }
}

impl PartVertices {
    /// Whether its vertices are those of `other`, and always will be.
    pub fn moves_as(&self, other: &PartVertices) -> bool {
        let alike = |a: &MorphTarget, b: &MorphTarget| match (&a.positions, &b.positions) {
            (None, None) => true,
            (Some(a), Some(b)) => a.is(b),
            _ => false,
        };
        self.positions.is(&other.positions)
            && self.targets.len() == other.targets.len()
            && self.targets.iter().zip(&other.targets).all(|(a, b)| alike(a, b))
            && self.joints.len() == other.joints.len()
            && self.joints.iter().zip(&other.joints).all(|(a, b)| a.is(b))
            && self.weights.iter().zip(&other.weights).all(|(a, b)| a.is(b))
    }

    /// The normal of a vertex as in [`PartVertices::turn`], of any length; 0 without normals.
    pub fn normal(&self, vertex: usize, weights: &[f64], palette: &[DAffine3]) -> Vec3 {
        let Some(modelled) = &self.normals else { return Vec3::ZERO };
        let double = |vector: [f32; 3]| DVec3::from(vector.map(f64::from));
        let mut normal = double(modelled[vertex]);
        for (target, &weight) in self.targets.iter().zip(weights) {
            if let Some(ways) = &target.normals {
                normal += weight * double(ways[vertex]);
            }
        }
        if !self.joints.is_empty() {
            let mut blend = DMat3::ZERO;
            for (joints, weights) in self.joints.iter().zip(&self.weights) {
                for (&joint, &weight) in joints[vertex].iter().zip(&weights[vertex]) {
                    blend += palette[usize::from(joint)].matrix3 * f64::from(weight);
                }
            }
            normal = cofactors(&blend) * normal;
        }
        normal.as_vec3()
    }

    /// Sets `positions` to where the vertices are with these weights of the morph targets and, if it has a skin, this
    /// palette of its joints: first morph targets, then joints (glTF 2.0, 3.7.2.2 and 3.7.3.3).
    pub fn pose(&self, weights: &[f64], palette: &[DAffine3], positions: &mut Vec<[f32; 3]>) {
        let mut places = doubles(&self.positions);
        self.morph(weights, |target| target.positions.as_ref(), &mut places);
        if !self.joints.is_empty() {
            for (place, joint) in places.iter_mut().zip(self.blends(palette)) {
                *place = joint.transform_point3(*place);
            }
        }
        positions.clear();
        positions.extend(places.iter().map(|place| place.as_vec3().to_array()));
    }

    /// Sets `normals` to the unit normals that go with [`PartVertices::pose`]; empty without normals. A normal that
    /// vanishes stays as modelled.
    pub fn turn(&self, weights: &[f64], palette: &[DAffine3], normals: &mut Vec<[f32; 3]>) {
        normals.clear();
        let Some(modelled) = &self.normals else { return };
        let mut turned = doubles(modelled);
        self.morph(weights, |target| target.normals.as_ref(), &mut turned);
        if !self.joints.is_empty() {
            for (normal, joint) in turned.iter_mut().zip(self.blends(palette)) {
                *normal = cofactors(&joint.matrix3) * *normal;
            }
        }
        let unit = |(normal, modelled): (&DVec3, &[f32; 3])| {
            normal.try_normalize().map_or(*modelled, |unit| unit.as_vec3().to_array())
        };
        normals.extend(turned.iter().zip(modelled.iter()).map(unit));
    }

    /// Adds the displacements of the morph targets at these weights.
    fn morph(&self, weights: &[f64], of: impl Fn(&MorphTarget) -> Option<&Array<[f32; 3]>>, vectors: &mut [DVec3]) {
        for (target, &weight) in self.targets.iter().zip(weights) {
            let Some(moved) = of(target).filter(|_| weight != 0.0) else { continue };
            for (vector, by) in vectors.iter_mut().zip(moved.iter()) {
                *vector += weight * DVec3::from(by.map(f64::from));
            }
        }
    }

    /// Blended transform of its joints for each vertex.
    fn blends(&self, palette: &[DAffine3]) -> Vec<DAffine3> {
        let nothing = DAffine3 { matrix3: DMat3::ZERO, translation: DVec3::ZERO };
        let mut blends = vec![nothing; self.positions.len()];
        for (joints, weights) in self.joints.iter().zip(&self.weights) {
            for (blend, (joints, weights)) in blends.iter_mut().zip(joints.iter().zip(weights.iter())) {
                for (&joint, &weight) in joints.iter().zip(weights).filter(|(_, weight)| **weight != 0.0) {
                    let (weight, joint) = (f64::from(weight), &palette[usize::from(joint)]);
                    blend.matrix3 += joint.matrix3 * weight;
                    blend.translation += joint.translation * weight;
                }
            }
        }
        blends
    }
}

fn doubles(vectors: &[[f32; 3]]) -> Vec<DVec3> {
    vectors.iter().map(|vector| DVec3::from(vector.map(f64::from))).collect()
}
