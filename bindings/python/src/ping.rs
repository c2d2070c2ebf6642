//! Pings of sonars.

use crate::argument;
use crate::array::{ColumnOwner, owned, shared};
use crate::cloud::names;
use crate::error::{BindingError, BindingResult, no_pickle};
use crate::image::Image;
use crate::options::ScanRequest;
use crate::place::Pose;
use crate::sensor::named;
use crate::sequence;
use echocast::image::{self, ImageRange, Overlap};
use echocast::preview::{self, PreviewOptions, View};
use echocast::{BuiltScene, Error, Field, Layout, Report};
use pyo3::exceptions::PyKeyError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

/// Pings of one sonar, in order.
///
/// `Scene.pings` makes them. `len(pings)` is their number, `pings[i]` one of them, from the end if i is negative;
/// IndexError for others. `waterfall`, `mosaic`, `fan` and `depth_map` are their images.
///
/// >>> lake = ec.Scene.generate("seabed", seed=3)
/// >>> survey = ec.Trajectory([0.0, 10.0], np.array([[-15.0, 0, -2], [5, 0, -2]]))
/// >>> pings = lake.pings("sss_450", 3, at=survey)
/// >>> [ping.number for ping in pings], pings[-1].number
/// ([0, 1, 2], 2)
/// >>> pings.write("survey.npz"), pings.waterfall().write("survey.png")
/// ([], [])
#[pyclass(frozen, sequence, module = "echocast")]
pub struct Pings(Arc<echocast::Pings>);

impl Pings {
    fn layout(&self) -> BindingResult<&Layout> {
        self.0.layout().ok_or_else(|| BindingError::argument("pings", "none", "at least one"))
    }
}

#[pymethods]
impl Pings {
    fn __len__(&self) -> usize {
        self.0.all().len()
    }

    fn __getitem__(&self, index: isize) -> PyResult<Ping> {
        let index = sequence::place("ping", index, self.0.all().len())?;
        Ok(Ping { pings: self.0.clone(), index })
    }

