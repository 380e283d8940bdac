//! `harness self-test`: proof that this program gives right verdicts on this machine.
//!
//! In virtual time, the reference devices are green, and a sample of mutants is red by the cases of
//! what they break. In real time, a reference device is tested as a device of the user is, and the
//! lateness of the tester's own timers says which failures it could not decide here.

mod clock;
mod findings;
mod real;
mod verdicts;

use runner::stop::Stop;
use runner::suite::Library;

use crate::cli::SelfTestArgs;
use crate::data;
use crate::exit::{Exit, Refused};
use crate::folders::Folders;
use crate::reporter::say;
use crate::source::Complaint;
use crate::version::VERSION;

use clock::Clock;
use findings::Findings;

/// Carries out the parts and prints what they found, each as soon as it is over.
///
/// # Errors
/// When a part cannot be carried out, as when an adapter is not there.
pub(super) fn run(args: &SelfTestArgs, stop: &Stop) -> Result<Exit, Refused> {
    real::check(args)?;
    let (processor, system) = (std::env::consts::ARCH, std::env::consts::OS);
    say(&format!("harness {VERSION} on {system}, {processor}; seed {}\n\n", args.seed));
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
