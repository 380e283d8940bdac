//! Every decision of the function blocks that a test can observe.

mod deviations;
mod digital;
mod inputs;
mod parameters;
mod results;

use std::time::Duration;

use canopen::{Abort, Mux};

use super::load::{Driven, Stage};
use super::logic::{self, Verdict};
use super::math;
use super::output::{self, Command, Disabled, Interventions, Kind};
use super::pid::{self, Gains};
use super::ramp::Ramp;
use super::signal::{self, Link, Signal};
use super::table::{self, POINTS};
use crate::decisions::{Layers, in_code_alone};

use digital::DigitalDecision;

/// All decisions of a controller; clauses are those of its manual.
pub(super) type Ax021211Rules = Layers<Otherwise>;

parts! {
    /// A decision of a controller that is taken otherwise.
    pub(super) Otherwise:
    Block(Decision),
    Digital(DigitalDecision),
}

in_code_alone! { Command, Disabled, Link, Ramp, Stage, Verdict }

decisions! {
    /// The decisions. The default methods are what the manual says; one that is *chosen* fills a
    /// gap of it, and other devices may choose otherwise.
    pub(super) Decision of Ax021211Rules, otherwise [
        deviations::DEVIATIONS,
        inputs::DEVIATIONS,
        results::DEVIATIONS,
        parameters::DEVIATIONS,
    ];

    /// A parameter is in force as it is written.
    fn parameter(&self, _mux: Mux, configured: i64) -> i64 {
        configured
    }

    /// Each block has parameters of its own.
    fn place(&self, _index: u16, place: usize) -> usize {
        place
    }

    /// A control input is on when it is not zero.
    fn is_on(&self, signal: Signal) -> bool {
        signal.value != 0.0
    }

    /// The outputs drive in every state of the node. Chosen.
    fn outputs_need_operational(&self) -> bool {
        false
    }

    /// TPDOs are driven by time (2.2.15).
    fn sends_on_change(&self) -> bool {
        false
    }

    /// A value out of the range that other objects give it is refused (tables 3 and 5, 2.2.10, 2.3,
    /// 2.4).
    fn refused(&self, _mux: Mux, abort: Abort) -> Result<(), Abort> {
        Err(abort)
    }

    /// The scaling that 2311h is a tenth of at most (2.4.9).
    fn larger_scaling(&self, fv1: i64, fv2: i64) -> i64 {
        fv1.max(fv2)
    }

    /// The type of each output is known from the start, so that the next one is a change (1.3).
    fn reads_types_at_a_start(&self) -> bool {
        true
    }

    /// An open circuit at any output is a reason to change the state (2.2.13).
    fn reacts(&self, _place: usize) -> bool {
        true
    }

    /// Everything that an RPDO carries has an error when it fails to come (1.2, 2.2.14).
    fn is_supervised(&self, _rpdo: u16, _sub: u8) -> bool {
        true
    }

    /// Fault mode 0 keeps the present level of the output, not the level it is moving to (1.3,
    /// table 10).
    fn kept_on_fault(&self, level: f64, _target: f64, _asked: f64) -> f64 {
        level
    }

    // Sources

    /// Tables 4 and 5.
    fn link(&self, link: Link) -> Link {
        link
    }

    /// An input of an output takes the message that its number names (2.4.19, 2.4.22).
    fn input_link(&self, link: Link, _source_index: u16, _place: usize) -> Link {
        link
    }

    /// A written value is in force at once.
    fn takes_over(&self, _index: u16) -> bool {
        true
    }

    /// Each block has settings of its own; a kind of blocks is named by the first of its objects.
    fn block(&self, _kind: u16, place: usize) -> usize {
        place
    }

    /// Where a value is between two limits (tables 5 and 6).
    fn share(&self, value: f64, low: f64, high: f64) -> f64 {
        signal::share(value, low, high)
    }

    /// The supply in volts and the temperature in degrees Celsius (2.4.79, 2.4.80).
    fn measured(&self, volts: f64, degrees: f64) -> (f64, f64) {
        (volts, degrees)
    }

    /// After a reset no block knows what was before. Chosen.
    fn forgets(&self) -> bool {
        true
    }

    /// A message controls a digital output by a bit of 6200h, whatever the output of that number
    /// is, and any other by its process value (1.2, table 5).
    fn takes_a_bit(&self, is_digital: bool, _numbered_is_digital: bool) -> bool {
        is_digital
    }

    /// Every other input takes a message as a process value, also that of a digital output
    /// (table 5).
    fn others_take_a_bit(&self, _numbered_is_digital: bool) -> bool {
        false
    }

    /// The bit of 6200h that belongs to an output (1.2).
    fn write_state(&self, states: i64, place: usize) -> bool {
        states >> place & 1 != 0
    }

    /// A received value is copied while its status is 1 (2.3.17).
    fn takes_received(&self, status: i64) -> bool {
        status == 1
    }

    /// The status falls back when the value is copied (2.3.17).
    fn status_after_copy(&self, _changed: bool) -> i64 {
        0
    }

    /// A value that came before its validation is not copied (2.3.17).
    fn copies_with_the_validation(&self) -> bool {
        false
    }

    /// A copy that comes with its validation leaves 6F52h as it was written (2.3.17).
    fn copy_ends_each_validation(&self) -> bool {
        false
    }

    /// The values of an RPDO that has timed out are in error (1.1, 2.2.14).
    fn message_fails(&self, timed_out: bool) -> bool {
        timed_out
    }

    /// The sub-index of 1029h for an open or short circuit (2.2.13).
    fn fault_group(&self) -> Option<u8> {
        Some(5)
    }

    /// The sub-index of 1029h for a supply that is too high or too low. 2.2.13 names such faults
    /// without one; that there is none is chosen.
    fn supply_group(&self) -> Option<u8> {
        None
    }

    /// A source whose measurement is wrong is in an error state: a supply out of its range, and the
    /// feedback of an output with an open or short circuit. Chosen.
    fn source_fails(&self, wrong: bool) -> bool {
        wrong
    }

    /// The channel of an emergency message (table 22).
    fn channel(&self, place: usize) -> u8 {
        place as u8 + 1
    }

    /// The supply is 9 to 60 V (3.1): whether it is too low, and too high. That these are the
    /// limits of 2.2.4 is chosen.
    fn supply_errors(&self, volts: f64) -> (bool, bool) {
        (volts < 9.0, volts > 60.0)
    }

    /// The outputs that a change of 2380h is for share a timer (1.3).
    fn bank(&self, place: usize) -> usize {
        place / 4
    }

    /// A value that is written for one output of a bank is shown for each of them (1.3).
    fn frequency_is_shared(&self) -> bool {
        true
    }

    /// The frequency of a bank is fixed while one of its outputs has a current loop (1.3).
    fn frequency(&self, configured: i64, has_loop: bool) -> i64 {
        if has_loop { 25_000 } else { configured }
    }

    /// A change of the type brings the defaults of the new one while 5550h is true (1.3, 1.8).
    fn updates(&self, enabled: bool, _kind: Kind) -> bool {
        enabled
    }

    /// Writing the type that an output has already is no change (1.8).
    fn updates_with_the_same_type(&self) -> bool {
        false
    }

    /// The default of an object of the output for its new type (1.3, 1.8).
    fn type_default(&self, mux: Mux, value: i64) -> (Mux, i64) {
        (mux, value)
    }

    // Lookup table

    /// A table whose source is in an error state holds its value. Chosen.
    fn table_in_error(&self, held: f64) -> f64 {
        held
    }

    /// A table without source has no output. Chosen.
    fn table_without_source(&self, _held: i64) -> i64 {
        0
    }

    /// A new source leaves the X-axis to the user (1.5).
    fn source_spreads_points(&self) -> bool {
        false
    }

    /// The responses of table 12.
    fn point_response(&self, code: u8) -> u8 {
        code
    }

    /// 3yz2h (1.5.4).
    fn repeats(&self, configured: bool) -> bool {
        configured
    }

    /// Ignored points count for the limits (1.5.2).
    fn points_of_limits(&self, _in_use: usize) -> usize {
        POINTS
    }

    /// The limits are those of a percentage or the ends of the Y-axis (1.5.2).
    fn table_limits(&self, low: f64, high: f64) -> (f64, f64) {
        table::limits_of(low, high)
    }

    /// An ignored point takes all that follow with it (1.5.3).
    fn points_in_use(&self, before_ignored: usize) -> usize {
        before_ignored
    }

    /// A segment ends with its point (1.5.3).
    fn within_segment(&self, x: f64, point: f64) -> bool {
        x <= point
    }

    /// At the first point no segment has begun.
    fn is_before_table(&self, x: f64, first: f64) -> bool {
        x <= first
    }

    /// Up to the first point the output is that of the first point.
    fn below_table(&self, _x: f64, first: (f64, f64)) -> f64 {
        first.1
    }

    /// Ignored points are no end of a table, not even beyond all of them (1.5.3).
    fn end_of_table(&self, in_use: usize, _beyond_all: bool) -> usize {
        in_use
    }

    /// Beyond the last point the output is that of the last point (1.5.3).
    fn beyond_table(&self, last: f64) -> f64 {
        last
    }

    /// A jump is to the point that the segment leads to (1.5.3).
    fn jump(&self, _from: f64, to: f64) -> f64 {
        to
    }

    /// The X-axis of a time response has intervals (1.5.4).
    fn interval(&self, _before: f64, point: f64) -> f64 {
        point
    }

    /// A profile that is over leaves its last output (1.5.4).
    fn after_sequence(&self, last: f64) -> f64 {
        last
    }

    /// A profile always begins at its first point (1.5.4).
    fn sequence_begins_anew(&self) -> bool {
        true
    }

    /// While the input is off, the output is zero (1.5.4).
    fn sequence_off(&self, _held: f64) -> f64 {
        0.0
    }

    /// The X-axis is in the unit of the source (1.5.1).
    fn table_input(&self, x: f64, _repeats: bool) -> f64 {
        x
    }

    /// A profile begins when its input comes on (1.5.4).
    fn sequence_runs(&self, on: bool) -> bool {
        on
    }

    /// A time response sets the first point and the digits of its X-axis to 0 (1.5.4), by the last
    /// digit of the object.
    fn first_point(&self, _item: u16) -> Option<i64> {
        Some(0)
    }

    /// The X-axis of a time response has no decimal digits (1.5.4).
    fn digits_of_time(&self, _digits: u8) -> u8 {
        0
    }

    /// The limits of an X-axis are those of its source (1.5.1).
    fn x_limits(&self, limits: Option<(f64, f64)>) -> Option<(f64, f64)> {
        limits
    }

    /// A point of an X-axis lies between the points beside it in the same table (1.5.1).
    fn neighbours(&self, place: usize) -> usize {
        place
    }

    /// It may be equal to them (1.5.1).
    fn x_range(&self, low: i64, high: i64) -> (i64, i64) {
        (low, high)
    }

    // PID control

    /// The times of 6459h (1.4).
    fn pid_time(&self, seconds: f64) -> f64 {
        seconds
    }

    /// A loop needs a target and a feedback (1.4).
    fn pid_is_enabled(&self, both: bool, _links: [Link; 2]) -> bool {
        both
    }

    /// Target less feedback (figure 8).
    fn pid_error(&self, target: f64, feedback: f64) -> f64 {
        target - feedback
    }

    /// A difference smaller than the tolerance is none (1.4).
    fn is_tolerated(&self, difference: f64, tolerance: f64) -> bool {
        difference < tolerance
    }

    /// How much of a difference counts (1.4).
    fn counted(&self, difference: f64, _tolerance: f64, tolerated: bool) -> f64 {
        if tolerated { 0.0 } else { difference }
    }

    /// Target and feedback are percentages of the limits of their sources (1.4).
    fn percent(&self, signal: Signal, limits: (f64, f64)) -> f64 {
        signal.percent(limits)
    }

    /// A loop with an input in an error state is at 0 and forgets its sum. Chosen.
    fn pid_forgets_in_error(&self) -> bool {
        true
    }

    /// A loop that has its sources back runs again (1.4).
    fn pid_resumes(&self) -> bool {
        true
    }

    /// The gains of figure 8.
    fn pid_gains(&self, gains: Gains, cycle: f64) -> (f64, f64, f64) {
        gains.of_cycle(cycle)
    }

    /// The sum of figure 8.
    fn error_sum(&self, sum: f64, error: f64) -> f64 {
        sum + error
    }

    /// The difference of two errors (figure 8).
    fn error_step(&self, error: f64, last: f64) -> f64 {
        error - last
    }

    /// While the error is none the output stops changing, so the loop stays on its side of the
    /// target (2.4.29).
    fn pid_side(&self, side: f64, error: f64) -> f64 {
        if error == 0.0 { side } else { error }
    }

    /// The responses of table 11, and the range of the output (2.4.37).
    fn pid_output(&self, response: u8, output: f64, side: f64) -> f64 {
        pid::respond(response, output, side)
    }

    /// A target without limits has those of the feedback (1.4).
    fn target_limits(&self, own: Option<(f64, f64)>, of_feedback: (f64, f64)) -> (f64, f64) {
        own.unwrap_or(of_feedback)
    }

    /// A loop that is disabled commands nothing. Chosen.
    fn pid_disabled(&self, _held: i64) -> i64 {
        0
    }

    // Math

    /// A block that is not enabled is at 0, even if its scaling begins elsewhere (2.4.65).
    fn math_off(&self, _low: f64) -> f64 {
        0.0
    }

    /// A gain has two digits (2.4.76).
    fn gain(&self, configured: i64) -> f64 {
        configured as f64 / 100.0
    }

    /// A block that is not enabled is at 0 (2.4.65).
    fn math_is_enabled(&self, configured: bool) -> bool {
        configured
    }

    /// There are three functions (1.7).
    fn functions(&self) -> usize {
        3
    }

    /// Only of its own block an input can take a function (1.7).
    fn is_own_block(&self, is_own: bool) -> bool {
        is_own
    }

    /// A function needs both inputs (1.7).
    fn function_counts(&self, inputs: [bool; 2]) -> bool {
        inputs[0] && inputs[1]
    }

    /// The result of a function as an input: a negative difference counts as 0 unless it is
    /// multiplied by a negative number (1.7).
    fn linked_result(&self, result: f64, gain: f64, subtracts: bool) -> f64 {
        let linked = result * gain;
        if subtracts { linked.max(0.0) } else { linked }
    }

    /// The first of a pair is InA (1.7).
    fn function_inputs(&self, inputs: [f64; 2]) -> [f64; 2] {
        inputs
    }

    /// The functions of table 19.
    fn math_result(&self, operator: u8, a: f64, b: f64) -> f64 {
        math::operate(operator, a, b)
    }

    /// The last function that counts is the result of the block (1.7).
    fn block_result(&self, _before: Option<f64>, result: f64) -> Option<f64> {
        Some(result)
    }

    /// The output saturates (1.7).
    fn saturated(&self, part: f64) -> f64 {
        part.clamp(0.0, 1.0)
    }

    /// The scaling takes the value as it is (1.7).
    fn value_before_scaling(&self, value: f64, _gain: f64) -> f64 {
        value
    }

    /// An input is a part of its scaling before it gets its gain (1.7).
    fn math_input(&self, part: f64, gain: f64) -> f64 {
        part * gain
    }

    /// An input in error counts as 0 in the function, whatever a 0 of its source is (1.7).
    fn math_input_in_error(&self, _value: f64, _of_zero: f64) -> f64 {
        0.0
    }

    // Logic

    /// 3300h (1.6).
    fn logic_is_enabled(&self, configured: bool) -> bool {
        configured
    }

    /// Only an evaluation selects a table (2.4.51, 2.4.52). Chosen: a block that is off keeps the
    /// last one, before the first evaluation table A.
    fn selected_while_disabled(&self, selected: u8) -> u8 {
        selected
    }

    /// The results of table 15.
    fn condition(&self, operator: u8, _links: [Link; 2], arguments: [Signal; 2]) -> Verdict {
        logic::judge(operator, arguments)
    }

    /// The first table whose conditions hold, or else table A (1.6.2).
    fn selection(&self, selects: [bool; 3]) -> usize {
        selects.iter().position(|selects| *selects).unwrap_or(0)
    }

    /// Where no conditions hold, the table that was selected last does not matter (1.6.2).
    fn keeps_selection(&self) -> bool {
        false
    }

    /// 3310h is the number of the lookup table (1.6.2).
    fn selected_table(&self, number: u8, _chosen: usize) -> u8 {
        number
    }

    /// With a table that has no source there is no output (1.6.3).
    fn logic_is_available(&self, has_output: bool) -> bool {
        has_output
    }

    /// The output is a percentage of the range of the table (1.6.3).
    fn logic_percent(&self, signal: Signal) -> f64 {
        signal.percent(signal.limits.unwrap_or((0.0, 100.0)))
    }

    // Output

    /// An input in error is a fault of the output, whichever of the three it is (1.2).
    fn input_fault(&self, inputs: [bool; 3]) -> bool {
        let [control, enable, overriding] = inputs;
        control || enable || overriding
    }

    /// An input without a source, 1 for enable and 2 for override, has no say (1.3).
    fn absent(&self, _input: usize) -> Option<bool> {
        None
    }

    /// Without a control source an output is off. Chosen.
    fn uncontrolled(&self, _level: f64) -> f64 {
        0.0
    }

    /// 7320h and 7322h have the digits of 6302h (2.3.8).
    fn digits_of_scaling(&self, digits: u8) -> u8 {
        digits
    }

    /// The order of figure 6.
    fn decide(&self, found: Interventions, control: Signal) -> Command {
        output::decide(found, control)
    }

    /// 6250h and 6340h: a fault leaves the output as it was (tables 2 and 10).
    fn keeps(&self, configured: bool) -> bool {
        configured
    }

    /// 6260h (1.2).
    fn fault_state(&self, configured: bool) -> bool {
        configured
    }

    /// An output that is shut or ramped off is at 0 (table 8).
    fn off_fv(&self, _minimum: f64) -> f64 {
        0.0
    }

    /// 7330h shows what the ramps make of the target (1.3).
    fn shown_fv(&self, level: f64, _target: f64) -> f64 {
        level
    }

    /// An override brings the output to 2300h (1.3).
    fn override_fv(&self, configured: f64, _level: f64) -> f64 {
        configured
    }

    /// A digital output has no control response (2.4.17).
    fn is_digital_off(&self, _response: u8, _pv: f64, _limits: (f64, f64)) -> bool {
        false
    }

    /// The responses of table 7.
    fn is_off(&self, response: u8, pv: f64, limits: (f64, f64)) -> bool {
        let (low, high) = limits;
        response == 1 && pv < low || response == 2 && pv > high
    }

    /// The field value holds at its ends (figure 5).
    fn held_part(&self, part: f64) -> f64 {
        part.clamp(0.0, 1.0)
    }

    /// At a process value of zero the output is smaller by the static bias (1.3).
    fn biased(&self, fv: f64, pv: f64, bias: f64) -> f64 {
        if pv == 0.0 { fv - bias } else { fv }
    }

    /// Ramps jump over the static bias, and begin at 0 where there is none (1.3).
    fn ramp_bias(&self, bias: f64, _minimum: f64) -> f64 {
        bias
    }

    /// The way that the ramp times are for (1.3).
    fn ramp_span(&self, fv1: f64, fv2: f64, _largest: f64) -> f64 {
        (fv2 - fv1).abs()
    }

    /// 2330h is for the way up and 2331h for the way down (2.4.13, 2.4.14).
    fn ramp(&self, ramp: Ramp) -> Ramp {
        ramp
    }

    /// The control input is followed on ramps, and an output may ramp off; all else is at once
    /// (1.3).
    fn is_ramped(&self, command: Command) -> bool {
        matches!(command, Command::Control(_) | Command::Disabled(Disabled::RampOff))
    }

    /// The output stage does what was commanded; a dither leaves the mean unchanged.
    fn stage(&self, stage: Stage, _dither: f64) -> Stage {
        stage
    }

    /// 2370h of a type without measurement shows the target (2.4.24).
    fn feedback_without_current(&self, level: i64, _driven: Driven) -> i64 {
        level
    }

    /// 7330h shows the logic state, 2370h the drive state (1.2, table 5).
    fn digital_states(&self, logic: bool, drive: bool) -> (bool, bool) {
        (logic, drive)
    }

    /// A short circuit, or a feedback out of the tolerance, while the output drives (1.3).
    fn is_wrong(&self, drives: bool, shorted: bool, difference: f64, tolerance: f64) -> bool {
        drives && (shorted || difference > tolerance)
    }

    /// Only a current is watched (3.2).
    fn watches(&self, is_current: bool) -> bool {
        is_current
    }

    /// The feedback is compared with the field value, on a ramp, too (1.3).
    fn difference(&self, fv: f64, _target: f64, feedback: f64, _seen: (Driven, f64)) -> f64 {
        (fv - feedback).abs()
    }

    /// 2312h (2.4.10).
    fn reaction_delay(&self, configured: Duration) -> Duration {
        configured
    }

    /// A fault that was gone restarts its reaction delay (2.4.10).
    fn detection_begins_anew(&self) -> bool {
        true
    }

    /// A fault ends when the feedback is within the tolerance again (1.3).
    fn error_ends(&self) -> bool {
        true
    }
}
