//! Where the files are that robots name.

use ground::read::Limit;
use ground::read::xml::{Xml, XmlText};
use ground::shown;
use scene_files::inside;
use std::path::{Path, PathBuf};

/// The files by which a folder is known as a package of ROS, or as a model of Gazebo.
const MANIFESTS: [&str; 2] = ["package.xml", "model.config"];

/// Folders in which files are looked for, in this order: that of the file that names them, then those given. Files in
/// other folders are not read, unless that is allowed.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ModelFolders<'o> {
    /// Those given.
    pub given: &'o [PathBuf],
    /// Whether files may be anywhere.
    pub anywhere: bool,
}

impl ModelFolders<'_> {
    /// The file or folder that `uri` means in the file at `here`: `package://NAME/…` and `model://NAME/…` in a folder
    /// NAME in a given one, in a given one that is called so, or in one above `here` that is called so and has a
    /// manifest; `file://…` and paths from the folder of `here`, then in the given ones.
    ///
    /// # Errors
    /// The end of a sentence about the URI: it leads out of the folders, or is not there, with the paths searched.
    pub fn find(&self, here: &Path, uri: &str) -> Result<PathBuf, String> {
        let own = here.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let uri = uri.trim();
        let (searched, refused) = match uri.split_once("://") {
            Some(("package" | "model", rest)) => {
                let searched = self.in_packages(own, rest);
                let refused = searched.is_empty();
                (searched, refused)
            }
            Some(("file", rest)) => self.in_folders(own, rest),
            Some((scheme, _)) => {
                let scheme = shown::name(scheme).to_string();
                return Err(format!(
                    "{:?} has the scheme {scheme:?}; allowed: package://, model://, file://, and paths",
                    shown::name(uri)
                ));
            }
            None => self.in_folders(own, uri),
        };
        if let Some(found) = searched.iter().find(|path| path.exists()) {
            return Ok(found.clone());
        }
        let name = shown::name(uri).to_string();
        if searched.is_empty() && refused {
            return Err(format!(
                "{name:?} leads out of the folder of the file and of those given; allowed: files in them, or any with \
                 allow_outside_paths (--allow-outside-paths)"
            ));
        }
        let paths: Vec<String> = searched.iter().map(|path| shown::path(path)).collect();
        Err(format!(
            "{name:?} is not there; searched: {}; allowed: a file in the folder of the file or of model_paths \
             (--model-path)",
            shown::some_of(&paths)
        ))
    }

    /// The paths that a path may mean, and whether some were refused.
    fn in_folders(&self, own: &Path, name: &str) -> (Vec<PathBuf>, bool) {
        let own = std::path::absolute(own).unwrap_or_else(|_| own.to_owned());
        // The meshes of a package are often beside the folder of its robots.
        let package = own.ancestors().find(|folder| is_package(folder));
        let allowed = || [own.as_path()].into_iter().chain(package).chain(self.given.iter().map(PathBuf::as_path));
        let mut refused = false;
        let mut found = Vec::new();
        for folder in [own.as_path()].into_iter().chain(self.given.iter().map(PathBuf::as_path)) {
            // Joined to an absolute name, a folder is gone.
            let path = folder.join(name);
            match allowed().find_map(|allowed| inside(allowed, &path)) {
                Some(path) => found.push(path),
                None if self.anywhere => found.push(path),
                None => refused = true,
            }
        }
        found.dedup();
        (found, refused)
    }

    /// The paths that `NAME/…` of a package or model may mean.
    fn in_packages(&self, own: &Path, rest: &str) -> Vec<PathBuf> {
        let (name, rest) = rest.split_once('/').unwrap_or((rest, ""));
        if name.is_empty() || name == ".." || name == "." {
            return Vec::new();
        }
        let is_called_so = |folder: &&Path| folder.file_name().is_some_and(|own| own == name);
        let in_given = self.given.iter().map(|folder| folder.join(name));
        let given = self.given.iter().map(PathBuf::as_path).filter(is_called_so).map(Path::to_owned);
        // Without a manifest it could be any folder of the user's that happens to be above.
        let whole = std::path::absolute(own).unwrap_or_else(|_| own.to_owned());
        let above = whole.ancestors().filter(is_called_so).filter(|folder| is_package(folder)).map(Path::to_owned);
        let beside = [own.join(name)];
        let packages: Vec<PathBuf> = in_given.chain(given).chain(above).chain(beside).collect();
        packages.iter().filter_map(|package| inside(package, &package.join(rest))).collect()
    }
}

/// Whether a folder has the manifest of a package or a model.
fn is_package(folder: &Path) -> bool {
    MANIFESTS.iter().any(|file| folder.join(file).is_file())
}

/// The file of a model in `folder`: that which its `model.config` names last, the newest version of SDF, or else
/// `model.sdf`.
pub(crate) fn model_file(folder: &Path) -> PathBuf {
    let named = || {
        let text = XmlText::load(&folder.join("model.config"), Limit::YAML).ok()?;
        let document = text.parse().ok()?;
        let name = Xml::root(&document, &text).children("sdf").last()?.content();
        inside(folder, &folder.join(name)).filter(|path| path.is_file())
    };
    named().unwrap_or_else(|| folder.join("model.sdf"))
}
