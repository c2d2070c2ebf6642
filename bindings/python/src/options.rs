//! How to scan: the keyword arguments of every method that scans.

use crate::error::{Failure, Outcome, one_of};
use crate::place;
use crate::sensor::{Air, named};
use echocast::{BoxAxes, FieldSet, ScanOptions, Sensor, Trajectory};
use pyo3::exceptions::{PyOverflowError, PyTypeError, PyUserWarning};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::ffi::CString;
use std::ops::ControlFlow;

/// Names of the arguments.
const NAMES: &str = "at, fields, seed, frame, start_time, trajectory_time, freeze, frame_period, organised, coordinates, \
                     order, deskew, boxes, box_time, image_boxes, profile, reflectance_source, mask, specular_depth, \
                     environment, progress";

/// What a method that scans was asked for.
pub struct Asked {
    pub options: ScanOptions,
    /// Where the sensor is, if that was told.
    path: Option<Trajectory>,
    progress: Progress,
}

/// Columns: names in a list, or separated by commas.
pub enum Columns {
    Text(String),
    List(Vec<String>),
}

one_of! { Columns: Text | List; "names of columns in a list, or in a text with commas" }

impl Columns {
    pub fn names(self) -> Vec<String> {
        match self {
            Columns::Text(text) => text.split(',').map(|name| name.trim().to_owned()).collect(),
            Columns::List(names) => names,
        }
    }
}

impl Asked {
    /// Out of `keywords`, for scans with `sensor`.
    pub fn of(keywords: Option<&Bound<'_, PyDict>>, sensor: &Sensor) -> Outcome<Asked> {
        let mut current = String::new();
        let read = Asked::read(keywords, sensor, &mut current);
        read.map_err(|error| Python::attach(|py| error.about(py, &current)))
    }

    /// [`Asked::of`] that says in `current` which argument it reads.
    fn read(keywords: Option<&Bound<'_, PyDict>>, sensor: &Sensor, current: &mut String) -> Outcome<Asked> {
        let mut asked = Asked {
            options: ScanOptions { fields: sensor.default_fields(), ..ScanOptions::default() },
            path: None,
            progress: Progress::default(),
        };
        let options = &mut asked.options;
        for (key, value) in keywords.into_iter().flatten() {
            let key: String = key.extract()?;
            known(&key)?;
            current.clone_from(&key);
            let text = || value.extract::<String>();
            match &*key {
                // None means the default.
                _ if value.is_none() => {}
                "at" => asked.path = Some(place::path(&value)?),
                "fields" => {
                    let list = value.extract::<Columns>()?.names().join(",");
                    options.fields = FieldSet::parse_with(&list, sensor.default_fields())?;
                }
                "seed" => options.seed = whole(&key, &value)?,
                "frame" => options.frame = whole(&key, &value)?,
                "start_time" => options.start_time = value.extract()?,
                "trajectory_time" => options.trajectory_time = value.extract()?,
                "freeze" => options.freeze = value.extract()?,
                "frame_period" => options.frame_period = value.extract()?,
                "organised" => options.organised = value.extract()?,
                "coordinates" => options.coordinates = named("coordinates", &text()?)?,
                "order" => options.order = named("order", &text()?)?,
                "boxes" => {
                    options.boxes = match value.extract::<bool>() {
                        Ok(wanted) => wanted.then_some(BoxAxes::default()),
                        Err(_) => Some(named("boxes", &text()?)?),
                    }
                }
                "box_time" => options.box_time = named("box_time", &text()?)?,
                "deskew" => options.deskew = value.extract()?,
                "image_boxes" => options.image_boxes = value.extract()?,
                "profile" => options.profile = named("profile", &text()?)?,
                "reflectance_source" => options.reflectance_source = Some(named("reflectance_source", &text()?)?),
                "mask" => options.mask = whole(&key, &value)?,
                "specular_depth" => options.specular_depth = whole(&key, &value)?,
                "environment" => options.environment = value.extract::<Air>()?.environment()?,
                "progress" => asked.progress = Progress::of(&value, "scan")?,
                _ => {}
            }
        }
        Ok(asked)
    }

