//! Echoes of the air: the faces of what hangs in it, drops and flakes.

use crate::level::kernels;
use crate::math::{cell, exp_negative, log2};
use crate::{LANES, Lanes};

/// What rounding may add to a mean number of particles, relative to it.
const ROUNDING: f32 = 1e-6;

/// Rows of a table of [`peaks`].
pub const FACES: usize = 65;

/// Cells of range in a table of particles.
pub const CELLS: usize = 64;

/// Levels of strength in a table of particles, which may have further entries of 0.
pub const LEVELS: usize = 48;

kernels! {
    /// How far behind the first `count` faces, at `from` m, the peaks of their echoes are, m, and their height, 1/m.
    /// `rows`: both in sigmas, in equal steps of the root of `u`, the decay behind the face in a sigma, up to `most`.
    /// Power decays by twice the `extinction`, 1/m, and with the spreading of light, `from^2 + near_range^2`.
    pub fn peaks(
        rows: &[[f32; 2]; FACES],
        most: f32,
        sigma: f32,
        extinction: f32,
        near_range_2: f32,
        from: &Lanes,
        count: usize,
        behind: &mut Lanes,
        height: &mut Lanes,
    ) {
        for lane in 0..whole_vectors::<N>(count) {
            let spread = from[lane] * from[lane] + near_range_2;
            let u = (2.0 * extinction + 2.0 * from[lane] / spread) * sigma;
            let place = (u / most).sqrt().min(1.0) * (FACES - 1) as f32;
            let (row, part) = cell(place, FACES - 2);
            let [a, b] = [rows[row], rows[row + 1]];
            behind[lane] = (a[0] + (b[0] - a[0]) * part) * sigma;
            height[lane] = (a[1] + (b[1] - a[1]) * part) * sigma / spread;
        }
    }

    /// Mean ranges, m, of the echoes of media between `from` and `to` m whose peaks are `behind` m behind the face and
    /// `height` 1/m high, and the reflectances of walls there that return as much, at the optical `depth` of the face.
    /// `scale`: pi times the backscatter, 1/m. A layer thinner than the pulse returns an echo from its middle, in
    /// proportion to its thickness.
    pub fn face_echoes(
        scale: f32,
        from: &Lanes,
        to: &Lanes,
        depth: &Lanes,
        behind: &Lanes,
        height: &Lanes,
        count: usize,
        range: &mut Lanes,
        rho_eff: &mut Lanes,
    ) {
        for lane in 0..whole_vectors::<N>(count) {
            let length = to[lane] - from[lane];
            let at = from[lane] + behind[lane].min(0.5 * length);
            let full = height[lane] * at * at;
            let seen = full * (1.0 - exp_negative((length / full).max(0.0)));
            range[lane] = at;
            rho_eff[lane] = scale * seen * exp_negative(2.0 * depth[lane]);
        }
    }

    /// Mean numbers of particles that are at least as strong as `least`, 1/m^2, or rounding more. `table`: the mean
    /// number at least as strong as each level, of which the first is `k` and each factor of 2 has `per_octave`;
    /// weaker ones than the first do not count.
    pub fn stronger(
        table: &[f32; CELLS],
        per_octave: f32,
        k: f32,
        least: &Lanes,
        count: usize,
        number: &mut Lanes,
    ) {
        for lane in 0..whole_vectors::<N>(count) {
            let place = (log2(least[lane] / k) * per_octave).clamp(0.0, (LEVELS - 1) as f32);
            let (level, part) = cell(place, LEVELS - 2);
            number[lane] = (table[level] + (table[level + 1] - table[level]) * part) * (1.0 + ROUNDING);
        }
    }

    /// The levels down to which there are `number` particles on average, in the same table: the inverse of
    /// [`stronger`], up to rounding.
    pub fn levels(table: &[f32; CELLS], number: &Lanes, count: usize, level: &mut Lanes) {
        for lane in 0..whole_vectors::<N>(count) {
            // How many entries are greater, by bisection.
            let mut above = 0;
            for step in [32, 16, 8, 4, 2, 1] {
                above += if table[above + step - 1] > number[lane] { step } else { 0 };
            }
            let above = above.clamp(1, LEVELS - 1);
            let [more, less] = [table[above - 1], table[above]];
            let part = ((more - number[lane]) / (more - less).max(f32::MIN_POSITIVE)).clamp(0.0, 1.0);
            level[lane] = (above - 1) as i32 as f32 + part;
        }
    }

    /// The cells of range in which the sums in row `row` of `shares` reach `target`, and the part of each before that.
    pub fn cells(
        shares: &[[f32; CELLS]; LEVELS],
        row: &Lanes<u32>,
        target: &Lanes,
        count: usize,
        cell: &mut Lanes,
    ) {
        for lane in 0..whole_vectors::<N>(count) {
            let sums = &shares[(row[lane] as usize).min(LEVELS - 1)];
            // How many entries are not greater, by bisection: the last one always is.
            let mut found = 0;
            for step in [32, 16, 8, 4, 2, 1] {
                found += if sums[found + step - 1] <= target[lane] { step } else { 0 };
            }
            let before = if found == 0 { 0.0 } else { sums[found.max(1) - 1] };
            let part = (target[lane] - before) / (sums[found] - before).max(f32::MIN_POSITIVE);
            cell[lane] = found as i32 as f32 + part.clamp(0.0, 1.0);
        }
    }
}

