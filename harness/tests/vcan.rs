//! The harness on a real bus: the device in one process, the harness in another, the kernel's CAN
//! between them. `scripts/with-vcan cargo test -p harness --test vcan -- --ignored` runs these.

// Other systems have no SocketCAN.
#![cfg(target_os = "linux")]

#[path = "common/agree.rs"]
mod agree;
mod common;
#[path = "common/record.rs"]
mod record;

use std::collections::BTreeSet;
use std::env;
use std::ffi::OsStr;
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use canopen::{Bus, BusError, Frame};
use harness::bus::socketcan::SocketCan;
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use reports::{CaseRun, Outcome, Run, Verdict};
use runner::stop::Stop;
use tempfile::TempDir;

use common::harness;

/// Every kind of terminal of the controller, in a minute and a half; all but `slow` take five.
const OF_THERMOSTAT: [&str; 26] = [
    "drr460/alarm-modes",
    "drr460/alarm-parameters",
    "drr460/alarms-otherwise",
    "drr460/analogue-input",
    "drr460/automatic-manual",
    "drr460/automatic-manual-broken-sensor",
    "drr460/command-output",
    "drr460/communication-errors",
    "drr460/control",
    "drr460/emergency",
    "drr460/error-and-stop",
    "drr460/expansion",
    "drr460/faults",
    "drr460/key-and-switches",
    "drr460/linear-inputs/retransmission",
    "drr460/linear-inputs/signals",
    "drr460/off-line",
    "drr460/parameters",
    "drr460/pdo",
    "drr460/resets",
    "drr460/retransmission",
    "drr460/sensor-error",
    "drr460/set-points",
    "drr460/store",
    "drr460/tuning",
    "drr460/valve",
];

// A test for each device, and one for each third of the longest run: `.ci/run` runs them side by
// side, each on a vcan0 of its own.

#[test]
#[ignore = "needs vcan0: scripts/with-vcan"]
fn the_real_bus_agrees_with_virtual_time_on_generic_1_of_3() {
    the_real_bus_agrees_with_virtual_time("generic", &["--shard", "1/3", "*"]);
}

#[test]
#[ignore = "needs vcan0: scripts/with-vcan"]
fn the_real_bus_agrees_with_virtual_time_on_generic_2_of_3() {
    the_real_bus_agrees_with_virtual_time("generic", &["--shard", "2/3", "*"]);
}

#[test]
#[ignore = "needs vcan0: scripts/with-vcan"]
fn the_real_bus_agrees_with_virtual_time_on_generic_3_of_3() {
    the_real_bus_agrees_with_virtual_time("generic", &["--shard", "3/3", "*"]);
}

#[test]
#[ignore = "needs vcan0: scripts/with-vcan"]
fn the_real_bus_agrees_with_virtual_time_on_drr460() {
    the_real_bus_agrees_with_virtual_time("drr460", &OF_THERMOSTAT);
}

#[test]
#[ignore = "needs vcan0: scripts/with-vcan"]
fn the_real_bus_agrees_with_virtual_time_on_em66() {
    the_real_bus_agrees_with_virtual_time("em66", &["em66/*"]);
}

/// What the bench of a module turns, warms and sees; all of its suites would take five minutes.
#[test]
#[ignore = "needs vcan0: scripts/with-vcan"]
fn the_real_bus_agrees_with_virtual_time_on_mcm260x() {
    let cases = ["cia401/*", "mcm260x/encoder*", "mcm260x/emergency"];
    the_real_bus_agrees_with_virtual_time("mcm260x-9ad", &cases);
}

/// Loads and their currents, loops and chains of blocks, in a quarter of a minute.
#[test]
#[ignore = "needs vcan0: scripts/with-vcan"]
fn the_real_bus_agrees_with_virtual_time_on_ax021211() {
    let cases = ["ax021211/outputs-types", "ax021211/pid", "ax021211/sources-chains"];
    the_real_bus_agrees_with_virtual_time("ax021211", &cases);
}

