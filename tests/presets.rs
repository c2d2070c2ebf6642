//! Draws the pattern of every preset and compares it with the figures in its `expect` section, and a few with figures
//! worked out by hand.

use echocast::detect::{Detection, Statistical};
use echocast::emitter::lobe::Lobe;
use echocast::emitter::pattern::{Imaging, Janus, Multibeam, Pattern, Sidescan, SingleBeam, Spinning};
use echocast::emitter::{BeamTable, FiringOrder};
use echocast::radar::{RadarSpec, RadarWaveform};
use echocast::scene::Material;
use echocast::{
    Cause, Environment, FieldSet, Ping, Pose, PresetInfo, ReturnsSpec, ScanOptions, Sensor, SensorKind, Trajectory,
};
use echocast_tests::assert_in_document;
use echocast_tests::reference::{SceneBuilder, Shape};
use glam::DVec3;
use std::collections::BTreeSet;
use std::path::Path;

/// Azimuth of a beam, degrees.
fn azimuth(beams: &BeamTable, beam: usize) -> f64 {
    f64::from(beams.dir_y[beam]).atan2(f64::from(beams.dir_x[beam])).to_degrees()
}

/// Elevation of a beam, degrees.
fn elevation(beams: &BeamTable, beam: usize) -> f64 {
    let [x, y, z] = [beams.dir_x[beam], beams.dir_y[beam], beams.dir_z[beam]].map(f64::from);
    z.atan2(x.hypot(y)).to_degrees()
}

/// `a - b`, degrees, in -180 to 180.
fn turn(a: f64, b: f64) -> f64 {
    (a - b + 540.0).rem_euclid(360.0) - 180.0
}

#[track_caller]
fn assert_near(what: &str, found: f64, expected: f64, tolerance: f64) {
    assert!((found - expected).abs() <= tolerance, "{what} is {found}, expected {expected} +- {tolerance}");
}

fn spinning(sensor: &Sensor) -> &Spinning {
    match &sensor.spec().pattern {
        Pattern::Spinning(spinning) => spinning,
        other => panic!("{} is not spinning: {other:?}", sensor.name()),
    }
}

#[test]
fn every_file_is_a_preset_with_a_name_of_its_own() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../presets");
    let mut files = Vec::new();
    for folder in ["lidar", "survey", "tof", "sonar", "radar", "paper"] {
        for entry in std::fs::read_dir(root.join(folder)).unwrap() {
            let path = entry.unwrap().path();
            files.push((folder.to_owned(), path.file_stem().unwrap().to_string_lossy().into_owned()));
        }
    }
    files.sort();
    let mut presets: Vec<_> = Sensor::presets().into_iter().map(|preset| (preset.folder, preset.name)).collect();
    presets.sort();
    assert_eq!(presets, files);
    let names: BTreeSet<_> = presets.iter().map(|(_, name)| name).collect();
    assert_eq!(names.len(), presets.len(), "two folders have a preset of the same name");
}

#[test]
fn every_preset_says_what_it_is() {
    for preset in Sensor::presets() {
        let sensor = Sensor::preset(&preset.name).unwrap();
        assert_eq!(sensor.name(), preset.name);
        assert_eq!((sensor.title(), sensor.kind()), (preset.title.as_str(), preset.kind));
        assert!(!sensor.title().is_empty() && !sensor.source().is_empty(), "{}", preset.name);
        let kind = match preset.folder.as_str() {
            "lidar" | "survey" => SensorKind::Lidar,
            "tof" => SensorKind::Tof,
            "sonar" => SensorKind::Sonar,
            "radar" => SensorKind::Radar,
            // The paper has both.
            _ => preset.kind,
        };
        assert_eq!(sensor.kind(), kind, "{}", preset.name);
    }
}

#[test]
fn patterns_have_the_figures_of_their_files() {
    for preset in Sensor::presets().into_iter().filter(|preset| preset.kind.is_optical()) {
        let name = &preset.name;
        let sensor = Sensor::preset(name).unwrap();
        let beams = sensor.beams();
        beams.check().unwrap();
        let expected = sensor.expectations().unwrap_or_else(|| panic!("{name} has no section expect"));
        assert_eq!(Some(beams.len() as u64), expected.beams, "{name}: beams");

        let is_spinning = matches!(sensor.spec().pattern, Pattern::Spinning(_));
        if beams.firing_order == FiringOrder::Columns {
            assert_eq!(Some(u64::from(beams.rows)), expected.channels, "{name}: channels");
            assert_eq!(Some(u64::from(beams.columns)), expected.columns, "{name}: columns");
        }
        if is_spinning {
            let step = expected.azimuth_step_deg.unwrap_or_else(|| panic!("{name} has no azimuth_step_deg"));
            // Data sheets round to four places.
            for beam in [0, beams.len() / 2, beams.len() - 2] {
                let found = turn(azimuth(beams, beam + 1), azimuth(beams, beam)).abs();
                assert_near(&format!("{name}: azimuth step"), found, step, 1e-4);
            }
        }

        let angles: Vec<f64> = (0..beams.len()).map(|beam| elevation(beams, beam)).collect();
        let [low, high] = expected.elevation_deg.unwrap_or_else(|| panic!("{name} has no elevation_deg"));
        let lowest = angles.iter().copied().fold(f64::INFINITY, f64::min);
        let highest = angles.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        assert_near(&format!("{name}: lowest elevation"), lowest, low, 1e-3);
        assert_near(&format!("{name}: highest elevation"), highest, high, 1e-3);

        // A turn is not a whole number of cycles, and data sheets round.
        let rate = expected.points_per_s.unwrap_or_else(|| panic!("{name} has no points_per_s"));
        let tolerance = if expected.source == "computed" { 1e-3 } else { 0.03 };
        assert_near(&format!("{name}: points per second"), beams.len() as f64 / beams.period, rate, tolerance * rate);

        // A scan ends before the next one starts, except for channels that fire early or late in their cycle.
        let slack = if is_spinning { 1e-4 } else { 0.0 };
        for &time in &beams.time {
            assert!((-slack..beams.period + slack).contains(&time), "{name}: a beam at {time} s");
        }
    }
}

