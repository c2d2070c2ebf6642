//! Compacts lanes into rows.

use crate::level::kernels;
use crate::{Lanes, MISS};

/// Lists those of the first `count` lanes that `are` so; returns how many there are.
#[inline(always)]
fn list(count: usize, lanes: &mut Lanes<u8>, are: impl Fn(usize) -> bool) -> usize {
    let mut found = 0;
    for lane in 0..count.min(lanes.len()) {
        // A byte can index every lane of a block and no other, so no index needs a check.
        lanes[found & 0xff] = lane as u8;
        found += usize::from(are(lane));
    }
    found
}

kernels! {
    /// Lists those of the first `count` lanes that have a surface; returns how many there are.
    pub fn choose(surface: &Lanes<u32>, count: usize, lanes: &mut Lanes<u8>) -> usize {
        list(count, lanes, |lane| surface[lane] != MISS)
    }

    /// Lists those of the first `count` lanes that have the surface `which`; returns how many there are.
    pub fn of_surface(surface: &Lanes<u32>, which: u32, count: usize, lanes: &mut Lanes<u8>) -> usize {
        list(count, lanes, |lane| surface[lane] == which)
    }

    /// Lists those of the first `count` lanes in which `a` exceeds `b`; returns how many there are.
    pub fn exceeding(a: &Lanes, b: &Lanes, count: usize, lanes: &mut Lanes<u8>) -> usize {
        list(count, lanes, |lane| a[lane] > b[lane])
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
