//! Facts: what is broken in a device, each with all instances that show it.
//!
//! A [`Cause`] is about a requirement. One broken fact may show in cases about several of them: bit
//! 0 of 1001h that is never set, or a command that has no effect. Two instances show one thing when
//! they have one cause, or when they are [equal observations](seen). Where each instance that shows
//! it rests on a requirement that others show to be broken, it follows from what they show. One
//! that rests on nothing broken shows a fact of its own: a second fault stays apart, although some
//! of the cases that meet it rest on the first one. What differs alike in cases about many
//! requirements is one fact as well: a PDO that never comes.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use crate::cause::Cause;
use crate::run::{CaseRun, DeviceRun, Run};
use crate::seen::{Seen, seen};
use crate::verdict::Outcome;

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

    /// Adds an instance; whether an earlier one shows the same fact, or what it follows from. What
    /// follows explains nothing: the next instance that shows the same may rest on nothing broken.
    pub(crate) fn takes(&mut self, device: &DeviceRun, case: &CaseRun) -> bool {
        let follows = follows(device, case).any(|sign| self.0.contains(&sign));
        let known = follows || shown(case).any(|sign| self.0.contains(&sign));
        self.0.extend(broken(device, case).chain(shown(case).filter(|_| !follows)));
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
    let mut origins_of = vec![None; cases.len()];
    for (at, (_, device, case)) in cases.iter().enumerate() {
        let signs = follows(device, case);
        let others = signs.filter_map(|sign| origins.get(&sign).copied());
        for origin in others.filter(|origin| *origin != at) {
            explains[origin] += 1;
            if joined.root(origin) != joined.root(at) {
                origins_of[at].get_or_insert(origin);
            }
        }
    }
    // What rests on it and was not run is explained as well.
    let blocked = run.cases().filter(|(_, case)| matches!(case.outcome, Outcome::Blocked(_)));
    for origin in blocked.flat_map(|(device, case)| follows(device, case)) {
        origins.get(&origin).into_iter().for_each(|at| explains[*at] += 1);
    }
    joined.join_widespread(&cases);
    for group in joined.groups() {
        // The fact on which the first of them rests has all of them.
        let origins: Option<Vec<usize>> = group.iter().map(|at| origins_of[*at]).collect();
        if let Some(origin) = origins.and_then(|all| all.first().copied()) {
            joined.join(origin, group[0]);
        }
    }
    let fact = |members: &Vec<usize>| {
        let others = || members.iter().map(|other| cases[*other].2);
        let weight = |at: usize| {
            let case = cases[at].2;
            let holds = case.outcome.holds_against_device();
            // The requirement that breaks the others, or that most of them are about.
            let alike = others().filter(|other| other.cause == case.cause).count();
            let explains = explains[at] + alike;
            // A case about nothing else shows it best.
            let about = Reverse(case.info.checks.len());
            let said = others().filter(|other| is_said_alike(other, case)).count();
            let of_suite = others().filter(|other| other.info.suite == case.info.suite).count();
            let is_red = run.is_red(case.verdict());
            let why = (origins_of[at].is_none(), is_red, holds, explains, about);
            (why, said, of_suite, Reverse(at))
        };
        let first = members.iter().copied().max_by_key(|at| weight(*at)).unwrap_or_default();
        let members = members.iter().map(|at| cases[*at]).collect();
        Fact { first: cases[first], cases: members }
    };
    let mut facts: Vec<Fact> = joined.groups().iter().map(fact).collect();
    facts.sort_by_key(|fact| (!fact.is_red(run), Reverse(fact.cases.len()), fact.cases[0].0));
    facts
}

/// Whether both expected the same, and the same came, with all values.
fn is_said_alike(one: &CaseRun, other: &CaseRun) -> bool {
    let said = |case: &CaseRun| {
        let problem = case.outcome.problem()?;
        Some((problem.expected.clone(), problem.actual.clone()))
    };
    said(one) == said(other)
}

/// In cases about how many requirements the same difference has to come up to be one fact. In a few
/// it may come up by several faults.
const WIDESPREAD: usize = 6;

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

    /// What belongs together, each in order.
    fn groups(&self) -> Vec<Vec<usize>> {
        let mut groups = BTreeMap::<usize, Vec<usize>>::new();
        (0..self.0.len()).for_each(|at| groups.entry(self.root(at)).or_default().push(at));
        groups.into_values().collect()
    }

    /// Joins the instances with the same difference, where it came up in many requirements.
    fn join_widespread(&mut self, cases: &[Noticed]) {
        let mut alike = BTreeMap::<(&str, Option<&str>), Vec<(usize, &str)>>::new();
        for (at, (.., case)) in cases.iter().enumerate() {
            if let Some(cause) = &case.cause {
                let difference = (cause.difference.as_str(), cause.object.as_deref());
                alike.entry(difference).or_default().push((at, &cause.requirement));
            }
        }
        for group in alike.values() {
            let requirements: BTreeSet<&str> = group.iter().map(|(_, id)| *id).collect();
            if requirements.len() >= WIDESPREAD {
                group.iter().for_each(|(at, _)| self.join(group[0].0, *at));
            }
        }
    }

    fn join(&mut self, one: usize, other: usize) {
        let (one, other) = (self.root(one), self.root(other));
        self.0[one.max(other)] = one.min(other);
    }
}
