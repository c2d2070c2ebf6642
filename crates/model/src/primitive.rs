//! Bodies given by a few numbers.

use crate::mesh::{Mesh, Part};
use crate::quadric::Quadric;
use glam::DVec3;
use ground::error::{Error, Result};
use ground::read::bounds::{ABOVE_ZERO, Bounds};
use ground::read::yaml::Document;
use quickhull::ConvexTriangleMesh;
use serde::Deserialize;
use std::f64::consts::{PI, TAU};
use std::ops::Range;

/// A body given by a few numbers, about the origin of its frame. In files it is a section of its name:
/// `{sphere: {radius_m: 0.5}}`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
#[non_exhaustive]
pub enum PrimitiveShape {
    /// A rectangle at z = 0.
    Plane {
        /// Its lengths along x and y, m.
        size_m: [f64; 2],
    },
    /// A box.
    Box {
        /// Its lengths, m.
        size_m: [f64; 3],
    },
    /// A ball.
    Sphere {
        /// Its radius, m.
        radius_m: f64,
    },
    /// An ellipsoid.
    Ellipsoid {
        /// Its half axes, m.
        radii_m: [f64; 3],
    },
    /// A cylinder about the z axis with half a ball at each end.
    Capsule {
        /// Its radius, m.
        radius_m: f64,
        /// Its length between the balls, m.
        length_m: f64,
    },
    /// A cylinder about the z axis, closed at its ends.
    Cylinder {
        /// Its radius, m.
        radius_m: f64,
        /// Its length, m.
        length_m: f64,
    },
    /// A cone about the z axis, closed below, from its base at z = `-length_m / 2` to its tip at `length_m / 2`.
    Cone {
        /// Radius of its base, m.
        radius_m: f64,
        /// Its length, m.
        length_m: f64,
    },
    /// Ground whose heights are at equal distances from each other. Cells are cut from the corner of least x and y to that of
    /// greatest, as those of MuJoCo.
    HeightField {
        /// Its lengths along x and y, m.
        size_m: [f64; 2],
        /// Heights z, m, row by row from least to greatest y: two rows or more, of as many heights each, two or more.
        heights_m: Vec<Vec<f64>>,
    },
    /// The convex hull of points.
    Hull {
        /// Four points or more, m, not all in one plane.
        points_m: Vec<[f64; 3]>,
    },
}

/// Least and greatest distance between a curved surface and the triangles that stand for it, m.
const TOLERANCES_M: [f64; 2] = [1e-6, 1.0];

/// Greatest length of anything, m.
const LONGEST_M: f64 = 1e6;

/// Most cells of a height field: triangles and what is built from them to trace them take about 250 bytes a cell.
const MOST_CELLS: usize = 20_000_000;

impl PrimitiveShape {
    /// Reads it from YAML text: `{box: {size_m: [1, 2, 3]}}`.
    ///
    /// # Errors
    /// The line and the key, what was found and what is allowed.
    pub fn from_yaml(text: &str) -> Result<PrimitiveShape> {
        let document = Document::parse("YAML text", text)?;
        let shape: PrimitiveShape = document.read()?;
        shape.check(&mut Bounds::none()).map_err(|error| document.locate(error))?;
        Ok(shape)
    }

