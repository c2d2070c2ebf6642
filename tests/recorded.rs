//! Scans recorded with the paper's system (BLAINDER range scanner 7842360 in Blender 3.4.1), compared with the same
//! rays in the same scenes under profile `blainder`.
//!
//! The recordings are searched in `reference/scans` of the folder named by the environment variable `ECHOCAST_SHARED`,
//! else of `../shared` beside the repository; without them these tests are listed as ignored.

use echocast::{Cause, Field, FieldSet, PointCloud, Pose, Profile, ScanOptions, Scene, Sensor, Trajectory};
use echocast_tests::reference::{Table, sensor};
use flate2::read::GzDecoder;
use glam::DVec3;
use serde_json::Value;
use std::collections::HashMap;
use std::fs::{self, File};
use std::io::Read;
use std::path::Path;

/// A point of a recording.
struct Point {
    category: String,
    part: String,
    position: DVec3,
    /// Range of a `rotating` recording, depth of a `static` one, m.
    distance: f64,
    intensity: f64,
    /// Linear base colour.
    rgb: [f64; 3],
}

/// A recording and its scene.
struct Recording {
    scene: Scene,
    points: Vec<Point>,
    /// The `parameters` of the program.
    parameters: Value,
    /// The sensor's pose, x along the view.
    pose: Pose,
}

impl Recording {
    /// The recording called `case` in the scene file called `scene`.
    fn find(case: &str, scene: &str) -> Recording {
        let folder = Path::new(env!("RECORDED_SCANS"));
        let about: Value =
            serde_json::from_str(&fs::read_to_string(folder.join(format!("{case}.json"))).unwrap()).unwrap();
        let names = |kind: &str| -> HashMap<u64, String> {
            let table = about["labels"][kind].as_object().unwrap();
            table.iter().map(|(name, number)| (number.as_u64().unwrap(), name.clone())).collect()
        };
        let (categories, parts) = (names("categoryID"), names("partID"));

        let mut text = String::new();
        let file = File::open(folder.join(format!("{case}.csv.gz"))).unwrap();
        GzDecoder::new(file).read_to_string(&mut text).unwrap();
        let table = Table::parse(&text, ';');
        let points = (0..table.len())
            .map(|row| {
                let number = |column| table.number(row, column);
                Point {
                    category: categories[&(number("categoryID") as u64)].clone(),
                    part: parts[&(number("partID") as u64)].clone(),
                    position: DVec3::new(number("X"), number("Y"), number("Z")),
                    distance: number("distance"),
                    intensity: number("intensity"),
                    rgb: ["red", "green", "blue"].map(number),
                }
            })
            .collect();

        let scene = Scene::load(folder.join(scene)).unwrap();
        let pose = scene.camera("Sensor").unwrap().pose;
        // The same pose as in the recording: a camera that looks along its -z with y up.
        let entry = |row: usize, column: usize| about["sensor"]["matrix_world"][row][column].as_f64().unwrap();
        let axis = |column: usize| DVec3::new(entry(0, column), entry(1, column), entry(2, column));
        assert!((pose.position - axis(3)).length() < 1e-6);
        assert!((pose.orientation * DVec3::X + axis(2)).length() < 1e-6);
        assert!((pose.orientation * DVec3::Z - axis(1)).length() < 1e-6);
        Recording { scene, points, parameters: about["parameters"].clone(), pose }
    }

    /// The beam to each point, in the sensor's frame.
    fn directions(&self) -> Vec<DVec3> {
        let to_sensor = self.pose.orientation.inverse();
        self.points.iter().map(|point| to_sensor * (point.position - self.pose.position).normalize()).collect()
    }

    fn scan(&self, sensor: &Sensor) -> PointCloud {
        let options = ScanOptions::default().fields(FieldSet::all()).organised(true).profile(Profile::Blainder);
        self.scene.build().unwrap().scan(sensor, &Trajectory::fixed(self.pose), &options).unwrap()
    }
}