    /// Where the sensor is. Without `at` it stands at 0, 0, 0, with a warning that suggests one of the scene's `cameras`.
    pub fn path(&self, py: Python<'_>, cameras: impl FnOnce() -> Vec<String>) -> PyResult<Trajectory> {
        if let Some(path) = &self.path {
            return Ok(path.clone());
        }
        let camera = cameras().first().map(|name| format!("; the scene has a camera: at=scene.camera({name:?})"));
        warn(
            py,
            &format!(
                "the sensor is at 0, 0, 0, as at is not given; allowed: a Pose, a Trajectory, x, y and z, or a matrix of 4 \
                 x 4{}",
                camera.unwrap_or_default()
            ),
        )?;
        Ok(Trajectory::fixed(echocast::Pose::IDENTITY))
    }

    /// Does `work` without the interpreter, which it can ask how to go on.
    pub fn run<T: Send>(
        &self,
        py: Python<'_>,
        work: impl Send + FnOnce(&mut dyn FnMut(f64) -> ControlFlow<()>) -> echocast::Result<T>,
    ) -> Outcome<T> {
        let mut stopped: Option<PyErr> = None;
        let done = py.detach(|| {
            work(&mut |fraction| match Python::attach(|py| self.progress.tell(py, (fraction,))) {
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
            Some(error) => Err(Failure::Python(error)),
            None => Ok(done?),
        }
    }
}

/// Who is told how far work has come.
#[derive(Default)]
pub struct Progress {
    told: Option<Py<PyAny>>,
    /// Whether it is a bar of this package.
    is_bar: bool,
}

impl Progress {
    /// Out of the argument `progress`: a function, or True for a bar that says it is about `what`.
    pub fn of(progress: &Bound<'_, PyAny>, what: &str) -> PyResult<Progress> {
        Ok(match progress.extract::<bool>() {
            Ok(false) => Progress::default(),
            Ok(true) => {
                let bar = progress.py().import("echocast._progress")?.call_method1("bar", (what,))?;
                Progress { told: Some(bar.unbind()), is_bar: true }
            }
            Err(_) => Progress { told: Some(progress.clone().unbind()), is_bar: false },
        })
    }

    /// Tells it `counts`; whether to go on. Fails at Ctrl-C.
    pub fn tell<'py>(&self, py: Python<'py>, counts: impl pyo3::call::PyCallArgs<'py>) -> PyResult<bool> {
        py.check_signals()?;
        let Some(told) = &self.told else { return Ok(true) };
        // What it returns does not matter, unless it says no.
        let answer = told.bind(py).call1(counts)?;
        Ok(answer.is_none() || answer.is_truthy()?)
    }

    pub fn close(&self, py: Python<'_>) -> PyResult<()> {
        match &self.told {
            Some(bar) if self.is_bar => bar.bind(py).call_method0("close").map(drop),
            _ => Ok(()),
        }
    }
}

/// The whole number that `value` is, for the argument `name`, which is 0 to the greatest `T`.
pub fn whole<T: TryFrom<u64>>(name: &str, value: &Bound<'_, PyAny>) -> Outcome<T> {
    let number = match value.extract::<u64>() {
        Err(error) if !error.is_instance_of::<PyOverflowError>(value.py()) => return Err(error.into()),
        number => number.ok(),
    };
    let most = u64::MAX >> (64 - 8 * size_of::<T>());
    let fitting = number.and_then(|number| T::try_from(number).ok());
    fitting.ok_or_else(|| Failure::argument(name, value, format!("0 to {most}")))
}

/// Warns as Python does, of the line that called this package.
pub fn warn(py: Python<'_>, told: &str) -> PyResult<()> {
    let told = CString::new(told)?;
    PyErr::warn(py, &py.get_type::<PyUserWarning>(), &told, 1)
}

/// Fails unless `key` is the name of an argument.
fn known(key: &str) -> Outcome<()> {
    if NAMES.split(", ").any(|name| name == key) {
        return Ok(());
    }
    Err(PyTypeError::new_err(format!("there is no argument {key:?}; allowed: {NAMES}")).into())
}
