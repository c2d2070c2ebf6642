//! Values that vary from sample to sample, as written in a scenario file.

use super::draw::{Address, Stream};
use ground::error::{Error, Result, nearest};
use ground::read::yaml;
use rand_distr::{Distribution as _, Normal, StandardUniform, Uniform};
use serde::Deserialize;
use serde::de::{Deserializer, Error as _};
use serde_json::Value;
use std::fmt::Display;

/// A value, the distribution that it is drawn from, or a list of these.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Random {
    /// Always the same.
    Fixed(Value),
    List(Vec<Random>),
    /// Numbers; several axes make a list of numbers.
    Spread {
        kind: ProbabilityLaw,
        /// For each axis, the numbers in the file.
        axes: Vec<Vec<f64>>,
        list: bool,
    },
    /// One of several values, drawn by weight.
    Choice(Vec<(Value, f64)>),
    /// All values in turn; each is kept for `stride` samples, so that several grids run through all combinations.
    Grid {
        values: Vec<Value>,
        stride: u64,
    },
}

/// How numbers are distributed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ProbabilityLaw {
    /// From low to high.
    Uniform,
    /// Mean and standard deviation.
    Normal,
    /// Mean, standard deviation, low and high: values outside are redrawn.
    TruncatedNormal,
    /// From low to high, uniform in the logarithm.
    LogUniform,
    /// From low to high, more evenly than independent random numbers: an Owen-scrambled Sobol sequence over the samples
    /// (Burley 2020, Practical Hash-based Owen Scrambling, JCGT 9(4)). The axes of one list share a multi-dimensional
    /// sequence.
    Sobol,
}

const NAMES: [(&str, ProbabilityLaw); 5] = [
    ("uniform", ProbabilityLaw::Uniform),
    ("normal", ProbabilityLaw::Normal),
    ("truncated_normal", ProbabilityLaw::TruncatedNormal),
    ("log_uniform", ProbabilityLaw::LogUniform),
    ("sobol", ProbabilityLaw::Sobol),
];

/// Beyond this many standard deviations, a normal distribution has nothing left to draw.
const FARTHEST_TAIL: f64 = 30.0;

impl ProbabilityLaw {
    /// Meaning of the numbers in the file.
    fn numbers(self) -> &'static str {
        match self {
            ProbabilityLaw::Uniform | ProbabilityLaw::LogUniform | ProbabilityLaw::Sobol => "[low, high]",
            ProbabilityLaw::Normal => "[mean, sigma]",
            ProbabilityLaw::TruncatedNormal => "[mean, sigma, low, high]",
        }
    }

    fn count(self) -> usize {
        self.numbers().split(',').count()
    }

    /// What is wrong with the numbers of an axis.
    fn fault(self, numbers: &[f64]) -> Option<String> {
        if numbers.len() != self.count() {
            return Some(format!("has {} numbers; allowed: {}", numbers.len(), self.numbers()));
        }
        let ends = |low: f64, high: f64| {
            (low > high).then(|| format!("starts at {low} and ends at {high}; allowed: {}", self.numbers()))
        };
        let sigma = |sigma: f64| (sigma < 0.0).then(|| format!("sigma is {sigma}; allowed: 0 or more"));
        match (self, numbers) {
            (ProbabilityLaw::Uniform | ProbabilityLaw::Sobol, &[low, high]) => ends(low, high),
            (ProbabilityLaw::LogUniform, &[low, high]) => {
                (low <= 0.0).then(|| format!("starts at {low}; allowed: above 0")).or_else(|| ends(low, high))
            }
            (ProbabilityLaw::Normal, &[_, s]) => sigma(s),
            (ProbabilityLaw::TruncatedNormal, &[mean, s, low, high]) => {
                sigma(s).or_else(|| ends(low, high)).or_else(|| {
                    let far = (low - mean).max(mean - high);
                    (far > FARTHEST_TAIL * s || s == 0.0 && far > 0.0).then(|| {
                        format!("has nothing between {low} and {high}; allowed: ends within {FARTHEST_TAIL} sigma")
                    })
                })
            }
            _ => None,
        }
    }

    /// Draws a number from the distribution with the file's `numbers`, for axis `axis` of its list.
    fn draw(self, numbers: &[f64], address: &Address, axis: usize, stream: &mut Stream) -> f64 {
        match (self, numbers) {
            (ProbabilityLaw::Uniform, &[low, high]) => between(low, high, stream),
            (ProbabilityLaw::LogUniform, &[low, high]) => between(low.ln(), high.ln(), stream).exp().clamp(low, high),
            (ProbabilityLaw::Normal, &[mean, sigma]) => {
                Normal::new(mean, sigma).map_or(mean, |normal| normal.sample(stream))
            }
            (ProbabilityLaw::TruncatedNormal, &[mean, sigma, low, high]) if sigma > 0.0 => {
                let [a, b] = [low, high].map(|end| (end - mean) / sigma);
                let z = if b < 0.0 { -tail(-b, -a, stream) } else { tail(a, b, stream) };
                (mean + sigma * z).clamp(low, high)
            }
            (ProbabilityLaw::Sobol, &[low, high]) => low + (high - low) * sobol(address, axis),
            // Of zero width.
            (_, &[mean, ..]) => mean,
            (_, &[]) => f64::NAN,
        }
    }
}

