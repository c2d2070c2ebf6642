//! What a radar transmits and how it samples echoes: the keys of sensor files, and what follows from them.

use crate::LIGHT_SPEED;
use crate::cube::{Axis, CubeAxes};
use ground::error::{Error, Result};
use ground::read::bounds::Bounds;
use ground::read::yaml::split_tag;
use serde::{Deserialize, Deserializer, Serialize};

/// Most cells of a cube, over all channels: 2 GiB of amplitudes.
pub const MOST_CELLS: u64 = 1 << 28;

/// The waveform of a radar, selected by `type`.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "type", rename_all = "snake_case")]
#[non_exhaustive]
pub enum RadarWaveform {
    /// Chirps, whose frequency rises linearly.
    Fmcw(Fmcw),
    /// Pulses of one frequency.
    Pulse(RadarPulse),
}

impl<'de> Deserialize<'de> for RadarWaveform {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let (word, section) = split_tag(deserializer, "type")?;
        match word.as_str() {
            "fmcw" => section.read().map(RadarWaveform::Fmcw),
            "pulse" => section.read().map(RadarWaveform::Pulse),
            _ => Err(section.unknown(&word, &["fmcw", "pulse"])),
        }
    }
}

/// `type: fmcw`: chirps, sampled after they are mixed with what is being transmitted. Frequencies rise.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Fmcw {
    /// Frequency at which a ramp begins, GHz, 1 to 300.
    pub start_ghz: f64,
    /// Slope of the ramp, MHz/us, 0.001 to 10,000.
    pub slope_mhz_per_us: f64,
    /// Samples of a chirp, 2 to 65,536.
    pub samples: u32,
    /// Rate of sampling, MHz, 0.001 to 100,000.
    pub sample_rate_mhz: f64,
    /// Whether in-phase and quadrature signals are sampled; otherwise, one signal, which reaches half as far.
    #[serde(default = "yes")]
    pub complex: bool,
    /// Pause before a ramp, us, 0 to 1,000,000.
    #[serde(default)]
    pub idle_us: f64,
    /// Time from the beginning of the ramp to the first sample, us, 0 to 1,000,000.
    #[serde(default)]
    pub adc_start_us: f64,
    /// Length of the ramp, us, up to 1,000,000: no shorter than until the last sample has been taken.
    pub ramp_us: f64,
    /// Chirps of each transmitter in a frame, 1 to 65,536; with `bpm`, blocks in which every code occurs once.
    pub chirps: u32,
    /// How signals of several transmitters are told apart.
    #[serde(default)]
    pub multiplex: Multiplex,
    /// Only with `multiplex: ddm`, and required there: into how many bands the velocities are divided, at least one for
    /// each transmitter; a divisor of `chirps`. Those that are left over resolve ambiguities.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bands: Option<u32>,
    /// By how much the filter before the converter attenuates frequencies that are not sampled and therefore appear as
    /// others, dB, 0 to 200.
    #[serde(default = "anti_alias")]
    pub anti_alias_db: f64,
}

/// How signals of several transmitters are told apart.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Multiplex {
    /// By time: they transmit in turn.
    #[default]
    Tdm,
    /// By codes of phases of 0 and 180 degrees from chirp to chirp: the columns of a Hadamard matrix.
    Bpm,
    /// By Doppler: each turns its phase from chirp to chirp by another step.
    Ddm,
}

/// `type: pulse`: pulses of one frequency, sampled after a filter that matches their rectangular shape.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct RadarPulse {
    /// Frequency, GHz, 1 to 300.
    pub frequency_ghz: f64,
    /// Length of a pulse, us, 0.0001 to 10,000.
    pub pulse_us: f64,
    /// Pulses per second, kHz, 0.001 to 10,000.
    pub repetition_khz: f64,
    /// Pulses of a frame, 1 to 65,536.
    pub pulses: u32,
    /// Whether the phase is known from pulse to pulse, so that velocities are measured; otherwise each pulse gives a
    /// channel of its own.
    #[serde(default)]
    pub coherent: bool,
    /// Rate of sampling, MHz, 0.001 to 100,000, at least once per pulse.
    pub sample_rate_mhz: f64,
    /// Samples after each pulse, 2 to 65,536, before the next one.
    pub samples: u32,
}

