//! Messages of ROS 2: their definitions and their bytes.
//!
//! Definitions: common_interfaces and geometry2 of ROS 2 Jazzy, vision_msgs 4.1, radar_msgs 0.2, continental_msgs of
//! Nebula. Bytes: CDR (OMG, DDS-XTypes 1.3,
//! 7.4.1), little endian: each number is at a multiple of its size, counted from the end of the four-byte header.

use echocast_memory::tried;
use glam::{DQuat, DVec3};
use ground::pose::Pose;
use std::io;

/// Types and their members, line by line.
const TYPES: [(&str, &str); 25] = [
    ("builtin_interfaces/Time", "int32 sec\nuint32 nanosec"),
    ("std_msgs/Header", "builtin_interfaces/Time stamp\nstring frame_id"),
    ("std_msgs/String", "string data"),
    ("geometry_msgs/Point", "float64 x\nfloat64 y\nfloat64 z"),
    ("geometry_msgs/Vector3", "float64 x\nfloat64 y\nfloat64 z"),
    ("geometry_msgs/Quaternion", "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1"),
    ("geometry_msgs/Pose", "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation"),
    ("geometry_msgs/PoseWithCovariance", "geometry_msgs/Pose pose\nfloat64[36] covariance"),
    ("geometry_msgs/Transform", "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation"),
    (
        "geometry_msgs/TransformStamped",
        "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform",
    ),
    ("tf2_msgs/TFMessage", "geometry_msgs/TransformStamped[] transforms"),
    (
        "sensor_msgs/PointField",
        "uint8 INT8=1\nuint8 UINT8=2\nuint8 INT16=3\nuint8 UINT16=4\nuint8 INT32=5\nuint8 UINT32=6\nuint8 FLOAT32=7\n\
         uint8 FLOAT64=8\nstring name\nuint32 offset\nuint8 datatype\nuint32 count",
    ),
    (
        "sensor_msgs/PointCloud2",
        "std_msgs/Header header\nuint32 height\nuint32 width\nsensor_msgs/PointField[] fields\nbool is_bigendian\n\
         uint32 point_step\nuint32 row_step\nuint8[] data\nbool is_dense",
    ),
    (
        "sensor_msgs/Image",
        "std_msgs/Header header\nuint32 height\nuint32 width\nstring encoding\nuint8 is_bigendian\nuint32 step\n\
         uint8[] data",
    ),
    ("sensor_msgs/RegionOfInterest", "uint32 x_offset\nuint32 y_offset\nuint32 height\nuint32 width\nbool do_rectify"),
    (
        "sensor_msgs/CameraInfo",
        "std_msgs/Header header\nuint32 height\nuint32 width\nstring distortion_model\nfloat64[] d\nfloat64[9] k\n\
         float64[9] r\nfloat64[12] p\nuint32 binning_x\nuint32 binning_y\nsensor_msgs/RegionOfInterest roi",
    ),
    ("vision_msgs/ObjectHypothesis", "string class_id\nfloat64 score"),
    (
        "vision_msgs/ObjectHypothesisWithPose",
        "vision_msgs/ObjectHypothesis hypothesis\ngeometry_msgs/PoseWithCovariance pose",
    ),
    ("vision_msgs/BoundingBox3D", "geometry_msgs/Pose center\ngeometry_msgs/Vector3 size"),
    (
        "vision_msgs/Detection3D",
        "std_msgs/Header header\nvision_msgs/ObjectHypothesisWithPose[] results\nvision_msgs/BoundingBox3D bbox\n\
         string id",
    ),
    ("vision_msgs/Detection3DArray", "std_msgs/Header header\nvision_msgs/Detection3D[] detections"),
    (
        "radar_msgs/RadarReturn",
        "float32 range\nfloat32 azimuth\nfloat32 elevation\nfloat32 doppler_velocity\nfloat32 amplitude",
    ),
    ("radar_msgs/RadarScan", "std_msgs/Header header\nradar_msgs/RadarReturn[] returns"),
    (
        "continental_msgs/ContinentalArs548Detection",
        "float32 azimuth_angle\nfloat32 azimuth_angle_std\nbool invalid_distance\nbool invalid_distance_std\n\
         bool invalid_azimuth\nbool invalid_azimuth_std\nbool invalid_elevation\nbool invalid_elevation_std\n\
         bool invalid_range_rate\nbool invalid_range_rate_std\nfloat32 elevation_angle\nfloat32 elevation_angle_std\n\
         float32 range\nfloat32 range_std\nfloat32 range_rate\nfloat32 range_rate_std\nint8 rcs\nuint16 measurement_id\n\
         uint8 raw_positive_predictive_value\nuint8 classification\nuint8 raw_multi_target_probability\n\
         uint16 object_id\nuint8 raw_ambiguity_flag",
    ),
    (
        "continental_msgs/ContinentalArs548DetectionList",
        "std_msgs/Header header\nuint8 stamp_sync_status\ngeometry_msgs/Point origin_pos\nfloat32 origin_pitch\n\
         float32 origin_pitch_std\nfloat32 origin_yaw\nfloat32 origin_yaw_std\nfloat32 ambiguity_free_velocity_min\n\
         float32 ambiguity_free_velocity_max\nfloat32 alignment_azimuth_correction\n\
         float32 alignment_elevation_correction\nuint8 alignment_status\n\
         continental_msgs/ContinentalArs548Detection[] detections",
    ),
];

