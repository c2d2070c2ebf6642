//! Messages of ROS 2 in bags, read back with their published definitions, and the same packed.

use echocast::emitter::ImuModel;
use echocast::export::{self, GrowingFile};
use echocast::messages::{self, BagMotion, BagOptions, BagTopic, ScanMessage};
use echocast::{BuiltScene, FieldSet, Named as _, PointCloud, Pose, ScanOptions, Scene, Sensor, Trajectory};
use echocast_tests::{python, root};
use glam::{DQuat, DVec3};
use serde_json::Value;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// What the reader says of bags.
fn read(files: &[PathBuf]) -> Vec<Value> {
    let output = python().arg(root().join("tests/readers/messages.py")).args(files).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

fn indoor() -> BuiltScene {
    Scene::load(root().join("examples/scenes/indoor-1.glb")).unwrap().build().unwrap()
}

/// In a room of it.
fn inside() -> Pose {
    Pose::at(-6.0, 6.0, 1.2).with_rpy_deg(0.0, 0.0, 30.0)
}

/// The only message of a topic.
fn only<'v>(bag: &'v Value, topic: &str) -> &'v Value {
    let all = bag["topics"][topic].as_array().unwrap_or_else(|| panic!("no {topic}"));
    assert_eq!(all.len(), 1, "{topic}");
    &all[0]
}

fn number(value: &Value) -> f64 {
    value.as_f64().or_else(|| value.as_str().and_then(|text| text.parse().ok())).unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(number).collect()
}

fn vector(value: &Value) -> DVec3 {
    DVec3::from(["x", "y", "z"].map(|axis| number(&value[axis])))
}

/// A transform, or a pose.
fn pose(value: &Value, [place, turn]: [&str; 2]) -> Pose {
    let q = ["x", "y", "z", "w"].map(|axis| number(&value[turn][axis]));
    Pose { position: vector(&value[place]), orientation: DQuat::from_array(q) }
}

fn stamp(message: &Value) -> f64 {
    let time = &message["header"]["stamp"];
    number(&time["sec"]) + 1e-9 * number(&time["nanosec"])
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut text, byte| {
        write!(text, "{byte:02x}").unwrap();
        text
    })
}

/// Beginnings of the hashes of the definitions that ROS 2 and Livox publish.
const HASHES: [(&str, &str); 8] = [
    ("sensor_msgs/msg/LaserScan", "64c19139"),
    ("sensor_msgs/msg/MultiEchoLaserScan", "ba5eac34"),
    ("livox_ros_driver2/msg/CustomMsg", "2eb17e5e"),
    ("sensor_msgs/msg/Imu", "7d9a00ff"),
    ("nav_msgs/msg/Odometry", "3cc97dc7"),
    ("rosgraph_msgs/msg/Clock", "692f7a66"),
    ("sensor_msgs/msg/PointCloud2", "9198cabf"),
    ("tf2_msgs/msg/TFMessage", "e369d0f0"),
];

fn assert_hashes(bag: &Value, types: &[&str]) {
    for kind in types {
        let (_, begin) = HASHES.iter().find(|(known, _)| known == kind).unwrap();
        let hash = bag["hashes"][*kind].as_str().unwrap_or_else(|| panic!("no {kind}"));
        assert!(hash.starts_with(&format!("RIHS01_{begin}")), "{kind}: {hash}");
    }
}