/// A cycle takes 55.296 us, in which a rotor at 10 turns/s advances 0.1990656 deg; the last of 16 firings 2.304 us
/// apart comes 34.56 us after the first, 0.124416 deg further on. In the HDL-32E's cycle of 46.080 us, 0.165888 deg,
/// the last of 32 firings 1.152 us apart comes after 35.712 us.
#[test]
fn pucks_turn_while_their_lasers_wait() {
    for (name, channels, cycle_us, wait_us) in [
        ("velodyne_vlp16", 16, 55.296, 34.56),
        ("velodyne_vlp32c", 32, 55.296, 34.56),
        ("velodyne_hdl32e", 32, 46.080, 35.712),
    ] {
        // 3600 degrees in a second.
        let degrees = |us: f64| -3600e-6 * us;
        let sensor = Sensor::preset(name).unwrap();
        let beams = sensor.beams();
        let columns = beams.columns as usize;
        let offsets = &spinning(&sensor).channels.as_ref().unwrap().azimuth_offset_deg;
        let offset = |channel: usize| offsets.get(channel).copied().unwrap_or(0.0);
        assert_eq!(beams.rows, channels);
        let last = channels as usize - 1;
        for column in [0, 1, 777, columns - 2] {
            let (first_beam, last_beam) = (column, last * columns + column);
            assert_eq!(
                (beams.firing(first_beam as u32), beams.firing(last_beam as u32)),
                (column as u32, column as u32)
            );
            // Clockwise: azimuth falls.
            let advance = turn(azimuth(beams, first_beam + 1), azimuth(beams, first_beam));
            assert_near(&format!("{name}: advance in a cycle"), advance, degrees(cycle_us), 1e-5);
            let waited = turn(azimuth(beams, last_beam), azimuth(beams, first_beam)) - (offset(last) - offset(0));
            assert_near(&format!("{name}: advance of the last channel"), waited, degrees(wait_us), 1e-5);
            let wait = beams.time[last_beam] - beams.time[first_beam];
            assert_near(&format!("{name}: wait of the last channel"), wait, wait_us * 1e-6, 1e-8);
            let cycle = beams.time[first_beam + 1] - beams.time[first_beam];
            assert_near(&format!("{name}: cycle"), cycle, cycle_us * 1e-6, 1e-8);
        }
    }
}

/// The paper's cameras put their outermost rays on the edges of the field of view; real ones look through pixel
/// centres.
#[test]
fn cameras_reach_their_field_of_view() {
    let paper = Sensor::preset("kinect_v1_default").unwrap();
    let corner = paper.beams();
    let tangents = |beams: &BeamTable, beam: usize| {
        let [x, y, z] = [beams.dir_x[beam], beams.dir_y[beam], beams.dir_z[beam]].map(f64::from);
        (y / x, z / x)
    };
    // The program uses the ratio of the angles, 43 to 57 degrees, for that of the sides.
    let left = 28.5f64.to_radians().tan();
    let up = left * 43.0 / 57.0;
    assert_eq!((corner.columns, corner.rows), (320, 240));
    for (beam, y, z) in [(0, left, up), (319, -left, up), (239 * 320, left, -up), (240 * 320 - 1, -left, -up)] {
        let found = tangents(corner, beam);
        assert_near("tangent to the left", found.0, y, 1e-6);
        assert_near("tangent up", found.1, z, 1e-6);
    }
    let real = Sensor::preset("kinect_v1").unwrap();
    let found = tangents(real.beams(), 0);
    assert_eq!((real.beams().columns, real.beams().rows), (640, 480));
    assert_near("tangent to the left", found.0, left * 639.0 / 640.0, 1e-6);
    assert_near("tangent up", found.1, 21.5f64.to_radians().tan() * 479.0 / 480.0, 1e-6);
}

/// The fan of the generic lidar of the paper rises from -45 degrees in steps of one, and turns counter-clockwise.
#[test]
fn fans_rise_with_the_row() {
    let sensor = Sensor::preset("generic_lidar").unwrap();
    let beams = sensor.beams();
    for row in 0..beams.rows as usize {
        assert_near("elevation", elevation(beams, row * 31), row as f64 - 45.0, 1e-5);
        assert_near("azimuth of the first column", azimuth(beams, row * 31), -15.0, 1e-5);
        assert_near("azimuth of the last column", azimuth(beams, row * 31 + 30), 15.0, 1e-5);
    }
}

