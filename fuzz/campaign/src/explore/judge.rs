//! The judge: the device shows what the reference device shows that got the same at the same time,
//! or what it shows when that came a control cycle earlier or later.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use canopen::emcy;
use canopen::sdo::{Initiate, REQUEST_COB_ID, RESPONSE_COB_ID, Request, Response};
use canopen::{Frame, Id, Instant, Mux, Value};
use reference_devices::change::Replica;

use super::align::{LEAD, aligned};
use super::lane::{Lane, Sent};
use crate::blueprint::Blueprint;
use crate::oracle::{Difference, End, Seen, Violation, What, error_control};
use crate::surface::Surface;

/// A control cycle: what a device does within it, before or after it notices, nobody knows.
pub(super) const CYCLE: Duration = Duration::from_millis(100);
/// By how many nanoseconds everything comes later for the other replicas: every other frame or
/// stimulus, and those between them.
type Shift = [i64; 2];
const CYCLES: i64 = CYCLE.as_nanos() as i64;
const SHIFTS: [Shift; 2] = [[-CYCLES; 2], [CYCLES; 2]];
/// The same for a device in a time of its own: what blinks changes within a cycle, and what it gets
/// may come a moment before or after what it does by itself.
const SHIFTS_ON_BUS: [Shift; 10] = [
    [-CYCLES; 2],
    [CYCLES; 2],
    [-50_000_000; 2],
    [50_000_000; 2],
    [-25_000_000; 2],
    [25_000_000; 2],
    [-10_000_000; 2],
    [10_000_000; 2],
    [-6_000_000, 6_000_000],
    [6_000_000, -6_000_000],
];
/// How far the phase of an LED that blinks may be another one, and how closely that is looked at.
/// Three flashes and their pause take two seconds (CiA 303-3).
const PHASE: Duration = Duration::from_secs(2);
const PHASE_STEP: Duration = Duration::from_millis(10);
/// How long a frame of a device in a time of its own may wait.
const GRACE_ON_BUS: Duration = Duration::from_millis(200);
/// How long a frame may wait for the wire.
pub(super) const GRACE: Duration = Duration::from_millis(20);

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
            let at = instant(what);
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
    /// What the device sent since the last look, but for answers and emergency messages.
    sent: Vec<Frame>,
    /// The emergency messages since then.
    told: Vec<Frame>,
    /// The last request.
    request: Option<Request>,
    /// When the last look was over.
    last_look: Instant,
}

/// A replica for which what the tester did came at other times.
struct Shifted {
    lane: Lane,
    /// The times, and the places of what came.
    events: Vec<(Instant, usize)>,
    next: usize,
}

