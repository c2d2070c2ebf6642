//! Boxes around labelled instances: their poses, numbers of points and visible fractions.

use super::ScanOptions;
use crate::detect::DepthCamera;
use crate::sensor::Sensor;
use crate::trace::{BuiltScene, Crossings, LabelledInstance, Sight, Tables};
use cloud::{BoxAxes, BoxTime, Field, Frame, InstanceBox, PointCloud};
use emitter::{Aim, BeamTable, ImageGrid, Outline, Trajectory};
use glam::{DAffine3, DMat3, DQuat, DVec3};
use ground::error::{Error, Result};
use ground::lanes::{CHUNK, LANES, RayBatch};
use ground::parallel;
use ground::pose::Pose;
use std::sync::Arc;
use std::sync::atomic::Ordering;

impl BuiltScene {
    /// Boxes around the labelled instances that such a scan can see: those with an `instance_id` other than 0 that are
    /// present when their box [holds](ScanOptions::box_time) and within the sensor's range then, or have points in
    /// `cloud`, the result of that scan. Objects with one `instance_id` share a box, along the axes of the first;
    /// deforming objects have their shape at that time. Boxes are along [`BoxAxes::Object`] by default.
    ///
    /// # Errors
    /// As [`BuiltScene::scan`]; a cloud without the column `instance_id`, or without `time` if boxes hold when objects
    /// are scanned; boxes in images of a sensor that has [none](Sensor::image_grid).
    pub fn boxes(
        &self,
        sensor: &Sensor,
        trajectory: &Trajectory,
        options: &ScanOptions,
        cloud: &PointCloud,
    ) -> Result<Vec<InstanceBox>> {
        options.check(trajectory)?;
        let ids = &cloud.columns.instance_id;
        if !cloud.fields.contains(Field::InstanceId) || ids.len() != cloud.len {
            return Err(Error::invalid("cloud", "without instance_id", "one with it, by which points are counted"));
        }
        let timed = options.box_time == BoxTime::Scan && !options.deskew;
        let times = &cloud.columns.time;
        if timed && (!cloud.fields.contains(Field::Time) || times.len() != cloud.len) {
            return Err(Error::invalid(
                "cloud",
                "without time",
                "one with it, or boxes at the start or the end of a scan",
            ));
        }
        let sonar = sensor.kind().makes_pings();
        let beams = if sonar { Arc::new(sensor.rays().into_owned()) } else { sensor.beams_at(options.start_time)? };
        self.0.check_time(options.start_time, beams.last_time())?;
        let start = trajectory.at(options.start_on_trajectory());
        let turned = sonar.then(|| Trajectory::fixed(sensor.turned(start, options.frame)));
        let aim = Aim::new(turned.as_ref().unwrap_or(trajectory), options.start_on_trajectory(), self.0.origin);
        let instances = self.0.instances();
        let wraps = sensor.camera.as_ref().is_some_and(DepthCamera::wraps);
        let reach = if wraps { f64::INFINITY } else { sensor.range_max_m };
        let last = beams.last_time();
        let met = met(ids, if timed { times } else { &[] }, [options.start_time, last], instances);
        let frame = match cloud.frame {
            Frame::World => Pose::IDENTITY,
            Frame::Sensor => cloud.sensor_pose,
        };
        // The frame of such points moves with the sensor.
        let rides = cloud.frame == Frame::Sensor && !sonar && !options.deskew;
        let grid = options.image_boxes.then(|| sensor.image_grid()).transpose()?;
        let make = Boxes { scene: &self.0, options, frame, rides, path: trajectory, reach, grid };
        Ok(self.0.engine.install(|| {
            let crossings = make.cross(&beams, &aim, sonar);
            let mut boxes = vec![None; instances.len()];
            parallel::for_each(&mut boxes, |index, to| {
                let [alone, first] = [&crossings.alone, &crossings.first].map(|all| all[index].load(Ordering::Relaxed));
                let InstanceHits { points, mean, first: met } = met[index];
                let seen = points > 0 || alone > 0;
                let around = |after: f64| make.around(&instances[index], seen, after);
                let found = match options.box_time {
                    BoxTime::Start => around(0.0),
                    BoxTime::End => around(last),
                    _ if options.deskew => around(0.0),
                    // An object that is hidden at times may be hidden in between.
                    _ if points > 0 => around(mean).or_else(|| around(met)),
                    _ => around(0.5 * last),
                };
                *to = found.map(|found| found.points(points).visible(f64::from(first) / f64::from(alone.max(1))));
            });
            boxes.into_iter().flatten().collect()
        }))
    }
}

/// When an instance was hit, and how often.
#[derive(Clone, Copy, Default)]
struct InstanceHits {
    /// Number of points on it.
    points: u32,
    /// Mean time of these points, and time of the first, s after the start of the scan.
    mean: f64,
    first: f64,
}

