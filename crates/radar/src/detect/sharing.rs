//! Which path a detection is of: the truth beside what was measured.
//!
//! A path contributes to a detection its power times the response of the window along range and velocity in the cell of
//! the detection, times the response of the array in its direction. Powers of a group of paths are added, as those of
//! many scatterers on average are; within a group of few, the true sum of their amplitudes may differ.

use super::angle::beams;
use super::detector::{CubeGeometry, RadarDetections};
use super::response::WindowResponse;
use crate::cube::CubeAxes;
use echocast_kernels::steer;
use ground::error::{Error, Result};
use rustfft::num_complex::Complex32;

/// Paths, a column for each quantity, in rising order of their ranges.
#[derive(Clone, Copy, Debug, Default)]
pub struct TruthPaths<'a> {
    /// Range, in cells from the middle of the first; beyond the last cell, they fold.
    pub range_cell: &'a [f32],
    /// Range rate, likewise, not folded.
    pub velocity_cell: &'a [f32],
    /// Unit vectors towards where the waves come from.
    pub direction: &'a [[f32; 3]],
    /// Power in each channel, W.
    pub power: &'a [f32],
    /// What paths belong together.
    pub group: &'a [u32],
}

/// How a detection sees what contributed most to it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SeenBy {
    /// In its own cell and direction.
    #[default]
    MainLobe,
    /// More than the main lobe of a window, or a beam, beside it.
    SideLobe,
    /// Folded: its range, velocity or direction differs by what the radar cannot tell apart.
    Alias,
    /// Nothing contributes as much as the noise does.
    Noise,
}

/// What a detection is of: the strongest contributor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DetectionTruth {
    /// Group that contributes most; `None` if nothing contributes.
    pub group: Option<u32>,
    /// Index of its path that contributes most.
    pub path: u32,
    /// Its part of the power that all paths contribute, 0 to 1.
    pub share: f32,
    /// How it is seen.
    pub seen: SeenBy,
}

/// What the array receives from other directions than that it looks in, of channels that transmit at one time and are at
/// one height.
#[derive(Clone, Debug)]
struct ResponseRow {
    /// Amplitudes over that of all channels, by the difference of the sines, around the middle of the row.
    table: Vec<Complex32>,
    /// Middle and height, wavelengths, and turns per m/s.
    y: f32,
    z: f32,
    turns: f32,
}

/// Finds out which paths the detections of one radar are of.
#[derive(Clone, Debug)]
pub struct Sharing {
    axes: CubeAxes,
    responses: [WindowResponse; 2],
    rows: Vec<ResponseRow>,
    /// Steps of the tables per sine.
    fine: f32,
    /// From the middle of a beam to its null, in sines; infinite if the array does not measure it.
    beam: [f32; 2],
    channels: f32,
    memory: Vec<PathPart>,
}

/// What a path contributes to a detection.
#[derive(Clone, Copy, Debug)]
pub struct PathPart {
    /// Its group.
    pub group: u32,
    /// Its index.
    pub path: u32,
    /// Power per channel in the cell and the direction of the detection, W.
    pub power: f32,
    /// How it is seen.
    pub seen: SeenBy,
}

/// What is looked at: a detection.
#[derive(Clone, Copy, Debug)]
struct SeenDetection {
    cell: [f32; 2],
    sines: [f32; 2],
    /// Range rate, in cells from the middle of the first, and spans that it is unfolded by.
    velocity: f32,
    fold: f32,
    power: f32,
}

