//! Splits of a set for training, validation and testing.

use super::draw::Draws;
use rand_core::Rng as _;
use serde::de::{Deserialize, Deserializer, Error};
use serde_json::Value;

/// Names of the splits, with their shares: numbers of any sum.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Splits(Vec<(String, f64)>);

/// Names of shares given without names.
const NAMES: [&str; 3] = ["train", "val", "test"];

/// Allowed values, for messages.
const ALLOWED: &str = "shares such as 80/10/10 (train, val, test), or with names such as {train: 80, test: 20}";

impl<'de> Deserialize<'de> for Splits {
    /// `80/10/10` or `{train: 80, val: 10, test: 10}`; empty for a set that is not split.
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let value = Value::deserialize(deserializer)?;
        let wrong = || D::Error::custom(format!("is {value}; allowed: {ALLOWED}"));
        let all: Vec<(String, f64)> = match &value {
            Value::Null => return Ok(Splits::default()),
            Value::String(shares) => {
                let shares: Result<Vec<f64>, _> = shares.split('/').map(|share| share.trim().parse()).collect();
                let shares =
                    shares.ok().filter(|shares| (2..=NAMES.len()).contains(&shares.len())).ok_or_else(wrong)?;
                NAMES.iter().map(|name| (*name).to_owned()).zip(shares).collect()
            }
            Value::Object(shares) => {
                let share = |(name, share): (&String, &Value)| Some((name.clone(), share.as_f64()?));
                shares.iter().map(share).collect::<Option<_>>().ok_or_else(wrong)?
            }
            _ => return Err(wrong()),
        };
        // Names become file names.
        let named =
            |name: &str| !name.is_empty() && name.chars().all(|c| c.is_ascii_alphanumeric() || "_-".contains(c));
        let sum: f64 = all.iter().map(|(_, share)| share).sum();
        if !(all.iter().all(|(name, share)| named(name) && *share >= 0.0) && sum > 0.0 && sum.is_finite()) {
            return Err(wrong());
        }
        Ok(Splits(all))
    }
}

impl Splits {
    /// Whether the set is not split.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Names of the splits; `train` for a set that is not split.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        let one = self.0.is_empty().then_some(NAMES[0]);
        self.0.iter().map(|(name, _)| name.as_str()).chain(one)
    }

    /// The split of a sample of a scenario with this `seed`: drawn for each sample by itself, so that it stays in its
    /// split when others are added.
    pub fn of(&self, seed: u64, sample: u64) -> &str {
        // Sample numbers have 32 bits.
        let drawn = Draws::new(seed, sample as u32).of("set.splits").stream().next_u64();
        let sum: f64 = self.0.iter().map(|(_, share)| share).sum();
        let mut left = (drawn >> 11) as f64 / (1_u64 << 53) as f64 * sum;
        for (name, share) in &self.0 {
            if left < *share {
                return name;
            }
            left -= share;
        }
        self.0.iter().rev().find(|(_, share)| *share > 0.0).map_or(NAMES[0], |(name, _)| name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn splits(value: Value) -> Splits {
        serde_json::from_value(value).unwrap()
    }

    #[test]
    fn parts_have_their_shares() {
        let all = splits(json!("80/15/5"));
        assert_eq!(all, splits(json!({"train": 80, "val": 15, "test": 5})));
        for seed in [0, 7, 1 << 40] {
            let count = |name: &str| (0..20_000).filter(|&sample| all.of(seed, sample) == name).count() as f64;
            for (name, share) in [("train", 0.8), ("val", 0.15), ("test", 0.05)] {
                // Four standard deviations of a binomial distribution.
                let allowed = 4.0 * f64::sqrt(20_000.0 * share * (1.0 - share));
                assert!((count(name) - 20_000.0 * share).abs() < allowed, "{seed} {name}: {}", count(name));
            }
        }
    }

    #[test]
    fn samples_stay_where_they_are() {
        // Existing sets have these splits: they must never change.
        let all = splits(json!("80/10/10"));
        let first: String = (0..40).map(|sample| &all.of(1, sample)[..2]).collect::<Vec<_>>().concat();
        assert_eq!(first, "trvatrtetrvatrtrtrtrtetrtrtrtrtrtrtrtrtrtrtrvatrtrtrtrtrtrtrtetrvatrtrtrtrtrvatr");
        // A split that grows takes from those after it.
        let more = splits(json!("90/10"));
        assert!((0..1000).all(|sample| all.of(1, sample) != "train" || more.of(1, sample) == "train"));
        assert_eq!(Splits::default().of(1, 3), "train");
        assert_eq!(Splits::default().names().collect::<Vec<_>>(), ["train"]);
        assert!((0..1000).all(|sample| splits(json!({"a": 1, "none": 0})).of(1, sample) == "a"));
    }

    #[test]
    fn other_shares_are_refused() {
        for value in [
            json!("80"),
            json!("80/10/5/5"),
            json!("80/-1"),
            json!("a/b"),
            json!("nan/1"),
            json!("inf/1"),
            json!(80),
            json!({}),
            json!({"a/b": 1}),
            json!({"a": 0}),
            json!({"a": "many"}),
        ] {
            let error = serde_json::from_value::<Splits>(value.clone()).unwrap_err().to_string();
            assert!(error.contains("allowed: shares such as 80/10/10"), "{value}: {error}");
        }
    }
}
