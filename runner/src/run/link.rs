//! The bus as a runner sees it: a trace with a cursor, transfers, and the other stations on the
//! bus.
//!
//! Everything that goes over the wire belongs here. Its meaning for a verdict does not.

mod lateness;
mod oddities;
mod other_nodes;
mod patience;
mod probe;
mod read;
pub(super) mod sdo;
mod silence;
mod trace;
mod traffic;
mod twins;

pub(super) use lateness::{Lateness, STALL};
pub(in crate::run) use oddities::contradiction;
pub use oddities::oddities;
pub(super) use patience::{Patience, proves_nothing};
pub use probe::{Lost, objects as probe};
pub(in crate::run) use read::identity_of;
pub(super) use read::versions;
pub use read::{exists, identity, read_number, read_text, read_value};
pub use sdo::{Ended, transfer, value_length};
pub use trace::Link;
pub use traffic::Traffic;
