//! Every decision of the controller that a test can observe.

mod deviations;

use std::time::Duration;

use canopen::{Abort, Mux};

use super::switches::Switches;
use crate::decisions::{Layers, Taken};
use crate::devices::pixsys::led::Pattern;
use crate::stack::Attachment;

use deviations::tables;

/// All decisions of a controller; clauses are those of its manual.
pub(crate) type Rules = Layers<Decision>;

/// When and how fast a controller works, for which the manual gives no figures.
pub(crate) struct Figures {
    /// In seconds; 0 without a filter.
    derivative_filter: f64,
    control_cycle: Duration,
    samples_at_once: bool,
}

impl Figures {
    const fn new(derivative_filter: f64, millis: u64, samples_at_once: bool) -> Self {
        let control_cycle = Duration::from_millis(millis);
        Self { derivative_filter, control_cycle, samples_at_once }
    }

    /// These rules with the figures.
    pub(crate) fn of(&self, rules: Rules) -> Rules {
        let filter = Decision::derivative_filter(Taken::Is(self.derivative_filter));
        let cycle = Decision::control_cycle(Taken::Is(self.control_cycle));
        let samples = Decision::samples_at_once(Taken::Is(self.samples_at_once));
        rules.under(filter, None).under(cycle, None).under(samples, None)
    }
}

/// Between these and those of the decisions lies what a controller is expected to have.
pub(crate) const FIGURES: [Figures; 9] = [
    Figures::new(0.0, 100, true),
    Figures::new(0.0, 100, false),
    Figures::new(1.0, 100, true),
    Figures::new(1.0, 100, false),
    Figures::new(0.05, 10, true),
    Figures::new(0.2, 10, true),
    Figures::new(0.05, 100, false),
    Figures::new(0.2, 100, true),
    Figures::new(0.2, 100, false),
];

