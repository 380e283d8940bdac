//! Suites: the notation, the requirement register, and loading both.

mod files;
pub mod literal;
pub mod model;
pub mod profile;
mod register;
mod test_map;

pub use files::{Library, Suite};
pub use register::{Register, RegisterFile, Requirement};
pub use test_map::{CHECKS, TestMapEntry};
