//! Writing files: they appear under their names only when they are complete, and this process removes unfinished ones
//! when it is stopped.

mod atomic;
pub mod sink;
mod unfinished;

use crate::error::Result;
pub use atomic::{Pending, commit_all};
pub use sink::Sink;
use std::io::{self, Write as _};
use std::path::Path;
#[cfg(feature = "hdf5")]
pub use unfinished::check;
pub use unfinished::{PREFIX, failed};
pub use unfinished::{cancel_flag, remove_unfinished};

/// Writes `bytes` as the file at `path`.
pub fn bytes(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut file = Sink::create(path)?;
    file.write_all(bytes)?;
    file.finish()
}

/// [`bytes`] whose error names the file.
///
/// # Errors
/// The system's errors.
pub fn whole(path: &Path, content: &[u8]) -> Result<()> {
    bytes(path, content).map_err(|source| failed(path, source))
}
