//! One case: settle, steps, restore, judgement.

use std::time::Duration;

use canopen::emcy::EmcyCode;
use canopen::nmt::{self, Command, Service};
use canopen::{BusError, Id, Mux};
use reports::{Event, Note, Outcome, Phase, Repeated};

use super::attempts::Repeats;
use super::outcome::{CaseOutcome, error};
use super::phases::run_phase;
use crate::dut::Dut;
use crate::plan::{Fate, Instance, Scope, deeds, others};
use crate::run::link::{Lateness, Link};
use crate::run::observer::{Observer, Unobserved};
use crate::run::policy::Policy;
use crate::run::rest::{
    Address, Baseline, BenchSnapshot, Leaving, Left, Partner, Settled, Snapshot, Undo, application,
    emergencies, enter, give_back, is_still, owes_a_sign, settle,
};
use crate::run::steps::{Difference, Proof, Steps, bench, is_of_protocol, is_reset, promise};

/// The consequence of a case for the next ones.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Aftermath {
    /// The device answers.
    Left(Left),
    /// The device does not answer any more.
    Gone(String),
    /// The bus failed, or the user asked to stop.
    Stop(BusError),
}

/// The common part of the cases of a session.
#[derive(Clone, Copy)]
pub(super) struct Common<'r> {
    /// The expected times and how long to wait.
    pub policy: &'r Policy,
    /// The device.
    pub dut: &'r Dut,
    /// How it was before the first case.
    pub baseline: &'r Baseline,
    /// The identifiers that its data sheet gives to TPDOs, SYNC and TIME.
    pub known: &'r [Id],
    /// The changes in the device.
    pub undo: &'r Undo,
    /// What was repeated on a bus that may lose frames.
    pub repeats: &'r Repeats,
    /// Learns what happens.
    pub observer: &'r dyn Observer,
}

/// The state of the device before the steps.
enum Ready {
    /// It is at rest, and these are the values of what the case may change.
    With(Snapshot),
    /// It is lost, and why.
    Lost(String),
}

const CONSUMER_HEARTBEAT_TIME: u16 = 0x1016;

/// Whether a failure of the bus is the end of the run: bad frames on the wire, and those that a
/// tester without time did not read, spoil one case, not those that follow.
const fn lasts(error: &BusError) -> bool {
    !matches!(
        error,
        BusError::Controller(_) | BusError::Lost(_) | BusError::Withheld(_) | BusError::Ended(_)
    )
}

/// One attempt at a case.
pub(super) struct CaseRun<'r, 'b> {
    pub link: &'r mut Link<'b>,
    pub common: Common<'r>,
    pub instance: &'r Instance,
    pub bench_snapshot: BenchSnapshot,
    /// What the case changed in the other node of the bus.
    pub partner: Partner,
    /// How late the tester was, when that may be the reason of the outcome.
    pub late: Option<Duration>,
    /// Where in the trace its steps begin.
    pub steps_from: usize,
    /// Whether an emergency came whose cause an earlier case may have left.
    pub earlier_cause: bool,
    /// The NMT commands in effect when the problem came up.
    pub commanded: Vec<Service>,
    /// The results for the assertions, if the observer asks for them.
    pub proof: Option<Proof>,
}

impl<'r, 'b> CaseRun<'r, 'b> {
    pub(super) fn new(link: &'r mut Link<'b>, common: Common<'r>, instance: &'r Instance) -> Self {
        let (bench_snapshot, proof) = (BenchSnapshot::default(), Proof::of(common.observer));
        Self {
            link,
            common,
            instance,
            bench_snapshot,
            partner: Partner::default(),
            late: None,
            steps_from: 0,
            earlier_cause: false,
            commanded: Vec::new(),
            proof,
        }
    }

