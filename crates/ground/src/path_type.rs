//! How the wave of a radar detection travelled.

/// How the wave of a radar detection travelled: the values of the column `path`. Numbers are explicit and never reused.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
#[non_exhaustive]
pub enum PathType {
    /// To the target and straight back.
    #[default]
    Direct = 0,
    /// By the ground, one way or both.
    Ground = 1,
    /// By a wall or another large mirror: a ghost, elsewhere than the target.
    Wall = 2,
    /// From one part of a target to another, such as in a corner.
    Internal = 3,
    /// The target of another direction, range or velocity, seen in a side lobe.
    SideLobe = 4,
    /// A target beyond what the waveform or the array can tell apart, folded into it.
    Alias = 5,
    /// Another transmitter.
    Interference = 6,
    /// Noise that looks like an echo.
    Noise = 7,
}

impl PathType {
    /// All types, each at the index of its number.
    pub const ALL: [PathType; 8] = [
        PathType::Direct,
        PathType::Ground,
        PathType::Wall,
        PathType::Internal,
        PathType::SideLobe,
        PathType::Alias,
        PathType::Interference,
        PathType::Noise,
    ];

    /// The type with the number `number` in the column `path`.
    pub fn from_number(number: u8) -> Option<PathType> {
        PathType::ALL.get(usize::from(number)).copied()
    }

    /// Its display name.
    pub fn name(self) -> &'static str {
        match self {
            PathType::Direct => "direct",
            PathType::Ground => "ground",
            PathType::Wall => "wall",
            PathType::Internal => "internal",
            PathType::SideLobe => "side lobe",
            PathType::Alias => "alias",
            PathType::Interference => "interference",
            PathType::Noise => "noise",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn types_are_at_their_numbers() {
        for (number, path) in (0..).zip(PathType::ALL) {
            assert_eq!((path as u8, PathType::from_number(number)), (number, Some(path)));
        }
        assert_eq!(PathType::from_number(8), None);
    }
}
