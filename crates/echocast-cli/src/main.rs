//! The `echocast` program.

use std::process::ExitCode;

fn main() -> ExitCode {
    ExitCode::from(echocast_cli::run(std::env::args_os()))
}
