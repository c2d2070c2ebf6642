//! MCAP, the bag format of ROS 2: for each frame a cloud, the pose of its sensor, the boxes, the images of a camera or the
//! detections of a radar, and the messages that the driver of such a sensor publishes; between frames what carries it.
//!
//! Written by the crate `mcap`, in chunks that are compressed by zstd, with an index. Points are in the frame of the
//! sensor and begin with the fields that the driver of its maker publishes; the other columns follow, as in the cloud.

use super::bag::{BagFile, McapChannel};
use super::carrier::{BASE, CarrierTopics, IMU, ODOM};
use super::{Format, FormatInfo, Growing, NEAR, camera, labels_json, radar_messages};
use crate::messages::cdr::{CdrWriter, Stamp};
use crate::messages::{BagOptions, BagTopic, ScanMessage};
use crate::{ColumnType, Driver, Field, Frame, InstanceBox, PackItem, PackType, PointCloud};
use emitter::Intrinsics;
use glam::DVec3;
use ground::pose::Pose;
use ground::report::Report;
use std::io;
use std::path::Path;

pub(super) const MCAP: Mcap = Mcap {
    info: FormatInfo {
        name: "mcap",
        extensions: &["mcap"],
        description: "bag of ROS 2: for each frame a PointCloud2 in the layout of the driver of the sensor's maker, a LaserScan of a \
                      single ring, a Livox's CustomMsg, TFMessage, Detection3DArray; Imu, Odometry and Clock on request",
        needs_positions: true,
        holds_label_names: true,
    },
    driver: None,
};

pub(super) const MCAP_VELODYNE: Mcap = of_driver(
    "mcap_velodyne",
    "bag with points in the layout of Velodyne's driver; time in s since the stamp",
    Driver::Velodyne,
);
pub(super) const MCAP_OUSTER: Mcap = of_driver(
    "mcap_ouster",
    "bag with points in the layout of Ouster's driver; time in ns since the stamp, range in mm",
    Driver::Ouster,
);
pub(super) const MCAP_HESAI: Mcap =
    of_driver("mcap_hesai", "bag with points in the layout of Hesai's driver; time in s of the run", Driver::Hesai);
pub(super) const MCAP_ROBOSENSE: Mcap = of_driver(
    "mcap_robosense",
    "bag with points in the layout of RoboSense's driver; time in s of the run",
    Driver::Robosense,
);
pub(super) const MCAP_LIVOX: Mcap =
    of_driver("mcap_livox", "bag with points in the layout of Livox's driver; time in ns of the run", Driver::Livox);
pub(super) const MCAP_AUTOWARE: Mcap = of_driver(
    "mcap_autoware",
    "bag with points in the layout of Autoware (PointXYZIRCAEDT); time in ns since the stamp",
    Driver::Autoware,
);

/// Bags of one driver, regardless of the sensor.
const fn of_driver(name: &'static str, description: &'static str, driver: Driver) -> Mcap {
    Mcap { info: FormatInfo { name, extensions: &[], description, ..MCAP.info }, driver: Some(driver) }
}

/// A kind of bag.
#[derive(Clone, Copy)]
pub(super) struct Mcap {
    info: FormatInfo,
    /// The driver whose points are written; `None`: that of the cloud.
    driver: Option<Driver>,
}

/// Names of the frames: the world, the sensor, and its images, with z along the optical axis and x to the right (REP
/// 103).
const MAP: &str = "map";
const SENSOR: &str = "sensor";
const OPTICAL: &str = "sensor_optical";
/// The frame of points that are far from the sensor: around the origin of the cloud.
const LOCAL: &str = "local";

/// Name of the column `channel` if the driver has a field of that name.
const LASER: &str = "laser_id";

const TRANSFORMS: &str = "tf2_msgs/TFMessage";

/// Byte order of points and pixels; the numbers around them are always little endian.
const BIG_ENDIAN: bool = cfg!(target_endian = "big");

impl Format for Mcap {
    fn info(&self) -> &FormatInfo {
        &self.info
    }

