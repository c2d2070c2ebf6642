//! Clouds as strangers write them: text with all kinds of headers or none, PLY with lists, coordinate systems and records
//! of surveying, damaged heaps of HDF5, bombs.

use super::{cloud, read::read, said};
use echocast::cloud::{Field, FieldSet, Frame, Record, Records};
use echocast::export::{self, FORMATS, FramesFile, GrowingFile};
use echocast::import::{self, ReadOptions};
use echocast::{PointCloud, Pose, Report};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

const PLACES: [[f64; 3]; 2] = [[1.5, 2.5, 3.5], [4.5, 5.5, 6.5]];

fn positions(cloud: &PointCloud) -> Vec<[f64; 3]> {
    (0..cloud.len).map(|row| cloud.position(row).to_array()).collect()
}

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("data/clouds").join(name)
}

#[test]
fn texts_of_other_programs_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.txt");
    // What the columns beside the places are, and what is said.
    for (text, columns, told) in [
        ("\u{feff}X,Y,Z,Intensity\r\n1.5,2.5,3.5,0.25\r\n4.5,5.5,6.5,0.5\r\n", "intensity", ""),
        ("\"X\";\"Y\";\"Z\"\n1,5;2,5;3,5\n4,5;5,5;6,5\n", "", "decimal points"),
        ("x\ty\tz\n1,5\t2,5\t3,5\n4,5\t5,5\t6,5\n", "", "decimal points"),
        ("1,5 2,5 3,5\n4,5 5,5 6,5\n", "", "no header"),
        ("\"Name\",\"X\",\"Y\",\"Z\"\n\"a, b\",1.5,2.5,3.5\n\"c\",\"4.5\",5.5,6.5\n", "", "no place for Name"),
        ("X (m),Y (m),Z (cm),note,\n1.5,2.5,350,stone,\n4.5,5.5,650,,\n", "", "no place for note"),
        ("Easting;Northing;Height\n1.5;2.5;3.5\n4.5;5.5;6.5\n", "", ""),
        // CloudCompare, with the number of points and without it; scalar fields with blanks in their names.
        (
            "//X;Y;Z;Rf;Gf;Bf;Intensity;Illuminance (PCV);Nx;Ny;Nz\n2\n1.5;2.5;3.5;1;0.2;0;0.5;0.9;0;0;1\n\
             4.5;5.5;6.5;0;0;1;0.25;0.9;1;0;0\n",
            "red,green,blue,intensity,normal_x,normal_y,normal_z",
            "no place for Illuminance (PCV)",
        ),
        ("//X Y Z R G B\n1.5 2.5 3.5 255 0 9\n4.5 5.5 6.5 1 2 3\n", "red,green,blue", ""),
        ("# made by hand, on Monday\n# x, y, z\n1.5 2.5 3.5\n4.5 5.5 6.5\n", "", ""),
        // PTS, of one scan and of two.
        (
            "2\n1.5 2.5 3.5 -2048 255 0 9\n4.5 5.5 6.5 2047 1 2 3\n",
            "intensity,red,green,blue",
            "taken as x,y,z,intensity,red,green,blue",
        ),
        ("1\n1.5 2.5 3.5 -700\n1\n4.5 5.5 6.5 12\n", "intensity", "taken as x,y,z,intensity"),
        ("1.5 2.5 3.5\n\n4.5  5.5\t6.5\n", "", "taken as x,y,z"),
        ("1.5,2.5,3.5,0.1,0.5,1\n4.5,5.5,6.5,0,0.25,0\n", "red,green,blue", "colours from 0 to 1"),
        ("1.5 2.5 3.5 0.6 0.8 0\n4.5 5.5 6.5 0 0 -1\n", "normal_x,normal_y,normal_z", "normal_z"),
        ("1.5 2.5 3.5 7 8\n4.5 5.5 6.5 7 8\n", "", "and 2 more are left out"),
        ("X,Y,Z,Temperatur \u{b0}C\n1.5,2.5,3.5,20\n4.5,5.5,6.5,21\n", "", "no place for Temperatur"),
    ] {
        fs::write(&path, text).unwrap();
        let (cloud, report) = read(&path);
        for (found, wanted) in positions(&cloud).iter().flatten().zip(PLACES.as_flattened()) {
            assert!((found - wanted).abs() < 1e-6, "{text:?}: {:?}", positions(&cloud));
        }
        let wanted = FieldSet::parse(format!("x,y,z,{columns}").replace(",,", ",").trim_end_matches(',')).unwrap();
        assert_eq!((cloud.fields, cloud.len), (wanted, 2), "{text:?}");
        assert_eq!(report.warnings.is_empty(), told.is_empty(), "{text:?}: {report:?}");
        assert!(told.is_empty() || said(&report, told), "{text:?}: {report:?}");
    }
    let rows = |text: &[u8]| {
        fs::write(&path, text).unwrap();
        read(&path).0
    };
    let found = rows(b"2\n1.5 2.5 3.5 -2048 255 0 9\n4.5 5.5 6.5 2047 1 2 3\n");
    assert_eq!((&found.columns.intensity[..], found.intensity_full_scale), (&[-2048.0, 2047.0][..], None));
    assert_eq!((found.columns.red, found.columns.blue), (vec![255, 1], vec![9, 3]));
    let found = rows(b"//X Y Z Rf Gf Bf\n1 2 3 1 0.2 0\n4 5 6 0 0 1\n");
    assert_eq!((found.columns.red, found.columns.green), (vec![255, 0], vec![51, 0]));
    // Names in an older alphabet.
    assert_eq!(rows(b"X,Y,Z,H\xf6he\n1,2,3,4\n").len, 1);

    let error = |text: &[u8]| {
        fs::write(&path, text).unwrap();
        PointCloud::read(&path).unwrap_err().to_string()
    };
    assert!(error(b"\xff\xfex\0,\0y\0,\0z\0\n\0").contains("UTF-16"));
    assert!(error(b"3\n1 2 3 4\n1 2 3 4\n").contains("says it has 3 points, and has 2"));
    assert!(error(b"1 2 3\n7\n1 2 3\n").contains("line 2: has 1 numbers; expected 3"));
    let ptx = "1\n1\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n1 2 3 0.5\n";
    assert!(error(ptx.as_bytes()).contains("is a PTX file"));
}

