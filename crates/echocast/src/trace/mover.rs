//! Objects that move while they are scanned.

use super::deforming::{Deforming, Known, MeshSpot, Moment};
use super::{Engine, Surface, Tables};
use crate::ground::error::{Error, Result};
use crate::ground::lanes::LANES;
use crate::motion::{MOST_BENDS, Motion, Path, Span, Timeline};
use crate::scene::{Mesh, Sequence};
use echocast_kernels::aim;
use embree4::{CommittedScene, CustomShape, LocalRays, Pace, Query};
use glam::{DAffine3, DMat3, DVec3, Mat3, Vec3};
use std::sync::{Arc, OnceLock};

/// A moving object, as rays hit it at their own times.
pub(crate) struct Mover {
    pub path: Path,
    /// Start of its time span, s.
    pub start: f64,
    driving: DrivingMotion,
    body: MoverMesh,
}

/// The motion of an object, and its tolerance.
#[derive(Clone)]
pub(crate) struct DrivingMotion {
    pub name: String,
    pub timeline: Arc<Timeline>,
    pub motion: Motion,
    pub mesh: Arc<Mesh>,
    /// Meshes that replace its own over time.
    pub sequence: Option<Arc<Sequence>>,
    /// Tolerance on the position of deforming surfaces, m.
    pub tolerance: f64,
    /// The scene's origin.
    pub origin: DVec3,
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

/// Poses of the objects of a scene one frame later.
pub(crate) struct Later {
    /// The time of the scan, and how much later, s.
    span: Span,
    period: f64,
    /// By number, computed on demand; few objects are hit.
    objects: Vec<OnceLock<Next>>,
}

/// How an object moves in one frame.
enum Next {
    Stays,
    Moves(Path, Option<Deforming>),
    /// Its motion takes too much memory to be represented.
    Unknown,
}

/// Most memory for the moving objects of one scene, bytes.
pub(super) const MOST_BYTES: usize = 4 << 30;

/// How a point moves.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Movement {
    /// In the world, m/s.
    pub velocity: Vec3,
    /// Its position one frame later minus its current one, in the world, m.
    pub flow: Vec3,
}

/// What takes a point back to where it was.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Return {
    /// Its earlier position minus its current one, in the world, m.
    pub way: Vec3,
    /// Matrix that transforms normals accordingly.
    pub normal: Mat3,
}

/// Most lanes of a packet.
const MOST: usize = 16;

impl DrivingMotion {
    /// Its path through `span`, given the `bounds` of its mesh, in no more than `most_bytes`.
    fn path(&self, span: Span, bounds: [[f32; 3]; 2], most_bytes: usize) -> Result<Path> {
        let DrivingMotion { timeline, motion, origin, .. } = self;
        if span.length == 0.0 {
            let place = DAffine3::from_translation(-*origin) * self.world_from_object(span.start);
            return Ok(Path::standing(&place, timeline.is_visible(motion.node, span.start)));
        }
        let end = span.start + span.length;
        if timeline.most_bends(motion.node, span.start, end) > MOST_BENDS {
            return Err(self.too_much(span));
        }
        let mut bends = Vec::new();
        timeline.bends(motion.node, span.start, end, &mut bends);
        let visible = |time: f64| timeline.is_visible(motion.node, time);
        let path = Path::new(span, bends, bounds, *origin, |time| self.world_from_object(time), visible, most_bytes);
        path.ok_or_else(|| self.too_much(span))
    }

    /// Its shape in `span`, if it changes, in no more than `most_bytes`; see [`Deforming::new`].
    fn shape(&self, span: Span, known: &mut Known, most_bytes: usize) -> Result<Option<Deforming>> {
        let Some(shape) = &self.motion.shape else { return Ok(None) };
        let deforming = Deforming::new(self, shape, span, known, most_bytes)?;
        deforming.ok_or_else(|| self.too_much(span)).map(Some)
    }

    pub(super) fn world_from_object(&self, time: f64) -> DAffine3 {
        self.timeline.world_from_node(self.motion.node, time) * self.motion.node_from_object
    }

    fn too_much(&self, span: Span) -> Error {
        let gib = MOST_BYTES >> 30;
        let allowed = format!(
            "a time short enough for moving objects to fit into {gib} GiB, which object {:?} does not",
            self.name
        );
        Error::invalid("time of a scan", format!("{} s", span.length), allowed)
    }

