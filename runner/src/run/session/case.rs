//! One case: settle, steps, restore, judgement.

use std::collections::BTreeSet;
use std::time::Duration;

use canopen::monitor::{self, Breach, Seen};
use canopen::pdo::CobId;
use canopen::sdo::Response;
use canopen::{Abort, BenchError, BusError, Frame, Instant, Mux, emcy};
use reports::{Event, Note, Outcome, Phase, Problem};

use super::baseline::Baseline;
use super::bench;
use super::bench_snapshot::BenchSnapshot;
use super::judge::{Difference, Judgement, Trouble, excerpt};
use super::link::Link;
use super::policy::Policy;
use super::promise;
use super::proof::{Proof, Shown, Witness};
use super::restore::Snapshot;
use super::settle::{self, Left, Unsettled};
use super::steps::Steps;
use super::traffic::Traffic;
use super::undo::Undo;
use crate::dut::Dut;
use crate::plan::{Instance, Scope, others};
use crate::source::{At, Place, Source};
use crate::suite::literal::show_time;
use crate::suite::model::Tolerated;
use crate::suite::step::Step;

/// What came of a case.
pub(super) struct Finished {
    /// The verdict and what led to it.
    pub outcome: Outcome,
    /// What the case means for those that follow.
    pub aftermath: Aftermath,
    /// What it shows about its assertions, where somebody wants to know.
    pub shown: Option<Shown>,
}

/// What a case means for those that follow.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Aftermath {
    /// The device answers.
    Left(Left),
    /// The device does not answer any more.
    Gone(String),
    /// The bus failed, or the user asked to stop.
    Stop(BusError),
}

/// What the cases of a session have in common.
#[derive(Clone, Copy)]
pub(super) struct Common<'r> {
    /// What to wait for and how long.
    pub policy: &'r Policy,
    /// The device.
    pub dut: &'r Dut,
    /// How it was before the first case.
    pub baseline: &'r Baseline,
    /// The identifiers that its data sheet gives to TPDOs, SYNC and TIME.
    pub known: &'r [u16],
    /// What was changed in it.
    pub undo: &'r Undo,
    /// Who learns what the cases show about their assertions.
    pub witness: Option<&'r dyn Witness>,
}

