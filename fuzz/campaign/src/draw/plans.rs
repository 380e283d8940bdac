//! Actions that make sense one after the other, and are drawn at once.

use canopen::eds::Direction;
use canopen::heartbeat::guarding_request;
use canopen::lss::{Fastscan, Mode, Part, Request as Lss, UNCONFIGURED};
use canopen::nmt::{Command, Service};
use canopen::pdo::{CobId, Mapping};
use canopen::sdo::Request;
use canopen::sdo::block::BlockRequest;
use canopen::{Frame, Id, Mux};

use super::configure::communication;
use super::cycles::{RPDO_KINDS, TPDO_KINDS, Usage};
use super::{Draw, Scene};
use crate::action::{Action, Kind, Then};
use crate::talk::Open;

/// In how many of a hundred cases a plan goes on: what comes between may matter, too.
const AS_PLANNED: u8 = 92;
/// How many objects are remembered that were written.
const REMEMBERED: usize = 16;
const STORES: Kind = Kind::LssStore;
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

    /// What a transfer of several messages has left is read, at times.
    pub(super) fn plan_to_read_the_subject(&mut self) {
        if let Some(mux) = self.subject.filter(|_| self.chance(40)) {
            let read = match self.chance(50) {
                true => Request::Upload(mux),
                false => {
                    Request::Block(BlockRequest::Upload { mux, crc: true, size: 127, threshold: 0 })
                }
            };
            let read = self.asks(Kind::Upload, read);
            self.plan(Some(read));
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
        if !self.chance(50) {
            return;
        }
        match (scene.talk.open(), self.subject) {
            (Open::Upload | Open::Download, Some(mux)) => {
                let again = self.asks(Kind::Upload, Request::Upload(mux));
                self.plan(Some(again));
            }
            (Open::BlockDownload, _) => self.wished = Some(Kind::BlockDownload),
            (Open::BlockUpload, _) => self.wished = Some(Kind::BlockUpload),
            _ => {}
        }
    }

    /// The whole mapping of a PDO, and its use. What it holds, another one may hold as well.
    pub(super) fn whole_mapping(&mut self, scene: Scene<'_>) -> Option<Action> {
        let (pdo, direction) = self.a_pdo();
        let mut usages = vec![self.plan_mapping(pdo, direction, None, scene)?];
        if let Some(other) = self.other_pdo(pdo, 25) {
            let same = usages[0].entries.clone();
            usages.extend(self.plan_mapping(other, direction, Some(same), scene));
        }
        self.plan_to_use(&usages, scene);
        self.planned.pop_front()
    }

    /// PDO off, count 0, entries, count, type, PDO on.
    fn plan_mapping(
        &mut self,
        pdo: u16,
        direction: Direction,
        entries: Option<Vec<Mapping>>,
        scene: Scene<'_>,
    ) -> Option<Usage> {
        let kind = Kind::ConfigureMapping;
        let index = communication(direction) + pdo;
        let (cob, mapping) = (Mux::new(index, 1), index + 0x200);
        let present = scene.od.int(cob)? as u32;
        let places = scene.od.entries_in(mapping..=mapping).len().saturating_sub(1).min(64);
        let entries = match entries {
            Some(entries) if entries.len() <= places => entries,
            Some(_) => return None,
            None => self.entries_to_map(direction, places)?,
        };
        let off = self.writes(kind, cob, &(present | CobId::INVALID).to_le_bytes());
        self.plan(off);
        let none = self.writes(kind, Mux::new(mapping, 0), &[0]);
        self.plan(none);
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
        Some(Usage { direction, index, cob: present, entries, timed: false })
    }

    /// Entries of a mapping that fit: often one alone, or as many as there is room for.
    fn entries_to_map(&mut self, direction: Direction, places: usize) -> Option<Vec<Mapping>> {
        let most = match self.below(5) {
            0 => 1,
            1 | 2 => places,
            _ => 1 + self.below(places),
        };
        // At times, by one byte more than there is room for.
        let (mut entries, mut left) = (Vec::new(), if self.chance(6) { ROOM + 8 } else { ROOM });
        let (full, small) = (most == places, self.chance(40));
        for _ in 0..3 * most {
            let Some(more) = (most - entries.len()).checked_sub(1) else { break };
            let entry = self.object_to_map(direction)?;
            let entry = if self.chance(12) { self.gap() } else { entry };
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

    /// A device without node id, fastscans of it, and its node id again, mostly.
    pub(super) fn whole_fastscan(&mut self) -> Option<Action> {
        let own = self.node();
        self.plan_node_id(own, UNCONFIGURED, false);
        for _ in 0..=self.below(3) {
            self.plan_fastscan()?;
        }
        if self.chance(85) {
            self.plan_node_id(UNCONFIGURED, own, false);
        }
        self.planned.pop_front()
    }

    /// A fastscan as a master makes it, part after part, mostly with a question that is odd, and a
    /// look at the state in which it leaves the device.
    fn plan_fastscan(&mut self) -> Option<()> {
        let confirm = Fastscan { number: 0, bit: Fastscan::CONFIRM, part: 0, next: 0 };
        let mut questions = if self.chance(90) { vec![confirm] } else { Vec::new() };
        let odd = self.below(7) as u8;
        for part in 0..4 {
            let own = self.own_part(part.into())?;
            let high = self.pick(&[1, 7, 8, 15, 16, 24, 30, 31]).filter(|_| self.chance(50));
            for bit in high.into_iter().chain([0]) {
                let next = if bit == 0 { (part + 1) % 4 } else { part };
                let right = Fastscan { number: own >> bit << bit, bit, part, next };
                if odd == part && self.chance(60) {
                    questions.push(self.odd_question(right)?);
                }
                if odd != part || self.chance(60) {
                    questions.push(right);
                }
            }
            let frames = questions.drain(..).map(|it| Lss::Fastscan(it).frame()).collect();
            self.plan(Some(Action::new(Kind::LssIdentify, frames, Then::Wait(2_000))));
        }
        self.plan(Some(Self::master(Kind::LssInquire, Lss::Inquire(Part::ALL[0]))));
        let again = Self::master(Kind::LssSwitch, Lss::SwitchGlobal(Mode::WAITING));
        let again = Some(again).filter(|_| self.chance(80));
        self.plan(again);
        Some(())
    }

    /// A question that a device must not answer, or that leads it somewhere else.
    fn odd_question(&mut self, right: Fastscan) -> Option<Fastscan> {
        let Fastscan { number, bit, part, .. } = right;
        Some(match self.below(5) {
            // One of the bits that are compared.
            0 | 1 => {
                let flipped = bit + self.below(usize::from(32 - bit)) as u8;
                Fastscan { number: number ^ 1 << flipped, ..right }
            }
            2 => Fastscan { next: self.pick(&[0, part, (part + 3) % 4, 4, 255])?, ..right },
            3 => Fastscan { bit: self.pick(&[32, 127])?, ..right },
            _ => {
                let part = self.pick(&[0, 1, 2, 3, 4])?;
                let number = self.own_part((part % 4).into())?;
                Fastscan { number, bit: 0, part, next: (part + 1) % 4 }
            }
        })
    }

    /// The device gets a node id, and boots with it, after a power-on where it is stored. One
    /// without node id waits for no reset.
    fn plan_node_id(&mut self, from: u8, to: u8, stored: bool) {
        let requests = [
            (Kind::LssSwitch, Lss::SwitchGlobal(Mode::CONFIGURATION)),
            (Kind::LssConfigure, Lss::ConfigureNodeId(to)),
            (Kind::LssStore, Lss::Store),
            (Kind::LssSwitch, Lss::SwitchGlobal(Mode::WAITING)),
        ];
        for (kind, request) in requests.into_iter().filter(|(kind, _)| stored || *kind != STORES) {
            self.plan(Some(Self::master(kind, request)));
        }
        if stored && !self.blueprint.spares(Kind::PowerCycle) {
            let off_and_on = Action::new(Kind::PowerCycle, Vec::new(), Then::Wait(200_000));
            return self.plan(Some(off_and_on));
        }
        let reset = Command { service: Service::RESET_COMMUNICATION, node: from };
        let (frames, then) = match from {
            UNCONFIGURED => (Vec::new(), Then::Wait(100_000)),
            _ => (vec![reset.frame()], Then::Wait(100_000)),
        };
        self.plan(Some(Action::new(Kind::NmtReset, frames, then)));
    }

    /// Both identifiers of a further server.
    pub(super) fn whole_channel(&mut self, scene: Scene<'_>) -> Option<Action> {
        const CLIENTS: [u16; 4] = [0x6A0, 0x6A2, 0x680, 0x190];
        let index = 0x1201 + self.below(2) as u16;
        let to = self.pick(&CLIENTS)?;
        // With one of them alone, there is no channel.
        let without = if self.chance(30) { 1 + self.below(2) as u8 } else { 0 };
        for (sub, id) in [(1, to), (2, to + 1)] {
            let mux = Mux::new(index, sub);
            scene.od.entry(mux).filter(|entry| entry.access.writable())?;
            let switch = if sub == without { CobId::INVALID } else { 0 };
            let value = (u32::from(id) | switch).to_le_bytes();
            let write = self.writes(Kind::ConfigureChannel, mux, &value);
            self.plan(write);
        }
        if without > 0 {
            let request = Request::Upload(Mux::new(0x1018, 1)).frame(self.node());
            let frame = Frame { id: Id::standard(to), ..request };
            self.plan(Some(Action::new(Kind::FurtherServer, vec![frame], Then::Wait(2_000))));
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
        let configures = Lss::SwitchGlobal(Mode::CONFIGURATION);
        self.plan(Some(Self::master(Kind::LssSwitch, configures)));
        if self.chance(85) {
            let index = self.present_bit_rate()?;
            let timing = Lss::ConfigureBitTiming { table: 0, index };
            self.plan(Some(Self::master(Kind::LssConfigure, timing)));
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
        let own = self.node();
        let mut ways = vec![(own, other), (other, own)];
        ways.extend(Some((own, own)).filter(|_| self.chance(30)));
        for (from, to) in ways {
            let stored = self.chance(40);
            self.plan_node_id(from, to, stored);
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
