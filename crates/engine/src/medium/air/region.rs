//! Where a medium is.

use glam::{DVec3, Vec3};
use ground::error::{Error, Result};
use ground::read::bounds::{ABOVE_ZERO, Bounds};
use ground::read::yaml;
use serde::de::{DeserializeOwned, Deserializer};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A part of space. World coordinates, metres.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Region {
    /// All of space.
    #[default]
    Everywhere,
    /// A shell around the sensor: the part of a beam between two distances along its path.
    Shell {
        /// Where it begins, m, at least 0.
        start_m: f64,
        /// How thick it is, m, above 0.
        length_m: f64,
    },
    /// A box along the axes of the world.
    Box {
        /// Least corner, m.
        min_m: [f64; 3],
        /// Greatest corner, m.
        max_m: [f64; 3],
    },
    /// A ball.
    Sphere {
        /// Its centre, m.
        center_m: [f64; 3],
        /// Its radius, m, above 0.
        radius_m: f64,
    },
    /// The space behind a plane, such as that of ground fog below a height: `{point_m: [0, 0, 2], normal: [0, 0, 1]}`.
    HalfSpace {
        /// A point of the plane, m.
        point_m: [f64; 3],
        /// Direction out of the medium, of any length but 0.
        normal: [f64; 3],
    },
}

/// Farthest corner or point that makes sense, m.
const FARTHEST_M: f64 = 1e8;

impl Region {
    pub(in crate::medium) fn check(&self, key: &str, bounds: &mut Bounds) -> Result<()> {
        let above_zero = [ABOVE_ZERO, FARTHEST_M];
        let mut point = |name: &str, point: [f64; 3]| -> Result<()> {
            for (axis, value) in point.into_iter().enumerate() {
                bounds.within(format_args!("{key}.{name}[{axis}]"), value, -FARTHEST_M, FARTHEST_M)?;
            }
            Ok(())
        };
        match *self {
            Region::Everywhere => Ok(()),
            Region::Shell { start_m, length_m } => {
                bounds.within(format_args!("{key}.start_m"), start_m, 0.0, FARTHEST_M)?;
                bounds.number(format_args!("{key}.length_m"), length_m, above_zero, "above 0")
            }
            Region::Box { min_m, max_m } => {
                point("box.min_m", min_m)?;
                point("box.max_m", max_m)?;
                for axis in 0..3 {
                    let near = (format!("{key}.box.min_m[{axis}]"), min_m[axis]);
                    bounds.rising(near, (format!("{key}.box.max_m[{axis}]"), max_m[axis]))?;
                }
                Ok(())
            }
            Region::Sphere { center_m, radius_m } => {
                point("sphere.center_m", center_m)?;
                bounds.number(format_args!("{key}.sphere.radius_m"), radius_m, above_zero, "above 0")
            }
            Region::HalfSpace { point_m, normal } => {
                point("half_space.point_m", point_m)?;
                point("half_space.normal", normal)?;
                if normal.iter().all(|along| along.abs() < 1e-6) {
                    let key = format!("{key}.half_space.normal");
                    return Err(Error::invalid(key, format!("{normal:?}"), "a direction longer than 1e-6"));
                }
                Ok(())
            }
        }
    }
}

/// Some weather, and where it is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Placed<T> {
    /// The weather.
    #[serde(flatten)]
    pub what: T,
    /// Where it is.
    #[serde(flatten, serialize_with = "write_region")]
    pub region: Region,
}

impl<T> From<T> for Placed<T> {
    /// The weather everywhere.
    fn from(what: T) -> Self {
        Placed { what, region: Region::Everywhere }
    }
}

/// Writes the keys that [`Placed`] reads.
fn write_region<S: serde::Serializer>(region: &Region, serializer: S) -> Result<S::Ok, S::Error> {
    match region {
        Region::Everywhere => BTreeMap::<&str, f64>::new().serialize(serializer),
        Region::Shell { start_m, length_m } => {
            BTreeMap::from([("start_m", start_m), ("length_m", length_m)]).serialize(serializer)
        }
        other => other.serialize(serializer),
    }
}