/// sRGB byte (IEC 61966-2-1) to linear 0..1.
fn linear(byte: u8) -> f64 {
    let encoded = f64::from(byte) / 255.0;
    if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

/// How many of `rows` differ from their points, by quantity; `column` is what the recording calls distance.
fn differences(cloud: &PointCloud, points: &[Point], rows: &[usize], column: Field) -> HashMap<&'static str, usize> {
    let c = cloud.columns();
    let mut wrong = HashMap::new();
    let name = |table: &echocast::scene::NameTable, id: u32| table.name(id).unwrap_or("").to_owned();
    for &row in rows {
        let point = &points[row];
        let mut count = |what: &'static str, right: bool| *wrong.entry(what).or_insert(0) += usize::from(!right);
        // Written so that NaN, a miss, fails too.
        count("distance", (cloud.column(column).get_f64(row) - point.distance).abs() <= 1e-3);
        count("position", (cloud.position(row) - point.position).length() <= 1e-3);
        count("category", name(&cloud.labels.category, c.category_id()[row]) == point.category);
        count("part", name(&cloud.labels.part, c.part_id()[row]) == point.part);
        count("intensity", (f64::from(c.intensity()[row]) - point.intensity).abs() <= 1e-4);
        let rgb = [c.red()[row], c.green()[row], c.blue()[row]].map(linear);
        // A step of 8 bits in sRGB is at most 0.009 in linear light.
        count("colour", rgb.iter().zip(point.rgb).all(|(is, expected)| (is - expected).abs() <= 0.005));
    }
    wrong
}

/// Checks that at most one of 1000 rows differs in anything.
#[track_caller]
fn check(case: &str, wrong: &HashMap<&'static str, usize>, rows: usize) {
    eprintln!("{case}: {rows} points, of which differ: {wrong:?}");
    for (what, &count) in wrong {
        assert!(count * 1000 <= rows, "{case}: {what} of {count} of {rows} points differs");
    }
}

#[test]
#[cfg_attr(not(recorded), ignore = "there are no recorded scans; ECHOCAST_SHARED names where they are")]
fn a_square_is_scanned_as_recorded() {
    for (case, count) in [("a_quad_10x10", 100), ("a_quad_100x100", 10_000)] {
        let recording = Recording::find(case, "a_quad.glb");
        assert_eq!(recording.points.len(), count);
        let cloud = recording.scan(&sensor(&recording.directions()));
        let rows: Vec<usize> = (0..count).collect();
        check(case, &differences(&cloud, &recording.points, &rows, Field::Depth), count);
    }
}

#[test]
#[cfg_attr(not(recorded), ignore = "there are no recorded scans; ECHOCAST_SHARED names where they are")]
fn chairs_are_scanned_as_recorded() {
    let recording = Recording::find("e_chairs", "e_chairs.glb");
    assert_eq!(recording.points.len(), 159_488);
    let cloud = recording.scan(&sensor(&recording.directions()));
    let rows: Vec<usize> = (0..recording.points.len()).collect();
    check("e_chairs", &differences(&cloud, &recording.points, &rows, Field::Depth), rows.len());
}

/// What is seen directly, and what is seen in the mirror: along the beam at the length of the path, from which the
/// program omits the millimetre by which it starts behind the mirror; with the label of the mirror, which for us is
/// that of the first surface.
#[test]
#[cfg_attr(not(recorded), ignore = "there are no recorded scans; ECHOCAST_SHARED names where they are")]
fn a_mirror_is_scanned_as_recorded() {
    let mut recording = Recording::find("f_mirror_rotating", "f_mirror.glb");
    assert_eq!(recording.points.len(), 3683);
    let directions = recording.directions();
    let cloud = recording.scan(&sensor(&directions));
    let (direct, mirrored): (Vec<usize>, Vec<usize>) =
        (0..cloud.len()).partition(|&row| cloud.columns().bounces()[row] == 0);
    assert!(direct.len() > 1000 && mirrored.len() > 1000, "{} direct, {} mirrored", direct.len(), mirrored.len());
    check("f_mirror_rotating, direct", &differences(&cloud, &recording.points, &direct, Field::Range), direct.len());

    for &row in &mirrored {
        let (point, beam) = (&mut recording.points[row], directions[row]);
        point.distance += 1e-3;
        point.position += recording.pose.orientation * beam * 1e-3;
        let first = cloud.columns().first_category_id()[row];
        assert_eq!(cloud.labels.category.name(first), Some("mirror"));
        assert_eq!(cloud.columns().cause()[row], Cause::Mirror as u8);
    }
    let wrong = differences(&cloud, &recording.points, &mirrored, Field::Range);
    eprintln!("mirrored: {wrong:?}");
    for what in ["distance", "position", "intensity"] {
        assert!(wrong[what] * 1000 <= mirrored.len(), "{what}: {wrong:?}");
    }
}

