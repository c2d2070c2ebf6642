//! A survey of HELIOS++ with all that it refers to.

use crate::assets::AssetFolders;
use crate::notes::{NoteBook, XmlPlace};
use crate::platform::{HeliosMovement, HeliosPlatform, note_noise};
use crate::scanner::HeliosScanner;
use crate::scene::HeliosScene;
use crate::settings::{HeliosSettings, OF_PLATFORMS, OF_SCANNERS};
use crate::track::HeliosTrack;
use crate::turning::fitting;
use crate::xml::XmlElement;
use ground::error::{Error, Result};
use ground::read::Limit;
use ground::read::xml::XmlText;
use std::path::Path;

/// A survey.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct HeliosSurvey {
    /// Its name.
    pub name: String,
    /// Seed of random numbers.
    pub seed: Option<u64>,
    /// How many times it is made.
    pub runs: u32,
    /// What measures.
    pub scanner: HeliosScanner,
    /// What carries that.
    pub platform: HeliosPlatform,
    /// What is measured.
    pub scene: HeliosScene,
    /// Its legs, at least one.
    pub legs: Vec<HeliosLeg>,
}

/// A leg: the way from its point to that of the next, or a station.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct HeliosLeg {
    /// Settings of the platform.
    pub platform: HeliosSettings,
    /// Settings of the scanner.
    pub scanner: HeliosSettings,
    /// The rows of a trajectory file along which an interpolated platform moves.
    pub track: Option<HeliosTrack>,
    /// Name of the strip that it belongs to.
    pub strip: Option<String>,
    /// Longest time that it may take, s.
    pub longest_s: Option<f64>,
    pub(crate) place: XmlPlace,
}

/// Reads one thing that an attribute refers to, of the element `kind`.
fn asset<T>(
    element: XmlElement,
    attribute: &str,
    kind: &'static str,
    (here, assets): (&Path, &AssetFolders),
    read: impl FnOnce(XmlElement) -> Result<T>,
) -> Result<T> {
    let name = element.required(attribute)?;
    let (file, id) = assets.reference(here, name).map_err(|why| element.error(format_args!("{attribute}: {why}")))?;
    let text = XmlText::load(&file, Limit::XML)?;
    let document = text.parse()?;
    let root = XmlElement::root(&document, &text, element.notes());
    let found = root.asset(kind, id).map_err(|error| Error::parse(&file, "", error.to_string()))?;
    read(found)
}

impl HeliosSurvey {
    /// Reads the survey in the file at `path`.
    pub(crate) fn read(path: &Path, assets: &AssetFolders, notes: &NoteBook) -> Result<HeliosSurvey> {
        let text = XmlText::load(path, Limit::XML)?;
        let document = text.parse()?;
        let root = XmlElement::root(&document, &text, notes);
        let survey = root.child("survey").ok_or_else(|| root.error("has no survey in it"))?;
        survey.note_all();
        for mount in root.children("scannerMount") {
            mount.note_all();
            mount.not_understood("a mount outside of platforms and surveys has no effect in HELIOS++");
        }
        let from = (path, assets);
        let interpolated = survey.text("platform") == Some("interpolated");
        let mut platform = match (interpolated, survey.text("basePlatform")) {
            (true, None) => HeliosPlatform { movement: HeliosMovement::Interpolated, mount: fitting(None)? },
            (true, Some(_)) => asset(survey, "basePlatform", "platform", from, HeliosPlatform::read)?,
            (false, _) => asset(survey, "platform", "platform", from, HeliosPlatform::read)?,
        };
        if let Some(mount) = survey.child("scannerMount") {
            let own = fitting(Some(mount))?;
            if interpolated {
                platform.mount = own;
            } else {
                let why = "HELIOS++ reads it for interpolated platforms only";
                mount.not_understood(why);
            }
        }
        if interpolated {
            platform.movement = HeliosMovement::Interpolated;
        }
        note_noise(survey);
        let mut scanner = asset(survey, "scanner", "scanner", from, HeliosScanner::read)?;
        override_detector(survey, &mut scanner)?;
        let canonical = match survey.text("rotationSpec") {
            None | Some("ARINC 705") => false,
            Some("CANONICAL") => true,
            Some(_) => return Err(survey.wrong("rotationSpec", "CANONICAL or ARINC 705")),
        };
        let legs = survey.children("leg").map(|leg| read_leg(leg, from, interpolated.then_some(canonical)));
        let legs = legs.collect::<Result<Vec<HeliosLeg>>>()?;
        if legs.is_empty() {
            return Err(survey.error("has no leg; allowed: at least one"));
        }
        let name = survey.text("name").unwrap_or("survey").to_owned();
        let scene = asset(survey, "scene", "scene", from, |scene| HeliosScene::read(scene, assets))?;
        note_options(survey)?;
        let seed = seed(survey);
        let runs = survey.count("numRuns", 1, 1_000_000)?.unwrap_or(1);
        Ok(HeliosSurvey { name, seed, runs, scanner, platform, scene, legs })
    }
}

