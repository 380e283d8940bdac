//! The dictionary of a device with modules (CiA 306-1, 8.3): fixed objects are there with the first
//! module that has them, and extended objects get sub-indices with every one.
//!
//! Modules are taken by their places, and each continues where the one before it ended.

use std::collections::BTreeMap;

use super::Reader;
use super::compact::{made, number_of_subs};
use super::modules::{Count, Described, Extend, MODULE_LIST, MOST_MODULES};
use crate::eds::codes;
use crate::eds::ini::Name;
use crate::eds::model::{Access, Entry, Object, ObjectKind, Term};
use crate::mux::Mux;
use crate::value::{DataType, Value};

/// How far an object is extended, by the index that the modules name.
#[derive(Clone, Copy)]
struct End {
    /// The object that is extended now.
    index: u16,
    /// How many bits of its last sub-index are free.
    free: u8,
}

impl Reader {
    /// Adds what the modules at places 1, 2, 3 and so on bring. Gives the entries that they bring,
    /// with the lines of their sections.
    pub(super) fn connect(
        &mut self,
        described: &[Described],
        connected: &[u16],
    ) -> BTreeMap<Mux, usize> {
        let own: BTreeMap<Mux, usize> = self.lines();
        let by_number: BTreeMap<u16, &Described> =
            described.iter().map(|module| (module.number, module)).collect();
        let mut ends = BTreeMap::new();
        let connected = &connected[..connected.len().min(MOST_MODULES)];
        for module in connected.iter().filter_map(|number| by_number.get(number)) {
            self.fix(module);
            for extend in &module.extends {
                let index = extend.model.mux.index;
                let start = Some(End { index, free: 0 });
                let end = ends.entry(index).or_insert(start);
                // An object that is full was told of.
                *end = end.and_then(|end| self.extend_by(extend, end));
            }
        }
        self.list_modules(connected.len() as u8);
        let mut brought = self.lines();
        brought.retain(|mux, _| !own.contains_key(mux));
        brought
    }

    fn lines(&self) -> BTreeMap<Mux, usize> {
        self.eds.entries().map(|entry| (entry.mux, entry.line)).collect()
    }

    /// Adds the fixed objects that are not there yet.
    fn fix(&mut self, module: &Described) {
        for object in &module.fixed {
            if self.add(object.clone()) {
                let is_about =
                    |name: &str| matches!(Name::of(name), Name::Object(i, _) if i == object.index);
                let kept = module.kept.iter().filter(|section| is_about(&section.name));
                self.eds.unknown.extend(kept.cloned());
            }
        }
    }

    /// Adds an object, unless there is one with its index.
    fn add(&mut self, object: Object) -> bool {
        let objects = &mut self.eds.objects;
        let place = objects.binary_search_by_key(&object.index, |object| object.index);
        if let Err(place) = place {
            objects.insert(place, object);
        }
        place.is_err()
    }

    /// Adds what one module has of an object; nothing when there is no room for it.
    fn extend_by(&mut self, extend: &Extend, end: End) -> Option<End> {
        let (subs, free) = match extend.count {
            Count::Subs(subs) => (subs, 0),
            Count::Bits { bits, .. } if bits <= end.free => (0, end.free - bits),
            Count::Bits { bits, of } => (1, end.free + of - bits),
        };
        let mut index = end.index;
        for _ in 0..subs {
            index = self.extend_by_one(extend, index)?;
        }
        Some(End { index, free })
    }

