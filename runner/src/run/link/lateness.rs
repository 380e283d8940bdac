//! How late the tester is on a bus where it can be, and whether an SDO server waits for it.

use std::time::Duration;

use canopen::sdo::block::{BlockRequest, BlockResponse};
use canopen::sdo::{Initiate, REQUEST_COB_ID, RESPONSE_COB_ID, Request, Response};
use canopen::{Frame, Stamped};

/// A host that stood still for longer may have changed what the device did before the step that
/// fails, or before what it expects comes: a node was missed, an entry was made twice.
pub(in crate::run) const STALL: Duration = Duration::from_millis(100);

/// How late the tester was on a bus where it can be. In virtual time all of it stays zero.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Lateness {
    /// The longest time by which a frame missed the moment at which it was meant to leave, of those
    /// that were more than the step bears.
    pub missed: Duration,
    /// The same of the ends of waits.
    pub overslept: Duration,
    /// The longest time that an SDO server waited for the next request of an open transfer after
    /// the moment at which the tester could have sent it.
    pub kept_waiting: Duration,
    /// The longest time that it took to notice a frame, or the end of a wait.
    pub noticed: Duration,
    /// The shortest.
    pub soonest: Duration,
    /// All of these times together.
    pub sum: Duration,
    /// How many there are.
    pub count: u32,
}

impl Lateness {
    pub(super) fn notice(&mut self, late: Duration) {
        self.noticed = self.noticed.max(late);
        self.soonest = if self.count == 0 { late } else { self.soonest.min(late) };
        self.sum += late;
        self.count += 1;
    }

    pub(super) fn keep_waiting(&mut self, late: Duration) {
        self.kept_waiting = self.kept_waiting.max(late);
    }
}

/// Whether an SDO server waits for the next request of a transfer, as far as the frames tell.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Awaited {
    /// The last request, and what came to it last.
    last: Option<(Frame, Option<Frame>)>,
}

impl Awaited {
    /// Whether a frame goes to an SDO server, on a default identifier.
    pub(super) fn is_request(frame: &Frame) -> bool {
        frame.data_id().is_some_and(|id| of_node(id, REQUEST_COB_ID))
    }

    /// Whether the server may give up a transfer when the tester is late.
    pub(super) fn is_open(&self) -> bool {
        match &self.last {
            None => false,
            // A segment of a block may look like the end of another transfer: its answer tells.
            Some((request, None)) => !matches!(
                Request::decode(&request.data),
                Ok(Request::Abort(..) | Request::Block(BlockRequest::UploadEnd))
            ),
            Some((request, Some(answer))) => leaves_open(request, answer),
        }
    }

    /// Takes note of a frame.
    pub(super) fn see(&mut self, seen: &Stamped) {
        let Stamped { own, frame, .. } = seen;
        if *own && Self::is_request(frame) {
            self.last = Some((*frame, None));
        } else if !own
            && let Some((_, answer)) = &mut self.last
            && frame.data_id().is_some_and(|id| of_node(id, RESPONSE_COB_ID))
        {
            *answer = Some(*frame);
        }
    }
}

fn of_node(id: u16, base: u16) -> bool {
    (base + 1..=base + 0x7F).contains(&id)
}

/// Whether the answer to a request leaves its transfer open.
fn leaves_open(request: &Frame, answer: &Frame) -> bool {
    const ABORT: u8 = 0x80;
    let (Ok(asked), Ok(answered)) =
        (Request::decode(&request.data), Response::decode(&answer.data))
    else {
        return true;
    };
    match answered {
        // What follows are segments, whose first byte is no command.
        _ if matches!(
            asked,
            Request::Block(BlockRequest::UploadStart | BlockRequest::UploadAck(_))
        ) =>
        {
            answer.data.first() != Some(&ABORT)
        }
        Response::Abort(..) | Response::Block(BlockResponse::DownloadEnd) => false,
        Response::Upload(_, initiate) => matches!(initiate, Initiate::Segmented(_)),
        Response::UploadSegment(segment) => !segment.last,
        Response::Download(_) => matches!(asked, Request::Download(_, Initiate::Segmented(_))),
        Response::DownloadSegment(_) => {
            matches!(asked, Request::DownloadSegment(segment) if !segment.last)
        }
        Response::Block(_) | Response::BlockSegment(_) | Response::Unknown(_) => true,
    }
}
