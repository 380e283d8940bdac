//! The firmware of `examples/firmware-c`, the way its README goes: red, waived, green.

// It reads and writes as POSIX has it.
#![cfg(unix)]

mod common;

use std::fs;
use std::path::Path;
use std::process::Command;

use common::{harness, project};

/// What its two defects concern, and some of what they do not.
const CASES: [&str; 3] =
    ["cia301/objects-types", "cia301/sdo-segmented/*-than-announced-*", "cia301/pdo-cob-id"];

#[test]
fn a_firmware_goes_from_red_over_waived_to_green() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    copy(folder);
    compile(folder, "firmware", &["firmware.c", "bench.c"]);
    compile(folder, "firmware-defects", &["firmware.c", "bench.c", "-DOVERFLOW", "-DSTALE_LENGTH"]);
    let defects = ["--target", "exec:./firmware-defects"];

    let (exit, said) = run(folder, &[]);
    assert_eq!(exit, 0, "{said}");
    let (exit, said) = run(folder, &[&defects[..], &["--journal", "red.jsonl"]].concat());
    assert_eq!(exit, 1, "{said}");
    for red in [
        "cia301/objects-types/shorter-than-before[2002:00]",
        "cia301/sdo-segmented/more-than-announced-of-a-text[2002:00]",
    ] {
        assert!(said.contains(red), "{said}");
    }
    let waive = ["waive", "red.jsonl", "--out", "waivers.yaml", "--reason", "mended with 1.1"];
    let output = harness().current_dir(folder).args(waive).output().expect("it starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let (exit, said) = run(folder, &[&defects[..], &["--waivers", "waivers.yaml"]].concat());
    assert_eq!(exit, 0, "{said}");
    // What was mended is waived no longer.
    let (exit, said) = run(folder, &["--waivers", "waivers.yaml"]);
    assert_eq!(exit, 5, "{said}");
}

/// The program serves its bench, and a suite for it uses a name of it.
#[test]
fn a_bench_of_the_firmware_lets_more_cases_run() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    copy(folder);
    compile(folder, "firmware", &["firmware.c", "bench.c"]);
    let judged = |more: &[&str]| {
        let mut run = harness();
        run.current_dir(folder).args(["-q", "--no-progress", "--dut", "device-under-test.yaml"]);
        run.args(["--suites", "own-suites", "input", "cia301/nmt/*-after-power-on"]).args(more);
        let output = run.output().expect("it starts");
        (output.status.code(), String::from_utf8_lossy(&output.stdout).into_owned())
    };
    // Nothing is judged then.
    let (exit, without) = judged(&[]);
    assert_eq!(exit, Some(4), "{without}");
    assert!(
        without.contains("did not run because no bench offers `input` (2), `power` (2)"),
        "{without}"
    );
    let (exit, with) =
        judged(&["--target", "exec:BENCH=bench ./firmware", "--bench", "unix:bench"]);
    assert_eq!(exit, Some(0), "{with}");
    assert!(with.contains("4 passed, 0 lenient, 0 failed, 0 errors, 0 skipped"), "{with}");
}

/// A text that keeps the length of a longer one is found, repeated and promoted, and the code that
/// is reached steers the sessions.
#[test]
fn a_defect_of_the_firmware_is_found_by_fuzzing() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    copy(folder);
    compile(folder, "coverage.o", &["-c", "coverage.c"]);
    let counts =
        format!("-fsanitize-coverage={}", if is_clang() { "trace-pc-guard" } else { "trace-pc" });
    let defective = ["firmware.c", "bench.c", "coverage.o", "-DSTALE_LENGTH", &counts];
    compile(folder, "firmware-defects", &defective);
    let device = ["--dut", "device-under-test.yaml", "--target", "exec:./firmware-defects"];
    let (exit, said) = fuzz(
        folder,
        &[&device[..], &["--max-findings", "1", "--findings", "found", "--quiet"]].concat(),
    );
    assert_eq!(exit, 8, "{said}");
    assert!(said.contains("#41022000"), "{said}");
    assert!(said.contains("reached code of the program that none before had"), "{said}");
    let mut files = fs::read_dir(folder.join("found")).expect("there is a finding");
    let file = files.next().expect("there is one").expect("it is read").path();
    let file = file.to_str().expect("a name");
    let (exit, said) = fuzz(folder, &["repro", file]);
    assert_eq!(exit, 8, "{said}");
    let (exit, said) = fuzz(folder, &["promote", file, "--into", "own"]);
    assert_eq!(exit, 0, "{said}");
}

