//! Emergency messages (CiA 301, 7.2.7).

use std::fmt;

use crate::frame::{Data, Frame};
use crate::malformed::Malformed;

/// The identifier of node 0's emergency messages; add the node id.
pub const COB_ID: u16 = 0x080;

/// An emergency message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Emcy {
    /// The error.
    pub code: EmcyCode,
    /// The error register 1001h at that moment.
    pub register: u8,
    /// The manufacturer's own five bytes.
    pub vendor: [u8; 5],
}

impl Emcy {
    /// Decodes the bytes.
    ///
    /// # Errors
    /// [`Malformed`] when there are not exactly eight.
    pub fn decode(bytes: &[u8]) -> Result<Self, Malformed> {
        Malformed::unless(bytes, 8, 8)?;
        let mut vendor = [0; 5];
        vendor.copy_from_slice(&bytes[3..]);
        let code = EmcyCode(u16::from_le_bytes([bytes[0], bytes[1]]));
        Ok(Self { code, register: bytes[2], vendor })
    }

    /// Encodes the message.
    pub fn encode(self) -> Data {
        let [low, high] = self.code.0.to_le_bytes();
        let [a, b, c, d, e] = self.vendor;
        Data::from([low, high, self.register, a, b, c, d, e])
    }

    /// The whole frame on the default identifier of node `node`.
    pub fn frame(self, node: u8) -> Frame {
        Frame::new(COB_ID + u16::from(node & 0x7F), self.encode())
    }
}

/// Emergency error code. Unknown ones are kept.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct EmcyCode(pub u16);

impl EmcyCode {
    /// Whether it is about the communication, and not about the device or its application.
    pub const fn is_of_communication(self) -> bool {
        matches!(self.0 >> 8, 0x81 | 0x82)
    }

    /// Error reset or no error.
    pub const RESET: Self = Self(0x0000);
    /// Device hardware.
    pub const HARDWARE: Self = Self(0x5000);
    /// Communication.
    pub const COMMUNICATION: Self = Self(0x8100);
    /// CAN overrun: messages were lost.
    pub const OVERRUN: Self = Self(0x8110);
    /// CAN controller in error passive mode.
    pub const ERROR_PASSIVE: Self = Self(0x8120);
    /// Life guarding or heartbeat error.
    pub const HEARTBEAT: Self = Self(0x8130);
    /// Recovered from bus-off.
    pub const BUS_OFF_RECOVERED: Self = Self(0x8140);
    /// An RPDO was too short and not processed.
    pub const PDO_LENGTH: Self = Self(0x8210);
    /// An RPDO was longer than its mapping.
    pub const PDO_TOO_LONG: Self = Self(0x8220);
    /// SYNC of unexpected length.
    pub const SYNC_LENGTH: Self = Self(0x8240);
    /// An RPDO missed its deadline.
    pub const RPDO_TIMEOUT: Self = Self(0x8250);

    /// Whether CiA 301 has a name for this very code, not only for its class.
    pub const fn is_named(self) -> bool {
        let [class, detail] = self.0.to_be_bytes();
        detail == 0 || matches!((class, detail), (0x81, 0x10..=0x50) | (0x82, 0x10..=0x50))
    }

    /// The meaning of the code, by its class when the exact code is unknown (CiA 301, table 26).
    pub const fn meaning(self) -> &'static str {
        match self.0 {
            0x8110 => "CAN overrun",
            0x8120 => "CAN error passive",
            0x8130 => "life guarding or heartbeat error",
            0x8140 => "recovered from bus-off",
            0x8150 => "CAN identifier collision",
            0x8210 => "PDO not processed, too short",
            0x8220 => "PDO longer than its mapping",
            0x8230 => "destination address mode PDO not processed",
            0x8240 => "unexpected SYNC length",
            0x8250 => "RPDO time-out",
            _ => match self.0 >> 8 {
                0x00 => "no error",
                0x10 => "generic error",
                0x20..=0x23 => "current",
                0x30..=0x33 => "voltage",
                0x40..=0x42 => "temperature",
                0x50 => "device hardware",
                0x60..=0x63 => "device software",
                0x70 => "additional modules",
                0x80 => "monitoring",
                0x81 => "communication",
                0x82 => "protocol error",
                0x90 => "external error",
                0xF0 => "additional functions",
                0xFF => "device specific",
                _ => "reserved",
            },
        }
    }
}

impl fmt::Display for EmcyCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:04X}h ({})", self.0, self.meaning())
    }
}

impl fmt::Debug for EmcyCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn bytes_and_messages() {
        let emcy = Emcy { code: EmcyCode::HEARTBEAT, register: 0x11, vendor: [0, 5, 7, 0, 0] };
        let bytes = [0x30, 0x81, 0x11, 0, 5, 7, 0, 0];
        assert_eq!(Emcy::decode(&bytes), Ok(emcy));
        assert_eq!(*emcy.encode(), bytes);
        assert_eq!(EmcyCode(0x8130).to_string(), "8130h (life guarding or heartbeat error)");
    }

    proptest! {
        #[test]
        fn round_trip(bytes in proptest::collection::vec(any::<u8>(), 0..=8)) {
            match Emcy::decode(&bytes) {
                Ok(emcy) => prop_assert_eq!(&*emcy.encode(), &bytes[..]),
                Err(_) => prop_assert_ne!(bytes.len(), 8),
            }
        }
    }
}
