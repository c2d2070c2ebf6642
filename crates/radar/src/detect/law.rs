//! The law of constant-false-alarm-rate detection: by which factor a cell must exceed the level of its reference cells,
//! so that noise does so with a given probability, and with which probability targets do.
//!
//! A cell holds the power of `looks` channels, added without their phases. Thermal noise makes it gamma distributed with
//! this shape (exponential for one channel); powers are in units of the noise of one channel. With the level Z of the
//! reference cells, of density f, and the probability T(y) that a cell exceeds y,
//!
//! ```text
//! P(cell > factor Z) = integral of T(factor z) f(z) dz.
//! ```
//!
//! The integral is a sum over equal steps of ln z, which converges faster than any power of the step because all these
//! functions are analytic (Trefethen and Weideman 2014, "The exponentially convergent trapezoidal rule"). It needs no
//! formula for each detector, and agrees with those that are known: Gandhi and Kassam 1988, "Analysis of CFAR processors
//! in nonhomogeneous background", whose results are the check values of the tests.

/// Level of the noise around a cell, estimated from reference cells. Numbers of cells need not be whole: of cells whose
/// noise is alike, fewer tell as much.
#[derive(Clone, Debug, PartialEq)]
pub enum ReferenceLevel {
    /// Mean of so many cells, above 0.
    Mean(f64),
    /// One of so many cells in the order of their powers.
    Ranked {
        /// Number of cells, 1 or more.
        cells: f64,
        /// Which of them: 1 is the weakest.
        rank: f64,
    },
    /// The greatest of several levels, one or more, of different cells.
    Greatest(Vec<ReferenceLevel>),
    /// The least of them.
    Least(Vec<ReferenceLevel>),
}

/// Distribution of a level at one place: natural logarithms, which hold the tails however thin they are.
#[derive(Clone, Copy)]
struct Tails {
    /// Probability to be below.
    below: f64,
    /// Probability to be above.
    above: f64,
    /// Density.
    density: f64,
}

impl Tails {
    /// Of the greater of two independent levels.
    fn greater(self, other: Tails) -> Tails {
        Tails {
            below: self.below + other.below,
            above: ln_add(self.above, self.below + other.above),
            density: ln_add(self.density + other.below, other.density + self.below),
        }
    }

    /// Of the negative level.
    fn flipped(self) -> Tails {
        Tails { below: self.above, above: self.below, density: self.density }
    }

    /// Of the mean of `cells` cells at `z`: their sum is gamma distributed.
    fn of_mean(looks: usize, cells: f64, z: f64) -> Tails {
        let shape = looks as f64 * cells;
        let (below, above) = ln_gamma_tails(shape, cells * z);
        Tails { below, above, density: shape * (cells * z).ln() - cells * z - ln_gamma(shape) - z.ln() }
    }

    /// Of the cell at `rank` among `cells` with the distribution `self`. The probability to be below the cell at a rank is
    /// beta distributed (David and Nagaraja 2003, "Order statistics", 2.1).
    fn ranked(self, cells: f64, rank: f64) -> Tails {
        let (a, b) = (rank, cells - rank + 1.0);
        let (below, above) = ln_beta_tails(a, b, self.below, self.above);
        Tails { below, above, density: self.ranked_density(a, b) }
    }

    /// Logarithm of the density of that.
    fn ranked_density(self, a: f64, b: f64) -> f64 {
        ln_gamma(a + b) - ln_gamma(a) - ln_gamma(b)
            + times(a - 1.0, self.below)
            + times(b - 1.0, self.above)
            + self.density
    }
}

impl ReferenceLevel {
    /// Its distribution at `z`.
    fn tails(&self, looks: usize, z: f64) -> Tails {
        let never = Tails { below: 0.0, above: f64::NEG_INFINITY, density: f64::NEG_INFINITY };
        match self {
            ReferenceLevel::Mean(cells) => Tails::of_mean(looks, *cells, z),
            ReferenceLevel::Ranked { cells, rank } => Tails::of_mean(looks, 1.0, z).ranked(*cells, *rank),
            ReferenceLevel::Greatest(levels) => {
                levels.iter().map(|level| level.tails(looks, z)).fold(never, Tails::greater)
            }
            ReferenceLevel::Least(levels) => {
                levels.iter().map(|level| level.tails(looks, z).flipped()).fold(never, Tails::greater).flipped()
            }
        }
    }