/// The ranges of a scan are those of the points at its angles; the other beams have none.
fn assert_ranges_of_points(message: &Value, cloud: &PointCloud) {
    let scan = &message["message"];
    let (ranges, intensities) = (numbers(&scan["ranges"]), numbers(&scan["intensities"]));
    let [start, end, step] = ["angle_min", "angle_max", "angle_increment"].map(|name| number(&scan[name]));
    assert!((start + (ranges.len() - 1) as f64 * step - end).abs() < 1e-4);
    assert_eq!(ranges.len(), intensities.len());
    let c = cloud.columns();
    let mut expected = vec![(f64::INFINITY, 0.0); ranges.len()];
    for row in cloud.return_rows().filter(|&row| c.return_number()[row] == 1) {
        let beam = c.beam()[row] as usize;
        expected[beam] = (c.range()[row].into(), c.intensity()[row].into());
        let off = start + beam as f64 * step - f64::from(c.azimuth()[row]);
        let turns = (off / std::f64::consts::TAU).round();
        assert!((off - turns * std::f64::consts::TAU).abs() < 1e-5, "beam {beam} is off by {off}");
    }
    let found: Vec<(f64, f64)> = ranges.into_iter().zip(intensities).collect();
    assert_eq!(found, expected);
    assert!(expected.iter().filter(|(range, _)| range.is_finite()).count() > 100);
}

#[test]
fn a_single_ring_has_a_laser_scan_beside_its_points() {
    let folder = tempfile::tempdir().unwrap();
    let built = indoor();
    let fields = FieldSet::parse("default,beam,azimuth").unwrap();
    let (mut clouds, mut files) = (Vec::new(), Vec::new());
    for (preset, organised) in
        [("hokuyo_ust10lx", false), ("slamtec_rplidar_a1", true), ("sick_lms111", false), ("hokuyo_ust10lx", true)]
    {
        let sensor = Sensor::preset(preset).unwrap();
        let options = ScanOptions::default().fields(fields).organised(organised).start_time(2.5);
        let cloud = built.scan(&sensor, &Trajectory::fixed(inside()), &options).unwrap();
        assert_eq!(cloud.scan_line, sensor.scan_line());
        let path = folder.path().join(format!("{preset} {organised}.mcap"));
        assert!(cloud.write(&path).unwrap().warnings.is_empty());
        files.push(path);
        clouds.push((sensor, cloud));
    }
    for (bag, (sensor, cloud)) in read(&files).iter().zip(&clouds) {
        assert_hashes(bag, &["sensor_msgs/msg/LaserScan", "sensor_msgs/msg/PointCloud2", "tf2_msgs/msg/TFMessage"]);
        let told = only(bag, "/scan");
        assert_eq!(told["type"], "sensor_msgs/msg/LaserScan");
        assert_ranges_of_points(told, cloud);
        only(bag, "/points");
        assert!(bag["topics"].get("/echoes").is_none());
        let scan = &told["message"];
        let range = sensor.spec().range;
        assert!((number(&scan["range_min"]) - range.min_m).abs() < 1e-6);
        assert!((number(&scan["range_max"]) - range.max_m.unwrap()).abs() < 1e-5);
        assert!((number(&scan["scan_time"]) - sensor.beams().period).abs() < 1e-6);
        let beams = sensor.beams();
        let step = (beams.time[beams.len() - 1] - beams.time[0]) / (beams.len() - 1) as f64;
        assert!((number(&scan["time_increment"]) - step).abs() < 1e-9);
        assert!((stamp(scan) - 2.5 - beams.time[0]).abs() < 1e-8);
        assert_eq!(scan["header"]["frame_id"], "sensor");
        // A turn clockwise, as it fires.
        assert_eq!(number(&scan["angle_increment"]) < 0.0, sensor.name() == "slamtec_rplidar_a1");
        // The packed message is the same, from whatever columns.
        let packed = cloud.message(ScanMessage::LaserScan, "sensor").unwrap();
        assert_eq!(told["bytes"], hex(&packed));
    }
    for (_, cloud) in &clouds {
        let whole = cloud.message(ScanMessage::LaserScan, "sensor").unwrap();
        let columns = cloud.columns();
        for without in ["x,y,z,range,intensity,return_number,azimuth", "x,y,z,range,intensity,return_number"] {
            let fields = FieldSet::parse(without).unwrap();
            let mut fewer = PointCloud::new(fields, cloud.len()).unwrap();
            (fewer.origin, fewer.sensor_pose) = (cloud.origin, cloud.sensor_pose);
            (fewer.scan_line, fewer.start_time) = (cloud.scan_line, cloud.start_time);
            let c = fewer.columns_mut();
            c.x.copy_from_slice(columns.x());
            c.y.copy_from_slice(columns.y());
            c.z.copy_from_slice(columns.z());
            c.range.copy_from_slice(columns.range());
            c.intensity.copy_from_slice(columns.intensity());
            c.return_number.copy_from_slice(columns.return_number());
            if !c.azimuth.is_empty() {
                c.azimuth.copy_from_slice(columns.azimuth());
            }
            assert!(fewer.message(ScanMessage::LaserScan, "sensor").unwrap() == whole, "{without}");
        }
    }
}

