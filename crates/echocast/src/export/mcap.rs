//! MCAP, the bags of ROS 2: for each frame a cloud, the pose of its sensor, the boxes, and the images of a camera.
//!
//! Written by the crate `mcap`, in chunks that are compressed by zstd, with an index. Points are in the frame of the
//! sensor and begin with what a driver publishes of them; the other columns follow, as they are in the cloud.

use super::ros::{Message, Stamp, definition};
use super::{Format, FormatInfo, Growing, NEAR, Sink, camera, labels_json};
use crate::cloud::record::{self, BLOCK_BYTES};
use crate::cloud::{ColumnType, Field, Frame, InstanceBox, PackItem, PackType, PointCloud};
use crate::emitter::Intrinsics;
use crate::ground::parallel;
use crate::ground::pose::Pose;
use crate::ground::report::Report;
use ::mcap::records::MessageHeader;
use ::mcap::{Compression, McapError, WriteOptions, Writer};
use glam::{DMat3, DVec3};
use std::collections::BTreeMap;
use std::io;
use std::path::Path;

pub(super) const MCAP: Mcap = Mcap {
    info: FormatInfo {
        name: "mcap",
        extensions: &["mcap"],
        description: "bag of ROS 2: for each frame a PointCloud2 as of Velodyne's driver, TFMessage, Detection3DArray",
        needs_positions: true,
        holds_label_names: true,
    },
    layout: &VELODYNE,
};

pub(super) const MCAP_OUSTER: Mcap = Mcap {
    info: FormatInfo {
        name: "mcap_ouster",
        extensions: &[],
        description: "bag with points as of Ouster's driver; time in ns, range in mm",
        ..MCAP.info
    },
    layout: &OUSTER,
};

pub(super) const MCAP_LIVOX: Mcap = Mcap {
    info: FormatInfo {
        name: "mcap_livox",
        extensions: &[],
        description: "bag with points as of Livox's driver; time in ns",
        ..MCAP.info
    },
    layout: &LIVOX,
};

/// A kind of bag.
#[derive(Clone, Copy)]
pub(super) struct Mcap {
    info: FormatInfo,
    layout: &'static Layout,
}

/// What the frames are called: the world, the sensor, and its images, which look along z with x to the right (REP 103).
const MAP: &str = "map";
const SENSOR: &str = "sensor";
const OPTICAL: &str = "sensor_optical";
/// The frame of points that are far from the sensor: around the origin of the cloud.
const LOCAL: &str = "local";

/// Order of the bytes of points and pixels; numbers around them are little endian everywhere.
const BIG_ENDIAN: bool = cfg!(target_endian = "big");

/// Fast enough for as many points as drivers publish; higher levels save little of what is mostly noise.
const COMPRESSION_LEVEL: u32 = 1;

/// Quality of service of a topic whose last message is for those who come later: history keeps the last (1), it is
/// reliable (1), transient local (1) and alive by itself (1); times are infinite.
const FOR_LATER: &str = "- history: 1
  depth: 1
  reliability: 1
  durability: 1
  deadline: {sec: 9223372036, nsec: 854775807}
  lifespan: {sec: 9223372036, nsec: 854775807}
  liveliness: 1
  liveliness_lease_duration: {sec: 9223372036, nsec: 854775807}
  avoid_ros_namespace_conventions: false
";

/// What a driver publishes of a point.
struct Layout {
    members: &'static [Member],
    /// Bytes of a point.
    size: usize,
}

struct Member {
    name: &'static str,
    kind: PackType,
    offset: usize,
    value: Value,
}

#[derive(Clone, Copy, PartialEq)]
enum Value {
    /// Coordinate in the sensor frame; x, y and z are the first members, side by side.
    Place,
    /// The column, times this.
    Column(Field, f64),
    /// Time since the stamp, s, times this.
    Since(f64),
    /// Intensity, 255 at its full scale.
    Reflectivity,
    /// Number of the return in bits 4 and 5.
    Tag,
    /// Nothing that is simulated.
    Zero,
}

const fn member(name: &'static str, kind: PackType, offset: usize, value: Value) -> Member {
    Member { name, kind, offset, value }
}

/// `PointcloudXYZIRT` of github.com/ros-drivers/velodyne, velodyne_pointcloud/src/lib/pointcloudXYZIRT.cpp; times count
/// from the stamp.
const VELODYNE: Layout = Layout {
    size: 22,
    members: &[
        member("x", PackType::F32, 0, Value::Place),
        member("y", PackType::F32, 4, Value::Place),
        member("z", PackType::F32, 8, Value::Place),
        member("intensity", PackType::F32, 12, Value::Column(Field::Intensity, 1.0)),
        member("ring", PackType::U16, 16, Value::Column(Field::Channel, 1.0)),
        member("time", PackType::F32, 18, Value::Since(1.0)),
    ],
};

