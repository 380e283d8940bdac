//! `harness check`: load and lint everything, touch no bus.

use std::collections::BTreeSet;
use std::fs;
use std::path::PathBuf;
use std::sync::Arc;

use canopen::catalogue::Catalogue;
use canopen::source::Outline;
use reference_devices::devices::{self, ReferenceDevice};
use reference_devices::freedom::{self, Freedom};
use reference_devices::mutant::{self, Mutant};
use runner::dut::Dut;
use runner::parallel;
use runner::plan::{Fate, Plan};
use runner::suite::{self, Library, Register};

use super::counted::counted;
use super::own::folder_of;
use super::planned::{plan_for, plan_to_check};
use super::rewrite;
use crate::cli::CheckArgs;
use crate::exit::{Exit, Refused};
use crate::files::read_source;
use crate::folders::Folders;
use crate::nearest::did_you_mean;
use crate::reporter::say;
use crate::source::{Complaint, Source};
use crate::target;
use crate::target::{Selection, Target};

/// Checks what the arguments name: suites for every reference device, or devices against all
/// suites, and the catalogue with them.
///
/// # Errors
/// Everything that is wrong.
pub(super) fn run(args: &CheckArgs) -> Result<Exit, Refused> {
    if args.rewrite {
        return rewrite::run(args);
    }
    let selection = args.selection()?;
    let folders = &selection.folders;
    let own = own_dut(args, &selection)?;
    let (devices, files): (Vec<_>, Vec<_>) =
        args.files.iter().cloned().partition(|path| target::holds_device(path));
    let catalogue = folders.catalogue.load()?;
    let names = match devices.as_slice() {
        [] => devices::names().map(str::to_owned).collect(),
        paths => {
            let family =
                |path: &PathBuf| target::with_variants(&path.to_string_lossy(), &catalogue);
            paths.iter().map(family).collect::<Result<Vec<_>, _>>()?.concat()
        }
    };
    let targets = targets_of(&names, &catalogue)?;
    if !devices.is_empty() {
        up_to_date(&names, &catalogue)?;
    }
    // Devices that are named come before the suites, which take longest to read.
    let sound = match devices.as_slice() {
        [] => None,
        _ => Some(sound_deviations(&names, &folders.load_part(|_| false)?)?),
    };
    let library = match files.as_slice() {
        [] => folders.load()?,
        files => with_register(folders, files)?,
    };
    let duts: Vec<&Dut> = targets.iter().map(|target| &target.dut).collect();
    let plans = match &own {
        None => plan_to_check(&library, &duts, &|device| again(&files, folders, device))?,
        Some(own) => {
            // The user's suites are for the user's device, and may name objects that others lack.
            let mut plans = plan_for(&of_the_program(&library), &duts)?;
            let of_own = plan_for(&library, &[own])?;
            of_own.iter().for_each(say_what_is_skipped);
            plans.extend(of_own);
            plans
        }
    };
    // Else last, because suites are what people write.
    let (mutants, freedoms) = match sound {
        Some(sound) => sound,
        None => sound_deviations(&names, &library)?,
    };
    let cases: usize = library.suites.iter().map(|suite| suite.file.cases.len()).sum();
    let instances: usize = plans.iter().map(|plan| plan.instances.len()).sum();
    let counts = [
        (library.suites.len(), "suite"),
        (cases, "case"),
        (instances, "instance"),
        (plans.len(), "device"),
        (library.register.iter().count(), "requirement"),
        (mutants, "mutant"),
        (freedoms, "freedom"),
    ];
    let counts = counts.map(|(count, noun)| counted(count, noun));
    let amended = folders.catalogue.folder.is_some();
    let profiles = amended.then(|| counted(library.catalogue.profiles().len(), "profile") + ", ");
    let profiles = profiles.unwrap_or_default();
    let [suites, cases, instances, devices, requirements, mutants, freedoms] = counts;
    say(&format!(
        "{profiles}{suites}, {cases}, {instances} on {devices}, {requirements}, {mutants}, \
         {freedoms}: no errors\n"
    ));
    Ok(Exit::Green)
}

