//! An SDO client without I/O: requests come out, answers and time-outs go in.

use std::fmt;

use super::{Initiate, Request, Response, Segment};
use crate::abort::Abort;
use crate::frame::Data;
use crate::mux::Mux;

/// A transfer under way. [`step`](Self::step) consumes it and says what comes next.
#[derive(Clone, Debug)]
pub struct Client {
    mux: Mux,
    state: State,
}

#[derive(Clone, Debug)]
enum State {
    UploadInitiated,
    UploadingSegments { toggle: bool, size: Option<u32>, data: Vec<u8> },
    DownloadInitiated { data: Vec<u8>, segmented: bool },
    DownloadingSegments { toggle: bool, data: Vec<u8>, sent: usize, last: bool },
}

/// How a client begins a download.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Transfer {
    /// All data in the first frame; at most four bytes.
    Expedited,
    /// In segments of seven bytes.
    Segmented,
}

impl Transfer {
    /// What a client chooses for `len` bytes.
    pub const fn usual(len: usize) -> Self {
        match len {
            1..=4 => Self::Expedited,
            _ => Self::Segmented,
        }
    }
}

/// What a transfer does next.
#[derive(Clone, Debug)]
pub enum Next {
    /// Send this and wait for the answer.
    Send(Client, Request),
    /// Finished: the data of an upload, nothing for a download.
    Done(Vec<u8>),
    /// Failed. When there is a request, send it to tell the server.
    Failed(Failure, Option<Request>),
}

/// Why a transfer failed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Failure {
    /// The server refused.
    Aborted(Abort),
    /// The server did not answer in time.
    Timeout,
    /// The server broke the protocol: what was expected, and what came.
    Violation {
        /// What the protocol asks for.
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
            Self::Violation { expected, got } => write!(f, "{got:?} instead of {expected}"),
        }
    }
}

impl Client {
    /// Begins to read `mux`.
    pub const fn upload(mux: Mux) -> (Self, Request) {
        (Self { mux, state: State::UploadInitiated }, Request::Upload(mux))
    }

    /// Begins to write `data` to `mux`. More than four bytes always go in segments.
    pub fn download(mux: Mux, data: &[u8], transfer: Transfer) -> (Self, Request) {
        let segmented = transfer == Transfer::Segmented || !(1..=4).contains(&data.len());
        let initiate = match segmented {
            true => Initiate::Segmented(u32::try_from(data.len()).ok()),
            false => Initiate::Expedited(Data::new(data)),
        };
        let state = State::DownloadInitiated { data: data.to_vec(), segmented };
        (Self { mux, state }, Request::Download(mux, initiate))
    }

    /// The server did not answer in time: the transfer ends.
    pub fn timeout(self) -> Next {
        Next::Failed(Failure::Timeout, Some(Request::Abort(self.mux, Abort::TIMEOUT)))
    }

    /// Takes the server's answer.
    pub fn step(self, answer: Response) -> Next {
        let Self { mux, state } = self;
        if let Response::Abort(_, code) = answer {
            return Next::Failed(Failure::Aborted(code), None);
        }
        match state {
            State::UploadInitiated => upload_initiated(mux, answer),
            State::UploadingSegments { toggle, size, data } => {
                uploading(mux, toggle, size, data, answer)
            }
            State::DownloadInitiated { data, segmented } => match answer {
                Response::Download(echo) if echo == mux => match segmented {
                    true => send_segment(mux, false, data, 0),
                    false => Next::Done(Vec::new()),
                },
                got => violation(mux, format!("the answer to a download of {mux}"), got),
            },
            State::DownloadingSegments { toggle, data, sent, last } => match answer {
                Response::DownloadSegment(echo) if echo == toggle => match last {
                    true => Next::Done(Vec::new()),
                    false => send_segment(mux, !toggle, data, sent),
                },
                got => {
                    let toggle = u8::from(toggle);
                    violation(mux, format!("a segment answer with toggle {toggle}"), got)
                }
            },
        }
    }
}