    fn write(&self, cloud: &PointCloud, path: &Path, report: &mut Report) -> io::Result<()> {
        super::write_alone(Bag::create(self.driver, cloud, path, &BagOptions::default())?, cloud, report)
    }

    fn begin(&self, first: &PointCloud, path: &Path) -> Option<io::Result<Box<dyn Growing>>> {
        self.begin_bag(first, path, &BagOptions::default())
    }

    fn begin_bag(&self, first: &PointCloud, path: &Path, options: &BagOptions) -> Option<io::Result<Box<dyn Growing>>> {
        Some(Bag::create(self.driver, first, path, options).map(|bag| Box::new(bag) as Box<dyn Growing>))
    }
}

/// The contents of a bag that is being written.
struct Bag {
    /// The driver whose points are written; `None`: unknown.
    driver: Option<Driver>,
    file: BagFile,
    transforms: McapChannel,
    points: Option<McapChannel>,
    detections: McapChannel,
    scans: Vec<ScanTopic>,
    images: Option<CameraTopics>,
    radar: Option<RadarTopics>,
    carrier: Option<CarrierTopics>,
    /// Start of the last frame, s.
    last: Option<f64>,
    /// Whether categories were too large for images.
    large: bool,
    /// Whether points were too far from their frame for f32.
    coarse: bool,
    /// Whether times of points were too late for the time field of the driver.
    late: bool,
}

/// The topic of a message with a whole scan.
struct ScanTopic {
    message: ScanMessage,
    channel: McapChannel,
    /// Whether it was requested, rather than there by default.
    requested: bool,
    /// Why a scan is missing that was not requested.
    missing: Option<String>,
}

/// The topics of a camera.
struct CameraTopics {
    camera: McapChannel,
    depth: McapChannel,
    labels: McapChannel,
}

/// The topics of a radar.
struct RadarTopics {
    scan: McapChannel,
    detections: McapChannel,
}

impl Bag {
    fn create(driver: Option<Driver>, first: &PointCloud, path: &Path, options: &BagOptions) -> io::Result<Bag> {
        let driver = driver.or(first.driver);
        let topics = options.topics_of(first, driver).map_err(io::Error::other)?;
        let start = first.begins();
        let mut file = BagFile::create(path)?;
        let mut legend = file.latched("/legend", "std_msgs/String")?;
        let images = camera::of(first);
        let moving = options.motion.as_ref().filter(|_| topics.iter().any(|topic| topic.is_of_motion()));
        let carrier = moving.map(|motion| CarrierTopics::new(&mut file, motion, &topics, start)).transpose()?;
        let fixed = fixed_transforms(images.is_some(), carrier.as_ref());
        let mut latched = if fixed.is_empty() { None } else { Some(file.latched("/tf_static", TRANSFORMS)?) };
        let transforms = file.topic("/tf", TRANSFORMS)?;
        let wants_points = topics.contains(&BagTopic::Points);
        let points = wants_points.then(|| file.topic("/points", "sensor_msgs/PointCloud2")).transpose()?;
        let detections = file.topic("/detections", "vision_msgs/Detection3DArray")?;
        let mut scans = Vec::new();
        for (topic, name) in
            [(BagTopic::Scan, "/scan"), (BagTopic::Echoes, "/echoes"), (BagTopic::Livox, "/livox/lidar")]
        {
            if let Some(message) = topic.message().filter(|_| topics.contains(&topic)) {
                let (channel, requested) = (file.topic(name, message.name())?, options.topics.is_some());
                scans.push(ScanTopic { message, channel, requested, missing: None });
            }
        }
        let radar = radar_messages::is_radar(first).then(|| -> io::Result<RadarTopics> {
            let scan = file.topic("/radar/scan", radar_messages::SCAN)?;
            Ok(RadarTopics { scan, detections: file.topic("/radar/detections", radar_messages::DETECTIONS)? })
        });
        let radar = radar.transpose()?;
        let images = images.map(|_| -> io::Result<CameraTopics> {
            let camera = file.topic("/depth/camera_info", "sensor_msgs/CameraInfo")?;
            let depth = file.topic("/depth/image_rect", "sensor_msgs/Image")?;
            Ok(CameraTopics { camera, depth, labels: file.topic("/labels/image_rect", "sensor_msgs/Image")? })
        });
        let images = images.transpose()?;
        let stamp = Stamp::of(start);
        let mut message = file.message();
        // Each cloud message has a shape of its own.
        message.text(&labels_json(&PointCloud { organised: None, driver, ..first.head() }))?;
        file.send(&mut legend, stamp, message)?;
        if let Some(latched) = &mut latched {
            let message = transforms_message(file.message(), &fixed, stamp)?;
            file.send(latched, stamp, message)?;
        }
        let (large, coarse, late, last) = (false, false, false, None);
        Ok(Bag {
            driver,
            file,
            transforms,
            points,
            detections,
            scans,
            images,
            radar,
            carrier,
            last,
            large,
            coarse,
            late,
        })
    }