/// The element of this sample, 0 to 1, in the sequence of this address; each address has its own.
fn sobol(address: &Address, axis: usize) -> f64 {
    /// Length of the library's longest sequence; after it another one begins.
    const LENGTH: u32 = 1 << 16;
    /// Maximum number of dimensions of the library.
    const DIMENSIONS: usize = 256;
    let (sample, seed) = address.in_sequence();
    let seed = seed.wrapping_add(sample / LENGTH);
    sobol_burley::sample(sample % LENGTH, (axis % DIMENSIONS) as u32, seed).into()
}

fn between(low: f64, high: f64, stream: &mut Stream) -> f64 {
    Uniform::new_inclusive(low, high).map_or(low, |uniform| uniform.sample(stream))
}

/// A standard normal number from `a` to `b`, `b` not below 0, by rejection sampling (Robert 1995, Simulation of
/// truncated normal variables, Statistics and Computing 5).
fn tail(a: f64, b: f64, stream: &mut Stream) -> f64 {
    /// Number of proposals after which the last is accepted: so many in a row are rejected once in 10^30 draws.
    const TRIES: usize = 400;
    /// Width above which normal proposals are accepted more often than uniform ones.
    const WIDE: f64 = 2.506_628_274_631;
    let unit = |stream: &mut Stream| -> f64 { StandardUniform.sample(stream) };
    let mut z = a.clamp(0.0, b);
    for _ in 0..TRIES {
        let taken = if a <= 0.0 && b - a > WIDE {
            z = rand_distr::StandardNormal.sample(stream);
            (a..=b).contains(&z)
        } else if a > 0.0 && b - a > 1.0 / a {
            z = a - (1.0 - unit(stream) * -(-a * (b - a)).exp_m1()).ln() / a;
            unit(stream) <= (-0.5 * (z - a) * (z - a)).exp()
        } else {
            z = between(a, b, stream);
            let nearest = a.max(0.0);
            unit(stream) <= (0.5 * (nearest * nearest - z * z)).exp()
        };
        if taken {
            return z;
        }
    }
    z.clamp(a, b)
}

impl Random {
    /// Whether every value is a number.
    pub fn is_number(&self) -> bool {
        match self {
            Random::Fixed(value) => value.is_number(),
            Random::List(_) => false,
            Random::Spread { list, .. } => !list,
            Random::Choice(values) => values.iter().all(|(value, _)| value.is_number()),
            Random::Grid { values, .. } => values.iter().all(Value::is_number),
        }
    }

    /// Whether every value is a list of three numbers.
    pub fn is_vector(&self) -> bool {
        let is = |value: &Value| value.as_array().is_some_and(|it| it.len() == 3 && it.iter().all(Value::is_number));
        match self {
            Random::Fixed(value) => is(value),
            Random::List(items) => items.len() == 3 && items.iter().all(Random::is_number),
            Random::Spread { list, axes, .. } => *list && axes.len() == 3,
            Random::Choice(values) => values.iter().all(|(value, _)| is(value)),
            Random::Grid { values, .. } => values.iter().all(is),
        }
    }

