//! A second station with the node id of the device: every request then has two answers, and every
//! write goes to both.
//!
//! A frame may also come twice because it was disturbed at its end (ISO 11898-1). So a request that
//! had two answers is a suspicion, and uploads of 1000h before the next frame decide.

use std::collections::BTreeMap;

use canopen::sdo::block::{BlockRequest, BlockResponse};
use canopen::sdo::{REQUEST_COB_ID, RESPONSE_COB_ID, Request, Response};
use canopen::{Frame, Mux, Stamped};

/// The transfers that were begun on a bus that others share, and how often each was answered.
#[derive(Clone, Debug, Default)]
pub(super) struct Twins {
    /// Of the device; `None` where no other station can be.
    pub node: Option<u8>,
    begun: BTreeMap<Mux, Begun>,
    /// The sender of the segments of a block transfer: they have no command, and look like any
    /// request or answer.
    segments: Option<Side>,
    /// Two answers to one request.
    suspicion: Option<(Mux, [Frame; 2])>,
    /// Why nothing may be sent any more.
    pub found: Option<String>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Side {
    Client,
    Server,
}

/// The requests to begin a transfer of one object.
#[derive(Clone, Copy, Debug, Default)]
struct Begun {
    requests: u32,
    answers: u32,
    /// The last answer.
    last: Option<Frame>,
}

impl Twins {
    /// How many uploads decide on a suspicion.
    pub(super) const PROBES: u32 = 5;
    /// Of so many both answers must come.
    const DOUBLE: u32 = 4;

    /// Takes a frame that was on the bus. Requests of other clients count as well.
    pub(super) fn see(&mut self, Stamped { frame, .. }: &Stamped) {
        let (Some(node), Some(id)) = (self.node, frame.data_id()) else { return };
        if id == REQUEST_COB_ID + u16::from(node) {
            if self.is_segment(Side::Client, frame) {
                return;
            }
            if let Some(mux) = begins(frame) {
                let begun = self.begun.entry(mux).or_default();
                if begun.answers >= begun.requests {
                    *begun = Begun::default();
                }
                begun.requests += 1;
            }
        } else if id == RESPONSE_COB_ID + u16::from(node)
            && !self.is_segment(Side::Server, frame)
            && let Some(mux) = answers(frame)
            && let Some(begun) = self.begun.get_mut(&mux)
        {
            begun.answers += 1;
            let first = begun.last.replace(*frame);
            if begun.answers > begun.requests
                && let Some(first) = first
            {
                self.suspicion.get_or_insert((mux, [first, *frame]));
            }
        }
    }

    /// Whether the frame, which that side sends, is a segment of a block or belongs between blocks.
    /// Otherwise the transfer has ended, if there was one. An abort has the number of no segment.
    fn is_segment(&mut self, side: Side, frame: &Frame) -> bool {
        let command = frame.data.first().copied().unwrap_or_default();
        let is_one = match self.segments {
            None => false,
            Some(sender) if sender == side => command != ABORT,
            // The start of an upload, and the confirmation of a block.
            Some(Side::Server) => matches!(command, 0xA2 | 0xA3),
            Some(Side::Client) => command == 0xA2,
        };
        if is_one {
            return true;
        }
        self.segments = match Response::decode(&frame.data) {
            Ok(Response::Block(BlockResponse::Upload { .. })) if side == Side::Server => {
                Some(Side::Server)
            }
            Ok(Response::Block(BlockResponse::Download { .. })) if side == Side::Server => {
                Some(Side::Client)
            }
            _ => None,
        };
        false
    }

    /// Whether a request had two answers since the last [`decision`](Self::decide).
    pub(super) const fn suspects(&self) -> bool {
        self.suspicion.is_some()
    }

