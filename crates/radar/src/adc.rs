//! Paths to samples of the converter, and samples to streams.

use crate::LIGHT_SPEED;
use crate::cube::RadarCube;
use crate::paths::Paths;
use crate::plan::{CubeAxis, RadarPlan};
use crate::waveform::RadarWaveform;
use echocast_kernels::math::sin_cos_turns;
use ground::error::Result;
use ground::parallel;
use ground::read::bounds::Bounds;
use num_complex::Complex32;
use rustfft::{Fft, FftPlannerScalar};
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, SQRT_2};
use std::sync::Arc;

/// Width of the Kaiser-Bessel function that waves are spread with, steps of the oversampled spectrum.
const WIDTH: usize = 8;

/// Steps of its table over one of these: linear interpolation errs by less than 1e-6.
const STEPS: usize = 1024;

/// Samples of a frame, sqrt(W). Echoes have positive frequencies, and receding ones phases that advance: with `np.fft`
/// the ranges are in order, and cubes are the conjugate complex of the transforms.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AdcSamples {
    /// Chirps of each transmitter, or code word; of pulses with coherence, pulses.
    pub chirps: usize,
    /// Chirps of a loop: transmitters with `tdm`, code words with `bpm`, otherwise 1; of pulses without coherence,
    /// pulses.
    pub slots: usize,
    /// Receivers.
    pub receivers: usize,
    /// Samples of a chirp.
    pub samples: usize,
    /// Whether there is a quadrature signal; otherwise imaginary parts are 0.
    pub complex: bool,
    /// The samples, `[chirp][slot][receiver][sample]`.
    pub values: Vec<Complex32>,
}

/// `adc`: the analogue-to-digital converter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct AdcSpec {
    /// Bits of a sample, 2 to 16.
    pub bits: u32,
    /// Power of a wave at the antenna that just uses the whole range of numbers, dBm, -150 to 50; stronger ones are
    /// clipped.
    pub full_scale_dbm: f64,
    /// By how much the quadrature signal is stronger than the in-phase signal, dB, -10 to 10.
    pub iq_gain_db: f64,
    /// By how much its phase differs from 90 degrees, -45 to 45.
    pub iq_phase_deg: f64,
}

impl Default for AdcSpec {
    /// 16 bits, -40 dBm, in-phase and quadrature signals alike.
    fn default() -> Self {
        AdcSpec { bits: 16, full_scale_dbm: -40.0, iq_gain_db: 0.0, iq_phase_deg: 0.0 }
    }
}

impl AdcSpec {
    /// Checks that all values are within their allowed ranges.
    ///
    /// # Errors
    /// Names the first that is not.
    pub fn check(&self, bounds: &mut Bounds) -> Result<()> {
        bounds.within("adc.bits", f64::from(self.bits), 2.0, 16.0)?;
        bounds.within("adc.full_scale_dbm", self.full_scale_dbm, -150.0, 50.0)?;
        bounds.within("adc.iq_gain_db", self.iq_gain_db, -10.0, 10.0)?;
        bounds.within("adc.iq_phase_deg", self.iq_phase_deg, -45.0, 45.0)
    }

    /// Replaces `samples` by what the numbers stand for that the converter makes of them, and returns these: two for
    /// each sample, in-phase and quadrature, or one.
    pub fn convert(&self, samples: &mut AdcSamples) -> Vec<i16> {
        let greatest = f64::from((1i32 << (self.bits - 1)) - 1);
        // Real samples carry the power of both side bands: sqrt(2) times the amplitude.
        let root = if samples.complex { 1.0 } else { SQRT_2 };
        let full = root * (1e-3 * 10f64.powf(0.1 * self.full_scale_dbm)).sqrt();
        let step = full / greatest;
        let quantise = |value: f64| (value / step).round().clamp(-greatest - 1.0, greatest);
        let (sine, cosine) = self.iq_phase_deg.to_radians().sin_cos();
        let gain = 10f64.powf(self.iq_gain_db / 20.0);
        let mut numbers = Vec::with_capacity(samples.values.len() * if samples.complex { 2 } else { 1 });
        for value in &mut samples.values {
            let (i, q) = (f64::from(value.re), f64::from(value.im));
            let i = quantise(i);
            numbers.push(i as i16);
            value.re = (i * step) as f32;
            if samples.complex {
                let q = quantise(gain * (q * cosine + f64::from(value.re) * sine));
                numbers.push(q as i16);
                value.im = (q * step) as f32;
            }
        }
        numbers
    }
}

/// The function that waves are spread with over the oversampled spectrum (Kaiser-Bessel; Beatty, Nishimura, Pauly 2005,
/// equations 4 and 5, for an oversampling of 2).
struct WaveSpreading {
    /// Rows for fractions of steps, [`STEPS`] and one more, of [`WIDTH`] values.
    table: Vec<f32>,
    /// What the samples of a chirp are multiplied by to undo it.
    inverse: Vec<f32>,
}

