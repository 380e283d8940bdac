//! Compares two runs.

use std::collections::{BTreeMap, BTreeSet};

use crate::cause::Cause;
use crate::characteristics::Characteristic;
use crate::comparison::{Change, Comparison, KnownCause, Moved};
use crate::event::{Origin, RunStarted};
use crate::fact::{Noticed, facts};
use crate::junit::moment_in_words;
use crate::run::{CaseRun, DeviceRun, Run};
use crate::style::clean;
use crate::terminal::came_instead;
use crate::verdict::Verdict;

/// What is different in `now` from `before`, on the devices that are tested now.
pub fn compared(now: &Run, before: &Run) -> Comparison {
    let tested = |device: &str| now.devices.iter().any(|it| it.info.device == device);
    let (mut causes, old_causes) = (causes(now, tested), causes(before, tested));
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
    let decided = decided(now);
    let (mut as_before, mut cured, mut not_decided) = (Vec::new(), Vec::new(), Vec::new());
    for old in &old_causes {
        if let Some(same) = causes.iter().find(|it| it.is_same(old)) {
            as_before.push(same.known.verdict);
        } else {
            match old.open(&decided, &verdicts) {
                None => cured.push(old.known.clone()),
                Some(said) => {
                    let text = format!("{}: not decided now: {said}", old.known.text);
                    not_decided.push(KnownCause { text, ..old.known });
                }
            }
        }
    }
    causes.retain(|it| !old_causes.iter().any(|old| it.is_same(old)));
    let mut new: Vec<KnownCause> = causes.into_iter().map(|it| it.known).collect();
    [&mut new, &mut cured, &mut not_decided].into_iter().for_each(|causes| causes.sort());
    let mut runs = [said(now), said(before)];
    let files = [now, before].map(|run| run.started.as_ref().map(files).unwrap_or_default());
    if files[0] != files[1] {
        // What was not tried before, or is not waived now, is red by these.
        for (said, files) in runs.iter_mut().zip(files) {
            said.push_str(&clean(&format!(
                ", with {}",
                Origin::in_words(&files).unwrap_or_default()
            )));
        }
    }
    Comparison {
        runs,
        notes: same_firmware(now, before).into_iter().collect(),
        new,
        cured,
        not_decided,
        as_before,
        is_regression: changed.iter().any(|it| is_red(it.now) && !is_red(it.before)),
        moved: moved(now, before),
        changed,
    }
}

/// A run by its target, its devices and when it began.
fn said(run: &Run) -> String {
    let Some(started) = &run.started else { return String::new() };
    let device = |device: &DeviceRun| {
        let info = &device.info;
        let software = info.versions.software.iter().map(|it| format!(", software {it}"));
        format!("{} (node {}{})", info.device, info.node, software.collect::<String>())
    };
    let devices: Vec<String> = run.devices.iter().map(device).collect();
    let began = started.began.map_or_else(
        || "in virtual time".to_owned(),
        |it| format!("began {}", moment_in_words(it)),
    );
    let devices = match devices.len() {
        many if many > MOST_DEVICES => format!("{many} devices"),
        _ => devices.join(", "),
    };
    let target = &started.target;
    let program = program(started).map(|it| format!(" (its SHA-256: {})", it.sha256));
    let target = target.clone() + &program.unwrap_or_default();
    let journals = Origin::in_words(&run.journals).map(|it| format!(", journal {it}"));
    let journals = journals.unwrap_or_default();
    clean(&format!("{devices}, target {target}, {began}, harness {}{journals}", started.harness))
}

/// The program under test, where the device is one.
fn program(started: &RunStarted) -> Option<&Origin> {
    let is_program = |file: &&Origin| is_of_target(started, file);
    started.files.iter().find(is_program).filter(|_| started.target.contains("exec:"))
}

/// Whether the target names a file: a new firmware is what runs are compared for.
fn is_of_target(started: &RunStarted, file: &Origin) -> bool {
    started.target.contains(&file.from)
}

/// What is said of runs that tested the same program, or devices that name the same software:
/// nothing that is different comes from the firmware then, or nobody can tell.
fn same_firmware(now: &Run, before: &Run) -> Option<String> {
    let programs = [now, before].map(|run| run.started.as_ref().and_then(program));
    if let [Some(now), Some(before)] = programs {
        let text = "both runs tested the same program: its SHA-256 did not change";
        return (now.sha256 == before.sha256).then(|| text.to_owned());
    }
    let software = |run: &Run| {
        let of = |device: &DeviceRun| {
            let info = &device.info;
            Some((info.device.clone(), info.versions.software.clone()?))
        };
        run.devices.iter().filter_map(of).collect::<BTreeSet<_>>()
    };
    let (now, before) = (software(now), software(before));
    let text = "the software version (100Ah) is the same in both runs";
    (!now.is_empty() && now == before).then(|| text.to_owned())
}

