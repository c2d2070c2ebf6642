//! SemanticKITTI: each sample is a sequence.

use super::names::numbered;
use super::points::{LabelCache, is_word, local, remission, runs};
use super::style::{Scanned, Style, Writer as Write};
use crate::{Sample, Scan};
use cloud::{Field, FieldSet, PointCloud, VELOCITY};
use glam::{DAffine3, Vec3};
use ground::error::{Error, Result};
use ground::pose::Pose;
use ground::report::Report;
use ground::write;
use serde::Deserialize;
use std::collections::{BTreeSet, HashMap, HashSet};
use std::fmt::Write as _;
use std::path::Path;

/// `sequences/000017/velodyne/000003.bin`, `labels/000003.label`, `poses.txt`, `calib.txt`, `times.txt`.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct SemanticKitti {
    /// Name of the sensor, where there are several.
    pub sensor: Option<String>,
}

/// Numbers of SemanticKITTI's classes (Behley et al. 2019, SemanticKITTI; configuration of its development kit), by the
/// names that scenes use.
const CLASSES: [(&str, u16); 30] = [
    ("unlabeled", 0),
    ("outlier", 1),
    ("car", 10),
    ("bicycle", 11),
    ("bus", 13),
    ("motorcycle", 15),
    ("on-rails", 16),
    ("truck", 18),
    ("other-vehicle", 20),
    ("person", 30),
    ("bicyclist", 31),
    ("motorcyclist", 32),
    ("road", 40),
    ("parking", 44),
    ("sidewalk", 48),
    ("other-ground", 49),
    ("building", 50),
    ("fence", 51),
    ("other-structure", 52),
    ("lane-marking", 60),
    ("vegetation", 70),
    ("trunk", 71),
    ("terrain", 72),
    ("pole", 80),
    ("traffic-sign", 81),
    ("other-object", 99),
    // Categories of generated landscapes.
    ("path", 49),
    ("tree", 70),
    ("bush", 70),
    ("grass", 72),
];

/// Numbers of the classes of moving objects, by those of stationary ones (as above).
const MOVING: [(u16, u16); 8] =
    [(10, 252), (31, 253), (30, 254), (32, 255), (16, 256), (13, 257), (18, 258), (20, 259)];

/// Objects slower than this are stationary, m/s.
const STANDING_M_S: f32 = 0.1;

struct SemanticKittiWriter<'w> {
    folder: &'w Path,
    /// Index of the scan that is written.
    scan: usize,
    poses: String,
    times: String,
    frames: usize,
    /// Sensor pose of the first frame.
    first: Option<Pose>,
}

impl Style for SemanticKitti {
    fn root(&self) -> &'static str {
        "sequences"
    }

    fn folder_per_sample(&self) -> bool {
        true
    }

    fn fields(&self, sample: &Sample) -> FieldSet {
        let own = [Field::X, Field::Y, Field::Z, Field::Intensity, Field::CategoryId, Field::InstanceId];
        own.into_iter().chain(VELOCITY.into_iter().filter(|_| sample.is_moving())).collect()
    }

    fn readme(&self) -> String {
        "`sequences` is laid out as SemanticKITTI, a sequence for each sample. Points are in the sensor's frame (x ahead, y \
         left, z up), and so are poses, relative to the first: `Tr` of `calib.txt` is the identity. Labels have \
         SemanticKITTI's numbers, instance numbers start anew in each scan.\n\n\
         ```python\n\
         import numpy as np\n\
         points = np.fromfile('sequences/000000/velodyne/000000.bin', np.float32).reshape(-1, 4)  # x, y, z, remission\n\
         labels = np.fromfile('sequences/000000/labels/000000.label', np.uint32)\n\
         classes, instances = labels & 0xFFFF, labels >> 16\n\
         ```\n"
            .to_owned()
    }

    fn fits(&self, sample: &Sample) -> Result<()> {
        self.scan(sample).map(drop)
    }

    fn writer<'w>(&'w self, _number: u64, sample: &Sample, folder: &'w Path) -> Result<Box<dyn Write + 'w>> {
        for name in ["velodyne", "labels"] {
            let folder = folder.join(name);
            std::fs::create_dir(&folder).map_err(|source| Error::Io { path: folder, source })?;
        }
        let scan = self.scan(sample)?;
        Ok(Box::new(SemanticKittiWriter {
            folder,
            scan,
            poses: String::new(),
            times: String::new(),
            frames: 0,
            first: None,
        }))
    }
}

impl SemanticKitti {
    /// Index of the scan of `sample` that is written.
    fn scan(&self, sample: &Sample) -> Result<usize> {
        let names = || sample.scans().iter().map(Scan::name).collect::<Vec<_>>().join(", ");
        match (&self.sensor, sample.scans()) {
            (None, [_]) => Ok(0),
            (None, scans) => {
                let found = format!("missing, and there are {} sensors", scans.len());
                Err(Error::invalid("semantic_kitti: sensor", found, format!("one of {}", names())))
            }
            (Some(name), scans) => {
                let found = scans.iter().position(|scan| scan.name() == name);
                found.ok_or_else(|| Error::invalid("semantic_kitti: sensor", format!("{name:?}"), names()))
            }
        }
    }
}

