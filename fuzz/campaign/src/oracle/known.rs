//! Which values of a device are known to a judge that only listens: those that were read or written
//! since it has been listening. What a device has stored before, nobody has seen.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::RangeInclusive;

use canopen::emcy::{Emcy, EmcyCode};
use canopen::pdo::CobId;
use canopen::{Data, Dictionary, Frame, Mux, NmtState, lss};

use super::What;
use super::identifiers::{Class, Tpdo};
use crate::blueprint::Blueprint;
use crate::model::Model;

/// What is known.
#[derive(Clone, Debug, Default)]
pub(super) struct Known {
    /// The values that may be others than the data sheet says, until they are seen; none where a
    /// session is played, which begins with a look at them.
    open: BTreeSet<Mux>,
    /// What the device has after a reset.
    boot: BTreeMap<Mux, Data>,
    /// What has been read or written since.
    now: BTreeSet<Mux>,
    /// The objects that say in which state the device starts.
    startup: Vec<Mux>,
    /// Whether nobody knows in which state it is.
    somewhere: bool,
    /// Whether nobody knows what it did since it booted.
    joined: bool,
    /// Whether nobody knows whether it is in LSS configuration state.
    lss_open: bool,
}

impl Known {
    /// Before anything was heard.
    pub(super) fn new(blueprint: &Blueprint) -> Self {
        if !blueprint.listens() {
            return Self::default();
        }
        let entries = blueprint.eds().entries();
        let open = entries.filter(|entry| {
            let states = STATES.contains(&entry.mux.index);
            let fixed = entry.default.is_some() && !entry.access.writable();
            !blueprint.is_of_application(entry.mux) && !states && !fixed
        });
        let mut open: BTreeSet<Mux> = open.map(|entry| entry.mux).collect();
        let settings = blueprint.settings();
        open.extend(
            [settings.boot_up_state_object, settings.time_interval_object].iter().flatten(),
        );
        let startup = [Some(Mux::new(0x1F80, 0)), settings.boot_up_state_object];
        let startup = startup.into_iter().flatten().filter(|mux| open.contains(mux));
        Self { startup: startup.collect(), open, ..Self::default() }
    }

    /// The device has this value after a reset.
    pub(super) fn is_stored(&mut self, mux: Mux, value: Data) {
        self.boot.insert(mux, value);
        self.now.insert(mux);
    }

    /// What the device has after a reset.
    pub(super) const fn boot(&self) -> &BTreeMap<Mux, Data> {
        &self.boot
    }

    /// Whether an object may have any value.
    pub(super) fn lacks(&self, mux: Mux) -> bool {
        self.open.contains(&mux) && !self.now.contains(&mux)
    }

    /// A value was written.
    pub(super) fn wrote(&mut self, mux: Mux, od: &Dictionary) {
        self.now.insert(mux);
        let group = match (mux.index, mux.sub) {
            (STORE, 1) => 0x1000..=0xFFFF,
            (STORE, 2) => 0x1000..=0x1FFF,
            (STORE, 3) => 0x6000..=0x9FFF,
            _ => return,
        };
        let now = self.now.iter().filter(|it| self.open.contains(it) && group.contains(&it.index));
        let values = now.filter_map(|mux| Some((*mux, Data::new(od.get(*mux)?))));
        self.boot.extend(values);
    }

    /// The device has been running.
    pub(super) const fn join(&mut self) {
        (self.joined, self.lss_open) = (true, true);
    }

    /// Whether nobody knows what the device did since it booted.
    pub(super) const fn is_joined(&self) -> bool {
        self.joined
    }

    /// The device got a frame, which may say in which LSS state it is.
    pub(super) fn hears(&mut self, frame: &Frame) {
        if frame.data_id() == Some(lss::REQUEST_COB_ID)
            && let Ok(lss::Request::SwitchGlobal(_)) = lss::Request::decode(&frame.data)
        {
            self.lss_open = false;
        }
    }

    /// The device was commanded to enter a state. Returns whether nobody knew in which it was.
    pub(super) const fn enters(&mut self) -> bool {
        std::mem::replace(&mut self.somewhere, false)
    }

    /// Whether an object was written since the device booted.
    pub(super) fn is_written(&self, mux: Mux) -> bool {
        self.now.contains(&mux)
    }

    /// The device has booted, and so has the model. `od` is what it has then; none where it has
    /// another node-ID for a time, with which defaults change.
    pub(super) fn booted(&mut self, od: Option<&Dictionary>) {
        self.now = self.boot.keys().copied().collect();
        (self.joined, self.lss_open) = (false, false);
        self.somewhere = self.startup.iter().any(|mux| self.lacks(*mux));
        for (mux, value) in &mut self.boot {
            if let Some(bytes) = od.and_then(|od| od.get(*mux)) {
                *value = Data::new(bytes);
            }
        }
    }

