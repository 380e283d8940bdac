//! The modules that take one decision otherwise.

use canopen::emcy::EmcyCode;
use canopen::{Abort, Instant, Mux, NmtState};

use super::super::encoder;
use super::super::indicators::{Pattern, Phase};
use super::super::parameters::{DEFAULT_BIT_RATE, Item};
use super::super::sensor::Wiring;
use super::{Diagnosis, Layer, Manual, Mcm260xRules};
use crate::devices::deviating::{self, Deviation, Lay, deviating};

/// The names of the devices that break one decision.
pub(crate) fn names() -> impl Iterator<Item = &'static str> {
    let fixed = FIXED.iter().map(|(name, ..)| *name);
    let taken = TAKEN_FOR.iter().map(|(name, ..)| *name);
    fixed.chain(taken).chain(deviating::names(DEVIATIONS))
}

/// The deviation of that name; `None` when there is none.
pub(crate) fn named(name: &str) -> Option<Lay<dyn Mcm260xRules>> {
    let parameter = |item, from, to| -> Option<Lay<dyn Mcm260xRules>> {
        Some(deviating::unmutable(move |beneath| Box::new(TakenFor { beneath, item, from, to })))
    };
    if let Some((_, item, value)) = FIXED.iter().find(|(fixed, ..)| *fixed == name) {
        return parameter(*item, None, *value);
    }
    if let Some((_, item, from, to)) = TAKEN_FOR.iter().find(|(taken, ..)| *taken == name) {
        return parameter(*item, Some(*from), *to);
    }
    deviating::named(DEVIATIONS, name)
}

/// A module that takes one code of a parameter, or any, for another one.
struct TakenFor {
    beneath: Box<dyn Mcm260xRules>,
    item: Item,
    from: Option<i64>,
    to: i64,
}

impl Layer for TakenFor {
    fn beneath(&self) -> Option<&dyn Mcm260xRules> {
        Some(&*self.beneath)
    }
}

impl Mcm260xRules for TakenFor {
    fn parameter(&self, item: Item, configured: i64) -> i64 {
        let configured = self.beneath.parameter(item, configured);
        let is_it = item == self.item && self.from.is_none_or(|from| configured == from);
        if is_it { self.to } else { configured }
    }
}

const TAKEN_FOR: &[(&str, Item, i64, i64)] = &[
    ("tc-k-taken-for-tc-s", Item::SensorType, 1, 2),
    ("tc-s-taken-for-tc-j", Item::SensorType, 2, 4),
    ("tc-r-taken-for-tc-j", Item::SensorType, 3, 4),
    ("tc-j-taken-for-tc-t", Item::SensorType, 4, 5),
    ("tc-t-taken-for-tc-b", Item::SensorType, 5, 8),
    ("tc-e-taken-for-tc-t", Item::SensorType, 6, 5),
    ("tc-n-taken-for-tc-e", Item::SensorType, 7, 6),
    ("tc-b-taken-for-tc-n", Item::SensorType, 8, 7),
    ("pt100-taken-for-ni100", Item::SensorType, 9, 10),
    ("ni100-taken-for-ntc", Item::SensorType, 10, 11),
    ("ntc-taken-for-tc-b", Item::SensorType, 11, 8),
    ("ptc-taken-for-ntc", Item::SensorType, 12, 11),
    ("pt500-taken-for-ptc", Item::SensorType, 13, 12),
    ("pt1000-taken-for-ptc", Item::SensorType, 14, 12),
    ("1-volt-taken-for-5-volts", Item::SensorType, 15, 16),
    ("5-volts-taken-for-10-volts", Item::SensorType, 16, 17),
    ("10-volts-taken-for-5-volts", Item::SensorType, 17, 16),
    ("0-to-20-milliamperes-taken-for-4-to-20", Item::SensorType, 18, 19),
    ("4-to-20-milliamperes-taken-for-0-to-20", Item::SensorType, 19, 18),
    ("60-millivolts-taken-for-1-volt", Item::SensorType, 20, 15),
    ("potentiometer-taken-for-60-millivolts", Item::SensorType, 21, 20),
    ("disabled-input-taken-for-pt100", Item::SensorType, 0, 9),
    ("fahrenheit-taken-for-kelvin", Item::Degree, 1, 2),
    ("kelvin-taken-for-fahrenheit", Item::Degree, 2, 1),
    ("x2-taken-for-x4", Item::EncoderSetup, 1, 2),
    ("x4-taken-for-x2", Item::EncoderSetup, 2, 1),
    ("x2-with-z-taken-for-x4", Item::EncoderSetup, 3, 4),
    ("x4-with-z-taken-for-x2", Item::EncoderSetup, 4, 3),
    ("x2-with-z-taken-for-x2", Item::EncoderSetup, 3, 1),
    ("x4-with-z-taken-for-x4", Item::EncoderSetup, 4, 2),
    ("counter-up-taken-for-down", Item::EncoderSetup, 5, 6),
    ("counter-down-taken-for-up", Item::EncoderSetup, 6, 5),
    ("disabled-encoder-taken-for-x4", Item::EncoderSetup, 0, 2),
];