/// What sets node ids, resets and stores, as far as the file lets it.
#[test]
#[ignore = "needs vcan0: scripts/with-vcan"]
fn the_real_bus_agrees_with_virtual_time_by_the_file_of_init() {
    let (folder, device) = (tempfile::tempdir().unwrap(), "generic");
    let file = folder.path().join("device-under-test.yaml");
    {
        let _wire = wire();
        let _served = Served::device(device, &[]);
        let mut init = harness();
        let output = init.args(["init", "--target", "vcan0", "--out"]).arg(&file).output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    }
    let cases = ["cia305/*", "cia301/nmt*", "cia301/store*", "cia301/emcy", "cia301/guarding"];
    compare(device, &cases, &["--dut", file.to_str().unwrap()]);
}

fn the_real_bus_agrees_with_virtual_time(device: &str, cases: &[&str]) {
    compare(device, cases, &[]);
}

fn compare(device: &str, cases: &[&str], options: &[&str]) {
    let _wire = wire();
    let files = Files::new();
    let cases = [options, cases].concat();
    let run = |target: &[&str], exits: &[i32]| {
        let output = harness().args(target).args(&cases).args(files.options()).output().unwrap();
        let (said, told) = (text(&output.stdout), text(&output.stderr));
        assert!(output.status.code().is_some_and(|code| exits.contains(&code)), "{said}");
        // A long run on a bus says how long it takes.
        let is_estimate = |line: &str| line.starts_with("note: ") && line.contains(" take about ");
        assert!(told.lines().all(is_estimate), "{told}");
        assert!(files.junit().contains("<testcase"));
        files.run()
    };
    let mut in_virtual_time = run(&["--target", &format!("sim:{device}")], &[0]);

    let socket = files.path("bench");
    let of_bench = ["--bench-socket".as_ref(), socket.as_os_str()];
    let _served = Served::device(device, &of_bench);
    let bench = format!("unix:{}", socket.display());
    // What failed is looked at below, and so is what the tester was too late for.
    let mut on_the_real_bus = run(&["--target", "vcan0", "--bench", &bench], &[0, 1, 6]);
    leave_out_long_cases([&mut in_virtual_time, &mut on_the_real_bus]);
    let of_bus = [options, &["--target", "vcan0", "--bench", &bench][..]].concat();
    let alone = |names: &[String]| rerun(&files, names, &of_bus);
    agree::agree(&in_virtual_time, &on_the_real_bus, alone);
}

/// Takes out what is skipped on the interface: what would take minutes of it, and what needs
/// another node, as a simulated device has it.
fn leave_out_long_cases(runs: [&mut Run; 2]) {
    const WHY: [&str; 2] = ["time on the bus is real", "the device file names no other node"];
    let is_one = |reason: &str| WHY.iter().any(|why| reason.starts_with(why));
    let is_long = |case: &CaseRun| matches!(&case.outcome, Outcome::Skip(why) if is_one(why));
    let [_, on_the_real_bus] = &runs;
    let long = on_the_real_bus.cases().filter(|(_, case)| is_long(case));
    let long: BTreeSet<String> = long.map(|(_, case)| case.info.name()).collect();
    for run in runs {
        for suite in run.devices.iter_mut().flat_map(|device| &mut device.suites) {
            suite.cases.retain(|case| !long.contains(&case.info.name()));
        }
    }
}

#[test]
#[ignore = "needs vcan0: scripts/with-vcan"]
fn a_scan_finds_the_device_that_is_served() {
    let _wire = wire();
    let mut served = Served::start();
    let output = harness().args(["scan", "--target", "vcan0"]).output().unwrap();
    let found = text(&output.stdout);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert_eq!(found.lines().count(), 2, "a heading and one node: {found}");
    assert!(
        found.lines().any(|line| line.starts_with("1 ") && line.ends_with("drr460")),
        "{found}"
    );

    interrupt(&served.0);
    assert_eq!(served.0.wait().unwrap().code(), Some(0), "Ctrl-C is how serving ends");
}

