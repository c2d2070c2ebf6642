//! How the noise of one cell is that of others, too.

use crate::window::transform;

/// Correlations between cells that are weaker than this are left out.
const WEAKEST: f64 = 3e-3;

/// White noise along an axis, and what windows make of it.
#[derive(Clone, Debug)]
pub(crate) struct Correlation {
    /// Offset of a cell, and how much of its noise there is.
    pub taps: Vec<(i64, f32)>,
    /// Cells beyond either end that are heard.
    pub beyond: usize,
}

impl Correlation {
    /// Of the transform of white noise: the transform of the window at whole cells.
    pub fn of_window(window: &[f64]) -> Self {
        // Farther away, cells are the same again.
        let farthest = (window.len() as i64 - 1) / 2;
        let mut taps = vec![(0, 1.0)];
        for offset in 1..=farthest {
            let value = transform(window, offset as f64);
            if value.abs() < WEAKEST {
                // Transforms of windows do not rise again before they have stayed below for a few cells.
                match offset {
                    0..16 => continue,
                    _ => break,
                }
            }
            taps.extend([(offset, value), (-offset, value)]);
        }
        Correlation::new(taps)
    }

    /// Of white noise after the filter that matches a rectangular pulse, `length` cells long.
    pub fn of_pulse(length: f64) -> Self {
        let whole = length.floor() as i64;
        let mut taps: Vec<(i64, f64)> = (0..whole).map(|offset| (offset - whole / 2, 1.0)).collect();
        taps.push((whole - whole / 2, length - length.floor()));
        Correlation::new(taps)
    }

    fn new(taps: Vec<(i64, f64)>) -> Self {
        let power: f64 = taps.iter().map(|(_, tap)| tap * tap).sum();
        let beyond = taps.iter().map(|(offset, _)| offset.unsigned_abs() as usize).max().unwrap_or(0);
        let taps = taps.into_iter().map(|(offset, tap)| (offset, (tap / power.sqrt()) as f32)).collect();
        Correlation { taps, beyond }
    }
}