/// The definition of `name`, such as `std_msgs/Header`, followed by those of the types in it.
pub(super) fn definition(name: &str) -> String {
    let members = |name: &str| TYPES.iter().find(|(known, _)| *known == name).map_or("", |(_, members)| members);
    let mut text = members(name).to_owned();
    let mut names = vec![name];
    let mut next = 0;
    while let Some(&name) = names.get(next) {
        if next > 0 {
            text += &format!("\n{}\nMSG: {name}\n{}", "=".repeat(80), members(name));
        }
        for line in members(name).lines() {
            let kind = line.split([' ', '[']).next().unwrap_or_default();
            if kind.contains('/') && !names.contains(&kind) {
                names.push(kind);
            }
        }
        next += 1;
    }
    text + "\n"
}

/// A time, ns since the start of the run.
#[derive(Clone, Copy)]
pub(super) struct Stamp(pub i64);

impl Stamp {
    /// `time` in s.
    pub fn of(time: f64) -> Stamp {
        Stamp((time * 1e9).round() as i64)
    }

    /// As bags count time: never below 0.
    pub fn log_time(self) -> u64 {
        self.0.max(0) as u64
    }

    pub fn seconds(self) -> f64 {
        self.0 as f64 / 1e9
    }
}

/// The bytes of a message that is being written.
pub(super) struct CdrWriter(Vec<u8>);

/// Bytes before a message: its encoding.
const HEADER: [u8; 4] = [0, 1, 0, 0];

impl CdrWriter {
    /// An empty message in the memory of `bytes`.
    pub fn new(mut bytes: Vec<u8>) -> CdrWriter {
        bytes.clear();
        bytes.extend(HEADER);
        CdrWriter(bytes)
    }

    pub fn bytes(self) -> Vec<u8> {
        self.0
    }

    fn number<const N: usize>(&mut self, bytes: [u8; N]) {
        let at = (self.0.len() - HEADER.len()).next_multiple_of(N) + HEADER.len();
        self.0.resize(at, 0);
        self.0.extend(bytes);
    }

    pub fn u8(&mut self, value: u8) {
        self.0.push(value);
    }

    pub fn i8(&mut self, value: i8) {
        self.number(value.to_le_bytes());
    }

    pub fn u16(&mut self, value: u16) {
        self.number(value.to_le_bytes());
    }

    pub fn u32(&mut self, value: u32) {
        self.number(value.to_le_bytes());
    }

