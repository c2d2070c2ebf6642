//! The nodes of a scene over time.

use super::{AnimationTrack, Curve, Interpolation};
use glam::{DAffine3, DQuat, DVec3};
use ground::error::{Error, Result};
use std::sync::Arc;

/// What moves in a scene, evaluated at any time, in seconds: a hierarchy of nodes, and the keys of the file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Timeline {
    /// Parents before their children.
    #[doc(hidden)]
    pub nodes: Vec<Node>,
}

/// A node that others may be attached to.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Node {
    /// Number of its parent; `None`: the world.
    pub parent: Option<usize>,
    /// Its pose in its parent, where no track says otherwise.
    pub rest: Rest,
    /// Three numbers, m.
    pub translation: Option<AnimationTrack>,
    /// A quaternion, x, y, z, w.
    pub rotation: Option<AnimationTrack>,
    /// Three factors.
    pub scale: Option<AnimationTrack>,
    /// Above 0.5: it and its descendants are visible.
    pub visible: Option<AnimationTrack>,
}

/// A pose in a parent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Rest {
    /// Parts that tracks may replace.
    Parts {
        /// Position of its origin in the parent, m.
        translation: DVec3,
        /// Unit quaternion, from the scaled node to the parent.
        rotation: DQuat,
        /// Factors along its own x, y and z.
        scale: DVec3,
    },
    /// As a whole, never moving.
    Whole(DAffine3),
}

/// Nodes that belong together, and all their ancestors.
#[derive(Clone, Debug)]
pub struct Branch {
    /// Parents before their children.
    nodes: Vec<usize>,
    /// Indices of their parents in `nodes`.
    parents: Vec<Option<usize>>,
    /// Indices in `nodes` of the requested ones, in their order.
    ends: Vec<usize>,
}

impl Branch {
    fn tracks<'a>(&'a self, timeline: &'a Timeline) -> impl Iterator<Item = &'a AnimationTrack> {
        self.nodes.iter().flat_map(|&node| timeline.nodes[node].tracks())
    }

    /// Whether all of it stays as it is at all times from `from` to `to`, s.
    pub fn stays(&self, timeline: &Timeline, from: f64, to: f64) -> bool {
        self.tracks(timeline).all(|track| track.is_still(from, to))
    }

    /// Adds the times between `from` and `to`, s, at which any of it may bend or jump, in no particular order.
    pub fn bends(&self, timeline: &Timeline, from: f64, to: f64, bends: &mut Vec<f64>) {
        self.tracks(timeline).for_each(|track| track.bends(from, to, bends));
    }

    /// Upper bound on the number of times that [`Branch::bends`] adds.
    pub fn most_bends(&self, timeline: &Timeline, from: f64, to: f64) -> f64 {
        self.tracks(timeline).map(|track| track.most_bends(from, to)).sum()
    }
}

impl Default for Rest {
    fn default() -> Self {
        Rest::Parts { translation: DVec3::ZERO, rotation: DQuat::IDENTITY, scale: DVec3::ONE }
    }
}

impl Node {
    /// Pose in the parent at `time`, s.
    pub fn parent_from_node(&self, time: f64) -> DAffine3 {
        let (translation, rotation, scale) = match self.rest {
            Rest::Whole(place) => return place,
            Rest::Parts { translation, rotation, scale } => (translation, rotation, scale),
        };
        let vector = |track: &Option<AnimationTrack>, rest| {
            track.as_ref().map_or(rest, |track| DVec3::from_array(track.value(time)))
        };
        let rotation = self.rotation.as_ref().map_or(rotation, |track| {
            // Splines leave the unit sphere (glTF 2.0, appendix C.5), and may pass through its centre.
            let turned = DQuat::from_array(track.value(time));
            if turned.length_squared().is_normal() { turned.normalize() } else { rotation }
        });
        DAffine3::from_scale_rotation_translation(
            vector(&self.scale, scale),
            rotation,
            vector(&self.translation, translation),
        )
    }

    fn tracks(&self) -> impl Iterator<Item = &AnimationTrack> {
        [&self.translation, &self.rotation, &self.scale, &self.visible].into_iter().flatten()
    }
}

impl Timeline {
    /// A timeline of one node that stays at `place`.
    #[doc(hidden)]
    pub fn standing(place: DAffine3) -> Timeline {
        Timeline { nodes: vec![Node { rest: Rest::Whole(place), ..Node::default() }] }
    }

