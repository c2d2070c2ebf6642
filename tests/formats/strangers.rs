//! Clouds as strangers write them: text with all kinds of headers or none, PLY with lists, coordinate systems and records
//! of surveying, damaged heaps of HDF5, bombs.

use super::{cloud, read::read, said};
use echocast::cloud::{Record, Records};
use echocast::export::{self, FORMATS, FramesFile, GrowingFile};
use echocast::import::{self, ReadOptions};
use echocast::{Field, FieldSet, Frame, PointCloud, Pose, Report};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

const PLACES: [[f64; 3]; 2] = [[1.5, 2.5, 3.5], [4.5, 5.5, 6.5]];

fn positions(cloud: &PointCloud) -> Vec<[f64; 3]> {
    (0..cloud.len()).map(|row| cloud.position(row).to_array()).collect()
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
        ("\"Name\",\"X\",\"Y\",\"Z\"\n\"a, b\",1.5,2.5,3.5\n\"c\",\"4.5\",5.5,6.5\n", "", "cannot hold Name"),
        ("X (m),Y (m),Z (cm),note,\n1.5,2.5,350,stone,\n4.5,5.5,650,,\n", "", "cannot hold note"),
        ("Easting;Northing;Height\n1.5;2.5;3.5\n4.5;5.5;6.5\n", "", ""),
        // CloudCompare, with the number of points and without it; scalar fields with blanks in their names.
        (
            "//X;Y;Z;Rf;Gf;Bf;Intensity;Illuminance (PCV);Nx;Ny;Nz\n2\n1.5;2.5;3.5;1;0.2;0;0.5;0.9;0;0;1\n\
             4.5;5.5;6.5;0;0;1;0.25;0.9;1;0;0\n",
            "red,green,blue,intensity,normal_x,normal_y,normal_z",
            "cannot hold Illuminance (PCV)",
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
        ("X,Y,Z,Temperatur \u{b0}C\n1.5,2.5,3.5,20\n4.5,5.5,6.5,21\n", "", "cannot hold Temperatur"),
        // Titles, units and two lines of names above the rows; other signs of comments.
        ("Survey of Monday, 12 May\nX;Y;Z\n1.5;2.5;3.5\n4.5;5.5;6.5\n", "", ""),
        ("Scan 12 03 2024\n1.5 2.5 3.5\n4.5 5.5 6.5\n", "", "no header"),
        ("x,y,z\nm,m,m\n1.5,2.5,3.5\n4.5,5.5,6.5\n", "", ""),
        ("x\ty\tz\n[m]\t[mm]\t[cm]\n1.5\t2500\t350\n4.5\t5500\t650\n", "", ""),
        ("position,,,\nx,y,z,intensity\nm,m,m,-\n1.5,2.5,3.5,7\n4.5,5.5,6.5,8\n", "intensity", ""),
        ("% made by hand\n% X Y Z\n1.5 2.5 3.5\n4.5 5.5 6.5\n", "", ""),
        ("X [m]  Y [m]  Z [m]\n1.5 2.5 3.5\n4.5 5.5 6.5\n", "", ""),
        ("X[m];Y (meters);Z (Meter)\n1.5;2.5;3.5\n4.5;5.5;6.5\n", "", ""),
        ("POINT_X,POINT_Y,POINT_Z\n1.5,2.5,3.5\n4.5,5.5,6.5\n", "", ""),
        ("Points_0,Points_1,Points_2\n1.5,2.5,3.5\n4.5,5.5,6.5\n", "", ""),
        ("\"Points:0\",\"Points:1\",\"Points:2\"\n1.5,2.5,3.5\n4.5,5.5,6.5\n", "", ""),
        // Names of points, with a header and without.
        ("Name X Y Z\nP1 1.5 2.5 3.5\nP2 4.5 5.5 6.5\n", "", "cannot hold Name"),
        ("P1,1.5,2.5,3.5\nP2,4.5,5.5,6.5\n", "", "taken as x,y,z, and 1 more are left out"),
        ("P1 tree 1.5 2.5 3.5 7\n22 wall 4.5 5.5 6.5 8\n", "intensity", "taken as x,y,z,intensity, and 2 more"),
        // Blanks and tabs, several of them; blanks before commas.
        ("x y\tz\n1.5 2.5\t3.5\n4.5\t\t5.5 6.5\n", "", ""),
        ("x\ty\tz\n1.5\t2.5\t3.5\n4.5 5.5\t6.5\n4.5\t\t5.5\t6.5\n", "", ""),
        ("1.5\t\t2.5\t\t3.5\n4.5\t\t5.5\t\t6.5\n", "", "no header"),
        ("1.5 ,2.5 ,3.5\n4.5 ,5.5 ,6.5\n", "", "no header"),
        ("1.5 , 2.5 , 3.5\n4.5 , 5.5 , 6.5\n", "", "no header"),
        // A separator at the end.
        ("X;Y;Z;\n1,5;2,5;3,5;\n4,5;5,5;6,5;\n", "", "decimal points"),
        ("1.5;2.5;3.5;\n4.5;5.5;6.5;\n", "", "no header"),
        ("1.5,2.5,3.5,\n4.5,5.5,6.5,\n", "", "taken as x,y,z;"),
        // What other languages write for numbers.
        ("x,y,z,range\n1.5,25D-1,3.5,-nan(ind)\n4.5,5.5,6.5,1.#QNAN\n", "range", ""),
    ] {
        fs::write(&path, text).unwrap();
        let (cloud, report) = read(&path);
        // One has a line more than the others.
        let cloud = cloud.select(&[0, 1]).unwrap();
        for (found, wanted) in positions(&cloud).iter().flatten().zip(PLACES.as_flattened()) {
            assert!((found - wanted).abs() < 1e-6, "{text:?}: {:?}", positions(&cloud));
        }
        let wanted = FieldSet::parse(format!("x,y,z,{columns}").replace(",,", ",").trim_end_matches(',')).unwrap();
        assert_eq!((cloud.fields(), cloud.len()), (wanted, 2), "{text:?}");
        assert_eq!(report.warnings.is_empty(), told.is_empty(), "{text:?}: {report:?}");
        assert!(told.is_empty() || said(&report, told), "{text:?}: {report:?}");
    }
    let rows = |text: &[u8]| {
        fs::write(&path, text).unwrap();
        read(&path).0
    };
    let found = rows(b"2\n1.5 2.5 3.5 -2048 255 0 9\n4.5 5.5 6.5 2047 1 2 3\n");
    assert_eq!((found.columns().intensity(), found.intensity_full_scale), (&[-2048.0, 2047.0][..], None));
    assert_eq!((found.columns().red(), found.columns().blue()), (&[255, 1][..], &[9, 3][..]));
    let found = rows(b"//X Y Z Rf Gf Bf\n1 2 3 1 0.2 0\n4 5 6 0 0 1\n");
    assert_eq!((found.columns().red(), found.columns().green()), (&[255, 0][..], &[51, 0][..]));
    let found = rows(b"10 ,20 ,30\n");
    assert_eq!(positions(&found), [[10.0, 20.0, 30.0]]);
    // Whether colours are of 16 bits, all rows say; NaN does not.
    let dark = "1 2 3 7 0 9\n".repeat(5000);
    let found = rows(format!("{dark}1 2 3 65535 257 0\n").as_bytes());
    assert_eq!((found.columns().red()[5000], found.columns().green()[5000], found.columns().red()[0]), (255, 1, 0));
    let found = rows(b"x,y,z,red,green,blue\n1,2,3,1,0,nan\n1,2,3,0,1,1\n");
    assert_eq!((found.columns().red(), found.columns().blue()), (&[1, 0][..], &[0, 1][..]));
    // Longer comments than what is looked at to know the format.
    let long = format!("{}x y z\n1 2 3\n", "# anything at all\n".repeat(3000));
    assert_eq!(positions(&rows(long.as_bytes())), [[1.0, 2.0, 3.0]]);
    // A single column has no counts.
    assert_eq!(rows(b"range\n5\n7\n").columns().range(), [5.0, 7.0]);
    // Names in an older alphabet.
    assert_eq!(rows(b"X,Y,Z,H\xf6he\n1,2,3,4\n").len(), 1);

    let error = |text: &[u8]| {
        fs::write(&path, text).unwrap();
        PointCloud::read(&path).unwrap_err().to_string()
    };
    assert!(error(b"\xff\xfex\0,\0y\0,\0z\0\n\0").contains("UTF-16"));
    assert!(error(b"lon,lat,alt\n1,2,3\n").contains("has none of the columns of a cloud"));
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
        import::read_with(&path, &ReadOptions::default().columns(columns), &mut report).map(|cloud| (cloud, report))
    };
    let (found, report) = named("# no header\n2\n7 1.5 2.5 3.5 0.5 9\n8 4.5 5.5 6.5 0.25 9\n", "_,x,y,Z,i").unwrap();
    assert_eq!((positions(&found), found.columns().intensity()), (PLACES.to_vec(), &[0.5, 0.25][..]));
    assert!(report.warnings.is_empty(), "{report:?}");
    // Instead of a header, whatever it says.
    let (found, _) = named("a;b;c\n1.5;2.5;3.5\n4.5;5.5;6.5\n", "x,y,z").unwrap();
    assert_eq!(positions(&found), PLACES);
    let error = |text: &str, columns: &str| named(text, columns).unwrap_err().to_string();
    let (found, _) = named("5\n7\n9\n", "range").unwrap();
    assert_eq!(found.columns().range(), [5.0, 7.0, 9.0]);
    let (found, _) = named("Scan of 3 rooms\nP1;1,5;2,5;3,5\nP2;4,5;5,5;6,5\n", "_,x,y,z").unwrap();
    assert_eq!(positions(&found), PLACES);
    let ptx = "1\n1\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n1 2 3 0.5\n";
    assert!(named(ptx, "x,y,z,intensity").unwrap_err().to_string().contains("is a PTX file"));
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
            (positions(&found), found.columns().intensity()),
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
        cloud.records = Arc::new(Records::default().all(all).standard_time(true));
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
                    assert_eq!(said(&report, "LAS 1.2 has no coordinate systems as text"), text, "{report:?}");
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
    let of = |user: &str, id| Record { user: user.into(), id, description: String::new(), data: vec![0; 160] };
    let tools = [10, 20, 30].map(|id| of("LAStools", id));
    with([vec![of("copc", 1)], tools.to_vec(), vec![own.clone()]].concat()).write(&path).unwrap();
    let (found, report) = read(&path);
    let told = "cannot hold copc 1, LAStools 10, LAStools 20, LAStools 30";
    assert!(said(&report, told) && found.records.all == [own], "{report:?}");
    // What no reader of XML would take is told, and the others read the file.
    let path = folder.path().join("a.e57");
    for name in ["a\u{1}b", "a\u{ffff}", "a]]>b"] {
        let report = export::write(&with(vec![wkt(name)]), &path, None).unwrap();
        assert!(said(&report, "coordinate system") && read(&path).0.len() == 100, "{name:?} {report:?}");
    }
}

