//! What files of echocast contain about a cloud in addition to its columns.

use super::Source;
use super::target::{FARTHEST, axis};
use crate::export::labels_path;
use crate::{Driver, Field, Frame, InstanceBox, Records};
use glam::{DQuat, DVec3};
use ground::error::{Error, Result};
use ground::named::Named;
use ground::pose::Pose;
use ground::read::{self, Limit};
use model::{Labels, NameTable};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::Path;

/// Metadata of a cloud; what a file does not specify has its default.
#[derive(Default)]
pub(super) struct About {
    pub frame: Option<Frame>,
    pub sensor_pose: Option<Pose>,
    /// `Some(None)`: it is known that there is none.
    pub intensity_full_scale: Option<Option<f32>>,
    pub driver: Option<Driver>,
    pub shape: Option<[u32; 2]>,
    pub labels: Labels,
    pub las_class: BTreeMap<u32, u8>,
    /// What has been added to f32 positions.
    pub f32_origin: Option<[f64; 3]>,
    /// Names of the columns that the cloud had.
    pub columns: Option<Vec<String>>,
    pub boxes: Option<Vec<InstanceBox>>,
    pub records: Records,
}

/// A file of arrays.
pub(super) trait Arrays {
    /// The numbers of the array `name`; `None`: there is none.
    ///
    /// # Errors
    /// Errors of the system; an array of another type.
    fn numbers(&mut self, name: &str) -> Result<Option<Vec<f64>>>;
    /// The texts of the array `name`; `None`: there is none.
    ///
    /// # Errors
    /// As [`Arrays::numbers`].
    fn texts(&mut self, name: &str) -> Result<Option<Vec<String>>>;
}

/// Arrays that are neither columns nor belong to boxes.
pub(super) const ABOUT: &[&str] = &[
    "origin",
    "sensor_position",
    "sensor_orientation_xyzw",
    "intensity_full_scale",
    "coordinates",
    "driver",
    "shape",
    "category_ids",
    "category_names",
    "part_ids",
    "part_names",
    "material_ids",
    "material_names",
    "instance_ids",
    "instance_names",
];

/// The metadata as written in files.
#[derive(Default, Deserialize)]
#[serde(default)]
struct WrittenAbout {
    coordinates: Option<String>,
    sensor_position: Option<[f64; 3]>,
    sensor_orientation_xyzw: Option<[f64; 4]>,
    intensity_full_scale: Option<f32>,
    driver: Option<String>,
    shape: Option<[u32; 2]>,
    f32_origin: Option<[f64; 3]>,
    columns: Option<Vec<String>>,
    category_ids: Vec<u32>,
    category_names: Vec<String>,
    part_ids: Vec<u32>,
    part_names: Vec<String>,
    material_ids: Vec<u32>,
    material_names: Vec<String>,
    instance_ids: Vec<u32>,
    instance_names: Vec<String>,
}

impl About {
    /// From `NAME.labels.json` next to the cloud at `path`, if there is one.
    ///
    /// # Errors
    /// A file that is not such JSON.
    pub(super) fn beside(path: &Path) -> Result<Option<About>> {
        let file = labels_path(path);
        if !file.exists() {
            return Ok(None);
        }
        About::parse(&file, &read::bytes(&file, Limit::NAMES)?).map(Some)
    }

    /// From `json`, which is in the file at `path`.
    ///
    /// # Errors
    /// Text that is not such JSON.
    pub(super) fn parse(path: &Path, json: &[u8]) -> Result<About> {
        let words = serde_json::from_slice(json);
        let words: WrittenAbout = words.map_err(|error| Error::parse(path, "names of labels", error.to_string()))?;
        About::of(words).map_err(|message| Error::parse(path, "", message))
    }

    /// From `arrays` of the file `source`.
    ///
    /// # Errors
    /// Arrays that cannot be read or have invalid values.
    pub(super) fn of_arrays(arrays: &mut dyn Arrays, source: &Source) -> Result<About> {
        let mut words = WrittenAbout::default();
        let three = |numbers: Option<Vec<f64>>| numbers.and_then(|numbers| <[f64; 3]>::try_from(numbers).ok());
        words.f32_origin = three(arrays.numbers("origin")?);
        words.sensor_position = three(arrays.numbers("sensor_position")?);
        words.sensor_orientation_xyzw = arrays.numbers("sensor_orientation_xyzw")?.and_then(|q| q.try_into().ok());
        words.coordinates = arrays.texts("coordinates")?.and_then(|texts| texts.into_iter().next());
        words.driver = arrays.texts("driver")?.and_then(|texts| texts.into_iter().next());
        let full = arrays.numbers("intensity_full_scale")?.and_then(|full| full.first().copied());
        words.intensity_full_scale = full.map(|full| full as f32);
        let shape = arrays.numbers("shape")?.and_then(|shape| <[f64; 2]>::try_from(shape).ok());
        words.shape = shape.map(|lengths| lengths.map(|length| length as u32));
        for (stem, ids, names) in [
            ("category", &mut words.category_ids, &mut words.category_names),
            ("part", &mut words.part_ids, &mut words.part_names),
            ("material", &mut words.material_ids, &mut words.material_names),
            ("instance", &mut words.instance_ids, &mut words.instance_names),
        ] {
            let numbers = arrays.numbers(&format!("{stem}_ids"))?.unwrap_or_default();
            *ids = numbers.into_iter().map(|id| id as u32).collect();
            *names = arrays.texts(&format!("{stem}_names"))?.unwrap_or_default();
        }
        let about = About::of(words).map_err(|message| source.error(message))?;
        // The file of another program does not state that there is no scale.
        Ok(About { intensity_full_scale: about.intensity_full_scale.filter(|_| full.is_some()), ..about })
    }

