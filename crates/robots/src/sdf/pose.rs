//! `<pose>` of SDF.

use crate::shapes::from_rpy;
use glam::{DAffine3, DQuat, DVec3};
use ground::error::Result;
use ground::read::xml::Xml;

/// The pose of an element, and the name of the frame that it is relative to, if it says so.
///
/// # Errors
/// Other than six numbers, or seven with a quaternion.
pub(crate) fn pose_of(element: Xml<'_>) -> Result<(DAffine3, Option<&str>)> {
    let Some(pose) = element.child("pose") else { return Ok((DAffine3::IDENTITY, None)) };
    let relative_to = pose.attribute("relative_to").filter(|name| !name.is_empty());
    if pose.content().is_empty() {
        return Ok((DAffine3::IDENTITY, relative_to));
    }
    let made = match pose.attribute("rotation_format") {
        Some("quat_xyzw") => {
            let [x, y, z, a, b, c, d] = pose.content_numbers::<7>()?;
            let turned = DQuat::from_xyzw(a, b, c, d);
            if turned.length_squared() == 0.0 {
                return Err(pose.error("has a quaternion of length 0; allowed: rotations"));
            }
            DAffine3::from_rotation_translation(turned.normalize(), DVec3::new(x, y, z))
        }
        None | Some("euler_rpy") => {
            let [x, y, z, roll, pitch, yaw] = pose.content_numbers::<6>()?;
            let degrees = pose.attribute("degrees").is_some_and(|degrees| ["true", "1"].contains(&degrees));
            let rpy = DVec3::new(roll, pitch, yaw) * if degrees { 1f64.to_radians() } else { 1.0 };
            DAffine3::from_mat3_translation(from_rpy(rpy), DVec3::new(x, y, z))
        }
        Some(_) => return Err(pose.wrong("rotation_format", "euler_rpy, quat_xyzw")),
    };
    Ok((made, relative_to))
}
