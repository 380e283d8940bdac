//! The state of the server, and the step from one state to the next.

use canopen::sdo::Request;
use canopen::sdo::block::BlockRequest;
use canopen::{Abort, Instant, Mux};

use super::block_download::BlockDownload;
use super::block_upload::{BlockUpload, Wanted};
use super::download::Download;
use super::step::Step;
use super::upload::Upload;
use crate::stack::services::Services;

/// A state is named for what it waits for.
#[derive(Clone, Debug, Default)]
pub(super) enum State {
    /// Any initiate request.
    #[default]
    Idle,
    /// The request for the next upload segment.
    Upload(Upload),
    /// The next download segment.
    Download(Download),
    /// The next segment of a sub-block, or the end of a block download.
    BlockDownload(BlockDownload),
    /// The event that a block upload waits for: the client, or the wire for its next segment.
    BlockUpload(BlockUpload),
}

/// The events of a transfer.
#[derive(Clone, Copy, Debug)]
pub(super) enum Input {
    Request(Request),
    /// The wire is free for the next segment of a block upload.
    Segment,
    Timeout,
}

impl State {
    /// Consumes the state: code that forgets to return the next one ends the transfer.
    pub(super) fn step(self, input: Input, now: Instant, services: &mut Services) -> Step<Self> {
        let open = self.mux();
        match (input, self) {
            (Input::Request(request), state) => state.requested(request, now, services),
            (Input::Segment, Self::BlockUpload(upload)) => next(Self::BlockUpload, upload.send()),
            (Input::Segment, state) => Ok((Some(state), None)),
            (Input::Timeout, Self::BlockDownload(download)) if download.is_asked(services) => {
                next(Self::BlockDownload, download.ask())
            }
            (Input::Timeout, _) => open.map_or(Ok((None, None)), |mux| Err((mux, Abort::TIMEOUT))),
        }
    }

    fn requested(self, request: Request, now: Instant, services: &mut Services) -> Step<Self> {
        let open = self.mux();
        if open.is_some() && begins(request) && !services.base.rules.initiate_replaces_transfer() {
            return Ok((Some(self), None));
        }
        let refusal = services.base.rules.initiate_refused_in_transfer();
        if let (Some(open), Some(code)) = (open.filter(|_| begins(request)), refusal) {
            return Err((open, code));
        }
        match (self, request) {
            (_, Request::Abort(..)) => Ok((None, None)),
            (_, Request::Upload(mux)) => {
                let mux = services.base.rules.uploaded(mux, open);
                next(Self::Upload, Upload::initiate(mux, services))
            }
            (left, Request::Download(mux, initiate)) => {
                let begun = next(Self::Download, Download::initiate(mux, initiate, now, services));
                match (left, begun) {
                    (Self::Upload(open), Ok((None, answer)))
                        if !services.base.rules.expedited_download_ends_upload() =>
                    {
                        Ok((Some(Self::Upload(open)), answer))
                    }
                    (_, begun) => begun,
                }
            }
            (Self::Upload(upload), Request::UploadSegment(toggle)) => {
                next(Self::Upload, upload.segment(toggle, services))
            }
            (Self::Download(download), Request::DownloadSegment(segment)) => {
                next(Self::Download, download.segment(segment, now, services))
            }
            (Self::BlockDownload(download), Request::BlockSegment(segment)) => {
                next(Self::BlockDownload, download.segment(segment, services))
            }
            (left, Request::Block(block)) => left.block(block, now, services),
            (
                _,
                Request::UploadSegment(_) | Request::DownloadSegment(_) | Request::BlockSegment(_),
            ) => Err((open.unwrap_or(NOTHING), Abort::COMMAND)),
            (left, Request::Unknown(bytes)) => left.unknown(&bytes, services),
        }
    }

    fn block(self, request: BlockRequest, now: Instant, services: &mut Services) -> Step<Self> {
        let Some(settings) = services.base.settings.block_transfer else {
            return self.unknown(&Request::Block(request).encode(), services);
        };
        let open = self.mux();
        match (self, request) {
            (_, BlockRequest::Download { mux, crc, size }) => {
                let step = BlockDownload::initiate(mux, crc, size, settings, services);
                next(Self::BlockDownload, step)
            }
            (_, BlockRequest::Upload { mux, crc, size, threshold }) => {
                let wanted = Wanted { mux, crc, size, threshold };
                match BlockUpload::initiate(wanted, services)? {
                    Some((begun, answer)) => Ok((Some(Self::BlockUpload(begun)), Some(answer))),
                    None => next(Self::Upload, Upload::initiate(mux, services)),
                }
            }
            (Self::BlockDownload(download), BlockRequest::DownloadEnd(end)) => {
                next(Self::BlockDownload, download.end(end, now, services))
            }
            (Self::BlockUpload(upload), BlockRequest::UploadStart) => {
                next(Self::BlockUpload, upload.start())
            }
            (Self::BlockUpload(upload), BlockRequest::UploadAck(ack)) => {
                next(Self::BlockUpload, upload.acknowledged(ack, services))
            }
            (Self::BlockUpload(upload), BlockRequest::UploadEnd) => {
                next(Self::BlockUpload, upload.end())
            }
            _ => Err((open.unwrap_or(NOTHING), Abort::COMMAND)),
        }
    }

    fn unknown(self, bytes: &[u8], services: &Services) -> Step<Self> {
        if !services.base.rules.answers_unknown_command() {
            return Ok((Some(self), None));
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

    /// Whether the next segment of a block upload is due.
    pub(super) fn in_upload_sub_block(&self) -> bool {
        matches!(self, Self::BlockUpload(upload) if upload.in_sub_block())
    }

    /// The object and the data of a download that is not at its end.
    pub(super) fn downloaded(&self) -> Option<(Mux, &[u8])> {
        match self {
            Self::Download(download) => Some((download.mux, &download.data)),
            Self::BlockDownload(download) => Some((download.mux, &download.data)),
            Self::Idle | Self::Upload(_) | Self::BlockUpload(_) => None,
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
}

/// The step of one kind of transfer as a step of the server.
fn next<S>(state: fn(S) -> State, step: Step<S>) -> Step<State> {
    step.map(|(left, answer)| (left.map(state), answer))
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

/// The address in an abort when no object is in question.
const NOTHING: Mux = Mux::new(0, 0);