    /// Its name in files.
    pub fn name(&self) -> &'static str {
        match self {
            PrimitiveShape::Plane { .. } => "plane",
            PrimitiveShape::Box { .. } => "box",
            PrimitiveShape::Sphere { .. } => "sphere",
            PrimitiveShape::Ellipsoid { .. } => "ellipsoid",
            PrimitiveShape::Capsule { .. } => "capsule",
            PrimitiveShape::Cylinder { .. } => "cylinder",
            PrimitiveShape::Cone { .. } => "cone",
            PrimitiveShape::HeightField { .. } => "height_field",
            PrimitiveShape::Hull { .. } => "hull",
        }
    }

    /// Checks that all lengths are above 0 and up to 1e6 m, and heights and points within 1e6 m.
    ///
    /// # Errors
    /// The key, what it is and what is allowed.
    pub fn check(&self, bounds: &mut Bounds) -> Result<()> {
        let length = |bounds: &mut Bounds, key: &str, value: f64| bounds.within(key, value, ABOVE_ZERO, LONGEST_M);
        let name = self.name();
        bounds.section(name, |bounds| match self {
            PrimitiveShape::Plane { size_m } => size_m.iter().try_for_each(|&size| length(bounds, "size_m", size)),
            PrimitiveShape::Box { size_m } => size_m.iter().try_for_each(|&size| length(bounds, "size_m", size)),
            PrimitiveShape::Ellipsoid { radii_m } => {
                radii_m.iter().try_for_each(|&half| length(bounds, "radii_m", half))
            }
            PrimitiveShape::Sphere { radius_m } => length(bounds, "radius_m", *radius_m),
            PrimitiveShape::Capsule { radius_m, length_m }
            | PrimitiveShape::Cylinder { radius_m, length_m }
            | PrimitiveShape::Cone { radius_m, length_m } => {
                length(bounds, "radius_m", *radius_m)?;
                length(bounds, "length_m", *length_m)
            }
            PrimitiveShape::HeightField { size_m, heights_m } => {
                size_m.iter().try_for_each(|&size| length(bounds, "size_m", size))?;
                let (rows, columns) = (heights_m.len(), heights_m.first().map_or(0, Vec::len));
                let found = format!("{rows} rows of {columns} heights");
                if rows < 2 || columns < 2 || rows.saturating_mul(columns) > MOST_CELLS {
                    let allowed = format!("two or more of two or more each, {MOST_CELLS} in all at most");
                    return Err(Error::invalid(format!("{name}.heights_m"), found, allowed));
                }
                for (row, heights) in heights_m.iter().enumerate() {
                    if heights.len() != columns {
                        let found = format!("{} heights", heights.len());
                        return Err(Error::invalid(
                            format!("{name}.heights_m[{row}]"),
                            found,
                            format!("{columns}, as in the first row"),
                        ));
                    }
                    heights.iter().try_for_each(|&z| bounds.within("heights_m", z, -LONGEST_M, LONGEST_M))?;
                }
                Ok(())
            }
            PrimitiveShape::Hull { points_m } => {
                if points_m.len() < 4 {
                    return Err(Error::invalid(
                        format!("{name}.points_m"),
                        format!("{} points", points_m.len()),
                        "four or more",
                    ));
                }
                points_m.iter().flatten().try_for_each(|&x| bounds.within("points_m", x, -LONGEST_M, LONGEST_M))
            }
        })
    }

    /// Its mesh, called `name`. Triangles stand for curved surfaces, at most `tolerance_m` from them, 1e-6 to 1 m; rays that
    /// hit these triangles meet the surface itself, so that only its outline is coarse.
    ///
    /// # Errors
    /// As [`PrimitiveShape::check`]; a tolerance out of its bounds; points of a hull that are all in one plane.
    pub fn mesh(&self, name: impl Into<String>, tolerance_m: f64) -> Result<Mesh> {
        let mut bounds = Bounds::none();
        self.check(&mut bounds)?;
        bounds.within("tolerance_m", tolerance_m, TOLERANCES_M[0], TOLERANCES_M[1])?;
        Mesh::new(name, vec![self.part(tolerance_m)?])
    }

    fn part(&self, tolerance: f64) -> Result<Part> {
        Ok(match *self {
            PrimitiveShape::Plane { size_m: [x, y] } => {
                let corners = [[-x, -y], [x, -y], [x, y], [-x, y]].map(|[x, y]| DVec3::new(0.5 * x, 0.5 * y, 0.0));
                plain(&corners, vec![[0, 1, 2], [0, 2, 3]])
            }
            PrimitiveShape::Box { size_m } => cuboid(0.5 * DVec3::from_array(size_m)),
            PrimitiveShape::Sphere { radius_m } => ellipsoid(DVec3::splat(radius_m), tolerance),
            PrimitiveShape::Ellipsoid { radii_m } => ellipsoid(DVec3::from_array(radii_m), tolerance),
            PrimitiveShape::Capsule { radius_m, length_m } => capsule(radius_m, 0.5 * length_m, tolerance),
            PrimitiveShape::Cylinder { radius_m, length_m } => {
                let (half, sides) = (0.5 * length_m, sides(radius_m, tolerance, 4.0));
                let rim = radius_m * balanced((PI / f64::from(sides)).cos());
                let side = (1..2, Quadric::lathed(radius_m, 0.0, [-half, half]));
                lathed(&[[0.0, -half], [rim, -half], [rim, half], [0.0, half]], DVec3::ONE, sides, &[side])
            }
            PrimitiveShape::Cone { radius_m, length_m } => {
                let (half, sides) = (0.5 * length_m, sides(radius_m, tolerance, 4.0));
                let rim = radius_m * balanced((PI / f64::from(sides)).cos());
                let side = (1..2, Quadric::lathed(0.5 * radius_m, -radius_m / length_m, [-half, half]));
                lathed(&[[0.0, -half], [rim, -half], [0.0, half]], DVec3::ONE, sides, &[side])
            }
            PrimitiveShape::HeightField { size_m, ref heights_m } => height_field(size_m, heights_m),
            PrimitiveShape::Hull { ref points_m } => hull(points_m)?,
        })
    }
}

