//! The `echocast` program.

use std::process::ExitCode;

#[global_allocator]
static MEMORY: echocast_memory::Allocator = echocast_memory::Allocator;

fn main() -> ExitCode {
    ExitCode::from(echocast_cli::run(std::env::args_os()))
}
