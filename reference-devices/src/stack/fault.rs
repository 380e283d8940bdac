//! The communication errors that the stack finds itself.

/// An error of the stack: what, on which node or PDO, and lengths where they matter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Fault {
    pub(crate) kind: FaultKind,
    pub(crate) subject: u16,
    pub(crate) expected: u8,
    pub(crate) actual: u8,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum FaultKind {
    SyncTimeout,
    SyncLength,
    Guarding,
    Heartbeat,
    RpdoTooShort,
    RpdoTooLong,
    RpdoTimeout,
    /// Of the behaviour, which numbers its errors itself.
    Application,
}

impl Fault {
    pub(crate) const fn new(kind: FaultKind, subject: u16) -> Self {
        Self { kind, subject, expected: 0, actual: 0 }
    }
}

impl FaultKind {
    /// CiA 301, 7.5.2.32: what 1029h sub 1 reacts to.
    pub(crate) const fn is_communication_error(self) -> bool {
        matches!(self, Self::Guarding | Self::Heartbeat)
    }
}
