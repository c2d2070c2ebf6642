//! Cells: what a receiver that listens continuously delivers for each ping, a level for every beam and range bin, and
//! what is derived from them.

mod sounding;
mod track;

use emitter::Pattern;
use glam::DVec3;
use ground::angle::direction_f64;
use ground::builder;
use ground::error::{Error, Result};
pub use sounding::Sounding;
pub use track::Track;

builder! {
    /// What all pings of a sonar have in common.
    #[derive(Clone, Debug, PartialEq)]
    pub struct Layout {
        /// What kind of sonar it is.
        pub view: SonarView = SonarView::Single,
        /// Azimuth and elevation of each beam's axis as reported, sensor frame, rad; for a rotating beam, at its first
        /// ping.
        pub axes: Vec<[f32; 2]> = Vec::new(),
        /// Range bins per beam; bin `k` reaches from `k bin_m` to `(k + 1) bin_m`.
        pub bins: usize = 0,
        /// Doppler bins per range bin; 1 where cells have no Doppler axis, as those of sonars.
        pub doppler_bins: usize = 1,
        /// Length of a bin, m of reported slant range.
        pub bin_m: f64 = 1.0,
        /// First bin that reports echoes: earlier bins are nearer than the nearest range.
        pub first_bin: usize = 0,
        /// Sound speed that ranges are reported with, m/s.
        pub believed_speed: f64 = 1500.0,
        /// Centre frequency of the pulse, Hz.
        pub frequency: f64 = 0.0,
        /// Height of the water surface in the world, m.
        pub surface_z: f64 = 0.0,
        /// Level of the noise in a cell, dB re 1 uPa, after directivity and processing gain.
        pub noise_db: f32 = 0.0,
        /// Lowest level that is reported as an echo, dB re 1 uPa, by bin: noise, volume reverberation and threshold.
        pub threshold_db: Vec<f32> = Vec::new(),
        /// Time-varied gain of images, dB, by bin.
        pub tvg_db: Vec<f32> = Vec::new(),
    }
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

impl SonarView {
    /// That of a sonar with `pattern`.
    #[doc(hidden)]
    pub fn of(pattern: &Pattern) -> SonarView {
        match pattern {
            Pattern::Sidescan(_) => SonarView::Sidescan,
            Pattern::Multibeam(_) => SonarView::Swath,
            Pattern::Imaging(_) => SonarView::Fan,
            Pattern::Dvl(_) => SonarView::Janus,
            _ => SonarView::Single,
        }
    }

    /// Whether its points are the depths of its beams, not its cells.
    #[doc(hidden)]
    pub fn reports_depths(self) -> bool {
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
    /// Checks that it has cells, its numbers are finite, and its columns have an element for each bin.
    #[doc(hidden)]
    pub fn check(&self) -> Result<()> {
        let cells = self.axes.len().checked_mul(self.bins);
        if !cells.is_some_and(|cells| 0 < cells && cells < u32::MAX as usize) {
            let found = format!("made of {} beams with {} bins", self.axes.len(), self.bins);
            return Err(Error::invalid("layout", found, "1 to 4294967294 cells"));
        }
        if self.doppler_bins != 1 {
            return Err(Error::invalid("doppler_bins", self.doppler_bins, "1 for sonars"));
        }
        if !(self.bin_m.is_finite() && self.bin_m > 0.0) {
            return Err(Error::invalid("bin_m", self.bin_m, "a length above 0"));
        }
        for (name, value) in [("believed_speed", self.believed_speed), ("surface_z", self.surface_z)] {
            if !value.is_finite() {
                return Err(Error::invalid(name, value, "a number"));
            }
        }
        if !self.axes.iter().flatten().all(|angle| angle.is_finite()) {
            return Err(Error::invalid("axes", "not a number", "azimuth and elevation of each beam, rad"));
        }
        for (name, values) in [("threshold_db", &self.threshold_db), ("tvg_db", &self.tvg_db)] {
            if values.len() != self.bins {
                let allowed = format!("the {} bins of a beam", self.bins);
                return Err(Error::invalid(name, format!("{} numbers long", values.len()), allowed));
            }
        }
        Ok(())
    }

    /// Number of beams.
    pub fn beams(&self) -> usize {
        self.axes.len()
    }

    /// Unit vector along the axis of a beam, sensor frame.
    #[doc(hidden)]
    pub fn axis(&self, beam: usize) -> DVec3 {
        direction_f64(self.axes[beam])
    }

    /// The axes of the cells: beams, Doppler bins and range bins.
    pub fn shape(&self) -> [usize; 3] {
        [self.beams(), self.doppler_bins, self.bins]
    }

    /// Cells of a ping.
    pub fn cells(&self) -> usize {
        self.shape().into_iter().product()
    }

    /// Row of the cell of `beam` in Doppler bin `doppler` and range bin `bin`: neighbours in range are neighbours.
    pub fn cell(&self, beam: usize, doppler: usize, bin: usize) -> usize {
        (beam * self.doppler_bins + doppler) * self.bins + bin
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
