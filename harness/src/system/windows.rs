//! Windows.

use std::env;
use std::fs;
use std::io;
use std::os::windows::fs::MetadataExt;
use std::os::windows::io::AsRawHandle;
use std::os::windows::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus};
use std::sync::{Mutex, PoisonError};

use serial2::SerialPort;
use win32job::{ExtendedLimitInfo, Job};

pub(crate) use uds_windows::{UnixListener, UnixStream};

/// How Python is usually called.
pub(crate) const PYTHON: &str = "python";

/// A program with whatever it has started, until it was ended.
#[derive(Debug)]
pub(crate) struct Group(Mutex<Option<Job>>);

/// In `winbase.h`, CREATE_NEW_PROCESS_GROUP: Ctrl-C does not reach the program.
const GROUP_OF_ITS_OWN: u32 = 0x0000_0200;
/// In `winnt.h`, FILE_ATTRIBUTE_REPARSE_POINT, which a socket has.
const REPARSE_POINT: u32 = 0x0000_0400;

/// Starts a program in a group of its own: what it starts ends with it, and Ctrl-C reaches only
/// the harness. It ends with the harness, too.
///
/// # Errors
/// Whatever the system says.
pub(crate) fn start(command: &mut Command) -> io::Result<(Child, Group)> {
    let mut limits = ExtendedLimitInfo::new();
    limits.limit_kill_on_job_close();
    let job = Job::create_with_limit_info(&limits).map_err(io::Error::other)?;
    let mut child = command.creation_flags(GROUP_OF_ITS_OWN).spawn()?;
    let joined = job.assign_process(child.as_raw_handle() as isize);
    // A program that has ended already joins nothing.
    match joined {
        Err(why) if matches!(child.try_wait(), Ok(None)) => {
            child.kill()?;
            Err(io::Error::other(why))
        }
        Ok(()) | Err(_) => Ok((child, Group(Mutex::new(Some(job))))),
    }
}

impl Group {
    /// Asks all of it to end. There is no signal for that: the end of standard input is one.
    pub(crate) fn ask_to_end(&self) {}

    /// Ends all of it; it may have ended by itself.
    pub(crate) fn end(&self) {
        // Its programs end when nobody holds the job.
        drop(self.0.lock().unwrap_or_else(PoisonError::into_inner).take());
    }
}

impl Drop for Group {
    /// Lets go on what was not ended, such as what a hook left in the background.
    fn drop(&mut self) {
        if let Some(job) = self.0.get_mut().unwrap_or_else(PoisonError::into_inner).take() {
            // One that cannot be changed ends its programs.
            _ = job.set_extended_limit_info(&ExtendedLimitInfo::new());
        }
    }
}

/// The signal that ended a program: there are none.
pub(crate) fn ended_by(_status: ExitStatus) -> Option<String> {
    None
}

/// The words for what goes wrong with files and connections, as other systems say them. Windows
/// says them in the language of its user.
pub(crate) fn words_of(kind: io::ErrorKind) -> Option<&'static str> {
    use io::ErrorKind as Kind;
    let words = match kind {
        Kind::NotFound => "No such file or directory",
        Kind::PermissionDenied => "Permission denied",
        Kind::AlreadyExists => "File exists",
        Kind::NotADirectory => "Not a directory",
        Kind::DirectoryNotEmpty => "Directory not empty",
        Kind::StorageFull => "No space left on device",
        Kind::BrokenPipe => "Broken pipe",
        Kind::ConnectionRefused => "Connection refused",
        Kind::ConnectionReset => "Connection reset by peer",
        Kind::AddrInUse => "Address already in use",
        Kind::TimedOut => "Connection timed out",
        _ => return None,
    };
    Some(words)
}

/// Whether there is such a process.
pub(crate) fn is_running(process: u32) -> bool {
    process_alive::state(process.into()).is_alive()
}

/// Whether a file can be started.
pub(crate) fn is_program(file: &fs::Metadata, path: &Path) -> bool {
    let ending = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    file.is_file() && PROGRAMS.contains(&&*ending)
}

