//! The material library: reflectance by material name and wavelength, and how surfaces scatter sound and radar waves, one
//! YAML file per material in `presets/material`.

use super::words::words;
use super::{Alpha, Material, Radio, RadioSource, Reflectance, Sound};
use ground::error::{Error, Result};
use ground::read::presets;
use ground::read::yaml::Document;
use serde::Deserialize;
use std::collections::HashMap;
use std::sync::OnceLock;

/// A material of the library, and the names that scenes give it.
#[derive(Debug)]
pub(super) struct LibraryMaterial {
    pub material: Material,
    pub names: MaterialNames,
}

/// What an entry's material is called.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct MaterialNames {
    /// Words and phrases for the material itself.
    words: Vec<String>,
    /// For things that are mostly made of it; they count where no word matches.
    things: Vec<String>,
    /// Standard deviation of the reflectance near 905 nm between samples and kinds of it.
    pub spread: Option<f32>,
}

/// Why a name matches a material.
#[derive(Clone, Copy, Debug)]
pub(super) struct Match {
    pub entry: &'static LibraryMaterial,
    /// The words of the name that match.
    pub phrase: &'static str,
}

impl Material {
    /// The library material called `name`; case and the suffix of a copy (`concrete.001`) are ignored.
    ///
    /// # Errors
    /// [`Error::Missing`] with similar names.
    pub fn library(name: &str) -> Result<Material> {
        let known = || library().entries.iter().map(|entry| &entry.material.name);
        let found = called(name).map(|entry| entry.material.clone());
        found.ok_or_else(|| Error::missing("library material", name, known()))
    }

    /// All library materials, by name.
    pub fn all_in_library() -> impl Iterator<Item = &'static Material> {
        library().entries.iter().map(|entry| &entry.material)
    }
}

/// The library's reflectance for the name of `material`, and the match, with the standard deviation between kinds of
/// the material; `None` where its alpha gives it.
pub(super) fn reflectance(material: &Material) -> Option<(&'static Reflectance, Match)> {
    let found = find(&material.name).filter(|_| material.alpha != Alpha::Reflectance)?;
    Some((found.entry.material.reflectance.as_ref()?, found))
}

/// How a material scatters and reflects sound, by itself or by the library.
pub(super) fn sound(material: &Material) -> Option<&Sound> {
    material.sound.as_ref().or_else(|| find(&material.name)?.entry.material.sound.as_ref())
}

/// How a material reflects the waves of radars, by itself, by the library or by its other properties.
pub(super) fn radar(material: &Material) -> (Radio, RadioSource) {
    if let Some(own) = &material.radar {
        return (own.clone(), RadioSource::Given);
    }
    let found = find(&material.name).and_then(|found| Some((found.entry, found.entry.material.radar.clone()?)));
    let (mut law, source) = match found {
        Some((entry, law)) => (law, RadioSource::Library(&entry.material.name)),
        None if material.metallic > 0.5 => (Radio::metal(), RadioSource::Properties),
        None if material.is_glass() => (Radio::pane(), RadioSource::Properties),
        None => (Radio::unknown(), RadioSource::Assumed),
    };
    if let Some(pane_m) = material.pane_m {
        law.make_pane(pane_m);
    }
    (law, source)
}

/// Whether `name` indicates glass.
pub(super) fn is_glass(name: &str) -> bool {
    find(name).is_some_and(|found| ["glass", "glass_frosted"].contains(&found.entry.material.name.as_str()))
}

/// The entry called `name`, ignoring case and the suffix of a copy.
fn called(name: &str) -> Option<&'static LibraryMaterial> {
    let stem = match name.rsplit_once('.') {
        Some((stem, digits)) if digits.len() == 3 && digits.bytes().all(|b| b.is_ascii_digit()) => stem,
        _ => name,
    };
    library().entries.iter().find(|entry| entry.material.name.eq_ignore_ascii_case(stem))
}

