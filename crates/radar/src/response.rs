//! How a wave spreads over the cells of an axis: the transform of a window, tabulated.

use ground::math::log2;
use num_complex::Complex64;
use rustfft::FftPlannerScalar;
use std::f64::consts::TAU;

/// Steps of tables over a cell: linear interpolation between them errs by up to 1.6e-5 of the peak of a Hann window.
const STEPS: usize = 128;

/// Cells on either side for which responses are tabulated, at most: farther away those of all windows but the
/// rectangular one are below -100 dB.
const MOST_CELLS_ASIDE: usize = 1024;

/// More cells on either side, so that runs of cells may be rounded up.
const MARGIN: usize = 16;

/// Levels are distinguished by this much, dB.
const DEEPEST_DB: usize = 140;

/// Responses over the distance of a cell from a wave.
#[derive(Clone, Debug)]
pub(crate) struct CellResponse {
    /// For each order, rows for fractions of cells, [`STEPS`] and one more, of columns for whole cells.
    tables: Vec<Vec<f32>>,
    /// Columns of a table.
    pub width: usize,
    /// Index of the column of distance 0.
    middle: usize,
    /// For each level below the peak, dB: beyond how many cells from the peak the response remains below it.
    reaches: Vec<f32>,
    /// Greatest response at any distance of at least so many half cells.
    envelope: Vec<f32>,
}

impl CellResponse {
    /// Of waves that `window` weights over time, for the `orders` of Chebyshev polynomials over time with which the
    /// window is multiplied: `sum of w[n] T_q(t_n) exp(j 2 pi x (n - (N - 1) / 2) / N) / sum of w`, `t_n = 2 (n - (N - 1)
    /// / 2) / N`, which is real for even orders; of odd ones it is the imaginary part.
    pub fn of_window(window: &[f64], orders: usize) -> Self {
        let count = window.len();
        let (sum, centre) = (window.iter().sum::<f64>(), 0.5 * (count as f64 - 1.0));
        let middle = (count / 2).min(MOST_CELLS_ASIDE) + MARGIN;
        let width = 2 * middle + 1;
        let fft = FftPlannerScalar::new().plan_fft_inverse(count);
        let turn = |cells: f64| Complex64::cis(TAU * cells / count as f64);
        let weighted = |order: usize| -> Vec<f64> {
            let weight = |n: usize| {
                let angle = (2.0 * (n as f64 - centre) / count as f64).acos();
                window[n] * (order as f64 * angle).cos() / sum
            };
            (0..count).map(weight).collect()
        };
        let weighted: Vec<Vec<f64>> = (0..orders).map(weighted).collect();
        let cells = (0..width).map(|column| column as i64 - middle as i64);
        let columns: Vec<(usize, Complex64)> =
            cells.map(|cell| (cell.rem_euclid(count as i64) as usize, turn(-(cell as f64) * centre))).collect();
        let mut tables = vec![Vec::with_capacity((STEPS + 1) * width); orders];
        let mut shifts = vec![Complex64::default(); count];
        let (mut bins, mut scratch) = (shifts.clone(), vec![Complex64::default(); fft.get_inplace_scratch_len()]);
        for step in 0..=STEPS {
            let part = step as f64 / STEPS as f64;
            for (n, shift) in shifts.iter_mut().enumerate() {
                *shift = turn(part * (n as f64 - centre));
            }
            for (order, (table, weighted)) in tables.iter_mut().zip(&weighted).enumerate() {
                for ((bin, shift), weight) in bins.iter_mut().zip(&shifts).zip(weighted) {
                    *bin = *weight * *shift;
                }
                fft.process_with_scratch(&mut bins, &mut scratch);
                table.extend(columns.iter().map(|&(bin, turn)| {
                    let value = bins[bin] * turn;
                    (if order % 2 == 0 { value.re } else { value.im }) as f32
                }));
            }
        }
        CellResponse::new(tables, width, middle)
    }

    /// Of rectangular pulses, `length` cells long, after the filter that matches them: a triangle, of a single order.
    pub fn of_pulse(length: f64) -> Self {
        let aside = (length.ceil() as usize + 1).max(1);
        let middle = aside + MARGIN;
        let width = 2 * middle + 1;
        let triangle = |cells: f64| (1.0 - cells.abs() / length).max(0.0);
        let row = |step: usize| {
            let part = step as f64 / STEPS as f64;
            (0..width).map(move |column| triangle(column as f64 - middle as f64 + part) as f32)
        };
        CellResponse::new(vec![(0..=STEPS).flat_map(row).collect()], width, middle)
    }

