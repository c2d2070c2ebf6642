//! What sound does at the surface of the sea.

use std::f64::consts::{LOG10_E, PI, TAU};

/// The surface of a sea after a long-lasting wind.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sea {
    /// Wind, m/s.
    pub wind_m_s: f64,
}

impl Sea {
    /// Root mean square height of the waves, m: a quarter of their significant height, `0.0214 U^2` in a fully
    /// developed sea (Pierson and Moskowitz 1964).
    pub fn rms_height_m(&self) -> f64 {
        0.0214 * self.wind_m_s.powi(2) / 4.0
    }

    /// Loss of the mirror image of a wave of `frequency_hz`, dB, at a grazing angle of sine `sin_grazing` in water of
    /// the speed of sound `speed_m_s`.
    ///
    /// Amplitudes are `-exp(-2 k^2 s^2 sin^2 g)`, with the wavenumber `k` and the height `s` (Eckart 1953, normally
    /// distributed heights). What is lost is scattered.
    pub fn mirror_loss_db(&self, sin_grazing: f64, frequency_hz: f64, speed_m_s: f64) -> f64 {
        let rayleigh = TAU * frequency_hz / speed_m_s * self.rms_height_m() * sin_grazing;
        20.0 * LOG10_E * 2.0 * rayleigh * rayleigh
    }

    /// Backscattering cross-section of the surface, m^2 per m^2 and sr, at a grazing angle of sine `sin_grazing`.
    ///
    /// Chapman and Harris 1962 (J. Acoust. Soc. Am. 34, 1592), `3.3 b log(g / 30 deg) - 42.4 log b + 2.6` dB with `b =
    /// 158 (v f^(1/3))^-0.58`, wind `v` in knots and `f` in Hz; and above 10 kHz facets that mirror the wave back, with
    /// the slopes seen by Cox and Munk 1954 (mean square slope `m = 0.003 + 0.00512 U`, both axes together):
    /// `exp(-tan^2(i) / m) / (4 pi m cos^4(i))` at the angle `i` from the normal.
    ///
    /// Assumptions of ours: Chapman and Harris measured from 400 Hz to 6.4 kHz, and outside the value at the nearer
    /// limit is used; above 30 degrees, where their law diverges in calm seas, the value at 30; the facets reflect
    /// everything. Bubbles count only as far as they are in the measurements.
    pub fn backscatter(&self, sin_grazing: f64, frequency_hz: f64) -> f64 {
        if sin_grazing <= 0.0 {
            return 0.0;
        }
        let sin = sin_grazing.min(1.0);
        let mut all = 0.0;
        if self.wind_m_s > 0.0 {
            let knots = self.wind_m_s / 0.514_444;
            let beta = 158.0 * (knots * frequency_hz.clamp(400.0, 6400.0).cbrt()).powf(-0.58);
            let degrees = sin.asin().to_degrees().min(30.0);
            let db = 3.3 * beta * (degrees / 30.0).log10() - 42.4 * beta.log10() + 2.6;
            all += 10f64.powf(db / 10.0);
        }
        if frequency_hz > 10e3 {
            let (slope, sin2) = (0.003 + 0.005_12 * self.wind_m_s.max(0.0), sin * sin);
            // Where sin^4 underflows the exponential has long been 0.
            let lobe = (-(1.0 - sin2) / (sin2 * slope)).exp();
            all += if lobe > 0.0 { lobe / (4.0 * PI * slope * sin2 * sin2) } else { 0.0 };
        }
        all
    }
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

    #[test]
    fn more_comes_back_in_wind_and_at_steeper_angles() {
        for frequency in [500.0, 5e3, 8e3] {
            for degrees in [1.0, 5.0, 20.0, 60.0, 90.0] {
                assert!(db(15.0, degrees, frequency) > db(5.0, degrees, frequency));
            }
            assert!(db(5.0, 20.0, frequency) > db(5.0, 5.0, frequency));
        }
    }

    /// A non-negative number at every angle, frequency and wind; the facets shine when seen from below.
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