/// Half-degree cells that the scans of `sensor` meet in its first second, after each tenth.
fn coverage(sensor: &Sensor) -> Vec<usize> {
    let mut cells = BTreeSet::new();
    let mut covered = Vec::new();
    for scan in 0..10 {
        let beams = sensor.beams_at(f64::from(scan) * 0.1).unwrap();
        beams.check().unwrap();
        for beam in 0..beams.len() {
            cells.insert([azimuth(&beams, beam), elevation(&beams, beam)].map(|angle| (2.0 * angle).floor() as i32));
        }
        covered.push(cells.len());
    }
    covered
}

/// The data sheets give cones of 38.4 and 70.4 degrees. The fit to the published patterns reaches 19.26 and 35.82
/// degrees, with azimuth and elevation as the legs of a triangle; ten scans come within 0.01 of it.
#[test]
fn livox_prisms_fill_their_cones() {
    for (name, cone, reach) in [("livox_mid40", 38.4, 19.26), ("livox_mid70", 70.4, 35.82)] {
        let sensor = Sensor::preset(name).unwrap();
        let (mut widest, mut farthest, mut nearest) = (0f64, 0f64, f64::INFINITY);
        for scan in 0..10 {
            let beams = sensor.beams_at(f64::from(scan) * 0.1).unwrap();
            for beam in 0..beams.len() {
                let off = f64::from(beams.dir_y[beam]).hypot(beams.dir_z[beam].into()).asin().to_degrees();
                (widest, nearest) = (widest.max(off), nearest.min(off));
                farthest = farthest.max(azimuth(&beams, beam).hypot(elevation(&beams, beam)));
            }
        }
        assert_near(&format!("{name}: cone"), 2.0 * widest, cone, 0.06);
        assert_near(&format!("{name}: reach"), farthest, reach, 0.01);
        assert!(nearest < 0.01, "{name}: a hole of {nearest} deg in the middle");
    }
}

/// Prisms that HELIOS++ estimated, or that are made to fit: data sheets give these fields of view. Those estimated for the
/// L2 miss half a degree of its height.
#[test]
fn prisms_fill_their_fields_of_view() {
    for (name, width, height, within) in [
        ("livox_avia", 70.4, 77.2, 0.25),
        ("livox_horizon", 81.7, 25.1, 0.1),
        ("dji_l1", 70.4, 77.2, 0.25),
        ("dji_l2", 70.0, 75.0, 0.7),
        ("dji_l2_repetitive", 70.0, 3.0, 0.1),
    ] {
        let sensor = Sensor::preset(name).unwrap();
        let (mut across, mut up) = (Vec::new(), Vec::new());
        for scan in 0..10 {
            let beams = sensor.beams_at(f64::from(scan) * 0.1).unwrap();
            across.extend((0..beams.len()).map(|beam| azimuth(&beams, beam)));
            up.extend((0..beams.len()).map(|beam| elevation(&beams, beam)));
        }
        for (what, angles, expected) in [("width", across, width), ("height", up, height)] {
            let low = angles.iter().copied().fold(f64::INFINITY, f64::min);
            let high = angles.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            assert_near(&format!("{name}: {what}"), high - low, expected, within);
        }
    }
}

#[test]
fn livox_scans_cover_more_with_time() {
    // Of the half-degree cells in the field of view: a cone, or all around.
    let cone = |degrees: f64| std::f64::consts::PI * degrees * degrees * 4.0;
    for (name, cells, first_scan, first_second) in [
        ("livox_mid40", cone(19.2), 0.3, 0.9),
        ("livox_mid70", cone(35.2), 0.15, 0.8),
        ("livox_avia", cone(35.2), 0.5, 0.9),
        ("livox_mid360", 360.0 * 59.4 * 4.0, 0.2, 0.9),
    ] {
        let sensor = Sensor::preset(name).unwrap();
        let covered = coverage(&sensor);
        assert!(covered.windows(2).all(|scans| scans[1] > scans[0]), "{name}: {covered:?}");
        assert!(
            covered[0] as f64 > first_scan * cells && covered[9] as f64 > first_second * cells,
            "{name}: {covered:?}"
        );
        assert!(covered[9] as f64 > 1.5 * covered[0] as f64, "{name}: {covered:?}");
        assert_ne!(*sensor.beams_at(0.1).unwrap(), *sensor.beams());
        assert_eq!(*sensor.beams_at(0.0).unwrap(), *sensor.beams());
    }
}

/// The presets of these folders, each with the text of its file.
fn presets_of(folders: &'static [&'static str]) -> impl Iterator<Item = (PresetInfo, Sensor, String)> {
    Sensor::presets().into_iter().filter(|preset| folders.contains(&preset.folder.as_str())).map(|preset| {
        let file = echocast_tests::root().join(format!("presets/{}/{}.yaml", preset.folder, preset.name));
        let sensor = Sensor::preset(&preset.name).unwrap();
        (preset, sensor, std::fs::read_to_string(file).unwrap())
    })
}

/// The presets of real optical instruments.
fn instruments() -> impl Iterator<Item = (PresetInfo, Sensor, String)> {
    presets_of(&["lidar", "tof"])
}

