//! Holds the modules (rooms) to the floors listed on the front page of the crate.

use std::fs;
use std::path::Path;

/// Every file below `folder`, with its text.
fn files(folder: &Path) -> Vec<(String, String)> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap().map(Result::unwrap) {
        let path = entry.path();
        if path.is_dir() {
            found.extend(files(&path));
        } else if path.extension().is_some_and(|ending| ending == "rs") {
            found.push((path.display().to_string(), fs::read_to_string(&path).unwrap()));
        }
    }
    found
}

#[test]
fn no_room_imports_from_a_higher_one() {
    let page = include_str!("lib.rs").lines().skip_while(|line| *line != "//! # Floors");
    let floors: Vec<&str> = page.filter_map(|line| line.strip_prefix("//! | `")?.split('`').next()).collect();
    let floor = |room: &str| floors.iter().position(|known| *known == room);
    assert!(floors.len() > 10 && floor("ground") == Some(floors.len() - 1), "{floors:?}");
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let rooms = fs::read_dir(&source).unwrap().map(|entry| entry.unwrap().path()).filter(|path| path.is_dir());
    for folder in rooms {
        let room = folder.file_name().unwrap().to_str().unwrap();
        let own = floor(room).unwrap_or_else(|| panic!("{room} has no floor"));
        for (file, text) in files(&folder) {
            // Tests and documentation may look at everything.
            let code = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default();
            let lines = code.lines().filter(|line| !line.trim_start().starts_with("//") && !file.ends_with("tests.rs"));
            for import in lines.flat_map(|line| line.split("crate::").skip(1)) {
                let other: String = import.chars().take_while(|c| c.is_ascii_lowercase() || *c == '_').collect();
                let below = floor(&other).is_some_and(|other| other >= own);
                assert!(below, "{room} imports from {other:?}, which is above it or no room: {file}");
            }
        }
    }
}
