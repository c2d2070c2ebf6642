//! Light at a smooth boundary: directions and shares of what is reflected and refracted.

use glam::Vec3;

/// What a smooth boundary reflects of unpolarised light, 0..1, and the cosine of the refracted direction; total
/// reflection has 1 and 0. `cos`: of the incidence angle, 0..1. `m`: index behind the boundary over that before it.
///
/// The amplitudes of Fresnel's equations, `r_s = (c_i - m c_t) / (c_i + m c_t)`, `r_p = (m c_i - c_t) / (m c_i + c_t)`,
/// which the paper's eq. 12 is the quotient of tangents and sines of, 0/0 head-on.
pub(crate) fn dielectric(cos: f32, m: f32) -> (f32, f32) {
    let sin2 = (1.0 - cos * cos) / (m * m);
    if sin2 >= 1.0 {
        return (1.0, 0.0);
    }
    let cos_t = (1.0 - sin2).sqrt();
    let (s, p) = amplitudes(cos, cos_t, m);
    ((s * s + p * p) / 2.0, cos_t)
}

fn amplitudes(cos: f32, cos_t: f32, m: f32) -> (f32, f32) {
    ((cos - m * cos_t) / (cos + m * cos_t), (m * cos - cos_t) / (m * cos + cos_t))
}

/// What a plate of index `n` reflects and lets pass, with all echoes between its faces, summed as powers for each
/// polarisation: `T = (1-R)^2 A / (1 - R^2 A^2)`, `R' = R + R (1-R)^2 A^2 / (1 - R^2 A^2)`. `pass`: what is left after
/// one way through, `A`; `cos_t`: as [`dielectric`] has it. Total reflection does not occur: both sides are air.
pub(crate) fn plate(cos: f32, cos_t: f32, n: f32, pass: f32) -> (f32, f32) {
    let (s, p) = amplitudes(cos, cos_t, n);
    let shares = [s * s, p * p].map(|r| {
        let between = (1.0 - r) * (1.0 - r) / (1.0 - r * r * pass * pass).max(f32::MIN_POSITIVE);
        (r + r * between * pass * pass, between * pass)
    });
    ((shares[0].0 + shares[1].0) / 2.0, (shares[0].1 + shares[1].1) / 2.0)
}

/// What a metal of complex index `n + i k` reflects of unpolarised light from air, 0..1.
pub(crate) fn conductor(cos: f32, n: f32, k: f32) -> f32 {
    // c_t = sqrt(1 - sin^2 / m^2), all complex.
    let (cos, n, k) = (f64::from(cos), f64::from(n), f64::from(k));
    let m2 = Complex(n * n - k * k, 2.0 * n * k);
    let ratio = Complex(1.0 - cos * cos, 0.0).over(m2);
    let cos_t = Complex(1.0 - ratio.0, -ratio.1).root();
    let m = Complex(n, k);
    let m_cos_t = m.times(cos_t);
    let s = Complex(cos - m_cos_t.0, -m_cos_t.1).over(Complex(cos + m_cos_t.0, m_cos_t.1));
    let m_cos = Complex(m.0 * cos, m.1 * cos);
    let p = Complex(m_cos.0 - cos_t.0, m_cos.1 - cos_t.1).over(Complex(m_cos.0 + cos_t.0, m_cos.1 + cos_t.1));
    ((s.square() + p.square()) / 2.0) as f32
}

#[derive(Clone, Copy)]
struct Complex(f64, f64);

impl Complex {
    fn square(self) -> f64 {
        self.0 * self.0 + self.1 * self.1
    }

    fn times(self, b: Complex) -> Complex {
        Complex(self.0 * b.0 - self.1 * b.1, self.0 * b.1 + self.1 * b.0)
    }

    fn over(self, b: Complex) -> Complex {
        let square = b.square();
        Complex((self.0 * b.0 + self.1 * b.1) / square, (self.1 * b.0 - self.0 * b.1) / square)
    }

    /// The root with an imaginary part of 0 or more.
    fn root(self) -> Complex {
        let size = self.square().sqrt();
        let (re, im) = (((size + self.0) / 2.0).max(0.0).sqrt(), ((size - self.0) / 2.0).max(0.0).sqrt());
        Complex(if self.1 < 0.0 { -re } else { re }, im)
    }
}

