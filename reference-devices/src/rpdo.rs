//! RPDOs: process data that the device receives (CiA 301, 7.2.2, objects 1400h and 1600h on).

use std::time::Duration;

use canopen::eds::Direction;
use canopen::{Data, Instant, Mux};

use crate::errors::{Fault, FaultKind};
use crate::pdo::{self, EVENT_TIMER, TYPE};
use crate::pdo_mapping::PdoMapping;
use crate::services::Base;

/// One RPDO.
#[derive(Debug)]
pub(crate) struct Rpdo {
    pdo: u16,
    id: Option<u16>,
    kind: u8,
    mapping: PdoMapping,
    /// Data that take effect with the next SYNC.
    waiting: Option<Data>,
    longest_gap: Duration,
    deadline: Option<Instant>,
}

impl Rpdo {
    /// The RPDOs of the device.
    pub(crate) fn all(base: &Base) -> Vec<Self> {
        let rpdos = pdo::existing(&base.od, Direction::Receive);
        rpdos.into_iter().map(|pdo| Self::new(pdo, base)).collect()
    }

    fn new(pdo: u16, base: &Base) -> Self {
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

    /// Takes the parameters.
    pub(crate) fn configure(&mut self, base: &Base) {
        let od = &base.od;
        let cob = pdo::cob_id(od, Direction::Receive, self.pdo);
        let communication = pdo::communication(Direction::Receive, self.pdo);
        let parameter = |sub| od.int(Mux::new(communication, sub)).unwrap_or(0);
        self.id = cob.valid().then(|| cob.can_id());
        self.kind = parameter(TYPE) as u8;
        self.longest_gap = Duration::from_millis(parameter(EVENT_TIMER) as u64);
        self.mapping.load(od, pdo::mapping(Direction::Receive, self.pdo));
        self.waiting = None;
        self.deadline = None;
    }

    /// Whether a frame on identifier `id` is this PDO.
    pub(crate) fn takes(&self, id: u16) -> bool {
        self.id == Some(id) && !self.mapping.is_empty()
    }

    /// Judges a frame. Returns the data when they take effect at once.
    pub(crate) fn receive(&mut self, now: Instant, data: Data, base: &mut Base) -> Option<Data> {
        if !self.judge_length(data, base) {
            return None;
        }
        if !self.longest_gap.is_zero() {
            base.errors.remove(FaultKind::RpdoTimeout, self.number());
            self.deadline = Some(now + self.longest_gap);
        }
        match self.kind {
            0..=240 if base.rules.synchronous_rpdo_waits() => {
                self.waiting = Some(data);
                None
            }
            241..=253 => None,
            _ => Some(data),
        }
    }

    /// SYNC has come: the data that take effect now.
    pub(crate) fn synchronise(&mut self) -> Option<Data> {
        self.waiting.take()
    }

    /// PDOs end with the states that have them.
    pub(crate) fn stop(&mut self) {
        self.waiting = None;
        self.deadline = None;
    }

    pub(crate) fn mapping(&self) -> &PdoMapping {
        &self.mapping
    }

    pub(crate) fn handle_timeout(&mut self, now: Instant, base: &mut Base) {
        if self.deadline.take_if(|due| *due <= now).is_some() {
            base.raise(Fault::new(FaultKind::RpdoTimeout, self.number()));
        }
    }

    pub(crate) fn poll_at(&self) -> Option<Instant> {
        self.deadline
    }

    /// Tells of a wrong length. Whether the data can be used: too many bytes can, too few cannot.
    fn judge_length(&self, data: Data, base: &mut Base) -> bool {
        let (expected, actual) = (self.mapping.len(), data.len());
        let wrong = |kind| Fault {
            kind,
            subject: self.number(),
            expected: expected as u8,
            actual: actual as u8,
        };
        if actual >= expected {
            base.errors.remove(FaultKind::RpdoTooShort, self.number());
        }
        if actual <= expected {
            base.errors.remove(FaultKind::RpdoTooLong, self.number());
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
