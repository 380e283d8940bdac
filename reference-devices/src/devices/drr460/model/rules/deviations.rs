//! The controllers that take one decision otherwise.

mod tables;

use canopen::{Abort, Mux};

use super::{Layer, Rules};
use crate::devices::deviating::{self, Deviation, Lay, deviating};
use crate::devices::drr460::model::switches::Switches;
use crate::devices::pixsys::led::Pattern;
use crate::stack::Attachment;

/// The names of the devices that break one decision.
pub(crate) fn names() -> impl Iterator<Item = &'static str> {
    tables::names().chain(deviating::names(DEVIATIONS))
}

/// The deviation of that name; `None` when there is none.
pub(crate) fn named(name: &str) -> Option<Lay<dyn Rules>> {
    tables::named(name).or_else(|| deviating::named(DEVIATIONS, name))
}

const DEVIATIONS: &[Deviation<dyn Rules>] = deviating! { dyn Rules: Rules [];
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
    "only-inputs-transmitted" {
        fn transmits_any_change(&self) -> bool { false }
    }
    "remote-alarm-is-bit-1" {
        fn remote_alarm(&self, value: i64) -> bool { value & 2 != 0 }
    }
    "normally-closed-ignored" {
        fn normally_closed(&self, _kind: i64, _contact: i64) -> bool { false }
    }
    "alarm-armed-from-start" {
        fn waits_for_absence(&self, _contact: i64) -> bool { false }
    }
    "set-point-tunes-nothing" {
        fn set_point_tunes(&self) -> bool { false }
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
    "soft-start-in-seconds" {
        fn minutes(&self, configured: i64) -> f64 { configured as f64 }
    }
    "transformer-of-100-ma" {
        fn tenths_of_amperes(&self, milliamperes: f64, full_scale: i64) -> f64 {
            milliamperes / 100.0 * full_scale as f64 * 10.0
        }
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
        fn sets_initial_values(&self, _expansion: bool) -> bool { false }
    }
    "initial-values-always" {
        fn sets_initial_values(&self, _expansion: bool) -> bool { true }
    }
    "expansion-until-power-off" {
        fn expansion_lasts(&self) -> bool { true }
    }
    "expansion-without-input" {
        fn shows_process(&self, expansion: bool) -> bool { !expansion }
    }
    "fluid-presets-at-power-on" {
        fn presets_at_power_on(&self) -> bool { true }
    }
    "scale-never-turned" {
        fn limits(&self, low: f64, high: f64) -> (f64, f64) { (low.min(high), high.max(low)) }
    }
    "dip-of-current-counts-on" {
        fn current_delay_starts_over(&self) -> bool { false }
    }
    "current-delay-anew-in-each-cycle" {
        fn current_delay_stands_still(&self) -> bool { false }
    }
    "switches-act-at-once" {
        fn switches_act_at_once(&self) -> bool { true }
    }
    "wiring-waits-for-writing" {
        fn waits_for_writing(&self, sub: u8) -> bool { sub == 16 }
    }
    "stored-input-waits-for-writing" {
        fn waits_for_writing(&self, sub: u8) -> bool { matches!(sub, 1..=10) }
    }
    "stored-delay-waits-for-writing" {
        fn waits_for_writing(&self, sub: u8) -> bool { matches!(sub, 23) }
    }
    "stored-band-waits-for-writing" {
        fn waits_for_writing(&self, sub: u8) -> bool { matches!(sub, 33) }
    }
    "stored-limit-waits-for-writing" {
        fn waits_for_writing(&self, sub: u8) -> bool { matches!(sub, 46) }
    }
    "stored-alarm-1-waits-for-writing" {
        fn waits_for_writing(&self, sub: u8) -> bool { matches!(sub, 56..=62) }
    }
    "stored-alarm-2-waits-for-writing" {
        fn waits_for_writing(&self, sub: u8) -> bool { matches!(sub, 68..=74) }
    }
    "stored-current-waits-for-writing" {
        fn waits_for_writing(&self, sub: u8) -> bool { matches!(sub, 90..=94) }
    }
    "stored-off-line-time-waits-for-writing" {
        fn waits_for_writing(&self, sub: u8) -> bool { matches!(sub, 115) }
    }
    "stored-analogue-range-waits-for-writing" {
        fn waits_for_writing(&self, sub: u8) -> bool { matches!(sub, 125..=127) }
    }
    "retransmission-waits-for-writing" {
        fn waits_for_writing(&self, sub: u8) -> bool { sub == 100 }
    }
    "band-of-ten-degrees-at-least" {
        fn parameter(&self, sub: u8, configured: i64) -> i64 {
            if sub == 33 && configured > 0 { configured.max(100) } else { configured }
        }
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
        fn attachment(&self, _switches: Switches, _own: (i64, i64), _bus: i64) -> Attachment {
            Attachment::AsIs
        }
    }
    "address-parameter-first" {
        fn attachment(&self, switches: Switches, own: (i64, i64), _bus: i64) -> Attachment {
            let (address, _) = own;
            let node = Switches { address: 0, ..switches }.node(address);
            node.or_else(|| switches.node(address)).map_or(Attachment::Off, Attachment::Node)
        }
    }
    "address-parameter-or-switches" {
        fn attachment(&self, switches: Switches, own: (i64, i64), _bus: i64) -> Attachment {
            let (address, _) = own;
            let set = Switches { address: 0, ..switches }.node(address).unwrap_or(0);
            let node = Switches { address: switches.address | set, ..switches }.node(address);
            node.map_or(Attachment::Off, Attachment::Node)
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
        fn error_leds(&self, alternate: [Pattern; 2]) -> [Pattern; 2] { [alternate[0]; 2] }
    }
    "thermoresistance-with-terminals" {
        fn wires(&self, terminals: f64) -> f64 { terminals - 25.0 }
    }
    "unit-of-linear-inputs" {
        fn linear(&self, digits: f64, unit: i64) -> f64 {
            if unit == 1 { digits * 1.8 + 320.0 } else { digits }
        }
    }
    "limits-of-temperatures" {
        fn temperature(&self, digits: f64, limits: (f64, f64)) -> f64 {
            let (low, high) = limits;
            digits.clamp(low.min(high), high.max(low))
        }
    }
    "latch-on-forgotten" {
        fn latch_lasts(&self) -> bool { false }
    }
    "break-ends-with-its-repair" {
        fn break_is_kept(&self) -> bool { false }
    }
    "alarms-rest-in-manual-mode" {
        fn alarms_work(&self, manual: bool) -> bool { !manual }
    }
    "memory-knows-manual-only" {
        fn remembers(&self, _manual: bool) -> bool { true }
    }
    "integral-without-band-is-on-off" {
        fn is_on_off(&self, band: i64, _integral_time: i64) -> bool { band == 0 }
    }
    "integral-kept-over-stop" {
        fn stop_ends_integral(&self) -> bool { false }
    }
    "tuning-finds-nothing" {
        fn takes_found(&self) -> bool { false }
    }
    "soft-start-not-at-power-on" {
        fn soft_starts(&self, since_power_on: bool) -> bool { since_power_on }
    }
    "off-line-not-rearmed" {
        fn ends_silence(&self, _reads: bool) -> bool { false }
    }
    "off-line-by-default" {
        fn offline_time(&self, configured: i64) -> f64 {
            if configured == 0 { 0.2 } else { configured as f64 / 10.0 }
        }
    }
    "expansion-outputs-swapped" {
        fn driven(&self, outputs: i64) -> i64 { outputs >> 1 & 1 | (outputs & 1) << 1 }
    }
    "expansion-without-errors" {
        fn errors_commute(&self) -> bool { false }
    }
    "output-leds-swapped" {
        fn output_leds(&self, outputs: [Pattern; 2]) -> [Pattern; 2] { [outputs[1], outputs[0]] }
    }
    "key-led-steady" {
        fn key_led(&self, _pattern: Pattern) -> Pattern { Pattern::SteadyOn }
    }
    "fluid-presets-no-cycle" {
        fn fluid(&self, fluid: i64) -> (i64, i64) {
            match fluid { 1 => (125, 10), 2 => (250, 10), _ => (100, 10) }
        }
    }
    "key-teaches-after-six-seconds" {
        fn teaching_time(&self) -> u64 { 6000 }
    }
    "cycle-never-whole" {
        fn cycle_share(&self, share: f64) -> f64 { share.min(0.9) }
    }
    "potentiometer-by-its-wiper" {
        fn track(&self, _connected: f64, configured: f64) -> f64 { configured }
    }
    "samples-in-periods" {
        fn samples_at_once(&self) -> bool { false }
    }
    "filter-of-first-order" {
        fn filters_by_mean(&self) -> bool { false }
    }
    "command-hysteresis-beyond-the-set-point" {
        fn on_off(&self, hysteresis: i64) -> (i64, i64) { (-hysteresis.max(0), -hysteresis.min(0)) }
    }
    "command-reset-holds-off" {
        fn reset_holds_on(&self) -> bool { false }
    }
    "dead-band-subtracted" {
        fn beyond_dead_band(&self, missing: i64, dead_band: i64) -> i64 {
            missing - dead_band * missing.signum()
        }
    }
    "overlap-by-halves" {
        fn overlap(&self, overlap: f64) -> (f64, f64) { (overlap / 2.0, overlap / 2.0) }
    }
    "share-counts-from-the-next-cycle" {
        fn share_counts_at_once(&self) -> bool { false }
    }
    "alarm-of-set-point-looks-at-4000h" {
        fn looked_at(&self, _in_force: i64, wanted: i64) -> i64 { wanted }
    }
    "selected-alarm-is-armed" {
        fn selection_disarms(&self) -> bool { false }
    }
    "tuning-at-any-gap" {
        fn any_gap_tunes(&self) -> bool { true }
    }
    "tuning-without-limits" {
        fn tuning_limits(&self, _bands: (f64, f64), _integral_time: f64) -> ((f64, f64), f64) {
            ((1.0, f64::from(i16::MAX)), 0.0)
        }
    }
    "gradient-without-end" {
        fn gradient_ends(&self) -> bool { false }
    }
    "flags-of-the-load-stay" {
        fn current_flags_end(&self) -> bool { false }
    }
    "whole-current-is-the-threshold" {
        fn taught(&self, current: f64) -> f64 { current }
    }
    "retransmission-to-21.5-ma" {
        fn share(&self, value: f64, low: f64, high: f64) -> f64 {
            if high == low { 0.0 } else { ((value - low) / (high - low)).clamp(0.0, 1.075) }
        }
    }
    "retransmission-limits-in-degrees" {
        fn retransmission_limit(&self, limit: i64, is_temperature: bool) -> f64 {
            limit as f64 * if is_temperature { 10.0 } else { 1.0 }
        }
    }
    "every-flag-is-an-error" {
        fn errors(&self, without_process: i64) -> i64 { without_process | !(0xF << 7) }
    }
    "sensor-reported" {
        fn reports_sensor(&self) -> bool { true }
    }
    "boot-reported" {
        fn reports_boot(&self) -> bool { true }
    }
    "input-shows-more" {
        fn input_error(&self) -> f64 { 0.003 }
    }
    "input-shows-less" {
        fn input_error(&self) -> f64 { -0.003 }
    }
    "cooling-goes-on-in-errors" {
        fn cooling_knows_errors(&self) -> bool { false }
    }
    "error-state-of-on-off-only" {
        fn errors_concern(&self, proportional: bool) -> bool { !proportional }
    }
    "manual-goes-on-in-stop" {
        fn manual_goes_on_in_stop(&self) -> bool { true }
    }
    "module-not-reported" {
        fn reports_module(&self) -> bool { false }
    }
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_is_used_once() {
        deviating::assert_unique(names(), |name| named(name).is_some());
    }
}
