//! Bus backends: the only places that touch hardware, and the only ones that read a clock.
//!
//! What an adapter does with frames and times belongs here. Where a device is found on it belongs
//! to [`target`](crate::target).

mod calendar;
mod echo;
mod far_clock;
pub mod gs_usb;
mod lines;
pub(crate) mod load;
mod names;
mod port;
mod program;
mod python_can;
mod slcan;
// What only one system has is left out here, and nowhere else.
#[cfg(target_os = "linux")]
pub mod socketcan;
#[cfg(not(target_os = "linux"))]
#[path = "bus/no_socketcan.rs"]
pub mod socketcan;
mod socketcand;
mod trouble;
mod watch;

use std::fmt;
use std::str::FromStr;
use std::sync::Arc;

use canopen::{Bus, BusError};

use gs_usb::GS_USB;
use load::Load;
use names::is_virtual;
use program::{OnInterface, OnPipes};
use python_can::PYTHON_CAN;
use socketcan::SocketCan;

use runner::stop::Stop;

pub use calendar::unix_time;
pub use gs_usb::GsUsb;
pub use lines::Stdio;
pub use python_can::PythonCan;
pub(crate) use python_can::plugged_in as of_python_can;
pub use slcan::Slcan;
pub use socketcan::Bell;
pub use socketcand::Socketcand;
pub(crate) use watch::{Reached, Watch};

/// A CAN interface by the name that a user gives it. A new backend is a variant here: the compiler
/// then asks how it is written and opened, and the test below how it is read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Interface {
    /// A network interface of Linux, such as `can0`.
    SocketCan(String),
    /// A program that is the device: it speaks frames as lines on its standard input and output,
    /// `exec:COMMAND`, or on an interface of Linux, `exec@vcan0:COMMAND`.
    Program {
        /// The program with its arguments, which blanks separate.
        command: String,
        /// The interface.
        on: Option<String>,
    },
    /// An adapter with Lawicel's protocol, `slcan:/dev/ttyACM0` or `slcan:tcp://host:port`.
    Slcan(Slcan),
    /// An interface of another machine, `socketcand://host:29536/can0`.
    Socketcand(Socketcand),
    /// An adapter that python-can drives, `python-can:pcan:PCAN_USBBUS1`.
    PythonCan(PythonCan),
    /// An adapter with the protocol gs_usb, `gs_usb:` or `gs_usb:SERIAL`.
    GsUsb(GsUsb),
}

impl Interface {
    /// Its bit rate in bit/s, when that can be found out; `usual` where nothing depends on it.
    pub fn bit_rate(&self, usual: u32) -> Option<u32> {
        match self {
            Self::SocketCan(name) => SocketCan::bit_rate(name, usual),
            Self::Program { on: Some(name), .. } => SocketCan::bit_rate(name, usual),
            // Pipes have no bit rate that could be too fast for a suite.
            Self::Program { on: None, .. } => Some(usual),
            // The protocols have no question for it.
            Self::Slcan(adapter) => adapter.bit_rate,
            Self::Socketcand(interface) => interface.is_virtual().then_some(usual),
            Self::PythonCan(bus) => bus.bit_rate().or_else(|| bus.is_virtual().then_some(usual)),
            Self::GsUsb(adapter) => adapter.bit_rate,
        }
    }

    /// The bit rate that it is set to, in bit/s; `None` also where there is none.
    pub fn own_bit_rate(&self) -> Option<u32> {
        match self {
            Self::Slcan(adapter) => return adapter.bit_rate,
            Self::PythonCan(bus) => return bus.bit_rate(),
            Self::GsUsb(adapter) => return adapter.bit_rate,
            Self::SocketCan(_) | Self::Program { .. } | Self::Socketcand(_) => {}
        }
        let name = self.network()?;
        if is_virtual(name) { None } else { SocketCan::bit_rate(name, 0) }
    }

