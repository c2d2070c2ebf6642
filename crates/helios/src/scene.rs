//! Scenes as HELIOS++ describes them.

use crate::assets::AssetFolders;
use crate::notes::XmlPlace;
use crate::turning::rotation;
use crate::xml::XmlElement;
use glam::{DQuat, DVec3};
use ground::error::Result;
use std::f64::consts::FRAC_PI_2;
use std::path::PathBuf;

/// What is measured.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct HeliosScene {
    /// Its parts that are meshes.
    pub parts: Vec<HeliosPart>,
    /// Kinds of loaders of the parts that are not.
    pub others: Vec<String>,
    pub(crate) place: XmlPlace,
}

/// A part of a scene: meshes at a place. A point of a file is turned, then scaled, then moved.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct HeliosPart {
    /// Its name.
    pub name: String,
    /// Files of its meshes.
    pub files: Vec<PathBuf>,
    /// Rotation, that from y up to z up included.
    pub rotation: DQuat,
    /// Scale.
    pub scale: f64,
    /// Translation, m.
    pub offset: DVec3,
    pub(crate) place: XmlPlace,
}

impl HeliosScene {
    /// Reads the element `scene`.
    pub(crate) fn read(element: XmlElement, assets: &AssetFolders) -> Result<HeliosScene> {
        element.text("name");
        note_steps(element);
        let (mut parts, mut others) = (Vec::new(), Vec::new());
        for (index, part) in element.children("part").enumerate() {
            match read_part(part, index, assets)? {
                Ok(part) => parts.push(part),
                Err(kind) => others.push(kind),
            }
        }
        Ok(HeliosScene { parts, others, place: element.place() })
    }
}

/// Notes when things move: nothing does.
fn note_steps(element: XmlElement) {
    for key in ["dynStep", "kdtDynStep", "dynTimeStep", "kdtDynTimeStep"] {
        if element.text(key).is_some() {
            element.notes().not_understood(element.place(), key, STANDS);
        }
    }
}

const STANDS: &str = "motions of parts are not read: the part stands where it begins";

/// A part, or the kind of its loader if that loads something else than meshes.
fn read_part(part: XmlElement, index: usize, assets: &AssetFolders) -> Result<Result<HeliosPart, String>> {
    let notes = part.notes();
    note_steps(part);
    let id = part.text("id").map_or_else(|| index.to_string(), str::to_owned);
    part.children("dmotion").for_each(|motion| motion.not_understood(STANDS));
    let exchanged = "parts are not exchanged while a survey is made: the first one stays";
    part.children("swap").for_each(|swap| swap.not_understood(exchanged));
    let (mut turn, mut scale, mut offset) = (DQuat::IDENTITY, 1.0, DVec3::ZERO);
    let mut files = Vec::new();
    let mut upright = DQuat::IDENTITY;
    for filter in part.children("filter") {
        let kind = filter.required("type")?.to_ascii_lowercase();
        let (of_filter, value) = (Params(filter), |key| Params(filter).value(key));
        match kind.as_str() {
            "objloader" => {
                files = of_filter.files(assets)?;
                upright = match value("up").map(|(up, _)| up) {
                    // (x, y, z) becomes (x, -z, y): a quarter turn about x.
                    Some("y") => DQuat::from_rotation_x(FRAC_PI_2),
                    _ => DQuat::IDENTITY,
                };
            }
            "rotate" => {
                let turned = of_filter.find("rotation").map(rotation).transpose()?;
                turn = turned.unwrap_or(DQuat::IDENTITY) * turn;
            }
            // The last ones count: ScaleFilter.cpp and TranslateFilter.cpp (3dgeo-heidelberg/helios fd94d1f).
            "scale" => scale = of_filter.number("scale")?.filter(|scale| *scale != 0.0).unwrap_or(scale),
            "translate" => {
                offset = of_filter.vector("offset")?.unwrap_or(offset);
                if let Some((_, param)) = value("onGround") {
                    let how = "the part is where it is moved to, not lowered onto the ground";
                    notes.approximated(param.place(), "value", how);
                }
            }
            "geotiffloader" | "xyzloader" | "detailedvoxels" => {
                let needs = match kind.as_str() {
                    "geotiffloader" => "needs terrain from GeoTIFF",
                    "xyzloader" => "needs clouds as scenes",
                    _ => "needs voxels as scenes",
                };
                part.not_understood(&format!("{needs}, which is not read yet: the part is left out"));
                return Ok(Err(kind));
            }
            _ => {
                let allowed = "objloader, geotiffloader, xyzloader, detailedvoxels, translate, rotate or scale";
                return Err(filter.wrong("type", allowed));
            }
        }
        of_filter.note_meaning(&kind);
    }
    if files.is_empty() {
        return Err(part.error("has no filter that loads something; allowed: one of type objloader first"));
    }
    let known = scale.is_finite() && scale > 0.0;
    if !known {
        return Err(part.error(format_args!("is scaled by {scale}; allowed: factors above 0")));
    }
    let rotation = (turn * upright).normalize();
    Ok(Ok(HeliosPart { name: id, files, rotation, scale, offset, place: part.place() }))
}

/// The elements `param` of a filter.
#[derive(Clone, Copy)]
struct Params<'d>(XmlElement<'d>);

impl<'d> Params<'d> {
    /// The one for `key`.
    fn find(self, key: &str) -> Option<XmlElement<'d>> {
        let found = self.0.children("param").find(|param| param.text("key") == Some(key))?;
        found.text("type");
        Some(found)
    }

    /// The value for `key`, and its element.
    fn value(self, key: &str) -> Option<(&'d str, XmlElement<'d>)> {
        let param = self.find(key)?;
        Some((param.text("value").unwrap_or_default(), param))
    }

    /// The number for `key`.
    fn number(self, key: &str) -> Result<Option<f64>> {
        self.find(key).map_or(Ok(None), |param| param.number_within("value", -1e9, 1e9))
    }

    /// The three numbers for `key`, with semicolons between them.
    fn vector(self, key: &str) -> Result<Option<DVec3>> {
        let Some((text, param)) = self.value(key) else { return Ok(None) };
        let numbers: Option<Vec<f64>> = text.split(';').map(|number| number.trim().parse().ok()).collect();
        match numbers.as_deref() {
            Some(&[x, y, z]) if [x, y, z].iter().all(|number| number.abs() <= 1e9) => Ok(Some(DVec3::new(x, y, z))),
            _ => Err(param.wrong("value", "three numbers with semicolons between them")),
        }
    }

    /// The files that a filter loads.
    fn files(self, assets: &AssetFolders) -> Result<Vec<PathBuf>> {
        let (several, one) = (self.value("efilepath"), self.value("filepath"));
        let (files, param) = match (several, one) {
            (Some((name, param)), _) => (assets.matching(name), param),
            (None, Some((name, param))) => (assets.find(name).map(|file| vec![file]), param),
            (None, None) => return Err(self.0.error("has no param with the key filepath or efilepath")),
        };
        files.map_err(|why| param.error(why))
    }

    /// Notes which of the params have a meaning for the filter `kind`.
    fn note_meaning(self, kind: &str) {
        let meant: &[&str] = match kind {
            "objloader" => &["filepath", "efilepath", "up"],
            "rotate" => &["rotation"],
            "scale" => &["scale"],
            "translate" => &["offset", "onGround"],
            _ => &[],
        };
        for param in self.0.children("param") {
            let key = param.text("key").unwrap_or_default();
            if !meant.contains(&key) {
                param.not_understood(&format!("{key} has no meaning for a filter of type {kind}"));
            }
        }
    }
}
