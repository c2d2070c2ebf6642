//! Frames of radars.

use crate::argument;
use crate::array::{FrameArray, of_frame, owned};
use crate::cloud::PointCloud;
use crate::error::{BindingError, BindingResult, no_pickle};
use crate::image::Image;
use crate::options::ScanRequest;
use crate::place::Pose;
use crate::sensor::named;
use echocast::preview::{self, PreviewOptions, View};
use echocast::radar::{Axis, RadarCube, RadarRecord};
use echocast::{BuiltScene, Error};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use std::path::PathBuf;
use std::sync::Arc;

/// A frame of a radar: its detections, and what was requested of its cube, samples and polar image, read-only.
///
/// `Scene.radar_frame` makes one. Arrays share its memory; what it does not have is None. `range_m` and `velocity` are
/// the axes of the cube: a positive velocity recedes.
///
/// >>> street = ec.Scene.generate("street", seed=3)
/// >>> frame = street.radar_frame("ti_awr1843", at=(0, 0, 0.5), samples=True)
/// >>> frame.cube.dtype, frame.cube.shape == (len(frame.elements), len(frame.velocity), len(frame.range_m))
/// (dtype('complex64'), True)
/// >>> chirps, transmitters, receivers, samples, two = frame.samples.shape
/// >>> two, frame.samples.dtype, "rcs" in frame.detections.fields
/// (2, dtype('int16'), True)
/// >>> frame.write("frame.npz"), frame.image("range_doppler").kind
/// ([], 'range_doppler')
#[pyclass(frozen, module = "echocast")]
pub struct RadarFrame {
    frame: Arc<echocast::radar::RadarFrame>,
    detections: Py<PointCloud>,
}

#[pymethods]
impl RadarFrame {
    /// Its number.
    #[getter]
    fn number(&self) -> u32 {
        self.frame.number
    }

    /// When it starts, s since the start of the run.
    #[getter]
    fn time(&self) -> f64 {
        self.frame.time
    }

    /// Pose of the radar.
    #[getter]
    fn pose(&self) -> Pose {
        Pose(self.frame.pose)
    }

    /// Wavelength in the middle of a chirp, m.
    #[getter]
    fn wavelength(&self) -> f64 {
        self.frame.wavelength
    }

    /// The detections, as `Scene.scan` returns them.
    #[getter]
    fn detections(&self, py: Python<'_>) -> Py<PointCloud> {
        self.detections.clone_ref(py)
    }

