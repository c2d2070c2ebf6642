//! What rain, fog and snow do to the waves of radars.

use super::mie;
use super::{Particles, Rain, Snow};
use model::material::Dielectric;
use num_complex::Complex64;
use std::f64::consts::PI;

/// Speed of light in vacuum, m/s (exact in the SI).
const LIGHT_M_S: f64 = 299_792_458.0;

/// Attenuation by rain of `rate_mm_h`, dB/km one way: `k R^alpha` with the fits of ITU-R P.838-3, eq. 2 to 5, from 1 to 1000
/// GHz, for a level path. `tilt_deg`: of the electric field from the horizontal, 0 (H) to 90 (V); 45 for circular
/// polarisation.
pub(in crate::medium) fn rain_db_km(rate_mm_h: f64, ghz: f64, tilt_deg: f64) -> f64 {
    let [k, alpha] = rain_coefficients(ghz, tilt_deg);
    k * rate_mm_h.powf(alpha)
}

/// `k` and `alpha` of [`rain_db_km`].
fn rain_coefficients(ghz: f64, tilt_deg: f64) -> [f64; 2] {
    /// `a`, `b`, `c` of the bells in the logarithm of the frequency; then its slope and a constant: tables 1 to 4.
    type Fit = (&'static [[f64; 3]], [f64; 2]);
    const K_H: Fit = (
        &[
            [-5.339_80, -0.100_08, 1.130_98],
            [-0.353_51, 1.269_70, 0.454_00],
            [-0.237_89, 0.860_36, 0.153_54],
            [-0.941_58, 0.645_52, 0.168_17],
        ],
        [-0.189_61, 0.711_47],
    );
    const K_V: Fit = (
        &[
            [-3.805_95, 0.569_34, 0.810_61],
            [-3.449_65, -0.229_11, 0.510_59],
            [-0.399_02, 0.730_42, 0.118_99],
            [0.501_67, 1.073_19, 0.271_95],
        ],
        [-0.163_98, 0.632_97],
    );
    const ALPHA_H: Fit = (
        &[
            [-0.143_18, 1.824_42, -0.551_87],
            [0.295_91, 0.775_64, 0.198_22],
            [0.321_77, 0.637_73, 0.131_64],
            [-5.376_10, -0.962_30, 1.478_28],
            [16.1721, -3.299_80, 3.439_90],
        ],
        [0.678_49, -1.955_37],
    );
    const ALPHA_V: Fit = (
        &[
            [-0.077_71, 2.338_40, -0.762_84],
            [0.567_27, 0.955_45, 0.540_39],
            [-0.202_38, 1.145_20, 0.268_09],
            [-48.2991, 0.791_669, 0.116_226],
            [48.5833, 0.791_459, 0.116_479],
        ],
        [-0.053_739, 0.834_33],
    );
    let log = ghz.log10();
    let fit = |(bells, [slope, constant]): Fit| {
        let bell = |&[a, b, c]: &[f64; 3]| a * (-((log - b) / c).powi(2)).exp();
        bells.iter().map(bell).sum::<f64>() + slope * log + constant
    };
    let [k_h, k_v] = [10f64.powf(fit(K_H)), 10f64.powf(fit(K_V))];
    let [alpha_h, alpha_v] = [fit(ALPHA_H), fit(ALPHA_V)];
    let level = (2.0 * tilt_deg.to_radians()).cos();
    let k = (k_h + k_v + (k_h - k_v) * level) / 2.0;
    [k, (k_h * alpha_h + k_v * alpha_v + (k_h * alpha_h - k_v * alpha_v) * level) / (2.0 * k)]
}

/// Attenuation by fog and spray, dB/km one way for a gram of water per cubic metre in droplets much smaller than the
/// wavelength: ITU-R P.840-9, eq. 2 and 3, `0.819 f / (eps'' (1 + ((2 + eps') / eps'')^2))`, at 10 degrees C.
pub(in crate::medium) fn droplets_db_km(ghz: f64) -> f64 {
    let eps = water(ghz, 10.0);
    let loss = -eps.im;
    0.819 * ghz / (loss * (1.0 + ((2.0 + eps.re) / loss).powi(2)))
}

/// Drops or flakes that return echoes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Precipitation {
    /// Radar cross-section of a cubic metre, m^2/m^3.
    pub eta_m2_per_m3: f64,
    /// Mean speed at which they fall, weighted by what they return, m/s.
    pub fall_m_s: f64,
    /// Standard deviation of that speed, m/s. Turbulence comes on top: 1 to 2 m/s.
    pub fall_spread_m_s: f64,
}

/// What spheres of rain or snow take and return.
#[derive(Clone, Copy, Debug)]
pub(in crate::medium) struct Scattered {
    /// Attenuation, dB/km one way.
    pub attenuation_db_km: f64,
    pub echoes: Precipitation,
}

