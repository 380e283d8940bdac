//! Answers of an SDO server that are as good as those of the model.

use canopen::sdo::block::{BlockRequest, BlockResponse};
use canopen::sdo::{self, Initiate, Response};
use canopen::{Abort, Frame, Mux};

use crate::blueprint::Blueprint;
use crate::model::Model;

/// The request of a client that is under way.
#[derive(Clone, Debug)]
pub(super) struct Request {
    mux: Mux,
    /// The value before, of an object that the device may refuse to change.
    before: Option<Vec<u8>>,
    may: MayRefuse,
}

/// For what reasons a device may refuse a value that its data sheet allows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum MayRefuse {
    /// For none.
    Nothing,
    /// It is a time that its timers cannot run (CIA301-HB-08 and what it stands for).
    Times,
    /// For those of its application.
    Anything,
}

/// The request that begins with a frame of a client; `None` when none does, and no transfer ends.
pub(super) fn request(
    frame: &Frame,
    blueprint: &Blueprint,
    model: &Model,
) -> Option<Option<Request>> {
    let id = frame.data_id()?;
    let default = sdo::REQUEST_COB_ID + u16::from(blueprint.node());
    let od = model.dictionary();
    let further = od.entries_in(0x1201..=0x127F).iter().filter(|entry| entry.mux.sub == 1);
    let mut further = further.filter_map(|entry| od.int(entry.mux));
    if id != default && !further.any(|cob| cob == i64::from(id)) {
        return None;
    }
    let mux = match sdo::Request::decode(&frame.data).ok()? {
        sdo::Request::Download(mux, _) | sdo::Request::Upload(mux) => mux,
        sdo::Request::Block(
            BlockRequest::Download { mux, .. } | BlockRequest::Upload { mux, .. },
        ) => mux,
        _ => return None,
    };
    let may = match blueprint.is_of_application(mux) {
        true => MayRefuse::Anything,
        false if is_time(mux) => MayRefuse::Times,
        false => MayRefuse::Nothing,
    };
    let before = (may != MayRefuse::Nothing).then(|| od.get(mux).map(<[u8]>::to_vec));
    Some(Some(Request { mux, before: before.flatten(), may }))
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

/// Whether an answer of the device is as good as that of the model.
pub(super) fn is_like(
    frame: &Frame,
    expected: &Frame,
    request: Option<&Request>,
    is_volatile: &dyn Fn(Mux) -> bool,
) -> bool {
    let (Ok(answer), Ok(model)) =
        (Response::decode(&frame.data), Response::decode(&expected.data))
    else {
        return false;
    };
    match (answer, model) {
        (Response::Upload(mux, one), Response::Upload(other, two)) if mux == other => {
            is_volatile(mux) && same_length(one, two) && frame.data[0] == expected.data[0]
        }
        (Response::Abort(mux, code), model) => {
            let may = request.filter(|it| it.mux == mux && it.before.is_some()).map(|it| it.may);
            let may = match may {
                Some(MayRefuse::Anything) => code != Abort::TOGGLE,
                Some(MayRefuse::Times) => {
                    matches!(code, Abort::VALUE | Abort::TOO_LOW | Abort::TOO_HIGH)
                }
                Some(MayRefuse::Nothing) | None => false,
            };
            let confirms = matches!(
                model,
                Response::Download(_)
                    | Response::DownloadSegment(_)
                    | Response::Block(BlockResponse::DownloadEnd)
            );
            may && confirms
        }
        _ => false,
    }
}

/// The object that does not have the value that the network gave it, and the value that it has.
pub(super) fn followed(
    frame: &Frame,
    expected: &Frame,
    request: Option<&Request>,
) -> Option<(Mux, Vec<u8>)> {
    match (Response::decode(&frame.data).ok()?, Response::decode(&expected.data).ok()?) {
        (Response::Upload(mux, Initiate::Expedited(value)), _) => Some((mux, value.to_vec())),
        (Response::Abort(mux, _), _) => {
            let request = request.filter(|request| request.mux == mux)?;
            Some((mux, request.before.clone()?))
        }
        _ => None,
    }
}

fn same_length(one: Initiate, two: Initiate) -> bool {
    match (one, two) {
        (Initiate::Expedited(one), Initiate::Expedited(two)) => one.len() == two.len(),
        (one, two) => one == two,
    }
}
