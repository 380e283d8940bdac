//! Every decision of the controller that a test can observe, and the devices that take one of them
//! otherwise.

use canopen::{Abort, Mux};

use crate::devices::deviating::{self, Deviation, deviating};

/// A controller that keeps to its manual; clauses are those of the manual.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Manual;

impl Drr460Rules for Manual {}

/// The decisions. The default methods are a summary of what the manual says.
pub(crate) trait Drr460Rules: Send {
    /// 3000h sub 2 selects the unit (11.3.2).
    fn unit(&self, configured: i64) -> i64 {
        configured
    }

    /// The process value is the input with gain and offset of 3000h subs 8 and 7 (11.3.2).
    fn calibration(&self, gain: i64, offset: i64) -> (i64, i64) {
        (gain, offset)
    }

    /// In STOP the controller does not control (11.3.6).
    fn controls(&self, started: bool) -> bool {
        started
    }

    /// 3000h subs 21, 60 and 72 select what the outputs do in STOP (11.3.2).
    fn stop_state(&self, configured: i64) -> i64 {
        configured
    }

    /// 3000h sub 17: start, stop, or what was before the power failure (11.3.2).
    fn starts(&self, initial_state: i64, before: bool) -> bool {
        match initial_state {
            1 => false,
            2 => before,
            _ => true,
        }
    }

    /// 3000h sub 18: 1 is cooling (11.3.2).
    fn cools(&self, action: i64) -> bool {
        action == 1
    }

    /// 3000h sub 33: the distance from the set point that asks for full output (11.3.2).
    fn proportional_band(&self, configured: i64) -> i64 {
        configured
    }

    /// 3000h subs 45 and 46 bound the output of P and PID control (11.3.2).
    fn output_limits(&self, low: i64, high: i64) -> (i64, i64) {
        (low, high)
    }

    /// Manual mode is what 400Fh asks for and 3000h sub 25 allows (7.6).
    fn manual(&self, allowed: i64, asked: i64) -> bool {
        allowed != 0 && asked == 1
    }

    /// In automatic mode the controller sets 4004h (7.6).
    fn sets_output(&self) -> bool {
        true
    }

    /// 3000h sub 80 selects a soft start (7.9).
    fn soft_start(&self, configured: i64) -> i64 {
        configured
    }

    /// While it tunes in step with its neighbours, the master forces the output (7.5).
    fn tuning_forces(&self, kind: i64) -> bool {
        kind == 4
    }

    /// 3000h subs 56 and 68 select what an alarm looks at (11.3.2).
    fn alarm_kind(&self, configured: i64) -> i64 {
        configured
    }

    /// Alarm 1 has its set point in 4001h and alarm 2 in 4002h (11.3.4, 11.3.5).
    fn alarm_set_point(&self, alarm: u16) -> Mux {
        Mux::new(0x4001 + alarm, 0)
    }

    /// Deviation and band alarms compare the distance from the set point (9.c to 9.e).
    fn deviation(&self, process: i64, set_point: i64) -> i64 {
        process - set_point
    }

    /// A band alarm has two sides (9.c).
    fn band(&self, deviation: i64) -> i64 {
        deviation.abs()
    }

    /// A lower deviation alarm lies as far below the set point as its own set point says (9.e).
    fn lower_deviation(&self, alarm_set_point: i64) -> i64 {
        -alarm_set_point
    }

    /// The second threshold of an alarm lies above the first when the hysteresis is positive and
    /// below it when it is negative (9.a to 9.e).
    fn hysteresis(&self, configured: i64) -> i64 {
        configured
    }

    /// Seconds: positive delays the way into an alarm, negative the way out (11.3.2, sub 62).
    fn alarm_delay(&self, configured: i64) -> i64 {
        configured
    }

    /// 3000h sub 57: 2 and 3 first wait until the alarm condition was absent (11.3.2).
    fn armed_from_start(&self, output: i64) -> bool {
        output < 2
    }

    /// 3000h sub 57: 1 and 3 are contacts that open in alarm (11.3.2).
    fn normally_closed(&self, output: i64) -> bool {
        output % 2 == 1
    }

    /// 3000h sub 61: an alarm that is reset by hand stays after its condition went (11.3.2).
    fn latches(&self, reset: i64) -> bool {
        reset != 0
    }

    /// 400Ch and 400Dh are values, 1 is an alarm (11.3.15).
    fn remote_alarm(&self, value: i64) -> bool {
        value == 1
    }

    /// 4009h: bit 0 is Q1 and bit 1 is Q2 (11.3.12).
    fn outputs_status(&self, q1: bool, q2: bool) -> i64 {
        i64::from(q1) | i64::from(q2) << 1
    }

    /// In expansion mode the master has the outputs (7.12).
    fn expansion(&self, configured: i64) -> bool {
        configured == 1
    }

    /// 400Eh takes what the kind of tuning, 3000h sub 31, has a meaning for (7.5, 11.3.17).
    ///
    /// # Errors
    /// [`Abort::VALUE`] for what is only read or means nothing, [`Abort::DEVICE_STATE`] while the
    /// controller tunes by itself.
    fn tuning_accepts(&self, kind: i64, value: u8) -> Result<(), Abort> {
        match (kind, value) {
            (1 | 3, _) => Err(Abort::DEVICE_STATE),
            (_, 4..) | (2, 2..) => Err(Abort::VALUE),
            _ => Ok(()),
        }
    }
}

