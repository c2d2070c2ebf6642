//! Where the files are that a survey names.

use ground::shown;
use regex::Regex;
use std::fs;
use std::path::{Path, PathBuf};

/// Folders in which files are looked for: that of the survey, then those given.
#[derive(Clone, Debug)]
pub(crate) struct AssetFolders(Vec<PathBuf>);

impl AssetFolders {
    /// Those of the survey at `survey`, and `more`.
    pub fn new(survey: &Path, more: &[PathBuf]) -> AssetFolders {
        let own = survey.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        AssetFolders([own.to_owned()].into_iter().chain(more.iter().cloned()).collect())
    }

    /// The places where the file `name` may be, by folder. HELIOS++ has its data in a folder `data`, or, since surveys
    /// were written, those of platforms and scanners in `python/pyhelios/data` (3dgeo-heidelberg/helios fd94d1f).
    ///
    /// # Errors
    /// A name that leads out of all folders.
    fn candidates(&self, name: &str) -> Result<Vec<PathBuf>, String> {
        let name = name.trim();
        let short = name.strip_prefix("data/").unwrap_or(name);
        let mut found = Vec::new();
        for folder in &self.0 {
            // Joined to an absolute name, a folder is gone.
            if scene_files::inside(folder, &folder.join(name)).is_none() {
                continue;
            }
            let moved = [format!("python/pyhelios/{name}"), format!("python/pyhelios/data/{short}")];
            let spelled = [name, short].into_iter().chain(moved.iter().map(String::as_str));
            found.extend(spelled.filter_map(|spelled| scene_files::inside(folder, &folder.join(spelled))));
        }
        if found.is_empty() {
            let name = shown::name(name);
            return Err(format!(
                "{name:?} leads out of the folder of the survey and of --assets; allowed: files in them"
            ));
        }
        found.dedup();
        Ok(found)
    }

    /// The file `name`.
    ///
    /// # Errors
    /// What is wrong, as the end of a sentence about the name: it leads out of all folders, or there is no such file.
    pub fn find(&self, name: &str) -> Result<PathBuf, String> {
        let found = self.candidates(name)?.into_iter().find(|path| path.is_file());
        found.ok_or_else(|| {
            let folders: Vec<_> = self.0.iter().map(|folder| shown::path(folder)).collect();
            format!(
                "{:?} is not in {}; allowed: a file there, or in a folder of --assets",
                shown::name(name),
                folders.join(", ")
            )
        })
    }

    /// The files whose names match the last part of `name`, a regular expression, in the folder of its other parts.
    ///
    /// # Errors
    /// As [`AssetFolders::find`]; an invalid expression.
    pub fn matching(&self, name: &str) -> Result<Vec<PathBuf>, String> {
        let (folder, expression) = name.rsplit_once('/').unwrap_or((".", name));
        let expression = Regex::new(&format!("^(?:{expression})$")).map_err(|_| {
            format!("{:?} is no regular expression; allowed: one for names of files", shown::name(expression))
        })?;
        for folder in self.candidates(folder)? {
            let names = fs::read_dir(&folder).into_iter().flatten().filter_map(|entry| entry.ok());
            let matches = |path: &PathBuf| {
                path.is_file()
                    && path.file_name().and_then(|name| name.to_str()).is_some_and(|name| expression.is_match(name))
            };
            let mut files: Vec<PathBuf> = names.map(|entry| entry.path()).filter(matches).collect();
            if !files.is_empty() {
                files.sort();
                return Ok(files);
            }
        }
        Err(format!("{:?} matches no file; allowed: an expression for names of files in a folder", shown::name(name)))
    }

    /// Splits `file#id`; the file is that at `here` where there is none.
    pub fn reference<'n>(&self, here: &Path, name: &'n str) -> Result<(PathBuf, &'n str), String> {
        match name.split_once('#') {
            Some((file, id)) => Ok((self.find(file)?, id)),
            None => Ok((here.to_owned(), name)),
        }
    }
}
