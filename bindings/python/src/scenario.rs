//! Scenarios, their samples, and sets.

use crate::argument::{self, class, one_of};
use crate::cloud::PointCloud;
use crate::error::{BindingError, BindingResult, no_pickle};
use crate::options::{ProgressListener, warn};
use crate::scene::Scene;
use crate::sensor::{SpecSource, options_text};
use crate::sequence;
use echocast::Engine;
use echocast::scenario::set::{self, Event, RunOptions};
use pyo3::prelude::*;
use pyo3::sync::{MutexExt, RwLockExt};
use pyo3::types::PyDict;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard, PoisonError, RwLock, RwLockReadGuard};

/// The definition of a run: scenes, rigs, trajectories, weather, and what varies from sample to sample.
///
/// `scenario`: the path of a file, or its keys as a dict or YAML text, with file names relative to `folder`, which is
/// allowed only for these; or a Scenario, of which it is a copy. `threads`: number of threads that build and scan;
/// None: all cores, or those of the Scenario that is copied. `scene`: a Scene that was made from the file that its key
/// `scene.blend` names, as only Blender reads such files; such a Scenario cannot be pickled. NotFoundError for a missing file, FormatError and
/// ArgumentError for wrong keys, with the nearest ones. `len(scenario)` is its number of samples, `scenario[i]` makes
/// one, always the same one, from the end if i is negative; IndexError for others. Scenarios can be pickled, also with
/// files relative to the working folder, and use the threads of the process that unpickles them.
///
/// >>> scenario = ec.Scenario({
/// ...     "scene": {"generate": {"indoor": {"rooms": [1, 1]}}},
/// ...     "sensors": [{"name": "top", "sensor": "velodyne_vlp16"}],
/// ...     "trajectory": {"camera": "Scanner"},
/// ...     "variation": [{"set": "environment.fog.visibility_m", "to": {"uniform": [10, 50]}}],
/// ...     "samples": 3,
/// ... })
/// >>> len(scenario), scenario[2].sensors
/// (3, ['top'])
/// >>> cloud = scenario[2].cloud()
#[pyclass(frozen, sequence, module = "echocast")]
pub struct Scenario(RwLock<echocast::Scenario>);

impl Scenario {
    fn now(&self, py: Python<'_>) -> RwLockReadGuard<'_, echocast::Scenario> {
        self.0.read_py_attached(py).unwrap_or_else(PoisonError::into_inner)
    }
}

class! { Scenario, "a Scenario" }

/// A scenario, or what one can be made from.
pub enum ScenarioLike<'py> {
    Made(Bound<'py, Scenario>),
    Source(SpecSource<'py>),
}

one_of! { ScenarioLike<'py>: Made | Source; "a Scenario, the path of a file, keys as a dict, or YAML text" }

impl ScenarioLike<'_> {
    /// The scenario; "" is no folder.
    fn scenario(self, py: Python<'_>, folder: PathBuf) -> BindingResult<echocast::Scenario> {
        let made = match self {
            ScenarioLike::Made(made) => made.get().now(py).clone(),
            ScenarioLike::Source(source) => match source.yaml()? {
                Some(text) => return Ok(echocast::Scenario::from_yaml(&text, folder)?),
                None => echocast::Scenario::load(source.path())?,
            },
        };
        if folder.as_os_str().is_empty() {
            return Ok(made);
        }
        Err(BindingError::argument("folder", folder.display(), "none for a file or a Scenario, which has one"))
    }
}

#[pymethods]
impl Scenario {
    #[new]
    #[pyo3(
        signature = (scenario, *, folder = PathBuf::new(), threads = None, scene = None),
        text_signature = "(scenario, *, folder='', threads=None, scene=None)"
    )]
    fn new(
        py: Python<'_>,
        #[pyo3(from_py_with = argument::scenario)] scenario: ScenarioLike<'_>,
        #[pyo3(from_py_with = argument::folder)] folder: PathBuf,
        #[pyo3(from_py_with = argument::threads)] threads: Option<usize>,
        #[pyo3(from_py_with = argument::scene)] scene: Option<Bound<'_, Scene>>,
    ) -> BindingResult<Scenario> {
        let made = scenario.scenario(py, folder)?;
        let made = match scene {
            Some(scene) if made.blend().is_none() => {
                let allowed = "there only if the key scene.blend is";
                return Err(BindingError::argument("scene", scene.repr()?, allowed));
            }
            Some(scene) => made.with_scene(scene.get().scene.clone()),
            None => made,
        };
        let made = match threads {
            Some(threads) => made.with_engine(&Engine::with_threads(threads)?),
            None => made,
        };
        Ok(Scenario(RwLock::new(made)))
    }

