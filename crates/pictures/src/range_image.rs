//! The cloud as seen by the sensor: left is left, up is up.

use super::Page;
use super::boxes::{self, BoxEdges};
use super::canvas::{GROUND, Picture};
use super::paint::Paint;
use super::points::{CHUNK, Points, angles, robust_span};
use super::splat::{self, SplatStamp, Splats};
use cloud::PointCloud;
use glam::{Vec2, Vec3};
use ground::parallel;
use std::collections::BTreeMap;
use std::f32::consts::{PI, TAU};

/// The flattest and the steepest picture, height over width; scans with few rows are stretched to it.
const FLATTEST: f32 = 0.22;
const STEEPEST: f32 = 0.62;
/// With more channels than any spinning sensor has, the column `channel` does not define rows.
const CHANNELS: usize = 128;

/// The range image: rows and columns of the sensor if the cloud has them, else azimuth and elevation.
pub(super) fn draw(
    cloud: &PointCloud,
    points: &Points<'_>,
    paint: &Paint<'_>,
    outlines: &[BoxEdges],
    page: &Page,
) -> Picture {
    let channel = &cloud.columns.channel;
    let (mut picture, splats);
    // Position of a direction (sensor frame) in the picture.
    let place: Box<dyn Fn(Vec3, Vec2) -> Option<Vec2>>;
    let organised = cloud
        .organised
        .filter(|[rows, columns]| cloud.len as u64 == u64::from(*rows) * u64::from(*columns))
        .map(|size| SensorGrid::new(points, size, channel))
        .filter(|grid| grid.is_straight(points));
    match organised {
        Some(grid) => {
            picture = frame(page, grid.columns as f32 / grid.rows.len() as f32);
            splats = grid.splats(points, &picture);
            let lines =
                if outlines.is_empty() { GridDirections::default() } else { GridDirections::new(&grid, points) };
            place = Box::new(move |direction, size| lines.place(direction, size));
        }
        None => {
            let panorama = Panorama::new(cloud, points);
            picture = frame(page, panorama.aspect());
            splats = panorama.splats(points, &picture);
            place = Box::new(move |direction, size| panorama.place(direction, size));
        }
    }
    // A neighbour nearer by a quarter of the range gives the maximum darkening.
    splats.draw(&mut picture, paint, |range| range.max(1e-3).ln() / 0.25);
    let size = Vec2::new(picture.width as f32, picture.height as f32);
    boxes::draw(&mut picture, outlines, page, |edge| {
        boxes::bent(edge, size.x, |position| place(points.in_sensor_frame(position), size))
    });
    picture
}

/// A dark picture of roughly the aspect ratio `aspect` (width over height).
fn frame(page: &Page, aspect: f32) -> Picture {
    let full = page.inner() as f32;
    let height = (full / aspect).clamp(FLATTEST * full, STEEPEST * full);
    // A picture taller than the page allows becomes narrower, but not a thin line.
    let width = (height * aspect).clamp(FLATTEST * full, full);
    Picture::new(width as u32, height as u32, GROUND)
}

/// Rows and columns of the sensor in the order in which they are shown.
struct SensorGrid {
    /// Sensor rows from the top of the picture down.
    rows: Vec<u32>,
    columns: u32,
    /// Whether the sensor's columns run from right to left.
    mirrored: bool,
    /// Mean angle from column to column, rad.
    step: f32,
}

impl SensorGrid {
    fn new(points: &Points<'_>, [rows, columns]: [u32; 2], channel: &[u16]) -> SensorGrid {
        let cell = |row: u32, column: u32| row * columns + column;
        let direction = |row, column| Some(angles(points.in_sensor_frame(points.get(cell(row, column))?)));
        // A few hundred positions per row suffice to determine its direction.
        let step = columns.div_ceil(512) as usize;
        let (mut leftward, mut rightward) = (0, 0);
        let mut turned = 0.0;
        let elevations: Vec<Option<f32>> = (0..rows)
            .map(|row| {
                let (mut sum, mut hits) = (0.0, 0);
                for column in (0..columns).step_by(step) {
                    let Some(here) = direction(row, column) else { continue };
                    sum += here.y;
                    hits += 1;
                    if let Some(next) = (column + 1 < columns).then(|| direction(row, column + 1)).flatten() {
                        // Azimuth increases to the left, and jumps once a turn.
                        let turn = (next.x - here.x + PI).rem_euclid(TAU) - PI;
                        leftward += i32::from(turn > 0.0);
                        rightward += i32::from(turn < 0.0);
                        turned += turn.abs();
                    }
                }
                (hits > 0).then(|| sum / hits as f32)
            })
            .collect();

        let mut order: Vec<u32> = (0..rows).collect();
        let rows_are_channels = rows as usize <= CHANNELS
            && channel.len() == rows as usize * columns as usize
            && points.sample.iter().all(|&(row, _)| u32::from(channel[row as usize]) == row / columns);
        if rows_are_channels {
            // Channels may be numbered in any order. A row without a return is taken to point at the sky.
            let height = |row: &u32| elevations[*row as usize].unwrap_or(f32::INFINITY);
            order.sort_by(|a, b| height(b).total_cmp(&height(a)));
        } else if rises(&elevations) {
            order.reverse();
        }
        let step = turned / (leftward + rightward).max(1) as f32;
        SensorGrid { rows: order, columns, mirrored: leftward > rightward, step }
    }

