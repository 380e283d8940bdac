//! Plans about process data: PDOs as they are used, with the cycles of SYNC.

use canopen::eds::Direction;
use canopen::nmt::{Command, Service};
use canopen::pdo::{CobId, Mapping};
use canopen::sdo::Request;
use canopen::{Data, Frame, Id, Mux};

use super::configure::communication;
use super::network::of_another_length;
use super::values::{ANY_ID, RESTRICTED};
use super::{Draw, Scene};
use crate::action::{Action, Kind, Then};

/// A PDO that is used.
pub(super) struct Usage {
    pub(super) direction: Direction,
    /// The object with its communication parameters.
    pub(super) index: u16,
    /// Its COB-ID while it is valid.
    pub(super) cob: u32,
    pub(super) entries: Vec<Mapping>,
    /// Whether something happens by itself some time after it was used.
    pub(super) timed: bool,
}

/// Transmission types: at events, with the next SYNC, with each, and on request.
pub(super) const RPDO_KINDS: [u8; 8] = [255, 254, 0, 1, 1, 1, 2, 240];
pub(super) const TPDO_KINDS: [u8; 10] = [255, 254, 255, 0, 1, 1, 2, 3, 252, 253];
/// Sub-indices of the parameters of a PDO.
const KIND: u8 = 2;
const INHIBIT_TIME: u8 = 3;
const EVENT_TIMER: u8 = 5;
const START_VALUE: u8 = 6;
/// The producer of SYNC is switched on.
const PRODUCES: u32 = 1 << 30;
const SYNC: Mux = Mux::new(0x1005, 0);
const PERIOD: Mux = Mux::new(0x1006, 0);
const WINDOW: Mux = Mux::new(0x1007, 0);
const OVERFLOW: Mux = Mux::new(0x1019, 0);
/// More RPDOs at once than a device has places for, if it does not use them as they come.
const BURST: usize = 64;
/// A pause in microseconds in which everything is done that is done at once.
const PAUSE: u64 = 1_500;

impl Usage {
    /// The length of its frames.
    fn bytes(&self) -> usize {
        let bits: u32 = self.entries.iter().map(|entry| u32::from(entry.bits)).sum();
        bits.div_ceil(8).min(8) as usize
    }
}

