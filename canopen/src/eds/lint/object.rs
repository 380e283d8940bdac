//! Objects on their own: shape, types, limits.

use super::{DEFAULT, Lint};
use crate::eds::codes;
use crate::eds::ini::{Name, Part};
use crate::eds::model::{Access, Entry, Object, ObjectKind, Term};
use crate::value::{DataType, Value};

impl Lint<'_, '_, '_> {
    pub(super) fn object(&mut self, object: &Object) {
        if let Some(kind) = expected_kind(object.index)
            && kind != object.kind
        {
            let message =
                format!("object {:04X}h is {:?} instead of {kind:?}", object.index, object.kind);
            self.add(&codes::OBJECT_KIND, object, message);
        }
        if matches!(object.kind, ObjectKind::ARRAY | ObjectKind::RECORD)
            && !object.entries.is_empty()
        {
            self.sub0(object);
            self.subs(object);
        }
        for entry in &object.entries {
            self.data_type(entry);
            self.limits(entry);
            if entry.mappable && entry.access == Access::Rw {
                let at = self.entry_place(entry, "AccessType");
                let message = match self.origin.is_xml {
                    true => {
                        "access rw does not say for which PDOs the value is; PDOmapping TPDO or \
                         RPDO does, or readWriteInput or readWriteOutput of a parameter"
                    }
                    false => {
                        "AccessType rw does not say for which PDOs the value is; rwr or rww does"
                    }
                };
                self.findings.habit(&codes::MAPPING_DIRECTION, at, message);
            }
        }
    }

    fn sub0(&mut self, object: &Object) {
        let index = object.index;
        let Some(sub0) = object.entry(0) else {
            let message = format!("object {index:04X}h has no sub-index 0");
            return self.add(&codes::SUB0_MISSING, object, message);
        };
        if sub0.data_type != DataType::UNSIGNED8 {
            let message = format!("{} is {} instead of unsigned8", sub0.mux, sub0.data_type);
            self.add_at(&codes::SUB0_TYPE, sub0, "DataType", message);
        }
        // These count the entries in use, so their value changes.
        if sub0.access.writable() || index == 0x1003 || is_mapping(index) {
            return;
        }
        // FFh describes the object and is not one of its values.
        let subs = object.entries.iter().map(|entry| entry.mux.sub);
        let highest = subs.filter(|&sub| sub < 0xFF).max().unwrap_or_default();
        match sub0.default.as_ref().map(|term| &term.value) {
            Some(&Value::Int(number)) if number != i128::from(highest) => {
                let message =
                    format!("{} is {number}, but the highest sub-index is {highest}", sub0.mux);
                self.add_at(&codes::SUB0_COUNT, sub0, DEFAULT, message);
            }
            Some(_) => {}
            None => {
                let message = format!(
                    "{} has no default value; the highest sub-index is {highest}",
                    sub0.mux
                );
                self.add_at(&codes::SUB0_DEFAULT, sub0, DEFAULT, message);
            }
        }
    }

    fn subs(&mut self, object: &Object) {
        let elements = || object.entries.iter().filter(|entry| (1..0xFF).contains(&entry.mux.sub));
        if object.kind == ObjectKind::ARRAY
            && let Some(first) = elements().next()
            && let Some(other) = elements().find(|entry| entry.data_type != first.data_type)
            && other.data_type != DataType(0)
        {
            let (one, two) = (first.data_type, other.data_type);
            let message = format!("{} is {two} in an array of {one}", other.mux);
            self.add_at(&codes::ARRAY_TYPES, other, "DataType", message);
        }
        let has = |sub| object.entry(sub).is_some();
        if let Some(ten) = object.entry(0x10)
            && has(9)
            && !(0x0A..0x10).any(has)
        {
            let message =
                format!("{} follows sub-index 9; the section name is probably decimal", ten.mux);
            let at = self.place(Name::Object(object.index, Part::Sub(0x10)), None);
            let at = at.unwrap_or_else(|| self.entry_place(ten, DEFAULT));
            self.findings.add(&codes::SUB_DECIMAL, at, message);
        }
    }

    fn data_type(&mut self, entry: &Entry) {
        let data_type = entry.data_type;
        let defined = || {
            let object = self.eds.object(data_type.0);
            object.is_some_and(|o| matches!(o.kind, ObjectKind::DEFTYPE | ObjectKind::DEFSTRUCT))
        };
        if data_type.name().is_some() || defined() {
            return;
        }
        if data_type.0 == 0 {
            let message = match self.entry_text(entry, "DataType") {
                Some(text) => format!("{}: DataType {text} is no data type", entry.mux),
                None => format!("{} has no DataType", entry.mux),
            };
            return self.add_at(&codes::DATA_TYPE_MISSING, entry, "DataType", message);
        }
        let message =
            format!("{}: {data_type} is neither basic nor defined by an object", entry.mux);
        self.add_at(&codes::DATA_TYPE, entry, "DataType", message);
    }

    fn limits(&mut self, entry: &Entry) {
        let Entry { mux, default, low, high, .. } = entry;
        if exceeds(low, high) {
            let value = |term: &Option<Term>| term.as_ref().map(|term| term.value.to_string());
            let (low, high) = (value(low).unwrap_or_default(), value(high).unwrap_or_default());
            let data_type = entry.data_type;
            let message = format!("{mux}: LowLimit {low} is above HighLimit {high} of {data_type}");
            return self.add_at(&codes::LIMITS, entry, "LowLimit", message);
        }
        if exceeds(low, default) {
            let message = format!("{mux}: the default value is below LowLimit");
            self.add_at(&codes::DEFAULT_LIMIT, entry, DEFAULT, message);
        }
        if exceeds(default, high) {
            let message = format!("{mux}: the default value is above HighLimit");
            self.add_at(&codes::DEFAULT_LIMIT, entry, DEFAULT, message);
        }
    }
}

pub(super) const fn is_mapping(index: u16) -> bool {
    matches!(index, 0x1600..=0x17FF | 0x1A00..=0x1BFF)
}

/// Whether `one` is more than `other` for some node id; not when one of them is not known.
fn exceeds(one: &Option<Term>, other: &Option<Term>) -> bool {
    let (Some(one), Some(other)) = (one, other) else { return false };
    [1, 127].into_iter().any(|node| match (one.resolve(node), other.resolve(node)) {
        (Value::Int(one), Value::Int(other)) => one > other,
        (one, other) => one.as_real() > other.as_real(),
    })
}

/// The object code that CiA 301 gives.
const fn expected_kind(index: u16) -> Option<ObjectKind> {
    match index {
        0x1000..=0x1002 | 0x1005..=0x100A | 0x100C | 0x100D | 0x1012..=0x1015 => {
            Some(ObjectKind::VAR)
        }
        0x1017 | 0x1019 => Some(ObjectKind::VAR),
        0x1003 | 0x1010 | 0x1011 | 0x1016 | 0x1020 | 0x1028 | 0x1029 => Some(ObjectKind::ARRAY),
        0x1018 | 0x1200..=0x12FF | 0x1400..=0x1BFF => Some(ObjectKind::RECORD),
        _ => None,
    }
}
