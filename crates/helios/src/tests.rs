//! Surveys of our own making: one for each habit of HELIOS++, compared with its documentation, or with directions computed
//! from its own description.

use crate::{HeliosOptics, Import, ImportOutcome};
use emitter::pattern::Pattern;
use glam::{DQuat, DVec3};
use ground::pose::Pose;
use ground::read::yaml;
use serde_json::Value;
use std::fs;
use std::path::PathBuf;
use tempfile::TempDir;

const SCANNERS: &str = r#"<?xml version="1.0"?>
<document>
  <scanner id="panorama" name="Panorama" optics="rotating" accuracy_m="0.005" beamDivergence_rad="0.0003"
      headRotatePerSecMax_deg="60" pulseFreqs_Hz="100000,300000" pulseLength_ns="5" rangeMin_m="1.5"
      scanAngleMax_deg="120" scanAngleEffectiveMax_deg="50" scanFreqMin_Hz="3" scanFreqMax_Hz="120">
    <FWFSettings beamSampleQuality="3"/>
    <beamOrigin x="0" y="0" z="0.2"/>
    <headRotateAxis x="0" y="0" z="1"/>
  </scanner>
  <scanner id="upended" optics="rotating" headRotatePerSecMax_deg="500" pulseFreqs_Hz="100000" scanAngleMax_deg="180"
      scanAngleEffectiveMax_deg="150" scanFreqMax_Hz="12000">
    <beamOrigin z="0.2"><rot axis="x" angle_deg="90"/></beamOrigin>
  </scanner>
  <scanner id="polygon" optics="rotating" pulseFreqs_Hz="50000,100000" pulseLength_ns="4" rangeMin_m="30"
      scanAngleMax_deg="45" scanAngleEffectiveMax_deg="22.5" scanFreqMin_Hz="10" scanFreqMax_Hz="160"/>
  <scanner id="swinging" optics="oscillating" pulseFreqs_Hz="70000" scanAngleMax_deg="37.5" scanFreqMax_Hz="90"
      scanProduct="1000"/>
  <scanner id="conical" optics="conic" pulseFreqs_Hz="200000,400000" scanAngleMax_deg="20" scanFreqMax_Hz="80"/>
  <scanner id="fibres" optics="line" pulseFreqs_Hz="83000" scanAngleMax_deg="7.5" numFibers="127"/>
  <scanner id="puck" optics="rotating" headRotatePerSecMax_deg="7200" pulseFreqs_Hz="18750" scanAngleMax_deg="1"
      scanAngleEffectiveMax_deg="1">
    <channels>
      <channel id="0"><beamOrigin><rot axis="x" angle_deg="-15"/></beamOrigin></channel>
      <channel id="1"><beamOrigin><rot axis="x" angle_deg="1"/></beamOrigin></channel>
      <channel id="2"><beamOrigin><rot axis="x" angle_deg="15"/><rot axis="z" angle_deg="2"/></beamOrigin></channel>
    </channels>
  </scanner>
  <scanner id="pair" optics="oscillating" pulseFreqs_Hz="70000" scanAngleMax_deg="30" scanFreqMax_Hz="90">
    <channels>
      <channel id="0"><beamOrigin><rot axis="y" angle_deg="14"/></beamOrigin></channel>
      <channel id="1" scanAngleMax_deg="5" wavelength_nm="532">
        <beamOrigin y="0.5"><rot axis="y" angle_deg="-14"/></beamOrigin></channel>
    </channels>
  </scanner>
  <scanner id="prisms" optics="risley" pulseFreqs_Hz="40000" rotorFreq1_Hz="10.5" rotorFreq2_Hz="-51.6"
      angle1_deg="-27.6" angle2_deg="29.6" refrIndex1="1.51" refrIndex2="1.51" refrIndex_air="1.0">
    <channels>
      <channel id="0"><incidentBeam x="-0.02" y="0.9998" z="0"/></channel>
      <channel id="1"><incidentBeam x="0.03" y="0.99955" z="0"/></channel>
    </channels>
  </scanner>
</document>"#;

const PLATFORMS: &str = r#"<?xml version="1.0"?>
<document>
  <platform id="plane" name="Plane" type="linearpath">
    <scannerMount z="0.7"><rot axis="x" angle_deg="-90"/><rot axis="z" angle_deg="90"/></scannerMount>
  </platform>
  <platform id="car" type="linearpath">
    <scannerMount x="0.5" y="1" z="2" rotations="local"><rot axis="z" angle_deg="90"/><rot axis="y" angle_deg="-30"/></scannerMount>
  </platform>
  <platform id="bare" type="linearpath"/>
  <platform id="copter" type="multicopter" drag="0.01" engine_max_force="0.1"><scannerMount z="0.2"/></platform>
  <platform id="tripod" type="static"><scannerMount z="1.5"/></platform>
  <platform id="slanted" type="static"><scannerMount><rot axis="x" angle_deg="-30"/></scannerMount></platform>
</document>"#;

const SCENE: &str = r#"<document>
  <scene id="blocks" name="Blocks">
    <part id="7"><filter type="objloader"><param type="string" key="filepath" value="data/parts/ground.obj"/></filter>
      <filter type="scale"><param type="double" key="scale" value="100"/></filter>
      <filter type="translate"><param type="vec3" key="offset" value="0;0;3"/></filter></part>
    <part><filter type="objloader"><param type="string" key="filepath" value="data/parts/cube.obj"/>
        <param type="string" key="up" value="y"/></filter>
      <filter type="rotate"><param type="rotation" key="rotation"><rot axis="z" angle_deg="45"/></param></filter>
      <filter type="translate"><param type="vec3" key="offset" value="-40.0;-5;0"/></filter></part>
    <part><filter type="objloader"><param type="string" key="efilepath" value="data/parts/c.*\.obj"/></filter></part>
    <part><filter type="geotiffloader"><param type="string" key="filepath" value="data/hills.tif"/></filter></part>
  </scene>
</document>"#;

