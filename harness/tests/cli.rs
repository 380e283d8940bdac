//! The command line, as folders of files below `cli/`: every folder with a file `args` is a test.
//!
//! | file | what it is |
//! |---|---|
//! | `args` | the arguments, one per line |
//! | `exit` | the exit code |
//! | `stdout`, `stderr` | what is printed; nothing where the file is absent |
//! | `after` | a folder of files as the program leaves them |
//! | `unix` | why no other system has this test |
//!
//! The program runs in the folder, whose other files are there for it, or in a copy of it if it is
//! to change them. In what is printed, `{..}`
//! stands for any part of a line and a line `{...}` for any number of lines. `WRITE_CLI_TESTS=1`
//! writes what was printed over what did not match; put the wildcards back and review it.

mod common;
#[path = "common/wildcards.rs"]
mod wildcards;

use std::fs;
#[cfg(unix)]
use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::Mutex;
use std::thread;

use common::{harness, project};
#[cfg(unix)]
use nix::sys::signal::{Signal, kill};
#[cfg(unix)]
use nix::unistd::Pid;
use reports::{Keep, Run, Verdict};
use wildcards::matches;

#[test]
fn every_folder() {
    let mut folders = Vec::new();
    find(&cli(), &mut folders);
    assert!(folders.len() >= 40, "only {} folders were found", folders.len());
    folders.sort();
    let wrong = side_by_side(&folders, wrong);
    assert!(wrong.is_empty(), "{} folders differ\n\n{}", wrong.len(), wrong.join("\n"));
}

/// On a machine without CAN the reason is another one, and so is the help. Both are right; which
/// one it is depends on the kernel alone.
#[test]
#[cfg(target_os = "linux")]
fn an_absent_interface_is_refused_with_what_helps() {
    for command in [&[][..], &["scan"], &["serve", "drr460"]] {
        let output = harness().args(command).args(["--target", "vcan99"]).output().unwrap();
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(6), "{said}");
        let no_interface = said.contains("vcan99") && said.contains("ip link add");
        let no_can = said.contains("no SocketCAN") && said.contains("scripts/with-vcan");
        assert!(no_interface || no_can, "{said}");
        assert_eq!(text(&output.stdout), "");
    }
}

#[test]
fn the_committed_schemas_are_those_of_the_program() {
    for (name, file) in [
        ("suite", "suites/suite"),
        ("words", "suites/words"),
        ("steps", "suites/steps"),
        ("requirements", "suites/requirements"),
        ("device", "reference-devices/device"),
        ("variant", "reference-devices/variant"),
        ("part", "reference-devices/part"),
        ("mutants", "reference-devices/mutants"),
        ("freedoms", "reference-devices/freedoms"),
        ("personalities", "reference-devices/personalities"),
        ("catalogue", "canopen/catalogue/catalogue"),
        ("report", "reports/report"),
        ("waivers", "suites/waivers"),
        ("dut", "suites/device-under-test"),
    ] {
        let output = harness().args(["schema", name]).output().unwrap();
        let path = project().join(file).with_extension("schema.json");
        let committed = fs::read_to_string(&path).unwrap();
        assert!(text(&output.stdout) == committed, "harness schema {name} > {}", path.display());
    }
}

#[test]
fn the_committed_data_sheets_are_those_of_the_program() {
    for device in reference_devices::devices::names() {
        // A file of another device is not overwritten.
        let folder = tempfile::tempdir().unwrap();
        let output =
            harness().args(["eds", "write", device, "--out"]).arg(folder.path()).output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        let described = reference_devices::devices::device(device).unwrap();
        for (file, _) in described.generated_files() {
            let name = Path::new(&file).file_name().unwrap();
            let written = fs::read(folder.path().join(name)).unwrap();
            let committed = fs::read(project().join(&file)).unwrap();
            assert!(written == committed, "{file}: harness eds write {device}");
        }
    }
}