/// The vendor is unknown, so there is no data sheet, and only 2000h identifies the device.
#[test]
#[ignore = "needs vcan0: scripts/with-vcan"]
fn a_device_of_an_unknown_vendor_is_judged_by_its_profile() {
    let _wire = wire();
    let _served = Served::device("em66", &["--mutant".as_ref(), "vendor-id-0".as_ref()]);
    let output = harness().args(["scan", "--target", "vcan0"]).output().unwrap();
    let found = text(&output.stdout);
    assert!(found.contains("  EUROMAP 66 heating/cooling device 1.1  none in this"), "{found}");

    let files = Files::new();
    let cases = ["em66/identification", "em66/units", "cia301/sdo-expedited"];
    let output =
        harness().args(["--target", "vcan0"]).args(cases).args(files.options()).output().unwrap();
    let (said, noted) = (text(&output.stdout), text(&output.stderr));
    assert_eq!(output.status.code(), Some(0), "{said}{noted}");
    assert!(
        noted.starts_with("note: this program has no data sheet of node 66, EUROMAP 66"),
        "{noted}"
    );
    assert!(said.contains("generated.eds was generated from the answers of the device"), "{said}");
    let run = files.run();
    let passed = |suite: &str| {
        let passed = |case: &CaseRun| case.verdict() == Verdict::Pass;
        run.cases().filter(|(_, case)| case.info.suite.starts_with(suite) && passed(case)).count()
    };
    assert!(passed("em66/") > 20 && passed("cia301/sdo-expedited") > 20, "{said}");
}

/// Both adapters are the same interface here. A machine that is busy is late, and says so.
#[test]
#[ignore = "needs vcan0: scripts/with-vcan"]
fn a_self_test_goes_from_one_adapter_to_another() {
    let _wire = wire();
    let arguments = ["self-test", "--mutants", "1", "--target", "vcan0", "--peer", "vcan0"];
    let output = harness().args(arguments).output().unwrap();
    let (said, noted) = (text(&output.stdout), text(&output.stderr));
    assert!([Some(0), Some(6)].contains(&output.status.code()), "{said}{noted}");
    assert!(said.contains("real time  generic over vcan0 and vcan0: "), "{said}{noted}");
    assert!(said.contains("timers     400 waits, late by "), "{said}{noted}");
    assert!(!noted.contains("wrong: "), "{noted}");
}

#[test]
#[ignore = "needs vcan0: scripts/with-vcan"]
fn a_bus_with_nobody_is_refused_with_what_helps() {
    let _wire = wire();
    for arguments in [&["--target", "vcan0"][..], &["scan", "--target", "vcan0"]] {
        let output = harness().args(arguments).output().unwrap();
        assert_eq!(output.status.code(), Some(6));
        let said = text(&output.stderr);
        assert!(said.starts_with("error: no node answers on vcan0."), "{said}");
        assert!(said.contains("\n  candump "), "{said}");
        assert!(said.contains("\n  harness serve drr460 --target vcan0\n"), "{said}");
        assert_eq!(text(&output.stdout), "", "nothing ran");
    }
}

#[test]
#[ignore = "needs vcan0: scripts/with-vcan"]
fn ctrl_c_restores_what_was_touched_and_reports_what_ran() {
    let _wire = wire();
    let files = Files::new();
    let _served = Served::start();
    let mut seen = SocketCan::open("vcan0", Stop::default()).expect("vcan0 is up");
    let run = files.start(&["interrupted/short", "interrupted/long"]);
    wait_for_the_write(&mut seen);
    interrupt(&run);
    let output = run.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130), "{}", text(&output.stderr));

    let run = files.run();
    assert_eq!(verdicts(&run), [("short", Verdict::Pass), ("long", Verdict::Error)]);
    assert_eq!(run.ended.map(|ended| ended.exit), Some(130));
    assert_eq!(files.junit().matches("<testcase").count(), 2);

    let output = files.start(&["interrupted/restored"]).wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stdout));
}

