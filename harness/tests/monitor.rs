//! `harness monitor --check` on what devices in order say: it accuses none.

mod common;

use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::Output;

use reports::{Event, journal};

use common::harness;

/// Which of so many parts of the cases are run: the whole takes a minute.
const PART: &str = "2/5";

fn said(output: &Output) -> String {
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    text(&output.stdout) + &text(&output.stderr)
}

/// The journal of a part of a run of all devices.
fn run(folder: &Path) -> String {
    let path = folder.join("journal");
    let mut run = harness();
    run.args(["run", "--quiet", "--no-progress", "--shard", PART, "--journal"]).arg(&path);
    let output = run.output().expect("the program starts");
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    fs::read_to_string(path).expect("the run wrote it")
}

fn check(trace: &Path, options: &[&str]) -> Output {
    let mut monitor = harness();
    monitor.args(["monitor", "--check", "--quiet"]).args(options).arg(trace);
    monitor.output().expect("the program starts")
}

/// A stretch that begins with a boot-up message has what the device had after the one before: that
/// may have been with another node id, whose identifiers are not those of the usual one.
#[test]
fn defaults_of_another_node_id_are_not_taken_for_stored_values() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("journal");
    let mut run = harness();
    run.args(["run", "--quiet", "--no-progress", "--target", "sim:ax021211"]);
    run.args(["cia305/configure", "cia305/identify", "cia305/unconfigured", "ax021211/lss"]);
    let output = run.arg("--journal").arg(&path).output().expect("the program starts");
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    let checked = check(&path, &[]);
    assert_eq!(checked.status.code(), Some(0), "{}", said(&checked));
    assert!(said(&checked).contains(", 0 wrong"), "{}", said(&checked));
}

/// Where nothing was judged, nothing is in order.
#[test]
fn a_device_with_another_node_id_is_not_judged() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("trace.log");
    fs::write(&path, "(1.0) can0 707#00\n(1.1) can0 707#7F\n").expect("the folder is there");
    let checked = check(&path, &["--device", "em66"]);
    assert_eq!(checked.status.code(), Some(4), "{}", said(&checked));
    assert!(said(&checked).contains("nothing was judged"), "{}", said(&checked));
    let checked = check(&path, &["--device", "em66@7"]);
    assert_eq!(checked.status.code(), Some(0), "{}", said(&checked));
}

/// An application decides what an emergency message says, and not how long it is.
#[test]
fn an_emergency_message_of_seven_bytes_is_wrong() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("trace.log");
    // Until 1014h is read, nobody knows that its messages have this identifier.
    let asked = "(1.1) can0 607#4014100000000000\n(1.101) can0 587#4314100087000000\n";
    for (asked, code) in [("", 0), (asked, 1)] {
        let said_then = "(1.2) can0 087#00420902000000\n(1.3) can0 707#7F\n";
        let log = format!("(1.0) can0 707#00\n{asked}{said_then}");
        fs::write(&path, log).expect("the folder is there");
        let checked = check(&path, &["--device", "em66@7"]);
        assert_eq!(checked.status.code(), Some(code), "{}", said(&checked));
    }
}

/// Many cases do something wrong on purpose, which is the tester's. In a journal the direction of
/// a frame stands beside it; in a log of candump only its identifier says whose it is, and nobody
/// says when the supply is switched.
#[test]
fn no_device_in_order_is_accused() {
    let folder = tempfile::tempdir().expect("a folder");
    let text = run(folder.path());
    let checked = check(&folder.path().join("journal"), &[]);
    assert_eq!(checked.status.code(), Some(0), "{}", said(&checked));
    let mut logs: Vec<(String, String)> = Vec::new();
    for (_, event) in journal::read(&text) {
        match event.expect("an event") {
            Event::DeviceStarted(device) => {
                logs.push((format!("{}@{}", device.device, device.node), String::new()));
            }
            Event::Frame(seen) => {
                let (_, log) = logs.last_mut().expect("a device");
                writeln!(log, "({}) can0 {}", seen.at, seen.frame).expect("a string grows");
            }
            _ => {}
        }
    }
    assert_eq!(said(&checked).matches(", 0 wrong").count(), logs.len(), "{}", said(&checked));
    assert!(logs.len() >= 15, "{} devices", logs.len());
    for (device, log) in &logs {
        let path = folder.path().join("trace.log");
        fs::write(&path, log).expect("the folder is there");
        let checked = check(&path, &["--device", device]);
        assert_eq!(checked.status.code(), Some(0), "{device}\n{}", said(&checked));
    }
}