    /// How it moves from `span` to the same time `period` s later, provided that it is rigid.
    fn next(&self, span: Span, period: f64) -> Next {
        if self.timeline.stays(self.motion.node, span.start, span.start + period + span.length) {
            return Next::Stays;
        }
        let span = Span { start: span.start + period, ..span };
        let bounds = self.mesh.bounds().unwrap_or_default();
        self.path(span, bounds, MOST_BYTES).map_or(Next::Unknown, |path| Next::Moves(path, None))
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
            (None, None) => MoverMesh::Rigid(driving.mesh.structure_by(engine, Pace::Now)?),
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

    /// Its motion `period` s later than in `span`.
    fn later(&self, span: Span, period: f64) -> Result<Next> {
        let span = Span { start: span.start + period, ..span };
        let shape = self.driving.shape(span, &mut self.moments().into(), MOST_BYTES)?;
        Ok(Next::Moves(self.driving.path(span, self.body.bounds(0.0), MOST_BYTES)?, shape))
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
    fn is_read(&self) -> bool {
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
                let of = mesh.structure_by(engine, Pace::Now)?;
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
        let times: &[f32] = match &self.body {
            MoverMesh::Rigid(_) | MoverMesh::Changing(_) => &[],
            MoverMesh::Deforming(deforming) => deforming.times(),
        };
        self.path.boxes(STEPS, times, |time| self.body.bounds(time))
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

/// Converts the times of beams to those of rays.
#[derive(Clone, Copy)]
pub(crate) struct Clock {
    /// Start of the scan since that of the scene's time span, in lengths of that span.
    offset: f64,
    /// One over the length of the scene's time span, 1/s; 0 where time is frozen.
    rate: f64,
}

impl Clock {
    /// Times of rays of beams that fire `times` s after the start of the scan.
    pub(crate) fn set(&self, times: &[f64], to: &mut [f32; LANES]) {
        for (to, time) in to.iter_mut().zip(times) {
            *to = self.of(*time);
        }
    }

    /// The time of a ray of a beam that fires `time` s after the start of the scan.
    pub(crate) fn of(&self, time: f64) -> f32 {
        ((self.offset + time * self.rate) as f32).clamp(0.0, 1.0)
    }
}

impl Later {
    /// How object `number` moves, if it ever does.
    fn of(&self, number: u32, next: impl FnOnce(Span, f64) -> Next) -> &Next {
        let known = self.objects.get(number as usize);
        known.map_or(&Next::Stays, |known| known.get_or_init(|| next(self.span, self.period)))
    }
}

impl Tables {
    /// In a moving scene, the clock of a scan that starts at `start_time`, s; with `freeze` all its beams have the same
    /// time.
    pub(crate) fn clock(&self, start_time: f64, freeze: bool) -> Option<Clock> {
        let Span { start, length } = self.span?;
        Some(Clock { offset: (start_time - start) / length, rate: if freeze { 0.0 } else { 1.0 / length } })
    }

    /// Poses of its objects `period` s later; `None` where time is frozen.
    ///
    /// # Errors
    /// A vertex cache that can no longer be read.
    pub(crate) fn later(&self, period: f64) -> Result<Option<Later>> {
        let Some(span) = self.span else { return Ok(None) };
        let object = |number: u32| match self.mover(number) {
            // What may fail does so before the scan.
            Some(mover) if mover.is_read() => Ok(OnceLock::from(mover.later(span, period)?)),
            _ => Ok(OnceLock::new()),
        };
        let objects = (0..self.extents.len() as u32).map(object).collect::<Result<_>>()?;
        Ok(Some(Later { span, period, objects }))
    }

    /// The point of a surface of `mover` at `time` and the weights `uv` of the second and third corner of a `triangle`,
    /// and its velocity, m per length of the time span, both in its object's frame.
    fn point(&self, mover: &Mover, surface: &Surface, triangle: u32, uv: [f32; 2], time: f32) -> (Vec3, Vec3) {
        let part = match &mover.body {
            MoverMesh::Deforming(deforming) => return deforming.point((surface.number.into(), triangle, uv), time),
            MoverMesh::Rigid(_) => &self.surfaces.parts[surface.part as usize],
            MoverMesh::Changing(stages) => &stages[stage_at(stages, time)].mesh.parts[usize::from(surface.number)],
        };
        (part.point(triangle, uv), Vec3::ZERO)
    }

    /// What takes a point of a surface (a row, or [`super::MISS`]) at `time` back to `start`, both 0 to 1; `None`: it
    /// does not move. Where triangles change, it moves with the object as a whole.
    pub(crate) fn return_to(&self, surface: u32, triangle: u32, uv: [f32; 2], time: f32, start: f32) -> Option<Return> {
        let row = self.surfaces.rows.get(surface as usize)?;
        let mover = self.mover(row.object)?;
        let [now, then] = [time, start].map(|time| mover.path.at(time));
        let (point, _) = self.point(mover, row, triangle, uv, time);
        let before = if mover.bends() { self.point(mover, row, triangle, uv, start).0 } else { point };
        Some(Return { way: then.to_local(before) - now.to_local(point), normal: then.normals_from(now) })
    }

    /// How a point of a surface (a row, or [`super::MISS`]) moves at `time`, see [`Tables::point`]; its position one
    /// frame later is known only with `later`. `None`: it does not move.
    pub(crate) fn movement(
        &self,
        later: Option<&Later>,
        surface: u32,
        triangle: u32,
        uv: [f32; 2],
        time: f32,
    ) -> Option<Movement> {
        let row = self.surfaces.rows.get(surface as usize)?;
        let Some(mover) = self.mover(row.object) else {
            let flow = self.start_of(later?, row, triangle, uv, time)?;
            return Some(Movement { velocity: Vec3::ZERO, flow });
        };
        let piece = mover.path.piece(time);
        let part = piece.part(time);
        let at = piece.at_part(part);
        let (point, rate) = self.point(mover, row, triangle, uv, time);
        let mut velocity = Vec3::ZERO;
        if let Some(span) = self.span {
            velocity = piece.velocity(part, point);
            if mover.bends() {
                velocity += at.turn(rate / span.length as f32);
            }
        }
        let next = |span, period| mover.later(span, period).unwrap_or(Next::Unknown);
        let flow = match later.map_or(&Next::Stays, |later| later.of(row.object, next)) {
            Next::Stays => Vec3::ZERO,
            Next::Moves(path, shape) => {
                let to = shape.as_ref().map_or(point, |then| then.point((row.number.into(), triangle, uv), time).0);
                path.at(time).to_local(to) - at.to_local(point)
            }
            Next::Unknown => Vec3::NAN,
        };
        Some(Movement { velocity, flow })
    }

    /// How far a point of an object at rest will have moved one frame later, if it moves by then.
    fn start_of(&self, later: &Later, row: &Surface, triangle: u32, uv: [f32; 2], time: f32) -> Option<Vec3> {
        let driving = self.resting.get(row.object as usize)?.as_deref()?;
        match later.of(row.object, |span, period| driving.next(span, period)) {
            Next::Stays => None,
            Next::Moves(path, _) => {
                let point = self.surfaces.parts[row.part as usize].point(triangle, uv);
                let now = driving.world_from_object(later.span.start).transform_point3(point.as_dvec3()) - self.origin;
                Some(path.at(time).to_local(point) - now.as_vec3())
            }
            Next::Unknown => Some(Vec3::NAN),
        }
    }

    /// Checks that a scan from `start_time` on that takes `length`, s, is within the time span that the scene is
    /// prepared for.
    ///
    /// # Errors
    /// If something moves, and it is not.
    pub(crate) fn check_time(&self, start_time: f64, length: f64) -> Result<()> {
        // Sums of times are rounded.
        const SLACK: f64 = 1e-6;
        match self.span {
            Some(Span { start, length: whole })
                if start_time < start - SLACK || start_time + length > start + whole + SLACK =>
            {
                Err(Error::invalid(
                    "start_time",
                    format!("{start_time} s for a scan of {length} s"),
                    format!("within {start} to {} s, for which the moving scene was set", start + whole),
                ))
            }
            _ => Ok(()),
        }
    }

    /// The mover of an object, if it moves.
    pub(crate) fn mover(&self, object: u32) -> Option<&Mover> {
        self.movers.get(object as usize)?.as_deref()
    }

    /// A `normal` in the frame of `object`, transformed to the world frame at `time`; of any length.
    pub(crate) fn turned(&self, object: u32, normal: Vec3, time: f32) -> Vec3 {
        match self.mover(object) {
            Some(mover) => mover.path.at(time).normal(normal),
            None => self.normal_matrices[object as usize] * normal,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Part;

    #[test]
    fn motion_takes_no_more_memory_than_it_may() {
        let part = Part {
            positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]].into(),
            normals: None,
            uvs: None,
            alphas: None,
            triangles: vec![[0, 1, 2]].into(),
            material: None,
        };
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
