//! How surfaces scatter sound.

use ground::error::{Error, Result};
use ground::read::yaml;
use serde::{Deserialize, Deserializer};
use std::f64::consts::PI;
use std::sync::LazyLock;

/// How a surface scatters and reflects sound under water: the section `sound` of a material, distinguished by `law`.
///
/// Backscatter is a cross-section per area and solid angle, 1/sr; in decibels that is the surface's scattering
/// strength. Angles are grazing angles, between wave and surface.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Sound {
    /// Lambert's law, `mu sin^2(g)`: a rough surface without layers below.
    Lambert {
        /// `10 log mu`, dB, -100 to -4.9715, at which everything is scattered; -27 for the deep sea (Mackenzie 1961),
        /// -15 for sand, -8 for rock.
        mu_db: f64,
    },
    /// Lambert's law plus specular facets with normally distributed slopes, which glint at normal incidence
    /// (high-frequency Kirchhoff): `mu sin^2(g) + R / (8 pi s^2 sin^4(g)) exp(-1 / (2 s^2 tan^2(g)))`.
    ///
    /// Without slopes the surface is smooth: objects of up to 450 wavelengths scatter by physical optics (Kirchhoff's
    /// integral over the insonified surface, in phase, over up to three facets), as plates, corners, spheres and
    /// cylinders do; larger ones scatter as if their facets had slopes of [`Sound::GLINT_DEG`], which leaves the level
    /// of a mirror's echo unchanged.
    Facet {
        /// As in `lambert`; defaults to -35.
        mu_db: f64,
        /// Standard deviation of the slope along any direction, as an angle in degrees, 0.1 to 45: `s` is its tangent;
        /// or 0, the default.
        slope_sigma_deg: f64,
        /// Loss of a facet at normal incidence, dB, 0 to 100: `R` is `10^(-loss / 10)`; defaults to 0.
        reflection_loss_db: f64,
    },
    /// Generic seabed backscatter (Lamarche and others 2011, Cont. Shelf Res. 31, S158), six numbers fitted to
    /// measurements: `A exp(-i^2 / (2 b^2)) + C cos^d(i) + E exp(-i^2 / (2 f^2))` at the incidence angle `i`.
    Gsab {
        /// `10 log A`, dB, -100 to 30: the lobe at normal incidence.
        a_db: f64,
        /// Width of that lobe, degrees, 0.1 to 90.
        b_deg: f64,
        /// `10 log C`, dB, -100 to 30.
        c_db: f64,
        /// Exponent, 0 to 20; 2 is Lambert's law.
        d: f64,
        /// `10 log E`, dB, -100 to 30: the lobe in between.
        e_db: f64,
        /// Width of that lobe, degrees, 0.1 to 90.
        f_deg: f64,
    },
    /// A type of seabed, by name.
    Sediment {
        /// The type.
        name: Sediment,
    },
    /// A small object that scatters as a whole, whatever its area: a fish, a float, a calibration sphere.
    Target {
        /// Target strength, dB re 1 m^2, -200 to 100.
        strength_db: f64,
    },
}

/// Types of seabed for which the library has a table: Jackson's small-slope model at 20, 100, 300 and 450 kHz.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Sediment {
    /// Rough rock.
    RoughRock,
    /// Rock.
    Rock,
    /// Cobble.
    Cobble,
    /// Sandy gravel.
    SandyGravel,
    /// Coarse sand.
    CoarseSand,
    /// Medium sand.
    MediumSand,
    /// Fine sand.
    FineSand,
    /// Silt.
    Silt,
}

impl Sediment {
    /// All of them, in the order of the table.
    pub const ALL: [Sediment; 8] = [
        Sediment::RoughRock,
        Sediment::Rock,
        Sediment::Cobble,
        Sediment::SandyGravel,
        Sediment::CoarseSand,
        Sediment::MediumSand,
        Sediment::FineSand,
        Sediment::Silt,
    ];
}