impl Write for SemanticKittiWriter<'_> {
    fn add(&mut self, &Scanned { sample, scan, frame, cloud, .. }: &Scanned) -> Result<Report> {
        let mut report = Report::default();
        if scan != self.scan {
            return Ok(report);
        }
        let columns = &cloud.columns;
        // Points in the sensor's frame at the start of the scan.
        let pose = cloud.sensor_pose;
        // Instances are numbered anew in each scan, since they have 16 bits.
        let mut instances: HashMap<u32, u16> = HashMap::new();
        let moving = if sample.is_moving() { moving(cloud) } else { HashSet::new() };
        let mut unknown = BTreeSet::new();
        let mut label = |category: u32, instance: u32| {
            let name = cloud.labels.category.name(category).unwrap_or("unlabeled");
            let class = CLASSES.iter().find(|(class, _)| is_word(class, name)).map_or_else(
                || {
                    unknown.insert(name.to_owned());
                    0
                },
                |(_, number)| *number,
            );
            let class = match MOVING.iter().find(|(standing, _)| *standing == class) {
                Some((_, moving_class)) if moving.contains(&instance) => *moving_class,
                _ => class,
            };
            let next = u16::try_from(instances.len() + 1).unwrap_or(0);
            let instance = if instance == 0 { 0 } else { *instances.entry(instance).or_insert(next) };
            u32::from(class) | u32::from(instance) << 16
        };
        let mut known = LabelCache::new();
        let [mut points, mut labels] = [16, 4].map(|bytes| Vec::with_capacity(bytes * cloud.len));
        for (row, Vec3 { x, y, z }) in local(cloud) {
            points.extend([x, y, z, remission(cloud, row)].map(f32::to_le_bytes).as_flattened());
            let [category, instance] = [columns.category_id[row], columns.instance_id[row]];
            labels.extend(known.of([category, instance], || label(category, instance)).to_le_bytes());
        }
        if !unknown.is_empty() {
            let names = unknown.into_iter().collect::<Vec<_>>().join(", ");
            report.warn(format!("semantic_kitti: categories that it does not have are unlabeled: {names}"));
        }
        let number = numbered(self.frames as u64);
        write::whole(&self.folder.join(format!("velodyne/{number}.bin")), &points)?;
        write::whole(&self.folder.join(format!("labels/{number}.label")), &labels)?;
        // Relative to the first, as in KITTI's odometry; the calibration is the identity.
        let first = *self.first.get_or_insert(pose);
        let place = |pose: &Pose| DAffine3::from_rotation_translation(pose.orientation, pose.position);
        let from_first = place(&first).inverse() * place(&pose);
        let rows = from_first.matrix3.transpose().to_cols_array();
        let translation = from_first.translation.to_array();
        let numbers = (0..12).map(|k| if k % 4 < 3 { rows[k / 4 * 3 + k % 4] } else { translation[k / 4] });
        let line: Vec<String> = numbers.map(|number| format!("{:e}", number + 0.0)).collect();
        let start = sample.scans()[scan].frames()[frame].start;
        // Writing to a string does not fail.
        let _ = writeln!(self.poses, "{}", line.join(" "));
        let _ = writeln!(self.times, "{start:e}");
        self.frames += 1;
        Ok(report)
    }

    fn finish(self: Box<Self>) -> Result<Report> {
        const CALIBRATION: &str = "P0: 1 0 0 0 0 1 0 0 0 0 1 0\nP1: 1 0 0 0 0 1 0 0 0 0 1 0\n\
                                   P2: 1 0 0 0 0 1 0 0 0 0 1 0\nP3: 1 0 0 0 0 1 0 0 0 0 1 0\n\
                                   Tr: 1 0 0 0 0 1 0 0 0 0 1 0\n";
        for (name, text) in [("poses.txt", self.poses.as_str()), ("times.txt", &self.times), ("calib.txt", CALIBRATION)]
        {
            write::whole(&self.folder.join(name), text.as_bytes())?;
        }
        Ok(Report::default())
    }
}

/// The moving instances, by the mean speed of their points: one leg of a walker stands while the other swings.
fn moving(cloud: &PointCloud) -> HashSet<u32> {
    let columns = &cloud.columns;
    let mut speeds: HashMap<u32, (f32, u32)> = HashMap::new();
    for (instance, rows) in runs(&columns.instance_id).filter(|(instance, _)| *instance != 0) {
        let (sum, count) = speeds.entry(instance).or_default();
        for row in rows {
            let velocity = Vec3::new(columns.velocity_x[row], columns.velocity_y[row], columns.velocity_z[row]);
            if velocity.is_finite() {
                *sum += velocity.length();
                *count += 1;
            }
        }
    }
    speeds.into_iter().filter(|(_, (sum, count))| *sum > STANDING_M_S * *count as f32).map(|(id, _)| id).collect()
}