#[test]
#[ignore = "needs vcan0: scripts/with-vcan"]
fn what_a_run_that_was_killed_left_changed_is_set_back() {
    let _wire = wire();
    let files = Files::new();
    let _served = Served::start();
    let mut seen = SocketCan::open("vcan0", Stop::default()).expect("vcan0 is up");
    let mut run = files.start(&["interrupted/long"]);
    wait_for_the_write(&mut seen);
    run.kill().unwrap();
    run.wait().unwrap();

    let restore = |arguments: &[&str]| {
        let mut command = files.harness();
        let output = command.arg("restore").args(arguments).output().unwrap();
        (text(&output.stdout).to_owned(), output.status.code())
    };
    let (listed, _) = restore(&[]);
    assert!(listed.ends_with("drr460, node 1 on vcan0: 1017:00\n"), "{listed}");
    let name = listed.split_whitespace().next().unwrap();
    let (said, exit) = restore(&[name]);
    assert_eq!(
        (&*said, exit),
        ("1017:00 = 00 00\n1 object of node 1 on vcan0 set back\n", Some(0))
    );
    assert_eq!(restore(&[]).0, "no run has left anything changed\n");

    let output = files.start(&["interrupted/restored"]).wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stdout));
}

/// The device file of the run protects the device from what sets it back, too.
#[test]
#[ignore = "needs vcan0: scripts/with-vcan"]
fn what_is_protected_is_not_set_back_either() {
    let _wire = wire();
    let files = Files::new();
    let _served = Served::start();
    let mut seen = SocketCan::open("vcan0", Stop::default()).expect("vcan0 is up");
    let device_file = files.path("device-under-test.yaml");
    let protect = |object: &str| {
        let text =
            format!("target: vcan0\nnode: 1\nprotect:\n  objects: [\"{object}\"]\n  loads: 4\n");
        std::fs::write(&device_file, text).unwrap();
    };
    protect("4000");
    let mut command = files.harness();
    command.arg("--dut").arg(&device_file).args(["--only-suites", SUITES, "interrupted/long"]);
    let mut run = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    wait_for_the_write(&mut seen);
    run.kill().unwrap();
    run.wait().unwrap();

    let restore = |arguments: &[&str]| {
        let output = files.harness().arg("restore").args(arguments).output().unwrap();
        let said = format!("{}{}", text(&output.stdout), text(&output.stderr));
        (said, output.status.code())
    };
    let (listed, _) = restore(&[]);
    let name = listed.split_whitespace().next().unwrap();
    protect("1017");
    let refused = "error: node 1 on vcan0 refuses 1017:00, or does not answer\n".to_owned();
    assert_eq!(restore(&[name]), (refused, Some(7)));
    assert_eq!(restore(&[]).0, listed, "it is still named");
    protect("4000");
    let back = "1017:00 = 00 00\n1 object of node 1 on vcan0 set back\n".to_owned();
    assert_eq!(restore(&[name]), (back, Some(0)));
}

/// A campaign on a device that outlives it.
#[test]
#[ignore = "needs vcan0: scripts/with-vcan"]
fn a_campaign_finds_nothing_on_a_device_in_order() {
    let _wire = wire();
    let files = Files::new();
    let _served = Served::device("generic", &[]);
    let campaign = |number: &str| {
        let output = files.campaign(&["--sessions", number]).wait_with_output().unwrap();
        let said = format!("{}{}", text(&output.stdout), text(&output.stderr));
        (output.status.code(), said)
    };
    let (exit, said) = campaign("20");
    assert_eq!(exit, Some(0), "{said}");
    assert!(said.contains("what a campaign may do to generic, node 2"), "{said}");
    assert!(!said.contains("warning"), "{said}");
    assert_eq!(files.restore(&[]).0, "no run has left anything changed\n");
}

