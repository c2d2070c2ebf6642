//! nuScenes: tables that refer to each other by tokens; each sample is a scene.

mod categories;

use super::names::numbered;
use super::points::{LabelCache, in_sensor, in_world, inverse, local, remission, runs};
use super::rig::{SensorClass, camera, find, kind, own_velocity, radar_fields};
use super::style::{Scanned, Style, Writer as Write};
use super::whole::{Whole, damaged};
use crate::Sample;
use crate::sample::BoxScope;
use categories::Categories;
use cloud::export::images::write_layer;
use cloud::export::{ImageLayer, RadarPoints};
use cloud::image::RangeImage;
use cloud::{Field, FieldSet, InstanceBox};
use emitter::{ImageGrid, Intrinsics};
use glam::{DQuat, DVec3, Vec3};
use ground::error::{Error, Result};
use ground::pose::{Pose, on};
use ground::report::Report;
use ground::shown;
use ground::write;
use serde::Deserialize;
use serde_json::{Value, json};
use sha2::{Digest as _, Sha256};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// `nuscenes/v1.0-echocast/*.json`, `samples`, `sweeps`, `lidarseg` (Caesar et al. 2020, nuScenes: a multimodal dataset
/// for autonomous driving; schema of its development kit).
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct NuScenes {
    /// Folder of the tables.
    pub version: String,
    /// Name of the LiDAR that is `LIDAR_TOP`, where there are several.
    pub top: Option<String>,
    /// Whether objects of which no sensor has a point get boxes, too.
    pub unseen: bool,
    /// Names in nuScenes, or new ones, for categories whose own names it does not know.
    pub categories: BTreeMap<String, String>,
}

impl Default for NuScenes {
    fn default() -> Self {
        NuScenes { version: "v1.0-echocast".into(), top: None, unseen: false, categories: BTreeMap::new() }
    }
}

const ROOT: &str = "nuscenes";

/// Tables to which each sample adds rows.
const TABLES: [&str; 9] = [
    "instance",
    "calibrated_sensor",
    "ego_pose",
    "log",
    "scene",
    "sample",
    "sample_data",
    "sample_annotation",
    "lidarseg",
];

/// Time between frames that have annotations, s.
const KEY_PERIOD_S: f64 = 0.5;

/// Start of the first scene, in microseconds since 1970, and the time between scenes.
const FIRST_US: u64 = 1_500_000_000_000_000;
const APART_US: u64 = 3_600_000_000;

/// Objects slower than this are stationary, m/s.
const STANDING_M_S: f64 = 0.1;

/// Attributes (nuScenes, instructions for annotators).
const ATTRIBUTES: [&str; 8] = [
    "vehicle.moving",
    "vehicle.stopped",
    "vehicle.parked",
    "cycle.with_rider",
    "cycle.without_rider",
    "pedestrian.sitting_lying_down",
    "pedestrian.standing",
    "pedestrian.moving",
];

/// Levels of visibility, each with its lower bound.
const VISIBILITY: [(&str, &str, f64); 4] =
    [("1", "v0-40", 0.0), ("2", "v40-60", 0.4), ("3", "v60-80", 0.6), ("4", "v80-100", 0.8)];

/// A unique name of a row: the same wherever the set is made.
fn token(words: &[&str]) -> String {
    let digest = Sha256::digest(words.join("\n").as_bytes());
    digest[..16].iter().map(|byte| format!("{byte:02x}")).collect()
}

/// A sensor in the tables.
struct SensorChannel {
    /// Index of its scan.
    scan: usize,
    name: String,
    camera: Option<(ImageGrid, Intrinsics)>,
    is_radar: bool,
    /// Token of its calibration.
    token: String,
    shots: Vec<Shot>,
}

/// A frame of a sensor.
struct Shot {
    token: String,
    timestamp: u64,
    /// Whether it belongs to the key frame itself, or is a sweep before it.
    is_key: bool,
    /// Index of the key frame, from 0.
    key: usize,
    /// Its file, relative to the folder of the style.
    file: String,
}

