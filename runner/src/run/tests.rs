//! Sessions on buses that make the tester late, and with devices that have peculiarities from the
//! start.

mod declined;
mod emergencies;
mod kept;
mod other_nodes;
mod reliance;
mod shared_bus;

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;
use std::time::Duration;

use canopen::catalogue::Catalogue;
use canopen::{Bench, BenchError, Bus, BusError, Frame, Instant, Stamped, Value, VirtualBus, eds};
use reference_devices::rules::Rules;
use reference_devices::{devices, mutant};
use reports::{Event, Note, Outcome, Repeated, Verdict};

use super::{Ending, Policy, Session, Undo, Unobserved};
use crate::dut::Dut;
use crate::plan;
use crate::source::Source;
use crate::stop::Stop;
use crate::suite::Library;

const BIT_RATE: u32 = 1_000_000;
const NODE: u8 = 1;

/// Changes a frame on its way to the tester, given the frames that the tester sent before.
type Way = Box<dyn FnMut(&[Frame], Stamped) -> Option<Stamped>>;

/// A bus with a device, and what is odd about it.
struct Odd {
    bus: VirtualBus<'static>,
    real: bool,
    /// How often the host stalls when nothing came for [`WINDOW`] after a device was settled.
    stalls: u32,
    /// How often it does not before.
    calm: u32,
    /// How long it stalls.
    stall: Duration,
    /// When it was, when nothing came since.
    last: Instant,
    /// After which time the tester learns of a frame of the device.
    lag: Duration,
    /// How long the host stalls before the request for a segment, or SYNC, leaves.
    before_segments: Duration,
    held: VecDeque<Stamped>,
    sent: Vec<Frame>,
    way: Way,
    /// From this frame of the tester on, each answer of the device comes twice.
    twice_after: Option<Frame>,
    /// Whether the next answer comes twice.
    twice_once: bool,
    /// A frame of another station after each answer.
    stranger: Option<Frame>,
    /// A frame of the tester, and one of the device that comes once, 1 ms after it.
    once: Option<(Frame, Frame)>,
    /// A frame of the tester after which frames are lost, once.
    loses_after: Option<Frame>,
    /// A frame of the tester after which the host is so late for the end of each wait.
    late_after: Option<(Frame, Duration)>,
    /// A frame of the device 1 ms after its first stimulus, and how long the bench takes for each.
    bench: Option<(Frame, Duration)>,
    /// How many stimuli were set.
    stimuli: u32,
}

/// The window that the cases have and nothing else.
const WINDOW: Duration = Duration::from_millis(77);
const STALL: Duration = Duration::from_millis(42);

impl Bus for Odd {
    fn is_real(&self) -> bool {
        self.real
    }

    fn now(&mut self) -> Instant {
        self.bus.now()
    }

    fn bench(&mut self) -> Option<&mut dyn Bench> {
        self.bench.is_some().then_some(self as &mut dyn Bench)
    }

    fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
        let id = frame.data_id();
        let to_server = id == Some(0x600 + u16::from(NODE));
        if to_server && frame.data.first() == Some(&0x60) || id == Some(0x080) {
            let until = self.bus.now() + self.before_segments;
            while let Some(seen) = self.bus.recv(until)? {
                self.held.extend(if seen.own { Some(seen) } else { (self.way)(&self.sent, seen) });
            }
        }
        self.sent.push(*frame);
        self.bus.send(frame)
    }

    fn recv(&mut self, until: Instant) -> Result<Option<Stamped>, BusError> {
        if self.loses_after.take_if(|frame| self.sent.contains(frame)).is_some() {
            return Err(BusError::Lost("200 frames were lost".to_owned()));
        }
        loop {
            if self.held.front().is_some_and(|held| held.at <= until) {
                return Ok(self.held.pop_front());
            }
            match self.bus.recv(until)? {
                Some(seen) => {
                    let settled = is_error_register(&seen.frame);
                    self.last = if settled { seen.at } else { Instant::NEVER };
                    let seen = if seen.own { Some(seen) } else { (self.way)(&self.sent, seen) };
                    if let Some(seen) = seen {
                        self.beside(seen);
                        let noticed = if seen.own { seen.at } else { seen.at + self.lag };
                        while let Some(next) = self.bus.recv(noticed)? {
                            self.held.push_back(next);
                        }
                        return Ok(Some(seen));
                    }
                }
                None => {
                    let late = self.late_after.filter(|(frame, _)| self.sent.contains(frame));
                    if let Some((_, late)) = late {
                        while let Some(seen) = self.bus.recv(until + late)? {
                            let seen =
                                if seen.own { Some(seen) } else { (self.way)(&self.sent, seen) };
                            self.held.extend(seen);
                        }
                    }
                    let is_long = until.since(self.last) >= WINDOW && self.stalls > 0;
                    if is_long && self.calm > 0 {
                        self.calm -= 1;
                        self.last = Instant::NEVER;
                    } else if is_long {
                        self.stalls -= 1;
                        // Once after each frame.
                        self.last = Instant::NEVER;
                        while let Some(seen) = self.bus.recv(until + self.stall)? {
                            self.held.push_back(seen);
                        }
                    }
                    return Ok(None);
                }
            }
        }
    }
}

/// Takes whatever it is told, in its time.
impl Bench for Odd {
    fn names(&mut self) -> Result<Vec<String>, BenchError> {
        Ok(vec!["sensor-1".to_owned(), "sensor-2".to_owned()])
    }

    fn set(&mut self, _: &str, _: &Value) -> Result<(), BenchError> {
        let Some((frame, takes)) = self.bench else { return Ok(()) };
        let begun = self.bus.now();
        while let Ok(Some(seen)) = self.bus.recv(begun + takes) {
            self.held.push_back(seen);
        }
        if self.stimuli == 0 {
            let at = begun + Duration::from_millis(1);
            self.held.push_back(Stamped { at, frame, own: false });
        }
        self.stimuli += 1;
        Ok(())
    }

