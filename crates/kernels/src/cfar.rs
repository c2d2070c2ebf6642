//! Thresholds of constant-false-alarm-rate detectors: sums and counts over the reference cells of a row of cells, and
//! the power that several channels receive together.
//!
//! A row begins at some place of a padded map; the reference cells of its first cell are at `place + offsets`, those of
//! the next one place further.

use crate::level::kernels;

/// Sums over the reference cells of `len` cells, up to `N`, from `first` on: always in the order of the offsets.
#[inline(always)]
fn sums<const N: usize>(map: &[f32], first: usize, offsets: &[usize], len: usize) -> [f32; N] {
    let mut sums = [0.0; N];
    for &offset in offsets {
        let cells = &map[first + offset..first + offset + len];
        if cells.len() == N {
            for lane in 0..N {
                sums[lane] += cells[lane];
            }
        } else {
            for (sum, cell) in sums.iter_mut().zip(cells) {
                *sum += cell;
            }
        }
    }
    sums
}

kernels! {
    /// Adds to `sum` the squared magnitudes of complex numbers, of which `parts` holds the real and imaginary parts in
    /// turn.
    pub fn add_power(parts: &[f32], sum: &mut [f32]) {
        for (sum, parts) in sum.chunks_mut(N).zip(parts.chunks(2 * N)) {
            if sum.len() == N {
                let mut power = [0.0; N];
                for lane in 0..N {
                    power[lane] = parts[2 * lane] * parts[2 * lane] + parts[2 * lane + 1] * parts[2 * lane + 1];
                }
                for lane in 0..N {
                    sum[lane] += power[lane];
                }
            } else {
                for (sum, part) in sum.iter_mut().zip(parts.chunks(2)) {
                    *sum += part[0] * part[0] + part[1] * part[1];
                }
            }
        }
    }

    /// Raises each of `thresholds` to at least its `scale` times the sum over its reference cells.
    pub fn raise(map: &[f32], place: usize, offsets: &[usize], scale: &[f32], thresholds: &mut [f32]) {
        for (chunk, (thresholds, scale)) in thresholds.chunks_mut(N).zip(scale.chunks(N)).enumerate() {
            let sums = sums::<N>(map, place + chunk * N, offsets, thresholds.len());
            for ((threshold, scale), sum) in thresholds.iter_mut().zip(scale).zip(sums) {
                let level = scale * sum;
                *threshold = if level > *threshold { level } else { *threshold };
            }
        }
    }

    /// Lowers each of `thresholds` to at most its `scale` times the sum over its reference cells; where the scale is 0,
    /// there are none.
    pub fn lower(map: &[f32], place: usize, offsets: &[usize], scale: &[f32], thresholds: &mut [f32]) {
        for (chunk, (thresholds, scale)) in thresholds.chunks_mut(N).zip(scale.chunks(N)).enumerate() {
            let sums = sums::<N>(map, place + chunk * N, offsets, thresholds.len());
            for ((threshold, scale), sum) in thresholds.iter_mut().zip(scale).zip(sums) {
                let level = scale * sum;
                *threshold = if *scale > 0.0 && level < *threshold { level } else { *threshold };
            }
        }
    }

    /// Lowers each of `margins` to at most by how many its reference cells below `share` times the cell itself, which
    /// is at `place + own`, are more than `needed`, less a half: negative where they are fewer than needed.
    pub fn rank(
        map: &[f32],
        place: usize,
        own: usize,
        offsets: &[usize],
        share: &[f32],
        needed: &[f32],
        margins: &mut [f32],
    ) {
        let rows = margins.chunks_mut(N).zip(share.chunks(N).zip(needed.chunks(N)));
        for (chunk, (margins, (share, needed))) in rows.enumerate() {
            let (first, len) = (place + chunk * N, margins.len());
            let mut limits = [0.0; N];
            for ((limit, share), cell) in limits.iter_mut().zip(share).zip(&map[first + own..first + own + len]) {
                *limit = share * cell;
            }
            let mut counts = [0.0f32; N];
            for &offset in offsets {
                let cells = &map[first + offset..first + offset + len];
                if cells.len() == N {
                    for lane in 0..N {
                        counts[lane] += if cells[lane] < limits[lane] { 1.0 } else { 0.0 };
                    }
                } else {
                    for (lane, cell) in cells.iter().enumerate() {
                        counts[lane] += if *cell < limits[lane] { 1.0 } else { 0.0 };
                    }
                }
            }
            for ((margin, needed), count) in margins.iter_mut().zip(needed).zip(counts) {
                let over = count - needed + 0.5;
                *margin = if over < *margin { over } else { *margin };
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::level::{Level, limit_level};
    use crate::random;

    #[test]
    fn every_level_gives_the_bits_of_the_plain_formula() {
        let mut map = vec![0.0; 700];
        let counters: Vec<u32> = (0..700).collect();
        random::uniforms([3, 4], &counters, 0, &vec![0; 700], 0, &mut map);
        let (offsets, len, own) = ([0, 3, 50, 51, 90], 531, 40);
        let scale: Vec<f32> =
            (0..len).map(|cell| if cell % 7 == 0 { 0.0 } else { 0.3 + 0.001 * cell as f32 }).collect();
        let sum = |cell: usize| offsets.iter().fold(0.0, |sum, offset| sum + map[9 + cell + offset]);
        let count = |cell: usize| {
            let limit = scale[cell] * map[9 + own + cell];
            offsets.iter().filter(|&&offset| map[9 + cell + offset] < limit).count()
        };
        let parts = &map[..2 * 333];
        for level in Level::here() {
            limit_level(level);
            let (mut raised, mut lowered, mut margins) = (vec![0.4; len], vec![0.4; len], vec![9.0; len]);
            raise(&map, 9, &offsets, &scale, &mut raised);
            lower(&map, 9, &offsets, &scale, &mut lowered);
            rank(&map, 9, own, &offsets, &scale, &vec![2.0; len], &mut margins);
            let mut power = vec![1.0; 333];
            add_power(parts, &mut power);
            for cell in 0..len {
                assert_eq!(raised[cell], (scale[cell] * sum(cell)).max(0.4));
                let lower = if scale[cell] > 0.0 { (scale[cell] * sum(cell)).min(0.4) } else { 0.4 };
                assert_eq!(lowered[cell], lower);
                assert_eq!(margins[cell], count(cell) as f32 - 1.5);
            }
            for (cell, power) in power.iter().enumerate() {
                assert_eq!(*power, 1.0 + (parts[2 * cell].powi(2) + parts[2 * cell + 1].powi(2)));
            }
        }
        limit_level(Level::Avx512);
    }
}
