//! The origin of a scene, to which coordinates in single precision are relative.

use super::object::{Live, Slot, boxes};
use glam::DVec3;
use ground::report::Report;

/// Scenes within this distance of the world's origin keep it as their own, so that coordinates stay as in the file: an
/// f32 step there is 0.06 mm.
const NEAR_ORIGIN_M: f64 = 1000.0;

/// Farther from the scene's origin than this, coordinates lose more than half a millimetre.
const FAR_M: f64 = 8192.0;

/// The world's origin where the scene is near it, else the place of the middle triangle, in whole metres: a stray
/// object far from all others does not pull it away.
pub(super) fn local_origin(slots: &[Slot]) -> DVec3 {
    if boxes(slots).all(|(_, corners)| reach(&corners, DVec3::ZERO) <= NEAR_ORIGIN_M) {
        return DVec3::ZERO;
    }
    let weight = |live: &Live| live.object.mesh.triangle_count();
    let half = boxes(slots).map(|(live, _)| weight(live)).sum::<usize>() / 2;
    let middle = |axis: usize| {
        // The first and the last corner of a box are opposite.
        let centre = |corners: [DVec3; 8]| corners[0].midpoint(corners[7])[axis];
        let mut centres: Vec<_> = boxes(slots).map(|(live, corners)| (centre(corners), weight(live))).collect();
        centres.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut before = 0;
        let found = centres.iter().find(|(_, weight)| {
            before += weight;
            before > half
        });
        found.map_or(0.0, |(centre, _)| centre.round())
    };
    DVec3::new(middle(0), middle(1), middle(2))
}

/// Greatest coordinate of `corners` relative to `origin`, m.
fn reach(corners: &[DVec3; 8], origin: DVec3) -> f64 {
    corners.iter().map(|corner| (*corner - origin).abs().max_element()).fold(0.0, f64::max)
}

/// Warns about the object that is farthest from `origin`, if its coordinates lose precision.
pub(super) fn warn_of_far_objects(slots: &[Slot], origin: DVec3, report: &mut Report) {
    let moved = boxes(slots).filter(|(live, _)| live.moved);
    let far = moved.map(|(live, corners)| (live, reach(&corners, origin)));
    let farthest = far.filter(|(_, reach)| *reach > FAR_M).max_by(|a, b| a.1.total_cmp(&b.1));
    if let Some((live, reach)) = farthest {
        let km = reach / 1000.0;
        // Spacing of f32 numbers of this size.
        let step_mm = 1000.0 * 2f64.powi(reach.log2().floor() as i32 - 23);
        report.warn(format!(
            "object {:?} reaches {km:.0} km from the scene's origin at {:.0},{:.0},{:.0}: coordinates there are rounded to \
             {step_mm:.1} mm",
            live.object.name, origin.x, origin.y, origin.z,
        ));
    }
}