/// The first `count` lanes, rounded up to vectors of `N`: what follows them is computed, too, and ignored.
#[inline(always)]
fn whole_vectors<const N: usize>(count: usize) -> usize {
    (count.div_ceil(N) * N).min(LANES)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers from 0 to 1 that repeat only after all lanes.
    fn fraction(lane: usize) -> f32 {
        (lane * 97 % LANES) as f32 / LANES as f32
    }

    #[test]
    fn levels_are_found_as_by_a_search() {
        let mut table = [0.0; CELLS];
        for level in 0..LEVELS {
            // Equal ones at first, none of the greatest strengths.
            table[level] = if level < 4 { 5.0 } else { (5.0 - 0.12 * level as f32).max(0.0) };
        }
        let (mut number, mut level, mut least) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
        for lane in 0..LANES {
            number[lane] = 5.5 * fraction(lane);
        }
        levels(&table, &number, LANES, &mut level);
        for lane in 0..LANES {
            let above = table[..LEVELS].partition_point(|&entry| entry > number[lane]).clamp(1, LEVELS - 1);
            let part = (table[above - 1] - number[lane]) / (table[above - 1] - table[above]).max(f32::MIN_POSITIVE);
            assert_eq!(level[lane], (above - 1) as f32 + part.clamp(0.0, 1.0), "{}", number[lane]);
            least[lane] = 2e-6 * (level[lane] / 2.0).exp2();
        }
        let mut back = [0.0; LANES];
        stronger(&table, 2.0, 2e-6, &least, LANES, &mut back);
        for lane in 0..LANES {
            let expected = number[lane].clamp(0.0, 5.0);
            assert!((back[lane] - expected).abs() < 1e-4, "{} {expected}", back[lane]);
        }
    }

    #[test]
    fn cells_are_found_as_by_a_search() {
        let (mut shares, mut row, mut target) = ([[0.0; CELLS]; LEVELS], [0; LANES], [0.0; LANES]);
        for level in 1..LEVELS {
            for cell in 0..CELLS {
                // The nearest cells of weak ones hold nothing, the farthest of strong ones neither.
                shares[level][cell] = ((cell as f32 - 3.0).max(0.0) / (40 - level / 2) as f32).min(1.0);
            }
        }
        for lane in 0..LANES {
            (row[lane], target[lane]) = ((lane % (LEVELS + 2)) as u32, fraction(lane));
        }
        let mut found = [0.0; LANES];
        cells(&shares, &row, &target, LANES, &mut found);
        for lane in 0..LANES {
            let sums = &shares[(row[lane] as usize).min(LEVELS - 1)];
            let cell = sums.partition_point(|&sum| sum <= target[lane]).min(CELLS - 1);
            let before = if cell == 0 { 0.0 } else { sums[cell - 1] };
            let part = (target[lane] - before) / (sums[cell] - before).max(f32::MIN_POSITIVE);
            assert_eq!(found[lane], cell as f32 + part.clamp(0.0, 1.0), "{} {}", row[lane], target[lane]);
        }
    }
}
