//! Permittivities of materials at the frequencies of radars.

use super::itu::{ItuMaterial, LOSS_PER_CONDUCTIVITY};
use ground::error::{Error, Result};
use ground::read::bounds::Bounds;
use ground::read::yaml::{self, Section};
use num_complex::Complex64;
use serde::Deserialize;
use serde::de::{Deserializer, Error as _};
use std::f64::consts::FRAC_PI_2;

/// The permittivity of a homogeneous material as a function of the frequency, distinguished by `law`.
///
/// Values are relative, `eps' - j eps''`, with `eps''` at least 0, for waves that vary as `exp(+j omega t)`.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Dielectric {
    /// A building material of ITU-R P.2040-3.
    Itu {
        /// Which.
        material: ItuMaterial,
        /// Whether the table's formula is used outside its range of frequencies, which is otherwise an error.
        extrapolate: bool,
    },
    /// The same at all frequencies, or with a conductivity.
    Permittivity {
        /// `eps'`, 1 to 1000.
        eps: f64,
        /// `eps''` besides that of the conductivity, 0 to 1000; 0 by default.
        loss: f64,
        /// Conductivity, S/m, 0 to 1e9, which adds `sigma / (2 pi f eps_0)` to `eps''`; 0 by default.
        conductivity_s_m: f64,
    },
    /// Any metal: a conductivity of 1e7 S/m, as in ITU-R P.2040-3, at every frequency.
    Metal,
    /// Dry human skin: two terms of Cole and Cole with the values of Gabriel, Lau and Gabriel 1996, Phys. Med. Biol. 41,
    /// 2271 (10 Hz to 100 GHz).
    Skin,
    /// Water: two terms of Debye, ITU-R P.840-9, and for sea water ITU-R P.527-6.
    Water {
        /// Degrees C, -5 to 50; 20 by default.
        temperature_c: f64,
        /// g/kg, 0 to 40: 35 in the ocean; 0 by default.
        salinity_g_kg: f64,
    },
    /// Soil of ITU-R P.527-6, 5.2 (after Dobson et al. 1985), at 20 degrees C: 1 to 1000 GHz.
    Ground {
        /// Volume of the water in a volume of soil, 0.001 to 0.6.
        moisture: f64,
        /// Sand, per cent of the dry mass, 0 to 100; 51.5 by default, sandy loam as in P.527-6.
        sand: f64,
        /// Clay, likewise; 13.5 by default. The rest is silt.
        clay: f64,
    },
    /// Leaves and other green parts of plants, ITU-R P.527-6, 5.3.1, at 20 degrees C.
    Vegetation {
        /// Mass of the water in a mass of leaf, 0 to 0.7; 0.6 by default.
        moisture: f64,
    },
}

/// Words of the laws.
pub(super) const LAWS: [&str; 7] = ["itu", "permittivity", "metal", "skin", "water", "ground", "vegetation"];

/// Degrees C at which soil and plants are.
const OUTDOORS_C: f64 = 20.0;

impl Dielectric {
    /// Relative permittivity `eps' - j eps''` at `frequency_hz`, above 0.
    ///
    /// # Errors
    /// A material of ITU-R P.2040 outside its range, unless it may be extrapolated.
    pub fn permittivity(&self, frequency_hz: f64) -> Result<Complex64> {
        let ghz = frequency_hz / 1e9;
        let conducting = |sigma: f64| LOSS_PER_CONDUCTIVITY * sigma / ghz;
        Ok(match *self {
            Dielectric::Itu { material, extrapolate } => {
                let [least, most] = material.range_ghz();
                if !extrapolate && !(least..=most).contains(&ghz) {
                    let found = format!("used at {ghz} GHz");
                    let allowed = format!("{least} to {most} GHz, or extrapolate: true");
                    return Err(Error::invalid("radar.material", found, allowed));
                }
                material.permittivity(frequency_hz)
            }
            Dielectric::Permittivity { eps, loss, conductivity_s_m } => {
                Complex64::new(eps, -(loss + conducting(conductivity_s_m)))
            }
            Dielectric::Metal => Complex64::new(1.0, -conducting(1e7)),
            Dielectric::Skin => skin(ghz),
            Dielectric::Water { temperature_c, salinity_g_kg } => water(ghz, temperature_c, salinity_g_kg),
            Dielectric::Ground { moisture, sand, clay } => soil(ghz, moisture, sand, clay),
            Dielectric::Vegetation { moisture } => vegetation(ghz, moisture),
        })
    }

