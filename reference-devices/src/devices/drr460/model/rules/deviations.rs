//! The controllers that take one decision otherwise.

use super::Rules;
use crate::devices::deviating::{self, Deviation, deviating};

/// The names of the devices that break one decision.
pub(crate) fn names() -> impl Iterator<Item = &'static str> {
    let fixed = FIXED.iter().map(|(name, ..)| *name);
    let taken = TAKEN_FOR.iter().map(|(name, ..)| *name);
    fixed.chain(taken).chain(deviating::names(DEVIATIONS))
}

/// The rules of the device that breaks the decision of that name; `None` when there is none.
pub(crate) fn named(name: &str) -> Option<Box<dyn Rules>> {
    if let Some((_, sub, value)) = FIXED.iter().find(|(fixed, ..)| *fixed == name) {
        return Some(Box::new(Fixed { sub: *sub, value: *value }));
    }
    if let Some((_, sub, from, to)) = TAKEN_FOR.iter().find(|(taken, ..)| *taken == name) {
        return Some(Box::new(TakenFor { sub: *sub, from: *from, to: *to }));
    }
    deviating::named(DEVIATIONS, name)
}

/// A controller for which a parameter has always the same value.
struct Fixed {
    sub: u8,
    value: i64,
}

impl Rules for Fixed {
    fn parameter(&self, sub: u8, configured: i64) -> i64 {
        if sub == self.sub { self.value } else { configured }
    }
}

/// A controller that takes one code of a parameter for another one.
struct TakenFor {
    sub: u8,
    from: i64,
    to: i64,
}

impl Rules for TakenFor {
    fn parameter(&self, sub: u8, configured: i64) -> i64 {
        if sub == self.sub && configured == self.from { self.to } else { configured }
    }
}

const FIXED: &[(&str, u8, i64)] = &[
    ("unit-ignored", 2, 0),
    ("lower-linear-limit-ignored", 3, 0),
    ("upper-linear-limit-ignored", 4, 10_000),
    ("potentiometer-value-ignored", 5, 10),
    ("over-limits-ignored", 6, 0),
    ("over-limits-always", 6, 1),
    ("offset-ignored", 7, 0),
    ("gain-ignored", 8, 0),
    ("filter-ignored", 10, 1),
    ("command-hysteresis-ignored", 19, 0),
    ("command-error-state-ignored", 20, 0),
    ("stop-state-ignored", 21, 0),
    ("command-reset-ignored", 22, 0),
    ("command-delay-ignored", 23, 0),
    ("valve-time-ignored", 24, 60),
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
    ("soft-start-ignored", 80, 0),
    ("soft-start-time-ignored", 84, 0),
    ("transformer-value-ignored", 91, 50),
    ("heater-break-ignored", 92, 0),
    ("over-current-ignored", 93, 0),
    ("heater-break-delay-ignored", 94, 0),
    ("retransmission-ignored", 100, 0),
    ("retransmission-type-ignored", 101, 1),
    ("retransmission-error-state-ignored", 104, 0),
    ("retransmission-stop-state-ignored", 105, 0),
    ("off-line-ignored", 115, 0),
    ("transformer-output-ignored", 131, 0),
];

const TAKEN_FOR: &[(&str, u8, i64, i64)] = &[
    ("tc-s-taken-for-tc-k", 1, 1, 0),
    ("pt100-taken-for-pt500", 1, 8, 12),
    ("0-20-ma-taken-for-4-20-ma", 1, 15, 16),
    ("4-20-ma-taken-for-0-20-ma", 1, 16, 15),
    ("60-mv-taken-for-10-v", 1, 17, 14),
    ("linear-zero-taken-for-zero", 9, 3, 2),
    ("valve-taken-for-contact", 16, 2, 0),
    ("alarm-2-live-zero-ignored", 16, 1, 0),
    ("command-live-zero-ignored", 16, 5, 4),
    ("alarm-1-sensor-taken-for-status", 56, 11, 8),
    ("alarm-2-sensor-taken-for-status", 68, 11, 8),
    ("alarm-2-cooling-off", 68, 9, 0),
    ("heater-break-alarm-off", 56, 10, 0),
];

const DEVIATIONS: &[Deviation<dyn Rules>] = deviating! { Rules;
    "cold-junction-uncompensated" {
        fn compensated(&self, _terminals: f64) -> f64 { 25.0 }
    }
    "latch-on-without-end" {
        fn latch_time(&self) -> f64 { f64::INFINITY }
    }
    "error-state-20-ma-is-21-5" {
        fn milliamperes(&self, code: i64) -> f64 {
            match code { 0 => 0.0, 1 => 4.0, _ => 21.5 }
        }
    }
    "stored-reset-not-kept" {
        fn kept_over_power_off(&self, _reset: i64) -> bool { false }
    }
    "cooling-band-divided" {
        fn cooling_band(&self, band: f64, multiplier: f64) -> f64 { band / multiplier }
    }
    "double-loop-centred" {
        fn centred(&self, configured: bool, _double_loop: bool) -> bool { configured }
    }
    "oil-taken-for-air" {
        fn fluid(&self, fluid: i64) -> (i64, i64) {
            if fluid == 2 { (250, 2) } else { (100, 10) }
        }
    }
    "tuning-without-master" {
        fn longest_silence_in_tuning(&self) -> f64 { f64::INFINITY }
    }
    "gradient-per-minute" {
        fn gradient(&self, digits: i64) -> f64 { digits as f64 / 60.0 }
    }
    "band-alarm-one-sided" {
        fn band(&self, deviation: i64) -> i64 { deviation }
    }
    "lower-deviation-not-negated" {
        fn lower_deviation(&self, alarm_set_point: i64) -> i64 { alarm_set_point }
    }
    "normally-closed-ignored" {
        fn normally_closed(&self, _kind: i64, _contact: i64) -> bool { false }
    }
    "alarm-armed-from-start" {
        fn waits_for_absence(&self, _contact: i64) -> bool { false }
    }
    "hysteresis-without-sign" {
        fn second_threshold(&self, first: i64, hysteresis: i64) -> i64 { first + hysteresis.abs() }
    }
    "live-zero-ignored" {
        fn microamperes(&self, share: f64, _live_zero: bool) -> f64 { 20_000.0 * share }
    }
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_is_used_once() {
        let mut all: Vec<&str> = names().collect();
        let count = all.len();
        all.sort_unstable();
        all.dedup();
        assert_eq!(all.len(), count);
        assert!(all.iter().all(|name| named(name).is_some()));
        assert!(named("none-of-these").is_none());
    }
}
