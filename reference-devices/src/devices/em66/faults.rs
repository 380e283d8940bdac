//! Errors of the device (3.4.7) and their reset (3.4.2).
//!
//! Each error is a bit of 2008h, and also an emergency message while it lasts.

use canopen::Dictionary;
use canopen::emcy::EmcyCode;

use super::objects::{
    CONTROL_ERRORS, CONTROL_WORD, ERROR_STATUS, GENERAL, LOW_LEVEL, SAFETY_LIMIT, SENSOR,
    STATUS_INFORMATION, SWITCH_OFF_STATUS, set, value,
};
use super::rules::Em66Rules;
use super::{External, Mode, Sensed};
use crate::stack::Errors;

/// The errors that are reported.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Faults {
    told: u8,
    /// The causes of the last judgement.
    causes: u8,
    /// The control word of the last judgement.
    control_word: i64,
}

impl Faults {
    /// Restarts after a reset.
    pub(super) fn restart(&mut self, rules: &Em66Rules) {
        *self = Self { causes: rules.causes_after_reset(self.causes), ..Self::default() };
    }

    /// Shows the errors in 2008h and reports them. Returns whether one forbids heating and cooling.
    pub(super) fn judge(
        &mut self,
        sensed: &Sensed,
        mode: Mode,
        od: &mut Dictionary,
        errors: &mut Errors,
        rules: &Em66Rules,
    ) -> bool {
        let suction = value(od, STATUS_INFORMATION) & 1 != 0;
        let switching_off = value(od, SWITCH_OFF_STATUS) != 0;
        let causes = causes(sensed, mode, value(od, CONTROL_ERRORS), rules);
        let causes = rules.causes_while(causes, suction, switching_off);
        let before = self.causes;
        self.causes = rules.causes_seen(before, causes);
        let appeared = causes & !before;
        self.told = self.told & (causes | rules.lasting_errors()) | appeared;
        let control_word = value(od, CONTROL_WORD);
        let before = std::mem::replace(&mut self.control_word, control_word);
        if rules.resets_failures(before, control_word) {
            self.told = rules.after_failure_reset(self.told, causes);
        }
        let shown = rules.error_status(self.told);
        set(od, ERROR_STATUS, shown.into());
        for (number, (bit, code, register)) in (1..).zip(MESSAGES) {
            match shown & bit != 0 {
                true => errors.raise(number, code, register, [shown, 0, 0, 0, 0]),
                false => errors.clear(number),
            }
        }
        self.told != 0
    }
}

/// The bits of the errors whose cause is present.
fn causes(sensed: &Sensed, mode: Mode, control_errors: i64, rules: &Em66Rules) -> u8 {
    let needed = mode == Mode::ExternalSensor;
    let unplugged = sensed.external == External::Unplugged;
    let sensor = match unplugged {
        true => rules.missing_sensor(needed),
        false => sensed.external == External::Broken,
    };
    let machine = sensed.machine_fault;
    [
        (rules.level_is_low(sensed.medium_level), LOW_LEVEL),
        (sensed.limiter_tripped, SAFETY_LIMIT),
        (sensor, SENSOR),
        (machine || rules.general_failure(unplugged, control_errors), GENERAL),
    ]
    .iter()
    .filter(|(present, _)| *present)
    .fold(0, |bits, (_, bit)| bits | bit)
}

/// The emergency message of each bit, with its bits of the error register: temperature for the
/// limiter, of the profile for the rest.
const MESSAGES: [(u8, EmcyCode, u8); 4] = [
    (LOW_LEVEL, EmcyCode(0x9000), 0x20),
    (SAFETY_LIMIT, EmcyCode(0x4200), 0x08),
    (SENSOR, EmcyCode(0x5000), 0x20),
    (GENERAL, EmcyCode(0x1000), 0x20),
];

#[cfg(test)]
mod tests;
