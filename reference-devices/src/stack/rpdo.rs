//! RPDOs: process data that the device receives (CiA 301, 7.2.2, objects 1400h and 1600h on).

use std::time::Duration;

use canopen::eds::Direction;
use canopen::{Data, Id, Instant, Mux};

use crate::rules::{Service, Timer};
use crate::stack::base::Base;
use crate::stack::fault::{Fault, FaultKind};
use crate::stack::pdo::{self, EVENT_TIMER, TYPE};
use crate::stack::pdo_mapping::PdoMapping;

/// One RPDO.
#[derive(Clone, Debug)]
pub(crate) struct Rpdo {
    pdo: u16,
    id: Option<Id>,
    kind: u8,
    mapping: PdoMapping,
    /// Data that take effect with the next SYNC.
    waiting: Option<Data>,
    longest_gap: Duration,
    deadline: Option<Instant>,
}

impl Rpdo {
    /// The RPDOs of the device.
    pub(crate) fn all(base: &mut Base) -> Vec<Self> {
        let rpdos = pdo::existing(&base.od, Direction::Receive);
        rpdos.into_iter().map(|pdo| Self::new(pdo, base)).collect()
    }

    fn new(pdo: u16, base: &mut Base) -> Self {
        let mapping = PdoMapping::default();
        let (waiting, deadline, longest_gap) = (None, None, Duration::ZERO);
        let mut rpdo = Self { pdo, id: None, kind: 0, mapping, waiting, longest_gap, deadline };
        rpdo.configure(base);
        rpdo
    }

    /// Whether this is the PDO counted `pdo` from 0.
    pub(crate) fn is(&self, pdo: u16) -> bool {
        self.pdo == pdo
    }

    /// Takes the parameters and clears the errors of the PDO.
    pub(crate) fn configure(&mut self, base: &mut Base) {
        base.mend(FaultKind::RpdoTimeout, self.number());
        for kind in [FaultKind::RpdoTooShort, FaultKind::RpdoTooLong] {
            base.mend(kind, base.rules.rpdo_length_error_of(self.number()));
        }
        let od = &base.od;
        let cob = pdo::cob_id(od, Direction::Receive, self.pdo);
        let parameter = |sub| {
            let pdo = base.rules.pdo_parameter_of(Direction::Receive, self.pdo, sub);
            od.int(Mux::new(pdo::communication(Direction::Receive, pdo), sub)).unwrap_or(0)
        };
        let (kind, event_time) = (parameter(TYPE) as u8, parameter(EVENT_TIMER) as u64);
        self.id = cob.valid().then(|| cob.can_id());
        self.kind = kind;
        if base.rules.new_rpdo_event_time_taken(self.deadline.is_some()) {
            self.longest_gap = Duration::from_millis(event_time);
        }
        self.mapping.load(od, pdo::mapping(Direction::Receive, self.pdo));
        if base.rules.waiting_rpdo_dropped(false) {
            self.waiting = None;
        }
        if base.rules.new_parameters_end_rpdo_deadline() {
            self.deadline = None;
        }
    }

    /// Whether a frame on identifier `id` is this PDO.
    pub(crate) fn takes(&self, id: Id) -> bool {
        self.id == Some(id) && !self.mapping.is_empty()
    }

    /// Whether the state is one in which a frame is received.
    pub(crate) fn is_received(&self, base: &Base) -> bool {
        let synchronous = matches!(self.kind, 0..=240);
        base.rules.rpdo_used_in(base.state_of(Service::Rpdo))
            || synchronous && base.rules.rpdo_waits_in(base.state)
    }

    /// Judges a frame. Returns the data when they take effect at once.
    pub(crate) fn receive(&mut self, now: Instant, data: Data, base: &mut Base) -> Option<Data> {
        if !self.judge_length(data, base) {
            return None;
        }
        if !self.longest_gap.is_zero() {
            base.mend(FaultKind::RpdoTimeout, self.number());
            self.deadline = Some(now + self.longest_gap);
        }
        match self.kind {
            // After the window of 1007h the actuation of this cycle is over (7.5.2.7).
            0..=240 if base.window_end.is_some_and(|end| end < now) => None,
            0..=240 if base.rules.synchronous_rpdo_waits() => {
                // Only the last data before a SYNC take effect.
                if self.waiting.is_none() || base.rules.synchronous_rpdo_replaced() {
                    self.waiting = Some(data);
                }
                None
            }
            // Reserved types, and types that only TPDOs have.
            241..=253 => None,
            _ => Some(data),
        }
    }

    /// The node entered OPERATIONAL.
    pub(crate) fn start(&mut self, now: Instant, base: &Base) {
        let exists = self.id.is_some() && !self.longest_gap.is_zero();
        if exists && self.deadline.is_none() && !base.rules.first_rpdo_starts_deadline() {
            self.deadline = Some(now + self.longest_gap);
        }
    }

