//! The controllers that take one decision otherwise.

use std::time::Duration;

use canopen::{Abort, Mux};

use super::super::limits;
use super::super::load::{Driven, Stage};
use super::super::logic::{self, Verdict};
use super::super::math;
use super::super::objects::{
    HOLD_CURRENT, HOTSHOT_CURRENT, OUTPUT_FREQUENCY, PID_INTEGRAL_TIME, table_of,
};
use super::super::output::{self, Command, Disabled, Interventions, Kind};
use super::super::pid::{self, Gains};
use super::super::ramp::Ramp;
use super::super::signal::{Link, Signal, share};
use super::super::table::POINTS;
use super::{Ax021211Rules, DigitalRules, Layer, digital, inputs, parameters, results};
use crate::devices::deviating::{self, Deviation, Lay, deviating};

/// The names of the devices that break one decision.
pub(in super::super) fn names() -> impl Iterator<Item = &'static str> {
    let named = [inputs::DEVIATIONS, DEVIATIONS, digital::DEVIATIONS, results::DEVIATIONS];
    parameters::names().chain(named.into_iter().flat_map(deviating::names))
}

/// The deviation of that name; `None` when there is none.
pub(in super::super) fn named(name: &str) -> Option<Lay<dyn Ax021211Rules>> {
    let named = [inputs::DEVIATIONS, DEVIATIONS, digital::DEVIATIONS, results::DEVIATIONS];
    let found = named.into_iter().find_map(|all| deviating::named(all, name));
    found.or_else(|| parameters::named(name))
}

