//! An interface of another machine, which socketcand offers over TCP, in its mode without filters.
//!
//! The server sends no echo of own frames. It handles commands in their order, so the answer to an
//! `echo` after a frame says that it has handed the frame to its kernel.

mod codec;

use std::fmt;
use std::str::FromStr;
use std::time::Duration;

use canopen::{Bus, BusError, Frame, Instant, Stamped};
use runner::stop::Stop;

use super::echo::Echoes;
use super::far_clock::FarClock;
use super::lines::{Clock, Ending, Inbox, Lines, Speech, quoted};
use super::names;
use super::port::Port;
use codec::Message;

/// An interface and its server, as `socketcand://host:29536/can0`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Socketcand {
    /// The server, as `host:port`.
    host: String,
    /// The name of the interface there.
    interface: String,
}

/// The port of servers that are not told another one.
const PORT: u16 = 29536;
/// How long the server may take for an answer.
const PATIENCE: Duration = Duration::from_secs(5);
/// How long it may take for one that not every server gives.
const SHORT_PATIENCE: Duration = Duration::from_millis(500);

impl Socketcand {
    /// Connects to the server and opens the interface.
    ///
    /// # Errors
    /// [`BusError::Open`] with what to do about it.
    pub(super) fn open(&self, stop: &Stop) -> Result<Connection, BusError> {
        let interface = &self.interface;
        let start = format!("`socketcand -i {interface}` there starts the server");
        Connection::on(self.clone(), Port::tcp(&self.host, &start)?, stop)
    }

    /// Whether the interface has no wire.
    pub(super) fn is_virtual(&self) -> bool {
        names::is_virtual(&self.interface)
    }

    /// Whether the server is on this machine.
    pub(super) fn is_on_this_machine(&self) -> bool {
        names::is_this_machine(&self.host)
    }
}

impl fmt::Display for Socketcand {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "//{}/{}", self.host, self.interface)
    }
}

impl FromStr for Socketcand {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts = text.strip_prefix("//").and_then(|text| text.split_once('/'));
        let parts = parts.filter(|(host, name)| !host.is_empty() && super::is_name(name));
        let (host, interface) =
            parts.ok_or("an interface of socketcand is `socketcand://host:29536/can0`")?;
        // An address of IPv6 has colons inside brackets.
        let has_port = host.rsplit_once(':').is_some_and(|(_, port)| !port.ends_with(']'));
        let host = if has_port { host.to_owned() } else { format!("{host}:{PORT}") };
        Ok(Self { host, interface: interface.to_owned() })
    }
}

/// An open interface of a server.
#[derive(Debug)]
pub(super) struct Connection {
    to: Socketcand,
    port: Port,
    lines: Lines<Words>,
    echoes: bool,
}

impl Connection {
    fn on(to: Socketcand, port: Port, stop: &Stop) -> Result<Self, BusError> {
        let (clock, stop) = (Clock::start(), stop.clone());
        let lines = Lines::new(port.clone(), port.clone(), clock, stop, Words::new(to.to_string()));
        let mut connection = Self { to, port, lines, echoes: false };
        connection.set_up()?;
        Ok(connection)
    }

    fn set_up(&mut self) -> Result<(), BusError> {
        self.expect(Message::Hi, PATIENCE)?;
        self.ask(&format!("< open {} >", self.to.interface), Message::Ok, PATIENCE)?;
        self.ask("< rawmode >", Message::Ok, PATIENCE)?;
        // Servers in adapters do not all know it.
        self.echoes = match self.ask("< echo >", Message::Echo, SHORT_PATIENCE) {
            Ok(()) => true,
            Err(BusError::Open(_)) => false,
            Err(why) => return Err(why),
        };
        self.lines.speech().echoes = Echoes::new(self.echoes);
        self.lines.speech().asks = self.echoes;
        Ok(())
    }

    fn ask(&mut self, what: &str, answer: Message, patience: Duration) -> Result<(), BusError> {
        self.lines.write(what).map_err(|why| self.fails(&why))?;
        self.expect(answer, patience)
    }

