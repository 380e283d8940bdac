//! Repeats a case while the tester is late, and one that fails on a bus that may lose frames.

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::fmt::Write;
use std::time::Duration;

use canopen::monitor::Seen;
use canopen::nmt::Service;
use reports::{Outcome, Problem};

use super::case::{Aftermath, CaseRun, Common};
use super::of_itself::of_itself;
use crate::dut::Dut;
use crate::plan::Instance;
use crate::run::link::{Link, Traffic};
use crate::run::observer::Shown;
use crate::run::rest::Left;
use crate::run::steps::Proof;
use crate::suite::literal::show_time;

/// The result of a case.
pub(super) struct Finished {
    /// The verdict and what led to it.
    pub outcome: Outcome,
    /// The consequence for the next cases.
    pub aftermath: Aftermath,
    /// The NMT commands in effect when its problem came up.
    pub commanded: Vec<Service>,
    /// The results for its assertions, if the observer asks for them.
    pub shown: Option<Shown>,
}

/// The failures of a session that were repeated. On a bus that others share, a frame may be lost,
/// or come twice because it was disturbed at its end, whatever the device does. A device that is a
/// program may have to wait until its machine runs it.
#[derive(Debug, Default)]
pub(super) struct Repeats {
    /// How a case has failed again and again, which needs no more proof.
    proved: RefCell<BTreeSet<String>>,
}

/// The failures of one case.
#[derive(Debug, Default)]
struct Failures {
    count: u32,
    /// How often the last of them came in a row.
    same: u32,
    at: String,
    /// How many frames the tester had sent in the last of them.
    sent: usize,
    last: Option<Box<Problem>>,
    /// In how many of them the device sent something wrong, which the wire does not explain.
    wrong: u32,
}

/// What a failed attempt shows beside its outcome.
#[derive(Clone, Copy, Debug)]
struct Evidence {
    /// How many frames the tester had sent in its steps.
    sent: usize,
    /// Whether a frame that was lost or came twice explains it: nothing came, or once more what had
    /// come before.
    by_the_wire: bool,
    /// How many wrong frames of six attempts are proof: where nobody shares the bus, none is lost
    /// that would explain them.
    enough: u32,
}

impl Evidence {
    /// From the frames of the steps.
    fn of(problem: Option<&Problem>, steps: &[Seen], dut: &Dut) -> Self {
        let enough = if dut.shares_its_bus { Failures::PROOF } else { 1 };
        let Some(problem) = problem else { return Self { sent: 0, by_the_wire: false, enough } };
        let until = steps.iter().map(|seen| &seen.stamped).take_while(|it| it.at <= problem.at);
        let times = |raw| until.clone().filter(|seen| !seen.own && seen.frame == raw).count();
        let by_the_wire = dut.shares_its_bus && problem.raw.is_none_or(|raw| times(raw) > 1);
        Self { sent: until.clone().filter(|seen| seen.own).count(), by_the_wire, enough }
    }

    /// Whether it failed where another attempt did after `sent` frames. In a long case, two frames
    /// are lost at two places.
    const fn is_near(self, sent: usize) -> bool {
        !self.by_the_wire || self.sent.abs_diff(sent) <= 1 + self.sent / 20
    }
}

/// What follows from an attempt.
enum Follows {
    /// The outcome of the case.
    Outcome(Outcome),
    /// Another attempt, after a reset.
    Again,
}

impl Failures {
    /// A device that fails so often in a row in one way fails.
    const PROOF: u32 = 3;
    /// After as many failures, in different ways, it is not tried again.
    const MOST: u32 = 6;

