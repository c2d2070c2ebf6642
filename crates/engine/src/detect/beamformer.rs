//! From the levels of a beam to the range that a sonar reports for it.
//!
//! A swath's beams detect as bathymetric sonars do (de Moustier 1988, "State of the art in swath bathymetry survey
//! systems"; Lurton 2010, "An introduction to underwater acoustics", section 8.4): short echoes by the centre of their
//! energy, long ones where the phase between the two halves of the array, which gives the angle from the beam's axis,
//! crosses zero.

use cloud::cells::{Layout, Sounding};
use glam::Vec3;
use ground::math::{LOG2_PER_DB, exp2};
use ground::rng::{Draw, Rng};
use std::ops::Range;

/// Fraction of a beam's full width at -3 dB to each side of its axis within which echoes are its own: those from
/// farther off axis came in through the flanks of the main lobe or through side lobes.
const WITHIN: f32 = 0.6;

/// What one beam has received.
pub(crate) struct BeamLevels<'a> {
    pub beam: usize,
    /// Levels, dB, bin by bin.
    pub levels: &'a [f32],
    /// From which angle off its axis it has received that.
    pub beside: Beside<'a>,
    /// Full width of the beam as it is steered, rad.
    pub width: f32,
    /// Length of the pulse, bins.
    pub resolution: f32,
    /// Random numbers of the ping.
    pub rng: &'a Rng,
}

/// Energies of a tile times the angle from the axis of the beam that receives them, rad, and the energies, by bin and
/// beam. Empty for a single beam.
#[derive(Clone, Copy)]
pub struct Beside<'a> {
    pub moment: &'a [f32],
    pub total: &'a [f32],
    /// Cells per bin, and which of them is the beam's.
    pub width: usize,
    pub beam: usize,
    /// First bin in which there may be energy, and the first after the last such bin.
    pub received: (usize, usize),
}

impl Beside<'_> {
    /// Angle from the beam's axis at which the energy of a bin arrives, rad; NaN: there is none.
    fn at(&self, bin: usize) -> f32 {
        let cell = bin * self.width + self.beam;
        self.moment[cell] / self.total[cell]
    }

    /// Energy that arrives in a bin on average, without speckle.
    fn energy(&self, bin: usize) -> f32 {
        self.total[bin * self.width + self.beam]
    }

    fn is_empty(&self) -> bool {
        self.total.is_empty()
    }
}

/// Buffers of [`sounding`].
#[derive(Default)]
pub(crate) struct SoundingMemory {
    /// Bins of an echo above the threshold, their powers, and the angles off axis that are measured there, rad.
    bins: Vec<u32>,
    powers: Vec<f32>,
    angles: Vec<f32>,
    beams: Vec<u32>,
    noise: Vec<f32>,
    sums: Vec<f32>,
}

/// Position of an echo, bins, and its standard error.
struct EchoEstimate {
    at: f32,
    error: f32,
}

/// The range of the strongest echo of a beam. `None`: nothing is above the threshold; or, for swaths, nothing is on the
/// beam's axis within range.
pub(crate) fn sounding(layout: &Layout, received: &BeamLevels, stretch: &mut SoundingMemory) -> Option<Sounding> {
    let BeamLevels { beam, levels, beside, .. } = *received;
    let window = if beside.is_empty() {
        around_the_strongest(layout, received)?
    } else {
        on_axis(layout, received, &mut stretch.sums)?
    };
    stretch.fill(layout, received, window.clone());
    let bins = levels.len();
    let found = match stretch.crossing(received) {
        Some(found) => found,
        // The echo continues beyond the last bin.
        None if !beside.is_empty() && window.end == bins => return None,
        None => stretch.centre(received, exp2(layout.noise_db * LOG2_PER_DB))?,
    };
    if !(window.start as f32 - 1.0..=window.end as f32 + 1.0).contains(&found.at) {
        return None;
    }
    let cell = (found.at.max(0.0) as usize).min(bins - 1);
    let strongest = window.map(|bin| levels[bin]).fold(f32::NEG_INFINITY, f32::max);
    let sounding = Sounding::default().beam(beam as u32).cell(layout.cell(beam, 0, cell) as u32).level_db(strongest);
    let range = found.at * layout.bin_m as f32;
    Some(sounding.range(range).quality(quality(found.error / found.at)).corrected(Vec3::NAN))
}

/// Confidence, 0 to 1, in a range with this relative standard error: 0.5 at 0.25 %, half of the depth error allowed for
/// surveys of the second best order (IHO S-44, order 1: 1.3 %, at 95 %).
fn quality(error: f32) -> f32 {
    const HALF: f32 = 2.5e-3;
    1.0 / (1.0 + (error / HALF).powi(2))
}

