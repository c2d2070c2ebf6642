//! The two ways from paths to cubes, by deposit and by samples, agree with each other and with the formula of the
//! signal.

use echocast_radar::{ArraySpec, FftWindow, Paths, RadarCube, RadarPlan, RadarWaveform};
use ground::parallel;
use ground::read::yaml::from_str;
use num_complex::{Complex32, Complex64};
use std::f64::consts::TAU;

const LIGHT: f64 = 299_792_458.0;

/// Numbers in [0, 1), the same in every run.
struct Dice(u64);

impl Dice {
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f64 / (1u64 << 24) as f64
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    fn direction(&mut self) -> [f32; 3] {
        let (azimuth, elevation) = (self.between(-1.2, 1.2), self.between(-0.4, 0.4));
        [azimuth.cos() * elevation.cos(), azimuth.sin() * elevation.cos(), elevation.sin()].map(|axis| axis as f32)
    }

    /// Paths of ranges up to `farthest` m and rates up to `fastest` m/s, of amplitudes 0.1 to 1.
    fn paths(&mut self, count: usize, farthest: f64, fastest: f64) -> Paths {
        let mut paths = Paths::default();
        for _ in 0..count {
            let range = self.between(0.3, farthest);
            paths.range.push(range);
            paths.range_rate.push(self.between(-fastest, fastest) as f32);
            let phase = self.between(0.0, TAU);
            paths.amplitude.push(Complex32::from_polar(self.between(0.1, 1.0) as f32, phase as f32));
            let direction = self.direction();
            paths.tx_direction.push(direction);
            // A third of them arrive from elsewhere, as over a wall.
            paths.rx_direction.push(if self.unit() < 0.3 { self.direction() } else { direction });
            paths.tx_distance.push(range as f32);
            paths.rx_distance.push(range as f32);
        }
        paths
    }
}

const CHIRP: &str = "start_ghz: 77, slope_mhz_per_us: 30, samples: 64, sample_rate_mhz: 5, ramp_us: 20";
const BOARD: &str = "{tx: [[0, 0], [4, 0], [2, 1]], rx: {count: 4}}";

fn plan(waveform: &str, array: &str, windows: [FftWindow; 2]) -> RadarPlan {
    let waveform: RadarWaveform = from_str("text", waveform).unwrap();
    let array: ArraySpec = from_str("text", array).unwrap();
    RadarPlan::new(&waveform, &array, windows, 5).unwrap()
}

/// Greatest difference, relative to the greatest amplitude, dB.
fn difference_db(one: &RadarCube, other: &RadarCube) -> f64 {
    assert_eq!((one.axes, one.channels), (other.axes, other.channels));
    let peak = other.cells.iter().map(|cell| cell.norm()).fold(0.0, f32::max);
    let differences = one.cells.iter().zip(&other.cells).map(|(a, b)| (a - b).norm());
    20.0 * f64::from(differences.fold(0.0, f32::max) / peak).log10()
}

fn both(plan: &RadarPlan, paths: &Paths) -> [RadarCube; 2] {
    let mut deposited = plan.silent_streams();
    plan.deposit(paths, 0.0, &mut deposited);
    [deposited, plan.streams_of(&plan.samples(paths))]
}

