//! What oscillators and other radars do to samples.

use crate::LIGHT_SPEED;
use crate::adc::{AdcSamples, PathWave, phasor};
use crate::cube::RadarCube;
use crate::paths::Paths;
use crate::plan::RadarPlan;
use crate::waveform::RadarWaveform;
use ground::error::{Error, Result};
use ground::parallel;
use ground::read::bounds::{Bounds, check_rows};
use ground::rng::{Draw, Rng};
use num_complex::Complex32;
use rustfft::FftPlannerScalar;
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, SQRT_2};

/// Most paths whose phase noise is computed, the strongest ones.
const MOST_PATHS: usize = 256;

/// Most radars that interfere.
const MOST_INTERFERERS: usize = 256;

/// `phase_noise`: that of the oscillator.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct PhaseNoise {
    /// Rows `[offset from the carrier, kHz, dBc/Hz]`, 1 to 1000, offsets rising; linear over the logarithm of the
    /// offset, constant beyond the ends. Offsets are above 0 to 1e9, levels -250 to 0.
    pub levels: Vec<[f64; 2]>,
}

impl PhaseNoise {
    /// Checks that its values are within their allowed ranges.
    ///
    /// # Errors
    /// Names the first that is not.
    pub fn check(&self, bounds: &mut Bounds) -> Result<()> {
        check_rows("phase_noise.levels", self.levels.len())?;
        for (row, [offset, level]) in self.levels.iter().enumerate() {
            let key = format!("phase_noise.levels[{row}]");
            bounds.number(format_args!("{key}[0]"), *offset, [1e-9, 1e9], "above 0 to 1e9")?;
            bounds.within(format_args!("{key}[1]"), *level, -250.0, 0.0)?;
        }
        for (row, pair) in self.levels.windows(2).enumerate() {
            let key = |row: usize| format!("phase_noise.levels[{row}][0]");
            bounds.rising((key(row), pair[0][0]), (key(row + 1), pair[1][0]))?;
        }
        Ok(())
    }

    /// Density on one side of the carrier at `offset` Hz, 1/Hz.
    pub fn density(&self, offset: f64) -> f64 {
        let khz = 1e-3 * offset;
        let after = self.levels.partition_point(|row| row[0] <= khz);
        let level = match (after.checked_sub(1).map(|before| self.levels[before]), self.levels.get(after).copied()) {
            (Some([from, low]), Some([to, high])) => low + (high - low) * (khz / from).ln() / (to / from).ln(),
            (Some([_, level]), None) | (None, Some([_, level])) => level,
            (None, None) => return 0.0,
        };
        10f64.powf(0.1 * level)
    }
}

/// What is left of the power of phase noise at `offset` Hz when an echo of `delay` s is mixed with the same oscillator:
/// `4 sin^2(pi f t)` (Budge and Burt 1993, range correlation).
pub fn range_correlation(offset: f64, delay: f64) -> f64 {
    4.0 * (PI * offset * delay).sin().powi(2)
}

/// Another radar that transmits chirps, out of step with this one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Interferer {
    /// Power times gain of its antenna towards this radar, dBm, -100 to 100.
    pub eirp_dbm: f64,
    /// Distance, m, 0.1 to 100,000.
    pub distance_m: f64,
    /// Azimuth in which it is seen, degrees, -180 to 180, positive to the left.
    #[serde(default)]
    pub azimuth_deg: f64,
    /// Likewise the elevation, -90 to 90, positive upwards.
    #[serde(default)]
    pub elevation_deg: f64,
    /// Frequency at which its ramps begin, GHz, 1 to 300.
    pub start_ghz: f64,
    /// Slope of its ramps, MHz/us, -10,000 to 10,000.
    pub slope_mhz_per_us: f64,
    /// Length of a ramp, us, 0.01 to 1,000,000.
    pub ramp_us: f64,
    /// From ramp to ramp, us, `ramp_us` to 1,000,000.
    pub period_us: f64,
}

