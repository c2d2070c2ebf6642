//! What is in the air: how much it dims a beam and how much it sends back. Weather is a medium, not a filter. And the
//! water, which sound goes through.

mod droplets;
mod dust;
mod environment;
mod particles;
mod rain;
mod region;
mod visibility;
mod water;
mod weather;

pub use droplets::{Fog, Spectrum, Spray};
pub use dust::Dust;
pub use environment::Environment;
pub(crate) use particles::Particles;
pub use rain::{PerLength, Rain, RainModel, Snow, SnowModel};
pub(crate) use region::Extent;
pub use region::{Placed, Region};
pub use visibility::{ClearAir, VisibilityModel};
pub use water::{
    Absorption, AmbientNoise, Fluid, Layer, Outside, RayEvent, RayPoint, Sea, SoundRay, SoundSpeed, SoundSpeedProfile,
    SpeedRow, Spreading, Water, WaterRow, pressure_bar, unesco_speed,
};
pub(crate) use water::{Column, End, Ray, Slab, slab_at, small_sin_cos};
pub(crate) use weather::{Medium, Weather};
