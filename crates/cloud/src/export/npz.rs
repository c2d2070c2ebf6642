//! NPZ: a zip of NumPy arrays, compressed in sets; `numpy.load` alone reads both.

use super::{Format, FormatInfo, boxes, sensor_pose};
use crate::{Column, FieldSet, PointCloud};
use ground::report::Report;
use ground::write::Sink;
use model::Labels;
use std::io::{self, BufWriter, Write};
use std::path::Path;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

/// Maximum number of characters of a label name: all names of an array are as wide as the longest.
pub(super) const NAME_CHARS: usize = 1024;

/// One array per column; positions f32 relative to the array `origin`. Organised clouds are stored as lists of rows,
/// and the array `shape` holds their numbers of rows and columns: `x.reshape(shape)` is the image.
pub(super) struct Npz {
    pack: Pack,
}

/// How arrays are stored: as they are, or deflated (RFC 1951) at the fastest level. Coordinates and times hardly shrink
/// at any level; at the lowest, labels shrink to a twentieth or less and colours to an eighth.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Pack {
    Stored,
    Deflated,
}

impl Npz {
    pub(super) const PLAIN: Npz = Npz { pack: Pack::Stored };
    const PACKED: Npz = Npz { pack: Pack::Deflated };
}

/// Maximum number of points, which are all in memory at once: some hundred gigabytes.
const MOST: u64 = 4_000_000_000;

impl Format for Npz {
    fn info(&self) -> &FormatInfo {
        &FormatInfo {
            name: "npz",
            extensions: &["npz"],
            description: "NumPy arrays, uncompressed except in sets; f32 positions relative to the array origin",
            needs_positions: false,
            holds_label_names: true,
        }
    }

    fn most_points(&self, _: FieldSet) -> Option<u64> {
        Some(MOST)
    }

    fn packed(&self) -> Option<&'static dyn Format> {
        Some(&Npz::PACKED)
    }

    fn write(&self, cloud: &PointCloud, path: &Path, report: &mut Report) -> io::Result<()> {
        let mut zip = Archive { pack: self.pack, ..Archive::create(path)? };
        for info in cloud.fields.iter() {
            let column = cloud.column(info.field);
            zip.column(info.name, &[column.len()], column)?;
        }
        zip.add("origin", "f8", &[3], &cloud.origin.to_array())?;
        for (name, values) in sensor_pose(cloud) {
            zip.add(name, "f8", &[values.len()], &values)?;
        }
        zip.add("intensity_full_scale", "f4", &[], &[cloud.intensity_full_scale.unwrap_or(f32::NAN)])?;
        zip.text("coordinates", cloud.frame.name())?;
        if let Some(driver) = cloud.driver {
            zip.text("driver", driver.name())?;
        }
        if let Some(shape) = cloud.organised {
            zip.add("shape", "u4", &[2], &shape)?;
        }
        if let Some(boxes) = &cloud.boxes {
            for column in &boxes::COLUMNS {
                let numbers = column.numbers(boxes);
                zip.column(&format!("boxes/{}", column.name), &column.shape(boxes.len()), numbers.column())?;
            }
        }
        zip.names(&cloud.labels, report)?;
        zip.finish()
    }
}

/// A file of arrays, written one by one.
pub(super) struct Archive {
    zip: ZipWriter<BufWriter<Sink>>,
    pack: Pack,
}

impl Archive {
    pub(super) fn create(path: &Path) -> io::Result<Archive> {
        Ok(Archive { zip: ZipWriter::new(BufWriter::new(Sink::create(path)?)), pack: Pack::Stored })
    }

    pub(super) fn finish(self) -> io::Result<()> {
        self.zip.finish()?.into_inner().map_err(io::IntoInnerError::into_error)?.finish()
    }

    /// Adds the array `name` of `data`.
    pub(super) fn column(&mut self, name: &str, shape: &[usize], data: Column<'_>) -> io::Result<()> {
        self.start(name, numpy_type(data), shape, data.bytes().len())?;
        self.zip.write_all(data.bytes())
    }

