//! Objects that could not be set back, which later cases find changed.

use std::collections::BTreeMap;

use canopen::Mux;
use reports::Outcome;

use crate::plan::Instance;

/// The objects, and the case since which each of them is changed.
#[derive(Debug, Default)]
pub(super) struct Unrestored(BTreeMap<Mux, String>);

impl Unrestored {
    /// Takes what is changed after a case.
    pub(super) fn after(&mut self, instance: &Instance, left: &BTreeMap<Mux, Vec<u8>>) {
        self.0.retain(|mux, _| left.contains_key(mux));
        for mux in left.keys() {
            self.0.entry(*mux).or_insert_with(|| instance.name());
        }
    }

    /// A failure with what was changed when the case began, which may be its reason.
    pub(super) fn beside(&self, mut outcome: Outcome) -> Outcome {
        if let Outcome::Fail(problem)
        | Outcome::Flaky { problem, .. }
        | Outcome::Error { problem: Some(problem), .. } = &mut outcome
        {
            let said = self.0.iter().map(|(mux, case)| {
                format!(
                    "{mux} is changed since {case}, which could not set it back; this may be why"
                )
            });
            problem.notes.extend(said);
        }
        outcome
    }
}