    /// Writes the poses of a frame.
    fn add_transforms(&mut self, cloud: &PointCloud, frame: &PointFrame, stamp: Stamp) -> io::Result<()> {
        let mut listed = vec![match &self.carrier {
            None => (MAP, SENSOR, cloud.sensor_pose),
            Some(carrier) => (ODOM, BASE, carrier.under(&cloud.sensor_pose)),
        }];
        if frame.name == LOCAL {
            listed.push((MAP, LOCAL, frame.pose));
        }
        let message = transforms_message(self.file.message(), &listed, stamp)?;
        self.file.send(&mut self.transforms, stamp, message)
    }

    /// Writes the messages that hold a whole scan.
    fn add_scans(&mut self, cloud: &PointCloud) -> io::Result<()> {
        for ScanTopic { message, channel, requested, missing } in &mut self.scans {
            let mut bytes = self.file.message();
            match cloud.write_message(*message, SENSOR, &mut bytes) {
                Ok(stamp) => self.file.send(channel, stamp, bytes)?,
                Err(error) if *requested => return Err(error),
                Err(error) => *missing = Some(error.to_string()),
            }
            self.late |= *message == ScanMessage::LivoxCustom && cloud.is_late_for_livox();
        }
        Ok(())
    }

    /// Writes the images of a camera.
    fn add_images(&mut self, cloud: &PointCloud, stamp: Stamp) -> io::Result<()> {
        let (Some(images), Some(camera)) = (&mut self.images, camera::of(cloud)) else { return Ok(()) };
        let message = camera_info(self.file.message(), cloud, camera, stamp)?;
        self.file.send(&mut images.camera, stamp, message)?;
        let message = depth_image(self.file.message(), cloud, stamp)?;
        self.file.send(&mut images.depth, stamp, message)?;
        if cloud.fields.contains(Field::CategoryId) {
            let message = label_image(self.file.message(), cloud, stamp)?;
            self.file.send(&mut images.labels, stamp, message)?;
            self.large |= cloud.columns.category_id.iter().any(|&id| id > u16::MAX.into());
        }
        Ok(())
    }
}

impl Growing for Bag {
    fn add(&mut self, cloud: &PointCloud) -> io::Result<()> {
        let (start, stamp) = (cloud.begins(), Stamp::of(cloud.begins()));
        self.last = Some(start);
        if let Some(carrier) = &mut self.carrier {
            carrier.write_before(&mut self.file, start)?;
        }
        let frame = PointFrame::of(cloud);
        self.coarse |= frame.coarse;
        self.late |= self.driver.is_some_and(|driver| cloud.time_beyond(driver, stamp.seconds()).is_some());
        self.add_transforms(cloud, &frame, stamp)?;
        if let Some(channel) = &mut self.points {
            let message = points(self.file.message(), self.driver, cloud, &frame, stamp)?;
            self.file.send(channel, stamp, message)?;
        }
        self.add_scans(cloud)?;
        if let Some(boxes) = &cloud.boxes {
            let message = detections(self.file.message(), cloud, boxes, stamp)?;
            self.file.send(&mut self.detections, stamp, message)?;
        }
        if let Some(radar) = &mut self.radar {
            let mut message = self.file.message();
            radar_messages::scan(&mut message, cloud, SENSOR, stamp)?;
            self.file.send(&mut radar.scan, stamp, message)?;
            let mut message = self.file.message();
            radar_messages::detections(&mut message, cloud, SENSOR, stamp)?;
            self.file.send(&mut radar.detections, stamp, message)?;
        }
        self.add_images(cloud, stamp)
    }

