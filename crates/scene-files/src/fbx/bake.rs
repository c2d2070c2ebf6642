//! Bakes curves that can be evaluated at any time into curves of keys.
//!
//! FBX rotates nodes by Euler angles, in one of seven orders, between pivots, by curves in several layers whose keys
//! have weighted tangents; none of our curves can represent these. So the transforms that `ufbx` evaluates are sampled,
//! and keys are set as needed: at all keys of the file, with straight lines between them where these are accurate, else
//! with splines (of the sampled slopes), as many as it takes. The result is accurate to a tolerance at every time, not
//! only at frames.

use super::budget::Budget;
use glam::DQuat;
use model::motion::{AnimationTrack, Curve, Interpolation};
use std::sync::Arc;

/// Where a stretch between two keys is checked, as fractions of its length: unevenly, so that no rotation or
/// oscillation passes all of them unnoticed.
const CHECKED: [f64; 5] = [0.11, 0.29, 0.5, 0.73, 0.9];

/// Stretches shorter than this, s, are not split further.
const SHORTEST_S: f64 = 1e-4;

/// Largest distance from a key at which the values before and after it are sampled, s: they may jump there.
const EDGE_S: f64 = 1e-9;

/// The course of a property over time.
#[derive(Clone, Default)]
pub(super) enum FbxCourse {
    /// No animation changes it.
    #[default]
    NotAnimated,
    /// A constant value, which may differ from the one without animations.
    Still(Vec<f64>),
    Moving(AnimationTrack),
}

impl FbxCourse {
    /// The constant value or the track, if any.
    pub fn split<const N: usize>(&self) -> (Option<[f64; N]>, Option<AnimationTrack>) {
        match self {
            FbxCourse::NotAnimated => (None, None),
            FbxCourse::Still(value) => (value.as_slice().try_into().ok(), None),
            FbxCourse::Moving(track) => (None, Some(track.clone())),
        }
    }
}

/// A quantity to be baked.
pub(super) struct Baker<'a> {
    /// Its values at a time, s.
    pub value: &'a dyn Fn(f64) -> Vec<f64>,
    /// The number of curves that a value depends on.
    pub cost: usize,
    /// Whether it is a quaternion.
    pub turns: bool,
    /// Largest error of a value; for quaternions about half the angle, rad.
    pub tolerance: f64,
    /// Period after which it repeats, s.
    pub period: Option<f64>,
    pub budget: &'a Budget,
}

/// A stretch of a curve, without jumps.
struct CurveStretch {
    start: f64,
    end: f64,
    from: Vec<f64>,
    to: Vec<f64>,
    /// Slopes at both ends, per second.
    leaving: Vec<f64>,
    arriving: Vec<f64>,
}

