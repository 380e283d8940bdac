//! The events that begin a case.

use std::sync::Arc;

use canopen::Instant;
use reports::{CaseStarted, Check};

use crate::plan::Instance;
use crate::suite::{Register, Suite};

/// The events that begin a case. Instances of a case mostly follow each other.
pub(super) struct Starts<'s> {
    register: &'s Register,
    last: Option<(Arc<Suite>, usize, CaseStarted)>,
}

impl<'s> Starts<'s> {
    pub(super) const fn new(register: &'s Register) -> Self {
        Self { register, last: None }
    }

    pub(super) fn of(&mut self, instance: &Instance, at: Instant) -> CaseStarted {
        let same = |(suite, case, _): &(Arc<Suite>, usize, CaseStarted)| {
            Arc::ptr_eq(suite, &instance.suite) && *case == instance.case
        };
        let of_case = match self.last.take().filter(same) {
            Some((.., started)) => started,
            None => self.of_case(instance),
        };
        let started = CaseStarted { at, instance: instance.label.clone(), ..of_case.clone() };
        self.last = Some((Arc::clone(&instance.suite), instance.case, of_case));
        started
    }

    /// The common part of all instances.
    fn of_case(&self, instance: &Instance) -> CaseStarted {
        let case = instance.case();
        let checks = case.checks.iter().filter_map(|id| {
            let relaxed_by = instance.relaxed.get(&id.value).map(|by| by.as_str().into());
            Some(Check { relaxed_by, ..self.register.check(&id.value)? })
        });
        CaseStarted {
            at: Instant::ZERO,
            suite: Arc::clone(&instance.suite.file.suite.value),
            case: Arc::clone(&case.id.value),
            instance: None,
            title: Arc::clone(&case.title),
            checks: checks.collect(),
            file: Arc::clone(&instance.suite.path),
            line: case.id.place.line as u32,
            column: case.id.place.column as u32,
        }
    }
}
