//! Animations: which properties change over time, and how (glTF 2.0, 3.11; `KHR_animation_pointer`).

use super::accessor::Accessors;
use super::sampler::{Keys, Quantity, Sampler, Samplers};
use super::{Document, Notes, morph, place};
use crate::ground::error::Result;
use crate::ground::report::Report;
use crate::ground::shown;
use crate::motion::Track;
use crate::scene::{LoadOptions, some_of};
use serde::Deserialize;
use std::collections::{BTreeSet, HashMap};
use std::path::Path;

pub(super) const POINTER: &str = "KHR_animation_pointer";

/// Shortest animation or cache that can be repeated, s: whoever looks at a time must get to the end of its rounds.
pub(in crate::scene) const SHORTEST_ROUND_S: f64 = 1e-3;

/// An animation as the file has it.
#[derive(Deserialize)]
pub(super) struct Animation {
    name: Option<String>,
    #[serde(default)]
    channels: Vec<Channel>,
    #[serde(default)]
    samplers: Vec<Sampler>,
}

#[derive(Deserialize)]
struct Channel {
    sampler: usize,
    target: Target,
}

#[derive(Deserialize)]
struct Target {
    node: Option<usize>,
    path: String,
    #[serde(default)]
    extensions: Extensions,
}

#[derive(Default, Deserialize)]
struct Extensions {
    #[serde(rename = "KHR_animation_pointer")]
    pointer: Option<Pointer>,
}

#[derive(Deserialize)]
struct Pointer {
    pointer: String,
}

/// What can change over time, by the number of its node or material in the file.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum Property {
    Translation(usize),
    Rotation(usize),
    Scale(usize),
    Weights(usize),
    Visible(usize),
    BaseColor(usize),
    Metallic(usize),
    Roughness(usize),
    Reflectance(usize),
}

/// What a property does over time.
pub(super) enum Course {
    /// It has this value, though the file says something else without its animations.
    Still(Vec<f64>),
    Moving(Track),
}

/// What the animations that are played say.
#[derive(Default)]
pub(super) struct Tracks {
    courses: HashMap<Property, Course>,
    /// Properties that are not played, with N for every number.
    unplayed: BTreeSet<String>,
}

impl Animation {
    /// Name of animation `index`.
    pub fn name(&self, index: usize) -> String {
        self.name.clone().unwrap_or_else(|| format!("animation_{index}"))
    }
}

/// Times of the last keys of all animations, s.
pub(super) fn lengths(document: &Document<'_>, samplers: &mut Samplers<'_>) -> Result<Vec<f64>> {
    let of = |(index, animation): (usize, &Animation)| {
        let mut end: f64 = 0.0;
        for (number, channel) in animation.channels.iter().enumerate() {
            let last = animation.sampler(channel).and_then(|sampler| samplers.end(sampler));
            end = end.max(last.map_err(|message| document.error(animation.place(index, number), message))?);
        }
        Ok(end)
    };
    document.animations.iter().enumerate().map(of).collect()
}

impl Animation {
    /// The sampler of a channel.
    fn sampler(&self, channel: &Channel) -> Result<&Sampler, String> {
        let (index, known) = (channel.sampler, self.samplers.len());
        self.samplers.get(index).ok_or_else(|| format!("its sampler {index} does not exist: the animation has {known}"))
    }

    /// `animation 0 "walk" channel 3`.
    fn place(&self, index: usize, channel: usize) -> String {
        format!("{} channel {channel}", place("animation", index, self.name.as_deref()))
    }
}

