//! Network management: module control and the states it leads to (CiA 301, 7.2.8, 7.3.2).

use std::fmt;

use crate::frame::{Data, Frame};
use crate::malformed::Malformed;

/// The identifier of every NMT command.
pub const COB_ID: u16 = 0x000;

/// An NMT command: a service for one node, or for all when the node is 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Command {
    /// What to do.
    pub service: Service,
    /// Which node; 0 is every node.
    pub node: u8,
}

impl Command {
    /// Decodes the bytes.
    ///
    /// # Errors
    /// [`Malformed`] when there are not exactly two.
    pub fn decode(bytes: &[u8]) -> Result<Self, Malformed> {
        Malformed::unless(bytes, 2, 2)?;
        Ok(Self { service: Service(bytes[0]), node: bytes[1] })
    }

    /// Encodes the command.
    pub fn encode(self) -> Data {
        Data::from([self.service.0, self.node])
    }

    /// The whole frame.
    pub fn frame(self) -> Frame {
        Frame::new(COB_ID, self.encode())
    }
}

/// NMT command specifier. Unknown ones are kept.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct Service(pub u8);

impl Service {
    /// Start remote node.
    pub const START: Self = Self(1);
    /// Stop remote node.
    pub const STOP: Self = Self(2);
    /// Enter PRE-OPERATIONAL.
    pub const ENTER_PRE_OPERATIONAL: Self = Self(128);
    /// Reset node.
    pub const RESET_NODE: Self = Self(129);
    /// Reset communication.
    pub const RESET_COMMUNICATION: Self = Self(130);
}

impl fmt::Display for Service {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::START => f.write_str("start"),
            Self::STOP => f.write_str("stop"),
            Self::ENTER_PRE_OPERATIONAL => f.write_str("enter pre-operational"),
            Self::RESET_NODE => f.write_str("reset node"),
            Self::RESET_COMMUNICATION => f.write_str("reset communication"),
            Self(code) => write!(f, "unknown command specifier {code:02X}h"),
        }
    }
}

impl fmt::Debug for Service {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

/// NMT state as error control reports it. Unknown ones are kept.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct NmtState(pub u8);

impl NmtState {
    /// Initialising; on the wire, the boot-up message.
    pub const INITIALISING: Self = Self(0);
    /// Stopped.
    pub const STOPPED: Self = Self(4);
    /// Operational.
    pub const OPERATIONAL: Self = Self(5);
    /// Pre-operational.
    pub const PRE_OPERATIONAL: Self = Self(127);
}

impl fmt::Display for NmtState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::INITIALISING => f.write_str("INITIALISING"),
            Self::STOPPED => f.write_str("STOPPED"),
            Self::OPERATIONAL => f.write_str("OPERATIONAL"),
            Self::PRE_OPERATIONAL => f.write_str("PRE-OPERATIONAL"),
            Self(code) => write!(f, "unknown state {code:02X}h"),
        }
    }
}

impl fmt::Debug for NmtState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn bytes_and_commands() {
        let table = [
            ([0x01, 0x05], Command { service: Service::START, node: 5 }),
            ([0x80, 0x00], Command { service: Service::ENTER_PRE_OPERATIONAL, node: 0 }),
            ([0x82, 0x7F], Command { service: Service::RESET_COMMUNICATION, node: 127 }),
        ];
        for (bytes, command) in table {
            assert_eq!(Command::decode(&bytes), Ok(command));
            assert_eq!(*command.encode(), bytes);
        }
    }

    proptest! {
        #[test]
        fn round_trip(bytes in proptest::collection::vec(any::<u8>(), 0..=8)) {
            match Command::decode(&bytes) {
                Ok(command) => prop_assert_eq!(&*command.encode(), &bytes[..]),
                Err(_) => prop_assert_ne!(bytes.len(), 2),
            }
        }
    }
}
