//! The facets of a row of surfaces at one moment.

use super::images::Mirror;
use crate::trace::Tables;
use glam::{DAffine3, DMat3, DVec3, Vec3};
use ground::math::cofactors;
use std::ops::Range;

/// A row of surfaces that may be in a radar's view.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RadarRow {
    /// Row of [`crate::trace::Surfaces`].
    pub row: u32,
    /// Sphere around it: middle, relative to the scene's origin, and radius, m.
    pub middle: DVec3,
    pub radius: f64,
    /// Number of its triangles.
    pub triangles: usize,
    /// World from object; `None`: its shape changes.
    place: Option<DAffine3>,
}

/// Where an object is.
#[derive(Clone, Copy, Debug)]
struct RadarObject {
    middle: DVec3,
    radius: f64,
    place: Option<DAffine3>,
}

/// The facets of a row, read out in double precision: the phase of a wave depends on fractions of a millimetre.
pub(crate) struct RowFacets<'a> {
    scene: &'a Tables,
    of: RadarRow,
    time: f32,
}

impl Tables {
    /// The rows that scans with this `mask` see at `time`, s, of which `part` is the part of the time span.
    pub(crate) fn radar_rows(&self, time: f64, part: f32, mask: u32) -> Vec<RadarRow> {
        let mut last: Option<(u32, Option<RadarObject>)> = None;
        let mut rows = Vec::new();
        for (row, surface) in (0..).zip(&self.surfaces.rows) {
            let triangles = self.surfaces.parts[surface.part as usize].triangles.len();
            let object = match &last {
                Some((object, known)) if *object == surface.object => *known,
                _ => {
                    let known = self.radar_object(surface.object, time, part, mask);
                    last = Some((surface.object, known));
                    known
                }
            };
            let Some(RadarObject { middle, radius, place }) = object else { continue };
            if triangles > 0 {
                rows.push(RadarRow { row, middle, radius, triangles, place });
            }
        }
        rows
    }

    /// Where an object is.
    fn radar_object(&self, object: u32, time: f64, part: f32, mask: u32) -> Option<RadarObject> {
        let (place, _) = self.transform_at(object, time, mask)?;
        let to_origin = DAffine3::from_translation(-self.origin);
        let stiff = self.mover(object).is_none_or(|mover| mover.is_stiff());
        let [low, high] = if stiff {
            // Of a box the corners suffice.
            let [low, high] = self.extents[object as usize].bounds?.map(|end| DVec3::from(end.map(f64::from)));
            let half = 0.5 * (high - low);
            let middle = to_origin.transform_point3(place.transform_point3(0.5 * (low + high)));
            let DMat3 { x_axis, y_axis, z_axis } = place.matrix3;
            let reach = (x_axis * half.x).abs() + (y_axis * half.y).abs() + (z_axis * half.z).abs();
            [middle - reach, middle + reach]
        } else {
            let at = self.mover(object)?.path.at(part);
            let mut ends = [DVec3::INFINITY, DVec3::NEG_INFINITY];
            self.each_corner(object, part, &mut |corner| {
                let place = at.to_local(corner.as_vec3()).as_dvec3();
                ends = [ends[0].min(place), ends[1].max(place)];
            });
            ends
        };
        let place = stiff.then(|| to_origin * place);
        let (middle, radius) = (0.5 * (low + high), 0.5 * (high - low).length());
        (low.x <= high.x).then_some(RadarObject { middle, radius, place })
    }

    /// The facets of a row at `time`, 0 to 1.
    pub(crate) fn row_facets(&self, of: RadarRow, time: f32) -> RowFacets<'_> {
        RowFacets { scene: self, of, time }
    }

    /// The number of the plane that a triangle lies in among those of its row, if it is one of the large ones of a row
    /// that keeps its shape.
    pub(super) fn plane_number(&self, of: &RadarRow, triangle: u32) -> Option<usize> {
        of.place?;
        self.surfaces.planes(self.surfaces.rows[of.row as usize].part).of(triangle)
    }

    /// A plane of a row; `None`: it is nowhere or has no extent.
    pub(super) fn plane(&self, of: &RadarRow, number: usize) -> Option<Mirror> {
        let row = &self.surfaces.rows[of.row as usize];
        let (place, plane) = (of.place?, *self.surfaces.planes(row.part).all().get(number)?);
        let across = cofactors(&place.matrix3) * plane.normal;
        let scale = across.length();
        let DMat3 { x_axis, y_axis, z_axis } = place.matrix3;
        let stretch = x_axis.length().max(y_axis.length()).max(z_axis.length());
        let mirror = Mirror {
            normal: across / scale,
            point: place.transform_point3(plane.point),
            area: plane.area * scale,
            radius: plane.radius * stretch,
            row: of.row,
            object: row.object,
        };
        (scale > 0.0).then_some(mirror)
    }
}

impl RowFacets<'_> {
    /// The corners of a triangle, relative to the scene's origin, m.
    pub fn corners(&self, triangle: u32) -> [DVec3; 3] {
        match &self.of.place {
            Some(place) => {
                let surfaces = &self.scene.surfaces;
                let part = &surfaces.parts[surfaces.rows[self.of.row as usize].part as usize];
                part.triangles[triangle as usize].map(|corner| {
                    place.transform_point3(DVec3::from_array(part.positions[corner as usize].map(f64::from)))
                })
            }
            None => self.scene.corners(self.of.row, triangle, self.time).map(|corner| corner.as_dvec3()),
        }
    }

    /// Which edges of a triangle, from its first, second and third corner on, are between triangles of one plane.
    pub fn inner(&self, triangle: u32) -> [bool; 3] {
        let surfaces = &self.scene.surfaces;
        // What changes its shape may bend there.
        self.of.place.map_or([false; 3], |_| surfaces.planes(surfaces.rows[self.of.row as usize].part).inner(triangle))
    }

    /// Velocity of the middle of a triangle, m/s, world.
    pub fn velocity(&self, triangle: u32) -> Vec3 {
        let movement = self.scene.movement(None, self.of.row, triangle, [1.0 / 3.0; 2], self.time);
        movement.map_or(Vec3::ZERO, |movement| movement.velocity)
    }

    /// Their numbers.
    pub fn triangles(&self) -> Range<u32> {
        0..self.of.triangles as u32
    }
}
