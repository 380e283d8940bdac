//! Deviations of the controller that override one decision.

pub(super) mod tables;

use canopen::{Abort, Mux};

use super::{Decision, Rules};
use crate::devices::drr460::model::switches::Switches;
use crate::devices::pixsys::led::Pattern;
use crate::stack::Attachment;

/// A controller that takes these parameters for new ones whenever they are written.
fn begins_anew(parameters: &'static [u8]) -> impl Fn(&Rules, u8) -> bool {
    move |rules, sub| !parameters.contains(&sub) && rules.same_parameter_changes_nothing(sub)
}

deviations! {
    pub(super) DEVIATIONS of Decision;

    "fahrenheit-without-32" => degrees: |_, celsius, unit| {
        match unit { 1 => celsius * 1.8, 2 => celsius + 273.15, _ => celsius }
    };
    "offset-before-gain" =>
        calibrated: |_, digits, gain, offset| (digits + offset) * (1.0 + gain / 1000.0);
    "calibrated-in-digits" =>
        calibrated: |rules, digits, gain, offset| rules.calibrated(digits.round(), gain, offset);
    "gain-in-per-cent" =>
        calibrated: |_, digits, gain, offset| digits * (1.0 + gain / 100.0) + offset;
    "error-state-20-ma-is-21-5" =>
        milliamperes: |_, code| match code { 0 => 0.0, 1 => 4.0, _ => 21.5 };
    "output-refused-in-automatic-mode" => output_accepts: |_, manual| manual;
    "unlisted-boot-states-refused" =>
        takes_boot_state: |_, state| matches!(state, 0 | 4 | 5 | 127);
    "terminals-compensated-anywhere" => compensated: |_, terminals| terminals;
    "sensor-selected-again-measures-anew" => same_parameter_changes_nothing: begins_anew(&[1]);
    "tuning-selected-again-ends" => same_parameter_changes_nothing: begins_anew(&[31]);
    "alarms-selected-again-begin-anew" => same_parameter_changes_nothing: begins_anew(&[56, 68]);
    "soft-start-selected-again-ends" => same_parameter_changes_nothing: begins_anew(&[80]);
    "filter-has-older-samples" => kept_samples: |_, wanted| wanted.max(50);
    "last-value-on-an-error" => shows_end: |_, linear, shorted| !linear && !shorted;
    "smallest-band-without-one" => band_without_one: |_| Some(1.0);
    "contact-closed-from-code-1" => closed: |_, code| code > 0;
    "valve-states-swapped" => valve_state: |_, code| if code % 2 == 1 { 1.0 } else { 0.0 };
    "valve-contacts-swapped" => valve_contacts: |_, opens, closes| [closes, opens];
    "stop-state-ignored" =>
        parameter: |_, sub, configured| if matches!(sub, 21 | 60 | 72) { 0 } else { configured };
    "initial-state-not-stored" => starts: |_, initial_state, _| initial_state != 1;
    "command-hysteresis-without-sign" => on_off: |_, hysteresis| (0, hysteresis.abs());
    "delay-sign-swapped" => delay: |_, to_on, delay| if to_on { -delay } else { delay };
    "alarm-delay-without-sign" => parameter: |_, sub, configured| {
        if matches!(sub, 62 | 74) { configured.abs() } else { configured }
    };
    // As in a signed number of 16 bits, and in an unsigned one of 50 ms each.
    "alarm-delays-in-signed-tenths" => parameter: |_, sub, configured| match sub {
        62 | 74 if configured.abs() > 3276 => 0,
        _ => configured,
    };
    "current-delay-in-16-bits" => parameter: |_, sub, configured| match sub {
        94 => configured * 20 % 0x1_0000 / 20,
        _ => configured,
    };
    "soft-start-in-16-bits" => parameter: |_, sub, configured| match sub {
        84 => configured * 60 % 0x1_0000 / 60,
        _ => configured,
    };
    "alarm-delay-ignored" =>
        parameter: |_, sub, configured| if matches!(sub, 62 | 74) { 0 } else { configured };
    "delay-of-a-closed-contact-turned-round" =>
        alarm_delay: |_, delay, closed| if closed { -delay } else { delay };
    "delay-of-the-end-not-for-closed-contacts" =>
        alarm_delay: |_, delay, closed| if closed { delay.max(0.0) } else { delay };
    "alarm-2-cools-in-the-cycle-of-heating" => cools_in_the_cycle_of_heating: |_, alarm| alarm == 1;
    "repair-not-seen-in-stop" => repair_is_seen: |_, running, _| running;
    "repair-not-seen-in-manual-mode" => repair_is_seen: |_, _, manual| !manual;
    "gain-between-halves" =>
        calibrated: |rules, digits, gain, offset| {
            rules.calibrated(digits, gain.clamp(-500.0, 500.0), offset)
        };
    "offset-between-halves" =>
        calibrated: |rules, digits, gain, offset| {
            rules.calibrated(digits, gain, offset.clamp(-5000.0, 5000.0))
        };
    "delay-both-ways" => delay: |_, _, delay| delay.abs();
    "reset-kept-without-storing" => kept_over_power_off: |_, reset| reset != 0;
    "resettable-while-it-lasts" => resettable: |_, latched, _| latched;
    "manual-without-permission" => manual: |_, _, asked| asked;
    "break-leads-to-manual-without-memory" => break_leads_to_manual: |_, allowed| allowed != 0;
    "alarms-without-process-know-no-errors" =>
        alarm_knows_errors: |_, kind| matches!(kind, 1..=5);
    "any-error-is-a-break" => is_break: |_, broken, error| broken || error;
    "manual-kept-without-memory" => manual_kept: |_, allowed| allowed != 0;
    "output-limits-ignored" =>
        parameter: |_, sub, configured| match sub { 45 => 0, 46 => 100, _ => configured };
    "dead-band-on-one-side" =>
        in_dead_band: |_, missing, dead_band| (0..=dead_band).contains(&missing);
    "off-over-below" => is_over: |_, over, threshold| over > -threshold;
    "cooling-band-divided" => cooling_band: |_, band, multiplier| band / multiplier;
    "double-loop-centred" => centred: |_, configured, _| configured;
    "oil-taken-for-air" => fluid: |_, fluid| if fluid == 2 { (250, 2) } else { (100, 10) };
    "cycle-begins-open" =>
        in_share: |_, at, share, period| share >= 1.0 || at >= (1.0 - share) * period;
    "alarm-2-kind-of-alarm-1" =>
        alarm_parameter: |_, alarm, offset| if offset == 0 { 56 } else { [56, 68][alarm] + offset };
    "alarm-2-contact-of-alarm-1" =>
        alarm_parameter: |_, alarm, offset| if offset == 1 { 57 } else { [56, 68][alarm] + offset };
    "alarm-2-hysteresis-of-alarm-1" =>
        alarm_parameter: |_, alarm, offset| if offset == 2 { 58 } else { [56, 68][alarm] + offset };
    "alarm-2-error-state-of-alarm-1" =>
        alarm_parameter: |_, alarm, offset| if offset == 3 { 59 } else { [56, 68][alarm] + offset };
    "alarm-2-stop-state-of-alarm-1" =>
        alarm_parameter: |_, alarm, offset| if offset == 4 { 60 } else { [56, 68][alarm] + offset };
    "alarm-2-reset-of-alarm-1" =>
        alarm_parameter: |_, alarm, offset| if offset == 5 { 61 } else { [56, 68][alarm] + offset };
    "alarm-2-delay-of-alarm-1" =>
        alarm_parameter: |_, alarm, offset| if offset == 6 { 62 } else { [56, 68][alarm] + offset };
    "alarm-off-is-above" => parameter: |_, sub, configured| {
        if matches!(sub, 56 | 68) { configured.max(1) } else { configured }
    };
    "alarm-below-is-above" => parameter: |_, sub, configured| {
        if matches!((sub, configured), (56 | 68, 2)) { 1 } else { configured }
    };
    "alarm-of-set-point-looks-at-process" => parameter: |_, sub, configured| {
        match (sub, configured) { (56 | 68, 6 | 7) => configured - 5, _ => configured }
    };
    "alarms-share-a-set-point" => alarm_set_point: |_, _| Mux::new(0x4001, 0);
    "deviation-is-absolute" => deviation: |_, process, _| process;
    "alarm-ignores-hysteresis" => second_threshold: |_, first, _| first;
    "short-circuit-from-the-threshold" => is_short: |_, amperes, threshold| amperes >= threshold;
    "current-from-a-tenth-of-an-ampere" => is_no_current: |_, amperes, _| amperes < 1.0;
    "virtual-zero-within-the-limits" => virtual_zero: |_, share| share.clamp(0.0, 1.0);
    "alarm-begins-beyond-its-threshold" => alarm_begins: |_, beyond| beyond > 0;
    "alarm-ends-at-its-threshold" => alarm_lasts: |_, beyond| beyond > 0;
    "alarm-hysteresis-without-sign" =>
        second_threshold: |_, first, hysteresis| first + hysteresis.abs();
    "lower-deviation-not-negated" => lower_deviation: |_, alarm_set_point| alarm_set_point;
    "band-alarm-one-sided" => band: |_, deviation| deviation;
    "remote-alarm-is-bit-1" => remote_alarm: |_, value| value & 2 != 0;
    "tuning-on-one-side" => gap_asks_for_tuning: |_, gap, greatest| gap > greatest;
    "tuning-deviation-added" => tuning_deviation: |_, configured| -configured;
    "tuning-written-while-automatic" => tuning_accepts: |_, kind, _, value| {
        if value > 3 || kind == 2 && value > 1 { Err(Abort::VALUE) } else { Ok(()) }
    };
    "soft-start-once-a-power-on" => soft_starts: |_, since_power_on| !since_power_on;
    "gradient-per-minute" => gradient: |_, digits| digits as f64 / 60.0;
    "soft-start-in-seconds" => minutes: |_, configured| configured as f64;
    "transformer-of-100-ma" => tenths_of_amperes: |_, milliamperes, full_scale| {
        milliamperes / 100.0 * full_scale as f64 * 10.0
    };
    "over-current-without-delay" =>
        current_delay: |_, fault, delay| if fault == 3 { 0.0 } else { delay };
    "over-current-without-alarm" => current_alarm: |_, faults| faults[..3].contains(&true);
    "short-circuit-without-alarm" => current_alarm: |_, faults| faults[1..].contains(&true);
    "whole-current-taught" => taught: |_, current| current * 2.0;
    "retransmission-beyond-its-range" => share: |_, value, low, high| {
        if high == low { 0.0 } else { ((value - low) / (high - low)).max(0.0) }
    };
    "live-zero-ignored" => microamperes: |_, share, _| 20_000.0 * share;
    "expansion-without-input" => shows_process: |_, expansion| !expansion;
    "scale-never-turned" => limits: |_, low, high| (low.min(high), high.max(low));
    "wiring-waits-for-writing" => waits_for_writing: |_, sub| sub == 16;
    "stored-input-waits-for-writing" => waits_for_writing: |_, sub| matches!(sub, 1..=10);
    "stored-delay-waits-for-writing" => waits_for_writing: |_, sub| matches!(sub, 23);
    "stored-band-waits-for-writing" => waits_for_writing: |_, sub| matches!(sub, 33);
    "stored-limit-waits-for-writing" => waits_for_writing: |_, sub| matches!(sub, 46);
    "stored-alarm-1-waits-for-writing" => waits_for_writing: |_, sub| matches!(sub, 56..=62);
    "stored-alarm-2-waits-for-writing" => waits_for_writing: |_, sub| matches!(sub, 68..=74);
    "stored-current-waits-for-writing" => waits_for_writing: |_, sub| matches!(sub, 90..=94);
    "stored-off-line-time-waits-for-writing" => waits_for_writing: |_, sub| matches!(sub, 115);
    "stored-analogue-range-waits-for-writing" =>
        waits_for_writing: |_, sub| matches!(sub, 125..=127);
    "retransmission-waits-for-writing" => waits_for_writing: |_, sub| sub == 100;
    "band-of-ten-degrees-at-least" => parameter: |_, sub, configured| {
        if sub == 33 && configured > 0 { configured.max(100) } else { configured }
    };
    "error-outputs-as-a-whole" =>
        commutes: |_, outputs, mask, values| if mask == 0 { outputs } else { values };
    "off-line-time-in-seconds" => offline_time: |_, configured| configured as f64;
    "reading-is-silence" => ends_silence: |_, reads| !reads;
    "flags-of-the-load-shifted" =>
        flag: |_, bit| if (7..=10).contains(&bit) { bit + 1 } else { bit };
    "flags-of-the-memory-shifted" => flag: |_, bit| if bit >= 16 { bit - 1 } else { bit };
    "outputs-status-swapped" => outputs_status: |_, q1, q2| i64::from(q2) | i64::from(q1) << 1;
    "address-parameter-first" => attachment: |_, switches, own, _| {
        let (address, _) = own;
        let node = Switches { address: 0, ..switches }.node(address);
        node.or_else(|| switches.node(address)).map_or(Attachment::Off, Attachment::Node)
    };
    "address-parameter-or-switches" => attachment: |_, switches, own, _| {
        let (address, _) = own;
        let set = Switches { address: 0, ..switches }.node(address).unwrap_or(0);
        let node = Switches { address: switches.address | set, ..switches }.node(address);
        node.map_or(Attachment::Off, Attachment::Node)
    };
    "run-led-without-emergency" => run_led: |_, pattern| match pattern {
        Pattern::Medium => Pattern::Slow,
        Pattern::ThreeOn => Pattern::SteadyOn,
        Pattern::ThreeOff => Pattern::OneOff,
        other => other,
    };
    "loading-shown-in-operation" => shows_loading: |_, loading, closed| loading || closed;
    "run-led-dark-while-loading" => loading_leds: |_, [_, first, second]| {
        [Pattern::SteadyOff, first, second]
    };
    "output-leds-dark-while-loading" => loading_leds: |_, [run, ..]| {
        [run, Pattern::SteadyOff, Pattern::SteadyOff]
    };
    "error-leds-blink-together" => error_leds: |_, alternate| { [alternate[0]; 2] };
    "thermoresistance-with-terminals" => wires: |_, terminals| terminals - 25.0;
    "unit-of-linear-inputs" =>
        linear: |_, digits, unit| if unit == 1 { digits * 1.8 + 320.0 } else { digits };
    "limits-of-temperatures" => temperature: |_, digits, limits| {
        let (low, high) = limits;
        digits.clamp(low.min(high), high.max(low))
    };
    "alarms-rest-in-manual-mode" => alarms_work: |_, manual| !manual;
    "integral-without-band-is-on-off" => is_on_off: |_, band, _| band == 0;
    "soft-start-not-at-power-on" => soft_starts: |_, since_power_on| since_power_on;
    "off-line-by-default" =>
        offline_time: |_, configured| if configured == 0 { 0.2 } else { configured as f64 / 10.0 };
    "expansion-outputs-swapped" => driven: |_, outputs| outputs >> 1 & 1 | (outputs & 1) << 1;
    "output-leds-swapped" => output_leds: |_, outputs| [outputs[1], outputs[0]];
    "fluid-presets-no-cycle" =>
        fluid: |_, fluid| match fluid { 1 => (125, 10), 2 => (250, 10), _ => (100, 10) };
    "cycle-never-whole" => cycle_share: |_, share| share.min(0.9);
    "potentiometer-by-its-wiper" => track: |_, _, configured| configured;
    "command-hysteresis-beyond-the-set-point" =>
        on_off: |_, hysteresis| (-hysteresis.max(0), -hysteresis.min(0));
    "dead-band-subtracted" =>
        beyond_dead_band: |_, missing, dead_band| missing - dead_band * missing.signum();
    "overlap-by-halves" => overlap: |_, overlap| (overlap / 2.0, overlap / 2.0);
    "alarm-of-set-point-looks-at-4000h" => looked_at: |_, _, wanted| wanted;
    "tuning-without-limits" => tuning_limits: |_, _, _| ((1.0, f64::from(i16::MAX)), 0.0);
    "whole-current-is-the-threshold" => taught: |_, current| current;
    "retransmission-to-21.5-ma" => share: |_, value, low, high| {
        if high == low { 0.0 } else { ((value - low) / (high - low)).clamp(0.0, 1.075) }
    };
    "retransmission-limits-in-degrees" => retransmission_limit: |_, limit, is_temperature| {
        limit as f64 * if is_temperature { 10.0 } else { 1.0 }
    };
    "every-flag-is-an-error" => errors: |_, without_process| without_process | !(0xF << 7);
    "error-state-of-on-off-only" => errors_concern: |_, proportional| !proportional;
}
