//! Contents of a scenario file, section by section.

use super::splits::Splits;
use super::variation::Rule;
use cloud::{BoxTime, Field, FieldSet, Frame};
use emitter::Navigation;
use emitter::trajectory::TrajectoryOptions;
use engine::medium::Environment;
use engine::scan::{Order, Profile};
use engine::scene::{CacheFile, GeometryUse, LabelRules, MaterialRules, UpAxis};
use engine::sensor::Sensor;
use glam::{DQuat, DVec3};
use ground::crs::Crs;
use ground::error::{Error, Result};
use ground::named::{Named, by_name};
use ground::pose::Pose;
use ground::read::bounds::Bounds;
use ground::read::yaml::{Document, inner, one_or_more_words};
use model::PrimitiveShape;
use model::material::ReflectanceSource;
use serde::Deserialize;
use serde::de::{Deserializer, Error as _};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use survey::{FlightLine, PlanSpec};
use worlds::Generate;

/// A scenario file. File names in it are relative to its folder, or to `folder`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Spec {
    /// Base folder of relative file names, instead of the file's own folder and relative to it.
    pub folder: Option<PathBuf>,
    pub scene: SceneSpec,
    #[serde(deserialize_with = "nothing_as_empty")]
    pub environment: Environment,
    pub sensors: Vec<SensorEntry>,
    pub trajectory: Option<Carrier>,
    #[serde(deserialize_with = "nothing_as_empty")]
    pub georeference: GeoreferenceSpec,
    /// Errors of the estimate of that trajectory, with which points are placed.
    pub navigation: Option<Navigation>,
    pub frames: Option<FrameSpec>,
    /// When the sensors are on, one strip after the other; empty: in frames.
    #[serde(deserialize_with = "nothing_as_empty")]
    pub strips: Vec<StripSpec>,
    #[serde(deserialize_with = "nothing_as_empty")]
    pub variation: Vec<Rule>,
    #[serde(deserialize_with = "word")]
    pub profile: Profile,
    #[serde(deserialize_with = "word_or_nothing")]
    pub reflectance_source: Option<ReflectanceSource>,
    /// Seed of all random draws.
    pub seed: u64,
    /// Number of samples.
    pub samples: u64,
    /// Column names, `default`, `all`.
    #[serde(deserialize_with = "one_or_more_words")]
    pub fields: Vec<String>,
    #[serde(deserialize_with = "word")]
    pub frame: Frame,
    #[serde(deserialize_with = "word")]
    pub order: Order,
    pub organised: bool,
    pub freeze: bool,
    /// Whether points are deskewed to the start of their frame.
    pub deskew: bool,
    /// Time for which boxes are valid.
    #[serde(deserialize_with = "word")]
    pub boxes: BoxTime,
    pub motion_tolerance_m: f64,
    #[serde(deserialize_with = "nothing_as_empty")]
    pub set: SetSpec,
    /// Output styles; each has its own keys.
    #[serde(deserialize_with = "nothing_as_empty")]
    pub outputs: Vec<Value>,
}

impl Default for Spec {
    fn default() -> Self {
        Spec {
            folder: None,
            scene: SceneSpec::default(),
            environment: Environment::default(),
            sensors: Vec::new(),
            trajectory: None,
            georeference: GeoreferenceSpec::default(),
            navigation: None,
            frames: None,
            strips: Vec::new(),
            variation: Vec::new(),
            profile: Profile::default(),
            reflectance_source: None,
            seed: 0,
            samples: 1,
            fields: vec!["default".to_owned()],
            frame: Frame::World,
            order: Order::default(),
            organised: false,
            freeze: false,
            deskew: false,
            boxes: BoxTime::default(),
            motion_tolerance_m: 1e-3,
            set: SetSpec::default(),
            outputs: Vec::new(),
        }
    }
}

