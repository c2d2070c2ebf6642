//! Files of trajectories other than plain text.

use super::*;
use ground::crs::Crs;
use std::f64::consts::{FRAC_PI_2, PI};
use std::fs;
use std::path::PathBuf;

/// A folder for files, which goes with it.
struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Folder {
        Folder(tempfile::tempdir().unwrap())
    }

    fn write(&self, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
        let path = self.0.path().join(name);
        fs::write(&path, bytes).unwrap();
        path
    }
}

/// A record: time, latitude, longitude, height, roll, pitch, platform heading, wander.
fn record([time, latitude, longitude, height, roll, pitch, heading, wander]: [f64; 8]) -> Vec<u8> {
    let head = [time, latitude, longitude, height, 0.0, 0.0, 0.0, roll, pitch, heading, wander];
    head.into_iter().chain([0.0; 6]).flat_map(f64::to_le_bytes).collect()
}

/// A record over the central meridian of zone 32, heading north.
fn at(time: f64) -> Vec<u8> {
    record([time, 0.85, 9f64.to_radians(), 500.0, 0.0, 0.0, 0.0, 0.0])
}

fn load(path: &Path, crs: Option<&str>) -> (Result<Trajectory>, Vec<String>) {
    let mut report = Report::default();
    let options = TrajectoryOptions::default().crs(crs.map(|crs| Crs::parse(crs).unwrap()));
    let read = Trajectory::load_with(path, &options, &mut report);
    (read, report.warnings)
}

#[test]
fn sbet_is_placed_in_the_grid_with_its_true_heading() {
    let folder = Folder::new();
    // East of the central meridian, grid north is to the right of true north.
    let place = record([10.0, 0.85, 11f64.to_radians(), 500.0, 0.1, 0.05, 1.7, 0.2]);
    let file = folder.write("flight.sbet", [place, at(11.0)].concat());
    let (read, warnings) = load(&file, None);
    let read = read.unwrap();
    assert_eq!(warnings.len(), 1);
    assert!(warnings[0].contains("WGS 84 / UTM zone 32N (EPSG:32632)"), "{warnings:?}");
    let grid = Crs::parse("EPSG:32632").unwrap().projection().unwrap().forward(0.85, 11f64.to_radians());
    let pose = read.at(10.0);
    assert!((pose.position - DVec3::new(grid.easting, grid.northing, 500.0)).length() < 1e-9);
    let expected = navigated([0.1, 0.05, 1.5 - grid.convergence]);
    assert!(pose.orientation.angle_between(expected) < 1e-7 && grid.convergence > 0.02);
    let other = read.at(11.0);
    assert!((other.orientation * DVec3::X - DVec3::Y).length() < 1e-12 && (other.position.x - 5e5).abs() < 1e-8);
    // The same with another ending, as what is not text.
    let (plain, _) = load(&folder.write("flight.bin", fs::read(&file).unwrap()), Some("EPSG:32632"));
    assert_eq!(plain.unwrap(), read);
    // An offset is subtracted.
    let options =
        TrajectoryOptions::default().crs(Crs::parse("EPSG:32632").unwrap()).offset(DVec3::new(5e5, 5e6, 400.0));
    let near = Trajectory::load_with(&file, &options, &mut Report::default()).unwrap();
    assert!((near.at(11.0).position - (other.position - DVec3::new(5e5, 5e6, 400.0))).length() < 1e-9);
    assert_eq!(near.georeference().unwrap().offset(), DVec3::new(5e5, 5e6, 400.0));
}

