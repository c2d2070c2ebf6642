//! Animation stacks: which properties of nodes and blend shapes change over time, and how.

use super::bake::{Baker, FbxCourse};
use super::names::place;
use super::{FbxDocument, affine, deform};
use crate::FileOptions;
use crate::notes::Notes;
use ground::error::Result;
use ground::shown;
use model::motion::SHORTEST_ROUND_S;
use std::collections::HashMap;
use std::iter;
use ufbx::{AnimCurve, AnimStack, ElementType, ExtrapolationMode};

/// Largest deviation of positions from those that `ufbx` evaluates, m.
const TOLERANCE_M: f64 = 1e-5;
/// The same for half of the rotation angle, rad, and for scales and weights.
const TOLERANCE: f64 = 1e-6;

/// Components of a transform, `ufbx_transform_flags`: the crate does not export the values that it requires.
const TRANSLATION: u32 = EXPLICITLY | 0x10;
const ROTATION: u32 = EXPLICITLY | 0x20;
const SCALE: u32 = EXPLICITLY | 0x40;
const EXPLICITLY: u32 = 0x4;

/// Tracks of the animations that are played.
#[derive(Default)]
pub(super) struct FbxTracks {
    /// Names of all animations of the file, played or not.
    pub names: Vec<String>,
    /// When each of them ends, s.
    pub lengths: Vec<f64>,
    nodes: HashMap<u32, Courses>,
    /// Courses of the weights of blend shapes, for each mesh with animated ones.
    weights: HashMap<u32, FbxCourse>,
}

/// Courses of the properties of a node.
#[derive(Default)]
pub(super) struct Courses {
    pub translation: FbxCourse,
    pub rotation: FbxCourse,
    pub scale: FbxCourse,
    pub visible: FbxCourse,
}

/// A kind of property that can be animated.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
enum FbxProperty {
    Place,
    Visible,
    Weight,
}

/// An animation that is played.
struct Play<'a> {
    anim: &'a ufbx::Anim,
    period: Option<f64>,
    /// Times of the keys of each property of each element.
    times: HashMap<(u32, FbxProperty), Vec<f64>>,
    /// Times of the keys of layer weights: everything changes with them.
    of_layers: Vec<f64>,
}

impl FbxTracks {
    /// Reads the animations that `options` select.
    pub fn read(document: &FbxDocument<'_>, options: &FileOptions, notes: &mut Notes) -> Result<FbxTracks> {
        let mut tracks = FbxTracks::default();
        for (index, stack) in document.file.anim_stacks.as_ref().iter().enumerate() {
            let name = stack.element.name.to_string();
            let name = if name.is_empty() { format!("animation_{index}") } else { name };
            let length = length(stack);
            let played = options.animation.as_ref().is_none_or(|selected| *selected == name);
            let here = format!("animation {:?}", shown::name(&name));
            let fault = |message: String| document.error(&here, message);
            tracks.names.push(name);
            tracks.lengths.push(length);
            if !played {
                continue;
            }
            let period = (options.looped && length > 0.0).then_some(length);
            if let Some(short) = period.filter(|&period| period < SHORTEST_ROUND_S) {
                let message = format!("it takes {short} s; allowed to be repeated: {SHORTEST_ROUND_S} s and more");
                return Err(fault(message));
            }
            let play = Play::read(document, stack, period, notes).map_err(fault)?;
            tracks.play(document, &play, notes)?;
        }
        Ok(tracks)
    }

    /// Adds the tracks of `play` to those of the animations before it.
    fn play(&mut self, document: &FbxDocument<'_>, play: &Play<'_>, notes: &mut Notes) -> Result<()> {
        for node in &document.file.nodes {
            let fault = |message: String| document.error(place(node), message);
            let (places, scales) = play.places(node);
            document.budget.look(1 + scales).map_err(fault)?;
            if !places.is_empty() {
                let courses = self.nodes.entry(node.element.typed_id).or_default();
                if !matches!(courses.rotation, FbxCourse::NotAnimated) {
                    notes.add("of the animations that move one node, the last is played", || place(node));
                }
                play.place(document, node, &places, scales, courses).map_err(fault)?;
            }
            let visibility_times = play.times(node.element.element_id, FbxProperty::Visible);
            if !visibility_times.is_empty() {
                let value = |time| {
                    let found = ufbx::evaluate_prop(play.anim, &node.element, "Visibility", time);
                    vec![f64::from(u8::from(found.value_int != 0))]
                };
                let steps = play.baker(document, &value).steps(&visibility_times).map_err(fault)?;
                self.nodes.entry(node.element.typed_id).or_default().visible = steps;
            }
        }
        for mesh in &document.file.meshes {
            let here = || format!("mesh {:?}", shown::name(&mesh.element.name));
            let fault = |message: String| document.error(here(), message);
            let (mut times, mut channels) = (Vec::new(), 0);
            for channel in deform::channels(mesh) {
                let own =
                    play.times.get(&(channel.element.element_id, FbxProperty::Weight)).map_or(&[][..], Vec::as_slice);
                document.budget.look(1 + own.len()).map_err(fault)?;
                times.extend(own);
                channels += 1;
            }
            let times = sorted(times, &play.of_layers);
            if times.is_empty() {
                continue;
            }
            let value = |time| deform::weights(mesh, |channel| channel.evaluate_blend_weight(play.anim, time));
            let baker = play.baker(document, &value);
            let course = Baker { cost: channels * baker.cost, ..baker }.bake(&times).map_err(fault)?;
            if self.weights.insert(mesh.element.typed_id, course).is_some() {
                notes.add("of the animations that move the blend shapes of one mesh, the last is played", here);
            }
        }
        Ok(())
    }

