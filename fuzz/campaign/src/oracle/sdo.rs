//! Answers of an SDO server that are as good as those of the model.

use std::collections::VecDeque;

use canopen::pdo::CobId;
use canopen::sdo::block::{BlockRequest, BlockResponse};
use canopen::sdo::{self, Initiate, Response};
use canopen::{Abort, Data, Frame, Id, Mux, Stamped};

use super::Early;
use super::expected::Queues;
use super::streams::Streams;
use crate::blueprint::Blueprint;
use crate::model::Model;

/// The request of a client that is under way.
pub(super) struct Request {
    mux: Mux,
    /// The identifier of the client's frames.
    id: Id,
    uploads: bool,
    /// The value before, of an object that the device may refuse to change.
    before: Option<Vec<u8>>,
    may: MayRefuse,
    /// Whether a transfer was open when it came.
    over: bool,
    /// Whether it may be a segment of a block download.
    pub(super) like_segment: bool,
    /// Where a service takes the value: what was before.
    pub(super) before_it: Option<Box<Before>>,
}

/// What a judge knew before a request that the device may refuse, and what it has seen since.
pub(super) struct Before {
    pub(super) model: Model,
    pub(super) queues: Queues,
    pub(super) streams: Streams,
    pub(super) early: Vec<Early>,
    /// How many frames the model had taken.
    pub(super) taken: u64,
    /// The frames of the device, but for answers of the server.
    pub(super) seen: Vec<Stamped>,
}

impl Request {
    /// The object that it writes.
    pub(super) fn writes(&self) -> Option<Mux> {
        (!self.uploads).then_some(self.mux)
    }

    /// Whether a frame of the default server confirms it, or a part of it.
    pub(super) fn is_confirmed_by(&self, frame: &Frame, node: u8) -> bool {
        let node = u16::from(node);
        let own = self.id == Id::standard(sdo::REQUEST_COB_ID + node)
            && frame.data_id() == Some(sdo::RESPONSE_COB_ID + node);
        let confirms = match Response::decode(&frame.data) {
            Ok(Response::Download(mux)) => mux == self.mux,
            Ok(Response::DownloadSegment(_) | Response::Block(BlockResponse::DownloadEnd)) => true,
            _ => false,
        };
        own && confirms
    }

    /// What was before a request that the device refuses.
    fn undone(&mut self, mux: Mux) -> Option<Before> {
        self.before_it.take_if(|_| self.mux == mux).map(|before| *before)
    }

    /// The TPDO of which a frame of this transfer may write a parameter, or the mapping: the index
    /// of its communication parameters.
    pub(super) fn configures(&self, frame: &Frame) -> Option<u16> {
        let writes = !self.uploads && frame.any_data_id() == Some(self.id);
        tpdo_of(self.mux).filter(|_| writes)
    }

    /// Whether a service takes its value, which the device may refuse.
    pub(super) fn may_be_undone(&self) -> bool {
        matches!(self.may, MayRefuse::Some { .. }) && !self.uploads
    }
}

/// The requests that a device may still answer, the last one at the end: one that serves them late
/// answers the first of many.
#[derive(Default)]
pub(super) struct Requests(VecDeque<Request>);

/// How many requests are remembered.
const MOST_REQUESTS: usize = 16;

impl Requests {
    /// A request begins. What looks like one may be a segment of a block: however many do, the one
    /// that they belong to is kept.
    pub(super) fn begin(&mut self, request: Request) {
        let of_one_block = |last: &Request| last.like_segment && request.like_segment;
        if self.last().is_some_and(of_one_block) {
            self.0.pop_back();
        } else if self.0.len() == MOST_REQUESTS {
            self.0.pop_front();
        }
        self.0.push_back(request);
    }

    /// The device has forgotten them.
    pub(super) fn clear(&mut self) {
        self.0.clear();
    }

    /// The last one.
    pub(super) fn last(&self) -> Option<&Request> {
        self.0.back()
    }

    /// The last one, with what was before it.
    pub(super) fn last_mut(&mut self) -> Option<&mut Request> {
        self.0.back_mut()
    }

    /// What was before a request for an object that the device refuses.
    pub(super) fn undone(&mut self, mux: Mux) -> Option<Before> {
        self.0.iter_mut().rev().find_map(|request| request.undone(mux))
    }

    /// The last one for an object.
    fn of(&self, mux: Mux) -> Option<&Request> {
        self.0.iter().rev().find(|request| request.mux == mux)
    }
}

