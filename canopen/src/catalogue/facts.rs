//! Facts about an object and its values, from a profile or from the description of a device.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::Deserialize;

use super::scalar::Scalar;
use crate::eds::{Access, ObjectKind};
use crate::value::DataType;

/// What is known of an object. For arrays and records, `type` to `category` hold for every sub
/// from 1 upwards that does not say otherwise.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ObjectFacts {
    /// Name of the object.
    pub name: Option<String>,
    /// Object code.
    pub object: Option<Shape>,
    /// Data type.
    #[serde(rename = "type")]
    pub data_type: Option<DataType>,
    /// Access over the network.
    pub access: Option<Access>,
    /// Default value.
    pub value: Option<Scalar>,
    /// Smallest value.
    pub low: Option<Scalar>,
    /// Largest value.
    pub high: Option<Scalar>,
    /// PDOs it may be mapped into.
    pub pdo: Option<Mapping>,
    /// Unit of the physical value.
    pub unit: Option<String>,
    /// Physical value of a raw 1, in `unit`.
    pub scale: Option<f64>,
    /// What it means.
    pub doc: Option<String>,
    /// Where the document speaks of it.
    pub clause: Option<String>,
    /// Whether the profile demands it.
    pub category: Option<Category>,
    /// `ObjFlags` of the data sheet.
    pub flags: Option<u32>,
    /// How many subs follow sub 0; without it, those under `subs` exist.
    pub count: Option<u8>,
    /// What a sub without a name of its own is called, before its number.
    pub item: Option<String>,
    /// What differs in sub 0.
    pub sub0: Option<Facts>,
    /// What differs in the subs from 1 upwards.
    pub subs: BTreeMap<u8, Facts>,
}

/// What is known of one value. A part that is `None` is left to the next description.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Facts {
    /// Name.
    pub name: Option<String>,
    /// Data type.
    #[serde(rename = "type")]
    pub data_type: Option<DataType>,
    /// Access over the network.
    pub access: Option<Access>,
    /// Default value.
    pub value: Option<Scalar>,
    /// Smallest value.
    pub low: Option<Scalar>,
    /// Largest value.
    pub high: Option<Scalar>,
    /// PDOs it may be mapped into.
    pub pdo: Option<Mapping>,
    /// Unit of the physical value.
    pub unit: Option<String>,
    /// Physical value of a raw 1, in `unit`.
    pub scale: Option<f64>,
    /// What it means.
    pub doc: Option<String>,
    /// Where the document speaks of it.
    pub clause: Option<String>,
    /// Whether the profile demands it.
    pub category: Option<Category>,
}

/// Object code, by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Shape {
    /// A single value.
    Var,
    /// Values of one type.
    Array,
    /// Values of different types.
    Record,
    /// A large amount of data without structure.
    Domain,
}

/// The PDOs a value may be mapped into, seen from the device.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Mapping {
    /// None.
    No,
    /// Those the device receives.
    Rpdo,
    /// Those it transmits.
    Tpdo,
    /// Both.
    Both,
}

/// Whether a profile demands an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Category {
    /// Every device has it.
    Mandatory,
    /// A device with a certain feature has it.
    Conditional,
    /// A device may have it.
    Optional,
}

impl ObjectFacts {
    /// The facts of the object itself about the value at sub-index `sub`. For a variable these are
    /// all facts; for arrays and records, those in `subs`, then those that hold for all subs. Names
    /// and texts of the object stay with the object.
    pub fn of_sub(&self, sub: u8) -> Facts {
        match sub {
            0 => self.sub0.clone().unwrap_or_default(),
            _ => self.subs.get(&sub).cloned().unwrap_or_default().or(&self.of_all()),
        }
    }

    /// The facts of the object about the value of a variable.
    pub fn of_var(&self) -> Facts {
        Facts { name: self.name.clone(), doc: self.doc.clone(), ..self.of_all() }
    }

    /// These facts, with those of `other` where nothing is known yet, sub by sub.
    #[must_use]
    pub fn or(self, other: &Self) -> Self {
        let other = other.clone();
        let mut subs = self.subs;
        for (sub, facts) in other.subs {
            let own = subs.remove(&sub).unwrap_or_default();
            subs.insert(sub, own.or(&facts));
        }
        let sub0 = match (self.sub0, other.sub0) {
            (Some(own), Some(other)) => Some(own.or(&other)),
            (own, other) => own.or(other),
        };
        Self {
            name: self.name.or(other.name),
            object: self.object.or(other.object),
            data_type: self.data_type.or(other.data_type),
            access: self.access.or(other.access),
            value: self.value.or(other.value),
            low: self.low.or(other.low),
            high: self.high.or(other.high),
            pdo: self.pdo.or(other.pdo),
            unit: self.unit.or(other.unit),
            scale: self.scale.or(other.scale),
            doc: self.doc.or(other.doc),
            clause: self.clause.or(other.clause),
            category: self.category.or(other.category),
            flags: self.flags.or(other.flags),
            count: self.count.or(other.count),
            item: self.item.or(other.item),
            sub0,
            subs,
        }
    }

    /// Whether it describes the access to its values, beyond the name of the object: a profile that
    /// is not public only names its objects.
    pub fn is_described(&self) -> bool {
        self.access.is_some() || self.subs.values().any(|facts| facts.access.is_some())
    }

    fn of_all(&self) -> Facts {
        Facts {
            name: None,
            data_type: self.data_type,
            access: self.access,
            value: self.value.clone(),
            low: self.low.clone(),
            high: self.high.clone(),
            pdo: self.pdo,
            unit: self.unit.clone(),
            scale: self.scale,
            doc: None,
            clause: self.clause.clone(),
            category: self.category,
        }
    }
}

impl Facts {
    /// These facts, with those of `other` where nothing is known yet.
    #[must_use]
    pub fn or(self, other: &Self) -> Self {
        let other = other.clone();
        Self {
            name: self.name.or(other.name),
            data_type: self.data_type.or(other.data_type),
            access: self.access.or(other.access),
            value: self.value.or(other.value),
            low: self.low.or(other.low),
            high: self.high.or(other.high),
            pdo: self.pdo.or(other.pdo),
            unit: self.unit.or(other.unit),
            scale: self.scale.or(other.scale),
            doc: self.doc.or(other.doc),
            clause: self.clause.or(other.clause),
            category: self.category.or(other.category),
        }
    }
}

impl Shape {
    /// The object code.
    pub const fn kind(self) -> ObjectKind {
        match self {
            Self::Var => ObjectKind::VAR,
            Self::Array => ObjectKind::ARRAY,
            Self::Record => ObjectKind::RECORD,
            Self::Domain => ObjectKind::DOMAIN,
        }
    }
}

impl Mapping {
    /// The access type that says which way a value of that access may be mapped; `None` when none
    /// does (CiA 306, AccessType).
    pub const fn access(self, access: Access) -> Option<Access> {
        match (access, self) {
            (_, Self::No) | (Access::Rw, Self::Both) => Some(access),
            (Access::Rw | Access::Rww, Self::Rpdo) => Some(Access::Rww),
            (Access::Wo, Self::Rpdo) => Some(access),
            (Access::Rw | Access::Rwr, Self::Tpdo) => Some(Access::Rwr),
            (Access::Ro | Access::Const, Self::Tpdo) => Some(access),
            _ => None,
        }
    }

    /// The name in a description.
    pub const fn name(self) -> &'static str {
        match self {
            Self::No => "no",
            Self::Rpdo => "rpdo",
            Self::Tpdo => "tpdo",
            Self::Both => "both",
        }
    }
}