fn radars() -> impl Iterator<Item = (PresetInfo, Sensor, String)> {
    presets_of(&["radar"])
}

fn sonars() -> impl Iterator<Item = (PresetInfo, Sensor, String)> {
    presets_of(&["sonar"])
}

#[test]
fn instruments_are_complete() {
    for (PresetInfo { name, kind, .. }, sensor, text) in instruments().chain(presets_of(&["survey"])) {
        let spec = sensor.spec();
        for key in ["\nbeam: {wavelength_nm: ", "\nrange: {min_m: ", "\ndetection: {model: ", "\nreturns: {mode: "] {
            assert!(text.contains(key), "{name} leaves out {key:?}");
        }
        assert!(spec.range.min_m > 0.0 && spec.range.max_m.is_some(), "{name}: {:?}", spec.range);
        let reason = "\n# No line of reflectance and range was found";
        let unlimited = spec.detection.model == Detection::None;
        assert_eq!(unlimited, text.contains(reason), "{name}: {:?} needs a reason, others none", spec.detection);
        if kind == SensorKind::Lidar {
            let beam = &spec.beam;
            assert!(beam.divergence_mrad.iter().all(|&mrad| mrad > 0.0) && beam.pulse_ns > 0.0, "{name}: {beam:?}");
        }
    }
}

/// Sections of a preset file whose comments, on the same line or right above, call a figure unverified.
fn unverified(text: &str) -> Vec<&str> {
    const SECTIONS: [&str; 11] = [
        "pattern",
        "beam",
        "range",
        "detection",
        "returns",
        "noise",
        "intensity",
        "doppler",
        "acoustics",
        "radar",
        "dvl",
    ];
    let (mut section, mut sections, mut above) = ("", Vec::new(), false);
    for line in text.lines() {
        let doubt = line.contains("unverified");
        if line.starts_with('#') {
            above |= doubt;
            continue;
        }
        if !line.starts_with(' ') {
            section = line.split(':').next().unwrap();
        }
        if (doubt | std::mem::take(&mut above)) && sections.last() != Some(&section) {
            sections.push(section);
        }
    }
    sections.retain(|section| SECTIONS.contains(section));
    sections
}

/// A row of the table in docs/instruments.md.
fn row(name: &str, sensor: &Sensor, text: &str) -> String {
    let (spec, beams) = (sensor.spec(), sensor.beams());
    let degrees = |angle: f64| ((10.0 * angle).round() / 10.0).to_string();
    let [low, high] = sensor.expectations().unwrap().elevation_deg.unwrap();
    let view = match &spec.pattern {
        Pattern::Spinning(spinning) if low == high => degrees(spinning.azimuth.fov_deg),
        Pattern::Spinning(spinning) => {
            format!("{} x {} to {}", degrees(spinning.azimuth.fov_deg), degrees(low), degrees(high))
        }
        Pattern::Pinhole(camera) => camera.fov_deg.map(degrees).join(" x "),
        Pattern::LineScan(scan) => match scan.head {
            Some(head) => format!("{} x {}", degrees(head.to_deg - head.from_deg), degrees(scan.width_deg())),
            None => format!("{} across", degrees(scan.width_deg())),
        },
        _ => {
            let widest = (0..beams.len()).map(|beam| azimuth(beams, beam).abs()).fold(0.0, f64::max);
            format!("{} x {}", degrees(2.0 * widest), degrees(2.0 * high.max(-low)))
        }
    };
    let seen = match spec.detection.model {
        Detection::RadarEquation { reflectance, at_m }
        | Detection::Statistical(Statistical { reflectance, at_m, .. }) => {
            format!("{} % at {at_m} m", 100.0 * reflectance)
        }
        _ => String::new(),
    };
    let divergence = match spec.beam.divergence_mrad {
        [0.0, 0.0] => String::new(),
        [across, up] => format!("{across} x {up}"),
    };
    let noise = match spec.noise.range_sigma_m {
        0.0 => String::new(),
        sigma => sigma.to_string(),
    };
    let ReturnsSpec { mode, max, .. } = spec.returns;
    let returns = format!("{mode:?} of {max}").to_lowercase();
    let range = format!("{} to {}", spec.range.min_m, spec.range.max_m.unwrap());
    let rate = (beams.len() as f64 / beams.period).round();
    let size = format!("{} x {}", beams.rows, beams.columns);
    let unverified = unverified(text).join(", ");
    format!(
        "| `{name}` | {view} | {size} | {rate} | {range} | {seen} | {divergence} | {noise} | {returns} | {unverified} |\n"
    )
}

#[test]
fn the_table_of_instruments_is_up_to_date() {
    let table: String = instruments().map(|(preset, sensor, text)| row(&preset.name, &sensor, &text)).collect();
    assert_in_document("docs/instruments.md", &table);
}

#[test]
fn the_table_of_survey_instruments_is_up_to_date() {
    let survey = presets_of(&["survey"]);
    let table: String = survey.map(|(preset, sensor, text)| row(&preset.name, &sensor, &text)).collect();
    assert_in_document("docs/instruments.md", &table);
}

