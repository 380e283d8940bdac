//! Whose an identifier is, by the present parameters of the model.

use std::ops::RangeInclusive;
use std::sync::Arc;
use std::time::Duration;

use canopen::pdo::CobId;
use canopen::sdo::RESPONSE_COB_ID;
use canopen::{Dictionary, Frame, Id, Instant, Mux, emcy, lss};

use super::{SYNC, error_control};
use crate::model::Model;

/// The service of a frame of the device.
#[derive(Clone, Debug)]
pub(super) enum Class {
    Sdo,
    ErrorControl,
    Emergency,
    Lss,
    Tpdo(Arc<Tpdo>),
    /// SYNC, TIME, SDO clients, and what nobody has.
    Other,
}

/// A TPDO as it is configured.
#[derive(Clone, Debug)]
pub(super) struct Tpdo {
    id: Id,
    /// The object with its communication parameters.
    pub(super) index: u16,
    pub(super) kind: u8,
    /// Whether its kind leaves it to events when it is sent, or the one before a change did.
    pub(super) by_events: bool,
    pub(super) inhibit: Duration,
    pub(super) period: Duration,
    /// What it maps, and after that what it may have mapped before a change.
    pub(super) mapped: Vec<Mux>,
    /// How many bits each takes that it maps.
    bits: Vec<u8>,
    /// The length of its frames.
    pub(super) bytes: usize,
}

/// A service with an identifier that can be changed, which is no PDO.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Other {
    Server,
    Emergency,
}

/// The identifiers of a node.
#[derive(Clone, Debug)]
pub(super) struct Identifiers {
    node: u8,
    /// At which change of the dictionary the rest was looked at.
    looked: Option<u64>,
    /// Those of further SDO servers and of EMCY.
    others: Vec<(Id, Other)>,
    /// Those of RPDOs and of SYNC.
    received: Vec<Id>,
    tpdos: Vec<Arc<Tpdo>>,
    /// TPDOs as they were, and until when: the last ones at the end.
    former: Vec<(Instant, Arc<Tpdo>)>,
    /// The others as they were.
    former_others: Vec<(Instant, Id, Other)>,
}

impl Identifiers {
    pub(super) fn new(node: u8) -> Self {
        Self {
            node,
            looked: None,
            others: Vec::new(),
            received: Vec::new(),
            tpdos: Vec::new(),
            former: Vec::new(),
            former_others: Vec::new(),
        }
    }

    /// The dictionary is another one.
    pub(super) const fn forget(&mut self) {
        self.looked = None;
    }

    /// The service of a frame, which may have been sent up to `late` before a change of its
    /// identifier.
    pub(super) fn class(
        &mut self,
        frame: &Frame,
        model: &Model,
        now: Instant,
        late: Duration,
    ) -> Class {
        let (id, nodes) = (frame.id, [self.node, model.id()]);
        if nodes.map(|it| Id::standard(RESPONSE_COB_ID + u16::from(it))).contains(&id) {
            return Class::Sdo;
        }
        if nodes.map(|it| Id::standard(error_control(it))).contains(&id) {
            return Class::ErrorControl;
        }
        if id == Id::standard(lss::RESPONSE_COB_ID) {
            return Class::Lss;
        }
        self.look(model.dictionary(), now);
        let recent = |until: Instant| until + late.max(HELD) >= now;
        let other = self.others.iter().find(|(known, _)| *known == id).map(|(_, other)| *other);
        let former = self.former.iter().rev().filter(|(until, _)| recent(*until));
        let mut tpdos = self.tpdos.iter().chain(former.map(|(_, tpdo)| tpdo));
        // A mapping that was changed may be the one before. Nothing keeps a user from giving a TPDO
        // the identifier of another service: what its application decides is judged as a TPDO.
        let fits = |tpdo: &&Arc<Tpdo>| tpdo.id == id && tpdo.bytes == frame.data.len();
        let mut fitting = tpdos.clone().filter(fits);
        let tpdo = fitting.next().cloned().map(|mut tpdo| {
            // It may be any of them.
            for other in fitting {
                let tpdo = Arc::make_mut(&mut tpdo);
                tpdo.mapped.extend(&other.mapped);
                tpdo.by_events |= other.by_events;
            }
            tpdo
        });
        let tpdo = tpdo.or_else(|| {
            let others = tpdos.find(|tpdo| tpdo.id == id).filter(|_| other.is_none());
            others.cloned()
        });
        let former = self.former_others.iter().rev();
        let mut former = former.filter(|(until, known, _)| *known == id && recent(*until));
        match (tpdo, other.or_else(|| former.next().map(|(.., other)| *other))) {
            (Some(tpdo), _) => Class::Tpdo(tpdo),
            (None, Some(Other::Server)) => Class::Sdo,
            (None, Some(Other::Emergency)) => Class::Emergency,
            (None, None) => Class::Other,
        }
    }

