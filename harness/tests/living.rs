//! Whole runs against devices that are alive, and peculiar: nobody is lost and no case is red,
//! neither with the device file that `harness init` writes nor with everything allowed, in whatever
//! order the cases run. ORDERS is how many orders are tried at least.

mod common;
#[path = "common/session.rs"]
mod session;

use std::ops::RangeInclusive;
use std::path::Path;
use std::{env, fs};

use canopen::bench::Needs;
use canopen::lss::{self, Mode, Request};
use canopen::{BenchError, Bus, Device, Frame, Instant, Outbox, Value, VirtualBus, nmt};
use clap::Parser;
use harness::cli::Cli;
use harness::target::DEFAULT_BIT_RATE;
use harness::target::{self, Target};
use reference_devices::devices;
use reference_devices::rules::Rules;
use reference_devices::stack::Node;
use reports::{Event, Verdict};
use runner::plan;
use runner::run::Ending;
use runner::stop::Stop;

use session::run_session;

const NODE: u8 = 2;

/// With everything allowed.
const FULL: &str = "allow: { outputs: true }\n";

#[test]
fn an_error_keeps_the_device_out_of_operational() {
    let runs = of("sim:generic?personality=scarred-and-kept-out");
    for run in &runs {
        assert!(run.blocked > 100, "{} cases are blocked", run.blocked);
        assert_eq!(run.lenient("cia301/nmt/"), ["cia301/nmt/stays-operational"]);
    }
    for of_a_file in runs.chunks(runs.len() / 2) {
        for run in of_a_file {
            assert_eq!(run.verdicts, of_a_file[0].verdicts, "the order makes a difference");
        }
    }
}

/// Whether it is there in the first moment decides what the device can show of OPERATIONAL. A case
/// in which it comes or goes may fail, is repeated, and is FLAKY then.
#[test]
fn an_error_comes_and_goes() {
    for file in [initial(), FULL.to_owned()] {
        let mut verdicts = orders(2).map(|seed| {
            let faulty = Peculiar { faulty: true, ..Peculiar::default() };
            let mut came = peculiar_in_order(&file, faulty, seed);
            // The suites of the device itself know all its errors.
            came.red.retain(|red| !red.contains(" generic/"));
            came.verdicts.retain(|name, _| !name.starts_with("generic/"));
            assert_eq!(came.red, Vec::<String>::new(), "{file}");
            assert!(came.blocked > 100, "{} cases are blocked", came.blocked);
            let mild = |found: &&mut Verdict| matches!(**found, Verdict::Lenient | Verdict::Flaky);
            came.verdicts.values_mut().filter(mild).for_each(|found| *found = Verdict::Pass);
            came.verdicts
        });
        let first = verdicts.next().expect("there are two orders");
        verdicts.for_each(|it| assert_eq!(it, first, "the order makes a difference"));
    }
}

#[test]
fn a_device_starts_itself_and_does_not_say_so() {
    for run in of("sim:generic?personality=unannounced-self-starter") {
        assert!(run.skipped.contains(&"cia301/nmt/pre-operational-after-boot-up".to_owned()));
        // What is stored on command is tried, although the application stores by itself.
        let restored = "cia301/nmt/reset-communication-restores".to_owned();
        assert!(!run.skipped.iter().any(|name| name.starts_with(&restored)));
    }
}

#[test]
fn layer_setting_services_are_slow_and_nothing_is_restored() {
    of("sim:generic?personality=slow-configurator");
}

/// CiA 301, 7.5.2.19, leaves no room here: an entry of 1016h with the time 0 is not used, so a
/// device that reports its node as lost has a deviation. It is that of one case; that the emergency
/// comes in others is not theirs.
#[test]
fn a_node_is_monitored_on_after_its_entry_was_set_back() {
    for file in [initial().as_str(), FULL] {
        for seed in orders(4) {
            let target = target("sim:generic?mutant=unused-entry-watched-on", file);
            let bus = target.open(&Stop::default()).map_err(|refused| refused.message);
            let run = run(&target, bus.expect("it is simulated"), seed);
            let red = ["FAIL cia301/heartbeat-consumer/unused-from-now-on"];
            assert_eq!(run.red, red, "seed {seed}\n{file}");
        }
    }
}

