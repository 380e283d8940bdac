//! Observers that watch a node all the time, regardless of the test.
//!
//! A monitor sees every frame in order, and whether a step waited for it. A frame that breaks a
//! rule that always holds is a [`Breach`].

use std::fmt;
use std::time::Duration;

use crate::abort::Abort;
use crate::bus::Stamped;
use crate::emcy::{self, Emcy, EmcyCode};
use crate::frame::{Frame, Id};
use crate::heartbeat::{self, ErrorControl};
use crate::lss;
use crate::mux::Mux;
use crate::nmt::{self, NmtState, Service};
use crate::pdo::{CobId, holds_cob_id};
use crate::sdo::block::{BlockRequest, BlockResponse};
use crate::sdo::{self, Initiate, Request, Response};
use crate::time::Instant;

/// A frame as a monitor sees it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Seen {
    /// The frame.
    pub stamped: Stamped,
    /// Whether a step of the test waited for it.
    pub expected: bool,
}

/// A rule that holds always, broken.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Breach {
    /// When.
    pub at: Instant,
    /// The rule that was broken.
    pub rule: String,
    /// The actual behaviour.
    pub got: String,
    /// The frame, when it is one.
    pub frame: Option<Frame>,
}

impl fmt::Display for Breach {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.rule, self.got)
    }
}

/// Watches one node.
pub trait Monitor {
    /// Takes the next frame.
    ///
    /// # Errors
    /// The rule that this frame breaks.
    fn observe(&mut self, seen: &Seen) -> Result<(), Breach>;

    /// Takes note that nothing more came until `now`.
    ///
    /// # Errors
    /// The rule that the silence breaks.
    fn finish(&mut self, _now: Instant) -> Result<(), Breach> {
        Ok(())
    }
}

/// The errors that a device has from the start, and reports whenever it starts.
#[derive(Clone, Debug, Default)]
pub struct Standing {
    /// Their codes.
    pub codes: Vec<EmcyCode>,
    /// The bits of 1001h for which the device sent no code because its emergency messages were
    /// disabled.
    pub untold: u8,
}

impl Standing {
    /// Whether there are any.
    const fn is_any(&self) -> bool {
        !self.codes.is_empty() || self.untold != 0
    }

    /// Whether a message is about one of them.
    fn explains(&self, emcy: &Emcy) -> bool {
        let untold = self.untold != 0 && emcy.register & !self.untold == 0;
        untold || self.codes.contains(&emcy.code)
    }
}

/// What is known of a node that is watched.
#[derive(Clone, Debug, Default)]
pub struct Watched {
    /// Its node id.
    pub node: u8,
    /// The identifiers it may use beside those of the predefined connection set; `None` where
    /// others share its bus, since a frame does not say who sent it.
    pub known: Option<Vec<Id>>,
    /// The identifiers of its TPDOs.
    pub tpdos: Vec<Id>,
    /// The errors that it had before the first case.
    pub standing: Standing,
    /// How late a frame may be because others are on a slow wire; there, each frame of the tester
    /// may hold up a heartbeat as long.
    pub slack: Duration,
    /// How long the device may stand still without a fault of its own, such as a program that
    /// waits for the processor.
    pub hold_up: Duration,
}

/// The monitors that watch a node in every case.
pub fn all(watched: Watched) -> Vec<Box<dyn Monitor>> {
    let Watched { node, known, tpdos, standing, slack, hold_up } = watched;
    let mut monitors: Vec<Box<dyn Monitor>> = vec![
        Box::new(NoSurprise {
            node,
            slack,
            stands: standing.is_any(),
            standing,
            ..NoSurprise::default()
        }),
        Box::new(HeartbeatAlive {
            node,
            slack,
            hold_up,
            own: 0,
            asked: None,
            period: None,
            last: None,
        }),
        Box::new(SilentWhenStopped { node, stopped: false, asked: false }),
        Box::new(NoPdoOutsideOperational { node, tpdos, slack, said: None, sent: None }),
    ];
    if let Some(known) = known {
        monitors.push(Box::new(KnownIdentifiers { node, known }));
    }
    monitors
}

