//! Why a point is there.

/// Why a point is there: the values of the column `cause`. Numbers are explicit and never reused.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
#[non_exhaustive]
pub enum Cause {
    /// A surface that the beam meets.
    #[default]
    Surface = 0,
    /// A surface seen in a mirror.
    Mirror = 1,
    /// A surface seen through glass or water.
    Glass = 2,
    /// A raindrop, or rain.
    Rain = 3,
    /// Fog or spray.
    Fog = 4,
    /// A snowflake, or snowfall.
    Snow = 5,
    /// Dust.
    Dust = 6,
    /// Noise that looks like an echo.
    FalseAlarm = 7,
    /// Several surfaces whose echoes have merged.
    Mixed = 8,
    /// Light that returned by a path other than the one it was emitted along, or leaked into a neighbouring beam.
    Multipath = 9,
    /// The water surface, as a sonar receives it from below.
    SeaSurface = 10,
}

impl Cause {
    /// All causes, each at the index of its number.
    pub const ALL: [Cause; 11] = [
        Cause::Surface,
        Cause::Mirror,
        Cause::Glass,
        Cause::Rain,
        Cause::Fog,
        Cause::Snow,
        Cause::Dust,
        Cause::FalseAlarm,
        Cause::Mixed,
        Cause::Multipath,
        Cause::SeaSurface,
    ];

    /// The cause with the number `number` in the column `cause`.
    pub fn from_number(number: u8) -> Option<Cause> {
        Cause::ALL.get(usize::from(number)).copied()
    }

    /// Whether there is a surface at the end of the path; without one, points have no labels.
    pub fn has_surface(self) -> bool {
        !matches!(self, Cause::Rain | Cause::Fog | Cause::Snow | Cause::Dust | Cause::FalseAlarm | Cause::SeaSurface)
    }

    /// Its display name.
    pub fn name(self) -> &'static str {
        match self {
            Cause::Surface => "surface",
            Cause::Mirror => "mirror",
            Cause::Glass => "glass",
            Cause::Rain => "rain",
            Cause::Fog => "fog",
            Cause::Snow => "snow",
            Cause::Dust => "dust",
            Cause::FalseAlarm => "noise",
            Cause::Mixed => "mixed",
            Cause::Multipath => "multipath",
            Cause::SeaSurface => "sea surface",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn causes_are_at_their_numbers() {
        for (number, cause) in (0..).zip(Cause::ALL) {
            assert_eq!((cause as u8, Cause::from_number(number)), (number, Some(cause)));
        }
        assert_eq!(Cause::from_number(11), None);
        let bare: Vec<u8> =
            Cause::ALL.into_iter().filter(|cause| !cause.has_surface()).map(|cause| cause as u8).collect();
        assert_eq!(bare, [3, 4, 5, 6, 7, 10]);
    }
}
