//! The bus as a runner sees it: a trace, and a cursor in it.
//!
//! Windows are measured in trace time. A step starts where the last one ended, at the stamp of the
//! last frame that was matched or sent, so the latency of the host never enters a judgement.

use std::time::Duration;

use canopen::monitor::Seen;
use canopen::sdo::{RESPONSE_COB_ID, Request};
use canopen::{Bench, Bus, BusError, Frame, Instant, Mux, Stamped};
use reports::Event;
use smallvec::SmallVec;

use super::lateness::{Awaited, Lateness, STALL};
use super::other_nodes::OtherNodes;
use super::silence::Silence;
use super::traffic::Traffic;
use super::twins::Twins;
use crate::dut::Dut;
use crate::run::observer::{Observer, Unobserved};
use crate::stop::Stop;

/// The frames that wait for the wire at once. The transmit queue of a CAN interface is usually ten
/// frames long, and one that is full costs a wait.
const MOST_AHEAD: usize = 8;

/// Every device has this object.
const DEVICE_TYPE: Mux = Mux::new(0x1000, 0);

/// A tester that is less late than this is in time.
const IN_TIME: Duration = Duration::from_millis(5);

/// A tester that is no later than this keeps up with the bus. The shortest wait for an answer is
/// not much longer.
const KEEPS_UP: Duration = Duration::from_millis(250);

/// A bus, the frames seen on it since the case began, and how far the steps have looked.
pub struct Link<'b> {
    bus: &'b mut dyn Bus,
    trace: Vec<Seen>,
    cursor: usize,
    mark: Instant,
    /// From where in the trace frames came beside the answer at that moment.
    beside: Option<(usize, Instant)>,
    emit: Option<&'b mut dyn FnMut(Event)>,
    observer: &'b dyn Observer,
    /// Whether a case is open, to which the frames belong.
    in_case: bool,
    lateness: Lateness,
    /// The lateness in the case before the device started anew.
    before: Lateness,
    /// When the tester did not keep up with the bus last, and how late it was then.
    behind: Option<(Instant, Duration)>,
    /// Whether the SDO server waits for the tester.
    awaited: Awaited,
    /// Until when the tester was busy with frames during which it looks at what came, or waited.
    busy: Instant,
    stop: Stop,
    silence: Silence,
    traffic: Traffic,
    twins: Twins,
    other_nodes: OtherNodes,
}

impl<'b> Link<'b> {
    /// A link that starts now.
    pub fn new(bus: &'b mut dyn Bus) -> Self {
        let mark = bus.now();
        Self {
            bus,
            trace: Vec::new(),
            cursor: 0,
            mark,
            beside: None,
            emit: None,
            observer: &Unobserved,
            in_case: false,
            lateness: Lateness::default(),
            before: Lateness::default(),
            behind: None,
            awaited: Awaited::default(),
            busy: Instant::default(),
            stop: Stop::default(),
            silence: Silence::default(),
            traffic: Traffic::default(),
            twins: Twins::default(),
            other_nodes: OtherNodes::default(),
        }
    }

    /// The same, with a receiver of events: those of [`emit`](Self::emit), and every frame of a
    /// case at the moment when it is seen. A run that is killed then leaves the frames of its last
    /// case. As long as the user [asks to stop](Stop::asked), nothing is received.
    pub(in crate::run) fn reporting(
        bus: &'b mut dyn Bus,
        emit: &'b mut dyn FnMut(Event),
        observer: &'b dyn Observer,
        stop: &Stop,
    ) -> Self {
        Self { emit: Some(emit), observer, stop: stop.clone(), ..Self::new(bus) }
    }

    /// Listens for when the device falls silent, for what happens to the other nodes of its bus
    /// that are known, and where others share its bus, for another one with its node id: once there
    /// is one, nothing is sent any more.
    pub(in crate::run) fn listen_to(&mut self, dut: &Dut) {
        self.silence = Silence::of(dut.node);
        self.twins.node = dut.shares_its_bus.then_some(dut.node);
        self.other_nodes = OtherNodes::of(&dut.other_nodes);
    }

    /// Measures from now on how much of the bus others take.
    pub(in crate::run) fn watch(&mut self, traffic: Traffic) {
        self.traffic = traffic;
        self.traffic.forget(self.mark);
    }

