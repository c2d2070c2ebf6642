//! What is between a sensor and the surfaces: air with its weather, for light, and water, for sound.

#[doc(inline)]
pub use engine::medium::{
    Absorption, AmbientNoise, ClearAir, Dust, Fluid, Fog, Layer, Outside, PerLength, Placed, Rain, RainModel, RayEvent,
    RayPoint, Region, Sea, Snow, SnowModel, SoundRay, SoundSpeed, SoundSpeedProfile, Spectrum, SpeedRow, Spray,
    Spreading, VisibilityModel, Water, WaterRow, pressure_bar, unesco_speed,
};
