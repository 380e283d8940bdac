//! Adapters that speak Lawicel's protocol (slcan) on a serial line or over TCP.
//!
//! The protocol has no echo of own frames: most adapters confirm each, and then a frame is complete
//! when it is confirmed. Others say nothing, as the kernel's slcan on the far end of a line, and
//! then it is complete when it is written.

mod codec;

use std::fmt;
use std::path::Path;
use std::str::FromStr;
use std::time::Duration;

use canopen::{Bus, BusError, Frame, Instant, Stamped};
use runner::stop::Stop;

use super::echo::{Echoes, Refused};
use super::far_clock::{FarClock, Unwrapped};
use super::lines::{Clock, Ending, Inbox, Lines, Speech, quoted};
use super::names;
use super::port::Port;
use codec::{BELL, BIT_RATES, CR, Flags, Message};

/// How an adapter is reached, as `slcan:/dev/ttyACM0,bitrate=500000` or `slcan:tcp://host:port`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Slcan {
    /// The serial line, or `tcp://host:port`.
    place: String,
    /// The speed of the serial line, in bit/s.
    serial: Option<u32>,
    /// The bit rate of the bus that the adapter is set to, in bit/s.
    pub(super) bit_rate: Option<u32>,
}

/// What a serial line is usually set to, in bit/s. Adapters on USB have no such speed.
const SERIAL: u32 = 115_200;
const TCP: &str = "tcp://";

impl Slcan {
    /// Opens the adapter, and its channel to the bus.
    ///
    /// # Errors
    /// [`BusError::Open`] with what to do about it.
    pub(super) fn open(&self, stop: &Stop) -> Result<Adapter, BusError> {
        let port = match self.place.strip_prefix(TCP) {
            Some(host) => Port::tcp(host, "is the adapter's server running there?"),
            None => Port::serial(Path::new(&self.place), self.serial.unwrap_or(SERIAL)),
        }?;
        Adapter::on(self.clone(), port, stop)
    }

    /// Whether the other end is a program on this machine.
    pub(super) fn is_on_this_machine(&self) -> bool {
        match self.place.strip_prefix(TCP) {
            Some(host) => names::is_this_machine(host),
            None => self.place.starts_with("/dev/pts/"),
        }
    }
}

impl fmt::Display for Slcan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.place)?;
        if let Some(speed) = self.serial {
            write!(f, ",serial={speed}")?;
        }
        self.bit_rate.map_or(Ok(()), |rate| write!(f, ",bitrate={rate}"))
    }
}

impl FromStr for Slcan {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut parts = text.split(',');
        let place = parts.next().unwrap_or_default().to_owned();
        let host = place.strip_prefix(TCP);
        if !host.map_or_else(|| is_line(&place), |host| host.contains(':')) {
            return Err("a serial line, such as `slcan:/dev/ttyACM0` or on Windows `slcan:COM3`, \
                        or `slcan:tcp://host:port` is an adapter"
                .to_owned());
        }
        let (mut serial, mut bit_rate) = (None, None);
        for option in parts {
            let known = option.split_once('=').and_then(|(key, value)| {
                let value = value.parse::<u32>().ok().filter(|value| *value > 0)?;
                match key {
                    "serial" if host.is_none() => serial.replace(value).is_none(),
                    "bitrate" => bit_rate.replace(value).is_none(),
                    _ => false,
                }
                .then_some(())
            });
            known.ok_or_else(|| {
                format!(
                    "`,{option}`: `,bitrate=500000` is the bit rate of the bus, and \
                     `,serial=115200` the speed of the serial line, in bit/s"
                )
            })?;
        }
        Ok(Self { place, serial, bit_rate })
    }
}

/// Whether this is the name of a serial line: a path, or on Windows COM with a number.
fn is_line(place: &str) -> bool {
    let number = place.strip_prefix("COM").and_then(|number| number.parse::<u16>().ok());
    place.starts_with('/') || number.is_some()
}