/// A folder with surveys in `data/surveys`, and all that they refer to.
struct World(TempDir);

impl World {
    fn new() -> World {
        let folder = tempfile::tempdir().unwrap();
        let world = World(folder);
        for (name, text) in [
            ("python/pyhelios/data/scanners.xml", SCANNERS),
            ("python/pyhelios/data/platforms.xml", PLATFORMS),
            ("data/scenes/scene.xml", SCENE),
            (
                "data/parts/ground.obj",
                "mtllib ground.mtl\nv 1 -1 0\nv -1 -1 0\nv 1 1 0\nv -1 1 0\nusemtl soil\nf 2 1 4\nf 1 3 4\n",
            ),
            (
                "data/parts/ground.mtl",
                "newmtl soil\nhelios_isGround true\nhelios_classification 2\nhelios_reflectance 0.3\nnewmtl unused\nhelios_reflectance 0.9\n",
            ),
            ("data/parts/cube.obj", "mtllib cube.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl wall\nf 1 2 3\n"),
            ("data/parts/cube.mtl", "newmtl wall\nhelios_spectra wood\n"),
            ("data/parts/cone.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
        ] {
            world.put(name, text);
        }
        world
    }

    fn put(&self, name: &str, text: &str) -> PathBuf {
        let path = self.0.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(&path, text).unwrap();
        path
    }

    /// Imports a survey with `legs` and what else is in it.
    fn import(&self, platform: &str, scanner: &str, legs: &str) -> Import {
        self.try_import(platform, scanner, legs).unwrap_or_else(|error| panic!("{error}"))
    }

    fn try_import(&self, platform: &str, scanner: &str, legs: &str) -> ground::error::Result<Import> {
        self.try_text(&format!(
            "<document>\n<scannerSettings id=\"fast\" active=\"true\" pulseFreq_hz=\"100000\" scanFreq_hz=\"50\"/>\n\
             <survey name=\"test\" scene=\"data/scenes/scene.xml#blocks\" platform=\"{platform}\" \
             scanner=\"data/scanners.xml#{scanner}\">\n{legs}\n</survey>\n</document>\n"
        ))
    }

    fn try_text(&self, text: &str) -> ground::error::Result<Import> {
        let path = self.put("data/surveys/test.xml", text);
        Import::load(path, &[self.0.path().to_owned()])
    }
}

/// A leg of a platform at a point.
fn leg(platform: &str, scanner: &str) -> String {
    format!("<leg><platformSettings {platform}/><scannerSettings {scanner}/></leg>\n")
}

fn of_sensor(import: &Import, sensor: usize) -> (Pattern, DQuat) {
    let pattern = &import.converted.sensors[sensor].1["pattern"];
    let pattern = Pattern::from_yaml(&yaml::to_string(pattern).unwrap()).unwrap();
    let rpy: Vec<f64> = import.converted.scenario["sensors"][sensor]["mount"]["rpy_deg"]
        .as_array()
        .map_or(vec![0.0; 3], |angles| angles.iter().map(|angle| angle.as_f64().unwrap()).collect());
    (pattern, Pose::IDENTITY.with_rpy_deg(rpy[0], rpy[1], rpy[2]).orientation)
}

/// Pose of the carrier at a time, s.
fn pose_at(import: &Import, time: f64) -> Pose {
    let keys = &import.converted.trajectory;
    let after = keys.partition_point(|(key, _)| *key <= time).clamp(1, keys.len() - 1);
    let ((t0, a), (t1, b)) = (keys[after - 1], keys[after]);
    let part = ((time - t0) / (t1 - t0)).clamp(0.0, 1.0);
    Pose { position: a.position.lerp(b.position, part), orientation: a.orientation.slerp(b.orientation, part) }
}

/// Times and directions in the world of the beams of the scan that begins at `start`, s.
fn world_beams(import: &Import, sensor: usize, start: f64) -> Vec<(f64, DVec3)> {
    let (pattern, mount) = of_sensor(import, sensor);
    let beams = pattern.beams(start).unwrap();
    let turned = |beam: usize| {
        let time = start + beams.time[beam];
        (time, pose_at(import, time).orientation * mount * beams.direction(beam).as_dvec3())
    };
    (0..beams.len()).map(turned).collect()
}

fn strips(import: &Import) -> &Vec<Value> {
    import.converted.scenario["strips"].as_array().unwrap()
}

fn turned(axis: DVec3, degrees: f64) -> DQuat {
    DQuat::from_axis_angle(axis, degrees.to_radians())
}

/// What became of an attribute, or of an element.
fn outcome<'i>(import: &'i Import, element: &str, attribute: &str) -> &'i ImportOutcome {
    let is_it =
        |note: &&crate::ImportNote| note.element == element && note.attribute.as_deref().unwrap_or("") == attribute;
    &import.notes.iter().find(is_it).unwrap_or_else(|| panic!("{element} {attribute}")).outcome
}

const STATION: &str = "headRotatePerSec_deg=\"10\" headRotateStart_deg=\"245\" headRotateStop_deg=\"360\"";

/// A panorama scanner at -40 to 60 degrees emits 41.6 % of its pulses: 100 of the 240 degrees that its mirror sweeps.
#[test]
fn pulses_leave_within_a_part_of_the_sweep() {
    let world = World::new();
    let settings = format!(
        "pulseFreq_hz=\"100000\" scanFreq_hz=\"120\" verticalAngleMin_deg=\"-40\" verticalAngleMax_deg=\"60\" {STATION}"
    );
    let import = world.import("data/platforms.xml#tripod", "panorama", &leg("x=\"-26\" y=\"-31\" z=\"0\"", &settings));
    let (pattern, _) = of_sensor(&import, 0);
    let Pattern::LineScan(scan) = &pattern else { panic!("{pattern:?}") };
    let emitted = scan.pulses() as f64 * scan.lines_hz / 100_000.0;
    assert!((emitted - 0.416).abs() < 1e-3, "{emitted}");
    // 115 degrees at 10 degrees a second are 11.5 s, and 1380 lines.
    assert_eq!((scan.lines(), strips(&import)[0]["to_s"].as_f64()), (1380, Some(11.5)));
    assert!(pose_at(&import, 1.0).position.distance(DVec3::new(-26.0, -31.0, 1.7)) < 1e-9);
    // By default, they leave within the effective angle, or within scanAngle if that is less.
    for (angle, half) in [("", 50.0), ("scanAngle_deg=\"20\"", 20.0), ("scanAngle_deg=\"300\"", 50.0)] {
        let import = world.import(
            "data/platforms.xml#tripod",
            "panorama",
            &leg("x=\"0\"", &format!("template=\"fast\" {angle} {STATION}")),
        );
        let window = &import.converted.sensors[0].1["pattern"]["mechanism"]["window_deg"];
        assert_eq!(*window, serde_json::json!([-half, half]));
    }
}

