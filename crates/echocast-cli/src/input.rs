//! The inputs of a scan: scene and sensor.

use crate::{choice, text, usage};
use anyhow::{Context as _, Result, anyhow, bail, ensure};
use clap::Args;
use clap::builder::{OsStringValueParser, TypedValueParser as _};
use echocast::echo::IntensityEncoding;
use echocast::scene::{CacheFile, FORMATS, GeometryUse, Material, MaterialRule, MaterialRules, UpAxis};
use echocast::{Error, LabelRules, LoadOptions, ReturnMode, Scene, Sensor, shown};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::error::Error as _;
use std::ffi::{OsStr, OsString};
use std::io::{ErrorKind, Read as _, stdin};
use std::os::unix::ffi::OsStrExt as _;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// Endings of scene files without units and axes.
const UNITLESS: &[&str] = &["obj", "ply", "stl"];

/// Scene files and how to read them.
#[derive(Args)]
pub struct SceneArgs {
    /// Scene files; several are combined as they are (`echocast formats` lists the formats)
    #[arg(required = true, value_name = "SCENE")]
    pub files: Vec<PathBuf>,
    /// Label file (YAML): maps names to numbers, and patterns of object and material names to names; `-` for standard
    /// input; or built-in rules: forest, semantic_kitti, street
    #[arg(long, value_name = "FILE|NAME", help_heading = "Scene")]
    labels: Option<PathBuf>,
    /// Leave out the objects whose names, or those of their parent nodes, match PATTERN (with `*` and `?`): sky boxes,
    /// helpers. Example: `--hide "Sky*"`; repeatable
    #[arg(long, value_name = "PATTERN", help_heading = "Scene")]
    hide: Vec<String>,
    /// Materials of surfaces (YAML): maps patterns of material names to the name of a library material or to keys of a
    /// material file; `-` for standard input
    #[arg(long, value_name = "FILE", help_heading = "Scene")]
    materials: Option<PathBuf>,
    /// Make materials whose name matches PATTERN (with `*` and `?`) reflect like the library material NAME
    /// (`echocast info` lists what is used). Example: `--material "Sofa*=fabric"`; repeatable
    #[arg(long, value_name = "PATTERN=NAME", value_parser = material, help_heading = "Scene")]
    material: Vec<(String, String)>,
    /// Up axis of scene formats that do not define one (OBJ, PLY, STL)
    #[arg(long, default_value = "z", value_parser = choice::of::<UpAxis>(), allow_hyphen_values = true, help_heading = "Scene")]
    up: UpAxis,
    /// Metres per unit of scene formats that do not define the unit (OBJ, PLY, STL), such as 0.001 for millimetres
    #[arg(long, value_name = "F", default_value = "1", value_parser = positive, help_heading = "Scene")]
    scale: f64,
    /// Memory limit for the images of all materials, MiB
    #[arg(long, value_name = "MIB", default_value_t = LoadOptions::default().texture_limit_mib, help_heading = "Scene")]
    texture_limit: u64,
    /// Play only this animation (`echocast info` lists them) [default: all of them at once]
    #[arg(long, value_name = "NAME", help_heading = "Scene")]
    animation: Option<String>,
    /// Repeat animations and caches: each starts again at its last key or sample, instead of staying there
    #[arg(long = "loop", help_heading = "Scene")]
    looped: bool,
    /// Let scenes refer to buffers, images and material files outside their own folder: only for scenes that you trust
    #[arg(long, help_heading = "Scene")]
    allow_outside_paths: bool,
    /// Which geometry of robots (URDF, SDF, MJCF) is scanned: what is to be seen, or what may be touched
    #[arg(long, default_value = "visual", value_parser = choice::of::<GeometryUse>(), help_heading = "Scene")]
    geometry: GeometryUse,
    /// Position of a joint of a robot, radians or metres; all others are at rest. Example: `--joint left_hip=0.3`;
    /// repeatable
    #[arg(long, value_name = "NAME=Q", value_parser = joint, help_heading = "Scene")]
    joint: Vec<(String, f64)>,
    /// Folder of packages and models that robots name (`package://`, `model://`), besides their own; repeatable
    #[arg(long, value_name = "DIR", help_heading = "Scene")]
    model_path: Vec<PathBuf>,
    /// Change the shape of the object NAME (a pattern with `*` and `?`) over time, with a vertex cache (.mdd, .pc2) or
    /// with numbered scene files, of which FILE is the first; FPS is the frame rate of .pc2 and of numbered files (24
    /// by default). Example: `--cache Flag=flag.pc2 --cache Water=water_0001.obj@25`; repeatable
    #[arg(long, value_name = "NAME=FILE[@FPS]", value_parser = OsStringValueParser::new().try_map(cache), help_heading = "Scene")]
    cache: Vec<(String, CacheFile)>,
}

