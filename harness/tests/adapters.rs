//! Adapters and servers of others: what is found through them is what is found in virtual time, and
//! what goes wrong with them is said.

#[path = "common/adapter.rs"]
mod adapter;
#[path = "common/agree.rs"]
mod agree;
mod common;
#[path = "common/gs_usb.rs"]
mod gs_usb;
#[path = "common/python.rs"]
mod python;
#[path = "common/record.rs"]
mod record;
#[path = "common/session.rs"]
mod session;

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::process::{Child, Command, Output, Stdio};
use std::sync::mpsc;
use std::time::Duration;

use adapter::{Fault, Manner};
use canopen::{Bus, VirtualBus, eds};
use common::harness;
use harness::bus::GsUsb;
use harness::target::DEFAULT_BIT_RATE;
use reference_devices::devices;
use reference_devices::rules::Rules;
use reference_devices::stack::Node;
use reports::{CaseRun, DeviceRun, Event, Outcome, Run, Verdict};
use runner::dut::Dut;
use runner::plan::plan;
use runner::run::Ending;
use runner::stop::Stop;
use runner::suite::Library;
use session::run_session;
use tempfile::TempDir;

const SERVED: &str = "generic --node 5";
/// What is judged by contents and by time.
const CASES: [&str; 3] = ["cia301/nmt", "cia301/sdo*", "cia301/heartbeat"];

/// More frames than the harness sends to know a device, and fewer than a run.
const AFTER: usize = 150;

fn run(target: &str, cases: &[&str]) -> (Run, Output) {
    run_by(harness(), target, cases)
}

fn run_by(program: Command, target: &str, cases: &[&str]) -> (Run, Output) {
    let (folder, output) = recorded(program, target, cases);
    (record::read(&folder.path().join(JOURNAL)), output)
}

/// Runs cases, with a journal in a folder.
fn recorded(program: Command, target: &str, cases: &[&str]) -> (TempDir, Output) {
    let folder = tempfile::tempdir().expect("a folder");
    let journal = folder.path().join(JOURNAL);
    let mut run = program;
    run.args(cases).args(["-q", "--no-progress", "--target", target, "--journal"]).arg(&journal);
    let output = run.output().expect("the program starts");
    assert!(journal.exists(), "{}", said(&output));
    (folder, output)
}

const JOURNAL: &str = "journal";

fn said(output: &Output) -> String {
    let text = [&output.stdout, &output.stderr].map(|text| String::from_utf8_lossy(text));
    text.concat()
}

/// Compares what is found there with what is found in virtual time.
fn compare(target: &str) -> Run {
    compare_by(harness, target)
}

/// The same with a program that is started in this way.
fn compare_by(program: impl Fn() -> Command, target: &str) -> Run {
    let (mut found, output) = run_by(program(), target, &CASES);
    let (mut expected, _) = run("sim:generic", &CASES);
    leave_out_what_is_simulated([&mut expected, &mut found]);
    assert!(expected.cases().count() > 50, "{}", said(&output));
    agree::agree(&expected, &found, |names| {
        run_by(program(), target, &names.iter().map(String::as_str).collect::<Vec<_>>()).0
    });
    found
}

/// Takes out what is skipped where there is no bench, or since it would take minutes of the bus.
fn leave_out_what_is_simulated(runs: [&mut Run; 2]) {
    const WHY: [&str; 2] = ["time on the bus is real", "the bench does not offer"];
    let is_out = |case: &CaseRun| match &case.outcome {
        Outcome::Skip(reason) => WHY.iter().any(|why| reason.starts_with(why)),
        _ => false,
    };
    let [_, on_the_bus] = &runs;
    let out = on_the_bus.cases().filter(|(_, case)| is_out(case));
    let out: BTreeSet<String> = out.map(|(_, case)| case.info.name()).collect();
    for run in runs {
        for suite in run.devices.iter_mut().flat_map(|device| &mut device.suites) {
            suite.cases.retain(|case| !out.contains(&case.info.name()));
        }
    }
}

