//! Sonars in the profiles of the paper and of its program: the program's output, line by line, and laws.

use super::assert_near;
use echocast::scene::Material;
use echocast::{
    BuiltScene, Engine, Environment, FieldSet, Frame, PointCloud, Pose, Profile, ScanOptions, Sensor, Trajectory,
};
use echocast_tests::reference::{SceneBuilder, Shape};
use glam::DVec3;

const RUN: &str = include_str!("../data/sonar/blainder_sonar_run.txt");

/// Hits of the program's run agree with ours to this, m, and levels to that, dB: its printed precision, and more than
/// single precision leaves.
const NEAR_M: f64 = 1e-2;
const NEAR_DB: f64 = 1e-3;

/// The lines below the heading of the run that starts with `name`.
fn section(name: &str) -> Vec<&'static str> {
    let heading = format!("--- {name} ");
    let lines = RUN.lines().skip_while(|line| !line.starts_with(&heading)).skip(1);
    let lines: Vec<_> = lines.take_while(|line| !line.starts_with("---")).collect();
    assert!(!lines.is_empty(), "no section {name}");
    lines
}

/// The number right after `key` in `line`.
#[track_caller]
fn after(line: &str, key: &str) -> f64 {
    let (_, rest) = line.split_once(key).unwrap_or_else(|| panic!("no {key:?} in {line:?}"));
    let rest = rest.trim_start().trim_start_matches('(');
    let end = rest.find(|c: char| !(c.is_ascii_digit() || "+-.".contains(c))).unwrap_or(rest.len());
    rest[..end].parse().unwrap_or_else(|_| panic!("no number after {key:?} in {line:?}"))
}

/// Plates at given heights, wide enough for any ray, each with its alpha: what the program uses as the reflectance.
fn plates(plates: &[(f64, f32)]) -> BuiltScene {
    let mut scene = SceneBuilder::new();
    for &(height, alpha) in plates {
        let material = Material::default().base_color([1.0, 1.0, 1.0, alpha]);
        let paint = scene.material(material);
        scene.stand(Shape::plate(DVec3::Z * height, DVec3::Z, 1000.0), Some(paint));
    }
    scene.finish().build().unwrap()
}

/// The paper's two fans, with the program's start values.
fn fans(fov_deg: f64, step_deg: f64) -> Sensor {
    let yaml = format!(
        "
name: fans
kind: sonar
pattern: {{type: sidescan, down_fov_deg: {fov_deg}, step_deg: {step_deg}}}
acoustics:
  frequency_khz: 200
  pulse_ms: 0.1
  source_level_db: 200
  noise_level_db: 50
  directivity_index_db: 20
  processing_gain_db: 10
  detection_threshold_db: 10
range: {{max_m: 1000}}
"
    );
    Sensor::from_yaml(&yaml, "").unwrap()
}

fn set(mut sensor: Sensor, key: &str, value: &str) -> Sensor {
    sensor.set(key, value).unwrap();
    sensor
}

/// Water of layers: depth of the top, speed and density of each.
fn layers(layers: &[[f64; 3]]) -> Environment {
    let row = |[depth, speed, density]: &[f64; 3]| {
        format!("{{depth_m: {depth}, speed_m_s: {speed}, density_kg_m3: {density}}}")
    };
    let rows = layers.iter().map(row).collect::<Vec<_>>().join(", ");
    Environment::from_yaml(&format!("water: {{profile: {{layers: [{rows}]}}}}")).unwrap()
}

fn options(profile: Profile, environment: Environment) -> ScanOptions {
    ScanOptions::default().fields(FieldSet::all()).profile(profile).environment(environment)
}

/// A sonar below the water's surface at z = 0 that drives along y: starboard is x.
fn at_depth(depth: f64) -> Trajectory {
    Trajectory::fixed(Pose::at(0.0, 0.0, -depth).with_rpy_deg(0.0, 0.0, 90.0))
}

fn scan(scene: &BuiltScene, sensor: &Sensor, depth: f64, options: &ScanOptions) -> PointCloud {
    scene.scan(sensor, &at_depth(depth), options).unwrap()
}

fn as_program(scene: &BuiltScene, sensor: &Sensor, depth: f64, environment: Environment) -> PointCloud {
    scan(scene, sensor, depth, &options(Profile::Blainder, environment))
}

