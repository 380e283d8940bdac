//! A session: one device, its plan, case after case, reported as events.
//!
//! Verdicts and their consequences belong here. The effect of a step belongs to
//! [`steps`](super::steps), and how the device gets to rest to [`rest`](super::rest).

mod attempts;
mod case;
mod monitors;
mod of_itself;
mod outcome;
mod phases;
mod reliance;
mod repeats;
mod starts;
mod turns;
mod unrestored;

use std::fmt;
use std::sync::{Arc, LazyLock};

use canopen::nmt::Service;
use canopen::{Bus, BusError, Instant};
use reports::{CaseEnded, CaseStarted, DeviceStarted, Event, Identity, Note, Outcome, Versions};

use super::link::{Link, Traffic, contradiction, identity, oddities, sdo, versions};
use super::observer::{Observer, Unobserved};
use super::policy::Policy;
use super::rest::{
    Baseline, Left, Outputs, Undo, Wanted, first_answer, first_look, give_back, look_at_channels,
    pre_operational, set_back_the_rest,
};
use crate::plan::{Instance, Plan, deeds, protected};
use crate::source::At;
use crate::stop::Stop;
use crate::suite::model::Tolerated;
use crate::suite::profile::{BlockDirections, Capability};
use crate::suite::{Level, Register};
use crate::waivers::Waivers;

use attempts::Finished;
use case::{Aftermath, Common};
use monitors::data_sheet_identifiers;
use reliance::Reliance;
use starts::Starts;
use turns::{Turn, Turns};

/// How a session ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Ending {
    /// Every case ran.
    Complete,
    /// No device answered.
    Nobody,
    /// The device stopped answering; the reason.
    Gone(String),
    /// The bus failed.
    Bus(BusError),
    /// This many cases failed, so that the rest was not run.
    Enough(usize),
}

/// The facts about a device found before the first case.
struct Known {
    baseline: Baseline,
    versions: Versions,
    /// Oddities of its answers, and of the bus.
    odd: Vec<String>,
    /// Its outputs, where they must not be driven.
    outputs: Outputs,
}

/// Runs a plan.
pub struct Session<'s> {
    /// The plan to run.
    pub plan: &'s Plan,
    /// The requirements that the cases check.
    pub register: &'s Register,
    /// The expected times and how long to wait.
    pub policy: Policy,
    /// The command that runs a case again, without its name.
    pub rerun: String,
    /// The known and accepted deviations.
    pub waivers: &'s Waivers,
    /// Stop after this many failed cases.
    pub max_fail: Option<usize>,
    /// Set when the user wants the run to end.
    pub stop: &'s Stop,
    /// The changes of the cases, until they are set back.
    pub undo: &'s Undo,
    /// Learns what happens, before it is reported.
    pub observer: &'s dyn Observer,
}

/// What is waived where nobody waives anything.
static NOTHING: LazyLock<Waivers> = LazyLock::new(Waivers::default);

impl<'s> Session<'s> {
    /// A plan at this bit rate, each case once, with nothing waived and nobody who watches.
    pub fn new(
        plan: &'s Plan,
        register: &'s Register,
        bit_rate: u32,
        stop: &'s Stop,
        undo: &'s Undo,
    ) -> Self {
        Self {
            plan,
            register,
            policy: Policy::at_bit_rate(bit_rate),
            rerun: String::new(),
            waivers: &NOTHING,
            max_fail: None,
            stop,
            undo,
            observer: &Unobserved,
        }
    }
}

