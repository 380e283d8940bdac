//! What the server is in the middle of, and the step from one state to the next.

use canopen::sdo::block::BlockRequest;
use canopen::sdo::{Request, Response};
use canopen::{Abort, Instant, Mux};

use super::block_download::BlockDownload;
use super::block_upload::{BlockUpload, Wanted};
use super::download::Download;
use super::upload::Upload;
use crate::stack::services::Services;

/// A state is named for what it waits for.
#[derive(Debug, Default)]
pub(super) enum Transfer {
    /// Any initiate request.
    #[default]
    Idle,
    /// The request for the next upload segment.
    Upload(Upload),
    /// The next download segment.
    Download(Download),
    /// The next segment of a sub-block, or the end of a block download.
    BlockDownload(BlockDownload),
    /// What a block upload waits for: the client, or the time of its next segment.
    BlockUpload(BlockUpload),
}

/// What can happen to a transfer.
#[derive(Clone, Copy, Debug)]
pub(super) enum Input {
    Request(Request),
    /// The time of the next segment of a block upload.
    Segment,
    Timeout,
}

/// The next state and the answer, or what was aborted and why.
pub(super) type Step = Result<(Transfer, Option<Response>), (Mux, Abort)>;

impl Transfer {
    /// Consumes the state: whoever forgets to return the next one ends the transfer.
    pub(super) fn step(self, input: Input, now: Instant, services: &mut Services) -> Step {
        let open = self.mux();
        match (input, self) {
            (Input::Request(request), state) => state.requested(request, now, services),
            (Input::Segment, Self::BlockUpload(upload)) => upload.send(now),
            (Input::Segment, state) => Ok((state, None)),
            (Input::Timeout, _) => {
                open.map_or(Ok((Self::Idle, None)), |mux| Err((mux, Abort::TIMEOUT)))
            }
        }
    }

    fn requested(self, request: Request, now: Instant, services: &mut Services) -> Step {
        let open = self.mux();
        if open.is_some() && begins(request) && !services.base.rules.initiate_replaces_transfer() {
            return Ok((self, None));
        }
        match (self, request) {
            (_, Request::Abort(..)) => Ok((Self::Idle, None)),
            (_, Request::Upload(mux)) => {
                Upload::initiate(services.base.rules.uploaded(mux, open), services)
            }
            (_, Request::Download(mux, initiate)) => {
                Download::initiate(mux, initiate, now, services)
            }
            (Self::Upload(upload), Request::UploadSegment(toggle)) => {
                upload.segment(toggle, services)
            }
            (Self::Download(download), Request::DownloadSegment(segment)) => {
                download.segment(segment, now, services)
            }
            (Self::BlockDownload(download), Request::BlockSegment(segment)) => {
                download.segment(segment, services)
            }
            (left, Request::Block(block)) => left.block(block, now, services),
            (
                _,
                Request::UploadSegment(_) | Request::DownloadSegment(_) | Request::BlockSegment(_),
            ) => Err((open.unwrap_or(NOTHING), Abort::COMMAND)),
            (left, Request::Unknown(bytes)) => left.unknown(&bytes, services),
        }
    }

    fn block(self, request: BlockRequest, now: Instant, services: &mut Services) -> Step {
        let Some(settings) = services.base.settings.block_transfer else {
            return self.unknown(&Request::Block(request).encode(), services);
        };
        let open = self.mux();
        match (self, request) {
            (_, BlockRequest::Download { mux, crc, size }) => {
                BlockDownload::initiate(mux, crc, size, settings, services)
            }
            (_, BlockRequest::Upload { mux, crc, size, threshold }) => {
                let wanted = Wanted { mux, crc, size, threshold };
                BlockUpload::initiate(wanted, settings, services)
            }
            (Self::BlockDownload(download), BlockRequest::DownloadEnd(end)) => {
                download.end(end, now, services)
            }
            (Self::BlockUpload(upload), BlockRequest::UploadStart) => upload.start(now),
            (Self::BlockUpload(upload), BlockRequest::UploadAck(ack)) => {
                upload.acknowledged(ack, now, services)
            }
            (Self::BlockUpload(upload), BlockRequest::UploadEnd) => upload.end(),
            _ => Err((open.unwrap_or(NOTHING), Abort::COMMAND)),
        }
    }

    fn unknown(self, bytes: &[u8], services: &Services) -> Step {
        if !services.base.rules.answers_unknown_command() {
            return Ok((self, None));
        }
        let mux = bytes.get(1..4).and_then(<[u8]>::first_chunk).map(|mux| Mux::from_bytes(*mux));
        Err((mux.unwrap_or(NOTHING), Abort::COMMAND))
    }

    /// Whether the next frame is a segment of a sub-block and no request.
    pub(super) const fn in_sub_block(&self) -> bool {
        match self {
            Self::BlockDownload(download) => download.in_sub_block(),
            _ => false,
        }
    }

    /// When the next segment of a block upload is to be sent.
    pub(super) const fn due(&self) -> Option<Instant> {
        match self {
            Self::BlockUpload(upload) => upload.due(),
            _ => None,
        }
    }

    /// The object of the open transfer.
    pub(super) fn mux(&self) -> Option<Mux> {
        match self {
            Self::Idle => None,
            Self::Upload(upload) => Some(upload.mux),
            Self::Download(download) => Some(download.mux),
            Self::BlockDownload(download) => Some(download.mux),
            Self::BlockUpload(upload) => Some(upload.mux),
        }
    }

    /// An upload of `mux` from its start: what a server is left with that does not end a transfer
    /// when it aborts it.
    pub(super) fn reopened(mux: Mux, services: &Services) -> Self {
        services.read(mux).map_or(Self::Idle, |bytes| Self::Upload(Upload::new(mux, bytes)))
    }
}

/// Whether the request begins a transfer.
const fn begins(request: Request) -> bool {
    matches!(
        request,
        Request::Upload(_)
            | Request::Download(..)
            | Request::Block(BlockRequest::Upload { .. } | BlockRequest::Download { .. })
    )
}

/// What an abort names when no object is in question.
const NOTHING: Mux = Mux::new(0, 0);