#[test]
fn several_returns_are_echoes() {
    let folder = tempfile::tempdir().unwrap();
    let mut sensor = Sensor::preset("sick_lms111").unwrap();
    sensor.set("returns.mode", "all").unwrap();
    let fields = FieldSet::parse("default,beam,azimuth").unwrap();
    let options = ScanOptions::default().fields(fields);
    let mut cloud = indoor().scan(&sensor, &Trajectory::fixed(inside()), &options).unwrap();
    let path = folder.path().join("a.mcap");
    cloud.write(&path).unwrap();
    let bag = &read(std::slice::from_ref(&path))[0];
    assert_hashes(bag, &["sensor_msgs/msg/MultiEchoLaserScan"]);
    let told = only(bag, "/echoes");
    assert_ranges_of_points(only(bag, "/scan"), &cloud);
    assert_eq!(told["bytes"], hex(&cloud.message(ScanMessage::MultiEchoLaserScan, "sensor").unwrap()));
    let echoes = |name: &str| -> Vec<Vec<f64>> {
        told["message"][name].as_array().unwrap().iter().map(|it| numbers(&it["echoes"])).collect()
    };
    let c = cloud.columns();
    let mut expected: Vec<Vec<f64>> = vec![Vec::new(); sensor.beams().len()];
    for row in 0..cloud.len() {
        assert_eq!(usize::from(c.return_number()[row]), expected[c.beam()[row] as usize].len() + 1);
        expected[c.beam()[row] as usize].push(c.range()[row].into());
    }
    expected.iter_mut().filter(|ranges| ranges.is_empty()).for_each(|ranges| ranges.push(f64::INFINITY));
    assert_eq!(echoes("ranges"), expected);
    let lengths = |all: &[Vec<f64>]| all.iter().map(Vec::len).collect::<Vec<_>>();
    assert_eq!(lengths(&echoes("intensities")), lengths(&expected));
    // Edges return twice.
    assert!(lengths(&expected).contains(&2));
    // Two frames are no scan, which is an error where it was requested.
    cloud.append(&cloud.clone()).unwrap();
    let message = cloud.message(ScanMessage::LaserScan, "sensor").unwrap_err().to_string();
    assert!(message.contains("twice; allowed: the points of one frame"), "{message}");
    let warnings = cloud.write(&path).unwrap().warnings;
    assert!(warnings[0].starts_with("mcap: a cloud is not written as sensor_msgs/LaserScan: "), "{warnings:?}");
    let requested = BagOptions::default().topics(vec![BagTopic::Scan]);
    assert!(export::write_with(&cloud, &path, None, &requested).is_err());
}