impl SceneArgs {
    /// The rules of the label file.
    pub fn labels(&self) -> Result<LabelRules> {
        match &self.labels {
            Some(file) => Ok(file_or_stdin("--labels", file, LabelRules::open, LabelRules::from_yaml)?),
            None => Ok(LabelRules::default()),
        }
    }

    /// The rules of `--materials` and `--material`.
    pub fn materials(&self) -> Result<MaterialRules> {
        let mut rules = match &self.materials {
            Some(file) => file_or_stdin("--materials", file, MaterialRules::load, MaterialRules::from_yaml)?,
            None => MaterialRules::default(),
        };
        for (pattern, name) in &self.material {
            Material::library(name).context("--material").map_err(usage::wrong)?;
            rules.set(pattern, MaterialRule::Library(name.clone()));
        }
        Ok(rules)
    }

    /// The vertex caches, by pattern.
    fn caches(&self) -> Result<BTreeMap<String, CacheFile>> {
        let mut caches = BTreeMap::new();
        for (name, file) in &self.cache {
            let before = caches.insert(name.clone(), file.clone());
            ensure!(before.is_none(), "--cache: {:?} is given twice; allowed: once for each name", shown::text(name));
        }
        Ok(caches)
    }

    /// Checks that a scene needs `--up` and `--scale`.
    fn check_units(&self) -> Result<()> {
        let specified = self.up != UpAxis::Z || self.scale != 1.0;
        ensure!(
            !specified || self.files.iter().any(|file| has_ending(file, UNITLESS)),
            "--up, --scale: {} already defines its up axis and its unit",
            self.names()
        );
        Ok(())
    }

    /// The units and axes assumed for files that do not define them; `None`: all do.
    pub fn units(&self) -> Option<String> {
        self.files.iter().any(|file| has_ending(file, UNITLESS)).then(|| {
            let endings = UNITLESS.join(", ").to_uppercase();
            format!("of {endings}: one is {} m (--scale), {} is up (--up)", self.scale, self.up.name())
        })
    }

    /// Reads all files into one scene, labelled by `labels` and made of `materials`.
    pub fn load(&self, labels: &LabelRules, materials: &MaterialRules) -> Result<Scene> {
        self.check_units().map_err(usage::wrong)?;
        let options = LoadOptions::default()
            .up(self.up)
            .scale(self.scale)
            .labels(labels.clone())
            .texture_limit_mib(self.texture_limit)
            .animation(self.animation.clone())
            .looped(self.looped)
            .allow_outside_paths(self.allow_outside_paths)
            .geometry(self.geometry)
            .joints(self.joint.iter().cloned().collect())
            .model_paths(self.model_path.clone())
            .caches(self.caches().map_err(usage::wrong)?)
            .materials(materials.clone())
            .hide(self.hide.clone());
        let readable = |file: &PathBuf| FORMATS.iter().any(|format| has_ending(file, format.extensions));
        Scene::load_all(&self.files, &options).map_err(|error| match error {
            // It is about the content of a file, not its ending.
            Error::Unsupported { .. } if self.files.iter().all(readable) => error.into(),
            error => usage::wrong(error),
        })
    }

    /// File names for display.
    pub fn names(&self) -> String {
        text::paths(&self.files).join(" + ")
    }

    /// As the section `scene` of a scenario; `labels` are the rules of the label file, `materials` those of
    /// materials.
    pub fn to_json(&self, labels: &LabelRules, materials: &MaterialRules) -> Result<Value> {
        // Standard input cannot be read again.
        let labels = match &self.labels {
            Some(file) if file.as_os_str() == "-" => {
                serde_json::to_value(labels).context("the label rules cannot be reported")?
            }
            file => json!(file.as_deref().map(shown::path)),
        };
        let caches: serde_json::Map<String, Value> = self
            .cache
            .iter()
            .map(|(name, CacheFile { file, fps, .. })| (name.clone(), json!({"file": shown::path(file), "fps": fps})))
            .collect();
        Ok(json!({
            "files": text::paths(&self.files),
            "labels": labels,
            "up": self.up.name(),
            "scale": self.scale,
            "texture_limit_mib": self.texture_limit,
            "animation": self.animation,
            "loop": self.looped,
            "allow_outside_paths": self.allow_outside_paths,
            "geometry": self.geometry.name(),
            "joints": self.joint.iter().cloned().collect::<BTreeMap<String, f64>>(),
            "model_paths": text::paths(&self.model_path),
            "caches": caches,
            "hide": self.hide,
            "materials": serde_json::to_value(materials).context("the material rules cannot be reported")?,
        }))
    }
}

