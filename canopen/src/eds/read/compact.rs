//! Short forms: `CompactSubObj` for many equal subs, `CompactPDO` for PDOs left out.

use super::object::Parts;
use super::{Kept, Reader, is_one_of};
use crate::eds::codes;
use crate::eds::ini::{Key, Name, Part, Section};
use crate::eds::model::{Access, Entry, Object, ObjectKind, Term};
use crate::mux::Mux;
use crate::source::Place;
use crate::value::{DataType, Value};

impl Reader {
    /// How many subs the head stands for.
    pub(super) fn compact_count(&mut self, head: &Section<'_>) -> u8 {
        let mut count = self.number(head, "CompactSubObj", 0xFF).unwrap_or_default() as u8;
        if count == 0xFF {
            let message = "CompactSubObj is 255, but the highest sub-index is 254";
            self.findings.add(&codes::COMPACT, self.key_place(head, "CompactSubObj"), message);
            count = 0xFE;
        }
        if !self.may_expand(count) {
            let message = format!("the short forms describe more than {MANY_SUBS} sub-indices");
            self.findings.add(&codes::COMPACT, head.at, message);
            return 0;
        }
        count
    }

    /// Counts subs that no section of their own describes; false when they are too many.
    pub(super) fn may_expand(&mut self, count: u8) -> bool {
        let expanded = self.expanded + usize::from(count);
        let may = expanded <= MANY_SUBS;
        if may {
            self.expanded = expanded;
        }
        may
    }

    /// Makes the subs a head stands for.
    pub(super) fn compact(
        &mut self,
        head: &Section<'_>,
        count: u8,
        parts: &Parts<'_, '_>,
        object: &mut Object,
        kept: &mut Kept,
    ) {
        let model = self.entry(head, Mux::new(parts.index, 1), object.kind, kept);
        object.entries.push(number_of_subs(Mux::new(parts.index, 0), count, model.line));
        object.entries.extend((1..=count).map(|sub| Entry {
            mux: Mux::new(parts.index, sub),
            name: format!("{}{sub}", model.name),
            ..model.clone()
        }));
        if let Some(section) = parts.names {
            for (sub, key) in self.numbered(section, count) {
                object.entries[usize::from(sub)].name = key.value.to_owned();
            }
        }
        if let Some(section) = parts.values {
            for (sub, key) in self.numbered(section, count) {
                let described =
                    |s: &Section<'_>| s.name == Name::Object(parts.index, Part::Sub(sub));
                if parts.subs.iter().any(described) {
                    continue;
                }
                let key = Key { name: "DefaultValue", ..key };
                let mut kept = Kept::new();
                let default = self.term(&key, model.data_type, &mut kept);
                object.entries[usize::from(sub)].default = default;
                self.keep_keys(Name::Object(parts.index, Part::Sub(sub)), kept);
            }
        }
    }

    /// The names or values that a section gives for subs 1 to `count`.
    fn numbered<'a>(&mut self, section: &Section<'a>, count: u8) -> Vec<(u8, Key<'a>)> {
        let mut found = Vec::new();
        for key in &section.keys {
            if is_one_of(key.name, &["NrOfEntries"]) {
                continue;
            }
            match key.name.parse() {
                Ok(sub) if (1..=count).contains(&sub) && !key.value.is_empty() => {
                    found.push((sub, *key));
                }
                Ok(sub) if (1..=count).contains(&sub) => {}
                _ => {
                    let message =
                        format!("section [{}] has no sub-index {:?}", section.title, key.name);
                    self.findings.add(&codes::COMPACT, key.name_at, message);
                }
            }
        }
        let named = self.number(section, "NrOfEntries", u8::MAX.into());
        let there_are = section.keys.len() - usize::from(section.key("NrOfEntries").is_some());
        if named != Some(there_are as u64) {
            let message = match named {
                Some(named) => format!("NrOfEntries is {named} instead of {there_are}"),
                None => format!("section [{}] lacks NrOfEntries", section.title),
            };
            self.findings.add(&codes::COMPACT, self.key_place(section, "NrOfEntries"), message);
        }
        found.sort_by_key(|&(sub, _)| sub);
        found.dedup_by_key(|(sub, _)| *sub);
        found
    }

    /// Makes the PDOs that exist by number alone.
    pub(super) fn compact_pdos(&mut self) {
        let Some((mask, at)) = self.compact_pdo else { return };
        let device = &self.eds.device;
        let directions = [
            (RPDO, 0x1400, device.rpdo_count, [0x200, 0x300, 0x400, 0x500]),
            (TPDO, 0x1800, device.tpdo_count, [0x180, 0x280, 0x380, 0x480]),
        ];
        let granularity = device.granularity.max(1);
        let mut pdos = 0;
        let mut objects = Vec::new();
        for (name, first, count, cob_ids) in directions {
            let (described, free): (Vec<u16>, Vec<u16>) =
                (first..first + PDOS).partition(|&index| self.eds.object(index).is_some());
            let missing = usize::from(count).saturating_sub(described.len());
            for index in free.into_iter().take(missing) {
                let cob_id = cob_ids.get(usize::from(index - first)).copied();
                objects.push(communication(name, index, mask, cob_id, at));
                if self.eds.object(index + 0x200).is_none() {
                    objects.push(mapping(name, index + 0x200, granularity, at));
                }
                pdos += 1;
            }
        }
        self.eds.objects.append(&mut objects);
        self.eds.objects.sort_by_key(|object| object.index);
        let message = format!("CompactPDO stands for {pdos} PDOs that are not described");
        self.findings.add(&codes::COMPACT_PDO, at, message);
    }
}

