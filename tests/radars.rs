//! What radars record, read back by readers that share no code with it.

use echocast::export::{PolarFolder, PolarStyle, RadarPoints};
use echocast::radar::{Axis, CubeAxes, PolarImage, RadarCube, RadarFrame, RawSamples};
use echocast::{FieldSet, Frame, Named as _, PathType, PointCloud, Pose};
use echocast_tests::python;
use serde_json::{Value, json};
use std::f64::consts::TAU;
use std::path::Path;

/// What `tests/readers/radar.py` finds in the file or folder at `path`.
fn read(kind: &str, path: &Path) -> Value {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("readers/radar.py");
    let output = python().arg(script).arg(kind).arg(path).output().unwrap();
    assert!(output.status.success(), "{kind}: {}", String::from_utf8_lossy(&output.stderr));
    let mut all: Vec<Value> = serde_json::from_slice(&output.stdout).unwrap();
    all.remove(0)
}

/// A frame of 2 channels, 3 velocities and 5 ranges, whose samples are of 3 chirps of 2 transmitters to 2 receivers.
fn frame() -> RadarFrame {
    let axes =
        CubeAxes { range: Axis { first: 0.25, step: 0.5, len: 5 }, velocity: Axis { first: -1.0, step: 1.0, len: 3 } };
    let mut cube = RadarCube { axes, channels: 2, ..RadarCube::default() };
    cube.cells.resize(30, Default::default());
    for (cell, value) in cube.cells.iter_mut().enumerate() {
        (value.re, value.im) = (cell as f32, -0.5 * cell as f32);
    }
    let mut frame = RadarFrame::default();
    (frame.number, frame.time, frame.wavelength) = (3, 1.5, 0.0039);
    frame.pose = Pose::at(1.0, 2.0, 3.0);
    frame.elements = vec![[0.0; 3], [0.0, 0.002, 0.0]];
    frame.cube = Some(cube);
    let values = (0..96).map(|value| value * 340 - 16_000).collect();
    frame.samples = Some(RawSamples { shape: [3, 2, 2, 4], values });
    frame
}

/// A turn to the left from 90 degrees on the left, at 8 azimuths; each cell has a level of its own.
fn turn(start: f64) -> RadarFrame {
    let mut image = PolarImage::default();
    image.range = Axis { first: 0.0, step: 0.0432, len: 20 };
    image.azimuths = (0..8).map(|row| TAU / 4.0 + TAU * f64::from(row) / 8.0).collect();
    image.times = (0..8).map(|row| start + 0.25 * f64::from(row) / 8.0).collect();
    image.levels = (0..160).map(|cell| -100.0 + 0.5 * cell as f32).collect();
    (image.floor_dbm, image.step_db) = (-100.0, 0.5);
    let mut frame = RadarFrame::default();
    frame.polar = Some(image);
    frame
}

/// Three detections in the frame of a radar at a pose of its own: a car that approaches at 20 m/s a radar that drives
/// at 10, a wall on the left, and noise without a velocity.
fn detections() -> PointCloud {
    let fields =
        RadarPoints::fields().union(FieldSet::parse("range_sigma,azimuth_sigma,velocity_sigma,snr,path").unwrap());
    let mut cloud = PointCloud::new(fields, 3).unwrap();
    cloud.frame = Frame::Sensor;
    cloud.sensor_pose = Pose::at(100.0, -20.0, 0.5).with_rpy_deg(0.0, 0.0, 30.0);
    let c = cloud.columns_mut();
    c.x.copy_from_slice(&[60.0, 0.0, 3.0]);
    c.y.copy_from_slice(&[0.0, 5.0, -4.0]);
    c.rcs.copy_from_slice(&[12.4, -3.0, f32::NAN]);
    c.doppler.copy_from_slice(&[-30.0, 0.0, f32::NAN]);
    c.range_sigma.copy_from_slice(&[0.2, 0.1, f32::NAN]);
    c.azimuth_sigma.fill(0.001);
    c.velocity_sigma.fill(0.1);
    c.path.copy_from_slice(&[PathType::Direct as u8, PathType::Wall as u8, PathType::Noise as u8]);
    cloud
}

