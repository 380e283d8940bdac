//! The checks of CiA's conformance test tool, and the cases that make them here.

use std::collections::BTreeMap;
use std::sync::Arc;

use reports::ToolCheck;
use serde::Deserialize;

use super::loaded::Suite;
use crate::source::{At, Complaint, Source};

/// One check of the tool.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct TestMapEntry {
    /// Its number, such as `2.19`.
    pub number: At<String>,
    /// What it checks, in our own words.
    pub checks: String,
    /// The cases that make it.
    #[serde(default)]
    pub cases: Vec<At<String>>,
    /// Why no case does.
    #[serde(default)]
    pub reason: Option<String>,
}

impl TestMapEntry {
    /// The check as reports show it.
    pub(super) fn told(&self) -> ToolCheck {
        ToolCheck {
            number: self.number.value.clone(),
            checks: self.checks.clone(),
            cases: self.cases.iter().map(|case| case.value.clone()).collect(),
            reason: self.reason.clone(),
        }
    }
}

/// How many checks the tool makes.
pub const CHECKS: usize = 127;

/// The mistakes of the list: a repeated number, a case that does not exist, a check without either
/// case or reason.
pub(super) fn wrong_map(
    maps: &[(Arc<Source>, Vec<At<TestMapEntry>>)],
    suites: &[Arc<Suite>],
) -> Vec<Complaint> {
    let (mut complaints, mut numbers) = (Vec::new(), BTreeMap::new());
    for (source, entries) in maps {
        for At { value: entry, .. } in entries {
            let number = &entry.number;
            let mut complain = |place, message| {
                complaints.push(Complaint::at(source, place, message));
            };
            if let Some(line) = numbers.insert(&number.value, number.place.line) {
                complain(
                    number.place,
                    format!("number {} is used twice: line {line} has it", number.value),
                );
            }
            if entry.cases.is_empty() == entry.reason.is_none() {
                let message = format!("number {} needs either `cases` or a `reason`", number.value);
                complain(number.place, message);
            }
            for case in &entry.cases {
                // Without suites, as in `harness check FILE`, there is nothing to compare with.
                if !suites.is_empty() && !is_case(&case.value, suites) {
                    complain(case.place, format!("there is no case {}", case.value));
                }
            }
        }
    }
    complaints
}

fn is_case(name: &str, suites: &[Arc<Suite>]) -> bool {
    suites.iter().any(|suite| {
        let case = name.strip_prefix(suite.name()).and_then(|rest| rest.strip_prefix('/'));
        let mut ids = suite.file.cases.iter().map(|case| &case.value.id.value);
        case.is_some_and(|case| ids.any(|id| **id == *case))
    })
}
