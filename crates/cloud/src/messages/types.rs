//! Definitions of messages: common_interfaces, rcl_interfaces and geometry2 of ROS 2 Jazzy, vision_msgs 4.1, radar_msgs 0.2,
//! continental_msgs of Nebula, livox_ros_driver2 13eb05e.

/// Types and their members, line by line.
const TYPES: [(&str, &str); 35] = [
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
    (
        "sensor_msgs/LaserScan",
        "std_msgs/Header header\nfloat32 angle_min\nfloat32 angle_max\nfloat32 angle_increment\n\
         float32 time_increment\nfloat32 scan_time\nfloat32 range_min\nfloat32 range_max\nfloat32[] ranges\n\
         float32[] intensities",
    ),
    ("sensor_msgs/LaserEcho", "float32[] echoes"),
    (
        "sensor_msgs/MultiEchoLaserScan",
        "std_msgs/Header header\nfloat32 angle_min\nfloat32 angle_max\nfloat32 angle_increment\n\
         float32 time_increment\nfloat32 scan_time\nfloat32 range_min\nfloat32 range_max\n\
         sensor_msgs/LaserEcho[] ranges\nsensor_msgs/LaserEcho[] intensities",
    ),
    (
        "sensor_msgs/Imu",
        "std_msgs/Header header\ngeometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n\
         geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n\
         geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance",
    ),
    ("geometry_msgs/Twist", "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular"),
    ("geometry_msgs/TwistWithCovariance", "geometry_msgs/Twist twist\nfloat64[36] covariance"),
    (
        "nav_msgs/Odometry",
        "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/PoseWithCovariance pose\n\
         geometry_msgs/TwistWithCovariance twist",
    ),
    ("rosgraph_msgs/Clock", "builtin_interfaces/Time clock"),
    (
        "livox_ros_driver2/CustomPoint",
        "uint32 offset_time\nfloat32 x\nfloat32 y\nfloat32 z\nuint8 reflectivity\nuint8 tag\nuint8 line",
    ),
    (
        "livox_ros_driver2/CustomMsg",
        "std_msgs/Header header\nuint64 timebase\nuint32 point_num\nuint8 lidar_id\nuint8[3] rsvd\n\
         livox_ros_driver2/CustomPoint[] points",
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

/// The definition of `name`, such as `std_msgs/Header`, followed by those of the types in it: the text of a schema
/// `ros2msg` in MCAP. Empty for messages that are not written.
pub fn definition(name: &str) -> String {
    if TYPES.iter().all(|(known, _)| *known != name) {
        return String::new();
    }
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

#[cfg(test)]
mod tests {
    use super::*;

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
