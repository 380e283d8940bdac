//! Running a plan against a device, in four rooms.
//!
//! ```text
//! session ▶ steps ▶ rest ▶ link
//! visit ▶ rest
//! ```
//!
//! [`link`] is the bus with its trace, [`rest`] brings the device to rest and leaves it as it was,
//! [`steps`] carries out and judges steps, and [`session`] runs case after case and emits events. A
//! [`visit`] lends the device to something else than cases.
//! The selection of cases and of the device does not belong here.

mod link;
mod observer;
mod policy;
mod rest;
mod session;
mod steps;
#[cfg(test)]
mod tests;
mod visit;

pub use link::{
    Ended, Link, Lost, Traffic, exists, identity, oddities, probe, read_number, read_text,
    read_value, transfer, value_length,
};
pub use observer::{Observer, Shown, Unobserved};
pub use policy::Policy;
pub use rest::{Abandoned, Address, BroughtBack, KeepChanges, Snapshot, Undo, differs};
pub use session::{Ending, Session};
pub use steps::bears;
pub use visit::{Started, Visit};
