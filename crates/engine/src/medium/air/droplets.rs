//! Water droplets as a continuous medium: fog and spray.

use super::mie;
use super::visibility::{self, VisibilityModel};
use ground::builder;
use ground::error::{Error, Result};
use ground::kept::kept;
use ground::read::bounds::{ABOVE_ZERO, Bounds};
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;
use std::sync::{Arc, Mutex};

/// A modified gamma distribution of droplet radii, `N(r) ~ r^a exp(-b r^g)` with its maximum at the mode radius.
///
/// The named distributions are those of Rasshofer et al. 2011 and Chu and Hogg 1968, as listed by LISA (Kilic et al.
/// 2021).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
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
    /// A custom distribution.
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

    /// Liquid water, g/m^3: `4/3 pi n int r^3 N(r) dr` times a density of 1e6 g/m^3, the distribution normalised.
    pub(in crate::medium) fn liquid_water_g_m3(self) -> f64 {
        let [number, a, g, mode] = self.numbers();
        // In s = ln(r / mode), around the maximum of each integrand, which may overflow f64 by itself.
        let sum = |power: f64| {
            let weight = |s: f64| power * s - (a / g) * (g * s).exp();
            let middle = (power / a).ln() / g;
            let at = |step: u32| middle - 20.0 + 0.01 * f64::from(step);
            let sum: f64 = (0..4000).map(|step| (weight(at(step)) - weight(middle)).exp()).sum();
            (weight(middle), sum)
        };
        let ((all, count), (cubed, volume)) = (sum(a + 1.0), sum(a + 4.0));
        1e6 * 4.0 / 3.0 * PI * number * mode.powi(3) * (cubed - all).exp() * volume / count
    }

    /// Extinction, 1/m, `int pi r^2 Q_ext(r) N(r) dr`, and backscatter, 1/(m sr),
    /// `int pi r^2 Q_back(r) / (4 pi) N(r) dr`, with Mie's efficiencies of spheres of water, the distribution
    /// normalised to its number of droplets.
    pub fn coefficients(self, wavelength_nm: f64) -> [f64; 2] {
        type Sum = ([f64; 5], [f64; 2]);
        /// Kept, so that the frames of a sequence need not sum again.
        static KNOWN: Mutex<Vec<Arc<Sum>>> = Mutex::new(Vec::new());
        let [number, a, g, mode] = self.numbers();
        let key = [number, a, g, mode, wavelength_nm];
        kept(&KNOWN, |(known, _)| *known == key, || (key, summed(key))).1
    }
}

/// [`Spectrum::coefficients`] of its numbers and a wavelength, nm.
fn summed([number, a, g, mode, wavelength_nm]: [f64; 5]) -> [f64; 2] {
    // In units of the mode radius N ~ x^a exp(-(a/g) x^g); x = e^s resolves all scales equally. In logarithms: either
    // factor alone may overflow f64.
    let weight = |s: f64| (a + 1.0) * s - (a / g) * (g * s).exp();
    // Around the droplet size that intercepts most light, out to where droplets intercept 1e-9 of that; small exponents
    // spread far.
    let middle = ((a + 3.0) / a).ln() / g;
    let light = |s: f64| weight(s) + 2.0 * s - weight(middle) - 2.0 * middle;
    let edge = |step: f64| {
        let mut s = middle;
        while light(s) > -20.7 && (s - middle).abs() < 20.0 {
            s += step;
        }
        s
    };
    let (from, to) = (edge(-0.05), edge(0.05));
    // Backscatter ripples with size, so many sizes are averaged: enough for 1 %, and no more terms of Mie's series than
    // can be summed in a second.
    let largest = mie::size(mode * to.exp(), wavelength_nm);
    let steps = (2e7 / largest).clamp(400.0, 6000.0) as u32;
    let water = mie::water(wavelength_nm);
    let (mut extinction, mut backscatter, mut logs) = (0.0, 0.0, Vec::new());
    for step in 0..steps {
        let s = from + (to - from) * (f64::from(step) + 0.5) / f64::from(steps);
        let radius = mode * s.exp();
        let light = weight(s).exp() * radius * radius;
        // Drops larger than rain are no longer spheres.
        let of = mie::sphere(mie::size(radius.min(0.5e-3), wavelength_nm), water, &mut logs);
        extinction += light * PI * of.extinction;
        backscatter += light * of.backscatter / 4.0;
    }
    // All droplets, including those that intercept no light: int x^a exp(-(a/g) x^g) dx.
    let all = (0..4000).map(|step| weight(-40.0 + 60.0 * (f64::from(step) + 0.5) / 4000.0).exp());
    let droplets = all.sum::<f64>() * 60.0 / 4000.0;
    let scale = number / droplets * (to - from) / f64::from(steps);
    [extinction * scale, backscatter * scale]
}

