//! Running a plan against a device: the loop over cases, and the events it emits.

mod ask;
mod baseline;
mod bench;
mod bench_snapshot;
mod bring_back;
mod case;
mod judge;
mod ladder;
mod limits;
mod link;
mod lss;
mod measure;
mod objects;
mod oddities;
mod policy;
mod probe;
mod promise;
mod proof;
mod reliance;
mod restore;
mod sdo;
mod session;
mod settle;
mod silence;
mod steps;
#[cfg(test)]
mod tests;
mod traffic;
mod undo;

pub use bring_back::{Abandoned, BroughtBack};
pub use link::Link;
pub use oddities::oddities;
pub use policy::Policy;
pub use probe::{Lost, objects as probe};
pub use proof::{Shown, Witness};
pub use sdo::{Ended, is_long, transfer};
pub use session::{Ending, Session, exists, identity, read_number, read_text};
pub use traffic::Traffic;
pub use undo::{KeepChanges, Undo};
