//! The judge: a model gets the frames that the device got, and each frame of the device must be one
//! of the model's, in its order and in time.
//!
//! What the application of a device decides is left out where it is not known: values of its
//! objects are compared by their length, and the model follows them; TPDOs that map them come when
//! they like; it may refuse what is written to it, and report errors of its own.
//!
//! A device on a bus is in a time of its own. Its frames may come as late as an answer, and a
//! little earlier than those of the model; what it sends periodically is judged by its period.

mod expected;
mod identifiers;
mod known;
mod sdo;
mod streams;

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::sync::Arc;
use std::time::Duration;

use canopen::eds::Entry;
use canopen::emcy::{Emcy, EmcyCode};
use canopen::heartbeat::ErrorControl;
use canopen::nmt::{self, Command, Service};
use canopen::pdo::CobId;
use canopen::sdo::{RESPONSE_COB_ID, Response};
use canopen::timestamp::TimeOfDay;
use canopen::{Data, Frame, Instant, Mux, NmtState, Stamped, Value, heartbeat};
use reference_devices::change::Replica;

use crate::blueprint::Blueprint;
use crate::model::Model;
use expected::{Expected, Must, Queues};
use identifiers::{Class, HELD, Identifiers};
use known::Known;
use sdo::{Before, Request, Requests, Transfer, Transfers};
use streams::{Streams, Taken};

pub(crate) use sdo::is_request;

/// Something that happened on the bus or on the bench.
#[derive(Clone, Debug, PartialEq)]
pub enum Seen {
    /// A frame.
    Frame(Stamped),
    /// The supply was switched.
    Power(Instant, bool),
    /// Nothing until then.
    Until(Instant),
    /// The device, a program, ended by itself.
    Ended(Instant),
    /// The device, which is about to boot, has this value then.
    Stored(Mux, Data),
    /// The device has been running until then, and nobody saw what it did.
    Joined(Instant),
    /// A stimulus was set on the bench.
    Stimulus(Instant, Arc<str>, Value),
    /// What was to be seen on the bench.
    Observed(Instant, Arc<str>, Value),
    /// A look is over.
    Looked(Instant),
}

impl Seen {
    /// When it happened. A look at stored values comes before all else.
    pub const fn at(&self) -> Instant {
        match self {
            Self::Frame(stamped) => stamped.at,
            Self::Power(at, _)
            | Self::Until(at)
            | Self::Ended(at)
            | Self::Stimulus(at, ..)
            | Self::Observed(at, ..)
            | Self::Looked(at)
            | Self::Joined(at) => *at,
            Self::Stored(..) => Instant::ZERO,
        }
    }
}

/// What is wrong with a device.
#[derive(Clone, Debug, PartialEq)]
pub struct Violation {
    /// When it was noticed.
    pub at: Instant,
    /// What it is.
    pub what: What,
}

/// What is wrong.
#[derive(Clone, Debug, PartialEq)]
pub enum What {
    /// A frame that is not the next one of its identifier, and the one that should have come.
    Unexpected(Frame, Option<Frame>),
    /// A frame that did not come, and when it was due.
    Missing(Frame, Instant),
    /// An event-driven TPDO came again within its inhibit time.
    Inhibited(Frame, Duration),
    /// The device, a program, ended by itself after it got this frame.
    Ended(Option<Frame>),
    /// Something is another than on the reference device.
    Differs(Box<Difference>),
}

/// Something that is another than on the reference device.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    /// What it is, without values and times: `value-64010110`, `bench-output-current-1`.
    pub kind: String,
    /// Its name, for people.
    pub name: String,
    /// The object, where it is the value of one.
    pub object: Option<Mux>,
    /// The name on the bench, where it is to be seen there.
    pub bench: Option<Arc<str>>,
    /// The value that the reference device shows, where it is one.
    pub value: Option<Value>,
    /// The same of the device.
    pub shown: Option<Value>,
    /// What the reference device shows.
    pub expected: String,
    /// What the device shows.
    pub actual: String,
}

impl Violation {
    /// Whether two sessions show the same.
    pub fn is_like(&self, other: &Self) -> bool {
        self.kind() == other.kind()
    }

    /// What it is, without values and times: `unexpected-582` or `missing-702`.
    pub fn kind(&self) -> String {
        let command = |frame: &Frame| frame.data.first().map_or(0, |command| command >> 5);
        match &self.what {
            What::Unexpected(frame, None) => format!("unexpected-{}", frame.id),
            What::Unexpected(frame, Some(other)) => {
                format!("unexpected-{}-{}-for-{}", frame.id, command(frame), command(other))
            }
            What::Missing(frame, _) => format!("missing-{}", frame.id),
            What::Inhibited(frame, _) => format!("inhibited-{}", frame.id),
            What::Ended(_) => "ended".to_owned(),
            What::Differs(difference) => difference.kind.clone(),
        }
    }
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.what {
            What::Unexpected(frame, Some(other)) => write!(f, "{frame} instead of {other}"),
            What::Unexpected(frame, None) => write!(f, "{frame} without a cause"),
            What::Missing(frame, due) => write!(f, "no {frame}, due at {due} s"),
            What::Inhibited(frame, gap) => {
                write!(f, "{frame} {gap:?} after the last one, within its inhibit time")
            }
            What::Ended(None) => f.write_str("the program ended"),
            What::Ended(Some(frame)) => write!(f, "the program ended after it got {frame}"),
            What::Differs(difference) => {
                let Difference { name, expected, actual, .. } = &**difference;
                write!(f, "{name}: {actual} instead of {expected}")
            }
        }
    }
}

/// Why a session is not judged any further.
#[derive(Clone, Debug, PartialEq)]
pub enum End {
    /// The device did something wrong.
    Violation(Violation),
    /// The application of the device has taken over.
    Void(Instant),
}

