//! `harness completions`: what a shell needs to complete commands, options and their values.

use clap::CommandFactory;

use crate::cli::{Cli, CompletionsArgs};
use crate::exit::{Exit, Refused};
use crate::reporter::say_report;

/// Prints the completions for a shell.
///
/// # Errors
/// None.
pub(super) fn run(args: &CompletionsArgs) -> Result<Exit, Refused> {
    let mut text = Vec::new();
    clap_complete::generate(args.shell, &mut Cli::command(), "harness", &mut text);
    say_report(&String::from_utf8_lossy(&text));
    Ok(Exit::Green)
}