/// Rows of a side: the program starts with starboard.
fn side(cloud: &PointCloud, channel: u16) -> Vec<usize> {
    (0..cloud.len()).filter(|&row| cloud.columns().channel()[row] == channel).collect()
}

const PORT: u16 = 0;
const STARBOARD: u16 = 1;

fn both_sides(cloud: &PointCloud) -> Vec<usize> {
    [side(cloud, STARBOARD), side(cloud, PORT)].concat()
}

/// What the program prints as the level: its ratio times the source level of the sonar.
fn printed_level(cloud: &PointCloud, row: usize, source_level: f64) -> f64 {
    f64::from(cloud.columns().intensity()[row]) * source_level
}

fn range(cloud: &PointCloud, row: usize) -> f64 {
    cloud.columns().range()[row].into()
}

#[track_caller]
fn assert_place(line: &str, is: DVec3, expected: [f64; 2]) {
    assert_near(&format!("x of {line:?}"), is.x, expected[0], NEAR_M);
    assert_near(&format!("y of {line:?}"), is.y, 0.0, NEAR_M);
    assert_near(&format!("z of {line:?}"), is.z, expected[1], NEAR_M);
}

/// Errata A and B1: `10 log r` each way.
#[test]
fn the_programs_run_a_isovelocity() {
    let cloud = as_program(&plates(&[(-100.0, 1.0)]), &fans(150.0, 15.0), 0.0, Environment::default());
    let (lines, rows) = (section("A"), both_sides(&cloud));
    assert_eq!(rows.len(), lines.len());
    for (line, row) in lines.into_iter().zip(rows) {
        let (distance, level) = (range(&cloud, row), printed_level(&cloud, row, 200.0));
        assert_near(line, distance, after(line, " d="), NEAR_M);
        assert_near(line, level, after(line, "level="), NEAR_DB);
        assert_place(line, cloud.position(row), [after(line, "loc=("), -100.0]);
        // 20 dB of noise minus gains.
        assert_near(line, (180.0 - level) / 2.0, after(line, "TLoneway="), NEAR_DB);
        assert_near(line, 10.0 * distance.log10(), after(line, "10logr="), NEAR_DB);
        assert_near(line, 20.0 * distance.log10(), after(line, " 20logr="), NEAR_DB);
    }
}

/// B2: the reflectance multiplies the level.
#[test]
fn the_programs_run_b_reflectance() {
    let cloud = as_program(&plates(&[(-100.0, 0.5)]), &fans(150.0, 15.0), 0.0, Environment::default());
    let (lines, rows) = (section("B"), side(&cloud, STARBOARD));
    assert!(rows.len() >= lines.len());
    for (line, row) in lines.into_iter().zip(rows) {
        assert_near(line, printed_level(&cloud, row, 200.0), after(line, "level="), NEAR_DB);
        assert_near(line, range(&cloud, row), after(line, "distance"), NEAR_M);
    }
    // Below 0 dB darker is louder. Levels down to -50 dB were printed, so the threshold was below.
    for line in section("B2") {
        let alpha = line.split(' ').next().unwrap().parse().unwrap();
        let sensor = set(fans(150.0, 15.0), "acoustics.source_level_db", "60");
        let sensor = set(set(sensor, "acoustics.noise_level_db", "100"), "acoustics.detection_threshold_db", "-100");
        let cloud = as_program(&plates(&[(-100.0, alpha)]), &sensor, 0.0, Environment::default());
        let rows = side(&cloud, STARBOARD);
        assert_eq!(rows.len(), 6);
        for (expected, row) in line.split('\'').skip(1).step_by(2).zip(rows) {
            assert_near(line, printed_level(&cloud, row, 60.0), expected.parse().unwrap(), NEAR_DB);
        }
    }
}

/// Six layers; densities do not affect the path of a ray.
fn six_layers() -> Environment {
    let rows = [[0.0, 1520.0], [10.0, 1500.0], [25.0, 1487.0], [45.0, 1475.0], [70.0, 1490.0], [95.0, 1510.0]];
    layers(&rows.map(|[depth, speed]| [depth, speed, 1025.0]))
}

