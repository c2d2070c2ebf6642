//! E57, the exchange format of terrestrial laser scanning (ASTM E2807): one scan for each frame.
//!
//! Written by the crate `e57`. Cartesian coordinates are in the frame of the sensor and the scan has its pose, as
//! surveyors expect; columns that E57 does not define are attributes of an extension, with the names of the columns.

use super::tail::Tail;
use super::{Format, FormatInfo, Growing, NEAR};
use crate::{Column, ColumnType, Field, Frame, PointCloud};
use ::e57::{
    E57Writer, Error, Extension, IntensityLimits, Quaternion, Record, RecordDataType, RecordName, RecordValue,
    Transform, Translation,
};
use glam::DVec3;
use ground::report::Report;
use ground::write::Sink;
use sha2::{Digest as _, Sha256};
use std::error::Error as _;
use std::io;
use std::path::Path;

/// Scans with poses, and rows and columns if they are organised.
pub(super) struct E57;

/// Namespace of our attributes.
const NAMESPACE: &str = "echocast";

/// States of coordinates: present, absent.
const VALID: RecordValue = RecordValue::Integer(0);
const INVALID: RecordValue = RecordValue::Integer(2);

impl Format for E57 {
    fn info(&self) -> &FormatInfo {
        &FormatInfo {
            name: "e57",
            extensions: &["e57"],
            description: "E57, a scan with its pose for each frame; f32 positions in the sensor frame, f64 far from it",
            needs_positions: true,
            holds_label_names: false,
        }
    }

    fn keeps(&self, record: &crate::Record) -> bool {
        // It is written verbatim into XML 1.0, which allows no other characters (2.2 Char).
        let is_char = |c: char| matches!(c, '\t' | '\n' | '\r' | ' '..='\u{fffd}' | '\u{10000}'..);
        record.text().is_some_and(|text| !text.contains("]]>") && text.chars().all(is_char))
    }

    fn write(&self, cloud: &PointCloud, path: &Path, report: &mut Report) -> io::Result<()> {
        super::write_alone(E57File::create(cloud, path)?, cloud, report)
    }

    fn begin(&self, first: &PointCloud, path: &Path) -> Option<io::Result<Box<dyn Growing>>> {
        Some(E57File::create(first, path).map(|file| Box::new(file) as Box<dyn Growing>))
    }
}

/// A file that is being written.
struct E57File {
    writer: E57Writer<Tail>,
    /// Scans so far.
    scans: u32,
}

impl E57File {
    fn create(first: &PointCloud, path: &Path) -> io::Result<E57File> {
        let mut writer = E57Writer::new(Tail::of(Sink::create(path)?), &guid(first, None)).map_err(io_error)?;
        let extension = Extension { namespace: NAMESPACE.into(), url: format!("urn:{NAMESPACE}:1") };
        writer.register_extension(extension).map_err(io_error)?;
        let system = first.records.all.iter().find(|record| E57.keeps(record)).and_then(crate::Record::text);
        writer.set_coordinate_metadata(system.map(str::to_owned));
        Ok(E57File { writer, scans: 0 })
    }
}

