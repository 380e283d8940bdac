//! The profiles' descriptions of their objects, as data: `catalogue/*.yaml`.
//!
//! A description of a device states only what the device chose and takes name, type and access
//! rights from here. Both sides use the same types, [`ObjectFacts`] and [`Facts`], in which every
//! part is optional.
//!
//! What a profile says of an object belongs here. What a device chose belongs to its description,
//! and what a suite demands to the requirement register.

mod facts;
mod file;
mod key;
mod scalar;

use std::collections::BTreeMap;
use std::iter;
use std::ops::RangeInclusive;
use std::sync::{Arc, OnceLock};

use schemars::JsonSchema;
use serde::Deserialize;

use crate::mux::Mux;
use crate::source::{self, Complaint, Source};

pub use facts::{Category, Facts, Mapping, ObjectFacts, Shape};
pub use file::CatalogueFile;
pub use key::{keyed, no_index};
pub use scalar::Scalar;

/// The profiles that are known.
#[derive(Debug)]
pub struct Catalogue {
    profiles: Vec<Arc<Profile>>,
}

/// The objects of one profile, and what its suites need to know beyond them.
#[derive(Clone, Debug, Default)]
pub struct Profile {
    /// Name, such as `cia301`.
    pub name: String,
    /// As it is written; empty where the name says enough.
    title: String,
    /// The profile it builds on, whose names and blocks are its own, too.
    base: Option<Arc<Self>>,
    /// How a device that follows it is identified, if 1000h does not identify it.
    pub recognised: Option<Recognition>,
    /// Bits and codes by the names under which suites of this profile use them.
    pub names: BTreeMap<String, i64>,
    /// Groups of objects that repeat.
    pub blocks: BTreeMap<String, Block>,
    /// The features that a device of this profile may lack although no object is missing, with
    /// their meaning.
    pub options: BTreeMap<String, String>,
    /// How long the application of such a device may take to see what was written, in
    /// milliseconds. Suites of the profile begin a case after it.
    pub cycle_ms: u16,
    /// An object that is not 0 while the device is still busy with an operation. The suites of the
    /// profile wait for it before a case.
    pub busy: Option<Mux>,
    objects: Vec<Indexed>,
}

/// A description, and the indices of the objects that share it.
type Indexed = (RangeInclusive<u16>, CatalogueObject);

/// A value that identifies a device of a profile.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Recognition {
    /// Where it stands.
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
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Version {
    /// Those in front of the point.
    pub major: u32,
    /// Those after it.
    pub minor: u32,
}

impl Recognition {
    /// Whether the object holds what only such a device has there.
    pub const fn fits(self, value: u32) -> bool {
        value & self.mask == self.value
    }

    /// The version of the profile, such as `1.1`; `None` if the value does not contain it.
    pub fn version_in(self, value: u32) -> Option<String> {
        let bits = |mask: u32| (value & mask) >> mask.trailing_zeros().min(31);
        self.version.map(|version| format!("{}.{}", bits(version.major), bits(version.minor)))
    }
}

/// Objects that belong together and stand in the dictionary several times, at equal distances.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Block {
    /// How often.
    pub count: u8,
    /// From the indices of one to those of the next.
    pub step: u16,
    /// The objects of the first one, by name.
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

/// The profile of that name of the catalogue in this program, such as `cia301`.
pub fn profile(name: &str) -> Option<&'static Profile> {
    Catalogue::built_in().profile(name)
}

/// Every profile of the catalogue in this program.
pub fn profiles() -> &'static [Arc<Profile>] {
    Catalogue::built_in().profiles()
}

/// The object at `index`, from the first of `names` that knows it, in the catalogue of this
/// program.
pub fn lookup(names: &[impl AsRef<str>], index: u16) -> Option<&'static CatalogueObject> {
    Catalogue::built_in().lookup(names, index)
}

