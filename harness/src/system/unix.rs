//! Linux, macOS and other systems of that family.

use std::env;
use std::fs::{self, OpenOptions, TryLockError};
use std::io::{self, IsTerminal};
use std::os::fd::OwnedFd;
use std::os::unix::fs::{FileTypeExt, OpenOptionsExt, PermissionsExt};
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus};
use std::thread;

use nix::errno::Errno;
use nix::libc;
use nix::sys::signal::{Signal, kill, killpg};
use nix::unistd::Pid;
use serial2::SerialPort;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::iterator::Signals;

pub(crate) use std::os::unix::net::{UnixListener, UnixStream};

/// How Python is usually called.
pub(crate) const PYTHON: &str = "python3";

/// A program with whatever it has started.
#[derive(Debug)]
pub(crate) struct Group(Pid);

/// Starts a program in a group of its own: what it starts ends with it, and Ctrl-C reaches only
/// the harness.
///
/// # Errors
/// Whatever the system says.
pub(crate) fn start(command: &mut Command) -> io::Result<(Child, Group)> {
    let child = command.process_group(0).spawn()?;
    let group = Group(Pid::from_raw(child.id().cast_signed()));
    Ok((child, group))
}

impl Group {
    /// Asks all of it to end; it may have ended by itself.
    pub(crate) fn ask_to_end(&self) {
        _ = killpg(self.0, Signal::SIGTERM);
    }

    /// Ends all of it; it may have ended by itself.
    pub(crate) fn end(&self) {
        _ = killpg(self.0, Signal::SIGKILL);
    }
}

/// The signal that ended a program.
pub(crate) fn ended_by(status: ExitStatus) -> Option<String> {
    let signal = status.signal()?;
    Some(match Signal::try_from(signal) {
        Ok(signal) => signal.to_string(),
        Err(_) => format!("signal {signal}"),
    })
}

/// The words for what goes wrong: those of the system.
pub(crate) fn words_of(_kind: io::ErrorKind) -> Option<&'static str> {
    None
}

/// Whether there is such a process.
pub(crate) fn is_running(process: u32) -> bool {
    let known = i32::try_from(process).map(|process| kill(Pid::from_raw(process), None));
    matches!(known, Ok(Ok(()) | Err(Errno::EPERM)))
}

/// Whether a file can be started.
pub(crate) fn is_program(file: &fs::Metadata, _path: &Path) -> bool {
    file.permissions().mode() & 0o111 != 0
}

/// The sentence for a file that cannot be started.
pub(crate) fn no_program(path: &Path) -> String {
    let name = path.display();
    format!("{name} is not a program: `chmod +x {name}` makes it one")
}

/// Whether there is a socket, whoever listens at it.
pub(crate) fn is_socket(path: &Path) -> bool {
    fs::symlink_metadata(path).is_ok_and(|found| found.file_type().is_socket())
}

/// Where a program keeps what it must not forget: `$XDG_STATE_HOME`, or where that is not set,
/// `~/.local/state`.
///
/// # Errors
/// A user without either has no place that is the user's own.
pub(crate) fn state_folder() -> Result<PathBuf, &'static str> {
    let state = env::var_os("XDG_STATE_HOME").map(PathBuf::from);
    let home = || Some(PathBuf::from(env::var_os("HOME")?).join(".local/state"));
    let state = state.filter(|path| path.is_absolute()).or_else(home);
    state.ok_or("neither XDG_STATE_HOME nor HOME is set")
}

/// Calls `wished` whenever the user wishes the program to end, from now on. A SIGHUP that was
/// ignored from the start, as by `nohup`, stays ignored.
///
/// # Errors
/// Whatever the system says. A signal then ends the process at once.
pub(crate) fn heed(mut wished: impl FnMut() + Send + 'static) -> io::Result<()> {
    let hang_up = Some(SIGHUP).filter(|_| !ignores_hang_up());
    let mut signals = Signals::new([SIGINT, SIGTERM].into_iter().chain(hang_up))?;
    thread::spawn(move || signals.forever().for_each(|_| wished()));
    Ok(())
}

/// Whether the program was started to outlive the terminal. Only Linux says so.
fn ignores_hang_up() -> bool {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let ignored = ignored.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    ignored.is_some_and(|mask| mask & 1 << (SIGHUP - 1) != 0)
}

/// Opens a serial line for 8 data bits without parity, at `speed` in bit/s, and keeps others away
/// from it.
///
/// # Errors
/// Whatever the system says.
pub(crate) fn serial_line(path: &Path, speed: u32) -> io::Result<SerialPort> {
    // Without O_NONBLOCK, opening waits for a carrier that such a line may not have.
    let flags = libc::O_NOCTTY | libc::O_NONBLOCK;
    let file = OpenOptions::new().read(true).write(true).custom_flags(flags).open(path)?;
    if !file.is_terminal() {
        return Err(Errno::ENOTTY.into());
    }
    file.try_lock().map_err(|why| match why {
        TryLockError::WouldBlock => Errno::EBUSY.into(),
        TryLockError::Error(why) => why,
    })?;
    let mut line = SerialPort::from(OwnedFd::from(file));
    let mut settings = line.get_configuration()?;
    settings.set_raw();
    settings.set_baud_rate(speed)?;
    settings.as_termios_mut().c_cflag |= libc::CLOCAL | libc::CREAD;
    line.set_configuration(&settings)?;
    Ok(line)
}

/// Why a serial line was not opened, and what to do about it.
pub(crate) fn line_not_opened(path: &Path, why: &io::Error) -> String {
    let name = path.display();
    match Errno::from_raw(why.raw_os_error().unwrap_or(0)) {
        Errno::ENOENT | Errno::ENXIO | Errno::ENODEV => format!(
            "there is no {name}: is the adapter plugged in? `harness scan --adapters` lists those \
             that are there"
        ),
        Errno::EACCES => format!(
            "{name} may not be opened by this user: `sudo usermod -a -G dialout $USER`, and log \
             in again"
        ),
        Errno::EBUSY => format!(
            "{name} is in use by another program, such as slcand or ModemManager: `fuser {name}` \
             tells its process"
        ),
        Errno::ENOTTY | Errno::EISDIR => format!("{name} is not a serial line"),
        _ => format!("cannot open {name}: {why}"),
    }
}

/// Serial lines that may be adapters, as macOS names them. What Linux has is in its folders.
pub(crate) fn serial_lines() -> Vec<String> {
    let names = SerialPort::available_ports().unwrap_or_default().into_iter();
    let names = names.map(|path| path.display().to_string());
    names.filter(|name| name.starts_with("/dev/cu.usb")).collect()
}

#[cfg(test)]
mod tests {
    use std::process::Stdio;

    use super::*;

    #[test]
    fn a_line_that_may_not_be_opened_says_how_it_may() {
        let denied = line_not_opened(Path::new("/dev/ttyACM0"), &Errno::EACCES.into());
        assert!(denied.contains("dialout"), "{denied}");
    }

    #[test]
    fn a_process_is_running_until_it_was_waited_for() {
        // Its input stays open, so that it does not end by itself.
        let (mut child, group) = start(Command::new("cat").stdin(Stdio::piped())).unwrap();
        assert!(is_running(child.id()));
        group.end();
        assert_eq!(ended_by(child.wait().unwrap()).as_deref(), Some("SIGKILL"));
        assert!(!is_running(child.id()));
        assert!(!is_running(u32::MAX));
    }
}
