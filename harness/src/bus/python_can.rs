//! Adapters that python-can drives, through a bridge: a program in Python that the harness brings
//! along and starts.
//!
//! Own frames come back where the driver echoes them, which not every driver can be told. So it
//! shows with the first ones: when their echoes do not come, frames are complete when they were
//! handed to the driver.

mod codec;

use std::env;
use std::fmt;
use std::process::{Command, Stdio};
use std::str::FromStr;
use std::time::Duration;

use canopen::{Bus, BusError, Frame, Instant, Stamped};
use runner::stop::Stop;

use super::echo::{Echoes, Refused};
use super::far_clock::FarClock;
use super::lines::{Clock, Ending, Inbox, Lines, Speech, quoted};
use super::names;
use super::program::Process;
use crate::files::words;
use crate::system;
use codec::Message;

/// The bridge, for `python -c`.
const BRIDGE: &str = include_str!("python_can/bridge.py");
/// The environment variable that names the interpreter.
const PYTHON: &str = "PYTHON";
/// How long the bridge may take to load the library and its driver, and to open the adapter.
const START: Duration = Duration::from_secs(30);

/// A bus of python-can, as `python-can:pcan:PCAN_USBBUS1,bitrate=500000`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PythonCan {
    /// The name that python-can has for the kind of adapter.
    interface: String,
    /// Which of them; that of python-can's own configuration when empty.
    channel: String,
    /// What else the driver is told.
    options: Vec<(String, String)>,
}

/// The option with the bit rate in bit/s.
const BIT_RATE: &str = "bitrate";

impl PythonCan {
    /// Starts the bridge.
    ///
    /// # Errors
    /// [`BusError::Open`] with what to do about it.
    pub(super) fn open(&self, stop: &Stop) -> Result<Bridge, BusError> {
        let mut command = python();
        command.arg(&self.interface).arg(&self.channel);
        command.args(self.options.iter().map(|(key, value)| format!("{key}={value}")));
        let (process, mut lines) = start(command, stop, Told::new(self.to_string()))?;
        let until = lines.now() + START;
        while !lines.speech().is_ready {
            let message = match lines.message(until)? {
                Ok(Some(message)) => codec::parse(&message),
                Ok(None) => return Err(self.refused("it does not open within 30 s")),
                Err(_) => return Err(self.refused("the interpreter ended")),
            };
            match message {
                Ok(Message::Ready(version)) => lines.speech().begin(version),
                Ok(Message::Failed(why)) => return Err(self.refused(&why)),
                // Drivers greet their users.
                Ok(_) | Err(_) => {}
            }
        }
        Ok(Bridge { of: self.clone(), lines, _process: process })
    }

    fn refused(&self, why: &str) -> BusError {
        BusError::Open(format!("python-can does not open python-can:{self}: {why}"))
    }

    /// The bit rate of the bus in bit/s, if one is said.
    pub(super) fn bit_rate(&self) -> Option<u32> {
        let said = self.options.iter().find(|(key, _)| key == BIT_RATE);
        said.and_then(|(_, value)| value.parse().ok())
    }

    /// Sets the bit rate of the bus, in bit/s.
    pub(super) fn set_bit_rate(&mut self, bit_rate: u32) {
        self.options.retain(|(key, _)| key != BIT_RATE);
        self.options.push((BIT_RATE.to_owned(), bit_rate.to_string()));
    }

    /// Whether there is no wire.
    pub(super) fn is_virtual(&self) -> bool {
        match &*self.interface {
            "virtual" | "udp_multicast" => true,
            "socketcan" => names::is_virtual(&self.channel),
            _ => false,
        }
    }
}

/// The adapters that python-can finds, each with its target; none where it is not installed.
pub(crate) fn plugged_in() -> Vec<String> {
    let output = python().stdin(Stdio::null()).stderr(Stdio::null()).output();
    let output = output.map(|output| output.stdout).unwrap_or_default();
    let adapters =
        output.split(|byte| *byte == b'\n').filter_map(|line| match codec::parse(line) {
            Ok(Message::Adapter(interface, channel)) => {
                Some(format!("{PYTHON_CAN}{interface}:{channel}"))
            }
            _ => None,
        });
    adapters.collect()
}