/// Bins around the highest level of a single beam that its echo from a flat bottom may cover.
fn around_the_strongest(layout: &Layout, received: &BeamLevels) -> Option<Range<usize>> {
    let BeamLevels { beam, levels, width, .. } = *received;
    let (bins, from) = (levels.len(), layout.first_bin);
    // Energy of the cells around each one, so that a single bright speckle does not win.
    let around = |bin: usize| {
        let about = &levels[bin.saturating_sub(2)..(bin + 3).min(bins)];
        about.iter().map(|level| exp2(level * LOG2_PER_DB)).sum::<f32>()
    };
    let above_threshold = stretches_above_threshold(levels, &layout.threshold_db, from..bins).flatten();
    let above_threshold = above_threshold.filter(|&bin| levels[bin] > layout.threshold_db[bin]);
    let (strongest, _) = above_threshold.map(|bin| (bin, around(bin))).max_by(|(_, a), (_, b)| a.total_cmp(b))?;
    let range = (strongest as f32 + 0.5) * layout.bin_m as f32;
    let reach = bins_about(layout, beam, width, range);
    Some(strongest.saturating_sub(reach).max(from)..(strongest + reach + 1).min(bins))
}

/// Bins to each side of a `range`, m, that the echo from a flat bottom may cover in a beam of this `width`, rad.
pub(crate) fn bins_about(layout: &Layout, beam: usize, width: f32, range: f32) -> usize {
    let [_, elevation] = layout.axes[beam];
    let down = (elevation + std::f32::consts::FRAC_PI_2).abs();
    let length = range * width * down.sin() / down.cos().abs().max(0.1) / layout.bin_m as f32;
    (0.75 * length).ceil() as usize + 3
}

/// The stretch of bins with the most energy among those that are above the threshold and come from within a swath's
/// beam, without much fainter bins before and after, which are received by the along-track side lobes. The mean energy
/// decides which these are: instruments search where neighbouring beams and previous pings have found something, so a
/// single dark speckle does not mislead them.
fn on_axis(layout: &Layout, received: &BeamLevels, sums: &mut Vec<f32>) -> Option<Range<usize>> {
    /// Least power of the rest, as a fraction of that of the strongest part.
    const FAINTER: f32 = 0.05;
    let BeamLevels { levels, beside, width, resolution, .. } = *received;
    let bins = layout.first_bin.max(beside.received.0)..levels.len().min(beside.received.1);
    // Speckle interrupts an echo.
    let least = 3.0 * resolution + 3.0;
    let longest = |length: usize| least.max(0.2 * length as f32);
    let lit = |&bin: &usize| levels[bin] > layout.threshold_db[bin] && beside.at(bin).abs() <= WITHIN * width;
    let mut best = (0.0, 0..0);
    let mut run = (0.0, 0..0);
    for bin in stretches_above_threshold(levels, &layout.threshold_db, bins).flatten().filter(lit) {
        let (_, at) = &run;
        if at.is_empty() || (bin - at.end) as f32 > longest(at.len()) {
            run = (0.0, bin..bin);
        }
        let (energy, at) = &mut run;
        *energy += beside.energy(bin);
        at.end = bin + 1;
        if *energy > best.0 {
            best = run.clone();
        }
    }
    let (energy, whole) = best;
    if energy == 0.0 {
        return None;
    }
    // Cumulative sums by bin, for means over some pulses.
    sums.clear();
    sums.push(0.0);
    let mut sum = 0.0;
    for bin in whole.clone() {
        sum += if lit(&bin) { beside.energy(bin) / energy } else { 0.0 };
        sums.push(sum);
    }
    let half = (0.5 * least) as usize;
    let around = |at: usize| sums[(at + half + 1).min(whole.len())] - sums[at.saturating_sub(half)];
    let (middle, most) = (0..whole.len()).map(|at| (at, around(at))).max_by(|(_, a), (_, b)| a.total_cmp(b))?;
    let is_faint = |at: &usize| around(*at) < FAINTER * most;
    // From the middle outwards, across gaps caused by speckle.
    let reach = |ways: &mut dyn Iterator<Item = usize>| {
        let mut last = middle;
        for at in ways {
            if !is_faint(&at) {
                last = at;
            } else if at.abs_diff(last) as f32 > longest(last.abs_diff(middle)) {
                break;
            }
        }
        last
    };
    let (first, last) = (reach(&mut (0..middle).rev()), reach(&mut (middle + 1..whole.len())));
    Some(whole.start + first..whole.start + last + 1)
}