    fn finish(&mut self, _: &PointCloud, report: &mut Report) -> io::Result<()> {
        if let (Some(carrier), Some(last)) = (&mut self.carrier, self.last) {
            carrier.write_rest(&mut self.file, last)?;
        }
        if self.large {
            report.warn(format!("mcap: category ids above {} are 0 in label images", u16::MAX));
        }
        if self.coarse {
            report.warn(format!(
                "mcap: positions farther than {NEAR} m from the frame of their points lose precision, as they are f32"
            ));
        }
        if self.late {
            report.warn(
                "mcap: times more than 4.29 s after the stamp are clamped to that: the driver stores nanoseconds in 32 \
                 bits",
            );
        }
        for ScanTopic { message, missing, .. } in &self.scans {
            if let Some(reason) = missing {
                report.warn(format!("mcap: a cloud is not written as {}: {reason}", message.name()));
            }
        }
        self.file.finish()
    }
}

/// A transform: the frame, the frame in it, and its pose.
type ListedTransform = (&'static str, &'static str, Pose);

/// What does not move: the orientation of images, and what is on the carrier. Odometry starts at the origin of the map.
fn fixed_transforms(images: bool, carrier: Option<&CarrierTopics>) -> Vec<ListedTransform> {
    let optical = Pose { orientation: Intrinsics::FROM_OPTICAL, ..Pose::IDENTITY };
    let mut fixed = Vec::new();
    if let Some(carrier) = carrier {
        fixed.push((MAP, ODOM, Pose::IDENTITY));
        fixed.extend([(BASE, SENSOR, *carrier.mount()), (BASE, IMU, Pose::IDENTITY)]);
    }
    fixed.extend(images.then_some((SENSOR, OPTICAL, optical)));
    fixed
}

fn transforms_message(mut message: CdrWriter, listed: &[ListedTransform], stamp: Stamp) -> io::Result<CdrWriter> {
    message.count(listed.len())?;
    for (frame, child, pose) in listed {
        message.header(stamp, frame)?;
        message.text(child)?;
        message.pose(pose);
    }
    Ok(message)
}