impl Session<'_> {
    /// Runs the plan on `bus` and passes every event to `emit` at the moment when it happens.
    pub fn run(&self, bus: &mut dyn Bus, emit: &mut dyn FnMut(Event)) -> Ending {
        let mut link = Link::reporting(bus, emit, self.observer, self.stop);
        let dut = &self.plan.dut;
        link.listen_to(dut);
        link.watch(Traffic::beside(dut, data_sheet_identifiers(dut)));
        match first_answer(&mut link, &self.policy, dut) {
            Ok(true) => {}
            Ok(false) => {
                let ending = match link.traffic().said(Traffic::FULL) {
                    None => Ending::Nobody,
                    Some(full) => {
                        let why = format!("node {} does not answer; {full}", dut.node);
                        Ending::Bus(BusError::Io(why))
                    }
                };
                return self.not_begun(&mut link, ending);
            }
            Err(error) => return self.not_begun(&mut link, Ending::Bus(error)),
        }
        let (known, blocks) = match self.get_to_know(&mut link) {
            Ok(known) => known,
            Err(error) => return self.not_begun(&mut link, Ending::Bus(error)),
        };
        link.emit(Event::DeviceStarted(Box::new(DeviceStarted {
            identity: known.baseline.identity,
            remark: self.remark(&known),
            versions: known.versions.clone(),
            ..self.device()
        })));
        say_of_other_nodes(&mut link, format_args!("before the first case of {}", dut.name));
        link.take_trace();
        let ending = self.cases(&mut link, &known.baseline, blocks);
        self.set_back(&mut link, &known.baseline.identity, &ending);
        say_of_other_nodes(&mut link, format_args!("after the last case of {}", dut.name));
        self.say_the_rest(&mut link, &known.outputs);
        ending
    }

    /// Finds out about the device before the first case.
    fn get_to_know(&self, link: &mut Link) -> Result<(Known, BlockDirections), BusError> {
        let identity = identity(link, &self.policy, &self.plan.dut)?;
        self.undo.identify(identity);
        self.is_alone(link)?;
        let outputs = Outputs::look(link, &self.policy, &self.plan.dut)?;
        let baseline = self.baseline(link, identity)?;
        let versions = versions(link, &self.policy, &self.plan.dut)?;
        look_at_channels(link, &self.policy, &self.plan.dut)?;
        // The answers of a second device may have come since.
        self.is_alone(link)?;
        let mut odd = oddities(link.trace(), self.plan.dut.node);
        odd.extend(link.traffic().said(Traffic::WORTH_A_WORD));
        Ok((Known { baseline, versions, odd, outputs }, self.knows_blocks(link)?))
    }

    /// Fails where two devices have the node id.
    fn is_alone(&self, link: &Link) -> Result<(), BusError> {
        let why = contradiction(link.trace(), self.plan.dut.node);
        why.map_or(Ok(()), |why| Err(BusError::Io(why)))
    }

    /// The device, as far as it is known without asking it.
    fn device(&self) -> DeviceStarted {
        self.plan.dut.started(self.rerun.clone())
    }

    /// Reports that no case was run, as where the bus cannot be opened.
    pub fn not_run(&self, emit: &mut dyn FnMut(Event), ending: &Ending) {
        emit(Event::DeviceStarted(Box::new(self.device())));
        let instances: Vec<&Instance> = self.plan.instances.iter().collect();
        self.rest_not_run(emit, Instant::ZERO, &instances, ending, true);
    }

    fn not_begun(&self, link: &mut Link, ending: Ending) -> Ending {
        self.not_run(&mut |event| link.emit(event), &ending);
        ending
    }

    /// Reports cases that were not run because the session has ended like this. Cases that the user
    /// stopped are skipped, except for the case at which that happened, `at_first`.
    fn rest_not_run(
        &self,
        emit: &mut dyn FnMut(Event),
        at: Instant,
        rest: &[&Instance],
        ending: &Ending,
        at_first: bool,
    ) {
        let mut starts = Starts::new(self.register);
        let why = match ending {
            Ending::Complete => return,
            Ending::Nobody => format!("node {} does not answer", self.plan.dut.node),
            Ending::Gone(why) => shortly(why).to_owned(),
            Ending::Bus(BusError::Interrupted) => "interrupted".to_owned(),
            Ending::Bus(BusError::Lost(why)) => shortly(why).to_owned(),
            Ending::Bus(error) => format!("the bus failed: {error}"),
            Ending::Enough(_) => "enough cases have failed, as `--max-fail` says".to_owned(),
        };
        let failed = match ending {
            Ending::Enough(_) => 0,
            Ending::Bus(BusError::Interrupted) => usize::from(at_first),
            _ => rest.len(),
        };
        for (place, instance) in rest.iter().enumerate() {
            let started = starts.of(instance, at);
            let outcome = match instance.skip() {
                Some(reason) => Outcome::Skip(reason.clone()),
                None if place >= failed => Outcome::Skip(format!("not run: {why}")),
                None => Outcome::not_run(&why),
            };
            emit(Event::CaseStarted(started.clone()));
            emit(Event::CaseEnded(CaseEnded::of(&started, at, outcome)));
        }
    }

    /// Says at the end what the bus and the outputs of the device did beside the cases.
    fn say_the_rest(&self, link: &mut Link, outputs: &Outputs) {
        let dut = &self.plan.dut;
        let strangers = link.traffic().strangers().filter(|_| dut.shares_its_bus);
        let moved = outputs.moved(link, &self.policy, dut).unwrap_or_default();
        for text in [strangers, outputs.said(), moved].into_iter().flatten() {
            link.emit(Event::Note(Note { at: link.mark(), text }));
        }
    }

    /// Tries once more to set back what cases left changed, where the device can still be asked.
    fn set_back(&self, link: &mut Link, identity: &Identity, ending: &Ending) {
        if let Some(other) = &self.plan.dut.partner {
            link.clean(true);
            // The caller of the session names what is not set back.
            _ = set_back_the_rest(link, &self.policy, other, self.undo.of_partner());
            link.clean(false);
        }
        let left = self.undo.snapshot();
        let lost = match ending {
            Ending::Nobody | Ending::Gone(_) => true,
            Ending::Bus(error) => *error != BusError::Interrupted,
            Ending::Complete | Ending::Enough(_) => false,
        };
        if lost || left.is_as_before() {
            return;
        }
        link.clean(true);
        let mut changed = left.values.keys().copied().collect();
        let dut = &self.plan.dut;
        if matches!(give_back(link, dut, identity, left.address), Ok(true)) {
            self.undo.has_its_address();
        }
        // The caller of the session names what is not set back.
        _ = pre_operational(link, &self.policy, dut)
            .and_then(|()| left.restore(link, &self.policy, dut.node, &mut changed));
        self.undo.end(&left, &changed, self.undo.address());
        link.clean(false);
    }

    /// The state of the device at the start. A baseline that no case needs is not taken.
    fn baseline(&self, link: &mut Link, identity: Identity) -> Result<Baseline, BusError> {
        let needed = |each: &Instance| each.skip().is_none() && each.needs_device();
        let dut = &self.plan.dut;
        let mut runs = self.plan.instances.iter().filter(|each| needed(each)).peekable();
        if runs.peek().is_none() {
            return Ok(Baseline::of(identity));
        }
        let wanted = runs.fold(Wanted::default(), |wanted, each| Wanted {
            self_start: wanted.self_start || each.asks_for(&Capability::SelfStart),
            operational: wanted.operational || each.needs_operational(dut.node),
        });
        first_look(link, &self.policy, dut, identity, wanted, self.undo)
    }

    /// A remark for readers of a report on how the device was tested.
    fn remark(&self, known: &Known) -> Option<String> {
        let sheet = &self.plan.dut.sheet;
        let composed = sheet.composed.then(|| {
            format!(
                "{} was generated from the answers of the device: manufacturer's objects, limits \
                 and the data sheet itself were not tested",
                sheet.source.name
            )
        });
        let without = &self.plan.dut.without;
        let options = (!without.is_empty()).then(|| format!("without {}", without.join(", ")));
        let factor = self.policy.patience;
        let patience = (factor > 1).then(|| format!("with `--patience {factor}`"));
        let remarks = composed.into_iter().chain(options).chain(patience);
        let remarks = remarks.chain(self.plan.dut.of_bus.iter().cloned());
        let remarks = remarks.chain(self.plan.said_left_out());
        let remarks = remarks.chain(known.odd.iter().cloned());
        let remarks: Vec<String> = remarks.chain(known.baseline.remarks()).collect();
        (!remarks.is_empty()).then(|| remarks.join("; "))
    }

    /// The directions of block transfer that the device has, which no data sheet states. Asked
    /// before the first case, so that nothing that happens in one can be the reason to skip
    /// another.
    fn knows_blocks(&self, link: &mut Link) -> Result<BlockDirections, BusError> {
        let needed = self.plan.instances.iter().map(Instance::blocks);
        let asked = needed.fold(BlockDirections::default(), |all, each| BlockDirections {
            upload: all.upload || each.upload,
            download: all.download || each.download,
        });
        sdo::knows_blocks(link, &self.policy, self.plan.dut.node, asked)
    }

    /// Why the device does not bear the case now: it would move an output that is on, or store
    /// more than is left after those that ran.
    fn exceeds(&self, instance: &Instance) -> Option<String> {
        let protection = &self.plan.dut.protection;
        if protection.holds() {
            return protected(instance, &self.plan.dut);
        }
        let limited = protection.has_budgets() && instance.needs_device();
        limited.then(|| protection.exceeded(&deeds(instance, &self.plan.dut)))?
    }

    /// Why the device cannot show in OPERATIONAL what the case is about.
    fn kept_out(&self, baseline: &Baseline, instance: &Instance) -> Option<String> {
        let why = baseline.kept_out.as_ref()?;
        let tolerated = instance.case().tolerates.contains(&Tolerated::LeavingOperational);
        let needs = !tolerated && instance.needs_operational(self.plan.dut.node);
        needs.then(|| why.clone())
    }

    /// Why a case is not run on the device, whatever other cases showed.
    fn excused(
        &self,
        instance: &Instance,
        baseline: &Baseline,
        blocks: BlockDirections,
    ) -> Option<Outcome> {
        let no_blocks = || instance.lacks_blocks(blocks);
        let unfit = || instance.unfit_for(baseline.habits).or_else(|| self.exceeds(instance));
        let skip = instance.skip().cloned().or_else(no_blocks).or_else(unfit);
        let kept_out = || self.kept_out(baseline, instance).map(Outcome::Blocked);
        skip.map(Outcome::Skip).or_else(kept_out)
    }

    fn cases(&self, link: &mut Link, baseline: &Baseline, blocks: BlockDirections) -> Ending {
        let mut starts = Starts::new(self.register);
        let (mut left, mut failed, mut gone) = (Left::Calm, 0, None::<String>);
        let mut reliance = Reliance::of(self.plan, self.register);
        let known = data_sheet_identifiers(&self.plan.dut);
        let repeats = attempts::Repeats::default();
        let common = Common {
            known: &known,
            policy: &self.policy,
            dut: &self.plan.dut,
            baseline,
            undo: self.undo,
            repeats: &repeats,
            observer: self.observer,
        };
        let mut turns = Turns::of(reliance.order(self.plan));
        let runs = |instance: &Instance| self.excused(instance, baseline, blocks).is_none();
        while let Some((instance, turn)) = turns.next(runs) {
            if self.stop.asked() {
                let mut rest = turns.rest();
                rest.splice(..0, (turn == Turn::Planned).then_some(instance));
                return self.rest_of(link, &rest, Ending::Bus(BusError::Interrupted), true);
            }
            let excused = self.excused(instance, baseline, blocks);
            // What the device does not bear once more stays undecided.
            if excused.is_some() && turn != Turn::Planned {
                continue;
            }
            let started = starts.of(instance, link.mark());
            link.emit(Event::CaseStarted(started.clone()));
            if excused.is_none() && gone.is_none() {
                match self.look_again(link, common, &mut reliance, instance, left) {
                    Aftermath::Left(how) => left = how,
                    Aftermath::Gone(reason) => gone = Some(reason),
                    Aftermath::Stop(error) => {
                        link.emit(ended(link, &started, Outcome::not_run(&error.to_string())));
                        return self.rest_of(link, &turns.rest(), Ending::Bus(error), false);
                    }
                }
            }
            let blocked = || reliance.blocks(instance).map(Outcome::Blocked);
            let lost = || gone.as_deref().filter(|_| instance.needs_device());
            let lost = || lost().map(|why| Outcome::not_run(shortly(why)));
            if let Some(outcome) = excused.or_else(blocked).or_else(lost) {
                reliance.learn(instance, &outcome);
                self.ends(link, instance, &started, outcome, &[]);
                continue;
            }
            let mut finished = self.repeated(link, common, instance, left);
            if reliance::is_failure(&finished.outcome) {
                self.hear(link, common, &mut reliance, instance, &mut finished.aftermath, blocks);
            }
            let aftermath = finished.aftermath.clone();
            say_if_again(&mut finished.outcome, turn);
            let outcome = self.report(link, &mut reliance, instance, &started, finished);
            failed += usize::from(matches!(outcome, Outcome::Fail(_)));
            if matches!(outcome, Outcome::Undecided(_)) {
                turns.undecided(instance, turn, reliance.proves(instance));
            }
            match aftermath {
                Aftermath::Left(how) => left = how,
                // Cases about the data sheet still run: they need no device.
                Aftermath::Gone(reason) => gone = Some(reason),
                Aftermath::Stop(error) => {
                    return self.rest_of(link, &turns.rest(), Ending::Bus(error), false);
                }
            }
            if self.max_fail.is_some_and(|most| failed >= most) {
                let rest = turns.rest();
                return self.rest_of(link, &rest, Ending::Enough(rest.len()), false);
            }
        }
        gone.map_or(Ending::Complete, Ending::Gone)
    }

    /// Runs the witnesses of a case that failed, as far as the device bears them and is there.
    fn hear(
        &self,
        link: &mut Link,
        common: Common,
        reliance: &mut Reliance<'_>,
        failed: &Instance,
        aftermath: &mut Aftermath,
        blocks: BlockDirections,
    ) {
        let unobserved = Common { observer: &Unobserved, ..common };
        for witness in reliance.witnesses_of(failed) {
            let Aftermath::Left(left) = *aftermath else { return };
            // What a case left changed may be why a witness fails.
            if !self.undo.left().is_empty()
                || self.excused(witness, common.baseline, blocks).is_some()
            {
                continue;
            }
            let blocked = reliance.blocks(witness).map(Outcome::Blocked);
            let outcome = blocked.unwrap_or_else(|| {
                let text = format!("it failed, and relies on what {} shows", witness.name());
                link.emit(Event::Note(Note { at: link.mark(), text }));
                let ran = attempts::run(link, unobserved, witness, left);
                *aftermath = ran.aftermath;
                self.at_its_level(witness, reliance.judged(witness, ran.outcome))
            });
            // Where the device breaks what it must keep, the failure stays the only sign of it: the
            // witness is in no report, and BLOCKED alone leaves a run green.
            if !matches!(outcome, Outcome::Fail(_) | Outcome::Flaky { .. }) {
                reliance.learn(witness, &outcome);
            }
        }
    }

    /// Runs once more what showed that a requirement does not hold, before the first case that this
    /// blocks: the reason may be gone.
    fn look_again<'p>(
        &self,
        link: &mut Link,
        common: Common,
        reliance: &mut Reliance<'p>,
        blocked: &'p Instance,
        left: Left,
    ) -> Aftermath {
        let Some(shown_by) = reliance.doubted(blocked) else { return Aftermath::Left(left) };
        let unobserved = Common { observer: &Unobserved, ..common };
        let again = attempts::run(link, unobserved, shown_by, left);
        reliance.look_again(shown_by, &self.at_its_level(shown_by, again.outcome));
        again.aftermath
    }

    /// The result of a case that ran, as it is reported.
    fn report<'p>(
        &self,
        link: &mut Link,
        reliance: &mut Reliance<'p>,
        instance: &'p Instance,
        started: &CaseStarted,
        finished: Finished,
    ) -> Outcome {
        self.observer.shows(finished.shown.unwrap_or_default());
        let outcome = reliance.judged(instance, finished.outcome);
        let outcome = self.at_its_level(instance, outcome);
        reliance.learn(instance, &outcome);
        reliance.unrestored.after(instance, &self.undo.left());
        if matches!(finished.aftermath, Aftermath::Gone(_)) {
            self.say_ways_back(link);
        }
        let outcome = self.waivers.apply(&self.plan.dut.name, started, outcome);
        self.ends(link, instance, started, outcome.clone(), &finished.commanded);
        let (name, case) = (&self.plan.dut.name, started.name());
        say_of_other_nodes(link, format_args!("while {case} ran on {name}"));
        outcome
    }

    /// Reports how a case ended. `by` are the NMT commands whose effects should be there.
    fn ends(
        &self,
        link: &mut Link,
        instance: &Instance,
        case: &CaseStarted,
        outcome: Outcome,
        by: &[Service],
    ) {
        let relies_on = self.rests_on(instance, &outcome, by);
        let end = CaseEnded::of(case, link.mark(), outcome);
        link.emit(Event::CaseEnded(CaseEnded { relies_on, ..end }));
    }

    /// The requirements on which a result rests: those that the case relies on, those that it tries
    /// in another situation, and the effects of the NMT commands before what went wrong.
    fn rests_on(&self, instance: &Instance, outcome: &Outcome, by: &[Service]) -> Vec<Arc<str>> {
        let named = instance.relies_on().map(Arc::from);
        match outcome {
            Outcome::Blocked(_) => return named.collect(),
            _ if outcome.problem().is_none() => return Vec::new(),
            _ => {}
        }
        let checks = &instance.case().checks;
        let checked = checks.iter().filter_map(|id| self.register.find(&id.value));
        let extended = checked.flat_map(|found| found.entry.value.extends.keys());
        let extended = extended.filter(|id| checks.iter().all(|check| check.value != **id));
        let effects = self.register.effects().filter(|(nmt, _)| by.contains(&nmt.service()));
        let effects = effects.map(|(_, id)| Arc::clone(id));
        named.chain(extended.map(|id| id.as_str().into())).chain(effects).collect()
    }

    fn say_ways_back(&self, link: &mut Link) {
        if let Some(text) = self.plan.dut.ways_back() {
            link.emit(Event::Note(Note { at: link.mark(), text }));
        }
    }

    fn rest_of(
        &self,
        link: &mut Link,
        rest: &[&Instance],
        ending: Ending,
        at_first: bool,
    ) -> Ending {
        let at = link.mark();
        self.rest_not_run(&mut |event| link.emit(event), at, rest, &ending, at_first);
        ending
    }

    /// A case fails when it checks a requirement that a conformant device must keep, unless a
    /// document of the device itself relaxes that. Where it relaxes all that the case checks, what
    /// a step accepts as LENIENT is what that document wants, and PASS.
    fn at_its_level(&self, instance: &Instance, outcome: Outcome) -> Outcome {
        let mut checks = instance.case().checks.iter();
        if checks.all(|id| instance.relaxed.contains_key(&id.value)) && outcome.is_accepted() {
            return Outcome::Pass;
        }
        let must = |id: &&At<String>| {
            let requirement = self.register.find(&id.value);
            requirement.is_none_or(|found| found.entry.value.level == Level::Must)
        };
        let mut musts = instance.case().checks.iter().filter(must).map(|id| &id.value).peekable();
        if musts.peek().is_none() {
            return outcome.capped(Vec::new());
        }
        let reasons = musts.map(|id| {
            let by = instance.relaxed.get(id)?;
            let decision = self.register.decision(by).map(|found| found.decision.trim_end());
            Some(format!("{by} relaxes {id}: {}", decision.unwrap_or_default()))
        });
        match reasons.collect::<Option<Vec<String>>>() {
            Some(reasons) => outcome.capped(reasons),
            None => outcome,
        }
    }
}

/// The first half of the sentence: the case in which the device was lost has all of it.
fn shortly(why: &str) -> &str {
    why.split("; ").next().unwrap_or(why)
}

/// Says of what is undecided that it has another turn: a reader takes an ERROR for the last word.
fn say_if_again(outcome: &mut Outcome, turn: Turn) {
    if let (Outcome::Undecided(reason), false) = (outcome, turn == Turn::Last) {
        reason.push_str("; it is to be tried again later in this run");
    }
}

/// Says what happened to the other nodes of the bus since this was last said. It is nobody's
/// verdict.
fn say_of_other_nodes(link: &mut Link, when: fmt::Arguments<'_>) {
    for said in link.of_other_nodes() {
        link.emit(Event::Note(Note { at: link.mark(), text: format!("{said}, {when}") }));
    }
}

fn ended(link: &Link, case: &CaseStarted, outcome: Outcome) -> Event {
    Event::CaseEnded(CaseEnded::of(case, link.mark(), outcome))
}
