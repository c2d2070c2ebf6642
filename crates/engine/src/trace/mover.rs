//! Objects that move while they are scanned.

use super::deforming::{Deforming, Known, MeshSpot, Moment};
use super::driving::DrivingMotion;
use super::structure::structure_of;
use super::{Engine, Tables};
use crate::scene::{Mesh, Sequence};
use echocast_kernels::aim;
use embree4::{CommittedScene, CustomShape, LocalRays, Pace, Query};
use glam::{DAffine3, DMat3, Vec3};
use ground::error::Result;
use model::Part;
use model::motion::{Path, Span};
use std::sync::Arc;

/// A moving object, as rays hit it at their own times.
pub struct Mover {
    pub path: Path,
    /// Start of its time span, s.
    pub start: f64,
    pub(super) driving: DrivingMotion,
    body: MoverMesh,
}

/// The mesh of an object that moves, in the object's frame.
enum MoverMesh {
    /// It is rigid.
    Rigid(CommittedScene),
    Deforming(Deforming),
    /// One mesh replaces another.
    Changing(Vec<MeshStage>),
}

/// A mesh and the time from which it is present, 0 to 1.
struct MeshStage {
    start: f32,
    /// Its number in the sequence.
    number: usize,
    mesh: Arc<Mesh>,
    of: CommittedScene,
    /// Memory that mesh and structure take, unless an earlier stage has them too.
    bytes: usize,
}

/// Most lanes of a packet.
const MOST: usize = 16;

impl DrivingMotion {
    /// Its shape in `span`, if it changes, in no more than `most_bytes`; see [`Deforming::new`].
    pub(super) fn shape(&self, span: Span, known: &mut Known, most_bytes: usize) -> Result<Option<Deforming>> {
        let Some(shape) = &self.motion.shape else { return Ok(None) };
        let deforming = Deforming::new(self, shape, span, known, most_bytes)?;
        deforming.ok_or_else(|| self.too_much(span)).map(Some)
    }
}

impl Mover {
    /// An object that moves through `span` as `driving` specifies; moments `known` already are used as in
    /// [`Deforming::new`].
    ///
    /// # Errors
    /// Embree's: out of memory; a vertex cache that can no longer be read; motion that takes more than `most_bytes`.
    pub(super) fn new(
        engine: &Engine,
        driving: DrivingMotion,
        span: Span,
        known: &mut Known,
        most_bytes: usize,
    ) -> Result<Mover> {
        let body = match (driving.shape(span, known, most_bytes)?, &driving.sequence) {
            (Some(deforming), _) => MoverMesh::Deforming(deforming),
            (None, Some(sequence)) => {
                let stages = stages(engine, sequence, span, most_bytes)?;
                MoverMesh::Changing(stages.ok_or_else(|| driving.too_much(span))?)
            }
            (None, None) => MoverMesh::Rigid(structure_of(&driving.mesh, engine, Pace::Now)?),
        };
        let path = driving.path(span, body.bounds(0.0), most_bytes)?;
        Ok(Mover { path, start: span.start, driving, body })
    }

    /// Memory that its motion takes.
    pub(super) fn bytes(&self) -> usize {
        let body = match &self.body {
            MoverMesh::Rigid(_) => 0,
            MoverMesh::Deforming(deforming) => deforming.bytes(),
            MoverMesh::Changing(stages) => stages.iter().map(|stage| stage.bytes).sum(),
        };
        self.path.bytes() + body
    }

    /// Its pose at `time`, s, and its orientation: that of its frame, or of its skeleton; `None`: it is hidden.
    pub(super) fn transform_at(&self, time: f64) -> Option<(DAffine3, DMat3)> {
        let DrivingMotion { timeline, motion, .. } = &self.driving;
        let world_from_object = self.driving.world_from_object(time);
        timeline.is_visible(motion.node, time).then(|| (world_from_object, self.turned(time, &world_from_object)))
    }

    /// Its orientation at `time`, s, given its pose then.
    fn turned(&self, time: f64, world_from_object: &DAffine3) -> DMat3 {
        let turned = match &self.body {
            MoverMesh::Deforming(deforming) => deforming.turned(&self.driving.timeline, time, world_from_object),
            MoverMesh::Rigid(_) | MoverMesh::Changing(_) => None,
        };
        world_from_object.matrix3 * turned.unwrap_or(DMat3::IDENTITY)
    }

    /// Whether it has the same triangles at all times.
    pub(super) fn keeps_triangles(&self) -> bool {
        !matches!(self.body, MoverMesh::Changing(_))
    }

