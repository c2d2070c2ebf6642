//! The image that beams in rows make: which pixel each beam is, and where in the image a point would be.

use super::BeamTable;
use super::pattern::{Pattern, Pinhole, Rays};
use glam::{DQuat, DVec3, Vec2};
use ground::angle::azimuth_elevation;
use ground::error::{Error, Result};
use ground::shown;
use std::f32::consts::{PI, TAU};

/// The image of a sensor whose beams form rows and columns: left is left, up is up. Pixel `[column, row]` counts from
/// the top left and covers `column..column + 1`, `row..row + 1` of the image, in which boxes are measured.
#[derive(Clone, Debug, PartialEq)]
pub struct ImageGrid {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// For a camera; `None`: for a sensor whose rows each have one elevation and whose columns each have one azimuth,
    /// to the nearest pixel, or for one whose beams were given in code, row by row from the top left.
    pub intrinsics: Option<Intrinsics>,
    /// Beams in a row.
    columns: usize,
    /// Row in the image of each row of beams, and column of its first beam.
    lines: Vec<[u32; 2]>,
    /// Whether beams follow each other from right to left.
    mirrored: bool,
    round: Option<Round>,
}

/// Where a camera sees a point of the sensor frame (x forward, y left, z up): at column `centre[0] - focal[0] y / x`
/// and row `centre[1] - focal[1] z / x`, with whole numbers at the centres of pixels, as in OpenCV.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Intrinsics {
    /// Focal lengths along columns and rows, pixels.
    pub focal: [f64; 2],
    /// Principal point, pixels from the middle of the top left pixel.
    pub centre: [f64; 2],
}

impl Intrinsics {
    /// From the optical frame, in which cameras are usually described (x right, y down, z ahead), to the sensor frame.
    #[doc(hidden)]
    pub const FROM_OPTICAL: DQuat = DQuat::from_xyzw(-0.5, 0.5, -0.5, 0.5);

    /// A camera without distortion.
    pub fn new(focal: [f64; 2], centre: [f64; 2]) -> Intrinsics {
        Intrinsics { focal, centre }
    }

    /// The camera matrix, row by row: from points in the frame with x to the right, y down and z ahead to pixels times
    /// their distance ahead.
    pub fn matrix(&self) -> [[f64; 3]; 3] {
        let Intrinsics { focal: [fx, fy], centre: [cx, cy] } = *self;
        [[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]]
    }
}

/// Directions of the rows and columns of a sensor that rotates or sweeps.
#[derive(Clone, Debug, PartialEq)]
struct Round {
    /// Azimuth of the middle of the first column, rad.
    left: f32,
    /// Angle from column to column, to the right, rad.
    step: f32,
    /// Elevations of the rows from the top, rad.
    elevations: Vec<f32>,
}

impl ImageGrid {
    /// The image of the sensor `name` whose `pattern` has these `beams`.
    ///
    /// # Errors
    /// [`Error::Unsupported`] for beams without rows and columns, those of prisms, of a table or of sound.
    #[doc(hidden)]
    pub fn of(name: &str, pattern: &Pattern, beams: &BeamTable) -> Result<ImageGrid> {
        match pattern {
            Pattern::Pinhole(camera) => Ok(ImageGrid::flat(camera, beams)),
            Pattern::Spinning(_) | Pattern::Raster(_) => Ok(ImageGrid::round(beams)),
            Pattern::Custom if beams.rows > 1 => Ok(ImageGrid::plain(beams)),
            pattern => {
                let instead = if pattern.is_of_sound() {
                    "images of sonars are made of their pings"
                } else {
                    "sensors that have one are cameras (pinhole), spinning and raster ones"
                };
                let what = format!("an image of {}, whose beams form no rows and columns,", shown::text(name));
                Err(Error::Unsupported { what, instead: instead.into() })
            }
        }
    }

    /// The image of beams row by row from the top left.
    #[doc(hidden)]
    pub fn plain(beams: &BeamTable) -> ImageGrid {
        let [width, height] = [beams.columns, beams.rows].map(|count| count as usize);
        let lines = (0..beams.rows).map(|row| [row, 0]).collect();
        ImageGrid { width, height, intrinsics: None, columns: width, lines, mirrored: false, round: None }
    }

    /// The image of a camera.
    #[doc(hidden)]
    pub fn flat(camera: &Pinhole, beams: &BeamTable) -> ImageGrid {
        let intrinsics = Intrinsics {
            focal: [0, 1].map(|axis| {
                let half = (0.5 * camera.fov_deg[axis]).to_radians().tan();
                let steps = match camera.rays {
                    Rays::Centres => camera.resolution[axis],
                    // A single ray is in the middle.
                    Rays::Edges => (camera.resolution[axis] - 1).max(1),
                };
                0.5 * f64::from(steps) / half
            }),
            centre: camera.resolution.map(|count| 0.5 * (f64::from(count) - 1.0)),
        };
        ImageGrid { intrinsics: Some(intrinsics), ..ImageGrid::plain(beams) }
    }

