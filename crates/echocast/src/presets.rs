//! The preset files that ship inside the library.

/// `(path below presets/, text)` of every embedded file whose path starts with `folder`.
pub(crate) fn embedded(folder: &str) -> impl Iterator<Item = (&'static str, &'static str)> {
    EMBEDDED.iter().copied().filter(move |(path, _)| path.starts_with(folder))
}

include!(concat!(env!("OUT_DIR"), "/presets.rs"));
