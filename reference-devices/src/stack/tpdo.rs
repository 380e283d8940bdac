//! TPDOs: process data that the device transmits (CiA 301, 7.2.2, objects 1800h and 1A00h on).

use std::collections::BTreeMap;
use std::time::Duration;

use canopen::eds::Direction;
use canopen::pdo::{CobId, Unpacker};
use canopen::sync::Sync;
use canopen::{Data, Frame, Id, Instant, Mux, Outbox};

use crate::rules::{Service, Timer};
use crate::stack::base::Base;
use crate::stack::behaviour::Behaviour;
use crate::stack::pdo::{self, EVENT_TIMER, INHIBIT_TIME, SYNC_START, TYPE};
use crate::stack::pdo_mapping::PdoMapping;
use crate::stack::time::{earlier, next_beat};

/// One TPDO.
#[derive(Clone, Debug)]
pub(crate) struct Tpdo {
    pdo: u16,
    cob: CobId,
    kind: u8,
    inhibit: Duration,
    period: Duration,
    sync_start: u8,
    mapping: PdoMapping,
    running: bool,
    /// The data that were transmitted last.
    last: Data,
    /// The values of the objects in the last transmission of each, where they are kept beyond new
    /// parameters.
    transmitted: BTreeMap<Mux, Vec<u8>>,
    /// The data of the objects when they were last looked at.
    seen: Data,
    /// Where the dictionary was when its values were those of the last transmission.
    quiet: Option<u64>,
    /// An event waits for the end of the inhibit time, or for SYNC.
    pending: bool,
    /// End of the inhibit time.
    free_at: Instant,
    /// When the event timer elapses.
    due: Option<Instant>,
    /// SYNC messages since the last transmission; `None` until the start value has come.
    syncs: Option<u8>,
    /// The data that a PDO of type 252 answers with.
    sampled: Option<Data>,
}

impl Tpdo {
    /// The TPDOs of the device.
    pub(crate) fn all(base: &Base) -> Vec<Self> {
        let tpdos = pdo::existing(&base.od, Direction::Transmit);
        tpdos.into_iter().map(|pdo| Self::new(pdo, base)).collect()
    }

    fn new(pdo: u16, base: &Base) -> Self {
        let mut tpdo = Self {
            pdo,
            cob: CobId(CobId::INVALID),
            kind: 0,
            inhibit: Duration::ZERO,
            period: Duration::ZERO,
            sync_start: 0,
            mapping: PdoMapping::default(),
            running: false,
            last: Data::EMPTY,
            transmitted: BTreeMap::new(),
            seen: Data::EMPTY,
            quiet: None,
            pending: false,
            free_at: Instant::ZERO,
            due: None,
            syncs: None,
            sampled: None,
        };
        tpdo.configure(Instant::ZERO, base);
        tpdo
    }

    /// Whether this is the PDO counted `pdo` from 0.
    pub(crate) fn is(&self, pdo: u16) -> bool {
        self.pdo == pdo
    }

    /// Takes the parameters; counting and timing restart.
    pub(crate) fn configure(&mut self, now: Instant, base: &Base) {
        let od = &base.od;
        let parameter = |sub| {
            let pdo = base.rules.pdo_parameter_of(Direction::Transmit, self.pdo, sub);
            od.int(Mux::new(pdo::communication(Direction::Transmit, pdo), sub)).unwrap_or(0)
        };
        let (kind, sync_start) = (parameter(TYPE) as u8, parameter(SYNC_START) as u8);
        let inhibit = base.rules.pdo_inhibit(parameter(INHIBIT_TIME) as u16);
        let period = Duration::from_millis(parameter(EVENT_TIMER) as u64);
        self.cob = pdo::cob_id(od, Direction::Transmit, self.pdo);
        (self.kind, self.sync_start, self.inhibit, self.period) =
            (kind, sync_start, inhibit, period);
        self.mapping.load(od, pdo::mapping(Direction::Transmit, self.pdo));
        self.restart(now, base);
    }

