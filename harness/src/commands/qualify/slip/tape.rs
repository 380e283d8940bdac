//! A bus on which a device slips, and what was heard on it.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::rc::Rc;

use canopen::bench::Needs;
use canopen::sdo::RESPONSE_COB_ID;
use canopen::{Bench, BenchError, Bus, BusError, Frame, Id, Instant, Stamped, Value};
use runner::plan::Scope;
use runner::run::{Observer, Shown};
use runner::suite::constraint::Constraint;

use super::model::{Fate, Slip};
use super::scene::{Heard, Moment};

/// A bus with a device that slips as the tape says.
pub(crate) struct SlippingBus {
    bus: Box<dyn Bus>,
    tape: Rc<Tape>,
}

/// The slip in the case that runs, and the frames heard since its steps began.
#[derive(Default)]
pub(crate) struct Tape(RefCell<Recording>);

#[derive(Default)]
struct Recording {
    slip: Slip,
    /// When the steps began; `None` before and after them.
    begin: Option<Instant>,
    step: usize,
    /// How many frames the device sent in the step, by identifier.
    counts: BTreeMap<Id, u32>,
    /// The delayed frames, each with the time at which it arrives.
    under_way: Vec<(Instant, Frame)>,
    heard: Vec<Heard>,
    moments: Vec<Moment>,
    /// The last request of the tester.
    request: Option<Frame>,
    shown: Shown,
    open: Option<Part>,
    /// The answers of the SDO server on a device that does not slip, by step.
    in_order: Rc<Answers>,
    /// How many of them the step that runs had.
    answered: usize,
    answers: Option<Id>,
}

/// The answers of an SDO server, by step.
pub(crate) type Answers = BTreeMap<usize, Vec<Frame>>;

/// A part of a step, the whole when there is none.
pub(crate) type Part = (usize, Option<Constraint>);

impl Tape {
    /// Begins a case, with its slip, the part that does not count, and the answers of a device
    /// without deviation.
    pub(crate) fn begin(
        &self,
        slip: Slip,
        open: Option<Part>,
        (node, in_order): (u8, Rc<Answers>),
    ) {
        let answers = Some(Id::standard(RESPONSE_COB_ID + u16::from(node)));
        *self.0.borrow_mut() = Recording { slip, open, in_order, answers, ..Recording::default() };
    }

    /// The results of the case, the frames heard in it, and its steps.
    pub(crate) fn end(&self) -> (Shown, Vec<Heard>, Vec<Moment>) {
        let recording = self.0.take();
        (recording.shown, recording.heard, recording.moments)
    }
}

impl Observer for Tape {
    fn goes_on(&self) -> bool {
        true
    }

    fn step_begins(&self, step: usize, from: Instant) {
        let recording = &mut *self.0.borrow_mut();
        (recording.step, recording.answered) = (step, 0);
        recording.counts.clear();
        if recording.begin.is_none() {
            recording.begin = Some(from);
            let unasked = std::mem::take(&mut recording.slip.unasked).into_iter();
            recording.under_way.extend(unasked.map(|(after, frame)| (from + after, frame)));
            recording.under_way.sort_by_key(|(at, _)| *at);
        }
        recording.moments.push(Moment { step, from, to: from, scope: Scope::default() });
    }

    fn step_ended(&self, _: usize, to: Instant, scope: &Scope) {
        if let Some(moment) = self.0.borrow_mut().moments.last_mut() {
            (moment.to, moment.scope) = (to, scope.clone());
        }
    }

    fn steps_over(&self) {
        let recording = &mut *self.0.borrow_mut();
        recording.begin = None;
        recording.under_way.clear();
    }

    fn opens(&self) -> Option<Part> {
        self.0.borrow().open.clone()
    }

    fn shows(&self, shown: Shown) {
        self.0.borrow_mut().shown = shown;
    }
}

impl Recording {
    /// Passes a frame of the bus through the slip; `None` when it does not arrive now.
    fn pass(&mut self, stamped: Stamped) -> Option<Stamped> {
        let Some(begin) = self.begin else { return Some(stamped) };
        let Stamped { at, frame, own } = stamped;
        let ordinal = match own {
            true => 0,
            false => {
                let count = self.counts.entry(frame.id).or_default();
                *count += 1;
                *count - 1
            }
        };
        let place = (self.step, ordinal);
        self.heard.push(Heard { at, frame, own, step: self.step, ordinal });
        if own {
            self.request = Some(frame);
            return Some(stamped);
        }
        let mut sent = frame;
        if Some(frame.id) == self.answers {
            let healed = self.slip.healed.is_some_and(|step| self.step > step);
            let same = self.in_order.get(&self.step).and_then(|all| all.get(self.answered));
            sent = same.copied().filter(|_| healed).unwrap_or(frame);
            self.answered += 1;
        }
        for change in &self.slip.changes {
            if change.id != frame.id || !(change.from..change.to).contains(&place) {
                continue;
            }
            let late = match &change.fate {
                Fate::Lost => return None,
                Fate::Edited(edit) => {
                    sent = edit.apply(&sent, self.request.as_ref());
                    continue;
                }
                Fate::Late(late) => *late,
                Fate::Slow(since, part) => at.since(begin).saturating_sub(*since).mul_f64(*part),
            };
            let due = at + late;
            let place = self.under_way.partition_point(|(other, _)| *other <= due);
            self.under_way.insert(place, (due, sent));
            return None;
        }
        Some(Stamped { frame: sent, ..stamped })
    }

