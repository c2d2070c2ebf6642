//! Binary PLY, for viewers.

use super::{Format, Sink};
use crate::cloud::record::{self, BLOCK_BYTES};
use crate::cloud::{Column, FieldInfo, PointCloud};
use crate::ground::report::Report;
use std::fmt::Write as _;
use std::io::{self, Write as _};
use std::path::Path;

/// Vertices without faces. Property names and types are those that CloudCompare and Open3D both keep: scalars are
/// called `scalar_NAME`, and integers wider than a byte are `int`, for Open3D skips `ushort` and `uint`.
pub(super) struct Ply;

impl Format for Ply {
    fn name(&self) -> &'static str {
        "ply"
    }

    fn extensions(&self) -> &'static [&'static str] {
        &["ply"]
    }

    fn description(&self) -> &'static str {
        "binary little endian PLY; f64 positions, other columns as scalar_NAME, labels as int"
    }

    fn holds(&self, _: &FieldInfo) -> bool {
        true
    }

    fn needs_positions(&self) -> bool {
        true
    }

    fn holds_label_names(&self) -> bool {
        false // header lines are ASCII
    }

    fn write(&self, cloud: &PointCloud, path: &Path, report: &mut Report) -> io::Result<()> {
        let mut header = String::from("ply\nformat binary_little_endian 1.0\n");
        let _ = writeln!(header, "comment echocast {}", env!("CARGO_PKG_VERSION"));
        if let Some([rows, columns]) = cloud.organised {
            let _ = writeln!(header, "obj_info num_cols {columns}\nobj_info num_rows {rows}");
        }
        let _ = writeln!(header, "element vertex {}", cloud.len);
        let mut properties = Vec::new();
        let mut size = 0;
        for info in cloud.fields.iter() {
            let property = Property { column: cloud.column(info.field), offset: cloud.offset(info.field), at: size };
            let (kind, bytes) = property.kind();
            let _ = writeln!(header, "property {kind} {}", property_name(info));
            size += bytes;
            properties.push(property);
            if let Column::U32(ids) = cloud.column(info.field)
                && ids.iter().any(|&id| i32::try_from(id).is_err())
            {
                report.warn(format!("ply: numbers above {} in {} written as that", i32::MAX, info.name));
            }
        }
        header.push_str("end_header\n");
        let mut file = Sink::create(path)?;
        file.write_all(header.as_bytes())?;
        let block = BLOCK_BYTES / size;
        let mut buffer = vec![0; block * size];
        for start in (0..cloud.len).step_by(block) {
            let rows = start..cloud.len.min(start + block);
            let records = &mut buffer[..rows.len() * size];
            for property in &properties {
                property.put(records, size, rows.clone());
            }
            file.write_all(records)?;
        }
        file.finish()
    }
}

/// Names with a meaning of their own in PLY; all else are scalars.
fn property_name(info: &FieldInfo) -> String {
    match info.name {
        "x" | "y" | "z" | "red" | "green" | "blue" => info.name.into(),
        "normal_x" => "nx".into(),
        "normal_y" => "ny".into(),
        "normal_z" => "nz".into(),
        name => format!("scalar_{name}"),
    }
}

struct Property<'a> {
    column: Column<'a>,
    /// What makes positions f64 world coordinates.
    offset: Option<f64>,
    /// First byte in the record.
    at: usize,
}

impl Property<'_> {
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
