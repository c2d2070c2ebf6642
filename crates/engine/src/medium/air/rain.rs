//! Rain and snow: many drops attenuate the beam, single ones return echoes.

use super::particles::Particles;
use ground::builder;
use ground::error::Result;
use ground::read::bounds::Bounds;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// How extinction follows from the rain rate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum RainModel {
    /// ITU-R P.1814-1 (2025), for drops of a gamma distribution of shape `mu`.
    #[default]
    Itu,
    /// Drops of Marshall and Palmer 1948, each counted with twice its area.
    MarshallPalmer,
    /// `0.01 R^0.6` per metre: Goodin et al. 2019, the first pair of the paper's eq. 14, some 25 times the others.
    Paper,
    /// `0.063 R^0.37` per kilometre: Lewandowski et al. 2009, the second pair of the paper's eq. 14, which omits the
    /// unit; per metre, visibility in drizzle would be 10 m.
    PaperLewandowski,
    /// `a R^b`.
    PowerLaw {
        /// Factor, at least 0.
        a: f64,
        /// Exponent.
        b: f64,
        /// The length it refers to.
        unit: PerLength,
    },
}

/// Unit of an extinction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PerLength {
    /// 1/m.
    PerM,
    /// 1/km.
    PerKm,
}

builder! {
    /// Rain: `{rate_mm_h: 10}`.
    #[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields)]
    pub struct Rain {
        /// Rate, mm/h, 0 to 500.
        pub rate_mm_h: f64,
        /// How extinction follows from it; defaults to `itu`, in the profiles `paper` and `blainder` to `paper`.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub model: Option<RainModel>,
        /// Shape of the drop size distribution in `itu`, -2 to 2.
        #[serde(default)]
        pub mu: i32,
        /// Part of the light that drops remove but deflect so little that the receiver still picks it up, 0 to 0.5.
        #[serde(default)]
        pub forward_recovery: f64,
        /// Whether drops appear as points; defaults to true, in the profiles `paper` and `blainder` to false. Only
        /// instruments with `detection.model: radar_equation` distinguish drops that they detect from others.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub drops: Option<bool>,
        /// Whether ranges scatter according to the paper's eq. 15, `sigma = 0.02 R (1 - e^-rate)^2`, where the rain is
        /// everywhere; defaults to false, in the profiles `paper` and `blainder` to true.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub range_noise: Option<bool>,
    }
}

/// `k` and `a` of `k R^a` dB/km in ITU-R P.1814-1, for mu from -2 to 2.
const ITU: [[f64; 2]; 5] = [[2.2838, 0.4050], [1.5921, 0.5506], [1.2924, 0.6436], [1.1394, 0.7057], [1.0505, 0.7497]];

/// One dB/km in 1/m.
const DB_PER_KM: f64 = 1.0 / 4_342.944_819_032_518;

impl Rain {
    /// Rain of `rate_mm_h`, with defaults for everything else.
    pub fn new(rate_mm_h: f64) -> Rain {
        Rain { rate_mm_h, model: None, mu: 0, forward_recovery: 0.0, drops: None, range_noise: None }
    }

    pub(in crate::medium) fn check(&self, key: &str, bounds: &mut Bounds) -> Result<()> {
        bounds.within(format_args!("{key}.rate_mm_h"), self.rate_mm_h, 0.0, 500.0)?;
        bounds.within(format_args!("{key}.mu"), f64::from(self.mu), -2.0, 2.0)?;
        bounds.within(format_args!("{key}.forward_recovery"), self.forward_recovery, 0.0, 0.5)?;
        if let Some(RainModel::PowerLaw { a, b, .. }) = self.model {
            bounds.within(format_args!("{key}.model.power_law.a"), a, 0.0, 1e3)?;
            bounds.within(format_args!("{key}.model.power_law.b"), b, 0.0, 10.0)?;
        }
        Ok(())
    }

