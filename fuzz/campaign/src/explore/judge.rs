//! The judge: the device shows what the reference device shows that got the same at the same time,
//! or what it shows when that came a control cycle earlier or later.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use canopen::emcy::{self, Emcy};
use canopen::sdo::{Initiate, REQUEST_COB_ID, RESPONSE_COB_ID, Request, Response};
use canopen::{Frame, Id, Instant, Mux, Value};
use reference_devices::change::Replica;

use super::align::{LEAD, aligned};
use super::band::{lies_among, lies_in};
use super::lane::{GRACE, Lane, Sent};
use super::shift::{CYCLE, SHIFTS, SHIFTS_ON_BUS, Shift, Shifted};
use crate::blueprint::Blueprint;
use crate::oracle::{Difference, End, Seen, Violation, What};
use crate::surface::Surface;

/// How far the phase of an LED that blinks may be another one, and how closely that is looked at.
/// Three flashes and their pause take two seconds (CiA 303-3).
const PHASE: Duration = Duration::from_secs(2);
const PHASE_STEP: Duration = Duration::from_millis(10);
/// How long a frame of a device in a time of its own may wait.
const GRACE_ON_BUS: Duration = Duration::from_millis(200);

/// Judges what was seen. Returns how far it goes, and what is wrong then.
pub(crate) fn judge(
    blueprint: &Blueprint,
    surface: &Surface,
    model: Box<dyn Replica>,
    seen: &[Seen],
) -> (usize, Option<End>) {
    let own_time = blueprint.is_in_its_own_time();
    let aligned = if own_time { aligned(&*model, blueprint.node(), seen) } else { Vec::new() };
    let all = if own_time { &aligned } else { seen };
    let mut judge = Judge::new(blueprint, surface, model, all);
    for (place, what) in all.iter().enumerate() {
        if let Some(difference) = judge.see(place) {
            let at = what.at();
            let at = if own_time { Instant(at.0.saturating_sub(LEAD)) } else { at };
            let what = What::Differs(Box::new(difference));
            // What the alignment added stands at the front.
            let place = place.min(seen.len().saturating_sub(1));
            return (place, Some(End::Violation(Violation { at, what })));
        }
    }
    (seen.len(), None)
}

struct Judge<'s> {
    node: u8,
    /// Whether the device is in a time of its own, and how long a frame may then wait.
    own_time: bool,
    grace: Duration,
    surface: &'s Surface,
    seen: &'s [Seen],
    /// What is like it when nothing came earlier or later.
    first: Lane,
    /// A device that was not yet switched on.
    model: Box<dyn Replica>,
    /// What is like it when everything came earlier, and later; built when they are needed.
    others: Option<Vec<Shifted>>,
    /// The same with other figures where the documents give none.
    figured: Option<Vec<Shifted>>,
    /// What the device sent since the last look, but for answers and emergency messages.
    sent: Vec<Frame>,
    /// The emergency messages since then.
    told: Vec<Frame>,
    /// The last request.
    request: Option<Request>,
    /// The same as a frame.
    question: Option<Frame>,
    /// When the last look was over.
    last_look: Instant,
}

impl<'s> Judge<'s> {
    fn new(
        blueprint: &Blueprint,
        surface: &'s Surface,
        model: Box<dyn Replica>,
        seen: &'s [Seen],
    ) -> Self {
        let node = blueprint.node();
        let first = Lane::new(model.clone(), node, 0);
        let own_time = blueprint.is_in_its_own_time();
        let grace = if own_time { GRACE_ON_BUS } else { GRACE };
        Self {
            node,
            own_time,
            grace,
            surface,
            seen,
            first,
            model,
            others: None,
            figured: None,
            sent: Vec::new(),
            told: Vec::new(),
            request: None,
            question: None,
            last_look: Instant::ZERO,
        }
    }

