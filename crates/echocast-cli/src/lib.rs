//! The `echocast` program: arguments, progress and printing. The work is the library's. A crate of its own, because the
//! Python package includes the program, too.

#![forbid(unsafe_code)]

mod bags;
mod bench;
mod blender;
mod choice;
mod cloud_info;
mod completions;
mod convert;
mod flight;
mod formats;
mod frames;
mod generate;
mod import;
mod info;
mod input;
mod interrupt;
mod names;
mod output;
mod picture;
mod pipe;
mod place;
mod plan;
mod preview;
mod progress;
mod radar;
mod record;
mod report;
mod run;
mod scan;
mod sensors;
mod strips;
mod text;
mod trajectory;
mod usage;
mod weather;

use clap::{Parser, Subcommand};
use echocast::{Engine, Scene};
use std::ffi::OsString;
use std::io::Write as _;

/// Simulates depth sensors: casts the beams of LiDARs, depth cameras, sonars and radars into a 3D scene and writes what the
/// instrument would have reported, every point labelled.
#[derive(Parser)]
#[command(
    name = "echocast",
    arg_required_else_help = true,
    args_conflicts_with_subcommands = true,
    override_usage = "echocast <COMMAND>\n       echocast --version [--verbose]",
    after_help = "Example:\n  echocast generate street -o street.glb\n  echocast scan street.glb --sensor velodyne_vlp32c --camera Corner -o scan.las --preview scan.png\n\n\
                  Exit codes:\n  \
                  0    success\n  \
                  1    the work has failed: a file cannot be read or written, or its content is wrong; the system\n       \
                  is out of memory or threads; the simulation is not possible\n  \
                  2    wrong usage: an option, name, value or file ending is unknown, not allowed, or cannot be\n       \
                  combined with the others, the sensor or the scene; nothing is written\n  \
                  130  interrupted\n\n\
                  Environment:\n  \
                  ECHOCAST_SIMD  vector instructions: avx512, avx2 or plain [default: the widest the processor has];\n                 \
                  values computed for surfaces may differ in their last digits"
)]
struct Cli {
    /// Print the version
    #[arg(short = 'V', long)]
    version: bool,
    /// Also print which vector instructions are used
    #[arg(long, requires = "version")]
    verbose: bool,
    #[command(subcommand)]
    command: Option<Command>,
}

#[derive(Subcommand)]
enum Command {
    Scan(Box<scan::ScanArgs>),
    Run(Box<run::RunArgs>),
    Plan(Box<plan::PlanArgs>),
    Sensors(sensors::SensorsArgs),
    Info(info::InfoArgs),
    Convert(convert::ConvertArgs),
    Trajectory(trajectory::TrajectoryArgs),
    Import(import::ImportArgs),
    Preview(preview::PreviewArgs),
    Generate(generate::GenerateArgs),
    Formats(formats::FormatsArgs),
    Bench(Box<bench::BenchArgs>),
    Completions(completions::CompletionsArgs),
}

/// Runs the command line `arguments`, the first of which is the program's name. Returns the exit code.
///
/// To be called once, by a process that does nothing else: it handles signals, and ends the process at the second.
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> u8 {
    run_with(arguments, None)
}

/// [`run`], with `scene` as what Blender has read from the file `scene.blend` of a scenario.
pub fn run_with(arguments: impl IntoIterator<Item = OsString>, scene: Option<Scene>) -> u8 {
    let arguments: Vec<OsString> = arguments.into_iter().collect();
    echocast_memory::end_with(interrupt::without_memory);
    // If this fails, a file that grows too long ends the program, as usual.
    let _ = interrupt::outlive_full_files();
    let cli = match Cli::try_parse_from(&arguments) {
        Ok(cli) => cli,
        Err(message) => {
            if !message.use_stderr()
                && let Err(error) = text::check_stdout()
            {
                text::note(&format!("error: {error}"));
                return usage::FAILED;
            }
            // Help, or an error. A failure to print it cannot be reported either.
            let _ = message.print();
            return u8::try_from(message.exit_code()).unwrap_or(u8::MAX);
        }
    };
    let done = match cli.command {
        // Without a command, that is all there is to do.
        None => print_version(cli.verbose),
        Some(command) => command.run(arguments.get(1..).unwrap_or_default(), scene),
    };
    match done {
        Ok(()) => 0,
        Err(error) => {
            let code = usage::exit_code(&error);
            if code == usage::INTERRUPTED {
                interrupt::report_interruption();
            } else {
                // If stderr is closed, the message is lost.
                let _ = writeln!(std::io::stderr(), "error: {}", text::one_line(&error));
            }
            code
        }
    }
}

impl Command {
    /// `arguments` are those of the command line, `scene` what Blender has read.
    fn run(self, arguments: &[OsString], scene: Option<Scene>) -> anyhow::Result<()> {
        match self {
            Command::Scan(args) => scan::run(&args),
            Command::Run(args) => run::run(&args, arguments, scene),
            Command::Plan(args) => plan::run(&args),
            Command::Sensors(args) => sensors::run(&args),
            Command::Info(args) => info::run(&args),
            Command::Convert(args) => convert::run(&args),
            Command::Trajectory(args) => trajectory::run(&args),
            Command::Import(args) => import::run(&args),
            Command::Preview(args) => preview::run(&args),
            Command::Generate(args) => generate::run(&args),
            Command::Formats(args) => formats::run(&args),
            Command::Bench(args) => bench::run(&args),
            Command::Completions(args) => completions::run::<Cli>(&args),
        }
    }
}

/// Prints the version, and if `verbose` also which vector instructions are used.
fn print_version(verbose: bool) -> anyhow::Result<()> {
    let mut message = concat!("echocast ", env!("CARGO_PKG_VERSION"), "\n").to_owned();
    if verbose {
        let engine = Engine::with_threads(1)?;
        let (major, minor, patch) = engine.embree_version();
        let isa = match engine.packet_width() {
            16 => "AVX-512",
            8 => "AVX",
            _ => "SSE or NEON",
        };
        let (vectors, width) = (engine.vectors(), engine.packet_width());
        message += &format!("kernels: {vectors}\nEmbree {major}.{minor}.{patch}: {isa}, packets of {width} rays\n");
    }
    text::print(&message)
}
