//! The labelled point cloud: one column each for position, range, labels and whatever else was requested.
#![forbid(unsafe_code)]

// So that what makes pings for tests also belongs to the tests of other crates.
#[cfg(test)]
extern crate self as cloud;

pub mod boxes;
pub mod cells;
mod collect;
pub mod driver;
mod driver_points;
pub mod export;
pub mod fields;
pub mod image;
pub mod import;
pub mod messages;
mod pack;
pub mod ping;
mod ping_points;
pub mod points;
pub mod radar_frame;
pub(crate) mod record;
mod records;
mod scan_line;
#[cfg(test)]
mod test_sensor;

pub use boxes::{BoxAxes, BoxTime, InstanceBox};
pub use collect::Kept;
pub use driver::Driver;
pub use driver_points::PointField;
pub use fields::{
    Column, ColumnMut, ColumnType, Columns, Element, FIELDS, FLOW, Field, FieldInfo, FieldSet, FieldSource, Slices,
    VELOCITY,
};
pub use pack::{PackItem, PackType};
pub use ping::{CELL_FIELDS, Ping, Pings};
pub use ping_points::PointOptions;
pub use points::{Frame, PointCloud};
pub use radar_frame::{PolarImage, RadarFrame, RawSamples};
pub use records::{Record, Records};
pub use scan_line::ScanLine;
