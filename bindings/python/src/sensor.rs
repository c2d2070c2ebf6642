//! Sensors and environments.

use crate::argument::{self, class, one_of};
use crate::array::owned;
use crate::error::{BindingError, BindingResult};
use pyo3::exceptions::{PyKeyError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyMapping};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::sync::{PoisonError, RwLock};

/// An instrument: its beams and its errors.
///
/// `sensor`: the name of one of the `presets` (a part that no other has is enough: "VLP-16"), the path of a sensor
/// file, or its keys as a dict or YAML text. ArgumentError for an unknown name, with the nearest ones; FormatError for
/// wrong keys.
///
/// `sensor["noise.range_sigma_m"]` is the number at a key, by its path in the YAML; KeyError if there is none.
/// `sensor["noise.range_sigma_m"] = 0` sets a key to a number, text, list or dict, and None removes an optional one; on
/// a FormatError or ArgumentError, which states what is allowed, the sensor is unchanged. Sensors can be copied and
/// pickled, and threads may share them: a scan is made with the sensor as it was when the scan began.
///
/// >>> sensor = ec.Sensor("velodyne_vlp16")
/// >>> sensor["noise.range_sigma_m"] = 0
/// >>> sensor["noise.range_sigma_m"]
/// 0.0
/// >>> pattern = {"type": "pinhole", "resolution": [64, 48], "fov_deg": [60, 45]}
/// >>> ec.Sensor({"name": "own", "kind": "tof", "pattern": pattern})
/// <Sensor own: tof, 3072 beams>
#[pyclass(frozen, module = "echocast")]
pub struct Sensor(RwLock<echocast::Sensor>);

impl Sensor {
    /// A copy of it as it is now.
    pub fn now(&self) -> echocast::Sensor {
        self.0.read().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn of(sensor: echocast::Sensor) -> Sensor {
        Sensor(RwLock::new(sensor))
    }
}

/// Keys and values of Python as YAML, which includes JSON.
pub fn options_text(value: &Bound<'_, PyAny>) -> PyResult<String> {
    value.py().import("echocast._arrays")?.call_method1("text", (value,))?.extract()
}

/// What `value` would be in YAML as keys and values of Python.
fn dict<'py>(py: Python<'py>, value: &impl Serialize) -> BindingResult<Bound<'py, PyAny>> {
    let text = serde_json::to_string(value).map_err(|error| PyValueError::new_err(error.to_string()))?;
    Ok(py.import("json")?.call_method1("loads", (text,))?)
}

class! { Sensor, "a Sensor" }
class! { Environment, "an Environment" }

/// What a sensor, an environment or a scenario can be made from.
pub enum SpecSource<'py> {
    Keys(Bound<'py, PyMapping>),
    Text(String),
    Path(PathBuf),
}

one_of! { SpecSource<'py>: Keys | Text | Path; "a name, the path of a file, keys as a dict, or YAML text" }

impl SpecSource<'_> {
    /// The YAML: keys as JSON, or text that is not a name.
    pub fn yaml(&self) -> PyResult<Option<String>> {
        Ok(match self {
            SpecSource::Keys(keys) => Some(options_text(&keys.py().get_type::<PyDict>().call1((keys,))?)?),
            SpecSource::Text(text) if text.contains(['\n', ':', '{']) && !Path::new(text).exists() => {
                Some(text.clone())
            }
            _ => None,
        })
    }

    pub fn path(&self) -> &Path {
        match self {
            SpecSource::Text(text) => Path::new(text),
            SpecSource::Path(path) => path,
            SpecSource::Keys(_) => Path::new(""),
        }
    }
}

/// Whether `source`, from which a sensor, an environment or a scenario is made, is the path or name of a file, not its
/// contents.
#[pyfunction]
pub fn is_path(#[pyo3(from_py_with = argument::source)] source: SpecSource<'_>) -> PyResult<bool> {
    Ok(source.yaml()?.is_none())
}

#[pymethods]
impl Sensor {
    #[new]
    fn new(#[pyo3(from_py_with = argument::sensor)] sensor: SpecSource<'_>) -> BindingResult<Sensor> {
        Ok(Sensor::of(match sensor.yaml()? {
            Some(text) => echocast::Sensor::from_yaml(&text, "")?,
            None => echocast::Sensor::open(sensor.path())?,
        }))
    }