/// Runs one instance.
pub(super) fn run(link: &mut Link, common: Common, instance: &Instance, left: Left) -> Finished {
    let Common { policy, dut, baseline, known, undo, witness } = common;
    let mut left = left;
    let (mut attempt, mut stalled, mut failed) = (0, false, false);
    loop {
        attempt += 1;
        let (link, bench_snapshot) = (&mut *link, BenchSnapshot::default());
        let proof = witness.map(Proof::of);
        let late = None;
        let mut run = CaseRun {
            link,
            policy,
            dut,
            baseline,
            known,
            instance,
            bench_snapshot,
            undo,
            late,
            proof,
            witness,
        };
        run.link.forget_traffic();
        let (mut outcome, aftermath) = run.run(left);
        run.link.clean(false);
        outcome = under_load(outcome, run.link.traffic());
        let late = run.late.map(|late| show_time(Duration::from_millis(late.as_millis() as u64)));
        run.link.take_trace();
        let shown = run.proof.take().map(Proof::end);
        let Aftermath::Left(how) = aftermath else { return Finished { outcome, aftermath, shown } };
        // A host that stalled may stall again where nobody looks: what fails there fails twice.
        let doubtful = stalled && !failed && matches!(outcome, Outcome::Fail(_));
        let why = match &late {
            // The case says nothing about the device.
            Some(late) => format!("the tester was late by {late}"),
            None if doubtful => "the tester was late in the attempt before".to_owned(),
            None => return Finished { outcome, aftermath, shown },
        };
        if attempt == ATTEMPTS {
            let reason = match &late {
                Some(_) => format!("{why}, and in {attempt} attempts"),
                None => format!("the tester was late in {} attempts, and one failed", attempt - 1),
            };
            return Finished { outcome: error(reason), aftermath, shown };
        }
        (left, stalled, failed) = (how, stalled || late.is_some(), failed || doubtful);
        run.note(format!("{why}: the case is repeated"));
        if let Err(error) = run.link.calm() {
            let (outcome, aftermath) = run.bus_failed(error);
            return Finished { outcome, aftermath, shown };
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

/// How the end of a case left the device.
struct Restored {
    /// Whether each object is as it was.
    whole: bool,
    /// Whether nothing can be in flight.
    still: bool,
}

struct CaseRun<'r, 'b> {
    link: &'r mut Link<'b>,
    policy: &'r Policy,
    dut: &'r Dut,
    baseline: &'r Baseline,
    known: &'r [u16],
    instance: &'r Instance,
    bench_snapshot: BenchSnapshot,
    undo: &'r Undo,
    /// How late the tester was, when that may be the reason of the outcome.
    late: Option<Duration>,
    /// What the run shows about the assertions, where somebody wants to know.
    proof: Option<Proof>,
    /// Who that is.
    witness: Option<&'r dyn Witness>,
}

impl CaseRun<'_, '_> {
    fn run(&mut self, left: Left) -> (Outcome, Aftermath) {
        if !self.instance.needs_device() {
            return match self.steps() {
                Ok(outcome) => (outcome, Aftermath::Left(left)),
                Err(error) => self.bus_failed(error),
            };
        }
        match settle::settle(self.link, self.policy, self.dut, self.baseline, left) {
            Ok(note) => note.into_iter().for_each(|text| self.note(text)),
            Err(Unsettled::Bus(error)) => return self.bus_failed(error),
            Err(Unsettled::Device(why)) => {
                let reason = format!("the device did not come back: {why}");
                return (error(reason.clone()), Aftermath::Gone(reason));
            }
        }
        if let Some(profile) = self.instance.suite.profile()
            && let Err(error) =
                settle::application(self.link, self.policy, self.dut, self.baseline, profile)
        {
            return self.bus_failed(error);
        }
        let taken = Snapshot::take(self.link, self.policy, self.dut, self.instance);
        let mut snapshot = match taken {
            Ok(snapshot) => snapshot,
            Err(error) => return self.bus_failed(error),
        };
        if self.undo.begin(&mut snapshot) {
            // The disk took time, which belongs to no step.
            if let Err(error) = self.link.look_from_now() {
                return self.bus_failed(error);
            }
        }
        // Bad frames on the wire spoil this case, not those that follow.
        let lasts = |error: &BusError| {
            !matches!(error, BusError::Controller(_) | BusError::Withheld(_) | BusError::Ended(_))
        };
        let (outcome, stop) = match self.watched_steps() {
            Ok(outcome) => (self.with_way_out(outcome), None),
            Err(BusError::Withheld(why)) => (Outcome::Skip(why), None),
            Err(error) => (self.bus_failed(error.clone()).0, Some(error)),
        };
        let bench_alone = !self.bench_snapshot.any();
        let still = bench_alone && settle::is_still(self.link, self.dut, 0);
        // A bus that failed may still carry what leaves the device as it was found.
        let passed = match &outcome {
            Outcome::Blocked(_) => false,
            Outcome::Lenient(_) => true,
            other => other.problem().is_none(),
        };
        let mut changed = snapshot.touched(self.link, self.dut.node);
        self.link.clean(true);
        let restored = self.restore(&snapshot, still, passed, &mut changed);
        self.undo.end(&snapshot, &changed);
        if !changed.is_empty() {
            let changed: Vec<String> = changed.iter().map(Mux::to_string).collect();
            self.note(format!("not every object could be restored: {}", changed.join(", ")));
        }
        match (restored, stop) {
            (_, Some(error)) | (Err(error), None) if lasts(&error) => {
                (outcome, Aftermath::Stop(error))
            }
            (Err(_), _) | (_, Some(_)) => (outcome, Aftermath::Left(Left::Dirty)),
            (Ok(restored), None) => {
                let still = bench_alone && restored.still;
                let left = match (restored.whole && passed, still) {
                    (false, _) => Left::Dirty,
                    (true, false) => Left::Calm,
                    (true, true) => Left::Still,
                };
                (outcome, Aftermath::Left(left))
            }
        }
    }

    /// Its steps, and who watches them.
    fn watched_steps(&mut self) -> Result<Outcome, BusError> {
        self.witness.inspect(|witness| witness.case_begins());
        let outcome = self.steps();
        self.witness.inspect(|witness| witness.case_over());
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
            relies_on: self.instance.relies_on().next(),
        };
        if let Some(complaint) = &self.instance.unfit {
            let place = complaint.place.unwrap_or_else(|| self.instance.case().id.place);
            let difference = promise::unfit(complaint, self.instance, self.dut);
            result.fail(Phase::Step, place, difference);
            return Ok(result.outcome);
        }
        if let Some(unmet) = bench::meet_needs(self.link, self.policy, self.dut, self.instance)? {
            result.error(unmet);
            return Ok(result.outcome);
        }
        if self.instance.needs_device() {
            let state = self.instance.case().state;
            settle::enter(self.link, self.policy, self.dut, self.baseline, state)?;
        }
        self.link.forget_lateness();
        let watched_from = self.link.trace().len();
        let (case, patience) = (self.instance.case(), self.patience());
        let scope = self.scope();
        let mut steps = Steps {
            link: &mut *self.link,
            dut: self.dut,
            catalogue: &self.instance.suite.catalogue,
            policy: self.policy,
            scope,
            patience,
            bench_snapshot: &mut self.bench_snapshot,
            proof: self.proof.take(),
            words: &self.instance.suite.words,
            begun: Vec::new(),
        };
        let witness = self.witness;
        let ran = match run_phase(&mut steps, &case.setup, Phase::Setup, &mut result, None) {
            Ok(true) => run_phase(&mut steps, &case.steps, Phase::Step, &mut result, witness),
            other => other,
        };
        witness.inspect(|witness| witness.steps_over());
        // Whatever ended the steps, what they set up is undone.
        steps.link.clean(true);
        let undone = run_phase(&mut steps, &case.finally, Phase::Finally, &mut result, None);
        if !matches!(result.outcome, Outcome::Pass | Outcome::Skip(_)) {
            steps.tell_begun();
        }
        self.proof = steps.proof.take();
        let alive = ran?;
        undone?;
        if let Some(what) = result.declined.take() {
            self.note(format!(
                "the device refused {what}, which is allowed; the remaining steps were skipped"
            ));
        }
        let last = case.steps.last().map_or(case.id.place, |step| step.place);
        if alive && let Some(breach) = self.watch(watched_from) {
            let difference =
                Difference { raw: breach.frame, ..Difference::new(breach.rule, breach.got) };
            self.proof.iter_mut().for_each(Proof::spoil);
            result.fail(Phase::Monitor, last, difference);
            // Who shares the host with the tester is as late as the tester.
            let noticed = self.link.lateness().noticed;
            let late = (noticed > self.policy.bears(Duration::ZERO)).then_some(noticed);
            result.late = result.late.max(late);
        }
        self.late = result.late;
        Ok(result.outcome)
    }

    /// The names of the instance; nodes that the device monitors from the start are not `$other`.
    fn scope(&self) -> Scope {
        let mut scope = self.instance.scope.clone();
        if !self.baseline.monitored.is_empty() {
            let stored = others(self.dut, &self.baseline.monitored);
            for ((name, planned), (_, binding)) in others(self.dut, &[]).zip(stored) {
                scope.rebind(&name, &planned, binding);
            }
        }
        scope
    }

    /// No document of a profile limits how long its application may take, while the times of
    /// CiA 301 and of the data sheet are limits.
    fn patience(&self) -> u32 {
        let of_profile = self.instance.suite.file.profile.is_some();
        if of_profile { self.policy.patience } else { 1 }
    }

    /// An option that the device may lack, which only its user knows: how to say so.
    fn with_way_out(&self, mut outcome: Outcome) -> Outcome {
        if let Outcome::Fail(problem) = &mut outcome {
            problem.notes.extend(self.instance.options().map(|option| {
                format!("for a device that has no {option}, say `--without {option}`")
            }));
        }
        outcome
    }

    /// The first rule that the frames from place `from` on break.
    fn watch(&self, from: usize) -> Option<Breach> {
        let tolerated = self.instance.case().tolerates.contains(&Tolerated::Emergency);
        let emergency = Some(emcy::COB_ID + u16::from(self.dut.node));
        let waited_for = |seen: &Seen| {
            let tolerated = tolerated && seen.stamped.frame.data_id() == emergency;
            Seen { expected: seen.expected || tolerated, ..*seen }
        };
        let frames = &self.link.trace()[from..];
        let now = self.link.mark();
        let (node, known) = (self.dut.node, self.known.to_vec());
        let mut monitors =
            monitor::all(node, known, self.baseline.standing(), self.policy.slow_wire);
        monitors.iter_mut().find_map(|monitor| {
            let seen = frames.iter().find_map(|seen| monitor.observe(&waited_for(seen)).err());
            // Without power, silence is expected.
            let silence = || (!self.bench_snapshot.off).then(|| monitor.finish(now).err())?;
            seen.or_else(silence)
        })
    }

    fn restore(
        &mut self,
        snapshot: &Snapshot,
        still: bool,
        passed: bool,
        changed: &mut BTreeSet<Mux>,
    ) -> Result<Restored, BusError> {
        let without_supply = self.bench_snapshot.off;
        match self.bench_snapshot.undo_silence(self.link) {
            // Whether it is back, the next case finds out when it settles the device.
            Ok(()) if without_supply => {
                _ = settle::booted(self.link, self.policy, self.dut, self.baseline)?;
            }
            Ok(()) => {}
            Err(error) if without_supply => {
                let what = format!("the bench does not switch the supply on again: {error}");
                return Err(BusError::Io(what));
            }
            Err(error) => self.not_set_back(&error),
        }
        // One that failed is reset before the next case.
        if snapshot.is_empty() && (still || !passed) {
            self.undo_stimuli()?;
            self.rest_after_emergencies()?;
            return Ok(Restored { whole: true, still });
        }
        // Once the device is in PRE-OPERATIONAL and nothing is in flight, only what came since
        // matters to the next case.
        let mut from = 0;
        if !still {
            from = self.link.trace().len();
            settle::pre_operational(self.link, self.policy, self.dut)?;
        }
        let whole = snapshot.restore(self.link, self.policy, self.dut.node, changed)?;
        // What the stimuli cause then, such as the end of an error or of a slow filter, takes as
        // long as with the parameters from before the case.
        self.undo_stimuli()?;
        self.rest_after_emergencies()?;
        Ok(Restored { whole, still: settle::is_still(self.link, self.dut, from) })
    }

    /// Sets the stimuli back, and waits until the device has come to rest.
    fn undo_stimuli(&mut self) -> Result<(), BusError> {
        match self.bench_snapshot.undo(self.link) {
            Ok(false) => {}
            Ok(true) => {
                let end = self.link.mark() + self.policy.rest_after_stimuli * self.patience();
                self.link.wait(end)?;
            }
            Err(error) => self.not_set_back(&error),
        }
        Ok(())
    }

    fn not_set_back(&mut self, error: &BenchError) {
        self.note(format!("the bench does not set back what the case set: {error}"));
    }

    /// The end of an error is of this case, and not one without a cause in the next. Messages that
    /// an inhibit time holds back follow each other, so the device rests when none came for long.
    fn rest_after_emergencies(&mut self) -> Result<(), BusError> {
        /// More than a device with errors that come and go for ever needs.
        const MOST: usize = 8;
        let inhibited = self.dut.default_int(INHIBIT_TIME_EMCY).unwrap_or(0);
        let inhibited = Duration::from_micros(u64::try_from(inhibited).unwrap_or(0) * 100);
        let mut looked_at = 0;
        for _ in 0..MOST {
            let Some(last) = self.last_emergency(looked_at) else { break };
            let quiet = match self.ends_all_errors(&last) {
                true => self.policy.quiet,
                false => self.policy.quiet_after_emergency,
            };
            looked_at = self.link.trace().len();
            self.link.drain(quiet + inhibited)?;
        }
        Ok(())
    }

    /// The last emergency message of the device in the trace from place `from`.
    fn last_emergency(&self, from: usize) -> Option<Frame> {
        let emergency = Some(emcy::COB_ID + u16::from(self.dut.node));
        let sent = self.link.trace()[from..].iter().map(|seen| &seen.stamped);
        let mut sent = sent.filter(|seen| !seen.own && seen.frame.data_id() == emergency);
        sent.next_back().map(|seen| seen.frame)
    }

    /// Whether an emergency message says that no error is left but those from the start: nothing
    /// is to follow it.
    fn ends_all_errors(&self, message: &Frame) -> bool {
        match &*message.data {
            [0, 0, register, ..] => self.baseline.new_errors(&Ok(vec![*register])).is_none(),
            _ => false,
        }
    }

    fn note(&mut self, text: String) {
        let at = self.link.mark();
        self.link.emit(Event::Note(Note { at, text }));
    }

    fn bus_failed(&self, failure: BusError) -> (Outcome, Aftermath) {
        let reason = match &failure {
            BusError::Interrupted => "interrupted".to_owned(),
            BusError::Ended(why) => why.clone(),
            other => format!("the bus failed: {other}"),
        };
        let aftermath = match failure {
            // What ended was started again.
            BusError::Ended(_) => Aftermath::Left(Left::Dirty),
            failure => Aftermath::Stop(failure),
        };
        (error(reason), aftermath)
    }
}

/// Runs steps until one does not succeed or is declined; whether none failed.
fn run_phase<'s>(
    steps: &mut Steps<'s, '_>,
    list: &'s [At<Step>],
    phase: Phase,
    result: &mut CaseOutcome,
    witness: Option<&dyn Witness>,
) -> Result<bool, BusError> {
    for (place, step) in list.iter().enumerate() {
        witness.inspect(|witness| witness.step_begins(place, steps.link.mark()));
        if let Some(proof) = &mut steps.proof {
            proof.step = (phase == Phase::Step).then_some(place);
            if proof.leaves_out() {
                continue;
            }
        }
        steps.begins(phase, step);
        let judgement = promised(steps, &step.value);
        witness.inspect(|witness| witness.step_ended(place, steps.link.mark(), &steps.scope));
        if let Some(proof) = &mut steps.proof {
            proof.difference().into_iter().for_each(|first| result.fail(phase, step.place, first));
            if matches!(judgement, Err(Trouble::Device(_) | Trouble::Impossible(_))) {
                proof.spoil();
            }
        }
        let judgement = match judgement {
            Err(Trouble::Device(difference)) if phase == Phase::Setup => {
                Err(prevented(&difference).map_or(Trouble::Device(difference), Trouble::Declined))
            }
            other => other,
        };
        result.at = steps.link.now();
        let failed = judgement.as_ref().err().and_then(Trouble::of_device);
        result.late = result.late.max(steps.late(&step.value, failed));
        match judgement {
            Ok(None) => {}
            Ok(Some(difference)) => result.lenient(phase, step.place, difference),
            Err(Trouble::Unjudged(why)) => {
                // What else is set back in the end does not depend on it.
                result.withheld(why);
                if phase != Phase::Finally {
                    return Ok(false);
                }
            }
            Err(Trouble::Bus(error)) => return Err(error),
            Err(Trouble::Device(difference)) => {
                match phase {
                    Phase::Setup => result.setup_failed(step.place, difference),
                    _ => result.fail(phase, step.place, difference),
                }
                return Ok(false);
            }
            Err(Trouble::Impossible(reason)) => {
                result.error(reason);
                return Ok(false);
            }
            Err(Trouble::Declined(what)) if phase == Phase::Setup => {
                result.outcome =
                    Outcome::Skip(format!("the device refused {what}, which is allowed"));
                return Ok(false);
            }
            Err(Trouble::Declined(what)) => {
                result.declined = Some(what);
                return Ok(true);
            }
        }
    }
    Ok(true)
}

/// Runs a step; a difference from what the data sheet promises names its line.
fn promised(steps: &mut Steps, step: &Step) -> Judgement {
    let judgement = steps.run(step);
    let promised = |difference: Difference| {
        let sheet = difference.sheet.clone().or_else(|| {
            promise::promised(step, &difference, &steps.scope, steps.dut).map(Box::new)
        });
        Difference { sheet, ..difference }
    };
    match judgement {
        Ok(lenient) => Ok(lenient.map(promised)),
        Err(Trouble::Device(difference)) => Err(Trouble::Device(promised(difference))),
        other => other,
    }
}

/// What the application prevents now by local control or its state, as CiA 301 lets it, before
/// anything was judged.
fn prevented(difference: &Difference) -> Option<String> {
    let answer = difference.raw.as_ref()?;
    match Response::decode(&answer.data) {
        Ok(Response::Abort(mux, code @ (Abort::LOCAL_CONTROL | Abort::DEVICE_STATE)))
            if mux.index >= 0x2000 || STORAGE.contains(&mux.index) =>
        {
            Some(format!("access to {mux}: {code}"))
        }
        _ => None,
    }
}

/// The outcome as it takes shape: the first thing that weighs most stays, the rest become notes.
struct CaseOutcome<'r> {
    source: &'r Source,
    /// When the step ended that is being judged.
    at: Instant,
    outcome: Outcome,
    /// The first requirement without which the case says nothing.
    relies_on: Option<&'r str>,
    /// What the device refused, as it may, so that the rest of the steps was left out.
    declined: Option<String>,
    /// How late the tester was, when that may be the reason of the outcome.
    late: Option<Duration>,
}