/// Names the cases of the user's suites that do not run on the device: a slip in what one of them
/// requires looks the same.
fn say_what_is_skipped(plan: &Plan) {
    let of_user = plan.instances.iter().filter(|instance| !instance.suite.is_built_in);
    let lacking = of_user.filter_map(|instance| match &instance.fate {
        Fate::Lacking(reason) => Some((instance.name(), reason)),
        _ => None,
    });
    let lacking: Vec<_> = lacking.collect();
    for (name, reason) in lacking.iter().take(MOST_SKIPPED) {
        complain!("note: {name} would be SKIP on {}: {reason}", plan.dut.name);
    }
    let more = lacking.len().saturating_sub(MOST_SKIPPED);
    if more > 0 {
        complain!("note: and {more} more; `harness list` names them");
    }
}

/// Of how many cases it is said that they do not run.
const MOST_SKIPPED: usize = 20;

/// How to check suites for a device that is not the program's.
fn again(files: &[PathBuf], folders: &Folders, device: &str) -> String {
    let files = files.iter().map(|file| format!(" {}", file.display()));
    let what = files.chain([folders.options()]).collect::<String>();
    let folder = folder_of(device);
    format!(
        "`harness check {folder}{what}` checks it with a device that is described in a folder, \
         and `--eds FILE --device {device}` with a data sheet"
    )
}

/// These reference devices as targets.
///
/// # Errors
/// What is wrong with their files.
fn targets_of(names: &[String], catalogue: &Catalogue) -> Result<Vec<Target>, Refused> {
    let target = |name: &String| {
        let selection = Selection::of_target(Some(&format!("sim:{name}")));
        target::resolve(&selection, catalogue, &Arc::default())
    };
    Ok(names.iter().map(target).collect::<Result<Vec<_>, _>>()?.into_iter().flatten().collect())
}

/// Checks that the data sheets and tables that lie beside descriptions are those of them.
///
/// # Errors
/// The files that are older.
fn up_to_date(names: &[String], catalogue: &Catalogue) -> Result<(), Refused> {
    let mut older = Vec::new();
    for name in names {
        let device = target::reference_device(name, catalogue)?;
        for (path, text) in device.generated_files() {
            if fs::read(&path).is_ok_and(|written| written != text.as_bytes()) {
                let source = Arc::new(Source::new(path, ""));
                let message = format!(
                    "this is not what the description says any more: `harness eds write {name}` \
                     writes it anew"
                );
                older.push(Complaint { source, place: None, message });
            }
        }
    }
    if older.is_empty() { Ok(()) } else { Err(older.into()) }
}

/// How many mutants and freedoms these devices have.
///
/// # Errors
/// Everything that is wrong with them.
fn sound_deviations(names: &[String], library: &Library) -> Result<(usize, usize), Refused> {
    let sound = parallel::try_map(names, |name| {
        let device = target::reference_device(name, &library.catalogue)?;
        let mutants = sound_mutants(&device, &library.register).map(|sound| sound.len());
        let freedoms = sound_freedoms(&device, &library.register).map(|sound| sound.len());
        Ok::<_, Refused>((mutants, freedoms))
    })?;
    let (mut mutants, mut freedoms) = (0, 0);
    let mut complaints = Vec::<Complaint>::new();
    for (of_mutants, of_freedoms) in sound {
        let wrong =
            [of_mutants.map(|count| mutants += count), of_freedoms.map(|count| freedoms += count)];
        for mut wrong in wrong.into_iter().filter_map(Result::err) {
            // A mistake of one device is mostly a mistake of its variants, too.
            wrong.retain(|wrong| !complaints.iter().any(|told| wrong.is_about_place_of(told)));
            complaints.append(&mut wrong);
        }
    }
    if complaints.is_empty() { Ok((mutants, freedoms)) } else { Err(complaints.into()) }
}

/// The library without suites of the user.
fn of_the_program(library: &Library) -> Library {
    let suites = library.suites.iter().filter(|suite| suite.is_built_in);
    Library {
        suites: suites.cloned().collect(),
        register: Arc::clone(&library.register),
        catalogue: Arc::clone(&library.catalogue),
        test_map: Vec::new(),
    }
}

/// The user's device, to check suites with, by its data sheet.
///
/// # Errors
/// When the data sheet cannot be read, or nothing names one.
fn own_dut(args: &CheckArgs, selection: &Selection) -> Result<Option<Dut>, Refused> {
    selection.modules.beside(selection.eds.as_deref())?;
    match (&selection.eds, &args.dut, &args.device) {
        (Some(eds), ..) => target::dut_of_file(selection, eds).map(Some),
        (None, Some(file), _) => Err(Refused::usage(format!(
            "{}: suites are checked with a data sheet, and this device file has no `eds`: --eds \
             FILE",
            file.display()
        ))),
        (None, None, Some(_)) => {
            Err(Refused::usage("--device NAME is the name of a data sheet: --eds FILE".to_owned()))
        }
        (None, None, None) => Ok(None),
    }
}

