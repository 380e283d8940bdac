//! Suites: the notation, the requirement register, and loading both.

pub mod each;
pub mod effect;
mod folders;
mod library;
pub mod literal;
mod loaded;
pub mod model;
pub mod profile;
mod register;
pub mod step;
mod test_map;

pub use folders::Folders;
pub use library::Library;
pub use loaded::Suite;
pub use register::{Register, RegisterFile, Requirement};
pub use test_map::{CHECKS, TestMapEntry};