    fn see(&mut self, place: usize) -> Option<Difference> {
        let what = &self.seen[place];
        match what {
            Seen::Frame(stamped) if stamped.own => {
                let owed = self.asks(&stamped.frame).then(|| self.first.answer()).flatten();
                self.first.give(stamped.at, what);
                owed.map(|frame| self.missing("answer", &frame))
            }
            Seen::Frame(stamped) => self.sent(place, stamped.at, &stamped.frame),
            Seen::Power(at, _) | Seen::Stimulus(at, ..) => {
                self.first.give(*at, what);
                None
            }
            Seen::Observed(at, name, value) => {
                self.first.pass(*at);
                let expected = self.first.observe(name);
                if expected.as_ref() == Some(value) {
                    return None;
                }
                self.observed(place, *at, name, value, expected)
            }
            Seen::Looked(at) => self.looked(place, *at),
            Seen::Ended(_) | Seen::Until(_) | Seen::Stored(..) | Seen::Joined(_) => None,
        }
    }

    /// Notes a request of the tester.
    fn asks(&mut self, frame: &Frame) -> bool {
        let is_request = frame.data_id() == Some(REQUEST_COB_ID + u16::from(self.node));
        if is_request {
            self.request = Request::decode(&frame.data).ok();
            self.question = Some(*frame);
        }
        is_request
    }

    fn sent(&mut self, place: usize, at: Instant, frame: &Frame) -> Option<Difference> {
        let id = frame.data_id();
        if id == Some(RESPONSE_COB_ID + u16::from(self.node)) {
            self.first.advance(at);
            let expected = self.first.answer();
            if expected.as_ref() == Some(frame) {
                return None;
            }
            return self.answered(place, at, frame, expected);
        }
        if id == Some(emcy::COB_ID + u16::from(self.node)) {
            self.told.push(*frame);
            return None;
        }
        if !self.first.is_error_control(frame.id) || frame.data.first() != Some(&0) {
            self.sent.push(*frame);
            return None;
        }
        self.first.pass(at);
        let due = self.first.boot_up();
        let is_due = due.is_some_and(|due| at.since(due) <= CYCLE);
        (!is_due).then(|| {
            let expected = due.map_or_else(|| "later".to_owned(), |due| format!("at {due} s"));
            self.plain("boot-up".to_owned(), "boot-up message", expected, format!("at {at} s"))
        })
    }

    /// An answer that is another one than that of the replica.
    fn answered(
        &mut self,
        place: usize,
        at: Instant,
        frame: &Frame,
        expected: Option<Frame>,
    ) -> Option<Difference> {
        let mux = self.request.as_ref().and_then(mux_of);
        let got = value(frame);
        let is_read = matches!(self.request, Some(Request::Upload(_)));
        if let (Some(mux), Some(got), true) = (mux, &got, is_read)
            && let Some(data_type) = self.first.dictionary().entry(mux).map(|it| it.data_type)
        {
            let read = |frame: Option<&Frame>| {
                frame.and_then(value).and_then(|it| data_type.decode(&it).ok())
            };
            let mut band: Vec<Value> = read(expected.as_ref()).into_iter().collect();
            for other in self.others(place, at) {
                other.lane.advance(at);
                band.extend(read(other.lane.answer().as_ref()));
            }
            if let (Some(mut lane), Some(question)) = (self.ahead(at), &self.question) {
                band.extend(read(lane.asked(at + CYCLE, question).as_ref()));
            }
            let is_wide = data_type.size().is_some_and(|size| size > 1);
            if let Ok(got) = data_type.decode(got) {
                if lies_in(&got, &band, is_wide) {
                    return None;
                }
                for other in self.figured(place, at) {
                    other.lane.advance(at);
                    band.extend(read(other.lane.answer().as_ref()));
                }
                if lies_in(&got, &band, is_wide) {
                    return None;
                }
            }
            let words = |bytes: Option<Vec<u8>>| {
                let value = bytes.and_then(|bytes| data_type.decode(&bytes).ok());
                value.map(|value| value.of(mux))
            };
            let decoded = expected.as_ref().and_then(value);
            let decoded = decoded.and_then(|bytes| data_type.decode(&bytes).ok());
            let expected = words(expected.as_ref().and_then(value)).or_else(|| expected.map(said));
            return Some(Difference {
                value: decoded,
                shown: data_type.decode(got).ok(),
                kind: format!("value-{:04x}-{}", mux.index, mux.sub),
                name: self.surface.name(mux),
                object: Some(mux),
                bench: None,
                expected: expected.unwrap_or_else(|| "no answer".to_owned()),
                actual: words(Some(got.clone())).unwrap_or_else(|| said(*frame)),
            });
        }
        let name = mux.map_or_else(|| "answer".to_owned(), |mux| self.surface.name(mux));
        let kind = mux.map_or_else(
            || "answer".to_owned(),
            |mux| format!("answer-{:04x}-{}", mux.index, mux.sub),
        );
        let expected = expected.map_or_else(|| "no answer".to_owned(), said);
        let object = mux;
        Some(Difference { object, ..self.plain(kind, &name, expected, said(*frame)) })
    }

