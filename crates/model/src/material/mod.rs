//! Materials of surfaces, and how much light, sound and radar waves they return.

mod change;
mod decode;
mod file;
pub mod fresnel;
mod infrared;
mod library;
mod optics;
mod radio;
mod reflectance;
mod returned;
mod scattering;
mod sound;
pub mod surface;
pub mod texture;
mod words;

pub use change::Changes;
pub use optics::{Mirrors, Optics};
pub use radio::{Clutter, Dielectric, ItuMaterial, Polarised, Radio, RadioLaw, RadioLayer, RadioSource, RadioSurface};
pub use reflectance::{Reflectance, ReflectanceSample};
pub use returned::Reflectances;
pub use returned::{Returned, Why};
pub use scattering::{RetroSample, Scattering};
pub use sound::{Sediment, Sound};
pub use surface::Alpha;
pub use surface::{ByColor, Material, ReflectanceSource};
pub use texture::{Channel, TextureBudget, linear_from_srgb, srgb_byte};
pub use texture::{Filter, Texture, TextureRef, Wrap};
