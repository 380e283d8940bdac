//! A replica of the device that runs beside it.

use canopen::bench::POWER;
use canopen::{Dictionary, Frame, Instant, Mux, NmtState, Outbox, Value};
use reference_devices::change::Replica;

/// A device in the time of the session, and the frames that it has to send.
#[derive(Clone)]
pub(crate) struct Model {
    device: Box<dyn Replica>,
    out: Outbox,
    due: Option<Instant>,
}

/// How often a model may be polled without time passing.
const POLLS_PER_INSTANT: u32 = 1_000;

impl Model {
    pub(crate) fn new(device: Box<dyn Replica>) -> Self {
        let due = device.poll_at();
        Self { device, out: Outbox::default(), due }
    }

    pub(crate) fn dictionary(&self) -> &Dictionary {
        self.device.node().dictionary()
    }

    pub(crate) fn id(&self) -> u8 {
        self.device.node().id()
    }

    pub(crate) fn state(&self) -> NmtState {
        self.device.node().state()
    }

    /// Whether an SDO transfer is open.
    pub(crate) fn transfers(&self) -> bool {
        self.device.node().transfers()
    }

    /// Whether a request on the default channel is a segment of a block download.
    pub(crate) fn takes_segments(&self) -> bool {
        self.device.node().takes_segments()
    }

    /// The next deadline, when it is before `to`.
    pub(crate) fn due_before(&self, to: Instant) -> Option<Instant> {
        self.due.filter(|due| *due < to)
    }

    /// Does what is due before `to`, and returns the frames that come of it, with their times.
    pub(crate) fn act_before(&mut self, to: Instant) -> Vec<(Instant, Frame)> {
        let mut all = Vec::new();
        while let Some(due) = self.due_before(to) {
            all.extend(self.poll(due).map(|frame| (due, frame)));
        }
        all
    }

    /// Does what is due at `now`, a deadline, and returns the frames that come of it.
    pub(crate) fn poll(&mut self, now: Instant) -> impl Iterator<Item = Frame> + '_ {
        let mut polls = 0;
        while self.due.is_some_and(|due| due <= now) && polls < POLLS_PER_INSTANT {
            self.device.handle_timeout(now, &mut self.out);
            self.wait_from(now);
            polls += 1;
        }
        self.sent()
    }

    /// Takes a frame of the tester.
    pub(crate) fn take(&mut self, now: Instant, frame: &Frame) -> impl Iterator<Item = Frame> + '_ {
        self.device.handle_frame(now, frame, &mut self.out);
        self.wait_from(now);
        self.sent()
    }

    /// Is switched on at another time than 0.
    pub(crate) fn start(&mut self, now: Instant) {
        self.power(now, false);
        self.power(now, true);
    }

    /// Switches the supply.
    pub(crate) fn power(&mut self, now: Instant, on: bool) {
        let value = Value::Text(if on { "on" } else { "off" }.to_owned());
        // Each simulated device has a supply.
        _ = self.device.stimulate(now, POWER, &value, &mut self.out);
        self.out.clear();
        self.wait_from(now);
    }

    /// A device may ask to be polled at a time that has passed, as after a pause without supply;
    /// its time does not go back.
    fn wait_from(&mut self, now: Instant) {
        self.due = self.device.poll_at().map(|due| due.max(now));
    }

    /// Has stored a value before it was switched on.
    pub(crate) fn store(&mut self, mux: Mux, bytes: &[u8]) {
        self.device.node_mut().store_value(mux, bytes);
    }

    /// Gives an object the value that the application of the device has given it.
    pub(crate) fn follow(&mut self, mux: Mux, bytes: &[u8]) {
        self.device.node_mut().take_value(mux, bytes);
    }

    fn sent(&mut self) -> impl Iterator<Item = Frame> + '_ {
        std::iter::from_fn(|| self.out.pop())
    }
}

impl Model {
    /// Takes a stimulus of the bench, and returns the frames that come of it.
    pub(crate) fn stimulate(&mut self, now: Instant, name: &str, value: &Value) -> Vec<Frame> {
        // A stimulus that the device took is one that the model takes, or it shows no effect.
        _ = self.device.stimulate(now, name, value, &mut self.out);
        self.wait_from(now);
        self.sent().collect()
    }

    /// What is to be seen on the bench.
    pub(crate) fn observe(&self, name: &str) -> Option<Value> {
        self.device.observe(name)
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use canopen::{Instant, Value};
    use reference_devices::change::Deviation;
    use reference_devices::devices;

    use super::Model;

    /// The edges of its encoder that were due while the module was off are over.
    #[test]
    fn time_does_not_go_back_after_a_pause_without_supply() {
        let device = devices::device("mcm260x-3ad").expect("it is a reference device");
        let built = Deviation::default().build(&device, 1).expect("it is as it is");
        let mut model = Model::new(built);
        let off = Instant::ZERO + Duration::from_secs(1);
        while let Some(due) = model.due_before(off) {
            model.poll(due).for_each(drop);
        }
        model.stimulate(off, "encoder-frequency-3", &Value::Real(25.6));
        model.power(off, false);
        assert_eq!(model.due_before(Instant::NEVER), None);
        let on = off + Duration::from_millis(300);
        model.power(on, true);
        assert_eq!(model.due_before(on), None);
        assert!(model.due_before(Instant::NEVER).is_some());
    }
}