/// An object in a key frame.
struct SampleAnnotation {
    key: usize,
    track: u32,
    category: String,
    pose: Pose,
    size: DVec3,
    points: u32,
    visible: f64,
    attribute: Option<&'static str>,
}

struct NuScenesWriter<'w> {
    style: &'w NuScenes,
    categories: Categories<'w>,
    folder: &'w Path,
    number: u64,
    /// Name of this sample, from which all its tokens are derived.
    name: String,
    /// The first is the LiDAR whose frames are key frames.
    channels: Vec<SensorChannel>,
    /// Number of key frames.
    keys: usize,
    annotations: Vec<SampleAnnotation>,
    /// Places in the world of the detections of radars in key frames.
    echoes: Vec<(usize, DVec3)>,
    /// Pairs of a key frame and an object of which a sensor has points in it.
    seen: BTreeSet<(usize, u32)>,
    /// Lines, each of a table's name and a row.
    rows: String,
    /// Categories that nuScenes does not have.
    unknown: BTreeSet<String>,
}

impl NuScenes {
    fn categories(&self) -> Categories<'_> {
        Categories::new(&self.categories)
    }

    /// Index of the scan whose frames are key frames.
    fn top(&self, sample: &Sample) -> Result<usize> {
        let lidars = || sample.scans().iter().enumerate().filter(|(_, scan)| kind(scan) == SensorClass::Lidar);
        match (&self.top, lidars().next()) {
            // The first of several.
            (None, Some((scan, _))) => Ok(scan),
            (top_name, _) => find(sample, "nuscenes: top", top_name.as_deref(), SensorClass::Lidar),
        }
    }
}

impl Style for NuScenes {
    fn check(&self) -> Result<()> {
        let name =
            |name: &str| !name.is_empty() && name.chars().all(|c| c.is_ascii_alphanumeric() || "_-.".contains(c));
        if !name(&self.version) || self.version.starts_with('.') || FOLDERS.contains(&self.version.as_str()) {
            let allowed = "a name of a folder, such as v1.0-mini";
            return Err(Error::invalid("version", format!("{:?}", self.version), allowed));
        }
        if let Some((ours, theirs)) = self.categories.iter().find(|(_, theirs)| !name(theirs)) {
            let allowed = "a name such as vehicle.car";
            return Err(Error::invalid(format!("categories.{ours}"), format!("{theirs:?}"), allowed));
        }
        let own = self.categories().own().len();
        if own > categories::MOST_OWN {
            let allowed = format!("{} at most", categories::MOST_OWN);
            return Err(Error::invalid("categories", format!("{own} names that nuScenes does not have"), allowed));
        }
        Ok(())
    }