impl Baker<'_> {
    /// Bakes the quantity; `times`, ascending, are those of all keys that it depends on, s.
    pub fn bake(&self, times: &[f64]) -> Result<FbxCourse, String> {
        let [first, .., last] = times else { return Ok(FbxCourse::Still(self.at(times[0])?)) };
        // Values may jump at the first and last keys too.
        let ends = [self.at(first - EDGE_S)?, self.at(last + EDGE_S)?];
        let mut lines = Vec::new();
        for pair in times.windows(2) {
            let line = self.line(pair[0], pair[1])?;
            if !self.fits(&line, Interpolation::Linear)? {
                lines.clear();
                break;
            }
            lines.push(line);
        }
        if !lines.is_empty() {
            let still = |value: &[f64]| self.near(value, &lines[0].from, self.tolerance * 1e-3);
            if lines.iter().flat_map(|line| [&line.from, &line.to]).chain(&ends).all(|value| still(value)) {
                return Ok(FbxCourse::Still(self.at(*first)?));
            }
            return self.join(lines, ends, Interpolation::Linear);
        }
        let mut splines = Vec::new();
        for pair in times.windows(2) {
            let mut parts = vec![(pair[0], pair[1])];
            while let Some((start, end)) = parts.pop() {
                let spline = self.spline(start, end)?;
                if end - start <= SHORTEST_S || self.fits(&spline, Interpolation::Cubic)? {
                    splines.push(spline);
                } else {
                    let middle = 0.5 * (start + end);
                    parts.extend([(middle, end), (start, middle)]);
                }
            }
        }
        self.join(splines, ends, Interpolation::Cubic)
    }

    /// Bakes a quantity that changes only at the times of keys: true or false.
    pub fn steps(&self, times: &[f64]) -> Result<FbxCourse, String> {
        let values = times.iter().map(|time| self.at(time + EDGE_S)).collect::<Result<Vec<_>, _>>()?.concat();
        if values.iter().all(|value| *value == values[0]) {
            return Ok(FbxCourse::Still(vec![values[0]]));
        }
        Ok(self.track(times.to_vec(), values, 1, Interpolation::Step))
    }

    /// The values at `time`.
    fn at(&self, time: f64) -> Result<Vec<f64>, String> {
        self.budget.look(self.cost)?;
        let mut value = (self.value)(time);
        if !value.iter().all(|number| number.is_finite()) {
            return Err(format!("at {time} s its animation is not finite"));
        }
        if self.turns {
            let turned = DQuat::from_slice(&value);
            let unit = if turned.length_squared().is_normal() { turned.normalize() } else { DQuat::IDENTITY };
            value.copy_from_slice(&unit.to_array());
        }
        Ok(value)
    }

    /// A straight line.
    fn line(&self, start: f64, end: f64) -> Result<CurveStretch, String> {
        let edge = edge(start, end);
        let (from, mut to) = (self.at(start + edge)?, self.at(end - edge)?);
        self.align(&mut to, &from);
        Ok(CurveStretch { start, end, from, to, leaving: Vec::new(), arriving: Vec::new() })
    }

    /// A spline with the slopes that the quantity has at both ends.
    fn spline(&self, start: f64, end: f64) -> Result<CurveStretch, String> {
        let (edge, step) = (edge(start, end), 1e-3 * (end - start));
        let line = self.line(start, end)?;
        let leaving = self.slope(start + edge, &line.from, step)?;
        let arriving = self.slope(end - edge, &line.to, -step)?;
        Ok(CurveStretch { leaving, arriving, ..line })
    }

    /// The slope at `time`, where the value is `here`: that of the parabola through it and two values `step` s apart.
    fn slope(&self, time: f64, here: &[f64], step: f64) -> Result<Vec<f64>, String> {
        let (mut near, mut far) = (self.at(time + step)?, self.at(time + 2.0 * step)?);
        self.align(&mut near, here);
        self.align(&mut far, here);
        let values = here.iter().zip(near).zip(far);
        Ok(values.map(|((here, near), far)| (4.0 * near - 3.0 * here - far) / (2.0 * step)).collect())
    }

    /// Sets `value` to the one of the two quaternions of its rotation that is nearer to `other`.
    fn align(&self, value: &mut [f64], other: &[f64]) {
        if self.turns && value.iter().zip(other).map(|(a, b)| a * b).sum::<f64>() < 0.0 {
            value.iter_mut().for_each(|number| *number = -*number);
        }
    }

    /// Whether a stretch is accurate, as far as it is checked.
    fn fits(&self, stretch: &CurveStretch, interpolation: Interpolation) -> Result<bool, String> {
        let mut keys = BakedKeys::default();
        keys.add(stretch, self, interpolation);
        let curve = keys.curve(self, interpolation);
        let mut found = vec![0.0; curve.width];
        for part in CHECKED {
            let time = stretch.start + part * (stretch.end - stretch.start);
            let mut expected = self.at(time)?;
            curve.at(time, &mut found);
            if self.turns {
                let turned = DQuat::from_slice(&found);
                // Splines leave the unit sphere, and are normalised when they are played.
                found.copy_from_slice(&turned.normalize().to_array());
                self.align(&mut expected, &found);
            }
            if !self.near(&found, &expected, self.tolerance) {
                return Ok(false);
            }
        }
        Ok(true)
    }

    fn near(&self, a: &[f64], b: &[f64], tolerance: f64) -> bool {
        // Large numbers have fewer digits after the point. NaN fails this comparison too.
        a.iter().zip(b).all(|(a, b)| (a - b).abs() <= tolerance.max(1e-9 * b.abs()))
    }

    /// Joins consecutive stretches, with the values before and after them, into one curve.
    fn join(
        &self,
        stretches: Vec<CurveStretch>,
        [before, mut after]: [Vec<f64>; 2],
        interpolation: Interpolation,
    ) -> Result<FbxCourse, String> {
        let (cubic, none) = (interpolation == Interpolation::Cubic, vec![0.0; before.len()]);
        let mut keys = BakedKeys::default();
        keys.push(stretches[0].start, &none, &before, &none, cubic);
        for mut stretch in stretches {
            self.budget.charge(stretch.from.len() * 6 * size_of::<f64>())?;
            if self.turns && keys.last.iter().zip(&stretch.from).map(|(a, b)| a * b).sum::<f64>() < 0.0 {
                let all = [&mut stretch.from, &mut stretch.to, &mut stretch.leaving, &mut stretch.arriving];
                all.into_iter().flatten().for_each(|number| *number = -*number);
            }
            keys.add(&stretch, self, interpolation);
        }
        self.align(&mut after, &keys.last);
        if !self.near(&keys.last, &after, self.tolerance) {
            let end = keys.times.last().copied().unwrap_or_default();
            keys.push(end, &none, &after, &none, cubic);
        }
        let curve = keys.curve(self, interpolation);
        Ok(self.track(curve.times, curve.values, curve.width, interpolation))
    }

    fn track(&self, times: Vec<f64>, values: Vec<f64>, width: usize, interpolation: Interpolation) -> FbxCourse {
        let curve = Arc::new(Curve { times, values, width, interpolation, turns: self.turns });
        FbxCourse::Moving(AnimationTrack { curve, period: self.period })
    }
}