    /// Sets a key by its path, as `--set KEY=VALUE` does: `scenario.set("samples", 20)`. FormatError and ArgumentError
    /// for unknown keys and wrong values; the scenario is then unchanged.
    fn set(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = argument::key)] key: &str,
        value: &Bound<'_, PyAny>,
    ) -> BindingResult<()> {
        let text = options_text(value)?;
        Ok(self.0.write_py_attached(py).unwrap_or_else(PoisonError::into_inner).set(key, &text)?)
    }

    /// All its keys as YAML, as they are now, from which the same scenario can be made in the same `folder`.
    ///
    /// >>> scenario = ec.Scenario({"scene": {"files": "tent.obj"}, "samples": 3}, folder="scenes")
    /// >>> len(ec.Scenario(scenario.to_yaml(), folder=scenario.folder))
    /// 3
    fn to_yaml(&self, py: Python<'_>) -> String {
        text(&self.now(py))
    }

    /// The folder that file names in it are relative to.
    #[getter]
    fn folder(&self, py: Python<'_>) -> PathBuf {
        self.now(py).folder().to_owned()
    }

    /// Seed of all random draws, 0 to 2^64 - 1.
    #[getter]
    fn seed(&self, py: Python<'_>) -> u64 {
        self.now(py).value().get("seed").and_then(Value::as_u64).unwrap_or_default()
    }

    fn __len__(&self, py: Python<'_>) -> usize {
        usize::try_from(self.now(py).samples()).unwrap_or(usize::MAX)
    }

    /// Makes sample `index`, always the same one.
    fn __getitem__(&self, py: Python<'_>, index: isize) -> BindingResult<Sample> {
        let number = sequence::place("sample", index, self.__len__(py))? as u64;
        let sample = py.detach(|| self.0.read().unwrap_or_else(PoisonError::into_inner).sample(number))?;
        Ok(Sample { number, sample: Mutex::new(sample) })
    }

    fn __iter__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        sequence::iterate(slf)
    }

    /// What other processes make the same scenario from, in any working folder, with threads of their own.
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> BindingResult<(Bound<'py, PyAny>, (String,))> {
        let py = slf.py();
        if slf.get().now(py).blend().is_some() {
            let instead = "let each process make it with the scene that Blender has read";
            return Ok(no_pickle("a Scenario with a file of Blender", instead)?);
        }
        let here = std::env::current_dir().map_err(PyErr::from)?;
        let mut made = slf.get().now(py).clone();
        // The folder of the set may be named after the file of the scenario, which the text does not include.
        if let Some(folder) = made.set_folder() {
            made.set("set.folder", &Value::from(here.join(folder).to_string_lossy()).to_string())?;
        }
        let keywords = PyDict::new(py);
        keywords.set_item("folder", here.join(made.folder()))?;
        let partial = py.import("functools")?.getattr("partial")?;
        Ok((partial.call((slf.get_type(),), Some(&keywords))?, (text(&made),)))
    }

    fn __repr__(&self, py: Python<'_>) -> String {
        format!("<Scenario: {} samples>", self.__len__(py))
    }
}

/// The keys of `scenario`, as JSON, which is also YAML and keeps every number exactly.
fn text(scenario: &echocast::Scenario) -> String {
    let mut keys = scenario.value().clone();
    // File names are relative to the folder of the scenario, which includes this key already.
    keys.as_object_mut().map(|keys| keys.shift_remove("folder"));
    format!("{keys:#}")
}

/// A sample of a scenario: the values drawn for it, and its scans. `scenario[i]` makes it.
///
/// >>> scenario = ec.Scenario({
/// ...     "scene": {"generate": {"indoor": {"rooms": [1, 1]}}},
/// ...     "sensors": [{"sensor": "velodyne_vlp16"}],
/// ...     "trajectory": {"camera": "Scanner"},
/// ...     "frames": {"first": 0, "last": 1, "fps": 10},
/// ... })
/// >>> sample = scenario[0]
/// >>> sample.number, sample.sensors, sample.frames()
/// (0, ['velodyne_vlp16'], [(0, 0.0), (1, 0.1)])
/// >>> len(sample.cloud(0, frame=1)) > 1000
/// True
#[pyclass(frozen, module = "echocast")]
pub struct Sample {
    /// Its number.
    #[pyo3(get)]
    number: u64,
    sample: Mutex<echocast::scenario::Sample>,
}

