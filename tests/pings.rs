//! Files of sonar pings and of their images, read back by third-party readers.

use echocast::cloud::{Columns, Field, FieldSet};
use echocast::image::{self, ImageRange, Overlap};
use echocast::scene::{Labels, NameTable};
use echocast::units::amplitude_from_db;
use echocast::{Layout, Ping, Pings, Pose, SonarView, Sounding};
use echocast_tests::python;
use glam::DVec3;
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

const BINS: usize = 40;

/// Three pings of a side-scan sonar that moves along x, with every kind of column.
fn pings() -> Pings {
    let layout = Arc::new(Layout {
        view: SonarView::Sidescan,
        axes: [90f32, -90.0].map(|degrees| [degrees.to_radians(), -0.5]).to_vec(),
        bins: BINS,
        bin_m: 0.5,
        first_bin: 0,
        believed_speed: 1480.0,
        noise_db: 31.5,
        threshold_db: vec![40.0; BINS],
        tvg_db: (0..BINS).map(|bin| 0.5 * bin as f32).collect(),
    });
    let fields = [Field::Intensity, Field::CategoryId, Field::Red, Field::Time, Field::TrueX];
    let labels = Labels {
        category: NameTable { ids: vec![1, 70_000], names: vec!["seabed".into(), "Fisch Ü".into()] },
        ..Labels::default()
    };
    let labels = Arc::new(labels);
    let cells = |number: usize, of: &dyn Fn(usize) -> f64| (0..2 * BINS).map(|cell| of(cell) + number as f64).collect();
    let ping = |number: usize| {
        let column: Vec<f64> = cells(number, &|cell| 60.0 + cell as f64 / 3.0);
        let mut ping = Ping::default();
        ping.number = 10 + number as u32;
        ping.time = 0.25 * number as f64;
        ping.pose = Pose::at(0.5 * number as f64, 2.0, -1.0).with_rpy_deg(1.0, 2.0, 0.0);
        ping.layout = Arc::clone(&layout);
        ping.origin = DVec3::new(500_000.0, 0.0, -7.0);
        ping.cells = Columns {
            intensity: column.iter().map(|&value| value as f32).collect(),
            category_id: (0..2 * BINS).map(|cell| [0, 1, 70_000][cell % 3]).collect(),
            red: (0..2 * BINS).map(|cell| (cell + number) as u8).collect(),
            time: column.clone(),
            true_x: column.iter().map(|&value| if value > 80.0 { value as f32 } else { f32::NAN }).collect(),
            ..Columns::default()
        };
        ping.fields = fields.into_iter().collect::<FieldSet>();
        ping.soundings = vec![Sounding { beam: 1, range: 7.25, cell: 54, level_db: 78.5, quality: 0.75 }; number];
        ping.labels = Arc::clone(&labels);
        ping
    };
    let mut pings = Pings::default();
    for number in 0..3 {
        pings.push(ping(number)).unwrap();
    }
    pings
}

