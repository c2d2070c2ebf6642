//! Deformation of meshes: morph targets, and the joints of their vertices.

use super::Notes;
use super::accessor::{Accessors, SharedVectors, attribute, same_count};
use gltf::json::mesh::{Primitive, Semantic};
use gltf::json::{Accessor, Index};
use ground::array::Array;
use model::beyond_reach;
use model::motion::{MorphTarget, PartVertices};
use std::collections::HashMap;

/// How far from 1 the sum of weights may be without a warning: they are stored in 8 bits or more.
const SUM_TOLERANCE: f32 = 0.005;

/// What changes the shape of a mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(super) struct GltfForm {
    pub skinned: bool,
    pub morphed: bool,
}

impl GltfForm {
    /// Whether anything deforms the mesh.
    pub fn deforms(self) -> bool {
        self.skinned || self.morphed
    }
}

/// Reads what deforms primitives; data that several of them share is decoded once.
pub(super) struct GltfDeformations<'a> {
    accessors: &'a Accessors<'a>,
    /// Deltas of morph targets, by accessor; `None`: all are zero.
    deltas: HashMap<usize, Option<SharedVectors<3>>>,
    influences: HashMap<InfluenceKey, JointInfluences>,
}

impl<'a> GltfDeformations<'a> {
    pub fn new(accessors: &'a Accessors<'a>) -> Self {
        GltfDeformations { accessors, deltas: HashMap::new(), influences: HashMap::new() }
    }

    /// Adds morph targets and joint influences of a primitive with that many `vertices` to those of a part, which are
    /// the `used` ones.
    pub fn add_to(
        &mut self,
        part: &mut PartVertices,
        primitive: &Primitive,
        form: GltfForm,
        (used, vertices): (Option<&Vec<u32>>, usize),
        notes: &mut Notes,
        here: &str,
    ) -> Result<(), String> {
        let accessors = self.accessors;
        if form.morphed {
            let targets = primitive.targets.as_ref().map_or(0, Vec::len);
            accessors.charge(targets * size_of::<MorphTarget>())?;
            for (number, target) in primitive.targets.iter().flatten().enumerate() {
                let fault = |message: String| format!("morph target {number} {message}");
                let with_normals = target.normals.filter(|_| part.normals.is_some());
                let mut read = |name: &str, index: Option<Index<Accessor>>| {
                    let Some(index) = index else { return Ok(None) };
                    let deltas = self.deltas(name, index, vertices)?;
                    deltas.map(|deltas| accessors.pick(&deltas, used)).transpose()
                };
                let positions = read("POSITION", target.positions).map_err(fault)?;
                let normals = read("NORMAL", with_normals).map_err(fault)?;
                part.targets.push(MorphTarget { positions, normals });
            }
        }
        if form.skinned {
            let key = influence_key(primitive);
            let all = match self.influences.get(&key) {
                Some(known) => known.clone(),
                None => influences(accessors, primitive, vertices, notes, here)?,
            };
            let joints = all.joints.iter().map(|set| accessors.pick(set, used));
            part.joints = joints.collect::<Result<_, _>>()?;
            let weights = all.weights.iter().map(|set| accessors.pick(set, used));
            part.weights = weights.collect::<Result<_, _>>()?;
            self.influences.insert(key, all);
        }
        Ok(())
    }

    /// The deltas of a morph target for `vertices` vertices; `None`: all are zero.
    fn deltas(
        &mut self,
        name: &str,
        index: Index<Accessor>,
        vertices: usize,
    ) -> Result<Option<SharedVectors<3>>, String> {
        let fault = |message: String| format!("{name}: {message}");
        same_count(name, self.accessors.describe(index).map_err(fault)?, vertices)?;
        if let Some(known) = self.deltas.get(&index.value()) {
            return Ok(known.clone());
        }
        let deltas = self.accessors.vectors::<3>(index).map_err(fault)?;
        if let Some(vertex) = beyond_reach(&deltas) {
            return Err(fault(format!("vertex {vertex} has {:?}; allowed: -1e18 to 1e18", deltas[vertex])));
        }
        let deltas = deltas.iter().any(|delta| *delta != [0.0; 3]).then(|| SharedVectors::from(deltas));
        self.deltas.insert(index.value(), deltas.clone());
        Ok(deltas)
    }
}

