//! The files that OBJ and MTL files reference.

use crate::{inside, outside};
use std::path::{Path, PathBuf};

/// The file that a name refers to, if any, or why it must not be read.
type FoundFile = Result<Option<PathBuf>, String>;

/// Where material files and images of a scene may be.
#[derive(Clone, Copy)]
pub(crate) struct Files<'a> {
    /// The folder of the scene.
    pub folder: &'a Path,
    /// Whether they may be outside that folder.
    pub allow_outside: bool,
}

impl Files<'_> {
    /// The file that `name` refers to in the file `from`: as written, with Windows separators, or, because many files
    /// carry paths of the machine they were made on, its last component in the folder of `from`. Folders do not count.
    ///
    /// # Errors
    /// A file that exists, but where files are not allowed.
    pub fn find(self, from: &Path, name: &str) -> FoundFile {
        let slashed = name.replace('\\', "/");
        let last = slashed.rsplit('/').next().unwrap_or(&slashed);
        for name in [name, &slashed, last].into_iter().filter(|name| !name.is_empty()) {
            let path = from.with_file_name(name);
            let path = match inside(self.folder, &path).filter(|_| !name.starts_with('/')) {
                Some(path) => path,
                None if self.allow_outside || !is_there(&path) => path,
                None => return Err(outside(name)),
            };
            if is_there(&path) {
                return Ok(Some(path));
            }
        }
        Ok(None)
    }

    /// The files that a `mtllib` in the file `from` names, with the names searched for: one name with blanks, or
    /// several names that end in `.mtl`.
    ///
    /// # Errors
    /// As [`Files::find`].
    pub fn libraries(self, from: &Path, names: &str) -> Result<Vec<(String, Option<PathBuf>)>, String> {
        if let Some(path) = self.find(from, names)? {
            return Ok(vec![(names.to_owned(), Some(path))]);
        }
        let mut pieces = vec![String::new()];
        for word in names.split_whitespace() {
            if let Some(piece) = pieces.last_mut() {
                if !piece.is_empty() {
                    piece.push(' ');
                }
                piece.push_str(word);
            }
            if word.to_ascii_lowercase().ends_with(".mtl") {
                pieces.push(String::new());
            }
        }
        pieces.retain(|piece| !piece.is_empty());
        pieces.into_iter().map(|piece| Ok((piece.clone(), self.find(from, &piece)?))).collect()
    }
}

/// Whether there is something to read, or to report as unreadable (pipes and devices).
fn is_there(path: &Path) -> bool {
    path.metadata().is_ok_and(|found| !found.is_dir())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn files_are_found_under_the_names_people_write() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::create_dir(at("sub")).unwrap();
        for name in ["a.mtl", "my b.mtl", "sub/c.mtl", "no ending"] {
            fs::write(at(name), "").unwrap();
        }
        let files = Files { folder: folder.path(), allow_outside: false };
        let found = |names: &str| -> Vec<Option<PathBuf>> {
            let libraries = files.libraries(&at("scene.obj"), names).unwrap();
            libraries.into_iter().map(|(_, path)| path).collect()
        };
        assert_eq!(found("my b.mtl"), [Some(at("my b.mtl"))]);
        assert_eq!(found("a.mtl my b.mtl gone.mtl"), [Some(at("a.mtl")), Some(at("my b.mtl")), None]);
        assert_eq!(found("sub\\c.mtl  sub/c.mtl"), [Some(at("sub/c.mtl")), Some(at("sub/c.mtl"))]);
        assert_eq!(found("C:\\Users\\me\\a.mtl"), [Some(at("a.mtl"))]);
        assert_eq!(found("/home/of/somebody/a.mtl"), [Some(at("a.mtl"))]);
        assert_eq!(found("../../gone/a.mtl"), [Some(at("a.mtl"))]);
        assert_eq!(found("no ending"), [Some(at("no ending"))]);
        assert_eq!(found("sub"), [None], "a folder is no file");
        assert_eq!(found(""), []);
    }

    #[test]
    fn files_elsewhere_are_found_where_that_is_allowed() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::create_dir_all(at("mats/here/sub")).unwrap();
        for name in ["mats/x.png", "mats/here/x.png", "mats/here/y.png", "y.png"] {
            fs::write(at(name), "").unwrap();
        }
        let scene = at("mats/here");
        let found = |allow_outside, from: &str, name: &str| {
            Files { folder: &scene, allow_outside }.find(&scene.join(from), name).map(Option::unwrap)
        };
        // A material file in a subfolder may refer back to the folder of the scene, but no further up.
        assert_eq!(found(false, "sub/a.mtl", "../x.png").unwrap(), at("mats/here/x.png"));
        for name in ["../../x.png", "..\\..\\x.png", at("y.png").to_str().unwrap()] {
            let error = found(false, "sub/a.mtl", name).unwrap_err();
            assert!(error.contains("leads out of the folder of the scene; allowed: "), "{error}");
            assert!(error.contains("--allow-outside-paths"), "{error}");
        }
        assert_eq!(found(true, "sub/a.mtl", "../../x.png").unwrap(), at("mats/here/sub/../../x.png"));
        assert_eq!(found(true, "a.mtl", at("y.png").to_str().unwrap()).unwrap(), at("y.png"));
    }
}