/// No unexpected emergency message or boot-up, and no second SDO answer.
#[derive(Default)]
struct NoSurprise {
    node: u8,
    /// Errors that no case caused.
    standing: Standing,
    /// Whether one of them may be present, so that its end is no surprise.
    stands: bool,
    history_cleared: bool,
    /// Commands that a boot-up may still be the answer to.
    resets: u32,
    /// Whether a setting was stored in LSS configuration state.
    lss_stored: bool,
    /// Whether that state was left since then: some devices restart with the setting.
    lss_left: bool,
    /// Requests that have no answer yet: they may be sent faster than they are answered.
    asked: u32,
    /// The object of the transfer that has begun and, as far as one frame tells, not ended.
    open: Option<Mux>,
    /// Whether requests are segments of a block, whose first byte is no command.
    in_a_block: bool,
    /// The object of a transfer that a command of the NMT interrupted.
    interrupted: Option<Mux>,
    /// Whether the server sends segments of a block.
    uploads_a_block: bool,
    /// When the tester aborted a transfer whose segments came.
    cut: Option<Instant>,
    /// How late a frame may be because others are on a slow wire.
    slack: Duration,
}

impl NoSurprise {
    const ERROR_COUNT: Mux = Mux::new(0x1003, 0);

    /// The queue of a controller, which may hold segments when the abort of the client is read.
    const ON_THEIR_WAY: Duration = Duration::from_millis(20);

    /// Takes note of what the tester sent.
    fn sent(&mut self, at: Instant, frame: &Frame) {
        if frame.data_id() == Some(sdo::REQUEST_COB_ID + u16::from(self.node)) {
            self.asked += 1;
            let request = Request::decode(&frame.data);
            self.history_cleared |= matches!(request, Ok(Request::Download(Self::ERROR_COUNT, _)));
            match request {
                Ok(Request::Abort(..)) => {
                    (self.open, self.in_a_block) = (None, false);
                    self.cut = std::mem::take(&mut self.uploads_a_block).then_some(at);
                }
                Ok(Request::Block(BlockRequest::UploadStart)) if !self.in_a_block => {
                    self.uploads_a_block = true;
                }
                Ok(Request::Block(BlockRequest::UploadEnd)) => self.uploads_a_block = false,
                Ok(request) if !self.in_a_block => self.open = initiated(request).or(self.open),
                _ => {}
            }
        }
        if frame.data_id() == Some(lss::REQUEST_COB_ID) {
            match lss::Request::decode(&frame.data) {
                Ok(lss::Request::Store) => self.lss_stored = true,
                Ok(lss::Request::SwitchGlobal(lss::Mode::WAITING)) => {
                    self.lss_left = std::mem::take(&mut self.lss_stored);
                }
                _ => {}
            }
        }
        if let Some(service) = commanded(frame, self.node) {
            self.lss_left = false;
            self.resets += u32::from(resets(service));
            self.interrupted = self.open.take();
            self.in_a_block &= !resets(service);
        }
    }

    /// Takes note of an answer.
    fn answered(&mut self, frame: &Frame) {
        match Response::decode(&frame.data) {
            Ok(Response::Block(BlockResponse::Download { .. })) => self.in_a_block = true,
            Ok(Response::Block(BlockResponse::DownloadEnd)) => self.in_a_block = false,
            Ok(Response::Abort(mux, _)) => {
                self.open.take_if(|open| *open == mux);
                (self.in_a_block, self.uploads_a_block) = (false, false);
            }
            Ok(Response::Upload(mux, Initiate::Expedited(_) | Initiate::Unsized(_))) => {
                self.open.take_if(|open| *open == mux);
            }
            _ => {}
        }
    }

