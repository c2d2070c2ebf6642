//! Options of scans: the keyword arguments of every method that scans.

use crate::argument::{Argument, one_of, wrong_type};
use crate::error::{BindingError, BindingResult};
use crate::place;
use crate::sensor::{EnvironmentLike, Instrument, named};
use echocast::{BoxAxes, FieldSet, ScanOptions, Sensor, Trajectory};
use pyo3::exceptions::{PyTypeError, PyUserWarning};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::ffi::CString;
use std::ops::ControlFlow;
use std::sync::Arc;

/// Names of the arguments.
fn names() -> impl Iterator<Item = &'static str> {
    ["at"].into_iter().chain(ScanOptions::OPTIONS.iter().map(|option| option.name)).chain(["progress"])
}

/// The arguments of a method that scans.
pub struct ScanRequest {
    pub sensor: Sensor,
    /// Where the sensor is.
    pub path: Trajectory,
    pub options: ScanOptions,
    progress: ProgressListener,
}

/// Columns: names in a list, or separated by commas.
pub enum ColumnNames {
    Text(String),
    List(Vec<String>),
}

/// Whether boxes are requested, and along which axes.
enum BoxRequest {
    Enabled(bool),
    Axes(String),
}

one_of! { BoxRequest: Enabled | Axes; "True, False, object or frame" }

one_of! { ColumnNames: Text | List; "names of columns in a list, or in a text with commas" }

impl ColumnNames {
    pub fn names(self) -> Vec<String> {
        match self {
            ColumnNames::Text(text) => text.split(',').map(|name| name.trim().to_owned()).collect(),
            ColumnNames::List(names) => names,
        }
    }
}

impl ScanRequest {
    /// Converts `keywords`. Without `at` the sensor is at 0, 0, 0, with a warning that suggests one of the scene's
    /// `cameras`.
    pub fn of(
        py: Python<'_>,
        sensor: Instrument<'_>,
        keywords: Option<&Bound<'_, PyDict>>,
        cameras: impl FnOnce() -> Vec<String>,
    ) -> BindingResult<ScanRequest> {
        let sensor = sensor.sensor()?;
        let mut options = ScanOptions::default().fields(sensor.default_fields());
        let (mut path, mut progress) = (None, ProgressListener::default());
        for (key, value) in keywords.into_iter().flatten() {
            let key: String = key.extract()?;
            known(&key)?;
            let key = key.as_str();
            let text = || <&str>::of(key, &value);
            match key {
                // None means the default.
                _ if value.is_none() => {}
                "at" => path = Some(place::path(key, &value)?),
                "fields" => {
                    let list = ColumnNames::of(key, &value)?.names().join(",");
                    options.fields = FieldSet::parse_with(&list, sensor.default_fields())?;
                }
                "seed" => options.seed = Argument::of(key, &value)?,
                "frame" => options.frame = Argument::of(key, &value)?,
                "strip" => options.strip = Argument::of(key, &value)?,
                "start_time" => options.start_time = Argument::of(key, &value)?,
                "trajectory_time" => options.trajectory_time = Argument::of(key, &value)?,
                "clock_offset" => options.clock_offset = Argument::of(key, &value)?,
                "estimated_trajectory" => options.estimated_trajectory = Some(Arc::new(place::path(key, &value)?)),
                "freeze" => options.freeze = Argument::of(key, &value)?,
                "frame_period" => options.frame_period = Argument::of(key, &value)?,
                "organised" => options.organised = Argument::of(key, &value)?,
                "coordinates" => options.coordinates = named(key, text()?)?,
                "order" => options.order = named(key, text()?)?,
                "boxes" => {
                    options.boxes = match BoxRequest::of(key, &value)? {
                        BoxRequest::Enabled(enabled) => enabled.then_some(BoxAxes::default()),
                        BoxRequest::Axes(name) => Some(named(key, &name)?),
                    }
                }
                "box_time" => options.box_time = named(key, text()?)?,
                "deskew" => options.deskew = Argument::of(key, &value)?,
                "image_boxes" => options.image_boxes = Argument::of(key, &value)?,
                "profile" => options.profile = named(key, text()?)?,
                "reflectance_source" => options.reflectance_source = Some(named(key, text()?)?),
                "mask" => options.mask = Argument::of(key, &value)?,
                "time_budget" => options.time_budget = Some(Argument::of(key, &value)?),
                "specular_depth" => options.specular_depth = Argument::of(key, &value)?,
                "environment" => options.environment = EnvironmentLike::of(key, &value)?.environment()?,
                "progress" => progress = ProgressListener::of(&value, "scan")?,
                _ => {}
            }
        }
        let path = path.map_or_else(|| nowhere(py, cameras), Ok)?;
        Ok(ScanRequest { sensor, path, options, progress })
    }

