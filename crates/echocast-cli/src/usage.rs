//! What the program ends with, and how.
//!
//! A command that must be written differently ends with 2, before any work: an option, name, value or ending of it is
//! unknown, not allowed, or does not go with the others, with the sensor or with the scene. What the command says can
//! be right and the work still fail, which is 1: a file cannot be read or written, or its content is wrong; the system
//! gives no memory or threads; the simulation refuses, as it does a sonar above the water.

use crate::interrupt;
use crate::text;
use echocast::Error;
use std::fmt;

/// Exit code of failed work.
pub const FAILED: u8 = 1;

/// Exit code of a command that must be written differently; clap's, too.
pub const WRONG: u8 = 2;

/// Why a command must be written differently.
#[derive(Debug)]
struct WrongUsage(String);

impl fmt::Display for WrongUsage {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for WrongUsage {}

/// What a check of the command says is wrong usage, unless the reason is a file or the system.
pub fn wrong(error: impl Into<anyhow::Error>) -> anyhow::Error {
    let error = error.into();
    match error.downcast_ref() {
        None | Some(Error::Missing { .. } | Error::InvalidParameter { .. } | Error::Unsupported { .. }) => {
            WrongUsage(text::one_line(&error)).into()
        }
        Some(_) => error,
    }
}

/// The exit code for `error`.
pub fn exit_code(error: &anyhow::Error) -> u8 {
    if matches!(error.downcast_ref(), Some(Error::Cancelled)) {
        interrupt::INTERRUPTED
    } else if error.is::<WrongUsage>() {
        WRONG
    } else {
        FAILED
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use anyhow::{Context as _, anyhow};

    #[test]
    fn files_and_the_system_are_not_to_blame_on_the_command() {
        let io = || Error::io("x.las", std::io::Error::other("disk full"));
        let missing = || Error::missing("column", "rnge", ["range"]);
        for (error, code) in [
            (wrong(anyhow!("--organised: no")), 2),
            (wrong(anyhow::Error::new(missing()).context("--fields")), 2),
            (wrong(anyhow::Error::new(io()).context("--preview")), 1),
            (wrong(Error::parse("a.yaml", "line 2", "is wrong")), 1),
            (missing().into(), 1),
            (anyhow::Error::new(Error::Cancelled).context("--preview"), 130),
        ] {
            assert_eq!(exit_code(&error), code, "{error:#}");
        }
        let told = Err::<(), _>(wrong(missing())).context("--fields").unwrap_err();
        assert_eq!(exit_code(&told), 2);
        assert_eq!(text::one_line(&told), "--fields: there is no column named \"rnge\"; near: range");
    }
}
