//! The SYNC producer (CiA 301, 7.2.5, objects 1005h, 1006h and 1019h).

use std::time::Duration;

use canopen::pdo::CobId;
use canopen::sync::Sync;
use canopen::{Frame, Id, Instant, Outbox};

use crate::rules::Timer;
use crate::stack::base::Base;
use crate::stack::sync::{COB_ID, COUNTER_OVERFLOW, PERIOD};
use crate::stack::time::next_beat;

/// Sends SYNC, if the device can and bit 30 of 1005h is set.
#[derive(Clone, Debug, Default)]
pub(crate) struct SyncProducer {
    id: Option<Id>,
    period: Duration,
    /// The highest value of the counter; 0 for a SYNC without one.
    overflow: u8,
    counter: u8,
    next: Option<Instant>,
}

impl SyncProducer {
    /// Restarts; SYNC is produced from the next state on that has it.
    pub(crate) fn reset(&mut self, base: &Base) {
        *self = Self::default();
        self.take_parameters(base);
    }

    /// Takes identifier, period and counter overflow value, and restarts with them.
    pub(crate) fn configure(&mut self, now: Instant, base: &Base) {
        let before = self.period;
        self.take_parameters(base);
        let longer = self.period > before && !before.is_zero();
        let at_once = !longer || base.rules.longer_sync_period_at_once();
        if at_once && base.rules.new_sync_period_at_once() {
            self.next = None;
        }
        self.enter(now, base);
    }

    /// The node entered its state. The counter begins with 1 when SYNC does (7.2.5.3.1).
    pub(crate) fn enter(&mut self, now: Instant, base: &Base) {
        let runs =
            self.id.is_some() && !self.period.is_zero() && base.rules.sync_produced_in(base.state);
        if !runs {
            self.next = None;
        } else if self.next.is_none() {
            self.counter = base.rules.sync_counter_at_start(self.counter);
            self.next = Some(now + base.rules.first_sync_after(self.period));
        }
    }

    /// Sends SYNC when it is due, and returns it: it is meant for this device, too.
    pub(crate) fn handle_timeout(
        &mut self,
        now: Instant,
        base: &Base,
        out: &mut Outbox,
    ) -> Option<Sync> {
        let due = self.next.filter(|due| base.rules.elapsed(Timer::Sync, *due, now))?;
        let id = self.id?;
        self.next = Some(next_beat(due, self.period, now));
        let counter = (self.overflow > 0).then(|| {
            self.counter = base.rules.sync_counter_after(self.counter, self.overflow);
            self.counter
        });
        let sync = Sync { counter };
        out.push(Frame::new(id, sync.encode()));
        Some(sync)
    }

    pub(crate) fn poll_at(&self) -> Option<Instant> {
        self.next
    }

    fn take_parameters(&mut self, base: &Base) {
        let able = base.settings.sync_producer.is_some();
        let cob = base.od.int(COB_ID).unwrap_or(0) as u32;
        let id = (able && base.rules.sync_producer_chosen(cob)).then(|| CobId(cob).can_id());
        let period = Duration::from_micros(base.od.int(PERIOD).unwrap_or(0).max(0) as u64);
        self.period = base.rules.sync_production_period(period);
        self.overflow = base.od.int(COUNTER_OVERFLOW).unwrap_or(0) as u8;
        self.id = id;
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use canopen::{Abort, Mux};

    use crate::rules::Rules;
    use crate::stack::testing::{Fixture, eds, full, mux, sent, set};
    use crate::stack::{Inert, NodeSettings};

    const COB_ID: Mux = mux(0x1005, 0);
    const PERIOD: Mux = mux(0x1006, 0);

    fn fixture() -> Fixture {
        let shortest = Some(Duration::from_millis(1));
        let settings = NodeSettings { sync_producer: shortest, ..NodeSettings::default() };
        let mut entries = full();
        set(&mut entries, mux(0x1800, 2), 1);
        set(&mut entries, mux(0x1A00, 0), 1);
        set(&mut entries, mux(0x1A00, 1), 0x6000_0108);
        Fixture::with(&eds(entries), settings, Rules::default(), Box::new(Inert))
    }

    fn produce(fixture: &mut Fixture, period: u32) -> u64 {
        fixture.write(PERIOD, &period.to_le_bytes()).unwrap();
        fixture.write(COB_ID, &[0x80, 0, 0, 0x40]).unwrap();
        fixture.now.0 / 1000
    }

    #[test]
    fn sync_comes_with_its_period_and_stops_with_the_node() {
        let mut fixture = fixture();
        let at = produce(&mut fixture, 10_000);
        let frames = [(at + 10_000, "080#"), (at + 20_000, "080#"), (at + 30_000, "080#")];
        assert_eq!(fixture.until(at + 35_000), sent(&frames));
        fixture.send("000#0205");
        assert_eq!(fixture.until(at + 100_000), []);
        fixture.send("000#8005");
        assert_eq!(fixture.until(at + 110_000), sent(&[(at + 110_000, "080#")]));
        fixture.write(COB_ID, &[0x80, 0, 0, 0]).unwrap();
        assert_eq!(fixture.until(at + 200_000), []);
        fixture.write(COB_ID, &[0x80, 0, 0, 0x40]).unwrap();
        fixture.write(PERIOD, &[0; 4]).unwrap();
        assert_eq!(fixture.until(at + 300_000), []);
    }

    #[test]
    fn the_counter_runs_from_1_to_its_overflow() {
        let mut fixture = fixture();
        fixture.write(mux(0x1019, 0), &[3]).unwrap();
        let at = produce(&mut fixture, 10_000);
        let frames = fixture.until(at + 55_000);
        let counters: Vec<&str> = frames.iter().map(|(_, frame)| frame.as_str()).collect();
        assert_eq!(counters, ["080#01", "080#02", "080#03", "080#01", "080#02"]);
        fixture.send("000#0205");
        fixture.send("000#8005");
        assert_eq!(fixture.until(at + 65_000), sent(&[(at + 65_000, "080#01")]));
    }

    #[test]
    fn its_own_sync_moves_its_own_pdos() {
        let mut fixture = fixture();
        let at = produce(&mut fixture, 10_000);
        fixture.send("000#0105");
        fixture.until(at + 9_000);
        let frames = [(at + 10_000, "080#"), (at + 10_000, "185#00")];
        assert_eq!(fixture.until(at + 15_000), sent(&frames));
    }

    #[test]
    fn a_producer_keeps_its_identifier_and_its_limits() {
        let mut fixture = fixture();
        produce(&mut fixture, 10_000);
        assert_eq!(fixture.write(COB_ID, &[0x81, 0, 0, 0x40]), Err(Abort::VALUE.0));
        assert_eq!(fixture.write(PERIOD, &[0xE7, 3, 0, 0]), Err(Abort::VALUE.0));
        assert_eq!(fixture.write(PERIOD, &[0xE8, 3, 0, 0]), Ok(()));
        assert_eq!(fixture.write(COB_ID, &[0x80, 0, 0, 0]), Ok(()));
        assert_eq!(fixture.write(COB_ID, &[0x81, 0, 0, 0]), Ok(()));
        assert_eq!(fixture.write(COB_ID, &[0x81, 0, 0, 0x40]), Ok(()));
        assert_eq!(fixture.write(COB_ID, &[0x81, 0, 0, 0x20]), Err(Abort::VALUE.0));
    }
}