fn communication(pdo: &str, index: u16, mask: u8, cob_id: Option<u32>, at: Place) -> Object {
    let line = at.line;
    let highest = 8 - mask.leading_zeros() as u8;
    let mut entries = vec![number_of_subs(Mux::new(index, 0), highest, line)];
    for (sub, (name, data_type)) in (1..).zip(COMMUNICATION) {
        if mask & 1 << (sub - 1) == 0 {
            continue;
        }
        let default = match (sub, cob_id) {
            (1, Some(offset)) => Some(Term { value: Value::Int(offset.into()), plus_node: true }),
            (1, None) => Some(Term::fixed(Value::Int(1 << 31))),
            _ => None,
        };
        entries.push(made(Mux::new(index, sub), name.to_owned(), data_type, default, line));
    }
    let name = format!("{pdo} communication parameter");
    Object { index, name, kind: ObjectKind::RECORD, flags: None, entries, line }
}

/// A mapping parameter with as many entries as units of `granularity` bits fit a PDO.
fn mapping(pdo: &str, index: u16, granularity: u8, at: Place) -> Object {
    let line = at.line;
    let mut count = number_of_subs(Mux::new(index, 0), 0, line);
    count.access = Access::Rw;
    let subs = (1..=64 / granularity).map(|sub| {
        let name = format!("Mapped object {sub}");
        made(Mux::new(index, sub), name, DataType::UNSIGNED32, None, line)
    });
    let entries = std::iter::once(count).chain(subs).collect();
    let name = format!("{pdo} mapping parameter");
    Object { index, name, kind: ObjectKind::RECORD, flags: None, entries, line }
}

/// Sub 0 of an object whose sections do not describe it.
pub(super) fn number_of_subs(mux: Mux, count: u8, line: usize) -> Entry {
    let default = Some(Term::fixed(Value::Int(count.into())));
    let name = "NrOfObjects".to_owned();
    Entry { access: Access::Ro, ..made(mux, name, DataType::UNSIGNED8, default, line) }
}

pub(super) fn made(
    mux: Mux,
    name: String,
    data_type: DataType,
    default: Option<Term>,
    line: usize,
) -> Entry {
    let (low, high) = (None, None);
    Entry { mux, name, data_type, access: Access::Rw, mappable: false, default, low, high, line }
}

/// More than any device has; a file of a few lines could stand for millions.
const MANY_SUBS: usize = 100_000;

/// How many PDOs a device can have in each direction.
const PDOS: u16 = 512;

const RPDO: &str = "RPDO";

const TPDO: &str = "TPDO";

/// Subs 1 to 6 of a communication parameter; a bit of `CompactPDO` stands for each.
const COMMUNICATION: [(&str, DataType); 6] = [
    ("COB-ID", DataType::UNSIGNED32),
    ("Transmission type", DataType::UNSIGNED8),
    ("Inhibit time", DataType::UNSIGNED16),
    ("Compatibility entry", DataType::UNSIGNED8),
    ("Event timer", DataType::UNSIGNED16),
    ("SYNC start value", DataType::UNSIGNED8),
];
