//! Adapters that speak gs_usb (candleLight, CANable and many others), by a USB library and without
//! a driver of the system.
//!
//! The adapter sends own frames back when they are complete, with their number. A few are under way
//! at a time, as with the driver of Linux: adapters have room for so many.

mod codec;
mod usb;

use std::collections::VecDeque;
use std::fmt;
use std::io::{self, Read, Write};
use std::str::FromStr;
use std::time::Duration;

use canopen::{Bus, BusError, Frame, Instant, Stamped};
use runner::stop::Stop;

use super::echo::Echoes;
use super::far_clock::{FarClock, Unwrapped};
use super::lines::{Clock, Ending, Inbox, Lines, Speech};
use super::trouble;
use codec::{Constants, RECORD, What, request};

pub(crate) use usb::plugged_in;

/// What the names of these interfaces begin with.
pub(crate) const GS_USB: &str = "gs_usb:";

/// An adapter, as `gs_usb:`, the only one, or `gs_usb:SERIAL,channel=1,bitrate=500000`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GsUsb {
    /// Its serial number; empty when there is only one adapter.
    serial: String,
    /// Which of its buses.
    channel: Option<u8>,
    /// The bit rate of the bus that it is set to, in bit/s.
    pub(super) bit_rate: Option<u32>,
}

impl GsUsb {
    /// Opens the adapter.
    ///
    /// # Errors
    /// [`BusError::Open`] with what to do about it.
    pub(super) fn open(&self, stop: &Stop) -> Result<Box<dyn Bus>, BusError> {
        self.open_on(usb::open(&self.serial)?, stop)
    }

    /// Opens an adapter on this USB, whichever that is.
    ///
    /// # Errors
    /// The same.
    pub fn open_on(&self, usb: Box<dyn Usb>, stop: &Stop) -> Result<Box<dyn Bus>, BusError> {
        Ok(Box::new(Adapter::on(self.clone(), usb, stop)?))
    }
}

impl fmt::Display for GsUsb {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.serial)?;
        if let Some(channel) = self.channel {
            write!(f, ",channel={channel}")?;
        }
        self.bit_rate.map_or(Ok(()), |rate| write!(f, ",bitrate={rate}"))
    }
}

impl FromStr for GsUsb {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut parts = text.split(',');
        let serial = parts.next().unwrap_or_default().to_owned();
        let mut adapter = Self { serial, channel: None, bit_rate: None };
        for option in parts {
            let is_known = match option.split_once('=') {
                Some(("channel", value)) => {
                    value.parse().is_ok_and(|value| adapter.channel.replace(value).is_none())
                }
                Some(("bitrate", value)) => {
                    let value = value.parse().ok().filter(|value| *value > 0);
                    value.is_some_and(|value| adapter.bit_rate.replace(value).is_none())
                }
                _ => false,
            };
            if !is_known {
                return Err(format!(
                    "`,{option}`: `,bitrate=500000` is the bit rate of the bus in bit/s, and \
                     `,channel=1` the second bus of an adapter"
                ));
            }
        }
        Ok(adapter)
    }
}

/// The two directions of frames. Each read and each write is a transfer; a read of nothing is the
/// end.
pub type Pipes = (Box<dyn Read + Send>, Box<dyn Write + Send>);

/// The USB that an adapter is on. A test has one of its own. It ends with the value.
pub trait Usb {
    /// The answer of `length` bytes at most to a request of the vendor to the interface.
    ///
    /// # Errors
    /// Whatever the system says.
    fn ask(&mut self, request: u8, value: u16, length: u16) -> io::Result<Vec<u8>>;

    /// A request of the vendor with data to the interface.
    ///
    /// # Errors
    /// Whatever the system says.
    fn tell(&mut self, request: u8, value: u16, data: &[u8]) -> io::Result<()>;

    /// The pipes for frames. They are asked for once.
    ///
    /// # Errors
    /// Whatever the system says.
    fn pipes(&mut self) -> io::Result<Pipes>;
}

/// An adapter that is on the bus.
struct Adapter {
    of: GsUsb,
    usb: Box<dyn Usb>,
    lines: Lines<Talk>,
    flags: u32,
}

