//! Block transfer (CiA 301, 7.2.4.3.9 to 7.2.4.3.16): many segments for one confirmation.
//!
//! Inside a sub-block the first byte of a frame is a sequence number, not a command. Only a reader
//! that knows that a sub-block is under way can decode it: see [`BlockSegment`].

use crate::malformed::Malformed;
use crate::mux::Mux;

/// The most segments of a sub-block; the fewest is 1.
pub const LARGEST_BLOCK: u8 = 127;

/// A client's command in a block transfer, outside sub-blocks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BlockRequest {
    /// Begins a download.
    Download {
        /// Where to.
        mux: Mux,
        /// Whether the client can send a checksum at the end.
        crc: bool,
        /// The number of bytes in all, when it is given.
        size: Option<u32>,
    },
    /// Ends a download.
    DownloadEnd(BlockEnd),
    /// Begins an upload.
    Upload {
        /// Where from.
        mux: Mux,
        /// Whether the client can check a checksum at the end.
        crc: bool,
        /// Segments of a sub-block, 1 to 127.
        size: u8,
        /// The largest number of bytes for which the server may change to the usual protocol; 0
        /// forbids it.
        threshold: u8,
    },
    /// Lets the first sub-block come.
    UploadStart,
    /// Confirms a sub-block.
    UploadAck(BlockAck),
    /// Confirms the end of an upload.
    UploadEnd,
}

/// A server's command in a block transfer, outside sub-blocks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BlockResponse {
    /// Accepts a download.
    Download {
        /// Where to.
        mux: Mux,
        /// Whether the server checks a checksum.
        crc: bool,
        /// Segments of a sub-block, 1 to 127.
        size: u8,
    },
    /// Confirms a sub-block.
    DownloadAck(BlockAck),
    /// Confirms the end of a download.
    DownloadEnd,
    /// Accepts an upload.
    Upload {
        /// Where from.
        mux: Mux,
        /// Whether the server sends a checksum at the end.
        crc: bool,
        /// The number of bytes in all, when it is given.
        size: Option<u32>,
    },
    /// Ends an upload.
    UploadEnd(BlockEnd),
}

/// The confirmation of a sub-block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BlockAck {
    /// The last segment that was received in order; later segments are sent again.
    pub last_good: u8,
    /// Segments of the next sub-block, 1 to 127.
    pub size: u8,
}

/// The end of a block transfer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BlockEnd {
    /// How many bytes of the last segment are not data.
    pub unused: u8,
    /// The checksum of the data, see [`crc`]; 0 when there is none.
    pub crc: u16,
}

/// A segment of a sub-block, the same from client and server.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BlockSegment {
    /// Counts from 1 in each sub-block.
    pub sequence: u8,
    /// Whether it is the last of the transfer.
    pub last: bool,
    /// Seven bytes; the end of the transfer states how many of the last segment count.
    pub data: [u8; 7],
}

impl BlockRequest {
    /// From eight bytes whose command specifier is 5 or 6.
    pub(super) const fn decode(bytes: [u8; 8]) -> Self {
        let [command, low, high, sub, a, b, c, d] = bytes;
        let mux = Mux::from_bytes([low, high, sub]);
        match (command >> 5, command & 3) {
            (6, 0 | 2) => {
                Self::Download { mux, crc: command & CRC != 0, size: given(command, [a, b, c, d]) }
            }
            (6, _) => Self::DownloadEnd(BlockEnd::decode(bytes)),
            (_, 0) => Self::Upload { mux, crc: command & CRC != 0, size: a, threshold: b },
            (_, 1) => Self::UploadEnd,
            (_, 2) => Self::UploadAck(BlockAck { last_good: low, size: high }),
            (_, _) => Self::UploadStart,
        }
    }

    pub(super) fn encode(self) -> [u8; 8] {
        match self {
            Self::Download { mux, crc, size } => initiate(0xC0, mux, crc, size),
            Self::DownloadEnd(end) => end.encode(),
            Self::Upload { mux, crc, size, threshold } => {
                let [low, high, sub] = mux.bytes();
                [0xA0 | flag(crc, CRC), low, high, sub, size, threshold, 0, 0]
            }
            Self::UploadStart => [0xA3, 0, 0, 0, 0, 0, 0, 0],
            Self::UploadAck(ack) => ack.encode(),
            Self::UploadEnd => [0xA1, 0, 0, 0, 0, 0, 0, 0],
        }
    }
}