/// Two runs with the same suites bear the same numbers.
#[test]
fn a_journal_says_what_it_was_made_with_and_what_a_selection_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let started = |name: &str, selected: &[&str]| {
        let path = folder.path().join(name);
        let mut run = harness();
        run.current_dir(folder.path()).args(["--target", "sim:drr460", "-q"]).args(selected);
        let output = run.arg("--journal").arg(&path).output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        let run = Run::fold(&fs::read_to_string(&path).unwrap(), Keep::Unusual).unwrap();
        (run.counts().total(), run.started.unwrap())
    };
    let (all, whole) = started("whole", &[]);
    let (some, part) = started("part", &["cia301/nmt"]);
    assert_eq!((whole.selected, whole.left_out), (false, None));
    assert_eq!((part.selected, part.left_out), (true, Some(all - some)));
    assert_eq!(part.suites[0].from, "built in");
    assert_eq!((&part.suites, &part.devices), (&whole.suites, &whole.devices));
    assert_eq!((part.suites.len(), part.devices.len()), (1, 1));
}

/// A dry run tells what would run.
#[test]
fn a_dry_run_keeps_to_what_failed_last() {
    let folder = tempfile::tempdir().unwrap();
    let run = |args: &[&str]| {
        let mut run = harness();
        run.current_dir(folder.path()).args(["cia301/heartbeat/switched-off", "cia301/nmt/start"]);
        run.args(["--target", "sim:drr460?mutant=heartbeat-cannot-be-stopped"]);
        let output = run.args(args);
        text(&output.output().unwrap().stdout).to_owned()
    };
    run(&["-q", "--journal", "journal"]);
    let dry = run(&["--dry-run", "--last-failed", "journal"]);
    assert!(dry.contains("1 case would run, 0 would be skipped"), "{dry}");
}

/// Several devices of one vendor bear the same product code. Modules of another revision are told
/// apart by what they have.
#[test]
fn a_scan_names_each_reference_device() {
    let recognised = |target: &str| {
        let output = harness().args(["scan", "--target", target]).output().unwrap();
        text(&output.stdout).split_whitespace().last().unwrap_or_default().to_owned()
    };
    for name in reference_devices::devices::names() {
        assert_eq!(recognised(&format!("sim:{name}")), name);
    }
    let folder = tempfile::tempdir().unwrap();
    for part in ["", "parts", "variants"] {
        let to = folder.path().join(part);
        fs::create_dir_all(&to).unwrap();
        for file in fs::read_dir(project().join("reference-devices/mcm260x").join(part)).unwrap() {
            let from = file.unwrap().path();
            if from.extension().is_some_and(|end| end == "yaml") {
                let text = fs::read_to_string(&from)
                    .unwrap()
                    .replace("\nrevision: 0x02", "\nrevision: 0x05");
                fs::write(to.join(from.file_name().unwrap()), text).unwrap();
            }
        }
    }
    for name in reference_devices::devices::with_variants("mcm260x") {
        let variant = name.strip_prefix("mcm260x-").unwrap();
        let path = folder.path().join("variants").join(variant).with_extension("yaml");
        assert_eq!(recognised(&format!("sim:{}", path.display())), name);
    }
}

/// A device file that `init` wrote is one that a run can begin with. A device that nobody knows
/// gets a data sheet, too.
#[test]
fn a_written_device_file_is_one_to_begin_with() {
    let targets = [("sim:generic", false), ("sim:em66", false), ("sim:mcm260x-2ad", false)];
    for (target, has_sheet) in targets.into_iter().chain([("sim:em66?mutant=vendor-id-0", true)]) {
        let folder = tempfile::tempdir().unwrap();
        let run = |args: &[&str]| harness().current_dir(folder.path()).args(args).output().unwrap();
        let output = run(&["init", "--target", target]);
        assert_eq!(output.status.code(), Some(0), "{target}: {}", text(&output.stderr));
        let said = text(&output.stdout);
        assert!(said.starts_with("device-under-test.yaml: read it, then\n"), "{said}");
        assert_eq!(folder.path().join("device-under-test.eds").exists(), has_sheet, "{target}");
        let file = fs::read_to_string(folder.path().join("device-under-test.yaml")).unwrap();
        assert!(file.contains("outputs: false") && file.contains("stores: 0"), "{file}");
        for args in [&["--dry-run"][..], &["cia301/nmt", "cia301/sdo*"]] {
            let output = run(&[&["--dut", "device-under-test.yaml"], args].concat());
            let said = [text(&output.stdout), text(&output.stderr)].concat();
            // A mutant is one all the same.
            let expected = if has_sheet { &[0, 1][..] } else { &[0] };
            assert!(expected.contains(&output.status.code().unwrap()), "{target}: {said}");
        }
        let output = run(&["init", "--target", target]);
        assert_eq!(output.status.code(), Some(2));
        let refused = "error: device-under-test.yaml exists and is not overwritten: give \
                       `--out` another name, or remove it\n";
        assert_eq!(text(&output.stderr), refused);
    }
}

