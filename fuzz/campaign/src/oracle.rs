//! The judge: a model gets the frames that the device got, and each frame of the device must be one
//! of the model's, in its order and in time.
//!
//! What the application of a device decides is left out where it is not known: values of its
//! objects are compared by their length, and the model follows them; TPDOs that map them come when
//! they like; it may refuse what is written to it, and report errors of its own.

mod expected;
mod identifiers;
mod sdo;

use std::collections::BTreeSet;
use std::fmt;
use std::time::Duration;

use canopen::emcy::{Emcy, EmcyCode};
use canopen::nmt::{self, Command, Service};
use canopen::{Frame, Instant, Mux, NmtState, Stamped, heartbeat};
use reference_devices::change::Replica;

use crate::blueprint::Blueprint;
use crate::model::Model;
use expected::{Expected, Must, Queues};
use identifiers::{Class, Identifiers};
use sdo::Request;

/// Something that happened on the bus or on the bench.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Seen {
    /// A frame.
    Frame(Stamped),
    /// The supply was switched.
    Power(Instant, bool),
    /// Nothing until then.
    Until(Instant),
}

/// What is wrong with a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Violation {
    /// When it was noticed.
    pub at: Instant,
    /// What it is.
    pub what: What,
}

/// What is wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum What {
    /// A frame that is not the next one of its identifier, and the one that should have come.
    Unexpected(Frame, Option<Frame>),
    /// A frame that did not come, and when it was due.
    Missing(Frame, Instant),
    /// An event-driven TPDO came again within its inhibit time.
    Inhibited(Frame, Duration),
}

impl Violation {
    /// Whether two sessions show the same.
    pub fn is_like(&self, other: &Self) -> bool {
        self.kind() == other.kind()
    }

    /// What it is, without values and times: `unexpected-582` or `missing-702`.
    pub fn kind(&self) -> String {
        let command = |frame: &Frame| frame.data.first().map_or(0, |command| command >> 5);
        match self.what {
            What::Unexpected(frame, None) => format!("unexpected-{}", frame.id),
            What::Unexpected(frame, Some(other)) => {
                format!("unexpected-{}-{}-for-{}", frame.id, command(&frame), command(&other))
            }
            What::Missing(frame, _) => format!("missing-{}", frame.id),
            What::Inhibited(frame, _) => format!("inhibited-{}", frame.id),
        }
    }
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.what {
            What::Unexpected(frame, Some(other)) => write!(f, "{frame} instead of {other}"),
            What::Unexpected(frame, None) => write!(f, "{frame} without a cause"),
            What::Missing(frame, due) => write!(f, "no {frame}, due at {due} s"),
            What::Inhibited(frame, gap) => {
                write!(f, "{frame} {gap:?} after the last one, within its inhibit time")
            }
        }
    }
}

/// Why a session is not judged any further.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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
    /// The last two requests: what looks like a request may be a segment of a block.
    requests: [Option<Request>; 2],
    /// Since when the bus has been busy, and when it last was.
    busy: (Instant, Instant),
    /// Whether the device has refused a transfer of which the model knows nothing.
    refused: bool,
    /// How many frames the model has taken.
    taken: u64,
    /// When the model was last OPERATIONAL.
    operational: Instant,
    /// The application has reported an error.
    errors: bool,
    /// Objects that the application has given other values than the network has.
    followed: BTreeSet<Mux>,
}