impl Sample {
    fn lock(&self, py: Python<'_>) -> MutexGuard<'_, echocast::scenario::Sample> {
        self.sample.lock_py_attached(py).unwrap_or_else(PoisonError::into_inner)
    }
}

#[pymethods]
impl Sample {
    /// Names of its sensors.
    #[getter]
    fn sensors(&self, py: Python<'_>) -> Vec<String> {
        self.lock(py).scans().iter().map(|scan| scan.name().to_owned()).collect()
    }

    /// Numbers and times, s, of the frames of a sensor, given by its index in `sensors`.
    #[pyo3(signature = (sensor = 0))]
    fn frames(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = argument::sensor)] sensor: usize,
    ) -> BindingResult<Vec<(u32, f64)>> {
        self.check(py, sensor, 0)?;
        Ok(self.lock(py).scans()[sensor].frames().iter().map(|frame| (frame.number, frame.start)).collect())
    }

    /// The cloud of a sensor, given by its index in `sensors`, in its `frame`th frame, counted from 0; ArgumentError
    /// for others.
    #[pyo3(signature = (sensor = 0, frame = 0))]
    fn cloud(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = argument::sensor)] sensor: usize,
        #[pyo3(from_py_with = argument::frame)] frame: usize,
    ) -> BindingResult<PointCloud> {
        self.check(py, sensor, frame)?;
        let cloud = || self.sample.lock().unwrap_or_else(PoisonError::into_inner).cloud(sensor, frame);
        Ok(PointCloud::of(py.detach(cloud)?))
    }

    /// The values drawn for it, in the order of the rules: enough to repeat it or to select by.
    #[getter]
    fn drawn<'py>(&self, py: Python<'py>) -> BindingResult<Bound<'py, PyAny>> {
        let text = serde_json::to_string(self.lock(py).drawn()).unwrap_or_default();
        Ok(py.import("json")?.call_method1("loads", (text,))?)
    }

    /// Warnings from when it was made, a sentence each: objects for which there was no room, those of the reader of the
    /// scene.
    #[getter]
    fn warnings(&self, py: Python<'_>) -> Vec<String> {
        self.lock(py).report().warnings.clone()
    }

    fn __reduce__(&self) -> PyResult<()> {
        no_pickle("a Sample", "its Scenario can, and makes the same sample again")
    }

    fn __repr__(&self, py: Python<'_>) -> String {
        format!("<Sample {}: {}>", self.number, self.sensors(py).join(", "))
    }
}

impl Sample {
    fn check(&self, py: Python<'_>, sensor: usize, frame: usize) -> BindingResult<()> {
        let sample = self.lock(py);
        let Some(scan) = sample.scans().get(sensor) else {
            let allowed = format!("below {}", sample.scans().len());
            return Err(BindingError::argument("sensor", sensor, allowed));
        };
        let frames = scan.frames().len();
        if frame >= frames.max(1) {
            return Err(BindingError::argument("frame", frame, format!("below {frames}")));
        }
        Ok(())
    }
}