/// The greatest angle between each of `directions` and the nearest beam of `beams`, rad. Both are in the same order, so
/// that the search only goes forwards.
fn greatest_angle(sensor: &Sensor, directions: &[DVec3]) -> f64 {
    let beams = sensor.beams();
    let mut beam = 0;
    let mut greatest = 0.0f64;
    for direction in directions {
        let angle = |beam: usize| {
            let own = DVec3::new(beams.dir_x[beam].into(), beams.dir_y[beam].into(), beams.dir_z[beam].into());
            own.cross(*direction).length().atan2(own.dot(*direction))
        };
        // A third of a pixel is certainly this one.
        let pixel = angle_between_columns(sensor);
        while angle(beam) > pixel / 3.0 {
            beam += 1;
            assert!(beam < beams.len(), "no beam of the pattern points along {direction}");
        }
        greatest = greatest.max(angle(beam));
    }
    greatest
}

/// Angle between the two beams in the middle of the first row, rad.
fn angle_between_columns(sensor: &Sensor) -> f64 {
    let beams = sensor.beams();
    let middle = beams.columns as usize / 2;
    let direction =
        |beam: usize| DVec3::new(beams.dir_x[beam].into(), beams.dir_y[beam].into(), beams.dir_z[beam].into());
    direction(middle).cross(direction(middle + 1)).length()
}

/// The program uses the ratio of the two angles of view as the ratio of the image's sides: 70 x 60 degrees become 70 x
/// 61.9425.
#[test]
#[cfg_attr(not(recorded), ignore = "there are no recorded scans; ECHOCAST_SHARED names where they are")]
fn the_kinect_pattern_of_the_paper_is_the_recorded_one() {
    let recording = Recording::find("e_chairs", "e_chairs.glb");
    let kinect = Sensor::preset("kinect_v2_paper").unwrap();
    let parameter = |name: &str| recording.parameters[name].as_f64().unwrap();
    let (width, height) = (parameter("fovX"), parameter("fovY"));
    let really = 2.0 * ((0.5 * width).to_radians().tan() * height / width).atan().to_degrees();
    assert!((really - 61.9425).abs() < 1e-3);
    // Recorded column by column from the left, each from the top; ours are row by row.
    let mut directions = recording.directions();
    let row = |d: &DVec3| ((1.0 - d.z / d.x / (0.5 * really).to_radians().tan()) * 423.0 / 2.0).round() as u32;
    directions.sort_by_key(row);
    let off = greatest_angle(&kinect, &directions);
    assert!(off < 1e-5, "{off} rad");

    // The preset then sees exactly the recorded points.
    let cloud = recording.scan(&kinect);
    let returns = cloud.columns().range().iter().filter(|range| range.is_finite()).count();
    let share = returns as f64 / recording.points.len() as f64;
    assert!((share - 1.0).abs() < 1e-3, "{returns} returns of {} points", recording.points.len());
}

/// The rotating patterns: steps of azimuth and elevation according to the parameters.
#[test]
#[cfg_attr(not(recorded), ignore = "there are no recorded scans; ECHOCAST_SHARED names where they are")]
fn recorded_rotating_beams_lie_on_an_even_grid() {
    let recording = Recording::find("f_mirror_rotating", "f_mirror.glb");
    let parameter = |name: &str| recording.parameters[name].as_f64().unwrap();
    let yaml = format!(
        "name: rotating\nkind: lidar\npattern: {{type: spinning, azimuth: {{fov_deg: {}, rate_hz: {}, step_deg: {}}}, \
         elevation: {{fov_deg: {}, step_deg: {}}}}}\n",
        parameter("fovX"),
        parameter("rotationsPerSecond"),
        parameter("xStepDegree"),
        parameter("fovY"),
        parameter("yStepDegree")
    );
    let rotating = Sensor::from_yaml(&yaml, "").unwrap();
    assert_eq!(rotating.beams().len(), 9801);
    let beams = rotating.beams();
    let own: Vec<DVec3> = (0..beams.len())
        .map(|beam| DVec3::new(beams.dir_x[beam].into(), beams.dir_y[beam].into(), beams.dir_z[beam].into()))
        .collect();
    let mut off = Vec::new();
    for direction in recording.directions().iter().step_by(37) {
        let nearest = own.iter().map(|beam| beam.cross(*direction).length()).fold(f64::MAX, f64::min);
        off.push(nearest);
    }
    let greatest = off.iter().copied().fold(0.0, f64::max);
    assert!(greatest < 1e-5, "{greatest} rad");
}