impl CaseOutcome<'_> {
    fn lenient(&mut self, phase: Phase, place: Place, difference: Difference) {
        let problem = self.problem(phase, place, difference);
        match &mut self.outcome {
            Outcome::Pass => self.outcome = Outcome::Lenient(problem),
            Outcome::Lenient(first) => note(&mut first.notes, summary(&problem)),
            _ => {}
        }
    }

    fn fail(&mut self, phase: Phase, place: Place, difference: Difference) {
        let problem = self.problem(phase, place, difference);
        match &mut self.outcome {
            Outcome::Fail(first) => note(&mut first.notes, summary(&problem)),
            Outcome::Error { .. } => {}
            _ => self.outcome = Outcome::Fail(problem),
        }
    }

    fn setup_failed(&mut self, place: Place, difference: Difference) {
        let problem = self.problem(Phase::Setup, place, difference);
        let reason = format!("the setup failed: {}", summary(&problem));
        self.outcome = match self.relies_on {
            Some(id) => Outcome::Blocked(format!("{id}: {reason}")),
            None => Outcome::Error { reason, problem: Some(problem) },
        };
    }

    /// A frame was not sent, or the bus is too slow, so that the case says nothing.
    fn withheld(&mut self, why: String) {
        if !matches!(self.outcome, Outcome::Fail(_)) {
            self.outcome = Outcome::Skip(why);
        }
    }

    /// The device failed where steps go on after that, although what follows cannot be made then.
    fn error(&mut self, reason: String) {
        if !matches!(self.outcome, Outcome::Fail(_)) {
            self.outcome = Outcome::Error { reason, problem: None };
        }
    }

    fn problem(&self, phase: Phase, place: Place, difference: Difference) -> Box<Problem> {
        let Difference { expected, actual, raw, sheet } = difference;
        let place = excerpt(self.source, place);
        let notes = Vec::new();
        Box::new(Problem {
            at: self.at,
            phase,
            place,
            expected,
            actual,
            raw,
            sheet: sheet.map(|sheet| *sheet),
            notes,
            capped: false,
        })
    }
}

/// What else is wrong, as far as anybody reads.
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

fn error(reason: String) -> Outcome {
    Outcome::Error { reason, problem: None }
}

/// The identifiers the data sheet gives to TPDOs, SYNC and TIME.
pub(super) fn data_sheet_identifiers(dut: &Dut) -> Vec<u16> {
    let cob_id = |mux| dut.default_int(mux).map(|cob_id| CobId(cob_id as u32).can_id());
    let tpdos = dut.eds.objects.iter().map(|object| object.index);
    let tpdos = tpdos.filter(|index| (0x1800..0x1A00).contains(index));
    let addresses = tpdos.map(|index| Mux::new(index, 1)).chain([SYNC, TIME]);
    addresses.filter_map(cob_id).collect()
}

/// The commands that save and load parameters.
const STORAGE: [u16; 2] = [0x1010, 0x1011];
const INHIBIT_TIME_EMCY: Mux = Mux::new(0x1015, 0);
const SYNC: Mux = Mux::new(0x1005, 0);
const TIME: Mux = Mux::new(0x1012, 0);

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
