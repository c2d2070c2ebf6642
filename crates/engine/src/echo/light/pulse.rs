//! The light pulse of a beam, and the echo of a medium.

use echocast_kernels::air;
use ground::lanes::LANES;
use ground::math::erf;
use ground::units::SPEED_OF_LIGHT;
use serde::{Deserialize, Serialize};
use std::f64::consts::{FRAC_PI_2, LN_2, PI, SQRT_2};

/// Power of a pulse over time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum PulseShape {
    /// A Gaussian.
    #[default]
    Gaussian,
    /// One lobe of a squared sine, as in LiDAR_fog_sim (Hahner et al. 2021).
    Sin2,
    /// On and off.
    Rectangular,
}

/// A pulse in metres of range: one of `t` s is `c t / 2` m long.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Pulse {
    shape: PulseShape,
    /// Full width at half maximum, m of range.
    pub width: f64,
}

impl Pulse {
    /// `fwhm_ns`: full width at half maximum, ns.
    pub fn new(shape: PulseShape, fwhm_ns: f64) -> Pulse {
        Pulse { shape, width: fwhm_ns * 1e-9 * SPEED_OF_LIGHT / 2.0 }
    }

    /// Power at `distance` m from its centre, where it is 1.
    fn power(self, distance: f64) -> f64 {
        let x = distance.abs() / self.width;
        match self.shape {
            PulseShape::Gaussian => (-4.0 * LN_2 * x * x).exp(),
            PulseShape::Sin2 if x < 1.0 => (FRAC_PI_2 * x).cos().powi(2),
            // Its edges, where integrals begin and end, count despite rounding.
            PulseShape::Rectangular if x < 0.5 + 1e-9 => 1.0,
            PulseShape::Sin2 | PulseShape::Rectangular => 0.0,
        }
    }

    /// Half of the length outside which its power is negligible, m.
    fn reach(self) -> f64 {
        match self.shape {
            PulseShape::Gaussian => 2.2 * self.width,
            PulseShape::Sin2 => self.width,
            PulseShape::Rectangular => 0.5 * self.width,
        }
    }

    /// Standard deviation of the Gaussian of the same width at half maximum, m of range.
    pub fn sigma(self) -> f64 {
        self.width / (2.0 * SQRT_2 * LN_2.sqrt())
    }

    /// Distance below which echoes have one peak, m: 2 sigma, as for two equal Gaussians.
    pub(crate) fn merging_distance(self) -> f64 {
        2.0 * self.sigma()
    }

