//! What a waveform and an array make of paths, worked out once for all frames.

use crate::LIGHT_SPEED;
use crate::array::{ArraySpec, VirtualArray};
use crate::correlation::Correlation;
use crate::cube::{CubeAxes, RadarCube};
use crate::pattern::LobeTable;
use crate::response::CellResponse;
use crate::waveform::{Multiplex, RadarWaveform};
use crate::window::{FftWindow, noise_bandwidth};
use ground::error::Result;
use ground::read::bounds::Bounds;
use num_complex::Complex32;

/// Most orders of polynomials that describe how an echo moves on along the range during a frame.
pub(crate) const MOST_ORDERS: usize = 12;

/// Density of thermal noise at the input of a receiver with this noise figure, W/Hz: Boltzmann's constant (SI 2019), J/K,
/// times the reference temperature of noise figures, 290 K (IEEE 145), times the factor.
pub fn noise_density(noise_figure_db: f64) -> f64 {
    1.380_649e-23 * 290.0 * 10f64.powf(0.1 * noise_figure_db)
}

/// A radar ready to turn paths into samples and cubes. Made of specs that have been checked.
///
/// Signals of one chirp and one receiver form a *stream*: with `tdm` it is that of a channel, with `bpm` that of a code
/// word, with `ddm` that of all transmitters. Streams are what is deposited, what noise is added to, and what
/// [`RadarPlan::decode`] turns into channels.
///
/// An echo of delay `t`, mixed with what is being transmitted, has the phase `2 pi (f t + S t (u - t / 2))`, `u` from the
/// middle of the chirp on; the delay is that of the chirp, and moves on from chirp to chirp. What a delay changes within
/// a chirp is the Doppler shift `2 v f_c / c` of the beat; the spread of that over the band, `v S u^2 / c` cycles, is left
/// out: 0.003 at 100 m/s, 30 MHz/us and 30 us.
#[derive(Clone, Debug)]
pub struct RadarPlan {
    pub(crate) waveform: RadarWaveform,
    /// Axes of streams, which are those of channels.
    pub(crate) axes: CubeAxes,
    pub(crate) array: VirtualArray,
    /// Places of transmitters and receivers, m.
    pub(crate) transmitters: Vec<[f32; 3]>,
    pub(crate) receivers: Vec<[f32; 3]>,
    /// Gains of elements, transmitter and receiver.
    pub patterns: [LobeTable; 2],
    /// Factors of transmitter and receiver pairs.
    pub(crate) errors: Vec<Complex32>,
    pub(crate) launches: Vec<SlotLaunch>,
    pub(crate) streams: Vec<Vec<StreamPart>>,
    pub(crate) range: CubeAxis,
    pub(crate) velocity: CubeAxis,
    /// Frequency in the middle of what is sampled, Hz.
    pub(crate) frequency: f64,
    /// Slope, Hz/s; 0 of pulses.
    pub(crate) slope: f64,
    /// From loop to loop, s.
    pub(crate) repetition: f64,
}

/// A transmitter in one of the chirps of a loop.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SlotLaunch {
    pub transmitter: usize,
    /// Middle of the chirp after the middle of the loop, s.
    pub time: f64,
    /// By how many rows of velocity its signals are moved on.
    pub shift: usize,
}

/// What one launch contributes to a stream.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StreamPart {
    pub launch: usize,
    pub receiver: usize,
    /// 1 or -1.
    pub code: f32,
}

/// An axis of a cube.
#[derive(Clone, Debug)]
pub(crate) struct CubeAxis {
    /// Cells that are kept.
    pub cells: usize,
    /// After how many cells waves appear again at the same place; 0: nowhere.
    pub period: usize,
    /// Sign with which they do.
    pub wrap: f32,
    /// The window, such that its sum is 1.
    pub window: Vec<f64>,
    pub response: CellResponse,
    /// Of noise.
    pub correlation: Correlation,
}

impl CubeAxis {
    fn new(window: FftWindow, count: usize, cells: usize, orders: usize) -> Self {
        let mut samples = window.samples(count);
        let sum: f64 = samples.iter().sum();
        // A window of two samples may have nothing but its zeros.
        match sum > 0.0 {
            true => samples.iter_mut().for_each(|sample| *sample /= sum),
            false => samples.fill(1.0 / count as f64),
        }
        let response = CellResponse::of_window(&samples, orders);
        // About the middle of the samples: exp(-j pi (N - 1)) is the sign.
        let wrap = if count.is_multiple_of(2) { -1.0 } else { 1.0 };
        let correlation = Correlation::of_window(&samples);
        CubeAxis { cells, period: count, wrap, window: samples, response, correlation }
    }

