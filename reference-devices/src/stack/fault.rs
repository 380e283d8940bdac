//! The communication errors that the stack finds itself.

use schemars::JsonSchema;
use serde::Deserialize;

/// An error of the stack: what, on which node or PDO, and lengths where they matter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Fault {
    pub(crate) kind: FaultKind,
    pub(crate) subject: u16,
    pub(crate) expected: u8,
    pub(crate) actual: u8,
}

/// A communication error.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum FaultKind {
    /// SYNC did not come in time.
    SyncTimeout,
    /// SYNC had another length than 1019h asks for.
    SyncLength,
    /// Life guarding was lost.
    Guarding,
    /// The heartbeat of a node was lost.
    Heartbeat,
    /// An RPDO was too short and was not used.
    RpdoTooShort,
    /// An RPDO was too long; its mapped part was used.
    RpdoTooLong,
    /// An RPDO missed its deadline.
    RpdoTimeout,
}

impl Fault {
    pub(crate) const fn new(kind: FaultKind, subject: u16) -> Self {
        Self { kind, subject, expected: 0, actual: 0 }
    }
}

impl FaultKind {
    /// The errors that 1029h sub 1 reacts to (CiA 301, 7.5.2.32).
    pub(crate) const fn is_communication_error(self) -> bool {
        matches!(self, Self::Guarding | Self::Heartbeat)
    }
}