    /// The echo of a medium from `from` to `to` m whose power at a range is `density(range)`, 1/m^2 per unit of
    /// backscatter: the peak of `J(R) = int p(2 (R - r) / c) density(r) dr`. The density falls beyond `falls_from`.
    pub(crate) fn peak(self, [from, to]: [f64; 2], falls_from: f64, density: impl Fn(f64) -> f64) -> SoftPeak {
        let from = from.max(1e-2);
        // Simpson's rule in the logarithm of range, with an odd number of `points`: near the sensor density falls
        // steeply.
        let integral = |range: f64, [low, high]: [f64; 2], points: usize| {
            if low >= high {
                return 0.0;
            }
            let step = (high / low).ln() / (points - 1) as f64;
            let sum: f64 = (0..points)
                .map(|i| {
                    let r = low * (step * i as f64).exp();
                    let weight = match i {
                        0 => 1.0,
                        i if i == points - 1 => 1.0,
                        i => 2.0 + 2.0 * (i % 2) as f64,
                    };
                    weight * self.power(range - r) * density(r) * r
                })
                .sum();
            sum * step / 3.0
        };
        // In two pieces: density may have a kink where it begins to fall.
        let received = |range: f64, points: usize| {
            let (low, high) = ((range - self.reach()).max(from), (range + self.reach()).min(to));
            let bend = falls_from.max(low).min(high);
            integral(range, [low, bend], points) + integral(range, [bend, high], points)
        };
        // The peak is within a pulse of where the density falls: search first in steps, then by golden section.
        const COARSE: usize = 41;
        const FINE: usize = 161;
        let (mut low, mut high) = (from, to.min(falls_from.max(from) + 3.0 * self.width));
        let steps = 24;
        let at = |low: f64, high: f64, i: i32| low + (high - low) * f64::from(i) / f64::from(steps);
        let mut best = (0, 0.0);
        for i in 0..=steps {
            let power = received(at(low, high, i), COARSE);
            if power > best.1 {
                best = (i, power);
            }
        }
        (low, high) = (at(low, high, (best.0 - 1).max(0)), at(low, high, (best.0 + 1).min(steps)));
        let golden = (5f64.sqrt() - 1.0) / 2.0;
        let (mut a, mut b) = (high - golden * (high - low), low + golden * (high - low));
        let (mut fa, mut fb) = (received(a, FINE), received(b, FINE));
        // Of a pulse shorter than ranges are resolved, there is nothing finer to find.
        let fine = (1e-4 * self.width).max(1e-14 * high);
        while high - low > fine {
            if fa > fb {
                (high, b, fb) = (b, a, fa);
                a = high - golden * (high - low);
                fa = received(a, FINE);
            } else {
                (low, a, fa) = (a, b, fb);
                b = low + golden * (high - low);
                fb = received(b, FINE);
            }
        }
        let range = (low + high) / 2.0;
        let height = received(range, FINE);
        // From the values a sigma to either side, as for a parabola.
        let beside = (received(range - self.sigma(), FINE) + received(range + self.sigma(), FINE)) / 2.0;
        let width = self.sigma() / (2.0 * (1.0 - beside / height).max(1e-3)).sqrt();
        SoftPeak { range, height, width }
    }
}

/// The peak of the echo of a medium.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SoftPeak {
    /// m.
    pub range: f64,
    /// `J`, 1/m.
    pub height: f64,
    /// `L` of `J (1 - (R - range)^2 / (2 L^2))` around it, m.
    pub width: f64,
}

impl SoftPeak {
    /// Standard deviation of its range, m, if each pulse-long part of the echo, `sigma` m, fluctuates by the fraction
    /// `fluctuation` of the peak: the slope of that, `fluctuation J / sigma`, over the curvature `J / L^2`; at most the
    /// width of the echo.
    pub(crate) fn wandering(&self, fluctuation: f64, sigma: f64) -> f64 {
        (fluctuation * self.width * self.width / sigma).min(self.width)
    }
}

/// The echo of a medium with a sharp face, far from the sensor: power falls by `e^(-kappa r)` behind its face, with
/// `kappa` = two extinctions plus spreading. In units of the pulse's sigma, with `u = kappa sigma`: how far behind the
/// face the peak is, and its height relative to the power at the face.
///
/// `J(x) = sqrt(pi/2) exp(u^2/2 - u x) erfc((u - x) / sqrt 2)`: a Gaussian convolved with a falling exponential; the
/// peak is found by bisection once for a row of `u` and interpolated from it linearly in `sqrt u`.
pub(crate) struct FaceEcho {
    rows: [[f32; 2]; air::FACES],
}

impl FaceEcho {
    /// Greatest `u` of the rows; denser media return an echo like a wall.
    const MOST: f64 = 16.0;