    /// Whether a server may send this unasked. It may give up an open transfer at any time, and a
    /// transfer that a command interrupts is not continued.
    fn gives_up(&mut self, frame: &Frame) -> bool {
        let Ok(Response::Abort(mux, code)) = Response::decode(&frame.data) else { return false };
        code == Abort::TIMEOUT && self.open.take_if(|open| *open == mux).is_some()
            || self.interrupted.take_if(|open| *open == mux).is_some()
    }

    /// Whether this may be a segment of a block, of which one request asks for many.
    fn is_segment(&self, frame: &Frame) -> bool {
        const LAST: u8 = 0x80;
        self.uploads_a_block && frame.data.first().is_some_and(|first| first & !LAST != 0)
    }

    /// Whether this may be a segment that was on its way when the tester aborted its transfer.
    fn was_on_its_way(&self, seen: &Seen) -> bool {
        let since = |cut| seen.stamped.at.since(cut);
        self.cut.is_some_and(|cut| since(cut) <= Self::ON_THEIR_WAY + self.slack)
    }

    /// Whether an emergency message has a cause: an error that stands, or its end, or that the
    /// history was cleared, which may be reported as the reset of all errors.
    fn is_explained(&mut self, frame: &Frame) -> bool {
        let Ok(emcy) = Emcy::decode(&frame.data) else { return false };
        if emcy.code == EmcyCode::RESET {
            return std::mem::take(&mut self.stands) || emcy.register == 0 && self.history_cleared;
        }
        let stands = self.standing.explains(&emcy);
        self.stands |= stands;
        stands
    }
}

impl Monitor for NoSurprise {
    fn observe(&mut self, seen: &Seen) -> Result<(), Breach> {
        let node = u16::from(self.node);
        let frame = &seen.stamped.frame;
        if seen.stamped.own {
            self.sent(seen.stamped.at, frame);
        }
        let booted = incoming(seen) == Some(heartbeat::COB_ID + node)
            && ErrorControl::decode(&frame.data) == Ok(ErrorControl::BOOT_UP);
        if booted && self.resets > 0 {
            self.resets -= 1;
            return Ok(());
        }
        if booted && std::mem::take(&mut self.lss_left) {
            return Ok(());
        }
        let answer = incoming(seen) == Some(sdo::RESPONSE_COB_ID + node);
        let asked = answer && self.asked > 0;
        self.asked -= u32::from(asked);
        if asked {
            self.answered(frame);
        }
        let Some(id) = incoming(seen).filter(|_| !seen.expected) else { return Ok(()) };
        if id == emcy::COB_ID + node {
            if self.is_explained(frame) {
                return Ok(());
            }
            let got = Emcy::decode(&frame.data)
                .map_or_else(|error| error.to_string(), |emcy| format!("emergency {}", emcy.code));
            return Err(breach(seen, "no emergency message without a cause", got));
        }
        if booted {
            let got = "the node booted".to_owned();
            return Err(breach(seen, "no boot-up without a reset", got));
        }
        let unasked = id == sdo::RESPONSE_COB_ID + node && !asked;
        let of_transfer = self.is_segment(frame) || self.was_on_its_way(seen);
        if unasked && !of_transfer && !self.gives_up(frame) {
            let got = "an SDO answer without a request".to_owned();
            return Err(breach(seen, "at most one SDO answer to a request", got));
        }
        Ok(())
    }
}

/// The command that the frame gives this node.
fn commanded(frame: &Frame, node: u8) -> Option<Service> {
    frame.data_id().filter(|id| *id == nmt::COB_ID)?;
    let command = nmt::Command::decode(&frame.data).ok()?;
    [0, node].contains(&command.node).then_some(command.service)
}

/// The object of the transfer that a request initiates and its answer does not end.
fn initiated(request: Request) -> Option<Mux> {
    match request {
        Request::Upload(mux)
        | Request::Download(mux, Initiate::Segmented(_))
        | Request::Block(BlockRequest::Upload { mux, .. } | BlockRequest::Download { mux, .. }) => {
            Some(mux)
        }
        _ => None,
    }
}

