//! Every decision that the specification takes, a file per service.
//!
//! The stack asks and holds no deviation of its own. The default methods are a summary of CiA 301
//! and CiA 305; clauses are those of CiA 301, version 4.2, unless a file names another document.
//! Below the decisions of a service stand its deviations, which take one of them otherwise.
//! Deviations add up: [`deviating`] lays one on top of others.

#[macro_use]
mod deviations;

mod access;
mod dissent;
mod emcy;
mod error_control;
mod lss;
mod nmt;
mod pdo;
mod reset;
mod sdo;
mod sdo_block;
mod storage;
mod sync;
mod time;
mod timers;

pub use access::AccessRules;
pub(crate) use deviations::laid;
pub use deviations::{Layer, deviating, named, names};
pub use dissent::Dissent;
pub use emcy::EmcyRules;
pub use error_control::ErrorControlRules;
pub use lss::LssRules;
pub use nmt::NmtRules;
pub use pdo::PdoRules;
pub use reset::{Change, Reset};
pub use sdo::SdoRules;
pub use sdo_block::SdoBlockRules;
pub use storage::StorageRules;
pub use sync::SyncRules;
pub use time::TimeRules;
pub use timers::{Timer, TimerRules};

/// All decisions of a device.
pub trait Rules:
    NmtRules
    + ErrorControlRules
    + SdoRules
    + SdoBlockRules
    + AccessRules
    + EmcyRules
    + SyncRules
    + TimeRules
    + TimerRules
    + PdoRules
    + StorageRules
    + LssRules
    + Send
    + Sync
{
}

/// A device that keeps to the specification.
#[derive(Clone, Copy, Debug, Default)]
pub struct Specification;

impl Layer for Specification {}
as_beneath!(Specification);
