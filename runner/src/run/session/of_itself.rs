//! Frames that only the device itself can have made.
//!
//! A case that failed is repeated where the wire or a busy machine may be the reason: what is
//! missing may have been lost, what is late may have waited, what comes twice may have been
//! disturbed at its end, and a value may be the effect of a frame that did not arrive. None of this
//! brings forth an answer to nobody's request, a frame that no service has, or one that the state
//! excludes which the device itself has reported. Such a frame counts, whatever the repeats show.

use std::time::Duration;

use canopen::heartbeat::{self, ErrorControl};
use canopen::monitor::Seen;
use canopen::nmt::{self, Command, NmtState};
use canopen::sdo::{Initiate, REQUEST_COB_ID, RESPONSE_COB_ID, Request, Response};
use canopen::{Frame, Instant, Mux, Stamped, emcy};
use reports::Problem;

/// Why no frame that was lost, late or copied explains the frame of a problem, when that is so.
/// `trace` holds the frames of the attempt, `slack` is how long a frame may wait for a slow wire.
pub(super) fn of_itself(
    problem: &Problem,
    trace: &[Seen],
    node: u8,
    slack: Duration,
) -> Option<&'static str> {
    let raw = problem.raw?;
    let is_it = |seen: &Seen| {
        !seen.stamped.own && seen.stamped.frame == raw && seen.stamped.at <= problem.at
    };
    let place = trace.iter().rposition(is_it)?;
    let mut heard = Heard::of(node);
    trace[..place].iter().for_each(|seen| heard.see(&seen.stamped));
    heard.excludes(&trace[place].stamped, slack)
}

/// What the frames so far say about a node.
struct Heard {
    node: u16,
    server: Server,
    /// Since when it reports STOPPED, unless something came that may change it.
    stopped: Option<Instant>,
    /// Whether its SDO server owed no answer when it reported that.
    owed_nothing: bool,
    /// Since when its heartbeat is off, as it has confirmed, and nobody guards it.
    mute: Option<Instant>,
}

impl Heard {
    /// A frame that waited for the bus when the state changed.
    const SLACK: Duration = Duration::from_millis(20);

    fn of(node: u8) -> Self {
        let server = Server::default();
        Self { node: node.into(), server, stopped: None, owed_nothing: false, mute: None }
    }

    /// Takes the next frame. Requests count whoever sent them.
    fn see(&mut self, seen: &Stamped) {
        let Stamped { at, frame, .. } = seen;
        let error_control = heartbeat::COB_ID + self.node;
        match frame.data_id() {
            Some(nmt::COB_ID) => self.command(frame),
            Some(id) if id == REQUEST_COB_ID + self.node => self.server.request(frame),
            Some(id) if id == RESPONSE_COB_ID + self.node => {
                const PRODUCER_TIME: Mux = Mux::new(0x1017, 0);
                if let Some((Request::Download(PRODUCER_TIME, value), Response::Download(_))) =
                    self.server.answer(frame)
                {
                    self.mute = (value == Initiate::Expedited([0, 0].into())).then_some(*at);
                }
            }
            Some(id) if id == error_control => self.report(*at, frame),
            // Its answers come from now on.
            None if frame.id.as_standard() == Some(error_control) => self.mute = None,
            _ => {}
        }
    }

    fn command(&mut self, frame: &Frame) {
        let Ok(command) = Command::decode(&frame.data) else { return };
        if [0, self.node].contains(&command.node.into()) {
            (self.stopped, self.mute) = (None, None);
        }
    }

    fn report(&mut self, at: Instant, frame: &Frame) {
        let state = ErrorControl::decode(&frame.data).map(|report| report.state);
        if state == Ok(NmtState::INITIALISING) {
            self.mute = None;
        }
        if state != Ok(NmtState::STOPPED) {
            self.stopped = None;
        } else if self.stopped.is_none() {
            (self.stopped, self.owed_nothing) = (Some(at), self.server.owes_nothing());
        }
    }