/// How frames got their times, as the report says.
fn times(run: &Run) -> String {
    let (device, _) = run.cases().next().expect("cases ran");
    device.info.remark.clone().unwrap_or_default()
}

#[cfg(unix)]
#[test]
fn an_adapter_on_a_serial_line_gets_the_verdicts_of_virtual_time() {
    let line = adapter::on_line(SERVED, Manner::default());
    let found = compare(&format!("slcan:{},bitrate=1000000", line.path));
    let times = times(&found);
    assert!(times.contains("the adapter's time stamps, in steps of 1 ms"), "{times}");
    assert!(times.contains("at which the adapter confirmed them"), "{times}");
}

#[test]
fn an_adapter_that_answers_nothing_gets_the_verdicts_of_virtual_time() {
    let address = adapter::on_tcp(SERVED, Manner { is_silent: true, ..Manner::default() });
    let found = compare(&format!("slcan:tcp://{address},bitrate=1000000"));
    let times = times(&found);
    assert!(times.contains("since the adapter answers no command"), "{times}");
}

#[test]
fn an_interface_of_socketcand_gets_the_verdicts_of_virtual_time() {
    let address = adapter::socketcand(SERVED, Manner::default());
    let found = compare(&format!("socketcand://{address}/can0"));
    let times = times(&found);
    assert!(times.contains("the time stamps of the server"), "{times}");
}

/// Its bus ends at its process, so the device is there, too.
#[test]
#[ignore = "needs python-can: PYTHON names an interpreter that has it"]
fn a_virtual_bus_of_python_can_gets_the_verdicts_of_virtual_time() {
    let folder = beside_the_bridge();
    let program = || with_virtual_bus(&folder);
    let times = times(&compare_by(program, "python-can:virtual:bench"));
    assert!(times.contains("the time stamps of the driver"), "{times}");
    assert!(times.contains("those of their echoes"), "{times}");
}

/// A folder whose program runs in the process of the bridge.
fn beside_the_bridge() -> TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let beside = folder.path().join("sitecustomize.py");
    fs::copy(python::SCRIPT, beside).expect("it is copied");
    folder
}

/// The harness, whose bridge has a device on its bus `virtual:bench`.
fn with_virtual_bus(beside: &TempDir) -> Command {
    let mut command = harness();
    command.env("PYTHONPATH", beside.path()).env("BUS", "virtual:bench");
    command.env("DEVICE", python::device(SERVED));
    command
}

#[test]
#[ignore = "needs python-can: PYTHON names an interpreter that has it"]
fn a_fault_behind_python_can_leaves_a_complete_report() {
    let folder = beside_the_bridge();
    for (fault, part) in [
        ("gone", "the adapter python-can:virtual:bench is gone: OSError: no such device"),
        ("killed", "the adapter python-can:virtual:bench is gone: the bridge to it ended"),
        ("full", "CanOperationError: full"),
    ] {
        let mut program = with_virtual_bus(&folder);
        program.env("FAULT", fault).env("AFTER", AFTER.to_string());
        complete_by(program, "python-can:virtual:bench", 6, part);
    }
}

#[test]
#[ignore = "needs python-can: PYTHON names an interpreter that has it"]
fn a_shared_bus_of_python_can_gets_the_verdicts_of_virtual_time() {
    let (_device, target) = python::on_multicast(2, SERVED);
    let times = times(&compare(&target));
    assert!(times.contains("those of their echoes"), "{times}");
}

/// A device that is made of a stack of others, its data sheet, and what explains what is red of it.
const OF_OTHERS: [&str; 3] = [
    concat!(env!("CARGO_MANIFEST_DIR"), "/tests/foreign/python-canopen/device.py"),
    concat!(env!("CARGO_MANIFEST_DIR"), "/tests/foreign/python-canopen/sheet.eds"),
    concat!(env!("CARGO_MANIFEST_DIR"), "/tests/foreign/python-canopen/waivers.yaml"),
];