const DEVIATIONS: &[Deviation<dyn Ax021211Rules>] = deviating! {
    dyn Ax021211Rules: Ax021211Rules [DigitalRules];
    "half-is-on" {
        fn is_on(&self, signal: Signal) -> bool { signal.value >= 50.0 }
    }
    "digital-by-process-value" {
        fn message_is_bit(&self, _is_digital: bool) -> bool { false }
    }
    "write-states-reversed" {
        fn write_state(&self, states: i64, place: usize) -> bool { states >> (9 - place) & 1 != 0 }
    }
    "write-states-of-first-bit" {
        fn write_state(&self, states: i64, _place: usize) -> bool { states & 1 != 0 }
    }
    "received-without-validation" {
        fn takes_received(&self, _status: i64) -> bool { true }
    }
    "received-not-copied" {
        fn takes_received(&self, _status: i64) -> bool { false }
    }
    "received-when-invalid" {
        fn takes_received(&self, status: i64) -> bool { status == 0 }
    }
    "validation-lasts" {
        fn status_after_copy(&self) -> i64 { 1 }
    }
    "timed-out-message-valid" {
        fn message_fails(&self, _timed_out: bool) -> bool { false }
    }
    "open-circuit-changes-no-state" {
        fn fault_group(&self) -> Option<u8> { None }
    }
    "open-circuit-is-digital-fault" {
        fn fault_group(&self) -> Option<u8> { Some(4) }
    }
    "open-circuit-is-communication-fault" {
        fn fault_group(&self) -> Option<u8> { Some(1) }
    }
    "channel-counted-from-0" {
        fn channel(&self, place: usize) -> u8 { place as u8 }
    }
    "channel-always-1" {
        fn channel(&self, _place: usize) -> u8 { 1 }
    }
    "supply-errors-swapped" {
        fn supply_errors(&self, volts: f64) -> (bool, bool) { (volts > 60.0, volts < 9.0) }
    }
    "supply-low-not-seen" {
        fn supply_errors(&self, volts: f64) -> (bool, bool) { (false, volts > 60.0) }
    }
    "supply-high-not-seen" {
        fn supply_errors(&self, volts: f64) -> (bool, bool) { (volts < 9.0, false) }
    }
    "banks-of-five" {
        fn bank(&self, place: usize) -> usize { place / 5 }
    }
    "each-output-has-a-timer" {
        fn bank(&self, place: usize) -> usize { place }
    }
    "one-bank" {
        fn bank(&self, _place: usize) -> usize { 0 }
    }
    "current-leaves-frequency" {
        fn frequency(&self, configured: i64, _has_loop: bool) -> i64 { configured }
    }
    "frequency-always-fixed" {
        fn frequency(&self, _configured: i64, _has_loop: bool) -> i64 { 25_000 }
    }
    "updates-always" {
        fn updates(&self, _enabled: bool, _kind: Kind) -> bool { true }
    }
    "updates-never" {
        fn updates(&self, _enabled: bool, _kind: Kind) -> bool { false }
    }
    "ramp-taken-for-jump" {
        fn point_response(&self, code: u8) -> u8 { code.max(2 * u8::from(code == 1)) }
    }
    "jump-taken-for-ramp" {
        fn point_response(&self, code: u8) -> u8 { code.min(1) }
    }
    "ignore-taken-for-ramp" {
        fn point_response(&self, code: u8) -> u8 { code.max(1) }
    }
    "auto-repeat-always" {
        fn repeats(&self, _configured: bool) -> bool { true }
    }
    "auto-repeat-never" {
        fn repeats(&self, _configured: bool) -> bool { false }
    }
    "ignored-points-out-of-limits" {
        fn points_of_limits(&self, in_use: usize) -> usize { in_use }
    }
    "table-limits-always-percentage" {
        fn table_limits(&self, _low: f64, _high: f64) -> (f64, f64) { (0.0, 100.0) }
    }
    "table-limits-always-ends" {
        fn table_limits(&self, low: f64, high: f64) -> (f64, f64) { (low, high) }
    }
    "ignored-point-alone" {
        fn points_in_use(&self, _before: usize) -> usize { POINTS }
    }
    "segment-without-its-end" {
        fn within_segment(&self, x: f64, point: f64) -> bool { x < point }
    }
    "below-table-is-zero" {
        fn below_table(&self, _x: f64, _first: (f64, f64)) -> f64 { 0.0 }
    }
    "beyond-table-is-zero" {
        fn beyond_table(&self, _last: f64) -> f64 { 0.0 }
    }
    "jump-is-late" {
        fn jump(&self, from: f64, _to: f64) -> f64 { from }
    }
    "time-points-are-absolute" {
        fn interval(&self, before: f64, point: f64) -> f64 { point - before }
    }
    "profile-falls-back" {
        fn after_sequence(&self, _last: f64) -> f64 { 0.0 }
    }
    "profile-goes-on" {
        fn sequence_begins_anew(&self) -> bool { false }
    }
    "profile-holds-when-off" {
        fn sequence_off(&self, held: f64) -> f64 { held }
    }
    "pid-times-tenfold" {
        fn pid_time(&self, seconds: f64) -> f64 { seconds * 10.0 }
    }
    "pid-without-feedback" {
        fn pid_is_enabled(&self, both: bool, links: [Link; 2]) -> bool {
            both || links[0].is_used()
        }
    }
    "pid-error-reversed" {
        fn pid_error(&self, target: f64, feedback: f64) -> f64 { feedback - target }
    }
    "pid-tolerance-inclusive" {
        fn is_tolerated(&self, difference: f64, tolerance: f64) -> bool { difference <= tolerance }
    }
    "pid-integral-without-ti" {
        fn pid_gains(&self, gains: Gains, cycle: f64) -> (f64, f64, f64) {
            let gains = Gains { integral_time: 1.0, ..gains };
            gains.of_cycle(cycle)
        }
    }
    "pid-derivative-without-td" {
        fn pid_gains(&self, gains: Gains, cycle: f64) -> (f64, f64, f64) {
            let gains = Gains { derivative_time: 0.0, ..gains };
            gains.of_cycle(cycle)
        }
    }
    "pid-gain-is-proportional-only" {
        fn pid_gains(&self, gains: Gains, cycle: f64) -> (f64, f64, f64) {
            let rest = Gains { proportional: 1.0, ..gains }.of_cycle(cycle);
            (gains.proportional, rest.1, rest.2)
        }
    }
    "pid-zero-ti-is-one" {
        fn pid_gains(&self, gains: Gains, cycle: f64) -> (f64, f64, f64) {
            let time = if gains.integral_time == 0.0 { 1.0 } else { gains.integral_time };
            Gains { integral_time: time, ..gains }.of_cycle(cycle)
        }
    }
    "pid-sum-forgets" {
        fn error_sum(&self, _sum: f64, error: f64) -> f64 { error }
    }
    "pid-step-of-error" {
        fn error_step(&self, error: f64, _last: f64) -> f64 { error }
    }
    "pid-output-is-absolute" {
        fn pid_output(&self, _response: u8, output: f64, _error: f64) -> f64 {
            output.abs().min(100.0)
        }
    }
    "pid-target-is-percentage" {
        fn target_limits(&self, own: Option<(f64, f64)>, _of_feedback: (f64, f64)) -> (f64, f64) {
            own.unwrap_or((0.0, 100.0))
        }
    }
    "math-gain-in-tenths" {
        fn gain(&self, configured: i64) -> f64 { configured as f64 / 10.0 }
    }
    "math-always-enabled" {
        fn math_is_enabled(&self, _configured: bool) -> bool { true }
    }
    "math-function-of-one-input" {
        fn function_counts(&self, inputs: [bool; 2]) -> bool { inputs[0] || inputs[1] }
    }
    "math-negative-result-passed-on" {
        fn linked_result(&self, result: f64, gain: f64, _subtracts: bool) -> f64 { result * gain }
    }
    "math-inputs-swapped" {
        fn function_inputs(&self, inputs: [f64; 2]) -> [f64; 2] { [inputs[1], inputs[0]] }
    }
    "math-truth-above-half" {
        fn math_result(&self, operator: u8, a: f64, b: f64) -> f64 {
            let less = if (6..=11).contains(&operator) { 1e-9 } else { 0.0 };
            math::operate(operator, a - less, b - less)
        }
    }
    "math-division-by-zero-saturates" {
        fn math_result(&self, operator: u8, a: f64, b: f64) -> f64 {
            if operator == 15 && b == 0.0 { 1.0 } else { math::operate(operator, a, b) }
        }
    }
    "math-first-function-is-result" {
        fn block_result(&self, before: Option<f64>, result: f64) -> Option<f64> {
            before.or(Some(result))
        }
    }
    "math-does-not-saturate" {
        fn saturated(&self, part: f64) -> f64 { part }
    }
    "math-error-counts-as-value" {
        fn math_input_in_error(&self, value: f64) -> f64 { value }
    }
    "math-gain-is-added" {
        fn math_input(&self, part: f64, gain: f64) -> f64 { part + gain - 1.0 }
    }
    "logic-always-enabled" {
        fn logic_is_enabled(&self, _configured: bool) -> bool { true }
    }
    "logic-last-table-wins" {
        fn selection(&self, selects: [bool; 3]) -> usize {
            selects.iter().rposition(|selects| *selects).unwrap_or(0)
        }
    }
    "logic-default-is-table-c" {
        fn selection(&self, selects: [bool; 3]) -> usize {
            selects.iter().position(|selects| *selects).unwrap_or(2)
        }
    }
    "logic-shows-letter" {
        fn selected_table(&self, _number: u8, chosen: usize) -> u8 { chosen as u8 + 1 }
    }
    "logic-output-is-value" {
        fn logic_percent(&self, signal: Signal) -> f64 { signal.value }
    }
    "logic-error-is-true" {
        fn condition(&self, operator: u8, _links: [Link; 2], arguments: [Signal; 2]) -> Verdict {
            match logic::judge(operator, arguments) {
                Verdict::Error => Verdict::True,
                other => other,
            }
        }
    }
    "logic-error-does-not-apply" {
        fn condition(&self, operator: u8, _links: [Link; 2], arguments: [Signal; 2]) -> Verdict {
            match logic::judge(operator, arguments) {
                Verdict::Error => Verdict::NotApplicable,
                other => other,
            }
        }
    }
    "gain-before-scaling" {
        fn value_before_scaling(&self, value: f64, gain: f64) -> f64 { value * gain }
        fn math_input(&self, part: f64, _gain: f64) -> f64 { part }
    }
    "logic-error-of-argument-2-unseen" {
        fn condition(&self, operator: u8, _links: [Link; 2], arguments: [Signal; 2]) -> Verdict {
            let [a, b] = arguments;
            let seen = if b.has_failed() { Signal::new(b.value, b.limits) } else { b };
            logic::judge(operator, [a, seen])
        }
    }
    "logic-not-applicable-is-false" {
        fn condition(&self, operator: u8, _links: [Link; 2], arguments: [Signal; 2]) -> Verdict {
            match logic::judge(operator, arguments) {
                Verdict::NotApplicable => Verdict::False,
                other => other,
            }
        }
    }
    "logic-not-applicable-is-true" {
        fn condition(&self, operator: u8, _links: [Link; 2], arguments: [Signal; 2]) -> Verdict {
            match logic::judge(operator, arguments) {
                Verdict::NotApplicable => Verdict::True,
                other => other,
            }
        }
    }
    "logic-arguments-swapped" {
        fn condition(&self, operator: u8, _links: [Link; 2], arguments: [Signal; 2]) -> Verdict {
            let [a, b] = arguments;
            logic::judge(operator, [b, a])
        }
    }
    "fault-of-control-only" {
        fn input_fault(&self, inputs: [bool; 3]) -> bool { inputs[0] }
    }
    "fault-not-seen" {
        fn input_fault(&self, _failed: [bool; 3]) -> bool { false }
    }
    "override-before-fault" {
        fn decide(&self, found: Interventions, control: Signal) -> Command {
            let fault = found.fault && !found.overrides;
            output::decide(Interventions { fault, ..found }, control)
        }
    }
    "enable-before-override" {
        fn decide(&self, found: Interventions, control: Signal) -> Command {
            let overrides = found.overrides && found.disabled.is_none();
            output::decide(Interventions { overrides, ..found }, control)
        }
    }
    "fault-modes-swapped" {
        fn keeps(&self, configured: bool) -> bool { !configured }
    }
    "fault-state-inverted" {
        fn fault_state(&self, configured: bool) -> bool { !configured }
    }
    "override-keeps-level" {
        fn override_fv(&self, _configured: f64, level: f64) -> f64 { level }
    }
    "override-switches-off" {
        fn override_fv(&self, _configured: f64, _level: f64) -> f64 { 0.0 }
    }
    "off-at-scaling-1" {
        fn is_off(&self, response: u8, pv: f64, limits: (f64, f64)) -> bool {
            let (low, high) = limits;
            response == 1 && pv <= low || response == 2 && pv > high
        }
    }
    "off-at-scaling-2" {
        fn is_off(&self, response: u8, pv: f64, limits: (f64, f64)) -> bool {
            let (low, high) = limits;
            response == 1 && pv < low || response == 2 && pv >= high
        }
    }
    "fv-exceeds-its-ends" {
        fn held_part(&self, part: f64) -> f64 { part }
    }
    "static-bias-is-added" {
        fn biased(&self, fv: f64, pv: f64, bias: f64) -> f64 {
            if pv == 0.0 { fv + bias } else { fv }
        }
    }
    "static-bias-always" {
        fn biased(&self, fv: f64, _pv: f64, bias: f64) -> f64 { fv - bias }
    }
    "ramp-through-bias" {
        fn ramp_bias(&self, _bias: f64) -> f64 { 0.0 }
    }
    "ramp-over-whole-range" {
        fn ramp_span(&self, _fv1: f64, _fv2: f64, largest: f64) -> f64 { largest }
    }
    "ramps-swapped" {
        fn ramp(&self, ramp: Ramp) -> Ramp { Ramp { up: ramp.down, down: ramp.up, ..ramp } }
    }
    "override-on-ramp" {
        fn is_ramped(&self, command: Command) -> bool {
            command == Command::Override
                || matches!(command, Command::Control(_) | Command::Disabled(Disabled::RampOff))
        }
    }
    "fault-on-ramp" {
        fn is_ramped(&self, command: Command) -> bool {
            command == Command::Fault
                || matches!(command, Command::Control(_) | Command::Disabled(Disabled::RampOff))
        }
    }
    "shut-off-on-ramp" {
        fn is_ramped(&self, command: Command) -> bool {
            matches!(command, Command::Control(_) | Command::Disabled(_))
        }
    }
    "feedback-of-voltage-is-measured" {
        fn feedback_without_current(&self, _level: i64, driven: Driven) -> i64 {
            (driven.milliamperes / 10.0) as i64
        }
    }
    "digital-states-swapped" {
        fn digital_states(&self, logic: bool, drive: bool) -> (bool, bool) { (drive, logic) }
    }
    "stage-at-half-power" {
        fn stage(&self, stage: Stage, _dither: f64) -> Stage {
            match stage {
                Stage::Current(milliamperes) => Stage::Current(milliamperes / 2.0),
                other => other,
            }
        }
    }
    "feedback-of-fault-valid" {
        fn feedback_fails(&self, _fault: bool) -> bool { false }
    }
    "detection-inclusive" {
        fn is_wrong(&self, drives: bool, shorted: bool, difference: f64, tolerance: f64) -> bool {
            drives && (shorted || difference >= tolerance)
        }
    }
    "short-circuit-not-signalled" {
        fn is_wrong(&self, drives: bool, _shorted: bool, difference: f64, tolerance: f64) -> bool {
            drives && difference > tolerance
        }
    }
    "open-circuit-not-seen" {
        fn is_wrong(&self, drives: bool, shorted: bool, _difference: f64, _tolerance: f64) -> bool {
            drives && shorted
        }
    }
    "reaction-delay-halved" {
        fn reaction_delay(&self, configured: Duration) -> Duration { configured / 2 }
    }
    "reaction-delay-goes-on" {
        fn detection_begins_anew(&self) -> bool { false }
    }
    "fault-is-latched" {
        fn error_ends(&self) -> bool { false }
    }
    "takes-what-is-out-of-range" {
        fn refused(&self, _mux: Mux, _abort: Abort) -> Result<(), Abort> { Ok(()) }
    }
    "takes-any-heartbeat-time" {
        fn refused(&self, mux: Mux, abort: Abort) -> Result<(), Abort> {
            if mux.index == 0x1017 { Ok(()) } else { self.0.refused(mux, abort) }
        }
    }
    "takes-any-number" {
        fn refused(&self, mux: Mux, abort: Abort) -> Result<(), Abort> {
            if limits::source_of(mux).is_some() { Ok(()) } else { self.0.refused(mux, abort) }
        }
    }
    "copies-with-the-validation" {
        fn copies_with_the_validation(&self) -> bool { true }
    }
    "copies-once-with-the-validation" {
        fn copies_with_the_validation(&self) -> bool { true }
        fn copy_ends_each_validation(&self) -> bool { true }
    }
    "same-type-updates" {
        fn updates_with_the_same_type(&self) -> bool { true }
    }
    "table-holds-without-source" {
        fn table_without_source(&self, held: i64) -> i64 { held }
    }
    "loop-holds-when-disabled" {
        fn pid_disabled(&self, held: i64) -> i64 { held }
    }
    "math-off-at-scaling-1" {
        fn math_off(&self, low: f64) -> f64 { low }
    }
    "disabled-logic-selects-none" {
        fn selected_while_disabled(&self, _selected: u8) -> u8 { 0 }
    }
    "off-at-minimum" {
        fn off_fv(&self, minimum: f64) -> f64 { minimum }
    }
    "shows-target-of-ramps" {
        fn shown_fv(&self, _level: f64, target: f64) -> f64 { target }
    }
    "results-cut" {
        fn pid_output(&self, response: u8, output: f64, error: f64) -> f64 {
            (pid::respond(response, output, error) * 10.0).trunc() / 10.0
        }
        fn saturated(&self, part: f64) -> f64 {
            (part.clamp(0.0, 1.0) * 10_000.0).trunc() / 10_000.0
        }
    }
    "math-of-percentages" {
        fn math_result(&self, operator: u8, a: f64, b: f64) -> f64 {
            math::operate(operator, 100.0 * a, 100.0 * b) / 100.0
        }
    }
    "math-inputs-limited" {
        fn math_input(&self, part: f64, gain: f64) -> f64 { part.clamp(0.0, 1.0) * gain }
    }
    "function-result-not-negative" {
        fn linked_result(&self, result: f64, gain: f64, _subtracts: bool) -> f64 {
            result.max(0.0) * gain
        }
    }
    "conditions-of-percentages" {
        fn condition(&self, operator: u8, _links: [Link; 2], arguments: [Signal; 2]) -> Verdict {
            let [a, b] = arguments.map(|signal| signal.limits);
            let percent = |signal: Signal| {
                let limits = signal.limits.or(a).or(b).unwrap_or((0.0, 100.0));
                Signal { value: signal.percent(limits), ..signal }
            };
            logic::judge(operator, arguments.map(percent))
        }
    }
    "logic-state-is-drive-state" {
        fn digital_states(&self, _logic: bool, drive: bool) -> (bool, bool) { (drive, drive) }
    }
    "supply-never-wrong" {
        fn supply_errors(&self, _volts: f64) -> (bool, bool) { (false, false) }
    }
    "open-circuit-is-input-fault" {
        fn fault_group(&self) -> Option<u8> { Some(3) }
    }
    "half-of-the-range-is-on" {
        fn is_on(&self, signal: Signal) -> bool {
            let (low, high) = signal.limits.unwrap_or((0.0, 1.0));
            share(signal.value, low, high) >= 0.5
        }
    }
    "outputs-need-operational" {
        fn outputs_need_operational(&self) -> bool { true }
    }
    "tpdos-on-change" {
        fn sends_on_change(&self) -> bool { true }
    }
    "first-output-sets-the-bank" {
        fn frequency_is_shared(&self) -> bool { false }
        fn place(&self, index: u16, place: usize) -> usize {
            if index == OUTPUT_FREQUENCY { self.bank(place) * 4 } else { place }
        }
    }
    "updates-for-currents-only" {
        fn updates(&self, enabled: bool, kind: Kind) -> bool { enabled && kind == Kind::Current }
    }
    "source-spreads-points" {
        fn source_spreads_points(&self) -> bool { true }
    }
    "first-point-not-shown" {
        fn first_point(&self, item: u16) -> Option<i64> { (item == 3).then_some(0) }
    }
    "jump-begins-with-its-point" {
        fn is_before_table(&self, x: f64, first: f64) -> bool { x < first }
        fn within_segment(&self, x: f64, point: f64) -> bool { x < point }
    }
    "nothing-below-the-table" {
        fn below_table(&self, x: f64, first: (f64, f64)) -> f64 {
            let (start, first) = first;
            if x < start { 0.0 } else { first }
        }
    }
    "selection-stays" {
        fn keeps_selection(&self) -> bool { true }
    }
    "takes-any-point" {
        fn refused(&self, mux: Mux, abort: Abort) -> Result<(), Abort> {
            match table_of(mux.index) {
                Some((_, 6)) => Ok(()),
                _ => self.0.refused(mux, abort),
            }
        }
    }
    "takes-an-integral-time-of-0" {
        fn refused(&self, mux: Mux, abort: Abort) -> Result<(), Abort> {
            match (mux.index, abort) {
                (PID_INTEGRAL_TIME, Abort::TOO_LOW) => Ok(()),
                _ => self.0.refused(mux, abort),
            }
        }
    }
    "hotshot-currents-apart" {
        fn refused(&self, mux: Mux, abort: Abort) -> Result<(), Abort> {
            match (mux.index, abort) {
                (HOTSHOT_CURRENT, Abort::TOO_LOW) | (HOLD_CURRENT, Abort::TOO_HIGH) => Ok(()),
                _ => self.0.refused(mux, abort),
            }
        }
    }
};
