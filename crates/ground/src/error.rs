//! Everything that can go wrong, sorted by who can act on it.

use crate::shown;
use std::path::{Path, PathBuf};
use std::{fmt, io};

/// Result of every fallible call of this crate.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Why a call failed. Each message is one sentence: where, what was found, what is allowed; on one line, below 500
/// bytes, and without control characters, whatever the files contain.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The operating system refused: missing file, no permission, full disk.
    Io {
        /// File or folder concerned.
        path: PathBuf,
        /// The error that the system reported.
        source: io::Error,
    },
    /// A file or text was read but its content is wrong.
    Parse {
        /// File path, or a word for text from elsewhere (`--set`, `YAML text`).
        origin: String,
        /// Where in it: `line 7`, `node 3 "Chair"`, `accessor 12`; empty for the whole.
        place: String,
        /// What was found and what is allowed.
        message: String,
    },
    /// An argument or option is outside what is allowed.
    InvalidParameter {
        /// Name of the argument, option or key.
        name: String,
        /// What was given.
        value: String,
        /// What would be accepted.
        allowed: String,
    },
    /// A preset, asset or name does not exist.
    Missing {
        /// Kind of thing looked for: `sensor preset`, `column`, `camera node`.
        what: &'static str,
        /// Name looked for.
        name: String,
        /// Similar existing names, best first.
        near: Vec<String>,
    },
    /// Understood, but this build or format cannot do it.
    Unsupported {
        /// What was requested.
        what: String,
        /// Which feature, format or tool would do it.
        instead: String,
    },
    /// The caller cancelled: by its progress callback, or `export::cancel_flag`.
    Cancelled,
    /// The system is out of memory.
    Memory(String),
    /// The system cannot start more threads.
    Threads {
        /// How many were requested.
        wanted: String,
        /// The error that the system reported.
        reason: String,
    },
    /// Embree failed or is missing: a sentence.
    Embree(String),
    /// A defect in this library.
    Internal(String),
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let (name, origin, numbers) = (shown::name, shown::origin, shown::short_numbers);
        let sentence = match self {
            Error::Io { path, source } => format!("{}: {source}", origin(&shown::path(path))),
            Error::Parse { origin: file, place, message } if place.is_empty() => {
                format!("{}: {}", origin(file), numbers(message))
            }
            Error::Parse { origin: file, place, message } => {
                format!("{}: {}: {}", origin(file), name(place), numbers(message))
            }
            Error::InvalidParameter { name: what, value, allowed } => {
                format!("{} is {}; allowed: {}", name(what), name(&numbers(value)), numbers(allowed))
            }
            Error::Missing { what, name: missing, near } => {
                let near: Vec<_> = near.iter().map(|near| name(near)).collect();
                let near = if near.is_empty() { String::new() } else { format!("; near: {}", near.join(", ")) };
                format!("there is no {what} named {:?}{near}", name(missing))
            }
            Error::Unsupported { what, instead } => format!("{what} is not supported: {instead}"),
            Error::Cancelled => "cancelled by the progress callback or an interrupt".into(),
            Error::Memory(what) => format!("no memory for {what}"),
            Error::Threads { wanted, reason } => {
                format!(
                    "the system cannot start {wanted} threads ({reason}); allowed: fewer, or a higher limit of processes"
                )
            }
            Error::Embree(why) => why.clone(),
            Error::Internal(what) => format!("internal error (please report): {what}"),
        };
        f.write_str(&shown::message(&sentence))
    }
}

impl Error {
    /// An [`Error::Io`] for `path`.
    pub fn io(path: impl AsRef<Path>, source: io::Error) -> Self {
        Error::Io { path: path.as_ref().to_owned(), source }
    }

    /// An [`Error::Parse`] in the file at `path`.
    pub fn parse(path: impl AsRef<Path>, place: impl Into<String>, message: impl Into<String>) -> Self {
        Error::Parse { origin: shown::path(path.as_ref()), place: place.into(), message: message.into() }
    }