/// B6: the path to each interface is that of the first direction. The paper's equations follow Snell's law.
#[test]
fn the_programs_run_c_six_layers() {
    let (scene, sensor) = (plates(&[(-120.0, 1.0)]), fans(180.0, 5.0));
    let program = as_program(&scene, &sensor, 55.0, six_layers());
    let paper = scan(&scene, &sensor, 55.0, &options(Profile::Paper, six_layers()));
    let lines = section("C");
    let (last, lines) = lines.split_last().unwrap();
    let rows = side(&program, STARBOARD);
    assert_eq!(rows.len() as f64, after(last, "hits on this side:"));
    // 19 rays per side, port first; the others are lost.
    assert_eq!(program.columns().beam()[rows[0]], 19);
    let find = |cloud: &PointCloud, ray: u32| {
        let row = (0..cloud.len()).find(|&row| cloud.columns().beam()[row] == 19 + ray).unwrap();
        let [x, z] = [cloud.columns().true_x()[row], cloud.columns().true_z()[row]].map(f64::from);
        DVec3::new(x, 0.0, z) + DVec3::new(cloud.origin.x, 0.0, cloud.origin.z)
    };
    for line in lines {
        let ray = ((90.0 - after(line, "launch")) / 5.0) as u32;
        let (found, exact) = (find(&program, ray), find(&paper, ray));
        assert_place(line, found, [after(line, "hit at range"), -120.0]);
        assert_place(line, exact, [after(line, "exact Snell"), -120.0]);
        assert_near(line, found.x - exact.x, after(line, "error"), 2.0 * NEAR_M);
    }
}

/// B4 and B5: a layer without contrast changes the level, and the transmitted part of the power multiplies it.
#[test]
fn the_programs_run_d_interface() {
    let scene = plates(&[(-100.0, 1.0)]);
    let of = |density| {
        as_program(&scene, &fans(150.0, 25.0), 10.0, layers(&[[0.0, 1500.0, 1000.0], [50.0, 1500.0, density]]))
    };
    let (same, denser) = (of(1000.0), of(1020.0));
    let lines = section("D");
    assert_eq!((lines.len(), side(&same, STARBOARD).len(), side(&denser, STARBOARD).len()), (8, 4, 4));
    for (index, line) in lines.into_iter().enumerate() {
        let cloud = if line.starts_with("no contrast") { &same } else { &denser };
        let row = side(cloud, STARBOARD)[index % 4];
        assert_near(line, range(cloud, row), after(line, "path="), NEAR_M);
        assert_near(line, printed_level(cloud, row, 200.0), after(line, "level="), NEAR_DB);
        if line.contains("whole path") {
            assert_near(line, 180.0 - 20.0 * range(cloud, row).log10(), after(line, "whole path"), NEAR_DB);
        }
    }
}

/// B8: what is too weak is not a hit, so the ray goes on behind it where there are layers.
#[test]
fn the_programs_run_e_weak_targets() {
    let scene = plates(&[(-30.0, 0.02), (-100.0, 1.0)]);
    let of = |environment| as_program(&scene, &fans(50.0, 25.0), 10.0, environment);
    let lines = section("E");
    assert_eq!(of(Environment::default()).len() as f64, after(lines[0], "n hits"));
    let cloud = of(layers(&[[0.0, 1500.0, 1000.0], [50.0, 1500.0, 1000.0]]));
    let rows = side(&cloud, STARBOARD);
    assert_eq!(rows.len(), lines.len() - 1);
    for (line, row) in lines[1..].iter().zip(rows) {
        // One place is printed.
        assert_near(line, range(&cloud, row), after(line, "hit bottom"), 0.05 + NEAR_M);
        assert_near(line, cloud.position(row).z, -100.0, NEAR_M);
    }
}

/// B7: rays are lost at total reflection.
#[test]
fn the_programs_run_f_total_reflection() {
    let environment = layers(&[[0.0, 1450.0, 1000.0], [50.0, 1700.0, 1000.0]]);
    let cloud = as_program(&plates(&[(-100.0, 1.0)]), &fans(178.0, 11.125), 10.0, environment);
    let (lines, rows) = (section("F"), both_sides(&cloud));
    assert_eq!(rows.len() as f64, after(lines[0], "n hits"));
    assert_eq!(rows.len(), lines.len() - 1);
    for (line, row) in lines[1..].iter().zip(rows) {
        assert_near(line, range(&cloud, row), after(line, "path"), NEAR_M);
        assert_place(line, cloud.position(row), [after(line, "loc"), -100.0]);
    }
}