#[test]
fn a_livox_has_the_message_of_its_driver() {
    let folder = tempfile::tempdir().unwrap();
    let built = indoor();
    let sensor = Sensor::preset("livox_mid360").unwrap();
    let fields = FieldSet::parse("default,ring").unwrap();
    let path = folder.path().join("livox.mcap");
    for organised in [false, true] {
        let options = ScanOptions::default().fields(fields).start_time(1.25).organised(organised);
        let cloud = built.scan(&sensor, &Trajectory::fixed(inside()), &options).unwrap();
        assert!(cloud.write(&path).unwrap().warnings.is_empty());
        let bag = &read(std::slice::from_ref(&path))[0];
        assert_hashes(bag, &["livox_ros_driver2/msg/CustomMsg"]);
        let message = &only(bag, "/livox/lidar")["message"];
        assert_eq!(message["timebase"], 1_250_000_000u64);
        assert_eq!((stamp(message), &message["lidar_id"]), (1.25, &Value::from(0)));
        assert_eq!(message["point_num"], cloud.len());
        let points = message["points"].as_array().unwrap();
        assert_eq!(points.len(), cloud.len());
        let c = cloud.columns();
        let turn = inside().orientation.conjugate();
        let mut before = 0.0;
        for (row, point) in points.iter().enumerate() {
            let place = turn * (cloud.position(row) - inside().position);
            let expected = if place.is_finite() { place } else { DVec3::ZERO };
            assert!((vector(point) - expected).length() < 1e-5, "{row}");
            let since = number(&point["offset_time"]);
            assert!((1e-9 * since + 1.25 - c.time()[row]).abs() < 1e-9 && since >= before);
            before = since;
            let intensity = if c.intensity()[row].is_nan() { 0.0 } else { f64::from(c.intensity()[row]) };
            assert!((number(&point["reflectivity"]) - intensity).abs() <= 0.5);
            assert_eq!((&point["tag"], &point["line"]), (&Value::from(c.return_number()[row] << 4), &Value::from(0)));
        }
        let packed = cloud.message(ScanMessage::LivoxCustom, "sensor").unwrap();
        // Encoding 4, stamp 8, text 11 and 5 free bytes, four numbers of 8, 4, 4 and 4 bytes, points of 20 but for the last.
        assert_eq!(packed.len(), 4 + 24 + 8 + 3 * 4 + 20 * cloud.len() - 1);
        let message = cloud.message(ScanMessage::LaserScan, "sensor").unwrap_err().to_string();
        assert!(message.contains("LiDAR with a single ring"), "{message}");
        let mut late = cloud;
        late.columns_mut().time[7] += 5.0;
        assert!(late.message(ScanMessage::LivoxCustom, "sensor").unwrap_err().to_string().contains("4.294967 s"));
    }
}

/// A circle of 4 m at 0.5 rad/s, heading along it, tilted by 3 degrees; a pose every 10 ms.
fn circle() -> Trajectory {
    let key = |step: u32| {
        let (time, angle) = (f64::from(step) / 100.0, f64::from(step) / 200.0);
        let pose = Pose::at(4.0 * angle.cos(), 4.0 * angle.sin(), 1.0);
        (time, pose.with_rpy_deg(3.0, 0.0, angle.to_degrees() + 90.0))
    };
    Trajectory::new((0..=500).map(key).collect()).unwrap()
}

/// Records three frames of a sensor that rides on `carrier`.
fn record(path: &Path, carrier: &Trajectory, mount: Pose, topics: Vec<BagTopic>, imu: ImuModel) {
    let sensor = Sensor::preset("hokuyo_ust10lx").unwrap();
    let (built, trajectory) = (indoor(), carrier.mounted(&mount).unwrap());
    let motion = BagMotion { carrier: Arc::new(carrier.clone()), estimate: None, mount, imu, seed: 5, scan_time: 0.5 };
    let options = BagOptions::default().topics(topics).motion(motion);
    let mut file = None;
    for start in [1.0, 1.5, 2.0] {
        let scan = ScanOptions::default().start_time(start);
        let cloud = built.scan(&sensor, &trajectory, &scan).unwrap();
        let file = file.get_or_insert_with(|| GrowingFile::begin_with(path, None, &cloud, &options).unwrap().unwrap());
        file.add(&cloud).unwrap();
    }
    file.unwrap().finish().unwrap();
}