/// World directions of a station are those of HELIOS++: about the upright axis from y, its ahead, to the left, raised by
/// the angle of the mirror.
#[test]
fn heads_turn_from_where_they_start() {
    let world = World::new();
    for (scanner, raised) in [("panorama", 0.0), ("upended", 90.0)] {
        let settings = format!("pulseFreq_hz=\"100000\" scanFreq_hz=\"100\" {STATION}");
        let stations = leg("x=\"0\"", &settings).repeat(2);
        let import = world.import("data/platforms.xml#tripod", scanner, &stations);
        for strip in strips(&import) {
            let start = strip["from_s"].as_f64().unwrap();
            let (pattern, mount) = of_sensor(&import, 0);
            assert!(mount.angle_between(DQuat::IDENTITY) < 1e-9);
            let beams = pattern.beams(start).unwrap();
            for (time, direction) in
                world_beams(&import, 0, start).into_iter().take(2 * beams.columns as usize).step_by(97)
            {
                let head = turned(DVec3::Z, 245.0 + 10.0 * (time - start));
                // In the frame of the head, beams are in the plane of ahead and up.
                let own = head.inverse() * direction;
                assert!(own.x.abs() < 1e-5, "{own}");
                let angle = (own.z.atan2(own.y).to_degrees() - raised + 540.0).rem_euclid(360.0) - 180.0;
                let most = if scanner == "panorama" { 50.0 } else { 150.0 };
                assert!(angle.abs() <= most + 1e-3, "{angle}");
            }
        }
    }
}

/// Heads that turn backwards, or about another axis than the mirror's own, turn with the trajectory.
#[test]
fn other_heads_turn_the_carrier() {
    let world = World::new();
    let settings = "pulseFreq_hz=\"100000\" scanFreq_hz=\"100\" headRotatePerSec_deg=\"-10\" headRotateStart_deg=\"340\" \
                    headRotateStop_deg=\"220\"";
    let import = world.import("data/platforms.xml#slanted", "panorama", &leg("x=\"0\"", settings));
    assert!(import.converted.sensors[0].1["pattern"].get("head").is_none());
    let mount = turned(DVec3::X, -30.0);
    for start in [0.0, 3.7, 11.0] {
        for (time, direction) in world_beams(&import, 0, start).into_iter().step_by(131) {
            let head = turned(DVec3::Z, 340.0 - 10.0 * time);
            let own = (mount * head).inverse() * direction;
            assert!(own.x.abs() < 1e-4 && own.y > 0.0, "{own} at {time}");
        }
    }
}

/// An aircraft that flies east looks down, across its way; the last leg measures nothing, and inactive ones are turns.
#[test]
fn legs_are_strips() {
    let world = World::new();
    let fly = |x: f64, y: f64, active: bool| {
        leg(
            &format!("x=\"{x}\" y=\"{y}\" z=\"100\" movePerSec_m=\"30\""),
            &format!("template=\"fast\" active=\"{active}\""),
        )
    };
    let legs = [fly(-30.0, -50.0, true), fly(70.0, -50.0, false), fly(70.0, 0.0, true), fly(-30.0, 0.0, true)].concat();
    let import = world.import("data/platforms.xml#plane", "polygon", &legs);
    let strips = strips(&import);
    assert_eq!(strips.iter().map(|strip| strip["strip"].as_u64().unwrap()).collect::<Vec<_>>(), [1, 2]);
    let span = |strip: &Value| [strip["from_s"].as_f64().unwrap(), strip["to_s"].as_f64().unwrap()];
    let [[from, to], [later, end]] = [span(&strips[0]), span(&strips[1])];
    assert!((from, (to - 100.0 / 30.0).abs() < 1e-9) == (0.0, true));
    assert!((later - 150.0 / 30.0).abs() < 0.01 && (end - later - 100.0 / 30.0).abs() < 1e-9);
    // Offsets do not turn with the heading.
    assert!(pose_at(&import, from).position.distance(DVec3::new(-30.0, -50.0, 100.7)) < 1e-9);
    assert!(pose_at(&import, end).position.distance(DVec3::new(-30.0, 0.0, 100.7)) < 1e-6);
    // Ahead of the carrier is where it flies: east, then west.
    assert!((pose_at(&import, 1.0).orientation * DVec3::X).distance(DVec3::X) < 1e-9);
    assert!((pose_at(&import, end - 1.0).orientation * DVec3::X).distance(DVec3::NEG_X) < 1e-9);
    let (pattern, mount) = of_sensor(&import, 0);
    let Pattern::LineScan(scan) = &pattern else { panic!("{pattern:?}") };
    // A mount that looks down is that of a scanner across the flight, as people would have written it.
    assert!(mount.angle_between(DQuat::IDENTITY) < 1e-9);
    // 50 lines a second, of which 45 of 90 degrees are used: 1000 of 2000 pulses.
    assert_eq!((scan.lines_hz, scan.pulses()), (50.0, 1000));
    let widest = world_beams(&import, 0, 1.0).into_iter().map(|(_, beam)| {
        assert!(beam.x.abs() < 1e-5 && beam.z < 0.0, "{beam}");
        (beam.y / -beam.z).atan().to_degrees()
    });
    let widest = widest.fold([0.0_f64; 2], |[low, high], angle| [low.min(angle), high.max(angle)]);
    assert!((widest[0] + 22.5).abs() < 0.1 && (widest[1] - 22.5).abs() < 0.1, "{widest:?}");
}

