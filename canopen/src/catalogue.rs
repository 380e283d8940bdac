//! What the profiles say of their objects, as data: `catalogue/*.yaml`.
//!
//! A description of a device states only what the device chose and takes name, type and access
//! rights from here. Both sides are written in the same terms, [`ObjectFacts`] and [`Facts`], in
//! which everything may be left open.

mod scalar;

use std::collections::BTreeMap;
use std::fmt;
use std::ops::RangeInclusive;
use std::sync::LazyLock;

use serde::Deserialize;

use crate::eds::{Access, ObjectKind};
use crate::mux::Mux;
use crate::value::DataType;

pub use scalar::Scalar;

/// The objects of one profile, and what its suites need to know beyond them.
#[derive(Debug)]
pub struct Profile {
    /// Name, such as `cia301`.
    pub name: String,
    /// As it is written; empty where the name says enough.
    title: String,
    /// The profile it builds on, whose names and blocks are its own, too.
    pub based_on: Option<String>,
    /// How a device that follows it is told from others, where 1000h does not tell.
    pub recognised: Option<Recognition>,
    /// Bits and codes by the names under which suites of this profile use them.
    pub names: BTreeMap<String, i64>,
    /// Groups of objects that repeat.
    pub blocks: BTreeMap<String, Block>,
    /// What a device of this profile may lack although no object is missing, with its meaning.
    pub options: BTreeMap<String, String>,
    objects: Vec<(RangeInclusive<u16>, CatalogueObject)>,
}

/// A value that tells a device of a profile from others.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Recognition {
    /// Where it stands.
    #[serde(deserialize_with = "scalar::mux")]
    pub object: Mux,
    /// The bits that count.
    pub mask: u32,
    /// What they are.
    pub value: u32,
    /// Where the version of the profile stands, when it stands there.
    #[serde(default)]
    pub version: Option<Version>,
}

/// The bits of a version.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Version {
    /// Those in front of the point.
    pub major: u32,
    /// Those behind it.
    pub minor: u32,
}

impl Recognition {
    /// Whether the object holds what only such a device has there.
    pub const fn fits(self, value: u32) -> bool {
        value & self.mask == self.value
    }

    /// The version of the profile, such as `1.1`; `None` when the value does not tell.
    pub fn version_in(self, value: u32) -> Option<String> {
        let bits = |mask: u32| (value & mask) >> mask.trailing_zeros().min(31);
        self.version.map(|version| format!("{}.{}", bits(version.major), bits(version.minor)))
    }
}

/// Objects that belong together and stand in the dictionary several times, at equal distances.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Block {
    /// How often.
    pub count: u8,
    /// From the indices of one to those of the next.
    pub step: u16,
    /// The objects of the first one, by name.
    #[serde(deserialize_with = "scalar::muxes")]
    pub objects: BTreeMap<String, Mux>,
}

impl Block {
    /// The address of the object of that name in block `number`, counted from 1; `None` when there
    /// is no such name or number.
    pub fn object(&self, name: &str, number: u8) -> Option<Mux> {
        let first = self.objects.get(name)?;
        let place = number.checked_sub(1).filter(|_| number <= self.count)?;
        Some(Mux::new(first.index + self.step * u16::from(place), first.sub))
    }
}

/// An object as a profile describes it.
pub type CatalogueObject = ObjectFacts;

/// What is known of an object. For arrays and records, `type` to `category` hold for every sub
/// from 1 upwards that does not say otherwise.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ObjectFacts {
    /// Name of the object.
    pub name: Option<String>,
    /// Object code.
    pub object: Option<Shape>,
    /// Data type.
    #[serde(rename = "type", deserialize_with = "scalar::data_type")]
    pub data_type: Option<DataType>,
    /// Access over the network.
    #[serde(deserialize_with = "scalar::access")]
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

/// What is known of one value. A part that is `None` is left to whoever describes it next.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Facts {
    /// Name.
    pub name: Option<String>,
    /// Data type.
    #[serde(rename = "type", deserialize_with = "scalar::data_type")]
    pub data_type: Option<DataType>,
    /// Access over the network.
    #[serde(deserialize_with = "scalar::access")]
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
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
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
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
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
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Category {
    /// Every device has it.
    Mandatory,
    /// A device with a certain feature has it.
    Conditional,
    /// A device may have it.
    Optional,
}

/// A catalogue file does not load.
#[derive(Debug)]
pub struct CatalogueError(String);

/// The profile of that name, such as `cia301`; `None` when the catalogue has none.
pub fn profile(name: &str) -> Option<&'static Profile> {
    profiles().iter().find(|profile| profile.name == name)
}

/// Every profile of the catalogue.
///
/// # Panics
/// When a file of the catalogue does not load: they are part of the program.
pub fn profiles() -> &'static [Profile] {
    &PROFILES
}