/// A model beside the device.
pub struct Oracle<'b> {
    blueprint: &'b Blueprint,
    model: Model,
    now: Instant,
    queues: Queues,
    identifiers: Identifiers,
    streams: Streams,
    /// Frames of a device in its own time that the model has not sent yet.
    early: Vec<Early>,
    /// The last frame that the device got.
    last: Option<Frame>,
    /// The server of the model has answered since it got the last frame.
    answered: bool,
    /// A reset that the model gets when the device has booted, in its own time.
    held: Option<Held>,
    /// What was requested of the device.
    requests: Requests,
    /// What the model answers.
    transfers: Transfers,
    /// Since when the bus has been busy, and when it last was.
    busy: (Instant, Instant),
    /// Whether the device has refused a transfer of which the model knows nothing.
    refused: bool,
    /// How many frames the model has taken.
    taken: u64,
    /// When the model was last OPERATIONAL.
    operational: Instant,
    /// When it last became so.
    started: Instant,
    /// When a command last led it out of OPERATIONAL.
    led_out: Option<Instant>,
    /// When parameters of TPDOs were last written, by the index of their communication parameters.
    configured: BTreeMap<u16, Instant>,
    /// The application has reported an error.
    errors: bool,
    /// What is wrong unless it has one, which it has not reported yet.
    suspicion: Option<Suspicion>,
    /// Objects that the application has given other values than the network has.
    followed: BTreeSet<Mux>,
    /// Texts of the application that were written since the last reset.
    texts: BTreeSet<Mux>,
    /// Objects of the application that keep what they are given, and that it has left alone since.
    kept: BTreeSet<Mux>,
    /// Whether TIME has set the clock since the last reset.
    told: bool,
    /// What is known of the values of the device.
    known: Known,
    /// An object that has another value than the model, which nobody has written.
    learnt: Option<(Mux, Data)>,
}

/// A reset of a device that boots, or its power-on.
#[derive(Clone, Copy, Debug)]
struct Held {
    at: Instant,
    /// The command; none at power-on.
    frame: Option<Frame>,
    /// How the model boots.
    boot: Boot,
}

/// How a model boots.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Boot {
    /// How long it takes.
    pub(crate) takes: Duration,
    /// The node id that it has then: LSS may have given it another one.
    node: u8,
}

/// A frame that the model may still send.
#[derive(Clone, Copy, Debug)]
struct Early {
    until: Instant,
    frame: Frame,
    /// The one that should have come.
    expected: Option<Frame>,
}

/// What is wrong unless the application reports an error.
#[derive(Clone, Debug)]
struct Suspicion {
    until: Instant,
    violation: Violation,
}

impl<'b> Oracle<'b> {
    /// The judge of a device that is like `device`, both of which are switched on at time 0.
    pub fn new(blueprint: &'b Blueprint, device: Box<dyn Replica>) -> Self {
        let node = blueprint.node();
        let model = Model::new(device);
        let at = Instant::ZERO;
        let boot = blueprint.is_in_its_own_time().then(|| boots_in(&model, at, None));
        let known = Known::new(blueprint);
        let held = boot.flatten().map(|boot| Held { at, frame: None, boot });
        Self {
            blueprint,
            model,
            now: Instant::ZERO,
            queues: Queues::default(),
            identifiers: Identifiers::new(node),
            streams: Streams::default(),
            early: Vec::new(),
            last: None,
            answered: true,
            held,
            requests: Requests::default(),
            transfers: Transfers::default(),
            busy: (Instant::ZERO, Instant::ZERO),
            refused: false,
            taken: 0,
            operational: Instant::ZERO,
            led_out: None,
            started: Instant::ZERO,
            configured: BTreeMap::new(),
            errors: blueprint.has_errors(),
            suspicion: None,
            followed: BTreeSet::new(),
            texts: BTreeSet::new(),
            kept: blueprint.kept().objects.clone(),
            told: false,
            known,
            learnt: None,
        }
    }

    /// The model.
    pub(crate) const fn model(&self) -> &Model {
        &self.model
    }

    /// The objects of which it was seen that the application changes them.
    pub const fn followed(&self) -> &BTreeSet<Mux> {
        &self.followed
    }

    /// Judges what happened next.
    ///
    /// # Errors
    /// When something is wrong, or nothing more can be judged.
    pub fn see(&mut self, seen: &Seen) -> Result<(), End> {
        match *seen {
            Seen::Frame(stamped) => {
                self.occupy(stamped.at);
                self.advance(stamped.at)?;
                if stamped.own {
                    self.take(stamped.at, &stamped.frame)
                } else {
                    self.judge(stamped.at, &stamped.frame)
                }
            }
            Seen::Until(at) => self.advance(Instant(at.0.saturating_add(1))),
            Seen::Ended(at) => wrong(at, What::Ended(self.last)),
            Seen::Power(at, on) => {
                self.advance(Instant(at.0.saturating_add(1)))?;
                self.model.power(at, on);
                self.requests.clear();
                self.forget_application();
                self.release();
                self.held = None;
                if on && self.blueprint.is_in_its_own_time() {
                    let boot = boots_in(&self.model, at, None);
                    self.held = boot.map(|boot| Held { at, frame: None, boot });
                }
                Ok(())
            }
            Seen::Stored(mux, value) => {
                self.model.store(mux, &value);
                self.known.is_stored(mux, value);
                Ok(())
            }
            Seen::Joined(at) => {
                self.join(at);
                Ok(())
            }
            Seen::Stimulus(at, ..) | Seen::Observed(at, ..) | Seen::Looked(at) => {
                self.advance(Instant(at.0.saturating_add(1)))
            }
        }
    }

    /// The model comes to where the device is, which has sent something else on its way.
    fn join(&mut self, at: Instant) {
        // Nothing that is missing until then is missed.
        for (due, frame) in self.model.act_before(at) {
            _ = self.expect(due, frame);
        }
        self.now = self.now.max(at);
        self.queues.release();
        self.streams.begin(at);
        self.early.clear();
        self.known.join();
    }

    /// The device may have lost what it had to send.
    fn release(&mut self) {
        (self.told, self.suspicion) = (false, None);
        self.queues.release();
        self.streams.release();
        if self.blueprint.listens() {
            // Nobody waited until the model had sent them, too.
            self.early.clear();
        }
    }

    /// The application begins anew: what of its values is stored, and where it begins, it decides.
    fn forget_application(&mut self) {
        self.texts.clear();
        self.kept.clear();
    }

    /// Whether the device is about to boot.
    pub(crate) fn boots(&self) -> bool {
        self.held.is_some()
    }