    /// Whether the rows and columns of the sensor are rows and columns of the view. They are not if the channels of a
    /// spinning sensor point at different azimuths at a time, or if beams follow a curve.
    fn is_straight(&self, points: &Points<'_>) -> bool {
        /// Columns by which a row may be off.
        const MOST: f32 = 2.0;
        let cells: Vec<(u32, Vec2)> =
            points.sample.iter().map(|&(cell, place)| (cell, angles(points.in_sensor_frame(place)))).collect();
        if !are_rows(cells.iter().map(|&(cell, angles)| (cell / self.columns, angles.y))) {
            return false;
        }
        let mut columns = vec![Vec2::ZERO; self.columns as usize];
        for (cell, angles) in &cells {
            columns[(cell % self.columns) as usize] += Vec2::from_angle(angles.x);
        }
        let mut rows = vec![Vec2::ZERO; self.rows.len()];
        for (cell, angles) in &cells {
            let column = columns[(cell % self.columns) as usize];
            rows[(cell / self.columns) as usize] += Vec2::from_angle(column.angle_to(Vec2::from_angle(angles.x)));
        }
        rows.iter().all(|row| row.to_angle().abs() <= MOST * self.step)
    }

    fn splats(&self, points: &Points<'_>, picture: &Picture) -> Splats {
        let splats = Splats::new(picture.width, picture.height);
        let (rows, columns) = (self.rows.len() as u64, u64::from(self.columns));
        splats.fill(|x, y, [width, height]| {
            let row = self.rows[(u64::from(y) * rows / u64::from(height)) as usize];
            let column = (u64::from(x) * columns / u64::from(width)) as u32;
            let column = if self.mirrored { self.columns - 1 - column } else { column };
            let cell = row * self.columns + column;
            Some((points.distance(points.get(cell)?), cell))
        });
        splats
    }
}

/// Directions of the rows and columns of a [`SensorGrid`], from the points in them.
#[derive(Default)]
struct GridDirections {
    /// Whether rows and columns are straight lines on a plane ahead, as those of a camera, rather than lines of
    /// constant elevation and azimuth.
    flat: bool,
    /// Coordinate of each row from the top down, and of each column from the left.
    rows: Vec<Option<f32>>,
    columns: Vec<Option<f32>>,
}

impl GridDirections {
    fn new(grid: &SensorGrid, points: &Points<'_>) -> GridDirections {
        let mut places = vec![0; grid.rows.len()];
        for (place, &row) in grid.rows.iter().enumerate() {
            places[row as usize] = place;
        }
        let cells: Vec<([usize; 2], Vec3)> = points
            .sample
            .iter()
            .map(|&(cell, position)| {
                let (row, column) = ((cell / grid.columns) as usize, (cell % grid.columns) as usize);
                let column = if grid.mirrored { grid.columns as usize - 1 - column } else { column };
                ([column, places[row]], points.in_sensor_frame(position))
            })
            .collect();
        let ahead = cells.iter().all(|(_, direction)| direction.x > 0.05 * direction.length());
        let [round, flat] = [false, true].map(|flat| {
            let lines = GridDirections {
                flat,
                rows: GridDirections::means(1, grid.rows.len(), &cells, flat),
                columns: GridDirections::means(0, grid.columns as usize, &cells, flat),
            };
            let off = cells.iter().map(|([column, row], direction)| {
                let at = lines.of(*direction);
                let off = |of: Option<f32>, at: f32| of.map_or(0.0, |of| f64::from((at - of).abs().min(1.0)));
                off(lines.columns[*column], at.x) + off(lines.rows[*row], at.y)
            });
            let off = off.sum::<f64>();
            (lines, off)
        });
        if ahead && flat.1 < round.1 { flat.0 } else { round.0 }
    }

