//! Dimensions: where a statement that holds once may fail to hold, and whether a case looks there.

use std::collections::BTreeMap;
use std::sync::Arc;

use schemars::JsonSchema;
use serde::Deserialize;
use wildmatch::WildMatch;

use crate::nearest::did_you_mean;
use crate::source::{At, Complaint, Source};

/// A direction in which a statement is extended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Dimension {
    /// Once more, and as often as one likes.
    Again,
    /// After reset communication, reset node, "load" and power-on: what goes and what stays.
    Reset,
    /// At the ends of a range, one beyond them, and where a number overflows.
    Boundary,
    /// Beside another function that is in use.
    Together,
    /// Of another object, channel, PDO or node.
    Second,
    /// With a parameter that changes while the function runs: shorter, longer, off and on.
    Running,
    /// What must not change.
    Unchanged,
}

impl Dimension {
    /// All of them.
    pub const ALL: [Self; 7] = [
        Self::Again,
        Self::Reset,
        Self::Boundary,
        Self::Together,
        Self::Second,
        Self::Running,
        Self::Unchanged,
    ];

    /// The word.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Again => "again",
            Self::Reset => "reset",
            Self::Boundary => "boundary",
            Self::Together => "together",
            Self::Second => "second",
            Self::Running => "running",
            Self::Unchanged => "unchanged",
        }
    }
}

/// The state of a requirement in one dimension.
#[derive(Debug, PartialEq, Eq)]
pub enum Extent {
    /// It applies. The requirements that extend it, and the cases that try it on every instance.
    Applies(Vec<String>),
    /// It does not apply, and why.
    Lacks(String),
}

/// Dimensions that some requirements lack.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Lack {
    /// The requirements: globs over the ids of this document.
    of: Vec<At<String>>,
    /// The dimensions that do not apply to them.
    lacks: Vec<Dimension>,
    /// Why, one sentence.
    why: At<String>,
}

/// Why each dimension that a requirement lacks does not apply to it.
pub(super) type Lacks = BTreeMap<Dimension, At<String>>;

/// The dimensions that the requirements of a file lack, by id.
pub(super) fn lacking<'r>(
    source: &Arc<Source>,
    notes: &[At<Lack>],
    ids: &[&'r str],
    complaints: &mut Vec<Complaint>,
) -> BTreeMap<&'r str, Lacks> {
    let mut lacking: BTreeMap<&str, Lacks> = BTreeMap::new();
    let mut complain = |place, message| complaints.push(Complaint::at(source, place, message));
    for At { value: note, place } in notes {
        if note.of.is_empty() || note.lacks.is_empty() {
            complain(*place, "the note names no requirement or no dimension".to_owned());
        }
        if note.why.value.trim().is_empty() {
            complain(note.why.place, "why the dimensions do not apply is missing".to_owned());
        }
        for glob in &note.of {
            let pattern = WildMatch::new(&glob.value);
            let mut found = ids.iter().filter(|id| pattern.matches(id)).peekable();
            if found.peek().is_none() {
                let meant = did_you_mean(&glob.value, ids.iter().copied());
                let message = format!("no requirement of this document is `{}`{meant}", glob.value);
                complain(glob.place, message);
            }
            let pairs = found.flat_map(|id| note.lacks.iter().map(move |lack| (id, lack)));
            let mut twice = None;
            for (id, lack) in pairs {
                let of_it = lacking.entry(id).or_default();
                let first = of_it.insert(*lack, note.why.clone());
                twice = twice.or_else(|| first.map(|first| (*lack, id, first.place.line)));
            }
            if let Some((lack, id, line)) = twice {
                let lack = lack.name();
                let message = format!("`{lack}` is noted twice for {id}: line {line} says why");
                complain(glob.place, message);
            }
        }
    }
    lacking
}
