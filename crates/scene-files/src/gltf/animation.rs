//! Animations: which properties change over time, and how (glTF 2.0, 3.11; `KHR_animation_pointer`).

use super::accessor::Accessors;
use super::sampler::{Quantity, SampledCurve, Sampler, Samplers};
use super::targets::targets_of_node;
use super::{GltfDocument, Notes, place};
use crate::FileOptions;
use ground::error::Result;
use ground::report::Report;
use ground::shown;
use model::motion::{AnimationTrack, SHORTEST_ROUND_S};
use serde::Deserialize;
use std::collections::{BTreeSet, HashMap};
use std::path::Path;

pub(super) const POINTER: &str = "KHR_animation_pointer";

/// An animation as in the file.
#[derive(Deserialize)]
pub(super) struct Animation {
    name: Option<String>,
    #[serde(default)]
    channels: Vec<AnimationChannel>,
    #[serde(default)]
    samplers: Vec<Sampler>,
}

#[derive(Deserialize)]
struct AnimationChannel {
    sampler: usize,
    target: ChannelTarget,
}

#[derive(Deserialize)]
struct ChannelTarget {
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

/// A property that can be animated, with the number of its node or material in the file.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum GltfProperty {
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

/// The course of a property over time.
pub(super) enum GltfCourse {
    /// A constant value, which may differ from the one without animations.
    Still(Vec<f64>),
    Moving(AnimationTrack),
}

/// Tracks of the animations that are played.
#[derive(Default)]
pub(super) struct GltfTracks {
    courses: HashMap<GltfProperty, GltfCourse>,
    /// Properties whose animations are not played, with N for every number.
    unplayed: BTreeSet<String>,
}

impl Animation {
    /// Name of animation `index`.
    pub fn name(&self, index: usize) -> String {
        self.name.clone().unwrap_or_else(|| format!("animation_{index}"))
    }
}

/// Times of the last keys of all animations, s.
pub(super) fn lengths(document: &GltfDocument<'_>, samplers: &mut Samplers<'_>) -> Result<Vec<f64>> {
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
    fn sampler(&self, channel: &AnimationChannel) -> Result<&Sampler, String> {
        let (index, known) = (channel.sampler, self.samplers.len());
        self.samplers.get(index).ok_or_else(|| format!("its sampler {index} does not exist: the animation has {known}"))
    }

    /// `animation 0 "walk" channel 3`.
    fn place(&self, index: usize, channel: usize) -> String {
        format!("{} channel {channel}", place("animation", index, self.name.as_deref()))
    }
}

impl GltfTracks {
    /// Reads the animations that `options` select; `lengths` are those of all animations, s.
    pub fn read(
        document: &GltfDocument<'_>,
        samplers: &mut Samplers<'_>,
        lengths: &[f64],
        options: &FileOptions,
        notes: &mut Notes,
    ) -> Result<GltfTracks> {
        let mut tracks = GltfTracks::default();
        for (index, animation) in document.animations.iter().enumerate() {
            if options.animation.as_ref().is_some_and(|selected| *selected != animation.name(index)) {
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
                let SampledCurve { curve, still } = samplers.keys(sampler, quantity).map_err(fault)?;
                let track = AnimationTrack { curve, period };
                let course = if still {
                    let mut value = vec![0.0; track.curve.width];
                    track.at(0.0, &mut value);
                    GltfCourse::Still(value)
                } else {
                    GltfCourse::Moving(track)
                };
                if tracks.courses.insert(property, course).is_some() {
                    notes.add("of the channels that animate one property, the last is played", here);
                }
            }
        }
        Ok(tracks)
    }

    /// The course of `property`, if an animation changes it.
    pub fn get(&self, property: GltfProperty) -> Option<&GltfCourse> {
        self.courses.get(&property)
    }

    /// Whether no animation changes anything.
    pub fn is_empty(&self) -> bool {
        self.courses.is_empty()
    }

    /// The constant value or the track of a property, if any.
    pub fn split<const N: usize>(&self, property: GltfProperty) -> (Option<[f64; N]>, Option<AnimationTrack>) {
        match self.get(property) {
            None => (None, None),
            Some(GltfCourse::Still(value)) => (value.as_slice().try_into().ok(), None),
            Some(GltfCourse::Moving(track)) => (None, Some(track.clone())),
        }
    }

