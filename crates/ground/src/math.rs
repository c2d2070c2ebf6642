//! Functions that the standard library does not have.

pub use echocast_kernels::math::{LOG2_PER_DB, exp2, log2};
use glam::DMat3;

/// The cofactors of the linear part of a transform: up to length they transform the normals of surfaces, whatever its
/// scale and mirroring. They are zero if it collapses every surface.
pub fn cofactors(m: &DMat3) -> DMat3 {
    DMat3::from_cols(m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis))
}

/// The greatest whole number not above `x`, as `x.floor() as i64`, which calls a function unless SSE 4.1 is enabled.
pub fn floor(x: f64) -> i64 {
    let whole = x as i64;
    whole.saturating_sub((whole as f64 > x).into())
}

/// The error function by its power series, to 1e-12 for |z| < 5.
pub fn erf(z: f64) -> f64 {
    if z.abs() > 5.0 {
        return z.signum();
    }
    let (mut term, mut sum) = (z, z);
    for n in 1..200 {
        term *= -z * z / f64::from(n);
        let before = sum;
        sum += term / f64::from(2 * n + 1);
        if sum == before {
            break;
        }
    }
    sum * 2.0 / std::f64::consts::PI.sqrt()
}