#[test]
fn columns_of_text_can_be_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.xyz");
    let named = |text: &str, columns: &str| {
        fs::write(&path, text).unwrap();
        let columns = Some(columns.split(',').map(str::to_owned).collect());
        let mut report = Report::default();
        import::read_with(&path, &ReadOptions { columns }, &mut report).map(|cloud| (cloud, report))
    };
    let (found, report) = named("# no header\n2\n7 1.5 2.5 3.5 0.5 9\n8 4.5 5.5 6.5 0.25 9\n", "_,x,y,Z,i").unwrap();
    assert_eq!((positions(&found), &found.columns.intensity[..]), (PLACES.to_vec(), &[0.5, 0.25][..]));
    assert!(report.warnings.is_empty(), "{report:?}");
    // Instead of a header, whatever it says.
    let (found, _) = named("a;b;c\n1.5;2.5;3.5\n4.5;5.5;6.5\n", "x,y,z").unwrap();
    assert_eq!(positions(&found), PLACES);
    let error = |text: &str, columns: &str| named(text, columns).unwrap_err().to_string();
    assert!(error("1 2 3\n", "x,y,colour").contains("colour"));
    assert!(error("1 2 3\n", "x,y,z,intensity").contains("no row for the columns x,y,z,intensity"));
    assert!(error("ply\nformat ascii 1.0\nelement vertex 0\nend_header\n", "x,y,z").contains("PLY"));
}