    fn get(&mut self, name: &str) -> Result<Value, BenchError> {
        Err(BenchError::unknown(name))
    }
}

impl Odd {
    /// What comes beside an answer of the device, right after it.
    fn beside(&mut self, seen: Stamped) {
        if let Some((_, frame)) = self.once.take_if(|(of, _)| seen.own && *of == seen.frame) {
            let at = seen.at + Duration::from_millis(1);
            self.held.push_back(Stamped { at, frame, own: false });
        }
        if seen.own || seen.frame.data_id() != Some(0x580 + u16::from(NODE)) {
            return;
        }
        let twin = self.twice_after.is_some_and(|first| self.sent.contains(&first));
        if twin || std::mem::take(&mut self.twice_once) {
            self.held.push_back(seen);
        }
        self.held.extend(self.stranger.map(|frame| Stamped { frame, ..seen }));
    }
}

fn odd(way: Way) -> Odd {
    let mut bus = VirtualBus::new(BIT_RATE);
    bus.attach(devices::device("drr460").unwrap().node(NODE, Rules::default()));
    let (held, sent) = (VecDeque::new(), Vec::new());
    let (last, lag, before_segments) = (Instant::NEVER, Duration::ZERO, Duration::ZERO);
    let (twice_after, twice_once, stranger, once) = (None, false, None, None);
    Odd {
        bus,
        real: true,
        stalls: 0,
        calm: 0,
        stall: STALL,
        last,
        lag,
        before_segments,
        held,
        sent,
        way,
        twice_after,
        twice_once,
        stranger,
        once,
        loses_after: None,
        late_after: None,
        bench: None,
        stimuli: 0,
    }
}

fn stalled(stalls: u32) -> Odd {
    Odd { stalls, ..odd(Box::new(|_, seen| Some(seen))) }
}

#[test]
fn what_a_document_relaxes_it_relaxes_for_devices_of_its_vendor_and_product_only() {
    const MANUAL: &str = "\
document: manual
title: The manual of a device
device: drr460
interpretations:
  - { id: M-1, clause: '1', conflict: Any., decision: Any., reason: Any., relaxes: [ANY-01] }
";
    let suite = "suite: any\ncases:\n  - { id: a, title: Any., checks: [ANY-01], steps: [] }\n";
    let source = |name: &str, text: &str| Arc::new(Source::new(name, text.to_owned()));
    let eds = eds::read(devices::device("drr460").unwrap().eds_text().as_bytes()).eds;
    let alike = BTreeMap::from([("drr460", &eds)]);
    let shared = MANUAL.replace("device: drr460", "devices: [em66, drr460]");
    for manual in [MANUAL, &shared] {
        let sources = [
            source("suites/requirements/any.yaml", REGISTER),
            source("suites/requirements/manual.yaml", manual),
            source("suites/any.yaml", suite),
        ];
        let library = Library::from_sources(&sources, Catalogue::built_in()).unwrap();
        let relaxed = |name, models: &BTreeMap<_, _>| {
            let plan = plan::plan(&library, &Dut::new(name, NODE, eds.clone()), models).unwrap();
            plan.instances[0].relaxed.get("ANY-01").cloned()
        };
        assert_eq!(relaxed("drr460", &BTreeMap::new()).as_deref(), Some("M-1"));
        assert_eq!(relaxed("bought", &alike).as_deref(), Some("M-1"));
        assert_eq!(relaxed("bought", &BTreeMap::new()), None);
    }
}

const REGISTER: &str = "\
document: any
title: Any document
requirements:
  - { id: ANY-01, clause: '1', level: must, says: Anything. }
";

/// How a session with these steps ended, the outcomes of its cases, its notes and its remark.
struct Ran {
    ending: Ending,
    outcomes: Vec<Outcome>,
    notes: Vec<String>,
    remark: String,
    took: Duration,
}

/// Runs as many cases with these steps.
fn run(bus: &mut Odd, cases: usize, steps: &str) -> Ran {
    run_until(bus, cases, steps, &Stop::default(), &Undo::default())
}

/// The same until the user stops it.
fn run_until(bus: &mut Odd, cases: usize, steps: &str, stop: &Stop, undo: &Undo) -> Ran {
    run_on(bus, &dut(), cases, steps, stop, undo)
}

/// The same with what is known of the device.
fn run_on(bus: &mut Odd, dut: &Dut, cases: usize, steps: &str, stop: &Stop, undo: &Undo) -> Ran {
    let mut text = "suite: any\ncases:\n".to_owned();
    for case in 0..cases {
        text.push_str(&format!(
            "  - id: case-{case}\n    title: Anything.\n    checks: [ANY-01]\n    steps: {steps}\n"
        ));
    }
    run_library(bus, dut, &library(&text), stop, undo)
}

/// Runs all cases of a library.
fn run_library(bus: &mut Odd, dut: &Dut, library: &Library, stop: &Stop, undo: &Undo) -> Ran {
    let plan = plan::plan(library, dut, &BTreeMap::new()).unwrap();
    let session = Session {
        plan: &plan,
        register: &library.register,
        policy: Policy::at_bit_rate(BIT_RATE),
        rerun: String::new(),
        waivers: &crate::waivers::Waivers::default(),
        max_fail: None,
        observer: &Unobserved,
        stop,
        undo,
    };
    let (mut outcomes, mut notes, mut remark) = (Vec::new(), Vec::new(), String::new());
    let ending = session.run(bus, &mut |event| match event {
        Event::DeviceStarted(device) => remark = device.remark.unwrap_or_default(),
        Event::CaseEnded(end) => outcomes.push(end.outcome),
        Event::Note(Note { text, .. }) | Event::CaseRepeated(Repeated { text, .. }) => {
            notes.push(text)
        }
        _ => {}
    });
    Ran { ending, outcomes, notes, remark, took: bus.now().since(Instant::ZERO) }
}