impl WaveSpreading {
    fn new(samples: usize) -> Self {
        let width = WIDTH as f64;
        let beta = PI * (width * width / 4.0 * 2.25 - 0.8).sqrt();
        let value = |x: f64| {
            let inside = 1.0 - (2.0 * x / width).powi(2);
            if inside < 0.0 { 0.0 } else { bessel_i0(beta * inside.sqrt()) / bessel_i0(beta) }
        };
        let row = |step: usize| {
            let part = step as f64 / STEPS as f64;
            // Of a wave `part` behind the step in the middle.
            (0..WIDTH).map(move |tap| value(tap as f64 - (WIDTH / 2 - 1) as f64 - part) as f32)
        };
        let inverse = |n: usize| {
            let place = (n as f64 - (samples / 2) as f64) / (2 * samples) as f64;
            let square = beta * beta - (PI * width * place).powi(2);
            let root = square.max(0.0).sqrt().max(1e-6);
            (bessel_i0(beta) * root / (width * root.sinh())) as f32
        };
        WaveSpreading { table: (0..=STEPS).flat_map(row).collect(), inverse: (0..samples).map(inverse).collect() }
    }

    /// Adds a wave at `place` steps to the spectrum.
    fn add(&self, wave: Complex32, place: f64, spectrum: &mut [Complex32]) {
        let below = place.floor();
        let step = (place - below) * STEPS as f64;
        let row = (step as usize).min(STEPS - 1);
        let part = (step - row as f64) as f32;
        let (low, high) = (&self.table[row * WIDTH..][..WIDTH], &self.table[(row + 1) * WIDTH..][..WIDTH]);
        let first = below as i64 - (WIDTH / 2 - 1) as i64;
        let count = spectrum.len();
        let mut at = first.rem_euclid(count as i64) as usize;
        for tap in 0..WIDTH {
            spectrum[at] += wave * (low[tap] + (high[tap] - low[tap]) * part);
            at = if at + 1 == count { 0 } else { at + 1 };
        }
    }
}

/// The modified Bessel function of the first kind and order 0, by its power series.
fn bessel_i0(x: f64) -> f64 {
    let (mut term, mut sum, quarter) = (1.0, 1.0, 0.25 * x * x);
    for n in 1..200 {
        term *= quarter / f64::from(n * n);
        sum += term;
        if term < 1e-17 * sum {
            break;
        }
    }
    sum
}

/// A path as all chirps see it.
pub(crate) struct PathWave {
    /// Conjugate amplitude in the middle of the frame, with the gains of elements, without its phase.
    pub amplitude: Complex32,
    pub range: f64,
    rate: f64,
    /// By how much farther transmitters and receivers are, m.
    farther: [Vec<f64>; 2],
    /// Waves at the receivers.
    received: Vec<Complex32>,
}

impl RadarPlan {
    /// The samples that `paths` give, without noise. It takes time for each path, chirp and receiver. Paths that are not
    /// finite are ignored.
    pub fn samples(&self, paths: &Paths) -> AdcSamples {
        let mut out = self.silent_samples();
        let AdcSamples { slots, receivers, samples, complex, ref mut values, .. } = out;
        let waves: Vec<PathWave> = (0..paths.len()).filter_map(|path| self.wave(paths, path)).collect();
        let spreading = WaveSpreading::new(samples);
        let fft = FftPlannerScalar::new().plan_fft_inverse(2 * samples);
        parallel::for_each_chunk(values, receivers * samples, |chirp, values| {
            let (chirp, slot) = (chirp / slots, chirp % slots);
            if self.slope > 0.0 {
                let mut spectra = vec![Complex32::ZERO; receivers * 2 * samples];
                self.spread(&waves, chirp, slot, &spreading, &mut spectra);
                for (values, spectrum) in values.chunks_exact_mut(samples).zip(spectra.chunks_exact_mut(2 * samples)) {
                    fft.process(spectrum);
                    for (n, (value, inverse)) in values.iter_mut().zip(&spreading.inverse).enumerate() {
                        let at = (n + 2 * samples - samples / 2) % (2 * samples);
                        *value = spectrum[at] * inverse;
                    }
                }
            } else {
                self.pulses(&waves, chirp, slot, values);
            }
            if !complex {
                values.iter_mut().for_each(|value| *value = Complex32::new(SQRT_2 as f32 * value.re, 0.0));
            }
        });
        out
    }

