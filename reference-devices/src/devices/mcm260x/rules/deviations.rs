//! Deviations of the module that override one decision.

use canopen::emcy::EmcyCode;
use canopen::{Mux, NmtState};

use super::super::encoder;
use super::super::indicators::{Pattern, Phase};
use super::super::parameters::{Item, SMALL_FREQUENCY};
use super::super::sensor::Wiring;
use super::{Decision, Diagnosis, Mcm260xRules};
use crate::devices::pixsys::emergency::Module;

/// A module that takes one code of a parameter for another one.
fn taken_for(item: Item, from: i64, to: i64) -> impl Fn(&Mcm260xRules, Item, i64) -> i64 {
    move |rules, of, configured| {
        let configured = rules.parameter(of, configured);
        if of == item && configured == from { to } else { configured }
    }
}

/// A module of which a parameter has always the same value.
fn fixed(item: Item, value: i64) -> impl Fn(&Mcm260xRules, Item, i64) -> i64 {
    move |rules, of, configured| if of == item { value } else { rules.parameter(of, configured) }
}

deviations! {
    pub(super) OF_PARAMETERS of Decision;

    "samples-at-10-hertz" => parameter: taken_for(Item::Frequency, SMALL_FREQUENCY, 3);
    "tc-k-taken-for-tc-s" => parameter: taken_for(Item::SensorType, 1, 2);
    "tc-s-taken-for-tc-j" => parameter: taken_for(Item::SensorType, 2, 4);
    "tc-r-taken-for-tc-j" => parameter: taken_for(Item::SensorType, 3, 4);
    "tc-j-taken-for-tc-t" => parameter: taken_for(Item::SensorType, 4, 5);
    "tc-t-taken-for-tc-b" => parameter: taken_for(Item::SensorType, 5, 8);
    "tc-e-taken-for-tc-t" => parameter: taken_for(Item::SensorType, 6, 5);
    "tc-n-taken-for-tc-e" => parameter: taken_for(Item::SensorType, 7, 6);
    "tc-b-taken-for-tc-n" => parameter: taken_for(Item::SensorType, 8, 7);
    "pt100-taken-for-ni100" => parameter: taken_for(Item::SensorType, 9, 10);
    "ni100-taken-for-ntc" => parameter: taken_for(Item::SensorType, 10, 11);
    "ntc-taken-for-tc-b" => parameter: taken_for(Item::SensorType, 11, 8);
    "ptc-taken-for-ntc" => parameter: taken_for(Item::SensorType, 12, 11);
    "pt500-taken-for-ptc" => parameter: taken_for(Item::SensorType, 13, 12);
    "pt1000-taken-for-ptc" => parameter: taken_for(Item::SensorType, 14, 12);
    "1-volt-taken-for-5-volts" => parameter: taken_for(Item::SensorType, 15, 16);
    "5-volts-taken-for-10-volts" => parameter: taken_for(Item::SensorType, 16, 17);
    "10-volts-taken-for-5-volts" => parameter: taken_for(Item::SensorType, 17, 16);
    "0-to-20-milliamperes-taken-for-4-to-20" => parameter: taken_for(Item::SensorType, 18, 19);
    "4-to-20-milliamperes-taken-for-0-to-20" => parameter: taken_for(Item::SensorType, 19, 18);
    "60-millivolts-taken-for-1-volt" => parameter: taken_for(Item::SensorType, 20, 15);
    "potentiometer-taken-for-60-millivolts" => parameter: taken_for(Item::SensorType, 21, 20);
    "disabled-input-taken-for-pt100" => parameter: taken_for(Item::SensorType, 0, 9);
    "fahrenheit-taken-for-kelvin" => parameter: taken_for(Item::Degree, 1, 2);
    "kelvin-taken-for-fahrenheit" => parameter: taken_for(Item::Degree, 2, 1);
    "x2-taken-for-x4" => parameter: taken_for(Item::EncoderSetup, 1, 2);
    "x4-taken-for-x2" => parameter: taken_for(Item::EncoderSetup, 2, 1);
    "x2-with-z-taken-for-x4" => parameter: taken_for(Item::EncoderSetup, 3, 4);
    "x4-with-z-taken-for-x2" => parameter: taken_for(Item::EncoderSetup, 4, 3);
    "x2-with-z-taken-for-x2" => parameter: taken_for(Item::EncoderSetup, 3, 1);
    "x4-with-z-taken-for-x4" => parameter: taken_for(Item::EncoderSetup, 4, 2);
    "counter-up-taken-for-down" => parameter: taken_for(Item::EncoderSetup, 5, 6);
    "counter-down-taken-for-up" => parameter: taken_for(Item::EncoderSetup, 6, 5);
    "disabled-encoder-taken-for-x4" => parameter: taken_for(Item::EncoderSetup, 0, 2);

    "interface-ignored" => parameter: fixed(Item::Interface, 0);
    "address-ignored" => parameter: fixed(Item::Address, 0);
    "offline-outputs-ignored" => parameter: fixed(Item::OfflineOutputs, 0);
    "encoder-setup-always-x4" => parameter: fixed(Item::EncoderSetup, 2);
    "sensor-type-always-volts" => parameter: fixed(Item::SensorType, 17);
    "degree-ignored" => parameter: fixed(Item::Degree, 0);
    "lower-limit-of-input-ignored" => parameter: fixed(Item::LowerLimit, 0);
    "upper-limit-of-input-ignored" => parameter: fixed(Item::UpperLimit, 1000);
    "potentiometer-always-10-kilohms" => parameter: fixed(Item::Potentiometer, 10);
    "limits-may-be-left" => parameter: fixed(Item::BeyondLimits, 1);
    "limits-always-hold" => parameter: fixed(Item::BeyondLimits, 0);
    "input-offset-ignored" => parameter: fixed(Item::Offset, 0);
    "input-gain-ignored" => parameter: fixed(Item::Gain, 0);
    "average-of-one-sample" => parameter: fixed(Item::Filter, 1);
    "average-of-fifty-samples" => parameter: fixed(Item::Filter, 50);
    "frequency-ignored" => parameter: fixed(Item::Frequency, 5);
    "every-sample-accepted" => parameter: fixed(Item::MaximumDifference, i64::MAX);
    "no-sample-accepted-late" => parameter: fixed(Item::MaximumRejection, 1_000_000);
    "output-always-volts" => parameter: fixed(Item::OutputType, 0);
    "lower-limit-of-output-ignored" => parameter: fixed(Item::OutputLower, 0);
    "upper-limit-of-output-ignored" => parameter: fixed(Item::OutputUpper, 1000);
    "sensor-type-always-pt100" => parameter: fixed(Item::SensorType, 9);
    "sensor-type-always-5-volts" => parameter: fixed(Item::SensorType, 16);
    "sensor-type-always-4-to-20-milliamperes" => parameter: fixed(Item::SensorType, 19);
    "sensor-always-off" => parameter: fixed(Item::SensorType, 0);
    "degree-always-kelvin" => parameter: fixed(Item::Degree, 2);
    "potentiometer-always-100-kilohms" => parameter: fixed(Item::Potentiometer, 100);
    "every-change-rejected" => parameter: fixed(Item::MaximumDifference, 0);
    "nothing-rejected" => parameter: fixed(Item::MaximumRejection, 0);
    "output-always-milliamperes" => parameter: fixed(Item::OutputType, 1);
    "offline-outputs-always-on" => parameter: fixed(Item::OfflineOutputs, -1);
    "frequency-always-fastest" => parameter: fixed(Item::Frequency, 13);
    "encoder-setup-always-x2" => parameter: fixed(Item::EncoderSetup, 1);
    "encoder-setup-always-up" => parameter: fixed(Item::EncoderSetup, 5);
    "encoder-always-off" => parameter: fixed(Item::EncoderSetup, 0);
}