    fn __iter__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        sequence::iterate(slf)
    }

    /// Writes them in the format of the ending of `path` and returns warnings: NPZ or HDF5, arrays of pings x beams x
    /// bins; XTF, the records of side-scan and swath sonars; KMALL, soundings and water columns of swath sonars.
    /// ArgumentError for other sonars.
    fn write(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = argument::path)] path: PathBuf,
    ) -> BindingResult<Vec<String>> {
        Ok(py.detach(|| self.0.write(path))?.warnings)
    }

    /// A row for each ping, the first at the top; for side-scan sonars port reversed and starboard side by side.
    ///
    /// `range`: "slant", or "ground", along a flat bed, without the water column below the sonar. `beam`: only this
    /// one, counted from 0.
    #[pyo3(signature = (*, range = "slant", beam = None))]
    fn waterfall(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = argument::range)] range: &str,
        #[pyo3(from_py_with = argument::beam)] beam: Option<usize>,
    ) -> BindingResult<Image> {
        let range: ImageRange = named("range", range)?;
        Ok(Image(py.detach(|| image::waterfall(&self.0, range, beam))?))
    }

    /// The pings of a side-scan, imaging or single-beam sonar on a map of squares of `cell_m` metres; ArgumentError for
    /// others.
    ///
    /// `range`: as for `waterfall`. `overlap`, where several cells fall on a pixel: "mean" (of the power), "max",
    /// "last" or "nearest" (to the sonar).
    #[pyo3(signature = (cell_m, *, range = "slant", overlap = "mean"))]
    fn mosaic(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = argument::cell_m)] cell_m: f64,
        #[pyo3(from_py_with = argument::range)] range: &str,
        #[pyo3(from_py_with = argument::overlap)] overlap: &str,
    ) -> BindingResult<Image> {
        let (range, overlap): (ImageRange, Overlap) = (named("range", range)?, named("overlap", overlap)?);
        Ok(Image(py.detach(|| image::mosaic(&self.0, range, cell_m, overlap))?))
    }

    /// The pings of a single rotating beam, laid out around the position of the first ping; the longer side has
    /// `pixels` pixels.
    #[pyo3(signature = (pixels = 800))]
    fn fan(&self, py: Python<'_>, #[pyo3(from_py_with = argument::pixels)] pixels: usize) -> BindingResult<Image> {
        Ok(Image(py.detach(|| image::turning_fan(&self.0, pixels))?))
    }

    /// Mean height of the soundings in squares of `cell_m` metres; ArgumentError for sonars without soundings.
    fn depth_map(&self, py: Python<'_>, #[pyo3(from_py_with = argument::cell_m)] cell_m: f64) -> BindingResult<Image> {
        Ok(Image(py.detach(|| image::depth_map(&self.0, cell_m))?))
    }

    /// A picture as PNG, bytes.
    ///
    /// `view`: "waterfall", "track" (on the map) or "fan". `color`: "intensity" or "label". `width`: 320 to 4096
    /// pixels; None: 1600.
    #[pyo3(signature = (*, view = "waterfall", color = "intensity", width = None))]
    fn png<'py>(
        &self,
        py: Python<'py>,
        #[pyo3(from_py_with = argument::view)] view: &str,
        #[pyo3(from_py_with = argument::color)] color: &str,
        #[pyo3(from_py_with = argument::width)] width: Option<u32>,
    ) -> BindingResult<Bound<'py, PyBytes>> {
        let view: View = named("view", view)?;
        let mut options = PreviewOptions::default().view(view).color(named("color", color)?);
        if let Some(width) = width {
            options.width = width;
        }
        let bytes = py.detach(|| {
            let picture = preview::render_pings(&self.0, &options, &mut Report::default())?;
            picture.to_png().map_err(|source| echocast::Error::Io { path: "picture".into(), source })
        })?;
        Ok(PyBytes::new(py, &bytes))
    }

    fn _repr_png_<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyBytes>> {
        self.png(py, "waterfall", "intensity", Some(640)).ok()
    }

    fn __reduce__(&self) -> PyResult<()> {
        no_pickle("Pings", "write() keeps them in a file, .npz or .h5; columns are arrays, which can")
    }

    fn __repr__(&self) -> String {
        match self.0.layout() {
            Some(layout) => {
                format!("<Pings: {} pings of {} beams x {} bins>", self.0.all().len(), layout.beams(), layout.bins)
            }
            None => "<Pings: none>".into(),
        }
    }

    /// Slant range of the middle of each bin, m: float64; ArgumentError if there are no pings.
    #[getter]
    fn ranges<'py>(&self, py: Python<'py>) -> BindingResult<Bound<'py, PyAny>> {
        ranges(py, self.layout()?)
    }
}

/// A ping of a sonar: beams x bins, read-only.
///
/// `ping.levels` and `ping["category_id"]` are NumPy arrays that share its memory, KeyError for a column that it does
/// not have; `ping.soundings` are the depths that the sonar reports. `Scene.ping` makes one.
///
/// >>> lake = ec.Scene.generate("seabed", seed=3)
/// >>> ping = lake.ping("mbes_400", at=lake.camera("Sonar"), fields="intensity,category_id")
/// >>> ping.levels.shape == ping["category_id"].shape == (len(ping.axes), len(ping.ranges))
/// True
/// >>> depths = ping.soundings
/// >>> bool((depths["range"] <= ping.ranges[-1] + ping.bin_m).all())
/// True
#[pyclass(frozen, module = "echocast")]
pub struct Ping {
    pings: Arc<echocast::Pings>,
    index: usize,
}

impl Ping {
    fn ping(&self) -> &echocast::Ping {
        &self.pings.all()[self.index]
    }

    fn array<'py>(&self, py: Python<'py>, field: Field) -> PyResult<Bound<'py, PyAny>> {
        let layout = &self.ping().layout();
        let held = ColumnOwner::Ping(self.pings.clone(), self.index, field);
        shared(py, held, &[layout.beams(), layout.bins])
    }
}

