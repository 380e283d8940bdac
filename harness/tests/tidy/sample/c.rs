//! A path through the parent, by its new name.

// use crate::b::B;
use super::a::another;

pub struct C;