/// A firmware that ends when data go behind a buffer, as with a sanitizer, becomes a case.
#[test]
fn a_firmware_that_ends_becomes_a_case() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    copy(folder);
    let source = fs::read_to_string(folder.join("firmware.c")).expect("it is read");
    let checked = "if (length > sizeof transfer.buffer)\n            abort();\n#ifndef OVERFLOW";
    let checked = source.replacen("#ifndef OVERFLOW", checked, 1);
    fs::write(folder.join("firmware.c"), checked).expect("it is written");
    compile(folder, "firmware-defects", &["firmware.c", "bench.c", "-DOVERFLOW"]);
    let sent = |does: &str, frame: String| {
        let then = r#"{ "answers": { "id": 1413, "count": 1 } }"#;
        format!(r#"{{ "does": "{does}", "frames": ["605#{frame}"], "then": {then} }}"#)
    };
    let begins = sent("download-in-segments", "2002200000000000".to_owned());
    let segment = |toggle| sent("download-segment", format!("{toggle}041424344454647"));
    let actions = [0, 1, 0, 1, 0].map(segment);
    let session = format!(
        r#"{{ "cause": "ended", "what": "the program ended", "requirements": [], "seed": 1,
              "session": 1, "freedoms": [], "actions": [{begins}, {}],
              "device": {{ "dut": "device-under-test.yaml",
                           "target": "exec:./firmware-defects", "node": 5 }} }}"#,
        actions.join(", ")
    );
    fs::write(folder.join("ended.json"), session).expect("it is written");
    let (exit, said) = fuzz(folder, &["promote", "ended.json", "--into", "own"]);
    assert_eq!(exit, 0, "{said}");
    let case = fs::read_to_string(folder.join("own/found/ended.yaml")).expect("it is written");
    assert!(case.contains("the program goes on"), "{case}");
}

