//! The cloud itself: what a scan returns.

use super::{Column, Columns, Driver, Field, FieldSet, InstanceBox, Records, ScanLine, Slices};
use echocast_memory::tried;
use glam::DVec3;
use ground::error::{Error, Result};
use ground::named;
use ground::pose::Pose;
use model::Labels;
use std::sync::Arc;

/// Coordinates of the output points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Frame {
    /// World, z up.
    #[default]
    World,
    /// Sensor frame at the time of each firing, or at the start of the scan (`ScanOptions::deskew`): x
    /// forward, y left, z up.
    Sensor,
}

named! { Frame: World "world", Sensor "sensor" }

/// What a scan returns: columns of equal length, one row per return (or per beam when organised).
#[derive(Clone, Debug)]
pub struct PointCloud {
    /// World (or sensor) coordinates of position 0, 0, 0, metres; add it to `x`, `y`, `z`.
    pub origin: DVec3,
    /// Each is empty or has `len` rows.
    #[doc(hidden)]
    pub columns: Columns,
    /// None of them is empty, unless there are no rows.
    #[doc(hidden)]
    pub fields: FieldSet,
    /// Number of rows.
    #[doc(hidden)]
    pub len: usize,
    /// Their product is `len`.
    #[doc(hidden)]
    pub organised: Option<[u32; 2]>,
    /// Frame of `x`, `y`, `z`, the normals and the boxes.
    pub frame: Frame,
    /// World pose of the sensor at the start of the (first) scan.
    pub sensor_pose: Pose,
    /// When the (first) scan starts, s since the start of the run; `None`: unknown, as for clouds that do not come from
    /// a scan.
    pub start_time: Option<f64>,
    /// Reading of the trajectory's clock at time 0 of the run, s:
    /// [`Trajectory::time_zero`](emitter::trajectory::Trajectory::time_zero).
    pub time_zero: f64,
    /// Full scale of `intensity`: 1, or 255 for 8-bit encodings; relative energy and the levels of sonars (dB) have
    /// none.
    pub intensity_full_scale: Option<f32>,
    /// Number of light rays traced, including those of beams that take several rays, at edges, and behind mirrors and
    /// glass. 0 for clouds that do not come from a scan, and for sonars, whose rays `Sensor::ray_count`
    /// counts.
    pub rays: u64,
    /// Most rays that a beam was given, apart from those behind mirrors and glass: what `beam.sub_rays` allows, or less
    /// if `ScanOptions::time_budget` requires it. 0 where `rays` is 0.
    pub most_rays: u32,
    /// The ROS 2 driver that publishes such clouds, that of the sensor's maker (`SensorSpec::driver`); `None`:
    /// unknown.
    pub driver: Option<Driver>,
    /// The beams of a LiDAR with a single ring, which a `LaserScan` describes; `None`: it has others, or is unknown, as for
    /// clouds from files.
    pub scan_line: Option<ScanLine>,
    /// Boxes around labelled instances, if requested (`ScanOptions::boxes`): sorted by frame, then by
    /// ascending `instance_id`.
    pub boxes: Option<Vec<InstanceBox>>,
    /// Names of the numbers in the label columns.
    pub labels: Arc<Labels>,
    /// The coordinate system, and whatever else a survey file contained in addition to its points.
    pub records: Arc<Records>,
    /// Coordinates of the world's origin in that system, m: LAS holds coordinates of the system, other formats those of
    /// the world.
    pub earth_offset: DVec3,
}

impl Default for PointCloud {
    /// An empty cloud without columns: what `BuiltScene::scan_into` fills.
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
            most_rays: 0,
            driver: None,
            scan_line: None,
            boxes: None,
            labels: Arc::default(),
            records: Arc::default(),
            earth_offset: DVec3::ZERO,
        }
    }
}