/// The transfers that a model has begun to answer, by the identifier of its answers.
#[derive(Clone, Default)]
pub(super) struct Transfers(Vec<(Id, Transfer)>);

/// A transfer, as the answer that begins it shows it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Transfer {
    mux: Mux,
    uploads: bool,
    /// Whether its segments have no command, and look like anything.
    in_blocks: bool,
}

impl Transfers {
    /// The transfer that the next answer of the model belongs to. Segments name no object: theirs
    /// is that of the answer before them.
    pub(super) fn of(&mut self, frame: &Frame, requests: &Requests) -> Option<Transfer> {
        let place = self.0.iter().position(|(id, _)| *id == frame.id);
        let open = place.map(|place| self.0[place].1);
        let in_blocks = open.is_some_and(|open| open.in_blocks) && !refuses(frame);
        let begins = |it: &Transfer| !in_blocks || requests.of(it.mux).is_some();
        let Some(begun) = Transfer::begun_by(frame).filter(begins) else { return open };
        match place {
            Some(place) => self.0[place].1 = begun,
            None => self.0.push((frame.id, begun)),
        }
        Some(begun)
    }
}

impl Transfer {
    fn begun_by(frame: &Frame) -> Option<Self> {
        let (mux, uploads, in_blocks) = match Response::decode(&frame.data).ok()? {
            Response::Upload(mux, _) => (mux, true, false),
            Response::Block(BlockResponse::Upload { mux, .. }) => (mux, true, true),
            Response::Download(mux)
            | Response::Abort(mux, _)
            | Response::Block(BlockResponse::Download { mux, .. }) => (mux, false, false),
            _ => return None,
        };
        Some(Self { mux, uploads, in_blocks })
    }

    /// The object that it reads.
    pub(super) fn reads(self) -> Option<Mux> {
        self.uploads.then_some(self.mux)
    }
}

/// For what reasons a device may refuse a value that its data sheet allows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum MayRefuse {
    /// For none.
    Nothing,
    /// For some.
    Some {
        /// It is a time that its timers cannot run (CIA301-HB-08 and what it stands for).
        time: bool,
        /// It has four bytes, none of which is said to be left out (CIA301-SDO-05).
        length: bool,
    },
    /// For those of its application.
    Anything,
}

/// Whether a frame may be one that the default server answers.
pub(crate) fn is_request(frame: &Frame, node: u8) -> bool {
    frame.data_id() == Some(sdo::REQUEST_COB_ID + u16::from(node))
}

/// The request that begins with a frame of a client.
pub(super) fn request(frame: &Frame, blueprint: &Blueprint, model: &Model) -> Option<Request> {
    let id = frame.any_data_id()?;
    let default = Id::standard(sdo::REQUEST_COB_ID + u16::from(model.id()));
    let od = model.dictionary();
    let further = od.entries_in(0x1201..=0x127F).iter().filter(|entry| entry.mux.sub == 1);
    let mut further = further.filter_map(|entry| Some(CobId(od.int(entry.mux)? as u32)));
    let by_default = id == default;
    if !by_default && !further.any(|cob| cob.valid() && cob.can_id() == id) {
        return None;
    }
    let like_segment = by_default && model.takes_segments();
    let (mut ends, mut length) = (false, false);
    let (mux, uploads) = match sdo::Request::decode(&frame.data).ok()? {
        sdo::Request::Download(mux, how) => {
            ends = matches!(how, Initiate::Expedited(value) if is_off(mux, &value));
            length = matches!(how, Initiate::Unsized(_));
            (mux, false)
        }
        sdo::Request::Upload(mux) => (mux, true),
        sdo::Request::Block(BlockRequest::Download { mux, .. }) => (mux, false),
        sdo::Request::Block(BlockRequest::Upload { mux, .. }) => (mux, true),
        _ => return None,
    };
    let may = match blueprint.is_of_application(mux) {
        true => MayRefuse::Anything,
        // A memory can fail.
        false if blueprint.listens() && matches!(mux.index, 0x1010 | 0x1011) => MayRefuse::Anything,
        // What 0 switches off can be switched off.
        false => match (is_time(mux) && !ends, length) {
            (false, false) => MayRefuse::Nothing,
            (time, length) => MayRefuse::Some { time, length },
        },
    };
    let before = (may != MayRefuse::Nothing).then(|| od.get(mux).map(<[u8]>::to_vec));
    let (before, over) = (before.flatten(), model.transfers());
    Some(Request { mux, id, uploads, before, may, over, like_segment, before_it: None })
}

