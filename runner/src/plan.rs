//! From suites to instances: binds a suite to a device by its data sheet.
//!
//! What can be known of a case without the device belongs here: its instances, and why one is
//! skipped. What the device answers belongs to [`run`](crate::run).

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

pub(crate) use bind::others;
pub use bind::{plan, plan_cases};
pub(crate) use bytes::{fill, mapping_word};
pub use bytes::{parse_bytes, show_bytes};
pub use deeds::deeds;
pub(crate) use deeds::{nmt_frame, protected};
pub(crate) use each::{index_range, matching_entries};
pub use instance::{Fate, Instance, Plan, is_named};
pub(crate) use scope::Binding;
pub use scope::Scope;
pub use wording::Wording;
