//! Compacts lanes into rows.

use crate::level::kernels;
use crate::{Lanes, MISS};

kernels! {
    /// Lists those of the first `count` lanes that have a surface; returns how many there are.
    pub fn choose(surface: &Lanes<u32>, count: usize, lanes: &mut Lanes<u8>) -> usize {
        let mut hits = 0;
        for lane in 0..count.min(surface.len()) {
            // A byte can index every lane of a block and no other, so no index needs a check.
            lanes[hits & 0xff] = lane as u8;
            hits += usize::from(surface[lane] != MISS);
        }
        hits
    }

    /// Lists those of the first `count` lanes that have the surface `which`; returns how many there are.
    pub fn of_surface(surface: &Lanes<u32>, which: u32, count: usize, lanes: &mut Lanes<u8>) -> usize {
        let mut found = 0;
        for lane in 0..count.min(surface.len()) {
            lanes[found & 0xff] = lane as u8;
            found += usize::from(surface[lane] == which);
        }
        found
    }

    /// Lists those of the first `count` lanes in which `a` exceeds `b`; returns how many there are.
    pub fn exceeding(a: &Lanes, b: &Lanes, count: usize, lanes: &mut Lanes<u8>) -> usize {
        let mut found = 0;
        for lane in 0..count.min(a.len()) {
            lanes[found & 0xff] = lane as u8;
            found += usize::from(a[lane] > b[lane]);
        }
        found
    }
}

/// First and end of each run of consecutive `lanes`; returns how many there are, 0 if there are more than `runs` has
/// room for.
pub fn runs(lanes: &[u8], runs: &mut [[u16; 2]]) -> usize {
    let (mut first, mut count) = (0, 0);
    for end in 1..=lanes.len() {
        if end < lanes.len() && lanes[end] == lanes[end - 1] + 1 {
            continue;
        }
        let Some(run) = runs.get_mut(count) else { return 0 };
        *run = [first as u16, end as u16];
        (first, count) = (end, count + 1);
    }
    count
}
