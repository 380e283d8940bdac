//! Values and times that matter to a device: the ends of ranges, what engineers write, and the
//! times that run in it.

use std::time::Duration;

use canopen::eds::{Direction, Entry};
use canopen::pdo::Mapping;
use canopen::{DataType, Mux, NmtState};

use super::{Draw, Scene};
use crate::action::Then;
use crate::oracle::error_control;

/// Nodes that a device may monitor.
pub(super) const OTHERS: [u8; 4] = [125, 126, 127, 1];
/// Times in milliseconds, as they are configured.
const TIMES: [u16; 20] = [
    0, 1, 5, 10, 20, 30, 50, 60, 70, 80, 100, 200, 290, 300, 500, 1000, 16400, 32768, 40000, 65535,
];
/// Identifiers that nobody has by default.
const FREE: [u32; 8] = [0x190, 0x1F0, 0x290, 0x380, 0x3FE, 0x680, 0x6A0, 0x6C0];
/// Identifiers that no object may have.
pub(super) const RESTRICTED: [u32; 8] = [0x000, 0x001, 0x07F, 0x101, 0x180, 0x581, 0x601, 0x701];
/// The bits of a COB-ID that are the identifier, and how long it is.
pub(super) const ANY_ID: u32 = 0x3FFF_FFFF;
const KINDS: [u8; 14] = [0, 1, 2, 3, 4, 239, 240, 241, 251, 252, 253, 254, 255, 255];