impl Catalogue {
    /// The catalogue in this program.
    ///
    /// # Panics
    /// When one of its files does not load: they are part of the program, and tests load them.
    pub fn built_in() -> &'static Arc<Self> {
        BUILT_IN.get_or_init(|| {
            Arc::new(Self::of_the_program().unwrap_or_else(|complaints| {
                let texts: Vec<String> = complaints.iter().map(ToString::to_string).collect();
                panic!("{}", texts.join("\n\n"))
            }))
        })
    }

    /// Reads the catalogue in this program again, for a caller that replaced some of its files.
    ///
    /// # Errors
    /// Everything that is wrong with them.
    pub fn of_the_program() -> Result<Self, Vec<Complaint>> {
        let source = |(name, text): (&str, &'static str)| {
            source::built_in(&format!("canopen/catalogue/{name}"), text)
        };
        Self::read(&FILES.map(source))
    }

    /// Reads the files of a catalogue.
    ///
    /// # Errors
    /// Everything that is wrong with them.
    pub fn read(sources: &[Arc<Source>]) -> Result<Self, Vec<Complaint>> {
        file::read(sources, &[]).map(|profiles| Self { profiles })
    }

    /// This catalogue with the changes and additions of the files: a known profile keeps everything
    /// that its file does not state.
    ///
    /// # Errors
    /// Everything that is wrong with the files.
    pub fn amended(&self, sources: &[Arc<Source>]) -> Result<Self, Vec<Complaint>> {
        file::read(sources, &self.profiles).map(|profiles| Self { profiles })
    }

    /// The profile of that name, such as `cia301`; `None` when the catalogue has none.
    pub fn profile(&self, name: &str) -> Option<&Profile> {
        self.profiles.iter().find(|profile| profile.name == name).map(|profile| &**profile)
    }

    /// Every profile.
    pub fn profiles(&self) -> &[Arc<Profile>] {
        &self.profiles
    }

    /// The object at `index`, from the first of `names` that knows it. Profiles other than CiA 301
    /// share the indices from 6000h on, so the order matters.
    pub fn lookup(&self, names: &[impl AsRef<str>], index: u16) -> Option<&CatalogueObject> {
        let known = names.iter().filter_map(|name| self.profile(name.as_ref()));
        known.into_iter().find_map(|profile| profile.lookup(index))
    }
}

impl Profile {
    /// The name for people.
    pub fn title(&self) -> &str {
        if self.title.is_empty() { &self.name } else { &self.title }
    }

    /// The value of a name that this profile, or the one it builds on, defines.
    pub fn code(&self, name: &str) -> Option<i64> {
        self.chain().find_map(|profile| profile.names.get(name).copied())
    }

    /// The block of that name, of this profile or the one it builds on.
    pub fn block(&self, name: &str) -> Option<&Block> {
        self.chain().find_map(|profile| profile.blocks.get(name))
    }

    /// This profile and those it builds on.
    pub fn chain(&self) -> impl Iterator<Item = &Self> {
        iter::successors(Some(self), |this| this.base.as_deref())
    }

    /// The object at `index`, as the profile defines it.
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

const FILES: [(&str, &str); 4] = [
    ("cia301.yaml", include_str!("../catalogue/cia301.yaml")),
    ("cia401.yaml", include_str!("../catalogue/cia401.yaml")),
    ("cia404.yaml", include_str!("../catalogue/cia404.yaml")),
    ("em66.yaml", include_str!("../catalogue/em66.yaml")),
];

static BUILT_IN: OnceLock<Arc<Catalogue>> = OnceLock::new();

#[cfg(test)]
mod tests {
    use super::*;
    use crate::eds::Access;
    use crate::value::DataType;

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

    /// A profile that is not public.
    const NAMES_ONLY: &str = "cia404";

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
                if profile.name == NAMES_ONLY {
                    assert!(facts.access.is_none(), "{at}: the choice of a document");
                    continue;
                }
                assert!(facts.data_type.is_some() || open_type, "{at}: no type");
                assert!(facts.access.is_some(), "{at}: no access");
            }
        }
    }
}