#[test]
fn frames_are_arrays() {
    let folder = tempfile::tempdir().unwrap();
    let frame = frame();
    let (npz, hdf5) = (folder.path().join("frame.npz"), folder.path().join("frame.h5"));
    frame.write(&npz).unwrap();
    frame.write(&hdf5).unwrap();
    let found = read("npz", &npz);
    assert_eq!(found, read("hdf5", &hdf5));
    let cube = frame.cube.as_ref().unwrap();
    let cells: Vec<f32> = cube.cells.iter().flat_map(|cell| [cell.re, cell.im]).collect();
    assert_eq!(found["cube"], json!({"type": "complex64", "shape": [2, 3, 5], "values": cells}));
    let samples = frame.samples.as_ref().unwrap();
    assert_eq!(found["adc"], json!({"type": "int16", "shape": [3, 2, 2, 4, 2], "values": samples.values}));
    assert_eq!(found["velocity_m_s"]["values"], json!([-1.0, 0.0, 1.0]));
    assert_eq!(found["range_m"]["values"], json!([0.25, 0.75, 1.25, 1.75, 2.25]));
    assert_eq!(found["element_position"]["shape"], json!([2, 3]));
    assert_eq!(found["time"], json!({"type": "float64", "shape": [], "values": [1.5]}));
    assert!(found.get("polar_dbm").is_none());
    let turn_path = folder.path().join("turn.npz");
    turn(0.0).write(&turn_path).unwrap();
    let found = read("npz", &turn_path);
    assert_eq!(found["polar_dbm"]["shape"], json!([8, 20]));
    assert!(found.get("cube").is_none() && found.get("adc").is_none());

    let capture = folder.path().join("adc.bin");
    frame.write(&capture).unwrap();
    let found = read("capture", &capture);
    let component = |which: usize| samples.values.iter().skip(which).step_by(2).map(|&value| f64::from(value));
    assert_eq!(found["real"], component(0).collect::<Value>());
    assert_eq!(found["imag"], component(1).collect::<Value>());
}

#[test]
fn polar_images_are_those_of_data_sets() {
    let folder = tempfile::tempdir().unwrap();
    let frames = [turn(1.5), turn(2.0)];
    for (name, style) in PolarStyle::NAMES {
        let folder = folder.path().join(name);
        let mut polar = PolarFolder::create(&folder, *style).unwrap();
        for frame in &frames {
            polar.add(frame).unwrap();
        }
        assert!(polar.finish().unwrap().iter().all(|file| file.exists()));
        let found = read(name, &folder);
        assert_eq!(found.as_array().unwrap().len(), 2, "{name}");
        for (frame, found) in frames.iter().zip(found.as_array().unwrap()) {
            let image = frame.polar.as_ref().unwrap();
            // Clockwise from ahead are measured rows 6, 5, ... 0, 7.
            let order = [6, 5, 4, 3, 2, 1, 0, 7];
            let levels = order.map(|row| (0..20).map(|cell| row * 20 + cell).collect::<Vec<u32>>());
            assert_eq!(found["levels"], json!(levels), "{name}");
            let stamp = match style {
                PolarStyle::Oxford => image.times[0] * 1e6,
                PolarStyle::Mulran => image.times[0] * 1e9,
                _ => image.times[3] * 1e6,
            };
            assert_eq!(found["stamp"], stamp as i64, "{name}");
            if *style != PolarStyle::Mulran {
                assert_eq!(found["azimuths"], json!([0.0, 45.0, 90.0, 135.0, 180.0, 225.0, 270.0, 315.0]), "{name}");
                assert_eq!(found["times"], json!(order.map(|row| (image.times[row as usize] * 1e6) as i64)), "{name}");
            }
        }
    }
}

