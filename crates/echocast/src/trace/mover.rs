//! Objects that move while they are scanned.

use super::bending::{Bending, Known, Moment, Spot};
use super::{Engine, Surface, Tables};
use crate::ground::error::{Error, Result};
use crate::ground::lanes::LANES;
use crate::motion::{MOST_BENDS, Motion, Path, Span, Timeline};
use crate::scene::{Mesh, Sequence};
use echocast_kernels::aim;
use embree4::{CommittedScene, LocalRays, Pace, Query, Shape};
use glam::{DAffine3, DMat3, DVec3, Mat3, Vec3};
use std::sync::{Arc, OnceLock};

/// An object on its way, as rays at their own times meet it.
pub(crate) struct Mover {
    pub path: Path,
    /// When it starts, s.
    pub start: f64,
    follows: Follows,
    body: Body,
}

/// What an object follows, and how exactly.
#[derive(Clone)]
pub(crate) struct Follows {
    pub name: String,
    pub timeline: Arc<Timeline>,
    pub motion: Motion,
    pub mesh: Arc<Mesh>,
    /// Meshes that take the place of its own.
    pub sequence: Option<Arc<Sequence>>,
    /// Greatest distance of what changes its shape from where it should be, m.
    pub tolerance: f64,
    /// The scene's origin.
    pub origin: DVec3,
}

/// The mesh of an object that moves, in the object's frame.
enum Body {
    /// It keeps its shape.
    Stiff(CommittedScene),
    Bending(Bending),
    /// One mesh takes the place of another.
    Changing(Vec<Stage>),
}

/// A mesh and from when it is there, 0 to 1.
struct Stage {
    start: f32,
    /// Which of the sequence it is.
    number: usize,
    mesh: Arc<Mesh>,
    of: CommittedScene,
    /// Memory that these take, unless an earlier stage has them too.
    bytes: usize,
}

/// Where the objects of a scene are one frame later.
pub(crate) struct Later {
    /// The time of the scan, and how much later, s.
    span: Span,
    period: f64,
    /// By number, once asked for; few objects are hit.
    objects: Vec<OnceLock<Next>>,
}

/// What becomes of an object in one frame.
enum Next {
    Stays,
    Moves(Path, Option<Bending>),
    /// It moves too much to be followed.
    Unknown,
}

/// Most memory for what moves in one scene, bytes.
pub(super) const MOST_BYTES: usize = 4 << 30;

/// How a point moves.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Movement {
    /// In the world, m/s.
    pub velocity: Vec3,
    /// Where it will be one frame later, minus where it is, in the world, m.
    pub flow: Vec3,
}

/// What brings a point back to where it was.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Return {
    /// Where it was, minus where it is, in the world, m.
    pub way: Vec3,
    /// What turns normals there.
    pub normal: Mat3,
}

/// Most lanes of a packet.
const MOST: usize = 16;