/// Of what a device sends with the identifier that somebody has stored, or when it starts, the
/// inhibit time goes on in the next case. These orders showed it.
#[test]
fn an_emergency_holds_back_none_of_the_next_case() {
    let suites = ["emcy", "heartbeat-consumer", "emcy-objects", "rpdo-errors", "sync"];
    for more in ["identifier-of-emergencies-moved-in-the-field", "error-from-power-on"] {
        let address =
            format!("sim:generic?freedom=long-inhibit-time-of-emergencies-by-default,{more}");
        for seed in [5, 8, 19] {
            let target = target(&address, FULL);
            let bus = target.open(&Stop::default()).map_err(|refused| refused.message);
            let chosen = |suite: &str| suites.iter().any(|it| suite == format!("cia301/{it}"));
            let run = run_of(&target, bus.expect("it is simulated"), seed, chosen);
            assert_eq!(run.red, Vec::<String>::new(), "{address}, seed {seed}");
        }
    }
}

#[test]
fn requests_are_lost_while_the_device_starts() {
    for file in [initial(), FULL.to_owned()] {
        for seed in orders(1) {
            let deaf = Peculiar { deaf_at_start: true, ..Peculiar::default() };
            let run = peculiar_in_order(&file, deaf, seed);
            assert_eq!(run.red, Vec::<String>::new(), "seed {seed}\n{file}");
        }
    }
}

/// CiA 305, 6.4.2, leaves no room here: a slave that was given a node id while it had none boots
/// when it leaves LSS configuration. One that waits for a reset has a deviation, which is that of
/// one case; it is not lost, and cases that only want it back get it back.
#[test]
fn a_node_id_is_used_from_reset_node_on() {
    for file in [initial(), FULL.to_owned()] {
        for seed in orders(4) {
            let peculiar = Peculiar { starts_at_reset: true, ..Peculiar::default() };
            let run = peculiar_in_order(&file, peculiar, seed);
            assert_eq!(run.red, ["FAIL cia305/unconfigured/starts"], "seed {seed}\n{file}");
        }
    }
}

/// The outcome of a run.
#[derive(Debug, Default)]
struct Came {
    red: Vec<String>,
    skipped: Vec<String>,
    blocked: usize,
    /// By name, in the order of names.
    verdicts: std::collections::BTreeMap<String, Verdict>,
}

impl Came {
    fn lenient(&self, prefix: &str) -> Vec<&str> {
        let lenient = self.verdicts.iter().filter(|(_, verdict)| **verdict == Verdict::Lenient);
        lenient.map(|(name, _)| name.as_str()).filter(|name| name.starts_with(prefix)).collect()
    }
}

/// Seeds of orders, so many or as many as ORDERS says.
fn orders(least: u64) -> RangeInclusive<u64> {
    let more: Option<u64> = env::var("ORDERS").ok().and_then(|orders| orders.parse().ok());
    1..=more.unwrap_or_default().max(least)
}

/// Runs with both files, in two orders each or more, of which none is red.
fn of(address: &str) -> Vec<Came> {
    let (mut all, initial) = (Vec::new(), initial());
    for file in [initial.as_str(), FULL] {
        for seed in orders(2) {
            let target = target(address, file);
            let bus = target.open(&Stop::default()).map_err(|refused| refused.message);
            let run = run(&target, bus.expect("it is simulated"), seed);
            assert_eq!(run.red, Vec::<String>::new(), "{address}, seed {seed}\n{file}");
            all.push(run);
        }
    }
    all
}