#[test]
fn nuscenes_reads_detections_with_its_own_filters() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("radar.pcd");
    detections().write_radar(&path, RadarPoints::Nuscenes, [10.0, 0.0, 0.0]).unwrap();
    let found = read("nuscenes", &path);
    // x, y, z, dyn_prop, id, rcs, vx, vy, vx_comp, vy_comp, is_quality_valid, ambig_state, x_rms, y_rms, invalid_state,
    // pdh0, vx_rms, vy_rms; what has no velocity is filtered.
    let f32 = |value: f32| f64::from(value);
    let car = [60.0, 0.0, 0.0, 2.0, 0.0, f32(12.4), -30.0, 0.0, -20.0, 0.0, 1.0, 3.0, 15.0, 10.0, 0.0, 1.0, 12.0, 12.0];
    assert_eq!(found.as_array().unwrap().len(), 2);
    assert_eq!(found[0], json!(car));
    assert_eq!(found[1][3], 1.0, "a wall stands");
    // A file without detections.
    let none = PointCloud::new(RadarPoints::fields(), 0).unwrap();
    none.write_radar(&path, RadarPoints::Nuscenes, [0.0; 3]).unwrap();
    assert_eq!(read("nuscenes", &path), json!([]));
}

#[test]
fn view_of_delft_reads_detections() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("00000.bin");
    detections().write_radar(&path, RadarPoints::ViewOfDelft, [10.0, 0.0, 0.0]).unwrap();
    let found = read("view_of_delft", &path);
    assert_eq!(found.as_array().unwrap().len(), 3);
    assert_eq!(found[0], json!([60.0, 0.0, 0.0, f64::from(12.4_f32), -30.0, -20.0, 0.0]));
    // Without a velocity, and of an RCS of which only a bound is known.
    assert_eq!(found[2], json!([3.0, -4.0, 0.0, -64.0, null, null, 0.0]));
}

#[test]
fn bags_have_the_messages_of_radars() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("radar.mcap");
    let cloud = detections();
    cloud.write(&path).unwrap();
    let found = read("bag", &path);
    assert_eq!(found["frames"], json!(["sensor", "sensor"]));
    let angle = |y: f32, x: f32| f64::from(y.atan2(x));
    let rcs = f64::from(12.4_f32);
    assert_eq!(found["returns"][0], json!([60.0, 0.0, 0.0, -30.0, rcs]));
    assert_eq!(found["returns"][1], json!([5.0, angle(5.0, 0.0), 0.0, 0.0, -3.0]));
    assert_eq!(found["returns"][2], json!([5.0, angle(-4.0, 3.0), 0.0, null, null]));
    let [range_sigma, velocity_sigma] = [0.2_f32, 0.1].map(f64::from);
    assert_eq!(found["detections"][0], json!([60.0, 0.0, 0.0, -30.0, 12.0, range_sigma, velocity_sigma]));
    assert_eq!(found["flags"][0], json!([false, false, true, false]));
    assert_eq!(found["flags"][2], json!([false, false, true, true]));
    assert_eq!((&found["ids"], &found["last"]), (&json!([0, 1, 2]), &json!([100, 100, 100])));
    // In the world they are the same, as radars report what is relative to them.
    let mut world = cloud.clone();
    world.frame = Frame::World;
    let turn = cloud.sensor_pose.rotation();
    let c = world.columns_mut();
    for row in 0..3 {
        let place = turn * glam::DVec3::new(c.x[row].into(), c.y[row].into(), c.z[row].into());
        [c.x[row], c.y[row], c.z[row]] = place.as_vec3().to_array();
    }
    world.origin = cloud.sensor_pose.position;
    world.write(&path).unwrap();
    let again = read("bag", &path);
    for (a, b) in again["returns"].as_array().unwrap().iter().zip(found["returns"].as_array().unwrap()) {
        let near = |axis: usize| (a[axis].as_f64().unwrap() - b[axis].as_f64().unwrap()).abs() < 1e-5;
        assert!((0..3).all(near), "{a} {b}");
    }
}
