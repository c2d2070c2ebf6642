//! What the black-box tests share: a slow, plain tracer in f64 that the library is compared with, and what makes
//! scenes, sensors and tables of expected values for them.

mod moving;
mod random;
mod scenes;
mod sensors;
mod table;
mod tracer;

pub use moving::{Actor, Change, Keys, Moving, Posed, Track, mdd, pc2};
pub use random::{Random, philox};
pub use scenes::{SceneBuilder, Shape};
pub use sensors::{beams, one_beam, raster, sensor};
pub use table::Table;
pub use tracer::{Answer, Hit, Surface, Tracer};
