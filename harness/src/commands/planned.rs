//! From a selection to the suites that are read, the devices and their plans.

use std::thread;

use reference_devices::devices;
use runner::dut::Dut;
use runner::parallel::{self, processors};
use runner::plan::{self, Plan};
use runner::stop::Stop;
use runner::suite::Library;

use super::own::{folder_of, is_of_program};
use super::select::{all_named, known_device};
use crate::exit::Refused;
use crate::nearest::did_you_mean;
use crate::source::{At, Complaint};
use crate::target::{self, Other, Selection, Target};

/// What a selection means.
pub(super) struct Planned {
    /// The suites; where names of files tell which of them the patterns name, these alone.
    pub(super) library: Library,
    pub(super) targets: Vec<Target>,
    /// A plan for each target, with the instances that the patterns do not name.
    pub(super) plans: Vec<Plan>,
}

impl Planned {
    /// Plans a selection, with the `whole` library or what the patterns need of it.
    ///
    /// # Errors
    /// Everything wrong with suites and targets.
    pub(super) fn new(selection: &Selection, whole: bool, stop: &Stop) -> Result<Self, Refused> {
        let load = || {
            let loaded = thread::scope(|scope| -> Result<_, Vec<Complaint>> {
                // The reference devices are read once, which need not wait for the suites.
                scope.spawn(|| devices::all().count());
                load(selection, whole)
            })?;
            known_device(selection, &loaded.0)?;
            Ok(loaded)
        };
        let ((mut library, is_part), targets) = target::resolve_beside(selection, stop, load)?;
        let duts: Vec<&Dut> = targets.iter().map(|target| &target.dut).collect();
        let mut plans = plan_beside(&library, &duts, &selection.others)?;
        if is_part && !all_named(&plans, selection) {
            // What is near may be anywhere.
            library = selection.folders.load()?;
            plans = plan_beside(&library, &duts, &selection.others)?;
        }
        Ok(Self { library, targets, plans })
    }
}

/// The suites, and whether they are those alone that the patterns name. The name of a device that
/// is not ours is held against all of them.
fn load(selection: &Selection, whole: bool) -> Result<(Library, bool), Vec<Complaint>> {
    let Selection { folders, patterns, device, .. } = selection;
    let is_ours = device.as_ref().is_none_or(|name| devices::names().any(|ours| ours == name));
    match whole || !is_ours {
        true => Ok((folders.load()?, false)),
        false => folders.load_named(patterns),
    }
}

/// A plan for each target.
///
/// # Errors
/// Everything wrong with the suites for any of the devices.
pub(super) fn plan_all(library: &Library, targets: &[Target]) -> Result<Vec<Plan>, Refused> {
    let duts: Vec<&Dut> = targets.iter().map(|target| &target.dut).collect();
    plan_for(library, &duts)
}

/// A plan for each device.
///
/// # Errors
/// As [`plan_all`].
pub(super) fn plan_for(library: &Library, duts: &[&Dut]) -> Result<Vec<Plan>, Refused> {
    plan_beside(library, duts, &[])
}

/// A plan for each device, while others of the same device file have suites of their own.
///
/// # Errors
/// As [`plan_all`].
pub(super) fn plan_beside(
    library: &Library,
    duts: &[&Dut],
    others: &[Other],
) -> Result<Vec<Plan>, Refused> {
    let known = |name: &str| others.iter().any(|other| other.known.name == name);
    note_suites_of_nobody(library, duts, known, &|device| {
        let folder = folder_of(device);
        format!(
            "`--target sim:{folder}` runs it on a device that is described in a folder, and \
             `--device {device}` gives another target this name"
        )
    });
    plan_unnoted(library, duts)
}

/// A plan for each device, to check suites. `again` is how to check those for a device of one's
/// own.
///
/// # Errors
/// As [`plan_all`].
pub(super) fn plan_to_check(
    library: &Library,
    duts: &[&Dut],
    again: &dyn Fn(&str) -> String,
) -> Result<Vec<Plan>, Refused> {
    note_suites_of_nobody(library, duts, |_| false, again);
    plan_unnoted(library, duts)
}

fn plan_unnoted(library: &Library, duts: &[&Dut]) -> Result<Vec<Plan>, Refused> {
    let (mut plans, mut complaints) = (Vec::new(), Vec::<Complaint>::new());
    let planned = parallel::map(duts.to_vec(), processors(), |dut| {
        plan::plan(library, dut, &target::models(&dut.eds))
    });
    for plan in planned {
        match plan {
            Ok(plan) => plans.push(plan),
            Err(mut wrong) => {
                // A mistake of one device is mostly a mistake of the next one, too.
                wrong.retain(|wrong| !complaints.iter().any(|told| wrong.is_about_place_of(told)));
                complaints.extend(wrong);
            }
        }
    }
    if complaints.is_empty() { Ok(plans) } else { Err(complaints.into()) }
}

/// Notes the suites for a device that is neither tested nor a reference device, which would
/// silently never run, with what `helps`.
fn note_suites_of_nobody(
    library: &Library,
    duts: &[&Dut],
    known: impl Fn(&str) -> bool,
    helps: &dyn Fn(&str) -> String,
) {
    for suite in &library.suites {
        let Some(At { value: device, .. }) = &suite.file.device else { continue };
        let tested = duts.iter().any(|dut| dut.name == *device) || known(device);
        if !tested && !is_of_program(device) {
            let mut names: Vec<&str> = devices::names().collect();
            names.extend(duts.iter().map(|dut| dut.name.as_str()));
            complain!(
                "note: suite {} is for the device `{device}` and is left out; {}{}",
                suite.name(),
                helps(device),
                did_you_mean(device, names.into_iter())
            );
        }
    }
}