    /// Gives every grid in it its stride: the first advances with every sample, each further one when all before it
    /// have wrapped around.
    pub fn number_grids(&mut self, next: &mut u64) {
        match self {
            Random::List(items) => items.iter_mut().for_each(|item| item.number_grids(next)),
            Random::Grid { values, stride } => {
                *stride = *next;
                *next = next.saturating_mul(values.len() as u64);
            }
            _ => {}
        }
    }

    /// The value at `address`.
    pub fn draw(&self, address: &Address) -> Value {
        match self {
            Random::Fixed(value) => value.clone(),
            Random::List(items) => items.iter().enumerate().map(|(k, item)| item.draw(&address.at(k))).collect(),
            Random::Spread { kind, axes, list } => {
                let mut stream = address.stream();
                let mut axis = |(k, numbers): (usize, &Vec<f64>)| kind.draw(numbers, address, k, &mut stream);
                if *list {
                    axes.iter().enumerate().map(axis).collect()
                } else {
                    axes.first().map_or(Value::Null, |numbers| axis((0, numbers)).into())
                }
            }
            Random::Choice(values) => choose(values, address).clone(),
            Random::Grid { values, stride } => {
                values[(u64::from(address.sample()) / stride % values.len() as u64) as usize].clone()
            }
        }
    }

    /// The number at `address`.
    pub fn number(&self, address: &Address) -> f64 {
        self.draw(address).as_f64().unwrap_or(f64::NAN)
    }

    /// The three numbers at `address`.
    pub fn vector(&self, address: &Address) -> [f64; 3] {
        let value = self.draw(address);
        std::array::from_fn(|axis| value.get(axis).and_then(Value::as_f64).unwrap_or(f64::NAN))
    }

    /// The whole number at `address`: in a range from low to high, both ends and all numbers between are equally
    /// likely; other distributions are rounded.
    pub fn whole(&self, address: &Address) -> i64 {
        let number = match self {
            Random::Spread { kind: ProbabilityLaw::Uniform | ProbabilityLaw::Sobol, axes, list: false }
                if axes[0].len() == 2 =>
            {
                let [low, high] = [axes[0][0].ceil(), axes[0][1].floor()];
                let wider = Random::Spread {
                    kind: self.kind().unwrap_or(ProbabilityLaw::Uniform),
                    axes: vec![vec![low, high + 1.0]],
                    list: false,
                };
                wider.number(address).floor().clamp(low, high.max(low))
            }
            other => other.number(address).round(),
        };
        number as i64
    }

    fn kind(&self) -> Option<ProbabilityLaw> {
        match self {
            Random::Spread { kind, .. } => Some(*kind),
            _ => None,
        }
    }
}

/// One of `values`, drawn by weight.
pub(super) fn choose<'v, T>(values: &'v [(T, f64)], address: &Address) -> &'v T {
    let whole: f64 = values.iter().map(|(_, weight)| weight).sum();
    let mut left = between(0.0, whole, &mut address.stream());
    let found = values.iter().find(|(_, weight)| {
        left -= weight;
        left < 0.0
    });
    // Rounding may leave a little over.
    let last = || values.iter().rfind(|(_, weight)| *weight > 0.0);
    &found.or_else(last).unwrap_or(&values[0]).0
}

impl<'de> Deserialize<'de> for Random {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        read(Value::deserialize(deserializer)?).map_err(D::Error::custom)
    }
}

/// A value of a scenario file, or what is wrong with it, after the key that it concerns.
fn read(value: Value) -> Result<Random, String> {
    match value {
        Value::Array(items) => {
            // A list without anything random is a value.
            if items.iter().all(|item| !item.is_object()) {
                return Ok(Random::Fixed(Value::Array(items)));
            }
            let item = |(index, item)| read(item).map_err(|fault| format!("[{index}]{}{fault}", separator(&fault)));
            items.into_iter().enumerate().map(item).collect::<Result<_, _>>().map(Random::List)
        }
        Value::Object(mut keys) => {
            let known = || NAMES.iter().map(|(name, _)| *name).chain(["choice", "grid"]);
            let Some(key) = keys.keys().next().filter(|_| keys.len() == 1).cloned() else {
                let found = keys.keys().map(String::as_str).collect::<Vec<_>>().join(", ");
                return Err(format!("a distribution has one key, not {}: {found}", keys.len()));
            };
            let inner = keys.shift_remove(&key).unwrap_or_default();
            let of_key = |fault: String| format!("{key}{}{fault}", separator(&fault));
            match key.as_str() {
                "choice" => choices(inner).map(Random::Choice).map_err(of_key),
                "grid" => match inner {
                    Value::Array(values) if !values.is_empty() => Ok(Random::Grid { values, stride: 1 }),
                    _ => Err(of_key(": expected a list of values".into())),
                },
                _ => match NAMES.iter().find(|(name, _)| *name == key) {
                    Some((_, kind)) => spread(*kind, &inner).map_err(of_key),
                    None => {
                        let names: Vec<&str> = known().collect();
                        let near = nearest(&key, &names);
                        let near = if near.is_empty() { String::new() } else { format!("; near: {}", near.join(", ")) };
                        Err(of_key(format!(": is not a distribution{near}; allowed: {}", names.join(", "))))
                    }
                },
            }
        }
        value => Ok(Random::Fixed(value)),
    }
}

