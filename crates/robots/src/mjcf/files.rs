//! A model and the files that it includes.

use crate::folders::ModelFolders;
use ground::error::Result;
use ground::read::Limit;
use ground::read::xml::{Xml, XmlText};
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// Most files of a model.
const MOST_FILES: usize = 1000;

/// The texts of the files that a model includes, by their paths.
pub(super) struct IncludedTexts(Vec<(PathBuf, XmlText)>);

impl IncludedTexts {
    /// Reads what the model at `root` includes, and what that includes.
    ///
    /// # Errors
    /// A file that is not there, is not XML, or includes itself.
    pub fn load(root: Xml<'_>, folders: ModelFolders<'_>) -> Result<IncludedTexts> {
        let main = root.path();
        let mut texts: Vec<(PathBuf, XmlText)> = Vec::new();
        let mut open = included(root, main, folders)?;
        while let Some(path) = open.pop() {
            if path == main || texts.iter().any(|(known, _)| *known == path) {
                // MuJoCo allows this neither.
                return Err(root
                    .error(format_args!("includes {:?} twice; allowed: each file once", ground::shown::path(&path))));
            }
            if texts.len() == MOST_FILES {
                return Err(root.error(format_args!("includes more than {MOST_FILES} files, the most allowed")));
            }
            let text = XmlText::load(&path, Limit::XML)?;
            open.extend(included(Xml::root(&text.parse()?, &text), main, folders)?);
            texts.push((path, text));
        }
        Ok(IncludedTexts(texts))
    }

    /// Their texts.
    pub fn texts(&self) -> impl Iterator<Item = (&Path, &XmlText)> {
        self.0.iter().map(|(path, text)| (path.as_path(), text))
    }
}

/// The files that `root` includes; MuJoCo looks for all in the folder of the model.
fn included(root: Xml<'_>, main: &Path, folders: ModelFolders<'_>) -> Result<Vec<PathBuf>> {
    let mut open = vec![root];
    let mut found = Vec::new();
    while let Some(element) = open.pop() {
        if element.name() == "include" {
            found.push(include_path(element, main, folders)?);
        }
        open.extend(element.elements());
    }
    Ok(found)
}

fn include_path(include: Xml<'_>, main: &Path, folders: ModelFolders<'_>) -> Result<PathBuf> {
    let file = include.required("file")?;
    folders.find(main, file).map_err(|why| include.error(format_args!("file {why}")))
}

/// The elements of a model, with those of included files where they are included.
pub(super) struct MjcfTree<'d, 'o> {
    /// The outermost elements of included files.
    pub roots: HashMap<&'d Path, Xml<'d>>,
    pub main: &'d Path,
    pub folders: ModelFolders<'o>,
}

impl<'d> MjcfTree<'d, '_> {
    /// The elements in `element`.
    pub fn children(&self, element: Xml<'d>) -> Vec<Xml<'d>> {
        let mut found = Vec::new();
        let mut open: Vec<Xml<'d>> = element.elements().collect();
        open.reverse();
        while let Some(element) = open.pop() {
            if element.name() != "include" {
                found.push(element);
                continue;
            }
            // It was found before.
            let path = include_path(element, self.main, self.folders).ok();
            if let Some(root) = path.and_then(|path| self.roots.get(path.as_path()).copied()) {
                let inner: Vec<Xml<'d>> = root.elements().collect();
                open.extend(inner.into_iter().rev());
            }
        }
        found
    }
}
