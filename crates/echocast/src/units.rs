//! Physical constants and conversions.

/// Speed of light in vacuum, m/s (exact, SI).
pub const SPEED_OF_LIGHT_M_S: f64 = 299_792_458.0;

/// Microseconds to seconds.
pub const fn seconds_from_us(us: f64) -> f64 {
    us * 1e-6
}