/// Separator between a key and the fault of its value, which may begin with a further key.
fn separator(fault: &str) -> &'static str {
    if fault.starts_with([':', '[', '.']) { "" } else { ": " }
}

/// Values with their weights: a list of values, or of `{value, weight}`.
fn choices(value: Value) -> Result<Vec<(Value, f64)>, String> {
    #[derive(Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Weighted {
        value: Value,
        weight: f64,
    }
    let Value::Array(items) = value else { return Err(": expected a list of values, or of {value, weight}".into()) };
    let choice = |(index, item): (usize, Value)| {
        if item.get("weight").is_none() {
            return Ok((item, 1.0));
        }
        let Weighted { value, weight } =
            Weighted::deserialize(item).map_err(|error| format!("[{index}]: {}", yaml::plain(&error.to_string())))?;
        if (0.0..=1e12).contains(&weight) {
            Ok((value, weight))
        } else {
            Err(format!("[{index}].weight: is {weight}; allowed: 0 to 1e12"))
        }
    };
    let choices: Vec<_> = items.into_iter().enumerate().map(choice).collect::<Result<_, _>>()?;
    match choices.iter().any(|(_, weight)| *weight > 0.0) {
        true => Ok(choices),
        false => Err(": has nothing to choose from; allowed: one value or more, with a weight above 0".into()),
    }
}

/// Numbers of a spread: for one axis, `[0, 1]`, or for several, `[[0, 0, 0], [1, 1, 2]]`.
fn spread(kind: ProbabilityLaw, value: &Value) -> Result<Random, String> {
    let wrong = || format!(": expected {}, or a list for each of these", kind.numbers());
    let items = value.as_array().ok_or_else(wrong)?;
    let list = items.iter().any(Value::is_array);
    let columns: Vec<Vec<f64>> = items
        .iter()
        .map(|item| match item {
            Value::Array(axes) if list => axes.iter().map(Value::as_f64).collect(),
            item if !list => item.as_f64().map(|number| vec![number]),
            _ => None,
        })
        .collect::<Option<_>>()
        .ok_or_else(wrong)?;
    let length = columns.first().map_or(0, Vec::len);
    if length == 0 || columns.iter().any(|column| column.len() != length) {
        return Err(wrong());
    }
    let axes: Vec<Vec<f64>> = (0..length).map(|axis| columns.iter().map(|column| column[axis]).collect()).collect();
    match axes.iter().find_map(|numbers| kind.fault(numbers)) {
        Some(fault) => Err(format!(": {fault}")),
        None => Ok(Random::Spread { kind, axes, list }),
    }
}

/// Checks that all values at `key` are from `low` to `high`, as far as their distribution is bounded.
pub(super) fn check_range(key: impl Display, random: &Random, low: f64, high: f64) -> Result<()> {
    let outside = |value: &f64| !(low..=high).contains(value);
    let found = match random {
        Random::Spread { kind: ProbabilityLaw::Normal, .. } | Random::List(_) => None,
        Random::Spread { kind: ProbabilityLaw::TruncatedNormal, axes, .. } => {
            axes.iter().flat_map(|n| n[2..].to_vec()).find(outside)
        }
        Random::Spread { axes, .. } => axes.iter().flatten().copied().find(outside),
        Random::Fixed(value) => value.as_f64().filter(outside),
        Random::Choice(values) => values.iter().filter_map(|(value, _)| value.as_f64()).find(outside),
        Random::Grid { values, .. } => values.iter().filter_map(Value::as_f64).find(outside),
    };
    found.map_or(Ok(()), |found| Err(Error::invalid(key.to_string(), found, format!("{low} to {high}"))))
}