/// B9: points are where the surface is. What the program calls the place with noise, here none, is the path along the
/// last direction, given by the incidence on a flat bottom.
#[test]
fn the_programs_run_g_places() {
    let environment = layers(&[[0.0, 1500.0, 1000.0], [50.0, 1400.0, 1000.0]]);
    let cloud = as_program(&plates(&[(-100.0, 1.0)]), &fans(150.0, 25.0), 10.0, environment);
    let (lines, rows) = (section("G"), side(&cloud, PORT));
    assert_eq!(rows.len(), lines.len());
    for (line, row) in lines.into_iter().zip(rows) {
        let (path, cos) = (range(&cloud, row), f64::from(cloud.columns().cos_incidence()[row]));
        assert_near(line, path, after(line, "path"), NEAR_M);
        let pair = |key| {
            let rest = line.split_once(key).unwrap().1;
            [after(rest, ""), after(rest, ",")]
        };
        assert_place(line, cloud.position(row), pair("true hit"));
        let along = DVec3::new(-(1.0 - cos * cos).sqrt(), 0.0, -cos);
        assert_place(line, DVec3::Z * -10.0 + path * along, pair("zero noise"));
    }
}

#[test]
fn the_programs_run_has_no_other_sections() {
    let names: Vec<_> = RUN.lines().filter_map(|line| line.strip_prefix("--- ")?.split(' ').next()).collect();
    assert_eq!(names, ["A", "B", "B2", "C", "D", "E", "F", "G"]);
}

/// A flat bottom of reflectance `reflectance` at z = -100.
fn bottom(reflectance: f32) -> BuiltScene {
    let mut scene = SceneBuilder::new();
    let paint = scene.reflector(reflectance);
    scene.stand(Shape::plate(DVec3::Z * -100.0, DVec3::Z, 1000.0), Some(paint));
    scene.finish().build().unwrap()
}

/// Eq. 6 with spherical spreading and `TS = 10 log(reflectance)`, and the threshold at its level.
#[test]
fn the_paper_has_the_sonar_equation() {
    let sensor = fans(150.0, 15.0);
    let of = |sensor: &Sensor, reflectance| {
        scan(&bottom(reflectance), sensor, 0.0, &options(Profile::Paper, Environment::default()))
    };
    let cloud = of(&sensor, 0.1);
    assert_eq!((cloud.len(), cloud.intensity_full_scale), (12, None));
    for row in 0..cloud.len() {
        let angle = (f64::from(cloud.columns().beam()[row] % 6) * 15.0).to_radians();
        let path = 100.0 / angle.cos();
        assert_near("range", range(&cloud, row), path, 1e-3);
        let level = 200.0 - 40.0 * path.log10() - 10.0 - 50.0 + 20.0 + 10.0;
        assert_near("level", cloud.columns().intensity()[row].into(), level, 1e-4);
        assert_near("incidence", cloud.columns().cos_incidence()[row].into(), angle.cos(), 1e-5);
    }
    // Straight down 90 dB arrive, at 45 degrees 6 dB less.
    let sensor = set(sensor, "acoustics.detection_threshold_db", "83.9");
    assert_eq!(side(&of(&sensor, 0.1), PORT).len(), 4);
    assert_eq!(of(&sensor, 0.0).len(), 0);
    // What the sonar does not specify is 0.
    let keys = ["noise_level_db", "directivity_index_db", "processing_gain_db"];
    let text = sensor.to_yaml().unwrap();
    let text: Vec<_> = text.lines().filter(|line| !keys.iter().any(|key| line.contains(key))).collect();
    let cloud = of(&Sensor::from_yaml(&text.join("\n"), "").unwrap(), 1.0);
    assert_near("level", cloud.columns().intensity()[0].into(), 120.0, 1e-4);
}

