//! Actions that make sense one after the other, and are drawn at once.

use canopen::Mux;
use canopen::eds::Direction;
use canopen::heartbeat::guarding_request;
use canopen::lss::{Fastscan, Mode, Part, Request as Lss, UNCONFIGURED};
use canopen::nmt::{Command, Service};
use canopen::pdo::{CobId, Mapping};
use canopen::sdo::Request;

use super::configure::communication;
use super::cycles::{RPDO_KINDS, TPDO_KINDS, Usage};
use super::{Draw, Scene};
use crate::action::{Action, Kind, Then};
use crate::talk::Open;

/// In how many of a hundred cases a plan goes on: what comes between may matter, too.
const AS_PLANNED: u8 = 92;
/// How many objects are remembered that were written.
const REMEMBERED: usize = 16;
/// The bits of a PDO.
const ROOM: u32 = 64;

impl Draw<'_> {
    /// What is planned next.
    pub(super) fn as_planned(&mut self, scene: Scene<'_>) -> Option<Action> {
        if self.planned.is_empty() || !scene.talk.is_idle() || !self.chance(AS_PLANNED) {
            return None;
        }
        self.planned.pop_front()
    }

    pub(super) fn plan(&mut self, action: Option<Action>) {
        let allowed = action.filter(|action| !self.blueprint.spares(action.does));
        self.planned.extend(allowed);
    }

    /// An object was written.
    pub(super) fn remember(&mut self, mux: Mux) {
        self.remembered.retain(|other| *other != mux);
        if self.remembered.len() == REMEMBERED {
            self.remembered.pop_front();
        }
        self.remembered.push_back(mux);
    }

    /// A device that starts anew is looked at, mostly.
    pub(super) fn after_a_reset(&mut self) {
        if self.planned.is_empty() && self.chance(50) {
            self.plan_to_read_again();
        }
    }

    /// Objects that were written are read.
    fn plan_to_read_again(&mut self) {
        for _ in 0..=self.below(3) {
            let place = self.below(self.remembered.len());
            let read = self.remembered.get(place).copied().map(Request::Upload);
            let read = read.map(|request| self.asks(Kind::Upload, request));
            self.plan(read);
        }
    }

    /// Errors that came and went are read, the number of those that are remembered first.
    pub(super) fn plan_to_read_errors(&mut self) {
        if self.blueprint.judges_errors() {
            for sub in [0, 1 + self.below(9) as u8] {
                let read = self.asks(Kind::Upload, Request::Upload(Mux::new(0x1003, sub)));
                self.plan(Some(read));
            }
        }
    }

    /// The configuration is signed, changed, and the signature is read.
    pub(super) fn whole_signature(&mut self, scene: Scene<'_>) -> Option<Action> {
        let signature = [1, 2].map(|sub| Mux::new(0x1020, sub));
        for mux in signature {
            scene.od.entry(mux).filter(|entry| entry.access.writable())?;
            let value = 1 + u32::from(self.byte());
            let write = self.writes(Kind::Download, mux, &value.to_le_bytes());
            self.plan(write);
        }
        let change = self.pick(&[
            Kind::ConfigurePdo,
            Kind::ConfigureErrorControl,
            Kind::ConfigureErrors,
            Kind::Download,
        ])?;
        let change = self.action(change, scene);
        self.plan(change);
        for mux in signature {
            let read = self.asks(Kind::Upload, Request::Upload(mux));
            self.plan(Some(read));
        }
        self.planned.pop_front()
    }

    /// What was stored is looked at after a reset.
    pub(super) fn plan_to_come_back(&mut self, scene: Scene<'_>) {
        let kind = if self.chance(30) { Kind::PowerCycle } else { Kind::NmtReset };
        let reset = self.action(kind, scene);
        self.plan(reset);
        self.plan_to_read_again();
    }

    /// A client that has aborted, or was refused, goes on as if nothing were, and begins again.
    pub(super) fn plan_to_go_on(&mut self, scene: Scene<'_>) {
        let next = match scene.talk.open() {
            Open::Upload => Some(Kind::UploadSegment),
            Open::Download => Some(Kind::DownloadSegment),
            Open::BlockDownload => Some(Kind::BlockSegments),
            Open::BlockUpload => Some(Kind::BlockAck),
            Open::Nothing | Open::Asked => None,
        };
        if let Some(kind) = next.filter(|_| self.chance(50)) {
            let next = self.sdo(kind, scene);
            self.plan(next);
        }
        if let Some(mux) = self.subject.filter(|_| self.chance(50)) {
            let again = match scene.talk.open() {
                Open::Upload | Open::Download => self.asks(Kind::Upload, Request::Upload(mux)),
                _ => return,
            };
            self.plan(Some(again));
        }
    }

    /// The whole mapping of a PDO, and its use: PDO off, count 0, entries, count, type, PDO on.
    pub(super) fn whole_mapping(&mut self, scene: Scene<'_>) -> Option<Action> {
        let kind = Kind::ConfigureMapping;
        let (pdo, direction) = self.a_pdo();
        let index = communication(direction) + pdo;
        let (cob, mapping) = (Mux::new(index, 1), index + 0x200);
        let present = scene.od.int(cob)? as u32;
        let off = self.writes(kind, cob, &(present | CobId::INVALID).to_le_bytes());
        self.plan(off);
        let none = self.writes(kind, Mux::new(mapping, 0), &[0]);
        self.plan(none);
        let places = scene.od.entries_in(mapping..=mapping).len().saturating_sub(1).min(64);
        let entries = self.entries_to_map(direction, places)?;
        for (place, entry) in entries.iter().enumerate() {
            let to = Mux::new(mapping, 1 + place as u8);
            let write = self.writes(kind, to, &entry.encode().to_le_bytes());
            self.plan(write);
        }
        let count = self.writes(kind, Mux::new(mapping, 0), &[entries.len() as u8]);
        self.plan(count);
        if self.chance(60) {
            let kinds: &[u8] = match direction {
                Direction::Receive => &RPDO_KINDS,
                Direction::Transmit => &TPDO_KINDS,
            };
            let value = self.pick(kinds)?;
            let write = self.writes(Kind::ConfigurePdo, Mux::new(index, 2), &[value]);
            self.plan(write);
        }
        let present = present & !CobId::INVALID;
        let on = self.writes(kind, cob, &present.to_le_bytes());
        self.plan(on);
        self.plan_to_use(&Usage { direction, index, cob: present, entries }, scene);
        self.planned.pop_front()
    }

    /// Entries of a mapping that fit: often one alone, or as many as there is room for.
    fn entries_to_map(&mut self, direction: Direction, places: usize) -> Option<Vec<Mapping>> {
        let most = match self.below(5) {
            0 => 1,
            1 | 2 => places,
            _ => 1 + self.below(places),
        };
        let (mut entries, mut left) = (Vec::new(), ROOM);
        let (full, small) = (most == places, self.chance(40));
        for _ in 0..3 * most {
            let Some(more) = (most - entries.len()).checked_sub(1) else { break };
            let entry = self.object_to_map(direction)?;
            let entry = if self.chance(8) { self.gap() } else { entry };
            // As many as there are places for are small ones.
            let room = match full {
                _ if small => 8,
                true => (left / (more as u32 + 1)).max(8),
                false => left,
            };
            if u32::from(entry.bits) <= room.min(left) {
                left -= u32::from(entry.bits);
                entries.push(entry);
            }
        }
        Some(entries)
    }

    /// A device without node id, and the whole of a fastscan, mostly with one step that is odd.
    pub(super) fn whole_fastscan(&mut self) -> Option<Action> {
        let master = |kind, request: Lss| Some(Self::master(kind, vec![request.frame()]));
        self.plan(master(Kind::LssSwitch, Lss::SwitchGlobal(Mode::CONFIGURATION)));
        self.plan(master(Kind::LssConfigure, Lss::ConfigureNodeId(UNCONFIGURED)));
        self.plan(master(Kind::LssSwitch, Lss::SwitchGlobal(Mode::WAITING)));
        let command = Command { service: Service::RESET_COMMUNICATION, node: self.node() };
        let then = Then::Wait(100_000);
        self.plan(Some(Action::new(Kind::NmtReset, vec![command.frame()], then)));
        for _ in 0..=self.below(2) {
            let odd = self.below(8);
            let confirm = Fastscan { number: 0, bit: Fastscan::CONFIRM, part: 0, next: 0 };
            self.plan(master(Kind::LssIdentify, Lss::Fastscan(confirm)));
            for part in 0..4 {
                let mut number = self.own_part(part)?;
                let (part, mut bit, mut next) = (part as u8, 0, (part as u8 + 1) % 4);
                if self.chance(30) {
                    bit = self.pick(&[1, 7, 8, 16, 24, 31])?;
                    (number, next) = (number >> bit << bit, part);
                    let step = Fastscan { number, bit, part, next };
                    self.plan(master(Kind::LssIdentify, Lss::Fastscan(step)));
                    (number, bit, next) = (self.own_part(part.into())?, 0, (part + 1) % 4);
                }
                if odd == usize::from(part) {
                    match self.below(3) {
                        0 => number ^= 1 << self.below(32),
                        1 => next = self.pick(&[0, part, 4, 255])?,
                        _ => bit = self.pick(&[32, 127])?,
                    }
                }
                let step = Fastscan { number, bit, part, next };
                self.plan(master(Kind::LssIdentify, Lss::Fastscan(step)));
            }
            self.plan(master(Kind::LssInquire, Lss::Inquire(Part::ALL[0])));
        }
        self.planned.pop_front()
    }

    /// Both identifiers of a further server.
    pub(super) fn whole_channel(&mut self, scene: Scene<'_>) -> Option<Action> {
        const CLIENTS: [u16; 4] = [0x6A0, 0x6A2, 0x680, 0x190];
        let index = 0x1201 + self.below(2) as u16;
        let to = self.pick(&CLIENTS)?;
        for (sub, id) in [(1, to), (2, to + 1)] {
            let mux = Mux::new(index, sub);
            scene.od.entry(mux).filter(|entry| entry.access.writable())?;
            let write = self.writes(Kind::ConfigureChannel, mux, &u32::from(id).to_le_bytes());
            self.plan(write);
        }
        self.planned.pop_front()
    }

    /// The device is to start by itself or not, also after a reset, and is asked for its state.
    pub(super) fn whole_startup(&mut self, scene: Scene<'_>) -> Option<Action> {
        let startup = Mux::new(0x1F80, 0);
        scene.od.entry(startup).filter(|entry| entry.access.writable())?;
        let value = self.pick(&[0, 2, 4, 8, 8, 12])?;
        let write = self.writes(Kind::ConfigureErrors, startup, &u32::to_le_bytes(value));
        self.plan(write);
        let save = self.writes(Kind::Store, Mux::new(0x1010, 1), b"save");
        self.plan(save);
        for _ in 0..=self.below(2) {
            let kind = if self.chance(30) { Kind::PowerCycle } else { Kind::NmtReset };
            let reset = self.action(kind, scene);
            self.plan(reset);
            let guarding = vec![guarding_request(self.node())];
            self.plan(Some(Action::new(Kind::Guarding, guarding, Then::Wait(5_000))));
        }
        self.planned.pop_front()
    }

    /// The bit rate of the bus is switched to again: the device is silent for a time, and back.
    pub(super) fn whole_activation(&mut self) -> Option<Action> {
        let master = |kind, request: Lss| Some(Self::master(kind, vec![request.frame()]));
        self.plan(master(Kind::LssSwitch, Lss::SwitchGlobal(Mode::CONFIGURATION)));
        if self.chance(85) {
            let index = self.present_bit_rate()?;
            let timing = Lss::ConfigureBitTiming { table: 0, index };
            self.plan(master(Kind::LssConfigure, timing));
        }
        let delay: u16 = self.pick(&[1, 5, 20, 100, 255, 300, 1_000, 40_000])?;
        let (frame, half) = (Lss::ActivateBitTiming(delay).frame(), u64::from(delay) * 500);
        self.plan(Some(Action::new(Kind::LssConfigure, vec![frame], Then::Wait(half))));
        // Before the change, after it, and when the device is back.
        for _ in 0..3 {
            let asks = match self.chance(70) {
                true => Lss::InquireNodeId.frame(),
                false => guarding_request(self.node()),
            };
            self.plan(Some(Action::new(Kind::LssInquire, vec![asks], Then::Wait(2 * half))));
        }
        self.planned.pop_front()
    }

    /// The device gets another node id, boots with it, and gets its own one again.
    pub(super) fn whole_renaming(&mut self) -> Option<Action> {
        let other = self.pick(&[125, 127, 127, 1, 126])?;
        for (from, to) in [(self.node(), other), (other, self.node())] {
            let requests = [
                (Kind::LssSwitch, Lss::SwitchGlobal(Mode::CONFIGURATION)),
                (Kind::LssConfigure, Lss::ConfigureNodeId(to)),
                (Kind::LssSwitch, Lss::SwitchGlobal(Mode::WAITING)),
            ];
            for (kind, request) in requests {
                self.plan(Some(Self::master(kind, vec![request.frame()])));
            }
            let reset = Command { service: Service::RESET_COMMUNICATION, node: from };
            let then = Then::Wait(100_000);
            self.plan(Some(Action::new(Kind::NmtReset, vec![reset.frame()], then)));
            for _ in 0..self.below(3) {
                let asks = match self.chance(50) {
                    true => Request::Upload(Mux::new(0x1018, 1)).frame(to),
                    false => guarding_request(to),
                };
                self.plan(Some(Action::new(Kind::SdoForAnother, vec![asks], Then::Wait(2_000))));
            }
        }
        self.planned.pop_front()
    }
}
