//! Files of sonar pings and of their images, read back by third-party readers.

use echocast::generate::Seabed;
use echocast::image::{self, ImageRange, Overlap};
use echocast::scene::Labels;
use echocast::units::amplitude_from_db;
use echocast::{
    Environment, Field, Layout, LoadOptions, Ping, Pings, Pose, ScanOptions, Sensor, SonarView, Sounding, Trajectory,
};
use echocast_tests::python;
use glam::{DQuat, DVec3, Vec3};
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

const BINS: usize = 40;

/// Three pings of a side-scan sonar that moves along x, with every kind of column.
fn pings() -> Pings {
    let layout = Arc::new(
        Layout::default()
            .view(SonarView::Sidescan)
            .axes([90f32, -90.0].map(|degrees| [degrees.to_radians(), -0.5]).to_vec())
            .bins(BINS)
            .bin_m(0.5)
            .first_bin(0)
            .believed_speed(1480.0)
            .frequency(450e3)
            .surface_z(0.25)
            .noise_db(31.5)
            .threshold_db(vec![40.0; BINS])
            .tvg_db((0..BINS).map(|bin| 0.5 * bin as f32).collect()),
    );
    let fields = [Field::Intensity, Field::CategoryId, Field::Red, Field::Time, Field::TrueX];
    let labels = Labels::default().category([(1, "seabed"), (70_000, "Fisch Ü")].into_iter().collect());
    let labels = Arc::new(labels);
    let cells = |number: usize, of: &dyn Fn(usize) -> f64| (0..2 * BINS).map(|cell| of(cell) + number as f64).collect();
    let ping = |number: usize| {
        let column: Vec<f64> = cells(number, &|cell| 60.0 + cell as f64 / 3.0);
        let mut ping = Ping::new(Arc::clone(&layout), fields.into_iter().collect()).unwrap();
        ping.number = 10 + number as u32;
        ping.time = 0.25 * number as f64;
        ping.pose = Pose::at(0.5 * number as f64, 2.0, -1.0).with_rpy_deg(1.0, 2.0, 0.0);
        ping.origin = DVec3::new(500_000.0, 0.0, -7.0);
        let cells = ping.cells_mut();
        for (cell, &value) in column.iter().enumerate() {
            cells.intensity[cell] = value as f32;
            cells.category_id[cell] = [0, 1, 70_000][cell % 3];
            cells.red[cell] = (cell + number) as u8;
            cells.time[cell] = value;
            cells.true_x[cell] = if value > 80.0 { value as f32 } else { f32::NAN };
        }
        let mut sounding = Sounding::default();
        (sounding.beam, sounding.range, sounding.cell) = (1, 7.25, 54);
        (sounding.level_db, sounding.quality) = (78.5, 0.75);
        sounding.corrected = Vec3::new(1.0, 2.0, -7.0);
        ping.set_soundings(vec![sounding; number]).unwrap();
        ping.labels = Arc::clone(&labels);
        ping
    };
    let mut pings = Pings::default();
    for number in 0..3 {
        pings.push(ping(number)).unwrap();
    }
    pings
}

/// Where the water of [`survey`] ends, m.
const SURFACE: f64 = 0.5;
/// Heading, pitch (nose up) and roll (to starboard) of its sonar, degrees.
const ANGLES: [f64; 3] = [60.0, 2.0, 3.0];