/// For the paper, unlike its program (run D), a layer like the one above changes nothing.
#[test]
fn in_the_paper_a_layer_without_contrast_changes_nothing() {
    let (scene, sensor) = (bottom(0.3), fans(150.0, 5.0));
    let water = layers(&[[0.0, 1500.0, 1000.0]]);
    let parted = layers(&[[0.0, 1500.0, 1000.0], [50.0, 1500.0, 1000.0]]);
    let [whole, parted] = [water, parted].map(|it| scan(&scene, &sensor, 10.0, &options(Profile::Paper, it)));
    assert_eq!(whole.len(), 32);
    assert_eq!(format!("{:?}", whole.columns()), format!("{:?}", parted.columns()));
}

/// Straight down `-10 log` of eq. 13, once.
#[test]
fn the_paper_loses_at_interfaces_on_one_way() {
    let (scene, sensor) = (bottom(1.0), fans(50.0, 25.0));
    let of = |rows: &[[f64; 3]]| scan(&scene, &sensor, 10.0, &options(Profile::Paper, layers(rows)));
    let water = of(&[[0.0, 1500.0, 1000.0]]);
    let interface = of(&[[0.0, 1500.0, 1000.0], [50.0, 1650.0, 1300.0]]);
    let (here, there): (f64, f64) = (1500.0 * 1000.0, 1650.0 * 1300.0);
    let loss = -10.0 * (4.0 * here * there / (here + there).powi(2)).log10();
    assert_near("range", range(&interface, 0), 90.0, 1e-4);
    let [water, interface] = [water, interface].map(|cloud| f64::from(cloud.columns().intensity()[0]));
    assert!(loss > 0.1);
    assert_near("loss", water - interface, loss, 5e-5);
}

/// Section 3.3: the path lies in the direction in which the ray left; the truth is beside it.
#[test]
fn the_papers_points_lie_along_the_beams_that_were_sent() {
    let (scene, sensor) = (bottom(1.0), fans(150.0, 25.0));
    let environment = layers(&[[0.0, 1500.0, 1000.0], [50.0, 1400.0, 1000.0]]);
    for coordinates in [Frame::World, Frame::Sensor] {
        let options = options(Profile::Paper, environment.clone()).coordinates(coordinates);
        let cloud = scan(&scene, &sensor, 10.0, &options);
        for row in side(&cloud, STARBOARD) {
            let angle = (f64::from(cloud.columns().beam()[row] % 4) * 25.0).to_radians();
            let refracted = (angle.sin() * 1400.0 / 1500.0).asin();
            let path = 40.0 / angle.cos() + 50.0 / refracted.cos();
            let aside = 40.0 * angle.tan() + 50.0 * refracted.tan();
            assert_near("path", range(&cloud, row), path, 1e-3);
            assert_near("true path", cloud.columns().true_range()[row].into(), path, 1e-3);
            let truth = [cloud.columns().true_x(), cloud.columns().true_y(), cloud.columns().true_z()]
                .map(|it| f64::from(it[row]));
            let truth = DVec3::from(truth) + cloud.origin;
            let [found, truth] = [cloud.position(row), truth].map(|it| match coordinates {
                Frame::World => DVec3::new(it.x, it.z + 10.0, it.y),
                Frame::Sensor => DVec3::new(-it.y, it.z, it.x),
            });
            assert!((found - path * DVec3::new(angle.sin(), -angle.cos(), 0.0)).length() < 1e-2, "{found}");
            assert!((truth - DVec3::new(aside, -90.0, 0.0)).length() < 1e-2, "{truth}");
            assert_near("elevation", cloud.columns().elevation()[row].into(), angle - 90f64.to_radians(), 1e-5);
        }
    }
}