impl Draw<'_> {
    pub(super) fn passes(&mut self, does: Kind, frames: Vec<Frame>, micros: u64) {
        self.plan(Some(Action::new(does, frames, Then::Wait(micros))));
    }

    pub(super) fn plan_state(&mut self, service: Service) {
        let command = Command { service, node: self.node() };
        self.passes(Kind::NmtState, vec![command.frame()], PAUSE);
    }

    pub(super) fn plan_write(&mut self, kind: Kind, mux: Mux, value: &[u8]) {
        let write = self.writes(kind, mux, value);
        self.plan(write);
    }

    /// Parameters of a PDO that is switched off for them, by their sub-indices.
    fn plan_parameters(&mut self, index: u16, cob: u32, parameters: &[(u8, u16)]) {
        let kind = Kind::ConfigurePdo;
        let switch = Mux::new(index, 1);
        self.plan_write(kind, switch, &(cob | CobId::INVALID).to_le_bytes());
        for (sub, value) in parameters {
            let size = if matches!(*sub, INHIBIT_TIME | EVENT_TIMER) { 2 } else { 1 };
            self.plan_write(kind, Mux::new(index, *sub), &value.to_le_bytes()[..size]);
        }
        if self.chance(5) {
            let restricted = self.pick(&RESTRICTED).unwrap_or_default();
            self.plan_write(kind, switch, &restricted.to_le_bytes());
        }
        self.plan_write(kind, switch, &(cob & !CobId::INVALID).to_le_bytes());
    }

    /// A PDO as it is mapped, with another transmission type, at times beside another one.
    pub(super) fn whole_use(&mut self, scene: Scene<'_>) -> Option<Action> {
        let (pdo, direction) = self.a_pdo();
        let mut usages = vec![self.plan_kind(pdo, direction, scene)?];
        let other = self.other_pdo(pdo, 35);
        usages.extend(other.and_then(|other| self.plan_kind(other, direction, scene)));
        self.plan_to_use(&usages, scene);
        self.planned.pop_front()
    }

    /// The other PDO of this session in so many of a hundred cases: what becomes of one must not
    /// depend on another.
    pub(super) fn other_pdo(&mut self, pdo: u16, percent: u8) -> Option<u16> {
        let together = !self.blueprint.is_in_its_own_time() && self.chance(percent);
        self.pdos.into_iter().find(|other| together && *other != pdo)
    }

    /// A PDO gets another transmission type, and other times.
    fn plan_kind(&mut self, pdo: u16, direction: Direction, scene: Scene<'_>) -> Option<Usage> {
        let usage = usage(communication(direction) + pdo, direction, scene)?;
        let (kinds, switches): (&[u8], u32) = match direction {
            Direction::Receive => (&RPDO_KINDS, 0),
            // Bit 30 says that the TPDO is not sent on request.
            Direction::Transmit => (&TPDO_KINDS, if self.chance(30) { PRODUCES } else { 0 }),
        };
        let mut parameters = vec![(KIND, u16::from(self.pick(kinds)?))];
        parameters.extend(self.times(&usage, scene));
        let timed = parameters.iter().any(|(sub, time)| *sub == EVENT_TIMER && *time > 0);
        let usage = Usage { cob: usage.cob ^ switches, timed, ..usage };
        self.plan_parameters(usage.index, usage.cob, &parameters);
        Some(usage)
    }

    /// The times of a PDO, at times: what happens within them, plans come to by themselves.
    fn times(&mut self, usage: &Usage, scene: Scene<'_>) -> Vec<(u8, u16)> {
        if !self.chance(45) {
            return Vec::new();
        }
        // The inhibit time counts 100 microseconds; the event timer, and the deadline of an RPDO,
        // milliseconds.
        let inhibit = (INHIBIT_TIME, [0, 50, 100, 500]);
        let timer = (EVENT_TIMER, [0, 5, 20, 50]);
        let times = [inhibit, timer].map(|(sub, times)| {
            let received = usage.direction == Direction::Receive && sub == INHIBIT_TIME;
            let exists = !received && scene.od.entry(Mux::new(usage.index, sub)).is_some();
            self.pick(&times).filter(|_| exists).map(|time| (sub, time))
        });
        times.into_iter().flatten().collect()
    }

    /// A TPDO with an inhibit time, changes within it, and what becomes of the last one.
    pub(super) fn whole_delay(&mut self, scene: Scene<'_>) -> Option<Action> {
        let (pdo, direction) = (self.pdos[self.below(2)], Direction::Transmit);
        let usage = usage(communication(direction) + pdo, direction, scene)?;
        scene.od.entry(Mux::new(usage.index, INHIBIT_TIME))?;
        let inhibit: u16 = self.pick(&[50, 100, 500])?;
        let kind = self.pick(&[254, 255])?;
        self.plan_parameters(usage.index, usage.cob, &[(KIND, kind), (INHIBIT_TIME, inhibit)]);
        self.plan_state(Service::START);
        for _ in 0..2 + self.below(3) {
            for _ in 0..=self.below(3) {
                self.plan_change(&usage, scene);
            }
            if self.chance(40) {
                self.plan_interruption(&usage, scene);
            }
            let time = u64::from(inhibit) * if self.chance(80) { 120 } else { 50 };
            self.passes(Kind::Wait, Vec::new(), time);
        }
        self.planned.pop_front()
    }

    /// PDOs that were mapped or configured are used.
    pub(super) fn plan_to_use(&mut self, usages: &[Usage], scene: Scene<'_>) {
        // What is there before is known then.
        let entries = usages.iter().flat_map(|usage| &usage.entries);
        for entry in entries.filter(|entry| self.blueprint.keeps(entry.mux)) {
            if let Some(entry) = scene.od.entry(entry.mux).filter(|_| self.chance(60))
                && entry.access.writable()
                && let Some(value) = self.value(entry, scene)
            {
                self.plan_write(Kind::Download, entry.mux, &value);
            }
        }
        if self.chance(85) {
            self.plan_state(Service::START);
        }
        // Whether a device in its own time comes first to a burst, or to a change of its state, or
        // to what follows, nobody knows.
        let (steps, burst) = if self.blueprint.is_in_its_own_time() { (11, 1) } else { (16, 3) };
        for _ in 0..3 + self.below(4 + 3 * usages.len()) {
            let Some(usage) = usages.get(self.below(usages.len())) else { break };
            if usage.timed && self.chance(30) {
                self.plan_pause();
            }
            match self.below(steps) {
                0..=4 => self.plan_transfer(usage, scene),
                5..=7 => {
                    let times = 1 + self.below(burst);
                    self.plan_sync(times, scene);
                }
                8..=10 => self.plan_look(usage),
                11 | 12 => self.plan_change(usage, scene),
                13 => self.plan_pause(),
                _ => self.plan_interruption(usage, scene),
            }
        }
        usages.iter().for_each(|usage| self.plan_look(usage));
    }

    fn plan_pause(&mut self) {
        let time = self.pick(&[5_000, 12_000, 30_000, 60_000]).unwrap_or(PAUSE);
        self.passes(Kind::Wait, Vec::new(), time);
    }

    /// The frame of an RPDO, or a request for a TPDO, or an event of it.
    fn plan_transfer(&mut self, usage: &Usage, scene: Scene<'_>) {
        let (id, bytes) = (CobId(usage.cob).can_id(), usage.bytes());
        match usage.direction {
            Direction::Receive => self.plan_rpdo(id, bytes),
            Direction::Transmit if self.chance(40) => {
                self.passes(Kind::TpdoRequest, vec![Frame::remote(id, bytes as u8)], PAUSE);
            }
            Direction::Transmit => self.plan_change(usage, scene),
        }
    }

    /// An RPDO, at times after or instead of one that is wrong, or as the last of many.
    fn plan_rpdo(&mut self, id: Id, bytes: usize) {
        let own_time = self.blueprint.is_in_its_own_time();
        let frames = if !own_time && self.chance(3) { BURST } else { 1 };
        let all = (0..frames).map(|_| [(); 8].map(|()| self.byte())).collect::<Vec<_>>();
        let right = all.iter().map(|data| Frame::new(id, Data::new(&data[..bytes])));
        let right: Vec<Frame> = right.collect();
        if own_time || !self.chance(20) {
            return self.passes(Kind::Rpdo, right, PAUSE);
        }
        let wrong = self.wrong_rpdo(right[0], &all[0]);
        self.passes(Kind::RpdoWrong, vec![wrong], PAUSE);
        // What the wrong one has changed is seen without the right one.
        if self.chance(50) {
            self.passes(Kind::Rpdo, right, PAUSE);
        }
    }

    /// A frame that is nearly the one of an RPDO; `data` are eight bytes that begin with its own.
    pub(super) fn wrong_rpdo(&mut self, right: Frame, data: &[u8; 8]) -> Frame {
        let bytes = right.data.len();
        let of = |length: usize| Frame { data: Data::new(&data[..length]), ..right };
        match self.below(6) {
            0 | 1 => of(bytes.saturating_sub(1)),
            2 => of((bytes + 1).min(8)),
            3 => of(0),
            4 => Frame { id: of_another_length(right.id), ..right },
            _ => Frame { remote: true, data: Data::new(&[0; 8][..bytes]), ..right },
        }
    }

    /// What a PDO holds is read.
    fn plan_look(&mut self, usage: &Usage) {
        let place = self.below(usage.entries.len());
        // The last entries are those that are lost first.
        let place = if self.chance(30) { usage.entries.len().saturating_sub(1) } else { place };
        let read = usage.entries.get(place).map(|entry| Request::Upload(entry.mux));
        let read = read.map(|request| self.asks(Kind::Upload, request));
        self.plan(read);
    }

    /// What a PDO holds is written by other means.
    fn plan_change(&mut self, usage: &Usage, scene: Scene<'_>) {
        let place = self.below(usage.entries.len());
        let entry = usage.entries.get(place).and_then(|entry| scene.od.entry(entry.mux));
        let Some(entry) = entry.filter(|entry| entry.access.writable()) else { return };
        if let Some(value) = self.value(entry, scene) {
            self.plan_write(Kind::Download, entry.mux, &value);
        }
    }

    /// A PDO, or the node, is switched off and on.
    fn plan_interruption(&mut self, usage: &Usage, scene: Scene<'_>) {
        match self.below(4) {
            0 => self.plan_state(Service::STOP),
            1 => self.plan_state(Service::ENTER_PRE_OPERATIONAL),
            2 => self.plan_reset(),
            _ => return self.plan_parameters(usage.index, usage.cob, &[]),
        }
        if self.chance(35) {
            self.plan_transfer(usage, scene);
            self.plan_sync(1, scene);
        }
        if self.chance(85) {
            self.plan_state(Service::START);
        }
    }

    /// The parameters of the communication are again those of the last power-on.
    fn plan_reset(&mut self) {
        let command = Command { service: Service::RESET_COMMUNICATION, node: self.node() };
        let reset = Action::new(Kind::NmtReset, vec![command.frame()], self.boots());
        self.plan(Some(reset));
    }

    /// The next SYNC so many times.
    fn plan_sync(&mut self, times: usize, scene: Scene<'_>) {
        let frame = self.sync(Kind::Sync, scene).into_iter().collect::<Vec<_>>();
        self.passes(Kind::Sync, frame.repeat(times), PAUSE);
    }

    /// RPDOs that wait for a SYNC, what happens until it comes, and what they have changed then.
    pub(super) fn whole_wait(&mut self, scene: Scene<'_>) -> Option<Action> {
        let kind = self.pick(&[0, 1, 1, 2, 240])?;
        let direction = Direction::Receive;
        let pdos = if self.pdos[0] == self.pdos[1] { &self.pdos[..1] } else { &self.pdos[..] };
        let usages = pdos.iter().filter_map(|pdo| usage(0x1400 + pdo, direction, scene));
        let usages = usages.collect::<Vec<_>>();
        for usage in &usages {
            self.plan_parameters(usage.index, usage.cob, &[(KIND, kind)]);
        }
        self.plan_state(Service::START);
        for _ in 0..2 + self.below(3) {
            for usage in &usages {
                (0..self.below(3)).for_each(|_| self.plan_transfer(usage, scene));
            }
            let Some(usage) = usages.get(self.below(usages.len())) else { break };
            match self.below(6) {
                0 => self.plan_change(usage, scene),
                1 => self.plan_interruption(usage, scene),
                2 => self.plan_absence(&usages, scene),
                _ => {}
            }
            self.plan_sync(1, scene);
            usages.iter().for_each(|usage| self.plan_look(usage));
            if self.chance(30) {
                // It takes effect once.
                self.plan_change(usage, scene);
                self.plan_sync(1, scene);
                self.plan_look(usage);
            }
        }
        self.planned.pop_front()
    }

    /// A SYNC comes while the node is not in OPERATIONAL.
    fn plan_absence(&mut self, usages: &[Usage], scene: Scene<'_>) {
        let away = self.pick(&[Service::STOP, Service::ENTER_PRE_OPERATIONAL]);
        self.plan_state(away.unwrap_or(Service::STOP));
        self.plan_sync(1, scene);
        usages.iter().for_each(|usage| self.plan_look(usage));
        self.plan_state(Service::START);
    }

    /// SYNC with a counter, and a TPDO that begins with one of its values.
    pub(super) fn whole_count(&mut self, scene: Scene<'_>) -> Option<Action> {
        let overflow: u8 = self.pick(&[2, 3, 5, 8, 8, 10, 240])?;
        self.plan_cycle(scene, 0, overflow)?;
        let (pdo, direction) = (self.pdos[self.below(2)], Direction::Transmit);
        let usage = usage(communication(direction) + pdo, direction, scene)?;
        let (kind, start) = (self.pick(&[1, 1, 2, 3])?, 1 + self.below(overflow.min(6).into()));
        self.plan_parameters(usage.index, usage.cob, &[(KIND, kind), (START_VALUE, start as u16)]);
        self.plan_state(Service::START);
        let id = CobId(scene.od.int(SYNC)? as u32).can_id();
        let mut counter = self.below(overflow.into()) as u8;
        for _ in 0..3 + self.below(4) {
            let frames = [(); 4].map(|()| {
                counter = counter % overflow + 1;
                Frame::new(id, [counter])
            });
            self.passes(Kind::Sync, frames.to_vec(), PAUSE);
        }
        self.sync_counter = counter;
        self.planned.pop_front()
    }

    /// The device produces SYNC, in which PDOs may take part.
    pub(super) fn whole_production(&mut self, scene: Scene<'_>) -> Option<Action> {
        let overflow: u8 = self.pick(&[0, 0, 2, 10, 240, 240])?;
        let period: u32 = self.pick(&[1_000, 1_500, 2_000, 5_000, 10_000])?;
        self.plan_cycle(scene, period, overflow)?;
        let (pdo, direction) = self.a_pdo();
        let usage = usage(communication(direction) + pdo, direction, scene);
        if let Some(usage) = &usage {
            let kind = self.pick(&[1, 1, 2, 0])?;
            self.plan_parameters(usage.index, usage.cob, &[(KIND, kind)]);
            self.plan_state(Service::START);
        }
        let present = scene.od.int(SYNC)? as u32;
        self.plan_write(Kind::ConfigureSync, SYNC, &(present | PRODUCES).to_le_bytes());
        let rounds = if overflow > 10 && period < 2_000 { u64::from(overflow) + 10 } else { 12 };
        self.passes(Kind::Wait, Vec::new(), rounds * u64::from(period));
        if self.chance(25) {
            self.plan_state(Service::STOP);
            self.passes(Kind::Wait, Vec::new(), 3 * u64::from(period));
            self.plan_state(Service::START);
        }
        if self.chance(25) {
            let other: u32 = self.pick(&[1_000, 2_500, 20_000])?;
            self.plan_write(Kind::ConfigureSync, PERIOD, &other.to_le_bytes());
            self.passes(Kind::Wait, Vec::new(), 5 * u64::from(other));
        }
        if self.chance(20) {
            // Its identifier is in use.
            let other = self.pick(&[0x90, 0x190, 0x6A0])?;
            let moved = present & !ANY_ID | PRODUCES | other;
            self.plan_write(Kind::ConfigureSync, SYNC, &moved.to_le_bytes());
        }
        if let Some(usage) = &usage {
            self.plan_transfer(usage, scene);
            self.passes(Kind::Wait, Vec::new(), 2 * u64::from(period));
            self.plan_look(usage);
        }
        // What comes often makes long waits dear.
        self.plan_write(Kind::ConfigureSync, SYNC, &(present & !PRODUCES).to_le_bytes());
        self.planned.pop_front()
    }

    /// The window after a SYNC in which synchronous PDOs are used, and RPDOs around its end.
    pub(super) fn whole_window(&mut self, scene: Scene<'_>) -> Option<Action> {
        let window: u32 = self.pick(&[0, 5_000, 20_000, 50_000])?;
        scene.od.entry(WINDOW)?;
        self.plan_write(Kind::ConfigureSync, WINDOW, &window.to_le_bytes());
        let (pdo, direction) = (self.pdos[self.below(2)], Direction::Receive);
        let usage = usage(communication(direction) + pdo, direction, scene)?;
        let kind = self.pick(&[0, 1, 1, 2])?;
        self.plan_parameters(usage.index, usage.cob, &[(KIND, kind)]);
        self.plan_state(Service::START);
        for _ in 0..=self.below(3) {
            let sync = self.sync(Kind::Sync, scene)?;
            let wait = self.pick(&[500, 3_000, 7_000, 60_000])?;
            self.passes(Kind::Sync, vec![sync], wait);
            self.plan_transfer(&usage, scene);
            self.plan_sync(1, scene);
            self.plan_look(&usage);
        }
        self.planned.pop_front()
    }

    /// Period and counter of SYNC, which nobody produces meanwhile.
    fn plan_cycle(&mut self, scene: Scene<'_>, period: u32, overflow: u8) -> Option<()> {
        let kind = Kind::ConfigureSync;
        let present = scene.od.int(SYNC)? as u32;
        [PERIOD, OVERFLOW].iter().try_for_each(|mux| scene.od.entry(*mux).map(drop))?;
        self.plan_write(kind, SYNC, &(present & !PRODUCES).to_le_bytes());
        self.plan_write(kind, PERIOD, &0_u32.to_le_bytes());
        self.plan_write(kind, OVERFLOW, &[overflow]);
        if period > 0 {
            self.plan_write(kind, PERIOD, &period.to_le_bytes());
        }
        Some(())
    }
}

/// A PDO as the device has it; `None` when it has none, or nothing is mapped.
fn usage(index: u16, direction: Direction, scene: Scene<'_>) -> Option<Usage> {
    let cob = scene.od.int(Mux::new(index, 1))? as u32 & !CobId::INVALID;
    let entries = scene.od.mapped(index)?;
    let used = CobId(cob).can_id().raw() > 0 && !entries.is_empty();
    used.then_some(Usage { direction, index, cob, entries, timed: false })
}