impl BlockResponse {
    /// From eight bytes whose command specifier is 5 or 6; `None` for what is not defined.
    pub(super) const fn decode(bytes: [u8; 8]) -> Option<Self> {
        let [command, low, high, sub, a, b, c, d] = bytes;
        let mux = Mux::from_bytes([low, high, sub]);
        Some(match (command >> 5, command & 3) {
            (6, 0 | 2) => {
                Self::Upload { mux, crc: command & CRC != 0, size: given(command, [a, b, c, d]) }
            }
            (6, _) => Self::UploadEnd(BlockEnd::decode(bytes)),
            (_, 0) => Self::Download { mux, crc: command & CRC != 0, size: a },
            (_, 1) => Self::DownloadEnd,
            (_, 2) => Self::DownloadAck(BlockAck { last_good: low, size: high }),
            (_, _) => return None,
        })
    }

    pub(super) fn encode(self) -> [u8; 8] {
        match self {
            Self::Download { mux, crc, size } => {
                let [low, high, sub] = mux.bytes();
                [0xA0 | flag(crc, CRC), low, high, sub, size, 0, 0, 0]
            }
            Self::DownloadAck(ack) => ack.encode(),
            Self::DownloadEnd => [0xA1, 0, 0, 0, 0, 0, 0, 0],
            Self::Upload { mux, crc, size } => initiate(0xC0, mux, crc, size),
            Self::UploadEnd(end) => end.encode(),
        }
    }
}

impl BlockAck {
    const fn encode(self) -> [u8; 8] {
        [0xA2, self.last_good, self.size, 0, 0, 0, 0, 0]
    }
}

impl BlockEnd {
    const fn decode(bytes: [u8; 8]) -> Self {
        Self { unused: bytes[0] >> 2 & 7, crc: u16::from_le_bytes([bytes[1], bytes[2]]) }
    }

    const fn encode(self) -> [u8; 8] {
        let [low, high] = self.crc.to_le_bytes();
        [0xC1 | (self.unused & 7) << 2, low, high, 0, 0, 0, 0, 0]
    }
}

impl BlockSegment {
    /// Decodes the eight bytes of a frame inside a sub-block.
    ///
    /// # Errors
    /// [`Malformed`] when there are not exactly eight.
    pub fn decode(bytes: &[u8]) -> Result<Self, Malformed> {
        let [first, data @ ..] = *bytes
            .first_chunk::<8>()
            .filter(|_| bytes.len() == 8)
            .ok_or(Malformed { expected: (8, 8), got: bytes.len() })?;
        Ok(Self { sequence: first & 0x7F, last: first & 0x80 != 0, data })
    }

    /// The eight bytes.
    pub const fn encode(self) -> [u8; 8] {
        let [a, b, c, d, e, f, g] = self.data;
        [self.sequence & 0x7F | (self.last as u8) << 7, a, b, c, d, e, f, g]
    }

    /// The segment with this number of the sub-block that begins `from` bytes into `data`; `None`
    /// after the last one. Without data there is one empty segment.
    pub fn of(data: &[u8], from: usize, sequence: u8) -> Option<Self> {
        let start = from + 7 * usize::from(sequence.max(1) - 1);
        if start >= data.len().max(1) {
            return None;
        }
        let rest = &data[start.min(data.len())..];
        let len = rest.len().min(7);
        let mut bytes = [0; 7];
        bytes[..len].copy_from_slice(&rest[..len]);
        Some(Self { sequence, last: rest.len() <= 7, data: bytes })
    }
}

impl BlockEnd {
    /// The end of a transfer of `data`; without `with_crc` the checksum stays 0.
    pub fn of(data: &[u8], with_crc: bool) -> Self {
        let unused = match data.len() {
            0 => 7,
            len => (7 - len % 7) % 7,
        };
        Self { unused: unused as u8, crc: if with_crc { crc(data) } else { 0 } }
    }
}

/// The checksum of a block transfer: CRC-16 with polynomial 1021h from 0, not reflected, known as
/// XMODEM (CiA 301, 7.2.4.3.16).
pub fn crc(data: &[u8]) -> u16 {
    data.iter().fold(0, |crc, byte| {
        (0..8).fold(crc ^ u16::from(*byte) << 8, |crc, _| {
            if crc & 0x8000 == 0 { crc << 1 } else { crc << 1 ^ 0x1021 }
        })
    })
}

/// The bit by which both sides say that they know the checksum.
const CRC: u8 = 1 << 2;
/// The bit that says that the size is given.
const SIZE: u8 = 1 << 1;

const fn given(command: u8, bytes: [u8; 4]) -> Option<u32> {
    if command & SIZE == 0 { None } else { Some(u32::from_le_bytes(bytes)) }
}

const fn flag(set: bool, bit: u8) -> u8 {
    if set { bit } else { 0 }
}

fn initiate(specifier: u8, mux: Mux, crc: bool, size: Option<u32>) -> [u8; 8] {
    let [low, high, sub] = mux.bytes();
    let [a, b, c, d] = size.unwrap_or_default().to_le_bytes();
    let command = specifier | flag(crc, CRC) | flag(size.is_some(), SIZE);
    [command, low, high, sub, a, b, c, d]
}

