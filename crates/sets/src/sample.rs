//! One sample: a varied scene and its scans.

use super::draw::Draws;
use super::spec::{Carrier, CarrierFile, SensorEntry, Spec};
use super::stage::{Base, Stage};
use super::variation::SampleScene;
use cloud::{BoxAxes, FieldSet, Ping, PointCloud};
use emitter::trajectory::TrajectoryOptions;
use emitter::{Navigation, NavigationSolution, Trajectory};
use engine::scan::ScanOptions;
use engine::sensor::Sensor;
use engine::trace::{BuiltScene, LiveScene};
use glam::{DQuat, DVec3};
use ground::crs::Crs;
use ground::error::{Error, Result};
use ground::pose::Pose;
use ground::report::Report;
use ground::shown;
use serde_json::Value;
use std::ops::RangeInclusive;
use std::path::Path;
use std::sync::Arc;

/// A sample of a [`super::Scenario`]: its scene, and the scans of its sensors.
#[derive(Debug)]
pub struct Sample {
    scans: Vec<Scan>,
    drawn: Vec<Value>,
    report: Report,
    live: LiveScene,
    /// Whether anything moves or changes over time.
    moving: bool,
}

/// What one sensor of the rig does in a sample.
#[derive(Clone, Debug)]
pub struct Scan {
    name: String,
    sensor: Arc<Sensor>,
    mount: Pose,
    trajectory: Trajectory,
    carrier: Arc<Trajectory>,
    navigation: Option<Arc<NavigationSolution>>,
    frames: Vec<FrameTime>,
    options: ScanOptions,
}

/// When a frame starts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameTime {
    /// Its number.
    pub number: u32,
    /// Seconds since the start of the run.
    pub start: f64,
}

/// Maximum number of frames of a scan.
const MOST_FRAMES: f64 = 10_000_000.0;

impl Scan {
    /// Name of the sensor in the rig.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The sensor.
    pub fn sensor(&self) -> &Arc<Sensor> {
        &self.sensor
    }

    /// Pose of the sensor on its carrier.
    pub fn mount(&self) -> &Pose {
        &self.mount
    }

    /// Pose of the sensor over time.
    pub fn trajectory(&self) -> &Trajectory {
        &self.trajectory
    }

    /// Pose of what it is mounted on over time.
    pub fn carrier(&self) -> &Trajectory {
        &self.carrier
    }

    /// What processing makes of the flight of its carrier, if the scenario has errors of navigation.
    pub fn navigation(&self) -> Option<&NavigationSolution> {
        self.navigation.as_deref()
    }

    /// Its frames; for a sonar, its pings.
    pub fn frames(&self) -> &[FrameTime] {
        &self.frames
    }

    /// Scan options of its `frame`th frame, counted from 0.
    pub fn options(&self, frame: usize) -> ScanOptions {
        let FrameTime { number, start } = self.frames[frame];
        self.options.clone().frame(number).start_time(start)
    }
}

/// Which boxes around instances a cloud gets.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum BoxScope {
    None,
    InSpace,
    /// Boxes that also give their place in the sensor's image, if it has one.
    InImage,
}

impl Sample {
    /// Makes a sample from the sections of `spec`, which are `value` as written; `drawn` is what was drawn for them.
    pub(super) fn new(
        stage: &Stage,
        spec: &Spec,
        value: &Value,
        folder: &Path,
        draws: &Draws,
        drawn: Vec<Value>,
    ) -> Result<Sample> {
        let scene_key = value.get("scene").map(Value::to_string).unwrap_or_default();
        let base = stage.base(spec, scene_key, folder)?;
        let mut stand = SampleScene::new((&base.live, &base.units), &stage.assets, &stage.labels, folder);
        stand.drawn = drawn;
        for (index, (rule, models)) in spec.variation.iter().zip(&stage.models).enumerate() {
            stand.apply(rule, &format!("variation[{index}]"), models, draws)?;
        }
        let standing = match &spec.trajectory {
            Some(Carrier::On(spot)) => Some(stand.spot(spot, draws)?),
            _ => None,
        };
        let mut report = base.scene.report.clone();
        stand.notes.iter().for_each(|note| report.warn(note));
        let (live, drawn) = (stand.live, stand.drawn);
        let moving = live.objects().any(|(_, object)| {
            object.motion.is_some() || object.materials().any(|material| material.changes.is_some())
        });
        let scans = scans(stage, spec, folder, draws, &base, standing, &mut report)?;
        Ok(Sample { scans, drawn, report, live, moving })
    }

    /// Its scans, in the order of the sensors.
    pub fn scans(&self) -> &[Scan] {
        &self.scans
    }

    /// What was drawn for it, in the order of the rules: enough to reproduce it or to select by.
    pub fn drawn(&self) -> &[Value] {
        &self.drawn
    }

    /// Warnings: objects that found no room, and those of the scene's reader.
    pub fn report(&self) -> &Report {
        &self.report
    }

