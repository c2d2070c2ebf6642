//! Ctrl-C and termination: unfinished files go, older files stay.

use anyhow::{Context as _, Result};
use echocast::export;
use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::exit;

/// What shells report of a program that was interrupted: 128 + SIGINT.
const INTERRUPTED: i32 = 130;

/// When the program is interrupted, removes what it was writing in `folders`, and ends it.
pub fn clean_up_in(folders: Vec<PathBuf>) -> Result<()> {
    ctrlc::set_handler(move || {
        folders.iter().for_each(|folder| remove_unfinished(folder));
        let _ = writeln!(std::io::stderr(), "error: interrupted; files that were complete stay, others are gone");
        exit(INTERRUPTED);
    })
    .context("cannot listen to Ctrl-C")
}

fn remove_unfinished(folder: &Path) {
    let ours = export::unfinished_prefix();
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        if entry.file_name().to_string_lossy().starts_with(&ours) {
            let _ = fs::remove_file(entry.path());
        }
    }
}