    /// Logarithm of its density at `z`.
    fn density(&self, looks: usize, z: f64) -> f64 {
        match self {
            ReferenceLevel::Ranked { cells, rank } => {
                Tails::of_mean(looks, 1.0, z).ranked_density(*rank, cells - rank + 1.0)
            }
            _ => self.tails(looks, z).density,
        }
    }

    /// Number of cells whose powers are added, the most of any part.
    fn most(&self) -> f64 {
        match self {
            ReferenceLevel::Mean(cells) | ReferenceLevel::Ranked { cells, .. } => *cells,
            ReferenceLevel::Greatest(levels) | ReferenceLevel::Least(levels) => {
                levels.iter().map(ReferenceLevel::most).fold(1.0, f64::max)
            }
        }
    }
}

/// The law of one detector.
#[derive(Clone, Debug)]
pub struct CfarLaw {
    looks: usize,
    /// Levels, and how probable they are.
    nodes: Vec<[f64; 2]>,
}

impl CfarLaw {
    /// Of cells that hold the power of `looks` channels, 1 or more, compared with `level`.
    pub fn new(looks: usize, level: &ReferenceLevel) -> Self {
        /// Steps across the width of the distribution.
        const FINE: f64 = 4.0;
        /// Levels that are e^-80 as probable as others count for nothing: probabilities down to 1e-15 are exact to
        /// 1e-19 of them.
        const DEPTH: f64 = 80.0;
        // ln Z is about as wide as the logarithm of a gamma distributed number of this shape: 1 / sqrt(shape).
        let step = (1.0 / (FINE * (looks as f64 * level.most()).sqrt())).min(0.2);
        let weight = |node: i64| {
            let z = (looks as f64) * (step * node as f64).exp();
            (z, level.density(looks, z) + z.ln())
        };
        let mut mode = 0;
        for direction in [1, -1] {
            while weight(mode + direction).1 > weight(mode).1 {
                mode += direction;
            }
        }
        let limit = weight(mode).1 - DEPTH;
        let side = |direction: i64| {
            (i64::from(direction > 0)..)
                .map(move |far| weight(mode + direction * far))
                .take_while(move |node| node.1 > limit)
        };
        // From the least level to the greatest.
        let mut nodes: Vec<_> = side(-1).collect();
        nodes.reverse();
        nodes.extend(side(1));
        CfarLaw { looks, nodes: nodes.into_iter().map(|(z, weight)| [z, step * weight.exp()]).collect() }
    }

    /// Probability that a cell of noise exceeds `factor`, above 0, times the level.
    pub fn false_alarm(&self, factor: f64) -> f64 {
        self.detection(factor, 0.0)
    }

    /// Probability that a cell with a target exceeds `factor` times the level. The target's power is exponentially
    /// distributed from frame to frame (Swerling 1) and common to all channels; its mean is `snr` times the noise in
    /// each.
    pub fn detection(&self, factor: f64, snr: f64) -> f64 {
        self.nodes.iter().map(|[z, weight]| weight * tail(self.looks, snr, factor * z)).sum()
    }

    /// The factor that noise exceeds with the probability `pfa`, above 0 and below 1.
    pub fn factor(&self, pfa: f64) -> f64 {
        let off = |ln_factor: f64| self.false_alarm(ln_factor.exp()).ln() - pfa.ln();
        let (mut low, mut high) = (0.0, 1.0);
        while off(low) < 0.0 && low > -700.0 {
            (low, high) = (low - 1.0, low);
        }
        while off(high) > 0.0 && high < 700.0 {
            (low, high) = (high, high + 1.0);
        }
        // Chords of the nearly straight curve between the ends, with a bisection where a chord does not halve them.
        let (mut at_low, mut at_high) = (off(low), off(high));
        for _ in 0..100 {
            let width = high - low;
            if width < 1e-12 {
                break;
            }
            for chord in [true, false] {
                let middle = if chord {
                    // A little towards the middle: otherwise one end would never move.
                    (low + width * at_low / (at_low - at_high)).clamp(low + 1e-3 * width, high - 1e-3 * width)
                } else if high - low > 0.5 * width {
                    0.5 * (low + high)
                } else {
                    continue;
                };
                let at = off(middle);
                if at > 0.0 {
                    (low, at_low) = (middle, at);
                } else {
                    (high, at_high) = (middle, at);
                }
            }
        }
        (0.5 * (low + high)).exp()
    }
}