/// A ray 5 degrees down is reflected at 70 m depth, 171.45 m away, and meets a wall on its way up; the program loses
/// it.
#[test]
fn total_reflection_is_the_papers() {
    let mut scene = SceneBuilder::new();
    let paint = scene.reflector(1.0);
    scene.stand(Shape::plate(DVec3::new(300.0, 0.0, -60.0), DVec3::X, 55.0), Some(paint));
    let scene = scene.finish().build().unwrap();
    let yaml = "
name: ahead
kind: sonar
pattern: {type: single_beam, beam_deg: 7, tilt_deg: 5}
acoustics: {frequency_khz: 200, pulse_ms: 0.1}
range: {max_m: 400}
";
    let sensor = Sensor::from_yaml(yaml, "").unwrap();
    let pose = Trajectory::fixed(Pose::at(0.0, 0.0, -55.0));
    let of = |profile| scene.scan(&sensor, &pose, &options(profile, six_layers())).unwrap();
    let (paper, program) = (of(Profile::Paper), of(Profile::Blainder));
    assert_eq!((paper.len(), program.len()), (1, 0));
    let tan = 5f64.to_radians().tan();
    assert_near(
        "depth",
        -f64::from(paper.columns().true_z()[0]) - paper.origin.z,
        70.0 - (300.0 - 15.0 / tan) * tan,
        1e-3,
    );
    assert_near("path", range(&paper, 0), 300.0 * (1.0 + tan * tan).sqrt(), 1e-3);
    assert_near("level", paper.columns().intensity()[0].into(), 210.0 - 40.0 * range(&paper, 0).log10(), 1e-3);
}

/// Rays that find nothing within the ranges keep their rows.
#[test]
fn clouds_can_be_organised() {
    let sensor = set(set(fans(150.0, 15.0), "range.max_m", "142"), "range.min_m", "103");
    for profile in [Profile::Paper, Profile::Blainder] {
        let options = options(profile, Environment::default()).organised(true);
        let cloud = scan(&bottom(0.5), &sensor, 0.0, &options);
        assert_eq!((cloud.len(), cloud.organised()), (12, Some([2, 6])));
        let found: Vec<_> = cloud.columns().range().iter().map(|range| !range.is_nan()).collect();
        let one_side = [false, true, true, true, false, false];
        assert_eq!(found, [one_side, one_side].concat());
        assert_eq!(cloud.columns().beam(), (0..12).collect::<Vec<_>>());
        assert_eq!(cloud.columns().category_id()[..3], [0, 1, 1]);
        assert!(cloud.columns().x()[0].is_nan() && cloud.columns().intensity()[5].is_nan());
    }
}

/// Where the program's 2D modes put points: x, y of a straight line per ping at the way from the start, or the lines in
/// plan. The path is that of the first direction (see run C), each sine that of Snell's law.
#[test]
fn the_programs_points_lie_in_one_plane() {
    let scene = plates(&[(-120.0, 1.0)]);
    let water = layers(&[[0.0, 1500.0, 1000.0], [60.0, 1450.0, 1000.0]]);
    let keys = [
        Pose::at(100.0, 200.0, -10.0).with_rpy_deg(0.0, 0.0, 90.0),
        Pose::at(97.0, 204.0, -10.0).with_rpy_deg(4.0, 0.0, 120.0),
        Pose::at(103.0, 212.0, -11.0).with_rpy_deg(0.0, 8.0, 70.0),
        Pose::at(100.0, 203.0, -11.0).with_rpy_deg(-5.0, 3.0, -100.0),
    ];
    let ways = [0.0, 5.0, 154f64.sqrt(), 10f64.sqrt()];
    let track = Trajectory::new((0..4).map(f64::from).zip(keys).collect()).unwrap();
    let scan = |flat: Option<&str>, start_time: f64| {
        let sensor = flat.map_or(fans(120.0, 15.0), |flat| set(fans(120.0, 15.0), "pattern.flat", flat));
        let options = options(Profile::Blainder, water.clone()).start_time(start_time);
        scene.scan(&sensor, &track, &options).unwrap()
    };
    for (time, (pose, way)) in (0..).map(f64::from).zip(keys.into_iter().zip(ways)) {
        let [space, waterfall, plan] = [None, Some("waterfall"), Some("plan")].map(|flat| scan(flat, time));
        assert_eq!(space.len(), 10);
        for row in 0..space.len() {
            let ray = space.columns().beam()[row];
            let side = if ray < 5 { 1.0 } else { -1.0 };
            let tilt = (1e-3 + f64::from(ray % 5) * 59.999 / 4.0).to_radians();
            let sent = pose.orientation * DVec3::new(0.0, side * tilt.sin(), -tilt.cos());
            let upper = (pose.position.z + 60.0) / -sent.z;
            let sine = sent.truncate().length() * 1450.0 / 1500.0;
            let path = upper + 60.0 / (1.0 - sine * sine).sqrt();
            let across = DVec3::new(sent.x, sent.y, 0.0).normalize();
            let line = DVec3::new(-side * path, way, -10.0);
            for (cloud, expected) in [(&waterfall, line), (&plan, pose.position + path * across)] {
                let found = cloud.position(row);
                assert!((found - expected).length() < 2e-3, "ray {ray} at {time} s: {found}, not {expected}");
                // All else is as in space.
                assert_near("range", range(cloud, row), path, 1e-3);
                let truth = |cloud: &PointCloud| [cloud.columns().true_x()[row], cloud.columns().true_z()[row]];
                assert_eq!(truth(cloud), truth(&space));
                assert_eq!(cloud.columns().intensity()[row], space.columns().intensity()[row]);
            }
            assert_near("z", space.position(row).z, -120.0, NEAR_M);
        }
    }
}

