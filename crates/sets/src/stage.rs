//! What samples start from: scenes, sensors and files, read and built once.

use super::assets::{self, Assets};
use super::lock;
use super::spec::{LabelSource, PlacedModel, SceneSpec, SensorEntry, Spec};
use super::variation::{SCALES, Units, What};
use engine::scene::{LabelRules, LoadOptions, Material, Object, PrimitiveShape, Scene, matches};
use engine::sensor::Sensor;
use engine::trace::{Engine, LiveScene};
use glam::{DAffine3, DVec3};
use ground::error::{Error, Result};
use ground::read::bounds::Bounds;
use ground::read::yaml::Document;
use ground::shown;
use serde_json::Value;
use std::collections::{HashMap, VecDeque};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, TryLockError};

/// What the samples of a scenario share, for any number of threads.
#[derive(Debug)]
pub(super) struct Stage {
    pub engine: Engine,
    /// The scene that Blender has read.
    given: Option<Arc<Scene>>,
    pub assets: Assets,
    pub labels: LabelRules,
    /// The files that each rule names.
    pub models: Vec<Vec<(PathBuf, f64)>>,
    /// Start and length, s, of the first frame, unless a rule changes it: scenes are built for this interval, so that
    /// samples share even what moves.
    first_frame: Option<[f64; 2]>,
    /// The most recent scenes, by the section that describes them, newest last.
    bases: Mutex<VecDeque<(String, BaseSlot)>>,
    /// By the entry that describes them.
    sensors: Mutex<HashMap<String, Arc<Sensor>>>,
}

/// A built scene that samples start from.
#[derive(Debug)]
pub(super) struct Base {
    pub scene: Scene,
    pub live: LiveScene,
    pub units: Units,
}

/// A scene that is built, or will be by the first sample that needs it.
type BaseSlot = Arc<Mutex<Option<Arc<Base>>>>;

/// Number of scenes kept, where the scene itself differs between samples.
const KEPT: usize = 4;

/// Number of sensors kept, likewise.
const KEPT_SENSORS: usize = 64;

/// A scene of the primitive `shape` alone, as `place`, which is at `key`, describes it.
fn primitive(place: &PlacedModel, shape: &PrimitiveShape, key: &str) -> Result<Scene> {
    let within = |error| match error {
        Error::InvalidParameter { name, value, allowed } => {
            Error::InvalidParameter { name: format!("{key}.{name}"), value, allowed }
        }
        other => other,
    };
    Bounds::none().section("primitive", |bounds| shape.check(bounds)).map_err(within)?;
    let mesh = shape.mesh(shape.name(), place.tolerance_m).map_err(within)?;
    let mut object = Object::new(shape.name(), Arc::new(mesh));
    object.material = place.material.as_deref().map(Material::library).transpose().map_err(within)?.map(Arc::new);
    let mut scene = Scene::default();
    scene.materials.extend(object.material.clone());
    scene.objects.push(object);
    Ok(scene)
}

impl Stage {
    /// # Errors
    /// A label file that cannot be read; a missing model.
    pub fn new(spec: &Spec, folder: &Path, engine: Engine, given: Option<Arc<Scene>>) -> Result<Stage> {
        let labels = match &spec.scene.labels {
            LabelSource::None => LabelRules::default(),
            LabelSource::File(file) => LabelRules::open_in(folder, file)?,
            LabelSource::Rules(rules) => {
                let mut rules = (**rules).clone();
                rules.check(&Document::from_value("", Value::Null), "scene.labels")?;
                rules.caches.values_mut().for_each(|cache| cache.file = folder.join(&cache.file));
                rules
            }
        };
        let files = |(index, rule): (usize, &super::variation::Rule)| match &rule.what {
            What::Swap(rule) => assets::files(&rule.with.0, folder, &format!("variation[{index}].with")),
            What::Place(rule) => assets::files(&rule.place.0, folder, &format!("variation[{index}].place")),
            _ => Ok(Vec::new()),
        };
        let models = spec.variation.iter().enumerate().map(files).collect::<Result<_>>()?;
        let (bases, sensors) = (Mutex::default(), Mutex::default());
        let mut stage =
            Stage { engine, given, assets: Assets::default(), labels, models, first_frame: None, bases, sensors };
        // A sensor that cannot be read is reported by the samples that use it.
        let sensor = spec.sensors.first().and_then(|entry| stage.sensor(entry, "sensors[0]", folder).ok());
        stage.first_frame = sensor.map(|sensor| {
            let first = f64::from(spec.frames.map_or(0, |frames| frames.first)) / spec.fps(&sensor);
            [first + spec.sensors[0].rate_hz.map_or(0.0, |_| spec.sensors[0].start_s), sensor.scan_time()]
        });
        Ok(stage)
    }