deviations! {
    pub(super) DEVIATIONS of Decision;

    "average-has-older-samples" => kept_samples: |_, wanted| wanted.max(50);
    "low-word-with-sign" => joined_words: |_, high, low| (high << 16) + low;
    "first-board-always-known" =>
        board_differs: |_, board, stored| board == Module::Other && board.differs(stored);
    "fourth-preset-in-the-third" => preset_place: |_, place| place.min(2);
    "loads-when-it-looks" => loaded_at: |_, _, to| to;
    "second-of-the-last-tenth" => windows: |_, _, tenth| (tenth * 10, tenth);
    "counter-down-knows-the-direction" => counts: |_, mode, from, to| {
        let counts = encoder::counts(mode, from, to);
        if mode == 6 && to < from { -counts } else { counts }
    };
    "low-supply-hides-the-inputs" =>
        flags: |_, _, now| if now & 0x0800 != 0 { now & 0x0FFF } else { now };
    "error-of-the-first-input-ends-only" => ends: |_, place| place == 0;
    "lower-limit-may-be-left" => within_limits: |_, share| share.min(1.0);
    "falls-are-always-near" => is_near: |_, difference, near| difference <= near;
    "gain-ends-at-a-tenth" => calibrated: |_, digits, gain, offset| {
        digits * (1.0 + gain.clamp(-100.0, 100.0) / 1000.0) + offset
    };
    "second-error-mode-not-mirrored" => mirrors: |_, written| written != Mux::new(0x6443, 2);
    "counts-every-second-edge" => counts: |_, mode, from, to| {
        encoder::counts(if mode % 2 == 0 { mode - 1 } else { mode }, from, to)
    };
    "counts-without-direction" => counts: |_, mode, from, to| encoder::counts(mode, from, to).abs();
    "b-before-a-is-forward" => counts: |_, mode, from, to| {
        let counts = encoder::counts(mode, from, to);
        if mode < 5 { -counts } else { counts }
    };
    "count-ends-at-its-limits" => count: |_, count, counts| {
        (i64::from(count) + counts).clamp(i32::MIN.into(), i32::MAX.into()) as i32
    };
    "count-outlives-power-off" => count_at_start: |_, last| last;
    "load-is-counted" => counted_by_loading: |_, step| step;
    "boot-up-is-no-state" => takes_boot_state: |_, state| matches!(state, 4 | 5 | 127);
    "counts-backwards" => counts: |_, mode, from, to| -encoder::counts(mode, from, to);
    "counts-while-off" =>
        counts: |_, mode, from, to| encoder::counts(if mode == 0 { 2 } else { mode }, from, to);
    "counter-counts-up-only" =>
        counts: |_, mode, from, to| encoder::counts(if mode == 6 { 5 } else { mode }, from, to);
    "counter-counts-both-edges" => counts: |_, mode, from, to| match mode {
        5 | 6 => 2 * encoder::counts(mode, from, to),
        _ => encoder::counts(mode, from, to),
    };
    "preset-loaded-by-any-command" => loads_now: |_, command| command != 0;
    "command-stays" => command_left: |_, command, _| command;
    "windows-swapped" => windows: |_, second, tenth| (tenth, second);
    "preset-of-16-bits" => preset: |_, _, low| low as i16 as i64;
    "preset-words-swapped" => preset: |_, high, low| low << 16 | high & 0xFFFF;
    "channel-flags-from-bit-11" => channel_flag: |_, place| 1 << (11 + place);
    "outputs-without-supply" => energised: |_, levels, _| levels;
    "boot-up-as-pre-operational" => run_led: |_, phase| match phase {
        Phase::BootUp => Phase::Node(NmtState::PRE_OPERATIONAL, false),
        _ => phase,
    };
    "pre-operational-as-operational" => run_led: |_, phase| match phase {
        Phase::Node(NmtState::PRE_OPERATIONAL, error) => {
            Phase::Node(NmtState::OPERATIONAL, error)
        }
        _ => phase,
    };
    "stopped-as-pre-operational" => run_led: |_, phase| match phase {
        Phase::Node(NmtState::STOPPED, error) => {
            Phase::Node(NmtState::PRE_OPERATIONAL, error)
        }
        _ => phase,
    };
    "operational-as-pre-operational" => run_led: |_, phase| match phase {
        Phase::Node(NmtState::OPERATIONAL, error) => {
            Phase::Node(NmtState::PRE_OPERATIONAL, error)
        }
        _ => phase,
    };
    "led-dark-with-modbus" => run_led: |_, phase| match phase {
        Phase::Modbus(_) => Phase::Dark,
        _ => phase,
    };
    "same-led-for-every-error" => run_led: |_, phase| match phase {
        Phase::Node(_, true) => Phase::Node(NmtState::PRE_OPERATIONAL, true),
        _ => phase,
    };
    "level-leds-of-outputs-only" => level_leds: |_, _, outputs| outputs;
    "level-leds-of-inputs-only" => level_leds: |_, inputs, _| inputs;
    "level-leds-from-the-other-end" =>
        level_leds: |_, inputs, outputs| i64::from(((inputs | outputs) as u8).reverse_bits());
    "input-led-while-disabled" => input_led: |_, _, out_of_range| (false, out_of_range);
    "input-led-without-errors" => input_led: |_, off, _| (off, false);
    "inputs-on-from-12-volts" => input_level: |_, millivolts| Some(millivolts >= 12_000.0);
    "inputs-on-from-2-volts" => input_level: |_, millivolts| Some(millivolts >= 2000.0);
    "encoders-1-and-2-swapped" => encoder_at: |_, place| if place < 2 { 1 - place } else { place };
    "encoder-3-at-encoder-2" => encoder_at: |_, place| place.min(1);
    "analogue-inputs-swapped" => analogue_at: |_, place| 1 - place;
    "fault-flags-moved" => fault_flag: |_, bit| bit ^ 1;
    "terminal-flags-moved" => terminal_flag: |_, bit| (bit + 1) % 3;
    "display-never-dark" => displayed: |_, flags| if flags == 0 { 1 } else { flags };
    "display-counts-from-0" => displayed: |_, flags| flags >> 1;
    "flags-stay" => flags: |_, before, now| before | now;
    "flag-of-the-configuration-always" => flags: |_, _, now| now | 1;
    "only-one-flag-at-a-time" => flags: |_, _, now| now & -now;
    "supply-low-below-12-volts" => supply_is_low: |_, volts| volts < 12.0;
    "supply-low-below-9-volts" => supply_is_low: |_, volts| volts < 9.0;
    "supply-of-the-first-block-only" => group: |_, block, _| block;
    "analogue-outputs-swapped" => output: |_, place| 1 - place.min(1);
    "output-of-ten-bits" => share: |_, digits, _, _| digits as f64 / 1023.0;
    "output-off-beyond-its-limits" => share: |rules, digits, lower, upper| {
        let share = rules.share(digits, lower, upper);
        if share > 1.0 { 0.0 } else { share }
    };
    "output-full-below-its-limits" => share: |rules, digits, lower, upper| {
        let share = rules.share(digits, lower, upper);
        if share < 0.0 { 1.0 } else { share }
    };
    "output-without-falling-scale" =>
        share: |rules, digits, lower, upper| {
            rules.share(digits, lower.min(upper), lower.max(upper))
        };
    "preset-words-shown-swapped" =>
        preset_words: |_, preset| (i64::from(preset as i16), preset >> 16);
    "preset-high-word-without-sign" =>
        preset_words: |_, preset| (preset >> 16 & 0x7FFF, i64::from(preset as i16));
    "what-is-loaded-counts-back" => counted_by_loading: |_, step| -step;
    "counts-in-operational-only" => counts_in: |_, state| state == NmtState::OPERATIONAL;
    "counts-not-in-stopped" => counts_in: |_, state| state != NmtState::STOPPED;
    "off-line-time-on-can" => works_with_modbus: |_, _| true;
    "off-line-time-on-can" => silent_since: |_, start, heard| heard.unwrap_or(start);
    "unit-of-linear-signals" =>
        linear_digits: |_, digits, degree| if degree == 0 { digits } else { digits * 1.8 + 320.0 };
    "offset-before-gain" =>
        calibrated: |_, digits, gain, offset| (digits + offset) * (1.0 + gain / 1000.0);
    "gain-in-hundredths" =>
        calibrated: |_, digits, gain, offset| digits * (1.0 + gain / 100.0) + offset;
    "gain-of-whole-percent" => calibrated: |rules, digits, gain, offset| {
        rules.calibrated(digits, (gain / 10.0).trunc() * 10.0, offset)
    };
    "span-of-16-bits" => span: |_, lower, upper| i64::from((upper - lower) as i16);
    "gain-raises-only" =>
        calibrated: |rules, digits, gain, offset| rules.calibrated(digits, gain.max(0.0), offset);
    "offset-subtracted" =>
        calibrated: |rules, digits, gain, offset| rules.calibrated(digits, gain, -offset);
    "offset-of-zero-below-zero" =>
        calibrated: |rules, digits, gain, offset| rules.calibrated(digits, gain, offset.max(0.0));
    "never-below-zero" =>
        calibrated: |rules, digits, gain, offset| rules.calibrated(digits, gain, offset).max(0.0);
    "junction-without-compensation" => junction_error: |_, terminals| terminals - 25.0;
    "broken-wire-unnoticed" =>
        wires: |_, _, wiring| if wiring == Wiring::Broken { Wiring::Connected } else { wiring };
    "broken-thermocouple-unnoticed" =>
        wires: |_, sensor, wiring| if sensor <= 8 { Wiring::Connected } else { wiring };
    "short-circuit-unnoticed" =>
        wires: |_, _, wiring| if wiring == Wiring::Shorted { Wiring::Connected } else { wiring };
    "filter-loses-a-part" => average: |_, sum, samples| sum / (samples as f64 + 0.5);
    "whole-degrees-only" => average: |_, sum, samples| (sum / samples as f64 / 10.0).trunc() * 10.0;
    "counts-whole-lines" => counts: |_, mode, from, to| match mode {
        2 | 4 => 4 * (to.div_euclid(4) - from.div_euclid(4)),
        _ => encoder::counts(mode, from, to),
    };
    "counts-up-to-50-kilohertz" => counts: |_, mode, from, to| {
        let edges = encoder::counts(mode, from, to);
        // This many counts pass between two looks at 50 kHz, with four counts a line.
        if (4000..20_000).contains(&edges.abs()) { 4000 * edges.signum() } else { edges }
    };
    "counts-of-16-bits-on-the-way" =>
        counts: |_, mode, from, to| i64::from(encoder::counts(mode, from, to) as i16);
    "counts-forward-with-z-only" => counts: |_, mode, from, to| {
        let edges = encoder::counts(mode, from, to);
        if matches!(mode, 3 | 4) { edges.max(0) } else { edges }
    };
    "counts-forward-without-z-only" => counts: |_, mode, from, to| {
        let edges = encoder::counts(mode, from, to);
        if matches!(mode, 1 | 2) { edges.max(0) } else { edges }
    };
    "counter-knows-the-direction" => counts: |_, mode, from, to| {
        let edges = encoder::counts(mode, from, to);
        if matches!(mode, 5 | 6) && to < from { -edges } else { edges }
    };
    "counts-x2-from-x4-setup" =>
        counts: |_, mode, from, to| encoder::counts(if mode == 4 { 3 } else { mode }, from, to);
    "preset-unsigned-16-bits-of-low-word" => preset: |_, high, low| high << 16 | low & 0x7FFF;
    "rate-of-a-second-in-tenths" => windows: |_, second, tenth| (second / 10, tenth);
    "rate-without-direction" => windows: |_, second, tenth| (second.abs(), tenth.abs());
    "rate-of-100-ms-as-of-a-second" => windows: |_, second, tenth| (second, 10 * tenth);
    "rates-stay-zero" => windows: |_, _, _| (0, 0);
    "z-not-in-x4" => sees_index: |_, mode| mode == 3;
    "z-not-in-x2" => sees_index: |_, mode| mode == 4;
    "diagnosis-once" => reports: |_, times| times == 1;
    "diagnosis-of-the-first-input-only" =>
        diagnosis: |rules, place| if place == 0 { rules.diagnosis(0) } else { None };
    "generic-error-at-power-on" => announcement: |_| {
        Some(Diagnosis { code: EmcyCode(0x1000), register: 0x01, vendor: [0; 5] })
    };
    "z-clears-the-count-in-every-setup" => sees_index: |_, _| true;
    "z-clears-the-count-in-every-setup" => count_at_index: |_, _| 0;
    "flashes-end-with-a-pause" => run_pattern: |_, pattern| match pattern {
        Pattern::ThreeOn => Pattern::ThreeOnThenPause,
        Pattern::ThreeOff => Pattern::ThreeOffThenPause,
        _ => pattern,
    };
}
