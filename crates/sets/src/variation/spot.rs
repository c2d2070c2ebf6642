//! Places: on surfaces, in boxes, along lines.

use super::{PlaceSpec, RuleTarget, Space};
use crate::draw::Address;
use engine::scene::matches;
use engine::trace::LiveScene;
use glam::{DVec3, Vec3};
use ground::error::{Error, Result};
use rand_distr::{Distribution as _, StandardUniform};

/// A drawn place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Point {
    pub at: DVec3,
    /// Upward unit normal of the surface.
    pub normal: DVec3,
    /// Heading of objects there, about z, rad.
    pub heading: f64,
    /// The instance whose surface it is, if it is on one.
    pub instance: Option<u32>,
}

/// Surfaces that face up, from which points are drawn uniformly by area.
#[derive(Debug, Default)]
pub(crate) struct Patches {
    triangles: Vec<[DVec3; 3]>,
    /// Instance of each triangle.
    instances: Vec<u32>,
    /// Cumulative area: of each triangle and all before it, m^2.
    areas: Vec<f64>,
}

impl Patches {
    /// The surfaces of `target` in `live` that are not steeper than `steepest_deg`.
    ///
    /// # Errors
    /// Nothing matches, or nothing that matches faces up. `key` names the rule.
    pub fn new(live: &LiveScene, target: &RuleTarget, steepest_deg: f64, key: &str) -> Result<Patches> {
        let least = steepest_deg.to_radians().cos();
        let mut patches = Patches::default();
        let (mut area, mut known) = (0.0, false);
        let labels = live.labels();
        for (_, object) in live.objects() {
            let category = labels.category.name(object.category_id).unwrap_or("");
            let above = object.ancestors.iter().map(|node| &*node.name);
            if !target.takes(std::iter::once(object.name.as_str()).chain(above), category) {
                continue;
            }
            for (part, number) in object.mesh.parts.iter().zip(&object.part_ids) {
                let name = labels.part.name(*number).unwrap_or("");
                if target.part.as_ref().is_some_and(|pattern| !matches(pattern, name)) {
                    continue;
                }
                known = true;
                let corner = |index: u32| {
                    object.world_from_object.transform_point3(Vec3::from(part.positions[index as usize]).as_dvec3())
                };
                // Mirrored objects have reversed winding.
                let mirrored = object.world_from_object.matrix3.determinant() < 0.0;
                for triangle in part.triangles.iter() {
                    let [a, b, c] = triangle.map(corner);
                    let normal = (b - a).cross(c - a) * if mirrored { -1.0 } else { 1.0 };
                    if normal.z > 0.0 && normal.z >= least * normal.length() {
                        area += 0.5 * normal.length();
                        patches.triangles.push([a, b, c]);
                        patches.instances.push(object.instance_id);
                        patches.areas.push(area);
                    }
                }
            }
        }
        if !known {
            let what = if target.part.is_some() { &labels.part } else { &labels.category };
            let known: Vec<&str> = what.names.iter().map(String::as_str).take(20).collect();
            let known = if target.object.is_some() { "names of objects".to_owned() } else { known.join(", ") };
            return Err(Error::invalid(key, format!("{}, which matches nothing in the scene", target.shown()), known));
        }
        if patches.triangles.is_empty() {
            let found = format!("{}, of which nothing faces up", target.shown());
            return Err(Error::invalid(key, found, format!("surfaces not steeper than {steepest_deg} degrees")));
        }
        Ok(patches)
    }

    /// A place drawn uniformly from these surfaces, inside `within` if given; `None` if none was found there.
    pub fn draw(&self, within: Option<&Space>, address: &Address) -> Option<Point> {
        /// Maximum number of places that are drawn until one is in the box.
        const MOST_DRAWS: u32 = 1000;
        let mut stream = address.stream();
        let mut unit = || -> f64 { StandardUniform.sample(&mut stream) };
        let mut draw = || {
            let drawn_area = unit() * self.areas.last().copied().unwrap_or(0.0);
            let index = self.areas.partition_point(|area| *area <= drawn_area).min(self.triangles.len() - 1);
            let [a, b, c] = self.triangles[index];
            // Uniform in a parallelogram, whose other half is folded over.
            let (u, v) = (unit(), unit());
            let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
            let normal = (b - a).cross(c - a).normalize_or(DVec3::Z);
            let normal = if normal.z < 0.0 { -normal } else { normal };
            Point { at: a + (b - a) * u + (c - a) * v, normal, heading: 0.0, instance: Some(self.instances[index]) }
        };
        let Some(within) = within else { return Some(draw()) };
        (0..MOST_DRAWS).map(|_| draw()).find(|point| within.holds(point.at))
    }
}

impl PlaceSpec {
    /// A place of this kind; `patches` are its surfaces, if it is on any. `None` if none was found.
    pub fn draw(&self, patches: Option<&Patches>, address: &Address) -> Option<Point> {
        let mut stream = address.stream();
        let mut unit = || -> f64 { StandardUniform.sample(&mut stream) };
        let free = |at: DVec3, heading: f64| Point { at, normal: DVec3::Z, heading, instance: None };
        let mut point = match (patches, &self.within, &self.along) {
            (Some(patches), within, _) => patches.draw(within.as_ref(), address)?,
            (_, Some(space), _) => {
                let [low, high] = [space.min_m, space.max_m].map(DVec3::from_array);
                free(low + (high - low) * DVec3::new(unit(), unit(), unit()), 0.0)
            }
            (.., Some(points)) => {
                let ends = points.windows(2).map(|ends| [ends[0], ends[1]].map(DVec3::from_array));
                let mut left = unit() * ends.clone().map(|[a, b]| a.distance(b)).sum::<f64>();
                let last = ends.clone().next_back();
                let found = ends.clone().find(|[a, b]| {
                    left -= a.distance(*b);
                    left < 0.0
                });
                let [a, b] = found.or(last).unwrap_or_default();
                let (ahead, length) = (b - a, a.distance(b));
                let part = if length > 0.0 { ((left + length) / length).clamp(0.0, 1.0) } else { 0.0 };
                free(a + ahead * part, ahead.y.atan2(ahead.x))
            }
            (None, None, None) => free(DVec3::ZERO, 0.0),
        };
        if let Some(height) = &self.height_m {
            point.at.z += height.number(&address.of("height_m"));
        }
        Some(point)
    }
}