/// Reflection loss where a law does not give it, dB: between those of sand (7 to 13) and rock (3) at normal incidence.
/// Specular reflection matters where one echo takes several paths, and such laws are fitted to backscatter alone.
const UNKNOWN_LOSS_DB: f64 = 10.0;

impl Sound {
    /// Slope attributed to the facets of a smooth surface where rays meet it, degrees, so that rays find the glint
    /// wherever there is one. The total stays the same: the echo of a mirror is `R r^2 / 4` whatever the slope.
    pub const GLINT_DEG: f64 = 2.0;

    /// The law of a surface of which only the reflectance is known, 0 to 1: Lambert's with `mu` the reflectance over
    /// `pi`.
    pub fn of_reflectance(reflectance: f64) -> Sound {
        Sound::Lambert { mu_db: 10.0 * (reflectance / PI).log10() }
    }

    /// Backscattering cross-section, 1/sr, of a surface met at a grazing angle of sine `sin_grazing`, 0 to 1, by sound
    /// of `frequency_hz`. That of a target is 0: it has a [`Sound::target_strength_db`] instead.
    pub fn backscatter(&self, sin_grazing: f64, frequency_hz: f64) -> f64 {
        if sin_grazing <= 0.0 {
            return 0.0;
        }
        let sin = sin_grazing.min(1.0);
        let lambert = |mu_db: f64| power(mu_db) * sin * sin;
        match *self {
            Sound::Lambert { mu_db } => lambert(mu_db),
            Sound::Facet { mu_db, slope_sigma_deg, reflection_loss_db } => {
                let slope_deg = if slope_sigma_deg == 0.0 { Sound::GLINT_DEG } else { slope_sigma_deg };
                let (sin2, slope2) = (sin * sin, slope_deg.to_radians().tan().powi(2));
                let lobe = ((sin2 - 1.0) / (2.0 * slope2 * sin2)).exp();
                // Where sin^4 underflows the exponential has long been 0.
                let facets = if lobe > 0.0 { lobe / (8.0 * PI * slope2 * sin2 * sin2) } else { 0.0 };
                lambert(mu_db) + power(-reflection_loss_db) * facets
            }
            Sound::Gsab { a_db, b_deg, c_db, d, e_db, f_deg } => {
                let incidence = sin.acos().to_degrees();
                let bell = |db: f64, width: f64| power(db) * (-0.5 * (incidence / width).powi(2)).exp();
                bell(a_db, b_deg) + power(c_db) * sin.powf(d) + bell(e_db, f_deg)
            }
            Sound::Sediment { name } => power(sediments().backscatter_db(name, sin, frequency_hz)),
            Sound::Target { .. } => 0.0,
        }
    }

    /// Loss of a specular reflection, dB, 0 or more, by a surface met at a grazing angle of sine `sin_grazing`.
    /// Lambert's law and `gsab` do not give it, and 10 dB is used; a target reflects nothing specularly, so that its
    /// loss is infinite. The loss does not depend on the frequency in any of the laws.
    pub fn reflection_loss_db(&self, sin_grazing: f64) -> f64 {
        match *self {
            Sound::Lambert { .. } | Sound::Gsab { .. } => UNKNOWN_LOSS_DB,
            Sound::Facet { reflection_loss_db, .. } => reflection_loss_db,
            Sound::Sediment { name } => sediments().of(name).reflection_loss_db(sin_grazing),
            Sound::Target { .. } => f64::INFINITY,
        }
    }

    /// Target strength, dB re 1 m^2, of a small object that scatters as a whole.
    pub fn target_strength_db(&self) -> Option<f64> {
        match *self {
            Sound::Target { strength_db } => Some(strength_db),
            _ => None,
        }
    }

    /// Whether it is a smooth surface: facets without slopes.
    #[doc(hidden)]
    pub fn is_smooth(&self) -> bool {
        matches!(self, Sound::Facet { slope_sigma_deg: 0.0, .. })
    }

