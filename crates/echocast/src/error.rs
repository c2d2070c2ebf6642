//! Everything that can go wrong, sorted by who can act on it.

use std::io;
use std::path::{Path, PathBuf};

/// Result of every fallible call of this crate.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Why a call failed. Each message is one sentence: where, what was found, what is allowed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The operating system refused: missing file, no permission, full disk.
    #[error("{}: {source}", path.display())]
    Io {
        /// File or folder concerned.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// A file or text was read but does not say what it should.
    #[error("{origin}{}: {message}", place_suffix(place))]
    Parse {
        /// File path, or a word for text that came from elsewhere (`--set`, `YAML text`).
        origin: String,
        /// Where in it: `line 7`, `node 3 "Chair"`, `accessor 12`; empty when the whole is meant.
        place: String,
        /// What was found and what is allowed.
        message: String,
    },
    /// An argument or option is outside what is allowed.
    #[error("{name} is {value}; allowed: {allowed}")]
    InvalidParameter {
        /// Name of the argument, option or key.
        name: String,
        /// What was given.
        value: String,
        /// What would be accepted.
        allowed: String,
    },
    /// A preset, asset or name does not exist.
    #[error("there is no {what} named {name:?}{}", near_suffix(near))]
    Missing {
        /// Kind of thing looked for: `sensor preset`, `column`, `camera node`.
        what: &'static str,
        /// Name looked for.
        name: String,
        /// Existing names that come near, best first.
        near: Vec<String>,
    },
    /// Understood, but this build or format cannot do it.
    #[error("{what} is not supported: {instead}")]
    Unsupported {
        /// What was asked for.
        what: String,
        /// Which feature, format or tool would do it.
        instead: String,
    },
    /// The caller did not want it any more.
    #[error("cancelled by the progress callback")]
    Cancelled,
    /// The system gives no more memory.
    #[error("no memory for {0}")]
    Memory(String),
    /// The system gives no more threads.
    #[error("the system does not give {wanted} threads ({reason}); allowed: fewer, or a higher limit of processes")]
    Threads {
        /// How many were wanted.
        wanted: String,
        /// What the system said.
        reason: String,
    },
    /// Embree failed.
    #[error("Embree: {0}")]
    Embree(#[source] embree4::Error),
    /// A defect of this library.
    #[error("internal error (please report): {0}")]
    Internal(String),
}

impl From<embree4::Error> for Error {
    fn from(error: embree4::Error) -> Error {
        match error {
            embree4::Error::Embree { call, reason: embree4::OUT_OF_MEMORY } => {
                Error::Memory(format!("Embree's {call}"))
            }
            other => Error::Embree(other),
        }
    }
}

fn place_suffix(place: &str) -> String {
    if place.is_empty() { String::new() } else { format!(": {place}") }
}

fn near_suffix(near: &[String]) -> String {
    match near {
        [] => String::new(),
        names => format!("; near: {}", names.join(", ")),
    }
}

impl Error {
    /// An [`Error::Io`] for `path`.
    pub fn io(path: impl AsRef<Path>, source: io::Error) -> Self {
        Error::Io { path: path.as_ref().to_owned(), source }
    }

    /// An [`Error::Parse`] in the file at `path`.
    pub fn parse(path: impl AsRef<Path>, place: impl Into<String>, message: impl Into<String>) -> Self {
        Error::Parse { origin: path.as_ref().display().to_string(), place: place.into(), message: message.into() }
    }

    /// An [`Error::InvalidParameter`].
    pub fn invalid(name: impl Into<String>, value: impl ToString, allowed: impl Into<String>) -> Self {
        Error::InvalidParameter { name: name.into(), value: value.to_string(), allowed: allowed.into() }
    }

    /// An [`Error::Missing`] that lists the names of `known` that come near `name`.
    pub fn missing<S: AsRef<str>>(what: &'static str, name: &str, known: impl IntoIterator<Item = S>) -> Self {
        Error::Missing { what, name: name.to_owned(), near: nearest(name, known) }
    }
}

/// Up to three of `known` within a few slips of the pen of `name` or containing it, best first.
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
}