    /// Extinction, 1/m; `model` is used where none is given.
    pub fn extinction(&self, model: RainModel) -> f64 {
        let rate = self.rate_mm_h;
        let all = match self.model.unwrap_or(model) {
            RainModel::Itu => {
                let [k, a] = ITU[(self.mu + 2).clamp(0, 4) as usize];
                k * rate.powf(a) * DB_PER_KM
            }
            // int (pi/4 D^2) 2 N0 e^(-L D) dD with D in mm.
            RainModel::MarshallPalmer => match self.drop_sizes() {
                Some(drops) => PI * drops.per_m3_mm / drops.slope_per_mm.powi(3) * 1e-6,
                None => 0.0,
            },
            RainModel::Paper => 0.01 * rate.powf(0.6),
            RainModel::PaperLewandowski => 0.063e-3 * rate.powf(0.37),
            RainModel::PowerLaw { a, b, unit } => a * rate.powf(b) * if unit == PerLength::PerKm { 1e-3 } else { 1.0 },
        };
        if rate > 0.0 { all * (1.0 - self.forward_recovery) } else { 0.0 }
    }

    /// The drops of Marshall and Palmer 1948: N0 = 8000 /(m^3 mm), Lambda = 4.1 R^-0.21 /mm. Drops above a millimetre
    /// flatten as they fall and lose their glory: Q_back 0.09, so they return 0.0225 of what a white disc of their size
    /// would.
    pub(crate) fn drop_sizes(&self) -> Option<Particles> {
        (self.rate_mm_h > 0.0).then(|| Particles {
            per_m3_mm: 8000.0,
            slope_per_mm: 4.1 * self.rate_mm_h.powf(-0.21),
            least_mm: 1.0,
            reflectance: 0.09 / 4.0,
        })
    }

    /// Standard deviation of ranges relative to the range: the paper's eq. 15 (Goodin et al. 2019), read as a
    /// deviation.
    pub fn range_sigma(&self) -> f64 {
        0.02 * (1.0 - (-self.rate_mm_h).exp()).powi(2)
    }
}

builder! {
    /// Snow: `{rate_mm_h: 2}`.
    #[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields)]
    pub struct Snow {
        /// Rate as melted water, mm/h, 0 to 100.
        pub rate_mm_h: f64,
        /// Size distribution of the flakes.
        #[serde(default)]
        pub model: SnowModel,
        /// Density of a flake, kg/m^3, 10 to 917.
        #[serde(default = "flake_density")]
        pub density_kg_m3: f64,
        /// Whether flakes appear as points; defaults to true, in the profiles `paper` and `blainder` to false. Only
        /// instruments with `detection.model: radar_equation` distinguish flakes that they detect from others.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub flakes: Option<bool>,
    }
}

fn flake_density() -> f64 {
    100.0
}

/// Distribution of melted diameters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum SnowModel {
    /// Sekhon and Srivastava 1970.
    #[default]
    SekhonSrivastava,
    /// Gunn and Marshall 1958.
    GunnMarshall,
}

impl Snow {
    /// Snow of `rate_mm_h`, with defaults for everything else.
    pub fn new(rate_mm_h: f64) -> Snow {
        Snow { rate_mm_h, model: SnowModel::default(), density_kg_m3: flake_density(), flakes: None }
    }

    pub(in crate::medium) fn check(&self, key: &str, bounds: &mut Bounds) -> Result<()> {
        bounds.within(format_args!("{key}.rate_mm_h"), self.rate_mm_h, 0.0, 100.0)?;
        bounds.number(format_args!("{key}.density_kg_m3"), self.density_kg_m3, [10.0, 917.0], "10 to 917")
    }

    /// N0, 1/(m^3 mm), and slope, 1/mm, of melted diameters.
    fn melted(&self) -> [f64; 2] {
        let rate = self.rate_mm_h.max(f64::MIN_POSITIVE);
        match self.model {
            SnowModel::SekhonSrivastava => [2.5e3 * rate.powf(-0.94), 2.29 * rate.powf(-0.45)],
            SnowModel::GunnMarshall => [3.8e3 * rate.powf(-0.87), 2.55 * rate.powf(-0.48)],
        }
    }

    /// Diameter of a flake over that of the drop it melts to.
    pub(super) fn growth(&self) -> f64 {
        (1000.0 / self.density_kg_m3).cbrt()
    }

    /// Extinction, 1/m: flakes counted with twice their area.
    pub fn extinction(&self) -> f64 {
        if self.rate_mm_h == 0.0 {
            return 0.0;
        }
        let [number, slope] = self.melted();
        PI * number / slope.powi(3) * 1e-6 * self.growth().powi(2)
    }

