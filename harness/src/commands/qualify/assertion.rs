//! The assertions of a case that can be proved, and those that one run proves.

use std::collections::BTreeSet;

use runner::run::Shown;
use runner::suite::constraint::Constraint;

use super::trial::Trial;

/// A part of a case that can be proved.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Assertion {
    /// Suite and case.
    pub case: String,
    /// The place of the step among the steps.
    pub step: usize,
    /// The constraint; the step as a whole when there is none.
    pub constraint: Option<Constraint>,
}

impl Assertion {
    /// The step and the constraints without which a device would have passed.
    pub(super) fn proved_by(case: &str, shown: &Shown) -> BTreeSet<Self> {
        let Some(step) = shown.step.filter(|_| shown.alone) else { return BTreeSet::new() };
        let constraints = shown.constraints.iter().cloned().map(Some);
        let all = [None].into_iter().chain(constraints);
        all.map(|constraint| Self { case: case.to_owned(), step, constraint }).collect()
    }

    /// The step that fails, although without it another one would.
    pub(super) fn failing(trial: &Trial) -> Option<Self> {
        let step = trial.shown.step.filter(|_| !trial.shown.alone)?;
        Some(Self { case: trial.case.clone(), step, constraint: None })
    }

    /// The allowances that the run used beside what was expected.
    pub(super) fn used_by(case: &str, shown: &Shown) -> impl Iterator<Item = Self> {
        shown.allowed.iter().map(|(step, allowance)| Self {
            case: case.to_owned(),
            step: *step,
            constraint: Some(Constraint::Allowance(*allowance)),
        })
    }
}
