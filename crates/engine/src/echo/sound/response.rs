//! Response of pulse and receiver to an echo.

use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// Weighting of the matched filter: the shape of a point-like echo over range.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Taper {
    /// None: `sinc^2` with first side lobes at -13.3 dB; an unmodulated pulse keeps its length.
    #[default]
    None,
    /// Hamming: side lobes below -42 dB, 1.47 times as wide; areas, noise and volume backscatter are 1.34 dB stronger
    /// relative to a point. For a pulse with a `bandwidth_khz`.
    Hamming,
}

impl Taper {
    /// The spectrum `0.54 + 0.46 cos` of a Hamming window (Harris 1978) is one line and two of half the cosine: ratio
    /// of the latter to the former.
    pub(crate) const HAMMING: f64 = 0.23 / 0.54;

    /// Energy over range of a point-like echo with a peak of 1, resolutions: 1 if untapered. Equivalent noise bandwidth
    /// of the window (Harris 1978, table I: 1.36).
    pub(crate) fn resolutions(self) -> f64 {
        match self {
            Taper::None => 1.0,
            Taper::Hamming => 1.0 + 2.0 * Taper::HAMMING * Taper::HAMMING,
        }
    }
}

/// Shape of a point-like echo over range bins: amplitudes, 1 in the middle within 0.06 dB (less where a bin is longer
/// than the resolution and holds the mean over its length), symmetric.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Response {
    /// From the middle outwards.
    taps: Vec<f32>,
    /// The taps that are not zero, for the convolution of a line with [`Response::reach`] bins of padding on each side:
    /// the bin of that line from which on each applies, and the tap.
    pub shifted: Vec<(u32, f32)>,
    /// Sum of the squares of all taps.
    pub power: f32,
}

impl Response {
    /// Bins are `bin` resolutions `c / (2 B)` long; `modulated`: compressed by a matched filter.
    ///
    /// # Errors
    /// The least possible `bin`: shorter ones would need more taps than that.
    pub fn new(bin: f64, modulated: bool, taper: Taper) -> Result<Response, f64> {
        /// Resolutions on each side: eight side lobes, the ninth is 29 dB down.
        const REACH: f64 = 8.5;
        /// Limits the work for bins much shorter than the pulse.
        const MOST_TAPS: f64 = 1024.0;
        // Exactly zero at the zeros: with bins of half a resolution that is every second tap, which then costs nothing.
        let sinc = |x: f64| match x {
            0.0 => 1.0,
            _ if x.fract() == 0.0 => 0.0,
            _ => (PI * x).sin() / (PI * x),
        };
        let shape = |x: f64| match taper {
            // An unmodulated pulse is uniform over one resolution; its edges count half.
            _ if !modulated => {
                let edge = (0.5 + 0.5 * bin - x) / bin;
                edge.clamp(0.0, 1.0).sqrt()
            }
            Taper::None => sinc(x),
            Taper::Hamming => sinc(x) + Taper::HAMMING * (sinc(x - 1.0) + sinc(x + 1.0)),
        };
        let reach = if modulated { REACH } else { 0.5 };
        if bin * MOST_TAPS < reach {
            return Err(reach / MOST_TAPS);
        }
        let count = if modulated { (reach / bin).ceil() } else { (reach / bin + 0.5).floor() } as usize;
        let mut taps: Vec<f32> = (0..=count).map(|k| shape(k as f64 * bin) as f32).collect();
        taps[0] = 1.0;
        let sum = |taps: &[f32]| taps[0] * taps[0] + 2.0 * taps[1..].iter().map(|tap| tap * tap).sum::<f32>();
        if modulated || bin > 1.0 {
            // Areas have the same level in bins of any length: long ones hold the mean over their length, and the
            // energy of the omitted side lobes, 0.05 dB, is given to the others.
            let scale = (taper.resolutions() as f32 / (bin as f32 * sum(&taps))).sqrt();
            taps.iter_mut().for_each(|tap| *tap *= scale);
        }
        let power = sum(&taps);
        let shifts = (0..2 * taps.len() as u32 - 1).map(|shift| (shift, taps[count.abs_diff(shift as usize)]));
        let shifted = shifts.filter(|(_, tap)| *tap != 0.0).collect();
        Ok(Response { taps, shifted, power })
    }

    /// Power of a point-like echo `bins` from its middle, relative to the middle.
    pub fn power_at(&self, bins: usize) -> f64 {
        self.taps.get(bins).map_or(0.0, |&tap| f64::from(tap * tap))
    }

    /// Amplitude of a point-like echo `bins` from its middle.
    pub fn amplitude_at(&self, bins: usize) -> f32 {
        self.taps.get(bins).map_or(0.0, |&tap| tap / self.taps[0])
    }

    /// Bins on each side over which the echo of a point extends.
    pub fn reach(&self) -> usize {
        self.taps.len() - 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_keeps_its_level_and_an_area_gets_a_resolution_cell() {
        for (bin, modulated, taper, cells) in [
            (0.5, true, Taper::None, 2.0),
            (0.25, true, Taper::None, 4.0),
            (0.5, false, Taper::None, 2.0),
            (0.25, false, Taper::None, 4.0),
        ] {
            let response = Response::new(bin, modulated, taper).unwrap();
            assert!((20.0 * response.taps[0].log10()).abs() < 0.06, "{bin} {modulated}: {}", response.taps[0]);
            // The energy of a stretch of one resolution.
            let off = 10.0 * (response.power / cells).log10();
            assert!(off.abs() < 0.02, "{bin} {modulated}: {off} dB");
        }
        for (bin, modulated, taper, cells) in [
            (3.0, true, Taper::None, 1.0),
            (2.5, false, Taper::None, 1.0),
            (1.0, true, Taper::Hamming, 1.363),
            (3.0, true, Taper::Hamming, 1.363),
        ] {
            let response = Response::new(bin, modulated, taper).unwrap();
            // The mean over the bin.
            assert!((response.power * bin as f32 / cells - 1.0).abs() < 0.01, "{bin} {modulated}: {}", response.power);
        }
        let hamming = Response::new(0.25, true, Taper::Hamming).unwrap();
        // Main lobe to 2 resolutions, then below -42 dB.
        assert!(hamming.taps[8..].iter().all(|tap| tap.abs() < 0.0079), "{:?}", hamming.taps);
        let sinc = Response::new(0.05, true, Taper::None).unwrap();
        let sidelobe = sinc.taps[20..40].iter().fold(0f32, |most, tap| most.max(tap.abs()));
        assert!((20.0 * sidelobe.log10() + 13.26).abs() < 0.1, "{sidelobe}");
        // The greatest number of taps, and one more.
        assert!(Response::new(8.5 / 1024.0, true, Taper::None).is_ok());
        assert_eq!(Response::new(4e-3, true, Taper::None), Err(8.5 / 1024.0));
        assert_eq!(Response::new(4e-4, false, Taper::None), Err(0.5 / 1024.0));
    }
}
