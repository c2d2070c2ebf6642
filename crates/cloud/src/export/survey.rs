//! What the formats of survey programs share: samples of few bits, records with their lengths.

use crate::cells::Layout;
use std::io;

/// Whether a sample of `steps`, clamped to between `least` and `most`, loses information on `level`; below the noise
/// there is none.
pub(super) fn is_lost(level: f32, steps: f32, [least, most]: [f32; 2], layout: &Layout) -> bool {
    level.is_nan() || steps > most || steps < least && level >= layout.noise_db
}

/// The number of bytes of a record, in the 32 bits of its length member.
pub(super) fn record_length(bytes: usize) -> io::Result<u32> {
    let reason = "a ping takes more than 4 GB; allowed: what 32 bits can hold";
    u32::try_from(bytes).map_err(|_| io::Error::new(io::ErrorKind::FileTooLarge, reason))
}
