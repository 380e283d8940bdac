//! Protection of a device under test.
//!
//! [`Wire`] knows what a frame does to a device, and [`Protection`] decides which of that is
//! refused. Both the planner and the bus ask them. A case that needs something protected is
//! skipped, and the reason names the protection. [`Guarded`] refuses a frame that does it, from any
//! sender.

mod deed;
mod guard;
mod wire;

use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use canopen::Mux;
use canopen::eds::{Direction, Eds, ObjectKind};
use reports::reason::PROTECTED_BY;

pub use deed::Deed;
pub use guard::Guarded;
pub use wire::Wire;

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

    /// Protects what a device makes of received process data, and the outputs of CiA 401 with what
    /// they do on errors.
    pub fn protect_outputs(&mut self, eds: &Eds, generic_io: bool, by: &Arc<str>) {
        let received = eds.entries().filter(|entry| {
            entry.mux.index >= MANUFACTURER && entry.maps_into(Direction::Receive)
                || generic_io && OUTPUTS.iter().any(|range| range.contains(&entry.mux.index))
        });
        self.entries.extend(received.map(|entry| (entry.mux, Arc::clone(by))));
    }

    /// Protects from a deed that is not about an object.
    pub fn forbid(&mut self, deed: Deed, by: String) {
        self.deeds.push((deed, by));
    }

    /// Lets 1010h or 1011h be written so often.
    pub fn limit(&mut self, index: u16, limit: u32, by: String) {
        self.budgets.insert(index, Budget { limit, used: Arc::default(), by });
    }

    /// Whether an entry of the object is protected for what it is by the data sheet.
    pub fn has_entries_of(&self, index: u16) -> bool {
        self.entries.keys().any(|mux| mux.index == index)
    }

    /// Why the deed is refused, in one sentence.
    pub fn refuses(&self, deed: Deed) -> Option<String> {
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
    pub(crate) fn has_budgets(&self) -> bool {
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
        for protected in ["6200:01", "6206:01", "6411:01"] {
            let mux = protected.parse().unwrap();
            assert!(protection.refuses(Deed::Write(mux, None)).is_some(), "{protected}");
        }
        for free in ["1017:00", "6000:01", "1600:01", "6401:01"] {
            let mux = free.parse().unwrap();
            assert_eq!(protection.refuses(Deed::Write(mux, None)), None, "{free}");
        }
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
