//! Which frames are scanned.

use std::fmt;
use std::str::FromStr;

/// Frames `first` to `last`, both included, every `step`th.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frames {
    pub first: u32,
    pub last: u32,
    pub step: u32,
}

impl Frames {
    /// The frame at time 0.
    pub const ONE: Frames = Frames { first: 0, last: 0, step: 1 };

    /// Number of frames.
    pub fn len(self) -> usize {
        ((self.last - self.first) / self.step) as usize + 1
    }

    /// Frame numbers, rising.
    pub fn iter(self) -> impl Iterator<Item = u32> {
        (self.first..=self.last).step_by(self.step as usize)
    }
}

impl FromStr for Frames {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let numbers: Result<Vec<u32>, _> = text.split(':').map(str::parse).collect();
        let frames = match numbers.as_deref() {
            Ok(&[first, last]) => Frames { first, last, step: 1 },
            Ok(&[first, last, step]) => Frames { first, last, step },
            _ => return Err("expected FIRST:LAST or FIRST:LAST:STEP, such as 0:9"),
        };
        if frames.step == 0 || frames.last < frames.first {
            return Err("the last frame must not come before the first, and the step must be at least 1");
        }
        Ok(frames)
    }
}

impl fmt::Display for Frames {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{}:{}:{}", self.first, self.last, self.step)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_ends_are_included() {
        let frames: Frames = "2:9:3".parse().unwrap();
        assert_eq!(frames.iter().collect::<Vec<_>>(), [2, 5, 8]);
        assert_eq!(frames.len(), 3);
        assert_eq!("4:4".parse::<Frames>().unwrap().len(), 1);
        assert_eq!("7:9".parse::<Frames>().unwrap().to_string(), "7:9:1");
        assert_eq!("0:4294967295".parse::<Frames>().unwrap().len(), 1 << 32);
        for wrong in ["", "5", "3:2", "0:9:0", "0:9:1:1", "-1:3", "a:b"] {
            assert!(wrong.parse::<Frames>().is_err(), "{wrong}");
        }
    }
}
