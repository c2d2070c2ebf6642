//! HDF5: one dataset per column at the root.

use super::{Format, boxes, sensor_pose, unfinished};
use crate::cloud::{Column, FieldInfo, PointCloud};
use crate::ground::report::Report;
use crate::scene::Labels;
use ::hdf5::types::VarLenUnicode;
use ::hdf5::{Attribute, Dataset, ErrorFrame, File, Group, H5Type, Location};
use std::io;
use std::path::Path;

/// Contiguous datasets named like the columns, with the attributes `unit` and `meaning`; positions f32 relative to the
/// dataset `origin`. Organised clouds stay lists of rows, and the dataset `shape` holds their rows and columns.
pub(super) struct Hdf5;

impl Format for Hdf5 {
    fn name(&self) -> &'static str {
        "hdf5"
    }

    fn extensions(&self) -> &'static [&'static str] {
        &["h5", "hdf5"]
    }

    fn description(&self) -> &'static str {
        "HDF5, one dataset per column; f32 positions relative to the dataset origin"
    }

    fn holds(&self, _: &FieldInfo) -> bool {
        true
    }

    fn needs_positions(&self) -> bool {
        false
    }

    fn holds_label_names(&self) -> bool {
        true
    }

    fn write(&self, cloud: &PointCloud, path: &Path, _: &mut Report) -> io::Result<()> {
        self.write_file(cloud, path).map_err(io_error)
    }
}

impl Hdf5 {
    fn write_file(&self, cloud: &PointCloud, path: &Path) -> ::hdf5::Result<()> {
        let file = File::create(path)?;
        for info in cloud.fields.iter() {
            let column = cloud.column(info.field);
            let dataset = add_column(&file, info.name, &[column.len()], column)?;
            describe(&dataset, info.unit, info.meaning)?;
        }
        for (name, values) in sensor_pose(cloud) {
            add(&file, name, &[values.len()], &values)?;
        }
        add_tables(&file, cloud)?;
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

/// Adds what says how to read the columns: frame, origin, shape, scale and name tables.
pub(super) fn add_tables(file: &File, cloud: &PointCloud) -> ::hdf5::Result<()> {
    add_one(file, "coordinates", &text(cloud.frame.name()))?;
    add(file, "origin", &[3], &cloud.origin.to_array())?;
    add_one(file, "intensity_full_scale", &cloud.intensity_full_scale.unwrap_or(f32::NAN))?;
    if let Some(shape) = cloud.organised {
        add(file, "shape", &[2], &shape)?;
    }
    add_names(file, &cloud.labels)
}

/// Adds numbers and names of the labels.
pub(super) fn add_names(file: &File, labels: &Labels) -> ::hdf5::Result<()> {
    for (stem, table) in labels.tables() {
        add(file, &format!("{stem}_ids"), &[table.ids.len()], &table.ids)?;
        let names: Vec<VarLenUnicode> = table.names.iter().map(|name| text(name)).collect();
        add(file, &format!("{stem}_names"), &[names.len()], &names)?;
    }
    Ok(())
}

/// What the system said where HDF5's error comes from it. HDF5 itself tells where in its memory and its sources it was.
pub(super) fn io_error(error: ::hdf5::Error) -> io::Error {
    let stack = error.stack();
    let frames = || stack.iter().flat_map(|stack| stack.iter());
    let number = |frame: &ErrorFrame| {
        let digits = frame.desc().split_once("errno = ")?.1;
        digits.split(|c: char| !c.is_ascii_digit()).next()?.parse().ok()
    };
    // Of one that follows from another, such as closing what could not be written, the first tells why.
    match (frames().find_map(number), frames().last()) {
        (Some(number), _) => io::Error::from_raw_os_error(number),
        (None, Some(frame)) => {
            io::Error::other(format!("HDF5: {}", frame.desc().split(&[',', ':']).next().unwrap_or_default()))
        }
        (None, None) => io::Error::other(format!("HDF5: {error}")),
    }
}

/// Adds the dataset `name` of `data`.
pub(super) fn add_column(group: &Group, name: &str, shape: &[usize], data: Column<'_>) -> ::hdf5::Result<Dataset> {
    unfinished::check().map_err(|error| error.to_string())?;
    match data {
        Column::F32(c) => add(group, name, shape, c),
        Column::F64(c) => add(group, name, shape, c),
        Column::U8(c) => add(group, name, shape, c),
        Column::U16(c) => add(group, name, shape, c),
        Column::U32(c) => add(group, name, shape, c),
    }
}

fn add<T: H5Type>(group: &Group, name: &str, shape: &[usize], data: &[T]) -> ::hdf5::Result<Dataset> {
    // Without times of change the same run gives the same bytes.
    let dataset = group.new_dataset::<T>().obj_track_times(false).shape(shape).create(name)?;
    if !data.is_empty() {
        dataset.write_raw(data)?;
    }
    Ok(dataset)
}

/// Adds a dataset of one value without a shape.
pub(super) fn add_one<T: H5Type>(file: &File, name: &str, value: &T) -> ::hdf5::Result<()> {
    file.new_dataset::<T>().obj_track_times(false).create(name)?.write_scalar(value)
}

/// Adds the attributes that say what a dataset holds.
pub(super) fn describe(dataset: &Location, unit: &str, meaning: &str) -> ::hdf5::Result<()> {
    let add = |name: &str, value: &str| -> ::hdf5::Result<()> {
        let attribute: Attribute = dataset.new_attr::<VarLenUnicode>().create(name)?;
        attribute.write_scalar(&text(value))
    };
    add("unit", unit)?;
    add("meaning", meaning)
}

/// HDF5 text ends at a zero, which therefore cannot stand in it.
pub(super) fn text(name: &str) -> VarLenUnicode {
    name.replace('\0', "\u{fffd}").parse().expect("there is no zero in it")
}
