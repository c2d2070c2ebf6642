//! Holds the sources to what keeps them readable: the floors listed on the front page of the crate, no circles among
//! the files of a folder, one meaning for each name of a type, files and functions that are not too long; and builds
//! to what keeps them short.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;
use std::process::Command;

/// The packages whose sources are checked.
const PACKAGES: [&str; 24] = [
    "bindings/python",
    "crates/cloud",
    "crates/crew",
    "crates/echocast",
    "crates/echocast-capi",
    "crates/echocast-cli",
    "crates/embree4",
    "crates/embree4-sys",
    "crates/emitter",
    "crates/engine",
    "crates/ground",
    "crates/hdf5",
    "crates/helios",
    "crates/kernels",
    "crates/memory",
    "crates/model",
    "crates/pictures",
    "crates/radar",
    "crates/robots",
    "crates/scene-files",
    "crates/sets",
    "crates/stdout",
    "crates/survey",
    "crates/worlds",
];

/// Files that a program has written.
const GENERATED: [&str; 1] = ["crates/embree4-sys/src/bindings.rs"];

/// Folders in which files import each other in a circle, and why.
const CIRCLES: [(&str, &str); 2] = [
    ("crates/model/src/material", "a material, its file, its changes and what its name says are one thing"),
    ("crates/engine/src/scene", "a scene and the steps that make it from files are methods of one type"),
];

/// Types that share their name, and why.
const SAME_NAMES: [(&str, &str); 6] = [
    ("Array", "public: shared numbers of a mesh, and the elements of a transducer, as YAML calls them"),
    ("Error", "Embree's, and the library's"),
    ("FramesFile", "of builds with HDF5, and of those without"),
    ("Layer", "public: of an image, and of water"),
    ("Mesh", "Embree's, and that of a scene"),
    ("Scene", "Embree's, and the contents of files"),
];

/// Most lines of a file and of a function.
const MOST_OF_FILE: usize = 800;
const MOST_OF_FUNCTION: usize = 120;

/// A file that is not only for tests.
struct Source {
    /// In the folder of the repository.
    path: String,
    /// Its module, from the root of its crate.
    module: Vec<String>,
    /// Its text up to its tests.
    text: String,
    /// `text` without comments.
    code: String,
}

/// The files of a package.
fn sources(package: &str) -> Vec<Source> {
    let repository = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let root = repository.join(package).join("src");
    let (mut found, mut open) = (Vec::new(), vec![root.clone()]);
    while let Some(folder) = open.pop() {
        for path in fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path()) {
            let stem = path.file_stem().unwrap().to_str().unwrap();
            let of_tests = stem == "floors" || stem.split('_').any(|word| ["test", "tests"].contains(&word));
            if path.is_dir() && !of_tests {
                open.push(path);
            } else if path.extension().is_some_and(|ending| ending == "rs") && !of_tests {
                let inner = path.strip_prefix(&root).unwrap().with_extension("");
                let mut module: Vec<String> = inner.iter().map(|part| part.to_str().unwrap().to_owned()).collect();
                module.pop_if(|last| ["lib", "main", "mod"].contains(&last.as_str()));
                let text = untested(&fs::read_to_string(&path).unwrap());
                let code = text.lines().filter(|line| !line.trim_start().starts_with("//"));
                let code = code.flat_map(|line| [line, "\n"]).collect();
                let path = path.strip_prefix(&repository).unwrap().display().to_string();
                found.push(Source { path, module, text, code });
            }
        }
    }
    found.sort_by(|a, b| a.path.cmp(&b.path));
    found
}

/// A text up to its tests.
fn untested(text: &str) -> String {
    let lines = text.lines().zip(text.lines().skip(1).chain([""]));
    let is_test = |(line, next): (&str, &str)| line == "#[cfg(test)]" && next.contains("mod ") && next.ends_with('{');
    lines.take_while(|&pair| !is_test(pair)).flat_map(|(line, _)| [line, "\n"]).collect()
}