    fn root(&self) -> &'static str {
        ROOT
    }

    fn fields(&self, sample: &Sample) -> FieldSet {
        use Field::{Beam, Blue, CategoryId, Green, InstanceId, Intensity, Range, Red, Ring, X, Y, Z};
        let fields = [X, Y, Z, Intensity, CategoryId, InstanceId, Ring, Beam, Range, Red, Green, Blue];
        radar_fields(sample).union(fields.into_iter().collect())
    }

    fn boxes(&self, sample: &Sample, scan: usize, frame: usize) -> BoxScope {
        let starts = || sample.scans()[scan].frames().iter().map(|frame| frame.start);
        let key = || starts().nth(frame).is_some_and(|start| key_times(starts()).contains(&start));
        if self.top(sample).is_ok_and(|top| scan == top) && key() { BoxScope::InSpace } else { BoxScope::None }
    }

    fn fits(&self, sample: &Sample) -> Result<()> {
        let top = self.top(sample)?;
        match sample.scans()[top].frames() {
            [] => Err(Error::invalid("nuscenes: top", "without frames", "a LiDAR that scans")),
            _ => Ok(()),
        }
    }

    fn writer<'w>(&'w self, number: u64, sample: &Sample, folder: &'w Path) -> Result<Box<dyn Write + 'w>> {
        let top = self.top(sample)?;
        let seed = sample.scans()[top].options(0).seed;
        let name = format!("{number} {seed}");
        let keys = key_times(sample.scans()[top].frames().iter().map(|frame| frame.start));
        let mut channels = Vec::new();
        let scans = sample.scans();
        let others = (0..scans.len()).filter(|&scan| scan != top && kind(&scans[scan]) != SensorClass::Sonar);
        for scan in [top].into_iter().chain(others) {
            let is_radar = kind(&scans[scan]) == SensorClass::Radar;
            let camera = camera(&scans[scan]).filter(|_| !is_radar);
            let own: String = scans[scan].name().to_uppercase();
            let own: String = own.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
            let channel = match &camera {
                _ if scan == top => "LIDAR_TOP".to_owned(),
                Some(_) => format!("CAM_{}", own.trim_start_matches("CAM_")),
                None if is_radar => format!("RADAR_{}", own.trim_start_matches("RADAR_")),
                None => format!("LIDAR_{}", own.trim_start_matches("LIDAR_")),
            };
            if channels.iter().any(|known: &SensorChannel| known.name == channel) {
                let found = format!("{channel} of two sensors, of which one is {}", scans[scan].name());
                return Err(Error::invalid(
                    "nuscenes: channel",
                    found,
                    "sensors whose names differ in letters and digits",
                ));
            }
            let times: Vec<f64> = scans[scan].frames().iter().map(|frame| frame.start).collect();
            let ending = match &camera {
                Some(_) => "png",
                None if is_radar => "pcd",
                None => "pcd.bin",
            };
            let shots = shots(&name, number, &channel, ending, &times, &keys);
            let token = token(&["calibrated_sensor", &name, &channel]);
            channels.push(SensorChannel { scan, name: channel, camera, is_radar, token, shots });
        }
        for channel in &channels {
            for kind in ["samples", "sweeps"] {
                make_folder(&folder.join(kind).join(&channel.name))?;
            }
        }
        make_folder(&folder.join("lidarseg").join(&self.version))?;
        make_folder(&folder.join(PIECES))?;
        let mut writer = NuScenesWriter {
            style: self,
            categories: self.categories(),
            folder,
            number,
            name,
            channels,
            keys: keys.len(),
            annotations: Vec::new(),
            echoes: Vec::new(),
            seen: BTreeSet::new(),
            rows: String::new(),
            unknown: BTreeSet::new(),
        };
        writer.begin(sample, &keys);
        Ok(Box::new(writer))
    }

    fn join(&self, whole: &mut Whole) -> Result<()> {
        let folder = Path::new(ROOT).join(&self.version);
        let (mut sensors, mut logs) = (BTreeSet::new(), Vec::new());
        let pieces = whole.pieces(&whole.samples(), piece)?;
        for table in TABLES {
            let root = whole.root;
            whole.write(folder.join(format!("{table}.json")), &mut |out| {
                let mut between = "[\n";
                for piece in &pieces {
                    let text = Whole::text(root, piece)?;
                    let rows = text.lines().filter_map(|line| line.strip_prefix(table)?.strip_prefix(' '));
                    for row in rows {
                        write!(out, "{between}{row}")?;
                        between = ",\n";
                    }
                }
                // An empty table lacks its opening bracket so far.
                write!(out, "{}\n]\n", if between == "[\n" { "[" } else { "" })
            })?;
        }
        for piece in &pieces {
            let path = whole.root.join(&piece.path);
            let text = Whole::text(whole.root, piece).map_err(|fault| damaged(fault.to_string()))?;
            for line in text.lines() {
                match line.split_once(' ') {
                    Some(("sensor", row)) => drop(sensors.insert(row.to_owned())),
                    Some(("log", row)) => {
                        let row: Value =
                            serde_json::from_str(row).map_err(|error| Error::parse(&path, "", error.to_string()))?;
                        logs.push(row["token"].clone());
                    }
                    _ => {}
                }
            }
        }
        let attributes = ATTRIBUTES.iter().map(
            |name| json!({"token": token(&["attribute", name]), "name": name, "description": name.replace(['.', '_'], " ")}),
        );
        let visibility = VISIBILITY.iter().map(|(token, level, _)| {
            json!({"token": token, "level": level, "description": format!("{level} % of the object are not hidden")})
        });
        let map = json!({
            "token": token(&["map"]), "category": "semantic_prior", "filename": "maps/none.png", "log_tokens": logs,
        });
        let mut rows = |name: &str, rows: Vec<String>| {
            let text = if rows.is_empty() { "[\n]\n".to_owned() } else { format!("[\n{}\n]\n", rows.join(",\n")) };
            whole.write(folder.join(format!("{name}.json")), &mut |out| out.write_all(text.as_bytes()))
        };
        rows("sensor", sensors.into_iter().collect())?;
        rows("attribute", attributes.map(|row| row.to_string()).collect())?;
        rows("visibility", visibility.map(|row| row.to_string()).collect())?;
        rows("category", self.categories().rows())?;
        rows("map", vec![map.to_string()])?;
        let parts: serde_json::Map<String, Value> = whole
            .parts()
            .into_iter()
            .map(|(part, samples)| (part, samples.into_iter().map(scene_name).collect::<Vec<_>>().into()))
            .collect();
        let text = format!("{:#}\n", Value::Object(parts));
        whole.write(folder.join("splits.json"), &mut |out| out.write_all(text.as_bytes()))?;
        let mut mask = Vec::new();
        let mut image = png::Encoder::new(&mut mask, 1, 1);
        image.set_color(png::ColorType::Grayscale);
        let written = image.write_header().and_then(|mut image| image.write_image_data(&[0]));
        written.map_err(|error| Error::Internal(error.to_string()))?;
        whole.write(Path::new(ROOT).join("maps/none.png"), &mut |out| out.write_all(&mask))
    }

    fn readme(&self) -> String {
        format!(
            "`nuscenes` is laid out as nuScenes v1.0, each sample a scene, with key frames every {KEY_PERIOD_S} s. Points \
             are in the LiDAR's frame (x ahead, y left, z up); `calibrated_sensor` and `ego_pose` say where that is. \
             Intensities go from 0 to 255. Boxes are of the whole object when `LIDAR_TOP` scans it, and their visibility is \
             how much of them it sees; `num_lidar_pts` counts its points in them, `num_radar_pts` the detections of all radars. Those are in PCDs \
             in the frame of each radar, with velocities along the line of sight, away from it positive. Objects of which no sensor has a \
             point have none. Classes that nuScenes does not have are `static.other` in \
             `lidarseg` and have no boxes. There is no map: its mask is empty. Times count from {} s after 1970, an hour \
             for each scene.\n\n\
             ```python\n\
             from nuscenes.nuscenes import NuScenes\n\
             from nuscenes.utils.data_classes import LidarPointCloud\n\
             nusc = NuScenes(version='{}', dataroot='nuscenes', verbose=False)\n\
             data = nusc.get('sample_data', nusc.sample[0]['data']['LIDAR_TOP'])\n\
             points = LidarPointCloud.from_file(nusc.get_sample_data_path(data['token'])).points\n\
             boxes = nusc.get_boxes(data['token'])\n\
             ```\n{}",
            FIRST_US / 1_000_000,
            self.version,
            if !self.categories().own().is_empty() {
                "\nSome categories are not in nuScenes; its devkit needs colours for them: `NuScenes(…, colormap={…})`.\n"
            } else {
                ""
            }
        )
    }
}

