//! A scan of a radar: one frame, or one turn.

mod explain;
mod frame;
mod paths;
mod points;
mod precipitation;
mod rotor;
mod setup;
#[cfg(test)]
mod tests;
mod truth;

use crate::scan::{ScanOptions, check_physical};
use crate::sensor::Sensor;
use crate::trace::BuiltScene;
use cloud::{PointCloud, RadarFrame};
use emitter::Trajectory;
use emitter::pattern::Pattern;
use ground::error::Result;
use setup::RadarSetup;

/// What is recorded of a frame besides its detections.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RadarRecord {
    /// The cube: amplitudes of every cell and channel.
    pub cube: bool,
    /// The samples of the converters. The cube is then that of the samples.
    pub samples: bool,
}

impl BuiltScene {
    /// One frame of a radar at `trajectory`, which starts when the scan of `options` does: what `record` requests, and its
    /// detections in `cloud`. Of a rotating radar, a turn: the polar image.
    ///
    /// # Errors
    /// A sensor that is not a radar; a profile other than [`Profile::Physical`](crate::scan::Profile::Physical); a material
    /// whose law does not hold at the radar's frequency; as [`BuiltScene::scan`].
    pub fn radar_frame(
        &self,
        sensor: &Sensor,
        trajectory: &Trajectory,
        options: &ScanOptions,
        record: RadarRecord,
        cloud: &mut PointCloud,
    ) -> Result<RadarFrame> {
        options.check(trajectory)?;
        options.environment.check()?;
        check_physical(options.profile, "physical, the only one with radars")?;
        let setup = RadarSetup::new(self, sensor, trajectory, options)?;
        let rotates = matches!(sensor.spec().pattern, Pattern::RadarRotor(_));
        let done =
            self.0.engine.install(|| if rotates { setup.turn(cloud, None) } else { setup.frame(record, cloud, None) });
        if done.is_err() {
            *cloud = PointCloud::default();
        }
        done
    }

    /// The detections of one frame, see [`BuiltScene::scan_into`].
    pub(in crate::scan) fn scan_radar(
        &self,
        sensor: &Sensor,
        trajectory: &Trajectory,
        options: &ScanOptions,
        cloud: &mut PointCloud,
    ) -> Result<()> {
        self.radar_frame(sensor, trajectory, options, RadarRecord::default(), cloud).map(drop)
    }
}