    /// The image of a sensor that rotates or sweeps: rows by elevation, the highest first, and every beam at its
    /// azimuth.
    #[doc(hidden)]
    pub fn round(beams: &BeamTable) -> ImageGrid {
        let (rows, columns) = (beams.rows as usize, beams.columns as usize);
        let angles = |beam: usize| azimuth_elevation([beams.dir_x[beam], beams.dir_y[beam], beams.dir_z[beam]]);
        let step = step(|column| angles(column)[0], columns);
        let mirrored = step > 0.0;
        let outermost = if mirrored { columns - 1 } else { 0 };
        let lefts: Vec<f32> = (0..rows).map(|row| angles(row * columns + outermost)[0]).collect();
        // Channels point in several directions at a time; the image is laid out about their mean.
        let mean = lefts.iter().map(|&left| Vec2::from_angle(left)).sum::<Vec2>().to_angle();
        let shifts: Vec<i64> = lefts.iter().map(|left| (turn(mean - left) / step.abs()).round() as i64).collect();
        let least = shifts.iter().copied().min().unwrap_or(0);
        let most = shifts.iter().copied().max().unwrap_or(0);
        let whole_turn = columns > 1 && (columns as f32 + 0.5) * step.abs() >= TAU;
        let (first, width) = if whole_turn { (0, columns) } else { (least, columns + (most - least) as usize) };
        let mut order: Vec<usize> = (0..rows).collect();
        let elevation = |row: usize| angles(row * columns)[1];
        order.sort_by(|&a, &b| elevation(b).total_cmp(&elevation(a)));
        let mut lines = vec![[0; 2]; rows];
        for (place, &row) in order.iter().enumerate() {
            let start = shifts[row] - first + if mirrored { columns as i64 - 1 } else { 0 };
            lines[row] = [place as u32, start.rem_euclid(width as i64) as u32];
        }
        let round = Round {
            left: mean - first as f32 * step.abs(),
            step: step.abs(),
            elevations: order.into_iter().map(elevation).collect(),
        };
        ImageGrid { width, height: rows, intrinsics: None, columns, lines, mirrored, round: Some(round) }
    }

    /// Number of pixels.
    pub fn len(&self) -> usize {
        self.width * self.height
    }

    /// Whether there are no pixels: never.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Rows and columns of its beams.
    #[doc(hidden)]
    pub fn beams(&self) -> [u32; 2] {
        [self.lines.len() as u32, self.columns as u32]
    }

    /// Whether beam k is pixel k, for all k.
    #[doc(hidden)]
    pub fn is_in_order(&self) -> bool {
        let lines = self.lines.iter().zip(0..).all(|(line, row)| *line == [row, 0]);
        lines && !self.mirrored && self.columns == self.width
    }

    /// Index of the pixel of a beam, row by row; `None`: there is no such beam.
    pub fn pixel(&self, beam: u32) -> Option<usize> {
        let (row, along) = (beam as usize / self.columns, beam as usize % self.columns);
        let [line, first] = self.lines.get(row)?.map(|place| place as usize);
        let column = if self.mirrored { first + self.width - along } else { first + along };
        Some(line * self.width + if column < self.width { column } else { column - self.width })
    }
}

/// Angle from beam to beam of a row of `count`, from the azimuths of its beams, rad; 1 for a single beam.
fn step(azimuth: impl Fn(usize) -> f32, count: usize) -> f32 {
    if count < 2 {
        return 1.0;
    }
    let steps = (count - 1) as f32;
    let rough = turn(azimuth(1) - azimuth(0));
    // Over the whole row it is more precise, up to whole turns.
    let all = turn(azimuth(count - 1) - azimuth(0));
    (all + ((rough * steps - all) / TAU).round() * TAU) / steps
}

/// The same angle from -pi up to pi.
fn turn(angle: f32) -> f32 {
    (angle + PI).rem_euclid(TAU) - PI
}

/// Bounding box that grows around triangles as they would appear in a sufficiently large image.
pub struct Outline<'g> {
    grid: &'g ImageGrid,
    /// Azimuth of what is in the middle, rad, and the column that it is in.
    middle: [f64; 2],
    ends: Option<[[f64; 2]; 2]>,
}

impl<'g> Outline<'g> {
    /// Nearest distance, m, to the plane through a camera at which anything is seen.
    const NEAR: f64 = 0.1;

