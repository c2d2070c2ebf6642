//! PCD, the format of the Point Cloud Library: version 0.7, binary, as text, and compressed.
//!
//! Layout: "The PCD (Point Cloud Data) file format" of the PCL documentation. Compressed data is column after column,
//! by LZF, whose stream has no header: the concatenated streams of the pieces are the stream of the whole.

use super::csv::{push_float, push_integer, push_position};
use super::{Format, FormatInfo, Growing};
use crate::record::{self, BLOCK_BYTES};
use crate::{Column, ColumnType, Field, FieldInfo, FieldSet, Frame, PointCloud};
use ground::parallel;
use ground::pose::Pose;
use ground::report::Report;
use ground::write::Sink;
use std::fmt::Write as _;
use std::io::{self, Seek as _, Write as _};
use std::path::Path;

/// Binary: records of packed columns.
pub(super) const PCD: Pcd = Pcd {
    info: FormatInfo {
        name: "pcd",
        extensions: &["pcd"],
        description: "PCD 0.7 of the Point Cloud Library, binary; f32 positions, f64 far from the origin",
        needs_positions: true,
        holds_label_names: false,
    },
    data: Data::Binary,
};

pub(super) const PCD_ASCII: Pcd = Pcd {
    info: FormatInfo { name: "pcd_ascii", extensions: &[], description: "PCD as text", ..PCD.info },
    data: Data::Text,
};

pub(super) const PCD_COMPRESSED: Pcd = Pcd {
    info: FormatInfo {
        name: "pcd_compressed",
        extensions: &[],
        description: "PCD with columns that are compressed by LZF, up to 4 GiB of them",
        ..PCD.info
    },
    data: Data::Compressed,
};

/// A kind of PCD file.
#[derive(Clone, Copy)]
pub(super) struct Pcd {
    info: FormatInfo,
    data: Data,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Data {
    Binary,
    Text,
    Compressed,
}

const COLOUR: [Field; 3] = [Field::Red, Field::Green, Field::Blue];

/// Bytes that are compressed at a time.
const PIECE: usize = 1 << 20;

/// Maximum number of bytes that LZF copies as they are after one byte with their count.
const LITERALS: usize = 32;

impl Format for Pcd {
    fn info(&self) -> &FormatInfo {
        &self.info
    }

    fn most_points(&self, fields: FieldSet) -> Option<u64> {
        // Positions far from the origin are f64.
        let far = PointCloud { origin: glam::DVec3::ONE, ..PointCloud::default() };
        let size = |info: &FieldInfo| if far.offset(info.field).is_some() { 8 } else { info.kind.size() };
        let size: usize = fields.iter().map(size).sum();
        (self.data == Data::Compressed).then(|| u64::from(u32::MAX) / size.max(1) as u64)
    }

    fn write(&self, cloud: &PointCloud, path: &Path, report: &mut Report) -> io::Result<()> {
        match self.data {
            Data::Compressed => write_compressed(cloud, path),
            _ => super::write_alone(PcdFile::create(self.data, cloud, path)?, cloud, report),
        }
    }

    fn begin(&self, first: &PointCloud, path: &Path) -> Option<io::Result<Box<dyn Growing>>> {
        let file = || Ok(Box::new(PcdFile::create(self.data, first, path)?) as Box<dyn Growing>);
        (self.data != Data::Compressed).then(file)
    }
}

/// A file that is being written.
struct PcdFile {
    data: Data,
    file: Sink,
}

impl PcdFile {
    fn create(data: Data, first: &PointCloud, path: &Path) -> io::Result<PcdFile> {
        let mut file = Sink::create(path)?;
        file.write_all(header(data, &first.head()).as_bytes())?;
        Ok(PcdFile { data, file })
    }
}

impl Growing for PcdFile {
    fn add(&mut self, cloud: &PointCloud) -> io::Result<()> {
        let members = PcdMember::of(cloud);
        if self.data == Data::Text {
            return super::csv::write_rows(&mut self.file, cloud.len, |text, row| {
                for member in &members {
                    member.push(text, row);
                    text.push(b' ');
                }
                if let Some(last) = text.last_mut() {
                    *last = b'\n';
                }
            });
        }
        let size = members.iter().map(PcdMember::size).sum::<usize>();
        let block = BLOCK_BYTES / size;
        let mut buffer = vec![0; block * size];
        for start in (0..cloud.len).step_by(block) {
            let rows = start..cloud.len.min(start + block);
            let records = &mut buffer[..rows.len() * size];
            let mut at = 0;
            for member in &members {
                member.put(records, size, at, rows.clone());
                at += member.size();
            }
            self.file.write_all(records)?;
        }
        Ok(())
    }