/// `bench instruments` has measured all of them.
#[test]
fn every_instrument_has_a_speed() {
    let file = std::fs::read_to_string(echocast_tests::root().join("docs/instruments.md")).unwrap();
    let (_, speeds) = file.split_once("\n## Speed\n").expect("a section of that name");
    let rows = speeds.lines().filter_map(|line| line.strip_prefix("| `")?.split_once("` | "));
    let mut measured: Vec<&str> = rows
        .map(|(name, cells)| {
            let speeds = cells.split('|').filter_map(|cell| cell.trim().parse::<f64>().ok());
            assert!(speeds.clone().count() > 0 && speeds.into_iter().all(|speed| speed > 0.0), "{name}: {cells}");
            name
        })
        .collect();
    let presets = Sensor::presets();
    let timed = presets.iter().filter(|preset| preset.folder != "paper");
    let mut expected: Vec<&str> = timed.map(|preset| &*preset.name).collect();
    measured.sort_unstable();
    expected.sort_unstable();
    assert_eq!(measured, expected, "`bench instruments` updates the tables");
}

/// Speed of sound for which widths and resolutions are stated, m/s.
const WATER: f64 = 1500.0;

/// Speed of sound in cold water, m/s.
const COLD_WATER: f64 = 1420.0;

/// Angle between the first and the last beam, degrees.
fn swath(beams: &BeamTable) -> f64 {
    let axis = |beam: usize| DVec3::new(beams.dir_x[beam].into(), beams.dir_y[beam].into(), beams.dir_z[beam].into());
    axis(0).angle_between(axis(beams.len() - 1)).to_degrees()
}

#[test]
fn sonars_have_the_figures_of_their_files() {
    for (PresetInfo { name, .. }, sensor, text) in sonars() {
        let (spec, beams, acoustics) = (sensor.spec(), sensor.beams(), sensor.acoustics().unwrap());
        beams.check().unwrap();
        let expected = sensor.expectations().unwrap_or_else(|| panic!("{name} has no section expect"));
        assert_eq!(Some(beams.len() as u64), expected.beams, "{name}: beams");
        let resolution = expected.resolution_m.unwrap_or_else(|| panic!("{name} has no resolution_m"));
        // Resolutions are rounded to tenths of a millimetre.
        assert_near(&format!("{name}: resolution"), acoustics.resolution(WATER), resolution, 5e-5);
        match &spec.pattern {
            Pattern::Sidescan(_) => assert_eq!(acoustics.bounces, 2, "{name}: sea surface and bottom"),
            Pattern::SingleBeam(_) => {}
            Pattern::Dvl(janus) => {
                let [low, high] = expected.elevation_deg.unwrap_or_else(|| panic!("{name} has no elevation_deg"));
                assert_eq!(low, high, "{name}: beams lean alike");
                assert_near(&format!("{name}: elevation"), janus.janus_deg - 90.0, low, 1e-9);
            }
            _ => {
                let angle = expected.swath_deg.unwrap_or_else(|| panic!("{name} has no swath_deg"));
                assert_near(&format!("{name}: swath"), swath(beams), angle, 1e-3);
            }
        }
        let range = spec.range;
        assert!(range.min_m > 0.0 && range.max_m.is_some(), "{name}: {range:?}");
        let heard = 0.5 * COLD_WATER * beams.period;
        assert!(range.max_m.unwrap() <= heard, "{name}: up to {range:?}, but the next ping comes after {heard} m");
        // Makers do not publish it.
        let generic = sensor.source() == "generic starting values, not those of a maker";
        assert_eq!(!generic, unverified(&text).contains(&"acoustics"), "{name}: a source level needs a word");
        let written = sensor.to_yaml().unwrap();
        assert_eq!(Sensor::from_yaml(&written, "").unwrap().spec(), spec, "{written}");
    }
}

/// Width of a lobe, degrees.
fn degrees(lobe: &Lobe, wavelength: f64) -> f64 {
    lobe.at(wavelength).width().to_degrees()
}

