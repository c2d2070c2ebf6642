//! A resolved scene: the contents of the files, with references resolved.
//!
//! What [`Scene`](crate::Scene) guarantees to its users:
//! * z is up, lengths are metres, the frame is right-handed;
//! * world positions are `f64`; mesh vertices are `f32` in the mesh's own frame;
//! * every index is in range, every vertex finite, no triangle degenerate, except in objects whose shape changes over
//!   time;
//! * a mesh that many objects use is stored once;
//! * every object and part carries label numbers, and [`Labels`] names them.

#[doc(inline)]
pub use engine::scene::{
    Ancestor, Array, CacheFile, Camera, CornerMesh, FORMATS, Filter, GeometryUse, InstanceRule, Labels, MOST_ANCESTORS,
    Material, MaterialRule, MaterialRules, Mesh, NameTable, Object, Part, PrimitiveShape, Quadric, SceneFormat,
    Sequence, Texture, TextureRef, UpAxis, Wrap,
};
