//! The steps, one function each; those about objects are in `objects.rs`.

use std::time::Duration;

use canopen::catalogue::Catalogue;
use canopen::heartbeat::{self, ErrorControl};
use canopen::pdo::CobId;
use canopen::{Abort, BusError, Frame, Instant, Mux, Pattern, Stamped, lss, nmt, sdo, sync};
use reports::{Begun, Event, Phase};

use super::apart;
use super::judge::{Difference, Judgement, Trouble};
use super::proof::Proof;
use super::window::window;
use crate::dut::Dut;
use crate::plan::{Binding, Scope, Wording, nmt_frame};
use crate::run::link::{Lateness, Link, STALL};
use crate::run::policy::Policy;
use crate::run::rest::{BenchSnapshot, Partner, Undo, first_answer};
use crate::source::At;
use crate::suite::Words;
use crate::suite::constraint::{Allowance, Constraint};
use crate::suite::literal::{Amount, FrameText, Literal, ObjectRef, show_time};
use crate::suite::step::{Expect, Never, Nmt, Produce, Reply, Step, SyncStep};

/// Runs the steps of one case.
pub(in crate::run) struct Steps<'s, 'b> {
    /// The bus.
    pub link: &'s mut Link<'b>,
    /// The device.
    pub dut: &'s Dut,
    /// The expected times and how long to wait.
    pub policy: &'s Policy,
    /// The profiles.
    pub catalogue: &'s Catalogue,
    /// The names, those that steps save included.
    pub scope: Scope,
    /// How many times as long as it says a step waits for the application of the device.
    pub patience: u32,
    /// The stimuli on the device's physical side.
    pub bench_snapshot: &'s mut BenchSnapshot,
    /// What the case changed in the other node.
    pub partner: &'s mut Partner,
    /// The changes of the run.
    pub undo: &'s Undo,
    /// The results for the assertions, if an observer asks for them.
    pub proof: Option<Proof>,
    /// The suite's words for objects and values.
    pub words: &'s Words,
    /// By what time the device missed what is accepted, in what the step judged last; zero where
    /// that is not known, or no time. What a mean misses counts as often as it has values.
    pub margin: Duration,
    /// How long a measurement waited for a frame that did not come.
    pub awaited: Duration,
    /// Where in the trace the steps begin.
    pub from: usize,
    /// The step after the one that runs.
    pub next: Option<&'s Step>,
    /// Whether the device is known to send a boot-up message.
    pub boots_up: bool,
    /// The steps that began and are not reported.
    pub begun: Vec<(Instant, Phase, &'s At<Step>)>,
}

/// How long an answer may take unless the step says otherwise.
pub(super) const DEFAULT_REPLY: Duration = Duration::from_secs(1);
pub(super) const DEFAULT_SYNC_PERIOD: Duration = Duration::from_millis(10);
/// How many times as late as the tester a device on the same host is at most.
const SHARED: u32 = 5;

impl<'s> Steps<'s, '_> {
    /// A step begins.
    pub(in crate::run) fn begins(&mut self, phase: Phase, step: &'s At<Step>) {
        let at = self.link.mark();
        match self.policy.every_step {
            true => self.tell(at, phase, step),
            false => self.begun.push((at, phase, step)),
        }
    }

    /// Reports the steps that are not yet. Names have the values that they have now.
    pub(in crate::run) fn tell_begun(&mut self) {
        for (at, phase, step) in std::mem::take(&mut self.begun) {
            self.tell(at, phase, step);
        }
    }

    fn tell(&mut self, at: Instant, phase: Phase, step: &At<Step>) {
        let (words, scope, node) = (self.words, Some(&self.scope), Some(self.dut.node));
        let wording = Wording { words, scope, node };
        let (line, text) = (step.place.line as u32, wording.step(&step.value));
        self.link.emit(Event::Step(Begun { at, phase, line, text }));
    }
}