/// Whether an object holds a time, whose range the data sheet may leave out.
const fn is_time(mux: Mux) -> bool {
    matches!(
        (mux.index, mux.sub),
        (0x1006 | 0x1007 | 0x100C | 0x100D | 0x1015 | 0x1017, 0)
            | (0x1016, 1..)
            | (0x1400..=0x15FF | 0x1800..=0x19FF, 3 | 5)
    )
}

/// Whether a value of an object that holds a time is 0; an entry of 1016h has it in its low half.
fn is_off(mux: Mux, value: &[u8]) -> bool {
    let time = if mux.index == 0x1016 { &value[..value.len().min(2)] } else { value };
    time.iter().all(|byte| *byte == 0)
}

/// Whether an answer of the device is as good as that of the model.
pub(super) fn is_like(
    frame: &Frame,
    expected: &Frame,
    of: Option<Transfer>,
    requests: &Requests,
    is_volatile: &dyn Fn(Mux) -> bool,
) -> bool {
    let (Ok(answer), Ok(model)) = (Response::decode(&frame.data), Response::decode(&expected.data))
    else {
        return false;
    };
    // Segments of an upload: nothing but their lengths and numbers.
    let of_volatile = of.and_then(Transfer::reads).is_some_and(is_volatile);
    let command = frame.data[0];
    if of_volatile && command != ABORT && !matches!(answer, Response::Upload(..)) {
        return command == expected.data[0];
    }
    match (answer, model) {
        (Response::Upload(mux, one), Response::Upload(other, two)) if mux == other => {
            is_volatile(mux) && same_length(one, two) && frame.data[0] == expected.data[0]
        }
        // An entry of the error history that is empty, or is not.
        (Response::Abort(mux, Abort::NO_DATA), Response::Upload(other, _))
        | (Response::Upload(mux, _), Response::Abort(other, Abort::NO_DATA))
            if mux == other && mux.index == HISTORY =>
        {
            is_volatile(mux)
        }
        (Response::Abort(mux, _), Response::Upload(other, _)) if mux == other => {
            requests.of(mux).is_some_and(|it| it.may == MayRefuse::Anything)
        }
        // What an unknown command is about, nobody can say.
        (Response::Abort(_, Abort::COMMAND), Response::Abort(_, Abort::COMMAND)) => true,
        (Response::Abort(mux, code), model) => {
            let may = requests.of(mux).filter(|it| it.before.is_some()).map(|it| it.may);
            let refuses = matches!(model, Response::Abort(other, _) if other == mux);
            let may = match may {
                Some(MayRefuse::Anything) if refuses => return STATES.contains(&code),
                Some(MayRefuse::Anything) => code != Abort::TOGGLE,
                Some(MayRefuse::Some { time, length }) => match code {
                    Abort::VALUE | Abort::TOO_LOW | Abort::TOO_HIGH => time,
                    Abort::LENGTH | Abort::TOO_LONG => length,
                    _ => false,
                },
                Some(MayRefuse::Nothing) | None => false,
            };
            let confirms = match model {
                // A confirmation that was lost with a reset may be of another object.
                Response::Download(other) => other == mux,
                Response::DownloadSegment(_) | Response::Block(BlockResponse::DownloadEnd) => true,
                _ => false,
            };
            may && confirms
        }
        _ => false,
    }
}

/// The object of which both frames begin an upload, one of another length than the other.
pub(super) fn resized(frame: &Frame, other: &Frame) -> Option<Mux> {
    let ((mux, size), (other, other_size)) = (begun(frame)?, begun(other)?);
    (mux == other && size != other_size).then_some(mux)
}

/// The object of which a frame begins an upload and tells the length.
pub(super) fn resizable(frame: &Frame) -> Option<Mux> {
    begun(frame).map(|(mux, _)| mux)
}

fn begun(frame: &Frame) -> Option<(Mux, u32)> {
    match Response::decode(&frame.data).ok()? {
        Response::Upload(mux, Initiate::Expedited(value)) => Some((mux, value.len() as u32)),
        Response::Upload(mux, Initiate::Segmented(size)) => Some((mux, size?)),
        Response::Block(BlockResponse::Upload { mux, size, .. }) => Some((mux, size?)),
        _ => None,
    }
}

