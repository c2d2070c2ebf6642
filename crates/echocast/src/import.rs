//! Files to clouds: one file per format, one table of readers.

#[doc(inline)]
pub use cloud::import::{CloudReader, READERS, ReadOptions, is_cloud, read, read_with};