/// The word at the beginning of `text`.
fn word(text: &str) -> &str {
    &text[..text.find(|letter: char| !letter.is_alphanumeric() && letter != '_').unwrap_or(text.len())]
}

/// The paths at the beginning of `text`, such as `a::{b, c::d}`.
fn paths(text: &str) -> Vec<Vec<&str>> {
    if let Some(list) = text.strip_prefix('{') {
        let (mut depth, mut start, mut all) = (0, 0, Vec::new());
        for (at, letter) in list.char_indices() {
            if depth == 0 && ",}".contains(letter) {
                all.extend(paths(list[start..at].trim_start()));
                start = at + 1;
            }
            depth += i32::from(letter == '{') - i32::from(letter == '}');
            if depth < 0 {
                break;
            }
        }
        return all;
    }
    let first = if text.starts_with('*') { "*" } else { word(text) };
    let inner = text[first.len()..].strip_prefix("::").map_or(Vec::new(), paths);
    match first {
        "" => Vec::new(),
        _ if inner.is_empty() => vec![vec![first]],
        _ => inner.into_iter().map(|rest| [&[first], &rest[..]].concat()).collect(),
    }
}

/// The kind and the name of the item that begins on a line.
fn item(line: &str) -> Option<(&str, &str)> {
    let mut text = line.trim_start();
    if text.starts_with("pub") {
        text = text.split_once(if text.starts_with("pub(") { ") " } else { " " })?.1;
    }
    let qualifiers = ["const fn ", "const unsafe fn ", "unsafe ", "extern \"C\" "];
    while let Some(qualifier) = qualifiers.into_iter().find(|qualifier| text.starts_with(qualifier)) {
        text = &text[qualifier.find(' ')? + 1..];
        text = text.strip_prefix("\"C\" ").unwrap_or(text);
    }
    let (kind, name) = text.split_once(' ')?;
    let kinds = ["const", "enum", "fn", "static", "struct", "trait", "type", "union"];
    kinds.contains(&kind).then(|| (kind, word(name))).filter(|(_, name)| !name.is_empty())
}

impl Source {
    /// The paths that begin with `start`.
    fn paths_from(&self, start: &'static str) -> impl Iterator<Item = Vec<&str>> {
        let inside = |before: char| before.is_alphanumeric() || "_:".contains(before);
        let places = self.code.match_indices(start).filter(move |(at, _)| !self.code[..*at].ends_with(inside));
        places.flat_map(|(at, _)| paths(&self.code[at..]))
    }

    /// The paths that it names by `crate::`, `super::` and `self::`, from the root of the crate.
    fn paths(&self) -> impl Iterator<Item = Vec<&str>> {
        let all = ["crate::", "super::", "self::"].into_iter().flat_map(|start| self.paths_from(start));
        all.map(|path| {
            let up = path.iter().take_while(|part| ["crate", "self", "super"].contains(part)).count();
            let own = match path[0] {
                "crate" => 0,
                "self" => self.module.len(),
                _ => self.module.len().saturating_sub(up),
            };
            self.module[..own].iter().map(String::as_str).chain(path[up..].iter().copied()).collect()
        })
    }

    /// The paths that it imports, as they are written.
    fn imports(&self) -> impl Iterator<Item = Vec<&str>> {
        let lines = self.code.match_indices("use ").map(|(at, _)| self.code[at + 4..].trim_start_matches("self::"));
        lines.flat_map(paths)
    }

    /// Functions, with their numbers of lines.
    fn functions(&self) -> Vec<(&str, usize)> {
        let lines: Vec<&str> = self.text.lines().collect();
        let length = |first: usize| {
            let (_, name) = item(lines[first]).filter(|(kind, _)| *kind == "fn")?;
            let indent = lines[first].len() - lines[first].trim_start().len();
            let end = lines[first..].iter().position(|line| line.trim_start() == "}" && line.len() == indent + 1)?;
            // A function of a trait may have no body, and a short one is on one line.
            let body = lines[first..].iter().position(|line| line.ends_with('{'))?;
            let other = lines[first..].iter().position(|line| line.ends_with(';') || line.ends_with('}'))?;
            (body < other).then_some((name, end + 1))
        };
        (0..lines.len()).filter_map(length).collect()
    }
}