/// What the names of these interfaces begin with.
pub(super) const PYTHON_CAN: &str = "python-can:";

/// The interpreter with the bridge, to which arguments may be added.
fn python() -> Command {
    let usual = || system::PYTHON.into();
    let mut command = Command::new(env::var_os(PYTHON).unwrap_or_else(usual));
    command.args(["-u", "-c", BRIDGE]);
    command
}

fn start(command: Command, stop: &Stop, told: Told) -> Result<(Process, Lines<Told>), BusError> {
    let mut command = command;
    command.stdin(Stdio::piped()).stdout(Stdio::piped());
    let name = command.get_program().display().to_string();
    let refused = |why: &str| {
        BusError::Open(format!(
            "python-can needs Python: `{name}` cannot be started ({why}). The environment variable \
             {PYTHON} names another interpreter"
        ))
    };
    let mut process = Process::of(command).map_err(|why| refused(&words(&why)))?;
    let (to, from) = process.pipes().ok_or_else(|| refused("it has no pipes"))?;
    Ok((process, Lines::new(from, to, Clock::start(), stop.clone(), told)))
}

impl fmt::Display for PythonCan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.interface)?;
        if !self.channel.is_empty() {
            write!(f, ":{}", self.channel)?;
        }
        self.options.iter().try_for_each(|(key, value)| write!(f, ",{key}={value}"))
    }
}

impl FromStr for PythonCan {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut parts = text.split(',');
        let place = parts.next().unwrap_or_default();
        let (interface, channel) = place.split_once(':').unwrap_or((place, ""));
        let is_word = |text: &str| {
            !text.is_empty()
                && text.chars().all(|letter| letter.is_ascii_alphanumeric() || letter == '_')
        };
        if !is_word(interface) {
            return Err("an adapter of python-can is `python-can:INTERFACE:CHANNEL`, such as \
                        `python-can:pcan:PCAN_USBBUS1`"
                .to_owned());
        }
        let mut options: Vec<(String, String)> = Vec::new();
        for option in parts {
            let known = option
                .split_once('=')
                .filter(|(key, _)| is_word(key) && options.iter().all(|(other, _)| other != key));
            let (key, value) = known.ok_or_else(|| {
                format!("`,{option}`: `,KEY=VALUE` is what the driver is told, `,bitrate=500000`")
            })?;
            options.push((key.to_owned(), value.to_owned()));
        }
        Ok(Self { interface: interface.to_owned(), channel: channel.to_owned(), options })
    }
}

/// An adapter that is open.
#[derive(Debug)]
pub(super) struct Bridge {
    of: PythonCan,
    /// Ends before the process does: that is how the bridge learns that it is over.
    lines: Lines<Told>,
    _process: Process,
}

impl Bridge {
    fn gone(&mut self, ending: &Ending) -> BusError {
        let why = match (self.lines.speech().failed.take(), ending) {
            (Some(why), _) => why,
            (None, Ending::Closed) => "the bridge to it ended".to_owned(),
            (None, Ending::Garbage(what)) => format!("the bridge to it wrote {what}"),
        };
        BusError::Io(format!("the adapter python-can:{} is gone: {why}", self.of))
    }
}

impl Drop for Bridge {
    /// Closes the adapter: the bridge ends with its standard input.
    fn drop(&mut self) {
        self.lines.close("");
    }
}

impl Bus for Bridge {
    fn is_real(&self) -> bool {
        true
    }

    fn now(&mut self) -> Instant {
        self.lines.now()
    }

    /// # Errors
    /// [`BusError::Io`] when the bridge does not read what it is sent.
    fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
        let of = &self.of;
        let fails = |why| BusError::Io(format!("the bridge to python-can:{of} {why}"));
        self.lines.send(frame).map_err(fails)
    }

    /// # Errors
    /// [`BusError::Controller`] for an error frame and for what the driver refuses,
    /// [`BusError::Lost`] when a line is garbled, [`BusError::Io`] when the adapter is gone,
    /// [`BusError::Interrupted`].
    fn recv(&mut self, until: Instant) -> Result<Option<Stamped>, BusError> {
        self.lines.recv(until)?.map_err(|ending| self.gone(&ending))
    }

    fn remark(&self) -> Option<String> {
        let told = self.lines.told();
        let heard = match told.has_stamps {
            true => "frames heard have the time stamps of the driver",
            false => "frames heard have the time at which they came from the driver",
        };
        let sent = match told.by {
            By::Echo => "frames sent those of their echoes",
            By::Handing => {
                "frames sent the time at which the driver took them, since it echoes none"
            }
        };
        Some(format!("{heard}, {sent} (python-can {})", told.version))
    }
}