    /// The scene that `spec` describes; `key` is the text of its section. Waits if another thread is building the same
    /// scene.
    ///
    /// # Errors
    /// As [`Scene::load`] and [`LiveScene::commit`]; a pattern that nothing matches.
    pub fn base(&self, spec: &Spec, key: String, folder: &Path) -> Result<Arc<Base>> {
        let slot = {
            let mut bases = lock(&self.bases);
            match bases.iter().find(|(known, _)| *known == key) {
                Some((_, slot)) => slot.clone(),
                None => {
                    if bases.len() == KEPT {
                        bases.pop_front();
                    }
                    let slot = BaseSlot::default();
                    bases.push_back((key, slot.clone()));
                    slot
                }
            }
        };
        // Threads that need the same scene wait for it, except pool threads: the job that they left for this one may be
        // part of its construction, and waiting would deadlock.
        let in_the_way = self.engine.threads() > 1 && rayon::current_thread_index().is_some();
        let mut base = match slot.try_lock() {
            Err(TryLockError::WouldBlock) if in_the_way => return Ok(Arc::new(self.make(spec, folder)?)),
            Err(TryLockError::WouldBlock) => lock(&slot),
            Err(TryLockError::Poisoned(known)) => known.into_inner(),
            Ok(base) => base,
        };
        match &*base {
            Some(base) => Ok(base.clone()),
            None => Ok(base.insert(Arc::new(self.make(spec, folder)?)).clone()),
        }
    }

    fn make(&self, spec: &Spec, folder: &Path) -> Result<Base> {
        let scene = self.read(&spec.scene, folder)?;
        check_hidden(&scene, &spec.scene.hide)?;
        let mut live = LiveScene::new(&self.engine);
        live.set_motion_tolerance(spec.motion_tolerance_m)?;
        live.add_scene(&scene)?;
        for (index, place) in spec.scene.place.iter().enumerate() {
            let key = format!("scene.place[{index}]");
            let [low, high] = SCALES;
            if !(low..=high).contains(&place.scale) {
                return Err(Error::invalid(format!("{key}.scale"), place.scale, format!("{low:e} to {high:e}")));
            }
            let pose = place.at.pose(&format!("{key}.at"))?;
            let placed =
                DAffine3::from_scale_rotation_translation(DVec3::splat(place.scale), pose.orientation, pose.position);
            let mut add = |scene: &Scene, usual: &str| {
                let name = (place.name.as_deref().unwrap_or(usual), live.next_instance());
                live.add_model(scene, &placed, name, place.category.as_deref()).map(drop)
            };
            match (&place.model, &place.primitive) {
                (Some(model), None) if place.material.is_none() => {
                    let path = folder.join(model);
                    let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
                    add(&self.assets.model(&path, &self.labels)?.scene, &stem)?;
                }
                (None, Some(shape)) => add(&primitive(place, shape, &key)?, shape.name())?,
                (Some(_), None) => {
                    return Err(Error::invalid(
                        format!("{key}.material"),
                        "given",
                        "for a primitive; models have their own",
                    ));
                }
                _ => return Err(Error::invalid(key, "without one model", "one of model and primitive")),
            }
        }
        live.classify(&self.labels.las_class);
        let units = Units::new(&live);
        for (index, rule) in spec.variation.iter().enumerate() {
            let Some(target) = rule.target() else { continue };
            let ids: Vec<_> = units.ids(target).collect();
            // Objects that an earlier rule places do not exist yet.
            let placed = spec.variation[..index].iter().any(|rule| matches!(rule.what, What::Place(_)));
            if ids.is_empty() && !placed {
                let found = format!("{}, which matches nothing in the scene", target.shown());
                let names: Vec<&str> = units.names().collect();
                let near = target.object.as_deref().map(|name| ground::error::nearest(name, &names));
                let near = near.filter(|near| !near.is_empty()).unwrap_or_default();
                let shown =
                    if near.is_empty() { names.iter().take(8).map(|name| (*name).to_owned()).collect() } else { near };
                return Err(Error::invalid(format!("variation[{index}]"), found, shown.join(", ")));
            }
            ids.into_iter().try_for_each(|id| live.unfix(id))?;
        }
        if let Some([start, length]) = self.first_frame {
            live.set_time(start, length)?;
        }
        // Objects that no rule changes are built here, once for all samples.
        live.commit()?;
        Ok(Base { scene, live, units })
    }