    /// Adds a text as an array without dimensions.
    pub(super) fn text(&mut self, name: &str, words: &str) -> io::Result<()> {
        let characters: Vec<u32> = words.chars().map(u32::from).collect();
        self.add(name, &format!("U{}", characters.len()), &[], &characters)
    }

    /// Adds numbers and names of the labels.
    pub(super) fn names(&mut self, labels: &Labels, report: &mut Report) -> io::Result<()> {
        for (stem, table) in labels.tables() {
            self.add(&format!("{stem}_ids"), "u4", &[table.ids.len()], &table.ids)?;
            // NumPy text: UTF-32, every element as wide as the longest, padded with zeros.
            let names = cut_names(&table.names, "npz", report);
            let width = names.iter().map(|name| name.chars().count()).max().unwrap_or(0).max(1);
            let count = names.len();
            self.start(&format!("{stem}_names"), &format!("U{width}"), &[count], count * width * 4)?;
            for name in names {
                let mut characters: Vec<u32> = name.chars().map(u32::from).collect();
                characters.resize(width, 0);
                self.zip.write_all(bytemuck::cast_slice(&characters))?;
            }
        }
        Ok(())
    }

    /// Adds the array `name` of elements of the NumPy type `kind`, in the machine's byte order.
    pub(super) fn add<T: bytemuck::NoUninit>(
        &mut self,
        name: &str,
        kind: &str,
        shape: &[usize],
        data: &[T],
    ) -> io::Result<()> {
        self.start(name, kind, shape, size_of_val(data))?;
        self.zip.write_all(bytemuck::cast_slice(data))
    }

    /// Adds an array whose data, `bytes` long, the caller writes next.
    fn start(&mut self, name: &str, kind: &str, shape: &[usize], bytes: usize) -> io::Result<()> {
        // Format 1.0 (numpy.lib.format): magic, version, length of the text, text padded so that data starts at 64 n.
        let order = if cfg!(target_endian = "big") { '>' } else { '<' };
        let shape: String = shape.iter().map(|length| format!("{length},")).collect();
        let mut text = format!("{{'descr': '{order}{kind}', 'fortran_order': False, 'shape': ({shape}), }}");
        let start = (10 + text.len() + 1).next_multiple_of(64);
        text.extend(std::iter::repeat_n(' ', start - 11 - text.len()));
        text.push('\n');
        let mut header = b"\x93NUMPY\x01\x00".to_vec();
        header.extend((text.len() as u16).to_le_bytes());
        header.extend(text.bytes());
        // Entries from 4 GiB on need the zip64 fields.
        let large = header.len() + bytes >= u32::MAX as usize;
        let options = SimpleFileOptions::default().large_file(large);
        let options = match self.pack {
            Pack::Stored => options.compression_method(CompressionMethod::Stored),
            Pack::Deflated => options.compression_method(CompressionMethod::Deflated).compression_level(Some(1)),
        };
        self.zip.start_file(format!("{name}.npy"), options)?;
        self.zip.write_all(&header)
    }
}

/// The `names` of labels, none of them longer than [`NAME_CHARS`].
pub(super) fn cut_names<'n>(names: &'n [String], format: &str, report: &mut Report) -> Vec<&'n str> {
    let cut = |name: &'n String| name.char_indices().nth(NAME_CHARS).map_or(&**name, |(end, _)| &name[..end]);
    let all: Vec<&str> = names.iter().map(cut).collect();
    if all.iter().zip(names).any(|(cut, name)| cut.len() < name.len()) {
        report.warn(format!("{format}: label names longer than {NAME_CHARS} characters cut"));
    }
    all
}

fn numpy_type(column: Column<'_>) -> &'static str {
    match column {
        Column::F32(_) => "f4",
        Column::F64(_) => "f8",
        Column::U8(_) => "u1",
        Column::U16(_) => "u2",
        Column::U32(_) => "u4",
    }
}
