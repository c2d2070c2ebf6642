//! The reflectance of a surface by wavelength.

use serde::Deserialize;
use serde::de::{self, Deserializer, SeqAccess, Visitor};
use std::fmt;

/// Hemispherical reflectance of a surface.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Reflectance {
    /// The same at every wavelength, 0..1.
    Constant(f32),
    /// Measured at some wavelengths, rising; 0 if empty.
    Samples(Vec<ReflectanceSample>),
}

/// Reflectance at one wavelength.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReflectanceSample {
    /// Wavelength, nm.
    pub wavelength_nm: f64,
    /// Hemispherical reflectance, 0..1.
    pub value: f64,
}

impl Reflectance {
    /// Reflectance at `wavelength_nm`, 0..1: linear between samples, constant outside them.
    pub fn at(&self, wavelength_nm: f64) -> f32 {
        let samples = match self {
            Reflectance::Constant(value) => return *value,
            Reflectance::Samples(samples) => samples,
        };
        let (below, above) = samples.split_at(samples.partition_point(|sample| sample.wavelength_nm < wavelength_nm));
        let value = match (below.last(), above.first()) {
            (Some(low), Some(high)) => {
                let t = (wavelength_nm - low.wavelength_nm) / (high.wavelength_nm - low.wavelength_nm);
                low.value + (high.value - low.value) * t
            }
            (Some(only), None) | (None, Some(only)) => only.value,
            (None, None) => 0.0,
        };
        value as f32
    }

    /// With every value replaced by what `changed` makes of it.
    #[doc(hidden)]
    pub fn map(&self, changed: impl Fn(f32) -> f32) -> Reflectance {
        let sample =
            |sample: &ReflectanceSample| ReflectanceSample { value: changed(sample.value as f32).into(), ..*sample };
        match self {
            Reflectance::Constant(value) => Reflectance::Constant(changed(*value)),
            Reflectance::Samples(samples) => Reflectance::Samples(samples.iter().map(sample).collect()),
        }
    }

    /// The greatest reflectance at any wavelength.
    pub(super) fn greatest(&self) -> f32 {
        match self {
            Reflectance::Constant(value) => *value,
            Reflectance::Samples(samples) => samples.iter().map(|sample| sample.value as f32).fold(0.0, f32::max),
        }
    }
}

impl<'de> Deserialize<'de> for Reflectance {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct NumberOrSamples;

        impl<'de> Visitor<'de> for NumberOrSamples {
            type Value = Reflectance;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("a number or a list of {wavelength_nm, value}")
            }
            fn visit_i64<E>(self, value: i64) -> Result<Reflectance, E> {
                Ok(Reflectance::Constant(value as f32))
            }
            fn visit_u64<E>(self, value: u64) -> Result<Reflectance, E> {
                Ok(Reflectance::Constant(value as f32))
            }
            fn visit_f64<E>(self, value: f64) -> Result<Reflectance, E> {
                Ok(Reflectance::Constant(value as f32))
            }
            fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<Reflectance, A::Error> {
                let samples = Deserialize::deserialize(de::value::SeqAccessDeserializer::new(seq))?;
                Ok(Reflectance::Samples(samples))
            }
        }
        deserializer.deserialize_any(NumberOrSamples)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reflectance_is_linear_between_samples() {
        let sample = |wavelength_nm, value| ReflectanceSample { wavelength_nm, value };
        let samples = Reflectance::Samples(vec![sample(800.0, 0.2), sample(1000.0, 0.6)]);
        assert_eq!([500.0, 800.0, 900.0, 1000.0, 1550.0].map(|nm| samples.at(nm)), [0.2, 0.2, 0.4, 0.6, 0.6]);
        assert_eq!(Reflectance::Samples(vec![sample(905.0, 0.3)]).at(1550.0), 0.3);
        assert_eq!(Reflectance::Samples(vec![]).at(905.0), 0.0);
        assert_eq!(Reflectance::Constant(0.7).at(905.0), 0.7);
    }
}