    /// Restarts the measurement of how much of the bus other stations take.
    pub(in crate::run) fn forget_traffic(&mut self) {
        self.traffic.forget(self.mark);
    }

    /// How much of the bus others take.
    pub(in crate::run) const fn traffic(&self) -> &Traffic {
        &self.traffic
    }

    /// Returns what happened to the other nodes since this was last asked, a sentence each.
    pub(in crate::run) fn of_other_nodes(&mut self) -> Vec<String> {
        self.other_nodes.take(self.mark)
    }

    /// The heartbeat of this other node has another period from now on.
    pub(in crate::run) fn has_another_period(&mut self, node: u8) {
        self.other_nodes.forget_period_of(node);
    }

    /// The last frame to the device, if it has sent nothing since.
    pub(in crate::run) const fn silence(&self) -> &Silence {
        &self.silence
    }

    /// Marks the begin or end of cleaning, which leaves the device as it was found: one signal is
    /// remembered until the end.
    pub(in crate::run) fn clean(&self, cleaning: bool) {
        self.stop.clean(cleaning);
    }

    /// Reports an event.
    pub(in crate::run) fn emit(&mut self, event: Event) {
        match &event {
            Event::CaseStarted(_) => self.in_case = true,
            Event::CaseEnded(_) => self.in_case = false,
            _ => {}
        }
        self.observer.event(&event);
        if let Some(emit) = &mut self.emit {
            emit(event);
        }
    }

    /// Where the next step starts.
    pub const fn mark(&self) -> Instant {
        self.mark
    }

    /// Until when frames were sent during the last steps, when the next step starts before that.
    pub(in crate::run) fn still_sent(&self) -> Option<Instant> {
        (self.busy > self.mark).then_some(self.busy)
    }

    /// The time on the bus, which may be later than where the next step starts.
    pub fn now(&mut self) -> Instant {
        self.bus.now().max(self.mark)
    }

    /// The frames since the trace was last taken.
    pub fn trace(&self) -> &[Seen] {
        &self.trace
    }

    /// Takes note of what somebody else has received from the bus.
    pub(in crate::run) fn was_seen(&mut self, frames: &[Stamped]) {
        self.trace.extend(frames.iter().map(|it| Seen { stamped: *it, expected: false }));
        self.cursor = self.trace.len();
        self.mark = frames.last().map_or(self.mark, |last| self.mark.max(last.at));
    }

    /// Takes the trace and begins a new one.
    pub fn take_trace(&mut self) -> Vec<Seen> {
        (self.cursor, self.beside) = (0, None);
        std::mem::take(&mut self.trace)
    }

