//! What a runner lets others see of its work: the one way in for `harness qualify`.

use std::collections::BTreeSet;

use canopen::{Instant, Stamped};
use reports::Event;

use crate::plan::Scope;
use crate::suite::constraint::{Allowance, Constraint};

/// Learns what happens in a session, and says what is to be judged otherwise in it. Whatever is not
/// asked for does nothing, as in a plain run: see [`Unobserved`].
pub trait Observer {
    /// Whether the steps of a case go on after the first thing that is wrong, which shows on what
    /// its verdict rests. What it shows is then in [`shows`](Self::shows).
    fn goes_on(&self) -> bool {
        false
    }

    /// The part of a step that does not count in the case that begins; the whole step when no part
    /// is named.
    fn opens(&self) -> Option<(usize, Option<Constraint>)> {
        None
    }

    /// A frame came, or was sent. Those before the first case and between cases are among them.
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

    /// The case is over, and what it changed is set back.
    fn case_over(&self) {}

    /// The case shows this about its assertions.
    fn shows(&self, _shown: Shown) {}
}

/// What one run of an instance shows.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Shown {
    /// The place of the step that the device failed first.
    pub step: Option<usize>,
    /// Whether nothing else was wrong: without the step, the case would have passed.
    pub alone: bool,
    /// The constraints of the step without which the case would have passed: one, or those of one
    /// frame.
    pub constraints: BTreeSet<Constraint>,
    /// What was accepted beside what was expected, with the place of the step.
    pub allowed: BTreeSet<(usize, Allowance)>,
}

/// A plain run, at which nobody looks.
#[derive(Clone, Copy, Debug, Default)]
pub struct Unobserved;

impl Observer for Unobserved {}
