//! The pinhole camera that took a cloud, found from the directions of its pixels.

use crate::{Field, PointCloud};
use emitter::Intrinsics;
use std::f32::consts::FRAC_PI_2;

/// Tolerated root-mean-square deviation of pixels: noise of directions, and rounding of f32.
const SLACK_PX: f64 = 0.5;

/// The camera of `cloud` if it is an image with directions, all of them ahead and on a grid of rows and columns.
pub(super) fn of(cloud: &PointCloud) -> Option<Intrinsics> {
    let [_, columns] = cloud.organised.filter(|shape| shape.iter().all(|&count| count > 1))?;
    let c = &cloud.columns;
    let all = [Field::Azimuth, Field::Elevation].iter().all(|&field| cloud.fields.contains(field));
    let directions = || c.azimuth.iter().zip(&c.elevation).enumerate().filter(|(_, (a, e))| (*a + *e).is_finite());
    if !all || directions().any(|(_, (azimuth, _))| azimuth.abs() >= FRAC_PI_2) {
        return None;
    }
    let across = CameraAxis::of(|| {
        directions().map(|(row, (azimuth, _))| ((row as u32 % columns).into(), f64::from(*azimuth).tan()))
    })?;
    let down = CameraAxis::of(|| {
        directions().map(|(row, (azimuth, elevation))| {
            ((row as u32 / columns).into(), f64::from(*elevation).tan() / f64::from(*azimuth).cos())
        })
    })?;
    Some(Intrinsics::new([across.focal, down.focal], [across.centre, down.centre]))
}

/// One direction of an image.
struct CameraAxis {
    focal: f64,
    centre: f64,
}

impl CameraAxis {
    /// The line through `points`: position of the pixel, and how far left or up its ray is for each metre ahead.
    fn of<I: Iterator<Item = (f64, f64)>>(points: impl Fn() -> I) -> Option<CameraAxis> {
        let count = points().count() as f64;
        let (sum_x, sum_y) = points().fold((0.0, 0.0), |(x, y), point| (x + point.0, y + point.1));
        let (mean_x, mean_y) = (sum_x / count, sum_y / count);
        let (xx, xy) = points()
            .fold((0.0, 0.0), |(xx, xy), (x, y)| (xx + (x - mean_x) * (x - mean_x), xy + (x - mean_x) * (y - mean_y)));
        let focal = -xx / xy;
        let centre = mean_x + mean_y * focal;
        let off = points().map(|(x, y)| (centre - y * focal - x).powi(2)).sum::<f64>() / count;
        (focal > 0.0 && focal.is_finite() && off < SLACK_PX * SLACK_PX).then_some(CameraAxis { focal, centre })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::FieldSet;
    use crate::test_sensor::TestSensor;
    use ground::angle::azimuth_elevation;

    /// What a sensor with `pattern` sees of a wall, with a row for each beam.
    fn scan(pattern: &str) -> PointCloud {
        let sensor = TestSensor::new(pattern);
        let beams = sensor.beams();
        let mut cloud = PointCloud::new(FieldSet::parse("azimuth,elevation").unwrap(), beams.len()).unwrap();
        for beam in 0..beams.len() {
            let [azimuth, elevation] = azimuth_elevation(beams.direction(beam).to_array());
            (cloud.columns.azimuth[beam], cloud.columns.elevation[beam]) = (azimuth, elevation);
        }
        cloud.organised = Some([beams.rows, beams.columns]);
        cloud
    }

    #[test]
    fn the_field_of_view_of_a_camera_is_found() {
        let camera = of(&scan("{type: pinhole, resolution: [80, 60], fov_deg: [90, 60]}")).unwrap();
        let expected = [40.0, 30.0 / 30f64.to_radians().tan(), 39.5, 29.5];
        let found = [camera.focal[0], camera.focal[1], camera.centre[0], camera.centre[1]];
        assert!(found.iter().zip(expected).all(|(found, expected)| (found - expected).abs() < 1e-4), "{camera:?}");
    }

    #[test]
    fn what_spins_is_no_camera() {
        let pattern = "{type: spinning, azimuth: {fov_deg: 120, step_deg: 1}, elevation: {fov_deg: 30, step_deg: 2}}";
        let mut cloud = scan(pattern);
        assert_eq!(of(&cloud), None);
        cloud.organised = None;
        assert_eq!(of(&cloud), None);
        assert_eq!(of(&PointCloud { organised: Some([2, 0]), ..PointCloud::default() }), None);
    }
}