/// No identifier but those the node owns, as far as no other node can be the sender. One of 29 bits
/// tells nothing about the sender.
struct KnownIdentifiers {
    node: u8,
    known: Vec<Id>,
}

/// Whether a device with this node id may use the identifier, or one with another node id does by
/// default; `known` are those that its data sheet gives it.
pub fn is_anybodys(id: u16, node: u8, known: &[Id]) -> bool {
    let (function, of) = (id & 0x780, id & 0x7F);
    let node = u16::from(node);
    let own = [emcy::COB_ID, sdo::RESPONSE_COB_ID, heartbeat::COB_ID].map(|base| base + node);
    let default_pdo = of == node && matches!(function, 0x180 | 0x280 | 0x380 | 0x480);
    let of_another =
        of != node && of != 0 && matches!(function, 0x080 | 0x180..=0x580 | 0x600 | 0x700);
    let lss = id == lss::RESPONSE_COB_ID;
    own.contains(&id) || default_pdo || lss || known.contains(&id.into()) || of_another
}

/// The identifier that a request gives a service of the node.
pub fn given(frame: &Frame, node: u8) -> Option<Id> {
    let (_, value) = sdo::written(frame, node).filter(|(mux, _)| holds_cob_id(*mux))?;
    value.first_chunk().map(|cob_id| CobId(u32::from_le_bytes(*cob_id)).can_id())
}

impl Monitor for KnownIdentifiers {
    fn observe(&mut self, seen: &Seen) -> Result<(), Breach> {
        if seen.stamped.own {
            self.known.extend(given(&seen.stamped.frame, self.node));
        }
        let Some(id) = incoming(seen).filter(|_| !seen.expected) else { return Ok(()) };
        if is_anybodys(id, self.node, &self.known) {
            return Ok(());
        }
        Err(breach(seen, "no identifier that the node does not own", format!("{id:03X}h")))
    }
}

/// Once a heartbeat period is set and the heartbeat has begun, no gap may exceed two periods.
struct HeartbeatAlive {
    node: u8,
    slack: Duration,
    hold_up: Duration,
    /// How many frames of the tester came since the last heartbeat.
    own: u32,
    asked: Option<Duration>,
    period: Option<Duration>,
    last: Option<Instant>,
}

impl HeartbeatAlive {
    const PRODUCER_TIME: Mux = Mux::new(0x1017, 0);

    fn gap(&self, now: Instant) -> Option<Duration> {
        let (period, last) = self.period.zip(self.last)?;
        let gap = now.since(last);
        let bears = Self::SLACK + self.hold_up + self.slack * (self.own + 1);
        (gap > period * 2 + bears).then_some(gap)
    }

    /// A frame in front of the heartbeat, and a host that is late by a few milliseconds.
    const SLACK: Duration = Duration::from_millis(5);

    fn judge(&self, now: Instant, frame: Option<Frame>) -> Result<(), Breach> {
        let (Some(gap), Some(period)) = (self.gap(now), self.period) else { return Ok(()) };
        let rule = format!("a heartbeat every {} ms", period.as_millis());
        let got = format!("none for {} ms", gap.as_millis());
        Err(Breach { at: now, rule, got, frame })
    }
}

