//! From a selection to the suites that are read, the devices and their plans.

use std::thread;

use reference_devices::devices;
use runner::dut::Dut;
use runner::parallel::{self, processors};
use runner::plan::{self, Plan};
use runner::stop::Stop;
use runner::suite::Library;

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
    note_suites_of_nobody(library, duts, others);
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
/// silently never run.
fn note_suites_of_nobody(library: &Library, duts: &[&Dut], others: &[Other]) {
    for suite in &library.suites {
        let Some(At { value: device, .. }) = &suite.file.device else { continue };
        let tested = duts.iter().any(|dut| dut.name == *device)
            || others.iter().any(|other| other.known.name == *device);
        if !tested && !devices::names().any(|name| name == device) {
            complain!(
                "note: suite {} is for the device `{device}` and is left out; `--device {device}` \
                 names the device under test{}",
                suite.name(),
                did_you_mean(device, devices::names())
            );
        }
    }
}
