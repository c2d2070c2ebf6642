//! Binary PLY, for viewers.

use super::{Format, FormatInfo, Growing};
use crate::record::{self, BLOCK_BYTES};
use crate::{Column, FieldInfo, FieldSet, PointCloud};
use ground::report::Report;
use ground::write::Sink;
use std::fmt::Write as _;
use std::io::{self, Seek as _, Write as _};
use std::path::Path;

/// Vertices without faces. Property names and types are those that CloudCompare and Open3D both keep: scalars are
/// called `scalar_NAME`, and integers wider than a byte are `int`, because Open3D skips `ushort` and `uint`.
pub(super) struct Ply;

impl Format for Ply {
    fn info(&self) -> &FormatInfo {
        &FormatInfo {
            name: "ply",
            extensions: &["ply"],
            description: "binary little endian PLY; f64 positions, other columns as scalar_NAME, labels as int",
            needs_positions: true,
            // Header lines are ASCII.
            holds_label_names: false,
        }
    }

    fn write(&self, cloud: &PointCloud, path: &Path, report: &mut Report) -> io::Result<()> {
        super::write_alone(PlyFile::create(cloud, path)?, cloud, report)
    }

    fn begin(&self, first: &PointCloud, path: &Path) -> Option<io::Result<Box<dyn Growing>>> {
        Some(PlyFile::create(first, path).map(|file| Box::new(file) as Box<dyn Growing>))
    }
}

/// A file that is being written.
struct PlyFile {
    file: Sink,
    /// Columns with numbers that are too large.
    clamped: FieldSet,
}

impl PlyFile {
    fn create(first: &PointCloud, path: &Path) -> io::Result<PlyFile> {
        let mut file = Sink::create(path)?;
        file.write_all(header(&first.head()).as_bytes())?;
        Ok(PlyFile { file, clamped: FieldSet::EMPTY })
    }
}

impl Growing for PlyFile {
    fn add(&mut self, cloud: &PointCloud) -> io::Result<()> {
        let mut properties = Vec::new();
        let mut size = 0;
        for info in cloud.fields.iter() {
            let property =
                VertexProperty { column: cloud.column(info.field), offset: cloud.offset(info.field), at: size };
            size += property.kind().1;
            properties.push(property);
            if let Column::U32(ids) = cloud.column(info.field)
                && ids.iter().any(|&id| i32::try_from(id).is_err())
            {
                self.clamped = self.clamped.with(info.field);
            }
        }
        let block = BLOCK_BYTES / size;
        let mut buffer = vec![0; block * size];
        for start in (0..cloud.len).step_by(block) {
            let rows = start..cloud.len.min(start + block);
            let records = &mut buffer[..rows.len() * size];
            for property in &properties {
                property.put(records, size, rows.clone());
            }
            self.file.write_all(records)?;
        }
        Ok(())
    }

    fn finish(&mut self, head: &PointCloud, report: &mut Report) -> io::Result<()> {
        for info in self.clamped.iter() {
            report.warn(format!("ply: numbers above {} in {} clamped to it", i32::MAX, info.name));
        }
        // Now that all points are counted.
        self.file.rewind()?;
        self.file.write_all(header(head).as_bytes())?;
        self.file.take_error()
    }
}

/// The header of a cloud with the rows of `head`; its length does not depend on their number.
fn header(head: &PointCloud) -> String {
    let mut text = String::from("ply\nformat binary_little_endian 1.0\n");
    let _ = writeln!(text, "comment echocast {}", env!("CARGO_PKG_VERSION"));
    let mut counts = format!("element vertex {}\n", head.len);
    let mut longest = format!("element vertex {}\n", usize::MAX).len();
    if let Some([rows, columns]) = head.organised {
        counts.insert_str(0, &format!("obj_info num_cols {columns}\nobj_info num_rows {rows}\n"));
        longest += format!("obj_info num_cols {0}\nobj_info num_rows {0}\n", u32::MAX).len();
    }
    let _ = writeln!(text, "comment{}", " ".repeat(longest - counts.len()));
    text += &counts;
    for info in head.fields.iter() {
        let property = VertexProperty { column: head.column(info.field), offset: head.offset(info.field), at: 0 };
        let _ = writeln!(text, "property {} {}", property.kind().0, property_name(info));
    }
    text + "end_header\n"
}

/// Names with a meaning of their own in PLY; all others are scalars.
fn property_name(info: &FieldInfo) -> String {
    match info.name {
        "x" | "y" | "z" | "red" | "green" | "blue" => info.name.into(),
        "normal_x" => "nx".into(),
        "normal_y" => "ny".into(),
        "normal_z" => "nz".into(),
        name => format!("scalar_{name}"),
    }
}

struct VertexProperty<'a> {
    column: Column<'a>,
    /// Added to positions to get f64 world coordinates.
    offset: Option<f64>,
    /// First byte in the record.
    at: usize,
}

impl VertexProperty<'_> {
    /// PLY type and its size.
    fn kind(&self) -> (&'static str, usize) {
        match (self.column, self.offset) {
            (Column::F32(_), Some(_)) | (Column::F64(_), _) => ("double", 8),
            (Column::F32(_), None) => ("float", 4),
            (Column::U8(_), _) => ("uchar", 1),
            (Column::U16(_) | Column::U32(_), _) => ("int", 4),
        }
    }

    fn put(&self, records: &mut [u8], size: usize, rows: std::ops::Range<usize>) {
        let at = self.at;
        match (self.column, self.offset) {
            (Column::F32(c), Some(offset)) => {
                record::put(records, size, at, rows, |row| (f64::from(c[row]) + offset).to_le_bytes());
            }
            (Column::F32(c), None) => record::put(records, size, at, rows, |row| c[row].to_le_bytes()),
            (Column::F64(c), _) => record::put(records, size, at, rows, |row| c[row].to_le_bytes()),
            (Column::U8(c), _) => record::put(records, size, at, rows, |row| [c[row]]),
            (Column::U16(c), _) => record::put(records, size, at, rows, |row| i32::from(c[row]).to_le_bytes()),
            (Column::U32(c), _) => {
                record::put(records, size, at, rows, |row| c[row].min(i32::MAX as u32).to_le_bytes());
            }
        }
    }
}
