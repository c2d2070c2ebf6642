//! Arrays: rows that are read, columns that share the memory of their owner.

use crate::error::{BindingError, BindingResult};
use echocast::cloud::{self, ColumnType};
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

/// A column of a cloud or ping, which it keeps alive; `numpy.asarray` makes a read-only array of it without a copy.
#[pyclass(frozen, module = "echocast")]
pub struct Column {
    held: ColumnOwner,
    shape: Vec<usize>,
}

#[pymethods]
impl Column {
    /// NumPy's array interface, version 3.
    #[getter]
    fn __array_interface__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let column = self.held.column();
        let kind = match column.kind() {
            ColumnType::F32 => "=f4",
            ColumnType::F64 => "=f8",
            ColumnType::U8 => "|u1",
            ColumnType::U16 => "=u2",
            ColumnType::U32 => "=u4",
        };
        let kind = kind.replace('=', if cfg!(target_endian = "big") { ">" } else { "<" });
        let interface = PyDict::new(py);
        interface.set_item("version", 3)?;
        interface.set_item("typestr", kind)?;
        interface.set_item("shape", PyTuple::new(py, &self.shape)?)?;
        // It is read-only.
        interface.set_item("data", (column.bytes().as_ptr() as usize, true))?;
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
    let column = Bound::new(py, Column { held, shape: shape.to_vec() })?;
    py.import("numpy")?.call_method1("asarray", (column,))
}

/// `values` as an array of `shape`, which owns them.
pub fn owned<'py, T: Element>(py: Python<'py>, values: Vec<T>, shape: &[usize]) -> PyResult<Bound<'py, PyAny>> {
    numpy::PyArray1::from_vec(py, values).call_method1("reshape", (PyTuple::new(py, shape)?,))
}
