//! The sections of one object: its head, its subs, or the short form for many equal subs.

use super::{Kept, Reader, is_one_of};
use crate::eds::codes;
use crate::eds::ini::{Name, Part, Section};
use crate::eds::model::{Access, Entry, Object, ObjectKind, Term};
use crate::eds::value;
use crate::mux::Mux;
use crate::source::Place;
use crate::value::DataType;

/// The sections of an object.
pub(super) struct Parts<'s, 'a> {
    pub(super) index: u16,
    pub(super) head: Option<&'s Section<'a>>,
    pub(super) subs: &'s [Section<'a>],
    pub(super) names: Option<&'s Section<'a>>,
    pub(super) values: Option<&'s Section<'a>>,
}

/// The kind of object that a head describes.
enum Head {
    /// The object as a whole.
    Object,
    /// Also its value, which is sub 0.
    Value,
    /// The number of further subs, all alike.
    Subs(u8),
}

impl Reader {
    /// Reads objects; `sections` are sorted.
    pub(super) fn objects(&mut self, sections: &[Section<'_>]) {
        let index = |section: &Section<'_>| match section.name {
            Name::Object(index, _) => index,
            _ => 0,
        };
        for all in sections.chunk_by(|one, next| index(one) == index(next)) {
            let index = index(&all[0]);
            let find = |part| all.iter().find(|section| section.name == Name::Object(index, part));
            let start =
                all.partition_point(|section| section.name <= Name::Object(index, Part::Head));
            let end =
                all.partition_point(|section| section.name < Name::Object(index, Part::Names));
            self.object(&Parts {
                index,
                head: find(Part::Head),
                subs: &all[start..end],
                names: find(Part::Names),
                values: find(Part::Values),
            });
        }
    }

    fn object(&mut self, parts: &Parts<'_, '_>) {
        let names_and_values = [parts.names, parts.values].into_iter().flatten();
        let Some(first) = parts.head.or_else(|| parts.subs.first()) else {
            return names_and_values.for_each(|section| self.other(section));
        };
        let index = parts.index;
        let (kind, role) = self.kind(parts);
        let (name, line) = (String::new(), first.at.line);
        let mut object = Object { index, name, kind, flags: None, entries: Vec::new(), line };
        match parts.head {
            Some(head) => self.head(head, &role, parts, &mut object),
            None => {
                let message =
                    format!("object {index:04X}h has sub-indices, but no section of its own");
                self.findings.add(&codes::PARENT_MISSING, first.at, message);
            }
        }
        if !matches!(role, Head::Subs(_)) {
            names_and_values.for_each(|section| self.other(section));
        }
        for section in parts.subs {
            self.sub(section, &mut object);
        }
        if let (Some(head), Head::Object | Head::Value) = (parts.head, role) {
            self.check_sub_number(head, parts.subs, &object);
        }
        // Most objects have one entry, and a list that grows has room for four.
        object.entries.shrink_to_fit();
        self.eds.objects.push(object);
    }

    /// The object code, or what the subs suggest when it cannot be right.
    fn kind(&mut self, parts: &Parts<'_, '_>) -> (ObjectKind, Head) {
        let Some(head) = parts.head else { return (ObjectKind::RECORD, Head::Object) };
        let compact = self.compact_count(head);
        let shape = match (compact, parts.subs) {
            (1.., _) => ObjectKind::ARRAY,
            (0, []) => ObjectKind::VAR,
            (0, _) => ObjectKind::RECORD,
        };
        let at = self.key_place(head, "ObjectType");
        let stated = self.stated_kind(head, parts.index);
        let kind = match stated {
            None => shape,
            Some(kind) if !kind.has_subs() && shape != ObjectKind::VAR => {
                let message =
                    format!("object {:04X}h is {kind:?}, but has sub-indices", parts.index);
                self.findings.add(&codes::SUB_OF_VAR, at, message);
                shape
            }
            Some(kind @ (ObjectKind::ARRAY | ObjectKind::RECORD)) if shape == ObjectKind::VAR => {
                let message =
                    format!("object {:04X}h is {kind:?}, but has no sub-indices", parts.index);
                self.findings.add(&codes::NO_SUBS, at, message);
                if head.filled("DataType").is_some() { shape } else { kind }
            }
            Some(kind) => kind,
        };
        let sub0 = Name::Object(parts.index, Part::Sub(0));
        let has_value = !stated.is_some_and(ObjectKind::has_subs)
            && head.filled("DataType").is_some()
            && parts.subs.first().is_some_and(|first| first.name != sub0);
        let role = match compact {
            1.. => Head::Subs(compact),
            0 if !kind.has_subs() || has_value => Head::Value,
            0 => Head::Object,
        };
        (kind, role)
    }

