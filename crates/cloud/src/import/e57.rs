//! E57, by the crate `e57`: all scans of a file, in world coordinates.

use super::about::{About, pose};
use super::names::{self, NamedColumn};
use super::rows::Rows;
use super::target::FieldTarget;
use super::{Source, contained};
use crate::{Field, FieldSet, Frame, PointCloud};
use ::e57::{E57Reader, PointCloud as Scan, Record, RecordDataType, RecordName, RecordValue, Transform};
use glam::DVec3;
use ground::error::Result;
use ground::pose::Pose;
use ground::read::number::Number;
use ground::report::Report;
use std::f64::consts::FRAC_PI_2;
use std::fs::File;
use std::io::{self, BufReader};

/// Maximum number of attributes of a point: the crate allocates memory for each before it has read any.
const MOST: usize = 80;

/// Number of points that are read before they are added to the columns.
const BLOCK: usize = 4096;

type E57FileReader<'a> = E57Reader<BufReader<&'a File>>;

pub(super) fn read(source: &Source, report: &mut Report) -> Result<PointCloud> {
    let file = source.from(0)?;
    let made = contained(|| E57Reader::new(file).map_err(io::Error::other));
    let mut reader = made.map_err(|error| source.failed(error, "its structure"))?;
    let scans = reader.pointclouds();
    let mut about = About::beside(source.path)?.unwrap_or_default();
    let world = about.frame != Some(Frame::Sensor);
    let mut attributes = Vec::new();
    for scan in &scans {
        attributes.push(E57Prototype::of(scan, source, report)?);
    }
    // The columns that all scans have.
    let all = attributes
        .iter()
        .map(|attributes| attributes.fields())
        .reduce(|all, more| all.iter().map(|info| info.field).filter(|&field| more.contains(field)).collect());
    let fields = all.unwrap_or_else(|| [Field::X, Field::Y, Field::Z].into_iter().collect());
    let mut rows = Rows::new(fields, 0, Some(&about))?;
    let (mut first, mut brightest) = (None, 0.0_f32);
    let mut grid = Some([0, 0]);
    for (scan, attributes) in scans.iter().zip(attributes) {
        let placed = scan.transform.as_ref().map(|transform| pose_of(transform, source)).transpose()?;
        first = first.or(placed);
        let transform = if world { placed.unwrap_or(Pose::IDENTITY) } else { Pose::IDENTITY };
        let taken = attributes.read(&mut reader, scan, transform, fields, source, &mut rows)?;
        grid = grid.zip(taken).and_then(|([rows, columns], [more, same])| {
            let fits = columns == 0 || columns == same;
            rows.checked_add(more).filter(|_| fits).map(|rows| [rows, same])
        });
        brightest = brightest.max(full_scale(scan));
    }
    if about.intensity_full_scale.is_none() && brightest > 0.0 {
        // Some state the maximum of the scan, others that of the instrument.
        let usual = [1.0, 255.0].into_iter().find(|&full| brightest <= full);
        about.intensity_full_scale = Some(usual.or(Some(brightest)));
    }
    if let Some(text) = reader.coordinate_metadata().filter(|text| !text.trim().is_empty()) {
        match crate::Record::of_text(text) {
            Some(system) => about.records.all.push(system),
            None => names::lost(std::iter::once(text), "e57", report),
        }
    }
    about.sensor_pose = about.sensor_pose.or(first);
    about.shape = about.shape.or(grid.filter(|grid| grid[1] > 0));
    rows.finish(source.path, "e57", about, report)
}

fn pose_of(transform: &Transform, source: &Source) -> Result<Pose> {
    let Transform { rotation: q, translation: t } = transform;
    pose([t.x, t.y, t.z], [q.x, q.y, q.z, q.w]).map_err(|message| source.error(message))
}

/// The greatest intensity that the scan states; 0: none.
fn full_scale(scan: &Scan) -> f32 {
    let kind =
        scan.prototype.iter().find(|record| record.name == RecordName::Intensity).map(|record| &record.data_type);
    let most = scan.intensity_limits.as_ref().and_then(|limits| limits.intensity_max.as_ref());
    let most = kind.zip(most).map_or(0.0, |(kind, most)| number(most, kind) as f32);
    if most.is_finite() { most } else { 0.0 }
}

/// The target of a number of a point.
#[derive(Clone, Copy, Debug, PartialEq)]
enum RecordTarget {
    /// A coordinate of this axis; spherical: range, azimuth, elevation.
    Cartesian(usize),
    Spherical(usize),
    /// Whether there are coordinates.
    Invalid,
    Row,
    Column,
    /// Counted from 0.
    ReturnIndex,
    Goal(FieldTarget),
    Nowhere,
}

/// The attributes of the points of a scan.
struct E57Prototype {
    places: Vec<RecordTarget>,
    kinds: Vec<RecordDataType>,
}

