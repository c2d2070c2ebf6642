//! The object set of KITTI: a LiDAR and a camera, boxes in the camera's frame, masks.

mod masks;

use super::names::numbered;
use super::points::{in_sensor, inverse, is_word, local, remission};
use super::rig::{self, SensorClass, find, kind, own_velocity, radar_fields};
use super::style::{Scanned, Style, Writer as Write};
use super::whole::Whole;
use crate::Sample;
use crate::sample::BoxScope;
use cloud::export::images::write_layer;
use cloud::export::{ImageLayer, RadarPoints};
use cloud::image::RangeImage;
use cloud::{Field, FieldSet, InstanceBox, PointCloud};
use emitter::{ImageGrid, Intrinsics, Outline};
use glam::{DMat3, DVec3};
use ground::error::{Error, Result};
use ground::pose::{Pose, on};
use ground::report::Report;
use ground::write;
use serde::Deserialize;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::Path;

/// `kitti/training/velodyne/000017.bin`, `label_2`, `calib`, `image_2`, and `ImageSets` (Geiger et al. 2012, Are we
/// ready for autonomous driving?; formats as in its object development kit), with the masks `semantic` and `instance`
/// of its semantic benchmark; detections of a radar, as of View-of-Delft, in `radar`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Kitti {
    /// Name of the LiDAR, where there are several.
    pub velodyne: Option<String>,
    /// Name of the camera, where there are several.
    pub camera: Option<String>,
    /// Name of the radar, where there are several.
    pub radar: Option<String>,
    /// Maximum number of frames of a sample: frame k of sample i is number i * frames + k.
    pub frames: u64,
    /// Whether objects that neither of them sees get boxes, too.
    pub unseen: bool,
    /// Types of categories with names that are not known.
    pub types: BTreeMap<String, String>,
    /// Classes in masks of categories with names that are not known.
    pub classes: BTreeMap<String, String>,
}

impl Default for Kitti {
    fn default() -> Self {
        let [types, classes] = [const { BTreeMap::new() }; 2];
        Kitti { velodyne: None, camera: None, radar: None, frames: 1, unseen: false, types, classes }
    }
}

/// KITTI's types by the names of categories that scenes use.
const TYPES: [(&str, &str); 15] = [
    ("car", "Car"),
    ("van", "Van"),
    ("truck", "Truck"),
    ("person", "Pedestrian"),
    ("pedestrian", "Pedestrian"),
    ("person-sitting", "Person_sitting"),
    ("bicyclist", "Cyclist"),
    ("cyclist", "Cyclist"),
    ("tram", "Tram"),
    ("on-rails", "Tram"),
    ("bus", "Misc"),
    ("trailer", "Misc"),
    ("motorcyclist", "Misc"),
    ("other-vehicle", "Misc"),
    ("misc", "Misc"),
];

/// Smallest visible fraction of an object that counts as fully visible, and as partly occluded.
const VISIBLE: f64 = 0.9;
const PARTLY: f64 = 0.5;

/// Boxes tilted by more than this, degrees, cause a warning: labels have no tilt.
const UPRIGHT_DEG: f64 = 5.0;

struct KittiWriter<'w> {
    style: &'w Kitti,
    number: u64,
    folder: &'w Path,
    /// Indices of the two scans.
    lidar: usize,
    camera: usize,
    /// Index of the scan of the radar, if there is one.
    radar: Option<usize>,
    grid: ImageGrid,
    calibration: String,
    /// For each frame, the boxes of the LiDAR, in its frame, and of the camera, until both are known.
    frames: Vec<[Option<Vec<InstanceBox>>; 2]>,
    /// Categories of objects that have no type.
    untyped: BTreeSet<String>,
    /// Categories that have no class.
    unclassed: BTreeSet<String>,
}

impl Kitti {
    /// Indices of the scans that are written: of the LiDAR and of the camera.
    fn scans(&self, sample: &Sample) -> Result<[usize; 2]> {
        Ok([
            find(sample, "kitti: velodyne", self.velodyne.as_deref(), SensorClass::Lidar)?,
            find(sample, "kitti: camera", self.camera.as_deref(), SensorClass::Camera)?,
        ])
    }

