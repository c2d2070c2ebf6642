//! Heights along flight lines.

use crate::{GroundHeight, HeightAbove, PlanSpec};
use glam::DVec2;

/// Height of a platform along a line.
#[derive(Clone, Debug)]
pub(crate) struct AltitudeProfile {
    /// Distance from one height to the next, m.
    step: f64,
    /// Heights z, m; one: the line is level.
    heights: Vec<f64>,
}

/// What is known of the ground below a line.
pub(crate) struct GroundProfile {
    /// Distance from one height to the next, m.
    step: f64,
    /// Heights of the ground, m, with those that are missing as at the nearest place that has one.
    heights: Vec<f64>,
    /// Whether heights are missing.
    pub gaps: bool,
}

/// Most heights of a line.
const MOST: f64 = 2000.0;

impl GroundProfile {
    /// The ground below the line from `start` to `end` every `step` m, or farther apart on very long lines; `None`: there is
    /// none.
    pub fn new(ground: GroundHeight, [start, end]: [DVec2; 2], step: f64) -> Option<GroundProfile> {
        GroundProfile::along(ground, &|part| start.lerp(end, part), start.distance(end), step)
    }

    /// [`GroundProfile::new`] along a path of this `length`, m, whose place at a part of the way, 0 to 1, is `place_at`.
    pub fn along(
        ground: GroundHeight,
        place_at: &dyn Fn(f64) -> DVec2,
        length: f64,
        step: f64,
    ) -> Option<GroundProfile> {
        let parts = (length / step).ceil().clamp(1.0, MOST);
        let place = |index: u32| place_at(f64::from(index) / parts);
        let found: Vec<Option<f64>> = (0..=parts as u32).map(|index| ground(place(index).x, place(index).y)).collect();
        let known: Vec<(usize, f64)> = found.iter().enumerate().filter_map(|(at, z)| Some((at, (*z)?))).collect();
        let gaps = known.len() < found.len();
        let first = *known.first()?;
        let mut next = 0;
        let heights = (0..found.len()).map(|at| {
            while known.get(next + 1).is_some_and(|after| after.0.abs_diff(at) <= known[next].0.abs_diff(at)) {
                next += 1;
            }
            known.get(next).unwrap_or(&first).1
        });
        Some(GroundProfile { step: length / parts, heights: heights.collect(), gaps })
    }

    /// Mean height, m.
    pub fn mean(&self) -> f64 {
        self.heights.iter().sum::<f64>() / self.heights.len() as f64
    }

    /// The height of the ground, mean over blocks of `block` m, twice: without steps or kinks.
    fn smoothed(&self, block: f64) -> Vec<f64> {
        let half = (0.5 * block / self.step).round() as usize;
        let means = |heights: &[f64]| -> Vec<f64> {
            // Sums up to each height.
            let sums: Vec<f64> = std::iter::once(0.0)
                .chain(heights.iter().scan(0.0, |sum, z| {
                    *sum += z - heights[0];
                    Some(*sum)
                }))
                .collect();
            let mean = |at: usize| {
                // As wide to both sides, also at the ends.
                let half = half.min(at).min(heights.len() - 1 - at);
                heights[0] + (sums[at + half + 1] - sums[at - half]) / (2 * half + 1) as f64
            };
            (0..heights.len()).map(mean).collect()
        };
        means(&means(&self.heights))
    }
}

impl AltitudeProfile {
    /// Of a platform `spec` at a speed, m/s, over `below`; `level` is the mean height of all ground below lines, m.
    pub fn new(spec: &PlanSpec, speed: f64, below: &GroundProfile, level: f64) -> AltitudeProfile {
        let heights = match spec.above {
            HeightAbove::Sea => vec![spec.height_m],
            HeightAbove::Flat => vec![level + spec.height_m],
            HeightAbove::Ground => {
                below.smoothed(block_m(spec.height_m, speed)).iter().map(|z| z + spec.height_m).collect()
            }
        };
        let level = heights.iter().all(|z| (z - heights[0]).abs() < 1e-6);
        AltitudeProfile { step: below.step, heights: if level { vec![heights[0]] } else { heights } }
    }

    /// Of a platform that stays at one height, m.
    pub fn level(height_m: f64) -> AltitudeProfile {
        AltitudeProfile { step: 1.0, heights: vec![height_m] }
    }

    /// Least height above the ground `below` it, m, and the distance along the line where it is.
    pub fn least_clearance(&self, below: &GroundProfile) -> [f64; 2] {
        let places = (0..).map(|index: u32| f64::from(index) * below.step).zip(&below.heights);
        let clearances = places.map(|(along, ground)| [self.at(along) - ground, along]);
        clearances.min_by(|a, b| a[0].total_cmp(&b[0])).unwrap_or([f64::INFINITY, 0.0])
    }

