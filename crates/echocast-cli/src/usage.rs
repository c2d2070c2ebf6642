//! Exit codes, and the errors that have them.
//!
//! A wrong command ends with 2, before any work: an option, name, value or ending of it is unknown, not allowed, or
//! does not go with the others, the sensor or the scene. A correct command whose work fails ends with 1: a file cannot
//! be read or written, or its content is wrong; the system provides no memory or threads; the simulation refuses, as it
//! does a sonar above the water.

use crate::text;
use echocast::Error;
use std::fmt;

/// Exit code of failed work.
pub const FAILED: u8 = 1;

/// Exit code of wrong usage; also that of clap.
pub const WRONG: u8 = 2;

/// Exit code of a cancelled program: what shells report for one ended by SIGINT, 128 + 2.
pub const INTERRUPTED: u8 = 130;

/// Why the usage is wrong.
#[derive(Debug)]
struct WrongUsage(String);

impl fmt::Display for WrongUsage {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for WrongUsage {}

/// The error of a check of the command as wrong usage, unless its cause is a file or the system.
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
        INTERRUPTED
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
        let wrapped = Err::<(), _>(wrong(missing())).context("--fields").unwrap_err();
        assert_eq!(exit_code(&wrapped), 2);
        assert_eq!(text::one_line(&wrapped), "--fields: there is no column named \"rnge\"; near: range");
    }
}