impl Steps<'_, '_> {
    /// Runs one step.
    ///
    /// # Errors
    /// What went wrong.
    pub(in crate::run) fn run(&mut self, step: &Step) -> Judgement {
        (self.margin, self.awaited) = (Duration::ZERO, Duration::ZERO);
        if step.transfers_objects() {
            self.let_the_server_open()?;
        }
        match step {
            Step::Send(frame) => {
                let frame = self.frame(frame)?;
                self.send_now(&frame)?;
                Ok(None)
            }
            Step::Reply(reply) => self.reply(reply),
            Step::Ask(ask) => self.ask(ask),
            Step::Expect(expect) => self.expect(expect),
            Step::Never(never) => self.never(never),
            Step::Read(read) => self.read(read),
            Step::Write(write) => self.write(write),
            Step::Remap(remap) => self.remap(remap),
            Step::Defaults(objects) => self.defaults(objects),
            Step::Nmt(nmt) => self.nmt(*nmt),
            Step::Wait(time) => {
                let time = self.time(time)?;
                let until = self.link.mark() + time;
                match self.is_pause() {
                    true => {
                        self.link.wait(until)?;
                        self.link.moved();
                    }
                    false => self.link.wait_for(until, self.policy.bears(time))?,
                }
                Ok(None)
            }
            Step::Until(until) => self.until(until),
            Step::Measure(measure) => self.measure(measure),
            Step::Collect(collect) => self.collect(collect),
            Step::Sync(sync) => self.sync(sync),
            Step::Produce(produce) => {
                self.begin(Some(produce))?;
                self.produce(produce).map(|()| None)
            }
            Step::Bench(stimuli) => self.stimulate_bench(stimuli),
            Step::Observe(observe) => self.observe(observe),
            Step::Partner(partner) => self.partner(partner),
            Step::Lss(lss) => self.lss(lss),
            Step::Eds(step) => self.eds(step),
            Step::Undeclared(step) => self.undeclared(step),
        }
    }

    /// A server may begin to listen some time after the boot-up message (CIA301-I-112).
    fn let_the_server_open(&mut self) -> Result<(), BusError> {
        let boot_up = ErrorControl::BOOT_UP.frame(self.dut.node);
        let (mark, time) = (self.link.mark(), self.policy.change_of_state);
        let mut recent = self
            .link
            .trace()
            .iter()
            .rev()
            .map(|seen| seen.stamped)
            .take_while(|it| it.at + time > mark);
        let booted = recent.find(|seen| !seen.own && seen.frame == boot_up);
        booted.map_or(Ok(()), |boot_up| self.link.wait(boot_up.at + time))
    }

    /// What explains that a request had no answer: a node does not listen before its boot-up
    /// message.
    pub(in crate::run) fn asked_too_early(
        &self,
        step: &Step,
        failed: &Difference,
    ) -> Option<String> {
        const ABORT: u8 = 0x80;
        if !step.transfers_objects() || failed.actual != sdo::Failure::Timeout.to_string() {
            return None;
        }
        let boot_up = ErrorControl::BOOT_UP.frame(self.dut.node);
        let requests = Some(sdo::REQUEST_COB_ID + u16::from(self.dut.node));
        let is_request = |Stamped { own, frame, .. }: &Stamped| {
            *own && frame.data_id() == requests && frame.data.first() != Some(&ABORT)
        };
        let trace = self.link.trace();
        let asked = trace.iter().rposition(|seen| is_request(&seen.stamped))?;
        let mut since = trace[asked..].iter().map(|seen| &seen.stamped);
        let booted = since.any(|seen| !seen.own && seen.frame == boot_up);
        booted.then(|| "the request was sent before the boot-up message".to_owned())
    }

    fn reply(&mut self, reply: &Reply) -> Judgement {
        let strict = self.pattern(&reply.frame)?;
        let within = self.optional_time(&reply.within, DEFAULT_REPLY)? + self.policy.slow_wire;
        let start = self.link.mark();
        let until = start + within;
        let id = strict.id();
        let answer = self.link.find_answer(until, |seen| !seen.own && seen.frame.id == id)?;
        let Some(answer) = answer else {
            let actual = format!("no frame {id} within {}", show_time(within));
            if reply.or_silence {
                self.allows(Allowance::OrSilence);
                return Err(Trouble::Declined(format!("expected {strict}, came {actual}")));
            }
            self.margin = within;
            return self.broken(&[], Difference::new(strict.to_string(), actual));
        };
        self.may_decline(&strict, &reply.or_else, &answer)?;
        let accepted = self.accept(&reply.frame, &reply.lenient, &answer);
        match accepted {
            Err(Trouble::Device(mut difference)) => {
                if let Some(elsewhere) = self.elsewhere(&strict, start) {
                    let frame = elsewhere.frame;
                    difference.actual += &format!("; the expected data came as {frame}");
                }
                Err(Trouble::Device(difference))
            }
            other => other,
        }
    }