    fn observed(
        &mut self,
        place: usize,
        at: Instant,
        name: &Arc<str>,
        value: &Value,
        expected: Option<Value>,
    ) -> Option<Difference> {
        let mut band: Vec<Value> = expected.iter().cloned().collect();
        for other in self.others(place, at) {
            other.lane.pass(at);
            band.extend(other.lane.observe(name));
        }
        band.extend(self.ahead(at).and_then(|lane| lane.observe(name)));
        let is_led = name.contains("led");
        let is_wide = !name.starts_with("digital-") && !is_led;
        if name.starts_with("output-current-") {
            band.extend(expected.as_ref().into_iter().flat_map(rounded_otherwise));
        }
        if lies_in(value, &band, is_wide) || is_led && self.shows_about(place, at, name, value) {
            return None;
        }
        for other in self.figured(place, at) {
            other.lane.pass(at);
            band.extend(other.lane.observe(name));
        }
        if lies_in(value, &band, is_wide) {
            return None;
        }
        let known = expected.clone();
        let expected = expected.map_or_else(|| "nothing".to_owned(), |it| it.to_string());
        let kind = format!("bench-{name}");
        let bench = Some(Arc::clone(name));
        Some(Difference {
            bench,
            value: known,
            shown: Some(value.clone()),
            ..self.plain(kind, name, expected, value.to_string())
        })
    }

    /// Whether an LED of a replica shows that within two seconds. One that blinks is looked at by
    /// chance, and its phase is that of a device in its own time.
    fn shows_about(&self, place: usize, at: Instant, name: &str, value: &Value) -> bool {
        if !self.own_time {
            return false;
        }
        let mut replica = Shifted::new(self.seen, self.model.clone(), self.node, Shift::NONE);
        let first = at.0.saturating_sub(PHASE.as_nanos() as u64);
        let mut times = (0..).map(|step| Instant(first) + PHASE_STEP * step);
        let mut within = times.by_ref().take_while(|time| time.since(at) <= PHASE);
        within.any(|time| {
            replica.follow(self.seen, place, time);
            replica.lane.pass(time);
            replica.lane.observe(name).as_ref() == Some(value)
        })
    }

    fn looked(&mut self, place: usize, at: Instant) -> Option<Difference> {
        self.first.pass(at);
        let earlier = Instant(at.0.saturating_sub(self.grace.as_nanos() as u64));
        if let Some(owed) = self.first.answer() {
            return Some(self.missing("answer", &owed));
        }
        if let Some(wrong) = self.emergencies(place, at, earlier) {
            return Some(wrong);
        }
        let device = std::mem::take(&mut self.sent);
        let ids: BTreeSet<Id> =
            device.iter().map(|frame| frame.id).chain(self.first.identifiers()).collect();
        for id in ids {
            let frames: Vec<&Frame> = device.iter().filter(|frame| frame.id == id).collect();
            if let Some(wrong) = self.transmitted(place, at, id, &frames) {
                return Some(wrong);
            }
        }
        self.first.forget(earlier);
        self.last_look = at;
        for other in self.others.iter_mut().flatten() {
            other.lane.forget(earlier);
        }
        None
    }

