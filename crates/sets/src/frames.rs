//! When the frames of a rig start.

use super::spec::{SensorEntry, Spec};
use emitter::Trajectory;
use engine::sensor::Sensor;
use ground::error::{Error, Result};

/// When a frame starts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameTime {
    /// Its number.
    pub number: u32,
    /// Seconds since the start of the run.
    pub start: f64,
}

/// Maximum number of frames of a scan.
const MOST_FRAMES: f64 = 10_000_000.0;

/// The frames of a rig.
#[derive(Clone, Copy, Debug)]
pub(super) struct RigFrames {
    /// Per second.
    fps: f64,
    first: u32,
    last: u32,
    step: u32,
}

impl RigFrames {
    /// Those that `spec` selects, at the rate of the `first` sensor unless it gives one; a sonar pings along all of the
    /// trajectory in a `file`.
    pub fn of(spec: &Spec, first: &Sensor, file: Option<&Trajectory>) -> RigFrames {
        let fps = spec.fps(first);
        let [first, last, step] = match (&spec.frames, file) {
            (Some(frames), _) => [frames.first, frames.last, frames.step],
            (None, Some(file)) if first.kind().makes_pings() => {
                [0, (file.span().1 * fps + 1e-6).min(MOST_FRAMES) as u32, 1]
            }
            (None, _) => [0, 0, 1],
        };
        RigFrames { fps, first, last, step }
    }

    /// Start of the first one, s.
    pub fn start(self) -> f64 {
        f64::from(self.first) / self.fps
    }

    /// From one to the next, s.
    pub fn period(self) -> f64 {
        f64::from(self.step) / self.fps
    }

    /// Those of the sensor of `entry`, which has the number `index`.
    ///
    /// # Errors
    /// A rate of its own that makes too many.
    pub fn of_sensor(self, (index, entry): (usize, &SensorEntry)) -> Result<Vec<FrameTime>> {
        let Some(rate) = entry.rate_hz else {
            let time = |number| FrameTime { number, start: f64::from(number) / self.fps };
            return Ok((self.first..=self.last).step_by(self.step as usize).map(time).collect());
        };
        // All frames that start before the one after the last.
        let first = self.start() + entry.start_s;
        let end = f64::from(self.last) / self.fps + self.period();
        let count = ((end - first) * rate - 1e-9).ceil().max(0.0);
        if count > MOST_FRAMES {
            let found = format!("{rate}, which makes {count} frames");
            let allowed = format!("a rate that makes {MOST_FRAMES} at most");
            return Err(Error::invalid(format!("sensors[{index}].rate_hz"), found, allowed));
        }
        Ok((0..count as u32).map(|number| FrameTime { number, start: first + f64::from(number) / rate }).collect())
    }
}
