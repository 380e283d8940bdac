//! The client in a block transfer.

use super::{Failure, Next, State};
use crate::abort::Abort;
use crate::mux::Mux;
use crate::sdo::block::{
    BlockAck, BlockEnd, BlockRequest, BlockResponse, BlockSegment, LARGEST_BLOCK, crc,
};
use crate::sdo::{Request, Response};

/// A download in blocks.
#[derive(Clone, Debug)]
pub(super) struct BlockDownload {
    mux: Mux,
    data: Vec<u8>,
    /// Both sides know the checksum.
    crc: bool,
    /// How many bytes are confirmed.
    confirmed: usize,
    /// How many segments the last sub-block had.
    sent: u8,
    /// Whether the last of them was the last of the transfer.
    last: bool,
    /// Sub-blocks in a row of which nothing arrived.
    lost: u32,
    /// The last segment of the sub-block that can have arrived in order.
    arrived: u8,
    /// How many sub-blocks were sent.
    blocks: u32,
    /// What the client does wrong.
    mistake: Option<Mistake>,
    waits_for: Answer,
}

/// What a client does wrong in a block download. That of a segment needs a sub-block of two
/// segments at least, and a later segment one of three.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mistake {
    /// The first segment is not sent before it is missed.
    LostSegment,
    /// The second segment of the second sub-block is not sent before it is missed, nor is that of
    /// the sub-block after it.
    LaterSegmentsLost,
    /// The first segment is sent twice.
    RepeatedSegment,
    /// The checksum at the end is not that of the data.
    WrongChecksum,
}

impl Mistake {
    /// Whether it is made in the sub-block of that number, which has so many segments.
    fn is_due(self, block: u32, segments: usize) -> bool {
        match self {
            Self::LostSegment | Self::RepeatedSegment => block == 1 && segments > 1,
            Self::LaterSegmentsLost => matches!(block, 2 | 3) && segments > 2,
            Self::WrongChecksum => false,
        }
    }
}

#[derive(Clone, Copy, Debug)]
enum Answer {
    Initiate,
    Ack,
    End,
}

impl BlockDownload {
    pub(super) fn begin(mux: Mux, data: &[u8], mistake: Option<Mistake>) -> (Self, Request) {
        let size = u32::try_from(data.len()).ok();
        let request = Request::Block(BlockRequest::Download { mux, crc: true, size });
        let download = Self {
            mux,
            data: data.to_vec(),
            crc: false,
            confirmed: 0,
            sent: 0,
            last: false,
            lost: 0,
            arrived: 0,
            blocks: 0,
            mistake,
            waits_for: Answer::Initiate,
        };
        (download, request)
    }

    pub(super) fn step(mut self, answer: Response) -> Next {
        match (self.waits_for, answer) {
            (Answer::Initiate, Response::Block(BlockResponse::Download { mux, crc, size }))
                if mux == self.mux =>
            {
                self.crc = crc;
                self.send_block(size, answer)
            }
            (Answer::Ack, Response::Block(BlockResponse::DownloadAck(ack))) => {
                self.acknowledged(ack, answer)
            }
            (Answer::End, Response::Block(BlockResponse::DownloadEnd)) => {
                Next::Done(Vec::new(), None)
            }
            (Answer::Initiate, got) => {
                let expected = format!("the answer to a block download of {}", self.mux);
                failed(self.mux, Abort::COMMAND, expected, got)
            }
            (Answer::Ack, got) => {
                let expected = "the confirmation of a sub-block".to_owned();
                failed(self.mux, Abort::COMMAND, expected, got)
            }
            (Answer::End, got) => {
                let expected = "the confirmation of the end".to_owned();
                failed(self.mux, Abort::COMMAND, expected, got)
            }
        }
    }