    fn finish(&mut self, head: &PointCloud, _: &mut Report) -> io::Result<()> {
        // Now that all points are counted.
        self.file.rewind()?;
        self.file.write_all(header(self.data, head).as_bytes())?;
        self.file.take_error()
    }
}

fn write_compressed(cloud: &PointCloud, path: &Path) -> io::Result<()> {
    let members = PcdMember::of(cloud);
    let size = members.iter().map(PcdMember::size).sum::<usize>();
    let small = |bytes: usize| {
        u32::try_from(bytes).map_err(|_| io::Error::other("a compressed PCD file holds 4 GiB at most; pcd holds more"))
    };
    let whole = small(cloud.len.saturating_mul(size))?;
    let mut bytes = vec![0; cloud.len * size];
    let mut rest = &mut bytes[..];
    for member in &members {
        let column;
        (column, rest) = rest.split_at_mut(cloud.len * member.size());
        member.put(column, member.size(), 0, 0..cloud.len);
    }
    let mut pieces: Vec<(&[u8], Vec<u8>)> = bytes.chunks(PIECE).map(|piece| (piece, Vec::new())).collect();
    parallel::for_each(&mut pieces, |_, (piece, packed)| *packed = compress(piece));
    let packed = small(pieces.iter().map(|(_, packed)| packed.len()).sum())?;
    let mut file = Sink::create(path)?;
    file.write_all(header(Data::Compressed, cloud).as_bytes())?;
    file.write_all(&packed.to_le_bytes())?;
    file.write_all(&whole.to_le_bytes())?;
    pieces.iter().try_for_each(|(_, packed)| file.write_all(packed))?;
    file.finish()
}

/// An LZF stream of `bytes`.
fn compress(bytes: &[u8]) -> Vec<u8> {
    lzf::compress(bytes).unwrap_or_else(|_| {
        // They cannot be compressed.
        bytes.chunks(LITERALS).flat_map(|run| [&[run.len() as u8 - 1], run].concat()).collect()
    })
}

/// The header of a cloud with the rows of `head`; its length does not depend on their number.
fn header(data: Data, head: &PointCloud) -> String {
    let members = PcdMember::of(head);
    let line = |key: &str, of: &dyn Fn(&PcdMember) -> String| {
        members.iter().fold(key.to_owned(), |line, member| line + " " + &of(member)) + "\n"
    };
    let mut text = line("FIELDS", &|member| member.name.to_owned());
    text += &line("SIZE", &|member| member.size().to_string());
    text += &line("TYPE", &|member| member.letter().to_string());
    text += &line("COUNT", &|_| "1".to_owned());
    let [height, width] = head.organised.map_or([1, head.len], |[rows, columns]| [rows as usize, columns as usize]);
    // Viewers transform the cloud by this.
    let Pose { position: p, orientation: q } =
        if head.frame == Frame::Sensor { head.sensor_pose } else { Pose::IDENTITY };
    let viewpoint = format!("{} {} {} {} {} {} {}", p.x, p.y, p.z, q.w, q.x, q.y, q.z);
    let counts = format!("WIDTH {width}\nHEIGHT {height}\nVIEWPOINT {viewpoint}\nPOINTS {}\n", head.len);
    let longest = 3 * usize::MAX.to_string().len() + format!("WIDTH \nHEIGHT \nVIEWPOINT {viewpoint}\nPOINTS \n").len();
    let filling = " ".repeat(longest - counts.len());
    let data = match data {
        Data::Binary => "binary",
        Data::Text => "ascii",
        Data::Compressed => "binary_compressed",
    };
    let _ = writeln!(text, "{counts}DATA {data}");
    format!(
        "# .PCD v0.7 - Point Cloud Data file format\n# echocast {}{filling}\nVERSION 0.7\n{text}",
        env!("CARGO_PKG_VERSION")
    )
}

/// A member of a point.
struct PcdMember<'a> {
    name: &'static str,
    values: PcdValues<'a>,
}

