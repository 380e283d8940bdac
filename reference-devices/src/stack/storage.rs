//! Storing and restoring parameters (CiA 301, 7.5.2.13 and 7.5.2.14, objects 1010h and 1011h).

use std::collections::BTreeMap;
use std::ops::RangeInclusive;

use canopen::eds::{Access, Eds};
use canopen::{Abort, Dictionary, Instant, Mux};

use crate::stack::base::Base;

/// The non-volatile memory: the values of the objects after a reset.
///
/// It has two banks, of which the newest that is complete counts, so that a device that loses its
/// supply while it stores has the old values or the new ones, and no mixture.
#[derive(Clone)]
pub(crate) struct Storage {
    defaults: Dictionary,
    /// In ascending order.
    storable: Vec<Mux>,
    banks: [Bank; 2],
    save: Option<Save>,
    /// Whether the supply has failed during a save.
    torn: bool,
    /// Whether the device must restart after a "load".
    restart: bool,
}

/// The differences from the defaults. A default that depends on the node id continues to follow it.
#[derive(Clone, Debug, Default)]
struct Bank {
    /// Written last of all; 0 is a bank that is not complete.
    number: u32,
    values: Values,
}

type Values = BTreeMap<Mux, Vec<u8>>;

/// A save under way.
#[derive(Clone)]
struct Save {
    /// Most have the default, which is `None`.
    values: Vec<(Mux, Option<Vec<u8>>)>,
    /// The values stored beside them.
    onto: Values,
    begun: Instant,
    done: Instant,
}

impl Storage {
    /// The memory of a new device. All writable objects are stored, except for those that the data
    /// sheet keeps out of a configuration (`ObjFlags` bit 0), commands, and records of events.
    /// `stored` is present from the start.
    pub(crate) fn new(eds: &Eds, defaults: &Dictionary, stored: &BTreeMap<Mux, i64>) -> Self {
        let configuration = eds.objects.iter().filter(|object| {
            object.flags.unwrap_or_default() & REFUSED_ON_DOWNLOAD == 0
                && !matches!(object.index, HISTORY | STORE | RESTORE)
        });
        let entries = configuration.flat_map(|object| &object.entries);
        let storable =
            entries.filter(|entry| matches!(entry.access, Access::Rw | Access::Rwr | Access::Rww));
        let mut storable: Vec<Mux> = storable.map(|entry| entry.mux).collect();
        storable.sort_unstable();
        let mut written = defaults.clone();
        let values = stored.iter().filter_map(|(mux, value)| {
            written.set_int(*mux, *value);
            Some((*mux, written.get(*mux)?.to_vec()))
        });
        let first = Bank { number: 1, values: values.collect() };
        let (defaults, banks) = (defaults.clone(), [first, Bank::default()]);
        Self { defaults, storable, banks, save: None, torn: false, restart: false }
    }

    /// A reset loads the objects of these indices from the newest bank.
    pub(crate) fn load(&self, indices: RangeInclusive<u16>, od: &mut Dictionary) {
        od.restore(&self.defaults, indices.clone());
        let stored = self.newest().values.iter();
        stored
            .filter(|(mux, _)| indices.contains(&mux.index))
            .for_each(|(mux, bytes)| od.set(*mux, bytes));
    }

    /// The device has another node id, and therefore other defaults.
    pub(crate) fn take_defaults(&mut self, defaults: Dictionary) {
        let before = std::mem::replace(&mut self.defaults, defaults);
        for (mux, bytes) in self.save.iter_mut().flat_map(|save| &mut save.values) {
            bytes.get_or_insert_with(|| before.get(*mux).unwrap_or_default().to_vec());
        }
    }

    /// Whether the object is a parameter that can be stored.
    pub(crate) fn keeps(&self, mux: Mux) -> bool {
        self.storable.binary_search(&mux).is_ok()
    }

    /// Until when a save lasts.
    pub(crate) fn poll_at(&self) -> Option<Instant> {
        self.save.as_ref().map(|save| save.done)
    }

