//! Tests import as they like.

use crate::c::C;