#[test]
#[ignore = "needs python-can: PYTHON names an interpreter that has it"]
fn a_stack_of_others_behind_python_can_is_as_its_waivers_say() {
    let (_device, target) = python::of_others_on_multicast(3, OF_OTHERS[0]);
    let mut scan = harness();
    let there = scan.args(["scan", "--wait", "--target", &target]).output();
    assert!(said(&there.expect("the program starts")).contains("\n3 "));
    others_are_as_their_waivers_say(&target);
}

#[cfg(unix)]
#[test]
#[ignore = "needs python-can: PYTHON names an interpreter that has it"]
fn a_stack_of_python_can_behind_other_adapters_is_as_its_waivers_say() {
    let line = adapter::on_line(OF_OTHERS[0], Manner::default());
    others_are_as_their_waivers_say(&format!("slcan:{},bitrate=1000000", line.path));
    let address = adapter::socketcand(OF_OTHERS[0], Manner::default());
    others_are_as_their_waivers_say(&format!("socketcand://{address}/can0"));
}

/// Its waivers explain what is red on vcan0: nothing else is red here.
fn others_are_as_their_waivers_say(target: &str) {
    let [_, sheet, waivers] = OF_OTHERS;
    let cases = ["cia301/nmt", "cia301/sdo-expedited", "cia301/sdo-segmented", "--node", "3"];
    let mut program = harness();
    program.args(["--eds", sheet, "--waivers", waivers]);
    let (found, output) = run_by(program, target, &cases);
    // What a busy machine spoils is decided by nobody.
    assert!(matches!(output.status.code(), Some(0 | 6)), "{}", said(&output));
    let count = |which| found.cases().filter(|(_, case)| case.verdict() == which).count();
    assert!(count(Verdict::Pass) > 30 && count(Verdict::Waived) > 10, "{}", said(&output));
}

/// Exit code 6, and the words of python-can.
#[test]
#[ignore = "needs python-can: PYTHON names an interpreter that has it"]
fn what_python_can_does_not_open_is_said() {
    for (target, part) in [
        ("python-can:no_such:1", "python-can does not open python-can:no_such:1: "),
        ("python-can:socketcan:no-such0", "python-can does not open "),
    ] {
        let output = harness().args(["scan", "--target", target]).output().unwrap();
        assert_eq!(output.status.code(), Some(6), "{}", said(&output));
        assert!(said(&output).contains(part), "{}", said(&output));
    }
}

#[test]
fn without_python_the_way_to_it_is_said() {
    let mut scan = harness();
    scan.env("PYTHON", "no-such-python").args(["scan", "--target", "python-can:virtual:1"]);
    let output = scan.output().unwrap();
    assert_eq!(output.status.code(), Some(6), "{}", said(&output));
    assert!(said(&output).contains("`no-such-python` cannot be started"), "{}", said(&output));
}

fn generic() -> Node {
    let device = devices::device("generic").expect("it is a reference device");
    device.node(5, Rules::default())
}

/// Verdicts by case.
type Verdicts = BTreeMap<String, Verdict>;

/// Runs cases of these topics in this process, on an adapter with gs_usb.
fn on_gs_usb(adapter: gs_usb::Adapter, topics: &[&str]) -> (Verdicts, Ending) {
    let stop = Stop::default();
    let target: GsUsb = ",bitrate=1000000".parse().expect("it names one");
    let bus = target.open_on(gs_usb::plugged_in(adapter, generic), &stop);
    in_process(&mut *bus.expect("it is there"), topics)
}

fn in_virtual_time(topics: &[&str]) -> Verdicts {
    let mut bus = VirtualBus::new(DEFAULT_BIT_RATE);
    bus.attach(generic());
    in_process(&mut bus, topics).0
}

