//! Cells: what a receiver that listens continuously delivers for each ping, a level for every beam and range bin, and
//! what is derived from them.

mod sounding;
mod track;

use crate::ground::angle::direction_f64;
use glam::DVec3;
pub use sounding::Sounding;
pub use track::Track;

/// What all pings of a sonar have in common.
#[derive(Clone, Debug, PartialEq)]
pub struct Layout {
    /// What kind of sonar it is.
    pub view: SonarView,
    /// Azimuth and elevation of each beam's axis as reported, sensor frame, rad; for a rotating beam, at its first
    /// ping.
    pub axes: Vec<[f32; 2]>,
    /// Range bins per beam; bin `k` reaches from `k bin_m` to `(k + 1) bin_m`.
    pub bins: usize,
    /// Length of a bin, m of reported slant range.
    pub bin_m: f64,
    /// First bin that reports echoes: earlier bins are nearer than the nearest range.
    pub first_bin: usize,
    /// Sound speed that ranges are reported with, m/s.
    pub believed_speed: f64,
    /// Centre frequency of the pulse, Hz.
    pub frequency: f64,
    /// Height of the water surface in the world, m.
    pub surface_z: f64,
    /// Level of the noise in a cell, dB re 1 uPa, after directivity and processing gain.
    pub noise_db: f32,
    /// Lowest level that is reported as an echo, dB re 1 uPa, by bin: noise, volume reverberation and threshold.
    pub threshold_db: Vec<f32>,
    /// Time-varied gain of images, dB, by bin.
    pub tvg_db: Vec<f32>,
}

/// Arrangement of the beams of a sonar, which determines its images.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SonarView {
    /// Beams to the sides: waterfall and mosaic.
    Sidescan,
    /// Beams side by side, down: bathymetry and the image of the water column.
    Swath,
    /// Beams side by side, ahead: fan.
    Fan,
    /// One beam.
    Single,
    /// Four beams, down and outwards: velocities.
    Janus,
}

impl Default for Layout {
    fn default() -> Self {
        Layout {
            view: SonarView::Single,
            axes: Vec::new(),
            bins: 0,
            bin_m: 1.0,
            first_bin: 0,
            believed_speed: 1500.0,
            frequency: 0.0,
            surface_z: 0.0,
            noise_db: 0.0,
            threshold_db: Vec::new(),
            tvg_db: Vec::new(),
        }
    }
}

impl SonarView {
    /// Whether its points are the depths of its beams, not its cells.
    pub(crate) fn reports_depths(self) -> bool {
        matches!(self, SonarView::Swath | SonarView::Single | SonarView::Janus)
    }

    /// Its name in files.
    pub fn name(self) -> &'static str {
        match self {
            SonarView::Sidescan => "sidescan",
            SonarView::Swath => "swath",
            SonarView::Fan => "fan",
            SonarView::Single => "single",
            SonarView::Janus => "janus",
        }
    }
}

impl Layout {
    /// Number of beams.
    pub fn beams(&self) -> usize {
        self.axes.len()
    }

    /// Unit vector along the axis of a beam, sensor frame.
    pub(crate) fn axis(&self, beam: usize) -> DVec3 {
        direction_f64(self.axes[beam])
    }

    /// Cells of a ping.
    pub fn cells(&self) -> usize {
        self.beams() * self.bins
    }

    /// Reported slant range of the middle of a bin, m.
    pub fn range(&self, bin: usize) -> f64 {
        (bin as f64 + 0.5) * self.bin_m
    }

    /// Farthest range, m.
    pub fn reach(&self) -> f64 {
        self.bins as f64 * self.bin_m
    }
}
