//! The decisions of the controller block (3.2) and of the ramps (3.4.14).

use canopen::Mux;

use super::{AlarmRules, Em66Rules, FaultRules, Layer, OperationRules, ValueRules};
use crate::devices::deviating::{Deviation, deviating};
use crate::devices::em66::codes::Codes;

/// What the controller is doing while the limits of the output hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Activity {
    /// Manual mode holds the output.
    Manual,
    /// Self-optimisation makes the process swing.
    Tuning,
    /// It cools down before it is off.
    CoolingDown,
}

decisions! {
    /// The decisions of the controller block (3.2) and of the ramps (3.4.14).
    pub(crate) trait ControlRules: Layer;

    /// Temperatures are degrees Celsius with one digit, the output is a percentage with one digit;
    /// no other unit is taken (3.2).
    fn is_fixed(&self, _mux: Mux) -> bool {
        true
    }

    /// 7400h is the value that is controlled (3.2).
    fn effective_value(&self, celsius: i64) -> i64 {
        celsius
    }

    /// A bit of 6425h makes the second set point the one in force (3.2.1).
    fn second_set_point(&self, asked: bool) -> bool {
        asked
    }

    /// 7401h is the set point in force with its ramp; while the controller is off, the chosen one
    /// (3.2).
    fn set_point_shown(&self, in_force: f64, _chosen: i64, _on: bool) -> i64 {
        in_force.round() as i64
    }

    /// What is missing is heated, what is too much is cooled (3.2).
    fn missing(&self, missing: f64) -> f64 {
        missing
    }

    /// Whoever is off neither heats nor cools (3.2.1).
    fn output_while_off(&self, _last: i64) -> i64 {
        0
    }

    /// 6410h is the output in tenths of a percent, cooling in two's complement (3.2).
    fn output_shown(&self, output: i64) -> i64 {
        output
    }

    /// 6413h limits cooling and 6414h heating (3.2).
    fn output_limits(&self, low: i64, high: i64) -> (i64, i64) {
        (low, high)
    }

    /// In manual mode the output stays as it was (3.2.2).
    fn manual_holds(&self) -> bool {
        true
    }

    /// The limits are the same whatever the controller is doing (3.2, 6413h, 6414h).
    fn limits_while(&self, _activity: Activity, low: i64, high: i64) -> (i64, i64) {
        (low, high)
    }

    /// Manual mode is one of either set point (3.2, 6423h).
    fn is_manual(&self, asked: bool, _second: bool) -> bool {
        asked
    }

    /// A controller whose sensor tells nothing can be switched off like any other (3.2.1).
    fn goes_on_without_sensor(&self) -> bool {
        true
    }

    /// A request for self-optimisation is answered until it goes or the controller is off (3.2.1).
    fn tuning_answered(&self, answered: bool, wanted: bool, _on: bool) -> bool {
        answered && wanted
    }

    /// While the controller is off, the set point that is selected is shown (3.2, 7401h).
    fn set_point_while_off(&self, chosen: i64, _first: i64) -> i64 {
        chosen
    }

    /// The last step of a ramp ends at the set point (3.4.14).
    fn ramp_step(&self, missing: f64, step: f64) -> f64 {
        missing.clamp(-step, step)
    }

    /// Self-optimisation goes on while it is asked for, in automatic mode and while the controller
    /// is on (3.2.1).
    fn tunes(&self, asked: bool, on: bool, manual: bool, _tuning: bool) -> bool {
        asked && on && !manual
    }

    /// 6427h (3.2.2).
    fn status_shown(&self, bits: i64, _codes: &Codes) -> i64 {
        bits
    }

    /// 3060h is how fast the set point rises and 3070h how fast it falls (3.4.14).
    fn rates(&self, heating: i64, cooling: i64) -> (i64, i64) {
        (heating, cooling)
    }

    /// At switch-on the ramp begins at the effective value (3.4.14).
    fn ramp_start(&self, effective: i64, _chosen: i64) -> i64 {
        effective
    }

    /// A ramp goes on from where it is when another set point is chosen (3.4.14).
    fn ramp_goes_on(&self) -> bool {
        true
    }

    /// The way to the second set point is a ramp, too (3.4.14).
    fn ramps_to_second(&self) -> bool {
        true
    }
}

