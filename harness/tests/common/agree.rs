//! What a run on a bus whose time is real owes to one in virtual time.

use std::collections::{BTreeMap, BTreeSet};

use reports::{Outcome, Run, Verdict};

use crate::record;

/// More cases than a busy machine spoils.
const MOST_SPOILT: usize = 20;
/// More of them than it spoils so that they have a verdict.
const MOST_WRONG: usize = 5;

/// Fails unless `got` has the verdicts that are `expected`. A busy machine stalls the tester, and a
/// device that is a program: what differs is tried again `alone`. What the tester is too late for
/// says nothing about the device, and so it is no difference.
pub(crate) fn agree(expected: &Run, got: &Run, alone: impl FnOnce(&[String]) -> Run) {
    let spoilt = differing(expected, got);
    if spoilt.is_empty() {
        return;
    }
    let first = record::differences(expected, got);
    let wrong = &spoilt - &undecided(got);
    assert!(spoilt.len() <= MOST_SPOILT && wrong.len() <= MOST_WRONG, "{first}");
    eprintln!("once more, alone:\n{first}");
    let names: Vec<String> = spoilt.iter().cloned().collect();
    let alone = alone(&names);
    let differing = &differing(expected, &alone) & &spoilt;
    let wrong = &differing - &undecided(&alone);
    let second = record::differences(expected, &alone);
    assert!(wrong.is_empty(), "alone, too: {wrong:?}\n{first}\n{second}");
}

/// The instances whose verdicts differ or that stand in one of the runs alone.
fn differing(expected: &Run, got: &Run) -> BTreeSet<String> {
    let (expected, got) = (by_name(expected), by_name(got));
    let names = expected.keys().chain(got.keys());
    names.filter(|name| expected.get(*name) != got.get(*name)).cloned().collect()
}

fn by_name(run: &Run) -> BTreeMap<String, Verdict> {
    record::verdicts(run).into_iter().map(|((_, name), verdict)| (name, verdict)).collect()
}

fn undecided(run: &Run) -> BTreeSet<String> {
    let cases = run.cases().filter(|(_, case)| matches!(case.outcome, Outcome::Undecided(_)));
    cases.map(|(_, case)| case.info.name()).collect()
}