impl Growing for E57File {
    fn add(&mut self, cloud: &PointCloud) -> io::Result<()> {
        // Readers fail on scans without points.
        if cloud.len == 0 {
            return Ok(());
        }
        let pose = &cloud.sensor_pose;
        let inverse = pose.orientation.inverse();
        let c = &cloud.columns;
        // In the frame of the sensor.
        let place = |row: usize| {
            let place = DVec3::new(f64::from(c.x[row]), f64::from(c.y[row]), f64::from(c.z[row]));
            match cloud.frame {
                Frame::World => inverse * (place + cloud.origin - pose.position),
                Frame::Sensor => place + cloud.origin,
            }
        };
        let far = (0..cloud.len).map(&place).any(|place| place.is_finite() && place.abs().max_element() > NEAR);
        let attributes = Attribute::of(cloud, far);
        let prototype = attributes.iter().map(Attribute::record).collect();
        let mut scan = self.writer.add_pointcloud(&guid(cloud, Some(self.scans)), prototype).map_err(io_error)?;
        self.scans += 1;
        scan.set_name(Some(format!("frame {}", self.scans)));
        // The scalar part is not negative there.
        let q = if pose.orientation.w < 0.0 { -pose.orientation } else { pose.orientation };
        scan.set_transform(Some(Transform {
            rotation: Quaternion { w: q.w, x: q.x, y: q.y, z: q.z },
            translation: Translation { x: pose.position.x, y: pose.position.y, z: pose.position.z },
        }));
        if let (Some(full), false) = (cloud.intensity_full_scale, cloud.columns.intensity.is_empty()) {
            let limit = |value| Some(RecordValue::Single(value));
            scan.set_intensity_limits(Some(IntensityLimits { intensity_min: limit(0.0), intensity_max: limit(full) }));
        }
        for row in 0..cloud.len {
            let place = place(row);
            let values = attributes.iter().map(|attribute| attribute.value(place, row)).collect();
            scan.add_point(values).map_err(io_error)?;
        }
        scan.finalize().map_err(io_error)
    }

    fn finish(&mut self, _: &PointCloud, _: &mut Report) -> io::Result<()> {
        self.writer.finalize().map_err(io_error)
    }
}

/// An identifier for `cloud`, the same for the same cloud: that of the scan `number`, or of the file that it starts.
fn guid(cloud: &PointCloud, number: Option<u32>) -> String {
    let mut digest = Sha256::new();
    digest.update(number.map_or([0; 4], |number| (number + 1).to_le_bytes()));
    let c = &cloud.columns;
    [&c.x, &c.y, &c.z].iter().for_each(|axis| digest.update(bytemuck::cast_slice::<f32, u8>(axis)));
    let pose = &cloud.sensor_pose;
    digest.update(bytemuck::bytes_of(&[pose.position.to_array(), cloud.origin.to_array()]));
    let hex: Vec<String> = digest.finalize().iter().map(|byte| format!("{byte:02x}")).collect();
    format!(
        "{{{}-{}-{}-{}-{}}}",
        hex[..4].concat(),
        hex[4..6].concat(),
        hex[6..8].concat(),
        hex[8..10].concat(),
        hex[10..16].concat()
    )
}

fn io_error(error: Error) -> io::Error {
    // The system's own message, if it caused the error.
    match error.source().and_then(|source| source.downcast_ref::<io::Error>()).and_then(io::Error::raw_os_error) {
        Some(code) => io::Error::from_raw_os_error(code),
        None => io::Error::other(error),
    }
}

/// An attribute of the points of a scan.
struct Attribute<'a> {
    name: RecordName,
    values: E57Values<'a>,
}