    /// Its scene.
    pub fn scene(&self) -> &LiveScene {
        &self.live
    }

    /// Whether anything in its scene moves or changes over time.
    pub fn is_moving(&self) -> bool {
        self.moving
    }

    /// The built scene; if anything moves, from time `start` on for `length`, s.
    ///
    /// # Errors
    /// As [`LiveScene::commit`].
    pub fn built_at(&mut self, start: f64, length: f64) -> Result<BuiltScene> {
        if self.moving {
            self.live.set_time(start, length)?;
        }
        self.live.commit()
    }

    /// The scene as the `frame`th frame of a scan sees it.
    ///
    /// # Errors
    /// As [`LiveScene::commit`].
    pub fn built(&mut self, scan: usize, frame: usize) -> Result<BuiltScene> {
        let Scan { frames, sensor, .. } = &self.scans[scan];
        self.built_at(frames[frame].start, sensor.scan_time())
    }

    /// The points of the `frame`th frame of a scan.
    ///
    /// # Errors
    /// As [`BuiltScene::scan`].
    pub fn cloud(&mut self, scan: usize, frame: usize) -> Result<PointCloud> {
        let mut cloud = PointCloud::default();
        self.cloud_into(scan, frame, &mut cloud)?;
        Ok(cloud)
    }

    /// [`Sample::cloud`] that reuses the memory of `cloud`.
    ///
    /// # Errors
    /// As [`Sample::cloud`].
    pub fn cloud_into(&mut self, scan: usize, frame: usize, cloud: &mut PointCloud) -> Result<()> {
        let built = self.built(scan, frame)?;
        let scan = &self.scans[scan];
        built.scan_into(&scan.sensor, &scan.trajectory, &scan.options(frame), cloud)
    }

    /// [`Sample::cloud_into`] with the further columns `more`, and boxes.
    pub(super) fn cloud_with(
        &mut self,
        scan: usize,
        frame: usize,
        more: FieldSet,
        boxes: BoxScope,
        cloud: &mut PointCloud,
    ) -> Result<()> {
        let built = self.built(scan, frame)?;
        let scan = &self.scans[scan];
        let options = scan.options(frame);
        let image_boxes = boxes == BoxScope::InImage && scan.sensor.image_grid().is_ok();
        let boxes = (boxes != BoxScope::None).then_some(BoxAxes::Object);
        let fields = options.fields.union(more);
        let options = options.fields(fields).boxes(boxes).image_boxes(image_boxes);
        built.scan_into(&scan.sensor, &scan.trajectory, &options, cloud)
    }

    /// The `frame`th ping of a sonar's scan.
    ///
    /// # Errors
    /// As [`BuiltScene::ping`].
    pub fn ping(&mut self, scan: usize, frame: usize) -> Result<Ping> {
        let built = self.built(scan, frame)?;
        let scan = &self.scans[scan];
        built.ping(&scan.sensor, &scan.trajectory, &scan.options(frame))
    }
}