    /// An empty outline, for objects about `middle` (sensor frame).
    pub fn new(grid: &'g ImageGrid, middle: DVec3) -> Outline<'g> {
        let azimuth = middle.y.atan2(middle.x);
        let column = grid.round.as_ref().map_or(0.0, |round| {
            let right = f64::from(round.left) - azimuth;
            // The image repeats with every turn: what is beyond its edges is placed next to the nearer one.
            let turn = std::f64::consts::TAU;
            let half = 0.5 * f64::from(round.step);
            let right = (right + half).rem_euclid(turn) - half;
            let beyond = grid.width as f64 * f64::from(round.step) - half;
            let nearer = right > beyond && turn - right < right - beyond;
            (if nearer { right - turn } else { right }) / f64::from(round.step) + 0.5
        });
        Outline { grid, middle: [azimuth, column], ends: None }
    }

    /// Grows around a triangle (sensor frame).
    pub fn add(&mut self, corners: [DVec3; 3]) {
        let Some(Intrinsics { focal, centre }) = self.grid.intrinsics else {
            if let Some(round) = &self.grid.round {
                let places = corners.map(|corner| round.place(corner, self.middle));
                places.into_iter().for_each(|place| self.reach(place));
            }
            return;
        };
        let see = |place: DVec3| {
            [centre[0] + 0.5 - focal[0] * place.y / place.x, centre[1] + 0.5 - focal[1] * place.z / place.x]
        };
        for (from, to) in [(0, 1), (1, 2), (2, 0)].map(|(from, to)| (corners[from], corners[to])) {
            if from.x >= Self::NEAR {
                self.reach(see(from));
            }
            // Where an edge crosses the plane.
            if (from.x >= Self::NEAR) != (to.x >= Self::NEAR) {
                let cut = from.lerp(to, (Self::NEAR - from.x) / (to.x - from.x));
                self.reach(see(DVec3 { x: Self::NEAR, ..cut }));
            }
        }
    }

    fn reach(&mut self, place: [f64; 2]) {
        let [low, high] = self.ends.get_or_insert([place; 2]);
        for axis in 0..2 {
            low[axis] = low[axis].min(place[axis]);
            high[axis] = high[axis].max(place[axis]);
        }
    }

    /// Left, top, right and bottom, pixels; `None`: nothing is in front.
    pub fn done(self) -> Option<[f64; 4]> {
        self.ends.map(|[[left, top], [right, bottom]]| [left, top, right, bottom])
    }
}

impl Round {
    /// Column and row of a point near the `middle`.
    fn place(&self, place: DVec3, [azimuth, column]: [f64; 2]) -> [f64; 2] {
        let turn = std::f64::consts::TAU;
        let off = (azimuth - place.y.atan2(place.x) + 0.5 * turn).rem_euclid(turn) - 0.5 * turn;
        let elevation = place.z.atan2(place.x.hypot(place.y));
        [column + off / f64::from(self.step), self.row(elevation)]
    }

