//! The reason why bytes are no valid message of a service.

use std::fmt;

/// The bytes cannot be this service's: they have the wrong length.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Malformed {
    /// The shortest and the longest length the service knows, in bytes.
    pub expected: (usize, usize),
    /// The length that was there.
    pub got: usize,
}

impl Malformed {
    /// Checks that `bytes` have `low` to `high` bytes.
    pub(crate) fn unless(bytes: &[u8], low: usize, high: usize) -> Result<(), Self> {
        if (low..=high).contains(&bytes.len()) {
            return Ok(());
        }
        Err(Self { expected: (low, high), got: bytes.len() })
    }
}

impl fmt::Display for Malformed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.expected {
            (low, high) if low == high => write!(f, "{} data bytes instead of {low}", self.got),
            (low, high) => write!(f, "{} data bytes instead of {low} to {high}", self.got),
        }
    }
}

impl std::error::Error for Malformed {}