    /// A frame that the model may still send, where nothing more will be seen.
    pub(crate) fn unexplained(&self) -> Option<End> {
        if let Some(suspicion) = &self.suspicion {
            return Some(End::Violation(suspicion.violation.clone()));
        }
        let Early { until, frame, expected } = *self.early.first()?;
        wrong(until, What::Unexpected(frame, expected)).err()
    }

    /// Whether the device owes anything that it does not send again and again.
    pub(crate) fn owes(&self) -> bool {
        let doubts = !self.early.is_empty() || self.suspicion.is_some();
        self.queues.owe() || doubts || self.held.is_some()
    }

    /// How many frames the device owes.
    pub(crate) fn debts(&self) -> usize {
        self.queues.owed()
    }

    /// Whether the device owes a frame with this identifier, or will by itself in that time.
    pub(crate) fn awaits(&self, id: u16, time: Duration) -> bool {
        if self.answered || self.queues.awaits(id) {
            return self.queues.awaits(id);
        }
        let (mut model, until) = (self.model.clone(), self.now + time);
        let mut says = || {
            let due = model.due_before(until)?;
            Some(model.poll(due).any(|said| said.data_id() == Some(id)))
        };
        std::iter::from_fn(&mut says).take(MOST_AHEAD).any(|says| says)
    }

    /// Lets the model act on everything before `to`.
    fn advance(&mut self, to: Instant) -> Result<(), End> {
        if let Some(held) = self.held {
            self.now = self.now.max(to);
            let boot_up = ErrorControl::BOOT_UP.frame(held.boot.node);
            return match held.at + START < to {
                true => wrong(to, What::Missing(boot_up, held.at)),
                false => Ok(()),
            };
        }
        while let Some(due) = self.model.due_before(to) {
            self.overdue(due)?;
            if self.model.state() == NmtState::OPERATIONAL {
                self.operational = due;
            }
            let sent: Vec<Frame> = self.model.poll(due).collect();
            self.now = due;
            self.identifiers.look(self.model.dictionary(), due);
            sent.into_iter().try_for_each(|frame| self.expect(due, frame))?;
        }
        self.now = self.now.max(to);
        if self.model.state() == NmtState::OPERATIONAL {
            self.operational = self.now;
        }
        self.overdue(to)
    }

    fn take(&mut self, now: Instant, frame: &Frame) -> Result<(), End> {
        if let Some(mut request) = sdo::request(frame, self.blueprint, &self.model) {
            if request.may_be_undone() {
                request.before_it = Some(Box::new(self.before()));
            }
            // Until it is confirmed, nobody knows what is left of a text.
            if let Some(mux) = request.writes() {
                self.texts.remove(&mux);
            }
            self.requests.begin(request);
            self.refused = false;
        }
        self.last = Some(*frame);
        if is_reset(frame, self.model.id()) {
            self.release();
            // Reset communication leaves the objects of the application alone (CIA301-NMT-33).
            if frame.data.first() == Some(&Service::RESET_NODE.0) {
                self.forget_application();
            }
            if self.blueprint.is_in_its_own_time()
                && let Some(boot) = boots_in(&self.model, now, Some(frame))
            {
                self.held = Some(Held { at: now, frame: Some(*frame), boot });
                return Ok(());
            }
        }
        if self.blueprint.listens() && !self.blueprint.is_prompt() {
            self.overtakes(now, frame)?;
        }
        if let Some(held) = self.held.take() {
            // The device has not come back, and will not hear this.
            self.begin(held.at, &held)?;
        }
        self.give(now, frame)
    }

    /// Others do not wait for a device in its own time: what it does first, nobody knows.
    fn overtakes(&mut self, now: Instant, frame: &Frame) -> Result<(), End> {
        if commands(frame, self.model.id()) {
            self.queues.release();
            self.early.clear();
        }
        let answer = RESPONSE_COB_ID + u16::from(self.model.id());
        match is_request(frame, self.model.id()) && self.queues.awaits(answer) {
            true => Err(End::Void(now)),
            false => Ok(()),
        }
    }

    /// What is known before the model gets a request that the device may refuse.
    fn before(&self) -> Before {
        Before {
            model: self.model.clone(),
            queues: self.queues.clone(),
            streams: self.streams.clone(),
            early: self.early.clone(),
            taken: self.taken,
            seen: Vec::new(),
        }
    }

    /// Gives the model a frame of the tester.
    fn give(&mut self, now: Instant, frame: &Frame) -> Result<(), End> {
        self.taken += 1;
        self.answered = !is_request(frame, self.model.id()) && self.answered;
        let tpdo = self.requests.last().and_then(|request| request.configures(frame));
        self.configured.extend(tpdo.map(|tpdo| (tpdo, now)));
        let before = self.model.state();
        if commands(frame, self.model.id()) && self.known.enters() {
            self.release();
            self.forget_application();
        }
        self.known.hears(frame);
        self.told |= self.sets_the_clock(frame);
        let open = self.open_process_data(now, frame);
        let sent: Vec<Frame> = self.model.take(now, frame).collect();
        if self.model.state() == NmtState::STOPPED {
            // What was to be reported stays where it is.
            self.suspicion = None;
        }
        let od = self.model.dictionary();
        self.identifiers.look(od, now);
        let given = open.into_iter().filter(|(mux, before)| od.get(*mux).map(Data::new) != *before);
        self.kept.extend(given.map(|(mux, _)| mux));
        match (before == NmtState::OPERATIONAL, self.model.state() == NmtState::OPERATIONAL) {
            (true, false) if commands(frame, self.model.id()) => self.led_out = Some(now),
            (_, true) => self.led_out = None,
            _ => {}
        }
        if self.model.state() == NmtState::OPERATIONAL && before != NmtState::OPERATIONAL {
            self.started = now;
        }
        sent.into_iter().try_for_each(|frame| self.expect(now, frame))
    }

    /// The objects that keep what they are given and have values that only the application knows,
    /// before a frame that may give them others, and what the model has.
    fn open_process_data(&mut self, now: Instant, frame: &Frame) -> Vec<(Mux, Option<Data>)> {
        let all = &self.blueprint.kept().objects;
        if self.kept.len() == all.len() || !self.identifiers.is_received(frame, &self.model, now) {
            return Vec::new();
        }
        let od = self.model.dictionary();
        all.difference(&self.kept).map(|mux| (*mux, od.get(*mux).map(Data::new))).collect()
    }