    /// One attempt: brings the device to rest, runs the steps, and leaves it as it was.
    pub(super) fn run(&mut self, left: Left) -> (Outcome, Aftermath) {
        let Common { policy, dut, baseline, .. } = self.common;
        if !self.instance.needs_device() {
            return match self.steps() {
                Ok(outcome) => (outcome, Aftermath::Left(left)),
                Err(error) => self.bus_failed(error),
            };
        }
        let snapshot = match self.prepare(left) {
            Ok(Ready::Lost(reason)) => {
                return (error(reason.clone()), Aftermath::Gone(reason));
            }
            Ok(Ready::With(snapshot)) => snapshot,
            Err(error) => return self.bus_failed(error),
        };
        let (outcome, stop) = match self.watched_steps() {
            Ok(outcome) => (self.with_way_out(outcome), None),
            Err(BusError::Withheld(why)) => (Outcome::Skip(why), None),
            Err(error) => (self.bus_failed(error.clone()).0, Some(error)),
        };
        let bench_alone = !self.bench_snapshot.any();
        let still = bench_alone && is_still(self.link, dut, 0);
        // A failed bus may still carry the frames that leave the device as it was found.
        let passed = match &outcome {
            Outcome::Blocked(_) => false,
            Outcome::Lenient(_) => true,
            other => other.problem().is_none(),
        };
        let mut changed = snapshot.touched(self.link, self.common.dut.node);
        self.earlier_cause = baseline.may_monitor() && self.reports_a_lost_node();
        if changed.iter().any(|mux| mux.index == CONSUMER_HEARTBEAT_TIME) {
            self.earlier_cause = false;
            baseline.monitors(true);
        }
        self.link.clean(true);
        let patience = self.patience();
        let (link, bench_snapshot) = (&mut *self.link, &mut self.bench_snapshot);
        let mut leaving = Leaving { link, policy, dut, baseline, bench_snapshot, patience };
        let restored = leaving.restore(&snapshot, still, passed, &mut changed);
        let restored = self.set_partner_back().and(restored);
        if !changed.is_empty() {
            let listed: Vec<String> = changed.iter().map(Mux::to_string).collect();
            self.note(format!("not every object could be restored: {}", listed.join(", ")));
        }
        let aftermath = match (restored, stop) {
            (_, Some(error)) | (Err(error), None) if self.ends_run(&error) => {
                Aftermath::Stop(error)
            }
            (Err(_), _) | (_, Some(_)) => Aftermath::Left(Left::Dirty),
            (Ok(restored), None) => {
                let still = bench_alone && restored.still;
                Aftermath::Left(match (restored.whole && passed, still) {
                    (false, _) => Left::Dirty,
                    (true, false) => Left::Calm,
                    (true, true) => Left::Still,
                })
            }
        };
        let ended = self.still_there(outcome, aftermath);
        // A device that layer setting services spoke to has shown by now that it is there.
        let address = Address::after(self.link.trace(), dut);
        self.common.undo.end(&snapshot, &changed, address);
        ended
    }

    /// Sets back what the case changed in the other node of the bus.
    fn set_partner_back(&mut self) -> Result<(), BusError> {
        let Common { policy, dut, undo, .. } = self.common;
        let Some(other) = &dut.partner else { return Ok(()) };
        if !self.partner.set_back(self.link, policy, other, undo.of_partner())? {
            self.note(format!("the heartbeat of {other} could not be set back"));
        }
        Ok(())
    }

    /// Whether the device reported in this attempt that a node it monitors is lost.
    fn reports_a_lost_node(&self) -> bool {
        let mut sent = emergencies(self.link.trace(), self.common.dut, self.common.baseline);
        let code = EmcyCode::HEARTBEAT.0.to_le_bytes();
        sent.any(|frame| frame.data.starts_with(&code))
    }

    /// A device of which the case has left no sign is brought to rest at once: the case in which it
    /// is lost is the one that says so.
    fn still_there(&mut self, outcome: Outcome, aftermath: Aftermath) -> (Outcome, Aftermath) {
        let Common { policy, dut, baseline, .. } = self.common;
        let Aftermath::Left(left) = aftermath else { return (outcome, aftermath) };
        if !owes_a_sign(self.link, dut) {
            return (outcome, aftermath);
        }
        match settle(self.link, policy, dut, baseline, left) {
            Ok(Settled::AtRest(remark)) => {
                remark.into_iter().for_each(|text| self.note(text));
                (outcome, Aftermath::Left(Left::Still))
            }
            Ok(Settled::Lost(why)) => {
                let case = self.instance.name();
                let reason = format!("the device did not come back after {case}: {why}");
                let outcome = match outcome {
                    Outcome::Fail(mut problem) => {
                        problem.notes.push(reason.clone());
                        Outcome::Fail(problem)
                    }
                    _ => error(reason.clone()),
                };
                (outcome, Aftermath::Gone(reason))
            }
            Err(failure) if self.ends_run(&failure) => (outcome, Aftermath::Stop(failure)),
            Err(_) => (outcome, Aftermath::Left(Left::Dirty)),
        }
    }

    /// Whether no case follows a failure of the bus.
    fn ends_run(&self, failure: &BusError) -> bool {
        lasts(failure) || self.common.baseline.is_given_up()
    }

