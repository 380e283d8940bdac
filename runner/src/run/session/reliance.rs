//! Reliance of cases on each other: the order in which they run, and the requirements known to be
//! broken.

use std::collections::{BTreeMap, BTreeSet};

use reports::Outcome;

use crate::plan::{Instance, Plan};

/// The requirements that cases rely on, and those of them that do not hold on this device.
pub(super) struct Reliance<'p> {
    relied: BTreeSet<&'p str>,
    broken: BTreeMap<&'p str, String>,
}

impl<'p> Reliance<'p> {
    /// Nothing is known to be broken.
    pub(super) fn of(plan: &'p Plan) -> Self {
        let relied = plan.by_case().flat_map(|instances| instances[0].relies_on()).collect();
        Self { relied, broken: BTreeMap::new() }
    }

    /// The instances, those first that prove what others rely on. Otherwise their order stays: the
    /// verdicts do not depend on it.
    pub(super) fn order(&self, plan: &'p Plan) -> Vec<&'p Instance> {
        let (first, others): (Vec<&[Instance]>, Vec<&[Instance]>) =
            plan.by_case().partition(|instances| self.proves(&instances[0]));
        let mut first: Vec<&Instance> = first.into_iter().flatten().collect();
        // A case that proves one requirement may rely on another.
        let mut ranks = BTreeMap::<&str, usize>::new();
        for _ in 0..DEEPEST {
            for instance in &first {
                let rank = rank(instance, &ranks);
                for id in checks(instance) {
                    let known = ranks.entry(id).or_default();
                    *known = rank.max(*known);
                }
            }
        }
        first.sort_by_cached_key(|instance| rank(instance, &ranks));
        first.extend(others.into_iter().flatten());
        first
    }

    /// Why a case cannot say anything about the device.
    pub(super) fn blocks(&self, instance: &Instance) -> Option<String> {
        let (id, why) = instance.relies_on().find_map(|id| self.broken.get_key_value(id))?;
        Some(format!("{id} {why}"))
    }

    /// Takes the result of a case into account. One that is undecided says nothing, and those that
    /// rely on it are tried.
    pub(super) fn learn(&mut self, instance: &'p Instance, outcome: &Outcome) {
        if !self.proves(instance) {
            return;
        }
        let why = match (outcome, outcome.problem()) {
            (Outcome::Blocked(reason), _) => format!("does not hold on this device: {reason}"),
            (_, Some(problem))
                if outcome.holds_against_device() || matches!(outcome, Outcome::Error { .. }) =>
            {
                let first = |text: &str| text.lines().next().unwrap_or_default().to_owned();
                let (expected, actual) = (first(&problem.expected), first(&problem.actual));
                let name = instance.name();
                format!("does not hold on this device: {name} expected {expected}, came {actual}")
            }
            // A verdict on a requirement that could not be tried would be a guess.
            (Outcome::Error { .. }, None) => {
                format!("is not known to hold: {} could not be carried out", instance.name())
            }
            _ => return,
        };
        for id in checks(instance) {
            self.broken.entry(id).or_insert_with(|| why.clone());
        }
    }

    /// Whether a case is about nothing but what others rely on.
    fn proves(&self, instance: &Instance) -> bool {
        checks(instance).all(|id| self.relied.contains(id))
    }
}

fn checks(instance: &Instance) -> impl Iterator<Item = &str> {
    instance.case().checks.iter().map(|id| id.value.as_str())
}

/// After how many others a case runs at least.
fn rank(instance: &Instance, ranks: &BTreeMap<&str, usize>) -> usize {
    instance.relies_on().filter_map(|id| ranks.get(id)).max().map_or(0, |rank| rank + 1)
}

/// How long a chain of cases that rely on each other is at most; a circle ends here, too.
const DEEPEST: usize = 8;