#[test]
fn sbet_is_read_back_as_it_was_written() {
    let folder = Folder::new();
    let place = TrajectoryOptions::default().crs(Crs::parse("EPSG:25833").unwrap()).offset(DVec3::new(4e5, 5.5e6, 0.0));
    let pose = |step: f64| {
        let orientation = navigated([0.02 * step, 0.3 - 0.01 * step, 2.0 + 0.1 * step]);
        Pose { position: DVec3::new(60.0 * step, -20.0 * step, 800.0 + 0.5 * step * step), orientation }
    };
    let keys: Vec<_> = (0..50).map(|step| (f64::from(step) * 0.5, pose(f64::from(step) * 0.5))).collect();
    let mut flight = Trajectory::new(keys.clone()).unwrap().on_earth(&place).unwrap();
    flight.time_zero = 345_600.25;
    let file = folder.0.path().join("flight.sbet");
    flight.save(&file).unwrap();
    let bytes = fs::read(&file).unwrap();
    assert_eq!(bytes.len(), 136 * 50);
    let number = |record: usize, index: usize| {
        let at = 136 * record + 8 * index;
        f64::from_le_bytes(bytes[at..at + 8].try_into().unwrap())
    };
    assert_eq!(number(3, 0), 345_601.75);
    // Speed over ground, without the scale of the grid; down; rates and accelerations about the body's axes.
    let grid = georeference_scale(&flight, 20);
    let speed = number(20, 4).hypot(number(20, 5));
    assert!((speed * grid - 4000f64.sqrt()).abs() < 1e-9, "{speed}");
    assert!((number(20, 6) + 10.0).abs() < 1e-9, "{}", number(20, 6));
    let acceleration = DVec3::new(number(20, 11), -number(20, 12), -number(20, 13));
    assert!((flight.keys[20].1.orientation * acceleration - DVec3::Z).length() < 1e-7);
    assert!(number(20, 10) == 0.0 && (number(20, 16) - 0.1 * 0.3f64.cos()).abs() < 0.02);
    let options =
        TrajectoryOptions::default().crs(Crs::parse("EPSG:25833").unwrap()).offset(DVec3::new(4e5, 5.5e6, 0.0));
    let read = Trajectory::load_with(&file, &options, &mut Report::default()).unwrap().shifted_to_zero();
    assert_eq!(read.time_zero(), 345_600.25);
    for ((time, pose), (read_time, read)) in keys.iter().zip(read.keys()) {
        assert_eq!(time, read_time);
        assert!((pose.position - read.position).length() < 2e-8, "{pose:?} {read:?}");
        assert!((pose.orientation.dot(read.orientation).abs() - 1.0).abs() < 1e-15);
    }
}

/// Scale of the grid at a key.
fn georeference_scale(of: &Trajectory, key: usize) -> f64 {
    let georeference = of.georeference().unwrap();
    let projection = georeference.projection().unwrap();
    georeference.place(&projection, &of.keys[key].1).1[1]
}

#[test]
fn text_is_read_back_as_it_was_written() {
    let folder = Folder::new();
    let pose = |x: f64| Pose { orientation: navigated([0.1, -0.2, x]), ..Pose::at(x, 2.0, 3.0) };
    let local = Trajectory::new(vec![(0.5, pose(1.0)), (1.5, pose(4.0))]).unwrap();
    for name in ["flight.csv", "flight.txt"] {
        let file = folder.0.path().join(name);
        local.save(&file).unwrap();
        assert_eq!(Trajectory::load(&file).unwrap(), local, "{name}");
    }
    let crs = Crs::parse("EPSG:32632").unwrap();
    let offset = DVec3::new(4e5, 5e6, 100.0);
    let file = folder.0.path().join("grid.csv");
    let place = TrajectoryOptions::default().crs(crs.clone()).offset(offset);
    local.clone().on_earth(&place).unwrap().save(&file).unwrap();
    let text = fs::read_to_string(&file).unwrap();
    assert!(text.starts_with("time_s,easting,northing,height,roll_deg,pitch_deg,heading_deg\n0.5,400001,5000002,103,"));
    let options = TrajectoryOptions::default().crs(crs).offset(offset);
    let read = Trajectory::load_with(&file, &options, &mut Report::default()).unwrap();
    for ((_, a), (_, b)) in local.keys().iter().zip(read.keys()) {
        assert!((a.position - b.position).length() < 1e-9 && a.orientation.angle_between(b.orientation) < 1e-7);
    }
    // Coordinates of the world have no offset.
    let plain = Trajectory::load_with(folder.0.path().join("flight.csv"), &options, &mut Report::default()).unwrap();
    assert_eq!(plain.keys(), local.keys());
    let message = local.save(folder.0.path().join("a.sbet")).unwrap_err().to_string();
    assert!(message.contains("one with a coordinate system"), "{message}");
    let message = local.save(folder.0.path().join("a.las")).unwrap_err().to_string();
    assert!(message.contains("\"a.las\"; allowed: a name ending in .sbet, .out, .csv or .txt"), "{message}");
}