    fn read(&self, spec: &SceneSpec, folder: &Path) -> Result<Scene> {
        let mut caches = spec.caches.clone();
        caches.values_mut().for_each(|cache| cache.file = folder.join(&cache.file));
        let options = LoadOptions::default()
            .up(spec.up)
            .scale(spec.scale)
            .labels(self.labels.clone())
            .texture_limit_mib(spec.texture_limit_mib)
            .animation(spec.animation.clone())
            .looped(spec.looped)
            .allow_outside_paths(spec.allow_outside_paths)
            .geometry(spec.geometry)
            .joints(spec.joints.clone())
            .model_paths(spec.model_paths.iter().map(|path| folder.join(path)).collect())
            .caches(caches)
            .materials(spec.materials.clone())
            .hide(spec.hide.clone());
        match (&spec.generate, &spec.blend, &spec.files[..]) {
            (Some(made), None, []) => made.scene(folder)?.load(&options),
            (None, Some(_), []) if spec.labels != LabelSource::None => {
                let allowed = "without: custom properties categoryID and partID in the file of Blender are its labels";
                Err(Error::invalid("scene.labels", "there beside blend", allowed))
            }
            (None, Some(file), []) => match &self.given {
                Some(scene) => Scene::clone(scene).with_options(&options),
                None => {
                    let found = format!("{}, which only Blender can read", shown::path(&folder.join(file)));
                    let allowed = "`echocast run`, which starts Blender, or the scene that Blender has read";
                    Err(Error::invalid("scene.blend", found, allowed))
                }
            },
            // All of it is placed.
            (None, None, []) if !spec.place.is_empty() => Ok(Scene::default()),
            (None, None, []) => Err(Error::invalid("scene", "no files", "files, generate, blend or place")),
            (None, None, files) => {
                let files: Vec<PathBuf> = files.iter().map(|file| folder.join(file)).collect();
                Scene::load_all(&files, &options)
            }
            _ => Err(Error::invalid("scene", "more than one of files, generate and blend", "one of them")),
        }
    }

    /// The sensor of `entry`, which is at `key` of the file.
    ///
    /// # Errors
    /// As [`Sensor::open`] and [`Sensor::set`].
    pub fn sensor(&self, entry: &SensorEntry, key: &str, folder: &Path) -> Result<Arc<Sensor>> {
        let name = format!("{}{}", entry.sensor, Value::Object(entry.set.clone()));
        if let Some(known) = lock(&self.sensors).get(&name) {
            return Ok(known.clone());
        }
        let mut sensor = match &entry.sensor {
            Value::String(name) => {
                let path = folder.join(name);
                // A file next to the scenario takes precedence over a preset.
                Sensor::open(if path.is_file() { &path } else { Path::new(name) })?
            }
            section @ Value::Object(_) => {
                Sensor::from_section(&Document::from_value(format!("{key}.sensor"), section.clone()), folder)?
            }
            other => {
                let allowed = "the name of a preset or file, or a section of keys";
                return Err(Error::invalid(format!("{key}.sensor"), other, allowed));
            }
        };
        for (path, value) in flat(&entry.set) {
            sensor.set(&path, &value.to_string())?;
        }
        let mut sensors = lock(&self.sensors);
        if sensors.len() == KEPT_SENSORS {
            sensors.clear();
        }
        Ok(sensors.entry(name).or_insert(Arc::new(sensor)).clone())
    }
}

/// Checks that each of `patterns` has hidden something in `scene`.
fn check_hidden(scene: &Scene, patterns: &[String]) -> Result<()> {
    for (index, pattern) in patterns.iter().enumerate() {
        if !scene.hidden.iter().any(|name| matches(pattern, name)) {
            let names = scene.objects.iter().map(|object| &object.name);
            let near = ground::error::nearest(pattern, names).join(", ");
            let found = format!("{:?}, which matches no object", shown::name(pattern));
            return Err(Error::invalid(format!("scene.hide[{index}]"), found, near));
        }
    }
    Ok(())
}

/// Nested sections flattened to key paths and their values.
fn flat(keys: &serde_json::Map<String, Value>) -> Vec<(String, &Value)> {
    let mut all = Vec::new();
    for (key, value) in keys {
        match value {
            Value::Object(inner) if !inner.is_empty() => {
                all.extend(flat(inner).into_iter().map(|(path, value)| (format!("{key}.{path}"), value)));
            }
            _ => all.push((key.clone(), value)),
        }
    }
    all
}
