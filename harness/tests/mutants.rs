//! The proof that every case can fail.

mod common;

use common::harness;

/// The matrix is reviewed like code: a mutant that is killed by another case than before tells that
/// a case changed its meaning.
#[test]
fn every_mutant_is_killed_and_every_case_kills() {
    let output = harness().args(["qualify", "-v"]).output().unwrap();
    let holes = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(0), "{holes}");
    assert_eq!(holes, "");
    insta::assert_snapshot!("kill-matrix", String::from_utf8(output.stdout).unwrap());
}

#[test]
fn every_requirement_has_a_case_and_a_mutant() {
    let output = harness().arg("trace").output().unwrap();
    let holes = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(0), "{holes}");
}
