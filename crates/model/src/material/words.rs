//! Splits the names that people give to materials into words.

/// The words of `name` in lower case and singular: `DarkRedFabric.001` is dark, red, fabric; `wood_planks2` is wood,
/// plank. Words end where a letter is followed by something else, and where a capital follows a small letter
/// (`RedWood`) or begins a word after capitals (`PVCPipe`).
pub(super) fn words(name: &str) -> Vec<String> {
    let letters: Vec<char> = name.chars().collect();
    let mut words = Vec::new();
    let mut word = String::new();
    for (at, &letter) in letters.iter().enumerate() {
        let before = at.checked_sub(1).map(|before| letters[before]);
        let small_after = letters.get(at + 1).is_some_and(|after| after.is_lowercase());
        let begins = letter.is_uppercase()
            && before.is_some_and(|before| before.is_lowercase() || before.is_uppercase() && small_after);
        if (begins || !letter.is_alphabetic()) && !word.is_empty() {
            words.push(singular(std::mem::take(&mut word)));
        }
        if letter.is_alphabetic() {
            word.extend(letter.to_lowercase());
        }
    }
    if !word.is_empty() {
        words.push(singular(word));
    }
    words
}

/// `word` without a plural ending. Both words of a comparison lose it, so `leaves` may become `leave`.
fn singular(mut word: String) -> String {
    let keep = if ["sses", "shes", "ches", "xes"].iter().any(|ending| word.ends_with(ending)) {
        word.len() - 2
    } else if word.len() > 3 && word.ends_with('s') && !["ss", "us", "is"].iter().any(|ending| word.ends_with(ending)) {
        word.len() - 1
    } else {
        word.len()
    };
    word.truncate(keep);
    word
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_have_words() {
        for (name, expected) in [
            ("DarkRedFabric", "dark red fabric"),
            ("Asphalt.001", "asphalt"),
            ("wood_planks2", "wood plank"),
            ("PVCPipe", "pvc pipe"),
            ("M_GlassPanes-01", "m glass pane"),
            ("Radiator", "radiator"),
            ("brick wall (old)", "brick wall old"),
            ("BOXES", "box"),
            ("grass", "grass"),
            ("Straße Bäume", "straße bäume"),
            ("", ""),
            ("...42", ""),
        ] {
            assert_eq!(words(name).join(" "), expected, "{name}");
        }
    }
}