/// Corners and triangles of flat faces.
fn plain(corners: &[DVec3], triangles: Vec<[u32; 3]>) -> Part {
    let positions: Vec<[f32; 3]> = corners.iter().map(|corner| corner.as_vec3().to_array()).collect();
    Part::default().positions(positions.into()).triangles(triangles.into())
}

fn cuboid(half: DVec3) -> Part {
    let corners: Vec<DVec3> = (0..8)
        .map(|corner| {
            half * DVec3::from_array(std::array::from_fn(|axis| if corner >> axis & 1 == 1 { 1.0 } else { -1.0 }))
        })
        .collect();
    // Of each side, counter-clockwise from outside.
    let sides: [[u32; 4]; 6] = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    plain(&corners, sides.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect())
}

/// Sides of a circle of a radius, m, whose triangles are within the tolerance: `share` is the ratio of the square of half the
/// angle of a side to the relative distance, to second order.
fn sides(radius: f64, tolerance: f64, share: f64) -> u32 {
    /// Fewer are no circle, more are finer than single precision.
    const SIDES: [f64; 2] = [12.0, 4096.0];
    // Even: half as many bands are from pole to pole.
    2 * (0.5 * (PI / (share * tolerance / radius).sqrt()).clamp(SIDES[0], SIDES[1])).ceil() as u32
}

/// Factor of the corners of a round surface whose triangles reach in to `nearest` of them, so that they are as far outside of it
/// as inside.
fn balanced(nearest: f64) -> f64 {
    2.0 / (1.0 + nearest)
}

/// Half the bands of a half ball, from its pole at -90 degrees to its equator: radius and height of each ring for a radius of 1.
fn quarter(bands: u32) -> impl DoubleEndedIterator<Item = [f64; 2]> {
    (0..=bands).map(move |band| {
        let angle = 0.5 * PI * f64::from(bands - band) / f64::from(bands);
        // The cosine of a right angle is not 0 in floating point.
        [if band == 0 { 0.0 } else { angle.cos() }, -angle.sin()]
    })
}

fn ellipsoid(radii: DVec3, tolerance: f64) -> Part {
    let sides = sides(radii.max_element(), tolerance, 2.0);
    let bands = sides.div_ceil(4);
    let grown = balanced((PI / f64::from(sides)).cos() * (0.25 * PI / f64::from(bands)).cos());
    let below: Vec<[f64; 2]> = quarter(bands).collect();
    let above = below.iter().rev().skip(1).map(|&[radius, z]| [radius, -z]);
    let profile: Vec<[f64; 2]> = below.iter().copied().chain(above).collect();
    let surface = Quadric::ellipsoid(radii, 0.0, [-radii.z, radii.z]);
    lathed(&profile, radii * grown, sides, &[(0..2 * bands, surface)])
}