builder! {
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
        /// Droplet size distribution instead.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub spectrum: Option<Spectrum>,
        /// How extinction by visibility depends on the wavelength; defaults to Kim.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub model: Option<VisibilityModel>,
        /// Extinction over backscatter, sr, 1 to 1000; by default that of the droplets, or 18.8 up to 905 nm, rising to
        /// 21.3 at 1550 nm.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub lidar_ratio_sr: Option<f64>,
    }
}

/// Lidar ratio of fog whose droplets are not given, sr: 18.8 at 905 nm and below (O'Connor, Illingworth, Hogan 2004:
/// 18.8 +- 0.8 in water clouds), 21.3 at 1550 nm, where water absorbs (Mie theory for advection fogs), linear in
/// between.
fn lidar_ratio_sr(wavelength_nm: f64) -> f64 {
    18.8 + (21.3 - 18.8) * ((wavelength_nm - 905.0) / (1550.0 - 905.0)).clamp(0.0, 1.0)
}

impl Fog {
    pub(in crate::medium) fn check(&self, key: &str, bounds: &mut Bounds) -> Result<()> {
        visibility::check_sight(key, self.visibility_m, self.mor_m, bounds)?;
        bounds.within(format_args!("{key}.lidar_ratio_sr"), self.lidar_ratio_sr, 1.0, 1000.0)?;
        match (&self.spectrum, self.visibility_m.or(self.mor_m)) {
            (None, None) => Err(Error::invalid(key, "without visibility_m, mor_m and spectrum", "one of them")),
            (Some(_), Some(_)) => {
                Err(Error::invalid(format!("{key}.spectrum"), "together with visibility_m or mor_m", "one of them"))
            }
            (Some(spectrum), None) => spectrum.check(&format!("{key}.spectrum"), bounds),
            (None, Some(_)) => Ok(()),
        }
    }

    /// Extinction, 1/m.
    pub fn extinction(&self, wavelength_nm: f64) -> f64 {
        let model = self.model.unwrap_or(VisibilityModel::Kim);
        match (self.spectrum, visibility::sight(self.visibility_m, self.mor_m)) {
            (Some(spectrum), _) => spectrum.coefficients(wavelength_nm)[0],
            (None, Some(sight)) => visibility::extinction(sight, wavelength_nm, model),
            (None, None) => 0.0,
        }
    }

    /// Liquid water, g/m^3: of a visibility 0.05 at 300 m and 0.5 at 50 m (ITU-R P.840-6, annex 1), and a power law through
    /// both.
    pub(in crate::medium) fn liquid_water_g_m3(&self) -> f64 {
        match (self.spectrum, visibility::sight(self.visibility_m, self.mor_m)) {
            (Some(spectrum), _) => spectrum.liquid_water_g_m3(),
            (None, Some(sight)) => 0.05 * (300.0 / sight).powf(10f64.ln() / 6f64.ln()),
            (None, None) => 0.0,
        }
    }

    /// Extinction, 1/m, and backscatter, 1/(m sr).
    pub fn coefficients(&self, wavelength_nm: f64) -> [f64; 2] {
        match (self.spectrum, self.lidar_ratio_sr) {
            (Some(spectrum), None) => spectrum.coefficients(wavelength_nm),
            (_, ratio) => {
                let extinction = self.extinction(wavelength_nm);
                [extinction, extinction / ratio.unwrap_or_else(|| lidar_ratio_sr(wavelength_nm))]
            }
        }
    }
}

builder! {
    /// Spray behind wheels: droplets in a region that the host moves with the vehicle.
    #[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields)]
    pub struct Spray {
        /// Its droplets.
        pub spectrum: Spectrum,
        /// Extinction over backscatter, sr, 1 to 1000; by default that of the droplets.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub lidar_ratio_sr: Option<f64>,
    }
}

impl Spray {
    /// Spray of drops of the sizes of `spectrum`.
    pub fn new(spectrum: Spectrum) -> Spray {
        Spray { spectrum, lidar_ratio_sr: None }
    }

    pub(in crate::medium) fn check(&self, key: &str, bounds: &mut Bounds) -> Result<()> {
        bounds.within(format_args!("{key}.lidar_ratio_sr"), self.lidar_ratio_sr, 1.0, 1000.0)?;
        self.spectrum.check(&format!("{key}.spectrum"), bounds)
    }

