//! From a cube to detections: thresholds, maxima, directions.

use super::angle::{DirectionFinder, PlaneWave};
use super::cfar::Cfar;
use super::response::{CellPeak, WindowResponse};
use super::spec::RadarDetectionSpec;
use crate::cube::{Axis, CubeAxes, RadarCube};
use echocast_kernels::{cfar, steer};
use ground::error::{Error, Result};
use rustfft::num_complex::Complex32;

/// What is known about the cells of a cube.
#[derive(Clone, Copy, Debug)]
pub struct CubeGeometry<'a> {
    /// Its axes.
    pub axes: CubeAxes,
    /// Responses of a path along range and along velocity.
    pub responses: [&'a WindowResponse; 2],
    /// Positions of the virtual elements, m: one for each channel, the sum of those of transmitter and receiver.
    pub positions: &'a [[f32; 3]],
    /// Wavelength, m.
    pub wavelength: f64,
    /// When each channel transmits, s after the first one; empty: all at the same time.
    pub slots: &'a [f32],
}

/// Detections of a frame, a column for each quantity, by range cell, velocity cell, and falling power.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RadarDetections {
    /// Range, m.
    pub range: Vec<f32>,
    /// Range rate, m/s, positive if receding; within the unambiguous span unless it is unfolded.
    pub velocity: Vec<f32>,
    /// Azimuth, rad, positive to the left.
    pub azimuth: Vec<f32>,
    /// Elevation, rad, positive up; 0 if the array does not measure it.
    pub elevation: Vec<f32>,
    /// Power in one channel, W, as if the path were in the middle of its cell.
    pub power: Vec<f32>,
    /// Power of the cell over the noise after the sum over channels, dB.
    pub snr_db: Vec<f32>,
    /// Standard errors that noise alone causes, of range, m.
    pub sigma_range: Vec<f32>,
    /// Of the range rate, m/s.
    pub sigma_velocity: Vec<f32>,
    /// Of the azimuth, rad; infinite if the array does not measure it.
    pub sigma_azimuth: Vec<f32>,
    /// Of the elevation, rad, likewise.
    pub sigma_elevation: Vec<f32>,
    /// Cell of the range.
    pub range_cell: Vec<u32>,
    /// Cell of the velocity.
    pub velocity_cell: Vec<u32>,
}

impl RadarDetections {
    /// Number of detections.
    pub fn len(&self) -> usize {
        self.range.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.range.is_empty()
    }

    /// Keeps those of the numbers `which`, in that order.
    pub fn keep(&mut self, which: &[usize]) {
        for column in self.columns() {
            *column = which.iter().map(|&at| column[at]).collect();
        }
        for column in [&mut self.range_cell, &mut self.velocity_cell] {
            *column = which.iter().map(|&at| column[at]).collect();
        }
    }

    fn columns(&mut self) -> [&mut Vec<f32>; 10] {
        [
            &mut self.range,
            &mut self.velocity,
            &mut self.azimuth,
            &mut self.elevation,
            &mut self.power,
            &mut self.snr_db,
            &mut self.sigma_range,
            &mut self.sigma_velocity,
            &mut self.sigma_azimuth,
            &mut self.sigma_elevation,
        ]
    }

    fn clear(&mut self) {
        for column in self.columns() {
            column.clear();
        }
        self.range_cell.clear();
        self.velocity_cell.clear();
    }

    fn push(&mut self, target: &CellTarget) {
        self.range.push(target.range as f32);
        self.velocity.push(target.velocity as f32);
        self.azimuth.push(target.angles[0] as f32);
        self.elevation.push(target.angles[1] as f32);
        self.power.push(target.power);
        self.snr_db.push(target.snr_db);
        self.sigma_range.push(target.errors[0]);
        self.sigma_velocity.push(target.errors[1]);
        self.sigma_azimuth.push(target.errors[2]);
        self.sigma_elevation.push(target.errors[3]);
        self.range_cell.push(target.cell[0]);
        self.velocity_cell.push(target.cell[1]);
    }
}

/// A target in a cell.
#[derive(Clone, Copy, Debug)]
struct CellTarget {
    /// Along range and velocity.
    cell: [u32; 2],
    range: f64,
    velocity: f64,
    angles: [f64; 2],
    power: f32,
    snr_db: f32,
    errors: [f32; 4],
}