    fn next(&self) -> Instant {
        self.under_way.first().map_or(Instant::NEVER, |(at, _)| *at)
    }
}

impl SlippingBus {
    /// Puts the tape between the bus and the tester.
    pub(crate) const fn new(bus: Box<dyn Bus>, tape: Rc<Tape>) -> Self {
        Self { bus, tape }
    }

    fn inner_bench(&mut self) -> Result<&mut dyn Bench, BenchError> {
        self.bus.bench().ok_or_else(|| BenchError::unknown("bench"))
    }
}

impl Bus for SlippingBus {
    fn now(&mut self) -> Instant {
        self.bus.now()
    }

    fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
        self.bus.send(frame)
    }

    fn recv(&mut self, until: Instant) -> Result<Option<Stamped>, BusError> {
        loop {
            let next = self.tape.0.borrow().next();
            let got = self.bus.recv(until.min(next))?;
            let recording = &mut *self.tape.0.borrow_mut();
            match got {
                Some(stamped) => {
                    if let Some(sent) = recording.pass(stamped) {
                        return Ok(Some(sent));
                    }
                }
                None if next <= until => {
                    let (_, frame) = recording.under_way.remove(0);
                    let at = next.max(self.bus.now());
                    return Ok(Some(Stamped { at, frame, own: false }));
                }
                None => return Ok(None),
            }
        }
    }

    fn bench(&mut self) -> Option<&mut dyn Bench> {
        match self.bus.bench().is_some() {
            true => Some(self),
            false => None,
        }
    }
}

impl Bench for SlippingBus {
    fn names(&mut self) -> Result<Vec<String>, BenchError> {
        self.inner_bench()?.names()
    }

    fn set(&mut self, name: &str, value: &Value) -> Result<(), BenchError> {
        self.inner_bench()?.set(name, value)
    }

    fn get(&mut self, name: &str) -> Result<Value, BenchError> {
        let seen = self.inner_bench()?.get(name)?;
        let recording = self.tape.0.borrow();
        Ok(match &recording.slip.observed {
            Some((step, odd)) if recording.begin.is_some() && *step == recording.step => {
                odd.of(&seen)
            }
            _ => seen,
        })
    }

    fn needs(&mut self) -> Result<Needs, BenchError> {
        self.inner_bench()?.needs()
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::super::edits::{Edit, Odd};
    use super::super::model::{Change, Slip};
    use super::*;

    /// A device that sends its frames 1 ms apart.
    struct Sends(Vec<Frame>, Instant);

    impl Bus for Sends {
        fn now(&mut self) -> Instant {
            self.1
        }
        fn send(&mut self, _: &Frame) -> Result<(), BusError> {
            Ok(())
        }
        fn recv(&mut self, until: Instant) -> Result<Option<Stamped>, BusError> {
            let next = self.1 + Duration::from_millis(1);
            if self.0.is_empty() || next > until {
                self.1 = until;
                return Ok(None);
            }
            self.1 = next;
            Ok(Some(Stamped { at: next, frame: self.0.remove(0), own: false }))
        }
    }

    const ID: u16 = 0x185;

    /// How frames 1, 2 and 3 are heard, with times in milliseconds.
    fn heard(slip: Slip) -> Vec<(u64, u8)> {
        let frames = [1, 2, 3].map(|byte| Frame::new(ID, [byte])).to_vec();
        let tape = Rc::new(Tape::default());
        tape.begin(slip, None, (5, Rc::default()));
        tape.step_begins(0, Instant::ZERO);
        let mut bus = SlippingBus::new(Box::new(Sends(frames, Instant::ZERO)), tape);
        let until = Instant::ZERO + Duration::from_millis(20);
        let mut heard = Vec::new();
        while let Some(stamped) = bus.recv(until).unwrap() {
            heard.push((stamped.at.0 / 1_000_000, stamped.frame.data[0]));
        }
        heard
    }

    #[test]
    fn a_slip_happens_to_one_frame_or_to_all_from_there_on() {
        let ms = Duration::from_millis;
        let id = Id::standard(ID);
        let second = |fate| Change { id, from: (0, 1), to: (0, 2), fate };
        let slip = |fate| Slip::new("").with(second(fate));
        assert_eq!(heard(Slip::default()), [(1, 1), (2, 2), (3, 3)]);
        assert_eq!(heard(slip(Fate::Lost)), [(1, 1), (3, 3)]);
        assert_eq!(heard(slip(Fate::Late(ms(5)))), [(1, 1), (3, 3), (7, 2)]);
        let ones = Fate::Edited(Edit::Byte(0, Odd::Ones));
        assert_eq!(heard(slip(ones.clone())), [(1, 1), (2, 0xFF), (3, 3)]);
        let from = Change { to: (0, u32::MAX), ..second(ones.clone()) };
        assert_eq!(heard(Slip::new("").with(from.clone())), [(1, 1), (2, 0xFF), (3, 0xFF)]);
        let elsewhere = Change { from: (1, 1), to: (1, 2), ..from };
        assert_eq!(heard(Slip::new("").with(elsewhere)), [(1, 1), (2, 2), (3, 3)]);
        let slow = Change { from: (0, 0), to: (0, 3), ..second(Fate::Slow(ms(1), 1.0)) };
        assert_eq!(heard(Slip::new("").with(slow)), [(1, 1), (3, 2), (5, 3)]);
        let unasked = Slip::new("").and_unasked(ms(10), Frame::new(ID, [9]));
        assert_eq!(heard(unasked), [(1, 1), (2, 2), (3, 3), (10, 9)]);
    }
}