    /// The model gets what was held.
    fn begin(&mut self, at: Instant, held: &Held) -> Result<(), End> {
        match &held.frame {
            Some(command) => self.give(at, command),
            None => {
                self.model.start(at);
                Ok(())
            }
        }
    }

    /// The device has booted: so does the model, at the same time.
    fn boot(&mut self, now: Instant, held: &Held) -> Result<(), End> {
        let reset = Instant(now.0.saturating_sub(held.boot.takes.as_nanos() as u64));
        self.begin(reset, held)?;
        self.advance(Instant(now.0.saturating_add(1)))?;
        let as_usual = held.boot.node == self.blueprint.node();
        self.known.booted(as_usual.then(|| self.model.dictionary()));
        Ok(())
    }

    /// A frame was on the bus until `now`.
    fn occupy(&mut self, now: Instant) {
        const LONGEST_FRAME: u64 = 160 * 1_000_000_000;
        let longest = LONGEST_FRAME / u64::from(self.blueprint.settings().bit_rate.max(1));
        let (since, last) = self.busy;
        let goes_on = now.since(last) <= Duration::from_nanos(longest);
        self.busy = (if goes_on { since } else { now }, now);
    }

    /// How much later than the model the device may be now: a frame waits while others are sent.
    fn late(&self) -> Duration {
        let waits = self.busy.1.since(self.busy.0);
        self.usually_late() + waits
    }

    const fn usually_late(&self) -> Duration {
        if self.blueprint.is_prompt() { LATE } else { LATE_ON_BUS }
    }

    /// Notes a frame of the model.
    fn expect(&mut self, now: Instant, frame: Frame) -> Result<(), End> {
        let class = self.identifiers.class(&frame, &self.model, now, self.usually_late());
        self.answered |= matches!(class, Class::Sdo);
        if matches!(class, Class::Emergency) {
            // What an application does with its values because of an error is its own business.
            self.kept.clear();
        }
        if let Some(period) = self.period(&class, &frame) {
            let like = |early: &Early| self.is_said_by(&class, &early.frame, &frame, None);
            let early = self.early.iter().position(like);
            early.map(|place| self.early.remove(place));
            return match self.streams.expect(now, frame, period, self.late()) {
                Some(what) => self.owed(now, what),
                None => Ok(()),
            };
        }
        let answers = matches!(class, Class::Sdo);
        let of = answers.then(|| self.transfers.of(&frame, &self.requests)).flatten();
        let like = |early: &Early| self.is_said_by(&class, &early.frame, &frame, of);
        if let Some(place) = self.early.iter().position(like) {
            let Early { frame: early, .. } = self.early.remove(place);
            self.queues.came(&early, now);
            return self.follow(now, &class, &early, &frame, of);
        }
        let must = match class {
            Class::Tpdo(ref tpdo) if self.is_free(tpdo) => {
                // Before its first period is over, only the application knows whether it comes.
                let runs = now.since(self.anew(tpdo)) >= tpdo.period;
                // After a pause, such as that of a new bit rate, its phase is that of its last
                // event, which only the application knows.
                let said = self.queues.said(&frame);
                let runs = runs && said.is_some_and(|then| now.since(then) <= tpdo.period + LATE);
                // One of type 0 has no event timer: its events are those of the application.
                let timed = tpdo.kind >= 254 && !tpdo.period.is_zero() && runs;
                if timed { Must::Within(tpdo.period) } else { Must::Not }
            }
            Class::Emergency if self.errors || !self.blueprint.knows_emergencies() => Must::Not,
            _ => Must::Come,
        };
        let later = self.later(&class);
        self.queues.expect(Expected { at: now, frame, must, later, of });
        Ok(())
    }

    /// How much longer than for any other frame a device in its own time may take.
    fn later(&self, class: &Class) -> Duration {
        match class {
            _ if self.blueprint.is_prompt() => Duration::ZERO,
            Class::Sdo | Class::Lss => ANSWER,
            _ => Duration::ZERO,
        }
    }

    /// Whether a frame of the device is one of the model.
    fn is_said_by(
        &self,
        class: &Class,
        frame: &Frame,
        model: &Frame,
        of: Option<Transfer>,
    ) -> bool {
        frame.id == model.id && (frame == model || self.is_like(class, frame, model, of))
    }

    /// The period of a frame that a device sends by itself again and again, when only that can be
    /// judged.
    fn period(&self, class: &Class, frame: &Frame) -> Option<Duration> {
        if !self.blueprint.is_in_its_own_time() || frame.remote {
            return None;
        }
        let od = self.model.dictionary();
        let number = |index| od.int(Mux::new(index, 0)).and_then(|it| u64::try_from(it).ok());
        let sync = || {
            let cob = CobId(number(SYNC)? as u32);
            let produces = cob.0 & SYNC_PRODUCER != 0;
            let period = Duration::from_micros(number(SYNC_PERIOD)?);
            produces.then_some((cob.can_id(), period))
        };
        let period = match class {
            Class::ErrorControl if frame.data.first() != Some(&0) => {
                Duration::from_millis(number(HEARTBEAT)?)
            }
            Class::Tpdo(tpdo) if tpdo.kind >= 254 && !tpdo.period.is_zero() => {
                tpdo.period.max(tpdo.inhibit)
            }
            Class::Tpdo(tpdo) if (1..=240).contains(&tpdo.kind) => sync()?.1 * u32::from(tpdo.kind),
            Class::Other if self.is_time(frame) => {
                let interval = self.blueprint.settings().time_interval_object;
                Duration::from_millis(interval.and_then(|mux| od.int(mux)).unwrap_or(0) as u64)
            }
            Class::Other => {
                let (id, period) = sync()?;
                if frame.any_data_id() == Some(id) { period } else { Duration::ZERO }
            }
            _ => Duration::ZERO,
        };
        Some(period).filter(|period| !period.is_zero())
    }

