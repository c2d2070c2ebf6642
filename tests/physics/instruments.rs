//! What every preset of light measures, beside what its sheet says.

use super::{farthest, mean_and_sigma, nothing, scan, scan_at, wall_all_around};
use echocast::detect::{Detection, Statistical};
use echocast::emitter::pattern::{Pattern, Pinhole, Spinning};
use echocast::generate::Landscape;
use echocast::{BuiltScene, Cause, Engine, PointCloud, Pose, PresetInfo, ScanOptions, Sensor, SensorKind};
use echocast_tests::assert_nearly_in_document;
use echocast_tests::reference::one_beam;

/// Points of surfaces in directions within 5 degrees of a camera's axis, or in all of a LiDAR's, and the beams there.
fn seen(cloud: &PointCloud, sensor: &Sensor) -> (Vec<f64>, usize) {
    let beams = sensor.beams();
    let counts = |beam: usize| sensor.kind() == SensorKind::Lidar || beams.dir_x[beam] > 5f32.to_radians().cos();
    let c = cloud.columns();
    let rows = (0..cloud.len()).filter(|&row| c.cause()[row] == Cause::Surface as u8 && counts(c.beam()[row] as usize));
    (rows.map(|row| c.range()[row].into()).collect(), (0..beams.len()).filter(|&beam| counts(beam)).count())
}

/// Reflectance and range of the line of the sheet; of a table, its last.
fn rated(sensor: &Sensor) -> [f64; 2] {
    match sensor.spec().detection.model {
        Detection::RadarEquation { reflectance, at_m }
        | Detection::Statistical(Statistical { reflectance, at_m, .. }) => [reflectance, at_m],
        Detection::Table { ref points } => points.last().map(|point| [point.reflectance, point.at_m]).unwrap(),
        Detection::ReflectivityLimit { upper, .. } => [upper.reflectance, upper.at_m],
        _ => panic!("{} has no detection model of a rated range", sensor.name()),
    }
}

/// Farthest wall, m, of the rated reflectance that nine tenths of the beams report; the end of the range is no limit.
fn reached(sensor: &Sensor, [reflectance, at_m]: [f64; 2]) -> f64 {
    let mut sensor = sensor.clone();
    sensor.set("range.max_m", "2000").unwrap();
    if let Pattern::Spinning(Spinning { channels: Some(_), .. }) = &sensor.spec().pattern {
        sensor.set("pattern.channels.range_max_m", "[]").unwrap();
    }
    farthest([0.55 * at_m, 1.1 * at_m], 0.002 * at_m, |range| {
        let wall = wall_all_around(reflectance, range, 60);
        let (found, beams) = seen(&scan(&wall, &sensor, ScanOptions::default()), &sensor);
        found.len() as f64 >= 0.9 * beams as f64
    })
}

/// Standard deviation of ranges to a wall of half the light at `range` m, mm.
fn sigma(sensor: &Sensor, range: f64) -> f64 {
    let (found, _) = seen(&scan(&wall_all_around(0.5, range, 300), sensor, ScanOptions::default()), sensor);
    1e3 * mean_and_sigma(&found).1
}

/// A landscape with trees, and a place 2 m above its middle.
fn landscape() -> (BuiltScene, Pose) {
    let trees = Landscape::default().trees_per_ha(800.0);
    let scene = trees.scene(7).unwrap().load(&Default::default()).unwrap().build_with(&Engine::new().unwrap()).unwrap();
    let above = Pose::at(0.0, 0.0, 500.0).with_rpy_deg(0.0, 90.0, 0.0);
    let ground = scan_at(&scene, &one_beam(""), above, ScanOptions::default());
    let place = Pose::at(0.0, 0.0, 502.0 - f64::from(ground.columns().range()[0]));
    (scene, place)
}

/// Part of the beams that report something which report more than one thing, if all echoes are wanted.
fn several(sensor: &Sensor, (scene, place): &(BuiltScene, Pose)) -> f64 {
    let mut sensor = sensor.clone();
    sensor.set("returns", "{mode: all, max: 3}").unwrap();
    let cloud = scan_at(scene, &sensor, *place, ScanOptions::default());
    let first = cloud.columns().return_number().iter().filter(|&&number| number == 1).count();
    let second = cloud.columns().return_number().iter().filter(|&&number| number == 2).count();
    second as f64 / first.max(1) as f64
}

/// Points of 10,000 beams that meet nothing.
fn false_alarms(sensor: &Sensor) -> f64 {
    // Enough for their digit.
    let frames = (1_000_000 / sensor.beams().len() as u32).clamp(2, 20);
    let scene = nothing();
    let points = (0..frames).map(|frame| {
        let cloud = scan(&scene, sensor, ScanOptions::default().frame(frame));
        assert!(cloud.columns().cause().iter().all(|&cause| cause == Cause::FalseAlarm as u8));
        cloud.len()
    });
    let each = points.sum::<usize>() as f64 / f64::from(frames) / sensor.beams().len() as f64;
    (1e5 * each).round() / 10.0
}

fn row(info: &PresetInfo, forest: &(BuiltScene, Pose)) -> String {
    let sensor = Sensor::preset(&info.name).unwrap();
    // Where noise is not asked for, a quarter of the pixels in each direction are enough, and a quarter of a turn.
    let mut coarse = sensor.clone();
    match sensor.spec().pattern {
        Pattern::Pinhole(Pinhole { resolution: [width, height], .. }) if width > 400 => {
            coarse.set("pattern.resolution", &format!("[{}, {}]", width / 4, height / 4)).unwrap();
        }
        Pattern::Spinning(_) if sensor.beams().len() > 20_000 => coarse.set("pattern.azimuth.fov_deg", "90").unwrap(),
        _ => {}
    }
    let line = rated(&sensor);
    let reached = reached(&coarse, line);
    let [reflectance, at_m] = line;
    // Where the sheet's line is a matter of chance, where channels differ and where a beam's light is a camera's, some
    // beams see less far than others.
    assert!((0.6..1.03).contains(&(reached / at_m)), "{} sees {reflectance} at {reached} m, not {at_m} m", info.name);
    let lidar = info.kind == SensorKind::Lidar;
    let at = if lidar { 10.0 } else { 2.0 };
    // As far as half of the light is seen.
    let far = sensor.spec().range.max_m.unwrap().min(at_m * (0.5 / reflectance).sqrt());
    let at = if far < at { 0.5 * far } else { at };
    let several = if lidar { format!("{:.1} %", 100.0 * several(&coarse, forest)) } else { "-".into() };
    format!(
        "| `{}` | {} % at {at_m} m | {reached:.1} m | {:.1} mm | {several} | {} |\n",
        info.name,
        (1e3 * reflectance).round() / 10.0,
        sigma(&sensor, at),
        false_alarms(&coarse),
    )
}

/// One table for all of them: the line of the sheet is reached, noise is there, second returns are.
#[test]
fn presets_measure_what_their_sheets_say() {
    let forest = landscape();
    let presets = Sensor::presets();
    let real = presets.iter().filter(|info| ["lidar", "tof"].contains(&&*info.folder));
    let table: String = real.map(|info| row(info, &forest)).collect();
    // Preset, line of the sheet, reached (sought in steps of 0.2 %), noise, part of the beams (one is up to 0.2 % of a
    // preset's), false alarms.
    assert_nearly_in_document("docs/instruments.md", &table, &[0.0, 0.0, 0.5, 0.1, 0.5, 0.0]);
}
