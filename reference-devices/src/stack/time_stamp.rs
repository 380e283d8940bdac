//! TIME, produced and consumed (CiA 301, 7.2.6, object 1012h), and the clock that it sets.

use std::time::Duration;

use canopen::pdo::{CobId, is_restricted};
use canopen::timestamp::TimeOfDay;
use canopen::{Abort, Frame, Id, Instant, Mux, Outbox};

use crate::stack::base::Base;
use crate::stack::time::next_beat;

/// The clock of the device.
#[derive(Clone, Debug, Default)]
pub(crate) struct TimeStamp {
    /// When the clock was set, and to what.
    set: (Instant, TimeOfDay),
    consumed: Option<Id>,
    produced: Option<Id>,
    interval: Duration,
    next: Option<Instant>,
}

impl TimeStamp {
    /// Takes the parameters. The clock runs on over resets, since it is not a parameter.
    pub(crate) fn reset(&mut self, base: &Base) {
        self.next = None;
        self.take_parameters(base);
    }

    /// A parameter changed; production restarts.
    pub(crate) fn configure(&mut self, now: Instant, base: &Base) {
        self.reset(base);
        self.enter(now, base);
    }

    /// The node entered its state: TIME belongs to PRE-OPERATIONAL and OPERATIONAL (7.3.2.2.5).
    pub(crate) fn enter(&mut self, now: Instant, base: &Base) {
        let runs = self.produced.is_some()
            && !self.interval.is_zero()
            && base.rules.time_used_in(base.state);
        if !runs {
            self.next = None;
        } else if self.next.is_none() {
            self.next = Some(now + self.interval);
        }
    }

    /// The identifier on which TIME comes.
    pub(crate) fn id(&self) -> Option<Id> {
        self.consumed
    }

    /// A frame on that identifier.
    pub(crate) fn handle_frame(&mut self, now: Instant, data: &[u8], base: &Base) {
        // A message of another length is not a time, and there is no error code for it.
        if let Some(time) = base.rules.time_stamp(data)
            && base.rules.time_consumed_in(base.state)
        {
            self.set = (now, time);
        }
    }

    pub(crate) fn handle_timeout(&mut self, now: Instant, out: &mut Outbox) {
        let Some((due, id)) = self.next.filter(|due| *due <= now).zip(self.produced) else {
            return;
        };
        self.next = Some(next_beat(due, self.interval, now));
        out.push(Frame::new(id, self.at(now).encode()));
    }

    pub(crate) fn poll_at(&self) -> Option<Instant> {
        self.next
    }

    /// Shows the time of day in its object.
    pub(crate) fn show(&self, now: Instant, base: &mut Base) {
        if let Some(clock) = base.settings.clock_object {
            base.od.set(clock, &self.at(now).encode());
        }
    }

    fn at(&self, now: Instant) -> TimeOfDay {
        let (since, time) = self.set;
        time.after(now.since(since).as_millis() as u64)
    }

    fn take_parameters(&mut self, base: &Base) {
        let cob = base.od.int(COB_ID).unwrap_or(0) as u32;
        let id = CobId(cob).can_id();
        self.produced = (cob & PRODUCER != 0).then_some(id);
        let consumes = self.produced.is_none() || base.rules.time_producer_consumes();
        self.consumed = (cob & CONSUMER != 0 && consumes).then_some(id);
        let interval = base.settings.time_interval_object.and_then(|mux| base.od.int(mux));
        self.interval = Duration::from_millis(interval.unwrap_or(0).max(0) as u64);
    }
}

/// The refusals of 1012h: an identifier that is not free, or that changes while it is in use (CiA
/// 301, 7.5.2.15).
pub(crate) fn check(bytes: &[u8], base: &Base) -> Result<(), Abort> {
    let &[a, b, c, d] = bytes else { return Ok(()) };
    let (before, after) =
        (base.od.int(COB_ID).unwrap_or(0) as u32, u32::from_le_bytes([a, b, c, d]));
    let in_use = before & after & (CONSUMER | PRODUCER) != 0;
    let moved = in_use && (before ^ after) & !(CONSUMER | PRODUCER) != 0;
    let fixed = moved && base.rules.cob_id_fixed_while_valid();
    let (cob, id) = (CobId(after), CobId(after).can_id());
    let restricted = id != DEFAULT_ID && is_restricted(id) && base.rules.restricted_ids_refused();
    if !base.has_room_for(cob) || fixed || restricted { Err(Abort::VALUE) } else { Ok(()) }
}