    /// Why the node sent this of itself.
    fn excludes(&self, seen: &Stamped, slack: Duration) -> Option<&'static str> {
        const NO_SERVICE: &str = "no service has such a frame";
        let Stamped { at, frame, .. } = seen;
        let id = frame.data_id()?;
        let long_since = |when: Instant| at.since(when) > Self::SLACK + slack;
        let stopped = self.stopped.is_some_and(long_since);
        if id == RESPONSE_COB_ID + self.node {
            return match () {
                () if frame.data.len() != 8 => Some(NO_SERVICE),
                () if !self.server.may_answer(frame) => Some("nobody asked its SDO server for it"),
                () if stopped && self.owed_nothing => Some("it had reported STOPPED before"),
                () => None,
            };
        }
        if id == heartbeat::COB_ID + self.node {
            let Some(state) = state(frame) else { return Some(NO_SERVICE) };
            let unasked = state != NmtState::INITIALISING && self.mute.is_some_and(long_since);
            return unasked.then_some("its heartbeat was off, and nobody guarded it");
        }
        if id == emcy::COB_ID + self.node {
            return (frame.data.len() != 8).then_some(NO_SERVICE);
        }
        let is_pdo = id & 0x7F == self.node && matches!(id & 0x780, 0x180 | 0x280 | 0x380 | 0x480);
        (is_pdo && stopped).then_some("it had reported STOPPED before")
    }
}

/// The state that a frame of error control reports, if there is such a state.
fn state(frame: &Frame) -> Option<NmtState> {
    let state = ErrorControl::decode(&frame.data).ok()?.state;
    let known = [
        NmtState::INITIALISING,
        NmtState::STOPPED,
        NmtState::OPERATIONAL,
        NmtState::PRE_OPERATIONAL,
    ];
    known.contains(&state).then_some(state)
}

/// What an SDO server may still answer. It serves one request after the other: once a later one is
/// answered, no answer to an earlier one, or to a copy of it, is under way.
#[derive(Default)]
struct Server {
    /// The object of the last request that was served in one exchange, of which a copy may come.
    served: Option<Mux>,
    /// The requests since that one exchange may serve.
    asked: Vec<Request>,
    /// Whether another one came since, such as a segment, of which any answer may come.
    others: bool,
}

impl Server {
    fn request(&mut self, frame: &Frame) {
        match Request::decode(&frame.data) {
            Ok(request) if object(&request).is_some() => self.asked.push(request),
            _ => self.others = true,
        }
    }

    /// Takes an answer; the exchange that ended with it.
    fn answer(&mut self, frame: &Frame) -> Option<(Request, Response)> {
        let request = *self.asked.last()?;
        let response = Response::decode(&frame.data).ok()?;
        let of = match (&request, &response) {
            (
                Request::Upload(_),
                Response::Upload(of, Initiate::Expedited(_) | Initiate::Unsized(_)),
            )
            | (Request::Download(..), Response::Download(of))
            | (_, Response::Abort(of, _)) => *of,
            _ => return None,
        };
        if object(&request) != Some(of) {
            return None;
        }
        *self = Self { served: Some(of), ..Self::default() };
        Some((request, response))
    }

    /// Whether each request was answered.
    const fn owes_nothing(&self) -> bool {
        self.asked.is_empty() && !self.others
    }

    /// Whether a request, or a copy of one, explains the answer. What was asked before the first
    /// exchange is not known.
    fn may_answer(&self, frame: &Frame) -> bool {
        let Some(served) = self.served.filter(|_| !self.others) else { return true };
        match Response::decode(&frame.data) {
            Ok(Response::Upload(of, _) | Response::Download(of) | Response::Abort(of, _)) => {
                served == of || self.asked.iter().any(|request| object(request) == Some(of))
            }
            _ => false,
        }
    }
}

