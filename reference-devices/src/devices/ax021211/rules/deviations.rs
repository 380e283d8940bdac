//! Deviations of the controller that override one decision.

use std::time::Duration;

use canopen::Abort;

use super::super::limits;
use super::super::load::Stage;
use super::super::logic::{self, Verdict};
use super::super::math;
use super::super::objects::{
    HOLD_CURRENT, HOTSHOT_CURRENT, OUTPUT_FREQUENCY, PID_INTEGRAL_TIME, table_of,
};
use super::super::output::{self, Command, Disabled, Interventions, Kind};
use super::super::pid::{self, Gains};
use super::super::ramp::Ramp;
use super::super::signal::{Signal, share};
use super::super::table::POINTS;
use super::Decision;

deviations! {
    pub(super) DEVIATIONS of Decision;

    "half-is-on" => is_on: |_, signal| signal.value >= 50.0;
    "write-states-reversed" => write_state: |_, states, place| states >> (9 - place) & 1 != 0;
    "write-states-of-first-bit" => write_state: |_, states, _| states & 1 != 0;
    "received-when-invalid" => takes_received: |_, status| status == 0;
    "channel-counted-from-0" => channel: |_, place| place as u8;
    "supply-errors-swapped" => supply_errors: |_, volts| (volts > 60.0, volts < 9.0);
    "banks-of-five" => bank: |_, place| place / 5;
    "each-output-has-a-timer" => bank: |_, place| place;
    "current-leaves-frequency" => frequency: |_, configured, _| configured;
    "ramp-taken-for-jump" => point_response: |_, code| code.max(2 * u8::from(code == 1));
    "jump-taken-for-ramp" => point_response: |_, code| code.min(1);
    "ignore-taken-for-ramp" => point_response: |_, code| code.max(1);
    "ignored-points-out-of-limits" => points_of_limits: |_, in_use| in_use;
    "table-limits-always-percentage" => table_limits: |_, _, _| (0.0, 100.0);
    "table-limits-always-ends" => table_limits: |_, low, high| (low, high);
    "table-limits-of-table-6" => table_limits: |_, low, high| (low.min(0.0), high.max(100.0));
    "ignored-point-alone" => points_in_use: |_, _| POINTS;
    "jump-is-late" => jump: |_, from, _| from;
    "time-points-are-absolute" => interval: |_, before, point| point - before;
    "profile-holds-when-off" => sequence_off: |_, held| held;
    "pid-times-tenfold" => pid_time: |_, seconds| seconds * 10.0;
    "pid-without-feedback" => pid_is_enabled: |_, both, links| both || links[0].is_used();
    "pid-error-reversed" => pid_error: |_, target, feedback| feedback - target;
    "pid-tolerance-inclusive" => is_tolerated: |_, difference, tolerance| difference <= tolerance;
    "pid-integral-without-ti" => pid_gains: |_, gains, cycle| {
        let gains = Gains { integral_time: 1.0, ..gains };
        gains.of_cycle(cycle)
    };
    "pid-derivative-without-td" => pid_gains: |_, gains, cycle| {
        let gains = Gains { derivative_time: 0.0, ..gains };
        gains.of_cycle(cycle)
    };
    "pid-gain-is-proportional-only" => pid_gains: |_, gains, cycle| {
        let rest = Gains { proportional: 1.0, ..gains }.of_cycle(cycle);
        (gains.proportional, rest.1, rest.2)
    };
    "pid-sum-forgets" => error_sum: |_, _, error| error;
    "pid-step-of-error" => error_step: |_, error, _| error;
    "pid-output-is-absolute" => pid_output: |_, _, output, _| output.abs().min(100.0);
    "pid-target-is-percentage" => target_limits: |_, own, _| own.unwrap_or((0.0, 100.0));
    "math-gain-in-tenths" => gain: |_, configured| configured as f64 / 10.0;
    "math-function-of-one-input" => function_counts: |_, inputs| inputs[0] || inputs[1];
    "math-inputs-swapped" => function_inputs: |_, inputs| [inputs[1], inputs[0]];
    "math-truth-above-half" => math_result: |_, operator, a, b| {
        let less = if (6..=11).contains(&operator) { 1e-9 } else { 0.0 };
        math::operate(operator, a - less, b - less)
    };
    "math-division-by-zero-saturates" => math_result: |_, operator, a, b| {
        if operator == 15 && b == 0.0 { 1.0 } else { math::operate(operator, a, b) }
    };
    "math-first-function-is-result" => block_result: |_, before, result| before.or(Some(result));
    "math-does-not-saturate" => saturated: |_, part| part;
    "math-error-counts-as-value" => math_input_in_error: |_, value, _| value;
    "math-error-is-zero-of-the-source" => math_input_in_error: |_, _, of_zero| of_zero;
    "math-gain-is-added" => math_input: |_, part, gain| part + gain - 1.0;
    "logic-last-table-wins" =>
        selection: |_, selects| selects.iter().rposition(|selects| *selects).unwrap_or(0);
    "logic-default-is-table-c" =>
        selection: |_, selects| selects.iter().position(|selects| *selects).unwrap_or(2);
    "logic-shows-letter" => selected_table: |_, _, chosen| chosen as u8 + 1;
    "logic-output-is-value" => logic_percent: |_, signal| signal.value;
    "logic-error-is-true" => condition: |_, operator, _, arguments| {
        match logic::judge(operator, arguments) {
            Verdict::Error => Verdict::True,
            other => other,
        }
    };
    "gain-before-scaling" => value_before_scaling: |_, value, gain| value * gain;
    "gain-before-scaling" => math_input: |_, part, _| part;
    "logic-error-of-argument-2-unseen" => condition: |_, operator, _, arguments| {
        let [a, b] = arguments;
        let seen = if b.has_failed() { Signal::new(b.value, b.limits) } else { b };
        logic::judge(operator, [a, seen])
    };
    "logic-not-applicable-is-false" => condition: |_, operator, _, arguments| {
        match logic::judge(operator, arguments) {
            Verdict::NotApplicable => Verdict::False,
            other => other,
        }
    };
    "logic-not-applicable-is-true" => condition: |_, operator, _, arguments| {
        match logic::judge(operator, arguments) {
            Verdict::NotApplicable => Verdict::True,
            other => other,
        }
    };
    "logic-arguments-swapped" => condition: |_, operator, _, arguments| {
        let [a, b] = arguments;
        logic::judge(operator, [b, a])
    };
    "fault-of-control-only" => input_fault: |_, inputs| inputs[0];
    "fault-of-override-unseen" => input_fault: |_, inputs| inputs[0] || inputs[1];
    "override-before-fault" => decide: |_, found, control| {
        let fault = found.fault && !found.overrides;
        output::decide(Interventions { fault, ..found }, control)
    };
    "enable-before-override" => decide: |_, found, control| {
        let overrides = found.overrides && found.disabled.is_none();
        output::decide(Interventions { overrides, ..found }, control)
    };
    "fault-modes-swapped" => keeps: |_, configured| !configured;
    "fault-state-inverted" => fault_state: |_, configured| !configured;
    "override-keeps-level" => override_fv: |_, _, level| level;
    "off-at-scaling-1" => is_off: |_, response, pv, limits| {
        let (low, high) = limits;
        response == 1 && pv <= low || response == 2 && pv > high
    };
    "off-at-scaling-2" => is_off: |_, response, pv, limits| {
        let (low, high) = limits;
        response == 1 && pv < low || response == 2 && pv >= high
    };
    "fv-exceeds-its-ends" => held_part: |_, part| part;
    "static-bias-is-added" => biased: |_, fv, pv, bias| if pv == 0.0 { fv + bias } else { fv };
    "static-bias-always" => biased: |_, fv, _, bias| fv - bias;
    "ramp-over-whole-range" => ramp_span: |_, _, _, largest| largest;
    "ramp-from-the-minimum" => ramp_bias: |_, bias, minimum| bias.max(minimum);
    "ramps-swapped" => ramp: |_, ramp| Ramp { up: ramp.down, down: ramp.up, ..ramp };
    "ramp-down-of-16-bits-with-sign" => ramp: |_, ramp| match ramp.down.as_millis() {
        32_768.. => Ramp { down: Duration::ZERO, ..ramp },
        _ => ramp,
    };
    "override-on-ramp" => is_ramped: |_, command| {
        command == Command::Override
            || matches!(command, Command::Control(_) | Command::Disabled(Disabled::RampOff))
    };
    "fault-on-ramp" => is_ramped: |_, command| {
        command == Command::Fault
            || matches!(command, Command::Control(_) | Command::Disabled(Disabled::RampOff))
    };
    "shut-off-on-ramp" =>
        is_ramped: |_, command| matches!(command, Command::Control(_) | Command::Disabled(_));
    "feedback-of-voltage-is-measured" =>
        feedback_without_current: |_, _, driven| (driven.milliamperes / 10.0) as i64;
    "digital-states-swapped" => digital_states: |_, logic, drive| (drive, logic);
    "stage-at-half-power" => stage: |_, stage, _| match stage {
        Stage::Current(milliamperes) => Stage::Current(milliamperes / 2.0),
        other => other,
    };
    "short-circuit-not-signalled" =>
        is_wrong: |_, drives, _, difference, tolerance| drives && difference > tolerance;
    "open-circuit-not-seen" => is_wrong: |_, drives, shorted, _, _| drives && shorted;
    "reaction-delay-of-16-bits-with-sign" =>
        reaction_delay: |_, configured| match configured.as_millis() {
            32_768.. => Duration::ZERO,
            _ => configured,
        };
    "reaction-delay-halved" => reaction_delay: |_, configured| configured / 2;
    "takes-any-heartbeat-time" => refused: |rules, mux, abort| {
        if mux.index == 0x1017 { Ok(()) } else { rules.refused(mux, abort) }
    };
    "takes-any-number" => refused: |rules, mux, abort| {
        if limits::source_of(mux).is_some() { Ok(()) } else { rules.refused(mux, abort) }
    };
    "validation-lasts-without-a-change" =>
        status_after_copy: |_, changed| i64::from(!changed);
    "copies-once-with-the-validation" => copies_with_the_validation: |_| true;
    "copies-once-with-the-validation" => copy_ends_each_validation: |_| true;
    "table-holds-without-source" => table_without_source: |_, held| held;
    "loop-holds-when-disabled" => pid_disabled: |_, held| held;
    "math-off-at-scaling-1" => math_off: |_, low| low;
    "off-at-minimum" => off_fv: |_, minimum| minimum;
    "shows-target-of-ramps" => shown_fv: |_, _, target| target;
    "results-cut" => pid_output: |_, response, output, side| {
        (pid::respond(response, output, side) * 10.0).trunc() / 10.0
    };
    "results-cut" => saturated: |_, part| (part.clamp(0.0, 1.0) * 10_000.0).trunc() / 10_000.0;
    "math-of-percentages" =>
        math_result: |_, operator, a, b| math::operate(operator, 100.0 * a, 100.0 * b) / 100.0;
    "function-result-not-negative" => linked_result: |_, result, gain, _| result.max(0.0) * gain;
    "conditions-of-percentages" => condition: |_, operator, _, arguments| {
        let [a, b] = arguments.map(|signal| signal.limits);
        let percent = |signal: Signal| {
            let limits = signal.limits.or(a).or(b).unwrap_or((0.0, 100.0));
            Signal { value: signal.percent(limits), ..signal }
        };
        logic::judge(operator, arguments.map(percent))
    };
    "logic-state-is-drive-state" => digital_states: |_, _, drive| (drive, drive);
    "supply-never-wrong" => supply_errors: |_, _| (false, false);
    "half-of-the-range-is-on" => is_on: |_, signal| {
        let (low, high) = signal.limits.unwrap_or((0.0, 1.0));
        share(signal.value, low, high) >= 0.5
    };
    "first-output-sets-the-bank" => frequency_is_shared: |_| false;
    "first-output-sets-the-bank" => place: |rules, index, place| {
        if index == OUTPUT_FREQUENCY { rules.bank(place) * 4 } else { place }
    };
    "updates-for-currents-only" => updates: |_, enabled, kind| enabled && kind == Kind::Current;
    "first-point-not-shown" => first_point: |_, item| (item == 3).then_some(0);
    "jump-begins-with-its-point" => is_before_table: |_, x, first| x < first;
    "jump-begins-with-its-point" => within_segment: |_, x, point| x < point;
    "nothing-below-the-table" => below_table: |_, x, first| {
        let (start, first) = first;
        if x < start { 0.0 } else { first }
    };
    "takes-any-point" => refused: |rules, mux, abort| match table_of(mux.index) {
        Some((_, 6)) => Ok(()),
        _ => rules.refused(mux, abort),
    };
    "takes-an-integral-time-of-0" => refused: |rules, mux, abort| match (mux.index, abort) {
        (PID_INTEGRAL_TIME, Abort::TOO_LOW) => Ok(()),
        _ => rules.refused(mux, abort),
    };
    "hotshot-currents-apart" => refused: |rules, mux, abort| match (mux.index, abort) {
        (HOTSHOT_CURRENT, Abort::TOO_LOW) | (HOLD_CURRENT, Abort::TOO_HIGH) => Ok(()),
        _ => rules.refused(mux, abort),
    };
}
