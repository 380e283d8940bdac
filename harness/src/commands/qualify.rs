//! `harness qualify`: the proofs of the suites, in virtual time. The first proof is that every case
//! can fail. It rests on the kill matrix of mutants, and on the assertions that the kills rest on.
//! Slips prove what no mutant proves: they are deviations that happen once and late in a case. The
//! second proof is that no case is unjust: nothing is red on a device that uses the freedoms which
//! the documents leave, one at a time, as a personality or mixed at random.

mod alike;
mod assertion;
mod assertions;
mod freedoms;
mod fuzzed;
mod fuzzed_freedoms;
mod matrix;
mod mistakes;
mod record;
mod slip;
mod slips;
mod trial;
mod why;

use std::collections::BTreeMap;
use std::sync::Arc;

use reference_devices::devices;
use runner::parallel;
use runner::suite::model::Case;
use runner::suite::{Library, Suite};

use super::counted::counted;
use super::own::{OwnDevice, is_of_program};
use crate::cli::QualifyArgs;
use crate::exit::{Exit, Refused};
use crate::folders::Folders;
use crate::reporter::say;
use crate::source::At;
use crate::target;

use assertions::Assertions;
pub(super) use assertions::Judged;
use freedoms::Freedoms;
use matrix::Matrix;
pub(super) use matrix::noticed_by;
use slips::Slips;
pub(super) use trial::Clean;
use trial::Fits;

/// Runs the qualification and prints the matrix and what the freedoms showed.
///
/// # Errors
/// When a file does not load or the device is unknown.
pub(crate) fn run(args: &QualifyArgs) -> Result<Exit, Refused> {
    if let Some(sessions) = args.fuzz {
        return fuzzed::run(args, sessions);
    }
    if let Some(sessions) = args.fuzz_freedoms {
        return fuzzed_freedoms::run(args, sessions);
    }
    let mut library = args.folders.load()?;
    if let Some(device) = &args.device {
        bring_home(&mut library, device, &args.folders)?;
    }
    if let Some(mutant) = &args.why {
        return why::run(args, &library, mutant);
    }
    let names = match &args.device {
        Some(name) => target::with_variants(name, &library.catalogue)?,
        None => devices::names().map(str::to_owned).collect(),
    };
    let every: &Fits = &|_| true;
    let cleans = parallel::try_map(&names, |name| Clean::with_freedoms(&library, name))?;
    let matrices = Matrix::of(&cleans, every)?;
    let mut freedoms = Freedoms::of(&cleans)?;
    Freedoms::mix(&mut freedoms, args)?;
    let judging = freedoms.iter().flat_map(Freedoms::judging);
    let mut holes = matrix::holes(&library, &matrices, judging, &again(args));
    holes.extend(of_no_device(&library, args, &names));
    holes.extend(freedoms.iter().flat_map(Freedoms::holes));
    let shown = |verbose: bool| {
        matrices.iter().zip(&freedoms).map(move |(matrix, freedoms)| {
            let mut text = String::new();
            matrix.show(&mut text, verbose);
            freedoms.show(&mut text, verbose);
            (matrix.device(), text)
        })
    };
    if let Some(folder) = &args.matrices {
        record::write_matrices(folder, shown(true))?;
    }
    let mut text: String = shown(args.verbose).map(|(_, text)| text).collect();
    let slips = slips_of(&cleans, &matrices, &freedoms, every)?;
    let assertions = Assertions::of(&library, &matrices, &freedoms, &slips);
    holes.extend(assertions.holes(args.device.is_none()));
    assertions.show(&mut text, args);
    if let Some(file) = &args.record {
        record::write(file, &cleans, &matrices, &assertions)?;
    }
    if args.verbose {
        text.push_str(&format!("slips: {} runs of cases\n", slips.runs()));
    }
    text.push_str(&mistakes::line(&matrices));
    say(&text);
    if holes.is_empty() {
        return Ok(Exit::Green);
    }
    let mut told = BTreeMap::<&str, usize>::new();
    holes.iter().for_each(|hole| *told.entry(hole).or_default() += 1);
    // Mixtures of freedoms that are red for one reason are one hole.
    for hole in holes.iter() {
        match told.remove(hole.as_str()) {
            None => {}
            Some(1) => complain!("hole: {hole}"),
            Some(times) => complain!("hole: {hole} ({times} times)"),
        }
    }
    complain!("{}", counted(holes.len(), "hole"));
    note_where_own_suites_are_proved(args);
    Ok(Exit::Holes)
}

