//! Plans about what a device keeps over a reset.

use canopen::Mux;
use canopen::eds::Entry;
use canopen::sdo::Request;

use super::{Draw, Scene};
use crate::action::{Action, Kind};

/// Objects of the communication that are stored, each with the others of its kind.
const STORED: [(u16, u16); 8] = [
    (0x1005, 0x1007),
    (0x100C, 0x100D),
    (0x1012, 0x1019),
    (0x1028, 0x1029),
    (0x1200, 0x127F),
    (0x1400, 0x17FF),
    (0x1800, 0x1BFF),
    (0x2000, 0xFFFF),
];

impl Draw<'_> {
    /// Objects are written, stored or not, and read after a reset.
    pub(super) fn whole_memory(&mut self, scene: Scene<'_>) -> Option<Action> {
        let mut written = Vec::new();
        for _ in 0..2 + self.below(5) {
            let (first, last) = self.pick(&STORED)?;
            let all = scene.od.entries_in(first..=last);
            let blueprint = self.blueprint;
            let known = |mux| !blueprint.is_of_application(mux) || blueprint.keeps(mux);
            let fits = |entry: &Entry| {
                entry.access.writable() && entry.data_type.size().is_some() && known(entry.mux)
            };
            let Some(entry) = self.entry(all, fits) else { continue };
            if let Some(value) = self.value(entry, scene) {
                self.plan_write(Kind::Download, entry.mux, &value);
                written.push(entry.mux);
            }
        }
        let group = self.pick(&[1, 1, 1, 2, 3])?;
        if self.chance(85) {
            self.plan_write(Kind::Store, Mux::new(0x1010, group), b"save");
        }
        for _ in 0..=self.below(2) {
            let kind = if self.chance(30) { Kind::PowerCycle } else { Kind::NmtReset };
            let reset = self.action(kind, scene);
            self.plan(reset);
            for mux in &written {
                let read = self.asks(Kind::Upload, Request::Upload(*mux));
                self.plan(Some(read));
            }
        }
        self.planned.pop_front()
    }
}
