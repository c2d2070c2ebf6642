//! Numbers over time: keys, and the interpolation between them.

use glam::DQuat;
use std::sync::Arc;

/// What a curve does between two keys (glTF 2.0, appendix C).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Interpolation {
    /// Holds the value of the key before.
    Step,
    /// A straight line; rotations turn uniformly, the short way (slerp).
    Linear,
    /// A cubic Hermite spline through values with tangents on both sides.
    Cubic,
}

/// A quantity of `width` numbers over time.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// Times of the keys, s, never falling; two equal times are a jump.
    pub times: Vec<f64>,
    /// `width` numbers for each time; with [`Interpolation::Cubic`] three times as many: the tangent before, the value
    /// and the tangent after, tangents per second.
    pub values: Vec<f64>,
    /// How many numbers the quantity has.
    pub width: usize,
    /// Interpolation between the keys.
    pub interpolation: Interpolation,
    /// Whether it is a quaternion (x, y, z, w).
    pub turns: bool,
}

impl Curve {
    /// Numbers of a key with its tangents.
    fn stride(&self) -> usize {
        if self.interpolation == Interpolation::Cubic { 3 * self.width } else { self.width }
    }

    /// The value of key `index`.
    fn key(&self, index: usize) -> &[f64] {
        let tangent = if self.interpolation == Interpolation::Cubic { self.width } else { 0 };
        &self.values[index * self.stride() + tangent..][..self.width]
    }

    /// The tangents of key `index` of a spline: before and after it.
    fn tangents(&self, index: usize) -> [&[f64]; 2] {
        [0, 2].map(|place| &self.values[(3 * index + place) * self.width..][..self.width])
    }

    /// The value at `time`; before the first key that of the first, after the last that of the last.
    pub fn at(&self, time: f64, value: &mut [f64]) {
        let after = passed(&self.times, time, |key| key <= time);
        let before = after.saturating_sub(1);
        let from = self.key(before);
        if after == 0 || after == self.times.len() || self.interpolation == Interpolation::Step {
            return value.copy_from_slice(from);
        }
        let to = self.key(after);
        let length = self.times[after] - self.times[before];
        let part = (time - self.times[before]) / length;
        if self.interpolation == Interpolation::Linear {
            if self.turns {
                let [from, to] = [from, to].map(DQuat::from_slice);
                // glam takes the shorter way.
                return value.copy_from_slice(&from.slerp(to, part).to_array());
            }
            for (value, (from, to)) in value.iter_mut().zip(from.iter().zip(to)) {
                *value = from + (to - from) * part;
            }
            return;
        }
        let ([_, leaving], [arriving, _]) = (self.tangents(before), self.tangents(after));
        let (t, t2, t3) = (part, part * part, part * part * part);
        for (index, value) in value.iter_mut().enumerate() {
            *value = (2.0 * t3 - 3.0 * t2 + 1.0) * from[index]
                + length * (t3 - 2.0 * t2 + t) * leaving[index]
                + (3.0 * t2 - 2.0 * t3) * to[index]
                + length * (t3 - t2) * arriving[index];
        }
    }

    /// Time of the last key, s.
    pub fn end(&self) -> f64 {
        self.times.last().copied().unwrap_or(0.0)
    }

    /// Whether it has one value at all times from `from` to `to`.
    fn is_still(&self, from: f64, to: f64) -> bool {
        let first = passed(&self.times, from, |key| key <= from).saturating_sub(1);
        let last = passed(&self.times, to, |key| key < to).min(self.times.len() - 1);
        let slopes = |index: usize| match self.interpolation {
            Interpolation::Cubic => self.tangents(index),
            _ => [&[][..]; 2],
        };
        let flat = |index: usize| slopes(index).into_iter().flatten().all(|slope| *slope == 0.0);
        first == last || (first..=last).all(|index| self.key(index) == self.key(first) && flat(index))
    }
}

/// How many of the `times`, which never fall, have `passed`; the first that has not is about `near`. Keys are mostly
/// evenly spaced, which tells where to look: a search among all of them would have to wait for memory time and again.
fn passed(times: &[f64], near: f64, passed: impl Fn(f64) -> bool) -> usize {
    let [first, .., last] = times else { return times.partition_point(|key| passed(*key)) };
    let guess = ((near - first) / (last - first) * (times.len() - 1) as f64) as usize;
    let (low, high) = (guess.min(times.len()).saturating_sub(1), guess.saturating_add(3).min(times.len()));
    let is_within = (low == 0 || passed(times[low - 1])) && (high == times.len() || !passed(times[high]));
    let (low, high) = if is_within { (low, high) } else { (0, times.len()) };
    low + times[low..high].partition_point(|key| passed(*key))
}