/// Nanoseconds of 32 bits.
#[test]
fn times_that_a_driver_cannot_say_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let mut cloud = cloud(20, FieldSet::parse("default,time").unwrap());
    for (seconds, late) in [(4.29, false), (4.3, true)] {
        cloud.columns_mut().time[7] = cloud.begins() + seconds;
        for format in FORMATS.iter().filter(|format| format.name().starts_with("mcap")) {
            let report = export::write(&cloud, &path, Some(format.name())).unwrap();
            let counts = matches!(format.name(), "mcap_ouster" | "mcap_autoware");
            assert_eq!(said(&report, "4.29 s"), late && counts, "{} {report:?}", format.name());
        }
    }
}

/// Points that were not measured, before the others.
#[test]
fn empty_rows_before_far_ones_cost_no_precision() {
    let folder = tempfile::tempdir().unwrap();
    let rows = "0 0 0\n500000.1234 5600000.5678 100.25\n500001.1234 5600001.5678 100.75\n";
    let header = "ply\nformat ascii 1.0\nelement vertex 3\nproperty double x\nproperty double y\nproperty double z\nend_header\n";
    for (name, text) in [
        ("a.csv", format!("x,y,z\n{}", rows.replace(' ', ","))),
        ("a.xyz", rows.to_owned()),
        ("a.ply", format!("{header}{rows}")),
    ] {
        let path = folder.path().join(name);
        fs::write(&path, text).unwrap();
        let (found, report) = read(&path);
        assert_eq!(found.position(0).to_array(), [0.0; 3], "{name}");
        assert!(
            (found.position(1) - glam::DVec3::new(500_000.123_4, 5_600_000.567_8, 100.25)).length() < 1e-4,
            "{name}"
        );
        assert!(!said(&report, "precision"), "{name} {report:?}");
        // Rows far from each other cannot all be precise.
        let far = fs::read_to_string(&path).unwrap().replace("500001.1234", "519999.1234");
        fs::write(&path, far).unwrap();
        assert!(said(&read(&path).1, "precision"), "{name}");
    }
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
    wide.columns_mut().x.iter_mut().enumerate().for_each(|(row, x)| *x = (row as f32 - 100.0) * 30.0);
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
                if !found.fields().contains(field) {
                    assert!(!format.holds(field.info()), "{}", format.name());
                    continue;
                }
                let value = |cloud: &PointCloud, row| cloud.column(field).get_f64(row) + cloud.origin[axis];
                for row in 0..cloud.len() {
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
    assert_eq!(cloud.labels.category.names(), ["M\u{fffd}", "frame", "glass", "wall"]);
    assert_eq!(cloud.labels.material.names(), ["glass", "plaster", "wood"]);
    assert!(said(&report, "not UTF-8") && cloud.len() == 121 && cloud.frame == Frame::World, "{report:?}");
    // Written again, texts have a length, and no heap is needed.
    cloud.write(&path).unwrap();
    assert!(!fs::read(&path).unwrap().windows(4).any(|bytes| bytes == b"GCOL"));
    assert_eq!(read(&path).0.labels, cloud.labels);

    let heap = whole.windows(4).position(|bytes| bytes == b"GCOL").unwrap();
    let names = |cloud: &PointCloud| {
        let labels = &cloud.labels;
        let all =
            [&labels.category, &labels.material, &labels.part, &labels.instance].map(|table| table.names().join("\n"));
        all.join("\n").chars().collect::<Vec<char>>()
    };
    let sound = names(&cloud);
    let started = Instant::now();
    let mut refused = 0;
    for at in (heap..heap + 600).step_by(4) {
        for value in [0u64, 1, 8, 4096, u64::MAX, u64::MAX / 2, 1 << 32] {
            let mut bytes = whole.clone();
            bytes[at..at + 8].copy_from_slice(&value.to_le_bytes());
            fs::write(&path, bytes).unwrap();
            let Ok(found) = PointCloud::read(&path) else {
                refused += 1;
                continue;
            };
            // Bytes that were changed may be those of texts; no text has those of another.
            let found = names(&found);
            let off = found.iter().zip(&sound).filter(|(a, b)| a != b).count();
            assert!(found.len() == sound.len() && off <= 8, "{at} {value}: {found:?}");
        }
    }
    assert!(refused > 50 && started.elapsed() < Duration::from_secs(20), "{refused} {:?}", started.elapsed());
}

/// This test program once more, with `test` alone, in so many kilobytes of memory at most; HDF5 is asked for another
/// driver.
fn in_memory_of(kilobytes: u32, test: &str) {
    let status = Command::new("sh")
        .args(["-c", &format!("ulimit -v {kilobytes} && exec \"$0\" --exact strangers::{test} --test-threads 1")])
        .arg(std::env::current_exe().unwrap())
        .env("ECHOCAST_TEST_CHILD", "1")
        .env("HDF5_DRIVER", "core")
        .output()
        .unwrap();
    let said = [&status.stdout, &status.stderr].map(|bytes| String::from_utf8_lossy(bytes).into_owned()).concat();
    assert!(status.status.success() && said.contains("1 passed"), "{test}: {said}");
}

/// Whether this is the child of [`in_memory_of`].
fn is_child() -> bool {
    std::env::var_os("ECHOCAST_TEST_CHILD").is_some()
}

#[test]
fn hdf5_of_strangers_is_refused_in_words_and_little_memory() {
    if !is_child() {
        return in_memory_of(1 << 20, "hdf5_of_strangers_is_refused_in_words_and_little_memory");
    }
    for (name, told) in [
        ("two_axes.h5", "category_names: has texts of shape [1024, 1024]; allowed: one after the other"),
        ("large_chunk.h5", "category_names: has chunks of 33554432 bytes; allowed: 16777216"),
        (
            "filter_name.h5",
            "required filter '\u{fffd}\u{fffd}\u{fffd}\u{fffd}\u{fffd}\u{fffd}\u{fffd}' is not registered",
        ),
        ("enum_name.h5", "x: is of an enumeration; allowed: numbers"),
        ("compound_name.h5", "category_names: is of compounds; allowed: texts"),
        ("compact_texts.h5", "category_names: has texts of variable length in compact storage"),
    ] {
        let started = Instant::now();
        let error = PointCloud::read(data(name)).unwrap_err().to_string();
        assert!(error.contains(told) && error.len() < 400, "{error}");
        assert!(started.elapsed() < Duration::from_secs(3), "{name}: {:?}", started.elapsed());
    }
    let (found, report) = read(&data("link_name.h5"));
    assert!(found.len() == 3 && said(&report, "cannot hold \u{fffd}\u{fffd}\u{fffd}"), "{report:?}");
    // Behind a block of its user, which looks like text.
    let (found, _) = read(&data("user_block.h5"));
    assert_eq!((found.len(), found.labels.category.names()), (3, &["wall".to_owned(), "T\u{fc}r".into()][..]));
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
            assert_eq!(PointCloud::read(&path).unwrap().len(), 50, "{number}");
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
    if !is_child() {
        return in_memory_of(1 << 20, "records_of_bags_take_no_more_than_their_bytes_can_hold");
    }
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