/// The example of reference-devices/README.md, in a folder whose name has a blank.
#[test]
fn a_device_in_a_folder_is_run_like_one_in_the_program() {
    let readme = fs::read_to_string(project().join("reference-devices/README.md")).unwrap();
    let folder = tempfile::tempdir().unwrap();
    for block in readme.split("```yaml\n# my-device/").skip(1) {
        let (file, rest) = block.split_once('\n').unwrap();
        let path = folder.path().join("a device").join(file);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, rest.split("```").next().unwrap()).unwrap();
    }
    let run = |args: &[&str]| harness().current_dir(folder.path()).args(args).output().unwrap();
    for args in [
        &["check", "a device"][..],
        &["eds", "write", "a device"],
        &["eds", "check", "a device/device.eds"],
        &["--target", "sim:a device", "cia301/*", "cia306/*"],
        &["--target", "sim:a device/variants/small.yaml", "cia301/sdo*"],
        &["list", "--target", "sim:a device?mutant=boots-twice"],
    ] {
        let output = run(args);
        let said = [text(&output.stdout), text(&output.stderr)].concat();
        assert_eq!(output.status.code(), Some(0), "{args:?}\n{said}");
    }
    let output = run(&["--target", "sim:a device?mutant=boots-twice", "cia301/nmt*"]);
    assert_eq!(output.status.code(), Some(1), "{}", text(&output.stdout));
    let again = "--target 'sim:a device?mutant=boots-twice'";
    assert!(text(&output.stdout).contains(again), "{}", text(&output.stdout));
}

#[test]
fn a_text_without_default_is_long_when_the_device_says_so() {
    let sheet = fs::read_to_string(project().join("reference-devices/generic/device.eds")).unwrap();
    let sheet: Vec<&str> = sheet
        .lines()
        .filter(|line| !line.starts_with("DefaultValue=") || line.contains("0x"))
        .collect();
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("without-texts.eds");
    fs::write(&file, sheet.join("\r\n")).unwrap();
    let list = |more: &[&str]| {
        let mut command = harness();
        command.args(["list", "cia301/sdo-segmented", "--eds"]).arg(&file).args(more);
        text(&command.output().unwrap().stdout).to_owned()
    };
    let asked = list(&["--target", "sim:generic"]);
    assert!(asked.contains("[1008:00]"), "{asked}");
    let nobody_asked = list(&[]);
    assert!(!nobody_asked.contains("[1008:00]"), "{nobody_asked}");
}

#[test]
fn the_list_as_json_says_what_the_list_says() {
    let list = harness().args(["list", "--target", "sim:drr460"]).output().unwrap();
    let json = harness().args(["list", "--json", "--target", "sim:drr460"]).output().unwrap();
    let rows: Vec<serde_json::Value> = serde_json::from_slice(&json.stdout).unwrap();
    let lines: Vec<&str> = text(&list.stdout).lines().take(rows.len()).collect();
    for (row, line) in rows.iter().zip(lines) {
        let (device, name) = (row["device"].as_str().unwrap(), row["name"].as_str().unwrap());
        let reason = row["skip"].as_str().map(|reason| format!("  SKIP: {reason}"));
        assert_eq!(line, format!("{device}  {name}{}", reason.unwrap_or_default()));
        let file = fs::read_to_string(project().join(row["file"].as_str().unwrap())).unwrap();
        let line = row["line"].as_u64().unwrap() as usize;
        let case = name.rsplit('/').next().unwrap().split('[').next().unwrap();
        let told = file.lines().nth(line - 1).unwrap().replace('"', "");
        // A case is where its id stands, or is a row of a table of cases.
        let is_row = told.trim_start().starts_with("- ") || told.contains("rows: ");
        assert!(told.ends_with(&format!("id: {case}")) || is_row, "{name}");
    }
}

