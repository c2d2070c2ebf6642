//! Materials of Wavefront files with the keys of HELIOS++.

use ground::error::Result;
use ground::read::{self, Limit};
use std::collections::{BTreeMap, BTreeSet};
use std::io::{BufRead as _, BufReader};
use std::path::Path;

/// What HELIOS++ adds to a material.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct MtlSurface {
    /// `helios_reflectance`, from 0 to 1.
    pub reflectance: Option<f64>,
    /// `helios_spectra`: a name in its spectral library.
    pub spectrum: Option<String>,
    /// `helios_classification`: an ASPRS class.
    pub class: Option<u8>,
    /// `helios_isGround`.
    pub ground: bool,
}

/// Materials of a mesh, by name: those that it uses.
pub(crate) type MtlSurfaces = BTreeMap<String, MtlSurface>;

/// The materials that the OBJ file at `path` uses, as the MTL files beside it have them. One that is missing is reported
/// when the scene is read.
pub(crate) fn of_mesh(path: &Path) -> Result<MtlSurfaces> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let (mut libraries, mut used) = (Vec::new(), BTreeSet::new());
    lines(path, Limit::SCENE, |line| {
        if let Some(name) = after(line, "mtllib") {
            libraries.push(name.to_owned());
        } else if let Some(name) = after(line, "usemtl") {
            used.insert(name.to_owned());
        }
    })?;
    let mut all = MtlSurfaces::new();
    for library in &libraries {
        let Some(library) = scene_files::inside(folder, &folder.join(library)).filter(|path| path.is_file()) else {
            continue;
        };
        read_library(&library, &mut all)?;
    }
    all.retain(|name, _| used.contains(name));
    Ok(all)
}

/// Adds the materials of the MTL file at `path`.
fn read_library(path: &Path, all: &mut MtlSurfaces) -> Result<()> {
    let mut current = None;
    lines(path, Limit::MATERIALS, |line| {
        if let Some(name) = after(line, "newmtl") {
            all.entry(name.to_owned()).or_default();
            current = Some(name.to_owned());
        }
        let Some(surface) = current.as_ref().and_then(|name| all.get_mut(name)) else { return };
        if let Some(value) = after(line, "helios_reflectance") {
            surface.reflectance = value.parse().ok().filter(|value: &f64| (0.0..=1.0).contains(value));
        } else if let Some(value) = after(line, "helios_spectra") {
            surface.spectrum = Some(value.to_owned());
        } else if let Some(value) = after(line, "helios_classification") {
            surface.class = value.parse().ok();
        } else if let Some(value) = after(line, "helios_isGround") {
            surface.ground = value.eq_ignore_ascii_case("true") || value == "1";
        }
    })
}

/// The text after the word `key` at the beginning of a line.
fn after<'l>(line: &'l str, key: &str) -> Option<&'l str> {
    line.trim().strip_prefix(key)?.strip_prefix(char::is_whitespace).map(str::trim)
}

/// Gives every line of a file to `each`; bytes that are no text are replaced.
fn lines(path: &Path, limit: Limit, mut each: impl FnMut(&str)) -> Result<()> {
    let mut reader = BufReader::new(read::open(path, limit)?);
    let mut line = Vec::new();
    loop {
        line.clear();
        let count = reader.read_until(b'\n', &mut line).map_err(|source| ground::error::Error::io(path, source))?;
        if count == 0 {
            return Ok(());
        }
        each(&String::from_utf8_lossy(&line));
    }
}