    /// Does `work` detached from the interpreter, to which it reports its progress.
    pub fn run<T: Send>(
        &self,
        py: Python<'_>,
        work: impl Send + FnOnce(&mut dyn FnMut(f64) -> ControlFlow<()>) -> echocast::Result<T>,
    ) -> BindingResult<T> {
        let mut stopped: Option<PyErr> = None;
        let done = py.detach(|| {
            work(&mut |fraction| match Python::attach(|py| self.progress.notify(py, (fraction,))) {
                Ok(true) => ControlFlow::Continue(()),
                Ok(false) => ControlFlow::Break(()),
                Err(error) => {
                    stopped = Some(error);
                    ControlFlow::Break(())
                }
            })
        });
        self.progress.close(py)?;
        match stopped {
            Some(error) => Err(BindingError::Python(error)),
            None => Ok(done?),
        }
    }
}

/// The place of a sensor for which none is given; warns, and suggests one of `cameras`.
fn nowhere(py: Python<'_>, cameras: impl FnOnce() -> Vec<String>) -> PyResult<Trajectory> {
    let camera = cameras().first().map(|name| format!("; the scene has a camera: at=scene.camera({name:?})"));
    warn(
        py,
        &format!(
            "the sensor is at 0, 0, 0, as at is not given; allowed: a Pose, a Trajectory, x, y and z, or a matrix \
             of 4 x 4{}",
            camera.unwrap_or_default()
        ),
    )?;
    Ok(Trajectory::fixed(echocast::Pose::IDENTITY))
}

/// Receives the progress of work.
#[derive(Default)]
pub struct ProgressListener {
    callback: Option<Py<PyAny>>,
    /// Whether it is a bar of this package.
    is_bar: bool,
}

impl ProgressListener {
    /// Converts the argument `progress`: a function, or True for a bar with the title `what`.
    pub fn of(progress: &Bound<'_, PyAny>, what: &str) -> BindingResult<ProgressListener> {
        Ok(match progress.extract::<bool>() {
            Ok(false) => ProgressListener::default(),
            Ok(true) => {
                let bar = progress.py().import("echocast._progress")?.call_method1("bar", (what,))?;
                ProgressListener { callback: Some(bar.unbind()), is_bar: true }
            }
            Err(_) if progress.is_callable() => {
                ProgressListener { callback: Some(progress.clone().unbind()), is_bar: false }
            }
            Err(_) => return Err(wrong_type("progress", progress, "a function, True or False")),
        })
    }

    /// Passes `counts` to it and returns whether to continue. Fails at Ctrl-C.
    pub fn notify<'py>(&self, py: Python<'py>, counts: impl pyo3::call::PyCallArgs<'py>) -> PyResult<bool> {
        py.check_signals()?;
        let Some(callback) = &self.callback else { return Ok(true) };
        // Only a false result other than None ends the work.
        let answer = callback.bind(py).call1(counts)?;
        Ok(answer.is_none() || answer.is_truthy()?)
    }

    pub fn close(&self, py: Python<'_>) -> PyResult<()> {
        match &self.callback {
            Some(bar) if self.is_bar => bar.bind(py).call_method0("close").map(drop),
            _ => Ok(()),
        }
    }
}

/// Issues a Python warning about the line that called this package.
pub fn warn(py: Python<'_>, message: &str) -> PyResult<()> {
    let message = CString::new(message)?;
    PyErr::warn(py, &py.get_type::<PyUserWarning>(), &message, 1)
}

/// Fails unless `key` is the name of an argument.
fn known(key: &str) -> BindingResult<()> {
    if names().any(|name| name == key) {
        return Ok(());
    }
    let allowed = names().collect::<Vec<_>>().join(", ");
    Err(PyTypeError::new_err(format!("there is no argument {key:?}; allowed: {allowed}")).into())
}