    /// Warns about what is not played.
    pub fn report_to(&self, origin: &Path, report: &mut Report) {
        if !self.unplayed.is_empty() {
            let names = shown::some_of(&self.unplayed.iter().cloned().collect::<Vec<_>>());
            report.warn(format!("{}: animations of these are not played: {names}", shown::path(origin)));
        }
    }
}

impl ChannelTarget {
    /// The property that it animates, or the kind of one that is not played.
    fn property(&self, document: &GltfDocument<'_>) -> Result<Result<GltfProperty, String>, String> {
        if self.path == "pointer" {
            let Some(Pointer { pointer }) = &self.extensions.pointer else {
                return Err(format!("its path is pointer, but it has no {POINTER}"));
            };
            return pointed(pointer, document);
        }
        let of: fn(usize) -> GltfProperty = match self.path.as_str() {
            "translation" => GltfProperty::Translation,
            "rotation" => GltfProperty::Rotation,
            "scale" => GltfProperty::Scale,
            "weights" => GltfProperty::Weights,
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

/// The property that a pointer refers to, or the kind of a pointer that is not played.
fn pointed(pointer: &str, document: &GltfDocument<'_>) -> Result<Result<GltfProperty, String>, String> {
    let number = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit()).then(|| text.parse().ok()).flatten();
    let mut steps = pointer.splitn(4, '/');
    let (start, kind, index, rest) = (steps.next(), steps.next(), steps.next().and_then(number), steps.next());
    let of: Option<fn(usize) -> GltfProperty> = match (start, kind, rest) {
        (Some(""), Some("nodes"), Some("translation")) => Some(GltfProperty::Translation),
        (Some(""), Some("nodes"), Some("rotation")) => Some(GltfProperty::Rotation),
        (Some(""), Some("nodes"), Some("scale")) => Some(GltfProperty::Scale),
        (Some(""), Some("nodes"), Some("weights")) => Some(GltfProperty::Weights),
        (Some(""), Some("nodes"), Some("extensions/KHR_node_visibility/visible")) => Some(GltfProperty::Visible),
        (Some(""), Some("materials"), Some("pbrMetallicRoughness/baseColorFactor")) => Some(GltfProperty::BaseColor),
        (Some(""), Some("materials"), Some("pbrMetallicRoughness/metallicFactor")) => Some(GltfProperty::Metallic),
        (Some(""), Some("materials"), Some("pbrMetallicRoughness/roughnessFactor")) => Some(GltfProperty::Roughness),
        (Some(""), Some("materials"), Some("extras/reflectance")) => Some(GltfProperty::Reflectance),
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
            // If the older model is given, it takes precedence.
            let extensions = document.json.materials[material].extensions.as_ref();
            let is_older = extensions.is_some_and(|all| all.pbr_specular_glossiness.is_some());
            if is_older && !matches!(property, GltfProperty::Reflectance(_)) {
                return Ok(Err(unknown(pointer)));
            }
            Ok(Ok(property))
        }
        None => Ok(Err(unknown(pointer))),
    }
}

/// The kind of a pointer to a property that is not known here.
fn unknown(pointer: &str) -> String {
    let is_number = |step: &str| !step.is_empty() && step.bytes().all(|byte| byte.is_ascii_digit());
    let name = |step| if is_number(step) { "N" } else { step };
    pointer.split('/').map(name).collect::<Vec<_>>().join("/")
}

/// The property `of` a node that exists and may have it animated.
fn node_property(
    of: fn(usize) -> GltfProperty,
    node: usize,
    document: &GltfDocument<'_>,
) -> Result<GltfProperty, String> {
    let known = document.transforms.len();
    let Some(transform) = document.transforms.get(node) else {
        return Err(format!("its node {node} does not exist: the file has {known}"));
    };
    let property = of(node);
    let moves = matches!(property, GltfProperty::Translation(_) | GltfProperty::Rotation(_) | GltfProperty::Scale(_));
    if moves && transform.has_matrix() {
        let node = document.node_place(node);
        return Err(format!(
            "{node} has a matrix, so it cannot be animated; allowed: nodes with translation, rotation, scale"
        ));
    }
    Ok(property)
}

impl GltfProperty {
    fn quantity(self, document: &GltfDocument<'_>) -> Result<Quantity, String> {
        Ok(match self {
            GltfProperty::Translation(_) | GltfProperty::Scale(_) => Quantity::of(3),
            GltfProperty::Rotation(_) => Quantity { turns: true, ..Quantity::of(4) },
            GltfProperty::Weights(node) => Quantity { elements: targets_of_node(document, node)?, ..Quantity::of(1) },
            GltfProperty::Visible(_) => Quantity { jumps: true, ..Quantity::of(1) },
            GltfProperty::BaseColor(_) => Quantity::of(4),
            GltfProperty::Metallic(_) | GltfProperty::Roughness(_) => Quantity::of(1),
            GltfProperty::Reflectance(_) => Quantity { fraction: true, ..Quantity::of(1) },
        })
    }
}

/// Tracks of the animations that `options` select, read from `accessors`, and the lengths of all animations, s.
pub(super) fn read(
    document: &GltfDocument<'_>,
    accessors: &Accessors<'_>,
    options: &FileOptions,
    notes: &mut Notes,
) -> Result<(GltfTracks, Vec<f64>)> {
    let mut samplers = Samplers::new(accessors);
    let lengths = lengths(document, &mut samplers)?;
    let tracks = GltfTracks::read(document, &mut samplers, &lengths, options, notes)?;
    Ok((tracks, lengths))
}
