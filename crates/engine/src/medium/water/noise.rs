//! Noise that an instrument receives in the sea.

/// Ambient noise of the sea: Coates 1990 (Underwater Acoustic Systems), his fit to the curves of Wenz 1962.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AmbientNoise {
    /// Wind speed, m/s.
    pub wind_m_s: f64,
    /// Amount of shipping, 0 to 1.
    pub shipping: f64,
}

impl AmbientNoise {
    /// Spectrum levels of turbulence, shipping, wind and thermal noise, dB re 1 uPa^2/Hz, at a frequency in Hz, above
    /// 0.
    pub fn parts_db(&self, frequency_hz: f64) -> [f64; 4] {
        let khz = frequency_hz * 1e-3;
        [
            17.0 - 30.0 * khz.log10(),
            40.0 + 20.0 * (self.shipping - 0.5) + 26.0 * khz.log10() - 60.0 * (khz + 0.03).log10(),
            50.0 + 7.5 * self.wind_m_s.max(0.0).sqrt() + 20.0 * khz.log10() - 40.0 * (khz + 0.4).log10(),
            -15.0 + 20.0 * khz.log10(),
        ]
    }

    /// Spectrum level of all of them, dB re 1 uPa^2/Hz: their powers add.
    pub fn level_db(&self, frequency_hz: f64) -> f64 {
        10.0 * self.parts_db(frequency_hz).iter().map(|db| 10f64.powf(db / 10.0)).sum::<f64>().log10()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sum_is_above_its_parts_and_grows_with_wind_and_ships() {
        let quiet = AmbientNoise { wind_m_s: 0.0, shipping: 0.0 };
        let loud = AmbientNoise { wind_m_s: 15.0, shipping: 1.0 };
        for frequency in [10.0, 1e2, 1e3, 1e4, 1e5, 1e6] {
            for noise in [quiet, loud] {
                let most = noise.parts_db(frequency).into_iter().fold(f64::MIN, f64::max);
                let level = noise.level_db(frequency);
                assert!((most..most + 6.03).contains(&level), "{frequency}: {level}");
            }
            assert!(loud.level_db(frequency) > quiet.level_db(frequency));
        }
        // Thermal noise dominates above 100 kHz: 38 dB at 450 kHz.
        assert!((quiet.level_db(450e3) - 38.06).abs() < 0.05);
    }
}