pub(crate) const COB_ID: Mux = Mux::new(0x1012, 0);
const CONSUMER: u32 = 1 << 31;
const PRODUCER: u32 = 1 << 30;
const DEFAULT_ID: Id = Id::standard(canopen::timestamp::COB_ID);

#[cfg(test)]
mod tests {
    use canopen::eds::Access;
    use canopen::{Abort, DataType};

    use super::*;
    use crate::rules::Rules;
    use crate::stack::testing::{Fixture, eds, entry, full, mux, sent};
    use crate::stack::{Inert, NodeSettings};

    const CLOCK: Mux = mux(0x2F30, 1);
    const INTERVAL: Mux = mux(0x2F30, 2);

    fn fixture() -> Fixture {
        let mut entries = full();
        entries.push(entry(COB_ID, DataType::UNSIGNED32, Access::Rw, 0x100));
        entries.push(entry(CLOCK, DataType::TIME_OF_DAY, Access::Ro, 0));
        entries.push(entry(INTERVAL, DataType::UNSIGNED16, Access::Rw, 20));
        let settings = NodeSettings {
            clock_object: Some(CLOCK),
            time_interval_object: Some(INTERVAL),
            ..NodeSettings::default()
        };
        Fixture::with(&eds(entries), settings, Rules::default(), Box::new(Inert))
    }

    fn clock(fixture: &mut Fixture) -> Vec<u8> {
        fixture.send("000#8005");
        fixture.node.dictionary().get(CLOCK).unwrap().to_vec()
    }

    #[test]
    fn the_clock_takes_the_time_and_goes_on() {
        let mut fixture = fixture();
        let before = clock(&mut fixture);
        fixture.send("100#952CB302983A");
        assert_eq!(clock(&mut fixture), before, "the device does not consume TIME");
        fixture.write(COB_ID, &[0, 1, 0, 0x80]).unwrap();
        for wrong in ["100#952CB30298", "100#952CB302983A00", "100#R6"] {
            fixture.send(wrong);
            assert_eq!(clock(&mut fixture), before, "{wrong}");
        }
        fixture.send("100#952CB3F2983A");
        assert_eq!(clock(&mut fixture), [0x95, 0x2C, 0xB3, 0x02, 0x98, 0x3A]);
        fixture.run_to(fixture.now.0 / 1000 + 3_000);
        assert_eq!(clock(&mut fixture), [0x98, 0x2C, 0xB3, 0x02, 0x98, 0x3A]);
    }

    #[test]
    fn a_producer_tells_the_time_at_its_interval() {
        let mut fixture = fixture();
        fixture.write(COB_ID, &[0, 1, 0, 0x80]).unwrap();
        fixture.send("100#00000000983A");
        fixture.write(COB_ID, &[0, 1, 0, 0x40]).unwrap();
        let at = fixture.now.0 / 1000;
        let frames = [(at + 20_000, "100#14000000983A"), (at + 40_000, "100#28000000983A")];
        assert_eq!(fixture.until(at + 45_000), sent(&frames));
        fixture.send("000#0205");
        assert_eq!(fixture.until(at + 100_000), []);
    }

    #[test]
    fn the_identifier_is_judged() {
        let mut fixture = fixture();
        for wrong in [[0, 1, 0, 0x20], [0, 9, 0, 0], [0x80, 1, 0, 0x80], [1, 7, 0, 0]] {
            assert_eq!(fixture.write(COB_ID, &wrong), Err(Abort::VALUE.0), "{wrong:02X?}");
        }
        assert_eq!(fixture.write(COB_ID, &[0x90, 0, 0, 0x80]), Ok(()));
        assert_eq!(fixture.write(COB_ID, &[0x91, 0, 0, 0x80]), Err(Abort::VALUE.0));
        assert_eq!(fixture.write(COB_ID, &[0, 1, 0, 0]), Ok(()));
    }
}