    /// A timeline of one node that passes through `keys`, times in s and poses in the world.
    ///
    /// # Errors
    /// No key; a number that is not finite; times that fall; a place that is sheared or squeezed flat.
    #[doc(hidden)]
    pub fn through(keys: &[(f64, DAffine3)]) -> Result<Timeline> {
        if keys.is_empty() {
            return Err(Error::invalid("keys", "none", "at least one"));
        }
        let times: Vec<f64> = keys.iter().map(|(time, _)| *time).collect();
        if let Some(index) = (0..times.len()).find(|&k| !times[k].is_finite() || k > 0 && times[k] < times[k - 1]) {
            return Err(Error::invalid(format!("time of key {index}"), times[index], "finite times that never fall"));
        }
        let (mut places, mut turns, mut scales) = (Vec::new(), Vec::new(), Vec::new());
        for (index, (_, pose)) in keys.iter().enumerate() {
            let (scale, rotation, translation) = pose.to_scale_rotation_translation();
            let again = DAffine3::from_scale_rotation_translation(scale, rotation, translation);
            if !again.abs_diff_eq(*pose, 1e-6 * scale.abs().max_element()) {
                let message = format!("{:?}", pose.matrix3.to_cols_array());
                let allowed = "a rotation and factors along the object's axes, none of them 0";
                return Err(Error::invalid(format!("pose of key {index}"), message, allowed));
            }
            places.extend(translation.to_array());
            turns.extend(rotation.to_array());
            scales.extend(scale.to_array());
        }
        let track = |values: Vec<f64>, turns| {
            let (times, width) = (times.clone(), if turns { 4 } else { 3 });
            let curve = Curve { times, values, width, interpolation: Interpolation::Linear, turns };
            Some(AnimationTrack { curve: Arc::new(curve), period: None })
        };
        let node = Node {
            translation: track(places, false),
            rotation: track(turns, true),
            scale: track(scales, false),
            ..Node::default()
        };
        Ok(Timeline { nodes: vec![node] })
    }

    /// Whether nothing ever moves.
    pub fn is_still(&self) -> bool {
        self.nodes.iter().all(|node| node.tracks().next().is_none())
    }

    /// Time of the last key, s; 0 without any.
    pub fn end(&self) -> f64 {
        self.nodes.iter().flat_map(Node::tracks).map(|track| track.curve.end()).fold(0.0, f64::max)
    }

    /// `node` and its ancestors.
    fn up(&self, node: usize) -> impl Iterator<Item = &Node> {
        std::iter::successors(self.nodes.get(node), |node| self.nodes.get(node.parent?))
    }

    /// Pose of `node` at `time`, s.
    #[doc(hidden)]
    pub fn world_from_node(&self, node: usize, time: f64) -> DAffine3 {
        self.up(node).fold(DAffine3::IDENTITY, |below, node| node.parent_from_node(time) * below)
    }

    /// `ends` and all their ancestors.
    #[doc(hidden)]
    pub fn branch(&self, ends: &[usize]) -> Branch {
        let mut nodes: Vec<usize> = Vec::new();
        for &end in ends {
            let mut next = Some(end);
            while let Some(node) = next
                && let Err(place) = nodes.binary_search(&node)
            {
                nodes.insert(place, node);
                next = self.nodes[node].parent;
            }
        }
        let place = |node: usize| nodes.binary_search(&node).ok();
        let parents = nodes.iter().map(|&node| place(self.nodes[node].parent?)).collect();
        let ends = ends.iter().filter_map(|&end| place(end)).collect();
        Branch { nodes, parents, ends }
    }

    /// Pose of each end of `branch` at `time`, s; ancestors that several of them share are evaluated once.
    pub(crate) fn world_from_ends(&self, branch: &Branch, time: f64) -> impl Iterator<Item = DAffine3> {
        let mut places: Vec<DAffine3> = Vec::with_capacity(branch.nodes.len());
        for (&node, &parent) in branch.nodes.iter().zip(&branch.parents) {
            let place = self.nodes[node].parent_from_node(time);
            places.push(parent.map_or(place, |parent| places[parent] * place));
        }
        branch.ends.iter().map(move |&end| places[end])
    }

    /// Whether `node` is visible at `time`, s.
    #[doc(hidden)]
    pub fn is_visible(&self, node: usize, time: f64) -> bool {
        self.up(node).filter_map(|node| node.visible.as_ref()).all(|track| track.value::<1>(time)[0] > 0.5)
    }

    /// Whether `node` stays as it is at all times from `from` to `to`, s.
    #[doc(hidden)]
    pub fn stays(&self, node: usize, from: f64, to: f64) -> bool {
        self.up(node).flat_map(Node::tracks).all(|track| track.is_still(from, to))
    }