const FIXED: &[(&str, Item, i64)] = &[
    ("interface-ignored", Item::Interface, 0),
    ("address-ignored", Item::Address, 0),
    ("bit-rate-ignored", Item::BitRate, DEFAULT_BIT_RATE),
    ("offline-time-ignored", Item::OfflineTime, 0),
    ("offline-outputs-ignored", Item::OfflineOutputs, 0),
    ("encoder-setup-always-x4", Item::EncoderSetup, 2),
    ("sensor-type-always-volts", Item::SensorType, 17),
    ("degree-ignored", Item::Degree, 0),
    ("lower-limit-of-input-ignored", Item::LowerLimit, 0),
    ("upper-limit-of-input-ignored", Item::UpperLimit, 1000),
    ("potentiometer-always-10-kilohms", Item::Potentiometer, 10),
    ("limits-may-be-left", Item::BeyondLimits, 1),
    ("limits-always-hold", Item::BeyondLimits, 0),
    ("input-offset-ignored", Item::Offset, 0),
    ("input-gain-ignored", Item::Gain, 0),
    ("average-of-one-sample", Item::Filter, 1),
    ("average-of-fifty-samples", Item::Filter, 50),
    ("frequency-ignored", Item::Frequency, 5),
    ("every-sample-accepted", Item::MaximumDifference, i64::MAX),
    ("no-sample-accepted-late", Item::MaximumRejection, 1_000_000),
    ("output-always-volts", Item::OutputType, 0),
    ("lower-limit-of-output-ignored", Item::OutputLower, 0),
    ("upper-limit-of-output-ignored", Item::OutputUpper, 1000),
    ("sensor-type-always-pt100", Item::SensorType, 9),
    ("sensor-type-always-5-volts", Item::SensorType, 16),
    ("sensor-type-always-4-to-20-milliamperes", Item::SensorType, 19),
    ("sensor-always-off", Item::SensorType, 0),
    ("degree-always-kelvin", Item::Degree, 2),
    ("potentiometer-always-100-kilohms", Item::Potentiometer, 100),
    ("every-change-rejected", Item::MaximumDifference, 0),
    ("nothing-rejected", Item::MaximumRejection, 0),
    ("output-always-milliamperes", Item::OutputType, 1),
    ("offline-outputs-always-on", Item::OfflineOutputs, -1),
    ("frequency-always-fastest", Item::Frequency, 13),
    ("encoder-setup-always-x2", Item::EncoderSetup, 1),
    ("encoder-setup-always-up", Item::EncoderSetup, 5),
    ("encoder-always-off", Item::EncoderSetup, 0),
];