    /// The coordinates of a direction: x is constant along a column, y along a row.
    fn of(&self, direction: Vec3) -> Vec2 {
        if self.flat { Vec2::new(direction.y, direction.z) / direction.x } else { angles(direction) }
    }

    /// Means of the coordinate `axis` in each of `count` lines.
    fn means(axis: usize, count: usize, cells: &[([usize; 2], Vec3)], flat: bool) -> Vec<Option<f32>> {
        let lines = GridDirections { flat, ..GridDirections::default() };
        // The mean of angles is that of directions.
        let mut sums = vec![Vec2::ZERO; count];
        for (cell, direction) in cells {
            let value = lines.of(*direction)[axis];
            sums[cell[axis]] += if flat { Vec2::new(1.0, value) } else { Vec2::from_angle(value) };
        }
        let mean = |sum: &Vec2| if flat { sum.y / sum.x } else { sum.y.atan2(sum.x) };
        sums.iter().map(|sum| (*sum != Vec2::ZERO).then(|| mean(sum))).collect()
    }

    /// Position of a direction in a picture of this size; `None` if it is not between two of the lines.
    fn place(&self, direction: Vec3, size: Vec2) -> Option<Vec2> {
        if self.flat && direction.x <= 0.0 {
            return None;
        }
        let at = self.of(direction);
        let along = |lines: &[Option<f32>], value: f32| {
            // Angles wrap around.
            let off = |line: f32| if self.flat { line - value } else { (line - value + PI).rem_euclid(TAU) - PI };
            let known: Vec<(usize, f32)> =
                lines.iter().enumerate().filter_map(|(index, line)| Some((index, off((*line)?)))).collect();
            let pair = known.windows(2).find(|pair| {
                let [a, b] = [pair[0].1, pair[1].1];
                a * b <= 0.0 && (self.flat || (a - b).abs() < PI)
            })?;
            let [(from, a), (to, b)] = [pair[0], pair[1]];
            let part = if a == b { 0.0 } else { a / (a - b) };
            Some((from as f32 + (to - from) as f32 * part + 0.5) / lines.len() as f32)
        };
        Some(Vec2::new(along(&self.columns, at.x)?, along(&self.rows, at.y)?) * size)
    }
}

/// Whether elevations, each with the number of its row, are mostly explained by the rows.
fn are_rows(elevations: impl Iterator<Item = (u32, f32)> + Clone) -> bool {
    /// Fraction of the variance that rows may leave unexplained: those of a camera are curved.
    const LEFT: f64 = 0.25;
    /// Variance up to which elevations are one row in any case, rad^2: a degree.
    const LEVEL: f64 = 3e-4;
    let mut rows: BTreeMap<u32, [f64; 3]> = BTreeMap::new();
    for (row, elevation) in elevations.filter(|(_, elevation)| elevation.is_finite()) {
        let value = f64::from(elevation);
        let sums = rows.entry(row).or_default();
        *sums = [sums[0] + 1.0, sums[1] + value, sums[2] + value * value];
    }
    let variance = |[count, sum, squares]: [f64; 3]| (squares - sum * sum / count.max(1.0)).max(0.0);
    let all = rows.values().fold([0.0; 3], |all, sums| std::array::from_fn(|k| all[k] + sums[k]));
    let within: f64 = rows.values().copied().map(variance).sum();
    within <= (LEFT * variance(all)).max(LEVEL * all[0])
}

/// Whether `values` mostly rise with their index: the sign of their covariance.
fn rises(values: &[Option<f32>]) -> bool {
    let known = || values.iter().enumerate().filter_map(|(index, value)| Some((index as f64, f64::from((*value)?))));
    let count = known().count().max(1) as f64;
    let (index_mean, value_mean) =
        known().fold((0.0, 0.0), |(i, v), (index, value)| (i + index / count, v + value / count));
    known().map(|(index, value)| (index - index_mean) * (value - value_mean)).sum::<f64>() > 0.0
}