    /// Ends the steps when the answer is one that a device may give instead.
    pub(super) fn may_decline(
        &mut self,
        strict: &Pattern,
        or_else: &[At<FrameText>],
        got: &Stamped,
    ) -> Result<(), Trouble> {
        for (text, place) in or_else.iter().zip(1..) {
            if self.pattern(text)?.matches(&got.frame) {
                self.allows(Allowance::OrElse(place));
                let meaning = canopen::meaning(&got.frame);
                return Err(Trouble::Declined(format!("expected {strict}, came {meaning}")));
            }
        }
        Ok(())
    }

    /// Judges a frame against the strict pattern and the lenient ones.
    pub(super) fn accept(
        &mut self,
        frame: &At<FrameText>,
        lenient: &[At<FrameText>],
        got: &Stamped,
    ) -> Judgement {
        let strict = self.pattern(frame)?;
        if strict.matches(&got.frame) {
            for (name, byte) in strict.captures(&got.frame) {
                self.scope.bind(name, Binding::Literal(Literal::Int(byte.into())));
            }
            return Ok(None);
        }
        let actual = canopen::meaning(&got.frame).to_string();
        let apart = apart::frames(&strict, &got.frame);
        let difference =
            Difference { apart, ..Difference::new(strict.to_string(), actual) }.about(got.frame);
        for (text, place) in lenient.iter().zip(1..) {
            if self.pattern(text)?.matches(&got.frame) {
                self.allows(Allowance::Lenient(place));
                return Ok(Some(difference));
            }
        }
        let odd = self.misfits(frame, got)?;
        self.broken(&odd, difference)
    }

    fn expect(&mut self, expect: &Expect) -> Judgement {
        let strict = self.pattern(&expect.frame)?;
        let mut patterns = vec![strict.clone()];
        for text in &expect.lenient {
            patterns.push(self.pattern(text)?);
        }
        let within = self.time(&expect.within)? + self.policy.slow_wire;
        let start = self.begin(expect.during.as_ref())?;
        let fits = |seen: &Stamped| {
            !seen.own && patterns.iter().any(|pattern| pattern.matches(&seen.frame))
        };
        // A device may act on a command before it confirms it.
        let at_once = expect.during.is_none() && expect.after.is_none();
        let beside = if at_once { self.link.find_beside(fits) } else { None };
        self.stimulate(expect.during.as_ref())?;
        let sent = self.link.mark().max(start);
        self.link_rewind(expect.during.is_some(), start);
        let boot_up = ErrorControl::BOOT_UP.frame(self.dut.node);
        let awaited = !expect.optional || self.boots_up || strict.frame() != Some(boot_up);
        let got = match beside {
            Some(got) => Some(got),
            None if awaited => self.link.find(sent + within, fits)?,
            // It has started when it answers.
            None => {
                let policy = Policy { boot_timeout: within, ..*self.policy };
                first_answer(self.link, &policy, self.dut)?;
                self.link.look_from(sent);
                let now = self.link.now();
                self.link.find(now, fits)?
            }
        };
        let Some(got) = got else {
            let within = if awaited { within } else { self.link.now().since(sent) };
            let missing = self.missing(&strict, start, within);
            self.margin = within;
            self.link.skip_to(sent + within);
            if expect.optional {
                self.allows(Allowance::Optional);
                return Ok(Some(missing));
            }
            let Some(odd) =
                self.nearly(&expect.frame, (start, sent + within), |count| count > 0)?
            else {
                return self.broken(&[], missing);
            };
            let open = self.pattern_without(&expect.frame, &odd)?;
            self.link.look_from(start);
            self.link.find(sent + within, |seen| !seen.own && open.matches(&seen.frame))?;
            return self.broken(&odd, missing);
        };
        if let Some(length) = &expect.length {
            let length = self.scope.int(&length.value).map_err(Trouble::Impossible)?;
            if length != got.frame.data.len() as i128 {
                let actual = format!("{} bytes", got.frame.data.len());
                let expected = format!("{strict} with {length} bytes");
                let difference = Difference::new(expected, actual).about(got.frame);
                self.broken(&[Constraint::Length], difference)?;
            }
        }
        if let Some(after) = &expect.after {
            let after = self.time(after)?;
            let came = got.at.since(start);
            if came < after {
                let expected = format!("{strict} not before {}", show_time(after));
                let actual = format!("after {}", show_time(came));
                let difference = Difference::new(expected, actual).about(got.frame);
                self.broken(&[Constraint::After], difference)?;
            }
        }
        self.accept(&expect.frame, &expect.lenient, &got)
    }

