//! What is in the air: how much it attenuates light and radar waves and how much it returns. Weather is a medium, not a filter.

mod droplets;
mod dust;
pub(in crate::medium) mod gases;
mod mie;
mod particles;
pub(in crate::medium) mod radio;
mod rain;
mod region;
mod visibility;

pub use droplets::{Fog, Spectrum, Spray};
pub use dust::Dust;
pub(crate) use particles::Particles;
pub use radio::Precipitation;
pub use rain::{PerLength, Rain, RainModel, Snow, SnowModel};
pub(crate) use region::Extent;
pub use region::{Placed, Region};
pub use visibility::{ClearAir, VisibilityModel};