/// What the first of `names` that knows the index says of it. Profiles other than CiA 301 share
/// the indices from 6000h on, so the order matters.
pub fn lookup(names: &[impl AsRef<str>], index: u16) -> Option<&'static CatalogueObject> {
    names.iter().filter_map(|name| profile(name.as_ref())).find_map(|known| known.lookup(index))
}

impl Profile {
    /// Reads a file of the catalogue.
    ///
    /// # Errors
    /// With line and column, when the text is not of the form; and when two keys overlap or are
    /// no indices.
    pub fn read(text: &str) -> Result<Self, CatalogueError> {
        let file: File =
            serde_yaml::from_str(text).map_err(|error| CatalogueError(error.to_string()))?;
        let mut objects = Vec::with_capacity(file.objects.len());
        for (key, object) in file.objects {
            let keyed = keyed(&key, object).ok_or_else(|| {
                let forms = "an index such as 1000, nor 1400..15FF, nor 6500..65F0/10";
                CatalogueError(format!("{key:?} is neither {forms}"))
            })?;
            objects.extend(keyed);
        }
        objects.sort_by_key(|(indices, _)| *indices.start());
        for pair in objects.windows(2) {
            if pair[0].0.end() >= pair[1].0.start() {
                let twice = pair[1].0.start();
                return Err(CatalogueError(format!("{twice:04X} is described twice")));
            }
        }
        Ok(Self {
            name: file.profile,
            title: file.title,
            based_on: file.based_on,
            recognised: file.recognised,
            names: file.names,
            blocks: file.blocks,
            options: file.options,
            objects,
        })
    }

    /// What a person calls it.
    pub fn title(&self) -> &str {
        if self.title.is_empty() { &self.name } else { &self.title }
    }

    /// What a name of this profile, or of the one it builds on, stands for.
    pub fn code(&self, name: &str) -> Option<i64> {
        self.chain().find_map(|profile| profile.names.get(name).copied())
    }

    /// The block of that name, of this profile or the one it builds on.
    pub fn block(&self, name: &str) -> Option<&Block> {
        self.chain().find_map(|profile| profile.blocks.get(name))
    }

    /// This profile and those it builds on.
    pub fn chain(&self) -> impl Iterator<Item = &Self> {
        std::iter::successors(Some(self), |this| profile(this.based_on.as_deref()?))
    }

    /// What the profile says of the object at `index`.
    pub fn lookup(&self, index: u16) -> Option<&CatalogueObject> {
        let place = self.objects.partition_point(|(indices, _)| *indices.end() < index);
        let (indices, object) = self.objects.get(place)?;
        indices.contains(&index).then_some(object)
    }

    /// The objects with the indices that share each description, by ascending index.
    pub fn objects(&self) -> impl Iterator<Item = (&RangeInclusive<u16>, &CatalogueObject)> {
        self.objects.iter().map(|(indices, object)| (indices, object))
    }
}

impl ObjectFacts {
    /// What the object says of the value at sub-index `sub` on its own account: for a variable
    /// everything, for arrays and records what `subs` has, then what holds for all subs. Names and
    /// texts of the object stay with the object.
    pub fn of_sub(&self, sub: u8) -> Facts {
        match sub {
            0 => self.sub0.clone().unwrap_or_default(),
            _ => self.subs.get(&sub).cloned().unwrap_or_default().or(&self.of_all()),
        }
    }

    /// What the object says of the value of a variable.
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

impl fmt::Display for CatalogueError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for CatalogueError {}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
struct File {
    profile: String,
    #[serde(default)]
    title: String,
    #[serde(default)]
    based_on: Option<String>,
    #[serde(default)]
    recognised: Option<Recognition>,
    #[serde(default)]
    names: BTreeMap<String, i64>,
    #[serde(default)]
    blocks: BTreeMap<String, Block>,
    #[serde(default)]
    options: BTreeMap<String, String>,
    objects: BTreeMap<String, ObjectFacts>,
}

/// The objects that a key of a description means: `1000`, `1400..15FF`, or every tenth (hex) as in
/// `6500..65F0/10`, where `#` in the name is the number of the object. `None` when it is no key.
pub fn keyed(key: &str, object: ObjectFacts) -> Option<Vec<(RangeInclusive<u16>, ObjectFacts)>> {
    let index = |text: &str| match text.len() {
        4 => u16::from_str_radix(text, 16).ok(),
        _ => None,
    };
    let Some((first, last)) = key.split_once("..") else {
        return index(key).map(|only| vec![(only..=only, object)]);
    };
    let (last, step) = match last.split_once('/') {
        Some((last, step)) => (last, u16::from_str_radix(step, 16).ok().filter(|step| *step > 0)?),
        None => (last, 0),
    };
    let (first, last) = (index(first)?, index(last)?);
    match step {
        _ if first > last => None,
        0 => Some(vec![(first..=last, object)]),
        _ => Some(
            (first..=last)
                .step_by(step.into())
                .zip(1..)
                .map(|(index, number): (u16, u16)| (index..=index, numbered(&object, number)))
                .collect(),
        ),
    }
}

fn numbered(object: &ObjectFacts, number: u16) -> ObjectFacts {
    let name = object.name.as_ref().map(|name| name.replace('#', &number.to_string()));
    ObjectFacts { name, ..object.clone() }
}

const FILES: [(&str, &str); 4] = [
    ("cia301.yaml", include_str!("../catalogue/cia301.yaml")),
    ("cia401.yaml", include_str!("../catalogue/cia401.yaml")),
    ("cia404.yaml", include_str!("../catalogue/cia404.yaml")),
    ("em66.yaml", include_str!("../catalogue/em66.yaml")),
];

static PROFILES: LazyLock<Vec<Profile>> = LazyLock::new(|| {
    let read = |(file, text)| Profile::read(text).unwrap_or_else(|e| panic!("{file}: {e}"));
    FILES.map(read).into()
});

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_and_single_indices_are_found() {
        let cia301 = profile("cia301").unwrap();
        let name = |index| cia301.lookup(index).and_then(|object| object.name.as_deref());
        assert_eq!(name(0x1000), Some("Device type"));
        assert_eq!(name(0x13FF), None);
        assert_eq!(name(0x1400), Some("RPDO communication parameter"));
        assert_eq!(name(0x15FF), Some("RPDO communication parameter"));
        assert_eq!(name(0x1600), Some("RPDO mapping parameter"));
        assert_eq!(name(0xFFFF), None);
    }

