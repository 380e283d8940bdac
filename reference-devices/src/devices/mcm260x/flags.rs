//! Errors, and what shows them (manual, 11.3.8 and 11.9).

use canopen::Dictionary;

use super::parameters::Item;
use super::{FLAGS, Mcm260x, TERMINAL_FLAGS};
use crate::stack::Errors;

/// How often something was wrong, and whether it is.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Faults {
    now: bool,
    times: u32,
}

impl Faults {
    fn follow(&mut self, now: bool) {
        self.times += u32::from(now && !self.now);
        self.now = now;
    }
}

impl Mcm260x {
    /// Says what there is to say at power-on.
    pub(super) fn announce(&mut self, errors: &mut Errors) {
        if let Some(told) = self.rules.announcement().filter(|_| !self.announced) {
            errors.raise(ANNOUNCEMENT, told.code, told.register, told.vendor);
        }
        self.announced = true;
    }

    /// Errors and what shows them.
    pub(super) fn show_errors(&mut self, od: &mut Dictionary, errors: &mut Errors) {
        let (mut flags, terminal) = self.inside.flags(&self.rules);
        od.set_int(TERMINAL_FLAGS, terminal);
        for (place, (input, faults)) in self.inputs.iter().zip(&mut self.faults).enumerate() {
            faults.follow(input.is_out_of_range());
            if !faults.now {
                if self.rules.ends(place) {
                    errors.clear(OUT_OF_RANGE + place as u16);
                }
                continue;
            }
            flags |= self.rules.channel_flag(place);
            let reports = self.rules.reports(faults.times);
            if let Some(told) = self.rules.diagnosis(place).filter(|_| reports) {
                errors.raise(OUT_OF_RANGE + place as u16, told.code, told.register, told.vendor);
            }
        }
        if self.rules.supply_is_low(self.surroundings.supply) {
            flags |= LOW_SUPPLY;
        }
        let before = od.int(FLAGS).unwrap_or(0);
        od.set_int(FLAGS, self.rules.flags(before, flags | self.wrong_parameters(od)));
    }

    /// Error values beyond the limits of their outputs.
    fn wrong_parameters(&self, od: &Dictionary) -> i64 {
        let parameters = self.parameters(od);
        let beyond = (0..self.io.counts().analogue_outputs).any(|place| {
            let (low, high) = self.limits(place, od);
            let value = parameters.value(Item::ErrorValue, place);
            !(low.min(high)..=low.max(high)).contains(&value)
        });
        if beyond { OUT_OF_BOUNDS } else { 0 }
    }
}

const OUT_OF_BOUNDS: i64 = 1 << 7;
const LOW_SUPPLY: i64 = 1 << 11;
/// The errors of the analogue inputs are numbered from here on.
const OUT_OF_RANGE: u16 = 12;
/// The number of the announcement at power-on.
const ANNOUNCEMENT: u16 = 8;