/// The cases of the user that are proved on none of these devices, since their suite names none.
fn of_no_device(library: &Library, args: &QualifyArgs, devices: &[String]) -> Vec<String> {
    if args.folders.only.is_empty() && args.folders.more.is_empty() {
        return Vec::new();
    }
    let own = args.folders.own_of(library.suites.iter().map(|suite| &suite.source));
    let homeless = library.suites.iter().filter(|suite| {
        own.contains(&suite.source.name)
            && suite.file.device.is_none()
            && !devices.iter().any(|device| device == matrix::home(suite))
    });
    let cases = homeless.flat_map(|suite| {
        let name = suite.name();
        suite.file.cases.iter().map(move |case| format!("{name}/{}", case.value.id.value))
    });
    cases.map(|case| format!("case {case} is not proved: its suite has no `device`")).collect()
}

/// The mutants of the program break requirements of the program alone.
fn note_where_own_suites_are_proved(args: &QualifyArgs) {
    let of_program = args.device.as_deref().is_none_or(|name| devices::device(name).is_some());
    if of_program && !args.folders.only.is_empty() {
        complain!(
            "note: suites of your own are proved on a device in a folder, whose `mutants.yaml` \
             breaks their requirements: docs/src/device-as-data.md"
        );
    }
}

/// The command without its mutant that shows what one changes.
fn again(args: &QualifyArgs) -> String {
    let device = args.device.as_ref().map(|device| format!(" {device}")).unwrap_or_default();
    format!("harness qualify{device}{}", args.folders.options())
}

/// A suite of the user that names no device is proved on the user's own device when that is
/// qualified. Elsewhere it would be proved on the device with everything, which is not looked at.
pub(super) fn bring_home(
    library: &mut Library,
    device: &str,
    folders: &Folders,
) -> Result<(), Refused> {
    let described = target::reference_device(device, &library.catalogue)?;
    let name = described.description.device.clone();
    if is_of_program(&name) {
        return Ok(());
    }
    let own = folders.own_of(library.suites.iter().map(|suite| &suite.source));
    for suite in library.suites.iter_mut().filter_map(Arc::get_mut) {
        let file = &mut suite.file;
        if own.contains(&suite.source.name) && file.device.is_none() && file.profile.is_none() {
            file.device = Some(At::new(name.clone(), file.suite.place));
        }
    }
    Ok(())
}

/// The assertions of a case, with the mutants that prove them on its own device, which may be one
/// of the user.
///
/// # Errors
/// When the data of the device do not load.
pub(super) fn assertions_of<'l>(
    library: &'l Library,
    suite: &Suite,
    case: &Case,
    own: &[OwnDevice],
) -> Result<Vec<Judged<'l>>, Refused> {
    let home = devices::names().filter(|name| matrix::is_home(name, suite));
    let own = own.iter().filter(|own| matrix::is_home(&own.name, suite));
    let home = home.map(str::to_owned).chain(own.map(|own| own.path.clone()));
    let fits: &Fits = &|other: &Case| std::ptr::eq(other, case);
    let cleans = home.map(|name| Clean::of(library, &name, fits)).collect::<Result<Vec<_>, _>>()?;
    let matrices = Matrix::of(&cleans, fits)?;
    let slips = slips_of(&cleans, &matrices, &[], fits)?;
    Ok(Assertions::of(library, &matrices, &[], &slips).about(case))
}

/// The proofs by slips for the selected cases, beside mutants and freedoms.
fn slips_of(
    cleans: &[Clean],
    matrices: &[Matrix],
    freedoms: &[Freedoms],
    fits: &Fits,
) -> Result<Slips, Refused> {
    let all = matrices.iter().flat_map(Matrix::proofs);
    let all = all.chain(freedoms.iter().flat_map(Freedoms::proofs));
    let known = all.map(|(assertion, _)| assertion).collect();
    Slips::of(cleans, &known, fits)
}
