//! Visibility, and the extinction that follows from it.

use ground::builder;
use ground::error::{Error, Result};
use ground::read::bounds::Bounds;
use serde::{Deserialize, Serialize};

/// How extinction depends on the wavelength.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum VisibilityModel {
    /// Kruse et al. 1962, for haze.
    Kruse,
    /// Kim et al. 2001, for fog: below 500 m all wavelengths are attenuated equally.
    Kim,
}

builder! {
    /// Clear air or haze, given by visibility: `{visibility_m: 23000}`.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    pub struct ClearAir {
        /// Visibility at 550 nm and 2 % contrast, m: extinction is 3.912/V there.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub visibility_m: Option<f64>,
        /// Meteorological optical range instead, at 5 % contrast, m: extinction is 2.996/MOR.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub mor_m: Option<f64>,
        /// How extinction depends on the wavelength; defaults to Kruse.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub model: Option<VisibilityModel>,
    }
}

impl ClearAir {
    pub(in crate::medium) fn check(&self, key: &str, bounds: &mut Bounds) -> Result<()> {
        check_sight(key, self.visibility_m, self.mor_m, bounds)?;
        if self.visibility_m.is_none() && self.mor_m.is_none() {
            return Err(Error::invalid(key, "without visibility_m and mor_m", "one of them"));
        }
        Ok(())
    }

    /// Extinction, 1/m.
    pub fn extinction(&self, wavelength_nm: f64) -> f64 {
        let model = self.model.unwrap_or(VisibilityModel::Kruse);
        sight(self.visibility_m, self.mor_m).map_or(0.0, |sight| extinction(sight, wavelength_nm, model))
    }
}

/// Checks that both are distances, and that only one is given.
pub(in crate::medium) fn check_sight(
    key: &str,
    visibility_m: Option<f64>,
    mor_m: Option<f64>,
    bounds: &mut Bounds,
) -> Result<()> {
    for (name, value) in [("visibility_m", visibility_m), ("mor_m", mor_m)] {
        bounds.number(format_args!("{key}.{name}"), value, [0.1, 1e9], "0.1 or more")?;
    }
    match (visibility_m, mor_m) {
        (Some(_), Some(mor)) => Err(Error::invalid(format!("{key}.mor_m"), mor, "none together with visibility_m")),
        _ => Ok(()),
    }
}

/// Distance, m, at which 2 % contrast remains (visibility, ITU-R P.1814), where the distance for 5 % may be given
/// instead (meteorological optical range, WMO): by Koschmieder's law contrast is `e^(-extinction distance)`.
pub(in crate::medium) fn sight(visibility_m: Option<f64>, mor_m: Option<f64>) -> Option<f64> {
    visibility_m.or_else(|| mor_m.map(|mor| mor * 0.02f64.ln() / 0.05f64.ln()))
}

/// Extinction, 1/m, for a visibility of `sight` m: Koschmieder's `-ln(0.02) / sight` at 550 nm, times
/// `(lambda / 550 nm)^-q`.
///
/// Kruse: q = 1.6 above 50 km, 1.3 above 6 km, else 0.585 V^(1/3). Kim: 1.6, 1.3, 0.16 V + 0.34 (1 to 6 km), V - 0.5
/// (0.5 to 1 km), 0 below; V is the visibility in km.
pub(in crate::medium) fn extinction(sight: f64, wavelength_nm: f64, model: VisibilityModel) -> f64 {
    let km = sight / 1e3;
    let q = match model {
        _ if km > 50.0 => 1.6,
        VisibilityModel::Kruse if km > 6.0 => 1.3,
        VisibilityModel::Kruse => 0.585 * km.cbrt(),
        VisibilityModel::Kim if km > 6.0 => 1.3,
        VisibilityModel::Kim if km > 1.0 => 0.16 * km + 0.34,
        VisibilityModel::Kim if km > 0.5 => km - 0.5,
        VisibilityModel::Kim => 0.0,
    };
    -0.02f64.ln() / sight * (wavelength_nm / 550.0).powf(-q)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn air(visibility_m: f64, model: VisibilityModel, wavelength_nm: f64) -> f64 {
        ClearAir { visibility_m: Some(visibility_m), mor_m: None, model: Some(model) }.extinction(wavelength_nm)
    }

    /// Values computed with numpy (Koschmieder at 2 and 5 %; Kruse 1962; Kim 2001).
    #[test]
    fn visibility_tables() {
        use VisibilityModel::{Kim, Kruse};
        for (visibility, model, wavelength, expected) in [
            (100.0, Kim, 550.0, 3.912_02e-2),
            (100.0, Kim, 905.0, 3.912_02e-2),
            (100.0, Kruse, 905.0, 3.417_22e-2),
            (1e3, Kim, 905.0, 3.049_71e-3),
            (1e3, Kruse, 905.0, 2.923_31e-3),
            (1e3, Kim, 1550.0, 2.330_33e-3),
            (1e3, Kruse, 1550.0, 2.133_88e-3),
            (23e3, Kruse, 905.0, 8.902_293_48e-5),
        ] {
            let found = air(visibility, model, wavelength);
            assert!((found / expected - 1.0).abs() < 2e-6, "{visibility} {model:?} {wavelength}: {found}");
        }
        let mor = ClearAir { mor_m: Some(100.0), ..ClearAir::default() }.extinction(550.0);
        assert!((mor / 2.995_73e-2 - 1.0).abs() < 2e-6);
    }

    /// Exponents at the edges of their pieces: Kim has no steps below 50 km, Kruse has one at 6 km, both have one at 50
    /// km.
    #[test]
    fn exponents_meet_at_the_edges() {
        use VisibilityModel::{Kim, Kruse};
        let exponent = |visibility: f64, model| {
            -(air(visibility, model, 905.0) / air(visibility, model, 550.0)).ln() / (905.0f64 / 550.0).ln()
        };
        for (visibility, model, below, above) in [
            (500.0, Kim, 0.0, 0.0),
            (1e3, Kim, 0.5, 0.5),
            (6e3, Kim, 1.3, 1.3),
            (6e3, Kruse, 1.063, 1.3),
            (50e3, Kim, 1.3, 1.6),
            (50e3, Kruse, 1.3, 1.6),
        ] {
            for (visibility, expected) in [(visibility * 0.999_999, below), (visibility * 1.000_001, above)] {
                let found = exponent(visibility, model);
                assert!((found - expected).abs() < 5e-4, "{model:?} at {visibility} m: {found}");
            }
        }
    }

    #[test]
    fn kim_is_continuous() {
        for visibility in [500.0, 1e3, 6e3] {
            let ratio = air(visibility * 1.000_001, VisibilityModel::Kim, 905.0)
                / air(visibility * 0.999_999, VisibilityModel::Kim, 905.0);
            assert!((ratio - 1.0).abs() < 1e-4, "{visibility}: {ratio}");
        }
    }
}
