//! An SDO client without I/O: requests come out, answers and time-outs go in.

mod block;

use std::fmt;

pub use self::block::Mistake;
use self::block::{BlockDownload, BlockUpload};
use super::{Initiate, Request, Response, Segment};
use crate::abort::Abort;
use crate::frame::Data;
use crate::malformed::Malformed;
use crate::mux::Mux;

/// A transfer under way. [`step`](Self::step) consumes it and says what comes next.
#[derive(Clone, Debug)]
pub struct Client {
    state: State,
}

#[derive(Clone, Debug)]
enum State {
    UploadInitiated { mux: Mux },
    UploadingSegments { mux: Mux, toggle: bool, size: Option<u32>, data: Vec<u8> },
    DownloadInitiated { mux: Mux, data: Vec<u8>, segmented: bool },
    DownloadingSegments { mux: Mux, toggle: bool, data: Vec<u8>, sent: usize, last: bool },
    BlockDownload(BlockDownload),
    BlockUpload(BlockUpload),
}

/// How a client begins a download.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Transfer {
    /// All data in the first frame; at most four bytes.
    Expedited,
    /// In segments of seven bytes.
    Segmented,
    /// In blocks of segments.
    Block,
}

impl Transfer {
    /// The protocol that a client chooses for `len` bytes.
    pub const fn usual(len: usize) -> Self {
        match len {
            1..=4 => Self::Expedited,
            _ => Self::Segmented,
        }
    }
}

/// The next action of a transfer.
#[derive(Clone, Debug)]
pub enum Next {
    /// Send these in order, if any, and wait for the next answer.
    Send(Client, Vec<Request>),
    /// Finished: the data of an upload, nothing for a download. When there is a request, send it
    /// to inform the server.
    Done(Vec<u8>, Option<Request>),
    /// Failed. If there is a request, send it to inform the server.
    Failed(Failure, Option<Request>),
}

/// Why a transfer failed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Failure {
    /// The server refused.
    Aborted(Abort),
    /// The server did not answer in time.
    Timeout,
    /// The server broke the protocol: the expected and the actual answer.
    Violation {
        /// The answer that the protocol requires.
        expected: String,
        /// What the server sent.
        got: Response,
    },
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Aborted(code) => write!(f, "refused with {code}"),
            Self::Timeout => f.write_str("no answer"),
            Self::Violation { expected, got } => {
                let bytes = got.encode();
                let bytes: Vec<String> = bytes.iter().map(|byte| format!("{byte:02X}")).collect();
                write!(f, "{} instead of {expected}", bytes.join(" "))
            }
        }
    }
}

impl Client {
    /// More bytes than any object of a device holds: a server that never ends is broken off.
    pub const LONGEST: u32 = 1 << 20;

    /// The address of the transferred object.
    pub const fn mux(&self) -> Mux {
        self.state.mux()
    }

    /// Begins to read `mux`.
    pub const fn upload(mux: Mux) -> (Self, Request) {
        (State::UploadInitiated { mux }.client(), Request::Upload(mux))
    }

    /// Begins to read `mux` in sub-blocks of `block` segments, 1 to 127. When the object has at
    /// most `threshold` bytes, and that is not 0, the server may use the usual protocol.
    pub fn upload_in_blocks(mux: Mux, block: u8, threshold: u8) -> (Self, Request) {
        let (upload, request) = BlockUpload::begin(mux, block, threshold);
        (State::BlockUpload(upload).client(), request)
    }

    /// Begins to write `data` to `mux` in blocks, with a mistake if there is one.
    pub fn download_in_blocks(mux: Mux, data: &[u8], mistake: Option<Mistake>) -> (Self, Request) {
        let (download, request) = BlockDownload::begin(mux, data, mistake);
        (State::BlockDownload(download).client(), request)
    }

    /// Begins to write `data` to `mux`. More than four bytes are never expedited.
    pub fn download(mux: Mux, data: &[u8], transfer: Transfer) -> (Self, Request) {
        if transfer == Transfer::Block {
            return Self::download_in_blocks(mux, data, None);
        }
        let segmented = transfer == Transfer::Segmented || !(1..=4).contains(&data.len());
        let initiate = match segmented {
            true => Initiate::Segmented(u32::try_from(data.len()).ok()),
            false => Initiate::Expedited(Data::new(data)),
        };
        let state = State::DownloadInitiated { mux, data: data.to_vec(), segmented };
        (state.client(), Request::Download(mux, initiate))
    }

