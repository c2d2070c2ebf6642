//! How surfaces distribute returned light over directions, as seen by a monostatic instrument.
//!
//! Each model gives the effective reflectance `rho_eff = pi f_r cos(theta)`: the reflectance of a Lambert surface at
//! normal incidence that returns as much, `f_r` the model's BRDF (1/sr) back to the light source, `theta` the incidence
//! angle.

use super::Reflectance;
use ground::error::{Error, Result};
use ground::read::yaml;
use serde::{Deserialize, Deserializer};
use std::f32::consts::PI;

/// How a surface scatters. Its reflectance is that of the diffuse part; together with what `phong` and `ggx` add it may
/// not exceed 1, and where it would, the diffuse part is reduced.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub enum Scattering {
    /// Equally bright from all directions: `rho cos(theta)`.
    #[default]
    Lambert,
    /// Equally strong at every angle: `rho`. A model of targets such as foliage, not of a surface.
    Constant,
    /// Rough and diffuse, made of Lambert facets (Oren and Nayar 1994, their qualitative model, seen from the light
    /// source): `rho (A cos(theta) + B sin^2(theta))` with `A = 1 - s^2 / (2 s^2 + 0.66)`, `B = 0.45 s^2 / (s^2 +
    /// 0.09)`.
    OrenNayar {
        /// Standard deviation `s` of the facets' slope angle, degrees, 0 to 90.
        slope_sigma_deg: f32,
    },
    /// Diffuse with a gloss (Phong, normalised): `rho cos(theta) + specular (n + 2) / 2 max(0, cos(2 theta))^n
    /// cos(theta)`.
    Phong {
        /// Reflectance of the gloss, 0 to 1.
        specular: f32,
        /// How narrow it is: `n`, 0 to 100000.
        exponent: f32,
    },
    /// Diffuse under a layer of microfacet mirrors (Walter and others 2007, shadowed by height-correlated Smith): `rho
    /// cos(theta) + pi D f0 G / (4 cos(theta))`.
    Ggx {
        /// Reflectance of the mirrors at normal incidence, 0 to 1.
        f0: f32,
        /// How much the mirrors tilt, 0.001 to 1; in glTF the square of the roughness.
        alpha: f32,
    },
    /// Diffuse, and returning light to its source: `rho cos(theta) + pi R_A(theta) / cos(theta)`. Effective
    /// reflectances are far above 1.
    RetroReflector {
        /// Coefficient of retro-reflection `R_A` at some incidence angles, rising: linear in between, constant before
        /// the first, and zero beyond the last, where data sheets end.
        samples: Vec<RetroSample>,
    },
}

/// Coefficient of retro-reflection at one incidence angle.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RetroSample {
    /// Incidence angle, degrees, 0 to 85.
    pub angle_deg: f32,
    /// Returned luminous intensity over the illuminance perpendicular to the beam and the area: `R_A`, cd/(lx m^2), 0
    /// to 10000.
    pub cd_lx_m2: f32,
}

impl Scattering {
    /// Effective reflectance of a surface whose diffuse part has the reflectance `rho`, 0..1; `cos` of the incidence
    /// angle, 0..1.
    #[doc(hidden)]
    pub fn rho_eff(&self, rho: f32, cos: f32) -> f32 {
        let sin2 = 1.0 - cos * cos;
        match *self {
            Scattering::Lambert => rho * cos,
            Scattering::Constant => rho,
            Scattering::OrenNayar { slope_sigma_deg } => {
                let s2 = slope_sigma_deg.to_radians().powi(2);
                let (a, b) = (1.0 - 0.5 * s2 / (s2 + 0.33), 0.45 * s2 / (s2 + 0.09));
                rho * (a * cos + b * sin2)
            }
            Scattering::Phong { specular, exponent } => {
                let lobe = 0.5 * (exponent + 2.0) * (cos * cos - sin2).max(0.0).powf(exponent);
                (rho.min(1.0 - specular) + specular * lobe) * cos
            }
            Scattering::Ggx { f0, alpha } => {
                // D = a^2 / (pi (cos^2 (a^2 - 1) + 1)^2) and G / cos = 1 / sqrt(cos^2 + a^2 sin^2), which is G = 1 / (1
                // + 2 L), L = (sqrt(1 + a^2 tan^2) - 1) / 2, without its 0/0 at grazing incidence.
                let a2 = alpha * alpha;
                let denominator = a2 * cos * cos + sin2;
                let lobe = a2 / (4.0 * denominator * denominator * (cos * cos + a2 * sin2).sqrt());
                rho.min(1.0 - f0) * cos + f0 * lobe
            }
            Scattering::RetroReflector { ref samples } => {
                rho * cos + PI * coefficient(samples, cos.acos().to_degrees()) / cos.max(LEAST_COS)
            }
        }
    }

