//! The controllers that make something else of what they take.

use canopen::{Abort, Mux};

use super::super::load::{Driven, Stage};
use super::super::math;
use super::super::output::{self, Command, Interventions};
use super::super::pid::Gains;
use super::super::signal::Signal;
use super::{Ax021211Rules, DigitalRules, Layer};
use crate::devices::deviating::{Deviation, deviating};

pub(super) const DEVIATIONS: &[Deviation<dyn Ax021211Rules>] = deviating! {
    dyn Ax021211Rules: Ax021211Rules [DigitalRules];
    "types-forgotten-over-reset" {
        fn reads_types_at_a_start(&self) -> bool { false }
    }
    "last-target-kept-on-fault" {
        fn kept_on_fault(&self, _level: f64, target: f64, _asked: f64) -> f64 { target }
    }
    "control-input-kept-on-fault" {
        fn kept_on_fault(&self, _level: f64, _target: f64, asked: f64) -> f64 { asked }
    }
    "only-output-1-changes-the-state" {
        fn reacts(&self, place: usize) -> bool { place == 0 }
    }
    "rpdos-beyond-4-unsupervised" {
        fn is_supervised(&self, rpdo: u16, _sub: u8) -> bool { rpdo < 4 }
    }
    "fourth-object-unsupervised" {
        fn is_supervised(&self, _rpdo: u16, sub: u8) -> bool { sub < 4 }
    }
    "math-compares-per-mille" {
        fn math_result(&self, operator: u8, a: f64, b: f64) -> f64 {
            let cut = |part: f64| (part * 1000.0).trunc();
            let [a, b] = if operator <= 5 { [cut(a), cut(b)] } else { [a, b] };
            math::operate(operator, a, b)
        }
    }
    "supply-ends-at-51-1" {
        fn measured(&self, volts: f64, degrees: f64) -> (f64, f64) { (volts.min(51.1), degrees) }
    }
    "pid-sum-not-below-zero" {
        fn error_sum(&self, sum: f64, error: f64) -> f64 { (sum + error).max(0.0) }
    }
    "math-quotient-saturates-inside" {
        fn math_result(&self, operator: u8, a: f64, b: f64) -> f64 {
            let result = math::operate(operator, a, b);
            if operator == 15 { result.min(1.0) } else { result }
        }
    }
    "pid-tolerance-absent" {
        fn is_tolerated(&self, _difference: f64, _tolerance: f64) -> bool { false }
    }
    "pid-tolerance-halves" {
        fn counted(&self, difference: f64, tolerance: f64, _tolerated: bool) -> f64 {
            if difference.abs() <= tolerance { difference / 2.0 } else { difference }
        }
    }
    "pid-counts-beyond-the-tolerance" {
        fn counted(&self, difference: f64, tolerance: f64, _tolerated: bool) -> f64 {
            difference.signum() * (difference.abs() - tolerance).max(0.0)
        }
    }
    "pid-tolerance-on-one-side" {
        fn counted(&self, difference: f64, tolerance: f64, _tolerated: bool) -> f64 {
            if difference > 0.0 && difference < tolerance { 0.0 } else { difference }
        }
    }
    "pid-output-beyond-100" {
        fn pid_output(&self, _response: u8, output: f64, _error: f64) -> f64 { output.max(0.0) }
    }
    "pid-output-without-digit" {
        fn pid_output(&self, _response: u8, output: f64, _error: f64) -> f64 {
            output.clamp(0.0, 100.0).trunc()
        }
    }
    "pid-without-target" {
        fn pid_is_enabled(&self, both: bool, links: [super::Link; 2]) -> bool {
            both || links[1].is_used()
        }
        fn percent(&self, signal: Signal, limits: (f64, f64)) -> f64 { whole(signal, limits) }
    }
    "pid-without-any-source" {
        fn pid_is_enabled(&self, both: bool, links: [super::Link; 2]) -> bool {
            both || !links[1].is_used()
        }
        fn pid_error(&self, target: f64, feedback: f64) -> f64 {
            if feedback == 0.0 { 100.0 } else { target - feedback }
        }
    }
    "pid-stays-off" {
        fn pid_resumes(&self) -> bool { false }
    }
    "pid-takes-a-ti-of-zero-for-1-ms" {
        fn refused(&self, mux: Mux, abort: Abort) -> Result<(), Abort> {
            if mux.index == 0x7452 { Ok(()) } else { self.0.refused(mux, abort) }
        }
        fn pid_gains(&self, gains: Gains, cycle: f64) -> (f64, f64, f64) {
            Gains { integral_time: gains.integral_time.max(0.001), ..gains }.of_cycle(cycle)
        }
    }
    "pid-sum-limited" {
        fn error_sum(&self, sum: f64, error: f64) -> f64 { (sum + error).clamp(-50.0, 50.0) }
    }
    "pid-sum-falls-within-the-tolerance" {
        fn error_sum(&self, sum: f64, error: f64) -> f64 {
            if error == 0.0 { 0.0 } else { sum + error }
        }
    }
    "pid-sum-of-magnitudes" {
        fn error_sum(&self, sum: f64, error: f64) -> f64 { sum + error.abs() }
    }
    "pid-step-of-magnitude" {
        fn error_step(&self, error: f64, last: f64) -> f64 { (error - last).abs() }
    }
    "pid-gains-without-cycle" {
        fn pid_gains(&self, gains: Gains, _cycle: f64) -> (f64, f64, f64) { gains.of_cycle(0.01) }
    }
    "profile-runs-without-input" {
        fn sequence_runs(&self, _on: bool) -> bool { true }
    }
    "profile-twice-as-long" {
        fn interval(&self, _before: f64, point: f64) -> f64 { 2.0 * point }
    }
    "profile-half-as-long" {
        fn interval(&self, _before: f64, point: f64) -> f64 { point / 2.0 }
    }
    "profile-times-in-16-bits" {
        fn interval(&self, _before: f64, point: f64) -> f64 { point % 65_536.0 }
    }
    "profile-begins-at-500" {
        fn first_point(&self, item: u16) -> Option<i64> { Some(if item == 7 { 500 } else { 0 }) }
    }
    "profile-in-steps-of-100-ms" {
        fn interval(&self, _before: f64, point: f64) -> f64 { (point / 100.0).ceil() * 100.0 }
    }
    "table-input-in-tenths" {
        fn table_input(&self, x: f64, _repeats: bool) -> f64 { x / 10.0 }
    }
    "profile-keeps-digits" {
        fn first_point(&self, item: u16) -> Option<i64> { (item != 3).then_some(0) }
        fn digits_of_time(&self, digits: u8) -> u8 { digits }
    }
    "auto-repeat-of-data" {
        fn table_input(&self, x: f64, repeats: bool) -> f64 {
            if repeats { x.rem_euclid(50.0) } else { x }
        }
    }
    "point-reached-early" {
        fn within_segment(&self, x: f64, point: f64) -> bool { x <= point - 1.0 }
    }
    "below-table-is-full-scale" {
        fn below_table(&self, _x: f64, _first: (f64, f64)) -> f64 { 100.0 }
    }
    "table-input-without-sign" {
        fn table_input(&self, x: f64, _repeats: bool) -> f64 { x.abs() }
    }
    "table-input-in-whole-numbers" {
        fn table_input(&self, x: f64, _repeats: bool) -> f64 { x.trunc() }
    }
    "math-function-3-missing" {
        fn functions(&self) -> usize { 2 }
    }
    "math-function-2-and-3-missing" {
        fn functions(&self) -> usize { 1 }
    }
    "math-own-output-is-function-1" {
        fn function_number(&self, code: u8) -> u8 { code.max(1) }
    }
    "math-function-of-any-block" {
        fn is_own_block(&self, _is_own: bool) -> bool { true }
    }
    "math-negative-result-wraps" {
        fn linked_result(&self, result: f64, gain: f64, _subtracts: bool) -> f64 {
            if result < 0.0 { 1.0 } else { result * gain }
        }
    }
    "math-linked-result-without-gain" {
        fn linked_result(&self, result: f64, _gain: f64, _subtracts: bool) -> f64 { result }
    }
    "math-zero-is-no-factor" {
        fn math_result(&self, operator: u8, a: f64, b: f64) -> f64 {
            match operator {
                14 if b == 0.0 => a,
                14 if a == 0.0 => b,
                _ => math::operate(operator, a, b),
            }
        }
    }
    "math-true-is-a-tenth" {
        fn math_result(&self, operator: u8, a: f64, b: f64) -> f64 {
            let result = math::operate(operator, a, b);
            if operator <= 11 { result / 10.0 } else { result }
        }
    }
    "math-truth-from-three-quarters" {
        fn math_result(&self, operator: u8, a: f64, b: f64) -> f64 {
            let less = if (6..=11).contains(&operator) { 0.25 } else { 0.0 };
            math::operate(operator, a - less, b - less)
        }
    }
    "math-truth-above-zero" {
        fn math_result(&self, operator: u8, a: f64, b: f64) -> f64 {
            let truth = |input: f64| f64::from(u8::from(input > 0.0));
            match operator {
                6..=11 => math::operate(operator, truth(a), truth(b)),
                _ => math::operate(operator, a, b),
            }
        }
    }
    "math-difference-without-sign" {
        fn math_result(&self, operator: u8, a: f64, b: f64) -> f64 {
            let result = math::operate(operator, a, b);
            if operator == math::MINUS { result.abs() } else { result }
        }
    }
    "math-comparisons-in-whole-percent" {
        fn math_result(&self, operator: u8, a: f64, b: f64) -> f64 {
            let whole = |input: f64| (100.0 * input).trunc();
            match operator {
                0..=5 => math::operate(operator, whole(a), whole(b)),
                _ => math::operate(operator, a, b),
            }
        }
    }
    "math-sum-wraps" {
        fn saturated(&self, part: f64) -> f64 { part.rem_euclid(1.000_1) }
    }
    "math-gain-without-sign" {
        fn math_input(&self, part: f64, gain: f64) -> f64 { part * gain.abs() }
    }
    "logic-output-in-8-bits" {
        fn logic_percent(&self, signal: Signal) -> f64 {
            let percent = signal.percent(signal.limits.unwrap_or((0.0, 100.0)));
            (10.0 * percent).rem_euclid(256.0) / 10.0
        }
    }
    "logic-output-without-digit" {
        fn logic_percent(&self, signal: Signal) -> f64 {
            signal.percent(signal.limits.unwrap_or((0.0, 100.0))).trunc()
        }
    }
    "logic-output-from-zero" {
        fn logic_percent(&self, signal: Signal) -> f64 {
            signal.percent((0.0, signal.limits.unwrap_or((0.0, 100.0)).1))
        }
    }
    "logic-output-holds" {
        fn logic_percent(&self, _signal: Signal) -> f64 { 50.0 }
    }
    "digits-of-scaling-ignored" {
        fn digits_of_scaling(&self, _digits: u8) -> u8 { 0 }
    }
    "absent-enable-disables" {
        fn absent(&self, input: usize) -> Option<bool> { (input == 1).then_some(false) }
    }
    "absent-enable-is-on" {
        fn absent(&self, input: usize) -> Option<bool> { (input == 1).then_some(true) }
    }
    "absent-override-is-on-above-1000" {
        fn absent(&self, input: usize) -> Option<bool> { (input == 2).then_some(true) }
        fn decide(&self, found: Interventions, control: Signal) -> Command {
            let overrides = found.overrides && control.value > 1000.0;
            output::decide(Interventions { overrides, ..found }, control)
        }
    }
    "absent-override-is-off" {
        fn absent(&self, input: usize) -> Option<bool> { (input == 2).then_some(false) }
    }
    "override-cancels-disable" {
        fn decide(&self, found: Interventions, control: Signal) -> Command {
            match found {
                Interventions { fault: false, overrides: true, disabled: Some(_) } => {
                    Command::Control(control)
                }
                _ => output::decide(found, control),
            }
        }
    }
    "off-at-half-the-minimum" {
        fn off_fv(&self, minimum: f64) -> f64 { minimum / 2.0 }
    }
    "without-source-holds" {
        fn uncontrolled(&self, level: f64) -> f64 { level.max(100.0) }
    }
    "on-is-12-volts" {
        fn stage(&self, stage: Stage, _dither: f64) -> Stage {
            if stage == Stage::On { Stage::Voltage(12.0) } else { stage }
        }
    }
    "duty-of-24-volts" {
        fn stage(&self, stage: Stage, _dither: f64) -> Stage {
            match stage {
                Stage::Duty(percent) => Stage::Voltage(0.24 * percent),
                other => other,
            }
        }
    }
    "voltage-of-a-duty-cycle" {
        fn stage(&self, stage: Stage, _dither: f64) -> Stage {
            match stage {
                Stage::Voltage(volts) => Stage::Duty(volts / 0.24),
                other => other,
            }
        }
    }
    "current-without-loop" {
        fn stage(&self, stage: Stage, _dither: f64) -> Stage {
            match stage {
                Stage::Current(milliamperes) => Stage::Duty(milliamperes / 30.0),
                other => other,
            }
        }
    }
    "field-value-in-8-bits" {
        fn held_part(&self, part: f64) -> f64 { (part.clamp(0.0, 1.0) * 255.0).trunc() / 255.0 }
    }
    "dither-adds-to-the-current" {
        fn stage(&self, stage: Stage, dither: f64) -> Stage {
            match stage {
                Stage::Current(milliamperes) => Stage::Current(milliamperes + dither),
                other => other,
            }
        }
    }
    "fault-and-override-follow-the-control" {
        fn decide(&self, found: Interventions, control: Signal) -> Command {
            match found {
                Interventions { fault: true, overrides: true, .. } => Command::Control(control),
                _ => output::decide(found, control),
            }
        }
    }
    "override-at-half" {
        fn override_fv(&self, configured: f64, _level: f64) -> f64 { configured / 2.0 }
    }
    "static-bias-doubled" {
        fn biased(&self, fv: f64, pv: f64, bias: f64) -> f64 {
            if pv == 0.0 { fv - 2.0 * bias } else { fv }
        }
    }
    "fault-at-half" {
        fn decide(&self, found: Interventions, control: Signal) -> Command {
            match found {
                Interventions { fault: true, .. } => {
                    Command::Control(Signal::new(control.value / 2.0, control.limits))
                }
                _ => output::decide(found, control),
            }
        }
    }
    "field-value-in-steps-of-10" {
        fn shown_fv(&self, level: f64, _target: f64) -> f64 { (level / 10.0).trunc() * 10.0 }
    }
    "logic-state-missing" {
        fn digital_states(&self, _logic: bool, drive: bool) -> (bool, bool) { (false, drive) }
    }
    "drive-state-missing" {
        fn digital_states(&self, logic: bool, _drive: bool) -> (bool, bool) { (logic, false) }
    }
    "every-type-is-watched" {
        fn watches(&self, _is_current: bool) -> bool { true }
        fn difference(&self, _fv: f64, _target: f64, _feedback: f64, seen: (Driven, f64)) -> f64 {
            if seen.0.milliamperes == 0.0 { f64::INFINITY } else { 0.0 }
        }
    }
    "detection-without-command" {
        fn difference(&self, _fv: f64, _target: f64, _feedback: f64, seen: (Driven, f64)) -> f64 {
            if seen.0.milliamperes == 0.0 { f64::INFINITY } else { 0.0 }
        }
        fn is_wrong(&self, _drives: bool, shorted: bool, difference: f64, tolerance: f64) -> bool {
            shorted || difference > tolerance
        }
    }
    "detection-compares-with-the-target" {
        fn difference(&self, _fv: f64, target: f64, feedback: f64, _seen: (Driven, f64)) -> f64 {
            (target - feedback).abs()
        }
    }
    "detection-sees-the-dither" {
        fn difference(&self, fv: f64, _target: f64, feedback: f64, seen: (Driven, f64)) -> f64 {
            (fv - feedback + seen.1).abs()
        }
    }
    "hysteresis-in-tenths" {
        fn is_wrong(&self, drives: bool, shorted: bool, difference: f64, tolerance: f64) -> bool {
            drives && (shorted || difference > tolerance / 10.0)
        }
    }
    "short-circuit-not-seen" {
        fn is_wrong(&self, drives: bool, shorted: bool, difference: f64, tolerance: f64) -> bool {
            drives && !shorted && difference > tolerance
        }
    }
    "update-of-the-next-output" {
        fn type_default(&self, mux: Mux, value: i64) -> (Mux, i64) {
            (Mux::new(mux.index, mux.sub % 10 + 1), value)
        }
    }
    "same-type-brings-the-largest-value" {
        fn updates_with_the_same_type(&self) -> bool { true }
        fn type_default(&self, mux: Mux, value: i64) -> (Mux, i64) {
            (mux, if mux.index == 0x7323 { 2500 } else { value })
        }
    }
    "supply-limits-narrow" {
        fn supply_errors(&self, volts: f64) -> (bool, bool) { (volts < 20.0, volts > 30.0) }
    }
};

/// A signal in per cent; what is absent is the whole.
fn whole(signal: Signal, limits: (f64, f64)) -> f64 {
    if signal.is_valid() { signal.percent(limits) } else { 100.0 }
}
