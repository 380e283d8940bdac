//! Buses of python-can with a reference device on them. `PYTHON` names an interpreter that has the
//! packages of `python-can.txt`.

use std::env;
use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};
use std::thread;

/// The program that puts a device on a bus.
pub(crate) const SCRIPT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/python_can.py");

/// The program that puts a device in Python on pipes.
const PIPES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/python_pipes.py");

/// A device that ends with the test.
pub(crate) struct Served(Child);

impl Drop for Served {
    fn drop(&mut self) {
        // It may have ended by itself.
        _ = self.0.kill();
        _ = self.0.wait();
    }
}

/// The command line of a reference device on pipes.
pub(crate) fn device(arguments: &str) -> String {
    format!("{} serve {arguments} --stdio", env!("CARGO_BIN_EXE_harness"))
}

/// A reference device on a bus that several programs of this machine share, and that echoes without
/// being told; the target. Tests that run side by side have each a bus of their own.
pub(crate) fn on_multicast(place: u8, arguments: &str) -> (Served, String) {
    let bus = multicast(place);
    let mut command = program(SCRIPT, &bus);
    command.env("DEVICE", device(arguments));
    let mut served = command.stdout(Stdio::piped()).spawn().expect("there is Python");
    let mut frames = BufReader::new(served.stdout.take().expect("it is a pipe")).lines();
    frames.next().expect("the device boots up").expect("it is text");
    thread::spawn(move || frames.for_each(drop));
    (Served(served), format!("python-can:{bus}"))
}

/// A device in Python, which may not be there yet, on such a bus; the target.
pub(crate) fn of_others_on_multicast(place: u8, script: &str) -> (Served, String) {
    let bus = multicast(place);
    let served = program(script, &bus).spawn().expect("there is Python");
    (Served(served), format!("python-can:{bus}"))
}

/// A device in Python on pipes.
pub(crate) fn of_others_on_pipes(script: &str) -> Command {
    let mut command = program(PIPES, "virtual:bench");
    command.arg(script);
    command
}

fn multicast(place: u8) -> String {
    let [_, third, fourth, ..] = std::process::id().to_be_bytes();
    format!("udp_multicast:239.{third}.{fourth}.{place}")
}

fn program(script: &str, bus: &str) -> Command {
    let python = env::var("PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let mut command = Command::new(python);
    command.arg(script).env("BUS", bus);
    command
}
