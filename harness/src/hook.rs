//! The user's programs for bringing a device back.

use std::io;
use std::path::PathBuf;
use std::process::{Child, ExitStatus, Stdio};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread;
use std::time::Duration;

use canopen::BusError;
use runner::dut::{Hook, Look};

use crate::command_line::CommandLine;
use crate::files::words;
use crate::system::{self, Group};

/// How long a program may take.
const LIMIT: Duration = Duration::from_secs(60);
/// The interval at which the bus is polled in the meantime, which notices an interruption.
const TURN: Duration = Duration::from_millis(100);

/// A program by its command line, and where it runs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Program {
    /// As the user writes it.
    pub command: String,
    /// The folder that its path and its arguments are relative to.
    pub folder: PathBuf,
}

impl Hook for Program {
    fn name(&self) -> &str {
        &self.command
    }

    fn call(&self, argument: Option<&str>, look: Look) -> Result<Result<(), String>, BusError> {
        match start(self, argument) {
            Ok((child, group)) => end(child, &group, look),
            Err(error) => Ok(Err(words(&error))),
        }
    }
}

/// Its path and its arguments are relative to the folder of the device file.
fn start(hook: &Program, argument: Option<&str>) -> io::Result<(Child, Group)> {
    let line = CommandLine::parse_in(&hook.folder, &hook.command).map_err(io::Error::other)?;
    let mut command = line.command(&hook.folder).map_err(io::Error::other)?;
    system::start(command.args(argument).stdin(Stdio::null()).stdout(Stdio::null()))
}

/// Waits for it; why it failed, if it did.
fn end(mut child: Child, group: &Group, look: Look) -> Result<Result<(), String>, BusError> {
    let (sender, ended) = mpsc::channel();
    thread::spawn(move || _ = sender.send(child.wait()));
    for _ in 0..LIMIT.as_millis() / TURN.as_millis() {
        match ended.recv_timeout(TURN) {
            Ok(status) => return Ok(status.map_err(|error| words(&error)).and_then(succeeded)),
            Err(RecvTimeoutError::Disconnected) => break,
            Err(RecvTimeoutError::Timeout) => {
                if let Err(error) = look() {
                    group.end();
                    return Err(error);
                }
            }
        }
    }
    group.end();
    Ok(Err(format!("it did not end within {} s", LIMIT.as_secs())))
}

fn succeeded(status: ExitStatus) -> Result<(), String> {
    if status.success() { Ok(()) } else { Err(status.to_string()) }
}
