//! Turns: which case is next, and when one that was undecided is tried again.

use std::collections::VecDeque;

use super::reliance::checks;
use crate::plan::Instance;

/// When a case has its turn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Turn {
    /// In the order of the plan.
    Planned,
    /// It was undecided, and the next case relies on what it shows.
    BeforeDependant,
    /// It was undecided. The host may be quieter at the end of a run; what is undecided then stays
    /// so.
    Last,
}

/// The cases that have still to run.
pub(super) struct Turns<'p> {
    planned: VecDeque<&'p Instance>,
    undecided: VecDeque<Undecided<'p>>,
}

struct Undecided<'p> {
    instance: &'p Instance,
    /// Whether the next case that relies on it waits for it: with luck it decides whether that one
    /// can be judged.
    awaited: bool,
}

impl<'p> Turns<'p> {
    /// In this order.
    pub(super) fn of(planned: Vec<&'p Instance>) -> Self {
        Self { planned: planned.into(), undecided: VecDeque::new() }
    }

    /// The next case. One that is not to `run` waits for no other.
    pub(super) fn next(&mut self, run: impl Fn(&Instance) -> bool) -> Option<(&'p Instance, Turn)> {
        let Some(next) = self.planned.pop_front() else {
            return self.undecided.pop_front().map(|last| (last.instance, Turn::Last));
        };
        let is_relied_on = |it: &Undecided| {
            it.awaited && next.relies_on().any(|id| checks(it.instance).any(|check| check == id))
        };
        let place = self.undecided.iter().position(is_relied_on).filter(|_| run(next));
        let Some(awaited) = place.and_then(|place| self.undecided.remove(place)) else {
            return Some((next, Turn::Planned));
        };
        self.planned.push_front(next);
        Some((awaited.instance, Turn::BeforeDependant))
    }

    /// A case was undecided at its turn. A `witness` is about nothing but what others rely on.
    pub(super) fn undecided(&mut self, instance: &'p Instance, turn: Turn, witness: bool) {
        match turn {
            Turn::Planned => self.undecided.push_back(Undecided { instance, awaited: witness }),
            Turn::BeforeDependant => {
                self.undecided.push_back(Undecided { instance, awaited: false });
            }
            Turn::Last => {}
        }
    }

    /// The cases that have had no turn.
    pub(super) fn rest(self) -> Vec<&'p Instance> {
        self.planned.into()
    }
}
