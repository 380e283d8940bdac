//! What a run says of the checks of CiA's conformance test tool, by their numbers.

use std::collections::BTreeMap;

use crate::run::Run;
use crate::style::clean;
use crate::verdict::Verdict;

/// A check of the tool, and what the cases say that make it here.
pub(crate) struct ToolChecked {
    pub(crate) number: String,
    pub(crate) checks: String,
    /// The heaviest verdict of its cases; `None` when none of them is in the run.
    pub(crate) verdict: Option<Verdict>,
    /// How many instances of its cases came out how.
    pub(crate) counts: Vec<(Verdict, usize)>,
    /// Why no case makes it.
    pub(crate) reason: Option<String>,
}

/// The checks in their order; none when the run has no case that makes one.
pub(crate) fn tool_checked(run: &Run) -> Vec<ToolChecked> {
    let mut all = BTreeMap::<String, BTreeMap<Verdict, usize>>::new();
    for (_, case) in run.cases() {
        let name = format!("{}/{}", case.info.suite, case.info.case);
        *all.entry(name).or_default().entry(case.verdict()).or_default() += 1;
    }
    let checks = run.started.iter().flat_map(|started| &started.tool_checks);
    let checked = |check: &crate::ToolCheck| {
        let mut counts = BTreeMap::<Verdict, usize>::new();
        for (verdict, count) in check.cases.iter().filter_map(|case| all.get(case)).flatten() {
            *counts.entry(*verdict).or_default() += count;
        }
        ToolChecked {
            number: clean(&check.number),
            checks: clean(&check.checks),
            verdict: counts.keys().copied().max_by_key(|verdict| verdict.weight()),
            counts: counts.into_iter().collect(),
            reason: check.reason.as_deref().map(clean),
        }
    };
    let checks: Vec<ToolChecked> = checks.map(checked).collect();
    match checks.iter().any(|check| check.verdict.is_some()) {
        true => checks,
        false => Vec::new(),
    }
}

impl ToolChecked {
    /// Whether it was made and does not simply pass.
    pub(crate) fn is_worse(&self) -> bool {
        self.verdict.is_some_and(Verdict::is_short_of_pass)
    }

    /// `12 PASS, 1 FAIL`, or why there is nothing.
    pub(crate) fn said(&self) -> String {
        let counts = self.counts.iter().map(|(verdict, count)| format!("{count} {verdict}"));
        let counts: Vec<String> = counts.collect();
        match (&self.reason, counts.as_slice()) {
            (Some(reason), _) => reason.clone(),
            (None, []) => "not in this run".to_owned(),
            (None, counts) => counts.join(", "),
        }
    }
}
