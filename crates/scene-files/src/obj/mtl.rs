//! MTL files: the materials of OBJ files.

use super::files::Files;
use super::text::Text;
use ground::error::{Error, Result};
use ground::read::{self, Limit};
use ground::shown;
use model::material::{Channel, Material, Reflectance};
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// A material of an MTL file.
#[derive(Debug, Default)]
pub(super) struct MtlMaterial {
    /// Everything but the textures.
    pub material: Material,
    /// `map_Kd`.
    pub map: Option<TextureMap>,
    /// `map_d`, or `map_Tr`.
    pub mask: Option<Mask>,
    /// The first error in it; irrelevant if the material is not used.
    pub fault: Option<Error>,
    /// Whether `d` is given, which takes precedence over `Tr`: exporters do not agree on what `Tr` means.
    dissolve_given: bool,
}

/// An image of the opacity of a surface.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Mask {
    pub map: TextureMap,
    /// `-imfchan`; without it, alpha if the image has any, else its brightness.
    pub channel: Option<Channel>,
}

/// An image that colours a surface.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct TextureMap {
    /// File name as written in the MTL.
    pub file: String,
    /// The MTL, and the line in it.
    library: PathBuf,
    line: usize,
    /// `-s`, then `-o`: the image is sampled at `u * scale + offset`.
    pub scale: [f32; 2],
    pub offset: [f32; 2],
    /// `-clamp on`.
    pub clamp: bool,
}

impl TextureMap {
    /// The image file.
    ///
    /// # Errors
    /// It does not exist, or is where `files` does not allow it.
    pub fn path(&self, files: Files<'_>) -> Result<PathBuf> {
        let missing = || format!("there is no image {:?}", shown::name(&self.file));
        files
            .find(&self.library, &self.file)
            .and_then(|path| path.ok_or_else(missing))
            .map_err(|message| Error::parse(&self.library, format!("line {}", self.line), message))
    }
}

/// Adds the materials of the MTL file at `path` to `entries`; a repeated name replaces the earlier one.
///
/// Reads `Kd` (taken as linear, 0..1), `d` and `Tr`, `Ni`, `map_Kd`, `map_d` and `map_Tr`, the extension `Pm` and `Pr`,
/// and our own `reflectance`. Keys for highlights and reflections say nothing about a scanner's wavelength.
///
/// Numbers are clamped to their range, as many exporters ignore it. An invalid number, or a reflectance outside 0..1,
/// becomes the fault of its material.
///
/// # Errors
/// A file that cannot be read.
pub(super) fn read(path: &Path, entries: &mut HashMap<String, MtlMaterial>) -> Result<()> {
    let bytes = read::bytes(path, Limit::MATERIALS)?;
    // Another file names it, and it may be any file of the user's: errors quote none of its words.
    let mut text = Text::new(path, &bytes)?.without_quotes();
    let mut entry = MtlMaterial::default();
    while text.next_statement() {
        match text.word() {
            b"newmtl" => {
                let material = Material::default().name(text.rest());
                let done = std::mem::replace(&mut entry, MtlMaterial { material, ..MtlMaterial::default() });
                entries.insert(done.material.name.clone(), done);
            }
            b"map_Kd" => entry.map = map(&mut text, path).map(|(map, _)| map),
            // Where both are given, `map_d` takes precedence, as `d` does.
            b"map_d" => entry.mask = mask(&mut text, path).or(entry.mask.take()),
            b"map_Tr" => entry.mask = entry.mask.take().or_else(|| mask(&mut text, path)),
            word => {
                if let Err(error) = entry.number(word, &mut text) {
                    entry.fault.get_or_insert(error);
                }
            }
        }
        text.skip_statement();
    }
    entries.insert(entry.material.name.clone(), entry);
    // Statements before the first `newmtl` belong to no material.
    entries.remove("");
    Ok(())
}

impl MtlMaterial {
    /// Reads the numbers of a statement that starts with `word`.
    fn number(&mut self, word: &[u8], text: &mut Text) -> Result<()> {
        let material = &mut self.material;
        match word {
            b"Kd" => match text.peek_word() {
                // Spectral files and CIE XYZ: rare, and no base colour.
                b"spectral" | b"xyz" => {}
                _ => {
                    let red = text.number()?;
                    let grey = text.statement_is_over();
                    let color = if grey { [red; 3] } else { [red, text.number()?, text.number()?] };
                    let [r, g, b] = color.map(fraction);
                    material.base_color = [r, g, b, material.base_color[3]];
                }
            },
            b"d" => {
                if text.peek_word() == b"-halo" {
                    text.word();
                }
                material.base_color[3] = fraction(text.number()?);
                self.dissolve_given = true;
            }
            b"Tr" => {
                let opacity = fraction(1.0 - text.number()?);
                if !self.dissolve_given {
                    material.base_color[3] = opacity;
                }
            }
            b"Ni" => material.ior = text.number()?.max(1.0) as f32,
            b"Pm" => material.metallic = fraction(text.number()?),
            b"Pr" => material.roughness = fraction(text.number()?),
            b"reflectance" => {
                let value = text.number()?;
                if !(0.0..=1.0).contains(&value) {
                    return Err(text.error(format!("reflectance is {value}; allowed: 0 to 1")));
                }
                material.reflectance = Some(Reflectance::Constant(value as f32));
            }
            _ => {}
        }
        Ok(())
    }
}