    /// Takes the outcome of an attempt.
    fn weigh(
        &mut self,
        outcome: Outcome,
        evidence: Evidence,
        instance: &Instance,
        repeats: &Repeats,
    ) -> Follows {
        let Some(at) = at(&outcome, instance) else {
            return Follows::Outcome(self.beside_failures(outcome));
        };
        let again = at == self.at && evidence.is_near(self.sent);
        self.same = if again { self.same + 1 } else { 1 };
        (self.count, self.at, self.sent) = (self.count + 1, at, evidence.sent);
        let came = outcome.problem().is_some_and(|problem| problem.raw.is_some());
        self.wrong += u32::from(came && !evidence.by_the_wire);
        if repeats.proved.borrow().contains(&self.at) {
            return Follows::Outcome(outcome);
        }
        if self.same == Self::PROOF {
            repeats.proved.borrow_mut().insert(self.at.clone());
            return Follows::Outcome(outcome);
        }
        // A device that has not passed once, and was wrong in several ways, is not in order. A
        // command or a PDO that was lost explains one or two of them.
        if self.count == Self::MOST && self.wrong >= evidence.enough {
            return Follows::Outcome(outcome);
        }
        if self.count == Self::MOST {
            let why = format!(
                "it failed in {} attempts, and never three times in a row in one way: frames are \
                 lost or come twice, the machine is busy, or the device fails now and then",
                self.count
            );
            return Follows::Outcome(Outcome::Undecided(why));
        }
        if let Outcome::Fail(problem) = outcome {
            self.last = Some(problem);
        }
        Follows::Again
    }

    /// A case that passes at last has not proved that the device is in order: it is FLAKY.
    fn beside_failures(&mut self, outcome: Outcome) -> Outcome {
        match (outcome, self.last.take()) {
            (Outcome::Pass | Outcome::Lenient(_), Some(mut problem)) => {
                let (failed, of) = (self.count, self.count + 1);
                problem.notes.push(format!(
                    "it failed in {failed} of {of} attempts, and then passed: a frame was lost or \
                     came twice, the machine was busy, or the device fails now and then",
                ));
                Outcome::Flaky { problem, failed, of }
            }
            (Outcome::Skip(why), Some(_)) => Outcome::Undecided(format!(
                "it failed in {} attempts, and was left out in the next: {why}",
                self.count
            )),
            (outcome, _) => outcome,
        }
    }
}

/// Where and in which way a case failed, or could not be carried out.
fn at(outcome: &Outcome, instance: &Instance) -> Option<String> {
    let suite = instance.suite.name();
    match outcome {
        // What is expected names the exchange, of which a lossy bus disturbs now one, now another.
        Outcome::Fail(problem) => {
            let Problem { place, expected, .. } = &**problem;
            Some(format!("{suite}:{}: {expected}", place.line))
        }
        // Without a problem of the device, such as a name that the bench lacks, it errs again.
        Outcome::Error { reason, problem: Some(_) } => Some(format!("{suite} {reason}")),
        Outcome::Blocked(reason) => Some(format!("{suite} {reason}")),
        _ => None,
    }
}