    pub fn f32s(&mut self, values: &[f32]) {
        values.iter().for_each(|value| self.number(value.to_le_bytes()));
    }

    pub fn f64s(&mut self, values: &[f64]) {
        values.iter().for_each(|value| self.number(value.to_le_bytes()));
    }

    /// The number of bytes or members that follow.
    pub fn count(&mut self, count: usize) -> io::Result<()> {
        let count = u32::try_from(count).map_err(|_| {
            let reason = format!("{count} bytes of a frame are too many for a message, which holds {}", u32::MAX);
            io::Error::new(io::ErrorKind::FileTooLarge, reason)
        })?;
        self.u32(count);
        Ok(())
    }

    pub fn text(&mut self, text: &str) -> io::Result<()> {
        // It is terminated by a zero.
        let text = text.split('\0').next().unwrap_or_default();
        self.count(text.len() + 1)?;
        self.0.extend(text.as_bytes());
        self.0.push(0);
        Ok(())
    }

    pub fn header(&mut self, stamp: Stamp, frame: &str) -> io::Result<()> {
        const SECOND: i64 = 1_000_000_000;
        let seconds = stamp.0.div_euclid(SECOND).clamp(i32::MIN.into(), i32::MAX.into()) as i32;
        self.number(seconds.to_le_bytes());
        self.u32(stamp.0.rem_euclid(SECOND) as u32);
        self.text(frame)
    }

    pub fn vector(&mut self, vector: DVec3) {
        self.f64s(&vector.to_array());
    }

    pub fn quaternion(&mut self, quaternion: DQuat) {
        self.f64s(&quaternion.to_array());
    }

    /// A pose, or a transform.
    pub fn pose(&mut self, pose: &Pose) {
        self.vector(pose.position);
        self.quaternion(pose.orientation);
    }

    /// Adds `count` and as many zeros, to be filled.
    pub fn zeros(&mut self, count: usize) -> io::Result<&mut [u8]> {
        self.count(count)?;
        let start = self.0.len();
        tried(|| self.0.try_reserve(count + 8)).map_err(|_| io::ErrorKind::OutOfMemory)?;
        self.0.resize(start + count, 0);
        Ok(&mut self.0[start..])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_at_multiples_of_their_size_behind_the_header() {
        let mut message = CdrWriter::new(vec![7; 3]);
        message.u8(1);
        message.u32(2);
        message.text("ab").unwrap();
        message.f64s(&[1.0]);
        let numbers = [0, 1, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0, 3, 0, 0, 0, b'a', b'b', 0, 0];
        assert_eq!(message.0, [&numbers[..], &1f64.to_le_bytes()].concat());
        assert!(message.count(1 << 32).unwrap_err().to_string().contains("too many for a message"));
    }

    #[test]
    fn times_have_whole_seconds_below_them() {
        let mut message = CdrWriter::new(Vec::new());
        message.header(Stamp::of(-0.25), "").unwrap();
        assert_eq!(message.0[4..8], (-1i32).to_le_bytes());
        assert_eq!(message.0[8..12], 750_000_000u32.to_le_bytes());
        assert_eq!((Stamp::of(-0.25).log_time(), Stamp::of(2.5).log_time()), (0, 2_500_000_000));
    }

    #[test]
    fn definitions_hold_the_types_that_they_need() {
        let text = definition("tf2_msgs/TFMessage");
        assert!(text.starts_with("geometry_msgs/TransformStamped[] transforms\n===="), "{text}");
        assert_eq!(text.matches("\nMSG: ").count(), 6, "{text}");
        for (name, _) in TYPES {
            for line in definition(name).lines().filter(|line| !line.starts_with("MSG") && !line.starts_with('=')) {
                let kind = line.split([' ', '[']).next().unwrap();
                assert!(!kind.contains('/') || TYPES.iter().any(|(known, _)| *known == kind), "{line}");
            }
        }
    }
}
