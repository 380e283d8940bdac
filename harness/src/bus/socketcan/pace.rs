//! The pace of a load: when which of its frames is due.

use std::sync::atomic::Ordering;
use std::time::Duration;

use canopen::Frame;
use canopen::wire::{INTERMISSION_BITS, frame_bits};

use crate::bus::load::{ID, Load};

/// When which frame is due.
pub(super) struct Pace {
    load: Load,
    /// Up to when it was looked at.
    past: Duration,
    /// The bits that are due and not sent.
    owed: f64,
    number: u64,
}

impl Pace {
    /// A pause of this machine is made up for as far as that: the wire is not to be filled at once.
    const MADE_UP: Duration = Duration::from_millis(10);

    /// A pace of its own, for one that sends a load.
    pub(super) fn of(load: &Load) -> Self {
        Self { load: load.clone(), past: Duration::ZERO, owed: 0.0, number: 0 }
    }

    /// The frames that are due when so much time has gone by since the beginning.
    pub(super) fn due(&mut self, since: Duration) -> Vec<Frame> {
        let span = since.saturating_sub(self.past);
        self.past = since;
        let rate = f64::from(self.load.bit_rate) * f64::from(self.load.percent) / 100.0;
        let most = rate * Self::MADE_UP.as_secs_f64();
        self.owed = (self.owed + rate * span.as_secs_f64()).min(most);
        self.load.carried.micros.fetch_add(span.as_micros() as u64, Ordering::Relaxed);
        let (mut owed, mut due) = (self.owed, Vec::new());
        while owed > 0.0 {
            // What differs in each changes the check sum and the stuff bits, too.
            let frame = Frame::new(ID, self.number.to_le_bytes());
            self.number = self.number.wrapping_mul(STEP).wrapping_add(1);
            owed -= on_wire(&frame) as f64;
            due.push(frame);
        }
        due
    }

    /// These were sent. What was not is owed.
    pub(super) fn sent(&mut self, frames: &[Frame]) {
        let bits = frames.iter().map(on_wire).sum::<u64>();
        self.owed -= bits as f64;
        self.load.carried.frames.fetch_add(frames.len() as u64, Ordering::Relaxed);
        self.load.carried.bits.fetch_add(bits, Ordering::Relaxed);
    }
}

/// The bits that a frame takes of the wire.
fn on_wire(frame: &Frame) -> u64 {
    frame_bits(frame) + INTERMISSION_BITS
}

/// From one number to the next, so that all bits of the data change (the multiplier of Knuth's
/// MMIX).
const STEP: u64 = 6_364_136_223_846_793_005;

#[cfg(test)]
mod tests {
    use super::*;

    /// What a pace sends that is asked at these times, in microseconds.
    fn sent(load: &Load, times: impl Iterator<Item = u64>) -> u64 {
        let (mut pace, mut bits) = (Pace::of(load), 0);
        for time in times {
            let due = pace.due(Duration::from_micros(time));
            pace.sent(&due);
            bits += due.iter().map(on_wire).sum::<u64>();
        }
        bits
    }

    #[test]
    fn a_load_takes_its_share_of_the_wire() {
        for (percent, bit_rate) in [(60, 1_000_000), (80, 125_000), (1, 500_000)] {
            let load = Load::new(percent, bit_rate);
            let bits = sent(&load, (0..=1_000).map(|ms| ms * 1_000));
            let due = u64::from(bit_rate) * u64::from(percent) / 100;
            assert!((due..due + 200).contains(&bits), "{percent} % of {bit_rate}: {bits} bits");
            let said = load.came().expect("frames were sent");
            assert!(said.ends_with(&format!("{percent} % was wanted")), "{said}");
        }
    }

    #[test]
    fn what_finds_no_room_is_owed() {
        let load = Load::new(50, 1_000_000);
        let mut pace = Pace::of(&load);
        let all = pace.due(Duration::from_millis(5));
        pace.sent(&all[..2]);
        assert_eq!(pace.due(Duration::from_millis(5)).len(), all.len() - 2);
        assert!(load.came().unwrap().starts_with("2 frames with 7F3"), "{:?}", load.came());
    }

    #[test]
    fn a_pause_is_not_made_up_for() {
        let load = Load::new(50, 1_000_000);
        let bits = sent(&load, [0, 1_000_000].into_iter());
        assert!((5_000..5_200).contains(&bits), "{bits} bits");
        assert!(load.came().unwrap().contains("took 0.5 % of"), "{:?}", load.came());
    }
}