/// The object that does not have the value that the network gave it, and the value that it has.
pub(super) fn followed(
    frame: &Frame,
    expected: &Frame,
    requests: &Requests,
) -> Option<(Mux, Vec<u8>)> {
    match (Response::decode(&frame.data).ok()?, Response::decode(&expected.data).ok()?) {
        (Response::Upload(mux, Initiate::Expedited(value)), _) => Some((mux, value.to_vec())),
        // What both refuse for one reason, such as an unknown command, has the same value in both.
        (Response::Abort(mux, _), _) if refuses(frame) && !same_code(frame, expected) => {
            let mut known = requests.0.iter().rev();
            let request = known.find(|request| request.mux == mux && !request.uploads)?;
            Some((mux, request.before.clone()?))
        }
        _ => None,
    }
}

/// The object of the write that an answer is about. A segment names none: it is that of its
/// transfer, or else the last one that was requested.
pub(super) fn written(frame: &Frame, of: Option<Transfer>, requests: &Requests) -> Option<Mux> {
    let last = || requests.last().map(|request| request.mux);
    let mux = match Response::decode(&frame.data).ok()? {
        Response::Download(mux) | Response::Abort(mux, _) => mux,
        Response::DownloadSegment(_) | Response::Block(_) => of.map(|it| it.mux).or_else(last)?,
        _ => return None,
    };
    requests.of(mux)?.writes()
}

/// The TPDO of which an answer confirms a parameter, or the mapping: the index of its communication
/// parameters.
pub(super) fn configured(frame: &Frame, of: Option<Transfer>, requests: &Requests) -> Option<u16> {
    match Response::decode(&frame.data).ok()? {
        // Others may have been requested since.
        Response::Download(mux) => tpdo_of(mux),
        Response::Abort(..) => None,
        _ => tpdo_of(written(frame, of, requests)?),
    }
}

fn tpdo_of(mux: Mux) -> Option<u16> {
    matches!(mux.index, 0x1800..=0x1BFF).then_some(0x1800 | mux.index & 0x1FF)
}

/// Whether a frame is an abort.
pub(super) fn refuses(frame: &Frame) -> bool {
    frame.data.first() == Some(&ABORT)
}

/// The object of which an answer is the whole value.
pub(super) fn read(frame: &Frame) -> Option<(Mux, Data)> {
    match Response::decode(&frame.data).ok()? {
        Response::Upload(mux, Initiate::Expedited(value)) => Some((mux, Data::new(&value))),
        _ => None,
    }
}

/// Whether a refused request came while a transfer was open: a device that refuses it before it
/// looks at its transfer goes on with that one.
pub(super) fn leaves_open(mux: Mux, requests: &Requests) -> bool {
    requests.of(mux).is_some_and(|request| request.over)
}

/// The error history.
const HISTORY: u16 = 0x1003;
/// The command of an abort.
const ABORT: u8 = 0x80;
/// Codes for the state of a device, which may be looked at before the value.
const STATES: [Abort; 3] = [Abort::STORE, Abort::LOCAL_CONTROL, Abort::DEVICE_STATE];

/// What ends the transfer of a model whose device has refused it.
pub(super) fn end(frame: &Frame, node: u8) -> Option<Frame> {
    frame.data.first().filter(|command| **command == ABORT)?;
    match Response::decode(&frame.data).ok()? {
        Response::Abort(mux, _) => Some(sdo::Request::Abort(mux, Abort::GENERAL).frame(node)),
        _ => None,
    }
}

/// Whether both are aborts with the same code.
pub(super) fn same_code(frame: &Frame, other: &Frame) -> bool {
    let aborts = |frame: &Frame| frame.data.first() == Some(&ABORT);
    aborts(frame) && aborts(other) && frame.data.get(4..) == other.data.get(4..)
}

/// Whether the application of the device refuses something, for a reason of its own.
pub(super) fn is_refusal(frame: &Frame, requests: &Requests) -> bool {
    let Ok(Response::Abort(mux, code)) = Response::decode(&frame.data) else { return false };
    let mut known = requests.0.iter();
    let asked = known.any(|request| request.mux == mux && request.may == MayRefuse::Anything);
    asked && frame.data[0] == ABORT && matches!(code.0 >> 16, 0x0604 | 0x0606 | 0x0609 | 0x0800)
}

fn same_length(one: Initiate, two: Initiate) -> bool {
    match (one, two) {
        (Initiate::Expedited(one), Initiate::Expedited(two)) => one.len() == two.len(),
        (Initiate::Unsized(_), Initiate::Unsized(_)) => true,
        (one, two) => one == two,
    }
}
