//! Cubes of range x velocity x channel.

use num_complex::Complex32;

/// Places of the cells along one axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Axis {
    /// Middle of the first cell, m or m/s.
    pub first: f64,
    /// From cell to cell, above 0.
    pub step: f64,
    /// Number of cells.
    pub len: usize,
}

impl Axis {
    /// The place `cells` (may be a fraction) from the middle of the first.
    pub fn at(&self, cells: f64) -> f64 {
        self.first + cells * self.step
    }

    /// How many cells `place` is from the middle of the first.
    pub fn cells(&self, place: f64) -> f64 {
        (place - self.first) / self.step
    }
}

/// The axes of a cube.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CubeAxes {
    /// Range, m.
    pub range: Axis,
    /// Range rate, m/s, positive if receding; cell 0 is the least, about minus the greatest unambiguous one.
    pub velocity: Axis,
}

/// Complex amplitudes, sqrt(W), of the cells of all channels, windows applied, coherent gain 1: a path in the middle of
/// a cell has its own amplitude there.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RadarCube {
    /// Its axes.
    pub axes: CubeAxes,
    /// Number of virtual channels.
    pub channels: usize,
    /// Amplitudes, `[channel][velocity][range]`.
    pub cells: Vec<Complex32>,
}