/// The stretches of `bins` in which any level is above its threshold: there are few.
fn stretches_above_threshold(
    levels: &[f32],
    thresholds: &[f32],
    bins: Range<usize>,
) -> impl Iterator<Item = Range<usize>> {
    /// Length of a stretch, bins.
    const STRETCH: usize = 32;
    let stretches = bins.clone().step_by(STRETCH).map(move |from| from..(from + STRETCH).min(bins.end));
    stretches.filter(|stretch| {
        let pairs = levels[stretch.clone()].iter().zip(&thresholds[stretch.clone()]);
        // No early exit, which would prevent vectorisation.
        pairs.fold(false, |above_threshold, (level, threshold)| above_threshold | (level > threshold))
    })
}

impl SoundingMemory {
    /// Collects the bins of `window` above the threshold, and measures angles there.
    fn fill(&mut self, layout: &Layout, received: &BeamLevels, window: Range<usize>) {
        /// Standard deviation of the measured angle over the width of the beam, times the square root of the ratio of
        /// power to noise: two halves of a line array, half its length apart, whose phases have independent noise; `1 /
        /// (0.886 pi)`, as the width is 0.886 wavelengths over the length.
        const PER_WIDTH: f32 = 0.359;
        let BeamLevels { beam, levels, beside, width, rng, .. } = *received;
        let SoundingMemory { bins, powers, angles, beams, noise, .. } = self;
        bins.clear();
        powers.clear();
        angles.clear();
        let is_swath = !beside.is_empty();
        let own = |bin: &usize| {
            levels[*bin] > layout.threshold_db[*bin] && (!is_swath || beside.at(*bin).abs() <= WITHIN * width)
        };
        bins.extend(window.filter(own).map(|bin| bin as u32));
        powers.extend(bins.iter().map(|&bin| exp2(levels[bin as usize] * LOG2_PER_DB)));
        if !is_swath {
            return;
        }
        beams.clear();
        beams.resize(bins.len(), beam as u32);
        noise.clear();
        noise.resize(bins.len(), 0.0);
        rng.normals(beams, bins, Draw::SplitPhase, noise);
        let background = exp2(layout.noise_db * LOG2_PER_DB);
        let measured = bins.iter().zip(&*powers).zip(&*noise).map(|((&bin, &power), &noise)| {
            let ratio = (power / background - 1.0).max(0.1);
            beside.at(bin as usize) + PER_WIDTH * width * noise / ratio.sqrt()
        });
        angles.extend(measured);
    }

    /// Centre of the energy within 10 dB of the maximum. Speckle moves it within the extent beyond a pulse, noise by a
    /// fraction of a pulse.
    fn centre(&self, received: &BeamLevels, noise: f32) -> Option<EchoEstimate> {
        /// Spread of a point's echo, in resolutions: that of `sinc^2` within 10 dB.
        const OWN: f32 = 0.28;
        let most = self.powers.iter().copied().fold(0.0, f32::max);
        let origin = *self.bins.first()?;
        let (mut sum, mut first, mut second) = (0.0, 0.0, 0.0);
        for (&bin, &power) in self.bins.iter().zip(&self.powers).filter(|(_, power)| **power > 0.1 * most) {
            let at = (bin - origin) as f32 + 0.5;
            (sum, first, second) = (sum + power, first + power * at, second + power * at * at);
        }
        let mean = first / sum;
        let own = (OWN * received.resolution).powi(2);
        // As many independent speckles as pulses fit into the echo.
        let looks = (self.bins.len() as f32 / received.resolution).max(1.0);
        let longer = (second / sum - mean * mean - own).max(0.0);
        Some(EchoEstimate { at: origin as f32 + mean, error: (longer / looks + own * noise / most).sqrt() })
    }

    /// Where the angle crosses zero, if it runs through the beam over several pulses: a parabola is fitted to it; the
    /// range of a flat bottom is not a parabola of the angle, but nearly one within a beam.
    fn crossing(&self, received: &BeamLevels) -> Option<EchoEstimate> {
        /// Least length of an echo, pulses.
        const PULSES: f32 = 6.0;
        /// Fraction of the beam width that the angle must run through at least.
        const THROUGH: f64 = 0.4;
        let (&first, &last) = (self.bins.first()?, self.bins.last()?);
        let half = 0.5 * (last + 1 - first) as f32;
        if self.angles.is_empty() || 2.0 * half < PULSES * received.resolution || self.bins.len() < 8 {
            return None;
        }
        let middle = first as f32 + half;
        // In half lengths of the stretch from its middle: moments with equal weights, as speckle carries no information
        // about the angle.
        let mut x_sums = [0f64; 5];
        let mut y_sums = [0f64; 3];
        for (&bin, &angle) in self.bins.iter().zip(&self.angles) {
            let x = f64::from((bin as f32 + 0.5 - middle) / half);
            let mut power = 1.0;
            for degree in 0..5 {
                x_sums[degree] += power;
                if degree < 3 {
                    y_sums[degree] += power * f64::from(angle);
                }
                power *= x;
            }
        }
        let [a, b, c] = parabola(x_sums, y_sums)?;
        if 2.0 * b.abs() < THROUGH * f64::from(received.width) {
            return None;
        }
        let residuals = self.bins.iter().zip(&self.angles).map(|(&bin, &angle)| {
            let x = f64::from((bin as f32 + 0.5 - middle) / half);
            (f64::from(angle) - (a + x * (b + x * c))).powi(2)
        });
        let sigma = (residuals.sum::<f64>() / (x_sums[0] - 3.0)).sqrt();
        // The root that becomes that of a straight line as c vanishes.
        let root = (b * b - 4.0 * a * c).max(0.0).sqrt();
        let x = -2.0 * a / (b + root.copysign(b));
        let slope = (b + 2.0 * c * x).abs().max(0.25 * b.abs());
        // For a parabola at its middle: 9/4 of the variance of a mean.
        let error = 1.5 * sigma / slope / x_sums[0].sqrt();
        Some(EchoEstimate { at: middle + half * x as f32, error: half * error as f32 })
    }
}