    /// Warning for the user about the validity of the law at `frequency_hz`.
    pub fn warning(&self, frequency_hz: f64) -> Option<String> {
        let [least, most] = [FREQUENCIES_HZ[0], FREQUENCIES_HZ[FREQUENCIES_HZ.len() - 1]];
        let outside = matches!(self, Sound::Sediment { .. }) && !(least..=most).contains(&frequency_hz);
        outside.then(|| {
            let (khz, least, most) = (frequency_hz / 1e3, least / 1e3, most / 1e3);
            let edge = if khz < least { least } else { most };
            format!(
                "sediments are tabulated from {least} to {most} kHz; at {khz} kHz the values at {edge} kHz are used"
            )
        })
    }

    /// Checks that all values are within their allowed ranges.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] that names the key, as in `sound.mu_db`.
    #[doc(hidden)]
    pub fn check(&self) -> Result<()> {
        let within = |key: &str, value: f64, [least, most]: [f64; 2]| {
            let invalid = || Error::invalid(format!("sound.{key}"), value, format!("{least} to {most}"));
            if (least..=most).contains(&value) { Ok(()) } else { Err(invalid()) }
        };
        // Lambert's law scatters pi mu of the incident energy, over all directions.
        let lambert = |mu_db: f64| within("mu_db", mu_db, [-100.0, -4.9715]);
        match *self {
            Sound::Lambert { mu_db } => lambert(mu_db),
            Sound::Facet { mu_db, slope_sigma_deg, reflection_loss_db } => {
                lambert(mu_db)?;
                if slope_sigma_deg != 0.0 && !(0.1..=45.0).contains(&slope_sigma_deg) {
                    return Err(Error::invalid("sound.slope_sigma_deg", slope_sigma_deg, "0 (smooth), or 0.1 to 45"));
                }
                within("reflection_loss_db", reflection_loss_db, [0.0, 100.0])
            }
            Sound::Gsab { a_db, b_deg, c_db, d, e_db, f_deg } => {
                for (key, db) in [("a_db", a_db), ("c_db", c_db), ("e_db", e_db)] {
                    within(key, db, [-100.0, 30.0])?;
                }
                within("b_deg", b_deg, [0.1, 90.0])?;
                within("d", d, [0.0, 20.0])?;
                within("f_deg", f_deg, [0.1, 90.0])
            }
            Sound::Sediment { .. } => Ok(()),
            Sound::Target { strength_db } => within("strength_db", strength_db, [-200.0, 100.0]),
        }
    }
}

/// Power ratio of `db` decibels.
fn power(db: f64) -> f64 {
    10f64.powf(db / 10.0)
}

/// Frequencies of the table, Hz.
const FREQUENCIES_HZ: [f64; 4] = [20e3, 100e3, 300e3, 450e3];

/// The table, in the order of [`Sediment`]; a test compares all of it with its source.
struct Sediments {
    rows: Vec<SedimentTable>,
    /// Logarithms of [`FREQUENCIES_HZ`].
    log_frequency: [f64; FREQUENCIES_HZ.len()],
}

/// The table's values for one sediment.
struct SedimentTable {
    /// Logarithm of each grazing angle in degrees, rising, and the sine of the first.
    log_angle: Vec<f64>,
    first_sine: f64,
    /// Backscatter, dB, at each of them by frequency.
    backscatter_db: Vec<[f64; FREQUENCIES_HZ.len()]>,
    /// Loss of a mirror image, dB.
    loss_db: Vec<f64>,
}

impl Sediments {
    fn of(&self, name: Sediment) -> &SedimentTable {
        &self.rows[name as usize]
    }