/// Probability that the powers of `looks` channels, noise of mean 1 and a Swerling 1 target of `snr` in each, exceed
/// `x` together.
///
/// In the direction of the target's channel vector, the power is exponentially distributed with mean b = 1 + looks snr;
/// in all others it is noise. Their convolution is
/// `Q(looks - 1, x) + e^(-x/b) (1 - 1/b)^(1 - looks) P(looks - 1, x (1 - 1/b))` with the incomplete gamma functions P
/// and Q (DiFranco and Rubin 1968, "Radar detection", 11.4).
fn tail(looks: usize, snr: f64, x: f64) -> f64 {
    let gain = looks as f64 * snr;
    if looks == 1 {
        return (-x / (1.0 + snr)).exp();
    }
    if gain <= 0.0 {
        return gamma_above(looks, x);
    }
    let (others, share) = (looks - 1, gain / (1.0 + gain));
    let (below, _) = ln_gamma_tails(others as f64, share * x);
    let target = below - x / (1.0 + gain) - others as f64 * share.ln();
    (gamma_above(others, x) + target.exp()).min(1.0)
}

/// The regularised upper incomplete gamma function `Q(n, x)`: `e^-x (1 + x + x^2 / 2! ... x^(n-1) / (n-1)!)` (Abramowitz
/// and Stegun 1964, 6.5.13).
fn gamma_above(n: usize, x: f64) -> f64 {
    if x < n as f64 {
        return ln_gamma_tails(n as f64, x).1.exp();
    }
    let mut term = ((n - 1) as f64 * x.ln() - x - ln_gamma(n as f64)).exp();
    let mut sum = term;
    for power in (1..n).rev() {
        term *= power as f64 / x;
        sum += term;
    }
    sum
}

/// Natural logarithms of the regularised incomplete gamma functions `P(a, x)` and `Q(a, x)`: the probabilities that a
/// gamma distributed number of shape `a` is below and above `x` (Abramowitz and Stegun 1964, 6.5.29 and 6.5.31).
fn ln_gamma_tails(a: f64, x: f64) -> (f64, f64) {
    if x <= 0.0 {
        return (f64::NEG_INFINITY, 0.0);
    }
    let front = a * x.ln() - x - ln_gamma(a);
    if x < a + 1.0 {
        let (mut term, mut sum, mut n) = (1.0 / a, 1.0 / a, a);
        while term > 1e-17 * sum {
            n += 1.0;
            term *= x / n;
            sum += term;
        }
        let below = (front + sum.ln()).min(0.0);
        return (below, ln_rest(below));
    }
    // Lentz's evaluation of the continued fraction.
    let (mut b, mut c) = (x + 1.0 - a, f64::INFINITY);
    let mut d = 1.0 / b;
    let mut fraction = d;
    for n in 1..100_000 {
        let n = f64::from(n);
        let factor = -n * (n - a);
        b += 2.0;
        d = 1.0 / (factor * d + b);
        c = b + factor / c;
        fraction *= c * d;
        if (c * d - 1.0).abs() < 1e-15 {
            break;
        }
    }
    let above = (front + fraction.ln()).min(0.0);
    (ln_rest(above), above)
}

/// `ln(1 - e^x)` for x up to 0.
fn ln_rest(x: f64) -> f64 {
    if x > -std::f64::consts::LN_2 { (-x.exp_m1()).ln() } else { (-x.exp()).ln_1p() }
}

/// `ln(e^a + e^b)`.
fn ln_add(a: f64, b: f64) -> f64 {
    let (most, least) = if a > b { (a, b) } else { (b, a) };
    if least == f64::NEG_INFINITY { most } else { most + (least - most).exp().ln_1p() }
}

/// `count` times `x`, 0 for a count of 0 even if x is infinite.
fn times(count: f64, x: f64) -> f64 {
    if count == 0.0 { 0.0 } else { count * x }
}

/// Natural logarithms of the probabilities that a beta distributed number of shapes `a` and `b` is below and above the
/// one of which `below` and `above` are the logarithms of it and of what it is less than 1 (Abramowitz and Stegun 1964,
/// 26.5.8).
fn ln_beta_tails(a: f64, b: f64, below: f64, above: f64) -> (f64, f64) {
    if below == f64::NEG_INFINITY || above == f64::NEG_INFINITY {
        return (below, above);
    }
    let x = below.exp();
    if x > (a + 1.0) / (a + b + 2.0) {
        let (above, below) = ln_beta_tails_near(b, a, above, below);
        return (below, above);
    }
    ln_beta_tails_near(a, b, below, above)
}

