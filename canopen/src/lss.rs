//! Layer setting services (CiA 305): the messages by which a master finds slaves and gives them
//! their node id and bit rate.

use crate::frame::{Data, Frame};
use crate::malformed::Malformed;

/// The identifier of what the master sends.
pub const REQUEST_COB_ID: u16 = 0x7E5;
/// The identifier of what a slave sends.
pub const RESPONSE_COB_ID: u16 = 0x7E4;
/// The node id of a slave that has none yet.
pub const UNCONFIGURED: u8 = 255;

/// A message of the master.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request {
    /// Switch state global (04h).
    SwitchGlobal(Mode),
    /// Configure node id (11h).
    ConfigureNodeId(u8),
    /// Configure bit timing parameters (13h).
    ConfigureBitTiming {
        /// Table of bit rates; 0 is that of CiA 301.
        table: u8,
        /// Place in the table.
        index: u8,
    },
    /// Activate bit timing parameters (15h), with the time before and after the switch in
    /// milliseconds.
    ActivateBitTiming(u16),
    /// Store configuration (17h).
    Store,
    /// Switch state selective (40h to 43h): a part of the address of the one that is meant.
    SwitchSelective(Part, u32),
    /// Identify remote slave (46h to 4Bh): a bound of the addresses that are meant.
    Identify(Bound, u32),
    /// Identify non-configured remote slave (4Ch).
    IdentifyUnconfigured,
    /// Fastscan (51h).
    Fastscan(Fastscan),
    /// Inquire a part of the address (5Ah to 5Dh).
    Inquire(Part),
    /// Inquire node id (5Eh).
    InquireNodeId,
    /// Any other command specifier, all eight bytes as they came.
    Unknown([u8; 8]),
}

/// A message of a slave.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Response {
    /// The node id was configured, or not (11h).
    ConfiguredNodeId(Status),
    /// The bit timing was configured, or not (13h).
    ConfiguredBitTiming(Status),
    /// The configuration was stored, or not (17h).
    Stored(Status),
    /// The slave was selected (44h).
    Selected,
    /// The slave is meant by what was asked (4Fh).
    Identified,
    /// The slave has no node id (50h).
    Unconfigured,
    /// A part of the slave's address (5Ah to 5Dh).
    Address(Part, u32),
    /// The slave's node id (5Eh).
    NodeId(u8),
    /// Any other command specifier, all eight bytes as they came.
    Unknown([u8; 8]),
}

/// The state a slave is switched to. Unknown ones are kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mode(pub u8);

impl Mode {
    /// The slave waits until it is addressed.
    pub const WAITING: Self = Self(0);
    /// The slave can be configured.
    pub const CONFIGURATION: Self = Self(1);
}

/// A part of the address of a slave, in the order of the sub-indices of 1018h from 1 on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Part {
    /// Vendor-ID.
    Vendor,
    /// Product code.
    Product,
    /// Revision number.
    Revision,
    /// Serial number.
    Serial,
}

impl Part {
    /// The four of them, in order.
    pub const ALL: [Self; 4] = [Self::Vendor, Self::Product, Self::Revision, Self::Serial];
}

/// A bound of a range of addresses, in the order in which they are sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Bound {
    /// Vendor-ID.
    Vendor,
    /// Product code.
    Product,
    /// Lowest revision number.
    RevisionLow,
    /// Highest revision number.
    RevisionHigh,
    /// Lowest serial number.
    SerialLow,
    /// Highest serial number.
    SerialHigh,
}

impl Bound {
    /// The six of them, in order.
    pub const ALL: [Self; 6] = [
        Self::Vendor,
        Self::Product,
        Self::RevisionLow,
        Self::RevisionHigh,
        Self::SerialLow,
        Self::SerialHigh,
    ];
}

/// One question of a fastscan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fastscan {
    /// The value that is asked for.
    pub number: u32,
    /// The lowest bit that is compared, 0 to 31, or [`Fastscan::CONFIRM`].
    pub bit: u8,
    /// The part of the address it is compared with, 0 to 3.
    pub part: u8,
    /// The part that is asked for next, 0 to 3.
    pub next: u8,
}

impl Fastscan {
    /// In place of a bit: asks whether any slave answers. Every scan starts with it.
    pub const CONFIRM: u8 = 0x80;
}

/// How a command ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Status {
    /// 0 is success; the others depend on the service, 255 is the manufacturer's own.
    pub error: u8,
    /// The manufacturer's own code.
    pub specific: u8,
}

impl Status {
    /// It worked.
    pub const DONE: Self = Self { error: 0, specific: 0 };
    /// The value is out of range, or storing is not supported.
    pub const REFUSED: Self = Self { error: 1, specific: 0 };
    /// The medium to store in failed.
    pub const MEDIUM: Self = Self { error: 2, specific: 0 };
}