impl Tracks {
    /// Reads the animations that `options` select, which last `lengths`.
    pub fn read(
        document: &Document<'_>,
        samplers: &mut Samplers<'_>,
        lengths: &[f64],
        options: &LoadOptions,
        notes: &mut Notes,
    ) -> Result<Tracks> {
        let mut tracks = Tracks::default();
        for (index, animation) in document.animations.iter().enumerate() {
            if options.animation.as_ref().is_some_and(|wanted| *wanted != animation.name(index)) {
                continue;
            }
            let period = (options.looped && lengths[index] > 0.0).then_some(lengths[index]);
            if let Some(short) = period.filter(|&period| period < SHORTEST_ROUND_S) {
                let message = format!("it takes {short} s; allowed to be repeated: {SHORTEST_ROUND_S} s and more");
                return Err(document.error(place("animation", index, animation.name.as_deref()), message));
            }
            for (number, channel) in animation.channels.iter().enumerate() {
                let here = || animation.place(index, number);
                let fault = |message: String| document.error(here(), message);
                let sampler = animation.sampler(channel).map_err(fault)?;
                let property = match channel.target.property(document).map_err(fault)? {
                    Ok(property) => property,
                    Err(unplayed) => {
                        tracks.unplayed.insert(unplayed);
                        continue;
                    }
                };
                let quantity = property.quantity(document).map_err(fault)?;
                let Keys { curve, still } = samplers.keys(sampler, quantity).map_err(fault)?;
                let track = Track { curve, period };
                let course = if still {
                    let mut value = vec![0.0; track.curve.width];
                    track.at(0.0, &mut value);
                    Course::Still(value)
                } else {
                    Course::Moving(track)
                };
                if tracks.courses.insert(property, course).is_some() {
                    notes.add("of the channels that animate one property, the last is played", here);
                }
            }
        }
        Ok(tracks)
    }

    /// What `property` does, if an animation says anything of it.
    pub fn get(&self, property: Property) -> Option<&Course> {
        self.courses.get(&property)
    }

    /// Whether no animation says anything.
    pub fn is_empty(&self) -> bool {
        self.courses.is_empty()
    }

    /// The constant value, if any, and else the track of a property.
    pub fn split<const N: usize>(&self, property: Property) -> (Option<[f64; N]>, Option<Track>) {
        match self.get(property) {
            None => (None, None),
            Some(Course::Still(value)) => (value.as_slice().try_into().ok(), None),
            Some(Course::Moving(track)) => (None, Some(track.clone())),
        }
    }

    /// Warns of what is not played.
    pub fn tell(&self, origin: &Path, report: &mut Report) {
        if !self.unplayed.is_empty() {
            let names = some_of(&self.unplayed.iter().cloned().collect::<Vec<_>>());
            report.warn(format!("{}: animations of these are not played: {names}", shown::path(origin)));
        }
    }
}

impl Target {
    /// What it animates, or the kind of what is not played.
    fn property(&self, document: &Document<'_>) -> Result<Result<Property, String>, String> {
        if self.path == "pointer" {
            let Some(Pointer { pointer }) = &self.extensions.pointer else {
                return Err(format!("its path is pointer, but it has no {POINTER}"));
            };
            return pointed(pointer, document);
        }
        let of: fn(usize) -> Property = match self.path.as_str() {
            "translation" => Property::Translation,
            "rotation" => Property::Rotation,
            "scale" => Property::Scale,
            "weights" => Property::Weights,
            other => {
                let (found, allowed) = (shown::name(other), "translation, rotation, scale, weights, pointer");
                return Err(format!("its path is {found:?}; allowed: {allowed}"));
            }
        };
        match self.node {
            Some(node) => node_property(of, node, document).map(Ok),
            None => Ok(Err(format!("{} of no node", self.path))),
        }
    }
}