    /// Brings the device to rest, and reads what the case may change.
    fn prepare(&mut self, left: Left) -> Result<Ready, BusError> {
        let Common { policy, dut, baseline, undo, .. } = self.common;
        match settle(self.link, policy, dut, baseline, left)? {
            Settled::AtRest(remark) => remark.into_iter().for_each(|text| self.note(text)),
            Settled::Lost(why) => {
                return Ok(Ready::Lost(format!("the device did not come back: {why}")));
            }
        }
        if let Some(profile) = self.instance.suite.profile() {
            application(self.link, policy, dut, baseline, profile)?;
        }
        let left = undo.address();
        if left > Address::AsBefore && give_back(self.link, dut, &baseline.identity, left)? {
            undo.has_its_address();
        }
        let mut snapshot = Snapshot::take(self.link, policy, dut, self.instance)?;
        if undo.is_kept() && dut.eds.device.lss {
            snapshot.address = Address::of_deeds(&deeds(self.instance, dut));
        }
        if undo.begin(&mut snapshot) {
            // The disk took time, which belongs to no step.
            self.link.look_from_now()?;
        }
        Ok(Ready::With(snapshot))
    }

    /// Its steps, under observation.
    fn watched_steps(&mut self) -> Result<Outcome, BusError> {
        self.common.observer.case_begins();
        let outcome = self.steps();
        self.common.observer.case_over();
        outcome
    }

    /// Setup, steps, finally, and what the monitors say.
    fn steps(&mut self) -> Result<Outcome, BusError> {
        let mut result = CaseOutcome {
            source: &self.instance.suite.source,
            at: self.link.mark(),
            outcome: Outcome::Pass,
            declined: None,
            late: None,
        };
        if self.is_unfit(&mut result) {
            return Ok(result.outcome);
        }
        if let Some(unmet) =
            bench::meet_needs(self.link, self.common.policy, self.common.dut, self.instance)?
        {
            result.error(unmet);
            return Ok(result.outcome);
        }
        let commanded_from = self.link.trace().len();
        if self.instance.needs_device() {
            let state = self.instance.case().state;
            enter(self.link, self.common.policy, self.common.dut, self.common.baseline, state)?;
        }
        self.link.forget_lateness();
        self.steps_from = self.link.trace().len();
        let (case, patience) = (self.instance.case(), self.patience());
        let scope = self.scope();
        let mut steps = Steps {
            link: &mut *self.link,
            dut: self.common.dut,
            catalogue: &self.instance.suite.catalogue,
            policy: self.common.policy,
            scope,
            patience,
            bench_snapshot: &mut self.bench_snapshot,
            partner: &mut self.partner,
            undo: self.common.undo,
            proof: self.proof.take(),
            words: &self.instance.suite.words,
            margin: Duration::ZERO,
            awaited: Duration::ZERO,
            from: self.steps_from,
            next: None,
            boots_up: self.common.baseline.boots_up(),
            begun: Vec::new(),
        };
        let observer = self.common.observer;
        let ran = match run_phase(&mut steps, &case.setup, Phase::Setup, &mut result, &Unobserved) {
            Ok(true) => run_phase(&mut steps, &case.steps, Phase::Step, &mut result, observer),
            other => other,
        };
        observer.steps_over();
        let declined = result.declined(case);
        // The setup is undone, regardless of how the steps ended.
        steps.link.clean(true);
        let undone = run_phase(&mut steps, &case.finally, Phase::Finally, &mut result, &Unobserved);
        if !matches!(result.outcome, Outcome::Pass | Outcome::Skip(_)) {
            steps.tell_begun();
        }
        self.proof = steps.proof.take();
        let alive = ran?;
        undone?;
        declined.into_iter().for_each(|text| self.note(text));
        if alive {
            self.judge_monitors(self.steps_from, &mut result);
        }
        self.excuse_beside_partner(&mut result);
        self.late = result.late;
        self.commanded = self.in_effect(commanded_from, &result.outcome);
        Ok(result.outcome)
    }

    /// Whether the data sheet contradicts the steps, so that the case fails without them.
    fn is_unfit(&self, result: &mut CaseOutcome) -> bool {
        let Fate::Unfit(complaint) = &self.instance.fate else { return false };
        let place = complaint.place.unwrap_or_else(|| self.instance.case().id.place);
        let difference = promise::unfit(complaint, self.instance, self.common.dut);
        result.fail(Phase::Step, place, difference);
        true
    }

    /// A failure says nothing where the other node of the bus missed a heartbeat itself.
    fn excuse_beside_partner(&mut self, result: &mut CaseOutcome) {
        if let (Outcome::Fail(_), Some(other)) = (&result.outcome, &self.common.dut.partner)
            && let Some(why) = self.partner.failed(self.link, other)
        {
            result.outcome = Outcome::Undecided(why);
        }
    }

