//! Mutants as data.

use canopen::source::Complaint;
use schemars::JsonSchema;
use serde::Deserialize;

use crate::change::{Change, Deviation, Origin};

/// A file of mutants, `mutants.yaml`.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct MutantFile {
    /// The mutants.
    pub(super) mutants: Vec<Mutant>,
}

/// A deviation.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Mutant {
    /// Unique name.
    pub name: String,
    /// What is wrong with such a device, one sentence.
    pub why: String,
    /// The requirements it breaks.
    #[serde(default)]
    pub breaks: Vec<String>,
    /// The variant of the device it lives on, where it is proved; the device itself, unless given.
    #[serde(default)]
    pub on: Option<String>,
    /// Whether the deviation cannot be seen: it must survive, or the proof itself is broken.
    #[serde(default)]
    pub canary: bool,
    /// Whether any device could have it: it is a deviation of the stack they share.
    #[serde(skip)]
    pub shared: bool,
    /// The deviation.
    pub(super) change: Change,
    /// Where it stands.
    #[serde(skip)]
    pub(super) origin: Origin,
}

impl Mutant {
    /// The deviation, to build the device with.
    pub fn deviation(&self) -> Deviation {
        let mut deviation = Deviation::new(format!("mutant={}", self.name));
        deviation.add(self.change.clone(), self.origin.below(&["change"]));
        deviation
    }

    /// Whether the device is in order and its data sheet is not.
    pub const fn is_of_data_sheet(&self) -> bool {
        matches!(self.change, Change::Eds(_))
    }

    /// A complaint about what stands at these keys of the mutant.
    pub fn complain(&self, path: &[&str], message: impl Into<String>) -> Complaint {
        self.origin.below(path).complaint(0, message)
    }
}