    /// Distance between the heights that it is made of, m; `None`: it is level.
    pub fn step(&self) -> Option<f64> {
        (self.heights.len() > 1).then_some(self.step)
    }

    /// Height at a distance along the line, m, by cubic interpolation that passes the given heights (Catmull and Rom 1974);
    /// beyond the ends that of the ends.
    pub fn at(&self, along: f64) -> f64 {
        self.with_slope(along)[0]
    }

    /// Height, m, and slope.
    pub fn with_slope(&self, along: f64) -> [f64; 2] {
        let last = self.heights.len() - 1;
        if last == 0 || along <= 0.0 {
            return [self.heights[0], 0.0];
        }
        if along >= last as f64 * self.step {
            return [self.heights[last], 0.0];
        }
        let at = ((along / self.step) as usize).min(last - 1);
        let part = along / self.step - at as f64;
        let z = |index: usize| self.heights[index];
        // Level at its ends, where turns begin.
        let tangent =
            |index: usize| if index == 0 || index == last { 0.0 } else { 0.5 * (z(index + 1) - z(index - 1)) };
        hermite([z(at), z(at + 1)], [tangent(at), tangent(at + 1)], part, self.step)
    }
}

/// Value and slope of the cubic between two values, with tangents per `length` at its ends.
pub(crate) fn hermite([a, b]: [f64; 2], [slope_a, slope_b]: [f64; 2], part: f64, length: f64) -> [f64; 2] {
    let (t, t2) = (part, part * part);
    let (bend, twist) = (3.0 * (b - a) - 2.0 * slope_a - slope_b, 2.0 * (a - b) + slope_a + slope_b);
    [a + t * slope_a + t2 * bend + t2 * t * twist, (slope_a + 2.0 * t * bend + 3.0 * t2 * twist) / length]
}

/// Length of the blocks over which terrain is followed, m: a platform neither follows what is smaller than its height, nor
/// climbs and sinks faster than in some seconds.
pub(crate) fn block_m(height_m: f64, speed: f64) -> f64 {
    height_m.max(4.0 * speed).max(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spec(above: HeightAbove) -> PlanSpec {
        PlanSpec { above, ..PlanSpec::new(80.0) }
    }

    /// Over a slope the platform keeps its height above ground; over waves much longer than a block, too; a step becomes a
    /// slope without kinks.
    #[test]
    fn terrain_is_followed() {
        let line = [DVec2::ZERO, DVec2::new(2000.0, 0.0)];
        let profile = |ground: GroundHeight| {
            let below = GroundProfile::new(ground, line, 10.0).unwrap();
            AltitudeProfile::new(&spec(HeightAbove::Ground), 8.0, &below, below.mean())
        };
        let slope = profile(&|x, _| Some(0.1 * x));
        let waves = profile(&|x, _| Some(30.0 * (x / 300.0).sin()));
        let step = profile(&|x, _| Some(if x < 1000.0 { 0.0 } else { 20.0 }));
        for along in (200..1800).step_by(7).map(f64::from) {
            assert!((slope.at(along) - 0.1 * along - 80.0).abs() < 1e-6);
            assert!((waves.at(along) - 30.0 * (along / 300.0).sin() - 80.0).abs() < 0.5);
            let [z, rise] = step.with_slope(along);
            assert!((79.9..=100.1).contains(&z) && (-0.01..=20.0 / 80.0 + 0.01).contains(&rise), "{along} {z} {rise}");
            let [_, later] = step.with_slope(along + 0.1);
            assert!((later - rise).abs() < 1e-3);
        }
    }

    #[test]
    fn levels_are_above_the_mean_or_the_sea() {
        let below = GroundProfile::new(&|x, _| Some(0.1 * x), [DVec2::ZERO, DVec2::new(100.0, 0.0)], 1.0).unwrap();
        let z = |above| AltitudeProfile::new(&spec(above), 8.0, &below, below.mean()).at(30.0);
        assert!((z(HeightAbove::Flat) - 85.0).abs() < 1e-9);
        assert_eq!(z(HeightAbove::Sea), 80.0);
    }

    /// Where the scene ends, the ground goes on as at its edge; nowhere there is none.
    #[test]
    fn gaps_are_filled_from_the_nearest_ground() {
        let line = [DVec2::ZERO, DVec2::new(100.0, 0.0)];
        let edge = GroundProfile::new(&|x, _| (20.0..=60.0).contains(&x).then_some(x), line, 1.0).unwrap();
        assert!(edge.gaps);
        assert_eq!([edge.heights[0], edge.heights[30], edge.heights[100]], [20.0, 30.0, 60.0]);
        assert!(GroundProfile::new(&|_, _| None, line, 1.0).is_none());
    }
}