    #[test]
    fn repeated_objects_have_numbers_and_blocks_their_addresses() {
        let cia404 = profile("cia404").unwrap();
        let name = |index| cia404.lookup(index).and_then(|object| object.name.as_deref());
        assert_eq!(name(0x6508), Some("AL 1 type"));
        assert_eq!(name(0x75F2), Some("AL 16 level"));
        let em66 = profile("em66").unwrap();
        let alarm = em66.block("alarm").unwrap();
        assert_eq!(alarm.object("action", 16), Some(Mux::new(0x65F9, 1)));
        assert_eq!([17, 0].map(|number| alarm.object("action", number)), [None, None]);
        assert_eq!(alarm.object("nothing", 1), None);
        for profile in profiles() {
            for block in profile.blocks.values() {
                for number in 1..=block.count {
                    for name in block.objects.keys() {
                        let mux = block.object(name, number).unwrap();
                        assert!(profile.lookup(mux.index).is_some(), "{name} {number}: {mux}");
                    }
                }
            }
        }
        assert_eq!((em66.code("control-on"), em66.code("nothing")), (Some(1), None));
        assert!(em66.recognised.unwrap().fits(0x0110_0142));
        assert!(!em66.recognised.unwrap().fits(0x0110_0242));
        for (value, version) in [(0x0110_0142, "1.1"), (0x0100_0142, "1.0"), (0x0340_0142, "3.4")] {
            assert_eq!(em66.recognised.unwrap().version_in(value).as_deref(), Some(version));
        }
    }

    #[test]
    fn a_sub_takes_what_its_array_says() {
        let limit = lookup(&["cia301", "cia401"], 0x6424).unwrap();
        let facts = limit.of_sub(3);
        assert_eq!(facts.data_type, Some(DataType::INTEGER32));
        assert_eq!(facts.access, Some(Access::Rw));
        assert_eq!(limit.of_sub(0).name.as_deref(), Some("Number of analogue inputs"));
        assert_eq!(limit.of_sub(0).data_type, None);
    }

    #[test]
    fn every_object_of_every_profile_is_complete() {
        for (profile, (indices, object)) in
            profiles().iter().flat_map(|p| p.objects().map(move |object| (p, object)))
        {
            let at = format!("{} {:04X}", profile.name, indices.start());
            let shape = object.object.unwrap_or_else(|| panic!("{at}: no object code"));
            assert!(object.name.is_some(), "{at}: no name");
            let values: Vec<Facts> = match shape {
                Shape::Var | Shape::Domain => vec![object.of_var()],
                _ if object.subs.is_empty() => vec![object.of_sub(1)],
                _ => object.subs.keys().map(|sub| object.of_sub(*sub)).collect(),
            };
            for facts in values {
                let open_type = matches!(indices.start(), 0x6404 | 0x6414);
                assert!(facts.data_type.is_some() || open_type, "{at}: no type");
                assert!(facts.access.is_some(), "{at}: no access");
            }
        }
    }

    #[test]
    fn mistakes_are_told() {
        let wrong = |objects: &str| {
            Profile::read(&format!("profile: x\nobjects:\n{objects}")).unwrap_err().to_string()
        };
        assert!(wrong("  \"100\": {}").contains("neither an index"));
        assert!(wrong("  \"1000..1010\": {}\n  \"1008\": {}").contains("1008 is described twice"));
        assert!(wrong("  \"1000\": { type: unsigned7 }").contains("unsigned7"));
        assert!(wrong("  \"1000\": { acess: ro }").contains("acess"));
    }
}
