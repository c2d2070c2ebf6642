//! Images: of pings, and what cameras and other sensors with rows and columns see.

use crate::argument;
use crate::array::{ColumnOwner, owned, shared};
use crate::error::{BindingError, BindingResult, no_pickle};
use crate::sensor::{Instrument, named};
use echocast::cloud::Column;
use echocast::image::{Layer, Layers};
use echocast::{Error, Field, PointCloud, Sensor};
use pyo3::exceptions::PyKeyError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;
use std::sync::Arc;

/// An image of pings: a waterfall, a mosaic, a fan or a map of depths; or of the frame of a radar.
///
/// `image.values` are its levels or heights, `image["category_id"]` the labels of its pixels: rows x columns uint32, 0
/// where there is nothing; KeyError for a column that the pings do not have.
///
/// >>> lake = ec.Scene.generate("seabed", seed=3)
/// >>> survey = ec.Trajectory([0.0, 10.0], np.array([[-15.0, 0, -2], [5, 0, -2]]))
/// >>> pings = lake.pings("sss_450", 3, at=survey, fields="intensity,category_id")
/// >>> image = pings.waterfall()
/// >>> image.values.shape == image["category_id"].shape == (3, 2 * len(pings.ranges))
/// True
#[pyclass(frozen, module = "echocast")]
pub struct Image(pub echocast::image::Image);

#[pymethods]
impl Image {
    /// "waterfall", "mosaic", "fan" or "depth_map"; "range_doppler" or "polar_fan" of radars.
    #[getter]
    fn kind(&self) -> &'static str {
        self.0.kind.name()
    }

    /// Rows x columns float32: echo levels with time-varied gain, dB re 1 uPa; for a depth map heights, m; for
    /// radars power at the receiver, dBm. NaN where
    /// there is nothing. A copy.
    #[getter]
    fn values<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        owned(py, self.0.values.clone(), &[self.0.height, self.0.width])
    }

    /// Names of its label columns.
    #[getter]
    fn fields(&self) -> Vec<&'static str> {
        self.0.layers.iter().map(|layer| layer.field.info().name).collect()
    }

    /// A label column.
    fn __getitem__<'py>(
        &self,
        py: Python<'py>,
        #[pyo3(from_py_with = argument::name)] name: &str,
    ) -> BindingResult<Bound<'py, PyAny>> {
        let layer = Field::from_name(name).ok().and_then(|field| self.0.layer(field));
        let Some(ids) = layer else {
            let (near, has) = (Error::missing("column", name, self.fields()), self.fields().join(", "));
            return Err(PyKeyError::new_err(format!("{near}; there are: {has}")).into());
        };
        Ok(owned(py, ids.to_vec(), &[self.0.height, self.0.width])?)
    }

    /// Coordinates of the centre of a pixel; `axes` names them.
    fn coordinates(
        &self,
        #[pyo3(from_py_with = argument::column)] column: usize,
        #[pyo3(from_py_with = argument::row)] row: usize,
    ) -> [f64; 2] {
        self.0.coordinates(column, row)
    }

    /// Meanings of the coordinates, along columns and rows, with their units.
    #[getter]
    fn axes(&self) -> [&'static str; 2] {
        self.0.place.axes
    }

    /// Writes it as PNG, NPZ or HDF5, by the ending of `path`; returns warnings.
    fn write(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = argument::path)] path: PathBuf,
    ) -> BindingResult<Vec<String>> {
        Ok(py.detach(|| self.0.write(path))?.warnings)
    }

    fn __reduce__(&self) -> PyResult<()> {
        no_pickle("an Image", "write() keeps it in a file; its values and labels are arrays, which can")
    }

    fn __repr__(&self) -> String {
        format!("<Image: {}, {} x {} pixels>", self.0.kind.name(), self.0.width, self.0.height)
    }
}

/// The layer called `layer` of the image that `sensor` has seen in `cloud`: rows x columns, or x 3 for colours and
/// normals.
pub fn layer<'py>(
    py: Python<'py>,
    cloud: &Arc<PointCloud>,
    layer: &str,
    sensor: Instrument<'_>,
) -> BindingResult<Bound<'py, PyAny>> {
    let layer: Layer = named("layer", layer)?;
    let grid = sensor.sensor()?.image_grid()?;
    let mut layers = Layers::default();
    let column = py.detach(|| layers.get(cloud, &grid, layer))?;
    let shape = [grid.height, grid.width];
    // If the rows of the cloud are the pixels, the layer is a column.
    let own = |field: &Field| cloud.column(*field).bytes().as_ptr() == column.bytes().as_ptr();
    if let Some(field) = cloud.fields().iter().map(|info| info.field).find(own) {
        return Ok(shared(py, ColumnOwner::Cloud(cloud.clone(), field), &shape)?);
    }
    let pixels = shape[0] * shape[1];
    let whole = [shape[0], shape[1], column.len() / pixels.max(1)];
    let shape = if column.len() > pixels { &whole[..] } else { &whole[..2] };
    Ok(match column {
        Column::F32(values) => owned(py, values.to_vec(), shape),
        Column::F64(values) => owned(py, values.to_vec(), shape),
        Column::U8(values) => owned(py, values.to_vec(), shape),
        Column::U16(values) => owned(py, values.to_vec(), shape),
        Column::U32(values) => owned(py, values.to_vec(), shape),
    }?)
}

/// The instances in the image of `cloud`, as dicts.
pub fn annotations<'py>(
    py: Python<'py>,
    cloud: &PointCloud,
    sensor: &Sensor,
) -> BindingResult<Vec<Bound<'py, PyDict>>> {
    let grid = sensor.image_grid()?;
    let found = py.detach(|| Layers::default().annotations(cloud, &grid))?;
    let described = found.into_iter().map(|seen| {
        let described = PyDict::new(py);
        described.set_item("instance_id", seen.instance_id)?;
        described.set_item("category_id", seen.category_id)?;
        described.set_item("bounds", seen.bounds)?;
        described.set_item("area", seen.area)?;
        described.set_item("amodal", seen.amodal)?;
        described.set_item("truncation", seen.truncation)?;
        described.set_item("occlusion", seen.occlusion)?;
        Ok::<_, BindingError>(described)
    });
    described.collect()
}
