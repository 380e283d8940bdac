//! The parts that requests and responses share.

use crate::frame::Data;

/// How a transfer begins: with all the data, or with segments to follow.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Initiate {
    /// One to four bytes, their number given.
    Expedited(Data),
    /// Four bytes of which the object's own length counts.
    Unsized([u8; 4]),
    /// Segments follow; the number of bytes in all, when it is given.
    Segmented(Option<u32>),
}

/// One segment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Segment {
    /// Alternates from segment to segment, false in the first.
    pub toggle: bool,
    /// Up to seven bytes.
    pub data: Data,
    /// Whether this is the last one.
    pub last: bool,
}

impl Initiate {
    /// From the bits `nnes` of the command byte and bytes 4 to 7.
    pub(super) fn decode(command: u8, bytes: [u8; 4]) -> Self {
        match (command & 0b10 != 0, command & 0b01 != 0) {
            (true, true) => Self::Expedited(Data::new(&bytes[..4 - usize::from(command >> 2 & 3)])),
            (true, false) => Self::Unsized(bytes),
            (false, true) => Self::Segmented(Some(u32::from_le_bytes(bytes))),
            (false, false) => Self::Segmented(None),
        }
    }

    /// The bits `nnes` and bytes 4 to 7. Data beyond four bytes do not fit and are cut off.
    pub(super) fn encode(self) -> (u8, [u8; 4]) {
        match self {
            Self::Expedited(data) => {
                let mut bytes = [0; 4];
                let len = data.len().min(4);
                bytes[..len].copy_from_slice(&data[..len]);
                ((4 - len as u8) << 2 & 0b1100 | 0b11, bytes)
            }
            Self::Unsized(bytes) => (0b10, bytes),
            Self::Segmented(Some(size)) => (0b01, size.to_le_bytes()),
            Self::Segmented(None) => (0b00, [0; 4]),
        }
    }
}

impl Segment {
    /// From the bits `tnnnc` of the command byte and bytes 1 to 7.
    pub(super) fn decode(bytes: [u8; 8]) -> Self {
        let len = 7 - usize::from(bytes[0] >> 1 & 7);
        Self {
            toggle: bytes[0] & 0x10 != 0,
            data: Data::new(&bytes[1..1 + len]),
            last: bytes[0] & 1 != 0,
        }
    }

    /// The eight bytes with `specifier` in the three leading bits. An eighth data byte does not
    /// fit and is cut off.
    pub(super) fn encode(self, specifier: u8) -> [u8; 8] {
        let len = self.data.len().min(7);
        let mut bytes = [0; 8];
        bytes[0] = specifier << 5
            | u8::from(self.toggle) << 4
            | (7 - len as u8) << 1
            | u8::from(self.last);
        bytes[1..1 + len].copy_from_slice(&self.data[..len]);
        bytes
    }
}