/// The bit rates of table 0 in bit/s by their place; `None` where there is none (CiA 305, 6.4.2).
pub const BIT_RATES: [Option<u32>; 9] = [
    Some(1_000_000),
    Some(800_000),
    Some(500_000),
    Some(250_000),
    Some(125_000),
    None,
    Some(50_000),
    Some(20_000),
    Some(10_000),
];

impl Request {
    /// Decodes the bytes. Reserved bytes are ignored.
    ///
    /// # Errors
    /// [`Malformed`] when there are not exactly eight.
    pub fn decode(bytes: &[u8]) -> Result<Self, Malformed> {
        Malformed::unless(bytes, 8, 8)?;
        let bytes = Data::new(bytes).padded();
        let [specifier, a, b, c, d, e, f, g] = bytes;
        let number = u32::from_le_bytes([a, b, c, d]);
        let part = |first: u8| Part::ALL[usize::from(specifier - first)];
        Ok(match specifier {
            0x04 => Self::SwitchGlobal(Mode(a)),
            0x11 => Self::ConfigureNodeId(a),
            0x13 => Self::ConfigureBitTiming { table: a, index: b },
            0x15 => Self::ActivateBitTiming(u16::from_le_bytes([a, b])),
            0x17 => Self::Store,
            0x40..=0x43 => Self::SwitchSelective(part(0x40), number),
            0x46..=0x4B => Self::Identify(Bound::ALL[usize::from(specifier - 0x46)], number),
            0x4C => Self::IdentifyUnconfigured,
            0x51 => Self::Fastscan(Fastscan { number, bit: e, part: f, next: g }),
            0x5A..=0x5D => Self::Inquire(part(0x5A)),
            0x5E => Self::InquireNodeId,
            _ => Self::Unknown(bytes),
        })
    }

    /// Encodes the message; reserved bytes are zero.
    pub fn encode(self) -> Data {
        let short = |specifier, [a, b]: [u8; 2]| [specifier, a, b, 0, 0, 0, 0, 0];
        Data::from(match self {
            Self::SwitchGlobal(mode) => short(0x04, [mode.0, 0]),
            Self::ConfigureNodeId(node) => short(0x11, [node, 0]),
            Self::ConfigureBitTiming { table, index } => short(0x13, [table, index]),
            Self::ActivateBitTiming(delay) => short(0x15, delay.to_le_bytes()),
            Self::Store => short(0x17, [0, 0]),
            Self::SwitchSelective(part, number) => with_number(0x40 + part as u8, number),
            Self::Identify(bound, number) => with_number(0x46 + bound as u8, number),
            Self::IdentifyUnconfigured => short(0x4C, [0, 0]),
            Self::Fastscan(Fastscan { number, bit, part, next }) => {
                let [specifier, a, b, c, d, ..] = with_number(0x51, number);
                [specifier, a, b, c, d, bit, part, next]
            }
            Self::Inquire(part) => short(0x5A + part as u8, [0, 0]),
            Self::InquireNodeId => short(0x5E, [0, 0]),
            Self::Unknown(bytes) => bytes,
        })
    }

    /// The whole frame.
    pub fn frame(self) -> Frame {
        Frame::new(REQUEST_COB_ID, self.encode())
    }
}

impl Response {
    /// Decodes the bytes. Reserved bytes are ignored.
    ///
    /// # Errors
    /// [`Malformed`] when there are not exactly eight.
    pub fn decode(bytes: &[u8]) -> Result<Self, Malformed> {
        Malformed::unless(bytes, 8, 8)?;
        let bytes = Data::new(bytes).padded();
        let [specifier, a, b, c, d, ..] = bytes;
        let status = Status { error: a, specific: b };
        Ok(match specifier {
            0x11 => Self::ConfiguredNodeId(status),
            0x13 => Self::ConfiguredBitTiming(status),
            0x17 => Self::Stored(status),
            0x44 => Self::Selected,
            0x4F => Self::Identified,
            0x50 => Self::Unconfigured,
            0x5A..=0x5D => {
                let part = Part::ALL[usize::from(specifier - 0x5A)];
                Self::Address(part, u32::from_le_bytes([a, b, c, d]))
            }
            0x5E => Self::NodeId(a),
            _ => Self::Unknown(bytes),
        })
    }

