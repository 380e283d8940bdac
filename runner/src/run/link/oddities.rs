//! Wrong answers with the node id of the device. With them, every verdict would be about something
//! else than the user thinks.

use std::collections::BTreeMap;

use canopen::heartbeat::ErrorControl;
use canopen::monitor::Seen;
use canopen::nmt::{self, Command, Service};
use canopen::sdo::{REQUEST_COB_ID, RESPONSE_COB_ID, Request, Response};
use canopen::{Frame, Mux};

use super::twins::identifies;

/// Sentences about it, each with the frames that show it. In the trace, the tester has done nothing
/// but reset and start the device, upload objects, and give it a heartbeat for a moment.
pub fn oddities(trace: &[Seen], node: u8) -> Vec<String> {
    let said = [several(trace, node), short(trace, node), garbage(trace, node)];
    said.into_iter().flatten().collect()
}

/// That two devices have the node id, where that is certain: answers to one upload of what never
/// changes contradict each other. A write would go to both, and the original value of one of them
/// could not be read.
pub(in crate::run) fn contradiction(trace: &[Seen], node: u8) -> Option<String> {
    let uploads = uploads(trace, node);
    let identities = uploads.iter().filter(|(mux, _)| identifies(**mux));
    let mut several = identities.filter(|(_, upload)| upload.answers.len() > upload.requests);
    several.find_map(|(mux, upload)| {
        let first = upload.answers.first()?;
        let other = upload.answers.iter().find(|answer| *answer != first)?;
        Some(format!(
            "two devices have node id {node}: an upload of {mux} had the answers {first} and \
             {other}; no case was run, since it would write to both"
        ))
    })
}

/// More answers than requests, or more boot-up messages than resets.
fn several(trace: &[Seen], node: u8) -> Option<String> {
    let two = |what: String| {
        format!("two devices may have node id {node}, or one device sends twice: {what}")
    };
    let uploads = uploads(trace, node);
    let twice = uploads.iter().find(|(_, upload)| upload.answers.len() > upload.requests);
    if let Some((mux, Upload { requests, answers })) = twice {
        let requests =
            if *requests == 1 { "1 upload".to_owned() } else { format!("{requests} uploads") };
        let last = answers.iter().rev().take(2).rev().map(Frame::to_string).collect::<Vec<_>>();
        let count = answers.len();
        return Some(two(format!(
            "{requests} of {mux} had {count} answers, such as {}",
            last.join(" and ")
        )));
    }
    let boots = boot_ups_after_a_reset(trace, node);
    (boots > 1).then(|| two(format!("{boots} boot-up messages followed one reset")))
}

/// The uploads of one object.
#[derive(Default)]
struct Upload {
    requests: usize,
    answers: Vec<Frame>,
}

/// The uploads that were asked for.
fn uploads(trace: &[Seen], node: u8) -> BTreeMap<Mux, Upload> {
    let mut uploads: BTreeMap<Mux, Upload> = BTreeMap::new();
    for seen in trace {
        match (request(seen, node), answer(seen, node)) {
            (Some(Request::Upload(mux)), _) => uploads.entry(mux).or_default().requests += 1,
            (_, Some(Response::Upload(mux, _))) => {
                uploads.entry(mux).or_default().answers.push(seen.stamped.frame);
            }
            _ => {}
        }
    }
    uploads.retain(|_, upload| upload.requests > 0);
    uploads
}

/// The largest number of boot-up messages between two resets, those before the first left out.
fn boot_ups_after_a_reset(trace: &[Seen], node: u8) -> usize {
    let boot_up = ErrorControl::BOOT_UP.frame(node);
    let (mut most, mut count) = (0, None);
    for seen in trace {
        let stamped = &seen.stamped;
        if stamped.own && resets(&stamped.frame) {
            count = Some(0);
        } else if !stamped.own && stamped.frame == boot_up {
            count = count.map(|count| count + 1);
            most = most.max(count.unwrap_or(0));
        }
    }
    most
}

fn resets(frame: &Frame) -> bool {
    let resets = [Service::RESET_NODE, Service::RESET_COMMUNICATION];
    frame.data_id() == Some(nmt::COB_ID)
        && Command::decode(&frame.data).is_ok_and(|command| resets.contains(&command.service))
}

/// Answers of less than 8 bytes.
fn short(trace: &[Seen], node: u8) -> Option<String> {
    let frame = answers(trace, node).find(|frame| frame.data.len() != 8)?;
    let bytes = frame.data.len();
    Some(format!("it answers SDO with {bytes} bytes where 8 are required: {frame}"))
}

/// Answers that belong to no upload, nor to a download.
fn garbage(trace: &[Seen], node: u8) -> Option<String> {
    let (mut asked, mut written) = (Vec::new(), Vec::new());
    for seen in trace {
        match request(seen, node) {
            Some(Request::Upload(mux)) => asked.push(mux),
            Some(Request::Download(mux, _)) => written.push(mux),
            _ => {}
        }
        let fits = match answer(seen, node) {
            None | Some(Response::UploadSegment(_)) => true,
            Some(Response::Upload(mux, _)) => asked.contains(&mux),
            Some(Response::Download(mux)) => written.contains(&mux),
            Some(Response::Abort(mux, _)) => asked.contains(&mux) || written.contains(&mux),
            Some(_) => false,
        };
        if !fits && !asked.is_empty() {
            let frame = seen.stamped.frame;
            let last = asked.last().map(Mux::to_string).unwrap_or_default();
            let meaning = canopen::meaning(&frame);
            return Some(format!("it answers an upload of {last} with {frame} ({meaning})"));
        }
    }
    None
}

