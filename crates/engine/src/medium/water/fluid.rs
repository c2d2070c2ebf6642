//! Plane waves at the interface of two fluids.

use std::f64::consts::{LOG10_E, PI};
use std::ops::{Add, Div, Mul, Sub};

/// An acoustic fluid: water, or a sediment treated as one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fluid {
    /// Density, kg/m^3, above 0.
    pub density_kg_m3: f64,
    /// Speed of sound, m/s, above 0.
    pub speed_m_s: f64,
    /// Loss of a wave in it, dB per wavelength, 0 or more; sand has 0.5 to 1. That of the fluid a wave comes from is
    /// ignored.
    pub loss_db_per_wavelength: f64,
}

impl Fluid {
    /// A lossless fluid.
    pub fn new(density_kg_m3: f64, speed_m_s: f64) -> Fluid {
        Fluid { density_kg_m3, speed_m_s, loss_db_per_wavelength: 0.0 }
    }

    /// Pressure reflection coefficient of a plane wave in this fluid that meets `other`: real and imaginary part, for
    /// waves `e^(-i w t)`. `sin_grazing`: sine of the angle between wave and interface, 0 to 1.
    ///
    /// Rayleigh's `V = (r2 c2 cos t1 - r1 c1 cos t2) / (r2 c2 cos t1 + r1 c1 cos t2)`, angles from the normal; beyond
    /// the critical angle `cos t2` is imaginary, and a loss makes `c2` complex (Brekhovskikh and Lysanov, Fundamentals
    /// of Ocean Acoustics).
    pub fn reflection(&self, other: &Fluid, sin_grazing: f64) -> [f64; 2] {
        let [here, there] = self.impedances(other, sin_grazing);
        let sum = there + here;
        if sum.norm() == 0.0 {
            // A wave along an interface without contrast.
            return [0.0, 0.0];
        }
        let Complex { re, im } = (there - here) / sum;
        [re, im]
    }

    /// Part of the power transmitted to `other`, 0 to 1; it and the squared magnitude of [`Fluid::reflection`] add up
    /// to 1. Without losses it is `4 r1 c1 r2 c2 cos t1 cos t2 / (r2 c2 cos t1 + r1 c1 cos t2)^2`, and 0 beyond the
    /// critical angle: the paper's eq. 13.
    pub fn transmittance(&self, other: &Fluid, sin_grazing: f64) -> f64 {
        let [here, there] = self.impedances(other, sin_grazing);
        let sum = (there + here).norm();
        // 1 - |(a - b) / (a + b)|^2 without its cancellation.
        if sum == 0.0 { 1.0 } else { (4.0 * (there.re * here.re + there.im * here.im) / sum).clamp(0.0, 1.0) }
    }

    /// `r1 c1 cos t2` and `r2 c2 cos t1`.
    fn impedances(&self, other: &Fluid, sin_grazing: f64) -> [Complex; 2] {
        let cos = sin_grazing.clamp(0.0, 1.0);
        // A loss of `a` dB per wavelength is a wavenumber of `k (1 + i a / (40 pi log10 e))`.
        let slowness = Complex { re: 1.0, im: other.loss_db_per_wavelength / (40.0 * PI * LOG10_E) };
        let speed = Complex::real(other.speed_m_s) / slowness;
        let ratio = speed / Complex::real(self.speed_m_s);
        let ratio2 = ratio * ratio;
        // 1 - ratio^2 sin^2, kept exact at grazing angles with little contrast.
        let cos_there = (Complex::real(1.0) - ratio2 + ratio2 * Complex::real(cos * cos)).sqrt();
        [
            cos_there * Complex::real(self.density_kg_m3 * self.speed_m_s),
            speed * Complex::real(other.density_kg_m3 * cos),
        ]
    }
}

#[derive(Clone, Copy)]
struct Complex {
    re: f64,
    im: f64,
}

impl Complex {
    fn real(re: f64) -> Complex {
        Complex { re, im: 0.0 }
    }

    /// Square of the absolute value.
    fn norm(self) -> f64 {
        self.re * self.re + self.im * self.im
    }

    /// The root with neither part negative, which makes waves decay, of a number whose imaginary part is not negative.
    fn sqrt(self) -> Complex {
        let length = self.norm().sqrt();
        // Of the two forms of each part, the one without cancellation.
        let large = (0.5 * (length + self.re.abs())).sqrt();
        if large == 0.0 {
            return Complex::real(0.0);
        }
        let small = 0.5 * self.im.abs() / large;
        if self.re >= 0.0 { Complex { re: large, im: small } } else { Complex { re: small, im: large } }
    }
}

