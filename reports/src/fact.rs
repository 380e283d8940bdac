//! Facts: what is broken in a device, each with all instances that show it.
//!
//! A [`Cause`] is about a requirement. One broken fact may show in cases about several of them: bit
//! 0 of 1001h that is never set, or a command that has no effect. Two instances show one fact when
//! they have one cause, when they are [equal observations](seen), or when one of them rests on a
//! requirement that the other one shows to be broken.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use crate::cause::Cause;
use crate::run::{CaseRun, DeviceRun, Run};
use crate::seen::{Seen, seen};

/// An instance with its device, and its place in the run.
pub type Noticed<'r> = (usize, &'r DeviceRun, &'r CaseRun);

/// A broken fact.
#[derive(Debug)]
pub struct Fact<'r> {
    /// The instance that explains the others.
    pub first: Noticed<'r>,
    /// The instances that show it, in the order of the run.
    pub cases: Vec<Noticed<'r>>,
}

impl<'r> Fact<'r> {
    /// The cause of the instance that explains it.
    pub fn cause(&self) -> Option<&'r Cause> {
        self.first.2.cause.as_deref()
    }

    /// Whether it makes the run red.
    pub fn is_red(&self, run: &Run) -> bool {
        self.cases.iter().any(|(.., case)| run.is_red(case.verdict()))
    }
}

/// The facts that were explained while the instances end.
#[derive(Debug)]
pub(crate) struct Explained(BTreeSet<Sign>);

impl Explained {
    pub(crate) const fn new() -> Self {
        Self(BTreeSet::new())
    }

    /// Adds an instance; whether an earlier one shows the same fact.
    pub(crate) fn takes(&mut self, device: &DeviceRun, case: &CaseRun) -> bool {
        let known = shown(case).chain(follows(device, case)).any(|sign| self.0.contains(&sign));
        self.0.extend(shown(case).chain(broken(device, case)));
        known
    }
}

/// What makes two instances show one fact.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Sign {
    Cause(Cause),
    Seen(Seen),
    /// A requirement that does not hold on a device.
    Broken(String, Arc<str>),
}

/// Cause and observations of an instance.
fn shown(case: &CaseRun) -> impl Iterator<Item = Sign> {
    let observed = case.outcome.problem().into_iter().flat_map(seen);
    case.cause.as_deref().cloned().map(Sign::Cause).into_iter().chain(observed.map(Sign::Seen))
}

/// The requirements that an instance shows to be broken.
fn broken(device: &DeviceRun, case: &CaseRun) -> impl Iterator<Item = Sign> {
    let holds = case.outcome.holds_against_device();
    let checks = case.info.checks.iter().filter(move |_| holds);
    checks.map(|check| Sign::Broken(device.info.device.clone(), Arc::clone(&check.id)))
}

/// The requirements from which the result of an instance would follow, were they broken.
fn follows(device: &DeviceRun, case: &CaseRun) -> impl Iterator<Item = Sign> {
    case.relies_on.iter().map(|id| Sign::Broken(device.info.device.clone(), Arc::clone(id)))
}

/// What did not pass, by fact. Facts that make the run red come first; among these, that of most
/// instances comes first.
pub fn facts(run: &Run) -> Vec<Fact<'_>> {
    let all = run.cases().enumerate().map(|(place, (device, case))| (place, device, case));
    let unusual = |(.., case): &Noticed| !case.verdict().is_usual() && !case.outcome.is_not_run();
    let cases: Vec<Noticed> = all.filter(unusual).collect();
    let mut joined = Joined::alone(cases.len());
    let (mut known, mut origins) = (BTreeMap::new(), BTreeMap::<Sign, usize>::new());
    for (at, (_, device, case)) in cases.iter().enumerate() {
        for sign in shown(case) {
            joined.join(*known.entry(sign).or_insert(at), at);
        }
        for sign in broken(device, case) {
            let origin = origins.entry(sign).or_insert(at);
            // A case about nothing else shows it best.
            if case.info.checks.len() < cases[*origin].2.info.checks.len() {
                *origin = at;
            }
        }
    }
    let mut explains = vec![0; cases.len()];
    for (at, (_, device, case)) in cases.iter().enumerate() {
        for origin in follows(device, case).filter_map(|sign| origins.get(&sign)) {
            joined.join(*origin, at);
            explains[*origin] += 1;
        }
    }
    let mut members = BTreeMap::<usize, Vec<usize>>::new();
    (0..cases.len()).for_each(|at| members.entry(joined.root(at)).or_default().push(at));
    let fact = |members: &Vec<usize>| {
        let alike = |at: usize| {
            let (suite, cause) = (&cases[at].2.info.suite, &cases[at].2.cause);
            let others = || members.iter().map(|other| cases[*other].2);
            let of_suite = others().filter(|case| case.info.suite == *suite).count();
            (of_suite, others().filter(|case| case.cause == *cause).count())
        };
        let weight = |at: usize| {
            let outcome = &cases[at].2.outcome;
            let holds = outcome.holds_against_device();
            // A case about nothing else shows it best.
            let about = Reverse(cases[at].2.info.checks.len());
            (explains[at], run.is_red(outcome.verdict()), holds, about, alike(at), Reverse(at))
        };
        let first = members.iter().copied().max_by_key(|at| weight(*at)).unwrap_or_default();
        let members = members.iter().map(|at| cases[*at]).collect();
        Fact { first: cases[first], cases: members }
    };
    let mut facts: Vec<Fact> = members.values().map(fact).collect();
    facts.sort_by_key(|fact| (!fact.is_red(run), Reverse(fact.cases.len()), fact.cases[0].0));
    facts
}

/// Which of so many things belong together.
struct Joined(Vec<usize>);

impl Joined {
    fn alone(count: usize) -> Self {
        Self((0..count).collect())
    }

    fn root(&self, mut at: usize) -> usize {
        while self.0[at] != at {
            at = self.0[at];
        }
        at
    }

    fn join(&mut self, one: usize, other: usize) {
        let (one, other) = (self.root(one), self.root(other));
        self.0[one.max(other)] = one.min(other);
    }
}
