//! `harness self-test`: proof that this program gives right verdicts on this machine.
//!
//! In virtual time, the reference devices are green, and a sample of mutants is red by the cases of
//! what they break. In real time, a reference device is tested as a device of the user is, and the
//! lateness of the tester's own timers says which failures it could not decide here.

mod clock;
mod real;
mod verdicts;

use std::fmt::Write;

use runner::stop::Stop;
use runner::suite::Library;

use super::counted::counted;
use crate::cli::SelfTestArgs;
use crate::data;
use crate::exit::{Exit, Refused};
use crate::folders::Folders;
use crate::reporter::say;
use crate::source::Complaint;

use clock::Clock;

/// What the self-test found, as it is printed.
#[derive(Default)]
struct Findings {
    /// The text.
    text: String,
    /// What is wrong with the verdicts of this program, a sentence each.
    wrong: Vec<String>,
    /// What this machine or its bus cannot be relied on for, a sentence each.
    weak: Vec<String>,
}

/// Carries out the parts and prints what they found, each as soon as it is over.
///
/// # Errors
/// When a part cannot be carried out, as when an adapter is not there.
pub(super) fn run(args: &SelfTestArgs, stop: &Stop) -> Result<Exit, Refused> {
    real::check(args)?;
    let version = env!("CARGO_PKG_VERSION");
    let (processor, system) = (std::env::consts::ARCH, std::env::consts::OS);
    say(&format!("harness {version} on {system}, {processor}; seed {}\n\n", args.seed));
    let library = of_the_program()?;
    let mut findings = Findings::default();
    let cleans = verdicts::devices(&library, &mut findings)?;
    findings.print();
    verdicts::mutants(&cleans, args, &mut findings)?;
    findings.print();
    if !args.in_process {
        let waits = real::run(&library, args, stop, &mut findings)?;
        findings.print();
        Clock::of(&waits).judge(&cleans, &mut findings);
        findings.print();
    }
    Ok(findings.end(args))
}

/// The suites of this program, whatever the folder is that it runs in, or what replaces its data.
fn of_the_program() -> Result<Library, Vec<Complaint>> {
    match data::folder() {
        None => Library::built_in(),
        Some(_) => Folders::default().load(),
    }
}

impl Findings {
    /// A line with the name of a part.
    fn line(&mut self, part: &str, said: &str) {
        // Writing to a string cannot fail.
        _ = writeln!(self.text, "{part:<9}  {said}");
    }

    /// Prints the text so far.
    fn print(&mut self) {
        say(&std::mem::take(&mut self.text));
    }

    /// Prints the conclusion, and on standard error what is wrong.
    fn end(&self, args: &SelfTestArgs) -> Exit {
        let about = if args.in_process { "in virtual time" } else { "on this machine" };
        let (exit, said) = match (&self.wrong[..], &self.weak[..]) {
            ([], []) => (Exit::Green, format!("The verdicts of this program are right {about}.")),
            ([], weak) => {
                let count = counted(weak.len(), "limit");
                (Exit::Bus, format!("This program is right, and this machine has {count}."))
            }
            (wrong, _) => {
                let count = counted(wrong.len(), "thing");
                (Exit::Holes, format!("Do not trust this program: {count} went wrong."))
            }
        };
        say(&format!("\n{said}\n"));
        self.wrong.iter().for_each(|wrong| complain!("wrong: {wrong}"));
        self.weak.iter().for_each(|weak| complain!("limit: {weak}"));
        exit
    }
}