/// Mounts: rotations are about fixed axes, or with rotations="local" about those already turned.
#[test]
fn mounts_turn_about_fixed_or_own_axes() {
    let world = World::new();
    let legs =
        [leg("x=\"0\" movePerSec_m=\"5\"", "template=\"fast\""), leg("x=\"0\" y=\"50\"", "template=\"fast\"")].concat();
    let import = world.import("data/platforms.xml#car", "polygon", &legs);
    // To the north, the axes of the platform are those of the world; y is ahead. Locally: first about z, then about the
    // turned y, which is -x of the platform.
    let mount = turned(DVec3::Z, 90.0) * turned(DVec3::Y, -30.0);
    for (_, direction) in world_beams(&import, 0, 1.0).into_iter().step_by(53) {
        let own = mount.inverse() * direction;
        assert!(own.x.abs() < 1e-5 && own.y > 0.9, "{own}");
    }
    // To the east, offsets of the mount stay as they are in the world.
    let legs = [leg("x=\"0\" movePerSec_m=\"5\"", "template=\"fast\""), leg("x=\"50\"", "template=\"fast\"")].concat();
    let import = world.import("data/platforms.xml#car", "polygon", &legs);
    assert!(pose_at(&import, 0.0).position.distance(DVec3::new(0.5, 1.0, 2.0)) < 1e-12);
}

/// Frequencies of swinging mirrors count periods, of two lines each, and are at most the scan product over the angle;
/// cones turn at their greatest frequency; fibres take turns.
#[test]
fn mirrors_have_the_habits_of_theirs() {
    let world = World::new();
    let fly = |scanner: &str, settings: &str| {
        let legs = [leg("x=\"0\" z=\"50\"", settings), leg("x=\"500\" z=\"50\"", settings)].concat();
        world.import("data/platforms.xml#plane", scanner, &legs)
    };
    let import = fly("swinging", "scanFreq_hz=\"50\" scanAngle_deg=\"15\"");
    let (pattern, _) = of_sensor(&import, 0);
    let Pattern::LineScan(scan) = &pattern else { panic!("{pattern:?}") };
    // 70 kHz, the first of the list where none is asked for, are 1400 pulses a period, 700 a line.
    assert_eq!((scan.lines_hz, scan.pulses(), scan.width_deg()), (100.0, 700, 30.0));
    let import = fly("swinging", "scanFreq_hz=\"50\" scanAngle_deg=\"25\"");
    let Pattern::LineScan(scan) = of_sensor(&import, 0).0 else { panic!() };
    assert_eq!(scan.lines_hz, 80.0);
    let import = fly("swinging", "scanFreq_hz=\"10\" scanAngle_deg=\"60\"");
    let Pattern::LineScan(scan) = of_sensor(&import, 0).0 else { panic!() };
    assert_eq!(scan.width_deg(), 75.0);
    assert!(matches!(outcome(&import, "scannerSettings", "scanAngle_deg"), ImportOutcome::Approximated(_)));
    let import = fly("conical", "pulseFreq_hz=\"400000\" scanFreq_hz=\"40\" scanAngle_deg=\"20\"");
    let Pattern::LineScan(scan) = of_sensor(&import, 0).0 else { panic!() };
    assert_eq!((scan.lines_hz, scan.pulses()), (80.0, 5000));
    assert!(world_beams(&import, 0, 1.0).iter().all(|(_, beam)| (beam.z + 20_f64.to_radians().cos()).abs() < 1e-6));
    let import = fly("fibres", "scanAngle_deg=\"5\"");
    let Pattern::LineScan(scan) = of_sensor(&import, 0).0 else { panic!() };
    assert_eq!(scan.pulses(), 127);
    // A rate that is not in the scanner's list is used, with a note.
    let import = fly("conical", "pulseFreq_hz=\"123456\"");
    assert!(matches!(outcome(&import, "scannerSettings", "pulseFreq_hz"), ImportOutcome::Approximated(_)));
    assert!(import.converted.sensors[0].1["pattern"].get("settings").is_none());
}

/// Steps along and across lines replace the rates of mirror and head.
#[test]
fn resolutions_replace_rates() {
    let world = World::new();
    let settings = "pulseFreq_hz=\"100000\" verticalResolution_deg=\"0.2\" horizontalResolution_deg=\"0.2\" \
                    headRotateStart_deg=\"-45\" headRotateStop_deg=\"45\"";
    let import = world.import("data/platforms.xml#tripod", "panorama", &leg("x=\"0\"", settings));
    let pattern = &import.converted.sensors[0].1["pattern"];
    // 100 kHz x 0.2 deg / 240 deg, and 0.2 deg a line.
    assert!((pattern["lines_hz"].as_f64().unwrap() - 83.333_333).abs() < 1e-5);
    assert!((pattern["head"]["rate_deg_s"].as_f64().unwrap() - 16.666_667).abs() < 1e-5);
}

/// Every channel fires at every step: a spinning sensor with an emitter for each.
#[test]
fn channels_of_turning_heads_spin() {
    let world = World::new();
    let settings = "scanFreq_hz=\"0\" headRotatePerSec_deg=\"3600\" headRotateStop_deg=\"3600\"";
    let import = world.import("data/platforms.xml#tripod", "puck", &leg("x=\"0\"", settings));
    assert_eq!((import.converted.sensors.len(), strips(&import)[0]["to_s"].as_f64()), (1, Some(1.0)));
    let (pattern, _) = of_sensor(&import, 0);
    let beams = pattern.beams(0.0).unwrap();
    // 18750 pulses a second of each of three channels, ten turns a second.
    assert_eq!((beams.rows, beams.columns), (3, 1875));
    let all = world_beams(&import, 0, 0.0);
    for (channel, rotation) in
        [turned(DVec3::X, -15.0), turned(DVec3::X, 1.0), turned(DVec3::Z, 2.0) * turned(DVec3::X, 15.0)]
            .into_iter()
            .enumerate()
    {
        for (time, direction) in all[channel * 1875..(channel + 1) * 1875].iter().step_by(311) {
            let expected = turned(DVec3::Z, 3600.0 * time) * rotation * DVec3::Y;
            assert!(direction.distance(expected) < 1e-4, "{direction} {expected}");
        }
    }
}

