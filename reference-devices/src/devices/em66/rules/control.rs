//! The decisions of the controller block (3.2) and of the ramps (3.4.14).

use canopen::Mux;

use super::Em66Rules;
use crate::devices::em66::codes::Codes;

/// The activity of the controller while the limits of the output hold.
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
    pub(crate) ControlDecision of Em66Rules, otherwise [DEVIATIONS];

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

    /// A positive deviation is heated, a negative one is cooled (3.2).
    fn missing(&self, missing: f64) -> f64 {
        missing
    }

    /// A controller that is off neither heats nor cools (3.2.1).
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

    /// The limits are the same in every activity of the controller (3.2, 6413h, 6414h).
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

    /// The set point in force rises while the chosen one is above it, whatever was chosen before
    /// (3.4.14). Temperatures in tenths of a degree.
    fn ramp_rises(&self, chosen: f64, present: f64, _former: f64) -> bool {
        chosen > present
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

    /// The way back from the second set point is a ramp as any other (3.4.14).
    fn ramps_back_from_second(&self) -> bool {
        true
    }

    /// The way to the second set point is a ramp, too (3.4.14).
    fn ramps_to_second(&self) -> bool {
        true
    }
}

deviations! {
    pub(super) DEVIATIONS of ControlDecision;

    // Objects
    "unit-of-temperatures-changes" => is_fixed: |_, mux| mux.index != 0x6406;
    "digits-of-temperatures-change" => is_fixed: |_, mux| mux.index != 0x6407;
    "unit-of-output-changes" => is_fixed: |_, mux| mux.index != 0x6415;
    "digits-of-output-change" => is_fixed: |_, mux| mux.index != 0x6416;
    "effective-value-in-whole-degrees" => effective_value: |_, celsius| celsius / 10 * 10;
    "effective-value-in-degrees" => effective_value: |_, celsius| celsius / 10;

    // Set points
    "effective-set-point-is-the-chosen-one" => set_point_shown: |_, _, chosen, _| chosen;
    "no-set-point-while-off" =>
        set_point_shown: |_, in_force, _, on| if on { in_force.round() as i64 } else { 0 };

    // Output
    "heats-what-is-too-hot" => missing: |_, missing| -missing;
    "never-heats" => missing: |_, missing| missing.min(0.0);
    "never-cools" => missing: |_, missing| missing.max(0.0);
    "output-stays-when-off" => output_while_off: |_, last| last;
    "output-in-whole-percent" => output_shown: |_, output| output / 10;
    "output-of-cooling-without-sign" => output_shown: |_, output| output.abs();
    "output-of-cooling-is-zero" => output_shown: |_, output| output.max(0);
    "lower-limit-ignored" => output_limits: |_, _, high| (-1000, high);
    "upper-limit-ignored" => output_limits: |_, low, _| (low, 1000);

    "lower-limit-not-in-manual-mode" => limits_while: |_, activity, low, high| {
        if activity == Activity::Manual { (-1000, high) } else { (low, high) }
    };
    "upper-limit-not-in-manual-mode" => limits_while: |_, activity, low, high| {
        if activity == Activity::Manual { (low, 1000) } else { (low, high) }
    };
    "upper-limit-not-in-self-optimisation" => limits_while: |_, activity, low, high| {
        if activity == Activity::Tuning { (low, 1000) } else { (low, high) }
    };
    "cools-down-without-limit" => limits_while: |_, activity, low, high| {
        if activity == Activity::CoolingDown { (-1000, high) } else { (low, high) }
    };
    "manual-mode-of-the-first-set-point-only" => is_manual: |_, asked, second| asked && !second;

    // Self-optimisation
    "self-optimisation-request-forgotten-while-on-only" =>
        tuning_answered: |_, answered, wanted, on| answered && (wanted || !on);
    "self-optimisation-while-off" => tunes: |_, asked, _, manual, _| asked && !manual;
    "self-optimisation-outlives-its-bit" =>
        tunes: |_, asked, on, manual, tuning| (asked || tuning) && on && !manual;
    "self-optimisation-outlives-the-controller" =>
        tunes: |_, asked, on, manual, tuning| if on { asked && !manual } else { tuning };
    "self-optimisation-in-manual-mode" => tunes: |_, asked, on, _, _| asked && on;

    // Status
    "status-on-inverted" => status_shown: |_, bits, codes| bits ^ codes.status_on;
    "status-without-self-optimisation" => status_shown: |_, bits, codes| bits & !codes.status_tune;
    "status-without-manual-mode" => status_shown: |_, bits, codes| bits & !codes.status_manual;
    "status-always-manual" => status_shown: |_, bits, codes| bits | codes.status_manual;
    "status-without-second-set-point" => status_shown: |_, bits, codes| bits & !codes.status_second;
    "status-always-second-set-point" => status_shown: |_, bits, codes| bits | codes.status_second;

    // Ramps
    "heating-ramp-ignored" => rates: |_, _, cooling| (0, cooling);
    "cooling-ramp-ignored" => rates: |_, heating, _| (heating, 0);
    "heating-ramp-per-second" => rates: |_, heating, cooling| (heating * 60, cooling);
    "cooling-ramp-per-second" => rates: |_, heating, cooling| (heating, cooling * 60);
    "ramps-in-hundredths" => rates: |_, heating, cooling| (heating / 10, cooling / 10);
    "heating-ramp-in-whole-kelvin" => rates: |_, heating, cooling| (heating / 10, cooling);
    "no-heating-ramp-is-a-slow-one" => rates: |_, heating, cooling| (heating.max(1), cooling);
    "no-cooling-ramp-is-a-slow-one" => rates: |_, heating, cooling| (heating, cooling.max(1));
    "one-ramp-for-both-ways" =>
        rates: |_, heating, cooling| (heating.max(cooling), heating.max(cooling));
    "ramp-begins-at-the-set-point" => ramp_start: |_, _, chosen| chosen;
    "ramp-begins-at-zero-or-above" => ramp_start: |_, effective, _| effective.max(0);
    "ramp-direction-from-the-former-set-point" =>
        ramp_rises: |_, chosen, _, former| chosen > former;
    "ramp-steps-beyond-its-end" => ramp_step: |_, missing, step| step.copysign(missing);
    "first-set-point-shown-while-off" => set_point_while_off: |_, _, first| first;
}