impl Draw<'_> {
    /// The boot-up message, or what else follows a reset.
    pub(super) fn boots(&self) -> Then {
        Then::answer(error_control(self.node()))
    }

    /// A time after an action, mostly around one that runs.
    pub(super) fn time(&mut self, scene: Scene<'_>) -> Duration {
        let milliseconds = |value: Option<i64>| value.filter(|it| *it > 0).map(|it| it as u64);
        let mut known: Vec<u64> = Vec::with_capacity(16);
        let mut know = |micros: Option<u64>| known.extend(micros.filter(|it| *it > 0));
        know(milliseconds(scene.int(0x1017, 0)).map(|it| it * 1000));
        for sub in 1..=4 {
            let entry = scene.int(0x1016, sub).unwrap_or(0);
            know(milliseconds(Some(entry & 0xFFFF)).map(|it| it * 1000));
        }
        let life = scene.int(0x100C, 0).unwrap_or(0) * scene.int(0x100D, 0).unwrap_or(0);
        know(milliseconds(Some(life)).map(|it| it * 1000));
        know(milliseconds(scene.int(0x1006, 0)));
        know(milliseconds(scene.int(0x1007, 0)));
        know(milliseconds(scene.int(0x1015, 0)).map(|it| it * 100));
        for pdo in self.pdos {
            know(milliseconds(scene.int(0x1800 + pdo, 3)).map(|it| it * 100));
            know(milliseconds(scene.int(0x1800 + pdo, 5)).map(|it| it * 1000));
            know(milliseconds(scene.int(0x1400 + pdo, 5)).map(|it| it * 1000));
        }
        if !matches!(scene.talk, crate::talk::Talk::Idle) {
            know(Some(self.blueprint.settings().sdo_timeout.as_micros() as u64));
        }
        let micros = match self.below(10) {
            0..=5 if !known.is_empty() => {
                let time = known[self.below(known.len())];
                let margin = (time / 20).max(1_500);
                match self.below(6) {
                    0 => time.saturating_sub(margin),
                    1 | 2 => time + margin,
                    3 => time / 2,
                    4 => 2 * time + margin,
                    _ => time,
                }
            }
            0..=7 => self.pick(&[100, 1_000, 2_000, 5_000, 10_000, 20_000, 50_000]).unwrap_or(0),
            8 => self.pick(&[100_000, 300_000, 600_000]).unwrap_or(0),
            _ => self.pick(&[1_100_000, 2_500_000, 8_000_000]).unwrap_or(0),
        };
        // What comes often makes long waits dear, and says nothing new after some dozen times.
        let busy = self.fastest(scene).map_or(Duration::MAX, |period| period * 64);
        Duration::from_micros(micros).min(busy)
    }

    /// The shortest period with which the device sends something.
    fn fastest(&self, scene: Scene<'_>) -> Option<Duration> {
        let milliseconds = |value: Option<i64>| {
            value.filter(|it| *it > 0).map(|it| Duration::from_millis(it as u64))
        };
        let sync = scene.int(0x1005, 0).is_some_and(|cob| cob & 1 << 30 != 0);
        let sync = scene.int(0x1006, 0).filter(|it| sync && *it > 0);
        let timers = scene.od.entries_in(0x1800..=0x19FF).iter();
        let timers = timers.filter(|entry| entry.mux.sub == 5);
        let timers = timers.filter_map(|entry| milliseconds(scene.od.int(entry.mux)));
        milliseconds(scene.int(0x1017, 0))
            .into_iter()
            .chain(sync.map(|it| Duration::from_micros(it as u64)))
            .chain(timers.filter(|_| scene.state == NmtState::OPERATIONAL))
            .min()
    }

    /// A value for an object: its bytes, `None` when the object is best left alone.
    pub(super) fn value(&mut self, entry: &Entry, scene: Scene<'_>) -> Option<Vec<u8>> {
        let mux = entry.mux;
        if self.blueprint.is_of_application(mux) {
            return self.value_of_application(entry, scene);
        }
        let size = entry.data_type.size()?;
        let number = self.number(mux, scene)?;
        Some(number.to_le_bytes()[..size.min(8)].to_vec())
    }

    /// What is received may have any value, and what keeps it; everything else keeps the value that
    /// it has, since nobody knows what another one does.
    fn value_of_application(&mut self, entry: &Entry, scene: Scene<'_>) -> Option<Vec<u8>> {
        let present = scene.od.get(entry.mux)?.to_vec();
        let free = entry.maps_into(Direction::Receive) || self.blueprint.keeps(entry.mux);
        if !free || !entry.data_type.is_integer() || self.chance(30) {
            return Some(present);
        }
        let (low, high) = limits(entry, self.node())?;
        let number = match self.below(4) {
            0 => low,
            1 => high,
            _ => {
                let span = (high - low).max(0) as u128 + 1;
                let drawn: u64 = self.bytes.arbitrary().unwrap_or(0);
                low + (u128::from(drawn) % span) as i128
            }
        };
        Some(number.to_le_bytes()[..present.len().min(8)].to_vec())
    }

    fn number(&mut self, mux: Mux, scene: Scene<'_>) -> Option<u64> {
        let present = scene.od.int(mux).unwrap_or(0) as u64;
        // 0 switches off what runs, and is drawn more often than each time.
        let time = if self.chance(12) { 0 } else { u64::from(self.pick(&TIMES)?) };
        Some(match (mux.index, mux.sub) {
            (0x1003, 0) => self.pick(&[0, 0, 1])?,
            // A clock that is set and told shows what it was set to.
            (0x1012, 0) if self.chance(30) => present & u64::from(ANY_ID) | 0xC000_0000,
            (0x1005 | 0x1012 | 0x1014, 0) => self.cob_id(mux, present, scene),
            (0x1006, 0) => self.pick(&[
                0,
                1000,
                1500,
                2000,
                5000,
                10_000,
                20_000,
                50_000,
                120_000,
                3_000_000_000,
            ])?,
            (0x1007, 0) => self.pick(&[0, 1000, 2000, 5000, 50_000, 100_000])?,
            (0x100D, 0) => self.pick(&[0, 1, 2, 3, 10, 127, 128, 255])?,
            (0x1015, 0) => self.pick(&[0, 1, 10, 100, 500, 1000, 40_000])?,
            (0x1016, 1..) => {
                let node = match self.below(10) {
                    0 => self.node(),
                    1 => self.pick(&[0, 128, 255])?,
                    _ => self.pick(&OTHERS)?,
                };
                u64::from(node) << 16 | time
            }
            (0x1019, 0) => self.pick(&[0, 1, 2, 3, 4, 10, 240, 241, 255])?,
            (0x1028, 1..) => {
                let node = u64::from(self.pick(&OTHERS)?);
                self.pick(&[0x8000_0080 + node, 0x80 + node, 0x8000_0000, 0x2000_0080])?
            }
            (0x1029, 1..) => self.pick(&[0, 1, 2, 2, 3, 255])?,
            (0x1200..=0x12FF, 1 | 2) => self.cob_id(mux, present, scene),
            (0x1200..=0x12FF, 3) => self.pick(&[1, 5, 127, 128])?,
            (0x1400..=0x15FF | 0x1800..=0x19FF, 1) => self.cob_id(mux, present, scene),
            (0x1400..=0x15FF | 0x1800..=0x19FF, 2) => u64::from(self.pick(&KINDS)?),
            (0x1400..=0x15FF | 0x1800..=0x19FF, 3) => {
                self.pick(&[0, 10, 50, 100, 500, 1000, 40_000])?
            }
            (0x1800..=0x19FF, 6) => self.pick(&[0, 1, 2, 4, 240, 241])?,
            (0x1600..=0x17FF | 0x1A00..=0x1BFF, 0) => {
                self.pick(&[0, 0, 1, 1, 2, 2, 3, 8, 9, 64, 254, 255])?
            }
            (0x1600..=0x17FF, _) => u64::from(self.mapping(Direction::Receive)?.encode()),
            (0x1A00..=0x1BFF, _) => u64::from(self.mapping(Direction::Transmit)?.encode()),
            (0x1F80, 0) => self.pick(&[0, 4, 4, 8, 12])?,
            (0x100C | 0x1017, 0) | (_, 5) => time,
            _ if self.chance(60) => present,
            _ => self.bytes.arbitrary().ok()?,
        })
    }

    /// A COB-ID: mostly the present one, switched off or on, or another one for a switched-off
    /// object.
    fn cob_id(&mut self, mux: Mux, present: u64, scene: Scene<'_>) -> u64 {
        const INVALID: u64 = 1 << 31;
        const PRODUCES: u64 = 1 << 30;
        let own = scene.od.entry(mux).and_then(|entry| entry.default.as_ref());
        let own = own.and_then(|term| term.resolve(self.node()).as_int()).unwrap_or(0) as u64;
        let id = own & u64::from(ANY_ID);
        let id = if id == 0 { u64::from(FREE[self.below(FREE.len())]) } else { id };
        match self.below(16) {
            0..=4 => present ^ INVALID,
            5..=7 => id,
            8..=9 => id | INVALID,
            10 => id | PRODUCES,
            11 if self.chance(50) => {
                // That of another PDO, which has it or had it.
                let base = if self.chance(50) { 0x1400 } else { 0x1800 };
                let other = scene.int(base + self.pdos[self.below(2)], 1).unwrap_or(0) as u64;
                other & u64::from(ANY_ID)
            }
            11 => u64::from(FREE[self.below(FREE.len())]),
            12 => INVALID | u64::from(FREE[self.below(FREE.len())]),
            13 => u64::from(RESTRICTED[self.below(RESTRICTED.len())]),
            14 => id | 1 << 29,
            _ => present ^ PRODUCES,
        }
    }

    /// An entry of a mapping: mostly one that fits.
    pub(super) fn mapping(&mut self, direction: Direction) -> Option<Mapping> {
        let right = self.object_to_map(direction)?;
        Some(match self.below(12) {
            0 => Mapping { bits: right.bits.wrapping_add(8), ..right },
            1 => Mapping { mux: Mux::new(right.mux.index, 0xF0), bits: 8 },
            2 => Mapping { mux: Mux::new(0x5FFF, 0), bits: 8 },
            3 => self.gap(),
            4 => Mapping { mux: Mux::new(0x1018, 1), bits: 32 },
            5 => Mapping { mux: Mux::new(0, 0), bits: 0 },
            _ => right,
        })
    }

    /// An object that a PDO can hold, in its whole length.
    pub(super) fn object_to_map(&mut self, direction: Direction) -> Option<Mapping> {
        let fits = |it: &&Entry| it.maps_into(direction) && it.data_type.size().is_some();
        let mut entries: Vec<&Entry> = self.blueprint.eds().entries().filter(fits).collect();
        // What a PDO says of the communication, and when, is known, and so is what keeps its value.
        let blueprint = self.blueprint;
        let known = |it: &&Entry| !blueprint.is_of_application(it.mux) || blueprint.keeps(it.mux);
        let percent = if direction == Direction::Transmit { 45 } else { 70 };
        if entries.iter().any(known) && self.chance(percent) {
            entries.retain(known);
        }
        let entry = *entries.get(self.below(entries.len()))?;
        let bits = match entry.data_type {
            DataType::BOOLEAN => 1,
            other => 8 * other.size()? as u8,
        };
        Some(Mapping { mux: entry.mux, bits })
    }
}

impl Draw<'_> {
    /// A gap, mostly of its length. A data sheet may leave out which a device supports.
    pub(super) fn gap(&mut self) -> Mapping {
        let dummies = &self.blueprint.eds().dummies;
        match dummies.get(self.below(dummies.len())) {
            Some(dummy) => {
                let size = DataType(*dummy).size().unwrap_or(1) as u8;
                let bits = if *dummy == DataType::BOOLEAN.0 { 1 } else { 8 * size };
                let bits = if self.chance(20) { 8 } else { bits };
                Mapping { mux: Mux::new(*dummy, 0), bits }
            }
            None => Mapping { mux: Mux::new(0, 0), bits: 0 },
        }
    }
}

/// The lowest and the highest value of an entry.
pub(crate) fn limits(entry: &Entry, node: u8) -> Option<(i128, i128)> {
    let (lowest, highest) = entry.data_type.limits()?;
    let bound = |term: &Option<canopen::eds::Term>| term.as_ref()?.resolve(node).as_int();
    Some((bound(&entry.low).unwrap_or(lowest), bound(&entry.high).unwrap_or(highest)))
}
