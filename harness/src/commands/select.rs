//! The instances that the patterns of a command line select.

use std::collections::{BTreeMap, BTreeSet};
use std::path::is_separator;

use clap::CommandFactory;
use reference_devices::devices;
use runner::plan::{Instance, Plan, is_named};
use runner::suite::Library;

use crate::cli::Cli;
use crate::exit::Refused;
use crate::nearest::{did_you_mean, nearest};
use crate::source::Complaint;
use crate::target::Selection;

/// Keeps the instances that a pattern names: a glob over the full name, or the name of a suite, of
/// a folder of suites or of a case. Without patterns everything is kept but the suites of profiles
/// that the device does not follow; asked for by name, they say why they do not apply. Each list
/// of plans has its selection.
///
/// # Errors
/// The pattern that names nothing on any device.
pub(super) fn select<'s>(
    all: &mut [Vec<Plan>],
    selections: impl Iterator<Item = &'s Selection> + Clone,
) -> Result<(), Refused> {
    for selection in selections.clone() {
        for pattern in &selection.patterns {
            let mut instances = all.iter().flatten().flat_map(|plan| &plan.instances);
            if !instances.any(|instance| names(pattern, instance)) {
                return Err(names_nothing(pattern, all.iter().flatten(), selection));
            }
        }
    }
    for (plans, Selection { patterns, .. }) in all.iter_mut().zip(selections) {
        plans.iter_mut().for_each(|plan| match patterns.is_empty() {
            true => plan.leave_out_foreign(),
            false => {
                plan.ask_for(|instance| patterns.iter().any(|pattern| names(pattern, instance)))
            }
        });
    }
    Ok(())
}

/// The complaint about a pattern, in the device file that says it.
fn names_nothing<'p>(
    pattern: &str,
    plans: impl Iterator<Item = &'p Plan>,
    selection: &Selection,
) -> Refused {
    let plans: Vec<&Plan> = plans.collect();
    let of_another = selection.folders.load().ok().and_then(|library| {
        let suite = library.suites.iter().find(|suite| suite.name() == pattern)?;
        let device = &suite.file.device.as_ref()?.value;
        let targets: BTreeSet<&str> = plans.iter().map(|plan| plan.dut.name.as_str()).collect();
        let targets: Vec<&str> = targets.into_iter().collect();
        Some(format!("suite `{pattern}` is for {device}, the target is {}", targets.join(", ")))
    });
    let message = of_another.unwrap_or_else(|| nothing_named(pattern, plans.into_iter()));
    let in_file = selection.file.iter().flat_map(|file| file.files()).find_map(|file| {
        let said = file.said.select.iter().find(|said| said.value == *pattern)?;
        Some(Complaint::at(&file.source, said.place, message.clone()))
    });
    in_file.map_or_else(|| Refused::usage(message), Refused::from)
}

/// Whether each pattern names something.
pub(super) fn all_named(plans: &[Plan], selection: &Selection) -> bool {
    let all = || plans.iter().flat_map(|plan| &plan.instances);
    selection.patterns.iter().all(|pattern| all().any(|instance| names(pattern, instance)))
}

/// The sentence for a pattern that matches nothing.
fn nothing_named<'p>(pattern: &str, plans: impl Iterator<Item = &'p Plan>) -> String {
    if Cli::command().find_subcommand(pattern).is_some() {
        return format!(
            "`{pattern}` is a command: write it before the options, `harness {pattern} ...`"
        );
    }
    let mut names = BTreeSet::new();
    for instance in plans.flat_map(|plan| &plan.instances) {
        let (suite, case) = (instance.suite.name(), &instance.case().id.value);
        names.insert(format!("{suite}/{case}"));
        let folders = suite.match_indices('/').map(|(place, _)| &suite[..place]);
        names.extend(folders.chain([suite]).map(str::to_owned));
    }
    let whole = did_you_mean(pattern, names.iter().map(String::as_str));
    // `nmt/stp` leaves the folder out, so it is compared with the ends of names.
    let parts = pattern.matches('/').count() + 1;
    let end = |name: &str| {
        let from = name.rmatch_indices('/').nth(parts - 1).map_or(0, |(place, _)| place + 1);
        name[from..].to_owned()
    };
    let ends: BTreeMap<String, &String> = names.iter().map(|name| (end(name), name)).collect();
    let of_end = || {
        let near = nearest(pattern, ends.keys().map(String::as_str))?;
        Some(format!("; did you mean `{}`?", ends.get(near)?))
    };
    let meant = match whole.is_empty() {
        true => of_end().unwrap_or_default(),
        false => whole,
    };
    format!("`{pattern}` names no suite and no case; `harness list` shows all names{meant}")
}

/// Checks that there is a device or a suite of the name that `--device` gives. A device with a data
/// sheet or a folder of its own may have any name, which a slip makes useless for its suites.
///
/// # Errors
/// The name that means nothing.
pub(super) fn known_device(selection: &Selection, library: &Library) -> Result<(), Refused> {
    let (Some(name), Some(target)) = (&selection.device, &selection.target) else { return Ok(()) };
    let mut known = BTreeSet::new();
    devices::names().for_each(|name| _ = known.insert(name));
    for suite in &library.suites {
        known.extend(suite.file.device.as_ref().map(|device| device.value.as_str()));
    }
    if known.contains(name.as_str()) {
        return Ok(());
    }
    let meant = did_you_mean(name, known.into_iter());
    let in_folder = target.strip_prefix("sim:").is_some_and(|device| device.contains(is_separator));
    if selection.eds.is_none() && !in_folder {
        return Err(Refused::usage(format!(
            "--device {name}: no reference device and no suite is for a device of this name; for a \
             device of your own, --eds FILE{meant}"
        )));
    }
    if !meant.is_empty() {
        complain!("note: --device {name}: no suite is for a device of this name{meant}");
    }
    Ok(())
}

fn names(pattern: &str, instance: &Instance) -> bool {
    is_named(pattern, &instance.name())
}