    fn acknowledged(mut self, ack: BlockAck, answer: Response) -> Next {
        if ack.last_good > self.arrived {
            let expected = format!("a confirmation of at most segment {}", self.arrived);
            return failed(self.mux, Abort::SEQUENCE, expected, answer);
        }
        if ack.last_good == self.sent && self.last {
            self.waits_for = Answer::End;
            let mut end = BlockEnd::of(&self.data, self.crc);
            if self.mistake == Some(Mistake::WrongChecksum) {
                end.crc = !end.crc;
            }
            let request = Request::Block(BlockRequest::DownloadEnd(end));
            return Next::Send(State::BlockDownload(self).client(), vec![request]);
        }
        self.confirmed += 7 * usize::from(ack.last_good);
        self.lost = if ack.last_good == 0 { self.lost + 1 } else { 0 };
        if self.lost > MOST_LOST {
            let expected = "a segment to arrive at last".to_owned();
            return failed(self.mux, Abort::SEQUENCE, expected, answer);
        }
        self.send_block(ack.size, answer)
    }

    fn send_block(mut self, size: u8, answer: Response) -> Next {
        if !(1..=LARGEST_BLOCK).contains(&size) {
            let expected = format!("a block size of 1 to {LARGEST_BLOCK}");
            return failed(self.mux, Abort::BLOCK_SIZE, expected, answer);
        }
        let mut segments: Vec<BlockSegment> = (1..=size)
            .map_while(|sequence| BlockSegment::of(&self.data, self.confirmed, sequence))
            .collect();
        self.sent = segments.len() as u8;
        self.last = segments.last().is_some_and(|segment| segment.last);
        self.arrived = self.sent;
        self.blocks += 1;
        match self.mistake.filter(|mistake| mistake.is_due(self.blocks, segments.len())) {
            Some(Mistake::LostSegment) => {
                segments.remove(0);
                self.arrived = 0;
            }
            Some(Mistake::LaterSegmentsLost) => {
                segments.remove(1);
                self.arrived = 1;
            }
            Some(Mistake::RepeatedSegment) => segments.insert(0, segments[0]),
            Some(Mistake::WrongChecksum) | None => {}
        }
        self.waits_for = Answer::Ack;
        let requests = segments.into_iter().map(Request::BlockSegment).collect();
        Next::Send(State::BlockDownload(self).client(), requests)
    }

    pub(super) const fn mux(&self) -> Mux {
        self.mux
    }
}

/// An upload in blocks.
#[derive(Clone, Debug)]
pub(super) struct BlockUpload {
    mux: Mux,
    /// Segments of a sub-block.
    block: u8,
    threshold: u8,
    /// Both sides know the checksum.
    crc: bool,
    /// As announced.
    announced: Option<u32>,
    data: Vec<u8>,
    /// The last segment of this sub-block that arrived in order.
    good: u8,
    /// Whether something came since the last confirmation.
    heard: bool,
    /// The number of sub-blocks in a row without a segment in order.
    lost: u32,
    phase: Phase,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    Initiated,
    Segments,
    End,
}

impl BlockUpload {
    pub(super) fn begin(mux: Mux, block: u8, threshold: u8) -> (Self, Request) {
        let request = BlockRequest::Upload { mux, crc: true, size: block, threshold };
        let upload = Self {
            mux,
            block,
            threshold,
            crc: false,
            announced: None,
            data: Vec::new(),
            good: 0,
            heard: false,
            lost: 0,
            phase: Phase::Initiated,
        };
        (upload, Request::Block(request))
    }

    pub(super) fn in_sub_block(&self) -> bool {
        self.phase == Phase::Segments
    }