/// Rows of a PLY file, with a list in the middle of each, behind an element that is none of ours.
fn listed(encoding: &str) -> Vec<u8> {
    let mut bytes = format!(
        "ply\nformat {encoding} 1.0\nelement camera 2\nproperty list uchar short view\nproperty float f\nelement vertex 2\n\
         property double x\nproperty list ushort int seen_by\nproperty double y\nproperty double z\nproperty list uchar float w\n\
         property uchar intensity\nelement face 0\nproperty list uchar int vertex_indices\nend_header\n"
    )
    .into_bytes();
    if encoding == "ascii" {
        bytes.extend(b"2 7 8 0.5\n0 0.5\n1.5 3 7 8 9 2.5 3.5 0 200\n4.5 0 5.5 6.5 1 0.5 100\n");
        return bytes;
    }
    macro_rules! put {
        ($($number:expr),*) => {$(
            let number = $number;
            bytes.extend(if encoding.contains("big") { number.to_be_bytes().to_vec() } else { number.to_le_bytes().to_vec() });
        )*};
    }
    put!(2u8, 7i16, 8i16, 0.5f32, 0u8, 0.5f32);
    put!(1.5f64, 3u16, 7i32, 8i32, 9i32, 2.5f64, 3.5f64, 0u8, 200u8);
    put!(4.5f64, 0u16, 5.5f64, 6.5f64, 1u8, 0.5f32, 100u8);
    bytes
}

#[test]
fn lists_of_vertices_are_skipped_and_told() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.ply");
    for encoding in ["ascii", "binary_little_endian", "binary_big_endian"] {
        let bytes = listed(encoding);
        fs::write(&path, &bytes).unwrap();
        assert!(import::is_cloud(&path).unwrap());
        let (found, report) = read(&path);
        assert_eq!(
            (positions(&found), &found.columns.intensity[..]),
            (PLACES.to_vec(), &[200.0, 100.0][..]),
            "{encoding}"
        );
        assert!(said(&report, "seen_by[], w[]") && said(&report, "camera"), "{report:?}");
        for end in bytes.len() - 40..bytes.len() - 5 {
            fs::write(&path, &bytes[..end]).unwrap();
            let error = PointCloud::read(&path).unwrap_err().to_string();
            assert!(error.contains("a.ply: "), "{encoding} {end}: {error}");
        }
    }
    // Lists that claim more than there is.
    let claims = String::from_utf8(listed("ascii")).unwrap().replace("3 7 8 9", "99999999999999 7 8 9");
    fs::write(&path, claims).unwrap();
    assert!(PointCloud::read(&path).unwrap_err().to_string().contains("line 18: has a list of"));
}

fn wkt(name: &str) -> Record {
    let data = format!("PROJCS[\"{name}\",GEOGCS[\"WGS 84\"]]\0").into_bytes();
    Record { user: "LASF_Projection".into(), id: 2112, description: "WKT".into(), data }
}

/// Keys of GeoTIFF that say EPSG:25832.
fn keys() -> Record {
    let data = [1u16, 1, 0, 1, 3072, 0, 1, 25832].iter().flat_map(|key| key.to_le_bytes()).collect();
    Record { user: "LASF_Projection".into(), id: 34735, description: "keys".into(), data }
}

