//! Clouds that are read: what every format keeps comes back, and files of other programs mean what these say.

use super::{cloud, made_of_positions, many_names, organised, said};
use echocast::cloud::{Column, FIELDS};
use echocast::export::{self, FORMATS, labels_path};
use echocast::{Driver, Field, FieldSet, Frame, Named as _, PointCloud, Report, import};
use echocast_tests::python;
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::sync::Arc;

/// The cloud in the file at `path`, and what was said.
pub(super) fn read(path: &Path) -> (PointCloud, Report) {
    let mut report = Report::default();
    let cloud = import::read(path, &mut report).unwrap();
    (cloud, report)
}

/// How far `format` may move the value of row `row` of the column `field`.
fn tolerance(cloud: &PointCloud, format: &str, field: Field, row: usize) -> f64 {
    let value = cloud.column(field).get_f64(row);
    // Half a step of f32, and what f64 resolves at such an origin.
    let f32_step = (value.abs() * f64::from(f32::EPSILON)).max(1e-12);
    let position = matches!(field, Field::X | Field::Y | Field::Z);
    let truth = matches!(field, Field::TrueX | Field::TrueY | Field::TrueZ);
    let far = position || truth || matches!(field, Field::CorrectedX | Field::CorrectedY | Field::CorrectedZ);
    let bag = format.starts_with("mcap");
    match format {
        "las" | "laz" | "las2" if position => 0.5e-4 + f32_step,
        "las" | "laz" | "las2" if field == Field::Intensity => 0.5 / 65535.0,
        "las" | "laz" if field == Field::ScanAngle => 0.003_f64.to_radians() + f32_step,
        "las2" if field == Field::ScanAngle => 0.5_f64.to_radians() + f32_step,
        // Turned into the frame of the sensor and back, kilometres away.
        _ if position && (format == "e57" || bag) => 1e-3,
        // Drivers count from the stamp, in f32 or nanoseconds, or all nanoseconds in f64.
        "mcap" | "mcap_velodyne" if field == Field::Time => 1e-7 + 2.0 * value.abs() * f64::EPSILON,
        "mcap_ouster" | "mcap_livox" | "mcap_autoware" if field == Field::Time => {
            2e-9 + 2.0 * value.abs() * f64::EPSILON
        }
        "mcap_ouster" if field == Field::Range => 0.5e-3 + f32_step,
        "mcap_autoware" if field == Field::Intensity => {
            (0.5 / 255.0 + 1e-6) * f64::from(cloud.intensity_full_scale.unwrap_or(1.0))
        }
        "csv" | "pcd_ascii" if far => 0.5e-6 + 1e-9 + f32_step,
        "ply" | "pcd" | "pcd_compressed" | "las" | "laz" | "las2" | "e57" if far => 1e-9,
        _ => 0.0,
    }
}

/// Compares the columns of `read` with `rows` of those that `format` holds of `cloud`.
fn compare(cloud: &PointCloud, format: &str, read: &PointCloud, rows: &[usize], held: FieldSet) {
    for info in FIELDS {
        let made = made_of_positions(format, info.field);
        assert_eq!(read.fields().contains(info.field), held.contains(info.field) || made, "{format} {}", info.name);
    }
    assert_eq!(read.len(), rows.len(), "{format}");
    for info in held.iter() {
        let (before, after) = (cloud.column(info.field), read.column(info.field));
        for (to, &row) in rows.iter().enumerate() {
            let (mut value, found) = (before.get_f64(row), after.get_f64(to));
            if format == "las2" && info.field == Field::CategoryId {
                value = value.min(65535.0);
            }
            if format == "mcap_livox" && info.field == Field::Ring {
                // A byte, as the driver has it.
                value = value.min(255.0);
            }
            let whole =
                matches!((format, info.field), ("mcap_ouster", Field::Range) | ("mcap_autoware", Field::Intensity));
            if whole && value.is_nan() {
                // As the driver has it.
                value = 0.0;
            }
            let same = (value - found).abs() <= tolerance(cloud, format, info.field, row);
            assert!(same || value.is_nan() && found.is_nan(), "{format} {} row {row}: {value} is {found}", info.name);
        }
    }
}

