//! Whole runs of every suite against devices of which something is protected. An observer inside
//! the device decodes each frame that reaches it by the values that its dictionary has at that
//! moment, and shares no code with what keeps such frames from being sent.

#[path = "common/session.rs"]
mod session;

use std::fs;
use std::sync::{Arc, Mutex};

use campaign::session::{Player, Script};
use campaign::{Blueprint, bytes};
use canopen::bench::Needs;
use canopen::catalogue::Catalogue;
use canopen::eds::Eds;
use canopen::nmt::NmtState;
use canopen::{BenchError, Device, Frame, Instant, Mux, Outbox, Value, VirtualBus};
use clap::Parser;
use harness::cli::{Cli, RunArgs};
use harness::target;
use harness::target::{DEFAULT_BIT_RATE, Target};
use reference_devices::devices;
use reference_devices::rules::Rules;
use reference_devices::stack::Node;
use reports::{Event, Verdict};
use runner::plan;
use runner::run::Ending;
use runner::stop::Stop;

use session::run_session;

#[test]
fn nothing_protected_is_done_to_generic() {
    for seed in 1..=4 {
        watch("generic", seed);
    }
}

#[test]
fn nothing_protected_is_done_to_em66() {
    for seed in 1..=2 {
        watch("em66", seed);
    }
}

#[test]
fn nothing_protected_is_done_to_a_controller() {
    watch("drr460", 1);
}

#[test]
fn nothing_protected_is_done_to_an_io_module() {
    watch("mcm260x-9ad", 1);
}

#[test]
fn nothing_protected_is_done_to_a_valve_controller() {
    watch("ax021211", 1);
}

/// No output is driven unless a device file says that it may be: neither by its value nor by a
/// parameter that gives it a source, an override or a polarity. The DRR460 is left out: what it
/// measures on the bench decides what it does.
#[test]
fn outputs_that_are_off_stay_off() {
    for device in ["generic", "em66", "mcm260x-9ad", "ax021211"] {
        let came = run(device, &Drawn::default(), &format!("target: sim:{device}\n"));
        assert_eq!(came.driven, Vec::<String>::new(), "{device}");
        assert_eq!(came.wrong, Vec::<String>::new(), "{device}");
        let file = format!("target: sim:{device}\nallow: {{ outputs: true }}\n");
        let free = run(device, &Drawn::default(), &file);
        assert!(!free.driven.is_empty(), "{device}: the observer sees nothing");
    }
}

/// A thousand sessions, and what they did to the device.
#[test]
fn nothing_protected_is_done_by_a_campaign() {
    let mut unprotected = 0;
    for seed in 1..=20 {
        let described = devices::device("generic").expect("it is part of the program");
        let drawn = Drawn::of(&described.description.eds, seed);
        let file = drawn.file("generic");
        let breaches = fuzzed("generic", &drawn, seed, &file, 50);
        assert_eq!(breaches, Vec::<String>::new(), "seed {seed}\n{file}");
        let free = "target: sim:generic\nallow: { outputs: true }\n";
        unprotected += fuzzed("generic", &drawn, seed, free, 2).len();
    }
    assert!(unprotected > 20, "the observer sees nothing");
}

/// Draws what is protected, runs everything with that and without, and looks at what came.
fn watch(device: &str, seed: u64) {
    let described = devices::device(device).expect("it is part of the program");
    let drawn = Drawn::of(&described.description.eds, seed);
    let file = drawn.file(device);
    let with = run(device, &drawn, &file);
    assert_eq!(with.breaches, Vec::<String>::new(), "seed {seed}\n{file}");
    assert_eq!(with.wrong, Vec::<String>::new(), "seed {seed}\n{file}");
    assert!(with.passed > 200, "only {} cases ran with seed {seed}\n{file}", with.passed);
    let without =
        run(device, &drawn, &format!("target: sim:{device}\nallow: {{ outputs: true }}\n"));
    assert!(!without.breaches.is_empty(), "the observer sees nothing with seed {seed}\n{file}");
    assert!(without.passed > with.passed);
}

/// What is protected.
#[derive(Clone, Default)]
struct Drawn {
    objects: Vec<Mux>,
    bit_timing: bool,
    store: bool,
    reset_node: bool,
    reset_communication: bool,
    all_nodes: bool,
    stores: u32,
    loads: u32,
}

impl Drawn {
    fn of(eds: &Eds, seed: u64) -> Self {
        let mut random = fastrand::Rng::with_seed(seed);
        let writable = eds.entries().filter(|entry| entry.access.writable());
        let mut objects: Vec<Mux> = writable.map(|entry| entry.mux).collect();
        objects.retain(|mux| !matches!(mux.index, 0x1010 | 0x1011));
        random.shuffle(&mut objects);
        objects.truncate(random.usize(1..=24));
        Self {
            objects,
            bit_timing: random.bool(),
            store: random.bool(),
            reset_node: random.bool(),
            reset_communication: random.bool(),
            all_nodes: random.bool(),
            stores: random.u32(0..6),
            loads: random.u32(0..6),
        }
    }

