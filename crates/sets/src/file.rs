//! A scenario: its file, and the samples that it makes.

use super::Sample;
use super::draw::Draws;
use super::shared::lock;
use super::spec::Spec;
use super::stage::Stage;
use super::variation::{self, What};
use engine::scene::Scene;
use engine::trace::Engine;
use ground::error::{Error, Result};
use ground::read::yaml::{self, Document};
use ground::{shown, write};
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::mem;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

/// A scenario file, read and checked. Its samples are made one by one, in any order, on any thread; sample 17 is the
/// same whether it is made alone or with others.
#[derive(Debug)]
pub struct Scenario {
    /// Where it comes from, for messages.
    pub(super) origin: String,
    /// Whether that is a file.
    file: bool,
    /// Base folder of relative file names.
    folder: PathBuf,
    /// Contents of the file as written.
    pub(super) value: Value,
    pub(super) spec: Arc<Spec>,
    engine: Option<Engine>,
    /// The scene that Blender has read.
    scene: Option<Arc<Scene>>,
    /// Made with the first sample.
    stage: Mutex<Option<Arc<Stage>>>,
}

impl Clone for Scenario {
    /// A copy that shares the scene already loaded.
    fn clone(&self) -> Self {
        let Scenario { origin, file, folder, value, spec, engine, scene, stage } = self;
        Scenario {
            origin: origin.clone(),
            file: *file,
            folder: folder.clone(),
            value: value.clone(),
            spec: spec.clone(),
            engine: engine.clone(),
            scene: scene.clone(),
            stage: Mutex::new(lock(stage).clone()),
        }
    }
}

impl Scenario {
    /// Reads a scenario file, or the report of `echocast scan --json`.
    ///
    /// # Errors
    /// A missing file; an invalid entry, with its line, its key and the most similar known key.
    pub fn load(path: impl AsRef<Path>) -> Result<Scenario> {
        let path = path.as_ref();
        let folder = path.parent().unwrap_or(Path::new(""));
        Ok(Scenario { file: true, ..Scenario::read(&Document::load(path)?, &shown::path(path), folder)? })
    }

    /// [`Scenario::load`] from the text of a file; file names in it are relative to `folder`.
    ///
    /// # Errors
    /// As [`Scenario::load`].
    pub fn from_yaml(text: &str, folder: impl AsRef<Path>) -> Result<Scenario> {
        const ORIGIN: &str = "YAML text";
        Scenario::read(&Document::parse(ORIGIN, text)?, ORIGIN, folder.as_ref())
    }

    fn read(document: &Document, origin: &str, folder: &Path) -> Result<Scenario> {
        // The report of a scan contains the scenario that reproduces it.
        let reported = document.value().get("run").filter(|_| document.value().get("version").is_some());
        if let Some(run) = reported {
            return Scenario::read(&Document::from_value(format!("{origin}: run"), run.clone()), origin, folder);
        }
        let mut spec = Spec::read(document)?;
        spec.scene.materials.check(document, "scene.materials")?;
        let folder = spec.folder.as_ref().map_or(folder.to_owned(), |own| folder.join(own));
        spec.read_files(&folder).map_err(|error| document.locate(error))?;
        variation::number_grids(&mut spec.variation);
        for (index, rule) in spec.variation.iter_mut().enumerate() {
            if let What::Set(rule) = &mut rule.what {
                // The key must be one that the file may contain.
                let mut value = document.value().clone();
                if yaml::put(&mut value, &rule.set, Value::Null, &[]).is_err() {
                    let message = format!("set: this file cannot contain {:?}", rule.set);
                    return Err(document.error(&format!("variation[{index}].set"), &message));
                }
                rule.whole = takes_whole_numbers(document, &rule.set);
            }
        }
        Ok(Scenario {
            origin: origin.to_owned(),
            file: false,
            folder,
            value: document.value().clone(),
            spec: Arc::new(spec),
            engine: None,
            scene: None,
            stage: Mutex::default(),
        })
    }

    /// Changes one key of the file: `key` is its path (`frames.last`, `sensors[0].mount.position_m[2]`,
    /// `sensors.top.rate_hz`), `value` is YAML.
    ///
    /// # Errors
    /// As [`Scenario::load`]; the scenario is then unchanged.
    pub fn set(&mut self, key: &str, value: &str) -> Result<()> {
        let mut tree = self.value.clone();
        yaml::set(&mut tree, key, value, &[])?;
        // The folder is resolved already.
        tree.as_object_mut().map(|keys| keys.shift_remove("folder"));
        let changed =
            Scenario::read(&Document::from_value(yaml::assignment(key, value), tree), &self.origin, &self.folder)?;
        // Random draws depend on the seed; what samples start from contains none.
        let stage = if key == "seed" { mem::take(&mut self.stage) } else { Mutex::default() };
        let (engine, scene) = (self.engine.clone(), self.scene.clone());
        *self = Scenario { engine, scene, file: self.file, stage, ..changed };
        Ok(())
    }

    /// The same scenario, built and scanned by `engine`. With a single-threaded engine, any number of threads can make
    /// samples in parallel.
    #[must_use]
    pub fn with_engine(self, engine: &Engine) -> Scenario {
        Scenario { engine: Some(engine.clone()), stage: Mutex::default(), ..self }
    }

    /// The same scenario with `scene` as what Blender has read from [`Scenario::blend`].
    #[must_use]
    pub fn with_scene(self, scene: Scene) -> Scenario {
        Scenario { scene: Some(Arc::new(scene)), stage: Mutex::default(), ..self }
    }