    /// Adds the times between `from` and `to`, s, at which the motion of `node` may bend or jump, in no particular
    /// order.
    #[doc(hidden)]
    pub fn bends(&self, node: usize, from: f64, to: f64, bends: &mut Vec<f64>) {
        self.up(node).flat_map(Node::tracks).for_each(|track| track.bends(from, to, bends));
    }

    /// Upper bound on the number of times that [`Timeline::bends`] adds.
    #[doc(hidden)]
    pub fn most_bends(&self, node: usize, from: f64, to: f64) -> f64 {
        self.up(node).flat_map(Node::tracks).map(|track| track.most_bends(from, to)).sum()
    }

    /// Attaches the nodes of `other` to the first node; returns by how much their numbers have risen.
    #[doc(hidden)]
    pub fn hang(&mut self, other: &Timeline) -> usize {
        let shift = self.nodes.len();
        let hung =
            other.nodes.iter().map(|node| Node { parent: Some(node.parent.map_or(0, |n| n + shift)), ..node.clone() });
        self.nodes.extend(hung);
        shift
    }

    /// Appends the nodes of `other`; returns by how much their numbers have risen.
    #[doc(hidden)]
    pub fn append(&mut self, other: Timeline) -> usize {
        let shift = self.nodes.len();
        self.nodes.extend(
            other.nodes.into_iter().map(|node| Node { parent: node.parent.map(|parent| parent + shift), ..node }),
        );
        shift
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Curve, Interpolation};
    use super::*;
    use std::f64::consts::FRAC_PI_2;

    fn track(times: &[f64], values: &[&[f64]], turns: bool) -> Option<AnimationTrack> {
        let curve = Curve {
            times: times.to_vec(),
            values: values.concat(),
            width: values[0].len(),
            interpolation: if values[0].len() == 1 { Interpolation::Step } else { Interpolation::Linear },
            turns,
        };
        Some(AnimationTrack { curve: Arc::new(curve), period: None })
    }

    /// A wheel on a car that drives and turns.
    #[test]
    fn children_move_with_their_parent() {
        let quarter = DQuat::from_rotation_z(FRAC_PI_2).to_array();
        let car = Node {
            translation: track(&[0.0, 2.0], &[&[0.0; 3], &[20.0, 0.0, 0.0]], false),
            visible: track(&[0.0, 1.5], &[&[1.0], &[0.0]], false),
            ..Node::default()
        };
        let wheel = Node {
            parent: Some(0),
            rest: Rest::Parts { translation: DVec3::Y, rotation: DQuat::IDENTITY, scale: DVec3::splat(2.0) },
            rotation: track(&[0.0, 1.0], &[&[0.0, 0.0, 0.0, 1.0], &quarter], true),
            ..Node::default()
        };
        let timeline = Timeline { nodes: vec![car, wheel] };
        let rim = |time| timeline.world_from_node(1, time).transform_point3(DVec3::X);
        assert!((rim(0.0) - DVec3::new(2.0, 1.0, 0.0)).length() < 1e-12);
        let half = 2.0 * FRAC_PI_2 / 2.0;
        assert!(
            (rim(0.5) - DVec3::new(5.0 + 2.0 * (half / 2.0).cos(), 1.0 + 2.0 * (half / 2.0).sin(), 0.0)).length()
                < 1e-12
        );
        assert!(timeline.is_visible(1, 1.4) && !timeline.is_visible(1, 1.6));
        assert!(timeline.stays(1, 3.0, 4.0) && !timeline.stays(1, 1.2, 1.3) && !timeline.stays(0, 0.2, 0.3));
        let mut bends = Vec::new();
        timeline.bends(1, 0.1, 1.9, &mut bends);
        bends.sort_by(f64::total_cmp);
        assert_eq!(bends, [1.0, 1.5]);
        assert_eq!((timeline.end(), timeline.is_still()), (2.0, false));

        let branch = timeline.branch(&[1, 0, 1]);
        let ends: Vec<_> = timeline.world_from_ends(&branch, 0.7).collect();
        assert_eq!(ends, [1, 0, 1].map(|node| timeline.world_from_node(node, 0.7)));
        assert!(branch.stays(&timeline, 3.0, 4.0) && !branch.stays(&timeline, 1.2, 1.3));

        let place = DAffine3::from_rotation_z(1.0);
        let mut hung = Timeline::standing(place);
        assert_eq!(hung.hang(&timeline), 1);
        assert!(hung.world_from_node(2, 0.7).abs_diff_eq(place * timeline.world_from_node(1, 0.7), 1e-12));

        let mut both = timeline.clone();
        assert_eq!(both.append(timeline.clone()), 2);
        assert_eq!(both.world_from_node(3, 0.7), timeline.world_from_node(1, 0.7));
    }
}
