//! The view of a run from outside: the only interface for `harness qualify`.

use std::collections::BTreeSet;

use canopen::{Instant, Stamped};
use reports::Event;

use crate::plan::Scope;
use crate::suite::constraint::{Allowance, Constraint};

/// Observes a session, and may change how it judges. By default every method does nothing, as in a
/// plain run: see [`Unobserved`].
pub trait Observer {
    /// Whether the steps of a case continue after the first mistake, which shows the constraints
    /// that the verdict rests on. The result is then passed to [`shows`](Self::shows).
    fn goes_on(&self) -> bool {
        false
    }

    /// The part of a step that does not count in the case that begins; the whole step when no part
    /// is named.
    fn opens(&self) -> Option<(usize, Option<Constraint>)> {
        None
    }

    /// A frame was received or sent. This includes frames before the first case and between cases.
    fn frame(&self, _frame: &Stamped) {}

    /// An event is reported: stimuli, the begin and the end of a case, and its frames.
    fn event(&self, _event: &Event) {}

    /// The device is settled, and the setup of a case begins.
    fn case_begins(&self) {}

    /// A step of the case begins to judge what comes after `from`.
    fn step_begins(&self, _step: usize, _from: Instant) {}

    /// It has judged what came until `to`, and these are the names after it.
    fn step_ended(&self, _step: usize, _to: Instant, _scope: &Scope) {}

    /// The steps are over, and what was set up is undone.
    fn steps_over(&self) {}

    /// The case is over, and its changes are set back.
    fn case_over(&self) {}

    /// The case shows this about its assertions.
    fn shows(&self, _shown: Shown) {}
}

/// The result of one run of an instance.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Shown {
    /// The place of the step that the device failed first.
    pub step: Option<usize>,
    /// Whether nothing else was wrong: without the step, the case would have passed.
    pub alone: bool,
    /// The constraints of the step without which the case would have passed: one, or those of one
    /// frame.
    pub constraints: BTreeSet<Constraint>,
    /// The allowances that were used, with the place of the step.
    pub allowed: BTreeSet<(usize, Allowance)>,
}

/// A plain run without an observer.
#[derive(Clone, Copy, Debug, Default)]
pub struct Unobserved;

impl Observer for Unobserved {}