    /// Takes a parameter that was written.
    pub(crate) fn reconfigure(&mut self, now: Instant, base: &Base) {
        self.configure(now, base);
        if self.is_active() && base.rules.tpdo_sent_when_configured() {
            self.pending = self.is_event_driven() || self.kind == 0;
        }
    }

    /// The node entered a state. In OPERATIONAL, event-driven PDOs transmit their present
    /// values.
    pub(crate) fn enter(
        &mut self,
        now: Instant,
        base: &Base,
        behaviour: &dyn Behaviour,
        out: &mut Outbox,
    ) {
        let runs = base.rules.tpdo_sent_in(base.state_of(Service::Tpdo));
        let goes_on = self.running && base.rules.tpdo_goes_on_in(base.state, self.kind);
        if runs == self.running || goes_on {
            return;
        }
        self.running = runs;
        let waits = self.pending && base.rules.event_waits_in(base.state);
        let free_at = waits.then_some(self.free_at);
        self.restart(now, base);
        if let Some(free_at) = free_at {
            (self.pending, self.free_at) = (true, free_at);
        }
        let held_back = |mux| behaviour.holds_back(mux, &base.od);
        let held_back = self.mapping.entries().iter().any(|entry| held_back(entry.mux));
        let sent = base.rules.tpdo_sent_at_start(held_back);
        if self.is_active() && self.is_event_driven() && sent {
            self.event(now, base, out);
        }
        if self.is_active() && self.kind == 0 && base.rules.start_is_event_of_acyclic_tpdo() {
            self.pending = true;
        }
    }

    /// Objects may have changed: transmits when the application calls that an event.
    pub(crate) fn compare(
        &mut self,
        now: Instant,
        base: &Base,
        behaviour: &mut dyn Behaviour,
        out: &mut Outbox,
    ) {
        let by_change = self.is_event_driven() || self.kind == 0;
        // A pending event transmits the values that hold when the inhibit time ends. What changes
        // until then is looked at all the same: the application may note which input it was.
        let overlooked = self.pending && !base.rules.changes_noted_while_pending();
        if !self.is_active() || !by_change || overlooked {
            return;
        }
        let changes = Some(base.od.changes());
        if self.quiet.is_some_and(|then| !self.mapping.has_changed_since(then, &base.od)) {
            self.quiet = changes;
            return;
        }
        let data = self.mapping.pack(&base.od);
        let compared = base.rules.tpdo_bytes_compared(data.len());
        let same = |before: Data| data.padded()[..compared] == before.padded()[..compared];
        if same(self.seen) && (same(self.last) || self.pending) {
            self.quiet = changes;
            return;
        }
        let event = self.is_event(base, behaviour);
        (self.seen, self.quiet) = (data, None);
        if event && !self.pending {
            self.event(now, base, out);
        }
    }

    /// SYNC has come.
    pub(crate) fn synchronise(&mut self, now: Instant, sync: Sync, base: &Base, out: &mut Outbox) {
        if !self.is_active() {
            return;
        }
        match self.kind {
            0 if self.pending => self.transmit(now, base, out),
            1..=240 => {
                let starts = sync.counter.is_none_or(|counter| counter == self.sync_start);
                // SYNC messages before the start value do not count (7.5.2.37, sub-index 6).
                if self.syncs.is_none() && self.sync_start != 0 && !starts {
                    return;
                }
                let first = || match self.sync_start {
                    0 => base.rules.syncs_before_first(self.kind),
                    _ => base.rules.syncs_before_start_value(self.kind),
                };
                if self.sync_start != 0 && starts && base.rules.sync_start_begins_again() {
                    self.syncs = None;
                }
                let count = self.syncs.unwrap_or_else(first).saturating_add(1);
                self.syncs = Some(count);
                if base.rules.cyclic_tpdo_due(count, self.kind) {
                    self.syncs = Some(0);
                    if !base.rules.inhibit_time_applies(self.kind) || self.free_at <= now {
                        self.transmit(now, base, out);
                    }
                }
            }
            // A remote request is answered with the sample of the last SYNC, however old it is.
            252 => self.sampled = Some(self.mapping.pack(&base.od)),
            _ => {}
        }
    }

