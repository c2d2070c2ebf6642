//! What radars receive: waves at the elements of an array, and patches of cells that paths add to cubes.

use crate::level::kernels;
use crate::math::{cos_pi, sin_pi};

/// Numbers added at a time: a fixed count at every level.
const STEP: usize = 16;

/// Paths that are handled at a time.
pub const PATHS: usize = 16;

/// A number for each of [`PATHS`].
pub type PathLanes = [f32; PATHS];

/// Cells of one row that a patch adds to.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PatchRun {
    /// Row of the cells.
    pub row: u32,
    /// First cell in the row.
    pub cell: u32,
    /// Number of cells.
    pub len: u32,
    /// Where the first of them is in the responses of the patch.
    pub skip: u32,
    /// 1 or -1: the sign of all of it.
    pub sign: f32,
}

/// What a path adds to a cube, up to one complex factor per layer: `layers` real numbers for each cell of its runs.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CellPatch {
    /// First of its runs.
    pub first: u32,
    /// Number of runs.
    pub runs: u32,
    /// Number of layers.
    pub layers: u32,
    /// Index of its first number.
    pub from: u32,
}

/// Part of `x` beyond the nearest whole number, for up to 2^22.
#[inline(always)]
fn beyond_whole(x: f32) -> f32 {
    const UNIT: f32 = 1.5 * (1 << 23) as f32;
    x - ((x + UNIT) - UNIT)
}

/// The cells of a channel, pairs of numbers in rows of `width` of them.
struct PatchRows<'a> {
    cells: &'a mut [f32],
    width: usize,
    height: usize,
    /// By how many rows patches are moved on.
    shift: usize,
    /// Sign of rows that begin from the first again.
    wrap: f32,
}

/// Adds the `L` layers of a patch, each times its complex factor; both numbers of a cell are the same.
#[inline(always)]
fn add_layers<const L: usize>(to: &mut PatchRows, runs: &[PatchRun], numbers: &[f32], factors: &[[f32; 2]]) {
    let mut pairs = [[0.0; STEP]; L];
    for layer in 0..L {
        for lane in 0..STEP {
            pairs[layer][lane] = factors[layer][lane % 2];
        }
    }
    let mut from = 0;
    for run in runs {
        let count = 2 * run.len as usize;
        let (row, sign) = match run.row as usize + to.shift {
            row if row >= to.height => (row - to.height, to.wrap),
            row => (row, 1.0),
        };
        let first = 2 * (row * to.width + run.cell as usize);
        let cells = &mut to.cells[first..first + count];
        let layer: [&[f32]; L] =
            std::array::from_fn(|layer| &numbers[from + layer * count..from + (layer + 1) * count]);
        from += L * count;
        let (steps, rest) = cells.as_chunks_mut::<STEP>();
        let columns = layer.map(|numbers| numbers.as_chunks::<STEP>());
        for (step, cells) in steps.iter_mut().enumerate() {
            let mut sums = [0.0; STEP];
            for layer in 0..L {
                let numbers = &columns[layer].0[step];
                for lane in 0..STEP {
                    sums[lane] += pairs[layer][lane] * numbers[lane];
                }
            }
            for lane in 0..STEP {
                cells[lane] += sign * sums[lane];
            }
        }
        for (lane, cell) in rest.iter_mut().enumerate() {
            let mut sum = 0.0;
            for layer in 0..L {
                sum += pairs[layer][lane] * columns[layer].1[lane];
            }
            *cell += sign * sum;
        }
    }
}