#[test]
fn what_is_written_comes_back() {
    let mut many_names = many_names();
    Arc::make_mut(&mut many_names.labels).las_class = [(1, 6), (70_000, 5)].into();
    let mut sensor_frame = cloud(10, FieldSet::parse("x,y,z").unwrap());
    sensor_frame.frame = Frame::Sensor;
    sensor_frame.intensity_full_scale = None;
    sensor_frame.origin = glam::DVec3::ZERO;
    let mut eight_bits = cloud(300, FieldSet::default());
    eight_bits.intensity_full_scale = Some(255.0);
    eight_bits.columns_mut().intensity.iter_mut().for_each(|value| *value = (*value * 255.0).round());
    eight_bits.driver = Some(Driver::Hesai);
    let clouds = [
        cloud(5000, FieldSet::all()),
        cloud(3000, FieldSet::default()),
        organised(),
        cloud(1, FieldSet::all()),
        cloud(0, FieldSet::all()),
        sensor_frame,
        many_names,
        eight_bits,
    ];
    let folder = tempfile::tempdir().unwrap();
    for format in FORMATS {
        let name = format.name();
        let (las, bag) = (name.starts_with("la"), name.starts_with("mcap"));
        for (i, cloud) in clouds.iter().enumerate() {
            // Whatever the file is called.
            let path = folder.path().join(format!("{name} {i}.file"));
            export::write(cloud, &path, Some(name)).unwrap();
            let (found, report) = read(&path);
            // What drivers say besides, and boxes.
            let told = |warning: &String| warning.starts_with("mcap: a cloud cannot hold ");
            assert!(las || report.warnings.iter().all(|warning| bag && told(warning)), "{name}: {report:?}");
            let held = cloud.fields().iter().filter(|info| format.holds(info)).map(|info| info.field);
            let mut held: FieldSet = held.collect();
            if name == "e57" && cloud.is_empty() {
                held = FieldSet::parse("x,y,z").unwrap();
            }
            let rows = (0..cloud.len()).filter(|&row| !(las && cloud.columns().x()[row].is_nan()));
            compare(cloud, name, &found, &rows.collect::<Vec<_>>(), held);
            assert_eq!(found.organised(), if las { None } else { cloud.organised() }, "{name}");
            let about = |cloud: &PointCloud| (cloud.origin, cloud.frame, cloud.sensor_pose, cloud.intensity_full_scale);
            assert_eq!(about(&found), about(cloud), "{name} {i}");
            let own =
                name.strip_prefix("mcap_").map(|own| Driver::NAMES.iter().find(|(known, _)| *known == own).unwrap().1);
            assert_eq!(found.driver, own.or(cloud.driver), "{name} {i}");
            for (before, after) in cloud.labels.tables().iter().zip(found.labels.tables()) {
                assert_eq!(*before, after, "{name} {i}");
            }
            let boxed = matches!(name, "npz" | "hdf5");
            assert_eq!(found.boxes, cloud.boxes.clone().filter(|_| boxed), "{name}");

            // Written again it is the same file, but where coordinates were turned.
            if name != "e57" && !bag {
                let again = folder.path().join(format!("{name} {i} again.file"));
                export::write(&found, &again, Some(name)).unwrap();
                assert!(fs::read(&again).unwrap() == fs::read(&path).unwrap(), "{name} {i}");
                let labels = |path: &Path| fs::read_to_string(labels_path(path)).ok();
                if !las {
                    assert_eq!(labels(&again), labels(&path), "{name} {i}");
                }
            }
        }
    }
}

