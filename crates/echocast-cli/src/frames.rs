//! Which frames are scanned.

use std::fmt;
use std::str::FromStr;

/// Frames `first` to `last`, both included, every `step`th.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameRange {
    pub first: u32,
    pub last: u32,
    pub step: u32,
}

impl FrameRange {
    /// The frame at time 0.
    pub const ONE: FrameRange = FrameRange { first: 0, last: 0, step: 1 };

    /// All frames that start before `end`, s, at `fps` frames per second, or also `at_end`; at least the first.
    pub fn until(end: f64, fps: f64, at_end: bool) -> FrameRange {
        /// More frames than any run has.
        const MOST: f64 = 1e9;
        // Times in files are rounded.
        const SLACK: f64 = 1e-6;
        let last = if at_end { (end * fps + SLACK).floor() } else { (end * fps - SLACK).ceil() - 1.0 };
        FrameRange { last: last.clamp(0.0, MOST) as u32, ..FrameRange::ONE }
    }

    /// Number of frames.
    pub fn len(self) -> usize {
        ((self.last - self.first) / self.step) as usize + 1
    }

    /// Frame numbers, rising.
    pub fn iter(self) -> impl Iterator<Item = u32> {
        (self.first..=self.last).step_by(self.step as usize)
    }
}

impl FromStr for FrameRange {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let numbers: Result<Vec<u32>, _> = text.split(':').map(str::parse).collect();
        let frames = match numbers.as_deref() {
            Ok(&[only]) => FrameRange { first: only, last: only, step: 1 },
            Ok(&[first, last]) => FrameRange { first, last, step: 1 },
            Ok(&[first, last, step]) => FrameRange { first, last, step },
            _ => return Err("expected FRAME, FIRST:LAST or FIRST:LAST:STEP, such as 0:9"),
        };
        if frames.step == 0 || frames.last < frames.first {
            return Err("the last frame must not come before the first, and the step must be at least 1");
        }
        Ok(frames)
    }
}

impl fmt::Display for FrameRange {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{}:{}:{}", self.first, self.last, self.step)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_ends_are_included() {
        let frames: FrameRange = "2:9:3".parse().unwrap();
        assert_eq!(frames.iter().collect::<Vec<_>>(), [2, 5, 8]);
        assert_eq!(frames.len(), 3);
        assert_eq!("4:4".parse::<FrameRange>().unwrap().len(), 1);
        assert_eq!("7:9".parse::<FrameRange>().unwrap().to_string(), "7:9:1");
        assert_eq!("5".parse::<FrameRange>().unwrap(), "5:5".parse().unwrap());
        assert_eq!("0:4294967295".parse::<FrameRange>().unwrap().len(), 1 << 32);
        for wrong in ["", "3:2", "0:9:0", "0:9:1:1", "-1:3", "a:b"] {
            assert!(wrong.parse::<FrameRange>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_span_holds_the_frames_that_start_in_it() {
        let most = 1_000_000_000;
        for (end, before, at) in
            [(0.0, 0, 0), (0.05, 0, 0), (0.1, 0, 1), (0.11, 1, 1), (1.000_000_001, 9, 10), (1e300, most, most)]
        {
            assert_eq!([false, true].map(|at_end| FrameRange::until(end, 10.0, at_end).last), [before, at], "{end}");
        }
    }
}
