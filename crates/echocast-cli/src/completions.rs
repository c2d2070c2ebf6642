//! `echocast completions`

use crate::text;
use anyhow::Result;
use clap::CommandFactory;
use clap_complete::{Shell, generate};

/// Print the script with which a shell completes commands and options
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  source <(echocast completions bash)
  echocast completions zsh > \"${fpath[1]}/_echocast\"
  echocast completions fish > ~/.config/fish/completions/echocast.fish")]
pub struct CompletionsArgs {
    /// Shell
    shell: Shell,
}

/// Prints the completions of the program `Cli`.
pub fn run<Cli: CommandFactory>(args: &CompletionsArgs) -> Result<()> {
    let mut script = Vec::new();
    generate(args.shell, &mut Cli::command(), "echocast", &mut script);
    text::print(&String::from_utf8(script)?)
}
