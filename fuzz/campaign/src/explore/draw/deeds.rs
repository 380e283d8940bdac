//! What a story does: writes, stimuli, waits, looks and messages.

use std::sync::Arc;
use std::time::Duration;

use canopen::eds::Direction;
use canopen::lss::{Mode, Part, Request as Lss};
use canopen::nmt::{Command, Service};
use canopen::pdo::CobId;
use canopen::sdo::{Initiate, RESPONSE_COB_ID, Request};
use canopen::{Data, Frame, Mux};

use super::values::{POSITIVE, STATES, USUAL_VALUE};
use super::{Draw, Pair, State};
use crate::action::{Action, Kind, Stimulus, Then};
use crate::oracle::error_control;
use crate::surface::{FIRST_OF_APPLICATION, Pdo};

/// The bit in which the identifier of a PDO changes when it moves.
const MOVED: u32 = 0x20;

impl Draw<'_> {
    pub(super) fn act(&mut self, does: Kind, frames: Vec<Frame>, then: Then) {
        self.story.actions.push(Action::new(does, frames, then));
    }

    /// Writes a setting of the session again: another value, or the one from before.
    pub(super) fn write_again(&mut self) {
        let place = self.below(self.focus.len());
        let setting = self.focus[place];
        let entry = &self.surface.settings[setting].entry;
        let is_number = entry.data_type.is_integer() && !self.surface.selectors.contains(&setting);
        if is_number
            && entry.mux.index >= FIRST_OF_APPLICATION
            && self.chance(1, 4)
            && let Some(value) = self.nudged(setting)
        {
            return self.put_noted(setting, value);
        }
        match self.default_of(setting) {
            Some(default) if self.chance(1, 4) => self.put(setting, default),
            _ => self.write(setting),
        }
    }

    pub(super) fn default_of(&self, setting: usize) -> Option<i64> {
        let default = self.surface.settings[setting].entry.default.as_ref()?;
        i64::try_from(default.resolve(self.node).as_int()?).ok()
    }

    pub(super) fn write(&mut self, setting: usize) {
        let drawn: Vec<(i64, u8)> = (0..2).map(|_| self.value(setting)).collect();
        let with = self.state as u16 | STATES;
        let count = |drawn: &(i64, u8)| self.tried(setting, drawn.1, with);
        let (value, sort) = drawn.into_iter().min_by_key(count).unwrap_or_default();
        self.note(setting, sort);
        self.put(setting, value);
    }

    /// Writes a value that was not drawn.
    pub(super) fn put_noted(&mut self, setting: usize, value: i64) {
        let default = self.default_of(setting);
        let sort = if default == Some(value) { USUAL_VALUE } else { POSITIVE };
        self.put_as(setting, value, sort);
    }

    /// Writes a value of that sort.
    pub(super) fn put_as(&mut self, setting: usize, value: i64, sort: u8) {
        self.note(setting, sort);
        self.put(setting, value);
    }

    /// Notes what a value is tried together with.
    fn note(&mut self, setting: usize, sort: u8) {
        let with = self.state as u16 | STATES;
        let (setting_, with_) = (setting as u16, self.surface.settings[setting].function as u16);
        self.story.tried.pairs.push(Pair { setting: setting_, sort, with });
        self.story.tried.pairs.push(Pair { setting: setting_, sort, with: with_ });
        for other in self.written.keys() {
            let with = self.surface.settings[*other].function as u16;
            if with != with_ {
                self.story.tried.pairs.push(Pair { setting: setting_, sort, with });
            }
        }
    }

    pub(super) fn put(&mut self, setting: usize, value: i64) {
        let entry = &self.surface.settings[setting].entry;
        let size = entry.data_type.size().unwrap_or(4);
        let (mux, data) = (entry.mux, Data::new(&value.to_le_bytes()[..size]));
        self.written.insert(setting, value);
        self.download(Kind::Download, mux, data);
    }

    pub(super) fn download(&mut self, does: Kind, mux: Mux, data: Data) {
        let request = Request::Download(mux, Initiate::Expedited(data));
        let answer = RESPONSE_COB_ID + u16::from(self.node);
        self.act(does, vec![request.frame(self.node)], Then::answer(answer));
    }

    /// Gives a command, and mostly takes it back: the device works on as before, or goes on from
    /// where that has brought it.
    pub(super) fn pulse(&mut self) {
        let all = &self.surface.commands;
        if all.is_empty() {
            return;
        }
        let setting = all[self.below(all.len())];
        let before = self.written.get(&setting).copied().or_else(|| self.default_of(setting));
        let before = before.unwrap_or(0);
        let entry = &self.surface.settings[setting].entry;
        let is_bits = entry.data_type.size() == Some(1) && entry.high.is_none();
        let (value, sort) = match is_bits && self.chance(2, 3) {
            true => (before ^ 1 << self.below(8), POSITIVE),
            false => self.value(setting),
        };
        self.put_as(setting, value, sort);
        if self.chance(1, 2) {
            let time = self.brief();
            self.act(Kind::Wait, Vec::new(), Then::after(time));
        } else {
            self.wait();
        }
        if self.chance(3, 4) {
            self.put(setting, before);
        }
    }

    /// Begins anew with what was set, some of which a device may look at only then.
    pub(super) fn begin_with_these(&mut self) {
        self.download(Kind::Store, Mux::new(0x1010, 1), Data::new(b"save"));
        if self.chance(1, 2) {
            self.power();
        } else {
            self.reset();
        }
    }

    pub(super) fn stimulate(&mut self) {
        if self.sources.is_empty() {
            return;
        }
        let source = match self.chance(1, 12) {
            true => self.below(self.surface.stimuli.len()),
            false => {
                let place = self.below(self.sources.len());
                self.sources[place]
            }
        };
        let name = Arc::clone(&self.surface.stimuli[source].name);
        let value = self.level(source);
        let time = self.brief();
        self.turning.take(&name, &value);
        self.story.actions.push(Action {
            does: Kind::Stimulate,
            frames: Vec::new(),
            bench: Some(Stimulus { name, value: value.into() }),
            then: Then::after(time),
        });
    }

    pub(super) fn wait(&mut self) {
        let (time, is_known) = self.time();
        // A session may once stay for as long as a setting says.
        if is_known && time > self.left && !self.stayed {
            self.stayed = true;
            self.left = time.min(self.longest);
        }
        let time = time.min(self.left);
        let time = self.turning.limit(time);
        self.left = self.left.saturating_sub(time);
        if time > Duration::from_secs(60) {
            self.state = State::Worked;
        }
        self.act(Kind::Wait, Vec::new(), Then::after(time));
    }

    pub(super) fn look(&mut self) {
        let time = self.brief();
        self.act(Kind::Wait, Vec::new(), Then::after(time));
        self.act(Kind::Look, Vec::new(), Then::Wait(0));
    }

    pub(super) fn receive(&mut self) {
        if self.rpdos.is_empty() {
            return;
        }
        let place = self.below(self.rpdos.len());
        let Pdo { cob, fields, .. } = self.rpdos[place].clone();
        let mut bytes = Vec::with_capacity(8);
        for (setting, size) in fields {
            let value = match setting {
                Some(setting) => {
                    let (value, _) = self.value(setting);
                    self.written.insert(setting, value);
                    value
                }
                None => 0,
            };
            bytes.extend_from_slice(&value.to_le_bytes()[..size.min(8)]);
        }
        bytes.truncate(8);
        let time = self.brief();
        let frame = Frame::new(CobId(cob).can_id(), Data::new(&bytes));
        self.act(Kind::Rpdo, vec![frame], Then::after(time));
    }

    /// Maps other objects into a PDO, which may get another identifier, too.
    pub(super) fn map(&mut self) {
        let direction = if self.chance(1, 3) { Direction::Receive } else { Direction::Transmit };
        let all = match direction {
            Direction::Receive => &self.rpdos,
            Direction::Transmit => &self.surface.tpdos,
        };
        let pdos: Vec<(u16, u32)> =
            all.iter().filter(|it| it.mappable).map(|it| (it.index, it.cob)).collect();
        if pdos.is_empty() {
            return;
        }
        let (index, mut cob) = pdos[self.below(pdos.len())];
        let byte = |value: u8| Data::new(&[value]);
        let long = |value: u32| Data::new(&value.to_le_bytes());
        self.download(Kind::ConfigurePdo, Mux::new(index, 1), long(cob | CobId::INVALID));
        self.download(Kind::ConfigureMapping, Mux::new(index + 0x200, 0), byte(0));
        let entries = self.entries(direction);
        for (place, (mux, _)) in entries.iter().enumerate() {
            let link = u32::from(mux.index) << 16 | u32::from(mux.sub) << 8;
            let link = link | self.surface.bits(*mux) as u32;
            let to = Mux::new(index + 0x200, 1 + place as u8);
            self.download(Kind::ConfigureMapping, to, long(link));
        }
        let count = byte(entries.len() as u8);
        self.download(Kind::ConfigureMapping, Mux::new(index + 0x200, 0), count);
        if self.chance(1, 4) {
            cob ^= MOVED;
        }
        self.download(Kind::ConfigurePdo, Mux::new(index, 1), long(cob & !CobId::INVALID));
        if let Some(pdo) = self.rpdos.iter_mut().find(|it| it.index == index) {
            let bytes = |mux| self.surface.bits(mux) as usize / 8;
            pdo.fields = entries.iter().map(|(mux, setting)| (*setting, bytes(*mux))).collect();
            pdo.cob = cob;
        }
    }

    /// Objects for a PDO, and which settings they are.
    fn entries(&mut self, direction: Direction) -> Vec<(Mux, Option<usize>)> {
        let all = self.surface.moving.len();
        let (mut entries, mut bits) = (Vec::new(), 0);
        for _ in 0..1 + self.below(4) {
            let of_settings = all == 0 || direction == Direction::Receive || self.chance(1, 3);
            let (mux, setting) = match of_settings {
                true => {
                    let setting = self.below(self.surface.settings.len());
                    (self.surface.settings[setting].entry.mux, Some(setting))
                }
                false => (self.surface.moving[self.below(all)], None),
            };
            bits += self.surface.bits(mux);
            if bits > 64 {
                break;
            }
            entries.push((mux, setting));
        }
        entries
    }

    pub(super) fn nmt(&mut self) {
        let services =
            [Service::START, Service::START, Service::STOP, Service::ENTER_PRE_OPERATIONAL];
        let service = services[self.below(services.len())];
        self.switch(service);
    }

    pub(super) fn switch(&mut self, service: Service) {
        self.state = match service {
            Service::START => State::Operational,
            Service::STOP => State::Stopped,
            _ => State::PreOperational,
        };
        let frame = Command { service, node: self.node }.frame();
        self.act(Kind::NmtState, vec![frame], Then::Wait(5_000));
    }

    /// The device is asked, or set to what it is, by layer setting services.
    pub(super) fn configure_by_lss(&mut self) {
        let switches = |mode| (Kind::LssSwitch, Lss::SwitchGlobal(mode));
        let part = Part::ALL[self.below(Part::ALL.len())];
        let index = self.below(10) as u8;
        let asks = match self.below(4) {
            0 => (Kind::LssInquire, Lss::InquireNodeId),
            1 => (Kind::LssInquire, Lss::Inquire(part)),
            2 => (Kind::LssConfigure, Lss::ConfigureNodeId(self.node)),
            _ => (Kind::LssConfigure, Lss::ConfigureBitTiming { table: 0, index }),
        };
        for (does, request) in [switches(Mode::CONFIGURATION), asks, switches(Mode::WAITING)] {
            self.act(does, vec![request.frame()], Then::Wait(5_000));
        }
    }

    pub(super) fn reset(&mut self) {
        let services = [Service::RESET_NODE, Service::RESET_NODE, Service::RESET_COMMUNICATION];
        let service = services[self.below(services.len())];
        let frame = Command { service, node: self.node }.frame();
        self.state = State::Reset;
        self.act(Kind::NmtReset, vec![frame], Then::answer(error_control(self.node)));
        self.again();
    }

    pub(super) fn power(&mut self) {
        self.state = State::PoweredAgain;
        self.act(Kind::PowerCycle, Vec::new(), Then::answer(error_control(self.node)));
        self.again();
    }

    /// Goes on after a reset.
    fn again(&mut self) {
        self.rpdos.clone_from(&self.surface.rpdos);
        if self.chance(3, 4) {
            let frame = Command { service: Service::START, node: self.node }.frame();
            self.act(Kind::NmtState, vec![frame], Then::Wait(5_000));
        }
    }

    pub(super) fn store(&mut self) {
        let (index, word, does) = match self.chance(3, 4) {
            true => (0x1010, b"save", Kind::Store),
            false => (0x1011, b"load", Kind::Restore),
        };
        self.download(does, Mux::new(index, 1), Data::new(word));
        match self.below(3) {
            0 => self.power(),
            1 => self.reset(),
            _ => {}
        }
    }
}
