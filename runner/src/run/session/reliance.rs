//! Reliance of cases on each other: the order in which they run, and the requirements known to be
//! broken.

use std::collections::{BTreeMap, BTreeSet};

use reports::{Outcome, Phase, Problem};

use super::unrestored::Unrestored;
use crate::plan::{Instance, Plan};
use crate::suite::Register;

/// The requirements that cases rely on, and what is known of them on this device.
pub(super) struct Reliance<'p> {
    relied: BTreeSet<&'p str>,
    /// Those that do not hold.
    broken: BTreeMap<&'p str, Broken<'p>>,
    /// Those that a case has shown to hold.
    holding: BTreeSet<&'p str>,
    /// Those that are kept in another way than the usual one, and how that showed.
    bent: BTreeMap<&'p str, String>,
    /// The cases about them that are undecided.
    undecided: Vec<&'p Instance>,
    /// The cases that prove them, and run where one fails that relies on them.
    witnesses: Vec<&'p Instance>,
    /// What earlier cases left changed.
    pub(super) unrestored: Unrestored,
}

/// How it showed that a requirement does not hold.
struct Broken<'p> {
    why: String,
    /// Whether a case has tried it. Else the case about it was blocked, and nobody knows.
    tried: bool,
    /// The case that showed it, or that showed what blocked the case about it.
    shown_by: Option<&'p Instance>,
    /// Whether that case is to be looked at again before the first one that it blocks: the reason
    /// may be gone by then.
    doubted: bool,
}

impl<'p> Reliance<'p> {
    /// Nothing is known to be broken.
    pub(super) fn of(plan: &'p Plan, register: &'p Register) -> Self {
        let named = plan.by_case().flat_map(|instances| instances[0].relies_on());
        let of_witnesses = plan.witnesses.iter().flat_map(Instance::relies_on);
        let relied =
            named.chain(of_witnesses).chain(register.effects().map(|(_, id)| &**id)).collect();
        Self {
            relied,
            broken: BTreeMap::new(),
            holding: BTreeSet::new(),
            bent: BTreeMap::new(),
            undecided: Vec::new(),
            witnesses: in_order(plan.witnesses.iter().collect()),
            unrestored: Unrestored::default(),
        }
    }

    /// The instances, those first that prove what others rely on. Otherwise their order stays: the
    /// verdicts do not depend on it.
    pub(super) fn order(&self, plan: &'p Plan) -> Vec<&'p Instance> {
        let (first, others): (Vec<&[Instance]>, Vec<&[Instance]>) =
            plan.by_case().partition(|instances| self.proves(&instances[0]));
        let mut first = in_order(first.into_iter().flatten().collect());
        first.extend(others.into_iter().flatten());
        first
    }

    /// The witnesses that tell whether a failure is its own, in their order. Each is heard once.
    pub(super) fn witnesses_of(&mut self, instance: &Instance) -> Vec<&'p Instance> {
        let mut relied: BTreeSet<&str> = instance.relies_on().collect();
        // What others rely on comes first, so that those that rely on it are seen before it.
        let (heard, others): (Vec<&Instance>, Vec<&Instance>) =
            self.witnesses.iter().rev().partition(|witness| {
                let tells = checks(witness).any(|id| relied.contains(id));
                if tells {
                    relied.extend(witness.relies_on());
                }
                tells
            });
        self.witnesses = others.into_iter().rev().collect();
        heard.into_iter().rev().collect()
    }

    /// Why a case cannot say anything about the device.
    pub(super) fn blocks(&self, instance: &Instance) -> Option<String> {
        let (id, broken) = instance.relies_on().find_map(|id| self.broken.get_key_value(id))?;
        let why = &broken.why;
        Some(match broken.tried {
            true => format!("{id} does not hold on this device: {why}"),
            false => format!("{id} was not tried: {why}"),
        })
    }