/// An adapter with an open channel.
#[derive(Debug)]
pub(super) struct Adapter {
    of: Slcan,
    port: Port,
    lines: Lines<Lawicel>,
    answers: bool,
    has_stamps: bool,
}

/// How long an adapter may take for an answer.
const PATIENCE: Duration = Duration::from_millis(500);
/// How long nothing comes any more when everything of before was read.
const QUIET: Duration = Duration::from_millis(100);

/// What an adapter answers to a command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Answer {
    Yes,
    No,
    Flags(Flags),
    Nothing,
}

impl Adapter {
    fn on(of: Slcan, port: Port, stop: &Stop) -> Result<Self, BusError> {
        let (clock, stop) = (Clock::start(), stop.clone());
        let lines =
            Lines::new(port.clone(), port.clone(), clock, stop, Lawicel::new(of.to_string()));
        let mut adapter = Self { of, port, lines, answers: false, has_stamps: false };
        adapter.set_up()?;
        Ok(adapter)
    }

    /// Closes the channel if it is open, sets the bit rate and opens it.
    fn set_up(&mut self) -> Result<(), BusError> {
        // Empties what a program before may have left in the buffer of the adapter.
        self.write("\r\r\rC\r")?;
        let mut answers = self.until_quiet()?;
        let name = &self.of.to_string();
        if let Some(rate) = self.of.bit_rate {
            let command = codec::bit_rate(rate).ok_or_else(|| {
                let known: Vec<String> = BIT_RATES.iter().map(u32::to_string).collect();
                let known = known.join(", ");
                BusError::Open(format!(
                    "slcan has no bit rate of {rate} bit/s: {known} bit/s are those of the protocol"
                ))
            })?;
            let answer = self.ask(&command, answers)?;
            answers |= answer != Answer::Nothing;
            if answer == Answer::No {
                return Err(BusError::Open(format!(
                    "the adapter {name} refuses the bit rate of {rate} bit/s (its answer to \
                     `{}` is BELL): another one may be what it supports",
                    command.trim_end()
                )));
            }
        }
        if answers {
            self.has_stamps = self.ask("Z1\r", answers)? == Answer::Yes;
        }
        match self.ask("O\r", answers)? {
            Answer::No => {
                let hint = match self.of.bit_rate {
                    None => "say the bit rate of the bus: --bitrate 500000",
                    Some(_) => "switch its power off and on",
                };
                return Err(BusError::Open(format!(
                    "the adapter {name} does not open its channel (its answer to `O` is BELL): \
                     {hint}"
                )));
            }
            Answer::Nothing => {}
            Answer::Yes | Answer::Flags(_) => answers = true,
        }
        self.answers = answers;
        let flags = if answers { self.ask("F\r", answers)? } else { Answer::Nothing };
        self.lines.speech().begin(answers, flags);
        Ok(())
    }

    fn write(&self, text: &str) -> Result<(), BusError> {
        self.lines.write(text).map_err(|why| self.fails(&why))
    }

    fn fails(&self, why: &str) -> BusError {
        BusError::Io(format!("the adapter {} {why}", self.of))
    }

    /// Reads until nothing more comes from an adapter whose channel was just closed. Whether
    /// anything came.
    fn until_quiet(&mut self) -> Result<bool, BusError> {
        let (mut patience, mut came) = (PATIENCE, false);
        let give_up = self.lines.now() + 4 * PATIENCE;
        while self.lines.now() < give_up {
            let until = self.lines.now() + patience;
            match self.lines.message(until)?.map_err(|ending| self.gone(&ending))? {
                None => break,
                Some(line) => {
                    patience = QUIET;
                    came |= matches!(codec::parse(&line), Ok(Message::Done | Message::Refused));
                }
            }
        }
        Ok(came)
    }

