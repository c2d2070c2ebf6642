//! From the levels of a beam to the range that a sonar reports for it.

use crate::cloud::{Layout, Sounding};
use std::ops::Range;

/// Beams farther from straight down than this are detected where the echo crosses their axis, rad (35 degrees): there
/// it is long, and its strongest part may be anywhere in it.
const BY_CROSSING: f32 = 0.61;

/// What one beam has heard.
pub(crate) struct BeamLevels<'a> {
    pub beam: usize,
    /// Levels, dB, bin by bin, and as powers.
    pub levels: &'a [f32],
    pub powers: &'a [f32],
    /// Angle from the beam's axis at which the energy of each bin arrives, rad; NaN: none. Empty: unknown.
    pub beside: &'a [f32],
    /// Width of the beam, rad.
    pub width: f32,
}

/// The range of the strongest echo of a beam: the centre of its energy, or for beams that look aside where it crosses
/// their axis. `None`: nothing is loud enough.
pub(crate) fn sounding(layout: &Layout, heard: &BeamLevels) -> Option<Sounding> {
    let BeamLevels { beam, levels, powers, beside, width } = *heard;
    let (bins, from) = (levels.len(), layout.first_bin);
    let [_, elevation] = layout.axes[beam];
    let down = (elevation + std::f32::consts::FRAC_PI_2).abs();
    // Energy of the cells around each one, so that a single bright speckle does not win.
    let around = |bin: usize| powers[bin.saturating_sub(2)..(bin + 3).min(bins)].iter().sum::<f32>();
    let loud = (from..bins).filter(|&bin| levels[bin] > layout.threshold_db[bin]);
    let (loudest, _) = loud.map(|bin| (bin, around(bin))).max_by(|(_, a), (_, b)| a.total_cmp(b))?;
    // The echo of a flat bottom lasts as long as the beam is wide on it.
    let range = (loudest as f32 + 0.5) * layout.bin_m as f32;
    let length = range * width * down.sin() / down.cos().abs().max(0.1) / layout.bin_m as f32;
    let reach = (0.75 * length).ceil() as usize + 3;
    let window = loudest.saturating_sub(reach).max(from)..(loudest + reach + 1).min(bins);
    let crossing = if down > BY_CROSSING { crossing(window.clone(), beside, powers) } else { None };
    let (at, spread) = match crossing {
        Some(at) => (at, 0.0),
        None => centre(window, powers, powers[loudest]),
    };
    let cell = (at as usize).min(bins - 1);
    let above = levels[loudest] - layout.threshold_db[loudest];
    let quality = (above / 20.0).clamp(0.0, 1.0) / (1.0 + spread / (reach as f32));
    Some(Sounding {
        beam: beam as u32,
        range: at * layout.bin_m as f32,
        cell: (beam * bins + cell) as u32,
        level_db: levels[loudest],
        quality,
    })
}

/// Centre and spread of the energy in `window` within 10 dB of the loudest, bins.
fn centre(window: Range<usize>, powers: &[f32], most: f32) -> (f32, f32) {
    let (mut sum, mut first, mut second) = (0.0, 0.0, 0.0);
    let origin = window.start;
    for bin in window {
        let power = powers[bin];
        if power > 0.1 * most {
            let at = (bin - origin) as f32 + 0.5;
            (sum, first, second) = (sum + power, first + power * at, second + power * at * at);
        }
    }
    let mean = first / sum;
    (origin as f32 + mean, (second / sum - mean * mean).max(0.0).sqrt())
}

/// Where the line through the angles in `window`, weighted by power, is 0; `None`: nowhere in it.
fn crossing(window: Range<usize>, beside: &[f32], powers: &[f32]) -> Option<f32> {
    let origin = window.start;
    let [mut n, mut x, mut y, mut xx, mut xy] = [0f64; 5];
    for bin in window.clone() {
        let angle = *beside.get(bin)?;
        if angle.is_nan() {
            continue;
        }
        let (weight, at, angle) = (f64::from(powers[bin]), (bin - origin) as f64 + 0.5, f64::from(angle));
        (n, x, y) = (n + weight, x + weight * at, y + weight * angle);
        (xx, xy) = (xx + weight * at * at, xy + weight * at * angle);
    }
    let slope = (n * xy - x * y) / (n * xx - x * x);
    let at = (x - y / slope) / n;
    (slope.is_finite() && at >= 0.0 && at <= window.len() as f64).then_some(origin as f32 + at as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::SonarView;

    fn layout(elevation: f32) -> Layout {
        Layout {
            view: SonarView::Swath,
            axes: vec![[0.0, elevation]],
            bins: 200,
            bin_m: 0.1,
            threshold_db: vec![50.0; 200],
            ..Layout::default()
        }
    }

    fn powers(levels: &[f32]) -> Vec<f32> {
        levels.iter().map(|level| 10f32.powf(0.1 * level)).collect()
    }

    #[test]
    fn a_short_echo_is_found_at_its_centre() {
        let mut levels = [40.0; 200];
        for (bin, level) in (98..103).zip([58.0, 70.0, 72.0, 70.0, 58.0]) {
            levels[bin] = level;
        }
        let layout = layout(-std::f32::consts::FRAC_PI_2);
        let powers = powers(&levels);
        let heard = BeamLevels { beam: 0, levels: &levels, powers: &powers, beside: &[], width: 0.02 };
        let found = sounding(&layout, &heard).unwrap();
        assert!((found.range - 10.05).abs() < 1e-3, "{found:?}");
        assert_eq!((found.cell, found.level_db), (100, 72.0));
        assert!(sounding(&Layout { first_bin: 110, ..layout }, &heard).is_none());
    }

    #[test]
    fn a_long_echo_is_found_where_it_crosses_the_axis() {
        // Louder towards one end, as speckle may make it.
        let mut levels = [40.0; 200];
        let mut beside = [f32::NAN; 200];
        for bin in 90..120 {
            levels[bin] = 60.0 + (bin - 90) as f32 / 3.0;
            beside[bin] = (bin as f32 + 0.5 - 104.0) * 1e-3;
        }
        let layout = layout(-0.4);
        let powers = powers(&levels);
        let heard = BeamLevels { beam: 0, levels: &levels, powers: &powers, beside: &beside, width: 0.1 };
        let found = sounding(&layout, &heard).unwrap();
        assert!((found.range - 10.4).abs() < 1e-2, "{found:?}");
    }
}
