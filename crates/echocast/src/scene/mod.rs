//! A resolved scene: the contents of the files, with references resolved.
//!
//! What [`Scene`] guarantees to its users:
//! * z is up, lengths are metres, the frame is right-handed;
//! * world positions are `f64`; mesh vertices are `f32` in the mesh's own frame;
//! * every index is in range, every vertex finite, no triangle degenerate, except in objects whose shape changes over
//!   time;
//! * a mesh that many objects use is stored once;
//! * every object and part carries label numbers, and [`Labels`] names them.

mod caches;
mod camera;
mod identity;
pub(crate) mod label;
pub(crate) mod load;
mod material_rules;
mod merge;
mod object;
mod pattern;
mod sequence;

pub use crate::ground::array::Array;
pub use crate::material::surface::Material;
pub use crate::material::texture::{Filter, Texture, TextureRef, Wrap};
pub use crate::model::{Ancestor, Camera, Labels, MOST_ANCESTORS, Mesh, NameTable, Part, UpAxis};
pub use crate::scene_files::{FORMATS, SceneFormat};
pub use caches::CacheFile;
pub use label::InstanceRule;
pub(crate) use label::LabelRules;
pub(crate) use load::{LoadOptions, Scene};
pub use material_rules::{MaterialRule, MaterialRules};
pub use object::Object;
pub(crate) use pattern::matches;
pub use sequence::Sequence;
