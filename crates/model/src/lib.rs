//! What readers of scene files produce: meshes, and objects and cameras as the file places them.
#![forbid(unsafe_code)]

mod corners;
mod labels;
pub mod material;
mod mesh;
pub mod motion;
mod pose;
mod primitive;
mod quadric;

pub use corners::CornerMesh;
pub use labels::{Labels, NameTable};
pub use mesh::{Mesh, Part, Structure, VertexSource, beyond_reach, is_degenerate, normals_are_flat, share_vertices};
pub use pose::pose;
pub use primitive::PrimitiveShape;
pub use quadric::Quadric;

use crate::material::Material;
use crate::motion::{Motion, Timeline};
use glam::{DAffine3, DMat3, DVec3};
use ground::error::{Error, Result};
use ground::named;
use ground::pose::Pose;
use ground::report::Report;
use serde::Deserialize;
use std::sync::Arc;

/// Largest magnitude of an accepted coordinate, in files and in the world: well inside `f32`, so that no later step
/// overflows.
pub const LARGEST: f64 = 1e18;

/// The file name extensions of scenes, lower case, without the dot.
pub const ENDINGS: &[&str] = &["glb", "gltf", "obj", "ply", "stl", "fbx", "dae", "urdf", "sdf", "world", "xml", "mjcf"];

/// Which axis of a file points up, for formats that do not specify it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum UpAxis {
    /// The file is y up: (x, y, z) becomes (x, -z, y).
    Y,
    /// The file is z up, as echocast is.
    #[default]
    Z,
    /// The file is x up: (x, y, z) becomes (-z, y, x).
    X,
    /// The file's x points down: (x, y, z) becomes (z, y, -x).
    #[serde(rename = "-x")]
    MinusX,
    /// The file's y points down: (x, y, z) becomes (x, z, -y).
    #[serde(rename = "-y")]
    MinusY,
    /// The file's z points down: (x, y, z) becomes (x, -y, -z).
    #[serde(rename = "-z")]
    MinusZ,
}

named! { UpAxis: Y "y", Z "z", X "x", MinusX "-x", MinusY "-y", MinusZ "-z" }

impl UpAxis {
    /// Turns the file so that z is up.
    #[doc(hidden)]
    pub fn world_from_file(self) -> DMat3 {
        let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
        match self {
            UpAxis::Y => DMat3::from_cols(x, z, -y),
            UpAxis::Z => DMat3::IDENTITY,
            UpAxis::X => DMat3::from_cols(z, y, -x),
            UpAxis::MinusX => DMat3::from_cols(-z, y, x),
            UpAxis::MinusY => DMat3::from_cols(x, -z, y),
            UpAxis::MinusZ => DMat3::from_cols(x, -y, -z),
        }
    }

    /// Orientation of an object whose mesh has this axis up and was rotated by `turned`: z is up in it.
    #[doc(hidden)]
    pub fn upright(self, turned: &DMat3) -> DMat3 {
        let DMat3 { x_axis: x, y_axis: y, z_axis: z } = *turned;
        match self {
            UpAxis::Y => DMat3::from_cols(x, -z, y),
            UpAxis::Z => *turned,
            UpAxis::X => DMat3::from_cols(-z, y, x),
            UpAxis::MinusX => DMat3::from_cols(z, y, -x),
            UpAxis::MinusY => DMat3::from_cols(x, z, -y),
            UpAxis::MinusZ => DMat3::from_cols(x, -y, -z),
        }
    }
}

/// A node of a file.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Ancestor {
    /// Its number in the file.
    pub node: u32,
    /// Its name; empty without one.
    pub name: Arc<str>,
    /// The category that it gives to its descendants, if it does.
    pub category: Option<Arc<str>>,
    /// Whether it only groups other things: it has no mesh and no category, and either is at the origin of its parent,
    /// or holds very many things, instances of a mesh, or another group.
    pub is_group: bool,
}

impl Ancestor {
    /// A node as a reader finds it.
    pub fn new(node: u32, name: &str, category: Option<&str>, is_group: bool) -> Ancestor {
        Ancestor { node, name: name.into(), category: category.map(Arc::from), is_group }
    }
}

/// Most ancestors recorded for an object.
pub const MOST_ANCESTORS: usize = 32;

/// A camera node of the scene file.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// Name of the node.
    pub name: String,
    /// Sensor pose at the camera at time 0: x = the view direction, z = the camera's up.
    pub pose: Pose,
    /// Its node of the timeline; `None`: it never moves.
    #[doc(hidden)]
    pub node: Option<usize>,
}

impl Camera {
    /// The first of `cameras` called `name`.
    ///
    /// # Errors
    /// [`Error::Missing`] with similar names.
    #[doc(hidden)]
    pub fn find<'a>(cameras: &'a [Camera], name: &str) -> Result<&'a Camera> {
        let found = cameras.iter().find(|camera| camera.name == name);
        found.ok_or_else(|| Error::missing("camera node", name, cameras.iter().map(|camera| &camera.name)))
    }
}

/// An object as a reader found it, before its labels have numbers.
pub struct RawObject {
    /// Name in the file.
    pub name: String,
    /// Its shape.
    pub mesh: Arc<Mesh>,
    /// Placement, metres.
    pub world_from_object: DAffine3,
    /// As in `Object::up`.
    pub up: UpAxis,
    /// `categoryID` of the node or its nearest ancestor.
    pub category: Option<String>,
    /// `partID` of the node or its nearest ancestor.
    pub part: Option<String>,
    /// How it follows the timeline.
    pub motion: Option<Motion>,
    /// As in `Object::ancestors`.
    pub ancestors: Arc<[Ancestor]>,
    /// Whether the last of them is its own node.
    pub has_node: bool,
}

/// A scene as a reader found it, before its labels have numbers.
#[derive(Default)]
pub struct RawScene {
    /// In the order of the file.
    pub objects: Vec<RawObject>,
    /// All materials, whether used by a part or not.
    pub materials: Vec<Arc<Material>>,
    /// Places for a sensor.
    pub cameras: Vec<Camera>,
    /// What moves.
    pub timeline: Timeline,
    /// Names of the animations, played or not.
    pub animations: Vec<String>,
    /// Time of the last key of each animation, s.
    pub animation_lengths: Vec<f64>,
    /// Names of the joints that take one position.
    pub joints: Vec<String>,
    /// Triangles without area that were left out.
    pub degenerate_triangles: usize,
    /// Warnings of the reader.
    pub report: Report,
}

/// Whether no coordinate is beyond [`LARGEST`].
pub fn within_reach(point: &DVec3) -> bool {
    // A comparison that NaN fails too.
    point.abs().max_element() <= LARGEST && point.is_finite()
}

/// The corners of the box `bounds` of a mesh in the world; the first and the last are opposite.
pub fn corners(bounds: [[f32; 3]; 2], world_from_object: &DAffine3) -> [DVec3; 8] {
    std::array::from_fn(|corner| {
        let local = DVec3::from_array(std::array::from_fn(|axis| f64::from(bounds[corner >> axis & 1][axis])));
        world_from_object.transform_point3(local)
    })
}

/// Lowest and highest corner of the box around `points`; `None` without any.
pub fn surrounding(points: impl Iterator<Item = DVec3>) -> Option<(DVec3, DVec3)> {
    points.map(|p| (p, p)).reduce(|(low, high), (p, _)| (low.min(p), high.max(p)))
}
