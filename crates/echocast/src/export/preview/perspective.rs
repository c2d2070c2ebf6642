//! The cloud in perspective, from behind and above the sensor.

use super::Page;
use super::canvas::{GROUND, Picture};
use super::cutaway;
use super::paint::Paint;
use super::points::{Points, quantile, wide};
use super::splat::{self, Splats, Stamp};
use glam::{Vec2, Vec3};
use rayon::prelude::*;

/// How far the camera looks down.
const PITCH_DEG: f32 = 30.0;
/// How far the camera stands to the right of the sensor's heading: boxes show two sides.
const YAW_DEG: f32 = 22.0;
/// Tangents of half the angles of view: 50 degrees wide, 16 : 9.
const HALF_WIDTH: f32 = 0.466;
const HALF_HEIGHT: f32 = HALF_WIDTH * 9.0 / 16.0;
/// Part of the points at each edge that may lie outside of the picture.
const OUTSIDE: f32 = 0.005;

/// A pinhole camera.
struct Camera {
    position: Vec3,
    right: Vec3,
    up: Vec3,
    forward: Vec3,
    /// Pixels per unit of tangent.
    focal: f32,
    centre: Vec2,
}

impl Camera {
    /// The camera that has the seen part of `points` in the picture.
    fn new(points: &Points<'_>, width: u32, height: u32, seen: impl Fn(Vec3, Vec3) -> bool) -> Camera {
        // A sensor that looks straight down has its heading where its upper edge points.
        let heading = [Vec3::X, Vec3::Z]
            .map(|axis| (points.orientation * axis).with_z(0.0))
            .into_iter()
            .find(|heading| heading.length() > 0.1)
            .unwrap_or(Vec3::X)
            .normalize();
        let (yaw, pitch) = (YAW_DEG.to_radians(), PITCH_DEG.to_radians());
        let ahead = heading * yaw.cos() - heading.cross(Vec3::Z) * yaw.sin();
        let forward = ahead * pitch.cos() - Vec3::Z * pitch.sin();
        let right = ahead.cross(Vec3::Z).normalize();
        let up = right.cross(forward);

        // The four sides of the view are planes that should touch the cloud; where they stand follows from
        // the offsets of the points along them. (across, along) are coordinates in the plane of one pair.
        let sample: Vec<Vec3> =
            points.sample().map(|(_, position)| position).filter(|&position| seen(position, -forward)).collect();
        let fit = |axis: Vec3, tangent: f32| {
            let offsets = |sign: f32, q: f32| {
                let mut values: Vec<f32> =
                    sample.iter().map(|p| p.dot(axis) + sign * tangent * p.dot(forward)).collect();
                quantile(&mut values, q)
            };
            let [low, high] = [offsets(1.0, OUTSIDE), offsets(-1.0, 1.0 - OUTSIDE)];
            (low.midpoint(high), (low - high) / (2.0 * tangent))
        };
        // A little room around the cloud.
        let (across, back) = fit(right, 0.95 * HALF_WIDTH);
        let (upward, back_upward) = fit(up, 0.95 * HALF_HEIGHT);
        // Points too close together for any distance between them still need some from the camera.
        let nearest = sample.iter().map(|p| p.dot(forward)).fold(f32::INFINITY, f32::min);
        let [closest, _] = wide([nearest, nearest]);
        let along = back.min(back_upward).min(closest);
        Camera {
            position: right * across + up * upward + forward * along,
            right,
            up,
            forward,
            focal: width as f32 / (2.0 * HALF_WIDTH),
            centre: Vec2::new(width as f32, height as f32) / 2.0,
        }
    }

    /// Pixels from the upper left corner and distance along the view; none behind the camera.
    fn project(&self, position: Vec3) -> Option<(Vec2, f32)> {
        let from_camera = position - self.position;
        let depth = from_camera.dot(self.forward);
        let at = Vec2::new(from_camera.dot(self.right), -from_camera.dot(self.up)) * (self.focal / depth);
        (depth > 0.0).then_some((self.centre + at, depth))
    }
}

/// The view of `points`; what it leaves out goes to `notes`.
pub(super) fn draw(points: &Points<'_>, paint: &Paint<'_>, page: &Page, notes: &mut Vec<String>) -> Picture {
    let width = page.inner();
    let height = (width as f32 * HALF_HEIGHT / HALF_WIDTH) as u32;
    let mut picture = Picture::new(width, height, GROUND);
    let ceiling = cutaway::ceiling(points).unwrap_or(f32::INFINITY);
    let seen = |position: Vec3, toward_viewer: Vec3| {
        position.z <= ceiling && !cutaway::from_behind(points, position, toward_viewer)
    };
    let camera = Camera::new(points, width, height, seen);

    // Splats of points near the camera are larger than those of the middle distance.
    let mut depths: Vec<f32> = points.sample().filter_map(|(_, position)| Some(camera.project(position)?.1)).collect();
    let middle = quantile(&mut depths, 0.5);
    let usual = splat::diameter(points.count, &picture, 3.0 * page.scale);
    let stamps: Vec<Stamp> = (1..=32).map(|samples| Stamp::disc(samples as f32 / splat::SAMPLES as f32)).collect();
    let splats = Splats::new(width, height);
    points.rows().for_each(|row| {
        let Some(position) = points.get(row).filter(|&position| seen(position, -camera.forward)) else {
            return;
        };
        if let Some((at, depth)) = camera.project(position) {
            let diameter = usual * (middle / depth).sqrt().min(2.0);
            let samples = (diameter * splat::SAMPLES as f32).round() as usize;
            splats.put(at, &stamps[samples.clamp(1, stamps.len()) - 1], depth, row);
        }
    });
    // A neighbour nearer by a tenth of the distance darkens as much as one can.
    splats.draw(&mut picture, paint, |depth| depth.ln() / 0.1);

    if let Some((at, _)) = camera.project(points.sensor) {
        let ahead = camera.project(points.sensor + points.orientation * Vec3::X).map_or(at, |(ahead, _)| ahead);
        picture.sensor_mark(at, ahead, 8.0 * page.scale);
    }
    if ceiling.is_finite() {
        notes.push("cut open under the ceiling".to_owned());
    }
    picture
}
