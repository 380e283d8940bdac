//! Devices that are programs: what is found over their standard input and output is what is found
//! in virtual time.

#[path = "common/agree.rs"]
mod agree;
mod common;
#[path = "common/record.rs"]
mod record;

use std::fs;

use common::{harness, project};
use reports::{Run, Verdict};

/// A run of these cases, with further arguments among them.
fn run(target: &str, cases: &[&str]) -> Run {
    let folder = tempfile::tempdir().expect("a folder");
    let journal = folder.path().join("journal");
    let mut run = harness();
    run.args(cases).args(["-q", "--no-progress", "--target", target, "--journal"]).arg(&journal);
    let output = run.output().expect("the program starts");
    let (said, told) = (String::from_utf8_lossy(&output.stdout), output.stderr);
    let run = record::read(&journal);
    assert!(run.cases().next().is_some(), "{said}{}", String::from_utf8_lossy(&told));
    run
}

/// Compares what is found over pipes with what is found in virtual time, and returns the latter.
fn compare(of_program: &str, simulated: &str) -> Run {
    let (found, expected) = (run(of_program, &CASES), run(simulated, &CASES));
    assert!(expected.cases().count() > 50);
    agree::agree(&expected, &found, |names| {
        run(of_program, &names.iter().map(String::as_str).collect::<Vec<_>>())
    });
    expected
}

fn served(arguments: &str) -> String {
    format!("exec:{} serve {arguments} --stdio", env!("CARGO_BIN_EXE_harness"))
}

/// What is judged by its contents, so that a machine with other things to do changes nothing.
const CASES: [&str; 4] =
    ["cia301/sdo-expedited", "cia301/sdo-block*", "cia301/sdo-segmented", "cia301/objects-access"];

#[test]
fn a_program_gets_the_verdicts_of_virtual_time() {
    compare(&served("generic"), "sim:generic");
}

#[test]
fn a_program_with_a_defect_fails_where_it_does_in_virtual_time() {
    let mutant = "abort-no-sub-index-for-no-object";
    let served = served(&format!("generic --mutant {mutant}"));
    let found = compare(&served, &format!("sim:generic?mutant={mutant}"));
    assert!(found.cases().any(|(_, case)| case.verdict() == Verdict::Fail));
}

/// LSS tells the device the bit rate of its bus, so it goes on; another one would leave it silent.
#[test]
fn a_program_takes_the_bit_rate_of_its_bus_from_the_command_line() {
    let case = "cia305/bit-timing/speaks-again";
    let run = run(&served("generic --bitrate 500000"), &[case, "--bitrate", "500000"]);
    let verdicts: Vec<_> = run.cases().map(|(_, case)| case.verdict()).collect();
    assert_eq!(verdicts, [Verdict::Pass]);
}

/// A device file says where the program runs and what is in its environment, for the program, the
/// bench and the hooks alike. Its paths are relative to the file. The program is a script of `sh`.
#[test]
#[cfg(unix)]
fn a_program_runs_where_it_is_told_with_what_it_is_told() {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, text: &str| {
        fs::write(folder.path().join(name), text).expect("it is written");
    };
    fs::create_dir(folder.path().join("my build")).expect("it is made");
    write("my build/device.sh", "exec \"$HARNESS\" serve $DEVICE --stdio\n");
    let program = env!("CARGO_BIN_EXE_harness");
    let line = |folder, device| {
        format!("exec:cd {folder} && HARNESS={program} DEVICE='{device}' sh ./device.sh")
    };
    let file = |line: &str| write("dut.yaml", &format!("target: \"{line}\"\nnode: 7\n"));
    let scan = || {
        let mut run = harness();
        run.args(["cia301/nmt/enter-pre-operational", "-q", "--dut"])
            .arg(folder.path().join("dut.yaml"));
        let output = run.output().expect("the program starts");
        let said = [&output.stdout, &output.stderr].map(|text| String::from_utf8_lossy(text));
        (output.status.code(), said.concat())
    };
    file(&line("'my build'", "generic --node 7"));
    let (code, said) = scan();
    assert_eq!(code, Some(0), "{said}");
    file(&line("elsewhere", "generic"));
    let (code, said) = scan();
    let why = format!("there is no folder {}", folder.path().join("elsewhere").display());
    assert!(code == Some(6) && said.contains(&why), "{said}");
}

/// What no document allows is done once: by the device in the case, since no attempt after it
/// shows it.
#[test]
fn what_only_the_device_can_have_sent_is_a_failure_although_it_came_once() {
    let folder = tempfile::tempdir().expect("a folder");
    let device = "harness/tests/cli/qualify/first-mutant/my-device/device.yaml";
    fs::copy(project().join(device), folder.path().join("device.yaml")).expect("it is copied");
    fs::write(folder.path().join("mutants.yaml"), ONCE).expect("it is written");
    // A command line is split as a shell does it, which takes a backslash for a quote.
    let path = folder.path().display().to_string().replace('\\', "/");
    for (mutant, case, verdict) in [
        ("another-node", "cia301/frame-formats/requests-of-other-nodes", Verdict::Fail),
        ("long-identifier", "cia301/sdo-expedited/request-in-another-format", Verdict::Fail),
        ("mute", "cia301/heartbeat/switched-off", Verdict::Fail),
        ("stopped", "cia301/pdo-states/none-in-stopped[TPDO1]", Verdict::Fail),
        // The machine may have been busy.
        ("late", "cia301/heartbeat/switched-off", Verdict::Flaky),
    ] {
        let target = served(&format!("{path} --mutant {mutant}"));
        let run = run(&target, &[case]);
        let verdicts: Vec<_> = run.cases().map(|(_, case)| case.verdict()).collect();
        assert_eq!(verdicts, [verdict], "{mutant}");
    }
}

const ONCE: &str = r#"mutants:
- another-node: A request for another node is answered.
  breaks: [CIA301-SDO-19]
  frame: { when: "604+n#...", received: true, edit: "600+n#= = = = = = = =", most: 1 }
- long-identifier: A 29-bit frame is a request.
  breaks: [CIA301-SDO-10]
  frame: { when: "00000600+n#40 ...", received: true, edit: "600+n#= ...", most: 1 }
- stopped: A TPDO comes after the device has reported STOPPED several times.
  breaks: [CIA301-TPDO-11]
  frame: { when: "700+n#04", edit: "180+n#01 00", skip: 6, most: 1 }
- mute: A heartbeat comes although the device has confirmed that there is none.
  breaks: [CIA301-HB-02]
  frame: { when: "700+n#7F", delay: 55 ms, most: 1 }
- late: An answer comes too late.
  breaks: [CIA301-HB-02]
  frame: { when: "580+n#60 17 10 ...", delay: 2000 ms, most: 1 }
"#;
