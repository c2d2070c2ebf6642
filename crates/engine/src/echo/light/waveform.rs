//! The received signal of a beam over range, and the echoes in it.
//!
//! Every piece of surface that a beam hits returns its pulse; `W(R) = sum P_i exp(-(R - R_i)^2 / (2 sigma^2))` is the
//! received signal, with a Gaussian of the width of the beam's pulse (whatever its shape), P_i = `rho_eff / R_i^2`,
//! 1/m^2. An echo is a local maximum of W. Two equal pulses have one maximum up to a distance of 2 sigma.

use super::signal::BeamSignal;
use echocast_kernels::{light, signal};
use ground::lanes::LANES;

/// An echo: a maximum of the signal of a beam.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Peak {
    /// Range, m.
    pub range: f32,
    /// Power, 1/m^2.
    pub power: f32,
}

/// The shape of an echo.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct EchoShape {
    /// Full width at half maximum over that of the emitted pulse, of the Gaussian that bends as the echo does at its peak.
    pub width: f32,
    /// Area between the echo and an emitted pulse of the same height, over the area of that pulse.
    pub deviation: f32,
}

impl EchoShape {
    /// That of a plane at an angle, which lowers the peak by the factor `lowered`: a wider Gaussian.
    pub fn of_plane(lowered: f32) -> EchoShape {
        let width = lowered.recip();
        EchoShape { width, deviation: width - 1.0 }
    }
}

impl Default for EchoShape {
    /// That of the emitted pulse.
    fn default() -> Self {
        EchoShape { width: 1.0, deviation: 0.0 }
    }
}

/// Forms signals of pulses of one width.
#[derive(Clone, Debug)]
pub(crate) struct Waveform {
    /// Standard deviation of the pulse, m of range; 0: every range is a separate echo.
    sigma: f32,
    /// The pulse, bin by bin.
    pulse: [f32; 2 * Waveform::REACH_IN_BINS + 1],
    /// Ranges, m, and powers, 1/m^2, of some pulses of the signal.
    ranges: Vec<f32>,
    powers: Vec<f32>,
    /// The same as power bin by bin, and convolved with the pulse.
    parts: Vec<f32>,
    bins: Vec<f32>,
}

impl Default for Waveform {
    fn default() -> Self {
        let height = |bin: usize| {
            let x = (bin as f32 - Self::REACH_IN_BINS as f32) / Self::BINS_PER_SIGMA;
            (-0.5 * x * x).exp()
        };
        Waveform {
            sigma: 0.0,
            pulse: std::array::from_fn(height),
            ranges: Vec::with_capacity(Self::USUAL),
            powers: Vec::with_capacity(Self::USUAL),
            parts: Vec::with_capacity(Self::USUAL),
            bins: Vec::with_capacity(Self::USUAL),
        }
    }
}

impl Waveform {
    /// Pulses farther apart than this, in sigmas, do not affect each other: `exp(-5^2/2)` = 4e-6.
    const REACH: f32 = 5.0;
    /// Bins per sigma: 8 per full width at half maximum are 3.4.
    const BINS_PER_SIGMA: f32 = 3.5;
    const REACH_IN_BINS: usize = (Self::REACH * Self::BINS_PER_SIGMA) as usize;
    /// Pulses and bins of a signal for which there is memory from the start.
    const USUAL: usize = 1024;
    /// A signal longer than this, in bins, is cut in two; those of grazing beams are some hundred bins long.
    const MOST_BINS: usize = 1 << 14;
    /// Greatest span of the pulses of one piece of a signal, in sigmas.
    pub(crate) const LONGEST_PIECE: f32 = 64.0;

    pub(crate) fn set_sigma(&mut self, sigma: f64) {
        self.sigma = sigma as f32;
    }

    /// Standard deviation of the pulse, m of range.
    pub fn sigma(&self) -> f32 {
        self.sigma
    }