fn peculiar_in_order(file: &str, peculiar: Peculiar, seed: u64) -> Came {
    let mut target = target("sim:generic", file);
    target.dut.shares_its_bus = peculiar.faulty;
    let described = devices::device("generic").expect("it is part of the program");
    let node = described.node(NODE, Rules::default());
    let mut bus = VirtualBus::new(DEFAULT_BIT_RATE);
    let due = if peculiar.faulty { Instant::ZERO } else { Instant::NEVER };
    let fault = Fault { present: false, due };
    bus.attach(Wrapped { node, peculiar, since_reset: None, held: false, given: None, fault });
    run(&target, target.guard(Box::new(bus)), seed)
}

/// What `harness init` protects.
fn initial() -> String {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("device-under-test.yaml");
    let mut command = common::harness();
    command.args(["init", "--target", "sim:generic", "--node", "2", "--out"]).arg(&path);
    assert!(command.output().expect("it runs").status.success());
    let text = fs::read_to_string(&path).expect("it is written");
    text[text.find("protect:").expect("it protects something")..].to_owned()
}

fn target(address: &str, file: &str) -> Target {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("device-under-test.yaml");
    let text = format!("target: \"{address}\"\nnode: {NODE}\n{file}");
    fs::write(&path, text).expect("it can be written");
    let args = args(&path);
    let library = args.selection.folders.load().expect("the suites load");
    let targets = target::resolve(&args.selection, &library.catalogue, &Stop::default());
    targets.map_err(|refused| refused.message).expect("a target").remove(0)
}

fn args(path: &Path) -> harness::cli::RunArgs {
    let cli = Cli::try_parse_from(["harness", "--dut", path.to_str().expect("a path")]);
    let args = cli.expect("a command line").run.only();
    args.map_err(|refused| refused.message).expect("a device file")
}

fn run(target: &Target, bus: Box<dyn Bus>, seed: u64) -> Came {
    run_of(target, bus, seed, |_| true)
}

/// Runs the suites that are chosen, in random order.
fn run_of(
    target: &Target,
    mut bus: Box<dyn Bus>,
    seed: u64,
    chosen: impl Fn(&str) -> bool,
) -> Came {
    let cli = Cli::try_parse_from(["harness"]).expect("a command line");
    let library = cli.run.selection.folders.load().expect("the suites load");
    let models = target::models(&target.dut.eds);
    let mut plan = plan::plan(&library, &target.dut, &models).expect("the suites fit");
    plan.leave_out_foreign();
    plan.instances.retain(|instance| chosen(instance.suite.name()));
    fastrand::Rng::with_seed(seed).shuffle(&mut plan.instances);
    let (mut came, mut case) = (Came::default(), String::new());
    let ending = run_session(&library, &plan, &mut *bus, &mut |event| match event {
        Event::CaseStarted(started) => case = started.name(),
        Event::CaseEnded(ended) => {
            let (name, verdict) = (std::mem::take(&mut case), ended.outcome.verdict());
            match verdict {
                Verdict::Fail | Verdict::Error => {
                    eprintln!("{name}: {:?}", ended.outcome);
                    came.red.push(format!("{verdict} {name}"));
                }
                Verdict::Skip => came.skipped.push(name.clone()),
                Verdict::Blocked => came.blocked += 1,
                _ => {}
            }
            came.verdicts.insert(name, verdict);
        }
        _ => {}
    });
    assert_eq!(ending, Ending::Complete);
    came
}

/// How a device differs.
#[derive(Clone, Copy, Debug, Default)]
struct Peculiar {
    /// Without a node id, it hears no LSS in the first 100 ms after a reset.
    deaf_at_start: bool,
    /// A device without node id that was given one starts at reset node, and not when it leaves LSS
    /// configuration.
    starts_at_reset: bool,
    /// An input is broken now and then, from power-on on, and the device is not started meanwhile.
    faulty: bool,
}

