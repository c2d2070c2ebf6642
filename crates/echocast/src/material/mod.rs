//! Materials of surfaces, and how much light and sound they return.

mod change;
mod decode;
mod file;
pub(crate) mod fresnel;
mod infrared;
mod library;
mod optics;
mod reflectance;
mod returned;
mod scattering;
mod sound;
pub(crate) mod surface;
pub(crate) mod texture;
mod words;

pub use change::Changes;
pub(crate) use optics::{Mirrors, Optics};
pub use reflectance::{Reflectance, ReflectanceSample};
pub(crate) use returned::Reflectances;
pub use returned::{Returned, Why};
pub use scattering::{RetroSample, Scattering};
pub use sound::{Sediment, Sound};
pub use surface::Alpha;
pub(crate) use surface::{ByColor, Material, ReflectanceSource};
pub(crate) use texture::{Channel, TextureBudget, linear_from_srgb, srgb_byte};
pub(crate) use texture::{Filter, Texture, TextureRef, Wrap};