    /// Reflectance of a Lambert surface that returns as much at this angle: [`Scattering::rho_eff`] over `cos`.
    #[doc(hidden)]
    pub fn as_lambert(&self, rho: f32, cos: f32) -> f32 {
        self.rho_eff(rho, cos) / cos.max(LEAST_COS)
    }

    /// Upper bound of [`Scattering::rho_eff`] at any angle.
    #[doc(hidden)]
    pub fn greatest(&self, rho: f32) -> f32 {
        match *self {
            // A and B of Oren and Nayar keep their factors below 1: A cos + B sin^2 is A at normal incidence, and at
            // its peak, if it has one, A^2 / (4 B) + B, which is 0.65 for s = 1 and less for rougher ones.
            Scattering::Lambert | Scattering::Constant | Scattering::OrenNayar { .. } => rho,
            // Both lobes are greatest at normal incidence.
            Scattering::Phong { .. } | Scattering::Ggx { .. } => self.rho_eff(rho, 1.0),
            Scattering::RetroReflector { ref samples } => {
                let coefficient = samples.iter().map(|sample| sample.cd_lx_m2).fold(0.0, f32::max);
                let cos = samples.last().map_or(1.0, |sample| sample.angle_deg.to_radians().cos());
                rho + PI * coefficient / cos
            }
        }
    }

    /// Checks that all values are within their allowed ranges, given the known `reflectance` of the diffuse part.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] that names the key, as in `scattering.f0`.
    #[doc(hidden)]
    pub fn check(&self, reflectance: Option<&Reflectance>) -> Result<()> {
        let within = |key: &str, value: f32, [least, most]: [f32; 2]| {
            let holds = (least..=most).contains(&value);
            let invalid = || Error::invalid(format!("scattering.{key}"), value, format!("{least} to {most}"));
            if holds { Ok(()) } else { Err(invalid()) }
        };
        let beside_reflectance = |key: &str, value: f32| {
            within(key, value, [0.0, 1.0])?;
            let reflectance = reflectance.map_or(0.0, Reflectance::greatest);
            // Single-precision numbers that add up to 1 in decimals may exceed it slightly.
            if value + reflectance <= 1.0 + 1e-6 {
                return Ok(());
            }
            let allowed = format!("such that it and the reflectance of {reflectance} make at most 1");
            Err(Error::invalid(format!("scattering.{key}"), value, allowed))
        };
        match self {
            Scattering::Lambert | Scattering::Constant => Ok(()),
            Scattering::OrenNayar { slope_sigma_deg } => within("slope_sigma_deg", *slope_sigma_deg, [0.0, 90.0]),
            Scattering::Phong { specular, exponent } => {
                beside_reflectance("specular", *specular)?;
                within("exponent", *exponent, [0.0, 1e5])
            }
            Scattering::Ggx { f0, alpha } => {
                beside_reflectance("f0", *f0)?;
                within("alpha", *alpha, [1e-3, 1.0])
            }
            Scattering::RetroReflector { samples } => {
                if samples.is_empty() {
                    return Err(Error::invalid("scattering.samples", "an empty list", "one sample or more"));
                }
                let mut above = None;
                for (index, &RetroSample { angle_deg, cd_lx_m2 }) in samples.iter().enumerate() {
                    let key = format!("samples[{index}].angle_deg");
                    within(&key, angle_deg, [0.0, 85.0])?;
                    if let Some(above) = above.filter(|&above| angle_deg <= above) {
                        let allowed = format!("above {above}, in rising order");
                        return Err(Error::invalid(format!("scattering.{key}"), angle_deg, allowed));
                    }
                    above = Some(angle_deg);
                    within(&format!("samples[{index}].cd_lx_m2"), cd_lx_m2, [0.0, 1e4])?;
                }
                Ok(())
            }
        }
    }
}

