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
#[cfg(test)]
mod file_tests;
mod identity;
pub mod label;
pub mod load;
mod material_rules;
mod merge;
mod object;
mod pattern;
mod sequence;

pub use caches::CacheFile;
pub use ground::array::Array;
pub use label::InstanceRule;
pub use label::LabelRules;
pub use load::FORMATS;
pub use load::{LoadOptions, Scene};
pub use material_rules::{MaterialRule, MaterialRules};
pub use model::material::surface::Material;
pub use model::material::texture::{Filter, Texture, TextureRef, Wrap};
pub use model::{
    Ancestor, Camera, CornerMesh, Labels, MOST_ANCESTORS, Mesh, NameTable, Part, PrimitiveShape, Quadric, UpAxis,
};
pub use object::Object;
pub use pattern::matches;
pub use robots::GeometryUse;
pub use scene_files::SceneFormat;
pub use sequence::Sequence;
