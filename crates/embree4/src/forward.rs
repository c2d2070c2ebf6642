//! Shapes that contain scenes: the rays of a query, traced through one.

use crate::CommittedScene;
use crate::library::embree;
use crate::shape::{Call, LocalRays, MOST, Query};

impl Query<'_> {
    /// Traces the lanes of `active` (-1, else 0; those that are not active in the query stay out) through `scene`, with
    /// the origins and directions of `rays`, up to their far ends.
    pub fn forward(&mut self, scene: &CommittedScene, rays: &mut LocalRays, active: &[i32; MOST]) {
        #[repr(align(64))]
        struct AlignedMask([i32; MOST]);
        let mut valid = AlignedMask(*active);
        for (lane, lane_mask) in valid.0.iter_mut().enumerate() {
            *lane_mask &= self.active.get(lane).copied().unwrap_or(0);
        }
        if valid.0 == [0; MOST] {
            return;
        }
        let (valid, scene, to, instance) = (valid.0.as_ptr(), scene.raw(), rays.0.as_mut_ptr(), self.geometry);
        // SAFETY: the call is the one being answered; the scene is alive, committed and without instances of its own;
        // `to` has twelve rows of 16 lanes, of which Embree reads those of the query's width, and is aligned to 64
        // bytes like `valid`.
        unsafe {
            match (self.call, self.lanes) {
                (Call::Intersect(call), 1) => embree().rtcForwardIntersect1(call, scene, to.cast(), instance),
                (Call::Intersect(call), 4) => embree().rtcForwardIntersect4(valid, call, scene, to.cast(), instance),
                (Call::Intersect(call), 8) => embree().rtcForwardIntersect8(valid, call, scene, to.cast(), instance),
                (Call::Intersect(call), _) => embree().rtcForwardIntersect16(valid, call, scene, to.cast(), instance),
                (Call::Occluded(call), 1) => embree().rtcForwardOccluded1(call, scene, to.cast(), instance),
                (Call::Occluded(call), 4) => embree().rtcForwardOccluded4(valid, call, scene, to.cast(), instance),
                (Call::Occluded(call), 8) => embree().rtcForwardOccluded8(valid, call, scene, to.cast(), instance),
                (Call::Occluded(call), _) => embree().rtcForwardOccluded16(valid, call, scene, to.cast(), instance),
            }
        }
    }
}
