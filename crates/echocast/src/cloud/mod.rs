//! The labelled point cloud: one column each for position, range, labels and whatever else was requested.

mod boxes;
mod collect;
mod driver;
mod fields;
mod pack;
mod ping;
pub(crate) mod record;
mod records;

pub use boxes::{BoxAxes, BoxTime, InstanceBox};
pub(crate) use collect::Kept;
pub use driver::{Driver, PointField};
pub(crate) use fields::{BOTTOM_TRACK, ColumnMut, Element, FLOW, MOVING, SOUNDING, Slices, VELOCITY, WATER_TRACK, put};
pub use fields::{Column, ColumnType, Columns, FIELDS, Field, FieldInfo, FieldSet};
pub use pack::{PackItem, PackType};
pub use ping::{CELL_FIELDS, Ping, Pings};
pub use records::{Record, Records};

use crate::ground::error::{Error, Result};
use crate::ground::named::named;
use crate::ground::pose::Pose;
use crate::scene::Labels;
use echocast_memory::tried;
use glam::DVec3;
use std::sync::Arc;

/// Coordinates of the output points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Frame {
    /// World, z up.
    #[default]
    World,
    /// Sensor frame at the time of each firing, or at the start of the scan ([`crate::ScanOptions::deskew`]): x
    /// forward, y left, z up.
    Sensor,
}

named! { Frame: World "world", Sensor "sensor" }

/// What a scan returns: columns of equal length, one row per return (or per beam when organised).
#[derive(Clone, Debug)]
pub struct PointCloud {
    /// World (or sensor) coordinates of position 0, 0, 0, metres; add it to `x`, `y`, `z`.
    pub origin: DVec3,
    /// The data; a column that was not requested is empty.
    pub columns: Columns,
    /// Which columns are present.
    pub fields: FieldSet,
    /// Number of rows.
    pub len: usize,
    /// `[rows, columns]` of the sensor if every beam has a row (misses are NaN).
    pub organised: Option<[u32; 2]>,
    /// Frame of `x`, `y`, `z`, the normals and the boxes.
    pub frame: Frame,
    /// World pose of the sensor at the start of the (first) scan.
    pub sensor_pose: Pose,
    /// When the (first) scan starts, s since the start of the run; `None`: unknown, as for clouds that do not come from
    /// a scan.
    pub start_time: Option<f64>,
    /// Reading of the trajectory's clock at time 0 of the run, s:
    /// [`Trajectory::time_zero`](crate::Trajectory::time_zero).
    pub time_zero: f64,
    /// Full scale of `intensity`: 1, or 255 for 8-bit encodings; relative energy and the levels of sonars (dB) have
    /// none.
    pub intensity_full_scale: Option<f32>,
    /// Number of light rays traced, including those of beams that take several rays, at edges, and behind mirrors and
    /// glass. 0 for clouds that do not come from a scan, and for sonars, whose rays [`crate::Sensor::ray_count`]
    /// counts.
    pub rays: u64,
    /// The ROS 2 driver that publishes such clouds, that of the sensor's maker ([`crate::SensorSpec::driver`]); `None`:
    /// unknown.
    pub driver: Option<Driver>,
    /// Boxes around labelled instances, if requested ([`crate::ScanOptions::boxes`]): sorted by frame, then by
    /// ascending `instance_id`.
    pub boxes: Option<Vec<InstanceBox>>,
    /// Names of the numbers in the label columns.
    pub labels: Arc<Labels>,
    /// The coordinate system, and whatever else a survey file contained in addition to its points.
    pub records: Arc<Records>,
}

impl Default for PointCloud {
    /// An empty cloud without columns: what [`crate::BuiltScene::scan_into`] fills.
    fn default() -> Self {
        PointCloud {
            origin: DVec3::ZERO,
            columns: Columns::default(),
            fields: FieldSet::EMPTY,
            len: 0,
            organised: None,
            frame: Frame::World,
            sensor_pose: Pose::IDENTITY,
            start_time: None,
            time_zero: 0.0,
            intensity_full_scale: Some(1.0),
            rays: 0,
            driver: None,
            boxes: None,
            labels: Arc::default(),
            records: Arc::default(),
        }
    }
}