    /// The signature was right: stores or forgets a group of objects.
    pub(crate) fn execute(&mut self, now: Instant, mux: Mux, base: &mut Base) {
        let group = base.rules.parameter_group(mux.sub);
        if mux.index == STORE {
            let chosen = |mux: &&Mux| group.contains(&mux.index) && base.rules.stored(**mux);
            let values = self.storable.iter().filter(chosen).filter_map(|mux| {
                let bytes = base.od.get(*mux)?;
                let bytes = &bytes[..base.rules.stored_length(bytes.len())];
                Some((*mux, (self.defaults.get(*mux) != Some(bytes)).then(|| bytes.to_vec())))
            });
            let values = values.collect();
            let done = now + base.settings.save_time;
            let bank = if base.rules.save_extends_newest() { self.newest() } else { self.older() };
            let onto = bank.values.clone();
            if self.torn && !base.rules.saves_after_a_cut() {
                return;
            }
            self.save = Some(Save { values, onto, begun: now, done });
            // A memory that takes no time has no deadline, so it is completed at once.
            self.handle_timeout(now);
        } else {
            // A save that ended after this would bring back what is forgotten here.
            self.finish();
            let mut values = self.newest().values.clone();
            values.retain(|mux, _| !group.contains(&mux.index) || !base.rules.forgotten(*mux));
            self.commit(values);
            self.restart = base.rules.load_restarts();
            if !base.rules.load_waits_for_reset() {
                for mux in self.storable.iter().filter(|mux| group.contains(&mux.index)) {
                    base.od.set(*mux, self.defaults.get(*mux).unwrap_or_default());
                }
            }
        }
    }

    /// Whether "load" was just executed on a device that restarts after it.
    pub(crate) fn takes_restart(&mut self) -> bool {
        std::mem::take(&mut self.restart)
    }

    /// A parameter has changed, which a device that stores autonomously keeps: by the sub-index of
    /// its group, or of all parameters.
    pub(crate) fn changed(&mut self, mux: Mux, base: &Base) {
        const AUTONOMOUS: i64 = 1 << 1;
        let group = match mux.index {
            0x1000..=0x1FFF => 2,
            0x6000..=0x9FFF => 3,
            _ => 1,
        };
        let capability = [group, 1].into_iter().find_map(|sub| base.od.int(Mux::new(STORE, sub)));
        let capability = capability.unwrap_or(0);
        let process_data = base.od.entry(mux).is_some_and(|entry| entry.mappable);
        if capability & AUTONOMOUS == 0 || process_data || !self.keeps(mux) {
            return;
        }
        if let Some(bytes) = base.od.get(mux) {
            let onto = self.newest().values.clone();
            let values = self.with(onto, vec![(mux, Some(bytes.to_vec()))]);
            self.commit(values);
        }
    }

    pub(crate) fn handle_timeout(&mut self, now: Instant) {
        if self.poll_at().is_some_and(|done| done <= now) {
            self.finish();
        }
    }

    /// Ends a save at once.
    pub(crate) fn finish(&mut self) {
        if let Some(save) = self.save.take() {
            let values = self.with(save.onto, save.values);
            self.commit(values);
        }
    }

    /// The supply is gone, and with it the rest of what was being stored.
    pub(crate) fn cut(&mut self, now: Instant, base: &Base) {
        let Some(mut save) = self.save.take() else { return };
        self.torn = true;
        let (part, whole) = (now.since(save.begun), save.done.since(save.begun));
        let written = save.values.len() as u128 * part.as_nanos() / whole.as_nanos().max(1);
        save.values.truncate(written as usize);
        let values = self.with(save.onto, save.values);
        if base.rules.save_completes_last() {
            *self.older_mut() = Bank { number: 0, values };
        } else {
            self.commit(values);
        }
    }

