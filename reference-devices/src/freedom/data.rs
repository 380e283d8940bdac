//! Freedoms and personalities as data.

use canopen::source::Complaint;
use schemars::JsonSchema;
use serde::Deserialize;

use super::mixture;
use crate::change::{Change, Deviation, On, OneOrMore, Origin, Written, WrittenChange};
use crate::devices::WITH_EVERYTHING;

/// A file of freedoms, `freedoms.yaml`.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct FreedomFile {
    /// The freedoms.
    #[schemars(with = "Vec<Written<WrittenFreedom>>")]
    pub(super) freedoms: Vec<Freedom>,
}

/// A freedom as it is written. Without a change, it takes the decision that has its name.
#[derive(JsonSchema)]
#[schemars(
    rename_all = "kebab-case",
    rename = "Freedom",
    extend("additionalProperties" = { "description": "The name, and why.", "type": "string" })
)]
#[expect(dead_code, reason = "the schema is made of it")]
struct WrittenFreedom {
    /// Unique name.
    name: Option<String>,
    /// Why a vendor builds a device so, one sentence.
    why: Option<String>,
    /// The requirements and interpretations that leave room for it.
    allowed_by: OneOrMore,
    /// The devices and variants on which it is tried. Unless given, a freedom of a device is tried
    /// on that device, and one that any device can use on the generic device.
    on: Option<OneOrMore>,
    /// Freedoms that no device can use together with this one.
    excludes: Option<OneOrMore>,
    /// What is different.
    change: Option<Change>,
    /// What is different, where it is several changes.
    changes: Option<Vec<Written<Change>>>,
    #[schemars(flatten)]
    by_kind: WrittenChange,
}

/// A deviation that a document allows.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Freedom {
    /// Unique name.
    pub name: String,
    /// The requirements and interpretations that leave room for it.
    pub allowed_by: Vec<String>,
    /// Why a vendor builds a device so, one sentence.
    pub why: String,
    /// The devices and variants on which it is tried. Unless given, a freedom of a device is tried
    /// on that device, and one that any device can use on the generic device.
    #[serde(default)]
    pub on: On,
    /// Freedoms that no device can use together with this one.
    #[serde(default)]
    pub excludes: Vec<String>,
    /// What is different.
    pub(super) changes: Vec<Change>,
    /// Whether any device can use it.
    #[serde(skip)]
    pub shared: bool,
    /// Where it stands.
    #[serde(skip)]
    pub(super) origin: Origin,
}

/// The file of the personalities.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct PersonalityFile {
    /// The personalities.
    pub(super) personalities: Vec<Personality>,
}

/// A device that uses many freedoms at once, as real stacks combine them.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Personality {
    /// Unique name.
    pub name: String,
    /// What kind of device it is like, one sentence.
    pub why: String,
    /// The device it is built on; the generic device unless given.
    #[serde(default)]
    on: Option<String>,
    /// The names of its freedoms.
    pub freedoms: Vec<String>,
    /// These freedoms.
    #[serde(skip)]
    pub(super) members: Vec<Freedom>,
}

impl Freedom {
    /// The deviation, to build the device with.
    pub fn deviation(&self) -> Deviation {
        let mut deviation = Deviation::new(format!("freedom={}", self.name));
        for (number, change) in self.changes.iter().enumerate() {
            let origin = self.origin.below(&["changes", &number.to_string()]);
            deviation.add(change.clone(), origin);
        }
        deviation
    }

    /// Whether a device can use both freedoms.
    pub fn agrees_with(&self, other: &Self) -> bool {
        let excludes = |one: &Self, other: &Self| one.excludes.contains(&other.name);
        self.name != other.name && !excludes(self, other) && !excludes(other, self)
    }

    /// A complaint about what stands at these keys of the freedom.
    pub fn complain(&self, path: &[&str], message: impl Into<String>) -> Complaint {
        self.origin.below(path).complaint(0, message)
    }
}

impl Personality {
    /// The device it is built on.
    pub fn device(&self) -> &str {
        self.on.as_deref().unwrap_or(WITH_EVERYTHING)
    }

    /// The deviation, to build the device with.
    pub fn deviation(&self) -> Deviation {
        let mut deviation = mixture(&self.members);
        deviation.query = format!("personality={}", self.name);
        deviation
    }
}