impl PointCloud {
    /// Start of the cloud, s since the start of the run: that of its scan, else the time of its first point, else 0.
    pub fn begins(&self) -> f64 {
        let first = || self.columns.time.iter().copied().filter(|time| time.is_finite()).min_by(f64::total_cmp);
        self.start_time.or_else(first).unwrap_or(0.0)
    }

    /// Column `field`; empty when it was not computed.
    pub fn column(&self, field: Field) -> Column<'_> {
        self.columns.get(field)
    }

    /// Column called `name`.
    ///
    /// # Errors
    /// [`crate::Error::Missing`] if there is no such column at all.
    pub fn column_by_name(&self, name: &str) -> Result<Column<'_>> {
        Ok(self.column(Field::from_name(name)?))
    }

    /// World (or sensor) position of row `row`, metres, f64.
    ///
    /// # Panics
    /// If there is no such row, or `x`, `y` or `z` was not computed.
    pub fn position(&self, row: usize) -> DVec3 {
        let c = &self.columns;
        self.origin + DVec3::new(f64::from(c.x[row]), f64::from(c.y[row]), f64::from(c.z[row]))
    }

    /// Rows that are returns: all but the misses of an organised cloud, if a column shows which they are.
    pub fn return_rows(&self) -> impl Iterator<Item = usize> {
        /// Columns that only returns have: misses are NaN.
        const ONLY_RETURNS: [Field; 5] = [Field::X, Field::Range, Field::TrueRange, Field::Intensity, Field::NormalX];
        let marking = ONLY_RETURNS.map(|field| self.column(field)).into_iter().find(|column| !column.is_empty());
        let marking = marking.filter(|_| self.organised.is_some());
        (0..self.len).filter(move |&row| marking.is_none_or(|column| !column.get_f64(row).is_nan()))
    }

    /// What to add to a column of positions to get f64 world (or sensor) coordinates; `None` for other columns.
    pub(crate) fn offset(&self, field: Field) -> Option<f64> {
        offset(self.origin, field)
    }

    /// Checks that the columns are as long as the cloud: they are public, so they may disagree.
    pub(crate) fn check(&self) -> Result<()> {
        match self.fields.iter().find(|info| self.column(info.field).len() != self.len) {
            None => Ok(()),
            Some(info) => Err(Error::invalid(
                format!("column {}", info.name),
                format!("{} rows long", self.column(info.field).len()),
                format!("the cloud's {} rows", self.len),
            )),
        }
    }

    /// Sorts the rows by the `time` column; rows with the same time keep their order.
    ///
    /// # Errors
    /// No memory; the columns are then unusable.
    pub(crate) fn sort_by_time(&mut self) -> Result<()> {
        let times = &self.columns.time;
        let mut order = Vec::new();
        tried(|| order.try_reserve_exact(self.len))
            .map_err(|_| Error::Memory(format!("the order of {} rows", self.len)))?;
        order.extend(0..self.len);
        // Rows with the same time keep their order, without the memory that a stable sort needs.
        order.sort_unstable_by(|&a, &b| times[a].total_cmp(&times[b]).then(a.cmp(&b)));
        self.columns.permute(&order)
    }

    /// Appends the rows of `other`, a later scan of the same scene with the same columns.
    ///
    /// # Errors
    /// When origins, frames, columns, intensity scales or labels differ, or only one has boxes; more than 4,294,967,295
    /// rows of an organised cloud; no memory.
    pub fn append(&mut self, other: &PointCloud) -> Result<()> {
        if self.len == 0 && self.fields == FieldSet::EMPTY {
            *self = other.clone();
            return Ok(());
        }
        self.lengthen(other)?;
        self.columns.reserve(&other.columns)?;
        self.columns.append(&other.columns);
        if let (Some(boxes), Some(more)) = (&mut self.boxes, &other.boxes) {
            boxes.extend_from_slice(more);
        }
        Ok(())
    }

    /// A cloud of the rows `rows`, in that order, not organised; boxes are kept.
    ///
    /// # Errors
    /// A row that does not exist; no memory.
    pub fn select(&self, rows: &[usize]) -> Result<PointCloud> {
        self.check()?;
        if let Some(row) = rows.iter().find(|&&row| row >= self.len) {
            return Err(Error::invalid("row", row, format!("below {}, the length of the cloud", self.len)));
        }
        Ok(PointCloud {
            columns: self.columns.gather(rows)?,
            len: rows.len(),
            organised: None,
            boxes: self.boxes.clone(),
            ..self.head()
        })
    }

    /// The cloud without its rows and boxes.
    pub(crate) fn head(&self) -> PointCloud {
        PointCloud {
            columns: Columns::default(),
            len: 0,
            organised: self.organised.map(|[_, columns]| [0, columns]),
            boxes: self.boxes.as_ref().map(|_| Vec::new()),
            labels: Arc::clone(&self.labels),
            records: Arc::clone(&self.records),
            ..*self
        }
    }

    /// Counts the rows of `other`, which follow those of `self`.
    ///
    /// # Errors
    /// As [`PointCloud::append`], except for memory.
    pub(crate) fn lengthen(&mut self, other: &PointCloud) -> Result<()> {
        let same = self.origin == other.origin
            && self.frame == other.frame
            && self.fields == other.fields
            && self.intensity_full_scale == other.intensity_full_scale
            && self.boxes.is_some() == other.boxes.is_some()
            && self.labels == other.labels;
        if !same {
            return Err(Error::invalid(
                "cloud to append",
                "of another origin, frame, set of columns, intensity scale or labels, or as to boxes",
                "a scan of the same scene with the same options",
            ));
        }
        self.organised = match (self.organised, other.organised) {
            (Some([rows, columns]), Some([more, same])) if columns == same => {
                let sum = rows.checked_add(more).ok_or_else(|| {
                    let found = format!("{more} rows of beams long, after {rows}");
                    Error::invalid("cloud to append", found, format!("{} rows together", u32::MAX))
                })?;
                Some([sum, columns])
            }
            _ => None,
        };
        self.driver = self.driver.filter(|_| self.driver == other.driver);
        self.len += other.len;
        self.rays += other.rays;
        Ok(())
    }
}