impl Interferer {
    /// Checks that its values, below `key`, are within their allowed ranges.
    fn check(&self, key: &str, bounds: &mut Bounds) -> Result<()> {
        let key = |name: &str| format!("{key}.{name}");
        bounds.within(key("eirp_dbm"), self.eirp_dbm, -100.0, 100.0)?;
        bounds.within(key("distance_m"), self.distance_m, 0.1, 1e5)?;
        bounds.within(key("azimuth_deg"), self.azimuth_deg, -180.0, 180.0)?;
        bounds.within(key("elevation_deg"), self.elevation_deg, -90.0, 90.0)?;
        bounds.within(key("start_ghz"), self.start_ghz, 1.0, 300.0)?;
        bounds.within(key("slope_mhz_per_us"), self.slope_mhz_per_us, -1e4, 1e4)?;
        bounds.within(key("ramp_us"), self.ramp_us, 0.01, 1e6)?;
        let allowed = format!("ramp_us ({}) to 1e6", self.ramp_us);
        bounds.number(key("period_us"), self.period_us, [self.ramp_us, 1e6], allowed)
    }

    /// Power that an isotropic antenna receives from it at `wavelength` m, W: `P G lambda^2 / (4 pi R)^2` (Friis 1946).
    pub fn received_power(&self, wavelength: f64) -> f64 {
        1e-3 * 10f64.powf(0.1 * self.eirp_dbm) * (wavelength / (4.0 * PI * self.distance_m)).powi(2)
    }

    /// Unit vector towards it.
    fn direction(&self) -> [f32; 3] {
        let ((sa, ca), (se, ce)) = (self.azimuth_deg.to_radians().sin_cos(), self.elevation_deg.to_radians().sin_cos());
        [ce * ca, ce * sa, se].map(|axis| axis as f32)
    }
}

/// Checks that the values of all `interferers` are within their allowed ranges.
///
/// # Errors
/// Names the first that is not.
pub fn check_interferers(interferers: &[Interferer], bounds: &mut Bounds) -> Result<()> {
    if interferers.len() > MOST_INTERFERERS {
        let allowed = format!("up to {MOST_INTERFERERS}");
        return Err(Error::invalid("interferers", format!("a list of {}", interferers.len()), allowed));
    }
    interferers.iter().enumerate().try_for_each(|(index, one)| one.check(&format!("interferers[{index}]"), bounds))
}

impl RadarPlan {
    /// Adds the streams of `samples` to `streams`: so disturbances get into cubes of deposited paths.
    ///
    /// # Panics
    /// If either is of another radar.
    pub fn add_samples(&self, samples: &AdcSamples, streams: &mut RadarCube) {
        let more = self.streams_of(samples);
        streams.cells.iter_mut().zip(&more.cells).for_each(|(cell, more)| *cell += more);
    }

    /// Adds to `samples` what phase noise adds to those of `paths`: the skirts around strong echoes. Skirts that would
    /// stay below the density `floor`, W/Hz, even without the correlation of the oscillator with itself, are left out,
    /// as are those of all but the strongest 256 paths. Offsets below one cell of range are left out, too. Pulses have
    /// none.
    pub fn add_phase_noise(&self, noise: &PhaseNoise, paths: &Paths, floor: f64, rng: &Rng, samples: &mut AdcSamples) {
        let RadarWaveform::Fmcw(fmcw) = &self.waveform else { return };
        let (count, receivers) = (samples.samples, samples.receivers);
        let step = fmcw.sample_rate() / count as f64;
        let densities: Vec<f64> = (0..=count / 2).map(|bin| noise.density(bin as f64 * step)).collect();
        let highest = densities.iter().skip(1).copied().fold(0.0, f64::max);
        let waves: Vec<PathWave> = (0..paths.len()).filter_map(|path| self.wave(paths, path)).collect();
        let power = |wave: &PathWave| f64::from(wave.amplitude.norm_sqr());
        let mut strong: Vec<&PathWave> = waves.iter().filter(|wave| 4.0 * highest * power(wave) > floor).collect();
        strong.sort_by(|a, b| power(b).total_cmp(&power(a)));
        strong.truncate(MOST_PATHS);
        let fft = FftPlannerScalar::new().plan_fft_inverse(count);
        let root = if samples.complex { 1.0 } else { SQRT_2 as f32 };
        let (slots, complex) = (samples.slots, samples.complex);
        parallel::for_each_chunk(&mut samples.values, receivers * count, |chirp, values| {
            // Phases of the oscillator: a real signal of the two-sided density L, from its positive frequencies.
            let (mut re, mut im) = (vec![0.0; count / 2 + 1], vec![0.0; count / 2 + 1]);
            rng.cell_phasors(chirp as u32, Draw::OscillatorPhase, &mut re, &mut im);
            let mut phases = vec![Complex32::ZERO; count];
            for wave in &strong {
                let delay = 2.0 * wave.range / LIGHT_SPEED;
                phases.fill(Complex32::ZERO);
                for bin in 1..=count / 2 {
                    let amplitude = 2.0 * (densities[bin] * step).sqrt() as f32;
                    let echo = Complex32::ONE - phasor(-(bin as f64) * step * delay);
                    phases[bin] = Complex32::new(re[bin], im[bin]) * echo * amplitude;
                }
                fft.process(&mut phases);
                self.each_launch(wave, [chirp / slots, chirp % slots], &mut |receiver, amplitude, place| {
                    let values = &mut values[receiver * count..(receiver + 1) * count];
                    let (mut turn, advance) = (
                        phasor(-0.5 * place * (count as f64 - 1.0) / count as f64) * amplitude,
                        phasor(place / count as f64),
                    );
                    for (value, phase) in values.iter_mut().zip(&phases) {
                        // exp(j p) - 1, for small p.
                        let added = turn * Complex32::new(0.0, root * phase.re);
                        *value += if complex { added } else { Complex32::new(added.re, 0.0) };
                        turn *= advance;
                    }
                });
            }
        });
    }