    /// Writes the maxima of a `received` signal, whose pieces are sorted, to `peaks`, nearest first.
    pub(crate) fn peaks(&mut self, received: &BeamSignal, peaks: &mut Vec<Peak>) {
        peaks.clear();
        let longest = self.sigma * Self::MOST_BINS as f32 / Self::BINS_PER_SIGMA;
        let mut rest = &received.pieces[..];
        while let [first, others @ ..] = rest {
            // Pieces so close together that they form one signal.
            let ([low, mut high], mut count) = (first.ends, 1);
            for piece in others {
                if piece.ends[0] - high > 2.0 * Self::REACH * self.sigma || piece.ends[1] - low > longest {
                    break;
                }
                high = high.max(piece.ends[1]);
                count += 1;
            }
            let (group, behind) = rest.split_at(count);
            rest = behind;
            self.ranges.clear();
            self.powers.clear();
            for piece in group {
                let [ranges, powers] = received.pulses_of(piece);
                self.ranges.extend_from_slice(ranges);
                self.powers.extend_from_slice(powers);
            }
            if let [range] = self.ranges[..] {
                peaks.push(Peak { range, power: self.powers[0] });
            } else if high - low <= 2.0 * self.sigma {
                // One maximum: log W is concave where the centres span no more than 2 sigma, since the variance of
                // centres within a span L is at most L^2/4.
                let (sum, moment) = group
                    .iter()
                    .fold((0.0, 0.0), |(sum, moment), piece| (sum + piece.power, moment + piece.power * piece.range));
                peaks.push(self.refine(moment / sum));
            } else {
                self.search([low, high], peaks);
            }
        }
    }

    /// The maximum of the signal of the pulses nearest to `range`, by Newton's method on log W.
    fn refine(&self, mut range: f32) -> Peak {
        if self.sigma == 0.0 {
            return Peak { range, power: self.powers.iter().sum() };
        }
        let (mut power, scale) = (0.0, 1.0 / self.sigma);
        for _ in 0..8 {
            let [sum, first, second] = signal::pull(&self.ranges, &self.powers, range, scale);
            power = sum;
            // In sigmas: (log W)' = E[x], (log W)'' = Var[x] - 1.
            let mean = first / sum;
            let bend = (1.0 - (second / sum - mean * mean)).max(0.1);
            let step = (mean / bend).clamp(-0.5, 0.5);
            range += step * self.sigma;
            // The next step would be its square.
            if step.abs() < 1e-3 {
                break;
            }
        }
        Peak { range, power }
    }

    /// The shape of the echo at `peak` of a `received` signal or, where that is empty, of the ranges and powers of what
    /// returns `directly`; `None` for a single pulse.
    pub(crate) fn shape(
        &mut self,
        received: &BeamSignal,
        directly: impl Iterator<Item = (f32, f32)>,
        peak: Peak,
    ) -> Option<EchoShape> {
        /// Samples on each side of the peak, and how many there are per sigma.
        const SAMPLES: i32 = 12;
        const PER_SIGMA: f32 = 4.0;
        self.ranges.clear();
        self.powers.clear();
        for piece in &received.pieces {
            let [ranges, powers] = received.pulses_of(piece);
            self.ranges.extend_from_slice(ranges);
            self.powers.extend_from_slice(powers);
        }
        if received.is_empty() {
            for (range, power) in directly {
                self.ranges.push(range);
                self.powers.push(power);
            }
        }
        if self.sigma == 0.0 || self.ranges.len() < 2 {
            return None;
        }
        let scale = 1.0 / self.sigma;
        let at = |range: f32| signal::pull(&self.ranges, &self.powers, range, scale);
        let [height, first, second] = at(peak.range);
        // As in `refine`: (log W)'' is -1 for the pulse alone, in sigmas.
        let mean = first / height;
        let bend = 1.0 - (second / height - mean * mean);
        let (mut between, mut area) = (0.0, 0.0);
        for sample in -SAMPLES..=SAMPLES {
            let x = sample as f32 / PER_SIGMA;
            let pulse = height * (-0.5 * x * x).exp();
            let [echo, ..] = at(peak.range + x * self.sigma);
            between += (echo - pulse).abs();
            area += pulse;
        }
        // Flat tops have no width of their own.
        Some(EchoShape { width: bend.max(0.01).sqrt().recip(), deviation: between / area })
    }

    /// [`Waveform::refine`] for signals side by side, each of parts that span no more than [`Waveform::NARROW`]:
    /// `signals` holds range and power of the parts. `peaks` starts as their mean range and the sum of their power.
    pub(crate) fn refine_narrow<'a>(
        &self,
        signals: impl Iterator<Item = [&'a [f32; LANES]; 2]> + Clone,
        [range, power]: [&mut [f32; LANES]; 2],
    ) {
        let scale = 1.0 / self.sigma;
        // With centres within one sigma two steps are accurate to 1e-4 of it.
        for _ in 0..2 {
            let (mut sum, mut first, mut second) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
            for [ranges, powers] in signals.clone() {
                light::add_terms(scale, ranges, powers, range, &mut sum, &mut first, &mut second);
            }
            light::step(self.sigma, &sum, &first, &second, range);
            *power = sum;
        }
    }

