//! Oxygen and water vapour.

use std::sync::LazyLock;

/// Lines of the recommendation's tables: frequency, GHz, and six coefficients.
struct GasLines {
    oxygen: Vec<[f64; 7]>,
    vapour: Vec<[f64; 7]>,
}

static LINES: LazyLock<GasLines> = LazyLock::new(|| GasLines {
    oxygen: read(include_str!("oxygen.csv")),
    vapour: read(include_str!("water_vapour.csv")),
});

fn read(text: &str) -> Vec<[f64; 7]> {
    let rows = text.lines().filter(|line| !line.starts_with('#')).skip(1);
    let numbers = |line: &str| line.split(',').filter_map(|number| number.parse().ok()).collect::<Vec<f64>>();
    rows.map(|line| numbers(line).try_into().expect("the tables that are compiled in are sound")).collect()
}

/// Pressure of dry air, hPa, degrees C and water vapour, g/m^3: those of ITU-R P.676-13, fig. 1, at sea level.
const AIR: [f64; 3] = [1013.25, 15.0, 7.5];

/// Attenuation of air at sea level, dB/km one way, at 1 to 1000 GHz: by oxygen and by water vapour. ITU-R P.676-13, annex 1,
/// eq. 1 to 9: `0.182 f sum S F`, lines of strengths `S` and shapes `F`, and the continuum of dry air.
pub(in crate::medium) fn attenuation_db_km(ghz: f64) -> [f64; 2] {
    let [dry, celsius, vapour] = AIR;
    let kelvin = celsius + 273.15;
    let (theta, wet) = (300.0 / kelvin, vapour * kelvin / 216.7);
    let line = |strength: f64, center: f64, width: f64, overlap: f64| {
        let side = |apart: f64| (width - overlap * apart) / (apart * apart + width * width);
        strength * ghz / center * (side(center - ghz) + side(center + ghz))
    };
    let oxygen: f64 = LINES
        .oxygen
        .iter()
        .map(|&[center, a1, a2, a3, a4, a5, a6]| {
            let strength = a1 * 1e-7 * dry * theta.powi(3) * (a2 * (1.0 - theta)).exp();
            let width = a3 * 1e-4 * (dry * theta.powf(0.8 - a4) + 1.1 * wet * theta);
            let overlap = (a5 + a6 * theta) * 1e-4 * (dry + wet) * theta.powf(0.8);
            line(strength, center, width.hypot(1.5e-3), overlap)
        })
        .sum();
    let width = 5.6e-4 * (dry + wet) * theta.powf(0.8);
    let debye = 6.14e-5 / (width * (1.0 + (ghz / width).powi(2)));
    let nitrogen = 1.4e-12 * dry * theta.powf(1.5) / (1.0 + 1.9e-5 * ghz.powf(1.5));
    let continuum = ghz * dry * theta * theta * (debye + nitrogen);
    let water: f64 = LINES
        .vapour
        .iter()
        .map(|&[center, b1, b2, b3, b4, b5, b6]| {
            let strength = b1 * 0.1 * wet * theta.powf(3.5) * (b2 * (1.0 - theta)).exp();
            let width = b3 * 1e-4 * (dry * theta.powf(b4) + b5 * wet * theta.powf(b6));
            let doppler = (0.217 * width * width + 2.1316e-12 * center * center / theta).sqrt();
            line(strength, center, 0.535 * width + doppler, 0.0)
        })
        .sum();
    [oxygen + continuum, water].map(|refractivity| 0.182 * ghz * refractivity)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The values that ITU-R Study Group 3 publishes for checking P.676.
    #[test]
    fn air_attenuates_as_the_itu_computes_it() {
        for (ghz, oxygen, vapour) in [
            (12.0, 0.008_698_264, 0.009_535_39),
            (20.0, 0.011_883_550, 0.097_047_3),
            (60.0, 14.623_474_8, 0.154_841_84),
            (90.0, 0.038_869_711, 0.341_973_39),
            (130.0, 0.041_509_084, 0.751_844_70),
        ] {
            let found = attenuation_db_km(ghz);
            assert!((found[0] / oxygen - 1.0).abs() < 1e-7, "{ghz} GHz: {found:?}");
            assert!((found[1] / vapour - 1.0).abs() < 1e-6, "{ghz} GHz: {found:?}");
        }
    }
}