impl<'b> Oracle<'b> {
    /// The judge of a device that is like `device`, both of which are switched on at time 0.
    pub fn new(blueprint: &'b Blueprint, device: Box<dyn Replica>) -> Self {
        let node = blueprint.node();
        Self {
            blueprint,
            model: Model::new(device),
            now: Instant::ZERO,
            queues: Queues::default(),
            identifiers: Identifiers::new(node),
            requests: [None, None],
            busy: (Instant::ZERO, Instant::ZERO),
            refused: false,
            taken: 0,
            operational: Instant::ZERO,
            errors: blueprint.has_errors(),
            followed: BTreeSet::new(),
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
                    self.take(stamped.at, &stamped.frame);
                    Ok(())
                } else {
                    self.judge(stamped.at, &stamped.frame)
                }
            }
            Seen::Until(at) => self.advance(Instant(at.0.saturating_add(1))),
            Seen::Power(at, on) => {
                self.advance(Instant(at.0.saturating_add(1)))?;
                self.model.power(at, on);
                self.requests = [None, None];
                self.queues.release();
                Ok(())
            }
        }
    }

    /// Lets the model act on everything before `to`.
    fn advance(&mut self, to: Instant) -> Result<(), End> {
        while let Some(due) = self.model.due_before(to) {
            self.overdue(due)?;
            let sent: Vec<Frame> = self.model.poll(due).collect();
            self.now = due;
            sent.into_iter().for_each(|frame| self.expect(due, frame));
        }
        self.now = self.now.max(to);
        if self.model.state() == NmtState::OPERATIONAL {
            self.operational = self.now;
        }
        self.overdue(to)
    }

    fn take(&mut self, now: Instant, frame: &Frame) {
        if let Some(request) = sdo::request(frame, self.blueprint, &self.model, self.taken) {
            let [_, last] = std::mem::take(&mut self.requests);
            self.requests = [last, Some(request)];
            self.refused = false;
        }
        self.taken += 1;
        if is_reset(frame) {
            self.queues.release();
        }
        let sent: Vec<Frame> = self.model.take(now, frame).collect();
        sent.into_iter().for_each(|frame| self.expect(now, frame));
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
        LATE + waits
    }

    /// Notes a frame of the model.
    fn expect(&mut self, now: Instant, frame: Frame) {
        let class = self.identifiers.class(&frame, &self.model, now, LATE);
        let must = match class {
            Class::Tpdo(tpdo) if self.is_free(&tpdo) => match tpdo.period.is_zero() {
                true => Must::Not,
                false => Must::Within(tpdo.period),
            },
            Class::Emergency if self.errors || !self.blueprint.knows_emergencies() => Must::Not,
            _ => Must::Come,
        };
        self.queues.expect(Expected { at: now, frame, must });
    }

    /// Whether the application decides when a TPDO comes.
    fn is_free(&self, tpdo: &identifiers::Tpdo) -> bool {
        let mut mapped = tpdo.mapped.iter();
        matches!(tpdo.kind, 0 | 254..) && mapped.any(|mux| self.is_volatile(*mux))
    }

    /// Whether the value of an object is compared by its length.
    fn is_volatile(&self, mux: Mux) -> bool {
        self.blueprint.is_of_application(mux)
            || match mux.index {
                STATUS_REGISTER | HIGH_RESOLUTION => true,
                ERROR_REGISTER | HISTORY => self.errors || !self.blueprint.knows_emergencies(),
                _ => false,
            }
    }

    /// Judges a frame of the device.
    fn judge(&mut self, now: Instant, frame: &Frame) -> Result<(), End> {
        let class = self.identifiers.class(frame, &self.model, now, LATE);
        if self.model.state() == NmtState::OPERATIONAL {
            self.operational = now;
        }
        let mut queues = std::mem::take(&mut self.queues);
        let found = queues.find(now, frame, |expected| self.is_like(&class, frame, expected));
        self.queues = queues;
        match found {
            Ok(expected) => {
                self.queues.came(frame, now);
                self.follow(now, &class, frame, &expected)
            }
            Err(expected) => self.surprise(now, &class, frame, expected),
        }
    }

    /// Whether a frame is as good as the one that is expected.
    fn is_like(&self, class: &Class, frame: &Frame, expected: &Frame) -> bool {
        match class {
            Class::Sdo if self.refused && sdo::same_code(frame, expected) => true,
            Class::Sdo => {
                sdo::is_like(frame, expected, &self.requests, &|mux| self.is_volatile(mux))
            }
            Class::Tpdo(tpdo) => {
                let same = frame.data.len() == expected.data.len() && !frame.remote;
                same && tpdo.mapped.iter().any(|mux| self.is_volatile(*mux))
            }
            Class::Emergency => self.errors && frame.data.get(..2) == expected.data.get(..2),
            Class::ErrorControl | Class::Lss | Class::Other => false,
        }
    }

    /// Brings the model up to date with what the application of the device has decided.
    fn follow(
        &mut self,
        now: Instant,
        class: &Class,
        frame: &Frame,
        expected: &Frame,
    ) -> Result<(), End> {
        if frame == expected || !matches!(class, Class::Sdo) {
            return Ok(());
        }
        let refused = sdo::end(frame, self.blueprint.node());
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
        self.model.follow(mux, &value);
        self.followed.insert(mux);
        Ok(())
    }

    /// Takes the model from before a request that the device refuses.
    ///
    /// # Errors
    /// When it has taken other frames since.
    fn undo(&mut self, now: Instant, mux: Mux) -> Result<(), End> {
        let mut requests = self.requests.iter_mut().flatten().rev();
        let Some((model, taken)) = requests.find_map(|request| request.undone(mux)) else {
            return Err(End::Void(now));
        };
        if self.taken != taken + 1 {
            return Err(End::Void(now));
        }
        self.model = model;
        self.identifiers.forget();
        while let Some(due) = self.model.due_before(now) {
            self.model.poll(due).for_each(drop);
        }
        Ok(())
    }

    /// Judges a frame that the model does not send.
    fn surprise(
        &mut self,
        now: Instant,
        class: &Class,
        frame: &Frame,
        expected: Option<Frame>,
    ) -> Result<(), End> {
        match class {
            Class::Tpdo(tpdo)
                if self.is_free(tpdo)
                    && frame.data.len() == tpdo.bytes
                    && now.since(self.operational) <= LATE =>
            {
                let last = self.queues.last(frame);
                self.queues.came(frame, now);
                let gap = last.map(|last| now.since(last));
                let inhibit = tpdo.inhibit.saturating_sub(self.late());
                match gap.filter(|gap| tpdo.kind >= 254 && *gap < inhibit) {
                    Some(gap) => wrong(now, What::Inhibited(*frame, gap)),
                    None => Ok(()),
                }
            }
            Class::Emergency if !self.blueprint.knows_emergencies() => match frame.data.len() {
                8 => Ok(()),
                _ => self.unexpected(now, frame, expected),
            },
            Class::Emergency if self.is_of_application(frame) => {
                self.errors = true;
                Ok(())
            }
            // The application may have led its device to another state.
            Class::Sdo if sdo::is_refusal(frame, &self.requests) => Err(End::Void(now)),
            Class::Sdo => self.unexpected(now, frame, expected),
            _ if self.errors => Err(End::Void(now)),
            _ => self.unexpected(now, frame, expected),
        }
    }

    fn unexpected(
        &mut self,
        now: Instant,
        frame: &Frame,
        expected: Option<Frame>,
    ) -> Result<(), End> {
        wrong(now, What::Unexpected(*frame, expected))
    }

    /// Whether an emergency message is none about the communication.
    fn is_of_application(&self, frame: &Frame) -> bool {
        let Ok(emcy) = Emcy::decode(&frame.data) else { return false };
        match emcy.code {
            EmcyCode::RESET => self.errors,
            code => !matches!(code.0 >> 8, 0x81 | 0x82),
        }
    }

    fn overdue(&mut self, now: Instant) -> Result<(), End> {
        let late = self.late();
        if let Some(what) = self.queues.overdue(now, late) {
            return match self.errors {
                true => Err(End::Void(now)),
                false => wrong(now, what),
            };
        }
        Ok(())
    }
}

fn wrong(at: Instant, what: What) -> Result<(), End> {
    Err(End::Violation(Violation { at, what }))
}

fn is_reset(frame: &Frame) -> bool {
    let command = Command::decode(&frame.data).ok();
    let resets = [Service::RESET_NODE, Service::RESET_COMMUNICATION];
    frame.data_id() == Some(nmt::COB_ID) && command.is_some_and(|it| resets.contains(&it.service))
}

/// The identifier of heartbeat and boot-up of a node.
pub(crate) fn error_control(node: u8) -> u16 {
    heartbeat::COB_ID + u16::from(node)
}

/// How much later than the model the device may send a frame that waits for nothing but the wire.
const LATE: Duration = Duration::from_millis(8);
const ERROR_REGISTER: u16 = 0x1001;
const STATUS_REGISTER: u16 = 0x1002;
const HISTORY: u16 = 0x1003;
const HIGH_RESOLUTION: u16 = 0x1013;
