//! Strips: when the sensors are on along their trajectory, and the pieces in which they scan.

use super::frames::FrameTime;
use super::spec::{SensorEntry, StripSpec};
use super::stage::Stage;
use emitter::Trajectory;
use emitter::pattern::Pattern;
use engine::sensor::Sensor;
use ground::error::{Error, Result};
use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

/// A strip of one sensor: one or several parts of its trajectory.
#[derive(Clone, Debug)]
pub(super) struct SensorStrip {
    /// Its number.
    pub strip: u16,
    parts: Vec<StripPart>,
}

/// A part of the trajectory on which a sensor is on, as scans that follow each other.
#[derive(Clone, Debug)]
struct StripPart {
    sensor: Arc<Sensor>,
    /// Key and value that shorten the sensor's scan for the last one, if that is shorter than the others.
    rest: Option<(&'static str, String)>,
    /// When its first scan starts, s.
    start: f64,
    /// From scan to scan, s.
    period: f64,
    /// Number of scans.
    count: u32,
    /// Number of its first scan among all of the sensor.
    first: u32,
}

/// What a sensor scans at once: a frame, or a piece of a strip.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct ScanPiece {
    /// The sensor, as it is set there.
    pub sensor: Arc<Sensor>,
    /// Number of the frame, or of the piece among all of the sensor; it addresses random draws.
    pub number: u32,
    /// When it starts, s since the start of the run.
    pub start: f64,
    /// Number of its strip; 0: none.
    pub strip: u16,
}

/// Beams of a piece, about: as many as keep all threads busy, and few enough that their points need little memory.
const PIECE_BEAMS: u64 = 1 << 18;

/// Maximum number of pieces of a sensor.
const MOST_PIECES: u32 = 10_000_000;

impl SensorStrip {
    /// Its number, and when it starts.
    pub fn time(&self) -> FrameTime {
        FrameTime { number: self.strip.into(), start: self.parts.first().map_or(0.0, |part| part.start) }
    }

    /// Number of its pieces.
    pub fn pieces(&self) -> usize {
        self.parts.iter().map(|part| part.count as usize).sum()
    }

    /// The part of its `index`th piece, counted from 0, and the number of that piece in it.
    fn part(&self, mut index: usize) -> (&StripPart, u32) {
        for part in &self.parts {
            if index < part.count as usize {
                return (part, index as u32);
            }
            index -= part.count as usize;
        }
        unreachable!("a strip has at least one part, and pieces below their number")
    }

    /// Number and start of its `index`th piece, counted from 0.
    pub fn piece_time(&self, index: usize) -> FrameTime {
        let (part, piece) = self.part(index);
        FrameTime { number: part.first + piece, start: part.start + f64::from(piece) * part.period }
    }

    /// The sensor of its `index`th piece, counted from 0.
    ///
    /// # Errors
    /// As [`Sensor::set`].
    pub fn piece_sensor(&self, index: usize) -> Result<Arc<Sensor>> {
        let (part, piece) = self.part(index);
        match &part.rest {
            Some((key, value)) if piece + 1 == part.count => changed(&part.sensor, key, value),
            _ => Ok(part.sensor.clone()),
        }
    }
}

/// A copy of `sensor` with another value of `key`.
fn changed(sensor: &Arc<Sensor>, key: &str, value: &str) -> Result<Arc<Sensor>> {
    let mut sensor = Sensor::clone(sensor);
    sensor.set(key, value)?;
    Ok(Arc::new(sensor))
}

/// How a sensor is used in strips: shared by all of them.
struct StripSensor {
    /// As it is set.
    given: Arc<Sensor>,
    /// With scans of the length of pieces.
    cut: Arc<Sensor>,
}

impl StripSensor {
    /// # Errors
    /// As [`Sensor::set`].
    fn new(given: Arc<Sensor>) -> Result<StripSensor> {
        let cut = match &given.spec().pattern {
            Pattern::LineScan(scan) => {
                let lines = (PIECE_BEAMS / scan.pulses()).clamp(1, 1 << 16);
                changed(&given, "pattern.lines", &lines.to_string())?
            }
            _ => given.clone(),
        };
        Ok(StripSensor { given, cut })
    }

