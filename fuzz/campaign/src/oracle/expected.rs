//! The frames that the model has sent and the device has not, by identifier and in their order.

use std::collections::VecDeque;
use std::time::Duration;

use canopen::{Frame, Id, Instant};

use super::What;
use super::identifiers::HELD;
use super::sdo::Transfer;

/// A frame of the model.
#[derive(Clone, Copy, Debug)]
pub(super) struct Expected {
    /// When it was sent.
    pub(super) at: Instant,
    pub(super) frame: Frame,
    pub(super) must: Must,
    /// How much later than the others it may come.
    pub(super) later: Duration,
    /// The SDO transfer that it belongs to, where it is an answer.
    pub(super) of: Option<Transfer>,
}

/// Whether the device must send a frame, too.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Must {
    /// It must.
    Come,
    /// It must have sent any frame with the identifier in a time before.
    Within(Duration),
    /// It may.
    Not,
}

/// What is expected.
#[derive(Clone, Debug, Default)]
pub(super) struct Queues {
    of_ids: Vec<Queue>,
}

#[derive(Clone, Debug)]
struct Queue {
    id: Id,
    expected: VecDeque<Expected>,
    /// When the device last sent a frame with the identifier.
    last: Option<Instant>,
    /// When the model did.
    said: Option<Instant>,
    /// The last frames that need not have come: each may have been one that must.
    spare: Vec<(Instant, Frame)>,
}

/// How many frames that need not have come are remembered.
const MOST_SPARE: usize = 8;

impl Queues {
    fn queue(&mut self, id: Id) -> &mut Queue {
        let place = self.of_ids.iter().position(|queue| queue.id == id).unwrap_or_else(|| {
            let expected = VecDeque::new();
            self.of_ids.push(Queue { id, expected, last: None, said: None, spare: Vec::new() });
            self.of_ids.len() - 1
        });
        &mut self.of_ids[place]
    }

    /// Whether a frame with this identifier must come.
    pub(super) fn awaits(&self, id: u16) -> bool {
        let mut of_id = self.of_ids.iter().filter(|queue| queue.id.as_standard() == Some(id));
        of_id.any(|queue| queue.expected.iter().any(|expected| expected.must == Must::Come))
    }

    /// Whether the next frame with its identifier that must come is this one.
    pub(super) fn awaits_exactly(&self, frame: &Frame) -> bool {
        self.awaits_one(frame.id, |expected| expected.frame == *frame)
    }

    /// Whether the next frame with an identifier that must come is one of these.
    pub(super) fn awaits_one(&self, id: Id, is_it: impl Fn(&Expected) -> bool) -> bool {
        let queue = self.of_ids.iter().find(|queue| queue.id == id);
        let mut must = queue.into_iter().flat_map(|queue| &queue.expected);
        must.find(|expected| expected.must == Must::Come).is_some_and(is_it)
    }

    /// Whether any frame must come.
    pub(super) fn owe(&self) -> bool {
        self.owed() > 0
    }

    /// How many frames must come.
    pub(super) fn owed(&self) -> usize {
        let all = self.of_ids.iter().flat_map(|queue| &queue.expected);
        all.filter(|expected| expected.must == Must::Come).count()
    }

    /// The device must send this frame.
    pub(super) fn expect(&mut self, expected: Expected) {
        let queue = self.queue(expected.frame.id);
        queue.said = Some(expected.at);
        queue.expected.push_back(expected);
    }

    /// Takes the frame that a frame of the device is, with those before it that need not come.
    ///
    /// # Errors
    /// The one that should have come.
    pub(super) fn find(
        &mut self,
        now: Instant,
        frame: &Frame,
        is_like: impl Fn(&Expected) -> bool,
    ) -> Result<Expected, Option<Frame>> {
        let queue = self.queue(frame.id);
        // What has come and was taken for a frame that need not is not waited for.
        let spare = &queue.spare;
        let came =
            |it: &Expected| spare.iter().any(|(then, frame)| *frame == it.frame && *then >= it.at);
        let waits = |it: &Expected| it.must == Must::Come && !came(it);
        let first = queue.expected.iter().position(waits);
        let within = first.map_or(queue.expected.len(), |place| place + 1);
        let known = || queue.expected.iter().take(within);
        let exact = known().position(|it| it.frame == *frame && !came(it));
        let place = exact
            .or_else(|| known().position(|it| it.must == Must::Come && is_like(it)))
            .or_else(|| known().position(|it| is_like(it) && !came(it)))
            .or_else(|| known().position(|it| it.frame == *frame));
        let Some(place) = place else {
            return Err(first.map(|place| queue.expected[place].frame));
        };
        // Of two that are the same, either may be the one that has come: the other may follow.
        let left = queue.expected.iter().take(place).filter(|it| came(it));
        let left: Vec<Expected> = left.map(|it| Expected { must: Must::Not, ..*it }).collect();
        let found = queue.expected[place];
        queue.expected.drain(..=place);
        left.into_iter().rev().for_each(|it| queue.expected.push_front(it));
        if found.must == Must::Not {
            if queue.spare.len() == MOST_SPARE {
                queue.spare.remove(0);
            }
            queue.spare.push((now, *frame));
        }
        Ok(found)
    }

    /// The device has sent a frame.
    pub(super) fn came(&mut self, frame: &Frame, now: Instant) {
        self.queue(frame.id).last = Some(now);
    }

    /// When it last sent one with the identifier.
    pub(super) fn last(&mut self, frame: &Frame) -> Option<Instant> {
        self.queue(frame.id).last
    }

    /// When the model last sent one with the identifier.
    pub(super) fn said(&mut self, frame: &Frame) -> Option<Instant> {
        self.queue(frame.id).said
    }

    /// The device may have lost what it had to send, or may still hold it.
    pub(super) fn release(&mut self) {
        let all = self.of_ids.iter_mut().flat_map(|queue| &mut queue.expected);
        all.for_each(|expected| {
            expected.must = Must::Not;
            expected.later = expected.later.max(HELD);
        });
        self.of_ids.iter_mut().for_each(|queue| queue.last = None);
    }

    /// What should have come by now.
    pub(super) fn overdue(&mut self, now: Instant, late: Duration) -> Option<What> {
        for queue in &mut self.of_ids {
            while let Some(first) = queue.expected.front()
                && first.at + late + first.later < now
            {
                let Expected { at, frame, must, .. } = *first;
                let came = match must {
                    Must::Come => {
                        let is_it =
                            |(then, other): &(Instant, Frame)| *then >= at && *other == frame;
                        let place = queue.spare.iter().position(is_it);
                        place.map(|place| queue.spare.remove(place)).is_some()
                    }
                    Must::Within(time) => queue.last.is_some_and(|last| last + time + late >= at),
                    Must::Not => true,
                };
                queue.expected.pop_front();
                if !came {
                    return Some(What::Missing(frame, at));
                }
            }
        }
        None
    }
}
