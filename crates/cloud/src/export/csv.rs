//! CSV: a header of column names, one row per point.

use super::{Format, FormatInfo, Growing};
use crate::{Column, PointCloud};
use ground::parallel;
use ground::report::Report;
use ground::write::Sink;
use std::io::{self, Write};
use std::path::Path;

/// Text, for programs that do not read anything else.
pub(super) struct Csv;

/// Rows that one thread formats at a time: about 1 MB of text.
const ROWS: usize = 8192;

impl Format for Csv {
    fn info(&self) -> &FormatInfo {
        &FormatInfo {
            name: "csv",
            extensions: &["csv"],
            description: "comma-separated text with a header; positions to the micrometre, misses are nan",
            needs_positions: false,
            holds_label_names: false,
        }
    }

    fn write(&self, cloud: &PointCloud, path: &Path, report: &mut Report) -> io::Result<()> {
        super::write_alone(CsvFile::create(cloud, path)?, cloud, report)
    }

    fn begin(&self, first: &PointCloud, path: &Path) -> Option<io::Result<Box<dyn Growing>>> {
        Some(CsvFile::create(first, path).map(|file| Box::new(file) as Box<dyn Growing>))
    }
}

/// A file that is being written.
struct CsvFile(Sink);

impl CsvFile {
    fn create(first: &PointCloud, path: &Path) -> io::Result<CsvFile> {
        let names: Vec<&str> = first.fields.iter().map(|info| info.name).collect();
        let mut file = Sink::create(path)?;
        file.write_all(format!("{}\n", names.join(",")).as_bytes())?;
        Ok(CsvFile(file))
    }
}

impl Growing for CsvFile {
    fn add(&mut self, cloud: &PointCloud) -> io::Result<()> {
        let columns: Vec<(Column, Option<f64>)> =
            cloud.fields.iter().map(|info| (cloud.column(info.field), cloud.offset(info.field))).collect();
        write_rows(&mut self.0, cloud.len, |text, row| push_row(text, &columns, row))
    }

    fn finish(&mut self, _: &PointCloud, _: &mut Report) -> io::Result<()> {
        self.0.take_error()
    }
}

/// Writes `count` rows of text, each appended by `push`.
pub(super) fn write_rows(file: &mut Sink, count: usize, push: impl Fn(&mut Vec<u8>, usize) + Sync) -> io::Result<()> {
    let mut texts = vec![Vec::new(); parallel::threads()];
    for start in (0..count).step_by(ROWS * texts.len()) {
        parallel::for_each(&mut texts, |i, text| {
            text.clear();
            let start = start + i * ROWS;
            (start..count.min(start + ROWS)).for_each(|row| push(text, row));
        });
        texts.iter().try_for_each(|text| file.write_all(text))?;
    }
    Ok(())
}

fn push_row(text: &mut Vec<u8>, columns: &[(Column, Option<f64>)], row: usize) {
    for &(column, offset) in columns {
        match (column, offset) {
            (Column::F32(c), Some(offset)) => push_position(text, f64::from(c[row]) + offset),
            (Column::F32(c), None) => push_float(text, c[row]),
            (Column::F64(c), _) => push_float(text, c[row]),
            (Column::U8(c), _) => push_integer(text, c[row]),
            (Column::U16(c), _) => push_integer(text, c[row]),
            (Column::U32(c), _) => push_integer(text, c[row]),
        }
        text.push(b',');
    }
    if let Some(comma) = text.last_mut() {
        *comma = b'\n';
    }
}

pub(super) fn push_integer(text: &mut Vec<u8>, value: impl itoa::Integer) {
    text.extend_from_slice(itoa::Buffer::new().format(value).as_bytes());
}

/// The shortest text that reads back as the same number.
pub(super) fn push_float<F: zmij::Float + Into<f64>>(text: &mut Vec<u8>, value: F) {
    if value.into().is_nan() {
        text.extend_from_slice(b"nan");
    } else {
        text.extend_from_slice(zmij::Buffer::new().format(value).as_bytes());
    }
}

/// Metres with six decimals: with coordinates such as 5600000, relative f32 positions carry no more than micrometres.
pub(super) fn push_position(text: &mut Vec<u8>, metres: f64) {
    let micrometres = (metres * 1e6).round();
    // Beyond 2^53 micrometres, 9 million kilometres, they are no longer counted exactly.
    if micrometres.is_nan() || micrometres.abs() > 9_007_199_254_740_992.0 {
        return push_float(text, metres);
    }
    if micrometres < 0.0 {
        text.push(b'-');
    }
    let micrometres = micrometres.abs() as u64;
    push_integer(text, micrometres / 1_000_000);
    // A leading 1 keeps the zeros; the point replaces it.
    let point = text.len();
    push_integer(text, micrometres % 1_000_000 + 1_000_000);
    text[point] = b'.';
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_become_text() {
        let position = |metres| {
            let mut text = Vec::new();
            push_position(&mut text, metres);
            String::from_utf8(text).unwrap()
        };
        assert_eq!(position(5_600_000.000_1), "5600000.000100");
        assert_eq!(position(-0.25), "-0.250000");
        assert_eq!(position(0.999_999_6), "1.000000");
        assert_eq!(position(-1e-9), "0.000000");
        assert_eq!(position(-1e12), "-1000000000000.0");
        assert_eq!(position(f64::NAN), "nan");
        let mut text = Vec::new();
        push_float(&mut text, 0.1f32);
        text.push(b' ');
        push_float(&mut text, f32::NAN);
        assert_eq!(text, b"0.1 nan");
    }

    #[test]
    fn rows_are_in_order_across_blocks() {
        let mut cloud = PointCloud { len: 3 * ROWS + 7, ..PointCloud::default() };
        cloud.fields = cloud.fields.with(crate::Field::Beam);
        cloud.columns.beam = (0..cloud.len as u32).collect();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("beams.csv");
        Csv.write(&cloud, &path, &mut Report::default()).unwrap();
        let text = std::fs::read_to_string(path).unwrap();
        let mut lines = text.lines();
        assert_eq!(lines.next(), Some("beam"));
        assert!(lines.map(|line| line.parse::<u32>().unwrap()).eq(0..cloud.len as u32));
    }
}