/// The frames are on the bus for everybody else. The tester neither gets nor counts them.
#[test]
#[ignore = "needs vcan0: scripts/with-vcan"]
fn a_load_beside_a_campaign_is_on_the_bus_and_in_no_trace() {
    let _wire = wire();
    let files = Files::new();
    let _served = Served::device("generic", &[]);
    let mut seen = SocketCan::open("vcan0", Stop::default()).expect("vcan0 is up");
    let is_load = |frame: &Frame| frame.to_string().starts_with("7F3#");

    let campaign = files.campaign(&["--sessions", "2", "--load", "20"]);
    let give_up = seen.now() + Duration::from_secs(30);
    while !is_load(&seen.recv(give_up).expect("vcan0 works").expect("the bus is loaded").frame) {}
    // Nobody reads it from here on, and it would overflow.
    drop(seen);
    let output = campaign.wait_with_output().unwrap();
    let (said, noted) = (text(&output.stdout), text(&output.stderr));
    assert_eq!(output.status.code(), Some(0), "{said}{noted}");
    let came = noted.lines().find(|line| line.ends_with(" % of the wire's time; 20 % was wanted"));
    assert!(came.is_some_and(|came| came.contains(" frames with 7F3h took ")), "{noted}");

    let run = files.run();
    let remark = run.devices[0].info.remark.as_deref();
    assert_eq!(remark, Some("frames with 7F3h load the bus by 20 % of 1000000 bit/s (--load)"));
    let journal = std::fs::read_to_string(files.path("journal.jsonl")).unwrap();
    assert!(!journal.contains("7F3#"), "the frames are in the journal");

    // It ends with the campaign.
    let mut seen = SocketCan::open("vcan0", Stop::default()).expect("vcan0 is up");
    let quiet = seen.now() + Duration::from_millis(100);
    while let Some(late) = seen.recv(quiet).expect("vcan0 works") {
        assert!(!is_load(&late.frame), "{late:?}");
    }
}

/// However a campaign ends, its reports say how far it came, and the device is as before, or is so
/// after `harness restore`.
#[test]
#[ignore = "needs vcan0: scripts/with-vcan"]
fn a_campaign_that_is_ended_leaves_the_device_as_before() {
    let _wire = wire();
    let files = Files::new();
    let _served = Served::device("generic", &[]);
    for (ends, boots) in [(Signal::SIGINT, 6), (Signal::SIGTERM, 9), (Signal::SIGKILL, 12)] {
        // Nobody reads between two campaigns, so that each is watched from its beginning on.
        let mut seen = SocketCan::open("vcan0", Stop::default()).expect("vcan0 is up");
        let campaign = files.campaign(&["--time", "1h"]);
        let give_up = seen.now() + Duration::from_secs(120);
        let is_boot_up = |frame: &Frame| frame.to_string() == "702#00";
        let mut left = boots;
        while left > 0 {
            match seen.recv(give_up) {
                Ok(stamped) => {
                    let frame = stamped.expect("sessions go on").frame;
                    left -= u32::from(is_boot_up(&frame));
                }
                // A busy machine reads too late, and the next boot-up message counts as well.
                Err(BusError::Lost(_)) => {}
                Err(error) => panic!("{error}"),
            }
        }
        signal(&campaign, ends);
        let output = campaign.wait_with_output().unwrap();
        let (listed, _) = files.restore(&[]);
        if ends != Signal::SIGKILL {
            assert_eq!(output.status.code(), Some(130), "{}", text(&output.stderr));
            assert_eq!(files.run().ended.map(|ended| ended.exit), Some(130));
            assert!(files.junit().contains("interrupted"));
            assert_eq!(listed, "no run has left anything changed\n", "{ends}");
            continue;
        }
        assert!(listed.contains("generic, node 2 on vcan0: "), "{listed}");
        let name = listed.split_whitespace().next().unwrap();
        let (said, exit) = files.restore(&[name]);
        assert_eq!(exit, Some(0), "{said}");
        assert_eq!(files.restore(&[]).0, "no run has left anything changed\n");
    }
    // What is set back is what the data sheet says.
    let mut run = files.harness();
    run.args(["--target", "vcan0", "cia301/objects-*"]);
    let output = run.output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stdout));
}

