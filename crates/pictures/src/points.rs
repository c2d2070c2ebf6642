//! Positions of a cloud as a preview needs them: finite, in single precision, relative to the sensor.

use cloud::{Frame, PointCloud};
use glam::{Quat, Vec2, Vec3};
use ground::cause::Cause;
use ground::parallel;
use ground::pose::Pose;
use ground::report::Report;
use std::ops::Range;

/// Positions farther out than this are treated as misses, so that squares stay finite, metres.
const FARTHEST: f32 = 1e15;
/// Most rows in a picture, which numbers them in 32 bits.
const MOST_ROWS: usize = u32::MAX as usize;
/// Rows that are worth a task of their own.
pub(super) const CHUNK: usize = 1 << 16;
/// Most points of a sample; a percentile of it is accurate to a thousandth.
pub(super) const SAMPLE: usize = 50_000;
/// Fraction of a sample that must be on surfaces to define where the scene is.
const SCENE: f32 = 0.01;

/// The positions of a cloud, relative to its origin.
pub(super) struct Points<'a> {
    x: &'a [f32],
    y: &'a [f32],
    z: &'a [f32],
    /// Azimuth and elevation of the beams as reported, rad; `None` if unknown.
    reported: Option<[&'a [f32]; 2]>,
    /// Numbers of causes; empty if unknown.
    causes: &'a [u8],
    /// Number of rows that have a position.
    pub count: usize,
    /// Some rows with their positions, evenly spread over the cloud.
    pub sample: Vec<(u32, Vec3)>,
    /// The positions of the sample on surfaces, or all if those are few: what pictures are framed by.
    pub scene: Vec<Vec3>,
    /// Height of z = 0 in the cloud's frame, metres.
    pub height_origin: f64,
    /// Position of the sensor at the start.
    pub sensor: Vec3,
    /// Rotation from the sensor frame to the cloud's.
    pub orientation: Quat,
}

impl<'a> Points<'a> {
    /// The positions of `cloud`; none, with a warning, if it lacks them.
    pub(super) fn new(cloud: &'a PointCloud, report: &mut Report) -> Self {
        let columns = &cloud.columns;
        let rows = cloud.len.min(MOST_ROWS);
        if rows < cloud.len {
            report.warn(format!("preview: rows after the first {MOST_ROWS} are left out"));
        }
        let axes = [&columns.x, &columns.y, &columns.z];
        let here = axes.iter().all(|axis| axis.len() >= rows);
        if !here {
            report.warn("preview: the cloud has no positions, which require the columns x, y and z");
        }
        let [x, y, z] = axes.map(|axis| if here { &axis[..rows] } else { &[][..] });
        let pose = match cloud.frame {
            Frame::World => cloud.sensor_pose,
            Frame::Sensor => Pose::IDENTITY,
        };
        let mut points = Points {
            x,
            y,
            z,
            reported: (columns.azimuth.len() >= rows && columns.elevation.len() >= rows)
                .then_some([&columns.azimuth, &columns.elevation]),
            causes: if columns.cause.len() >= rows { &columns.cause[..rows] } else { &[] },
            count: 0,
            sample: Vec::new(),
            scene: Vec::new(),
            height_origin: cloud.origin.z,
            sensor: (pose.position - cloud.origin).as_vec3(),
            orientation: pose.orientation.as_quat(),
        };
        points.count = points.count_rows(|row| points.get(row).is_some());
        let step = points.count.div_ceil(SAMPLE).max(1);
        let hits = (0..points.len() as u32).filter_map(|row| Some((row, points.get(row)?)));
        points.sample = hits.step_by(step).collect();
        let places = |on: &dyn Fn(u32) -> bool| {
            points.sample.iter().filter(|&&(row, _)| on(row)).map(|&(_, position)| position).collect::<Vec<_>>()
        };
        let on_surfaces = places(&|row| points.cause(row).has_surface());
        let enough = on_surfaces.len() as f32 >= SCENE * points.sample.len() as f32;
        points.scene = if enough { on_surfaces } else { places(&|_| true) };
        points
    }

    /// Number of rows, with and without a position.
    pub(super) fn len(&self) -> usize {
        self.x.len()
    }

    /// Calls `counts` for every row, in parallel, and returns how often it was true.
    pub(super) fn count_rows(&self, counts: impl Fn(u32) -> bool + Sync) -> usize {
        let count = |rows: Range<usize>| rows.filter(|&row| counts(row as u32)).count();
        parallel::map_reduce(self.len(), CHUNK, count, |left, right| left + right)
    }

    /// Position of row `row`; none for a miss.
    pub(super) fn get(&self, row: u32) -> Option<Vec3> {
        let row = row as usize;
        let position = Vec3::new(self.x[row], self.y[row], self.z[row]);
        (position.abs().max_element() < FARTHEST && position.is_finite()).then_some(position)
    }

    /// Whether the causes of points are known.
    pub(super) fn have_causes(&self) -> bool {
        self.causes.len() == self.len()
    }

    /// The cause of the point of row `row`; a surface unless known otherwise.
    pub(super) fn cause(&self, row: u32) -> Cause {
        self.causes.get(row as usize).and_then(|&number| Cause::from_number(number)).unwrap_or_default()
    }

    /// Distance of `position` from the sensor, metres.
    pub(super) fn distance(&self, position: Vec3) -> f32 {
        position.distance(self.sensor)
    }