    /// Encodes the message; reserved bytes are zero.
    pub fn encode(self) -> Data {
        let short = |specifier, [a, b]: [u8; 2]| [specifier, a, b, 0, 0, 0, 0, 0];
        let status = |status: Status| [status.error, status.specific];
        Data::from(match self {
            Self::ConfiguredNodeId(how) => short(0x11, status(how)),
            Self::ConfiguredBitTiming(how) => short(0x13, status(how)),
            Self::Stored(how) => short(0x17, status(how)),
            Self::Selected => short(0x44, [0, 0]),
            Self::Identified => short(0x4F, [0, 0]),
            Self::Unconfigured => short(0x50, [0, 0]),
            Self::Address(part, number) => with_number(0x5A + part as u8, number),
            Self::NodeId(node) => short(0x5E, [node, 0]),
            Self::Unknown(bytes) => bytes,
        })
    }

    /// The whole frame.
    pub fn frame(self) -> Frame {
        Frame::new(RESPONSE_COB_ID, self.encode())
    }
}

fn with_number(specifier: u8, number: u32) -> [u8; 8] {
    let [a, b, c, d] = number.to_le_bytes();
    [specifier, a, b, c, d, 0, 0, 0]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn bytes_and_requests() {
        let scan = Fastscan { number: 0x8000_0000, bit: 31, part: 2, next: 3 };
        let table = [
            ([0x04, 1, 0, 0, 0, 0, 0, 0], Request::SwitchGlobal(Mode::CONFIGURATION)),
            ([0x11, 127, 0, 0, 0, 0, 0, 0], Request::ConfigureNodeId(127)),
            ([0x13, 0, 4, 0, 0, 0, 0, 0], Request::ConfigureBitTiming { table: 0, index: 4 }),
            ([0x15, 0xE8, 3, 0, 0, 0, 0, 0], Request::ActivateBitTiming(1000)),
            ([0x17, 0, 0, 0, 0, 0, 0, 0], Request::Store),
            ([0x40, 4, 3, 2, 1, 0, 0, 0], Request::SwitchSelective(Part::Vendor, 0x0102_0304)),
            ([0x43, 4, 0, 0, 0, 0, 0, 0], Request::SwitchSelective(Part::Serial, 4)),
            ([0x46, 4, 0, 0, 0, 0, 0, 0], Request::Identify(Bound::Vendor, 4)),
            ([0x4B, 4, 0, 0, 0, 0, 0, 0], Request::Identify(Bound::SerialHigh, 4)),
            ([0x4C, 0, 0, 0, 0, 0, 0, 0], Request::IdentifyUnconfigured),
            ([0x51, 0, 0, 0, 0x80, 31, 2, 3], Request::Fastscan(scan)),
            ([0x5D, 0, 0, 0, 0, 0, 0, 0], Request::Inquire(Part::Serial)),
            ([0x5E, 0, 0, 0, 0, 0, 0, 0], Request::InquireNodeId),
            ([0x7F, 1, 2, 3, 4, 5, 6, 7], Request::Unknown([0x7F, 1, 2, 3, 4, 5, 6, 7])),
        ];
        for (bytes, request) in table {
            assert_eq!(Request::decode(&bytes), Ok(request));
            assert_eq!(*request.encode(), bytes);
        }
    }

    #[test]
    fn bytes_and_responses() {
        let specific = Status { error: 255, specific: 7 };
        let table = [
            ([0x11, 1, 0, 0, 0, 0, 0, 0], Response::ConfiguredNodeId(Status::REFUSED)),
            ([0x13, 255, 7, 0, 0, 0, 0, 0], Response::ConfiguredBitTiming(specific)),
            ([0x17, 2, 0, 0, 0, 0, 0, 0], Response::Stored(Status::MEDIUM)),
            ([0x44, 0, 0, 0, 0, 0, 0, 0], Response::Selected),
            ([0x4F, 0, 0, 0, 0, 0, 0, 0], Response::Identified),
            ([0x50, 0, 0, 0, 0, 0, 0, 0], Response::Unconfigured),
            ([0x5B, 4, 3, 2, 1, 0, 0, 0], Response::Address(Part::Product, 0x0102_0304)),
            ([0x5E, 255, 0, 0, 0, 0, 0, 0], Response::NodeId(UNCONFIGURED)),
            ([0x00, 1, 2, 3, 4, 5, 6, 7], Response::Unknown([0, 1, 2, 3, 4, 5, 6, 7])),
        ];
        for (bytes, response) in table {
            assert_eq!(Response::decode(&bytes), Ok(response));
            assert_eq!(*response.encode(), bytes);
        }
    }

    proptest! {
        #[test]
        fn round_trip(bytes in proptest::collection::vec(any::<u8>(), 0..=8)) {
            match (Request::decode(&bytes), Response::decode(&bytes)) {
                (Ok(request), Ok(response)) => {
                    prop_assert_eq!(Request::decode(&request.encode()), Ok(request));
                    prop_assert_eq!(Response::decode(&response.encode()), Ok(response));
                }
                (Err(_), Err(_)) => prop_assert_ne!(bytes.len(), 8),
                _ => prop_assert!(false),
            }
        }
    }
}
