//! From lanes to rows.

use crate::level::kernels;
use crate::{Lanes, MISS};

kernels! {
    /// Lists the first `count` lanes that have a surface; returns how many there are.
    pub fn choose(surface: &Lanes<u32>, count: usize, lanes: &mut Lanes<u8>) -> usize {
        let mut hits = 0;
        for lane in 0..count.min(surface.len()) {
            // Bytes reach every lane of a block and no other, so no index needs a check.
            lanes[hits & 0xff] = lane as u8;
            hits += usize::from(surface[lane] != MISS);
        }
        hits
    }
}