impl E57Prototype {
    fn of(scan: &Scan, source: &Source, report: &mut Report) -> Result<E57Prototype> {
        let prototype = &scan.prototype;
        if prototype.is_empty() || prototype.len() > MOST {
            let count = prototype.len();
            return Err(source.error(format!("has points with {count} attributes; allowed: 1 to {MOST}")));
        }
        if prototype.iter().all(|record| is_constant(&record.data_type)) && scan.records > 0 {
            return Err(source.error("has only constant attributes, so that its points are all the same"));
        }
        // A point takes at least one bit.
        if scan.records > source.length.saturating_mul(8) {
            let records = scan.records;
            return Err(source.error(format!("says it has {records} points, and is too short for them")));
        }
        let cartesian = scan.has_cartesian();
        if !cartesian && !scan.has_spherical() {
            return Err(source.error("has a scan without coordinates"));
        }
        let mut names = Vec::new();
        let mut places = Vec::new();
        for record in prototype {
            let place = place(record, cartesian);
            let name = match (&record.name, place) {
                (RecordName::Unknown { name, .. }, _) => name,
                // Used, or a flag of presence.
                _ => "_",
            };
            names.push(NamedColumn::new(name, Number::U8));
            places.push(place);
        }
        // Attributes of extensions are matched by their names.
        let goals = names::goals(&names, "e57", report);
        for (place, goal) in places.iter_mut().zip(goals) {
            if let (RecordTarget::Nowhere, Some(goal)) = (*place, goal)
                && !matches!(goal.field, Field::X | Field::Y | Field::Z)
            {
                *place = RecordTarget::Goal(goal);
            }
        }
        Ok(E57Prototype { places, kinds: prototype.iter().map(|record| record.data_type.clone()).collect() })
    }

    fn fields(&self) -> FieldSet {
        let field = |place: &RecordTarget| match place {
            RecordTarget::Goal(goal) => Some(goal.field),
            RecordTarget::ReturnIndex => Some(Field::ReturnNumber),
            _ => None,
        };
        let axes = [Field::X, Field::Y, Field::Z];
        self.places.iter().filter_map(field).chain(axes).collect()
    }

    /// Adds the points of `scan`, moved by `transform`, to `rows`, with the columns `fields`. Returns the numbers of
    /// rows and columns of the scan if its points fill the grid in order.
    fn read(
        &self,
        reader: &mut E57FileReader,
        scan: &Scan,
        transform: Pose,
        fields: FieldSet,
        source: &Source,
        rows: &mut Rows,
    ) -> Result<Option<[u32; 2]>> {
        let failed = |error: io::Error| source.failed(error, "its points");
        let opened = contained(|| reader.pointcloud_raw(scan).map_err(io::Error::other));
        let mut points = opened.map_err(failed)?;
        let mut block: Vec<Vec<f64>> = vec![Vec::new(); self.places.len()];
        let mut grid = E57Grid::default();
        let mut left = scan.records;
        while left > 0 {
            let count = left.min(BLOCK as u64);
            contained(|| {
                for _ in 0..count {
                    let Some(point) = points.next() else { return Err(io::ErrorKind::UnexpectedEof.into()) };
                    let point = point.map_err(io::Error::other)?;
                    for ((value, kind), column) in point.iter().zip(&self.kinds).zip(&mut block) {
                        column.push(number(value, kind));
                    }
                }
                Ok(())
            })
            .map_err(failed)?;
            self.add(&block, transform, fields, rows)?;
            grid.add(self.column(&block, RecordTarget::Row), self.column(&block, RecordTarget::Column));
            block.iter_mut().for_each(Vec::clear);
            left -= count;
        }
        Ok(grid.shape())
    }

    fn column<'a>(&self, block: &'a [Vec<f64>], place: RecordTarget) -> Option<&'a [f64]> {
        self.places.iter().position(|&other| other == place).map(|index| &*block[index])
    }

    fn add(&self, block: &[Vec<f64>], transform: Pose, fields: FieldSet, rows: &mut Rows) -> Result<()> {
        let rotation = transform.rotation();
        let invalid = self.column(block, RecordTarget::Invalid);
        let of = |place: fn(usize) -> RecordTarget| {
            [0, 1, 2].map(|axis| self.column(block, place(axis)).unwrap_or_default())
        };
        let (cartesian, spherical) = (of(RecordTarget::Cartesian), of(RecordTarget::Spherical));
        let count = block.first().map_or(0, Vec::len);
        let is_there = |row: usize| invalid.is_none_or(|states| states[row] == 0.0);
        let places: Vec<DVec3> = (0..count)
            .map(|row| {
                if !is_there(row) {
                    return DVec3::NAN;
                }
                let [x, y, z] = cartesian;
                let place = if x.is_empty() {
                    let [range, azimuth, elevation] = spherical.map(|column| column[row]);
                    let (sin, cos) = azimuth.sin_cos();
                    let level = range * (FRAC_PI_2 - elevation).sin();
                    DVec3::new(level * cos, level * sin, range * elevation.sin())
                } else {
                    DVec3::new(x[row], y[row], z[row])
                };
                transform.position + rotation * place
            })
            .collect();
        for (axis, field) in [Field::X, Field::Y, Field::Z].into_iter().enumerate() {
            rows.add(field.into(), places.iter().map(move |place| place[axis]))?;
        }
        for (place, column) in self.places.iter().zip(block) {
            match place {
                RecordTarget::Goal(goal) if fields.contains(goal.field) => rows.add(*goal, column.iter().copied())?,
                RecordTarget::ReturnIndex if fields.contains(Field::ReturnNumber) => {
                    let number = |(row, index): (usize, &f64)| if is_there(row) { index + 1.0 } else { 0.0 };
                    rows.add(Field::ReturnNumber.into(), column.iter().enumerate().map(number))?;
                }
                _ => {}
            }
        }
        Ok(())
    }
}