/// For each folder of a package, which of its files and folders import which others, with what they import.
type Imports = BTreeMap<String, BTreeMap<(String, String), String>>;

fn imports(package: &str) -> Imports {
    let sources = sources(package);
    let mut children: BTreeMap<&[String], BTreeSet<&str>> = BTreeMap::new();
    for source in &sources {
        for (depth, name) in source.module.iter().enumerate() {
            children.entry(&source.module[..depth]).or_default().insert(name);
        }
    }
    // In a folder, the child that defines a name which the folder's own file imports.
    let mut origins: BTreeMap<(&[String], &str), &str> = BTreeMap::new();
    for folder in &sources {
        let Some(children) = children.get(&folder.module[..]) else { continue };
        for path in folder.imports().filter(|path| path.len() > 1 && children.contains(path[0])) {
            let (child, name) = (path[0], path[path.len() - 1]);
            origins.insert((&folder.module, name), child);
            let is_child = |source: &&Source| source.module.split_last() == Some((&child.to_owned(), &folder.module));
            for source in sources.iter().filter(is_child).filter(|_| name == "*") {
                let items = source.code.lines().filter(|line| !line.starts_with(' ')).filter_map(item);
                origins.extend(items.map(|(_, name)| ((&folder.module[..], name), child)));
            }
        }
    }
    let mut found = Imports::new();
    for source in &sources {
        for path in source.paths() {
            for (depth, own) in source.module.iter().enumerate().take(path.len()) {
                let (folder, name) = (&source.module[..depth], path[depth]);
                if path[..depth] != *folder {
                    break;
                }
                let is_child = children[folder].contains(name);
                let other = if is_child { Some(name) } else { origins.get(&(folder, name)).copied() };
                if let Some(other) = other.filter(|other| other != own) {
                    let folder = [&[format!("{package}/src")], folder].concat().join("/");
                    let edge = (own.clone(), other.to_owned());
                    found.entry(folder).or_default().insert(edge, path[depth..].join("::"));
                }
            }
        }
    }
    found
}

/// The edges that are part of a circle, as sentences.
fn circles(edges: &BTreeMap<(String, String), String>) -> Vec<String> {
    let reaches = |from: &str, to: &str| {
        let (mut open, mut known) = (vec![from], BTreeSet::new());
        while let Some(name) = open.pop().filter(|name| *name != to) {
            let next = edges.keys().filter(|(own, _)| own == name).map(|(_, other)| other.as_str());
            open.extend(next.filter(|other| known.insert(*other)));
        }
        known.contains(to)
    };
    let circular = edges.iter().filter(|((own, other), _)| reaches(other, own));
    circular.map(|((own, other), what)| format!("{own} imports {what} from {other}")).collect()
}