    fn new(tables: Vec<Vec<f32>>, width: usize, middle: usize) -> Self {
        let (table, aside) = (&tables[0], middle - MARGIN);
        // Side lobes are about one cell apart: an eighth of a cell misses their peaks by less than 0.2 dB.
        let at = |eighth: usize| {
            let (row, column) = (eighth % 8 * (STEPS / 8), middle + eighth / 8);
            f64::from(table[row * width + column].abs())
        };
        let mut envelope = vec![0.0f32; 2 * aside + 1];
        let mut greatest = 0f64;
        for half in (0..=2 * aside).rev() {
            for eighth in (4 * half..4 * half + 4).rev() {
                greatest = greatest.max(at(eighth));
            }
            envelope[half] = greatest as f32;
        }
        let reach = |db: usize| {
            let level = 10f32.powf(-(db as f32) / 20.0);
            0.5 * envelope.partition_point(|&value| value > level) as f32
        };
        CellResponse { reaches: (0..=DEEPEST_DB).map(reach).collect(), tables, width, middle, envelope }
    }

    /// The table of an order.
    pub fn table(&self, order: usize) -> &[f32] {
        &self.tables[order]
    }

    /// How far from a wave cells are tabulated, at least.
    pub fn limit(&self) -> f32 {
        (self.middle - 1) as f32
    }

    /// Where a table has the response of a wave at `place` in the `cell`, and the part of the way to the next row.
    pub fn find(&self, cell: i32, place: f64) -> (u32, f32) {
        let above = place.ceil();
        let step = (above - place) * STEPS as f64;
        let row = (step as usize).min(STEPS - 1);
        let column = (cell - above as i32 + self.middle as i32).clamp(0, self.width as i32 - 1) as usize;
        ((row * self.width + column) as u32, (step - row as f64) as f32)
    }

    /// Beyond how many cells from the peak the response remains below `level`.
    pub fn reach(&self, level: f32) -> f32 {
        // 20 log10(2) dB per octave.
        let db = (-6.020_6 * log2(level.max(1e-9))).max(0.0) as usize;
        self.reaches[(db + 1).min(DEEPEST_DB)]
    }

    /// Greatest response `cells` from the peak or farther.
    pub fn envelope(&self, cells: f32) -> f32 {
        self.envelope[((2.0 * cells.max(0.0)) as usize).min(self.envelope.len() - 1)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::FftWindow;
    use crate::window::transform;

    fn value(response: &CellResponse, order: usize, cell: i32, place: f64) -> f64 {
        let (at, part) = response.find(cell, place);
        let (low, high) = (response.table(order)[at as usize], response.table(order)[at as usize + response.width]);
        f64::from(low + (high - low) * part)
    }

    #[test]
    fn tables_follow_windows() {
        for (window, count) in
            [(FftWindow::Hann, 128), (FftWindow::BlackmanHarris, 37), (FftWindow::Rect, 64), (FftWindow::Hann, 1)]
        {
            let samples = window.samples(count);
            let response = CellResponse::of_window(&samples, 4);
            for step in 0..500 {
                let (place, cell) = (0.37 + 0.0213 * f64::from(step), step % 23 - 5);
                if (f64::from(cell) - place).abs() > 0.5 * count as f64 {
                    continue;
                }
                let expected = transform(&samples, f64::from(cell) - place);
                let found = value(&response, 0, cell, place);
                assert!((found - expected).abs() < 5e-5, "{window:?} at {place}: {found}, {expected}");
                assert!(
                    f64::from(response.envelope((f64::from(cell) - place).abs() as f32)) > 0.97 * expected.abs() - 1e-5
                );
                // By definition: the sine transform of the window times t^3.
                let sum = samples.iter().sum::<f64>();
                let third = |(n, w): (usize, &f64)| {
                    let t = (2.0 * n as f64 + 1.0) / count as f64 - 1.0;
                    let angle = TAU * (f64::from(cell) - place) * 0.5 * t;
                    w * (4.0 * t * t * t - 3.0 * t) * angle.sin() / sum
                };
                let third: f64 = samples.iter().enumerate().map(third).sum();
                assert!((value(&response, 3, cell, place) - third).abs() < 5e-5, "{window:?}");
            }
            let level = 1e-3;
            let reach = f64::from(response.reach(level));
            for step in 0..400 {
                let cells = reach + 0.05 * f64::from(step);
                if cells < 0.5 * count as f64 {
                    assert!(transform(&samples, cells).abs() < 1.05e-3, "{window:?} at {cells}");
                }
            }
        }
    }

    #[test]
    fn a_matched_filter_makes_a_triangle() {
        let response = CellResponse::of_pulse(4.5);
        assert!((value(&response, 0, 10, 10.0) - 1.0).abs() < 1e-6);
        assert!((value(&response, 0, 12, 9.75) - 0.5).abs() < 1e-6);
        assert_eq!(value(&response, 0, 16, 11.2), 0.0);
        assert!(response.reach(1e-4) >= 4.5);
    }
}