/// Finds detections in the cubes of one radar.
#[derive(Clone)]
pub struct Detector {
    spec: RadarDetectionSpec,
    axes: CubeAxes,
    responses: [WindowResponse; 2],
    channels: usize,
    /// Turns of the phase of each channel per m/s.
    turns: Vec<f32>,
    /// Numbers of unambiguous spans that a velocity may differ by, the likeliest first.
    folds: Vec<i32>,
    cfar: Cfar,
    finder: DirectionFinder,
    memory: DetectorMemory,
}

/// Buffers, kept from frame to frame.
#[derive(Clone, Debug, Default)]
struct DetectorMemory {
    power: Vec<f32>,
    found: Vec<u32>,
    channels: Vec<Complex32>,
    turned: Vec<Complex32>,
    waves: Vec<PlaneWave>,
    targets: Vec<CellTarget>,
}

impl Detector {
    /// For cubes of one geometry.
    ///
    /// # Errors
    /// A cube, an array or a detector that does not go together.
    pub fn new(spec: &RadarDetectionSpec, geometry: CubeGeometry) -> Result<Self> {
        let CubeGeometry { axes, responses, positions, wavelength, slots } = geometry;
        let channels = positions.len();
        if !slots.is_empty() && slots.len() != channels {
            let allowed = format!("one for each of {channels} channels, or none");
            return Err(Error::invalid("number of slots", slots.len(), allowed));
        }
        if slots.iter().any(|slot| !slot.is_finite()) {
            return Err(Error::invalid("time of a slot", "not finite", "seconds after the first one"));
        }
        let finder = DirectionFinder::new(positions, wavelength)?;
        let (map, shape) = spec.axes([axes.velocity.len, axes.range.len], responses);
        let cfar = Cfar::new(&map, (spec.method, shape, spec.os_rank), channels, spec.pfa)?;
        // A path that recedes with v is 2 v t longer at the time t.
        let turns: Vec<f32> = slots.iter().map(|&slot| (2.0 * f64::from(slot) / wavelength) as f32).collect();
        let mut times = slots.to_vec();
        times.sort_by(f32::total_cmp);
        times.dedup();
        // As many velocities that differ by the unambiguous span have different phases as there are slots.
        let count = if spec.unfold { times.len().max(1) as i32 } else { 1 };
        let folds = (0..count).map(|fold| if fold % 2 == 1 { (fold + 1) / 2 } else { -fold / 2 }).collect();
        Ok(Detector {
            spec: spec.clone(),
            axes,
            responses: responses.map(WindowResponse::clone),
            channels,
            turns,
            folds,
            cfar,
            finder,
            memory: DetectorMemory::default(),
        })
    }

    /// Replaces `detections` by those of `cube`, whose noise has `noise_power` W in each cell of each channel, 0 or more.
    /// Signal-to-noise ratios are relative to it; thresholds are relative to the cells around.
    ///
    /// # Errors
    /// A cube of another geometry, or a noise that is none.
    pub fn run(&mut self, cube: &RadarCube, noise_power: f32, detections: &mut RadarDetections) -> Result<()> {
        let cells = self.cfar.cells();
        let lengths = |axes: &CubeAxes| [axes.range.len, axes.velocity.len];
        if lengths(&cube.axes) != lengths(&self.axes)
            || cube.channels != self.channels
            || cube.cells.len() != cells * self.channels
        {
            let shape = |axes: &CubeAxes, channels| format!("{} x {} x {channels}", axes.range.len, axes.velocity.len);
            let found = format!("{}, {} in total", shape(&cube.axes, cube.channels), cube.cells.len());
            return Err(Error::invalid("cells of the cube", found, shape(&self.axes, self.channels)));
        }
        if !(noise_power.is_finite() && noise_power >= 0.0) {
            return Err(Error::invalid("noise power", noise_power, "0 W or more"));
        }
        detections.clear();
        let mut memory = std::mem::take(&mut self.memory);
        memory.power.clear();
        memory.power.resize(cells, 0.0);
        for channel in cube.cells.chunks_exact(cells) {
            cfar::add_power(bytemuck::cast_slice(channel), &mut memory.power);
        }
        let mut found = std::mem::take(&mut memory.found);
        let done = self.cfar.run(&memory.power, &mut found);
        memory.targets.clear();
        for &cell in &found {
            let cell = cell as usize;
            if !self.spec.local_maxima || self.is_maximum(&memory.power, cell) {
                self.targets(cube, cell, noise_power, &mut memory);
            }
        }
        memory.found = found;
        let targets = &mut memory.targets;
        if let Some(most) = self.spec.max_detections.map(|most| most as usize).filter(|most| targets.len() > *most) {
            // Ties go to the earlier cell: the sort is stable, and cells are in the order of the cube.
            targets.sort_by(|a, b| b.power.total_cmp(&a.power));
            targets.truncate(most);
        }
        targets.sort_by(|a, b| a.cell.cmp(&b.cell).then(b.power.total_cmp(&a.power)));
        targets.iter().for_each(|target| detections.push(target));
        self.memory = memory;
        done
    }

