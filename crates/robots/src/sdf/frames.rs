//! The frames of SDF, by the semantics of its poses (<http://sdformat.org/tutorials?tut=pose_frame_semantics>): every
//! model, link, joint and frame has a pose relative to another, named or implied.

use glam::DAffine3;
use ground::error::{Error, Result};
use ground::read::xml::Xml;
use ground::shown;
use std::collections::HashMap;
use std::path::PathBuf;

/// A frame that another is relative to.
#[derive(Clone, Debug)]
pub(super) enum FrameRef {
    /// By its index.
    Known(usize),
    /// By its name in a scope, from a place in a file.
    Named { scope: usize, name: String, place: FilePlace },
}

/// Where something is in a file.
#[derive(Clone, Debug)]
pub(super) struct FilePlace {
    path: PathBuf,
    line: u32,
}

impl FilePlace {
    /// That of an element.
    pub fn of(element: Xml<'_>) -> FilePlace {
        FilePlace { path: element.path().to_owned(), line: element.line() }
    }

    /// An error there.
    pub fn error(&self, message: impl Into<String>) -> Error {
        Error::parse(&self.path, format!("line {}", self.line), message)
    }
}

/// What a name stands for.
#[derive(Clone, Debug)]
pub(super) enum NamedThing {
    /// A link, by its index.
    Link(usize),
    /// A joint, which moves with its child.
    Joint { child: FrameRef },
    /// A frame, which moves with what it is attached to.
    Frame { attached: FrameRef },
    /// A model, by its scope; `canonical`: the link that stands for it.
    Model { scope: usize, canonical: Option<FrameRef> },
}

/// A frame with a pose relative to another.
#[derive(Clone, Debug)]
pub(super) struct SdfFrame {
    /// `None`: the world.
    pub relative_to: Option<FrameRef>,
    /// Its pose there.
    pub pose: DAffine3,
    /// Instead of the frame itself, the pose is that of this one in it.
    pub placement: Option<FrameRef>,
    /// What it is the frame of; `None`: the world.
    pub thing: Option<NamedThing>,
}

/// The frames of a world; scopes are models, in which names are unique.
#[derive(Default)]
pub(super) struct SdfFrames {
    all: Vec<SdfFrame>,
    /// For each scope its own frame, and those with names in it.
    scopes: Vec<(usize, HashMap<String, usize>)>,
    /// World poses so far; `Some(None)` while one is computed.
    known: Vec<Option<Option<DAffine3>>>,
}

impl SdfFrames {
    /// Adds a frame; returns its index.
    pub fn add(&mut self, frame: SdfFrame) -> usize {
        self.all.push(frame);
        self.all.len() - 1
    }

    /// Says what a frame is of, and which frame in it its pose places.
    pub fn set(&mut self, frame: usize, placement: Option<FrameRef>, thing: NamedThing) {
        (self.all[frame].placement, self.all[frame].thing) = (placement, Some(thing));
    }

    /// Adds a scope with its own frame; returns its index.
    pub fn add_scope(&mut self, own: usize) -> usize {
        self.scopes.push((own, HashMap::new()));
        self.scopes.len() - 1
    }

    /// Gives a frame a name in a scope.
    ///
    /// # Errors
    /// Another has it.
    pub fn name(&mut self, scope: usize, name: &str, frame: usize, element: Xml<'_>) -> Result<()> {
        match self.scopes[scope].1.insert(name.to_owned(), frame) {
            None => Ok(()),
            Some(_) => Err(element
                .error("has the name of another link, joint, frame or model beside it; allowed: names that differ")),
        }
    }

