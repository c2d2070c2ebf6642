//! Every format, read back by third-party readers.

use echocast::cloud::{ColumnType, FIELDS};
use echocast::export::{self, FORMATS, FramesFile, GrowingFile};
use echocast::scene::Labels;
use echocast::{
    Driver, Error, Field, FieldSet, Frame, InstanceBox, PointCloud, Pose, Report, ScanOptions, Scene, Sensor,
    Trajectory,
};
use echocast_tests::python;
use glam::{DQuat, DVec3};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;

#[path = "formats/read.rs"]
mod read;
#[path = "formats/strangers.rs"]
mod strangers;

/// A cloud of `len` rows with what is hard to write: large ids, a far origin, all numbers of returns.
fn cloud(len: usize, fields: FieldSet) -> PointCloud {
    let mut random = 1u64;
    let mut draw = move || {
        random = random.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (random >> 40) as u32 // 24 bits
    };
    let mut cloud = PointCloud::new(fields, len).unwrap();
    let columns = cloud.columns_mut();
    macro_rules! fill {
        ($($name:ident: $value:expr;)*) => {$(
            for (value, new) in columns.$name.iter_mut().zip((0..len).map($value)) {
                *value = new;
            }
        )*};
    }
    let mut metres = |scale: f32| (draw() as f32 / 8_388_608.0 - 1.0) * scale;
    let whole =
        |row: usize, limit: u32| if row == 1 { limit } else { (row as u32).wrapping_mul(2_654_435_761) % limit };
    fill! {
        x: |_| metres(120.0);
        y: |_| metres(0.001);
        z: |_| metres(3000.0);
        range: |_| metres(50.0).abs();
        intensity: |row| [0.0, 1.0, 0.25, 0.123_456_79][row % 4];
        category_id: |row| whole(row, i32::MAX as u32);
        part_id: |row| whole(row, 70_000);
        instance_id: |row| whole(row, 100_000_000);
        material_id: |row| whole(row, 300);
        return_number: |row| 1 + (row % 7) as u8;
        return_count: |row| 7 - (row % 3) as u8;
        channel: |row| whole(row, 65_535) as u16;
        ring: |row| whole(row, 65_535) as u16;
        time: |row| 1_700_000_000.0 + row as f64 * 2.304e-6;
        frame: |row| whole(row, 1000);
        beam: |row| row as u32 + 16_777_216;
        firing: |row| whole(row, 2_000_000_000);
        azimuth: |_| metres(3.0);
        elevation: |_| metres(1e-6);
        red: |row| row as u8;
        green: |row| (row * 7) as u8;
        blue: |row| 255 - row as u8;
        normal_x: |_| metres(1.0);
        normal_y: |_| metres(1e-30);
        normal_z: |_| -0.0;
        cos_incidence: |_| metres(1.0).abs();
        depth: |_| metres(1e6);
        true_x: |_| metres(120.0);
        true_y: |_| metres(120.0);
        true_z: |_| metres(120.0);
        true_range: |_| metres(120.0);
        cause: |row| (row % 10) as u8;
        bounces: |row| (row % 256) as u8;
        first_category_id: |row| (row % 7) as u32;
        first_instance_id: |row| (row % 11) as u32;
        velocity_x: |_| metres(40.0);
        velocity_y: |_| metres(1e-3);
        velocity_z: |_| metres(1.0);
        radial_velocity: |_| metres(60.0);
        flow_x: |_| metres(4.0);
        flow_y: |_| metres(0.1);
        flow_z: |_| 0.0;
        track_id: |row| whole(row, 100_000_000);
        doppler: |row| if row % 5 == 0 { f32::NAN } else { metres(128.0) };
        quality: |row| (row % 101) as f32 / 100.0;
        corrected_x: |row| if row % 6 == 0 { f32::NAN } else { metres(120.0) };
        corrected_y: |_| metres(120.0);
        corrected_z: |_| metres(120.0);
        bottom_track_x: |row| if row % 4 == 0 { f32::NAN } else { metres(3.0) };
        bottom_track_y: |_| metres(3.0);
        bottom_track_z: |_| metres(0.5);
        bottom_track_error: |_| metres(0.01);
        water_track_x: |_| f32::NAN;
        water_track_y: |_| metres(3.0);
        water_track_z: |_| metres(0.5);
        water_track_error: |_| metres(0.01);
        rcs: |_| metres(40.0);
        snr: |_| metres(60.0).abs();
        power: |row| if row % 3 == 0 { f32::NAN } else { metres(10.0) - 110.0 };
        path: |row| (row % 8) as u8;
        true_rcs: |_| metres(40.0);
        range_sigma: |_| metres(0.4).abs();
        azimuth_sigma: |_| metres(0.1).abs();
        elevation_sigma: |_| f32::NAN;
        velocity_sigma: |_| metres(0.1).abs();
        // Whole steps of LAS.
        scan_angle: |row| ((f64::from(whole(row, 30_000)) - 15_000.0) * 0.006).to_radians() as f32;
        scan_direction: |row| (row % 2) as u8;
        edge_of_line: |row| u8::from(row % 9 == 0);
        strip: |row| whole(row, 65_535) as u16;
        reflectance_db: |row| if row % 8 == 0 { f32::NAN } else { metres(30.0) };
        amplitude_db: |_| metres(30.0).abs();
        pulse_width: |_| metres(1e-8).abs();
        deviation: |_| metres(1.0).abs();
    }
    let table = |rows: &[(u32, &str)]| rows.iter().copied().collect();
    let labels = Labels::default()
        .category(table(&[(1, "chair"), (2, "Tür, \"groß\""), (70_000, "木の 🌲")]))
        .part(table(&[(7, "a\nb\\c")]))
        .material(table(&[]))
        .instance(table(&[(1, "Desk"), (2, "Desk"), (100_000_000, "")]));
    cloud.origin = [500_000.0, 5_600_000.0, 100.25].into();
    cloud.sensor_pose =
        Pose { orientation: DQuat::from_xyzw(0.1, -0.7, 0.1, 0.7), ..Pose::at(500_001.1, 5_600_002.2, -3.3) };
    cloud.labels = Arc::new(labels);
    cloud.boxes = Some(boxes(len.min(20)));
    cloud
}