impl Sharing {
    /// For detections of one geometry.
    pub fn new(geometry: CubeGeometry) -> Self {
        let CubeGeometry { axes, responses, positions, wavelength, slots } = geometry;
        /// Steps of a table per beam: the error is a thousandth of the peak's amplitude.
        const STEPS: f32 = 32.0;
        let beam = beams(positions, wavelength);
        let fine = if beam[0].is_finite() { STEPS / beam[0] } else { 1.0 };
        let scale = (1.0 / wavelength) as f32;
        let channel = |channel: usize| {
            let slot = slots.get(channel).copied().unwrap_or_default();
            (slot, positions[channel][2] * scale, positions[channel][1] * scale)
        };
        let mut order: Vec<_> = (0..positions.len()).map(channel).collect();
        order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
        let count = positions.len() as f32;
        let row = |row: &[(f32, f32, f32)]| {
            let y = row.iter().map(|row| row.2).sum::<f32>() / row.len() as f32;
            let amplitude = |step: usize| {
                let sine = step as f32 / fine;
                let sum: Complex32 = row.iter().map(|row| phasor((row.2 - y) * sine)).sum();
                sum / count
            };
            let steps = (2.0 * fine).ceil() as usize + 2;
            let turns = 2.0 * row[0].0 * scale;
            ResponseRow { table: (0..steps).map(amplitude).collect(), y, z: row[0].1, turns }
        };
        let rows = order.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)).map(row).collect();
        let responses = responses.map(WindowResponse::clone);
        Sharing { axes, responses, rows, fine, beam, channels: count, memory: Vec::new() }
    }

    /// Fills `truth` with what each of `detections` is of. `noise_power`: W in each cell of each channel.
    ///
    /// # Errors
    /// Columns of paths that do not have one length, or paths that are not in the order of their ranges.
    pub fn run(
        &mut self,
        detections: &RadarDetections,
        paths: &TruthPaths,
        noise_power: f32,
        truth: &mut Vec<DetectionTruth>,
    ) -> Result<()> {
        let count = paths.range_cell.len();
        for (name, len) in [
            ("velocity_cell", paths.velocity_cell.len()),
            ("direction", paths.direction.len()),
            ("power", paths.power.len()),
            ("group", paths.group.len()),
        ] {
            if len != count {
                return Err(Error::invalid(format!("length of {name}"), len, format!("that of range_cell, {count}")));
            }
        }
        if !paths.range_cell.is_sorted() {
            return Err(Error::invalid("range_cell of paths", "not in rising order", "numbers in rising order"));
        }
        truth.clear();
        truth.extend((0..detections.len()).map(|at| self.one(detections, at, paths, noise_power / self.channels)));
        Ok(())
    }

    /// What one detection is of.
    fn one(&mut self, detections: &RadarDetections, at: usize, paths: &TruthPaths, noise: f32) -> DetectionTruth {
        let mut memory = std::mem::take(&mut self.memory);
        let total = self.parts(detections, at, paths, &mut memory);
        let mut found = strongest(&mut memory, total);
        if total < f64::from(noise) {
            found.seen = SeenBy::Noise;
        }
        self.memory = memory;
        found
    }

    /// Replaces `parts` by what each of `paths` contributes to detection number `at` of `detections`, in any order; returns
    /// the sum of their powers, W. Paths have to be in the order of their ranges.
    pub fn parts(&self, detections: &RadarDetections, at: usize, paths: &TruthPaths, parts: &mut Vec<PathPart>) -> f64 {
        /// Cells around a detection beyond which side lobes along range are not looked for.
        const FARTHEST: f32 = 32.0;
        let (azimuth, elevation) = (detections.azimuth[at], detections.elevation[at]);
        let cells = self.axes.velocity.len as f32;
        let velocity = self.axes.velocity.cells(detections.velocity[at].into()) as f32;
        let look = SeenDetection {
            cell: [detections.range_cell[at] as f32, detections.velocity_cell[at] as f32],
            sines: [elevation.cos() * azimuth.sin(), elevation.sin()],
            velocity,
            fold: ((velocity + 0.5) / cells).floor(),
            power: detections.power[at],
        };
        let mut total = 0.0;
        // Less of the detection's power than this is nothing: nearby even from thousands of paths, far away, where side
        // lobes are looked for, from one.
        for (reach, least) in [(self.responses[0].null() + 0.5, 1e-7), (FARTHEST, 1e-4)] {
            parts.clear();
            self.visit(&look, (reach, least * look.power), paths, parts);
            total = parts.iter().map(|part| f64::from(part.power)).sum();
            // What is near explains most of what was measured: no need to look for side lobes of what is far.
            if total > 0.5 * f64::from(look.power) {
                break;
            }
        }
        total
    }

    /// Adds what paths up to `reach` cells of range from a detection contribute to it, if more than `least` W.
    fn visit(&self, look: &SeenDetection, (reach, least): (f32, f32), paths: &TruthPaths, parts: &mut Vec<PathPart>) {
        /// Folds that are looked at: echoes from farther away are too weak.
        const FOLDS: f32 = 8.0;
        let period = self.responses[0].period();
        let ends = [paths.range_cell.first(), paths.range_cell.last()];
        let [first, last] = ends.map(|end| end.map_or(0.0, |end| (end / period).clamp(-FOLDS, FOLDS)));
        let mut fold = first.floor();
        while fold <= last.ceil() {
            let middle = look.cell[0] + fold * period;
            // Windows around two folds do not overlap.
            let reach = reach.min(0.499 * period);
            let from = paths.range_cell.partition_point(|&at| at < middle - reach);
            let to = paths.range_cell.partition_point(|&at| at <= middle + reach);
            parts.extend((from..to).filter_map(|path| self.part(look, (middle, least), paths, path)));
            fold += 1.0;
        }
    }

    /// What one path contributes, if that can be more than `least` W; `middle`: the detection's cell, unfolded to it.
    fn part(
        &self,
        look: &SeenDetection,
        (middle, least): (f32, f32),
        paths: &TruthPaths,
        path: usize,
    ) -> Option<PathPart> {
        // Responses are 1 at most.
        if paths.power[path].is_nan() || paths.power[path] <= least {
            return None;
        }
        let away = [paths.range_cell[path] - middle, paths.velocity_cell[path] - look.cell[1]];
        let mut power = paths.power[path] * self.responses[0].power(away[0]);
        if power > least {
            power *= self.responses[1].power(away[1]);
        }
        if power.is_nan() || power <= least {
            return None;
        }
        let [_, y, z] = paths.direction[path];
        let beside = [y - look.sines[0], z - look.sines[1]];
        let faster = (paths.velocity_cell[path] - look.velocity) * self.axes.velocity.step as f32;
        let response = self.response(beside, faster);
        let far = |axis: usize| self.responses[axis].nearest(away[axis]) > self.responses[axis].null();
        let fold = |cell: f32, cells: f32| ((cell + 0.5) / cells).floor();
        let folded = fold(paths.range_cell[path], self.responses[0].period()) != 0.0
            || fold(paths.velocity_cell[path], self.axes.velocity.len as f32) != look.fold;
        let off = beside[0].abs() > self.beam[0] || beside[1].abs() > self.beam[1];
        let seen = if far(0) || far(1) {
            SeenBy::SideLobe
        } else if folded || off && response > 0.5 {
            // No side lobe receives half of the power: a grating lobe.
            SeenBy::Alias
        } else if off {
            SeenBy::SideLobe
        } else {
            SeenBy::MainLobe
        };
        Some(PathPart { group: paths.group[path], path: path as u32, power: power * response, seen })
    }

    /// Power that the array receives from `beside` the direction in which it looks, of a target that recedes `faster`
    /// than it assumes, m/s; 1 from there.
    fn response(&self, beside: [f32; 2], faster: f32) -> f32 {
        let sum: Complex32 = self
            .rows
            .iter()
            .map(|row| {
                let place = beside[0].abs() * self.fine;
                let step = (place as usize).min(row.table.len() - 2);
                let [low, high] = [row.table[step], row.table[step + 1]];
                let value = low + (high - low) * (place - step as f32);
                let value = if beside[0] < 0.0 { value.conj() } else { value };
                value * phasor(row.y * beside[0] + row.z * beside[1] - row.turns * faster)
            })
            .sum();
        sum.norm_sqr()
    }
}

