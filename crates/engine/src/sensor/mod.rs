//! Sensors: a scan pattern, a beam and a receiver, read from YAML or taken from a preset.

mod check;
mod keys;
mod presets;
mod radar;
mod reception;
mod rings;
mod signals;
mod sonar;
mod spec;
#[cfg(test)]
mod tests;
mod tof;

pub use presets::PresetInfo;
pub(crate) use radar::RadarParts;
pub use radar::{RadarSpec, RadarWindows};
pub(crate) use reception::Reception;
pub(crate) use signals::{Adaptive, Signals};
pub use sonar::{AcousticsSpec, Speckle, Sweep, Tvg};
pub use spec::{BeamSpec, Expectations, IntensitySpec, RangeSpec, ReturnsSpec, SensorKind, SensorSpec, SubRays};
pub use tof::{Illumination, ShotNoiseSpec, Target, TofSpec, Vignetting};

use crate::detect::{DepthCamera, DetectionSpec, Doppler, Noise, PulseAssignment, RangeError, Threshold, Timing};
use crate::echo::{Glint, Pulse, texture};
use cloud::cells::SonarView;
use cloud::export::Instrument;
use cloud::{Driver, Field, FieldSet, FieldSource, ScanLine};
use emitter::pattern::Pattern;
use emitter::{BeamTable, ImageGrid, RayColumns, Transducer};
use ground::error::{Error, Result};
use ground::read::yaml::{self, Document};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// Transducers, each with the wavelength, m, and the ratio of sound speeds that it was made for.
type Transducers = Vec<(f64, f64, Arc<Transducer>)>;

/// A depth sensor, ready to scan.
#[derive(Clone, Debug)]
pub struct Sensor {
    spec: SensorSpec,
    /// Base folder of relative paths in it.
    folder: PathBuf,
    /// Directions and times of its beams in one scan.
    #[doc(hidden)]
    pub beams: Arc<BeamTable>,
    /// One more than the greatest channel of a beam.
    #[doc(hidden)]
    pub channels: usize,
    /// The ring of each channel.
    #[doc(hidden)]
    pub rings: Arc<[u16]>,
    scan_line: Option<ScanLine>,
    pub(crate) wavelength_nm: f64,
    pub(crate) range_min_m: f64,
    pub(crate) range_max_m: f64,
    pub(crate) range_resolution_m: f64,
    pub(crate) detection: DetectionSpec,
    /// Errors of what it measures.
    #[doc(hidden)]
    pub noise: Noise,
    /// What it reports as intensity.
    #[doc(hidden)]
    pub intensity: IntensitySpec,
    /// How it measures radial velocities; `None`: it does not.
    #[doc(hidden)]
    pub doppler: Option<Doppler>,
    /// How its pixels measure ranges; `None`: it has no section `tof`.
    #[doc(hidden)]
    pub camera: Option<DepthCamera>,
    /// How the echoes of its beams become returns.
    pub(crate) signals: Arc<Signals>,
    /// Quantiles of the texture of a sonar's echoes; empty: none.
    #[doc(hidden)]
    pub texture: Arc<[f32]>,
    /// What a radar computes once.
    radar: Option<Arc<RadarParts>>,
    /// Transducers of a sonar, for the wavelengths that it has been used at; shared with copies.
    transducers: Arc<Mutex<Transducers>>,
    /// Receptions prepared for scans; shared with copies.
    receptions: Arc<Mutex<Vec<Arc<Reception>>>>,
    /// Beams of earlier scans, if the pattern does not repeat: their memory is reused for later ones; shared with
    /// copies.
    drawn: Arc<Mutex<Vec<Arc<BeamTable>>>>,
}

impl Instrument for Sensor {
    fn name(&self) -> &str {
        self.name()
    }

    fn image_grid(&self) -> Result<ImageGrid> {
        self.image_grid()
    }

    fn sonar_view(&self) -> SonarView {
        self.sonar_view()
    }
}

impl Sensor {
    /// Reads a sensor file.
    ///
    /// # Errors
    /// States the file, line and key of the fault, with the most similar known key.
    pub fn load(path: impl AsRef<Path>) -> Result<Sensor> {
        let path = path.as_ref();
        Sensor::from_section(&Document::load(path)?, path.parent().unwrap_or(Path::new("")))
    }

    /// Reads the text of a sensor file; relative paths in it are resolved against `folder`.
    ///
    /// # Errors
    /// As [`Sensor::load`].
    pub fn from_yaml(text: &str, folder: impl AsRef<Path>) -> Result<Sensor> {
        Sensor::from_section(&Document::parse("YAML text", text)?, folder.as_ref())
    }