/// Refraction at a face with the normal `normal` (pointing along the light), from an index to another: Snell's law as
/// vectors.
fn refracted(light: DVec3, normal: DVec3, ratio: f64) -> DVec3 {
    let tangential = (light - normal * light.dot(normal)) * ratio;
    tangential + normal * (1.0 - tangential.length_squared()).sqrt()
}

/// Prisms bend beams as those of HELIOS++ do, whose tilted normals turn from up to right.
#[test]
fn prisms_turn_as_theirs() {
    let world = World::new();
    let legs = [leg("x=\"0\" movePerSec_m=\"5\"", ""), leg("x=\"0\" y=\"50\"", "")].concat();
    let import = world.import("data/platforms.xml#bare", "prisms", &legs);
    let HeliosOptics::Risley { prisms, .. } = &import.survey.scanner.channels[0].optics else { panic!() };
    assert_eq!(prisms.len(), 2);
    assert_eq!(import.converted.sensors.len(), 1);
    let beams = world_beams(&import, 0, 2.0);
    let count = beams.len() / 2;
    for (channel, incident) in [DVec3::new(-0.02, 0.9998, 0.0), DVec3::new(0.03, 0.99955, 0.0)].into_iter().enumerate()
    {
        for (time, direction) in beams[channel * count..(channel + 1) * count].iter().step_by(173) {
            let mut light = incident.normalize();
            for (wedge, turns) in [(-27.6_f64, 10.5), (29.6, -51.6)] {
                let (sin, cos) = wedge.abs().to_radians().sin_cos();
                let angle = std::f64::consts::TAU * turns * time;
                // From up to right; the outward normal against the light leans so for the first face, the one along it for
                // the second.
                let lean = DVec3::new(angle.sin(), 0.0, angle.cos()) * sin;
                let [first, second] =
                    if wedge > 0.0 { [DVec3::Y * cos - lean, DVec3::Y] } else { [DVec3::Y, DVec3::Y * cos + lean] };
                light = refracted(light, first, 1.0 / 1.51);
                light = refracted(light, second, 1.51);
            }
            assert!(direction.distance(light) < 1e-4, "{direction} {light} at {time}");
        }
    }
}

/// Interpolated platforms: angles as in ARINC 705 or about x, y and z; rows between times; columns by number or name.
#[test]
fn trajectories_are_read_by_row() {
    let world = World::new();
    let rows = "0 10 20 30 1 2 3\n1 12 20 32 4 2 3\n2 14 20 34 7 2 3\n2 0 0 0 0 0 50\n4 0 0 90 0 20 50\n";
    world.put("data/own.txt", rows);
    world.put(
        "data/own.trj",
        &format!(
            "#TIME_COLUMN: 0\n#HEADER: \"t\", \"roll\", \"pitch\", \"yaw\", \"x\", \"y\", \"z\"\n{}",
            rows.replace(' ', ",")
        ),
    );
    let about = |axis: DVec3, degrees: f64| turned(axis, degrees);
    for (canonical, attitude) in [
        (true, about(DVec3::X, 11.0) * about(DVec3::Y, 20.0) * about(DVec3::Z, 31.0)),
        (false, about(DVec3::NEG_Z, 31.0) * about(DVec3::Y, 11.0) * about(DVec3::X, 20.0)),
    ] {
        for file in
            ["trajectory=\"data/own.txt\" trajectory_separator=\" \" tIndex=\"0\"", "trajectory=\"data/own.trj\""]
        {
            let spec = if canonical { "CANONICAL" } else { "ARINC 705" };
            let legs = [
                leg(&format!("{file} tStart=\"0\" tEnd=\"2\""), "template=\"fast\""),
                leg(&format!("{} tStart=\"2\"", file.replace(" tIndex=\"0\"", "")), "template=\"fast\""),
            ];
            let platform = format!("interpolated\" basePlatform=\"data/platforms.xml#bare\" rotationSpec=\"{spec}");
            let import = world.import(&platform, "polygon", &legs.concat());
            let pose = pose_at(&import, 0.5);
            assert!(pose.position.distance(DVec3::new(2.5, 2.0, 3.0)) < 1e-9, "{}", pose.position);
            let expected = attitude * turned(DVec3::Z, 90.0);
            assert!(pose.orientation.angle_between(expected) < 1e-4, "{canonical} {file}");
            // Every leg measures, and the second begins where its rows do.
            let spans: Vec<f64> = strips(&import).iter().map(|strip| strip["from_s"].as_f64().unwrap()).collect();
            assert_eq!(spans.len(), 2);
            assert!(pose_at(&import, spans[1]).position.distance(DVec3::new(0.0, 0.0, 50.0)) < 0.1);
        }
    }
}

