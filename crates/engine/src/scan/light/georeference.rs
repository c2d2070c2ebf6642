//! Points where processing puts them, with the trajectory that it has.

use super::block::Block;
use super::plan::ScanPlan;
use emitter::Trajectory;
use glam::DVec3;
use ground::lanes::LANES;

impl Block {
    /// Moves the `places` of the first `count` lanes, measured from the true pose of each beam, to where they are as seen
    /// from the `estimated` one: `p = T_estimated(t) T_true(t)^-1 p_measured`.
    #[inline(never)]
    pub fn georeference(&self, scan: &ScanPlan, estimated: &Trajectory, count: usize, places: &mut [[f32; LANES]; 3]) {
        let start = scan.options.start_on_trajectory();
        let origin = scan.world.scene.origin;
        for lane in 0..count {
            let time = start + scan.aim.beams.time[self.lanes.beam[lane] as usize];
            let (truth, belief) = (scan.aim.trajectory.at(time), estimated.at(time + scan.options.clock_offset));
            let place = DVec3::from_array(places.each_ref().map(|axis| axis[lane].into()));
            let seen = place - (truth.position - origin);
            let turned = belief.orientation * (truth.orientation.conjugate() * seen);
            let place = belief.position - origin + turned;
            for (axis, value) in places.iter_mut().zip(place.to_array()) {
                axis[lane] = value as f32;
            }
        }
    }
}
