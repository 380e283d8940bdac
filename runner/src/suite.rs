//! Suites: the notation, the requirement register, and loading both.
//!
//! The meaning of a word of the notation belongs here, and what is wrong in a file whatever the
//! device is. What a suite says that a data sheet contradicts belongs to [`plan`](crate::plan).

mod built_in;
pub mod constraint;
mod definition;
mod dimension;
pub(crate) mod each;
pub(crate) mod effect;
mod expand;
mod formula;
mod library;
pub mod literal;
mod loaded;
pub mod model;
pub(crate) mod profile;
pub mod refusal;
mod register;
mod rewrite;
mod same;
mod scale;
mod schema;
pub mod step;
mod test_map;
mod vocabulary;
mod words;

pub use built_in::{built_in, fingerprint, fingerprint_of};
pub use dimension::{Dimension, Extent};
pub use library::{Library, is_register, is_suite};
pub use loaded::Suite;
pub(crate) use register::Relaxation;
pub use register::{Level, Register, RegisterFile, Requirement};
pub use rewrite::{Changes, Rewritten, rewritten};
pub use schema::{steps_schema, suite_schema, words_schema};
pub use test_map::CHECKS;
pub use vocabulary::beside;
pub use words::Words;
