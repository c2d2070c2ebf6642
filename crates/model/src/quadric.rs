//! Curved surfaces of parts that are known exactly.

use glam::DVec3;
use std::ops::Range;

/// A surface of second degree about the z axis of a mesh, which some triangles of a part stand for:
/// `x^2 curve.x + y^2 curve.y + (z - middle)^2 curve.z + 2 slope (z - middle) = level`, lengths in m.
///
/// Rays that hit these triangles are taken to hit this surface instead: its range and its normal have no error of
/// tessellation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quadric {
    /// The first of its triangles.
    pub first_triangle: u32,
    /// Number of its triangles.
    pub triangle_count: u32,
    /// Factors of the squares, 1/m^2 or, in all terms alike, any other unit.
    pub curve: DVec3,
    /// Factor of the linear term in z.
    pub slope: f64,
    /// What the terms add up to.
    pub level: f64,
    /// Height of the middle, m.
    pub middle: f64,
    /// Least and greatest z of the surface, m.
    pub span: [f64; 2],
}

impl Quadric {
    /// Its triangles.
    pub(crate) fn triangles(&self) -> Range<u64> {
        let first = u64::from(self.first_triangle);
        first..first + u64::from(self.triangle_count)
    }

    /// An ellipsoid with these half axes, m, about a middle on the z axis, from and up to a height, m.
    pub(crate) fn ellipsoid(radii: DVec3, middle: f64, span: [f64; 2]) -> Quadric {
        let curve = (radii * radii).recip();
        Quadric { first_triangle: 0, triangle_count: 0, curve, slope: 0.0, level: 1.0, middle, span }
    }

    /// A round surface about the z axis whose radius grows by `growth` per metre, `radius` m at z = 0.
    pub(crate) fn lathed(radius: f64, growth: f64, span: [f64; 2]) -> Quadric {
        // x^2 + y^2 = (radius + growth z)^2
        Quadric {
            first_triangle: 0,
            triangle_count: 0,
            curve: DVec3::new(1.0, 1.0, -growth * growth),
            slope: -radius * growth,
            level: radius * radius,
            middle: 0.0,
            span,
        }
    }

    /// The distance, in lengths of `direction`, at which a ray meets the surface, next to `near`, and the gradient there:
    /// normal to the surface. `None`: it passes the surface, or meets it beyond its ends.
    pub fn meet(&self, origin: DVec3, direction: DVec3, near: f64) -> Option<(f64, DVec3)> {
        // From a place on the ray near the surface, where the terms are small: far origins lose no digits.
        let start = origin + direction * near;
        let place = start - DVec3::Z * self.middle;
        let square = (direction * direction).dot(self.curve);
        let half = (place * direction).dot(self.curve) + self.slope * direction.z;
        let rest = (place * place).dot(self.curve) + 2.0 * self.slope * place.z - self.level;
        let root = (half * half - square * rest).sqrt();
        // The root of least magnitude in the form that does not cancel; NaN where there is none.
        let step = -rest / (half + root.copysign(half));
        let found = place + direction * step;
        let z = found.z + self.middle;
        // Written so that NaN fails.
        if !(z >= self.span[0] && z <= self.span[1] && step.is_finite()) {
            return None;
        }
        Some((near + step, found * self.curve + DVec3::Z * self.slope))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rays meet a sphere where the usual formula says, from outside, from inside and from far away.
    #[test]
    fn spheres_are_met_where_they_are() {
        let sphere = Quadric::ellipsoid(DVec3::splat(0.5), 1.0, [0.5, 1.5]);
        for (origin, direction, near, expected) in [
            (DVec3::new(-3.0, 0.0, 1.0), DVec3::X, 2.501, 2.5),
            (DVec3::new(-3.0, 0.0, 1.0), DVec3::X, 3.499, 3.5),
            (DVec3::new(0.0, 0.0, 1.0), DVec3::Y, 0.499, 0.5),
            (DVec3::new(-3e5, 0.3, 1.0), DVec3::X, 3e5 - 0.39, 3e5 - 0.4),
        ] {
            let (met, normal) = sphere.meet(origin, direction, near).unwrap();
            assert!((met - expected).abs() < 1e-9, "{met} {expected}");
            let out = origin + direction * met - DVec3::Z;
            assert!(normal.normalize().dot(out.normalize()) > 1.0 - 1e-12);
        }
        assert_eq!(sphere.meet(DVec3::new(-3.0, 0.5001, 1.0), DVec3::X, 3.0), None);
    }

    /// The side of a cylinder ends; that of a cone narrows to its tip.
    #[test]
    fn sides_are_met_between_their_ends() {
        let cylinder = Quadric::lathed(0.3, 0.0, [-1.0, 1.0]);
        let (met, normal) = cylinder.meet(DVec3::new(-2.0, 0.0, 0.9), DVec3::X, 1.69).unwrap();
        assert!((met - 1.7).abs() < 1e-12 && normal.normalize() == DVec3::NEG_X, "{met} {normal}");
        assert_eq!(cylinder.meet(DVec3::new(-2.0, 0.0, 1.1), DVec3::X, 1.7), None);
        let cone = Quadric::lathed(0.5, -0.5, [-1.0, 1.0]);
        let (met, normal) = cone.meet(DVec3::new(-2.0, 0.0, 0.5), DVec3::X, 1.74).unwrap();
        assert!((met - 1.75).abs() < 1e-12);
        assert!((normal.normalize() - DVec3::new(-1.0, 0.0, 0.5).normalize()).length() < 1e-12, "{normal}");
    }
}