    /// Sends a frame and waits until it is complete on the wire. The next step starts there.
    ///
    /// # Errors
    /// Whatever the bus reports; [`BusError::Io`] when no node acknowledges the frame.
    pub fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
        self.send_all([*frame])
    }

    /// Whether time on the bus is real.
    pub fn is_real(&self) -> bool {
        self.bus.is_real()
    }

    /// Sends a frame that was meant to leave at the moment `meant`, and can be as late as `bears`.
    ///
    /// # Errors
    /// As [`send`](Self::send).
    pub fn send_at(
        &mut self,
        frame: &Frame,
        meant: Instant,
        bears: Duration,
    ) -> Result<(), BusError> {
        self.send(frame)?;
        let late = self.mark.since(meant.max(self.busy));
        if self.bus.is_real() && late > bears {
            self.lateness.missed = self.lateness.missed.max(late);
        }
        Ok(())
    }

    /// Lets time pass until `until`, for what follows to happen then, or as much later as `bears`.
    ///
    /// # Errors
    /// Whatever the bus reports.
    pub fn wait_for(&mut self, until: Instant, bears: Duration) -> Result<(), BusError> {
        self.wait(until)?;
        let late = self.bus.now().since(until.max(self.busy));
        if self.bus.is_real() && late > bears {
            self.lateness.overslept = self.lateness.overslept.max(late);
        }
        Ok(())
    }

    /// How late the tester was since this was last forgotten.
    pub const fn lateness(&self) -> Lateness {
        self.lateness
    }

    /// The longest time that it took to notice something since the case began.
    pub(in crate::run) fn noticed(&self) -> Duration {
        self.before.noticed.max(self.lateness.noticed)
    }

    /// The longest time that an SDO server waited for the tester since the case began.
    pub(in crate::run) fn kept_waiting(&self) -> Duration {
        self.before.kept_waiting.max(self.lateness.kept_waiting)
    }

    /// How late the tester was when it last did not keep up with the bus, if it was since that
    /// moment. A device that is a program of the same machine may be as late with its answers.
    pub fn behind_since(&self, start: Instant) -> Option<Duration> {
        self.behind.filter(|(when, _)| *when >= start).map(|(_, late)| late)
    }

    /// The device starts anew: what it did, or did not get, because the tester was late is over.
    pub(in crate::run) fn starts_anew(&mut self) {
        let (noticed, kept_waiting) = (self.noticed(), self.kept_waiting());
        self.before = Lateness { noticed, kept_waiting, ..Lateness::default() };
        (self.lateness, self.awaited) = Default::default();
    }

    /// Restarts the measurement of how late the tester is.
    pub fn forget_lateness(&mut self) {
        (self.lateness, self.before, self.awaited) = Default::default();
    }

    /// Waits until the tester has been in time for a while, at most two seconds: a stall of the
    /// host often lasts.
    ///
    /// # Errors
    /// Whatever the bus reports.
    pub fn calm(&mut self) -> Result<(), BusError> {
        const WHILE: Duration = Duration::from_millis(100);
        const MOST: u32 = 20;
        for _ in 0..MOST {
            self.forget_lateness();
            let until = self.now() + WHILE;
            self.wait(until)?;
            if self.lateness.noticed < IN_TIME && self.now().since(until) < IN_TIME {
                break;
            }
        }
        Ok(())
    }

    /// Sends frames without a gap between them and waits until the last is complete on the wire.
    /// The next step starts there.
    ///
    /// # Errors
    /// As [`send`](Self::send).
    pub fn send_all(&mut self, frames: impl IntoIterator<Item = Frame>) -> Result<(), BusError> {
        self.look_for_a_twin()?;
        let mut frames = frames.into_iter();
        let mut ahead = SmallVec::<[Frame; MOST_AHEAD]>::new();
        loop {
            // A frame that waits in the queue of the interface follows at once, however late the
            // host hears of the end of the frame before it.
            for frame in frames.by_ref().take(MOST_AHEAD - ahead.len()) {
                self.bus.send(&frame)?;
                ahead.push(frame);
            }
            if ahead.is_empty() {
                return Ok(());
            }
            let (could, before) = (self.mark.max(self.busy), self.awaited);
            let frame = ahead.remove(0);
            self.complete(&frame)?;
            let took = self.mark.since(could);
            if self.bus.is_real() && before.is_open() && Awaited::is_request(&frame) {
                self.lateness.keep_waiting(took);
            }
            // Unless the wire is full, only a host that stood still keeps a frame back so long.
            if self.bus.is_real() && took > STALL {
                self.lateness.notice(took);
            }
        }
    }

    /// Decides whether another station has the node id of the device, where something speaks for
    /// it, before anything else is sent.
    fn look_for_a_twin(&mut self) -> Result<(), BusError> {
        /// A second answer comes in that time.
        const BOTH: Duration = Duration::from_millis(100);
        if self.twins.suspects()
            && let Some(node) = self.twins.node
        {
            let mut double = 0;
            for _ in 0..Twins::PROBES {
                let request = Request::Upload(DEVICE_TYPE).frame(node);
                self.bus.send(&request)?;
                self.complete(&request)?;
                let asked = self.cursor;
                self.wait(self.mark + BOTH)?;
                let came = self.trace[asked..].iter().map(|seen| &seen.stamped);
                let answers = Some(RESPONSE_COB_ID + u16::from(node));
                let answers = came.filter(|it| !it.own && it.frame.data_id() == answers);
                double += u32::from(answers.count() > 1);
            }
            self.twins.decide(double);
        }
        match &self.twins.found {
            Some(found) => Err(BusError::Io(found.clone())),
            None => Ok(()),
        }
    }

    /// Waits until an own frame is complete on the wire.
    fn complete(&mut self, frame: &Frame) -> Result<(), BusError> {
        const PATIENCE: Duration = Duration::from_secs(2);
        /// This many in that time leave no room for another one.
        const MANY: usize = 200;
        let (give_up, before) = (self.bus.now() + PATIENCE, self.trace.len());
        while let Some(place) = self.pull(give_up)? {
            let stamped = self.trace[place].stamped;
            if stamped.own && stamped.frame == *frame {
                (self.cursor, self.mark) = (place + 1, stamped.at);
                return Ok(());
            }
        }
        let others = self.trace[before..].iter().filter(|seen| !seen.stamped.own).count();
        Err(BusError::Io(match others {
            ..MANY => format!("frame {frame} was not acknowledged: is another node on the bus?"),
            _ => format!(
                "frame {frame} was not sent within 2 s, in which {others} frames of others came: \
                 they leave no room on the bus"
            ),
        }))
    }

    /// The next frame from the cursor on that `fits`, if it is complete by `until`. It counts as
    /// expected, and the next step starts there.
    ///
    /// # Errors
    /// Whatever the bus reports.
    pub fn find(
        &mut self,
        until: Instant,
        mut fits: impl FnMut(&Stamped) -> bool,
    ) -> Result<Option<Stamped>, BusError> {
        let mut place = self.cursor;
        let first_look = self.bus.now();
        loop {
            if place == self.trace.len() && self.pull(until)?.is_none() {
                // All of the time had passed before the tester looked for the first time.
                if self.bus.is_real() && first_look > until {
                    self.lateness.notice(first_look.since(self.mark));
                }
                self.busy = self.busy.max(until);
                return Ok(None);
            }
            let seen = &mut self.trace[place];
            if seen.stamped.at > until {
                self.busy = self.busy.max(until);
                return Ok(None);
            }
            if fits(&seen.stamped) {
                seen.expected = true;
                (self.cursor, self.mark) = (place + 1, seen.stamped.at);
                return Ok(Some(seen.stamped));
            }
            place += 1;
        }
    }

    /// The answer to the last request, as [`find`](Self::find) finds a frame. A frame that the
    /// request causes may arrive before the answer: [`find_beside`](Self::find_beside) finds it.
    ///
    /// # Errors
    /// Whatever the bus reports.
    pub fn find_answer(
        &mut self,
        until: Instant,
        fits: impl FnMut(&Stamped) -> bool,
    ) -> Result<Option<Stamped>, BusError> {
        let asked = self.cursor;
        let answer = self.find(until, fits)?;
        self.beside = answer.map(|answer| (asked, answer.at));
        Ok(answer)
    }

    /// A frame that came between a request and its answer, when nothing happened after the answer.
    /// It counts as expected; the next step starts where it would have started.
    pub fn find_beside(&mut self, fits: impl Fn(&Stamped) -> bool) -> Option<Stamped> {
        let (from, _) = self.beside.filter(|(_, answered)| *answered == self.mark)?;
        let between = &mut self.trace[from..self.cursor];
        let place = between.iter().position(|seen| !seen.expected && fits(&seen.stamped))?;
        between[place].expected = true;
        let found = between[place].stamped;
        self.beside = Some((from + place + 1, self.mark));
        Some(found)
    }

    /// Lets time pass until `until`. The next step starts there.
    ///
    /// # Errors
    /// Whatever the bus reports.
    pub fn wait(&mut self, until: Instant) -> Result<(), BusError> {
        while self.pull(until)?.is_some() {}
        self.skip_to(until);
        Ok(())
    }

    /// Waits until nothing came for the time `quiet`, at most 20 times as long: a device that
    /// never falls silent is not waited for.
    ///
    /// # Errors
    /// Whatever the bus reports.
    pub fn drain(&mut self, quiet: Duration) -> Result<(), BusError> {
        let end = self.mark + quiet * 20;
        let mut until = self.mark + quiet;
        while let Some(place) = self.pull(until.min(end))? {
            until = self.trace[place].stamped.at + quiet;
        }
        self.skip_to(until.min(end));
        Ok(())
    }

    /// The bench around the device.
    pub fn bench(&mut self) -> Option<&mut dyn Bench> {
        self.bus.bench()
    }

    /// All frames received so far count as seen.
    ///
    /// # Errors
    /// Whatever the bus reports.
    pub fn look_from_now(&mut self) -> Result<(), BusError> {
        let now = self.now();
        self.wait(now)
    }

    /// Takes note of all frames received so far; the next step sees them.
    ///
    /// # Errors
    /// Whatever the bus reports.
    pub fn catch_up(&mut self) -> Result<(), BusError> {
        let now = self.now();
        while self.pull(now)?.is_some() {}
        Ok(())
    }

    /// Time may have passed outside the bus. The next step starts now, and sees the frames that
    /// arrived in the meantime.
    pub fn moved(&mut self) {
        self.mark = self.now();
    }

    /// Looks again at everything that came after `start`, as after sending many frames.
    pub fn look_from(&mut self, start: Instant) {
        // What follows the first of them cannot leave before the last.
        self.busy = self.busy.max(self.mark);
        self.cursor = self.trace.partition_point(|seen| seen.stamped.at <= start);
        self.mark = start;
    }

    /// Everything up to `until` has been looked at.
    pub fn skip_to(&mut self, until: Instant) {
        self.cursor +=
            self.trace[self.cursor..].iter().take_while(|seen| seen.stamped.at <= until).count();
        self.mark = self.mark.max(until);
    }

    /// The next frame until `until`. It is waited for in short turns, since a host that stalls and
    /// is awake again when a frame comes is noticed by nothing else.
    fn watchful(&mut self, until: Instant) -> Result<Option<Stamped>, BusError> {
        const TURN: Duration = Duration::from_millis(2);
        let mut asked = self.bus.now();
        loop {
            let turn = until.min(asked + TURN);
            let got = self.bus.recv(turn)?;
            let due = got.map_or(turn, |stamped| stamped.at);
            // A frame that was already there was not waited for.
            if asked <= due {
                asked = self.bus.now();
                self.lateness.notice(asked.since(due));
            }
            let late = asked.since(due);
            if late > KEEPS_UP {
                self.behind = Some((asked, late));
                self.other_nodes.lose();
            }
            if got.is_some() || turn == until {
                return Ok(got);
            }
        }
    }

    /// One more frame into the trace; its place, or `None` when `until` has come.
    fn pull(&mut self, until: Instant) -> Result<Option<usize>, BusError> {
        // A real bus looks while it waits; a simulated one never waits.
        if self.stop.asked() {
            return Err(BusError::Interrupted);
        }
        let got = match self.bus.is_real() {
            true => self.watchful(until),
            false => self.bus.recv(until),
        };
        if let Err(BusError::Lost(_) | BusError::Controller(_)) = &got {
            self.other_nodes.lose();
        }
        let Some(stamped) = got? else { return Ok(None) };
        self.silence.see(&stamped);
        self.awaited.see(&stamped);
        self.traffic.see(&stamped);
        self.twins.see(&stamped);
        self.other_nodes.see(&stamped);
        self.observer.frame(&stamped);
        self.trace.push(Seen { stamped, expected: false });
        if self.in_case {
            self.emit(Event::Frame(stamped));
        }
        Ok(Some(self.trace.len() - 1))
    }
}

