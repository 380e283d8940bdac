//! A catalogue of the user's: what suites and devices take from it instead of from the program.

#[path = "../common/mod.rs"]
mod common;

use std::fs;
use std::path::{Path, PathBuf};

use common::{harness, project};

/// The heating/cooling device with its alarms at the addresses of the other catalogue.
fn device_of_the_other_reading(folder: &Path) -> PathBuf {
    let text = fs::read_to_string(project().join("reference-devices/em66/device.yaml")).unwrap();
    let moved = [
        ("6500..65F0/10", "6502..65F2/10"),
        ("6504..65F4/10", "6505..65F5/10"),
        ("7502..75F2/10", "7504..75F4/10"),
        ("7503..75F3/10", "7505..75F5/10"),
    ];
    let text = moved.iter().fold(text, |text, (from, to)| {
        assert!(text.contains(from), "{from}");
        text.replace(from, to)
    });
    let device = folder.join("em66");
    fs::create_dir(&device).unwrap();
    fs::write(device.join("device.yaml"), text).unwrap();
    device
}

/// The summary line of the suites of EUROMAP 66-2 on this target, with the other catalogue.
fn summary(target: &str) -> String {
    let catalogue = project().join("harness/tests/catalogue");
    let output = harness()
        .args(["--target", target, "em66/*", "--quiet", "--catalogue"])
        .arg(catalogue)
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert_eq!(output.status.code(), Some(0), "{said}{}", String::from_utf8_lossy(&output.stderr));
    said.trim_end().lines().next_back().unwrap_or_default().to_owned()
}

#[test]
fn a_device_of_the_same_reading_is_tested_whole() {
    let folder = tempfile::tempdir().unwrap();
    let device = device_of_the_other_reading(folder.path());
    let summary = summary(&format!("sim:{}", device.display()));
    assert!(summary.contains(" passed, 0 lenient, 0 failed, 0 errors, "), "{summary}");
    assert!(!summary.contains("blocked"), "{summary}");
}

#[test]
fn a_device_of_another_reading_is_lenient_and_blocked() {
    let summary = summary("sim:em66");
    assert!(summary.contains(" lenient, 0 failed, 0 errors, "), "{summary}");
    assert!(!summary.contains(" 0 lenient") && summary.contains(" blocked"), "{summary}");
}
