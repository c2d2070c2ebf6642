//! Multiple time around: echoes that arrive after the next pulse has been fired.

use ground::units::SPEED_OF_LIGHT;
use serde::{Deserialize, Serialize};

/// What an instrument makes of echoes that arrive after its next pulse. Those that arrive within `range.blind_m` of a
/// pulse are lost to it, except in `truth`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum MultipleTimeAround {
    /// It knows which pulse they belong to, and is never blind.
    #[default]
    Truth,
    /// It takes them for echoes of the last pulse before they arrive: shorter by multiples of `c / (2 PRF)`, and in the
    /// direction of that pulse.
    Folded,
    /// It finds out which pulse they belong to.
    Resolved,
}

/// How an instrument assigns echoes to pulses that it fires at an even rate.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PulseAssignment {
    /// Range whose echo arrives with the next pulse, m.
    unambiguous: f32,
    /// Echoes closer to a pulse than this are lost, m of range.
    blind: f32,
    /// Whether echoes are taken for those of the last pulse.
    pub folds: bool,
    /// Whether no pulses are fired between lines.
    pub pauses: bool,
}

impl PulseAssignment {
    /// For `pulse_rate` pulses per second, about which an instrument is blind for `blind` m; `None`: pulses play no part.
    /// `pauses`: whether no pulses are fired between lines.
    pub(crate) fn new(mode: MultipleTimeAround, pulse_rate: f64, blind: f64, pauses: bool) -> Option<PulseAssignment> {
        (mode != MultipleTimeAround::Truth).then_some(PulseAssignment {
            unambiguous: (0.5 * SPEED_OF_LIGHT / pulse_rate) as f32,
            blind: blind as f32,
            folds: mode == MultipleTimeAround::Folded,
            pauses,
        })
    }

    /// By how many pulses an echo from `range` m is late, and the range from the last of them, m, if `left` pulses follow
    /// its own before the laser pauses; `None`: it is lost.
    pub(crate) fn assign(self, range: f32, left: u32) -> Option<(u32, f32)> {
        let pulses = ((range / self.unambiguous) as u32).min(left);
        let after = range - pulses as f32 * self.unambiguous;
        let before = if pulses < left { self.unambiguous - after } else { f32::INFINITY };
        let is_lost = (pulses > 0 && after < self.blind) || before < self.blind;
        (!is_lost).then_some((pulses, after))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// From 1000 m: at 1 MHz six pulses are in the air, and the range is folded to 100.6226 m; at 2 MHz thirteen and
    /// 25.67451 m; at 300 kHz two, and 0.691807 m, where the instrument is blind.
    #[test]
    fn ranges_fold_at_the_rate_of_pulses() {
        let of = |rate, blind| PulseAssignment::new(MultipleTimeAround::Folded, rate, blind, true).unwrap();
        for (rate, pulses, folded) in [(1e6, 6, 100.6226), (2e6, 13, 25.674_51), (300e3, 2, 0.691_807)] {
            let (late, after) = of(rate, 0.5).assign(1000.0, 100).unwrap();
            assert_eq!(late, pulses);
            assert!((after - folded).abs() < 2e-4, "{after}");
        }
        assert_eq!(of(300e3, 1.5).assign(1000.0, 100), None);
        assert_eq!(of(300e3, 1.5).assign(499.0, 100), None);
        // After the last pulse of a line nothing blinds it, and later ones do not exist.
        assert_eq!(of(300e3, 1.5).assign(499.0, 0), Some((0, 499.0)));
        assert_eq!(of(1e6, 1.5).assign(1000.0, 2).unwrap().0, 2);
        assert!(PulseAssignment::new(MultipleTimeAround::Truth, 1e6, 1.0, true).is_none());
    }
}