    /// Extinction, 1/m, and backscatter, 1/(m sr).
    pub fn coefficients(&self, wavelength_nm: f64) -> [f64; 2] {
        let [extinction, backscatter] = self.spectrum.coefficients(wavelength_nm);
        [extinction, self.lidar_ratio_sr.map_or(backscatter, |ratio| extinction / ratio)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against Mie series summed with miepython 3.3 over the same spectra, including a haze of small droplets.
    #[test]
    fn spectra_agree_with_mie_theory() {
        let haze = Spectrum::Gamma { per_cm3: 100.0, a: 2.0, g: 0.5, mode_radius_um: 0.07 };
        for (spectrum, wavelength_nm, extinction, backscatter) in [
            (Spectrum::StrongAdvectionFog, 905.0, 2.906_61e-2, 1.619_12e-3),
            (Spectrum::StrongAdvectionFog, 1550.0, 2.958_18e-2, 1.386_02e-3),
            (Spectrum::ModerateAdvectionFog, 905.0, 1.872_25e-2, 1.023_13e-3),
            (Spectrum::ModerateAdvectionFog, 1550.0, 1.910_90e-2, 9.041_02e-4),
            (Spectrum::ChuHogg, 905.0, 1.635_04e-3, 8.467_02e-5),
            (Spectrum::ChuHogg, 1550.0, 1.720_23e-3, 7.982_68e-5),
            (Spectrum::StrongSpray, 905.0, 1.705_71e-2, 8.646_38e-4),
            (Spectrum::StrongSpray, 1550.0, 1.773_02e-2, 9.671_22e-4),
            (Spectrum::ModerateSpray, 905.0, 4.489_49e-3, 2.628_35e-4),
            (Spectrum::ModerateSpray, 1550.0, 4.898_72e-3, 1.735_31e-4),
            (haze, 905.0, 3.162_03e-5, 2.990_76e-7),
            (haze, 1550.0, 1.432_98e-5, 1.617_86e-7),
        ] {
            let [found, back] = spectrum.coefficients(wavelength_nm);
            assert!((found / extinction - 1.0).abs() < 0.005, "{spectrum:?}: {found} {extinction}");
            assert!((back / backscatter - 1.0).abs() < 0.03, "{spectrum:?}: {back} {backscatter}");
        }
        let own = Spectrum::Gamma { per_cm3: 20.0, a: 3.0, g: 1.0, mode_radius_um: 10.0 };
        assert_eq!(own.coefficients(905.0), Spectrum::StrongAdvectionFog.coefficients(905.0));
        // The extremes of the allowed ranges are summed in reasonable time, to finite numbers.
        for a in [0.1, 20.0] {
            for (g, mode_radius_um) in [(0.1, 0.01), (0.1, 1000.0), (10.0, 0.01), (10.0, 1000.0)] {
                let spectrum = Spectrum::Gamma { per_cm3: 1.0, a, g, mode_radius_um };
                let start = std::time::Instant::now();
                let found = spectrum.coefficients(200.0);
                assert!(found.iter().all(|value| value.is_finite() && *value >= 0.0), "{spectrum:?}: {found:?}");
                assert!(start.elapsed().as_secs() < 20, "{spectrum:?}: {:?}", start.elapsed());
            }
        }
    }

    /// Lidar ratios: 18.8 sr of droplets give a backscatter of 0.15935 over the optical range, 65.1 sr the 0.046 used
    /// by LiDAR_fog_sim (Hahner et al. 2021).
    #[test]
    fn fog_backscatter_has_its_lidar_ratio() {
        for (lidar_ratio_sr, expected, within) in [(None, 0.159_35, 5e-6), (Some(65.1), 0.046, 5e-5)] {
            let fog = Fog { mor_m: Some(50.0), lidar_ratio_sr, ..Fog::default() };
            let [extinction, backscatter] = fog.coefficients(905.0);
            assert!((extinction * 50.0 - 2.995_73).abs() < 5e-6);
            assert!((backscatter * 50.0 - expected).abs() < within, "{backscatter}");
        }
        assert_eq!([532.0, 905.0, 1550.0, 2000.0].map(lidar_ratio_sr), [18.8, 18.8, 21.3, 21.3]);
        let spectrum = Spectrum::StrongSpray;
        let [extinction, backscatter] = Spray { spectrum, lidar_ratio_sr: None }.coefficients(905.0);
        assert!((extinction / backscatter / 19.727 - 1.0).abs() < 0.03);
        let [extinction, backscatter] = Spray { spectrum, lidar_ratio_sr: Some(50.0) }.coefficients(905.0);
        assert_eq!(extinction / backscatter, 50.0);
    }

    #[test]
    fn fog_holds_water() {
        let of = |visibility_m| Fog { visibility_m: Some(visibility_m), ..Fog::default() }.liquid_water_g_m3();
        assert!((of(300.0) - 0.05).abs() < 1e-12 && (of(50.0) - 0.5).abs() < 1e-12);
        // 20 droplets per cm^3 of a mode of 10 um: the moment of a gamma distribution, <r^3> = 6! / 3! (r / 3)^3.
        let fog = Fog { spectrum: Some(Spectrum::StrongAdvectionFog), ..Fog::default() };
        let expected = 1e6 * 20e6 * 4.0 / 3.0 * PI * 120.0 * (10e-6f64 / 3.0).powi(3);
        assert!((fog.liquid_water_g_m3() / expected - 1.0).abs() < 1e-6, "{} {expected}", fog.liquid_water_g_m3());
        for (a, g) in [(0.1, 0.1), (0.1, 10.0), (20.0, 0.1), (20.0, 10.0)] {
            let spectrum = Spectrum::Gamma { per_cm3: 1.0, a, g, mode_radius_um: 1.0 };
            let found = spectrum.liquid_water_g_m3();
            assert!(found > 0.0 && found.is_finite(), "{a} {g}: {found}");
        }
    }
}