#[cfg(test)]
mod tests {
    use super::super::draw::Draws;
    use super::*;

    fn random(text: &str) -> Random {
        yaml::from_str("text", text).unwrap()
    }

    fn numbers(text: &str, count: u32) -> Vec<f64> {
        let random = random(text);
        (0..count).map(|sample| random.number(&Draws::new(11, sample).of("test"))).collect()
    }

    /// Kolmogorov-Smirnov distance of the numbers' distribution from `cdf`, as a multiple of that which one sample in a
    /// million exceeds.
    fn far(mut numbers: Vec<f64>, cdf: impl Fn(f64) -> f64) -> f64 {
        numbers.sort_by(f64::total_cmp);
        let n = numbers.len() as f64;
        let distance = |(k, &x): (usize, &f64)| (cdf(x) - k as f64 / n).abs().max((cdf(x) - (k + 1) as f64 / n).abs());
        let most = numbers.iter().enumerate().map(distance).fold(0.0, f64::max);
        // P(D > d) is about 2 exp(-2 n d^2).
        most / (0.5 * (2e6_f64).ln() / n).sqrt()
    }

    /// By Simpson's rule.
    fn normal_cdf(x: f64) -> f64 {
        let density = |z: f64| (-0.5 * z * z).exp() / std::f64::consts::TAU.sqrt();
        let (n, from) = (400, -9.0);
        let step = (x.max(from) - from) / f64::from(n);
        let weight = |k: i32| if k == 0 || k == n { 1.0 } else { 2.0 + 2.0 * f64::from(k % 2) };
        (0..=n).map(|k| weight(k) * density(from + f64::from(k) * step)).sum::<f64>() * step / 3.0
    }

    #[test]
    fn distributions_are_what_they_are_called() {
        let n = 20_000;
        assert!(far(numbers("{uniform: [-2, 6]}", n), |x| (x + 2.0) / 8.0) < 1.0);
        assert!(far(numbers("{normal: [5, 2]}", n), |x| normal_cdf((x - 5.0) / 2.0)) < 1.0);
        assert!(far(numbers("{log_uniform: [0.1, 1000]}", n), |x| (x / 0.1).log10() / 4.0) < 1.0);
        // Both kinds of proposals, and both tails.
        for [mean, sigma, low, high] in [
            [0.0, 1.0, -2.0, 2.0],
            [0.0, 1.0, -0.5, 0.7],
            [0.0, 1.0, 0.2, 0.9],
            [1.0, 2.0, 4.0, 40.0],
            [0.0, 1.0, -30.0, -2.5],
            [3.0, 0.5, 2.9, 3.0],
        ] {
            let text = format!("{{truncated_normal: [{mean}, {sigma}, {low}, {high}]}}");
            let at = |x: f64| normal_cdf((x - mean) / sigma);
            let drawn = numbers(&text, n);
            assert!(drawn.iter().all(|x| (low..=high).contains(x)), "{text}");
            assert!(far(drawn, |x| (at(x) - at(low)) / (at(high) - at(low))) < 1.0, "{text}");
        }
        let drawn = numbers("{choice: [{value: 1, weight: 3}, {value: 2, weight: 1}, {value: 3, weight: 0}, 4]}", n);
        for (value, share) in [(1.0, 0.6), (2.0, 0.2), (3.0, 0.0), (4.0, 0.2)] {
            let count = drawn.iter().filter(|x| **x == value).count() as f64;
            assert!((count / f64::from(n) - share).abs() < 0.02, "{value}: {count}");
        }
    }