/// Runs one instance.
pub(super) fn run(link: &mut Link, common: Common, instance: &Instance, left: Left) -> Finished {
    let mut left = left;
    let (mut lost, mut stalls, mut failed, mut cleared) = (0, 0, false, false);
    let mut failures = Failures::default();
    loop {
        let mut run = CaseRun::new(link, common, instance);
        run.link.forget_traffic();
        let (mut outcome, aftermath) = run.run(left);
        run.link.clean(false);
        outcome = under_load(outcome, run.link.traffic());
        let steps = run.link.trace().get(run.steps_from..).unwrap_or_default();
        let evidence = Evidence::of(outcome.problem(), steps, common.dut);
        let certain = is_certain(&mut outcome, run.link.trace(), common);
        let late = run.late.map(|late| show_time(Duration::from_millis(late.as_millis() as u64)));
        run.link.take_trace();
        let shown = run.proof.take().map(Proof::end);
        let commanded = std::mem::take(&mut run.commanded);
        let finished = |outcome, aftermath| Finished { outcome, aftermath, commanded, shown };
        let Aftermath::Left(how) = aftermath else { return finished(outcome, aftermath) };
        if certain {
            return finished(outcome, aftermath);
        }
        // After a stall, a failure counts only if it repeats: the next stall may go unnoticed.
        let is_fail = matches!(outcome, Outcome::Fail(_));
        let doubtful = stalls > 0 && !failed && is_fail;
        if is_fail && run.earlier_cause && !cleared {
            (left, cleared) = (Left::Dirty, true);
            run.repeat(
                "an emergency of an earlier case came: the case is repeated after a reset"
                    .to_owned(),
                false,
            );
            continue;
        }
        let why = match &late {
            // The case says nothing about the device.
            Some(late) => format!("the tester was late by {late}"),
            None if doubtful => "the tester was late in the attempt before".to_owned(),
            // On a full bus, the next attempt fares no better.
            None if !(common.dut.shares_its_bus || common.dut.shares_its_machine)
                || !instance.needs_device()
                || run.link.traffic().load() >= Traffic::FULL =>
            {
                return finished(outcome, aftermath);
            }
            None => match failures.weigh(outcome, evidence, instance, common.repeats) {
                Follows::Outcome(outcome) => return finished(outcome, aftermath),
                Follows::Again => {
                    left = Left::Dirty;
                    let why = match common.dut.shares_its_bus {
                        true => "a frame was lost or came twice",
                        false => "the machine was too busy for the device",
                    };
                    let what = "the first attempt failed; the case is repeated after a reset";
                    run.repeat(format!("{what}, to rule out that {why}"), true);
                    continue;
                }
            },
        };
        (lost, stalls) = (lost + 1, stalls + u32::from(late.is_some()));
        if lost == ATTEMPTS {
            let reason = match &late {
                Some(_) => format!("{why}, and in {stalls} attempts"),
                None => format!("the tester was late in {stalls} attempts, and one failed"),
            };
            return finished(undecided(reason, &outcome), aftermath);
        }
        (left, failed) = (how, failed || doubtful);
        run.repeat(format!("{why}: the case is repeated"), false);
        if let Err(error) = run.link.calm() {
            let (outcome, aftermath) = run.bus_failed(error);
            return finished(outcome, aftermath);
        }
    }
}

/// What a case is for that reason, with the outcome of its last attempt.
fn undecided(mut reason: String, last: &Outcome) -> Outcome {
    if let Some(problem) = last.problem() {
        let first = |text: &str| text.lines().next().unwrap_or_default().to_owned();
        let (expected, actual) = (first(&problem.expected), first(&problem.actual));
        _ = write!(reason, "; the last one expected {expected}, came {actual}");
    }
    Outcome::Undecided(reason)
}

/// Whether a failure needs no repeat, since no frame that was lost, late or copied explains it. The
/// problem says so.
fn is_certain(outcome: &mut Outcome, trace: &[Seen], common: Common) -> bool {
    let Common { dut, policy, .. } = common;
    let Outcome::Fail(problem) = outcome else { return false };
    let Some(why) = of_itself(problem, trace, dut.node, policy.slow_wire) else { return false };
    if dut.shares_its_bus || dut.shares_its_machine {
        problem.notes.push(format!(
            "the device sent it of itself, once is enough: {why}, and a frame that was lost, late \
             or copied explains none of it"
        ));
    }
    true
}

/// A case that failed while others left hardly any room on the bus says nothing about the device.
fn under_load(outcome: Outcome, traffic: &Traffic) -> Outcome {
    match (outcome, traffic.said(Traffic::WORTH_A_WORD)) {
        (Outcome::Fail(problem), Some(load)) if traffic.load() >= Traffic::FULL => {
            let reason = format!("{load}, so that what came late or not at all proves nothing");
            Outcome::Error { reason, problem: Some(problem) }
        }
        (Outcome::Fail(mut problem), Some(load)) => {
            problem.notes.push(load);
            Outcome::Fail(problem)
        }
        (Outcome::Error { reason, problem }, Some(load)) => {
            Outcome::Error { reason: format!("{reason}; {load}"), problem }
        }
        (outcome, _) => outcome,
    }
}

/// How many attempts at a case the tester may spoil. Those that show how the device fails beside
/// them do not count: each brings the verdict nearer.
const ATTEMPTS: u32 = 4;
