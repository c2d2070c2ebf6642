//! Density with which the sensor has covered its view, or the ground.

use super::points::{CHUNK, Points, robust_span};
use glam::Vec3;
use ground::parallel;
use std::f32::consts::{FRAC_PI_2, PI, TAU};
use std::sync::atomic::{AtomicU32, Ordering};

/// Points in a typical cell: their number is accurate to a sixth.
const IN_CELL: f32 = 36.0;
/// Bounds of the side of cells, degrees.
const FINEST: f32 = 0.1;
const COARSEST: f32 = 5.0;

/// Points per square degree around each point, as seen by the sensor: those in its cell of azimuth and elevation over
/// the solid angle of the cell. NaN where there is no point.
pub(super) fn of(points: &Points<'_>) -> Vec<f32> {
    let side = side(points);
    let shape = [(TAU / side).ceil() as usize, (PI / side).ceil() as usize];
    let place = |row: u32, position: Vec3| {
        let at = points.angles(row, position);
        [at.x.rem_euclid(TAU) / side, (at.y + FRAC_PI_2) / side]
    };
    let solid_angle = |row: usize| {
        let below = row as f32 * side - FRAC_PI_2;
        side * ((below + side).min(FRAC_PI_2).sin() - below.sin()) * 1_f32.to_degrees().powi(2)
    };
    in_cells(points, shape, place, solid_angle)
}

/// Points per square metre of the map around each point. NaN where there is no point.
pub(super) fn on_ground(points: &Points<'_>) -> Vec<f32> {
    /// Most cells along an axis; a cell of them is a count of 4 bytes.
    const MOST: f32 = 4096.0;
    let of_axis = |axis: usize| {
        let mut values: Vec<f32> = points.sample.iter().map(|(_, position)| position[axis]).collect();
        robust_span(&mut values, 0.0)
    };
    let [[west, east], [south, north]] = [0, 1].map(of_axis);
    let [width, height] = [east - west, north - south];
    let least = (width.max(height) / MOST).max(1e-3);
    let side = (IN_CELL * width * height / points.count.max(1) as f32).sqrt().max(least);
    // A cell more on all sides: the sample may lack the outermost points.
    let shape = [width, height].map(|extent| (extent / side) as usize + 3);
    let place = |_: u32, position: Vec3| [(position.x - west) / side + 1.0, (position.y - south) / side + 1.0];
    in_cells(points, shape, place, |_| side * side)
}

/// Points in the cell of each point over the area of cells of its row; `place` is where points are, in cells.
fn in_cells(
    points: &Points<'_>,
    [columns, rows]: [usize; 2],
    place: impl Fn(u32, Vec3) -> [f32; 2] + Sync,
    area: impl Fn(usize) -> f32 + Sync,
) -> Vec<f32> {
    let cell = |row: usize| {
        let [x, y] = place(row as u32, points.get(row as u32)?);
        let index = |value: f32, count: usize| Some(value as usize).filter(|&index| value >= 0.0 && index < count);
        Some((index(x, columns)?, index(y, rows)?))
    };
    let counts: Vec<AtomicU32> = (0..rows * columns).map(|_| AtomicU32::new(0)).collect();
    parallel::for_each_range(points.len(), CHUNK, |range| {
        for (column, row) in range.filter_map(cell) {
            counts[row * columns + column].fetch_add(1, Ordering::Relaxed);
        }
    });
    let mut densities = vec![f32::NAN; points.len()];
    parallel::for_each_chunk(&mut densities, CHUNK, |chunk, densities| {
        for (index, density) in densities.iter_mut().enumerate() {
            if let Some((column, row)) = cell(chunk * CHUNK + index) {
                let count = counts[row * columns + column].load(Ordering::Relaxed);
                *density = count as f32 / area(row);
            }
        }
    });
    densities
}

/// Side of the cells, rad.
fn side(points: &Points<'_>) -> f32 {
    let [width, height] = [0, 1].map(|axis| {
        let angles = points.sample.iter().map(|&(row, position)| points.angles(row, position)[axis]);
        let [low, high] = robust_span(&mut angles.filter(|angle| angle.is_finite()).collect::<Vec<_>>(), 0.002);
        high - low
    });
    let side = (IN_CELL * width * height / points.count.max(1) as f32).sqrt();
    side.clamp(FINEST.to_radians(), COARSEST.to_radians())
}

#[cfg(test)]
mod tests {
    use super::*;
    use cloud::PointCloud;
    use ground::report::Report;

    #[test]
    fn ground_that_two_strips_cover_is_twice_as_dense() {
        let mut cloud = PointCloud::default();
        let mut strip = |from: i32, to: i32| {
            for x in from * 4..to * 4 {
                for y in 0..400 {
                    cloud.columns.x.push(x as f32 / 4.0 + 0.125);
                    cloud.columns.y.push(y as f32 / 4.0 + 0.125);
                    cloud.columns.z.push((x % 7) as f32);
                }
            }
        };
        strip(-50, 20);
        strip(-20, 50);
        cloud.len = cloud.columns.x.len();
        let densities = on_ground(&Points::new(&cloud, &mut Report::default()));
        // A cell has five or six rows of points each way: right on average.
        let mean = |from: f32, to: f32| {
            let inside = |row: &usize| {
                (5.0..95.0).contains(&cloud.columns.y[*row]) && (from..to).contains(&cloud.columns.x[*row].abs())
            };
            let found: Vec<f32> = (0..cloud.len).filter(inside).map(|row| 1.0 / densities[row]).collect();
            found.len() as f32 / found.iter().sum::<f32>()
        };
        let [twice, once] = [mean(0.0, 18.0), mean(22.0, 45.0)];
        assert!((twice / 32.0 - 1.0).abs() < 0.06 && (once / 16.0 - 1.0).abs() < 0.06, "{twice} {once}");
    }

    #[test]
    fn evenly_covered_is_even_and_what_is_scanned_twice_counts_twice() {
        // 20 points per square degree ahead; and once more to the left.
        let mut cloud = PointCloud::default();
        let mut ring = |from: i32, to: i32| {
            for azimuth in from * 10..to * 10 {
                for elevation in -20..20 {
                    let (azimuth, elevation) = (azimuth as f32 / 10.0 + 0.05, elevation as f32 / 2.0 + 0.25);
                    let (azimuth, elevation) = (azimuth.to_radians(), elevation.to_radians());
                    cloud.columns.x.push(5.0 * elevation.cos() * azimuth.cos());
                    cloud.columns.y.push(5.0 * elevation.cos() * azimuth.sin());
                    cloud.columns.z.push(5.0 * elevation.sin());
                }
            }
        };
        ring(-40, 40);
        let once = 80 * 10 * 40;
        ring(10, 40);
        // And a miss.
        for axis in [&mut cloud.columns.x, &mut cloud.columns.y, &mut cloud.columns.z] {
            axis.push(f32::NAN);
        }
        cloud.len = cloud.columns.x.len();
        let points = Points::new(&cloud, &mut Report::default());
        let densities = of(&points);
        assert!(densities.last().unwrap().is_nan());
        let mean = |rows: &mut dyn Iterator<Item = usize>| {
            let values: Vec<f32> = rows.map(|row| densities[row]).collect();
            values.iter().sum::<f32>() / values.len() as f32
        };
        let right = mean(&mut (0..40 * 10 * 40));
        assert!((right - 20.0).abs() < 0.06 * 20.0, "{right}");
        let left = mean(&mut (once + 5 * 10 * 40..cloud.len - 1 - 5 * 10 * 40));
        assert!((left - 40.0).abs() < 0.06 * 40.0, "{left}");
    }
}
