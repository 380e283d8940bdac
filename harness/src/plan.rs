//! From suites to instances: a suite meets a device's data sheet.

mod bind;
mod check;
mod instance;
mod scope;

pub use bind::{index_range, matching_entries, plan};
pub use check::{fill, mapping_word, parse_bytes};
pub use instance::{Instance, Plan};
pub use scope::{Binding, Dut, Scope, show_bytes};