/// Drops of Marshall and Palmer of 0.05 to 7 mm, spheres of water of 20 degrees C by Mie's theory, which fall with
/// `9.65 - 10.3 exp(-0.6 D)` m/s, D in mm (Atlas, Srivastava and Sekhon 1973, Rev. Geophys. 11, 1, eq. 1). Their attenuation
/// at 77 GHz is a fifth above that of P.838-3, whose distribution has fewer small drops: scans use P.838's.
pub(in crate::medium) fn rain_echoes(rain: &Rain, ghz: f64) -> Option<Scattered> {
    let index = refraction(water(ghz, 20.0));
    let fall = |mm: f64| (9.65 - 10.3 * (-0.6 * mm).exp()).max(0.0);
    rain.drop_sizes().map(|drops| summed(&drops, [0.05, 7.0], ghz, index, fall))
}

/// Flakes whose drops would have up to 7 mm, spheres of ice and air by Mie's theory, which fall with 1 m/s, give or take
/// 0.2 (unrimed aggregates of 1 to 10 mm: Locatelli and Hobbs 1974, J. Geophys. Res. 79, 2185). Of a dry flake: what melts
/// attenuates as rain does.
pub(in crate::medium) fn snow_echoes(snow: &Snow, ghz: f64) -> Option<Scattered> {
    // Ice at 0 degrees C: ITU-R P.527-6, eq. 28 to 34; its loss grows with the frequency. Mixed with air by the formula of
    // Clausius and Mossotti.
    let ice = Complex64::new(3.1884, -9.17e-5 * ghz);
    let dense = snow.density_kg_m3 / 917.0 * (ice - 1.0) / (ice + 2.0);
    let index = refraction((1.0 + 2.0 * dense) / (1.0 - dense));
    let growth = snow.growth();
    let mut found = summed(&snow.flake_sizes()?, [0.05 * growth, 7.0 * growth], ghz, index, |_| 1.0);
    found.echoes.fall_spread_m_s = 0.2;
    Some(found)
}

/// Permittivity of water.
fn water(ghz: f64, temperature_c: f64) -> Complex64 {
    let water = Dielectric::Water { temperature_c, salinity_g_kg: 0.0 };
    water.permittivity(ghz * 1e9).expect("water has no range of frequencies")
}

/// Index of refraction `n + j k`, for waves that vary as `exp(-j omega t)`, as Mie's series here has it.
fn refraction(eps: Complex64) -> Complex64 {
    eps.conj().sqrt()
}

