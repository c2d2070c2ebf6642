//! One sample: a varied scene and its scans.

use super::draw::Draws;
use super::frames::{FrameTime, RigFrames};
use super::spec::{Carrier, PLAN_KEY, SensorEntry, Spec, StripSpec};
use super::stage::{Base, Stage};
use super::strips::{self, ScanPiece, SensorStrip};
use super::variation::SampleScene;
use cloud::{BoxAxes, FieldSet, Ping, PointCloud};
use emitter::{Navigation, NavigationSolution, Trajectory};
use engine::scan::ScanOptions;
use engine::scene::Scene;
use engine::sensor::Sensor;
use engine::trace::{BuiltScene, LiveScene};
use glam::DQuat;
use ground::error::{Error, Result};
use ground::pose::Pose;
use ground::report::Report;
use ground::shown;
use serde_json::Value;
use std::ops::RangeInclusive;
use std::path::Path;
use std::sync::Arc;
use survey::{AreaBox, CarrierKind, PlanSpec, SurveyPlan, SurveySwath};

/// A sample of a [`super::Scenario`]: its scene, and the scans of its sensors.
#[derive(Debug)]
pub struct Sample {
    scans: Vec<Scan>,
    drawn: Vec<Value>,
    report: Report,
    live: LiveScene,
    /// Whether anything moves or changes over time.
    moving: bool,
    plan: Option<SurveyPlan>,
    base: Arc<Base>,
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
    /// Its strips, each of which is a frame; empty: there are none.
    strips: Vec<SensorStrip>,
    options: ScanOptions,
}

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

    /// Its frames; for a sonar, its pings. Strips take the place of frames: their numbers are those of the strips.
    pub fn frames(&self) -> &[FrameTime] {
        &self.frames
    }

    /// Whether its frames are strips.
    pub fn has_strips(&self) -> bool {
        !self.strips.is_empty()
    }

    /// Number of pieces in which its `frame`th frame, counted from 0, is scanned: 1, unless it is a strip.
    pub fn pieces(&self, frame: usize) -> usize {
        self.strips.get(frame).map_or(1, SensorStrip::pieces)
    }

    /// A piece of its `frame`th frame, both counted from 0.
    ///
    /// # Errors
    /// As [`Sensor::set`].
    pub fn piece(&self, frame: usize, piece: usize) -> Result<ScanPiece> {
        let (FrameTime { number, start }, strip) = self.piece_time(frame, piece);
        let of_strip = self.strips.get(frame).map(|strip| strip.piece_sensor(piece)).transpose()?;
        Ok(ScanPiece { sensor: of_strip.unwrap_or_else(|| self.sensor.clone()), number, start, strip })
    }

    /// Number and start of a piece, and the number of its strip; 0: none.
    pub fn piece_time(&self, frame: usize, piece: usize) -> (FrameTime, u16) {
        let of_strip = self.strips.get(frame).map(|strip| (strip.piece_time(piece), strip.strip));
        of_strip.unwrap_or_else(|| (self.frames[frame], 0))
    }

    /// Scan options of its `frame`th frame, counted from 0; of a strip, those of its first piece.
    pub fn options(&self, frame: usize) -> ScanOptions {
        self.options_of(frame, 0)
    }

    /// Scan options of a piece.
    fn options_of(&self, frame: usize, piece: usize) -> ScanOptions {
        let (FrameTime { number, start }, strip) = self.piece_time(frame, piece);
        self.options.clone().frame(number).strip(strip).start_time(start)
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
        let (mut live, drawn) = (stand.live, stand.drawn);
        let plan = match &spec.trajectory {
            Some(Carrier::Plan(plan)) => Some(planned(plan, stage, spec, folder, &mut live)?),
            _ => None,
        };
        if let Some(plan) = &plan {
            report.absorb(plan.report.clone());
        }
        let moving = live.objects().any(|(_, object)| {
            object.motion.is_some() || object.materials().any(|material| material.changes.is_some())
        });
        let scans = scans(stage, spec, folder, draws, &base, (standing, plan.as_ref()), &mut report)?;
        Ok(Sample { scans, drawn, report, live, moving, plan, base })
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

    /// The survey that its sensors are on, if its trajectory is planned.
    pub fn plan(&self) -> Option<&SurveyPlan> {
        self.plan.as_ref()
    }

    /// The scene that it starts from, as it was read, before the rules of the scenario.
    pub fn loaded(&self) -> &Scene {
        &self.base.scene
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

    /// The scene as the `frame`th frame of a scan sees it; of a strip, its first piece.
    ///
    /// # Errors
    /// As [`LiveScene::commit`].
    pub fn built(&mut self, scan: usize, frame: usize) -> Result<BuiltScene> {
        let ScanPiece { sensor, start, .. } = self.scans[scan].piece(frame, 0)?;
        self.built_at(start, sensor.scan_time())
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
        let pieces = self.scans[scan].pieces(frame);
        if pieces == 1 {
            return self.piece_into(scan, [frame, 0], FieldSet::EMPTY, BoxScope::None, cloud);
        }
        let (mut all, mut next) = (PointCloud::default(), std::mem::take(cloud));
        for piece in 0..pieces {
            self.piece_into(scan, [frame, piece], FieldSet::EMPTY, BoxScope::None, &mut next)?;
            all.append(&next)?;
        }
        *cloud = all;
        Ok(())
    }

    /// The points of a piece of a frame of a scan, both counted from 0, with the further columns `more`, and boxes.
    pub(super) fn piece_into(
        &mut self,
        scan: usize,
        [frame, piece]: [usize; 2],
        more: FieldSet,
        boxes: BoxScope,
        cloud: &mut PointCloud,
    ) -> Result<()> {
        let ScanPiece { sensor, start, .. } = self.scans[scan].piece(frame, piece)?;
        let built = self.built_at(start, sensor.scan_time())?;
        let scan = &self.scans[scan];
        let options = scan.options_of(frame, piece);
        let image_boxes = boxes == BoxScope::InImage && sensor.image_grid().is_ok();
        let boxes = (boxes != BoxScope::None).then_some(BoxAxes::Object);
        let fields = options.fields.union(more);
        let options = options.fields(fields).boxes(boxes).image_boxes(image_boxes);
        built.scan_into(&sensor, &scan.trajectory, &options, cloud)
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
    (standing, plan): (Option<Pose>, Option<&SurveyPlan>),
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
    let earth = spec.georeference.options(folder)?;
    let file = match &spec.trajectory {
        Some(Carrier::File(file)) => Some(Trajectory::load_with(folder.join(file), &earth, report)?.shifted_to_zero()),
        _ => None,
    };
    let frames = RigFrames::of(spec, first, file.as_ref());
    let start = frames.start();
    let planned_strips = |plan: &SurveyPlan| plan.strips.iter().map(StripSpec::planned).collect();
    let spec_strips: Vec<StripSpec> = plan.map_or_else(|| spec.strips.clone(), planned_strips);
    let strips_of = |(index, entry): (usize, &SensorEntry)| {
        strips::of_sensor(&spec_strips, (entry, &format!("sensors[{index}]")), stage, folder)
    };
    let strips: Vec<Vec<SensorStrip>> = spec.sensors.iter().enumerate().map(strips_of).collect::<Result<_>>()?;
    let times: Vec<Vec<FrameTime>> = if spec_strips.is_empty() {
        spec.sensors.iter().enumerate().map(|sensor| frames.of_sensor(sensor)).collect::<Result<_>>()?
    } else {
        strips.iter().map(|strips| strips.iter().map(SensorStrip::time).collect()).collect()
    };
    let start = spec_strips.first().map_or(start, |strip| strip.from_s);
    let ends = times.iter().zip(&sensors).filter_map(|(times, sensor)| Some(times.last()?.start + sensor.scan_time()));
    let last = ends.chain(spec_strips.last().map(|strip| strip.to_s)).fold(start, f64::max);
    let carrier = match (plan, file, &spec.trajectory) {
        (Some(plan), ..) => plan.trajectory.clone().on_earth(&earth)?,
        (_, Some(file), _) => file,
        (None, None, trajectory) => carrier(trajectory.as_ref(), standing, base, start, last)?.on_earth(&earth)?,
    };
    strips::check_times(&spec_strips, &carrier)?;
    let carrier = Arc::new(carrier);
    let mut names: Vec<String> = Vec::new();
    let mut scans = Vec::new();
    let rig = spec.sensors.iter().zip(sensors).zip(times).zip(strips);
    for (index, (((entry, sensor), times), strips)) in rig.enumerate() {
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
        let clock_offset = navigation.as_ref().map_or(0.0, |solution| solution.clock_offset);
        scans.push(Scan {
            trajectory: carrier.mounted(&mount)?,
            carrier: carrier.clone(),
            navigation,
            mount,
            frames: times,
            strips,
            options: ScanOptions::default()
                .fields(spec.fields(&sensor)?)
                .seed(draws.scan_seed(spec.seed, index as u32))
                .estimated_trajectory(estimated)
                .clock_offset(clock_offset)
                .freeze(spec.freeze)
                // Pings have one pose each.
                .deskew(spec.deskew && !sensor.kind().makes_pings())
                .box_time(spec.boxes)
                .frame_period(entry.rate_hz.map_or(frames.period(), f64::recip))
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

/// The survey `plan` with the first sensor over the scene of a sample.
///
/// # Errors
/// As [`SurveySwath::new`] and [`SurveyPlan::new`].
fn planned(plan: &PlanSpec, stage: &Stage, spec: &Spec, folder: &Path, live: &mut LiveScene) -> Result<SurveyPlan> {
    let Some(entry) = spec.sensors.first() else { return Err(Error::invalid("sensors", "none", "at least one")) };
    let sensor = stage.sensor(entry, "sensors[0]", folder)?;
    let mount = entry.mount.pose("sensors[0].mount")?;
    let range = &sensor.spec().range;
    let range = [range.min_m, range.max_m.unwrap_or(f64::INFINITY)];
    let swath =
        SurveySwath::new(&sensor.spec().pattern, sensor.beams(), mount.orientation, range, plan.half_angle_deg)?;
    let built = live.commit()?;
    let Some((low, high)) = live.bounds() else {
        return Err(Error::invalid(PLAN_KEY, "over an empty scene", "a scene with a ground"));
    };
    let mut plan = plan.clone();
    if plan.is_nowhere() && plan.platform != CarrierKind::Tripod {
        plan.area = Some(AreaBox { min_m: [low.x, low.y], max_m: [high.x, high.y] });
    }
    // Rays at the very edge may miss what ends there.
    let edge = 1e-3 + 1e-6 * (high - low).truncate().max_element();
    let ground = |x: f64, y: f64| {
        let inside = (low.x - edge..=high.x + edge).contains(&x) && (low.y - edge..=high.y + edge).contains(&y);
        let within = |value: f64, low: f64, high: f64| value.min(high - edge).max(low + edge);
        let (x, y) = (within(x, low.x, high.x), within(y, low.y, high.y));
        if inside { built.ground_at(x, y, high.z + edge) } else { None }
    };
    SurveyPlan::new(&plan, PLAN_KEY, &swath, &ground, spec.seed)
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
        Some(Carrier::Plan(_)) => Err(Error::Internal("a survey that was not planned".into())),
        None => match base.scene.cameras.as_slice() {
            [camera] => base.scene.camera_path(&camera.name, start, end),
            cameras => {
                let found = format!("missing, and the scene has {} camera nodes", cameras.len());
                Err(Error::invalid("trajectory", found, "one of file, position_m, camera, object, poses, on"))
            }
        },
    }
}
