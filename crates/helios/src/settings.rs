//! Settings of the legs of a survey, templates included.

use crate::assets::AssetFolders;
use crate::notes::XmlPlace;
use crate::xml::XmlElement;
use ground::error::{Error, Result};
use ground::read::Limit;
use ground::read::xml::XmlText;
use ground::shown;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Settings of a scanner or a platform on one leg: each is that of the leg, or else that of its template.
#[derive(Clone, Debug, Default)]
pub struct HeliosSettings {
    /// Numbers and truths, 0 and 1, by the name of their attribute.
    values: BTreeMap<&'static str, (f64, XmlPlace)>,
}

/// Name of a number and the least and greatest one that makes sense.
type KnownNumber = (&'static str, [f64; 2]);

/// What `scannerSettings` and `platformSettings` may have.
pub(crate) struct KnownSettings {
    /// Name of the element.
    pub element: &'static str,
    numbers: &'static [KnownNumber],
    flags: &'static [&'static str],
}

/// Most templates that each have the next one.
const DEEPEST: usize = 100;

const ANGLE: [f64; 2] = [-1e6, 1e6];
const TIME: [f64; 2] = [-1e9, 1e9];

pub(crate) const OF_SCANNERS: KnownSettings = KnownSettings {
    element: "scannerSettings",
    numbers: &[
        ("pulseFreq_hz", [1.0, 1e9]),
        ("scanFreq_hz", [0.0, 1e6]),
        ("scanAngle_deg", [-360.0, 360.0]),
        ("verticalAngleMin_deg", [-360.0, 360.0]),
        ("verticalAngleMax_deg", [-360.0, 360.0]),
        ("headRotatePerSec_deg", ANGLE),
        ("headRotateStart_deg", ANGLE),
        ("headRotateStop_deg", ANGLE),
        ("verticalResolution_deg", [0.0, 360.0]),
        ("horizontalResolution_deg", [0.0, 360.0]),
        ("beamDivergence_rad", [0.0, 1.0]),
        ("beamDivergenceRad", [0.0, 1.0]),
        ("trajectoryTimeInterval_s", TIME),
        ("opticsWarmupPhase_s", TIME),
        ("maxDuration_s", TIME),
    ],
    flags: &["active"],
};

pub(crate) const OF_PLATFORMS: KnownSettings = KnownSettings {
    element: "platformSettings",
    numbers: &[
        ("x", [-1e9, 1e9]),
        ("y", [-1e9, 1e9]),
        ("z", [-1e9, 1e9]),
        ("movePerSec_m", [0.0, 1e6]),
        ("yawAtDeparture_deg", ANGLE),
    ],
    flags: &["onGround", "stopAndTurn", "smoothTurn", "slowdownEnabled"],
};

impl HeliosSettings {
    /// Those of `element`, of the kind `known`, and of its template, which is in the file at `here` or another.
    pub(crate) fn read(element: XmlElement, known: &KnownSettings, here: &Path, assets: &AssetFolders) -> Result<Self> {
        let mut settings = HeliosSettings::default();
        settings.add(element, known, here, assets, &mut Vec::new())?;
        Ok(settings)
    }

    /// Adds the values of `element` and of its template that are not there yet. `above` are the templates that led here.
    fn add(
        &mut self,
        element: XmlElement,
        known: &KnownSettings,
        here: &Path,
        assets: &AssetFolders,
        above: &mut Vec<(PathBuf, String)>,
    ) -> Result<()> {
        let place = element.place();
        for &(name, [low, high]) in known.numbers {
            if let Some(value) = element.number_within(name, low, high)? {
                self.values.entry(name).or_insert((value, place));
            }
        }
        for &name in known.flags {
            if let Some(value) = element.flag(name)? {
                self.values.entry(name).or_insert((value.into(), place));
            }
        }
        if let Some(child) = element.child("maxDuration_s") {
            let value = child.content().parse().ok().filter(|value: &f64| value.is_finite());
            let value = value.ok_or_else(|| child.error("has no number"))?;
            self.values.entry("maxDuration_s").or_insert((value, place));
        }
        let Some(template) = element.text("template") else { return Ok(()) };
        let (file, id) =
            assets.reference(here, template).map_err(|why| element.error(format_args!("template: {why}")))?;
        let reached = (file, id.to_owned());
        if above.contains(&reached) {
            return Err(element.error(format_args!("template {:?} leads back to itself", shown::name(template))));
        }
        if above.len() == DEEPEST {
            return Err(
                element.error(format_args!("has templates of templates, more than {DEEPEST} deep, the most allowed"))
            );
        }
        above.push(reached.clone());
        let missing = |error: Error| element.error(format_args!("template: {error}"));
        if reached.0 == here {
            let found = element.outermost().asset(known.element, id).map_err(missing)?;
            return self.add(found, known, here, assets, above);
        }
        let text = XmlText::load(&reached.0, Limit::XML)?;
        let document = text.parse()?;
        let found = XmlElement::root(&document, &text, element.notes()).asset(known.element, id).map_err(missing)?;
        self.add(found, known, &reached.0, assets, above)
    }

    /// A number, and where it is.
    pub(crate) fn number(&self, name: &str) -> Option<f64> {
        self.values.get(name).map(|(value, _)| *value)
    }

    /// Whether something is so.
    pub(crate) fn flag(&self, name: &str) -> Option<bool> {
        self.number(name).map(|value| value != 0.0)
    }

    /// Where an attribute is.
    pub(crate) fn place(&self, name: &str) -> Option<XmlPlace> {
        self.values.get(name).map(|(_, place)| *place)
    }
}
