//! Reflectance of metals.

/// Reflectance of a metal of complex index `n + i k` for unpolarised light in air, 0..1.
pub fn conductor(cos: f32, n: f32, k: f32) -> f32 {
    // c_t = sqrt(1 - sin^2 / m^2), all complex.
    let (cos, n, k) = (f64::from(cos), f64::from(n), f64::from(k));
    let m2 = ComplexIndex(n * n - k * k, 2.0 * n * k);
    let ratio = ComplexIndex(1.0 - cos * cos, 0.0).over(m2);
    let cos_t = ComplexIndex(1.0 - ratio.0, -ratio.1).root();
    let m = ComplexIndex(n, k);
    let m_cos_t = m.times(cos_t);
    let s = ComplexIndex(cos - m_cos_t.0, -m_cos_t.1).over(ComplexIndex(cos + m_cos_t.0, m_cos_t.1));
    let m_cos = ComplexIndex(m.0 * cos, m.1 * cos);
    let p = ComplexIndex(m_cos.0 - cos_t.0, m_cos.1 - cos_t.1).over(ComplexIndex(m_cos.0 + cos_t.0, m_cos.1 + cos_t.1));
    ((s.square() + p.square()) / 2.0) as f32
}

#[derive(Clone, Copy)]
struct ComplexIndex(f64, f64);

impl ComplexIndex {
    fn square(self) -> f64 {
        self.0 * self.0 + self.1 * self.1
    }

    fn times(self, b: ComplexIndex) -> ComplexIndex {
        ComplexIndex(self.0 * b.0 - self.1 * b.1, self.0 * b.1 + self.1 * b.0)
    }

    fn over(self, b: ComplexIndex) -> ComplexIndex {
        let square = b.square();
        ComplexIndex((self.0 * b.0 + self.1 * b.1) / square, (self.1 * b.0 - self.0 * b.1) / square)
    }

    /// The root with an imaginary part of 0 or more.
    fn root(self) -> ComplexIndex {
        let size = self.square().sqrt();
        let (re, im) = (((size + self.0) / 2.0).max(0.0).sqrt(), ((size - self.0) / 2.0).max(0.0).sqrt());
        ComplexIndex(if self.1 < 0.0 { -re } else { re }, im)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cos(degrees: f32) -> f32 {
        degrees.to_radians().cos()
    }

    #[test]
    fn conductors() {
        assert!((conductor(1.0, 2.0, 8.0) - 0.890_411).abs() < 1e-6);
        assert!((conductor(cos(60.0), 1.5, 0.0) - 0.089_186_7).abs() < 1e-6);
        assert!(conductor(0.0, 2.0, 8.0) > 0.999_999);
    }
}
