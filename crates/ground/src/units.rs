//! Unit conversions: SI inside, other units only at the edges and under a name that says so.

/// Microseconds to seconds.
pub const fn seconds_from_us(us: f64) -> f64 {
    us / 1e6
}

/// Amplitude from a level: dB re 1 uPa to uPa.
pub fn amplitude_from_db(db: f64) -> f64 {
    10f64.powf(db / 20.0)
}

/// Speed of light, m/s.
pub const SPEED_OF_LIGHT: f64 = 299_792_458.0;