fn yes() -> bool {
    true
}

fn anti_alias() -> f64 {
    60.0
}

impl Fmcw {
    /// Sampled bandwidth, Hz: `S N / f_s`.
    pub fn bandwidth(&self) -> f64 {
        self.slope() * f64::from(self.samples) / self.sample_rate()
    }

    /// Slope, Hz/s.
    pub fn slope(&self) -> f64 {
        1e12 * self.slope_mhz_per_us
    }

    /// Rate of sampling, Hz.
    pub fn sample_rate(&self) -> f64 {
        1e6 * self.sample_rate_mhz
    }

    /// Middle of the sampled band, Hz.
    pub fn centre_frequency(&self) -> f64 {
        1e9 * self.start_ghz + self.slope() * 1e-6 * self.adc_start_us + 0.5 * self.bandwidth()
    }

    /// Wavelength there, m.
    pub fn wavelength(&self) -> f64 {
        LIGHT_SPEED / self.centre_frequency()
    }

    /// Range from cell to cell, which is the resolution, m: `c / 2B`.
    pub fn range_step(&self) -> f64 {
        0.5 * LIGHT_SPEED / self.bandwidth()
    }

    /// Cells of range.
    pub fn range_cells(&self) -> u32 {
        if self.complex { self.samples } else { self.samples / 2 }
    }

    /// Greatest unambiguous range, m: `f_s c / 2S`, half of it without quadrature.
    pub fn greatest_range(&self) -> f64 {
        let whole = 0.5 * self.sample_rate() * LIGHT_SPEED / self.slope();
        if self.complex { whole } else { 0.5 * whole }
    }

    /// From chirp to chirp, s.
    pub fn chirp_time(&self) -> f64 {
        1e-6 * (self.idle_us + self.ramp_us)
    }

    /// Chirps of a loop, in which every one of `transmitters` has its turn.
    pub fn slots(&self, transmitters: usize) -> usize {
        match self.multiplex {
            Multiplex::Tdm => transmitters,
            // Sylvester's Hadamard matrices exist for powers of two.
            Multiplex::Bpm => transmitters.next_power_of_two(),
            Multiplex::Ddm => 1,
        }
    }

    /// From loop to loop, s.
    pub fn repetition(&self, transmitters: usize) -> f64 {
        self.slots(transmitters) as f64 * self.chirp_time()
    }

    /// From the first pause to the end of the last ramp, s.
    pub fn duration(&self, transmitters: usize) -> f64 {
        f64::from(self.chirps) * self.repetition(transmitters)
    }

    /// Range rate from cell to cell, m/s: `lambda / (2 N_c T_r)`.
    pub fn velocity_step(&self, transmitters: usize) -> f64 {
        0.5 * self.wavelength() / self.duration(transmitters)
    }

    /// Greatest unambiguous range rate, m/s: `lambda / (4 T_r)`.
    pub fn greatest_velocity(&self, transmitters: usize) -> f64 {
        0.25 * self.wavelength() / self.repetition(transmitters)
    }

    /// Frequency at which a target appears, Hz, whose distance is `range` m and range rate `rate` m/s:
    /// `2 S r / c + 2 v f_c / c`.
    pub fn beat(&self, range: f64, rate: f64) -> f64 {
        2.0 * (self.slope() * range + rate * self.centre_frequency()) / LIGHT_SPEED
    }

    /// By how much a target that recedes by `rate` m/s appears too far, m: `v f_c / S`.
    pub fn coupling(&self, rate: f64) -> f64 {
        rate * self.centre_frequency() / self.slope()
    }