#[test]
fn classes_of_las_stay() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.laz");
    let mut cloud = cloud(100, FieldSet::default());
    let classes = [(1, 6), (70_000, 5)].into();
    Arc::make_mut(&mut cloud.labels).las_class = classes;
    cloud.columns_mut().category_id.iter_mut().zip([0, 1, 70_000].into_iter().cycle()).for_each(|(to, id)| *to = id);
    cloud.write(&path).unwrap();
    assert_eq!(PointCloud::read(&path).unwrap().labels.las_class, cloud.labels.las_class);
}

/// A column as JSON has it.
fn numbers(found: &Value) -> Vec<f64> {
    let number = |value: &Value| value.as_str().map_or_else(|| value.as_f64().unwrap(), |text| text.parse().unwrap());
    found.as_array().unwrap().iter().map(number).collect()
}

#[test]
fn files_of_other_programs_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("readers/foreign.py");
    let output = python().arg(script).arg(folder.path()).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let files: Value = serde_json::from_slice(&output.stdout).unwrap();
    let files = files.as_object().unwrap();
    assert!(files.len() >= 25, "{:?}", files.keys());
    for (file, wanted) in files {
        let (cloud, report) = read(&folder.path().join(file));
        let columns = wanted["columns"].as_object().unwrap();
        for (name, values) in columns {
            let field = Field::from_name(name).unwrap();
            let values = numbers(values);
            let column = cloud.column(field);
            assert_eq!(column.len(), values.len(), "{file} {name}: {report:?}");
            let offset = match field {
                Field::X => cloud.origin.x,
                Field::Y => cloud.origin.y,
                Field::Z => cloud.origin.z,
                _ => 0.0,
            };
            let tolerance = wanted["tolerance"][name].as_f64().unwrap_or(0.0);
            for (row, &value) in values.iter().enumerate() {
                let found = column.get_f64(row) + offset;
                let same = (found - value).abs() <= tolerance || found.is_nan() && value.is_nan();
                assert!(same, "{file} {name} row {row}: {value} is {found}");
            }
        }
        let held: Vec<&str> =
            cloud.fields().iter().map(|info| info.name).filter(|n| !columns.contains_key(*n)).collect();
        assert!(held.is_empty(), "{file} made up {held:?}");
        for lost in wanted["lost"].as_array().into_iter().flatten() {
            assert!(said(&report, lost.as_str().unwrap()), "{file} {lost}: {report:?}");
        }
        if wanted["lost"].is_null() {
            assert!(report.warnings.is_empty(), "{file}: {report:?}");
        }
        for (id, name) in wanted["categories"].as_object().into_iter().flatten() {
            assert_eq!(cloud.labels.category.name(id.parse().unwrap()), name.as_str(), "{file}");
        }
        if !wanted["shape"].is_null() {
            assert_eq!(serde_json::to_value(cloud.organised()).unwrap(), wanted["shape"], "{file}");
        }
        if !wanted["sensor"].is_null() {
            assert_eq!(cloud.sensor_pose.position.to_array()[..], numbers(&wanted["sensor"]), "{file}");
        }
    }
}