/// Direction of the reflected light; `n` is the unit normal on the side of `d`, which comes in.
pub(crate) fn reflected(d: Vec3, n: Vec3) -> Vec3 {
    d - n * (2.0 * d.dot(n))
}

/// Direction of the refracted light, by Snell's law; `cos_t` as [`dielectric`] has it.
pub(crate) fn refracted(d: Vec3, n: Vec3, m: f32, cos_t: f32) -> Vec3 {
    (d / m + n * (-d.dot(n) / m - cos_t)).normalize()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cos(degrees: f32) -> f32 {
        degrees.to_radians().cos()
    }

    /// Values made with numpy from Fresnel's equations.
    #[test]
    fn dielectric_table() {
        for (m, degrees, expected) in [
            (1.5, 0.0, 0.04),
            (1.5, 30.0, 0.041_522_6),
            (1.5, 45.0, 0.050_239_9),
            (1.5, 60.0, 0.089_186_7),
            (1.5, 75.0, 0.253_060_6),
            (1.5, 85.0, 0.612_799_6),
            (1.33, 0.0, 0.020_059_3),
        ] {
            let (found, cos_t) = dielectric(cos(degrees), m);
            assert!((found - expected).abs() < 1e-5, "{m} {degrees}: {found}");
            // There and back: the same share the other way.
            let (back, _) = dielectric(cos_t, 1.0 / m);
            assert!((back - found).abs() < 1e-5, "{m} {degrees}: {back}");
        }
        for (m, degrees) in [(1.0 / 1.5, 42.0), (1.0 / 1.5, 60.0), (1.0 / 1.33, 60.0)] {
            assert_eq!(dielectric(cos(degrees), m), (1.0, 0.0));
        }
        // The critical angle, from glass and from water.
        for (index, critical) in [(1.5, 41.810_31), (1.33, 48.753_47)] {
            assert_eq!(dielectric(cos(critical + 5e-5), 1.0 / index).0, 1.0);
            assert!(dielectric(cos(critical - 5e-5), 1.0 / index).0 < 1.0);
        }
        // Along the boundary everything is reflected.
        for m in [1.5, 1.33, 1.0 / 1.5] {
            assert_eq!(dielectric(0.0, m).0, 1.0);
        }
        // Brewster's angle: nothing of the light in the plane of incidence.
        let brewster = cos(56.309_93);
        let (_, cos_t) = dielectric(brewster, 1.5);
        assert!(amplitudes(brewster, cos_t, 1.5).1.abs() < 1e-6);
        assert_eq!(dielectric(0.5, 1.0).0, 0.0);
    }

    #[test]
    fn conductors() {
        assert!((conductor(1.0, 2.0, 8.0) - 0.890_411).abs() < 1e-6);
        assert!((conductor(cos(60.0), 1.5, 0.0) - 0.089_186_7).abs() < 1e-6);
        assert!(conductor(0.0, 2.0, 8.0) > 0.999_999);
    }

    /// Transmission of a pane of 1.5, and what is left of 1 after one way through, both ways.
    #[test]
    fn plate_table() {
        for (degrees, expected) in
            [(0.0, 0.923_077), (30.0, 0.920_734), (45.0, 0.907_344), (60.0, 0.848_128), (75.0, 0.618_149)]
        {
            let cos = cos(degrees);
            let (reflected, passed) = plate(cos, dielectric(cos, 1.5).1, 1.5, 1.0);
            assert!((passed - expected).abs() < 2e-6, "{degrees}: {passed}");
            assert!((reflected + passed - 1.0).abs() < 1e-6);
        }
        // 20/m of absorption over 4 mm.
        let (reflected, passed) = plate(1.0, 1.0, 1.5, (-0.08f32).exp());
        assert!((passed - 0.851_905_5).abs() < 2e-6 && reflected + passed < 1.0);
    }

    #[test]
    fn snells_law() {
        let d = Vec3::new(0.5, 0.0, -(0.75f32.sqrt()));
        let (_, cos_t) = dielectric(0.75f32.sqrt(), 1.5);
        let t = refracted(d, Vec3::Z, 1.5, cos_t);
        assert!((t - Vec3::new(0.333_333_3, 0.0, -0.942_809)).length() < 1e-6);
        assert!((f64::from(t.x).asin().to_degrees() - 19.4712).abs() < 5e-5);
        assert_eq!(reflected(Vec3::new(0.6, 0.0, -0.8), Vec3::Z), Vec3::new(0.6, 0.0, 0.8));
    }
}