/// The broken input.
struct Fault {
    present: bool,
    /// When that changes.
    due: Instant,
}

struct Wrapped {
    node: Node,
    peculiar: Peculiar,
    since_reset: Option<Instant>,
    /// Whether it has a node id, but was not started with it.
    held: bool,
    /// The node id that it was given last, and whether it has none in use.
    given: Option<(u8, bool)>,
    fault: Fault,
}

impl Wrapped {
    /// Whether the frame reaches the node.
    fn hears(&mut self, now: Instant, frame: &Frame, out: &mut Outbox) -> bool {
        let is_reset = frame.data_id() == Some(nmt::COB_ID)
            && matches!(frame.data.first(), Some(0x81 | 0x82))
            && [0, NODE].contains(frame.data.get(1).unwrap_or(&1));
        if is_reset {
            self.since_reset = Some(now);
            if let Some((lss::UNCONFIGURED, without)) = &mut self.given {
                *without = true;
            }
            if self.held && frame.data[0] == 0x81 {
                (self.held, self.given) = (false, None);
                let leave = Request::SwitchGlobal(Mode::WAITING).frame();
                self.node.handle_frame(now, &leave, out);
                return false;
            }
        }
        if frame.data_id() != Some(lss::REQUEST_COB_ID) {
            let starts = frame.data_id() == Some(nmt::COB_ID) && frame.data.first() == Some(&0x01);
            return !(starts && self.fault.present);
        }
        const STARTING: std::time::Duration = std::time::Duration::from_millis(100);
        // One with a node id has started with its boot-up message.
        let without = self.given.is_some_and(|(_, without)| without);
        let starting = without && self.since_reset.is_some_and(|reset| now.since(reset) < STARTING);
        if self.peculiar.deaf_at_start && starting || self.held {
            return false;
        }
        match Request::decode(&frame.data) {
            Ok(Request::ConfigureNodeId(node)) => {
                self.given = Some((node, without));
            }
            Ok(Request::SwitchGlobal(Mode::WAITING)) => {
                let has_one = |(node, without): (u8, bool)| without && node != lss::UNCONFIGURED;
                let starts = self.given.is_some_and(has_one);
                self.held = starts && self.peculiar.starts_at_reset;
                if starts && !self.held {
                    // It starts at once with the node id that it was given.
                    self.given = None;
                }
                return !self.held;
            }
            _ => {}
        }
        true
    }
}

impl Device for Wrapped {
    fn handle_frame(&mut self, now: Instant, frame: &Frame, out: &mut Outbox) {
        if self.hears(now, frame, out) {
            self.node.handle_frame(now, frame, out);
        }
    }

    fn handle_timeout(&mut self, now: Instant, out: &mut Outbox) {
        const PERIOD: std::time::Duration = std::time::Duration::from_secs(17);
        if now >= self.fault.due {
            let present = !self.fault.present;
            self.fault = Fault { present, due: now + PERIOD };
            let value = Value::Int(i128::from(present));
            self.node.stimulate(now, "input-fault", &value, out).expect("it has inputs");
        }
        self.node.handle_timeout(now, out);
    }

    fn poll_at(&self) -> Option<Instant> {
        let due = Some(self.fault.due).filter(|_| self.peculiar.faulty);
        self.node.poll_at().into_iter().chain(due).min()
    }

    fn bench_names(&self) -> Vec<String> {
        self.node.bench_names()
    }

    fn bench_needs(&self) -> Needs {
        self.node.bench_needs()
    }

    fn stimulate(
        &mut self,
        now: Instant,
        name: &str,
        value: &Value,
        out: &mut Outbox,
    ) -> Result<(), BenchError> {
        if name == canopen::bench::POWER {
            (self.held, self.given) = (false, None);
        }
        self.node.stimulate(now, name, value, out)
    }

    fn observe(&self, name: &str) -> Option<Value> {
        self.node.observe(name)
    }
}