/// Most times at which something may bend during one scan.
pub const MOST_BENDS: f64 = 1e7;

/// A curve as it is played.
#[derive(Clone, Debug, PartialEq)]
pub struct AnimationTrack {
    /// Its keys, which tracks may share.
    pub curve: Arc<Curve>,
    /// After how many seconds it repeats; `None`: it holds its last value.
    pub period: Option<f64>,
}

impl AnimationTrack {
    /// The value at `time`, s.
    pub fn at(&self, time: f64, value: &mut [f64]) {
        self.curve.at(self.own_time(time), value);
    }

    /// [`AnimationTrack::at`] of `N` numbers.
    pub fn value<const N: usize>(&self, time: f64) -> [f64; N] {
        let mut value = [0.0; N];
        self.at(time, &mut value);
        value
    }

    fn own_time(&self, time: f64) -> f64 {
        self.period.map_or(time, |period| time.rem_euclid(period))
    }

    /// Whether it has one value at all times from `from` to `to`, s.
    pub fn is_still(&self, from: f64, to: f64) -> bool {
        match self.period {
            None => self.curve.is_still(from, to),
            // If both times are within one period, only the part in between is checked, otherwise the whole period.
            Some(period) if to - from < period && self.own_time(from) <= self.own_time(to) => {
                self.curve.is_still(self.own_time(from), self.own_time(to))
            }
            Some(period) => self.curve.is_still(0.0, period),
        }
    }

    /// Adds the times between `from` and `to`, s, at which it may bend or jump, in no particular order.
    pub fn bends(&self, from: f64, to: f64, bends: &mut Vec<f64>) {
        bends_of(&self.curve.times, self.period, from, to, bends);
    }

    /// Upper bound on the number of times that [`AnimationTrack::bends`] adds.
    pub fn most_bends(&self, from: f64, to: f64) -> f64 {
        most_bends_of(&self.curve.times, self.period, from, to)
    }
}

/// How many periods the times between `from` and `to`, s, may touch.
fn rounds(period: Option<f64>, from: f64, to: f64) -> f64 {
    period.map_or(1.0, |period| ((to - from) / period).ceil() + 1.0)
}

/// Upper bound on the number of times that [`bends_of`] adds.
pub(super) fn most_bends_of(times: &[f64], period: Option<f64>, from: f64, to: f64) -> f64 {
    if period.is_some() {
        return rounds(period, from, to) * (times.len() + 1) as f64;
    }
    let first = passed(times, from, |key| key <= from);
    passed(times, to, |key| key < to).saturating_sub(first) as f64
}

