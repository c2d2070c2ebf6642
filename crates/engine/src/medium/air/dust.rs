//! Dust: the paper's clouds of equal spheres.

use ground::builder;
use ground::error::Result;
use ground::read::bounds::{ABOVE_ZERO, Bounds};
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

builder! {
    /// A cloud of equal spheres that scatter isotropically (Phillips et al. 2017, the paper's eq. 16 and 17):
    /// `{radius_um: 50, per_m3: 1.0e5, start_m: 5, length_m: 12.5}`.
    #[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields)]
    pub struct Dust {
        /// Radius of a grain, um, above 0.
        pub radius_um: f64,
        /// Grains per m^3, at least 0.
        pub per_m3: f64,
        /// Extinction efficiency of a grain: 1, as in the paper (whose 2 accounts for the two-way path), or 2,
        /// including diffraction; 0.1 to 4.
        #[serde(default = "one")]
        pub q_ext: f64,
        /// Extinction over backscatter, sr, 1 to 1000: 40 to 60 for mineral dust. Without it all the light that a
        /// grain's area intercepts is scattered isotropically, as in the paper: `4 pi q_ext`.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub lidar_ratio_sr: Option<f64>,
    }
}

fn one() -> f64 {
    1.0
}

impl Dust {
    /// Grains of `radius_um`, `per_m3` of them, with defaults for everything else.
    pub fn new(radius_um: f64, per_m3: f64) -> Dust {
        Dust { radius_um, per_m3, q_ext: one(), lidar_ratio_sr: None }
    }

    pub(in crate::medium) fn check(&self, key: &str, bounds: &mut Bounds) -> Result<()> {
        bounds.number(format_args!("{key}.radius_um"), self.radius_um, [ABOVE_ZERO, 1e5], "above 0, at most 1e5")?;
        bounds.within(format_args!("{key}.per_m3"), self.per_m3, 0.0, 1e15)?;
        bounds.within(format_args!("{key}.lidar_ratio_sr"), self.lidar_ratio_sr, 1.0, 1000.0)?;
        bounds.within(format_args!("{key}.q_ext"), self.q_ext, 0.1, 4.0)
    }

    /// Extinction, 1/m: `Q pi r^2 n`.
    pub fn extinction(&self) -> f64 {
        self.q_ext * PI * (self.radius_um * 1e-6).powi(2) * self.per_m3
    }

    /// Backscatter, 1/(m sr): by the lidar ratio, or `r^2 n / 4`, the paper's eq. 17, with all the light that a grain's
    /// area intercepts scattered evenly into 4 pi sr.
    pub fn backscatter(&self) -> f64 {
        let even = (self.radius_um * 1e-6).powi(2) * self.per_m3 / 4.0;
        self.lidar_ratio_sr.map_or(even, |ratio| self.extinction() / ratio)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dust_table() {
        for (per_m3, extinction, transmittance, backscatter) in
            [(1e5, 7.853_98e-4, 0.980_557, 6.25e-5), (1e7, 7.853_98e-2, 0.140_367, 6.25e-3)]
        {
            let dust = Dust { radius_um: 50.0, per_m3, q_ext: 1.0, lidar_ratio_sr: None };
            assert!((dust.extinction() / extinction - 1.0).abs() < 2e-6);
            assert!(((-2.0 * dust.extinction() * 12.5).exp() / transmittance - 1.0).abs() < 3e-6);
            assert!((dust.backscatter() / backscatter - 1.0).abs() < 1e-12);
            let twice = Dust { q_ext: 2.0, ..dust };
            assert_eq!(twice.extinction(), 2.0 * dust.extinction());
            let mineral = Dust { lidar_ratio_sr: Some(50.0), ..dust };
            assert!((mineral.extinction() / mineral.backscatter() - 50.0).abs() < 1e-9);
        }
    }
}
