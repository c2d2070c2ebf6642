//! Directions as angles.

use glam::{DVec3, Vec3};

/// Azimuth, counter-clockwise from x, and elevation, up from the xy plane, of a direction of any length, rad.
pub fn azimuth_elevation([x, y, z]: [f32; 3]) -> [f32; 2] {
    [y.atan2(x), z.atan2(x.hypot(y))]
}

/// Unit vector of an azimuth and an elevation, rad.
pub fn direction([azimuth, elevation]: [f32; 2]) -> Vec3 {
    let ((sin_az, cos_az), (sin_el, cos_el)) = (azimuth.sin_cos(), elevation.sin_cos());
    Vec3::new(cos_el * cos_az, cos_el * sin_az, sin_el)
}

/// [`direction`] in double precision.
pub fn direction_f64(angles: [f32; 2]) -> DVec3 {
    let [(sin_az, cos_az), (sin_el, cos_el)] = angles.map(|angle| f64::from(angle).sin_cos());
    DVec3::new(cos_el * cos_az, cos_el * sin_az, sin_el)
}