    /// SYNC has come: the data that take effect now.
    pub(crate) fn synchronise(&mut self, base: &Base) -> Option<Data> {
        if base.rules.synchronous_rpdo_acts_once() { self.waiting.take() } else { self.waiting }
    }

    /// PDOs end with the states that have them.
    pub(crate) fn stop(&mut self, base: &Base) {
        if base.rules.waiting_rpdo_dropped(true) {
            self.waiting = None;
        }
        self.deadline = None;
    }

    pub(crate) fn mapping(&self) -> &PdoMapping {
        &self.mapping
    }

    pub(crate) fn handle_timeout(&mut self, now: Instant, base: &mut Base) {
        let rules = &base.rules;
        if self.deadline.take_if(|due| rules.elapsed(Timer::Rpdo, *due, now)).is_some() {
            base.raise(Fault::new(FaultKind::RpdoTimeout, self.number()));
        }
    }

    pub(crate) fn poll_at(&self) -> Option<Instant> {
        self.deadline
    }

    /// Tells of a wrong length. Whether the data can be used: too many bytes can, too few cannot.
    fn judge_length(&self, data: Data, base: &mut Base) -> bool {
        let (expected, actual) = (self.mapping.len(), data.len());
        let subject = base.rules.rpdo_length_error_of(self.number());
        let wrong = |kind| Fault { kind, subject, expected: expected as u8, actual: actual as u8 };
        let told = base.rules.rpdo_length_end_told();
        let mut end = |kind| match told {
            true => base.mend(kind, subject),
            false => base.errors.forget(kind, subject),
        };
        // Each of the two errors ends with a frame that does not have it, even if that frame has
        // the other one.
        if actual >= expected {
            end(FaultKind::RpdoTooShort);
        }
        if actual <= expected {
            end(FaultKind::RpdoTooLong);
        }
        if actual != expected && base.rules.rpdo_length_told() {
            let short = actual < expected;
            base.raise(wrong(match short {
                true => FaultKind::RpdoTooShort,
                false => FaultKind::RpdoTooLong,
            }));
        }
        base.rules.rpdo_length_usable(expected, actual)
    }

    /// As people count.
    fn number(&self) -> u16 {
        self.pdo + 1
    }
}

#[cfg(test)]
mod tests {
    use canopen::NmtState;
    use canopen::emcy::EmcyCode;

    use crate::rules::Rules;
    use crate::stack::testing::{Fixture, eds, full, mux, sent, set};
    use crate::stack::{EmcyForm, EmcyTable, FaultKind, Inert, NodeSettings};

    /// The first RPDO carries 6200:01, a gap of a byte, and 2001h.
    fn fixture(rules: &str, kind: u8) -> Fixture {
        let mut entries = full();
        set(&mut entries, mux(0x1400, 2), kind.into());
        set(&mut entries, mux(0x1600, 0), 3);
        set(&mut entries, mux(0x1600, 1), 0x6200_0108);
        set(&mut entries, mux(0x1600, 2), 0x0005_0008);
        set(&mut entries, mux(0x1600, 3), 0x2001_0010);
        let mut sheet = eds(entries);
        sheet.dummies = vec![5];
        match rules {
            "" => Fixture::new(&sheet),
            rules => Fixture::mutant(&sheet, rules),
        }
    }

    fn values(fixture: &mut Fixture) -> (u8, u8) {
        (fixture.read(mux(0x6200, 1)).unwrap()[0], fixture.read(mux(0x2001, 0)).unwrap()[0])
    }

    #[test]
    fn takes_effect_at_once_in_operational_only() {
        let mut fixture = fixture("", 255);
        fixture.send("205#01EE0200");
        assert_eq!(values(&mut fixture), (0, 0));
        fixture.send("000#0105");
        for ignored in ["205#R4", "00000205#01EE0200", "206#01EE0200"] {
            fixture.send(ignored);
            assert_eq!(values(&mut fixture), (0, 0));
        }
        fixture.send("205#01EE0200");
        assert_eq!(values(&mut fixture), (1, 2));
    }

    #[test]
    fn a_value_out_of_range_is_left_out() {
        let mut fixture = fixture("", 255);
        fixture.send("000#0105");
        fixture.send("205#07EEFF7F");
        assert_eq!(values(&mut fixture), (7, 0));
    }

    #[test]
    fn the_last_synchronous_data_take_effect_with_sync() {
        for kind in [0, 1, 240] {
            let mut fixture = fixture("", kind);
            fixture.send("000#0105");
            fixture.send("205#01000100");
            fixture.send("205#02000200");
            assert_eq!(values(&mut fixture), (0, 0));
            fixture.send("080#");
            assert_eq!(values(&mut fixture), (2, 2));
            fixture.send("205#03000300");
            fixture.send("000#8005");
            fixture.send("000#0105");
            fixture.send("080#");
            assert_eq!(values(&mut fixture), (2, 2));
        }
    }

