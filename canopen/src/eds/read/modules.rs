//! `[SupportedModules]`, `[ConnectedModules]` and the sections of modules: what a module adds to
//! the objects of a device (CiA 306-1, 8).

use std::collections::{BTreeMap, BTreeSet};
use std::mem;

use super::object::{HEAD_KEYS, VALUE_KEYS};
use super::{Kept, Reader, is_one_of};
use crate::eds::codes;
use crate::eds::ini::{Key, ModulePart, Name, Section};
use crate::eds::model::{Entry, Object, ObjectKind, UnknownSection};
use crate::eds::module::Module;
use crate::eds::number::{Number, without_comment};
use crate::eds::value;
use crate::mux::Mux;
use crate::source::Place;
use crate::value::DataType;

/// A module, and what it adds where it is connected.
pub(super) struct Described {
    pub(super) number: u16,
    pub(super) name: String,
    /// Objects that are there with the first module of the kind.
    pub(super) fixed: Vec<Object>,
    /// The keys of `fixed` that have no place in the description.
    pub(super) kept: Vec<UnknownSection>,
    /// Objects that get sub-indices with each module of the kind.
    pub(super) extends: Vec<Extend>,
}

/// Sub-indices that a module adds to an object.
pub(super) struct Extend {
    /// The first of them, if it were sub-index 1.
    pub(super) model: Entry,
    pub(super) flags: Option<u32>,
    pub(super) count: Count,
    /// The sub-index after which the next object continues; `None` where no other does.
    pub(super) last: Option<u8>,
    /// Where the section says how many.
    pub(super) at: Place,
}

/// How much a module adds to an object.
#[derive(Clone, Copy)]
pub(super) enum Count {
    /// So many sub-indices.
    Subs(u8),
    /// So many bits of a sub-index that several modules share; it has `of` bits.
    Bits { bits: u8, of: u8 },
}