    /// An [`Error::InvalidParameter`].
    pub fn invalid(name: impl Into<String>, value: impl ToString, allowed: impl Into<String>) -> Self {
        Error::InvalidParameter { name: name.into(), value: value.to_string(), allowed: allowed.into() }
    }

    /// An [`Error::Missing`] that lists the names of `known` similar to `name`.
    pub fn missing<S: AsRef<str>>(what: &'static str, name: &str, known: impl IntoIterator<Item = S>) -> Self {
        Error::Missing { what, name: name.to_owned(), near: nearest(name, known) }
    }
}

/// Up to three of `known` within a few typing errors of `name` or containing it, best first.
pub fn nearest<S: AsRef<str>>(name: &str, known: impl IntoIterator<Item = S>) -> Vec<String> {
    let wanted = name.to_lowercase();
    let mut scored: Vec<(usize, String)> = known
        .into_iter()
        .filter_map(|candidate| {
            let candidate = candidate.as_ref();
            let lower = candidate.to_lowercase();
            let distance = strsim::osa_distance(&wanted, &lower);
            let contained = !wanted.is_empty() && (lower.contains(&wanted) || wanted.contains(&lower));
            let limit = wanted.chars().count().max(3) / 3;
            (distance <= limit || contained).then(|| (distance, candidate.to_owned()))
        })
        .collect();
    scored.sort();
    scored.truncate(3);
    scored.into_iter().map(|(_, name)| name).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn near_names_are_offered_best_first() {
        let known = ["velodyne_vlp16", "velodyne_vlp32c", "kinect_v2"];
        assert_eq!(nearest("velodyne_vlp32", known)[0], "velodyne_vlp32c");
        assert!(nearest("zzz", known).is_empty());
        let error = Error::missing("sensor preset", "kinect_v3", known);
        assert_eq!(error.to_string(), "there is no sensor preset named \"kinect_v3\"; near: kinect_v2");
    }

    #[test]
    fn messages_are_one_short_line_whatever_is_in_them() {
        for text in ["x", "\u{1f600}", "\n", "\"", "a\x1b[31m ", "9"].map(|piece| piece.repeat(10_000)) {
            let (path, string) = (PathBuf::from(&text), || text.clone());
            let found = format!("{:?}", 1e300);
            for error in [
                Error::io(&path, io::Error::other(string())),
                Error::parse(&path, string(), string()),
                Error::parse(&path, "", string()),
                Error::invalid(string(), string(), string()),
                Error::invalid(string(), 1e300, found),
                Error::Missing { what: "camera node", name: string(), near: vec![string(); 3] },
                Error::Unsupported { what: string(), instead: string() },
                Error::Memory(string()),
                Error::Internal(string()),
            ] {
                let message = error.to_string();
                assert!(message.len() < 500 && !message.contains(char::is_control), "{message}");
            }
        }
        let error = Error::invalid("k".repeat(1000), -1e300, format!("{} to {}", 0.0, 1e300)).to_string();
        assert!(error.ends_with("kk... is -1e300; allowed: 0 to 1e300"), "{error}");
        let error = Error::Parse { origin: "a/b\n.yaml".into(), place: "line 2".into(), message: "is \r".into() };
        assert_eq!(error.to_string(), "a/b\\n.yaml: line 2: is \\r");
    }

    #[cfg(unix)]
    #[test]
    fn names_that_are_not_text_are_escaped() {
        use std::os::unix::ffi::OsStrExt as _;
        let path = Path::new(std::ffi::OsStr::from_bytes(b"x\xff.glb"));
        assert_eq!(Error::parse(path, "", "is empty").to_string(), "x\\xff.glb: is empty");
        assert_eq!(Error::io(path, io::Error::other("gone")).to_string(), "x\\xff.glb: gone");
    }
}
