//! How surfaces reflect, transmit and scatter the waves of radars.

mod dielectric;
mod itu;
mod law;
mod stack;
mod surface;

pub use dielectric::Dielectric;
pub use itu::ItuMaterial;
pub use law::{Radio, RadioLaw, RadioLayer, RadioSource};
pub use surface::{Clutter, Polarised, RadioSurface};
