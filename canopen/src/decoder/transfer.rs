//! The SDO channel of a node: which transfer is open, and what it has carried so far.

use std::mem;

use crate::frame::Frame;
use crate::meaning::meaning;
use crate::mux::Mux;
use crate::sdo::block::{
    BlockAck, BlockEnd, BlockRequest, BlockResponse, BlockSegment, LARGEST_BLOCK,
};
use crate::sdo::{Initiate, Request, Response, Segment};

use super::shown::{bytes, count};

/// The sender of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    /// With an identifier of requests.
    Client,
    /// With an identifier of answers.
    Server,
}

/// A value that was transferred as a whole.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Whole {
    /// The object.
    pub mux: Mux,
    /// Its value.
    pub value: Vec<u8>,
    /// Whether the server has taken it or has given it.
    pub written: bool,
    /// Whether the transfer announced its number of bytes.
    pub sized: bool,
    /// How its frame shows it.
    pub frame: InFrame,
}

/// The part of the value that the words for the last frame of a transfer show.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum InFrame {
    /// The object and the bytes.
    Bytes,
    /// The object.
    Object,
    /// Neither.
    Nothing,
}

/// A frame in words.
pub(super) struct Said {
    /// The words.
    pub text: String,
    /// The value that this frame completes.
    pub whole: Option<Whole>,
}

/// The state of the transfers of a node.
#[derive(Debug, Default)]
pub(super) struct Channel {
    state: State,
    last: Option<Side>,
}

#[derive(Debug, Default)]
enum State {
    /// Unknown: the trace may have begun in the middle of a transfer.
    #[default]
    Unknown,
    /// No transfer is open.
    Idle,
    /// A download of up to four bytes, which the server has not confirmed.
    Expedited(Mux, Initiate),
    /// Segment by segment.
    Segments(Segments),
    /// In blocks.
    Block(Block),
}

#[derive(Debug)]
struct Segments {
    /// `None` where the trace begins in the middle.
    mux: Option<Mux>,
    sender: Side,
    /// The toggle bit of the next segment, when it is known.
    toggle: Option<bool>,
    size: Option<u32>,
    value: Vec<u8>,
    /// Whether the last segment was sent.
    over: bool,
}

#[derive(Debug)]
struct Block {
    /// `None` where the trace begins in the middle.
    mux: Option<Mux>,
    sender: Side,
    /// Segments of the sub-block that is under way, and how many may come; `None` outside one.
    open: Option<(Vec<BlockSegment>, u8)>,
    /// Where the sender goes on counting, when the trace begins within a sub-block.
    first: Option<u8>,
    value: Vec<u8>,
}

impl Block {
    fn new(mux: Option<Mux>, sender: Side) -> Self {
        Self { mux, sender, open: None, first: None, value: Vec::new() }
    }

    fn open(self, size: u8) -> Self {
        Self { open: Some((Vec::new(), size)), first: Some(1), ..self }
    }

    /// The end of the transfer: cuts the unused bytes off the last segment.
    fn cut(&mut self, end: BlockEnd) {
        let length = self.value.len().saturating_sub(end.unused.into());
        self.value.truncate(length);
    }

    /// The number of the segment that comes next, as its sender counts.
    fn due(&self) -> u8 {
        let last = self.open.as_ref().and_then(|(segments, _)| segments.last());
        last.map_or_else(|| self.first.unwrap_or(1), |last| last.sequence + 1)
    }

    /// The confirmation of a sub-block: the confirmed part, and the next sub-block.
    fn confirm(&mut self, ack: BlockAck) {
        let (segments, _) = self.open.take().unwrap_or_default();
        let mut over = false;
        for (segment, due) in segments.iter().scan(self.first.unwrap_or(1), in_order) {
            if segment.sequence == due && due <= ack.last_good {
                self.value.extend(segment.data);
                over = segment.last;
            }
        }
        if !over {
            (self.open, self.first) = (Some((Vec::new(), ack.size)), Some(1));
        }
    }
}

impl Channel {
    /// Ends the open transfer, if there is one.
    pub(super) fn end(&mut self) {
        (self.state, self.last) = (State::Idle, None);
    }

