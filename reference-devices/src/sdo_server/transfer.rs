//! What the server is in the middle of, and the step from one state to the next.

use canopen::sdo::{Request, Response};
use canopen::{Abort, Instant, Mux};

use super::download::Download;
use super::upload::Upload;
use crate::services::Services;

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
}

/// What can happen to a transfer.
#[derive(Clone, Copy, Debug)]
pub(super) enum Input {
    Request(Request),
    Timeout,
}

/// The next state and the answer, or what was aborted and why.
pub(super) type Step = Result<(Transfer, Option<Response>), (Mux, Abort)>;

impl Transfer {
    /// Consumes the state: whoever forgets to return the next one ends the transfer.
    pub(super) fn step(self, input: Input, now: Instant, services: &mut Services) -> Step {
        let open = self.mux();
        let request = match input {
            Input::Request(request) => request,
            Input::Timeout => {
                return open.map_or(Ok((Self::Idle, None)), |mux| Err((mux, Abort::TIMEOUT)));
            }
        };
        match (self, request) {
            (_, Request::Abort(..)) => Ok((Self::Idle, None)),
            (left, Request::Upload(_) | Request::Download(..))
                if open.is_some() && !services.base.rules.initiate_replaces_transfer() =>
            {
                Ok((left, None))
            }
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
            (_, Request::UploadSegment(_) | Request::DownloadSegment(_)) => {
                Err((open.unwrap_or(NOTHING), Abort::COMMAND))
            }
            (left, Request::Unknown(bytes)) => {
                if !services.base.rules.answers_unknown_command() {
                    return Ok((left, None));
                }
                Err((Mux::from_bytes([bytes[1], bytes[2], bytes[3]]), Abort::COMMAND))
            }
        }
    }

    /// The object of the open transfer.
    pub(super) fn mux(&self) -> Option<Mux> {
        match self {
            Self::Idle => None,
            Self::Upload(upload) => Some(upload.mux),
            Self::Download(download) => Some(download.mux),
        }
    }

    /// An upload of `mux` from its start: what a server is left with that does not end a transfer
    /// when it aborts it.
    pub(super) fn reopened(mux: Mux, services: &Services) -> Self {
        services.read(mux).map_or(Self::Idle, |bytes| Self::Upload(Upload::new(mux, bytes)))
    }
}

/// What an abort names when no object is in question.
const NOTHING: Mux = Mux::new(0, 0);