/// The signal of section 6 of textbooks on chirps, sample by sample: `exp j 2 pi [f_c t + S u t - S t^2 / 2 + f_d u]`,
/// where `t` is the delay of the chirp between the elements.
#[test]
fn samples_follow_the_formula() {
    let cases = [
        (format!("{{type: fmcw, {CHIRP}, chirps: 6}}"), "tdm"),
        (format!("{{type: fmcw, {CHIRP}, chirps: 6, multiplex: bpm}}"), "bpm"),
        (format!("{{type: fmcw, {CHIRP}, chirps: 6, multiplex: ddm, bands: 6}}"), "ddm"),
        (format!("{{type: fmcw, {CHIRP}, chirps: 6, complex: false}}"), "real"),
    ];
    for (text, mode) in cases {
        let waveform: RadarWaveform = from_str("text", &text).unwrap();
        let RadarWaveform::Fmcw(fmcw) = &waveform else { unreachable!("the text says fmcw") };
        let array: ArraySpec = from_str("text", BOARD).unwrap();
        let plan = RadarPlan::new(&waveform, &array, [FftWindow::Hann; 2], 5).unwrap();
        // As far as the filter lets them pass.
        let paths = Dice(3).paths(12, 0.9 * fmcw.greatest_range(), 20.0);
        let samples = plan.samples(&paths);
        let (slots, loops, count) = (fmcw.slots(3), 6, 64);
        assert_eq!((samples.slots, samples.chirps, samples.samples), (slots, loops, count));
        let ([tx, rx], errors) = (array.places(waveform.wavelength()), array.errors(5));
        let away = |distance: f32, direction: [f32; 3], place: [f32; 3]| {
            let part = |axis: usize| f64::from(distance) * f64::from(direction[axis]) - f64::from(place[axis]);
            (0..3).map(|axis| part(axis).powi(2)).sum::<f64>().sqrt()
        };
        let (mut greatest, mut worst) = (0f64, 0f64);
        for (chirp, slot, receiver, n) in (0..loops * slots * 4 * count)
            .map(|i| (i / (slots * 4 * count), i / (4 * count) % slots, i / count % 4, i % count))
        {
            let mut sum = Complex64::ZERO;
            for path in 0..paths.len() {
                let (range, rate) = (paths.range[path], f64::from(paths.range_rate[path]));
                for transmitter in 0..3 {
                    let code = match mode {
                        "bpm" => f64::from(1 - 2 * ((slot & transmitter).count_ones() as i32 % 2)),
                        "ddm" => 1.0,
                        _ => f64::from(u8::from(slot == transmitter)),
                    };
                    let band = if mode == "ddm" { transmitter as f64 / 6.0 } else { 0.0 };
                    let middle = 0.5 * (slots as f64 - 1.0);
                    let time = (chirp as f64 - 2.5) * fmcw.repetition(3) + (slot as f64 - middle) * fmcw.chirp_time();
                    let zero = [0.0; 3];
                    let sent = away(paths.tx_distance[path], paths.tx_direction[path], tx[transmitter])
                        - away(paths.tx_distance[path], paths.tx_direction[path], zero);
                    let back = away(paths.rx_distance[path], paths.rx_direction[path], rx[receiver])
                        - away(paths.rx_distance[path], paths.rx_direction[path], zero);
                    let delay = (2.0 * (range + rate * time) + sent + back) / LIGHT;
                    let u = (n as f64 - 0.5 * count as f64) / fmcw.sample_rate();
                    let (carrier, slope) = (fmcw.centre_frequency(), fmcw.slope());
                    let turns = carrier * (delay - 2.0 * range / LIGHT) + slope * (u - 0.5 * delay) * delay
                        // The delay is that of the mean time of all samples.
                        + carrier * 2.0 * rate / LIGHT * (u + 0.5 / fmcw.sample_rate())
                        + band * (chirp as f64 - 2.5);
                    let amplitude = paths.amplitude[path] * errors[transmitter * 4 + receiver];
                    let amplitude = Complex64::new(amplitude.re.into(), -f64::from(amplitude.im));
                    sum += code * amplitude * Complex64::cis(TAU * turns);
                }
            }
            if mode == "real" {
                sum = Complex64::new(2f64.sqrt() * sum.re, 0.0);
            }
            let found = samples.values[((chirp * slots + slot) * 4 + receiver) * count + n];
            let error = Complex64::new(found.re.into(), found.im.into()) - sum;
            (greatest, worst) = (greatest.max(sum.norm()), worst.max(error.norm()));
        }
        assert!(worst < 3e-4 * greatest, "{mode}: {worst} of {greatest}");
    }
}

/// In every mode, near and far, slow and fast: to -60 dB of the peak.
#[test]
fn deposit_is_the_transform_of_samples() {
    let text = |more: &str| format!("{{type: fmcw, {CHIRP}, chirps: 16{more}}}");
    let hann = [FftWindow::Hann; 2];
    let chebyshev = FftWindow::Chebyshev { sidelobe_db: 80.0 };
    // An array as wide as 3 cells of range, and targets that cross up to 7 of them.
    let fine = "{type: fmcw, start_ghz: 76, slope_mhz_per_us: 200, samples: 80, sample_rate_mhz: 4, ramp_us: 21, \
                chirps: 32, anti_alias_db: 0}";
    let wide = "{design_ghz: 76, tx: [[0, 0], [150, 0]], rx: [[0, 0], [20, 0], [75, 9]]}";
    let pulse = "{type: pulse, frequency_ghz: 9.41, pulse_us: 0.1, repetition_khz: 20, pulses: 12, \
                 sample_rate_mhz: 25, samples: 200";
    let cases: [(String, &str, [FftWindow; 2], f64, f64); 12] = [
        (text(""), BOARD, hann, 60.0, 10.0),
        (text(""), BOARD, [FftWindow::BlackmanHarris, chebyshev], 60.0, 60.0),
        (text(""), BOARD, [FftWindow::Rect; 2], 20.0, 0.0),
        (text(", complex: false"), BOARD, hann, 40.0, 30.0),
        (text(", multiplex: bpm"), BOARD, hann, 60.0, 30.0),
        (text(", multiplex: ddm, bands: 4"), BOARD, hann, 60.0, 30.0),
        (text(", multiplex: ddm, bands: 8, complex: false"), BOARD, hann, 30.0, 30.0),
        (fine.into(), wide, [FftWindow::Hamming, FftWindow::Hann], 6.0, 10.0),
        (fine.into(), wide, hann, 6.0, 200.0),
        (format!("{pulse}, coherent: true}}"), "{rx: {count: 3}}", hann, 900.0, 30.0),
        (format!("{pulse}}}"), "{}", hann, 900.0, 30.0),
        (text("").replace("chirps: 16", "chirps: 1"), "{}", hann, 60.0, 10.0),
    ];
    for (number, (waveform, array, windows, farthest, fastest)) in cases.into_iter().enumerate() {
        let plan = plan(&waveform, array, windows);
        let paths = Dice(number as u64).paths(40, farthest, fastest);
        let [deposited, transformed] = both(&plan, &paths);
        let error = difference_db(&deposited, &transformed);
        println!("case {number}: {error:.1} dB");
        assert!(error < -60.0, "case {number}, {waveform}: {error} dB");
    }
}

