//! Several runs as one: the shards of a run, or runs of several devices.

use std::collections::BTreeSet;

use crate::event::{RunEnded, RunStarted, Shard};
use crate::run::{DeviceRun, Run};

/// The runs as one. What was tested on the same device by the same data sheet stands together; a
/// shard that is missing is the reason why the whole run did not come to its end.
pub fn merged(runs: Vec<Run>) -> Run {
    let mut runs = runs.into_iter();
    let Some(mut all) = runs.next() else { return Run::default() };
    let mut shards: BTreeSet<Shard> = shard(&all).into_iter().collect();
    for run in runs {
        shards.extend(shard(&run));
        all.started = all.started.take().map(|started| both(started, &run));
        all.ended = match (all.ended.take(), run.ended) {
            (Some(one), Some(other)) => Some(RunEnded {
                exit: one.exit.max(other.exit),
                reason: one.reason.or(other.reason),
            }),
            // One that was cut off is not at its end, and so the whole is not.
            _ => None,
        };
        run.devices.into_iter().for_each(|device| add(&mut all.devices, device));
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
    RunStarted { target, began, grade, shard: None, ..one }
}

fn add(devices: &mut Vec<DeviceRun>, device: DeviceRun) {
    let of = |device: &DeviceRun| {
        let info = &device.info;
        (info.device.clone(), info.node, info.identity, info.versions.clone(), info.sheet.clone())
    };
    let Some(known) = devices.iter_mut().find(|known| of(known) == of(&device)) else {
        return devices.push(device);
    };
    for suite in device.suites {
        match known.suites.iter_mut().find(|known| known.name == suite.name) {
            None => known.suites.push(suite),
            Some(known) => {
                let is_new = |case: &crate::CaseRun| {
                    let name = (&case.info.case, &case.info.instance);
                    known.cases.iter().all(|one| (&one.info.case, &one.info.instance) != name)
                };
                let new: Vec<_> = suite.cases.into_iter().filter(is_new).collect();
                known.cases.extend(new);
            }
        }
    }
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