    /// Phase by which the echo of a target that recedes by `rate` m/s advances from one chirp to the next, radians:
    /// `4 pi v T_c / lambda`.
    pub fn slot_phase(&self, rate: f64) -> f64 {
        2.0 * std::f64::consts::TAU * rate * self.chirp_time() / self.wavelength()
    }

    /// Cells of range that a target crosses during a frame at `rate` m/s.
    pub fn migration(&self, rate: f64, transmitters: usize) -> f64 {
        rate * self.duration(transmitters) / self.range_step()
    }

    /// When, after the beginning of the frame, the middle of it is, s: the mean time of all samples, at which ranges of
    /// paths are meant.
    pub fn middle(&self, transmitters: usize) -> f64 {
        let ramps = (self.slots(transmitters) as f64 * f64::from(self.chirps) - 1.0) * self.chirp_time();
        let sampled = 0.5 * (f64::from(self.samples) - 1.0) / self.sample_rate();
        0.5 * ramps + 1e-6 * (self.idle_us + self.adc_start_us) + sampled
    }

    fn check(&self, bounds: &mut Bounds, transmitters: usize) -> Result<()> {
        let key = |name: &str| format!("waveform.{name}");
        bounds.within(key("start_ghz"), self.start_ghz, 1.0, 300.0)?;
        bounds.within(key("slope_mhz_per_us"), self.slope_mhz_per_us, 1e-3, 1e4)?;
        bounds.within(key("samples"), f64::from(self.samples), 2.0, 65_536.0)?;
        bounds.within(key("sample_rate_mhz"), self.sample_rate_mhz, 1e-3, 1e5)?;
        bounds.within(key("idle_us"), self.idle_us, 0.0, 1e6)?;
        bounds.within(key("adc_start_us"), self.adc_start_us, 0.0, 1e6)?;
        // The ramp of most boards ends a little after the last sample; rounded figures must not be refused.
        let last = self.adc_start_us + f64::from(self.samples) / self.sample_rate_mhz;
        let least = (last * (1.0 - 1e-9)).min(1e6);
        let allowed = format!("{last:.6}, when the last sample has been taken (adc_start_us + samples / rate), to 1e6");
        bounds.number(key("ramp_us"), self.ramp_us, [least, 1e6], allowed)?;
        bounds.within(key("chirps"), f64::from(self.chirps), 1.0, 65_536.0)?;
        bounds.within(key("anti_alias_db"), self.anti_alias_db, 0.0, 200.0)?;
        match (self.multiplex, self.bands) {
            (Multiplex::Ddm, Some(bands)) => {
                let allowed = format!("one for each of {transmitters} transmitters, or more, a divisor of chirps");
                bounds.number(
                    key("bands"),
                    f64::from(bands),
                    [transmitters as f64, f64::from(self.chirps)],
                    &allowed,
                )?;
                if !self.chirps.is_multiple_of(bands) {
                    return Err(Error::invalid(key("bands"), bands, allowed));
                }
            }
            (Multiplex::Ddm, None) => {
                return Err(Error::invalid(key("bands"), "missing", "a number, with multiplex: ddm"));
            }
            (_, Some(_)) => return Err(Error::invalid(key("bands"), "given", "with multiplex: ddm only")),
            _ => {}
        }
        Ok(())
    }
}

impl RadarPulse {
    /// Frequency, Hz.
    pub fn frequency(&self) -> f64 {
        1e9 * self.frequency_ghz
    }

    /// From pulse to pulse, s.
    pub fn repetition(&self) -> f64 {
        1e-3 / self.repetition_khz
    }

    /// Range from cell to cell, m: `c / 2 f_s`.
    pub fn range_step(&self) -> f64 {
        0.5 * LIGHT_SPEED / (1e6 * self.sample_rate_mhz)
    }

    /// Range resolution, m: `c tau / 2`.
    pub fn resolution(&self) -> f64 {
        0.5e-6 * LIGHT_SPEED * self.pulse_us
    }