    /// Amplitudes at the receiver, channels x velocities x ranges complex64, square roots of W; None if they were not
    /// requested. A longer way makes the phase more negative.
    #[getter]
    fn cube<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let shape = |cube: &RadarCube| [cube.channels, cube.axes.velocity.len, cube.axes.range.len];
        self.frame.cube.as_ref().map(|cube| of_frame(py, &self.frame, FrameArray::Cube, &shape(cube))).transpose()
    }

    /// Range of each range cell of the cube, m: float64; None without a cube.
    #[getter]
    fn range_m<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        self.frame.cube.as_ref().map(|cube| places(py, cube.axes.range)).transpose()
    }

    /// Rate of the range of each velocity cell of the cube, m/s: float64, positive if receding; None without a cube.
    #[getter]
    fn velocity<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        self.frame.cube.as_ref().map(|cube| places(py, cube.axes.velocity)).transpose()
    }

    /// Places of the virtual elements of the channels, in the axes of the radar, m: channels x 3 float64.
    #[getter]
    fn elements<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let elements = &self.frame.elements;
        owned(py, elements.as_flattened().to_vec(), &[elements.len(), 3])
    }

    /// What the converters sampled: chirps x transmitters x receivers x samples x 2 (in phase, in quadrature) int16; None
    /// if it was not requested.
    #[getter]
    fn samples<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let array = |[chirps, transmitters, receivers, count]: [usize; 4]| {
            of_frame(py, &self.frame, FrameArray::Samples, &[chirps, transmitters, receivers, count, 2])
        };
        self.frame.samples.as_ref().map(|samples| array(samples.shape)).transpose()
    }

    /// Power at the receiver by azimuth and range in a turn of a rotating radar, azimuths x ranges float32, dBm; None for
    /// others.
    #[getter]
    fn polar<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let shape = self.frame.polar.as_ref().map(|image| [image.azimuths.len(), image.range.len]);
        shape.map(|shape| of_frame(py, &self.frame, FrameArray::Polar, &shape)).transpose()
    }

    /// Direction of each row of `polar`, rad, counter-clockwise from ahead: float64; None without it.
    #[getter]
    fn polar_azimuth<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let image = self.frame.polar.as_ref();
        image.map(|image| owned(py, image.azimuths.clone(), &[image.azimuths.len()])).transpose()
    }

    /// When each row of `polar` was measured, s since the start of the run: float64; None without it.
    #[getter]
    fn polar_time<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let image = self.frame.polar.as_ref();
        image.map(|image| owned(py, image.times.clone(), &[image.times.len()])).transpose()
    }

    /// Range of each cell of a row of `polar`, m: float64; None without it.
    #[getter]
    fn polar_range_m<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        self.frame.polar.as_ref().map(|image| places(py, image.range)).transpose()
    }

    /// Its power as an image, dBm. `view`: "range_doppler" or "range_azimuth" of the cube, "polar" of the polar image;
    /// ArgumentError for a frame without it. The last two are laid out around the radar, ahead up, `width` pixels wide
    /// or less, 320 to 4096; None: 1600.
    #[pyo3(signature = (view, *, width = None))]
    fn image(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = argument::view)] view: &str,
        #[pyo3(from_py_with = argument::width)] width: Option<u32>,
    ) -> BindingResult<Image> {
        let options = shown(view, width)?;
        Ok(Image(py.detach(|| preview::image_of_frame(&self.frame, &options))?))
    }

    /// A picture of this image with scale and legend as PNG, bytes.
    #[pyo3(signature = (view, *, width = None))]
    fn png<'py>(
        &self,
        py: Python<'py>,
        #[pyo3(from_py_with = argument::view)] view: &str,
        #[pyo3(from_py_with = argument::width)] width: Option<u32>,
    ) -> BindingResult<Bound<'py, PyBytes>> {
        let options = shown(view, width)?;
        let bytes = py.detach(|| {
            let image = preview::image_of_frame(&self.frame, &options)?;
            let picture = preview::render_radar(&image, options.width)?;
            picture.to_png().map_err(|source| Error::Io { path: "picture".into(), source })
        })?;
        Ok(PyBytes::new(py, &bytes))
    }

    /// Writes it in the format of the ending of `path` and returns warnings: NPZ or HDF5, arrays with their axes; `.bin`,
    /// the samples alone in the layout of TI's capture card DCA1000.
    fn write(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = argument::path)] path: PathBuf,
    ) -> BindingResult<Vec<String>> {
        Ok(py.detach(|| self.frame.write(path))?.warnings)
    }

    fn __reduce__(&self) -> PyResult<()> {
        no_pickle("a RadarFrame", "write() keeps it in a file, .npz or .h5; its arrays and its detections can")
    }

    fn __repr__(&self) -> String {
        let has = [
            ("a cube", self.frame.cube.is_some()),
            ("samples", self.frame.samples.is_some()),
            ("a polar image", self.frame.polar.is_some()),
        ];
        let has: Vec<&str> = has.iter().filter(|(_, has)| *has).map(|(what, _)| *what).collect();
        let what = if has.is_empty() { "detections alone".to_owned() } else { has.join(", ") };
        format!("<RadarFrame {}: {what}>", self.frame.number)
    }
}

fn shown(view: &str, width: Option<u32>) -> BindingResult<PreviewOptions> {
    let view: View = named("view", view)?;
    if !view.shows_frames() {
        return Err(BindingError::argument("view", view.name(), "range_doppler, range_azimuth, polar"));
    }
    let options = PreviewOptions::default().view(view);
    Ok(width.map_or(options, |width| options.width(width)))
}

/// Places of all cells of `axis`.
fn places<'py>(py: Python<'py>, axis: Axis) -> PyResult<Bound<'py, PyAny>> {
    owned(py, (0..axis.len).map(|cell| axis.at(cell as f64)).collect(), &[axis.len])
}

/// One frame with what `record` requests.
pub fn radar_frame(
    py: Python<'_>,
    built: &BuiltScene,
    request: &ScanRequest,
    record: RadarRecord,
) -> BindingResult<RadarFrame> {
    let ScanRequest { sensor, path, options, .. } = request;
    let (frame, cloud) = request.run(py, |progress| {
        let mut cloud = echocast::PointCloud::default();
        if progress(0.0).is_break() {
            return Err(Error::Cancelled);
        }
        let frame = built.radar_frame(sensor, path, options, record, &mut cloud)?;
        cloud.time_zero = path.time_zero();
        let _ = progress(1.0);
        Ok((frame, cloud))
    })?;
    Ok(RadarFrame { frame: Arc::new(frame), detections: Py::new(py, PointCloud::of(cloud))? })
}
