//! Density with which the sensor has covered its view.

use super::points::{CHUNK, Points, robust_span};
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
    let columns = (TAU / side).ceil() as usize;
    let rows = (PI / side).ceil() as usize;
    let cell = |row: usize| {
        let at = points.angles(row as u32, points.get(row as u32)?);
        let place = |value: f32, count: usize| Some(((value / side) as usize).min(count - 1)).filter(|_| value >= 0.0);
        Some((place(at.x.rem_euclid(TAU), columns)?, place(at.y + FRAC_PI_2, rows)?))
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
                let below = row as f32 * side - FRAC_PI_2;
                let solid_angle = side * ((below + side).min(FRAC_PI_2).sin() - below.sin());
                let count = counts[row * columns + column].load(Ordering::Relaxed);
                *density = count as f32 / (solid_angle * 1_f32.to_degrees().powi(2));
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