kernels! {
    /// The waves of paths at an element at `place`, m from the reference point: factors of the amplitude, and by how
    /// much farther than the reference point the ends of the paths are, m. `ends` are distances, m, and three columns of
    /// directions towards them; `turns` are phases in turns per m. `more` turns are added.
    pub fn waves_at(
        place: [f32; 3],
        ends: [&PathLanes; 4],
        turns: &PathLanes,
        more: &PathLanes,
        re: &mut PathLanes,
        im: &mut PathLanes,
        farther: &mut PathLanes,
    ) {
        let square = place[0] * place[0] + place[1] * place[1] + place[2] * place[2];
        for lane in 0..PATHS {
            let distance = ends[0][lane];
            let along = ends[1][lane] * place[0] + ends[2][lane] * place[1] + ends[3][lane] * place[2];
            // |D u - p| - D, without the difference of almost equal numbers: (p^2 - 2 D u.p) / (|D u - p| + D).
            let numerator = square - 2.0 * distance * along;
            let from_element = (distance * distance + numerator).max(0.0).sqrt();
            let difference = numerator / (from_element + distance).max(1e-9);
            let turn = beyond_whole(-(turns[lane] * difference + more[lane]));
            // By the half angle.
            let (sine, cosine) = (sin_pi(turn), cos_pi(turn));
            re[lane] = 1.0 - 2.0 * sine * sine;
            im[lane] = 2.0 * sine * cosine;
            farther[lane] = difference;
        }
    }

    /// Values of a table of `width` columns: for each of `places`, a number's index and the part of the way to the one
    /// in the next row, `len` columns from there.
    pub fn table_rows(table: &[f32], width: usize, places: &[(u32, f32)], len: usize, out: &mut [f32]) {
        for (&(from, part), out) in places.iter().zip(out.chunks_exact_mut(len)) {
            let from = from as usize;
            let (low, high) = (&table[from..from + len], &table[from + width..from + width + len]);
            for column in 0..len {
                out[column] = low[column] + (high[column] - low[column]) * part;
            }
        }
    }

    /// Adds `factor` times `from` to `to`, of the same length.
    pub fn add_scaled(from: &[f32], factor: f32, to: &mut [f32]) {
        for (to, from) in to.iter_mut().zip(from) {
            *to += factor * from;
        }
    }

    /// Products of a `matrix` and `columns` of `len` numbers each.
    pub fn products(matrix: &[f32], columns: &[f32], len: usize, out: &mut [f32]) {
        let inputs = columns.len() / len;
        for (factors, out) in matrix.chunks_exact(inputs).zip(out.chunks_exact_mut(len)) {
            out.fill(0.0);
            for (factor, column) in factors.iter().zip(columns.chunks_exact(len)) {
                for cell in 0..len {
                    out[cell] += factor * column[cell];
                }
            }
        }
    }

    /// Fills the layers of a patch. `ranges` are responses along the rows, `len` long, of `orders` for each node;
    /// `rows` are those across, `orders` for each run. Even orders sum up to the first half of the layers, odd ones to
    /// the second, which is absent if there is only one order.
    pub fn fill_patch(
        runs: &[PatchRun],
        rows: &[f32],
        ranges: &[f32],
        len: usize,
        orders: usize,
        out: &mut [f32],
    ) {
        let halves = if orders > 1 { 2 } else { 1 };
        let mut at = 0;
        for (run, rows) in runs.iter().zip(rows.chunks_exact(orders)) {
            let (skip, count) = (run.skip as usize, run.len as usize);
            for half in 0..halves {
                for ranges in ranges.chunks_exact(len * orders) {
                    let out = &mut out[at..at + 2 * count];
                    at += 2 * count;
                    for (cell, pair) in out.as_chunks_mut::<2>().0.iter_mut().enumerate() {
                        let value = run.sign * rows[half] * ranges[half * len + skip + cell];
                        *pair = [value, value];
                    }
                    for order in (half + 2..orders).step_by(2) {
                        let factor = run.sign * rows[order];
                        let ranges = &ranges[order * len + skip..order * len + skip + count];
                        for (range, pair) in ranges.iter().zip(out.as_chunks_mut::<2>().0) {
                            pair[0] += factor * range;
                            pair[1] += factor * range;
                        }
                    }
                }
            }
        }
    }

    /// Adds patches to the `cells` of a channel, pairs of numbers in rows of `width` of them: each layer times its
    /// complex factor, the factors of one patch after those of another. PatchRows are moved on by `shift`, and those beyond
    /// the last, `height`, begin from the first, times `wrap`.
    pub fn add_patches(
        cells: &mut [f32],
        width: usize,
        height: usize,
        shift: usize,
        wrap: f32,
        patches: &[CellPatch],
        runs: &[PatchRun],
        numbers: &[f32],
        factors: &[[f32; 2]],
    ) {
        let mut to = PatchRows { cells, width, height, shift, wrap };
        let mut used = 0;
        for patch in patches {
            let layers = patch.layers as usize;
            let given = &factors[used..used + layers];
            used += layers;
            let runs = &runs[patch.first as usize..(patch.first + patch.runs) as usize];
            match (layers, &numbers[patch.from as usize..]) {
                (0, _) => {}
                (1, numbers) => add_layers::<1>(&mut to, runs, numbers, given),
                (2, numbers) => add_layers::<2>(&mut to, runs, numbers, given),
                (3, numbers) => add_layers::<3>(&mut to, runs, numbers, given),
                (4, numbers) => add_layers::<4>(&mut to, runs, numbers, given),
                (6, numbers) => add_layers::<6>(&mut to, runs, numbers, given),
                (_, numbers) => {
                    // Run by run, for the layers of a run follow each other.
                    let mut from = 0;
                    for run in runs.chunks(1) {
                        let count = 2 * run[0].len as usize;
                        for layer in 0..layers {
                            add_layers::<1>(&mut to, run, &numbers[from..from + count], &given[layer..]);
                            from += count;
                        }
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{block, unit};
    use crate::{Level, limit_level};

    fn numbers(count: usize, stream: u32) -> Vec<f32> {
        (0..count).map(|index| 2.0 * unit(block([index as u32, stream, 0, 0], [1, 2])[0]) - 1.0).collect()
    }

    #[test]
    fn waves_follow_exact_distances() {
        let column = |stream| -> PathLanes { numbers(PATHS, stream).try_into().unwrap() };
        let mut direction = [column(0), column(1), column(2)];
        for lane in 0..PATHS {
            let length = direction.iter().map(|axis| axis[lane] * axis[lane]).sum::<f32>().sqrt();
            direction.iter_mut().for_each(|axis| axis[lane] /= length);
        }
        let mut distance = column(3).map(|value| 10f32.powf(1.5 + 1.5 * value));
        distance[0] = 0.0;
        let (turns, more) = ([257.3; PATHS], column(4));
        let [mut re, mut im, mut farther] = [[0.0; PATHS]; 3];
        let place = [0.01, 0.07, -0.03];
        let ends = [&distance, &direction[0], &direction[1], &direction[2]];
        waves_at(place, ends, &turns, &more, &mut re, &mut im, &mut farther);
        for lane in 0..PATHS {
            let far = f64::from(distance[lane]);
            let square = |axis: usize| (far * f64::from(direction[axis][lane]) - f64::from(place[axis])).powi(2);
            // Directions are unit vectors up to rounding only.
            let length: f64 = (0..3).map(|axis| f64::from(direction[axis][lane]).powi(2)).sum::<f64>();
            let expected = ((0..3).map(square).sum::<f64>() + far * far * (1.0 - length)).sqrt() - far;
            assert!((f64::from(farther[lane]) - expected).abs() < 3e-8, "{lane}: {} {expected}", farther[lane]);
            let phase = -std::f64::consts::TAU * (257.3 * expected + f64::from(more[lane]));
            assert!((f64::from(re[lane]) - phase.cos()).abs() < 1e-4, "{lane}");
            assert!((f64::from(im[lane]) - phase.sin()).abs() < 1e-4, "{lane}");
        }
    }

    #[test]
    fn patches_are_sums_of_products_at_every_level() {
        const WIDTH: usize = 40;
        const HEIGHT: usize = 5;
        let run = |row, cell, len, skip, sign| PatchRun { row, cell, len, skip, sign };
        let runs = [run(0, 3, 8, 0, 1.0), run(4, 1, 11, 0, -1.0), run(2, 35, 5, 6, 1.0)];
        let (len, mut first) = (11, Vec::new());
        for level in [Level::Plain, Level::Avx2, Level::Avx512] {
            limit_level(level);
            let mut cells = numbers(2 * WIDTH * HEIGHT, 9);
            let mut expected: Vec<f64> = cells.iter().map(|&cell| cell.into()).collect();
            for (orders, nodes) in [(1, 1), (1, 3), (3, 1), (4, 3)] {
                let halves = if orders > 1 { 2 } else { 1 };
                let (ranges, rows) = (numbers(nodes * orders * len, 1), numbers(runs.len() * orders, 2));
                let factors: Vec<[f32; 2]> = numbers(2 * nodes * halves, 3).as_chunks().0.to_vec();
                let total: usize = runs.iter().map(|run| 2 * run.len as usize).sum();
                let mut layers = vec![0.0; total * nodes * halves];
                fill_patch(&runs, &rows, &ranges, len, orders, &mut layers);
                let patch = CellPatch { first: 0, runs: 3, layers: (nodes * halves) as u32, from: 0 };
                add_patches(&mut cells, WIDTH, HEIGHT, 2, -1.0, &[patch], &runs, &layers, &factors);
                for (run, rows) in runs.iter().zip(rows.chunks(orders)) {
                    let moved = run.row as usize + 2;
                    let sign = f64::from(run.sign) * if moved >= HEIGHT { -1.0 } else { 1.0 };
                    for cell in 0..run.len as usize {
                        for node in 0..nodes {
                            for order in 0..orders {
                                let range = ranges[(node * orders + order) * len + run.skip as usize + cell];
                                let value = sign * f64::from(rows[order]) * f64::from(range);
                                let factor = factors[(order % 2) * nodes + node];
                                let at = 2 * (moved % HEIGHT * WIDTH + run.cell as usize + cell);
                                expected[at] += f64::from(factor[0]) * value;
                                expected[at + 1] += f64::from(factor[1]) * value;
                            }
                        }
                    }
                }
            }
            for (cell, expected) in cells.iter().zip(&expected) {
                assert!((f64::from(*cell) - expected).abs() < 3e-6);
            }
            if first.is_empty() {
                first = cells;
            } else {
                assert_eq!(first, cells, "{level:?}");
            }
        }
        limit_level(Level::Avx512);
    }
}