    /// A sensor described in code; relative paths in it are resolved against the working directory.
    ///
    /// ```
    /// use echocast::emitter::pattern::Pattern;
    /// use echocast::{Sensor, SensorKind, SensorSpec};
    ///
    /// let pixels = Pattern::from_yaml("{type: pinhole, resolution: [64, 48], fov_deg: [70, 55]}")?;
    /// let mut spec = SensorSpec::new("mine", SensorKind::Tof, pixels);
    /// spec.noise.range_sigma_m = 0.01;
    /// let sensor = Sensor::from_spec(spec)?;
    /// assert_eq!(sensor.beams().len(), 64 * 48);
    /// # Ok::<(), echocast::Error>(())
    /// ```
    ///
    /// # Errors
    /// States the key of the fault, and what is allowed.
    pub fn from_spec(mut spec: SensorSpec) -> Result<Sensor> {
        spec.check()?;
        spec.pattern.resolve(Path::new(""), None);
        let beams = spec.pattern.beams(0.0)?;
        Sensor::new(spec, PathBuf::new(), Arc::new(beams))
    }

    /// Reads a section of a file; relative paths in it are resolved against `folder`.
    ///
    /// # Errors
    /// As [`Sensor::load`].
    #[doc(hidden)]
    pub fn from_section(document: &Document, folder: &Path) -> Result<Sensor> {
        let mut spec = SensorSpec::read(document)?;
        spec.pattern.resolve(folder, None);
        let beams = spec.pattern.beams(0.0).map_err(|error| document.locate(document.asks("pattern.file", error)))?;
        Sensor::new(spec, folder.to_owned(), Arc::new(beams)).map_err(|error| document.locate(error))
    }

    /// A sensor from a checked description.
    ///
    /// # Errors
    /// A list with a number per channel does not have as many numbers as there are channels.
    fn new(spec: SensorSpec, folder: PathBuf, beams: Arc<BeamTable>) -> Result<Sensor> {
        let channels = beams.channel.iter().max().map_or(0, |&channel| usize::from(channel) + 1);
        let numbers = spec.detection.channel_efficiency.len();
        if numbers != 0 && numbers != channels {
            let (found, allowed) =
                (format!("a list of {numbers}"), format!("as many as there are channels ({channels})"));
            return Err(Error::invalid("detection.channel_efficiency", found, allowed));
        }
        let signals = Signals::new(&spec);
        Ok(Sensor {
            wavelength_nm: spec.beam.wavelength_nm,
            range_min_m: spec.range.min_m,
            range_max_m: spec.range.max_m.unwrap_or(f64::INFINITY),
            range_resolution_m: spec.range.resolution_m,
            detection: spec.detection.clone(),
            noise: spec.noise.clone(),
            intensity: spec.intensity,
            doppler: spec.doppler,
            camera: spec.tof.as_ref().map(|tof| tof.camera(&spec.pattern)),
            rings: rings::of_channels(&spec, &beams, channels),
            scan_line: scan_line_of(&spec, &beams, signals.rule.most()),
            signals: Arc::new(signals),
            texture: spec.acoustics.as_ref().and_then(|it| it.texture_shape).map_or_else(|| Arc::from([]), texture),
            radar: spec
                .radar
                .as_ref()
                .map(|radar| {
                    RadarParts::new(radar, &spec.pattern, [spec.range.min_m, spec.range.max_m.unwrap_or(f64::INFINITY)])
                })
                .transpose()?
                .map(Arc::new),
            transducers: Arc::default(),
            receptions: Arc::default(),
            drawn: Arc::default(),
            spec,
            folder,
            beams,
            channels,
        })
    }

    /// Time over which one scan observes the scene, s, for [`LiveScene::set_time`](crate::trace::LiveScene::set_time); never
    /// 0.
    pub fn scan_time(&self) -> f64 {
        /// Snapshots take a moment too.
        const LEAST: f64 = 1e-4;
        /// Slower than sound in any water, m/s.
        const SLOW: f64 = 1000.0;
        let last = self.beams.last_time();
        let sound = if self.spec.kind == SensorKind::Sonar { self.range_max_m / SLOW } else { 0.0 };
        let chirps = self.spec.radar.as_ref().map_or(0.0, |radar| radar.waveform.duration(radar.array.tx.len()));
        (last + chirps + if sound.is_finite() { sound } else { 0.0 }).max(LEAST)
    }

