//! The frames of a run as a log of candump, which `canplayer`, python-can and `harness decode`
//! read.

use std::io::{self, Write};

use crate::event::Event;
use crate::recorder::{Recorder, interface};

/// Writes the log.
#[derive(Debug, Default)]
pub struct Candump {
    target: String,
    /// When the run began, in seconds since 1970.
    began: u64,
    /// How many devices there were, and the interface of the last one.
    devices: usize,
    interface: String,
}

impl Recorder for Candump {
    fn take(&mut self, event: &Event, out: &mut dyn Write) -> io::Result<()> {
        match event {
            Event::RunStarted(run) => {
                self.target.clone_from(&run.target);
                self.began = run.began.unwrap_or_default();
            }
            Event::DeviceStarted(_) => {
                self.interface = interface(&self.target, self.devices);
                self.devices += 1;
            }
            Event::Frame(stamped) => {
                let (seconds, rest) = (stamped.at.0 / NANOS, stamped.at.0 % NANOS);
                let (seconds, micros) = (self.began + seconds, rest / 1_000);
                let Self { interface, .. } = self;
                writeln!(out, "({seconds:010}.{micros:06}) {interface} {}", stamped.frame)?;
            }
            _ => {}
        }
        Ok(())
    }

    fn end(&mut self, _out: &mut dyn Write) -> io::Result<()> {
        Ok(())
    }
}

/// The beginning of each log.
pub(crate) const BEGINS: &[u8] = b"(";
const NANOS: u64 = 1_000_000_000;