    /// A remote frame.
    pub(crate) fn handle_request(&mut self, now: Instant, id: Id, base: &Base, out: &mut Outbox) {
        let asked = self.is_active() && self.cob.can_id() == id;
        if !asked || !base.rules.rtr_answered(self.cob) {
            return;
        }
        match (self.kind, self.sampled) {
            (252, Some(sampled)) => out.push(Frame::new(id, sampled)),
            (252 | 253, _) => self.transmit(now, base, out),
            // The inhibit time applies to requested transmissions as well.
            (254.., _) => self.event(now, base, out),
            _ => {}
        }
    }

    pub(crate) fn handle_timeout(&mut self, now: Instant, base: &Base, out: &mut Outbox) {
        if let Some(due) = self.due.filter(|due| base.rules.elapsed(Timer::Event, *due, now)) {
            let (last, seen) = (self.last, self.seen);
            match base.rules.event_timer_is_inhibited() {
                true => self.event(now, base, out),
                false => self.transmit(now, base, out),
            }
            if !base.rules.timer_transmission_remembered() {
                (self.last, self.seen, self.quiet) = (last, seen, None);
            }
            // The inhibit time can delay the transmission, but never the next beat of the timer.
            self.due = Some(next_beat(due, self.period, now));
        }
        if self.waits_for_inhibit() && base.rules.elapsed(Timer::Inhibit, self.free_at, now) {
            self.transmit(now, base, out);
            self.pending = !base.rules.delayed_event_ends();
        }
    }

    pub(crate) fn poll_at(&self) -> Option<Instant> {
        earlier(self.due, self.waits_for_inhibit().then_some(self.free_at))
    }

    /// Transmits, now or when the inhibit time is over; type 0 waits for SYNC.
    fn event(&mut self, now: Instant, base: &Base, out: &mut Outbox) {
        if self.is_event_driven() && self.free_at <= now {
            self.transmit(now, base, out);
        } else {
            self.pending = true;
        }
    }

    fn transmit(&mut self, now: Instant, base: &Base, out: &mut Outbox) {
        self.remember(base);
        if !base.rules.transmission_ends_with_its_parameters() {
            let values = self.mapping.entries().iter().map(|entry| entry.mux);
            let values = values.filter_map(|mux| Some((mux, base.od.get(mux)?.to_vec())));
            self.transmitted.extend(values);
        }
        self.pending = false;
        out.push(Frame::new(self.cob.can_id(), self.last));
        if base.rules.inhibit_time_applies(self.kind) {
            self.free_at = now + self.inhibit;
        }
        if self.is_event_driven() && base.rules.event_timer_restarts() {
            self.start_timer(now);
        }
    }

    fn restart(&mut self, now: Instant, base: &Base) {
        self.remember(base);
        self.recall(base);
        if !self.pending || base.rules.disabled_tpdo_forgets_its_event() {
            self.pending = false;
            self.free_at = now;
        }
        self.syncs = None;
        self.sampled = None;
        self.due = None;
        if self.is_active() && self.is_event_driven() {
            self.start_timer(now);
        }
    }

    fn remember(&mut self, base: &Base) {
        self.last = self.mapping.pack(&base.od);
        (self.seen, self.quiet) = (self.last, Some(base.od.changes()));
    }

    /// What was transmitted before the parameters were new is still what was transmitted last; what
    /// never was counts as 0.
    fn recall(&mut self, base: &Base) {
        if base.rules.transmission_ends_with_its_parameters() {
            return;
        }
        let mut od = base.od.clone();
        for entry in self.mapping.entries() {
            match self.transmitted.get(&entry.mux) {
                Some(value) => od.set(entry.mux, value),
                None => od.set_int(entry.mux, 0),
            }
        }
        self.last = self.mapping.pack(&od);
        (self.seen, self.quiet) = (self.last, None);
    }