    /// The errors of its ranges.
    pub(crate) fn range_error(&self, threshold: Threshold) -> RangeError {
        let BeamSpec { pulse_shape, pulse_ns, .. } = self.spec.beam;
        let edge_sigma = match self.detection.timing {
            Timing::Peak => 0.0,
            Timing::LeadingEdge => Pulse::new(pulse_shape, pulse_ns).sigma(),
        };
        RangeError::new(&self.noise, self.range_resolution_m, self.channels, edge_sigma, threshold)
    }

    /// How it receives the glint of its own light from smooth surfaces, if it does. An elliptic beam is replaced by a
    /// round one of the same area; if a beam has several sub-rays, each of them is a line.
    pub(crate) fn glint(&self) -> Option<Glint> {
        let beam = &self.spec.beam;
        let [horizontal, vertical] = beam.divergence_mrad;
        let width = if matches!(beam.sub_rays, SubRays::Count(2..)) { 0.0 } else { 1.0 };
        beam.aperture_mm.map(|diameter| Glint {
            start: (0.5e-3 * beam.exit_diameter_mm * width) as f32,
            divergence: (0.5e-3 * (horizontal * vertical).sqrt() * width) as f32,
            opening: (0.5e-3 * diameter) as f32,
        })
    }

    /// An ideal lidar with custom beams: no noise, no threshold, no range limit other than the table's.
    ///
    /// # Errors
    /// As [`BeamTable::check`].
    pub fn from_beams(name: impl Into<String>, mut beams: BeamTable) -> Result<Sensor> {
        beams.check()?;
        beams.normalize();
        let spec = SensorSpec::new(name, SensorKind::Lidar, Pattern::Custom);
        spec.check()?;
        Sensor::new(spec, PathBuf::new(), Arc::new(beams))
    }

    /// An ideal lidar with custom rays, each from its own origin at its own time: [`Sensor::from_beams`] with one row.
    ///
    /// ```
    /// use echocast::{Sensor, emitter::RayColumns};
    ///
    /// // Two diodes, 4 cm apart, that look ahead; the second fires 10 us after the first.
    /// let ahead = RayColumns::default().direction(&[[1.0, 0.0, 0.0]; 2]);
    /// let rays = ahead.origin(&[[0.0, 0.02, 0.0], [0.0, -0.02, 0.0]]).time(&[0.0, 10e-6]);
    /// let mut sensor = Sensor::from_rays("pair", &rays)?;
    /// sensor.set("noise.range_sigma_m", "0.02")?;
    /// # Ok::<(), echocast::Error>(())
    /// ```
    ///
    /// # Errors
    /// As [`BeamTable::from_rays`].
    pub fn from_rays(name: impl Into<String>, rays: &RayColumns) -> Result<Sensor> {
        Sensor::from_beams(name, BeamTable::from_rays(rays)?)
    }

    /// Its description, with every key that has a value.
    pub fn to_yaml(&self) -> Result<String> {
        yaml::to_string(&self.spec)
    }

    /// Its description.
    pub fn spec(&self) -> &SensorSpec {
        &self.spec
    }

    /// Its name.
    pub fn name(&self) -> &str {
        &self.spec.name
    }

    /// Its title, for display; without one, its name.
    pub fn title(&self) -> &str {
        if self.spec.title.is_empty() { self.name() } else { &self.spec.title }
    }

    /// What it measures with.
    pub fn kind(&self) -> SensorKind {
        self.spec.kind
    }

    /// Maker of its ROS driver, if its file specifies it.
    pub fn driver(&self) -> Option<Driver> {
        self.spec.driver
    }

    /// Its beams as a line of ranges, which messages such as `sensor_msgs/LaserScan` describe, if it is a LiDAR with a single
    /// ring, whose beams lie in its plane z = 0.
    pub fn scan_line(&self) -> Option<ScanLine> {
        self.scan_line
    }