#[test]
fn no_room_imports_from_a_higher_one() {
    // Of crates Cargo checks the same.
    let page = include_str!("../crates/echocast/src/lib.rs").lines().skip_while(|line| *line != "//! # Floors");
    let cells = |line: &'static str| line.strip_prefix("//! | `").map(|row| row.split('`').collect::<Vec<_>>());
    let rows: Vec<Vec<&str>> = page.filter_map(cells).collect();
    let floors: Vec<(&str, &str)> = rows.iter().filter(|row| row.len() > 3).map(|row| (row[0], row[2])).collect();
    assert!(floors.len() > 20 && floors.last().is_some_and(|last| last.1 == "ground"), "{floors:?}");
    let packages: BTreeSet<&str> = floors.iter().map(|(package, _)| *package).collect();
    for package in packages {
        let rooms: Vec<&str> = floors.iter().filter(|floor| floor.0 == package).map(|floor| floor.1).collect();
        // The files of a crate that are in no folder are the room of its name, or its only one.
        let own_name = rooms.iter().find(|room| room.replace('_', "-") == package || rooms.len() == 1);
        let room_of = |module: Option<&str>| {
            let room = module.and_then(|first| rooms.iter().find(|room| **room == first));
            room.or(own_name).and_then(|room| rooms.iter().position(|known| known == room))
        };
        for source in sources(&format!("crates/{package}")).iter().filter(|source| !source.module.is_empty()) {
            let path = &source.path;
            let own = room_of(source.module.first().map(String::as_str));
            let own = own.unwrap_or_else(|| panic!("{path} is in no room"));
            for other in source.paths_from("crate::").filter_map(|path| path.get(1).map(|name| name.to_string())) {
                let below = room_of(Some(&other)).is_some_and(|other| other >= own);
                assert!(below, "{} imports from {other:?}, which is above it or no room: {path}", rooms[own]);
            }
        }
    }
}

#[test]
fn no_files_import_each_other_in_circles() {
    for (folder, edges) in PACKAGES.into_iter().flat_map(imports) {
        let circles = circles(&edges);
        match CIRCLES.iter().any(|(known, _)| *known == folder) {
            false => assert!(circles.is_empty(), "{folder}: {circles:#?}"),
            true => assert!(!circles.is_empty(), "{folder} has no circle any more: take it off the list"),
        }
    }
}

#[test]
fn no_two_files_define_types_of_one_name() {
    let mut defined: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    // Those of bindings wrap the types of the same name.
    let packages = PACKAGES.into_iter().filter(|package| !package.starts_with("bindings/"));
    for source in packages.flat_map(sources).filter(|source| !GENERATED.contains(&source.path.as_str())) {
        for line in source.code.lines() {
            // Types of traits are indented.
            let is_type =
                |kind| kind == "type" && !line.starts_with(' ') || !["const", "fn", "static", "type"].contains(&kind);
            if let Some((_, name)) = item(line).filter(|(kind, _)| is_type(kind)) {
                defined.entry(name.to_owned()).or_default().insert(source.path.clone());
            }
        }
    }
    for (name, files) in defined {
        match SAME_NAMES.iter().any(|(known, _)| *known == name) {
            false => assert!(files.len() == 1, "{name} is defined in several files: {files:?}"),
            true => assert!(files.len() > 1, "{name} is defined once: take it off the list"),
        }
    }
}

#[test]
fn no_file_and_no_function_is_too_long() {
    let mut long = BTreeSet::new();
    for source in PACKAGES.into_iter().flat_map(sources).filter(|source| !GENERATED.contains(&source.path.as_str())) {
        let functions = source.functions().into_iter().filter(|(_, lines)| *lines > MOST_OF_FUNCTION);
        long.extend(functions.map(|(name, _)| format!("{}: {name}", source.path)));
        if source.text.lines().count() > MOST_OF_FILE {
            long.insert(source.path);
        }
    }
    assert!(long.is_empty(), "more than {MOST_OF_FILE} lines, or {MOST_OF_FUNCTION} of a function: {long:#?}");
}

/// Dependencies with their features, built for the package that `which` selects, or all.
fn features(which: &str) -> BTreeSet<String> {
    let what = ["tree", "--locked", "--offline", "--edges=normal,build", "--prefix=none", "--format={p} {f}", which];
    let output =
        Command::new(env!("CARGO")).args(what).current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/..")).output();
    let output = output.unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let lines = String::from_utf8(output.stdout).unwrap();
    lines.lines().map(|line| line.trim_end_matches(" (*)").to_owned()).collect()
}

/// Else whoever runs all tests builds everything twice.
#[test]
fn the_python_package_is_built_with_the_features_of_the_workspace() {
    let (python, all) = (features("--package=echocast-python"), features("--workspace"));
    let differ: Vec<_> = python.difference(&all).collect();
    assert!(python.len() > 100 && differ.is_empty(), "with other features: {differ:#?}");
}