/// A suite of this text, with the register.
fn library(text: &str) -> Library {
    let source = |name: &str, text: &str| Arc::new(Source::new(name, text.to_owned()));
    let sources =
        [source("suites/requirements/any.yaml", REGISTER), source("suites/any.yaml", text)];
    Library::from_sources(&sources, Catalogue::built_in()).unwrap()
}

fn dut() -> Dut {
    let eds = eds::read(devices::device("drr460").unwrap().eds_text().as_bytes()).eds;
    Dut { bit_rate: Some(BIT_RATE), ..Dut::new("drr460", NODE, eds) }
}

/// The device with every service, alone on its bus.
fn generic() -> VirtualBus<'static> {
    let mut bus = VirtualBus::new(BIT_RATE);
    bus.attach(devices::device("generic").unwrap().node(NODE, Rules::default()));
    bus
}

fn dut_of_generic() -> Dut {
    let eds = eds::read(devices::device("generic").unwrap().eds_text().as_bytes()).eds;
    Dut { bit_rate: Some(BIT_RATE), ..Dut::new("generic", NODE, eds) }
}

fn verdicts(ran: &Ran) -> Vec<Verdict> {
    ran.outcomes.iter().map(Outcome::verdict).collect()
}

const WAITS: &str = "[ wait: 77 ms, send: '080#', never: { frame: '080+n#...', for: 10 ms } ]";
const AGAIN: &str = "; it is to be tried again later in this run";
const EXPECTS: &str = "[ expect: { frame: '700+n#05', within: 77 ms } ]";

#[test]
fn a_case_in_which_the_tester_was_late_is_repeated() {
    let ran = run(&mut stalled(2), 1, WAITS);
    assert_eq!(verdicts(&ran), [Verdict::Pass]);
    let note = "the tester was late by 42 ms: the case is repeated";
    assert_eq!(ran.notes, [note, note]);
}

#[test]
fn a_tester_that_is_always_late_neither_passes_nor_fails_a_case() {
    let missed = "; the last one expected 701#05, came no matching frame within 77 ms";
    for (steps, failed) in [(WAITS, ""), (EXPECTS, missed)] {
        let ran = run(&mut stalled(u32::MAX), 1, steps);
        let last = format!("the tester was late by 42 ms, and in 4 attempts{failed}");
        let first = Outcome::Undecided(format!("{last}{AGAIN}"));
        assert_eq!(ran.outcomes, [first, Outcome::Undecided(last)]);
        assert_eq!(ran.ending, Ending::Complete);
    }
}

#[test]
fn what_is_undecided_is_tried_again_at_the_end() {
    let ran = run(&mut stalled(5), 2, WAITS);
    assert_eq!(verdicts(&ran), [Verdict::Error, Verdict::Pass, Verdict::Pass]);
}

/// As where a device sends more than a busy tester reads, until it is set back.
#[test]
fn frames_that_were_lost_leave_one_case_undecided() {
    let loses_after = Some(Frame::new(0x123, []));
    let mut bus = Odd { loses_after, ..stalled(0) };
    let ran = run(&mut bus, 2, "[ send: '123#', never: { frame: '080+n#...', for: 10 ms } ]");
    assert_eq!(ran.outcomes[0], Outcome::Undecided(format!("200 frames were lost{AGAIN}")));
    assert_eq!(verdicts(&ran), [Verdict::Error, Verdict::Pass, Verdict::Pass]);
    assert_eq!(ran.ending, Ending::Complete);
}

#[test]
fn silence_proves_nothing_where_the_host_stalled_for_half_of_it() {
    let never = |window: &str| format!("[ never: {{ frame: '080+n#...', for: {window} }} ]");
    for (window, notes) in [("77 ms", 1), ("300 ms", 0)] {
        let ran = run(&mut stalled(1), 1, &never(window));
        assert_eq!((verdicts(&ran), ran.notes.len()), (vec![Verdict::Pass], notes), "{window}");
    }
}

#[test]
fn what_fails_after_the_host_stalled_fails_twice_or_not_at_all() {
    let late = "the tester was late by 42 ms: the case is repeated";
    let again = "the tester was late in the attempt before: the case is repeated";
    let judged = |mut bus: Odd, steps: &str| {
        let mut ran = run(&mut bus, 1, steps);
        ran.notes.retain(|note| note.ends_with("repeated"));
        (ran.outcomes[0].verdict(), ran.notes)
    };
    let notes = vec![late.to_owned(), again.to_owned()];
    assert_eq!(judged(stalled(1), EXPECTS), (Verdict::Fail, notes.clone()));
    // Answers that two attempts do not see.
    let mut losses = 2;
    let way = move |_: &[Frame], seen: Stamped| {
        let is_lost = losses > 0 && seen.frame.to_string().starts_with("581#80FF5F07");
        losses -= u32::from(is_lost);
        (!is_lost).then_some(seen)
    };
    let steps = "[ wait: 77 ms, send: '600+n#40FF5F0700000000', \
                 expect: { frame: '580+n#80FF5F07...', within: 50 ms } ]";
    let bus = Odd { stalls: 1, ..odd(Box::new(way)) };
    assert_eq!(judged(bus, steps), (Verdict::Pass, notes));
}