    /// The index of a frame.
    ///
    /// # Errors
    /// A name that there is not.
    pub fn find(&self, reference: &FrameRef) -> Result<usize> {
        let (scope, name, place) = match reference {
            FrameRef::Known(frame) => return Ok(*frame),
            FrameRef::Named { scope, name, place } => (*scope, name.as_str(), place),
        };
        match name {
            "__model__" => return Ok(self.scopes[scope].0),
            // The first frame.
            "world" | "__root__" => return Ok(0),
            _ => {}
        }
        let mut inner = scope;
        let mut steps = name.split("::").peekable();
        while let Some(step) = steps.next() {
            if step == "__model__" {
                return Ok(self.scopes[inner].0);
            }
            let Some(&frame) = self.scopes[inner].1.get(step) else { break };
            match (&self.all[frame].thing, steps.peek()) {
                (_, None) => return Ok(frame),
                (Some(NamedThing::Model { scope, .. }), _) => inner = *scope,
                _ => break,
            }
        }
        let near = ground::error::nearest(name, self.scopes[scope].1.keys());
        let near = if near.is_empty() { String::new() } else { format!("; near: {}", near.join(", ")) };
        Err(place.error(format!(
            "there is no frame {:?}; allowed: links, joints, frames and models of the same model{near}",
            shown::name(name)
        )))
    }

    /// The link that a frame moves with; `None`: the world.
    ///
    /// # Errors
    /// A name that there is not; frames that are attached in a circle.
    pub fn link_of(&self, reference: &FrameRef) -> Result<Option<usize>> {
        let mut next = reference.clone();
        for _ in 0..=self.all.len() {
            next = match &self.all[self.find(&next)?].thing {
                None => return Ok(None),
                Some(NamedThing::Link(link)) => return Ok(Some(*link)),
                Some(NamedThing::Joint { child }) => child.clone(),
                Some(NamedThing::Frame { attached }) => attached.clone(),
                Some(NamedThing::Model { canonical: Some(link), .. }) => link.clone(),
                Some(NamedThing::Model { canonical: None, .. }) => return Ok(None),
            };
        }
        Err(self.circle(reference))
    }

    /// The world pose of a frame.
    ///
    /// # Errors
    /// A name that there is not; frames that are relative to each other in a circle.
    pub fn pose(&mut self, reference: &FrameRef) -> Result<DAffine3> {
        self.known.resize(self.all.len(), None);
        let target = self.find(reference)?;
        // Without recursion: hierarchies may be deep.
        let mut open = vec![target];
        while let Some(&frame) = open.last() {
            if let Some(Some(_)) = self.known[frame] {
                open.pop();
                continue;
            }
            let SdfFrame { relative_to, pose, placement, .. } = self.all[frame].clone();
            let base = match &relative_to {
                None => DAffine3::IDENTITY,
                Some(base) => {
                    let base = self.find(base)?;
                    match self.known[base] {
                        Some(Some(pose)) => pose,
                        // It is being computed already.
                        Some(None) => return Err(self.circle(reference)),
                        None if base == frame => return Err(self.circle(reference)),
                        None => {
                            self.known[frame] = Some(None);
                            open.push(base);
                            continue;
                        }
                    }
                }
            };
            let own = match &placement {
                None => pose,
                // world_from_model model_from_placement = base pose.
                Some(placed) => pose * self.pose_within(placed, frame)?.inverse(),
            };
            self.known[frame] = Some(Some(base * own));
            open.pop();
        }
        Ok(self.known[target].flatten().unwrap_or(DAffine3::IDENTITY))
    }

    /// The pose of a frame of a model in that model, whose own frame is `model`.
    fn pose_within(&self, reference: &FrameRef, model: usize) -> Result<DAffine3> {
        let mut frame = self.find(reference)?;
        let mut pose = DAffine3::IDENTITY;
        for _ in 0..=self.all.len() {
            if frame == model {
                return Ok(pose);
            }
            let SdfFrame { relative_to, pose: own, placement, .. } = &self.all[frame];
            let own = match placement {
                None => *own,
                Some(placed) => *own * self.pose_within(placed, frame)?.inverse(),
            };
            pose = own * pose;
            match relative_to {
                Some(base) => frame = self.find(base)?,
                None => break,
            }
        }
        Err(self.circle(reference))
    }

    fn circle(&self, reference: &FrameRef) -> Error {
        let message =
            "a pose is relative to itself by a circle of frames; allowed: relative_to and attached_to without circles";
        match reference {
            FrameRef::Named { place, .. } => place.error(message),
            FrameRef::Known(_) => Error::invalid("relative_to", "a circle of frames", "frames without circles"),
        }
    }
}