/// The coefficients of the best fit `a + b x + c x^2`, from the sums of `x^0` to `x^4` and of `x^0 y` to `x^2 y`.
fn parabola([n, x1, x2, x3, x4]: [f64; 5], [y0, y1, y2]: [f64; 3]) -> Option<[f64; 3]> {
    let moments = glam::DMat3::from_cols_array(&[n, x1, x2, x1, x2, x3, x2, x3, x4]);
    if moments.determinant() < 1e-9 * n * n * n {
        return None;
    }
    Some((moments.inverse() * glam::DVec3::new(y0, y1, y2)).to_array())
}

#[cfg(test)]
mod tests {
    use super::*;
    use cloud::cells::SonarView;

    fn layout(elevation: f32) -> Layout {
        Layout::default()
            .view(SonarView::Swath)
            .axes(vec![[0.0, elevation]])
            .bins(200)
            .bin_m(0.1)
            .noise_db(40.0)
            .threshold_db(vec![50.0; 200])
    }

    fn found(layout: &Layout, levels: &[f32], beside: &[f32], width: f32) -> Option<Sounding> {
        let rng = Rng::new(1, 0);
        let total = vec![1.0; beside.len()];
        let beside = Beside { moment: beside, total: &total, width: 1, beam: 0, received: (0, levels.len()) };
        let received = BeamLevels { beam: 0, levels, beside, width, resolution: 2.0, rng: &rng };
        sounding(layout, &received, &mut SoundingMemory::default())
    }

    #[test]
    fn a_short_echo_is_found_at_its_centre() {
        let mut levels = [40.0; 200];
        for (bin, level) in (98..103).zip([58.0, 70.0, 72.0, 70.0, 58.0]) {
            levels[bin] = level;
        }
        let layout = layout(-std::f32::consts::FRAC_PI_2);
        for beside in [&[][..], &[0.0; 200]] {
            let found = found(&layout, &levels, beside, 0.02).unwrap();
            assert!((found.range - 10.05).abs() < 1e-3 && found.quality > 0.35, "{found:?}");
            assert_eq!((found.cell, found.level_db), (100, 72.0));
        }
        assert!(found(&layout.clone().first_bin(110), &levels, &[], 0.02).is_none());
        // An echo from off axis is not the beam's own.
        assert!(found(&layout, &levels, &[0.05; 200], 0.02).is_none());
    }

    #[test]
    fn a_long_echo_is_found_where_it_crosses_the_axis() {
        // Stronger towards one end, as speckle may cause, and on a curve, as a flat bottom gives.
        let mut levels = [40.0; 200];
        let mut beside = [f32::NAN; 200];
        for bin in 84..130 {
            let at = bin as f32 + 0.5 - 104.0;
            levels[bin] = 80.0 + (bin - 84) as f32 / 3.0;
            beside[bin] = at * 2e-3 - at * at * 8e-6;
        }
        // An object in the water before it is weaker as a whole, though not in each bin.
        (levels[60], beside[60]) = (90.0, 0.01);
        let layout = layout(-0.4);
        let whole = found(&layout, &levels, &beside, 0.1).unwrap();
        assert!((whole.range - 10.4).abs() < 0.02 && whole.quality > 0.5, "{whole:?}");
        // The bottom reaches the axis beyond the last bin.
        let near = layout.bins(100).threshold_db(vec![50.0; 100]);
        assert_eq!(found(&near, &levels[..100], &beside[..100], 0.1).map(|it| it.cell), None);
    }

    #[test]
    fn the_better_a_range_is_known_the_higher_its_quality() {
        assert_eq!(quality(0.0), 1.0);
        assert_eq!(quality(2.5e-3), 0.5);
        assert!(quality(0.02) < 0.02);
    }
}