    /// Warning for the user that a table is extrapolated at `frequency_hz`.
    pub(super) fn warning(&self, frequency_hz: f64) -> Option<String> {
        let Dielectric::Itu { material, extrapolate: true } = *self else { return None };
        let ([least, most], ghz) = (material.range_ghz(), frequency_hz / 1e9);
        let name = self.to_string();
        let outside = !(least..=most).contains(&ghz);
        outside.then(|| format!("{name} holds from {least} to {most} GHz and is extrapolated to {ghz} GHz"))
    }

    pub(super) fn check(&self, key: &str, bounds: &mut Bounds) -> Result<()> {
        let mut within = |name: &str, value: f64, [least, most]: [f64; 2]| {
            bounds.within(format_args!("{key}.{name}"), value, least, most)
        };
        match *self {
            Dielectric::Itu { .. } | Dielectric::Metal | Dielectric::Skin => Ok(()),
            Dielectric::Permittivity { eps, loss, conductivity_s_m } => {
                within("eps", eps, [1.0, 1e3])?;
                within("loss", loss, [0.0, 1e3])?;
                within("conductivity_s_m", conductivity_s_m, [0.0, 1e9])
            }
            Dielectric::Water { temperature_c, salinity_g_kg } => {
                within("temperature_c", temperature_c, [-5.0, 50.0])?;
                within("salinity_g_kg", salinity_g_kg, [0.0, 40.0])
            }
            Dielectric::Ground { moisture, sand, clay } => {
                within("moisture", moisture, [0.001, 0.6])?;
                within("sand", sand, [0.0, 100.0])?;
                within("clay", clay, [0.0, 100.0 - sand])
            }
            Dielectric::Vegetation { moisture } => within("moisture", moisture, [0.0, 0.7]),
        }
    }

    /// The law called `word`, with the keys of `section`; `None`: there is no such law.
    pub(super) fn read<E: serde::de::Error>(word: &str, section: Section) -> Result<Option<Dielectric>, E> {
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Building {
            material: ItuMaterial,
            #[serde(default)]
            extrapolate: bool,
        }
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct ConstantPermittivity {
            eps: f64,
            #[serde(default)]
            loss: f64,
            #[serde(default)]
            conductivity_s_m: f64,
        }
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields, default)]
        struct Liquid {
            temperature_c: f64,
            salinity_g_kg: f64,
        }
        impl Default for Liquid {
            fn default() -> Liquid {
                Liquid { temperature_c: 20.0, salinity_g_kg: 0.0 }
            }
        }
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Soil {
            moisture: f64,
            #[serde(default = "sandy_loam_sand")]
            sand: f64,
            #[serde(default = "sandy_loam_clay")]
            clay: f64,
        }
        fn sandy_loam_sand() -> f64 {
            51.52
        }
        fn sandy_loam_clay() -> f64 {
            13.43
        }
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Leaf {
            #[serde(default = "fresh_leaf")]
            moisture: f64,
        }
        fn fresh_leaf() -> f64 {
            0.6
        }
        Ok(Some(match word {
            "itu" => {
                let Building { material, extrapolate } = section.read()?;
                Dielectric::Itu { material, extrapolate }
            }
            "permittivity" => {
                let ConstantPermittivity { eps, loss, conductivity_s_m } = section.read()?;
                Dielectric::Permittivity { eps, loss, conductivity_s_m }
            }
            "metal" => {
                section.end()?;
                Dielectric::Metal
            }
            "skin" => {
                section.end()?;
                Dielectric::Skin
            }
            "water" => {
                let Liquid { temperature_c, salinity_g_kg } = section.read()?;
                Dielectric::Water { temperature_c, salinity_g_kg }
            }
            "ground" => {
                let Soil { moisture, sand, clay } = section.read()?;
                Dielectric::Ground { moisture, sand, clay }
            }
            "vegetation" => {
                let Leaf { moisture } = section.read()?;
                Dielectric::Vegetation { moisture }
            }
            _ => return Ok(None),
        }))
    }
}

