//! From lanes to rows: which beams of a block have a return, and where their values are written.

use super::Element;
use echocast_kernels::rows;
use ground::lanes::{LANES, MISS};

/// The lanes of a block that become rows.
pub struct Kept {
    /// Lane of each row; a byte can index every lane of a block and nothing beyond, so no index needs a check.
    lanes: [u8; LANES],
    rows: usize,
    /// First row and end of each run of rows with consecutive lanes, which is copied at once; none where runs are many
    /// and short.
    runs: [[u16; 2]; MOST_RUNS],
    run_count: usize,
    /// Whether lanes without a return have a row as well (organised clouds).
    misses: bool,
}

const _: () = assert!(LANES == 1 << u8::BITS);

/// Up to this many runs are copied faster one by one than lane by lane.
const MOST_RUNS: usize = 16;

impl Default for Kept {
    /// Without any rows; [`Kept::choose`] selects them.
    fn default() -> Self {
        Kept { lanes: [0; LANES], rows: 0, runs: [[0; 2]; MOST_RUNS], run_count: 0, misses: false }
    }
}

impl Kept {
    /// Selects among the first `count` lanes those that hit a surface, or all when `organised`; returns how many.
    pub fn choose(&mut self, surface: &[u32; LANES], count: usize, organised: bool) -> usize {
        let hits = rows::choose(surface, count, &mut self.lanes);
        self.misses = organised && hits < count;
        self.rows = if organised { count } else { hits };
        if organised || hits == count {
            (self.runs[0], self.run_count) = ([0, self.rows as u16], 1);
        } else {
            self.run_count = rows::runs(&self.lanes[..hits], &mut self.runs);
        }
        self.rows
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Whether row i is lane i and none is a miss.
    pub fn are_first_lanes(&self) -> bool {
        let [first, end] = self.runs[0];
        !self.misses && self.run_count == 1 && self.lanes[usize::from(first)] == 0 && usize::from(end) == self.rows
    }

    /// Writes values that every beam has, with or without a return.
    pub fn put_beam<T: Element>(&self, from: &[T; LANES], to: &mut [T]) {
        if to.is_empty() {
            return;
        }
        let to = &mut to[..self.rows];
        for &[first, end] in &self.runs[..self.run_count] {
            // With misses among the rows, row i is lane i.
            let lane = if self.misses { 0 } else { usize::from(self.lanes[usize::from(first)]) };
            let rows = usize::from(first)..usize::from(end);
            to[rows.clone()].copy_from_slice(&from[lane..lane + rows.len()]);
        }
        if self.run_count == 0 {
            for (row, &lane) in to.iter_mut().zip(&self.lanes) {
                *row = from[lane as usize];
            }
        }
    }

    /// Writes values that only returns have; misses of organised clouds get the type's miss value.
    pub fn put<T: Element>(&self, surface: &[u32; LANES], from: &[T; LANES], to: &mut [T]) {
        if to.is_empty() {
            return;
        }
        self.put_beam(from, to);
        if self.misses {
            for (row, &surface) in to[..self.rows].iter_mut().zip(surface) {
                if surface == MISS {
                    *row = T::MISS;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn returns_move_up_or_keep_their_places() {
        let mut surface = [MISS; LANES];
        surface[1] = 5;
        surface[4] = 0;
        let value: [f32; LANES] = std::array::from_fn(|lane| lane as f32);
        let mut kept = Kept::default();
        assert_eq!(kept.choose(&surface, 6, false), 2);
        let mut rows = [-1.0; 8];
        kept.put(&surface, &value, &mut rows);
        assert_eq!(rows[..3], [1.0, 4.0, -1.0]);

        assert_eq!(kept.choose(&surface, 6, true), 6);
        kept.put(&surface, &value, &mut rows);
        assert!(rows[0].is_nan() && rows[5].is_nan() && rows[6] == -1.0);
        assert_eq!((rows[1], rows[4]), (1.0, 4.0));
        kept.put_beam(&value, &mut rows);
        assert_eq!(rows[..6], value[..6]);

        // Every third lane is a miss, then all but every fiftieth: one by one, and in runs.
        for (every, hit) in [(3, false), (3, true), (50, true), (50, false), (LANES, true), (LANES, false)] {
            let surface = std::array::from_fn(|lane| if (lane % every == every - 1) == hit { 0 } else { MISS });
            let expected: Vec<f32> = (0..LANES).filter(|&lane| surface[lane] == 0).map(|lane| lane as f32).collect();
            let mut rows = vec![-1.0; expected.len() + 1];
            assert_eq!(kept.choose(&surface, LANES, false), expected.len());
            kept.put(&surface, &value, &mut rows);
            assert_eq!((&rows[..expected.len()], rows[expected.len()]), (&expected[..], -1.0));
        }

        assert_eq!(kept.choose(&[0; LANES], LANES, false), LANES);
        kept.put::<f32>(&surface, &value, &mut []);
    }
}