    /// Adds what `interferers` transmit to `samples`. When they begin, and with which phases, depends on the seed and
    /// the frame of `rng`. A ramp that crosses this radar's is heard for `2 B / |S - S'|`, while it is within the band
    /// that the converter samples; a parallel one looks like an echo. Pulses hear nothing.
    pub fn add_interference(&self, interferers: &[Interferer], rng: &Rng, samples: &mut AdcSamples) {
        let RadarWaveform::Fmcw(fmcw) = &self.waveform else { return };
        let (count, receivers, slots) = (samples.samples, samples.receivers, samples.slots);
        let wavelength = self.waveform.wavelength();
        let band =
            if fmcw.complex { 0.0..fmcw.sample_rate() } else { -0.5 * fmcw.sample_rate()..0.5 * fmcw.sample_rate() };
        let complex = samples.complex;
        parallel::for_each_chunk(&mut samples.values, receivers * count, |chirp, values| {
            let loops = ((chirp / slots) as f64 - 0.5 * (self.velocity.cells as f64 - 1.0)) * self.repetition;
            let launch = &self.launches[self.streams[chirp % slots * receivers][0].launch];
            for (index, other) in interferers.iter().enumerate() {
                let [begin, ..] = rng.four(index as u32, Draw::Interference, 0);
                let direction = other.direction();
                let amplitude = other.received_power(wavelength).sqrt() as f32 * self.patterns[1].amplitude(direction);
                let steering: Vec<Complex32> = self
                    .receivers
                    .iter()
                    .map(|place| {
                        let along: f32 = (0..3).map(|axis| place[axis] * direction[axis]).sum();
                        phasor(-f64::from(along) / wavelength) * amplitude
                    })
                    .collect();
                let (period, ramp) = (1e-6 * other.period_us, 1e-6 * other.ramp_us);
                for n in 0..count {
                    let u = (n as f64 - 0.5 * (count as f64 - 1.0)) / fmcw.sample_rate();
                    let since = loops + launch.time + u - f64::from(begin) * period;
                    let number = (since / period).floor();
                    let since = since - number * period;
                    let slope = 1e12 * other.slope_mhz_per_us;
                    let beat = self.frequency + self.slope * u - 1e9 * other.start_ghz - slope * since;
                    if since > ramp || !band.contains(&beat) {
                        continue;
                    }
                    let [phase, ..] =
                        rng.four(index as u32, Draw::Interference, 1u32.wrapping_add(number as i64 as u32));
                    let turns = (self.frequency + 0.5 * self.slope * u) * u
                        - (1e9 * other.start_ghz + 0.5 * slope * since) * since
                        + f64::from(phase);
                    let wave = phasor(turns);
                    for (receiver, steering) in steering.iter().enumerate() {
                        let value = wave * steering;
                        values[receiver * count + n] +=
                            if complex { value } else { Complex32::new(SQRT_2 as f32 * value.re, 0.0) };
                    }
                }
            }
        });
    }
}