decisions! {
    /// The decisions. The default methods are a summary of what the manual says.
    pub(crate) Decision of Rules, otherwise [deviations::DEVIATIONS, tables::DEVIATIONS];

    /// A parameter is in force as it is written (11.3.2).
    fn parameter(&self, _sub: u8, configured: i64) -> i64 {
        configured
    }

    /// A stored parameter is in force from power-on, without being written again (7.1).
    fn waits_for_writing(&self, _sub: u8) -> bool {
        false
    }

    /// Degrees Celsius in the unit of sub 2 (11.3.2).
    fn degrees(&self, celsius: f64, unit: i64) -> f64 {
        match unit {
            1 => celsius * 1.8 + 32.0,
            2 => celsius + 273.15,
            _ => celsius,
        }
    }

    /// An alarm of this kind has the state of parameter 59 or 71 on an error (11.3.2). Cooling is a
    /// decision of its own, and kind 11 shows the error.
    fn alarm_knows_errors(&self, kind: i64) -> bool {
        !matches!(kind, 9 | 11)
    }

    /// Cooling is the output of an alarm, whose state on an error it has (11.3.2, subs 59 and 71).
    fn cooling_knows_errors(&self) -> bool {
        true
    }

    /// The state on an error is that of every command, proportional or not (11.3.2, sub 20).
    fn errors_concern(&self, _proportional: bool) -> bool {
        true
    }

    /// In STOP the command has its state of sub 21, in manual mode, too (11.3.2).
    fn manual_goes_on_in_stop(&self) -> bool {
        false
    }

    /// In STOP outputs have their states of STOP with a broken sensor, too (11.3.2).
    fn error_goes_before_stop(&self) -> bool {
        false
    }

    /// By which share of its full scale the input is off; 3.2 allows 0.3 %.
    fn input_error(&self) -> f64 {
        0.0
    }

    /// The degrees that the wires of a temperature sensor add: none (3.2).
    fn wires(&self, _terminals: f64) -> f64 {
        0.0
    }

    /// The unit of sub 2 is for temperatures only (11.3.2).
    fn linear(&self, digits: f64, _unit: i64) -> f64 {
        digits
    }

    /// A lower limit above the upper one turns the scale round (11.3.2, subs 3 and 4).
    fn limits(&self, low: f64, high: f64) -> (f64, f64) {
        (low, high)
    }

    /// Subs 3 and 4 are for linear inputs only (11.3.2).
    fn temperature(&self, digits: f64, _limits: (f64, f64)) -> f64 {
        digits
    }

    /// A potentiometer is measured by its resistance in kilohms, regardless of sub 5 (5.1.b).
    fn track(&self, connected: f64, _configured: f64) -> f64 {
        connected
    }

    /// The input is read at once when something changes, not only once in a period.
    fn samples_at_once(&self) -> bool {
        true
    }

    /// The filter is a mean over samples, not a lag of the first order (11.3.2, sub 10).
    fn filters_by_mean(&self) -> bool {
        true
    }

    /// The first sample fills the mean, so that it need not climb from zero (11.3.2, sub 10).
    fn filter_starts_full(&self) -> bool {
        true
    }

    /// The process value is the input with gain and offset (11.3.2, subs 7 and 8).
    fn calibrated(&self, digits: f64, gain: f64, offset: f64) -> f64 {
        digits * (1.0 + gain / 1000.0) + offset
    }

    /// The cold junction is compensated from 0 to 50 degrees (3.2).
    fn compensated(&self, terminals: f64) -> f64 {
        terminals.clamp(0.0, 50.0)
    }

    /// Beyond that the cold junction is an error (11.3.10, bit 0).
    fn junction_works(&self, terminals: f64) -> bool {
        (0.0..=50.0).contains(&terminals)
    }

    /// A linear signal far beyond its range is an error (11.3.10, bit 1).
    fn linear_signals_end(&self) -> bool {
        true
    }

    /// How often the controller decides while something moves. The manual has no figure.
    fn control_cycle(&self) -> Duration {
        Duration::from_millis(100)
    }

    /// An input without a value shows the end of its range, linear or not, and with terminals in
    /// short circuit, too. Otherwise it shows the last value.
    fn shows_end(&self, _linear: bool, _shorted: bool) -> bool {
        true
    }

    /// The error is one of any sensor, with a cold junction or without.
    fn junction_is_of_any_sensor(&self) -> bool {
        true
    }

    /// A repaired sensor is no error any more, in STOP and in manual mode, too (11.3.10).
    fn repair_is_seen(&self, _running: bool, _manual: bool) -> bool {
        true
    }

    /// In the standard procedure latch-on ends after 120 s (7.11).
    fn latch_time(&self) -> f64 {
        120.0
    }

    /// With a virtual zero both ends of the scale stay where they are (7.11).
    fn zero_keeps_ends(&self, kind: i64) -> bool {
        kind == 2
    }

    /// The commands of latch-on are taken with a temperature sensor, too, where they have no effect
    /// (7.11).
    fn latch_is_of_any_sensor(&self) -> bool {
        true
    }

    /// A minimum or a maximum is only taken while latch-on is enabled (7.11).
    fn latch_needs_enabling(&self) -> bool {
        true
    }

    /// Each sub of 4011h has its effect (7.11).
    fn learns(&self, _sub: u8) -> bool {
        true
    }

    /// What is read of a sub of 4011h other than the first after it was written: the same.
    fn latch_command_reads(&self, written: i64) -> i64 {
        written
    }

    /// The point that becomes the virtual zero, as a share of the range: where the signal is, even
    /// beyond the limits (7.11).
    fn virtual_zero(&self, share: f64) -> f64 {
        share
    }

    /// The values that latch-on learned survive power-off (7.11).
    fn latch_lasts(&self) -> bool {
        true
    }

    /// The state of a contact: closed for odd codes (11.3.2, subs 20, 21, 59, 60, 71, 72).
    fn closed(&self, code: i64) -> bool {
        code % 2 == 1
    }

    /// The state of the analogue output in milliamperes (11.3.2, same subs, 104 and 105).
    fn milliamperes(&self, code: i64) -> f64 {
        match code {
            0 => 0.0,
            1 => 4.0,
            2 => 20.0,
            _ => 21.5,
        }
    }

    /// Where a valve goes in a state: 1 is open (11.3.2, subs 20 and 21).
    fn valve_state(&self, code: i64) -> f64 {
        if code % 2 == 1 { 0.0 } else { 1.0 }
    }

    /// Q1 opens a valve and Q2 closes it (11.3.2, sub 16).
    fn valve_contacts(&self, opens: bool, closes: bool) -> [bool; 2] {
        [opens, closes]
    }

    /// In STOP the controller does not control (11.3.6).
    fn controls(&self, started: bool) -> bool {
        started
    }

    /// Sub 17: start, stop, or what was before the power failure (11.3.2).
    fn starts(&self, initial_state: i64, before: bool) -> bool {
        match initial_state {
            1 => false,
            2 => before,
            _ => true,
        }
    }

    /// The digits before the set point at which on/off control switches (11.3.2, sub 19).
    fn on_off(&self, hysteresis: i64) -> (i64, i64) {
        (hysteresis.min(0), hysteresis.max(0))
    }

    /// An alarm with manual reset, by sub 22, is held on and not held off (11.3.13).
    fn reset_holds_on(&self) -> bool {
        true
    }

    /// A delay in seconds: above 0 before on, below before off (11.3.2, subs 23, 62 and 74).
    fn delay(&self, to_on: bool, delay: f64) -> f64 {
        if to_on { delay } else { -delay }
    }

    /// Begin and end of an alarm, which a delay is for, do not depend on its contact (11.3.2,
    /// subs 57 and 62).
    fn alarm_delay(&self, delay: f64, _closed: bool) -> f64 {
        delay
    }

    /// A delay that is interrupted starts over in full.
    fn delay_starts_over(&self) -> bool {
        true
    }

    /// Subs 22, 61 and 73: a state with manual reset stays after its condition ended (11.3.2).
    fn latches(&self, reset: i64) -> bool {
        reset != 0
    }

    /// An alarm that waits for a manual reset survives a power failure (11.3.2, subs 22, 61, 73).
    fn kept_over_power_off(&self, reset: i64) -> bool {
        reset == 2
    }

    /// 400Ah and 400Bh show what can be reset: nothing whose condition lasts (11.3.13, 11.3.14).
    fn resettable(&self, latched: bool, active: bool) -> bool {
        latched && !active
    }

    /// 400Ah and 400Bh reset when 0 is written (11.3.13, 11.3.14).
    fn resets(&self, written: i64) -> bool {
        written == 0
    }

    /// Manual mode is what 400Fh asks for and sub 25 allows (7.6).
    fn manual(&self, allowed: i64, asked: bool) -> bool {
        allowed != 0 && asked
    }

    /// Only an error of the sensor is a break; one of the hardware or of the cold junction is none
    /// (7.6).
    fn is_break(&self, broken: bool, _error: bool) -> bool {
        broken
    }

    /// With memory, a broken sensor leads to manual mode (7.6).
    fn break_leads_to_manual(&self, allowed: i64) -> bool {
        allowed == 2
    }

    /// A sensor that was broken before leads there as well, once the rest is given (7.6).
    fn lasting_break_counts(&self) -> bool {
        true
    }

    /// In STOP and in expansion mode a broken sensor leads nowhere, since nothing is controlled.
    fn break_counts_without_control(&self) -> bool {
        false
    }

    /// The manual mode of a broken sensor lasts until the master ends it (7.6).
    fn break_is_kept(&self) -> bool {
        true
    }

    /// Alarms work in manual mode as well (7.6).
    fn alarms_work(&self, _manual: bool) -> bool {
        true
    }

    /// Automatic mode is remembered as well (7.6).
    fn remembers(&self, manual: bool) -> bool {
        manual
    }

    /// With memory, manual mode and its output outlast the loss of supply (7.6).
    fn manual_kept(&self, allowed: i64) -> bool {
        allowed == 2
    }

    /// In automatic mode the controller sets 4004h (7.6).
    fn sets_output(&self) -> bool {
        true
    }

    /// Without a band and without an integral time, control is on/off (11.3.2, sub 33).
    fn is_on_off(&self, band: i64, integral_time: i64) -> bool {
        band == 0 && integral_time == 0
    }

    /// The band in digits of a controller with an integral time and no band; `None` leaves the
    /// integral part alone. The manual has no figure.
    fn band_without_one(&self) -> Option<f64> {
        None
    }

    /// STOP clears the integral of PID control.
    fn stop_ends_integral(&self) -> bool {
        true
    }

    /// The mean of more samples than before begins with those that it had.
    fn kept_samples(&self, wanted: usize) -> usize {
        wanted
    }

    /// PID control begins anew after a tuning and after on/off control.
    fn other_control_ends_integral(&self) -> bool {
        true
    }

    /// A parameter that is written as it is changes nothing (11.3.2).
    fn same_parameter_changes_nothing(&self, _sub: u8) -> bool {
        true
    }

    /// The integral part goes with the integral time (11.3.2, sub 34).
    fn integral_goes_with_its_time(&self) -> bool {
        true
    }

    /// Within the dead band nothing is missing (11.3.2, sub 36).
    fn in_dead_band(&self, missing: i64, dead_band: i64) -> bool {
        missing.abs() <= dead_band
    }

    /// Beyond the dead band, the whole deviation counts (11.3.2, sub 36).
    fn beyond_dead_band(&self, missing: i64, _dead_band: i64) -> i64 {
        missing
    }

    /// The time constant of the filter of the derivative, in seconds. The manual has no figure.
    fn derivative_filter(&self) -> f64 {
        1.0
    }

    /// The derivative looks at the process alone, so a set point that moves is taken out of it.
    fn set_point_step(&self, moved: i64) -> i64 {
        moved
    }

    /// The output is off beyond its threshold over the set point (11.3.2, subs 38 and 39).
    fn is_over(&self, over: i64, threshold: i64) -> bool {
        over > threshold
    }

    /// The proportional band of cooling is that of heating times its multiplier (7.8).
    fn cooling_band(&self, band: f64, multiplier: f64) -> f64 {
        band * multiplier
    }

    /// Which parts of the overlap move heating and cooling (7.8): cooling alone.
    fn overlap(&self, overlap: f64) -> (f64, f64) {
        (0.0, overlap)
    }

    /// In double loop the band is never centred (11.3.2, sub 37).
    fn centred(&self, configured: bool, double_loop: bool) -> bool {
        configured && !double_loop
    }

    /// Multiplier and cycle time of a cooling fluid (7.8).
    fn fluid(&self, fluid: i64) -> (i64, i64) {
        match fluid {
            1 => (125, 4),
            2 => (250, 2),
            _ => (100, 10),
        }
    }

    /// A fluid presets multiplier and cycle time when it is chosen, and not at power-on (7.8).
    fn presets_at_power_on(&self) -> bool {
        false
    }

    /// A new share counts at once, not only from the next cycle on (11.3.2, subs 40 and 44).
    fn share_counts_at_once(&self) -> bool {
        true
    }

    /// Cooling has its own cycle time, at either alarm (11.3.2, sub 44).
    fn cools_in_the_cycle_of_heating(&self, _alarm: usize) -> bool {
        false
    }

    /// A cycle has the share of the output (11.3.2, subs 40 and 44).
    fn cycle_share(&self, share: f64) -> f64 {
        share
    }

    /// Whether a contact is closed `at` seconds after its cycle began (11.3.2, subs 40, 44).
    fn in_share(&self, at: f64, share: f64, period: f64) -> bool {
        at < share * period
    }

    /// The parameters of alarm 1 begin at sub 56, those of alarm 2 at sub 68 (11.3.2).
    fn alarm_parameter(&self, alarm: usize, offset: u8) -> u8 {
        [56, 68][alarm] + offset
    }

    /// Alarm 1 has its set point in 4001h and alarm 2 in 4002h (11.3.4, 11.3.5).
    fn alarm_set_point(&self, alarm: u16) -> Mux {
        Mux::new(0x4001 + alarm, 0)
    }

    /// Deviation and band alarms compare the distance from the set point in force (9.c to 9.e).
    fn deviation(&self, process: i64, set_point: i64) -> i64 {
        process - set_point
    }

    /// Kinds 6 and 7 look at the set point in force, not at 4000h (11.3.2, subs 56 and 68).
    fn looked_at(&self, in_force: i64, _wanted: i64) -> i64 {
        in_force
    }

    /// The second threshold lies as far from the first as the hysteresis says, above it when that
    /// is positive (chapter 9).
    fn second_threshold(&self, first: i64, hysteresis: i64) -> i64 {
        first + hysteresis
    }

    /// An alarm begins at its outer threshold, and so many digits beyond it (chapter 9).
    fn alarm_begins(&self, beyond: i64) -> bool {
        beyond >= 0
    }

    /// It lasts up to its inner threshold and at it, and so many digits beyond it (chapter 9).
    fn alarm_lasts(&self, beyond: i64) -> bool {
        beyond >= 0
    }

    /// A lower deviation alarm lies as far below the set point as its own set point says (9.e).
    fn lower_deviation(&self, alarm_set_point: i64) -> i64 {
        -alarm_set_point
    }

    /// A band alarm has two sides (9.c).
    fn band(&self, deviation: i64) -> i64 {
        deviation.abs()
    }

    /// A change of what is no analogue input is transmitted, too (11.2.21).
    fn transmits_any_change(&self) -> bool {
        true
    }

    /// 400Ch and 400Dh are values, 1 is an alarm (11.3.15).
    fn remote_alarm(&self, value: i64) -> bool {
        value == 1
    }

    /// The contact opens in alarm (11.3.2, sub 57); cooling has no rest position.
    fn normally_closed(&self, kind: i64, contact: i64) -> bool {
        contact % 2 == 1 && kind != 9
    }

    /// The alarm waits until its condition was absent once (11.3.2, sub 57).
    fn waits_for_absence(&self, contact: i64) -> bool {
        contact >= 2
    }

    /// An alarm that is selected waits for absence, as one at power-on does (11.3.2, sub 57).
    fn selection_disarms(&self) -> bool {
        true
    }

    /// A change of the set point begins an automatic tuning, as START does (11.3.2, sub 31).
    fn set_point_tunes(&self) -> bool {
        true
    }

    /// A tuning at START or at a new set point begins when the gap is above the largest (7.2).
    fn gap_asks_for_tuning(&self, gap: i64, greatest: i64) -> bool {
        gap.abs() > greatest
    }

    /// A gap that opens at another time than those begins no tuning (7.2, and 11.3.2, sub 31).
    fn any_gap_tunes(&self) -> bool {
        false
    }

    /// Tuning keeps to the least and greatest band and the least integral time (subs 48 to 50).
    fn tuning_limits(&self, bands: (f64, f64), integral_time: f64) -> ((f64, f64), f64) {
        (bands, integral_time)
    }

    /// An error ends a tuning, which has no process value then (11.3.2, sub 20).
    fn error_ends_tuning(&self) -> bool {
        true
    }

    /// Each value that 400Eh takes has its effect (7.5, 11.3.17).
    fn obeys_tuning(&self, _value: i64) -> bool {
        true
    }

    /// A tuning takes some swings about its threshold, not one overshoot. The manual has no method.
    fn swings_to_tune(&self) -> bool {
        true
    }

    /// The results of a tuning go to subs 33 to 35 (7.3).
    fn takes_found(&self) -> bool {
        true
    }

    /// The threshold of manual tuning lies that much before the set point (7.3).
    fn tuning_deviation(&self, configured: i64) -> i64 {
        configured
    }

    /// After its success, tuning at the next start is off (7.4).
    fn tunes_once(&self) -> bool {
        true
    }

    /// While it tunes in step with its neighbours, the master forces the output (7.5).
    fn tuning_forces(&self) -> bool {
        true
    }

    /// With synchronised tuning the output stays off until the master has seen the end (7.5).
    fn tuning_waits_for_master(&self) -> bool {
        true
    }

    /// With a soft start there is no synchronised tuning (7.5).
    fn soft_start_prevents_tuning(&self, kind: i64) -> bool {
        kind != 0
    }

    /// The master has to read 400Eh within this time in seconds (7.5).
    fn longest_silence_in_tuning(&self) -> f64 {
        10.0
    }

    /// 400Eh takes what the kind of tuning, sub 31, has a meaning for (7.5, 11.3.17).
    ///
    /// # Errors
    /// [`Abort::VALUE`] for what is only read or means nothing, [`Abort::DEVICE_STATE`] while the
    /// controller tunes by itself, or when a soft start is selected.
    fn tuning_accepts(&self, kind: i64, soft_start: bool, value: u8) -> Result<(), Abort> {
        match (kind, value) {
            (1 | 3, _) => Err(Abort::DEVICE_STATE),
            (_, 4..) | (2, 2..) => Err(Abort::VALUE),
            (4, 1..) if soft_start => Err(Abort::DEVICE_STATE),
            _ => Ok(()),
        }
    }

    /// 4004h takes a value in automatic mode, too, where the next control cycle overwrites it
    /// (7.6, 11.3.7).
    fn output_accepts(&self, _manual: bool) -> bool {
        true
    }

    /// A soft start follows START, also after a STOP (7.9).
    fn soft_starts(&self, _since_power_on: bool) -> bool {
        true
    }

    /// A soft start ends with STOP, so that 4008h is the set point again (7.9, 11.3.11).
    fn stop_ends_soft_start(&self) -> bool {
        true
    }

    /// The digits per second by which the gradient moves the set point (7.9).
    fn gradient(&self, digits_per_hour: i64) -> f64 {
        digits_per_hour as f64 / 3600.0
    }

    /// At the set point the soft start is over, and later changes count at once (7.9).
    fn gradient_ends(&self) -> bool {
        true
    }

    /// The gradient holds for the way down as well (11.3.2, sub 81).
    fn gradient_falls(&self) -> bool {
        true
    }

    /// The longest soft start is in minutes (11.3.2, sub 84); in seconds.
    fn minutes(&self, configured: i64) -> f64 {
        configured as f64 * 60.0
    }

    /// 50 mA of the transformer are the amperes of sub 91 (3.2), in tenths.
    fn tenths_of_amperes(&self, milliamperes: f64, full_scale: i64) -> f64 {
        milliamperes / 50.0 * full_scale as f64 * 10.0
    }

    /// Every fault of the load has the delay of sub 94 (11.3.2); `fault` counts from bit 7.
    fn current_delay(&self, _fault: usize, delay: f64) -> f64 {
        delay
    }

    /// A fault that goes before its delay is over has its whole delay again (11.3.2, sub 94).
    fn current_delay_starts_over(&self) -> bool {
        true
    }

    /// While the output is off nothing is known of a heater break, and its delay stands still.
    fn current_delay_stands_still(&self) -> bool {
        true
    }

    /// A flag of the load ends with its cause (11.3.10, bits 7 to 10).
    fn current_flags_end(&self) -> bool {
        true
    }

    /// Heater break and over-current are one alarm (11.3.2, subs 56 and 68, 10).
    fn current_alarm(&self, faults: [bool; 4]) -> bool {
        faults.contains(&true)
    }

    /// Up to this current in tenths of an ampere none flows: a tenth of the threshold. The manual
    /// leaves it open.
    fn is_no_current(&self, amperes: f64, threshold: f64) -> bool {
        amperes <= threshold / 10.0
    }

    /// From this current in tenths of an ampere on the switch is in short circuit while the command
    /// is off: any. The manual leaves it open.
    fn is_short(&self, amperes: f64, threshold: f64) -> bool {
        amperes > threshold / 10.0
    }

    /// The key teaches this share of the present current as threshold. The manual leaves it open.
    fn taught(&self, current: f64) -> f64 {
        current * 0.8
    }

    /// The key has to be pressed so long to teach, in milliseconds (6.2).
    fn teaching_time(&self) -> u64 {
        3000
    }

    /// The pressed key enables the command (6.2).
    fn key_enables(&self) -> bool {
        true
    }

    /// The retransmitted value stays within the range of the output (7.10).
    fn share(&self, value: f64, low: f64, high: f64) -> f64 {
        if high == low { 0.0 } else { ((value - low) / (high - low)).clamp(0.0, 1.0) }
    }

    /// Limits of retransmission are digits: tenths of a degree (11.3.2, subs 102 and 103).
    fn retransmission_limit(&self, limit: i64, _is_temperature: bool) -> f64 {
        limit as f64
    }

    /// 4 to 20 mA begin at 4 mA (11.3.2, subs 16, 101 and 125).
    fn microamperes(&self, share: f64, live_zero: bool) -> f64 {
        if live_zero { 4000.0 + 16_000.0 * share } else { 20_000.0 * share }
    }

    /// The analogue output retransmits when it is not the command (7.10).
    fn retransmits(&self, is_command: bool) -> bool {
        !is_command
    }

    /// In expansion mode the master has the outputs (7.12).
    fn expansion(&self, configured: i64) -> bool {
        configured == 1
    }

    /// Expansion mode ends when sub 121 is 0 again (7.12).
    fn expansion_lasts(&self) -> bool {
        false
    }

    /// In expansion mode 6401h has the process value as well (7.12).
    fn shows_process(&self, _expansion: bool) -> bool {
        true
    }

    /// At a start the outputs of an expansion module have their initial values (7.12).
    fn sets_initial_values(&self, expansion: bool) -> bool {
        expansion
    }

    /// Bit 0 of 6200h is Q1 and bit 1 is Q2 (11.4.1).
    fn driven(&self, outputs: i64) -> i64 {
        outputs
    }

    /// An error of the device commutes the outputs of an expansion module (11.3.2, sub 123).
    fn errors_commute(&self) -> bool {
        true
    }

    /// Which outputs of an expansion module commute in case of an error (11.3.2, sub 123).
    fn commutes(&self, outputs: i64, mask: i64, values: i64) -> i64 {
        outputs & !mask | values & mask
    }

    /// The off-line time in seconds (11.3.2, sub 115).
    fn offline_time(&self, configured: i64) -> f64 {
        configured as f64 / 10.0
    }

    /// Any access by the network ends the silence, reading included (11.3.2, sub 115).
    fn ends_silence(&self, _reads: bool) -> bool {
        true
    }

    /// A flag of 4007h has this bit (11.3.10).
    fn flag(&self, bit: u8) -> u8 {
        bit
    }

    /// A fault of the board inside is the generic error (11.3.10, bit 5).
    fn board_is_generic_error(&self) -> bool {
        true
    }

    /// The flags that are an error: those that leave no process value (11.3.2, subs 20, 59, 71 and
    /// 104).
    fn errors(&self, without_process: i64) -> i64 {
        without_process
    }

    /// A broken sensor has no code of its own, so that no message reports it (11.9).
    fn reports_sensor(&self) -> bool {
        false
    }

    /// Power-on with default settings has no code of its own either (11.9).
    fn reports_boot(&self) -> bool {
        false
    }

    /// A buffer that ran over is an error for a moment, with an end, and no mere event (11.9).
    fn overflow_lasts(&self) -> bool {
        true
    }

    /// A part of the memory that cannot be read is a configuration that does not coincide (11.9).
    fn reports_memory(&self) -> bool {
        true
    }

    /// Reset communication compares the board with the one before, as power-on does (11.9).
    fn reset_communication_compares_boards(&self) -> bool {
        true
    }

    /// So does reset node (11.9).
    fn reset_node_compares_boards(&self) -> bool {
        true
    }

    /// The board inside has the messages of a module (11.9).
    fn reports_module(&self) -> bool {
        true
    }

    /// 2000h sub 3 takes states that it does not list, which mean the default (11.3.1).
    fn takes_boot_state(&self, _state: i64) -> bool {
        true
    }

    /// 4009h: bit 0 is Q1 and bit 1 is Q2 (11.3.12).
    fn outputs_status(&self, q1: bool, q2: bool) -> i64 {
        i64::from(q1) | i64::from(q2) << 1
    }

    /// Node-ID and bit rate by the switches or by subs 111 and 112; `bus` is the rate here (6.3).
    fn attachment(&self, switches: Switches, own: (i64, i64), bus: i64) -> Attachment {
        let (address, code) = own;
        match switches.node(address) {
            Some(node) if switches.rate(code) == bus => Attachment::Node(node),
            _ => Attachment::Off,
        }
    }

    /// Reset node reads the switches, as power-on does (6.3).
    fn reset_reads_switches(&self) -> bool {
        true
    }

    /// Switches are read at power-on, not when they are moved (6.3).
    fn switches_act_at_once(&self) -> bool {
        false
    }

    /// All LEDs blink while the defaults are loaded; contact 4 that is closed later shows nothing
    /// (6.3, 7.1).
    fn shows_loading(&self, loading: bool, _closed: bool) -> bool {
        loading
    }

    /// Contact 4 of DIP 2 loads the defaults at power-on (6.3, 7.1).
    fn loads_defaults(&self, switches: Switches) -> bool {
        switches.loads_defaults()
    }

    /// The pattern of RUN (chapter 10).
    fn run_led(&self, pattern: Pattern) -> Pattern {
        pattern
    }

    /// OUT1 is Q1 and OUT2 is Q2 (6.1).
    fn output_leds(&self, outputs: [Pattern; 2]) -> [Pattern; 2] {
        outputs
    }

    /// The pattern of the command's LED while the key is pressed (6.1).
    fn key_led(&self, pattern: Pattern) -> Pattern {
        pattern
    }

    /// How long after the release of the key its LED shows that it has taught. The manual leaves it
    /// open.
    fn taught_led_lasts(&self) -> Duration {
        Duration::ZERO
    }

    /// The patterns of RUN, OUT1 and OUT2 while contact 4 of DIP 2 loads the defaults (7.1).
    fn loading_leds(&self, patterns: [Pattern; 3]) -> [Pattern; 3] {
        patterns
    }

    /// The patterns of OUT1 and OUT2 in an error, counted from 0: they alternate (6.1).
    fn error_leds(&self, alternate: [Pattern; 2]) -> [Pattern; 2] {
        alternate
    }
}
