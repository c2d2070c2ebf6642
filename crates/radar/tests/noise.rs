//! Noise of cubes has the density and the correlations of noise of samples.

use echocast_radar::{ArraySpec, FftWindow, Leakage, Paths, RadarCube, RadarPlan, RadarWaveform};
use ground::parallel;
use ground::read::yaml::from_str;
use ground::rng::Rng;
use num_complex::{Complex32, Complex64};

const FIGURE_DB: f64 = 12.0;

fn plan(waveform: &str, array: &str, windows: [FftWindow; 2]) -> RadarPlan {
    let waveform: RadarWaveform = from_str("text", waveform).unwrap();
    let array: ArraySpec = from_str("text", array).unwrap();
    RadarPlan::new(&waveform, &array, windows, 5).unwrap()
}

fn chirp(more: &str) -> String {
    format!(
        "{{type: fmcw, start_ghz: 77, slope_mhz_per_us: 30, samples: 64, sample_rate_mhz: 5, ramp_us: 20, chirps: 32{more}}}"
    )
}

/// Mean of `value(cell, cell that many rows and columns on)` over all streams of `frames` frames, far from the ends.
fn covariance(cubes: &[RadarCube], [rows, cells]: [usize; 2]) -> Complex64 {
    let (mut sum, mut count) = (Complex64::ZERO, 0.0);
    for cube in cubes {
        let (width, height) = (cube.axes.range.len, cube.axes.velocity.len);
        for slab in cube.cells.chunks_exact(width * height) {
            for row in 0..height - rows {
                for cell in 4..width - 4 - cells {
                    let (a, b) = (slab[row * width + cell], slab[(row + rows) * width + cell + cells]);
                    sum += Complex64::new(a.re.into(), a.im.into()) * Complex64::new(b.re.into(), (-b.im).into());
                    count += 1.0;
                }
            }
        }
    }
    sum / count
}

#[test]
fn noise_is_that_of_samples() {
    let pulse = "{type: pulse, frequency_ghz: 9.41, pulse_us: 0.1, repetition_khz: 20, pulses: 32, \
                 sample_rate_mhz: 30, samples: 64, coherent: true}";
    let cases = [
        (chirp(""), [FftWindow::Hann, FftWindow::Hann], 2),
        (chirp(", complex: false"), [FftWindow::Hamming, FftWindow::Rect], 2),
        (chirp(""), [FftWindow::BlackmanHarris, FftWindow::Chebyshev { sidelobe_db: 60.0 }], 4),
        (pulse.to_owned(), [FftWindow::Rect, FftWindow::Hann], 3),
    ];
    for (waveform, windows, far) in cases {
        let plan = plan(&waveform, "{rx: {count: 4}}", windows);
        let frames = |of: &dyn Fn(&Rng) -> RadarCube| (0..12).map(|frame| of(&Rng::new(9, frame))).collect::<Vec<_>>();
        let direct = frames(&|rng| {
            let mut streams = plan.silent_streams();
            plan.add_noise(FIGURE_DB, rng, &mut streams);
            streams
        });
        let sampled = frames(&|rng| {
            let mut samples = plan.samples(&Paths::default());
            plan.add_sample_noise(FIGURE_DB, rng, &mut samples);
            plan.streams_of(&samples)
        });
        let power = plan.stream_noise(FIGURE_DB);
        for offset in [[0, 0], [0, 1], [1, 0], [1, 1], [0, 2], [2, 0], [far, far]] {
            let [one, other] = [&direct, &sampled].map(|cubes| covariance(cubes, offset) / power);
            // About 50,000 cells, of which two to eight are correlated: standard deviations of 0.006 to 0.012.
            assert!((one - other).norm() < 0.05, "{waveform}, {offset:?}: {one}, {other}");
            if offset == [0, 0] {
                assert!((one.re - 1.0).abs() < 0.03 && (other.re - 1.0).abs() < 0.03, "{one}, {other}");
            }
        }
        if windows == [FftWindow::Hann; 2] {
            // Of a Hann window: 2/3, 1/6 (from its three coefficients 1/4, 1/2, 1/4).
            assert!((covariance(&direct, [0, 1]) / power - 2.0 / 3.0).norm() < 0.03);
            assert!((covariance(&direct, [0, 2]) / power - 1.0 / 6.0).norm() < 0.03);
        }
    }
}

/// `k T_0 B` of 10 MHz is -103.9752 dBm; 12 dBm, antennas of 10 dBi, 10 m^2 at 100 m at 77 GHz give -119.1697 dBm, and
/// over 128 chirps of 25.6 us with a noise figure of 14 dB a signal-to-noise ratio of 15.95999 dB: computed with NumPy
/// from the radar equation.
#[test]
fn signal_to_noise_ratios_are_those_of_the_radar_equation() {
    let text = "{type: fmcw, start_ghz: 77, slope_mhz_per_us: 0.001, samples: 256, sample_rate_mhz: 10, ramp_us: 25.6, \
                chirps: 128}";
    let plan = plan(text, "{}", [FftWindow::Rect; 2]);
    let dbm = |power: f64| 30.0 + 10.0 * power.log10();
    let wavelength = 299_792_458.0 / 77e9;
    let received =
        1e-3 * 10f64.powf(1.2) * 100.0 * f64::powi(wavelength, 2) * 10.0 / ((4.0 * std::f64::consts::PI).powi(3) * 1e8);
    assert!((dbm(received) + 119.169_7).abs() < 1e-4);
    assert!((dbm(plan.stream_noise(0.0) * 256.0 * 128.0) + 103.975_2).abs() < 1e-4);
    assert!((dbm(received) - dbm(plan.stream_noise(14.0)) - 15.959_99).abs() < 1e-4);
}