/// The scene that all samples start from.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct SceneSpec {
    #[serde(deserialize_with = "one_or_more_words")]
    pub files: Vec<String>,
    /// A file of Blender, which Blender reads: [`Scenario::with_scene`](super::Scenario::with_scene).
    pub blend: Option<PathBuf>,
    pub generate: Option<Generate>,
    pub labels: LabelSource,
    #[serde(deserialize_with = "word")]
    pub up: UpAxis,
    pub scale: f64,
    pub texture_limit_mib: u64,
    pub animation: Option<String>,
    #[serde(rename = "loop")]
    pub looped: bool,
    pub allow_outside_paths: bool,
    /// Which geometry of robots is read.
    #[serde(deserialize_with = "word")]
    pub geometry: GeometryUse,
    /// Positions of the joints of robots, by name.
    pub joints: BTreeMap<String, f64>,
    /// Folders of packages and models of robots.
    #[serde(deserialize_with = "one_or_more_words")]
    pub model_paths: Vec<String>,
    /// Object name pattern to the file that describes how the object's shape changes.
    pub caches: BTreeMap<String, CacheFile>,
    /// Name patterns of objects to leave out.
    #[serde(deserialize_with = "one_or_more_words")]
    pub hide: Vec<String>,
    /// Further models, each with its own pose.
    pub place: Vec<PlacedModel>,
    /// What surfaces are made of, by material name pattern.
    pub materials: MaterialRules,
}

impl Default for SceneSpec {
    fn default() -> Self {
        let options = engine::scene::LoadOptions::default();
        SceneSpec {
            files: Vec::new(),
            blend: None,
            generate: None,
            labels: LabelSource::default(),
            up: options.up,
            scale: options.scale,
            texture_limit_mib: options.texture_limit_mib,
            animation: None,
            looped: false,
            allow_outside_paths: false,
            geometry: options.geometry,
            joints: BTreeMap::new(),
            model_paths: Vec::new(),
            caches: BTreeMap::new(),
            hide: Vec::new(),
            place: Vec::new(),
            materials: MaterialRules::default(),
        }
    }
}

/// A label file, or its contents.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) enum LabelSource {
    #[default]
    None,
    File(PathBuf),
    Rules(Box<LabelRules>),
}

impl<'de> Deserialize<'de> for LabelSource {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        match Value::deserialize(deserializer)? {
            Value::Null => Ok(LabelSource::None),
            Value::String(file) => Ok(LabelSource::File(file.into())),
            value => Ok(LabelSource::Rules(Box::new(inner(&value)?))),
        }
    }
}

/// A model or a primitive placed in the scene.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PlacedModel {
    pub model: Option<PathBuf>,
    pub primitive: Option<PrimitiveShape>,
    /// Material of the library that the primitive is made of.
    pub material: Option<String>,
    /// Greatest distance between a primitive and its triangles, m.
    #[serde(default = "a_millimetre")]
    pub tolerance_m: f64,
    /// Name of the instance; defaults to that of the file or the primitive.
    pub name: Option<String>,
    pub category: Option<String>,
    /// Position of its origin, and its orientation.
    #[serde(default)]
    pub at: PoseSpec,
    /// Scale factor relative to its file.
    #[serde(default = "unchanged")]
    pub scale: f64,
}

/// A position and an orientation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct PoseSpec {
    pub position_m: [f64; 3],
    /// Roll, pitch, yaw about the fixed axes, see [`Pose::with_rpy_deg`].
    pub rpy_deg: Option<[f64; 3]>,
    pub orientation_xyzw: Option<[f64; 4]>,
}

impl PoseSpec {
    /// The pose, or what is wrong with it; `key` is that of the section.
    pub fn pose(&self, key: &str) -> Result<Pose> {
        let [x, y, z] = self.position_m;
        let pose = match (self.rpy_deg, self.orientation_xyzw) {
            (None, None) => Pose::at(x, y, z),
            (Some([roll, pitch, yaw]), None) => Pose::at(x, y, z).with_rpy_deg(roll, pitch, yaw),
            (None, Some(turned)) => {
                let orientation = DQuat::from_array(turned);
                if !(1e-6..1e6).contains(&orientation.length()) {
                    let key = format!("{key}.orientation_xyzw");
                    return Err(Error::invalid(key, format!("{turned:?}"), "a quaternion of length 1"));
                }
                // A unit quaternion is kept bit for bit.
                let unit = orientation.is_normalized();
                Pose {
                    position: DVec3::new(x, y, z),
                    orientation: if unit { orientation } else { orientation.normalize() },
                }
            }
            (Some(_), Some(_)) => {
                return Err(Error::invalid(key, "rotated twice", "rpy_deg or orientation_xyzw"));
            }
        };
        if pose.position.is_finite() && pose.orientation.is_finite() {
            return Ok(pose);
        }
        Err(Error::invalid(key, format!("{:?}", self.position_m), "finite numbers"))
    }
}