#[pymethods]
impl Ping {
    /// Its number, that of its frame.
    #[getter]
    fn number(&self) -> u32 {
        self.ping().number
    }

    /// Time of transmission, s since the start of the run.
    #[getter]
    fn time(&self) -> f64 {
        self.ping().time
    }

    /// Pose of the sonar at that time.
    #[getter]
    fn pose(&self) -> Pose {
        Pose(self.ping().pose)
    }

    /// The point that `true_x`, `true_y` and `true_z` are relative to: x, y, z in the world, m.
    #[getter]
    fn origin(&self) -> [f64; 3] {
        self.ping().origin.to_array()
    }

    /// Echo levels, beams x bins float32, dB re 1 uPa; shares the memory of the ping.
    #[getter]
    fn levels<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.array(py, Field::Intensity)
    }

    /// Names of its columns.
    #[getter]
    fn fields(&self) -> Vec<&'static str> {
        self.ping().fields().iter().map(|info| info.name).collect()
    }

    /// A column: beams x bins.
    fn __getitem__<'py>(
        &self,
        py: Python<'py>,
        #[pyo3(from_py_with = argument::name)] name: &str,
    ) -> BindingResult<Bound<'py, PyAny>> {
        match Field::from_name(name).ok().filter(|&field| self.ping().fields().contains(field)) {
            Some(field) => Ok(self.array(py, field)?),
            None => {
                let (near, has) = (Error::missing("column", name, self.fields()), self.fields().join(", "));
                Err(PyKeyError::new_err(format!("{near}; there are {has}")).into())
            }
        }
    }

    /// Arrangement of its beams: "sidescan", "swath", "fan", "single" or "janus".
    #[getter]
    fn view(&self) -> &'static str {
        self.ping().layout().view.name()
    }

    /// Slant range of the middle of each bin, m: float64.
    #[getter]
    fn ranges<'py>(&self, py: Python<'py>) -> BindingResult<Bound<'py, PyAny>> {
        ranges(py, self.ping().layout())
    }

    /// Length of a bin, m.
    #[getter]
    fn bin_m(&self) -> f64 {
        self.ping().layout().bin_m
    }

    /// Azimuth and elevation of the axis of each beam, sensor frame, rad: beams x 2 float32.
    #[getter]
    fn axes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let axes = &self.ping().layout().axes;
        owned(py, axes.as_flattened().to_vec(), &[axes.len(), 2])
    }

    /// Noise level in a cell, dB re 1 uPa.
    #[getter]
    fn noise_db(&self) -> f32 {
        self.ping().layout().noise_db
    }

    /// Lowest level that is reported as an echo, dB re 1 uPa: float32, one for each bin.
    #[getter]
    fn threshold_db<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let levels = &self.ping().layout().threshold_db;
        owned(py, levels.clone(), &[levels.len()])
    }

    /// Sound speed that reported ranges assume, m/s.
    #[getter]
    fn sound_speed(&self) -> f64 {
        self.ping().layout().believed_speed
    }

    /// The soundings, a dict of arrays: `beam`, uint32; `range`, float32, m; `bin`, uint32; `level_db`, float32, dB re
    /// 1 uPa; `quality`, float32, 0 to 1; `corrected`, n x 3 float32, the position by a ray traced through the assumed
    /// sound speed cast, m, relative to `origin`. The arrays are empty for side-scan and imaging sonars.
    #[getter]
    fn soundings<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let (found, bins) = (self.ping().soundings(), self.ping().layout().bins.max(1) as u32);
        let by_name = PyDict::new(py);
        let count = [found.len()];
        by_name.set_item("beam", owned(py, found.iter().map(|sounding| sounding.beam).collect(), &count)?)?;
        by_name.set_item("range", owned(py, found.iter().map(|sounding| sounding.range).collect(), &count)?)?;
        by_name.set_item("bin", owned(py, found.iter().map(|sounding| sounding.cell % bins).collect(), &count)?)?;
        by_name.set_item("level_db", owned(py, found.iter().map(|sounding| sounding.level_db).collect(), &count)?)?;
        by_name.set_item("quality", owned(py, found.iter().map(|sounding| sounding.quality).collect(), &count)?)?;
        let places = found.iter().flat_map(|sounding| sounding.corrected.to_array()).collect();
        by_name.set_item("corrected", owned(py, places, &[found.len(), 3])?)?;
        Ok(by_name)
    }

    /// Names of the numbers in `category_id`.
    #[getter]
    fn categories(&self) -> BTreeMap<u32, String> {
        names(&self.ping().labels.category)
    }

    /// Its image by beam and range; the longer side has `pixels` pixels. For imaging and swath sonars; ArgumentError
    /// for others.
    #[pyo3(signature = (pixels = 800))]
    fn fan(&self, py: Python<'_>, #[pyo3(from_py_with = argument::pixels)] pixels: usize) -> BindingResult<Image> {
        Ok(Image(py.detach(|| image::fan(self.ping(), pixels))?))
    }

    fn __reduce__(&self) -> PyResult<()> {
        no_pickle("a Ping", "its levels and other columns are arrays, which can")
    }

    fn __repr__(&self) -> String {
        let layout = &self.ping().layout();
        format!("<Ping {}: {} beams x {} bins>", self.ping().number, layout.beams(), layout.bins)
    }
}