    /// The offset of f32 positions in the column `field`; none for other columns.
    pub(super) fn offset(&self, field: Field) -> f64 {
        axis(field).zip(self.f32_origin).map_or(-0.0, |(axis, origin)| origin[axis])
    }

    /// The metadata in `words`.
    ///
    /// # Errors
    /// What is wrong with them.
    fn of(words: WrittenAbout) -> Result<About, String> {
        let frame = words.coordinates.map(|name| named("coordinates", &name)).transpose()?;
        let driver = words.driver.map(|name| named("driver", &name)).transpose()?;
        let sensor_pose = match (words.sensor_position, words.sensor_orientation_xyzw) {
            (Some(position), Some(orientation)) => Some(pose(position, orientation)?),
            _ => None,
        };
        let full_scale = words.intensity_full_scale.filter(|full| !full.is_nan());
        if let Some(full) = full_scale.filter(|&full| !(full > 0.0 && full.is_finite())) {
            return Err(format!("intensity_full_scale is {full}; allowed: a finite number above 0"));
        }
        if words.f32_origin.is_some_and(|origin| !is_place(origin)) {
            return Err("the origin is not a place within 1e18 m".into());
        }
        let labels = Labels::default()
            .category(table("category", words.category_ids, words.category_names)?)
            .part(table("part", words.part_ids, words.part_names)?)
            .material(table("material", words.material_ids, words.material_names)?)
            .instance(table("instance", words.instance_ids, words.instance_names)?);
        Ok(About {
            frame,
            sensor_pose,
            intensity_full_scale: Some(full_scale),
            driver,
            shape: words.shape,
            labels,
            f32_origin: words.f32_origin,
            columns: words.columns,
            ..About::default()
        })
    }
}

/// The value called `name`, which is under `key` in the file.
///
/// # Errors
/// An unknown name.
fn named<T: Named>(key: &str, name: &str) -> Result<T, String> {
    let known = T::NAMES.iter().find(|(known, _)| *known == name).map(|(_, value)| *value);
    known.ok_or_else(|| {
        let names: Vec<&str> = T::NAMES.iter().map(|(known, _)| *known).collect();
        format!("{key} is {name:?}; allowed: {}", names.join(", "))
    })
}

/// Whether `place` is within reach.
fn is_place(place: [f64; 3]) -> bool {
    place.iter().all(|metres| metres.abs() <= FARTHEST)
}

/// A pose from an orientation that need not be exactly of unit length.
///
/// # Errors
/// What is wrong with it.
pub(super) fn pose(position: [f64; 3], orientation: [f64; 4]) -> Result<Pose, String> {
    let orientation = DQuat::from_array(orientation);
    let length = orientation.length();
    if !is_place(position) || !(1e-3..1e3).contains(&length) {
        return Err("the pose of the sensor is not a place within 1e18 m and a quaternion".into());
    }
    let orientation = if (length - 1.0).abs() < 1e-9 { orientation } else { orientation.normalize() };
    Ok(Pose { position: DVec3::from_array(position), orientation })
}

/// Numbers and names of a label column.
///
/// # Errors
/// What is wrong with them.
fn table(stem: &str, ids: Vec<u32>, names: Vec<String>) -> Result<NameTable, String> {
    let rising = ids.is_sorted_by(|a, b| a < b) && ids.first().is_none_or(|&id| id > 0);
    if !rising || ids.len() != names.len() {
        return Err(format!("{stem}_ids are not rising numbers from 1 with as many {stem}_names"));
    }
    Ok(NameTable { ids, names })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_cannot_be_is_an_error() {
        let of = |json: &str| About::parse(Path::new("a.labels.json"), json.as_bytes()).map(|_| ());
        assert!(
            of("{}").is_ok()
                && of(r#"{"more": 1, "shape": [2, 3], "category_ids": [1, 5], "category_names": ["a", "b"]}"#).is_ok()
        );
        for (json, expected) in [
            ("{", "names of labels"),
            (r#"{"coordinates": "lidar"}"#, "allowed: world, sensor"),
            (r#"{"driver": "sick"}"#, "driver is \"sick\"; allowed: velodyne, ouster, hesai"),
            (r#"{"category_ids": [5, 1], "category_names": ["a", "b"]}"#, "category_ids are not rising"),
            (r#"{"part_ids": [0], "part_names": ["a"]}"#, "part_ids"),
            (r#"{"instance_ids": [1], "instance_names": []}"#, "instance_ids"),
            (r#"{"intensity_full_scale": -1}"#, "intensity_full_scale is -1; allowed: a finite number above 0"),
            (r#"{"f32_origin": [0, 0, 1e19]}"#, "origin"),
            (r#"{"sensor_position": [0, 0, 0], "sensor_orientation_xyzw": [0, 0, 0, 0]}"#, "quaternion"),
        ] {
            let error = of(json).unwrap_err().to_string();
            assert!(error.starts_with("a.labels.json: ") && error.contains(expected), "{error}");
        }
    }
}
