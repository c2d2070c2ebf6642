//! Droplets of water too many to count: fog and spray.

use super::visibility::{self, VisibilityModel};
use crate::ground::error::{Error, Result};
use crate::read::bounds::{ABOVE_ZERO, Bounds};
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// A modified gamma distribution of droplet radii, `N(r) ~ r^a exp(-b r^g)` with its maximum at the mode radius.
///
/// The named ones are those of Rasshofer et al. 2011 and Chu and Hogg 1968, as listed by LISA (Kilic et al. 2021).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Spectrum {
    /// 20 droplets per cm^3, mode radius 10 um.
    StrongAdvectionFog,
    /// 20 droplets per cm^3, mode radius 8 um.
    ModerateAdvectionFog,
    /// 20 droplets per cm^3, mode radius 1 um, with a long tail.
    ChuHogg,
    /// 100 droplets per cm^3, mode radius 4 um: what wheels throw up from a wet road.
    StrongSpray,
    /// 100 droplets per cm^3, mode radius 2 um.
    ModerateSpray,
    /// A custom one.
    Gamma {
        /// Droplets per cm^3, above 0.
        per_cm3: f64,
        /// Exponent `a`, above 0.
        a: f64,
        /// Exponent `g`, above 0.
        g: f64,
        /// Most frequent radius, um, above 0.
        mode_radius_um: f64,
    },
}

impl Spectrum {
    fn check(&self, key: &str, bounds: &mut Bounds) -> Result<()> {
        let Spectrum::Gamma { per_cm3, a, g, mode_radius_um } = *self else { return Ok(()) };
        let key = format!("{key}.gamma");
        bounds.number(format_args!("{key}.per_cm3"), per_cm3, [ABOVE_ZERO, 1e6], "above 0, at most 1e6")?;
        bounds.within(format_args!("{key}.a"), a, 0.1, 20.0)?;
        bounds.within(format_args!("{key}.g"), g, 0.1, 10.0)?;
        bounds.within(format_args!("{key}.mode_radius_um"), mode_radius_um, 0.01, 1000.0)
    }

    /// Droplets per m^3, exponents a and g, mode radius in m.
    fn numbers(self) -> [f64; 4] {
        let [per_cm3, a, g, mode_radius_um] = match self {
            Spectrum::StrongAdvectionFog => [20.0, 3.0, 1.0, 10.0],
            Spectrum::ModerateAdvectionFog => [20.0, 3.0, 1.0, 8.0],
            Spectrum::ChuHogg => [20.0, 2.0, 0.5, 1.0],
            Spectrum::StrongSpray => [100.0, 6.0, 1.0, 4.0],
            Spectrum::ModerateSpray => [100.0, 6.0, 1.0, 2.0],
            Spectrum::Gamma { per_cm3, a, g, mode_radius_um } => [per_cm3, a, g, mode_radius_um],
        };
        [per_cm3 * 1e6, a, g, mode_radius_um * 1e-6]
    }

    /// Extinction, 1/m: `int pi r^2 Q_ext(r) N(r) dr`, the distribution normalised to its number of droplets.
    pub fn extinction(self, wavelength_nm: f64) -> f64 {
        let [number, a, g, mode] = self.numbers();
        // In units of the mode radius N ~ x^a exp(-(a/g) x^g); x = e^s resolves all scales equally.
        let (mut droplets, mut area) = (0.0, 0.0);
        let steps = 4000;
        // Around the droplets that intercept most light; small exponents spread far.
        let middle = ((a + 3.0) / a).ln() / g;
        let reach = 7.0 / g.min(1.0);
        let (from, to) = (middle - reach, middle + reach);
        for step in 0..steps {
            let x = f64::exp(from + (to - from) * (f64::from(step) + 0.5) / f64::from(steps));
            // In logarithms: either factor alone may overflow f64.
            let weight = ((a + 1.0) * x.ln() - (a / g) * x.powf(g)).exp();
            droplets += weight;
            area += weight * PI * (x * mode).powi(2) * extinction_efficiency(x * mode, wavelength_nm);
        }
        number * area / droplets
    }
}

/// Refractive index of water near 905 nm (1.318 at 1550 nm changes extinction by less than the approximation does).
const WATER: f64 = 1.328;

/// Extinction efficiency of a water droplet: anomalous diffraction (van de Hulst 1957, 11.22) and the edge term
/// `1.992386 x^(-2/3)` (Nussenzveig and Wiscombe 1980); compared with Mie series of the five named spectra it is 0.05
/// to 0.5 % too large.
fn extinction_efficiency(radius: f64, wavelength_nm: f64) -> f64 {
    let x = 2.0 * PI * radius / (wavelength_nm * 1e-9);
    let p = 2.0 * x * (WATER - 1.0);
    // Near 0 the difference of large terms is p^2 / 2.
    let diffraction = if p < 1e-3 { p * p / 2.0 } else { 2.0 - 4.0 / p * p.sin() + 4.0 / (p * p) * (1.0 - p.cos()) };
    diffraction + if x > 1.0 { 1.992_386 * x.powf(-2.0 / 3.0) } else { 0.0 }
}