/// The mutants that are proved on a device, each of which it can be.
///
/// # Errors
/// Everything that is wrong with the files of mutants: also a requirement that the register does
/// not have, unless its document is not loaded.
fn sound_mutants(
    device: &ReferenceDevice,
    register: &Register,
) -> Result<Vec<Mutant>, Vec<Complaint>> {
    let mutants = mutants_proved_on(device)?;
    let mut complaints = Vec::new();
    for mutant in &mutants {
        complaints.extend(mutant.deviation().complaints(device));
        for (number, id) in mutant.breaks.iter().enumerate() {
            if register.find(id).is_none() && !register.lacks_document_of(id) {
                let meant = did_you_mean(id, register.iter().map(|(id, _)| id));
                let message = format!("the register has no requirement {id}{meant}");
                complaints.push(mutant.complain(&["breaks", &number.to_string()], message));
            }
        }
    }
    if complaints.is_empty() { Ok(mutants) } else { Err(complaints) }
}

/// The mutants that are proved on a device, by their files alone.
///
/// # Errors
/// Everything that is wrong with the files of mutants.
pub(super) fn mutants_proved_on(device: &ReferenceDevice) -> Result<Vec<Mutant>, Vec<Complaint>> {
    let mut mutants = mutant::of(device)?;
    let proves_shared = device.description.device == devices::WITH_EVERYTHING;
    mutants.retain(|mutant| !mutant.shared || proves_shared);
    Ok(mutants)
}

/// The freedoms that are tried on a device, each of which it can use.
///
/// # Errors
/// Everything that is wrong with the files of freedoms: also what the register does not have,
/// unless its document is not loaded.
fn sound_freedoms(
    device: &ReferenceDevice,
    register: &Register,
) -> Result<Vec<Freedom>, Vec<Complaint>> {
    let freedoms = freedom::of(device)?;
    let mut complaints = unknown_decisions(device, register);
    for freedom in &freedoms {
        complaints.extend(freedom.deviation().complaints(device));
        if freedom.allowed_by.is_empty() {
            let message = "no requirement or interpretation allows this freedom";
            complaints.push(freedom.complain(&["allowed-by"], message));
        }
        for (number, id) in freedom.allowed_by.iter().enumerate() {
            let known = register.find(id).is_some() || register.decision(id).is_some();
            if !known && !register.lacks_document_of(id) {
                let ids = register.iter().map(|(id, _)| id).chain(register.decision_ids());
                let meant = did_you_mean(id, ids);
                let message = format!("the register has no {id}{meant}");
                complaints.push(freedom.complain(&["allowed-by", &number.to_string()], message));
            }
        }
    }
    if complaints.is_empty() { Ok(freedoms) } else { Err(complaints) }
}

/// What a device says it leaves open by a decision that the register does not have.
fn unknown_decisions(device: &ReferenceDevice, register: &Register) -> Vec<Complaint> {
    let known = |id: &str| register.decision(id).is_some() || register.lacks_document_of(id);
    let open = device.description.not_judged.iter().filter(|(_, id)| !known(id));
    let complain = |(name, id): (&String, &String)| {
        let meant = did_you_mean(id, register.decision_ids());
        let place =
            Outline::of(&device.source).and_then(|outline| outline.key(&["not-judged", name]));
        let message = format!("the register has no interpretation {id}{meant}");
        Complaint { source: Arc::clone(&device.source), place, message }
    };
    open.map(complain).collect()
}

/// Only these suites, with the whole register.
fn with_register(folders: &Folders, files: &[PathBuf]) -> Result<Library, Refused> {
    let mut sources = folders.register_sources()?;
    sources.append(&mut with_vocabulary(files)?);
    Ok(Library::from_part(&sources, &folders.catalogue.load()?)?)
}

/// These suites, and the words and named steps that they may use.
///
/// # Errors
/// When a file cannot be read.
pub(super) fn with_vocabulary(files: &[PathBuf]) -> Result<Vec<Arc<Source>>, Complaint> {
    let beside = files.iter().flat_map(|file| suite::beside(file));
    let files: BTreeSet<PathBuf> = files.iter().cloned().chain(beside).collect();
    files.iter().map(|path| read_source(path)).collect()
}
