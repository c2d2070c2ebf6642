//! Which of its echoes a beam reports.

use crate::echo::Peak;
use ground::named;
use serde::{Deserialize, Serialize};

/// Which echoes of a beam are reported.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum ReturnMode {
    /// The strongest echo.
    #[default]
    Strongest,
    /// The nearest echo.
    First,
    /// The farthest echo.
    Last,
    /// The second strongest echo; the only one if there is just one.
    Second,
    /// Two: the strongest echo, or the second strongest if the strongest is also the farthest, and then the farthest. A
    /// single echo is reported twice (Velodyne's manuals, chapter on return modes).
    Dual,
    /// The strongest echoes, up to the greatest number, nearest first.
    All,
}

named! { ReturnMode: Strongest "strongest", First "first", Last "last", Second "second", Dual "dual", All "all" }

impl ReturnMode {
    /// How much it prefers an echo of `power`, 1/m^2, from `range` m, where only one is reported: the one that it
    /// prefers most.
    pub(crate) fn merit(self, range: f32, power: f32) -> f32 {
        match self {
            ReturnMode::First => -range,
            ReturnMode::Last => range,
            _ => power,
        }
    }

    /// Whether only the strongest echo can be reported.
    pub(crate) fn is_by_power(self) -> bool {
        !matches!(self, ReturnMode::First | ReturnMode::Last)
    }

    /// Whether echoes other than the one it prefers most may be reported.
    pub(crate) fn reports_others(self) -> bool {
        matches!(self, ReturnMode::Second | ReturnMode::Dual | ReturnMode::All)
    }
}

/// Which echoes of a beam an instrument reports.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct ReturnRule {
    pub mode: ReturnMode,
    /// Greatest number in mode `all`.
    pub max: usize,
    /// Of echoes closer together than this, m, only the strongest is detected.
    pub separation: f32,
}

impl ReturnRule {
    /// Greatest number of returns of a beam.
    pub fn most(&self) -> usize {
        match self.mode {
            ReturnMode::Dual => 2,
            ReturnMode::All => self.max,
            _ => 1,
        }
    }

    /// How often a single echo is reported.
    pub(crate) fn copies(&self) -> usize {
        if self.mode == ReturnMode::Dual { 2 } else { 1 }
    }

    /// Indices of those `echoes` that are reported, in the order of reporting; `echoes` are detected and in ascending
    /// range. `order` is working memory.
    pub fn choose(&self, echoes: &[Peak], order: &mut Vec<usize>, chosen: &mut Vec<usize>) {
        chosen.clear();
        order.clear();
        order.extend(0..echoes.len());
        // The nearer of two equally strong ones comes first.
        order.sort_unstable_by(|&a, &b| echoes[b].power.total_cmp(&echoes[a].power).then(a.cmp(&b)));
        if self.separation > 0.0 {
            let mut kept = 0;
            for place in 0..order.len() {
                let range = echoes[order[place]].range;
                if order[..kept].iter().all(|&other| (echoes[other].range - range).abs() >= self.separation) {
                    order[kept] = order[place];
                    kept += 1;
                }
            }
            order.truncate(kept);
        }
        let [strongest, ..] = order[..] else { return };
        let last = order.iter().copied().max().unwrap_or(strongest);
        let second = order.get(1).copied().unwrap_or(strongest);
        match self.mode {
            ReturnMode::Strongest => chosen.push(strongest),
            ReturnMode::First => chosen.extend(order.iter().min()),
            ReturnMode::Last => chosen.push(last),
            ReturnMode::Second => chosen.push(second),
            ReturnMode::Dual => chosen.extend([if strongest == last { second } else { strongest }, last]),
            ReturnMode::All => {
                chosen.extend(order.iter().take(self.max));
                chosen.sort_unstable();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ranges of the returns of echoes at 5, 6, 6.5 and 20 m.
    fn choose(mode: ReturnMode, max: usize, separation: f32, powers: &[f32]) -> Vec<f32> {
        let echoes: Vec<Peak> = ([5.0, 6.0, 6.5, 20.0].iter().zip(powers))
            .filter(|(_, power)| **power > 0.0)
            .map(|(&range, &power)| Peak { range, power })
            .collect();
        let (mut order, mut chosen) = (Vec::new(), vec![7]);
        let rule = ReturnRule { mode, max, separation };
        rule.choose(&echoes, &mut order, &mut chosen);
        assert!(chosen.len() <= rule.most());
        chosen.into_iter().map(|place| echoes[place].range).collect()
    }

    #[test]
    fn modes_choose_as_they_say() {
        use ReturnMode::*;
        let powers = [0.2, 0.9, 0.5, 0.4];
        for (mode, expected) in [
            (Strongest, &[6.0][..]),
            (First, &[5.0]),
            (Last, &[20.0]),
            (Second, &[6.5]),
            (Dual, &[6.0, 20.0]),
            (All, &[6.0, 6.5, 20.0]),
        ] {
            assert_eq!(choose(mode, 3, 0.0, &powers), expected, "{mode:?}");
            assert_eq!(choose(mode, 3, 0.0, &[]), [] as [f32; 0], "{mode:?}");
        }
        assert_eq!(choose(All, 9, 0.0, &powers), [5.0, 6.0, 6.5, 20.0]);
    }

    /// Block A holds the strongest return, or the second strongest if the strongest is also the last; block B the last;
    /// both hold a single one.
    #[test]
    fn dual_returns_follow_the_makers_rule() {
        assert_eq!(choose(ReturnMode::Dual, 2, 0.0, &[0.3, 0.1, 0.0, 0.9]), [5.0, 20.0]);
        assert_eq!(choose(ReturnMode::Dual, 2, 0.0, &[0.3, 0.1, 0.0, 0.2]), [5.0, 20.0]);
        assert_eq!(choose(ReturnMode::Dual, 2, 0.0, &[0.0, 0.0, 0.0, 0.2]), [20.0, 20.0]);
        assert_eq!(choose(ReturnMode::Second, 1, 0.0, &[0.0, 0.0, 0.4]), [6.5]);
    }

    #[test]
    fn near_the_stronger_a_weaker_echo_is_not_seen() {
        let powers = [0.2, 0.9, 0.5, 0.4];
        assert_eq!(choose(ReturnMode::All, 9, 1.0, &powers), [5.0, 6.0, 20.0]);
        assert_eq!(choose(ReturnMode::All, 9, 1.1, &powers), [6.0, 20.0]);
        assert_eq!(choose(ReturnMode::Last, 1, 100.0, &powers), [6.0]);
    }

    /// Of two equally strong echoes the nearer counts as the strongest.
    #[test]
    fn ties_go_to_the_nearer() {
        assert_eq!(choose(ReturnMode::Strongest, 1, 0.0, &[0.0, 0.5, 0.5, 0.5]), [6.0]);
        assert_eq!(choose(ReturnMode::All, 2, 0.0, &[0.0, 0.5, 0.5, 0.5]), [6.0, 6.5]);
    }
}
