//! Whole runs on a bus that others use, too: a load that leaves room changes no verdict, and one
//! that leaves none makes no case FAIL.

#[path = "common/session.rs"]
mod session;

use std::collections::BTreeMap;
use std::time::Duration;

use canopen::wire::{INTERMISSION_BITS, frame_bits};
use canopen::{Device, Frame, Instant, Outbox, VirtualBus};
use clap::Parser;
use harness::cli::Cli;
use harness::target::DEFAULT_BIT_RATE;
use harness::target::{self, Connection};
use reference_devices::rules::Rules;
use reports::{Event, Outcome, Verdict};
use runner::plan;
use runner::run::Ending;
use runner::stop::Stop;

use session::run_session;

/// Before and behind everything else on the wire but NMT and SYNC: an emergency message of one node
/// and a heartbeat of another.
const FIRST: u16 = 0x081 + 0x10;
const LAST: u16 = 0x77F;

#[test]
fn a_load_that_leaves_room_changes_no_verdict() {
    let alone = run(&[]);
    assert_eq!(alone.counts.get("FAIL"), None);
    for (percent, id) in [(30, FIRST), (50, FIRST), (60, LAST)] {
        let loaded = run(&[Crowd::new(id, percent)]);
        assert_eq!(loaded.ending, Ending::Complete);
        assert_eq!(loaded.differences(&alone), Vec::<String>::new(), "{percent} % of {id:03X}h");
        let said = format!("frames of others take {percent} % of the bus");
        assert!(loaded.remark.contains(&said), "{}", loaded.remark);
    }
}

#[test]
fn a_load_that_leaves_hardly_any_room_makes_no_case_fail() {
    for (percent, id) in [(90, FIRST), (99, LAST)] {
        let loaded = run(&[Crowd::new(id, percent)]);
        assert_eq!(loaded.failed(), Vec::<String>::new(), "{percent} % of {id:03X}h");
    }
}

#[test]
fn a_bus_without_room_is_named_for_what_it_is() {
    let loaded = run(&[Crowd::new(FIRST, 99), Crowd::new(FIRST + 1, 99)]);
    let Ending::Bus(why) = &loaded.ending else { panic!("{:?}", loaded.ending) };
    let why = why.to_string();
    assert!(why.contains("frames of others came: they leave no room on the bus"), "{why}");
    assert!(loaded.outcomes.len() > 2000, "what did not run is in the report");
    let counts: Vec<&str> = loaded.counts.keys().map(String::as_str).collect();
    assert!(counts.iter().all(|verdict| ["ERROR", "SKIP"].contains(verdict)), "{counts:?}");
}

/// Answers that are late because of others are no proof against the device.
#[test]
fn a_case_that_fails_on_a_full_bus_is_an_error_with_the_load() {
    let deaf = |id: u16| Crowd::new(id, 99);
    let loaded = run_with("sim:generic?mutant=no-boot-up", &[deaf(LAST)]);
    let alone = run_with("sim:generic?mutant=no-boot-up", &[]);
    assert!(!alone.failed().is_empty());
    assert_eq!(loaded.failed(), Vec::<String>::new());
    let errors = loaded.outcomes.values().filter_map(|outcome| match outcome {
        Outcome::Error { reason, .. } => Some(reason),
        _ => None,
    });
    let said = errors.filter(|reason| reason.starts_with("frames of others take 99 % of the bus"));
    assert!(said.count() > 0);
}

/// A station that sends a frame at regular distances.
struct Crowd {
    frame: Frame,
    period: Duration,
    next: Instant,
}

impl Crowd {
    /// Takes so much of the bus.
    fn new(id: u16, percent: u64) -> Self {
        let frame = Frame::new(id, [0x12; 8]);
        let bits = frame_bits(&frame) + INTERMISSION_BITS;
        let nanoseconds = bits * 1_000_000_000 / u64::from(DEFAULT_BIT_RATE);
        let period = Duration::from_nanos(nanoseconds * 100 / percent);
        Self { frame, period, next: Instant::ZERO }
    }
}

impl Device for Crowd {
    fn handle_frame(&mut self, _: Instant, _: &Frame, _: &mut Outbox) {}

    fn handle_timeout(&mut self, now: Instant, out: &mut Outbox) {
        while self.next <= now {
            self.next += self.period;
            // What is not sent in time is not sent twice.
            if out.is_empty() {
                out.push(self.frame);
            }
        }
    }

    fn poll_at(&self) -> Option<Instant> {
        Some(self.next)
    }
}

/// What came of a run.
struct Came {
    ending: Ending,
    remark: String,
    outcomes: BTreeMap<String, Outcome>,
    counts: BTreeMap<String, usize>,
}

impl Came {
    fn differences(&self, other: &Self) -> Vec<String> {
        let verdict = |came: &Self, name: &String| came.outcomes.get(name).map(Outcome::verdict);
        let names = self.outcomes.keys().filter(|name| verdict(self, name) != verdict(other, name));
        names.map(|name| format!("{name}: {:?}", self.outcomes[name])).collect()
    }

    fn failed(&self) -> Vec<String> {
        let failed = |outcome: &Outcome| outcome.verdict() == Verdict::Fail;
        let failed = self.outcomes.iter().filter(|(_, outcome)| failed(outcome));
        failed.map(|(name, outcome)| format!("{name}: {outcome:?}")).collect()
    }
}

fn run(crowds: &[Crowd]) -> Came {
    run_with("sim:generic", crowds)
}

fn run_with(target: &str, crowds: &[Crowd]) -> Came {
    let cli = Cli::try_parse_from(["harness", "--target", target]).expect("a command line");
    let args = cli.run;
    let library = args.selection.folders.load().expect("the suites load");
    let targets = target::resolve(&args.selection, &library.catalogue, &Stop::default());
    let target = targets.map_err(|refused| refused.message).expect("a target").remove(0);
    let models = target::models(&target.dut.eds);
    let mut plan = plan::plan(&library, &target.dut, &models).expect("the suites fit");
    plan.leave_out_foreign();
    // Its cases wait for up to an hour, in which the others send millions of frames.
    plan.instances.retain(|instance| instance.suite.name() != "cia301/long-times");
    let Connection::Simulation { device, deviation, .. } = &target.connection else {
        panic!("a simulated device")
    };
    let mut bus = VirtualBus::new(DEFAULT_BIT_RATE);
    match deviation {
        None => _ = bus.attach(device.node(target.dut.node, Rules::default())),
        Some(deviation) => {
            let built = deviation.build(device, target.dut.node).expect("it fits the device");
            bus.attach_boxed(built);
        }
    }
    for Crowd { frame, period, next } in crowds {
        bus.attach(Crowd { frame: *frame, period: *period, next: *next });
    }
    let (mut remark, mut name) = (String::new(), String::new());
    let mut outcomes = BTreeMap::new();
    let ending = run_session(&library, &plan, &mut bus, &mut |event| match event {
        Event::DeviceStarted(device) => remark = device.remark.unwrap_or_default(),
        Event::CaseStarted(case) => name = case.name(),
        Event::CaseEnded(end) => _ = outcomes.insert(name.clone(), end.outcome),
        _ => {}
    });
    let mut counts = BTreeMap::new();
    for outcome in outcomes.values() {
        *counts.entry(outcome.verdict().to_string()).or_default() += 1;
    }
    Came { ending, remark, outcomes, counts }
}
