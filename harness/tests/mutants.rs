//! Every requirement is traced. That every case can fail is proved by `harness qualify`, which
//! takes a minute: `.ci/run proofs` runs it and compares the kills with `matrices/`.

mod common;

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use common::harness;
use reference_devices::devices;

#[test]
fn every_requirement_has_a_case_and_a_mutant() {
    let output = harness().arg("trace").output().unwrap();
    let holes = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(0), "{holes}");
}

/// One device is proved here, so that a mistake in the proof itself shows without a minute of work.
/// A mutant that is killed by another case than before shows that a case changed its meaning.
#[test]
fn the_mutants_of_a_device_are_killed_by_the_cases_of_its_matrix() {
    let folder = tempfile::tempdir().unwrap();
    let mut qualify = harness();
    qualify.args(["qualify", "em66-minimum", "--matrices"]).arg(folder.path());
    let output = qualify.output().unwrap();
    let holes = String::from_utf8(output.stderr).unwrap();
    assert_eq!((output.status.code(), holes.as_str()), (Some(0), ""));
    let matrix = |folder: &Path| fs::read_to_string(folder.join("em66-minimum.txt")).unwrap();
    assert_eq!(matrix(folder.path()), matrix(&matrices()));
}

#[test]
fn each_device_has_a_matrix() {
    let files = fs::read_dir(matrices()).unwrap().map(|file| file.unwrap().path());
    let stems = files.map(|file| file.file_stem().unwrap().to_str().unwrap().to_owned());
    assert_eq!(stems.collect::<BTreeSet<_>>(), devices::names().map(str::to_owned).collect());
}

fn matrices() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/matrices")
}