/// The seed of a survey, if it is a whole number.
fn seed(survey: XmlElement) -> Option<u64> {
    let text = survey.text("seed")?;
    let seed = text.trim().parse().ok();
    if seed.is_none() {
        let how = "the seed is 0: only whole numbers are kept";
        survey.notes().approximated(survey.place(), "seed", how);
    }
    seed
}

/// Notes what else a survey may say.
fn note_options(survey: XmlElement) -> Result<()> {
    let (notes, place) = (survey.notes(), survey.place());
    if survey.number("simSpeed")?.is_some() {
        notes.approximated(place, "simSpeed", "surveys are made as fast as possible");
    }
    for key in ["legRandomOffset", "legRandomOffsetMean", "legRandomOffsetStdev"] {
        if survey.text(key).is_some() {
            notes.not_understood(place, key, "points of legs are where they are given, without random offsets");
        }
    }
    Ok(())
}

/// Applies what a survey changes of its scanner.
fn override_detector(survey: XmlElement, scanner: &mut HeliosScanner) -> Result<()> {
    for channel in &mut scanner.channels {
        channel.sampling = channel.sampling.replaced(survey)?;
    }
    let Some(settings) = survey.child("detectorSettings") else { return Ok(()) };
    let accuracy = settings.number_within("accuracy_m", 0.0, 1000.0)?;
    let nearest = settings.number_within("rangeMin_m", 0.0, 1e9)?;
    let farthest = settings.number_within("rangeMax_m", 0.0, 1e9)?;
    if settings.text("distanceMeasurementError").is_some() {
        let why = "errors as formulas are not read: there are none";
        settings.notes().not_understood(settings.place(), "distanceMeasurementError", why);
    }
    for channel in &mut scanner.channels {
        channel.accuracy_m = accuracy.unwrap_or(channel.accuracy_m);
        channel.range_min_m = nearest.unwrap_or(channel.range_min_m);
        channel.range_max_m = farthest.or(channel.range_max_m);
    }
    Ok(())
}

/// Reads a leg; `canonical` is how the angles of an interpolated platform are meant.
fn read_leg(leg: XmlElement, (here, assets): (&Path, &AssetFolders), canonical: Option<bool>) -> Result<HeliosLeg> {
    let part = |name| leg.child(name).ok_or_else(|| leg.error(format_args!("has no {name}")));
    let (platform, scanner) = (part(OF_PLATFORMS.element)?, part(OF_SCANNERS.element)?);
    let track = canonical.map(|canonical| HeliosTrack::read(platform, assets, canonical)).transpose()?;
    Ok(HeliosLeg {
        platform: HeliosSettings::read(platform, &OF_PLATFORMS, here, assets)?,
        scanner: HeliosSettings::read(scanner, &OF_SCANNERS, here, assets)?,
        track,
        strip: leg.text("stripId").map(str::to_owned),
        longest_s: leg.number("maxDuration_s")?.filter(|longest| *longest > 0.0),
        place: leg.place(),
    })
}