impl Monitor for HeartbeatAlive {
    fn observe(&mut self, seen: &Seen) -> Result<(), Breach> {
        let Stamped { at, frame, own } = seen.stamped;
        let node = u16::from(self.node);
        self.own += u32::from(own);
        match frame.data_id() {
            Some(nmt::COB_ID) if own => {
                let command = nmt::Command::decode(&frame.data).ok();
                if command.is_some_and(|command| resets(command.service)) {
                    (self.period, self.last) = (None, None);
                }
            }
            Some(id) if own && id == sdo::REQUEST_COB_ID + node => {
                self.asked = match Request::decode(&frame.data) {
                    Ok(Request::Download(Self::PRODUCER_TIME, Initiate::Expedited(data))) => {
                        let low = data.first().copied().unwrap_or(0);
                        let high = data.get(1).copied().unwrap_or(0);
                        Some(Duration::from_millis(u16::from_le_bytes([low, high]).into()))
                    }
                    _ => None,
                };
            }
            Some(id) if !own && id == sdo::RESPONSE_COB_ID + node => {
                if let (Some(period), Ok(Response::Download(Self::PRODUCER_TIME))) =
                    (self.asked.take(), Response::decode(&frame.data))
                {
                    self.period = Some(period).filter(|period| !period.is_zero());
                    self.last = None;
                }
            }
            // Another check decides whether it may boot; here its heartbeat restarts.
            Some(_) if !own && frame == ErrorControl::BOOT_UP.frame(self.node) => {
                (self.period, self.last) = (None, None);
            }
            Some(id) if !own && id == heartbeat::COB_ID + node => {
                let judged = self.judge(at, Some(frame));
                (self.last, self.own) = (Some(at), 0);
                return judged;
            }
            _ => {}
        }
        Ok(())
    }

    fn finish(&mut self, now: Instant) -> Result<(), Breach> {
        self.judge(now, None)
    }
}

/// In STOPPED, no answer to an SDO request.
struct SilentWhenStopped {
    node: u8,
    stopped: bool,
    asked: bool,
}

impl Monitor for SilentWhenStopped {
    fn observe(&mut self, seen: &Seen) -> Result<(), Breach> {
        let Stamped { frame, own, .. } = seen.stamped;
        let node = u16::from(self.node);
        match frame.data_id() {
            Some(nmt::COB_ID) if own => {
                if let Ok(command) = nmt::Command::decode(&frame.data)
                    && [0, self.node].contains(&command.node)
                {
                    (self.stopped, self.asked) = (command.service == Service::STOP, false);
                }
            }
            Some(id) if own && id == sdo::REQUEST_COB_ID + node => self.asked = self.stopped,
            Some(id) if !own && id == heartbeat::COB_ID + node => {
                let report = ErrorControl::decode(&frame.data).ok();
                self.stopped &= report.is_none_or(|report| report.state == NmtState::STOPPED);
            }
            Some(id) if !own && id == sdo::RESPONSE_COB_ID + node && self.asked => {
                let got = "an SDO answer".to_owned();
                return Err(breach(seen, "no SDO in STOPPED", got));
            }
            _ => {}
        }
        Ok(())
    }
}

/// No TPDO between two messages of error control that both report a state other than OPERATIONAL.
/// One message is not enough: a device may enter OPERATIONAL by itself, and says so with the next.
struct NoPdoOutsideOperational {
    node: u8,
    /// The identifiers of its TPDOs.
    tpdos: Vec<Id>,
    slack: Duration,
    /// When it said last that it is in this state, unless something came that may change it.
    said: Option<(Instant, NmtState)>,
    /// The first TPDO since then.
    sent: Option<(Instant, Frame)>,
}

impl NoPdoOutsideOperational {
    /// A TPDO that waited for the bus when the state changed.
    const SLACK: Duration = Duration::from_millis(20);
}

impl Monitor for NoPdoOutsideOperational {
    fn observe(&mut self, seen: &Seen) -> Result<(), Breach> {
        let Stamped { at, frame, own } = seen.stamped;
        if own && commanded(&frame, self.node).is_some() {
            (self.said, self.sent) = (None, None);
        }
        let Some(id) = frame.any_data_id().filter(|_| !own) else { return Ok(()) };
        if id == Id::standard(heartbeat::COB_ID + u16::from(self.node)) {
            let state = ErrorControl::decode(&frame.data).ok().map(|report| report.state);
            let state = state
                .filter(|state| [NmtState::PRE_OPERATIONAL, NmtState::STOPPED].contains(state));
            let before = std::mem::replace(&mut self.said, state.map(|state| (at, state)));
            let sent = self.sent.take().filter(|_| before.map(|(_, state)| state) == state);
            let (Some((at, frame)), Some(state)) = (sent, state) else { return Ok(()) };
            let (rule, got) = (format!("no TPDO in {state}"), format!("{frame}"));
            return Err(Breach { at, rule, got, frame: Some(frame) });
        }
        let late = |(said, _): (Instant, _)| at.since(said) > Self::SLACK + self.slack;
        if self.tpdos.contains(&id) && self.sent.is_none() && self.said.is_some_and(late) {
            self.sent = Some((at, frame));
        }
        Ok(())
    }
}