/// Adds those of `times` that are between `from` and `to`, s, repeated with the `period`, in no particular order.
pub(super) fn bends_of(times: &[f64], period: Option<f64>, from: f64, to: f64, bends: &mut Vec<f64>) {
    let mut round = |start: f64| {
        let first = passed(times, from - start, |key| start + key <= from);
        let last = passed(times, to - start, |key| start + key < to);
        bends.extend(times[first..last.max(first)].iter().map(|key| start + key));
        if period.is_some() && start > from && start < to {
            bends.push(start);
        }
    };
    let Some(length) = period else { return round(0.0) };
    let first = (from / length).floor();
    // Counted, as late times may be too large for one period more to make a difference.
    for number in 0..rounds(period, from, to) as u64 {
        round((first + number as f64) * length);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curve(times: &[f64], values: &[f64], width: usize, interpolation: Interpolation) -> Curve {
        Curve { times: times.to_vec(), values: values.to_vec(), width, interpolation, turns: false }
    }

    fn at(curve: &Curve, time: f64) -> f64 {
        let mut value = [0.0];
        curve.at(time, &mut value);
        value[0]
    }

    #[test]
    fn curves_hold_before_and_after_their_keys() {
        for interpolation in [Interpolation::Step, Interpolation::Linear] {
            let curve = curve(&[1.0, 3.0], &[5.0, 9.0], 1, interpolation);
            assert_eq!([at(&curve, -7.0), at(&curve, 1.0), at(&curve, 3.0), at(&curve, 1e9)], [5.0, 5.0, 9.0, 9.0]);
        }
        let step = curve(&[1.0, 3.0], &[5.0, 9.0], 1, Interpolation::Step);
        assert_eq!(at(&step, 2.999), 5.0);
        assert_eq!(at(&curve(&[1.0, 3.0], &[5.0, 9.0], 1, Interpolation::Linear), 1.5), 6.0);
    }

    /// A cubic is reproduced by its own values and slopes.
    #[test]
    fn splines_are_cubics() {
        let (f, slope) = (|t: f64| 2.0 + t - 3.0 * t * t + 0.5 * t * t * t, |t: f64| 1.0 - 6.0 * t + 1.5 * t * t);
        let times = [-1.0, 0.5, 3.0];
        let values: Vec<f64> = times.iter().flat_map(|&t| [slope(t), f(t), slope(t)]).collect();
        let curve = curve(&times, &values, 1, Interpolation::Cubic);
        for t in [-1.0, -0.3, 0.5, 0.6, 2.9, 3.0] {
            assert!((at(&curve, t) - f(t)).abs() < 1e-12, "{t}");
        }
        assert_eq!(at(&curve, 9.0), f(3.0));
    }

    /// Evenly spaced keys, bunched ones, jumps, and one key alone; before all keys, between them, at them and after.
    #[test]
    fn every_key_is_found() {
        let even: Vec<f64> = (0..50).map(|key| 0.3 + f64::from(key) / 24.0).collect();
        let bunched: Vec<f64> = (0..50).map(|key| 1.0 - 0.7_f64.powi(key)).collect();
        for times in [&even[..], &bunched, &[0.0, 0.1, 0.1, 0.1, 2.0], &[1.0, 1.0, 1.0], &[0.5, 1.5], &[0.5], &[]] {
            let near = times.iter().flat_map(|key| [key.next_down(), *key, key.next_up()]);
            for time in near.chain((-40..400).map(|k| f64::from(k) * 0.01)).chain([-1e300, 1e300]) {
                assert_eq!(passed(times, time, |key| key <= time), times.iter().filter(|key| **key <= time).count());
                assert_eq!(passed(times, time, |key| key < time), times.iter().filter(|key| **key < time).count());
            }
        }
    }

    #[test]
    fn rotations_turn_uniformly_and_the_short_way() {
        let turn = |degrees: f64| DQuat::from_rotation_z(degrees.to_radians());
        let (a, b) = (turn(10.0), -turn(110.0));
        let values = [a.to_array(), b.to_array()].concat();
        let track = AnimationTrack {
            curve: Arc::new(Curve { turns: true, ..curve(&[0.0, 1.0], &values, 4, Interpolation::Linear) }),
            period: None,
        };
        let found = DQuat::from_array(track.value(0.3));
        assert!(found.angle_between(turn(40.0)) < 1e-7 && (found.length() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn tracks_repeat_and_know_where_they_bend() {
        let line = Arc::new(curve(&[0.0, 1.0, 2.0], &[0.0, 4.0, 4.0], 1, Interpolation::Linear));
        let [once, again] = [None, Some(2.0)].map(|period| AnimationTrack { curve: line.clone(), period });
        assert_eq!([once.value::<1>(2.5), again.value(2.5), again.value(-1.5)], [[4.0], [2.0], [2.0]]);
        let bends = |track: &AnimationTrack, from, to| {
            let mut bends = Vec::new();
            track.bends(from, to, &mut bends);
            bends.sort_by(f64::total_cmp);
            bends.dedup();
            bends
        };
        assert_eq!(bends(&once, 0.5, 9.0), [1.0, 2.0]);
        assert_eq!(bends(&once, 1.0, 2.0), [0.0; 0]);
        assert_eq!(bends(&again, 0.5, 4.5), [1.0, 2.0, 3.0, 4.0]);
        assert!(once.is_still(1.0, 99.0) && !once.is_still(0.99, 1.5) && once.is_still(-4.0, 0.0));
        assert!(again.is_still(3.0, 3.9) && !again.is_still(3.5, 4.5) && again.is_still(1.2, 1.7));
    }

    #[test]
    fn splines_stand_still_without_slopes_alone() {
        let still = curve(&[0.0, 1.0], &[0.0, 2.0, 0.0, 0.0, 2.0, 0.0], 1, Interpolation::Cubic);
        let bulging = curve(&[0.0, 1.0], &[0.0, 2.0, 1.0, 0.0, 2.0, 0.0], 1, Interpolation::Cubic);
        assert!(still.is_still(0.2, 0.8) && !bulging.is_still(0.2, 0.8) && bulging.is_still(1.0, 5.0));
    }
}
