//! In the place of SocketCAN where the operating system has none: an interface of Linux that
//! nobody can open.

use std::env::consts::OS;

use canopen::{Bus, BusError, Frame, Instant, Stamped};
use runner::stop::Stop;

use super::load::Load;

/// An open interface, of which there is none.
#[derive(Debug)]
pub enum SocketCan {}

/// A bell that ends the wait of one.
#[derive(Clone, Debug)]
pub enum Bell {}

impl SocketCan {
    /// Refuses to open the interface `name`.
    ///
    /// # Errors
    /// [`BusError::Open`] with what works here.
    pub fn open(name: &str, _stop: Stop) -> Result<Self, BusError> {
        Err(BusError::Open(format!(
            "{name} would be a network interface of Linux (SocketCAN), which {OS} does not have: \
             `slcan:`, `gs_usb:`, `python-can:`, `socketcand:` and `exec:` work here, and \
             `harness scan --adapters` lists the adapters that are plugged in"
        )))
    }

    /// The same with a bell.
    ///
    /// # Errors
    /// None.
    pub fn with_bell(self) -> Result<(Self, Bell), BusError> {
        match self {}
    }

    /// The same without the frames of a load.
    ///
    /// # Errors
    /// None.
    pub(crate) fn deaf_to_loads(self) -> Result<Self, BusError> {
        match self {}
    }

    /// The same beside a load of the bus.
    ///
    /// # Errors
    /// None.
    pub(crate) fn with_load(self, _load: &Load) -> Result<Self, BusError> {
        match self {}
    }

    /// The bit rate of an interface that is not there.
    pub fn bit_rate(_name: &str, _usual: u32) -> Option<u32> {
        None
    }
}

impl Bell {
    /// Ends the wait that goes on, or else the next one.
    pub fn ring(&self) {
        match *self {}
    }
}

impl Bus for SocketCan {
    fn now(&mut self) -> Instant {
        match *self {}
    }

    fn send(&mut self, _frame: &Frame) -> Result<(), BusError> {
        match *self {}
    }

    fn recv(&mut self, _until: Instant) -> Result<Option<Stamped>, BusError> {
        match *self {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interface_of_linux_is_refused_with_what_works_here() {
        let refused = SocketCan::open("can0", Stop::default()).unwrap_err().to_string();
        assert!(refused.starts_with("can0 would be a network interface of Linux"), "{refused}");
        assert!(refused.contains(&format!("{OS} does not have: `slcan:`")), "{refused}");
    }
}
