//! Mutants as data.

use canopen::source::Complaint;
use schemars::JsonSchema;
use serde::Deserialize;

use crate::change::{Change, Deviation, On, OnEach, OneOrMore, Origin, Written, WrittenChange};
use crate::freedom::{Freedom, mixture};

/// A file of mutants, `mutants.yaml`.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct MutantFile {
    /// The mutants.
    #[schemars(with = "Vec<Written<WrittenMutant>>")]
    pub(super) mutants: Vec<Mutant>,
}

/// A mutant as it is written. Without a change, it takes the decision that has its name.
#[derive(JsonSchema)]
#[schemars(
    rename_all = "kebab-case",
    rename = "Mutant",
    extend("additionalProperties" = { "description": "The name, and why.", "type": "string" })
)]
#[expect(dead_code, reason = "the schema is made of it")]
struct WrittenMutant {
    /// Unique name.
    name: Option<String>,
    /// What is wrong with such a device, one sentence.
    why: Option<String>,
    /// The requirements it breaks.
    breaks: Option<OneOrMore>,
    /// The variants of the device it lives on, where it is proved; the device itself, unless given.
    /// Of several, each has a mutant of its own; a map has the requirements it breaks there.
    on: Option<OnEach>,
    /// Freedoms of the stack that the device uses besides, where only such a device can have the
    /// deviation.
    uses: Option<OneOrMore>,
    /// The mistake in the source of a firmware that leads to such a device; absent for a device
    /// that was built otherwise on purpose.
    #[schemars(rename = "as")]
    mistake: Option<Mistake>,
    /// Whether the deviation cannot be seen: it must survive, or the proof itself is broken.
    canary: Option<bool>,
    /// The deviation.
    change: Option<Change>,
    #[schemars(flatten)]
    by_kind: WrittenChange,
}

/// A deviation.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Mutant {
    /// Unique name.
    pub name: String,
    /// What is wrong with such a device, one sentence.
    pub why: String,
    /// The requirements it breaks.
    #[serde(default)]
    pub breaks: Vec<String>,
    /// The variants of the device it lives on, where it is proved; the device itself, unless given.
    #[serde(default)]
    pub on: On,
    /// Freedoms of the stack that the device uses besides, by their names.
    #[serde(default)]
    pub uses: Vec<String>,
    /// The mistake in the source of a firmware that leads to such a device; absent for a device
    /// that was built otherwise on purpose.
    #[serde(default, rename = "as")]
    pub mistake: Option<Mistake>,
    /// Whether the deviation cannot be seen: it must survive, or the proof itself is broken.
    #[serde(default)]
    pub canary: bool,
    /// Whether any device could have it: it is a deviation of the stack they share.
    #[serde(skip)]
    pub shared: bool,
    /// The deviation.
    pub(super) change: Change,
    /// The freedoms that it uses.
    #[serde(skip)]
    pub(super) freedoms: Vec<Freedom>,
    /// Where it stands.
    #[serde(skip)]
    pub(super) origin: Origin,
}

/// A mistake as it is made in the source of a firmware.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema, PartialEq, Eq, PartialOrd, Ord)]
#[serde(rename_all = "kebab-case")]
pub enum Mistake {
    /// A count, an index or a bound is one too many or too few.
    OffByOne,
    /// A flag, a counter or a value is left from before.
    Stale,
    /// The bytes of a value are in the wrong order.
    ByteOrder,
    /// A value is kept in too few bits, digits or entries.
    Truncation,
    /// The sign of a value is lost or wrong.
    Sign,
    /// A value is in another unit, or is rounded in another way.
    Unit,
    /// A timer or a trigger is not armed again.
    ReArm,
    /// The right thing is done with the wrong object, channel or bit.
    Instance,
    /// A state or a mode is not asked for, or the wrong one is.
    StateCheck,
    /// The right things are done in the wrong order, or one of them too early or too late.
    Order,
    /// A bound is inclusive instead of exclusive, or the other way round.
    Inclusive,
    /// One case of several is forgotten.
    Missing,
}

impl Mistake {
    /// The word in files of mutants.
    pub const fn word(self) -> &'static str {
        match self {
            Self::OffByOne => "off-by-one",
            Self::Stale => "stale",
            Self::ByteOrder => "byte-order",
            Self::Truncation => "truncation",
            Self::Sign => "sign",
            Self::Unit => "unit",
            Self::ReArm => "re-arm",
            Self::Instance => "instance",
            Self::StateCheck => "state-check",
            Self::Order => "order",
            Self::Inclusive => "inclusive",
            Self::Missing => "missing",
        }
    }
}

impl Mutant {
    /// The deviation, to build the device with.
    pub fn deviation(&self) -> Deviation {
        let mut deviation = Deviation::new(format!("mutant={}", self.name));
        deviation.append(mixture(&self.freedoms));
        deviation.add(self.change.clone(), self.origin.below(&["change"]));
        deviation
    }

    /// The device without the mistake: with the freedoms that the mutant uses. `None` where it uses
    /// none.
    pub fn without_mistake(&self) -> Option<Deviation> {
        (!self.freedoms.is_empty()).then(|| mixture(&self.freedoms))
    }

    /// Whether only the data sheet is wrong, and not the device.
    pub const fn is_of_data_sheet(&self) -> bool {
        matches!(self.change, Change::Eds(_))
    }

    /// The change that makes the device, as a file of mutants has it in full: `frame: { .. }`.
    pub fn made(&self) -> String {
        self.origin.below(&["change"]).text()
    }

    /// The file and the line where it stands.
    pub fn stands_in(&self) -> String {
        self.origin.file_and_line()
    }

    /// A complaint about what stands at these keys of the mutant.
    pub fn complain(&self, path: &[&str], message: impl Into<String>) -> Complaint {
        self.origin.below(path).complaint(0, message)
    }
}
