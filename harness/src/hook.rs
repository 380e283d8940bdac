//! Programs of the user's that bring a device back.

use std::os::unix::process::CommandExt;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread;
use std::time::Duration;

use canopen::BusError;
use nix::sys::signal::{Signal, killpg};
use nix::unistd::Pid;
use reports::{Event, Note};

use super::link::Link;
use crate::dut::Hook;
use crate::files::words;

/// How long a program may take.
const LIMIT: Duration = Duration::from_secs(60);
/// How often the bus is looked at meanwhile, which notices an interruption.
const TURN: Duration = Duration::from_millis(100);

/// Runs the program to its end; whether it succeeded. If it did not, the report says why.
///
/// # Errors
/// Whatever the bus reports.
pub(super) fn call(link: &mut Link, hook: &Hook, argument: Option<&str>) -> Result<bool, BusError> {
    let failed = match start(hook, argument) {
        Ok(child) => end(link, child)?,
        Err(error) => Some(words(&error)),
    };
    link.moved();
    let Some(why) = failed else { return Ok(true) };
    let text = format!("the program `{}` failed: {why}", hook.command);
    link.emit(Event::Note(Note { at: link.mark(), text }));
    Ok(false)
}

/// Its path and its arguments are relative to the folder of the device file.
fn start(hook: &Hook, argument: Option<&str>) -> std::io::Result<Child> {
    let mut words = hook.command.split_whitespace();
    let program = words.next().unwrap_or_default();
    let path = match program.contains('/') {
        true => hook.folder.join(program),
        false => program.into(),
    };
    let folder = if hook.folder.as_os_str().is_empty() { ".".as_ref() } else { &*hook.folder };
    Command::new(path.canonicalize().unwrap_or(path))
        .args(words)
        .args(argument)
        .current_dir(folder)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        // What it starts ends with it, and Ctrl-C is the harness's to handle.
        .process_group(0)
        .spawn()
}

/// Waits for it; why it failed, if it did.
fn end(link: &mut Link, mut child: Child) -> Result<Option<String>, BusError> {
    let group = Pid::from_raw(child.id().cast_signed());
    let (sender, ended) = mpsc::channel();
    thread::spawn(move || _ = sender.send(child.wait()));
    // The group may have ended by itself.
    let kill = || _ = killpg(group, Signal::SIGKILL);
    for _ in 0..LIMIT.as_millis() / TURN.as_millis() {
        match ended.recv_timeout(TURN) {
            Ok(status) => return Ok(status.map_or_else(|error| Some(words(&error)), said)),
            Err(RecvTimeoutError::Disconnected) => break,
            Err(RecvTimeoutError::Timeout) => {
                if let Err(error) = link.look_from_now() {
                    kill();
                    return Err(error);
                }
            }
        }
    }
    kill();
    Ok(Some(format!("it did not end within {} s", LIMIT.as_secs())))
}

fn said(status: ExitStatus) -> Option<String> {
    (!status.success()).then(|| status.to_string())
}
