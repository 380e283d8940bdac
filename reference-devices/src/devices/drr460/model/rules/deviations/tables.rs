//! Deviations that are rows of a table: of a parameter, a flag, the RUN LED or a command.

use crate::devices::deviating::{self, Lay};
use crate::devices::drr460::model::rules::{Layer, Rules};
use crate::devices::pixsys::led::Pattern;

/// The names of the rows.
pub(super) fn names() -> impl Iterator<Item = &'static str> {
    let fixed = FIXED.iter().map(|(name, ..)| *name);
    let taken = TAKEN_FOR.iter().map(|(name, ..)| *name);
    let scaled = SCALED.iter().map(|(name, ..)| *name);
    let moved = MOVED.iter().map(|(name, ..)| *name);
    let led = LED.iter().map(|(name, ..)| *name);
    let deaf = DEAF.iter().map(|(name, ..)| *name);
    fixed.chain(taken).chain(scaled).chain(moved).chain(led).chain(deaf)
}

/// The deviation of the row of that name; `None` when there is none.
pub(super) fn named(name: &str) -> Option<Lay<dyn Rules>> {
    let row = if let Some((_, sub, value)) = FIXED.iter().find(|row| row.0 == name) {
        Row::Fixed { sub: *sub, value: *value }
    } else if let Some((_, sub, from, to)) = TAKEN_FOR.iter().find(|row| row.0 == name) {
        Row::TakenFor { sub: *sub, from: *from, to: *to }
    } else if let Some((_, sub, factor)) = SCALED.iter().find(|row| row.0 == name) {
        Row::Scaled { sub: *sub, factor: *factor }
    } else if let Some((_, from, to)) = MOVED.iter().find(|row| row.0 == name) {
        Row::Moved { from: *from, to: *to }
    } else if let Some((_, from, to)) = LED.iter().find(|row| row.0 == name) {
        Row::Led { from: *from, to: *to }
    } else {
        let (_, index, value) = DEAF.iter().find(|row| row.0 == name)?;
        Row::Deaf { index: *index, value: *value }
    };
    Some(deviating::unmutable(move |beneath| Box::new(OfRow { beneath, row })))
}

/// A deviation that is a row of a table.
#[derive(Clone, Copy)]
enum Row {
    /// A parameter has always the same value.
    Fixed { sub: u8, value: i64 },
    /// One code of a parameter is taken for another one.
    TakenFor { sub: u8, from: i64, to: i64 },
    /// A parameter counts so many times.
    Scaled { sub: u8, factor: i64 },
    /// A flag of 4007h has another bit.
    Moved { from: u8, to: u8 },
    /// RUN shows another pattern.
    Led { from: Pattern, to: Pattern },
    /// A value of 400Eh, or a sub of 4011h, has no effect.
    Deaf { index: u16, value: u8 },
}

/// A controller that deviates as a row says.
struct OfRow {
    beneath: Box<dyn Rules>,
    row: Row,
}

impl Layer for OfRow {
    fn beneath(&self) -> Option<&dyn Rules> {
        Some(&*self.beneath)
    }
}

impl Rules for OfRow {
    fn parameter(&self, of: u8, configured: i64) -> i64 {
        let configured = self.beneath.parameter(of, configured);
        match self.row {
            Row::Fixed { sub, value } if sub == of => value,
            Row::TakenFor { sub, from, to } if sub == of && configured == from => to,
            Row::Scaled { sub, factor } if sub == of => configured * factor,
            _ => configured,
        }
    }

    fn flag(&self, bit: u8) -> u8 {
        match self.row {
            Row::Moved { from, to } if from == bit => to,
            _ => self.beneath.flag(bit),
        }
    }

    fn run_led(&self, pattern: Pattern) -> Pattern {
        match self.row {
            Row::Led { from, to } if from == pattern => to,
            _ => self.beneath.run_led(pattern),
        }
    }

    fn obeys_tuning(&self, value: i64) -> bool {
        let deaf = |index, own| index == 0x400E && i64::from(own) == value;
        !matches!(self.row, Row::Deaf { index, value: own } if deaf(index, own))
            && self.beneath.obeys_tuning(value)
    }

    fn learns(&self, sub: u8) -> bool {
        !matches!(self.row, Row::Deaf { index: 0x4011, value } if value == sub)
            && self.beneath.learns(sub)
    }
}

