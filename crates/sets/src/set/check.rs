//! Whether the files of a set are as they were written.

use super::manifest::{self, Entry};
use super::origin::{Origin, need_origin};
use super::whole;
use ground::error::Result;
use std::collections::BTreeMap;
use std::path::Path;

/// Faults of the set in `root`, one sentence each: files that are missing or changed, samples that have failed or are
/// missing.
///
/// # Errors
/// There is no set; a manifest that names files outside the set.
pub fn check_folder(root: &Path) -> Result<Vec<String>> {
    let origin = need_origin(root)?;
    let entries = manifest::read(root)?;
    let mut faults = missing(&origin, &entries).into_iter().collect::<Vec<_>>();
    for entry in entries.values() {
        if let Some(error) = &entry.error {
            faults.push(format!("sample {} has failed: {error}", entry.sample));
        }
        faults.extend(damages(root, &origin, entry));
    }
    faults.extend(whole::read(root)?.iter().filter_map(|file| file.fault(root)));
    Ok(faults)
}

/// Faults of the files of a sample, one sentence each: files that are missing or changed, styles without files.
pub(super) fn damages(root: &Path, origin: &Origin, entry: &Entry) -> impl Iterator<Item = String> {
    let is_of = |file: &str, name: &str| file.strip_prefix(name).is_some_and(|rest| rest.starts_with('/'));
    let has = move |name: &str| entry.files.iter().any(|file| is_of(&file.path, name));
    let bare = origin.roots.iter().filter(move |name| entry.error.is_none() && !has(name));
    let bare = bare.map(|name| format!("sample {} has no file in {name}", entry.sample));
    entry.files.iter().filter_map(move |file| file.fault(root)).chain(bare)
}

/// A sentence about missing samples, if there are any.
pub(super) fn missing(origin: &Origin, entries: &BTreeMap<u64, Entry>) -> Option<String> {
    let count = origin.samples - entries.range(..origin.samples).count() as u64;
    let first = (0..origin.samples).find(|sample| !entries.contains_key(sample))?;
    Some(match count {
        1 => format!("sample {first} is missing"),
        _ => format!("{count} of {} samples are missing, the first is {first}", origin.samples),
    })
}
