//! The cells of a ping: how its range is divided into bins, and what background, threshold and gain each bin has.

use crate::echo::Response;
use crate::medium::{Spreading, Water};
use crate::sensor::{AcousticsSpec, Sensor};
use cloud::cells::{Layout, SonarView};
use emitter::Transducer;
use ground::error::{Error, Result};
use ground::math::{LOG2_PER_DB, log2};

/// How range is divided into bins.
pub(super) struct RangeBins {
    /// Number of bins.
    pub count: usize,
    /// Length of one, m.
    pub length: f64,
    /// Range resolution of the pulse, m.
    pub resolution: f64,
}

impl RangeBins {
    /// The bins of each of the `beams` up to `reach`, m, for an instrument that assumes the sound speed `believed`,
    /// m/s.
    ///
    /// # Errors
    /// More cells than a ping may have.
    pub fn new(acoustics: &AcousticsSpec, beams: usize, reach: f64, believed: f64) -> Result<RangeBins> {
        /// A size that fits into memory many times over.
        const MOST_CELLS: f64 = 2e7;
        let resolution = acoustics.resolution(believed);
        let length = acoustics.bin_m.unwrap_or(0.5 * resolution);
        let count = (reach / length).ceil();
        if count * beams as f64 > MOST_CELLS {
            let found = format!("{length} m: {count} bins of {beams} beams");
            return Err(Error::invalid("acoustics.bin_m", found, format!("at most {MOST_CELLS} cells in a ping")));
        }
        Ok(RangeBins { count: count as usize, length, resolution })
    }

    /// The response of pulse and receiver, by bin.
    ///
    /// # Errors
    /// Bins that are too short for the resolution.
    pub fn response(&self, acoustics: &AcousticsSpec) -> Result<Response> {
        let RangeBins { length, resolution, .. } = *self;
        let response = Response::new(length / resolution, acoustics.bandwidth_khz.is_some(), acoustics.taper);
        response.map_err(|least| {
            let allowed = format!("at least {} m for a resolution of {resolution} m", least * resolution);
            Error::invalid("acoustics.bin_m", format!("{length} m"), allowed)
        })
    }
}

/// What a [`Layout`] depends on, apart from the sensor.
#[derive(Clone, PartialEq)]
pub(super) struct LayoutInputs {
    sensor: AcousticsSpec,
    view: SonarView,
    bins: usize,
    first_bin: usize,
    directivity: f64,
    /// Greatest solid angle of a beam, sr.
    widest: f32,
    believed: f64,
    surface_z: f64,
    absorption: f64,
    ambient: f64,
    volume: Option<f64>,
    spreading: Spreading,
    /// Where hybrid spreading becomes cylindrical, m.
    spreading_from: f32,
}

impl LayoutInputs {
    /// Those of a sonar that assumes the sound speed `believed`, m/s, where sound is absorbed by `absorption`, dB/m.
    pub fn new(
        sensor: &Sensor,
        acoustics: &AcousticsSpec,
        water: &Water,
        transducer: &Transducer,
        bins: &RangeBins,
        [believed, absorption]: [f64; 2],
    ) -> LayoutInputs {
        let ambient = || water.noise().level_db(acoustics.frequency()) + 10.0 * acoustics.bandwidth().log10();
        LayoutInputs {
            sensor: acoustics.clone(),
            view: sensor.sonar_view(),
            bins: bins.count,
            first_bin: (sensor.range_min_m / bins.length).floor() as usize,
            directivity: acoustics.directivity_index_db.unwrap_or(transducer.directivity_db),
            widest: transducer.solid_angles.iter().copied().fold(0.0, f32::max),
            believed,
            surface_z: water.surface_z_m,
            absorption,
            ambient: acoustics.noise_level_db.unwrap_or_else(ambient),
            volume: water.volume_backscatter_db,
            spreading: water.spreading,
            spreading_from: water.spreading_from(),
        }
    }
}

/// Power that a steradian of open water returns from each bin, uPa^2: volume backscatter from a resolution cell,
/// spreading along straight rays and absorption as at the sonar (sonar equation, Urick 1983, section 8.3).
pub(super) fn volume(inputs: &LayoutInputs, bin_m: f64, resolution: f64) -> Vec<f32> {
    let Some(strength) = inputs.volume else { return Vec::new() };
    let of_bin = |bin: usize| {
        let range = (bin as f64 + 0.5) * bin_m;
        let path = log2(range as f32);
        let spread = 2.0 * (path - inputs.spreading.one_way(path, inputs.spreading_from)) / LOG2_PER_DB;
        let level = inputs.sensor.source_level_db + strength + 10.0 * resolution.log10() + f64::from(spread);
        10f64.powf((level - 2.0 * inputs.absorption * range) / 10.0) as f32
    };
    (0..inputs.bins).map(of_bin).collect()
}

/// The layout of a ping whose open water returns `volume`.
pub(super) fn layout(inputs: &LayoutInputs, transducer: &Transducer, bin_m: f64, volume: &[f32]) -> Layout {
    let acoustics = &inputs.sensor;
    // A tapered filter passes more noise.
    let taper = 10.0 * acoustics.taper.resolutions().log10();
    let noise_db = inputs.ambient - inputs.directivity - acoustics.processing_gain() + taper;
    let noise = 10f64.powf(noise_db / 10.0);
    let threshold = |bin: usize| {
        let background = noise + f64::from(volume.get(bin).copied().unwrap_or(0.0) * inputs.widest);
        (10.0 * background.log10() + acoustics.detection_threshold_db) as f32
    };
    let tvg = |bin: usize| {
        let range = (bin as f64 + 0.5) * bin_m;
        let absorption = acoustics.tvg.absorption_db_m.unwrap_or(inputs.absorption);
        (acoustics.tvg.spreading * range.max(1.0).log10() + 2.0 * absorption * range + acoustics.tvg.gain_db) as f32
    };
    Layout::default()
        .view(inputs.view)
        .axes(transducer.axes.clone())
        .bins(inputs.bins)
        .bin_m(bin_m)
        .first_bin(inputs.first_bin)
        .believed_speed(inputs.believed)
        .frequency(acoustics.frequency())
        .surface_z(inputs.surface_z)
        .noise_db(noise_db as f32)
        .threshold_db((0..inputs.bins).map(threshold).collect())
        .tvg_db((0..inputs.bins).map(tvg).collect())
}