const SCALED: &[(&str, u8, i64)] = &[
    ("integral-time-in-seconds", 34, 10),
    ("derivative-time-in-seconds", 35, 10),
    ("command-hysteresis-in-degrees", 19, 10),
    ("command-delay-in-minutes", 23, 60),
    ("alarm-1-hysteresis-in-degrees", 58, 10),
    ("alarm-2-hysteresis-in-degrees", 70, 10),
    ("heater-break-in-amperes", 92, 10),
    ("over-current-in-amperes", 93, 10),
    ("retransmission-limit-in-degrees", 103, 10),
];

const MOVED: &[(&str, u8, u8)] = &[
    ("process-error-is-generic", 1, 5),
    ("memory-read-error-moved", 3, 11),
    ("calibration-missing-moved", 4, 12),
    ("hardware-error-moved", 6, 14),
    ("short-circuit-moved", 7, 11),
    ("open-load-is-partial-break", 8, 9),
    ("partial-break-is-open-load", 9, 8),
    ("over-current-moved", 10, 11),
];

const LED: &[(&str, Pattern, Pattern)] = &[
    ("run-led-pre-operational-fast", Pattern::Slow, Pattern::Medium),
    ("run-led-operational-off", Pattern::SteadyOn, Pattern::SteadyOff),
    ("run-led-stopped-slow", Pattern::OneOff, Pattern::Slow),
    ("run-led-boot-slow", Pattern::Fast, Pattern::Slow),
];

const DEAF: &[(&str, u16, u8)] = &[
    ("tuning-not-ended", 0x400E, 0),
    ("tuning-not-begun", 0x400E, 1),
    ("tuning-not-forced-on", 0x400E, 2),
    ("calculation-not-begun", 0x400E, 3),
    ("minimum-not-learned", 0x4011, 2),
    ("maximum-not-learned", 0x4011, 3),
    ("zero-not-learned", 0x4011, 4),
];

const FIXED: &[(&str, u8, i64)] = &[
    ("unit-ignored", 2, 0),
    ("lower-linear-limit-ignored", 3, 0),
    ("upper-linear-limit-ignored", 4, 10_000),
    ("potentiometer-value-ignored", 5, 10),
    ("over-limits-ignored", 6, 0),
    ("over-limits-always", 6, 1),
    ("offset-ignored", 7, 0),
    ("gain-ignored", 8, 0),
    ("latch-on-ignored", 9, 0),
    ("filter-ignored", 10, 1),
    ("action-ignored", 18, 0),
    ("command-hysteresis-ignored", 19, 0),
    ("command-error-state-ignored", 20, 0),
    ("command-stop-state-ignored", 21, 0),
    ("command-reset-ignored", 22, 0),
    ("command-delay-ignored", 23, 0),
    ("valve-time-ignored", 24, 60),
    ("manual-mode-forbidden", 25, 0),
    ("tuning-deviation-ignored", 32, 300),
    ("proportional-band-ignored", 33, 0),
    ("integral-time-ignored", 34, 0),
    ("derivative-time-ignored", 35, 0),
    ("dead-band-ignored", 36, 0),
    ("centred-band-ignored", 37, 0),
    ("off-over-set-point-ignored", 38, 0),
    ("off-over-threshold-ignored", 39, 0),
    ("cycle-time-ignored", 40, 15),
    ("cooling-multiplier-ignored", 42, 100),
    ("overlap-ignored", 43, 0),
    ("cooling-cycle-ignored", 44, 10),
    ("lower-output-limit-ignored", 45, 0),
    ("upper-output-limit-ignored", 46, 100),
    ("tuning-gap-ignored", 47, 30),
    ("least-band-of-tuning-ignored", 48, 0),
    ("greatest-band-of-tuning-ignored", 49, 10_000),
    ("least-integral-time-of-tuning-ignored", 50, 0),
    ("alarm-1-error-state-ignored", 59, 0),
    ("alarm-1-delay-ignored", 62, 0),
    ("alarm-2-error-state-ignored", 71, 0),
    ("alarm-2-delay-ignored", 74, 0),
    ("soft-start-ignored", 80, 0),
    ("gradient-ignored", 81, 1000),
    ("soft-start-percentage-ignored", 82, 50),
    ("soft-start-threshold-ignored", 83, 1000),
    ("soft-start-time-ignored", 84, 0),
    ("transformer-always-off", 90, 0),
    ("transformer-value-ignored", 91, 50),
    ("heater-break-ignored", 92, 0),
    ("over-current-ignored", 93, 0),
    ("heater-break-delay-ignored", 94, 0),
    ("retransmission-ignored", 100, 0),
    ("retransmission-type-ignored", 101, 1),
    ("retransmission-lower-limit-ignored", 102, 0),
    ("retransmission-upper-limit-ignored", 103, 10_000),
    ("retransmission-error-state-ignored", 104, 0),
    ("retransmission-stop-state-ignored", 105, 0),
    ("address-parameter-ignored", 111, 1),
    ("bit-rate-parameter-ignored", 112, 2),
    ("off-line-ignored", 115, 0),
    ("initial-outputs-ignored", 122, 0),
    ("outputs-never-commute", 123, 0),
    ("outputs-always-commute", 123, 3),
    ("error-outputs-ignored", 124, 0),
    ("analogue-type-ignored", 125, 1),
    ("analogue-lower-limit-ignored", 126, 0),
    ("analogue-upper-limit-ignored", 127, 10_000),
    ("initial-analogue-ignored", 128, 0),
    ("analogue-never-commutes", 129, 0),
    ("error-analogue-ignored", 130, 0),
    ("transformer-output-ignored", 131, 0),
];

