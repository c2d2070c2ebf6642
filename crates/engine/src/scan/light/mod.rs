//! A scan of a LiDAR or a depth camera: blocks of beams, side by side on threads.

mod adaptive;
mod around;
mod block;
mod bloom;
mod budget;
mod collect;
mod deskew;
mod explain;
mod gather;
mod georeference;
mod halo;
mod looks;
mod motion;
mod one_ray;
mod plan;
mod returns;
mod rounds;
mod run;
mod split;
mod survey;

use super::{Progress, ScanOptions};
use crate::sensor::Sensor;
use crate::trace::BuiltScene;
use cloud::PointCloud;
use emitter::Trajectory;
use ground::error::{Error, Result};
use plan::ScanPlan;
use std::time::Instant;

impl BuiltScene {
    /// [`BuiltScene::scan_with_progress`] for light.
    pub(super) fn scan_light(
        &self,
        sensor: &Sensor,
        trajectory: &Trajectory,
        options: &ScanOptions,
        cloud: &mut PointCloud,
        progress: Option<Progress>,
    ) -> Result<()> {
        options.check(trajectory)?;
        let start = Instant::now();
        let beams = sensor.beams_at(options.start_time)?;
        self.0.check_time(options.start_time, beams.last_time())?;
        let reception = sensor.reception(&options.environment, self.0.origin, options.profile)?;
        let mut scan = ScanPlan::new(&self.0, sensor, &beams, &reception, trajectory, options)?;
        if options.organised && scan.most_returns() > 1 {
            let found = format!("{} returns per beam", scan.most_returns());
            return Err(Error::invalid(
                "organised",
                found,
                "one return per beam (returns.mode: strongest, first, last or second)",
            ));
        }
        scan.find_halos(sensor);
        let limited = match options.time_budget {
            Some(budget) => scan.keep_to(budget, start, &mut cloud.columns),
            None => Ok(()),
        };
        let scanned = limited.and_then(|()| scan.run(cloud, progress));
        if scanned.is_err() {
            *cloud = PointCloud::default();
        }
        scanned
    }

    /// [`BuiltScene::explain`] for light.
    pub(super) fn explain_light(
        &self,
        sensor: &Sensor,
        trajectory: &Trajectory,
        options: &ScanOptions,
        beam: u32,
    ) -> Result<String> {
        let beams = sensor.beams_at(options.start_time)?;
        if beam as usize >= beams.len() {
            return Err(Error::invalid("beam", beam, format!("0 to {}", beams.len() - 1)));
        }
        self.0.check_time(options.start_time, beams.last_time())?;
        let reception = sensor.reception(&options.environment, self.0.origin, options.profile)?;
        let mut scan = ScanPlan::new(&self.0, sensor, &beams, &reception, trajectory, options)?;
        scan.find_halos(sensor);
        scan.explain(&sensor.signals, beam as usize)
    }
}