/// Runs cases of these topics in this process.
fn in_process(bus: &mut dyn Bus, topics: &[&str]) -> (Verdicts, Ending) {
    let device = devices::device("generic").expect("it is a reference device");
    let eds = eds::read(device.eds_text().as_bytes()).eds;
    let library = Library::built_in().expect("the suites load");
    let mut dut = Dut { bit_rate: Some(DEFAULT_BIT_RATE), ..Dut::new("generic", 5, eds) };
    dut.shares_its_machine = bus.is_real();
    let mut plan = plan(&library, &dut, &BTreeMap::new()).expect("the suites fit the device");
    plan.instances.retain(|instance| topics.contains(&instance.suite.name()));
    let (mut name, mut verdicts) = (String::new(), Verdicts::new());
    let ending = run_session(&library, &plan, bus, &mut |event| match event {
        Event::CaseStarted(case) => name = case.name(),
        // A case that is tried again ends again.
        Event::CaseEnded(case) => _ = verdicts.insert(name.clone(), case.outcome.verdict()),
        _ => {}
    });
    (verdicts, ending)
}

#[test]
fn an_adapter_with_gs_usb_gets_the_verdicts_of_virtual_time() {
    let topics = ["cia301/nmt", "cia301/sdo-expedited", "cia301/heartbeat"];
    for (is_simple, topics) in [(false, &topics[..]), (true, &topics[1..2])] {
        let expected = in_virtual_time(topics);
        let adapter = gs_usb::Adapter { is_simple, ..gs_usb::Adapter::default() };
        let (found, _) = on_gs_usb(adapter, topics);
        assert!(found.keys().eq(expected.keys()), "{found:?}");
        // Time on the bus is real: what takes minutes is skipped, and what a busy machine spoils
        // is decided by nobody.
        let is_open = [Verdict::Skip, Verdict::Error, Verdict::Flaky];
        let differ = |(name, verdict): &(&String, &Verdict)| {
            !is_open.contains(verdict) && expected.get(*name) != Some(*verdict)
        };
        assert_eq!(found.iter().filter(differ).collect::<Vec<_>>(), []);
        let passed = found.values().filter(|verdict| **verdict == Verdict::Pass).count();
        assert!(passed * 10 > expected.len() * 9, "{found:?}");
    }
}

/// Each fault in the middle of a run: every case is in the report, and the run goes on where it
/// can.
#[test]
fn a_fault_of_an_adapter_with_gs_usb_leaves_a_complete_report() {
    let topics = ["cia301/sdo-expedited"];
    let expected = in_virtual_time(&topics);
    for fault in [gs_usb::Fault::Gone, gs_usb::Fault::Garbage, gs_usb::Fault::BusOff] {
        let adapter = gs_usb::Adapter { after: 60, fault: Some(fault), ..Default::default() };
        let (found, ending) = on_gs_usb(adapter, &topics);
        assert!(found.keys().eq(expected.keys()), "{ending:?}: {found:?}");
        let count = |which| found.values().filter(|verdict| **verdict == which).count();
        assert_eq!(count(Verdict::Fail), 0, "{found:?}");
        let (passed, undecided) = (count(Verdict::Pass), count(Verdict::Error));
        let is_gone = fault == gs_usb::Fault::Gone;
        assert_eq!(passed > undecided, !is_gone, "{found:?}");
        assert!(passed > 0, "{found:?}");
    }
}

/// A device behind an adapter that needs 20 ms for each frame is not slow itself.
#[cfg(unix)]
#[test]
fn a_slow_adapter_is_not_a_slow_device() {
    let slow = Manner { is_slow: Some(Duration::from_millis(20)), ..Manner::default() };
    let line = adapter::on_line(SERVED, slow);
    let target = format!("slcan:{},bitrate=1000000", line.path);
    let cases = ["cia301/sdo-expedited"];
    let ((found, _), (expected, _)) = (run(&target, &cases), run("sim:generic", &cases));
    agree::agree(&expected, &found, |names| {
        run(&target, &names.iter().map(String::as_str).collect::<Vec<_>>()).0
    });
}

#[cfg(unix)]
#[test]
fn a_scan_through_an_adapter_finds_the_device() {
    let line = adapter::on_line(SERVED, Manner::default());
    let target = format!("slcan:{}", line.path);
    let mut scan = harness();
    let output = scan.args(["scan", "--bitrate", "500000", "--target", &target]).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    assert!(said(&output).contains("generic"), "{}", said(&output));
}

