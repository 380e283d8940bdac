//! Serial lines and TCP connections, as a pair of pipes that can be closed while they are waited
//! for.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use canopen::BusError;
use nix::errno::Errno;
use nix::libc;
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use nix::sys::termios::{
    BaudRate, ControlFlags, FlushArg, SetArg, cfmakeraw, cfsetspeed, tcflush, tcgetattr, tcsetattr,
};

use super::bell::Bell;

/// How long a host may take to accept a connection.
const CONNECT: Duration = Duration::from_secs(5);

/// An open serial line or connection. Clones are the same one.
#[derive(Clone, Debug)]
pub(super) struct Port {
    file: Arc<File>,
    is_closed: Arc<AtomicBool>,
    bell: Bell,
}

impl Port {
    /// Opens a serial line for 8 data bits without parity, at `speed` in bit/s.
    ///
    /// # Errors
    /// [`BusError::Open`] with what to do about it.
    pub(super) fn serial(path: &Path, speed: u32) -> Result<Self, BusError> {
        let refused = |why: io::Error| BusError::Open(not_opened(path, &why));
        let rate = SPEEDS.iter().find(|(known, _)| *known == speed).map(|(_, rate)| *rate);
        let rate = rate.ok_or_else(|| {
            let known: Vec<String> = SPEEDS.iter().map(|(speed, _)| speed.to_string()).collect();
            BusError::Open(format!("serial lines have no speed {speed}: {}", known.join(", ")))
        })?;
        // Without O_NONBLOCK, opening waits for a carrier that such a line may not have.
        let flags = libc::O_NOCTTY | libc::O_NONBLOCK;
        let file = OpenOptions::new().read(true).write(true).custom_flags(flags).open(path);
        let file = file.map_err(refused)?;
        let mut settings = tcgetattr(&file).map_err(|why| refused(why.into()))?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Err(refused(Errno::EBUSY.into())),
            Err(TryLockError::Error(why)) => return Err(refused(why)),
        }
        cfmakeraw(&mut settings);
        settings.control_flags |= ControlFlags::CLOCAL | ControlFlags::CREAD;
        settings.control_flags -= ControlFlags::CSTOPB | ControlFlags::CRTSCTS;
        cfsetspeed(&mut settings, rate)
            .and_then(|()| tcsetattr(&file, SetArg::TCSANOW, &settings))
            .and_then(|()| tcflush(&file, FlushArg::TCIOFLUSH))
            .map_err(|why| refused(why.into()))?;
        Self::new(file).map_err(refused)
    }

    /// Connects to `host`, which has the form `host:port`.
    ///
    /// # Errors
    /// [`BusError::Open`] with what to do about it; `is_there` says what should be there.
    pub(super) fn tcp(host: &str, is_there: &str) -> Result<Self, BusError> {
        let refused = |why: io::Error| BusError::Open(not_reached(host, &why, is_there));
        let mut last = None;
        for address in host.to_socket_addrs().map_err(refused)? {
            match TcpStream::connect_timeout(&address, CONNECT) {
                Ok(stream) => {
                    stream.set_nodelay(true).map_err(refused)?;
                    stream.set_nonblocking(true).map_err(refused)?;
                    return Self::new(File::from(OwnedFd::from(stream))).map_err(refused);
                }
                Err(why) => last = Some(why),
            }
        }
        Err(refused(last.unwrap_or_else(|| io::ErrorKind::NotFound.into())))
    }

    fn new(file: File) -> io::Result<Self> {
        Ok(Self { file: Arc::new(file), is_closed: Arc::default(), bell: Bell::new()? })
    }

    /// Ends every wait on it, so that others may open it.
    pub(super) fn close(&self) {
        self.is_closed.store(true, Ordering::SeqCst);
        self.bell.ring();
        // One that is not locked needs no unlocking.
        _ = self.file.unlock();
    }

    /// Waits until it can be read or written.
    fn wait(&self, what: PollFlags) -> io::Result<()> {
        let port = PollFd::new(self.file.as_fd(), what);
        let bell = PollFd::new(self.bell.as_fd(), PollFlags::POLLIN);
        match poll(&mut [port, bell], PollTimeout::NONE) {
            Ok(_) | Err(Errno::EINTR) if !self.is_closed.load(Ordering::SeqCst) => Ok(()),
            Ok(_) | Err(Errno::EINTR) => Err(io::ErrorKind::NotConnected.into()),
            Err(why) => Err(why.into()),
        }
    }

    /// Does what may have to wait.
    fn patiently<T>(
        &self,
        what: PollFlags,
        mut act: impl FnMut(&File) -> io::Result<T>,
    ) -> io::Result<T> {
        loop {
            match act(&self.file) {
                Err(why) if why.kind() == io::ErrorKind::WouldBlock => self.wait(what)?,
                done => return done,
            }
        }
    }
}