/// How the names of files end that the system starts.
const PROGRAMS: [&str; 4] = ["exe", "com", "bat", "cmd"];

/// The sentence for a file that cannot be started.
pub(crate) fn no_program(path: &Path) -> String {
    format!("{} is not a program: the name of one ends with .exe, .bat or .cmd", path.display())
}

/// Whether there is a socket, whoever listens at it.
pub(crate) fn is_socket(path: &Path) -> bool {
    fs::symlink_metadata(path).is_ok_and(|found| {
        found.file_attributes() & REPARSE_POINT != 0 && !found.is_symlink() && !found.is_dir()
    })
}

/// Where a program keeps what it must not forget: `$XDG_STATE_HOME`, as elsewhere, or where that is
/// not set, the folder for data of programs.
///
/// # Errors
/// A user without either has no place that is the user's own.
pub(crate) fn state_folder() -> Result<PathBuf, &'static str> {
    let folder = |name| env::var_os(name).map(PathBuf::from).filter(|path| path.is_absolute());
    let state = folder("XDG_STATE_HOME").or_else(|| folder("LOCALAPPDATA"));
    state.ok_or("neither XDG_STATE_HOME nor LOCALAPPDATA is set")
}

/// Calls `wished` whenever the user wishes the program to end, from now on.
///
/// # Errors
/// Whatever the system says. Ctrl-C then ends the process at once.
pub(crate) fn heed(wished: impl FnMut() + Send + 'static) -> io::Result<()> {
    ctrlc::set_handler(wished).map_err(io::Error::other)
}

/// Opens a serial line for 8 data bits without parity, at `speed` in bit/s. Others are kept away
/// from it.
///
/// # Errors
/// Whatever the system says.
pub(crate) fn serial_line(path: &Path, speed: u32) -> io::Result<SerialPort> {
    let line = SerialPort::open(path, speed)?;
    // Adapters on USB take it for the sign that somebody is there. Not every line has it.
    _ = line.set_dtr(true);
    Ok(line)
}

/// Why a serial line was not opened, and what to do about it.
pub(crate) fn line_not_opened(path: &Path, why: &io::Error) -> String {
    let name = path.display();
    match why.kind() {
        io::ErrorKind::NotFound => format!(
            "there is no {name}: is the adapter plugged in? `harness scan --adapters` lists those \
             that are there"
        ),
        io::ErrorKind::PermissionDenied => format!("{name} is in use by another program"),
        _ => format!("cannot open {name}: {why}"),
    }
}

/// Serial lines that may be adapters.
pub(crate) fn serial_lines() -> Vec<String> {
    let names = SerialPort::available_ports().unwrap_or_default().into_iter();
    names.map(|path| path.display().to_string()).collect()
}

#[cfg(test)]
mod tests {
    use std::process::Stdio;

    use super::*;

    #[test]
    fn a_group_ends_with_what_it_started() {
        let mut command = Command::new("cmd");
        // It waits for a key, and the outer one for it.
        command.args(["/c", "cmd", "/c", "pause"]).stdin(Stdio::piped()).stdout(Stdio::piped());
        let (mut child, group) = start(&mut command).unwrap();
        let no_key = child.stdin.take();
        assert!(is_running(child.id()));
        group.end();
        // It comes back when nobody holds the pipe any more.
        child.wait_with_output().unwrap();
        drop(no_key);
    }

    #[test]
    fn an_error_has_the_same_words_as_elsewhere() {
        let folder = tempfile::tempdir().unwrap();
        let error = fs::read(folder.path().join("none")).unwrap_err();
        assert_eq!(words_of(error.kind()), Some("No such file or directory"));
    }

    #[test]
    fn the_name_of_a_program_says_that_it_is_one() {
        let folder = tempfile::tempdir().unwrap();
        for (name, expected) in [("reset.BAT", true), ("reset.sh", false), ("reset", false)] {
            let path = folder.path().join(name);
            fs::write(&path, "").unwrap();
            assert_eq!(is_program(&fs::metadata(&path).unwrap(), &path), expected, "{name}");
        }
    }
}