/// The gate of `examples/ci` lets a green firmware pass, and names what is new in a red one.
#[test]
fn a_gate_tells_what_is_new() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    copy(folder);
    compile(folder, "firmware", &["firmware.c", "bench.c"]);
    compile(folder, "firmware-defects", &["firmware.c", "bench.c", "-DSTALE_LENGTH"]);
    let gate = |reports: &str, only_new: &str, more: &[&str]| {
        let mut gate = Command::new(project().join("examples/ci/gate"));
        gate.current_dir(folder).args(["-q", "--dut", "device-under-test.yaml"]).args(more);
        gate.args(["cia301/objects-types/shorter-*", "cia301/heartbeat/switched-off"]);
        gate.env("HARNESS", env!("CARGO_BIN_EXE_harness")).env("REPORTS", reports);
        gate.env("AGAINST", "good/journal.jsonl").env("ONLY_NEW", only_new);
        let page = folder.join(format!("{reports}.md"));
        let output = gate.env("GITHUB_STEP_SUMMARY", &page).output().expect("it starts");
        let said = String::from_utf8_lossy(&output.stdout).into_owned();
        (output.status.code(), said, fs::read_to_string(page).expect("a summary"))
    };
    let defects = ["--target", "exec:./firmware-defects"];

    let (exit, said, page) = gate("good", "", &[]);
    assert_eq!(exit, Some(0), "{said}");
    assert!(page.contains("No requirement is broken"), "{page}");
    let (exit, said, page) = gate("bad", "true", &defects);
    assert_eq!(exit, Some(10), "{said}");
    assert!(said.contains("changed firmware cia301/objects-types/shorter-"), "{said}");
    assert!(page.contains("A regression"), "{page}");
    let (exit, said, _) = gate("bad", "", &defects);
    assert_eq!(exit, Some(1), "{said}");
    for report in ["report.html", "report.json", "junit.xml", "journal.jsonl", "summary.md"] {
        assert!(folder.join("bad").join(report).is_file(), "{report}");
    }
    // A program that does not start says nothing about what it was to run.
    let (exit, said, page) = gate("absent", "", &["--target", "exec:./no-firmware"]);
    assert_eq!(exit, Some(6), "{said}");
    assert!(!said.contains("regression") && !page.contains("regression"), "{said}{page}");
    // What is red as before passes where only what is new counts.
    fs::copy(folder.join("bad/journal.jsonl"), folder.join("good/journal.jsonl")).expect("it is");
    let (exit, said, _) = gate("known", "true", &defects);
    assert_eq!(exit, Some(0), "{said}");
    // Waivers that are out of date do not hide what is new.
    fs::write(
        folder.join("old.yaml"),
        "- cases: cia301/nmt/start\n  reason: r\n  expires: 2020-01-01\n",
    )
    .expect("it is written");
    fs::remove_dir_all(folder.join("good")).expect("it is there");
    gate("good", "", &[]);
    for only_new in ["", "true"] {
        let more = [&defects[..], &["--waivers", "old.yaml"]].concat();
        let (exit, said, _) = gate("bad", only_new, &more);
        assert_eq!(exit, Some(10), "{said}");
    }
    // The earlier run may be the last one of the same folder.
    let (exit, said, _) = gate("good", "true", &defects);
    assert_eq!(exit, Some(10), "{said}");
}

fn fuzz(folder: &Path, arguments: &[&str]) -> (i32, String) {
    let output = harness().current_dir(folder).arg("fuzz").args(arguments).output();
    let output = output.expect("it starts");
    let said = [output.stdout, output.stderr].concat();
    (output.status.code().expect("an exit code"), String::from_utf8_lossy(&said).into_owned())
}

fn is_clang() -> bool {
    let version = Command::new("cc").arg("--version").output().expect("there is a C compiler");
    String::from_utf8_lossy(&version.stdout).contains("clang")
}

fn copy(folder: &Path) {
    let example = project().join("examples/firmware-c");
    fs::create_dir_all(folder.join("own-suites/requirements")).expect("it is made");
    for file in [
        "firmware.c",
        "bench.c",
        "bench.h",
        "coverage.c",
        "firmware.eds",
        "device-under-test.yaml",
        "own-suites/input.yaml",
        "own-suites/requirements/input.yaml",
    ] {
        fs::copy(example.join(file), folder.join(file)).expect("it is copied");
    }
}

/// The exit code of a run of the cases, and what it prints.
fn run(folder: &Path, more: &[&str]) -> (i32, String) {
    let mut run = harness();
    run.current_dir(folder).args(CASES).args(["-q", "--no-progress"]);
    let output = run.args(["--dut", "device-under-test.yaml"]).args(more).output();
    let output = output.expect("it starts");
    let said = [output.stdout, output.stderr].concat();
    (output.status.code().expect("an exit code"), String::from_utf8_lossy(&said).into_owned())
}

/// The compiler is the one that links Rust programs.
fn compile(folder: &Path, program: &str, arguments: &[&str]) {
    let flags = ["-std=c99", "-D_POSIX_C_SOURCE=200809L", "-O1", "-o", program];
    let mut cc = Command::new("cc");
    let done = cc.current_dir(folder).args(flags).args(arguments).status();
    assert!(done.expect("there is a C compiler").success());
}