    fn start_timer(&mut self, now: Instant) {
        self.due = (!self.period.is_zero()).then(|| now + self.period);
    }

    fn is_active(&self) -> bool {
        self.running && self.cob.valid() && !self.mapping.is_empty()
    }

    const fn is_event_driven(&self) -> bool {
        self.kind >= 254
    }

    const fn waits_for_inhibit(&self) -> bool {
        self.pending && self.is_event_driven()
    }

    fn is_event(&self, base: &Base, behaviour: &mut dyn Behaviour) -> bool {
        let mut last = Unpacker::new(self.last);
        let mut seen = Unpacker::new(self.seen);
        // Every value is looked at, since the application may note which of them it was.
        self.mapping.entries().iter().fold(false, |event, entry| {
            let bytes = usize::from(entry.bits.div_ceil(8)).min(8);
            let (transmitted, level) = (last.take(entry.bits), seen.take(entry.bits));
            let has_edges = behaviour.has_edges(entry.mux);
            let before = &(if has_edges { level } else { transmitted })[..bytes];
            let now = base.od.get(entry.mux).unwrap_or_default();
            before != now && behaviour.triggers(entry.mux, before, &base.od) || event
        })
    }
}

#[cfg(test)]
mod tests {
    use crate::rules::Rules;
    use crate::stack::testing::{Fixture, eds, entry, full, mux, sent, set};
    use crate::stack::{Behaviour, NodeSettings};
    use canopen::eds::Access;
    use canopen::{DataType, Dictionary, Mux};

    /// The first TPDO carries 2000h and 2001h, in OPERATIONAL after `set`.
    fn fixture(rules: &str, parameters: &[(u8, i64)]) -> Fixture {
        let mut entries = full();
        set(&mut entries, mux(0x1A00, 0), 2);
        set(&mut entries, mux(0x1A00, 1), 0x2000_0008);
        set(&mut entries, mux(0x1A00, 2), 0x2001_0010);
        for (sub, value) in parameters {
            set(&mut entries, mux(0x1800, *sub), *value);
        }
        match rules {
            "" => Fixture::new(&eds(entries)),
            rules => Fixture::mutant(&eds(entries), rules),
        }
    }

    fn write(fixture: &mut Fixture, value: u8) -> Vec<String> {
        let answers = fixture.ask(&format!("605#2F002000{value:02X}000000"));
        answers.into_iter().filter(|frame| !frame.starts_with("585")).collect()
    }

    #[test]
    fn an_event_driven_pdo_is_sent_at_the_start_and_with_each_change() {
        for kind in [254, 255] {
            let mut fixture = fixture("", &[(2, kind)]);
            assert!(write(&mut fixture, 0x10).is_empty());
            assert_eq!(fixture.ask("000#0105"), ["185#100000"]);
            assert!(fixture.ask("000#0105").is_empty());
            assert!(write(&mut fixture, 0x10).is_empty());
            assert_eq!(write(&mut fixture, 0x12), ["185#120000"]);
            fixture.send("000#0205");
            assert_eq!(fixture.until(9_000_000), []);
        }
    }

    #[test]
    fn a_change_while_a_pdo_is_invalid_may_be_an_event_afterwards() {
        let changed = |rules| {
            let mut fixture = fixture(rules, &[]);
            assert_eq!(fixture.ask("000#0105"), ["185#110000"]);
            fixture.write(mux(0x1800, 1), &[0x85, 1, 0, 0x80]).unwrap();
            assert!(write(&mut fixture, 0x12).is_empty());
            fixture.write(mux(0x1800, 1), &[0x85, 1, 0, 0]).unwrap();
            fixture.until(fixture.now.0 / 1000 + 1_000).len()
        };
        assert_eq!(changed(""), 0);
        assert_eq!(changed("transmission-ends-with-its-parameters: false"), 1);
    }