    /// Its scans from `from` to `to`, s, the first of which has the number `first`; `None`: not even one fits.
    ///
    /// Line scanners scan whole lines, prisms all pulses, other patterns whole scans.
    fn part(&self, [from, to]: [f64; 2], first: u32) -> Option<StripPart> {
        // Quotients of decimal fractions may miss a whole number by a rounding error; casts saturate.
        let (start, period, count, rest) = match &self.cut.spec().pattern {
            Pattern::LineScan(scan) => {
                let each = f64::from(scan.lines());
                let begin = (from * scan.lines_hz - 1e-6).ceil();
                let lines = (to * scan.lines_hz + 1e-6).floor() - begin;
                let count = (lines / each).ceil();
                let left = lines - each * (count - 1.0);
                let rest = (left < each).then(|| ("pattern.lines", left.to_string()));
                (begin / scan.lines_hz, each / scan.lines_hz, count, rest)
            }
            Pattern::Risley(prisms) => {
                let count = ((to - from) * prisms.rate_hz + 1e-6).floor();
                let left = to - from - count / prisms.rate_hz;
                let rest = (left * prisms.pulse_rate_hz > 1.0).then(|| ("pattern.rate_hz", (1.0 / left).to_string()));
                (from, 1.0 / prisms.rate_hz, count + f64::from(u8::from(rest.is_some())), rest)
            }
            _ => {
                let period = self.cut.beams().period;
                (from, period, ((to - from) / period + 1e-6).floor(), None)
            }
        };
        let (sensor, count) = (self.cut.clone(), count.max(0.0) as u32);
        (count > 0).then_some(StripPart { sensor, rest, start, period, count, first })
    }

    /// Duration of the least that it scans, s.
    fn shortest(&self) -> f64 {
        match &self.given.spec().pattern {
            Pattern::LineScan(scan) => 1.0 / scan.lines_hz,
            Pattern::Risley(prisms) => 1.0 / prisms.pulse_rate_hz,
            _ => self.given.beams().period,
        }
    }
}

/// The strips of the sensor of `entry`, which is at `key`: entries of one number are parts of one strip.
///
/// # Errors
/// A sensor that has no strips; a key that it does not have; a strip in which not even one scan fits.
pub(super) fn of_sensor(
    strips: &[StripSpec],
    (entry, key): (&SensorEntry, &str),
    stage: &Stage,
    folder: &Path,
) -> Result<Vec<SensorStrip>> {
    let mut all: Vec<SensorStrip> = Vec::new();
    // Places of strips in `all` by their numbers.
    let mut places: HashMap<u16, usize> = HashMap::new();
    let mut known: Vec<StripSensor> = Vec::new();
    let mut next = 0_u32;
    for (index, spec) in strips.iter().enumerate() {
        let mut own = entry.clone();
        own.set.extend(spec.set.clone());
        let given = stage.sensor(&own, key, folder)?;
        if !given.kind().is_optical() {
            let found = format!("given, and {key} is a {}", given.kind());
            return Err(Error::invalid("strips", found, "with LiDARs and depth cameras"));
        }
        let found = known.iter().position(|known| Arc::ptr_eq(&known.given, &given));
        let place = match found {
            Some(place) => place,
            None => {
                known.push(StripSensor::new(given)?);
                known.len() - 1
            }
        };
        let sensor = &known[place];
        let to_s = format!("strips[{index}].to_s");
        let Some(part) = sensor.part([spec.from_s, spec.to_s], next) else {
            let found = format!("{}, too early for a scan of {key}", spec.to_s);
            return Err(Error::invalid(to_s, found, format!("at least {} s after from_s", sensor.shortest())));
        };
        next = part.first.saturating_add(part.count);
        if next > MOST_PIECES {
            let found = format!("{}, so late that {key} makes more than {MOST_PIECES} scans", spec.to_s);
            return Err(Error::invalid(to_s, found, "fewer or shorter strips"));
        }
        match places.get(&spec.strip) {
            Some(&place) => all[place].parts.push(part),
            None => {
                places.insert(spec.strip, all.len());
                all.push(SensorStrip { strip: spec.strip, parts: vec![part] });
            }
        }
    }
    Ok(all)
}

