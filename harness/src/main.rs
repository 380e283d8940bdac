//! The `harness` program.

use std::io::Write;
use std::process::ExitCode;

use clap::Parser;
use harness::cli::Cli;
use harness::commands;
use harness::exit::Exit;

fn main() -> ExitCode {
    // A panic is a bug of ours; its message is on the terminal already.
    let exit = std::panic::catch_unwind(|| match Cli::try_parse() {
        Ok(cli) => commands::run(cli),
        Err(error) => {
            let printed = error.print().and_then(|()| std::io::stdout().flush());
            match printed {
                // When standard output is closed, no reader is left for the message.
                Err(why) if why.kind() != std::io::ErrorKind::BrokenPipe => Exit::File,
                _ if error.use_stderr() => Exit::Usage,
                _ => Exit::Green,
            }
        }
    });
    let exit = exit.unwrap_or_else(|_| {
        // A failed write to standard error cannot be reported.
        _ = writeln!(
            std::io::stderr(),
            "this is a bug of the harness: please report it with the command you ran"
        );
        Exit::Internal
    });
    ExitCode::from(exit as u8)
}