    /// Row of an elevation, rad: linear between the rows, and beyond them as between the last two.
    fn row(&self, elevation: f64) -> f64 {
        let rows = &self.elevations;
        let Some(last) = rows.len().checked_sub(2) else { return 0.5 };
        let below = rows.partition_point(|&row| f64::from(row) > elevation);
        let above = below.saturating_sub(1).min(last);
        let [high, low] = [rows[above], rows[above + 1]].map(f64::from);
        let part = if high > low { (high - elevation) / (high - low) } else { 0.0 };
        above as f64 + 0.5 + part
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Pattern;
    use glam::Vec3;

    fn beams(yaml: &str) -> (Pattern, BeamTable) {
        let pattern: Pattern = ground::read::yaml::from_str("pattern", yaml).unwrap();
        let beams = pattern.beams(0.0).unwrap();
        (pattern, beams)
    }

    /// Every beam has a pixel of its own, and its neighbours in the image are left and right, above and below.
    fn check(grid: &ImageGrid, beams: &BeamTable) {
        let mut of = vec![None; grid.len()];
        for beam in 0..beams.len() as u32 {
            let pixel = grid.pixel(beam).unwrap();
            assert_eq!(of[pixel].replace(beam), None, "{beam}");
        }
        assert_eq!(grid.pixel(beams.len() as u32), None);
        let angles = |pixel: usize| {
            of[pixel].map(|beam| Vec2::from(azimuth_elevation(beams.direction(beam as usize).to_array())))
        };
        for pixel in (0..grid.len()).filter(|pixel| pixel % grid.width + 1 < grid.width) {
            if let (Some(here), Some(right)) = (angles(pixel), angles(pixel + 1)) {
                assert!(turn(here.x - right.x) > 0.0, "{pixel}: {here} {right}");
            }
            if let (Some(here), Some(below)) = (angles(pixel), angles((pixel + grid.width) % grid.len()))
                && pixel + grid.width < grid.len()
            {
                assert!(here.y >= below.y, "{pixel}: {here} {below}");
            }
        }
    }

    const FULL: &str = "{type: spinning, azimuth: {fov_deg: 360, step_deg: 0.4}, channels: {elevation_deg: [-10, 10, 0], \
                        azimuth_offset_deg: [-4, 0, 4]}}";

    #[test]
    fn channels_are_at_their_azimuth_the_highest_on_top() {
        for (direction, part) in [("ccw", 360), ("cw", 360), ("ccw", 90), ("cw", 90)] {
            let yaml = FULL.replace("step_deg: 0.4", &format!("step_deg: 0.4, direction: {direction}"));
            let (_, beams) = beams(&yaml.replace("fov_deg: 360", &format!("fov_deg: {part}")));
            let grid = ImageGrid::round(&beams);
            check(&grid, &beams);
            // For part of a turn, the image is as wide as what all channels see.
            let wider = if part == 360 { 0 } else { 20 };
            assert_eq!([grid.width, grid.height], [beams.columns as usize + wider, 3]);
            // What is ahead is in the middle of all rows.
            for row in 0..3 {
                let ahead = |beam: usize| Vec3::X.dot(beams.direction(row * beams.columns as usize + beam));
                let middle = (0..beams.columns as usize).max_by(|&a, &b| ahead(a).total_cmp(&ahead(b))).unwrap();
                let pixel = grid.pixel((row * beams.columns as usize + middle) as u32).unwrap();
                assert!((pixel % grid.width).abs_diff(grid.width / 2) <= 1, "{direction} {part} {row}");
            }
        }
    }

    #[test]
    fn sweeps_are_turned_and_cameras_are_not() {
        let (_, sweep) =
            beams("{type: raster, azimuth: {fov_deg: 40, step_deg: 1}, elevation: {fov_deg: 20, step_deg: 2}}");
        let grid = ImageGrid::round(&sweep);
        check(&grid, &sweep);
        assert_eq!([grid.width, grid.height], [41, 11]);
        assert_eq!(grid.pixel(0), Some(41 * 11 - 1));
        let (pattern, table) = beams("{type: pinhole, resolution: [8, 4], fov_deg: [90, 60]}");
        let Pattern::Pinhole(camera) = pattern else { panic!() };
        let grid = ImageGrid::flat(&camera, &table);
        assert!((0..32).all(|beam| grid.pixel(beam) == Some(beam as usize)));
    }

    #[test]
    fn places_are_where_beams_look() {
        for yaml in [
            "{type: pinhole, resolution: [8, 4], fov_deg: [90, 60]}",
            "{type: pinhole, resolution: [8, 4], fov_deg: [90, 60], rays: edges}",
            FULL,
            "{type: raster, azimuth: {fov_deg: 40, step_deg: 1}, elevation: {fov_deg: 20, step_deg: 2}}",
        ] {
            let (pattern, beams) = beams(yaml);
            let grid = match &pattern {
                Pattern::Pinhole(camera) => ImageGrid::flat(camera, &beams),
                _ => ImageGrid::round(&beams),
            };
            for beam in 0..beams.len() {
                let place = 7.0 * beams.direction(beam).as_dvec3();
                let mut outline = Outline::new(&grid, place);
                outline.add([place; 3]);
                let [left, top, ..] = outline.done().unwrap();
                let pixel = grid.pixel(beam as u32).unwrap();
                let expected = [(pixel % grid.width) as f64 + 0.5, (pixel / grid.width) as f64 + 0.5];
                assert!((left - expected[0]).abs() < 0.01, "{yaml} {beam}: {left} {expected:?}");
                assert!((top - expected[1]).abs() < 0.01, "{yaml} {beam}: {top} {expected:?}");
            }
        }
    }

    #[test]
    fn triangles_through_the_camera_plane_are_clipped() {
        let (pattern, table) = beams("{type: pinhole, resolution: [100, 100], fov_deg: [90, 90]}");
        let Pattern::Pinhole(camera) = pattern else { panic!() };
        let grid = ImageGrid::flat(&camera, &table);
        let around = |corners: [[f64; 3]; 3]| {
            let mut outline = Outline::new(&grid, DVec3::X);
            outline.add(corners.map(DVec3::from_array));
            outline.done()
        };
        // A wall to the left that continues behind the camera.
        let [left, top, right, bottom] = around([[-5.0, 1.0, 0.5], [5.0, 1.0, 0.5], [5.0, 1.0, -0.5]]).unwrap();
        assert!((left - (50.0 - 50.0 / 0.1)).abs() < 1e-6 && (right - 40.0).abs() < 1e-9, "{left} {right}");
        assert!((bottom - 55.0).abs() < 1e-9 && top < -190.0, "{top} {bottom}");
        assert_eq!(around([[-5.0, 1.0, 0.5], [-1.0, 1.0, 0.5], [-5.0, 1.0, -0.5]]), None);
    }
}