    /// Adds a sub-index to an object, or to the next one when it is full; gives the one that has
    /// it.
    fn extend_by_one(&mut self, extend: &Extend, index: u16) -> Option<u16> {
        let base = extend.model.mux.index;
        let refuse = |reader: &mut Self, message: String| {
            reader.findings.add(&codes::SUB_EXTEND, extend.at, message);
            None
        };
        if !self.may_expand(1) {
            return refuse(self, "the modules have too many sub-indices".to_owned());
        }
        let kind = self.eds.object(index).map(|object| object.kind);
        if let Some(kind) = kind.filter(|kind| !kind.has_subs()) {
            let message = format!(
                "object {index:04X}h is {kind:?}; modules add sub-indices to arrays and records"
            );
            return refuse(self, message);
        }
        let highest = self.eds.object(index).map_or(0, highest);
        if highest < extend.last.unwrap_or(HIGHEST) {
            self.put(extend, Mux::new(index, highest + 1));
            return Some(index);
        }
        if extend.last.is_none() {
            let message = format!("object {base:04X}h has more than {HIGHEST} sub-indices");
            return refuse(self, message);
        }
        match index.checked_add(1).filter(|next| self.eds.object(*next).is_none()) {
            Some(next) => {
                self.put(extend, Mux::new(next, 1));
                Some(next)
            }
            None => {
                let message = format!(
                    "object {base:04X}h is full, and the object after {index:04X}h is another one"
                );
                refuse(self, message)
            }
        }
    }

    /// Adds a sub-index, and the object when it is the first.
    fn put(&mut self, extend: &Extend, mux: Mux) {
        let Entry { name, line, .. } = &extend.model;
        let (kind, entries) = (ObjectKind::ARRAY, Vec::new());
        let Mux { index, sub } = mux;
        self.add(Object { index, name: name.clone(), kind, flags: None, entries, line: *line });
        let Some(object) = object_mut(&mut self.eds.objects, index) else { return };
        if let Some(flags) = extend.flags {
            object.flags = Some(object.flags.unwrap_or_default() | flags);
        }
        let name = format!("{name}{sub}");
        insert(object, Entry { mux, name, ..extend.model.clone() });
        count_subs(object, sub);
    }

    /// Makes the module list (CiA 301, 7.5.2.30) as long as there are modules. Which number a
    /// module has in it, the sheet does not say.
    fn list_modules(&mut self, count: u8) {
        let Some(object) = object_mut(&mut self.eds.objects, MODULE_LIST) else { return };
        if !object.kind.has_subs() {
            return;
        }
        let first = Mux::new(MODULE_LIST, 1);
        let model = object.entry(1).cloned().unwrap_or_else(|| {
            let name = "Module".to_owned();
            let model = made(first, name, DataType::UNSIGNED16, None, object.line);
            Entry { access: Access::Ro, ..model }
        });
        object.entries.retain(|entry| matches!(entry.mux.sub, 0 | 0xFF));
        for sub in 1..=count {
            let mux = Mux::new(MODULE_LIST, sub);
            insert(object, Entry { mux, default: None, ..model.clone() });
        }
        count_subs(object, count);
    }
}

fn object_mut(objects: &mut [Object], index: u16) -> Option<&mut Object> {
    let place = objects.binary_search_by_key(&index, |object| object.index).ok()?;
    Some(&mut objects[place])
}

/// The highest sub-index; FFh describes the object and is not one of its values.
fn highest(object: &Object) -> u8 {
    let subs = object.entries.iter().map(|entry| entry.mux.sub);
    subs.filter(|sub| *sub <= HIGHEST).max().unwrap_or_default()
}

fn insert(object: &mut Object, entry: Entry) {
    let place = object.entries.partition_point(|other| other.mux.sub < entry.mux.sub);
    object.entries.insert(place, entry);
}

/// Lets sub 0 say the highest sub-index.
fn count_subs(object: &mut Object, highest: u8) {
    match object.entries.first_mut().filter(|entry| entry.mux.sub == 0) {
        Some(sub0) => sub0.default = Some(Term::fixed(Value::Int(highest.into()))),
        None => {
            let sub0 = number_of_subs(Mux::new(object.index, 0), highest, object.line);
            insert(object, sub0);
        }
    }
}

/// The highest sub-index that a value can have.
const HIGHEST: u8 = 0xFE;