    pub(super) fn step(mut self, answer: Response) -> Next {
        match (self.phase, answer) {
            (Phase::Initiated, Response::Block(BlockResponse::Upload { mux, crc, size }))
                if mux == self.mux =>
            {
                (self.crc, self.announced, self.phase) = (crc, size, Phase::Segments);
                self.go_on(BlockRequest::UploadStart)
            }
            (Phase::Initiated, Response::Upload(..)) if self.threshold > 0 => {
                super::upload_initiated(self.mux, answer)
            }
            (Phase::Segments, Response::BlockSegment(segment)) => self.segment(segment, answer),
            (Phase::End, Response::Block(BlockResponse::UploadEnd(end))) => self.ended(end, answer),
            (Phase::Initiated, got) => {
                let expected = format!("the answer to a block upload of {}", self.mux);
                failed(self.mux, Abort::COMMAND, expected, got)
            }
            (Phase::Segments, got) => failed(self.mux, Abort::COMMAND, "a segment".to_owned(), got),
            (Phase::End, got) => {
                let expected = "the end of the block upload".to_owned();
                failed(self.mux, Abort::COMMAND, expected, got)
            }
        }
    }

    fn segment(mut self, segment: BlockSegment, answer: Response) -> Next {
        self.heard = true;
        let BlockSegment { sequence, last, data } = segment;
        if !(1..=self.block).contains(&sequence) {
            let expected = format!("a sequence number of 1 to {}", self.block);
            return failed(self.mux, Abort::SEQUENCE, expected, answer);
        }
        let taken = sequence == self.good + 1;
        if taken {
            self.good = sequence;
            self.data.extend_from_slice(&data);
            if self.data.len() > super::Client::LONGEST as usize + 7 {
                let expected = format!("an end before {} bytes", super::Client::LONGEST);
                return failed(self.mux, Abort::MEMORY, expected, answer);
            }
        }
        if taken && last {
            self.phase = Phase::End;
        } else if !last && sequence != self.block {
            return Next::Send(State::BlockUpload(self).client(), Vec::new());
        }
        self.confirm().unwrap_or_else(|mux| {
            let expected = "the first segment to arrive at last".to_owned();
            failed(mux, Abort::SEQUENCE, expected, answer)
        })
    }

    /// Confirms the segments that arrived in order and asks for the rest.
    ///
    /// # Errors
    /// The object, when sub-block after sub-block brings nothing in order.
    fn confirm(mut self) -> Result<Next, Mux> {
        self.lost = if self.good == 0 { self.lost + 1 } else { 0 };
        if self.lost > MOST_LOST {
            return Err(self.mux);
        }
        let ack = BlockAck { last_good: self.good, size: self.block };
        (self.good, self.heard) = (0, false);
        Ok(self.go_on(BlockRequest::UploadAck(ack)))
    }

    /// The end of a sub-block got lost when something came before: then what came is confirmed.
    pub(super) fn timeout(self) -> Next {
        let given_up =
            |mux| Next::Failed(Failure::Timeout, Some(Request::Abort(mux, Abort::TIMEOUT)));
        match self.heard {
            true => self.confirm().unwrap_or_else(given_up),
            false => given_up(self.mux),
        }
    }

    fn ended(mut self, end: BlockEnd, answer: Response) -> Next {
        let len = self.data.len().saturating_sub(usize::from(end.unused));
        self.data.truncate(len);
        if let Some(size) = self.announced.filter(|size| *size as usize != len) {
            let code = if len > size as usize { Abort::TOO_LONG } else { Abort::TOO_SHORT };
            let expected = format!("{size} bytes in all, as announced, and not {len}");
            return failed(self.mux, code, expected, answer);
        }
        if self.crc && crc(&self.data) != end.crc {
            let expected = format!("checksum {:04X}h", crc(&self.data));
            return failed(self.mux, Abort::CRC, expected, answer);
        }
        Next::Done(self.data, Some(Request::Block(BlockRequest::UploadEnd)))
    }

    fn go_on(self, request: BlockRequest) -> Next {
        Next::Send(State::BlockUpload(self).client(), vec![Request::Block(request)])
    }

    pub(super) const fn mux(&self) -> Mux {
        self.mux
    }
}

/// The number of sub-blocks in a row that may get lost.
const MOST_LOST: u32 = 3;

fn failed(mux: Mux, code: Abort, expected: String, got: Response) -> Next {
    Next::Failed(Failure::Violation { expected, got }, Some(Request::Abort(mux, code)))
}