    /// Whether nothing is unknown on which something wrong depends.
    pub(super) fn decides(&self, class: &Class, what: &What, model: &Model) -> bool {
        let frame = match what {
            What::Unexpected(frame, _) | What::Missing(frame, _) | What::Inhibited(frame, _) => {
                frame
            }
            What::Ended(_) | What::Differs(_) => return true,
        };
        let od = model.dictionary();
        match class {
            // The object is looked at where the frame is compared.
            Class::Sdo => true,
            Class::Lss => !self.lss_open && (!is_of_identity(frame) || self.knows(&[IDENTITY])),
            _ if self.somewhere => false,
            Class::ErrorControl => {
                // With 1017h = 0 it is guarding, which has a toggle bit.
                let guards = od.int(Mux::new(HEARTBEAT, 0)) == Some(0);
                self.knows(&[HEARTBEAT..=HEARTBEAT]) && !(guards && self.joined)
            }
            Class::Tpdo(tpdo) => self.decides_tpdo(tpdo, what, model),
            // How long it is does not depend on what it says.
            Class::Emergency if frame.data.len() != 8 => {
                !self.lacks(Mux::new(*EMERGENCY.start(), 0))
            }
            Class::Emergency => self.knows(&[EMERGENCY]) && self.knows(causes(frame)),
            Class::Other if is_sync(frame, od) => !self.joined && self.knows(&[SYNC, OVERFLOW]),
            Class::Other => self.knows(&[SYNC, 0x1012..=0x1015, SERVERS, TPDOS]),
        }
    }

    fn decides_tpdo(&self, tpdo: &Tpdo, what: &What, model: &Model) -> bool {
        if self.lacks(Mux::new(tpdo.index, 1)) {
            return false;
        }
        let mapping = tpdo.index + 0x200;
        let count = model.dictionary().int(Mux::new(mapping, 0)).unwrap_or(0).clamp(0, 64) as u8;
        let mapped = (0..=count).all(|sub| !self.lacks(Mux::new(mapping, sub)));
        if let What::Unexpected(frame, other) = what {
            // That none may come, the state says, and how long it is, the mapping.
            let other = other.is_some_and(|it| it.data.len() != frame.data.len());
            if model.state() != NmtState::OPERATIONAL || other && mapped {
                return true;
            }
        }
        // How many SYNC have come since the last one.
        let counts = self.joined && (2..=240).contains(&tpdo.kind);
        let by_sync = tpdo.kind <= 240;
        mapped
            && !counts
            && self.knows(&[tpdo.index..=tpdo.index])
            && (!by_sync || self.knows(&[SYNC]))
    }

    /// Whether nothing is unknown on which a device looks when an object is written.
    pub(super) fn decides_write(&self, mux: Mux) -> bool {
        let family = match mux.index {
            0x1005..=0x1007 | 0x1019 => [SYNC, OVERFLOW],
            HEARTBEAT | 0x100C | 0x100D => [HEARTBEAT..=HEARTBEAT, GUARDING],
            0x1014 | 0x1015 => [EMERGENCY, EMERGENCY],
            0x1400..=0x1BFF => [mux.index & !MAPPING, mux.index | MAPPING].map(|it| it..=it),
            index => [index..=index, index..=index],
        };
        let mut open = self.open.iter().filter(|other| **other != mux && !self.now.contains(other));
        !open.any(|mux| family.iter().any(|range| range.contains(&mux.index)))
    }

    /// Whether all objects of these indices are known.
    fn knows(&self, indices: &[RangeInclusive<u16>]) -> bool {
        let known = |range: &RangeInclusive<u16>| {
            let all = Mux::new(*range.start(), 0)..=Mux::new(*range.end(), u8::MAX);
            self.open.range(all).all(|mux| self.now.contains(mux))
        };
        indices.iter().all(known)
    }
}

/// The objects that say when a device sends an emergency message like this.
fn causes(frame: &Frame) -> &'static [RangeInclusive<u16>] {
    match Emcy::decode(&frame.data).map(|emcy| emcy.code) {
        Ok(EmcyCode::HEARTBEAT) => &[CONSUMER, GUARDING],
        Ok(EmcyCode::COMMUNICATION | EmcyCode::SYNC_LENGTH) => &[SYNC],
        Ok(EmcyCode::PDO_LENGTH | EmcyCode::PDO_TOO_LONG | EmcyCode::RPDO_TIMEOUT) => &[RPDOS],
        Ok(_) | Err(_) => &[CONSUMER, GUARDING, SYNC, RPDOS],
    }
}

fn is_sync(frame: &Frame, od: &Dictionary) -> bool {
    let cob = od.int(Mux::new(0x1005, 0)).map(|cob| CobId(cob as u32).can_id());
    cob.is_some() && cob == frame.any_data_id()
}

/// Whether an answer of the LSS depends on the identity of a device.
fn is_of_identity(frame: &Frame) -> bool {
    frame.data.first().is_some_and(|command| matches!(command, 0x44 | 0x4F | 0x50 | 0x5A..=0x5D))
}

/// Objects that show a state or take a command, and keep no value.
const STATES: [u16; 6] = [0x1001, 0x1002, 0x1003, 0x1010, 0x1011, 0x1013];
const STORE: u16 = 0x1010;
const HEARTBEAT: u16 = 0x1017;
/// The difference of the indices of the mapping of a PDO and its communication parameters.
const MAPPING: u16 = 0x0200;
const SYNC: RangeInclusive<u16> = 0x1005..=0x1007;
const GUARDING: RangeInclusive<u16> = 0x100C..=0x100D;
const EMERGENCY: RangeInclusive<u16> = 0x1014..=0x1015;
const CONSUMER: RangeInclusive<u16> = 0x1016..=0x1016;
const IDENTITY: RangeInclusive<u16> = 0x1018..=0x1018;
const OVERFLOW: RangeInclusive<u16> = 0x1019..=0x1019;
const SERVERS: RangeInclusive<u16> = 0x1200..=0x12FF;
const RPDOS: RangeInclusive<u16> = 0x1400..=0x17FF;
const TPDOS: RangeInclusive<u16> = 0x1800..=0x19FF;