#[cfg(test)]
mod tests {
    use std::collections::VecDeque;

    use super::*;

    /// An interface that notes in `most` the longest transmit queue that was needed.
    #[derive(Default)]
    struct Queue {
        waiting: VecDeque<Frame>,
        most: usize,
        now: Instant,
    }

    impl Bus for Queue {
        fn now(&mut self) -> Instant {
            self.now
        }
        fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
            self.waiting.push_back(*frame);
            self.most = self.most.max(self.waiting.len());
            Ok(())
        }
        fn recv(&mut self, _: Instant) -> Result<Option<Stamped>, BusError> {
            self.now += Duration::from_micros(100);
            Ok(self.waiting.pop_front().map(|frame| Stamped { at: self.now, frame, own: true }))
        }
    }

    #[test]
    fn frames_wait_in_the_queue_of_the_interface_and_do_not_overflow_it() {
        let mut bus = Queue::default();
        let mut link = Link::new(&mut bus);
        let frames: Vec<Frame> = (0..127).map(|count| Frame::new(0x605, [count; 8])).collect();
        link.send_all(frames.iter().copied()).unwrap();
        assert_eq!(link.mark(), link.trace()[126].stamped.at);
        assert!(link.trace().iter().map(|seen| seen.stamped.frame).eq(frames));
        assert_eq!(bus.most, MOST_AHEAD);
    }
}
