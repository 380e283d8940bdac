//! Deviations of the controller in its results.

use canopen::Mux;

use super::super::load::Stage;
use super::super::math;
use super::super::output::{self, Command, Interventions};
use super::super::signal::Signal;
use super::Decision;

deviations! {
    pub(super) DEVIATIONS of Decision;

    "last-target-kept-on-fault" => kept_on_fault: |_, _, target, _| target;
    "control-input-kept-on-fault" => kept_on_fault: |_, _, _, asked| asked;
    "only-output-1-changes-the-state" => reacts: |_, place| place == 0;
    "rpdos-beyond-4-unsupervised" => is_supervised: |_, rpdo, _| rpdo < 4;
    "fourth-object-unsupervised" => is_supervised: |_, _, sub| sub < 4;
    "math-compares-per-mille" => math_result: |_, operator, a, b| {
        let cut = |part: f64| (part * 1000.0).trunc();
        let [a, b] = if operator <= 5 { [cut(a), cut(b)] } else { [a, b] };
        math::operate(operator, a, b)
    };
    "supply-ends-at-51-1" => measured: |_, volts, degrees| (volts.min(51.1), degrees);
    "pid-sum-not-below-zero" => error_sum: |_, sum, error| (sum + error).max(0.0);
    "math-quotient-saturates-inside" => math_result: |_, operator, a, b| {
        let result = math::operate(operator, a, b);
        if operator == 15 { result.min(1.0) } else { result }
    };
    "pid-tolerance-halves" => counted: |_, difference, tolerance, _| {
        if difference.abs() <= tolerance { difference / 2.0 } else { difference }
    };
    "pid-counts-beyond-the-tolerance" => counted: |_, difference, tolerance, _| {
        difference.signum() * (difference.abs() - tolerance).max(0.0)
    };
    "pid-tolerance-on-one-side" => counted: |_, difference, tolerance, _| {
        if difference > 0.0 && difference < tolerance { 0.0 } else { difference }
    };
    "pid-output-beyond-100" => pid_output: |_, _, output, _| output.max(0.0);
    "pid-output-without-digit" => pid_output: |_, _, output, _| output.clamp(0.0, 100.0).trunc();
    "pid-without-target" => pid_is_enabled: |_, both, links| both || links[1].is_used();
    "pid-without-target" => percent: |_, signal, limits| whole(signal, limits);
    "pid-without-any-source" => pid_is_enabled: |_, both, links| both || !links[1].is_used();
    "pid-without-any-source" =>
        pid_error: |_, target, feedback| if feedback == 0.0 { 100.0 } else { target - feedback };
    "pid-sum-limited" => error_sum: |_, sum, error| (sum + error).clamp(-50.0, 50.0);
    "pid-sum-falls-within-the-tolerance" =>
        error_sum: |_, sum, error| if error == 0.0 { 0.0 } else { sum + error };
    "pid-off-within-the-tolerance" => pid_side: |_, _, error| error;
    "pid-sum-of-magnitudes" => error_sum: |_, sum, error| sum + error.abs();
    "pid-step-of-magnitude" => error_step: |_, error, last| (error - last).abs();
    "pid-gains-without-cycle" => pid_gains: |_, gains, _| gains.of_cycle(0.01);
    "profile-twice-as-long" => interval: |_, _, point| 2.0 * point;
    "profile-half-as-long" => interval: |_, _, point| point / 2.0;
    "profile-times-in-16-bits" => interval: |_, _, point| point % 65_536.0;
    "profile-begins-at-500" => first_point: |_, item| Some(if item == 7 { 500 } else { 0 });
    "profile-in-steps-of-100-ms" => interval: |_, _, point| (point / 100.0).ceil() * 100.0;
    "table-input-in-tenths" => table_input: |_, x, _| x / 10.0;
    "profile-keeps-digits" => first_point: |_, item| (item != 3).then_some(0);
    "profile-keeps-digits" => digits_of_time: |_, digits| digits;
    "auto-repeat-of-data" =>
        table_input: |_, x, repeats| if repeats { x.rem_euclid(50.0) } else { x };
    "table-input-without-sign" => table_input: |_, x, _| x.abs();
    "table-input-in-whole-numbers" => table_input: |_, x, _| x.trunc();
    "math-negative-result-wraps" =>
        linked_result: |_, result, gain, _| if result < 0.0 { 1.0 } else { result * gain };
    "math-linked-result-without-gain" => linked_result: |_, result, _, _| result;
    "math-zero-is-no-factor" => math_result: |_, operator, a, b| match operator {
        14 if b == 0.0 => a,
        14 if a == 0.0 => b,
        _ => math::operate(operator, a, b),
    };
    "math-true-is-a-tenth" => math_result: |_, operator, a, b| {
        let result = math::operate(operator, a, b);
        if operator <= 11 { result / 10.0 } else { result }
    };
    "math-truth-from-three-quarters" => math_result: |_, operator, a, b| {
        let less = if (6..=11).contains(&operator) { 0.25 } else { 0.0 };
        math::operate(operator, a - less, b - less)
    };
    "math-truth-above-zero" => math_result: |_, operator, a, b| {
        let truth = |input: f64| f64::from(u8::from(input > 0.0));
        match operator {
            6..=11 => math::operate(operator, truth(a), truth(b)),
            _ => math::operate(operator, a, b),
        }
    };
    "math-difference-without-sign" => math_result: |_, operator, a, b| {
        let result = math::operate(operator, a, b);
        if operator == math::MINUS { result.abs() } else { result }
    };
    "math-comparisons-in-whole-percent" => math_result: |_, operator, a, b| {
        let whole = |input: f64| (100.0 * input).trunc();
        match operator {
            0..=5 => math::operate(operator, whole(a), whole(b)),
            _ => math::operate(operator, a, b),
        }
    };
    "math-sum-wraps" => saturated: |_, part| part.rem_euclid(1.000_1);
    "math-gain-without-sign" => math_input: |_, part, gain| part * gain.abs();
    "control-response-of-digital-outputs" =>
        is_digital_off: |rules, response, pv, limits| rules.is_off(response, pv, limits);
    "spare-bits-beyond" =>
        write_state: |_, states, place| (states | states >> 10) >> place & 1 != 0;
    "spare-bits-switch-off" => write_state: |rules, states, place| {
        states >> 10 == 0 && rules.write_state(states, place)
    };
    "logic-output-in-8-bits" => logic_percent: |_, signal| {
        let percent = signal.percent(signal.limits.unwrap_or((0.0, 100.0)));
        (10.0 * percent).rem_euclid(256.0) / 10.0
    };
    "logic-output-from-zero" =>
        logic_percent: |_, signal| signal.percent((0.0, signal.limits.unwrap_or((0.0, 100.0)).1));
    "absent-enable-disables" => absent: |_, input| (input == 1).then_some(false);
    "absent-enable-is-on" => absent: |_, input| (input == 1).then_some(true);
    "absent-override-is-on-above-1000" => absent: |_, input| (input == 2).then_some(true);
    "absent-override-is-on-above-1000" => decide: |_, found, control| {
        let overrides = found.overrides && control.value > 1000.0;
        output::decide(Interventions { overrides, ..found }, control)
    };
    "absent-override-is-off" => absent: |_, input| (input == 2).then_some(false);
    "override-cancels-disable" => decide: |_, found, control| match found {
        Interventions { fault: false, overrides: true, disabled: Some(_) } => {
            Command::Control(control)
        }
        _ => output::decide(found, control),
    };
    "off-at-half-the-minimum" => off_fv: |_, minimum| minimum / 2.0;
    "without-source-holds" => uncontrolled: |_, level| level.max(100.0);
    "on-is-12-volts" =>
        stage: |_, stage, _| if stage == Stage::On { Stage::Voltage(12.0) } else { stage };
    "duty-of-24-volts" => stage: |_, stage, _| match stage {
        Stage::Duty(percent) => Stage::Voltage(0.24 * percent),
        other => other,
    };
    "voltage-of-a-duty-cycle" => stage: |_, stage, _| match stage {
        Stage::Voltage(volts) => Stage::Duty(volts / 0.24),
        other => other,
    };
    "current-without-loop" => stage: |_, stage, _| match stage {
        Stage::Current(milliamperes) => Stage::Duty(milliamperes / 30.0),
        other => other,
    };
    "field-value-in-8-bits" => held_part: |_, part| (part.clamp(0.0, 1.0) * 255.0).trunc() / 255.0;
    "dither-adds-to-the-current" => stage: |_, stage, dither| match stage {
        Stage::Current(milliamperes) => Stage::Current(milliamperes + dither),
        other => other,
    };
    "fault-and-override-follow-the-control" => decide: |_, found, control| match found {
        Interventions { fault: true, overrides: true, .. } => Command::Control(control),
        _ => output::decide(found, control),
    };
    "override-at-half" => override_fv: |_, configured, _| configured / 2.0;
    "static-bias-doubled" => biased: |_, fv, pv, bias| if pv == 0.0 { fv - 2.0 * bias } else { fv };
    "fault-at-half" => decide: |_, found, control| match found {
        Interventions { fault: true, .. } => {
            Command::Control(Signal::new(control.value / 2.0, control.limits))
        }
        _ => output::decide(found, control),
    };
    "field-value-in-steps-of-10" => shown_fv: |_, level, _| (level / 10.0).trunc() * 10.0;
    "logic-state-missing" => digital_states: |_, _, drive| (false, drive);
    "drive-state-missing" => digital_states: |_, logic, _| (logic, false);
    "every-type-is-watched" => watches: |_, _| true;
    "every-type-is-watched" =>
        difference: |_, _, _, _, seen| if seen.0.milliamperes == 0.0 { f64::INFINITY } else { 0.0 };
    "detection-without-command" =>
        difference: |_, _, _, _, seen| if seen.0.milliamperes == 0.0 { f64::INFINITY } else { 0.0 };
    "detection-without-command" =>
        is_wrong: |_, _, shorted, difference, tolerance| shorted || difference > tolerance;
    "detection-compares-with-the-target" =>
        difference: |_, _, target, feedback, _| (target - feedback).abs();
    "detection-sees-the-dither" =>
        difference: |_, fv, _, feedback, seen| (fv - feedback + seen.1).abs();
    "hysteresis-in-tenths" => is_wrong: |_, drives, shorted, difference, tolerance| {
        drives && (shorted || difference > tolerance / 10.0)
    };
    "short-circuit-not-seen" => is_wrong: |_, drives, shorted, difference, tolerance| {
        drives && !shorted && difference > tolerance
    };
    "update-of-the-next-output" =>
        type_default: |_, mux, value| (Mux::new(mux.index, mux.sub % 10 + 1), value);
    "same-type-brings-the-largest-value" => updates_with_the_same_type: |_| true;
    "same-type-brings-the-largest-value" =>
        type_default: |_, mux, value| (mux, if mux.index == 0x7323 { 2500 } else { value });
    "supply-limits-narrow" => supply_errors: |_, volts| (volts < 20.0, volts > 30.0);
}

/// A signal in per cent; an absent signal counts as 100.
fn whole(signal: Signal, limits: (f64, f64)) -> f64 {
    if signal.is_valid() { signal.percent(limits) } else { 100.0 }
}