    /// A breach of what holds in each case makes it fail.
    fn judge_monitors(&mut self, from: usize, result: &mut CaseOutcome) {
        let Some(breach) = self.watch(from) else { return };
        let case = self.instance.case();
        let last = case.steps.last().map_or(case.id.place, |step| step.place);
        // A device on the same host is delayed equally, and a server may give up a transfer.
        let waited = match is_of_protocol(breach.frame.as_ref()) {
            true => self.link.kept_waiting(),
            false => Duration::ZERO,
        };
        let difference =
            Difference { raw: breach.frame, ..Difference::new(breach.rule, breach.got) };
        self.proof.iter_mut().for_each(Proof::spoil);
        result.fail(Phase::Monitor, last, difference);
        // A tester that was late with a frame had as little of the time.
        let Lateness { missed, overslept, .. } = self.link.lateness();
        let late = self.link.noticed().max(waited).max(missed).max(overslept);
        let late = (late > self.common.policy.bears(Duration::ZERO)).then_some(late);
        result.late = result.late.max(late);
    }

    /// The NMT commands whose effects should be there when the problem came up: the last reset of
    /// the case, and the last command after it.
    fn in_effect(&self, from: usize, outcome: &Outcome) -> Vec<Service> {
        let Some(problem) = outcome.problem() else { return Vec::new() };
        let sent = self.link.trace()[from..].iter().map(|seen| seen.stamped);
        let sent = sent.filter(|seen| seen.own && seen.at <= problem.at);
        let commands = sent.filter(|seen| seen.frame.data_id() == Some(nmt::COB_ID));
        let commands = commands.filter_map(|seen| Command::decode(&seen.frame.data).ok());
        let of_device = |command: &Command| [0, self.common.dut.node].contains(&command.node);
        let mut in_effect = Vec::new();
        for Command { service, .. } in commands.filter(of_device) {
            match service {
                service if is_reset(service) => in_effect.clear(),
                _ => in_effect.retain(|before| is_reset(*before)),
            }
            in_effect.push(service);
        }
        in_effect
    }

    /// The names of the instance; nodes that the device monitors from the start are not `$other`.
    fn scope(&self) -> Scope {
        let mut scope = self.instance.scope.clone();
        if !self.common.baseline.monitored.is_empty() {
            let stored = others(self.common.dut, &self.common.baseline.monitored);
            for ((name, planned), (_, binding)) in others(self.common.dut, &[]).zip(stored) {
                scope.rebind(&name, &planned, binding);
            }
        }
        scope
    }

    /// No document of a profile limits how long its application may take, while the times of
    /// CiA 301 and of the data sheet are limits.
    fn patience(&self) -> u32 {
        let of_profile = self.instance.suite.file.profile.is_some();
        if of_profile { self.common.policy.patience } else { 1 }
    }

    /// If the case is about an option that the device may lack, adds how to declare it: only the
    /// user knows.
    fn with_way_out(&self, mut outcome: Outcome) -> Outcome {
        if let Outcome::Fail(problem) = &mut outcome {
            problem.notes.extend(self.instance.options().map(|option| {
                format!("for a device that has no {option}, say `--without {option}`")
            }));
        }
        outcome
    }

    pub(super) fn note(&mut self, text: String) {
        let at = self.link.mark();
        self.link.emit(Event::Note(Note { at, text }));
    }

    /// Says why the case begins anew.
    /// Begins anew, after an attempt that `failed` or that says nothing.
    pub(super) fn repeat(&mut self, text: String, failed: bool) {
        let at = self.link.mark();
        self.link.emit(Event::CaseRepeated(Repeated { at, text, failed }));
    }

    pub(super) fn bus_failed(&self, failure: BusError) -> (Outcome, Aftermath) {
        let outcome = match &failure {
            BusError::Interrupted => error("interrupted".to_owned()),
            BusError::Ended(why) => error(why.clone()),
            // A trace with a hole in it proves nothing.
            BusError::Lost(why) => Outcome::Undecided(why.clone()),
            other => error(format!("the bus failed: {other}")),
        };
        let aftermath = match failure {
            // A program that ended was started again.
            BusError::Ended(_) => Aftermath::Left(Left::Dirty),
            BusError::Lost(_) if !self.common.baseline.is_given_up() => {
                Aftermath::Left(Left::Dirty)
            }
            failure => Aftermath::Stop(failure),
        };
        (outcome, aftermath)
    }
}