    pub fn get() -> &'static FaceEcho {
        static FACE: std::sync::OnceLock<FaceEcho> = std::sync::OnceLock::new();
        FACE.get_or_init(|| {
            let rows = std::array::from_fn(|row| {
                // Without decay there is no peak: it recedes, ever more slowly.
                let u = (Self::MOST * (row as f64 / (air::FACES - 1) as f64).powi(2)).max(1e-3);
                let height = |x: f64| (PI / 2.0).sqrt() * scaled_erfc((u - x) / SQRT_2) * (-x * x / 2.0).exp();
                // J'(x) = 0 where u J = exp(-x^2/2): the height is exp(-x^2/2) / u there. Bisection: u J - exp(-x^2/2)
                // rises from below 0.
                let (mut low, mut high) = (-1.0, 6.0);
                for _ in 0..60 {
                    let x = (low + high) / 2.0;
                    if u * height(x) < (-x * x / 2.0).exp() { low = x } else { high = x }
                }
                [low as f32, height(low) as f32]
            });
            FaceEcho { rows }
        })
    }

    /// Distances of the peaks behind the first `count` faces, which are at `from` m, and their heights, 1/m: of pulses
    /// of `sigma` m in a medium with an `extinction`, 1/m, where light spreads by the square of range and
    /// `near_range_2`, m^2.
    pub fn peaks(
        &self,
        [sigma, extinction, near_range_2]: [f32; 3],
        from: &[f32; LANES],
        count: usize,
        [behind, height]: [&mut [f32; LANES]; 2],
    ) {
        air::peaks(&self.rows, Self::MOST as f32, sigma, extinction, near_range_2, from, count, behind, height);
    }
}