/// A sonar hears a bottom of medium sand at three tenths of its range, in the direction half way from its axis to where
/// it hears half as loudly.
#[test]
fn sonars_hear_a_flat_bottom() {
    let mut scene = SceneBuilder::new();
    // Lambert's law with mu 0.03, -15 dB.
    let sand = scene.reflector((0.03 * std::f64::consts::PI) as f32);
    scene.stand(Shape::plate(DVec3::ZERO, DVec3::Z, 1000.0), Some(sand));
    let scene = scene.finish().build().unwrap();
    let ping = |sensor: &Sensor, height: f64| -> echocast::Result<Ping> {
        let environment = Environment::from_yaml(&format!("water: {{surface_z_m: {}}}", height + 5.0))?;
        let options = ScanOptions::default().environment(environment);
        scene.ping(sensor, &Trajectory::fixed(Pose::at(0.0, 0.0, height)), &options)
    };
    for (PresetInfo { name, .. }, mut sensor, _) in sonars() {
        let wavelength = WATER / sensor.acoustics().unwrap().frequency();
        let (below, rays) = match &sensor.spec().pattern {
            Pattern::Sidescan(Sidescan { tilt_deg, .. }) => (*tilt_deg, 512),
            Pattern::Imaging(Imaging { tilt_deg, vertical_deg, .. }) => {
                (tilt_deg + 0.25 * degrees(vertical_deg, wavelength), 32)
            }
            Pattern::SingleBeam(SingleBeam { tilt_deg, vertical_deg, .. }) => {
                (tilt_deg + vertical_deg.as_ref().map_or(0.0, |lobe| 0.25 * degrees(lobe, wavelength)), 256)
            }
            Pattern::Dvl(janus) => (90.0 - janus.janus_deg, 256),
            _ => (90.0, 8),
        };
        let range = 0.3 * sensor.spec().range.max_m.unwrap();
        sensor.set("pattern.rays", &rays.to_string()).unwrap();
        sensor.set("range.max_m", &(1.2 * range).to_string()).unwrap();
        let ping = ping(&sensor, range * below.to_radians().sin()).unwrap();
        let layout = &ping.layout();
        let beam = layout.beams() / 2;
        let from_to = [0.97, 1.03].map(|part| (part * range / layout.bin_m) as usize);
        let power = |level: f32| 10f64.powf(f64::from(level) / 10.0);
        let heard: Vec<f64> = ping.levels(beam)[from_to[0]..from_to[1]].iter().copied().map(power).collect();
        // Straight down the echo is short; to the side it is as long as the window.
        let level = if below == 90.0 {
            heard.iter().copied().fold(0.0, f64::max)
        } else {
            heard.iter().sum::<f64>() / heard.len() as f64
        };
        let (level, least) = (10.0 * level.log10(), f64::from(layout.threshold_db[from_to[1]]));
        assert!(level > least, "{name}: {level} dB at {range} m, but {least} dB is needed");
        if below == 90.0 {
            let found = ping.soundings().iter().find(|sounding| sounding.beam as usize == beam);
            let found = found.unwrap_or_else(|| panic!("{name} finds no depth"));
            assert_near(&format!("{name}: depth"), found.range.into(), range, 0.02 * range);
        }
    }
    // More pings than the range allows time for.
    let mut hasty = Sensor::preset("mbes_400").unwrap();
    hasty.set("pattern.rate_hz", "10").unwrap();
    let error = ping(&hasty, 20.0).unwrap_err().to_string();
    assert!(
        error.starts_with("range.max_m is 150 m, beyond the 74.") && error.contains("a lower pattern.rate_hz"),
        "{error}"
    );
}

/// A row of the table of sonars in docs/instruments.md.
fn sonar_row(name: &str, sensor: &Sensor, text: &str) -> String {
    let (spec, acoustics) = (sensor.spec(), sensor.acoustics().unwrap());
    let wavelength = WATER / acoustics.frequency();
    let width = |lobe: &Lobe| ((100.0 * degrees(lobe, wavelength)).round() / 100.0).to_string();
    let (beams, view, widths) = match &spec.pattern {
        Pattern::Sidescan(Sidescan { along_deg, vertical_deg, tilt_deg, .. }) => {
            ("2".to_owned(), format!("sides, {tilt_deg} below"), [along_deg, vertical_deg].map(width).join(" x "))
        }
        Pattern::Multibeam(Multibeam { beams, swath_deg, along_deg, across_deg, .. }) => {
            (beams.to_string(), format!("down, {swath_deg}"), [along_deg, across_deg].map(width).join(" x "))
        }
        Pattern::Imaging(Imaging { beams, fov_deg, beam_deg, vertical_deg, .. }) => {
            (beams.to_string(), format!("ahead, {fov_deg}"), [beam_deg, vertical_deg].map(width).join(" x "))
        }
        Pattern::SingleBeam(SingleBeam { beam_deg, vertical_deg, turn, .. }) => {
            let view = turn.map_or("down".to_owned(), |turn| format!("turns, {}", turn.fov_deg));
            let widths: Vec<_> = [Some(beam_deg), vertical_deg.as_ref()].into_iter().flatten().map(width).collect();
            ("1".to_owned(), view, widths.join(" x "))
        }
        Pattern::Dvl(Janus { janus_deg, beam_deg, .. }) => {
            ("4".to_owned(), format!("down and outwards, {janus_deg} off"), width(beam_deg))
        }
        other => panic!("{name} is no sonar: {other:?}"),
    };
    let range = format!("{} to {}", spec.range.min_m, spec.range.max_m.unwrap());
    let resolution = sensor.expectations().unwrap().resolution_m.unwrap();
    let rate = (100.0 / sensor.beams().period).round() / 100.0;
    let (frequency, unverified) = (acoustics.frequency_khz, unverified(text).join(", "));
    format!(
        "| `{name}` | {frequency} | {beams} | {view} | {widths} | {range} | {resolution} | {rate} | {unverified} |\n"
    )
}

#[test]
fn the_table_of_sonars_is_up_to_date() {
    let table: String = sonars().map(|(preset, sensor, text)| sonar_row(&preset.name, &sensor, &text)).collect();
    assert_in_document("docs/instruments.md", &table);
}

/// The section `radar` of a sensor.
fn radar(sensor: &Sensor) -> &RadarSpec {
    sensor.spec().radar.as_ref().unwrap()
}