/// The rules of the controller that is wrong in just the way `name` says; `None` when there is
/// none.
pub(crate) fn named(name: &str) -> Option<Box<dyn Drr460Rules>> {
    deviating::named(DEVIATIONS, name)
}

/// The names that [`named`] knows.
pub(crate) fn names() -> impl Iterator<Item = &'static str> {
    deviating::names(DEVIATIONS)
}

const DEVIATIONS: &[Deviation<dyn Drr460Rules>] = deviating! { Drr460Rules;
    "unit-ignored" {
        fn unit(&self, _configured: i64) -> i64 { 0 }
    }
    "offset-ignored" {
        fn calibration(&self, gain: i64, _offset: i64) -> (i64, i64) { (gain, 0) }
    }
    "gain-ignored" {
        fn calibration(&self, _gain: i64, offset: i64) -> (i64, i64) { (0, offset) }
    }
    "stop-keeps-heating" {
        fn controls(&self, _started: bool) -> bool { true }
    }
    "stop-state-ignored" {
        fn stop_state(&self, _configured: i64) -> i64 { 0 }
    }
    "initial-state-ignored" {
        fn starts(&self, _initial_state: i64, _before: bool) -> bool { true }
    }
    "action-ignored" {
        fn cools(&self, _action: i64) -> bool { false }
    }
    "proportional-band-ignored" {
        fn proportional_band(&self, _configured: i64) -> i64 { 0 }
    }
    "output-limits-ignored" {
        fn output_limits(&self, _low: i64, _high: i64) -> (i64, i64) { (0, 100) }
    }
    "manual-without-permission" {
        fn manual(&self, _allowed: i64, asked: i64) -> bool { asked == 1 }
    }
    "manual-ignored" {
        fn manual(&self, _allowed: i64, _asked: i64) -> bool { false }
    }
    "automatic-keeps-written-output" {
        fn sets_output(&self) -> bool { false }
    }
    "soft-start-ignored" {
        fn soft_start(&self, _configured: i64) -> i64 { 0 }
    }
    "tuning-does-not-force" {
        fn tuning_forces(&self, _kind: i64) -> bool { false }
    }
    "alarm-off-is-above" {
        fn alarm_kind(&self, configured: i64) -> i64 { configured.max(1) }
    }
    "alarm-below-is-above" {
        fn alarm_kind(&self, configured: i64) -> i64 {
            if configured == 2 { 1 } else { configured }
        }
    }
    "alarm-above-is-below" {
        fn alarm_kind(&self, configured: i64) -> i64 {
            if configured == 1 { 2 } else { configured }
        }
    }
    "alarm-of-set-point-looks-at-process" {
        fn alarm_kind(&self, configured: i64) -> i64 {
            if matches!(configured, 6 | 7) { configured - 5 } else { configured }
        }
    }
    "alarms-share-a-set-point" {
        fn alarm_set_point(&self, _alarm: u16) -> Mux { Mux::new(0x4001, 0) }
    }
    "deviation-is-absolute" {
        fn deviation(&self, process: i64, _set_point: i64) -> i64 { process }
    }
    "band-alarm-one-sided" {
        fn band(&self, deviation: i64) -> i64 { deviation }
    }
    "lower-deviation-not-negated" {
        fn lower_deviation(&self, alarm_set_point: i64) -> i64 { alarm_set_point }
    }
    "alarm-ignores-hysteresis" {
        fn hysteresis(&self, _configured: i64) -> i64 { 0 }
    }
    "alarm-hysteresis-without-sign" {
        fn hysteresis(&self, configured: i64) -> i64 { configured.abs() }
    }
    "alarm-delay-ignored" {
        fn alarm_delay(&self, _configured: i64) -> i64 { 0 }
    }
    "alarm-delay-without-sign" {
        fn alarm_delay(&self, configured: i64) -> i64 { configured.abs() }
    }
    "alarm-armed-from-start" {
        fn armed_from_start(&self, _output: i64) -> bool { true }
    }
    "normally-closed-ignored" {
        fn normally_closed(&self, _output: i64) -> bool { false }
    }
    "manual-reset-ignored" {
        fn latches(&self, _reset: i64) -> bool { false }
    }
    "remote-alarm-is-bit-1" {
        fn remote_alarm(&self, value: i64) -> bool { value & 2 != 0 }
    }
    "outputs-status-swapped" {
        fn outputs_status(&self, q1: bool, q2: bool) -> i64 { i64::from(q2) | i64::from(q1) << 1 }
    }
    "expansion-always" {
        fn expansion(&self, _configured: i64) -> bool { true }
    }
    "expansion-ignored" {
        fn expansion(&self, _configured: i64) -> bool { false }
    }
    "tuning-takes-anything" {
        fn tuning_accepts(&self, _kind: i64, _value: u8) -> Result<(), Abort> { Ok(()) }
    }
    "tuning-written-while-automatic" {
        fn tuning_accepts(&self, kind: i64, value: u8) -> Result<(), Abort> {
            if value > 3 || kind == 2 && value > 1 { Err(Abort::VALUE) } else { Ok(()) }
        }
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
        assert!(named("offset-ignored").is_some());
        assert!(named("none-of-these").is_none());
    }
}
