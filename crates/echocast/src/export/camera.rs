//! The pinhole camera that took a cloud, found from the directions of its pixels.

use crate::cloud::{Field, PointCloud};
use crate::emitter::Intrinsics;
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
    let across = Axis::of(|| {
        directions().map(|(row, (azimuth, _))| ((row as u32 % columns).into(), f64::from(*azimuth).tan()))
    })?;
    let down = Axis::of(|| {
        directions().map(|(row, (azimuth, elevation))| {
            ((row as u32 / columns).into(), f64::from(*elevation).tan() / f64::from(*azimuth).cos())
        })
    })?;
    Some(Intrinsics { focal: [across.focal, down.focal], centre: [across.centre, down.centre] })
}

/// One direction of an image.
struct Axis {
    focal: f64,
    centre: f64,
}

impl Axis {
    /// The line through `points`: position of the pixel, and how far left or up its ray is for each metre ahead.
    fn of<I: Iterator<Item = (f64, f64)>>(points: impl Fn() -> I) -> Option<Axis> {
        let count = points().count() as f64;
        let (sum_x, sum_y) = points().fold((0.0, 0.0), |(x, y), point| (x + point.0, y + point.1));
        let (mean_x, mean_y) = (sum_x / count, sum_y / count);
        let (xx, xy) = points()
            .fold((0.0, 0.0), |(xx, xy), (x, y)| (xx + (x - mean_x) * (x - mean_x), xy + (x - mean_x) * (y - mean_y)));
        let focal = -xx / xy;
        let centre = mean_x + mean_y * focal;
        let off = points().map(|(x, y)| (centre - y * focal - x).powi(2)).sum::<f64>() / count;
        (focal > 0.0 && focal.is_finite() && off < SLACK_PX * SLACK_PX).then_some(Axis { focal, centre })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ScanOptions;
    use crate::cloud::FieldSet;
    use crate::{Pose, Scene, Sensor, Trajectory};

    fn scan(sensor: &str, width: u32) -> PointCloud {
        let scene = Scene::load(concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/scenes/indoor-1.glb")).unwrap();
        let sensor = Sensor::from_yaml(sensor, ".").unwrap();
        let trajectory = Trajectory::fixed(Pose::at(-6.0, 6.0, 1.2));
        let fields = FieldSet::parse("default,azimuth,elevation").unwrap();
        let options = ScanOptions { fields, organised: true, ..ScanOptions::default() };
        let cloud = scene.build().unwrap().scan(&sensor, &trajectory, &options).unwrap();
        assert_eq!(cloud.organised.unwrap()[1], width);
        cloud
    }

    #[test]
    fn the_field_of_view_of_a_camera_is_found() {
        let pattern = "pattern: {type: pinhole, resolution: [80, 60], fov_deg: [90, 60]}";
        let camera = of(&scan(&format!("{{name: a, kind: tof, {pattern}}}"), 80)).unwrap();
        let expected = [40.0, 30.0 / 30f64.to_radians().tan(), 39.5, 29.5];
        let found = [camera.focal[0], camera.focal[1], camera.centre[0], camera.centre[1]];
        assert!(found.iter().zip(expected).all(|(found, expected)| (found - expected).abs() < 1e-4), "{camera:?}");
    }

    #[test]
    fn what_spins_is_no_camera() {
        let pattern = "{type: spinning, azimuth: {fov_deg: 120, step_deg: 1}, elevation: {fov_deg: 30, step_deg: 2}}";
        let mut cloud = scan(&format!("{{name: a, kind: lidar, pattern: {pattern}}}"), 121);
        assert_eq!(of(&cloud), None);
        cloud.organised = None;
        assert_eq!(of(&cloud), None);
        assert_eq!(of(&PointCloud { organised: Some([2, 0]), ..PointCloud::default() }), None);
    }
}
