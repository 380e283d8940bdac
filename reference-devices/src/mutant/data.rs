//! Mutants as data.

use std::sync::Arc;

use canopen::source::{Complaint, Outline, Source};
use schemars::JsonSchema;
use serde::Deserialize;

use super::patch::Patch;
use super::sheet::SheetPatch;

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
    /// Whether nobody can see the deviation: it must survive, or the proof itself is broken.
    #[serde(default)]
    pub canary: bool,
    /// Whether any device could have it: it is a deviation of the stack they share.
    #[serde(skip)]
    pub shared: bool,
    /// The deviation.
    pub(super) change: Change,
    /// The file it stands in, and which of its mutants it is, counted from 0.
    #[serde(skip)]
    pub(super) origin: Option<(Arc<Source>, usize)>,
}

/// What is wrong with the change of a mutant: the keys that lead there, and why.
#[derive(Debug, PartialEq)]
pub(super) struct Misfit {
    /// Below `change`, such as `frame` and `when`; an item of a list by its number.
    pub path: Vec<String>,
    /// The byte within the text that stands there.
    pub offset: usize,
    /// What is wrong.
    pub message: String,
}

impl Misfit {
    /// Something wrong at these keys.
    pub(super) fn at(path: &[&str], message: impl Into<String>) -> Self {
        let path = path.iter().map(|&key| key.to_owned()).collect();
        Self { path, offset: 0, message: message.into() }
    }

    /// The same, below these keys.
    pub(super) fn below(mut self, keys: &[&str]) -> Self {
        self.path.splice(0..0, keys.iter().map(|&key| key.to_owned()));
        self
    }
}

impl Mutant {
    /// What is wrong with the change, with its place.
    pub(super) fn complaint(&self, misfit: &Misfit) -> Complaint {
        let mut path = vec!["change"];
        path.extend(misfit.path.iter().map(String::as_str));
        self.complain(&path, misfit.offset, misfit.message.clone())
    }

    /// A complaint about what stands at these keys of the mutant, so many bytes after its start.
    pub fn complain(&self, path: &[&str], offset: usize, message: impl Into<String>) -> Complaint {
        let message = message.into();
        let Some((source, number)) = &self.origin else {
            let source = Arc::new(Source { name: self.name.clone(), ..Source::default() });
            return Complaint { source, place: None, message };
        };
        let number = number.to_string();
        let path = [&["mutants", &number], path].concat();
        let outline = Outline::of(source);
        let place = outline.map(|outline| source.inside(outline.nearest(&path), offset));
        Complaint { source: Arc::clone(source), place, message }
    }
}

/// Where the deviation sits.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
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
#[derive(Clone, Debug, Deserialize, JsonSchema)]
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