/// What confirms a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum By {
    /// It comes back.
    Echo,
    /// The driver took it.
    Handing,
}

/// What is known of the conversation with a bridge.
#[derive(Debug)]
struct Told {
    name: String,
    is_ready: bool,
    version: String,
    by: By,
    echoes: Echoes,
    /// What was sent until the first echo came.
    first: Vec<Frame>,
    is_echoed: bool,
    clock: FarClock,
    has_stamps: bool,
    failed: Option<String>,
}

impl Told {
    const fn new(name: String) -> Self {
        Self {
            name,
            is_ready: false,
            version: String::new(),
            by: By::Echo,
            echoes: Echoes::new(true),
            first: Vec::new(),
            is_echoed: false,
            clock: FarClock::new(Duration::from_micros(1)),
            has_stamps: true,
            failed: None,
        }
    }

    /// Frames follow.
    fn begin(&mut self, version: String) {
        (self.is_ready, self.version) = (true, version);
    }

    /// Whether a frame is the echo of an own one. Not every driver marks echoes, and some mark what
    /// other programs of this machine send.
    fn is_echo(&mut self, at: Instant, frame: &Frame, inbox: &mut Inbox) -> bool {
        let is_echo = match self.by {
            By::Echo => self.echoes.confirmed_by(frame, at, inbox),
            // It comes after all, too late.
            By::Handing => self.first.contains(frame),
        };
        if is_echo {
            (self.by, self.is_echoed) = (By::Echo, true);
            self.first.clear();
        }
        is_echo
    }

    fn heard(&mut self, at: Instant, frame: Frame, stamp: Option<u64>, inbox: &mut Inbox) {
        self.has_stamps = stamp.is_some();
        let at = stamp.map_or(at, |stamp| self.clock.time(at, stamp));
        if self.is_echo(at, &frame, inbox) {
            return;
        }
        self.echoes.precede(at, inbox);
        inbox.heard(at, frame);
    }
}

impl Speech for Told {
    const LONGEST: usize = 4096;

    fn ends(message: &[u8]) -> bool {
        message.ends_with(b"\n")
    }

    fn send(&mut self, now: Instant, frame: &Frame, inbox: &mut Inbox) -> Vec<u8> {
        if self.by == By::Echo && !self.is_echoed {
            self.first.push(*frame);
        }
        self.echoes.sent(now, *frame, inbox);
        format!("{frame}\n").into()
    }

    fn take(&mut self, at: Instant, message: &[u8], inbox: &mut Inbox) -> Result<(), Ending> {
        match codec::parse(message) {
            Ok(Message::Frame(frame, stamp)) => self.heard(at, frame, stamp, inbox),
            Ok(Message::Sent) if self.by == By::Handing => self.echoes.confirmed(at, inbox),
            Ok(Message::Refused(why)) => {
                if let Some(Refused::Frame(frame)) = self.echoes.refused() {
                    let name = &self.name;
                    inbox.fault(BusError::Controller(format!(
                        "that python-can:{name} refuses to send {frame}: {why}"
                    )));
                }
            }
            Ok(Message::ErrorFrame(id)) => {
                // Only SocketCAN has classes of errors there.
                let what = super::trouble::of(id, None);
                let what = what.unwrap_or_else(|| "an error frame".to_owned());
                inbox.fault(BusError::Controller(what));
            }
            Ok(Message::Failed(why)) => {
                self.failed = Some(why);
                return Err(Ending::Closed);
            }
            Ok(Message::Sent | Message::Ready(_) | Message::Adapter(..)) => {}
            Err(why) => {
                let text = quoted(message);
                inbox.fault(BusError::Lost(format!(
                    "the bridge to python-can:{} wrote `{text}`, which is no frame: {why}",
                    self.name
                )));
            }
        }
        Ok(())
    }