/// Whether the name of `file` ends in one of `endings`.
pub fn has_ending(file: &Path, endings: &[&str]) -> bool {
    file.extension().is_some_and(|found| endings.iter().any(|ending| found.eq_ignore_ascii_case(ending)))
}

/// A sensor and changes to it.
#[derive(Args)]
pub struct SensorArgs {
    /// Preset (`echocast sensors` lists them), a sensor file (.yaml), or `-` for one from standard input
    #[arg(long, value_name = "NAME|FILE", help_heading = "Sensor")]
    sensor: PathBuf,
    /// Change one parameter by its path in the sensor's YAML; repeatable
    #[arg(long, value_name = "KEY=VALUE", value_parser = key_value, help_heading = "Sensor")]
    set: Vec<(String, String)>,
    /// Which echo of a beam is reported [default: that of the sensor]
    #[arg(long, value_name = "MODE", value_parser = choice::of::<ReturnMode>(), help_heading = "Sensor")]
    returns: Option<ReturnMode>,
    /// How intensity is encoded [default: that of the sensor]
    #[arg(long, value_name = "ENCODING", value_parser = choice::of::<IntensityEncoding>(), help_heading = "Sensor")]
    intensity: Option<IntensityEncoding>,
}

impl SensorArgs {
    /// The sensor with its changes.
    pub fn load(&self) -> Result<Sensor> {
        let mut sensor = load_sensor(&self.sensor).context("--sensor")?;
        for (key, value) in &self.set {
            sensor.set(key, value).map_err(wrong_key).context("--set")?;
        }
        if let Some(mode) = self.returns {
            set_returns(&mut sensor, mode).map_err(usage::wrong)?;
        }
        if let Some(encoding) = self.intensity {
            sensor.set("intensity.encoding", encoding.name()).context("--intensity").map_err(usage::wrong)?;
        }
        Ok(sensor)
    }
}

/// Sets which echoes `sensor` reports.
fn set_returns(sensor: &mut Sensor, mode: ReturnMode) -> Result<()> {
    ensure!(
        sensor.kind().is_optical(),
        "--returns: the sensor is a sonar, which reports the depth of each beam, or all range bins above its threshold; \
         allowed: with other sensors"
    );
    sensor.set("returns.mode", mode.name()).context("--returns")
}

/// The error of the command for a KEY=VALUE that cannot be set.
pub fn wrong_key(error: Error) -> anyhow::Error {
    match error {
        // The text that could not be parsed is KEY=VALUE.
        Error::Parse { .. } => usage::wrong(anyhow!("{error}")),
        error => usage::wrong(error),
    }
}

/// A preset, as [`Sensor::preset`] finds it, or a file if `name` is the name of one.
pub fn load_sensor(name: &Path) -> Result<Sensor> {
    file_or_stdin("--sensor", name, open_sensor, |text| Sensor::from_yaml(text, ""))
}

fn open_sensor(name: &Path) -> Result<Sensor> {
    Sensor::open(name).map_err(|error| match error {
        missing @ Error::Missing { .. } => {
            let missing = anyhow::Error::new(missing);
            usage::wrong(missing.context(format!("{} is neither a preset nor a file", shown::path(name))))
        }
        other => usage::wrong(other),
    })
}

