//! Phase noise, interference, and the maps that pictures show.

use echocast_radar::{
    ArraySpec, FftWindow, Interferer, Paths, PhaseNoise, RadarPlan, RadarWaveform, check_interferers, range_correlation,
};
use ground::parallel;
use ground::read::bounds::Bounds;
use ground::read::yaml::from_str;
use ground::rng::Rng;
use num_complex::Complex32;

const LIGHT: f64 = 299_792_458.0;

const CHIRP: &str = "{type: fmcw, start_ghz: 77, slope_mhz_per_us: 30, samples: 256, sample_rate_mhz: 10, ramp_us: 40, \
                     chirps: 16}";

fn plan(array: &str) -> RadarPlan {
    let waveform: RadarWaveform = from_str("text", CHIRP).unwrap();
    let array: ArraySpec = from_str("text", array).unwrap();
    RadarPlan::new(&waveform, &array, [FftWindow::Hann; 2], 5).unwrap()
}

fn path(range: f64, azimuth: f32) -> Paths {
    let direction = [azimuth.cos(), azimuth.sin(), 0.0];
    Paths {
        range: vec![range],
        range_rate: vec![0.0],
        amplitude: vec![Complex32::ONE],
        tx_direction: vec![direction],
        rx_direction: vec![direction],
        tx_distance: vec![range as f32],
        rx_distance: vec![range as f32],
    }
}

#[test]
fn phase_noise_has_its_density_less_the_correlation_with_the_echo() {
    // 50 m, 100 kHz: computed with NumPy from the formula.
    let delay = 100.0 / LIGHT;
    assert!((range_correlation(1e5, delay) - 0.043_765_1).abs() < 1e-7);
    assert!((10.0 * range_correlation(1e5, delay).log10() + 13.588_7).abs() < 1e-4);
    let noise: PhaseNoise = from_str("text", "levels: [[10, -70], [1000, -90]]").unwrap();
    noise.check(&mut Bounds::none()).unwrap();
    assert!((10.0 * noise.density(1e5).log10() + 80.0).abs() < 1e-9);
    assert!((10.0 * noise.density(1e8).log10() + 90.0).abs() < 1e-9);
    // The mean periodogram around an echo of amplitude 1: the density times the width of a cell.
    let plan = plan("{gain_error_db: 0}");
    let (range, count) = (plan.axes().range.at(64.0), 256.0);
    let mut powers = [0.0; 256];
    let frames = 60;
    for frame in 0..frames {
        let mut samples = plan.silent_samples();
        plan.add_phase_noise(&noise, &path(range, 0.0), 0.0, &Rng::new(1, frame), &mut samples);
        for line in samples.values.chunks_exact(256) {
            for offset in [5usize, 20, 50] {
                for place in [64 + offset, 64 - offset] {
                    let turn = |n: usize| Complex32::cis(-std::f32::consts::TAU * (place * n % 256) as f32 / 256.0);
                    let sum: Complex32 = line.iter().enumerate().map(|(n, value)| value * turn(n)).sum();
                    powers[place] += f64::from(sum.norm_sqr()) / count / count / 16.0 / f64::from(frames);
                }
            }
        }
    }
    let (step, delay) = (10e6 / count, 2.0 * range / LIGHT);
    for offset in [5usize, 20, 50] {
        let frequency = offset as f64 * step;
        let expected = noise.density(frequency) * range_correlation(frequency, delay) * step;
        for place in [64 + offset, 64 - offset] {
            // Of 960 periodograms: a standard deviation of 3.2 percent.
            assert!((powers[place] / expected - 1.0).abs() < 0.2, "{place}: {} of {expected}", powers[place]);
        }
    }
}

fn interferer(more: &str) -> Interferer {
    let text = format!("{{eirp_dbm: 33, distance_m: 50, start_ghz: 77, ramp_us: 80, period_us: 80, {more}}}");
    from_str("text", &text).unwrap()
}

/// EIRP 33 dBm, antenna of 10 dBi, 50 m, 77 GHz: -61.157 dBm, computed with NumPy.
#[test]
fn interference_is_as_strong_as_friis_says() {
    let power = interferer("slope_mhz_per_us: 20").received_power(LIGHT / 77e9) * 10.0;
    assert!((30.0 + 10.0 * power.log10() + 61.157).abs() < 1e-3);
}