/// Distance from the ends of a stretch at which its end values are sampled, s.
fn edge(start: f64, end: f64) -> f64 {
    EDGE_S.min(1e-3 * (end - start))
}

/// A curve under construction.
#[derive(Default)]
struct BakedKeys {
    times: Vec<f64>,
    values: Vec<f64>,
    /// The value of the last key.
    last: Vec<f64>,
}

impl BakedKeys {
    fn add(&mut self, stretch: &CurveStretch, baker: &Baker<'_>, interpolation: Interpolation) {
        let width = stretch.from.len();
        let none = vec![0.0; width];
        let cubic = interpolation == Interpolation::Cubic;
        let continues = !self.last.is_empty() && baker.near(&self.last, &stretch.from, baker.tolerance);
        if continues && cubic {
            let slopes = self.values.len() - width;
            self.values[slopes..].copy_from_slice(&stretch.leaving);
        }
        if !continues {
            self.push(stretch.start, &none, &stretch.from, &stretch.leaving, cubic);
        }
        self.push(stretch.end, &stretch.arriving, &stretch.to, &none, cubic);
    }

    fn push(&mut self, time: f64, before: &[f64], value: &[f64], after: &[f64], cubic: bool) {
        self.times.push(time);
        self.last = value.to_vec();
        if cubic {
            self.values.extend([before, value, after].into_iter().flatten());
        } else {
            self.values.extend(value);
        }
    }

    fn curve(self, baker: &Baker<'_>, interpolation: Interpolation) -> Curve {
        let BakedKeys { times, values, last } = self;
        Curve { times, values, width: last.len(), interpolation, turns: baker.turns }
    }
}
