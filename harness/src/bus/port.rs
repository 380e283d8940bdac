//! Serial lines and TCP connections, as a pair of pipes that can be closed while they are waited
//! for.

use std::io::{self, Read, Write};
use std::net::{Shutdown, TcpStream, ToSocketAddrs};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, PoisonError, RwLock};
use std::time::Duration;

use canopen::BusError;
use serial2::SerialPort;

use crate::system;

/// How long a host may take to accept a connection.
const CONNECT: Duration = Duration::from_secs(5);
/// How long a serial line that is closed may be listened to.
const TURN: Duration = Duration::from_millis(20);

/// An open serial line or connection. Clones are the same one.
#[derive(Clone, Debug)]
pub(super) struct Port {
    /// Nothing when it is closed. Whoever reads or writes has it meanwhile.
    way: Arc<RwLock<Option<Way>>>,
    is_closed: Arc<AtomicBool>,
}

#[derive(Debug)]
enum Way {
    Serial(SerialPort),
    Tcp(TcpStream),
}

impl Port {
    /// Opens a serial line for 8 data bits without parity, at `speed` in bit/s.
    ///
    /// # Errors
    /// [`BusError::Open`] with what to do about it.
    pub(super) fn serial(path: &Path, speed: u32) -> Result<Self, BusError> {
        let refused = |why: io::Error| BusError::Open(system::line_not_opened(path, &why));
        if !SPEEDS.contains(&speed) {
            let known = SPEEDS.map(|speed| speed.to_string()).join(", ");
            return Err(BusError::Open(format!("serial lines have no speed {speed}: {known}")));
        }
        let mut line = system::serial_line(path, speed).map_err(refused)?;
        line.set_read_timeout(TURN)
            .and_then(|()| line.set_write_timeout(TURN))
            .and_then(|()| line.discard_buffers())
            .map_err(refused)?;
        Ok(Self::new(Way::Serial(line)))
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
                    return Ok(Self::new(Way::Tcp(stream)));
                }
                Err(why) => last = Some(why),
            }
        }
        Err(refused(last.unwrap_or_else(|| io::ErrorKind::NotFound.into())))
    }

    fn new(way: Way) -> Self {
        Self { way: Arc::new(RwLock::new(Some(way))), is_closed: Arc::default() }
    }

    /// Ends every wait on it, so that others may open it.
    pub(super) fn close(&self) {
        self.is_closed.store(true, Ordering::SeqCst);
        if let Some(Way::Tcp(stream)) = &*self.way.read().unwrap_or_else(PoisonError::into_inner) {
            // The other end may have closed it.
            _ = stream.shutdown(Shutdown::Both);
        }
        *self.way.write().unwrap_or_else(PoisonError::into_inner) = None;
    }

    /// Does what may have to wait, until it is closed.
    fn patiently(&self, mut act: impl FnMut(&Way) -> io::Result<usize>) -> io::Result<usize> {
        while !self.is_closed.load(Ordering::SeqCst) {
            let way = self.way.read().unwrap_or_else(PoisonError::into_inner);
            let Some(way) = &*way else { break };
            match act(way) {
                Err(why) if why.kind() == io::ErrorKind::TimedOut => {}
                _ if self.is_closed.load(Ordering::SeqCst) => break,
                done => return done,
            }
        }
        Err(io::ErrorKind::NotConnected.into())
    }
}

impl Read for Port {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        self.patiently(|way| match way {
            Way::Serial(line) => line.read(into),
            Way::Tcp(stream) => (&mut &*stream).read(into),
        })
    }
}

impl Write for Port {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.patiently(|way| match way {
            Way::Serial(line) => line.write(bytes),
            Way::Tcp(stream) => (&mut &*stream).write(bytes),
        })
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// The speeds of serial lines in bit/s. A line over USB has no speed, whatever is set.
const SPEEDS: [u32; 14] = [
    2_400, 4_800, 9_600, 19_200, 38_400, 57_600, 115_200, 230_400, 460_800, 500_000, 921_600,
    1_000_000, 2_000_000, 3_000_000,
];

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg(unix)]
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
