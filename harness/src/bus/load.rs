//! A bus that is kept busy with frames of nobody, under which a device must keep its promises.

use std::cell::Cell;
use std::rc::Rc;
use std::time::Duration;

use canopen::wire::{INTERMISSION_BITS, frame_bits};
use canopen::{Bench, Bus, BusError, Frame, Instant, Stamped};

/// The identifier of the frames that fill the wire: nobody's, and of a low priority, so that each
/// other frame waits for one of them at most.
const NOBODY: u16 = 0x7F0;
/// How many of them are sent at once: fewer than the queue of an interface has places for.
const AT_ONCE: u32 = 4;
/// Of how many of them the length is looked at.
const SAMPLE: u64 = 256;

/// How busy the wire was.
#[derive(Clone, Debug, Default)]
pub(crate) struct Busy(Rc<Cell<(u64, Duration)>>);

impl Busy {
    /// The time in which there were frames on the wire, in percent, and the whole time.
    pub(crate) fn share(&self, bit_rate: u32) -> (u64, Duration) {
        let (bits, time) = self.0.get();
        let most = time.as_micros() as u64 * u64::from(bit_rate) / 1_000_000;
        (100 * bits / most.max(1), time)
    }

    fn add(&self, bits: u64, time: Duration) {
        let (all, whole) = self.0.get();
        self.0.set((all + bits, whole + time));
    }
}

/// A bus with such frames.
pub(crate) struct Loaded {
    bus: Box<dyn Bus>,
    /// The time from one of them to the next.
    pause: Duration,
    next: Instant,
    number: u64,
    busy: Busy,
    /// When its use was last noted.
    noted: Instant,
}

impl Loaded {
    /// A bus whose frames of nobody alone take so many percent of its time.
    pub(crate) fn new(mut bus: Box<dyn Bus>, percent: u8, bit_rate: u32) -> (Self, Busy) {
        // How long one is depends on its bytes.
        let bits = (0..SAMPLE).map(|number| frame_bits(&filler(number)) + INTERMISSION_BITS);
        let nanoseconds = bits.sum::<u64>() * 100_000_000_000
            / (SAMPLE * u64::from(percent) * u64::from(bit_rate));
        let (now, busy) = (bus.now(), Busy::default());
        let pause = Duration::from_nanos(nanoseconds);
        let loaded = Self { bus, pause, next: now, number: 0, busy: busy.clone(), noted: now };
        (loaded, busy)
    }

    /// Sends those that are due. What could not be sent in time is not sent later, all at once.
    fn fill(&mut self) -> Result<(), BusError> {
        for _ in 0..AT_ONCE {
            self.bus.send(&filler(self.number))?;
            self.number += 1;
        }
        let now = self.bus.now();
        self.next = (self.next + self.pause * AT_ONCE).max(now);
        self.busy.add(0, now.since(self.noted));
        self.noted = now;
        Ok(())
    }
}

fn filler(number: u64) -> Frame {
    Frame::new(NOBODY, number.wrapping_mul(0x9E37_79B9_7F4A_7C15).to_le_bytes())
}

impl Bus for Loaded {
    fn now(&mut self) -> Instant {
        self.bus.now()
    }

    fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
        self.bus.send(frame)
    }

    fn recv(&mut self, until: Instant) -> Result<Option<Stamped>, BusError> {
        loop {
            if self.bus.now() >= self.next {
                self.fill()?;
            }
            match self.bus.recv(until.min(self.next))? {
                Some(seen) => {
                    self.busy.add(frame_bits(&seen.frame) + INTERMISSION_BITS, Duration::ZERO);
                    if !(seen.own && seen.frame.data_id() == Some(NOBODY)) {
                        return Ok(Some(seen));
                    }
                }
                None if until <= self.next => return Ok(None),
                None => {}
            }
        }
    }

    fn is_real(&self) -> bool {
        self.bus.is_real()
    }

    fn remark(&self) -> Option<String> {
        self.bus.remark()
    }

    fn bench(&mut self) -> Option<&mut dyn Bench> {
        self.bus.bench()
    }
}

#[cfg(test)]
mod tests {
    use canopen::VirtualBus;

    use super::*;

    const BIT_RATE: u32 = 1_000_000;

    fn loaded(percent: u8) -> (Loaded, Busy) {
        Loaded::new(Box::new(VirtualBus::new(BIT_RATE)), percent, BIT_RATE)
    }

    #[test]
    fn frames_of_nobody_take_so_much_of_the_wires_time() {
        for percent in [10, 60, 90] {
            let (mut bus, busy) = loaded(percent);
            assert_eq!(bus.recv(Instant::ZERO + Duration::from_secs(2)), Ok(None));
            let (share, time) = busy.share(BIT_RATE);
            assert!(share.abs_diff(percent.into()) <= 2, "{share} % for {percent} %");
            assert!(time.as_millis().abs_diff(2_000) < 10, "{time:?}");
        }
    }

    #[test]
    fn they_are_not_seen_and_hold_back_no_frame_for_long() {
        let (mut bus, _) = loaded(80);
        bus.recv(Instant::ZERO + Duration::from_millis(10)).unwrap();
        let request = Frame::new(0x601, [0x40, 0, 0x10, 0, 0, 0, 0, 0]);
        bus.send(&request).unwrap();
        let seen = bus.recv(Instant::ZERO + Duration::from_secs(1)).unwrap().unwrap();
        assert_eq!((seen.frame, seen.own), (request, true));
        assert!(seen.at.since(Instant::ZERO) < Duration::from_millis(12), "{:?}", seen.at);
    }
}