    /// `place` in cells as it appears, from 0 to the period, with its sign.
    pub fn fold(&self, place: f64) -> (f64, f32) {
        if self.period == 0 {
            return (place, 1.0);
        }
        let turns = (place / self.period as f64).floor();
        let sign = if turns.rem_euclid(2.0) == 0.0 { 1.0 } else { self.wrap };
        (place - turns * self.period as f64, sign)
    }
}

impl RadarPlan {
    /// The radar of a `waveform` and an `array` whose cubes are formed with `windows` along range and velocity. The
    /// errors of its channels are those of the instrument number `seed`. Pulses need no window along range.
    ///
    /// # Errors
    /// As [`RadarWaveform::check`], [`ArraySpec::check`] and [`FftWindow::check`].
    pub fn new(waveform: &RadarWaveform, array: &ArraySpec, windows: [FftWindow; 2], seed: u64) -> Result<Self> {
        let bounds = &mut Bounds::none();
        array.check(bounds)?;
        waveform.check(bounds, array.tx.len(), array.rx.len())?;
        windows[0].check("range_window", bounds)?;
        windows[1].check("velocity_window", bounds)?;
        let transmitters = array.tx.len();
        let axes = waveform.axes(transmitters);
        let (launches, streams) = launches(waveform, transmitters, array.rx.len());
        let mut velocity = CubeAxis::new(windows[1], axes.velocity.len, axes.velocity.len, MOST_ORDERS);
        let (range, frequency, slope, repetition) = match waveform {
            RadarWaveform::Fmcw(fmcw) => (
                CubeAxis::new(windows[0], fmcw.samples as usize, axes.range.len, 1),
                fmcw.centre_frequency() - 0.5 * fmcw.slope() / fmcw.sample_rate(),
                fmcw.slope(),
                fmcw.repetition(transmitters),
            ),
            RadarWaveform::Pulse(pulse) => {
                if !pulse.coherent {
                    velocity = CubeAxis::new(FftWindow::Rect, 1, 1, 1);
                }
                let range = CubeAxis {
                    cells: axes.range.len,
                    period: 0,
                    wrap: 1.0,
                    window: Vec::new(),
                    response: CellResponse::of_pulse(pulse.pulse_cells()),
                    correlation: Correlation::of_pulse(pulse.pulse_cells()),
                };
                (range, pulse.frequency(), 0.0, pulse.repetition())
            }
        };
        let wavelength = waveform.wavelength();
        let mut virtual_array = array.virtual_array(wavelength);
        let looks = streams.len() / array.rx.len();
        if let RadarWaveform::Pulse(_) = waveform {
            virtual_array.places = virtual_array.places.repeat(looks);
        }
        let [tx, rx] = array.places(wavelength);
        Ok(RadarPlan {
            waveform: waveform.clone(),
            axes,
            array: virtual_array,
            transmitters: tx,
            receivers: rx,
            patterns: [array.tx_pattern.table(), array.rx_pattern.table()],
            errors: array.errors(seed),
            launches,
            streams,
            range,
            velocity,
            frequency,
            slope,
            repetition,
        })
    }

    /// Axes of its cubes.
    pub fn axes(&self) -> CubeAxes {
        self.axes
    }

    /// Its channels as an array. Pulses without coherence have those of the first pulse, then those of the second, and
    /// so on.
    pub fn array(&self) -> &VirtualArray {
        &self.array
    }

    /// How long after the middle of a frame each channel is sampled, on average, s: with `tdm`, a Doppler shift turns
    /// their phases accordingly; otherwise 0.
    pub fn channel_times(&self) -> Vec<f64> {
        let receivers = self.receivers.len();
        let time = |channel: usize| match self.one_each() {
            true => self.launches[channel / receivers].time,
            false => 0.0,
        };
        (0..self.array.places.len()).map(time).collect()
    }

    /// Whether a stream is that of one launch, and therefore a channel.
    pub(crate) fn one_each(&self) -> bool {
        self.launches.len() * self.receivers.len() == self.streams.len()
    }

    /// A cube of silent streams.
    pub fn silent_streams(&self) -> RadarCube {
        let channels = self.streams.len();
        let cells = vec![Complex32::ZERO; channels * self.range.cells * self.velocity.cells];
        RadarCube { axes: self.axes, channels, cells }
    }

    /// Bandwidth of the noise in a cell of a stream, Hz: that of a sample, over the number of samples, times the noise
    /// bandwidths of the windows. Of pulses, it is that of the filter, `1 / tau`.
    fn noise_bandwidth(&self) -> f64 {
        let velocity = noise_bandwidth(&self.velocity.window) / self.velocity.window.len() as f64;
        velocity
            * match &self.waveform {
                RadarWaveform::Fmcw(fmcw) => {
                    fmcw.sample_rate() * noise_bandwidth(&self.range.window) / f64::from(fmcw.samples)
                }
                RadarWaveform::Pulse(pulse) => 1e6 / pulse.pulse_us,
            }
    }

