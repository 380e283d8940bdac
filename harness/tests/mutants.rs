//! The proof that every case can fail.

mod common;

use std::fs;
use std::path::Path;

use common::harness;
use reference_devices::devices;

/// The matrix is reviewed like code: a mutant that is killed by another case than before shows that
/// a case changed its meaning. Each device has a file of its own, so that a change of one device
/// is reviewed without the others.
#[test]
fn every_mutant_is_killed_and_every_case_kills() {
    // A thousand mixtures, the default, are for a release build.
    let output = harness().args(["qualify", "-v", "--mixtures", "100"]).output().unwrap();
    let holes = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(0), "{holes}");
    assert_eq!(holes, "");
    let text = String::from_utf8(output.stdout).unwrap();
    // How many assertions are proved changes with each case and each mutant.
    let (matrices, _) = text.split_once("assertions:").expect("the figures are at the end");
    let matrices = by_device(matrices);
    assert!(matrices.iter().map(|(device, _)| *device).eq(devices::names()), "a matrix per device");
    for (device, matrix) in &matrices {
        insta::assert_snapshot!(format!("kill-matrix-{device}"), matrix);
    }
    let snapshots = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/snapshots");
    for file in fs::read_dir(snapshots).unwrap() {
        let name = file.unwrap().file_name().into_string().unwrap();
        let Some(rest) = name.strip_prefix("mutants__kill-matrix-") else { continue };
        let device = rest.split('.').next().unwrap();
        assert!(devices::names().any(|name| name == device), "{name} is of a device that is gone");
    }
}

/// The name and the lines of each device: the lines that begin with the name, of its mutants and of
/// its freedoms, and the indented lines after them.
fn by_device(matrices: &str) -> Vec<(&str, String)> {
    let mut found: Vec<(&str, String)> = Vec::new();
    for line in matrices.lines() {
        if !line.starts_with(' ') {
            let (device, _) = line.split_once(':').expect("a matrix begins with the device");
            if found.last().is_none_or(|(last, _)| *last != device) {
                found.push((device, String::new()));
            }
        }
        let (_, text) = found.last_mut().expect("a matrix begins with the device");
        text.push_str(line);
        text.push('\n');
    }
    found
}

#[test]
fn every_requirement_has_a_case_and_a_mutant() {
    let output = harness().arg("trace").output().unwrap();
    let holes = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(0), "{holes}");
}
