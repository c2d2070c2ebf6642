//! Clouds as Arrow tables that share their memory: the Arrow C stream interface, which pyarrow, polars, DuckDB and
//! others read.

use crate::array::ColumnOwner;
use crate::error::{BindingError, BindingResult};
use arrow_array::ffi_stream::FFI_ArrowArrayStream;
use arrow_array::{
    ArrayRef, Float32Array, Float64Array, RecordBatch, RecordBatchIterator, UInt8Array, UInt16Array, UInt32Array,
};
use arrow_buffer::{Buffer, ScalarBuffer};
use arrow_schema::{DataType, Schema};
use bytes::Bytes;
use echocast::PointCloud;
use echocast::cloud::ColumnType;
use echocast::scene::NameTable;
use pyo3::prelude::*;
use pyo3::types::PyCapsule;
use serde_json::{Map, Value, json};
use std::collections::HashMap;
use std::sync::Arc;

/// `cloud` as a stream of one batch; its schema has the metadata `origin` and the names of labels, as JSON.
pub fn stream<'py>(py: Python<'py>, cloud: &Arc<PointCloud>) -> BindingResult<Bound<'py, PyCapsule>> {
    let table = table(cloud).map_err(|error| BindingError::argument("cloud", error, "one that Arrow can hold"))?;
    let schema = table.schema();
    let stream = FFI_ArrowArrayStream::new(Box::new(RecordBatchIterator::new([Ok(table)], schema)));
    Ok(PyCapsule::new_with_value(py, stream, c"arrow_array_stream")?)
}

fn table(cloud: &Arc<PointCloud>) -> Result<RecordBatch, arrow_schema::ArrowError> {
    let mut columns = Vec::new();
    let mut fields = Vec::new();
    for info in cloud.fields().iter() {
        let held = ColumnOwner::Cloud(cloud.clone(), info.field);
        let (kind, count) = (held.column().kind(), cloud.len());
        let buffer = Buffer::from(Bytes::from_owner(held));
        let (kind, column): (DataType, ArrayRef) = match kind {
            ColumnType::F32 => {
                (DataType::Float32, Arc::new(Float32Array::new(ScalarBuffer::new(buffer, 0, count), None)))
            }
            ColumnType::F64 => {
                (DataType::Float64, Arc::new(Float64Array::new(ScalarBuffer::new(buffer, 0, count), None)))
            }
            ColumnType::U8 => (DataType::UInt8, Arc::new(UInt8Array::new(ScalarBuffer::new(buffer, 0, count), None))),
            ColumnType::U16 => {
                (DataType::UInt16, Arc::new(UInt16Array::new(ScalarBuffer::new(buffer, 0, count), None)))
            }
            ColumnType::U32 => {
                (DataType::UInt32, Arc::new(UInt32Array::new(ScalarBuffer::new(buffer, 0, count), None)))
            }
        };
        fields.push(arrow_schema::Field::new(info.name, kind, false));
        columns.push(column);
    }
    let labels = &cloud.labels;
    let metadata = HashMap::from([
        ("origin".to_owned(), json!(cloud.origin.to_array()).to_string()),
        ("categories".to_owned(), names(&labels.category)),
        ("parts".to_owned(), names(&labels.part)),
        ("instances".to_owned(), names(&labels.instance)),
        ("materials".to_owned(), names(&labels.material)),
    ]);
    RecordBatch::try_new(Arc::new(Schema::new_with_metadata(fields, metadata)), columns)
}

fn names(table: &NameTable) -> String {
    let names: Map<String, Value> = table.iter().map(|(id, name)| (id.to_string(), name.into())).collect();
    Value::Object(names).to_string()
}
