//! The requests of a client.

use super::REQUEST_COB_ID;
use super::block::{BlockRequest, BlockSegment};
use super::initiate::{Initiate, Segment};
use crate::abort::Abort;
use crate::frame::{Data, Frame};
use crate::malformed::Malformed;
use crate::mux::Mux;

/// A client's request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request {
    /// Download segment (command specifier 0).
    DownloadSegment(Segment),
    /// Initiate download (1).
    Download(Mux, Initiate),
    /// Initiate upload (2).
    Upload(Mux),
    /// Upload segment (3) with its toggle bit.
    UploadSegment(bool),
    /// Abort transfer (4).
    Abort(Mux, Abort),
    /// Block transfer (5 and 6), outside sub-blocks.
    Block(BlockRequest),
    /// A segment of a sub-block; see [`decode_in_sub_block`](Self::decode_in_sub_block).
    BlockSegment(BlockSegment),
    /// Any other command, all eight bytes as they came.
    Unknown([u8; 8]),
}

/// The object and the value of an expedited download that a frame requests of the default server of
/// `node`.
pub fn written(frame: &Frame, node: u8) -> Option<(Mux, Data)> {
    const DOWNLOAD: u8 = 1;
    frame.data_id().filter(|id| *id == REQUEST_COB_ID + u16::from(node))?;
    // Most requests are none: one look at the command tells.
    frame.data.first().filter(|command| **command >> 5 == DOWNLOAD)?;
    match Request::decode(&frame.data).ok()? {
        Request::Download(mux, Initiate::Expedited(value)) => Some((mux, value)),
        _ => None,
    }
}

impl Request {
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
            0 => Self::DownloadSegment(Segment::decode(bytes)),
            1 => Self::Download(mux, Initiate::decode(bytes[0], rest)),
            2 => Self::Upload(mux),
            3 => Self::UploadSegment(bytes[0] & 0x10 != 0),
            4 => Self::Abort(mux, Abort(u32::from_le_bytes(rest))),
            5 | 6 => Self::Block(BlockRequest::decode(bytes)),
            _ => Self::Unknown(bytes),
        })
    }

    /// Decodes the bytes while the server waits for segments of a block download. The first byte is
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

    /// Encodes the request; reserved bits and bytes are zero.
    pub fn encode(self) -> Data {
        let with_mux = |command: u8, mux: Mux, rest: [u8; 4]| {
            let [low, high, sub] = mux.bytes();
            let [a, b, c, d] = rest;
            [command, low, high, sub, a, b, c, d]
        };
        Data::from(match self {
            Self::DownloadSegment(segment) => segment.encode(0),
            Self::Download(mux, initiate) => {
                let (bits, rest) = initiate.encode();
                with_mux(0x20 | bits, mux, rest)
            }
            Self::Upload(mux) => with_mux(0x40, mux, [0; 4]),
            Self::UploadSegment(toggle) => [0x60 | u8::from(toggle) << 4, 0, 0, 0, 0, 0, 0, 0],
            Self::Abort(mux, code) => with_mux(0x80, mux, code.0.to_le_bytes()),
            Self::Block(block) => block.encode(),
            Self::BlockSegment(segment) => segment.encode(),
            Self::Unknown(bytes) => bytes,
        })
    }

    /// The whole frame to the default server of node `node`.
    pub fn frame(self, node: u8) -> Frame {
        Frame::new(REQUEST_COB_ID + u16::from(node & 0x7F), self.encode())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn bytes_and_requests() {
        let mux = Mux::new(0x1017, 0);
        let segment = |toggle, data: &[u8], last| Segment { toggle, data: Data::new(data), last };
        let table = [
            ([0x40, 0x17, 0x10, 0, 0, 0, 0, 0], Request::Upload(mux)),
            (
                [0x2B, 0x17, 0x10, 0, 0xE8, 3, 0, 0],
                Request::Download(mux, Initiate::Expedited(Data::from([0xE8, 3]))),
            ),
            (
                [0x22, 0x17, 0x10, 0, 1, 2, 3, 4],
                Request::Download(mux, Initiate::Unsized([1, 2, 3, 4])),
            ),
            (
                [0x21, 0x17, 0x10, 0, 20, 0, 0, 0],
                Request::Download(mux, Initiate::Segmented(Some(20))),
            ),
            ([0x20, 0x17, 0x10, 0, 0, 0, 0, 0], Request::Download(mux, Initiate::Segmented(None))),
            (
                [0x00, 1, 2, 3, 4, 5, 6, 7],
                Request::DownloadSegment(segment(false, &[1, 2, 3, 4, 5, 6, 7], false)),
            ),
            ([0x1D, 9, 0, 0, 0, 0, 0, 0], Request::DownloadSegment(segment(true, &[9], true))),
            ([0x70, 0, 0, 0, 0, 0, 0, 0], Request::UploadSegment(true)),
            ([0x80, 0x17, 0x10, 0, 0, 0, 4, 5], Request::Abort(mux, Abort::TIMEOUT)),
            ([0xE0, 1, 2, 3, 4, 5, 6, 7], Request::Unknown([0xE0, 1, 2, 3, 4, 5, 6, 7])),
        ];
        for (bytes, request) in table {
            assert_eq!(Request::decode(&bytes), Ok(request));
            assert_eq!(*request.encode(), bytes);
        }
    }

    proptest! {
        #[test]
        fn round_trip(bytes in proptest::collection::vec(any::<u8>(), 0..=8)) {
            match Request::decode(&bytes) {
                Ok(request) => prop_assert_eq!(Request::decode(&request.encode()), Ok(request)),
                Err(_) => prop_assert_ne!(bytes.len(), 8),
            }
        }
    }
}