const DEVIATIONS: &[Deviation<dyn Mcm260xRules>] = deviating! { dyn Mcm260xRules: Mcm260xRules [];
    "low-word-with-sign" {
        fn joined_words(&self, high: i64, low: i64) -> i64 { (high << 16) + low }
    }
    "fourth-preset-in-the-third" {
        fn preset_place(&self, place: usize) -> usize { place.min(2) }
    }
    "command-for-z-outlives-a-reset" {
        fn waits_over_a_start(&self) -> bool { true }
    }
    "intervals-outlive-a-reset" {
        fn intervals_over_a_start(&self) -> bool { true }
    }
    "loads-when-it-looks" {
        fn loaded_at(&self, _index: i64, to: i64) -> i64 { to }
    }
    "command-for-z-cannot-be-withdrawn" {
        fn command_replaces_the_last(&self) -> bool { false }
    }
    "setup-taken-at-rest-only" {
        fn takes_a_setup_while_turning(&self) -> bool { false }
    }
    "second-of-the-last-tenth" {
        fn windows(&self, _second: i64, tenth: i64) -> (i64, i64) { (tenth * 10, tenth) }
    }
    "counter-down-knows-the-direction" {
        fn counts(&self, mode: i64, from: i64, to: i64) -> i64 {
            let counts = encoder::counts(mode, from, to);
            if mode == 6 && to < from { -counts } else { counts }
        }
    }
    "low-supply-hides-the-inputs" {
        fn flags(&self, _before: i64, now: i64) -> i64 {
            if now & 0x0800 != 0 { now & 0x0FFF } else { now }
        }
    }
    "error-of-the-first-input-ends-only" {
        fn ends(&self, place: usize) -> bool { place == 0 }
    }
    "falls-are-always-near" {
        fn is_near(&self, difference: f64, near: f64) -> bool { difference <= near }
    }
    "rejection-counts-from-the-first-peak" {
        fn rejection_begins_anew(&self) -> bool { false }
    }
    "gain-ends-at-a-tenth" {
        fn calibrated(&self, digits: f64, gain: f64, offset: f64) -> f64 {
            digits * (1.0 + gain.clamp(-100.0, 100.0) / 1000.0) + offset
        }
    }
    "second-error-mode-not-mirrored" {
        fn mirrors(&self, written: Mux) -> bool { written != Mux::new(0x6443, 2) }
    }
    "parameters-of-the-first-channel" {
        fn channel(&self, _item: Item, _place: usize) -> usize { 0 }
    }
    "counts-every-second-edge" {
        fn counts(&self, mode: i64, from: i64, to: i64) -> i64 {
            encoder::counts(if mode % 2 == 0 { mode - 1 } else { mode }, from, to)
        }
    }
    "counts-without-direction" {
        fn counts(&self, mode: i64, from: i64, to: i64) -> i64 {
            encoder::counts(mode, from, to).abs()
        }
    }
    "b-before-a-is-forward" {
        fn counts(&self, mode: i64, from: i64, to: i64) -> i64 {
            let counts = encoder::counts(mode, from, to);
            if mode < 5 { -counts } else { counts }
        }
    }
    "count-ends-at-its-limits" {
        fn count(&self, count: i32, counts: i64) -> i32 {
            (i64::from(count) + counts).clamp(i32::MIN.into(), i32::MAX.into()) as i32
        }
    }
    "count-outlives-power-off" {
        fn count_at_start(&self, last: i32) -> i32 { last }
    }
    "new-setup-clears-the-count" {
        fn count_in_new_setup(&self, _count: i32) -> i32 { 0 }
    }
    "z-clears-the-count" {
        fn count_at_index(&self, _count: i32) -> i32 { 0 }
    }
    "load-is-counted" {
        fn counted_by_loading(&self, step: i64) -> i64 { step }
    }
    "preset-apart-from-its-words" {
        fn preset_is_one_value(&self) -> bool { false }
    }
    "error-values-are-written" {
        fn output_objects_stay(&self) -> bool { false }
    }
    "boot-up-is-no-state" {
        fn takes_boot_state(&self, state: u16) -> bool { matches!(state, 4 | 5 | 127) }
    }
    "any-boot-state" {
        fn takes_boot_state(&self, _state: u16) -> bool { true }
    }
    "offline-time-to-32767" {
        fn longest_offline_time(&self) -> u16 { 32_767 }
    }
    "beyond-the-limits-refused" {
        fn takes_beyond_limits(&self) -> bool { false }
    }
    "counts-backwards" {
        fn counts(&self, mode: i64, from: i64, to: i64) -> i64 { -encoder::counts(mode, from, to) }
    }
    "counts-while-off" {
        fn counts(&self, mode: i64, from: i64, to: i64) -> i64 {
            encoder::counts(if mode == 0 { 2 } else { mode }, from, to)
        }
    }
    "counter-counts-up-only" {
        fn counts(&self, mode: i64, from: i64, to: i64) -> i64 {
            encoder::counts(if mode == 6 { 5 } else { mode }, from, to)
        }
    }
    "counter-counts-both-edges" {
        fn counts(&self, mode: i64, from: i64, to: i64) -> i64 {
            match mode {
                5 | 6 => 2 * encoder::counts(mode, from, to),
                _ => encoder::counts(mode, from, to),
            }
        }
    }
    "preset-never-loaded" {
        fn loads_now(&self, _command: i64) -> bool { false }
    }
    "preset-loaded-by-any-command" {
        fn loads_now(&self, command: i64) -> bool { command != 0 }
    }
    "preset-never-loaded-at-z" {
        fn loads_at_index(&self, _command: i64) -> bool { false }
    }
    "command-stays" {
        fn command_left(&self, command: i64, _waits: bool) -> i64 { command }
    }
    "command-for-z-falls-back-at-once" {
        fn command_left(&self, _command: i64, _waits: bool) -> i64 { 0 }
    }
    "windows-swapped" {
        fn windows(&self, second: i64, tenth: i64) -> (i64, i64) { (tenth, second) }
    }
    "preset-of-16-bits" {
        fn preset(&self, _high: i64, low: i64) -> i64 { low as i16 as i64 }
    }
    "preset-words-swapped" {
        fn preset(&self, high: i64, low: i64) -> i64 { low << 16 | high & 0xFFFF }
    }
    "channel-flags-from-bit-11" {
        fn channel_flag(&self, place: usize) -> i64 { 1 << (11 + place) }
    }
    "channel-flag-of-the-first" {
        fn channel_flag(&self, _place: usize) -> i64 { 1 << 12 }
    }
    "out-of-range-without-message" {
        fn diagnosis(&self, _place: usize) -> Option<Diagnosis> { None }
    }
    "diagnosis-without-channel" {
        fn diagnosis(&self, place: usize) -> Option<Diagnosis> {
            let vendor = [0x00, 0x07, 0x00, 0x00, place as u8 + 13];
            Some(Diagnosis { code: EmcyCode(0xFF00), register: 0x81, vendor })
        }
    }
    "low-supply-ignored" {
        fn supply_is_low(&self, _volts: f64) -> bool { false }
    }
    "outputs-without-supply" {
        fn energised(&self, levels: i64, _supplied: bool) -> i64 { levels }
    }
    "led-without-errors" {
        fn led_shows(&self, _error: bool) -> bool { false }
    }
    "led-always-with-error" {
        fn led_shows(&self, _error: bool) -> bool { true }
    }
    "boot-up-as-pre-operational" {
        fn run_led(&self, phase: Phase) -> Phase {
            match phase {
                Phase::BootUp => Phase::Node(NmtState::PRE_OPERATIONAL, false),
                _ => phase,
            }
        }
    }
    "pre-operational-as-operational" {
        fn run_led(&self, phase: Phase) -> Phase {
            match phase {
                Phase::Node(NmtState::PRE_OPERATIONAL, error) => {
                    Phase::Node(NmtState::OPERATIONAL, error)
                }
                _ => phase,
            }
        }
    }
    "stopped-as-pre-operational" {
        fn run_led(&self, phase: Phase) -> Phase {
            match phase {
                Phase::Node(NmtState::STOPPED, error) => {
                    Phase::Node(NmtState::PRE_OPERATIONAL, error)
                }
                _ => phase,
            }
        }
    }
    "operational-as-pre-operational" {
        fn run_led(&self, phase: Phase) -> Phase {
            match phase {
                Phase::Node(NmtState::OPERATIONAL, error) => {
                    Phase::Node(NmtState::PRE_OPERATIONAL, error)
                }
                _ => phase,
            }
        }
    }
    "led-dark-with-modbus" {
        fn run_led(&self, phase: Phase) -> Phase {
            match phase {
                Phase::Modbus(_) => Phase::Dark,
                _ => phase,
            }
        }
    }
    "same-led-for-every-error" {
        fn run_led(&self, phase: Phase) -> Phase {
            match phase {
                Phase::Node(_, true) => Phase::Node(NmtState::PRE_OPERATIONAL, true),
                _ => phase,
            }
        }
    }
    "com-led-dark" {
        fn com_led(&self, _heard: bool) -> bool { false }
    }
    "level-leds-dark" {
        fn level_leds(&self, _inputs: i64, _outputs: i64) -> i64 { 0 }
    }
    "level-leds-of-outputs-only" {
        fn level_leds(&self, _inputs: i64, outputs: i64) -> i64 { outputs }
    }
    "level-leds-of-inputs-only" {
        fn level_leds(&self, inputs: i64, _outputs: i64) -> i64 { inputs }
    }
    "level-leds-from-the-other-end" {
        fn level_leds(&self, inputs: i64, outputs: i64) -> i64 {
            i64::from(((inputs | outputs) as u8).reverse_bits())
        }
    }
    "leds-of-outputs-first" {
        fn inputs_come_first(&self) -> bool { false }
    }
    "input-led-while-disabled" {
        fn input_led(&self, _off: bool, out_of_range: bool) -> (bool, bool) {
            (false, out_of_range)
        }
    }
    "input-led-without-errors" {
        fn input_led(&self, off: bool, _out_of_range: bool) -> (bool, bool) { (off, false) }
    }
    "output-led-dark" {
        fn output_led(&self, _active: bool) -> bool { false }
    }
    "display-always-dark" {
        fn displayed(&self, _flags: i64) -> i64 { 0 }
    }
    "display-never-dark" {
        fn displayed(&self, flags: i64) -> i64 { if flags == 0 { 1 } else { flags } }
    }
    "display-counts-from-0" {
        fn displayed(&self, flags: i64) -> i64 { flags >> 1 }
    }
    "flags-stay" {
        fn flags(&self, before: i64, now: i64) -> i64 { before | now }
    }
    "flag-of-the-configuration-always" {
        fn flags(&self, _before: i64, now: i64) -> i64 { now | 1 }
    }
    "only-one-flag-at-a-time" {
        fn flags(&self, _before: i64, now: i64) -> i64 { now & -now }
    }
    "supply-low-below-12-volts" {
        fn supply_is_low(&self, volts: f64) -> bool { volts < 12.0 }
    }
    "supply-low-below-9-volts" {
        fn supply_is_low(&self, volts: f64) -> bool { volts < 9.0 }
    }
    "supply-of-the-first-group" {
        fn group(&self, _block: usize, _of_each_block: bool) -> usize { 0 }
    }
    "supply-of-the-first-block-only" {
        fn group(&self, block: usize, _of_each_block: bool) -> usize { block }
    }
    "analogue-outputs-swapped" {
        fn output(&self, place: usize) -> usize { 1 - place.min(1) }
    }
    "both-outputs-as-the-first" {
        fn output(&self, _place: usize) -> usize { 0 }
    }
    "output-of-ten-bits" {
        fn share(&self, digits: i64, lower: i64, upper: i64) -> f64 {
            let _ = (lower, upper);
            digits as f64 / 1023.0
        }
    }
    "output-off-beyond-its-limits" {
        fn share(&self, digits: i64, lower: i64, upper: i64) -> f64 {
            let share = Manual.share(digits, lower, upper);
            if share > 1.0 { 0.0 } else { share }
        }
    }
    "output-full-below-its-limits" {
        fn share(&self, digits: i64, lower: i64, upper: i64) -> f64 {
            let share = Manual.share(digits, lower, upper);
            if share < 0.0 { 1.0 } else { share }
        }
    }
    "output-without-falling-scale" {
        fn share(&self, digits: i64, lower: i64, upper: i64) -> f64 {
            Manual.share(digits, lower.min(upper), lower.max(upper))
        }
    }
    "preset-loaded-as-it-is-written" {
        fn preset_waits_for_command(&self) -> bool { false }
    }
    "preset-words-shown-swapped" {
        fn preset_words(&self, preset: i64) -> (i64, i64) {
            (i64::from(preset as i16), preset >> 16)
        }
    }
    "preset-high-word-without-sign" {
        fn preset_words(&self, preset: i64) -> (i64, i64) {
            (preset >> 16 & 0x7FFF, i64::from(preset as i16))
        }
    }
    "error-objects-apart-from-parameters" {
        fn mirrors(&self, written: Mux) -> bool {
            !matches!(written.index, 0x6443 | 0x6444) && !(66..=69).contains(&written.sub)
        }
    }
    "filter-apart-from-its-parameter" {
        fn mirrors(&self, written: Mux) -> bool {
            written.index != 0x2000 && !matches!(written.sub, 35 | 72)
        }
    }
    "what-is-loaded-counts-back" {
        fn counted_by_loading(&self, step: i64) -> i64 { -step }
    }
    "counts-in-operational-only" {
        fn counts_in(&self, state: NmtState) -> bool { state == NmtState::OPERATIONAL }
    }
    "counts-not-in-stopped" {
        fn counts_in(&self, state: NmtState) -> bool { state != NmtState::STOPPED }
    }
    "choice-without-restart" {
        fn choice_restarts(&self) -> bool { false }
    }
    "off-line-levels-on-can" {
        fn works_with_modbus(&self, _interface: i64) -> bool { true }
    }
    "off-line-time-on-can" {
        fn works_with_modbus(&self, _interface: i64) -> bool { true }
        fn silent_since(&self, start: Instant, heard: Option<Instant>) -> Instant {
            heard.unwrap_or(start)
        }
    }
    "never-off-line-on-modbus" {
        fn works_with_modbus(&self, _interface: i64) -> bool { false }
    }
    "unit-of-linear-signals" {
        fn linear_digits(&self, digits: f64, degree: i64) -> f64 {
            if degree == 0 { digits } else { digits * 1.8 + 320.0 }
        }
    }
    "offset-before-gain" {
        fn calibrated(&self, digits: f64, gain: f64, offset: f64) -> f64 {
            (digits + offset) * (1.0 + gain / 1000.0)
        }
    }
    "gain-in-hundredths" {
        fn calibrated(&self, digits: f64, gain: f64, offset: f64) -> f64 {
            digits * (1.0 + gain / 100.0) + offset
        }
    }
    "gain-of-whole-percent" {
        fn calibrated(&self, digits: f64, gain: f64, offset: f64) -> f64 {
            Manual.calibrated(digits, (gain / 10.0).trunc() * 10.0, offset)
        }
    }
    "span-of-16-bits" {
        fn span(&self, lower: i64, upper: i64) -> i64 { i64::from((upper - lower) as i16) }
    }
    "gain-raises-only" {
        fn calibrated(&self, digits: f64, gain: f64, offset: f64) -> f64 {
            Manual.calibrated(digits, gain.max(0.0), offset)
        }
    }
    "offset-subtracted" {
        fn calibrated(&self, digits: f64, gain: f64, offset: f64) -> f64 {
            Manual.calibrated(digits, gain, -offset)
        }
    }
    "offset-of-zero-below-zero" {
        fn calibrated(&self, digits: f64, gain: f64, offset: f64) -> f64 {
            Manual.calibrated(digits, gain, offset.max(0.0))
        }
    }
    "never-below-zero" {
        fn calibrated(&self, digits: f64, gain: f64, offset: f64) -> f64 {
            Manual.calibrated(digits, gain, offset).max(0.0)
        }
    }
    "junction-without-compensation" {
        fn junction_error(&self, terminals: f64) -> f64 { terminals - 25.0 }
    }
    "broken-wire-unnoticed" {
        fn wires(&self, _sensor: i64, wiring: Wiring) -> Wiring {
            if wiring == Wiring::Broken { Wiring::Connected } else { wiring }
        }
    }
    "broken-thermocouple-unnoticed" {
        fn wires(&self, sensor: i64, wiring: Wiring) -> Wiring {
            if sensor <= 8 { Wiring::Connected } else { wiring }
        }
    }
    "short-circuit-unnoticed" {
        fn wires(&self, _sensor: i64, wiring: Wiring) -> Wiring {
            if wiring == Wiring::Shorted { Wiring::Connected } else { wiring }
        }
    }
    "filter-loses-a-part" {
        fn average(&self, sum: f64, samples: usize) -> f64 { sum / (samples as f64 + 0.5) }
    }
    "whole-degrees-only" {
        fn average(&self, sum: f64, samples: usize) -> f64 {
            (sum / samples as f64 / 10.0).trunc() * 10.0
        }
    }
    "counts-whole-lines" {
        fn counts(&self, mode: i64, from: i64, to: i64) -> i64 {
            match mode {
                2 | 4 => 4 * (to.div_euclid(4) - from.div_euclid(4)),
                _ => encoder::counts(mode, from, to),
            }
        }
    }
    "counts-up-to-50-kilohertz" {
        fn counts(&self, mode: i64, from: i64, to: i64) -> i64 {
            let edges = encoder::counts(mode, from, to);
            // At 50 kHz, four counts a line, so many pass between two looks.
            if (4000..20_000).contains(&edges.abs()) { 4000 * edges.signum() } else { edges }
        }
    }
    "counts-of-16-bits-on-the-way" {
        fn counts(&self, mode: i64, from: i64, to: i64) -> i64 {
            i64::from(encoder::counts(mode, from, to) as i16)
        }
    }
    "counts-forward-with-z-only" {
        fn counts(&self, mode: i64, from: i64, to: i64) -> i64 {
            let edges = encoder::counts(mode, from, to);
            if matches!(mode, 3 | 4) { edges.max(0) } else { edges }
        }
    }
    "counts-forward-without-z-only" {
        fn counts(&self, mode: i64, from: i64, to: i64) -> i64 {
            let edges = encoder::counts(mode, from, to);
            if matches!(mode, 1 | 2) { edges.max(0) } else { edges }
        }
    }
    "counter-knows-the-direction" {
        fn counts(&self, mode: i64, from: i64, to: i64) -> i64 {
            let edges = encoder::counts(mode, from, to);
            if matches!(mode, 5 | 6) && to < from { -edges } else { edges }
        }
    }
    "counts-x2-from-x4-setup" {
        fn counts(&self, mode: i64, from: i64, to: i64) -> i64 {
            encoder::counts(if mode == 4 { 3 } else { mode }, from, to)
        }
    }
    "preset-unsigned-16-bits-of-low-word" {
        fn preset(&self, high: i64, low: i64) -> i64 { high << 16 | low & 0x7FFF }
    }
    "rate-of-a-second-in-tenths" {
        fn windows(&self, second: i64, tenth: i64) -> (i64, i64) { (second / 10, tenth) }
    }
    "rate-without-direction" {
        fn windows(&self, second: i64, tenth: i64) -> (i64, i64) { (second.abs(), tenth.abs()) }
    }
    "rate-of-100-ms-as-of-a-second" {
        fn windows(&self, second: i64, tenth: i64) -> (i64, i64) { (second, 10 * tenth) }
    }
    "rates-stay-zero" {
        fn windows(&self, _second: i64, _tenth: i64) -> (i64, i64) { (0, 0) }
    }
    "z-not-in-x4" {
        fn sees_index(&self, mode: i64) -> bool { mode == 3 }
    }
    "z-not-in-x2" {
        fn sees_index(&self, mode: i64) -> bool { mode == 4 }
    }
    "diagnosis-with-another-code" {
        fn diagnosis(&self, place: usize) -> Option<Diagnosis> {
            let told = Manual.diagnosis(place);
            told.map(|told| Diagnosis { code: EmcyCode(0x5000), ..told })
        }
    }
    "diagnosis-without-register" {
        fn diagnosis(&self, place: usize) -> Option<Diagnosis> {
            Manual.diagnosis(place).map(|told| Diagnosis { register: 1, ..told })
        }
    }
    "diagnosis-once" {
        fn reports(&self, times: u32) -> bool { times == 1 }
    }
    "diagnosis-of-the-first-input-only" {
        fn diagnosis(&self, place: usize) -> Option<Diagnosis> {
            if place == 0 { Manual.diagnosis(0) } else { None }
        }
    }
    "generic-error-at-power-on" {
        fn announcement(&self) -> Option<Diagnosis> {
            Some(Diagnosis { code: EmcyCode(0x1000), register: 0x01, vendor: [0; 5] })
        }
    }
    "wrong-value-refused-as-read-only" {
        fn refusal(&self) -> Abort { Abort::READ_ONLY }
    }
    "load-clears-the-parameters" {
        fn load_clears(&self) -> bool { true }
    }
    "z-clears-the-count-in-every-setup" {
        fn sees_index(&self, _mode: i64) -> bool { true }
        fn count_at_index(&self, _count: i32) -> i32 { 0 }
    }
    "inputs-show-more" {
        fn input_error(&self) -> f64 { 0.002 }
    }
    "inputs-show-less" {
        fn input_error(&self) -> f64 { -0.002 }
    }
    "output-led-always-lit" {
        fn output_led(&self, _active: bool) -> bool { true }
    }
    "flashes-end-with-a-pause" {
        fn run_pattern(&self, pattern: Pattern) -> Pattern {
            match pattern {
                Pattern::ThreeOn => Pattern::ThreeOnThenPause,
                Pattern::ThreeOff => Pattern::ThreeOffThenPause,
                _ => pattern,
            }
        }
    }
    "diagnosis-of-the-first" {
        fn diagnosis(&self, _place: usize) -> Option<Diagnosis> { Manual.diagnosis(0) }
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