/// Azimuth to the left and elevation, or channel, up.
struct Panorama<'a> {
    azimuth: [f32; 2],
    elevation: [f32; 2],
    /// Channel of each point and row of each channel, if channels form rows.
    channels: Option<(&'a [u16], BTreeMap<u16, usize>)>,
    /// Elevations of these rows, from the top down.
    elevations: Vec<f32>,
}

impl<'a> Panorama<'a> {
    fn new(cloud: &'a PointCloud, points: &Points<'_>) -> Self {
        let columns = &cloud.columns;
        let sample: Vec<(u32, Vec2)> =
            points.sample.iter().map(|&(row, position)| (row, points.angles(row, position))).collect();
        let [azimuth, elevation] = [0, 1].map(|axis| {
            let mut values: Vec<f32> =
                sample.iter().map(|(_, angles)| angles[axis]).filter(|a| a.is_finite()).collect();
            let [low, high] = robust_span(&mut values, 0.002);
            // A picture needs to show at least a thousandth of a turn.
            let middle = low.midpoint(high);
            [low.min(middle - 0.003), high.max(middle + 0.003)]
        });
        let mut panorama = Panorama { azimuth, elevation, channels: None, elevations: Vec::new() };

        if columns.channel.len() >= cloud.len {
            let mut rows: BTreeMap<u16, (f64, f64)> = BTreeMap::new();
            for (row, angles) in &sample {
                let (sum, count) = rows.entry(columns.channel[*row as usize]).or_default();
                (*sum, *count) = (*sum + f64::from(angles.y), *count + 1.0);
            }
            let by_channel = sample.iter().map(|(row, angles)| (u32::from(columns.channel[*row as usize]), angles.y));
            if (2..=CHANNELS).contains(&rows.len()) && are_rows(by_channel) {
                let mut order: Vec<(u16, f64)> =
                    rows.into_iter().map(|(channel, (sum, count))| (channel, sum / count)).collect();
                order.sort_by(|a, b| b.1.total_cmp(&a.1));
                panorama.elevations = order.iter().map(|(_, elevation)| *elevation as f32).collect();
                let rows = order.into_iter().enumerate().map(|(row, (channel, _))| (channel, row)).collect();
                panorama.channels = Some((&columns.channel, rows));
            }
        }
        panorama
    }

    /// Position of a direction (sensor frame) in a picture of this size; `None` if it is above or below all channels.
    fn place(&self, direction: Vec3, size: Vec2) -> Option<Vec2> {
        let at = angles(direction);
        let part = |value: f32, [low, high]: [f32; 2]| (high - value) / (high - low);
        let down = if self.elevations.is_empty() {
            part(at.y, self.elevation)
        } else {
            let rows = self.elevations.windows(2).position(|rows| (rows[1]..=rows[0]).contains(&at.y))?;
            let [above, below] = [self.elevations[rows], self.elevations[rows + 1]];
            let between = if above > below { (above - at.y) / (above - below) } else { 0.0 };
            (rows as f32 + between + 0.5) / self.elevations.len() as f32
        };
        Some(Vec2::new(part(at.x, self.azimuth), down) * size)
    }

    fn aspect(&self) -> f32 {
        (self.azimuth[1] - self.azimuth[0]) / (self.elevation[1] - self.elevation[0])
    }

    fn splats(&self, points: &Points<'_>, picture: &Picture) -> Splats {
        let size = Vec2::new(picture.width as f32, picture.height as f32);
        let row_height = self.channels.as_ref().map(|(_, rows)| size.y / rows.len() as f32);
        let stamp = match row_height {
            // Wide enough to close the row if all its beams return.
            Some(height) => {
                let per_row = points.count as f32 * height / size.y;
                // Rounded up: no gap between rows.
                let closed = (height * splat::SAMPLES as f32).ceil() / splat::SAMPLES as f32;
                SplatStamp::rectangle((1.3 * size.x / per_row).min(0.01 * size.x), closed)
            }
            None => {
                let side = splat::diameter(points.count, picture, 0.01 * size.x);
                SplatStamp::rectangle(side, side)
            }
        };
        let splats = Splats::new(picture.width, picture.height);
        let part = |value: f32, [low, high]: [f32; 2]| (high - value) / (high - low);
        parallel::for_each_range(points.len(), CHUNK, |rows| {
            for row in rows {
                let Some(position) = points.get(row as u32) else { continue };
                let direction = points.angles(row as u32, position);
                let x = part(direction.x, self.azimuth) * size.x;
                let y = match (&self.channels, row_height) {
                    (Some((channel, rows)), Some(height)) => match rows.get(&channel[row]) {
                        Some(&row) => (row as f32 + 0.5) * height,
                        None => continue,
                    },
                    _ => part(direction.y, self.elevation) * size.y,
                };
                splats.put(Vec2::new(x, y), &stamp, points.distance(position), row as u32);
            }
        });
        splats
    }
}