/// What a run is made with that decides which cases run and what is waived. What the target names
/// is not among it.
fn files(started: &RunStarted) -> Vec<Origin> {
    let of_user = started.files.iter().filter(|file| !is_of_target(started, file));
    started.suites.iter().chain(of_user).cloned().collect()
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

/// Device and case.
type Name = (String, String);

/// A cause of a run, and the cases that show it.
struct Shown<'r> {
    known: KnownCause,
    /// The same without what differs from instance to instance.
    kind: String,
    causes: BTreeSet<(&'r str, &'r Cause)>,
    cases: BTreeSet<Name>,
}

impl Shown<'_> {
    /// Whether both runs show it: in the same words, or by a cause of a case that is in both. The
    /// case that explains the others may be in one run only.
    fn is_same(&self, other: &Shown<'_>) -> bool {
        self.kind == other.kind || !self.causes.is_disjoint(&other.causes)
    }

    /// How many of its cases the other run does not decide, and why; `None` where all are decided.
    fn open(&self, decided: &BTreeSet<Name>, verdicts: &BTreeMap<Name, Verdict>) -> Option<String> {
        let open: Vec<&Name> = self.cases.iter().filter(|name| !decided.contains(*name)).collect();
        let mut reasons = BTreeMap::<&str, usize>::new();
        for name in &open {
            let reason = verdicts.get(*name).map_or("not run", |verdict| verdict.name());
            *reasons.entry(reason).or_default() += 1;
        }
        let reasons = reasons.into_iter().map(|(reason, count)| format!("{count} {reason}"));
        let reasons = reasons.collect::<Vec<_>>().join(", ");
        let cases = if self.cases.len() == 1 { "case" } else { "cases" };
        let said = format!("{} of {} {cases} ({reasons})", open.len(), self.cases.len());
        (!open.is_empty()).then_some(said)
    }
}

/// The causes, each with its device and the service of the case that explains the others.
fn causes(run: &Run, of: impl Fn(&str) -> bool) -> Vec<Shown<'_>> {
    let facts = facts(run).into_iter().filter_map(|fact| {
        // A fact may show on several devices.
        let is_tested = |noticed: &&Noticed<'_>| of(&noticed.1.info.device);
        let tested = || fact.cases.iter().filter(is_tested);
        let (_, device, case) = *Some(&fact.first).filter(is_tested).or_else(|| tested().next())?;
        let cause = fact.cause()?;
        let said = |cause: &str| {
            let named = device.info.objects.in_text(cause);
            clean(&format!("{} {}: {named}", device.info.device, case.info.suite))
        };
        let kind = said(&cause.to_string());
        // The values of the case that explains the others: a cause has none.
        let values = case.outcome.problem().map(came_instead);
        let text = said(&cause.with(values.as_deref().unwrap_or(&cause.difference)));
        let verdict = tested().map(|(.., it)| it.verdict()).max_by_key(|it| it.weight())?;
        let causes = tested().filter_map(|(_, device, it)| {
            Some((device.info.device.as_str(), it.cause.as_deref()?))
        });
        let causes = causes.collect();
        let cases = tested().map(|(_, device, case)| name(device, case)).collect();
        Some(Shown { known: KnownCause { text, verdict }, kind, causes, cases })
    });
    facts.collect()
}

/// The cases that ran and said what they can say about the device.
fn decided(run: &Run) -> BTreeSet<Name> {
    let decided = run.cases().filter(|(_, case)| case.outcome.is_decided());
    decided.map(|(device, case)| name(device, case)).collect()
}

fn name(device: &DeviceRun, case: &CaseRun) -> Name {
    (clean(&device.info.device), clean(&case.info.name()))
}

fn verdicts(run: &Run, of: impl Fn(&str) -> bool) -> BTreeMap<Name, Verdict> {
    let cases = run.cases().filter(|(device, _)| of(&device.info.device));
    cases.map(|(device, case)| (name(device, case), case.verdict())).collect()
}

/// Of how many devices a run is named by.
const MOST_DEVICES: usize = 3;
