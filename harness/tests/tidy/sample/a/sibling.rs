//! A name that the parent passes on.

use super::{Inner, another};

pub fn sibling() -> Inner {
    another("");
    Inner
}