/// Each fault in the middle of a run: its target, the exit code, and what is said.
#[cfg(unix)]
#[test]
fn a_fault_in_the_middle_leaves_a_complete_report() {
    for (fault, exit, part) in [
        (Fault::Gone, 6, "is gone: was it unplugged?"),
        // The case is tried again.
        (Fault::Garbage, 0, "which is no frame: its identifier is no number"),
        (Fault::Refusing(0x24), 6, "error passive"),
        (Fault::Refusing(0x02), 6, "its transmit queue is full"),
    ] {
        let manner = Manner { after: AFTER, fault: Some(fault), ..Manner::default() };
        let line = adapter::on_line(SERVED, manner);
        let target = format!("slcan:{},bitrate=1000000", line.path);
        complete(&target, exit, part);
    }
}

#[test]
fn a_connection_that_is_cut_leaves_a_complete_report() {
    let manner = Manner { after: AFTER, fault: Some(Fault::Gone), ..Manner::default() };
    let target = format!("slcan:tcp://{},bitrate=1000000", adapter::on_tcp(SERVED, manner.clone()));
    complete(&target, 6, "closed the connection");
    let target = format!("socketcand://{}/can0", adapter::socketcand(SERVED, manner));
    complete(&target, 6, "closed the connection");
    let manner = Manner { after: AFTER, fault: Some(Fault::Garbage), ..Manner::default() };
    let target = format!("socketcand://{}/can0", adapter::socketcand(SERVED, manner));
    complete(&target, 0, "which is no frame: its identifier is no number");
}

fn complete(target: &str, exit: i32, part: &str) {
    complete_by(harness(), target, exit, part);
}

/// A run in which something goes wrong: every case is in the report, and the journal says why.
fn complete_by(program: Command, target: &str, exit: i32, part: &str) {
    let cases = ["cia301/sdo-expedited", "--node", "5"];
    let (folder, output) = recorded(program, target, &cases);
    let text = said(&output);
    let journal = folder.path().join(JOURNAL);
    let (found, (expected, _)) = (record::read(&journal), run("sim:generic", &cases[..1]));
    // What a busy machine leaves undecided is no fault of the adapter.
    let undecided = found.cases().any(|(_, case)| matches!(case.outcome, Outcome::Undecided(_)));
    let exit = if undecided { exit.max(6) } else { exit };
    assert_eq!(output.status.code(), Some(exit), "{target}, {part}: {text}");
    let journal = fs::read_to_string(journal).expect("it was read before");
    assert_eq!(found.counts().total(), expected.counts().total(), "{target}: {text}");
    assert!(found.cases().any(|(_, case)| case.verdict() == Verdict::Pass), "{target}: {text}");
    assert!(journal.contains(part), "{target}, {part}: {text}");
}

/// What cannot be opened: exit code 6, and what to do.
#[test]
fn what_is_refused_is_said() {
    let scan = |target: &str| {
        let output = harness().args(["scan", "--target", target]).output().unwrap();
        (output.status.code(), said(&output))
    };
    let of = |refuses| Manner { refuses: Some(refuses), ..Manner::default() };
    let tcp = |manner| format!("slcan:tcp://{}", adapter::on_tcp(SERVED, manner));
    let server = |manner| format!("socketcand://{}", adapter::socketcand(SERVED, manner));
    for (target, exit, part) in [
        ("slcan:/dev/no-such-adapter".to_owned(), 6, "is the adapter plugged in?"),
        (tcp(Manner::default()), 6, "say the bit rate of the bus: --bitrate 500000"),
        (tcp(of("S")) + ",bitrate=500000", 6, "refuses the bit rate of 500000 bit/s"),
        (tcp(of("O")) + ",bitrate=500000", 6, "switch its power off and on"),
        (tcp(Manner::default()) + ",bitrate=83333", 6, "no bit rate of 83333 bit/s: 10000, "),
        (server(Manner::default()) + "/can1", 6, "could not open bus"),
        (tcp(Manner::default()) + ",speed=1", 2, "`,serial=115200` the speed"),
        (server(Manner::default()), 2, "is `socketcand://host:29536/can0`"),
    ] {
        let (code, text) = scan(&target);
        assert_eq!(code, Some(exit), "{target}: {text}");
        assert!(text.contains(part), "{target}: {text}");
    }
}