    /// The same interface at this bit rate in bit/s, if one is said and opening it sets one.
    #[must_use]
    pub fn at_bit_rate(mut self, said: Option<u32>) -> Self {
        match (&mut self, said) {
            (Self::Slcan(adapter), Some(said)) => adapter.bit_rate = Some(said),
            (Self::PythonCan(bus), Some(said)) => bus.set_bit_rate(said),
            (Self::GsUsb(adapter), Some(said)) => adapter.bit_rate = Some(said),
            _ => {}
        }
        self
    }

    /// Whether other stations can be on it: it is no pair of pipes.
    pub const fn is_shared(&self) -> bool {
        !matches!(self, Self::Program { on: None, .. })
    }

    /// Whether the device ends with the harness, since it is a program that the harness starts.
    pub const fn is_program(&self) -> bool {
        match self {
            Self::Program { .. } => true,
            Self::SocketCan(_)
            | Self::Slcan(_)
            | Self::Socketcand(_)
            | Self::PythonCan(_)
            | Self::GsUsb(_) => false,
        }
    }

    /// Whether the device waits for this machine, as a program does: one behind a virtual interface
    /// is one, or is reached through one.
    pub fn is_on_this_machine(&self) -> bool {
        match self {
            Self::Slcan(adapter) => adapter.is_on_this_machine(),
            Self::Socketcand(interface) => interface.is_on_this_machine(),
            Self::PythonCan(bus) => bus.is_virtual(),
            Self::GsUsb(_) => false,
            Self::SocketCan(_) | Self::Program { .. } => {
                self.is_program() || self.network().is_some_and(is_virtual)
            }
        }
    }

    /// The network interface of Linux that it is on, which other programs such as `candump` know,
    /// too.
    pub fn network(&self) -> Option<&str> {
        match self {
            Self::SocketCan(name) | Self::Program { on: Some(name), .. } => Some(name),
            Self::Program { on: None, .. }
            | Self::Slcan(_)
            | Self::Socketcand(_)
            | Self::PythonCan(_)
            | Self::GsUsb(_) => None,
        }
    }

    /// Opens the interface. `stop` ends every wait on it.
    ///
    /// # Errors
    /// [`BusError::Open`] with the reason, and what to do about it.
    pub fn open(&self, stop: &Stop) -> Result<Box<dyn Bus>, BusError> {
        self.open_beside(stop, Beside::default())
    }

    /// The same with something beside it.
    ///
    /// # Errors
    /// The same.
    pub(crate) fn open_beside(
        &self,
        stop: &Stop,
        beside: Beside<'_>,
    ) -> Result<Box<dyn Bus>, BusError> {
        let Beside { watch, load } = beside;
        match self {
            Self::SocketCan(name) => Ok(Box::new(loaded(name, stop, load)?)),
            Self::Program { command, on: None } => {
                Ok(Box::new(OnPipes::open(command, stop, watch.cloned())?))
            }
            Self::Program { command, on: Some(name) } => Ok(Box::new(OnInterface::open(
                command,
                loaded(name, stop, load)?,
                name,
                watch.cloned(),
            )?)),
            Self::Slcan(adapter) => Ok(Box::new(adapter.open(stop)?)),
            Self::Socketcand(interface) => Ok(Box::new(interface.open(stop)?)),
            Self::PythonCan(bus) => Ok(Box::new(bus.open(stop)?)),
            Self::GsUsb(adapter) => adapter.open(stop),
        }
    }
}

/// What there is beside an interface.
#[derive(Clone, Copy, Default)]
pub(crate) struct Beside<'b> {
    /// What a program tells beside its frames.
    pub(crate) watch: Option<&'b Arc<Watch>>,
    /// What fills the bus; an interface with a [network](Interface::network) can be filled.
    pub(crate) load: Option<&'b Load>,
}

fn loaded(name: &str, stop: &Stop, load: Option<&Load>) -> Result<SocketCan, BusError> {
    let bus = SocketCan::open(name, stop.clone())?;
    match load {
        Some(load) => bus.with_load(load),
        None => Ok(bus),
    }
}