    /// Length of a pulse, cells of range.
    pub fn pulse_cells(&self) -> f64 {
        self.pulse_us * self.sample_rate_mhz
    }

    /// Range beyond which echoes arrive after the next pulse, m: `c T_r / 2`.
    pub fn greatest_range(&self) -> f64 {
        0.5 * LIGHT_SPEED * self.repetition()
    }

    fn check(&self, bounds: &mut Bounds) -> Result<()> {
        let key = |name: &str| format!("waveform.{name}");
        bounds.within(key("frequency_ghz"), self.frequency_ghz, 1.0, 300.0)?;
        bounds.within(key("pulse_us"), self.pulse_us, 1e-4, 1e4)?;
        bounds.within(key("repetition_khz"), self.repetition_khz, 1e-3, 1e4)?;
        bounds.within(key("pulses"), f64::from(self.pulses), 1.0, 65_536.0)?;
        bounds.within(key("samples"), f64::from(self.samples), 2.0, 65_536.0)?;
        let rates = [(1.0 / self.pulse_us).max(1e-3), 1e5];
        let allowed = format!("{} (once per pulse_us) to 100000", rates[0]);
        bounds.number(key("sample_rate_mhz"), self.sample_rate_mhz, rates, allowed)?;
        let most = (1e3 / self.repetition_khz - self.pulse_us) * self.sample_rate_mhz;
        let allowed = format!("2 to {}, what fits between two pulses", most.max(0.0).floor());
        bounds.number(key("samples"), f64::from(self.samples), [2.0, most], allowed)
    }
}

impl RadarWaveform {
    /// Checks that all values are within their allowed ranges and go together, and that the cube of an array of
    /// `transmitters` and `receivers` is not too large: at most [`MOST_CELLS`] cells.
    ///
    /// # Errors
    /// Names the first value that is not allowed.
    pub fn check(&self, bounds: &mut Bounds, transmitters: usize, receivers: usize) -> Result<()> {
        match self {
            RadarWaveform::Fmcw(fmcw) => fmcw.check(bounds, transmitters)?,
            RadarWaveform::Pulse(pulse) => {
                pulse.check(bounds)?;
                if transmitters != 1 {
                    let found = format!("{transmitters} elements");
                    return Err(Error::invalid("array.tx", found, "1, with waveform.type: pulse"));
                }
            }
        }
        let (loops, cells) = match self {
            RadarWaveform::Fmcw(fmcw) => (fmcw.chirps, fmcw.samples),
            RadarWaveform::Pulse(pulse) => (pulse.pulses, pulse.samples),
        };
        let channels = (transmitters.max(1) as u64).saturating_mul(receivers as u64);
        let total = u64::from(loops).saturating_mul(cells.into()).saturating_mul(channels);
        if total > MOST_CELLS {
            let found = format!("{cells} samples of {loops} chirps or pulses in {channels} channels");
            return Err(Error::invalid("waveform", found, format!("together up to {MOST_CELLS}")));
        }
        Ok(())
    }

    /// Frequency of the carrier, Hz: for chirps, the middle of the sampled band.
    pub fn frequency(&self) -> f64 {
        match self {
            RadarWaveform::Fmcw(fmcw) => fmcw.centre_frequency(),
            RadarWaveform::Pulse(pulse) => pulse.frequency(),
        }
    }

    /// Its wavelength, m.
    pub fn wavelength(&self) -> f64 {
        LIGHT_SPEED / self.frequency()
    }

    /// Beginning of the frame to its middle, s, at which ranges of paths are meant.
    pub fn middle(&self, transmitters: usize) -> f64 {
        match self {
            RadarWaveform::Fmcw(fmcw) => fmcw.middle(transmitters),
            RadarWaveform::Pulse(pulse) => 0.5 * (f64::from(pulse.pulses) - 1.0) * pulse.repetition(),
        }
    }