#[test]
fn the_rig_in_the_manual_is_the_one_that_is_tested() {
    let rig = fs::read_to_string(cli().join("run/bench-rig/rig.sh")).unwrap();
    let manual = fs::read_to_string(project().join("suites/README.md")).unwrap();
    assert!(manual.contains(&format!("```sh\n{rig}```\n")), "suites/README.md shows another rig");
}

#[test]
fn a_checkout_takes_the_place_of_the_data_in_the_program() {
    let folder = checkout();
    let mutants = folder.path().join("reference-devices/mutants/cia301.yaml");
    let text = fs::read_to_string(&mutants).unwrap();
    let explain = |data: &Path| {
        harness().env("HARNESS_DATA", data).args(["explain", "boot-up-twice"]).output().unwrap()
    };
    fs::write(&mutants, text.replace("A second boot-up message", "One more boot-up")).unwrap();
    let output = explain(folder.path());
    assert!(text_of(&output).contains("One more boot-up makes a master"), "{}", text_of(&output));

    fs::write(&mutants, text.replace("breaks:", "braeks:")).unwrap();
    let output = explain(folder.path());
    assert_eq!(output.status.code(), Some(3));
    assert!(text_of(&output).contains("unknown key `braeks`; did you mean `breaks`?"));
    assert!(text_of(&output).contains("reference-devices/mutants/cia301.yaml:"));

    let output = explain(&folder.path().join("none"));
    assert_eq!(output.status.code(), Some(3));
    assert!(text_of(&output).contains("HARNESS_DATA names a checkout of the harness"));
}

/// A copy of what the program reads in the place of its own data.
fn checkout() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for part in ["canopen/catalogue", "reference-devices", "suites"] {
        for file in files(&project().join(part)) {
            let to = folder.path().join(file.strip_prefix(project()).unwrap());
            fs::create_dir_all(to.parent().unwrap()).unwrap();
            fs::copy(file, to).unwrap();
        }
    }
    folder
}

/// A program whose proofs do not hold says so itself, and which.
#[test]
fn a_self_test_names_what_is_wrong_with_the_program() {
    let folder = checkout();
    let change = |file: &str, from: &str, to: &str| {
        let path = folder.path().join(file);
        let text = fs::read_to_string(&path).unwrap();
        assert!(text.contains(from), "{file} has another text");
        fs::write(path, text.replacen(from, to, 1)).unwrap();
    };
    change(
        "suites/cia301/nmt.yaml",
        "- never: { frame: boot-up, for",
        "- expect: { frame: boot-up, within",
    );
    let nothing = r##"frame: { when: "580+n#...", edit: "580+n#..." }"##;
    change(
        "reference-devices/mutants/cia301.yaml",
        "breaks: [CIA301-UP-02]\n    change: { decision: starts-itself, is: true }",
        &format!("breaks: [CIA301-UP-02]\n    {nothing}"),
    );
    let output =
        harness().env("HARNESS_DATA", folder.path()).args(["self-test", "--in-process"]).output();
    let output = output.unwrap();
    assert_eq!(output.status.code(), Some(9), "{}", text_of(&output));
    let said = text(&output.stderr);
    assert!(said.contains("wrong: generic has no deviation and is not green in "), "{said}");
    assert!(said.contains("no case notices the mutant start-by-itself-always"), "{said}");
    assert!(text(&output.stdout).contains("devices    0 of 15 green"), "{}", text(&output.stdout));
}

/// Completions and pages are of the command line that there is.
#[test]
fn completions_and_manual_pages_know_every_command() {
    let help = harness().arg("--help").output().unwrap();
    let commands = text(&help.stdout).split_once("Commands:\n").unwrap().1;
    let commands = commands.split_once("\n\n").unwrap().0;
    let named = commands.lines().filter(|line| line.starts_with("  ") && !line.starts_with("   "));
    let named: Vec<&str> = named.filter_map(|line| line.split_whitespace().next()).collect();
    assert!(named.len() > 20 && named.contains(&"self-test"), "{named:?}");
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        let output = harness().args(["completions", shell]).output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{shell}");
        let missing = named.iter().find(|name| !text(&output.stdout).contains(**name));
        assert_eq!(missing, None, "{shell}");
    }
    let folder = tempfile::tempdir().unwrap();
    let pages = folder.path().join("pages");
    let output = harness().arg("man").arg(&pages).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", text_of(&output));
    for name in named.iter().filter(|name| **name != "help") {
        let page = fs::read_to_string(pages.join(format!("harness-{name}.1"))).unwrap();
        assert!(page.contains(".SH SYNOPSIS"), "{name}");
    }
    let printed = harness().arg("man").output().unwrap();
    let written = fs::read_to_string(pages.join("harness.1")).unwrap();
    assert!(text(&printed.stdout).contains("7 the device did not come back"));
    assert!(written.contains("7 the device did not come back"));
}