    /// Greatest span of the parts of a signal, in sigmas, that [`Waveform::refine_narrow`] accepts.
    pub(crate) const NARROW: f32 = 1.0;

    /// All maxima of the signal of the pulses, which are between two ranges, sampled finely enough to miss none.
    fn search(&mut self, [low, high]: [f32; 2], peaks: &mut Vec<Peak>) {
        let step = self.sigma / Self::BINS_PER_SIGMA;
        // Maxima are between the first and the last pulse; one bin beyond each shows that the signal falls there.
        let start = low - step;
        let count = ((high - start) / step) as usize + 3;
        self.parts.clear();
        self.parts.resize(count + 2 * Self::REACH_IN_BINS, 0.0);
        self.bins.resize(count, 0.0);
        let scale = 1.0 / step;
        for (range, power) in self.ranges.iter().zip(&self.powers) {
            // Divided among three bins so that its power, mean and variance stay.
            let place = (range - start) * scale + 0.5;
            let bin = place as usize;
            let off = place - bin as f32 - 0.5;
            let [before, here, behind] = [0.5 * off * (off - 1.0), 1.0 - off * off, 0.5 * off * (off + 1.0)];
            let parts = &mut self.parts[bin + Self::REACH_IN_BINS - 1..][..3];
            parts[0] += power * before;
            parts[1] += power * here;
            parts[2] += power * behind;
        }
        signal::convolve(&self.parts, &self.pulse, &mut self.bins);
        for bin in 1..count - 1 {
            let [left, here, right] = [self.bins[bin - 1], self.bins[bin], self.bins[bin + 1]];
            if !(here > left.max(0.0) && here >= right) {
                continue;
            }
            // Where the Gaussian through the three is highest.
            let [left, here, right] = [left, here, right].map(|value| value.max(f32::MIN_POSITIVE).ln());
            let bend = left - 2.0 * here + right;
            let top = if bend < 0.0 { 0.5 * (left - right) / bend } else { 0.0 };
            let peak = self.refine(start + (bin as f32 + top.clamp(-0.5, 0.5)) * step);
            // Two bins of a flat top lead to the same maximum.
            if peaks.last().is_none_or(|last| peak.range - last.range > 0.01 * self.sigma) {
                peaks.push(peak);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ground::units::SPEED_OF_LIGHT;

    /// Sigma, m, of a pulse of 5 ns: 2.12330 ns are 0.318275 m.
    fn sigma() -> f64 {
        5e-9 / (8.0 * 2f64.ln()).sqrt() * SPEED_OF_LIGHT / 2.0
    }

    fn waveform(sigma: f64) -> Waveform {
        Waveform { sigma: sigma as f32, ..Waveform::default() }
    }

    fn received(parts: &[[f32; 2]]) -> BeamSignal {
        let mut received = BeamSignal::default();
        (parts.iter().zip(0..)).for_each(|(&[range, power], source)| received.push(range, power, source));
        received.sort();
        received
    }

    fn peaks(parts: &[[f32; 2]]) -> Vec<Peak> {
        let mut peaks = Vec::new();
        waveform(sigma()).peaks(&received(parts), &mut peaks);
        peaks
    }

    #[test]
    fn a_lone_part_is_its_echo() {
        assert_eq!(peaks(&[[7.0, 0.25]]), [Peak { range: 7.0, power: 0.25 }]);
        assert_eq!(peaks(&[]), []);
    }

    #[test]
    fn without_a_pulse_every_range_is_an_echo() {
        let mut found = Vec::new();
        waveform(0.0).peaks(&received(&[[3.5, 0.5], [3.0, 0.5], [3.0, 0.5]]), &mut found);
        assert_eq!(found, [Peak { range: 3.0, power: 1.0 }, Peak { range: 3.5, power: 0.5 }]);
    }

    /// Amplitudes 1 and 0.5 at 0 and dR: position and height of the maxima; values computed with scipy.
    #[test]
    fn two_echoes_of_different_strength() {
        let at = 20.0;
        let found = |apart: f32| peaks(&[[at, 1.0], [at + apart, 0.5]]);
        for (apart, range, power) in [(0.6, 0.067_057, Some(1.101_11)), (0.65, 0.051_824, None)] {
            let found = found(apart);
            assert_eq!(found.len(), 1, "{found:?}");
            assert!((found[0].range - at - range).abs() < 3e-5, "{found:?}");
            assert!(power.is_none_or(|power: f32| (found[0].power - power).abs() < 2e-5), "{found:?}");
        }
        let [near, far] = found(1.0)[..] else { panic!("two echoes 1 m apart") };
        assert!((near.range - at - 0.003_718_6).abs() < 1e-5 && (near.power - 1.003_658).abs() < 1e-5, "{near:?}");
        assert!((far.range - at - 0.983_349).abs() < 2e-5 && (far.power - 0.507_772).abs() < 1e-5, "{far:?}");
        let [near, far] = found(2.0)[..] else { panic!("two echoes 2 m apart") };
        assert!((near.range - at).abs() < 6e-6 && (far.range - at - 2.0).abs() < 6e-6, "{near:?} {far:?}");
    }

    /// Two equal Gaussians have two maxima beyond 2 sigma = 0.636551 m.
    #[test]
    fn equal_echoes_separate_beyond_two_sigmas() {
        assert!((2.0 * sigma() - 0.636_551).abs() < 1e-6);
        for (apart, echoes) in [(0.6, 1), (0.63, 1), (0.65, 2), (0.7, 2)] {
            let found = peaks(&[[5.0, 0.3], [5.0 + apart, 0.3]]);
            assert_eq!(found.len(), echoes, "{apart}: {found:?}");
        }
    }

    /// A row of equal parts is a pulse convolved with a box: its middle, and its power by the error function.
    #[test]
    fn a_tilted_surface_echoes_from_its_middle() {
        let parts: Vec<[f32; 2]> = (0..41).map(|i| [30.0 + 0.02 * i as f32, 1.0 / 41.0]).collect();
        let found = peaks(&parts);
        assert!(found.len() == 1 && (found[0].range - 30.4).abs() < 1e-3, "{found:?}");
        let half = 0.41 / (sigma() * 2f64.sqrt());
        let expected = (std::f64::consts::PI).sqrt() / 2.0 * ground::math::erf(half) / half;
        assert!((f64::from(found[0].power) / expected - 1.0).abs() < 1e-3, "{found:?} {expected}");
    }

    /// The search and Newton's method alone find the same in a signal of one maximum.
    #[test]
    fn sampling_finds_what_newton_finds() {
        let mut waveform = waveform(sigma());
        (waveform.ranges, waveform.powers) = (vec![10.0, 10.2, 10.35, 10.6], vec![0.3, 0.9, 0.2, 0.4]);
        let mut sampled = Vec::new();
        waveform.search([10.0, 10.6], &mut sampled);
        assert_eq!(sampled.len(), 1);
        let peak = waveform.refine(10.3);
        assert!((sampled[0].range - peak.range).abs() < 3e-5 && (sampled[0].power / peak.power - 1.0).abs() < 1e-5);
    }

    /// Narrow signals side by side give the same as one by one.
    #[test]
    fn lanes_find_what_one_signal_finds() {
        let waveform = waveform(sigma());
        let count = 19;
        let part = |lane: usize, i: usize| {
            let turn = (lane * 31 + i * 17) as f32;
            let span = Waveform::NARROW * waveform.sigma() * lane as f32 / LANES as f32;
            [20.0 + span * (0.5 + 0.5 * turn.sin()), 1.0 + 0.9 * (turn * 1.7).cos()]
        };
        let column = |which: usize| -> Vec<[f32; LANES]> {
            (0..count).map(|i| std::array::from_fn(|lane| part(lane, i)[which])).collect()
        };
        let (ranges, powers) = (column(0), column(1));
        let all = |lane: usize| (0..count).map(move |i| part(lane, i));
        let mut power: [f32; LANES] = std::array::from_fn(|lane| all(lane).map(|[_, power]| power).sum());
        let mut range =
            std::array::from_fn(|lane| all(lane).map(|[range, power]| range * power).sum::<f32>() / power[lane]);
        let signals = ranges.iter().zip(&powers).map(|(ranges, powers)| [ranges, powers]);
        waveform.refine_narrow(signals, [&mut range, &mut power]);
        for lane in 0..LANES {
            let parts: Vec<[f32; 2]> = all(lane).collect();
            let expected = peaks(&parts)[0];
            assert!((range[lane] - expected.range).abs() < 2e-4 * waveform.sigma(), "{lane}: {}", range[lane]);
            assert!((power[lane] / expected.power - 1.0).abs() < 1e-5, "{lane}");
        }
    }

    /// A thousand parts over a kilometre: no more echoes than parts, in order.
    #[test]
    fn long_signals_are_searched_in_pieces() {
        let parts: Vec<[f32; 2]> = (0..1000).map(|i| [1.0 + i as f32 * 1.7, 1.0]).collect();
        let found = peaks(&parts);
        assert_eq!(found.len(), 1000);
        assert!(found.windows(2).all(|pair| pair[0].range < pair[1].range));
    }
}