const TAKEN_FOR: &[(&str, u8, i64, i64)] = &[
    ("tc-s-taken-for-tc-k", 1, 1, 0),
    ("tc-b-taken-for-tc-k", 1, 7, 0),
    ("pt100-taken-for-ni100", 1, 8, 9),
    ("ntc-taken-for-ptc", 1, 10, 11),
    ("0-20-ma-taken-for-4-20-ma", 1, 15, 16),
    ("4-20-ma-taken-for-0-20-ma", 1, 16, 15),
    ("60-mv-taken-for-10-v", 1, 17, 14),
    ("kelvin-taken-for-celsius", 2, 2, 0),
    ("linear-zero-taken-for-zero", 9, 3, 2),
    ("valve-taken-for-contact", 16, 2, 0),
    ("alarm-2-live-zero-ignored", 16, 1, 0),
    ("alarm-1-live-zero-ignored", 16, 3, 2),
    ("command-live-zero-ignored", 16, 5, 4),
    ("tuning-once-taken-for-automatic", 31, 3, 1),
    ("alarm-above-is-below", 56, 1, 2),
    ("alarm-2-above-is-below", 68, 1, 2),
    ("alarm-1-sensor-taken-for-status", 56, 11, 8),
    ("alarm-2-sensor-taken-for-status", 68, 11, 8),
    ("alarm-2-cooling-off", 68, 9, 0),
    ("alarm-2-heater-break-off", 68, 10, 0),
    ("heater-break-alarm-off", 56, 10, 0),
    ("alarm-1-works-not-in-stop", 60, 4, 0),
    ("alarm-2-works-not-in-stop", 72, 4, 0),
    ("alarm-2-reset-by-itself", 73, 1, 0),
    ("percentage-taken-for-gradient", 80, 2, 1),
    ("60-hz-is-off", 90, 2, 0),
    ("alarm-2-retransmitted-as-alarm-1", 100, 4, 3),
    ("current-retransmitted-as-process", 100, 5, 1),
    ("remote-value-not-retransmitted", 100, 6, 0),
    ("retransmission-works-not-in-stop", 105, 4, 0),
    ("no-filter-taken-for-the-longest", 10, 1, 50),
    ("latch-on-without-selection", 9, 0, 1),
    ("zero-with-standard-latch-on", 9, 1, 2),
    ("zero-taken-for-linear-zero", 9, 2, 3),
    ("current-command-taken-for-contact", 16, 4, 0),
    ("live-current-command-taken-for-contact", 16, 5, 1),
    ("start-taken-for-previous-state", 17, 0, 2),
    ("previous-state-taken-for-start", 17, 2, 0),
    ("automatic-tuning-off", 31, 1, 0),
    ("manual-tuning-off", 31, 2, 0),
    ("tuning-once-off", 31, 3, 0),
    ("synchronised-tuning-off", 31, 4, 0),
    ("no-soft-start-taken-for-percentage", 80, 0, 2),
    ("gradient-taken-for-percentage", 80, 1, 2),
    ("endless-soft-start-of-a-minute", 84, 0, 1),
    ("alarm-1-above-off", 56, 1, 0),
    ("alarm-1-below-off", 56, 2, 0),
    ("alarm-1-band-off", 56, 3, 0),
    ("alarm-1-above-deviation-off", 56, 4, 0),
    ("alarm-1-below-deviation-off", 56, 5, 0),
    ("alarm-1-set-point-above-off", 56, 6, 0),
    ("alarm-1-set-point-below-off", 56, 7, 0),
    ("alarm-1-status-off", 56, 8, 0),
    ("alarm-1-cooling-off", 56, 9, 0),
    ("alarm-1-remote-off", 56, 12, 0),
    ("alarm-2-below-off", 68, 2, 0),
    ("alarm-2-band-off", 68, 3, 0),
    ("alarm-2-above-deviation-off", 68, 4, 0),
    ("alarm-2-below-deviation-off", 68, 5, 0),
    ("alarm-2-set-point-above-off", 68, 6, 0),
    ("alarm-2-set-point-below-off", 68, 7, 0),
    ("alarm-2-status-off", 68, 8, 0),
    ("alarm-2-remote-off", 68, 12, 0),
    ("alarm-1-open-taken-for-closed", 57, 0, 1),
    ("alarm-1-closed-taken-for-open", 57, 1, 0),
    ("alarm-1-armed-open-taken-for-open", 57, 2, 0),
    ("alarm-1-armed-closed-taken-for-armed-open", 57, 3, 2),
    ("alarm-2-open-taken-for-closed", 69, 0, 1),
    ("alarm-2-closed-taken-for-open", 69, 1, 0),
    ("alarm-2-armed-open-taken-for-open", 69, 2, 0),
    ("alarm-2-armed-closed-taken-for-armed-open", 69, 3, 2),
    ("alarm-1-open-taken-for-armed", 57, 0, 2),
    ("alarm-2-open-taken-for-armed", 69, 0, 2),
    ("alarm-1-reset-by-itself", 61, 1, 0),
    ("alarm-1-without-reset-taken-for-stored-reset", 61, 0, 2),
    ("alarm-1-stored-reset-taken-for-reset", 61, 2, 1),
    ("alarm-2-stored-reset-taken-for-reset", 73, 2, 1),
    ("alarm-1-reset-taken-for-stored-reset", 61, 1, 2),
    ("alarm-2-reset-taken-for-stored-reset", 73, 1, 2),
    ("command-without-reset-taken-for-reset", 22, 0, 1),
    ("process-retransmitted-without-selection", 100, 0, 1),
    ("process-not-retransmitted", 100, 1, 0),
    ("set-point-retransmitted-as-process", 100, 2, 1),
    ("alarm-1-retransmitted-as-alarm-2", 100, 3, 4),
    ("transformer-always-on", 90, 0, 1),
    ("off-over-always", 38, 0, 1),
    ("tc-k-taken-for-ni100", 1, 0, 9),
    ("tc-r-taken-for-ni100", 1, 2, 9),
    ("tc-j-taken-for-ni100", 1, 3, 9),
    ("tc-t-taken-for-ni100", 1, 4, 9),
    ("tc-e-taken-for-ni100", 1, 5, 9),
    ("tc-n-taken-for-ni100", 1, 6, 9),
    ("ni100-taken-for-ntc", 1, 9, 10),
    ("ntc-taken-for-tc-b", 1, 10, 7),
    ("ptc-taken-for-ntc", 1, 11, 10),
    ("pt500-taken-for-ni100", 1, 12, 9),
    ("pt1000-taken-for-ni100", 1, 13, 9),
    ("tc-k-taken-for-tc-r", 1, 0, 2),
    ("tc-r-taken-for-tc-k", 1, 2, 0),
    ("tc-j-taken-for-tc-k", 1, 3, 0),
    ("tc-t-taken-for-tc-k", 1, 4, 0),
    ("tc-e-taken-for-tc-k", 1, 5, 0),
    ("tc-n-taken-for-tc-k", 1, 6, 0),
    ("pt100-taken-for-tc-j", 1, 8, 3),
    ("ni100-taken-for-pt100", 1, 9, 8),
    ("ptc-taken-for-pt100", 1, 11, 8),
    ("pt500-taken-for-tc-j", 1, 12, 3),
    ("pt1000-taken-for-tc-j", 1, 13, 3),
    ("10-v-taken-for-60-mv", 1, 14, 17),
    ("potentiometer-taken-for-10-v", 1, 18, 14),
    ("analogue-always-commutes", 129, 0, 1),
];