/// Cosine below which incidence is grazing: nothing comes back, whatever the model. It is also the least divisor.
const LEAST_COS: f32 = 1e-6;

/// `R_A` at the incidence angle `angle_deg`.
fn coefficient(samples: &[RetroSample], angle_deg: f32) -> f32 {
    let (below, above) = samples.split_at(samples.partition_point(|sample| sample.angle_deg < angle_deg));
    match (below.last(), above.first()) {
        (Some(low), Some(high)) => {
            let t = (angle_deg - low.angle_deg) / (high.angle_deg - low.angle_deg);
            low.cd_lx_m2 + (high.cd_lx_m2 - low.cd_lx_m2) * t
        }
        (None, Some(first)) => first.cd_lx_m2,
        (_, None) => 0.0,
    }
}

impl<'de> Deserialize<'de> for Scattering {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Slope {
            slope_sigma_deg: f32,
        }
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Gloss {
            specular: f32,
            exponent: f32,
        }
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Microfacets {
            f0: f32,
            alpha: f32,
        }
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Retro {
            samples: Vec<RetroSample>,
        }
        const MODELS: &[&str] = &["lambert", "constant", "oren_nayar", "phong", "ggx", "retro_reflector"];
        let (word, section) = yaml::split_tag(deserializer, "model")?;
        Ok(match word.as_str() {
            "lambert" => {
                section.end()?;
                Scattering::Lambert
            }
            "constant" => {
                section.end()?;
                Scattering::Constant
            }
            "oren_nayar" => {
                let Slope { slope_sigma_deg } = section.read()?;
                Scattering::OrenNayar { slope_sigma_deg }
            }
            "phong" => {
                let Gloss { specular, exponent } = section.read()?;
                Scattering::Phong { specular, exponent }
            }
            "ggx" => {
                let Microfacets { f0, alpha } = section.read()?;
                Scattering::Ggx { f0, alpha }
            }
            "retro_reflector" => {
                let Retro { samples } = section.read()?;
                Scattering::RetroReflector { samples }
            }
            _ => return Err(section.unknown(&word, MODELS)),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use std::f64::consts::{FRAC_PI_2, PI, TAU};

    fn at(model: &Scattering, rho: f32, degrees: f32) -> f32 {
        model.rho_eff(rho, degrees.to_radians().cos())
    }

    fn oren_nayar(s: f32) -> Scattering {
        Scattering::OrenNayar { slope_sigma_deg: s.to_degrees() }
    }

    fn retro(samples: &[(f32, f32)]) -> Scattering {
        let sample = |&(angle_deg, cd_lx_m2): &(f32, f32)| RetroSample { angle_deg, cd_lx_m2 };
        Scattering::RetroReflector { samples: samples.iter().map(sample).collect() }
    }

    /// Computed with numpy from the formulas of the models: at normal incidence and at 60 degrees.
    #[test]
    fn effective_reflectances_are_those_of_the_table() {
        for (model, rho, head_on, inclined) in [
            (Scattering::Lambert, 0.5, 0.5, 0.25),
            (Scattering::Constant, 0.5, 0.5, 0.5),
            (oren_nayar(0.3), 0.5, 0.446_429, 0.307_589),
            (oren_nayar(0.5), 0.5, 0.392_241, 0.320_202),
            (Scattering::Phong { specular: 0.15, exponent: 20.0 }, 0.35, 2.0, 0.175),
            (Scattering::Ggx { f0: 0.04, alpha: 0.3 }, 0.4, 0.511_111, 0.202_677),
        ] {
            assert!((at(&model, rho, 0.0) - head_on).abs() < 1e-6, "{model:?}: {}", at(&model, rho, 0.0));
            assert!((at(&model, rho, 60.0) - inclined).abs() < 1e-6, "{model:?}: {}", at(&model, rho, 60.0));
        }
        // pi R_A.
        for (r_a, expected) in [(250.0, 785.398), (70.0, 219.911)] {
            assert!((at(&retro(&[(0.0, r_a)]), 0.0, 0.0) - expected).abs() < 1e-3);
        }
    }

    #[test]
    fn models_without_their_parameter_are_lambert() {
        for degrees in [0.0, 20.0, 44.0, 46.0, 80.0, 89.9] {
            let expected = at(&Scattering::Lambert, 0.6, degrees);
            for model in [
                oren_nayar(0.0),
                Scattering::Phong { specular: 0.0, exponent: 50.0 },
                Scattering::Ggx { f0: 0.0, alpha: 0.1 },
                retro(&[(0.0, 0.0)]),
            ] {
                assert!((at(&model, 0.6, degrees) - expected).abs() < 1e-6, "{model:?} at {degrees}");
            }
        }
    }

    #[test]
    fn coefficients_are_linear_between_angles() {
        let model = retro(&[(5.0, 250.0), (30.0, 150.0)]);
        for (degrees, expected) in
            [(0.0, 250.0), (4.9, 250.0), (17.5, 200.0), (29.99, 150.04), (30.1, 0.0), (80.0, 0.0)]
        {
            let cos = f32::to_radians(degrees).cos();
            let found = at(&model, 0.0, degrees) * cos / std::f32::consts::PI;
            assert!((found - expected).abs() < 1e-2, "{degrees}: {found}");
        }
    }

    /// Finite, non-negative and below the bound that prunes paths, at every angle up to 90 degrees.
    #[test]
    fn nothing_exceeds_the_bound() {
        let models = [
            Scattering::Lambert,
            Scattering::Constant,
            oren_nayar(0.05),
            oren_nayar(0.4),
            oren_nayar(1.5),
            Scattering::Phong { specular: 1.0, exponent: 1e5 },
            Scattering::Phong { specular: 0.3, exponent: 0.0 },
            Scattering::Ggx { f0: 1.0, alpha: 1e-3 },
            Scattering::Ggx { f0: 0.5, alpha: 0.5 },
            Scattering::Ggx { f0: 0.9, alpha: 1.0 },
            retro(&[(0.0, 100.0), (40.0, 700.0), (85.0, 300.0)]),
        ];
        for model in &models {
            for rho in [0.0, 0.3, 1.0] {
                let most = model.greatest(rho);
                for step in 0..=100_000 {
                    let cos = step as f32 / 100_000.0;
                    let (found, lambert) = (model.rho_eff(rho, cos), model.as_lambert(rho, cos));
                    assert!(found >= 0.0 && found <= most * (1.0 + 1e-6), "{model:?} {rho} {cos}: {found} {most}");
                    assert!(lambert.is_finite() && lambert * cos <= found * (1.0 + 1e-6));
                }
            }
        }
    }

    /// BRDFs, 1/sr, as their authors give them, for unit directions to the light and to the eye; the normal is z.
    fn brdf(model: &Scattering, rho: f64, light: DVec3, eye: DVec3) -> f64 {
        let (cos_i, cos_o) = (light.z, eye.z);
        match *model {
            Scattering::OrenNayar { slope_sigma_deg } => {
                let s2 = f64::from(slope_sigma_deg).to_radians().powi(2);
                let (a, b) = (1.0 - 0.5 * s2 / (s2 + 0.33), 0.45 * s2 / (s2 + 0.09));
                let across = (light.truncate().normalize_or_zero()).dot(eye.truncate().normalize_or_zero()).max(0.0);
                let (theta_i, theta_o) = (cos_i.acos(), cos_o.acos());
                rho / PI * (a + b * across * theta_i.max(theta_o).sin() * theta_i.min(theta_o).tan())
            }
            Scattering::Phong { specular, exponent } => {
                let (specular, n) = (f64::from(specular), f64::from(exponent));
                let mirrored = DVec3::new(-light.x, -light.y, light.z).dot(eye).max(0.0);
                rho / PI + specular * (n + 2.0) / TAU * mirrored.powf(n)
            }
            Scattering::Ggx { f0, alpha } => {
                let (f0, a2) = (f64::from(f0), f64::from(alpha).powi(2));
                let half = (light + eye).normalize();
                let d = a2 / (PI * (half.z * half.z * (a2 - 1.0) + 1.0).powi(2));
                let lambda = |cos: f64| ((1.0 + a2 * (1.0 / (cos * cos) - 1.0)).sqrt() - 1.0) / 2.0;
                let g = 1.0 / (1.0 + lambda(cos_i) + lambda(cos_o));
                rho / PI + f0 * d * g / (4.0 * cos_i * cos_o)
            }
            _ => rho / PI,
        }
    }

    /// Our form of each model is its BRDF back to the light, and no BRDF returns more than the incident light: the
    /// integral of `f_r cos` over the hemisphere, by the midpoint rule.
    #[test]
    fn brdfs_keep_energy() {
        let models = [
            (oren_nayar(0.3), 1.0),
            (oren_nayar(1.0), 1.0),
            (Scattering::Phong { specular: 0.4, exponent: 30.0 }, 0.6),
            (Scattering::Phong { specular: 1.0, exponent: 3.0 }, 0.0),
            (Scattering::Ggx { f0: 0.4, alpha: 0.2 }, 0.6),
            (Scattering::Ggx { f0: 1.0, alpha: 0.7 }, 0.0),
        ];
        for (model, rho) in &models {
            for degrees in [0.0f64, 20.0, 45.0, 60.0, 75.0] {
                let (sin, cos) = degrees.to_radians().sin_cos();
                let light = DVec3::new(sin, 0.0, cos);
                let back = PI * brdf(model, *rho, light, light) * cos;
                let found = f64::from(model.rho_eff(*rho as f32, cos as f32));
                assert!((found - back).abs() < 2e-6 * back.max(1.0), "{model:?} at {degrees}: {found} {back}");
                let (rows, columns) = (600, 600);
                let (up, around) = (FRAC_PI_2 / f64::from(rows), TAU / f64::from(columns));
                let mut sum = 0.0;
                for row in 0..rows {
                    let (sin, cos) = ((f64::from(row) + 0.5) * up).sin_cos();
                    for column in 0..columns {
                        let (y, x) = ((f64::from(column) + 0.5) * around).sin_cos();
                        let eye = DVec3::new(sin * x, sin * y, cos);
                        sum += brdf(model, *rho, light, eye) * cos * sin * up * around;
                    }
                }
                assert!(sum < 1.0 + 1e-3, "{model:?} at {degrees}: {sum}");
                // The gloss is normalised at normal incidence.
                if let (Scattering::Phong { .. }, 0.0) = (model, degrees) {
                    assert!((sum - 1.0).abs() < 1e-3, "{model:?}: {sum}");
                }
            }
        }
    }

    /// Gloss and diffuse part add up to at most 1, whatever the base colour.
    #[test]
    fn the_diffuse_part_gives_way() {
        let white = |model: &Scattering| at(model, 1.0, 60.0);
        let phong = Scattering::Phong { specular: 0.3, exponent: 20.0 };
        assert!((white(&phong) - 0.35).abs() < 1e-6);
        let ggx = Scattering::Ggx { f0: 0.04, alpha: 0.3 };
        assert!((white(&ggx) - at(&ggx, 0.96, 60.0)).abs() < 1e-6);
    }
}
