//! What the files of samples are called.

use std::path::{Path, PathBuf};

/// `000017`: the text of sample numbers sorts like the numbers.
pub(super) fn numbered(sample: u64) -> String {
    format!("{sample:06}")
}

/// The folder of a sample in that of a style.
pub(super) fn sample_folder(root: &str, sample: u64) -> PathBuf {
    Path::new(root).join(numbered(sample))
}

/// `name` as a file name: characters that could have a special meaning there become `_`.
pub(super) fn file_name(name: &str) -> String {
    name.chars().map(|letter| if letter.is_alphanumeric() || "-_.".contains(letter) { letter } else { '_' }).collect()
}
