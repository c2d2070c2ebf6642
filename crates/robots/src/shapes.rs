//! What the three formats have in common: sizes, axes, scales and colours, checked.

use glam::{DMat3, DQuat, DVec3};
use ground::error::Result;
use ground::read::xml::Xml;
use model::material::Material;
use std::sync::Arc;

/// Largest size and scale that is taken, metres: what is larger is a mistake.
const LARGEST: f64 = 1e6;

/// The lengths of an attribute, each above 0.
pub(crate) fn size_of_shape<const N: usize>(shape: Xml<'_>, attribute: &str) -> Result<[f64; N]> {
    let sizes = shape.numbers::<N>(attribute)?;
    let sizes = sizes.ok_or_else(|| shape.error(format_args!("has no attribute {attribute}")))?;
    if sizes.iter().all(|&size| is_size(size)) { Ok(sizes) } else { Err(shape.wrong(attribute, SIZES)) }
}

/// The allowed sizes, for messages.
pub(crate) const SIZES: &str = "metres above 0, up to 1e6";

/// Whether a shape may be so long.
pub(crate) fn is_size(size: f64) -> bool {
    size > 0.0 && size <= LARGEST
}

/// The scale of a mesh: 1 where there is none.
pub(crate) fn checked_scale(holder: Xml<'_>, scale: Option<DVec3>) -> Result<DVec3> {
    let scale = scale.unwrap_or(DVec3::ONE);
    if scale.to_array().into_iter().all(|factor| is_size(factor.abs())) {
        return Ok(scale);
    }
    Err(holder.error(format_args!("has the scale {:?}; allowed: numbers other than 0, -1e6 to 1e6", scale.to_array())))
}

/// `axis` at unit length.
pub(crate) fn checked_axis(holder: Xml<'_>, attribute: &str, axis: DVec3) -> Result<DVec3> {
    // Scaled first: squares of very small numbers would vanish.
    let scaled = axis / axis.abs().max_element();
    scaled.try_normalize().ok_or_else(|| {
        holder.error(format_args!("has {attribute} {:?}; allowed: a direction, not of length 0", axis.to_array()))
    })
}

/// A material of one colour, taken as linear like those of MTL files; alpha below 1 lets light through.
pub(crate) fn colored(name: &str, rgba: [f64; 4]) -> Arc<Material> {
    let mut material = Material::default().name(name).base_color(rgba.map(|channel| channel.clamp(0.0, 1.0) as f32));
    material.let_through();
    Arc::new(material)
}

/// The rotation by roll, pitch and yaw, radians, about fixed axes: Rz(yaw) Ry(pitch) Rx(roll).
pub(crate) fn from_rpy(rpy: DVec3) -> DMat3 {
    let turned = DQuat::from_rotation_z(rpy.z) * DQuat::from_rotation_y(rpy.y) * DQuat::from_rotation_x(rpy.x);
    DMat3::from_quat(turned)
}