/// What to add to a column of positions relative to `origin`; `None` for other columns.
fn offset(origin: DVec3, field: Field) -> Option<f64> {
    match field {
        Field::X | Field::TrueX | Field::CorrectedX => Some(origin.x),
        Field::Y | Field::TrueY | Field::CorrectedY => Some(origin.y),
        Field::Z | Field::TrueZ | Field::CorrectedZ => Some(origin.z),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clouds_are_appended_only_if_they_fit_together() {
        let mut cloud = PointCloud { organised: Some([2, 0]), ..PointCloud::default() };
        cloud.fields = cloud.fields.with(Field::Range);
        let mut more = cloud.clone();
        cloud.append(&more).unwrap();
        assert_eq!(cloud.organised, Some([4, 0]));
        more.organised = Some([u32::MAX, 0]);
        let error = cloud.append(&more).unwrap_err().to_string();
        assert!(error.contains("4294967295 rows of beams long, after 4"), "{error}");
        assert_eq!(cloud.organised, Some([4, 0]));
        more.intensity_full_scale = None;
        assert!(cloud.append(&more).unwrap_err().to_string().contains("intensity scale"));
    }

    #[test]
    fn rows_of_one_time_keep_their_order() {
        let mut cloud = PointCloud { len: 4, ..PointCloud::default() };
        cloud.columns.time = vec![2.0, 1.0, 2.0, 0.0];
        cloud.columns.beam = vec![0, 1, 2, 3];
        cloud.sort_by_time().unwrap();
        assert_eq!(cloud.columns.beam, [3, 1, 0, 2]);
    }
}