    /// Writes a command and waits for the answer. Frames that come before it are not of interest.
    fn ask(&mut self, command: &str, answers: bool) -> Result<Answer, BusError> {
        self.write(command)?;
        // One that has not said anything yet will hardly do so now.
        let until = self.lines.now() + if answers { PATIENCE } else { QUIET };
        loop {
            let came = self.lines.message(until)?.map_err(|ending| self.gone(&ending))?;
            let Some(line) = came else { return Ok(Answer::Nothing) };
            return Ok(match codec::parse(&line) {
                Ok(Message::Done | Message::Other) => Answer::Yes,
                Ok(Message::Refused) => Answer::No,
                Ok(Message::Flags(flags)) => Answer::Flags(flags),
                // Not even of an adapter, unless it is the rest of a line.
                Ok(Message::Frame(..)) | Err(_) => continue,
            });
        }
    }

    fn gone(&self, ending: &Ending) -> BusError {
        let name = &self.of;
        BusError::Io(match ending {
            Ending::Closed if self.of.place.starts_with(TCP) => format!(
                "the adapter {name} closed the connection: does it have power, and does nobody \
                 else use it?"
            ),
            Ending::Closed => format!("the adapter {name} is gone: was it unplugged?"),
            Ending::Garbage(what) => format!(
                "the adapter {name} sent {what}: is it an adapter with the Lawicel protocol, and \
                 is `,serial=` its speed?"
            ),
        })
    }
}

impl Drop for Adapter {
    /// Closes the channel, so that the adapter does not go on to confirm frames on the bus.
    fn drop(&mut self) {
        self.lines.close("C\r");
        self.port.close();
    }
}

impl Bus for Adapter {
    fn is_real(&self) -> bool {
        true
    }

    fn now(&mut self) -> Instant {
        self.lines.now()
    }

    /// # Errors
    /// [`BusError::Io`] when the adapter does not read what it is sent.
    fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
        self.lines.send(frame).map_err(|why| self.fails(&why))
    }

    /// # Errors
    /// [`BusError::Controller`] when the adapter refuses a frame or reports a faulty bus,
    /// [`BusError::Lost`] when it lost frames or a line is garbled, [`BusError::Io`] when it is
    /// gone, [`BusError::Interrupted`].
    fn recv(&mut self, until: Instant) -> Result<Option<Stamped>, BusError> {
        self.lines.recv(until)?.map_err(|ending| self.gone(&ending))
    }

    fn remark(&self) -> Option<String> {
        let heard = match self.has_stamps {
            true => "frames heard have the adapter's time stamps, in steps of 1 ms",
            false => "frames heard have the time at which they came from the adapter",
        };
        let sent = match self.answers {
            true => "frames sent that at which the adapter confirmed them",
            false => {
                "frames sent that at which they were written, since the adapter answers no command"
            }
        };
        Some(format!("{heard}, {sent}"))
    }
}

/// What is known of the conversation with an adapter.
#[derive(Debug)]
struct Lawicel {
    name: String,
    echoes: Echoes,
    clock: FarClock,
    unwrapped: Unwrapped,
    /// The flags that were told last, if the adapter tells them.
    flags: Option<Flags>,
    /// When they were asked for.
    asked: Instant,
    /// Whether something happened since.
    is_active: bool,
    /// The frame that was refused, until the flags tell why.
    refused: Option<Frame>,
}

/// Stamps count the milliseconds of a minute.
const MINUTE: Duration = Duration::from_secs(60);
/// Some adapters count until their number is full.
const FULL: Duration = Duration::from_millis(1 << 16);

impl Lawicel {
    /// How often the flags are asked for while something happens.
    const EVERY: Duration = Duration::from_millis(500);

    const fn new(name: String) -> Self {
        Self {
            name,
            echoes: Echoes::new(false),
            clock: FarClock::new(Duration::from_millis(1)),
            unwrapped: Unwrapped::new(MINUTE),
            flags: None,
            asked: Instant::ZERO,
            is_active: false,
            refused: None,
        }
    }