/// `ouster_ros::Point` of github.com/ouster-lidar/ouster-ros, ouster-ros/include/ouster_ros/os_point.h, aligned to 16
/// bytes; times count from the stamp, in ns, and ranges are in mm.
const OUSTER: Layout = Layout {
    size: 48,
    members: &[
        member("x", PackType::F32, 0, Value::Place),
        member("y", PackType::F32, 4, Value::Place),
        member("z", PackType::F32, 8, Value::Place),
        member("intensity", PackType::F32, 16, Value::Column(Field::Intensity, 1.0)),
        member("t", PackType::U32, 20, Value::Since(1e9)),
        member("reflectivity", PackType::U16, 24, Value::Reflectivity),
        member("ring", PackType::U16, 26, Value::Column(Field::Channel, 1.0)),
        member("ambient", PackType::U16, 28, Value::Zero),
        member("range", PackType::U32, 32, Value::Column(Field::Range, 1e3)),
    ],
};

/// `LivoxPointXyzrtlt` of github.com/Livox-SDK/livox_ros_driver2, src/lds.h, and its fields, src/lddc.cpp; times are
/// those of the run, in ns. Tags: "Livox HAP user manual", point cloud data.
const LIVOX: Layout = Layout {
    size: 26,
    members: &[
        member("x", PackType::F32, 0, Value::Place),
        member("y", PackType::F32, 4, Value::Place),
        member("z", PackType::F32, 8, Value::Place),
        member("intensity", PackType::F32, 12, Value::Column(Field::Intensity, 1.0)),
        member("tag", PackType::U8, 16, Value::Tag),
        member("line", PackType::U8, 17, Value::Column(Field::Channel, 1.0)),
        member("timestamp", PackType::F64, 18, Value::Column(Field::Time, 1e9)),
    ],
};

impl Format for Mcap {
    fn info(&self) -> &FormatInfo {
        &self.info
    }

    fn write(&self, cloud: &PointCloud, path: &Path, report: &mut Report) -> io::Result<()> {
        super::write_alone(Bag::create(self.layout, cloud, path)?, cloud, report)
    }

    fn begin(&self, first: &PointCloud, path: &Path) -> Option<io::Result<Box<dyn Growing>>> {
        Some(Bag::create(self.layout, first, path).map(|bag| Box::new(bag) as Box<dyn Growing>))
    }
}

/// A file that is being written.
struct Bag {
    layout: &'static Layout,
    writer: Writer<Sink>,
    transforms: Channel,
    points: Channel,
    detections: Channel,
    images: Option<Images>,
    /// Whether categories were too large for images.
    large: bool,
    /// Whether points were too far from their frame for f32.
    coarse: bool,
    /// Memory of the last message.
    bytes: Vec<u8>,
}

/// The topics of a camera.
struct Images {
    camera: Channel,
    depth: Channel,
    labels: Channel,
}

/// A topic.
struct Channel {
    id: u16,
    /// Messages so far.
    count: u32,
}

impl Bag {
    fn create(layout: &'static Layout, first: &PointCloud, path: &Path) -> io::Result<Bag> {
        let options = WriteOptions::new()
            .profile("ros2")
            .library(concat!("echocast ", env!("CARGO_PKG_VERSION")))
            .compression(Some(Compression::Zstd))
            .compression_level(COMPRESSION_LEVEL)
            // Several would compress differently.
            .compression_threads(0);
        let mut writer = options.create(Sink::create(path)?).map_err(io_error)?;
        let mut channel = |topic: &str, kind: &str, service: &str| {
            let (package, name) = kind.split_once('/').unwrap_or_default();
            let schema = writer.add_schema(&format!("{package}/msg/{name}"), "ros2msg", definition(kind).as_bytes())?;
            let metadata = BTreeMap::from([("offered_qos_profiles".to_owned(), service.to_owned())]);
            writer.add_channel(schema, topic, "cdr", &metadata).map(|id| Channel { id, count: 0 })
        };
        let mut legend = channel("/legend", "std_msgs/String", FOR_LATER).map_err(io_error)?;
        let transforms = channel("/tf", "tf2_msgs/TFMessage", "").map_err(io_error)?;
        let points = channel("/points", "sensor_msgs/PointCloud2", "").map_err(io_error)?;
        let detections = channel("/detections", "vision_msgs/Detection3DArray", "").map_err(io_error)?;
        let mut images = |_| {
            let camera = channel("/depth/camera_info", "sensor_msgs/CameraInfo", "")?;
            let depth = channel("/depth/image_rect", "sensor_msgs/Image", "")?;
            Ok(Images { camera, depth, labels: channel("/labels/image_rect", "sensor_msgs/Image", "")? })
        };
        let images = camera::of(first).map(&mut images).transpose().map_err(io_error)?;
        let (large, coarse, bytes) = (false, false, Vec::new());
        let mut bag = Bag { layout, writer, transforms, points, detections, images, large, coarse, bytes };
        let mut message = bag.message();
        // Each message has a shape of its own.
        message.text(&labels_json(&PointCloud { organised: None, ..first.head() }))?;
        send(&mut bag.writer, &mut legend, stamp(first), message).map(|bytes| bag.bytes = bytes)?;
        Ok(bag)
    }

