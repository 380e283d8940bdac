//! When edges are counted, and where the counts are shown (manual, 11.3.3 to 11.3.7).

use std::time::Duration;

use canopen::{Dictionary, Instant, Mux};

use super::encoder::{Encoder, Setup, TENTH, TENTHS_IN_A_SECOND};
use super::parameters::{COUNTS, Item};
use super::{COMMANDS, Mcm260x, PRESETS};

impl Mcm260x {
    /// Counts what has passed, interval by interval, and shows it.
    pub(super) fn count(&mut self, now: Instant, od: &mut Dictionary) {
        if now > self.next_tenth + LONG {
            // The intervals before the last full second leave no trace.
            let seconds = now.since(self.intervals_from).as_secs() - 1;
            self.next_tenth = self.intervals_from + Duration::from_secs(seconds);
        }
        let counts = self.rules.counts_in(self.state);
        while self.next_tenth <= now {
            let end = self.next_tenth;
            let number = end.since(self.intervals_from).as_nanos() / TENTH.as_nanos();
            let of_second = number.is_multiple_of(TENTHS_IN_A_SECOND);
            for (encoder, setup) in self.encoders.iter_mut().zip(&self.setups) {
                encoder.follow(end, setup.counting(counts), &self.rules);
                encoder.interval_ends(of_second);
            }
            self.next_tenth += TENTH;
        }
        for (encoder, setup) in self.encoders.iter_mut().zip(&self.setups) {
            encoder.follow(now, setup.counting(counts), &self.rules);
        }
        self.show_counts(od);
    }

    pub(super) fn show_counts(&self, od: &mut Dictionary) {
        for ((encoder, setup), sub) in self.encoders.iter().zip(&self.setups).zip(1..) {
            if setup.mode == 0 && !self.changed {
                continue;
            }
            let (second, tenth) = self.rules.windows(encoder.in_a_second(), encoder.in_a_tenth());
            od.set_int(Mux::new(COUNTS, sub), encoder.count.into());
            od.set_int(Mux::new(IN_A_SECOND, sub), second);
            od.set_int(Mux::new(IN_A_TENTH, sub), tenth);
            let command = Mux::new(COMMANDS, sub);
            if let Some(last) = od.int(command).filter(|last| *last != 0) {
                od.set_int(command, encoder.open_commands(last, &self.rules));
            }
        }
    }

    /// Loads a preset that has just been written, where it does not wait for a command.
    pub(super) fn load_at_once(&mut self, written: Mux, od: &mut Dictionary) {
        if written.index == PRESETS && !self.rules.preset_waits_for_command() {
            for (encoder, setup) in self.encoders.iter_mut().zip(&self.setups) {
                encoder.count = setup.preset;
            }
            self.show_counts(od);
        }
    }

    /// Takes over the parameters of the encoders.
    pub(super) fn set_up(&mut self, od: &Dictionary) {
        for place in 0..self.setups.len() {
            let parameters = self.parameters(od);
            let mode = parameters.value(Item::EncoderSetup, place);
            let preset = od.int(Mux::new(PRESETS, place as u8 + 1)).unwrap_or(0);
            let preset = self.rules.preset(preset >> 16, preset & 0xFFFF) as i32;
            if mode == 0 {
                self.encoders[place].forget_intervals();
            }
            let turns = self.encoders[place].motion.millihertz != 0;
            let mode = match turns && !self.rules.takes_a_setup_while_turning() {
                true => self.setups[place].mode,
                false => mode,
            };
            if mode != self.setups[place].mode {
                self.encoders[place].set_up_anew(&self.rules);
            }
            self.setups[place] = Setup { mode, preset };
        }
    }

    /// The next multiple of the period at which counts are looked at. A reader in between shows
    /// them, and leaves it where it is.
    pub(super) fn next_look(&self) -> Option<Instant> {
        if !self.rules.looks_while_turning() {
            return None;
        }
        let after = |period| Instant((self.looked.0 / period + 1) * period);
        let counts = |(encoder, setup): (&Encoder, &Setup)| {
            setup.mode != 0 && encoder.motion.millihertz != 0
        };
        if self.encoders.iter().zip(&self.setups).any(counts) {
            return Some(after(LOOK));
        }
        self.is_turning().then(|| after(TENTH.as_nanos() as u64))
    }

    /// Whether counts change, or those of an interval will.
    pub(super) fn is_turning(&self) -> bool {
        let turns = |(encoder, setup): (&Encoder, &Setup)| setup.mode != 0 && !encoder.is_quiet();
        self.encoders.iter().zip(&self.setups).any(turns)
    }
}

/// Counts that took longer than this to be looked at are not gone through interval by interval.
const LONG: Duration = Duration::from_secs(3);
/// How often the counts of a shaft that turns are looked at, in nanoseconds.
const LOOK: u64 = 20_000_000;
/// Encoder/counter calculations in 1 s.
const IN_A_SECOND: u16 = 0x3004;
/// Encoder/counter calculations in 100 ms.
const IN_A_TENTH: u16 = 0x3005;
