//! The heartbeat producer (CiA 301, 7.2.8.3.2.2, object 1017h).

use std::time::Duration;

use canopen::heartbeat::ErrorControl;
use canopen::{Instant, Mux, Outbox};

use crate::rules::Timer;
use crate::stack::base::Base;
use crate::stack::time::next_beat;

/// Tells the NMT state again and again.
#[derive(Clone, Debug, Default)]
pub(crate) struct HeartbeatProducer {
    period: Duration,
    due: Option<Instant>,
}

impl HeartbeatProducer {
    /// Takes the period from 1017h; the first heartbeat comes one period from now.
    pub(crate) fn configure(&mut self, now: Instant, base: &Base) {
        let configured = base.od.int(PERIOD).unwrap_or(0);
        self.period = base.rules.heartbeat_period(Duration::from_millis(configured as u64));
        let first = match base.rules.heartbeat_begins_at_once() {
            true => now,
            false => now + self.period,
        };
        self.due = (configured > 0).then_some(first);
    }

    /// Boot-up is done: the boot-up message counts as the first heartbeat.
    pub(crate) fn start(&mut self, now: Instant, base: &Base, out: &mut Outbox) {
        self.configure(now, base);
        if self.runs() {
            self.due = Some(now + self.period);
            // By specification none: the period counts from the boot-up message.
            for _ in 0..base.rules.heartbeats_at_boot_up() {
                out.push(ErrorControl::heartbeat(base.state).frame(base.id));
            }
        }
    }

    /// The state is another one, which the next heartbeat will say.
    pub(crate) fn enter(&mut self, now: Instant, base: &Base, out: &mut Outbox) {
        if self.runs() && base.rules.state_change_restarts_heartbeat() {
            self.due = Some(now + self.period);
        }
        if self.runs() && base.rules.heartbeat_at_change_of_state() {
            out.push(ErrorControl::heartbeat(base.state).frame(base.id));
        }
    }

    pub(crate) fn stop(&mut self) {
        self.due = None;
    }

    /// Whether heartbeat is on, which rules out guarding.
    pub(crate) fn runs(&self) -> bool {
        self.due.is_some()
    }

    pub(crate) fn handle_timeout(&mut self, now: Instant, base: &Base, out: &mut Outbox) {
        if let Some(due) = self.due.filter(|due| base.rules.elapsed(Timer::Heartbeat, *due, now)) {
            out.push(ErrorControl::heartbeat(base.state).frame(base.id));
            self.due = Some(next_beat(due, self.period, now));
        }
    }

    pub(crate) fn poll_at(&self) -> Option<Instant> {
        self.due
    }
}

pub(super) const PERIOD: Mux = Mux::new(0x1017, 0);

#[cfg(test)]
mod tests {
    use crate::stack::testing::{Fixture, basic, eds, mux, sent, set};

    #[test]
    fn heartbeat_keeps_its_beat_and_tells_the_state() {
        let mut fixture = Fixture::new(&eds(basic()));
        fixture.write(mux(0x1017, 0), &[100, 0]).unwrap();
        assert_eq!(fixture.until(201_000), sent(&[(101_000, "705#7F"), (201_000, "705#7F")]));
        fixture.send("000#0205");
        assert_eq!(fixture.until(301_000), sent(&[(301_000, "705#04")]));
        fixture.send("000#8005");
        fixture.write(mux(0x1017, 0), &[0, 0]).unwrap();
        assert_eq!(fixture.until(900_000), []);
    }

    #[test]
    fn boot_up_counts_as_the_first_heartbeat() {
        let mut entries = basic();
        set(&mut entries, mux(0x1017, 0), 100);
        let mut fixture = Fixture::new(&eds(entries.clone()));
        assert_eq!(fixture.until(150_000), sent(&[(101_000, "705#7F")]));
        fixture.send("000#8205");
        assert_eq!(fixture.until(300_000), sent(&[(151_000, "705#00"), (251_000, "705#7F")]));
        let mut fixture = Fixture::mutant(&eds(entries), "heartbeats-at-boot-up: 3");
        fixture.send("000#8205");
        assert_eq!(fixture.until(50_000).len(), 4);
    }

    #[test]
    fn a_drift_of_one_per_cent_is_a_drift() {
        let mut fixture = Fixture::mutant(&eds(basic()), "heartbeat-period-drifts");
        fixture.write(mux(0x1017, 0), &[100, 0]).unwrap();
        assert_eq!(fixture.until(204_000), sent(&[(102_000, "705#7F"), (203_000, "705#7F")]));
    }
}
