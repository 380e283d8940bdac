//! TPDOs: process data that the device transmits (CiA 301, 7.2.2, objects 1800h and 1A00h on).

use std::time::Duration;

use canopen::eds::Direction;
use canopen::pdo::{CobId, Unpacker};
use canopen::sync::Sync;
use canopen::{Data, Frame, Instant, Mux, Outbox};

use crate::behaviour::Behaviour;
use crate::pdo::{self, EVENT_TIMER, INHIBIT_TIME, SYNC_START, TYPE};
use crate::pdo_mapping::PdoMapping;
use crate::services::Base;
use crate::time::{earlier, next_beat};

/// One TPDO.
#[derive(Debug)]
pub(crate) struct Tpdo {
    pdo: u16,
    cob: CobId,
    kind: u8,
    inhibit: Duration,
    period: Duration,
    sync_start: u8,
    mapping: PdoMapping,
    running: bool,
    /// What the next change is a change from.
    last: Data,
    /// An event waits for the end of the inhibit time, or for SYNC.
    pending: bool,
    /// End of the inhibit time.
    free_at: Instant,
    /// When the event timer elapses.
    due: Option<Instant>,
    /// SYNC messages since the last transmission; `None` until the start value has come.
    syncs: Option<u8>,
    /// What type 252 answers with.
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

    /// Takes the parameters; counting and timing begin anew.
    pub(crate) fn configure(&mut self, now: Instant, base: &Base) {
        let od = &base.od;
        let communication = pdo::communication(Direction::Transmit, self.pdo);
        let parameter = |sub| od.int(Mux::new(communication, sub)).unwrap_or(0);
        self.cob = pdo::cob_id(od, Direction::Transmit, self.pdo);
        self.kind = parameter(TYPE) as u8;
        self.inhibit = base.rules.pdo_inhibit(parameter(INHIBIT_TIME) as u16);
        self.period = Duration::from_millis(parameter(EVENT_TIMER) as u64);
        self.sync_start = parameter(SYNC_START) as u8;
        self.mapping.load(od, pdo::mapping(Direction::Transmit, self.pdo));
        self.restart(now, base);
    }

    /// The node entered a state. In OPERATIONAL, event-driven PDOs tell where they stand.
    pub(crate) fn enter(&mut self, now: Instant, base: &Base, out: &mut Outbox) {
        let runs = base.rules.tpdo_sent_in(base.state);
        if runs == self.running {
            return;
        }
        self.running = runs;
        self.restart(now, base);
        if self.is_active() && self.is_event_driven() && base.rules.tpdo_sent_at_start() {
            self.event(now, base, out);
        }
    }

    /// Objects may have changed: transmits when the application calls that an event.
    pub(crate) fn compare(
        &mut self,
        now: Instant,
        base: &Base,
        behaviour: &dyn Behaviour,
        out: &mut Outbox,
    ) {
        let by_change = self.is_event_driven() || self.kind == 0;
        if !self.is_active() || !by_change || self.pending {
            return;
        }
        let data = self.mapping.pack(&base.od);
        if data != self.last && self.is_event(base, behaviour) {
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
                if self.syncs.is_none() && self.sync_start != 0 && !starts {
                    return;
                }
                let count = self.syncs.unwrap_or(0).saturating_add(1);
                self.syncs = Some(count);
                if base.rules.cyclic_tpdo_due(count, self.kind) {
                    self.syncs = Some(0);
                    self.transmit(now, base, out);
                }
            }
            252 => self.sampled = Some(self.mapping.pack(&base.od)),
            _ => {}
        }
    }

    /// A remote frame.
    pub(crate) fn handle_request(&mut self, now: Instant, id: u16, base: &Base, out: &mut Outbox) {
        let asked = self.is_active() && self.cob.can_id() == id;
        if !asked || !base.rules.rtr_answered(self.cob) {
            return;
        }
        match (self.kind, self.sampled) {
            (252, Some(sampled)) => out.push(Frame::new(id, sampled)),
            (252 | 253, _) => self.transmit(now, base, out),
            (254.., _) => self.event(now, base, out),
            _ => {}
        }
    }

    pub(crate) fn handle_timeout(&mut self, now: Instant, base: &Base, out: &mut Outbox) {
        if let Some(due) = self.due.filter(|due| *due <= now) {
            self.event(now, base, out);
            self.due = Some(next_beat(due, self.period, now));
        }
        if self.waits_for_inhibit() && self.free_at <= now {
            self.transmit(now, base, out);
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
        self.last = self.mapping.pack(&base.od);
        self.pending = false;
        out.push(Frame::new(self.cob.can_id(), self.last));
        if self.is_event_driven() {
            self.free_at = now + self.inhibit;
            if base.rules.event_timer_restarts() {
                self.start_timer(now);
            }
        }
    }

    fn restart(&mut self, now: Instant, base: &Base) {
        self.last = self.mapping.pack(&base.od);
        self.pending = false;
        self.free_at = now;
        self.syncs = None;
        self.sampled = None;
        self.due = None;
        if self.is_active() && self.is_event_driven() {
            self.start_timer(now);
        }
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

    fn is_event(&self, base: &Base, behaviour: &dyn Behaviour) -> bool {
        let mut last = Unpacker::new(self.last);
        self.mapping.entries().iter().any(|entry| {
            let bytes = usize::from(entry.bits.div_ceil(8)).min(8);
            let before = &last.take(entry.bits)[..bytes];
            let now = base.od.get(entry.mux).unwrap_or_default();
            before != now && behaviour.triggers(entry.mux, before, &base.od)
        })
    }
}
