//! The instrument's own light, reflected specularly by a smooth surface near normal incidence.
//!
//! Such a surface is a mirror in which the instrument sees itself at twice the range. Its receiver collects the
//! fraction `1 - exp(-2 a^2 / w(2 R)^2)` of the reflected light: that of a Gaussian beam of radius `w` (1/e^2) through
//! an aperture of radius `a` on its axis. At an angle of incidence `theta` the axis returns at a distance `d = 2 theta
//! R` from the centre of the aperture, and the light is reduced by the factor `(erf(sqrt 2 (d + a) / w) - erf(sqrt 2 (d
//! - a) / w)) / (2 erf(sqrt 2 a / w))`: what a slit of that width would lose. For an aperture much smaller than the
//!   beam, and for a beam without width, this is exact; in between it is too large by up to 0.07 of the light at normal
//!   incidence.

use ground::math::erf;
use std::f64::consts::SQRT_2;

/// What determines how an instrument sees its own reflection.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Glint {
    /// Radius of the beam where it starts, at 1/e^2, m.
    pub start: f32,
    /// Half divergence at 1/e^2, rad.
    pub divergence: f32,
    /// Radius of the receiver's aperture, m, above 0.
    pub opening: f32,
}

impl Glint {
    /// Radius of the beam after `length` m, m.
    fn radius(self, length: f32) -> f32 {
        self.start.hypot(self.divergence * length)
    }

    /// Fraction of the light reflected back along its path at `range` m that the receiver collects, 0..1.
    fn taken(self, range: f32) -> f32 {
        -(-2.0 * (self.opening / self.radius(2.0 * range)).powi(2)).exp_m1()
    }

    /// Effective reflectance of a surface that reflects the light back along its path: its `reflected` fraction, 0..1,
    /// reaches the receiver as from a Lambert surface of that brightness. `angle`: angle of incidence, rad; `range`:
    /// distance, m.
    pub(crate) fn rho_eff(self, reflected: f32, angle: f32, range: f32) -> f32 {
        let beside = 2.0 * angle * range;
        // There is no significant light beyond; usually the sum, which exceeds the radius, already shows this.
        let is_beyond = |width: f32| beside - self.opening > 3.0 * width;
        if is_beyond(self.start + self.divergence * 2.0 * range) {
            return 0.0;
        }
        let width = self.radius(2.0 * range);
        if is_beyond(width) {
            return 0.0;
        }
        let within = |edge: f32| erf(SQRT_2 * f64::from(edge / width.max(f32::MIN_POSITIVE)));
        let opening = self.opening;
        let left = (within(beside + opening) - within(beside - opening)) / (2.0 * within(opening));
        // A Lambert surface scatters rho_eff / pi of the light into each steradian, and the aperture covers pi a^2 /
        // R^2 of them.
        reflected * left as f32 * self.taken(range) * (range / self.opening).powi(2)
    }

    /// Upper bound of `rho_eff / R^2` from `range` m on, 1/m^2.
    pub(crate) fn greatest_power(self, range: f32) -> f32 {
        self.taken(range) / (self.opening * self.opening)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BEAM: Glint = Glint { start: 5e-3, divergence: 1.5e-3, opening: 10e-3 };

    /// Computed with numpy: a beam of 5 mm and 1.5 mrad after 20 m, and what an aperture of 10 mm collects of it.
    #[test]
    fn the_receiver_takes_its_part_of_the_beam() {
        assert!((BEAM.radius(20.0) - 30.414e-3).abs() < 1e-6);
        assert!((BEAM.taken(10.0) - 0.194_439).abs() < 1e-6);
        let expected = 0.04 * 0.194_439 * 1e6;
        assert!((BEAM.rho_eff(0.04, 0.0, 10.0) / expected - 1.0).abs() < 1e-5);
        // A beam without width returns entirely.
        let line = Glint { start: 0.0, divergence: 0.0, ..BEAM };
        assert_eq!((line.taken(10.0), line.greatest_power(10.0)), (1.0, 1e4));
    }

    /// Fraction of the light at normal incidence at 0.25 to 2 mrad, computed with numpy by summing the beam over the
    /// aperture.
    #[test]
    fn a_surface_turned_away_shows_less() {
        let head_on = BEAM.rho_eff(0.04, 0.0, 10.0);
        for (mrad, expected) in
            [(0.25, 0.9527), (0.5, 0.8239), (0.75, 0.6465), (1.0, 0.4602), (1.5, 0.1739), (2.0, 0.0443)]
        {
            let share = BEAM.rho_eff(0.04, mrad * 1e-3, 10.0) / head_on;
            assert!((share - expected).abs() < 0.02, "{mrad}: {share}");
        }
        assert_eq!(BEAM.rho_eff(0.04, 5.5e-3, 10.0), 0.0);
        // A beam without width returns into the aperture or misses it.
        let line = Glint { start: 0.0, divergence: 0.0, ..BEAM };
        assert_eq!(line.rho_eff(0.04, 0.49e-3, 10.0), 0.04 * 1e6);
        assert_eq!(line.rho_eff(0.04, 0.51e-3, 10.0), 0.0);
    }

    #[test]
    fn power_falls_with_range() {
        for centimetres in 1..5000 {
            let range = centimetres as f32 / 100.0;
            let power = BEAM.rho_eff(1.0, 0.0, range) / (range * range);
            assert!(power <= BEAM.greatest_power(range) * (1.0 + 1e-6));
            assert!(BEAM.greatest_power(range) <= BEAM.greatest_power(range - 0.01) * (1.0 + 1e-6));
        }
    }
}
