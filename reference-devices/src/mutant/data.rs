//! Mutants as data.

use serde::Deserialize;

use super::patch::Patch;
use super::sheet::SheetPatch;

/// A file of mutants.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub(super) struct MutantFile {
    /// The mutants.
    pub mutants: Vec<Mutant>,
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
    /// The variant of the device it lives on, where it is proved; the device itself, unless given.
    #[serde(default)]
    pub on: Option<String>,
    /// Whether nobody can see the deviation: it must survive, or the proof itself is broken.
    #[serde(default)]
    pub canary: bool,
    /// Whether any device could have it: it is a deviation of the stack they share.
    #[serde(skip)]
    pub shared: bool,
    /// The deviation.
    pub(super) change: Change,
}

/// Where the deviation sits.
#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Change {
    /// Between the device and the wire.
    Frame(FrameChange),
    /// In the dictionary, after the data sheet was made.
    Dictionary(Patch),
    /// In a decision of the stack.
    Rule(String),
    /// In a decision of the device's application.
    Behaviour(String),
    /// In the data sheet, while the device is in order.
    Eds(Vec<SheetPatch>),
}

/// What happens to frames that fit a pattern. Exactly one of `edit`, `drop`, `repeat`, `delay`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub(super) struct FrameChange {
    /// Which frames the device sends.
    pub when: String,
    /// Frames it receives instead.
    #[serde(default)]
    pub received: bool,
    /// What they become.
    #[serde(default)]
    pub edit: Option<String>,
    /// They are lost.
    #[serde(default)]
    pub drop: bool,
    /// They come so many times more.
    #[serde(default)]
    pub repeat: Option<u32>,
    /// They come so much later, such as `20 ms`; only frames that are sent.
    #[serde(default)]
    pub delay: Option<String>,
    /// The first so many are left alone.
    #[serde(default)]
    pub skip: u32,
    /// At most so many are changed.
    #[serde(default)]
    pub most: Option<u32>,
}