    /// Takes the next frame of the channel.
    pub(super) fn see(&mut self, side: Side, frame: &Frame, node: u8) -> Said {
        let before = self.last.replace(side);
        let plain = meaning(frame).to_string();
        let Ok(raw) = <[u8; 8]>::try_from(&*frame.data) else {
            return Said { text: plain, whole: None };
        };
        if let Some(segment) = self.block_segment(side, before, raw) {
            return Said { text: self.take_segment(segment, node), whole: None };
        }
        let (more, whole) = match side {
            Side::Client => match Request::decode(&raw) {
                Ok(request) => self.request(request),
                Err(_) => (String::new(), None),
            },
            Side::Server => match Response::decode(&raw) {
                Ok(response) => self.response(response),
                Err(_) => (String::new(), None),
            },
        };
        Said { text: plain + &more, whole }
    }

    /// The frame as a segment of a sub-block, where one is under way, or where the trace begins
    /// within one: then a side speaks twice, which it does nowhere else.
    fn block_segment(
        &self,
        side: Side,
        before: Option<Side>,
        raw: [u8; 8],
    ) -> Option<BlockSegment> {
        let segment = BlockSegment::decode(&raw).ok().filter(|_| raw[0] != 0x80)?;
        match &self.state {
            State::Block(block) if block.sender == side => {
                let (segments, size) = block.open.as_ref()?;
                let due = block.due();
                // A client that gave up silently starts again.
                let anew = segment.sequence != due && side == Side::Client && begins(raw);
                (!anew && segments.len() < usize::from(*size)).then_some(segment)
            }
            State::Unknown | State::Segments(Segments { mux: None, .. }) => {
                (before == Some(side) && segment.sequence > 0).then_some(segment)
            }
            _ => None,
        }
    }

    fn take_segment(&mut self, segment: BlockSegment, node: u8) -> String {
        if !matches!(self.state, State::Block(_)) {
            let sender = self.last.unwrap_or(Side::Server);
            let open = Some((Vec::new(), LARGEST_BLOCK));
            let first = Some(segment.sequence);
            self.state = State::Block(Block { open, first, ..Block::new(None, sender) });
        }
        let State::Block(block) = &mut self.state else { return String::new() };
        let (due, of) = (block.due(), of(block.mux));
        let Some((segments, size)) = &mut block.open else { return String::new() };
        let wrong = match segment.sequence == due {
            true => String::new(),
            false => format!(", where {due} is due"),
        };
        segments.push(segment);
        let last = if segment.last { ", last" } else { "" };
        let so_far = block.value.len() + 7 * segments.len();
        if segment.last || segment.sequence >= *size {
            // The other side sends next.
            *size = segments.len() as u8;
        }
        format!(
            "SDO node {node}: block segment {}{wrong} = {}{last}{of}, {} so far",
            segment.sequence,
            bytes(&segment.data),
            count(so_far),
        )
    }

    fn request(&mut self, request: Request) -> (String, Option<Whole>) {
        match request {
            Request::Upload(_) => self.state = State::Idle,
            Request::Download(mux, Initiate::Segmented(size)) => {
                self.state = segments(Some(mux), Side::Client, size);
            }
            Request::Download(mux, how) => self.state = State::Expedited(mux, how),
            Request::UploadSegment(toggle) => return (self.ask(toggle), None),
            Request::DownloadSegment(segment) => return self.segment(Side::Client, segment),
            Request::Abort(..) => self.state = State::Idle,
            Request::Block(request) => return self.block_request(request),
            Request::BlockSegment(_) | Request::Unknown(_) => {}
        }
        (String::new(), None)
    }

    fn response(&mut self, response: Response) -> (String, Option<Whole>) {
        match response {
            Response::Upload(mux, Initiate::Segmented(size)) => {
                self.state = segments(Some(mux), Side::Server, size);
            }
            Response::Upload(mux, how) => {
                self.state = State::Idle;
                return (String::new(), at_once(mux, how, false));
            }
            Response::Download(mux) => {
                let State::Expedited(asked, how) = self.state else { return Default::default() };
                self.state = State::Idle;
                let whole = (asked == mux).then(|| at_once(mux, how, true)).flatten();
                return (String::new(), whole);
            }
            Response::UploadSegment(segment) => return self.segment(Side::Server, segment),
            Response::DownloadSegment(toggle) => return self.confirmed(toggle),
            Response::Abort(..) => self.state = State::Idle,
            Response::Block(response) => return self.block_response(response),
            Response::BlockSegment(_) | Response::Unknown(_) => {}
        }
        (String::new(), None)
    }