    /// The kind in `ObjectType`.
    fn stated_kind(&mut self, head: &Section<'_>, index: u16) -> Option<ObjectKind> {
        let Some(key) = head.filled("ObjectType") else {
            self.findings.habit(&codes::OBJECT_TYPE_MISSING, head.at, "ObjectType is missing");
            return None;
        };
        let code = value::unsigned(key, u8::MAX.into(), &mut self.findings)?;
        if !matches!(code, 0 | 2 | 5..=9) {
            let message = format!("object {index:04X}h: object type {code} does not exist");
            self.findings.add(&codes::OBJECT_TYPE, key.at, message);
        }
        Some(ObjectKind(code as u8))
    }

    fn head(
        &mut self,
        head: &Section<'_>,
        role: &Head,
        parts: &Parts<'_, '_>,
        object: &mut Object,
    ) {
        object.name = self.name(head);
        object.flags = self.number(head, "ObjFlags", u32::MAX.into()).map(|flags| flags as u32);
        let has_value = !matches!(role, Head::Object);
        let mut kept = self.others(head, |name| {
            is_one_of(name, &HEAD_KEYS) || has_value && is_one_of(name, &VALUE_KEYS)
        });
        match role {
            Head::Object => {}
            Head::Value => {
                let mux = Mux::new(parts.index, 0);
                let entry = self.entry(head, mux, object.kind, &mut kept);
                object.entries.push(entry);
                if object.kind.has_subs() {
                    return self.keep_keys(Name::Object(parts.index, Part::Sub(0)), kept);
                }
            }
            Head::Subs(count) => self.compact(head, *count, parts, object, &mut kept),
        }
        self.keep_keys(head.name, kept);
    }

    fn sub(&mut self, section: &Section<'_>, object: &mut Object) {
        let Name::Object(index, Part::Sub(sub)) = section.name else { return };
        let mut kept = self.others(section, |name| is_one_of(name, &VALUE_KEYS));
        match self.number(section, "ObjectType", u8::MAX.into()) {
            Some(2 | 7) => {}
            Some(code) => {
                let message =
                    format!("{index:04X}:{sub:02X} has object type {code}, but a sub-index is VAR");
                let at = self.key_place(section, "ObjectType");
                self.findings.add(&codes::OBJECT_TYPE, at, message);
            }
            None if section.filled("ObjectType").is_some() => {}
            None => {
                let message = "ObjectType is missing";
                self.findings.habit(&codes::OBJECT_TYPE_MISSING, section.at, message);
            }
        }
        if let Some(flags) = self.number(section, "ObjFlags", u32::MAX.into()) {
            object.flags = Some(object.flags.unwrap_or_default() | flags as u32);
        }
        let mut entry = self.entry(section, Mux::new(index, sub), object.kind, &mut kept);
        entry.name = self.name(section);
        // The short form may have made one.
        match object.entries.binary_search_by_key(&sub, |entry| entry.mux.sub) {
            Ok(place) => object.entries[place] = entry,
            Err(place) => object.entries.insert(place, entry),
        }
        self.keep_keys(section.name, kept);
    }