    /// A message, in the memory of the last.
    fn message(&mut self) -> Message {
        Message::new(std::mem::take(&mut self.bytes))
    }
}

impl Growing for Bag {
    fn add(&mut self, cloud: &PointCloud) -> io::Result<()> {
        let stamp = stamp(cloud);
        let from = if cloud.frame == Frame::World { placed(cloud).1.position } else { DVec3::ZERO };
        self.coarse |= reach(cloud, from) > NEAR;
        let message = transforms(self.message(), cloud, self.images.is_some(), stamp)?;
        self.bytes = send(&mut self.writer, &mut self.transforms, stamp, message)?;
        let message = points(self.message(), self.layout, cloud, stamp)?;
        self.bytes = send(&mut self.writer, &mut self.points, stamp, message)?;
        if let Some(boxes) = &cloud.boxes {
            let message = detections(self.message(), cloud, boxes, stamp)?;
            self.bytes = send(&mut self.writer, &mut self.detections, stamp, message)?;
        }
        if let (Some(images), Some(camera)) = (&mut self.images, camera::of(cloud)) {
            let message = camera_info(Message::new(std::mem::take(&mut self.bytes)), cloud, camera, stamp)?;
            let bytes = send(&mut self.writer, &mut images.camera, stamp, message)?;
            let message = depth_image(Message::new(bytes), cloud, stamp)?;
            self.bytes = send(&mut self.writer, &mut images.depth, stamp, message)?;
            if cloud.fields.contains(Field::CategoryId) {
                let message = label_image(Message::new(std::mem::take(&mut self.bytes)), cloud, stamp)?;
                self.bytes = send(&mut self.writer, &mut images.labels, stamp, message)?;
                self.large |= cloud.columns.category_id.iter().any(|&id| id > u16::MAX.into());
            }
        }
        Ok(())
    }

    fn finish(&mut self, _: &PointCloud, report: &mut Report) -> io::Result<()> {
        if self.large {
            report.warn(format!("mcap: category ids above {} are 0 in label images", u16::MAX));
        }
        if self.coarse {
            report.warn(format!(
                "mcap: positions farther than {NEAR} m from the frame of their points lose precision, as f32 has it there"
            ));
        }
        self.writer.finish().map(drop).map_err(io_error)
    }
}

/// Writes `message` and returns its memory.
fn send(writer: &mut Writer<Sink>, channel: &mut Channel, stamp: Stamp, message: Message) -> io::Result<Vec<u8>> {
    let bytes = message.bytes();
    let (log_time, publish_time) = (stamp.log_time(), stamp.log_time());
    let header = MessageHeader { channel_id: channel.id, sequence: channel.count, log_time, publish_time };
    writer.write_to_known_channel(&header, &bytes).map_err(io_error)?;
    channel.count = channel.count.wrapping_add(1);
    Ok(bytes)
}

fn io_error(error: McapError) -> io::Error {
    match error {
        McapError::Io(error) => error,
        McapError::Parse(error) => io::Error::other(error),
        other => io::Error::other(other),
    }
}

/// When `cloud` begins: its scan, else its first point.
fn stamp(cloud: &PointCloud) -> Stamp {
    let first = || cloud.columns.time.iter().copied().filter(|time| time.is_finite()).min_by(f64::total_cmp);
    Stamp::of(cloud.start_time.or_else(first).unwrap_or(0.0))
}