#[test]
fn coordinate_systems_and_records_stay_or_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let own = Record { user: "liblas".into(), id: 7, description: "anything".into(), data: vec![1, 2, 3] };
    // Behind the points, for it is too long to be before them.
    let long = Record { user: "somebody".into(), id: 9, description: String::new(), data: vec![7; 70_000] };
    let with = |all: Vec<Record>| {
        let mut cloud = cloud(100, FieldSet::parse("x,y,z,time").unwrap());
        cloud.records = Arc::new(Records { all, standard_time: true });
        cloud.boxes = None;
        cloud
    };
    for (records, name) in [
        (vec![wkt("WGS 84 / UTM zone 33N"), own.clone(), long.clone()], "WGS 84 / UTM zone 33N"),
        (vec![keys(), own.clone(), long.clone()], "EPSG:25832"),
    ] {
        let cloud = with(records.clone());
        assert_eq!(cloud.records.system().as_deref(), Some(name));
        let text = cloud.records.wkt().is_some();
        for format in FORMATS {
            let path = folder.path().join(format.name());
            let report = export::write(&cloud, &path, Some(format.name())).unwrap();
            let found = read(&path).0;
            match format.name() {
                "las" | "laz" => {
                    assert_eq!(found.records, cloud.records, "{}", format.name());
                    // Of points from format 6 on, whatever there is; and times of GPS.
                    assert_eq!(fs::read(&path).unwrap()[6..8], [0b1_0001, 0]);
                    assert_eq!(said(&report, "GeoTIFF keys"), !text, "{report:?}");
                    assert!(!said(&report, "cannot hold"), "{report:?}");
                }
                "las2" => {
                    assert_eq!(found.records.all, records[..2]);
                    assert_eq!(fs::read(&path).unwrap()[6] & 16, 0);
                    assert!(said(&report, "cannot hold the records somebody 9"), "{report:?}");
                    assert_eq!(said(&report, "LAS 1.2 knows no coordinate systems as text"), text, "{report:?}");
                }
                "e57" => {
                    assert_eq!(found.records.wkt(), cloud.records.wkt());
                    assert_eq!(said(&report, "coordinate system"), !text, "{report:?}");
                    assert!(said(&report, "liblas 7, somebody 9"), "{report:?}");
                }
                other => {
                    let told = format!(
                        "{other}: cannot hold the coordinate system {name} and the records liblas 7, somebody 9"
                    );
                    assert!(said(&report, &told), "{report:?}");
                }
            }
        }
        // From file to file, and frame by frame.
        let [las, laz] = ["a.las", "a.laz"].map(|name| folder.path().join(name));
        cloud.write(&las).unwrap();
        let mut grown = GrowingFile::begin(&laz, None, &read(&las).0).unwrap().unwrap();
        grown.add(&cloud).unwrap();
        grown.finish().unwrap();
        assert_eq!(read(&laz).0.records, cloud.records);
    }
    // What points into its own file is not kept.
    let path = folder.path().join("a.las");
    let copc = Record { user: "copc".into(), id: 1, description: String::new(), data: vec![0; 160] };
    with(vec![copc, own.clone()]).write(&path).unwrap();
    let (found, report) = read(&path);
    assert!(said(&report, "no place for copc 1") && found.records.all == [own], "{report:?}");
}

/// Every number of a place that any writer keeps in f32, at (500000, 5600000): all come back within a millimetre, or the
/// loss is told.
#[test]
fn places_far_from_the_origin_stay_precise() {
    let folder = tempfile::tempdir().unwrap();
    let fields = FieldSet::parse("default,true_x,true_y,true_z,corrected_x,corrected_y,corrected_z").unwrap();
    let mut poseless = cloud(200, fields);
    poseless.sensor_pose = Pose::IDENTITY;
    poseless.boxes = None;
    let mut wide = poseless.clone();
    // From the least to the greatest, 6 km.
    wide.columns.x.iter_mut().enumerate().for_each(|(row, x)| *x = (row as f32 - 100.0) * 30.0);
    let mut own = poseless.clone();
    own.frame = Frame::Sensor;
    for (name, cloud) in
        [("poseless", &poseless), ("wide", &wide), ("sensor", &own), ("posed", &super::cloud(200, fields))]
    {
        for format in FORMATS {
            let path = folder.path().join(format.name());
            let report = export::write(cloud, &path, Some(format.name())).unwrap();
            let found = read(&path).0;
            let mut worst = 0.0_f64;
            let axes = || ["x", "y", "z"].into_iter().enumerate();
            let places = ["", "true_", "corrected_"].into_iter().flat_map(|stem| axes().map(move |axis| (stem, axis)));
            for (stem, (axis, letter)) in places {
                let field = Field::from_name(&format!("{stem}{letter}")).unwrap();
                if !found.fields.contains(field) {
                    assert!(!format.holds(field.info()), "{}", format.name());
                    continue;
                }
                let value = |cloud: &PointCloud, row| cloud.column(field).get_f64(row) + cloud.origin[axis];
                for row in 0..cloud.len {
                    let off = (value(&found, row) - value(cloud, row)).abs();
                    worst = worst.max(if value(cloud, row).is_nan() { 0.0 } else { off });
                }
            }
            assert!(worst < 1e-3 || said(&report, "precision"), "{name} {}: {worst} m, {report:?}", format.name());
            assert!(
                said(&report, "precision") == (name == "sensor" && format.name().starts_with("mcap")),
                "{report:?}"
            );
            assert_eq!(found.sensor_pose, cloud.sensor_pose, "{name} {}", format.name());
        }
    }
}

