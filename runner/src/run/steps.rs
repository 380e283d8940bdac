//! Steps: the actions of each on the bus or the bench, and its demands.
//!
//! The judgement of one step belongs here. Its consequence for the verdict of the case belongs to
//! [`session`](super::session).

mod apart;
mod ask;
pub(super) mod bench;
mod judge;
mod limits;
mod lss;
mod measure;
mod objects;
mod partner;
pub(super) mod promise;
mod proof;
mod run;
mod window;

pub(in crate::run) use judge::{Difference, Judgement, Trouble, excerpt};
pub(in crate::run) use proof::Proof;
pub(in crate::run) use run::{Steps, is_of_protocol, is_reset};
pub use window::bears;