    /// Samples of silence.
    pub fn silent_samples(&self) -> AdcSamples {
        let receivers = self.receivers.len();
        let (chirps, slots) = (self.velocity.cells, self.streams.len() / receivers);
        let (samples, complex) = match &self.waveform {
            RadarWaveform::Fmcw(fmcw) => (fmcw.samples as usize, fmcw.complex),
            RadarWaveform::Pulse(pulse) => (pulse.samples as usize, true),
        };
        let values = vec![Complex32::ZERO; chirps * slots * receivers * samples];
        AdcSamples { chirps, slots, receivers, samples, complex, values }
    }

    pub(crate) fn wave(&self, paths: &Paths, path: usize) -> Option<PathWave> {
        let (range, rate) = (paths.range[path], f64::from(paths.range_rate[path]));
        let amplitude =
            paths.amplitude[path] * self.element_gain(paths, path) * self.filter_gain(self.range_of(range, rate));
        if !(amplitude.is_finite() && range.abs() < 1e12 && rate.abs() < 1e9) {
            return None;
        }
        let farther = |places: &[[f32; 3]], distance: f32, direction: [f32; 3]| -> Vec<f64> {
            let distance = f64::from(distance.clamp(0.0, 1e12));
            let difference = |place: &[f32; 3]| {
                let place = place.map(f64::from);
                let along: f64 = (0..3).map(|axis| place[axis] * f64::from(direction[axis])).sum();
                // |D u - p| - D, see the kernel `waves_at`.
                let numerator = place.iter().map(|axis| axis * axis).sum::<f64>() - 2.0 * distance * along;
                numerator / ((distance * distance + numerator).max(0.0).sqrt() + distance).max(1e-9)
            };
            places.iter().map(difference).collect()
        };
        let sent = farther(&self.transmitters, paths.tx_distance[path], paths.tx_direction[path]);
        let back = farther(&self.receivers, paths.rx_distance[path], paths.rx_direction[path]);
        let turns = self.mixed_frequency(range) / LIGHT_SPEED;
        let received = back.iter().map(|farther| phasor(turns * farther)).collect();
        Some(PathWave { amplitude: amplitude.conj(), range, rate, farther: [sent, back], received })
    }

    /// Gives what each launch of a chirp makes of a wave at each receiver: the receiver, the amplitude in the middle of
    /// the samples, and the place, cells of range, before it is folded.
    pub(crate) fn each_launch(
        &self,
        wave: &PathWave,
        [chirp, slot]: [usize; 2],
        each: &mut impl FnMut(usize, Complex32, f64),
    ) {
        let receivers = self.receivers.len();
        let loops = (chirp as f64 - 0.5 * (self.velocity.cells as f64 - 1.0)) * self.repetition;
        for part in &self.streams[slot * receivers] {
            let launch = &self.launches[part.launch];
            let range = wave.range + wave.rate * (loops + launch.time) + 0.5 * wave.farther[0][launch.transmitter];
            let place = self.range_of(range, wave.rate);
            let amplitude = self.phase(wave, range, launch.shift, chirp) * wave.amplitude;
            for receiver in 0..receivers {
                let place = place + 0.5 * wave.farther[1][receiver] / self.axes.range.step;
                // The codes of a slot are the same at all receivers.
                let error = self.errors[launch.transmitter * receivers + receiver].conj() * part.code;
                each(receiver, amplitude * wave.received[receiver] * error, place);
            }
        }
    }

    /// Adds the spectra of the waves in a chirp to those of the receivers.
    fn spread(
        &self,
        waves: &[PathWave],
        chirp: usize,
        slot: usize,
        spreading: &WaveSpreading,
        spectra: &mut [Complex32],
    ) {
        let samples = spreading.inverse.len();
        // Samples are counted from the middle one of the transform; amplitudes are those between the samples.
        let beyond = (samples / 2) as f64 - 0.5 * (samples as f64 - 1.0);
        for wave in waves {
            self.each_launch(wave, [chirp, slot], &mut |receiver, amplitude, place| {
                let amplitude = amplitude * phasor(place * beyond / samples as f64);
                let spectrum = &mut spectra[receiver * 2 * samples..(receiver + 1) * 2 * samples];
                spreading.add(amplitude, 2.0 * place.rem_euclid(samples as f64), spectrum);
            });
        }
    }

    /// Phase of a wave in a chirp, at the `range` m from its transmitter.
    fn phase(&self, wave: &PathWave, range: f64, shift: usize, chirp: usize) -> Complex32 {
        let (delay, middle) = (2.0 * range / LIGHT_SPEED, 2.0 * wave.range / LIGHT_SPEED);
        // The amplitude has the phase of the carrier at the middle of the frame.
        let later = self.frequency * (delay - middle) - (self.waveform.frequency() - self.frequency) * middle;
        let turned =
            shift as f64 / self.velocity.cells as f64 * (chirp as f64 - 0.5 * (self.velocity.cells as f64 - 1.0));
        phasor(later - 0.5 * self.slope * delay * delay + turned)
    }