/// Multicopters: the speed grows and decays exponentially, up to force over drag; distance and time agree.
#[test]
fn multicopters_start_and_stop() {
    let world = World::new();
    for (speed, length) in [(5.0, 100.0), (50.0, 100.0), (8.0, 3.0)] {
        let legs = [
            leg(&format!("x=\"0\" z=\"9\" movePerSec_m=\"{speed}\""), "template=\"fast\""),
            leg(&format!("x=\"0\" y=\"{length}\" z=\"9\" movePerSec_m=\"{speed}\""), "template=\"fast\""),
        ];
        let import = world.import("data/platforms.xml#copter", "polygon", &legs.concat());
        let keys = &import.converted.trajectory;
        let end = strips(&import)[0]["to_s"].as_f64().unwrap();
        assert!((pose_at(&import, end).position.y - length).abs() < 1e-9);
        let speeds: Vec<f64> = keys
            .windows(2)
            .map(|pair| (pair[1].1.position.y - pair[0].1.position.y) / (pair[1].0 - pair[0].0))
            .collect();
        let top = speeds.iter().fold(0.0_f64, |top, speed| top.max(*speed));
        // Force over drag is 10 m/s.
        assert!(speeds.iter().all(|speed| *speed >= 0.0) && top <= f64::min(speed, 10.0) + 1e-6, "{speeds:?}");
        assert!(speeds[0] < 0.1 && speeds[speeds.len() - 1] < 0.2, "{speeds:?}");
        if length > 50.0 {
            // From 0.01 m/s at e^(2 t), and down to 0.1 m/s: ln(500) / 2 + ln(50) / 2 s of ramps for 5 m/s.
            let most = f64::min(speed, 10.0);
            let ramps = ((most / 0.01).ln() + (most / 0.1).ln()) / 2.0;
            let expected = ramps + (length - (most - 0.01) / 2.0 - (most - 0.1) / 2.0) / most;
            assert!((end - expected).abs() < 1e-6, "{end} {expected}");
        }
    }
    // A smooth turn keeps the speed, cuts the corner, and ends on the next leg.
    let point = |x: f64, y: f64| {
        leg(&format!("x=\"{x}\" y=\"{y}\" movePerSec_m=\"6\" smoothTurn=\"true\""), "template=\"fast\"")
    };
    let import = world.import(
        "data/platforms.xml#copter",
        "polygon",
        &[point(0.0, 0.0), point(0.0, 80.0), point(80.0, 80.0)].concat(),
    );
    for pair in import.converted.trajectory.windows(2) {
        let speed = pair[0].1.position.distance(pair[1].1.position) / (pair[1].0 - pair[0].0);
        assert!((speed - 6.0).abs() < 0.02, "{speed}");
        assert!(pair[0].1.orientation.angle_between(pair[1].1.orientation) < 0.11);
    }
    let corner = import
        .converted
        .trajectory
        .iter()
        .map(|(_, pose)| pose.position.truncate().distance(glam::DVec2::new(0.0, 80.0)));
    let nearest = corner.fold(f64::INFINITY, f64::min);
    assert!((0.5..6.0).contains(&nearest), "{nearest}");
}

/// Legs of one strip that follow each other without changes are one entry.
#[test]
fn strips_of_one_name_are_one() {
    let world = World::new();
    let fly = |x: f64, strip: &str, active: bool| {
        let settings = format!("template=\"fast\" active=\"{active}\"");
        leg(&format!("x=\"{x}\" z=\"50\" movePerSec_m=\"50\""), &settings)
            .replace("<leg>", &format!("<leg stripId=\"{strip}\">"))
    };
    let legs = [
        fly(0.0, "a", true),
        fly(100.0, "a", true),
        fly(200.0, "a", false),
        fly(300.0, "b", true),
        fly(400.0, "b", false),
    ];
    let import = world.import("data/platforms.xml#plane", "polygon", &legs.concat());
    let found: Vec<_> = strips(&import)
        .iter()
        .map(|strip| (strip["strip"].as_u64(), strip["from_s"].as_f64(), strip["to_s"].as_f64()))
        .collect();
    assert_eq!(found, [(Some(1), Some(0.0), Some(4.0)), (Some(2), Some(6.0), Some(8.0))]);
}

/// Parts are turned, scaled and moved; materials and classes are kept; the ground carries what stands on it.
#[test]
fn scenes_are_placed() {
    let world = World::new();
    let import = world.import(
        "data/platforms.xml#tripod",
        "panorama",
        &leg("x=\"9\" y=\"9\" z=\"77\" onGround=\"true\"", &format!("template=\"fast\" {STATION}")),
    );
    // The ground is at 3 m, the tripod 1.5 m and the beam another 0.2 m above it.
    assert!(pose_at(&import, 0.0).position.distance(DVec3::new(9.0, 9.0, 4.7)) < 1e-6);
    let scene = &import.converted.scenario["scene"];
    let place = scene["place"].as_array().unwrap();
    let of = |model: &Value, key: &str| model["at"][key].clone();
    assert_eq!(
        place.iter().map(|model| model["name"].as_str().unwrap()).collect::<Vec<_>>(),
        ["ground_7", "cube_1", "cone_2", "cube_2"]
    );
    assert_eq!((&place[0]["scale"], of(&place[0], "position_m")), (&100.0.into(), serde_json::json!([0.0, 0.0, 3.0])));
    // y up to z up is a quarter turn about x.
    assert_eq!(of(&place[1], "rpy_deg"), serde_json::json!([90.0, 0.0, 45.0]));
    assert_eq!((&place[0]["category"], &scene["labels"]["las_class"]["ground"]), (&"ground".into(), &2.into()));
    assert_eq!(scene["labels"]["surfaces"], serde_json::json!({"soil": {"reflectance": 0.3}, "wall": "wood"}));
    assert!(matches!(outcome(&import, "filter", ""), ImportOutcome::Used));
    let unread = import
        .notes
        .iter()
        .filter(|note| matches!(&note.outcome, ImportOutcome::NotUnderstood(why) if why.contains("terrain")));
    // The part, its filter and its param, with their attributes.
    assert_eq!(
        unread.map(|note| note.element.as_str()).collect::<Vec<_>>(),
        ["part", "filter", "filter", "param", "param", "param", "param"]
    );
}