    #[test]
    fn the_inhibit_time_joins_changes() {
        let mut fixture = fixture("", &[(3, 1000)]);
        assert_eq!(fixture.ask("000#0105"), ["185#110000"]);
        for value in 0x20..0x30 {
            fixture.run_to(fixture.now.0 / 1000 + 1_000);
            assert!(write(&mut fixture, value).is_empty());
        }
        assert_eq!(fixture.until(900_000), sent(&[(101_000, "185#2F0000")]));
    }

    #[test]
    fn the_event_timer_starts_anew_with_each_transmission() {
        let mut fixture = fixture("", &[(5, 100)]);
        fixture.send("000#0105");
        fixture.until(1_000);
        let twice = sent(&[(101_000, "185#110000"), (201_000, "185#110000")]);
        assert_eq!(fixture.until(250_000), twice);
        assert_eq!(write(&mut fixture, 1), ["185#010000"]);
        assert_eq!(fixture.until(400_000), sent(&[(350_000, "185#010000")]));
        fixture.write(mux(0x1800, 5), &[0, 0]).unwrap();
        assert_eq!(fixture.until(900_000), []);
    }

    #[test]
    fn inhibit_time_goes_before_event_timer() {
        let mut fixture = fixture("", &[(3, 2500), (5, 100)]);
        fixture.send("000#0105");
        fixture.until(1_000);
        let spaced = sent(&[(251_000, "185#110000"), (501_000, "185#110000")]);
        assert_eq!(fixture.until(600_000), spaced);
    }

    #[test]
    fn a_cyclic_pdo_is_sent_with_every_nth_sync() {
        for kind in [1, 3, 240] {
            let mut fixture = fixture("", &[(2, kind)]);
            assert!(fixture.ask("000#0105").is_empty());
            assert!(write(&mut fixture, 1).is_empty());
            let sent: usize = (0..3 * kind).map(|_| fixture.ask("080#").len()).sum();
            assert_eq!(sent, 3);
        }
    }

    #[test]
    fn an_acyclic_pdo_needs_an_event_and_sync() {
        let mut fixture = fixture("", &[(2, 0)]);
        fixture.send("000#0105");
        assert!(fixture.ask("080#").is_empty());
        assert!(write(&mut fixture, 1).is_empty());
        assert_eq!(fixture.ask("080#"), ["185#010000"]);
        assert!(fixture.ask("080#").is_empty());
    }

    #[test]
    fn the_start_value_is_the_first_sync() {
        let mut fixture = fixture("", &[(2, 2), (6, 4)]);
        fixture.write(mux(0x1019, 0), &[10]).unwrap();
        fixture.send("000#0105");
        let sent: Vec<_> =
            (1..=10).filter(|n| !fixture.ask(&format!("080#{n:02X}")).is_empty()).collect();
        assert_eq!(sent, [5, 7, 9]);
    }

    #[test]
    fn remote_requests_are_answered_where_the_type_has_them() {
        let mut asked = fixture("", &[(2, 252)]);
        asked.send("000#0105");
        assert!(asked.ask("080#").is_empty());
        write(&mut asked, 1);
        assert_eq!(asked.ask("185#R3"), ["185#110000"]);
        let mut asked = fixture("", &[(2, 253)]);
        assert!(asked.ask("185#R3").is_empty());
        asked.send("000#0105");
        assert!(write(&mut asked, 1).is_empty());
        assert_eq!(asked.ask("185#R3"), ["185#010000"]);
        let mut asked = fixture("", &[(2, 255)]);
        asked.send("000#0105");
        assert_eq!(asked.ask("185#R3"), ["185#110000"]);
        let mut asked = fixture("", &[(1, 0x4000_0185)]);
        asked.send("000#0105");
        assert!(asked.ask("185#R3").is_empty());
        let mut asked = fixture("", &[(2, 1)]);
        asked.send("000#0105");
        assert!(asked.ask("185#R3").is_empty());
    }

