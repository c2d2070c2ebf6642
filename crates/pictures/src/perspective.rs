//! The cloud in perspective, from behind and above the sensor.

use super::Page;
use super::boxes::{self, BoxEdges};
use super::canvas::{GROUND, Picture};
use super::cutaway::Cutaway;
use super::legend::counted;
use super::paint::Paint;
use super::points::{Points, quantile, robust_span, wide};
use super::splat::{self, SplatStamp, Splats};
use glam::{Quat, Vec2, Vec3};

/// How far the camera may look down: the angle at which the cloud best fills the picture is used.
const PITCHES_DEG: [f32; 7] = [16.0, 20.0, 24.0, 28.0, 32.0, 36.0, 40.0];
/// Angle of the camera to the right of the sensor's heading, so that boxes show two sides.
const YAW_DEG: f32 = 18.0;
/// Tangents of half the angles of view: 50 degrees wide, 16 : 9.
const HALF_WIDTH: f32 = 0.466;
const HALF_HEIGHT: f32 = HALF_WIDTH * 9.0 / 16.0;
/// Fraction of the points at each edge that may be outside the picture.
const OUTSIDE: f32 = 0.006;

/// A pinhole camera.
struct PinholeCamera {
    position: Vec3,
    right: Vec3,
    up: Vec3,
    forward: Vec3,
    /// Pixels per unit of tangent.
    focal: f32,
    centre: Vec2,
}

impl PinholeCamera {
    /// The camera that frames the visible part of `points`.
    fn new(points: &Points<'_>, picture: &Picture, seen: impl Fn(Vec3, Vec3) -> bool) -> PinholeCamera {
        // The heading of a sensor that looks straight down is the direction of its upper edge.
        let heading = [Vec3::X, Vec3::Z]
            .map(|axis| (points.orientation * axis).with_z(0.0))
            .into_iter()
            .find(|heading| heading.length() > 0.1)
            .unwrap_or(Vec3::X)
            .normalize();
        let ahead = Quat::from_rotation_z(YAW_DEG.to_radians()) * heading;
        let cameras = PITCHES_DEG.map(|pitch| {
            let pitch = pitch.to_radians();
            let forward = ahead * pitch.cos() - Vec3::Z * pitch.sin();
            let seen: Vec<Vec3> = points.scene.iter().copied().filter(|&position| seen(position, -forward)).collect();
            PinholeCamera::fit(forward, if seen.is_empty() { &points.scene } else { &seen }, picture)
        });
        let [first, rest @ ..] = cameras;
        rest.into_iter().fold(first, |best, next| if next.1 < best.1 { next } else { best }).0
    }

    /// The camera that looks along `forward` and frames `sample`, and how much of the picture's width or height it
    /// leaves empty, as a difference of logarithms.
    fn fit(forward: Vec3, sample: &[Vec3], picture: &Picture) -> (PinholeCamera, f32) {
        let right = forward.cross(Vec3::Z).normalize();
        let up = right.cross(forward);
        // The four sides of the view are planes that should touch the cloud: they are placed at the offsets of all but
        // the outermost points, and two opposite ones meet in a line through the camera.
        let meet = |axis: Vec3, tangent: f32| {
            let span = |tangent: f32| {
                let mut offsets: Vec<f32> = sample.iter().map(|p| p.dot(axis) + tangent * p.dot(forward)).collect();
                robust_span(&mut offsets, OUTSIDE)
            };
            let ([low, _], [_, high]) = (span(tangent), span(-tangent));
            (low.midpoint(high), (low - high) / (2.0 * tangent))
        };
        // A small margin around the cloud.
        let (across, along_width) = meet(right, 0.94 * HALF_WIDTH);
        let (upward, along_height) = meet(up, 0.94 * HALF_HEIGHT);
        // However narrow the cloud, the camera is in front of it.
        let mut depths: Vec<f32> = sample.iter().map(|p| p.dot(forward)).collect();
        let middle = quantile(&mut depths, 0.5);
        let [before, _] = wide([middle, middle]);
        let along = along_width.min(along_height).min(before);
        let empty =
            ((middle - along_width).max(f32::MIN_POSITIVE) / (middle - along_height).max(f32::MIN_POSITIVE)).ln();
        let camera = PinholeCamera {
            position: right * across + up * upward + forward * along,
            right,
            up,
            forward,
            focal: picture.width as f32 / (2.0 * HALF_WIDTH),
            centre: Vec2::new(picture.width as f32, picture.height as f32) / 2.0,
        };
        (camera, empty.abs())
    }

