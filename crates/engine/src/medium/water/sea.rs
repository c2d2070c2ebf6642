//! Reflection and scattering of sound at the sea surface.

use std::f64::consts::{LOG10_E, PI, TAU};

/// The surface of a fully developed sea.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sea {
    /// Wind speed, m/s.
    pub wind_m_s: f64,
}

impl Sea {
    /// Root mean square height of the waves, m: a quarter of their significant height, `0.0214 U^2` in a fully
    /// developed sea (Pierson and Moskowitz 1964).
    pub fn rms_height_m(&self) -> f64 {
        0.0214 * self.wind_m_s.powi(2) / 4.0
    }

    /// Loss of the specular reflection of a wave of `frequency_hz`, dB, at a grazing angle of sine `sin_grazing` in
    /// water of the speed of sound `speed_m_s`.
    ///
    /// Amplitudes are `-exp(-2 k^2 s^2 sin^2 g)`, with the wavenumber `k` and the height `s` (Eckart 1953, normally
    /// distributed heights). The lost energy is scattered.
    pub fn mirror_loss_db(&self, sin_grazing: f64, frequency_hz: f64, speed_m_s: f64) -> f64 {
        let rayleigh = TAU * frequency_hz / speed_m_s * self.rms_height_m() * sin_grazing;
        20.0 * LOG10_E * 2.0 * rayleigh * rayleigh
    }

    /// Backscattering cross-section of the surface, m^2 per m^2 and sr, at a grazing angle of sine `sin_grazing`.
    ///
    /// Up to 10 kHz: Chapman and Harris 1962 (J. Acoust. Soc. Am. 34, 1592), `3.3 b log(g / 30 deg) - 42.4 log b + 2.6`
    /// dB with `b = 158 (v f^(1/3))^-0.58`, wind `v` in knots and `f` in Hz. They measured from 400 Hz to 6.4 kHz;
    /// outside, the value at the nearer limit is used, and above 30 degrees, where their law diverges in calm seas, the
    /// value at 30 (our assumptions).
    ///
    /// Above 10 kHz: the bubbles below the surface and, seen through them, facets that reflect the wave straight back,
    /// with the slopes of Cox and Munk 1954 (mean square slope `m = 0.003 + 0.00512 U`, both axes together):
    /// `exp(-tan^2(i) / m) / (4 pi m cos^4(i))` at the angle `i` from the normal. That the facets reflect everything is
    /// our assumption.
    pub fn backscatter(&self, sin_grazing: f64, frequency_hz: f64) -> f64 {
        if sin_grazing <= 0.0 {
            return 0.0;
        }
        let sin = sin_grazing.min(1.0);
        if frequency_hz <= 10e3 {
            return if self.wind_m_s > 0.0 { self.chapman_harris(sin, frequency_hz) } else { 0.0 };
        }
        let (slope, sin2) = (0.003 + 0.005_12 * self.wind_m_s.max(0.0), sin * sin);
        // Where sin^4 underflows the exponential has long been 0.
        let lobe = (-(1.0 - sin2) / (sin2 * slope)).exp();
        let facets = if lobe > 0.0 { lobe / (4.0 * PI * slope * sin2 * sin2) } else { 0.0 };
        let depth = self.bubble_depth(frequency_hz) / sin;
        bubbles(depth, sin, frequency_hz) + facets * (-4.0 * depth).exp()
    }

    fn chapman_harris(&self, sin: f64, frequency_hz: f64) -> f64 {
        let knots = self.wind_m_s / 0.514_444;
        let beta = 158.0 * (knots * frequency_hz.clamp(400.0, 6400.0).cbrt()).powf(-0.58);
        let degrees = sin.asin().to_degrees().min(30.0);
        let db = 3.3 * beta * (degrees / 30.0).log10() - 42.4 * beta.log10() + 2.6;
        10f64.powf(db / 10.0)
    }

    /// Attenuation of a wave's amplitude on a vertical path through the bubbles, nepers: APL-UW 1994 (TR 9407, section
    /// II), `10^(-5.2577 + 0.4701 U) (f / 25 kHz)^0.85`, and above 11 m/s as `U^3.5`.
    fn bubble_depth(&self, frequency_hz: f64) -> f64 {
        /// Wind above which bubbles increase more slowly, m/s.
        const STRONG: f64 = 11.0;
        let (wind, over) = (self.wind_m_s.clamp(0.0, STRONG), (self.wind_m_s / STRONG).max(1.0));
        10f64.powf(-5.2577 + 0.4701 * wind) * over.powf(3.5) * (frequency_hz / 25e3).powf(0.85)
    }
}