/// The `file` of `option`, read with `load`; or standard input, if it is `-`, read with `parse`.
pub fn file_or_stdin<'f, T, E: Into<anyhow::Error>>(
    option: &'static str,
    file: &'f Path,
    load: impl FnOnce(&'f Path) -> Result<T, E>,
    parse: impl FnOnce(&str) -> echocast::Result<T>,
) -> Result<T> {
    /// Longest standard input.
    const MOST_MIB: u64 = 256;
    /// The option that has read it.
    static READ_BY: OnceLock<&str> = OnceLock::new();
    if file != Path::new("-") {
        return load(file).map_err(|error| match error.into() {
            error if is_pipe(file, &error) => {
                anyhow!("{}; for standard input, use `-`", text::one_line(&error))
            }
            error => error,
        });
    }
    let by = *READ_BY.get_or_init(|| option);
    if by != option {
        let twice = anyhow!("{option} -: standard input is already read by {by}; allowed: one option");
        return Err(usage::wrong(twice));
    }
    let mut input = String::new();
    let read = stdin().lock().take((MOST_MIB << 20) + 1).read_to_string(&mut input);
    read.with_context(|| format!("{option} -: standard input"))?;
    ensure!(
        input.len() as u64 <= MOST_MIB << 20,
        "{option} -: standard input is longer than {MOST_MIB} MiB, the most allowed"
    );
    parse(&input).with_context(|| format!("{option} -"))
}

/// Whether `error` says that `file` is not a regular file.
fn is_pipe(file: &Path, error: &anyhow::Error) -> bool {
    let Some(Error::Io { path, source }) = error.downcast_ref() else { return false };
    path == file && source.kind() == ErrorKind::InvalidInput
}

/// `NAME=FILE[@FPS]`; what follows an `@` and is no number belongs to the file.
fn cache(text: OsString) -> Result<(String, CacheFile), String> {
    let expected = "expected NAME=FILE or NAME=FILE@FPS, such as Flag=flag.pc2@25";
    let bytes = text.as_bytes();
    let split = bytes.iter().position(|&byte| byte == b'=').ok_or(expected)?;
    let (name, file) = (&bytes[..split], &bytes[split + 1..]);
    let name = str::from_utf8(name).map_err(|_| "NAME is not UTF-8 text")?;
    let (file, fps) = match file.iter().rposition(|&byte| byte == b'@') {
        Some(at) => match str::from_utf8(&file[at + 1..]).ok().and_then(|fps| fps.parse().ok()) {
            Some(fps) => (&file[..at], Some(fps)),
            None => (file, None),
        },
        None => (file, None),
    };
    if name.is_empty() || file.is_empty() {
        return Err(expected.into());
    }
    Ok((name.to_owned(), CacheFile::new(OsStr::from_bytes(file)).fps(fps)))
}

pub fn key_value(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((key, value)) if !key.is_empty() => Ok((key.to_owned(), value.to_owned())),
        _ => Err("expected KEY=VALUE, such as noise.range_sigma_m=0".into()),
    }
}

/// `PATTERN=NAME`; the pattern may hold `=` itself.
fn material(text: &str) -> Result<(String, String), String> {
    match text.rsplit_once('=') {
        Some((pattern, name)) if !pattern.is_empty() && !name.is_empty() => Ok((pattern.to_owned(), name.to_owned())),
        _ => Err("expected PATTERN=NAME, such as Sofa*=fabric".into()),
    }
}

/// `NAME=Q`; the name may hold `=` itself.
fn joint(text: &str) -> Result<(String, f64), String> {
    let position = |number: &str| number.parse().ok().filter(|number: &f64| number.is_finite());
    let parts = text.rsplit_once('=').and_then(|(name, number)| Some((name.to_owned(), position(number)?)));
    parts.filter(|(name, _)| !name.is_empty()).ok_or("expected NAME=Q, such as left_hip=0.3".into())
}

/// A number above 0.
pub fn positive(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|number: &f64| *number > 0.0 && number.is_finite())
        .ok_or("expected a number above 0".into())
}

/// Uses `threads` threads for all parallel work, or all cores if `None`.
pub fn set_threads(threads: Option<u16>) -> Result<usize> {
    let Err(error) = rayon::ThreadPoolBuilder::new().num_threads(threads.unwrap_or(0).into()).build_global() else {
        return Ok(rayon::current_num_threads());
    };
    if error.source().is_some() {
        let requested =
            threads.map_or("as many threads as there are cores".to_owned(), |threads| format!("{threads} threads"));
        bail!(
            "--threads: the system cannot start {requested} ({error}); allowed: fewer, or a higher limit of processes"
        );
    }
    // Inside Blender the threads have been started before.
    let started = rayon::current_num_threads();
    ensure!(
        threads.is_none_or(|threads| usize::from(threads) == started),
        "--threads: Blender has started {started} threads already; allowed: without --threads"
    );
    Ok(rayon::current_num_threads())
}
