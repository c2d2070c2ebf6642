//! Why a point is there.

/// Why a point is there: the values of the column `cause`. Numbers are written out and never reused.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Cause {
    /// A surface that the beam meets.
    #[default]
    Surface = 0,
    /// A surface seen in a mirror.
    Mirror = 1,
    /// A surface seen through glass or water.
    Glass = 2,
    /// A rain drop, or rain.
    Rain = 3,
    /// Fog or spray.
    Fog = 4,
    /// A flake of snow, or snowfall.
    Snow = 5,
    /// Dust.
    Dust = 6,
    /// Noise that looks like an echo.
    FalseAlarm = 7,
    /// Several surfaces whose echoes are one.
    Mixed = 8,
    /// Light that went another way back than there.
    Multipath = 9,
}

impl Cause {
    /// Its name for people.
    pub fn name(self) -> &'static str {
        match self {
            Cause::Surface => "surface",
            Cause::Mirror => "mirror",
            Cause::Glass => "glass",
            Cause::Rain => "rain",
            Cause::Fog => "fog",
            Cause::Snow => "snow",
            Cause::Dust => "dust",
            Cause::FalseAlarm => "false alarm",
            Cause::Mixed => "mixed",
            Cause::Multipath => "multipath",
        }
    }
}