    /// A point of a part at `time` and the weights `uv` of the second and third corner of a `triangle`, and its
    /// velocity, m per length of the time span, both in its object's frame; `as_modelled` is the part with this
    /// `number` while nothing changes it.
    pub(super) fn point(
        &self,
        (number, as_modelled): (u16, &Part),
        triangle: u32,
        uv: [f32; 2],
        time: f32,
    ) -> (Vec3, Vec3) {
        let part = match &self.body {
            MoverMesh::Deforming(deforming) => return deforming.point((number.into(), triangle, uv), time),
            MoverMesh::Rigid(_) => as_modelled,
            MoverMesh::Changing(stages) => &stages[stage_at(stages, time)].mesh.parts[usize::from(number)],
        };
        (part.point(triangle, uv), Vec3::ZERO)
    }

    /// If its shape changes, passes the positions of the corners of its triangles at `time`, 0 to 1, and their
    /// velocities per length of the time span, both in the object's frame, to `visit`.
    pub(super) fn each_corner(&self, time: f32, visit: &mut dyn FnMut(Vec3, Vec3)) {
        match &self.body {
            MoverMesh::Rigid(_) => {}
            MoverMesh::Deforming(deforming) => deforming.each_corner(time, visit),
            MoverMesh::Changing(stages) => {
                let Some(stage) = stages.get(stage_at(stages, time)) else { return };
                for part in &stage.mesh.parts {
                    let corners = part.triangles.iter().flatten();
                    corners.for_each(|&corner| visit(part.positions[corner as usize].into(), Vec3::ZERO));
                }
            }
        }
    }

    /// Whether it is rigid.
    pub(super) fn is_stiff(&self) -> bool {
        matches!(self.body, MoverMesh::Rigid(_))
    }

    /// Box around its mesh at the start of the time span.
    pub(super) fn start_bounds(&self) -> [[f32; 3]; 2] {
        self.body.bounds(0.0)
    }

    /// What is known of its shape, for the next scan.
    pub(super) fn moments(&self) -> &[Arc<Moment>] {
        match &self.body {
            MoverMesh::Rigid(_) | MoverMesh::Changing(_) => &[],
            MoverMesh::Deforming(deforming) => deforming.moments(),
        }
    }

    /// The interpolated normal of a spot at `time` in the object's frame, of any length, where its shape changes;
    /// `None`: it is flat there, or rigid.
    pub(crate) fn smooth_normal(&self, spot: MeshSpot, time: f32) -> Option<Vec3> {
        match &self.body {
            MoverMesh::Rigid(_) | MoverMesh::Changing(_) => None,
            MoverMesh::Deforming(deforming) => deforming.normal(spot, time),
        }
    }

    /// Whether its shape is read from a file.
    pub(super) fn is_read(&self) -> bool {
        let shape = self.driving.motion.shape.as_ref();
        shape.and_then(|shape| shape.cache.as_ref()).is_some_and(|cache| cache.is_read())
    }

    /// Whether its shape changes.
    pub(crate) fn bends(&self) -> bool {
        matches!(self.body, MoverMesh::Deforming(_))
    }
}

impl MoverMesh {
    /// Box around it at `time`, 0 to 1.
    fn bounds(&self, time: f32) -> [[f32; 3]; 2] {
        match self {
            MoverMesh::Rigid(of) => of.bounds(),
            MoverMesh::Deforming(deforming) => deforming.bounds(time),
            // That of all stages: no box is better than another where everything changes at once.
            MoverMesh::Changing(stages) => {
                let all = stages.iter().map(|stage| stage.of.bounds().map(Vec3::from));
                let around = all.reduce(|[low, high], [a, b]| [low.min(a), high.max(b)]);
                around.map_or([[0.0; 3]; 2], |ends| ends.map(|end| end.to_array()))
            }
        }
    }
}

/// The meshes of `sequence` that are present in `span`; `None`: they take more than `most_bytes`, or are far too many.
fn stages(engine: &Engine, sequence: &Sequence, span: Span, most_bytes: usize) -> Result<Option<Vec<MeshStage>>> {
    const MOST_STAGES: usize = 100_000;
    /// Embree's structure, vertices and indices.
    const TRIANGLE_BYTES: usize = 150;
    let mut stages: Vec<MeshStage> = Vec::new();
    let mut left = most_bytes;
    for (number, time) in sequence.between(span.start, span.start + span.length) {
        // Meshes that repeat are reused.
        let (mesh, of, bytes) = match stages.iter().find(|stage| stage.number == number) {
            Some(known) => (known.mesh.clone(), known.of.clone(), 0),
            None => {
                let mesh = sequence.load(number)?;
                let of = structure_of(&mesh, engine, Pace::Now)?;
                let bytes = mesh.triangle_count() * TRIANGLE_BYTES;
                (mesh, of, bytes)
            }
        };
        if bytes > left || stages.len() == MOST_STAGES {
            return Ok(None);
        }
        left -= bytes;
        stages.push(MeshStage { start: span.part(time), number, mesh, of, bytes });
    }
    Ok(Some(stages))
}