impl Add for Complex {
    type Output = Complex;
    fn add(self, other: Complex) -> Complex {
        Complex { re: self.re + other.re, im: self.im + other.im }
    }
}

impl Sub for Complex {
    type Output = Complex;
    fn sub(self, other: Complex) -> Complex {
        Complex { re: self.re - other.re, im: self.im - other.im }
    }
}

impl Mul for Complex {
    type Output = Complex;
    fn mul(self, other: Complex) -> Complex {
        Complex { re: self.re * other.re - self.im * other.im, im: self.re * other.im + self.im * other.re }
    }
}

impl Div for Complex {
    type Output = Complex;
    fn div(self, other: Complex) -> Complex {
        let norm = other.norm();
        Complex {
            re: (self.re * other.re + self.im * other.im) / norm,
            im: (self.im * other.re - self.re * other.im) / norm,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use echocast_kernels::water::transmittance;

    const WATER: Fluid = Fluid { density_kg_m3: 1025.0, speed_m_s: 1500.0, loss_db_per_wavelength: 0.0 };
    const SAND: Fluid = Fluid { density_kg_m3: 1900.0, speed_m_s: 1650.0, loss_db_per_wavelength: 0.8 };
    const MUD: Fluid = Fluid { density_kg_m3: 1200.0, speed_m_s: 1480.0, loss_db_per_wavelength: 0.1 };

    fn power([re, im]: [f64; 2]) -> f64 {
        re * re + im * im
    }

    #[test]
    fn what_is_not_reflected_is_transmitted() {
        let air = Fluid::new(1.2, 340.0);
        for other in [WATER, SAND, MUD, air, Fluid { loss_db_per_wavelength: 0.0, ..SAND }] {
            for step in 0..=1000 {
                let sin = f64::from(step) / 1000.0;
                let (v, alpha) = (WATER.reflection(&other, sin), WATER.transmittance(&other, sin));
                assert!((power(v) + alpha - 1.0).abs() < 1e-12, "{other:?} {sin}: {v:?} {alpha}");
                let cos_there = (1.0 - sin * sin).sqrt() * other.speed_m_s / WATER.speed_m_s;
                if other.loss_db_per_wavelength == 0.0 && cos_there < 1.0 && sin > 0.0 {
                    let impedances = [WATER, other].map(|it| it.density_kg_m3 * it.speed_m_s);
                    let known = transmittance(impedances, [sin, (1.0 - cos_there * cos_there).sqrt()]);
                    assert!((known - alpha).abs() < 1e-12, "{other:?} {sin}: {known} {alpha}");
                }
            }
        }
    }

    #[test]
    fn a_boundary_without_contrast_is_none() {
        for sin in [0.0, 1e-9, 0.3, 1.0] {
            assert!(power(WATER.reflection(&WATER, sin)) < 1e-30);
            assert!((WATER.transmittance(&WATER, sin) - 1.0).abs() < 1e-15);
        }
    }

    /// As much is transmitted in the reverse direction, by Snell's law.
    #[test]
    fn both_ways_are_alike() {
        let other = Fluid::new(1100.0, 1550.0);
        for sin in [0.3f64, 0.5, 0.8, 1.0] {
            let cos_there = other.speed_m_s / WATER.speed_m_s * (1.0 - sin * sin).sqrt();
            let back = other.transmittance(&WATER, (1.0 - cos_there * cos_there).sqrt());
            assert!((WATER.transmittance(&other, sin) - back).abs() < 1e-12);
        }
    }

    #[test]
    fn beyond_the_critical_angle_all_is_reflected_unless_the_sediment_absorbs_it() {
        let hard = Fluid { loss_db_per_wavelength: 0.0, ..SAND };
        // Critical at a grazing angle of acos(1500 / 1650) = 24.6 degrees.
        for degrees in [1.0f64, 10.0, 24.0] {
            let sin = degrees.to_radians().sin();
            assert!((power(WATER.reflection(&hard, sin)) - 1.0).abs() < 1e-12);
            assert_eq!(WATER.transmittance(&hard, sin), 0.0);
            assert!(WATER.transmittance(&SAND, sin) > 1e-3);
        }
        assert!(WATER.transmittance(&hard, 25f64.to_radians().sin()) > 0.1);
    }

    /// The air reflects everything with the sign inverted.
    #[test]
    fn the_surface_is_a_soft_mirror() {
        let [re, im] = WATER.reflection(&Fluid::new(1.2, 340.0), 1.0);
        assert!((re + 0.999_47).abs() < 1e-5 && im == 0.0);
    }
}
