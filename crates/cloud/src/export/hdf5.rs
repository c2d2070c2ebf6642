//! HDF5: one dataset per column at the root.

use super::boxes::{self, BoxColumn, Numbers};
use super::npz::{NAME_CHARS, cut_names};
use super::{Format, FormatInfo, Growing, sensor_pose};
use crate::{Column, ColumnType, FieldInfo, InstanceBox, PointCloud};
use ::hdf5::types::{FixedUnicode, TypeDescriptor};
use ::hdf5::{Container, Dataset, DatasetBuilderEmpty, Extent, File, Group, H5Type, Location};
use echocast_hdf5::io_error;
use ground::report::Report;
use ground::write;
use model::Labels;
use std::io;
use std::path::Path;

/// Contiguous datasets named like the columns, with the attributes `unit` and `meaning`; positions f32 relative to the
/// dataset `origin`. Organised clouds are stored as lists of rows, and the dataset `shape` holds their numbers of rows
/// and columns.
pub(super) struct Hdf5;

impl Format for Hdf5 {
    fn info(&self) -> &FormatInfo {
        &FormatInfo {
            name: "hdf5",
            extensions: &["h5", "hdf5"],
            description: "HDF5, one dataset per column; f32 positions relative to the dataset origin",
            needs_positions: false,
            holds_label_names: true,
        }
    }

    fn write(&self, cloud: &PointCloud, path: &Path, report: &mut Report) -> io::Result<()> {
        self.write_file(cloud, path, report).map_err(io_error)
    }

    fn begin(&self, first: &PointCloud, path: &Path) -> Option<io::Result<Box<dyn Growing>>> {
        Some(Hdf5File::create(first, path).map(|file| Box::new(file) as Box<dyn Growing>).map_err(io_error))
    }
}

impl Hdf5 {
    fn write_file(&self, cloud: &PointCloud, path: &Path, report: &mut Report) -> ::hdf5::Result<()> {
        let file = echocast_hdf5::create(path)?;
        for info in cloud.fields.iter() {
            let column = cloud.column(info.field);
            let dataset = add_column(&file, info.name, &[column.len()], column)?;
            describe(&dataset, info.unit, info.meaning)?;
        }
        for (name, values) in sensor_pose(cloud) {
            add(&file, name, &[values.len()], &values)?;
        }
        add_tables(&file, cloud, report)?;
        if let Some(boxes) = &cloud.boxes {
            let group = file.create_group("boxes")?;
            for column in &boxes::COLUMNS {
                let numbers = column.numbers(boxes);
                let dataset = add_column(&group, column.name, &column.shape(boxes.len()), numbers.column())?;
                describe(&dataset, column.unit, column.meaning)?;
            }
        }
        file.close()
    }
}

/// Rows of frames, boxes and texts that are processed together.
pub(super) const ROWS: usize = 256;
/// Maximum number of bytes of a text: the longest allowed name, four bytes per character.
pub const WIDEST: usize = NAME_CHARS * 4;
/// Rows of points that are allocated together.
const CHUNK: usize = 1 << 16;

/// A file to which clouds are added: the same datasets, in chunks.
struct Hdf5File {
    // Dropped in this order: the datasets before the file.
    columns: Vec<(&'static FieldInfo, Dataset)>,
    boxes: Option<BoxRows>,
    file: Option<File>,
    /// Rows so far.
    len: usize,
}

impl Hdf5File {
    fn create(first: &PointCloud, path: &Path) -> ::hdf5::Result<Hdf5File> {
        fn create<T: H5Type>(file: &File, info: &FieldInfo) -> ::hdf5::Result<Dataset> {
            let rows = file.new_dataset::<T>().obj_track_times(false).chunk(CHUNK).shape(Extent::resizable(0));
            let dataset = rows.create(info.name)?;
            describe(&dataset, info.unit, info.meaning)?;
            Ok(dataset)
        }
        let file = echocast_hdf5::create(path)?;
        let mut columns = Vec::new();
        for info in first.fields.iter() {
            let dataset = match info.kind {
                ColumnType::F32 => create::<f32>(&file, info),
                ColumnType::F64 => create::<f64>(&file, info),
                ColumnType::U8 => create::<u8>(&file, info),
                ColumnType::U16 => create::<u16>(&file, info),
                ColumnType::U32 => create::<u32>(&file, info),
            }?;
            columns.push((info, dataset));
        }
        let boxes = first.boxes.is_some().then(|| BoxRows::create(&file)).transpose()?;
        Ok(Hdf5File { columns, boxes, file: Some(file), len: 0 })
    }