impl Read for Port {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        self.patiently(PollFlags::POLLIN, |mut file| file.read(into))
    }
}

impl Write for Port {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.patiently(PollFlags::POLLOUT, |mut file| file.write(bytes))
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// The speeds of serial lines in bit/s. A line over USB has no speed, whatever is set.
const SPEEDS: [(u32, BaudRate); 14] = [
    (2_400, BaudRate::B2400),
    (4_800, BaudRate::B4800),
    (9_600, BaudRate::B9600),
    (19_200, BaudRate::B19200),
    (38_400, BaudRate::B38400),
    (57_600, BaudRate::B57600),
    (115_200, BaudRate::B115200),
    (230_400, BaudRate::B230400),
    (460_800, BaudRate::B460800),
    (500_000, BaudRate::B500000),
    (921_600, BaudRate::B921600),
    (1_000_000, BaudRate::B1000000),
    (2_000_000, BaudRate::B2000000),
    (3_000_000, BaudRate::B3000000),
];

fn not_opened(path: &Path, why: &io::Error) -> String {
    let name = path.display();
    match errno(why) {
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

fn not_reached(host: &str, why: &io::Error, is_there: &str) -> String {
    match why.kind() {
        io::ErrorKind::ConnectionRefused => {
            format!("{host} takes no connection: {is_there}")
        }
        io::ErrorKind::TimedOut => {
            format!("{host} does not answer: is it switched on and on this network? {is_there}")
        }
        _ => format!("cannot connect to {host}: {why}"),
    }
}

/// The error of the operating system; 0, which is none, when it comes from elsewhere.
fn errno(why: &io::Error) -> Errno {
    Errno::from_raw(why.raw_os_error().unwrap_or(0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_that_cannot_be_opened_says_what_to_do() {
        let open =
            |path: &str, speed| Port::serial(Path::new(path), speed).unwrap_err().to_string();
        for (path, speed, part) in [
            ("/dev/no-such-adapter", 115_200, "is the adapter plugged in?"),
            ("/dev/null", 115_200, "/dev/null is not a serial line"),
            ("/dev", 115_200, "/dev is not a serial line"),
            ("/dev/null", 12_345, "serial lines have no speed 12345: 2400, 4800"),
        ] {
            let said = open(path, speed);
            assert!(said.contains(part), "{said}");
        }
        let denied = not_opened(Path::new("/dev/ttyACM0"), &Errno::EACCES.into());
        assert!(denied.contains("dialout"), "{denied}");
    }

    #[test]
    fn a_host_that_is_not_reached_says_what_to_do() {
        let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        let host = listener.local_addr().unwrap().to_string();
        drop(listener);
        let said = Port::tcp(&host, "start it").unwrap_err().to_string();
        assert_eq!(said, format!("{host} takes no connection: start it"));
        let said = Port::tcp("no port", "start it").unwrap_err().to_string();
        assert!(said.starts_with("cannot connect to no port: "), "{said}");
    }

    #[test]
    fn closing_ends_a_wait() {
        let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        let host = listener.local_addr().unwrap().to_string();
        let port = Port::tcp(&host, "").unwrap();
        let mut waiting = port.clone();
        let waits = std::thread::spawn(move || waiting.read(&mut [0; 8]).unwrap_err().kind());
        port.close();
        assert_eq!(waits.join().unwrap(), io::ErrorKind::NotConnected);
    }
}