    /// Linear in decibels over the logarithms of angle and frequency: at small angles a power of the angle dominates.
    /// Outside the table's frequencies, the first or last is used; below the first angle, backscatter falls with the
    /// fourth power of the sine, continuing the table's last degrees.
    fn backscatter_db(&self, name: Sediment, sin: f64, frequency_hz: f64) -> f64 {
        let rows = self.of(name);
        let (row, t) = rows.place(sin);
        let known = &self.log_frequency;
        let frequency = frequency_hz.ln().clamp(known[0], known[known.len() - 1]);
        let column = known.partition_point(|&known| known <= frequency).clamp(1, known.len() - 1) - 1;
        let u = (frequency - known[column]) / (known[column + 1] - known[column]);
        let at = |row: usize| {
            let row = rows.backscatter_db[row];
            row[column] + (row[column + 1] - row[column]) * u
        };
        let below = 40.0 * (sin / rows.first_sine).min(1.0).log10();
        at(row) + (at(row + 1) - at(row)) * t + below
    }
}

impl SedimentTable {
    /// Row below a grazing angle, and the fraction of the way to the next.
    fn place(&self, sin: f64) -> (usize, f64) {
        let log = sin.clamp(0.0, 1.0).asin().to_degrees().ln();
        let row = self.log_angle.partition_point(|&angle| angle <= log).clamp(1, self.log_angle.len() - 1) - 1;
        let (low, high) = (self.log_angle[row], self.log_angle[row + 1]);
        (row, ((log - low) / (high - low)).clamp(0.0, 1.0))
    }

    /// Linear over the logarithm of the angle; constant below the first angle.
    fn reflection_loss_db(&self, sin: f64) -> f64 {
        let (row, t) = self.place(sin);
        self.loss_db[row] + (self.loss_db[row + 1] - self.loss_db[row]) * t
    }
}

/// The table, read once from the embedded file.
fn sediments() -> &'static Sediments {
    static SEDIMENTS: LazyLock<Sediments> = LazyLock::new(|| {
        let mut all: Vec<SedimentTable> = Vec::new();
        let mut last = "";
        let lines = include_str!("sediments.csv").lines().filter(|line| !line.starts_with('#')).skip(1);
        for line in lines {
            let (name, numbers) = line.split_once(',').unwrap_or_default();
            let numbers: Vec<f64> = numbers.split(',').filter_map(|number| number.parse().ok()).collect();
            let [angle, db @ .., loss] = &numbers[..] else { continue };
            if name != last {
                let first_sine = angle.to_radians().sin();
                let (log_angle, backscatter_db, loss_db) = (Vec::new(), Vec::new(), Vec::new());
                all.push(SedimentTable { log_angle, first_sine, backscatter_db, loss_db });
                last = name;
            }
            if let Some(rows) = all.last_mut() {
                rows.log_angle.push(angle.ln());
                rows.backscatter_db.push(db.try_into().expect("the table that is compiled in is sound"));
                rows.loss_db.push(*loss);
            }
        }
        Sediments { rows: all, log_frequency: FREQUENCIES_HZ.map(f64::ln) }
    });
    &SEDIMENTS
}

