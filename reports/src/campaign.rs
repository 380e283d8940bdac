//! What a fuzzing campaign showed beside its causes, which are cases: how much was tried, and what
//! was learnt of the device.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What a campaign showed.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub struct Campaign {
    /// Sessions that were played.
    pub sessions: u64,
    /// Actions in them.
    pub actions: u64,
    /// Pairs of a state of the device and a kind of action.
    pub goals: usize,
    /// Sessions that an error of the application has cut short.
    pub cut_short: u64,
    /// Sessions that were wrong once, and not when they were repeated.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub undecided: u64,
    /// Sessions that reached code of a program which none before had.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub further: u64,
    /// The findings by their causes.
    pub causes: Vec<Found>,
    /// The freedoms that the device was seen to use.
    pub learnt: Vec<Learnt>,
    /// What an exploration covered.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub explored: Option<Explored>,
    /// The objects that the application changes.
    pub changes: Vec<String>,
    /// In how many states each kind of action was tried, the rarest first.
    pub tried: Vec<(String, usize)>,
}

/// What an exploration covered.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub struct Explored {
    /// Pairs of a setting with a sort of value, and another function or a state.
    pub pairs: usize,
    /// Objects that were judged, and that can be read.
    pub objects: (usize, usize),
    /// Names of the bench that were judged, and that show something.
    pub bench: (usize, usize),
    /// What was not judged.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub left_out: Vec<String>,
}

/// Findings that have a cause in common.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub struct Found {
    /// The name of the cause.
    pub cause: String,
    /// What is wrong in the first of them.
    pub what: String,
    /// What the device may do wrong, the likeliest first.
    pub like: Vec<Like>,
    /// The numbers of the sessions.
    pub sessions: Vec<u64>,
    /// How many actions show it.
    pub actions: usize,
    /// What the device, a program, said before it ended.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub said: Option<String>,
    /// These in words.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub done: Vec<String>,
    /// The file with them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub file: Option<String>,
    /// Why it is accepted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub waived: Option<String>,
}

/// A mutant that does the same.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Like {
    /// The requirements that it breaks.
    pub requirements: String,
    /// What it does.
    pub why: String,
}

/// A freedom that the device uses.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub struct Learnt {
    /// Its name.
    pub freedom: String,
    /// What it does.
    pub why: String,
    /// The requirements and interpretations that allow it.
    pub allowed_by: Vec<String>,
    /// Whether it is from a run, and no session has contradicted it.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub from_a_run: bool,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde wants it so")]
const fn is_zero(count: &u64) -> bool {
    *count == 0
}
