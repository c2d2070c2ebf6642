//! Boxes of rigid objects: what sound may hit between its rays.

use super::{Surface, Tables};
use glam::{DMat3, DVec3};
use model::material::Sound;

/// A rigid object that does not scatter as a whole.
#[derive(Clone, Copy, Debug)]
pub struct Body {
    /// As in [`super::Surface::object`].
    pub object: u32,
    /// Its first row of surfaces.
    pub row: u32,
    /// Whether it has smooth facets: see [`Sound::Facet`].
    pub mirrors: bool,
    /// Middle, relative to the scene's origin, and radius of its box, m; `None`: it moves.
    pub sphere: Option<(DVec3, f64)>,
}

/// The box of a body at its pose.
#[derive(Clone, Copy, Debug)]
pub struct Stand {
    pub body: Body,
    /// Relative to the scene's origin, m.
    pub middle: DVec3,
    /// Half its edges, m.
    pub halves: [DVec3; 3],
    /// World from object, without the translation.
    pub linear: DMat3,
}

impl Stand {
    /// Half the diagonal, m.
    pub fn radius(&self) -> f64 {
        self.halves.iter().map(|half| half.length_squared()).sum::<f64>().sqrt()
    }

    /// The rectangle that encloses its outline as seen along the unit `direction`: half its sides, m, at right angles
    /// to each other; the first is along the longest extent of the box.
    pub fn outline(&self, direction: DVec3) -> [DVec3; 2] {
        let across = self.halves.map(|half| half - half.dot(direction) * direction);
        let longest = across.into_iter().max_by(|a, b| a.length_squared().total_cmp(&b.length_squared()));
        let along = longest.and_then(DVec3::try_normalize).unwrap_or_else(|| direction.any_orthonormal_vector());
        let aside = direction.cross(along);
        [along, aside].map(|side| side * across.iter().map(|half| half.dot(side).abs()).sum::<f64>())
    }
}

impl Tables {
    /// The bodies of the scene.
    pub fn bodies(&self) -> &[Body] {
        self.bodies.get_or_init(|| {
            let rows = &self.surfaces.rows;
            let mut first = 0;
            let next = |rows: &[Surface]| {
                first += rows.len() as u32;
                self.body(first - rows.len() as u32, rows)
            };
            rows.chunk_by(|a, b| a.object == b.object).filter_map(next).collect()
        })
    }

    /// The body with the `rows` from `first` on, if they are those of one.
    fn body(&self, first: u32, rows: &[Surface]) -> Option<Body> {
        let law = |row: &Surface| self.surfaces.materials[row.material as usize].sound_law();
        if rows.iter().filter_map(law).any(|law| law.target_strength_db().is_some()) {
            return None;
        }
        let object = rows.first()?.object;
        let mirrors = rows.iter().filter_map(law).any(Sound::is_smooth);
        let body = Body { object, row: first, mirrors, sphere: None };
        if let Some(mover) = self.mover(object) {
            return mover.is_stiff().then_some(body);
        }
        let stand = self.stand(body, 0.0, u32::MAX)?;
        Some(Body { sphere: Some((stand.middle, stand.radius())), ..body })
    }

    /// The box of a body at `time`, s; `None` if scans with this mask do not see it then.
    pub fn stand(&self, body: Body, time: f64, mask: u32) -> Option<Stand> {
        let (place, _) = self.transform_at(body.object, time, mask)?;
        let [low, high] = self.extents[body.object as usize].bounds?.map(|end| DVec3::from(end.map(f64::from)));
        let (half, linear) = (0.5 * (high - low), place.matrix3);
        let middle = place.transform_point3(0.5 * (low + high)) - self.origin;
        let halves = [linear.x_axis * half.x, linear.y_axis * half.y, linear.z_axis * half.z];
        Some(Stand { body, middle, halves, linear })
    }
}