    /// Decides on the suspicion: `double` of the uploads after it had two answers. A device that
    /// starts meanwhile answers none of them, but no frame is disturbed into another identity.
    pub(super) fn decide(&mut self, double: u32) {
        self.begun.clear();
        let (Some((mux, [first, other])), Some(node)) = (self.suspicion.take(), self.node) else {
            return;
        };
        let differ = identifies(mux) && are_values(&first, &other) && first != other;
        if double < Self::DOUBLE && !differ {
            return;
        }
        let who = match first == other {
            true => format!("two devices have node id {node}, or one answers every request twice"),
            false => format!("two devices have node id {node}"),
        };
        self.found = Some(format!(
            "{who}: a request for {mux} had the answers {first} and {other}, and so had {double} \
             of {} uploads of 1000h. Nothing is sent any more, since it would go to both",
            Self::PROBES
        ));
    }
}

/// Whether the object is the same whenever a device is asked.
pub(super) fn identifies(mux: Mux) -> bool {
    matches!(mux.index, 0x1000 | 0x1018)
}

/// Whether both frames answer an upload with a value.
fn are_values(one: &Frame, other: &Frame) -> bool {
    let is_value =
        |frame: &Frame| matches!(Response::decode(&frame.data), Ok(Response::Upload(..)));
    is_value(one) && is_value(other)
}

/// The command of an abort.
const ABORT: u8 = 0x80;

/// The object of a transfer that the frame begins.
fn begins(frame: &Frame) -> Option<Mux> {
    match Request::decode(&frame.data.padded()).ok()? {
        Request::Upload(mux)
        | Request::Download(mux, _)
        | Request::Block(BlockRequest::Upload { mux, .. } | BlockRequest::Download { mux, .. }) => {
            Some(mux)
        }
        _ => None,
    }
}

/// The object of a transfer of which the frame answers the beginning. A refusal may also come
/// later.
fn answers(frame: &Frame) -> Option<Mux> {
    match Response::decode(&frame.data).ok()? {
        Response::Upload(mux, _)
        | Response::Download(mux)
        | Response::Block(
            BlockResponse::Upload { mux, .. } | BlockResponse::Download { mux, .. },
        ) => Some(mux),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use canopen::Instant;

    use super::*;

    fn twins(frames: &[&str]) -> Twins {
        let mut twins = Twins { node: Some(5), ..Twins::default() };
        for text in frames {
            let (own, text) = text.strip_prefix('>').map_or((false, *text), |text| (true, text));
            let frame = text.parse().unwrap();
            twins.see(&Stamped { at: Instant::ZERO, frame, own });
        }
        twins
    }

    const ASKED: &str = ">605#4000100000000000";
    const ANSWER: &str = "585#4300100091010000";
    const OTHER: &str = "585#4300100092010000";

    #[test]
    fn a_request_with_two_answers_is_a_suspicion() {
        for frames in [
            &[ASKED, ANSWER, ANSWER][..],
            &[ASKED, ANSWER, OTHER],
            &[">605#2B17100064000000", "585#6017100000000000", "585#6017100000000000"],
            // The second answer comes after the next request.
            &[ASKED, ANSWER, ">605#4018100100000000", ANSWER],
        ] {
            assert!(twins(frames).suspects(), "{frames:?}");
        }
        for frames in [
            &[ASKED, ANSWER, ASKED, ANSWER][..],
            // A device that was slow to start, and another client.
            &[ASKED, ASKED, ANSWER, ANSWER],
            &["605#4000100000000000", ANSWER, ASKED, ANSWER],
            &[ASKED, "585#8000100000000206", "585#8000100000000405"],
            &[ANSWER, ANSWER],
        ] {
            assert!(!twins(frames).suspects(), "{frames:?}");
        }
        let mut alone = Twins { node: None, ..twins(&[ASKED, ANSWER]) };
        let frame = ANSWER.parse().unwrap();
        alone.see(&Stamped { at: Instant::ZERO, frame, own: false });
        assert!(!alone.suspects());
    }

    /// Segments 40h and 43h have the form of the request and of the answer of an upload.
    #[test]
    fn segments_of_a_block_are_no_requests_and_no_answers() {
        let looks_asked = ">605#4031323334353637";
        let looks_answered = "585#4331323334353637";
        let download = [">605#C6202F00D0070000", "585#A4202F007F000000"];
        let upload = [">605#A4202F007F000000", "585#C6202F00D0070000", ">605#A3"];
        let blocks = [&download[..], &[looks_asked, ">605#C1", "585#A1"], &upload].concat();
        let all = [&blocks[..], &[looks_answered, looks_answered], &[">605#A27F7F"]].concat();
        assert!(!twins(&all).suspects());
        for end in [">605#8000000000000405", "585#8000000000000405", ">605#A1"] {
            let all = [&upload[..], &[looks_answered, end, ASKED, ANSWER, ANSWER]].concat();
            assert!(twins(&all).suspects(), "{end}");
        }
        let all = [&download[..], &[looks_asked, "585#A1", ASKED, ANSWER, ANSWER]].concat();
        assert!(twins(&all).suspects());
    }

    #[test]
    fn a_frame_that_comes_twice_once_is_not_a_device() {
        let mut twins = twins(&[ASKED, ANSWER, ANSWER]);
        twins.decide(3);
        assert!(!twins.suspects() && twins.found.is_none());
        // One of two devices starts while the uploads decide.
        let mut twins = self::twins(&[ASKED, ANSWER, OTHER]);
        twins.decide(0);
        let found = twins.found.unwrap();
        assert!(
            found.starts_with("two devices have node id 5: a request for 1000:00 had"),
            "{found}"
        );
        let status = ["585#4302100091010000", "585#4302100092010000"];
        let mut twins = self::twins(&[">605#4002100000000000", status[0], status[1]]);
        twins.decide(3);
        assert!(twins.found.is_none(), "a value that changes is no identity");
        let mut twins = self::twins(&[ASKED, ANSWER, ANSWER]);
        twins.decide(4);
        assert!(twins.found.is_some());
    }
}
