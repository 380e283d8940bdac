//! The responses of a server.

use super::block::{BlockResponse, BlockSegment};
use super::initiate::{Initiate, Segment};
use crate::abort::Abort;
use crate::frame::{Data, Frame};
use crate::malformed::Malformed;
use crate::mux::Mux;

/// A server's answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Response {
    /// Upload segment (command specifier 0).
    UploadSegment(Segment),
    /// Download segment (1) with its toggle bit.
    DownloadSegment(bool),
    /// Initiate upload (2).
    Upload(Mux, Initiate),
    /// Initiate download (3).
    Download(Mux),
    /// Abort transfer (4).
    Abort(Mux, Abort),
    /// Block transfer (5 and 6), outside sub-blocks.
    Block(BlockResponse),
    /// A segment of a sub-block; see [`decode_in_sub_block`](Self::decode_in_sub_block).
    BlockSegment(BlockSegment),
    /// Any other command, all eight bytes as they came.
    Unknown([u8; 8]),
}

impl Response {
    /// Decodes the bytes. Reserved bits and bytes are ignored.
    ///
    /// # Errors
    /// [`Malformed`] when there are not exactly eight.
    pub fn decode(bytes: &[u8]) -> Result<Self, Malformed> {
        Malformed::unless(bytes, 8, 8)?;
        let bytes = Data::new(bytes).padded();
        let mux = Mux::from_bytes([bytes[1], bytes[2], bytes[3]]);
        let rest = [bytes[4], bytes[5], bytes[6], bytes[7]];
        Ok(match bytes[0] >> 5 {
            0 => Self::UploadSegment(Segment::decode(bytes)),
            1 => Self::DownloadSegment(bytes[0] & 0x10 != 0),
            2 => Self::Upload(mux, Initiate::decode(bytes[0], rest)),
            3 => Self::Download(mux),
            4 => Self::Abort(mux, Abort(u32::from_le_bytes(rest))),
            5 | 6 => BlockResponse::decode(bytes).map_or(Self::Unknown(bytes), Self::Block),
            _ => Self::Unknown(bytes),
        })
    }

    /// Decodes the bytes while the client waits for segments of a block upload. The first byte is
    /// then a sequence number. Only 80h, which cannot be one, is still a command: abort.
    ///
    /// # Errors
    /// [`Malformed`] when there are not exactly eight.
    pub fn decode_in_sub_block(bytes: &[u8]) -> Result<Self, Malformed> {
        match bytes.first() {
            Some(0x80) => Self::decode(bytes),
            _ => BlockSegment::decode(bytes).map(Self::BlockSegment),
        }
    }

    /// Encodes the response; reserved bits and bytes are zero.
    pub fn encode(self) -> Data {
        let with_mux = |command: u8, mux: Mux, rest: [u8; 4]| {
            let [low, high, sub] = mux.bytes();
            let [a, b, c, d] = rest;
            [command, low, high, sub, a, b, c, d]
        };
        Data::from(match self {
            Self::UploadSegment(segment) => segment.encode(0),
            Self::DownloadSegment(toggle) => [0x20 | u8::from(toggle) << 4, 0, 0, 0, 0, 0, 0, 0],
            Self::Upload(mux, initiate) => {
                let (bits, rest) = initiate.encode();
                with_mux(0x40 | bits, mux, rest)
            }
            Self::Download(mux) => with_mux(0x60, mux, [0; 4]),
            Self::Abort(mux, code) => with_mux(0x80, mux, code.0.to_le_bytes()),
            Self::Block(block) => block.encode(),
            Self::BlockSegment(segment) => segment.encode(),
            Self::Unknown(bytes) => bytes,
        })
    }

    /// The whole frame from the default server of node `node`.
    pub fn frame(self, node: u8) -> Frame {
        Frame::new(super::RESPONSE_COB_ID + u16::from(node & 0x7F), self.encode())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn bytes_and_responses() {
        let mux = Mux::new(0x1008, 0);
        let segment = Segment { toggle: true, data: Data::from(*b"60"), last: true };
        let table = [
            (
                [0x43, 0x08, 0x10, 0, b'M', b'2', b'6', b'0'],
                Response::Upload(mux, Initiate::Expedited(Data::from(*b"M260"))),
            ),
            (
                [0x41, 0x08, 0x10, 0, 9, 0, 0, 0],
                Response::Upload(mux, Initiate::Segmented(Some(9))),
            ),
            ([0x1B, b'6', b'0', 0, 0, 0, 0, 0], Response::UploadSegment(segment)),
            ([0x60, 0x08, 0x10, 0, 0, 0, 0, 0], Response::Download(mux)),
            ([0x30, 0, 0, 0, 0, 0, 0, 0], Response::DownloadSegment(true)),
            ([0x80, 0x08, 0x10, 0, 2, 0, 1, 6], Response::Abort(mux, Abort::READ_ONLY)),
            ([0xE0, 1, 2, 3, 4, 5, 6, 7], Response::Unknown([0xE0, 1, 2, 3, 4, 5, 6, 7])),
        ];
        for (bytes, response) in table {
            assert_eq!(Response::decode(&bytes), Ok(response));
            assert_eq!(*response.encode(), bytes);
        }
    }

    proptest! {
        #[test]
        fn round_trip(bytes in proptest::collection::vec(any::<u8>(), 0..=8)) {
            match Response::decode(&bytes) {
                Ok(response) => prop_assert_eq!(Response::decode(&response.encode()), Ok(response)),
                Err(_) => prop_assert_ne!(bytes.len(), 8),
            }
        }
    }
}