    /// The file of Blender that is its scene, if it has one.
    pub fn blend(&self) -> Option<PathBuf> {
        self.spec.scene.blend.as_ref().map(|file| self.folder.join(file))
    }

    /// Number of samples.
    pub fn samples(&self) -> u64 {
        self.spec.samples
    }

    /// The file as a tree of values.
    pub fn value(&self) -> &Value {
        &self.value
    }

    /// The file as readable YAML.
    ///
    /// # Errors
    /// None but those of a defect.
    pub fn to_yaml(&self) -> Result<String> {
        yaml::to_string(&self.value)
    }

    /// Writes it as the file at `path`; names of files in it still count from [`Scenario::folder`].
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn save(&self, path: impl AsRef<Path>) -> Result<()> {
        let path = path.as_ref();
        let whole = |folder: &Path| {
            let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
            folder.canonicalize().map_err(|source| Error::Io { path: folder.to_owned(), source })
        };
        let (to, own) = (whole(path.parent().unwrap_or(Path::new("")))?, whole(&self.folder)?);
        let mut value = self.value.clone();
        if let Some(keys) = value.as_object_mut() {
            keys.shift_remove("folder");
            if to != own {
                keys.shift_insert(0, "folder".into(), shown::path(&own).into());
            }
        }
        write::whole(path, yaml::to_string(&value)?.as_bytes())
    }

    /// Makes sample `index`: draws what varies, and sets up its scene and scans.
    ///
    /// # Errors
    /// A file that cannot be read; a drawn value that a key does not allow; no room for an object that must be placed.
    /// An index beyond [`Scenario::samples`] is allowed, up to 4,294,967,295.
    pub fn sample(&self, index: u64) -> Result<Sample> {
        let number = u32::try_from(index).map_err(|_| Error::invalid("sample", index, "0 to 4294967295"))?;
        let stage = self.stage()?;
        let draws = Draws::new(self.spec.seed, number);
        let (spec, value, set) = self.varied(&draws, index)?;
        stage.engine.install(|| Sample::new(&stage, &spec, &value, &self.folder, &draws, set))
    }

    /// Base folder of the relative file names in it.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The first entry of this style in its section `outputs`, if there is one.
    ///
    /// # Errors
    /// An invalid entry, with its key and the most similar known key.
    pub fn output_of<T: DeserializeOwned>(&self, style: &str) -> Result<Option<T>> {
        let is_of = |output: &Value| output.get("style").and_then(Value::as_str) == Some(style);
        let Some(index) = self.spec.outputs.iter().position(is_of) else { return Ok(None) };
        let document = Document::from_value(&self.origin, self.value.clone());
        document.read_at(&format!("outputs[{index}]"), &self.spec.outputs[index]).map(Some)
    }

    /// Folder of its set: the specified one, or one named after the file; `None` for a scenario that is not from a file
    /// and specifies none.
    pub fn set_folder(&self) -> Option<PathBuf> {
        let of_file = || Path::new(&self.origin).file_stem().filter(|_| self.file).map(Path::new);
        Some(self.folder.join(self.spec.set.folder.as_deref().or_else(of_file)?))
    }

    pub(super) fn stage(&self) -> Result<Arc<Stage>> {
        let mut stage = lock(&self.stage);
        if let Some(stage) = &*stage {
            return Ok(stage.clone());
        }
        let engine = self.engine.clone().map_or_else(Engine::new, Ok)?;
        Ok(stage.insert(Arc::new(Stage::new(&self.spec, &self.folder, engine, self.scene.clone())?)).clone())
    }

    /// The specification of a sample after all rules that set keys, the same as a tree of values, and what was drawn.
    fn varied(&self, draws: &Draws, index: u64) -> Result<(Arc<Spec>, Value, Vec<Value>)> {
        let mut value = self.value.clone();
        let mut drawn = Vec::new();
        for rule in &self.spec.variation {
            let What::Set(set) = &rule.what else { continue };
            let address = draws.of(&rule.name).of("to");
            let whole = set.whole && set.to.is_number();
            let new = if whole { set.to.whole(&address).into() } else { set.to.draw(&address) };
            drawn.push(serde_json::json!({"rule": rule.name, "key": set.set, "value": new}));
            yaml::put(&mut value, &set.set, new, &[])
                .map_err(|fault| Error::invalid(&rule.name, fault, "a key of this file"))?;
        }
        if drawn.is_empty() {
            return Ok((self.spec.clone(), value, drawn));
        }
        // Rules stay as they are, with their grids.
        let rules = value.as_object_mut().and_then(|keys| keys.shift_remove("variation"));
        let document = Document::from_value(format!("{}, sample {index}", self.origin), value);
        let mut spec = Spec::read(&document)?;
        spec.read_files(&self.folder).map_err(|error| document.locate(error))?;
        spec.variation.clone_from(&self.spec.variation);
        let mut value = document.value().clone();
        if let (Some(keys), Some(rules)) = (value.as_object_mut(), rules) {
            keys.insert("variation".into(), rules);
        }
        Ok((Arc::new(spec), value, drawn))
    }
}

/// Whether the key at `path` of a scenario takes whole numbers.
fn takes_whole_numbers(document: &Document, path: &str) -> bool {
    let takes = |number: Value| {
        let mut value = document.value().clone();
        yaml::put(&mut value, path, number, &[]).is_ok() && Document::from_value("", value).read::<Spec>().is_ok()
    };
    takes(1.into()) && !takes(0.5.into())
}