    /// The difference, with the frame that came on the identifier instead, if there was one.
    fn missing(&self, strict: &Pattern, start: Instant, within: Duration) -> Difference {
        let id = strict.id();
        let others = self
            .link
            .trace()
            .iter()
            .map(|seen| seen.stamped)
            .filter(|seen| !seen.own && seen.at > start && seen.frame.id == id);
        let (count, last) =
            others.fold((0, None), |(count, _), seen| (count + 1, Some(seen.frame)));
        let mut nothing = format!("no matching frame within {}", show_time(within));
        if let Some(elsewhere) = self.elsewhere(strict, start) {
            let frame = elsewhere.frame;
            nothing = format!("{nothing}; the expected data came as {frame}");
        }
        let Some(last) = last else { return Difference::new(strict.to_string(), nothing) };
        let meaning = canopen::meaning(&last);
        let actual = match count {
            1 => format!("{nothing}; 1 other frame with identifier {id}: {meaning}"),
            _ => format!("{nothing}; other frames with identifier {id}, the last: {meaning}"),
        };
        let apart = apart::frames(strict, &last);
        Difference { apart, ..Difference::new(strict.to_string(), actual) }.about(last)
    }

    /// The first frame with the data that were expected and another identifier. A byte or two may
    /// be the same by chance.
    fn elsewhere(&self, strict: &Pattern, start: Instant) -> Option<Stamped> {
        const MEANT: usize = 3;
        let expected = strict.frame().filter(|frame| frame.data.len() >= MEANT)?;
        let mut since = self.link.trace().iter().map(|seen| seen.stamped);
        since.find(|seen| {
            let Stamped { at, own, frame } = seen;
            !own && *at > start && frame.data == expected.data && frame.id != expected.id
        })
    }

    fn never(&mut self, never: &Never) -> Judgement {
        let pattern = self.pattern(&never.frame)?;
        let time = self.time(&never.time)?;
        let start = self.begin(never.during.as_ref())?;
        self.stimulate(never.during.as_ref())?;
        let until = self.link.mark() + time;
        self.link_rewind(never.during.is_some(), start);
        let mut lenient = None;
        // A frame that was under way on a slow wire still arrives.
        let from = start + self.policy.slow_wire;
        let fits = |seen: &Stamped| {
            !seen.own && (from == start || seen.at > from) && pattern.matches(&seen.frame)
        };
        while let Some(got) = self.link.find(until, fits)? {
            let expected = format!("no {pattern} for {}", show_time(time));
            let meaning = canopen::meaning(&got.frame);
            for (text, place) in never.or_else.iter().zip(1..) {
                if self.pattern(text)?.matches(&got.frame) {
                    self.allows(Allowance::OrElse(place));
                    return Err(Trouble::Declined(format!("expected {expected}, came {meaning}")));
                }
            }
            self.margin = got.at.since(start);
            let actual = format!("{meaning} after {}", show_time(self.margin));
            let difference = Difference::new(expected, actual).about(got.frame);
            let mut accepted = false;
            for (text, place) in never.lenient.iter().zip(1..) {
                if self.pattern(text)?.matches(&got.frame) {
                    self.allows(Allowance::Lenient(place));
                    accepted = true;
                }
            }
            match accepted {
                true => _ = lenient.get_or_insert(difference),
                false => _ = self.broken(&[], difference)?,
            }
        }
        self.link.skip_to(until);
        Ok(lenient)
    }

    fn nmt(&mut self, nmt: Nmt) -> Judgement {
        self.send_now(&nmt_frame(nmt, self.dut.node))?;
        Ok(None)
    }

    fn sync(&mut self, step: &SyncStep) -> Judgement {
        const COB_ID_SYNC: Mux = Mux::new(0x1005, 0);
        let every = self.optional_time(&step.every, DEFAULT_SYNC_PERIOD)?;
        let cob_id = self.dut.default_int(COB_ID_SYNC).map(|cob_id| CobId(cob_id as u32).can_id());
        let frame = Frame::new(cob_id.unwrap_or_else(|| sync::COB_ID.into()), []);
        self.ends_sending(every)?;
        self.repeat(&frame, step.count, every)?;
        Ok(None)
    }