    /// Pixels from the top left corner and distance along the view; none behind the camera.
    fn project(&self, position: Vec3) -> Option<(Vec2, f32)> {
        let from_camera = position - self.position;
        let depth = from_camera.dot(self.forward);
        let at = Vec2::new(from_camera.dot(self.right), -from_camera.dot(self.up)) * (self.focal / depth);
        (depth > 0.0).then_some((self.centre + at, depth))
    }

    /// The part of an edge in front of the camera, in pixels.
    fn line(&self, edge: [Vec3; 2]) -> Option<[Vec2; 2]> {
        /// Nearest depth, as a part of the farther end's.
        const NEAREST: f32 = 1e-3;
        let depths = edge.map(|end| (end - self.position).dot(self.forward));
        let nearest = NEAREST * depths[0].max(depths[1]);
        let cut = |end: usize| {
            let part = (nearest - depths[end]) / (depths[1 - end] - depths[end]);
            if depths[end] < nearest { edge[end].lerp(edge[1 - end], part) } else { edge[end] }
        };
        Some([self.project(cut(0))?.0, self.project(cut(1))?.0])
    }
}

/// The view of `points`; what it leaves out is added to `notes`.
pub(super) fn draw(
    points: &Points<'_>,
    paint: &Paint<'_>,
    outlines: &[BoxEdges],
    page: &Page,
    notes: &mut Vec<String>,
) -> Picture {
    let width = page.inner();
    let height = (width as f32 * HALF_HEIGHT / HALF_WIDTH) as u32;
    let mut picture = Picture::new(width, height, GROUND);
    let cutaway = Cutaway::new(points);
    let seen = |position: Vec3, toward_viewer: Vec3| {
        position.z <= cutaway.ceiling && !cutaway.seen_from_behind(position, toward_viewer)
    };
    let camera = PinholeCamera::new(points, &picture, seen);

    let stamp = SplatStamp::disc(splat::diameter(points.count, &picture, 3.0 * page.scale));
    let splats = Splats::new(width, height);
    let behind = points.count_rows(|row| {
        let Some(position) = points.get(row) else { return false };
        // Backscatter from the air is not a wall.
        let shown = !points.cause(row).has_surface() || seen(position, -camera.forward);
        if shown && let Some((at, depth)) = camera.project(position) {
            splats.put(at, &stamp, depth, row);
        }
        !shown && position.z <= cutaway.ceiling
    });
    // A neighbour nearer by 5 % of the distance gives the maximum darkening.
    splats.draw(&mut picture, paint, |depth| depth.ln() / 0.05);
    boxes::draw(&mut picture, outlines, page, |edge| camera.line(edge));

    let mark = 8.0 * page.scale;
    let room = Vec2::new(width as f32, height as f32) - mark;
    let sensor =
        camera.project(points.sensor).filter(|(at, _)| at.cmpgt(Vec2::splat(mark)).all() && at.cmplt(room).all());
    if let Some((at, _)) = sensor {
        let ahead = camera.project(points.sensor + points.orientation * Vec3::X).map_or(at, |(ahead, _)| ahead);
        picture.sensor_mark(at, ahead, mark);
    }
    if cutaway.ceiling.is_finite() {
        notes.push("cut open under the ceiling".to_owned());
    }
    if behind > 0 {
        notes.push(format!("{} seen from behind left out", counted(behind, "point")));
    }
    picture
}

#[cfg(test)]
mod tests {
    use super::super::ColorBy;
    use super::*;
    use cloud::PointCloud;
    use ground::cause::Cause;
    use ground::pose::Pose;
    use ground::report::Report;

    /// Corners and edges of a box from `low` to `high`, and the sensor at `pose`.
    fn scene(pose: Pose, low: Vec3, high: Vec3) -> PointCloud {
        let mut cloud = PointCloud { sensor_pose: pose, ..PointCloud::default() };
        for i in 0..1000 {
            let t = Vec3::new((i % 10) as f32, (i / 10 % 10) as f32, (i / 100) as f32) / 9.0;
            let position = low + t * (high - low);
            cloud.columns.x.push(position.x);
            cloud.columns.y.push(position.y);
            cloud.columns.z.push(position.z);
        }
        cloud.len = 1000;
        cloud
    }

    fn camera(cloud: &PointCloud) -> PinholeCamera {
        let points = Points::new(cloud, &mut Report::default());
        PinholeCamera::new(&points, &Picture::new(1600, 900, GROUND), |_, _| true)
    }

