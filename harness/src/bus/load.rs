//! A load of the bus beside a test: how much of the wire's time frames take that no device listens
//! to.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use canopen::Id;

/// The identifier of the frames. CiA 301 restricts 780h to 7FFh, so that no object of a device can
/// have it, and all but a few frames go before it.
pub(crate) const ID: Id = Id::standard(0x7F3);
/// The largest load, in percent. Above it a device may be late for want of room.
pub(crate) const MOST: u8 = 80;

/// A load that is wanted, and what came of it.
#[derive(Clone, Debug)]
pub struct Load {
    pub(super) percent: u8,
    pub(super) bit_rate: u32,
    pub(super) carried: Arc<Carried>,
}

/// What was sent, by all that send it, one after the other.
#[derive(Debug, Default)]
pub(super) struct Carried {
    pub(super) frames: AtomicU64,
    pub(super) bits: AtomicU64,
    /// For how long it was sent, in microseconds.
    pub(super) micros: AtomicU64,
}

impl Load {
    /// So many percent of the time of a wire with this bit rate, in bit/s.
    pub(crate) fn new(percent: u8, bit_rate: u32) -> Self {
        Self { percent, bit_rate, carried: Arc::default() }
    }

    /// What is wanted, as a sentence.
    pub(crate) fn wanted(&self) -> String {
        let Self { percent, bit_rate, .. } = self;
        format!("frames with {ID}h load the bus by {percent} % of {bit_rate} bit/s (--load)")
    }

    /// What came of it so far, as a sentence; `None` before it began.
    pub(crate) fn came(&self) -> Option<String> {
        let Carried { frames, bits, micros } = &*self.carried;
        let [frames, bits, micros] = [frames, bits, micros].map(|it| it.load(Ordering::Relaxed));
        let room = micros as f64 / 1e6 * f64::from(self.bit_rate);
        (room > 0.0).then(|| {
            let share = bits as f64 / room * 100.0;
            let Self { percent, .. } = self;
            format!(
                "{frames} frames with {ID}h took {share:.1} % of the wire's time; {percent} % was \
                 wanted"
            )
        })
    }
}