fn request(seen: &Seen, node: u8) -> Option<Request> {
    let stamped = &seen.stamped;
    let is_request =
        stamped.own && stamped.frame.data_id() == Some(REQUEST_COB_ID + u16::from(node));
    is_request.then(|| Request::decode(&stamped.frame.data).ok())?
}

fn answer(seen: &Seen, node: u8) -> Option<Response> {
    let frame = &seen.stamped.frame;
    let is_answer = !seen.stamped.own && frame.data_id() == Some(RESPONSE_COB_ID + u16::from(node));
    is_answer.then(|| Response::decode(&frame.data).ok())?
}

fn answers(trace: &[Seen], node: u8) -> impl Iterator<Item = &Frame> {
    let frames = trace.iter().map(|seen| &seen.stamped).filter(|seen| !seen.own);
    let frames = frames.map(|seen| &seen.frame);
    frames.filter(move |frame| frame.data_id() == Some(RESPONSE_COB_ID + u16::from(node)))
}

#[cfg(test)]
mod tests {
    use canopen::{Instant, Stamped};

    use super::*;

    /// Frames in candump form; those with `>` are of the tester.
    fn seen(frames: &[&str]) -> Vec<Seen> {
        let seen = |text: &&str| {
            let (own, text) = text.strip_prefix('>').map_or((false, *text), |text| (true, text));
            let frame = text.parse().unwrap();
            Seen { stamped: Stamped { at: Instant::ZERO, frame, own }, expected: false }
        };
        frames.iter().map(seen).collect()
    }

    fn said(frames: &[&str]) -> Vec<String> {
        oddities(&seen(frames), 5)
    }

    const ASKED: &str = ">605#4000100000000000";
    const ANSWER: &str = "585#4300100091010000";

    #[test]
    fn a_device_in_order_is_not_remarked_on() {
        let segment = ["585#4108100009000000", ">605#6000000000000000", "585#0161626300000000"];
        let upload = [ASKED, ANSWER, ">605#4008100000000000"];
        assert_eq!(said(&[&upload[..], &segment].concat()), [""; 0]);
        // A device that was slow to start answers each request once.
        assert_eq!(said(&[ASKED, ASKED, "705#00", ANSWER, ANSWER]), [""; 0]);
        assert_eq!(said(&["705#00", ">000#8105", "705#00", ">000#8205", "705#00"]), [""; 0]);
        assert_eq!(said(&[ASKED, "585#8000100000000206", "586#FFFF"]), [""; 0]);
        // A transfer of another client, before the tester sent a request.
        assert_eq!(said(&["585#6000200000000000", ASKED, ANSWER]), [""; 0]);
    }

    #[test]
    fn answers_that_contradict_each_other_are_of_two_devices() {
        let other = "585#4300100092010000";
        let contradiction = |frames: &[&str]| contradiction(&seen(frames), 5);
        let said = contradiction(&[ASKED, ANSWER, other]);
        let expected = "two devices have node id 5: an upload of 1000:00 had the answers \
                        585#4300100091010000 and 585#4300100092010000; no case was run, since it \
                        would write to both";
        assert_eq!(said.as_deref(), Some(expected));
        // One device may send twice, or answer late and have changed in between.
        assert_eq!(contradiction(&[ASKED, ANSWER, ANSWER]), None);
        assert_eq!(contradiction(&[ASKED, ASKED, ANSWER, other]), None);
    }

    #[test]
    fn what_shows_that_it_is_not_in_order() {
        for (frames, expected) in [
            (
                vec![ASKED, ANSWER, "585#4300100092010000"],
                "two devices may have node id 5, or one device sends twice: 1 upload of 1000:00 \
                 had 2 answers, such as 585#4300100091010000 and 585#4300100092010000",
            ),
            (
                vec![">000#8105", "705#00", "705#00"],
                "two devices may have node id 5, or one device sends twice: 2 boot-up messages \
                 followed one reset",
            ),
            (
                vec![ASKED, "585#43001000"],
                "it answers SDO with 4 bytes where 8 are required: 585#43001000",
            ),
            (
                vec![ASKED, "585#FF01020304050607"],
                "it answers an upload of 1000:00 with 585#FF01020304050607 (SDO node 5: unknown \
                 command specifier 7: FF 01 02 03 04 05 06 07)",
            ),
            (
                vec![ASKED, "585#4300200091010000"],
                "it answers an upload of 1000:00 with 585#4300200091010000 (SDO node 5: uploaded \
                 2000:00 = 91 01 00 00 (4 bytes))",
            ),
        ] {
            assert_eq!(said(&frames), [expected]);
        }
    }
}
