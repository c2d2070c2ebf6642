//! Keys for radars only: the section `radar` of a sensor file.

use super::Sensor;
use crate::echo::radar::RadarSurfaces;
use crate::trace::SharedSurfaces;
use ::radar::{
    ArraySpec, CubeGeometry, Detector, FftWindow, Interferer, Leakage, PhaseNoise, RadarDetectionSpec, RadarPlan,
    RadarWaveform, Sharing, WindowResponse, check_interferers,
};
use emitter::pattern::Pattern;
use ground::error::{Error, Result};
use ground::read::bounds::Bounds;
use serde::{Deserialize, Serialize};
use std::sync::{Arc, Mutex, PoisonError, Weak};

/// `radar`: waveform, antennas, receiver and detection of a radar.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct RadarSpec {
    /// What it transmits.
    pub waveform: RadarWaveform,
    /// Its elements; by default one that transmits and receives, without a pattern.
    #[serde(default)]
    pub array: ArraySpec,
    /// Power of each transmitter at its element, dBm, -100 to 120.
    pub power_dbm: f64,
    /// Noise figure of the receivers, dB, 0 to 50.
    #[serde(default = "noise_figure")]
    pub noise_figure_db: f64,
    /// Losses of both ways together, of radome, feeds and processing, dB, 0 to 100.
    #[serde(default, skip_serializing_if = "is_default")]
    pub loss_db: f64,
    /// Thickness of the film of water on the radome, mm, 0 to 10.
    #[serde(default, skip_serializing_if = "is_default")]
    pub wet_radome_mm: f64,
    /// Windows of the transforms.
    #[serde(default)]
    pub windows: RadarWindows,
    /// What transmitters leak into receivers.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub leakage: Option<Leakage>,
    /// Phase noise of its oscillator; without it, there is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub phase_noise: Option<PhaseNoise>,
    /// Other radars that transmit chirps towards it, up to 256.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub interferers: Vec<Interferer>,
    /// How echoes are detected.
    #[serde(default)]
    pub detection: RadarDetectionSpec,
    /// Most mirrors that a wave meets on its way to what scatters it, 0 to 3: 1 for the ground and ghosts in walls, 2 for
    /// corners of three faces.
    #[serde(default = "mirrors")]
    pub mirrors: u8,
    /// Whether rough surfaces return clutter.
    #[serde(default = "yes")]
    pub clutter: bool,
    /// Number of the instrument, on which the errors of its channels depend.
    #[serde(default, skip_serializing_if = "is_default")]
    pub instrument: u64,
}

/// `radar.windows`: weights of samples and chirps before they are transformed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct RadarWindows {
    /// Along range.
    pub range: FftWindow,
    /// Along velocity.
    pub velocity: FftWindow,
}

impl Default for RadarWindows {
    fn default() -> Self {
        RadarWindows { range: FftWindow::Hann, velocity: FftWindow::Hann }
    }
}

fn noise_figure() -> f64 {
    12.0
}

fn mirrors() -> u8 {
    2
}

fn yes() -> bool {
    true
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

impl RadarSpec {
    /// Checks that all values are within their allowed ranges.
    #[doc(hidden)]
    pub fn check(&self, bounds: &mut Bounds, pattern: &Pattern) -> Result<()> {
        bounds.section("radar", |bounds| {
            self.array.check(bounds)?;
            self.waveform.check(bounds, self.array.tx.len(), self.array.rx.len())?;
            self.phase_noise.as_ref().map_or(Ok(()), |noise| noise.check(bounds))?;
            check_interferers(&self.interferers, bounds)?;
            self.leakage.as_ref().map_or(Ok(()), |leakage| leakage.check(bounds))
        })?;
        bounds.within("radar.power_dbm", self.power_dbm, -100.0, 120.0)?;
        bounds.within("radar.noise_figure_db", self.noise_figure_db, 0.0, 50.0)?;
        bounds.within("radar.loss_db", self.loss_db, 0.0, 100.0)?;
        bounds.within("radar.wet_radome_mm", self.wet_radome_mm, 0.0, 10.0)?;
        bounds.within("radar.mirrors", f64::from(self.mirrors), 0.0, 3.0)?;
        self.windows.range.check("radar.windows.range", bounds)?;
        self.windows.velocity.check("radar.windows.velocity", bounds)?;
        self.detection.check("radar.detection", bounds)?;
        let elements = self.array.tx.len() * self.array.rx.len();
        if matches!(pattern, Pattern::RadarRotor(_)) && elements > 1 {
            let allowed = "one that transmits and one that receives with pattern.type: radar_rotor";
            return Err(Error::invalid("radar.array", format!("{elements} pairs of elements"), allowed));
        }
        let disturbed = self.phase_noise.is_some() || !self.interferers.is_empty();
        if disturbed && matches!(pattern, Pattern::RadarRotor(_)) {
            let key = if self.phase_noise.is_some() { "radar.phase_noise" } else { "radar.interferers" };
            return Err(Error::invalid(key, "given", "with pattern.type: radar only"));
        }
        Ok(())
    }

    /// The keys of its detector, with limits within the field of view of `pattern` and within the ranges
    /// `reported_m`.
    fn detection_within(&self, pattern: &Pattern, reported_m: [f64; 2]) -> RadarDetectionSpec {
        let mut detection = self.detection.clone();
        let narrow = |limits: &mut Option<[f64; 2]>, [least, greatest]: [f64; 2]| {
            let [from, to] = limits.unwrap_or([least, greatest]);
            *limits = Some([from.max(least), to.min(greatest)]);
        };
        narrow(&mut detection.limits.range_m, reported_m);
        if let Pattern::Radar(view) = pattern {
            narrow(&mut detection.limits.azimuth_deg, view.azimuth_deg);
            narrow(&mut detection.limits.elevation_deg, view.elevation_deg);
        }
        detection
    }

    /// Frequency in the middle of what is sampled, Hz.
    pub fn frequency(&self) -> f64 {
        ::radar::LIGHT_SPEED / self.waveform.wavelength()
    }
}

/// What a radar computes once for all its frames.
#[derive(Debug)]
pub(crate) struct RadarParts {
    pub plan: RadarPlan,
    detectors: Mutex<Vec<FrameDetector>>,
    first: FrameDetector,
    /// Materials of the scene that it was last used in.
    surfaces: Mutex<Option<(Weak<SharedSurfaces>, Arc<RadarSurfaces>)>>,
}

/// Detector of a thread that scans.
#[derive(Clone)]
pub(crate) struct FrameDetector {
    pub detector: Detector,
    pub sharing: Sharing,
}

impl std::fmt::Debug for FrameDetector {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.debug_struct("FrameDetector").finish_non_exhaustive()
    }
}