/// The object of a request that one exchange may serve.
const fn object(request: &Request) -> Option<Mux> {
    match request {
        Request::Upload(mux)
        | Request::Download(mux, Initiate::Expedited(_) | Initiate::Unsized(_)) => Some(*mux),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use reports::{Excerpt, Phase};

    use super::*;

    /// What is said of the last of `ms frame` lines (`>` in front of own ones) on node 5.
    fn said(lines: &[&str]) -> Option<&'static str> {
        let seen = |line: &&str| {
            let (ms, text) = line.split_once(' ').unwrap();
            let frame = text.trim_start_matches('>').parse().unwrap();
            let at = Instant(ms.parse::<u64>().unwrap() * 1_000_000);
            let stamped = Stamped { at, frame, own: text.starts_with('>') };
            Seen { stamped, expected: false }
        };
        let trace: Vec<Seen> = lines.iter().map(seen).collect();
        let last = trace.last().unwrap().stamped;
        let problem = Problem {
            at: last.at,
            phase: Phase::Step,
            place: Excerpt { line: 1, column: 1, length: 1, ..Excerpt::default() },
            expected: String::new(),
            actual: String::new(),
            raw: Some(last.frame),
            apart: None,
            sheet: None,
            notes: Vec::new(),
            capped: false,
        };
        of_itself(&problem, &trace, 5, Duration::ZERO)
    }

    fn after(before: &[&str], lines: &[&str]) -> Option<&'static str> {
        said(&[before, lines].concat())
    }

    const ASKED: &[&str] = &["0 >605#4001100000000000", "1 585#4F01100000000000"];
    const ANSWER: &str = "9 585#4300100091010000";

    #[test]
    fn an_answer_is_explained_by_requests_that_are_not_answered_and_by_the_last_one() {
        let unasked = Some("nobody asked its SDO server for it");
        for request in ["605#R8", "00000605#4000100000000000", "615#4000100000000000"] {
            assert_eq!(after(ASKED, &[&format!("2 >{request}"), ANSWER]), unasked, "{request}");
        }
        // Asked, by the tester or by another client.
        assert_eq!(after(ASKED, &["2 >605#4000100000000000", ANSWER]), None);
        assert_eq!(after(ASKED, &["2 605#4000100000000000", ANSWER]), None);
        // Once more what was served last, which may come of a copy; before it, it may not.
        assert_eq!(after(ASKED, &[ASKED[1]]), None);
        let other = ["2 >605#4000100000000000", "3 585#4300100091010000"];
        assert_eq!(after(ASKED, &[other[0], other[1], "9 585#4F01100000000000"]), unasked);
        // What was asked before the trace begins is not known.
        assert_eq!(said(&[ANSWER]), None);
        // A request that has no answer yet, and one that began a transfer.
        let late = ["2 >605#4000100000000000", "3 >605#4018100100000000", ANSWER];
        assert_eq!(after(ASKED, &late), None);
        let long = ["2 >605#4008100000000000", "3 585#4108100009000000"];
        assert_eq!(after(ASKED, &[&long[..], &["9 585#8008100000000405"]].concat()), None);
        assert_eq!(after(ASKED, &[&long[..], &["4 >605#60", ANSWER]].concat()), None);
        assert_eq!(after(ASKED, &["2 >605#C208100009000000", ANSWER]), None);
        // A segment that nobody asked for.
        assert_eq!(after(ASKED, &["9 585#0061626300000000"]), unasked);
    }

    #[test]
    fn no_wire_makes_a_frame_that_no_service_has() {
        let no_service = Some("no service has such a frame");
        for frame in ["585#60171000", "085#00", "705#7F00", "705#03", "705#"] {
            assert_eq!(said(&[&format!("1 {frame}")]), no_service, "{frame}");
        }
        for frame in ["705#00", "705#84", "085#0000000000000000", "185#"] {
            assert_eq!(said(&[&format!("1 {frame}")]), None, "{frame}");
        }
    }

    #[test]
    fn a_device_is_held_to_the_state_that_it_reports() {
        let stopped = &["0 >000#0205", "5 705#04"];
        let denied = Some("it had reported STOPPED before");
        assert_eq!(after(stopped, &["26 185#01"]), denied);
        // The command alone may have been lost; what waited for the bus may follow the report.
        assert_eq!(said(&["0 >000#0205", "26 185#01"]), None);
        assert_eq!(after(stopped, &["24 185#01"]), None);
        for ends in ["7 >000#0105", "7 000#8100", "7 705#05", "7 705#00"] {
            assert_eq!(after(stopped, &[ends, "40 185#01"]), None, "{ends}");
        }
        assert_eq!(after(stopped, &["7 >000#0106", "40 185#01"]), denied);
        let asked = ["10 >605#4000100000000000", "30 585#4300100091010000"];
        assert_eq!(after(&[ASKED, stopped].concat(), &asked), denied);
        let before = ["0 >605#4000100000000000", "1 705#04", "30 585#4300100091010000"];
        assert_eq!(said(&before), None);
    }

    #[test]
    fn a_heartbeat_that_is_off_is_silent_unless_the_node_is_guarded() {
        let off = &["0 >605#2B17100000000000", "1 585#6017100000000000"];
        let unasked = Some("its heartbeat was off, and nobody guarded it");
        assert_eq!(after(off, &["22 705#7F"]), unasked);
        assert_eq!(after(off, &["5 >00000705#R", "22 705#7F"]), unasked);
        assert_eq!(after(off, &["5 705#7F"]), None);
        assert_eq!(after(off, &["22 705#00"]), None);
        for ends in ["5 >705#R", "5 705#R", "5 >000#8205", "5 705#00"] {
            assert_eq!(after(off, &[ends, "40 705#7F"]), None, "{ends}");
        }
        let on = ["0 >605#2B17100064000000", "1 585#6017100000000000"];
        assert_eq!(after(off, &[on[0], on[1], "40 705#7F"]), None);
        let refused = ["0 >605#2B17100000000000", "1 585#8017100000000206"];
        assert_eq!(after(&refused, &["40 705#7F"]), None);
    }
}