/// A sensor of the rig.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SensorEntry {
    /// Its name in the set; defaults to the sensor's own.
    pub name: Option<String>,
    /// A preset, a sensor file, or the contents of one.
    pub sensor: Value,
    /// Keys that replace those of the sensor: sections, or paths such as `noise.range_sigma_m`.
    #[serde(default)]
    pub set: serde_json::Map<String, Value>,
    /// Its pose on the carrier.
    #[serde(default)]
    pub mount: PoseSpec,
    /// Scans per second; defaults to one scan for each frame.
    pub rate_hz: Option<f64>,
    /// When the first of these scans starts, s after the first frame.
    #[serde(default)]
    pub start_s: f64,
}

/// How the carrier of the sensors moves.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Carrier {
    /// A file of any format of trajectories; time 0 is the first pose.
    File(PathBuf),
    /// A fixed pose.
    At(PoseSpec),
    /// A camera node of the scene.
    Camera(String),
    /// An object of the scene, whose x axis points forward.
    Object(String),
    /// Rows of a time, s, and a pose, as in TUM text.
    Poses(Vec<[f64; 8]>),
    /// A fixed pose on surfaces of the scene, different in each sample.
    On(Box<super::variation::Spot>),
    /// A survey with the first sensor, which also says when the sensors are on.
    Plan(Box<PlanSpec>),
}

/// How the world lies on the Earth.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct GeoreferenceSpec {
    /// Coordinate system of the world, as [`Crs::open_in`] takes it.
    crs: Option<String>,
    /// Coordinates of the world's origin in it.
    offset_m: [f64; 3],
    /// GPS week from whose start the times of the trajectory count.
    gps_week: Option<u16>,
}

impl GeoreferenceSpec {
    /// How to read trajectories; files of coordinate systems are in `folder`.
    ///
    /// # Errors
    /// As [`Crs::open_in`].
    pub fn options(&self, folder: &Path) -> Result<TrajectoryOptions> {
        let crs = self.crs.as_ref().map(|crs| Crs::open_in(folder, crs)).transpose()?;
        Ok(TrajectoryOptions::default().crs(crs).offset(DVec3::from_array(self.offset_m)).gps_week(self.gps_week))
    }
}

impl<'de> Deserialize<'de> for Carrier {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct CarrierFile {
            file: PathBuf,
        }
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct CarrierCamera {
            camera: String,
        }
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct CarrierObject {
            object: String,
        }
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Poses {
            poses: Vec<[f64; 8]>,
        }
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Planned {
            plan: Box<PlanSpec>,
        }
        let value = Value::deserialize(deserializer)?;
        let has = |key: &str| value.get(key).is_some();
        Ok(match () {
            () if has("file") => Carrier::File(inner::<CarrierFile, _>(&value)?.file),
            () if has("camera") => Carrier::Camera(inner::<CarrierCamera, _>(&value)?.camera),
            () if has("object") => Carrier::Object(inner::<CarrierObject, _>(&value)?.object),
            () if has("poses") => Carrier::Poses(inner::<Poses, _>(&value)?.poses),
            () if has("on") => Carrier::On(Box::new(inner(&value)?)),
            () if has("plan") => Carrier::Plan(inner::<Planned, _>(&value)?.plan),
            () if has("position_m") => Carrier::At(inner(&value)?),
            () => {
                let found = value.as_object().and_then(|keys| keys.keys().next()).cloned().unwrap_or_default();
                const KNOWN: &[&str] = &["file", "position_m", "camera", "object", "poses", "on", "plan"];
                return Err(D::Error::unknown_field(&found, KNOWN));
            }
        })
    }
}

