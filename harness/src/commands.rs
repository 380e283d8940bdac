//! The commands, a file each.
//!
//! A command asks the other modules and prints what they answer. Options and their help belong to
//! [`cli`](crate::cli).

mod book;
mod check;
mod completions;
mod counted;
mod decode;
mod dry_run;
mod eds;
mod estimate;
mod explain;
mod fuzz;
mod init;
mod list;
mod man;
mod monitor;
mod own;
mod planned;
mod qualify;
mod recorded;
mod report;
mod restore;
mod rewrite;
mod run;
mod scan;
mod schema;
mod select;
mod self_test;
mod serve;
mod trace;
mod used;
mod waive;

use crate::cli::{Cli, Command};
use crate::data;
use crate::exit::{Exit, Refused};
use crate::reporter::{harmless, unsaid};
use crate::signals;

/// Carries out what the command line asks for.
pub fn run(cli: Cli) -> Exit {
    let stop = signals::listen();
    let done = data::read().and_then(|()| match cli.command {
        None => run::run(&cli.run, &stop),
        Some(Command::Run(args)) => run::run(&args, &stop),
        Some(Command::List(args)) => list::run(&args, &stop),
        Some(Command::Check(args)) => check::run(&args),
        Some(Command::Serve(args)) => serve::run(&args, &stop),
        Some(Command::Scan(args)) => scan::run(&args, &stop),
        Some(Command::Qualify(args)) => qualify::run(&args),
        Some(Command::Fuzz(args)) => fuzz::run(&args, &stop),
        Some(Command::Trace(args)) => trace::run(&args),
        Some(Command::Explain(args)) => explain::run(&args),
        Some(Command::Eds(command)) => eds::run(&command, &stop),
        Some(Command::Decode(args)) => decode::run(&args),
        Some(Command::Monitor(args)) => monitor::run(&args, &stop),
        Some(Command::Book(args)) => book::run(&args),
        Some(Command::Report(args)) => report::run(&args),
        Some(Command::Waive(args)) => waive::run(&args),
        Some(Command::Restore(args)) => restore::run(&args, &stop),
        Some(Command::Init(args)) => init::run(&args, &stop),
        Some(Command::Schema(args)) => schema::run(&args),
        Some(Command::SelfTest(args)) => self_test::run(&args, &stop),
        Some(Command::Completions(args)) => completions::run(&args),
        Some(Command::Man(args)) => man::run(&args),
    });
    let exit = done.unwrap_or_else(|Refused { exit, message }| {
        complain!("{}", harmless(&message));
        exit
    });
    if unsaid() { exit.max(Exit::File) } else { exit }
}
