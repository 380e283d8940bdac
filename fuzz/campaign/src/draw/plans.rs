//! Actions that make sense one after the other, and are drawn at once.

use canopen::eds::Direction;
use canopen::lss::{Fastscan, Mode, Part, Request as Lss, UNCONFIGURED};
use canopen::nmt::{Command, Service};
use canopen::pdo::{CobId, Mapping};
use canopen::sdo::Request;
use canopen::{Data, Frame, Mux, sync};

use super::configure::communication;
use super::{Draw, Scene};
use crate::action::{Action, Kind, Then};
use crate::talk::Open;

/// In how many of a hundred cases a plan goes on: what comes between may matter, too.
const AS_PLANNED: u8 = 92;
/// How many objects are remembered that were written.
const REMEMBERED: usize = 16;
/// The bits of a PDO.
const ROOM: u32 = 64;
/// Transmission types: at events, with the next SYNC, and with each.
const KINDS: [u8; 6] = [255, 254, 255, 0, 1, 2];

impl Draw<'_> {
    /// What is planned next.
    pub(super) fn as_planned(&mut self, scene: Scene<'_>) -> Option<Action> {
        if self.planned.is_empty() || !scene.talk.is_idle() || !self.chance(AS_PLANNED) {
            return None;
        }
        self.planned.pop_front()
    }

    fn plan(&mut self, action: Option<Action>) {
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
        let (most, mut entries, mut bits) = (1 + self.below(places), Vec::new(), 0);
        for _ in 0..most {
            let entry = self.object_to_map(direction)?;
            let entry = if self.chance(12) { self.gap() } else { entry };
            if bits + u32::from(entry.bits) > ROOM {
                continue;
            }
            bits += u32::from(entry.bits);
            entries.push(entry);
        }
        for (place, entry) in entries.iter().enumerate() {
            let to = Mux::new(mapping, 1 + place as u8);
            let write = self.writes(kind, to, &entry.encode().to_le_bytes());
            self.plan(write);
        }
        let count = self.writes(kind, Mux::new(mapping, 0), &[entries.len() as u8]);
        self.plan(count);
        if self.chance(60) {
            let value = self.pick(&KINDS)?;
            let write = self.writes(Kind::ConfigurePdo, Mux::new(index, 2), &[value]);
            self.plan(write);
        }
        let on = self.writes(kind, cob, &(present & !CobId::INVALID).to_le_bytes());
        self.plan(on);
        let bytes = bits.div_ceil(8).min(8) as usize;
        self.plan_to_use(CobId(present).can_id(), direction, &entries, bytes);
        self.planned.pop_front()
    }

    /// A PDO that was mapped is used.
    fn plan_to_use(&mut self, id: u16, direction: Direction, entries: &[Mapping], bytes: usize) {
        let after = |does, frame| Some(Action::new(does, vec![frame], Then::Wait(1_500)));
        if self.chance(70) {
            let command = Command { service: Service::START, node: self.node() };
            self.plan(after(Kind::NmtState, command.frame()));
        }
        for _ in 0..=self.below(3) {
            match direction {
                Direction::Receive => {
                    let data = [(); 8].map(|()| self.byte());
                    let frame = Frame::new(id, Data::new(&data[..bytes]));
                    self.plan(after(Kind::Rpdo, frame));
                }
                Direction::Transmit => {
                    self.plan(after(Kind::Sync, Frame::new(sync::COB_ID, [])));
                }
            }
            let place = self.below(entries.len());
            if let Some(entry) = entries.get(place).filter(|_| self.chance(40)) {
                let read = self.asks(Kind::Upload, Request::Upload(entry.mux));
                self.plan(Some(read));
            }
        }
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
}