#[cfg(test)]
mod tests {
    use super::super::{Request, Response};
    use super::*;
    use proptest::prelude::*;

    const MUX: Mux = Mux::new(0x1008, 0);

    #[test]
    fn bytes_and_requests() {
        let ack = BlockAck { last_good: 3, size: 127 };
        let end = BlockEnd { unused: 5, crc: 0x31C3 };
        let table = [
            (
                [0xC6, 8, 0x10, 0, 9, 0, 0, 0],
                BlockRequest::Download { mux: MUX, crc: true, size: Some(9) },
            ),
            (
                [0xC0, 8, 0x10, 0, 0, 0, 0, 0],
                BlockRequest::Download { mux: MUX, crc: false, size: None },
            ),
            ([0xD5, 0xC3, 0x31, 0, 0, 0, 0, 0], BlockRequest::DownloadEnd(end)),
            (
                [0xA4, 8, 0x10, 0, 127, 4, 0, 0],
                BlockRequest::Upload { mux: MUX, crc: true, size: 127, threshold: 4 },
            ),
            ([0xA3, 0, 0, 0, 0, 0, 0, 0], BlockRequest::UploadStart),
            ([0xA2, 3, 127, 0, 0, 0, 0, 0], BlockRequest::UploadAck(ack)),
            ([0xA1, 0, 0, 0, 0, 0, 0, 0], BlockRequest::UploadEnd),
        ];
        for (bytes, request) in table {
            assert_eq!(Request::decode(&bytes), Ok(Request::Block(request)));
            assert_eq!(*Request::Block(request).encode(), bytes);
        }
    }

    #[test]
    fn bytes_and_responses() {
        let ack = BlockAck { last_good: 127, size: 1 };
        let end = BlockEnd { unused: 0, crc: 0x1234 };
        let table = [
            (
                [0xA4, 8, 0x10, 0, 127, 0, 0, 0],
                BlockResponse::Download { mux: MUX, crc: true, size: 127 },
            ),
            ([0xA2, 127, 1, 0, 0, 0, 0, 0], BlockResponse::DownloadAck(ack)),
            ([0xA1, 0, 0, 0, 0, 0, 0, 0], BlockResponse::DownloadEnd),
            (
                [0xC2, 8, 0x10, 0, 9, 0, 0, 0],
                BlockResponse::Upload { mux: MUX, crc: false, size: Some(9) },
            ),
            ([0xC1, 0x34, 0x12, 0, 0, 0, 0, 0], BlockResponse::UploadEnd(end)),
        ];
        for (bytes, response) in table {
            assert_eq!(Response::decode(&bytes), Ok(Response::Block(response)));
            assert_eq!(*Response::Block(response).encode(), bytes);
        }
        let undefined = [0xA3, 1, 2, 3, 4, 5, 6, 7];
        assert_eq!(Response::decode(&undefined), Ok(Response::Unknown(undefined)));
    }

    #[test]
    fn the_checksum_of_the_textbook() {
        assert_eq!(crc(b"123456789"), 0x31C3);
        assert_eq!(crc(&[]), 0);
    }

    #[test]
    fn segments_cover_the_data_and_the_end_tells_what_does_not_count() {
        let data: Vec<u8> = (0..15).collect();
        let segment = |sequence| BlockSegment::of(&data, 0, sequence);
        let third = BlockSegment { sequence: 3, last: true, data: [14, 0, 0, 0, 0, 0, 0] };
        assert_eq!(segment(3), Some(third));
        assert_eq!(segment(2).map(|segment| segment.last), Some(false));
        assert_eq!(segment(4), None);
        assert_eq!(BlockSegment::of(&data, 14, 1).map(|segment| segment.data[0]), Some(14));
        assert_eq!(BlockEnd::of(&data, false), BlockEnd { unused: 6, crc: 0 });
        assert_eq!(BlockEnd::of(&data[..14], false).unused, 0);
        let empty = BlockSegment { sequence: 1, last: true, data: [0; 7] };
        assert_eq!(BlockSegment::of(&[], 0, 1), Some(empty));
        assert_eq!(BlockSegment::of(&[], 0, 2), None);
        assert_eq!(BlockEnd::of(&[], true), BlockEnd { unused: 7, crc: 0 });
    }

    proptest! {
        #[test]
        fn round_trip(bytes in proptest::collection::vec(any::<u8>(), 0..=9)) {
            match BlockSegment::decode(&bytes) {
                Ok(segment) => prop_assert_eq!(segment.encode().to_vec(), bytes),
                Err(_) => prop_assert_ne!(bytes.len(), 8),
            }
        }
    }
}
