//! Meshes that change their shape: skins, morph targets, caches.

use super::{Cache, Timeline, Track};
use crate::ground::array::Array;
use crate::ground::math::cofactors;
use glam::{DAffine3, DMat3, DVec3};
use std::sync::Arc;

/// How an object's mesh changes its shape over time.
#[derive(Clone, Debug)]
pub(crate) struct Shape {
    /// What its vertices are before they move; shared by all objects with this mesh.
    pub vertices: Arc<Vertices>,
    /// Weights of the morph targets, where no track says otherwise.
    pub weights: Vec<f64>,
    /// Weights of the morph targets over time.
    pub weights_track: Option<Track>,
    pub skin: Option<Arc<Skin>>,
    pub cache: Option<Arc<Cache>>,
}

/// The vertices of a mesh as they were modelled, part by part.
#[derive(Clone, Debug, Default)]
pub(crate) struct Vertices {
    pub parts: Vec<PartVertices>,
}

/// The vertices of a part, in the order of [`crate::scene::Part::positions`].
#[derive(Clone, Debug, Default)]
pub(crate) struct PartVertices {
    /// As modelled, m.
    pub positions: Array<[f32; 3]>,
    /// Unit normals, where the surface is smooth.
    pub normals: Option<Array<[f32; 3]>>,
    /// Morph targets.
    pub targets: Vec<Target>,
    /// Sets of four joints that move each vertex, numbers in [`Skin::joints`]; one or two sets, or none without skin.
    pub joints: Vec<Array<[u16; 4]>>,
    /// How much each joint does, all sets together 1.
    pub weights: Vec<Array<[f32; 4]>>,
}

/// Where a morph target moves the vertices of a part at weight 1.
#[derive(Clone, Debug, Default)]
pub(crate) struct Target {
    /// m; `None`: nowhere.
    pub positions: Option<Array<[f32; 3]>>,
    /// What it adds to the normals.
    pub normals: Option<Array<[f32; 3]>>,
}

/// A skeleton that moves vertices.
#[derive(Clone, Debug)]
pub(crate) struct Skin {
    /// Nodes of the timeline.
    pub joints: Vec<usize>,
    /// From the mesh as modelled to each joint's own frame.
    pub joint_from_mesh: Vec<DAffine3>,
}

impl Shape {
    /// Weights of the morph targets at `time`, s.
    pub(crate) fn weights_at(&self, time: f64) -> Vec<f64> {
        let mut weights = self.weights.clone();
        if let Some(track) = &self.weights_track {
            track.at(time, &mut weights);
        }
        weights
    }

    /// What brings its vertices to their places at `time`, s: weights of the morph targets, and [`Skin::palette`].
    fn pull(&self, timeline: &Timeline, time: f64, world_from_object: &DAffine3) -> (Vec<f64>, Vec<DAffine3>) {
        let mut palette = Vec::new();
        if let Some(skin) = &self.skin {
            skin.palette(timeline, time, world_from_object, &mut palette);
        }
        (self.weights_at(time), palette)
    }

    /// Sets `positions` to where the vertices of part `part` are at `time`, s, in the frame of an object at
    /// `world_from_object`, which counts for skins only.
    pub(crate) fn pose(
        &self,
        timeline: &Timeline,
        time: f64,
        world_from_object: &DAffine3,
        part: usize,
        positions: &mut Vec<[f32; 3]>,
    ) {
        let (weights, palette) = self.pull(timeline, time, world_from_object);
        self.vertices.parts[part].pose(&weights, &palette, positions);
    }

    /// Sets `normals` to the unit normals that go with [`Shape::pose`]; empty where the surface is not smooth.
    pub(crate) fn normals(
        &self,
        timeline: &Timeline,
        time: f64,
        world_from_object: &DAffine3,
        part: usize,
        normals: &mut Vec<[f32; 3]>,
    ) {
        let (weights, palette) = self.pull(timeline, time, world_from_object);
        self.vertices.parts[part].turn(&weights, &palette, normals);
    }

    /// The same on a timeline whose nodes have numbers `shift` higher.
    pub(super) fn shifted(self, shift: usize) -> Shape {
        let skin = self.skin.map(|skin| {
            let Skin { joints, joint_from_mesh } = Arc::unwrap_or_clone(skin);
            Arc::new(Skin { joints: joints.into_iter().map(|joint| joint + shift).collect(), joint_from_mesh })
        });
        Shape { skin, ..self }
    }
}

impl Skin {
    /// Sets `palette` to what brings the mesh as modelled to where each joint wants it at `time`, s, in the frame of an
    /// object at `world_from_object`.
    pub(crate) fn palette(
        &self,
        timeline: &Timeline,
        time: f64,
        world_from_object: &DAffine3,
        palette: &mut Vec<DAffine3>,
    ) {
        palette.clear();
        palette.extend(self.palette_of(timeline.world_from_nodes(&self.joints, time), world_from_object));
    }

    /// [`Skin::palette`] where the joints are at `world_from_joints`.
    pub(crate) fn palette_of(
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
    /// Sets `positions` to where the vertices are with these weights of the morph targets and, if it has a skin, this
    /// palette of its joints: first morph targets, then joints (glTF 2.0, 3.7.2.2 and 3.7.3.3).
    pub(crate) fn pose(&self, weights: &[f64], palette: &[DAffine3], positions: &mut Vec<[f32; 3]>) {
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

    /// Sets `normals` to the unit normals that go with [`PartVertices::pose`]; empty without normals. One that is left
    /// without direction stays as modelled.
    pub(crate) fn turn(&self, weights: &[f64], palette: &[DAffine3], normals: &mut Vec<[f32; 3]>) {
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

    /// Adds what the morph targets add at these weights.
    fn morph(&self, weights: &[f64], of: impl Fn(&Target) -> Option<&Array<[f32; 3]>>, vectors: &mut [DVec3]) {
        for (target, &weight) in self.targets.iter().zip(weights) {
            let Some(moved) = of(target).filter(|_| weight != 0.0) else { continue };
            for (vector, by) in vectors.iter_mut().zip(moved.iter()) {
                *vector += weight * DVec3::from(by.map(f64::from));
            }
        }
    }

    /// What its joints together do to each vertex.
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
