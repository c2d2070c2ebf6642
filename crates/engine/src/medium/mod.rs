//! What is between a sensor and the surfaces: air with its weather, for light and radar waves, and water, for sound.

mod air;
pub mod environment;
mod radio_air;
mod water;
mod weather;

pub use air::Precipitation;
pub use air::{
    ClearAir, Dust, Fog, PerLength, Placed, Rain, RainModel, Region, Snow, SnowModel, Spectrum, Spray, VisibilityModel,
};
pub(crate) use air::{Extent, Particles};
pub use environment::Environment;
pub use radio_air::{RadioAir, RadioMedium, wet_radome_db};
pub use water::{
    Absorption, AmbientNoise, Fluid, Layer, Outside, RayEvent, RayPoint, Sea, SoundRay, SoundSpeed, SoundSpeedProfile,
    SpeedRow, Spreading, Water, WaterRow, pressure_bar, unesco_speed,
};
pub(crate) use water::{End, RefractedRay, Slab, WaterColumn, slab_at};
pub(crate) use weather::{Medium, Weather};
