//! Reflectance in the near infrared estimated from the visible colour, for surfaces whose name indicates no material.

use super::surface::luminance;

/// Coefficients at one wavelength, and the standard deviation of the residuals.
struct InfraredRow {
    wavelength_nm: f64,
    /// `a` to `e` of [`Estimate`].
    coefficients: [f32; 5],
    sigma: f32,
}

/// Fitted to 1295 spectra of ECOSTRESS 1.0 (914; Meerdink et al. 2019), USGS splib07a (113; Kokaly et al. 2017), KLUM
/// (168; Ilehag et al. 2019) and of skin (NIST, 100; Cooksey et al. 2017): paints, textiles, plastics, wood, leaves,
/// plaster, brick, concrete, ceramics, stone, soil, asphalt, skin. Their colours are linear sRGB under an even white
/// light (CIE 1931). Robust least squares with no coefficient below 0; each class has a weight as a whole, so that 553
/// leaves do not count more than 14 textiles. The deviations are those of the samples fitted; a constant would leave
/// 0.23 at 905 nm, the luminance 0.27.
const ROWS: [InfraredRow; 6] = [
    InfraredRow { wavelength_nm: 532.0, coefficients: [0.0, 0.961, 0.0, 0.0, 0.246], sigma: 0.034 },
    InfraredRow { wavelength_nm: 850.0, coefficients: [0.093, 0.0, 0.792, 0.146, 0.668], sigma: 0.153 },
    InfraredRow { wavelength_nm: 905.0, coefficients: [0.094, 0.131, 0.646, 0.197, 0.591], sigma: 0.154 },
    InfraredRow { wavelength_nm: 940.0, coefficients: [0.095, 0.150, 0.614, 0.215, 0.564], sigma: 0.154 },
    InfraredRow { wavelength_nm: 1064.0, coefficients: [0.104, 0.129, 0.606, 0.262, 0.557], sigma: 0.157 },
    InfraredRow { wavelength_nm: 1550.0, coefficients: [0.103, 0.218, 0.388, 0.266, 0.125], sigma: 0.164 },
];

/// Reflectance at one wavelength from linear red, green and blue: `a + b Y + c max + d S + e G`, between 0.02 and 0.95,
/// with the luminance Y, the greatest channel, the colourfulness `S = (max - min) / (max + 0.05)` and the greenness
/// `G = (g - max(r, b)) / (max + 0.05)`, at least 0. Dyes and leaves absorb in the visible alone, so colourful surfaces
/// are bright in the infrared; those that are dark because of a dye cannot be distinguished from soot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    coefficients: [f32; 5],
    /// Standard deviation of true reflectances about the estimate.
    pub sigma: f32,
}

impl Estimate {
    /// The estimate at `wavelength_nm`: linear between the rows, constant outside them. In steps of 5 nm, so that
    /// diodes specified as 903 and 905 nm, which drift by more than that with temperature, are the same.
    pub fn at(wavelength_nm: f64) -> Estimate {
        let wavelength_nm = (wavelength_nm / 5.0).round() * 5.0;
        let of = |row: &InfraredRow| Estimate { coefficients: row.coefficients, sigma: row.sigma };
        let above = ROWS.partition_point(|row| row.wavelength_nm < wavelength_nm);
        if above == 0 || above == ROWS.len() {
            return of(&ROWS[above.min(ROWS.len() - 1)]);
        }
        let (low, high) = (&ROWS[above - 1], &ROWS[above]);
        let part = ((wavelength_nm - low.wavelength_nm) / (high.wavelength_nm - low.wavelength_nm)) as f32;
        let mix = |low: f32, high: f32| low + (high - low) * part;
        Estimate {
            coefficients: std::array::from_fn(|k| mix(low.coefficients[k], high.coefficients[k])),
            sigma: mix(low.sigma, high.sigma),
        }
    }

    /// Reflectance, 0.02 to 0.95, of a surface of the linear colour `r`, `g`, `b`.
    pub fn of(&self, [r, g, b]: [f32; 3]) -> f32 {
        let (most, least) = (r.max(g).max(b), r.min(g).min(b));
        let whole = most + 0.05;
        let [base, by_luminance, by_most, by_color, by_green] = self.coefficients;
        let green = (g - r.max(b)).max(0.0) / whole;
        let sum = base + by_luminance * luminance([r, g, b]) + by_most * most + by_color * (most - least) / whole;
        (sum + by_green * green).clamp(0.02, 0.95)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn estimate(wavelength_nm: f64, color: [f32; 3]) -> f32 {
        Estimate::at(wavelength_nm).of(color)
    }

    /// Colours of measured samples, and their reflectances at 905 nm (USGS splib07a, ECOSTRESS, KLUM): the residuals
    /// are within two standard deviations for all but the black dye, which the colour cannot reveal.
    #[test]
    fn estimates_from_colours_are_near_measurements() {
        let samples = [
            ([0.62, 0.60, 0.62], 0.64), // white cotton
            ([0.33, 0.02, 0.03], 0.53), // red nylon
            ([0.01, 0.13, 0.43], 0.63), // blue nylon
            ([0.77, 0.80, 0.80], 0.70), // white vinyl
            ([0.28, 0.17, 0.09], 0.52), // cardboard
            ([0.24, 0.10, 0.04], 0.60), // cedar
            ([0.04, 0.04, 0.04], 0.04), // black paint
            ([0.14, 0.12, 0.10], 0.15), // asphalt
            ([0.27, 0.13, 0.07], 0.35), // brick
            ([0.49, 0.43, 0.35], 0.47), // concrete
            ([0.83, 0.74, 0.57], 0.76), // plaster
            ([0.25, 0.16, 0.06], 0.35), // soil
        ];
        let sigma = Estimate::at(905.0).sigma;
        let mut squares = 0.0;
        for (color, measured) in samples {
            let found = estimate(905.0, color);
            assert!((found - measured).abs() < 2.0 * sigma, "{color:?}: {found} {measured}");
            squares += (found - measured).powi(2);
        }
        assert!((squares / samples.len() as f32).sqrt() < sigma);
        assert!(estimate(905.0, [0.01, 0.01, 0.01]) < 0.2, "black polyester has 0.74");
    }

    #[test]
    fn estimates_follow_the_wavelength() {
        let leaf = [0.05, 0.15, 0.03];
        assert!(estimate(905.0, leaf) > 2.5 * estimate(532.0, leaf));
        assert_eq!(estimate(400.0, leaf), estimate(532.0, leaf));
        assert_eq!(estimate(2000.0, leaf), estimate(1550.0, leaf));
        assert_eq!(estimate(903.0, leaf), estimate(905.0, leaf));
        let [low, between, high] = [850.0, 875.0, 905.0].map(|nm| estimate(nm, leaf));
        assert!((between - (low + (high - low) * 25.0 / 55.0)).abs() < 1e-6);
        // Brighter colours have higher reflectances.
        for k in 0..100 {
            let [dark, bright] = [0.0, 0.01].map(|more| estimate(905.0, [0.01 * k as f32 + more; 3]));
            assert!(bright >= dark && (0.02..=0.95).contains(&dark));
        }
    }
}
