//! Downloads to the objects of the communication, in the order in which they make sense, mostly.

use canopen::Mux;
use canopen::eds::{Direction, Entry};
use canopen::pdo::CobId;

use super::{Draw, Scene};
use crate::action::{Action, Kind};

impl Draw<'_> {
    pub(super) fn configure(&mut self, kind: Kind, scene: Scene<'_>) -> Option<Action> {
        // These plans were not tried on a device in its own time.
        let whole = !self.blueprint.is_in_its_own_time();
        let mux = match kind {
            Kind::Store | Kind::Restore => return self.storage(kind, scene),
            Kind::ConfigurePdo if whole && self.chance(25) => {
                return match self.below(6) {
                    0 => self.whole_wait(scene),
                    1 => self.whole_delay(scene),
                    _ => self.whole_use(scene),
                };
            }
            Kind::ConfigurePdo => self.of_pdo(scene)?,
            Kind::ConfigureMapping if self.chance(25) => return self.whole_mapping(scene),
            Kind::ConfigureMapping => return self.of_mapping(scene),
            Kind::ConfigureErrorControl if whole && self.chance(25) => {
                return match self.below(3) {
                    0 => self.whole_guarding(scene),
                    _ => self.whole_monitoring(scene),
                };
            }
            Kind::ConfigureErrors if whole && self.chance(25) => return self.whole_errors(scene),
            Kind::ConfigureErrorControl => {
                self.one_of(scene, &[0x1017, 0x1017, 0x1016, 0x1016, 0x1016, 0x100C, 0x100D])?
            }
            Kind::ConfigureSync if whole && self.chance(30) => {
                return match self.below(3) {
                    0 => self.whole_count(scene),
                    1 => self.whole_production(scene),
                    _ => self.whole_window(scene),
                };
            }
            Kind::ConfigureSync => {
                self.one_of(scene, &[0x1005, 0x1005, 0x1006, 0x1006, 0x1007, 0x1019, 0x1012])?
            }
            Kind::ConfigureErrors => {
                self.one_of(scene, &[0x1003, 0x1014, 0x1015, 0x1028, 0x1029, 0x1029])?
            }
            Kind::ConfigureChannel if self.chance(40) => return self.whole_channel(scene),
            Kind::ConfigureChannel => self.one_of(scene, &[0x1201, 0x1201, 0x1202, 0x1280])?,
            _ => return None,
        };
        let entry = scene.od.entry(mux)?;
        let value = self.value(entry, scene)?;
        self.writes(kind, mux, &value)
    }

    /// An entry of one of these objects that can be written.
    fn one_of(&mut self, scene: Scene<'_>, indices: &[u16]) -> Option<Mux> {
        let index = self.pick(indices)?;
        let writable = |entry: &Entry| entry.access.writable();
        self.entry(scene.od.entries_in(index..=index), writable).map(|entry| entry.mux)
    }

    pub(super) fn a_pdo(&mut self) -> (u16, Direction) {
        let pdo = self.pdos[self.below(2)];
        let direction = if self.chance(60) { Direction::Transmit } else { Direction::Receive };
        (pdo, direction)
    }

    fn of_pdo(&mut self, scene: Scene<'_>) -> Option<Mux> {
        let (pdo, direction) = self.a_pdo();
        let index = communication(direction) + pdo;
        let sub = self.pick(&[1, 1, 1, 2, 2, 2, 3, 5, 5, 6])?;
        let mux = Mux::new(index, sub);
        let exists = scene.od.entry(mux).is_some_and(|entry| entry.access.writable());
        exists.then_some(mux)
    }

    /// The next download of the procedure: PDO off, count 0, entries, count, PDO on.
    fn of_mapping(&mut self, scene: Scene<'_>) -> Option<Action> {
        let kind = Kind::ConfigureMapping;
        let (pdo, direction) = self.a_pdo();
        let cob = Mux::new(communication(direction) + pdo, 1);
        let mapping = communication(direction) + pdo + 0x200;
        let valid = CobId(scene.od.int(cob)? as u32).valid();
        let count = scene.int(mapping, 0)?;
        if valid && self.chance(88) {
            let off = scene.od.int(cob)? as u32 | CobId::INVALID;
            return self.writes(kind, cob, &off.to_le_bytes());
        }
        if count > 0 && self.chance(75) {
            return match self.chance(65) {
                true => self.writes(kind, Mux::new(mapping, 0), &[0]),
                false => {
                    let on = scene.od.int(cob)? as u32 & !CobId::INVALID;
                    self.writes(kind, cob, &on.to_le_bytes())
                }
            };
        }
        let sub = self.pick(&[0, 0, 1, 1, 1, 2, 2, 3, 4, 8, 9])?;
        let mux = Mux::new(mapping, sub);
        let Some(entry) = scene.od.entry(mux) else {
            return self.writes(kind, mux, &[0; 4]);
        };
        let value = self.value(entry, scene)?;
        self.writes(kind, mux, &value)
    }

    fn storage(&mut self, kind: Kind, scene: Scene<'_>) -> Option<Action> {
        if kind == Kind::Store && !self.blueprint.is_in_its_own_time() && self.chance(15) {
            return self.whole_startup(scene);
        }
        if kind == Kind::Store && !self.blueprint.is_in_its_own_time() && self.chance(30) {
            return self.whole_memory(scene);
        }
        let (index, right) = match kind {
            Kind::Store => (0x1010, *b"save"),
            _ => (0x1011, *b"load"),
        };
        let fits = |entry: &Entry| entry.mux.sub > 0;
        let mut mux = self.entry(scene.od.entries_in(index..=index), fits)?.mux;
        if self.chance(12) {
            // A group that the device does not have.
            mux.sub = self.pick(&[0, 0x7F])?;
        }
        let signature = match self.below(6) {
            0 => *b"evas",
            1 => [right[0], right[1], right[2], right[3] ^ 1],
            _ => right,
        };
        if kind == Kind::Store && signature == right && self.chance(40) {
            self.plan_to_come_back(scene);
        }
        self.writes(kind, mux, &signature)
    }
}

pub(super) const fn communication(direction: Direction) -> u16 {
    match direction {
        Direction::Receive => 0x1400,
        Direction::Transmit => 0x1800,
    }
}