    /// Its name: that of a preset, or the key `name`.
    #[getter]
    fn name(&self) -> String {
        self.now().name().to_owned()
    }

    /// Its full name.
    #[getter]
    fn title(&self) -> String {
        self.now().title().to_owned()
    }

    /// "lidar", "tof", "sonar" or "radar".
    #[getter]
    fn kind(&self) -> String {
        self.now().kind().to_string()
    }

    /// Where its numbers come from: data sheets, papers.
    #[getter]
    fn source(&self) -> String {
        self.now().source().to_owned()
    }

    /// Number of beams of a scan.
    #[getter]
    fn beams(&self) -> usize {
        self.now().beams().len()
    }

    /// Time from scan to scan, s.
    #[getter]
    fn period(&self) -> f64 {
        self.now().beams().period
    }

    /// Where its beams point in a scan, along its axes: beams x 3, float32. A pattern that does not repeat has others
    /// in the scans that follow.
    ///
    /// >>> directions = ec.Sensor("velodyne_vlp16").directions
    /// >>> directions.shape[1], round(float(np.degrees(np.arcsin(directions[:, 2].max()))))
    /// (3, 15)
    #[getter]
    fn directions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let sensor = self.now();
        let beams = sensor.beams();
        let axes = [&beams.dir_x, &beams.dir_y, &beams.dir_z];
        let rows = (0..beams.len()).flat_map(|beam| axes.map(|axis| axis[beam])).collect();
        owned(py, rows, &[beams.len(), 3])
    }

    /// The largest range that it reports, m; infinite if it has no limit.
    ///
    /// >>> ec.Sensor("velodyne_vlp16").reach
    /// 100.0
    #[getter]
    fn reach(&self) -> f64 {
        self.now().parameter("range.max_m").map_or(f64::INFINITY, |found| found.value)
    }

    /// All its keys as a dict, from which the same sensor can be made.
    ///
    /// >>> ec.Sensor("velodyne_vlp16").to_dict()["noise"]["range_sigma_m"] > 0
    /// True
    fn to_dict<'py>(&self, py: Python<'py>) -> BindingResult<Bound<'py, PyAny>> {
        dict(py, self.now().spec())
    }

    /// All its keys as YAML, from which the same sensor can be made.
    ///
    /// >>> sensor = ec.Sensor("velodyne_vlp16")
    /// >>> ec.Sensor(sensor.to_yaml()).beams == sensor.beams
    /// True
    fn to_yaml(&self) -> BindingResult<String> {
        Ok(self.now().to_yaml()?)
    }

    /// The number at `key`.
    fn __getitem__(&self, #[pyo3(from_py_with = argument::key)] key: &str) -> BindingResult<f64> {
        match self.now().parameter(key) {
            Ok(found) => Ok(found.value),
            Err(error) => Err(PyKeyError::new_err(error.to_string()).into()),
        }
    }

    /// Sets `key`, as `--set KEY=VALUE` does.
    fn __setitem__(
        &self,
        #[pyo3(from_py_with = argument::key)] key: &str,
        value: &Bound<'_, PyAny>,
    ) -> BindingResult<()> {
        let mut changed = self.now();
        changed.set(key, &options_text(value)?)?;
        *self.0.write().unwrap_or_else(PoisonError::into_inner) = changed;
        Ok(())
    }

    fn __copy__(&self) -> Sensor {
        Sensor::of(self.now())
    }

    fn __deepcopy__(&self, _memo: &Bound<'_, PyAny>) -> Sensor {
        Sensor::of(self.now())
    }

    fn __reduce__(slf: &Bound<'_, Self>) -> BindingResult<(Py<PyAny>, (String,))> {
        Ok((slf.get_type().into_any().unbind(), (slf.get().to_yaml()?,)))
    }

    fn __repr__(&self) -> String {
        let sensor = self.now();
        format!("<Sensor {}: {}, {} beams>", sensor.name(), sensor.kind(), sensor.beams().len())
    }
}