    #[test]
    fn a_new_mapping_is_on_the_wire() {
        let mut fixture = fixture("", &[]);
        fixture.send("000#0105");
        fixture.write(mux(0x1800, 1), &[0x85, 1, 0, 0x80]).unwrap();
        fixture.write(mux(0x1A00, 0), &[0]).unwrap();
        fixture.write(mux(0x1A00, 1), &0x2002_0020u32.to_le_bytes()).unwrap();
        assert!(write(&mut fixture, 1).is_empty());
        fixture.write(mux(0x1A00, 0), &[2]).unwrap();
        fixture.write(mux(0x1800, 1), &[0x85, 1, 0, 0]).unwrap();
        assert_eq!(fixture.ask("185#R6"), ["185#112233440000"]);
    }

    #[test]
    fn the_application_decides_what_is_an_event() {
        #[derive(Clone)]
        struct EvenOnly;
        impl Behaviour for EvenOnly {
            fn triggers(&mut self, mux: Mux, last: &[u8], od: &Dictionary) -> bool {
                assert_eq!((mux.index, last.len()), (0x2000, 1));
                od.int(mux).unwrap() % 2 == 0
            }
        }
        let mut entries = full();
        set(&mut entries, mux(0x1A00, 0), 2);
        set(&mut entries, mux(0x1A00, 1), 0x2000_0008);
        set(&mut entries, mux(0x1A00, 2), 0x6000_0108);
        let (rules, settings) = (Rules::default(), NodeSettings::default());
        let mut fixture = Fixture::with(&eds(entries), settings, rules, Box::new(EvenOnly));
        fixture.send("000#0105");
        assert!(write(&mut fixture, 0x21).is_empty());
        assert_eq!(write(&mut fixture, 0x22), ["185#2200"]);
    }

    #[test]
    fn bits_share_a_byte_where_mapping_has_the_granularity() {
        let mut entries = full();
        for sub in 1..=2 {
            let bit = entry(mux(0x6020, sub), DataType::BOOLEAN, Access::Rw, 0);
            entries.push(bit);
            set(&mut entries, mux(0x1A00, sub), 0x6020_0001 + (i64::from(sub) << 8));
        }
        set(&mut entries, mux(0x1A00, 0), 2);
        let mut sheet = eds(entries);
        sheet.device.granularity = 1;
        let mut fixture = Fixture::new(&sheet);
        assert_eq!(fixture.ask("000#0105"), ["185#00"]);
        assert_eq!(fixture.ask("605#2F20600201000000"), ["585#6020600200000000", "185#02"]);
    }

    #[test]
    fn mutants_break_what_they_say() {
        let mut late = fixture("tpdo-one-sync-late", &[(2, 1)]);
        late.send("000#0105");
        assert!(late.ask("080#").is_empty());
        let mut stopped = fixture("tpdo-sent-in-stopped", &[(5, 100)]);
        stopped.send("000#0205");
        assert_eq!(stopped.until(101_000).len(), 2);
        let mut shy = fixture("tpdo-sent-at-start: false", &[]);
        assert!(shy.ask("000#0105").is_empty());
        let mut slow = fixture("tpdo-inhibit-in-milliseconds", &[(3, 100)]);
        slow.send("000#0105");
        write(&mut slow, 1);
        assert_eq!(slow.until(900_000), sent(&[(101_000, "185#010000")]));
        let mut stubborn = fixture("event-timer-restarts: false", &[(5, 100)]);
        stubborn.send("000#0105");
        stubborn.run_to(50_000);
        write(&mut stubborn, 1);
        assert_eq!(stubborn.until(150_000), sent(&[(101_000, "185#010000")]));
        let mut open = fixture("rtr-answered: true", &[(1, 0x4000_0185)]);
        open.send("000#0105");
        assert_eq!(open.ask("185#R3"), ["185#110000"]);
    }
}