    /// Index of the scan of the radar, if there is one.
    fn radar(&self, sample: &Sample) -> Result<Option<usize>> {
        let any = sample.scans().iter().any(|scan| kind(scan) == SensorClass::Radar);
        if !any && self.radar.is_none() {
            return Ok(None);
        }
        find(sample, "kitti: radar", self.radar.as_deref(), SensorClass::Radar).map(Some)
    }

    /// Type of a category.
    fn of(&self, category: &str) -> Option<&str> {
        let known = || TYPES.iter().find(|(name, _)| is_word(name, category)).map(|(_, of)| *of);
        self.types.get(category).map(String::as_str).or_else(known)
    }

    /// Class of a category.
    fn class(&self, category: &str) -> Option<u32> {
        self.classes.get(category).map_or_else(|| masks::number_of(category), |class| masks::number(class))
    }
}

impl Style for Kitti {
    fn check(&self) -> Result<()> {
        if !(1..=100_000).contains(&self.frames) {
            return Err(Error::invalid("frames", self.frames, "1 to 100000"));
        }
        let word = |word: &String| !word.is_empty() && !word.contains(char::is_whitespace);
        if let Some((category, name)) = self.types.iter().find(|(_, name)| !word(name)) {
            return Err(Error::invalid(format!("types.{category}"), format!("{name:?}"), "a word, such as Car"));
        }
        match self.classes.iter().find(|(_, name)| masks::number(name).is_none()) {
            Some((category, name)) => {
                Err(Error::invalid(format!("classes.{category}"), format!("{name:?}"), masks::classes()))
            }
            None => Ok(()),
        }
    }