    /// The case that showed what blocks this one, if it was not looked at again.
    pub(super) fn doubted(&self, instance: &Instance) -> Option<&'p Instance> {
        let blocking = instance.relies_on().filter_map(|id| self.broken.get(id));
        blocking.filter(|broken| broken.doubted).find_map(|broken| broken.shown_by)
    }

    /// Takes the result of a second look into account. Where the case passes now, what it showed
    /// blocks nothing, and nothing that was blocked by it.
    pub(super) fn look_again(&mut self, shown_by: &Instance, outcome: &Outcome) {
        let is_it = |broken: &Broken| broken.shown_by.is_some_and(|it| std::ptr::eq(it, shown_by));
        let holds = matches!(outcome, Outcome::Pass) || is_another_way(outcome);
        if holds {
            self.broken.retain(|_, broken| !is_it(broken));
        }
        self.broken.values_mut().filter(|broken| is_it(broken)).for_each(|it| it.doubted = false);
    }

    /// The result of a case that depends on more than itself. It fails only where all that it
    /// relies on is decided: what a busy host left undecided may be the reason. A setup that failed
    /// is excused by a requirement that is kept in another way than the setup expects; without such
    /// a witness nothing else shows what is wrong.
    pub(super) fn judged(&self, instance: &Instance, outcome: Outcome) -> Outcome {
        // A witness that is heard afterwards may show that it should not have begun.
        if is_failure(&outcome)
            && let Some(why) = self.blocks(instance)
        {
            return Outcome::Blocked(why);
        }
        if let Outcome::Fail(problem)
        | Outcome::Flaky { problem, .. }
        | Outcome::Error { problem: Some(problem), .. } = &outcome
            && let Some(id) = instance.relies_on().find(|id| self.is_undecided(id))
        {
            return Outcome::Undecided(format!(
                "{id} is undecided, on which it relies; it {}",
                in_a_line(problem)
            ));
        }
        let outcome = self.unrestored.beside(outcome);
        match &outcome {
            Outcome::Error { reason, problem: Some(problem) } if problem.phase == Phase::Setup => {
                match instance.relies_on().find_map(|id| self.bent.get_key_value(id)) {
                    Some((id, why)) => Outcome::Blocked(format!(
                        "{id} is kept in another way on this device: {why}; {reason}"
                    )),
                    None => outcome,
                }
            }
            _ => outcome,
        }
    }

    /// Takes the result of a case into account. Only what holds against the device is a witness: of
    /// an ERROR nobody knows whether the requirement holds, so what relies on it is tried.
    pub(super) fn learn(&mut self, instance: &'p Instance, outcome: &Outcome) {
        if !self.proves(instance) {
            return;
        }
        self.undecided.retain(|known| !std::ptr::eq(*known, instance));
        let showed = |problem: &Problem| format!("{} {}", instance.name(), in_a_line(problem));
        match (outcome, outcome.problem()) {
            (Outcome::Undecided(_), _) => self.undecided.push(instance),
            (Outcome::Blocked(why), _) => {
                let blocking = instance.relies_on().find_map(|id| self.broken.get(id));
                let shown_by = blocking.and_then(|broken| broken.shown_by);
                // Where another case has shown that it holds, nothing is unknown.
                let unknown = checks(instance).filter(|id| !self.holding.contains(id));
                for id in unknown.collect::<Vec<_>>() {
                    let (why, tried, doubted) = (why.clone(), false, false);
                    let broken = Broken { why, tried, shown_by, doubted };
                    self.broken.entry(id).or_insert(broken);
                }
            }
            (_, Some(problem)) if outcome.holds_against_device() => {
                let why = showed(problem);
                for id in checks(instance) {
                    let (why, tried, shown_by) = (why.clone(), true, Some(instance));
                    let broken = Broken { why, tried, shown_by, doubted: true };
                    match self.broken.get(id) {
                        Some(known) if known.tried => {}
                        _ => _ = self.broken.insert(id, broken),
                    }
                }
            }
            (Outcome::Pass, _) => {
                self.holding.extend(checks(instance));
                self.broken.retain(|id, broken| broken.tried || !self.holding.contains(id));
            }
            (Outcome::Lenient(problem), _) => {
                for id in checks(instance) {
                    self.bent.entry(id).or_insert_with(|| showed(problem));
                }
            }
            _ => {}
        }
    }

    /// Whether a case about the requirement is undecided.
    fn is_undecided(&self, id: &str) -> bool {
        self.undecided.iter().any(|of| checks(of).any(|check| check == id))
    }

    /// Whether a case is about nothing but what others rely on.
    pub(super) fn proves(&self, instance: &Instance) -> bool {
        checks(instance).all(|id| self.relied.contains(id))
    }
}

/// Those that prove something, after those that prove what they rely on.
fn in_order(mut proving: Vec<&Instance>) -> Vec<&Instance> {
    // A case that proves one requirement may rely on another.
    let mut ranks = BTreeMap::<&str, usize>::new();
    for _ in 0..DEEPEST {
        for instance in &proving {
            let rank = rank(instance, &ranks);
            for id in checks(instance) {
                let known = ranks.entry(id).or_default();
                *known = rank.max(*known);
            }
        }
    }
    proving.sort_by_cached_key(|instance| rank(instance, &ranks));
    proving
}

/// What was expected, and what came.
fn in_a_line(problem: &Problem) -> String {
    let first = |text: &str| text.lines().next().unwrap_or_default().to_owned();
    format!("expected {}, came {}", first(&problem.expected), first(&problem.actual))
}

/// Whether a result may be the fault of what the case relies on.
pub(super) const fn is_failure(outcome: &Outcome) -> bool {
    matches!(
        outcome,
        Outcome::Fail(_) | Outcome::Flaky { .. } | Outcome::Error { problem: Some(_), .. }
    )
}

/// Whether a requirement is kept, in another way than the usual one.
const fn is_another_way(outcome: &Outcome) -> bool {
    matches!(outcome, Outcome::Lenient(problem) if !problem.capped)
}

/// The requirements that a case is about.
pub(super) fn checks(instance: &Instance) -> impl Iterator<Item = &str> {
    instance.case().checks.iter().map(|id| id.value.as_str())
}

/// After how many others a case runs at least.
fn rank(instance: &Instance, ranks: &BTreeMap<&str, usize>) -> usize {
    instance.relies_on().filter_map(|id| ranks.get(id)).max().map_or(0, |rank| rank + 1)
}

/// How long a chain of cases that rely on each other is at most; a circle ends here, too.
const DEEPEST: usize = 8;
