//! Passes on what a child defines.

mod inner;
mod sibling;

#[cfg(test)]
mod tests;

pub use inner::{Inner, other as another};