impl Reader {
    /// Reads what describes modules, and which are connected; `sections` are sorted.
    pub(super) fn modules(
        &mut self,
        sections: &[Section<'_>],
    ) -> (Vec<Described>, Option<Vec<u16>>) {
        let start = sections.partition_point(|section| section.name <= Name::ConnectedModules);
        let (lists, parts) = sections.split_at(start);
        let find = |name| lists.iter().find(|section| section.name == name);
        let groups: Vec<_> = parts.chunk_by(|one, next| number(one) == number(next)).collect();
        self.check_supported(find(Name::SupportedModules), &groups);
        let described: Vec<_> = groups.into_iter().map(|parts| self.module(parts)).collect();
        self.check_fixed(&described);
        let connected = find(Name::ConnectedModules);
        let connected = connected.map(|section| self.connected(section, &described));
        (described, connected)
    }

    /// Compares the number of modules with those that are described.
    fn check_supported(&mut self, section: Option<&Section<'_>>, groups: &[&[Section<'_>]]) {
        let Some(section) = section else {
            if let Some([first, ..]) = groups.first() {
                let message = "the sheet describes modules, but has no [SupportedModules]";
                self.findings.add(&codes::MODULE_SECTION, first.at, message);
            }
            return;
        };
        // Some name the modules here as well.
        self.others(section, |name| is_one_of(name, &[COUNT_OF_LIST]) || is_number(name));
        if self.eds.object(MODULE_LIST).is_none() && !groups.is_empty() {
            let message = "object 1027h (module list) is missing in the sheet of a modular device";
            self.findings.add(&codes::MODULE_LIST, section.at, message);
        }
        let Some(key) = section.filled(COUNT_OF_LIST) else {
            let message = format!("section [{}] lacks {COUNT_OF_LIST}", section.title);
            return self.findings.add(&codes::LIST_COUNT, section.at, message);
        };
        let count = value::unsigned(key, u16::MAX.into(), &mut self.findings);
        let Some(count) = count.map(|count| count as u16) else { return };
        let there_are: BTreeSet<u16> = groups.iter().map(|parts| number(&parts[0])).collect();
        if let Some(missing) = (1..=count).find(|number| !there_are.contains(number)) {
            let message = format!("module {missing} of {count} is not described");
            self.findings.add(&codes::MODULE_SECTION, key.at, message);
        }
        for first in groups.iter().map(|parts| &parts[0]) {
            let number = number(first);
            if !(1..=count).contains(&number) {
                let message = format!("module {number} is not one of 1 to {count}");
                self.findings.add(&codes::MODULE_SECTION, first.at, message);
            }
        }
    }

    /// Reads the sections of one module.
    fn module(&mut self, parts: &[Section<'_>]) -> Described {
        let number = number(&parts[0]);
        let find = |part| parts.iter().find(|section| section.name == Name::Module(number, part));
        let name = match find(ModulePart::Info) {
            Some(section) => self.module_info(section),
            None => {
                let message = format!("module {number} has no section [M{number}ModuleInfo]");
                self.findings.add(&codes::MODULE_SECTION, parts[0].at, message);
                String::new()
            }
        };
        if let Some(section) = find(ModulePart::Comments) {
            self.comment_lines(section);
        }
        let (fixed, kept) = self.fixed(parts);
        let heads = fixed.iter().map(|object| (object.index, Place::of_line(object.line)));
        let heads = heads.collect();
        self.check_listed(number, ModulePart::FixedObjects, find(ModulePart::FixedObjects), &heads);
        let more = extended(parts).map(|(index, section)| (index, section.at)).collect();
        self.check_listed(number, ModulePart::SubExtends, find(ModulePart::SubExtends), &more);
        for (index, at) in more.iter().filter(|(index, _)| heads.contains_key(index)) {
            let message =
                format!("object {index:04X}h of module {number} is fixed and extended at once");
            self.findings.add(&codes::MODULE_OBJECT, *at, message);
        }
        let extends = extended(parts).filter_map(|(index, section)| self.extend(section, index));
        let extends = extends.collect();
        Described { number, name, fixed, kept, extends }
    }

    /// Reads `[MxModuleInfo]`; gives the name of the module.
    fn module_info(&mut self, section: &Section<'_>) -> String {
        self.others(section, |name| is_one_of(name, &MODULE_INFO));
        for name in ["ProductVersion", "ProductRevision"] {
            self.number(section, name, u8::MAX.into());
        }
        let missing: Vec<_> =
            MODULE_INFO.into_iter().filter(|name| section.key(name).is_none()).collect();
        if !missing.is_empty() {
            let message = format!("section [{}] lacks {}", section.title, missing.join(", "));
            self.findings.add(&codes::MODULE_INFO, section.at, message);
        }
        section.key("ProductName").map_or_else(String::new, |key| key.value.to_owned())
    }

    /// Reads the fixed objects of a module as objects of another device.
    fn fixed(&mut self, parts: &[Section<'_>]) -> (Vec<Object>, Vec<UnknownSection>) {
        let objects = parts.iter().filter_map(|section| match section.name {
            Name::Module(_, ModulePart::Fixed(index, part)) => {
                let Section { title, at, .. } = *section;
                let name = Name::Object(index, part);
                Some(Section { name, title, at, keys: section.keys.clone() })
            }
            _ => None,
        });
        let objects: Vec<_> = objects.collect();
        let device = mem::take(&mut self.eds);
        self.objects(&objects);
        let module = mem::replace(&mut self.eds, device);
        (module.objects, module.unknown)
    }

    /// Compares a list of a module with the objects that it describes.
    fn check_listed(
        &mut self,
        number: u16,
        list: ModulePart,
        section: Option<&Section<'_>>,
        described: &BTreeMap<u16, Place>,
    ) {
        let list = Name::Module(number, list).canonical().unwrap_or_default();
        let mut listed: BTreeMap<u16, Place> = BTreeMap::new();
        let keys = section.map(|section| self.list_keys(section, COUNT_OF_LIST).0);
        for key in keys.unwrap_or_default() {
            let index = value::unsigned(&key, u16::MAX.into(), &mut self.findings);
            let Some(index) = index.map(|index| index as u16) else { continue };
            if let Some(first) = listed.get(&index) {
                let message =
                    format!("object {index:04X}h is already listed in line {}", first.line);
                self.findings.add(&codes::LISTED_TWICE, key.at, message);
                continue;
            }
            listed.insert(index, key.at);
            if !described.contains_key(&index) {
                let message = format!("object {index:04X}h is in [{list}], but has no section");
                self.findings.add(&codes::NO_SECTION, key.at, message);
            }
        }
        for (index, at) in described.iter().filter(|(index, _)| !listed.contains_key(index)) {
            let message = format!("object {index:04X}h is not in [{list}]");
            self.findings.add(&codes::NOT_LISTED, *at, message);
        }
    }

    /// Reads `[MxSubExtXXXX]`; nothing when it does not say what is added.
    fn extend(&mut self, section: &Section<'_>, index: u16) -> Option<Extend> {
        let known = [&HEAD_KEYS[..], &VALUE_KEYS, &EXTEND_KEYS].concat();
        self.others(section, |name| is_one_of(name, &known));
        let name = self.name(section);
        let mux = Mux::new(index, 1);
        let model = self.entry(section, mux, ObjectKind::ARRAY, &mut Kept::new());
        let flags = self.number(section, "ObjFlags", u32::MAX.into()).map(|flags| flags as u32);
        let last = self.number(section, "ObjExtend", 0xFE).filter(|last| *last != 0);
        let count = self.count(section, model.data_type);
        if model.data_type == DataType(0) {
            let message = format!("section [{}] has no DataType", section.title);
            self.findings.add(&codes::DATA_TYPE_MISSING, section.at, message);
            return None;
        }
        Some(Extend {
            model: Entry { name, ..model },
            flags,
            count: count?,
            last: last.map(|last| last as u8),
            at: self.key_place(section, "Count"),
        })
    }

    /// Reads `Count`: a number of sub-indices, or `0;` and a number of bits.
    fn count(&mut self, section: &Section<'_>, data_type: DataType) -> Option<Count> {
        let Some(key) = section.filled("Count") else {
            let message = format!("section [{}] has no Count", section.title);
            self.findings.add(&codes::SUB_EXTEND, section.at, message);
            return None;
        };
        let (subs, bits) = match key.value.split_once(';') {
            Some((subs, bits)) if Number::parse(without_comment(bits.trim_ascii())).is_some() => {
                (subs.trim_ascii_end(), Some(bits.trim_ascii()))
            }
            _ => (key.value, None),
        };
        let mut number = |value| {
            let key = Key { value, ..*key };
            Some(value::unsigned(&key, 0xFE, &mut self.findings)? as u8)
        };
        let (subs, bits) = (number(subs)?, bits.map(&mut number));
        let of = match data_type {
            DataType::BOOLEAN => 1,
            _ => (8 * data_type.size().unwrap_or_default()) as u8,
        };
        match bits {
            None => Some(Count::Subs(subs)),
            Some(bits) => match bits? {
                bits if subs == 0 && (1..=of).contains(&bits) => Some(Count::Bits { bits, of }),
                _ => {
                    let message = format!(
                        "Count is {:?}: after `0;` stands how many bits of {data_type} a module \
                         has, 1 to {of}",
                        key.value
                    );
                    self.findings.add(&codes::SUB_EXTEND, key.at, message);
                    None
                }
            },
        }
    }

    /// Checks that a fixed object is the same in all modules, and none of the device itself.
    fn check_fixed(&mut self, described: &[Described]) {
        let mut known: BTreeMap<u16, (u16, &Object)> = BTreeMap::new();
        for (number, object) in described.iter().flat_map(Described::numbered) {
            let (index, at) = (object.index, Place::of_line(object.line));
            if let Some(own) = self.eds.object(index) {
                let message = format!(
                    "object {index:04X}h of module {number} is an object of the device, in line {}",
                    own.line
                );
                self.findings.add(&codes::MODULE_OBJECT, at, message);
            }
            let Some((first, same)) = known.get(&index) else {
                known.insert(index, (number, object));
                continue;
            };
            if !is_same(same, object) {
                let message = format!(
                    "object {index:04X}h of module {number} is not that of module {first}, in \
                     line {}",
                    same.line
                );
                self.findings.add(&codes::MODULE_OBJECT, at, message);
            }
        }
    }

    /// Reads `[ConnectedModules]`: the number of the module at each place.
    fn connected(&mut self, section: &Section<'_>, described: &[Described]) -> Vec<u16> {
        let known: BTreeSet<u16> = described.iter().map(|module| module.number).collect();
        let mut connected = Vec::new();
        for key in self.list_keys(section, COUNT_OF_LIST).0 {
            let Some(number) = value::unsigned(&key, u16::MAX.into(), &mut self.findings) else {
                continue;
            };
            let number = number as u16;
            if !known.contains(&number) {
                let message = format!("there is no module {number}");
                self.findings.add(&codes::CONNECTED_MODULE, key.at, message);
                continue;
            }
            if connected.len() == MOST_MODULES {
                let message = format!("object 1027h has room for {MOST_MODULES} modules");
                self.findings.add(&codes::CONNECTED_MODULE, key.at, message);
                break;
            }
            connected.push(number);
        }
        connected
    }
}

impl Described {
    pub(super) fn as_module(&self) -> Module {
        Module { number: self.number, name: self.name.clone() }
    }

    /// The objects that it can have.
    pub(super) fn indices(&self) -> impl Iterator<Item = u16> {
        let extended = self.extends.iter().map(|extend| extend.model.mux.index);
        self.fixed.iter().map(|object| object.index).chain(extended)
    }

    /// The fixed objects with the number of the module.
    fn numbered(&self) -> impl Iterator<Item = (u16, &Object)> {
        self.fixed.iter().map(|object| (self.number, object))
    }
}

/// The number of the module that a section is about.
fn number(section: &Section<'_>) -> u16 {
    match section.name {
        Name::Module(number, _) => number,
        _ => 0,
    }
}

/// The sections of a module about objects that it extends.
fn extended<'s, 'a>(parts: &'s [Section<'a>]) -> impl Iterator<Item = (u16, &'s Section<'a>)> {
    parts.iter().filter_map(|section| match section.name {
        Name::Module(_, ModulePart::SubExt(index)) => Some((index, section)),
        _ => None,
    })
}

fn is_same(one: &Object, other: &Object) -> bool {
    let plain = |object: &Object| {
        let mut object = Object { line: 0, ..object.clone() };
        object.entries.iter_mut().for_each(|entry| entry.line = 0);
        object
    };
    plain(one) == plain(other)
}

fn is_number(name: &str) -> bool {
    name.bytes().all(|byte| byte.is_ascii_digit())
}

/// The module list of CiA 301.
pub(super) const MODULE_LIST: u16 = 0x1027;

/// How many modules 1027h can list.
pub(super) const MOST_MODULES: usize = 254;

/// The key that counts the entries of the lists here.
const COUNT_OF_LIST: &str = "NrOfEntries";

const MODULE_INFO: [&str; 4] = ["ProductName", "ProductVersion", "ProductRevision", "OrderCode"];

/// Keys that say how an object is extended.
const EXTEND_KEYS: [&str; 2] = ["Count", "ObjExtend"];