    /// Decodes the server's bytes at this point of the transfer.
    ///
    /// # Errors
    /// [`Malformed`] when there are not exactly eight.
    pub fn decode(&self, bytes: &[u8]) -> Result<Response, Malformed> {
        match &self.state {
            State::BlockUpload(upload) if upload.in_sub_block() => {
                Response::decode_in_sub_block(bytes)
            }
            _ => Response::decode(bytes),
        }
    }

    /// The server did not answer in time: the transfer ends, unless all that is missing is the end
    /// of a sub-block.
    pub fn timeout(self) -> Next {
        match self.state {
            State::BlockUpload(upload) => upload.timeout(),
            other => {
                Next::Failed(Failure::Timeout, Some(Request::Abort(other.mux(), Abort::TIMEOUT)))
            }
        }
    }

    /// Takes the server's answer.
    pub fn step(self, answer: Response) -> Next {
        if let Response::Abort(_, code) = answer {
            return Next::Failed(Failure::Aborted(code), None);
        }
        match self.state {
            State::UploadInitiated { mux } => upload_initiated(mux, answer),
            State::UploadingSegments { mux, toggle, size, data } => {
                uploading(mux, toggle, size, data, answer)
            }
            State::DownloadInitiated { mux, data, segmented } => match answer {
                Response::Download(echo) if echo == mux => match segmented {
                    true => send_segment(mux, false, data, 0),
                    false => Next::Done(Vec::new(), None),
                },
                got => violation(mux, format!("the answer to a download of {mux}"), got),
            },
            State::DownloadingSegments { mux, toggle, data, sent, last } => match answer {
                Response::DownloadSegment(echo) if echo == toggle => match last {
                    true => Next::Done(Vec::new(), None),
                    false => send_segment(mux, !toggle, data, sent),
                },
                got => {
                    let expected = format!("a segment answer with toggle {}", u8::from(toggle));
                    let has_toggle = matches!(got, Response::DownloadSegment(_));
                    wrong_segment(mux, expected, got, has_toggle)
                }
            },
            State::BlockDownload(download) => download.step(answer),
            State::BlockUpload(upload) => upload.step(answer),
        }
    }
}

impl State {
    const fn client(self) -> Client {
        Client { state: self }
    }

    const fn mux(&self) -> Mux {
        match self {
            Self::UploadInitiated { mux }
            | Self::UploadingSegments { mux, .. }
            | Self::DownloadInitiated { mux, .. }
            | Self::DownloadingSegments { mux, .. } => *mux,
            Self::BlockDownload(download) => download.mux(),
            Self::BlockUpload(upload) => upload.mux(),
        }
    }
}

fn upload_initiated(mux: Mux, answer: Response) -> Next {
    match answer {
        Response::Upload(echo, Initiate::Expedited(data)) if echo == mux => {
            Next::Done(data.to_vec(), None)
        }
        Response::Upload(echo, Initiate::Unsized(data)) if echo == mux => {
            Next::Done(data.to_vec(), None)
        }
        Response::Upload(echo, Initiate::Segmented(size)) if echo == mux => {
            let state = State::UploadingSegments { mux, toggle: false, size, data: Vec::new() };
            Next::Send(state.client(), vec![Request::UploadSegment(false)])
        }
        got => violation(mux, format!("the answer to an upload of {mux}"), got),
    }
}

