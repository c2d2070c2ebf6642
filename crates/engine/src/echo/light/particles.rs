//! Individual drops and flakes: the few that a sensor detects.

use crate::medium::Particles;
use echocast_kernels::air::{self, CELLS, LEVELS};
use ground::lanes::LANES;
use std::f64::consts::PI;

/// Shape of a beam, as needed for particles.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cone {
    /// Diameter at the sensor, m.
    pub start: f64,
    /// Full divergence, rad.
    pub divergence: [f64; 2],
}

impl Cone {
    /// Product of both diameters at `range` m, m^2.
    pub fn square(&self, range: f64) -> f64 {
        (self.start + self.divergence[0] * range) * (self.start + self.divergence[1] * range)
    }
}

/// The particles of a medium that one kind of beam detects.
///
/// A particle of diameter D at range r fills the fraction D^2 / beam^2 of the beam; its strength is `S = reflectance (D
/// / beam)^2 gain(r) / r^2`, and it is detected if that is at least the threshold K. All others are never detected and
/// never drawn. The detectable ones form a Poisson process, which can be sampled in order of range or of strength,
/// particle by particle, as far as needed: the mean number up to the n-th is a sum of n exponential numbers.
#[derive(Clone, Debug)]
pub(crate) struct Detectable {
    from: f32,
    cell: f32,
    /// Mean number nearer than the end of each cell.
    nearer: [f32; CELLS],
    /// Least diameter detected in each cell, mm.
    least_mm: [f32; CELLS],
    /// Strength per filled fraction of the beam, `reflectance gain / r^2`, in each cell.
    whole: [f32; CELLS],
    /// Product of the beam's diameters in each cell, mm^2.
    square_mm2: [f32; CELLS],
    slope_per_mm: f32,
    k: f32,
    /// Mean number at least as strong as each level, descending; 0 beyond the last.
    stronger: [f32; CELLS],
    /// Fraction of the particles of exactly a level's strength that is nearer than the end of each cell, 0..1.
    shares: Box<[[f32; CELLS]; LEVELS]>,
}

/// Levels of strength for each factor of 2.
const LEVELS_PER_OCTAVE: f32 = 2.0;

impl Detectable {
    /// `from` and `to`: extent of the medium, m. `gain`: `overlap(r) T(r)`. `k`: the detection threshold, 1/m^2, above
    /// 0.
    pub fn new(
        particles: &Particles,
        cone: Cone,
        [from, to]: [f64; 2],
        gain: impl Fn(f64) -> f64,
        k: f64,
    ) -> Detectable {
        let whole = |range: f64| particles.reflectance * gain(range) / (range * range).max(1e-12);
        let rate = |range: f64| {
            let (fill, square) = (k / whole(range), cone.square(range));
            // No particle returns more than a disc as wide as the beam.
            let least = ((fill * square).sqrt() * 1e3).max(particles.least_mm);
            if fill > 1.0 { 0.0 } else { PI / 4.0 * square * particles.count_above(least) }
        };
        // Beyond the range where one beam in a million hits a particle per metre there is nothing to draw.
        let mut end = from;
        while end < to && (end < from + 2.0 || rate(end) > 1e-6) {
            end = (end * 1.05 + 0.05).min(to);
        }
        let cell = (end - from) / CELLS as f64;
        let middle = |index: usize| from + cell * (index as f64 + 0.5);
        let mut seen = Detectable {
            from: from as f32,
            cell: cell as f32,
            nearer: [0.0; CELLS],
            least_mm: [0.0; CELLS],
            whole: std::array::from_fn(|index| whole(middle(index)) as f32),
            square_mm2: std::array::from_fn(|index| cone.square(middle(index)) as f32 * 1e6),
            slope_per_mm: particles.slope_per_mm as f32,
            k: k as f32,
            stronger: [0.0; CELLS],
            shares: Box::new([[0.0; CELLS]; LEVELS]),
        };
        // Particles in each cell larger than 0.
        let all: [f32; CELLS] = std::array::from_fn(|index| {
            let volume = PI / 4.0 * cone.square(middle(index)) * cell;
            (volume * particles.count_above(0.0)) as f32
        });
        let mut sum = 0.0;
        for index in 0..CELLS {
            let at = |part: f64| from + cell * (index as f64 + part);
            // Simpson's rule.
            sum += cell / 6.0 * (rate(at(0.0)) + 4.0 * rate(at(0.5)) + rate(at(1.0)));
            seen.nearer[index] = sum as f32;
            let fill = seen.k / seen.whole[index];
            seen.least_mm[index] = (fill * seen.square_mm2[index]).sqrt().max(particles.least_mm as f32);
        }
        for level in 0..LEVELS {
            let strength = seen.k * (level as f32 / LEVELS_PER_OCTAVE).exp2();
            let (mut stronger, mut alike) = (0.0, 0.0);
            for index in 0..CELLS {
                let fill = strength / seen.whole[index];
                if fill <= 1.0 {
                    let diameter = (fill * seen.square_mm2[index]).sqrt();
                    let least = particles.least_mm as f32;
                    stronger += all[index] * (-seen.slope_per_mm * diameter.max(least)).exp();
                    // dD/dS = D / 2S: the number of exactly that strength, up to a factor common to all cells.
                    if diameter >= least {
                        alike += all[index] * (-seen.slope_per_mm * diameter).exp() * diameter;
                    }
                }
                seen.shares[level][index] = alike;
            }
            seen.stronger[level] = stronger;
            seen.shares[level].iter_mut().for_each(|share| *share /= alike.max(f32::MIN_POSITIVE));
        }
        // Both orders sample the same particles.
        let scale = seen.mean() / seen.stronger[0].max(f32::MIN_POSITIVE);
        seen.stronger.iter_mut().for_each(|stronger| *stronger *= scale);
        seen
    }

