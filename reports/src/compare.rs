//! Compares two runs.

use std::collections::{BTreeMap, BTreeSet};

use crate::characteristics::Characteristic;
use crate::comparison::{Change, Comparison, Moved};
use crate::fact::facts;
use crate::run::Run;
use crate::style::clean;
use crate::verdict::Verdict;

/// What is different in `now` from `before`, on the devices that are tested now.
pub fn compared(now: &Run, before: &Run) -> Comparison {
    let tested = |device: &str| now.devices.iter().any(|it| it.info.device == device);
    let (causes, old_causes) = (causes(now, tested), causes(before, tested));
    let (verdicts, old_verdicts) = (verdicts(now, tested), verdicts(before, tested));
    let names: BTreeSet<_> = verdicts.keys().chain(old_verdicts.keys()).collect();
    let change = |key: &&(String, String)| {
        let (before, now) = (old_verdicts.get(*key).copied(), verdicts.get(*key).copied());
        let (device, name) = (*key).clone();
        (before != now).then_some(Change { device, name, before, now })
    };
    let mut changed: Vec<Change> = names.iter().filter_map(change).collect();
    // What needs work is read first; among equals, the names are in order.
    changed.sort_by_key(Change::rank);
    let is_red = |verdict: Option<Verdict>| verdict.is_some_and(|it| now.is_red(it));
    Comparison {
        new: causes.difference(&old_causes).cloned().collect(),
        cured: old_causes.difference(&causes).cloned().collect(),
        as_before: causes.intersection(&old_causes).count(),
        is_regression: changed.iter().any(|it| is_red(it.now) && !is_red(it.before)),
        moved: moved(now, before),
        changed,
    }
}

/// The figures of the same quantity on the same device whose intervals do not touch.
fn moved(now: &Run, before: &Run) -> Vec<Moved> {
    let mut all = Vec::new();
    for device in &now.devices {
        let name = &device.info.device;
        let Some(old) = before.devices.iter().find(|it| it.info.device == *name) else { continue };
        let old = old.characteristics();
        for now in device.characteristics() {
            let Some(before) = old.iter().find(|it| it.what == now.what) else { continue };
            let (median, p99) = (before.median_moved(&now), before.p99_moved(&now));
            let moved = |figure, before, now: &Characteristic, value| Moved {
                device: clean(name),
                what: now.what,
                figure,
                unit: now.unit,
                before,
                now: value,
            };
            if median {
                all.push(moved("median", before.median, &now, now.median));
            }
            if p99 {
                all.push(moved("99 %", before.p99, &now, now.p99));
            }
        }
    }
    all
}

/// The causes, each with its device and its service.
fn causes(run: &Run, of: impl Fn(&str) -> bool) -> BTreeSet<String> {
    let facts = facts(run).into_iter().filter_map(|fact| {
        // A fact may show on several devices.
        let (_, device, case) = *fact.cases.iter().find(|it| of(&it.1.info.device))?;
        let cause = fact.cause()?.to_string();
        let named = device.info.objects.in_text(&cause);
        Some(clean(&format!("{} {}: {named}", device.info.device, case.info.suite)))
    });
    facts.collect()
}

fn verdicts(run: &Run, of: impl Fn(&str) -> bool) -> BTreeMap<(String, String), Verdict> {
    let cases = run.cases().filter(|(device, _)| of(&device.info.device));
    let named = cases.map(|(device, case)| {
        ((clean(&device.info.device), clean(&case.info.name())), case.verdict())
    });
    named.collect()
}
