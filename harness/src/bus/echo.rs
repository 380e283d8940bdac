//! Echoes of own frames where the other side sends none: it confirms each frame instead, or says
//! nothing at all.

use std::collections::VecDeque;
use std::time::Duration;

use canopen::{Frame, Instant};

use super::lines::Inbox;

/// Longer than a slow adapter takes, and shorter than the runner waits for an echo.
const PATIENCE: Duration = Duration::from_secs(1);

/// What was written and is not confirmed yet, in order.
///
/// A frame is complete when it is confirmed. A frame of another station that comes before may be
/// its answer, so it is then shown at that time. Where nothing is confirmed, a frame is complete
/// when it is written.
#[derive(Debug)]
pub(super) struct Echoes {
    are_confirmed: bool,
    waiting: VecDeque<Waiting>,
}

#[derive(Debug)]
struct Waiting {
    /// The frame, or `None` for a question.
    frame: Option<Frame>,
    since: Instant,
    /// Whether its echo was received.
    is_shown: bool,
}

/// What the other side does not take.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Refused {
    /// A frame.
    Frame(Frame),
    /// A question.
    Question,
}

impl Echoes {
    /// Nothing was written; whether the other side confirms what it takes.
    pub(super) const fn new(are_confirmed: bool) -> Self {
        Self { are_confirmed, waiting: VecDeque::new() }
    }

    /// A frame is written.
    pub(super) fn sent(&mut self, now: Instant, frame: Frame, inbox: &mut Inbox) {
        if self.are_confirmed {
            self.waiting.push_back(Waiting { frame: Some(frame), since: now, is_shown: false });
        } else {
            inbox.own(now, frame);
        }
    }

    /// A question is written, which is answered in its turn.
    pub(super) fn asked(&mut self, now: Instant) {
        self.waiting.push_back(Waiting { frame: None, since: now, is_shown: true });
    }

    /// Whether no question waits for its answer.
    pub(super) fn none_asked(&self) -> bool {
        self.waiting.iter().all(|it| it.frame.is_some())
    }

    /// The oldest frame is confirmed.
    pub(super) fn confirmed(&mut self, at: Instant, inbox: &mut Inbox) {
        if let Some(place) = self.waiting.iter().position(|it| it.frame.is_some())
            && let Some(Waiting { frame: Some(frame), is_shown: false, .. }) =
                self.waiting.remove(place)
        {
            inbox.own(at, frame);
        }
    }

    /// A frame came: whether it is the echo of an own one that waits for it. A controller may send
    /// frames by their priority, so that is not always the oldest one.
    pub(super) fn confirmed_by(&mut self, echo: &Frame, at: Instant, inbox: &mut Inbox) -> bool {
        let Some(place) = self.waiting.iter().position(|it| it.frame.as_ref() == Some(echo)) else {
            return false;
        };
        if let Some(Waiting { is_shown: false, .. }) = self.waiting.remove(place) {
            inbox.own(at, *echo);
        }
        true
    }

    /// The oldest question is answered.
    pub(super) fn answered(&mut self) {
        if let Some(place) = self.waiting.iter().position(|it| it.frame.is_none()) {
            self.waiting.remove(place);
        }
    }

    /// The oldest of all is not taken; `None` when nothing was written.
    pub(super) fn refused(&mut self) -> Option<Refused> {
        let waiting = self.waiting.pop_front()?;
        Some(waiting.frame.map_or(Refused::Question, Refused::Frame))
    }

    /// A frame of another station follows, which came at `at`. It is no answer to what was written
    /// later.
    pub(super) fn precede(&mut self, at: Instant, inbox: &mut Inbox) {
        for waiting in self.waiting.iter_mut().filter(|it| !it.is_shown && it.since <= at) {
            if let Some(frame) = waiting.frame {
                inbox.own(at, frame);
            }
            waiting.is_shown = true;
        }
    }

    /// Gives up what was not answered for too long. After a frame of that kind nothing is confirmed
    /// any more, which is returned.
    pub(super) fn give_up(&mut self, now: Instant, inbox: &mut Inbox) -> bool {
        let is_late = |it: &Waiting| now.since(it.since) > PATIENCE;
        self.waiting.retain(|it| it.frame.is_some() || !is_late(it));
        let are_late = self.waiting.iter().any(is_late);
        if are_late {
            self.are_confirmed = false;
            for Waiting { frame, since, is_shown } in self.waiting.drain(..) {
                if let Some(frame) = frame.filter(|_| !is_shown) {
                    inbox.own(since, frame);
                }
            }
        }
        are_late
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MILLI: u64 = 1_000_000;

    fn at(ms: u64) -> Instant {
        Instant(ms * MILLI)
    }

    fn frame(id: u16) -> Frame {
        Frame::new(id, [])
    }

    /// The identifiers and milliseconds of what was received; own ones are negative.
    fn received(inbox: &mut Inbox) -> Vec<(i32, u64)> {
        let all = std::iter::from_fn(|| inbox.next()).map(|seen| seen.expect("nothing is wrong"));
        let all = all.map(|seen| {
            let id = i32::try_from(seen.frame.id.raw()).expect("it is small");
            (if seen.own { -id } else { id }, seen.at.0 / MILLI)
        });
        all.collect()
    }

    #[test]
    fn a_frame_is_complete_when_it_is_confirmed() {
        let (mut echoes, mut inbox) = (Echoes::new(true), Inbox::new());
        echoes.sent(at(1), frame(1), &mut inbox);
        echoes.sent(at(2), frame(2), &mut inbox);
        assert_eq!(received(&mut inbox), []);
        echoes.confirmed(at(5), &mut inbox);
        echoes.confirmed(at(6), &mut inbox);
        echoes.confirmed(at(7), &mut inbox);
        assert_eq!(received(&mut inbox), [(-1, 5), (-2, 6)]);
    }

    #[test]
    fn what_may_be_its_answer_comes_after_it() {
        let (mut echoes, mut inbox) = (Echoes::new(true), Inbox::new());
        echoes.sent(at(2), frame(1), &mut inbox);
        for time in [1, 3] {
            echoes.precede(at(time), &mut inbox);
            inbox.heard(at(time), frame(9));
        }
        echoes.confirmed(at(4), &mut inbox);
        assert_eq!(received(&mut inbox), [(9, 1), (-1, 3), (9, 3)]);
    }

    #[test]
    fn a_question_has_its_turn() {
        let (mut echoes, mut inbox) = (Echoes::new(true), Inbox::new());
        echoes.sent(at(1), frame(1), &mut inbox);
        echoes.asked(at(1));
        echoes.sent(at(1), frame(2), &mut inbox);
        assert!(!echoes.none_asked());
        echoes.confirmed(at(2), &mut inbox);
        assert_eq!(echoes.refused(), Some(Refused::Question));
        assert!(echoes.none_asked());
        assert_eq!(echoes.refused(), Some(Refused::Frame(frame(2))));
        assert_eq!(echoes.refused(), None);
        assert_eq!(received(&mut inbox), [(-1, 2)]);
    }

    #[test]
    fn where_nothing_is_confirmed_a_frame_is_complete_when_it_is_written() {
        let (mut echoes, mut inbox) = (Echoes::new(true), Inbox::new());
        echoes.sent(at(1), frame(1), &mut inbox);
        assert!(!echoes.give_up(at(900), &mut inbox));
        assert_eq!(received(&mut inbox), []);
        assert!(echoes.give_up(at(1002), &mut inbox));
        echoes.sent(at(1003), frame(2), &mut inbox);
        assert_eq!(received(&mut inbox), [(-1, 1), (-2, 1003)]);
    }
}