    /// Mean number in an unobstructed beam.
    pub fn mean(&self) -> f32 {
        self.nearer[CELLS - 1]
    }

    /// Range, m, of the particle up to which there are `number` on average; `number` is less than [`Detectable::mean`].
    pub fn nearest(&self, number: f32) -> f32 {
        let sums = &self.nearer;
        let cell = sums.partition_point(|&sum| sum <= number).min(CELLS - 1);
        let before = if cell == 0 { 0.0 } else { sums[cell - 1] };
        let part = (number - before) / (sums[cell] - before).max(f32::MIN_POSITIVE);
        self.from + self.cell * (cell as f32 + part.clamp(0.0, 1.0))
    }

    /// Effective reflectance of a particle at `range` m, from a number in [0, 1).
    pub(crate) fn brightness(&self, range: f32, size: f32) -> f32 {
        let cell = (((range - self.from) / self.cell) as usize).min(CELLS - 1);
        let diameter = self.least_mm[cell] - (1.0 - size).ln() / self.slope_per_mm;
        (diameter * diameter / self.square_mm2[cell]).min(1.0) * self.whole[cell] * range * range
    }

    /// Strengths, 1/m^2, of the particles down to which there are the first `count` of `number` on average; meaningless
    /// where that is [`Detectable::mean`] or more.
    pub fn strongest(&self, number: &[f32; LANES], count: usize, strength: &mut [f32; LANES]) {
        air::levels(&self.stronger, number, count, strength);
        for strength in &mut strength[..count] {
            *strength = self.k * (*strength / LEVELS_PER_OCTAVE).exp2();
        }
    }

    /// For the first `count` of `least`, 1/m^2, the mean number of particles from which on [`Detectable::strongest`] is
    /// certainly not above it, not more than rounding beyond the number at which it is.
    pub fn stronger(&self, least: &[f32; LANES], count: usize, number: &mut [f32; LANES]) {
        // As if they were a little weaker, for the rounding of logarithms.
        let k = self.k * (1.0 + 1e-4);
        air::stronger(&self.stronger, LEVELS_PER_OCTAVE, k, least, count, number);
    }