    /// The columns of its clouds by default: [`FieldSet::default`]; `doppler` if it measures that; for a sonar no
    /// `ring`, but `cause`, as its points come from the seabed, the water surface, reflections and noise, and the
    /// fields of its soundings and velocities.
    pub fn default_fields(&self) -> FieldSet {
        let mut fields = FieldSet::default();
        if self.doppler.is_some() {
            fields = fields.with(Field::Doppler);
        }
        if let Pattern::LineScan(scan) = &self.spec.pattern {
            fields = fields.without(Field::Ring).union(FieldSet::from_source(FieldSource::Survey));
            if scan.head.is_some() {
                let of_flight = [Field::ScanAngle, Field::ScanDirection, Field::EdgeOfLine];
                fields = of_flight.into_iter().fold(fields, FieldSet::without);
            }
        }
        if self.kind() == SensorKind::Radar {
            let own = [Field::Azimuth, Field::Elevation, Field::Doppler, Field::Rcs, Field::Snr, Field::Path];
            fields = fields.without(Field::Ring).without(Field::Channel).union(own.into_iter().collect());
        }
        if self.kind() == SensorKind::Sonar {
            fields = fields.without(Field::Ring).with(Field::Cause);
            if self.sonar_view().reports_depths() {
                fields = fields.union(FieldSet::from_source(FieldSource::Sounding));
            }
            if self.sonar_view() == SonarView::Janus {
                fields = fields.with(Field::Doppler).union(FieldSet::from_source(FieldSource::BottomTrack));
            }
            if self.spec.dvl.is_some_and(|log| log.water.is_some()) {
                fields = fields.union(FieldSet::from_source(FieldSource::WaterTrack));
            }
        }
        fields
    }

    /// Full width of its pulse at half the peak power, s; NaN: it has none.
    pub(crate) fn pulse_s(&self) -> f32 {
        let pulse_ns = self.spec.beam.pulse_ns;
        if pulse_ns > 0.0 { (1e-9 * pulse_ns) as f32 } else { f32::NAN }
    }

    /// How it assigns echoes to pulses, where that plays a part.
    pub(crate) fn assignment(&self) -> Option<PulseAssignment> {
        let Pattern::LineScan(scan) = &self.spec.pattern else { return None };
        let range = &self.spec.range;
        PulseAssignment::new(range.multiple_time_around, scan.pulse_rate_hz, range.blind_m, scan.duty() < 1.0)
    }

    /// Where its numbers come from; may be empty.
    pub fn source(&self) -> &str {
        &self.spec.source
    }

    /// The maker's figures, which its pattern is tested against.
    pub fn expectations(&self) -> Option<&Expectations> {
        self.spec.expect.as_ref()
    }

    /// The greatest number of returns that it reports per beam; range bins of a sonar do not count.
    pub fn most_returns(&self) -> usize {
        self.signals.rule.most()
    }

    /// The beams of one scan; for a pattern that does not repeat, those of the scan that starts at time 0.
    pub fn beams(&self) -> &BeamTable {
        &self.beams
    }

    /// The grid of its image: which pixel each of its beams is.
    ///
    /// # Errors
    /// [`Error::Unsupported`] for beams without rows and columns, those of prisms, of a table or of sound.
    pub fn image_grid(&self) -> Result<ImageGrid> {
        ImageGrid::of(self.name(), &self.spec.pattern, &self.beams)
    }

    /// The beams of the scan that starts at `start_time`, s: as many in every scan, drawn anew if the pattern does not
    /// repeat.
    ///
    /// # Errors
    /// A start that is not finite, a beam that a prism reflects totally, no memory.
    pub fn beams_at(&self, start_time: f64) -> Result<Arc<BeamTable>> {
        if start_time == 0.0 || self.spec.pattern.repeats() {
            return Ok(self.beams.clone());
        }
        /// Beams of earlier scans that are kept; more are in use only where as many threads scan at once.
        const MOST: usize = 16;
        let drawn = || self.drawn.lock().unwrap_or_else(PoisonError::into_inner);
        let free = {
            let mut drawn = drawn();
            drawn.iter_mut().position(|beams| Arc::get_mut(beams).is_some()).map(|index| drawn.swap_remove(index))
        };
        let mut beams = free.unwrap_or_else(|| self.beams.clone());
        self.spec.pattern.redraw(start_time, Arc::make_mut(&mut beams))?;
        let mut drawn = drawn();
        if drawn.len() < MOST {
            drawn.push(beams.clone());
        }
        Ok(beams)
    }
}

/// The line of ranges that a LiDAR with such `beams` reports, if they are one; lines that a turning head sweeps are none.
fn scan_line_of(spec: &SensorSpec, beams: &BeamTable, returns: usize) -> Option<ScanLine> {
    let scans = spec.kind == SensorKind::Lidar && !matches!(spec.pattern, Pattern::LineScan(_));
    let range_m = [spec.range.min_m, spec.range.max_m.unwrap_or(f64::INFINITY)];
    scans.then(|| ScanLine::of(beams, range_m, returns.min(255) as u8)).flatten()
}
