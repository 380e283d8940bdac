//! The outcome of a case while it runs.

use std::time::Duration;

use canopen::Instant;
use reports::{Outcome, Phase, Problem};

use crate::run::steps::{Difference, excerpt};
use crate::source::{Place, Source};
use crate::suite::model::Case;

/// The outcome as it takes shape: the first thing that weighs most stays, the rest become notes.
pub(super) struct CaseOutcome<'r> {
    pub source: &'r Source,
    /// When the step ended that is being judged.
    pub at: Instant,
    pub outcome: Outcome,
    /// A permitted refusal of the device, because of which the remaining steps were left out, and
    /// the place of the step.
    pub declined: Option<(usize, String)>,
    /// How late the tester was, when that may be the reason of the outcome.
    pub late: Option<Duration>,
}

impl CaseOutcome<'_> {
    pub(super) fn lenient(&mut self, phase: Phase, place: Place, difference: Difference) {
        let problem = self.problem(phase, place, difference);
        match &mut self.outcome {
            Outcome::Pass => self.outcome = Outcome::Lenient(problem),
            Outcome::Lenient(first) => note(&mut first.notes, summary(&problem)),
            _ => {}
        }
    }

    pub(super) fn fail(&mut self, phase: Phase, place: Place, difference: Difference) {
        let problem = self.problem(phase, place, difference);
        match &mut self.outcome {
            Outcome::Fail(first) => note(&mut first.notes, summary(&problem)),
            Outcome::Error { .. } => {}
            _ => self.outcome = Outcome::Fail(problem),
        }
    }

    pub(super) fn setup_failed(&mut self, place: Place, difference: Difference) {
        let problem = self.problem(Phase::Setup, place, difference);
        let reason = format!("the setup failed: {}", summary(&problem));
        // Were something that the case relies on known to be broken, it would not have begun.
        self.outcome = Outcome::Error { reason, problem: Some(problem) };
    }

    /// A frame was not sent, or the bus is too slow, so that the case says nothing.
    pub(super) fn withheld(&mut self, why: String) {
        if !matches!(self.outcome, Outcome::Fail(_)) {
            self.outcome = Outcome::Skip(why);
        }
    }

    /// The device refused what it may refuse, so that the remaining steps were left out. Returns
    /// what is to be noted: where all that judges is among them, the case says nothing.
    pub(super) fn declined(&mut self, case: &Case) -> Option<String> {
        let (place, what) = self.declined.take()?;
        let allowed = format!("{what}, which is allowed");
        let judging = case.judging_steps();
        let is_untried = judging.first().is_some_and(|(first, _)| *first >= place)
            && judging.last().is_some_and(|(last, _)| *last > place);
        let is_enough = case.steps[place].value.is_enough();
        if is_untried && !is_enough && self.outcome == Outcome::Pass {
            self.outcome = Outcome::Skip(format!("{allowed}, before anything was judged"));
            return None;
        }
        Some(format!("{allowed}; the remaining steps were skipped"))
    }

    /// The device failed where steps go on after that, although what follows cannot be made then.
    pub(super) fn error(&mut self, reason: String) {
        if !matches!(self.outcome, Outcome::Fail(_)) {
            self.outcome = Outcome::Error { reason, problem: None };
        }
    }

    fn problem(&self, phase: Phase, place: Place, difference: Difference) -> Box<Problem> {
        let Difference { expected, actual, raw, apart, sheet } = difference;
        let place = excerpt(self.source, place);
        let notes = Vec::new();
        Box::new(Problem {
            at: self.at,
            phase,
            place,
            expected,
            actual,
            raw,
            apart,
            sheet: sheet.map(|sheet| *sheet),
            notes,
            capped: false,
        })
    }
}

/// Adds a further problem, up to the number that a reader will look at.
fn note(notes: &mut Vec<String>, text: String) {
    const MOST: usize = 100;
    match notes.len() {
        ..MOST => notes.push(text),
        MOST => notes.push(format!("and more: these are the first {MOST}")),
        _ => {}
    }
}

fn summary(problem: &Problem) -> String {
    format!("line {}: expected {}, came {}", problem.place.line, problem.expected, problem.actual)
}

pub(super) fn error(reason: String) -> Outcome {
    Outcome::Error { reason, problem: None }
}

#[cfg(test)]
mod tests {
    use super::note;

    #[test]
    fn notes_end_with_a_word_about_the_rest() {
        let mut notes = Vec::new();
        (0..1000).for_each(|number| note(&mut notes, number.to_string()));
        assert_eq!((notes.len(), notes[99].as_str()), (101, "99"));
        assert_eq!(notes[100], "and more: these are the first 100");
    }
}