fn fraction(value: f64) -> f32 {
    value.clamp(0.0, 1.0) as f32
}

/// Options and file name of a `map_d`; `None` without a file name.
fn mask(text: &mut Text, library: &Path) -> Option<Mask> {
    map(text, library).map(|(map, channel)| Mask { map, channel })
}

/// Options and file name of a map, and which of its channels is used; `None` without a file name.
fn map(text: &mut Text, library: &Path) -> Option<(TextureMap, Option<Channel>)> {
    let mut channel = None;
    let mut map = TextureMap {
        file: String::new(),
        library: library.to_owned(),
        line: text.line(),
        scale: [1.0; 2],
        offset: [0.0; 2],
        clamp: false,
    };
    loop {
        let option = text.peek_word();
        let arguments = match option {
            b"-s" | b"-o" | b"-t" => 0,
            b"-mm" => 2,
            b"-blendu" | b"-blendv" | b"-boost" | b"-bm" | b"-cc" | b"-clamp" | b"-colorspace" | b"-imfchan"
            | b"-texres" | b"-type" => 1,
            _ => break,
        };
        text.word();
        if arguments == 0 {
            let target = match option {
                b"-s" => &mut map.scale,
                b"-o" => &mut map.offset,
                _ => &mut [0.0; 2],
            };
            // One to three numbers: u, v and w, which images do not have.
            for axis in 0..3 {
                let Some(value) = text.optional_number() else { break };
                if let Some(slot) = target.get_mut(axis) {
                    *slot = value as f32;
                }
            }
        }
        for _ in 0..arguments {
            let argument = text.word();
            match (option, argument) {
                (b"-clamp", _) => map.clamp = argument == b"on",
                (b"-imfchan", b"r") => channel = Some(Channel::Red),
                (b"-imfchan", b"g") => channel = Some(Channel::Green),
                (b"-imfchan", b"b") => channel = Some(Channel::Blue),
                (b"-imfchan", b"m") => channel = Some(Channel::Alpha),
                (b"-imfchan", b"l") => channel = Some(Channel::Luminance),
                _ => {}
            }
        }
    }
    map.file = text.rest();
    (!map.file.is_empty()).then_some((map, channel))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entries(text: &str) -> Result<HashMap<String, MtlMaterial>> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.mtl");
        std::fs::write(&path, text).unwrap();
        let mut entries = HashMap::new();
        read(&path, &mut entries).map(|()| entries)
    }

    #[test]
    fn materials_are_read() {
        let text = "# made by hand\nKd 1 0 0\nnewmtl steel plate\nKd 0.25 .5 2\nTr 0.9\nd 0.75\nTr 0.9\nNi 0\nPm 0.5\nPr 1e-1\n\
                    Ks nan\nreflectance 0.3\n\nnewmtl grey\r\n\tKd 0.5\r\nTr 0.25\nNi 1.33\nnewmtl xyz\nKd xyz 1 1 1\nd -halo 0.5";
        let entries = entries(text).unwrap();
        assert_eq!(entries.len(), 3);
        let steel = &entries["steel plate"].material;
        assert_eq!((steel.base_color, steel.ior), ([0.25, 0.5, 1.0, 0.75], 1.0));
        assert_eq!((steel.metallic, steel.roughness), (0.5, 0.1));
        assert_eq!(steel.reflectance, Some(Reflectance::Constant(0.3)));
        let grey = &entries["grey"].material;
        assert_eq!((grey.base_color, grey.ior, &grey.reflectance), ([0.5, 0.5, 0.5, 0.75], 1.33, &None));
        assert_eq!(entries["xyz"].material.base_color, [1.0, 1.0, 1.0, 0.5]);
    }

    #[test]
    fn texture_options_are_read() {
        let text = "newmtl a\nmap_Kd -blendu on -mm 0 1 -s 2 -o .5 .25 0 -clamp on my wood #1.png\nnewmtl b\nmap_Kd\n\
                    newmtl c\nmap_Kd -t 1 1 1 -bm 0.3 C:\\tex\\a.png";
        let entries = entries(text).unwrap();
        let map = entries["a"].map.as_ref().unwrap();
        assert_eq!((map.file.as_str(), map.clamp), ("my wood #1.png", true));
        assert_eq!((map.scale, map.offset), ([2.0, 1.0], [0.5, 0.25]));
        assert_eq!(entries["b"].map, None);
        let map = entries["c"].map.as_ref().unwrap();
        assert_eq!(
            (map.file.as_str(), map.clamp, map.scale, map.offset),
            ("C:\\tex\\a.png", false, [1.0; 2], [0.0; 2])
        );
    }

    #[test]
    fn errors_name_file_and_line() {
        for (text, message) in [
            ("newmtl a\nKd 1 nan 0", "line 2: not a number from -1e18 to 1e18"),
            ("newmtl a\nKd 1 1\nNi x", "line 2: a number is missing"),
            ("newmtl a\n\nreflectance 1.5", "line 3: reflectance is 1.5; allowed: 0 to 1"),
        ] {
            let error = entries(text).unwrap().remove("a").unwrap().fault.unwrap().to_string();
            assert!(error.ends_with(&format!("a.mtl: {message}")), "{error}");
        }
    }
}