/// The joints that move the vertices of an accessor, and their weights: one or two sets of four.
#[derive(Clone)]
struct JointInfluences {
    joints: Vec<Array<[u16; 4]>>,
    weights: Vec<Array<[f32; 4]>>,
}

/// The accessors from which a primitive takes its influences.
type InfluenceKey = [[Option<usize>; 2]; 2];

/// The accessors that [`influences`] reads.
fn influence_key(primitive: &Primitive) -> InfluenceKey {
    let index = |semantic| attribute(primitive, semantic).map(|accessor| accessor.value());
    [0, 1].map(|set| [index(Semantic::Joints(set)), index(Semantic::Weights(set))])
}

/// The influences of `vertices` vertices.
fn influences(
    accessors: &Accessors<'_>,
    primitive: &Primitive,
    vertices: usize,
    notes: &mut Notes,
    here: &str,
) -> Result<JointInfluences, String> {
    let attribute = |semantic| attribute(primitive, semantic);
    let (mut joints, mut weights) = (Vec::new(), Vec::new());
    for set in 0..2 {
        let names = [format!("JOINTS_{set}"), format!("WEIGHTS_{set}")];
        let found = [Semantic::Joints(set), Semantic::Weights(set)].map(attribute);
        let [Some(of_joints), Some(of_weights)] = found else {
            if found == [None; 2] && set > 0 {
                break;
            }
            let missing = &names[usize::from(found[0].is_some())];
            return Err(format!("it has no {missing}, which a mesh with a skin needs"));
        };
        for (name, index) in names.iter().zip([of_joints, of_weights]) {
            let described = accessors.describe(index).map_err(|message| format!("{name}: {message}"))?;
            same_count(name, described, vertices)?;
        }
        joints.push(accessors.quadruples(of_joints).map_err(|message| format!("{}: {message}", names[0]))?);
        let read = accessors.vectors::<4>(of_weights).map_err(|message| format!("{}: {message}", names[1]))?;
        // NaN fails this comparison too.
        let bad = |weights: &[f32; 4]| !weights.iter().all(|&weight| (0.0..=f32::MAX).contains(&weight));
        if let Some(bad) = read.iter().position(bad) {
            return Err(format!("{}: vertex {bad} has {:?}; allowed: 0 and more", names[1], read[bad]));
        }
        weights.push(read);
    }
    if attribute(Semantic::Joints(2)).is_some() {
        notes.add("of the joints that move a vertex, only the first eight are used", || here.to_owned());
    }
    normalize(&mut joints, &mut weights, notes, here);
    // A set in which all weights are zero.
    if weights.last().is_some_and(|last| joints.len() > 1 && last.iter().all(|weights| *weights == [0.0; 4])) {
        joints.pop();
        weights.pop();
    }
    let (joints, weights) = (joints.into_iter().map(Array::from), weights.into_iter().map(Array::from));
    Ok(JointInfluences { joints: joints.collect(), weights: weights.collect() })
}

/// Scales the weights of each vertex to add up to 1, and sets the numbers of joints without weight to 0.
fn normalize(joints: &mut [Vec<[u16; 4]>], weights: &mut [Vec<[f32; 4]>], notes: &mut Notes, here: &str) {
    let place = |vertex: usize| format!("{here} vertex {vertex}");
    for vertex in 0..weights.first().map_or(0, Vec::len) {
        let sum: f64 = weights.iter().flat_map(|set| set[vertex]).map(f64::from).sum();
        for (joints, weights) in joints.iter_mut().zip(weights.iter_mut()) {
            for (joint, weight) in joints[vertex].iter_mut().zip(&mut weights[vertex]) {
                *weight = if sum > 0.0 { (f64::from(*weight) / sum) as f32 } else { 0.0 };
                if *weight == 0.0 {
                    *joint = 0;
                }
            }
        }
        if sum == 0.0 {
            notes.add("vertices without a joint are moved by the first", || place(vertex));
            weights[0][vertex][0] = 1.0;
        } else if (sum as f32 - 1.0).abs() > SUM_TOLERANCE {
            notes.add("weights of joints that do not add up to 1 are scaled", || place(vertex));
        }
    }
}