impl<'de, T: DeserializeOwned> Deserialize<'de> for Placed<T> {
    /// Reads the keys of the weather together with those of a region: `start_m` and `length_m`, or `box`, `sphere`,
    /// `half_space`.
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Shell {
            start_m: f64,
            length_m: f64,
        }
        let (place, rest) = yaml::split_keys(deserializer, &["start_m", "length_m", "box", "sphere", "half_space"])?;
        let region = match place.keys().collect::<Vec<_>>()[..] {
            [] => Region::Everywhere,
            ["box" | "sphere" | "half_space"] => place.read()?,
            ["start_m" | "length_m"] | ["start_m" | "length_m", "start_m" | "length_m"] => {
                let Shell { start_m, length_m } = place.read()?;
                Region::Shell { start_m, length_m }
            }
            [first, second, ..] => {
                let message =
                    format!("{second}: is given together with {first}; allowed: one region, or none for everywhere");
                return Err(serde::de::Error::custom(message));
            }
            [_] => unreachable!("only keys of regions are taken"),
        };
        Ok(Placed { what: rest.read()?, region })
    }
}

/// A [`Region`] in the coordinates of rays.
#[derive(Clone, Copy, Debug)]
pub enum Extent {
    Everywhere,
    Shell { start: f32, end: f32 },
    Box { min: Vec3, max: Vec3 },
    Sphere { center: Vec3, radius: f32 },
    HalfSpace { normal: Vec3, offset: f32 },
}

impl Extent {
    /// `origin`: world position of the rays' (0, 0, 0).
    pub fn new(region: Region, origin: DVec3) -> Extent {
        let local = |point: [f64; 3]| (DVec3::from(point) - origin).as_vec3();
        match region {
            Region::Everywhere => Extent::Everywhere,
            Region::Shell { start_m, length_m } => {
                Extent::Shell { start: start_m as f32, end: (start_m + length_m) as f32 }
            }
            Region::Box { min_m, max_m } => Extent::Box { min: local(min_m), max: local(max_m) },
            Region::Sphere { center_m, radius_m } => {
                Extent::Sphere { center: local(center_m), radius: radius_m as f32 }
            }
            Region::HalfSpace { point_m, normal } => {
                let normal = DVec3::from(normal).normalize();
                let offset = normal.dot(DVec3::from(point_m) - origin) as f32;
                Extent::HalfSpace { normal: normal.as_vec3(), offset }
            }
        }
    }

    /// Whether the interval of a beam depends only on distances from the sensor.
    pub(crate) fn is_around_the_sensor(&self) -> bool {
        matches!(self, Extent::Everywhere | Extent::Shell { .. })
    }

    /// The interval of a ray inside the region, as distances from its origin between 0 and `length`, m; `from > to`
    /// means nowhere. `travelled`: the beam's path up to the origin of the ray, m.
    pub fn interval(&self, org: Vec3, dir: Vec3, travelled: f32, length: f32) -> (f32, f32) {
        let (from, to) = match *self {
            Extent::Everywhere => (0.0, length),
            Extent::Shell { start, end } => (start - travelled, end - travelled),
            Extent::Box { min, max } => {
                let (mut from, mut to) = (f32::NEG_INFINITY, f32::INFINITY);
                for axis in 0..3 {
                    // Parallel to a pair of faces, which count as inside.
                    if dir[axis] == 0.0 {
                        if org[axis] < min[axis] || org[axis] > max[axis] {
                            return (1.0, 0.0);
                        }
                        continue;
                    }
                    let a = (min[axis] - org[axis]) / dir[axis];
                    let b = (max[axis] - org[axis]) / dir[axis];
                    from = from.max(a.min(b));
                    to = to.min(a.max(b));
                }
                (from, to)
            }
            Extent::Sphere { center, radius } => {
                let nearest = dir.dot(center - org);
                let half2 = radius * radius - (center - org - dir * nearest).length_squared();
                if half2 < 0.0 { (1.0, 0.0) } else { (nearest - half2.sqrt(), nearest + half2.sqrt()) }
            }
            Extent::HalfSpace { normal, offset } => {
                let (above, falling) = (normal.dot(org) - offset, -normal.dot(dir));
                let crossing = above / falling;
                match (above <= 0.0, falling > 0.0) {
                    (true, true) => (0.0, length),
                    (true, false) if falling == 0.0 => (0.0, length),
                    (true, false) => (0.0, crossing),
                    (false, true) => (crossing, length),
                    (false, false) => (1.0, 0.0),
                }
            }
        };
        (from.max(0.0), to.min(length))
    }
}