    /// Flakes of a millimetre and more, white (0.9).
    pub(crate) fn flake_sizes(&self) -> Option<Particles> {
        let [number, slope] = self.melted();
        (self.rate_mm_h > 0.0).then(|| Particles {
            per_m3_mm: number / self.growth(),
            slope_per_mm: slope / self.growth(),
            least_mm: 1.0,
            reflectance: 0.9,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values computed with numpy from the cited formulas.
    #[test]
    fn rain_tables() {
        for (rate, paper, marshall_palmer, itu) in [
            (1.0, 1.000_00e-2, 3.646_60e-4, 2.975_86e-4),
            (10.0, 3.981_07e-2, 1.555_57e-3, 1.309_82e-3),
            (30.0, 7.696_14e-2, 3.107_95e-3, 2.656_37e-3),
        ] {
            for (model, expected) in
                [(RainModel::Paper, paper), (RainModel::MarshallPalmer, marshall_palmer), (RainModel::Itu, itu)]
            {
                let found = Rain::new(rate).extinction(model);
                assert!((found / expected - 1.0).abs() < 3e-6, "{rate} {model:?}: {found}");
            }
        }
        let per_km = Rain::new(0.5).extinction(RainModel::PaperLewandowski);
        assert!((per_km / 4.874_829_73e-5 - 1.0).abs() < 1e-8);
        let law = RainModel::PowerLaw { a: 0.063, b: 0.37, unit: PerLength::PerM };
        assert!((Rain::new(0.5).extinction(law) / 4.874_829_73e-2 - 1.0).abs() < 1e-8);
        for (rate, mu, expected) in [
            (0.5, -2, 3.971_518_69e-4),
            (0.5, 2, 1.438_565_22e-4),
            (10.0, -2, 1.336_207_05e-3),
            (10.0, -1, 1.302_524_89e-3),
            (10.0, 0, 1.309_823_08e-3),
            (10.0, 1, 1.332_268_94e-3),
            (10.0, 2, 1.359_288_82e-3),
        ] {
            let found = Rain { mu, ..Rain::new(rate) }.extinction(RainModel::Itu);
            assert!((found / expected - 1.0).abs() < 1e-8, "{rate} {mu}: {found}");
        }
        assert_eq!(Rain::new(0.0).extinction(RainModel::Itu), 0.0);
        let half = Rain { forward_recovery: 0.5, ..Rain::new(10.0) };
        assert!((half.extinction(RainModel::Itu) * 2.0 / 1.309_82e-3 - 1.0).abs() < 3e-6);
    }

    /// Against Mie series over the same drops at 905 nm.
    #[test]
    fn drops_of_twice_their_area_come_near_mie_theory() {
        let ratio = Rain::new(10.0).extinction(RainModel::MarshallPalmer) / 1.563_02e-3;
        assert!((ratio - 1.0).abs() < 0.006, "{ratio}");
    }

    #[test]
    fn range_noise_table() {
        for (rate, range, expected) in
            [(0.1, 1.0, 0.000_181_118_34), (1.0, 50.0, 0.399_576_4), (10.0, 50.0, 0.999_909_2)]
        {
            assert!((Rain::new(rate).range_sigma() * range / expected - 1.0).abs() < 1e-6);
        }
    }

    #[test]
    fn snow_tables() {
        use SnowModel::{GunnMarshall, SekhonSrivastava};
        for (model, density_kg_m3, expected) in [
            (GunnMarshall, 1000.0, 7.199_68e-4),
            (GunnMarshall, 100.0, 3.341_79e-3),
            (SekhonSrivastava, 1000.0, 6.540_09e-4),
            (SekhonSrivastava, 100.0, 3.035_64e-3),
        ] {
            let found = Snow { rate_mm_h: 1.0, model, density_kg_m3, flakes: None }.extinction();
            assert!((found / expected - 1.0).abs() < 3e-6, "{model:?} {density_kg_m3}: {found}");
        }
    }

    /// N(D > 0.05 mm) and N(> 1 mm) of 10 mm/h, per m^3.
    #[test]
    fn drops_are_counted() {
        let drops = Rain::new(10.0).drop_sizes().unwrap();
        for (least_mm, expected) in [(0.05, 2788.76), (1.0, 252.576)] {
            let found = drops.count_above(least_mm);
            assert!((found / expected - 1.0).abs() < 3e-6, "{found}");
        }
        assert!(Rain::new(0.0).drop_sizes().is_none());
    }
}
