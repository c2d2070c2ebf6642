//! Materials of surfaces, and how much light and sound they return.

#[doc(inline)]
pub use model::material::{
    Alpha, Changes, Reflectance, ReflectanceSample, RetroSample, Returned, Scattering, Sediment, Sound, Why,
};
