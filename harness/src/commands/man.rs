//! `harness man`: the manual pages, from the same source as `--help`.

use std::fs;

use clap::CommandFactory;
use clap_mangen::{Man, generate_to};

use crate::cli::{Cli, ManArgs};
use crate::exit::{Exit, Refused};
use crate::files::words;
use crate::reporter::{say, say_report};

/// Writes the pages of all commands into a folder, `harness-fuzz-repro.1` for `harness fuzz repro`,
/// or prints that of the program.
///
/// # Errors
/// When a page cannot be written.
pub(super) fn run(args: &ManArgs) -> Result<Exit, Refused> {
    let command = Cli::command().disable_help_subcommand(true);
    let Some(folder) = &args.folder else {
        let mut text = Vec::new();
        // Writing to memory cannot fail.
        _ = Man::new(command).render(&mut text);
        say_report(&String::from_utf8_lossy(&text));
        return Ok(Exit::Green);
    };
    let written = fs::create_dir_all(folder).and_then(|()| generate_to(command, folder));
    written.map_err(|error| Refused {
        exit: Exit::File,
        message: format!("error: {}: {}", folder.display(), words(&error)),
    })?;
    say(&format!("{}: the pages are written\n", folder.display()));
    Ok(Exit::Green)
}