/// A run that another version killed can be set back.
#[test]
fn an_undo_log_of_an_earlier_version_is_listed() {
    // Where it was built on another system, its folders have no drive.
    let state = std::path::absolute(cli().join("kept-formats/state-of-0.1")).unwrap();
    let output = harness().arg("restore").env("XDG_STATE_HOME", state).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", text_of(&output));
    let said = text(&output.stdout);
    for known in ["vcan0-node1-4194305", "drr460", "1017:00, 6423:00"] {
        assert!(said.contains(known), "{said}");
    }
}

/// A program that reads the report of an earlier version reads that of this one.
#[test]
fn the_report_for_programs_has_what_it_had_in_earlier_versions() {
    let folder = cli().join("kept-formats/journal-of-0.1");
    let kept = fs::read_to_string(folder.join("report.json")).unwrap();
    let file = tempfile::tempdir().unwrap();
    let path = file.path().join("report.json");
    let output =
        harness().arg("report").arg(folder.join("journal")).arg("--json").arg(&path).output();
    assert!(path.exists(), "{}", text_of(&output.unwrap()));
    let [kept, written] = [kept, fs::read_to_string(path).unwrap()]
        .map(|text| serde_json::from_str::<serde_json::Value>(&text).unwrap());
    let lost = lost(&kept, &written, "");
    assert!(lost.is_empty(), "not in the report any more, or of another type: {lost:?}");
}

/// The paths that one value has and the other does not, or with another type of value.
fn lost(kept: &serde_json::Value, written: &serde_json::Value, path: &str) -> Vec<String> {
    use serde_json::Value::{Array, Null, Object};
    match (kept, written) {
        (Object(kept), Object(written)) => kept
            .iter()
            .flat_map(|(key, kept)| {
                lost(kept, written.get(key).unwrap_or(&Null), &format!("{path}/{key}"))
            })
            .collect(),
        (Array(kept), Array(written)) => {
            let pairs = kept.iter().zip(written);
            let deep = pairs.flat_map(|(kept, written)| lost(kept, written, path));
            let fewer = (kept.len() > written.len()).then(|| path.to_owned());
            deep.chain(fewer).collect()
        }
        (kept, written) if std::mem::discriminant(kept) == std::mem::discriminant(written) => {
            Vec::new()
        }
        _ => vec![path.to_owned()],
    }
}

/// What a command printed, errors last.
fn text_of(output: &Output) -> String {
    format!("{}{}", text(&output.stdout), text(&output.stderr))
}

/// The texts of this run stand in `cli/run/dies-in-the-middle`.
#[test]
fn a_device_that_dies_in_the_middle_still_gives_reports() {
    let folder = tempfile::tempdir().unwrap();
    let (journal, junit) = (folder.path().join("journal"), folder.path().join("junit.xml"));
    let output = harness()
        .current_dir(cli().join("run/dies-in-the-middle"))
        .args(["--target", "sim:drr460?mutant=reset-node-stops", "--journal"])
        .arg(&journal)
        .arg("--junit")
        .arg(&junit)
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(7), "{}", text(&output.stderr));
    let journal = fs::read_to_string(journal).unwrap();
    assert_eq!(journal.lines().filter(|line| line.starts_with("{\"case-ended\"")).count(), 4);
    assert!(journal.lines().last().unwrap().starts_with("{\"run-ended\":{\"exit\":7"));
    assert_eq!(fs::read_to_string(junit).unwrap().matches("<testcase").count(), 4);
}