#[test]
fn what_carries_a_sensor_has_an_imu_odometry_and_a_clock() {
    let folder = tempfile::tempdir().unwrap();
    let (still, moving) = (folder.path().join("still.mcap"), folder.path().join("moving.mcap"));
    let carrier = circle();
    let mount = Pose::at(0.3, -0.1, 0.5).with_rpy_deg(0.0, 5.0, 90.0);
    let topics = vec![BagTopic::Scan, BagTopic::Imu, BagTopic::Odom, BagTopic::Clock];
    record(&moving, &carrier, mount, topics, ImuModel::Ideal);
    record(&still, &Trajectory::fixed(inside()), Pose::IDENTITY, vec![BagTopic::Imu], ImuModel::XsensMti10);
    let bags = read(&[moving, still]);
    let bag = &bags[0];
    assert_hashes(bag, &["sensor_msgs/msg/Imu", "nav_msgs/msg/Odometry", "rosgraph_msgs/msg/Clock"]);
    assert_eq!(bag["latched"], serde_json::json!(["/legend", "/tf_static"]));
    assert_eq!(bag["in_order"], true);
    assert!(bag["topics"].get("/points").is_none());
    let all = |bag: &Value, topic: &str| bag["topics"][topic].as_array().unwrap().clone();
    // From the first frame to the end of the last.
    for (topic, rate) in [("/imu", 200.0), ("/odom", 50.0), ("/clock", 100.0)] {
        let times: Vec<f64> = all(bag, topic).iter().map(|it| 1e-9 * number(&it["time"])).collect();
        assert_eq!(times.len(), (1.5 * rate) as usize, "{topic}");
        assert!(times.iter().enumerate().all(|(n, time)| (time - 1.0 - n as f64 / rate).abs() < 1e-8), "{topic}");
    }
    let tilt = DQuat::from_rotation_x(3f64.to_radians());
    for it in all(bag, "/imu") {
        let imu = &it["message"];
        assert_eq!(imu["header"]["frame_id"], "imu_link");
        // Towards the centre, to the left, and upwards.
        let force = tilt.conjugate() * DVec3::new(0.0, 0.25 * 4.0, 9.806_65);
        assert!((vector(&imu["linear_acceleration"]) - force).length() < 0.005, "{imu}");
        let rate = tilt.conjugate() * DVec3::new(0.0, 0.0, 0.5);
        assert!((vector(&imu["angular_velocity"]) - rate).length() < 1e-6, "{imu}");
        assert_eq!(numbers(&imu["orientation_covariance"])[0], -1.0);
        assert!(numbers(&imu["angular_velocity_covariance"]).iter().all(|&it| it == 0.0));
    }
    for it in all(bag, "/odom") {
        let odometry = &it["message"];
        assert_eq!(
            (&odometry["header"]["frame_id"], &odometry["child_frame_id"]),
            (&"odom".into(), &"base_link".into())
        );
        let found = pose(&odometry["pose"]["pose"], ["position", "orientation"]);
        let expected = carrier.at(stamp(odometry));
        assert!((found.position - expected.position).length() < 1e-9);
        assert!(found.orientation.angle_between(expected.orientation) < 1e-7);
        // In the frame of the carrier: ahead, wherever that is in the world.
        let twist = &odometry["twist"]["twist"];
        assert!((vector(&twist["linear"]) - DVec3::new(2.0, 0.0, 0.0)).length() < 0.006, "{twist}");
        let rate = tilt.conjugate() * DVec3::new(0.0, 0.0, 0.5);
        assert!((vector(&twist["angular"]) - rate).length() < 1e-6, "{twist}");
    }
    for it in all(bag, "/clock") {
        let clock = &it["message"]["clock"];
        assert_eq!(number(&clock["sec"]) * 1e9 + number(&clock["nanosec"]), number(&it["time"]));
    }
    // The chain of frames leads from the map to where the sensor was.
    let placed = |topic: &str, at: usize, parent: &str, child: &str| -> Pose {
        let message = all(bag, topic).remove(at);
        let list = message["message"]["transforms"].as_array().unwrap();
        let found = list.iter().find(|it| it["header"]["frame_id"] == parent && it["child_frame_id"] == child);
        let found = found.unwrap_or_else(|| panic!("no {parent} to {child}"));
        pose(&found["transform"], ["translation", "rotation"])
    };
    let on = |carrier: Pose, mount: Pose| Pose {
        position: carrier.position + carrier.orientation * mount.position,
        orientation: carrier.orientation * mount.orientation,
    };
    for (at, start) in [1.0, 1.5, 2.0].into_iter().enumerate() {
        let base = on(placed("/tf_static", 0, "map", "odom"), placed("/tf", at, "odom", "base_link"));
        let sensor = on(base, placed("/tf_static", 0, "base_link", "sensor"));
        let expected = carrier.mounted(&mount).unwrap().at(start);
        assert!((sensor.position - expected.position).length() < 1e-9);
        assert!(sensor.orientation.angle_between(expected.orientation) < 1e-7);
        assert_eq!(placed("/tf_static", 0, "base_link", "imu_link"), Pose::IDENTITY);
    }
    // At rest, with the noise that the message tells of.
    let noisy = all(&bags[1], "/imu");
    assert_eq!(noisy.len(), 150);
    let model = ImuModel::XsensMti10;
    for (name, covariance, rest, sigma) in [
        ("angular_velocity", "angular_velocity_covariance", 0.0, model.gyroscope().sigma(100.0)),
        ("linear_acceleration", "linear_acceleration_covariance", 9.806_65, model.accelerometer().sigma(100.0)),
    ] {
        let up: Vec<f64> = noisy.iter().map(|it| number(&it["message"][name]["z"]) - rest).collect();
        let found = (up.iter().map(|value| value * value).sum::<f64>() / 150.0).sqrt();
        assert!((found / sigma - 1.0).abs() < 5.0 / 300f64.sqrt(), "{name}: {found}, not {sigma}");
        let told = number(&noisy[0]["message"][covariance][8]).sqrt();
        assert!((told / sigma - 1.0).abs() < 0.01, "{told} {sigma}");
    }
}