    /// Whether a cell is stronger than all eight around it; of equals the first is.
    fn is_maximum(&self, power: &[f32], cell: usize) -> bool {
        let exceeds = |other: usize| power[cell] > power[other] || power[cell] == power[other] && cell < other;
        let [before, after] = self.axes.beside(cell, 1);
        [before, Some(cell), after].into_iter().flatten().all(|row| {
            let [near, far] = self.axes.beside(row, 0);
            [near, Some(row), far].into_iter().flatten().all(|other| other == cell || exceeds(other))
        })
    }

    /// Adds the targets of a cell.
    fn targets(&mut self, cube: &RadarCube, cell: usize, noise_power: f32, memory: &mut DetectorMemory) {
        let around = self.axes.beside(cell, 1).map(|other| other.map(|other| memory.power[other]));
        let coarse = peak(&self.responses[1], around, memory.power[cell]);
        let span = self.axes.velocity.step * self.axes.velocity.len as f64;
        let ranges = self.axes.range.len;
        let velocity = self.axes.velocity.at((cell / ranges) as f64 + f64::from(coarse.offset));
        gather(cube, cell, &mut memory.channels);
        let mut best = (0, -1.0);
        for &fold in &self.folds {
            turn(&self.turns, &memory.channels, velocity + f64::from(fold) * span, &mut memory.turned);
            if self.folds.len() > 1 {
                let power = self.finder.strongest(&memory.turned);
                best = if power > best.1 { (fold, power) } else { best };
            }
        }
        let fold = f64::from(best.0) * span;
        let receding = velocity + fold;
        if self.folds.len() > 1 {
            turn(&self.turns, &memory.channels, receding, &mut memory.turned);
        }
        // Noise alone has so many independent maxima as channels; a further target is above them with the same
        // probability of a false alarm.
        let beam_noise = noise_power / self.channels as f32;
        let floor = beam_noise * (self.channels as f64 / self.spec.pfa).ln() as f32;
        let (most, fraction) = (self.spec.targets_per_cell as usize, self.spec.second_target as f32);
        let mut waves = std::mem::take(&mut memory.waves);
        self.finder.find(&memory.turned, most, fraction, floor, &mut waves);
        for wave in &waves {
            // The maximum in the direction of the wave, where noise is less and other waves are suppressed.
            let mut towards = |other: usize| {
                gather(cube, other, &mut memory.channels);
                turn(&self.turns, &memory.channels, receding, &mut memory.turned);
                self.finder.towards(wave.sines, &memory.turned).power()
            };
            let around = [0, 1].map(|axis| self.axes.beside(cell, axis).map(|other| other.map(&mut towards)));
            let peaks = [0, 1].map(|axis| peak(&self.responses[axis], around[axis], wave.power()));
            if let Some(target) = self.target(cell, fold, wave, peaks, beam_noise) {
                memory.targets.push(target);
            }
        }
        memory.waves = waves;
    }

