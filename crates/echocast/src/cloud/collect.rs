//! From lanes to rows: which beams of a block have a return, and where their values go.

use super::Element;
use crate::ground::lanes::{LANES, MISS};
use echocast_kernels::rows;

/// The lanes of a block that become rows.
pub(crate) struct Kept {
    /// Lane of each row; bytes reach every lane of a block and no other, so no index needs a check.
    lanes: [u8; LANES],
    rows: usize,
    /// Whether row i is lane i.
    contiguous: bool,
    /// Lanes without a return that have a row all the same (organised clouds).
    misses: bool,
}

const _: () = assert!(LANES == 1 << u8::BITS);

impl Kept {
    pub(crate) fn new() -> Self {
        Kept { lanes: [0; LANES], rows: 0, contiguous: true, misses: false }
    }

    /// Chooses among the first `count` lanes those that hit a surface, or all when `organised`; returns how many.
    pub(crate) fn choose(&mut self, surface: &[u32; LANES], count: usize, organised: bool) -> usize {
        let hits = rows::choose(surface, count, &mut self.lanes);
        self.misses = organised && hits < count;
        self.contiguous = organised || hits == count;
        self.rows = if organised { count } else { hits };
        self.rows
    }

    /// Writes what every beam has, return or not.
    pub(crate) fn put_beam<T: Element>(&self, from: &[T; LANES], to: &mut [T]) {
        if to.is_empty() {
            return;
        }
        let to = &mut to[..self.rows];
        if self.contiguous {
            to.copy_from_slice(&from[..self.rows]);
        } else {
            for (row, &lane) in to.iter_mut().zip(&self.lanes) {
                *row = from[lane as usize];
            }
        }
    }

    /// Writes what only returns have; misses of organised clouds get the type's miss value.
    pub(crate) fn put<T: Element>(&self, surface: &[u32; LANES], from: &[T; LANES], to: &mut [T]) {
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
        let mut kept = Kept::new();
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

        assert_eq!(kept.choose(&[0; LANES], LANES, false), LANES);
        kept.put::<f32>(&surface, &value, &mut []);
    }
}
