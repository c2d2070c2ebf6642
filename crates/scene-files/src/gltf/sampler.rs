//! Samplers: accessors of times and values to curves (glTF 2.0, 3.11 and appendix C).

use super::accessor::Accessors;
use gltf::json::Index;
use model::motion::{AnimationTrack, Curve, Interpolation};
use serde::Deserialize;
use std::collections::HashMap;
use std::sync::Arc;

/// A sampler as in the file. The `gltf` crate reads core glTF only; extensions add to it, so animations are read here.
#[derive(Deserialize)]
pub(super) struct Sampler {
    /// Accessor of the times.
    input: u32,
    /// Accessor of the values.
    output: u32,
    interpolation: Option<String>,
}

/// The kind of quantity that a sampler provides.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct Quantity {
    /// Numbers in an element of the accessor of values: 1, 3 or 4.
    pub element: usize,
    /// Elements in a value: one, or as many as there are morph targets.
    pub elements: usize,
    /// Whether it is a rotation.
    pub turns: bool,
    /// Whether it can only jump.
    pub jumps: bool,
    /// Whether it must be within 0 to 1.
    pub fraction: bool,
}

impl Quantity {
    pub fn of(element: usize) -> Quantity {
        Quantity { element, elements: 1, turns: false, jumps: false, fraction: false }
    }
}

/// A curve, and whether it is constant.
#[derive(Clone)]
pub(super) struct SampledCurve {
    pub curve: Arc<Curve>,
    pub still: bool,
}

/// Reads the samplers of a file; shared accessors are decoded once.
pub(super) struct Samplers<'a> {
    accessors: &'a Accessors<'a>,
    times: HashMap<u32, Arc<Vec<f64>>>,
    curves: HashMap<(u32, u32, Interpolation, Quantity), SampledCurve>,
}

impl<'a> Samplers<'a> {
    pub fn new(accessors: &'a Accessors<'a>) -> Self {
        Samplers { accessors, times: HashMap::new(), curves: HashMap::new() }
    }

    /// Time of the last key, s.
    pub fn end(&mut self, sampler: &Sampler) -> Result<f64, String> {
        Ok(self.times(sampler.input)?.last().copied().unwrap_or(0.0))
    }

    /// The curve of a quantity by `sampler`.
    pub fn keys(&mut self, sampler: &Sampler, quantity: Quantity) -> Result<SampledCurve, String> {
        let interpolation = match sampler.interpolation.as_deref() {
            None | Some("LINEAR") => Interpolation::Linear,
            Some("STEP") => Interpolation::Step,
            Some("CUBICSPLINE") => Interpolation::Cubic,
            Some(other) => {
                let found = ground::shown::name(other);
                return Err(format!("its interpolation is {found:?}; allowed: LINEAR, STEP, CUBICSPLINE"));
            }
        };
        if quantity.jumps && interpolation != Interpolation::Step {
            return Err("a boolean is interpolated; allowed: STEP".into());
        }
        let key = (sampler.input, sampler.output, interpolation, quantity);
        if let Some(known) = self.curves.get(&key) {
            return Ok(known.clone());
        }
        let times = self.times(sampler.input)?;
        let cubic = interpolation == Interpolation::Cubic;
        if cubic && times.len() < 2 {
            return Err("a CUBICSPLINE with one key; allowed: two and more".into());
        }
        let values = self.values(sampler.output, times.len(), quantity, cubic)?;
        let width = quantity.element * quantity.elements;
        self.accessors.charge(times.len() * size_of::<f64>()).map_err(|message| format!("its curve {message}"))?;
        let times = times.to_vec();
        let curve = Arc::new(Curve { times, values, width, interpolation, turns: quantity.turns });
        let still = AnimationTrack { curve: curve.clone(), period: None }.is_still(f64::NEG_INFINITY, f64::INFINITY);
        let keys = SampledCurve { curve, still };
        self.curves.insert(key, keys.clone());
        Ok(keys)
    }

    /// Ascending times, at least one.
    fn times(&mut self, input: u32) -> Result<Arc<Vec<f64>>, String> {
        if let Some(known) = self.times.get(&input) {
            return Ok(known.clone());
        }
        let fault = |message: String| format!("input: {message}");
        let read = self.accessors.vectors::<1>(Index::new(input)).map_err(fault)?;
        self.accessors.charge(read.len() * size_of::<f64>()).map_err(fault)?;
        let times: Vec<f64> = read.into_iter().map(|[time]| f64::from(time)).collect();
        if times.is_empty() {
            return Err(fault("it has no key; allowed: one and more".into()));
        }
        // NaN fails this comparison too.
        if let Some(bad) = times.iter().position(|time| !(0.0..=f64::from(f32::MAX)).contains(time)) {
            return Err(fault(format!("key {bad} is at {} s; allowed: 0 and more", times[bad])));
        }
        if let Some(bad) = times.windows(2).position(|pair| pair[0] >= pair[1]) {
            let (before, time) = (times[bad], times[bad + 1]);
            return Err(fault(format!("key {} at {time} s follows one at {before} s; allowed: rising times", bad + 1)));
        }
        let times = Arc::new(times);
        self.times.insert(input, times.clone());
        Ok(times)
    }

    /// All numbers of `keys` keys, with tangents if `cubic`.
    fn values(&self, output: u32, keys: usize, quantity: Quantity, cubic: bool) -> Result<Vec<f64>, String> {
        let fault = |message: String| format!("output: {message}");
        let index = Index::new(output);
        let found = self.accessors.describe(index).map_err(fault)?.count.0;
        let in_key = quantity.elements * if cubic { 3 } else { 1 };
        let expected = keys.saturating_mul(in_key);
        if found != expected as u64 {
            let each = if in_key == 1 { String::new() } else { format!(" with {in_key} each") };
            return Err(fault(format!("{found} elements for {keys} keys{each}; allowed: {expected}")));
        }
        self.accessors.charge(expected.saturating_mul(quantity.element * size_of::<f64>())).map_err(fault)?;
        let doubles = |numbers: &[f32]| numbers.iter().map(|&number| f64::from(number)).collect::<Vec<f64>>();
        let mut values = match quantity.element {
            1 => self.accessors.vectors::<1>(index).map(|all| doubles(all.as_flattened())),
            3 => self.accessors.vectors::<3>(index).map(|all| doubles(all.as_flattened())),
            _ => self.accessors.vectors::<4>(index).map(|all| doubles(all.as_flattened())),
        }
        .map_err(fault)?;
        let width = quantity.element * in_key;
        if let Some(bad) = values.iter().position(|value| !value.is_finite()) {
            return Err(fault(format!("key {} has {}; allowed: finite numbers", bad / width, values[bad])));
        }
        if quantity.fraction {
            let bad = |key: usize| !(0.0..=1.0).contains(&values[key * width + usize::from(cubic)]);
            if let Some(bad) = (0..keys).find(|&key| bad(key)) {
                let found = values[bad * width + usize::from(cubic)];
                return Err(fault(format!("key {bad} is {found}; allowed: 0 to 1")));
            }
        }
        if quantity.turns {
            for (number, key) in values.chunks_exact_mut(width).enumerate() {
                let rotation = if cubic { &mut key[4..8] } else { key };
                let length = rotation.iter().map(|value| value * value).sum::<f64>().sqrt();
                if length == 0.0 {
                    return Err(fault(format!("key {number} is a quaternion of length 0; allowed: unit quaternions")));
                }
                // Quaternions in files are rounded; the tangents of splines belong to the values as they are.
                if !cubic {
                    rotation.iter_mut().for_each(|value| *value /= length);
                }
            }
        }
        Ok(values)
    }
}
