//! Materials that change over time.

use super::{Material, Reflectance};
use crate::motion::{AnimationTrack, Curve, Interpolation};
use std::sync::Arc;

/// How a material changes over time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Changes {
    /// Linear red, green, blue and alpha.
    #[doc(hidden)]
    pub base_color: Option<AnimationTrack>,
    /// Metallic factor, 0..1.
    #[doc(hidden)]
    pub metallic: Option<AnimationTrack>,
    /// Roughness factor, 0..1.
    #[doc(hidden)]
    pub roughness: Option<AnimationTrack>,
    /// The same at every wavelength.
    #[doc(hidden)]
    pub reflectance: Option<AnimationTrack>,
}

impl Changes {
    fn tracks(&self) -> impl Iterator<Item = &AnimationTrack> {
        [&self.base_color, &self.metallic, &self.roughness, &self.reflectance].into_iter().flatten()
    }
}

impl Material {
    /// The material at `time`, s; `None`: it never changes. Values that leave 0..1 between keys are clamped.
    pub fn at(&self, time: f64) -> Option<Material> {
        let changes = self.changes.as_ref()?;
        let mut now = Material { changes: None, ..self.clone() };
        let factor = |track: &Option<AnimationTrack>, rest: f32| {
            track.as_ref().map_or(rest, |track| track.value::<1>(time)[0].clamp(0.0, 1.0) as f32)
        };
        if let Some(track) = &changes.base_color {
            now.base_color = track.value::<4>(time).map(|channel| channel.clamp(0.0, 1.0) as f32);
        }
        now.metallic = factor(&changes.metallic, self.metallic);
        now.roughness = factor(&changes.roughness, self.roughness);
        if changes.reflectance.is_some() {
            now.reflectance = Some(Reflectance::Constant(factor(&changes.reflectance, 0.0)));
        }
        Some(now)
    }

    /// Sets how the material changes over time, if it does, and gives it the values of time 0.
    #[doc(hidden)]
    pub fn set_changes(&mut self, changes: Changes) {
        let changing = changes.tracks().any(|track| !track.is_still(f64::NEG_INFINITY, f64::INFINITY));
        self.changes = Some(Arc::new(changes));
        if let Some(now) = self.at(0.0) {
            *self = Material { changes: self.changes.take().filter(|_| changing), ..now };
        }
    }

    /// The reflectance at the time when it is greatest; splines are evaluated at their keys only.
    #[doc(hidden)]
    pub fn greatest_reflectance(&self) -> Option<Reflectance> {
        let Some(track) = self.changes.as_ref().and_then(|changes| changes.reflectance.as_ref()) else {
            return self.reflectance.clone();
        };
        let at_keys = track.curve.times.iter().map(|&time| {
            let mut value = [0.0];
            track.curve.at(time, &mut value);
            value[0] as f32
        });
        Some(Reflectance::Constant(at_keys.fold(0.0, f32::max)))
    }

    /// Multiplies the base colour, at all times.
    #[doc(hidden)]
    pub fn tint(&mut self, color: [f32; 4]) {
        for (channel, factor) in self.base_color.iter_mut().zip(color) {
            *channel *= factor;
        }
        let Some(changes) = &mut self.changes else { return };
        let Changes { base_color: Some(track), .. } = Arc::make_mut(changes) else { return };
        let Curve { values, .. } = Arc::make_mut(&mut track.curve);
        for (value, factor) in values.iter_mut().zip(color.into_iter().cycle()) {
            *value *= f64::from(factor);
        }
    }
}

/// A reflectance of `value` at each `time`, linear in between; times must not decrease.
pub(super) fn reflectance(keys: impl Iterator<Item = [f64; 2]>) -> Changes {
    let (times, values) = keys.map(|[time, value]| (time, value)).unzip();
    let curve = Curve { times, values, width: 1, interpolation: Interpolation::Linear, turns: false };
    Changes { reflectance: Some(AnimationTrack { curve: Arc::new(curve), period: None }), ..Changes::default() }
}
