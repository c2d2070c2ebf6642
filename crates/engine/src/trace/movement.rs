//! How the points of surfaces move.

use super::deforming::Deforming;
use super::driving::{DrivingMotion, MOST_BYTES};
use super::{Mover, Surface, Tables};
use glam::{Mat3, Vec3};
use ground::error::Result;
use model::motion::{Path, Span};
use std::sync::OnceLock;

/// Poses of the objects of a scene one frame later.
pub struct Later {
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

impl DrivingMotion {
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
    /// Its motion `period` s later than in `span`.
    fn later(&self, span: Span, period: f64) -> Result<Next> {
        let span = Span { start: span.start + period, ..span };
        let shape = self.driving.shape(span, &mut self.moments().into(), MOST_BYTES)?;
        Ok(Next::Moves(self.driving.path(span, self.start_bounds(), MOST_BYTES)?, shape))
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
    /// Poses of its objects `period` s later; `None` where time is frozen.
    ///
    /// # Errors
    /// A vertex cache that can no longer be read.
    pub fn later(&self, period: f64) -> Result<Option<Later>> {
        let Some(span) = self.span else { return Ok(None) };
        let object = |number: u32| match self.mover(number) {
            // What may fail does so before the scan.
            Some(mover) if mover.is_read() => Ok(OnceLock::from(mover.later(span, period)?)),
            _ => Ok(OnceLock::new()),
        };
        let objects = (0..self.extents.len() as u32).map(object).collect::<Result<_>>()?;
        Ok(Some(Later { span, period, objects }))
    }

    /// [`Mover::point`] of a surface.
    fn point(&self, mover: &Mover, surface: &Surface, triangle: u32, uv: [f32; 2], time: f32) -> (Vec3, Vec3) {
        mover.point((surface.number, &self.surfaces.parts[surface.part as usize]), triangle, uv, time)
    }

    /// Whether a surface, a row, has the same triangles at all times, if perhaps at other places.
    pub(crate) fn keeps_triangles(&self, surface: u32) -> bool {
        let row = &self.surfaces.rows[surface as usize];
        self.mover(row.object).is_none_or(Mover::keeps_triangles)
    }

    /// The corners of a `triangle` of a surface, a row, at `time`, 0 to 1, in Embree's frame.
    pub(crate) fn corners(&self, surface: u32, triangle: u32, time: f32) -> [Vec3; 3] {
        let row = &self.surfaces.rows[surface as usize];
        match self.mover(row.object) {
            Some(mover) => {
                let at = mover.path.at(time);
                [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]].map(|uv| at.to_local(self.point(mover, row, triangle, uv, time).0))
            }
            None => {
                let part = &self.surfaces.parts[row.part as usize];
                let place = &self.extents[row.object as usize].world_from_object;
                let [a, b, c] = part.triangles[triangle as usize];
                let corner = |corner: u32| {
                    let position = Vec3::from(part.positions[corner as usize]).as_dvec3();
                    (place.transform_point3(position) - self.origin).as_vec3()
                };
                [corner(a), corner(b), corner(c)]
            }
        }
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
}