#[test]
fn what_comes_between_two_stimuli_of_a_step_is_seen_by_the_next_step() {
    const STEPS: &str = "[ bench: { sensor-1: 100, sensor-2: 200 }, \
                         expect: { frame: '123#01', within: 20 ms } ]";
    for takes in [0, 5] {
        let bench = Some((Frame::new(0x123, [1]), Duration::from_millis(takes)));
        let mut bus = Odd { bench, ..odd(Box::new(|_, seen| Some(seen))) };
        let dut = Dut { bench: bus.names().unwrap(), ..dut() };
        let ran = run_on(&mut bus, &dut, 1, STEPS, &Stop::default(), &Undo::default());
        assert_eq!(verdicts(&ran), [Verdict::Pass], "{takes} ms: {:?}", ran.outcomes);
    }
}

/// A device that monitors the tester sends more while it does not run.
#[test]
fn what_comes_after_the_host_stood_still_proves_nothing() {
    const COMES: &str = "[ wait: 77 ms, send: '600+n#40 00 10 00 00 00 00 00', \
                         expect: { frame: '580+n#43 00 10 00 ...', within: 100 ms } ]";
    for (ms, repeated) in [(42, false), (142, true)] {
        let stall = Duration::from_millis(ms);
        let ran = run(&mut Odd { stall, ..stalled(1) }, 1, COMES);
        assert_eq!(verdicts(&ran), [Verdict::Pass]);
        assert_eq!(ran.notes.iter().any(|note| note.contains("142 ms")), repeated, "{ms} ms");
    }
}

/// A slave of LSS keeps no time between requests, and its answer is the same whenever it is
/// noticed.
#[test]
fn a_pause_beside_a_request_of_lss_may_be_longer() {
    const SWITCHES: &str = "wait: 77 ms, send: '7E5#04 01 00 00 00 00 00 00', wait: 40 ms";
    const SILENT: &str = "expect: { frame: '080+n#...', within: 1 s }";
    const ANSWERS: &str = "send: '7E5#5E 00 00 00 00 00 00 00', \
                           never: { frame: '7E4#...', for: 35 ms }";
    let judged = |first: &str, then: &str| {
        let mut bus = Odd { bus: generic(), ..stalled(1) };
        let (dut, stop, undo) = (dut_of_generic(), Stop::default(), Undo::default());
        let mut ran = run_on(&mut bus, &dut, 1, &format!("[ {first}, {then} ]"), &stop, &undo);
        ran.notes.retain(|note| note.ends_with("repeated"));
        (ran.outcomes[0].verdict(), ran.notes)
    };
    assert_eq!(judged(SWITCHES, SILENT), (Verdict::Fail, Vec::new()));
    assert_eq!(judged(SWITCHES, ANSWERS), (Verdict::Fail, Vec::new()));
    // Another frame comes when its time has come.
    let timed = SWITCHES.replacen("send", "send: '123#', send", 1);
    let late = "the tester was late by 42 ms: the case is repeated".to_owned();
    let again = "the tester was late in the attempt before: the case is repeated".to_owned();
    assert_eq!(judged(&timed, SILENT), (Verdict::Fail, vec![late, again]));
    assert_eq!(judged(&timed, ANSWERS), (Verdict::Fail, Vec::new()));
}

#[test]
fn a_deviation_within_the_lateness_of_the_tester_is_none_of_the_device() {
    const MEASURES: &str = "[ write: { object: '1017:00', value: 100 ms }, \
                            measure: { frame: '700+n#...', count: 3, interval: 100 ms +/- 2 ms } ]";
    let judged = |lag| {
        let mut heartbeats = 0;
        // The second heartbeat comes 3 ms late.
        let way = move |_: &[Frame], seen: Stamped| {
            let is_heartbeat = seen.frame.to_string().starts_with("701#7F");
            heartbeats += u32::from(is_heartbeat);
            let late = Duration::from_millis(if is_heartbeat && heartbeats == 2 { 3 } else { 0 });
            Some(Stamped { at: seen.at + late, ..seen })
        };
        let lag = Duration::from_millis(lag);
        verdicts(&run(&mut Odd { lag, ..odd(Box::new(way)) }, 1, MEASURES))
    };
    assert_eq!(judged(0), [Verdict::Fail]);
    assert_eq!(judged(4), [Verdict::Pass]);
}

/// A device that is a program of the same machine has as little of the time.
#[test]
fn what_a_monitor_says_while_a_frame_could_not_leave_is_undecided() {
    let judged = |before_segments| {
        let (mut sent_before, mut heartbeats) = (0, 0);
        let way = move |sent: &[Frame], seen: Stamped| {
            if sent.len() != sent_before {
                (sent_before, heartbeats) = (sent.len(), 0);
            }
            let is_heartbeat = seen.frame.to_string().starts_with("701#7F");
            heartbeats += u32::from(is_heartbeat);
            (!is_heartbeat || !(3..=6).contains(&heartbeats)).then_some(seen)
        };
        let mut bus = Odd { before_segments, ..odd(Box::new(way)) };
        let steps = "[ write: { object: '1017:00', value: 20 ms }, wait: 100 ms, send: '080#', \
                     wait: 10 ms ]";
        run(&mut bus, 1, steps).outcomes.remove(0)
    };
    assert_eq!(judged(Duration::ZERO).verdict(), Verdict::Fail);
    let late = judged(Duration::from_millis(90));
    let Outcome::Undecided(why) = &late else { panic!("{late:?}") };
    assert!(why.starts_with("the tester was late by 90 ms, and in 4 attempts"), "{why}");
}