/// The device is a program that the harness starts, and has the interface of the harness.
#[test]
#[ignore = "needs vcan0: scripts/with-vcan"]
fn a_program_on_the_interface_gets_the_verdicts_of_virtual_time() {
    let _wire = wire();
    let files = Files::new();
    let cases = ["cia301/sdo-expedited", "cia301/objects-*", "cia301/heartbeat"];
    let run = |target: &str| {
        let mut command = files.harness();
        command.args(["--target", target, "--no-progress"]).args(cases).args(files.options());
        let output = command.output().unwrap();
        assert!(matches!(output.status.code(), Some(0 | 1 | 6)), "{}", text(&output.stderr));
        files.run()
    };
    let program = format!("{} serve generic --target vcan0", env!("CARGO_BIN_EXE_harness"));
    let (simulated, served) = (run("sim:generic"), run(&format!("exec@vcan0:{program}")));
    let target = format!("exec@vcan0:{program}");
    agree::agree(&simulated, &served, |names| rerun(&files, names, &["--target", &target]));
}

#[test]
#[ignore = "needs vcan0: scripts/with-vcan"]
fn a_device_that_dies_in_the_middle_still_gives_a_report() {
    let _wire = wire();
    let files = Files::new();
    let mut served = Served::start();
    let mut seen = SocketCan::open("vcan0", Stop::default()).expect("vcan0 is up");
    let run = files.start(&["gone"]);
    wait_for_the_write(&mut seen);
    served.0.kill().unwrap();
    let output = run.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(7), "{}", text(&output.stderr));

    let run = files.run();
    // A case for which the tester was late is repeated, and by then the device has gone.
    let late = run
        .cases()
        .any(|(_, case)| case.record().notes.iter().any(|note| note.text.contains("late")));
    let expected = [
        ("before", Verdict::Pass),
        ("during", if late { Verdict::Error } else { Verdict::Fail }),
        ("after", Verdict::Error),
        ("long-after", Verdict::Error),
    ];
    assert_eq!(verdicts(&run), expected);
    assert_eq!(run.ended.map(|ended| ended.exit), Some(7));
    assert_eq!(files.junit().matches("<testcase").count(), 4);
}

#[test]
#[ignore = "needs vcan0: scripts/with-vcan"]
fn a_bench_behind_a_socket_switches_the_supply() {
    let _wire = wire();
    let files = Files::new();
    let socket = files.path("bench");
    let mut served = Served::device("drr460", &["--bench-socket".as_ref(), socket.as_os_str()]);
    let suites = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/vcan/bench");
    let bench = format!("unix:{}", socket.display());
    let arguments = ["--target", "vcan0", "--only-suites", suites, "--bench", &bench, "demo/off"];
    let output = harness().args(arguments).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stdout));

    interrupt(&served.0);
    assert_eq!(served.0.wait().unwrap().code(), Some(0));
    assert!(!socket.exists(), "a socket goes with its device");
}

#[test]
#[ignore = "needs vcan0: scripts/with-vcan"]
fn a_served_device_that_misses_frames_goes_on() {
    let _wire = wire();
    let mut served = Served::start();
    signal(&served.0, Signal::SIGSTOP);
    let mut bus = SocketCan::open("vcan0", Stop::default()).expect("vcan0 is up");
    for _ in 0..MORE_THAN_A_QUEUE {
        bus.send(&Frame::new(0x77F, [0; 8])).expect("vcan0 takes it");
    }
    signal(&served.0, Signal::SIGCONT);
    let told = served.line();
    assert!(told.contains("frames of vcan0 were lost"), "{told}");

    let mut bus = SocketCan::open("vcan0", Stop::default()).expect("vcan0 is up");
    let is_answer = |frame: Frame| frame.to_string().starts_with("581#43001000");
    // A busy machine takes its time over the frames that were kept, and may lose this one as well.
    let answers = (0..30).any(|_| {
        bus.send(&Frame::new(0x601, *b"\x40\0\x10\0\0\0\0\0")).expect("vcan0 takes it");
        let again = bus.now() + Duration::from_secs(2);
        while let Some(seen) = bus.recv(again).expect("vcan0 works") {
            if is_answer(seen.frame) {
                return true;
            }
        }
        false
    });
    assert!(answers);
}