fn capsule(radius: f64, half: f64, tolerance: f64) -> Part {
    let sides = sides(radius, tolerance, 2.0);
    let bands = sides.div_ceil(4);
    let grown = radius * balanced((PI / f64::from(sides)).cos() * (0.25 * PI / f64::from(bands)).cos());
    let below = quarter(bands).map(|[ring, z]| [grown * ring, grown * z - half]);
    let above = quarter(bands).rev().map(|[ring, z]| [grown * ring, half - grown * z]);
    let profile: Vec<[f64; 2]> = below.chain(above).collect();
    let ball = |middle: f64, span: [f64; 2]| Quadric::ellipsoid(DVec3::splat(radius), middle, span);
    let surfaces = [
        (0..bands, ball(-half, [-half - radius, -half])),
        (bands..bands + 1, Quadric::lathed(radius, 0.0, [-half, half])),
        (bands + 1..2 * bands + 1, ball(half, [half, half + radius])),
    ];
    lathed(&profile, DVec3::ONE, sides, &surfaces)
}

/// The surface that a profile of radii and heights z, from below to above, sweeps about the z axis in `sides` steps, stretched by
/// `scale`. Profiles that begin and end on the axis are closed. Each surface of `surfaces` is that of some bands, from one point of
/// the profile to the next.
fn lathed(profile: &[[f64; 2]], scale: DVec3, sides: u32, surfaces: &[(Range<u32>, Quadric)]) -> Part {
    let mut corners = Vec::new();
    // First corner of each ring, and how many it has.
    let mut rings: Vec<(u32, u32)> = Vec::new();
    for &[radius, z] in profile {
        let count = if radius == 0.0 { 1 } else { sides };
        rings.push((corners.len() as u32, count));
        corners.extend((0..count).map(|side| {
            let (sin, cos) = (TAU * f64::from(side) / f64::from(sides)).sin_cos();
            DVec3::new(radius * cos, radius * sin, z) * scale
        }));
    }
    let mut triangles: Vec<[u32; 3]> = Vec::new();
    let mut first_of_band = vec![0];
    for ends in rings.windows(2) {
        let corner = |(first, count): (u32, u32), side: u32| first + side % count;
        for side in 0..sides {
            let [a, b] = [side, side + 1].map(|side| corner(ends[0], side));
            let [d, c] = [side, side + 1].map(|side| corner(ends[1], side));
            triangles.extend((ends[0].1 > 1).then_some([a, b, c]));
            triangles.extend((ends[1].1 > 1).then_some([a, c, d]));
        }
        first_of_band.push(triangles.len() as u32);
    }
    let surfaces = surfaces.iter().map(|(bands, surface)| {
        let [first, end] = [bands.start, bands.end].map(|band| first_of_band[band as usize]);
        Quadric { first_triangle: first, triangle_count: end - first, ..*surface }
    });
    plain(&corners, triangles).quadrics(surfaces.collect::<Vec<_>>())
}

fn height_field([width, depth]: [f64; 2], heights: &[Vec<f64>]) -> Part {
    let (rows, columns) = (heights.len(), heights[0].len());
    let place = |at: usize, count: usize, size: f64| size * (at as f64 / (count - 1) as f64 - 0.5);
    let corners: Vec<DVec3> = heights
        .iter()
        .enumerate()
        .flat_map(|(row, heights)| {
            let y = place(row, rows, depth);
            heights.iter().enumerate().map(move |(column, &z)| DVec3::new(place(column, columns, width), y, z))
        })
        .collect();
    let cells = (0..rows - 1).flat_map(|row| (0..columns - 1).map(move |column| row * columns + column));
    let triangles = cells.flat_map(|cell| {
        let [a, b, c, d] = [cell, cell + 1, cell + 1 + columns, cell + columns].map(|corner| corner as u32);
        [[a, b, c], [a, c, d]]
    });
    plain(&corners, triangles.collect())
}