/// The points in one half of a scan: their number, the sum of their times, and the first and last time, s.
#[derive(Clone, Copy)]
struct Half {
    points: u32,
    sum: f64,
    reach: [f64; 2],
}

impl Half {
    const NONE: Half = Half { points: 0, sum: 0.0, reach: [f64::INFINITY, f64::NEG_INFINITY] };

    fn add(&mut self, time: f64) {
        let [first, last] = self.reach;
        *self = Half { points: self.points + 1, sum: self.sum + time, reach: [first.min(time), last.max(time)] };
    }
}

/// When each of `instances` was hit, and how often, by points with the instances `ids` at `times`, s, if these are
/// required, in a scan from `start` on that lasts `length`, s.
///
/// What is hit at the start of a revolution may be hit again at its end: at the mean time there would be no point. Then
/// the time is that of the end with more points.
fn met(ids: &[u32], times: &[f64], [start, length]: [f64; 2], instances: &[LabelledInstance]) -> Vec<InstanceHits> {
    let mut all = vec![InstanceHits::default(); instances.len()];
    let mut halves = vec![[Half::NONE; 2]; if times.is_empty() { 0 } else { instances.len() }];
    let mut row = 0;
    for run in ids.chunk_by(|a, b| a == b) {
        if let Ok(index) = instances.binary_search_by_key(&run[0], |instance| instance.id) {
            let met = &mut all[index];
            if let Some(times) = times.get(row..row + run.len()) {
                if met.points == 0 {
                    met.first = times[0] - start;
                }
                // Relative to the start, so that times since 1970 keep their precision.
                times.iter().map(|time| time - start).for_each(|time| {
                    halves[index][usize::from(time > 0.5 * length)].add(time);
                });
            }
            met.points += run.len() as u32;
        }
        row += run.len();
    }
    for (met, [early, late]) in all.iter_mut().zip(halves) {
        let (count, sum) = if late.reach[0] - early.reach[1] <= 0.5 * length {
            (early.points + late.points, early.sum + late.sum)
        } else if early.points >= late.points {
            (early.points, early.sum)
        } else {
            (late.points, late.sum)
        };
        met.mean = sum / f64::from(count.max(1));
    }
    all
}

/// What is the same for all boxes of a scan.
struct Boxes<'a> {
    scene: &'a Tables,
    options: &'a ScanOptions,
    /// World from the frame of the boxes, when the scan starts.
    frame: Pose,
    /// Whether that frame moves with the sensor.
    rides: bool,
    /// Path of the sensor.
    path: &'a Trajectory,
    /// Greatest range, m.
    reach: f64,
    /// Its image, if boxes in it are requested.
    grid: Option<ImageGrid>,
}