#[cfg(test)]
mod tests {
    use super::super::{PreviewOptions, View, palette, render};
    use super::*;
    use ground::pose::Pose;
    use ground::report::Report;

    /// A sphere of radius 5 m around the sensor at 1, 2, 3, seen by channels at `elevations`, degrees, over a full turn
    /// counter-clockwise; its label is the channel + 1, and 9 dead ahead.
    fn spinning(columns: u32, elevations: &[f32]) -> PointCloud {
        let mut cloud = PointCloud { sensor_pose: Pose::at(1.0, 2.0, 3.0), ..PointCloud::default() };
        for (channel, elevation) in elevations.iter().enumerate() {
            for column in 0..columns {
                let azimuth = (column as f32 + 0.5) / columns as f32 * TAU - PI;
                let elevation = elevation.to_radians();
                cloud.columns.x.push(1.0 + 5.0 * elevation.cos() * azimuth.cos());
                cloud.columns.y.push(2.0 + 5.0 * elevation.cos() * azimuth.sin());
                cloud.columns.z.push(3.0 + 5.0 * elevation.sin());
                cloud.columns.channel.push(channel as u16);
                let ahead = azimuth.abs() < 0.3;
                cloud.columns.category_id.push(if ahead { 9 } else { channel as u32 + 1 });
            }
        }
        cloud.len = cloud.columns.x.len();
        cloud
    }

    fn picture(cloud: &PointCloud) -> Picture {
        let options = PreviewOptions { view: View::Range, width: 800, ..PreviewOptions::default() };
        let mut report = Report::default();
        let picture = render(cloud, &options, &mut report).unwrap();
        assert_eq!(report.warnings, Vec::<String>::new());
        picture
    }

    /// Colour at the part `x`, `y` of the panel.
    fn at(picture: &Picture, x: f32, y: f32) -> [u8; 3] {
        let page = Page::new(picture.width);
        let top = page.panel_top() as f32;
        let height = FLATTEST * page.inner() as f32;
        picture.pixel((page.margin() as f32 + x * page.inner() as f32) as u32, (top + y * height) as u32)
    }

    #[test]
    fn rows_stand_by_elevation_and_left_is_left() {
        let mut organised = spinning(900, &[-10.0, 10.0, 0.0]);
        organised.organised = Some([3, 900]);
        // A mark to the left of the sensor, at azimuth +90 degrees, in the lowest row.
        let left = 900 * 3 / 4;
        for column in left - 40..left + 40 {
            organised.columns.category_id[column] = 7;
        }
        let mut loose = organised.clone();
        loose.organised = None;
        for cloud in [organised, loose] {
            let picture = picture(&cloud);
            // Rows from the top: channels 1 (10 degrees), 2 (0), 0 (-10).
            assert_eq!(at(&picture, 0.1, 0.16), palette::category(2));
            assert_eq!(at(&picture, 0.1, 0.5), palette::category(3));
            assert_eq!(at(&picture, 0.1, 0.83), palette::category(1));
            assert_eq!(at(&picture, 0.5, 0.5), palette::category(9));
            assert_eq!(at(&picture, 0.25, 0.83), palette::category(7));
            assert_eq!(at(&picture, 0.75, 0.83), palette::category(1));
        }
    }

    #[test]
    fn every_point_is_at_its_own_azimuth() {
        let mut cloud = spinning(900, &[-10.0, 10.0, 0.0]);
        cloud.organised = Some([3, 900]);
        // The second channel points 17 degrees further to the left at a time.
        for row in 900..1800 {
            let out = Vec2::from_angle(0.3).rotate(Vec2::new(cloud.columns.x[row] - 1.0, cloud.columns.y[row] - 2.0));
            [cloud.columns.x[row], cloud.columns.y[row]] = [out.x + 1.0, out.y + 2.0];
        }
        // A post to the left.
        for row in 0..cloud.len {
            let azimuth = (cloud.columns.y[row] - 2.0).atan2(cloud.columns.x[row] - 1.0);
            cloud.columns.category_id[row] = if (azimuth - 0.25 * TAU).abs() < 0.1 { 7 } else { 3 };
        }
        let picture = picture(&cloud);
        for (y, x) in [0.16, 0.5, 0.83].into_iter().flat_map(|y| [(y, 0.2), (y, 0.25), (y, 0.3)]) {
            let expected = if x == 0.25 { 7 } else { 3 };
            assert_eq!(at(&picture, x, y), palette::category(expected), "{x} {y}");
        }
    }