/// As many boxes, of several frames, with numbers that serde_json reads exactly.
fn boxes(count: usize) -> Vec<InstanceBox> {
    (0..count as u32)
        .map(|k| {
            let some = |scale: f64| scale * f64::from(k + 1) / 1024.0;
            let mut found = InstanceBox::default();
            (found.frame, found.time) = (k / 3, some(2.0));
            found.track_id = 4_000_000_000 + k;
            found.instance_id = if k == 1 { 1 } else { 4_000_000_000 + k };
            found.category_id = k % 3;
            found.pose = Pose {
                position: DVec3::new(5e5, 5.6e6, some(-1.0)),
                orientation: DQuat::from_xyzw(0.0, 0.6, 0.0, [0.8, -0.8][k as usize % 2]),
            };
            found.size = DVec3::new(some(1.0), 1e-9, 12.0);
            found.velocity = DVec3::new(some(-3.0), 0.0, -0.0);
            (found.points, found.visible) = (k * 1000, some(1.0));
            found
        })
        .collect()
}

/// What a file says of a box.
fn told(found: &InstanceBox) -> Value {
    json!({
        "frame": found.frame,
        "time": found.time,
        "track_id": found.track_id,
        "instance_id": found.instance_id,
        "category_id": found.category_id,
        "position": found.pose.position.to_array(),
        "size": found.size.to_array(),
        "orientation_xyzw": found.pose.orientation.to_array(),
        "velocity": found.velocity.to_array(),
        "points": found.points,
        "visible": found.visible,
    })
}

fn all_told(boxes: &[InstanceBox]) -> Value {
    boxes.iter().map(told).collect()
}

/// What a bag says of the boxes of `cloud`.
fn detections(cloud: &PointCloud) -> Value {
    let told = cloud.boxes.iter().flatten().map(|found| {
        let category = ["0", "chair", "Tür, \"groß\""][found.category_id as usize];
        json!({
            "time": (found.time * 1e9).round() / 1e9,
            "track_id": found.track_id,
            "category": category,
            "position": found.pose.position.to_array(),
            "size": found.size.to_array(),
            "orientation_xyzw": found.pose.orientation.to_array(),
        })
    });
    told.collect()
}

/// A few points of a scene with thousands of instances.
fn many_names() -> PointCloud {
    let mut cloud = cloud(3, FieldSet::default());
    let labels = Arc::make_mut(&mut cloud.labels);
    labels.instance = (1..=5000).map(|id| (id, format!("object number {id}"))).collect();
    cloud
}

/// A grid of 4 by 5 beams, some without a return.
fn organised() -> PointCloud {
    let mut cloud = cloud(20, FieldSet::all());
    cloud.set_organised(Some([4, 5])).unwrap();
    let c = cloud.columns_mut();
    for miss in [0, 7, 8, 19] {
        for column in [&mut *c.x, c.y, c.z, c.range, c.true_x, c.normal_z, c.intensity] {
            column[miss] = f32::NAN;
        }
        c.return_number[miss] = 0;
    }
    cloud
}

