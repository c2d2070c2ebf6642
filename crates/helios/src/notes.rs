//! What becomes of each element and attribute of a survey.

use serde::Serialize;
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// What became of an element or an attribute.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(tag = "outcome", content = "how", rename_all = "snake_case")]
pub enum ImportOutcome {
    /// It has the effect that it has in HELIOS++.
    Used,
    /// It has a similar effect: which.
    Approximated(String),
    /// It has no effect: why.
    NotUnderstood(String),
}

/// An element or an attribute, and what became of it.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ImportNote {
    /// File that it is in.
    pub file: PathBuf,
    /// Its line, from 1.
    pub line: u32,
    /// Name of the element.
    pub element: String,
    /// Name of the attribute; none: the element itself.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub attribute: Option<String>,
    /// Value of the attribute.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub value: Option<String>,
    /// What became of it.
    #[serde(flatten)]
    pub outcome: ImportOutcome,
}

/// Where an element is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct XmlPlace {
    /// Number of the file in the notes.
    pub file: u32,
    /// Number of the element in the file, which rises along it.
    pub node: u32,
    /// Line of its beginning.
    pub line: u32,
}

/// Notes while a survey is read and converted.
#[derive(Default)]
pub(crate) struct NoteBook(RefCell<Pages>);

#[derive(Default)]
struct Pages {
    files: Vec<PathBuf>,
    /// By file, element, and name of the attribute, which is empty for the element itself.
    lines: BTreeMap<(u32, u32, String), NoteLine>,
}

struct NoteLine {
    line: u32,
    element: String,
    value: Option<String>,
    /// None: nothing has asked for it.
    outcome: Option<ImportOutcome>,
}

impl NoteBook {
    /// The number of a file.
    pub fn file(&self, path: &Path) -> u32 {
        let files = &mut self.0.borrow_mut().files;
        let known = files.iter().position(|file| file == path);
        known.unwrap_or_else(|| {
            files.push(path.to_owned());
            files.len() - 1
        }) as u32
    }

    /// The path of the file of `place`.
    pub fn path(&self, place: XmlPlace) -> PathBuf {
        self.0.borrow().files[place.file as usize].clone()
    }

    /// Notes that there is an element, or an attribute with its value, which counts as not understood until it is used.
    pub fn found(&self, place: XmlPlace, element: &str, attribute: Option<(&str, &str)>) {
        let (name, value) = attribute.unzip();
        let key = (place.file, place.node, name.unwrap_or_default().to_owned());
        let line =
            NoteLine { line: place.line, element: element.to_owned(), value: value.map(str::to_owned), outcome: None };
        self.0.borrow_mut().lines.entry(key).or_insert(line);
    }

    /// Notes that an attribute has the effect it has in HELIOS++, unless something else has been noted; an empty name
    /// stands for the element.
    pub fn used(&self, place: XmlPlace, attribute: &str) {
        if let Some(line) = self.0.borrow_mut().lines.get_mut(&(place.file, place.node, attribute.to_owned())) {
            line.outcome.get_or_insert(ImportOutcome::Used);
        }
    }

    /// Notes that an attribute, if it is there, has a similar effect.
    pub fn approximated(&self, place: XmlPlace, attribute: &str, how: impl Into<String>) {
        self.set(place, attribute, ImportOutcome::Approximated(how.into()));
    }

    /// Notes that an attribute, if it is there, has no effect.
    pub fn not_understood(&self, place: XmlPlace, attribute: &str, why: impl Into<String>) {
        self.set(place, attribute, ImportOutcome::NotUnderstood(why.into()));
    }

    fn set(&self, place: XmlPlace, attribute: &str, outcome: ImportOutcome) {
        if let Some(line) = self.0.borrow_mut().lines.get_mut(&(place.file, place.node, attribute.to_owned())) {
            line.outcome = Some(outcome);
        }
    }

    /// The notes, in the order of the files.
    pub fn finish(self) -> Vec<ImportNote> {
        let Pages { files, lines } = self.0.into_inner();
        let unknown = |attribute: &str, line: &NoteLine| {
            let name = if attribute.is_empty() {
                format!("<{}>", line.element)
            } else {
                format!("{} {attribute}", line.element)
            };
            ImportOutcome::NotUnderstood(format!("{name} is not known"))
        };
        let note = |((file, _, attribute), line): ((u32, u32, String), NoteLine)| ImportNote {
            file: files[file as usize].clone(),
            line: line.line,
            outcome: line.outcome.clone().unwrap_or_else(|| unknown(&attribute, &line)),
            element: line.element,
            attribute: Some(attribute).filter(|name| !name.is_empty()),
            value: line.value,
        };
        lines.into_iter().map(note).collect()
    }
}