/// Folders next to that of the tables.
const FOLDERS: [&str; 4] = ["samples", "sweeps", "lidarseg", "maps"];

/// Folder of the rows of samples.
const PIECES: &str = ".pieces";

fn piece(sample: u64) -> PathBuf {
    Path::new(ROOT).join(PIECES).join(format!("{}.txt", numbered(sample)))
}

fn scene_name(sample: u64) -> String {
    format!("scene-{sample:04}")
}

fn make_folder(path: &Path) -> Result<()> {
    fs::create_dir_all(path).map_err(|source| Error::Io { path: path.to_owned(), source })
}

/// Times of key frames among `times`: the first, and the first after each further period.
fn key_times(times: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut keys: Vec<f64> = Vec::new();
    let mut next = f64::NEG_INFINITY;
    for time in times {
        if time >= next - 1e-9 {
            let first = *keys.first().unwrap_or(&time);
            next = first + (((time - first) / KEY_PERIOD_S + 1e-6).floor() + 1.0) * KEY_PERIOD_S;
            keys.push(time);
        }
    }
    keys
}

fn timestamp(number: u64, time: f64) -> u64 {
    (FIRST_US + number * APART_US).saturating_add_signed((time * 1e6).round() as i64)
}

/// The frames of a sensor: the nearest to each key time is a key frame, those between belong to the next.
fn shots(name: &str, number: u64, channel: &str, ending: &str, times: &[f64], keys: &[f64]) -> Vec<Shot> {
    let mut key_of: BTreeMap<usize, usize> = BTreeMap::new();
    for (key, &at) in keys.iter().enumerate() {
        let nearest = (0..times.len()).min_by(|&a, &b| (times[a] - at).abs().total_cmp(&(times[b] - at).abs()));
        nearest.map(|frame| key_of.entry(frame).or_insert(key));
    }
    let shot = |(frame, &time): (usize, &f64)| {
        let is_key = key_of.contains_key(&frame);
        let next = keys.partition_point(|key| *key < time - 1e-9).min(keys.len() - 1);
        let timestamp = timestamp(number, time);
        let folder = if is_key { "samples" } else { "sweeps" };
        Shot {
            token: token(&["sample_data", name, channel, &frame.to_string()]),
            timestamp,
            is_key,
            key: key_of.get(&frame).copied().unwrap_or(next),
            file: format!("{folder}/{channel}/{}__{channel}__{timestamp}.{ending}", scene_name(number)),
        }
    };
    times.iter().enumerate().map(shot).collect()
}

