//! Points of a cloud as the files of data sets hold them.

use cloud::{Frame, InstanceBox, PointCloud};
use glam::Vec3;
use ground::pose::{Pose, on};
use std::collections::HashMap;
use std::hash::Hash;
use std::ops::Range;

/// The rows of `cloud` that have a position, and the position in the sensor's frame at the start of the scan.
pub(super) fn local(cloud: &PointCloud) -> impl Iterator<Item = (usize, Vec3)> {
    let columns = &cloud.columns;
    let pose = cloud.sensor_pose;
    let back = pose.orientation.inverse();
    let place = move |row: usize| {
        let point = Vec3::new(columns.x[row], columns.y[row], columns.z[row]);
        match cloud.frame {
            Frame::Sensor => point,
            Frame::World => (back * (point.as_dvec3() + (cloud.origin - pose.position))).as_vec3(),
        }
    };
    (0..cloud.len).map(move |row| (row, place(row))).filter(|(_, point)| point.is_finite())
}

/// Runs of rows with the same number, such as that of an instance: neighbours in a scan often hit the same one.
pub(super) fn runs(numbers: &[u32]) -> impl Iterator<Item = (u32, Range<usize>)> {
    let mut end = 0;
    numbers.chunk_by(|a, b| a == b).map(move |run| {
        let start = end;
        end += run.len();
        (run[0], start..end)
    })
}

/// Whether `found`, a name in a scene, is the `known` word of a data set, ignoring case and with `-`, `_` or blanks
/// between its parts.
pub(super) fn is_word(known: &str, found: &str) -> bool {
    let plain = |word: &str| {
        let letters = word.chars().map(|letter| if matches!(letter, '_' | ' ') { '-' } else { letter });
        letters.flat_map(char::to_lowercase).collect::<String>()
    };
    known == found || known.len() == found.len() && plain(known) == plain(found)
}

/// Values for the labels of rows, each computed once; the last one is kept at hand, since neighbours often share it.
pub(super) struct LabelCache<K, V> {
    all: HashMap<K, V>,
    last: Option<(K, V)>,
}

impl<K: Copy + Eq + Hash, V: Copy> LabelCache<K, V> {
    pub fn new() -> LabelCache<K, V> {
        LabelCache { all: HashMap::new(), last: None }
    }

    /// The value for `key`, which is computed if it is not known.
    pub fn of(&mut self, key: K, make: impl FnOnce() -> V) -> V {
        match self.last {
            Some((last, value)) if last == key => value,
            _ => self.last.insert((key, *self.all.entry(key).or_insert_with(make))).1,
        }
    }
}

/// Intensity of a row, 0 to 1.
pub(super) fn remission(cloud: &PointCloud, row: usize) -> f32 {
    let full = cloud.intensity_full_scale.filter(|full| *full > 0.0).unwrap_or(1.0);
    let remission = (cloud.columns.intensity[row] / full).clamp(0.0, 1.0);
    if remission.is_finite() { remission } else { 0.0 }
}

/// Pose of a box around an instance of `cloud` in the world.
pub(super) fn in_world(cloud: &PointCloud, found: &InstanceBox) -> Pose {
    match cloud.frame {
        Frame::World => found.pose,
        Frame::Sensor => on(&cloud.sensor_pose, &found.pose),
    }
}

/// Pose of a box around an instance of `cloud` in the sensor's frame at the start of the scan.
pub(super) fn in_sensor(cloud: &PointCloud, found: &InstanceBox) -> Pose {
    match cloud.frame {
        Frame::World => on(&inverse(&cloud.sensor_pose), &found.pose),
        Frame::Sensor => found.pose,
    }
}

/// The inverse of `pose`.
pub(super) fn inverse(pose: &Pose) -> Pose {
    let back = pose.orientation.inverse();
    Pose { position: -(back * pose.position), orientation: back }
}

#[cfg(test)]
mod tests {
    use super::*;
    use cloud::{Field, FieldSet};
    use glam::DVec3;

    #[test]
    fn points_far_from_the_origin_are_precise_around_the_sensor() {
        let mut cloud = PointCloud { len: 100, origin: DVec3::new(5e5, 5.6e6, 100.0), ..PointCloud::default() };
        cloud.fields = [Field::X, Field::Y, Field::Z].into_iter().collect::<FieldSet>();
        let column = |step: f32| (0..100).map(|row| row as f32 * step - 40.0).collect();
        (cloud.columns.x, cloud.columns.y, cloud.columns.z) = (column(2.7), column(-1.9), column(0.3));
        cloud.sensor_pose = Pose::at(500_003.3, 5_600_001.7, 99.1).with_rpy_deg(3.0, -20.0, 140.0);
        let pose = cloud.sensor_pose;
        for (row, point) in local(&cloud) {
            let place = pose.position + pose.orientation * point.as_dvec3();
            assert!(place.distance(cloud.position(row)) < 1e-3, "{row}: {place}");
        }
    }

    #[test]
    fn words_of_data_sets_are_known_in_any_case() {
        for (known, found, same) in [
            ("car", "Car", true),
            ("traffic-sign", "Traffic Sign", true),
            ("person-sitting", "Person_sitting", true),
            ("vehicle.car", "VEHICLE.CAR", true),
            ("car", "cars", false),
            ("car", "cat", false),
        ] {
            assert_eq!(is_word(known, found), same, "{known} {found}");
        }
    }
}
