//! The hot loops over blocks of beams, compiled for every vector level; the widest that this processor has is chosen
//! once. Everything around them is ordinary code.
//!
//! A kernel does the same operations on every lane and works on plain numbers: it does not depend on sensors, scenes or
//! materials. Results are bit-identical at every level: no operation is fused or reordered.

mod level;

pub mod aim;
pub mod air;
pub mod boundary;
pub mod camera;
pub mod cfar;
pub mod cover;
pub mod echo;
pub mod light;
pub mod math;
pub mod measure;
pub mod radar;
pub mod random;
pub mod rim;
pub mod rows;
pub mod signal;
pub mod skin;
pub mod sound;
pub mod steer;
pub mod tile;
pub mod tree;
pub mod water;

pub use level::{Level, NoLevel, VARIABLE, chosen_level, level, limit_level};

/// Lanes of a block. All columns of a block together fit in the first-level cache.
pub const LANES: usize = 256;

/// Surface index of a ray that hit nothing.
pub const MISS: u32 = u32::MAX;

/// A number for each lane.
pub type Lanes<T = f32> = [T; LANES];