/// w, x, y, z.
fn turned(orientation: DQuat) -> [f64; 4] {
    [orientation.w, orientation.x, orientation.y, orientation.z]
}

impl NuScenesWriter<'_> {
    fn row(&mut self, table: &str, row: &Value) {
        self.rows += &format!("{table} {row}\n");
    }

    fn token(&self, table: &str, of: &str) -> String {
        token(&[table, &self.name, of])
    }

    /// The token of a key frame; empty if there is none.
    fn sample_token(&self, key: Option<usize>) -> String {
        key.filter(|key| *key < self.keys).map_or_else(String::new, |key| self.token("sample", &key.to_string()))
    }

    /// Adds the rows that are known before anything is scanned.
    fn begin(&mut self, sample: &Sample, keys: &[f64]) {
        let (log, scene) = (self.token("log", ""), self.token("scene", ""));
        let scene_name = scene_name(self.number);
        self.row(
            "log",
            &json!({
                "token": log, "logfile": scene_name, "vehicle": "echocast", "date_captured": "2017-07-14",
                "location": "simulated",
            }),
        );
        let drawn = Value::from(sample.drawn());
        self.row(
            "scene",
            &json!({
                "token": scene, "log_token": log, "nbr_samples": keys.len(), "name": scene_name,
                "first_sample_token": self.sample_token(Some(0)),
                "last_sample_token": self.sample_token(Some(keys.len() - 1)),
                "description": if sample.drawn().is_empty() { String::new() } else { drawn.to_string() },
            }),
        );
        for (key, &time) in keys.iter().enumerate() {
            let row = json!({
                "token": self.sample_token(Some(key)), "timestamp": timestamp(self.number, time),
                "prev": self.sample_token(key.checked_sub(1)), "next": self.sample_token(Some(key + 1)),
                "scene_token": scene,
            });
            self.row("sample", &row);
        }
        for index in 0..self.channels.len() {
            let SensorChannel { scan, name, camera, is_radar, token: calibrated, .. } = &self.channels[index];
            let modality = match camera {
                Some(_) => "camera",
                None if *is_radar => "radar",
                None => "lidar",
            };
            let sensor = token(&["sensor", name]);
            let mount = sample.scans()[*scan].mount();
            let (orientation, intrinsic) = match camera {
                None => (mount.orientation, json!([])),
                Some((_, camera)) => {
                    ((mount.orientation * Intrinsics::FROM_OPTICAL).normalize(), json!(camera.matrix()))
                }
            };
            let row = json!({
                "token": calibrated, "sensor_token": sensor, "translation": mount.position.to_array(),
                "rotation": turned(orientation), "camera_intrinsic": intrinsic,
            });
            let sensor = json!({"token": sensor, "channel": name, "modality": modality});
            self.row("calibrated_sensor", &row);
            self.row("sensor", &sensor);
        }
    }

    /// Adds the rows of objects, once all of them are known.
    fn link(&mut self) {
        self.annotations.sort_by_key(|found| (found.track, found.key));
        let mut annotations = std::mem::take(&mut self.annotations);
        annotations.retain(|found| self.style.unseen || self.seen.contains(&(found.key, found.track)));
        for track in annotations.chunk_by(|a, b| a.track == b.track) {
            let of = |found: Option<&SampleAnnotation>| {
                found.map_or_else(String::new, |found| {
                    self.token("sample_annotation", &format!("{} {}", found.track, found.key))
                })
            };
            let instance = self.token("instance", &track[0].track.to_string());
            let mut rows = Vec::new();
            for (index, found) in track.iter().enumerate() {
                let level = VISIBILITY.iter().rev().find(|(_, _, from)| found.visible >= *from);
                let attributes: Vec<String> = found.attribute.iter().map(|name| token(&["attribute", name])).collect();
                rows.push(json!({
                    "token": of(Some(found)), "sample_token": self.sample_token(Some(found.key)),
                    "instance_token": instance, "visibility_token": level.map_or("1", |(token, ..)| token),
                    "attribute_tokens": attributes, "translation": found.pose.position.to_array(),
                    "size": [found.size.y, found.size.x, found.size.z], "rotation": turned(found.pose.orientation),
                    "prev": of(index.checked_sub(1).map(|before| &track[before])), "next": of(track.get(index + 1)),
                    "num_lidar_pts": found.points, "num_radar_pts": echoes_in(found, &self.echoes),
                }));
            }
            let row = json!({
                "token": instance, "category_token": categories::token_of(&track[0].category),
                "nbr_annotations": track.len(), "first_annotation_token": of(track.first()),
                "last_annotation_token": of(track.last()),
            });
            self.row("instance", &row);
            rows.iter().for_each(|row| self.row("sample_annotation", row));
        }
    }
}

