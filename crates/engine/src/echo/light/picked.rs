//! The lanes of a block that a step is about, side by side.

use echocast_kernels::rows;
use ground::lanes::LANES;

/// Some lanes of a block, in order.
pub(super) struct Picked {
    lanes: [u8; LANES],
    pub count: usize,
}

impl Picked {
    /// Those of the first `count` lanes in which `a` exceeds `b`.
    pub fn exceeding(a: &[f32; LANES], b: &[f32; LANES], count: usize) -> Picked {
        let mut lanes = [0; LANES];
        let count = rows::exceeding(a, b, count, &mut lanes);
        Picked { lanes, count }
    }

    /// Each with its place among them.
    pub fn lanes(&self) -> impl Iterator<Item = (usize, usize)> {
        self.lanes[..self.count].iter().map(|&lane| usize::from(lane)).enumerate()
    }

    /// Moves the values of these lanes to their places.
    pub fn compact<T: Copy>(&self, column: &mut [T; LANES]) {
        for (place, lane) in self.lanes() {
            column[place] = column[lane];
        }
    }

    /// The values of these lanes in `column`.
    pub fn take<'a, T: Copy>(&self, column: &[T], to: &'a mut [T; LANES]) -> &'a [T] {
        for (to, (_, lane)) in to.iter_mut().zip(self.lanes()) {
            *to = column[lane];
        }
        &to[..self.count]
    }

    /// Keeps those at whose places `a` exceeds `b`; returns the places that they had.
    pub fn narrow(&mut self, a: &[f32; LANES], b: &[f32; LANES]) -> Picked {
        let kept = Picked::exceeding(a, b, self.count);
        kept.compact(&mut self.lanes);
        self.count = kept.count;
        kept
    }
}