enum PcdValues<'a> {
    Column(Column<'a>),
    /// Positions relative to a coordinate.
    Position(&'a [f32], f64),
    /// Red, green and blue in one number.
    Colour([&'a [u8]; 3]),
}

impl<'a> PcdMember<'a> {
    /// The members of the points of `cloud`.
    fn of(cloud: &'a PointCloud) -> Vec<PcdMember<'a>> {
        let c = &cloud.columns;
        let coloured = COLOUR.iter().all(|&field| cloud.fields.contains(field));
        let other = if coloured { COLOUR[1..].iter().copied().collect() } else { FieldSet::EMPTY };
        let fields = cloud.fields.iter().filter(|info| !other.contains(info.field));
        let member = |info: &'static FieldInfo| match (cloud.column(info.field), cloud.offset(info.field)) {
            _ if coloured && info.field == Field::Red => {
                PcdMember { name: "rgb", values: PcdValues::Colour([&c.red, &c.green, &c.blue]) }
            }
            // The usual point types of the library have f32 positions.
            (Column::F32(column), Some(offset)) if cloud.origin != glam::DVec3::ZERO => {
                PcdMember { name: info.name, values: PcdValues::Position(column, offset) }
            }
            (column, _) => PcdMember { name: info.name, values: PcdValues::Column(column) },
        };
        fields.map(member).collect()
    }

    fn size(&self) -> usize {
        match self.values {
            PcdValues::Column(column) => column.kind().size(),
            PcdValues::Position(..) => 8,
            PcdValues::Colour(_) => 4,
        }
    }

    /// Type: unsigned or float.
    fn letter(&self) -> char {
        match self.values {
            PcdValues::Column(column) if !matches!(column.kind(), ColumnType::F32 | ColumnType::F64) => 'U',
            PcdValues::Colour(_) => 'U',
            _ => 'F',
        }
    }

    fn put(&self, records: &mut [u8], size: usize, at: usize, rows: std::ops::Range<usize>) {
        match self.values {
            PcdValues::Column(Column::F32(c)) => record::put(records, size, at, rows, |row| c[row].to_le_bytes()),
            PcdValues::Column(Column::F64(c)) => record::put(records, size, at, rows, |row| c[row].to_le_bytes()),
            PcdValues::Column(Column::U8(c)) => record::put(records, size, at, rows, |row| [c[row]]),
            PcdValues::Column(Column::U16(c)) => record::put(records, size, at, rows, |row| c[row].to_le_bytes()),
            PcdValues::Column(Column::U32(c)) => record::put(records, size, at, rows, |row| c[row].to_le_bytes()),
            PcdValues::Position(c, offset) => {
                record::put(records, size, at, rows, |row| (f64::from(c[row]) + offset).to_le_bytes());
            }
            PcdValues::Colour(rgb) => record::put(records, size, at, rows, |row| packed(rgb, row).to_le_bytes()),
        }
    }

    fn push(&self, text: &mut Vec<u8>, row: usize) {
        match self.values {
            PcdValues::Column(Column::F32(c)) => push_float(text, c[row]),
            PcdValues::Column(Column::F64(c)) => push_float(text, c[row]),
            PcdValues::Column(Column::U8(c)) => push_integer(text, c[row]),
            PcdValues::Column(Column::U16(c)) => push_integer(text, c[row]),
            PcdValues::Column(Column::U32(c)) => push_integer(text, c[row]),
            PcdValues::Position(c, offset) => push_position(text, f64::from(c[row]) + offset),
            PcdValues::Colour(rgb) => push_integer(text, packed(rgb, row)),
        }
    }
}

/// 0x00RRGGBB.
fn packed([red, green, blue]: [&[u8]; 3], row: usize) -> u32 {
    u32::from_be_bytes([0, red[row], green[row], blue[row]])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_are_one_stream() {
        let mut random = 1_u32;
        let mut noise = || {
            random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (random >> 24) as u8
        };
        let even = vec![7; 5000];
        let uneven: Vec<u8> = (0..5000).map(|_| noise()).collect();
        for pieces in [[&even[..], &uneven[..]], [&uneven[..], &even[..33]], [&even[..1], &uneven[..0]]] {
            let stream: Vec<u8> = pieces.iter().flat_map(|piece| compress(piece)).collect();
            let whole = pieces.concat();
            assert!(lzf::decompress(&stream, whole.len()).unwrap() == whole);
        }
        assert!(compress(&even).len() < 200);
    }
}