/// It may have had its own share of the stall later.
#[test]
fn a_stall_before_a_request_leaves_says_nothing_of_what_follows() {
    let judged = |stall| {
        let before_segments = Duration::from_millis(stall);
        let mut bus = Odd { before_segments, ..odd(Box::new(|_, seen| Some(seen))) };
        let steps = "[ send: '600+n#60 00 00 00 00 00 00 00', \
                     expect: { frame: '700+n#05', within: 50 ms } ]";
        run(&mut bus, 1, steps).outcomes.remove(0).verdict()
    };
    assert_eq!(judged(90), Verdict::Fail);
    assert_eq!(judged(120), Verdict::Error);
}

#[test]
fn a_transfer_that_a_late_tester_lets_time_out_says_nothing() {
    let judged = |lag| {
        // Instead of 1008h the server answers that it gives up: 0504 0000h.
        let way = |_: &[Frame], seen: Stamped| {
            let given_up = Frame::new(0x581, [0x80, 0x08, 0x10, 0, 0, 0, 0x04, 0x05]);
            let is_answer = seen.frame.data_id() == Some(0x581)
                && seen.frame.data.get(1..3) == Some([0x08, 0x10].as_slice());
            Some(Stamped { frame: if is_answer { given_up } else { seen.frame }, ..seen })
        };
        let lag = Duration::from_millis(lag);
        let mut bus = Odd { lag, ..odd(Box::new(way)) };
        verdicts(&run(&mut bus, 1, "[ read: { object: '1008:00' } ]"))
    };
    assert_eq!(judged(0), [Verdict::Fail]);
    assert_eq!(judged(10), [Verdict::Error, Verdict::Error]);
}

/// A server may give up a transfer after a few milliseconds, and the tester may stall between an
/// answer and its next request, whatever kind of step makes it.
#[test]
fn a_server_that_waited_for_the_tester_may_give_up() {
    const READS: &str = "[ read: { object: '1009:00' } ]";
    const SENDS: &str = "[ send: '600+n#40 09 10 00 00 00 00 00', \
                         reply: { frame: '580+n#41 ...' }, \
                         send: '600+n#60 00 00 00 00 00 00 00', \
                         reply: { frame: '580+n#0. ...' } ]";
    const FIRST: &str =
        "[ send: '600+n#60 00 00 00 00 00 00 00', reply: { frame: '580+n#0. ...' } ]";
    let judged = |steps: &str, late: u64, code: Option<[u8; 4]>| {
        // What the server says instead of a segment, if it says anything.
        let way = move |sent: &[Frame], seen: Stamped| {
            let of_segment = sent.last().is_some_and(|sent| sent.data.first() == Some(&0x60))
                && seen.frame.data_id() == Some(0x580 + u16::from(NODE));
            let Some([a, b, c, d]) = code else { return (!of_segment).then_some(seen) };
            let given_up = Frame::new(0x581, [0x80, 0x09, 0x10, 0, a, b, c, d]);
            Some(Stamped { frame: if of_segment { given_up } else { seen.frame }, ..seen })
        };
        let before_segments = Duration::from_millis(late);
        let mut bus = Odd { before_segments, ..odd(Box::new(way)) };
        verdicts(&run(&mut bus, 1, steps))[0]
    };
    const TIMEOUT: [u8; 4] = [0, 0, 0x04, 0x05];
    const COMMAND: [u8; 4] = [1, 0, 0x04, 0x05];
    const GENERAL: [u8; 4] = [0, 0, 0, 0x08];
    for steps in [READS, SENDS] {
        for code in [Some(TIMEOUT), Some(COMMAND), None] {
            assert_eq!(judged(steps, 0, code), Verdict::Fail, "{steps} {code:?}");
            assert_eq!(judged(steps, 48, code), Verdict::Error, "{steps} {code:?}");
        }
        assert_eq!(judged(steps, 48, Some(GENERAL)), Verdict::Fail, "{steps}");
    }
    // No server waits for the first request.
    assert_eq!(judged(FIRST, 48, Some(COMMAND)), Verdict::Fail);
}

/// A device that shares the machine is late at other moments than the tester, and by a few times as
/// much: that excuses what missed a window by little, and not what never came.
#[test]
fn lateness_excuses_a_device_on_the_same_machine_within_proportion() {
    let dut = Dut { shares_its_machine: true, ..dut() };
    let judged = |steps: &str| {
        let lag = Duration::from_millis(8);
        let mut bus = Odd { lag, ..odd(Box::new(|_, seen| Some(seen))) };
        let ran = run_on(&mut bus, &dut, 1, steps, &Stop::default(), &Undo::default());
        (verdicts(&ran)[0], matches!(ran.outcomes[0], Outcome::Undecided(_)))
    };
    const ASKED: &str = "send: '600+n#40 00 10 00 00 00 00 00'";
    for never_comes in [
        "expect: { frame: '700+n#05'",
        "send: '123#', reply: { frame: '700+n#05'",
        "ask: { send: '123#', reply: '700+n#05'",
    ] {
        let within = |time: &str| judged(&format!("[ {ASKED}, {never_comes}, within: {time} }} ]"));
        assert_eq!(within("30 ms"), (Verdict::Error, true), "{never_comes}");
        assert_eq!(within("5 s"), (Verdict::Fail, false), "{never_comes}");
    }
    let never = format!("[ {ASKED}, never: {{ frame: '580+n#...', for: 1 s }} ]");
    assert_eq!(judged(&never), (Verdict::Error, true));
}

#[test]
fn a_tester_in_time_judges_and_so_does_one_in_virtual_time() {
    let late = |stalls, real| Odd { real, ..stalled(stalls) };
    for mut bus in [late(0, true), late(u32::MAX, false)] {
        assert_eq!(verdicts(&run(&mut bus, 1, EXPECTS)), [Verdict::Fail]);
    }
    for mut bus in [late(0, true), late(u32::MAX, false)] {
        assert_eq!(verdicts(&run(&mut bus, 1, WAITS)), [Verdict::Pass]);
    }
}