    /// Frames follow, to an adapter that `answers`, and gave these flags.
    fn begin(&mut self, answers: bool, flags: Answer) {
        self.echoes = Echoes::new(answers);
        self.flags = match flags {
            Answer::Flags(flags) => Some(flags),
            _ => None,
        };
    }

    fn stamped(&mut self, at: Instant, stamp: Option<u16>) -> Instant {
        let Some(stamp) = stamp else { return at };
        let stamp = Duration::from_millis(stamp.into());
        if stamp >= MINUTE {
            self.unwrapped.correct(FULL);
        }
        let stamp = self.unwrapped.count(at, stamp.as_nanos() as u64);
        self.clock.time(at, stamp)
    }

    fn told(&mut self, flags: Flags, inbox: &mut Inbox) {
        self.echoes.answered();
        let name = &self.name;
        let new = flags.since(self.flags.replace(flags).unwrap_or_default());
        if let Some(frame) = self.refused.take() {
            let why = flags.reason().unwrap_or("its status flags show no reason");
            inbox
                .fault(BusError::Controller(format!("that {name} refuses to send {frame}: {why}")));
        } else if let Some(trouble) = new.trouble() {
            inbox.fault(BusError::Controller(trouble.to_owned()));
        }
        if new.lost() {
            inbox.fault(BusError::Lost(format!(
                "frames were lost in the adapter {name}: they came faster than it passed them on"
            )));
        }
    }

    /// Something is not taken: the flags tell why, where there are flags.
    fn refused(&mut self, inbox: &mut Inbox) {
        match self.echoes.refused() {
            Some(Refused::Frame(frame)) if self.flags.is_some() => self.refused = Some(frame),
            Some(Refused::Frame(frame)) => {
                let name = &self.name;
                inbox.fault(BusError::Controller(format!(
                    "that {name} refuses to send {frame}: is another node powered and connected, \
                     and is the bit rate the same?"
                )));
            }
            Some(Refused::Question) => self.flags = None,
            None => {}
        }
    }
}

impl Speech for Lawicel {
    /// The longest is a 29-bit frame with a time stamp, of 30 bytes.
    const LONGEST: usize = 4096;

    fn ends(message: &[u8]) -> bool {
        message.ends_with(&[CR]) || message.ends_with(&[BELL])
    }

    fn send(&mut self, now: Instant, frame: &Frame, inbox: &mut Inbox) -> Vec<u8> {
        self.is_active = true;
        self.echoes.sent(now, *frame, inbox);
        codec::line(frame).into()
    }

    fn take(&mut self, at: Instant, message: &[u8], inbox: &mut Inbox) -> Result<(), Ending> {
        match codec::parse(message) {
            Ok(Message::Frame(frame, stamp)) => {
                self.is_active = true;
                let at = self.stamped(at, stamp);
                self.echoes.precede(at, inbox);
                inbox.heard(at, frame);
            }
            Ok(Message::Done) => self.echoes.confirmed(at, inbox),
            Ok(Message::Refused) => self.refused(inbox),
            Ok(Message::Flags(flags)) => self.told(flags, inbox),
            Ok(Message::Other) => {}
            Err(why) => {
                let text = quoted(message);
                inbox.fault(BusError::Lost(format!(
                    "the adapter {} sent `{text}`, which is no frame: {why}",
                    self.name
                )));
            }
        }
        Ok(())
    }

