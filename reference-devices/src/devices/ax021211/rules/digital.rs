//! The decisions about a digital output, and the dither of a current (1.2, 1.3).

use std::time::Duration;

use super::super::output::Command;
use super::Ax021211Rules;

decisions! {
    /// The decisions. The default methods are a summary of what the manual says.
    pub(in super::super) DigitalDecision of Ax021211Rules, otherwise [DEVIATIONS];

    /// 6202h inverts the drive state (table 1).
    fn polarity(&self, inverse: bool) -> bool {
        inverse
    }

    /// What an enable, an override or a fault demands is a drive state (1.2).
    fn forced(&self, on: bool, _inverse: bool, _by: Command) -> bool {
        on
    }

    /// There is no third polarity (table 1).
    fn blinks(&self, _polarity: i64) -> bool {
        false
    }

    /// A delay is for normal polarity (1.2).
    fn delays(&self, inverse: bool) -> bool {
        !inverse
    }

    /// 2225h says which state is reached late (2.4.6).
    fn is_delayed_edge(&self, wanted: bool, delayed_state: bool) -> bool {
        wanted == delayed_state
    }

    /// 2224h (2.4.5).
    fn delay(&self, configured: Duration) -> Duration {
        configured
    }

    /// A command that ends within the delay has no effect when the delay is over (2.4.5).
    fn delay_ends_with_its_command(&self) -> bool {
        true
    }

    /// A delay is for on/off outputs (1.2).
    fn hotshot_is_delayed(&self) -> bool {
        false
    }

    /// Each time the output comes on it begins with the hotshot (figure 3).
    fn hotshot_is_armed_again(&self) -> bool {
        true
    }

    /// A fault that keeps the output on leaves the hotshot its time (1.2, figure 3).
    fn hotshot_ends_in_a_fault(&self) -> bool {
        true
    }

    /// 2222h (2.4.3).
    fn hotshot_time(&self, configured: Duration) -> Duration {
        configured
    }

    /// 2220h first, 2221h then (figure 3).
    fn hotshot_currents(&self, hotshot: f64, hold: f64) -> (f64, f64) {
        (hotshot, hold)
    }

    /// A dither belongs to a current output (1.3).
    fn dithers(&self, is_current: bool) -> bool {
        is_current
    }

    /// 2321h (2.4.12).
    fn dither(&self, amplitude: f64) -> f64 {
        amplitude
    }

    /// The sub-index of 2320h from 0 on for an output (2.4.11).
    fn dither_bank(&self, place: usize) -> usize {
        place / 4
    }
}

deviations! {
    pub(super) DEVIATIONS of DigitalDecision;

    "polarity-inverted" => polarity: |_, inverse| !inverse;
    "delay-on-other-edge" => is_delayed_edge: |_, wanted, delayed_state| wanted != delayed_state;
    "delay-doubled" => delay: |_, configured| configured * 2;
    "hotshot-lasts" => hotshot_time: |_, configured| configured * 10;
    "hotshot-currents-swapped" => hotshot_currents: |_, hotshot, hold| (hold, hotshot);
    "forces-the-logic-state" => forced: |_, on, inverse, _| on != inverse;
    "fault-state-turned-round" => forced: |rules, on, inverse, by| match by {
        Command::Fault => on != inverse,
        _ => rules.forced(on, inverse, by),
    };
    "shut-off-turned-round" => forced: |rules, on, inverse, by| match by {
        Command::Disabled(_) => on != inverse,
        _ => rules.forced(on, inverse, by),
    };
    "delay-of-16-bits-with-sign" => delay: |_, configured| match configured.as_millis() {
        32_768.. => Duration::ZERO,
        _ => configured,
    };
    "polarity-3-blinks" => blinks: |_, polarity| polarity == 3;
    "hotshot-of-two-seconds" =>
        hotshot_time: |_, configured| configured.min(Duration::from_secs(2));
}