#[test]
fn columns_are_found_by_name() {
    let folder = Folder::new();
    let grid = "heading_deg,pitch_deg,roll_deg,height,northing,easting,gps_time\n90,10,5,120,5400000,600000,7\n";
    let read = Trajectory::load(folder.write("grid.csv", grid)).unwrap();
    let pose = read.at(7.0);
    assert_eq!(pose.position, DVec3::new(6e5, 5.4e6, 120.0));
    assert_eq!(pose.orientation, Pose::IDENTITY.with_rpy_deg(5.0, -10.0, 0.0).orientation);
    let degrees = "t,lat,lon,height,roll_deg,pitch_deg,heading_deg\n0,48.7,9,500,0,0,0\n1,48.701,9,500,0,0,0\n";
    let (read, warnings) = load(&folder.write("degrees.csv", degrees), None);
    let read = read.unwrap();
    assert_eq!(warnings.len(), 1);
    // A minute of latitude is a nautical mile there.
    let way = read.at(1.0).position - read.at(0.0).position;
    assert!(way.x.abs() < 1e-6 && (way.y - 1852.0 * 0.06).abs() < 0.15, "{way}");
    for (text, expected) in [
        (
            "t,lat,lon,height,roll_deg,pitch_deg,yaw_deg\n0,48.7,9,500,0,0,0\n",
            "line 2: has lat and lon without heading_deg",
        ),
        ("t,lat,height,roll_deg,pitch_deg,heading_deg\n", "line 1: the column lon beside lat is missing"),
        ("t,easting,northing,roll_deg,pitch_deg,heading_deg\n", "line 1: the column height beside easting is missing"),
        ("t,lat,lon,height,roll_deg,pitch_deg,heading_deg\n0,98.7,9,500,0,0,0\n", "allowed: -80 to 84 degrees"),
    ] {
        let message = Trajectory::load(folder.write("wrong.csv", text)).unwrap_err().to_string();
        assert!(message.contains(expected), "{message}");
    }
}

/// Its platforms look along y, the angles are those of ARINC 705.
#[test]
fn trajectories_of_helios_are_turned_into_our_axes() {
    let folder = Folder::new();
    let header = "#TIME_COLUMN: 0\n#HEADER: \"t\", \"roll\", \"pitch\", \"yaw\", \"x\", \"y\", \"z\"\n";
    let rows = "0, 0, 0, 0, 0, -40, 7\n2.5, 30, 0, 0, 0, 0, 0\n5, 0, 30, 90, 1, 2, 3\n";
    let read = Trajectory::load(folder.write("a.trj", format!("{header}{rows}"))).unwrap();
    let [ahead, starboard, up] = [DVec3::X, DVec3::NEG_Y, DVec3::Z];
    let turned = |time: f64, axis: DVec3| read.at(time).orientation * axis;
    assert!((turned(0.0, ahead) - DVec3::Y).length() < 1e-12 && (turned(0.0, up) - DVec3::Z).length() < 1e-12);
    assert!((turned(2.5, starboard) - DVec3::new(0.75f64.sqrt(), 0.0, -0.5)).length() < 1e-12);
    assert!((turned(5.0, ahead) - DVec3::new(0.75f64.sqrt(), 0.0, 0.5)).length() < 1e-12);
    assert_eq!(read.at(0.0).position, DVec3::new(0.0, -40.0, 7.0));
    // Another order, and none.
    let other = "#HEADER: \"x\",\"y\",\"z\",\"t\",\"roll\",\"pitch\",\"yaw\"\n0 -40 7 0 0 0 0\n0;0;0;2.5;30;0;0\n1,2,3,5,0,30,90\n";
    assert_eq!(Trajectory::load(folder.write("b.trj", other)).unwrap(), read);
    assert_eq!(Trajectory::load(folder.write("c.trj", rows)).unwrap(), read);
    for (text, expected) in [
        ("#HEADER: \"t\",\"x\"\n0,1\n", "line 1: the column roll is missing"),
        ("0,0,0,0,0,0\n", "line 1: has 6 numbers; expected 7: t, roll, pitch, yaw, x, y, z"),
        ("0,0,0,0,0,0,nan\n", "line 1: \"nan\" is not a finite number"),
        ("1,0,0,0,0,0,0\n1,0,0,0,0,0,0\n", "line 2: time 1 s after 1 s"),
        ("#\n", "has no poses; expected lines of t, roll"),
    ] {
        let message = Trajectory::load(folder.write("d.trj", text)).unwrap_err().to_string();
        assert!(message.contains(expected), "{message}");
    }
}

#[test]
fn a_week_that_ends_goes_on() {
    let folder = Folder::new();
    let times = [604_799.5, 604_799.75, 0.0, 0.25];
    let (read, warnings) = load(&folder.write("a.out", times.map(at).concat()), Some("EPSG:32632"));
    assert_eq!(read.unwrap().span(), (604_799.5, 604_800.25));
    assert_eq!(warnings.len(), 1);
    assert!(warnings[0].contains("record 3: time goes back from 604799.75 s to 0 s"), "{warnings:?}");
    // Neither the end of a week nor rising.
    for times in [[100.0, 99.0, 101.0, 102.0], [300_000.0, 1.0, 2.0, 3.0], [1.0, 1.0, 2.0, 3.0]] {
        let (read, _) = load(&folder.write("b.sbet", times.map(at).concat()), None);
        let message = read.unwrap_err().to_string();
        assert!(message.contains("b.sbet: record 2: time ") && message.contains("times must rise"), "{message}");
    }
}