    /// The device file that says so.
    fn file(&self, device: &str) -> String {
        let objects: Vec<String> = self.objects.iter().map(|mux| format!("{mux:?}")).collect();
        let words = |words: &[(&'static str, bool)]| {
            let words = words.iter().filter(|(_, drawn)| *drawn).map(|(word, _)| *word);
            words.collect::<Vec<_>>().join(", ")
        };
        format!(
            "target: sim:{device}\nprotect:\n  objects: [\"{}\"]\n  stores: {}\n  loads: {}\n  \
             lss: [{}]\n  nmt: [{}]\nallow:\n  outputs: true\n",
            objects.join("\", \""),
            self.stores,
            self.loads,
            words(&[("bit-timing", self.bit_timing), ("store", self.store)]),
            words(&[
                ("reset-node", self.reset_node),
                ("reset-communication", self.reset_communication),
                ("all-nodes", self.all_nodes),
            ]),
        )
    }
}

/// What came of a run.
#[derive(Default)]
struct Came {
    breaches: Vec<String>,
    wrong: Vec<String>,
    /// The cases that drive an output, each with the first one.
    driven: Vec<String>,
    passed: usize,
}

/// The command line with a device file.
fn arguments(file: &str) -> RunArgs {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("device-under-test.yaml");
    fs::write(&path, file).expect("it can be written");
    let cli = Cli::try_parse_from(["harness", "--dut", path.to_str().expect("a path")]);
    let args = cli.expect("a command line").run.only();
    args.map_err(|refused| refused.message).expect("a device file")
}

fn target_of(args: &RunArgs, catalogue: &Catalogue) -> Target {
    let targets = target::resolve(&args.selection, catalogue, &Stop::default());
    targets.map_err(|refused| refused.message).expect("a target").remove(0)
}

/// What sessions of a campaign do to the device that they must not.
fn fuzzed(device: &str, drawn: &Drawn, seed: u64, file: &str, sessions: u64) -> Vec<String> {
    let args = arguments(file);
    let catalogue = args.selection.folders.catalogue.load().expect("a catalogue");
    let target = target_of(&args, &catalogue);
    let described = devices::device(device).expect("it is part of the program");
    let settings = described.description.settings.clone();
    let eds = described.description.eds.clone();
    let blueprint = Blueprint::of_sheet(eds, target.dut.node, settings).expect("a data sheet");
    let breaches = Arc::new(Mutex::new(Vec::new()));
    for number in 0..sessions {
        let node = described.node(target.dut.node, Rules::default());
        let (drawn, breaches) = (drawn.clone(), Arc::clone(&breaches));
        let mut bus = VirtualBus::new(DEFAULT_BIT_RATE);
        bus.attach(Watched::new(node, drawn, breaches, Arc::default()));
        let mut bus = target.guard(Box::new(bus));
        let model = blueprint.build([]).expect("a model");
        let player = Player::new(&mut *bus, &blueprint, model);
        let played = player.play(&Script::Bytes(&bytes(seed, number))).expect("a bus");
        assert_eq!(played.end, None, "session {number} with seed {seed}\n{file}");
    }
    std::mem::take(&mut *breaches.lock().expect("nothing panicked"))
}

fn run(device: &str, drawn: &Drawn, file: &str) -> Came {
    let args = arguments(file);
    let library = args.selection.folders.load().expect("the suites load");
    let target = target_of(&args, &library.catalogue);
    let models = target::models(&target.dut.eds);
    let mut plan = plan::plan(&library, &target.dut, &models).expect("the suites fit");
    plan.leave_out_foreign();
    let described = devices::device(device).expect("it is part of the program");
    let node = described.node(target.dut.node, Rules::default());
    let breaches = Arc::new(Mutex::new(Vec::new()));
    let driven = Arc::new(Mutex::new(None));
    let mut bus = VirtualBus::new(DEFAULT_BIT_RATE);
    let watched = Watched::new(node, drawn.clone(), Arc::clone(&breaches), Arc::clone(&driven));
    bus.attach(watched);
    let (mut came, mut case) = (Came::default(), String::new());
    let mut bus = target.guard(Box::new(bus));
    let ending = run_session(&library, &plan, &mut *bus, &mut |event| match event {
        Event::CaseStarted(started) => case = started.name(),
        Event::CaseEnded(ended) => {
            let driven = driven.lock().expect("nothing panicked").take();
            came.driven.extend(driven.map(|output| format!("{case}: {output}")));
            match ended.outcome.verdict() {
                Verdict::Pass | Verdict::Lenient => came.passed += 1,
                verdict @ (Verdict::Fail | Verdict::Error) => {
                    came.wrong.push(format!("{verdict} {case}: {:?}", ended.outcome));
                }
                _ => {}
            }
        }
        _ => {}
    });
    assert_eq!(ending, Ending::Complete);
    came.breaches = std::mem::take(&mut *breaches.lock().expect("nothing panicked"));
    came
}

/// How the names of outputs on a bench begin.
const DRIVEN: [&str; 4] = ["digital-outputs-", "analogue-output-", "output-current-", "heater"];

/// A device that notes what is done to it and must not be.
struct Watched {
    node: Node,
    drawn: Drawn,
    breaches: Arc<Mutex<Vec<String>>>,
    /// How often 1010h and 1011h were written.
    writes: [u32; 2],
    /// The names of its outputs on a bench.
    outputs: Vec<String>,
    /// The first output that is driven, and how.
    driven: Arc<Mutex<Option<String>>>,
}

impl Watched {
    fn new(
        node: Node,
        drawn: Drawn,
        breaches: Arc<Mutex<Vec<String>>>,
        driven: Arc<Mutex<Option<String>>>,
    ) -> Self {
        let drives = |name: &String| DRIVEN.iter().any(|known| name.starts_with(known));
        let outputs = node.bench_names().into_iter().filter(drives).collect();
        Self { node, drawn, breaches, writes: [0; 2], outputs, driven }
    }