#[test]
fn topics_that_a_bag_cannot_have_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let sensor = Sensor::preset("velodyne_vlp16").unwrap();
    let cloud = indoor().scan(&sensor, &Trajectory::fixed(inside()), &ScanOptions::default()).unwrap();
    assert_eq!(cloud.scan_line, None);
    for (_, topic) in BagTopic::NAMES {
        let options = BagOptions::default().topics(vec![*topic]);
        let path = folder.path().join("a.mcap");
        let written = export::write_with(&cloud, &path, None, &options).map_err(|error| error.to_string());
        match topic {
            // Livox's message is for any LiDAR.
            BagTopic::Points | BagTopic::Livox => assert!(written.is_ok(), "{written:?}"),
            _ => {
                let error = written.unwrap_err();
                let allowed = if topic.is_of_motion() { "the motion of what carries" } else { "a single ring" };
                assert!(
                    error.contains(&format!("with {}; allowed: ", topic.name())) && error.contains(allowed),
                    "{error}"
                );
            }
        }
    }
    assert!(messages::definition("sensor_msgs/Imu").starts_with("std_msgs/Header header\n"));
    assert_eq!(messages::definition("sensor_msgs/Unknown"), "");
}

/// Frames that are placed apart by mistake would fill the disk.
#[test]
fn a_carrier_does_not_move_for_years_between_frames() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let carrier = Arc::new(circle());
    let motion =
        BagMotion { carrier, estimate: None, mount: Pose::IDENTITY, imu: ImuModel::Ideal, seed: 0, scan_time: 0.1 };
    let options = BagOptions::default().topics(vec![BagTopic::Points, BagTopic::Imu]).motion(motion);
    let mut cloud = PointCloud::new(FieldSet::parse("x,y,z").unwrap(), 1).unwrap();
    cloud.start_time = Some(1.0);
    let mut file = GrowingFile::begin_with(&path, None, &cloud, &options).unwrap().unwrap();
    file.add(&cloud).unwrap();
    for later in [1e6, 1e300, f64::NAN] {
        cloud.start_time = Some(later);
        let error = file.add(&cloud).unwrap_err().to_string();
        assert!(error.contains("s apart; allowed with messages of the carrier: 86400 s"), "{error}");
    }
}