    fn with(&self, mut values: Values, saved: Vec<(Mux, Option<Vec<u8>>)>) -> Values {
        for (mux, bytes) in saved {
            match bytes.filter(|bytes| self.defaults.get(mux) != Some(bytes)) {
                Some(bytes) => values.insert(mux, bytes),
                None => values.remove(&mux),
            };
        }
        values
    }

    fn commit(&mut self, values: Values) {
        let number = self.newest().number + 1;
        *self.older_mut() = Bank { number, values };
    }

    /// Stores a value beside those that are stored.
    pub(crate) fn put(&mut self, mux: Mux, bytes: &[u8]) {
        let values = self.newest().values.clone();
        let values = self.with(values, vec![(mux, Some(bytes.to_vec()))]);
        self.commit(values);
    }

    /// Forgets everything that was stored.
    pub(crate) fn forget(&mut self) {
        self.commit(Values::new());
    }

    fn newest(&self) -> &Bank {
        let [first, second] = &self.banks;
        if first.number >= second.number { first } else { second }
    }

    fn older(&self) -> &Bank {
        let [first, second] = &self.banks;
        if first.number >= second.number { second } else { first }
    }

    fn older_mut(&mut self) -> &mut Bank {
        let [first, second] = &mut self.banks;
        if first.number >= second.number { second } else { first }
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

pub(crate) const STORE: u16 = 0x1010;
pub(crate) const RESTORE: u16 = 0x1011;
const HISTORY: u16 = 0x1003;
const REFUSED_ON_DOWNLOAD: u32 = 1 << 0;

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use crate::rules::Rules;
    use crate::stack::testing::{Fixture, eds, full, mux, sent};
    use crate::stack::{Inert, NodeSettings};
    use canopen::{Abort, Mux};

    const PERIOD: Mux = mux(0x1017, 0);
    const OWN: Mux = mux(0x2000, 0);

    /// 1017h is 500 and 2000h is 7, neither stored.
    fn changed(rules: &str) -> Fixture {
        let mut fixture = match rules {
            "" => Fixture::new(&eds(full())),
            rules => Fixture::mutant(&eds(full()), rules),
        };
        fixture.write(PERIOD, &[0xF4, 1]).unwrap();
        fixture.write(OWN, &[7]).unwrap();
        fixture
    }

    fn after_reset(fixture: &mut Fixture) -> (Vec<u8>, Vec<u8>) {
        fixture.send("000#8105");
        fixture.run_to(fixture.now.0 / 1000 + 10_000);
        (fixture.read(PERIOD).unwrap(), fixture.read(OWN).unwrap())
    }

    #[test]
    fn what_is_stored_survives_reset_and_power_cycle() {
        let mut fixture = changed("");
        fixture.write(mux(0x1010, 1), b"save").unwrap();
        assert_eq!(fixture.read(mux(0x1010, 1)), Ok(vec![1, 0, 0, 0]));
        fixture.write(OWN, &[8]).unwrap();
        assert_eq!(after_reset(&mut fixture), (vec![0xF4, 1], vec![7]));
        fixture.node.power_on(fixture.now);
        fixture.run_to(fixture.now.0 / 1000 + 10_000);
        assert_eq!(fixture.read(OWN), Ok(vec![7]));
    }

    fn slow(rules: &str) -> Fixture {
        let rules = if rules.is_empty() { Rules::default() } else { Rules::otherwise(rules) };
        let save_time = Duration::from_millis(10);
        let settings = NodeSettings { save_time, ..NodeSettings::default() };
        Fixture::with(&eds(full()), settings, rules, Box::new(Inert))
    }

    const SAVE: &str = "605#2310100173617665";

    #[test]
    fn the_answer_comes_when_everything_is_stored() {
        let mut fixture = slow("");
        let at = fixture.now.0 / 1000;
        assert!(fixture.ask(SAVE).is_empty());
        assert_eq!(fixture.write(mux(0x1010, 1), b"save"), Err(Abort::DEVICE_STATE.0));
        assert_eq!(fixture.until(at + 50_000), sent(&[(at + 10_000, "585#6010100100000000")]));
    }

    #[test]
    fn a_node_that_is_stopped_meanwhile_does_not_answer() {
        let mut fixture = slow("");
        fixture.write(OWN, &[7]).unwrap();
        fixture.send(SAVE);
        fixture.send("000#0205");
        assert_eq!(fixture.until(fixture.now.0 / 1000 + 50_000), []);
        assert_eq!(after_reset(&mut fixture).1, [7]);
    }

    #[test]
    fn a_save_that_is_cut_short_leaves_the_old_values() {
        for (rules, torn) in [("", false), ("save-completes-last: false", true)] {
            let mut fixture = slow(rules);
            fixture.write(PERIOD, &[0xF4, 1]).unwrap();
            fixture.write(OWN, &[7]).unwrap();
            fixture.send(SAVE);
            fixture.run_to(fixture.now.0 / 1000 + 5_000);
            fixture.node.power_on(fixture.now);
            fixture.run_to(fixture.now.0 / 1000 + 5_000);
            let period = if torn { vec![0xF4, 1] } else { vec![0, 0] };
            assert_eq!(fixture.read(PERIOD), Ok(period));
            assert_eq!(fixture.read(OWN), Ok(vec![0x11]));
            fixture.write(OWN, &[8]).unwrap();
            fixture.send(SAVE);
            fixture.run_to(fixture.now.0 / 1000 + 50_000);
            fixture.node.power_on(fixture.now);
            fixture.run_to(fixture.now.0 / 1000 + 5_000);
            assert_eq!(fixture.read(OWN), Ok(vec![8]));
        }
    }

    #[test]
    fn a_sub_index_is_a_group_of_objects() {
        for (sub, period, own) in [(2, [0xF4, 1], 0x11), (3, [0, 0], 0x11), (4, [0, 0], 7)] {
            let mut fixture = changed("");
            fixture.write(mux(0x1010, sub), b"save").unwrap();
            assert_eq!(after_reset(&mut fixture), (period.to_vec(), vec![own]), "sub {sub}");
        }
    }

    #[test]
    fn restored_values_wait_for_the_reset() {
        let mut fixture = changed("");
        fixture.write(mux(0x1010, 1), b"save").unwrap();
        fixture.write(mux(0x1011, 1), b"load").unwrap();
        assert_eq!(fixture.read(OWN), Ok(vec![7]));
        assert_eq!(after_reset(&mut fixture), (vec![0, 0], vec![0x11]));
    }

    #[test]
    fn nothing_is_stored_without_the_signature() {
        let mut fixture = changed("");
        for wrong in [b"SAVE", b"evas", b"load", b"\0\0\0\0"] {
            assert_eq!(fixture.write(mux(0x1010, 1), wrong), Err(Abort::STORE.0));
        }
        assert_eq!(fixture.write(mux(0x1011, 1), b"save"), Err(Abort::STORE.0));
        assert_eq!(fixture.write(mux(0x1010, 1), b"sa"), Err(Abort::TOO_SHORT.0));
        assert_eq!(after_reset(&mut fixture), (vec![0, 0], vec![0x11]));
    }

    #[test]
    fn mutants_break_what_they_say() {
        let mut fixture = changed("save-stores-half");
        fixture.write(mux(0x1010, 1), b"save").unwrap();
        assert_eq!(after_reset(&mut fixture), (vec![0xF4, 1], vec![0x11]));
        let mut fixture = changed("load-waits-for-reset: false");
        fixture.write(mux(0x1011, 1), b"load").unwrap();
        assert_eq!(fixture.read(OWN), Ok(vec![0x11]));
        let mut fixture = changed("save-with-any-signature");
        assert_eq!(fixture.write(mux(0x1010, 1), b"evil"), Ok(()));
        assert_eq!(fixture.write(mux(0x1011, 1), b"evil"), Err(Abort::STORE.0));
    }
}