/// Full width at half the power of the beam of a radar that looks straight ahead, degrees, in azimuth (axis 0) or in
/// elevation (1); none without elements beside, or above, each other.
fn radar_beam(spec: &RadarSpec, axis: usize) -> Option<f64> {
    let array = spec.array.virtual_array(spec.waveform.wavelength());
    let power = |degrees: f64| {
        let (sine, cosine) = degrees.to_radians().sin_cos();
        let direction = if axis == 0 { [cosine, sine, 0.0] } else { [cosine, 0.0, sine] };
        let sum: (f64, f64) = array
            .steering(direction)
            .iter()
            .fold((0.0, 0.0), |(re, im), element| (re + f64::from(element.re), im + f64::from(element.im)));
        (sum.0.powi(2) + sum.1.powi(2)) / (array.places.len() as f64).powi(2)
    };
    const STEP: f64 = 0.01;
    let beyond = (1..9000).find(|&step| power(STEP * f64::from(step)) < 0.5)?;
    let [mut inside, mut outside] = [beyond - 1, beyond].map(|step| STEP * f64::from(step));
    for _ in 0..40 {
        let middle = 0.5 * (inside + outside);
        if power(middle) < 0.5 { outside = middle } else { inside = middle }
    }
    Some(inside + outside)
}

/// Range resolution, m.
fn range_resolution(spec: &RadarSpec) -> f64 {
    match &spec.waveform {
        RadarWaveform::Fmcw(fmcw) => fmcw.range_step(),
        RadarWaveform::Pulse(pulse) => pulse.resolution(),
        other => panic!("no range resolution is known of {other:?}"),
    }
}

/// Greatest unambiguous range rate, m/s: transmitters that take turns tell as many spans apart as there are, if the radar
/// unfolds. None without coherent pulses.
fn unambiguous(spec: &RadarSpec) -> Option<f64> {
    let (transmitters, axis) = (spec.array.tx.len(), spec.waveform.axes(spec.array.tx.len()).velocity);
    let folds = match &spec.waveform {
        RadarWaveform::Fmcw(fmcw) if spec.detection.unfold => fmcw.slots(transmitters),
        _ => 1,
    };
    (axis.len > 1).then_some(0.5 * axis.step * axis.len as f64 * folds as f64)
}

#[test]
fn radars_have_the_figures_of_their_files() {
    for (PresetInfo { name, .. }, sensor, text) in radars() {
        let (spec, beams, radar) = (sensor.spec(), sensor.beams(), radar(&sensor));
        beams.check().unwrap();
        let expected = sensor.expectations().unwrap_or_else(|| panic!("{name} has no section expect"));
        let transmitters = radar.array.tx.len();
        let axes = radar.waveform.axes(transmitters);

        // Data sheets round, angles to one or two digits; and wavelengths are those at the start of a ramp or in its
        // middle.
        let tolerances = if expected.source == "computed" { [0.01; 3] } else { [0.01, 0.04, 0.1] };
        let compare = |what: &str, found: Option<f64>, expected: Option<f64>, tolerance: f64| {
            let Some(expected) = expected else { return };
            let found = found.unwrap_or_else(|| panic!("{name} has no {what}"));
            assert_near(&format!("{name}: {what}"), found, expected, tolerance * expected);
        };
        assert!(expected.range_m.is_some(), "{name} has no range_m");
        compare("range", spec.range.max_m, expected.range_m, 0.0);
        compare("range resolution", Some(range_resolution(radar)), expected.range_resolution_m, tolerances[0]);
        compare("unambiguous velocity", unambiguous(radar), expected.velocity_m_s, tolerances[1]);
        compare("velocity resolution", Some(axes.velocity.step), expected.velocity_resolution_m_s, tolerances[1]);
        // A rotating antenna has a beam of its own, which transmits and receives.
        let of_antenna = radar.array.rx_pattern.azimuth_deg.filter(|_| matches!(spec.pattern, Pattern::RadarRotor(_)));
        let azimuth = of_antenna.or_else(|| radar_beam(radar, 0));
        compare("azimuth resolution", azimuth, expected.azimuth_resolution_deg, tolerances[2]);
        compare("elevation resolution", radar_beam(radar, 1), expected.elevation_resolution_deg, tolerances[2]);

        // What it reports it also samples, and one frame ends before the next begins.
        let sampled = axes.range.first + axes.range.step * axes.range.len as f64;
        assert!(
            spec.range.min_m > 0.0 && spec.range.max_m.unwrap() <= sampled,
            "{name}: {:?}, {sampled} m",
            spec.range
        );
        let each = beams.period / beams.len() as f64;
        let duration = radar.waveform.duration(transmitters);
        assert!(duration <= each, "{name}: a frame takes {duration} s of {each}");
        // Noise alone: less than one false alarm a frame, or a turn.
        let cells = axes.range.len * axes.velocity.len * beams.len();
        assert!(radar.detection.pfa * cells as f64 <= 1.0, "{name}: {cells} cells");
        // Makers publish neither losses nor chirps.
        assert!(unverified(&text).contains(&"radar"), "{name}: power and chirps need a word");
        let written = sensor.to_yaml().unwrap();
        assert_eq!(Sensor::from_yaml(&written, "").unwrap().spec(), spec, "{written}");
    }
}

