//! The instrument's own light, thrown back by a smooth surface that is met head-on.
//!
//! Such a surface is a mirror in which the instrument sees itself at twice the range. Into its receiver comes the part
//! `1 - exp(-2 a^2 / w(2 R)^2)` of what is reflected: of a Gaussian beam of radius `w` (1/e^2) through an opening of radius
//! `a` on its axis. That is so while the reflected beam meets the opening, `2 theta <= phi + (a + w_0) / (2 R)`, with the
//! half divergence `phi` and the radius `w_0` with which the beam starts.

/// What of an instrument decides how it sees itself.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Glint {
    /// Radius of the beam where it starts, at 1/e^2, m.
    pub start: f32,
    /// Half divergence at 1/e^2, rad.
    pub divergence: f32,
    /// Radius of the receiver's opening, m, above 0.
    pub opening: f32,
}

impl Glint {
    /// Radius of the beam after `length` m, m.
    fn radius(self, length: f32) -> f32 {
        self.start.hypot(self.divergence * length)
    }

    /// Part of the light reflected at `range` m, along the way that it came, that the receiver takes, 0..1.
    fn taken(self, range: f32) -> f32 {
        -(-2.0 * (self.opening / self.radius(2.0 * range)).powi(2)).exp_m1()
    }

    /// Effective reflectance of a surface that sends the light back as it came: whose `reflected` part, 0..1, comes to the
    /// receiver as it would from a Lambert surface that is so bright. `angle`: of incidence, rad; `range`: way there, m.
    pub(crate) fn rho_eff(self, reflected: f32, angle: f32, range: f32) -> f32 {
        if 2.0 * angle > self.divergence + (self.opening + self.start) / (2.0 * range) {
            return 0.0;
        }
        // A Lambert surface sends rho_eff / pi of the light into each steradian, and the opening is pi a^2 / R^2 of them.
        reflected * self.taken(range) * (range / self.opening).powi(2)
    }

    /// What `rho_eff / R^2` does not exceed from `range` m on, 1/m^2.
    pub(crate) fn greatest_power(self, range: f32) -> f32 {
        self.taken(range) / (self.opening * self.opening)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BEAM: Glint = Glint { start: 5e-3, divergence: 1.5e-3, opening: 10e-3 };

    /// Computed with numpy: a beam of 5 mm and 1.5 mrad after 20 m, and what an opening of 10 mm takes of it.
    #[test]
    fn the_receiver_takes_its_part_of_the_beam() {
        assert!((BEAM.radius(20.0) - 30.414e-3).abs() < 1e-6);
        assert!((BEAM.taken(10.0) - 0.194_439).abs() < 1e-6);
        let expected = 0.04 * 0.194_439 * 1e6;
        assert!((BEAM.rho_eff(0.04, 0.0, 10.0) / expected - 1.0).abs() < 1e-5);
        // A beam without width comes back whole.
        let line = Glint { start: 0.0, divergence: 0.0, ..BEAM };
        assert_eq!((line.taken(10.0), line.greatest_power(10.0)), (1.0, 1e4));
    }

    /// 2 theta = 1.5 mrad + 15 mm / 20 m.
    #[test]
    fn a_surface_turned_away_shows_nothing() {
        assert!(BEAM.rho_eff(0.04, 1.12e-3, 10.0) > 7000.0);
        assert_eq!(BEAM.rho_eff(0.04, 1.13e-3, 10.0), 0.0);
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