    /// Whether a frame is the time of a clock, which is another one in each device.
    fn is_time(&self, frame: &Frame) -> bool {
        let cob = self.model.dictionary().int(Mux::new(TIME, 0)).map(|cob| CobId(cob as u32));
        self.blueprint.is_in_its_own_time()
            && cob.is_some_and(|cob| frame.any_data_id() == Some(cob.can_id()))
    }

    /// Whether a frame is a time stamp that the device consumes.
    fn sets_the_clock(&self, frame: &Frame) -> bool {
        let cob = self.model.dictionary().int(Mux::new(TIME, 0)).unwrap_or(0) as u32;
        let consumes = cob & TIME_CONSUMER != 0 && self.model.state() != NmtState::STOPPED;
        let id = CobId(cob).can_id();
        consumes && frame.any_data_id() == Some(id) && TimeOfDay::decode(&frame.data).is_ok()
    }

    /// Whether an answer does not show another time than that of the model, once TIME has set both.
    fn agrees_in_time(&self, frame: &Frame, expected: &Frame, of: Option<Transfer>) -> bool {
        let reads = of.and_then(Transfer::reads);
        let clock = self.blueprint.kept().clock.filter(|clock| self.told && reads == Some(*clock));
        let time = |frame: &Frame| match (clock, Response::decode(&frame.data).ok()?) {
            (Some(_), Response::UploadSegment(segment)) => TimeOfDay::decode(&segment.data).ok(),
            _ => None,
        };
        time(frame).zip(time(expected)).is_none_or(|(shown, known)| shown.is_near(known))
    }

    /// Whether the application decides when a TPDO comes.
    fn is_free(&self, tpdo: &identifiers::Tpdo) -> bool {
        let mut mapped = tpdo.mapped.iter();
        // Whether a value that was written is an event, the application decides as well.
        let announced = self.blueprint.kept().announced;
        let decides = |mux: &Mux| self.is_volatile(*mux) || self.kept.contains(mux) && !announced;
        tpdo.by_events && mapped.any(decides)
    }

    /// When a TPDO began: with the last start, or when its parameters were last written.
    fn anew(&self, tpdo: &identifiers::Tpdo) -> Instant {
        let configured = self.configured.get(&tpdo.index);
        configured.map_or(self.started, |configured| self.started.max(*configured))
    }

    /// Whether the value of an object is compared by its length.
    fn is_volatile(&self, mux: Mux) -> bool {
        let kept = self.texts.contains(&mux) || self.kept.contains(&mux);
        self.blueprint.is_of_application(mux) && !kept
            || self.known.lacks(mux)
            || match mux.index {
                STATUS_REGISTER | HIGH_RESOLUTION | STORED_SHEET => true,
                ERROR_REGISTER | HISTORY => {
                    self.errors || self.known.is_joined() || !self.blueprint.knows_emergencies()
                }
                _ => false,
            }
    }

    /// Judges a frame of the device.
    fn judge(&mut self, now: Instant, frame: &Frame) -> Result<(), End> {
        if frame.remote && self.blueprint.shares_its_bus() {
            return self.surprise(now, &Class::Other, frame, None);
        }
        let boots = |held: &mut Held| *frame == ErrorControl::BOOT_UP.frame(held.boot.node);
        if let Some(held) = self.held.take_if(boots) {
            self.boot(now, &held)?;
        }
        let class = self.identifiers.class(frame, &self.model, now, self.usually_late());
        if matches!(class, Class::Emergency) {
            self.kept.clear();
        }
        if !matches!(class, Class::Sdo)
            && let Some(before) = self.open_request()
        {
            before.seen.push(Stamped { at: now, frame: *frame, own: false });
        }
        if self.model.state() == NmtState::OPERATIONAL {
            self.operational = now;
        }
        let mut streams = std::mem::take(&mut self.streams);
        let like = |model: &Frame| self.is_said_by(&class, frame, model, None);
        // An answer may look like what is sent by itself, as that of guarding does, and so may a
        // TPDO that SYNC triggers after it was sent by its event timer.
        let is_awaited = self.queues.awaits_exactly(frame)
            || self.period(&class, frame).is_none()
                && self
                    .queues
                    .awaits_one(frame.id, |it| self.is_said_by(&class, frame, &it.frame, it.of));
        let taken = match is_awaited {
            true => Taken::Unknown,
            false => streams.take(now, frame, self.late(), like),
        };
        self.streams = streams;
        match taken {
            Taken::InTime => return Ok(()),
            // An event of the application has its own frame.
            Taken::TooOften if matches!(&class, Class::Tpdo(tpdo) if self.is_free(tpdo)) => {
                return Ok(());
            }
            Taken::TooOften => return self.accuse(now, What::Unexpected(*frame, None)),
            Taken::Unknown => {}
        }
        let mut queues = std::mem::take(&mut self.queues);
        let like = |it: &Expected| self.is_like(&class, frame, &it.frame, it.of);
        let found = queues.find(now, frame, like);
        self.queues = queues;
        match found {
            Ok(Expected { frame: expected, of, .. }) => {
                self.confirm_kept(frame, &expected);
                // Until then, a device that serves requests late may have sent by what was before.
                let confirmed = matches!(class, Class::Sdo);
                let tpdo = sdo::configured(frame, of, &self.requests).filter(|_| confirmed);
                self.configured.extend(tpdo.map(|tpdo| (tpdo, now)));
                self.queues.came(frame, now);
                self.follow(now, &class, frame, &expected, of)
            }
            Err(expected) => self.surprise(now, &class, frame, expected),
        }
    }

    /// Notes an object of the application that was written to its end, and keeps it.
    fn confirm_kept(&mut self, frame: &Frame, expected: &Frame) {
        let node = self.model.id();
        let last = self.requests.last().filter(|request| request.is_confirmed_by(frame, node));
        let Some(mux) = last.and_then(Request::writes) else { return };
        let entry = self.blueprint.eds().entry(mux);
        let is_text = entry.is_some_and(|entry| self.blueprint.is_text(entry));
        if frame == expected && !self.model.transfers() {
            self.texts.extend(is_text.then_some(mux));
            self.kept.extend(self.blueprint.keeps(mux).then_some(mux));
        }
    }