    #[test]
    fn a_wrong_length_is_told_once_and_taken_back() {
        let mut fixture = fixture("", 255);
        fixture.send("000#0105");
        assert_eq!(fixture.ask("205#010000"), ["085#1082110000000000"]);
        assert!(fixture.ask("205#010000").is_empty());
        assert_eq!(values(&mut fixture), (0, 0));
        assert_eq!(fixture.ask("205#0100010099"), ["085#0000000000000000", "085#2082110000000000"]);
        assert_eq!(values(&mut fixture), (1, 1));
        assert_eq!(fixture.ask("205#02000200"), ["085#0000000000000000"]);
        assert_eq!(values(&mut fixture), (2, 2));
    }

    #[test]
    fn new_parameters_end_an_error() {
        let mut fixture = fixture("", 255);
        fixture.send("000#0105");
        fixture.send("205#01");
        assert_eq!(fixture.read(mux(0x1001, 0)), Ok(vec![0x11]));
        fixture.write(mux(0x1400, 1), &[5, 2, 0, 0x80]).unwrap();
        assert_eq!(fixture.read(mux(0x1001, 0)), Ok(vec![0]));
    }

    #[test]
    fn a_missed_deadline_is_told() {
        let mut fixture = fixture("", 255);
        fixture.write(mux(0x1400, 5), &[50, 0]).unwrap();
        fixture.send("000#0105");
        assert_eq!(fixture.until(500_000), []);
        fixture.send("205#01000100");
        assert_eq!(fixture.until(900_000), sent(&[(550_000, "085#5082110000000000")]));
        assert_eq!(fixture.ask("205#01000100"), ["085#0000000000000000"]);
    }

    #[test]
    fn a_pdo_that_does_not_exist_is_ignored() {
        let mut fixture = fixture("", 255);
        fixture.send("000#0105");
        fixture.write(mux(0x1400, 1), &[5, 2, 0, 0x80]).unwrap();
        fixture.send("205#01000100");
        assert_eq!(values(&mut fixture), (0, 0));
        assert!(fixture.ask("305#0102").is_empty());
    }

    #[test]
    fn a_missed_deadline_may_be_a_communication_error() {
        for (error_class, state) in
            [(Some(1), NmtState::PRE_OPERATIONAL), (None, NmtState::OPERATIONAL)]
        {
            let form = EmcyForm { error_class, ..EmcyForm::new(EmcyCode::COMMUNICATION, 1) };
            let faults = [(FaultKind::RpdoTimeout, form)].into();
            let emcy = EmcyTable { faults, ..EmcyTable::default() };
            let settings = NodeSettings { emcy, ..NodeSettings::default() };
            let mut entries = full();
            set(&mut entries, mux(0x1400, 2), 255);
            set(&mut entries, mux(0x1400, 5), 50);
            set(&mut entries, mux(0x1600, 0), 1);
            set(&mut entries, mux(0x1600, 1), 0x6200_0108);
            let mut fixture =
                Fixture::with(&eds(entries), settings, Rules::default(), Box::new(Inert));
            fixture.send("000#0105");
            fixture.send("205#01");
            fixture.run_to(500_000);
            assert_eq!(fixture.node.state(), state, "{error_class:?}");
        }
    }

    #[test]
    fn mutants_break_what_they_say() {
        let mut first = fixture("synchronous-rpdo-replaced: false", 1);
        first.send("000#0105");
        first.send("205#01000100");
        first.send("205#02000200");
        first.send("080#");
        assert_eq!(values(&mut first), (1, 1));
        let mut again = fixture("synchronous-rpdo-acts-once: false", 1);
        again.send("000#0105");
        again.send("205#01000100");
        again.send("080#");
        again.write(mux(0x6200, 1), &[9]).unwrap();
        again.send("080#");
        assert_eq!(values(&mut again), (1, 1));
        let mut dense = fixture("gap-takes-room: false", 255);
        dense.send("000#0105");
        dense.send("205#01020003");
        assert_eq!(values(&mut dense), (1, 2));
        let mut eager = fixture("first-rpdo-starts-deadline: false", 255);
        eager.write(mux(0x1400, 5), &[50, 0]).unwrap();
        eager.send("000#0105");
        assert_eq!(eager.until(500_000).len(), 1);
        let mut early = fixture("rpdo-used-in: true", 255);
        early.send("205#01000100");
        assert_eq!(values(&mut early), (1, 1));
        let mut short = fixture("rpdo-length-usable: true", 255);
        short.send("000#0105");
        short.send("205#01");
        assert_eq!(values(&mut short), (1, 0));
        let mut quiet = fixture("rpdo-length-told: false", 255);
        quiet.send("000#0105");
        assert!(quiet.ask("205#01").is_empty());
        let mut early = fixture("synchronous-rpdo-waits: false", 1);
        early.send("000#0105");
        early.send("205#01000100");
        assert_eq!(values(&mut early), (1, 1));
    }
}
