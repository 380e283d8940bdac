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
