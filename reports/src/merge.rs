//! Several runs as one: the shards of a run, or runs of several devices.

use std::collections::{BTreeMap, BTreeSet};

use crate::event::{Origin, RunEnded, RunStarted, Shard};
use crate::run::{CaseRun, DeviceRun, Run};

/// The runs as one. Parts of a test of the same device by the same data sheet stand together; what
/// was tested twice stands side by side. A shard that is missing is the reason why the whole run
/// did not come to its end.
pub fn merged(runs: Vec<Run>) -> Run {
    let mut runs = runs.into_iter();
    let Some(mut all) = runs.next() else { return Run::default() };
    let mut shards: BTreeSet<Shard> = shard(&all).into_iter().collect();
    for run in runs {
        shards.extend(shard(&run));
        all.journals.extend(run.journals.iter().cloned());
        let is_shard = shard(&run).is_some();
        all.started = all.started.take().map(|started| both(started, &run));
        all.ended = match (all.ended.take(), run.ended) {
            (Some(one), Some(other)) => Some(RunEnded {
                exit: one.exit.max(other.exit),
                reason: one.reason.or(other.reason),
                outdated: one.outdated.into_iter().chain(other.outdated).collect(),
            }),
            // One that was cut off is not at its end, and so the whole is not.
            _ => None,
        };
        run.devices.into_iter().for_each(|device| add(&mut all.devices, device, is_shard));
    }
    if let Some(ended) = &mut all.ended
        && let Some(missing) = missing(&shards)
    {
        ended.exit = ended.exit.max(NOT_WHOLE);
        ended.reason =
            Some(ended.reason.take().map_or_else(|| missing.clone(), |it| it + "; " + &missing));
    }
    all
}

fn shard(run: &Run) -> Option<Shard> {
    run.started.as_ref()?.shard
}

/// How both began.
fn both(one: RunStarted, other: &Run) -> RunStarted {
    let Some(other) = &other.started else { return one };
    let target = match one.target.split(", ").any(|known| known == other.target) {
        true => one.target,
        false => format!("{}, {}", one.target, other.target),
    };
    let began = [one.began, other.began].into_iter().flatten().min();
    let grade = if one.grade == other.grade { one.grade } else { crate::Grade::Strict };
    let repeat = one.repeat.max(other.repeat);
    let selected = one.selected || other.selected;
    // Shards leave out the same. What runs of other kinds left out together is not known.
    let same = other.shard.is_some() && one.left_out == other.left_out;
    let left_out = one.left_out.filter(|_| same);
    let suites = together(one.suites, &other.suites);
    let devices = together(one.devices, &other.devices);
    let files = together(one.files, &other.files);
    RunStarted {
        target,
        began,
        grade,
        repeat,
        selected,
        left_out,
        suites,
        devices,
        files,
        shard: None,
        ..one
    }
}

/// What both were made with, each once.
fn together(mut some: Vec<Origin>, others: &[Origin]) -> Vec<Origin> {
    let new: Vec<Origin> = others.iter().filter(|it| !some.contains(it)).cloned().collect();
    some.extend(new);
    some
}

fn add(devices: &mut Vec<DeviceRun>, device: DeviceRun, is_shard: bool) {
    let of = |device: &DeviceRun| {
        let info = &device.info;
        (info.device.clone(), info.node, info.identity, info.versions.clone(), info.sheet.clone())
    };
    let same = devices.iter().position(|known| of(known) == of(&device));
    // A case that ran twice was tried on two states of a device. Shards have in common what proves
    // that their cases can be relied on.
    let Some(known) = same.filter(|known| is_shard || are_apart(&devices[*known], &device)) else {
        let name = free_name(devices, &device);
        let info = crate::DeviceStarted { device: name, ..device.info };
        return devices.push(DeviceRun { info, ..device });
    };
    let known = &mut devices[known];
    for suite in device.suites {
        match known.suites.iter_mut().find(|known| known.name == suite.name) {
            None => known.suites.push(suite),
            Some(known) => {
                let named = known.cases.iter().enumerate().map(|(place, case)| (name(case), place));
                let places: BTreeMap<String, usize> = named.collect();
                for case in suite.cases {
                    let Some(place) = places.get(&name(&case)) else {
                        known.cases.push(case);
                        continue;
                    };
                    // What one shard found is not lost.
                    let known = &mut known.cases[*place];
                    if case.verdict().weight() > known.verdict().weight() {
                        *known = case;
                    }
                }
            }
        }
    }
}

/// Whether no case is in both.
fn are_apart(one: &DeviceRun, other: &DeviceRun) -> bool {
    let names: BTreeSet<String> = one.cases().map(name).collect();
    other.cases().all(|case| !names.contains(&name(case)))
}

fn name(case: &CaseRun) -> String {
    case.info.name()
}

/// The name of a device, with the software or a number where another one has it already: two
/// versions of a firmware stand side by side.
fn free_name(devices: &[DeviceRun], device: &DeviceRun) -> String {
    let name = &device.info.device;
    let is_free = |name: &str| devices.iter().all(|known| known.info.device != name);
    let software = &device.info.versions.software;
    let is_other = devices.iter().all(|known| known.info.versions.software != *software);
    let software = software.iter().filter(|_| is_other).map(|it| format!("{name} {it}"));
    let numbered = (2..).map(|number| format!("{name} ({number})"));
    let names = std::iter::once(name.clone()).chain(software).chain(numbered);
    names.into_iter().find(|name| is_free(name)).unwrap_or_default()
}

/// The shards that are not there.
fn missing(shards: &BTreeSet<Shard>) -> Option<String> {
    let of = shards.first()?.of;
    let there = |place: &usize| shards.contains(&Shard { place: *place, of });
    let missing = (1..=of).filter(|place| !there(place)).map(|place| format!("{place}/{of}"));
    let missing: Vec<String> = missing.collect();
    (!missing.is_empty()).then(|| format!("the shard {} is missing", missing.join(", ")))
}

/// The exit code of a run of which a part did not run, as if its bus had failed.
const NOT_WHOLE: u8 = 6;