    /// Compares the emergency messages since the last look.
    fn emergencies(&mut self, place: usize, at: Instant, earlier: Instant) -> Option<Difference> {
        let told = std::mem::take(&mut self.told);
        let Err(wrong) = self.first.tells(&told, at, earlier) else {
            for other in self.others.iter_mut().flatten() {
                // Which of them a replica has told does not matter where the first one is right.
                other.follow(self.seen, place, at);
                other.lane.pass(at);
                _ = other.lane.tells(&told, at, earlier);
            }
            return None;
        };
        let others = self.others(place, at);
        let mut fits = false;
        for other in others {
            other.lane.pass(at);
            fits |= other.lane.tells(&told, at, earlier).is_ok();
        }
        if fits {
            return None;
        }
        let (expected, actual) = wrong;
        let known = actual.or(expected).map_or(0, |frame| code(&frame));
        let words = |frame: Option<Frame>| frame.map_or_else(|| "none".to_owned(), said);
        let (expected, actual) = (words(expected), words(actual));
        Some(self.plain(format!("emergency-{known:04x}"), "emergency message", expected, actual))
    }

    /// Compares what was sent with an identifier since the last look: the number of frames, and
    /// the last one.
    fn transmitted(
        &mut self,
        place: usize,
        at: Instant,
        id: Id,
        frames: &[&Frame],
    ) -> Option<Difference> {
        let (last_look, grace, own_time) = (self.last_look, self.grace, self.own_time);
        let last = frames.last().copied();
        let is_carried = |sent: &Sent| sent.at <= last_look || sent.may_be_lost;
        // The last frame of a replica, and those that the device may have yet to send.
        let may_be_last = |lane: &Lane| {
            let sent: Vec<Frame> = lane.sent(id).map(|sent| sent.frame).collect();
            let carried = lane.sent(id).filter(|sent| is_carried(sent)).count();
            let waiting = lane.sent(id).filter(|sent| sent.at + grace >= at).count();
            let first = sent.len().saturating_sub(waiting + carried + 1);
            (sent, first, waiting + carried)
        };
        let shows = |lane: &Lane| {
            if lane.is_error_control(id) {
                // The boot-up message is waited for.
                return true;
            }
            let (sent, first, open) = may_be_last(lane);
            let enough = frames.len() + open >= sent.len() && frames.len() <= sent.len();
            // How often a device in its own time notices what moves, nobody knows.
            (enough || own_time) && last.is_none_or(|last| sent[first..].contains(last))
        };
        if shows(&self.first) {
            return None;
        }
        if self.others(place, at).iter().any(|other| shows(&other.lane)) {
            return None;
        }
        if let Some(last) = last.filter(|_| own_time) {
            let may_be = |lane: &Lane| {
                let (sent, first, _) = may_be_last(lane);
                sent.into_iter().skip(first)
            };
            let first = std::iter::once(&self.first);
            let lanes = first.chain(self.others.iter().flatten().map(|other| &other.lane));
            let mut known: Vec<Frame> = lanes.flat_map(may_be).collect();
            for other in self.figured(place, at) {
                other.lane.pass(at);
                known.extend(may_be(&other.lane));
            }
            // What moves is somewhere between where it is for the replicas.
            if lies_among(last, &known, self.first.dictionary()) {
                return None;
            }
        }
        let (count, last) = (self.first.sent(id).count(), self.first.sent(id).last());
        let words = |count: usize, last: Option<Frame>| match last {
            Some(last) => format!("{count} frames, the last {last}"),
            None => "no frame".to_owned(),
        };
        let expected = words(count, last.map(|sent| sent.frame));
        let actual = words(frames.len(), frames.last().map(|last| **last));
        Some(self.plain(
            format!("frames-{id}").to_lowercase(),
            &format!("frames {id}"),
            expected,
            actual,
        ))
    }

    fn plain(&self, kind: String, name: &str, expected: String, actual: String) -> Difference {
        let name = name.to_owned();
        Difference {
            kind,
            name,
            object: None,
            bench: None,
            value: None,
            shown: None,
            expected,
            actual,
        }
    }

    fn missing(&self, what: &str, frame: &Frame) -> Difference {
        let name = what.split('-').next().unwrap_or(what);
        self.plain(format!("missing-{what}"), name, said(*frame), "nothing".to_owned())
    }