/// A flat plate of metal that faces the radar has a radar cross-section of `4 pi A^2 / lambda^2` (Knott, Shaeffer, Tuley
/// 2004, "Radar cross section", 5.3). What a radar detects at its range is at half the level of another target twice as
/// far to the power of four, -12 dB.
#[test]
fn radars_detect_at_their_ranges() {
    for (PresetInfo { name, .. }, sensor, _) in radars() {
        let expected = sensor.expectations().unwrap();
        let range = 0.95 * expected.range_m.unwrap();
        let wavelength = radar(&sensor).waveform.wavelength();
        let near = 2.0 * range_resolution(radar(&sensor));
        // Frames, of so many, in which a target of `rcs` m^2 is detected.
        let seen = |rcs: f64, frames: u32| {
            let side = (wavelength * (rcs / (4.0 * std::f64::consts::PI)).sqrt()).sqrt();
            let mut scene = SceneBuilder::new();
            let metal = scene.material(Material::from_yaml("name: metal").unwrap());
            scene.stand(Shape::plate(DVec3::X * range, -DVec3::X, 0.5 * side), Some(metal));
            let scene = scene.finish().build().unwrap();
            let in_frame = |frame: &u32| {
                let options =
                    ScanOptions::default().seed(7).frame(*frame).fields(FieldSet::parse("range,cause").unwrap());
                let cloud = scene.scan(&sensor, &Trajectory::fixed(Pose::IDENTITY), &options).unwrap();
                let columns = cloud.columns();
                (0..cloud.len()).any(|row| {
                    columns.cause[row] != Cause::FalseAlarm as u8
                        && (f64::from(columns.range[row]) - range).abs() < near
                })
            };
            (0..frames).filter(in_frame).count()
        };
        let strong = seen(expected.rcs_m2.unwrap_or(10.0), 4);
        assert!(strong >= 3, "{name}: detected in {strong} of 4 frames at {range} m");
        if let Some(rcs) = expected.rcs_m2 {
            assert_eq!(seen(rcs / 16.0, 2), 0, "{name}: at {range} m it detects what should be lost in noise");
        }
    }
}

/// A row of the table of radars in docs/instruments.md.
fn radar_row(name: &str, sensor: &Sensor, text: &str) -> String {
    let (spec, radar, beams) = (sensor.spec(), radar(sensor), sensor.beams());
    let digits = |value: f64| {
        let scale = 10f64.powf(2.0 - value.abs().log10().floor());
        ((value * scale).round() / scale).to_string()
    };
    let or_none = |value: Option<f64>| value.map_or(String::new(), digits);
    let view = match &spec.pattern {
        Pattern::Radar(view) => {
            [view.azimuth_deg, view.elevation_deg].map(|[least, most]| digits(most - least)).join(" x ")
        }
        _ => "turns".to_owned(),
    };
    let transmitters = radar.array.tx.len();
    let elements = format!("{transmitters} x {}", radar.array.rx.len());
    let widths = match &spec.pattern {
        Pattern::Radar(_) => [radar_beam(radar, 0), radar_beam(radar, 1)],
        _ => [radar.array.rx_pattern.azimuth_deg, radar.array.rx_pattern.elevation_deg],
    };
    let widths: Vec<String> = widths.into_iter().flatten().map(digits).collect();
    let velocity = radar.waveform.axes(transmitters).velocity;
    let steps = (velocity.len > 1).then_some(velocity.step);
    let range = format!("{} to {}", spec.range.min_m, spec.range.max_m.unwrap());
    format!(
        "| `{name}` | {} | {elements} | {view} | {} | {range} | {} | {} | {} | {} | {} |\n",
        digits(1e-9 * radar.waveform.frequency()),
        widths.join(" x "),
        digits(range_resolution(radar)),
        or_none(unambiguous(radar)),
        or_none(steps),
        digits(1.0 / beams.period),
        unverified(text).join(", ")
    )
}

#[test]
fn the_table_of_radars_is_up_to_date() {
    let table: String = radars().map(|(preset, sensor, text)| radar_row(&preset.name, &sensor, &text)).collect();
    assert_in_document("docs/instruments.md", &table);
}

/// A row of the table in docs/materials.md.
fn material_row(material: &Material) -> String {
    let name = &material.name;
    let file = echocast_tests::root().join(format!("presets/material/{name}.yaml"));
    let text = std::fs::read_to_string(file).unwrap();
    let spread = text.lines().find_map(|line| line.strip_prefix("spread: ")).unwrap();
    let spread: f64 = spread.split_whitespace().next().unwrap().parse().unwrap();
    let reflectance = material.reflectance.as_ref().unwrap();
    let values = [532.0, 905.0, 940.0, 1064.0, 1550.0].map(|nm| format!("{:.2}", reflectance.at(nm)));
    // Lines of comments are about other sections.
    let typical = text.lines().any(|line| !line.starts_with('#') && line.contains("# unverified"));
    let typical = if typical { "*" } else { "" };
    format!("| `{name}` | {} | {spread:.2} | {typical} |\n", values.join(" | "))
}

#[test]
fn the_table_of_materials_is_up_to_date() {
    let table: String = Material::all_in_library().map(material_row).collect();
    assert_in_document("docs/materials.md", &table);
}