impl Follows {
    /// Its way through `span` around `bounds`, in no more than `most_bytes`.
    fn path(&self, span: Span, bounds: [[f32; 3]; 2], most_bytes: usize) -> Result<Path> {
        let Follows { timeline, motion, origin, .. } = self;
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

    /// Its shape in `span`, if it changes, in no more than `most_bytes`; see [`Bending::new`].
    fn shape(&self, span: Span, known: &mut Known, most_bytes: usize) -> Result<Option<Bending>> {
        let Some(shape) = &self.motion.shape else { return Ok(None) };
        let bending = Bending::new(self, shape, span, known, most_bytes)?;
        bending.ok_or_else(|| self.too_much(span)).map(Some)
    }

    pub(super) fn world_from_object(&self, time: f64) -> DAffine3 {
        self.timeline.world_from_node(self.motion.node, time) * self.motion.node_from_object
    }

    fn too_much(&self, span: Span) -> Error {
        let gib = MOST_BYTES >> 30;
        let allowed =
            format!("times in which what moves can be followed in {gib} GiB, as object {:?} cannot", self.name);
        Error::invalid("time of a scan", format!("{} s", span.length), allowed)
    }

    /// What becomes of it from `span` to the same time `period` s later, in which it keeps its shape.
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
    /// What moves through `span` as `follows` says; moments `known` already as in [`Bending::new`].
    ///
    /// # Errors
    /// Embree's: out of memory; a vertex cache that can no longer be read; motion that takes more than `most_bytes`.
    pub(super) fn new(
        engine: &Engine,
        follows: Follows,
        span: Span,
        known: &mut Known,
        most_bytes: usize,
    ) -> Result<Mover> {
        let body = match (follows.shape(span, known, most_bytes)?, &follows.sequence) {
            (Some(bending), _) => Body::Bending(bending),
            (None, Some(sequence)) => {
                let stages = stages(engine, sequence, span, most_bytes)?;
                Body::Changing(stages.ok_or_else(|| follows.too_much(span))?)
            }
            (None, None) => Body::Stiff(follows.mesh.structure_by(engine, Pace::Now)?),
        };
        let path = follows.path(span, body.bounds(0.0), most_bytes)?;
        Ok(Mover { path, start: span.start, follows, body })
    }

    /// Memory that its motion takes.
    pub(super) fn bytes(&self) -> usize {
        let body = match &self.body {
            Body::Stiff(_) => 0,
            Body::Bending(bending) => bending.bytes(),
            Body::Changing(stages) => stages.iter().map(|stage| stage.bytes).sum(),
        };
        self.path.bytes() + body
    }

    /// Where it is at `time`, s, and how it has turned: as its frame has, or its skeleton; `None`: it cannot be seen.
    pub(super) fn stance(&self, time: f64) -> Option<(DAffine3, DMat3)> {
        let Follows { timeline, motion, .. } = &self.follows;
        let world_from_object = self.follows.world_from_object(time);
        timeline.is_visible(motion.node, time).then(|| (world_from_object, self.turned(time, &world_from_object)))
    }

    /// How it has turned at `time`, s, where it is then.
    fn turned(&self, time: f64, world_from_object: &DAffine3) -> DMat3 {
        let turned = match &self.body {
            Body::Bending(bending) => bending.turned(&self.follows.timeline, time, world_from_object),
            Body::Stiff(_) | Body::Changing(_) => None,
        };
        world_from_object.matrix3 * turned.unwrap_or(DMat3::IDENTITY)
    }

    /// If its shape changes, passes the places of the corners of its triangles at `time`, 0 to 1, in the object's frame
    /// and how fast they move there, per length of the scan's time, to `visit`.
    pub(super) fn each_corner(&self, time: f32, visit: &mut dyn FnMut(Vec3, Vec3)) {
        match &self.body {
            Body::Stiff(_) => {}
            Body::Bending(bending) => bending.each_corner(time, visit),
            Body::Changing(stages) => {
                let Some(stage) = stages.get(stage_at(stages, time)) else { return };
                for part in &stage.mesh.parts {
                    let corners = part.triangles.iter().flatten();
                    corners.for_each(|&corner| visit(part.positions[corner as usize].into(), Vec3::ZERO));
                }
            }
        }
    }

    /// Whether it keeps its shape.
    pub(super) fn is_stiff(&self) -> bool {
        matches!(self.body, Body::Stiff(_))
    }

    /// Its way `period` s later than in `span`.
    fn later(&self, span: Span, period: f64) -> Result<Next> {
        let span = Span { start: span.start + period, ..span };
        let shape = self.follows.shape(span, &mut self.moments().into(), MOST_BYTES)?;
        Ok(Next::Moves(self.follows.path(span, self.body.bounds(0.0), MOST_BYTES)?, shape))
    }

    /// What is known of its shape, for the next scan.
    pub(super) fn moments(&self) -> &[Arc<Moment>] {
        match &self.body {
            Body::Stiff(_) | Body::Changing(_) => &[],
            Body::Bending(bending) => bending.moments(),
        }
    }

    /// The interpolated normal of a spot at `time` in the object's frame, of any length, where its shape changes;
    /// `None`: it is flat there, or keeps its shape.
    pub(crate) fn smooth_normal(&self, spot: Spot, time: f32) -> Option<Vec3> {
        match &self.body {
            Body::Stiff(_) | Body::Changing(_) => None,
            Body::Bending(bending) => bending.normal(spot, time),
        }
    }

    /// Whether its shape is read from a file.
    fn is_read(&self) -> bool {
        let shape = self.follows.motion.shape.as_ref();
        shape.and_then(|shape| shape.cache.as_ref()).is_some_and(|cache| cache.is_read())
    }

    /// Whether its shape changes.
    pub(crate) fn bends(&self) -> bool {
        matches!(self.body, Body::Bending(_))
    }
}

impl Body {
    /// Box around it at `time`, 0 to 1.
    fn bounds(&self, time: f32) -> [[f32; 3]; 2] {
        match self {
            Body::Stiff(of) => of.bounds(),
            Body::Bending(bending) => bending.bounds(time),
            // Of all: one box is as good as another where everything changes at once.
            Body::Changing(stages) => {
                let all = stages.iter().map(|stage| stage.of.bounds().map(Vec3::from));
                let around = all.reduce(|[low, high], [a, b]| [low.min(a), high.max(b)]);
                around.map_or([[0.0; 3]; 2], |ends| ends.map(|end| end.to_array()))
            }
        }
    }
}

/// The meshes of `sequence` that are there in `span`; `None`: they take more than `most_bytes`, or are far too many.
fn stages(engine: &Engine, sequence: &Sequence, span: Span, most_bytes: usize) -> Result<Option<Vec<Stage>>> {
    const MOST_STAGES: usize = 100_000;
    /// Of Embree's structure, corners and indices.
    const TRIANGLE_BYTES: usize = 150;
    let mut stages: Vec<Stage> = Vec::new();
    let mut left = most_bytes;
    for (number, time) in sequence.between(span.start, span.start + span.length) {
        // Those that repeat come back.
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
        stages.push(Stage { start: span.part(time), number, mesh, of, bytes });
    }
    Ok(Some(stages))
}

/// Which of `stages` is there at `time`, 0 to 1.
fn stage_at(stages: &[Stage], time: f32) -> usize {
    stages.partition_point(|stage| stage.start <= time).saturating_sub(1)
}

impl Shape for Mover {
    fn bounds(&self) -> Vec<[[f32; 3]; 2]> {
        /// Two boxes fit what moves straight; what turns gains from more.
        const STEPS: usize = 3;
        let times: &[f32] = match &self.body {
            Body::Stiff(_) | Body::Changing(_) => &[],
            Body::Bending(bending) => bending.times(),
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
            Body::Stiff(of) => query.forward(of, &mut rays, &active),
            Body::Bending(bending) => bending.intersect(query, &mut rays, &active),
            Body::Changing(stages) => {
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

/// From the times of beams to those of rays.
#[derive(Clone, Copy)]
pub(crate) struct Clock {
    /// Time of the scan's start since the scene's, in lengths of the scene's time.
    offset: f64,
    /// One over the length of the scene's time, 1/s; 0 where time stands still.
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
    /// What becomes of object `number`, if it ever moves.
    fn of(&self, number: u32, next: impl FnOnce(Span, f64) -> Next) -> &Next {
        let known = self.objects.get(number as usize);
        known.map_or(&Next::Stays, |known| known.get_or_init(|| next(self.span, self.period)))
    }
}

impl Tables {
    /// Where the scene moves, what the times of beams of a scan are that starts at `start_time`, s; all the same if it
    /// is to `freeze`.
    pub(crate) fn clock(&self, start_time: f64, freeze: bool) -> Option<Clock> {
        let Span { start, length } = self.span?;
        Some(Clock { offset: (start_time - start) / length, rate: if freeze { 0.0 } else { 1.0 / length } })
    }

    /// Where its objects are `period` s later; `None` where time stands still.
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

    /// The point of a surface of `mover`, in its object's frame, where at `time` the second and the third corner of a
    /// `triangle` weigh `u` and `v`, and how fast it moves there, m per length of the scan's time.
    fn point(&self, mover: &Mover, surface: &Surface, triangle: u32, uv: [f32; 2], time: f32) -> (Vec3, Vec3) {
        let part = match &mover.body {
            Body::Bending(bending) => return bending.point((surface.number.into(), triangle, uv), time),
            Body::Stiff(_) => &self.surfaces.parts[surface.part as usize],
            Body::Changing(stages) => &stages[stage_at(stages, time)].mesh.parts[usize::from(surface.number)],
        };
        (part.point(triangle, uv), Vec3::ZERO)
    }

    /// What brings a point of a surface (a row, or [`super::MISS`]) at `time` back to `start`, both 0 to 1; `None`: it
    /// stays. Where triangles change, it goes with the object as a whole.
    pub(crate) fn return_to(&self, surface: u32, triangle: u32, uv: [f32; 2], time: f32, start: f32) -> Option<Return> {
        let row = self.surfaces.rows.get(surface as usize)?;
        let mover = self.mover(row.object)?;
        let [now, then] = [time, start].map(|time| mover.path.at(time));
        let (point, _) = self.point(mover, row, triangle, uv, time);
        let before = if mover.bends() { self.point(mover, row, triangle, uv, start).0 } else { point };
        Some(Return { way: then.to_local(before) - now.to_local(point), normal: then.normals_from(now) })
    }

    /// How a point of a surface (a row, or [`super::MISS`]) moves at `time`, see [`Tables::point`]; where it will be one
    /// frame later is known with `later` alone. `None`: it stays.
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

    /// Where a point of an object that stands will be one frame later, minus where it is, if it moves by then.
    fn start_of(&self, later: &Later, row: &Surface, triangle: u32, uv: [f32; 2], time: f32) -> Option<Vec3> {
        let follows = self.resting.get(row.object as usize)?.as_deref()?;
        match later.of(row.object, |span, period| follows.next(span, period)) {
            Next::Stays => None,
            Next::Moves(path, _) => {
                let point = self.surfaces.parts[row.part as usize].point(triangle, uv);
                let now = follows.world_from_object(later.span.start).transform_point3(point.as_dvec3()) - self.origin;
                Some(path.at(time).to_local(point) - now.as_vec3())
            }
            Next::Unknown => Some(Vec3::NAN),
        }
    }

    /// Checks that a scan from `start_time` on that takes `length`, s, lies in the time that the scene is prepared for.
    ///
    /// # Errors
    /// If something moves, and it does not.
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

    /// The object of a row, if it moves.
    pub(crate) fn mover(&self, object: u32) -> Option<&Mover> {
        self.movers.get(object as usize)?.as_deref()
    }

    /// The `normal` of `object` in its own frame in the world's, at `time`; of any length.
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
        let follows = Follows {
            name: "Flag".to_owned(),
            timeline: Arc::new(Timeline::through(&keys).unwrap()),
            motion: Motion { node: 0, node_from_object: DAffine3::IDENTITY, shape: None },
            mesh,
            sequence: None,
            tolerance: 1e-3,
            origin: DVec3::ZERO,
        };
        let span = Span { start: 0.0, length: 1.0 };
        let of = |most: usize| Mover::new(&engine, follows.clone(), span, &mut Known::default(), most);
        let bytes = of(1 << 22).unwrap().bytes();
        assert!((10_000..1 << 22).contains(&bytes), "{bytes}");
        assert_eq!(of(bytes).unwrap().bytes(), bytes);
        let error = of(bytes - 1).err().unwrap().to_string();
        assert!(error.contains("1 s") && error.contains("Flag") && error.contains("4 GiB"), "{error}");
    }
}