#[test]
fn cubes_are_the_same_with_any_number_of_threads() {
    let plan = plan(&format!("{{type: fmcw, {CHIRP}, chirps: 16}}"), BOARD, [FftWindow::Hann; 2]);
    let paths = Dice(1).paths(3000, 60.0, 20.0);
    let deposit = || {
        let mut streams = plan.silent_streams();
        plan.deposit(&paths, 1e-4, &mut streams);
        streams
    };
    let (shared, alone) = (deposit(), parallel::alone(deposit));
    assert!(shared.cells == alone.cells);
    assert!(plan.samples(&paths) == parallel::alone(|| plan.samples(&paths)));
}

/// A path in the middle of a cell has its own amplitude there, in every channel up to its phase, and its velocity folds.
#[test]
fn a_path_is_found_where_it_is() {
    let waveform: RadarWaveform = from_str("text", &format!("{{type: fmcw, {CHIRP}, chirps: 16}}")).unwrap();
    let array: ArraySpec = from_str("text", "{rx: {count: 4}, gain_error_db: 0, phase_error_deg: 0}").unwrap();
    let plan = RadarPlan::new(&waveform, &array, [FftWindow::Hann; 2], 0).unwrap();
    let axes = plan.axes();
    let greatest = -axes.velocity.first;
    for (row, fold) in [(11, 0.0), (4, 0.0), (1, 1.0), (13, -1.0)] {
        let rate = axes.velocity.at(f64::from(row)) + fold * 2.0 * greatest;
        let RadarWaveform::Fmcw(fmcw) = &waveform else { unreachable!("the text says fmcw") };
        let range = axes.range.at(20.0) - fmcw.coupling(rate);
        let mut paths = Dice(2).paths(1, 10.0, 1.0);
        (paths.range[0], paths.range_rate[0]) = (range, rate as f32);
        (paths.tx_distance[0], paths.rx_distance[0]) = (range as f32, range as f32);
        let [cell, found_row] = plan.cells_of(range, rate);
        assert!((cell - 20.0).abs() < 1e-3 && (found_row - f64::from(row)).abs() < 0.02, "{cell}, {found_row}");
        let mut streams = plan.silent_streams();
        plan.deposit(&paths, 0.0, &mut streams);
        for channel in 0..4 {
            let value = streams.cells[(channel * 16 + row as usize) * 64 + 20];
            // Fast ones move on by part of a cell.
            assert!((value.norm() / paths.amplitude[0].norm() - 1.0).abs() < 0.02, "{value}");
        }
    }
}

#[test]
fn bad_paths_are_ignored() {
    let plan = plan(&format!("{{type: fmcw, {CHIRP}, chirps: 16}}"), BOARD, [FftWindow::Hann; 2]);
    let good = Dice(4).paths(1, 20.0, 5.0);
    let mut paths = Paths::default();
    for bad in 0..8 {
        let one = Dice(4).paths(1, 20.0, 5.0);
        paths.range.push([f64::NAN, f64::INFINITY, 1e300, 5.0, 5.0, 5.0, -3.0, one.range[0]][bad]);
        paths.range_rate.push([0.0, 0.0, 0.0, f32::NAN, f32::INFINITY, 0.0, 0.0, one.range_rate[0]][bad]);
        let amplitude = [1.0, 1.0, 1.0, 1.0, 1.0, f32::NAN, 0.0, 0.0][bad];
        paths.amplitude.push(if bad == 7 { one.amplitude[0] } else { Complex32::new(amplitude, 0.0) });
        paths.tx_direction.push(one.tx_direction[0]);
        paths.rx_direction.push(one.rx_direction[0]);
        paths.tx_distance.push(if bad == 6 { f32::INFINITY } else { one.tx_distance[0] });
        paths.rx_distance.push(one.rx_distance[0]);
    }
    let [bad, good] = [paths, good].map(|paths| both(&plan, &paths));
    assert!(bad[0].cells == good[0].cells && bad[1].cells == good[1].cells);
}