    /// What the first replica is a control cycle later if nothing more comes: a faster clock is
    /// ahead in what has moved since long.
    fn ahead(&self, at: Instant) -> Option<Lane> {
        let mut lane = self.own_time.then(|| self.first.clone())?;
        lane.pass(at + CYCLE);
        Some(lane)
    }

    /// The replicas for which everything came earlier and later, at the time of what was seen.
    fn others(&mut self, place: usize, at: Instant) -> &mut [Shifted] {
        let (seen, model, node) = (self.seen, &self.model, self.node);
        let by = if self.own_time { &SHIFTS_ON_BUS[..] } else { &SHIFTS };
        let others = self.others.get_or_insert_with(|| {
            by.iter().map(|by| Shifted::new(seen, model.clone(), node, *by)).collect()
        });
        for other in others.iter_mut() {
            other.follow(seen, place, at);
        }
        others
    }

    /// The replicas that have other figures where the documents give none. They take long, and are
    /// asked last.
    fn figured(&mut self, place: usize, at: Instant) -> &mut [Shifted] {
        let (seen, model, node) = (self.seen, &self.model, self.node);
        let count = if self.own_time { model.node().other_figures() } else { 0 };
        let figured = self.figured.get_or_insert_with(|| {
            let with = |figures| {
                let mut other = model.clone();
                other.node_mut().take_figures(figures);
                Shifted::new(seen, other, node, Shift::NONE)
            };
            (0..count).map(with).collect()
        });
        let earlier = Instant(self.last_look.0.saturating_sub(self.grace.as_nanos() as u64));
        for other in figured.iter_mut() {
            other.follow(seen, place, at);
            other.lane.forget(earlier);
        }
        figured
    }
}

/// The values beside one that a bench has measured: how a current is rounded to its unit is a
/// matter of the bench.
fn rounded_otherwise(measured: &Value) -> impl Iterator<Item = Value> + use<> {
    let whole = measured.as_int();
    whole.into_iter().flat_map(|whole| [Value::Int(whole - 1), Value::Int(whole + 1)])
}

/// The value that an answer carries.
fn value(frame: &Frame) -> Option<Vec<u8>> {
    match Response::decode(&frame.data).ok()? {
        Response::Upload(_, Initiate::Expedited(data)) => Some(data.to_vec()),
        _ => None,
    }
}

const fn mux_of(request: &Request) -> Option<Mux> {
    match request {
        Request::Upload(mux) | Request::Download(mux, _) => Some(*mux),
        _ => None,
    }
}

/// The error code of an emergency message.
fn code(frame: &Frame) -> u16 {
    let byte = |place: usize| u16::from(frame.data.get(place).copied().unwrap_or(0));
    byte(0) | byte(1) << 8
}

/// A frame with what it says, where its identifier tells what it is.
fn said(frame: Frame) -> String {
    let is = |of: u16| frame.data_id().is_some_and(|id| (of + 1..of + 128).contains(&id));
    let words = match (Response::decode(&frame.data), Emcy::decode(&frame.data)) {
        (Ok(Response::Abort(_, code)), _) if is(RESPONSE_COB_ID) => return format!("abort {code}"),
        (Ok(Response::Download(mux)), _) if is(RESPONSE_COB_ID) => format!("downloaded {mux}"),
        (Ok(Response::Upload(mux, _)), _) if is(RESPONSE_COB_ID) => format!("uploaded {mux}"),
        (_, Ok(Emcy { code, register, .. })) if is(emcy::COB_ID) => {
            format!("error {:04X}h, error register {register:02X}h", code.0)
        }
        _ => return frame.to_string(),
    };
    format!("{frame} ({words})")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_is_told_by_its_identifier() {
        let said = |frame: &str| said(frame.parse().unwrap());
        assert_eq!(
            said("581#8017100030000906"),
            "abort 0609 0030h (value not valid for the object)"
        );
        assert_eq!(said("581#6017100000000000"), "581#6017100000000000 (downloaded 1017:00)");
        assert_eq!(said("181#8017100030000906"), "181#8017100030000906");
        let emergency = "081#8050010000000000";
        let words = "error 5080h, error register 01h";
        assert_eq!(said(emergency), format!("{emergency} ({words})"));
    }
}
