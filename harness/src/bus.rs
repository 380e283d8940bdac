//! Bus backends: the only places that touch hardware, and the only ones that read a clock.
//!
//! What an adapter does with frames and times belongs here. Where a device is found on it belongs
//! to [`target`](crate::target).

mod bell;
mod calendar;
mod lines;
mod program;
pub mod socketcan;
mod watch;

use std::fmt;
use std::str::FromStr;
use std::sync::Arc;

use canopen::{Bus, BusError};

use program::{OnInterface, OnPipes};
use socketcan::SocketCan;

use runner::stop::Stop;

pub use bell::Bell;
pub use calendar::unix_time;
pub use lines::Stdio;
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
}

impl Interface {
    /// Its bit rate in bit/s, when that can be found out; `usual` where nothing depends on it.
    pub fn bit_rate(&self, usual: u32) -> Option<u32> {
        match self {
            Self::SocketCan(name) => SocketCan::bit_rate(name, usual),
            Self::Program { on: Some(name), .. } => SocketCan::bit_rate(name, usual),
            // Pipes have no bit rate that could be too fast for a suite.
            Self::Program { on: None, .. } => Some(usual),
        }
    }

    /// The bit rate that it is set to, in bit/s; `None` also where there is none.
    pub fn own_bit_rate(&self) -> Option<u32> {
        let name = self.network()?;
        if SocketCan::is_virtual(name) { None } else { SocketCan::bit_rate(name, 0) }
    }

    /// Whether the device ends with the harness, since it is a program that the harness starts.
    pub const fn is_program(&self) -> bool {
        match self {
            Self::Program { .. } => true,
            Self::SocketCan(_) => false,
        }
    }

    /// Whether the device waits for this machine, as a program does: one behind a virtual interface
    /// is one, or is reached through one.
    pub fn is_on_this_machine(&self) -> bool {
        self.is_program() || self.network().is_some_and(SocketCan::is_virtual)
    }

    /// The network interface of Linux that it is on, which other programs such as `candump` know,
    /// too.
    pub fn network(&self) -> Option<&str> {
        match self {
            Self::SocketCan(name) | Self::Program { on: Some(name), .. } => Some(name),
            Self::Program { on: None, .. } => None,
        }
    }

    /// Opens the interface. `stop` ends every wait on it.
    ///
    /// # Errors
    /// [`BusError::Open`] with the reason, and what to do about it.
    pub fn open(&self, stop: &Stop) -> Result<Box<dyn Bus>, BusError> {
        self.open_watched(stop, None)
    }

    /// The same with a program that tells more.
    ///
    /// # Errors
    /// The same.
    pub(crate) fn open_watched(
        &self,
        stop: &Stop,
        watch: Option<&Arc<Watch>>,
    ) -> Result<Box<dyn Bus>, BusError> {
        match self {
            Self::SocketCan(name) => Ok(Box::new(SocketCan::open(name, stop.clone())?)),
            Self::Program { command, on: None } => {
                Ok(Box::new(OnPipes::open(command, stop, watch.cloned())?))
            }
            Self::Program { command, on: Some(name) } => {
                Ok(Box::new(OnInterface::open(command, name, stop, watch.cloned())?))
            }
        }
    }
}

/// As on the command line.
impl fmt::Display for Interface {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::SocketCan(name) => f.write_str(name),
            Self::Program { command, on: None } => write!(f, "exec:{command}"),
            Self::Program { command, on: Some(name) } => write!(f, "exec@{name}:{command}"),
        }
    }
}

impl FromStr for Interface {
    type Err = NotAnInterface;

    /// Linux allows anything without blanks and slashes. A colon belongs to the name of another
    /// backend, as in `slcan:/dev/ttyACM0`.
    fn from_str(text: &str) -> Result<Self, NotAnInterface> {
        if let Some((exec, command)) = text.split_once(':') {
            let on = match exec.strip_prefix("exec").ok_or(NotAnInterface)? {
                "" => None,
                on => {
                    Some(on.strip_prefix('@').filter(|name| is_name(name)).ok_or(NotAnInterface)?)
                }
            };
            let command = Some(command.trim()).filter(|command| !command.is_empty());
            let command = command.ok_or(NotAnInterface)?.to_owned();
            return Ok(Self::Program { command, on: on.map(str::to_owned) });
        }
        if is_name(text) { Ok(Self::SocketCan(text.to_owned())) } else { Err(NotAnInterface) }
    }
}

fn is_name(text: &str) -> bool {
    let no = |c: char| c == '/' || c == ':' || c.is_whitespace();
    !text.is_empty() && text.len() < 16 && !text.contains(no)
}

/// No backend takes this for the name of an interface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NotAnInterface;

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
            Some(Interface::Program { on: Some(_), .. }) => None,
        }
    }

    #[test]
    fn a_device_on_a_virtual_interface_runs_on_this_machine() {
        for (text, is_here) in [("vcan0", true), ("exec:./sim", true), ("can0", false)] {
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
        for text in [
            "",
            "slcan:/dev/ttyACM0",
            "a name",
            "longer-than-16-characters",
            "exec:",
            "exec@:a",
            "exec@a b:c",
        ] {
            assert_eq!(text.parse::<Interface>(), Err(NotAnInterface), "{text:?}");
        }
    }
}