#[test]
fn damaged_heaps_of_hdf5_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.h5");
    let whole = fs::read(data("variable_texts.h5")).unwrap();
    let (cloud, report) = read(&data("variable_texts.h5"));
    assert_eq!(cloud.labels.category.names, ["M\u{fffd}", "frame", "glass", "wall"]);
    assert_eq!(cloud.labels.material.names, ["glass", "plaster", "wood"]);
    assert!(said(&report, "not UTF-8") && cloud.len == 121 && cloud.frame == Frame::World, "{report:?}");
    // Written again, texts have a length, and no heap is needed.
    cloud.write(&path).unwrap();
    assert!(!fs::read(&path).unwrap().windows(4).any(|bytes| bytes == b"GCOL"));
    assert_eq!(read(&path).0.labels, cloud.labels);

    let heap = whole.windows(4).position(|bytes| bytes == b"GCOL").unwrap();
    let started = Instant::now();
    let mut refused = 0;
    for at in (heap..heap + 600).step_by(4) {
        for value in [0u64, 1, 8, 4096, u64::MAX, u64::MAX / 2, 1 << 32] {
            let mut bytes = whole.clone();
            bytes[at..at + 8].copy_from_slice(&value.to_le_bytes());
            fs::write(&path, bytes).unwrap();
            refused += u32::from(PointCloud::read(&path).is_err());
        }
    }
    assert!(refused > 50 && started.elapsed() < Duration::from_secs(20), "{refused} {:?}", started.elapsed());
}

/// Children that are started meanwhile hold nothing of ours, so that nothing is in use.
#[test]
fn hdf5_is_written_and_read_while_processes_start() {
    let folder = tempfile::tempdir().unwrap();
    let done = AtomicBool::new(false);
    let cloud = cloud(50, FieldSet::default());
    std::thread::scope(|scope| {
        let starting = scope.spawn(|| {
            let mut children = Vec::new();
            let started = Instant::now();
            while !done.load(Ordering::Relaxed) && started.elapsed() < Duration::from_secs(60) {
                let child = Command::new("sleep").arg("0.3").spawn().unwrap();
                children.push(child);
                if children.len() > 40 {
                    children.remove(0).wait().unwrap();
                }
            }
            children.into_iter().map(|mut child| child.wait().unwrap()).count()
        });
        for number in 0..60 {
            let path = folder.path().join(format!("{}.h5", number % 3));
            cloud.write(&path).unwrap();
            assert_eq!(PointCloud::read(&path).unwrap().len, 50, "{number}");
        }
        let mut frames = FramesFile::create(folder.path().join("frames.h5")).unwrap();
        frames.add(&cloud).unwrap();
        #[cfg(target_os = "linux")]
        {
            let mut child = Command::new("sleep").arg("0.2").spawn().unwrap();
            let held = fs::read_dir(format!("/proc/{}/fd", child.id())).unwrap();
            let held = held.filter_map(|entry| fs::read_link(entry.unwrap().path()).ok());
            assert_eq!(held.filter(|file| file.starts_with(folder.path())).count(), 0);
            child.wait().unwrap();
        }
        frames.finish().unwrap();
        done.store(true, Ordering::Relaxed);
        assert!(starting.join().unwrap() > 0);
    });
}

#[test]
fn records_of_bags_take_no_more_than_their_bytes_can_hold() {
    for name in ["zero_records.mcap", "zero_records_2gb.mcap", "text_length.mcap"] {
        let started = Instant::now();
        let error = PointCloud::read(data(name)).unwrap_err().to_string();
        assert!(error.contains(name) && error.len() < 300, "{name}: {error}");
        assert!(started.elapsed() < Duration::from_secs(3), "{name}: {:?}", started.elapsed());
    }
}

#[test]
fn points_of_a_bag_without_a_pose_lie_around_their_origin() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let mut cloud = cloud(20, FieldSet::parse("x,y,z").unwrap());
    cloud.sensor_pose = Pose::IDENTITY;
    cloud.write(&path).unwrap();
    let found = read(&path).0;
    assert_eq!((found.origin, found.sensor_pose), (cloud.origin, Pose::IDENTITY));
    // As they are in the cloud.
    assert!((0..20).all(|row| found.position(row).distance(cloud.position(row)) < 1e-8));
}
