//! Suites: the notation, the requirement register, and loading both.

pub(crate) mod constraint;
mod definition;
mod dimension;
pub(crate) mod each;
pub(crate) mod effect;
mod expand;
mod folders;
mod formula;
mod library;
pub(crate) mod literal;
mod loaded;
pub(crate) mod model;
pub(crate) mod profile;
pub(crate) mod refusal;
mod register;
mod rewrite;
mod same;
mod scale;
mod schema;
pub(crate) mod step;
mod test_map;
mod vocabulary;
mod words;

pub(crate) use dimension::{Dimension, Extent};
pub use folders::{CatalogueFolder, Folders};
pub use library::Library;
pub(crate) use loaded::Suite;
pub(crate) use register::{Level, Register, RegisterFile, Requirement};
pub(crate) use rewrite::{Changes, Rewritten, rewritten};
pub(crate) use schema::{steps_schema, suite_schema, words_schema};
pub(crate) use test_map::CHECKS;
pub(crate) use vocabulary::beside;
pub use words::Words;
