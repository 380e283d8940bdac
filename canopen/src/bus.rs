//! The two basic traits: a bus owns time, a device is a value.

use std::collections::VecDeque;
use std::fmt;

use crate::bench::{Bench, BenchError, Needs};
use crate::frame::Frame;
use crate::time::Instant;
use crate::value::Value;

/// A wire and its clock. Waiting is receiving: there is no other way to let time pass.
pub trait Bus {
    /// The time on this bus.
    fn now(&mut self) -> Instant;

    /// Queues a frame for transmission. Its echo comes back from [`Bus::recv`] with
    /// [`Stamped::own`] set once it is complete on the wire.
    fn send(&mut self, frame: &Frame) -> Result<(), BusError>;

    /// The next frame that is complete by `until`, or `None` when `until` has come.
    fn recv(&mut self, until: Instant) -> Result<Option<Stamped>, BusError>;

    /// Whether time passes by itself, so that the user of this bus can be late.
    fn is_real(&self) -> bool {
        false
    }

    /// How its frames get their times, where that is worth a remark in a report.
    fn remark(&self) -> Option<String> {
        None
    }

    /// The bench around the device under test; `None` if there is none.
    fn bench(&mut self) -> Option<&mut dyn Bench> {
        None
    }
}

/// A frame with the time at which it was complete on the wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stamped {
    /// End of the frame.
    pub at: Instant,
    /// The frame.
    pub frame: Frame,
    /// Whether it is the echo of a frame sent through this handle of the bus.
    pub own: bool,
}

/// Why a bus could not do what it was asked for. Says nothing about any device.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum BusError {
    /// The interface could not be opened; the text says what to do about it.
    Open(String),
    /// The interface failed while in use.
    Io(String),
    /// The CAN controller reported an error condition, such as error passive or bus-off.
    Controller(String),
    /// Frames were lost on their way from the interface; the text says how many, and why.
    Lost(String),
    /// The user asked to stop while the bus was waiting.
    Interrupted,
    /// The frame was not sent, since it does to a device what must not be done; the text says what
    /// that is and what protects the device.
    Withheld(String),
    /// The device is a program that ended; the text says how and what it was sent last. It was
    /// started again, so that what follows can be tried.
    Ended(String),
    /// A simulated device asked to be polled again and again without time passing.
    Spinning {
        /// The device's place on the bus, counted from 0.
        station: usize,
        /// When it happened.
        at: Instant,
    },
}

impl fmt::Display for BusError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Open(why)
            | Self::Io(why)
            | Self::Lost(why)
            | Self::Withheld(why)
            | Self::Ended(why) => f.write_str(why),
            Self::Controller(what) => write!(f, "the CAN controller reports {what}"),
            Self::Interrupted => f.write_str("interrupted"),
            Self::Spinning { station, at } => {
                write!(f, "simulated device {station} does not let time pass at {at} s")
            }
        }
    }
}

impl std::error::Error for BusError {}

/// A CANopen device as a value: frames and time go in, frames and the next deadline come out.
pub trait Device {
    /// Takes a frame of another station.
    fn handle_frame(&mut self, now: Instant, frame: &Frame, out: &mut Outbox);

    /// Does what is due at `now`. Harmless when nothing is.
    fn handle_timeout(&mut self, now: Instant, out: &mut Outbox);

    /// When [`Device::handle_timeout`] is wanted next. Too early is harmless, too late is not.
    fn poll_at(&self) -> Option<Instant>;

    /// The names of what can be set and observed on its physical side.
    fn bench_names(&self) -> Vec<String> {
        Vec::new()
    }

    /// How the device must be set up for stimuli to reach it.
    fn bench_needs(&self) -> Needs {
        Needs::new()
    }

    /// Takes a stimulus.
    ///
    /// # Errors
    /// When there is none of that name, or it does not take the value.
    fn stimulate(
        &mut self,
        _now: Instant,
        name: &str,
        _value: &Value,
        _out: &mut Outbox,
    ) -> Result<(), BenchError> {
        Err(BenchError::unknown(name))
    }