    /// Adds pulses of all waves to the samples of receivers.
    fn pulses(&self, waves: &[PathWave], chirp: usize, slot: usize, values: &mut [Complex32]) {
        let RadarWaveform::Pulse(pulse) = &self.waveform else { return };
        let (receivers, samples, length) = (self.receivers.len(), pulse.samples as usize, pulse.pulse_cells());
        let loops = (chirp as f64 - 0.5 * (self.velocity.cells as f64 - 1.0)) * self.repetition;
        for wave in waves {
            for part in self.streams[slot * receivers].iter() {
                let launch = &self.launches[part.launch];
                let range = wave.range + wave.rate * (loops + launch.time) + 0.5 * wave.farther[0][launch.transmitter];
                let amplitude = self.phase(wave, range, 0, chirp) * wave.amplitude;
                for (receiver, values) in values.chunks_exact_mut(samples).enumerate() {
                    // Folded as at the middle of the frame: a pulse that moves past the end is not cut in two.
                    let moved = range - wave.range + 0.5 * wave.farther[1][receiver];
                    let place = self.range_of(wave.range, wave.rate) + moved / self.axes.range.step;
                    let error = self.errors[launch.transmitter * receivers + receiver].conj();
                    let amplitude = amplitude * wave.received[receiver] * error;
                    let first = (place - length).ceil().max(0.0) as usize;
                    for (n, value) in values.iter_mut().enumerate().skip(first) {
                        let height = 1.0 - (n as f64 - place).abs() / length;
                        if height <= 0.0 && n as f64 > place {
                            break;
                        }
                        *value += amplitude * height.max(0.0) as f32;
                    }
                }
            }
        }
    }

    /// The streams of `samples`: weighted with the windows, and transformed along range and velocity.
    ///
    /// # Panics
    /// If the samples are not those of [`RadarPlan::samples`].
    pub fn streams_of(&self, samples: &AdcSamples) -> RadarCube {
        let mut streams = self.silent_streams();
        let (count, per_chirp) = (samples.samples, samples.slots * samples.receivers * samples.samples);
        assert_eq!((samples.values.len(), samples.chirps), (self.velocity.cells * per_chirp, self.velocity.cells));
        let (cells, rows) = (self.range.cells, self.velocity.cells);
        let along = (self.slope > 0.0).then(|| AxisTransform::new(&self.range, 0));
        let across = AxisTransform::new(&self.velocity, rows / 2);
        let root = if samples.complex { 1.0 } else { SQRT_2 as f32 };
        parallel::for_each_chunk(&mut streams.cells, cells * rows, |stream, out| {
            let mut line = vec![Complex32::ZERO; count];
            for (chirp, out) in out.chunks_exact_mut(cells).enumerate() {
                let from = chirp * per_chirp + stream * count;
                line.copy_from_slice(&samples.values[from..from + count]);
                if let Some(along) = &along {
                    along.apply(&mut line);
                }
                for (cell, value) in out.iter_mut().zip(&line) {
                    *cell = value.conj() * root;
                }
            }
            let mut column = vec![Complex32::ZERO; rows];
            for cell in 0..cells {
                for row in 0..rows {
                    column[row] = out[row * cells + cell].conj();
                }
                across.apply(&mut column);
                for row in 0..rows {
                    out[row * cells + cell] = column[row].conj();
                }
            }
        });
        streams
    }
}

pub(crate) fn phasor(turns: f64) -> Complex32 {
    let (sine, cosine) = sin_cos_turns(turns);
    Complex32::new(cosine as f32, sine as f32)
}

/// FftWindow and Fourier transform along an axis, about the middle of the samples.
struct AxisTransform {
    window: Vec<f32>,
    fft: Arc<dyn Fft<f32>>,
    /// Turns of the cells.
    turns: Vec<Complex32>,
    /// Which cell comes first.
    first: usize,
}

impl AxisTransform {
    /// `before` cells have negative frequencies.
    fn new(axis: &CubeAxis, before: usize) -> Self {
        let count = axis.window.len();
        let turn = |cell: usize| {
            let frequency = cell as f64 - before as f64;
            phasor(0.5 * frequency * (count as f64 - 1.0) / count as f64)
        };
        AxisTransform {
            window: axis.window.iter().map(|&weight| weight as f32).collect(),
            fft: FftPlannerScalar::new().plan_fft_forward(count),
            turns: (0..count).map(turn).collect(),
            first: (count - before) % count,
        }
    }

    fn apply(&self, line: &mut [Complex32]) {
        for (value, weight) in line.iter_mut().zip(&self.window) {
            *value *= *weight;
        }
        self.fft.process(line);
        line.rotate_left(self.first);
        for (value, turn) in line.iter_mut().zip(&self.turns) {
            *value *= turn;
        }
    }
}