    /// Whether an upload begins of an object of any length that nobody but the application has
    /// written since the last reset, and that has another length than in the model.
    fn has_another_length(&self, frame: &Frame, expected: &Frame) -> bool {
        sdo::resized(frame, expected).is_some_and(|mux| self.is_free_text(mux))
    }

    /// Whether nobody but the application knows the length of an object.
    fn is_free_text(&self, mux: Mux) -> bool {
        let unheard = self.blueprint.listens() && !self.known.is_written(mux);
        let free = |entry: &Entry| {
            let alone = !entry.access.writable() || self.blueprint.is_text(entry) || unheard;
            alone && entry.data_type.size().is_none()
        };
        self.is_volatile(mux) && self.blueprint.eds().entry(mux).is_some_and(free)
    }

    /// Whether an upload of such an object begins, with a length that the model may not have.
    fn begins_free_text(&self, frame: &Frame) -> bool {
        sdo::resizable(frame).is_some_and(|mux| self.is_free_text(mux))
    }

    /// Whether a frame is as good as the one that is expected.
    fn is_like(
        &self,
        class: &Class,
        frame: &Frame,
        expected: &Frame,
        of: Option<Transfer>,
    ) -> bool {
        match class {
            Class::Sdo if self.refused && sdo::same_code(frame, expected) => true,
            Class::Sdo => {
                sdo::is_like(frame, expected, of, &self.requests, &|mux| self.is_volatile(mux))
                    && self.agrees_in_time(frame, expected, of)
            }
            Class::Tpdo(tpdo) => {
                let same = frame.data.len() == expected.data.len() && !frame.remote;
                let open = |mux: Mux| self.is_volatile(mux);
                // A device in its own time may have packed its values a moment before.
                let known = !self.blueprint.is_prompt() || tpdo.agree(frame, expected, open);
                same && known && tpdo.mapped.iter().any(|mux| self.is_volatile(*mux))
            }
            Class::Emergency => self.errors && frame.data.get(..2) == expected.data.get(..2),
            Class::Other => {
                let counts = self.is_time(frame) || self.period(class, frame).is_some();
                counts && frame.data.len() == expected.data.len() && !frame.remote
            }
            Class::ErrorControl | Class::Lss => false,
        }
    }

    /// Brings the model up to date with what the application of the device has decided.
    fn follow(
        &mut self,
        now: Instant,
        class: &Class,
        frame: &Frame,
        expected: &Frame,
        of: Option<Transfer>,
    ) -> Result<(), End> {
        if matches!(class, Class::Sdo) {
            self.learn(frame, expected, of);
        }
        if frame == expected || !matches!(class, Class::Sdo) {
            return Ok(());
        }
        let refused = sdo::end(frame, self.model.id());
        if let Some(end) = &refused {
            self.model.take(now, end).for_each(drop);
            self.refused = true;
        }
        let Some((mux, value)) = sdo::followed(frame, expected, &self.requests) else {
            return Ok(());
        };
        if refused.is_some() && sdo::leaves_open(mux, &self.requests) {
            return Err(End::Void(now));
        }
        if refused.is_some() && !self.blueprint.is_of_application(mux) {
            return self.undo(now, mux);
        }
        self.texts.remove(&mux);
        self.kept.remove(&mux);
        self.model.follow(mux, &value);
        self.followed.insert(mux);
        Ok(())
    }

    /// Takes note of the value of an object that an answer shows.
    fn learn(&mut self, frame: &Frame, expected: &Frame, of: Option<Transfer>) {
        if let Some((mux, value)) = sdo::read(frame).filter(|(mux, _)| self.known.lacks(*mux)) {
            match frame == expected {
                true => self.known.is_stored(mux, value),
                false => self.learnt = Some((mux, value)),
            }
        }
        let confirms = frame == expected && !self.model.transfers() && !sdo::refuses(frame);
        if let Some(mux) = sdo::written(frame, of, &self.requests).filter(|_| confirms) {
            self.known.wrote(mux, self.model.dictionary());
        }
    }

    /// An object that has another value than the model has, which nobody has written since the
    /// device booted.
    pub(crate) fn learnt(&self) -> Option<(Mux, Data)> {
        self.learnt
    }

    /// The values that the device is known to have after a reset.
    pub(crate) fn boot_values(&self) -> &BTreeMap<Mux, Data> {
        self.known.boot()
    }

    /// Whether the application has reported an error.
    pub(crate) const fn has_errors(&self) -> bool {
        self.errors
    }

    /// Whether a frame is one that must come next.
    pub(crate) fn awaits_exactly(&self, frame: &Frame) -> bool {
        self.queues.awaits_exactly(frame)
    }

    /// Takes the model from before a request that the device refuses, and judges by it what was
    /// seen since.
    ///
    /// # Errors
    /// When it has taken other frames since, or one of the device was wrong.
    fn undo(&mut self, now: Instant, mux: Mux) -> Result<(), End> {
        let Some(before) = self.requests.undone(mux) else {
            return Err(End::Void(now));
        };
        if self.taken != before.taken + 1 {
            return Err(End::Void(now));
        }
        (self.model, self.queues, self.streams) = (before.model, before.queues, before.streams);
        self.early = before.early;
        self.identifiers.forget();
        for stamped in before.seen {
            self.advance(stamped.at)?;
            self.judge(stamped.at, &stamped.frame)?;
        }
        self.advance(now)
    }

    /// The request that the device has not answered yet and may refuse, which the model has not.
    fn open_request(&mut self) -> Option<&mut Before> {
        let taken = self.taken;
        let id = RESPONSE_COB_ID + u16::from(self.model.id());
        let open = self.queues.awaits(id);
        let before = self.requests.last_mut()?.before_it.as_deref_mut();
        before.filter(|before| open && taken == before.taken + 1)
    }