    /// Mean power of thermal noise in a cell of a stream, W: `k T_0 F B`. The noise figure is that of one side band:
    /// the same signal-to-noise ratio results whether samples are complex or real.
    pub fn stream_noise(&self, noise_figure_db: f64) -> f64 {
        noise_density(noise_figure_db) * self.noise_bandwidth()
    }

    /// Likewise in a cell of a channel: decoding averages over the code words of `bpm`.
    pub fn channel_noise(&self, noise_figure_db: f64) -> f64 {
        let words = match &self.waveform {
            RadarWaveform::Fmcw(fmcw) if fmcw.multiplex == Multiplex::Bpm => fmcw.slots(self.transmitters.len()),
            _ => 1,
        };
        self.stream_noise(noise_figure_db) / words as f64
    }

    /// Place along the axis of velocity, cells, of a Doppler shift by `shift` Hz, before it is folded.
    pub(crate) fn row_of(&self, shift: f64) -> f64 {
        shift * self.velocity.cells as f64 * self.repetition + (self.velocity.cells / 2) as f64
    }

    /// Where an echo from `range` m with the range rate `rate` m/s appears, in cells along range and velocity, folded.
    pub fn cells_of(&self, range: f64, rate: f64) -> [f64; 2] {
        let place = self.range_of(range, rate);
        let rows = self.row_of(2.0 * rate * (self.frequency - self.slope * 2.0 * range / LIGHT_SPEED) / LIGHT_SPEED);
        [self.range.fold(place).0, self.velocity.fold(rows).0]
    }

    /// Place along the axis of range, cells, before it is folded.
    pub fn range_of(&self, range: f64, rate: f64) -> f64 {
        match &self.waveform {
            RadarWaveform::Fmcw(fmcw) => (range + fmcw.coupling(rate)) / self.axes.range.step,
            // An echo may arrive after later pulses.
            RadarWaveform::Pulse(pulse) => range.rem_euclid(pulse.greatest_range()) / self.axes.range.step,
        }
    }
}

/// Sign of an element of Sylvester's Hadamard matrix.
pub(crate) fn hadamard(row: usize, column: usize) -> f32 {
    if (row & column).count_ones().is_multiple_of(2) { 1.0 } else { -1.0 }
}

/// The launches of a loop, and the streams that they make at `receivers`.
fn launches(
    waveform: &RadarWaveform,
    transmitters: usize,
    receivers: usize,
) -> (Vec<SlotLaunch>, Vec<Vec<StreamPart>>) {
    // Chirps of a loop (or pulses without coherence) and their spacing, and with which sign a transmitter is heard.
    let (slots, spacing, shift) = match waveform {
        RadarWaveform::Fmcw(fmcw) => {
            let shift = fmcw.bands.map_or(0, |bands| (fmcw.chirps / bands.max(1)) as usize);
            (fmcw.slots(transmitters), fmcw.chirp_time(), shift)
        }
        RadarWaveform::Pulse(pulse) if pulse.coherent => (1, 0.0, 0),
        RadarWaveform::Pulse(pulse) => (pulse.pulses as usize, pulse.repetition(), 0),
    };
    let code = |slot: usize, transmitter: usize| match waveform {
        RadarWaveform::Fmcw(fmcw) => match fmcw.multiplex {
            Multiplex::Tdm => {
                if slot == transmitter {
                    1.0
                } else {
                    0.0
                }
            }
            Multiplex::Bpm => hadamard(slot, transmitter),
            Multiplex::Ddm => 1.0,
        },
        RadarWaveform::Pulse(_) => 1.0,
    };
    let (mut launches, mut streams) = (Vec::new(), Vec::new());
    for slot in 0..slots {
        let first = launches.len();
        let time = (slot as f64 - 0.5 * (slots as f64 - 1.0)) * spacing;
        let active: Vec<usize> = (0..transmitters).filter(|&transmitter| code(slot, transmitter) != 0.0).collect();
        let launch = |&transmitter: &usize| SlotLaunch { transmitter, time, shift: transmitter * shift };
        launches.extend(active.iter().map(launch));
        for receiver in 0..receivers {
            let part = |(launch, &transmitter): (usize, &usize)| StreamPart {
                launch,
                receiver,
                code: code(slot, transmitter),
            };
            streams.push((first..).zip(&active).map(part).collect());
        }
    }
    (launches, streams)
}