/// The case sends frames for longer than anybody waits. SIGKILL leaves the program no time for
/// reports, so what the journal has then was written while the case ran.
#[test]
fn a_run_that_is_killed_leaves_the_frames_of_its_open_case() {
    let folder = tempfile::tempdir().unwrap();
    let mut child = endless(folder.path());
    child.kill().unwrap();
    child.wait().unwrap();
    let path = folder.path().join("journal");
    let run = Run::fold(&fs::read_to_string(&path).unwrap(), Keep::All).unwrap();
    let cases: Vec<_> = run.devices[0].cases().collect();
    let verdicts: Vec<Verdict> = cases.iter().map(|case| case.verdict()).collect();
    assert_eq!(verdicts, [Verdict::Pass, Verdict::Error], "a case that did not end is an error");
    assert!(cases[1].record().trace.len() >= 100, "{} frames", cases[1].record().trace.len());
    assert!(run.ended.is_none());
    let junit = fs::read_to_string(folder.path().join("junit.xml")).unwrap();
    assert!(junit.contains("<error") && junit.contains("did not come to its end"), "{junit}");
}

/// In virtual time nothing waits, so that nothing but the runner notices a signal.
#[cfg(unix)]
#[test]
fn each_signal_ends_a_run_with_complete_reports() {
    let signals = [Signal::SIGINT, Signal::SIGTERM, Signal::SIGHUP];
    for signal in signals.into_iter().filter(|signal| !is_ignored(*signal)) {
        let folder = tempfile::tempdir().unwrap();
        let mut child = endless(folder.path());
        kill(Pid::from_raw(child.id().cast_signed()), signal).unwrap();
        assert_eq!(child.wait().unwrap().code(), Some(130), "{signal}");
        let journal = fs::read_to_string(folder.path().join("journal")).unwrap();
        let run = Run::fold(&journal, Keep::All).unwrap();
        let verdicts: Vec<Verdict> = run.cases().map(|(_, case)| case.verdict()).collect();
        assert_eq!(verdicts, [Verdict::Pass, Verdict::Error, Verdict::Skip], "{signal}");
        assert_eq!(run.ended.map(|ended| ended.exit), Some(130));
        let junit = fs::read_to_string(folder.path().join("junit.xml")).unwrap();
        assert_eq!(junit.matches("<testcase").count(), 3, "{junit}");
        assert!(junit.contains("message=\"not run: interrupted\""), "{junit}");
    }
}

/// Whether this process ignores a signal, and so does what it starts: SIGHUP under nohup.
#[cfg(unix)]
fn is_ignored(signal: Signal) -> bool {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0);
    mask >> (signal as i32 - 1) & 1 != 0
}

#[cfg(target_os = "linux")]
#[test]
fn a_disk_that_is_full_is_said_and_spoils_no_other_report() {
    let folder = tempfile::tempdir().unwrap();
    let junit = folder.path().join("junit.xml");
    let output = demo("run/green").args(["--journal", "/dev/full", "--junit"]).arg(&junit).output();
    let output = output.unwrap();
    let said = beside_note(&output.stderr);
    assert_eq!(output.status.code(), Some(3), "{said}");
    assert!(said.starts_with("error: /dev/full: No space left on device; the journal"), "{said}");
    assert!(fs::read_to_string(junit).unwrap().contains("<testcase"));
}

#[cfg(target_os = "linux")]
#[test]
fn standard_output_that_takes_nothing_is_an_error_unless_its_reader_went_away() {
    let full = fs::File::options().write(true).open("/dev/full").unwrap();
    let output = demo("run/green").stdout(full).output().unwrap();
    assert_eq!(output.status.code(), Some(3));
    let said = beside_note(&output.stderr);
    assert_eq!(said, "error: standard output: No space left on device\n");
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    let output = demo("run/green").stdout(writer).output().unwrap();
    assert_eq!((output.status.code(), beside_note(&output.stderr)), (Some(0), ""));
}