#[test]
fn what_takes_minutes_runs_where_time_is_virtual() {
    let case = "[ read: { object: '1000:00' } ]\n    requires: [{ supports: virtual-time }]";
    for (real, verdict) in [(true, Verdict::Skip), (false, Verdict::Pass)] {
        let mut bus = Odd { real, ..odd(Box::new(|_, seen| Some(seen))) };
        assert_eq!(verdicts(&run(&mut bus, 1, case)), [verdict]);
    }
}

const READS: &str = "[ nmt: reset-node, wait: 3 s, read: { object: '1000:00' } ]";

/// Whether the frame is the answer to an upload of 1001h.
fn is_error_register(frame: &Frame) -> bool {
    frame.to_string().starts_with("581#4F011000")
}

#[test]
fn an_error_that_stands_from_the_start_is_reported_once_and_no_obstacle() {
    let mut bus = odd(Box::new(|_, seen| {
        let scarred = Frame::new(0x581, [0x4F, 0x01, 0x10, 0, 0x81, 0, 0, 0]);
        let frame = if is_error_register(&seen.frame) { scarred } else { seen.frame };
        Some(Stamped { frame, ..seen })
    }));
    let ran = run(&mut bus, 3, READS);
    assert_eq!(verdicts(&ran), [Verdict::Pass; 3]);
    assert!(ran.remark.contains("1001h was 81"), "{}", ran.remark);
    assert_eq!(ran.notes, Vec::<String>::new());
}

#[test]
fn an_error_register_that_cannot_be_read_is_no_obstacle() {
    let mut bus = odd(Box::new(|_, seen| {
        let refused = Frame::new(0x581, [0x80, 0x01, 0x10, 0, 0, 0, 0, 8]);
        let frame = if is_error_register(&seen.frame) { refused } else { seen.frame };
        Some(Stamped { frame, ..seen })
    }));
    let ran = run(&mut bus, 3, READS);
    assert_eq!(verdicts(&ran), [Verdict::Pass; 3]);
    assert!(ran.remark.contains("upload of 1001:00 before the first case"), "{}", ran.remark);
}

#[test]
fn a_request_before_the_boot_up_message_is_told() {
    let apart = |steps: &str| {
        // A DRR460 boots later than a request is waited for.
        let mut bus = odd(Box::new(|_, seen| Some(seen)));
        bus.bus = VirtualBus::new(BIT_RATE);
        bus.bus.attach(devices::device("generic").unwrap().node(NODE, Rules::default()));
        let ran = run(&mut bus, 1, steps);
        let Outcome::Fail(problem) = &ran.outcomes[0] else { panic!("{:?}", ran.outcomes) };
        (problem.actual.clone(), problem.apart.clone())
    };
    let told = Some("the request was sent before the boot-up message".to_owned());
    let too_early = apart("[ nmt: reset-node, read: { object: '1000:00' } ]");
    assert_eq!(too_early, ("no answer".to_owned(), told));
    let stopped = apart("[ nmt: stop, read: { object: '1000:00' }, nmt: reset-node ]");
    assert_eq!(stopped, ("no answer".to_owned(), None));
}

#[test]
fn a_boot_up_message_that_never_comes_is_waited_for_once() {
    let mut bus = odd(Box::new(|_, seen| (seen.frame != Frame::new(0x701, [0])).then_some(seen)));
    let fails = "[ nmt: reset-node, wait: 3 s, read: { object: '1000:00', value: 0 } ]";
    let ran = run(&mut bus, 10, fails);
    assert_eq!(verdicts(&ran), [Verdict::Fail; 10]);
    assert!(ran.remark.contains("no boot-up message"), "{}", ran.remark);
    // Ten seconds once, three in each case, and its resets.
    assert!(ran.took < Duration::from_secs(70), "{:?}", ran.took);
}

/// One that is known to send none is asked until it answers.
#[test]
fn a_step_does_not_wait_for_an_optional_boot_up_message_that_never_comes() {
    let took = |place: u16| {
        let silent = Frame::new(0x700 + place, [0]);
        let mut bus = odd(Box::new(move |_, seen| (seen.frame != silent).then_some(seen)));
        let steps = "[ nmt: reset-node, \
                     expect: { frame: '700+n#00', within: 5 s, optional: true }, \
                     read: { object: '1000:00' } ]";
        let ran = run(&mut bus, 4, steps);
        (verdicts(&ran), ran.took)
    };
    let ((usual, in_time), (without, took)) = (took(u16::from(NODE) + 1), took(u16::from(NODE)));
    assert_eq!((usual, without), (vec![Verdict::Pass; 4], vec![Verdict::Lenient; 4]));
    // Ten seconds once, and no more than the device takes to start in each case.
    assert!(took < in_time + Duration::from_secs(14), "{took:?} instead of {in_time:?}");
}

#[test]
fn a_server_may_open_some_time_after_the_boot_up_message() {
    let verdicts_of = |asks: &str| {
        let mut booted = Instant::ZERO;
        let mut bus = odd(Box::new(move |_, seen| {
            if seen.frame == Frame::new(0x701, [0]) {
                booted = seen.at;
            }
            let is_answer = seen.frame.data_id() == Some(0x581);
            let too_early = is_answer && seen.at < booted + Duration::from_millis(10);
            (!too_early).then_some(seen)
        }));
        let boots = "nmt: reset-node, expect: { frame: '700+n#00', within: 5 s }";
        verdicts(&run(&mut bus, 2, &format!("[ {boots}, {asks} ]")))
    };
    assert_eq!(verdicts_of("read: { object: '1000:00' }"), [Verdict::Pass; 2]);
    let at_once = "send: '600+n#40 00 10 00 00 00 00 00', reply: { frame: '580+n#43 ...' }";
    assert_eq!(verdicts_of(at_once), [Verdict::Fail; 2]);
}