    /// Courses of `node`, if an animation changes it.
    pub fn of_node(&self, node: &ufbx::Node) -> Option<&Courses> {
        self.nodes.get(&node.element.typed_id)
    }

    /// Course of the weights of the blend shapes of `mesh`, if an animation changes them.
    pub fn of_mesh(&self, mesh: &ufbx::Mesh) -> Option<&FbxCourse> {
        self.weights.get(&mesh.element.typed_id)
    }
}

impl<'a> Play<'a> {
    fn read(
        document: &FbxDocument<'_>,
        stack: &'a AnimStack,
        period: Option<f64>,
        notes: &mut Notes,
    ) -> Result<Play<'a>, String> {
        let mut play = Play { anim: &stack.anim, period, times: HashMap::new(), of_layers: Vec::new() };
        for prop in stack.layers.as_ref().iter().flat_map(|layer| &layer.anim_props) {
            let curves = || prop.anim_value.curves.iter().flatten();
            let kind = match (prop.element.type_, prop.prop_name.as_ref()) {
                (ElementType::Node, "Visibility") => FbxProperty::Visible,
                (ElementType::Node, name) if places(name) => FbxProperty::Place,
                (ElementType::BlendChannel, _) => FbxProperty::Weight,
                (ElementType::AnimLayer, _) => {
                    for curve in curves() {
                        keys(document, stack, curve, &mut play.of_layers)?;
                    }
                    continue;
                }
                (ElementType::Material | ElementType::Texture, _) => {
                    notes.add("animations of materials and textures are not played", || {
                        format!("{:?}", shown::name(&prop.element.name))
                    });
                    continue;
                }
                _ => continue,
            };
            let times = play.times.entry((prop.element.element_id, kind)).or_default();
            for curve in curves() {
                keys(document, stack, curve, times)?;
            }
        }
        Ok(play)
    }

    /// A dimensionless quantity, to be adapted as needed.
    fn baker<'b>(&self, document: &'b FbxDocument<'_>, value: &'b dyn Fn(f64) -> Vec<f64>) -> Baker<'b> {
        let cost = 1 + self.anim.layers.len();
        Baker { value, cost, turns: false, tolerance: TOLERANCE, period: self.period, budget: document.budget }
    }

    /// Times at which a property of `kind` may bend or jump, ascending; empty: never.
    fn times(&self, element: u32, kind: FbxProperty) -> Vec<f64> {
        let own = self.times.get(&(element, kind));
        own.map_or(Vec::new(), |own| sorted(own.clone(), &self.of_layers))
    }

    /// The same for the transform of `node`, which also depends on nodes that `ufbx` adds for scales above it, and the
    /// number of these nodes.
    fn places(&self, node: &ufbx::Node) -> (Vec<f64>, usize) {
        let of =
            |node: &ufbx::Node| self.times.get(&(node.element.element_id, FbxProperty::Place)).into_iter().flatten();
        let mut all: Vec<f64> = of(node).copied().collect();
        let Some(parent) = node.parent.as_deref() else { return (sorted(all, &self.of_layers), 0) };
        let inherited =
            iter::successors(parent.inherit_scale_node.as_deref(), |node| node.inherit_scale_node.as_deref());
        let mut scales = 0;
        for helper in iter::once(parent).chain(inherited).filter_map(|node| node.scale_helper.as_deref()) {
            all.extend(of(helper));
            scales += 1;
        }
        (sorted(all, &self.of_layers), scales)
    }

    /// Bakes the courses of `node`, whose transform changes at `times` and depends on that many `scales` above it.
    fn place(
        &self,
        document: &FbxDocument<'_>,
        node: &ufbx::Node,
        times: &[f64],
        scales: usize,
        courses: &mut Courses,
    ) -> Result<(), String> {
        document.budget.charge(size_of::<Courses>())?;
        let look = |time, part| ufbx::evaluate_transform_flags(self.anim, node, time, part);
        let moved = |time| {
            let found = look(time, TRANSLATION).translation;
            vec![found.x, found.y, found.z]
        };
        let turned = |time| {
            let found = look(time, ROTATION).rotation;
            vec![found.x, found.y, found.z, found.w]
        };
        let scaled = |time| {
            let found = look(time, SCALE).scale;
            vec![found.x, found.y, found.z]
        };
        // Metres in the world are different units in the parent.
        let world_from_parent = node.parent.as_deref().map_or(1.0, |parent| {
            let matrix = affine(&parent.node_to_world).matrix3;
            matrix.x_axis.length().max(matrix.y_axis.length()).max(matrix.z_axis.length())
        });
        let tolerance = (TOLERANCE_M / world_from_parent).clamp(1e-12, 1e12);
        let baker = |value| {
            let baker = self.baker(document, value);
            Baker { cost: baker.cost + scales, ..baker }
        };
        courses.translation = Baker { tolerance, ..baker(&moved) }.bake(times)?;
        courses.rotation = Baker { turns: true, ..baker(&turned) }.bake(times)?;
        courses.scale = baker(&scaled).bake(times)?;
        Ok(())
    }
}