    /// Where no echo comes after all, frames are confirmed by the driver from now on.
    fn due(&mut self, now: Instant, inbox: &mut Inbox) -> Option<Vec<u8>> {
        if self.echoes.give_up(now, inbox) && self.by == By::Echo {
            (self.by, self.echoes) = (By::Handing, Echoes::new(true));
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn talk() -> (Told, Inbox) {
        let mut told = Told::new("here".to_owned());
        told.begin("1".to_owned());
        (told, Inbox::new())
    }

    fn hear(told: &mut Told, inbox: &mut Inbox, ms: u64, line: &str) {
        assert_eq!(told.take(Instant(ms * 1_000_000), line.as_bytes(), inbox), Ok(()));
    }

    /// What was received: own frames have a dash.
    fn received(inbox: &mut Inbox) -> Vec<String> {
        let all = std::iter::from_fn(|| inbox.next()).map(|seen| match seen {
            Ok(Stamped { at, frame, own }) => {
                format!("{} {}{frame}", at.0 / 1_000_000, if own { "-" } else { "" })
            }
            Err(fault) => fault.to_string(),
        });
        all.collect()
    }

    #[test]
    fn an_echo_confirms_whatever_else_comes() {
        let (mut told, mut inbox) = talk();
        let line = told.send(Instant(1_000_000), &Frame::new(0x605, [1]), &mut inbox);
        assert_eq!(line, b"605#01\n");
        hear(&mut told, &mut inbox, 2, "sent\n");
        hear(&mut told, &mut inbox, 3, "frame 10.003 605#01\n");
        hear(&mut told, &mut inbox, 4, "frame 10.004 585#01\n");
        assert_eq!(received(&mut inbox), ["3 -605#01", "4 585#01"]);
        // Nothing is confirmed twice: this is a frame of another station.
        hear(&mut told, &mut inbox, 5, "frame 10.005 605#01\n");
        assert_eq!(received(&mut inbox), ["5 605#01"]);
    }

    #[test]
    fn where_no_echo_comes_the_driver_confirms() {
        let (mut told, mut inbox) = talk();
        told.send(Instant(1_000_000), &Frame::new(1, []), &mut inbox);
        hear(&mut told, &mut inbox, 2, "sent\n");
        assert_eq!(told.due(Instant(1_100_000_000), &mut inbox), None);
        told.send(Instant(1_200_000_000), &Frame::new(2, []), &mut inbox);
        hear(&mut told, &mut inbox, 1201, "sent\n");
        assert_eq!(received(&mut inbox), ["1 -001#", "1201 -002#"]);
        // It was only late.
        hear(&mut told, &mut inbox, 1300, "frame 10.3 001#\n");
        told.send(Instant(1_400_000_000), &Frame::new(2, []), &mut inbox);
        hear(&mut told, &mut inbox, 1401, "sent\n");
        assert_eq!(received(&mut inbox), [""; 0]);
        hear(&mut told, &mut inbox, 1402, "frame 10.402 002#\n");
        assert_eq!(received(&mut inbox), ["1402 -002#"]);
    }

    #[test]
    fn what_goes_wrong_is_told() {
        let (mut told, mut inbox) = talk();
        told.send(Instant(1), &Frame::new(1, []), &mut inbox);
        hear(&mut told, &mut inbox, 1, "refused CanOperationError: queue full\n");
        hear(&mut told, &mut inbox, 1, "error - 0\n");
        hear(&mut told, &mut inbox, 1, "a greeting\n");
        let faults = received(&mut inbox);
        assert!(faults[0].ends_with("refuses to send 001#: CanOperationError: queue full"));
        assert!(faults[1].ends_with("an error frame"), "{faults:?}");
        assert!(faults[2].ends_with("`a greeting`, which is no frame: no line begins so"));
        let over = told.take(Instant(2), b"failed OSError: unplugged\n", &mut inbox);
        assert_eq!(
            (over, told.failed.as_deref()),
            (Err(Ending::Closed), Some("OSError: unplugged"))
        );
    }
}