/// Where the sensor is, and how its images lie.
fn transforms(mut message: Message, cloud: &PointCloud, images: bool, stamp: Stamp) -> io::Result<Message> {
    let optical = Pose { orientation: Intrinsics::FROM_OPTICAL, ..Pose::IDENTITY };
    let mut told = vec![(MAP, SENSOR, cloud.sensor_pose)];
    if images {
        told.push((SENSOR, OPTICAL, optical));
    }
    let (frame, pose) = placed(cloud);
    if frame == LOCAL {
        told.push((MAP, LOCAL, pose));
    }
    message.count(told.len())?;
    for (frame, child, pose) in &told {
        message.header(stamp, frame)?;
        message.text(child)?;
        message.pose(pose);
    }
    Ok(message)
}

fn camera_info(mut message: Message, cloud: &PointCloud, camera: Intrinsics, stamp: Stamp) -> io::Result<Message> {
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
fn depth_image(mut message: Message, cloud: &PointCloud, stamp: Stamp) -> io::Result<Message> {
    let (c, to_sensor) = (&cloud.columns, into_frame(cloud, &cloud.sensor_pose));
    let computed = |row| to_sensor([c.x[row], c.y[row], c.z[row]])[0];
    let depths: Vec<f32> = if c.depth.is_empty() { (0..cloud.len).map(computed).collect() } else { c.depth.clone() };
    image(&mut message, cloud, "32FC1", bytemuck::cast_slice(&depths), stamp)?;
    Ok(message)
}

fn label_image(mut message: Message, cloud: &PointCloud, stamp: Stamp) -> io::Result<Message> {
    let ids: Vec<u16> = cloud.columns.category_id.iter().map(|&id| u16::try_from(id).unwrap_or(0)).collect();
    image(&mut message, cloud, "16UC1", bytemuck::cast_slice(&ids), stamp)?;
    Ok(message)
}

/// What images and their camera begin with; [`camera::of`] has made sure that the cloud has rows and columns.
fn image_header(message: &mut Message, cloud: &PointCloud, stamp: Stamp) -> io::Result<()> {
    message.header(stamp, OPTICAL)?;
    cloud.organised.iter().flatten().for_each(|&count| message.u32(count));
    Ok(())
}

fn image(message: &mut Message, cloud: &PointCloud, encoding: &str, pixels: &[u8], stamp: Stamp) -> io::Result<()> {
    image_header(message, cloud, stamp)?;
    message.text(encoding)?;
    message.u8(BIG_ENDIAN.into());
    message.u32((pixels.len() / cloud.organised.map_or(1, |[rows, _]| rows as usize)) as u32);
    message.zeros(pixels.len())?.copy_from_slice(pixels);
    Ok(())
}

/// The boxes of `cloud`, in the frame in which they are.
fn detections(mut message: Message, cloud: &PointCloud, boxes: &[InstanceBox], stamp: Stamp) -> io::Result<Message> {
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

/// A number that each point of a message has.
struct PointField {
    name: &'static str,
    kind: PackType,
    offset: usize,
}

/// The points of `cloud`.
fn points(mut message: Message, layout: &Layout, cloud: &PointCloud, stamp: Stamp) -> io::Result<Message> {
    let (fields, items, step) = record_of(layout, cloud, stamp);
    let [height, width] = cloud.organised.map_or([1, cloud.len], |shape| shape.map(|count| count as usize));
    let (frame, pose) = placed(cloud);
    message.header(stamp, frame)?;
    message.count(height)?;
    message.count(width)?;
    message.count(fields.len())?;
    for field in &fields {
        message.text(field.name)?;
        message.u32(field.offset as u32);
        message.u8(number_of(field.kind));
        message.u32(1);
    }
    message.u8(BIG_ENDIAN.into());
    message.u32(step as u32);
    message.count(width.saturating_mul(step))?;
    let bytes = message.zeros(cloud.len.saturating_mul(step))?;
    cloud.pack(&items, step, bytes).map_err(io::Error::other)?;
    let tag = layout.members.iter().find(|member| member.value == Value::Tag && present(member, cloud));
    let c = &cloud.columns;
    let to_frame = into_frame(cloud, &pose);
    let rows = (BLOCK_BYTES / step).max(1);
    parallel::for_each_chunk(bytes, rows * step, |block, records| {
        let rows = block * rows..block * rows + records.len() / step;
        record::put(records, step, 0, rows.clone(), |row| to_frame([c.x[row], c.y[row], c.z[row]]));
        if let Some(tag) = tag {
            record::put(records, step, tag.offset, &c.return_number[rows], |number| (*number).min(3) << 4);
        }
    });
    let dense = [&c.x, &c.y, &c.z].into_iter().flatten().all(|x| x.is_finite());
    message.u8(dense.into());
    Ok(message)
}

/// The frame of the points of `cloud`, and where it is in the world: the sensor, unless f32 is too coarse from there, as
/// where the pose of the sensor is not known. Around the origin of the cloud it is as fine as in the cloud.
fn placed(cloud: &PointCloud) -> (&'static str, Pose) {
    let sensor = (SENSOR, cloud.sensor_pose);
    let far = cloud.frame == Frame::World && reach(cloud, cloud.sensor_pose.position) > NEAR;
    if far { (LOCAL, Pose { position: cloud.origin, ..Pose::IDENTITY }) } else { sensor }
}

/// How far the points of `cloud` are along an axis from `from`, at most.
fn reach(cloud: &PointCloud, from: DVec3) -> f64 {
    let c = &cloud.columns;
    let axes = [&c.x, &c.y, &c.z].into_iter().zip((cloud.origin - from).to_array());
    let along = |(column, shift): (&Vec<f32>, f64)| {
        let finite = column.iter().filter(|x| x.is_finite());
        finite.fold(0.0, |most: f64, &x| most.max((f64::from(x) + shift).abs()))
    };
    axes.map(along).fold(0.0, f64::max)
}

/// Takes positions of `cloud` to the frame at `pose`; those in the frame of the sensor stay.
fn into_frame(cloud: &PointCloud, pose: &Pose) -> impl Fn([f32; 3]) -> [f32; 3] + use<> {
    let pose = if cloud.frame == Frame::World { *pose } else { Pose::IDENTITY };
    let (turn, shift) = (DMat3::from_quat(pose.orientation.inverse()), cloud.origin - pose.position);
    move |place| (turn * (DVec3::from(place.map(f64::from)) + shift)).as_vec3().to_array()
}

/// Whether the cloud has what `member` is made of.
fn present(member: &Member, cloud: &PointCloud) -> bool {
    let field = match member.value {
        Value::Place | Value::Zero => return true,
        Value::Column(field, _) => field,
        Value::Since(_) => Field::Time,
        Value::Reflectivity => Field::Intensity,
        Value::Tag => Field::ReturnNumber,
    };
    cloud.fields.contains(field)
}

/// What a point of a message has, where its numbers come from, and its size. Where the cloud lacks a column, its place
/// is left free.
fn record_of(layout: &Layout, cloud: &PointCloud, stamp: Stamp) -> (Vec<PointField>, Vec<PackItem>, usize) {
    let (mut fields, mut items) = (Vec::new(), Vec::new());
    let mut others = cloud.fields.without(Field::X).without(Field::Y).without(Field::Z);
    for member in layout.members.iter().filter(|member| present(member, cloud)) {
        let &Member { name, kind, offset, value } = member;
        fields.push(PointField { name, kind, offset });
        let mut item = |field, shift, scale| items.push(PackItem { field, kind, offset, shift, scale });
        match value {
            Value::Column(field, scale) => {
                item(field, 0.0, scale);
                others = others.without(field);
            }
            Value::Since(scale) => {
                item(Field::Time, stamp.seconds(), scale);
                others = others.without(Field::Time);
            }
            Value::Reflectivity => {
                item(Field::Intensity, 0.0, cloud.intensity_full_scale.map_or(1.0, |full| 255.0 / f64::from(full)));
            }
            Value::Place | Value::Tag | Value::Zero => {}
        }
    }
    let mut size = layout.size;
    // As programs that show colours know them: 0x00RRGGBB, called a float.
    const COLOUR: [Field; 3] = [Field::Blue, Field::Green, Field::Red];
    if COLOUR.iter().all(|&field| others.contains(field)) {
        fields.push(PointField { name: "rgb", kind: PackType::F32, offset: size });
        for (byte, field) in COLOUR.into_iter().enumerate() {
            items.push(PackItem::new(field, PackType::U8, size + byte));
            others = others.without(field);
        }
        size += PackType::F32.size();
    }
    for info in others.iter() {
        let kind = match info.kind {
            // Of positions in the world.
            ColumnType::F32 if cloud.offset(info.field).is_some_and(|offset| offset != 0.0) => PackType::F64,
            ColumnType::F32 => PackType::F32,
            ColumnType::F64 => PackType::F64,
            ColumnType::U8 => PackType::U8,
            ColumnType::U16 => PackType::U16,
            ColumnType::U32 => PackType::U32,
        };
        fields.push(PointField { name: info.name, kind, offset: size });
        items.push(PackItem::new(info.field, kind, size));
        size += kind.size();
    }
    (fields, items, size)
}

/// The number that `sensor_msgs/PointField` has for a type that points have.
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