    fn add_rows(&mut self, cloud: &PointCloud) -> ::hdf5::Result<()> {
        let rows = self.len..self.len + cloud.len;
        for (info, dataset) in self.columns.iter().filter(|_| !rows.is_empty()) {
            write::check().map_err(|error| error.to_string())?;
            dataset.resize(rows.end)?;
            match cloud.column(info.field) {
                Column::F32(c) => dataset.write_slice(c, rows.clone()),
                Column::F64(c) => dataset.write_slice(c, rows.clone()),
                Column::U8(c) => dataset.write_slice(c, rows.clone()),
                Column::U16(c) => dataset.write_slice(c, rows.clone()),
                Column::U32(c) => dataset.write_slice(c, rows.clone()),
            }?;
        }
        if let (Some(rows), Some(boxes)) = (&mut self.boxes, &cloud.boxes) {
            rows.add(boxes)?;
        }
        self.len = rows.end;
        Ok(())
    }

    fn complete(&mut self, head: &PointCloud, report: &mut Report) -> ::hdf5::Result<()> {
        self.columns.clear();
        self.boxes = None;
        let Some(file) = self.file.take() else { return Ok(()) };
        for (name, values) in sensor_pose(head) {
            add(&file, name, &[values.len()], &values)?;
        }
        add_tables(&file, head, report)?;
        file.close()
    }
}

impl Growing for Hdf5File {
    fn add(&mut self, cloud: &PointCloud) -> io::Result<()> {
        self.add_rows(cloud).map_err(io_error)
    }

    fn finish(&mut self, head: &PointCloud, report: &mut Report) -> io::Result<()> {
        self.complete(head, report).map_err(io_error)
    }
}

/// The boxes of a file to which they are added: a group with a dataset for each of [`boxes::COLUMNS`].
#[derive(Debug)]
pub(super) struct BoxRows {
    datasets: Vec<Dataset>,
    /// Boxes so far.
    len: usize,
}

impl BoxRows {
    pub(super) fn create(file: &File) -> ::hdf5::Result<BoxRows> {
        fn create<T: H5Type>(group: &Group, column: &BoxColumn) -> ::hdf5::Result<Dataset> {
            let (extents, chunk): (Vec<Extent>, Vec<usize>) = [(Extent::resizable(0), ROWS)]
                .into_iter()
                .chain(column.width().map(|width| (Extent::fixed(width), width)))
                .unzip();
            let dataset =
                group.new_dataset::<T>().obj_track_times(false).chunk(chunk).shape(extents).create(column.name)?;
            describe(&dataset, column.unit, column.meaning)?;
            Ok(dataset)
        }
        let group = file.create_group("boxes")?;
        let all = boxes::COLUMNS.iter().map(|column| match column.numbers(&[]) {
            Numbers::U32(_) => create::<u32>(&group, column),
            Numbers::F64(_) => create::<f64>(&group, column),
        });
        Ok(BoxRows { datasets: all.collect::<::hdf5::Result<_>>()?, len: 0 })
    }

