//! From suites to instances: a suite meets a device's data sheet.

mod bind;
mod bytes;
mod check;
mod deeds;
mod each;
mod instance;
mod kind;
mod pdo;
mod profile;
mod scope;
mod wording;

pub use bind::plan;
pub(crate) use bind::{others, plan_cases};
pub(crate) use bytes::{fill, mapping_word, parse_bytes, show_bytes};
pub(crate) use deeds::{deeds, nmt_frame};
pub(crate) use each::{index_range, matching_entries};
pub use instance::Plan;
pub(crate) use instance::{Instance, is_named};
pub(crate) use scope::{Binding, Scope};
pub(crate) use wording::Wording;
