//! What a device in its own time sends periodically, by identifier: each frame must say what the
//! model said about then, and they come neither too rarely nor too often.

use std::collections::VecDeque;
use std::time::Duration;

use canopen::{Frame, Id, Instant};

use super::What;

/// All of them.
#[derive(Clone, Debug, Default)]
pub(super) struct Streams {
    of_ids: Vec<Stream>,
}

#[derive(Clone, Debug)]
struct Stream {
    id: Id,
    period: Duration,
    /// Since when the model sends it.
    since: Instant,
    /// The last frames of the model.
    sent: VecDeque<(Instant, Frame)>,
    /// When the last ones of the device came.
    came: VecDeque<Instant>,
}

/// What a frame of a device is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Taken {
    /// One of a stream.
    InTime,
    /// One too many.
    TooOften,
    /// None of a stream.
    Unknown,
}

/// How many frames of the model are remembered.
const MOST: usize = 64;
/// Over so many periods at least it is judged whether frames come too often.
const PERIODS: usize = 8;

impl Streams {
    /// The model sends a frame of a stream with this period. Returns what is missing of those of
    /// the device, each of which may be `late`.
    pub(super) fn expect(
        &mut self,
        now: Instant,
        frame: Frame,
        period: Duration,
        late: Duration,
    ) -> Option<What> {
        let place = self.of_ids.iter().position(|stream| stream.id == frame.id);
        let place = place.unwrap_or_else(|| {
            let (sent, came) = (VecDeque::new(), VecDeque::new());
            let (id, since) = (frame.id, now);
            self.of_ids.push(Stream { id, period: Duration::ZERO, since, sent, came });
            self.of_ids.len() - 1
        });
        let stream = &mut self.of_ids[place];
        let last = stream.sent.back().map(|(last, _)| *last);
        if stream.period != period || last.is_none_or(|last| now.since(last) > 2 * period + late) {
            (stream.period, stream.since) = (period, now);
            stream.came.clear();
        }
        if stream.sent.len() == MOST {
            stream.sent.pop_front();
        }
        stream.sent.push_back((now, frame));
        let last = stream.came.back().map_or(stream.since, |last| stream.since.max(*last));
        // The phase of the device is another one, by up to a period.
        let most = 2 * period + period / 4 + late;
        (now.since(last) > most).then_some(What::Missing(frame, last + period))
    }

    /// Takes a frame of the device, if it says what the model said about then.
    pub(super) fn take(
        &mut self,
        now: Instant,
        frame: &Frame,
        late: Duration,
        is_like: impl Fn(&Frame) -> bool,
    ) -> Taken {
        let Some(stream) = self.of_ids.iter_mut().find(|stream| stream.id == frame.id) else {
            return Taken::Unknown;
        };
        let about = stream.period + stream.period / 4 + late;
        let mut recent = stream.sent.iter().rev().take_while(|(at, _)| now.since(*at) <= about);
        if !recent.any(|(_, model)| is_like(model)) {
            return Taken::Unknown;
        }
        stream.came.push_back(now);
        // A frame that was late makes the next gap short.
        let over = late.as_nanos() / stream.period.as_nanos().max(1);
        let over = PERIODS.max(4 * over as usize);
        if stream.came.len() <= over {
            return Taken::InTime;
        }
        let first = stream.came.pop_front().unwrap_or(now);
        let least = stream.period * over as u32 * 3 / 4;
        if now.since(first) < least { Taken::TooOften } else { Taken::InTime }
    }

    /// The frames of the device are seen from now on.
    pub(super) fn begin(&mut self, now: Instant) {
        for stream in &mut self.of_ids {
            stream.since = now;
            stream.came.clear();
        }
    }

    /// The device may begin them anew.
    pub(super) fn release(&mut self) {
        for stream in &mut self.of_ids {
            stream.period = Duration::ZERO;
            stream.came.clear();
        }
    }
}
