//! Storing and restoring parameters (CiA 301, 7.5.2.13 and 7.5.2.14, objects 1010h and 1011h).

use std::ops::RangeInclusive;

use canopen::eds::{Access, Eds};
use canopen::{Abort, Dictionary, Mux};

use crate::services::Base;

/// The non-volatile memory: what the objects hold after a reset.
pub(crate) struct Storage {
    defaults: Dictionary,
    image: Dictionary,
    storable: Vec<Mux>,
}

impl Storage {
    /// The memory of a new device. What can be written is stored, except for what the data sheet
    /// keeps out of a configuration (`ObjFlags` bit 0) and what is a command or a record of events.
    pub(crate) fn new(eds: &Eds, defaults: &Dictionary) -> Self {
        let configuration = eds.objects.iter().filter(|object| {
            object.flags & REFUSED_ON_DOWNLOAD == 0
                && !matches!(object.index, HISTORY | STORE | RESTORE)
        });
        let entries = configuration.flat_map(|object| &object.entries);
        let storable =
            entries.filter(|entry| matches!(entry.access, Access::Rw | Access::Rwr | Access::Rww));
        Self {
            defaults: defaults.clone(),
            image: defaults.clone(),
            storable: storable.map(|entry| entry.mux).collect(),
        }
    }

    /// What a reset loads.
    pub(crate) fn image(&self) -> &Dictionary {
        &self.image
    }

    /// The signature was right: stores or forgets a group of objects.
    pub(crate) fn execute(&mut self, mux: Mux, base: &mut Base) {
        let group = group(mux.sub);
        if mux.index == STORE {
            let chosen = |mux: &&Mux| group.contains(&mux.index) && base.rules.stored(**mux);
            for mux in self.storable.iter().filter(chosen) {
                if let Some(bytes) = base.od.get(*mux) {
                    self.image.set(*mux, bytes);
                }
            }
        } else {
            self.image.restore(&self.defaults, group.clone());
            if !base.rules.load_waits_for_reset() {
                for mux in self.storable.iter().filter(|mux| group.contains(&mux.index)) {
                    base.od.set(*mux, self.defaults.get(*mux).unwrap_or_default());
                }
            }
        }
    }
}

/// Writing is a command that needs its signature.
pub(crate) fn check(mux: Mux, bytes: &[u8], base: &Base) -> Result<(), Abort> {
    let signature = if mux.index == STORE { b"save" } else { b"load" };
    let possible = base.od.int(mux).is_some_and(|capability| capability & 1 != 0);
    if possible && base.rules.signature_valid(signature, bytes) {
        Ok(())
    } else {
        Err(Abort::STORE)
    }
}

fn group(sub: u8) -> RangeInclusive<u16> {
    match sub {
        2 => 0x1000..=0x1FFF,
        3 => 0x6000..=0x9FFF,
        4.. => 0x2000..=0x5FFF,
        _ => 0x1000..=0xFFFF,
    }
}

pub(crate) const STORE: u16 = 0x1010;
pub(crate) const RESTORE: u16 = 0x1011;
const HISTORY: u16 = 0x1003;
const REFUSED_ON_DOWNLOAD: u32 = 1 << 0;

#[cfg(test)]
mod tests {
    use crate::testing::{Rig, eds, full, mux};
    use canopen::{Abort, Mux};

    const PERIOD: Mux = mux(0x1017, 0);
    const OWN: Mux = mux(0x2000, 0);

    /// 1017h is 500 and 2000h is 7, neither stored.
    fn changed(rules: &str) -> Rig {
        let mut rig = match rules {
            "" => Rig::new(&eds(full())),
            rules => Rig::mutant(&eds(full()), rules),
        };
        rig.write(PERIOD, &[0xF4, 1]).unwrap();
        rig.write(OWN, &[7]).unwrap();
        rig
    }

    fn after_reset(rig: &mut Rig) -> (Vec<u8>, Vec<u8>) {
        rig.send("000#8105");
        rig.run_to(rig.now.0 / 1000 + 10_000);
        (rig.read(PERIOD).unwrap(), rig.read(OWN).unwrap())
    }

    #[test]
    fn what_is_stored_survives_reset_and_power_cycle() {
        let mut rig = changed("");
        rig.write(mux(0x1010, 1), b"save").unwrap();
        assert_eq!(rig.read(mux(0x1010, 1)), Ok(vec![1, 0, 0, 0]));
        rig.write(OWN, &[8]).unwrap();
        assert_eq!(after_reset(&mut rig), (vec![0xF4, 1], vec![7]));
        rig.node.power_on(rig.now);
        rig.run_to(rig.now.0 / 1000 + 10_000);
        assert_eq!(rig.read(OWN), Ok(vec![7]));
    }

    #[test]
    fn a_sub_index_is_a_group_of_objects() {
        for (sub, period, own) in [(2, [0xF4, 1], 0x11), (3, [0, 0], 0x11), (4, [0, 0], 7)] {
            let mut rig = changed("");
            rig.write(mux(0x1010, sub), b"save").unwrap();
            assert_eq!(after_reset(&mut rig), (period.to_vec(), vec![own]), "sub {sub}");
        }
    }

    #[test]
    fn restored_values_wait_for_the_reset() {
        let mut rig = changed("");
        rig.write(mux(0x1010, 1), b"save").unwrap();
        rig.write(mux(0x1011, 1), b"load").unwrap();
        assert_eq!(rig.read(OWN), Ok(vec![7]));
        assert_eq!(after_reset(&mut rig), (vec![0, 0], vec![0x11]));
    }

    #[test]
    fn nothing_is_stored_without_the_signature() {
        let mut rig = changed("");
        for wrong in [b"SAVE", b"evas", b"load", b"\0\0\0\0"] {
            assert_eq!(rig.write(mux(0x1010, 1), wrong), Err(Abort::STORE.0));
        }
        assert_eq!(rig.write(mux(0x1011, 1), b"save"), Err(Abort::STORE.0));
        assert_eq!(rig.write(mux(0x1010, 1), b"sa"), Err(Abort::TOO_SHORT.0));
        assert_eq!(after_reset(&mut rig), (vec![0, 0], vec![0x11]));
    }

    #[test]
    fn mutants_break_what_they_say() {
        let mut rig = changed("save-stores-half");
        rig.write(mux(0x1010, 1), b"save").unwrap();
        assert_eq!(after_reset(&mut rig), (vec![0xF4, 1], vec![0x11]));
        let mut rig = changed("load-at-once");
        rig.write(mux(0x1011, 1), b"load").unwrap();
        assert_eq!(rig.read(OWN), Ok(vec![0x11]));
        let mut rig = changed("save-with-any-signature");
        assert_eq!(rig.write(mux(0x1010, 1), b"evil"), Ok(()));
        assert_eq!(rig.write(mux(0x1011, 1), b"evil"), Err(Abort::STORE.0));
    }
}
