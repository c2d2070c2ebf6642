//! Curves that can be asked for any time to curves of keys.
//!
//! FBX turns nodes by Euler angles, in one of seven orders, between pivots, by curves in several layers whose keys have
//! weighted tangents: no curve of ours is one of these. So what `ufbx` makes of them is looked at, and keys are set as
//! needed: at all keys of the file, straight lines between them where these are right, and else splines (with the slopes
//! that are there), as many as it takes. The result is right to a tolerance at every time, not only at frames.

use super::budget::Budget;
use crate::motion::{Curve, Interpolation, Track};
use glam::DQuat;
use std::sync::Arc;

/// Where a stretch between two keys is checked, as parts of its length: not evenly, so that no turn and no wave passes
/// all of them unnoticed.
const CHECKED: [f64; 5] = [0.11, 0.29, 0.5, 0.73, 0.9];

/// Stretches shorter than this, s, are not cut further.
const SHORTEST_S: f64 = 1e-4;

/// How far from a key one looks at what is before and after it, s, at most: values may jump there.
const EDGE_S: f64 = 1e-9;

/// What a property does over time.
#[derive(Clone, Default)]
pub(super) enum Course {
    /// No animation says anything of it.
    #[default]
    Unsaid,
    /// It has this value, though the file says something else without its animations.
    Still(Vec<f64>),
    Moving(Track),
}

impl Course {
    /// The constant value, if any, and else the track.
    pub fn split<const N: usize>(&self) -> (Option<[f64; N]>, Option<Track>) {
        match self {
            Course::Unsaid => (None, None),
            Course::Still(value) => (value.as_slice().try_into().ok(), None),
            Course::Moving(track) => (None, Some(track.clone())),
        }
    }
}

/// A quantity to be baked.
pub(super) struct Baker<'a> {
    /// Its values at a time, s.
    pub value: &'a dyn Fn(f64) -> Vec<f64>,
    /// Curves behind a value.
    pub cost: usize,
    /// Whether it is a quaternion.
    pub turns: bool,
    /// How far a value may be off; for quaternions about half the angle, rad.
    pub tolerance: f64,
    /// After how many seconds it starts again.
    pub period: Option<f64>,
    pub budget: &'a Budget,
}

/// A stretch of a curve, without jumps.
struct Stretch {
    start: f64,
    end: f64,
    from: Vec<f64>,
    to: Vec<f64>,
    /// Slopes at both ends, per second.
    leaving: Vec<f64>,
    arriving: Vec<f64>,
}