fn scans(
    stage: &Stage,
    spec: &Spec,
    folder: &Path,
    draws: &Draws,
    base: &Base,
    standing: Option<Pose>,
    report: &mut Report,
) -> Result<Vec<Scan>> {
    let sensors: Vec<Arc<Sensor>> = spec
        .sensors
        .iter()
        .enumerate()
        .map(|(index, entry)| stage.sensor(entry, &format!("sensors[{index}]"), folder))
        .collect::<Result<_>>()?;
    let Some(first) = sensors.first() else {
        return Err(Error::invalid("sensors", "none", "at least one"));
    };
    let fps = spec.fps(first);
    let file = match &spec.trajectory {
        Some(Carrier::File(CarrierFile { file, crs, offset_m })) => {
            let crs = crs.as_ref().map(|crs| Crs::open_in(folder, crs)).transpose()?;
            let options = TrajectoryOptions::default().crs(crs).offset(DVec3::from_array(*offset_m));
            Some(Trajectory::load_with(folder.join(file), &options, report)?.shifted_to_zero())
        }
        _ => None,
    };
    let [from, to, step] = match &spec.frames {
        Some(frames) => [frames.first, frames.last, frames.step],
        // A sonar pings along its whole trajectory.
        None if first.kind().makes_pings() && file.is_some() => {
            let end = file.as_ref().map_or(0.0, |file| file.span().1);
            [0, (end * fps + 1e-6).min(MOST_FRAMES) as u32, 1]
        }
        None => [0, 0, 1],
    };
    let start = f64::from(from) / fps;
    let end = f64::from(to) / fps;
    let whole = (from..=to).step_by(step as usize);
    let times = |index: usize, entry: &SensorEntry| -> Result<Vec<FrameTime>> {
        let Some(rate) = entry.rate_hz else {
            return Ok(whole.clone().map(|number| FrameTime { number, start: f64::from(number) / fps }).collect());
        };
        // All frames that start before the one after the last.
        let first = start + entry.start_s;
        let count = ((end + f64::from(step) / fps - first) * rate - 1e-9).ceil().max(0.0);
        if count > MOST_FRAMES {
            let found = format!("{rate}, which makes {count} frames");
            let allowed = format!("a rate that makes {MOST_FRAMES} at most");
            return Err(Error::invalid(format!("sensors[{index}].rate_hz"), found, allowed));
        }
        Ok((0..count as u32).map(|number| FrameTime { number, start: first + f64::from(number) / rate }).collect())
    };
    let times: Vec<Vec<FrameTime>> =
        spec.sensors.iter().enumerate().map(|(index, entry)| times(index, entry)).collect::<Result<_>>()?;
    let ends = times.iter().zip(&sensors).filter_map(|(times, sensor)| Some(times.last()?.start + sensor.scan_time()));
    let last = ends.fold(start, f64::max);
    let carrier = match (file, &spec.trajectory) {
        (Some(file), _) => file,
        (None, trajectory) => carrier(trajectory.as_ref(), standing, base, start, last)?,
    };
    let carrier = Arc::new(carrier);
    let mut names: Vec<String> = Vec::new();
    let mut scans = Vec::new();
    for (index, ((entry, sensor), times)) in spec.sensors.iter().zip(sensors).zip(times).enumerate() {
        let name = entry.name.clone().unwrap_or_else(|| sensor.name().to_owned());
        if !LENGTHS.contains(&name.len()) {
            let allowed = format!("{} to {} bytes, as files are named after it", LENGTHS.start(), LENGTHS.end());
            let found = format!("{} bytes long, {:?}", name.len(), shown::name(&name));
            return Err(Error::invalid(format!("sensors[{index}].name"), found, allowed));
        }
        if names.contains(&name) {
            let found = format!("called {name:?}, like an earlier sensor");
            return Err(Error::invalid(format!("sensors[{index}]"), found, "a `name` of its own for each"));
        }
        let mount = entry.mount.pose(&format!("sensors[{index}].mount"))?;
        if spec.navigation.is_some() && !sensor.kind().is_optical() {
            let found = format!("given with sensors[{index}], a {}", sensor.kind());
            return Err(Error::invalid("navigation", found, "for LiDARs and depth cameras"));
        }
        let solve = |errors: &Navigation| errors.solve(draws.scan_seed(spec.seed, 0), &carrier, &mount, [start, last]);
        let navigation = spec.navigation.as_ref().map(solve).transpose()?.map(Arc::new);
        let estimated = navigation.as_ref().map(|solution| solution.sensor.clone());
        scans.push(Scan {
            trajectory: carrier.mounted(&mount)?,
            carrier: carrier.clone(),
            navigation,
            mount,
            frames: times,
            options: ScanOptions::default()
                .fields(spec.fields(&sensor)?)
                .seed(draws.scan_seed(spec.seed, index as u32))
                .estimated_trajectory(estimated)
                .freeze(spec.freeze)
                // Pings have one pose each.
                .deskew(spec.deskew && !sensor.kind().makes_pings())
                .box_time(spec.boxes)
                .frame_period(entry.rate_hz.map_or(f64::from(step) / fps, f64::recip))
                .organised(spec.organised)
                .coordinates(spec.frame)
                .order(spec.order)
                .profile(spec.profile)
                .reflectance_source(spec.reflectance_source)
                .environment(spec.environment.clone()),
            sensor,
            name: name.clone(),
        });
        names.push(name);
    }
    Ok(scans)
}

/// Allowed length of a sensor's name, bytes: file names, which add to it, are limited to 255.
const LENGTHS: RangeInclusive<usize> = 1..=200;

/// The trajectory of the carrier from `start` to `end`, s.
fn carrier(
    trajectory: Option<&Carrier>,
    standing: Option<Pose>,
    base: &Base,
    start: f64,
    end: f64,
) -> Result<Trajectory> {
    match trajectory {
        Some(Carrier::On(_)) => Ok(Trajectory::fixed(standing.unwrap_or_default())),
        Some(Carrier::At(pose)) => Ok(Trajectory::fixed(pose.pose("trajectory")?)),
        Some(Carrier::Poses(rows)) => {
            let keys = rows.iter().map(|&[time, x, y, z, qx, qy, qz, qw]| {
                (time, Pose { orientation: DQuat::from_xyzw(qx, qy, qz, qw), ..Pose::at(x, y, z) })
            });
            Trajectory::new(keys.collect())
        }
        Some(Carrier::Camera(name)) => base.scene.camera_path(name, start, end),
        Some(Carrier::Object(name)) => base.scene.object_path(name, start, end),
        Some(Carrier::File(_)) => Err(Error::Internal("a trajectory file that was not read".into())),
        None => match base.scene.cameras.as_slice() {
            [camera] => base.scene.camera_path(&camera.name, start, end),
            cameras => {
                let found = format!("missing, and the scene has {} camera nodes", cameras.len());
                Err(Error::invalid("trajectory", found, "one of file, position_m, camera, object, poses, on"))
            }
        },
    }
}