/// The library's match for a scene material called `name`: the material of that name; else the one whose phrase with
/// the most words is in the name, the last one where several have as many; else the same with things.
fn find(name: &str) -> Option<Match> {
    if let Some(entry) = called(name) {
        return Some(Match { entry, phrase: &entry.material.name });
    }
    let library = library();
    let words = words(name);
    let mut best: Option<([usize; 4], Match)> = None;
    for word in &words {
        for phrase in library.by_word.get(word.as_str()).into_iter().flatten() {
            let last = phrase.words.iter().map(|word| words.iter().rposition(|it| it == word)).max().flatten();
            let all = phrase.words.iter().all(|word| words.contains(word));
            let letters = phrase.words.iter().map(String::len).sum();
            let rank = [usize::from(phrase.names_material), phrase.words.len(), last.unwrap_or(0), letters];
            if all && best.as_ref().is_none_or(|(known, _)| rank > *known) {
                best = Some((rank, Match { entry: &library.entries[phrase.entry], phrase: &phrase.text }));
            }
        }
    }
    best.map(|(_, found)| found)
}

struct Library {
    entries: Vec<LibraryMaterial>,
    /// Phrases by their first word.
    by_word: HashMap<String, Vec<Phrase>>,
}

struct Phrase {
    text: String,
    words: Vec<String>,
    /// Whether it is a word for the material, not for a thing.
    names_material: bool,
    /// Index into the entries.
    entry: usize,
}

/// The files are embedded in this crate and a test reads every one.
fn library() -> &'static Library {
    static LIBRARY: OnceLock<Library> = OnceLock::new();
    LIBRARY.get_or_init(|| {
        let entries: Vec<LibraryMaterial> = presets::embedded("material/")
            .map(|(path, text)| read(path, text).expect("presets that are compiled in can be read"))
            .collect();
        let mut by_word: HashMap<String, Vec<Phrase>> = HashMap::new();
        for (number, LibraryMaterial { names, .. }) in entries.iter().enumerate() {
            let phrases = names.words.iter().map(|text| (text, true));
            for (text, names_material) in phrases.chain(names.things.iter().map(|text| (text, false))) {
                let words = words(text);
                let phrase = Phrase { text: text.clone(), words: words.clone(), names_material, entry: number };
                let Some(first) = words.into_iter().next() else { continue };
                by_word.entry(first).or_default().push(phrase);
            }
        }
        Library { entries, by_word }
    })
}