    fn root(&self) -> &'static str {
        "kitti"
    }

    fn fields(&self, sample: &Sample) -> FieldSet {
        use Field::{Beam, Blue, CategoryId, Green, InstanceId, Intensity, Range, Red, X, Y, Z};
        let fields = [X, Y, Z, Intensity, CategoryId, InstanceId, Beam, Range, Red, Green, Blue];
        radar_fields(sample).union(fields.into_iter().collect())
    }

    fn boxes(&self, sample: &Sample, scan: usize, _frame: usize) -> BoxScope {
        if self.scans(sample).is_ok_and(|both| both.contains(&scan)) { BoxScope::InSpace } else { BoxScope::None }
    }

    fn fits(&self, sample: &Sample) -> Result<()> {
        let [lidar, camera] = self.scans(sample)?.map(|scan| &sample.scans()[scan]);
        let count = lidar.frames().len() as u64;
        if count > self.frames {
            let found = format!("{}, and a sample has {count}", self.frames);
            return Err(Error::invalid("kitti: frames", found, format!("{count} or more, the most that a sample has")));
        }
        let radar = self.radar(sample)?.map(|scan| &sample.scans()[scan]);
        for other in [camera].into_iter().chain(radar) {
            let same = lidar.frames().len() == other.frames().len()
                && lidar.frames().iter().zip(other.frames()).all(|(a, b)| (a.start - b.start).abs() < 1e-6);
            if !same {
                let found = format!("of sensors that scan at other times, {} and {}", lidar.name(), other.name());
                return Err(Error::invalid(
                    "kitti",
                    found,
                    "both without rate_hz and start_s: a frame of each at once",
                ));
            }
        }
        Ok(())
    }

    fn writer<'w>(&'w self, number: u64, sample: &Sample, folder: &'w Path) -> Result<Box<dyn Write + 'w>> {
        let radar = self.radar(sample)?;
        let folders = ["velodyne", "label_2", "calib", "image_2", "semantic", "instance"];
        for name in folders.into_iter().chain(radar.map(|_| "radar")) {
            let folder = folder.join("training").join(name);
            std::fs::create_dir_all(&folder).map_err(|source| Error::Io { path: folder, source })?;
        }
        let [lidar, camera] = self.scans(sample)?;
        let scans = sample.scans();
        let (grid, intrinsics) =
            rig::camera(&scans[camera]).ok_or_else(|| Error::Internal("a camera that is no pinhole sensor".into()))?;
        let mounts = [lidar, camera].map(|scan| scans[scan].mount());
        let calibration = calibration(&intrinsics, mounts[0], mounts[1], radar.map(|scan| scans[scan].mount()));
        let [untyped, unclassed] = [const { BTreeSet::new() }; 2];
        let frames = vec![[None, None]; scans[lidar].frames().len()];
        let style = self;
        Ok(Box::new(KittiWriter {
            style,
            number,
            folder,
            lidar,
            camera,
            radar,
            grid,
            calibration,
            frames,
            untyped,
            unclassed,
        }))
    }

    fn join(&self, whole: &mut Whole) -> Result<()> {
        for (part, samples) in whole.parts() {
            let mut lines = String::new();
            for sample in samples {
                let clouds = whole.entries[&sample].files.iter().filter_map(|file| {
                    let name = file.path.strip_prefix("kitti/training/velodyne/")?;
                    name.strip_suffix(".bin")
                });
                clouds.for_each(|name| lines += &format!("{name}\n"));
            }
            whole.write(format!("kitti/ImageSets/{part}.txt"), &mut |out| out.write_all(lines.as_bytes()))?;
        }
        Ok(())
    }

    fn readme(&self) -> String {
        "`kitti` is laid out as KITTI's object set. Points are in the LiDAR's frame (x ahead, y left, z up), boxes in the \
         camera's (x right, y down, z ahead), which is rectified: `R0_rect` is the identity, and `P0` to `P3` are the \
         same. Boxes are where objects are when the LiDAR scans them; objects that neither sensor sees have none, unless \
         the scenario requests them (`unseen: true`). \
         Boxes in the image are around the whole object, clipped at the image's edges. `occluded` is 0 where 90 % of \
         what the camera would see of the object alone is visible, 1 from 50 % on, 2 below, and 3 (unknown) where \
         the camera sees nothing of it. `image_2` shows the \
         surfaces' own colours, without light and shadow. `semantic` and `instance` are masks as of KITTI's semantic \
         benchmark: the class of each pixel with the numbers of Cityscapes (road 7, building 11, person 24, car 26), and \
         256 times that plus the number of its instance, which counts those of a class in an image from 1; what has no \
         return, such as the sky, is 0. A radar has detections as of View-of-Delft in `radar`, seven numbers each (x, y, z, \
         RCS, velocity, the same without the radar's own, 0), in its own frame; velocities are negative where it and the \
         target approach each other. All frames are in `training`; `ImageSets` divides them.\n\n\
         ```python\n\
         import numpy as np\n\
         from PIL import Image\n\
         points = np.fromfile('kitti/training/velodyne/000000.bin', np.float32).reshape(-1, 4)  # x, y, z, remission\n\
         objects = [line.split() for line in open('kitti/training/label_2/000000.txt')]\n\
         calibration = {}\n\
         for line in open('kitti/training/calib/000000.txt'):\n    \
             name, _, numbers = line.partition(':')\n    \
             calibration[name] = np.array(numbers.split(), float)\n\
         to_camera = calibration['Tr_velo_to_cam'].reshape(3, 4)\n\
         mask = np.asarray(Image.open('kitti/training/instance/000000.png'))\n\
         classes, instances = mask >> 8, mask & 255\n\
         ```\n"
            .to_owned()
    }
}