    /// When a step starts during which frames may be sent.
    pub(super) fn begin(&mut self, during: Option<&Produce>) -> Result<Instant, Trouble> {
        if let Some(during) = during {
            let every = self.time(&during.every)?;
            self.ends_sending(every)?;
        }
        Ok(self.link.mark())
    }

    /// A step may end before all frames were sent that are sent during it. Those of the next step
    /// come after them, in their own distance.
    fn ends_sending(&mut self, every: Duration) -> Result<(), BusError> {
        self.link.still_sent().map_or(Ok(()), |last| self.link.wait(last + every))
    }

    fn produce(&mut self, produce: &Produce) -> Result<(), Trouble> {
        let frame = self.frame(&produce.frame)?;
        let every = self.time(&produce.every)?;
        self.repeat(&frame, produce.count, every)
    }

    fn repeat(&mut self, frame: &Frame, count: usize, every: Duration) -> Result<(), Trouble> {
        /// This many frames take a quarter of an hour even if the wire is never idle.
        const MOST: usize = 1_000_000;
        if count > MOST {
            let text = format!("a step may send {MOST} frames, and this one sends {count}");
            return Err(Trouble::Impossible(text));
        }
        let mut next = self.link.mark();
        for place in 0..count {
            if place > 0 {
                self.link.wait(next)?;
            }
            // The wire may be too slow for the demanded distance between frames.
            let meant = next.max(self.link.mark());
            self.send_meant(frame, meant, every)?;
            next += every;
        }
        Ok(())
    }

    /// Sends a frame that is meant to leave when the last step ended. A request of a confirmed
    /// service bears to be late.
    fn send_now(&mut self, frame: &Frame) -> Result<(), BusError> {
        self.send_meant(frame, self.link.mark(), Duration::ZERO)
    }

    /// Sends a frame that is meant to leave at that moment, as one of several with that distance.
    fn send_meant(
        &mut self,
        frame: &Frame,
        meant: Instant,
        every: Duration,
    ) -> Result<(), BusError> {
        match is_request(frame) {
            true => self.link.send(frame)?,
            false => self.link.send_at(frame, meant, self.policy.bears(every))?,
        }
        if self.is_reset(frame) {
            self.link.starts_anew();
        }
        Ok(())
    }

    /// Whether a wait gives a slave of LSS time before or after a request, and may be longer.
    fn is_pause(&self) -> bool {
        let next = match self.next {
            Some(Step::Send(frame)) => self.frame(frame).ok(),
            Some(Step::Ask(ask)) => self.frame(ask.first.as_ref().unwrap_or(&ask.send)).ok(),
            _ => None,
        };
        let mut sent = self.link.trace().iter().map(|seen| &seen.stamped).filter(|seen| seen.own);
        let last = sent.next_back().map(|seen| &seen.frame);
        let is_request = |frame: &Frame| frame.data_id() == Some(lss::REQUEST_COB_ID);
        last.into_iter().chain(&next).any(is_request) && !self.is_silent_for_a_time()
    }

    /// Whether the case has the device be silent for a time that it keeps: for the switch delay of
    /// its bit rate, or while it starts, until something comes.
    fn is_silent_for_a_time(&self) -> bool {
        let seen = self.link.trace()[self.from..].iter().map(|seen| &seen.stamped);
        let node = u16::from(self.dut.node);
        let of_device =
            [sdo::RESPONSE_COB_ID + node, heartbeat::COB_ID + node, lss::RESPONSE_COB_ID];
        let (mut switches, mut starts) = (false, false);
        for Stamped { own, frame, .. } in seen {
            let activates = || {
                let request = lss::Request::decode(&frame.data);
                matches!(request, Ok(lss::Request::ActivateBitTiming(_)))
            };
            switches |= *own && frame.data_id() == Some(lss::REQUEST_COB_ID) && activates();
            starts |= *own && self.is_reset(frame);
            starts &= *own || !frame.data_id().is_some_and(|id| of_device.contains(&id));
        }
        switches || starts
    }

    /// Whether the frame has the device start anew.
    fn is_reset(&self, frame: &Frame) -> bool {
        let command = frame.data_id().filter(|id| *id == nmt::COB_ID);
        let command = command.and_then(|_| nmt::Command::decode(&frame.data).ok());
        command.is_some_and(|it| is_reset(it.service) && [0, self.dut.node].contains(&it.node))
    }