/// Number of `echoes`, each in a key frame and at a place in the world, in the box of an object in its key frame.
fn echoes_in(found: &SampleAnnotation, echoes: &[(usize, DVec3)]) -> usize {
    let (back, half) = (found.pose.orientation.inverse(), 0.5 * found.size);
    let inside = |place: DVec3| (back * (place - found.pose.position)).abs().cmple(half).all();
    echoes.iter().filter(|(key, place)| *key == found.key && inside(*place)).count()
}

/// Number of `places` in a box, both in the same frame, as the development kit counts them.
fn inside(found: &InstanceBox, places: &[Vec3]) -> u32 {
    let (middle, half) = (found.pose.position, 0.5 * found.size);
    let (near, reach) = (middle.as_vec3(), 1.001 * half.length() as f32);
    let back = found.pose.orientation.inverse();
    let is_inside = |place: &&Vec3| (back * (place.as_dvec3() - middle)).abs().cmple(half).all();
    places.iter().filter(|place| place.distance_squared(near) <= reach * reach).filter(is_inside).count() as u32
}

/// The attribute of an object of a category at a speed, m/s.
fn attribute(category: &str, ours: &str, speed: f64) -> Option<&'static str> {
    let moves = speed > STANDING_M_S;
    match category {
        "vehicle.bicycle" | "vehicle.motorcycle" if ours.to_ascii_lowercase().ends_with("cyclist") => {
            Some("cycle.with_rider")
        }
        "vehicle.bicycle" | "vehicle.motorcycle" => Some("cycle.without_rider"),
        category if category.starts_with("vehicle.") => Some(if moves { "vehicle.moving" } else { "vehicle.parked" }),
        category if category.starts_with("human.pedestrian.") => {
            Some(if moves { "pedestrian.moving" } else { "pedestrian.standing" })
        }
        _ => None,
    }
}