    fn due(&mut self, now: Instant, inbox: &mut Inbox) -> Option<Vec<u8>> {
        _ = self.echoes.give_up(now, inbox);
        let is_due = self.is_active && now.since(self.asked) >= Self::EVERY;
        let is_wanted = is_due || self.refused.is_some();
        if self.flags.is_none() || !is_wanted || !self.echoes.none_asked() {
            return None;
        }
        (self.asked, self.is_active) = (now, false);
        self.echoes.asked(now);
        Some("F\r".into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn talk(flags: Answer) -> (Lawicel, Inbox) {
        let mut lawicel = Lawicel::new("here".to_owned());
        lawicel.begin(true, flags);
        (lawicel, Inbox::new())
    }

    fn hear(lawicel: &mut Lawicel, inbox: &mut Inbox, at: u64, line: &str) {
        let taken = lawicel.take(Instant(at * 1_000_000), line.as_bytes(), inbox);
        assert_eq!(taken, Ok(()));
    }

    fn fault(inbox: &mut Inbox) -> String {
        inbox.next().expect("something comes").expect_err("it is a fault").to_string()
    }

    #[test]
    fn what_is_refused_has_the_reason_that_the_flags_give() {
        let (mut lawicel, mut inbox) = talk(Answer::Flags(Flags(0)));
        let line = lawicel.send(Instant(1), &Frame::new(0x605, [1]), &mut inbox);
        assert_eq!(line, b"t605101\r");
        hear(&mut lawicel, &mut inbox, 2, "\x07");
        assert_eq!(inbox.next(), None);
        assert_eq!(lawicel.due(Instant(3_000_000), &mut inbox).as_deref(), Some(&b"F\r"[..]));
        assert_eq!(lawicel.due(Instant(3_000_000), &mut inbox), None);
        hear(&mut lawicel, &mut inbox, 4, "F24\r");
        assert!(fault(&mut inbox).contains("here refuses to send 605#01: error passive"));
        assert_eq!(inbox.next(), None);
    }

    #[test]
    fn flags_are_told_once_and_not_asked_for_where_there_are_none() {
        let (mut lawicel, mut inbox) = talk(Answer::Flags(Flags(0x80)));
        for (second, flags, told) in [
            (1, "F80\r", ""),
            (2, "F84\r", "error warning"),
            (3, "F84\r", ""),
            (4, "F08\r", "lost"),
        ] {
            let now = Instant(second * 1_000_000_000);
            lawicel.send(now, &Frame::new(1, []), &mut inbox);
            hear(&mut lawicel, &mut inbox, second * 1000, "z\r");
            assert_eq!(lawicel.due(now, &mut inbox).as_deref(), Some(&b"F\r"[..]));
            hear(&mut lawicel, &mut inbox, second * 1000, flags);
            assert!(inbox.next().expect("the echo").expect("is one").own);
            match told {
                "" => assert_eq!(inbox.next(), None),
                told => assert!(fault(&mut inbox).contains(told)),
            }
        }
        let (mut lawicel, mut inbox) = talk(Answer::No);
        lawicel.send(Instant(1), &Frame::new(1, []), &mut inbox);
        assert_eq!(lawicel.due(Instant(900_000_000), &mut inbox), None);
        hear(&mut lawicel, &mut inbox, 900, "\x07");
        assert!(fault(&mut inbox).contains("refuses to send 001#"));
    }

    #[test]
    fn stamps_that_begin_again_after_another_time_are_noticed() {
        let (mut lawicel, mut inbox) = talk(Answer::Flags(Flags(0)));
        for (at, stamp) in [
            (50_000, 50_000),
            (61_000, 61_000),
            (66_000, 66_000 - 65_536),
            (67_000, 67_000 - 65_536),
        ] {
            hear(&mut lawicel, &mut inbox, at, &format!("t7010{stamp:04X}\r"));
            let seen = inbox.next().expect("it comes").expect("nothing is wrong");
            assert_eq!(seen.at, Instant(at * 1_000_000));
        }
    }

    #[test]
    fn a_garbled_line_is_a_lost_frame() {
        let (mut lawicel, mut inbox) = talk(Answer::Nothing);
        hear(&mut lawicel, &mut inbox, 1, "t58\u{7f}5\r");
        hear(&mut lawicel, &mut inbox, 2, "t5810\r");
        let said = "the adapter here sent `t58\\u{7f}5`, which is no frame: its identifier is no \
                    number";
        assert_eq!(fault(&mut inbox), said);
        assert!(inbox.next().expect("it goes on").is_ok());
    }
}