/// Where the section of a plan is.
pub(super) const PLAN_KEY: &str = "trajectory.plan";

/// Which frames are scanned; frame k starts at k / fps seconds.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FrameSpec {
    #[serde(default)]
    pub first: u32,
    /// Inclusive.
    pub last: u32,
    #[serde(default = "one")]
    pub step: u32,
    /// Defaults to the rate of the first sensor.
    pub fps: Option<f64>,
}

/// A part of the trajectory on which the sensors are on.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct StripSpec {
    /// Number of the strip, 1 to 65535: flight line or station. Entries of one number are parts of one strip.
    pub strip: u16,
    /// Start, s, in the time of the trajectory.
    pub from_s: f64,
    /// End, s, likewise.
    pub to_s: f64,
    /// Keys that replace those of all sensors there, as [`SensorEntry::set`].
    #[serde(default)]
    pub set: serde_json::Map<String, Value>,
}

impl StripSpec {
    /// A strip of a plan.
    pub fn planned(line: &FlightLine) -> StripSpec {
        let FlightLine { strip, from_s, to_s, .. } = *line;
        StripSpec { strip, from_s, to_s, set: serde_json::Map::new() }
    }
}

/// Checks the section `strips` by itself, and with the other sections.
///
/// # Errors
/// A number or a time that is not allowed; sections that do not go with strips.
fn check_strips(spec: &Spec) -> Result<()> {
    /// Latest time, s.
    const LATEST: f64 = 1e9;
    let mut before = f64::NEG_INFINITY;
    for (index, strip) in spec.strips.iter().enumerate() {
        let key = |name: &str| format!("strips[{index}].{name}");
        let StripSpec { strip, from_s, to_s, .. } = *strip;
        if strip == 0 {
            return Err(Error::invalid(key("strip"), strip, format!("1 to {}", u16::MAX)));
        }
        if !(from_s.abs() <= LATEST && from_s >= before) {
            let allowed = if before.is_finite() {
                format!("{before} or more, where the strip before ends")
            } else {
                format!("-{LATEST:e} to {LATEST:e}")
            };
            return Err(Error::invalid(key("from_s"), from_s, allowed));
        }
        if !(to_s > from_s && to_s <= LATEST) {
            return Err(Error::invalid(key("to_s"), to_s, format!("above from_s, {from_s}, up to {LATEST:e}")));
        }
        before = to_s;
    }
    let planned = matches!(spec.trajectory, Some(Carrier::Plan(_)));
    if spec.strips.is_empty() && !planned {
        return Ok(());
    }
    if planned && !spec.strips.is_empty() {
        return Err(Error::invalid("strips", "given beside trajectory.plan", "one of the two: a plan makes strips"));
    }
    let without = "without strips, in which scans follow each other";
    if spec.frames.is_some() {
        return Err(Error::invalid("frames", "given beside strips", without));
    }
    match spec.sensors.iter().position(|entry| entry.rate_hz.is_some() || entry.start_s != 0.0) {
        Some(index) => {
            Err(Error::invalid(format!("sensors[{index}]"), "given rate_hz or start_s beside strips", without))
        }
        None => Ok(()),
    }
}

fn one() -> u32 {
    1
}

fn unchanged() -> f64 {
    1.0
}

fn a_millimetre() -> f64 {
    1e-3
}

/// The set that the samples form.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct SetSpec {
    /// Folder that it is written to; defaults to one named after the scenario file, without extension.
    pub folder: Option<PathBuf>,
    /// Its splits.
    pub splits: Splits,
    /// Its licence: a name such as `CC-BY-4.0`, or a sentence.
    pub licence: Option<String>,
}

fn word<'de, D: Deserializer<'de>, T: Named>(deserializer: D) -> Result<T, D::Error> {
    by_name("value", &String::deserialize(deserializer)?).map_err(D::Error::custom)
}

fn word_or_nothing<'de, D: Deserializer<'de>, T: Named>(deserializer: D) -> Result<Option<T>, D::Error> {
    let word = Option::<String>::deserialize(deserializer)?;
    word.map(|word| by_name("value", &word).map_err(D::Error::custom)).transpose()
}