    /// Whether a frame gives values to the objects that RPDOs map.
    pub(super) fn is_received(&mut self, frame: &Frame, model: &Model, now: Instant) -> bool {
        self.look(model.dictionary(), now);
        frame.any_data_id().is_some_and(|id| self.received.contains(&id))
    }

    /// Takes note of what the dictionary says now, which a frame that waits may not any more.
    pub(super) fn look(&mut self, od: &Dictionary, now: Instant) {
        let looked = self.looked.replace(od.changes());
        let mut changed = looked.and_then(|count| od.changed_since(count));
        if changed.as_mut().is_some_and(|all| all.all(|mux| !COMMUNICATION.contains(&mux.index))) {
            return;
        }
        if self.former.len() > MOST_FORMER {
            self.former.drain(..MOST_FORMER / 2);
        }
        self.former.extend(self.tpdos.drain(..).map(|tpdo| (now, tpdo)));
        if self.former_others.len() > MOST_FORMER {
            self.former_others.drain(..MOST_FORMER / 2);
        }
        self.former_others.extend(self.others.drain(..).map(|(id, other)| (now, id, other)));
        let valid = |mux: Mux| {
            let cob = CobId(od.int(mux)? as u32);
            cob.valid().then(|| cob.can_id())
        };
        let servers = od.entries_in(0x1201..=0x127F).iter().filter(|entry| entry.mux.sub == 2);
        let servers = servers.filter_map(|entry| Some((valid(entry.mux)?, Other::Server)));
        let predefined = Id::standard(emcy::COB_ID + u16::from(self.node));
        let emergency = Mux::new(0x1014, 0);
        let emergency = match od.int(emergency) {
            Some(_) => valid(emergency),
            None => Some(predefined),
        };
        self.others = servers.chain(emergency.map(|id| (id, Other::Emergency))).collect();
        let parameters = |indices| od.entries_in(indices).iter().filter(|entry| entry.mux.sub == 1);
        let rpdos = parameters(0x1400..=0x15FF).filter_map(|entry| valid(entry.mux));
        let sync = od.int(Mux::new(SYNC, 0)).map(|cob| CobId(cob as u32).can_id());
        self.received = rpdos.chain(sync).collect();
        let tpdos = parameters(0x1800..=0x19FF)
            .filter_map(|entry| Tpdo::new(od, entry.mux.index, valid(entry.mux)?).map(Arc::new));
        self.tpdos = tpdos.collect();
    }
}

/// The objects that identifiers and mappings are in (CiA 301, 7.4.3).
const COMMUNICATION: RangeInclusive<u16> = 0x1000..=0x1FFF;

/// How long a device may hold a frame that is ready: its stack may be called in a cycle of 30 ms,
/// and 8 ms are what any frame may be late.
pub(super) const HELD: Duration = Duration::from_millis(40);

/// How many identifiers as they were are remembered.
const MOST_FORMER: usize = 64;

impl Tpdo {
    fn new(od: &Dictionary, index: u16, id: Id) -> Option<Self> {
        let parameter = |sub| od.int(Mux::new(index, sub)).unwrap_or(0);
        let entries = od.mapped(index)?;
        let bits: u32 = entries.iter().map(|entry| u32::from(entry.bits)).sum();
        let kind = parameter(2) as u8;
        Some(Self {
            id,
            index,
            kind,
            by_events: matches!(kind, 0 | 254..),
            inhibit: Duration::from_micros(100) * parameter(3) as u32,
            period: Duration::from_millis(parameter(5) as u64),
            mapped: entries.iter().map(|entry| entry.mux).collect(),
            bits: entries.iter().map(|entry| entry.bits).collect(),
            bytes: bits.div_ceil(8).min(8) as usize,
        })
    }

    /// Whether two frames have the same values, but for the objects that are `open`; also where
    /// they are none of this mapping.
    pub(super) fn agree(&self, one: &Frame, other: &Frame, open: impl Fn(Mux) -> bool) -> bool {
        let all: u32 = self.bits.iter().map(|bits| u32::from(*bits)).sum();
        if all > u64::BITS || one.data.len() != self.bytes || other.data.len() != self.bytes {
            return true;
        }
        let [one, other] = [one, other].map(|it| u64::from_le_bytes(it.data.padded()));
        let mut differs = one ^ other;
        self.mapped.iter().zip(&self.bits).all(|(mux, bits)| {
            let mask = u64::MAX.checked_shr(u64::BITS - u32::from(*bits)).unwrap_or(0);
            let same = differs & mask == 0;
            differs = differs.checked_shr(u32::from(*bits)).unwrap_or(0);
            same || open(*mux)
        })
    }
}