    #[test]
    fn beams_without_rows_are_points() {
        // Along a curve that fills a square, as behind two prisms: one row, or a few lines of them.
        for rows in [1, 3] {
            let mut cloud = PointCloud { organised: Some([rows, 2000]), ..PointCloud::default() };
            for index in 0..rows * 2000 {
                let phase = index as f32 * 0.11;
                let direction = 0.3 * Vec2::new((1.618 * phase).sin(), phase.cos());
                cloud.columns.x.push(5.0);
                cloud.columns.y.push(5.0 * direction.x);
                cloud.columns.z.push(5.0 * direction.y);
                cloud.columns.channel.push((index / 2000) as u16);
                cloud.columns.category_id.push(if direction.y > 0.0 { 1 } else { 2 });
            }
            cloud.len = cloud.columns.x.len();
            let picture = picture(&cloud);
            let page = Page::new(800);
            let height = picture.height - page.panel_top();
            let count = |rows: std::ops::Range<u32>, id| {
                let pixels = rows.flat_map(|y| (0..picture.width).map(move |x| (x, y)));
                pixels.filter(|&(x, y)| picture.pixel(x, y) == palette::category(id)).count()
            };
            // What is above is above.
            let (upper, lower) = (page.panel_top()..page.panel_top() + height / 3, 2 * height / 3..height);
            assert!(count(upper.clone(), 1) > 500 && count(upper, 2) == 0, "{rows}");
            assert!(count(lower.clone(), 2) > 100 && count(lower, 1) == 0, "{rows}");
        }
    }

    #[test]
    fn misses_are_dark() {
        let mut cloud = spinning(900, &[-10.0, 10.0, 0.0]);
        cloud.organised = Some([3, 900]);
        for row in 1000..1100 {
            cloud.columns.z[row] = f32::NAN;
        }
        let picture = picture(&cloud);
        assert_eq!(at(&picture, 1.0 - 150.0 / 900.0, 0.16), GROUND);
        assert_eq!(at(&picture, 1.0 - 250.0 / 900.0, 0.16), palette::category(2));
    }

    #[test]
    fn cameras_keep_their_rows_whichever_way_they_run() {
        // Rows from the bottom up, columns from left to right, more rows than any channel count.
        let (rows, columns) = (200, 300);
        let mut cloud = PointCloud { organised: Some([rows, columns]), ..PointCloud::default() };
        for row in 0..rows {
            for column in 0..columns {
                cloud.columns.x.push(2.0);
                cloud.columns.y.push(1.5 - column as f32 / 100.0);
                cloud.columns.z.push(row as f32 / 100.0 - 1.0);
                cloud.columns.category_id.push(if row < 100 { 1 } else { 2 } + if column < 150 { 0 } else { 2 });
            }
        }
        cloud.len = cloud.columns.x.len();
        let page = Page::new(800);
        let picture = picture(&cloud);
        let (height, top) = (STEEPEST * page.inner() as f32, page.panel_top() as f32);
        let at = |x: f32, y: f32| picture.pixel((400.0 + (x - 0.5) * height) as u32, (top + y * height) as u32);
        let corners = [at(0.2, 0.25), at(0.8, 0.25), at(0.2, 0.75), at(0.8, 0.75)];
        for (corner, id) in corners.into_iter().zip([2, 4, 1, 3]) {
            // Slanted surfaces are a little darker.
            assert!(corner.iter().zip(palette::category(id)).all(|(is, full)| is.abs_diff(full) < 5), "{corners:?}");
        }
    }

    #[test]
    fn thin_scans_are_stretched_and_tall_ones_narrowed() {
        let page = Page::new(1600);
        let size = |aspect| {
            let picture = frame(&page, aspect);
            (picture.width, picture.height)
        };
        assert_eq!(size(1808.0 / 16.0), (1544, 339));
        assert_eq!(size(2.0), (1544, 772));
        assert_eq!(size(1.0), (957, 957));
        assert_eq!(size(0.01), (339, 957));
    }
}