fn uploading(
    mux: Mux,
    toggle: bool,
    size: Option<u32>,
    mut data: Vec<u8>,
    answer: Response,
) -> Next {
    let segment = match answer {
        Response::UploadSegment(segment) if segment.toggle == toggle => segment,
        got => {
            let expected = format!("a segment with toggle {}", u8::from(toggle));
            let has_toggle = matches!(got, Response::UploadSegment(_));
            return wrong_segment(mux, expected, got, has_toggle);
        }
    };
    data.extend_from_slice(&segment.data);
    if data.len() > Client::LONGEST as usize {
        return violation(mux, format!("an end before {} bytes", Client::LONGEST), answer);
    }
    let too_long = size.is_some_and(|size| data.len() > size as usize);
    let too_short = segment.last && size.is_some_and(|size| data.len() < size as usize);
    if too_long || too_short {
        let size = size.unwrap_or_default();
        return violation(mux, format!("{size} bytes in all, as announced"), answer);
    }
    if segment.last {
        return Next::Done(data, None);
    }
    let state = State::UploadingSegments { mux, toggle: !toggle, size, data };
    Next::Send(state.client(), vec![Request::UploadSegment(!toggle)])
}

fn send_segment(mux: Mux, toggle: bool, data: Vec<u8>, sent: usize) -> Next {
    let end = data.len().min(sent + 7);
    let last = end == data.len();
    let segment = Segment { toggle, data: Data::new(&data[sent..end]), last };
    let state = State::DownloadingSegments { mux, toggle, data, sent: end, last };
    Next::Send(state.client(), vec![Request::DownloadSegment(segment)])
}

fn violation(mux: Mux, expected: String, got: Response) -> Next {
    broken_off(mux, Abort::COMMAND, expected, got)
}

/// Another answer than the segment that was expected; one that `has_toggle` has the wrong one.
fn wrong_segment(mux: Mux, expected: String, got: Response, has_toggle: bool) -> Next {
    let code = if has_toggle { Abort::TOGGLE } else { Abort::COMMAND };
    broken_off(mux, code, expected, got)
}