#[test]
fn threads_change_nothing() {
    let sensor = fans(170.0, 0.01);
    let clouds = [1, 3].map(|threads| {
        let mut scene = SceneBuilder::new();
        let paint = scene.reflector(0.5);
        scene.stand(Shape::sphere(30.0, 20).and(Shape::plate(DVec3::Z * -120.0, DVec3::Z, 900.0)).flat(), Some(paint));
        let scene = scene.finish().build_with(&Engine::with_threads(threads).unwrap()).unwrap();
        [Profile::Paper, Profile::Blainder].map(|profile| scan(&scene, &sensor, 55.0, &options(profile, six_layers())))
    });
    for (one, three) in clouds[0].iter().zip(&clouds[1]) {
        assert!(one.len() > 10_000);
        assert_eq!(format!("{:?}", one.columns()), format!("{:?}", three.columns()));
    }
}

/// One ray for each beam of a swath; the levels of the paper and of the program straight down.
#[test]
fn other_sonars_send_a_ray_along_each_beam() {
    for (name, beams) in [("mbes_400", 256), ("sbes_200", 1)] {
        let sensor = Sensor::preset(name).unwrap();
        let cloud = scan(&bottom(0.5), &sensor, 80.0, &options(Profile::Paper, Environment::default()));
        assert_eq!(cloud.len(), beams);
        assert_eq!(cloud.columns().channel()[cloud.len() - 1] as usize, beams - 1);
        assert_near("depth", cloud.position(0).z, -100.0, 1e-3);
    }
}

/// The preset of the paper in all three profiles, in the water of their kind.
#[test]
fn the_papers_sonar_works_in_every_profile() {
    let sensor = Sensor::preset("generic_sonar").unwrap();
    let scene = bottom(0.5);
    let water = || Environment::from_yaml("water: {surface_z_m: -40}").unwrap();
    let of = |profile| scan(&scene, &sensor, 60.0, &options(profile, water()));
    let (physical, paper, program) = (of(Profile::Physical), of(Profile::Paper), of(Profile::Blainder));
    assert_eq!((paper.len(), program.len()), (46, 46));
    assert!(physical.len() > 10, "{}", physical.len());
    for cloud in [&physical, &paper, &program] {
        assert!(cloud.columns().category_id().iter().all(|&category| category <= 1));
        assert!((0..cloud.len()).any(|row| (cloud.position(row).z + 100.0).abs() < 0.5));
    }
    // The alpha of a surface without one is 1, but its own reflectance counts.
    assert_near("ratio", program.columns().intensity()[0].into(), 0.5 * (180.0 - 20.0 * 40f64.log10()) / 200.0, 1e-5);
    let ping = scene.ping(&sensor, &at_depth(60.0), &options(Profile::Paper, water()));
    assert!(ping.unwrap_err().to_string().starts_with("profile is paper"));
}

#[test]
fn errors_say_what_is_allowed() {
    let (scene, sensor) = (bottom(0.5), fans(90.0, 2.0));
    let message = |profile, water: &str, depth| {
        let environment = Environment::from_yaml(&format!("water: {{{water}}}")).unwrap();
        let scanned = scene.scan(&sensor, &at_depth(depth), &options(profile, environment));
        scanned.unwrap_err().to_string()
    };
    let cast = "profile: {cast: [{depth_m: 0, speed_m_s: 1500}, {depth_m: 50, speed_m_s: 1490}]}";
    assert!(message(Profile::Blainder, cast, 10.0).starts_with("water.profile is cast; allowed: layers or constant"));
    for profile in [Profile::Paper, Profile::Blainder] {
        assert!(message(profile, "surface_z_m: -20", 10.0).starts_with("the depth of the sonar is -10 m"));
    }
}