impl PointCloud {
    /// A cloud of `len` rows of zeros with the columns `fields`, for points from elsewhere: [`PointCloud::columns_mut`]
    /// fills it.
    ///
    /// # Errors
    /// No memory.
    pub fn new(fields: FieldSet, len: usize) -> Result<PointCloud> {
        let mut cloud = PointCloud { fields, len, ..PointCloud::default() };
        cloud.columns.resize(fields, len)?;
        Ok(cloud)
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// The data; a column that was not requested is empty.
    pub fn columns(&self) -> &Columns {
        &self.columns
    }

    /// Which columns are present: those that are written.
    pub fn fields(&self) -> FieldSet {
        self.fields
    }

    /// `[rows, columns]` of the sensor if every beam has a row (misses are NaN).
    pub fn organised(&self) -> Option<[u32; 2]> {
        self.organised
    }

    /// The data, to change values in place.
    pub fn columns_mut(&mut self) -> Slices<'_> {
        self.columns.slices(0, self.len)
    }

    /// The data alone.
    pub fn into_columns(self) -> Columns {
        self.columns
    }

    /// Restricts the columns that are written to `fields`; [`PointCloud::columns`] keeps the others.
    ///
    /// # Errors
    /// A column that the cloud does not have.
    pub fn set_fields(&mut self, fields: FieldSet) -> Result<()> {
        if let Some(info) = fields.iter().find(|info| self.column(info.field).len() != self.len) {
            let found = format!("without {}", info.name);
            return Err(Error::invalid("cloud", found, "columns that it has"));
        }
        self.fields = fields;
        Ok(())
    }

    /// States that the rows are those of a sensor with `shape`, rows and columns of beams, or of none.
    ///
    /// # Errors
    /// Another number of beams than rows.
    pub fn set_organised(&mut self, shape: Option<[u32; 2]>) -> Result<()> {
        if let Some([rows, columns]) = shape.filter(|[rows, columns]| *rows as usize * *columns as usize != self.len) {
            let allowed = format!("{} beams, one for each row of the cloud", self.len);
            return Err(Error::invalid("rows x columns", format!("{rows} x {columns}"), allowed));
        }
        self.organised = shape;
        Ok(())
    }

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
    /// [`Error::Missing`] if there is no such column at all.
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
    #[doc(hidden)]
    pub fn offset(&self, field: Field) -> Option<f64> {
        offset(self.origin, field)
    }

    /// Sorts the rows by the `time` column; rows with the same time keep their order.
    ///
    /// # Errors
    /// No memory; the columns are then unusable.
    #[doc(hidden)]
    pub fn sort_by_time(&mut self) -> Result<()> {
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
    #[doc(hidden)]
    pub fn head(&self) -> PointCloud {
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
    #[doc(hidden)]
    pub fn lengthen(&mut self, other: &PointCloud) -> Result<()> {
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
        self.scan_line = self.scan_line.filter(|_| self.scan_line == other.scan_line);
        self.len += other.len;
        self.rays += other.rays;
        Ok(())
    }
}

/// What to add to a column of positions relative to `origin`; `None` for other columns.
pub(super) fn offset(origin: DVec3, field: Field) -> Option<f64> {
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
    fn columns_always_have_the_rows_of_their_cloud() {
        let fields = FieldSet::EMPTY.with(Field::Range).with(Field::Beam);
        let mut cloud = PointCloud::new(fields, 6).unwrap();
        cloud.columns_mut().range.fill(2.0);
        assert_eq!(
            (cloud.columns().range(), cloud.columns().beam(), cloud.columns().x()),
            (&[2.0; 6][..], &[0; 6][..], &[][..])
        );
        let error = cloud.set_fields(fields.with(Field::Time)).unwrap_err().to_string();
        assert_eq!(error, "cloud is without time; allowed: columns that it has");
        cloud.set_fields(FieldSet::EMPTY.with(Field::Beam)).unwrap();
        assert_eq!(cloud.columns().range().len(), 6, "it is only not written");
        let error = cloud.set_organised(Some([2, 2])).unwrap_err().to_string();
        assert_eq!(error, "rows x columns is 2 x 2; allowed: 6 beams, one for each row of the cloud");
        cloud.set_organised(Some([2, 3])).unwrap();
        assert_eq!(cloud.organised(), Some([2, 3]));
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