/// How many frames a device cannot keep while it does not run.
const MORE_THAN_A_QUEUE: usize = 30_000;

const SUITES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/vcan/suites");

/// A run of these instances alone.
fn rerun(files: &Files, names: &[String], target: &[&str]) -> Run {
    harness().args(target).args(names).args(files.options()).output().unwrap();
    files.run()
}

/// There is one vcan0 for all processes of a kernel, and no test may see the device of another one.
/// Where each process has a kernel of its own, as in user-mode-linux, each has its lock as well.
fn wire() -> File {
    let lock = File::create(env::temp_dir().join("harness-tests-of-vcan0")).unwrap();
    lock.lock().unwrap();
    lock
}

/// A reference device on vcan0, until this is dropped.
struct Served(Child);

impl Served {
    /// Returns when the device is on the bus.
    fn start() -> Self {
        Self::device("drr460", &[])
    }

    fn device(name: &str, options: &[&OsStr]) -> Self {
        let mut command = harness();
        command.args(["serve", name, "--target", "vcan0"]).args(options);
        command.stderr(Stdio::piped());
        let mut served = Self(command.spawn().unwrap());
        let line = served.line();
        assert!(line.contains("on vcan0"), "{line}");
        served
    }

    /// The next line that it says.
    fn line(&mut self) -> String {
        let mut line = String::new();
        let errors = self.0.stderr.as_mut().expect("it was asked for");
        BufReader::new(errors).read_line(&mut line).unwrap();
        line
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        // It may have been ended already.
        _ = self.0.kill();
        _ = self.0.wait();
    }
}

/// Where the reports of a run go.
struct Files(TempDir);

impl Files {
    fn new() -> Self {
        Self(TempDir::new().unwrap())
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn options(&self) -> [PathBuf; 4] {
        let flags = ["--journal", "--junit"].map(PathBuf::from);
        let [journal, junit] = flags;
        [journal, self.path("journal.jsonl"), junit, self.path("junit.xml")]
    }

    /// The program, which keeps its undo logs here.
    fn harness(&self) -> Command {
        let mut command = harness();
        command.env("XDG_STATE_HOME", self.0.path());
        command
    }

    /// Starts a run of the suites beside this file.
    fn start(&self, cases: &[&str]) -> Child {
        let mut command = self.harness();
        command
            .args(["--target", "vcan0", "--only-suites", SUITES])
            .args(cases)
            .args(self.options());
        command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
    }

    /// Starts a campaign on vcan0.
    fn campaign(&self, arguments: &[&str]) -> Child {
        let mut command = self.harness();
        command.args(["fuzz", "--target", "vcan0", "--quiet"]).args(arguments).args(self.options());
        command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
    }

    fn restore(&self, arguments: &[&str]) -> (String, Option<i32>) {
        let output = self.harness().arg("restore").args(arguments).output().unwrap();
        (text(&output.stdout).to_owned(), output.status.code())
    }

    fn run(&self) -> Run {
        record::read(&self.path("journal.jsonl"))
    }

    fn junit(&self) -> String {
        std::fs::read_to_string(self.path("junit.xml")).unwrap()
    }
}

fn verdicts(run: &Run) -> Vec<(&str, Verdict)> {
    run.cases().map(|(_, case)| (&*case.info.case, case.verdict())).collect()
}

/// Returns when the device has confirmed the download to 1017h.
fn wait_for_the_write(bus: &mut SocketCan) {
    let give_up = bus.now() + Duration::from_secs(30);
    loop {
        let seen = bus.recv(give_up).expect("vcan0 works").expect("the case writes to 1017h");
        if seen.frame.to_string() == "581#6017100000000000" {
            return;
        }
    }
}

fn interrupt(child: &Child) {
    signal(child, Signal::SIGINT);
}

fn signal(child: &Child, signal: Signal) {
    let id = child.id().try_into().expect("process ids are positive numbers of 32 bits");
    kill(Pid::from_raw(id), signal).unwrap();
}

fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).expect("the program writes UTF-8")
}