#[test]
fn crossing_ramps_are_bursts_and_parallel_ones_are_echoes() {
    let plan = plan("{rx_pattern: {gain_dbi: 10}}");
    // Ten MHz within ten MHz/us of difference: a burst of a microsecond, ten samples.
    let (mut lengths, mut levels) = (Vec::new(), Vec::new());
    for frame in 0..20 {
        let mut samples = plan.silent_samples();
        let crossing = interferer("slope_mhz_per_us: 20");
        plan.add_interference(&[crossing], &Rng::new(3, frame), &mut samples);
        for line in samples.values.chunks_exact(256) {
            let heard: Vec<usize> = (0..256).filter(|&n| line[n] != Complex32::ZERO).collect();
            if let (Some(&first), Some(&last)) = (heard.first(), heard.last())
                && first > 0
                && last < 255
            {
                lengths.push(heard.len());
                levels.push(f64::from(line[first].norm_sqr()));
            }
        }
    }
    assert!(lengths.len() > 10, "{lengths:?}");
    assert!(lengths.iter().all(|length| (9..=11).contains(length)), "{lengths:?}");
    let expected = interferer("slope_mhz_per_us: 20").received_power(LIGHT / 77.384e9) * 10.0;
    assert!(levels.iter().all(|level| (level / expected - 1.0).abs() < 1e-3));

    // The same chirp, out of step: an echo in one cell of range, whose velocity is arbitrary from frame to frame.
    let mut ghosts = 0;
    for frame in 0..400 {
        let mut samples = plan.silent_samples();
        let text = "{eirp_dbm: 33, distance_m: 50, start_ghz: 77, slope_mhz_per_us: 30, ramp_us: 40, period_us: 40}";
        let parallel: Interferer = from_str("text", text).unwrap();
        plan.add_interference(&[parallel], &Rng::new(3, frame), &mut samples);
        if samples == plan.silent_samples() {
            continue;
        }
        let mut streams = plan.silent_streams();
        plan.add_samples(&samples, &mut streams);
        for cells in streams.cells.chunks_exact(256) {
            let powers: Vec<f32> = cells.iter().map(|cell| cell.norm_sqr()).collect();
            let at = (0..256).max_by(|&a, &b| powers[a].total_cmp(&powers[b])).unwrap();
            if powers[at] > 0.0 && (3..253).contains(&at) {
                let (inside, all): (f32, f32) = (powers[at - 2..=at + 2].iter().sum(), powers.iter().sum());
                assert!(inside > 0.95 * all, "frame {frame}: {inside} of {all}");
                ghosts += 1;
            }
        }
    }
    assert!(ghosts >= 16, "{ghosts} lines have a ghost");
}

#[test]
fn disturbances_do_not_depend_on_threads() {
    let plan = plan("{rx: {count: 2}}");
    let noise: PhaseNoise = from_str("text", "levels: [[100, -80]]").unwrap();
    let disturbed = || {
        let mut samples = plan.silent_samples();
        plan.add_interference(&[interferer("slope_mhz_per_us: 29")], &Rng::new(1, 2), &mut samples);
        plan.add_phase_noise(&noise, &path(20.0, 0.0), 0.0, &Rng::new(1, 2), &mut samples);
        samples
    };
    assert!(disturbed() == parallel::alone(disturbed));
}

#[test]
fn disturbances_out_of_bounds_are_refused() {
    let error = |more: &str| {
        let interferers = [interferer("slope_mhz_per_us: 20"), interferer(more)];
        check_interferers(&interferers, &mut Bounds::none()).unwrap_err().to_string()
    };
    assert_eq!(error("slope_mhz_per_us: 99999"), "interferers[1].slope_mhz_per_us is 99999; allowed: -10000 to 10000");
    assert!(error("slope_mhz_per_us: 1, azimuth_deg: 200").contains("interferers[1].azimuth_deg"));
    for (text, key) in [
        ("levels: []", "phase_noise.levels is"),
        ("levels: [[0, -80]]", "phase_noise.levels[0][0]"),
        ("levels: [[2, -80], [1, -90]]", "phase_noise.levels[1][0]"),
        ("levels: [[2, 3]]", "phase_noise.levels[0][1]"),
    ] {
        let noise: PhaseNoise = from_str("text", text).unwrap();
        let error = noise.check(&mut Bounds::none()).unwrap_err().to_string();
        assert!(error.contains(key), "{error}");
    }
}

#[test]
fn maps_show_targets_where_they_are() {
    let plan = plan("{tx: [[0, 0], [4, 0]], rx: {count: 4}, gain_error_db: 0, phase_error_deg: 0}");
    let azimuth = 0.4f32;
    let mut streams = plan.silent_streams();
    plan.deposit(&path(plan.axes().range.at(100.0), azimuth), 0.0, &mut streams);
    let cube = plan.decode(streams);
    let doppler = cube.range_doppler();
    let strongest = (0..doppler.len()).max_by(|&a, &b| doppler[a].total_cmp(&doppler[b])).unwrap();
    assert_eq!(strongest, 8 * 256 + 100);
    assert!((doppler[strongest] - 1.0).abs() < 1e-3, "{}", doppler[strongest]);
    let map = cube.range_azimuth(plan.array(), 128);
    assert_eq!(map.powers.len(), 256 * map.sine.len);
    let strongest = (0..map.powers.len()).max_by(|&a, &b| map.powers[a].total_cmp(&map.powers[b])).unwrap();
    assert_eq!(strongest / map.sine.len, 100);
    let sine = map.sine.at((strongest % map.sine.len) as f64);
    assert!((sine - f64::from(azimuth.sin())).abs() < map.sine.step, "{sine}");
    // Summed over velocities: times the noise bandwidth of 16 samples of a Hann window, 1.5 x 16 / 15.
    assert!((map.powers[strongest] / 1.6 - 1.0).abs() < 0.01, "{}", map.powers[strongest]);
}