impl RadarParts {
    /// # Errors
    /// As [`RadarPlan::new`] and [`Detector::new`].
    pub fn new(spec: &RadarSpec, pattern: &Pattern, reported_m: [f64; 2]) -> Result<RadarParts> {
        let detection = spec.detection_within(pattern, reported_m);
        let RadarWindows { range, velocity } = spec.windows;
        let plan = RadarPlan::new(&spec.waveform, &spec.array, [range, velocity], spec.instrument)?;
        let axes = plan.axes();
        let samples = match &spec.waveform {
            RadarWaveform::Fmcw(fmcw) => range.samples(fmcw.samples as usize),
            _ => vec![1.0],
        };
        let transform = samples.len().max(axes.range.len);
        let responses = [
            WindowResponse::new(&samples, transform),
            WindowResponse::new(&velocity.samples(axes.velocity.len), axes.velocity.len),
        ];
        let times = plan.channel_times();
        let start = times.iter().copied().fold(f64::INFINITY, f64::min);
        let slots: Vec<f32> = times.iter().map(|time| (time - start) as f32).collect();
        let geometry = CubeGeometry {
            axes,
            responses: [&responses[0], &responses[1]],
            positions: &plan.array().places,
            wavelength: spec.waveform.wavelength(),
            slots: &slots,
        };
        let first = FrameDetector { detector: Detector::new(&detection, geometry)?, sharing: Sharing::new(geometry) };
        Ok(RadarParts { detectors: Mutex::default(), first, surfaces: Mutex::default(), plan })
    }

    /// A detector for a frame, to be given back afterwards.
    pub fn detector(&self) -> FrameDetector {
        let free = self.detectors.lock().unwrap_or_else(PoisonError::into_inner).pop();
        free.unwrap_or_else(|| self.first.clone())
    }

    /// Gives a detector back.
    pub fn keep(&self, detector: FrameDetector) {
        self.detectors.lock().unwrap_or_else(PoisonError::into_inner).push(detector);
    }

    /// The materials of a scene at the radar's frequency.
    ///
    /// # Errors
    /// As [`RadarSurfaces::new`].
    pub fn surfaces(&self, table: &Arc<SharedSurfaces>, frequency: f64) -> Result<Arc<RadarSurfaces>> {
        let mut known = self.surfaces.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((of, surfaces)) = &*known
            && surfaces.is_for(frequency)
            && of.upgrade().is_some_and(|of| Arc::ptr_eq(&of, table))
        {
            return Ok(surfaces.clone());
        }
        let surfaces = Arc::new(RadarSurfaces::new(table, frequency)?);
        *known = Some((Arc::downgrade(table), surfaces.clone()));
        Ok(surfaces)
    }
}

impl Sensor {
    /// The section `radar`, and what it was prepared to.
    ///
    /// # Errors
    /// A sensor that is not a radar.
    pub(crate) fn radar(&self) -> Result<(&RadarSpec, &RadarParts)> {
        let parts = self.spec.radar.as_ref().zip(self.radar.as_deref());
        parts.ok_or_else(|| Error::invalid("sensor", self.name(), "a radar (kind: radar)"))
    }
}