    /// `position` in the sensor frame: x forward, y left, z up.
    pub(super) fn in_sensor_frame(&self, position: Vec3) -> Vec3 {
        self.orientation.inverse() * (position - self.sensor)
    }

    /// Azimuth and elevation of the beam of row `row`, as reported, else those of its `position`, rad.
    pub(super) fn angles(&self, row: u32, position: Vec3) -> Vec2 {
        match self.reported {
            Some([azimuth, elevation]) => Vec2::new(azimuth[row as usize], elevation[row as usize]),
            None => angles(self.in_sensor_frame(position)),
        }
    }
}

/// Angles of a direction in the sensor frame: azimuth, elevation, rad.
pub(super) fn angles(direction: Vec3) -> Vec2 {
    Vec2::new(direction.y.atan2(direction.x), direction.z.atan2(direction.truncate().length()))
}

/// The value below which the fraction `q` of `values` lies; 0 if there are none.
pub(super) fn quantile(values: &mut [f32], q: f32) -> f32 {
    if values.is_empty() {
        return 0.0;
    }
    let rank = (q * (values.len() - 1) as f32).round() as usize;
    *values.select_nth_unstable_by(rank, f32::total_cmp).1
}

/// The span of `values`, without the few outliers.
///
/// Each end excludes the fraction `outside` of the values, but extends to the outermost value if that is near. The span
/// is never empty.
pub(super) fn robust_span(values: &mut [f32], outside: f32) -> [f32; 2] {
    let [low, high] = [quantile(values, outside), quantile(values, 1.0 - outside)];
    let near = 0.25 * (high - low);
    let reach = |end: f32, last: f32| if (last - end).abs() <= near { last } else { end };
    let (first, last) = (quantile(values, 0.0), quantile(values, 1.0));
    wide([reach(low, first), reach(high, last)])
}

/// `span`, or one metre around it when it is too narrow to divide by.
pub(super) fn wide([low, high]: [f32; 2]) -> [f32; 2] {
    let least = 1e-5 * low.abs().max(high.abs()).max(1e-3);
    if high - low > least { [low, high] } else { [low - 0.5 * least.max(1.0), high + 0.5 * least.max(1.0)] }
}

#[cfg(test)]
mod tests {
    use super::*;
    use cloud::{Field, FieldSet};
    use glam::DVec3;

    #[test]
    fn misses_are_left_out_and_the_sensor_is_near() {
        let mut cloud = PointCloud { len: 4, origin: DVec3::new(5e5, 5.6e6, 100.0), ..PointCloud::default() };
        cloud.fields = FieldSet::EMPTY.with(Field::X).with(Field::Y).with(Field::Z);
        cloud.columns.x = vec![1.0, f32::NAN, f32::INFINITY, 1e30];
        cloud.columns.y = vec![2.0; 4];
        cloud.columns.z = vec![3.0; 4];
        cloud.sensor_pose = Pose::at(5e5, 5.6e6, 101.5).with_rpy_deg(0.0, 0.0, 90.0);
        let mut report = Report::default();
        let points = Points::new(&cloud, &mut report);
        assert_eq!(points.count, 1);
        assert_eq!(points.sample, [(0, Vec3::new(1.0, 2.0, 3.0))]);
        assert_eq!(points.sensor, Vec3::new(0.0, 0.0, 1.5));
        assert!(points.in_sensor_frame(Vec3::new(0.0, 2.0, 1.5)).distance(Vec3::new(2.0, 0.0, 0.0)) < 1e-6);
        assert!(report.warnings.is_empty());
        cloud.columns.y.clear();
        assert_eq!(Points::new(&cloud, &mut report).count, 0);
        assert_eq!(report.warnings.len(), 1);
        cloud.len = MOST_ROWS + 1;
        Points::new(&cloud, &mut report);
        assert!(report.warnings[1].contains("rows after the first 4294967295"), "{report:?}");
    }

    #[test]
    fn surfaces_alone_show_where_the_scene_is() {
        let mut cloud = PointCloud { len: 200, ..PointCloud::default() };
        cloud.columns.x = (0..200).map(|row| row as f32).collect();
        (cloud.columns.y, cloud.columns.z) = (vec![0.0; 200], vec![0.0; 200]);
        let scene = |cloud: &PointCloud| {
            Points::new(cloud, &mut Report::default()).scene.iter().map(|position| position.x).collect::<Vec<_>>()
        };
        assert_eq!(scene(&cloud).len(), 200);
        cloud.columns.cause = vec![Cause::Fog as u8; 200];
        cloud.columns.cause[7] = Cause::Mirror as u8;
        assert_eq!(scene(&cloud).len(), 200, "one point is no scene");
        // A point with an unknown cause counts as a surface.
        cloud.columns.cause[9] = 77;
        assert_eq!(scene(&cloud), [7.0, 9.0]);
    }

    #[test]
    fn spans_leave_out_strays_but_not_edges() {
        let mut values: Vec<f32> = (0..1000).map(|i| i as f32 / 100.0).collect();
        assert_eq!(robust_span(&mut values, 0.01), [0.0, 9.99]);
        values.push(1e6);
        let [low, high] = robust_span(&mut values, 0.01);
        assert!(low == 0.0 && (9.8..10.0).contains(&high), "{low} {high}");
        assert_eq!(robust_span(&mut [7.0], 0.01), [6.5, 7.5]);
        let [low, high] = robust_span(&mut [1e14; 3], 0.01);
        assert!(low < high);
        assert_eq!(robust_span(&mut [], 0.01), [-0.5, 0.5]);
    }
}
