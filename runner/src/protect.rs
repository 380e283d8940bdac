//! Protection of a device under test.
//!
//! [`Wire`] knows what a frame does to a device, and [`Protection`] decides which of that is
//! refused. Both the planner and the bus ask them. A case that needs something protected is
//! skipped, and the reason names the protection. [`Guarded`] refuses a frame that does it, from any
//! sender.

mod deed;
mod guard;
mod wire;

use std::collections::{BTreeMap, BTreeSet};
use std::ops::RangeInclusive;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use canopen::Mux;
use canopen::eds::{Direction, Eds, Entry, ObjectKind};
use reports::reason::PROTECTED_BY;

pub use deed::Deed;
pub use guard::Guarded;
pub use wire::Wire;
pub(crate) use wire::download;

/// Objects that are named: a range of indices, all sub-indices or one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Objects {
    /// The indices.
    pub indices: RangeInclusive<u16>,
    /// The sub-index; all of them when absent.
    pub sub: Option<u8>,
}

impl Objects {
    /// Whether the address is one of them.
    pub fn contain(&self, mux: Mux) -> bool {
        self.indices.contains(&mux.index) && self.sub.is_none_or(|sub| sub == mux.sub)
    }
}

/// A kind of writes that a device bears so often: stored parameters wear memory out.
#[derive(Clone, Debug)]
struct Budget {
    limit: u32,
    used: Arc<AtomicU32>,
    by: String,
}

impl Budget {
    fn left(&self) -> u32 {
        self.limit.saturating_sub(self.used.load(Ordering::SeqCst))
    }
}

/// The protections of a device under test. The default protects nothing.
#[derive(Clone, Debug, Default)]
pub struct Protection {
    /// Objects, each with what protects them.
    objects: Vec<(Objects, String)>,
    /// The entries that the data sheet protects by their kind.
    entries: BTreeMap<Mux, Arc<str>>,
    /// Other deeds, each with what protects from them.
    deeds: Vec<(Deed, String)>,
    /// How often 1010h and 1011h may be written.
    budgets: BTreeMap<u16, Budget>,
    /// Outputs that must not be driven.
    outputs: Option<Outputs>,
}

/// The outputs of a device that must not move, and what is known of them.
#[derive(Clone, Debug)]
struct Outputs {
    /// The objects that show them.
    shown: BTreeSet<Mux>,
    by: Arc<str>,
    /// Why they would move: what is on.
    on: Arc<Mutex<Option<String>>>,
}