    /// How late the tester was, where that may be the reason why the step ended as it did.
    pub(in crate::run) fn late(
        &self,
        step: &Step,
        failed: Option<&Difference>,
    ) -> Option<Duration> {
        let Lateness { missed, overslept, noticed, .. } = self.link.lateness();
        // What is less than the tester's own lateness may be the host's. A frame that must not come
        // is there, however soon it came.
        let is_time = matches!(step, Step::Measure(_) | Step::Ask(_));
        let doubtful = is_time && Duration::ZERO < self.margin && self.margin <= noticed;
        let late = match failed {
            // A device that must not answer does or does not, however late the request came.
            Some(failed)
                if matches!(step, Step::Never(_))
                    && self.answered(step, failed)
                    && !self.is_silent_for_a_time() =>
            {
                Duration::ZERO
            }
            Some(_) if doubtful => missed.max(overslept).max(noticed),
            Some(_) => missed.max(overslept),
            // A longer pause is no reason for a device to stay silent.
            None => missed,
        };
        if late > Duration::ZERO && (failed.is_some() || matches!(step, Step::Never(_))) {
            return Some(late);
        }
        if failed.is_some() && self.link.noticed() > STALL {
            return Some(self.link.noticed());
        }
        if let Some(kept_waiting) = failed.and_then(|failed| self.kept_waiting(step, failed)) {
            return Some(kept_waiting);
        }
        // What comes may come because the device missed the tester, as one that monitors it does.
        if failed.is_none()
            && let Step::Expect(expect) = step
        {
            let lost = noticed.max(overslept).max(missed);
            let every = expect.during.as_ref().and_then(|during| self.time(&during.every).ok());
            let bears_missing = every.is_none_or(|every| missed <= every);
            return (lost > STALL || !bears_missing).then_some(lost);
        }
        // A device on the same host is late at other moments, and by other times, than the tester.
        let shares = self.dut.shares_its_machine && noticed > self.policy.bears(Duration::ZERO);
        if shares
            && self.margin < noticed * SHARED
            && failed.is_some_and(|failed| judges_time(step, failed))
        {
            return Some(noticed);
        }
        // A device on the same host had as little of the time as the tester.
        if failed.is_none() && matches!(step, Step::Never(_) | Step::Collect(_)) {
            let (window, lost) = (self.window(step)?, noticed.max(overslept));
            return (lost > self.policy.bears(window).max(window / 2)).then_some(lost);
        }
        let failed = failed?;
        let window = match transfers(step) && failed.raw.is_none() {
            // The client may have been too slow for the server. A device on the same host is
            // delayed as much.
            _ if self.gave_up() => Duration::ZERO,
            true => self.policy.sdo_timeout,
            // What a server or a slave answers is the same, however soon it is noticed.
            false if self.answered(step, failed) => return None,
            false => self.window(step)?,
        };
        (noticed > self.policy.bears(window)).then_some(noticed)
    }

    /// How long the tester let the server wait for a request of a transfer, where what came instead
    /// of what is expected may be because the server has given it up.
    pub(in crate::run) fn kept_waiting(&self, step: &Step, came: &Difference) -> Option<Duration> {
        let kept_waiting = self.link.lateness().kept_waiting;
        let is_silent = came.raw.is_none() && waits_for_an_answer(step);
        let given_up = is_silent || is_of_protocol(came.raw.as_ref()) || self.gave_up();
        (given_up && kept_waiting > self.policy.bears(Duration::ZERO)).then_some(kept_waiting)
    }

    /// Whether the step fails with an answer to a request: of the first SDO server, or of LSS. A
    /// transfer that the server has given up is answered with an error of the protocol.
    fn answered(&self, step: &Step, failed: &Difference) -> bool {
        let answers = Some(sdo::RESPONSE_COB_ID + u16::from(self.dut.node));
        let Some(came) = &failed.raw else { return false };
        let ids = [answers, Some(lss::RESPONSE_COB_ID)];
        matches!(step, Step::Reply(_) | Step::Ask(_) | Step::Never(_))
            && ids.contains(&came.data_id())
            && !is_of_protocol(Some(came))
    }

    /// Whether the server has aborted a transfer of this case because of the time. The abort itself
    /// may be no answer, and what fails then is the next request.
    fn gave_up(&self) -> bool {
        let answers = Some(sdo::RESPONSE_COB_ID + u16::from(self.dut.node));
        let mut came = self.link.trace().iter().map(|seen| &seen.stamped);
        came.any(|Stamped { own, frame, .. }| {
            let answer = sdo::Response::decode(&frame.data);
            !own && frame.data_id() == answers
                && matches!(answer, Ok(sdo::Response::Abort(_, Abort::TIMEOUT)))
        })
    }