fn broken_off(mux: Mux, code: Abort, expected: String, got: Response) -> Next {
    Next::Failed(Failure::Violation { expected, got }, Some(Request::Abort(mux, code)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sdo::block::{BlockAck, BlockEnd, BlockRequest, BlockResponse, BlockSegment};

    const MUX: Mux = Mux::new(0x1008, 0);

    /// The one request that comes next.
    fn sent(next: Next) -> (Client, Request) {
        match next {
            Next::Send(client, requests) if requests.len() == 1 => (client, requests[0]),
            other => panic!("{other:?}"),
        }
    }

    fn segment(toggle: bool, data: &[u8], last: bool) -> Response {
        Response::UploadSegment(Segment { toggle, data: Data::new(data), last })
    }

    #[test]
    fn a_segmented_upload_collects_every_byte() {
        let (client, request) = Client::upload(MUX);
        assert_eq!(request, Request::Upload(MUX));
        let next = client.step(Response::Upload(MUX, Initiate::Segmented(Some(9))));
        let (client, request) = sent(next);
        assert_eq!(request, Request::UploadSegment(false));
        let next = client.step(segment(false, b"DRR460-", false));
        let (client, request) = sent(next);
        assert_eq!(request, Request::UploadSegment(true));
        let next = client.step(segment(true, b"12", true));
        assert!(matches!(&next, Next::Done(data, None) if data == b"DRR460-12"), "{next:?}");
    }

    #[test]
    fn a_segmented_download_sends_every_byte() {
        let (client, request) = Client::download(MUX, b"12345678", Transfer::Segmented);
        assert_eq!(request, Request::Download(MUX, Initiate::Segmented(Some(8))));
        let next = client.step(Response::Download(MUX));
        let (client, Request::DownloadSegment(first)) = sent(next) else { panic!() };
        assert_eq!((&*first.data, first.last), (&b"1234567"[..], false));
        let next = client.step(Response::DownloadSegment(false));
        let (client, Request::DownloadSegment(last)) = sent(next) else { panic!() };
        assert_eq!((&*last.data, last.toggle, last.last), (&b"8"[..], true, true));
        assert!(matches!(client.step(Response::DownloadSegment(true)), Next::Done(..)));
    }

    #[test]
    fn a_server_that_breaks_the_protocol_is_told_and_named() {
        let wrong = [
            Response::Upload(Mux::new(0x1009, 0), Initiate::Expedited(Data::from([1]))),
            Response::Download(MUX),
            Response::Unknown([0xFF; 8]),
        ];
        for got in wrong {
            let next = Client::upload(MUX).0.step(got);
            assert!(
                matches!(&next, Next::Failed(Failure::Violation { .. }, Some(Request::Abort(..)))),
                "{next:?}"
            );
        }
        let next = Client::upload(MUX).0.step(Response::Upload(MUX, Initiate::Segmented(Some(1))));
        let (client, _) = sent(next);
        assert!(matches!(client.step(segment(false, &[1, 2], true)), Next::Failed(..)));
    }

    #[test]
    fn a_wrong_toggle_bit_has_an_abort_code_of_its_own() {
        let uploading = || {
            let begun = Response::Upload(MUX, Initiate::Segmented(None));
            sent(Client::upload(MUX).0.step(begun)).0
        };
        let downloading = || {
            let client = Client::download(MUX, &[0; 9], Transfer::Segmented).0;
            sent(client.step(Response::Download(MUX))).0
        };
        for (client, answer, code) in [
            (uploading(), segment(true, &[1], true), Abort::TOGGLE),
            (uploading(), Response::DownloadSegment(false), Abort::COMMAND),
            (downloading(), Response::DownloadSegment(true), Abort::TOGGLE),
            (downloading(), segment(false, &[1], true), Abort::COMMAND),
        ] {
            match client.step(answer) {
                Next::Failed(_, told) => assert_eq!(told, Some(Request::Abort(MUX, code))),
                other => panic!("{other:?}"),
            }
        }
    }

    #[test]
    fn refusals_and_silence_are_different() {
        let refused = Client::upload(MUX).0.step(Response::Abort(MUX, Abort::NO_OBJECT));
        assert!(matches!(refused, Next::Failed(Failure::Aborted(Abort::NO_OBJECT), None)));
        assert!(matches!(
            Client::upload(MUX).0.timeout(),
            Next::Failed(Failure::Timeout, Some(Request::Abort(_, Abort::TIMEOUT)))
        ));
    }

    /// Plays the server of a block upload of `data` that loses the segments `lose` of each
    /// sub-block while `losses` last, and returns the client's result.
    fn block_upload(data: &[u8], block: u8, lose: u8, mut losses: u32) -> Next {
        let (client, request) = Client::upload_in_blocks(MUX, block, 0);
        let asked = BlockRequest::Upload { mux: MUX, crc: true, size: block, threshold: 0 };
        assert_eq!(request, Request::Block(asked));
        let accepted = BlockResponse::Upload { mux: MUX, crc: true, size: Some(data.len() as u32) };
        let (mut client, request) = sent(client.step(Response::Block(accepted)));
        assert_eq!(request, Request::Block(BlockRequest::UploadStart));
        let mut from = 0;
        loop {
            let mut ack = None;
            for sequence in 1..=block {
                let Some(segment) = BlockSegment::of(data, from, sequence) else { break };
                if sequence == lose && losses > 0 {
                    losses -= 1;
                    continue;
                }
                let answer = client.decode(&segment.encode()).unwrap();
                match client.step(answer) {
                    Next::Send(next, requests) => {
                        client = next;
                        ack = ack.or_else(|| requests.first().copied());
                    }
                    other => return other,
                }
            }
            if ack.is_none() {
                match client.timeout() {
                    Next::Send(next, requests) => (client, ack) = (next, Some(requests[0])),
                    other => return other,
                }
            }
            let Some(Request::Block(BlockRequest::UploadAck(ack))) = ack else { panic!("{ack:?}") };
            assert_eq!(ack.size, block);
            let next = BlockSegment::of(data, from, ack.last_good);
            from += 7 * usize::from(ack.last_good);
            if next.is_some_and(|segment| segment.last) {
                let end = BlockResponse::UploadEnd(BlockEnd::of(data, true));
                return client.step(Response::Block(end));
            }
        }
    }

    #[test]
    fn a_block_upload_collects_every_byte_whatever_gets_lost() {
        let data: Vec<u8> = (0..=255).cycle().take(889).collect();
        for (len, block) in [(0, 1), (1, 127), (7, 2), (8, 1), (15, 2), (889, 127), (889, 126)] {
            for lose in [0, 1, 2, block] {
                // If no segment of a sub-block arrives, the server is gone.
                if lose == 1 && (block == 1 || len <= 7) {
                    continue;
                }
                let next = block_upload(&data[..len], block, lose, 2);
                let Next::Done(got, Some(Request::Block(BlockRequest::UploadEnd))) = next else {
                    panic!("{len} {block} {lose}: {next:?}")
                };
                assert_eq!(got, data[..len], "{len} {block} {lose}");
            }
        }
    }

    #[test]
    fn a_block_upload_is_broken_off_for_a_wrong_checksum_size_or_sequence() {
        let begin = |size| {
            let accepted = BlockResponse::Upload { mux: MUX, crc: true, size };
            let (client, _) = Client::upload_in_blocks(MUX, 2, 0);
            sent(client.step(Response::Block(accepted))).0
        };
        let last = Response::BlockSegment(BlockSegment { sequence: 1, last: true, data: [7; 7] });
        let end = |unused, crc| Response::Block(BlockResponse::UploadEnd(BlockEnd { unused, crc }));
        let told = |next: Next| match next {
            Next::Failed(Failure::Violation { .. }, Some(Request::Abort(_, code))) => code,
            other => panic!("{other:?}"),
        };
        let ended = |size, unused, crc| told(sent(begin(size).step(last)).0.step(end(unused, crc)));
        assert_eq!(ended(None, 0, 1), Abort::CRC);
        assert_eq!(ended(Some(6), 0, 0), Abort::TOO_LONG);
        assert_eq!(ended(Some(7), 1, 0), Abort::TOO_SHORT);
        for sequence in [0, 3] {
            let wrong = BlockSegment { sequence, last: false, data: [0; 7] };
            assert_eq!(told(begin(None).step(Response::BlockSegment(wrong))), Abort::SEQUENCE);
        }
        let switched = Response::Upload(MUX, Initiate::Expedited(Data::from([1])));
        assert_eq!(told(Client::upload_in_blocks(MUX, 2, 0).0.step(switched)), Abort::COMMAND);
        let next = Client::upload_in_blocks(MUX, 2, 4).0.step(switched);
        assert!(matches!(&next, Next::Done(data, None) if *data == [1]), "{next:?}");
        assert!(matches!(begin(None).timeout(), Next::Failed(Failure::Timeout, _)));
    }

    #[test]
    fn a_block_upload_that_never_begins_is_given_up() {
        let data = [7; 20];
        for block in [2, 127] {
            let next = block_upload(&data, block, 1, u32::MAX);
            let Next::Failed(_, Some(Request::Abort(MUX, code))) = next else { panic!("{next:?}") };
            assert_eq!(code, Abort::SEQUENCE);
        }
    }

    #[test]
    fn a_block_download_follows_the_block_size_and_sends_again_what_was_lost() {
        let data: Vec<u8> = (0..30).collect();
        let ack = |last_good, size| {
            Response::Block(BlockResponse::DownloadAck(BlockAck { last_good, size }))
        };
        let segments = |next: Next| match next {
            Next::Send(client, requests) => {
                let bytes: Vec<[u8; 2]> =
                    requests.iter().map(|r| [r.encode()[0], r.encode()[1]]).collect();
                (client, bytes)
            }
            other => panic!("{other:?}"),
        };
        let (client, request) = Client::download(MUX, &data, Transfer::Block);
        let asked = BlockRequest::Download { mux: MUX, crc: true, size: Some(30) };
        assert_eq!(request, Request::Block(asked));
        let accepted = BlockResponse::Download { mux: MUX, crc: true, size: 2 };
        let (client, sent_now) = segments(client.step(Response::Block(accepted)));
        assert_eq!(sent_now, [[1, 0], [2, 7]]);
        let (client, sent_now) = segments(client.step(ack(1, 3)));
        assert_eq!(sent_now, [[1, 7], [2, 14], [3, 21]]);
        let (client, sent_now) = segments(client.step(ack(3, 127)));
        assert_eq!(sent_now, [[0x81, 28]]);
        let (client, end) = sent(client.step(ack(1, 127)));
        assert_eq!(end, Request::Block(BlockRequest::DownloadEnd(BlockEnd::of(&data, true))));
        let done = client.step(Response::Block(BlockResponse::DownloadEnd));
        assert!(matches!(done, Next::Done(_, None)), "{done:?}");
    }

    #[test]
    fn a_client_makes_its_mistake_once() {
        let ack = |last_good| {
            let size = 3;
            Response::Block(BlockResponse::DownloadAck(BlockAck { last_good, size }))
        };
        let begin = |mistake| {
            let accepted = BlockResponse::Download { mux: MUX, crc: true, size: 3 };
            let (client, _) = Client::download_in_blocks(MUX, &[7; 15], Some(mistake));
            client.step(Response::Block(accepted))
        };
        let numbers = |next: Next| match next {
            Next::Send(client, requests) => {
                let number = |request: &Request| match request {
                    Request::BlockSegment(segment) => segment.sequence,
                    _ => 0,
                };
                (client, requests.iter().map(number).collect::<Vec<_>>())
            }
            other => panic!("{other:?}"),
        };
        let (client, sent) = numbers(begin(Mistake::LostSegment));
        assert_eq!(sent, [2, 3]);
        let taken = client.clone().step(ack(3));
        assert!(matches!(&taken, Next::Failed(Failure::Violation { .. }, _)), "{taken:?}");
        let (_, sent) = numbers(client.step(ack(0)));
        assert_eq!(sent, [1, 2, 3]);
        let (client, sent) = numbers(begin(Mistake::LaterSegmentsLost));
        assert_eq!(sent, [1, 2, 3]);
        let (client, sent) = numbers(client.step(ack(0)));
        assert_eq!(sent, [1, 3]);
        let (client, sent) = numbers(client.step(ack(0)));
        assert_eq!(sent, [1, 3]);
        let (_, sent) = numbers(client.step(ack(0)));
        assert_eq!(sent, [1, 2, 3]);
        let (client, sent) = numbers(begin(Mistake::RepeatedSegment));
        assert_eq!(sent, [1, 1, 2, 3]);
        let (_, sent) = numbers(client.step(ack(1)));
        assert_eq!(sent, [1, 2]);
        let (client, sent) = numbers(begin(Mistake::WrongChecksum));
        assert_eq!(sent, [1, 2, 3]);
        let Next::Send(_, end) = client.step(ack(3)) else { panic!("no end") };
        let Request::Block(BlockRequest::DownloadEnd(end)) = end[0] else { panic!("{end:?}") };
        assert_eq!(end.crc, !BlockEnd::of(&[7; 15], true).crc);
    }

    #[test]
    fn a_block_download_is_broken_off_for_what_a_server_must_not_say() {
        let ack = |last_good, size| {
            Response::Block(BlockResponse::DownloadAck(BlockAck { last_good, size }))
        };
        let begin = |size| {
            let accepted = BlockResponse::Download { mux: MUX, crc: false, size };
            Client::download(MUX, &[0; 30], Transfer::Block).0.step(Response::Block(accepted))
        };
        let told = |next: Next| match next {
            Next::Failed(Failure::Violation { .. }, Some(Request::Abort(_, code))) => code,
            other => panic!("{other:?}"),
        };
        let open = || match begin(2) {
            Next::Send(client, _) => client,
            other => panic!("{other:?}"),
        };
        assert_eq!(told(begin(0)), Abort::BLOCK_SIZE);
        assert_eq!(told(begin(128)), Abort::BLOCK_SIZE);
        assert_eq!(told(open().step(ack(3, 2))), Abort::SEQUENCE);
        assert_eq!(told(open().step(ack(2, 0))), Abort::BLOCK_SIZE);
        assert_eq!(told(open().step(Response::Download(MUX))), Abort::COMMAND);
        let mut client = open();
        for _ in 0..MOST_TRIES {
            match client.step(ack(0, 2)) {
                Next::Send(next, _) => client = next,
                failed => return assert_eq!(told(failed), Abort::SEQUENCE),
            }
        }
        panic!("it never gives up");
    }

    const MOST_TRIES: usize = 10;
}