pub(super) const DEVIATIONS: &[Deviation<dyn Em66Rules>] = deviating! {
    dyn Em66Rules: ControlRules [Em66Rules AlarmRules OperationRules FaultRules ValueRules];

    // Objects
    "unit-of-temperatures-changes" {
        fn is_fixed(&self, mux: Mux) -> bool { mux.index != 0x6406 }
    }
    "digits-of-temperatures-change" {
        fn is_fixed(&self, mux: Mux) -> bool { mux.index != 0x6407 }
    }
    "unit-of-output-changes" {
        fn is_fixed(&self, mux: Mux) -> bool { mux.index != 0x6415 }
    }
    "digits-of-output-change" {
        fn is_fixed(&self, mux: Mux) -> bool { mux.index != 0x6416 }
    }
    "effective-value-in-whole-degrees" {
        fn effective_value(&self, celsius: i64) -> i64 { celsius / 10 * 10 }
    }
    "effective-value-in-degrees" {
        fn effective_value(&self, celsius: i64) -> i64 { celsius / 10 }
    }

    // Set points
    "second-set-point-ignored" {
        fn second_set_point(&self, _asked: bool) -> bool { false }
    }
    "second-set-point-always" {
        fn second_set_point(&self, _asked: bool) -> bool { true }
    }
    "effective-set-point-is-the-chosen-one" {
        fn set_point_shown(&self, _in_force: f64, chosen: i64, _on: bool) -> i64 { chosen }
    }
    "no-set-point-while-off" {
        fn set_point_shown(&self, in_force: f64, _chosen: i64, on: bool) -> i64 {
            if on { in_force.round() as i64 } else { 0 }
        }
    }

    // Output
    "heats-what-is-too-hot" {
        fn missing(&self, missing: f64) -> f64 { -missing }
    }
    "never-heats" {
        fn missing(&self, missing: f64) -> f64 { missing.min(0.0) }
    }
    "never-cools" {
        fn missing(&self, missing: f64) -> f64 { missing.max(0.0) }
    }
    "output-stays-when-off" {
        fn output_while_off(&self, last: i64) -> i64 { last }
    }
    "keeps-warm-while-off" {
        fn output_while_off(&self, _last: i64) -> i64 { 100 }
    }
    "output-in-whole-percent" {
        fn output_shown(&self, output: i64) -> i64 { output / 10 }
    }
    "output-of-cooling-without-sign" {
        fn output_shown(&self, output: i64) -> i64 { output.abs() }
    }
    "output-of-cooling-is-zero" {
        fn output_shown(&self, output: i64) -> i64 { output.max(0) }
    }
    "lower-limit-ignored" {
        fn output_limits(&self, _low: i64, high: i64) -> (i64, i64) { (-1000, high) }
    }
    "upper-limit-ignored" {
        fn output_limits(&self, low: i64, _high: i64) -> (i64, i64) { (low, 1000) }
    }
    "manual-mode-controls" {
        fn manual_holds(&self) -> bool { false }
    }

    "lower-limit-not-in-manual-mode" {
        fn limits_while(&self, activity: Activity, low: i64, high: i64) -> (i64, i64) {
            if activity == Activity::Manual { (-1000, high) } else { (low, high) }
        }
    }
    "upper-limit-not-in-self-optimisation" {
        fn limits_while(&self, activity: Activity, low: i64, high: i64) -> (i64, i64) {
            if activity == Activity::Tuning { (low, 1000) } else { (low, high) }
        }
    }
    "cools-down-without-limit" {
        fn limits_while(&self, activity: Activity, low: i64, high: i64) -> (i64, i64) {
            if activity == Activity::CoolingDown { (-1000, high) } else { (low, high) }
        }
    }
    "manual-mode-of-the-first-set-point-only" {
        fn is_manual(&self, asked: bool, second: bool) -> bool { asked && !second }
    }
    "stands-still-without-its-sensor" {
        fn goes_on_without_sensor(&self) -> bool { false }
    }

    // Self-optimisation
    "self-optimisation-request-forgotten-while-on-only" {
        fn tuning_answered(&self, answered: bool, wanted: bool, on: bool) -> bool {
            answered && (wanted || !on)
        }
    }
    "self-optimisation-ignored" {
        fn tunes(&self, _asked: bool, _on: bool, _manual: bool, _tuning: bool) -> bool { false }
    }
    "self-optimisation-while-off" {
        fn tunes(&self, asked: bool, _on: bool, manual: bool, _tuning: bool) -> bool {
            asked && !manual
        }
    }
    "self-optimisation-outlives-its-bit" {
        fn tunes(&self, asked: bool, on: bool, manual: bool, tuning: bool) -> bool {
            (asked || tuning) && on && !manual
        }
    }
    "self-optimisation-in-manual-mode" {
        fn tunes(&self, asked: bool, on: bool, _manual: bool, _tuning: bool) -> bool {
            asked && on
        }
    }

    // Status
    "status-on-inverted" {
        fn status_shown(&self, bits: i64, codes: &Codes) -> i64 { bits ^ codes.status_on }
    }
    "status-without-self-optimisation" {
        fn status_shown(&self, bits: i64, codes: &Codes) -> i64 { bits & !codes.status_tune }
    }
    "status-without-manual-mode" {
        fn status_shown(&self, bits: i64, codes: &Codes) -> i64 { bits & !codes.status_manual }
    }
    "status-always-manual" {
        fn status_shown(&self, bits: i64, codes: &Codes) -> i64 { bits | codes.status_manual }
    }
    "status-without-second-set-point" {
        fn status_shown(&self, bits: i64, codes: &Codes) -> i64 { bits & !codes.status_second }
    }
    "status-always-second-set-point" {
        fn status_shown(&self, bits: i64, codes: &Codes) -> i64 { bits | codes.status_second }
    }

    // Ramps
    "heating-ramp-ignored" {
        fn rates(&self, _heating: i64, cooling: i64) -> (i64, i64) { (0, cooling) }
    }
    "cooling-ramp-ignored" {
        fn rates(&self, heating: i64, _cooling: i64) -> (i64, i64) { (heating, 0) }
    }
    "heating-ramp-per-second" {
        fn rates(&self, heating: i64, cooling: i64) -> (i64, i64) { (heating * 60, cooling) }
    }
    "cooling-ramp-per-second" {
        fn rates(&self, heating: i64, cooling: i64) -> (i64, i64) { (heating, cooling * 60) }
    }
    "ramps-in-hundredths" {
        fn rates(&self, heating: i64, cooling: i64) -> (i64, i64) { (heating / 10, cooling / 10) }
    }
    "heating-ramp-in-whole-kelvin" {
        fn rates(&self, heating: i64, cooling: i64) -> (i64, i64) { (heating / 10, cooling) }
    }
    "no-heating-ramp-is-a-slow-one" {
        fn rates(&self, heating: i64, cooling: i64) -> (i64, i64) { (heating.max(1), cooling) }
    }
    "no-cooling-ramp-is-a-slow-one" {
        fn rates(&self, heating: i64, cooling: i64) -> (i64, i64) { (heating, cooling.max(1)) }
    }
    "one-ramp-for-both-ways" {
        fn rates(&self, heating: i64, cooling: i64) -> (i64, i64) {
            (heating.max(cooling), heating.max(cooling))
        }
    }
    "ramp-begins-at-the-set-point" {
        fn ramp_start(&self, _effective: i64, chosen: i64) -> i64 { chosen }
    }
    "ramp-begins-at-zero" {
        fn ramp_start(&self, _effective: i64, _chosen: i64) -> i64 { 0 }
    }
    "ramp-begins-at-zero-or-above" {
        fn ramp_start(&self, effective: i64, _chosen: i64) -> i64 { effective.max(0) }
    }
    "ramp-rates-of-twelve-bits" {
        fn rates(&self, heating: i64, cooling: i64) -> (i64, i64) {
            (heating & 0xFFF, cooling & 0xFFF)
        }
    }
    "ramp-steps-beyond-its-end" {
        fn ramp_step(&self, missing: f64, step: f64) -> f64 { step.copysign(missing) }
    }
    "first-set-point-shown-while-off" {
        fn set_point_while_off(&self, _chosen: i64, first: i64) -> i64 { first }
    }
    "ramp-begins-anew-at-each-set-point" {
        fn ramp_goes_on(&self) -> bool { false }
    }
    "second-set-point-without-ramp" {
        fn ramps_to_second(&self) -> bool { false }
    }
};