impl Write for KittiWriter<'_> {
    fn add(&mut self, &Scanned { sample, scan, frame, cloud, boxes, .. }: &Scanned) -> Result<Report> {
        let mut report = Report::default();
        if ![Some(self.lidar), Some(self.camera), self.radar].contains(&Some(scan)) {
            // Another sensor may have more frames than these.
            report
                .warn(format!("kitti: holds a LiDAR, a camera and a radar, left out: {}", sample.scans()[scan].name()));
            return Ok(report);
        }
        let name = numbered(self.number * self.style.frames + frame as u64);
        let path = |folder: &str, ending: &str| self.folder.join(format!("training/{folder}/{name}.{ending}"));
        if scan == self.lidar {
            let points = local(cloud).map(|(row, point)| [point.x, point.y, point.z, remission(cloud, row)]);
            let bytes: Vec<u8> = points.flatten().flat_map(f32::to_le_bytes).collect();
            write::whole(&path("velodyne", "bin"), &bytes)?;
            write::whole(&path("calib", "txt"), self.calibration.as_bytes())?;
        }
        if self.radar == Some(scan) {
            let velocity = own_velocity(&sample.scans()[scan], frame);
            cloud.write_radar(path("radar", "bin"), RadarPoints::ViewOfDelft, velocity)?;
            return Ok(report);
        }
        if scan == self.camera {
            let image = RangeImage::new(cloud, &self.grid)?;
            write_layer(&image, ImageLayer::Color, None, &path("image_2", "png"), &mut report)?;
            let [semantic, instance] = ["semantic", "instance"].map(|name| path(name, "png"));
            let class = |category: &str| {
                self.style.class(category).unwrap_or_else(|| {
                    self.unclassed.insert(category.to_owned());
                    0
                })
            };
            masks::write(&image, class, [&semantic, &instance], &mut report)?;
        }
        for (place, own_scan) in [self.lidar, self.camera].into_iter().enumerate() {
            if scan == own_scan {
                let own = boxes.iter().map(|found| found.pose(in_sensor(cloud, found)));
                self.frames[frame][place] = Some(own.collect());
            }
        }
        // Sensors arrive in any order.
        if let [Some(met), Some(seen)] = &mut self.frames[frame] {
            let (met, seen) = (std::mem::take(met), std::mem::take(seen));
            self.frames[frame] = [None, None];
            let between = [self.lidar, self.camera].map(|scan| sample.scans()[scan].mount());
            let to_camera = on(&inverse(between[1]), between[0]);
            let file = path("label_2", "txt");
            let lines = self.labels(&met, &seen, &to_camera, cloud, &mut report);
            write::whole(&file, lines.as_bytes())?;
        }
        Ok(report)
    }

    fn finish(self: Box<Self>) -> Result<Report> {
        let mut report = Report::default();
        for (names, what) in [
            (self.untyped, "objects without a type have no box"),
            (self.unclassed, "categories that its masks do not have are unlabeled there"),
        ] {
            if !names.is_empty() {
                report.warn(format!("kitti: {what}: {}", names.into_iter().collect::<Vec<_>>().join(", ")));
            }
        }
        Ok(report)
    }
}

impl KittiWriter<'_> {
    /// The lines of a frame: objects that the camera has `seen`, at the poses where the LiDAR has `met` them, so that
    /// its points are in the boxes. `to_camera` is from the LiDAR.
    fn labels(
        &mut self,
        met: &[InstanceBox],
        seen: &[InstanceBox],
        to_camera: &Pose,
        cloud: &PointCloud,
        report: &mut Report,
    ) -> String {
        let mut lines = String::new();
        for found in seen {
            let own = met.iter().find(|own| own.instance_id == found.instance_id);
            let points = found.points + own.map_or(0, |own| own.points);
            if !self.style.unseen && points == 0 {
                continue;
            }
            let category = cloud.labels.category.name(found.category_id).unwrap_or("unlabelled");
            let Some(of) = self.style.of(category) else {
                self.untyped.insert(category.to_owned());
                continue;
            };
            let place = match own {
                Some(own) => own.pose(on(to_camera, &own.pose)),
                None => *found,
            };
            if let Some(line) = label(&self.grid, of, found, &place) {
                lines += &line;
            }
            if (place.pose.orientation * DVec3::Z).z < UPRIGHT_DEG.to_radians().cos() {
                report.warn("kitti: boxes tilted in the camera's frame are written upright");
            }
        }
        lines
    }
}

/// The line of an object, in the camera's frame as a sensor: its place in the image as the camera has `seen` it, and in
/// space as it was `met`; `None` if it is not in the image.
fn label(grid: &ImageGrid, of: &str, seen: &InstanceBox, met: &InstanceBox) -> Option<String> {
    let to_optical = Intrinsics::FROM_OPTICAL.inverse();
    let whole = around(grid, seen)?;
    let last = [grid.width, grid.height].map(|count| count as f64 - 1.0);
    let cut: [[f64; 2]; 2] = whole.map(|corner| [0, 1].map(|axis| corner[axis].clamp(0.0, last[axis])));
    let area = |[low, high]: [[f64; 2]; 2]| (high[0] - low[0]) * (high[1] - low[1]);
    if area(cut) <= 0.0 {
        return None;
    }
    let truncated = 1.0 - area(cut) / area(whole);
    let occluded = match seen.visible {
        visible if visible >= VISIBLE => 0,
        visible if visible >= PARTLY => 1,
        visible if visible > 0.0 => 2,
        // Unknown to the camera.
        _ => 3,
    };
    let InstanceBox { pose, size, .. } = met;
    let (ahead, up) = (to_optical * (pose.orientation * DVec3::X), pose.orientation * DVec3::Z);
    // KITTI's location is the centre of the bottom face.
    let place = to_optical * (pose.position - up * (0.5 * size.z));
    let turned = (-ahead.z).atan2(ahead.x);
    let angle = |angle: f64| {
        let whole = std::f64::consts::TAU;
        angle - (angle / whole).round() * whole
    };
    let alpha = angle(turned - place.x.atan2(place.z));
    let numbers = [cut[0][0], cut[0][1], cut[1][0], cut[1][1], size.z, size.y, size.x];
    let numbers = numbers.into_iter().chain(place.to_array()).chain([turned]);
    let numbers: Vec<String> = numbers.map(|number| format!("{:.4}", number + 0.0)).collect();
    Some(format!("{of} {:.4} {occluded} {:.4} {}\n", truncated + 0.0, alpha + 0.0, numbers.join(" ")))
}