/// Nothing is dropped silently: every attribute of what is read has a note, and what has no meaning says so.
#[test]
fn every_attribute_has_a_note() {
    let world = World::new();
    let legs = leg("x=\"0\" colour=\"red\"", &format!("template=\"fast\" {STATION} trajectoryTimeInterval_s=\"0.1\""))
        + "<weather rain=\"1\"/>";
    let import = world.import("data/platforms.xml#tripod", "panorama", &legs);
    for (element, attribute, used) in [
        ("platformSettings", "x", true),
        ("platformSettings", "colour", false),
        ("weather", "", false),
        ("weather", "rain", false),
        ("scannerSettings", "pulseFreq_hz", true),
        ("scanner", "accuracy_m", true),
    ] {
        assert_eq!(*outcome(&import, element, attribute) == ImportOutcome::Used, used, "{element} {attribute}");
    }
    let survey: Vec<_> = import.notes.iter().filter(|note| note.file.ends_with("test.xml")).collect();
    let attributes = survey.iter().filter(|note| note.attribute.is_some()).count();
    // Those of the template, of the survey (name, scene, platform, scanner), of the leg's settings, and the rain.
    assert_eq!(attributes, 4 + 4 + 2 + 5 + 1);
    let [used, approximated, unread] = import.counts();
    assert_eq!(used + approximated + unread, import.notes.len());
    assert!(import.summary().iter().any(|line| line.starts_with(
        "test.xml: line 4: <platformSettings colour> not understood: platformSettings colour is not known"
    )));
}

/// Templates: a leg's own settings count, then those of its template, which may have one, too.
#[test]
fn settings_come_from_templates() {
    let world = World::new();
    world.put(
        "data/settings.xml",
        "<document><scannerSettings id=\"slow\" scanFreq_hz=\"20\" pulseFreq_hz=\"300000\"/></document>",
    );
    let settings = format!("template=\"data/settings.xml#slow\" scanFreq_hz=\"40\" {STATION}");
    let import = world.import("data/platforms.xml#tripod", "panorama", &leg("x=\"0\"", &settings));
    let pattern = &import.converted.sensors[0].1["pattern"];
    assert_eq!((pattern["lines_hz"].as_f64(), pattern["pulse_rate_hz"].as_f64()), (Some(40.0), Some(300_000.0)));
}

/// Settings that change from leg to leg are changes of the strips.
#[test]
fn strips_change_settings() {
    let world = World::new();
    let station = |rate: u32| leg("x=\"0\"", &format!("template=\"fast\" pulseFreq_hz=\"{rate}\" {STATION}"));
    let import = world.import("data/platforms.xml#tripod", "panorama", &[station(100_000), station(300_000)].concat());
    let strips = strips(&import);
    assert_eq!(
        (strips[0].get("set"), &strips[1]["set"]),
        (None, &serde_json::json!({"pattern.pulse_rate_hz": 300_000.0}))
    );
    // Each begins where the head does.
    assert_eq!((strips[1]["from_s"].as_f64(), strips[1]["to_s"].as_f64()), (Some(23.0), Some(34.5)));
}

/// Files: a scenario, its sensors and trajectory, and the report; what is there is not overwritten.
#[test]
fn imports_are_written_once() {
    let world = World::new();
    let import =
        world.import("data/platforms.xml#tripod", "panorama", &leg("x=\"0\"", &format!("template=\"fast\" {STATION}")));
    let folder = world.0.path().join("out");
    let scenario = import.write(&folder).unwrap();
    let text = fs::read_to_string(scenario).unwrap();
    assert!(text.starts_with("# test, a survey of HELIOS++;") && text.contains("strip: 1"), "{text}");
    let read: Value = yaml::from_str("survey.yaml", &text).unwrap();
    let ends = |strips: &Value| (strips[0]["from_s"].as_f64(), strips[0]["to_s"].as_f64());
    assert_eq!(ends(&read["strips"]), ends(&import.converted.scenario["strips"]));
    let trajectory = emitter::Trajectory::load(folder.join("trajectory.csv")).unwrap();
    assert_eq!(trajectory.span(), (0.0, 11.5));
    assert!(folder.join("panorama.yaml").is_file());
    let report: Value = serde_json::from_slice(&fs::read(folder.join("report.json")).unwrap()).unwrap();
    assert_eq!(report["notes"].as_array().unwrap().len(), import.notes.len());
    let error = import.write(&folder).unwrap_err().to_string();
    assert!(error.ends_with("out: is there already; allowed: a new folder"), "{error}");
}

#[test]
fn errors_name_line_and_attribute() {
    let world = World::new();
    let tripod = "data/platforms.xml#tripod";
    let message = |legs: &str| world.try_import(tripod, "panorama", legs).unwrap_err().to_string();
    let ok = format!("template=\"fast\" {STATION}");
    for (legs, found) in [
        (String::new(), "line 3: survey has no leg; allowed: at least one"),
        ("<leg><platformSettings x=\"0\"/></leg>".into(), "line 4: leg has no scannerSettings"),
        (leg("x=\"here\"", &ok), "line 4: platformSettings x is \"here\"; allowed: a number"),
        (leg("x=\"NaN\"", &ok), "line 4: platformSettings x is \"NaN\"; allowed: a number"),
        (leg("x=\"1e300\"", &ok), "line 4: platformSettings x is \"1e300\"; allowed: -1000000000 to 1000000000"),
        (leg("onGround=\"maybe\"", &ok), "platformSettings onGround is \"maybe\"; allowed: true or false"),
        (
            leg("x=\"0\"", "template=\"fats\""),
            "line 4: scannerSettings template: there is no scannerSettings named \"fats\"; near: fast",
        ),
        (leg("x=\"0\"", "template=\"fast\""), "line 4: leg never ends; allowed: a head that turns, or maxDuration_s"),
        (
            leg("x=\"0\"", "template=\"fast\" headRotatePerSec_deg=\"5\" headRotateStart_deg=\"90\""),
            "line 4: leg turns its head by 5 degrees a second from 90 to 0; allowed: a stop that it turns to",
        ),
        (
            leg("x=\"0\"", &format!("{ok} verticalAngleMin_deg=\"30\" verticalAngleMax_deg=\"20\"")),
            "measures from 30 to 20 degrees",
        ),
        ("<leg>".into(), "line 5: is not well-formed XML"),
        (leg("x=\"0\"", &ok) + "&lol;", "line 5: is not well-formed XML"),
    ] {
        let message = message(&legs);
        assert!(message.contains(found) && !message.contains('\n'), "{message}\n{found}");
    }
    let plane =
        world.try_import("data/platforms.xml#plane", "panorama", &leg("x=\"0\"", "template=\"fast\"")).unwrap_err();
    assert!(plane.to_string().contains("the last leg of a moving platform measures nothing"), "{plane}");
    let slow = [leg("x=\"0\" movePerSec_m=\"0\"", "template=\"fast\""), leg("x=\"5\"", "")].concat();
    let slow = world.try_import("data/platforms.xml#plane", "polygon", &slow).unwrap_err();
    assert!(slow.to_string().contains("leg has movePerSec_m 0"), "{slow}");
    for (platform, scanner, found) in [
        (
            "../../../etc/passwd#x",
            "panorama",
            "platform: \"../../../etc/passwd\" leads out of the folder of the survey",
        ),
        ("/etc/passwd#x", "panorama", "leads out of the folder of the survey and of --assets"),
        ("data/none.xml#x", "panorama", "platform: \"data/none.xml\" is not in "),
        ("data/platforms.xml#tripot", "panorama", "there is no platform named \"tripot\"; near: tripod"),
        (tripod, "panoramas", "there is no scanner named \"panoramas\"; near: panorama"),
    ] {
        let error = world.try_import(platform, scanner, &leg("x=\"0\"", &ok)).unwrap_err().to_string();
        assert!(error.contains(found), "{error}\n{found}");
    }
}