#[test]
fn a_device_that_only_a_reset_of_all_nodes_brings_back_is_not_given_up() {
    let all = Frame::new(0, [0x81, 0]);
    let mut bus = odd(Box::new(move |sent, seen| {
        // Deaf from the first STOP on.
        let stopped = sent.iter().rposition(|sent| *sent == Frame::new(0, [2, NODE]));
        let back = sent.iter().rposition(|sent| *sent == all);
        (stopped <= back).then_some(seen)
    }));
    let steps = "[ nmt: stop, wait: 100 ms ]";
    let ran = run(&mut bus, 2, steps);
    assert_eq!(verdicts(&ran), [Verdict::Pass; 2]);
    assert_eq!(ran.notes, ["settled by reset of all nodes"]);
}

#[test]
fn a_device_that_no_reset_brings_back_is_given_up() {
    let mut bus =
        odd(Box::new(|sent, seen| (!sent.contains(&Frame::new(0, [2, NODE]))).then_some(seen)));
    let ran = run(&mut bus, 3, "[ nmt: stop, wait: 100 ms ]");
    let all = "reset of all nodes";
    assert!(matches!(&ran.ending, Ending::Gone(why) if why.contains(all)), "{:?}", ran.ending);
    assert_eq!(verdicts(&ran), [Verdict::Pass, Verdict::Error, Verdict::Error]);
}

/// A consumer time of two seconds is more than a run waits after each case.
#[test]
fn a_node_that_an_earlier_case_had_monitored_is_no_failure_of_the_next_one() {
    let device = devices::device("generic").unwrap();
    let mutants = mutant::of(&device).unwrap();
    let dut = dut_of_generic();
    let watches_on = mutants.iter().find(|known| known.name == "unused-entry-watched-on").unwrap();
    let mut bus = VirtualBus::new(BIT_RATE);
    bus.attach_boxed(watches_on.deviation().build(&device, NODE).unwrap());
    let mut bus = Odd { bus, ..odd(Box::new(|_, seen| Some(seen))) };
    let steps = "[ never: { frame: '080+n#...', for: 3 s }, \
                 write: { object: '1016:01', value: $other-consumer + 2000 }, \
                 send: '$other-heartbeat#05', write: { object: '1016:01', value: 0 } ]";
    let ran = run_on(&mut bus, &dut, 2, steps, &Stop::default(), &Undo::default());
    assert_eq!(verdicts(&ran), [Verdict::Pass; 2], "{:?}", ran.outcomes);
    let note = "an emergency of an earlier case came: the case is repeated after a reset";
    assert_eq!(ran.notes[0], note);
}

#[test]
fn two_devices_with_one_node_id_are_not_tested() {
    let mut bus = odd(Box::new(|_, seen| Some(seen)));
    bus.bus.attach(devices::device("em66").unwrap().node(NODE, Rules::default()));
    // Both have started long ago.
    while bus.bus.recv(Instant::ZERO + Duration::from_secs(20)).unwrap().is_some() {}
    let ran = run(&mut bus, 2, "[ read: { object: '1000:00' } ]");
    let said = "two devices have node id 1: an upload of 1000:00 had the answers \
                581#4300100091010E00 and 581#4300100094013000";
    assert!(
        matches!(&ran.ending, Ending::Bus(error) if error.to_string().starts_with(said)),
        "{:?}",
        ran.ending
    );
    assert_eq!(verdicts(&ran), [Verdict::Error; 2]);
}

#[test]
fn a_device_that_sends_twice_is_named() {
    let mut bus = odd(Box::new(|_, seen| Some(seen)));
    bus.bus.attach(devices::device("drr460").unwrap().node(NODE, Rules::default()));
    while bus.bus.recv(Instant::ZERO + Duration::from_secs(20)).unwrap().is_some() {}
    let ran = run(&mut bus, 2, "[ read: { object: '1000:00' } ]");
    let said = "two devices may have node id 1, or one device sends twice: 2 uploads of 1000:00 \
                had 4 answers";
    assert!(ran.remark.contains(said), "{}", ran.remark);
}

#[test]
fn answers_of_four_bytes_are_named_and_no_silence() {
    let mut bus = odd(Box::new(|_, seen| {
        let cut = Frame::new(0x581, [seen.frame.data[0], 0, 0x10, 0]);
        let frame = if seen.frame.data_id() == Some(0x581) { cut } else { seen.frame };
        Some(Stamped { frame, ..seen })
    }));
    let ran = run(&mut bus, 2, "[ read: { object: '1000:00' } ]");
    assert_eq!(verdicts(&ran), [Verdict::Fail; 2]);
    assert!(
        ran.remark.contains("it answers SDO with 4 bytes where 8 are required"),
        "{}",
        ran.remark
    );
    assert_eq!(ran.ending, Ending::Complete);
}

#[test]
fn answers_that_are_garbage_are_named() {
    let mut bus = odd(Box::new(|_, seen| {
        let noise = Frame::new(0x581, [0xFF, 1, 2, 3, 4, 5, 6, 7]);
        let frame = if seen.frame.data_id() == Some(0x581) { noise } else { seen.frame };
        Some(Stamped { frame, ..seen })
    }));
    let ran = run(&mut bus, 2, "[ read: { object: '1000:00' } ]");
    assert_eq!(verdicts(&ran), [Verdict::Fail; 2]);
    let said = "it answers an upload of 1000:00 with 581#FF01020304050607";
    assert!(ran.remark.contains(said), "{:?} {}", ran.ending, ran.remark);
    assert_eq!(ran.ending, Ending::Complete);
}