/// Where it is no terminal there is none: the folders of `cli/` would show it.
#[cfg(unix)]
#[test]
fn long_work_has_a_line_on_a_terminal() {
    for arguments in
        [&["scan", "--target", "sim:generic"][..], &["cia301/nmt", "--target", "sim:drr460"]]
    {
        let pty = nix::pty::openpty(None, None).unwrap();
        let mut command = harness();
        command.args(arguments).env("TERM", "xterm").stdout(Stdio::null());
        let mut child = command.stderr(pty.slave).spawn().unwrap();
        // With the command its copy of the terminal goes, so that reading ends.
        drop(command);
        let mut shown = Vec::new();
        // The end of a terminal is an error.
        _ = fs::File::from(pty.master).read_to_end(&mut shown);
        assert!(child.wait().unwrap().success());
        let shown = String::from_utf8_lossy(&shown).into_owned();
        assert!(shown.contains(" %  "), "{arguments:?}: {shown}");
    }
}

#[test]
fn colours_are_where_people_expect_them() {
    let coloured = |option: Option<&str>, variables: &[(&str, &str)]| {
        let mut command = demo("run/green");
        command.env_remove("NO_COLOR").env_remove("CLICOLOR_FORCE");
        command.envs(variables.iter().copied());
        let output = command.args(option.map(|when| format!("--color={when}"))).output().unwrap();
        text(&output.stdout).contains('\x1b')
    };
    let (no, force) = (("NO_COLOR", "1"), ("CLICOLOR_FORCE", "1"));
    assert!(!coloured(None, &[]), "it is no terminal");
    assert!(coloured(Some("always"), &[no]));
    assert!(coloured(None, &[force]) && coloured(None, &[force, ("NO_COLOR", "")]));
    assert!(!coloured(None, &[force, no]) && !coloured(Some("never"), &[force]));
}

#[cfg(target_os = "linux")]
#[test]
fn standard_error_that_takes_nothing_changes_nothing() {
    let full = fs::File::options().write(true).open("/dev/full").unwrap();
    let output = harness().args(["--target", "none0"]).stderr(full).output().unwrap();
    assert_eq!(output.status.code(), Some(6));
}

/// What is said beside the note that the demonstration has suites of its own.
#[cfg(target_os = "linux")]
fn beside_note(said: &[u8]) -> &str {
    let note = "note: the suites of ./suites are read instead of those in this program, from which \
                they differ; a folder of your own that stands beside them has another name, with \
                `--suites NAME`\n";
    text(said).trim_start_matches(note)
}

#[test]
fn a_run_that_cannot_start_says_so_in_its_reports() {
    let folder = tempfile::tempdir().unwrap();
    let [junit, journal] = ["junit.xml", "journal"].map(|name| folder.path().join(name));
    fs::write(&junit, "<?xml version=\"1.0\"?> of an earlier run").unwrap();
    let output = demo("run/green")
        .args(["no/such-case", "--junit"])
        .arg(&junit)
        .arg("--journal")
        .arg(&journal)
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(2));
    let junit = fs::read_to_string(junit).unwrap();
    assert_eq!(junit.matches("<error").count(), 1, "{junit}");
    assert!(junit.contains("`no/such-case` names no suite"), "{junit}");
    let run = Run::fold(&fs::read_to_string(journal).unwrap(), Keep::All).unwrap();
    assert_eq!(run.ended.map(|ended| ended.exit), Some(2));
}

/// A run in the folder of a transcript.
fn demo(folder: &str) -> Command {
    let mut command = harness();
    command.current_dir(cli().join(folder)).args(read(&cli().join(folder), "args").lines());
    command
}

/// A run that is within a case that lasts longer than anybody waits, with reports in that folder.
fn endless(folder: &Path) -> Child {
    let suites = folder.join("suites");
    fs::create_dir_all(suites.join("requirements")).unwrap();
    let register = cli().join("run/failing/suites/requirements/demo.yaml");
    fs::copy(register, suites.join("requirements/demo.yaml")).unwrap();
    fs::write(suites.join("demo.yaml"), ENDLESS).unwrap();
    let path = folder.join("journal");
    let mut child = harness()
        .args(["--target", "sim:generic", "--only-suites"])
        .arg(&suites)
        .arg("--journal")
        .arg(&path)
        .arg("--junit")
        .arg(folder.join("junit.xml"))
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let mut journal = String::new();
    while journal.matches("080#").count() < 100 {
        assert_eq!(child.try_wait().unwrap(), None, "it ended by itself:\n{journal}");
        thread::yield_now();
        journal = fs::read_to_string(&path).unwrap_or_default();
    }
    child
}