#[test]
fn wrong_files_are_refused_in_a_sentence() {
    let folder = Folder::new();
    let message = |bytes: &[u8], crs| load(&folder.write("a.sbet", bytes), crs).0.unwrap_err().to_string();
    assert!(message(b"", None).contains("a.sbet: is empty; expected records of 136 bytes"));
    assert!(message(&[0; 137], None).contains("a.sbet: has 137 bytes; expected a multiple of 136"));
    assert!(message(&at(f64::NAN), None).contains("a.sbet: record 1: a number that is not finite"));
    let with = |place| [at(0.0), record(place)].concat();
    let cases = [
        ([1.0, f64::NAN, 0.15, 0.0, 0.0, 0.0, 0.0, 0.0], "record 2: latitude is NaN; allowed: finite numbers"),
        ([1.0, 49.4, 0.15, 0.0, 0.0, 0.0, 0.0, 0.0], "record 2: latitude is 49.4 rad; allowed: -1.5708 to 1.5708"),
        ([1.0, 0.8, 0.15, f64::INFINITY, 0.0, 0.0, 0.0, 0.0], "record 2: height is inf"),
        ([1.0, 0.8, -PI, 0.0, 0.0, 0.0, 0.0, 0.0], "record 2: longitude -180 degrees is more than 30 degrees"),
        ([1.0, 0.8, 0.15, 0.0, 0.0, FRAC_PI_2, 0.0, f64::NAN], "record 2: heading is NaN"),
    ];
    for (place, expected) in cases {
        let found = message(&with(place), None);
        assert!(found.contains(expected), "{found}");
    }
    assert!(message(&at(0.0), Some("local")).contains("which has no projection that is known here"));
    let pole = record([0.0, 1.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    assert!(message(&pole, None).contains("record 1: latitude is 85.9"), "{}", message(&pole, None));
}

/// Whatever is in it, a file is read or refused; what is read is sound.
#[test]
fn any_bytes_are_read_or_refused() {
    let folder = Folder::new();
    let mut state = 1u64;
    let mut next = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        state
    };
    let good: Vec<u8> = (0..6).flat_map(|second| at(f64::from(second))).collect();
    let text = b"0, 0, 0, 0, 0, -40, 7\n2.5, 30, 0, 0, 0, 0, 0\n".repeat(3);
    let mut kept = 0;
    for round in 0..3000 {
        let ending = ["sbet", "out", "bin", "trj"][round % 4];
        let mut bytes = if ending == "trj" { text.clone() } else { good.clone() };
        for _ in 0..next() % 4 {
            let at = next() as usize % bytes.len();
            match next() % 4 {
                0 => bytes[at] = next() as u8,
                1 => bytes.truncate(at.max(1)),
                2 => bytes[at] ^= 1 << (next() % 8),
                _ => bytes.extend_from_within(at..),
            }
        }
        let file = folder.write(&format!("a.{ending}"), bytes);
        if let Ok(read) = Trajectory::load(&file) {
            kept += 1;
            let (start, end) = read.span();
            assert!(start <= end && read.at(0.5 * (start + end)).orientation.is_normalized());
        }
    }
    assert!(kept > 300, "{kept}");
}

#[test]
fn accuracies_are_read_back_and_checked() {
    let folder = Folder::new();
    let record = |time: f64| Accuracy {
        time,
        position_m: [0.02, 0.021, 0.03],
        velocity_m_s: [0.003, 0.004, 0.005],
        attitude_arcmin: [0.15, 0.16, 0.4],
    };
    let records = [record(1.0), record(2.0)];
    let file = folder.0.path().join("smrmsg_flight.out");
    Accuracy::save(&records, &file).unwrap();
    let bytes = fs::read(&file).unwrap();
    assert_eq!(bytes.len(), 160);
    assert_eq!(bytes[80 + 72..80 + 80], 0.4f64.to_le_bytes());
    assert_eq!(Accuracy::load(&file).unwrap(), records);
    let message = |bytes: &[u8]| Accuracy::load(folder.write("a.out", bytes)).unwrap_err().to_string();
    assert!(message(&bytes[..81]).contains("has 81 bytes; expected a multiple of 80"));
    assert!(message(&[&bytes[80..], &bytes[..80]].concat()).contains("record 2: time 1 s after 2 s"));
    let negative: Vec<u8> = [1.0f64, -0.1].into_iter().chain([0.0; 8]).flat_map(f64::to_le_bytes).collect();
    assert!(message(&negative).contains("record 1: holds a number that is not finite or a negative deviation"));
}
