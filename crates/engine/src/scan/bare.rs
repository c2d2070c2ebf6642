//! The rays of a scan, for the bare loop to trace.

use crate::sensor::Sensor;
use crate::trace::{BareLoop, BuiltScene};
use emitter::{Across, Aim, Trajectory};
use ground::lanes::{LANES, RayBatch};
use ground::pose::Pose;

impl<'a> BareLoop<'a> {
    /// Prepares the rays that [`BuiltScene::scan`] would trace with `sensor` at `pose`, including all sub-rays of every
    /// beam; for a sonar, those of a ping through water of 1500 m/s.
    pub fn new(scene: &'a BuiltScene, sensor: &Sensor, pose: Pose) -> Self {
        let beams = &*sensor.rays();
        let trajectory = Trajectory::fixed(pose);
        let aim = Aim::new(&trajectory, 0.0, scene.origin());
        // Where the number of sub-rays adapts, one per beam.
        let footprint = sensor.signals.footprint.as_ref().filter(|_| sensor.signals.adaptive.is_none());
        let (mut rays, mut counts) = (Vec::new(), Vec::new());
        for first in (0..beams.len()).step_by(LANES) {
            let count = LANES.min(beams.len() - first);
            let mut axes = RayBatch::default();
            aim.rays(beams, first, beams.directions(first, count), sensor.range_max_m as f32, &mut axes);
            match footprint {
                None => rays.push(axes),
                Some(footprint) => {
                    let mut across = Across::default();
                    for lane in 0..count {
                        let up = aim.pose(beams, first + lane).0.z_axis;
                        across.set(lane, axes.direction(lane), up, (lane as f32 * 0.618).fract());
                    }
                    for index in 0..footprint.count() {
                        let mut batch = RayBatch::default();
                        footprint.rays(index, &across, &axes, &mut batch);
                        rays.push(batch);
                    }
                }
            }
            counts.resize(rays.len(), count);
        }
        BareLoop::of(scene, [beams.is_coherent(), footprint.is_some()], rays, counts)
    }
}