    fn check_sub_number(&mut self, head: &Section<'_>, subs: &[Section<'_>], object: &Object) {
        let index = object.index;
        let number = self.number(head, "SubNumber", u16::MAX.into());
        match (number, subs.len() as u64) {
            (Some(number), subs) if number != subs => {
                let at = self.key_place(head, "SubNumber");
                let message =
                    format!("object {index:04X}h: SubNumber is {number} instead of {subs}");
                self.findings.add(&codes::SUB_NUMBER, at, message);
            }
            (None, 1..) if head.filled("SubNumber").is_none() => {
                let message = format!("object {index:04X}h has sub-indices, but no SubNumber");
                self.findings.add(&codes::SUB_NUMBER, head.at, message);
            }
            _ => {}
        }
    }

    /// The value that a section describes, named like it.
    pub(super) fn entry(
        &mut self,
        section: &Section<'_>,
        mux: Mux,
        kind: ObjectKind,
        kept: &mut Kept,
    ) -> Entry {
        let data_type = self.data_type(section, mux, kind);
        let access = self.access(section, mux, kind);
        let flag = section.key("PDOMapping");
        let mappable = flag.is_some_and(|key| value::flag(key, &mut self.findings));
        if access == Access::None {
            let message = match mappable {
                true => "no SDO reaches the value (noAccess), PDOs alone do",
                false => "neither SDOs nor PDOs reach the value (noAccess)",
            };
            let at = self.key_place(section, "AccessType");
            self.findings.habit(&codes::NO_ACCESS, at, message);
        }
        Entry {
            mux,
            name: section.key("ParameterName").map_or_else(String::new, |key| key.value.to_owned()),
            data_type,
            access,
            mappable,
            default: self.default(section, data_type, kept),
            low: self.limit(section, "LowLimit", data_type, kept),
            high: self.limit(section, "HighLimit", data_type, kept),
            line: section.at.line,
        }
    }

    fn default(
        &mut self,
        section: &Section<'_>,
        data_type: DataType,
        kept: &mut Kept,
    ) -> Option<Term> {
        let key = section.key("DefaultValue")?;
        if key.value.is_empty() {
            let message = "DefaultValue is empty; it counts as absent";
            self.findings.habit(&codes::EMPTY_DEFAULT, key.name_at, message);
            return None;
        }
        self.term(key, data_type, kept)
    }

    fn limit(
        &mut self,
        section: &Section<'_>,
        name: &str,
        data_type: DataType,
        kept: &mut Kept,
    ) -> Option<Term> {
        let key = section.filled(name)?;
        let real = matches!(data_type, DataType::REAL32 | DataType::REAL64);
        if !real && data_type != DataType::BOOLEAN && !data_type.is_integer() {
            let message = format!("{name} has no meaning for {data_type}");
            self.findings.habit(&codes::LIMIT_TYPE, key.name_at, message);
            kept.push((key.name.to_owned(), key.value.to_owned()));
            return None;
        }
        self.term(key, data_type, kept)
    }

    fn data_type(&mut self, section: &Section<'_>, mux: Mux, kind: ObjectKind) -> DataType {
        let Some(key) = section.filled("DataType") else {
            return match kind {
                ObjectKind::DOMAIN => DataType::DOMAIN,
                ObjectKind::DEFTYPE => DataType::UNSIGNED32,
                _ if kind.has_subs() && mux.sub == 0 => {
                    let message = format!("{mux} has no DataType; unsigned8 is assumed");
                    self.findings.add(&codes::DATA_TYPE_MISSING, section.at, message);
                    DataType::UNSIGNED8
                }
                // The lint reports that.
                _ => DataType(0),
            };
        };
        if key.value.bytes().all(|byte| byte.is_ascii_digit()) {
            let message = "DataType is usually written in hex, such as 0x0007";
            self.findings.habit(&codes::DATA_TYPE_DECIMAL, key.at, message);
        }
        let code = value::unsigned(key, u16::MAX.into(), &mut self.findings);
        DataType(code.unwrap_or_default() as u16)
    }

    fn access(&mut self, section: &Section<'_>, mux: Mux, kind: ObjectKind) -> Access {
        let Some(key) = section.filled("AccessType") else {
            return match kind {
                ObjectKind::DOMAIN => Access::Rw,
                ObjectKind::DEFTYPE => Access::Ro,
                _ => {
                    let message = format!("{mux} has no AccessType; ro is assumed");
                    self.findings.add(&codes::ACCESS_MISSING, section.at, message);
                    Access::Ro
                }
            };
        };
        let text = value::typed(key, &mut self.findings);
        if text == Access::None.name() {
            return Access::None;
        }
        if let Some(access) = Access::named(text) {
            return access;
        }
        let known = match text.to_ascii_lowercase().as_str() {
            "r" => Some(Access::Ro),
            "w" => Some(Access::Wo),
            small => Access::named(small),
        };
        if let Some(access) = known {
            let message = format!("AccessType {text:?} is usually written {:?}", access.name());
            self.findings.habit(&codes::ACCESS_SPELLING, key.at, message);
            return access;
        }
        let message = format!("{mux}: {text:?} is not an access type; ro is assumed");
        self.findings.add(&codes::ACCESS, key.at, message);
        Access::Ro
    }

    pub(super) fn name(&mut self, section: &Section<'_>) -> String {
        let Some(key) = section.filled("ParameterName") else {
            let message = format!("section [{}] has no ParameterName", section.title);
            self.findings.add(&codes::NAME_MISSING, section.at, message);
            return String::new();
        };
        key.value.to_owned()
    }

    /// Where a key's value is, or the section that lacks the key.
    pub(super) fn key_place(&self, section: &Section<'_>, name: &str) -> Place {
        section.key(name).map_or(section.at, |key| key.at)
    }

    pub(super) fn number(&mut self, section: &Section<'_>, name: &str, high: u64) -> Option<u64> {
        let key = section.filled(name)?;
        value::unsigned(key, high, &mut self.findings)
    }
}

/// Keys that describe an object.
pub(super) const HEAD_KEYS: [&str; 5] =
    ["ParameterName", "ObjectType", "SubNumber", "ObjFlags", "CompactSubObj"];

/// Keys that describe a value.
pub(super) const VALUE_KEYS: [&str; 8] = [
    "ParameterName",
    "ObjectType",
    "DataType",
    "LowLimit",
    "HighLimit",
    "AccessType",
    "DefaultValue",
    "PDOMapping",
];
