//! The transfer with the default SDO server, as its client sees it.

use canopen::sdo::block::{BlockEnd, BlockRequest, BlockResponse, BlockSegment};
use canopen::sdo::{Initiate, Request, Response};

/// A transfer that a client has begun and not ended.
#[derive(Clone, Debug, Default)]
pub(crate) enum Talk {
    /// None is open.
    #[default]
    Idle,
    /// An initiation was sent, of the transfer that its answer opens.
    Asked(Box<Self>),
    /// Segments of an upload.
    Upload {
        /// The next toggle bit.
        toggle: bool,
    },
    /// Segments of a download.
    Download {
        /// The next toggle bit.
        toggle: bool,
        /// What is still to be sent.
        rest: Vec<u8>,
    },
    /// Sub-blocks of a download.
    Blocks {
        /// All of the data.
        data: Vec<u8>,
        /// How many bytes are confirmed.
        confirmed: usize,
        /// How many segments were sent since.
        sent: u8,
        /// The size of the sub-block.
        size: u8,
    },
    /// A block upload waits for its start.
    Accepted {
        /// The size of the first sub-block.
        size: u8,
    },
    /// Sub-blocks of an upload.
    Receiving {
        /// The last segment that came.
        last: u8,
        /// Whether it is the last of the transfer.
        ended: bool,
        /// The size of the sub-block.
        size: u8,
    },
    /// The end of a block upload came.
    Ended,
}

/// What is open, for the count of goals.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Open {
    /// No transfer.
    Nothing,
    /// The server has not answered.
    Asked,
    /// A segmented upload.
    Upload,
    /// A segmented download.
    Download,
    /// A block download.
    BlockDownload,
    /// A block upload.
    BlockUpload,
}

impl Talk {
    pub(crate) const fn open(&self) -> Open {
        match self {
            Self::Idle => Open::Nothing,
            Self::Asked(_) => Open::Asked,
            Self::Upload { .. } => Open::Upload,
            Self::Download { .. } => Open::Download,
            Self::Blocks { .. } => Open::BlockDownload,
            Self::Accepted { .. } | Self::Receiving { .. } | Self::Ended => Open::BlockUpload,
        }
    }

    pub(crate) const fn is_idle(&self) -> bool {
        matches!(self, Self::Idle)
    }

    /// The server has answered.
    pub(crate) fn hear(&mut self, data: &[u8]) {
        if let Self::Receiving { last, ended, size } = self
            && !*ended
            && *last < *size
            && data.first() != Some(&ABORTS)
            && let Ok(Response::BlockSegment(segment)) = Response::decode_in_sub_block(data)
        {
            (*last, *ended) = (segment.sequence, segment.last);
            return;
        }
        let Ok(answer) = Response::decode(data) else { return };
        *self = match (answer, std::mem::take(self)) {
            (Response::Abort(..) | Response::Download(_), Self::Asked(then)) => {
                match (answer, *then) {
                    (Response::Download(_), open @ Self::Download { .. }) => open,
                    _ => Self::Idle,
                }
            }
            (Response::Abort(..), _) => Self::Idle,
            (Response::Upload(_, Initiate::Segmented(_)), Self::Asked(_)) => {
                Self::Upload { toggle: false }
            }
            (Response::UploadSegment(segment), Self::Upload { toggle }) => match segment.last {
                true => Self::Idle,
                false => Self::Upload { toggle: !toggle },
            },
            (Response::DownloadSegment(_), Self::Download { toggle, rest }) => match rest.len() {
                0 => Self::Idle,
                _ => Self::Download { toggle: !toggle, rest },
            },
            (Response::Block(block), before) => before.hear_block(block),
            (Response::Upload(..), Self::Asked(_)) => Self::Idle,
            (_, before) => before,
        };
    }

    fn hear_block(self, answer: BlockResponse) -> Self {
        match (answer, self) {
            (BlockResponse::Download { size, .. }, Self::Asked(then)) => match *then {
                Self::Blocks { data, .. } => Self::Blocks { data, confirmed: 0, sent: 0, size },
                other => other,
            },
            (BlockResponse::DownloadAck(ack), Self::Blocks { data, confirmed, .. }) => {
                let confirmed = confirmed + 7 * usize::from(ack.last_good);
                Self::Blocks { data, confirmed, sent: 0, size: ack.size }
            }
            (BlockResponse::DownloadEnd, _) => Self::Idle,
            (BlockResponse::Upload { .. }, Self::Asked(then)) => *then,
            (BlockResponse::UploadEnd(_), Self::Receiving { .. }) => Self::Ended,
            (_, before) => before,
        }
    }

    /// A client has sent a request, and will go on with this data.
    pub(crate) fn ask(&mut self, request: &Request, data: Option<Vec<u8>>) {
        let asked = |then: Self| Self::Asked(Box::new(then));
        *self = match (request, std::mem::take(self)) {
            (Request::Download(_, Initiate::Segmented(_)), _) => {
                asked(Self::Download { toggle: false, rest: data.unwrap_or_default() })
            }
            (Request::Download(..) | Request::Upload(_), _) => asked(Self::Idle),
            (Request::Abort(..), _) => Self::Idle,
            (Request::DownloadSegment(segment), Self::Download { toggle, mut rest }) => {
                rest.drain(..segment.data.len().min(rest.len()));
                Self::Download { toggle, rest }
            }
            (Request::Block(block), before) => match *block {
                BlockRequest::Download { .. } => {
                    let data = data.unwrap_or_default();
                    asked(Self::Blocks { data, confirmed: 0, sent: 0, size: 0 })
                }
                BlockRequest::Upload { size, .. } => asked(Self::Accepted { size }),
                BlockRequest::UploadStart => match before {
                    Self::Accepted { size } => Self::Receiving { last: 0, ended: false, size },
                    before => before,
                },
                BlockRequest::UploadAck(ack) => match before {
                    Self::Receiving { ended, last, .. } => {
                        let ended = ended && ack.last_good == last;
                        Self::Receiving { last: 0, ended, size: ack.size }
                    }
                    before => before,
                },
                BlockRequest::UploadEnd => Self::Idle,
                BlockRequest::DownloadEnd(_) => before,
            },
            (_, before) => before,
        };
    }

    /// Segments of a sub-block were sent.
    pub(crate) fn sent_segments(&mut self, count: usize) {
        if let Self::Blocks { sent, size, .. } = self {
            *sent = (usize::from(*sent) + count).min(usize::from(*size)) as u8;
        }
    }

    /// The next segments of a sub-block, at most so many.
    pub(crate) fn segments(&self, most: usize) -> Vec<BlockSegment> {
        let Self::Blocks { data, confirmed, sent, size } = self else { return Vec::new() };
        let numbers = (*sent..*size).map(|sent| sent + 1);
        numbers.take(most).map_while(|it| BlockSegment::of(data, *confirmed, it)).collect()
    }

    /// The end of a block download that is complete.
    pub(crate) fn end(&self) -> Option<BlockRequest> {
        let Self::Blocks { data, confirmed, .. } = self else { return None };
        (*confirmed >= data.len()).then(|| BlockRequest::DownloadEnd(BlockEnd::of(data, true)))
    }
}

/// The command of an abort.
const ABORTS: u8 = 0x80;