impl Boxes<'_> {
    /// Which instances the axes of `beams` hit.
    fn cross(&self, beams: &BeamTable, aim: &Aim, sonar: bool) -> Crossings {
        let clock = self.scene.clock(self.options.start_time, self.options.freeze);
        let crossings = Crossings::new(self.scene.instances().len());
        if crossings.alone.is_empty() {
            return crossings;
        }
        // Sound does not pass through glass as light does.
        let sight = if sonar { Sight::of_shapes(self.options.mask) } else { self.options.sight() };
        let coherent = beams.is_coherent();
        parallel::for_each_range(beams.len(), CHUNK, |chunk| {
            let mut rays = RayBatch::default();
            for first in chunk.clone().step_by(LANES) {
                let count = LANES.min(chunk.end - first);
                if let Some(clock) = &clock {
                    clock.set(&beams.time[first..first + count], &mut rays.time);
                }
                aim.rays(beams, first, beams.directions(first, count), self.reach as f32, &mut rays);
                self.scene.cross(&rays, count, coherent, sight, !sonar, &crossings);
            }
        });
        crossings
    }

    /// The box around `instance`, `after` s from the start of the scan, without points; `None`: it is not present, or
    /// neither `seen` nor within range.
    fn around(&self, instance: &LabelledInstance, seen: bool, after: f64) -> Option<InstanceBox> {
        let (start, mask) = (self.options.start_time, self.options.mask);
        let time = start + after;
        let moment = self.scene.clock(start, self.options.freeze).map_or(0.0, |clock| clock.of(after));
        let sensor = self.path.at(self.options.start_on_trajectory() + after);
        let frame = if self.rides { sensor } else { self.frame };
        let stances = instance.objects.iter().filter_map(|&object| {
            let (place, turned) =
                self.scene.transform_at(object, if self.options.freeze { start } else { time }, mask)?;
            Some((object, place, turned))
        });
        let stances: Vec<(u32, DAffine3, DMat3)> = stances.collect();
        let (first, place, turned) = stances.first()?;
        let axes = match self.options.boxes.unwrap_or_default() {
            BoxAxes::Frame => frame.orientation,
            _ => axes(turned),
        };
        // Relative to a position nearby, so that distances keep their precision.
        let near = place.translation;
        let into = DAffine3::from_quat(axes.inverse()) * DAffine3::from_translation(-near);
        let extents =
            stances.iter().filter_map(|(object, place, _)| self.scene.extent(*object, &(into * *place), moment));
        let [low, high] = extents.reduce(|[a, b], [low, high]| [a.min(low), b.max(high)])?;
        let (middle, size) = (0.5 * (low + high), high - low);
        let place = near + axes * middle;
        let beyond = (axes.inverse() * (sensor.position - place)).abs() - 0.5 * size;
        if !seen && beyond.max(DVec3::ZERO).length() > self.reach {
            return None;
        }
        let velocity = self.scene.velocity_at(*first, place, moment);
        let to_frame = frame.orientation.inverse();
        let (position, orientation) = (to_frame * (place - frame.position), (to_frame * axes).normalize());
        let found = InstanceBox::default().frame(self.options.frame).time(time);
        let found = found.track_id(instance.id).instance_id(instance.id).category_id(instance.category_id);
        let found = found.pose(Pose { position, orientation }).size(size).velocity(to_frame * velocity.as_dvec3());
        Some(found.image(self.grid.as_ref().and_then(|grid| self.outline(grid, sensor, &stances, place, moment))))
    }

    /// Left, top, right and bottom in an image of objects about `middle` (world).
    fn outline(
        &self,
        grid: &ImageGrid,
        sensor: Pose,
        stances: &[(u32, DAffine3, DMat3)],
        middle: DVec3,
        moment: f32,
    ) -> Option<[f64; 4]> {
        let Pose { position, orientation } = sensor;
        let back = DAffine3::from_quat(orientation.inverse());
        let mut outline = Outline::new(grid, back.transform_point3(middle - position));
        for (object, place, _) in stances {
            // The difference of positions first, so that it keeps its precision.
            let near = DAffine3 { translation: place.translation - position, ..*place };
            let into = back * near;
            let mut corners = [DVec3::ZERO; 3];
            let mut count = 0;
            self.scene.each_corner(*object, moment, &mut |corner| {
                corners[count] = into.transform_point3(corner);
                count += 1;
                if count == 3 {
                    outline.add(corners);
                    count = 0;
                }
            });
        }
        outline.done()
    }
}

/// The rotation of an object with this linear part: x along its x axis, z along the part of its z axis that is at right
/// angles to that; y completes them, whether the object is mirrored or not.
fn axes(linear: &DMat3) -> DQuat {
    let [x, y, z] = [linear.x_axis, linear.y_axis, linear.z_axis].map(DVec3::normalize_or_zero);
    // An object scaled flat takes its axes from those that are left.
    let x = if x == DVec3::ZERO { y.cross(z).try_normalize().unwrap_or(DVec3::X) } else { x };
    let across = |axis: DVec3| (axis - x * x.dot(axis)).try_normalize().filter(|_| axis.cross(x).length() > 1e-9);
    let z = across(z).or_else(|| across(x.cross(y))).unwrap_or_else(|| x.any_orthonormal_vector());
    DQuat::from_mat3(&DMat3::from_cols(x, z.cross(x), z)).normalize()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_follow_x_and_the_rest_is_at_right_angles() {
        let quarter = DMat3::from_rotation_z(1.0) * DMat3::from_rotation_x(0.3);
        let same = |linear: DMat3, expected: DMat3| {
            let found = DMat3::from_quat(axes(&linear));
            assert!(found.abs_diff_eq(expected, 1e-12), "{linear}: {found}, not {expected}");
        };
        let of = |x, y, z| DMat3::from_diagonal(DVec3::new(x, y, z));
        same(quarter * of(2.0, 3.0, 0.5), quarter);
        // Mirroring swaps left and right; a reversed x axis is a rotation.
        same(quarter * of(1.0, -1.0, 1.0), quarter);
        same(of(-1.0, 1.0, 1.0), of(-1.0, -1.0, 1.0));
        same(of(-1.0, -1.0, -1.0), of(-1.0, 1.0, -1.0));
        // Sheared: z is tilted forward.
        same(DMat3::from_cols(2.0 * DVec3::X, DVec3::Y, DVec3::new(1.0, 0.0, 1.0)), DMat3::IDENTITY);
        // Scaled flat.
        same(quarter * of(0.0, 1.0, 1.0), quarter);
        same(quarter * of(1.0, 0.0, 1.0), quarter);
        same(quarter * of(1.0, 1.0, 0.0), quarter);
        for linear in [DMat3::ZERO, of(1.0, 0.0, 0.0), of(0.0, 1.0, 0.0), of(0.0, 0.0, 1.0)] {
            let found = DMat3::from_quat(axes(&linear));
            assert!((found.determinant() - 1.0).abs() < 1e-12, "{linear}: {found}");
        }
    }
}