    /// Waits for a message. Frames before it are not of interest.
    fn expect(&mut self, wanted: Message, patience: Duration) -> Result<(), BusError> {
        let Socketcand { host, interface } = &self.to.clone();
        let until = self.lines.now() + patience;
        loop {
            let came = match self.lines.message(until)? {
                Ok(came) => came,
                Err(Ending::Closed) => {
                    return Err(BusError::Open(format!(
                        "{host} closed the connection before {interface} was open"
                    )));
                }
                Err(ending) => return Err(self.gone(&ending)),
            };
            let Some(message) = came else {
                return Err(BusError::Open(format!(
                    "{host} does not speak as socketcand does: is this its port?"
                )));
            };
            match codec::parse(&message) {
                Ok(message) if message == wanted => return Ok(()),
                Ok(Message::Error(why)) => {
                    return Err(BusError::Open(format!(
                        "socketcand on {host} does not open {interface}: {why}. Is it up there, \
                         and among those of its option: `socketcand -i {interface}`?"
                    )));
                }
                Ok(Message::Frame(..) | Message::ErrorFrame(_)) => {}
                Ok(_) | Err(_) => {
                    let text = quoted(&message);
                    return Err(BusError::Open(format!(
                        "{host} does not speak as socketcand does, it says `{text}`: is this its \
                         port?"
                    )));
                }
            }
        }
    }

    fn fails(&self, why: &str) -> BusError {
        BusError::Io(format!("socketcand on {} {why}", self.to.host))
    }

    fn gone(&self, ending: &Ending) -> BusError {
        let Socketcand { host, interface } = &self.to;
        BusError::Io(match ending {
            Ending::Closed => format!(
                "socketcand on {host} closed the connection: is {interface} still up there, and \
                 the network in order?"
            ),
            Ending::Garbage(what) => format!("{host} sent {what}: is this the port of socketcand?"),
        })
    }
}

impl Drop for Connection {
    fn drop(&mut self) {
        self.lines.close("");
        self.port.close();
    }
}

impl Bus for Connection {
    fn is_real(&self) -> bool {
        true
    }

    fn now(&mut self) -> Instant {
        self.lines.now()
    }

    /// # Errors
    /// [`BusError::Io`] when the server does not read what it is sent.
    fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
        self.lines.send(frame).map_err(|why| self.fails(&why))
    }

    /// # Errors
    /// [`BusError::Controller`] for an error frame and for what the server refuses,
    /// [`BusError::Lost`] when a message is garbled, [`BusError::Io`] when the connection is gone,
    /// [`BusError::Interrupted`].
    fn recv(&mut self, until: Instant) -> Result<Option<Stamped>, BusError> {
        self.lines.recv(until)?.map_err(|ending| self.gone(&ending))
    }

    fn remark(&self) -> Option<String> {
        let sent = match self.echoes {
            true => "that at which the server said that it had taken them",
            false => "that at which they were written, since the server does not answer to `echo`",
        };
        Some(format!("frames heard have the time stamps of the server, frames sent {sent}"))
    }
}

/// What is known of the conversation with a server.
#[derive(Debug)]
struct Words {
    name: String,
    echoes: Echoes,
    /// Whether an `echo` is asked for after each frame.
    asks: bool,
    clock: FarClock,
}

impl Words {
    const fn new(name: String) -> Self {
        let clock = FarClock::new(Duration::from_micros(1));
        Self { name, echoes: Echoes::new(false), asks: false, clock }
    }
}

impl Speech for Words {
    const LONGEST: usize = 4096;

    fn ends(message: &[u8]) -> bool {
        message.ends_with(&[codec::END])
    }

    fn send(&mut self, now: Instant, frame: &Frame, inbox: &mut Inbox) -> Vec<u8> {
        self.echoes.sent(now, *frame, inbox);
        let message = codec::message(frame);
        if self.asks { message + "< echo >" } else { message }.into()
    }

    fn take(&mut self, at: Instant, message: &[u8], inbox: &mut Inbox) -> Result<(), Ending> {
        match codec::parse(message) {
            Ok(Message::Frame(frame, stamp)) => {
                let at = self.clock.time(at, stamp);
                self.echoes.precede(at, inbox);
                inbox.heard(at, frame);
            }
            Ok(Message::Echo) => self.echoes.confirmed(at, inbox),
            Ok(Message::ErrorFrame(class)) => {
                if let Some(trouble) = super::trouble::of(class, None) {
                    inbox.fault(BusError::Controller(trouble));
                }
            }
            Ok(Message::Error(why)) => {
                let name = &self.name;
                inbox.fault(BusError::Controller(format!(
                    "through socketcand:{name}: {why}; servers do not all send remote frames"
                )));
            }
            Ok(Message::Hi | Message::Ok) => {}
            Err(why) => {
                let text = quoted(message);
                inbox.fault(BusError::Lost(format!(
                    "socketcand:{} sent `{text}`, which is no frame: {why}",
                    self.name
                )));
            }
        }
        Ok(())
    }

    fn due(&mut self, now: Instant, inbox: &mut Inbox) -> Option<Vec<u8>> {
        _ = self.echoes.give_up(now, inbox);
        None
    }
}