/// The 11-bit identifier of a data frame that is not our echo.
fn incoming(seen: &Seen) -> Option<u16> {
    if seen.stamped.own { None } else { seen.stamped.frame.data_id() }
}

fn resets(service: Service) -> bool {
    [Service::RESET_NODE, Service::RESET_COMMUNICATION].contains(&service)
}

fn breach(seen: &Seen, rule: &str, got: String) -> Breach {
    let Stamped { at, frame, .. } = seen.stamped;
    Breach { at, rule: rule.to_owned(), got, frame: Some(frame) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Feeds `ms frame` lines (`>` in front of own ones, `!` of expected ones) to every monitor.
    fn breaches(lines: &[&str]) -> Vec<String> {
        let standing = Standing { codes: vec![EmcyCode(0x5030)], untold: 0 };
        breaches_beside(standing, lines)
    }

    fn breaches_beside(standing: Standing, lines: &[&str]) -> Vec<String> {
        breaches_of(Watched { standing, ..Watched::default() }, lines)
    }

    fn breaches_of(watched: Watched, lines: &[&str]) -> Vec<String> {
        let known = Some(vec![Id::standard(0x333)]);
        let mut monitors =
            all(Watched { node: 5, known, tpdos: vec![Id::standard(0x185)], ..watched });
        let mut found = Vec::new();
        for line in lines {
            let (ms, text) = line.split_once(' ').unwrap();
            let frame = text.trim_start_matches(['>', '!']).parse().unwrap();
            let at = Instant(ms.parse::<u64>().unwrap() * 1_000_000);
            let stamped = Stamped { at, frame, own: text.starts_with('>') };
            let seen = Seen { stamped, expected: text.starts_with('!') };
            found.extend(monitors.iter_mut().filter_map(|monitor| monitor.observe(&seen).err()));
        }
        found.iter().map(Breach::to_string).collect()
    }

    #[test]
    fn an_error_without_a_code_explains_messages_about_its_bits() {
        let breaches =
            |line| breaches_beside(Standing { codes: Vec::new(), untold: 0x05 }, &[line]);
        assert_eq!(breaches("1 085#3081050000000000"), [""; 0]);
        assert_eq!(breaches("1 085#3081110000000000").len(), 1);
    }

    #[test]
    fn surprises() {
        assert_eq!(breaches(&["1 !085#3081110000000000", "2 !705#00", "3 705#7F"]), [""; 0]);
        assert_eq!(breaches(&["1 085#3081110000000000"]).len(), 1);
        let cleared = ["1 >605#2F03100000000000", "2 085#0000000000000000"];
        assert_eq!(breaches(&cleared), [""; 0]);
        assert_eq!(breaches(&["1 705#00"]), ["no boot-up without a reset: the node booted"]);
        let twice = ["1 >000#8205", "2 >000#8200", "3 705#00", "4 705#00", "5 705#00"];
        assert_eq!(breaches(&twice).len(), 1);
        assert_eq!(breaches(&["1 >000#8206", "2 705#00"]).len(), 1);
        let stored = ["1 >7E5#1700000000000000", "2 >7E5#0400000000000000", "3 705#00"];
        assert_eq!(breaches(&stored), [""; 0]);
        assert_eq!(breaches(&stored[1..]).len(), 1);
        assert_eq!(breaches(&["1 585#6017100000000000"]).len(), 1);
        let given_up =
            ["1 >605#4008100000000000", "2 585#410810000B000000", "9 585#8008100000000405"];
        assert_eq!(breaches(&given_up), [""; 0]);
    }

    #[test]
    fn a_transfer_that_has_ended_is_not_given_up() {
        let given_up = "9 585#8008100000000405";
        let read = ["1 >605#4008100000000000", "2 !585#4308100001000000", given_up];
        assert_eq!(breaches(&read).len(), 1);
        let write = ["1 >605#2F08100001000000", "2 !585#6008100000000000", given_up];
        assert_eq!(breaches(&write).len(), 1);
        let refused = ["1 >605#4008100000000000", "2 !585#8008100000000206", given_up];
        assert_eq!(breaches(&refused).len(), 1);
        let open = ["1 >605#2108100009000000", "2 !585#6008100000000000", given_up];
        assert_eq!(breaches(&open), [""; 0]);
        assert_eq!(breaches(&[&open[..], &[given_up]].concat()).len(), 1);
        let other = ["1 >605#4009100000000000", "2 !585#4109100009000000", given_up];
        assert_eq!(breaches(&other).len(), 1);
        // The segment looks like a request for another object.
        let block = ["1 >605#C208100009000000", "2 !585#A00810007F000000"];
        let segment = ["3 >605#4000100000000000", given_up];
        assert_eq!(breaches(&[block, segment].concat()), [""; 0]);
    }

    #[test]
    fn tpdos_outside_operational() {
        let pdo = "50 185#01";
        assert_eq!(
            breaches(&["10 705#7F", pdo, "110 705#7F"]),
            ["no TPDO in PRE-OPERATIONAL: 185#01"]
        );
        assert_eq!(breaches(&["10 705#04", pdo, "110 705#84"]), ["no TPDO in STOPPED: 185#01"]);
        // It may have been in OPERATIONAL in between, or have waited for the bus.
        assert_eq!(breaches(&["10 705#7F", pdo, "110 705#05"]), [""; 0]);
        assert_eq!(breaches(&["40 705#7F", pdo, "140 705#7F"]), [""; 0]);
        assert_eq!(breaches(&["10 705#05", pdo, "110 705#7F"]), [""; 0]);
        assert_eq!(breaches(&["10 705#7F", "20 >000#0105", pdo, "110 705#7F"]), [""; 0]);
        assert_eq!(breaches(&["10 705#7F", "20 !705#00", pdo, "110 705#7F"]), [""; 0]);
        assert_eq!(breaches(&["10 705#7F", "50 285#01", "110 705#7F"]), [""; 0]);
    }

    #[test]
    fn a_transfer_that_a_command_interrupts() {
        let open = ["1 >605#4008100000000000", "2 585#410810000B000000"];
        let stopped = |lines: &[&str]| breaches(&[&open[..], lines].concat()).len();
        assert_eq!(stopped(&["3 >000#0205", "4 585#8008100022000008"]), 0);
        assert_eq!(stopped(&["3 >000#8205", "4 585#8008100001000405"]), 0);
        let twice = ["3 >000#0205", "4 585#8008100022000008", "5 585#8008100022000008"];
        assert_eq!(stopped(&twice), 1);
        assert_eq!(stopped(&["3 >000#0205", "4 585#8009100022000008"]), 1);
        assert_eq!(stopped(&["3 >000#0206", "4 585#8008100022000008"]), 1);
    }

    #[test]
    fn segments_that_are_on_their_way_when_the_client_aborts() {
        let begun = ["1 >605#A408100004000000", "2 !585#C60810001E000000"];
        let first =
            ["3 >605#A300000000000000", "4 !585#0130313233343536", "5 585#0230313233343536"];
        let cut = [&begun[..], &first, &["5 >605#8008100000000008"]].concat();
        let then = |lines: &[&str]| breaches(&[&cut[..], lines].concat()).len();
        // One answer is to the abort itself, as far as the number of requests says.
        let queued = ["6 585#0237383930313233", "7 585#0337383930313233"];
        assert_eq!(then(&queued), 0);
        assert_eq!(then(&[queued[0], "100 585#0337383930313233"]), 1);
        assert_eq!(then(&[queued[0], "100 585#8008100000000405"]), 1);
        let ended = ["5 >605#A100000000000000", "6 >605#8008100000000008", queued[0], queued[0]];
        assert_eq!(breaches(&[&cut[..4], &ended].concat()).len(), 0);
        assert_eq!(breaches(&[&cut[..4], &ended, &[queued[0]]].concat()).len(), 1);
    }

    #[test]
    fn what_stands_from_the_start() {
        let [error, end] = ["2 085#3050010000000000", "3 085#0000000000000000"];
        assert_eq!(breaches(&[error, end]), [""; 0]);
        // It may have come before this case, and may come again.
        assert_eq!(breaches(&[end, error, end]), [""; 0]);
        assert_eq!(breaches(&[end, end]).len(), 1);
        assert_eq!(breaches_beside(Standing::default(), &[end]).len(), 1);
        assert_eq!(breaches(&[error, end, end]).len(), 1);
        assert_eq!(breaches(&["2 085#3081110000000000"]).len(), 1);
    }

    #[test]
    fn identifiers() {
        assert_eq!(breaches(&["1 185#00", "2 333#00", "3 706#05", "4 385#"]), [""; 0]);
        let moved = ["1 >605#230018010A010000", "2 10A#00", "3 10B#00"];
        assert_eq!(breaches(&moved), ["no identifier that the node does not own: 10Bh"]);
        // A COB-ID of 29 bits gives no identifier of 11 bits.
        let long = ["1 >605#230018010A010020", "2 0000010A#00", "3 10A#00"];
        assert_eq!(breaches(&long), ["no identifier that the node does not own: 10Ah"]);
        assert_eq!(
            breaches(&["1 123#00", "2 10A#00"]),
            [
                "no identifier that the node does not own: 123h",
                "no identifier that the node does not own: 10Ah"
            ]
        );
    }

    #[test]
    fn an_identifier_of_strangers_is_nobodys_where_a_bus_is_shared() {
        let frame = "123#00".parse().unwrap();
        let seen =
            Seen { stamped: Stamped { at: Instant::ZERO, frame, own: false }, expected: false };
        let breaks = |known| {
            let mut monitors = all(Watched { node: 5, known, ..Watched::default() });
            monitors.iter_mut().any(|monitor| monitor.observe(&seen).is_err())
        };
        assert!(breaks(Some(Vec::new())) && !breaks(None));
    }

    #[test]
    fn a_missing_heartbeat() {
        let set = ["1 >605#2B17100064000000", "2 !585#6017100000000000", "10 705#7F"];
        let alive = [&set[..], &["110 705#7F", "210 705#7F"]].concat();
        assert_eq!(breaches(&alive), [""; 0]);
        let gap = [&set[..], &["310 705#7F"]].concat();
        assert_eq!(breaches(&gap), ["a heartbeat every 100 ms: none for 300 ms"]);
        let held_up = |hold_up| breaches_of(Watched { hold_up, ..Watched::default() }, &gap);
        assert_eq!(held_up(Duration::from_millis(100)), [""; 0]);
        assert_eq!(held_up(Duration::from_millis(90)).len(), 1);
        let reset = [&set[..], &["20 >000#8205", "900 !705#00"]].concat();
        assert_eq!(breaches(&reset), [""; 0]);
        let supply = [&set[..], &["900 !705#00", "1900 705#7F"]].concat();
        assert_eq!(breaches(&supply), [""; 0]);
    }

    #[test]
    fn answers_in_stopped() {
        let stopped = ["1 >000#0205", "2 >605#4000100000000000", "3 !585#4300100000000000"];
        assert_eq!(breaches(&stopped), ["no SDO in STOPPED: an SDO answer"]);
        let before = ["1 >605#4000100000000000", "2 >000#0205", "3 !585#4300100000000000"];
        assert_eq!(breaches(&before), [""; 0]);
    }
}