    /// The value seen from outside; for a stimulus, the value that was set.
    fn observe(&self, _name: &str) -> Option<Value> {
        None
    }
}

/// The frames a station wants to send, in its own order.
#[derive(Clone, Debug, Default)]
pub struct Outbox {
    frames: VecDeque<Frame>,
}

impl Outbox {
    /// Queues a frame.
    pub fn push(&mut self, frame: Frame) {
        self.frames.push_back(frame);
    }

    /// The next frame to send, left in place.
    pub fn first(&self) -> Option<&Frame> {
        self.frames.front()
    }

    /// Takes the next frame to send.
    pub fn pop(&mut self) -> Option<Frame> {
        self.frames.pop_front()
    }

    /// Drops everything that waits, as a controller does on a reset.
    pub fn clear(&mut self) {
        self.frames.clear();
    }

    /// Whether nothing waits.
    pub fn is_empty(&self) -> bool {
        self.frames.is_empty()
    }

    /// How many frames wait.
    pub fn len(&self) -> usize {
        self.frames.len()
    }
}

/// Runs `device` as a station of `bus` until `end`. A station that runs late, as a program on a
/// busy machine does, still meets things in the order in which they happened: a frame that came
/// before a timeout was due is handled before it.
///
/// # Errors
/// Whatever the bus reports.
pub fn serve(bus: &mut dyn Bus, device: &mut dyn Device, end: Instant) -> Result<(), BusError> {
    let mut out = Outbox::default();
    loop {
        while let Some(frame) = out.pop() {
            bus.send(&frame)?;
        }
        let due = device.poll_at().unwrap_or(Instant::NEVER);
        if let Some(seen) = bus.recv(due.min(end))? {
            if !seen.own {
                device.handle_frame(seen.at, &seen.frame, &mut out);
            }
            continue;
        }
        let now = bus.now();
        if due <= now {
            device.handle_timeout(now, &mut out);
        }
        if now >= end && out.is_empty() {
            return Ok(());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A bus whose station looks at `now`, when two frames have come.
    struct Late {
        now: Instant,
        came: VecDeque<Stamped>,
        sent: Vec<Frame>,
    }

    impl Bus for Late {
        fn now(&mut self) -> Instant {
            self.now
        }
        fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
            self.sent.push(*frame);
            Ok(())
        }
        fn recv(&mut self, until: Instant) -> Result<Option<Stamped>, BusError> {
            if self.came.front().is_some_and(|seen| seen.at <= until) {
                return Ok(self.came.pop_front());
            }
            self.now = self.now.max(until);
            Ok(None)
        }
    }

    /// Sends the identifiers of what it got, and 7FFh when its time has come.
    struct Diary {
        due: Option<Instant>,
    }

    impl Device for Diary {
        fn handle_frame(&mut self, _now: Instant, frame: &Frame, out: &mut Outbox) {
            out.push(*frame);
        }
        fn handle_timeout(&mut self, _now: Instant, out: &mut Outbox) {
            self.due = None;
            out.push(Frame::new(0x7FF, []));
        }
        fn poll_at(&self) -> Option<Instant> {
            self.due
        }
    }

    #[test]
    fn a_late_station_sees_frames_and_its_timeout_in_their_order() {
        let frames = [1, 3].map(|at| Stamped {
            at: Instant(at),
            frame: Frame::new(at as u16, []),
            own: false,
        });
        let mut bus = Late { now: Instant(9), came: frames.into(), sent: Vec::new() };
        let mut device = Diary { due: Some(Instant(2)) };
        assert_eq!(serve(&mut bus, &mut device, Instant(9)), Ok(()));
        assert_eq!(bus.sent, [1, 0x7FF, 3].map(|id| Frame::new(id, [])));
    }
}