/// As on the command line.
impl fmt::Display for Interface {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::SocketCan(name) => f.write_str(name),
            Self::Program { command, on: None } => write!(f, "exec:{command}"),
            Self::Program { command, on: Some(name) } => write!(f, "exec@{name}:{command}"),
            Self::Slcan(adapter) => write!(f, "{SLCAN}{adapter}"),
            Self::Socketcand(interface) => write!(f, "{SOCKETCAND}{interface}"),
            Self::PythonCan(bus) => write!(f, "{PYTHON_CAN}{bus}"),
            Self::GsUsb(adapter) => write!(f, "{GS_USB}{adapter}"),
        }
    }
}

impl FromStr for Interface {
    type Err = NotAnInterface;

    /// Linux allows anything without blanks and slashes. A colon belongs to the name of another
    /// backend.
    fn from_str(text: &str) -> Result<Self, NotAnInterface> {
        const NO: NotAnInterface = NotAnInterface { why: None };
        let why = |why| NotAnInterface { why: Some(why) };
        if let Some(adapter) = text.strip_prefix(SLCAN) {
            return adapter.parse().map(Self::Slcan).map_err(why);
        }
        if let Some(interface) = text.strip_prefix(SOCKETCAND) {
            return interface.parse().map(Self::Socketcand).map_err(why);
        }
        if let Some(bus) = text.strip_prefix(PYTHON_CAN) {
            return bus.parse().map(Self::PythonCan).map_err(why);
        }
        if let Some(adapter) = text.strip_prefix(GS_USB) {
            return adapter.parse().map(Self::GsUsb).map_err(why);
        }
        if let Some((exec, command)) = text.split_once(':') {
            let on = match exec.strip_prefix("exec").ok_or(NO)? {
                "" => None,
                on => {
                    let name = on.strip_prefix('@').filter(|name| is_name(name));
                    Some(name.ok_or(NO)?)
                }
            };
            let command = Some(command.trim()).filter(|command| !command.is_empty());
            let command = command.ok_or(NO)?.to_owned();
            return Ok(Self::Program { command, on: on.map(str::to_owned) });
        }
        if is_name(text) { Ok(Self::SocketCan(text.to_owned())) } else { Err(NO) }
    }
}

const SLCAN: &str = "slcan:";
const SOCKETCAND: &str = "socketcand:";

fn is_name(text: &str) -> bool {
    let no = |c: char| c == '/' || c == ':' || c.is_whitespace();
    !text.is_empty() && text.len() < 16 && !text.contains(no)
}