    /// A request for a segment.
    fn ask(&mut self, toggle: bool) -> String {
        let Some(open) = self.segments(Side::Server) else { return NONE_OPEN.to_owned() };
        let due = open.toggle.replace(toggle).filter(|due| open.mux.is_some() && *due != toggle);
        of(open.mux) + &wrong_toggle(due)
    }

    fn segment(&mut self, side: Side, segment: Segment) -> (String, Option<Whole>) {
        let Some(open) = self.segments(side) else { return (NONE_OPEN.to_owned(), None) };
        let due = open.toggle.filter(|due| open.mux.is_some() && *due != segment.toggle);
        open.toggle = Some(!segment.toggle);
        open.value.extend(&*segment.data);
        open.over = segment.last;
        let mut text = of(open.mux) + &wrong_toggle(due);
        let so_far = open.value.len();
        match (open.size, segment.last) {
            (Some(size), true) if open.mux.is_some() && size as usize != so_far => {
                text.push_str(&format!(", {} where {size} were announced", count(so_far)));
            }
            (_, true) => {}
            (Some(size), false) => text.push_str(&format!(", {so_far} of {size} bytes")),
            (None, false) => text.push_str(&format!(", {} so far", count(so_far))),
        }
        let ends = side == Side::Server && segment.last;
        match ends.then(|| self.complete()).flatten() {
            // The value says which object it is.
            Some(whole) => (text.replacen(&of(Some(whole.mux)), "", 1), Some(whole)),
            None => (text, None),
        }
    }

    /// The confirmation of a segment.
    fn confirmed(&mut self, toggle: bool) -> (String, Option<Whole>) {
        let Some(open) = self.segments(Side::Client) else { return (NONE_OPEN.to_owned(), None) };
        open.toggle.get_or_insert(!toggle);
        let (text, over) = (of(open.mux), open.over);
        match over.then(|| self.complete()).flatten() {
            Some(whole) => (String::new(), Some(whole)),
            None => (text, None),
        }
    }

    /// The value of the transfer that is over, when all of it was seen.
    fn complete(&mut self) -> Option<Whole> {
        // The apparent end of a transfer that began before the trace may be no end.
        let after = if self.mux().is_some() { State::Idle } else { State::Unknown };
        let (mux, value, sender) = match mem::replace(&mut self.state, after) {
            State::Segments(open) => (open.mux?, open.value, open.sender),
            State::Block(block) => (block.mux?, block.value, block.sender),
            _ => return None,
        };
        Some(Whole {
            mux,
            value,
            written: sender == Side::Client,
            sized: true,
            frame: InFrame::Nothing,
        })
    }

    /// The segments of a sender that are under way, or of which the trace does not have the begin.
    fn segments(&mut self, sender: Side) -> Option<&mut Segments> {
        if matches!(self.state, State::Unknown) {
            self.state = segments(None, sender, None);
        }
        match &mut self.state {
            State::Segments(open) if open.sender == sender => Some(open),
            _ => None,
        }
    }

    fn block_request(&mut self, request: BlockRequest) -> (String, Option<Whole>) {
        let sender = match request {
            BlockRequest::Download { mux, .. } => {
                self.state = State::Block(Block::new(Some(mux), Side::Client));
                return (String::new(), None);
            }
            BlockRequest::Upload { mux, .. } => {
                self.state = State::Block(Block::new(Some(mux), Side::Server));
                return (String::new(), None);
            }
            BlockRequest::DownloadEnd(_) => Side::Client,
            BlockRequest::UploadStart | BlockRequest::UploadAck(_) | BlockRequest::UploadEnd => {
                Side::Server
            }
        };
        let Some(block) = self.block(sender) else { return (NONE_OPEN.to_owned(), None) };
        match request {
            BlockRequest::UploadStart => {
                (block.open, block.first) = (Some((Vec::new(), LARGEST_BLOCK)), Some(1));
            }
            BlockRequest::UploadAck(ack) => block.confirm(ack),
            BlockRequest::DownloadEnd(end) => block.cut(end),
            BlockRequest::UploadEnd => return self.block_over(),
            BlockRequest::Download { .. } | BlockRequest::Upload { .. } => {}
        }
        (of(self.mux()), None)
    }

