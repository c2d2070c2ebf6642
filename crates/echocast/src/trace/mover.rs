//! Objects that move while they are scanned.

use super::{Surface, Tables};
use crate::ground::error::{Error, Result};
use crate::ground::lanes::LANES;
use crate::motion::{Motion, Path, Span, Timeline};
use echocast_kernels::aim;
use embree4::{CommittedScene, LocalRays, Query, Shape};
use glam::{DAffine3, DVec3, Vec3};
use std::sync::Arc;

/// An object on its way, as rays at their own times meet it.
pub(crate) struct Mover {
    pub path: Path,
    timeline: Arc<Timeline>,
    motion: Motion,
    /// Its mesh, in the object's frame.
    of: CommittedScene,
}

/// Most lanes of a packet.
const MOST: usize = 16;

impl Mover {
    /// An object with the mesh `of` that follows `timeline` through `span`; `origin` is the scene's.
    pub(super) fn new(
        timeline: &Arc<Timeline>,
        motion: &Motion,
        span: Span,
        origin: DVec3,
        of: CommittedScene,
    ) -> Mover {
        let path = path(timeline, motion, span, origin, of.bounds());
        Mover { path, timeline: timeline.clone(), motion: motion.clone(), of }
    }

    /// Where it is at `time`, s.
    pub(super) fn world_from_object(&self, time: f64) -> DAffine3 {
        self.timeline.world_from_node(self.motion.node, time) * self.motion.node_from_object
    }

    /// Whether it can be seen at `time`, s.
    pub(super) fn is_visible(&self, time: f64) -> bool {
        self.timeline.is_visible(self.motion.node, time)
    }

    /// Its way `period` s later than in `span`.
    fn later(&self, span: Span, period: f64, origin: DVec3) -> Path {
        let span = Span { start: span.start + period, ..span };
        path(&self.timeline, &self.motion, span, origin, self.of.bounds())
    }
}

fn path(timeline: &Timeline, motion: &Motion, span: Span, origin: DVec3, bounds: [[f32; 3]; 2]) -> Path {
    let mut bends = Vec::new();
    timeline.bends(motion.node, span.start, span.start + span.length, &mut bends);
    let pose = |time: f64| timeline.world_from_node(motion.node, time) * motion.node_from_object;
    Path::new(span, bends, bounds, origin, pose, |time| timeline.is_visible(motion.node, time))
}

/// Where the objects of a scene are one frame later, by number; `None` of those that stay.
pub(crate) struct Later(Vec<Option<Path>>);

impl Shape for Mover {
    fn bounds(&self) -> Vec<[[f32; 3]; 2]> {
        /// Two boxes fit what moves straight; what turns gains from more.
        const STEPS: usize = 3;
        let bounds = self.of.bounds();
        self.path.boxes(STEPS, |_| bounds)
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
        query.forward(&self.of, &mut rays, &active);
    }
}

/// From the times of beams to those of rays.
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

impl Tables {
    /// Where the scene moves, what the times of beams of a scan are that starts at `start_time`, s; all the same if it
    /// is to `freeze`.
    pub(crate) fn clock(&self, start_time: f64, freeze: bool) -> Option<Clock> {
        let Span { start, length } = self.span?;
        Some(Clock { offset: (start_time - start) / length, rate: if freeze { 0.0 } else { 1.0 / length } })
    }

    /// Where its objects are `period` s later.
    pub(crate) fn later(&self, period: f64) -> Later {
        let path = |mover: &Arc<Mover>| Some(mover.later(self.span?, period, self.origin));
        Later(self.movers.iter().map(|mover| mover.as_ref().and_then(path)).collect())
    }

    /// The point of an object, in its frame, where the second and the third corner of a `triangle` weigh `u` and `v`.
    fn point(&self, surface: &Surface, triangle: u32, [u, v]: [f32; 2]) -> Vec3 {
        let part = &self.surfaces.parts[surface.part as usize];
        let corner = |index: u32| Vec3::from(part.positions[index as usize]);
        let [a, b, c] = part.triangles[triangle as usize].map(corner);
        a * (1.0 - u - v) + b * u + c * v
    }

    /// How fast a point of a surface (a row, or [`super::MISS`]) moves at `time`, in the world, m/s; see
    /// [`Tables::point`].
    pub(crate) fn velocity(&self, surface: u32, triangle: u32, uv: [f32; 2], time: f32) -> Vec3 {
        let Some(row) = self.surfaces.rows.get(surface as usize) else { return Vec3::ZERO };
        if self.mover(row.object).is_none() {
            return Vec3::ZERO;
        }
        self.velocity_of(row.object, self.point(row, triangle, uv), time)
    }

    /// How fast the place `at` (object frame) of `object` moves at `time`, in the world, m/s.
    pub(super) fn velocity_of(&self, object: u32, at: Vec3, time: f32) -> Vec3 {
        let Some(mover) = self.mover(object) else { return Vec3::ZERO };
        let piece = mover.path.piece(time);
        piece.velocity(piece.part(time), at)
    }

    /// Where a point of a surface will be one frame after `time`, minus where it is, in the world, m.
    pub(crate) fn flow(&self, later: &Later, surface: u32, triangle: u32, uv: [f32; 2], time: f32) -> Vec3 {
        let Some(row) = self.surfaces.rows.get(surface as usize) else { return Vec3::ZERO };
        let Some(mover) = self.mover(row.object) else { return Vec3::ZERO };
        let Some(Some(then)) = later.0.get(row.object as usize) else { return Vec3::ZERO };
        let point = self.point(row, triangle, uv);
        then.at(time).to_local(point) - mover.path.at(time).to_local(point)
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

    /// Whether a surface (a row, or [`super::MISS`]) belongs to something that moves.
    pub(crate) fn moves(&self, surface: u32) -> bool {
        self.surfaces.rows.get(surface as usize).is_some_and(|row| self.mover(row.object).is_some())
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
