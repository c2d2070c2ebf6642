//! Sets of models: ours, and those of the paper that the library started from.

use crate::named;

/// The set of models that a scan uses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Profile {
    /// Physical models.
    #[default]
    Physical,
    /// The equations of the paper as printed; glass is physical. Sonars produce clouds, and no pings.
    Paper,
    /// As computed by the paper's program; total internal reflection in glass is physical. Sonars as with `Paper`.
    Blainder,
}

named! { Profile: Physical "physical", Paper "paper", Blainder "blainder" }

impl Profile {
    /// The one of three values that is for this profile: `physical`, that of the equations as `printed`, and that of the
    /// `program`.
    #[doc(hidden)]
    pub fn choose<T>(self, physical: T, printed: T, program: T) -> T {
        match self {
            Profile::Physical => physical,
            Profile::Paper => printed,
            Profile::Blainder => program,
        }
    }

    /// Whether the paper's equations replace ours: rain, glass by lengths, no instrument that sees its own reflection,
    /// no depth camera.
    #[doc(hidden)]
    pub fn is_paper(self) -> bool {
        self != Profile::Physical
    }

    /// Whether those are computed as by the paper's program: its limits, one ray and one return per beam, no echoes of
    /// the air, and undetected echoes are kept.
    #[doc(hidden)]
    pub fn is_program(self) -> bool {
        self == Profile::Blainder
    }
}