/// `e^(2 pi i turns)`.
fn phasor(turns: f32) -> Complex32 {
    let [cosine, sine] = steer::phasor(turns);
    Complex32::new(cosine, sine)
}

/// The group with the greatest sum of powers, of all that have `total`; of equals the one with the lowest number. It is
/// seen as most of its power is.
fn strongest(parts: &mut [PathPart], total: f64) -> DetectionTruth {
    parts.sort_by_key(|part| (part.group, part.path));
    let mut best = (0.0, DetectionTruth { seen: SeenBy::Noise, ..DetectionTruth::default() });
    for group in parts.chunk_by(|a, b| a.group == b.group) {
        let sum = |seen: Option<SeenBy>| -> f64 {
            let of = group.iter().filter(|part| seen.is_none_or(|seen| part.seen == seen));
            of.map(|part| f64::from(part.power)).sum()
        };
        let power = sum(None);
        if power <= best.0 {
            continue;
        }
        let mut seen = SeenBy::MainLobe;
        for other in [SeenBy::Alias, SeenBy::SideLobe] {
            seen = if sum(Some(other)) > sum(Some(seen)) { other } else { seen };
        }
        let mut path = group[0];
        for part in group {
            path = if part.power > path.power { *part } else { path };
        }
        let share = (power / total) as f32;
        best = (power, DetectionTruth { group: Some(path.group), path: path.path, share, seen });
    }
    best.1
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detect::test_radar::{TARGET, TestRadar, TestTarget, WAVELENGTH};
    use crate::detect::{PlaneWave, RadarDetectionSpec};
    use std::f64::consts::TAU;

    /// Columns of the paths of `targets`, each a group.
    struct Truth {
        range_cell: Vec<f32>,
        velocity_cell: Vec<f32>,
        direction: Vec<[f32; 3]>,
        power: Vec<f32>,
        group: Vec<u32>,
    }

    impl Truth {
        fn new(targets: &[TestTarget]) -> Self {
            let of = |value: &dyn Fn(&TestTarget) -> f64| targets.iter().map(|target| value(target) as f32).collect();
            Truth {
                range_cell: of(&|target| target.range),
                velocity_cell: of(&|target| target.velocity),
                direction: targets.iter().map(|target| [0.0, target.sines[0] as f32, target.sines[1] as f32]).collect(),
                power: of(&|target| f64::from(target.amplitude).powi(2)),
                group: (0..targets.len() as u32).map(|at| 10 + at).collect(),
            }
        }

        fn paths(&self) -> TruthPaths<'_> {
            TruthPaths {
                range_cell: &self.range_cell,
                velocity_cell: &self.velocity_cell,
                direction: &self.direction,
                power: &self.power,
                group: &self.group,
            }
        }
    }

    /// A detection in the middle of a cell.
    fn detection(radar: &TestRadar, cell: [u32; 2], sine: f32, power: f32) -> RadarDetections {
        let mut found = RadarDetections::default();
        let [azimuth, elevation] = PlaneWave { sines: [sine, 0.0], amplitude: Complex32::default() }.angles();
        for (column, value) in [
            (&mut found.range, radar.axes.range.at(cell[0].into()) as f32),
            (&mut found.velocity, radar.axes.velocity.at(cell[1].into()) as f32),
            (&mut found.azimuth, azimuth),
            (&mut found.elevation, elevation),
            (&mut found.power, power),
        ] {
            column.push(value);
        }
        (found.range_cell, found.velocity_cell) = (vec![cell[0]], vec![cell[1]]);
        found
    }

    fn truth(radar: &TestRadar, detections: &RadarDetections, targets: &[TestTarget]) -> Vec<DetectionTruth> {
        let mut found = Vec::new();
        Sharing::new(radar.geometry()).run(detections, &Truth::new(targets).paths(), 1e-4, &mut found).unwrap();
        assert_eq!(found.len(), detections.len());
        found
    }

    #[test]
    fn responses_of_the_array_are_sums_over_its_elements() {
        for radar in [TestRadar::new(1, 12, 1), TestRadar::new(3, 4, 1), TestRadar::new(2, 8, 2)] {
            let sharing = Sharing::new(radar.geometry());
            for step in 0..200 {
                let beside = [0.0173 * f64::from(step) - 1.7, 0.3 * f64::from(step % 5) - 0.6];
                let faster = 0.9 * f64::from(step % 7) - 2.0;
                let mut sum = num_complex::Complex64::default();
                for (at, slot) in radar.positions.iter().zip(&radar.slots) {
                    let along = f64::from(at[1]) * beside[0] + f64::from(at[2]) * beside[1];
                    let turns = (along - 2.0 * faster * f64::from(*slot)) / WAVELENGTH;
                    sum += num_complex::Complex64::from_polar(1.0, TAU * turns) / radar.positions.len() as f64;
                }
                let found = f64::from(sharing.response(beside.map(|sine| sine as f32), faster as f32));
                assert!((found.sqrt() - sum.norm()).abs() < 3e-3, "{found} at {beside:?}, not {}", sum.norm_sqr());
            }
        }
    }

    #[test]
    fn every_detection_is_of_the_target_that_is_there() {
        let radar = TestRadar::new(3, 4, 1);
        let targets = [
            TARGET,
            TestTarget { sines: [-0.4, 0.0], amplitude: 0.8, phase: 2.0, ..TARGET },
            TestTarget { range: 30.6, velocity: 5.1, amplitude: 0.3, ..TARGET },
            // Folds in velocity.
            TestTarget { range: 45.0, velocity: 40.0, ..TARGET },
        ];
        let spec: RadarDetectionSpec = serde_json::from_str(r#"{"targets_per_cell": 2, "unfold": false}"#).unwrap();
        let found = radar.detect(&spec, &targets, 1e-4, 6);
        let truth = truth(&radar, &found, &targets);
        let of = |range_cell: u32| {
            let rows = truth.iter().zip(&found.range_cell).filter(move |(_, cell)| **cell == range_cell);
            rows.map(|(truth, _)| (truth.group, truth.seen)).collect::<Vec<_>>()
        };
        assert_eq!(of(20), [(Some(10), SeenBy::MainLobe), (Some(11), SeenBy::MainLobe)]);
        assert_eq!(of(31), [(Some(12), SeenBy::MainLobe)]);
        assert!(of(45).iter().all(|of| *of == (Some(13), SeenBy::Alias)), "{:?}", of(45));
        assert!(truth.iter().all(|truth| truth.share > 0.9), "{truth:?}");
    }

    #[test]
    fn side_lobes_aliases_and_noise_are_told_apart() {
        let radar = TestRadar::new(1, 12, 1);
        let strong = TestTarget { range: 20.0, velocity: 16.0, amplitude: 100.0, ..TARGET };
        let seen = |cell: [u32; 2], sine: f32, power: f32, target: TestTarget| {
            let found = detection(&radar, cell, sine, power);
            truth(&radar, &found, &[target])[0]
        };
        assert_eq!(seen([20, 16], 0.2, 1e4, strong).seen, SeenBy::MainLobe);
        // Side lobes along range, along velocity, and in angle: 3 half beams from the middle.
        let between = TestTarget { range: 20.5, velocity: 16.5, ..strong };
        assert_eq!(seen([24, 16], 0.2, 0.5, between).seen, SeenBy::SideLobe);
        assert_eq!(seen([20, 19], 0.2, 4.0, between).seen, SeenBy::SideLobe);
        assert_eq!(seen([20, 16], 0.2 + 1.5 / 6.0, 400.0, strong).seen, SeenBy::SideLobe);
        // Folded range, velocity, and both ends of the axes.
        assert_eq!(seen([20, 16], 0.2, 1e4, TestTarget { range: 84.0, ..strong }).seen, SeenBy::Alias);
        assert_eq!(seen([20, 16], 0.2, 1e4, TestTarget { velocity: -16.0, ..strong }).seen, SeenBy::Alias);
        assert_eq!(
            seen([63, 31], 0.2, 1e4, TestTarget { range: 63.2, velocity: 31.3, ..strong }).seen,
            SeenBy::MainLobe
        );
        assert_eq!(seen([0, 0], 0.2, 1e4, TestTarget { range: 63.8, velocity: 0.0, ..strong }).seen, SeenBy::Alias);
        // Weaker than noise there, and nowhere near.
        let weak = seen([20, 16], 0.2, 1e-3, TestTarget { amplitude: 1e-3, ..strong });
        assert_eq!((weak.seen, weak.group), (SeenBy::Noise, Some(10)));
        let far = seen([60, 16], 0.2, 1e-3, TestTarget { amplitude: 1e-3, ..strong });
        assert_eq!((far.seen, far.group), (SeenBy::Noise, None));
    }

    #[test]
    fn groups_are_sums_of_their_paths() {
        let radar = TestRadar::new(1, 12, 1);
        let path = |range: f64, amplitude: f32| TestTarget { range, velocity: 16.0, amplitude, ..TARGET };
        let targets = [path(19.8, 0.8), path(19.9, 0.8), path(20.0, 1.0), path(20.1, 0.1)];
        let mut truth = Truth::new(&targets);
        truth.group = vec![7, 7, 8, 7];
        let found = detection(&radar, [20, 16], 0.2, 1.0);
        let mut sharing = Sharing::new(radar.geometry());
        let mut of = Vec::new();
        sharing.run(&found, &truth.paths(), 0.0, &mut of).unwrap();
        assert_eq!((of[0].group, of[0].path), (Some(7), 1));
        assert!((of[0].share - 1.27 / 2.27).abs() < 0.02, "{:?}", of[0]);
        truth.range_cell.reverse();
        let error = sharing.run(&found, &truth.paths(), 0.0, &mut of).unwrap_err().to_string();
        assert_eq!(error, "range_cell of paths is not in rising order; allowed: numbers in rising order");
        truth.power.pop();
        let error = sharing.run(&found, &truth.paths(), 0.0, &mut of).unwrap_err().to_string();
        assert_eq!(error, "length of power is 3; allowed: that of range_cell, 4");
    }
}
