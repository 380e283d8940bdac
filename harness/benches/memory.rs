//! The peak memory of a run of every suite, as the system counts it for the program.

use std::process::{Command, Stdio};

use nix::sys::resource::{UsageWho, getrusage};

fn main() {
    let project = concat!(env!("CARGO_MANIFEST_DIR"), "/..");
    let status = Command::new(env!("CARGO_BIN_EXE_harness"))
        .args(["--no-progress", "--journal", "/dev/null", "--junit", "/dev/null"])
        .current_dir(project)
        .stdout(Stdio::null())
        .status()
        .expect("the program starts");
    assert!(status.success(), "the run ends with {status}");
    let usage = getrusage(UsageWho::RUSAGE_CHILDREN).expect("the system counts");
    // Linux counts in KiB.
    println!("peak memory of a run: {:.1} MiB", usage.max_rss() as f64 / 1024.0);
}