/// What a pointer leads to, or its kind.
fn pointed(pointer: &str, document: &Document<'_>) -> Result<Result<Property, String>, String> {
    let number = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit()).then(|| text.parse().ok()).flatten();
    let mut steps = pointer.splitn(4, '/');
    let (start, kind, index, rest) = (steps.next(), steps.next(), steps.next().and_then(number), steps.next());
    let of: Option<fn(usize) -> Property> = match (start, kind, rest) {
        (Some(""), Some("nodes"), Some("translation")) => Some(Property::Translation),
        (Some(""), Some("nodes"), Some("rotation")) => Some(Property::Rotation),
        (Some(""), Some("nodes"), Some("scale")) => Some(Property::Scale),
        (Some(""), Some("nodes"), Some("weights")) => Some(Property::Weights),
        (Some(""), Some("nodes"), Some("extensions/KHR_node_visibility/visible")) => Some(Property::Visible),
        (Some(""), Some("materials"), Some("pbrMetallicRoughness/baseColorFactor")) => Some(Property::BaseColor),
        (Some(""), Some("materials"), Some("pbrMetallicRoughness/metallicFactor")) => Some(Property::Metallic),
        (Some(""), Some("materials"), Some("pbrMetallicRoughness/roughnessFactor")) => Some(Property::Roughness),
        (Some(""), Some("materials"), Some("extras/reflectance")) => Some(Property::Reflectance),
        _ => None,
    };
    match of.zip(index) {
        Some((of, node)) if kind == Some("nodes") => node_property(of, node, document).map(Ok),
        Some((of, material)) => {
            let known = document.json.materials.len();
            if material >= known {
                return Err(format!("its material {material} does not exist: the file has {known}"));
            }
            let property = of(material);
            // Where the older model is given, it counts.
            let extensions = document.json.materials[material].extensions.as_ref();
            let is_older = extensions.is_some_and(|all| all.pbr_specular_glossiness.is_some());
            if is_older && !matches!(property, Property::Reflectance(_)) {
                return Ok(Err(unknown(pointer)));
            }
            Ok(Ok(property))
        }
        None => Ok(Err(unknown(pointer))),
    }
}

/// A kind of pointers that lead to nothing that is known here.
fn unknown(pointer: &str) -> String {
    let is_number = |step: &str| !step.is_empty() && step.bytes().all(|byte| byte.is_ascii_digit());
    let name = |step| if is_number(step) { "N" } else { step };
    pointer.split('/').map(name).collect::<Vec<_>>().join("/")
}

/// The property `of` a node that exists and may have it animated.
fn node_property(of: fn(usize) -> Property, node: usize, document: &Document<'_>) -> Result<Property, String> {
    let known = document.transforms.len();
    let Some(transform) = document.transforms.get(node) else {
        return Err(format!("its node {node} does not exist: the file has {known}"));
    };
    let property = of(node);
    let moves = matches!(property, Property::Translation(_) | Property::Rotation(_) | Property::Scale(_));
    if moves && transform.has_matrix() {
        let node = document.node_place(node);
        return Err(format!(
            "{node} has a matrix, so it cannot be animated; allowed: nodes with translation, rotation, scale"
        ));
    }
    Ok(property)
}

impl Property {
    fn quantity(self, document: &Document<'_>) -> Result<Quantity, String> {
        Ok(match self {
            Property::Translation(_) | Property::Scale(_) => Quantity::of(3),
            Property::Rotation(_) => Quantity { turns: true, ..Quantity::of(4) },
            Property::Weights(node) => {
                Quantity { elements: morph::targets_of_node(document, node)?, ..Quantity::of(1) }
            }
            Property::Visible(_) => Quantity { jumps: true, ..Quantity::of(1) },
            Property::BaseColor(_) => Quantity::of(4),
            Property::Metallic(_) | Property::Roughness(_) => Quantity::of(1),
            Property::Reflectance(_) => Quantity { fraction: true, ..Quantity::of(1) },
        })
    }
}

/// Every animation of the file, of which `accessors` has the numbers, and when each ends.
pub(super) fn read(
    document: &Document<'_>,
    accessors: &Accessors<'_>,
    options: &LoadOptions,
    notes: &mut Notes,
) -> Result<(Tracks, Vec<f64>)> {
    let mut samplers = Samplers::new(accessors);
    let lengths = lengths(document, &mut samplers)?;
    let tracks = Tracks::read(document, &mut samplers, &lengths, options, notes)?;
    Ok((tracks, lengths))
}
