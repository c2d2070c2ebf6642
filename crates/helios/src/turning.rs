//! Rotations and offsets as HELIOS++ writes them, and its axes: x to the right, y ahead, z up; ours are x ahead, y to the
//! left, z up.

use crate::xml::XmlElement;
use glam::{DQuat, DVec3};
use ground::error::Result;
use std::f64::consts::FRAC_PI_2;

/// Where something is mounted on what carries it.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Fitting {
    /// Its position, m, axes of HELIOS++.
    pub offset: DVec3,
    /// Its orientation there.
    pub rotation: DQuat,
}

impl Default for Fitting {
    fn default() -> Self {
        Fitting { offset: DVec3::ZERO, rotation: DQuat::IDENTITY }
    }
}

/// Coordinates in the axes of HELIOS++ from those in ours: ahead, x here, is y there.
pub(crate) fn theirs_from_ours() -> DQuat {
    DQuat::from_rotation_z(FRAC_PI_2)
}

/// A rotation of something with the axes of HELIOS++, as one of the same thing with ours.
pub(crate) fn in_our_axes(rotation: DQuat) -> DQuat {
    let turn = theirs_from_ours();
    (turn.conjugate() * rotation * turn).normalize()
}

/// Orientation in the world of something with our axes, which has `attitude` with those of HELIOS++.
pub(crate) fn with_our_axes(attitude: DQuat) -> DQuat {
    (attitude * theirs_from_ours()).normalize()
}

/// The offset `x`, `y`, `z` of an element, m.
pub(crate) fn offset(element: XmlElement) -> Result<DVec3> {
    let axis = |name| Ok(element.number_within(name, -1e9, 1e9)?.unwrap_or(0.0));
    Ok(DVec3::new(axis("x")?, axis("y")?, axis("z")?))
}

/// The rotation that the elements `rot` of an element make, one after the other: each about the fixed axes, or with
/// rotations="local" about those already turned (createRotationFromXml in XmlUtils.cpp, 3dgeo-heidelberg/helios fd94d1f).
/// Angles are degrees, right-handed.
pub(crate) fn rotation(element: XmlElement) -> Result<DQuat> {
    let local = match element.text("rotations") {
        None | Some("global") => false,
        Some("local") => true,
        Some(_) => return Err(element.wrong("rotations", "global or local")),
    };
    let mut turned = DQuat::IDENTITY;
    for turn in element.children("rot") {
        let angle =
            turn.number_within("angle_deg", -1e6, 1e6)?.ok_or_else(|| turn.error("has no attribute angle_deg"))?;
        let axis = match turn.required("axis")? {
            "x" | "X" => DVec3::X,
            "y" | "Y" => DVec3::Y,
            "z" | "Z" => DVec3::Z,
            _ => return Err(turn.wrong("axis", "x, y or z")),
        };
        let turn = DQuat::from_axis_angle(axis, angle.to_radians());
        turned = if local { turned * turn } else { turn * turned };
    }
    Ok(turned.normalize())
}

/// Offset and rotation of an element; the origin, without one.
pub(crate) fn fitting(element: Option<XmlElement>) -> Result<Fitting> {
    element.map_or(Ok(Fitting::default()), |element| {
        Ok(Fitting { offset: offset(element)?, rotation: rotation(element)? })
    })
}

/// Roll, pitch and yaw, degrees, as scenarios have them (`Rz(yaw) Ry(pitch) Rx(roll)`), without rounding errors in the
/// last digits.
pub(crate) fn rpy_deg(rotation: DQuat) -> [f64; 3] {
    let (yaw, pitch, roll) = rotation.to_euler(glam::EulerRot::ZYX);
    // Whatever is not a multiple of that has not been written by a person.
    [roll, pitch, yaw].map(|angle| (angle.to_degrees() * 1e9).round() / 1e9 + 0.0)
}