impl Outputs {
    fn is_on(&self) -> Option<String> {
        self.on.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

/// Whether an entry of a manufacturer's shows an output: process data that nobody writes.
fn shows_output(entry: &Entry, eds: &Eds) -> bool {
    (MANUFACTURER..PROFILES).contains(&entry.mux.index)
        && !entry.access.writable()
        && entry.maps_into(Direction::Transmit)
        && is_about_outputs(entry, eds)
}

/// Whether an entry of a manufacturer's may drive an output: a parameter that gives it a source, an
/// override or a polarity is not process data.
fn may_drive(entry: &Entry, eds: &Eds) -> bool {
    entry.mux.index >= MANUFACTURER && entry.access.writable() && is_about_outputs(entry, eds)
}

/// Whether an entry is about an output, by its name in the data sheet.
fn is_about_outputs(entry: &Entry, eds: &Eds) -> bool {
    let of_object = eds.object(entry.mux.index).map(|object| object.name.as_str());
    names_output(&entry.name) || of_object.is_some_and(names_output)
}

/// Whether a name has a word for outputs. Words end at anything but letters, and before a capital
/// after a small letter: `Output1Source`.
fn names_output(name: &str) -> bool {
    let mut words = vec![String::new()];
    let mut last = ' ';
    for letter in name.chars() {
        if !letter.is_alphabetic() || last.is_lowercase() && letter.is_uppercase() {
            words.push(String::new());
        }
        if let Some(word) = words.last_mut().filter(|_| letter.is_alphabetic()) {
            word.extend(letter.to_lowercase());
        }
        last = letter;
    }
    words.iter().any(|word| matches!(word.as_str(), "output" | "outputs" | "ao" | "do"))
}

/// Store parameters, and restore default parameters.
const STORES: [u16; 2] = [0x1010, 0x1011];

impl Protection {
    /// Whether nothing is protected.
    pub fn is_none(&self) -> bool {
        self.objects.is_empty()
            && self.entries.is_empty()
            && self.deeds.is_empty()
            && self.budgets.is_empty()
            && self.outputs.is_none()
    }

    /// Protects objects by their addresses.
    pub fn protect(&mut self, objects: Objects, by: String) {
        self.objects.push((objects, by));
    }

    /// Protects everything that the data sheet calls a DOMAIN.
    pub fn protect_domains(&mut self, eds: &Eds, by: &Arc<str>) {
        let domains = eds.objects.iter().filter(|object| object.kind == ObjectKind::DOMAIN);
        let of_objects = domains.flat_map(|object| &object.entries);
        let typed = eds.entries().filter(|entry| entry.data_type == canopen::DataType::DOMAIN);
        let all = of_objects.chain(typed).map(|entry| (entry.mux, Arc::clone(by)));
        self.entries.extend(all);
    }

    /// Protects what a device makes of received process data, the parameters that are about outputs
    /// by their names, and the outputs of CiA 401 with what they do on errors, those included that
    /// the data sheet lacks. While one of them is [on](Self::hold), nothing is sent that may move
    /// it.
    pub fn protect_outputs(&mut self, eds: &Eds, generic_io: bool, by: &Arc<str>) {
        let of_profile =
            |mux: Mux| generic_io && OUTPUTS.iter().any(|range| range.contains(&mux.index));
        let received = eds.entries().filter(|entry| {
            entry.mux.index >= MANUFACTURER && entry.maps_into(Direction::Receive)
                || of_profile(entry.mux)
        });
        let received: BTreeSet<Mux> = received.map(|entry| entry.mux).collect();
        let driving = eds.entries().filter(|entry| may_drive(entry, eds)).map(|entry| entry.mux);
        let moving = received.iter().copied().chain(driving);
        self.entries.extend(moving.map(|mux| (mux, Arc::clone(by))));
        let mut shown = received;
        if generic_io {
            for indices in OUTPUTS {
                self.objects.push((Objects { indices, sub: None }, by.to_string()));
            }
            shown.extend(VALUES.map(|index| Mux::new(index, 1)));
        }
        shown.retain(|mux| {
            mux.sub > 0 || eds.object(mux.index).is_none_or(|it| it.kind == ObjectKind::VAR)
        });
        shown.extend(eds.entries().filter(|entry| shows_output(entry, eds)).map(|it| it.mux));
        self.outputs = Some(Outputs { shown, by: Arc::clone(by), on: Arc::default() });
    }

    /// The objects that show the outputs which must not move.
    pub(crate) fn outputs(&self) -> impl Iterator<Item = Mux> {
        self.outputs.iter().flat_map(|outputs| &outputs.shown).copied()
    }

    /// From now on nothing is done that may move outputs, for the reason that they are `on`; when
    /// there is none, they are off.
    pub(crate) fn hold(&self, on: Option<String>) {
        if let Some(outputs) = &self.outputs {
            *outputs.on.lock().unwrap_or_else(PoisonError::into_inner) = on;
        }
    }

    /// Whether an output is on that must not move.
    pub(crate) fn holds(&self) -> bool {
        self.outputs.as_ref().is_some_and(|outputs| outputs.is_on().is_some())
    }

    /// Protects from a deed that is not about an object.
    pub fn forbid(&mut self, deed: Deed, by: String) {
        self.deeds.push((deed, by));
    }

    /// Lets 1010h or 1011h be written so often; of several limits, the smallest counts.
    pub fn limit(&mut self, index: u16, limit: u32, by: String) {
        if self.budgets.get(&index).is_none_or(|known| limit < known.limit) {
            self.budgets.insert(index, Budget { limit, used: Arc::default(), by });
        }
    }

    /// Whether an entry of the object is protected for what it is by the data sheet.
    pub fn has_entries_of(&self, index: u16) -> bool {
        self.entries.keys().any(|mux| mux.index == index)
    }

    /// Why the deed is refused, in one sentence.
    pub fn refuses(&self, deed: Deed) -> Option<String> {
        if deed.moves_outputs()
            && let Some(outputs) = &self.outputs
            && let Some(on) = outputs.is_on()
        {
            return Some(format!("{deed} while {on}: protected by {}", outputs.by));
        }
        let by = match deed {
            Deed::Write(mux, _) | Deed::Map(_, mux) => self.of(mux).or_else(|| {
                let budget = self.budgets.get(&mux.index)?;
                (budget.left() == 0).then_some(budget.by.as_str())
            }),
            // Every protected entry could be the one that is written.
            Deed::WriteAny(_) => {
                let objects = self.objects.iter().map(|(_, by)| by.as_str());
                objects.chain(self.entries.values().map(|by| &**by)).next()
            }
            other => {
                let mut deeds = self.deeds.iter();
                deeds.find(|(deed, _)| *deed == other).map(|(_, by)| by.as_str())
            }
        };
        by.map(|by| format!("{deed}{PROTECTED_BY}{by}"))
    }

    /// The protection of an object.
    fn of(&self, mux: Mux) -> Option<&str> {
        let named = self.objects.iter().find(|(objects, _)| objects.contain(mux));
        named.map(|(_, by)| by.as_str()).or_else(|| Some(self.entries.get(&mux)?))
    }

    /// Whether objects are protected.
    pub(crate) fn has_objects(&self) -> bool {
        !self.objects.is_empty() || !self.entries.is_empty()
    }

    /// Whether something may be done a number of times only.
    pub fn has_budgets(&self) -> bool {
        !self.budgets.is_empty()
    }

    /// Why these deeds, all together, are more than the device bears.
    pub fn exceeded(&self, deeds: &[Deed]) -> Option<String> {
        STORES.into_iter().find_map(|index| {
            let budget = self.budgets.get(&index)?;
            let count = deeds.iter().filter(|deed| deed.written() == Some(index)).count();
            let left = budget.left();
            (count as u32 > left).then(|| {
                let times =
                    if count == 1 { "1 write".to_owned() } else { format!("{count} writes") };
                format!("{times} of {index:04X}h, {left} left{PROTECTED_BY}{}", budget.by)
            })
        })
    }

    /// Counts what is done.
    pub fn spend(&self, deed: Deed) {
        if let Some(budget) = deed.written().and_then(|index| self.budgets.get(&index)) {
            budget.used.fetch_add(1, Ordering::SeqCst);
        }
    }
}

/// The first index that is not about communication.
const MANUFACTURER: u16 = 0x2000;
/// The first index of the device profiles.
const PROFILES: u16 = 0x6000;
/// The values of outputs in CiA 401, which a device may have that its data sheet does not know.
const VALUES: [u16; 8] = [0x6200, 0x6220, 0x6300, 0x6320, 0x6410, 0x6411, 0x6412, 0x6413];
/// The outputs of CiA 401, and what they do on errors.
const OUTPUTS: [RangeInclusive<u16>; 3] = [0x6200..=0x63FF, 0x6410..=0x6420, 0x6441..=0x644F];

#[cfg(test)]
mod tests {
    use reference_devices::devices;

    use super::*;

    #[test]
    fn outputs_are_what_a_device_receives() {
        let device = devices::device("generic").unwrap();
        let eds = &device.description.eds;
        let mut protection = Protection::default();
        protection.protect_outputs(eds, true, &Arc::from("`outputs: false`"));
        // The data sheet has no 6300h.
        for protected in ["6200:01", "6206:01", "6411:01", "6300:01"] {
            let mux = protected.parse().unwrap();
            assert!(protection.refuses(Deed::Write(mux, None)).is_some(), "{protected}");
        }
        for free in ["1017:00", "6000:01", "1600:01", "6401:01"] {
            let mux = free.parse().unwrap();
            assert_eq!(protection.refuses(Deed::Write(mux, None)), None, "{free}");
        }
    }

    #[test]
    fn a_parameter_of_an_output_is_known_by_its_name() {
        for name in
            ["Source of output 3", "Output1Source", "AO_Override", "DO2 polarity", "outputs"]
        {
            assert!(names_output(name), "{name}");
        }
        for name in ["Throughput", "Doors", "Input source", "AOK", ""] {
            assert!(!names_output(name), "{name}");
        }
        let device = devices::device("ax021211").unwrap();
        let mut protection = Protection::default();
        let by = Arc::from("`outputs: false`");
        protection.protect_outputs(&device.description.eds, false, &by);
        // Sources, overrides and set points of outputs; an input's type.
        let refused = ["2340:01", "2361:01", "7300:01", "6110:01"]
            .map(|mux| protection.refuses(Deed::Write(mux.parse().unwrap(), None)).is_some());
        assert_eq!(refused, [true, true, true, false]);
    }

    #[test]
    fn while_an_output_is_on_nothing_moves_it() {
        let device = devices::device("generic").unwrap();
        let mut protection = Protection::default();
        protection.hold(Some("output 6200:01 is on".to_owned()));
        assert!(!protection.holds(), "outputs are not protected");
        protection.protect_outputs(&device.description.eds, true, &Arc::from("`outputs: false`"));
        let heartbeat = Deed::Write(Mux::new(0x1016, 1), None);
        let moving = [Deed::Stop, Deed::Start, Deed::ResetNode, Deed::Stimulus, heartbeat];
        assert!(moving.iter().all(|deed| protection.refuses(*deed).is_none()));
        protection.hold(Some("output 6200:01 is on".to_owned()));
        assert!(moving.iter().all(|deed| protection.refuses(*deed).is_some()));
        let why = "NMT stop while output 6200:01 is on: protected by `outputs: false`";
        assert_eq!(protection.refuses(Deed::Stop).as_deref(), Some(why));
        assert_eq!(protection.refuses(Deed::Write(Mux::new(0x1017, 0), None)), None);
        protection.hold(None);
        assert_eq!(protection.refuses(Deed::Stop), None);
    }

    #[test]
    fn a_budget_is_spent() {
        let mut protection = Protection::default();
        protection.limit(0x1010, 2, "`stores: 2` in dut.yaml:3".to_owned());
        let store = Deed::Write(Mux::new(0x1010, 1), None);
        assert_eq!(protection.exceeded(&[store, store]), None);
        let why = "3 writes of 1010h, 2 left: protected by `stores: 2` in dut.yaml:3";
        assert_eq!(protection.exceeded(&[store; 3]).as_deref(), Some(why));
        protection.spend(store);
        assert_eq!(protection.refuses(store), None);
        protection.spend(store);
        let why = "write of 1010:01: protected by `stores: 2` in dut.yaml:3";
        assert_eq!(protection.refuses(store).as_deref(), Some(why));
    }
}