/// An entry from the `text` of its file: the keys of a material, and those of [`MaterialNames`].
fn read(path: &str, text: &str) -> Result<LibraryMaterial> {
    let document = Document::parse(path, text)?;
    let mut keys = document.value().clone();
    let mut names = serde_json::Map::new();
    if let Some(keys) = keys.as_object_mut() {
        for key in ["words", "things", "spread"] {
            names.extend(keys.shift_remove_entry(key));
        }
    }
    let names = Document::from_value(path, names.into()).read()?;
    Ok(LibraryMaterial { material: Material::read(&Document::from_value(path, keys))?, names })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    /// The wavelengths of common LiDARs, nm.
    const WAVELENGTHS: [f64; 5] = [532.0, 905.0, 940.0, 1064.0, 1550.0];

    #[test]
    fn every_file_of_the_library_is_sound() {
        let mut phrases = HashSet::new();
        let mut count = 0;
        for (path, text) in presets::embedded("material/") {
            let LibraryMaterial { material, names } = read(path, text).unwrap();
            assert_eq!(path, format!("material/{}.yaml", material.name));
            assert!(!material.source.is_empty(), "{path}");
            let Some(Reflectance::Samples(samples)) = &material.reflectance else { panic!("{path}") };
            let wavelengths: Vec<f64> = samples.iter().map(|sample| sample.wavelength_nm).collect();
            assert_eq!(wavelengths, WAVELENGTHS, "{path}");
            assert!(names.spread.is_some_and(|spread| spread > 0.0 && spread < 0.5), "{path}");
            for phrase in names.words.iter().chain(&names.things) {
                let mut words = words(phrase);
                words.sort();
                assert!(!words.is_empty() && phrases.insert(words), "{path}: {phrase:?} is there twice");
            }
            count += 1;
        }
        assert_eq!(count, library().entries.len());
        assert!(count >= 80, "{count}");
    }

    /// Typical reflectances at 905 nm, and of snow at 1550 nm.
    #[test]
    fn reflectances_are_typical() {
        for (name, wavelength_nm, least, most) in [
            ("asphalt_dry", 905.0, 0.15, 0.2),
            ("asphalt_wet", 905.0, 0.05, 0.1),
            ("concrete", 905.0, 0.35, 0.5),
            ("vegetation", 905.0, 0.4, 0.6),
            ("black_car_paint", 905.0, 0.05, 0.1),
            ("white_paint", 905.0, 0.8, 0.8),
            ("snow", 905.0, 0.8, 0.9),
            ("snow", 1550.0, 0.0, 0.1),
        ] {
            let found = Material::library(name).unwrap().reflectance.unwrap().at(wavelength_nm);
            assert!((least..=most).contains(&found), "{name} at {wavelength_nm} nm: {found}");
        }
    }

    /// Names of materials in scenes that people made, and in the generated ones.
    #[test]
    fn names_indicate_materials() {
        for (name, expected) in [
            ("DarkRedFabric", "fabric"),
            ("Asphalt.001", "asphalt_dry"),
            ("asphalt_wet", "asphalt_wet"),
            ("WetAsphalt", "asphalt_wet"),
            ("DarkWoodMat", "wood_dark"),
            ("light_wood", "wood_light"),
            ("white_wall", "painted_plaster"),
            ("Walls", "painted_plaster"),
            ("Sofa", "fabric"),
            ("Black_Plastic_Dull", "plastic_black"),
            ("LigthGreenLeaves", "leaf"),
            ("Door_Frame_Glass", "glass"),
            ("Radiator", "painted_metal"),
            ("Monitor_Screen", "screen"),
            ("roof_tile", "roof_tile"),
            ("TreeBark_02", "bark"),
            ("RoadMarkingYellow", "road_marking_yellow"),
        ] {
            let found = find(name).map(|found| found.entry.material.name.as_str());
            assert_eq!(found, Some(expected), "{name}");
        }
        // Words within words do not count.
        for name in ["", "Material.001", "PC", "Goldfish", "Woodrow", "brickly", "default", "Board"] {
            assert!(find(name).is_none(), "{name}: {:?}", find(name));
        }
        let material = Material { name: "DarkRedFabric".into(), alpha: Alpha::Reflectance, ..Material::default() };
        assert!(reflectance(&material).is_none(), "its alpha gives it");
    }

    #[test]
    fn seabeds_have_sound() {
        use super::super::Sediment;
        for (name, sediment) in [
            ("rock", Sediment::Rock),
            ("gravel", Sediment::SandyGravel),
            ("sand", Sediment::MediumSand),
            ("mud", Sediment::Silt),
        ] {
            let scene = Material { name: format!("{name}.001"), ..Material::default() };
            assert_eq!(scene.sound_law(), Some(&Sound::Sediment { name: sediment }));
            let own = Material { sound: Some(Sound::Lambert { mu_db: -20.0 }), ..scene };
            assert_eq!(own.sound_law(), own.sound.as_ref());
        }
        assert_eq!(Material::default().sound_law(), None);
    }

    /// What radars see of every material, in the bands in which they work.
    #[test]
    fn all_have_a_law_for_radars() {
        for material in Material::all_in_library() {
            let law = material.radar.as_ref().unwrap_or_else(|| panic!("{} has no section radar", material.name));
            for frequency in [9.41e9, 24.125e9, 60.25e9, 77e9, 79e9] {
                let surface = law.at(frequency).unwrap();
                for cos in [1.0, 0.7, 0.3, 0.05] {
                    let [back, through] = [surface.reflect(cos).power(), surface.transmit(cos).power()];
                    assert!(back + through <= 1.001, "{} {frequency} {cos}: {back} {through}", material.name);
                }
                let [road, wall] = [0.1, 1.0].map(|cos| surface.clutter(cos));
                assert!(
                    (0.0..10.0).contains(&road) && (0.0..3000.0).contains(&wall),
                    "{} {road} {wall}",
                    material.name
                );
            }
            // Clutter is what the file says, where nothing limits it: at 30 degrees from grazing.
            if let Some(clutter) = law.clutter {
                let said = clutter.gamma_db + 10.0 * 0.5f64.log10() * clutter.exponent;
                let found = 10.0 * f64::from(law.at(77e9).unwrap().clutter(0.5)).log10();
                assert!(found > said - 0.1 && found < said + 3.0, "{}: {found}, said {said}", material.name);
            }
        }
    }

    /// Power reflected by and through a surface at normal incidence at 77 GHz, dB: of car bodies and metal all; of asphalt
    /// by its permittivity of 3 to 5.5, of skin and water by their measurements, through glass by ITU-R P.2040-3.
    #[test]
    fn radar_sees_materials_as_measured() {
        let at = |name: &str| Material::library(name).unwrap().radar_law().at(77e9).unwrap();
        for (name, least, most) in [
            ("car_paint", -0.3, 0.0),
            ("aluminium", -0.1, 0.0),
            ("traffic_sign", -0.5, 0.0),
            ("asphalt_dry", -11.0, -7.9),
            ("asphalt_wet", -4.5, -2.5),
            ("concrete", -8.13, -8.11),
            ("skin", -4.69, -4.67),
            ("water", -3.51, -3.50),
            ("clothing", -9.0, -3.0),
            ("snow_fresh", -30.0, -20.0),
        ] {
            let found = 10.0 * at(name).reflect(1.0).power().log10();
            assert!((least..=most).contains(&found), "{name}: {found} dB");
        }
        for (name, least, most) in [
            ("glass", -4.58, -4.57),
            ("plasterboard", -6.87, -6.85),
            ("vegetation", -0.41, -0.39),
            ("leaf", -6.0, -0.5),
            ("curtain", -1.0, 0.0),
            ("plastic", -2.0, 0.0),
        ] {
            let found = 10.0 * at(name).transmit(1.0).power().log10();
            assert!((least..=most).contains(&found), "{name}: {found} dB");
        }
        assert_eq!(at("concrete").transmit(1.0).power(), 0.0);
    }

    #[test]
    fn names_have_laws_for_radars() {
        let named = |name: &str| Material { name: name.into(), ..Material::default() }.radar_source();
        let (law, source) = named("RedCarPaint.001");
        assert_eq!(source, RadioSource::Library("red_car_paint"));
        assert_eq!(Some(law), Material::library("red_car_paint").unwrap().radar);
        let pane = Material { name: "Window".into(), pane_m: Some(0.01), ..Material::default() };
        assert_eq!(pane.radar_law().to_string(), "10 mm of glass of ITU-R P.2040");
        // What a name says counts more than glTF's factors, which exporters often leave at their default.
        let road = Material { name: "road".into(), metallic: 1.0, ..Material::default() };
        assert_eq!(road.radar_source().1, RadioSource::Library("asphalt_dry"));
    }

    #[test]
    fn library_names_match_without_case_and_copy_suffix() {
        assert_eq!(called("Concrete.012").unwrap().material.name, "concrete");
        assert!(called("concrete.wall").is_none());
        assert_eq!(Material::library("Concrete").unwrap(), called("concrete").unwrap().material);
        let error = Material::library("concret").unwrap_err().to_string();
        assert!(error.starts_with("there is no library material named \"concret\"; near: concrete"), "{error}");
    }
}