fn camera_info(mut message: CdrWriter, cloud: &PointCloud, camera: Intrinsics, stamp: Stamp) -> io::Result<CdrWriter> {
    let matrix = camera.matrix();
    image_header(&mut message, cloud, stamp)?;
    message.text("plumb_bob")?;
    message.count(5)?;
    message.f64s(&[0.0; 5]);
    message.f64s(matrix.as_flattened());
    message.f64s(&[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
    message.f64s(matrix.map(|[x, y, z]| [x, y, z, 0.0]).as_flattened());
    // No binning, and no region of interest.
    (0..6).for_each(|_| message.u32(0));
    message.u8(0);
    Ok(message)
}

/// Distances along the axis, m, NaN where there is none.
fn depth_image(mut message: CdrWriter, cloud: &PointCloud, stamp: Stamp) -> io::Result<CdrWriter> {
    let (c, to_sensor) = (&cloud.columns, cloud.to_frame(&cloud.sensor_pose));
    let computed = |row| to_sensor([c.x[row], c.y[row], c.z[row]])[0];
    let depths: Vec<f32> = if c.depth.is_empty() { (0..cloud.len).map(computed).collect() } else { c.depth.clone() };
    image(&mut message, cloud, "32FC1", bytemuck::cast_slice(&depths), stamp)?;
    Ok(message)
}

fn label_image(mut message: CdrWriter, cloud: &PointCloud, stamp: Stamp) -> io::Result<CdrWriter> {
    let ids: Vec<u16> = cloud.columns.category_id.iter().map(|&id| u16::try_from(id).unwrap_or(0)).collect();
    image(&mut message, cloud, "16UC1", bytemuck::cast_slice(&ids), stamp)?;
    Ok(message)
}

/// The beginning of images and camera information; [`camera::of`] has made sure that the cloud has rows and columns.
fn image_header(message: &mut CdrWriter, cloud: &PointCloud, stamp: Stamp) -> io::Result<()> {
    message.header(stamp, OPTICAL)?;
    cloud.organised.iter().flatten().for_each(|&count| message.u32(count));
    Ok(())
}

fn image(message: &mut CdrWriter, cloud: &PointCloud, encoding: &str, pixels: &[u8], stamp: Stamp) -> io::Result<()> {
    image_header(message, cloud, stamp)?;
    message.text(encoding)?;
    message.u8(BIG_ENDIAN.into());
    message.u32((pixels.len() / cloud.organised.map_or(1, |[rows, _]| rows as usize)) as u32);
    message.zeros(pixels.len())?.copy_from_slice(pixels);
    Ok(())
}

/// The boxes of `cloud`, in its frame.
fn detections(
    mut message: CdrWriter,
    cloud: &PointCloud,
    boxes: &[InstanceBox],
    stamp: Stamp,
) -> io::Result<CdrWriter> {
    let frame = match cloud.frame {
        Frame::World => MAP,
        Frame::Sensor => SENSOR,
    };
    message.header(stamp, frame)?;
    message.count(boxes.len())?;
    for found in boxes {
        message.header(Stamp::of(found.time), frame)?;
        message.count(1)?;
        let name = cloud.labels.category.name(found.category_id).filter(|name| !name.is_empty());
        message.text(&name.map_or_else(|| found.category_id.to_string(), str::to_owned))?;
        message.f64s(&[1.0]);
        message.pose(&found.pose);
        message.f64s(&[0.0; 36]);
        message.pose(&found.pose);
        message.vector(found.size);
        message.text(&found.track_id.to_string())?;
    }
    Ok(message)
}

/// The points of `cloud`, as `driver` publishes them.
fn points(
    mut message: CdrWriter,
    driver: Option<Driver>,
    cloud: &PointCloud,
    frame: &PointFrame,
    stamp: Stamp,
) -> io::Result<CdrWriter> {
    let turned;
    let (mut shape, mut cloud) = (cloud.shape(), cloud);
    if let Some(order) = driver.and_then(|driver| cloud.order_of(driver)) {
        turned = cloud.select(&order.rows).map_err(io::Error::other)?;
        (cloud, shape) = (&turned, order.shape);
    }
    let ([height, width], known) = (shape, driver.unwrap_or(Driver::Velodyne));
    let (fields, items, step) = record_of(known, cloud, stamp);
    message.header(stamp, frame.name)?;
    message.count(height)?;
    message.count(width)?;
    message.count(fields.len())?;
    for &(name, kind, offset) in &fields {
        message.text(name)?;
        message.u32(offset as u32);
        message.u8(number_of(kind));
        message.u32(1);
    }
    message.u8(BIG_ENDIAN.into());
    message.u32(step as u32);
    message.count(width.saturating_mul(step))?;
    let bytes = message.zeros(cloud.len.saturating_mul(step))?;
    cloud.pack(&items, step, bytes).map_err(io::Error::other)?;
    cloud.put_made(known, step, &frame.pose, bytes);
    // Hesai's driver never reports it.
    let dense = driver != Some(Driver::Hesai)
        && [&cloud.columns.x, &cloud.columns.y, &cloud.columns.z].into_iter().flatten().all(|x| x.is_finite());
    message.u8(dense.into());
    Ok(message)
}

/// The frame of the points of a cloud.
struct PointFrame {
    name: &'static str,
    /// Where it is in the world.
    pose: Pose,
    /// Whether points are too far from it for f32.
    coarse: bool,
}

impl PointFrame {
    /// The sensor, unless f32 is too coarse relative to it, as when the pose of the sensor is unknown. Relative to the
    /// origin of the cloud, f32 is as fine as in the cloud.
    fn of(cloud: &PointCloud) -> PointFrame {
        let is_world = cloud.frame == Frame::World;
        let from = if is_world { cloud.sensor_pose.position } else { DVec3::ZERO };
        let far = reach(cloud, from) > NEAR;
        if !(far && is_world) {
            return PointFrame { name: SENSOR, pose: cloud.sensor_pose, coarse: far };
        }
        let coarse = reach(cloud, cloud.origin) > NEAR;
        PointFrame { name: LOCAL, pose: Pose { position: cloud.origin, ..Pose::IDENTITY }, coarse }
    }
}

/// Greatest distance of the points of `cloud` from `from` along an axis.
fn reach(cloud: &PointCloud, from: DVec3) -> f64 {
    let c = &cloud.columns;
    let axes = [&c.x, &c.y, &c.z].into_iter().zip((cloud.origin - from).to_array());
    let along = |(column, shift): (&Vec<f32>, f64)| {
        let finite = column.iter().filter(|x| x.is_finite());
        finite.fold(0.0, |most: f64, &x| most.max((f64::from(x) + shift).abs()))
    };
    axes.map(along).fold(0.0, f64::max)
}

/// Name, type and first byte of a number in each point of a message.
type MessageField = (&'static str, PackType, usize);

/// The fields of a point of a message, the columns that they come from, and its size. The bytes of a column that the
/// cloud lacks are left free.
fn record_of(driver: Driver, cloud: &PointCloud, stamp: Stamp) -> (Vec<MessageField>, Vec<PackItem>, usize) {
    let (mut fields, mut items) = (Vec::new(), Vec::new());
    let mut others = cloud.fields.without(Field::X).without(Field::Y).without(Field::Z);
    for field in driver.point_fields().iter().filter(|field| field.is_in(cloud)) {
        fields.push((field.name, field.kind, field.offset));
        if let Some(item) = field.item(cloud, stamp.seconds()) {
            others = others.without(item.field);
            items.push(item);
        }
    }
    let mut size = driver.point_step();
    // As expected by viewers: 0x00RRGGBB, declared as a float.
    const COLOUR: [Field; 3] = [Field::Blue, Field::Green, Field::Red];
    if COLOUR.iter().all(|&field| others.contains(field)) {
        fields.push(("rgb", PackType::F32, size));
        for (byte, field) in COLOUR.into_iter().enumerate() {
            items.push(PackItem::new(field, PackType::U8, size + byte));
            others = others.without(field);
        }
        size += PackType::F32.size();
    }
    for info in others.iter() {
        let kind = match info.kind {
            // Positions in the world.
            ColumnType::F32 if cloud.offset(info.field).is_some_and(|offset| offset != 0.0) => PackType::F64,
            ColumnType::F32 => PackType::F32,
            ColumnType::F64 => PackType::F64,
            ColumnType::U8 => PackType::U8,
            ColumnType::U16 => PackType::U16,
            ColumnType::U32 => PackType::U32,
        };
        let taken = fields.iter().any(|(name, ..)| *name == info.name);
        // Autoware's channels are rings.
        let name = if taken && info.field == Field::Channel { LASER } else { info.name };
        fields.push((name, kind, size));
        items.push(PackItem::new(info.field, kind, size));
        size += kind.size();
    }
    (fields, items, size)
}

/// The number of a type of points in `sensor_msgs/PointField`.
fn number_of(kind: PackType) -> u8 {
    match kind {
        PackType::I8 => 1,
        PackType::U8 => 2,
        PackType::I16 => 3,
        PackType::U16 => 4,
        PackType::I32 => 5,
        PackType::U32 => 6,
        PackType::F32 => 7,
        PackType::F64 | PackType::I64 | PackType::U64 => 8,
    }
}
