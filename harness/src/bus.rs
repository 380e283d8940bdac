//! Bus backends: the only places that touch hardware, and the only ones that read a clock.

mod calendar;
pub mod socketcan;

use std::fmt;
use std::str::FromStr;

use canopen::{Bus, BusError};

use socketcan::SocketCan;

use crate::stop::Stop;

pub use calendar::unix_time;

/// A CAN interface by the name that a user gives it. A new backend is a variant here: the compiler
/// then asks how it is written and opened, and the test below how it is read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Interface {
    /// A network interface of Linux, such as `can0`.
    SocketCan(String),
}

impl Interface {
    /// Its bit rate in bit/s, when that can be found out; `usual` where nothing depends on it.
    pub fn bit_rate(&self, usual: u32) -> Option<u32> {
        match self {
            Self::SocketCan(name) => SocketCan::bit_rate(name, usual),
        }
    }

    /// Opens the interface. `stop` ends every wait on it.
    ///
    /// # Errors
    /// [`BusError::Open`] with the reason, and what to do about it.
    pub fn open(&self, stop: &Stop) -> Result<Box<dyn Bus>, BusError> {
        match self {
            Self::SocketCan(name) => Ok(Box::new(SocketCan::open(name, stop.clone())?)),
        }
    }
}

/// As on the command line.
impl fmt::Display for Interface {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::SocketCan(name) => f.write_str(name),
        }
    }
}

impl FromStr for Interface {
    type Err = NotAnInterface;

    /// Linux allows anything without blanks and slashes. A colon belongs to the name of another
    /// backend, as in `slcan:/dev/ttyACM0`.
    fn from_str(text: &str) -> Result<Self, NotAnInterface> {
        let is_name = !text.is_empty()
            && text.len() < 16
            && !text.contains(|c: char| c == '/' || c == ':' || c.is_whitespace());
        if is_name { Ok(Self::SocketCan(text.to_owned())) } else { Err(NotAnInterface) }
    }
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
            Some(Interface::SocketCan(_)) => None,
        }
    }

    #[test]
    fn every_interface_is_read_as_it_is_written() {
        let mut last = None;
        while let Some(interface) = after(last.as_ref()) {
            assert_eq!(interface.to_string().parse(), Ok(interface.clone()));
            last = Some(interface);
        }
        for text in ["", "slcan:/dev/ttyACM0", "a name", "longer-than-16-characters"] {
            assert_eq!(text.parse::<Interface>(), Err(NotAnInterface), "{text:?}");
        }
    }
}