/// Smallest and largest image coordinates of a box in the camera's frame as a sensor, from the centre of the first
/// pixel; `None` if it is behind the camera.
fn around(grid: &ImageGrid, shown: &InstanceBox) -> Option<[[f64; 2]; 2]> {
    let mut outline = Outline::new(grid, shown.pose.position);
    let corners = shown.corners();
    InstanceBox::EDGES.iter().for_each(|&[a, b]| outline.add([corners[a], corners[b], corners[b]]));
    let [left, top, right, bottom] = outline.done()?.map(|end| end - 0.5);
    Some([[left, top], [right, bottom]])
}

/// `calib/000017.txt` of sensors with these mounts.
fn calibration(intrinsics: &Intrinsics, lidar: &Pose, camera: &Pose, radar: Option<&Pose>) -> String {
    let projection = intrinsics.matrix().map(|[x, y, z]| [x, y, z, 0.0]);
    let mut text = String::new();
    let mut line = |name: &str, numbers: &[f64]| {
        let numbers: Vec<String> = numbers.iter().map(|number| format!("{:.12e}", number + 0.0)).collect();
        // Writing to a string does not fail.
        let _ = writeln!(text, "{name}: {}", numbers.join(" "));
    };
    ["P0", "P1", "P2", "P3"].into_iter().for_each(|name| line(name, projection.as_flattened()));
    line("R0_rect", &DMat3::IDENTITY.to_cols_array());
    let turned = Pose { position: DVec3::ZERO, orientation: Intrinsics::FROM_OPTICAL.inverse() };
    line("Tr_velo_to_cam", &rows(&on(&turned, &on(&inverse(camera), lidar))));
    line("Tr_imu_to_velo", &rows(&inverse(lidar)));
    if let Some(radar) = radar {
        line("Tr_radar_to_cam", &rows(&on(&turned, &on(&inverse(camera), radar))));
    }
    text
}

/// The first three rows of the matrix of `pose`.
fn rows(pose: &Pose) -> [f64; 12] {
    let turned = pose.rotation().transpose().to_cols_array();
    let moved = pose.position.to_array();
    std::array::from_fn(|k| if k % 4 < 3 { turned[k / 4 * 3 + k % 4] } else { moved[k / 4] })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn calibrations_say_where_the_radar_is() {
        let intrinsics = Intrinsics::new([700.0; 2], [620.0, 187.0]);
        let [lidar, camera, radar] =
            [[0.0, 0.0, 1.8], [0.3, 0.0, 1.6], [2.3, 0.5, 0.6]].map(|[x, y, z]| Pose::at(x, y, z));
        let line = |text: &str| text.lines().find_map(|line| line.strip_prefix("Tr_radar_to_cam: ").map(str::to_owned));
        assert_eq!(line(&calibration(&intrinsics, &lidar, &camera, None)), None);
        let found = line(&calibration(&intrinsics, &lidar, &camera, Some(&radar))).unwrap();
        let numbers: Vec<f64> = found.split(' ').map(|number| number.parse().unwrap()).collect();
        // x right, y down, z ahead: 0.5 m on the left, 1 m below, 2 m ahead.
        let expected = [0.0, -1.0, 0.0, -0.5, 0.0, 0.0, -1.0, 1.0, 1.0, 0.0, 0.0, 2.0];
        assert!(numbers.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9), "{numbers:?}");
    }
}