/// The target of the attribute `record`.
fn place(record: &Record, cartesian: bool) -> RecordTarget {
    let colour = |field| {
        let white = match record.data_type {
            RecordDataType::Integer { max, .. } if max > 0 => max as f64,
            RecordDataType::Integer { .. } | RecordDataType::ScaledInteger { .. } => 255.0,
            RecordDataType::Single { .. } | RecordDataType::Double { .. } => 1.0,
        };
        RecordTarget::Goal(FieldTarget::scaled(field, 255.0 / white))
    };
    match record.name {
        RecordName::CartesianX if cartesian => RecordTarget::Cartesian(0),
        RecordName::CartesianY if cartesian => RecordTarget::Cartesian(1),
        RecordName::CartesianZ if cartesian => RecordTarget::Cartesian(2),
        RecordName::CartesianInvalidState if cartesian => RecordTarget::Invalid,
        RecordName::SphericalRange if !cartesian => RecordTarget::Spherical(0),
        RecordName::SphericalAzimuth if !cartesian => RecordTarget::Spherical(1),
        RecordName::SphericalElevation if !cartesian => RecordTarget::Spherical(2),
        RecordName::SphericalInvalidState if !cartesian => RecordTarget::Invalid,
        RecordName::RowIndex => RecordTarget::Row,
        RecordName::ColumnIndex => RecordTarget::Column,
        RecordName::ReturnIndex => RecordTarget::ReturnIndex,
        RecordName::ReturnCount => RecordTarget::Goal(Field::ReturnCount.into()),
        RecordName::Intensity => RecordTarget::Goal(Field::Intensity.into()),
        RecordName::TimeStamp => RecordTarget::Goal(Field::Time.into()),
        RecordName::ColorRed => colour(Field::Red),
        RecordName::ColorGreen => colour(Field::Green),
        RecordName::ColorBlue => colour(Field::Blue),
        _ => RecordTarget::Nowhere,
    }
}

/// Whether all numbers of this type are the same, which take no bits in a file.
fn is_constant(kind: &RecordDataType) -> bool {
    match kind {
        RecordDataType::Integer { min, max } | RecordDataType::ScaledInteger { min, max, .. } => min == max,
        _ => false,
    }
}

fn number(value: &RecordValue, kind: &RecordDataType) -> f64 {
    match (value, kind) {
        (RecordValue::Single(value), _) => f64::from(*value),
        (RecordValue::Double(value), _) => *value,
        (RecordValue::ScaledInteger(value), RecordDataType::ScaledInteger { scale, offset, .. }) => {
            *value as f64 * scale + offset
        }
        (RecordValue::ScaledInteger(value) | RecordValue::Integer(value), _) => *value as f64,
    }
}

/// Rows and columns of points that should fill a grid in order.
struct E57Grid {
    /// Points added so far.
    count: u64,
    columns: u64,
    whole: bool,
}

impl Default for E57Grid {
    fn default() -> Self {
        E57Grid { count: 0, columns: 0, whole: true }
    }
}

impl E57Grid {
    fn add(&mut self, rows: Option<&[f64]>, columns: Option<&[f64]>) {
        let (Some(rows), Some(columns)) = (rows, columns) else {
            self.whole = false;
            return;
        };
        for (&row, &column) in rows.iter().zip(columns) {
            if row == 0.0 {
                self.columns += 1;
            }
            let columns = self.columns as f64;
            self.whole &= row * columns + column == self.count as f64 && column < columns;
            self.count += 1;
        }
    }

    fn shape(&self) -> Option<[u32; 2]> {
        let rows = self.count.checked_div(self.columns).filter(|rows| rows * self.columns == self.count)?;
        let shape = u32::try_from(rows).ok().zip(u32::try_from(self.columns).ok());
        shape.filter(|_| self.whole).map(Into::into)
    }
}