#[test]
fn documents_made_to_do_harm_are_refused() {
    let world = World::new();
    let message = |text: &str| world.try_text(text).unwrap_err().to_string();
    let bomb =
        "<?xml version=\"1.0\"?>\n<!DOCTYPE x [<!ENTITY a \"aaaa\"><!ENTITY b \"&a;&a;\">]>\n<document>&b;</document>";
    assert!(message(bomb).contains("line 2: has a document type (DTD)"), "{}", message(bomb));
    let outside = "<!DOCTYPE x SYSTEM \"file:///etc/passwd\"><document/>";
    assert!(message(outside).contains("has a document type (DTD)"));
    let deep = format!("<document>{}", "<a>".repeat(200_000));
    assert!(message(&deep).contains("XML"), "{}", message(&deep));
    assert!(message("<document/>").contains("line 1: document has no survey in it"));
    assert!(message("").contains("is not well-formed XML"));
    let circle = format!(
        "<document>\n<scannerSettings id=\"a\" template=\"b\"/>\n<scannerSettings id=\"b\" template=\"a\"/>\n\
         <survey scene=\"data/scenes/scene.xml#blocks\" platform=\"data/platforms.xml#tripod\" \
         scanner=\"data/scanners.xml#panorama\">\n{}</survey></document>",
        leg("x=\"0\"", "template=\"a\"")
    );
    assert!(message(&circle).contains("template \"a\" leads back to itself"), "{}", message(&circle));
    let path = world.put("data/surveys/bytes.xml", "");
    fs::write(&path, b"<document>\n\xff</document>").unwrap();
    let error = Import::load(&path, &[]).unwrap_err().to_string();
    assert!(error.contains("line 2: is not UTF-8"), "{error}");
}

/// Without anything that is a mesh, there is nothing to scan.
#[test]
fn scenes_of_terrain_alone_are_refused() {
    let world = World::new();
    world.put(
        "data/scenes/scene.xml",
        "<document><scene id=\"blocks\">\n<part><filter type=\"geotiffloader\"><param type=\"string\" key=\"filepath\" \
         value=\"x.tif\"/></filter></part></scene></document>",
    );
    let error = world.try_import(
        "data/platforms.xml#tripod",
        "panorama",
        &leg("x=\"0\"", &format!("template=\"fast\" {STATION}")),
    );
    let error = error.unwrap_err().to_string();
    assert!(error.contains("scene has nothing but parts of geotiffloader, which are not read yet"), "{error}");
}

/// Channels with optics of their own are sensors side by side, which change alike from strip to strip.
#[test]
fn channels_are_sensors_side_by_side() {
    let world = World::new();
    let fly = |angles: [f64; 2]| {
        let legs = [angles[0], angles[1], 1.0].into_iter().enumerate().map(|(index, angle)| {
            let settings = format!("scanFreq_hz=\"50\" scanAngle_deg=\"{angle}\"");
            leg(&format!("x=\"{}\" z=\"50\" movePerSec_m=\"50\"", 100 * index), &settings)
        });
        world.try_import("data/platforms.xml#plane", "pair", &legs.collect::<String>())
    };
    let import = fly([4.0, 3.0]).unwrap();
    assert_eq!(import.converted.sensors.len(), 2);
    assert_eq!(import.converted.sensors[1].1["beam"]["wavelength_nm"], 532.0);
    // Ahead of the platform is x here.
    assert_eq!(import.converted.scenario["sensors"][1]["mount"]["position_m"], serde_json::json!([0.5, 0.0, 0.0]));
    assert_eq!(strips(&import)[1]["set"]["pattern.mechanism"]["half_deg"], 3.0);
    // Beams of the first look ahead or back by 14 degrees, as their plane is turned about theirs, ahead of the scanner.
    for (sensor, rotation) in [(0, 14.0), (1, -14.0)] {
        let mount = turned(DVec3::Z, 90.0) * turned(DVec3::X, -90.0) * turned(DVec3::Y, rotation);
        let platform = turned(DVec3::Z, -90.0);
        for (_, direction) in world_beams(&import, sensor, 0.5).into_iter().step_by(61) {
            let own = (platform * mount).inverse() * direction;
            assert!(own.x.abs() < 1e-5 && own.y > 0.99, "{own}");
        }
    }
    let error = fly([4.0, 20.0]).unwrap_err().to_string();
    assert!(error.contains("leg changes mechanism of its channels in different ways"), "{error}");
}