/// Fog, given by visibility or by its droplets.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Fog {
    /// Visibility at 550 nm and 2 % contrast, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub visibility_m: Option<f64>,
    /// Meteorological optical range instead, at 5 % contrast, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mor_m: Option<f64>,
    /// Droplets instead.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub spectrum: Option<Spectrum>,
    /// How extinction by visibility depends on the wavelength; default Kim.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub model: Option<VisibilityModel>,
    /// Extinction over backscatter, sr; default 18.8.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lidar_ratio_sr: Option<f64>,
}

/// Lidar ratio of water droplets at 905 nm, sr (O'Connor, Illingworth, Hogan 2004: 18.8 +- 0.8).
const LIDAR_RATIO_SR: f64 = 18.8;

impl Fog {
    pub(in crate::medium) fn check(&self, key: &str, bounds: &mut Bounds) -> Result<()> {
        visibility::check_sight(key, self.visibility_m, self.mor_m, bounds)?;
        bounds.within(format_args!("{key}.lidar_ratio_sr"), self.lidar_ratio_sr, 1.0, 1000.0)?;
        match (&self.spectrum, self.visibility_m.or(self.mor_m)) {
            (None, None) => Err(Error::invalid(key, "without visibility_m, mor_m and spectrum", "one of them")),
            (Some(_), Some(_)) => {
                Err(Error::invalid(format!("{key}.spectrum"), "beside visibility_m or mor_m", "one of them"))
            }
            (Some(spectrum), None) => spectrum.check(&format!("{key}.spectrum"), bounds),
            (None, Some(_)) => Ok(()),
        }
    }

    /// Extinction, 1/m.
    pub fn extinction(&self, wavelength_nm: f64) -> f64 {
        let model = self.model.unwrap_or(VisibilityModel::Kim);
        match (self.spectrum, visibility::sight(self.visibility_m, self.mor_m)) {
            (Some(spectrum), _) => spectrum.extinction(wavelength_nm),
            (None, Some(sight)) => visibility::extinction(sight, wavelength_nm, model),
            (None, None) => 0.0,
        }
    }

    /// Extinction, 1/m, and backscatter, 1/(m sr).
    pub fn coefficients(&self, wavelength_nm: f64) -> [f64; 2] {
        let extinction = self.extinction(wavelength_nm);
        [extinction, extinction / self.lidar_ratio_sr.unwrap_or(LIDAR_RATIO_SR)]
    }
}

/// Spray behind wheels: droplets in a region that the host moves with the vehicle.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Spray {
    /// Its droplets.
    pub spectrum: Spectrum,
}

impl Spray {
    pub(in crate::medium) fn check(&self, key: &str, bounds: &mut Bounds) -> Result<()> {
        self.spectrum.check(&format!("{key}.spectrum"), bounds)
    }

    /// Extinction, 1/m, and backscatter, 1/(m sr).
    pub fn coefficients(&self, wavelength_nm: f64) -> [f64; 2] {
        let extinction = self.spectrum.extinction(wavelength_nm);
        [extinction, extinction / LIDAR_RATIO_SR]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against Mie series summed with miepython 3.3 over the same spectra at 905 nm.
    #[test]
    fn spectra_dim_as_mie_theory_says() {
        for (spectrum, expected, mor) in [
            (Spectrum::StrongAdvectionFog, 2.906_61e-2, 103.07),
            (Spectrum::ModerateAdvectionFog, 1.872_25e-2, 160.01),
            (Spectrum::ChuHogg, 1.635_04e-3, 1832.2),
            (Spectrum::StrongSpray, 1.705_71e-2, 175.63),
            (Spectrum::ModerateSpray, 4.489_49e-3, 667.28),
        ] {
            let found = spectrum.extinction(905.0);
            assert!((found / expected - 1.0).abs() < 0.006, "{spectrum:?}: {found} {expected}");
            // Range at which 5 % of contrast remains.
            assert!((20f64.ln() / found / mor - 1.0).abs() < 0.006, "{spectrum:?}: {found} {mor}");
        }
        let own = Spectrum::Gamma { per_cm3: 20.0, a: 3.0, g: 1.0, mode_radius_um: 10.0 };
        assert_eq!(own.extinction(905.0), Spectrum::StrongAdvectionFog.extinction(905.0));
    }

    /// Lidar ratios: 18.8 sr of droplets give a backscatter of 0.15935 over the optical range, 65.1 sr the 0.046 used
    /// by LiDAR_fog_sim (Hahner et al. 2021).
    #[test]
    fn fog_sends_back_by_its_lidar_ratio() {
        for (lidar_ratio_sr, expected, within) in [(None, 0.159_35, 5e-6), (Some(65.1), 0.046, 5e-5)] {
            let fog = Fog { mor_m: Some(50.0), lidar_ratio_sr, ..Fog::default() };
            let [extinction, backscatter] = fog.coefficients(905.0);
            assert!((extinction * 50.0 - 2.995_73).abs() < 5e-6);
            assert!((backscatter * 50.0 - expected).abs() < within, "{backscatter}");
        }
        let [extinction, backscatter] = Spray { spectrum: Spectrum::StrongSpray }.coefficients(905.0);
        assert_eq!(extinction / backscatter, 18.8);
    }

    #[test]
    fn large_droplets_take_twice_their_area() {
        assert!((extinction_efficiency(1e-2, 905.0) - 2.0).abs() < 2e-3);
        assert!(extinction_efficiency(1e-12, 905.0) < 1e-9);
    }
}