impl<'de> Deserialize<'de> for Dielectric {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let (word, section) = yaml::split_tag(deserializer, "law")?;
        let found = Dielectric::read(&word, section)?;
        found.ok_or_else(|| D::Error::custom(format!("law: {}", D::Error::unknown_variant(&word, &LAWS))))
    }
}

impl std::fmt::Display for Dielectric {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        match *self {
            Dielectric::Itu { material, .. } => {
                let name = format!("{material:?}");
                for (at, letter) in name.char_indices() {
                    if at > 0 && letter.is_uppercase() {
                        f.write_str(" ")?;
                    }
                    write!(f, "{}", letter.to_ascii_lowercase())?;
                }
                f.write_str(" of ITU-R P.2040")
            }
            Dielectric::Permittivity { eps, loss, conductivity_s_m } => {
                write!(f, "permittivity {eps} - j {loss}")?;
                if conductivity_s_m > 0.0 { write!(f, ", {conductivity_s_m} S/m") } else { Ok(()) }
            }
            Dielectric::Metal => f.write_str("metal"),
            Dielectric::Skin => f.write_str("skin"),
            Dielectric::Water { temperature_c, salinity_g_kg: 0.0 } => write!(f, "water of {temperature_c} C"),
            Dielectric::Water { temperature_c, salinity_g_kg } => {
                write!(f, "water of {temperature_c} C and {salinity_g_kg} g/kg of salt")
            }
            Dielectric::Ground { moisture, .. } => write!(f, "ground with {} % of water", 100.0 * moisture),
            Dielectric::Vegetation { moisture } => write!(f, "leaf with {} % of water", 100.0 * moisture),
        }
    }
}

/// Two terms of Cole and Cole, `eps_inf + sum Delta / (1 + (j omega tau)^(1 - alpha)) + sigma / (j omega eps_0)`: dry
/// skin in the table of Gabriel, Lau and Gabriel 1996; its third and fourth term are 0.
fn skin(ghz: f64) -> Complex64 {
    /// `Delta`, `tau` in ns, `alpha`.
    const TERMS: [[f64; 3]; 2] = [[32.0, 7.23e-3, 0.0], [1100.0, 32.48, 0.2]];
    let omega = 4.0 * FRAC_PI_2 * ghz;
    let mut eps = Complex64::new(4.0, -LOSS_PER_CONDUCTIVITY * 2e-4 / ghz);
    for [delta, tau, alpha] in TERMS {
        let (size, angle) = ((omega * tau).powf(1.0 - alpha), FRAC_PI_2 * (1.0 - alpha));
        eps += delta / Complex64::new(1.0 + size * angle.cos(), size * angle.sin());
    }
    eps
}

