//! What a campaign leaves: reports, a journal, waivers and cases, however it ends.

mod common;

use std::fs;
use std::path::Path;
use std::process::Output;

use common::harness;
#[cfg(unix)]
use nix::sys::signal::{Signal, kill};
#[cfg(unix)]
use nix::unistd::Pid;
use reports::{Keep, Run, Verdict};

const MUTANT: &str = "sim:generic?mutant=sdo-toggle-unchecked";

fn fuzz(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = harness();
    command.current_dir(folder).arg("fuzz").args(arguments);
    command.output().expect("the program starts")
}

fn said(output: &Output) -> String {
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    text(&output.stdout) + &text(&output.stderr)
}

fn folded(journal: &Path) -> Run {
    let journal = fs::read_to_string(journal).expect("the campaign wrote it");
    Run::fold(&journal, Keep::Unusual).expect("a journal")
}

#[test]
fn a_campaign_leaves_what_a_run_leaves() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let arguments = ["--target", MUTANT, "--sessions", "40", "--findings", "found"];
    let reports = ["--junit", "junit.xml", "--journal", "journal"];
    let output = fuzz(folder.path(), &[&arguments[..], &reports].concat());
    assert_eq!(output.status.code(), Some(8), "{}", said(&output));
    let run = folded(&path("journal"));
    assert_eq!(run.ended.as_ref().map(|ended| ended.exit), Some(8));
    let cases: Vec<_> = run.cases().map(|(_, case)| (case.info.name(), case.verdict())).collect();
    let expected = [("fuzz/sessions", Verdict::Pass), ("fuzz/sdo-toggle-unchecked", Verdict::Fail)];
    assert_eq!(cases, expected.map(|(name, verdict)| (name.to_owned(), verdict)));
    let (_, cause) = run.cases().last().unwrap();
    assert!(cause.info.checks.iter().any(|check| &*check.id == "CIA301-SEG-02"));
    assert!(!cause.record().trace.is_empty());
    let junit = fs::read_to_string(path("junit.xml")).unwrap();
    assert!(junit.contains("name=\"sdo-toggle-unchecked\"") && junit.contains("<failure"));

    // The first waivers of a run are written in the same way.
    let mut waive = harness();
    waive.current_dir(folder.path()).args(["waive", "journal", "--out", "waivers.yaml"]);
    assert!(waive.status().unwrap().success());
    let waivers = fs::read_to_string(path("waivers.yaml")).unwrap();
    fs::write(path("waivers.yaml"), waivers.replace("not explained yet", "Known.")).unwrap();
    let output = fuzz(folder.path(), &[&arguments[..], &["--waivers", "waivers.yaml"]].concat());
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    assert!(said(&output).contains("WAIVED sdo-toggle-unchecked: Known."), "{}", said(&output));
}

#[test]
fn the_number_of_workers_changes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let of = |jobs: &str| {
        let target = "sim:generic?personality=optimist";
        let arguments = ["--target", target, "--sessions", "40", "--jobs", jobs, "--json", jobs];
        let output = fuzz(folder.path(), &arguments);
        assert_eq!(output.status.code(), Some(0), "{}", said(&output));
        (output.stdout, fs::read(folder.path().join(jobs)).unwrap())
    };
    assert_eq!(of("1"), of("3"));
}

#[test]
fn a_session_that_took_longer_than_the_campaign_has_counts() {
    let folder = tempfile::tempdir().unwrap();
    let program = format!("exec:{} serve em66 --stdio", env!("CARGO_BIN_EXE_harness"));
    let arguments = ["--target", &program, "--oracle", "em66", "--time", "0s", "--json", "it"];
    let output = fuzz(folder.path(), &arguments);
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    let shown = fs::read(folder.path().join("it")).unwrap();
    let shown: serde_json::Value = serde_json::from_slice(&shown).unwrap();
    assert_eq!(shown["campaign"]["sessions"], 1, "{}", said(&output));
}

#[test]
fn what_a_run_showed_is_believed() {
    let folder = tempfile::tempdir().unwrap();
    let target = "sim:generic?freedom=sync-of-any-length";
    let mut run = harness();
    run.current_dir(folder.path()).args(["--target", target, "-q", "--journal", "journal"]);
    assert_eq!(run.arg("cia301/sync").output().unwrap().status.code(), Some(0));
    let output =
        fuzz(folder.path(), &["--target", target, "--sessions", "3", "--after", "journal"]);
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    assert!(said(&output).contains("from the run: sync-of-any-length"), "{}", said(&output));
    let other = ["--target", "sim:drr460", "--sessions", "3", "--after", "journal"];
    let output = fuzz(folder.path(), &other);
    assert_eq!(output.status.code(), Some(2), "{}", said(&output));
}

#[test]
fn a_finding_becomes_a_case_that_the_device_fails() {
    let folder = tempfile::tempdir().unwrap();
    let found = ["--target", MUTANT, "--sessions", "60", "--findings", "found"];
    assert_eq!(fuzz(folder.path(), &found).status.code(), Some(8));
    let file = "found/sdo-toggle-unchecked.json";
    let promote = ["promote", file, "--into", "mine", "--mutant"];
    let output = fuzz(folder.path(), &promote);
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    assert!(said(&output).contains("has a mutant that does the same"), "{}", said(&output));
    let run = |target: &str| {
        let mut run = harness();
        run.current_dir(folder.path()).args(["--suites", "mine", "found", "--target", target]);
        run.output().unwrap()
    };
    let (red, green) = (run(MUTANT), run("sim:generic"));
    assert_eq!(red.status.code(), Some(1), "{}", said(&red));
    assert_eq!(green.status.code(), Some(0), "{}", said(&green));
    // What somebody may have changed since is not overwritten.
    assert_eq!(fuzz(folder.path(), &promote).status.code(), Some(2));
}

/// The device confirms a command before it is done.
#[test]
fn a_frame_that_comes_early_becomes_a_case() {
    let folder = tempfile::tempdir().unwrap();
    let target = "sim:generic?mutant=save-after-load-answered-only";
    let found = ["--target", target, "--max-findings", "1", "--findings", "found"];
    assert_eq!(fuzz(folder.path(), &found).status.code(), Some(8));
    let file = "found/save-after-load-answered-only.json";
    let output = fuzz(folder.path(), &["promote", file, "--into", "mine"]);
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
}

#[cfg(unix)]
#[test]
fn a_signal_ends_a_campaign_with_complete_reports() {
    for signal in [Signal::SIGINT, Signal::SIGTERM] {
        let folder = tempfile::tempdir().unwrap();
        let mut command = harness();
        command.current_dir(folder.path()).args(["fuzz", "--target", "sim:generic", "--quiet"]);
        command.args(["--time", "1h", "--journal", "journal", "--junit", "junit.xml"]);
        let mut child = command.stdout(std::process::Stdio::null()).spawn().unwrap();
        let journal = folder.path().join("journal");
        let begun = || fs::read_to_string(&journal).is_ok_and(|it| it.contains("sessions"));
        while !begun() {
            std::thread::yield_now();
        }
        kill(Pid::from_raw(child.id().cast_signed()), signal).unwrap();
        assert_eq!(child.wait().unwrap().code(), Some(130), "{signal}");
        let run = folded(&journal);
        assert_eq!(run.ended.as_ref().map(|ended| ended.exit), Some(130));
        let (_, sessions) = run.cases().last().unwrap();
        assert_eq!(sessions.verdict(), Verdict::Error);
        let junit = fs::read_to_string(folder.path().join("junit.xml")).unwrap();
        assert!(junit.contains("interrupted"), "{junit}");
    }
}