const ENDLESS: &str = "\
suite: demo
cases:
  - id: short
    title: The device can be read.
    checks: [DEMO-1]
    steps:
      - read: { object: '1000:00' }
  - id: endless
    title: The device bears SYNC messages.
    checks: [DEMO-1]
    steps:
      - produce: { frame: '080#', count: 1000000, every: 1 ms }
  - id: after
    title: The device can be read.
    checks: [DEMO-1]
    steps:
      - read: { object: '1000:00' }
";

/// What `check` finds in each folder, in the order of the folders, on as many threads as the
/// machine has processors. Most of the time of a case is that of the program it starts.
fn side_by_side(
    folders: &[PathBuf],
    check: impl Fn(&Path) -> Option<String> + Sync,
) -> Vec<String> {
    let workers = thread::available_parallelism().map_or(1, Into::into);
    let next = Mutex::new(folders.iter().enumerate());
    let work = || {
        // The lock is released before the case runs.
        let take = || next.lock().unwrap().next();
        std::iter::from_fn(take).map(|(place, folder)| (place, check(folder))).collect::<Vec<_>>()
    };
    let mut found: Vec<_> = thread::scope(|scope| {
        let workers: Vec<_> = (0..workers).map(|_| scope.spawn(work)).collect();
        workers.into_iter().flat_map(|worker| worker.join().unwrap()).collect()
    });
    found.sort_by_key(|(place, _)| *place);
    found.into_iter().filter_map(|(_, wrong)| wrong).collect()
}

fn cli() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/cli")
}

fn find(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            find(&path, found);
        } else if path.file_name().is_some_and(|name| name == "args")
            && (cfg!(unix) || !folder.join("unix").exists())
        {
            found.push(folder.to_owned());
        }
    }
}

/// What differs from what the folder says.
fn wrong(folder: &Path) -> Option<String> {
    let args = read(folder, "args");
    let after = folder.join("after");
    let copy = after.is_dir().then(|| copied(folder));
    let at = copy.as_ref().map_or(folder, |copy| copy.path());
    let output = harness().current_dir(at).args(args.lines()).output().unwrap();
    let printed = [
        ("stdout", text(&output.stdout).to_owned()),
        ("stderr", text(&output.stderr).to_owned()),
        ("exit", format!("{}\n", exit_code(&output))),
    ];
    let mut wrong = String::new();
    for (name, got) in printed {
        let expected = read(folder, name);
        if matches(&expected.lines().collect::<Vec<_>>(), &got.lines().collect::<Vec<_>>()) {
            continue;
        }
        if std::env::var_os("WRITE_CLI_TESTS").is_some() {
            fs::write(folder.join(name), &got).unwrap();
        }
        wrong.push_str(&format!("--- expected {name}\n{expected}+++ got {name}\n{got}"));
    }
    for file in files(&after) {
        let name = file.strip_prefix(&after).unwrap();
        let (expected, got) = (read(&after, name), read(at, name));
        if expected != got {
            if std::env::var_os("WRITE_CLI_TESTS").is_some() {
                fs::write(&file, &got).unwrap();
            }
            let name = name.display();
            wrong.push_str(&format!("--- expected {name}\n{expected}+++ got {name}\n{got}"));
        }
    }
    (!wrong.is_empty()).then(|| format!("=== {}\n{wrong}", folder.display()))
}

fn copied(folder: &Path) -> tempfile::TempDir {
    let copy = tempfile::tempdir().unwrap();
    for file in files(folder) {
        let to = copy.path().join(file.strip_prefix(folder).unwrap());
        fs::create_dir_all(to.parent().unwrap()).unwrap();
        fs::copy(file, to).unwrap();
    }
    copy
}

/// The files below a folder; none where it is absent.
fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten();
    let below = entries.flat_map(|entry| {
        let path = entry.unwrap().path();
        if path.is_dir() { files(&path) } else { vec![path] }
    });
    below.collect()
}

fn exit_code(output: &Output) -> String {
    output.status.code().map_or_else(|| output.status.to_string(), |code| code.to_string())
}

fn read(folder: &Path, name: impl AsRef<Path>) -> String {
    // Absent is empty.
    fs::read_to_string(folder.join(name)).unwrap_or_default()
}

fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).expect("the program writes UTF-8")
}