fn hull(points: &[[f64; 3]]) -> Result<Part> {
    let flat = |_| Error::invalid("hull.points_m", "points in one plane", "four or more that are not in one plane");
    let points: Vec<_> = points.iter().map(|point| point.map(|x| x as f32).into()).collect();
    let (corners, triangles) = ConvexTriangleMesh::try_from_points(&points, None).map_err(flat)?.into_parts();
    let positions: Vec<[f32; 3]> = corners.into_iter().map(Into::into).collect();
    Ok(Part::default().positions(positions.into()).triangles(triangles.into()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    fn shape(text: &str) -> PrimitiveShape {
        PrimitiveShape::from_yaml(text).unwrap()
    }

    /// Volume that the triangles enclose, seen from the origin, m^3.
    fn volume(part: &Part) -> f64 {
        let corner = |index: u32| Vec3::from(part.positions[index as usize]).as_dvec3();
        let sixth = |&[a, b, c]: &[u32; 3]| corner(a).dot(corner(b).cross(corner(c))) / 6.0;
        part.triangles.iter().map(sixth).sum()
    }

    /// Closed, facing outwards, and as large as the formula says, to what the tolerance allows.
    #[test]
    fn bodies_are_closed_and_as_large_as_they_are() {
        let ball = 4.0 / 3.0 * PI;
        for (text, expected) in [
            ("{box: {size_m: [1, 2, 3]}}", 6.0),
            ("{sphere: {radius_m: 0.5}}", ball / 8.0),
            ("{ellipsoid: {radii_m: [0.5, 1, 0.2]}}", ball * 0.1),
            ("{capsule: {radius_m: 0.5, length_m: 2}}", ball / 8.0 + 0.5 * PI),
            ("{cylinder: {radius_m: 0.5, length_m: 2}}", 0.5 * PI),
            ("{cone: {radius_m: 0.5, length_m: 3}}", 0.25 * PI),
            (
                "{hull: {points_m: [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0.1, 0.1, 0.1], [0.5, 0.5, 0]]}}",
                1.0 / 6.0,
            ),
        ] {
            let mesh = shape(text).mesh("a", 1e-3).unwrap();
            let part = &mesh.parts[0];
            assert!(part.is_closed() || text.contains("hull"), "{text}");
            assert!((volume(part) / expected - 1.0).abs() < 5e-3, "{text}: {} {expected}", volume(part));
        }
    }

    /// No corner and no middle of a triangle is farther from the surface than the tolerance, half of which are outside.
    #[test]
    fn triangles_are_within_the_tolerance() {
        for tolerance in [1e-2, 1e-3, 1e-5] {
            let mesh = shape("{sphere: {radius_m: 0.5}}").mesh("a", tolerance).unwrap();
            let part = &mesh.parts[0];
            let (mut low, mut high) = (0f64, 0f64);
            for triangle in 0..part.triangles.len() as u32 {
                for uv in [[0.0, 0.0], [0.5, 0.0], [0.0, 0.5], [0.5, 0.5]] {
                    let off = part.point(triangle, uv).as_dvec3().length() - 0.5;
                    (low, high) = (low.min(off), high.max(off));
                }
            }
            assert!(high < 1.1 * tolerance && low > -1.1 * tolerance, "{tolerance}: {low} {high}");
            assert!(high - low > tolerance, "{tolerance}: {low} {high}");
        }
    }

    #[test]
    fn wrong_numbers_are_named() {
        for (text, expected) in [
            ("{sphere: {radius_m: 0}}", "sphere.radius_m: is 0; allowed: 0.000000001 to 1000000"),
            ("{box: {size_m: [1, -2, 3]}}", "box.size_m: is -2; allowed: 0.000000001 to"),
            ("{cone: {radius_m: .nan, length_m: 1}}", ".nan is not a finite number"),
            ("{ball: {radius_m: 1}}", "unknown variant"),
            ("{sphere: {radius: 1}}", "radius"),
            ("{height_field: {size_m: [1, 1], heights_m: [[0, 0], [0]]}}", "height_field.heights_m[1]"),
            ("{height_field: {size_m: [1, 1], heights_m: [[0, 0]]}}", "height_field.heights_m"),
            ("{hull: {points_m: [[0, 0, 0], [1, 0, 0], [0, 1, 0]]}}", "hull.points_m"),
        ] {
            let error = PrimitiveShape::from_yaml(text).unwrap_err().to_string();
            assert!(error.contains(expected), "{text}: {error}");
        }
        let flat = shape("{hull: {points_m: [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]}}").mesh("a", 1e-3);
        assert!(flat.unwrap_err().to_string().contains("one plane"));
        assert!(shape("{sphere: {radius_m: 1}}").mesh("a", 0.0).is_err());
    }
}