/// Cross-sections of particles of diameters `from` to `to`, mm, by Simpson's rule; `fall` is their speed, m/s.
fn summed(sizes: &Particles, [from, to]: [f64; 2], ghz: f64, index: Complex64, fall: impl Fn(f64) -> f64) -> Scattered {
    const STEPS: usize = 1400;
    let wavelength_nm = LIGHT_M_S / ghz;
    let width = (to - from) / STEPS as f64;
    let (mut extinction, mut returned, mut logs) = (0.0, [0.0; 3], Vec::new());
    for step in 0..=STEPS {
        let mm = from + width * step as f64;
        let weight = width / 3.0 * if step == 0 || step == STEPS { 1.0 } else { 2.0 + 2.0 * (step % 2) as f64 };
        let count = weight * sizes.per_m3_mm * (-sizes.slope_per_mm * mm).exp();
        let area = count * PI * (mm / 2e3).powi(2);
        let of = mie::sphere(mie::size(mm / 2e3, wavelength_nm), index, &mut logs);
        extinction += area * of.extinction;
        let speed = fall(mm);
        for (power, sum) in returned.iter_mut().enumerate() {
            *sum += area * of.backscatter * speed.powi(power as i32);
        }
    }
    let [eta, mean, square] = returned;
    let (fall_m_s, square) = if eta > 0.0 { (mean / eta, square / eta) } else { (0.0, 0.0) };
    let fall_spread_m_s = (square - fall_m_s * fall_m_s).max(0.0).sqrt();
    let attenuation_db_km = extinction * 1e3 * 10.0 / std::f64::consts::LN_10;
    Scattered { attenuation_db_km, echoes: Precipitation { eta_m2_per_m3: eta, fall_m_s, fall_spread_m_s } }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Computed with numpy from the fits of ITU-R P.838-3.
    #[test]
    fn rain_attenuates_as_the_itu_fits_it() {
        for (ghz, k_h, alpha_h, k_v, alpha_v, rates) in [
            (9.4, 0.009_253_97, 1.290_11, 0.008_360_14, 1.257_42, [0.073_803, 0.180_48, 0.588_61, 1.4394, 3.5201]),
            (24.125, 0.144_280, 1.008_72, 0.142_002, 0.955_221, [0.7316, 1.4721, 3.7097, 7.4644, 15.019]),
            (60.0, 0.860_613, 0.765_632, 0.851_520, 0.748_565, [2.951, 5.017, 10.118, 17.203, 29.246]),
            (77.0, 1.131_97, 0.717_681, 1.127_62, 0.707_295, [3.5931, 5.909, 11.405, 18.757, 30.846]),
            (79.0, 1.157_91, 0.713_496, 1.154_06, 0.703_764, [3.6508, 5.9865, 11.511, 18.875, 30.951]),
        ] {
            let near = |found: f64, expected: f64, digits: f64| {
                assert!((found / expected - 1.0).abs() < digits, "{ghz} GHz: {found}, not {expected}");
            };
            let [h, v] = [0.0, 90.0].map(|tilt| rain_coefficients(ghz, tilt));
            for (found, expected) in h.into_iter().chain(v).zip([k_h, alpha_h, k_v, alpha_v]) {
                near(found, expected, 5e-6);
            }
            for (rate, expected) in [5.0, 10.0, 25.0, 50.0, 100.0].into_iter().zip(rates) {
                near(rain_db_km(rate, ghz, 0.0), expected, 1e-4);
            }
            let slanted = rain_coefficients(ghz, 45.0)[0];
            near(slanted, (k_h + k_v) / 2.0, 5e-6);
        }
        assert_eq!(rain_db_km(0.0, 77.0, 0.0), 0.0);
    }

    /// Computed with numpy and Mie's series of scipy's Bessel functions: Marshall and Palmer, 0.05 to 7 mm, 20 degrees C.
    #[test]
    fn rain_returns_as_computed_elsewhere() {
        for (ghz, expected) in [
            (24.125, [5.152_26e-5, 4.277_25e-4, 9.572_75e-4]),
            (60.0, [3.889_37e-4, 1.346_76e-3, 2.135_14e-3]),
            (77.0, [4.349_54e-4, 1.270_74e-3, 1.914_72e-3]),
        ] {
            for (rate, expected) in [5.0, 25.0, 50.0].into_iter().zip(expected) {
                let found = rain_echoes(&Rain::new(rate), ghz).unwrap();
                let eta = found.echoes.eta_m2_per_m3;
                assert!((eta / expected - 1.0).abs() < 1e-5, "{ghz} GHz, {rate} mm/h: {eta}, not {expected}");
            }
        }
        for (rate, db_km) in [(5.0, 4.25), (25.0, 14.4), (50.0, 23.5)] {
            let found = rain_echoes(&Rain::new(rate), 77.0).unwrap().attenuation_db_km;
            assert!((found / db_km - 1.0).abs() < 4e-3, "{rate} mm/h: {found}");
        }
        assert!(rain_echoes(&Rain::new(0.0), 77.0).is_none());
    }

    /// In the limit of long waves drops return `pi^5 |K|^2 Z / lambda^4` with `Z = int N D^6 = 720 N0 / Lambda^7` (Rayleigh), and
    /// the speed weighted by D^6 follows from the same integrals.
    #[test]
    fn long_waves_see_the_sixth_power_of_diameters() {
        let (rate, ghz) = (1.0, 1.0);
        let found = rain_echoes(&Rain::new(rate), ghz).unwrap().echoes;
        let eps = water(ghz, 20.0);
        let polarity = ((eps - 1.0) / (eps + 2.0)).norm_sqr();
        let lambda = LIGHT_M_S / (ghz * 1e9);
        let z = 720.0 * 8000.0 / 4.1f64.powi(7) * 1e-18;
        let eta = PI.powi(5) * polarity * z / lambda.powi(4);
        assert!((found.eta_m2_per_m3 / eta - 1.0).abs() < 0.01, "{found:?} {eta}");
        let slower = |rate: f64| 10.3 * (4.1 / (4.1 + rate)).powi(7);
        let (mean, square) = (9.65 - slower(0.6), 9.65 * 9.65 - 2.0 * 9.65 * slower(0.6) + 10.3 * slower(1.2));
        assert!((found.fall_m_s / mean - 1.0).abs() < 0.01, "{found:?} {mean}");
        assert!((found.fall_spread_m_s - (square - mean * mean).sqrt()).abs() < 0.05, "{found:?}");
    }

    /// Droplets of Rayleigh's size absorb `6 pi / lambda Im((eps - 1) / (eps + 2))` of their volume; P.840 gives less than 2
    /// dB/km at 77 GHz where one sees 50 m, in 0.5 g/m^3.
    #[test]
    fn fog_hides_little() {
        assert!((1.0..2.0).contains(&(0.5 * droplets_db_km(77.0))), "{}", droplets_db_km(77.0));
        for ghz in [24.125, 77.0] {
            let eps = water(ghz, 10.0);
            let per_m = 6.0 * PI * ghz * 1e9 / LIGHT_M_S * -((eps - 1.0) / (eps + 2.0)).im * 1e-6;
            let db_km = per_m * 1e4 / std::f64::consts::LN_10;
            assert!((droplets_db_km(ghz) / db_km - 1.0).abs() < 2e-3, "{ghz}: {db_km}");
        }
    }

    #[test]
    fn dry_snow_hides_less_than_rain() {
        let snow = snow_echoes(&Snow::new(5.0), 77.0).unwrap();
        assert!(snow.attenuation_db_km > 0.0 && snow.attenuation_db_km < rain_db_km(5.0, 77.0, 0.0) * 2.0, "{snow:?}");
        assert!(snow.echoes.eta_m2_per_m3 > 0.0 && (snow.echoes.fall_m_s - 1.0).abs() < 1e-12, "{snow:?}");
        assert!(snow_echoes(&Snow::new(0.0), 77.0).is_none());
    }
}