/// `exp(z^2) erfc(z)`: by the error function's series where that is accurate enough, else by its continued fraction
/// (Abramowitz and Stegun 7.1.5, 7.1.14).
fn scaled_erfc(z: f64) -> f64 {
    if z < 2.0 {
        return (z * z).exp() * (1.0 - erf(z));
    }
    let mut fraction = z;
    for k in (1..=60).rev() {
        fraction = z + f64::from(k) / 2.0 / fraction;
    }
    1.0 / (PI.sqrt() * fraction)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Overlap of beam and receiver: 0 at `near`, 1 at `far`.
    fn overlap([near, far]: [f64; 2], range: f64) -> f64 {
        ((range - near) / (far - near)).clamp(0.0, 1.0)
    }

    /// Values computed with scipy: pulse sin^2 of a width in ns, overlap, extinction (optical ranges of 99.86, 49.93
    /// and 149.8 m); range of the fog's echo, m, and J, 1/m; reflectances of equally strong walls at 10, 20, 30 and 50
    /// m, `pi beta J R^2 / T` with 18.8 sr.
    #[test]
    fn fog_echoes_where_the_overlap_begins() {
        for (ns, seen, extinction, range, height, walls) in [
            (20.0, [0.9, 1.0], 0.03, 1.677_07, 0.630_535, &[0.575_97, 4.198, 17.21, 158.7][..]),
            (20.0, [0.9, 1.0], 0.06, 1.643_45, 0.572_139, &[1.904_58, 25.29]),
            (5.0, [0.5, 2.0], 0.03, 1.181_61, 0.217_501, &[0.198_679, 1.448_07, 5.9367, 54.75]),
            (5.0, [1.0, 8.0], 0.02, 2.040_75, 2.419_99e-2, &[0.012_066, 0.0720, 0.241_67, 1.4940]),
            (5.0, [1.0, 8.0], 0.06, 1.941_11, 2.064_39e-2, &[0.068_721, 0.912_64, 6.8177]),
        ] {
            let density = |r: f64| overlap(seen, r) * (-2.0 * extinction * r).exp() / (r * r);
            let SoftPeak { range: found, height: j, .. } =
                Pulse::new(PulseShape::Sin2, ns).peak([seen[0], 200.0], seen[1], density);
            // The peak is found to 1e-4 of the pulse.
            assert!((found - range).abs() < 1e-4, "{found} {range}");
            assert!((j / height - 1.0).abs() < 5e-6, "{j} {height}");
            for (at, wall) in [10.0f64, 20.0, 30.0, 50.0].into_iter().zip(walls) {
                let as_strong = PI * extinction / 18.8 * j * at * at * (2.0 * extinction * at).exp();
                assert!((as_strong / wall - 1.0).abs() < 2e-4, "{at} m: {as_strong} {wall}");
            }
        }
    }

    /// The dust cloud from 5 to 17.5 m, 5 ns sin^2, 10^5 to 10^7 grains of 50 um per m^3, computed with scipy: its echo
    /// relative to that of a target of reflectance 0.5 at 30 m, and of 0.05. The first is below the threshold of 0.8 at
    /// 200 m.
    #[test]
    fn dust_echoes_at_its_face() {
        for (per_m3, range, ratio, of_dark) in [
            (1e5, 5.516_57, 8.674e-3, 8.674e-2),
            (1e6, 5.512_53, 0.102_77, 1.027_73),
            (1e7, 5.476_95, 5.619_57, 56.196),
        ] {
            let extinction = PI * 50e-6f64.powi(2) * per_m3;
            let backscatter = extinction / (4.0 * PI);
            let density = |r: f64| (-2.0 * extinction * (r - 5.0)).exp() / (r * r);
            let SoftPeak { range: found, height: j, .. } =
                Pulse::new(PulseShape::Sin2, 5.0).peak([5.0, 17.5], 5.0, density);
            assert!((found - range).abs() < 1e-5, "{found} {range}");
            assert_eq!(PI * backscatter * j > 0.8 / 200f64.powi(2), per_m3 > 1e5);
            for (reflectance, ratio) in [(0.5, ratio), (0.05, of_dark)] {
                let target = reflectance * (-2.0 * extinction * 12.5).exp() / 900.0;
                let found = PI * backscatter * j / target;
                assert!((found / ratio - 1.0).abs() < 1e-4, "{found} {ratio}");
            }
        }
    }

    /// Two equal Gaussians of 5 ns split beyond 2 sigma: 4.24661 ns, 0.636551 m.
    #[test]
    fn pulses_merge_within_two_sigmas() {
        let merging = Pulse::new(PulseShape::Gaussian, 5.0).merging_distance();
        assert!((merging - 0.636_551).abs() < 5e-7, "{merging}");
        assert!((merging * 2.0 / SPEED_OF_LIGHT * 1e9 - 4.246_61).abs() < 5e-6);
    }

    /// The search for its peak ends, where the overlap makes the echo strongest.
    #[test]
    fn pulses_of_hardly_any_length_have_a_peak() {
        for ns in [1e-300, 1e-30, 1e-12, 1e-6] {
            let density = |r: f64| overlap([0.5, 2.0], r) / (r * r);
            let peak = Pulse::new(PulseShape::Gaussian, ns).peak([0.5, 200.0], 2.0, density);
            assert!((0.5..=2.1).contains(&peak.range), "{ns}: {peak:?}");
        }
    }

    /// The table of faces against the integral itself.
    #[test]
    fn face_echoes_agree_with_the_integral() {
        let pulse = Pulse::new(PulseShape::Gaussian, 5.0);
        let sigma = pulse.sigma();
        for kappa in [0.01, 0.1, 0.5, 2.0, 8.0] {
            let SoftPeak { range, height: j, .. } =
                pulse.peak([1000.0, 4000.0], 1000.0, |r| (-kappa * (r - 1000.0)).exp());
            // Where spreading adds nothing to the decay; the light that arrives falls by its square.
            let from = 1e6;
            let (mut behind, mut height) = ([0.0; LANES], [0.0; LANES]);
            let medium = [sigma, kappa / 2.0, 0.0].map(|value| value as f32);
            FaceEcho::get().peaks(medium, &[from; LANES], LANES, [&mut behind, &mut height]);
            for lane in [0, LANES - 1] {
                let [behind, height] = [behind[lane], height[lane] * from * from].map(f64::from);
                assert!((height / j - 1.0).abs() < 0.01, "{kappa}: {height} {j}");
                assert!((behind - (range - 1000.0)).abs() < 0.05 * sigma, "{kappa}: {behind}");
            }
        }
    }

    #[test]
    fn known_values_of_the_error_function() {
        for (z, expected) in [(0.0, 0.0), (0.5, 0.520_499_877_813), (1.0, 0.842_700_792_950), (2.0, 0.995_322_265_019)]
        {
            assert!((erf(z) - expected).abs() < 1e-11 && erf(-z) == -erf(z));
        }
        // The two forms agree where they meet.
        assert!((scaled_erfc(1.999_999) - scaled_erfc(2.000_001)).abs() < 1e-6);
    }
}
