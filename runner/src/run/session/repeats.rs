//! Runs a case as often as the user wants, to see whether it comes out the same each time.
//!
//! Each repeat is decided alone, with all its attempts. What they come to together is decided here,
//! once.

use reports::{Event, Outcome, Problem, Repeated};

use super::Session;
use super::attempts::{self, Finished};
use super::case::{Aftermath, Common};
use crate::plan::Instance;
use crate::run::link::Link;
use crate::run::rest::Left;

impl Session<'_> {
    /// Runs an instance as often as the run repeats each, unless the device is lost or does not
    /// bear it once more. What needs no device comes out the same each time.
    pub(super) fn repeated(
        &self,
        link: &mut Link,
        common: Common,
        instance: &Instance,
        left: Left,
    ) -> Finished {
        let most = if instance.needs_device() { self.policy.repeat } else { 1 };
        let mut tally = Tally::default();
        let mut finished = attempts::run(link, common, instance, left);
        for count in 2..=most {
            let Aftermath::Left(left) = finished.aftermath else { break };
            if self.stop.asked() || self.exceeds(instance).is_some() {
                break;
            }
            let failed = finished.outcome.problem().is_some();
            tally.take(finished.outcome);
            let (at, text) = (link.mark(), format!("repeat {count} of {most}"));
            link.emit(Event::CaseRepeated(Repeated { at, text, failed }));
            finished = attempts::run(link, common, instance, left);
        }
        Finished { outcome: tally.with(finished.outcome), ..finished }
    }
}

/// The outcomes of the repeats of a case.
#[derive(Debug, Default)]
struct Tally {
    /// How many attempts said something about the device.
    of: u32,
    /// In how many of them it failed, and the problem of the latest.
    failed: u32,
    problem: Option<Box<Problem>>,
    /// The latest of each of the others.
    lenient: Option<Outcome>,
    error: Option<Outcome>,
    undecided: Option<Outcome>,
}

impl Tally {
    fn take(&mut self, outcome: Outcome) {
        let (failed, of, problem) = match outcome {
            Outcome::Fail(problem) => (1, 1, Some(problem)),
            Outcome::Flaky { problem, failed, of } => (failed, of, Some(problem)),
            Outcome::Pass => (0, 1, None),
            Outcome::Lenient(_) => {
                self.lenient = Some(outcome);
                (0, 1, None)
            }
            Outcome::Undecided(_) => return self.undecided = Some(outcome),
            Outcome::Error { .. } => return self.error = Some(outcome),
            // A case that cannot go on says nothing more.
            Outcome::Skip(_) | Outcome::Blocked(_) | Outcome::Waived { .. } => return,
        };
        (self.failed, self.of) = (self.failed + failed, self.of + of);
        self.problem = problem.or_else(|| self.problem.take());
    }

    /// What they come to with the last one. A case that could not be carried out once is an ERROR,
    /// since nobody knows what it would have shown; one for which the tester was late is only left
    /// out.
    fn with(mut self, last: Outcome) -> Outcome {
        if self.of == 0 && self.error.is_none() && self.undecided.is_none() {
            return last;
        }
        self.take(last.clone());
        let (failed, of) = (self.failed, self.of);
        match (self.error, self.problem) {
            (Some(error), _) => error,
            _ if of == 0 => last,
            (None, Some(mut problem)) if failed < of => {
                problem
                    .notes
                    .push(format!("with --repeat, it failed in {failed} of {of} attempts"));
                Outcome::Flaky { problem, failed, of }
            }
            (None, Some(problem)) => Outcome::Fail(problem),
            (None, None) => self.lenient.unwrap_or(Outcome::Pass),
        }
    }
}

#[cfg(test)]
mod tests {
    use reports::{Excerpt, Phase, Verdict};

    use super::*;

    fn problem() -> Box<Problem> {
        Box::new(Problem {
            at: canopen::Instant::ZERO,
            phase: Phase::Step,
            place: Excerpt {
                file: String::new(),
                line: 1,
                column: 1,
                length: 1,
                source: String::new(),
                before: Vec::new(),
                after: Vec::new(),
            },
            expected: String::new(),
            actual: String::new(),
            raw: None,
            apart: None,
            sheet: None,
            notes: Vec::new(),
            capped: false,
        })
    }

    #[test]
    fn repeats_come_to_one_verdict() {
        let of = |letter| match letter {
            'p' => Outcome::Pass,
            'f' => Outcome::Fail(problem()),
            'l' => Outcome::Lenient(problem()),
            'y' => Outcome::Flaky { problem: problem(), failed: 1, of: 2 },
            'u' => Outcome::Undecided(String::new()),
            'e' => Outcome::Error { reason: String::new(), problem: None },
            _ => Outcome::Skip(String::new()),
        };
        for (repeats, verdict, times) in [
            ("p", Verdict::Pass, None),
            ("ppp", Verdict::Pass, None),
            ("plp", Verdict::Lenient, None),
            ("fff", Verdict::Fail, None),
            ("y", Verdict::Flaky, Some((1, 2))),
            ("yy", Verdict::Flaky, Some((2, 4))),
            ("pfp", Verdict::Flaky, Some((1, 3))),
            ("lf", Verdict::Flaky, Some((1, 2))),
            ("pfe", Verdict::Error, None),
            ("upu", Verdict::Pass, None),
            ("uuf", Verdict::Fail, None),
            ("uu", Verdict::Error, None),
            ("s", Verdict::Skip, None),
        ] {
            let mut outcomes: Vec<Outcome> = repeats.chars().map(of).collect();
            let last = outcomes.pop().expect("one at least");
            let mut tally = Tally::default();
            outcomes.into_iter().for_each(|outcome| tally.take(outcome));
            let outcome = tally.with(last);
            let came = match &outcome {
                Outcome::Flaky { failed, of, .. } => Some((*failed, *of)),
                _ => None,
            };
            assert_eq!((outcome.verdict(), came), (verdict, times), "{repeats}");
        }
    }
}