    /// Judges a frame that the model does not send.
    fn surprise(
        &mut self,
        now: Instant,
        class: &Class,
        frame: &Frame,
        expected: Option<Frame>,
    ) -> Result<(), End> {
        if let Some(expected) = expected.filter(|it| self.shows_an_error(class, frame, it)) {
            let violation = Violation { at: now, what: What::Unexpected(*frame, Some(expected)) };
            self.suspicion =
                Some(Suspicion { until: now + self.usually_late().max(HELD), violation });
            self.errors = true;
            return self.judge(now, frame);
        }
        match class {
            Class::Tpdo(tpdo)
                if self.is_free(tpdo)
                    && frame.data.len() == tpdo.bytes
                    && now.since(self.operational) <= self.usually_late().max(HELD) =>
            {
                // What is started or configured may send at once.
                let anew = self.anew(tpdo);
                let last = self.queues.last(frame).filter(|last| *last > anew);
                self.queues.came(frame, now);
                let gap = last.map(|last| now.since(last));
                let inhibit = tpdo.inhibit.saturating_sub(self.late());
                match gap.filter(|gap| tpdo.kind >= 254 && *gap < inhibit) {
                    Some(gap) => self.accuse(now, What::Inhibited(*frame, gap)),
                    None => Ok(()),
                }
            }
            // On what SYNC a device without 1005h acts is not in its data sheet.
            Class::Tpdo(tpdo) if tpdo.kind <= 240 && !self.model.dictionary().has_object(SYNC) => {
                Ok(())
            }
            // Whatever the application says, it says in eight bytes.
            Class::Emergency if frame.data.len() != 8 => {
                self.accuse(now, What::Unexpected(*frame, expected))
            }
            Class::Emergency if !self.blueprint.knows_emergencies() => Ok(()),
            Class::Emergency if self.is_of_application(frame) => {
                (self.errors, self.suspicion) = (true, None);
                Ok(())
            }
            // The application may have led its device to another state.
            Class::Sdo if sdo::is_refusal(frame, &self.requests) => Err(End::Void(now)),
            // It is the frame of another station, which the device has got as well.
            Class::Other if self.blueprint.shares_its_bus() => match self.held {
                Some(_) => Ok(()),
                None => self.take(now, frame),
            },
            // When its SDO client asks, and what, the application decides.
            Class::Other if self.is_of_client(frame) => Ok(()),
            // An error of the application, of which there was no message.
            Class::Sdo
                if self.blueprint.listens()
                    && !self.errors
                    && sdo::read(frame).is_some_and(|(mux, _)| mux.index == ERROR_REGISTER)
                    && expected.is_some_and(|it| sdo::read(&it).is_some()) =>
            {
                self.errors = true;
                self.judge(now, frame)
            }
            // It is the device, which has another node id now.
            Class::Other if self.blueprint.listens() && self.is_of_another(frame) => {
                Err(End::Void(now))
            }
            // Nobody but the application knows how long its text is now.
            Class::Sdo if expected.is_some_and(|it| self.has_another_length(frame, &it)) => {
                Err(End::Void(now))
            }
            Class::Sdo if expected.is_some() => {
                self.accuse(now, What::Unexpected(*frame, expected))
            }
            Class::Sdo => self.unexpected(now, frame, expected),
            _ if self.errors => self.owed(now, What::Unexpected(*frame, expected)),
            _ => self.unexpected(now, frame, expected),
        }
    }

    /// Whether a frame would be as good as the one that is expected if the application had an
    /// error, which a device may show in its objects before it reports it.
    fn shows_an_error(&mut self, class: &Class, frame: &Frame, expected: &Frame) -> bool {
        if self.errors {
            return false;
        }
        self.errors = true;
        let is_like = self.is_like(class, frame, expected, None);
        self.errors = false;
        is_like
    }

    /// Whether a frame is a request of an SDO client of the device.
    fn is_of_client(&self, frame: &Frame) -> bool {
        let od = self.model.dictionary();
        let clients = od.entries_in(0x1280..=0x12FF).iter().filter(|entry| entry.mux.sub == 1);
        let mut cobs = clients.filter_map(|entry| Some(CobId(od.int(entry.mux)? as u32)));
        cobs.any(|cob| cob.valid() && frame.any_data_id() == Some(cob.can_id()))
    }

    /// Whether a frame is the boot-up message of a node that has another id.
    fn is_of_another(&self, frame: &Frame) -> bool {
        let nodes = heartbeat::COB_ID + 1..=heartbeat::COB_ID + 127;
        frame.data[..] == [0] && frame.data_id().is_some_and(|id| nodes.contains(&id))
    }

    /// A frame that the model has not sent. A device in its own time may be a little early, and one
    /// that refuses a request goes on as before, which its answer says later.
    fn unexpected(
        &mut self,
        now: Instant,
        frame: &Frame,
        expected: Option<Frame>,
    ) -> Result<(), End> {
        let early = match self.blueprint.is_prompt() {
            false => EARLY,
            true if self.open_request().is_some() || self.blueprint.listens() => LATE,
            true => return wrong(now, What::Unexpected(*frame, expected)),
        };
        self.early.push(Early { until: now + early, frame: *frame, expected });
        Ok(())
    }

    /// Whether an emergency message is none about the communication.
    fn is_of_application(&self, frame: &Frame) -> bool {
        let Ok(emcy) = Emcy::decode(&frame.data) else { return false };
        match emcy.code {
            // One that was there before anybody listened may end.
            EmcyCode::RESET => self.errors || self.blueprint.listens() && emcy.register == 0,
            // What a controller notices on the wire, no trace shows.
            code if self.blueprint.listens() && OF_CONTROLLER.contains(&code.0) => true,
            code => !code.is_of_communication(),
        }
    }

    fn overdue(&mut self, now: Instant) -> Result<(), End> {
        if let Some(suspicion) = self.suspicion.take_if(|it| it.until < now) {
            return Err(End::Violation(suspicion.violation));
        }
        while let Some(place) = self.early.iter().position(|early| early.until < now) {
            let Early { frame, expected, .. } = self.early.remove(place);
            if self.begins_free_text(&frame) {
                return Err(End::Void(now));
            }
            self.owed(now, What::Unexpected(frame, expected))?;
        }
        let late = self.late();
        while let Some(what) = self.queues.overdue(now, late) {
            self.owed(now, what)?;
        }
        Ok(())
    }

    /// Something is wrong that is nobody's business but the application's once it has reported an
    /// error.
    fn owed(&mut self, now: Instant, what: What) -> Result<(), End> {
        let runs_on = self.runs_on(now, &what);
        match (self.accuse(now, what), runs_on) {
            (Err(End::Violation(_)), Some(false)) if self.errors => Ok(()),
            (Err(End::Violation(_)), None) if self.errors => Err(End::Void(now)),
            (judged, _) => judged,
        }
    }