    /// What is reported of a wave, if it is within the limits.
    fn target(
        &self,
        cell: usize,
        fold: f64,
        wave: &PlaneWave,
        peaks: [CellPeak; 2],
        beam_noise: f32,
    ) -> Option<CellTarget> {
        let (limits, steps) = (&self.spec.limits, &self.spec.steps);
        let ranges = self.axes.range.len;
        let at = [cell % ranges, cell / ranges];
        let place = |axis: &Axis, which: usize| axis.at(at[which] as f64 + f64::from(peaks[which].offset));
        let (range, velocity) = (place(&self.axes.range, 0), place(&self.axes.velocity, 1) + fold);
        let angles = wave.angles().map(f64::from);
        let snr = wave.power() / beam_noise.max(f32::MIN_POSITIVE);
        let snr_db = 10.0 * snr.log10();
        let within = |limits: Option<[f64; 2]>, value: f64| {
            limits.is_none_or(|[least, greatest]| (least..=greatest).contains(&value))
        };
        let reported = within(limits.range_m, range)
            && within(limits.velocity_m_s, velocity)
            && within(limits.azimuth_deg, angles[0].to_degrees())
            && within(limits.elevation_deg, angles[1].to_degrees())
            && self.spec.min_snr_db.is_none_or(|least| f64::from(snr_db) >= least);
        if !reported {
            return None;
        }
        let [sine_error, height_error] = self.finder.error(snr);
        // u = cos(elevation) sin(azimuth), w = sin(elevation): errors grow towards the sides.
        let [azimuth, elevation] = wave.angles();
        let along = (elevation.cos() * azimuth.cos()).max(1e-3);
        let errors = [
            self.responses[0].error(snr) * self.axes.range.step as f32,
            self.responses[1].error(snr) * self.axes.velocity.step as f32,
            sine_error / along,
            height_error / elevation.cos().max(1e-3),
        ];
        let stepped = |step: Option<f64>, value: f64| step.map_or(value, |step| (value / step).round() * step);
        let turned = |step: Option<f64>, angle: f64| stepped(step.map(f64::to_radians), angle);
        Some(CellTarget {
            cell: at.map(|at| at as u32),
            range: stepped(steps.range_m, range),
            velocity: stepped(steps.velocity_m_s, velocity),
            angles: [turned(steps.azimuth_deg, angles[0]), turned(steps.elevation_deg, angles[1])],
            power: wave.power() * peaks[0].gain * peaks[1].gain,
            snr_db,
            errors,
        })
    }
}

impl CubeAxes {
    /// Cells next to `cell` before and after it along range (0) or velocity (1), if there are any.
    fn beside(&self, cell: usize, axis: usize) -> [Option<usize>; 2] {
        let (ranges, velocities) = (self.range.len, self.velocity.len);
        let (range, velocity) = (cell % ranges, cell / ranges);
        if axis == 0 {
            return [range.checked_sub(1).map(|_| cell - 1), (range + 1 < ranges).then_some(cell + 1)];
        }
        let other = |velocity: usize| (velocities > 2).then_some(velocity % velocities * ranges + range);
        [other(velocity + velocities - 1), other(velocity + 1)]
    }
}

/// The maximum between a cell of power `at` and those beside it.
fn peak(response: &WindowResponse, around: [Option<f32>; 2], at: f32) -> CellPeak {
    match around {
        [Some(before), Some(after)] => response.peak([before, at, after]),
        _ => CellPeak { offset: 0.0, gain: 1.0 },
    }
}

/// Turns back the phases of channels that transmit at other times, for a target that recedes with `velocity`; `turns`:
/// of each channel per m/s, empty if they transmit together.
fn turn(turns: &[f32], channels: &[Complex32], velocity: f64, turned: &mut Vec<Complex32>) {
    turned.clear();
    if turns.is_empty() {
        turned.extend_from_slice(channels);
        return;
    }
    turned.extend(channels.iter().zip(turns).map(|(channel, turns)| {
        let [cosine, sine] = steer::phasor(turns * velocity as f32);
        channel * Complex32::new(cosine, sine)
    }));
}