/// Five pings over a lake of a sonar with these sections of its file.
fn survey(sections: &str) -> Pings {
    let lake = Seabed::default().size_m([30.0, 30.0]).cell_m(0.5).scene(1).unwrap();
    let lake = lake.load(&LoadOptions::default()).unwrap().build().unwrap();
    let sonar = format!("name: survey\nkind: sonar\n{sections}");
    let sonar = Sensor::from_yaml(&sonar, ".").unwrap();
    let [heading, pitch, roll] = ANGLES;
    let at = |x: f64, y: f64, z: f64| Pose::at(x, y, z).with_rpy_deg(roll, -pitch, 90.0 - heading);
    let track = Trajectory::new(vec![(0.0, at(-4.0, -3.0, -2.0)), (1.0, at(4.0, 1.0, -2.5))]).unwrap();
    let environment = Environment::from_yaml(&format!("water: {{surface_z_m: {SURFACE}}}")).unwrap();
    let mut pings = Pings::default();
    for frame in 0..5 {
        let start_time = 0.2 * f64::from(frame);
        let options = ScanOptions::default().frame(frame).start_time(start_time).environment(environment.clone());
        pings.push(lake.ping(&sonar, &track, &options).unwrap()).unwrap();
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
    let all = pings.all();
    let cells = [3, 2, BINS];
    for found in &read(&files) {
        let levels = || all.iter().flat_map(|ping| ping.cells().intensity()).copied();
        compare(found, "level", "f4", &cells, levels().map(f64::from));
        compare(
            found,
            "amplitude",
            "f4",
            &cells,
            levels().map(|level| f64::from(amplitude_from_db(level.into()) as f32)),
        );
        let ids = all.iter().flat_map(|ping| ping.cells().category_id());
        compare(found, "category_id", "u4", &cells, ids.map(|&id| f64::from(id)));
        let red = all.iter().flat_map(|ping| ping.cells().red());
        compare(found, "red", "u1", &cells, red.map(|&red| f64::from(red)));
        compare(found, "time", "f8", &cells, all.iter().flat_map(|ping| ping.cells().time().to_vec()));
        let true_x = all.iter().flat_map(|ping| ping.cells().true_x());
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
        compare(found, "frequency_hz", "f8", &[], [450e3]);
        compare(found, "surface_z_m", "f8", &[], [0.25]);
        compare(found, "noise_db", "f4", &[], [31.5]);
        compare(found, "threshold_db", "f4", &[BINS], [40.0; BINS]);
        compare(found, "tvg_db", "f4", &[BINS], (0..BINS).map(|bin| 0.5 * bin as f64));
        compare(found, "sounding_ping", "u4", &[3], [1.0, 2.0, 2.0]);
        compare(found, "sounding_beam", "u4", &[3], [1.0; 3]);
        compare(found, "sounding_range", "f4", &[3], [7.25; 3]);
        compare(found, "sounding_level_db", "f4", &[3], [78.5; 3]);
        compare(found, "sounding_quality", "f4", &[3], [0.75; 3]);
        compare(found, "sounding_corrected", "f4", &[3, 3], [1.0, 2.0, -7.0, 1.0, 2.0, -7.0, 1.0, 2.0, -7.0]);
        compare(found, "sounding_cell", "u4", &[3], [54.0; 3]);
        compare(found, "category_ids", "u4", &[2], [1.0, 70_000.0]);
        assert_eq!(texts(found, "category_names"), ["seabed", "Fisch Ü"]);
        assert_eq!(texts(found, "view"), ["sidescan"]);
        // Nothing else except the tables of the other labels.
        let names = found.as_object().unwrap().keys();
        assert_eq!(names.filter(|name| !name.ends_with("_names") && !name.ends_with("_ids")).count(), 28);
    }
}

/// Compares all numbers of the array `name` with `expected`.
fn near(found: &Value, name: &str, tolerance: f64, expected: impl IntoIterator<Item = f64>) {
    let read: Vec<f64> = texts(found, name).iter().map(|value| value.parse().unwrap()).collect();
    let expected: Vec<f64> = expected.into_iter().collect();
    assert_eq!(read.len(), expected.len(), "{name}");
    let far = read.iter().zip(&expected).position(|(a, b)| (a - b).abs() > tolerance);
    assert!(far.is_none(), "{name}: {:?}", far.map(|index| (index, read[index], expected[index])));
}

/// The numbers of the array `name`, which is there.
fn numbers(found: &Value, name: &str) -> Vec<f64> {
    texts(found, name).iter().map(|value| value.parse().unwrap()).collect()
}

#[test]
fn sides_are_read_by_a_reader_of_xtf() {
    let folder = tempfile::tempdir().unwrap();
    let pings = survey(
        "pattern: {type: sidescan, tilt_deg: 25, vertical_deg: 50, along_deg: 1, rays: 256, rate_hz: 5}\n\
         acoustics: {frequency_khz: 450, source_level_db: 220, bandwidth_khz: 30, bin_m: 0.1}\n\
         range: {min_m: 0.5, max_m: 25}\n",
    );
    let files = ["a.xtf", "a.npz"].map(|name| folder.path().join(name));
    for file in &files {
        let report = pings.write(file).unwrap();
        assert!(report.warnings.is_empty(), "{report:?}");
    }
    let [xtf, npz]: [Value; 2] = read(&files).try_into().unwrap();
    let (all, layout) = (pings.all(), pings.layout().unwrap());
    let (bins, count) = (layout.bins, all.len());

    assert_eq!(texts(&xtf, "program"), ["echocast"]);
    assert_eq!(texts(&xtf, "channels"), ["Port", "Starboard"]);
    near(&xtf, "NavUnits", 0.0, [0.0]);
    near(&xtf, "channel_TypeOfChannel", 0.0, [1.0, 2.0]);
    near(&xtf, "channel_Frequency", 0.0, [450.0; 2]);
    near(&xtf, "channel_TiltAngle", 1e-4, numbers(&npz, "beam_elevation").iter().map(|angle| -angle.to_degrees()));
    // Side by side, a row is the levels of port from the farthest, then those of starboard.
    let levels = numbers(&npz, "level");
    let rows = levels.chunks(2 * bins).flat_map(|row| row[..bins].iter().rev().chain(&row[bins..]));
    let expected: Vec<f64> = rows.map(|level| 100.0 * level).collect();
    assert_eq!(xtf["samples"]["type"], "u2");
    assert_eq!(xtf["samples"]["shape"], serde_json::json!([count, 2, bins]));
    near(&xtf, "samples", 0.501, expected.iter().copied());
    near(&xtf, "waterfall", 0.501, expected);
    for (name, value) in [
        ("SlantRange", layout.reach()),
        ("TimeDuration", 2.0 * layout.reach() / layout.believed_speed),
        ("SecondsPerPing", 0.2),
        ("Frequency", 450.0),
        ("NumSamples", bins as f64),
    ] {
        near(&xtf, name, 1e-6 * value, vec![value; 2 * count]);
    }
    let altitudes = image::altitudes(&pings).unwrap();
    near(&xtf, "SensorPrimaryAltitude", 1e-5, altitudes.iter().copied());
    let ground = altitudes.iter().flat_map(|height| [(layout.reach().powi(2) - height * height).sqrt(); 2]);
    near(&xtf, "GroundRange", 1e-5, ground);
    near(&xtf, "NumChansToFollow", 0.0, vec![2.0; count]);
    assert!(numbers(&xtf, "NumBytesThisRecord").iter().all(|length| length % 64.0 == 0.0));
    poses(&xtf, &npz, count);
}

/// Compares times, places and attitudes in an XTF file with those in an NPZ file of the same pings.
fn poses(xtf: &Value, npz: &Value, count: usize) {
    let times = numbers(npz, "ping_time");
    near(xtf, "time", 0.0051, times.iter().copied());
    near(xtf, "AttitudeTimeTag", 0.51, times.iter().map(|time| 1e3 * time));
    near(xtf, "PingNumber", 0.0, numbers(npz, "ping_number"));
    let position = numbers(npz, "sensor_position");
    let axis = |axis: usize| position.iter().skip(axis).step_by(3).copied();
    near(xtf, "SensorXcoordinate", 0.0, axis(0));
    near(xtf, "SensorYcoordinate", 0.0, axis(1));
    near(xtf, "ShipXcoordinate", 0.0, axis(0));
    near(xtf, "SensorDepth", 1e-6, axis(2).map(|z| SURFACE - z));
    for (name, angle) in ["SensorHeading", "SensorPitch", "SensorRoll"].into_iter().zip(ANGLES) {
        near(xtf, name, 1e-5, vec![angle; count]);
    }
    let speed = numbers(npz, "believed_speed_m_s")[0];
    near(xtf, "SoundVelocity", 1e-4, vec![speed / 2.0; count]);
    near(xtf, "ComputedSoundVelocity", 1e-4, vec![speed; count]);
}

#[test]
fn soundings_and_water_columns_are_read_by_readers_of_xtf_and_kmall() {
    let folder = tempfile::tempdir().unwrap();
    let pings = survey(
        "pattern: {type: multibeam, beams: 32, swath_deg: 120, along_deg: 2, across_deg: 2, rays: 16, rate_hz: 5}\n\
         acoustics: {frequency_khz: 400, source_level_db: 220, bandwidth_khz: 30, bin_m: 0.1}\n\
         range: {min_m: 0.5, max_m: 25}\n",
    );
    // Some beams hear nothing.
    let mut fewer = Pings::default();
    for (index, mut ping) in pings.into_iter().enumerate() {
        let heard = ping.soundings().iter().filter(|sounding| sounding.beam as usize % 5 != index);
        ping.set_soundings(heard.copied().collect()).unwrap();
        fewer.push(ping).unwrap();
    }
    let pings = fewer;
    let files = ["a.xtf", "a.kmall", "a.npz"].map(|name| folder.path().join(name));
    for file in &files {
        let report = pings.write(file).unwrap();
        assert!(report.warnings.is_empty(), "{report:?}");
    }
    let [xtf, kmall, npz]: [Value; 3] = read(&files).try_into().unwrap();
    let (all, layout) = (pings.all(), pings.layout().unwrap());
    let (count, beams, bins) = (all.len(), layout.beams(), layout.bins);

    // Where soundings are, from the arrays.
    let [azimuth, elevation] = ["beam_azimuth", "beam_elevation"].map(|name| numbers(&npz, name));
    let [of_ping, of_beam] = ["sounding_ping", "sounding_beam"].map(|name| numbers(&npz, name));
    let [range, level, quality] =
        ["sounding_range", "sounding_level_db", "sounding_quality"].map(|name| numbers(&npz, name));
    assert!(range.len() > count * beams / 2 && range.len() < count * beams, "{}", range.len());
    let speed = numbers(&npz, "believed_speed_m_s")[0];
    let turns = numbers(&npz, "sensor_orientation_xyzw");
    let position: Vec<DVec3> = numbers(&npz, "sensor_position").chunks(3).map(DVec3::from_slice).collect();
    let turn = |ping: usize| DQuat::from_slice(&turns[4 * ping..]);
    let axis =
        |beam: usize| DQuat::from_rotation_z(azimuth[beam]) * DQuat::from_rotation_y(-elevation[beam]) * DVec3::X;
    let origin = DVec3::from_slice(&numbers(&npz, "origin"));
    let corrected: Vec<DVec3> = numbers(&npz, "sounding_corrected").chunks(3).map(DVec3::from_slice).collect();
    let from_sonar: Vec<DVec3> =
        (0..range.len()).map(|i| corrected[i] + origin - position[of_ping[i] as usize]).collect();
    for (i, from) in from_sonar.iter().enumerate() {
        // In water of one speed.
        let straight = turn(of_ping[i] as usize) * (range[i] * axis(of_beam[i] as usize));
        assert!((*from - straight).length() < 1e-4, "{from} {straight}");
    }
    let depth = |i: usize| SURFACE - position[of_ping[i] as usize].z - from_sonar[i].z;
    let each = || 0..range.len();

    poses(&xtf, &npz, count);
    assert_eq!(texts(&xtf, "channels"), ["Bathymetry"]);
    near(&xtf, "channel_TypeOfChannel", 0.0, [3.0]);
    near(&xtf, "soundings", 0.0, all.iter().map(|ping| ping.soundings().len() as f64));
    near(&xtf, "dPosOffsetTrX", 1e-6, from_sonar.iter().map(|from| from.x));
    near(&xtf, "dPosOffsetTrY", 1e-6, from_sonar.iter().map(|from| from.y));
    near(&xtf, "fDepth", 1e-5, each().map(depth));
    near(&xtf, "dTime", 1e-12, range.iter().map(|range| 2.0 * range / speed));
    near(&xtf, "usAmpl", 0.501, level.iter().map(|level| 100.0 * level));
    near(&xtf, "ucQuality", 0.501, quality.iter().map(|quality| 255.0 * quality));

    // A row for each beam.
    let mut found = vec![None; count * beams];
    for i in each() {
        found[of_ping[i] as usize * beams + of_beam[i] as usize] = Some(i);
    }
    let of_found = |value: &dyn Fn(usize) -> f64, none: f64| -> Vec<f64> {
        found.iter().map(|found| found.map_or(none, value)).collect()
    };
    let each_beam = |value: &dyn Fn(usize, usize) -> f64| -> Vec<f64> {
        (0..count * beams).map(|row| value(row / beams, row % beams)).collect()
    };
    assert_eq!(texts(&kmall, "installed"), ["0.000", "motion_1"]);
    let times = numbers(&npz, "ping_time");
    for name in ["SKM_time", "MRZ_time"] {
        near(&kmall, name, 1e-8, times.iter().copied());
    }
    near(&kmall, "pingCnt", 0.0, numbers(&npz, "ping_number"));
    for side in ["", "SKM_"] {
        // WGS 84 at 0 N 0 E.
        near(&kmall, &format!("{side}longitude_deg"), 1e-12, position.iter().map(|at| at.x / 111_319.490_793));
        near(&kmall, &format!("{side}latitude_deg"), 1e-12, position.iter().map(|at| at.y / 110_574.275_821));
    }
    near(&kmall, "SKM_ellipsoidHeight_m", 1e-6, position.iter().map(|at| at.z));
    for (names, angle) in
        [("SKM_heading_deg headingVessel_deg", ANGLES[0]), ("SKM_pitch_deg", ANGLES[1]), ("SKM_roll_deg", ANGLES[2])]
    {
        names.split(' ').for_each(|name| near(&kmall, name, 1e-5, vec![angle; count]));
    }
    near(&kmall, "txTransducerDepth_m", 1e-6, position.iter().map(|at| SURFACE - at.z));
    near(&kmall, "z_waterLevelReRefPoint_m", 1e-6, position.iter().map(|at| at.z - SURFACE));
    let rate = speed / (2.0 * layout.bin_m);
    for (names, value) in [
        ("soundSpeedAtTxDepth_mPerSec soundVelocity_mPerSec", speed),
        ("WCSampleRate sampleFreq_Hz", rate),
        ("frequencyMode_Hz centreFreq_Hz", 400e3),
        ("pingRate_Hz", 5.0),
        ("TVGfunctionApplied", 0.0),
    ] {
        names.split(' ').for_each(|name| near(&kmall, name, 1e-6 * value, vec![value; count]));
    }
    near(&kmall, "numSoundingsValidMain", 0.0, all.iter().map(|ping| ping.soundings().len() as f64));
    near(&kmall, "detectionType", 0.0, of_found(&|_| 0.0, 2.0));
    near(&kmall, "detectionMethod", 0.0, of_found(&|_| 1.0, 0.0));
    near(&kmall, "detectionConfidenceLevel", 0.501, of_found(&|i| 100.0 * quality[i], 0.0));
    near(&kmall, "reflectivity1_dB", 0.0, of_found(&|i| level[i], 0.0));
    near(&kmall, "WCBeamNumb", 0.0, each_beam(&|_, beam| beam as f64));
    near(&kmall, "twoWayTravelTime_sec", 1e-8, of_found(&|i| 2.0 * range[i] / speed, 0.0));
    near(&kmall, "WCrange_samples", 0.501, of_found(&|i| range[i] / layout.bin_m, 0.0));
    near(&kmall, "detectedRangeInSamplesHighResolution", 1e-4, of_found(&|i| range[i] / layout.bin_m, 0.0));
    // From the ship: ahead and to starboard on the map.
    let heading = ANGLES[0].to_radians();
    let ahead = DVec3::new(heading.sin(), heading.cos(), 0.0);
    let starboard = ahead.cross(DVec3::Z);
    near(&kmall, "x_reRefPoint_m", 1e-5, of_found(&|i| from_sonar[i].dot(ahead), 0.0));
    near(&kmall, "y_reRefPoint_m", 1e-5, of_found(&|i| from_sonar[i].dot(starboard), 0.0));
    near(&kmall, "z_reRefPoint_m", 1e-5, of_found(&|i| -from_sonar[i].z, 0.0));
    near(&kmall, "beamAngleReRx_deg", 1e-4, each_beam(&|_, beam| axis(beam).y.atan2(-axis(beam).z).to_degrees()));
    let across = each_beam(&|ping, beam| {
        let axis = turn(ping) * axis(beam);
        (-axis.dot(starboard)).atan2(-axis.z).to_degrees()
    });
    near(&kmall, "WCNomBeamAngleAcross_deg", 1e-4, across.iter().copied());
    near(&kmall, "beamPointAngReVertical_deg", 1e-4, across);
    // The reader's own longitudes, latitudes and depths are places of the soundings.
    let place = |i: usize| position[of_ping[i] as usize] + from_sonar[i];
    let read = numbers(&kmall, "lon_lat_z");
    for (row, found) in found.iter().enumerate() {
        if let Some(i) = *found {
            let at = [0, 1, 2].map(|part| read[part * count * beams + row]);
            let at = DVec3::new(at[0] * 111_319.490_793, at[1] * 110_574.275_821, SURFACE - at[2]);
            assert!((at - place(i)).length() < 1e-4, "{at} {}", place(i));
        }
    }

    let gain = numbers(&kmall, "TVGoffset_dB");
    assert!(gain.iter().all(|&other| other == gain[0] && other.fract() == 0.0));
    assert_eq!(kmall["samples"]["shape"], serde_json::json!([count, beams, bins]));
    near(&kmall, "startRangeSampleNum", 0.0, vec![0.0; count * beams]);
    // Nulls of the noise are deeper than eight bits say.
    let levels = numbers(&npz, "level");
    near(&kmall, "samples", 0.501, levels.iter().map(|level| (2.0 * (level + gain[0])).max(-128.0)));
    let lowest = levels.iter().filter(|&level| 2.0 * (level + gain[0]) < -128.5);
    assert!(lowest.clone().count() < levels.len() / 20 && lowest.clone().all(|&level| level < layout.noise_db.into()));
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
    for ending in ["npz", "h5", "xtf"] {
        let [first, second] = ["first", "second"].map(|name| {
            let path = folder.path().join(format!("{name}.{ending}"));
            pings().write(&path).unwrap();
            std::thread::sleep(std::time::Duration::from_millis(if name == "first" { 1100 } else { 0 }));
            fs::read(path).unwrap()
        });
        assert!(first == second, "{ending}");
    }
}