    /// Whether a device that somebody listens to reports OPERATIONAL after a command that leads out
    /// of it, and whether that is long ago: no error and no setting leads back there, whatever the
    /// period of its heartbeat is.
    fn runs_on(&mut self, now: Instant, what: &What) -> Option<bool> {
        let What::Unexpected(frame, _) = what else { return None };
        let at = self.led_out.filter(|_| self.blueprint.listens())?;
        let class = self.identifiers.class(frame, &self.model, now, self.usually_late());
        let says = ErrorControl::decode(&frame.data).ok()?.state;
        let runs = matches!(class, Class::ErrorControl) && says == NmtState::OPERATIONAL;
        runs.then(|| now.since(at) > LONG_AFTER)
    }

    /// Something is wrong, if nothing is unknown on which it depends.
    fn accuse(&mut self, now: Instant, what: What) -> Result<(), End> {
        let frame = match what {
            What::Unexpected(frame, _) | What::Missing(frame, _) | What::Inhibited(frame, _) => {
                frame
            }
            What::Ended(_) | What::Differs(_) => return wrong(now, what),
        };
        let class = self.identifiers.class(&frame, &self.model, now, self.usually_late());
        let written = sdo::written(&frame, None, &self.requests);
        let refused = match &what {
            What::Unexpected(it, Some(other)) => sdo::refuses(it) != sdo::refuses(other),
            _ => false,
        };
        let written = written.filter(|_| refused && matches!(class, Class::Sdo));
        if written.is_some_and(|mux| !self.known.decides_write(mux)) {
            return Err(End::Void(now));
        }
        if matches!(class, Class::Sdo) && self.known.is_joined() && self.requests.last().is_none() {
            return Err(End::Void(now));
        }
        if self.known.decides(&class, &what, &self.model) {
            return wrong(now, what);
        }
        let runs_on = self.runs_on(now, &what);
        let reports = matches!(class, Class::ErrorControl);
        let says = ErrorControl::decode(&frame.data).ok().filter(|_| reports).map(|it| it.state);
        if says.is_none_or(|state| state == self.model.state()) {
            return Ok(());
        }
        match runs_on {
            Some(true) => wrong(now, what),
            // It may have been on its way.
            Some(false) => Ok(()),
            // The device is in a state that somebody has not seen it enter.
            None => Err(End::Void(now)),
        }
    }
}

/// How the model boots after a command, or after power-on.
pub(crate) fn boots_in(model: &Model, now: Instant, command: Option<&Frame>) -> Option<Boot> {
    let mut model = model.clone();
    match command {
        Some(command) => model.take(now, command).for_each(drop),
        None => model.start(now),
    }
    while let Some(due) = model.due_before(now + START) {
        let sent: Vec<Frame> = model.poll(due).collect();
        let node = model.id();
        if sent.contains(&ErrorControl::BOOT_UP.frame(node)) {
            return Some(Boot { takes: due.since(now), node });
        }
    }
    None
}

fn wrong(at: Instant, what: What) -> Result<(), End> {
    Err(End::Violation(Violation { at, what }))
}

/// Whether a frame resets a node.
pub(crate) fn is_reset(frame: &Frame, node: u8) -> bool {
    let command = Command::decode(&frame.data).ok();
    let resets = [Service::RESET_NODE, Service::RESET_COMMUNICATION];
    commands(frame, node) && command.is_some_and(|it| resets.contains(&it.service))
}

/// Whether a frame commands a node to enter a state.
fn commands(frame: &Frame, node: u8) -> bool {
    let command = Command::decode(&frame.data).ok();
    frame.data_id() == Some(nmt::COB_ID) && command.is_some_and(|it| [0, node].contains(&it.node))
}

/// The identifier of heartbeat and boot-up of a node.
pub(crate) fn error_control(node: u8) -> u16 {
    heartbeat::COB_ID + u16::from(node)
}

/// How much later than the model the device may send a frame that waits for nothing but the wire.
const LATE: Duration = Duration::from_millis(8);
/// The same for a device in its own time.
const LATE_ON_BUS: Duration = Duration::from_millis(250);
/// How long after a command a device is in the state that it commands, however late it is.
const LONG_AFTER: Duration = Duration::from_secs(1);
/// How much longer an answer to a request may take there, and a boot-up message.
const ANSWER: Duration = Duration::from_millis(750);
const START: Duration = Duration::from_secs(5);
/// How much earlier than the model it may send what is not an answer.
const EARLY: Duration = Duration::from_millis(60);
/// In the COB-ID of SYNC: the device produces it.
const SYNC_PRODUCER: u32 = 1 << 30;
const SYNC: u16 = 0x1005;
const TIME: u16 = 0x1012;
/// How much of what a model does by itself is looked at to see whether it will say something.
const MOST_AHEAD: usize = 256;
const TIME_CONSUMER: u32 = 1 << 31;
const SYNC_PERIOD: u16 = 0x1006;
const HEARTBEAT: u16 = 0x1017;
/// Emergency error codes of a CAN controller: overrun, error passive, recovered from bus-off,
/// identifier collision.
const OF_CONTROLLER: [u16; 4] = [0x8110, 0x8120, 0x8140, 0x8150];
const ERROR_REGISTER: u16 = 0x1001;
const STATUS_REGISTER: u16 = 0x1002;
const HISTORY: u16 = 0x1003;
const HIGH_RESOLUTION: u16 = 0x1013;
/// The data sheet that a device keeps, which may tell present values.
const STORED_SHEET: u16 = 0x1021;

#[cfg(test)]
mod tests {
    use canopen::nmt::{Command, Service};

    use super::is_reset;

    #[test]
    fn a_reset_of_another_node_is_none() {
        for service in [Service::RESET_NODE, Service::RESET_COMMUNICATION] {
            let resets = |node| is_reset(&Command { service, node }.frame(), 2);
            assert_eq!([0, 2, 3].map(resets), [true, true, false]);
        }
        assert!(!is_reset(&Command { service: Service::START, node: 2 }.frame(), 2));
    }
}