#[test]
fn points_in_one_plane_are_the_programs_alone() {
    let (scene, sensor) = (bottom(0.5), set(fans(90.0, 2.0), "pattern.flat", "plan"));
    let message = |options: ScanOptions| {
        let scanned = scene.scan(&sensor, &at_depth(10.0), &options);
        scanned.unwrap_err().to_string()
    };
    for profile in [Profile::Physical, Profile::Paper] {
        let expected = format!("pattern.flat is given; allowed: with profile blainder only, not {}", profile.name());
        assert_eq!(message(options(profile, Environment::default())), expected);
    }
    let turned = options(Profile::Blainder, Environment::default()).coordinates(Frame::Sensor);
    assert!(message(turned).starts_with("coordinates is sensor; allowed: world with pattern.flat"));
}

/// Both derive speeds by Medwin's formula, whatever the water specifies, and know no laws of sediments.
#[test]
fn warnings_are_those_of_their_own_water() {
    let sensor = fans(90.0, 20.0);
    let scene = bottom(0.5);
    let told = |profile: Profile, keys: &str| {
        let environment = Environment::from_yaml(&format!("water: {{{keys}}}")).unwrap();
        let report = scene.check_water(&sensor, &at_depth(10.0), &options(profile, environment)).unwrap();
        report.warnings.join("; ")
    };
    for profile in [Profile::Paper, Profile::Blainder] {
        assert_eq!(told(profile, "salinity_psu: 5"), "");
        let warm = "the speed of sound is that of medwin, for temperature 40 C (valid for 0 to 35 C)";
        assert_eq!(told(profile, "temperature_c: 40"), warm);
    }
    assert!(told(Profile::Physical, "salinity_psu: 5").starts_with("the speed of sound is that of mackenzie"));
}

/// The terms of a ray add up to the level of its point: as levels in the paper, times the reflectance in the program.
#[test]
fn rays_are_explained_term_by_term() {
    let scene = plates(&[(-60.0, 0.25)]);
    let environment = layers(&[[0.0, 1480.0, 1000.0], [30.0, 1520.0, 1030.0]]);
    let sensor = set(fans(100.0, 5.0), "acoustics.detection_threshold_db", "-100");
    for profile in [Profile::Paper, Profile::Blainder] {
        let options = options(profile, environment.clone()).organised(true);
        let cloud = scene.scan(&sensor, &at_depth(5.0), &options).unwrap();
        let mut seen = 0;
        for ray in 0..cloud.len() {
            let text = scene.explain(&sensor, &at_depth(5.0), &options, ray as u32).unwrap();
            assert!(text.starts_with(&format!("ray {ray} of {} of fans in the profile ", cloud.len())), "{text}");
            let level = f64::from(cloud.columns().intensity()[ray]);
            if level.is_nan() {
                continue;
            }
            seen += 1;
            let term = |name: &str| after(text.lines().find(|line| line.contains(name)).unwrap(), name);
            let own = term("source level")
                + term("spreading")
                + term("noise level")
                + term("directivity index")
                + term("processing gain");
            let (sum, found) = if profile == Profile::Paper {
                (own + term("interfaces (eq. 13)") + term("target strength"), level)
            } else {
                (own * term("times the reflectance"), level * term("source level"))
            };
            assert_near(&text, sum, found, 0.05);
            assert_near(&text, term("echo level"), found, 0.02);
            assert_near("way", after(&text, ", after "), cloud.columns().range()[ray].into(), 1e-3);
        }
        assert!(seen > 10, "{seen}");
        let beyond = scene.explain(&sensor, &at_depth(5.0), &options, 10_000).unwrap_err().to_string();
        assert!(beyond.starts_with("beam is 10000; allowed: 0 to "), "{beyond}");
    }
    // Nothing in reach is a sentence, too.
    let text =
        scene.explain(&set(sensor, "range.max_m", "20"), &at_depth(5.0), &options(Profile::Paper, environment), 0);
    assert!(text.unwrap().ends_with("it hits nothing from 0 to 20 m\n"));
}