    fn block_response(&mut self, response: BlockResponse) -> (String, Option<Whole>) {
        let sender = match response {
            BlockResponse::Download { mux, size, .. } => {
                self.state = State::Block(Block::new(Some(mux), Side::Client).open(size));
                return (String::new(), None);
            }
            BlockResponse::Upload { mux, .. } => {
                self.state = State::Block(Block::new(Some(mux), Side::Server));
                return (String::new(), None);
            }
            BlockResponse::UploadEnd(_) => Side::Server,
            BlockResponse::DownloadAck(_) | BlockResponse::DownloadEnd => Side::Client,
        };
        let Some(block) = self.block(sender) else { return (NONE_OPEN.to_owned(), None) };
        match response {
            BlockResponse::DownloadAck(ack) => block.confirm(ack),
            BlockResponse::UploadEnd(end) => block.cut(end),
            BlockResponse::DownloadEnd => return self.block_over(),
            BlockResponse::Download { .. } | BlockResponse::Upload { .. } => {}
        }
        (of(self.mux()), None)
    }

    fn block_over(&mut self) -> (String, Option<Whole>) {
        let text = of(self.mux());
        match self.complete() {
            Some(whole) => (String::new(), Some(whole)),
            None => (text, None),
        }
    }

    /// The blocks of a sender that are under way, or of which the trace does not have the begin.
    fn block(&mut self, sender: Side) -> Option<&mut Block> {
        if matches!(self.state, State::Unknown) {
            self.state = State::Block(Block::new(None, sender));
        }
        match &mut self.state {
            State::Block(block) if block.sender == sender => Some(block),
            _ => None,
        }
    }

    fn mux(&self) -> Option<Mux> {
        match &self.state {
            State::Segments(open) => open.mux,
            State::Block(block) => block.mux,
            _ => None,
        }
    }
}

/// The remark on a frame that belongs to a transfer, when none is open.
const NONE_OPEN: &str = "; no such transfer is open";

/// A segment with the number that its receiver waits for.
fn in_order<'s>(due: &mut u8, segment: &'s BlockSegment) -> Option<(&'s BlockSegment, u8)> {
    let now = *due;
    *due += u8::from(segment.sequence == now);
    Some((segment, now))
}

/// Whether a client begins a transfer with these bytes, everything reserved zero.
fn begins(raw: [u8; 8]) -> bool {
    let Ok(request) = Request::decode(&raw) else { return false };
    let begins = matches!(
        request,
        Request::Upload(_)
            | Request::Download(..)
            | Request::Block(BlockRequest::Upload { .. } | BlockRequest::Download { .. })
    );
    begins && *request.encode() == raw
}

fn segments(mux: Option<Mux>, sender: Side, size: Option<u32>) -> State {
    let toggle = mux.map(|_| false);
    State::Segments(Segments { mux, sender, toggle, size, value: Vec::new(), over: false })
}

fn at_once(mux: Mux, how: Initiate, written: bool) -> Option<Whole> {
    let (value, sized) = match how {
        Initiate::Expedited(data) => (data.to_vec(), true),
        Initiate::Unsized(bytes) => (bytes.to_vec(), false),
        Initiate::Segmented(_) => return None,
    };
    let frame = if written { InFrame::Object } else { InFrame::Bytes };
    Some(Whole { mux, value, written, sized, frame })
}

/// Which object a part of a transfer belongs to.
fn of(mux: Option<Mux>) -> String {
    match mux {
        Some(mux) => format!("; {mux}"),
        None => "; of a transfer that began before the trace".to_owned(),
    }
}

fn wrong_toggle(due: Option<bool>) -> String {
    due.map_or_else(String::new, |due| format!(", where toggle {} is due", u8::from(due)))
}