const CHANGES: &str = "[ write: { object: '1017:00', value: 100 }, wait: 60 s ]\n    \
                       finally: [ send: '123#' ]";
/// The device has taken the value, and says so when it is to be restored.
const CHANGED: &str = "581#6017100000000000";
const READ_BACK: &str = "581#4B17100064000000";

/// A bus on which the user sends a signal whenever one of these frames is seen for the first time.
fn signalled(stop: &Stop, at: &'static [&'static str]) -> Odd {
    let (stop, mut left) = (stop.clone(), at.to_vec());
    odd(Box::new(move |_, seen| {
        let before = left.len();
        left.retain(|frame| seen.frame.to_string() != *frame);
        (left.len()..before).for_each(|_| stop.signal());
        Some(seen)
    }))
}

#[test]
fn a_signal_ends_the_steps_and_not_what_undoes_them() {
    let (stop, undo) = (Stop::default(), Undo::default());
    let mut bus = signalled(&stop, &[CHANGED]);
    let ran = run_until(&mut bus, 3, CHANGES, &stop, &undo);
    assert_eq!(ran.ending, Ending::Bus(BusError::Interrupted));
    assert_eq!(verdicts(&ran), [Verdict::Error, Verdict::Skip, Verdict::Skip]);
    assert_eq!(ran.outcomes[1], Outcome::Skip("not run: interrupted".to_owned()));
    assert!(bus.sent.contains(&Frame::new(0x123, [])), "`finally` was not run");
    assert!(bus.sent.contains(&Frame::new(0x601, [0x2B, 0x17, 0x10, 0, 0, 0, 0, 0])));
    assert_eq!(undo.said(), None);
    assert!(ran.took < Duration::from_secs(10), "{:?}", ran.took);
}

#[test]
fn a_signal_while_objects_are_set_back_is_remembered() {
    let (stop, undo) = (Stop::default(), Undo::default());
    let ran = run_until(&mut signalled(&stop, &[READ_BACK]), 3, CHANGES, &stop, &undo);
    assert_eq!(ran.ending, Ending::Bus(BusError::Interrupted));
    assert_eq!(verdicts(&ran), [Verdict::Pass, Verdict::Error, Verdict::Skip]);
    assert_eq!(undo.said(), None);
}

#[test]
fn a_second_signal_names_what_stays_changed() {
    let (stop, undo) = (Stop::default(), Undo::default());
    let ran = run_until(&mut signalled(&stop, &[CHANGED, READ_BACK]), 2, CHANGES, &stop, &undo);
    assert_eq!(ran.ending, Ending::Bus(BusError::Interrupted));
    assert_eq!(verdicts(&ran), [Verdict::Error, Verdict::Skip]);
    let said = "these objects may not be as they were before the run: 1017:00 (was 00 00)";
    assert_eq!(undo.said().as_deref(), Some(said));
    assert_eq!(ran.notes, ["not every object could be restored: 1017:00"]);
}

#[test]
fn a_step_that_sends_for_hours_is_refused() {
    let steps = "[ produce: { frame: '123#', count: 1000001, every: 1 ms } ]";
    let ran = run(&mut odd(Box::new(|_, seen| Some(seen))), 1, steps);
    let Outcome::Error { reason, .. } = &ran.outcomes[0] else { panic!("{:?}", ran.outcomes) };
    assert_eq!(reason, "a step may send 1000000 frames, and this one sends 1000001");
}

#[test]
fn a_case_with_too_many_instances_is_refused_before_they_are_made() {
    let values: Vec<String> = (0..30).map(|value| value.to_string()).collect();
    let values = values.join(", ");
    let matrix = ["a", "b", "c", "d", "e", "f"].map(|name| format!("{name}: [{values}]"));
    let text = format!(
        "suite: any\ncases:\n  - id: all\n    title: Anything.\n    checks: [ANY-01]\n    \
         matrix: {{ {} }}\n    steps: [ write: {{ object: '1017:00', value: $a }} ]\n",
        matrix.join(", ")
    );
    let complaints = plan::plan(&library(&text), &dut(), &BTreeMap::new()).unwrap_err();
    let said = "`all` has 729000000 instances, and a case may have 20000";
    assert_eq!(complaints[0].message, said);
}

/// The runner's rule about a late tester, said beforehand.
#[test]
fn a_case_bears_what_its_shortest_window_bears() {
    let policy = Policy::at_bit_rate(BIT_RATE);
    let bears = |steps: &str| {
        let case = format!("  - {{ id: a, title: Any., checks: [ANY-01], steps: {steps} }}\n");
        let library = library(&format!("suite: any\ncases:\n{case}"));
        let plan = plan::plan(&library, &dut(), &BTreeMap::new()).unwrap();
        super::bears(&plan.instances[0], &policy)
    };
    let ms = |ms| Some(Duration::from_millis(ms));
    let and_frames = |ms| Some(Duration::from_millis(ms) + policy.bus_slack * 2);
    let heartbeat = |within| format!("[expect: {{ frame: '701#..', within: {within} }}]");
    assert_eq!(bears("[]"), None);
    assert_eq!(bears(&heartbeat("200 ms")), and_frames(20));
    assert_eq!(bears(&heartbeat("20 ms")), and_frames(5));
    // A host that stands still spoils each failure.
    assert_eq!(bears(&heartbeat("5 s")), ms(100));
    assert_eq!(bears("[read: { object: '1000:00', value: 0 }]"), ms(100));
    // The request may be late, since its answer counts from its end.
    assert_eq!(bears("[send: '601#40 00 10 00 00 00 00 00']"), None);
    assert_eq!(bears("[send: '000#01 01', wait: 1 s]"), and_frames(5));
}