/// Backscatter of bubbles below a specular surface, 1/sr, at the sine of a grazing angle along which they attenuate by
/// `depth` nepers: directly, by the specular surface, and both (APL-UW 1994, TR 9407, section II),
/// `sin(g) / (8 pi) d_r / d (1 + 8 b exp(-2 b) - exp(-4 b))`. `d` is the damping of bubbles that resonate at
/// `frequency_hz`, of which `d_r` is by radiation.
fn bubbles(depth: f64, sin: f64, frequency_hz: f64) -> f64 {
    const BY_RADIATION: f64 = 0.0136;
    let damping = 2.55e-2 * (frequency_hz / 1e3).cbrt();
    let paths = 8.0 * depth * (-2.0 * depth).exp() - (-4.0 * depth).exp_m1();
    sin / (8.0 * PI) * BY_RADIATION / damping * paths
}

#[cfg(test)]
mod tests {
    use super::*;

    fn db(wind_m_s: f64, degrees: f64, frequency: f64) -> f64 {
        10.0 * Sea { wind_m_s }.backscatter(degrees.to_radians().sin(), frequency).log10()
    }

    #[test]
    fn heights_and_mirror_losses() {
        let sea = Sea { wind_m_s: 10.0 };
        assert!((sea.rms_height_m() - 0.535).abs() < 1e-12);
        // exp(-2 (k s sin g)^2) by hand: k = 2 pi 1000 / 1500.
        let (k, sin) = (4.188_790_2f64, 0.1f64);
        let amplitude = (-2.0 * (k * 0.535 * sin).powi(2)).exp();
        assert!((sea.mirror_loss_db(sin, 1000.0, 1500.0) + 20.0 * amplitude.log10()).abs() < 1e-6);
        assert_eq!(sea.mirror_loss_db(0.0, 1e5, 1500.0), 0.0);
        assert_eq!(Sea { wind_m_s: 0.0 }.mirror_loss_db(1.0, 1e5, 1500.0), 0.0);
    }

    /// By hand: 10 m/s are 19.438 kn, at 1000 Hz b = 158 194.38^-0.58 = 7.432.
    #[test]
    fn chapman_and_harris_by_hand() {
        assert!((db(10.0, 30.0, 1000.0) - (2.6 - 42.4 * 7.432f64.log10())).abs() < 0.01);
        assert!((db(10.0, 3.0, 1000.0) - (2.6 - 42.4 * 7.432f64.log10() - 3.3 * 7.432)).abs() < 0.02);
        assert_eq!(db(10.0, 10.0, 100.0), db(10.0, 10.0, 400.0));
        assert_eq!(db(10.0, 10.0, 9e3), db(10.0, 10.0, 6.4e3));
    }

    /// Bubbles alone, as computed by another program from the same report.
    #[test]
    fn bubbles_are_those_of_a_table() {
        let table = include_str!("../../../tests/data/sonar/surface_scatter.csv");
        let mut rows = 0;
        for line in table.lines().skip(1) {
            let [frequency, wind_m_s, degrees, expected]: [f64; 4] =
                line.split(',').map(|cell| cell.parse().unwrap()).collect::<Vec<_>>().try_into().unwrap();
            let sin = degrees.to_radians().sin();
            let depth = Sea { wind_m_s }.bubble_depth(frequency) / sin;
            let found = 10.0 * bubbles(depth, sin, frequency).log10();
            assert!((found - expected).abs() < 1e-3, "{line}: {found}");
            // Where facets do not glint, only bubbles remain.
            if degrees < 20.0 {
                assert!((db(wind_m_s, degrees, frequency) - expected).abs() < 0.1, "{line}");
            }
            rows += 1;
        }
        assert_eq!(rows, 96);
    }

    #[test]
    fn more_comes_back_in_wind_and_at_steeper_angles() {
        for frequency in [500.0, 5e3, 8e3] {
            for degrees in [1.0, 5.0, 20.0, 60.0, 90.0] {
                assert!(db(15.0, degrees, frequency) > db(5.0, degrees, frequency));
            }
            assert!(db(5.0, 20.0, frequency) > db(5.0, 5.0, frequency));
        }
        // This holds for bubbles until they hide the surface.
        for degrees in [1.0, 5.0, 10.0] {
            assert!(db(8.0, degrees, 30e3) > db(4.0, degrees, 30e3));
            assert!(db(4.0, 2.0 * degrees, 30e3) > db(4.0, degrees, 30e3));
        }
    }

    /// A non-negative number at every angle, frequency and wind; the facets glint when seen from straight below.
    #[test]
    fn nothing_is_negative_or_infinite() {
        for wind_m_s in [0.0, 0.1, 1.0, 10.0, 50.0] {
            for frequency in [100.0, 1e3, 2e4, 1e6] {
                for step in 0..=1000 {
                    let found = Sea { wind_m_s }.backscatter(f64::from(step) / 1000.0, frequency);
                    assert!((0.0..30.0).contains(&found), "{wind_m_s} {frequency} {step}: {found}");
                }
            }
        }
        assert!(db(5.0, 90.0, 1e5) > db(5.0, 60.0, 1e5) + 10.0);
        assert_eq!(Sea { wind_m_s: 0.0 }.backscatter(0.5, 1e3), 0.0);
    }
}