    /// Notes the first output that is driven.
    fn look_at_outputs(&self, now: Instant) {
        let mut driven = self.driven.lock().expect("nothing panicked");
        if driven.is_some() {
            return;
        }
        let on = self.outputs.iter().filter_map(|name| Some((name, self.node.observe(name)?)));
        let is_on = |value: &Value| match value {
            Value::Text(word) => word == "on",
            value => value.as_real().is_some_and(|value| value != 0.0),
        };
        let mut on = on.filter(|(_, value)| is_on(value));
        *driven = on.next().map(|(name, value)| format!("{now} {name} = {value:?}"));
    }

    fn look(&mut self, now: Instant, frame: &Frame) {
        let (Some(id), false) = (frame.id.as_standard(), frame.remote) else { return };
        let data = &*frame.data;
        let first = data.first().copied().unwrap_or_default();
        let forbidden = match id {
            0x000 => {
                self.drawn.reset_node && first == 0x81
                    || self.drawn.reset_communication && first == 0x82
                    || self.drawn.all_nodes && data.get(1) == Some(&0)
            }
            0x7E5 => {
                self.drawn.bit_timing && matches!(first, 0x13 | 0x15)
                    || self.drawn.store && first == 0x17
            }
            _ if self.is_request(id) => self.writes_by_sdo(data),
            _ => self.writes_by_pdo(id),
        };
        if forbidden {
            let mut breaches = self.breaches.lock().expect("nothing panicked");
            breaches.push(format!("{now} {frame}"));
        }
    }

    fn is_request(&self, id: u16) -> bool {
        let channel = |index| self.node.dictionary().int(Mux::new(index, 1));
        let channels = (0x1200..0x1280).filter_map(channel);
        (0x601..0x680).contains(&id)
            || channels.into_iter().any(|cob_id| cob_id as u32 & 0x8000_07FF == u32::from(id))
    }

    /// A download that begins, in one frame, in segments or in blocks.
    fn writes_by_sdo(&mut self, data: &[u8]) -> bool {
        let [command, low, high, sub, ..] = data else { return false };
        if command >> 5 != 1 && command & 0xE1 != 0xC0 {
            return false;
        }
        let mux = Mux::new(u16::from_le_bytes([*low, *high]), *sub);
        if let 0x1010 | 0x1011 = mux.index {
            let count = &mut self.writes[usize::from(mux.index - 0x1010)];
            *count += 1;
            return self.writes[0] > self.drawn.stores || self.writes[1] > self.drawn.loads;
        }
        self.drawn.objects.contains(&mux)
    }

    /// An RPDO with this identifier that maps something protected now.
    fn writes_by_pdo(&self, id: u16) -> bool {
        let value = |index, sub| self.node.dictionary().int(Mux::new(index, sub));
        let mine = |index: &u16| {
            value(*index, 1).is_some_and(|cob_id| cob_id as u32 & 0xA000_07FF == u32::from(id))
        };
        let mapped = |index: u16| {
            let count = value(index + 0x200, 0).unwrap_or(0).clamp(0, 64) as u8;
            (1..=count).filter_map(move |sub| value(index + 0x200, sub))
        };
        let mut mapped = (0x1400..0x1600).filter(mine).flat_map(mapped);
        self.node.state() == NmtState::OPERATIONAL
            && mapped.any(|entry| {
                let mux = Mux::new((entry >> 16) as u16, (entry >> 8) as u8);
                self.drawn.objects.contains(&mux)
            })
    }
}

impl Device for Watched {
    fn handle_frame(&mut self, now: Instant, frame: &Frame, out: &mut Outbox) {
        self.look(now, frame);
        self.node.handle_frame(now, frame, out);
        self.look_at_outputs(now);
    }

    fn handle_timeout(&mut self, now: Instant, out: &mut Outbox) {
        self.node.handle_timeout(now, out);
        self.look_at_outputs(now);
    }

    fn poll_at(&self) -> Option<Instant> {
        self.node.poll_at()
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
        self.node.stimulate(now, name, value, out)
    }

    fn observe(&self, name: &str) -> Option<Value> {
        self.node.observe(name)
    }
}