/// What `tests/readers/pings.py` finds in `files`.
fn read(files: &[PathBuf]) -> Vec<Value> {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("readers/pings.py");
    let output = python().arg(script).args(files).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Compares the array `name` with `values`, f32 as f64.
fn compare(found: &Value, name: &str, kind: &str, shape: &[usize], values: impl IntoIterator<Item = f64>) {
    let array = &found[name];
    assert_eq!(array["type"], kind, "{name}");
    assert_eq!(array["shape"], serde_json::json!(shape), "{name}");
    let read: Vec<f64> =
        array["values"].as_array().unwrap().iter().map(|v| v.as_str().unwrap().parse().unwrap()).collect();
    let values: Vec<f64> = values.into_iter().collect();
    assert_eq!(read.len(), values.len(), "{name}");
    assert!(read.iter().zip(&values).all(|(a, b)| a == b || a.is_nan() && b.is_nan()), "{name}: {read:?} {values:?}");
}

fn texts(found: &Value, name: &str) -> Vec<String> {
    serde_json::from_value(found[name]["values"].clone()).unwrap()
}

#[test]
fn pings_are_read_back() {
    let folder = tempfile::tempdir().unwrap();
    let pings = pings();
    let files = ["a.npz", "a.h5"].map(|name| folder.path().join(name));
    for file in &files {
        assert!(pings.write(file).unwrap().warnings.is_empty());
    }
    let all = &pings.pings;
    let cells = [3, 2, BINS];
    for found in &read(&files) {
        let levels = || all.iter().flat_map(|ping| &ping.cells.intensity).copied();
        compare(found, "level", "f4", &cells, levels().map(f64::from));
        compare(
            found,
            "amplitude",
            "f4",
            &cells,
            levels().map(|level| f64::from(amplitude_from_db(level.into()) as f32)),
        );
        let ids = all.iter().flat_map(|ping| &ping.cells.category_id);
        compare(found, "category_id", "u4", &cells, ids.map(|&id| f64::from(id)));
        let red = all.iter().flat_map(|ping| &ping.cells.red);
        compare(found, "red", "u1", &cells, red.map(|&red| f64::from(red)));
        compare(found, "time", "f8", &cells, all.iter().flat_map(|ping| ping.cells.time.clone()));
        let true_x = all.iter().flat_map(|ping| &ping.cells.true_x);
        compare(found, "true_x", "f4", &cells, true_x.map(|&x| f64::from(x)));
        compare(found, "origin", "f8", &[3], [500_000.0, 0.0, -7.0]);
        compare(found, "ping_number", "u4", &[3], [10.0, 11.0, 12.0]);
        compare(found, "ping_time", "f8", &[3], [0.0, 0.25, 0.5]);
        compare(found, "sensor_position", "f8", &[3, 3], all.iter().flat_map(|ping| ping.pose.position.to_array()));
        let turns = all.iter().flat_map(|ping| ping.pose.orientation.to_array());
        compare(found, "sensor_orientation_xyzw", "f8", &[3, 4], turns);
        compare(found, "beam_azimuth", "f4", &[2], [90f32, -90.0].map(|degrees| f64::from(degrees.to_radians())));
        compare(found, "beam_elevation", "f4", &[2], [-0.5; 2]);
        compare(found, "bin_m", "f8", &[], [0.5]);
        compare(found, "believed_speed_m_s", "f8", &[], [1480.0]);
        compare(found, "noise_db", "f4", &[], [31.5]);
        compare(found, "threshold_db", "f4", &[BINS], [40.0; BINS]);
        compare(found, "tvg_db", "f4", &[BINS], (0..BINS).map(|bin| 0.5 * bin as f64));
        compare(found, "sounding_ping", "u4", &[3], [1.0, 2.0, 2.0]);
        compare(found, "sounding_beam", "u4", &[3], [1.0; 3]);
        compare(found, "sounding_range", "f4", &[3], [7.25; 3]);
        compare(found, "sounding_level_db", "f4", &[3], [78.5; 3]);
        compare(found, "sounding_quality", "f4", &[3], [0.75; 3]);
        compare(found, "sounding_cell", "u4", &[3], [54.0; 3]);
        compare(found, "category_ids", "u4", &[2], [1.0, 70_000.0]);
        assert_eq!(texts(found, "category_names"), ["seabed", "Fisch Ü"]);
        assert_eq!(texts(found, "view"), ["sidescan"]);
        // Nothing else except the tables of the other labels.
        let names = found.as_object().unwrap().keys();
        assert_eq!(names.filter(|name| !name.ends_with("_names") && !name.ends_with("_ids")).count(), 25);
    }
}

#[test]
fn images_are_read_back() {
    let folder = tempfile::tempdir().unwrap();
    let pings = pings();
    let waterfall = image::waterfall(&pings, ImageRange::Slant, None).unwrap();
    let mosaic = image::mosaic(&pings, ImageRange::Slant, 0.25, Overlap::Mean).unwrap();
    for image in [&waterfall, &mosaic] {
        let files = ["a.npz", "a.hdf5"].map(|name| folder.path().join(name));
        files.iter().for_each(|file| drop(image.write(file).unwrap()));
        let shape = [image.height, image.width];
        for found in &read(&files) {
            compare(found, "values", "f4", &shape, image.values.iter().map(|&value| f64::from(value)));
            let ids = image.layer(Field::CategoryId).unwrap();
            compare(found, "category_id", "u4", &shape, ids.iter().map(|&id| f64::from(id)));
            compare(found, "first", "f8", &[2], image.place.first);
            compare(found, "step", "f8", &[2], image.place.step);
            assert_eq!(texts(found, "kind"), [image.kind.name()]);
            assert_eq!(texts(found, "column_axis"), [image.place.axes[0]]);
        }
    }
    assert_eq!((waterfall.width, waterfall.height, waterfall.place.first), (2 * BINS, 3, [-19.75, 0.0]));
}

#[test]
fn the_same_pings_give_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    for ending in ["npz", "h5"] {
        let [first, second] = ["first", "second"].map(|name| {
            let path = folder.path().join(format!("{name}.{ending}"));
            pings().write(&path).unwrap();
            std::thread::sleep(std::time::Duration::from_millis(if name == "first" { 1100 } else { 0 }));
            fs::read(path).unwrap()
        });
        assert!(first == second, "{ending}");
    }
}
