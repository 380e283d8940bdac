//! Every decision of the controller that a test can observe.

mod deviations;

#[allow(unused_imports, reason = "the application takes its deviations from here")]
pub(crate) use deviations::{named, names};

/// A controller that keeps to its manual; clauses are those of the manual.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Manual;

impl Rules for Manual {}

/// The decisions. The default methods are a summary of what the manual says.
pub(crate) trait Rules: Send {
    /// A parameter is in force as it is written (11.3.2).
    fn parameter(&self, _sub: u8, configured: i64) -> i64 {
        configured
    }

    /// The process value is the input with gain and offset (11.3.2, subs 7 and 8).
    fn calibrated(&self, digits: f64, gain: f64, offset: f64) -> f64 {
        digits * (1.0 + gain / 1000.0) + offset
    }

    /// The cold junction is compensated from 0 to 50 degrees (3.2).
    fn compensated(&self, terminals: f64) -> f64 {
        terminals.clamp(0.0, 50.0)
    }

    /// In the standard procedure latch-on ends after 120 s (7.11).
    fn latch_time(&self) -> f64 {
        120.0
    }

    /// With a virtual zero both ends of the scale stay where they are (7.11).
    fn zero_keeps_ends(&self, kind: i64) -> bool {
        kind == 2
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

    /// The second threshold lies as far from the first as the hysteresis says, above it when that
    /// is positive (chapter 9).
    fn second_threshold(&self, first: i64, hysteresis: i64) -> i64 {
        first + hysteresis
    }

    /// A lower deviation alarm lies as far below the set point as its own set point says (9.e).
    fn lower_deviation(&self, alarm_set_point: i64) -> i64 {
        -alarm_set_point
    }

    /// A band alarm has two sides (9.c).
    fn band(&self, deviation: i64) -> i64 {
        deviation.abs()
    }

    /// The contact opens in alarm (11.3.2, sub 57); cooling has no rest position.
    fn normally_closed(&self, kind: i64, contact: i64) -> bool {
        contact % 2 == 1 && kind != 9
    }

    /// The alarm waits until its condition was absent once (11.3.2, sub 57).
    fn waits_for_absence(&self, contact: i64) -> bool {
        contact >= 2
    }

    /// What waits for a reset by hand is kept over a power failure (11.3.2, subs 22, 61, 73).
    fn kept_over_power_off(&self, reset: i64) -> bool {
        reset == 2
    }

    /// The proportional band of cooling is that of heating times its multiplier (7.8).
    fn cooling_band(&self, band: f64, multiplier: f64) -> f64 {
        band * multiplier
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

    /// The master has to read 400Eh within this time in seconds (7.5).
    fn longest_silence_in_tuning(&self) -> f64 {
        10.0
    }

    /// A tuning at START or at a change of the set point begins when the gap is greater than the
    /// greatest one (7.2).
    fn gap_asks_for_tuning(&self, gap: i64, greatest: i64) -> bool {
        gap.abs() > greatest
    }

    /// The gradient moves the set point by so many digits in a second (7.9).
    fn gradient(&self, digits_per_hour: i64) -> f64 {
        digits_per_hour as f64 / 3600.0
    }

    /// 50 mA of the transformer are the amperes of sub 91 (3.2), in tenths.
    fn tenths_of_amperes(&self, milliamperes: f64, full_scale: i64) -> f64 {
        milliamperes / 50.0 * full_scale as f64 * 10.0
    }

    /// The retransmitted value stays within the range of the output (7.10).
    fn share(&self, value: f64, low: f64, high: f64) -> f64 {
        if high == low { 0.0 } else { ((value - low) / (high - low)).clamp(0.0, 1.0) }
    }

    /// 4 to 20 mA begin at 4 mA (11.3.2, subs 16, 101 and 125).
    fn microamperes(&self, share: f64, live_zero: bool) -> f64 {
        if live_zero { 4000.0 + 16_000.0 * share } else { 20_000.0 * share }
    }
}
