//! Devices that are programs: what is found over their standard input and output is what is found
//! in virtual time.

mod common;

use std::collections::BTreeMap;

use common::harness;
use reports::{Keep, Run, Verdict};

/// The verdicts of cases, by their names.
fn verdicts(target: &str, cases: &[&str]) -> BTreeMap<String, Verdict> {
    let folder = tempfile::tempdir().expect("a folder");
    let journal = folder.path().join("journal");
    let mut run = harness();
    run.args(cases).args(["-q", "--no-progress", "--target", target, "--journal"]).arg(&journal);
    let output = run.output().expect("the program starts");
    let (said, told) = (String::from_utf8_lossy(&output.stdout), output.stderr);
    let journal = std::fs::read_to_string(journal).expect("the run wrote it");
    let run = Run::fold(&journal, Keep::Unusual).expect("a journal");
    let verdicts: BTreeMap<_, _> =
        run.cases().map(|(_, case)| (case.info.name(), case.verdict())).collect();
    assert!(!verdicts.is_empty(), "{said}{}", String::from_utf8_lossy(&told));
    verdicts
}

/// Compares what is found over pipes with what is found in virtual time. A machine that stalls for
/// a moment stalls the device as well: such a case is tried again, alone.
fn compare(of_program: &str, simulated: &str) -> BTreeMap<String, Verdict> {
    let (found, expected) = (verdicts(of_program, &CASES), verdicts(simulated, &CASES));
    assert!(found.keys().eq(expected.keys()) && found.len() > 50);
    let differs = |name: &&String| found[*name] != expected[*name];
    let again: Vec<&str> = found.keys().filter(differs).map(String::as_str).collect();
    assert!(again.len() <= 3, "{again:?}");
    if !again.is_empty() {
        for (name, verdict) in verdicts(of_program, &again) {
            assert_eq!(verdict, expected[&name], "{name}");
        }
    }
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
    assert!(found.values().any(|verdict| *verdict == Verdict::Fail));
}
