//! From suites to instances: a suite meets a device's data sheet.

mod bind;
mod check;
mod scope;

pub use bind::{Instance, Plan, plan};
pub use check::{mapping_word, parse_bytes};
pub use scope::{Binding, Dut, Scope, show_bytes};
