//! Keys for sonars only: the section `acoustics` of a sensor file.

use super::Sensor;
use crate::echo::Taper;
use cloud::cells::SonarView;
use emitter::pattern::{Flat, Pattern};
use emitter::{BeamTable, Transducer};
use ground::error::{Error, Result};
use ground::pose::Pose;
use ground::read::bounds::Bounds;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::sync::{Arc, PoisonError};

/// `acoustics`: sound, transmitter and receiver. Levels are dB re 1 uPa; the source level at 1 m.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct AcousticsSpec {
    /// Centre frequency, kHz, 1 to 5000.
    pub frequency_khz: f64,
    /// Source level, dB re 1 uPa at 1 m, 0 to 300.
    #[serde(default = "source_level")]
    pub source_level_db: f64,
    /// Bandwidth of the pulse, kHz, from that whose resolution is the greatest range to twice the frequency; without
    /// it, that of an unmodulated pulse of `pulse_ms`, its inverse.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bandwidth_khz: Option<f64>,
    /// Length of the pulse, ms, 0.0001 to 10000.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pulse_ms: Option<f64>,
    /// Direction of the frequency sweep of a pulse with a bandwidth and a length, on which the ranges of moving objects
    /// depend.
    #[serde(default, skip_serializing_if = "is_default")]
    pub sweep: Sweep,
    /// Noise within the bandwidth, dB re 1 uPa, -200 to 300; without it the ambient noise of the water.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub noise_level_db: Option<f64>,
    /// Directivity index of the receiver, dB, -10 to 100, which reduces noise; without it, that of its beam.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub directivity_index_db: Option<f64>,
    /// Gain of the matched filter, dB, -100 to 100, which reduces noise; without it, `10 log(bandwidth x length of
    /// the pulse)`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub processing_gain_db: Option<f64>,
    /// Level by which an echo must exceed noise and volume reverberation to be reported, dB, -100 to 100.
    #[serde(default = "threshold")]
    pub detection_threshold_db: f64,
    /// Length of a range bin, m, 0.001 to 1000 and at least 0.0044 of the resolution (0.0005 of an unmodulated pulse);
    /// without it half the resolution `c / (2 bandwidth)`. Longer bins hold the mean power of what they cover: the
    /// level of an area stays the same, that of a point falls.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bin_m: Option<f64>,
    /// Weighting of the matched filter.
    #[serde(default, skip_serializing_if = "is_default")]
    pub taper: Taper,
    /// How the random scatterers of a surface modulate its echo.
    #[serde(default, skip_serializing_if = "is_default")]
    pub speckle: Speckle,
    /// Shape of the gamma-distributed texture that turns Rayleigh-distributed echoes into K-distributed ones, 0.1 to
    /// 1000; there is no texture if speckle is off.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub texture_shape: Option<f64>,
    /// Number of reflections at the sea surface and the scene over which sound is traced, 0 to 8; it returns the way it
    /// came, or directly from where it arrived. Sound that is transmitted directly and returns over reflections is
    /// included.
    #[serde(default)]
    pub bounces: u8,
    /// Gain over range that images are drawn with.
    #[serde(default)]
    pub tvg: Tvg,
    /// Sound speed that the beamformer of a `multibeam` or `imaging` sonar assumes, m/s, 100 to 10000; without it the
    /// true one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub array_speed_m_s: Option<f64>,
    /// Whether the sonar is at rest from a ping to its last echo; otherwise it receives at the pose that it has by
    /// then.
    #[serde(default, skip_serializing_if = "is_default")]
    pub stop_and_hop: bool,
    /// Whether echoes may arrive after the next ping, and are then taken for echoes of that ping.
    #[serde(default, skip_serializing_if = "is_default")]
    pub allow_ambiguity: bool,
}

/// Direction of a frequency sweep.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Sweep {
    /// Upwards: approaching objects appear too near.
    #[default]
    Up,
    /// Downwards.
    Down,
}

/// How the random scatterers of a surface modulate its echo.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Speckle {
    /// Rayleigh-distributed amplitude: each ray, on each return path, has its own random scatterer in every patch of a
    /// surface, a third of the range resolution wide, the same in all pings of a seed. If nothing moves, echoes repeat;
    /// another ray that hits the same patch finds another scatterer.
    #[default]
    Frozen,
    /// No speckle: the mean level.
    Off,
}