/// What `tests/readers/clouds.py` finds in `files`.
fn read(format: &str, files: &[PathBuf]) -> Vec<Value> {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("readers/clouds.py");
    let output = python().arg(script).arg(format).args(files).output().unwrap();
    assert!(output.status.success(), "{format}: {}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Compares `found` in a file with what `cloud` holds in `rows` of the columns `held`.
fn compare(cloud: &PointCloud, format: &str, found: &Value, rows: &[usize], held: FieldSet) {
    let (las, bag) = (format.starts_with("la"), format.starts_with("mcap"));
    let columns = found["columns"].as_object().unwrap();
    for info in FIELDS {
        let Some(column) = columns.get(info.name) else {
            // Without points, E57 files have no scan.
            assert!(!held.contains(info.field) || format == "e57" && rows.is_empty(), "{format} lost {}", info.name);
            continue;
        };
        if !held.contains(info.field) {
            let always = las && info.las.is_some() || format == "las2" && info.field == Field::CategoryId;
            assert!(always || made_of_positions(format, info.field), "{format} made up {}", info.name);
            continue;
        }
        let offset = match info.field {
            Field::X | Field::TrueX | Field::CorrectedX => cloud.origin.x,
            Field::Y | Field::TrueY | Field::CorrectedY => cloud.origin.y,
            Field::Z | Field::TrueZ | Field::CorrectedZ => cloud.origin.z,
            _ => 0.0,
        };
        let column = column.as_array().unwrap();
        assert_eq!(column.len(), rows.len(), "{format} {}", info.name);
        for (found_value, &row) in column.iter().zip(rows) {
            let mut read = found_value.as_str().unwrap().parse::<f64>().unwrap();
            let mut value = cloud.column(info.field).get_f64(row) + offset;
            let mut tolerance = 0.0;
            match (info.field, format) {
                // Half a step, plus what f64 resolves at such coordinates.
                (Field::X | Field::Y | Field::Z, "las" | "laz" | "las2") => {
                    tolerance = found["scale"].as_f64().unwrap() / 2.0 + 2e-9;
                }
                (Field::Intensity, "las" | "laz" | "las2") => value = (value * 65535.0).round(),
                (Field::ScanAngle, "las" | "laz") => tolerance = 0.003_f64.to_radians() + 1e-7,
                (Field::ScanAngle, "las2") => tolerance = 0.5_f64.to_radians() + 1e-7,
                (Field::CategoryId, "las2") => value = value.min(65535.0),
                // Half a step of f32 at 4 km from the sensor, on each axis.
                (Field::X | Field::Y | Field::Z, _) if format == "e57" || bag => tolerance = 5e-4,
                // What f64 resolves in a time since 1970, in s or ns.
                (Field::Time, _) if bag => tolerance = 5e-7,
                (Field::Range, "mcap_ouster") => tolerance = 0.5e-3,
                (Field::Ring, "mcap_livox") => value = value.min(255.0),
                // A byte, which is 0 where there is no number.
                (Field::Intensity, "mcap_autoware") => {
                    (value, tolerance) = (if value.is_nan() { 0.0 } else { value }, 0.5 / 255.0 + 1e-9);
                }
                (_, "csv" | "pcd_ascii") if offset != 0.0 => tolerance = 0.5e-6 + 2e-9,
                // The shortest text of an f32 is the same number again only as f32.
                (_, "csv") if info.kind == ColumnType::F32 => read = f64::from(read as f32),
                _ => {}
            }
            let same = (read - value).abs() <= tolerance || read.is_nan() && value.is_nan();
            assert!(same, "{format} {} row {row}: {read} is not {value}", info.name);
        }
    }
    for (stem, table) in cloud.labels.tables() {
        let names: Vec<(u32, String)> = serde_json::from_value(found["names"][stem].clone()).unwrap();
        assert!(table.iter().eq(names.iter().map(|(id, name)| (*id, name.as_str()))), "{format} {stem}: {names:?}");
    }
    if matches!(format, "npz" | "hdf5") {
        assert_eq!(found["boxes"], all_told(cloud.boxes.as_deref().unwrap()), "{format}");
    }
    if bag {
        assert_eq!(found["boxes"], detections(cloud), "{format}");
    }
    let about = json!({
        "coordinates": cloud.frame.name(),
        "sensor_position": cloud.sensor_pose.position.to_array(),
        "sensor_orientation_xyzw": cloud.sensor_pose.orientation.to_array(),
        "intensity_full_scale": cloud.intensity_full_scale,
    });
    assert_eq!(found["about"], about, "{format}");
}

/// Whether bags have the column `field`, whether or not it was computed: drivers publish it.
fn made_of_positions(format: &str, field: Field) -> bool {
    match format {
        "mcap_ouster" => field == Field::Range,
        "mcap_autoware" => matches!(field, Field::Range | Field::Azimuth | Field::Elevation),
        _ => false,
    }
}

fn points(cloud: &PointCloud) -> Vec<usize> {
    (0..cloud.len()).filter(|&row| !cloud.columns().x()[row].is_nan()).collect()
}

fn said(report: &Report, words: &str) -> bool {
    report.warnings.iter().any(|warning| warning.contains(words))
}

#[test]
fn every_format_is_read_back() {
    let positions = FieldSet::parse("x,y,z").unwrap();
    let mut sensor_frame = cloud(10, positions);
    sensor_frame.frame = Frame::Sensor;
    sensor_frame.origin = DVec3::new(0.5, -0.25, 0.125);
    sensor_frame.intensity_full_scale = None;
    let clouds = [
        cloud(1500, FieldSet::all()),
        cloud(1000, FieldSet::default()),
        organised(),
        cloud(1, FieldSet::all()),
        cloud(0, FieldSet::all()),
        sensor_frame,
        many_names(),
    ];
    let folder = tempfile::tempdir().unwrap();
    // By reader; one has all bags.
    let mut written = BTreeMap::<&str, Vec<_>>::new();
    for format in FORMATS {
        let name = format.name();
        for (i, cloud) in clouds.iter().enumerate() {
            let path = folder.path().join(format!("{name} {i}.file"));
            let report = export::write(cloud, &path, Some(name)).unwrap();
            for info in cloud.fields().iter() {
                let lost = !format.holds(info);
                let mut words = report.warnings.iter().filter(|w| w.contains("cannot hold"));
                let between = info.name.strip_suffix("_y").map(|stem| format!("{stem}_x to {stem}_z"));
                let named = words.any(|w| {
                    let whole = w.replace(',', " ").split(' ').any(|w| w == info.name);
                    whole || between.as_ref().is_some_and(|vector| w.contains(vector))
                });
                assert_eq!(lost, named, "{}: {:?}", info.name, report.warnings);
            }
            assert_eq!(format.info().holds_label_names, !export::labels_path(&path).exists());
            if name.starts_with("la") {
                assert_eq!(said(&report, "rows without a position"), cloud.organised().is_some(), "{report:?}");
            }
            assert_eq!(said(&report, "category ids above 65535"), name == "las2" && i != 5 && cloud.len() > 1);
            let reader = if name.starts_with("mcap") { "mcap" } else { name };
            written.entry(reader).or_default().push((format, cloud, path));
        }
    }
    for (reader, written) in written {
        let files: Vec<PathBuf> = written.iter().map(|(.., path)| path.clone()).collect();
        for ((format, cloud, _), found) in written.iter().zip(read(reader, &files)) {
            let keeps_misses = !reader.starts_with("la");
            let rows = if keeps_misses { (0..cloud.len()).collect() } else { points(cloud) };
            let held = cloud.fields().iter().filter(|info| format.holds(info)).map(|info| info.field).collect();
            compare(cloud, format.name(), &found, &rows, held);
            if let Some(shape) = found.get("shape") {
                assert_eq!(*shape, json!(cloud.organised()), "{}", format.name());
            }
        }
    }
}

#[test]
fn chunks_of_compressed_points_are_the_same_points() {
    let folder = tempfile::tempdir().unwrap();
    let cloud = cloud(170_001, FieldSet::default());
    let [las, laz] = ["a.las", "a.laz"].map(|name| folder.path().join(name));
    cloud.write(&las).unwrap();
    cloud.write(&laz).unwrap();
    assert_eq!(read("chunks", std::slice::from_ref(&laz))[0]["points"], 170_001);
    let bytes = |path: &Path| fs::metadata(path).unwrap().len();
    assert!(bytes(&laz) < bytes(&las), "{} {}", bytes(&laz), bytes(&las));
}

#[test]
fn formats_that_need_no_positions_hold_any_columns() {
    let cloud = cloud(12, FieldSet::parse("range,category_id,time").unwrap());
    let folder = tempfile::tempdir().unwrap();
    for format in FORMATS {
        let path = folder.path().join(format.name());
        let result = export::write(&cloud, &path, Some(format.name()));
        if format.info().needs_positions {
            assert!(result.unwrap_err().to_string().contains("without x, y, z"));
            assert!(!path.exists());
        } else {
            result.unwrap();
            let rows: Vec<usize> = (0..cloud.len()).collect();
            compare(&cloud, format.name(), &read(format.name(), &[path])[0], &rows, cloud.fields());
        }
    }
}

#[test]
fn frames_of_a_sequence_warn_alike() {
    let folder = tempfile::tempdir().unwrap();
    for format in FORMATS {
        let mut report = Report::default();
        let mut seen = None;
        for frame in 1..4 {
            let mut cloud = organised();
            cloud.intensity_full_scale = None;
            cloud.columns_mut().x[frame] = f32::NAN;
            cloud.columns_mut().y[1 + 2 * frame] = f32::NAN;
            cloud.columns_mut().intensity[10..10 + frame].fill(-1.0);
            cloud.columns_mut().return_count[10..10 + frame].fill(16);
            cloud.columns_mut().category_id[10..10 + frame].fill(u32::MAX);
            report.absorb(export::write(&cloud, &folder.path().join(format.name()), Some(format.name())).unwrap());
            assert_eq!(*seen.get_or_insert(report.warnings.len()), report.warnings.len(), "{report:?}");
        }
    }
}

#[test]
fn las_says_what_it_rounds_and_clamps() {
    let mut cloud = cloud(100, FieldSet::all());
    cloud.columns_mut().x[3] = 300_000.0;
    cloud.columns_mut().return_count[4] = 16;
    cloud.columns_mut().intensity[5] = 1.5;
    cloud.columns_mut().intensity[6] = f32::NAN;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("far.las");
    let report = cloud.write(&path).unwrap();
    assert!(said(&report, "rounded to 0.001 m") && said(&report, "intensities below 0"), "{report:?}");
    assert!(said(&report, "return numbers clamped to 1 to 15"), "{report:?}");
    cloud.columns_mut().return_count[4] = 15;
    cloud.columns_mut().intensity[5] = 1.0;
    cloud.columns_mut().intensity[6] = 0.0;
    let found = read("las", &[path]);
    assert_eq!(found[0]["scale"], 0.001);
    compare(&cloud, "las", &found[0], &points(&cloud), cloud.fields());
}

#[test]
fn one_long_name_does_not_make_an_npz_file_huge() {
    let mut cloud = cloud(1, FieldSet::default());
    let instances = &mut Arc::make_mut(&mut cloud.labels).instance;
    *instances = (1..=1000).map(|id| (id, format!("object {id}"))).collect();
    instances.set(501, &"木".repeat(100_000));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.npz");
    let report = cloud.write(&path).unwrap();
    assert!(said(&report, "longer than 1024 characters cut"), "{report:?}");
    assert!(fs::metadata(&path).unwrap().len() < 1000 * 4 * 1024 + 100_000);
    Arc::make_mut(&mut cloud.labels).instance.set(501, &"木".repeat(1024));
    compare(&cloud, "npz", &read("npz", &[path])[0], &[0], cloud.fields());
}

#[test]
fn eight_bit_intensities_fill_the_range_of_las() {
    let mut cloud = cloud(256, FieldSet::default());
    cloud.intensity_full_scale = Some(255.0);
    cloud.columns_mut().intensity.iter_mut().zip(0u16..).for_each(|(to, value)| *to = value.into());
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.las");
    cloud.write(&path).unwrap();
    let found = read("las", &[path]);
    let wide: Vec<String> = (0..256).map(|i| format!("{}.0", i * 257)).collect();
    assert_eq!(found[0]["columns"]["intensity"], json!(wide));
}

#[test]
fn relative_energy_fills_the_range_of_las() {
    let mut cloud = cloud(4, FieldSet::default());
    cloud.intensity_full_scale = None;
    cloud.columns_mut().intensity.copy_from_slice(&[1e-5, 4e-5, 0.0, 3e-5]);
    let folder = tempfile::tempdir().unwrap();
    for (format, strongest) in [("las", 4e-5), ("las2", 3.0)] {
        cloud.columns_mut().intensity[1] = strongest;
        let path = folder.path().join(format);
        let report = export::write(&cloud, &path, Some(format)).unwrap();
        assert!(said(&report, "has no full scale"), "{report:?}");
        let stored = |i: f32| format!("{}.0", (f64::from(i) / f64::from(strongest) * 65535.0).round());
        let wanted: Vec<String> = cloud.columns().intensity().iter().map(|&i| stored(i)).collect();
        assert_eq!(wanted[1], "65535.0");
        let found = read(format, &[path]);
        assert_eq!(found[0]["columns"]["intensity"], json!(wanted));
        // Next to it unchanged, where there is room.
        assert_eq!(said(&report, "raw_intensity holds it"), format == "las");
        match found[0]["columns"]["raw_intensity"].as_array() {
            Some(raw) => {
                let raw = raw.iter().map(|value| value.as_str().unwrap().parse::<f64>().unwrap());
                assert!(raw.eq(cloud.columns().intensity().iter().map(|&i| f64::from(i))));
            }
            None => assert_eq!(format, "las2"),
        }
    }
    cloud.columns_mut().intensity.fill(0.0);
    let dark = folder.path().join("dark.las");
    cloud.write(&dark).unwrap();
    assert_eq!(read("las", &[dark])[0]["columns"]["intensity"], json!(vec!["0.0"; 4]));
}

#[test]
fn levels_of_sonars_are_kept_in_las() {
    let mut cloud = cloud(4, FieldSet::default().with(Field::Cause));
    cloud.intensity_full_scale = None;
    let c = cloud.columns_mut();
    c.intensity.copy_from_slice(&[-12.5, 88.25, 0.0, 131.5]);
    c.cause.copy_from_slice(&[7, 0, 9, 10]);
    c.return_number.fill(1);
    c.return_count.fill(1);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("ping.las");
    let report = cloud.write(&path).unwrap();
    assert!(!said(&report, "return numbers"), "{report:?}");
    let found = &read("las", &[path])[0]["columns"];
    assert_eq!(found["raw_intensity"], json!(["-12.5", "88.25", "0.0", "131.5"]));
    assert_eq!(found["cause"], json!(["7.0", "0.0", "9.0", "10.0"]));
    assert_eq!((&found["return_number"], &found["return_count"]), (&json!(vec!["1.0"; 4]), &json!(vec!["1.0"; 4])));
}

#[test]
fn frames_are_rows_of_one_hdf5_file() {
    let mut clouds = [700, 0, 1].map(|len| cloud(len, FieldSet::default()));
    clouds[1].sensor_pose.position.x += 0.5;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("frames.h5");
    fs::write(&path, "old").unwrap();
    let mut file = FramesFile::create(&path).unwrap();
    for cloud in &clouds {
        file.add(cloud).unwrap();
    }
    let other = file.add(&cloud(5, FieldSet::all())).unwrap_err();
    assert!(matches!(other, Error::InvalidParameter { .. }), "{other}");
    for cloud in clouds.iter().cycle().take(600) {
        file.add(cloud).unwrap();
    }
    assert_eq!(fs::read(&path).unwrap(), b"old");
    file.finish().unwrap();
    let found = read("frames", &[path]);
    let frames = found[0]["frames"].as_array().unwrap();
    assert_eq!(frames.len(), 603);
    let boxes: Vec<_> = clouds.iter().cycle().take(603).flat_map(|cloud| cloud.boxes.clone().unwrap()).collect();
    assert_eq!(found[0]["boxes"], all_told(&boxes));
    for (cloud, frame) in clouds.iter().cycle().zip(frames) {
        compare(cloud, "frames", frame, &points(cloud), cloud.fields());
    }
    drop(FramesFile::create(folder.path().join("dropped.h5")).unwrap());
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn frames_are_messages_of_one_bag() {
    let bags: Vec<&str> = FORMATS.iter().map(|format| format.name()).filter(|name| name.starts_with("mcap")).collect();
    let folder = tempfile::tempdir().unwrap();
    let mut all = Vec::new();
    for format in &bags {
        let mut clouds = [700, 0, 1].map(|len| cloud(len, FieldSet::default()));
        for (frame, cloud) in clouds.iter_mut().enumerate() {
            cloud.sensor_pose.position.x += 0.5 * frame as f64;
            cloud.start_time = Some(1_700_000_000.0 + 0.1 * frame as f64);
            cloud.columns_mut().time.iter_mut().for_each(|time| *time += 0.1 * frame as f64);
        }
        let path = folder.path().join(format);
        let mut file = GrowingFile::begin(&path, Some(format), &clouds[0]).unwrap().unwrap();
        clouds.iter().for_each(|cloud| file.add(cloud).unwrap());
        assert!(file.finish().unwrap().warnings.is_empty());
        let mut together = clouds[0].clone();
        clouds[1..].iter().for_each(|cloud| together.append(cloud).unwrap());
        all.push(together);
    }
    let files: Vec<PathBuf> = bags.iter().map(|format| folder.path().join(format)).collect();
    for ((format, all), found) in bags.iter().zip(&all).zip(read("mcap", &files)) {
        let mut counts = json!({"/tf": 3, "/points": 3, "/detections": 3});
        if *format == "mcap_livox" {
            counts["/livox/lidar"] = 3.into();
        }
        assert_eq!(found["messages"], counts);
        let stamps = [1_700_000_000_000_000_000u64, 1_700_000_000_099_999_905, 1_700_000_000_200_000_048];
        let read: Vec<u64> = serde_json::from_value(found["stamps"].clone()).unwrap();
        assert!(read.iter().zip(stamps).all(|(read, stamp)| read.abs_diff(stamp) < 300), "{read:?}");
        compare(all, format, &found, &points(all), all.fields());
    }
}

/// Names, offsets and types of what a message has, as the driver's source says them, and the bytes of its points.
const DRIVERS: [(Driver, &str, usize); 6] = [
    (Driver::Velodyne, "x 0 7, y 4 7, z 8 7, intensity 12 7, ring 16 4, time 18 7", 22),
    (
        Driver::Ouster,
        "x 0 7, y 4 7, z 8 7, intensity 16 7, t 20 6, reflectivity 24 4, ring 26 4, ambient 28 4, range 32 6",
        48,
    ),
    (Driver::Hesai, "x 0 7, y 4 7, z 8 7, intensity 12 7, ring 16 4, timestamp 18 8", 26),
    (Driver::Robosense, "x 0 7, y 4 7, z 8 7, intensity 12 7, ring 16 4, timestamp 18 8", 26),
    (Driver::Livox, "x 0 7, y 4 7, z 8 7, intensity 12 7, tag 16 2, line 17 2, timestamp 18 8", 26),
    (
        Driver::Autoware,
        "x 0 7, y 4 7, z 8 7, intensity 12 2, return_type 13 2, channel 14 4, azimuth 16 7, elevation 20 7, \
         distance 24 7, time_stamp 28 6",
        32,
    ),
];

/// Bags of presets are as the drivers of their makers publish: fields, rings, times, rows and columns.
#[test]
fn bags_are_those_of_the_makers_driver() {
    let folder = tempfile::tempdir().unwrap();
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/scenes/indoor-1.glb");
    let built = Scene::load(scene).unwrap().build().unwrap();
    let trajectory = Trajectory::fixed(Pose::at(-6.0, 6.0, 1.2).with_rpy_deg(0.0, 0.0, 30.0));
    let (mut scans, mut files) = (Vec::new(), Vec::new());
    // Lasers, and the ring of each place in a message of rows and columns, by row, column and lasers.
    type Place = fn(usize, usize, usize) -> usize;
    let presets: [(&str, usize, Place, bool); 6] = [
        ("velodyne_vlp16", 16, |_, column, _| column, true),
        ("ouster_os1_64", 64, |row, _, _| row, false),
        ("hesai_pandar_xt32", 32, |row, _, _| row, false),
        ("hesai_pandar_qt64", 64, |row, _, _| row, false),
        ("robosense_rs16", 16, |_, column, _| if column < 8 { column } else { 23 - column }, true),
        ("livox_mid40", 1, |_, _, _| 0, false),
    ];
    for (preset, lasers, place, turned) in presets {
        let mut sensor = Sensor::preset(preset).unwrap();
        if lasers > 1 {
            sensor.set("pattern.azimuth.fov_deg", "20").unwrap();
        }
        for organised in [false, true] {
            let options = ScanOptions::default().organised(organised).start_time(2.0);
            let cloud = built.scan(&sensor, &trajectory, &options).unwrap();
            assert_eq!(cloud.driver, sensor.driver());
            let path = folder.path().join(format!("{preset} {organised}.mcap"));
            cloud.write(&path).unwrap();
            files.push(path);
            scans.push((preset, lasers, place, turned, cloud));
        }
    }
    for ((preset, lasers, place, turned, cloud), found) in scans.iter().zip(read("points", &files)) {
        let message = &found["messages"][0];
        let driver = cloud.driver.unwrap();
        let (_, fields, step) = DRIVERS.iter().find(|(known, ..)| *known == driver).unwrap();
        let told: Vec<(String, u32, u8)> = serde_json::from_value(message["fields"].clone()).unwrap();
        let own = fields.split(',').count();
        let listed: Vec<String> = told[..own].iter().map(|(name, at, kind)| format!("{name} {at} {kind}")).collect();
        assert_eq!(listed.join(", "), *fields, "{preset}");
        // Labels and all else follow.
        assert!(told[own..].iter().all(|(_, at, _)| *at as usize >= *step), "{preset}");
        assert!(["category_id", "channel"].iter().all(|name| told[own..].iter().any(|(known, ..)| known == name)));
        let number = |name: &str| -> Vec<f64> {
            let column = message["columns"][name].as_array().unwrap();
            column.iter().map(|text| text.as_str().unwrap().parse().unwrap()).collect()
        };
        assert_eq!(message["stamp"], 2_000_000_000u64);
        let (time, unit, since) = match driver {
            Driver::Velodyne => ("time", 1.0, 2.0),
            Driver::Ouster => ("t", 1e9, 2.0),
            Driver::Livox => ("timestamp", 1e9, 0.0),
            _ => ("timestamp", 1.0, 0.0),
        };
        let times: Vec<f64> = number(time).into_iter().map(|time| time / unit + since).collect();
        assert!(times.iter().all(|time| (1.99995..2.1).contains(time)), "{preset}");
        let rings = number(if driver == Driver::Livox { "line" } else { "ring" });
        let shape = [&message["height"], &message["width"]].map(|count| count.as_u64().unwrap() as usize);
        let finite = number("x").iter().all(|x| x.is_finite());
        assert_eq!(message["dense"], finite && driver != Driver::Hesai, "{preset}");
        let wanted = match cloud.organised() {
            None => [1, cloud.len()],
            Some([rows, columns]) if *turned => [columns as usize, rows as usize],
            Some(shape) => shape.map(|count| count as usize),
        };
        assert_eq!(shape, wanted, "{preset}");
        if cloud.organised().is_some() {
            for (at, ring) in rings.iter().enumerate() {
                assert_eq!(*ring, place(at / shape[1], at % shape[1], *lasers) as f64, "{preset} {at}");
            }
        } else if *lasers > 1 {
            let [x, y, z] = ["x", "y", "z"].map(number);
            let up: Vec<f64> = (0..x.len()).map(|row| z[row].atan2(x[row].hypot(y[row]))).collect();
            let mean = |ring: usize| -> f64 {
                let of: Vec<f64> = (0..up.len()).filter(|&row| rings[row] == ring as f64).map(|row| up[row]).collect();
                of.iter().sum::<f64>() / of.len() as f64
            };
            // The highest and the lowest may meet nothing.
            let met = |ring: &usize| rings.contains(&(*ring as f64));
            let [first, last] = [(0..*lasers).find(met), (0..*lasers).rfind(met)];
            let [low, high] = [first, last].map(|ring| mean(ring.unwrap()));
            let rises = !preset.starts_with("ouster") && *preset != "hesai_pandar_xt32";
            assert!(if rises { low < high } else { low > high }, "{preset}: {low} to {high}");
        }
    }
    for ((preset, _, _, turned, cloud), file) in scans.iter().zip(&files) {
        let back = PointCloud::read(file).unwrap();
        // One row is no image.
        let organised = cloud.organised().filter(|[rows, _]| *rows > 1);
        assert_eq!((back.driver, back.len(), back.organised()), (cloud.driver, cloud.len(), organised), "{preset}");
        // By beam again, where the driver has other rows.
        let mut rows: Vec<usize> = (0..cloud.len()).collect();
        if cloud.organised().is_some() && *turned && cloud.driver == Some(Driver::Velodyne) {
            rows.sort_by_key(|&row| cloud.columns().ring()[row]);
        }
        for (row, &from) in rows.iter().enumerate() {
            let [a, b] = [(&back, row), (cloud, from)].map(|(cloud, row)| {
                let c = cloud.columns();
                (c.ring()[row], c.channel()[row], c.category_id()[row], c.return_number()[row])
            });
            assert_eq!(a, b, "{preset} {row}");
            assert!((back.columns().time()[row] - cloud.columns().time()[from]).abs() < 1e-7, "{preset} {row}");
            let [a, b] = [back.columns().range()[row], cloud.columns().range()[from]];
            assert!((a - b).abs() < 6e-4 || b.is_nan() && (a.is_nan() || a == 0.0), "{preset} {row}: {a} {b}");
        }
    }
}

#[test]
fn bags_hold_the_images_of_a_camera() {
    let folder = tempfile::tempdir().unwrap();
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/scenes/indoor-1.glb");
    let built = Scene::load(scene).unwrap().build().unwrap();
    let yaml = "{name: a, kind: tof, pattern: {type: pinhole, resolution: [40, 30], fov_deg: [70, 50]}}";
    let sensor = Sensor::from_yaml(yaml, ".").unwrap();
    let trajectory = Trajectory::fixed(Pose::at(-6.0, 6.0, 1.2).with_rpy_deg(3.0, 10.0, -40.0));
    for fields in ["default,azimuth,elevation", "default,azimuth,elevation,depth", "x,y,z,azimuth,elevation"] {
        let fields = FieldSet::parse(fields).unwrap();
        let options = ScanOptions::default().fields(fields).organised(true);
        let cloud = built.scan(&sensor, &trajectory, &options).unwrap();
        let inside = options.coordinates(Frame::Sensor);
        let inside = built.scan(&sensor, &trajectory, &inside).unwrap();
        let path = folder.path().join("a.mcap");
        cloud.write(&path).unwrap();
        let found = &read("mcap", &[path])[0];
        let axis = |value: &Value| -> Vec<f64> {
            value.as_array().unwrap().iter().map(|text| text.as_str().unwrap().parse().unwrap()).collect()
        };
        let seen = [inside.columns().x(), inside.columns().y(), inside.columns().z()];
        for (index, column) in seen.into_iter().enumerate() {
            let read = axis(&found["unprojected"][index]);
            assert_eq!(read.len(), 1200);
            for (read, &x) in read.iter().zip(column) {
                assert!(
                    (read - f64::from(x)).abs() < 1e-4 || read.is_nan() && x.is_nan(),
                    "{index}: {read} is not {x}"
                );
            }
        }
        let labels: Vec<u32> = serde_json::from_value(found["labels"].clone()).unwrap_or_default();
        assert_eq!(labels, cloud.columns().category_id());
    }
}

#[test]
fn boxes_of_all_frames_have_files_of_their_own() {
    let mut all = cloud(12, FieldSet::default());
    let mut more = cloud(5, FieldSet::default());
    all.append(&more).unwrap();
    let boxes = all.boxes.clone().unwrap();
    assert_eq!(boxes[..12], cloud(12, FieldSet::default()).boxes.unwrap());
    assert_eq!(boxes[12..], more.boxes.clone().unwrap());
    more.boxes = None;
    assert!(all.append(&more).unwrap_err().to_string().contains("as to boxes"));

    let folder = tempfile::tempdir().unwrap();
    let files = ["all.json", "all.CSV", "none.json", "none.csv"].map(|name| folder.path().join(name));
    for (file, boxes) in files.iter().zip([&boxes[..], &boxes, &[], &[]]) {
        export::check_boxes(file).unwrap();
        export::write_boxes(boxes, &all.labels, file).unwrap();
    }
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 4);
    let found = read("boxes", &files);
    assert_eq!((&found[2]["boxes"], &found[3]["boxes"]), (&json!([]), &json!([])));
    let names = |found: &InstanceBox| {
        let category = ["", "chair", "Tür, \"groß\""][found.category_id as usize];
        (category, if found.instance_id == 1 { "Desk" } else { "" })
    };
    for (index, wanted) in boxes.iter().enumerate() {
        let (category, instance) = names(wanted);
        let mut named = told(wanted);
        named["category"] = category.into();
        named["instance"] = instance.into();
        assert_eq!(found[0]["boxes"][index], named);
        let cells = &found[1]["boxes"][index];
        let number = |name: &str| cells[name].as_str().unwrap().parse::<f64>().unwrap();
        let vector = |stem: &str, unit: &str| ["x", "y", "z"].map(|axis| number(&format!("{stem}_{axis}{unit}")));
        assert_eq!(cells["category"].as_str(), Some(category));
        assert_eq!(cells["instance"].as_str(), Some(instance));
        assert_eq!(number("track_id"), f64::from(wanted.track_id));
        assert_eq!((number("time_s"), number("visible")), (wanted.time, wanted.visible));
        assert_eq!(vector("position", "_m"), wanted.pose.position.to_array());
        assert_eq!(vector("size", "_m"), wanted.size.to_array());
        assert_eq!(vector("velocity", "_m_s"), wanted.velocity.to_array());
        assert_eq!(number("orientation_w"), wanted.pose.orientation.w);
    }

    let error = export::check_boxes(&folder.path().join("boxes.txt")).unwrap_err().to_string();
    assert!(error.contains("boxes are written as .json, .csv"), "{error}");
    assert!(export::check_boxes(&folder.path().join("missing/boxes.json")).is_err());
    let mut without = cloud(3, FieldSet::default());
    without.boxes = None;
    for format in ["npz", "hdf5"] {
        let path = folder.path().join(format);
        export::write(&without, &path, Some(format)).unwrap();
        assert_eq!(read(format, &[path])[0].get("boxes"), None);
    }
}

#[test]
fn the_same_cloud_gives_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    for format in FORMATS {
        let [first, second] = ["first", "second"].map(|name| {
            let path = folder.path().join(name);
            export::write(&cloud(2000, FieldSet::all()), &path, Some(format.name())).unwrap();
            std::thread::sleep(std::time::Duration::from_millis(if name == "first" { 1100 } else { 0 }));
            fs::read(path).unwrap()
        });
        assert!(first == second, "{}", format.name());
    }
}

/// Set in the process that may write at most 100 kB to a file.
const FULL_DISK: &str = "ECHOCAST_TEST_FULL_DISK";

#[test]
fn a_full_disk_leaves_the_older_file() {
    if let Some(path) = std::env::var_os(FULL_DISK) {
        let path = Path::new(&path);
        let cloud = cloud(50_000, FieldSet::default());
        for format in FORMATS {
            let error = export::write(&cloud, path, Some(format.name())).unwrap_err();
            assert!(matches!(&error, Error::Io { path: named, .. } if named == path), "{error}");
        }
        let mut frames = FramesFile::create(path).unwrap();
        let error = (0..3).try_for_each(|_| frames.add(&cloud)).and_then(|()| frames.finish()).unwrap_err();
        assert!(matches!(&error, Error::Io { path: named, .. } if named == path), "{error}");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cloud");
    fs::write(&path, "old").unwrap();
    // A limit on file size fails writes like a full disk, once its signal is ignored.
    let output = Command::new("sh")
        .args(["-c", "trap '' XFSZ; ulimit -f 200; exec \"$0\" \"$@\""])
        .arg(std::env::current_exe().unwrap())
        .args(["--exact", "a_full_disk_leaves_the_older_file", "--nocapture"])
        .env(FULL_DISK, &path)
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&output.stdout) + String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && text.contains("1 passed"), "{text}");
    assert_eq!(fs::read(&path).unwrap(), b"old");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
}
