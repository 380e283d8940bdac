//! The controllers that take one decision otherwise.

use canopen::{Abort, Mux};

use super::Rules;
use crate::devices::deviating::{self, Deviation, deviating};
use crate::devices::drr460::model::switches::Switches;
use crate::devices::pixsys::led::Pattern;
use crate::stack::Attachment;

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
    ("latch-on-ignored", 9, 0),
    ("filter-ignored", 10, 1),
    ("action-ignored", 18, 0),
    ("command-hysteresis-ignored", 19, 0),
    ("command-error-state-ignored", 20, 0),
    ("command-stop-state-ignored", 21, 0),
    ("command-reset-ignored", 22, 0),
    ("command-delay-ignored", 23, 0),
    ("valve-time-ignored", 24, 60),
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
    ("alarm-2-error-state-ignored", 71, 0),
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
    ("bit-rate-parameter-ignored", 112, 6),
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
];

const DEVIATIONS: &[Deviation<dyn Rules>] = deviating! { Rules;
    "fahrenheit-without-32" {
        fn degrees(&self, celsius: f64, unit: i64) -> f64 {
            match unit { 1 => celsius * 1.8, 2 => celsius + 273.15, _ => celsius }
        }
    }
    "offset-before-gain" {
        fn calibrated(&self, digits: f64, gain: f64, offset: f64) -> f64 {
            (digits + offset) * (1.0 + gain / 1000.0)
        }
    }
    "gain-in-per-cent" {
        fn calibrated(&self, digits: f64, gain: f64, offset: f64) -> f64 {
            digits * (1.0 + gain / 100.0) + offset
        }
    }
    "cold-junction-uncompensated" {
        fn compensated(&self, _terminals: f64) -> f64 { 25.0 }
    }
    "cold-junction-never-fails" {
        fn junction_works(&self, _terminals: f64) -> bool { true }
    }
    "latch-on-without-end" {
        fn latch_time(&self) -> f64 { f64::INFINITY }
    }
    "latch-on-without-enabling" {
        fn latch_needs_enabling(&self) -> bool { false }
    }
    "zero-shifts-the-scale" {
        fn zero_keeps_ends(&self, _kind: i64) -> bool { false }
    }
    "error-state-20-ma-is-21-5" {
        fn milliamperes(&self, code: i64) -> f64 {
            match code { 0 => 0.0, 1 => 4.0, _ => 21.5 }
        }
    }
    "contact-closed-from-code-1" {
        fn closed(&self, code: i64) -> bool { code > 0 }
    }
    "valve-states-swapped" {
        fn valve_state(&self, code: i64) -> f64 { if code % 2 == 1 { 1.0 } else { 0.0 } }
    }
    "valve-contacts-swapped" {
        fn valve_contacts(&self, opens: bool, closes: bool) -> [bool; 2] { [closes, opens] }
    }
    "stop-keeps-heating" {
        fn controls(&self, _started: bool) -> bool { true }
    }
    "stop-state-ignored" {
        fn parameter(&self, sub: u8, configured: i64) -> i64 {
            if matches!(sub, 21 | 60 | 72) { 0 } else { configured }
        }
    }
    "initial-state-ignored" {
        fn starts(&self, _initial_state: i64, _before: bool) -> bool { true }
    }
    "initial-state-not-stored" {
        fn starts(&self, initial_state: i64, _before: bool) -> bool { initial_state != 1 }
    }
    "command-hysteresis-without-sign" {
        fn on_off(&self, hysteresis: i64) -> (i64, i64) { (0, hysteresis.abs()) }
    }
    "command-hysteresis-on-both-sides" {
        fn on_off(&self, hysteresis: i64) -> (i64, i64) { (-hysteresis.abs(), hysteresis.abs()) }
    }
    "delay-sign-swapped" {
        fn delay(&self, to_on: bool, delay: f64) -> f64 { if to_on { -delay } else { delay } }
    }
    "alarm-delay-without-sign" {
        fn parameter(&self, sub: u8, configured: i64) -> i64 {
            if matches!(sub, 62 | 74) { configured.abs() } else { configured }
        }
    }
    "alarm-delay-ignored" {
        fn parameter(&self, sub: u8, configured: i64) -> i64 {
            if matches!(sub, 62 | 74) { 0 } else { configured }
        }
    }
    "delay-both-ways" {
        fn delay(&self, _to_on: bool, delay: f64) -> f64 { delay.abs() }
    }
    "delay-goes-on-after-a-gap" {
        fn delay_starts_over(&self) -> bool { false }
    }
    "manual-reset-ignored" {
        fn latches(&self, _reset: i64) -> bool { false }
    }
    "stored-reset-not-kept" {
        fn kept_over_power_off(&self, _reset: i64) -> bool { false }
    }
    "reset-kept-without-storing" {
        fn kept_over_power_off(&self, reset: i64) -> bool { reset != 0 }
    }
    "resettable-while-it-lasts" {
        fn resettable(&self, latched: bool, _active: bool) -> bool { latched }
    }
    "reset-by-any-value" {
        fn resets(&self, _written: i64) -> bool { true }
    }
    "manual-without-permission" {
        fn manual(&self, _allowed: i64, asked: bool) -> bool { asked }
    }
    "manual-ignored" {
        fn manual(&self, _allowed: i64, _asked: bool) -> bool { false }
    }
    "break-stays-automatic" {
        fn break_leads_to_manual(&self, _allowed: i64) -> bool { false }
    }
    "break-leads-to-manual-without-memory" {
        fn break_leads_to_manual(&self, allowed: i64) -> bool { allowed != 0 }
    }
    "manual-forgotten-at-power-off" {
        fn manual_kept(&self, _allowed: i64) -> bool { false }
    }
    "manual-kept-without-memory" {
        fn manual_kept(&self, allowed: i64) -> bool { allowed != 0 }
    }
    "automatic-keeps-written-output" {
        fn sets_output(&self) -> bool { false }
    }
    "output-limits-ignored" {
        fn parameter(&self, sub: u8, configured: i64) -> i64 {
            match sub { 45 => 0, 46 => 100, _ => configured }
        }
    }
    "dead-band-on-one-side" {
        fn in_dead_band(&self, missing: i64, dead_band: i64) -> bool {
            (0..=dead_band).contains(&missing)
        }
    }
    "derivative-of-the-set-point" {
        fn set_point_step(&self, _moved: i64) -> i64 { 0 }
    }
    "integral-saved-up" {
        fn integral(&self, grown: f64, _limits: (f64, f64)) -> f64 { grown.clamp(-100.0, 100.0) }
    }
    "off-over-below" {
        fn is_over(&self, over: i64, threshold: i64) -> bool { over > -threshold }
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
    "cycle-begins-open" {
        fn in_share(&self, at: f64, share: f64, period: f64) -> bool {
            share >= 1.0 || at >= (1.0 - share) * period
        }
    }
    "alarm-2-kind-of-alarm-1" {
        fn alarm_parameter(&self, alarm: usize, offset: u8) -> u8 {
            if offset == 0 { 56 } else { [56, 68][alarm] + offset }
        }
    }
    "alarm-2-contact-of-alarm-1" {
        fn alarm_parameter(&self, alarm: usize, offset: u8) -> u8 {
            if offset == 1 { 57 } else { [56, 68][alarm] + offset }
        }
    }
    "alarm-2-hysteresis-of-alarm-1" {
        fn alarm_parameter(&self, alarm: usize, offset: u8) -> u8 {
            if offset == 2 { 58 } else { [56, 68][alarm] + offset }
        }
    }
    "alarm-2-error-state-of-alarm-1" {
        fn alarm_parameter(&self, alarm: usize, offset: u8) -> u8 {
            if offset == 3 { 59 } else { [56, 68][alarm] + offset }
        }
    }
    "alarm-2-stop-state-of-alarm-1" {
        fn alarm_parameter(&self, alarm: usize, offset: u8) -> u8 {
            if offset == 4 { 60 } else { [56, 68][alarm] + offset }
        }
    }
    "alarm-2-reset-of-alarm-1" {
        fn alarm_parameter(&self, alarm: usize, offset: u8) -> u8 {
            if offset == 5 { 61 } else { [56, 68][alarm] + offset }
        }
    }
    "alarm-2-delay-of-alarm-1" {
        fn alarm_parameter(&self, alarm: usize, offset: u8) -> u8 {
            if offset == 6 { 62 } else { [56, 68][alarm] + offset }
        }
    }
    "alarm-off-is-above" {
        fn parameter(&self, sub: u8, configured: i64) -> i64 {
            if matches!(sub, 56 | 68) { configured.max(1) } else { configured }
        }
    }
    "alarm-below-is-above" {
        fn parameter(&self, sub: u8, configured: i64) -> i64 {
            if matches!((sub, configured), (56 | 68, 2)) { 1 } else { configured }
        }
    }
    "alarm-of-set-point-looks-at-process" {
        fn parameter(&self, sub: u8, configured: i64) -> i64 {
            match (sub, configured) { (56 | 68, 6 | 7) => configured - 5, _ => configured }
        }
    }
    "alarms-share-a-set-point" {
        fn alarm_set_point(&self, _alarm: u16) -> Mux { Mux::new(0x4001, 0) }
    }
    "deviation-is-absolute" {
        fn deviation(&self, process: i64, _set_point: i64) -> i64 { process }
    }
    "alarm-beyond-its-threshold" {
        fn reaches(&self, value: i64, threshold: i64) -> bool { value > threshold }
    }
    "alarm-ignores-hysteresis" {
        fn second_threshold(&self, first: i64, _hysteresis: i64) -> i64 { first }
    }
    "alarm-hysteresis-without-sign" {
        fn second_threshold(&self, first: i64, hysteresis: i64) -> i64 { first + hysteresis.abs() }
    }
    "lower-deviation-not-negated" {
        fn lower_deviation(&self, alarm_set_point: i64) -> i64 { alarm_set_point }
    }
    "band-alarm-one-sided" {
        fn band(&self, deviation: i64) -> i64 { deviation }
    }
    "remote-alarm-is-bit-1" {
        fn remote_alarm(&self, value: i64) -> bool { value & 2 != 0 }
    }
    "normally-closed-ignored" {
        fn normally_closed(&self, _kind: i64, _contact: i64) -> bool { false }
    }
    "cooling-normally-closed" {
        fn normally_closed(&self, _kind: i64, contact: i64) -> bool { contact % 2 == 1 }
    }
    "alarm-armed-from-start" {
        fn waits_for_absence(&self, _contact: i64) -> bool { false }
    }
    "alarm-stays-armed-over-stop" {
        fn armed_over_stop(&self) -> bool { true }
    }
    "set-point-tunes-nothing" {
        fn set_point_tunes(&self) -> bool { false }
    }
    "tuning-at-the-greatest-gap" {
        fn gap_asks_for_tuning(&self, gap: i64, greatest: i64) -> bool { gap.abs() >= greatest }
    }
    "tuning-on-one-side" {
        fn gap_asks_for_tuning(&self, gap: i64, greatest: i64) -> bool { gap > greatest }
    }
    "tuning-deviation-added" {
        fn tuning_deviation(&self, configured: i64) -> i64 { -configured }
    }
    "tuning-at-every-start" {
        fn tunes_once(&self) -> bool { false }
    }
    "tuning-does-not-force" {
        fn tuning_forces(&self) -> bool { false }
    }
    "tuning-ends-without-master" {
        fn tuning_waits_for_master(&self) -> bool { false }
    }
    "tuning-beside-a-soft-start" {
        fn soft_start_prevents_tuning(&self, _kind: i64) -> bool { false }
    }
    "tuning-without-master" {
        fn longest_silence_in_tuning(&self) -> f64 { f64::INFINITY }
    }
    "tuning-silence-of-1-s" {
        fn longest_silence_in_tuning(&self) -> f64 { 1.0 }
    }
    "tuning-takes-anything" {
        fn tuning_accepts(&self, _kind: i64, _soft: bool, _value: u8) -> Result<(), Abort> {
            Ok(())
        }
    }
    "tuning-written-while-automatic" {
        fn tuning_accepts(&self, kind: i64, _soft: bool, value: u8) -> Result<(), Abort> {
            if value > 3 || kind == 2 && value > 1 { Err(Abort::VALUE) } else { Ok(()) }
        }
    }
    "soft-start-once-a-power-on" {
        fn soft_starts(&self, since_power_on: bool) -> bool { !since_power_on }
    }
    "gradient-per-minute" {
        fn gradient(&self, digits: i64) -> f64 { digits as f64 / 60.0 }
    }
    "gradient-only-up" {
        fn gradient_falls(&self) -> bool { false }
    }
    "soft-start-beyond-its-threshold" {
        fn soft_start_ends(&self, process: i64, threshold: i64) -> bool { process > threshold }
    }
    "soft-start-in-seconds" {
        fn minutes(&self, configured: i64) -> f64 { configured as f64 }
    }
    "transformer-of-100-ma" {
        fn tenths_of_amperes(&self, milliamperes: f64, full_scale: i64) -> f64 {
            milliamperes / 100.0 * full_scale as f64 * 10.0
        }
    }
    "low-current-at-its-threshold" {
        fn current_is_low(&self, current: f64, threshold: f64) -> bool { current <= threshold }
    }
    "high-current-at-its-threshold" {
        fn current_is_high(&self, current: f64, threshold: f64) -> bool { current >= threshold }
    }
    "over-current-without-delay" {
        fn current_delay(&self, fault: usize, delay: f64) -> f64 {
            if fault == 3 { 0.0 } else { delay }
        }
    }
    "over-current-without-alarm" {
        fn current_alarm(&self, faults: [bool; 4]) -> bool { faults[..3].contains(&true) }
    }
    "short-circuit-without-alarm" {
        fn current_alarm(&self, faults: [bool; 4]) -> bool { faults[1..].contains(&true) }
    }
    "whole-current-taught" {
        fn taught(&self, current: f64) -> f64 { current * 2.0 }
    }
    "key-teaches-at-once" {
        fn teaching_time(&self) -> u64 { 0 }
    }
    "key-enables-nothing" {
        fn key_enables(&self) -> bool { false }
    }
    "retransmission-beyond-its-range" {
        fn share(&self, value: f64, low: f64, high: f64) -> f64 {
            if high == low { 0.0 } else { ((value - low) / (high - low)).max(0.0) }
        }
    }
    "live-zero-ignored" {
        fn microamperes(&self, share: f64, _live_zero: bool) -> f64 { 20_000.0 * share }
    }
    "retransmission-before-command" {
        fn retransmits(&self, _is_command: bool) -> bool { true }
    }
    "expansion-always" {
        fn expansion(&self, _configured: i64) -> bool { true }
    }
    "expansion-ignored" {
        fn expansion(&self, _configured: i64) -> bool { false }
    }
    "initial-values-ignored" {
        fn sets_initial_values(&self) -> bool { false }
    }
    "error-outputs-as-a-whole" {
        fn commutes(&self, outputs: i64, mask: i64, values: i64) -> i64 {
            if mask == 0 { outputs } else { values }
        }
    }
    "off-line-time-in-seconds" {
        fn offline_time(&self, configured: i64) -> f64 { configured as f64 }
    }
    "reading-is-silence" {
        fn ends_silence(&self, reads: bool) -> bool { !reads }
    }
    "flags-of-the-load-shifted" {
        fn flag(&self, bit: u8) -> u8 { if (7..=10).contains(&bit) { bit + 1 } else { bit } }
    }
    "flags-of-the-memory-shifted" {
        fn flag(&self, bit: u8) -> u8 { if bit >= 16 { bit - 1 } else { bit } }
    }
    "outputs-status-swapped" {
        fn outputs_status(&self, q1: bool, q2: bool) -> i64 { i64::from(q2) | i64::from(q1) << 1 }
    }
    "switches-ignored" {
        fn attachment(&self, _: Switches, _: (i64, i64), _: i64) -> Attachment { Attachment::AsIs }
    }
    "address-parameter-first" {
        fn attachment(&self, switches: Switches, (address, _): (i64, i64), _: i64) -> Attachment {
            let node = Switches { address: 0, ..switches }.node(address);
            node.or_else(|| switches.node(address)).map_or(Attachment::Off, Attachment::Node)
        }
    }
    "contact-4-ignored" {
        fn loads_defaults(&self, _switches: Switches) -> bool { false }
    }
    "run-led-without-emergency" {
        fn run_led(&self, pattern: Pattern) -> Pattern {
            match pattern {
                Pattern::Medium => Pattern::Slow,
                Pattern::ThreeOn => Pattern::SteadyOn,
                Pattern::ThreeOff => Pattern::OneOff,
                other => other,
            }
        }
    }
    "error-leds-blink-together" {
        fn error_leds(&self, [first, _]: [Pattern; 2]) -> [Pattern; 2] { [first; 2] }
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