/// Only one program uses a serial line at a time.
#[cfg(unix)]
#[test]
fn a_line_that_is_in_use_is_refused() {
    let line = adapter::on_line(SERVED, Manner::default());
    let target = format!("slcan:{}", line.path);
    let held = fs::File::open(&line.path).expect("it is there");
    held.lock().expect("nobody else has it");
    let output = harness().args(["scan", "--target", &target]).output().unwrap();
    assert_eq!(output.status.code(), Some(6), "{}", said(&output));
    assert!(said(&output).contains("is in use by another program"), "{}", said(&output));
}

/// The kernel's slcan on the far end of a line, and a served device on its interface.
#[cfg(unix)]
#[test]
#[ignore = "needs root and slcan: scripts/with-vcan"]
fn the_slcan_of_the_kernel_gets_the_verdicts_of_virtual_time() {
    let (line, address) = adapter::line_to_tcp();
    let start = |program: &str, arguments: &str| {
        let mut command = Command::new(program);
        command.args(arguments.split(' ')).stdout(Stdio::null());
        Process(command.spawn().expect("it starts"))
    };
    let _daemon = start("slcand", &format!("-o -s8 -F {} slcan7", line.path));
    until("ip link set slcan7 up");
    let _device = start(env!("CARGO_BIN_EXE_harness"), &format!("serve {SERVED} --target slcan7"));
    let target = format!("slcan:tcp://{address},bitrate=1000000");
    until(&format!("{} scan --target {target}", env!("CARGO_BIN_EXE_harness")));
    let times = times(&compare(&target));
    assert!(times.contains("since the adapter answers no command"), "{times}");
}