/// Makes samples of a scenario and writes them as its `outputs` specify, as `echocast run` does.
///
/// `scenario`: a Scenario, or what `Scenario` takes. `folder`: that of the set; None: as the scenario defines.
/// `samples`: (first, last) or (first, last, step), None: all. `shard`: (part, parts), to make only one part, counted
/// from 0; `finish` completes a set of shards. `resume`: True continues an existing set, which is otherwise an
/// ArgumentError. `threads`: None: all cores. `progress`: called with the number of samples done and their total; if it
/// returns False, samples under way are completed and a CancelledError follows. True shows a bar.
///
/// Returns a dict: `folder`; `made` and `found`, numbers of samples; `failed`, number and error of each; `points`;
/// `seconds`; `warnings`, one of each kind, with how many samples have it; `complete`, whether the set is.
///
/// >>> keys = {
/// ...     "scene": {"generate": {"indoor": {"rooms": [1, 1]}}},
/// ...     "sensors": [{"name": "top", "sensor": "velodyne_vlp16"}],
/// ...     "trajectory": {"camera": "Scanner"},
/// ...     "samples": 2,
/// ...     "outputs": [{"style": "plain", "format": "las"}],
/// ... }
/// >>> done = ec.run(ec.Scenario(keys), "set")
/// >>> done["made"], done["complete"]
/// (2, True)
/// >>> len(ec.PointCloud.read("set/data/000001/top.las")) > 1000
/// True
#[pyfunction]
#[pyo3(signature = (scenario, folder = None, *, samples = None, shard = None, resume = false, threads = None, progress = None))]
#[allow(clippy::too_many_arguments)]
pub fn run<'py>(
    py: Python<'py>,
    #[pyo3(from_py_with = argument::scenario)] scenario: ScenarioLike<'py>,
    #[pyo3(from_py_with = argument::folder)] folder: Option<PathBuf>,
    #[pyo3(from_py_with = argument::samples)] samples: Option<Vec<u64>>,
    #[pyo3(from_py_with = argument::shard)] shard: Option<Vec<u64>>,
    #[pyo3(from_py_with = argument::resume)] resume: bool,
    #[pyo3(from_py_with = argument::threads)] threads: Option<usize>,
    progress: Option<Bound<'py, PyAny>>,
) -> BindingResult<Bound<'py, PyDict>> {
    let samples = match samples.as_deref() {
        None => None,
        Some(&[first, last]) => Some([first, last, 1]),
        Some(&[first, last, step]) => Some([first, last, step]),
        Some(other) => {
            return Err(BindingError::argument(
                "samples",
                format!("{} numbers", other.len()),
                "first and last, and a step",
            ));
        }
    };
    let shard = match shard.as_deref() {
        None => None,
        Some(&[part, parts]) => Some([part, parts]),
        Some(other) => {
            return Err(BindingError::argument("shard", format!("{} numbers", other.len()), "part and parts"));
        }
    };
    let options =
        RunOptions::default().folder(folder).samples(samples).shard(shard).resume(resume).threads(threads.unwrap_or(0));
    let scenario = scenario.scenario(py, PathBuf::new())?;
    let progress = progress
        .map_or_else(|| Ok(ProgressListener::default()), |progress| ProgressListener::of(&progress, "samples"))?;
    let (stopped, done) = (Mutex::new(None::<PyErr>), Mutex::new((0, 0)));
    let watch = |event: Event| {
        let counts = {
            let mut done = done.lock().unwrap_or_else(PoisonError::into_inner);
            match event {
                Event::Begins(all) => *done = (0, all),
                Event::Made(_) | Event::Found(_) => done.0 += 1,
                _ => {}
            }
            *done
        };
        let reported = Python::attach(|py| progress.notify(py, counts));
        if let Err(error) =
            reported.and_then(|go| if go { Ok(()) } else { Err(BindingError::from(echocast::Error::Cancelled).into()) })
        {
            // Samples under way are completed; then the run ends.
            stopped.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
            echocast::export::cancel_flag().store(true, std::sync::atomic::Ordering::SeqCst);
        }
    };
    let result = py.detach(|| set::run(scenario, &options, &watch));
    progress.close(py)?;
    if let Some(error) = stopped.into_inner().unwrap_or_else(PoisonError::into_inner) {
        echocast::export::cancel_flag().store(false, std::sync::atomic::Ordering::SeqCst);
        return Err(error.into());
    }
    let summary = result?;
    let reported = PyDict::new(py);
    reported.set_item("folder", summary.folder)?;
    reported.set_item("made", summary.made)?;
    reported.set_item("found", summary.found)?;
    reported.set_item("failed", summary.failed)?;
    reported.set_item("points", summary.points)?;
    reported.set_item("seconds", summary.seconds)?;
    let warnings: BTreeMap<_, _> = summary.warnings.into_iter().map(|seen| (seen.warning, seen.samples)).collect();
    reported.set_item("warnings", warnings)?;
    reported.set_item("complete", summary.complete)?;
    Ok(reported)
}

/// Completes the set in `folder`, whose shards are all made: tables, manifest and report, as `echocast run --finish`
/// does. `check`: first verifies that all files are as they were written; False skips that, for sets whose files are
/// kept elsewhere, except those that tables or archives are made from.
///
/// >>> keys = {
/// ...     "scene": {"generate": {"indoor": {"rooms": [1, 1]}}},
/// ...     "sensors": [{"sensor": "velodyne_vlp16"}],
/// ...     "trajectory": {"camera": "Scanner"},
/// ...     "samples": 2,
/// ... }
/// >>> for part in (0, 1):  # each on a machine of its own
/// ...     done = ec.run(ec.Scenario(keys), "set", shard=(part, 2))
/// >>> ec.finish("set")
/// >>> import pathlib
/// >>> pathlib.Path("set/report.html").exists()
/// True
#[pyfunction]
#[pyo3(signature = (folder, *, check = true))]
pub fn finish(
    py: Python<'_>,
    #[pyo3(from_py_with = argument::folder)] folder: PathBuf,
    #[pyo3(from_py_with = argument::check)] check: bool,
) -> BindingResult<()> {
    let report = py.detach(|| if check { set::finish(&folder) } else { set::complete(&folder) })?;
    report.warnings.iter().try_for_each(|reported| warn(py, reported))?;
    Ok(())
}
