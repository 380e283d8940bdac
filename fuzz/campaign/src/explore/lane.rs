//! A replica of the device that gets what the device got, as early or as late as is wanted.

use std::collections::VecDeque;
use std::time::Duration;

use canopen::sdo::RESPONSE_COB_ID;
use canopen::{Dictionary, Frame, Id, Instant, Value};
use canopen::{emcy, nmt};
use reference_devices::change::Replica;

use crate::model::Model;
use crate::oracle::{Seen, error_control};

/// How long a frame may wait for the wire.
pub(super) const GRACE: Duration = Duration::from_millis(20);

/// A replica beside the device.
#[derive(Clone)]
pub(super) struct Lane {
    model: Model,
    node: u8,
    /// By how many nanoseconds its clock is ahead.
    clock: i64,
    /// What it answered and the device has not yet.
    answers: VecDeque<Frame>,
    /// Its emergency messages that the device has not sent yet.
    emergencies: VecDeque<Sent>,
    /// What it sent besides, since the last look but one.
    sent: Vec<Sent>,
}

/// A frame of a replica.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sent {
    pub(super) at: Instant,
    pub(super) frame: Frame,
    /// Whether the device may have lost it: a restart forgets what waits for the wire.
    pub(super) may_be_lost: bool,
}

impl Lane {
    /// A replica whose clock is ahead by some nanoseconds. All times here are those of the tester.
    pub(super) fn new(device: Box<dyn Replica>, node: u8, clock: i64) -> Self {
        Self {
            model: Model::new(device),
            node,
            clock,
            answers: VecDeque::new(),
            emergencies: VecDeque::new(),
            sent: Vec::new(),
        }
    }

    /// Takes a frame or a stimulus of the tester.
    pub(super) fn give(&mut self, at: Instant, what: &Seen) {
        match what {
            Seen::Frame(stamped) => {
                self.advance(at);
                if stamped.frame.data_id() == Some(nmt::COB_ID) {
                    self.lose(at);
                }
                let sent: Vec<Frame> = self.model.take(self.there(at), &stamped.frame).collect();
                self.keep(at, sent);
            }
            Seen::Power(_, on) => {
                self.pass(at);
                self.lose(at);
                self.model.power(self.there(at), *on);
                self.answers.clear();
            }
            Seen::Stimulus(_, name, value) => {
                self.pass(at);
                self.lose(at);
                let sent = self.model.stimulate(self.there(at), name, value);
                self.keep(at, sent);
            }
            _ => {}
        }
    }

    /// Lets it act on everything before `to`.
    pub(super) fn advance(&mut self, to: Instant) {
        for (due, frame) in self.model.act_before(self.there(to)) {
            self.keep(Instant(due.0.saturating_add_signed(-self.clock)), [frame]);
        }
    }

    /// The time of its own clock.
    fn there(&self, at: Instant) -> Instant {
        Instant(at.0.saturating_add_signed(self.clock))
    }

    /// The same, with what is due at `to`.
    pub(super) fn pass(&mut self, to: Instant) {
        self.advance(Instant(to.0.saturating_add(1)));
    }

    /// What may still wait for the wire may be lost.
    fn lose(&mut self, at: Instant) {
        let all = self.emergencies.iter_mut().chain(&mut self.sent);
        all.filter(|sent| sent.at + GRACE >= at).for_each(|sent| sent.may_be_lost = true);
    }

    fn keep(&mut self, at: Instant, frames: impl IntoIterator<Item = Frame>) {
        for frame in frames {
            let sent = Sent { at, frame, may_be_lost: false };
            match frame.data_id() {
                Some(id) if id == RESPONSE_COB_ID + u16::from(self.node) => {
                    self.answers.push_back(frame);
                }
                Some(id) if id == emcy::COB_ID + u16::from(self.node) => {
                    self.emergencies.push_back(sent);
                }
                _ => self.sent.push(sent),
            }
        }
    }

    /// Its answer to a request that it gets now.
    pub(super) fn asked(&mut self, now: Instant, request: &Frame) -> Option<Frame> {
        self.answers.clear();
        let sent: Vec<Frame> = self.model.take(self.there(now), request).collect();
        self.keep(now, sent);
        self.answer()
    }

    /// Its next answer.
    pub(super) fn answer(&mut self) -> Option<Frame> {
        self.answers.pop_front()
    }

    /// Whether it has told the same by `at`, where what it told since `earlier` may still come.
    ///
    /// # Errors
    /// What it tells at the first place where it tells something else, and what the device did.
    pub(super) fn tells(
        &mut self,
        told: &[Frame],
        at: Instant,
        earlier: Instant,
    ) -> Result<(), (Option<Frame>, Option<Frame>)> {
        let due = self.emergencies.iter().take_while(|next| next.at <= at).count();
        let next: Vec<Sent> = self.emergencies.drain(..due).collect();
        // How many of those of the device the ones up to here may be.
        let mut reached = vec![false; told.len() + 1];
        reached[0] = true;
        for sent in &next {
            for count in (0..reached.len()).rev() {
                let is_next = count > 0 && reached[count - 1] && told[count - 1] == sent.frame;
                let is_left_out = reached[count] && (sent.may_be_lost || sent.at >= earlier);
                reached[count] = is_next || is_left_out;
            }
        }
        // What has just been sent may come later.
        let waits = next.iter().filter(|sent| sent.at >= earlier);
        let waits: Vec<Sent> = waits.map(|sent| Sent { may_be_lost: true, ..*sent }).collect();
        waits.into_iter().rev().for_each(|sent| self.emergencies.push_front(sent));
        if reached[told.len()] {
            return Ok(());
        }
        let is_other =
            |place: &usize| next.get(*place).map(|it| it.frame) != told.get(*place).copied();
        let place = (0..=told.len()).find(is_other).unwrap_or(told.len());
        Err((next.get(place).map(|sent| sent.frame), told.get(place).copied()))
    }

    /// When its last boot-up message was due.
    pub(super) fn boot_up(&self) -> Option<Instant> {
        let id = Id::standard(error_control(self.node));
        let is_boot_up = |sent: &&Sent| sent.frame.id == id && sent.frame.data.first() == Some(&0);
        self.sent.iter().rev().find(is_boot_up).map(|sent| sent.at)
    }

    /// What is to be seen on the bench.
    pub(super) fn observe(&self, name: &str) -> Option<Value> {
        self.model.observe(name)
    }

    pub(super) fn dictionary(&self) -> &Dictionary {
        self.model.dictionary()
    }

    /// What it sent with an identifier by the time `at`, with the times.
    pub(super) fn sent(&self, id: Id) -> impl Iterator<Item = &Sent> {
        self.sent.iter().filter(move |sent| sent.frame.id == id)
    }

    /// The identifiers of what it sent.
    pub(super) fn identifiers(&self) -> impl Iterator<Item = Id> + '_ {
        self.sent.iter().map(|sent| sent.frame.id)
    }

    /// Forgets what it sent before `at`.
    pub(super) fn forget(&mut self, at: Instant) {
        self.sent.retain(|sent| sent.at >= at);
    }

    /// Whether a frame is one of error control.
    pub(super) fn is_error_control(&self, id: Id) -> bool {
        id == Id::standard(error_control(self.node))
    }
}