#[test]
fn noise_depends_on_seed_and_frame_only() {
    let plan = plan(&chirp(""), "{rx: {count: 4}}", [FftWindow::Hann; 2]);
    let noise = |seed, frame| {
        let mut streams = plan.silent_streams();
        plan.add_noise(FIGURE_DB, &Rng::new(seed, frame), &mut streams);
        streams.cells
    };
    let first = noise(1, 0);
    assert!(first == parallel::alone(|| noise(1, 0)));
    assert!(first != noise(2, 0) && first != noise(1, 1));
}

/// Words and bands of three transmitters: noise averages over words, and echoes keep their amplitude.
#[test]
fn decoding_keeps_echoes() {
    let array = "{tx: [[0, 0], [2, 0], [4, 0]], rx: {count: 2}, gain_error_db: 0, phase_error_deg: 0}";
    let path = |range: f64, rate: f32, amplitude: f32| Paths {
        range: vec![range],
        range_rate: vec![rate],
        amplitude: vec![Complex32::new(amplitude, 0.0)],
        tx_direction: vec![[0.8, 0.6, 0.0]],
        rx_direction: vec![[0.8, 0.6, 0.0]],
        tx_distance: vec![range as f32],
        rx_distance: vec![range as f32],
    };
    for more in [", multiplex: bpm", ", multiplex: ddm, bands: 8"] {
        let plan = plan(&chirp(more), array, [FftWindow::Hann; 2]);
        let mut noise = plan.silent_streams();
        plan.add_noise(FIGURE_DB, &Rng::new(1, 0), &mut noise);
        let noise = plan.decode(noise);
        let mean = noise.cells.iter().map(|cell| f64::from(cell.norm_sqr())).sum::<f64>() / noise.cells.len() as f64;
        assert!((mean / plan.channel_noise(FIGURE_DB) - 1.0).abs() < 0.1, "{more}: {mean}");
        let axes = plan.axes();
        for row in [20, 13, 27] {
            // 40 dB above the noise.
            let amplitude = (1e4 * plan.channel_noise(FIGURE_DB)).sqrt() as f32;
            let path = path(axes.range.at(20.0), axes.velocity.at(f64::from(row)) as f32, amplitude);
            let mut streams = plan.silent_streams();
            plan.add_noise(FIGURE_DB, &Rng::new(1, 0), &mut streams);
            plan.deposit(&path, plan.stream_noise(FIGURE_DB) * 1e-3, &mut streams);
            let cube = plan.decode(streams);
            let slab = axes.range.len * axes.velocity.len;
            let power =
                |at: usize| (0..6).map(|channel| f64::from(cube.cells[channel * slab + at].norm_sqr())).sum::<f64>();
            let strongest = (0..slab).max_by(|&a, &b| power(a).total_cmp(&power(b))).unwrap();
            assert_eq!(strongest, row as usize * axes.range.len + 20, "{more}");
            // The direction is that of the path: phases rise by 2 pi times half a wavelength times the sine.
            let array = plan.array();
            let steering = array.steering([0.8, 0.6, 0.0]);
            let sum: Complex32 =
                (0..6).map(|channel| cube.cells[channel * slab + strongest] * steering[channel].conj()).sum();
            assert!(
                f64::from(sum.norm()) > 5.8 * f64::from(amplitude),
                "{more}, row {row}: {}",
                sum.norm() / amplitude
            );
            // Nowhere else is there an echo.
            let near = |at: usize| {
                let (row_of, cell) = (at / axes.range.len, at % axes.range.len);
                (row_of as i32 - row).abs() < 4 && (cell as i32 - 20).abs() < 4
            };
            let second = (0..slab).filter(|&at| !near(at)).map(power).fold(0.0, f64::max);
            assert!(second < 40.0 * plan.channel_noise(FIGURE_DB), "{more}, row {row}: {second}");
        }
    }
}

#[test]
fn leakage_is_a_peak_at_the_near_end() {
    let plan = plan(&chirp(""), "{rx: {count: 2}, gain_error_db: 0, tx_pattern: {gain_dbi: 12}}", [FftWindow::Hann; 2]);
    let leakage: Leakage = from_str("text", "{power_dbm: -30}").unwrap();
    let mut paths = Paths::default();
    plan.add_leakage(&leakage, &mut paths);
    let mut streams = plan.silent_streams();
    plan.deposit(&paths, 0.0, &mut streams);
    let powers = streams.cells.iter().map(|cell| cell.norm_sqr());
    let (at, power) =
        powers.enumerate().fold((0, 0.0), |best, (at, power)| if power > best.1 { (at, power) } else { best });
    assert_eq!(at % (64 * 32), 16 * 64);
    assert!((power / 1e-6 - 1.0).abs() < 0.05, "{power}");
}