impl<'de> Deserialize<'de> for Sound {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Diffuse {
            mu_db: f64,
        }
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Facets {
            #[serde(default = "smooth_mu")]
            mu_db: f64,
            #[serde(default)]
            slope_sigma_deg: f64,
            #[serde(default)]
            reflection_loss_db: f64,
        }
        /// For a surface that is smooth except for scratches; our assumption.
        fn smooth_mu() -> f64 {
            -35.0
        }
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Fitted {
            a_db: f64,
            b_deg: f64,
            c_db: f64,
            d: f64,
            e_db: f64,
            f_deg: f64,
        }
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct SedimentName {
            name: Sediment,
        }
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct TargetStrength {
            strength_db: f64,
        }
        const LAWS: &[&str] = &["lambert", "facet", "gsab", "sediment", "target"];
        let (word, section) = yaml::split_tag(deserializer, "law")?;
        Ok(match word.as_str() {
            "lambert" => {
                let Diffuse { mu_db } = section.read()?;
                Sound::Lambert { mu_db }
            }
            "facet" => {
                let Facets { mu_db, slope_sigma_deg, reflection_loss_db } = section.read()?;
                Sound::Facet { mu_db, slope_sigma_deg, reflection_loss_db }
            }
            "gsab" => {
                let Fitted { a_db, b_deg, c_db, d, e_db, f_deg } = section.read()?;
                Sound::Gsab { a_db, b_deg, c_db, d, e_db, f_deg }
            }
            "sediment" => {
                let SedimentName { name } = section.read()?;
                Sound::Sediment { name }
            }
            "target" => {
                let TargetStrength { strength_db } = section.read()?;
                Sound::Target { strength_db }
            }
            _ => return Err(section.unknown(&word, LAWS)),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_PI_2, TAU};

    fn db(sound: &Sound, degrees: f64, frequency: f64) -> f64 {
        10.0 * sound.backscatter(degrees.to_radians().sin(), frequency).log10()
    }

    #[test]
    fn the_table_is_whole() {
        assert_eq!(sediments().rows.len(), Sediment::ALL.len());
        for rows in &sediments().rows {
            assert_eq!(rows.log_angle.len(), 22);
            assert!(rows.log_angle.is_sorted_by(|a, b| a < b));
            assert_eq!((rows.backscatter_db.len(), rows.loss_db.len()), (22, 22));
            assert!(rows.loss_db.iter().all(|&loss| loss >= 0.0));
        }
    }

    #[test]
    fn sediments_are_met_at_and_between_the_nodes() {
        let sand = Sound::Sediment { name: Sediment::MediumSand };
        // Rock scatters more than sand, sand more than silt.
        let at = |name| db(&Sound::Sediment { name }, 30.0, 100e3);
        assert!(at(Sediment::Rock) > at(Sediment::MediumSand) && at(Sediment::MediumSand) > at(Sediment::Silt));
        for (low, high) in [(20e3f64, 100e3f64), (100e3, 300e3), (300e3, 450e3)] {
            let middle = (low * high).sqrt();
            let mean = (db(&sand, 30.0, low) + db(&sand, 30.0, high)) / 2.0;
            assert!((db(&sand, 30.0, middle) - mean).abs() < 1e-9);
        }
        assert_eq!(db(&sand, 30.0, 1e3), db(&sand, 30.0, 20e3));
        assert_eq!(db(&sand, 30.0, 1e6), db(&sand, 30.0, 450e3));
        // The fourth power applies below a degree, without a step.
        assert!((db(&sand, 1.0, 1e5) - db(&sand, 0.5, 1e5) - 12.04).abs() < 0.01);
        assert!((db(&sand, 1.001, 1e5) - db(&sand, 0.999, 1e5)).abs() < 0.1);
        assert_eq!(sand.warning(100e3), None);
        let warned = "sediments are tabulated from 20 to 450 kHz; at 900 kHz the values at 450 kHz are used";
        assert_eq!(sand.warning(900e3).unwrap(), warned);
        assert_eq!(Sound::Lambert { mu_db: -27.0 }.warning(900e3), None);
    }

    /// The energy that Lambert's law scatters in all directions, `int mu sin(g) sin(g') / sin(g)` over the hemisphere,
    /// is at most the incident energy.
    #[test]
    fn lambert_keeps_energy() {
        for (sound, expected) in [
            (Sound::of_reflectance(1.0), 1.0),
            (Sound::of_reflectance(0.3), 0.3),
            (Sound::of_reflectance(0.0), 0.0),
            (Sound::Lambert { mu_db: -4.9715 }, 1.0),
        ] {
            // mu, which is the backscatter at normal incidence.
            let mu = sound.backscatter(1.0, 1e5);
            let steps = 2000;
            let width = FRAC_PI_2 / f64::from(steps);
            let sum: f64 = (0..steps)
                .map(|step| {
                    let (sin, cos) = ((f64::from(step) + 0.5) * width).sin_cos();
                    mu * sin * cos * width * TAU
                })
                .sum();
            assert!((sum - expected).abs() < 1e-5 && sum < 1.0 + 1e-6, "{sound:?}: {sum}");
        }
    }

    /// At normal incidence all level facets glint: `R / (8 pi s^2)`.
    #[test]
    fn facets_shine_head_on() {
        let facet = Sound::Facet { mu_db: -100.0, slope_sigma_deg: 5.0, reflection_loss_db: 6.0 };
        let slope2 = 5f64.to_radians().tan().powi(2);
        let expected = 10f64.powf(-0.6) / (8.0 * PI * slope2);
        assert!((facet.backscatter(1.0, 1e5) / expected - 1.0).abs() < 1e-9);
        assert!(db(&facet, 60.0, 1e5) < db(&facet, 90.0, 1e5) - 60.0);
        // Away from there only Lambert's law is left.
        let both = Sound::Facet { mu_db: -20.0, slope_sigma_deg: 5.0, reflection_loss_db: 6.0 };
        assert!((db(&both, 30.0, 1e5) - db(&Sound::Lambert { mu_db: -20.0 }, 30.0, 1e5)).abs() < 1e-9);
    }

    #[test]
    fn gsab_without_bells_is_lambert() {
        let plain = Sound::Gsab { a_db: -100.0, b_deg: 5.0, c_db: -20.0, d: 2.0, e_db: -100.0, f_deg: 20.0 };
        for degrees in [5.0, 30.0, 90.0] {
            assert!((db(&plain, degrees, 1e5) - db(&Sound::Lambert { mu_db: -20.0 }, degrees, 1e5)).abs() < 1e-5);
        }
        let full = Sound::Gsab { a_db: -10.0, b_deg: 5.0, c_db: -20.0, d: 2.0, e_db: -25.0, f_deg: 20.0 };
        let by_hand =
            0.1 * (-2f64).exp() + 0.01 * 80f64.to_radians().sin().powi(2) + 10f64.powf(-2.5) * (-0.125f64).exp();
        assert!((full.backscatter(80f64.to_radians().sin(), 1e5) / by_hand - 1.0).abs() < 1e-9);
    }

    #[test]
    fn nothing_is_negative_or_infinite() {
        let mut all: Vec<Sound> = Sediment::ALL.into_iter().map(|name| Sound::Sediment { name }).collect();
        all.extend([
            Sound::of_reflectance(0.0),
            Sound::Lambert { mu_db: -4.9715 },
            Sound::Facet { mu_db: -15.0, slope_sigma_deg: 0.1, reflection_loss_db: 0.0 },
            Sound::Facet { mu_db: -15.0, slope_sigma_deg: 45.0, reflection_loss_db: 10.0 },
            Sound::Gsab { a_db: 0.0, b_deg: 0.1, c_db: -15.0, d: 0.0, e_db: -20.0, f_deg: 90.0 },
            Sound::Target { strength_db: -30.0 },
        ]);
        for sound in &all {
            for frequency in [1.0, 20e3, 200e3, 450e3, 2e6] {
                for sin in (0..=1000).map(|step| f64::from(step) / 1000.0).chain([1e-300, -0.0, -1.0, 1.0 + 1e-12]) {
                    let found = sound.backscatter(sin, frequency);
                    assert!(found >= 0.0 && found.is_finite(), "{sound:?} {sin}: {found}");
                    assert!(sound.reflection_loss_db(sin) >= 0.0);
                }
            }
        }
    }

    #[test]
    fn mirror_images_lose() {
        let sand = Sound::Sediment { name: Sediment::MediumSand };
        assert!((sand.reflection_loss_db(1.0) - 8.6391).abs() < 1e-9);
        assert!(sand.reflection_loss_db(0.1) < 3.0);
        assert_eq!(Sound::Lambert { mu_db: -20.0 }.reflection_loss_db(0.5), 10.0);
        let facet = Sound::Facet { mu_db: -20.0, slope_sigma_deg: 5.0, reflection_loss_db: 6.0 };
        assert_eq!(facet.reflection_loss_db(0.5), 6.0);
        let target = Sound::Target { strength_db: -42.0 };
        assert_eq!((target.target_strength_db(), sand.target_strength_db()), (Some(-42.0), None));
        assert_eq!(target.reflection_loss_db(0.5), f64::INFINITY);
    }
}
