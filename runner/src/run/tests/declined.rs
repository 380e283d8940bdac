//! What becomes of a case whose device refuses what it may refuse.

use super::*;

/// Three bytes where two belong, and whatever else is said of the write.
fn refused(enough: &str) -> String {
    format!("write: {{ object: '1017:00', bytes: 01 02 03, or-refused: [0x06070012]{enough} }}")
}

const JUDGES: &str = "read: { object: '1017:00', value: 0 }";
const WHAT: &str = "the device refused 01 02 03 (3 bytes where 2 belong) in 1017:00: 0607 0012h \
                    (data too long for the object), which is allowed";

fn outcome(steps: &str) -> (Outcome, Vec<String>) {
    let mut ran = run(&mut stalled(0), 1, &format!("[ {steps} ]"));
    (ran.outcomes.remove(0), ran.notes)
}

#[test]
fn a_case_that_has_judged_nothing_by_then_is_skipped() {
    let (outcome, notes) = outcome(&format!("{}, {JUDGES}", refused("")));
    assert_eq!(outcome, Outcome::Skip(format!("{WHAT}, before anything was judged")));
    assert!(notes.is_empty(), "{notes:?}");
}

#[test]
fn a_case_that_has_judged_something_passes() {
    let (outcome, notes) = outcome(&format!("{JUDGES}, {}, {JUDGES}", refused("")));
    assert_eq!(outcome, Outcome::Pass);
    assert_eq!(notes, [format!("{WHAT}; the remaining steps were skipped")]);
}

#[test]
fn a_refusal_that_is_enough_passes() {
    let (outcome, notes) = outcome(&format!("{}, {JUDGES}", refused(", enough: true")));
    assert_eq!(outcome, Outcome::Pass);
    assert_eq!(notes, [format!("{WHAT}; the remaining steps were skipped")]);
}