    #[test]
    fn sobol_numbers_are_spread_evenly() {
        // Of each 64 samples, counted from the first, one is in each 64th of the range.
        let drawn = numbers("{sobol: [10, 74]}", 256);
        for part in drawn.chunks(64) {
            let mut cells: Vec<u32> = part.iter().map(|x| (x - 10.0) as u32).collect();
            cells.sort_unstable();
            assert_eq!(cells, (0..64).collect::<Vec<_>>());
        }
        // The axes of one list together: of 64 samples, one in each of 8 by 8 squares; other addresses are independent.
        let both = random("{sobol: [[0, 0], [8, 8]]}");
        let mut cells: Vec<[u64; 2]> = (0..64)
            .map(|sample| both.draw(&Draws::new(3, sample).of("here")))
            .map(|value| [0, 1].map(|axis| value[axis].as_f64().unwrap() as u64))
            .collect();
        cells.sort_unstable();
        cells.dedup();
        assert_eq!(cells.len(), 64);
        let one = random("{sobol: [0, 1]}");
        let at = |name: &str| (0..64).map(|s| one.number(&Draws::new(3, s).of(name))).collect::<Vec<_>>();
        assert_ne!(at("a"), at("b"));
        assert!(one.number(&Draws::new(3, 1 << 17).of("a")) != one.number(&Draws::new(3, 0).of("a")));
    }

    #[test]
    fn grids_go_through_all_combinations() {
        let mut list = random("[{grid: [a, b, c]}, 5, {grid: [{x: 1}, 2]}]");
        let mut next = 1;
        list.number_grids(&mut next);
        assert_eq!(next, 6);
        let mut drawn: Vec<String> =
            (0..6).map(|sample| list.draw(&Draws::new(1, sample).of("g")).to_string()).collect();
        assert_eq!(&drawn[..2], [r#"["a",5,{"x":1}]"#, r#"["b",5,{"x":1}]"#]);
        drawn.sort();
        drawn.dedup();
        assert_eq!(drawn.len(), 6);
    }

    #[test]
    fn whole_numbers_are_all_as_frequent() {
        for text in ["{uniform: [2, 5]}", "{sobol: [2, 5]}"] {
            let random = random(text);
            let mut counts = [0; 8];
            (0..8000).for_each(|s| counts[random.whole(&Draws::new(5, s).of("n")) as usize] += 1);
            assert_eq!((counts[..2].iter().sum::<i32>(), counts[6..].iter().sum::<i32>()), (0, 0));
            assert!(counts[2..6].iter().all(|count| (1850..2150).contains(count)), "{text} {counts:?}");
        }
        let whole = |text: &str| random(text).whole(&Draws::new(5, 0).of("n"));
        assert_eq!((whole("3"), whole("2.6"), whole("{choice: [7]}"), whole("{uniform: [4, 4]}")), (3, 3, 7, 4));
    }

    #[test]
    fn errors_are_reported_with_their_key() {
        #[derive(Debug, Deserialize)]
        #[allow(dead_code)]
        struct File {
            at: Random,
        }
        for (text, fault) in [
            ("at: {uniform: [5, 1]}", "starts at 5 and ends at 1; allowed: [low, high]"),
            ("at: {uniform: 3}", "expected [low, high], or a list for each of these"),
            ("at: {uniform: [1, 2, 3]}", "has 3 numbers; allowed: [low, high]"),
            ("at: {normal: [1, -2]}", "sigma is -2; allowed: 0 or more"),
            ("at: {log_uniform: [0, 2]}", "starts at 0; allowed: above 0"),
            ("at: {truncated_normal: [0, 1, 50, 60]}", "has nothing between 50 and 60; allowed: ends within 30 sigma"),
            ("at: {unifrom: [1, 2]}", "is not a distribution; near: uniform"),
            ("at: {choice: []}", "has nothing to choose from"),
            ("at: {choice: [{value: 1, weight: -1}]}", "is -1; allowed: 0 to 1e12"),
            ("at: {grid: []}", "expected a list of values"),
            ("at: {uniform: [0, 1], normal: [0, 1]}", "a distribution has one key, not 2: uniform, normal"),
            ("at: [0, {uniform: [5, 1]}, 0]", "starts at 5 and ends at 1; allowed: [low, high]"),
        ] {
            let error = yaml::from_str::<File>("file", text).unwrap_err().to_string();
            assert!(error.starts_with("file: line 1: at") && error.contains(fault), "{error}");
        }
        let range = |text: &str| check_range("chance", &random(text), 0.0, 1.0).map_err(|error| error.to_string());
        assert_eq!(range("{uniform: [0, 2]}").unwrap_err(), "chance is 2; allowed: 0 to 1");
        assert!(range("{truncated_normal: [9, 9, 0, 1]}").is_ok() && range("0.3").is_ok() && range("-1").is_err());
    }
}
