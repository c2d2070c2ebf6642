//! The labelled point cloud: one column each for position, range, labels and whatever else was requested.

#[doc(inline)]
pub use cloud::{Column, ColumnType, Columns, FIELDS, FieldInfo, FieldSource, PointField, Record, Records, Slices};