/// The channels of a cell.
fn gather(cube: &RadarCube, cell: usize, channels: &mut Vec<Complex32>) {
    let cells = cube.axes.range.len * cube.axes.velocity.len;
    channels.clear();
    channels.extend(cube.cells.chunks_exact(cells).map(|channel| channel[cell]));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detect::test_radar::{CELLS, TARGET, TestRadar, TestTarget, line};
    use ground::rng::{Draw, Rng};

    fn spec(text: &str) -> RadarDetectionSpec {
        serde_json::from_str(text).unwrap()
    }

    #[test]
    fn a_target_is_found_once_where_it_is() {
        for (radar, sines) in [
            (TestRadar::new(1, 12, 1), [0.2, 0.0]),
            (TestRadar::new(3, 4, 1), [-0.4, 0.0]),
            (TestRadar::new(2, 4, 2), [0.3, -0.2]),
        ] {
            for dims in ["range", "doppler", "range_then_doppler", "cross", "box"] {
                let spec = spec(&format!(r#"{{"dims": "{dims}", "pfa": 1e-7}}"#));
                let found = radar.detect(&spec, &[TestTarget { sines, ..TARGET }], 1e-4, 0);
                assert_eq!(found.len(), 1, "{dims}: {found:?}");
                assert_eq!([found.range_cell[0], found.velocity_cell[0]], [20, 18]);
                let off =
                    |value: f32, expected: f64, sigma: f32| (f64::from(value) - expected).abs() / f64::from(sigma);
                assert!(off(found.range[0], 0.2 * TARGET.range, found.sigma_range[0]) < 4.0, "{found:?}");
                let speed = radar.axes.velocity.at(TARGET.velocity);
                assert!(off(found.velocity[0], speed, found.sigma_velocity[0]) < 4.0, "{found:?}");
                let elevation = sines[1].asin();
                let azimuth = (sines[0] / elevation.cos()).asin();
                assert!(off(found.azimuth[0], azimuth, found.sigma_azimuth[0]) < 4.0, "{found:?}");
                if sines[1] != 0.0 {
                    assert!(off(found.elevation[0], elevation, found.sigma_elevation[0]) < 4.0, "{found:?}");
                }
                assert!((found.power[0] - 1.0).abs() < 0.02, "{found:?}");
                let loss = f64::from(line(0.3, 64) * line(0.2, 32)).powi(2);
                let snr = 10.0 * (loss * radar.positions.len() as f64 / 1e-4).log10();
                assert!((f64::from(found.snr_db[0]) - snr).abs() < 0.1, "{} dB, not {snr}", found.snr_db[0]);
            }
        }
    }

    fn one(found: &RadarDetections) -> [f32; 3] {
        assert_eq!(found.len(), 1, "{found:?}");
        [found.range[0], found.velocity[0], found.azimuth[0]]
    }

    /// A velocity beyond the unambiguous span folds; what the transmitters' phases tell unfolds it and puts the target
    /// back where it is.
    #[test]
    fn velocities_fold_and_are_unfolded_if_asked() {
        let radar = TestRadar::new(3, 4, 1);
        let span = radar.axes.velocity.step * CELLS[1] as f64;
        for (velocity, folded) in [(17.8, 17.8), (17.8 + 32.0, 17.8), (12.1 - 32.0, 12.1), (31.4, 31.4), (32.2, 0.2)] {
            let target = TestTarget { velocity, ..TARGET };
            let at = |cells: f64| radar.axes.velocity.at(cells) as f32;
            let [_, found, azimuth] = one(&radar.detect(&spec(r#"{"pfa": 1e-7}"#), &[target], 1e-4, 1));
            let off = (found - at(folded)).abs();
            assert!(off.min(span as f32 - off) < 0.02, "{found}, not {}", at(folded));
            assert_eq!(
                (azimuth - 0.2f32.asin()).abs() < 0.01,
                (0.0..32.0).contains(&velocity),
                "{velocity}: {azimuth}"
            );
            let [_, found, azimuth] = one(&radar.detect(&spec(r#"{"pfa": 1e-7, "unfold": true}"#), &[target], 1e-4, 1));
            assert!((found - at(velocity)).abs() < 0.02, "{found}, not {}", at(velocity));
            assert!((azimuth - 0.2f32.asin()).abs() < 0.01, "{velocity}: {azimuth}");
        }
    }

    #[test]
    fn targets_at_the_edges_are_found() {
        let radar = TestRadar::new(1, 8, 1);
        for dims in ["range", "doppler", "range_then_doppler", "cross", "box"] {
            for method in ["ca", "go", "so", "os"] {
                if dims == "box" && (method == "go" || method == "so") {
                    continue;
                }
                // One detection: a target in the first cell is seen in the last one, too.
                let text = format!(r#"{{"pfa": 1e-6, "dims": "{dims}", "method": "{method}", "max_detections": 1}}"#);
                let spec = spec(&text);
                for (range, velocity) in [(0.0, 16.0), (63.0, 0.0), (1.2, 31.3), (32.0, 31.6), (62.0, 0.4)] {
                    let target = TestTarget { range, velocity, ..TARGET };
                    let [found, speed, _] = one(&radar.detect(&spec, &[target], 1e-5, 2));
                    assert!(
                        (f64::from(found) - 0.2 * range).abs() < 0.02,
                        "{dims} {method}: {found}, not {}",
                        0.2 * range
                    );
                    let off = radar.axes.velocity.cells(speed.into()) - velocity;
                    assert!((off - (off / 32.0).round() * 32.0).abs() < 0.05, "{dims} {method}: off by {off} cells");
                }
            }
        }
    }

    #[test]
    fn two_targets_in_a_cell_are_two_detections() {
        let radar = TestRadar::new(3, 4, 1);
        let other = TestTarget { sines: [-0.4, 0.0], amplitude: 0.8, phase: 2.0, ..TARGET };
        let found = radar.detect(&spec(r#"{"targets_per_cell": 2}"#), &[TARGET, other], 1e-4, 3);
        assert_eq!(found.len(), 2, "{found:?}");
        assert_eq!(found.range_cell, [20, 20]);
        for (at, target) in [TARGET, other].iter().enumerate() {
            assert!((f64::from(found.azimuth[at].sin()) - target.sines[0]).abs() < 0.01, "{found:?}");
            assert!((found.power[at] / target.amplitude.powi(2) - 1.0).abs() < 0.1, "{found:?}");
            assert!((f64::from(found.range[at]) - 0.2 * target.range).abs() < 0.02, "{found:?}");
        }
        assert_eq!(radar.detect(&spec("{}"), &[TARGET, other], 1e-4, 3).len(), 1);
        let high = spec(r#"{"targets_per_cell": 2, "second_target": 0.9}"#);
        assert_eq!(radar.detect(&high, &[TARGET, other], 1e-4, 3).len(), 1);
    }

    #[test]
    fn what_is_reported_is_limited_and_stepped() {
        let radar = TestRadar::new(1, 8, 1);
        // Not in each other's reference cells.
        let targets = [8.3, 20.3, 40.3, 55.3].map(|range| TestTarget {
            range,
            velocity: 0.5 * range,
            amplitude: range as f32,
            ..TARGET
        });
        let ranges = |text: &str| radar.detect(&spec(text), &targets, 1e-2, 4).range;
        assert_eq!(ranges("{}").len(), 4);
        assert!(ranges("{}").is_sorted());
        assert_eq!(ranges(r#"{"max_detections": 2}"#), ranges("{}")[2..]);
        assert_eq!(ranges(r#"{"limits": {"range_m": [2, 9]}}"#), ranges("{}")[1..3]);
        assert_eq!(ranges(r#"{"limits": {"azimuth_deg": [12, 30]}}"#).len(), 0);
        assert_eq!(ranges(r#"{"limits": {"elevation_deg": [-5, 5], "velocity_m_s": [-50, 50]}}"#).len(), 4);
        assert_eq!(ranges(r#"{"steps": {"range_m": 0.5}}"#), [1.5, 4.0, 8.0, 11.0]);
        let weakest = radar.detect(&spec("{}"), &targets, 1e-2, 4).snr_db[0];
        assert_eq!(ranges(&format!(r#"{{"min_snr_db": {}}}"#, weakest + 0.01)).len(), 3);
        let found = radar.detect(&spec(r#"{"steps": {"velocity_m_s": 0.1, "azimuth_deg": 1}}"#), &targets, 1e-2, 4);
        let whole = |value: f32, step: f32| (value / step - (value / step).round()).abs() < 1e-3;
        assert!(found.velocity.iter().all(|&velocity| whole(velocity, 0.1)), "{found:?}");
        assert!(found.azimuth.iter().all(|azimuth| whole(azimuth.to_degrees(), 1.0)), "{found:?}");
        // All cells of the main lobes, not only their maxima.
        assert!(ranges(r#"{"local_maxima": false}"#).len() > 20);
    }

    /// Empty, overflowing and broken cubes give no detections or some, but end; a detector gives the same for the same
    /// cube whatever it saw before.
    #[test]
    fn any_cube_is_taken() {
        let radar = TestRadar::new(3, 4, 1);
        let mut detector =
            Detector::new(&spec(r#"{"targets_per_cell": 8, "unfold": true}"#), radar.geometry()).unwrap();
        let good = radar.cube(&[TARGET], 1e-4, 5);
        let (mut first, mut found) = (RadarDetections::default(), RadarDetections::default());
        detector.run(&good, 1e-4, &mut first).unwrap();
        for value in [0.0, 1.0, f32::NAN, f32::INFINITY, 1e30] {
            let mut cube = good.clone();
            cube.cells.fill(Complex32::new(value, 0.0));
            detector.run(&cube, 0.0, &mut found).unwrap();
            cube.cells[500].re = 2.0 * value;
            detector.run(&cube, 0.0, &mut found).unwrap();
            detector.run(&good, 1e-4, &mut found).unwrap();
            assert_eq!(found, first);
        }
        let mut refused = |cube: &RadarCube, noise| detector.run(cube, noise, &mut found).unwrap_err().to_string();
        assert_eq!(refused(&good, -1.0), "noise power is -1; allowed: 0 W or more");
        let other = RadarCube { channels: 11, ..good.clone() };
        let message = "cells of the cube is 64 x 32 x 11, 24576 in total; allowed: 64 x 32 x 12";
        assert_eq!(refused(&other, 1.0), message);
        let slots = &radar.slots[..3];
        let error = Detector::new(&spec("{}"), CubeGeometry { slots, ..radar.geometry() }).err().unwrap();
        assert_eq!(error.to_string(), "number of slots is 3; allowed: one for each of 12 channels, or none");
        let error = Detector::new(&spec("{}"), CubeGeometry { positions: &[], slots: &[], ..radar.geometry() });
        assert!(error.is_err());
    }

    #[test]
    fn detections_are_the_same_at_every_vector_level() {
        let radar = TestRadar::new(3, 4, 2);
        let text = r#"{"pfa": 0.01, "method": "os", "targets_per_cell": 3, "second_target": 0.1, "unfold": true}"#;
        let mut before = None;
        for level in echocast_kernels::Level::here() {
            echocast_kernels::limit_level(level);
            let found = radar.detect(&spec(text), &[TARGET, TestTarget { range: 40.2, ..TARGET }], 0.1, 7);
            assert!(found.len() > 2);
            assert_eq!(*before.get_or_insert_with(|| found.clone()), found, "{level:?}");
        }
        echocast_kernels::limit_level(echocast_kernels::Level::Avx512);
    }

    #[test]
    fn probabilities_of_detection_are_those_of_the_law() {
        // Check value: CA with 16 cells, Pfa 1e-4, a Swerling 1 target of 15 dB: 0.6857591.
        let mut radar = TestRadar { positions: vec![[0.0; 3]], slots: Vec::new(), ..TestRadar::new(1, 1, 1) };
        // Noise of each cell for itself: no windows.
        radar.responses = CELLS.map(|cells| WindowResponse::new(&vec![1.0; cells], cells));
        let spec = spec(r#"{"pfa": 1e-4, "dims": "range", "reference_cells": [8, 1], "local_maxima": false}"#);
        let mut detector = Detector::new(&spec, radar.geometry()).unwrap();
        let mut found = RadarDetections::default();
        let (mut count, mut all) = (0, 0);
        for frame in 0..600 {
            let mut cube = radar.cube(&[], 1.0, frame);
            // One cell of every row, far enough from the others not to be a reference cell of them.
            let mut swerling = [vec![0.0; CELLS[1]], vec![0.0; CELLS[1]]];
            let [re, im] = &mut swerling;
            Rng::new(9, frame).cell_phasors(0, Draw::RadarSpeckle, re, im);
            for row in 0..CELLS[1] {
                cube.cells[row * CELLS[0] + 32] += 10f32.powf(0.75) * Complex32::new(re[row], im[row]);
            }
            detector.run(&cube, 1.0, &mut found).unwrap();
            count += found.range_cell.iter().filter(|&&cell| cell == 32).count();
            all += CELLS[1];
        }
        let expected = 0.6857591;
        let (found, spread) = (count as f64 / all as f64, (expected * (1.0 - expected) / all as f64).sqrt());
        assert!((found - expected).abs() < 3.0 * spread, "{found} of {all}, not {expected}");
    }
}
