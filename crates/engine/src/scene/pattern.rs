//! Patterns of names: `*` and `?`, as in a shell.

use ground::error::nearest;
use std::collections::BTreeSet;

/// Shell-style match: `*` any run of characters, `?` any one; a pattern without capitals matches capitals, too.
pub fn matches(pattern: &str, name: &str) -> bool {
    let any_case = !has_capitals(pattern);
    let letters = name.chars().flat_map(|c| {
        let same = [c].into_iter().filter(move |_| !any_case);
        same.chain(c.to_lowercase().filter(move |_| any_case))
    });
    let (pattern, name): (Vec<char>, Vec<char>) = (pattern.chars().collect(), letters.collect());
    let (mut p, mut n) = (0, 0);
    // Where to continue when the text after the last `*` does not match: (pattern after it, next start).
    let mut retry: Option<(usize, usize)> = None;
    while n < name.len() {
        match pattern.get(p) {
            Some('*') => {
                retry = Some((p + 1, n + 1));
                p += 1;
            }
            Some(&c) if c == '?' || c == name[n] => {
                p += 1;
                n += 1;
            }
            _ => match retry {
                Some((after, start)) => {
                    p = after;
                    n = start;
                    retry = Some((after, start + 1));
                }
                None => return false,
            },
        }
    }
    pattern[p..].iter().all(|&c| c == '*')
}

/// Of `patterns` and their values, the one with the most letters that matches `name`.
pub(super) fn best_of<'a, T>(patterns: impl Iterator<Item = (&'a str, T)>, name: &str) -> Option<(&'a str, T)> {
    patterns
        .filter(|(pattern, _)| matches(pattern, name))
        .max_by_key(|(pattern, _)| (pattern.chars().filter(|c| !"*?".contains(*c)).count(), has_capitals(pattern)))
}

/// Whether `pattern` contains more than wildcards.
pub(super) fn is_lettered(pattern: &str) -> bool {
    pattern.chars().any(|c| !"*?".contains(c))
}

fn has_capitals(pattern: &str) -> bool {
    pattern.chars().any(char::is_uppercase)
}

/// Those of `names` that are most similar to `pattern`, as the end of a message; empty if none is.
pub(super) fn near(pattern: &str, names: &[&str]) -> String {
    let plain: String = pattern.chars().filter(|letter| !"*?".contains(*letter)).collect();
    let length = plain.chars().count();
    // What a `*` stands for is not compared.
    let wording = |name: &&str| -> String {
        match (pattern.starts_with('*'), pattern.ends_with('*')) {
            (false, true) => name.chars().take(length).collect(),
            (true, false) => name.chars().skip(name.chars().count().saturating_sub(length)).collect(),
            _ => (*name).to_owned(),
        }
    };
    let like = nearest(&plain, names.iter().map(wording));
    let found: BTreeSet<&str> = names.iter().copied().filter(|name| like.contains(&wording(name))).collect();
    match found.into_iter().take(3).collect::<Vec<_>>().join(", ") {
        none if none.is_empty() => none,
        near => format!("; near: {near}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stars_match_any_run_and_small_letters_any_case() {
        assert!(matches("car_*", "Car_1") && !matches("Car_*", "car_1") && matches("straße", "STRAßE"));
        assert!(matches("a*b*c", "axxbyybc") && !matches("a*b*c", "axxbyyb") && matches("*", "") && !matches("?", ""));
    }

    #[test]
    fn of_equal_lengths_the_pattern_with_capitals_wins() {
        let shade = [("Car*", 1), ("car*", 2)].into_iter();
        assert_eq!(best_of(shade, "Car").map(|(_, found)| found), Some(1));
    }
}