/// Pure water by ITU-R P.840-9, eq. 4 to 10, with theta = 300 / T. For sea water its parameters and conductivity are
/// changed as in ITU-R P.527-6, eq. 14 to 27 (Meissner and Wentz 2004 and 2012), whose cubic term in eq. 18 is negative:
/// P.527-6 prints the sign of the uncorrected paper.
fn water(ghz: f64, temperature_c: f64, salinity_g_kg: f64) -> Complex64 {
    let (t, s) = (temperature_c, salinity_g_kg);
    let warmth = 300.0 / (t + 273.15) - 1.0;
    let mut first = 77.66 + 103.3 * warmth;
    let mut second = 0.0671 * first;
    let mut last = 3.52;
    let mut slow_ghz = 20.20 - 146.0 * warmth + 316.0 * warmth * warmth;
    let mut fast_ghz = 39.8 * slow_ghz;
    let mut conductivity = 0.0;
    if s > 0.0 {
        first *= (-3.333_30e-3 * s + 4.748_68e-6 * s * s).exp();
        second *= (-6.289_08e-3 * s + 1.760_32e-4 * s * s - 9.221_44e-5 * t * s).exp();
        last *= 1.0 + s * (-2.042_65e-3 + 1.578_83e-4 * t);
        let cubic = 2.3232e-3 + t * (-7.9208e-5 + t * (3.6764e-6 + t * (-3.5594e-7 + t * 8.9795e-9)));
        slow_ghz *= 1.0 + s * cubic;
        fast_ghz *= 1.0 + s * (-1.997_23e-2 + 1.811_76e-4 * t);
        let at_35 = 2.903_602 + t * (8.607e-2 + t * (4.738_817e-4 + t * (-2.991e-6 + t * 4.3047e-9)));
        let at_15_c = s * (37.5109 + 5.45216 * s + 1.4409e-2 * s * s) / (1004.75 + 182.283 * s + s * s);
        let slope = (6.9431 + 3.2841 * s - 9.9486e-2 * s * s) / (84.850 + 69.024 * s + s * s);
        let warmed = 1.0 + slope * (t - 15.0) / (49.843 - 0.2276 * s + 0.198e-2 * s * s + t);
        conductivity = at_35 * at_15_c * warmed;
    }
    let debye = |height: f64, relaxation_ghz: f64| height / Complex64::new(1.0, ghz / relaxation_ghz);
    let conducting = Complex64::new(0.0, LOSS_PER_CONDUCTIVITY * conductivity / ghz);
    debye(first - second, slow_ghz) + debye(second - last, fast_ghz) + last - conducting
}

/// ITU-R P.527-6, eq. 57 to 70, at 20 degrees C, with grains of 2.66 g/cm^3.
fn soil(ghz: f64, moisture: f64, sand: f64, clay: f64) -> Complex64 {
    const GRAIN_G_CM3: f64 = 2.66;
    let parts = [(sand, 0.078_886), (clay, 0.038_753), (100.0 - sand - clay, 0.032_732)];
    // Constituents of less than 1 % are left out; the others make 100 %.
    let all: f64 = parts.iter().map(|(part, _)| part).filter(|part| **part >= 1.0).sum();
    let packed = |&(part, slope): &(f64, f64)| if part >= 1.0 { slope * (100.0 * part / all).ln() } else { 0.0 };
    let bulk = 1.072_56 + parts.iter().map(packed).sum::<f64>();
    let low = 0.0467 + 0.2204 * bulk - 0.004_111 * sand - 0.006_614 * clay;
    let high = -1.645 + 1.939 * bulk - 0.022_562_2 * sand + 0.015_94 * clay;
    let turn = (ghz / 1.35).powi(2);
    let effective = Complex64::new(ghz / 1.35 * (low - high) / (1.0 + turn), -(high + (low - high) / (1.0 + turn)));
    let free = water(ghz, OUTDOORS_C, 0.0) + 18.0 * (GRAIN_G_CM3 - bulk) / (ghz * GRAIN_G_CM3 * moisture) * effective;
    let [real, loss] = [free.re.max(1.0), (-free.im).max(0.0)];
    const ALPHA: f64 = 0.65;
    let grains = (1.01 + 0.44 * GRAIN_G_CM3).powi(2) - 0.062;
    let with_real = moisture.powf(1.2748 - 0.005_19 * sand - 0.001_52 * clay) * real.powf(ALPHA);
    let with_loss = moisture.powf(1.337_97 - 0.006_03 * sand - 0.001_66 * clay) * loss.powf(ALPHA);
    let eps = (1.0 + bulk / GRAIN_G_CM3 * (grains.powf(ALPHA) - 1.0) + with_real - moisture).powf(1.0 / ALPHA);
    Complex64::new(eps.max(1.0), -with_loss.powf(1.0 / ALPHA))
}

