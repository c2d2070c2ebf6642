//! The labelled point cloud: one column each for position, range, labels and whatever else was requested.

pub(crate) mod boxes;
mod collect;
pub(crate) mod driver;
mod driver_points;
pub(crate) mod fields;
pub(crate) mod pack;
pub(crate) mod ping;
pub(crate) mod points;
pub(crate) mod record;
mod records;

pub(crate) use boxes::{BoxAxes, BoxTime, InstanceBox};
pub(crate) use collect::Kept;
pub(crate) use driver::Driver;
pub use driver_points::PointField;
pub use fields::{Column, ColumnType, Columns, FIELDS, FieldInfo, FieldSource, Slices};
pub(crate) use fields::{ColumnMut, Element, FLOW, VELOCITY, put};
pub(crate) use fields::{Field, FieldSet};
pub(crate) use pack::{PackItem, PackType};
pub(crate) use ping::{CELL_FIELDS, Ping, Pings};
pub(crate) use points::{Frame, PointCloud};
pub use records::{Record, Records};