/// A list or section; an empty value, as where all entries are commented out, is read as an empty one.
fn nothing_as_empty<'de, D: Deserializer<'de>, T: Deserialize<'de> + Default>(deserializer: D) -> Result<T, D::Error> {
    Option::deserialize(deserializer).map(Option::unwrap_or_default)
}

impl Spec {
    /// Reads and checks `document`.
    pub fn read(document: &Document) -> Result<Spec> {
        let spec: Spec = document.read()?;
        spec.check().map_err(|error| document.locate(error))?;
        Ok(spec)
    }

    /// Reads what is kept in separate files, whose names are relative to `folder`.
    ///
    /// # Errors
    /// A missing or invalid file.
    pub fn read_files(&mut self, folder: &Path) -> Result<()> {
        self.environment.read_files(folder)
    }

    /// Columns of clouds of `sensor`: its default columns, and the cause of each point, by which training can exclude
    /// or weight points.
    ///
    /// # Errors
    /// A column that does not exist.
    pub fn fields(&self, sensor: &Sensor) -> Result<FieldSet> {
        FieldSet::parse_with(&self.fields.join(","), sensor.default_fields().with(Field::Cause))
    }

    /// Frames per second; `first` is the first sensor.
    pub fn fps(&self, first: &Sensor) -> f64 {
        self.frames.and_then(|frames| frames.fps).unwrap_or_else(|| 1.0 / first.beams().period)
    }

    fn check(&self) -> Result<()> {
        /// More than any real set has; sample numbers fit in 32 bits.
        const MOST_SAMPLES: u64 = 1_000_000_000;
        if !(1..=MOST_SAMPLES).contains(&self.samples) {
            return Err(Error::invalid("samples", self.samples, format!("1 to {MOST_SAMPLES}")));
        }
        if !(self.motion_tolerance_m > 0.0 && self.motion_tolerance_m <= 1e3) {
            return Err(Error::invalid("motion_tolerance_m", self.motion_tolerance_m, "above 0, up to 1000 m"));
        }
        if self.organised && self.order == Order::Time {
            return Err(Error::invalid("order", "time", "beam for organised clouds, whose rows and columns are beams"));
        }
        if let Some(frames) = &self.frames {
            if frames.last < frames.first || frames.step == 0 {
                let found = format!("{} to {} with step {}", frames.first, frames.last, frames.step);
                return Err(Error::invalid("frames", found, "last not before first, step 1 or more"));
            }
            if let Some(fps) = frames.fps.filter(|fps| !(*fps > 0.0 && fps.is_finite())) {
                return Err(Error::invalid("frames.fps", fps, "above 0"));
            }
        }
        for (index, sensor) in self.sensors.iter().enumerate() {
            let key = format!("sensors[{index}]");
            sensor.mount.pose(&format!("{key}.mount"))?;
            if let Some(rate) = sensor.rate_hz.filter(|rate| !(1e-6..=1e6).contains(rate)) {
                return Err(Error::invalid(format!("{key}.rate_hz"), rate, "1e-6 to 1e6"));
            }
            if !(0.0..1e9).contains(&sensor.start_s) {
                return Err(Error::invalid(format!("{key}.start_s"), sensor.start_s, "0 to 1e9"));
            }
        }
        if self.set.folder.as_ref().is_some_and(|folder| folder.as_os_str().is_empty()) {
            return Err(Error::invalid("set.folder", "\"\"", "the name of a folder, or no such key"));
        }
        self.environment.check().map_err(|error| match error {
            Error::InvalidParameter { name, value, allowed } => {
                Error::InvalidParameter { name: format!("environment.{name}"), value, allowed }
            }
            other => other,
        })?;
        if let Some(navigation) = &self.navigation {
            Bounds::none().section("navigation", |bounds| navigation.check(bounds))?;
        }
        match &self.trajectory {
            Some(Carrier::On(spot)) => spot.check("trajectory")?,
            Some(Carrier::Plan(plan)) => plan.check(PLAN_KEY)?,
            _ => {}
        }
        check_strips(self)?;
        super::variation::check(&self.variation)
    }
}