    /// Length of a frame, s.
    pub fn duration(&self, transmitters: usize) -> f64 {
        match self {
            RadarWaveform::Fmcw(fmcw) => fmcw.duration(transmitters),
            RadarWaveform::Pulse(pulse) => f64::from(pulse.pulses) * pulse.repetition(),
        }
    }

    /// Axes of the cubes that it gives with an array of `transmitters`. Those of pulses without coherence have one cell
    /// of velocity, about 0.
    pub fn axes(&self, transmitters: usize) -> CubeAxes {
        let (step, cells, loops, repetition) = match self {
            RadarWaveform::Fmcw(fmcw) => {
                (fmcw.range_step(), fmcw.range_cells(), fmcw.chirps, fmcw.repetition(transmitters))
            }
            RadarWaveform::Pulse(pulse) => {
                let loops = if pulse.coherent { pulse.pulses } else { 1 };
                (pulse.range_step(), pulse.samples, loops, pulse.repetition())
            }
        };
        let rate = 0.5 * self.wavelength() / (f64::from(loops) * repetition);
        CubeAxes {
            range: Axis { first: 0.0, step, len: cells as usize },
            velocity: Axis { first: -rate * f64::from(loops / 2), step: rate, len: loops as usize },
        }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use ground::read::yaml::from_str;

    pub fn chirp(text: &str) -> Fmcw {
        let base = "{type: fmcw, start_ghz: 77, slope_mhz_per_us: 30, samples: 256, sample_rate_mhz: 10, ramp_us: 40, \
                    chirps: 64";
        match from_str("text", &format!("{base}{text}}}")).unwrap() {
            RadarWaveform::Fmcw(fmcw) => fmcw,
            RadarWaveform::Pulse(_) => unreachable!("the text says fmcw"),
        }
    }

    #[track_caller]
    fn close(found: f64, expected: f64) {
        assert!((found / expected - 1.0).abs() < 1e-6, "{found}, not {expected}");
    }

    /// A chirp of 768 MHz, three transmitters: computed from the formulas with NumPy.
    #[test]
    fn figures_follow_from_the_keys() {
        let fmcw = chirp("");
        close(fmcw.bandwidth(), 768e6);
        close(fmcw.range_step(), 0.195_177_4);
        close(fmcw.greatest_range(), 49.965_41);
        close(fmcw.wavelength(), 3.874_088e-3);
        close(fmcw.greatest_velocity(3), 8.071_018);
        close(fmcw.velocity_step(3), 0.252_219_3);
        close(fmcw.beat(30.0, 0.0), 6.004_154e6);
        close(fmcw.coupling(30.0), 0.077_384_0);
        close(fmcw.slot_phase(5.0), 0.648_739_5);
        close(fmcw.migration(30.0, 3), 1.180_465);
        let axes = RadarWaveform::Fmcw(fmcw.clone()).axes(3);
        close(axes.velocity.at(0.0), -8.071_018);
        assert_eq!((axes.velocity.at(32.0), axes.range.len, axes.velocity.len), (0.0, 256, 64));
        // An echo from the distance of a cell lies in it.
        close(fmcw.beat(axes.range.at(100.0), 0.0) / fmcw.sample_rate() * 256.0, 100.0);
        let halved = chirp(", complex: false");
        assert_eq!((halved.range_cells(), halved.greatest_range()), (128, 0.5 * fmcw.greatest_range()));
    }

    /// Likewise.
    #[test]
    fn wavelengths_of_bands() {
        for (ghz, mm) in [(77.0, 3.893_409), (60.0, 4.996_541), (24.125, 12.426_63)] {
            let text = format!(
                "{{type: pulse, frequency_ghz: {ghz}, pulse_us: 0.1, repetition_khz: 2, pulses: 8, sample_rate_mhz: 20, \
                 samples: 512}}"
            );
            let pulse: RadarWaveform = from_str("text", &text).unwrap();
            pulse.check(&mut Bounds::none(), 1, 1).unwrap();
            close(1e3 * pulse.wavelength(), mm);
            assert_eq!(pulse.axes(1).velocity.len, 1);
        }
    }

    /// Public configurations of a cascade (MMWCAS) and of a 60 GHz board (IWR6843 ODS), figures likewise.
    #[test]
    fn figures_of_boards() {
        let cascade =
            Fmcw { slope_mhz_per_us: 79.0327, sample_rate_mhz: 8.0, adc_start_us: 6.0, idle_us: 5.0, ..chirp("") };
        close(cascade.range_step(), 0.059_269_9);
        close(cascade.greatest_range(), 15.173_08);
        let board = Fmcw {
            start_ghz: 60.25,
            slope_mhz_per_us: 156.0,
            sample_rate_mhz: 12.5,
            ramp_us: 31.0,
            chirps: 32,
            ..chirp("")
        };
        close(board.bandwidth(), 3194.88e6);
        close(board.range_step(), 0.046_917_6);
    }

    #[test]
    fn chirps_that_cannot_be_sampled_are_refused() {
        let error = |change: &dyn Fn(&mut Fmcw), transmitters| {
            let mut fmcw = chirp("");
            change(&mut fmcw);
            let checked = RadarWaveform::Fmcw(fmcw).check(&mut Bounds::none(), transmitters, 4);
            checked.map_err(|error| error.to_string()).unwrap_err()
        };
        chirp("").check(&mut Bounds::none(), 3).unwrap();
        assert_eq!(error(&|fmcw| fmcw.samples = 0, 3), "waveform.samples is 0; allowed: 2 to 65536");
        assert_eq!(
            error(&|fmcw| fmcw.adc_start_us = 15.0, 3),
            "waveform.ramp_us is 40; allowed: 40.600000, when the last sample has been taken (adc_start_us + samples / \
             rate), to 1e6"
        );
        assert_eq!(
            error(&|fmcw| (fmcw.samples, fmcw.ramp_us, fmcw.chirps) = (65_536, 1e6, 65_536), 3),
            "waveform is 65536 samples of 65536 chirps or pulses in 12 channels; allowed: together up to 268435456"
        );
        assert!(error(&|fmcw| fmcw.slope_mhz_per_us = f64::NAN, 3).contains("slope_mhz_per_us"));
        assert!(error(&|fmcw| fmcw.bands = Some(16), 3).contains("with multiplex: ddm only"));
        let ddm = |bands| move |fmcw: &mut Fmcw| (fmcw.multiplex, fmcw.bands) = (Multiplex::Ddm, bands);
        for bands in [None, Some(0), Some(2), Some(5), Some(128)] {
            assert!(error(&ddm(bands), 3).contains("waveform.bands"), "{bands:?}");
        }
        let unknown = from_str::<RadarWaveform>("text", "{type: fmcw, start: 77}").unwrap_err().to_string();
        assert!(unknown.contains("start"), "{unknown}");
    }

    #[test]
    fn pulses_that_cannot_be_sampled_are_refused() {
        let pulse = RadarPulse {
            frequency_ghz: 9.41,
            pulse_us: 0.08,
            repetition_khz: 3.0,
            pulses: 4,
            coherent: false,
            sample_rate_mhz: 25.0,
            samples: 4096,
        };
        close(1e3 * RadarWaveform::Pulse(pulse.clone()).wavelength(), 31.858_9);
        let error = |pulse: RadarPulse| {
            RadarWaveform::Pulse(pulse).check(&mut Bounds::none(), 1, 1).map_err(|error| error.to_string())
        };
        error(pulse.clone()).unwrap();
        let slow = error(RadarPulse { sample_rate_mhz: 10.0, ..pulse.clone() }).unwrap_err();
        assert_eq!(slow, "waveform.sample_rate_mhz is 10; allowed: 12.5 (once per pulse_us) to 100000");
        let long = error(RadarPulse { samples: 10_000, ..pulse }).unwrap_err();
        assert_eq!(long, "waveform.samples is 10000; allowed: 2 to 8331, what fits between two pulses");
    }
}