fn ranges<'py>(py: Python<'py>, layout: &Layout) -> BindingResult<Bound<'py, PyAny>> {
    Ok(owned(py, (0..layout.bins).map(|bin| layout.range(bin)).collect(), &[layout.bins])?)
}

/// `count` pings in order, from the frame and time that were requested.
pub fn pings(py: Python<'_>, built: &BuiltScene, request: &ScanRequest, count: u32) -> BindingResult<Pings> {
    let ScanRequest { sensor, path, .. } = request;
    let period = request.options.frame_period.unwrap_or(sensor.beams().period);
    let made = request.run(py, |progress| {
        let mut pings = echocast::Pings::default();
        for number in 0..count {
            let mut options = request.options.clone();
            options.frame = options.frame.saturating_add(number);
            options.start_time += f64::from(number) * period;
            let ping = built.ping(sensor, path, &options)?;
            if number == 0 {
                check_room(&ping, count)?;
            }
            pings.push(ping)?;
            if progress(f64::from(number + 1) / f64::from(count)).is_break() {
                return Err(echocast::Error::Cancelled);
            }
        }
        Ok(pings)
    })?;
    Ok(Pings(Arc::new(made)))
}

/// Fails unless the memory of this machine, or the share of a container, holds `count` pings like this.
fn check_room(ping: &echocast::Ping, count: u32) -> echocast::Result<()> {
    let bytes = ping.layout().cells() * ping.fields().iter().map(|info| info.kind.size()).sum::<usize>();
    let machine = rustix::system::sysinfo();
    // The limit of a container, which sees its own control group as the root; "max" is not a number.
    let limit = std::fs::read_to_string("/sys/fs/cgroup/memory.max").ok().and_then(|text| text.trim().parse().ok());
    let memory = (machine.totalram as usize).saturating_mul(machine.mem_unit as usize).min(limit.unwrap_or(usize::MAX));
    let most = memory / bytes.max(1);
    if count as usize <= most {
        return Ok(());
    }
    let allowed = format!("0 to {most}, for the memory of this machine; or fewer fields");
    Err(echocast::Error::InvalidParameter { name: "count".into(), value: count.to_string(), allowed })
}

/// One ping.
pub fn ping(py: Python<'_>, built: &BuiltScene, request: &ScanRequest) -> BindingResult<Ping> {
    Ok(Ping { pings: pings(py, built, request, 1)?.0, index: 0 })
}
