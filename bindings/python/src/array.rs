//! Arrays: rows that are read, columns that share the memory of their owner.

use crate::error::{BindingError, BindingResult};
use echocast::cloud::{self, ColumnType};
use echocast::radar::RadarFrame;
use echocast::{Field, Pings, PointCloud};
use numpy::ndarray::Dimension;
use numpy::{Element, PyReadonlyArray, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use std::sync::Arc;

/// The argument `name`: an array of `T` as it is, or whatever else NumPy accepts as numbers of `shape`, as a copy.
pub fn numbers<'py, T: Element, D: Dimension>(
    name: &str,
    value: &Bound<'py, PyAny>,
    shape: &str,
) -> BindingResult<PyReadonlyArray<'py, T, D>> {
    if let Ok(array) = value.extract() {
        return Ok(array);
    }
    let py = value.py();
    let arguments = (name, value, numpy::dtype::<T>(py), D::NDIM, shape);
    Ok(py.import("echocast._arrays")?.call_method1("numbers", arguments)?.extract()?)
}

/// The rows of `array`, the argument `name`: `N` numbers each.
pub fn rows<T: Element + Copy, const N: usize>(
    name: &str,
    array: &PyReadonlyArray2<'_, T>,
) -> BindingResult<Vec<[T; N]>> {
    let array = array.as_array();
    if array.ncols() != N {
        return Err(BindingError::argument(name, format!("n x {}", array.ncols()), format!("n x {N}")));
    }
    Ok(array.rows().into_iter().map(|row| std::array::from_fn(|column| row[column])).collect())
}

/// The owner of a column, and which one it is.
#[derive(Clone)]
pub enum ColumnOwner {
    Cloud(Arc<PointCloud>, Field),
    /// Of the ping with this index.
    Ping(Arc<Pings>, usize, Field),
}

impl ColumnOwner {
    pub fn column(&self) -> cloud::Column<'_> {
        match self {
            ColumnOwner::Cloud(cloud, field) => cloud.column(*field),
            ColumnOwner::Ping(pings, ping, field) => pings.all()[*ping].column(*field),
        }
    }
}

/// Its bytes, in the machine's order.
impl AsRef<[u8]> for ColumnOwner {
    fn as_ref(&self) -> &[u8] {
        self.column().bytes()
    }
}

/// What an array shares the memory of.
enum ArrayOwner {
    Column(ColumnOwner),
    Frame(Arc<RadarFrame>, FrameArray),
}

/// An array of the frame of a radar.
#[derive(Clone, Copy)]
pub enum FrameArray {
    /// Complex numbers.
    Cube,
    /// 16 bits with a sign.
    Samples,
    /// Levels of the polar image.
    Polar,
}

impl ArrayOwner {
    /// NumPy's type, without the order of bytes, and the address of the first number.
    fn described(&self) -> (&'static str, usize) {
        fn first<T>(numbers: Option<&Vec<T>>) -> usize {
            numbers.map_or(0, |numbers| numbers.as_ptr() as usize)
        }
        match self {
            ArrayOwner::Column(held) => {
                let column = held.column();
                let kind = match column.kind() {
                    ColumnType::F32 => "=f4",
                    ColumnType::F64 => "=f8",
                    ColumnType::U8 => "|u1",
                    ColumnType::U16 => "=u2",
                    ColumnType::U32 => "=u4",
                };
                (kind, column.bytes().as_ptr() as usize)
            }
            ArrayOwner::Frame(frame, FrameArray::Cube) => ("=c8", first(frame.cube.as_ref().map(|cube| &cube.cells))),
            ArrayOwner::Frame(frame, FrameArray::Samples) => {
                ("=i2", first(frame.samples.as_ref().map(|samples| &samples.values)))
            }
            ArrayOwner::Frame(frame, FrameArray::Polar) => {
                ("=f4", first(frame.polar.as_ref().map(|image| &image.levels)))
            }
        }
    }
}

/// Numbers of a cloud, a ping or the frame of a radar, which it keeps alive; `numpy.asarray` makes a read-only array of it without a copy.
#[pyclass(frozen, module = "echocast")]
pub struct Column {
    held: ArrayOwner,
    shape: Vec<usize>,
}

#[pymethods]
impl Column {
    /// NumPy's array interface, version 3.
    #[getter]
    fn __array_interface__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let (kind, first) = self.held.described();
        let kind = kind.replace('=', if cfg!(target_endian = "big") { ">" } else { "<" });
        let interface = PyDict::new(py);
        interface.set_item("version", 3)?;
        interface.set_item("typestr", kind)?;
        interface.set_item("shape", PyTuple::new(py, &self.shape)?)?;
        // It is read-only.
        interface.set_item("data", (first, true))?;
        Ok(interface)
    }
}

/// NumPy's name for a type.
pub fn kind_name(kind: ColumnType) -> &'static str {
    match kind {
        ColumnType::F32 => "float32",
        ColumnType::F64 => "float64",
        ColumnType::U8 => "uint8",
        ColumnType::U16 => "uint16",
        ColumnType::U32 => "uint32",
    }
}

/// The column `held` as an array of `shape`.
pub fn shared<'py>(py: Python<'py>, held: ColumnOwner, shape: &[usize]) -> PyResult<Bound<'py, PyAny>> {
    read_only(py, ArrayOwner::Column(held), shape)
}

/// The numbers `which` of `frame`, which it has, as an array of `shape`.
pub fn of_frame<'py>(
    py: Python<'py>,
    frame: &Arc<RadarFrame>,
    which: FrameArray,
    shape: &[usize],
) -> PyResult<Bound<'py, PyAny>> {
    read_only(py, ArrayOwner::Frame(frame.clone(), which), shape)
}

fn read_only<'py>(py: Python<'py>, held: ArrayOwner, shape: &[usize]) -> PyResult<Bound<'py, PyAny>> {
    let column = Bound::new(py, Column { held, shape: shape.to_vec() })?;
    py.import("numpy")?.call_method1("asarray", (column,))
}

/// `values` as an array of `shape`, which owns them.
pub fn owned<'py, T: Element>(py: Python<'py>, values: Vec<T>, shape: &[usize]) -> PyResult<Bound<'py, PyAny>> {
    numpy::PyArray1::from_vec(py, values).call_method1("reshape", (PyTuple::new(py, shape)?,))
}
