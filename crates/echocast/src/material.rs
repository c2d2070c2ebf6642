//! Materials of surfaces, and how much light, sound and radar waves they return.

#[doc(inline)]
pub use model::material::{
    Alpha, Changes, Clutter, Dielectric, ItuMaterial, Polarised, Radio, RadioLaw, RadioLayer, RadioSurface,
    Reflectance, ReflectanceSample, RetroSample, Returned, Scattering, Sediment, Sound, Why,
};