/// python-can's client of socketcand as another user of the server of these tests.
#[test]
#[ignore = "needs python-can: PYTHON names an interpreter that has it"]
fn the_server_of_these_tests_is_one_for_python_can() {
    let address = adapter::socketcand(SERVED, Manner::default());
    let (host, port) = address.split_once(':').expect("it has a port");
    let script = format!(
        "import can\n\
         bus = can.Bus(interface='socketcand', host='{host}', port={port}, channel='can0')\n\
         seen = iter(lambda: bus.recv(5), None)\n\
         bus.send(can.Message(arbitration_id=0x605, is_extended_id=False, \
                              data=[0x40, 0, 0x10, 0, 0, 0, 0, 0]))\n\
         answer = next(it for it in seen if it.arbitration_id == 0x585)\n\
         assert answer.data[:4] == bytes([0x43, 0, 0x10, 0]), answer\n\
         bus.shutdown()\n"
    );
    let python = std::env::var("PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let output = Command::new(python).args(["-c", &script]).output().expect("there is Python");
    assert!(output.status.success(), "{}", said(&output));
}

/// Tries a command until it succeeds.
fn until(command: &str) {
    const TRIES: usize = 100;
    let words: Vec<&str> = command.split(' ').collect();
    let (_silent, never) = mpsc::channel::<()>();
    for _ in 0..TRIES {
        let output = Command::new(words[0]).args(&words[1..]).output().expect("it starts");
        if output.status.success() {
            return;
        }
        _ = never.recv_timeout(Duration::from_millis(100));
    }
    panic!("{command} does not succeed");
}

/// A program that ends with the test.
struct Process(Child);

impl Drop for Process {
    fn drop(&mut self) {
        // It may have ended by itself.
        _ = self.0.kill();
        _ = self.0.wait();
    }
}

/// Two of a kind on one bus, of which one loses a node that a suite for the other plays. An
/// emergency comes however late the machine is; a heartbeat of it would be missed.
#[cfg(unix)]
#[test]
fn nodes_behind_one_adapter_are_tested_in_turn_and_the_other_one_is_watched() {
    const SUITE: &str = "\
suite: watched
cases:
  - id: begins
    title: The other node monitors a third one.
    checks: [CIA301-HB-01]
    steps: [{ send: '606#23 16 10 01 32 00 20 00' }, { wait: 100 ms }]
  - id: loses
    title: The other node reports that the third one is gone.
    checks: [CIA301-HB-01]
    steps: [{ send: '720#05' }, { wait: 1 s }]
";
    let line = adapter::on_line("generic --node 5 & generic --node 6", Manner::default());
    let folder = tempfile::tempdir().expect("a folder");
    fs::create_dir(folder.path().join("suites")).expect("it is new");
    fs::write(folder.path().join("suites/watched.yaml"), SUITE).expect("there is room");
    let file = format!(
        "target: 'slcan:{},bitrate=1000000'\ndevice: generic\nselect: [cia301/nmt/*]\nnodes:\n  \
         - {{ node: 5, suites: [suites], select: [watched] }}\n  - {{ node: 6 }}\n",
        line.path
    );
    let (found, output) = run_file(&folder, &file);
    let devices = found.devices.iter().map(|it| (&*it.info.device, it.info.node));
    assert!(devices.eq([("generic", 5), ("generic (2)", 6)]), "{}", said(&output));
    let said = said(&output);
    let lost = said.lines().find(|line| line.contains("emergency message 8130h"));
    let lost = lost.unwrap_or_else(|| panic!("{said}"));
    assert!(lost.starts_with("note: generic, node 6: "), "{lost}");
    assert!(lost.ends_with(" while watched/loses ran on generic"), "{lost}");
    assert_eq!(said.matches("node 6: ").count(), 1, "{said}");
    let of_all = |case: &CaseRun| {
        matches!(&case.outcome, Outcome::Skip(why) if why
        .starts_with("NMT command to all nodes: protected by the absence of `allow"))
    };
    assert!(found.cases().any(|(_, case)| of_all(case)), "{said}");
    let passed = found.cases().filter(|(_, case)| case.verdict() == Verdict::Pass).count();
    assert!(passed > 10, "{said}");
}

#[cfg(unix)]
#[test]
fn nodes_behind_two_adapters_are_in_one_report() {
    let lines = [SERVED, SERVED].map(|served| adapter::on_line(served, Manner::default()));
    let folder = tempfile::tempdir().expect("a folder");
    let mut file = "select: [cia301/nmt/*]\nnodes:\n".to_owned();
    for line in &lines {
        file.push_str(&format!(
            "  - {{ target: 'slcan:{},bitrate=1000000', node: 5 }}\n",
            line.path
        ));
    }
    let (found, output) = run_file(&folder, &file);
    let [one, other] = &found.devices[..] else { panic!("{}", said(&output)) };
    let cases = |device: &DeviceRun| {
        let cases = device.suites.iter().flat_map(|suite| &suite.cases);
        cases.map(|case| case.info.name()).collect::<Vec<_>>()
    };
    assert_eq!(cases(one), cases(other));
    // What a busy machine spoils of the verdicts is not the matter here.
    for device in [one, other] {
        let cases = device.suites.iter().flat_map(|suite| &suite.cases);
        let passed = cases.filter(|case| case.verdict() == Verdict::Pass).count();
        assert!(passed > 10, "{}", said(&output));
    }
}

/// Runs the devices of a file.
fn run_file(folder: &TempDir, file: &str) -> (Run, Output) {
    let [dut, journal] = ["bus.yaml", JOURNAL].map(|name| folder.path().join(name));
    fs::write(&dut, file).expect("there is room");
    let mut run = harness();
    run.args(["-q", "--no-progress", "--dut"]).arg(&dut).arg("--journal").arg(&journal);
    let output = run.output().expect("the program starts");
    assert!(journal.exists(), "{}", said(&output));
    (record::read(&journal), output)
}
