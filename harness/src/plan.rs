//! From suites to instances: a suite meets a device's data sheet.

mod bind;
mod bytes;
mod check;
mod each;
mod instance;
mod kind;
mod pdo;
mod profile;
mod scope;

pub use bind::plan;
pub use bytes::{fill, mapping_word, parse_bytes, show_bytes};
pub use each::{index_range, matching_entries};
pub use instance::{Instance, Plan};
pub use scope::{Binding, Scope};