#[test]
fn damaged_clouds_are_refused_with_a_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.file");
    let error = |bytes: &[u8]| {
        fs::write(&path, bytes).unwrap();
        let error = PointCloud::read(&path).unwrap_err().to_string();
        assert!(error.contains("a.file: ") && error.len() < 500, "{error}");
        error
    };
    assert!(error(b"").contains("does not begin as a cloud does"));
    assert!(error(b"glTF....").contains(".las, .laz"));
    let mut whole = cloud(2000, FieldSet::default());
    whole.boxes = None;
    for format in FORMATS {
        export::write(&whole, &path, Some(format.name())).unwrap();
        let bytes = fs::read(&path).unwrap();
        for part in [10, 100, 500, 2000, bytes.len() / 2, bytes.len() - 1] {
            // The end of the last line says nothing, and that of a number is one.
            let is_text = matches!(format.name(), "csv" | "pcd_ascii");
            if is_text && part == bytes.len() - 1 {
                continue;
            }
            let told = error(&bytes[..part]);
            assert!(!told.contains("internal"), "{} {part}: {told}", format.name());
        }
    }
    fs::remove_file(labels_path(&path)).unwrap();

    // Claims that no file could keep.
    let claims =
        "ply\nformat binary_little_endian 1.0\nelement vertex 9223372036854775807\nproperty float x\nend_header\n";
    assert!(error(claims.as_bytes()).contains("says it has 9223372036854775807 points"));
    let ascii = claims.replace("binary_little_endian", "ascii") + "1\n2\n";
    assert!(error(ascii.as_bytes()).contains("points, and has 2: it is cut off"));
    let pcd = |points: &str, data: &str| {
        format!(
            "# .PCD v0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH {points}\nHEIGHT 1\nPOINTS {points}\nDATA {data}\n"
        )
    };
    assert!(error(pcd("9223372036854775807", "binary").as_bytes()).contains("says it has 9223372036854775807 points"));
    assert!(error(pcd("9223372036854775807", "ascii").as_bytes()).contains("and has 0"));
    assert!(error(pcd("3", "zip").as_bytes()).contains("allowed: ascii, binary, binary_compressed"));
    assert!(error(pcd("-3", "ascii").as_bytes()).contains("line 6: WIDTH"));
    let packed = |points: &str, [packed, whole]: [u32; 2]| {
        [pcd(points, "binary_compressed").into_bytes(), packed.to_le_bytes().into(), whole.to_le_bytes().into()]
            .concat()
    };
    assert!(error(&packed("100000000", [0, 1_200_000_000])).contains("says that 0 bytes are 1200000000"));
    assert!(error(&packed("3", [36, 36])).contains("cut off"));
    assert!(
        error(b"ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nelement face 2\nend_header\n")
            .contains("mesh")
    );
    assert!(error(b"x,y,z\n1,2,3\n4,five,6\n").contains("line 3: \"five\" is not a number"));
    assert!(error(b"x,y,z\n1,2\n").contains("line 2: has 2 numbers; expected 3"));

    // Points of LAS: as many as a number can be, and compressed wrongly.
    for name in ["las", "laz"] {
        export::write(&whole, &path, Some(name)).unwrap();
        let mut bytes = fs::read(&path).unwrap();
        bytes[247..255].copy_from_slice(&(1u64 << 63).to_le_bytes());
        assert!(error(&bytes).contains("says it has 9223372036854775808 points"));
        bytes[131..139].copy_from_slice(&f64::NAN.to_le_bytes());
        assert!(error(&bytes).contains("scales coordinates by"));
        bytes[104] = 11 | bytes[104] & 0x80;
        assert!(error(&bytes).contains("format 11; allowed: 0 to 10"));
    }
}

#[test]
fn positions_that_are_none_stay_empty() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.csv");
    fs::write(&path, "x;y;z;label\n1;2;3;4\nnan;nan;nan;0\n1e300;inf;-1;5\n").unwrap();
    let (cloud, report) = read(&path);
    assert_eq!((cloud.columns().x()[0], cloud.columns().category_id()[2], cloud.len()), (1.0, 5, 3));
    assert!(cloud.columns().x()[1].is_nan() && cloud.columns().x()[2].is_nan() && cloud.columns().y()[2].is_nan());
    assert_eq!(cloud.columns().z()[2], -1.0);
    assert!(said(&report, "farther than 1e18 m") && said(&report, "rows without a position"), "{report:?}");
    // Far from the origin, positions keep their precision beside another one.
    fs::write(&path, "x,y,z,temperature\n500123.4567,5600000.25,10,20\n500124.4568,5600001.25,11,20\n").unwrap();
    let (cloud, report) = read(&path);
    assert_eq!(cloud.origin, glam::DVec3::new(500_000.0, 5_600_000.0, 0.0));
    assert!((cloud.position(1).x - 500_124.456_8).abs() < 1e-5);
    assert!(said(&report, "csv: a cloud cannot hold temperature"), "{report:?}");
    assert!(matches!(cloud.column(Field::Range), Column::F32([])));
}