/// Which of `stages` is present at `time`, 0 to 1.
fn stage_at(stages: &[MeshStage], time: f32) -> usize {
    stages.partition_point(|stage| stage.start <= time).saturating_sub(1)
}

impl CustomShape for Mover {
    fn bounds(&self) -> Vec<[[f32; 3]; 2]> {
        /// Two boxes fit linear motion; rotation gains from more.
        const STEPS: usize = 3;
        if let MoverMesh::Deforming(deforming) = &self.body {
            return self.path.boxes(STEPS, deforming.times(), |time| deforming.bounds(time));
        }
        let always = self.body.bounds(0.0);
        self.path.boxes(STEPS, &[], |_| always)
    }

    fn intersect(&self, query: &mut Query) {
        let lanes = query.lanes();
        let (mut rays, mut active) = (LocalRays::new(), [0; MOST]);
        let times = query.times();
        let [ox, oy, oz] = query.origins();
        let [dx, dy, dz] = query.directions();
        let mut start = 0;
        while start < lanes {
            // Neighbours are mostly in the same piece.
            let piece = self.path.piece(times[start]);
            let run = start..start + times[start..].iter().take_while(|&&time| piece.covers(time)).count().max(1);
            start = run.end;
            if piece.is_visible() {
                active[run.clone()].copy_from_slice(&query.active()[run.clone()]);
                let from = [ox, oy, oz, dx, dy, dz].map(|row| &row[run.clone()]);
                aim::enter(piece.frame(), &times[run.clone()], from, rays.rows(lanes).map(|row| &mut row[run.clone()]));
            }
        }
        match &self.body {
            MoverMesh::Rigid(of) => query.forward(of, &mut rays, &active),
            MoverMesh::Deforming(deforming) => deforming.intersect(query, &mut rays, &active),
            MoverMesh::Changing(stages) => {
                let mut at = [0; MOST];
                at.iter_mut().zip(query.times()).for_each(|(at, &time)| *at = stage_at(stages, time));
                for (number, stage) in stages.iter().enumerate().filter(|(number, _)| at[..lanes].contains(number)) {
                    let there = std::array::from_fn(|lane| if at[lane] == number { active[lane] } else { 0 });
                    query.forward(&stage.of, &mut rays, &there);
                }
            }
        }
    }
}

impl Tables {
    /// The mover of an object, if it moves.
    pub(crate) fn mover(&self, object: u32) -> Option<&Mover> {
        self.movers.get(object as usize)?.as_deref()
    }

    /// A `normal` in the frame of `object`, transformed to the world frame at `time`; of any length.
    pub fn turned(&self, object: u32, normal: Vec3, time: f32) -> Vec3 {
        match self.mover(object) {
            Some(mover) => mover.path.at(time).normal(normal),
            None => self.normal_matrices[object as usize] * normal,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use model::motion::{Motion, Timeline};

    #[test]
    fn motion_takes_no_more_memory_than_it_may() {
        let part = Part::default()
            .positions(vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]].into())
            .triangles(vec![[0, 1, 2]].into());
        let mesh = Arc::new(Mesh::new("flag", vec![part]).unwrap());
        let engine = Engine::with_threads(1).unwrap();
        let turn = |key: u32| {
            let pose = DAffine3::from_rotation_z(f64::from(key));
            (0.01 * f64::from(key), pose)
        };
        let keys: Vec<_> = (0..100).map(turn).collect();
        let driving = DrivingMotion {
            name: "Flag".to_owned(),
            timeline: Arc::new(Timeline::through(&keys).unwrap()),
            motion: Motion { node: 0, node_from_object: DAffine3::IDENTITY, shape: None },
            mesh,
            sequence: None,
            tolerance: 1e-3,
            origin: DVec3::ZERO,
        };
        let span = Span { start: 0.0, length: 1.0 };
        let of = |most: usize| Mover::new(&engine, driving.clone(), span, &mut Known::default(), most);
        let bytes = of(1 << 22).unwrap().bytes();
        assert!((10_000..1 << 22).contains(&bytes), "{bytes}");
        assert_eq!(of(bytes).unwrap().bytes(), bytes);
        let error = of(bytes - 1).err().unwrap().to_string();
        assert!(error.contains("1 s") && error.contains("Flag") && error.contains("4 GiB"), "{error}");
    }
}
