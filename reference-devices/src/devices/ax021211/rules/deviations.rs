//! The controllers that take one decision otherwise.

use super::Ax021211Rules;

/// The names of the devices that break one decision.
pub(in super::super) fn names() -> impl Iterator<Item = &'static str> {
    std::iter::empty()
}

/// The rules of the device that breaks the decision of that name; `None` when there is none.
pub(in super::super) fn named(_name: &str) -> Option<Box<dyn Ax021211Rules>> {
    None
}
