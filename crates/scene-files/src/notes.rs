//! Warnings that readers collect about a file.

use ground::report::Report;
use ground::shown;
use std::path::Path;

/// Notes worth a warning, reported once per kind however often they occur.
#[derive(Default)]
pub(super) struct Notes(Vec<Note>);

struct Note {
    what: &'static str,
    count: usize,
    /// Place of the first occurrence.
    first: String,
}

impl Notes {
    pub fn add(&mut self, what: &'static str, place: impl FnOnce() -> String) {
        match self.0.iter_mut().find(|note| note.what == what) {
            Some(note) => note.count += 1,
            None => self.0.push(Note { what, count: 1, first: place() }),
        }
    }

    pub fn report_to(self, origin: &Path, report: &mut Report) {
        for Note { what, count, first } in self.0 {
            let more = if count > 1 { format!(" and {} more", count - 1) } else { String::new() };
            report.warn(format!("{}: {what}: {first}{more}", shown::path(origin)));
        }
    }
}