impl Write for NuScenesWriter<'_> {
    fn add(&mut self, &Scanned { sample, scan, frame, cloud, boxes, .. }: &Scanned) -> Result<Report> {
        let mut report = Report::default();
        let Some(index) = self.channels.iter().position(|channel| channel.scan == scan) else {
            report
                .warn(format!("nuscenes: cannot hold sonars, left out: {}", shown::name(sample.scans()[scan].name())));
            return Ok(report);
        };
        let channel = &self.channels[index];
        let shot = &channel.shots[frame];
        let path = self.folder.join(&shot.file);
        let [mut width, mut height] = [0; 2];
        let mut labels = None;
        let mut places = Vec::new();
        if shot.is_key {
            self.seen.extend(runs(&cloud.columns.instance_id).map(|(id, _)| (shot.key, id)));
        }
        if channel.is_radar {
            cloud.write_radar(&path, RadarPoints::Nuscenes, own_velocity(&sample.scans()[scan], frame))?;
            if shot.is_key {
                let pose = &cloud.sensor_pose;
                let world = local(cloud).map(|(_, place)| pose.position + pose.orientation * place.as_dvec3());
                self.echoes.extend(world.map(|place| (shot.key, place)));
            }
        } else if let Some((grid, _)) = &channel.camera {
            [width, height] = [grid.width, grid.height];
            write_layer(&RangeImage::new(cloud, grid)?, ImageLayer::Color, None, &path, &mut report)?;
        } else {
            let columns = &cloud.columns;
            let [mut points, mut classes] = [20, 1].map(|bytes| Vec::with_capacity(bytes * cloud.len));
            let mut known = LabelCache::new();
            for (row, point) in local(cloud) {
                let ring = f32::from(columns.ring[row]);
                let numbers = [point.x, point.y, point.z, 255.0 * remission(cloud, row), ring];
                points.extend(numbers.map(f32::to_le_bytes).as_flattened());
                places.push(point);
                let category = columns.category_id[row];
                classes.push(known.of(category, || match cloud.labels.category.name(category) {
                    None => categories::NOISE,
                    Some(name) => self.categories.index(name).unwrap_or_else(|| {
                        self.unknown.insert(name.to_owned());
                        categories::OTHER
                    }),
                }));
            }
            write::whole(&path, &points)?;
            if shot.is_key {
                let file = format!("lidarseg/{}/{}_lidarseg.bin", self.style.version, shot.token);
                write::whole(&self.folder.join(&file), &classes)?;
                labels = Some(json!({"token": shot.token, "sample_data_token": shot.token, "filename": file}));
            }
        }
        let carrier = on(&cloud.sensor_pose, &inverse(sample.scans()[scan].mount()));
        let pose = json!({
            "token": shot.token, "timestamp": shot.timestamp, "rotation": turned(carrier.orientation),
            "translation": carrier.position.to_array(),
        });
        let beside = |frame: Option<usize>| {
            frame.and_then(|frame| channel.shots.get(frame)).map_or("", |shot| shot.token.as_str())
        };
        let data = json!({
            "token": shot.token, "sample_token": self.sample_token(Some(shot.key)), "ego_pose_token": shot.token,
            "calibrated_sensor_token": channel.token, "timestamp": shot.timestamp,
            "fileformat": if channel.camera.is_some() { "png" } else { "pcd" }, "is_key_frame": shot.is_key,
            "height": height, "width": width, "filename": shot.file, "prev": beside(frame.checked_sub(1)),
            "next": beside(Some(frame + 1)),
        });
        if index == 0 && shot.is_key {
            let key = shot.key;
            for found in boxes {
                let ours = cloud.labels.category.name(found.category_id).unwrap_or_default();
                let Some(category) = self.categories.of_boxes(ours) else { continue };
                self.annotations.push(SampleAnnotation {
                    key,
                    track: found.track_id,
                    category: category.to_owned(),
                    pose: in_world(cloud, found),
                    size: found.size,
                    points: inside(&found.pose(in_sensor(cloud, found)), &places),
                    visible: found.visible,
                    attribute: attribute(category, ours, found.velocity.length()),
                });
            }
        }
        self.row("ego_pose", &pose);
        self.row("sample_data", &data);
        if let Some(labels) = labels {
            self.row("lidarseg", &labels);
        }
        Ok(report)
    }

    fn finish(mut self: Box<Self>) -> Result<Report> {
        self.link();
        let path = self.folder.join(PIECES).join(format!("{}.txt", numbered(self.number)));
        write::whole(&path, self.rows.as_bytes())?;
        let mut report = Report::default();
        if !self.unknown.is_empty() {
            let names = self.unknown.into_iter().collect::<Vec<_>>().join(", ");
            report.warn(format!("nuscenes: categories that it does not have are static.other, without boxes: {names}"));
        }
        Ok(report)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn detections_of_radars_are_counted_in_their_key_frame() {
        let pose = Pose::at(500_000.0, 10.0, 0.75).with_rpy_deg(0.0, 0.0, 90.0);
        let size = DVec3::new(4.0, 2.0, 1.5);
        let car = SampleAnnotation {
            key: 1,
            track: 5,
            category: "vehicle.car".to_owned(),
            pose,
            size,
            points: 3,
            visible: 1.0,
            attribute: None,
        };
        let at = |ahead: f64, left: f64| pose.position + pose.orientation * DVec3::new(ahead, left, 0.0);
        let echoes = [(1, at(1.9, 0.0)), (0, at(0.0, 0.0)), (1, at(0.0, 1.1)), (1, at(-1.0, -0.9)), (1, at(2.1, 0.0))];
        assert_eq!(echoes_in(&car, &echoes), 2);
    }

    #[test]
    fn key_frames_come_twice_a_second() {
        let every = |step: f64, count: usize| key_times((0..count).map(move |k| k as f64 * step));
        assert_eq!(every(0.05, 21), [0.0, 0.5, 1.0]);
        assert_eq!(every(0.1, 11), [0.0, 0.5, 1.0]);
        assert_eq!(every(1.0, 3), [0.0, 1.0, 2.0]);
        // Frames 4 and 7 are the first after half a second and after a whole one.
        let found = every(0.15, 8);
        assert!(found.len() == 3 && (found[1] - 0.6).abs() < 1e-9 && (found[2] - 1.05).abs() < 1e-9, "{found:?}");
        let sweeps = shots("a", 2, "LIDAR_TOP", "pcd.bin", &[0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6], &[0.0, 0.5]);
        let seen: Vec<(bool, usize)> = sweeps.iter().map(|shot| (shot.is_key, shot.key)).collect();
        let between = (false, 1);
        assert_eq!(seen, [(true, 0), between, between, between, between, (true, 1), between]);
        assert_eq!(sweeps[1].timestamp - sweeps[0].timestamp, 100_000);
        // A slower sensor: its frames are those of the nearest key frames.
        let slow = shots("a", 2, "CAM_A", "png", &[0.02, 0.55, 1.9], &[0.0, 0.5]);
        assert_eq!(
            slow.iter().map(|shot| (shot.is_key, shot.key)).collect::<Vec<_>>(),
            [(true, 0), (true, 1), between]
        );
    }
}