    pub(super) fn add(&mut self, boxes: &[InstanceBox]) -> ::hdf5::Result<()> {
        /// Writes `numbers` from the row `first` on.
        fn put<T: H5Type>(dataset: &Dataset, first: usize, column: &BoxColumn, numbers: &[T]) -> ::hdf5::Result<()> {
            match column.width() {
                None => dataset.write_slice(numbers, first..first + numbers.len()),
                Some(width) => {
                    let rows = (first..).zip(numbers.chunks_exact(width));
                    rows.into_iter().try_for_each(|(row, numbers)| dataset.write_slice(numbers, (row, ..)))
                }
            }
        }
        for (column, dataset) in boxes::COLUMNS.iter().zip(&self.datasets) {
            dataset.resize(column.shape(self.len + boxes.len()))?;
            match column.numbers(boxes) {
                Numbers::U32(numbers) => put(dataset, self.len, column, &numbers),
                Numbers::F64(numbers) => put(dataset, self.len, column, &numbers),
            }?;
        }
        self.len += boxes.len();
        Ok(())
    }
}

/// Adds what is needed to interpret the columns: frame, origin, shape, scale and name tables.
pub(super) fn add_tables(file: &File, cloud: &PointCloud, report: &mut Report) -> ::hdf5::Result<()> {
    add_text(file, "coordinates", cloud.frame.name())?;
    if let Some(driver) = cloud.driver {
        add_text(file, "driver", driver.name())?;
    }
    add(file, "origin", &[3], &cloud.origin.to_array())?;
    let full_scale = cloud.intensity_full_scale.unwrap_or(f32::NAN);
    file.new_dataset::<f32>().obj_track_times(false).create("intensity_full_scale")?.write_scalar(&full_scale)?;
    if let Some(shape) = cloud.organised {
        add(file, "shape", &[2], &shape)?;
    }
    add_names(file, &cloud.labels, report)
}

/// Adds numbers and names of the labels.
pub(super) fn add_names(file: &File, labels: &Labels, report: &mut Report) -> ::hdf5::Result<()> {
    for (stem, table) in labels.tables() {
        add(file, &format!("{stem}_ids"), &[table.ids.len()], &table.ids)?;
        let names = cut_names(&table.names, "hdf5", report);
        let width = width(names.iter().map(|name| name.len()).max());
        let texts = new_texts(file, width).shape(names.len()).create(&*format!("{stem}_names"))?;
        for (start, names) in (0..).step_by(ROWS).zip(names.chunks(ROWS)) {
            put_texts(&texts, width, names, Some(start))?;
        }
    }
    Ok(())
}

/// Adds the dataset `name` of `data`.
pub(super) fn add_column(group: &Group, name: &str, shape: &[usize], data: Column<'_>) -> ::hdf5::Result<Dataset> {
    write::check().map_err(|error| error.to_string())?;
    match data {
        Column::F32(c) => add(group, name, shape, c),
        Column::F64(c) => add(group, name, shape, c),
        Column::U8(c) => add(group, name, shape, c),
        Column::U16(c) => add(group, name, shape, c),
        Column::U32(c) => add(group, name, shape, c),
    }
}

/// Adds the dataset `name` of `data`.
pub(super) fn add<T: H5Type>(group: &Group, name: &str, shape: &[usize], data: &[T]) -> ::hdf5::Result<Dataset> {
    // Without modification times the same run gives the same bytes.
    let dataset = group.new_dataset::<T>().obj_track_times(false).shape(shape).create(name)?;
    if !data.is_empty() {
        dataset.write_raw(data)?;
    }
    Ok(dataset)
}

/// Adds a scalar dataset of one text.
pub(super) fn add_text(file: &File, name: &str, text: &str) -> ::hdf5::Result<()> {
    let width = width(Some(text.len()));
    let dataset = new_texts(file, width).create(name)?;
    put_texts(&dataset, width, &[text], None)
}

/// Adds the attributes that describe what a dataset holds.
pub(super) fn describe(dataset: &Location, unit: &str, meaning: &str) -> ::hdf5::Result<()> {
    for (name, value) in [("unit", unit), ("meaning", meaning)] {
        let width = width(Some(value.len()));
        let attribute = dataset.new_attr_builder().empty_as(TypeDescriptor::FixedUnicode(width)).create(name)?;
        put_texts(&attribute, width, &[value], None)?;
    }
    Ok(())
}

/// Width in bytes of texts of which the longest has `longest`; a type of 0 bytes does not exist.
fn width(longest: Option<usize>) -> usize {
    longest.unwrap_or(0).max(1)
}

/// A dataset of texts of `width` bytes. Texts of variable length would be in the heaps of the file, which other
/// libraries read less carefully, and which ours does not use.
fn new_texts(file: &File, width: usize) -> DatasetBuilderEmpty {
    file.new_dataset_builder().empty_as(TypeDescriptor::FixedUnicode(width)).obj_track_times(false)
}

/// Writes `texts` of at most `width` bytes to `place`: from row `start` on, or the only one.
fn put_texts(place: &Container, width: usize, texts: &[&str], start: Option<usize>) -> ::hdf5::Result<()> {
    // In memory they have one of a few widths, which are types; the library converts them to those of the file.
    fn put<const N: usize>(place: &Container, texts: &[&str], start: Option<usize>) -> ::hdf5::Result<()> {
        // A zero terminates a text, and therefore cannot be part of it.
        let fixed = |text: &&str| text.replace('\0', "?").parse::<FixedUnicode<N>>().unwrap_or_default();
        let texts: Vec<FixedUnicode<N>> = texts.iter().map(fixed).collect();
        match (start, &*texts) {
            (Some(start), _) => place.write_slice(&texts, start..start + texts.len()),
            (None, [text, ..]) => place.write_scalar(text),
            (None, []) => Ok(()),
        }
    }
    match width {
        ..=64 => put::<64>(place, texts, start),
        65..=512 => put::<512>(place, texts, start),
        _ => put::<WIDEST>(place, texts, start),
    }
}