/// Whether the property `name` of a node is part of its transform.
fn places(name: &str) -> bool {
    matches!(
        name,
        "Lcl Translation"
            | "Lcl Rotation"
            | "Lcl Scaling"
            | "RotationOffset"
            | "RotationPivot"
            | "ScalingOffset"
            | "ScalingPivot"
            | "PreRotation"
            | "PostRotation"
            | "RotationOrder"
    )
}

/// `times` and `more`, ascending, without duplicates.
fn sorted(mut times: Vec<f64>, more: &[f64]) -> Vec<f64> {
    if times.is_empty() {
        return times;
    }
    times.extend(more);
    times.sort_by(f64::total_cmp);
    times.dedup();
    times
}

/// Time of the last key of an animation, s.
fn length(stack: &AnimStack) -> f64 {
    let values = stack.layers.as_ref().iter().flat_map(|layer| &layer.anim_values);
    let curves = values.flat_map(|value| value.curves.iter().flatten());
    let ends = curves.filter_map(|curve| curve.keyframes.as_ref().last()).map(|key| key.time);
    ends.filter(|end| end.is_finite()).fold(0.0, f64::max)
}

/// Adds the times of the keys of `curve`, and of those that it repeats until the animation ends.
fn keys(document: &FbxDocument<'_>, stack: &AnimStack, curve: &AnimCurve, times: &mut Vec<f64>) -> Result<(), String> {
    let keys = curve.keyframes.as_ref();
    document.budget.charge(keys.len() * size_of::<f64>())?;
    if let Some(bad) = keys.iter().find(|key| !(key.time.is_finite() && key.value.is_finite())) {
        return Err(format!("a key at {} s has the value {}; allowed: finite numbers", bad.time, bad.value));
    }
    times.extend(keys.iter().map(|key| key.time));
    let (Some(first), Some(last)) = (keys.first(), keys.last()) else { return Ok(()) };
    let length = last.time - first.time;
    let continues = |mode| mode != ExtrapolationMode::Constant && stack.time_end.is_finite() && length > 0.0;
    if continues(curve.post_extrapolation.mode) && stack.time_end > last.time {
        let rounds = ((stack.time_end - last.time) / length).ceil();
        if rounds * keys.len() as f64 > 1e7 {
            return Err(format!("a curve repeats itself {rounds} times; allowed: fewer"));
        }
        for round in 1..=rounds as usize {
            document.budget.charge(keys.len() * size_of::<f64>())?;
            let start = round as f64 * length;
            // Some curves run backwards in every other round.
            let again = keys.iter().flat_map(|key| [key.time, first.time + last.time - key.time]);
            times.extend(again.map(|time| time + start).filter(|time| *time < stack.time_end));
        }
        times.push(stack.time_end);
    }
    if continues(curve.pre_extrapolation.mode) && stack.time_begin < first.time && stack.time_begin.is_finite() {
        times.push(stack.time_begin);
    }
    Ok(())
}