/// `acoustics.tvg`: time-varied gain, `spreading log10(r) + 2 absorption r + gain_db` dB.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct Tvg {
    /// Factor of the logarithm, 0 to 60: 40 for point targets, 30 for areas, 20 for volumes.
    pub spreading: f64,
    /// Absorption, dB/m, 0 to 10; without it that of the water at the sonar.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub absorption_db_m: Option<f64>,
    /// Gain everywhere, dB, -200 to 200.
    pub gain_db: f64,
}

impl Default for Tvg {
    fn default() -> Self {
        Tvg { spreading: 30.0, absorption_db_m: None, gain_db: 0.0 }
    }
}

fn source_level() -> f64 {
    210.0
}

fn threshold() -> f64 {
    10.0
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

impl AcousticsSpec {
    /// Checks that all values are within their allowed ranges, and that those about the pulse go together.
    #[doc(hidden)]
    pub fn check(&self, bounds: &mut Bounds) -> Result<()> {
        let key = |name: &str| format!("acoustics.{name}");
        bounds.within(key("frequency_khz"), self.frequency_khz, 1.0, 5000.0)?;
        bounds.within(key("source_level_db"), self.source_level_db, 0.0, 300.0)?;
        // A wider one would not be a band around the frequency.
        let widest = 2.0 * self.frequency_khz;
        let allowed = format!("above 0 to twice acoustics.frequency_khz ({widest})");
        bounds.number(key("bandwidth_khz"), self.bandwidth_khz, [f64::MIN_POSITIVE, widest], &allowed)?;
        bounds.number(key("pulse_ms"), self.pulse_ms, [1e-4, 1e4], "0.0001 to 10000")?;
        match (self.bandwidth_khz, self.pulse_ms) {
            (Some(bandwidth), _) => {
                let lowest = 0.5 * bandwidth;
                let allowed = format!("at least half of acoustics.bandwidth_khz ({lowest})");
                bounds.number(key("frequency_khz"), self.frequency_khz, [lowest, f64::INFINITY], allowed)?;
            }
            (None, Some(pulse)) => {
                let shortest = 1.0 / widest;
                let allowed = format!("at least {shortest}, half a period of the sound, without a bandwidth_khz");
                bounds.number(key("pulse_ms"), pulse, [shortest, f64::INFINITY], allowed)?;
            }
            (None, None) => {
                let allowed = "this or acoustics.pulse_ms, or both";
                return Err(Error::invalid(key("bandwidth_khz"), "missing", allowed));
            }
        }
        bounds.within(key("noise_level_db"), self.noise_level_db, -200.0, 300.0)?;
        bounds.within(key("directivity_index_db"), self.directivity_index_db, -10.0, 100.0)?;
        bounds.within(key("processing_gain_db"), self.processing_gain_db, -100.0, 100.0)?;
        bounds.within(key("detection_threshold_db"), self.detection_threshold_db, -100.0, 100.0)?;
        bounds.within(key("bin_m"), self.bin_m, 1e-3, 1000.0)?;
        bounds.within(key("texture_shape"), self.texture_shape, 0.1, 1000.0)?;
        if self.taper != Taper::None && self.bandwidth_khz.is_none() {
            let allowed = "with acoustics.bandwidth_khz only: the filter of a pulse that is modulated";
            return Err(Error::invalid(key("taper"), "given", allowed));
        }
        if self.sweep != Sweep::Up && self.lead() == 0.0 {
            let allowed = "with acoustics.bandwidth_khz and pulse_ms only";
            return Err(Error::invalid(key("sweep"), "down", allowed));
        }
        bounds.within(key("bounces"), f64::from(self.bounces), 0.0, 8.0)?;
        bounds.within(key("tvg.spreading"), self.tvg.spreading, 0.0, 60.0)?;
        bounds.within(key("tvg.absorption_db_m"), self.tvg.absorption_db_m, 0.0, 10.0)?;
        bounds.within(key("tvg.gain_db"), self.tvg.gain_db, -200.0, 200.0)?;
        bounds.within(key("array_speed_m_s"), self.array_speed_m_s, 100.0, 10_000.0)
    }

    /// Centre frequency, Hz.
    pub fn frequency(&self) -> f64 {
        1e3 * self.frequency_khz
    }

    /// Bandwidth of the pulse, Hz.
    pub fn bandwidth(&self) -> f64 {
        self.bandwidth_khz
            .map_or_else(|| self.pulse_ms.map_or(f64::NAN, |pulse| 1e3 / pulse), |bandwidth| 1e3 * bandwidth)
    }

    /// Time by which the ranges of moving objects lead, `f T / B` for a pulse that sweeps up by its bandwidth over its
    /// length, s; 0 for one without a bandwidth, or of unknown length.
    pub fn lead(&self) -> f64 {
        let (Some(bandwidth), Some(pulse)) = (self.bandwidth_khz, self.pulse_ms) else { return 0.0 };
        let lead = 1e-3 * self.frequency_khz * pulse / bandwidth;
        match self.sweep {
            Sweep::Up => lead,
            Sweep::Down => -lead,
        }
    }

    /// Gain of the matched filter, dB.
    pub fn processing_gain(&self) -> f64 {
        let of_pulse = || match (self.bandwidth_khz, self.pulse_ms) {
            (Some(bandwidth), Some(pulse)) => (10.0 * (bandwidth * pulse).log10()).max(0.0),
            _ => 0.0,
        };
        self.processing_gain_db.unwrap_or_else(of_pulse)
    }

    /// Range resolution where sound travels at `speed` m/s, m: `c / (2 B)`, for an unmodulated pulse `c tau / 2`.
    pub fn resolution(&self, speed: f64) -> f64 {
        0.5 * speed / self.bandwidth()
    }
}

impl Sensor {
    /// Sound, transmitter and receiver.
    ///
    /// # Errors
    /// A sensor that is not a sonar.
    pub fn acoustics(&self) -> Result<&AcousticsSpec> {
        let kind = self.kind();
        self.spec.acoustics.as_ref().ok_or_else(|| Error::invalid("kind of the sensor", kind, "sonar, which pings"))
    }

    /// Which kind of images its pings make.
    pub(crate) fn sonar_view(&self) -> SonarView {
        SonarView::of(&self.spec.pattern)
    }

    /// How its points are laid out in one plane, if they are.
    #[doc(hidden)]
    pub fn flat(&self) -> Option<Flat> {
        match &self.spec.pattern {
            Pattern::Sidescan(sidescan) => sidescan.flat,
            _ => None,
        }
    }

    /// Orientation of the beams of a sonar at `pose` for ping `number`: rotating beams turn with each ping.
    #[doc(hidden)]
    pub fn turned(&self, pose: Pose, number: u32) -> Pose {
        match &self.spec.pattern {
            Pattern::SingleBeam(beam) => {
                let turn = glam::DQuat::from_rotation_z(beam.azimuth_deg(number).to_radians());
                Pose { orientation: pose.orientation * turn, ..pose }
            }
            _ => pose,
        }
    }

    /// The transducer of a sonar at `wavelength` m, where sound is `ratio` times as fast as its beamformer assumes. One
    /// wavelength is used for all that hardly differ from it.
    pub(crate) fn transducer(&self, wavelength: f64, ratio: f64) -> Arc<Transducer> {
        /// Steps of the wavelength and of the ratio, as a fraction of them: beams turn with the ratio.
        const STEPS: [f64; 2] = [1e-3, 1e-4];
        /// A sonar that moves up and down uses a few; they must not fill the memory.
        const MOST: usize = 16;
        let step = |value: f64, step: f64| ((value.ln() / step).round() * step).exp();
        let (wavelength, ratio) = (step(wavelength, STEPS[0]), step(ratio, STEPS[1]));
        let mut known = self.transducers.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((.., found)) = known.iter().find(|known| (known.0, known.1) == (wavelength, ratio)) {
            return found.clone();
        }
        let made = Transducer::new(&self.spec.pattern, wavelength, ratio).unwrap_or_default();
        if known.len() == MOST {
            known.remove(0);
        }
        known.push((wavelength, ratio, Arc::new(made)));
        known[known.len() - 1].2.clone()
    }

    /// Rays of one scan: one per beam, except for a sonar, where many rays sample a beam.
    pub fn ray_count(&self) -> usize {
        if self.spec.acoustics.is_some() { self.rays().len() } else { self.beams.len() }
    }

    /// The rays that sample its beams; for a sonar, in water of 1500 m/s.
    pub(crate) fn rays(&self) -> Cow<'_, BeamTable> {
        let Some(acoustics) = &self.spec.acoustics else { return Cow::Borrowed(&self.beams) };
        let transducer = self.transducer(1500.0 / acoustics.frequency(), 1.0);
        let [dir_x, dir_y, dir_z] = transducer.direction.clone();
        let rays = dir_x.len();
        let mut table = BeamTable::clone(&self.beams);
        (table.rows, table.columns) = (1, rays as u32);
        (table.dir_x, table.dir_y, table.dir_z) = (dir_x, dir_y, dir_z);
        (table.time, table.channel) = (vec![0.0; rays], vec![0; rays]);
        Cow::Owned(table)
    }
}