impl Adapter {
    fn on(of: GsUsb, mut usb: Box<dyn Usb>, stop: &Stop) -> Result<Self, BusError> {
        let name = format!("{GS_USB}{of}");
        let channel = of.channel.unwrap_or(0);
        let refused = |what: &str, why: &dyn fmt::Display| {
            BusError::Open(format!("the adapter {name} does not tell {what}: {why}"))
        };
        let failed = |why: io::Error| {
            BusError::Open(format!("the adapter {name} refuses to be set up: {why}"))
        };
        let Some(rate) = of.bit_rate else {
            let why = format!("{name} needs the bit rate of the bus: --bitrate 500000");
            return Err(BusError::Open(why));
        };
        usb.tell(request::HOST_FORMAT, 1, &codec::LITTLE_ENDIAN).map_err(failed)?;
        let config = usb.ask(request::DEVICE_CONFIG, 1, codec::CONFIG).map_err(failed)?;
        let channels = codec::channels(&config).map_err(|why| refused("what it has", &why))?;
        if u16::from(channel) >= channels {
            let last = channels - 1;
            let why = format!("the adapter {name} has the channels 0 to {last}");
            return Err(BusError::Open(why));
        }
        let constants = usb.ask(request::CONSTANTS, channel.into(), codec::CONSTANTS);
        let constants = Constants::parse(&constants.map_err(failed)?);
        let constants = constants.map_err(|why| refused("its limits", &why))?;
        let timing = constants.timing(rate).ok_or_else(|| {
            BusError::Open(format!("the adapter {name} has no bit rate of {rate} bit/s"))
        })?;
        // A program before may have left it on the bus, where its bit rate cannot be set.
        usb.tell(request::MODE, channel.into(), &codec::STOP).map_err(failed)?;
        usb.tell(request::BIT_TIMING, channel.into(), &timing).map_err(failed)?;
        let (from, to) = usb.pipes().map_err(failed)?;
        let flags = constants.features & codec::HAS_STAMPS;
        let talk = Talk::new(name.clone(), channel, flags != 0);
        let lines =
            Lines::new(Records { from, left: Vec::new() }, to, Clock::start(), stop.clone(), talk);
        usb.tell(request::MODE, channel.into(), &codec::start(flags)).map_err(failed)?;
        Ok(Self { of, usb, lines, flags })
    }

    fn mode(&mut self, data: &[u8]) -> io::Result<()> {
        self.usb.tell(request::MODE, self.of.channel.unwrap_or(0).into(), data)
    }

    fn gone(&self, ending: &Ending) -> BusError {
        let name = &self.of;
        BusError::Io(match ending {
            Ending::Closed => format!("the adapter {GS_USB}{name} is gone: was it unplugged?"),
            Ending::Garbage(what) => format!("the adapter {GS_USB}{name} sent {what}"),
        })
    }
}

impl Drop for Adapter {
    /// Takes the adapter from the bus, where it would go on to confirm frames.
    fn drop(&mut self) {
        self.lines.close("");
        // It may have been unplugged.
        _ = self.mode(&codec::STOP);
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
    /// [`BusError::Io`] when the adapter does not take what it is sent.
    fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
        let name = &self.of;
        let fails = |why| BusError::Io(format!("the adapter {GS_USB}{name} {why}"));
        self.lines.send(frame).map_err(fails)
    }

    /// An adapter that is bus-off is put on the bus again.
    ///
    /// # Errors
    /// [`BusError::Controller`] when the adapter reports a faulty bus, [`BusError::Lost`] when it
    /// lost frames or sent something else, [`BusError::Io`] when it is gone,
    /// [`BusError::Interrupted`].
    fn recv(&mut self, until: Instant) -> Result<Option<Stamped>, BusError> {
        let got = self.lines.recv(until);
        if std::mem::take(&mut self.lines.speech().is_off) {
            let start = codec::start(self.flags);
            // One that is gone says so itself.
            _ = self.mode(&codec::STOP).and_then(|()| self.mode(&start));
        }
        got?.map_err(|ending| self.gone(&ending))
    }

    fn remark(&self) -> Option<String> {
        let stamps = match self.lines.told().has_stamps {
            true => "have the adapter's time stamps, in steps of 1 \u{b5}s",
            false => "have the time at which they came from the adapter",
        };
        Some(format!("frames heard and the echoes of frames sent {stamps}"))
    }
}

/// Transfers as records of one length.
struct Records {
    from: Box<dyn Read + Send>,
    left: Vec<u8>,
}

impl Read for Records {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        if self.left.is_empty() {
            let mut transfer = [0; 512];
            match self.from.read(&mut transfer)? {
                0 => return Ok(0),
                length => self.left = codec::record(&transfer[..length]).to_vec(),
            }
        }
        let count = self.left.len().min(into.len());
        into[..count].copy_from_slice(&self.left[..count]);
        self.left.drain(..count);
        Ok(count)
    }
}

