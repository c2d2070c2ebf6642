//! The `echocast` program: arguments, progress and printing. The work is the library's.
#![forbid(unsafe_code)]

mod bench;
mod choice;
mod formats;
mod frames;
mod generate;
mod info;
mod input;
mod interrupt;
mod output;
mod place;
mod progress;
mod record;
mod report;
mod run;
mod scan;
mod sensors;
mod text;
mod weather;

use clap::{Parser, Subcommand};
use echocast::Error;
use std::io::Write as _;
use std::process::ExitCode;

/// Simulates depth sensors: casts the beams of LiDARs, depth cameras and sonars into a 3D scene and writes what the
/// instrument would have reported, every point labelled.
#[derive(Parser)]
#[command(
    name = "echocast",
    version,
    arg_required_else_help = true,
    after_help = "Example:\n  echocast scan street.glb --sensor velodyne_vlp32c --camera Corner -o scan.las --preview scan.png\n\n\
                  Exit codes: 0 success; 1 failure; 2 wrong usage; 130 interrupted."
)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Scan(Box<scan::Args>),
    Run(Box<run::Args>),
    Sensors(sensors::Args),
    Info(info::Args),
    Generate(generate::Args),
    Formats(formats::Args),
    Bench(Box<bench::Args>),
}

fn main() -> ExitCode {
    // If this fails, a file that grows too long ends the program, as usual.
    let _ = interrupt::outlive_full_files();
    let done = match Cli::parse().command {
        Command::Scan(args) => scan::run(&args),
        Command::Run(args) => run::run(&args),
        Command::Sensors(args) => sensors::run(&args),
        Command::Info(args) => info::run(&args),
        Command::Generate(args) => generate::run(&args),
        Command::Formats(formats::Args {}) => formats::run(),
        Command::Bench(args) => bench::run(&args),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) if error.chain().any(|cause| matches!(cause.downcast_ref(), Some(Error::Cancelled))) => {
            interrupt::say();
            ExitCode::from(interrupt::INTERRUPTED)
        }
        Err(error) => {
            // If stderr is closed, there is nobody to tell.
            let _ = writeln!(std::io::stderr(), "error: {}", text::one_line(&error));
            ExitCode::FAILURE
        }
    }
}
