//! Deformation of meshes: the bones of their vertices, and blend shapes.

use super::budget::Budget;
use model::beyond_reach;
use model::motion::{MorphTarget, PartVertices};
use ufbx::{BlendChannel, BlendShape, Mesh, SkinDeformer};

/// Most bones that move one vertex; of more, the strongest are used.
const MOST_INFLUENCES: usize = 8;

/// What changes the shape of a mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct FbxForm {
    pub skinned: bool,
    pub morphed: bool,
}

impl FbxForm {
    /// Whether anything deforms the mesh.
    pub fn deforms(self) -> bool {
        self.skinned || self.morphed
    }
}

/// The skin of a mesh, if it has one with bones.
pub(super) fn skin(mesh: &Mesh) -> Option<&SkinDeformer> {
    mesh.skin_deformers.as_ref().iter().map(|skin| &**skin).find(|skin| !skin.clusters.is_empty())
}

/// The blend channels of a mesh: weights, each of which may have several shapes.
pub(super) fn channels(mesh: &Mesh) -> impl Iterator<Item = &BlendChannel> {
    mesh.blend_deformers.into_iter().flat_map(|blend| &blend.channels)
}

/// Effective weight of each shape of a mesh whose channels have the weights `of`; 1: full effect.
pub(super) fn weights(mesh: &Mesh, of: impl Fn(&BlendChannel) -> f64) -> Vec<f64> {
    channels(mesh).flat_map(|channel| effective(channel, of(channel))).collect()
}

/// Effective weight of each shape of a channel that has this weight: interpolated between the two shapes whose target
/// weights are nearest, one of which may be no shape at 0; extrapolated beyond the last.
fn effective(channel: &BlendChannel, weight: f64) -> Vec<f64> {
    let keys = &channel.keyframes;
    let mut points: Vec<(f64, Option<usize>)> = keys.iter().map(|key| key.target_weight).zip((0..).map(Some)).collect();
    points.push((0.0, None));
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut found = vec![0.0; keys.len()];
    let last = points.len() - 1;
    let above = points.partition_point(|(point, _)| *point <= weight).clamp(1.min(last), last);
    let [(from, below), (to, above)] = [points[above.saturating_sub(1)], points[above]];
    if to > from {
        let part = (weight - from) / (to - from);
        below.into_iter().for_each(|shape| found[shape] = 1.0 - part);
        above.into_iter().for_each(|shape| found[shape] = part);
    }
    found
}

/// Adds morph targets and bone influences to the vertices of a part, which come from these vertices of the file.
pub(super) fn deforming(
    mesh: &Mesh,
    form: FbxForm,
    sources: &[u32],
    budget: &Budget,
    part: &mut PartVertices,
) -> Result<(), String> {
    if form.morphed {
        for shape in channels(mesh).flat_map(|channel| &channel.keyframes).map(|key| &*key.shape) {
            part.targets.push(target(shape, sources, budget, part.normals.is_some())?);
        }
    }
    if let Some(skin) = skin(mesh).filter(|_| form.skinned) {
        influences(skin, sources, budget, part)?;
    }
    Ok(())
}

/// The offsets by which a shape moves the vertices of a part.
fn target(shape: &BlendShape, sources: &[u32], budget: &Budget, smooth: bool) -> Result<MorphTarget, String> {
    budget.charge(sources.len().saturating_mul(2 * size_of::<[f32; 3]>()))?;
    let spread = |offsets: &[ufbx::Vec3]| {
        let of = |source: &u32| {
            // They are in ascending order.
            let place = shape.offset_vertices.binary_search(source).ok()?;
            let weight = shape.offset_weights.get(place).copied().unwrap_or(1.0);
            Some((super::vector(*offsets.get(place)?) * weight).as_vec3().to_array())
        };
        let all: Vec<[f32; 3]> = sources.iter().map(|source| of(source).unwrap_or_default()).collect();
        if let Some(bad) = beyond_reach(&all) {
            let (vertex, found) = (sources[bad], all[bad]);
            return Err(format!("a blend shape moves vertex {vertex} by {found:?}; allowed: -1e18 to 1e18"));
        }
        Ok(all.iter().any(|offset| *offset != [0.0; 3]).then(|| all.into()))
    };
    let positions = spread(&shape.position_offsets)?;
    let normals = if smooth { spread(&shape.normal_offsets)? } else { None };
    Ok(MorphTarget { positions, normals })
}

/// The bones of each vertex of a part; vertices that no bone moves follow the last bone, see
/// [`FbxSkeleton`](super::skeleton::FbxSkeleton).
fn influences(skin: &SkinDeformer, sources: &[u32], budget: &Budget, part: &mut PartVertices) -> Result<(), String> {
    let bones_of = |source: u32| {
        let Some(vertex) = skin.vertices.get(source as usize) else { return &[][..] };
        let first = vertex.weight_begin as usize;
        let count = (vertex.num_weights as usize).min(MOST_INFLUENCES);
        skin.weights.get(first..first + count).unwrap_or_default()
    };
    let most = sources.iter().map(|&source| bones_of(source).len()).max().unwrap_or(0);
    let sets = most.div_ceil(4).max(1);
    budget.charge(sources.len().saturating_mul(sets * (size_of::<[f32; 4]>() + size_of::<[u16; 4]>())))?;
    let mut joints = vec![Vec::with_capacity(sources.len()); sets];
    let mut weights = vec![Vec::with_capacity(sources.len()); sets];
    for &source in sources {
        let bones = bones_of(source);
        let sum: f64 = bones.iter().map(|bone| bone.weight).sum();
        let mut all: Vec<(u16, f32)> = if sum > 0.0 && sum.is_finite() {
            bones.iter().map(|bone| (bone.cluster_index as u16, (bone.weight / sum) as f32)).collect()
        } else {
            vec![(skin.clusters.len() as u16, 1.0)]
        };
        all.resize(4 * sets, (0, 0.0));
        for (set, four) in all.as_chunks::<4>().0.iter().enumerate() {
            joints[set].push(four.map(|(bone, _)| bone));
            weights[set].push(four.map(|(_, weight)| weight));
        }
    }
    part.joints = joints.into_iter().map(Into::into).collect();
    part.weights = weights.into_iter().map(Into::into).collect();
    Ok(())
}
