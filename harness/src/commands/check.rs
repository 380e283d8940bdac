//! `harness check`: load and lint everything, touch no bus.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use reference_devices::devices;
use reference_devices::mutant::{self, Mutant};

use super::counted;
use super::run::plan_all;
use crate::cli::{CheckArgs, Selection};
use crate::exit::{Exit, Refused};
use crate::reporter::say;
use crate::source::{Complaint, Source};
use crate::suite::{Folders, Library};
use crate::target;

/// Checks what the arguments name, for every reference device.
///
/// # Errors
/// Everything that is wrong.
pub(super) fn run(args: &CheckArgs) -> Result<Exit, Refused> {
    let library = match args.files.as_slice() {
        [] => Library::load(&args.folders)?,
        files => with_register(&args.folders, files)?,
    };
    let targets = target::resolve(&Selection::of_target(None), &Arc::new(AtomicBool::new(false)))?;
    let plans = plan_all(&library, &targets)?;
    let mut mutants = 0;
    for name in devices::names() {
        let device = target::reference_device(name)?;
        let mutants_of_it = mutant::of(&device)?;
        let proved_on_it = |mutant: &&Mutant| !mutant.shared || name == devices::WITH_EVERYTHING;
        for mutant in mutants_of_it.iter().filter(proved_on_it) {
            mutant::build(&device, 1, mutant).map(drop)?;
            mutants += 1;
        }
    }
    let cases: usize = library.suites.iter().map(|suite| suite.file.cases.len()).sum();
    let instances: usize = plans.iter().map(|plan| plan.instances.len()).sum();
    let counts = [
        (library.suites.len(), "suite"),
        (cases, "case"),
        (instances, "instance"),
        (plans.len(), "device"),
        (library.register.iter().count(), "requirement"),
        (mutants, "mutant"),
    ];
    let counts = counts.map(|(count, noun)| counted(count, noun));
    let [suites, cases, instances, devices, requirements, mutants] = counts;
    say(&format!(
        "{suites}, {cases}, {instances} on {devices}, {requirements}, {mutants}: no errors\n"
    ));
    Ok(Exit::Green)
}

/// Only these suites, with the whole register.
fn with_register(folders: &Folders, files: &[std::path::PathBuf]) -> Result<Library, Refused> {
    let mut sources = Library::register_sources(folders)?;
    for path in files {
        let name = path.display().to_string();
        let text = std::fs::read_to_string(path).map_err(|error| {
            let source = Arc::new(Source { name: name.clone(), text: String::new() });
            Refused::from(vec![Complaint { source, place: None, message: error.to_string() }])
        })?;
        sources.push(Arc::new(Source { name, text }));
    }
    Ok(Library::from_sources(&sources)?)
}