enum E57Values<'a> {
    /// Coordinate along this axis in the sensor frame, as f32.
    Place(usize),
    /// The same as f64, for clouds that reach far from the sensor.
    FarPlace(usize),
    /// Whether there are coordinates.
    State,
    /// Row or column in an organised cloud with this number of columns.
    Row(u32),
    Column(u32),
    Numbers(Column<'a>),
    /// Counts from 1, whereas E57 counts from 0; a beam without a return has 0 in both.
    ReturnIndex(&'a [u8]),
    /// A true position, with its coordinate of the origin.
    Position(&'a [f32], f64),
}

impl<'a> Attribute<'a> {
    /// The attributes of `cloud`; `far`: it reaches far from the sensor.
    fn of(cloud: &'a PointCloud, far: bool) -> Vec<Attribute<'a>> {
        let c = &cloud.columns;
        let mut all = Vec::new();
        let mut add = |name, values| all.push(Attribute { name, values });
        let axes = [RecordName::CartesianX, RecordName::CartesianY, RecordName::CartesianZ];
        let place = if far { E57Values::FarPlace } else { E57Values::Place };
        axes.into_iter().enumerate().for_each(|(axis, name)| add(name, place(axis)));
        let misses = [&c.x, &c.y, &c.z].into_iter().flatten().any(|x| !x.is_finite());
        if misses {
            add(RecordName::CartesianInvalidState, E57Values::State);
        }
        if let Some([_, columns]) = cloud.organised {
            add(RecordName::RowIndex, E57Values::Row(columns));
            add(RecordName::ColumnIndex, E57Values::Column(columns));
        }
        // E57 has all three of a colour, and both of a return, or none.
        let all_of = |fields: &[Field]| fields.iter().all(|&field| cloud.fields.contains(field));
        let coloured = all_of(&[Field::Red, Field::Green, Field::Blue]);
        let returns = all_of(&[Field::ReturnNumber, Field::ReturnCount]);
        for info in cloud.fields.iter() {
            let column = E57Values::Numbers(cloud.column(info.field));
            match info.field {
                Field::X | Field::Y | Field::Z => {}
                Field::Intensity => add(RecordName::Intensity, column),
                Field::Time => add(RecordName::TimeStamp, column),
                Field::Red if coloured => add(RecordName::ColorRed, column),
                Field::Green if coloured => add(RecordName::ColorGreen, column),
                Field::Blue if coloured => add(RecordName::ColorBlue, column),
                Field::ReturnNumber if returns => {
                    add(RecordName::ReturnIndex, E57Values::ReturnIndex(&c.return_number))
                }
                Field::ReturnCount if returns => add(RecordName::ReturnCount, column),
                _ => {
                    let name = RecordName::Unknown { namespace: NAMESPACE.into(), name: info.name.into() };
                    match (cloud.column(info.field), cloud.offset(info.field)) {
                        (Column::F32(positions), Some(offset)) => add(name, E57Values::Position(positions, offset)),
                        _ => add(name, column),
                    }
                }
            }
        }
        all
    }

    fn record(&self) -> Record {
        const SINGLE: RecordDataType = RecordDataType::Single { min: None, max: None };
        const DOUBLE: RecordDataType = RecordDataType::Double { min: None, max: None };
        let up_to = |max| RecordDataType::Integer { min: 0, max };
        let data_type = match &self.values {
            E57Values::Place(_) => SINGLE,
            E57Values::FarPlace(_) => DOUBLE,
            E57Values::State => up_to(2),
            E57Values::Row(_) | E57Values::Column(_) => up_to(u32::MAX.into()),
            E57Values::ReturnIndex(_) => up_to(u8::MAX.into()),
            E57Values::Position(..) => DOUBLE,
            E57Values::Numbers(column) => match column.kind() {
                ColumnType::F32 => SINGLE,
                ColumnType::F64 => DOUBLE,
                ColumnType::U8 => up_to(u8::MAX.into()),
                ColumnType::U16 => up_to(u16::MAX.into()),
                ColumnType::U32 => up_to(u32::MAX.into()),
            },
        };
        Record { name: self.name.clone(), data_type }
    }

    /// The value of row `row`, at `place` in the sensor frame.
    fn value(&self, place: DVec3, row: usize) -> RecordValue {
        let here = place.is_finite();
        match &self.values {
            E57Values::Place(axis) => RecordValue::Single(if here { place[*axis] as f32 } else { 0.0 }),
            E57Values::FarPlace(axis) => RecordValue::Double(if here { place[*axis] } else { 0.0 }),
            E57Values::State => {
                if here {
                    VALID
                } else {
                    INVALID
                }
            }
            E57Values::Row(columns) => RecordValue::Integer((row / *columns as usize) as i64),
            E57Values::Column(columns) => RecordValue::Integer((row % *columns as usize) as i64),
            E57Values::ReturnIndex(numbers) => RecordValue::Integer(i64::from(numbers[row]).saturating_sub(1).max(0)),
            E57Values::Position(positions, offset) => RecordValue::Double(f64::from(positions[row]) + offset),
            E57Values::Numbers(column) => match *column {
                Column::F32(c) => RecordValue::Single(c[row]),
                Column::F64(c) => RecordValue::Double(c[row]),
                Column::U8(c) => RecordValue::Integer(c[row].into()),
                Column::U16(c) => RecordValue::Integer(c[row].into()),
                Column::U32(c) => RecordValue::Integer(c[row].into()),
            },
        }
    }
}
