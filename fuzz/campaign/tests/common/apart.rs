//! A device in a time of its own, as on a bus: its clock is another one, and it takes some time for
//! each frame. Only the order of its frames is that of the model.

use std::collections::VecDeque;
use std::time::Duration;

use canopen::{BenchError, Device, Frame, Instant, Outbox, Value};
use reference_devices::change::Replica;

/// How long the device may take for a frame that it gets, and for one that it sends.
const HEARS_IN: Duration = Duration::from_millis(4);
const SENDS_IN: Duration = Duration::from_millis(12);
/// Its clock is faster by this part.
const FASTER: u64 = 2_000;

/// A device in its own time.
pub(crate) struct Apart {
    device: Box<dyn Replica>,
    random: fastrand::Rng,
    heard: VecDeque<(Instant, Frame)>,
    said: VecDeque<(Instant, Frame)>,
}

impl Apart {
    pub(crate) fn new(device: Box<dyn Replica>, seed: u64) -> Self {
        let random = fastrand::Rng::with_seed(seed);
        Self { device, random, heard: VecDeque::new(), said: VecDeque::new() }
    }

    /// At most so long after `now`, and not before what is in front.
    fn soon(&mut self, now: Instant, most: Duration, last: Option<Instant>) -> Instant {
        let nanos = self.random.u64(0..=most.as_nanos() as u64);
        (now + Duration::from_nanos(nanos)).max(last.unwrap_or(now))
    }

    fn say(&mut self, now: Instant, mut out: Outbox) {
        while let Some(frame) = out.pop() {
            let last = self.said.back().map(|(at, _)| *at);
            let at = self.soon(now, SENDS_IN, last);
            self.said.push_back((at, frame));
        }
    }
}

/// The time on the clock of the device.
fn there(at: Instant) -> Instant {
    Instant(at.0.saturating_add(at.0 / FASTER))
}

/// When that clock shows it.
fn here(at: Instant) -> Instant {
    Instant((u128::from(at.0) * u128::from(FASTER) / u128::from(FASTER + 1)) as u64 + 1)
}

impl Device for Apart {
    fn handle_frame(&mut self, now: Instant, frame: &Frame, _: &mut Outbox) {
        let last = self.heard.back().map(|(at, _)| *at);
        let at = self.soon(now, HEARS_IN, last);
        self.heard.push_back((at, *frame));
    }

    fn handle_timeout(&mut self, now: Instant, out: &mut Outbox) {
        loop {
            let timer = self.device.poll_at().map(here).filter(|due| *due <= now);
            let frame = self.heard.front().map(|(at, _)| *at).filter(|at| *at <= now);
            let mut said = Outbox::default();
            let at = match (timer, frame) {
                (Some(due), frame) if frame.is_none_or(|at| due < at) => {
                    self.device.handle_timeout(there(due), &mut said);
                    due
                }
                (_, Some(at)) => {
                    if let Some((_, frame)) = self.heard.pop_front() {
                        self.device.handle_frame(there(at), &frame, &mut said);
                    }
                    at
                }
                (_, None) => break,
            };
            self.say(at.max(now), said);
        }
        while let Some((_, frame)) = self.said.front().filter(|(at, _)| *at <= now) {
            out.push(*frame);
            self.said.pop_front();
        }
    }

    fn poll_at(&self) -> Option<Instant> {
        let queues = [self.heard.front(), self.said.front()];
        let queues = queues.into_iter().flatten().map(|(at, _)| *at);
        queues.chain(self.device.poll_at().map(here)).min()
    }

    fn bench_names(&self) -> Vec<String> {
        self.device.bench_names()
    }

    fn stimulate(
        &mut self,
        now: Instant,
        name: &str,
        value: &Value,
        _: &mut Outbox,
    ) -> Result<(), BenchError> {
        let mut said = Outbox::default();
        self.device.stimulate(there(now), name, value, &mut said)?;
        self.say(now, said);
        Ok(())
    }

    fn observe(&self, name: &str) -> Option<Value> {
        self.device.observe(name)
    }
}