    #[test]
    fn the_cloud_fills_the_picture_and_stays_inside() {
        let low = Vec3::new(4.0, -3.0, 0.0);
        let cloud = scene(Pose::at(0.0, 0.0, 1.5), low, Vec3::new(12.0, 3.0, 2.0));
        let camera = camera(&cloud);
        let points = Points::new(&cloud, &mut Report::default());
        let (mut first, mut last) = (Vec2::INFINITY, Vec2::NEG_INFINITY);
        for row in 0..1000 {
            let (at, _) = camera.project(points.get(row).unwrap()).unwrap();
            (first, last) = (first.min(at), last.max(at));
        }
        assert!(first.x > -40.0 && first.y > -40.0 && last.x < 1640.0 && last.y < 940.0, "{first} {last}");
        assert!(last.x - first.x > 1280.0 || last.y - first.y > 720.0, "{first} {last}");
        // Behind and above the sensor, looking the same way; left is left and up is up.
        assert!(camera.position.x < 0.0 && camera.position.z > 1.5, "{}", camera.position);
        assert!(camera.forward.x > 0.7, "{}", camera.forward);
        let at = |x, y, z| camera.project(Vec3::new(x, y, z)).unwrap().0;
        assert!(at(8.0, 2.0, 1.0).x < at(8.0, -2.0, 1.0).x);
        assert!(at(8.0, 0.0, 2.0).y < at(8.0, 0.0, 0.0).y);
    }

    #[test]
    fn the_thin_end_of_a_wall_is_in_the_picture() {
        let mut cloud = scene(Pose::at(0.0, 0.0, 1.5), Vec3::new(4.0, -3.0, 0.0), Vec3::new(12.0, 3.0, 2.0));
        let c = &mut cloud.columns;
        for column in [&mut c.x, &mut c.y, &mut c.z] {
            *column = column.repeat(10);
        }
        // A hundredth of the points, of which only the outermost may be cut off.
        c.x.extend([12.0; 100]);
        c.y.extend((0..100).map(|i| -3.0 - 0.06 * i as f32));
        c.z.extend([2.0; 100]);
        cloud.len = c.x.len();
        let (at, _) = camera(&cloud).project(Vec3::new(12.0, -5.4, 2.0)).unwrap();
        assert!((0.0..1600.0).contains(&at.x) && (0.0..900.0).contains(&at.y), "{at}");
    }

    #[test]
    fn backscatter_from_the_air_neither_frames_the_picture_nor_is_cut() {
        let fog = Cause::Fog as u8;
        let clear = scene(Pose::at(0.0, 0.0, 1.5), Vec3::new(4.0, -3.0, 0.0), Vec3::new(12.0, 3.0, 2.0));
        let mut foggy = clear.clone();
        let far = scene(Pose::IDENTITY, Vec3::new(-20.0, -9.0, 0.0), Vec3::new(-9.0, 9.0, 30.0));
        foggy.columns.append(&far.columns);
        foggy.len += far.len;
        assert_ne!(camera(&foggy).position, camera(&clear).position);
        foggy.columns.cause = [0, fog].map(|cause| [cause; 1000]).concat();
        assert_eq!(camera(&foggy).position, camera(&clear).position);

        // Between sensor and viewer.
        let mut wall = scene(Pose::at(0.0, 0.0, 1.0), Vec3::new(-3.0, -2.0, 0.0), Vec3::new(-2.9, 2.0, 2.5));
        let cut = |cloud: &PointCloud| {
            let (mut notes, mut report) = (Vec::new(), Report::default());
            let points = Points::new(cloud, &mut report);
            let paint = Paint::new(cloud, &points, ColorBy::Height, &mut report);
            draw(&points, &paint, &[], &Page::new(400), &mut notes);
            notes.iter().any(|note| note.contains("seen from behind"))
        };
        assert!(cut(&wall));
        wall.columns.cause = vec![fog; 1000];
        assert!(!cut(&wall));
    }

    #[test]
    fn a_sensor_that_looks_down_heads_where_its_top_points() {
        let pose = Pose::at(0.0, 0.0, 5.0).with_rpy_deg(0.0, 90.0, 90.0);
        let camera = camera(&scene(pose, Vec3::splat(-1.0), Vec3::new(1.0, 1.0, 0.0)));
        assert!(camera.forward.y > 0.7, "{}", camera.forward);
    }

    #[test]
    fn a_single_point_stands_before_the_camera() {
        let camera = camera(&scene(Pose::IDENTITY, Vec3::splat(1e5), Vec3::splat(1e5)));
        let (at, depth) = camera.project(Vec3::splat(1e5)).unwrap();
        assert!(depth > 0.0 && (at - Vec2::new(800.0, 450.0)).length() < 400.0, "{at} {depth}");
    }
}