/// How many frames are under way at a time.
const UNDER_WAY: u32 = 10;
/// How many may wait for that.
const MOST_WAITING: usize = 1000;
/// Stamps count microseconds until their number is full.
const FULL: Duration = Duration::from_micros(1 << 32);

/// What is known of the conversation with an adapter.
struct Talk {
    name: String,
    channel: u8,
    has_stamps: bool,
    echoes: Echoes,
    /// By number.
    under_way: [Option<Frame>; UNDER_WAY as usize],
    waiting: VecDeque<Frame>,
    clock: FarClock,
    unwrapped: Unwrapped,
    /// Whether the controller has left the bus.
    is_off: bool,
}

impl Talk {
    const fn new(name: String, channel: u8, has_stamps: bool) -> Self {
        Self {
            name,
            channel,
            has_stamps,
            echoes: Echoes::new(true),
            under_way: [None; UNDER_WAY as usize],
            waiting: VecDeque::new(),
            clock: FarClock::new(Duration::from_micros(1)),
            unwrapped: Unwrapped::new(FULL),
            is_off: false,
        }
    }

    /// The transfers for what waits, as far as there is room.
    fn next(&mut self) -> Option<Vec<u8>> {
        let free = self.under_way.iter().position(Option::is_none)?;
        let frame = self.waiting.pop_front()?;
        self.under_way[free] = Some(frame);
        Some(codec::transfer(&frame, free as u32, self.channel).to_vec())
    }

    fn stamped(&mut self, at: Instant, stamp: Option<u32>) -> Instant {
        let Some(stamp) = stamp else { return at };
        let stamp = self.unwrapped.count(at, u64::from(stamp) * 1000);
        self.clock.time(at, stamp)
    }

    fn trouble(&mut self, class: u32, data: [u8; 8], inbox: &mut Inbox) {
        if class & trouble::CLASS_BUS_OFF != 0 {
            // Started anew, the adapter knows nothing of what it was sent.
            self.is_off = true;
            self.under_way = [None; UNDER_WAY as usize];
            self.waiting.clear();
            self.echoes = Echoes::new(true);
        }
        if let Some(what) = trouble::of(class, Some(data)) {
            inbox.fault(BusError::Controller(what));
        }
    }
}

impl Speech for Talk {
    const LONGEST: usize = RECORD + 1;

    fn ends(message: &[u8]) -> bool {
        message.len() == RECORD
    }

    fn send(&mut self, now: Instant, frame: &Frame, inbox: &mut Inbox) -> Vec<u8> {
        if self.waiting.len() >= MOST_WAITING {
            let what = format!("that {} does not send: {MOST_WAITING} frames wait", self.name);
            inbox.fault(BusError::Controller(what));
            return Vec::new();
        }
        self.waiting.push_back(*frame);
        self.echoes.sent(now, *frame, inbox);
        self.next().unwrap_or_default()
    }

    fn take(&mut self, at: Instant, message: &[u8], inbox: &mut Inbox) -> Result<(), Ending> {
        let heard = match codec::parse(message, self.has_stamps) {
            Ok(heard) => heard,
            Err(why) => {
                let name = &self.name;
                let what = format!("the adapter {name} sent what is no frame: {why}");
                inbox.fault(BusError::Lost(what));
                return Ok(());
            }
        };
        if heard.channel != self.channel {
            return Ok(());
        }
        if heard.overflow {
            inbox.fault(BusError::Lost(format!(
                "frames were lost in the adapter {}: they came faster than it passed them on",
                self.name
            )));
        }
        match heard.what {
            What::Frame(frame) => {
                let at = self.stamped(at, heard.stamp);
                self.echoes.precede(at, inbox);
                inbox.heard(at, frame);
            }
            What::Echo(number) => {
                let place = self.under_way.get_mut(number as usize);
                if let Some(frame) = place.and_then(Option::take) {
                    let at = self.stamped(at, heard.stamp);
                    self.echoes.confirmed_by(&frame, at, inbox);
                }
            }
            What::Error(class, data) => self.trouble(class, data, inbox),
        }
        Ok(())
    }

    fn due(&mut self, now: Instant, inbox: &mut Inbox) -> Option<Vec<u8>> {
        if self.echoes.give_up(now, inbox) {
            inbox.fault(BusError::Controller(trouble::NO_ACK.to_owned()));
            self.echoes = Echoes::new(true);
        }
        self.next()
    }
}