/// No backend takes this for the name of an interface.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NotAnInterface {
    /// What is wrong with it, when it is clear which backend is meant.
    pub why: Option<String>,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One interface of each kind: the compiler asks here for the kind that is missing.
    fn after(interface: Option<&Interface>) -> Option<Interface> {
        match interface {
            None => Some(Interface::SocketCan("vcan0".to_owned())),
            Some(Interface::SocketCan(_)) => {
                Some(Interface::Program { command: "./sim --fast".to_owned(), on: None })
            }
            Some(Interface::Program { command, on: None }) => {
                Some(Interface::Program { command: command.clone(), on: Some("vcan0".to_owned()) })
            }
            Some(Interface::Program { on: Some(_), .. }) => {
                Some("slcan:/dev/ttyACM0,serial=57600,bitrate=500000".parse().unwrap())
            }
            Some(Interface::Slcan(_)) => Some("socketcand://rig:29536/can0".parse().unwrap()),
            Some(Interface::Socketcand(_)) => {
                Some("python-can:pcan:PCAN_USBBUS1,bitrate=500000,fd=False".parse().unwrap())
            }
            Some(Interface::PythonCan(_)) => {
                Some("gs_usb:0042,channel=1,bitrate=500000".parse().unwrap())
            }
            Some(Interface::GsUsb(_)) => None,
        }
    }

    #[test]
    fn a_device_on_a_virtual_interface_runs_on_this_machine() {
        for (text, is_here) in [
            ("vcan0", true),
            ("exec:./sim", true),
            ("can0", false),
            ("slcan:/dev/ttyACM0", false),
            ("slcan:/dev/pts/7", true),
            ("slcan:tcp://127.0.0.1:2000", true),
            ("slcan:tcp://rig:2000", false),
            ("socketcand://localhost/vcan0", true),
            ("socketcand://rig/can0", false),
            ("python-can:virtual:1", true),
            ("python-can:socketcan:vcan0", true),
            ("python-can:pcan", false),
            ("gs_usb:", false),
        ] {
            let interface: Interface = text.parse().expect("an interface");
            assert_eq!(interface.is_on_this_machine(), is_here, "{text}");
        }
    }

    #[test]
    fn every_interface_is_read_as_it_is_written() {
        let mut last = None;
        while let Some(interface) = after(last.as_ref()) {
            assert_eq!(interface.to_string().parse(), Ok(interface.clone()));
            last = Some(interface);
        }
        for text in ["", "a name", "longer-than-16-characters", "exec:", "exec@:a", "exec@a b:c"] {
            assert_eq!(text.parse::<Interface>(), Err(NotAnInterface { why: None }), "{text:?}");
        }
        for (text, part) in [
            ("slcan:", "such as `slcan:/dev/ttyACM0`"),
            ("slcan:ttyACM0", "such as `slcan:/dev/ttyACM0`"),
            ("slcan:tcp://rig", "`slcan:tcp://host:port`"),
            ("slcan:/dev/ttyACM0,bitrate=fast", "`,bitrate=fast`: `,bitrate=500000`"),
            ("slcan:/dev/ttyACM0,bitrate=1,bitrate=1", "`,bitrate=1`: "),
            ("slcan:tcp://rig:1,serial=9600", "`,serial=9600`: "),
            ("socketcand://rig", "is `socketcand://host:29536/can0`"),
            ("socketcand:rig/can0", "is `socketcand://host:29536/can0`"),
            ("python-can:", "`python-can:INTERFACE:CHANNEL`"),
            ("python-can:a b:1", "`python-can:INTERFACE:CHANNEL`"),
            ("python-can:pcan:1,fast", "`,fast`: `,KEY=VALUE`"),
            ("python-can:pcan:1,a=1,a=2", "`,a=2`: `,KEY=VALUE`"),
            ("gs_usb:,fast", "`,fast`: `,bitrate=500000`"),
            ("gs_usb:,channel=300", "`,channel=300`: "),
        ] {
            let why = text.parse::<Interface>().unwrap_err().why.expect(text);
            assert!(why.contains(part), "{text}: {why}");
        }
        for (text, whole) in [
            ("socketcand://rig/can0", "socketcand://rig:29536/can0"),
            ("socketcand://[::1]/can0", "socketcand://[::1]:29536/can0"),
        ] {
            assert_eq!(text.parse::<Interface>().unwrap().to_string(), whole);
        }
    }

    #[test]
    fn what_is_said_beats_the_bit_rate_in_the_name() {
        let adapter: Interface = "slcan:/dev/ttyACM0,bitrate=125000".parse().unwrap();
        assert_eq!(adapter.bit_rate(1_000_000), Some(125_000));
        assert_eq!(adapter.clone().at_bit_rate(None), adapter);
        let other = adapter.at_bit_rate(Some(500_000));
        assert_eq!(other.to_string(), "slcan:/dev/ttyACM0,bitrate=500000");
        let adapter: Interface = "python-can:pcan:1,bitrate=125000,fd=False".parse().unwrap();
        assert_eq!(adapter.bit_rate(1_000_000), Some(125_000));
        let other = adapter.at_bit_rate(Some(500_000));
        assert_eq!(other.to_string(), "python-can:pcan:1,fd=False,bitrate=500000");
    }
}