impl<'s> Judge<'s> {
    fn new(
        blueprint: &Blueprint,
        surface: &'s Surface,
        model: Box<dyn Replica>,
        seen: &'s [Seen],
    ) -> Self {
        let node = blueprint.node();
        let first = Lane::new(model.clone(), node);
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
            sent: Vec::new(),
            told: Vec::new(),
            request: None,
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
            let mut band: Vec<Value> = Vec::new();
            let mut take = |frame: Option<&Frame>| {
                let value = frame.and_then(value).and_then(|it| data_type.decode(&it).ok());
                band.extend(value);
            };
            take(expected.as_ref());
            for other in self.others(place, at) {
                other.lane.advance(at);
                take(other.lane.answer().as_ref());
            }
            let is_wide = data_type.size().is_some_and(|size| size > 1);
            if let Ok(got) = data_type.decode(got)
                && lies_in(&got, &band, is_wide)
            {
                return None;
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
        let is_led = name.contains("led");
        let is_wide = !name.starts_with("digital-") && !is_led;
        if lies_in(value, &band, is_wide) || is_led && self.shows_about(place, at, name, value) {
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
        let mut replica = Shifted::new(self.seen, self.model.clone(), self.node, [0; 2]);
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
        let shows = |lane: &Lane| {
            if lane.is_error_control(id) {
                // The boot-up message is waited for.
                return true;
            }
            let sent: Vec<&Sent> = lane.sent(id).collect();
            let last = frames.last().copied();
            let carried = sent.iter().filter(|sent| sent.at <= last_look || sent.may_be_lost);
            let carried = carried.count();
            let count = sent.len();
            let waiting = sent.iter().filter(|sent| sent.at + grace >= at).count();
            let enough = frames.len() + waiting + carried >= count && frames.len() <= count;
            let same = |last: &Frame| {
                sent.iter().rev().take(waiting + carried + 1).any(|it| it.frame == *last)
            };
            // How often a device in its own time notices what moves, nobody knows.
            (enough || own_time) && last.is_none_or(same)
        };
        if shows(&self.first) {
            return None;
        }
        if self.others(place, at).iter().any(|other| shows(&other.lane)) {
            return None;
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
}

impl Shifted {
    fn new(seen: &[Seen], model: Box<dyn Replica>, node: u8, by: Shift) -> Self {
        Self { lane: Lane::new(model, node), events: shifted(seen, by, node), next: 0 }
    }

    /// Takes what comes by the time of what was seen at this place.
    fn follow(&mut self, seen: &[Seen], place: usize, to: Instant) {
        while let Some((at, what)) = self.events.get(self.next).copied() {
            let is_read = is_read(&seen[what]);
            if at > to || is_read && what > place {
                break;
            }
            if is_read {
                while self.lane.answer().is_some() {}
            }
            self.lane.give(at, &seen[what]);
            self.next += 1;
        }
    }
}

/// What the tester did, at other times: nothing passes a look, nor the first boot-up, which is at
/// the same time for each replica.
fn shifted(seen: &[Seen], by: Shift, node: u8) -> Vec<(Instant, usize)> {
    let moved = |at: Instant, number: usize| Instant(at.0.saturating_add_signed(by[number % 2]));
    let is_look = |what: &Seen| is_read(what) || matches!(what, Seen::Observed(..));
    let mut events: Vec<(Instant, usize)> = Vec::new();
    let first_boot = boot_by_itself(seen, node);
    let mut last = Instant::ZERO;
    for (place, what) in seen.iter().enumerate() {
        if let Some(boot) = first_boot.filter(|boot| *boot <= instant(what)) {
            last = last.max(boot);
        }
        if is_look(what) {
            last = last.max(instant(what));
        }
        if is_own(what) {
            let at = if is_read(what) {
                instant(what)
            } else {
                moved(instant(what), events.len()).max(last)
            };
            last = last.max(at);
            events.push((at, place));
        }
    }
    // What came later than a look that follows comes just before it.
    let mut next = Instant(u64::MAX);
    let mut places = events.len();
    for (place, what) in seen.iter().enumerate().rev() {
        if is_look(what) {
            next = instant(what);
        }
        while places > 0 && events[places - 1].1 >= place {
            let (at, of) = events[places - 1];
            let limit = if is_read(&seen[of]) { at } else { Instant(next.0.saturating_sub(1)) };
            events[places - 1].0 = at.min(limit);
            places -= 1;
        }
    }
    events
}

/// When the device booted, where nothing that came at another time made it do so.
fn boot_by_itself(seen: &[Seen], node: u8) -> Option<Instant> {
    let id = Id::standard(error_control(node));
    let boots = |what: &Seen| match what {
        Seen::Frame(stamped) => stamped.frame.id == id && stamped.frame.data.first() == Some(&0),
        _ => false,
    };
    seen.iter().take_while(|what| !is_own(what)).find(|what| boots(what)).map(instant)
}

/// Whether the tester did it.
const fn is_own(what: &Seen) -> bool {
    match what {
        Seen::Frame(stamped) => stamped.own,
        Seen::Power(..) | Seen::Stimulus(..) => true,
        _ => false,
    }
}

/// Whether it is a request that reads.
fn is_read(what: &Seen) -> bool {
    match what {
        Seen::Frame(stamped) if stamped.own => {
            let id = stamped.frame.data_id().unwrap_or(0) & 0x780;
            id == REQUEST_COB_ID
                && matches!(
                    Request::decode(&stamped.frame.data),
                    Ok(Request::Upload(_) | Request::UploadSegment(_))
                )
        }
        _ => false,
    }
}

pub(super) fn instant(seen: &Seen) -> Instant {
    match seen {
        Seen::Frame(stamped) => stamped.at,
        Seen::Power(at, _)
        | Seen::Until(at)
        | Seen::Ended(at)
        | Seen::Stimulus(at, ..)
        | Seen::Observed(at, ..)
        | Seen::Looked(at)
        | Seen::Joined(at) => *at,
        // A look at stored values comes before all else.
        Seen::Stored(..) => Instant::ZERO,
    }
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

/// Whether a value is one of those of the replicas; of a wide number, whether it lies among them.
fn lies_in(value: &Value, band: &[Value], is_wide: bool) -> bool {
    if band.contains(value) {
        return true;
    }
    let numbers: Vec<f64> = band.iter().filter_map(Value::as_real).collect();
    let (Some(number), true) = (value.as_real(), is_wide) else { return false };
    let low = numbers.iter().copied().fold(f64::INFINITY, f64::min);
    let high = numbers.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    (low..=high).contains(&number)
}

/// The error code of an emergency message.
fn code(frame: &Frame) -> u16 {
    let byte = |place: usize| u16::from(frame.data.get(place).copied().unwrap_or(0));
    byte(0) | byte(1) << 8
}

fn said(frame: Frame) -> String {
    match Response::decode(&frame.data) {
        Ok(Response::Abort(_, code)) => format!("abort {code}"),
        _ => frame.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use canopen::Stamped;

    use super::*;

    fn seen(micros: u64, own: bool, frame: &str) -> Seen {
        let at = Instant(micros * 1000);
        Seen::Frame(Stamped { at, frame: frame.parse().unwrap(), own })
    }

    #[test]
    fn nothing_comes_before_the_boot_up_that_it_waited_for() {
        let all = [seen(1_200_000, false, "701#00"), seen(1_201_000, true, "000#0101")];
        let at = |by| shifted(&all, by, 1)[0].0;
        assert_eq!(at(SHIFTS[0]), Instant(1_200_000_000));
        assert_eq!(at(SHIFTS[1]), Instant(1_301_000_000));
        // A boot-up after a reset comes earlier with the reset.
        let reset = [seen(500_000, true, "000#8101"), all[0].clone(), all[1].clone()];
        assert_eq!(shifted(&reset, SHIFTS[0], 1)[1].0, Instant(1_101_000_000));
    }
}