/// More than any object of a device holds: a server that never ends is broken off.
const LONGEST: usize = 1 << 20;

fn upload_initiated(mux: Mux, answer: Response) -> Next {
    match answer {
        Response::Upload(echo, Initiate::Expedited(data)) if echo == mux => {
            Next::Done(data.to_vec())
        }
        Response::Upload(echo, Initiate::Unsized(data)) if echo == mux => Next::Done(data.to_vec()),
        Response::Upload(echo, Initiate::Segmented(size)) if echo == mux => {
            let state = State::UploadingSegments { toggle: false, size, data: Vec::new() };
            Next::Send(Client { mux, state }, Request::UploadSegment(false))
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
            return violation(mux, format!("a segment with toggle {}", u8::from(toggle)), got);
        }
    };
    data.extend_from_slice(&segment.data);
    if data.len() > LONGEST {
        return violation(mux, format!("an end before {LONGEST} bytes"), answer);
    }
    let too_long = size.is_some_and(|size| data.len() > size as usize);
    let too_short = segment.last && size.is_some_and(|size| data.len() < size as usize);
    if too_long || too_short {
        let size = size.unwrap_or_default();
        return violation(mux, format!("{size} bytes in all, as announced"), answer);
    }
    if segment.last {
        return Next::Done(data);
    }
    let state = State::UploadingSegments { toggle: !toggle, size, data };
    Next::Send(Client { mux, state }, Request::UploadSegment(!toggle))
}

fn send_segment(mux: Mux, toggle: bool, data: Vec<u8>, sent: usize) -> Next {
    let end = data.len().min(sent + 7);
    let last = end == data.len();
    let segment = Segment { toggle, data: Data::new(&data[sent..end]), last };
    let state = State::DownloadingSegments { toggle, data, sent: end, last };
    Next::Send(Client { mux, state }, Request::DownloadSegment(segment))
}

fn violation(mux: Mux, expected: String, got: Response) -> Next {
    let tell = Request::Abort(mux, Abort::COMMAND);
    Next::Failed(Failure::Violation { expected, got }, Some(tell))
}

#[cfg(test)]
mod tests {
    use super::*;

    const MUX: Mux = Mux::new(0x1008, 0);

    fn segment(toggle: bool, data: &[u8], last: bool) -> Response {
        Response::UploadSegment(Segment { toggle, data: Data::new(data), last })
    }

    #[test]
    fn a_segmented_upload_collects_every_byte() {
        let (client, request) = Client::upload(MUX);
        assert_eq!(request, Request::Upload(MUX));
        let next = client.step(Response::Upload(MUX, Initiate::Segmented(Some(9))));
        let Next::Send(client, Request::UploadSegment(false)) = next else { panic!("{next:?}") };
        let next = client.step(segment(false, b"DRR460-", false));
        let Next::Send(client, Request::UploadSegment(true)) = next else { panic!("{next:?}") };
        let next = client.step(segment(true, b"12", true));
        assert!(matches!(&next, Next::Done(data) if data == b"DRR460-12"), "{next:?}");
    }

    #[test]
    fn a_segmented_download_sends_every_byte() {
        let (client, request) = Client::download(MUX, b"12345678", Transfer::Segmented);
        assert_eq!(request, Request::Download(MUX, Initiate::Segmented(Some(8))));
        let next = client.step(Response::Download(MUX));
        let Next::Send(client, Request::DownloadSegment(first)) = next else { panic!("{next:?}") };
        assert_eq!((&*first.data, first.last), (&b"1234567"[..], false));
        let next = client.step(Response::DownloadSegment(false));
        let Next::Send(client, Request::DownloadSegment(last)) = next else { panic!("{next:?}") };
        assert_eq!((&*last.data, last.toggle, last.last), (&b"8"[..], true, true));
        assert!(matches!(client.step(Response::DownloadSegment(true)), Next::Done(_)));
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
        let Next::Send(client, _) = next else { panic!("{next:?}") };
        assert!(matches!(client.step(segment(false, &[1, 2], true)), Next::Failed(..)));
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
}