/// Checks that the carrier moves along `trajectory` during all `strips`: beyond its ends it would stand still.
///
/// # Errors
/// A strip that starts before, or ends after it.
pub(super) fn check_times(strips: &[StripSpec], trajectory: &Trajectory) -> Result<()> {
    /// Times in files are rounded, s.
    const SLACK: f64 = 1e-3;
    let (start, end) = trajectory.span();
    if trajectory.constant().is_some() {
        return Ok(());
    }
    for (index, strip) in strips.iter().enumerate() {
        for (name, time) in [("from_s", strip.from_s), ("to_s", strip.to_s)] {
            if !(start - SLACK..=end + SLACK).contains(&time) {
                let allowed = format!("{start} to {end}, the times of the trajectory");
                return Err(Error::invalid(format!("strips[{index}].{name}"), time, allowed));
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use crate::{Sample, Scenario};
    use cloud::PointCloud;
    use engine::trace::Engine;
    use std::fs;
    use std::path::PathBuf;
    use tempfile::TempDir;

    /// Level ground of 400 m around the origin.
    fn ground() -> TempDir {
        let folder = tempfile::tempdir().unwrap();
        let text = "o Ground\nv -200 -200 0\nv 200 -200 0\nv 200 200 0\nv -200 200 0\nf 1 2 3 4\n";
        fs::write(folder.path().join("ground.obj"), text).unwrap();
        folder
    }

    /// A scanner without errors, of 100 lines per second.
    fn scenario(folder: &TempDir, rate: f64, rest: &str) -> Scenario {
        try_scenario(folder, rate, rest).unwrap()
    }

    fn try_scenario(folder: &TempDir, rate: f64, rest: &str) -> ground::error::Result<Scenario> {
        let text = format!(
            "scene: {{files: ground.obj}}\n\
             sensors: [{{name: top, sensor: {{name: top, kind: lidar, pattern: {{type: line_scan, pulse_rate_hz: {rate}, \
             lines_hz: 100, mechanism: {{type: rotating, window_deg: [-45, 45], sweep_deg: 180}}}}}}}}]\n{rest}"
        );
        Ok(Scenario::from_yaml(&text, folder.path())?.with_engine(&Engine::with_threads(1)?))
    }

    const FLIGHT: &str = "trajectory: {poses: [[0, -100, 0, 50, 0, 0, 0, 1], [20, 100, 0, 50, 0, 0, 0, 1]]}\n";

    fn clouds(sample: &mut Sample) -> Vec<PointCloud> {
        (0..sample.scans()[0].frames().len()).map(|frame| sample.cloud(0, frame).unwrap()).collect()
    }

    /// A strip is all pulses of its time, once each, in however many pieces it is scanned; those of another time are missing.
    #[test]
    fn strips_are_all_pulses_of_their_times() {
        let folder = ground();
        let strips = "strips: [{strip: 3, from_s: 1, to_s: 2.305}, {strip: 7, from_s: 4, to_s: 4.5, set: {pattern.lines_hz: 50}}]";
        let mut sample = scenario(&folder, 1e6, &format!("{FLIGHT}{strips}")).sample(0).unwrap();
        let scan = sample.scans()[0].clone();
        assert_eq!(
            scan.frames().iter().map(|frame| (frame.number, frame.start)).collect::<Vec<_>>(),
            [(3, 1.0), (7, 4.0)]
        );
        // 130 lines of 5000 pulses are more than two pieces.
        assert_eq!([scan.pieces(0), scan.pieces(1)], [3, 1]);
        let numbers: Vec<u32> = (0..3).map(|piece| scan.piece(0, piece).unwrap().number).collect();
        assert_eq!((numbers, scan.piece(1, 0).unwrap().number), (vec![0, 1, 2], 3));
        let clouds = clouds(&mut sample);
        assert_eq!([clouds[0].len, clouds[1].len], [130 * 5000, 25 * 10_000]);
        for (cloud, [from, to]) in clouds.iter().zip([[1.0, 2.305], [4.0, 4.5]]) {
            let times = &cloud.columns.time;
            assert!(times.windows(2).all(|pair| pair[0] < pair[1]));
            assert!(times[0] >= from && times[times.len() - 1] <= to);
            // Where the carrier was then.
            for row in (0..cloud.len).step_by(9973) {
                let x = -100.0 + 10.0 * times[row];
                assert!((f64::from(cloud.columns.x[row]) + cloud.origin.x - x).abs() < 1e-3);
            }
        }
    }

    /// Entries of one number are parts of one strip.
    #[test]
    fn parts_of_one_number_are_one_strip() {
        let folder = ground();
        let strips = "strips: [{strip: 1, from_s: 0, to_s: 1}, {strip: 2, from_s: 1, to_s: 2}, {strip: 1, from_s: 3, to_s: 3.5}]";
        let mut sample = scenario(&folder, 1e4, &format!("{FLIGHT}{strips}")).sample(0).unwrap();
        let clouds = clouds(&mut sample);
        assert_eq!(clouds.iter().map(|cloud| cloud.len).collect::<Vec<_>>(), [150 * 50, 100 * 50]);
        assert!(clouds[0].columns.time.iter().all(|time| *time < 1.0 || *time >= 3.0));
    }

    #[test]
    fn strips_that_cannot_be_are_errors() {
        let folder = ground();
        let error = |rest: &str| {
            let made = try_scenario(&folder, 1e4, &format!("{FLIGHT}{rest}")).and_then(|scenario| scenario.sample(0));
            made.unwrap_err().to_string()
        };
        for (strips, found) in [
            ("strips: [{strip: 0, from_s: 0, to_s: 1}]", "strips[0].strip: is 0; allowed: 1 to 65535"),
            ("strips: [{strip: 1, from_s: 2, to_s: 2}]", "strips[0].to_s: is 2; allowed: above from_s, 2"),
            (
                "strips: [{strip: 1, from_s: 0, to_s: 2}, {strip: 2, from_s: 1, to_s: 3}]",
                "strips[1].from_s: is 1; allowed: 2 or more, where the strip before ends",
            ),
            (
                "strips: [{strip: 1, from_s: 0, to_s: 0.005}]",
                "strips[0].to_s is 0.005, too early for a scan of sensors[0]",
            ),
            (
                "strips: [{strip: 1, from_s: 18, to_s: 25}]",
                "strips[0].to_s is 25; allowed: 0 to 20, the times of the trajectory",
            ),
            ("strips: [{strip: 1, from_s: 0, to_s: 1, set: {pattern.line_hz: 50}}]", "pattern.line_hz"),
            ("strips: [{strip: 1, from_s: 0, to_s: 1}]\nframes: {last: 3}", "frames: is given beside strips"),
        ] {
            assert!(error(strips).contains(found), "{}", error(strips));
        }
    }

    /// A file for each strip, or one for all, of the same points.
    #[test]
    fn strips_have_files_of_their_own_or_share_one() {
        let folder = ground();
        let files = |output: &str| {
            let rest = format!(
                "{FLIGHT}strips: [{{strip: 2, from_s: 1, to_s: 1.9}}, {{strip: 5, from_s: 4, to_s: 4.5}}]\noutputs: [{output}]"
            );
            let set = tempfile::tempdir_in(folder.path()).unwrap();
            let options = crate::set::RunOptions::default().folder(set.path().join("set")).threads(2);
            crate::set::run(scenario(&folder, 1e6, &rest), &options, &|_| {}).unwrap();
            let data = set.path().join("set/data/000000");
            let mut names: Vec<PathBuf> = fs::read_dir(&data).unwrap().map(|entry| entry.unwrap().path()).collect();
            names.sort();
            let read =
                |path: &PathBuf| cloud::import::read(path, &mut ground::report::Report::default()).unwrap().len();
            let named = |path: &PathBuf| path.file_name().unwrap().to_str().unwrap().to_owned();
            names.iter().map(|path| (named(path), read(path))).collect::<Vec<_>>()
        };
        let (first, second) = (90 * 5000, 50 * 5000);
        for format in ["las", "laz"] {
            let found = files(&format!("{{style: plain, format: {format}}}"));
            assert_eq!(found, [(format!("top_0002.{format}"), first), (format!("top_0005.{format}"), second)]);
        }
        assert_eq!(files("{style: plain, format: las, single: false}"), [("top.las".to_owned(), first + second)]);
    }

    /// The density of a plan is that of the points of its scan, within 2 %; so is their number.
    #[test]
    fn plans_are_as_dense_as_their_scans() {
        let folder = ground();
        for rest in [
            "area: {min_m: [-60, -50], max_m: [60, 50]}, overlap: 0.3",
            "polygon_m: [[-70, -40], [50, -60], [70, 40], [-20, 60]], density_per_m2: 6, heading_deg: 70",
            "area: {min_m: [-40, -50], max_m: [40, 50]}, crossing: true, platform: multicopter",
        ] {
            let plan = format!("trajectory: {{plan: {{height_m: 30, speed_m_s: 12, {rest}}}}}");
            let mut sample = scenario(&folder, 8000.0, &plan).sample(0).unwrap();
            let found = sample.plan().unwrap().clone();
            assert!(found.strips.len() > 1 && found.report.warnings.is_empty(), "{:?}", found.report);
            let clouds = clouds(&mut sample);
            let (mut points, mut inside) = (0, 0);
            for cloud in &clouds {
                points += cloud.len;
                for row in 0..cloud.len {
                    let place = cloud.position(row);
                    // Whether it is left of an odd number of sides.
                    let sides = found.area.iter().zip(found.area.iter().cycle().skip(1));
                    let left = sides.filter(|(a, b)| {
                        (a.y > place.y) != (b.y > place.y)
                            && place.x < a.x + (place.y - a.y) / (b.y - a.y) * (b.x - a.x)
                    });
                    inside += left.count() % 2;
                }
            }
            let coverage = found.coverage.unwrap();
            let density = inside as f64 / coverage.area_m2;
            assert!((density / coverage.mean_per_m2 - 1.0).abs() < 0.02, "{rest}: {density} {coverage:?}");
            assert!((points as f64 / found.points - 1.0).abs() < 0.02, "{rest}: {points} {}", found.points);
            assert_eq!(coverage.covered, 1.0);
        }
    }
}