impl Baker<'_> {
    /// What the quantity does; `times`, rising, are those of all keys behind it, s.
    pub fn bake(&self, times: &[f64]) -> Result<Course, String> {
        let [first, .., last] = times else { return Ok(Course::Still(self.at(times[0])?)) };
        // Values may jump at these keys too.
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
                return Ok(Course::Still(self.at(*first)?));
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

    /// What changes at the times of keys alone: true or false.
    pub fn steps(&self, times: &[f64]) -> Result<Course, String> {
        let values = times.iter().map(|time| self.at(time + EDGE_S)).collect::<Result<Vec<_>, _>>()?.concat();
        if values.iter().all(|value| *value == values[0]) {
            return Ok(Course::Still(vec![values[0]]));
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
    fn line(&self, start: f64, end: f64) -> Result<Stretch, String> {
        let edge = edge(start, end);
        let (from, mut to) = (self.at(start + edge)?, self.at(end - edge)?);
        self.align(&mut to, &from);
        Ok(Stretch { start, end, from, to, leaving: Vec::new(), arriving: Vec::new() })
    }

    /// A spline with the slopes that the quantity has at both ends.
    fn spline(&self, start: f64, end: f64) -> Result<Stretch, String> {
        let (edge, step) = (edge(start, end), 1e-3 * (end - start));
        let line = self.line(start, end)?;
        let leaving = self.slope(start + edge, &line.from, step)?;
        let arriving = self.slope(end - edge, &line.to, -step)?;
        Ok(Stretch { leaving, arriving, ..line })
    }

    /// The slope at `time`, where the value is `here`: that of the parabola through it and two values `step` s apart.
    fn slope(&self, time: f64, here: &[f64], step: f64) -> Result<Vec<f64>, String> {
        let (mut near, mut far) = (self.at(time + step)?, self.at(time + 2.0 * step)?);
        self.align(&mut near, here);
        self.align(&mut far, here);
        let values = here.iter().zip(near).zip(far);
        Ok(values.map(|((here, near), far)| (4.0 * near - 3.0 * here - far) / (2.0 * step)).collect())
    }

    /// Makes `value` the one of two quaternions of the same rotation that is nearer to `other`.
    fn align(&self, value: &mut [f64], other: &[f64]) {
        if self.turns && value.iter().zip(other).map(|(a, b)| a * b).sum::<f64>() < 0.0 {
            value.iter_mut().for_each(|number| *number = -*number);
        }
    }

    /// Whether a stretch is right, as far as can be seen.
    fn fits(&self, stretch: &Stretch, interpolation: Interpolation) -> Result<bool, String> {
        let mut keys = Keys::default();
        keys.add(stretch, self, interpolation);
        let curve = keys.curve(self, interpolation);
        let mut found = vec![0.0; curve.width];
        for part in CHECKED {
            let time = stretch.start + part * (stretch.end - stretch.start);
            let mut wanted = self.at(time)?;
            curve.at(time, &mut found);
            if self.turns {
                let turned = DQuat::from_slice(&found);
                // Splines leave the unit sphere, and are brought back when they are played.
                found.copy_from_slice(&turned.normalize().to_array());
                self.align(&mut wanted, &found);
            }
            if !self.near(&found, &wanted, self.tolerance) {
                return Ok(false);
            }
        }
        Ok(true)
    }

    fn near(&self, a: &[f64], b: &[f64], tolerance: f64) -> bool {
        // Of large numbers fewer digits can be had. A comparison that NaN fails too.
        a.iter().zip(b).all(|(a, b)| (a - b).abs() <= tolerance.max(1e-9 * b.abs()))
    }

    /// Stretches that follow each other, with the values before and after them, as one curve.
    fn join(
        &self,
        stretches: Vec<Stretch>,
        [before, mut after]: [Vec<f64>; 2],
        interpolation: Interpolation,
    ) -> Result<Course, String> {
        let (cubic, none) = (interpolation == Interpolation::Cubic, vec![0.0; before.len()]);
        let mut keys = Keys::default();
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

    fn track(&self, times: Vec<f64>, values: Vec<f64>, width: usize, interpolation: Interpolation) -> Course {
        let curve = Arc::new(Curve { times, values, width, interpolation, turns: self.turns });
        Course::Moving(Track { curve, period: self.period })
    }
}

/// How far from the ends of a stretch one looks at what is in it, s.
fn edge(start: f64, end: f64) -> f64 {
    EDGE_S.min(1e-3 * (end - start))
}

/// A curve in the making.
#[derive(Default)]
struct Keys {
    times: Vec<f64>,
    values: Vec<f64>,
    /// The value of the last key.
    last: Vec<f64>,
}

impl Keys {
    fn add(&mut self, stretch: &Stretch, baker: &Baker<'_>, interpolation: Interpolation) {
        let width = stretch.from.len();
        let none = vec![0.0; width];
        let cubic = interpolation == Interpolation::Cubic;
        let goes_on = !self.last.is_empty() && baker.near(&self.last, &stretch.from, baker.tolerance);
        if goes_on && cubic {
            let slopes = self.values.len() - width;
            self.values[slopes..].copy_from_slice(&stretch.leaving);
        }
        if !goes_on {
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
        let Keys { times, values, last } = self;
        Curve { times, values, width: last.len(), interpolation, turns: baker.turns }
    }
}
