//! Repeats a case while the tester is late.

use std::time::Duration;

use canopen::nmt::Service;
use reports::Outcome;

use super::case::{Aftermath, CaseRun, Common};
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
    /// The last NMT command before its problem.
    pub commanded: Option<Service>,
    /// The results for its assertions, if the observer asks for them.
    pub shown: Option<Shown>,
}

/// Runs one instance.
pub(super) fn run(link: &mut Link, common: Common, instance: &Instance, left: Left) -> Finished {
    let mut left = left;
    let (mut attempt, mut stalled, mut failed, mut cleared) = (0, false, false, false);
    loop {
        attempt += 1;
        let mut run = CaseRun::new(link, common, instance);
        run.link.forget_traffic();
        let (mut outcome, aftermath) = run.run(left);
        run.link.clean(false);
        outcome = under_load(outcome, run.link.traffic());
        let late = run.late.map(|late| show_time(Duration::from_millis(late.as_millis() as u64)));
        run.link.take_trace();
        let shown = run.proof.take().map(Proof::end);
        let commanded = run.commanded;
        let finished = |outcome, aftermath| Finished { outcome, aftermath, commanded, shown };
        let Aftermath::Left(how) = aftermath else { return finished(outcome, aftermath) };
        // After a stall, a failure counts only if it repeats: the next stall may go unnoticed.
        let is_fail = matches!(outcome, Outcome::Fail(_));
        let doubtful = stalled && !failed && is_fail;
        if is_fail && run.earlier_cause && !cleared {
            (left, cleared) = (Left::Dirty, true);
            run.note(
                "an emergency of an earlier case came: the case is repeated after a reset"
                    .to_owned(),
            );
            continue;
        }
        let why = match &late {
            // The case says nothing about the device.
            Some(late) => format!("the tester was late by {late}"),
            None if doubtful => "the tester was late in the attempt before".to_owned(),
            None => return finished(outcome, aftermath),
        };
        if attempt == ATTEMPTS {
            let reason = match &late {
                Some(_) => format!("{why}, and in {attempt} attempts"),
                None => format!("the tester was late in {} attempts, and one failed", attempt - 1),
            };
            return finished(Outcome::Undecided(reason), aftermath);
        }
        (left, stalled, failed) = (how, stalled || late.is_some(), failed || doubtful);
        run.note(format!("{why}: the case is repeated"));
        if let Err(error) = run.link.calm() {
            let (outcome, aftermath) = run.bus_failed(error);
            return finished(outcome, aftermath);
        }
    }
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

/// How often a case is run at most while the tester is late.
const ATTEMPTS: u32 = 4;