/// Names of the sensors that come with echocast, with their full names.
///
/// >>> dict(ec.presets())["velodyne_vlp16"]
/// 'Velodyne VLP-16 Puck'
#[pyfunction]
pub fn presets() -> Vec<(String, String)> {
    echocast::Sensor::presets().into_iter().map(|preset| (preset.name.to_owned(), preset.title.to_owned())).collect()
}

/// The medium between sensor and surfaces: clear air, rain, fog, snow, dust; water for sonars.
///
/// `environment`: the keys of the section `environment` of a scenario, as a dict or YAML text, or the path of such a
/// file; None: clear air. FormatError and ArgumentError for wrong keys and values. Environments can be pickled.
///
/// >>> fog = ec.Environment({"fog": {"visibility_m": 20}})
/// >>> empty = ec.LiveScene()
/// >>> cloud = empty.scan("velodyne_vlp16", at=(0, 0, 0), environment=fog, fields="default,cause")
/// >>> set(cloud.cause.tolist())  # what comes back is fog
/// {4}
#[pyclass(frozen, module = "echocast")]
pub struct Environment(pub echocast::Environment);

#[pymethods]
impl Environment {
    #[new]
    #[pyo3(signature = (environment = None))]
    fn new(
        #[pyo3(from_py_with = argument::environment)] environment: Option<SpecSource<'_>>,
    ) -> BindingResult<Environment> {
        let Some(source) = environment else { return Ok(Environment(echocast::Environment::default())) };
        let made = match source.yaml()? {
            Some(text) => echocast::Environment::from_yaml(&text)?,
            None => echocast::Environment::load(source.path())?,
        };
        made.check()?;
        Ok(Environment(made))
    }

    /// All its keys as a dict, from which the same environment can be made.
    ///
    /// >>> ec.Environment({"fog": {"visibility_m": 20}}).to_dict()["fog"][0]["visibility_m"]
    /// 20.0
    fn to_dict<'py>(&self, py: Python<'py>) -> BindingResult<Bound<'py, PyAny>> {
        dict(py, &self.0)
    }

    /// All its keys as YAML, from which the same environment can be made.
    fn to_yaml(&self) -> BindingResult<String> {
        Ok(self.0.to_yaml()?)
    }

    fn __reduce__(slf: &Bound<'_, Self>) -> BindingResult<(Py<PyAny>, (String,))> {
        Ok((slf.get_type().into_any().unbind(), (slf.get().to_yaml()?,)))
    }

    fn __repr__(&self) -> String {
        let text = self.0.to_yaml().unwrap_or_default();
        format!("<Environment {}>", text.trim_end())
    }
}

/// An environment, or what one can be made from.
pub enum EnvironmentLike<'py> {
    Made(Bound<'py, Environment>),
    Source(SpecSource<'py>),
}

one_of! { EnvironmentLike<'py>: Made | Source; "an Environment, the path of a file, keys as a dict, or YAML text" }

impl EnvironmentLike<'_> {
    pub fn environment(self) -> BindingResult<echocast::Environment> {
        match self {
            EnvironmentLike::Made(made) => Ok(made.get().0.clone()),
            EnvironmentLike::Source(source) => Ok(Environment::new(Some(source))?.0),
        }
    }
}

/// A sensor, or what one can be made from.
pub enum Instrument<'py> {
    Made(Bound<'py, Sensor>),
    Source(SpecSource<'py>),
}

one_of! {
    Instrument<'py>: Made | Source;
    "a Sensor, the name of a preset, the path of a file, keys as a dict, or YAML text"
}

impl Instrument<'_> {
    pub fn sensor(self) -> BindingResult<echocast::Sensor> {
        match self {
            Instrument::Made(made) => Ok(made.get().now()),
            Instrument::Source(source) => Ok(Sensor::new(source)?.now()),
        }
    }
}

/// The value called `name` of a type with named values.
pub fn named<T: echocast::Named>(argument: &str, name: &str) -> BindingResult<T> {
    let found = T::NAMES.iter().find(|(known, _)| *known == name).map(|(_, value)| *value);
    let all = || T::NAMES.iter().map(|(known, _)| *known).collect::<Vec<_>>().join(", ");
    found.ok_or_else(|| BindingError::argument(argument, format!("{name:?}"), all()))
}