    /// How long the device has for what the step judges; `None` when the step judges no time.
    fn window(&self, step: &Step) -> Option<Duration> {
        window(step, &self.scope, self.awaited)
    }

    pub(super) fn stimulate(&mut self, during: Option<&Produce>) -> Result<(), Trouble> {
        during.map_or(Ok(()), |produce| self.produce(produce))
    }

    /// Looks again at what came while frames were sent.
    pub(super) fn link_rewind(&mut self, stimulated: bool, start: Instant) {
        if stimulated {
            self.link.look_from(start);
        }
    }

    pub(super) fn frame(&self, text: &At<FrameText>) -> Result<Frame, Trouble> {
        // The tester's own frames are not judged.
        let pattern =
            self.scope.pattern(&text.value, self.dut.node).map_err(Trouble::Impossible)?;
        pattern
            .frame()
            .ok_or_else(|| Trouble::Impossible(format!("{pattern} has holes and cannot be sent")))
    }

    pub(super) fn pattern(&self, text: &At<FrameText>) -> Result<Pattern, Trouble> {
        if let Some(part) = self.open() {
            return self.pattern_without(text, std::slice::from_ref(part));
        }
        self.scope.pattern(&text.value, self.dut.node).map_err(Trouble::Impossible)
    }

    pub(super) fn mux(&self, object: &At<ObjectRef>) -> Result<Mux, Trouble> {
        self.scope.mux(&object.value).map_err(Trouble::Impossible)
    }

    pub(super) fn time(&self, amount: &At<Amount>) -> Result<Duration, Trouble> {
        self.scope.time(&amount.value).map_err(Trouble::Impossible)
    }

    pub(super) fn optional_time(
        &self,
        amount: &Option<At<Amount>>,
        usual: Duration,
    ) -> Result<Duration, Trouble> {
        amount.as_ref().map_or(Ok(usual), |amount| self.time(amount))
    }
}

/// Whether a node starts anew with the command.
pub(in crate::run) const fn is_reset(service: nmt::Service) -> bool {
    matches!(service, nmt::Service::RESET_NODE | nmt::Service::RESET_COMMUNICATION)
}

/// Whether the frame is a request of a confirmed service, of SDO on a default identifier or of LSS.
pub(super) fn is_request(frame: &Frame) -> bool {
    const OF_SERVERS: std::ops::RangeInclusive<u16> =
        sdo::REQUEST_COB_ID + 1..=sdo::REQUEST_COB_ID + 0x7F;
    frame.data_id().is_some_and(|id| OF_SERVERS.contains(&id) || id == lss::REQUEST_COB_ID)
}

/// Whether the frame is an abort because of an error of the protocol, such as a request that
/// belongs to no transfer, or the time.
pub(in crate::run) fn is_of_protocol(frame: Option<&Frame>) -> bool {
    const OF_PROTOCOL: u32 = 0x0504;
    let Some(frame) = frame.filter(|frame| frame.data_id() != Some(lss::RESPONSE_COB_ID)) else {
        return false;
    };
    matches!(
        sdo::Response::decode(&frame.data),
        Ok(sdo::Response::Abort(_, Abort(code))) if code >> 16 == OF_PROTOCOL
    )
}

/// Whether the step makes requests and waits for their answers.
const fn waits_for_an_answer(step: &Step) -> bool {
    matches!(step, Step::Reply(_) | Step::Ask(_)) || transfers(step)
}

/// Whether the step is transfers by the SDO client.
pub(super) const fn transfers(step: &Step) -> bool {
    matches!(
        step,
        Step::Read(_) | Step::Write(_) | Step::Remap(_) | Step::Defaults(_) | Step::Undeclared(_)
    )
}

/// Whether the step fails because something came too late, too early or not at all.
fn judges_time(step: &Step, failed: &Difference) -> bool {
    match step {
        Step::Expect(_)
        | Step::Never(_)
        | Step::Collect(_)
        | Step::Until(_)
        | Step::Measure(_)
        | Step::Ask(_) => true,
        Step::Reply(_) | Step::Lss(_) => failed.raw.is_none(),
        _ => false,
    }
}