    /// Ranges, m, of the first `count` particles, of `strength`, from numbers in [0, 1), `place`.
    pub fn places(&self, strength: &[f32; LANES], place: &[f32; LANES], count: usize, range: &mut [f32; LANES]) {
        let mut level = [0; LANES];
        for (level, strength) in level.iter_mut().zip(&strength[..count]) {
            // The nearest one.
            *level = (f64::from((strength / self.k).log2() * LEVELS_PER_OCTAVE) + 0.5) as u32;
        }
        air::cells(&self.shares, &level, place, count, range);
        for range in &mut range[..count] {
            *range = self.from + self.cell * *range;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RAIN_10: Particles =
        Particles { per_m3_mm: 8000.0, slope_per_mm: 2.528_039_5, least_mm: 1.0, reflectance: 0.0225 };

    /// Drops of 10 mm/h above 1 mm in 50 m of a cone of 3 mrad, when the sensor detects them all: 74.390, and above
    /// 0.05 mm 821.36, computed with numpy. The others are volumes, m^3, of cones, and of frustums that start 12 mm
    /// wide.
    #[test]
    fn drops_in_a_beam_are_counted() {
        let mean = |start, length, particles: &Particles| {
            let cone = Cone { start, divergence: [3e-3; 2] };
            f64::from(Detectable::new(particles, cone, [0.0, length], |_| 1.0, 1e-30).mean())
        };
        for (least_mm, expected) in [(1.0, 74.390), (0.05, 821.36)] {
            let found = mean(0.0, 50.0, &Particles { least_mm, ..RAIN_10 });
            assert!((found / expected - 1.0).abs() < 1e-5, "{found} {expected}");
        }
        let in_a_m3 = RAIN_10.count_above(1.0);
        for (start, length, expected) in [
            (0.0, 50.0, 0.294_526),
            (0.012, 50.0, 0.370_865),
            (0.0, 100.0, 2.356),
            (0.012, 100.0, 2.650),
            (0.0, 10.0, 0.002_356),
            (0.012, 10.0, 0.006_315),
        ] {
            let found = mean(start, length, &RAIN_10) / in_a_m3;
            assert!((found / expected - 1.0).abs() < 2e-4, "{start} m, {length} m: {found} {expected}");
        }
    }

    /// Those that are left out undrawn are too weak, and those drawn are stronger but for rounding.
    #[test]
    fn the_number_of_stronger_particles_is_where_they_end() {
        for least_mm in [0.05, 1.0, 4.0] {
            let seen = Detectable::new(
                &Particles { least_mm, ..RAIN_10 },
                Cone { start: 0.012, divergence: [3e-3, 1.5e-3] },
                [0.5, 200.0],
                |_| 1.0,
                1e-6,
            );
            let mut least = [0.0; LANES];
            for lane in 2..LANES {
                least[lane] = 1e-7 * 1.1f32.powi(lane as i32);
            }
            least[1] = f32::INFINITY;
            let mut number = [0.0; LANES];
            seen.stronger(&least, LANES, &mut number);
            for factor in [1.0, 1.1, 2.0] {
                let (weaker, mut strength) = (number.map(|number| number * factor), [0.0; LANES]);
                seen.strongest(&weaker, LANES, &mut strength);
                for lane in 0..LANES {
                    let number = weaker[lane];
                    assert!(number >= seen.mean() || strength[lane] <= least[lane], "{number} {}", least[lane]);
                }
            }
            let (inside, mut strength, mut between) = (number.map(|number| number * 0.999), [0.0; LANES], 0);
            seen.strongest(&inside, LANES, &mut strength);
            for lane in 0..LANES {
                if 1e-6 < inside[lane] && inside[lane] < 0.99 * seen.mean() {
                    between += 1;
                    assert!(strength[lane] > least[lane] * 0.999, "{} {}", inside[lane], least[lane]);
                }
            }
            assert!(between > 20, "{between}");
        }
    }

    /// Drawn in order of range and in order of strength: the same particles.
    #[test]
    fn both_orders_sample_the_same_particles() {
        let flakes = Particles { per_m3_mm: 600.0, slope_per_mm: 0.8, least_mm: 1.0, reflectance: 0.9 };
        let cone = Cone { start: 0.012, divergence: [3e-3, 1.5e-3] };
        let k = 2e-5f32;
        let seen = Detectable::new(&flakes, cone, [0.5, 200.0], |_| 1.0, k.into());
        assert!(seen.mean() > 0.5 && seen.mean() < 10.0, "{}", seen.mean());
        let (steps, mut sums) = (200, [[0.0; 3]; 2]);
        for i in 0..steps {
            let number = seen.mean() * (i as f32 + 0.5) / steps as f32;
            for j in 0..steps {
                let u = (j as f32 + 0.5) / steps as f32;
                let range = seen.nearest(number);
                let (mut strength, mut place) = ([0.0; LANES], [0.0; LANES]);
                seen.strongest(&[number; LANES], 1, &mut strength);
                seen.places(&strength, &[u; LANES], 1, &mut place);
                let (a, b) = ((range, seen.brightness(range, u) / (range * range)), (place[0], strength[0]));
                for ((range, strength), sums) in [a, b].into_iter().zip(&mut sums) {
                    assert!(strength > 0.98 * k && range > 0.5 && range < 40.0, "{strength} at {range}");
                    let values = [range, strength.ln(), range * strength.ln()];
                    sums.iter_mut().zip(values).for_each(|(sum, value)| *sum += f64::from(value));
                }
            }
        }
        for (a, b) in sums[0].iter().zip(sums[1]) {
            assert!((a / b - 1.0).abs() < 0.01, "{sums:?}");
        }
    }
}