/// ITU-R P.527-6, eq. 71 to 77 (after Ulaby and El-Rayes 1987): dry matter, free water and bound water.
fn vegetation(ghz: f64, moisture: f64) -> Complex64 {
    let m = moisture;
    let dry = 1.7 - 0.74 * m + 6.16 * m * m;
    let free = (m * (0.55 * m - 0.076)).max(0.0);
    let bound = 4.64 * m * m / (1.0 + 7.36 * m * m);
    // Bound water is a term of Cole and Cole that relaxes at a hundredth of free water's frequency at 20 degrees C.
    let warmth = 300.0 / (OUTDOORS_C + 273.15) - 1.0;
    let relaxation_ghz = 20.20 - 146.0 * warmth + 316.0 * warmth * warmth;
    let root = (ghz / (0.02 * relaxation_ghz)).sqrt();
    let below = 1.0 + 2.0 * root + ghz / (0.01 * relaxation_ghz);
    let pure = water(ghz, OUTDOORS_C, 0.0);
    let real = dry + free * pure.re + bound * (2.9 + 55.0 * (1.0 + root) / below);
    let loss = free * (-pure.im + 22.86 / ghz) + bound * 55.0 * root / below;
    Complex64::new(real, -loss)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(found: Complex64, real: f64, loss: f64, digits: f64) {
        let off = [(found.re / real - 1.0).abs(), (-found.im / loss - 1.0).abs()];
        assert!(off[0] < digits && off[1] < digits, "{found}, not {real} - j {loss}");
    }

    /// Values computed with numpy from the papers' formulas; of skin, 36.413 S/m at 60 GHz.
    #[test]
    fn skin_and_water_follow_their_papers() {
        for (ghz, real, loss) in [(24.125, 18.9175, 17.0960), (60.0, 7.979_00, 10.9087), (77.0, 6.567_33, 8.916_84)] {
            near(skin(ghz), real, loss, 1e-5);
        }
        assert!((-skin(60.0).im * 60.0 / LOSS_PER_CONDUCTIVITY / 36.413 - 1.0).abs() < 5e-4);
        for (ghz, real, loss) in [(24.125, 30.0800, 35.2124), (60.0, 10.8860, 19.7175), (77.0, 8.805_91, 15.9018)] {
            near(water(ghz, 20.0, 0.0), real, loss, 5e-6);
        }
    }

    /// The ocean at 15 degrees C conducts 4.2914 S/m (PSS-78); at low frequencies that is all of its loss.
    #[test]
    fn sea_water_conducts() {
        let salt = water(0.01, 15.0, 35.0);
        assert!((-salt.im * 0.01 / LOSS_PER_CONDUCTIVITY / 4.2914 - 1.0).abs() < 2e-3, "{salt}");
        // Ions hold water molecules: salt lowers the static permittivity, by a tenth in the ocean (Stogryn 1971: 71 to 72).
        assert!((70.0..75.0).contains(&salt.re), "{salt}");
        assert!(water(77.0, 20.0, 35.0).re > 1.0);
    }

    /// The polynomial that Hallikainen et al. 1985, IEEE Trans. Geosci. Remote Sens. 23, 25, fitted to their measurements at
    /// 1.4 GHz: `eps'` of sandy loam.
    #[test]
    fn soil_takes_up_water() {
        let [sand, clay] = [51.52, 13.43];
        let slope = 3.803 + 0.462 * sand - 0.341 * clay;
        let bend = 119.006 - 0.500 * sand + 0.633 * clay;
        for moisture in [0.07, 0.1, 0.2, 0.3] {
            let measured = 2.862 - 0.012 * sand + 0.001 * clay + slope * moisture + bend * moisture * moisture;
            let found = soil(1.4, moisture, sand, clay);
            assert!((found.re - measured).abs() < 2.0, "{moisture}: {found}, not {measured}");
        }
        let mut before = 0.0;
        for step in 1..60 {
            let found = soil(77.0, 0.01 * f64::from(step), 51.52, 13.43);
            assert!(found.re > before && found.im <= 0.0, "{step}: {found}");
            before = found.re;
        }
        // Soil of sand alone has two constituents of less than 1 %.
        assert!(soil(10.0, 0.1, 100.0, 0.0).re > 2.0);
    }

    /// Ulaby and El-Rayes 1987, IEEE Trans. Geosci. Remote Sens. 25, 550, eq. 1 at 22 degrees C: water with one relaxation,
    /// 18 GHz, and salt of 1.27 S/m, bound water with 0.18 GHz.
    #[test]
    fn leaves_are_wet() {
        for (ghz, moisture) in [(1.0, 0.3), (9.4, 0.6), (20.0, 0.68)] {
            let [free, bound] = [moisture * (0.55 * moisture - 0.076), 4.64 * moisture * moisture];
            let bound = bound / (1.0 + 7.36 * moisture * moisture);
            let water = 4.9 + 75.0 / Complex64::new(1.0, ghz / 18.0) - Complex64::new(0.0, 18.0 * 1.27 / ghz);
            let held = 2.9 + 55.0 / (1.0 + Complex64::new(0.0, ghz / 0.18).sqrt());
            let paper = 1.7 - 0.74 * moisture + 6.16 * moisture * moisture + free * water + bound * held;
            near(vegetation(ghz, moisture), paper.re, -paper.im, 0.06);
        }
        assert!(vegetation(77.0, 0.0).re < 2.0);
    }

    #[test]
    fn no_law_gains_energy_or_is_thinner_than_air() {
        let mut all: Vec<Dielectric> =
            ItuMaterial::ALL.map(|material| Dielectric::Itu { material, extrapolate: true }).into();
        all.extend([Dielectric::Metal, Dielectric::Skin]);
        for [temperature_c, salinity_g_kg] in [[-5.0, 0.0], [-5.0, 40.0], [50.0, 0.0], [50.0, 40.0], [20.0, 35.0]] {
            all.push(Dielectric::Water { temperature_c, salinity_g_kg });
        }
        for [moisture, sand, clay] in [[0.001, 100.0, 0.0], [0.6, 0.0, 100.0], [0.3, 50.0, 10.0], [0.001, 0.0, 0.0]] {
            all.push(Dielectric::Ground { moisture, sand, clay });
        }
        all.extend([0.0, 0.1, 0.7].map(|moisture| Dielectric::Vegetation { moisture }));
        for law in all {
            for ghz in [1.0, 9.4, 24.125, 60.0, 77.0, 100.0, 300.0] {
                let found = law.permittivity(ghz * 1e9).unwrap();
                assert!(found.re >= 1.0 && found.im <= 0.0 && found.norm() < 1e9, "{law:?} {ghz} GHz: {found}");
            }
        }
    }

    #[test]
    fn tables_end() {
        let brick = |extrapolate| Dielectric::Itu { material: ItuMaterial::Brick, extrapolate };
        let error = brick(false).permittivity(77e9).unwrap_err().to_string();
        assert_eq!(error, "radar.material is used at 77 GHz; allowed: 1 to 40 GHz, or extrapolate: true");
        assert!(brick(true).permittivity(77e9).is_ok() && brick(false).permittivity(24e9).is_ok());
        let warned = "brick of ITU-R P.2040 holds from 1 to 40 GHz and is extrapolated to 77 GHz";
        assert_eq!(brick(true).warning(77e9).unwrap(), warned);
        assert_eq!((brick(true).warning(24e9), Dielectric::Skin.warning(77e9)), (None, None));
    }
}