/// [`ln_beta_tails`] below the mean, where the continued fraction converges fast; by Lentz's evaluation.
fn ln_beta_tails_near(a: f64, b: f64, below: f64, above: f64) -> (f64, f64) {
    let x = below.exp();
    let front = ln_gamma(a + b) - ln_gamma(a + 1.0) - ln_gamma(b) + a * below + b * above;
    let (mut c, mut d) = (1.0, 1.0 / (1.0 - (a + b) * x / (a + 1.0)));
    let mut fraction = d;
    for m in 1..10_000 {
        let m = f64::from(m);
        let even = m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m));
        let odd = -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0));
        for factor in [even, odd] {
            d = 1.0 / (1.0 + factor * d);
            c = 1.0 + factor / c;
            fraction *= c * d;
        }
        if (c * d - 1.0).abs() < 1e-15 {
            break;
        }
    }
    let near = (front + fraction.ln()).min(0.0);
    (near, ln_rest(near))
}

/// Natural logarithm of the gamma function of x above 0, by Stirling's series beyond 12 (Abramowitz and Stegun 1964,
/// 6.1.41; the first term left out is below 1e-14).
fn ln_gamma(mut x: f64) -> f64 {
    let mut product = 1.0;
    while x < 12.0 {
        product *= x;
        x += 1.0;
    }
    let y = 1.0 / (x * x);
    let series = (1.0 / 12.0 - y * (1.0 / 360.0 - y * (1.0 / 1260.0 - y * (1.0 / 1680.0 - y * (1.0 / 1188.0))))) / x;
    (x - 0.5) * x.ln() - x + 0.5 * std::f64::consts::TAU.ln() + series - f64::ln(product)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(found: f64, expected: f64, relative: f64) {
        assert!((found / expected - 1.0).abs() < relative, "{found}, not {expected}");
    }

    fn ranked(cells: u32, rank: u32) -> ReferenceLevel {
        ReferenceLevel::Ranked { cells: cells.into(), rank: rank.into() }
    }

    fn factor(level: &ReferenceLevel, pfa: f64) -> f64 {
        CfarLaw::new(1, level).factor(pfa)
    }

    fn halves(make: fn(Vec<ReferenceLevel>) -> ReferenceLevel, cells: [f64; 2]) -> ReferenceLevel {
        make(cells.map(ReferenceLevel::Mean).to_vec())
    }

    #[test]
    fn factors_are_those_of_the_literature() {
        // Check values: `N (Pfa^(-1/N) - 1)` for means, the product of `(N - i) / (N - i + factor)` for ranks.
        for (level, pfa, expected) in [
            (ReferenceLevel::Mean(16.0), 1e-4, 12.45247),
            (ReferenceLevel::Mean(32.0), 1e-6, 17.27765),
            (ReferenceLevel::Mean(24.0), 1e-4, 11.22718),
            (ranked(24, 18), 1e-4, 9.340805),
            (ranked(32, 24), 1e-6, 14.39852),
            (ranked(16, 12), 1e-4, 11.08019),
        ] {
            close(factor(&level, pfa), expected, 1e-6);
        }
        let db = |factor: f64| 10.0 * factor.log10();
        let mean = factor(&ReferenceLevel::Mean(16.0), 1e-4);
        close(db(mean), 10.95256, 1e-6);
        close(db(mean / -1e-4f64.ln()), 1.309798, 1e-6);
        close(db(factor(&ranked(24, 18), 1e-4)), 9.703843, 1e-6);
    }

    #[test]
    fn detection_is_that_of_the_literature() {
        let snr = 10f64.powf(1.5);
        for (level, expected) in [(ReferenceLevel::Mean(16.0), 0.6857591), (ranked(24, 18), 0.6872061)] {
            let law = CfarLaw::new(1, &level);
            close(law.detection(law.factor(1e-4), snr), expected, 2e-7);
        }
        // So many cells that the noise is known: Pfa^(1 / (1 + SNR)).
        let law = CfarLaw::new(1, &ReferenceLevel::Mean(1_000_000.0));
        close(law.detection(law.factor(1e-4), snr), 0.7540259, 1e-5);
    }

    #[test]
    fn closed_forms_hold_far_into_the_tails() {
        for pfa in [0.3, 1e-3, 1e-9, 1e-13] {
            for n in [1.0, 2.0, 16.0, 300.0] {
                close(factor(&ReferenceLevel::Mean(n), pfa), n * (pfa.powf(-1.0 / n) - 1.0), 1e-9);
            }
            for (cells, rank) in [(1, 1), (24, 1), (24, 24), (100, 75)] {
                let law = CfarLaw::new(1, &ranked(cells, rank));
                let factor = law.factor(pfa);
                let product: f64 = (0..rank).map(|i| f64::from(cells - i)).map(|left| left / (left + factor)).product();
                close(product, pfa, 1e-8);
            }
        }
    }

    /// The mean of several channels exceeds a mean of N cells with the probability of a beta distributed share:
    /// `sum over j < M of C(NM + j - 1, j) t^j / (1 + t)^(NM + j)`, t = factor / N.
    #[test]
    fn sums_over_channels_follow_the_beta_law() {
        for (looks, cells) in [(4, 16.0), (12, 24.0), (192, 8.0)] {
            let law = CfarLaw::new(looks, &ReferenceLevel::Mean(cells));
            for pfa in [1e-2, 1e-6] {
                let t = law.factor(pfa) / cells;
                let shape = looks as f64 * cells;
                let mut term = -shape * t.ln_1p();
                let mut sum = term.exp();
                for j in 1..looks {
                    term += ((shape + j as f64 - 1.0) / j as f64 * t / (1.0 + t)).ln();
                    sum += term.exp();
                }
                close(sum, pfa, 1e-8);
            }
        }
    }

    /// Whatever the greatest of two levels does more often than one of them, the least does more seldom.
    #[test]
    fn greatest_and_least_add_up_to_both_halves() {
        for looks in [1, 4, 12] {
            for cells in [[8.0, 8.0], [3.0, 16.0]] {
                let [first, second] = cells.map(|cells| CfarLaw::new(looks, &ReferenceLevel::Mean(cells)));
                let greatest = CfarLaw::new(looks, &halves(ReferenceLevel::Greatest, cells));
                let least = CfarLaw::new(looks, &halves(ReferenceLevel::Least, cells));
                for factor in [0.5, 2.0, 12.0] {
                    let both = first.false_alarm(factor) + second.false_alarm(factor);
                    close(greatest.false_alarm(factor) + least.false_alarm(factor), both, 1e-9);
                    assert!(greatest.false_alarm(factor) < least.false_alarm(factor));
                }
            }
        }
    }

    /// The binomial sum is the definition.
    #[test]
    fn ranks_are_below_with_the_binomial_probability() {
        for (cells, rank) in [(1u32, 1u32), (7, 3), (24, 18), (40, 40)] {
            for x in [1e-6, 0.01, 0.3, 0.74, 0.99, 1.0 - 1e-9f64] {
                let choose = |of: u32| (1..=of).map(|i| f64::from(cells - of + i) / f64::from(i)).product::<f64>();
                let term = |of: u32| choose(of) * x.powi(of as i32) * (1.0 - x).powi((cells - of) as i32);
                let (a, b) = (f64::from(rank), f64::from(cells - rank + 1));
                let (below, above) = ln_beta_tails(a, b, x.ln(), (-x).ln_1p());
                close(below.exp(), (rank..=cells).map(term).sum(), 1e-9);
                close(above.exp(), (0..rank).map(term).sum(), 1e-9);
            }
        }
    }

    #[test]
    fn probabilities_are_bounded_and_fall_with_the_factor() {
        let of_ranks = ReferenceLevel::Greatest(vec![ranked(16, 12), ranked(10, 8)]);
        for level in
            [ReferenceLevel::Mean(1.0), ranked(1000, 1000), halves(ReferenceLevel::Least, [1.0, 4.0]), of_ranks]
        {
            for looks in [1, 2, 192] {
                let law = CfarLaw::new(looks, &level);
                close(law.false_alarm(1e-9), 1.0, 1e-6);
                let mut before = [1.0 + 1e-9; 2];
                for factor in [0.01, 0.1, 0.5, 1.0, 1.5, 3.0, 20.0] {
                    let now = [law.false_alarm(factor), law.detection(factor, 0.5)];
                    assert!(now[0] < now[1] + 1e-12 && now[0] <= before[0] && now[1] <= before[1], "{now:?}");
                    before = now;
                }
            }
        }
    }
}
