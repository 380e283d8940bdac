//! The decisions about a digital output, and the dither of a current (1.2, 1.3).

use std::time::Duration;

use super::{Ax021211Rules, Layer};
use crate::devices::deviating::{Deviation, deviating};

decisions! {
    /// The decisions. The default methods are a summary of what the manual says.
    pub(in super::super) trait DigitalRules: Layer;

    /// 6202h inverts the drive state (table 1).
    fn polarity(&self, inverse: bool) -> bool {
        inverse
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

pub(super) const DEVIATIONS: &[Deviation<dyn Ax021211Rules>] = deviating! {
    dyn Ax021211Rules: DigitalRules [Ax021211Rules];
    "polarity-ignored" {
        fn polarity(&self, _inverse: bool) -> bool { false }
    }
    "polarity-inverted" {
        fn polarity(&self, inverse: bool) -> bool { !inverse }
    }
    "delay-with-inverse-polarity" {
        fn delays(&self, _inverse: bool) -> bool { true }
    }
    "delay-on-both-edges" {
        fn is_delayed_edge(&self, _wanted: bool, _delayed_state: bool) -> bool { true }
    }
    "delay-on-other-edge" {
        fn is_delayed_edge(&self, wanted: bool, delayed_state: bool) -> bool {
            wanted != delayed_state
        }
    }
    "delay-doubled" {
        fn delay(&self, configured: Duration) -> Duration { configured * 2 }
    }
    "hotshot-once" {
        fn hotshot_is_armed_again(&self) -> bool { false }
    }
    "hotshot-lasts-in-a-fault" {
        fn hotshot_ends_in_a_fault(&self) -> bool { false }
    }
    "hotshot-skipped" {
        fn hotshot_time(&self, _configured: Duration) -> Duration { Duration::ZERO }
    }
    "hotshot-lasts" {
        fn hotshot_time(&self, configured: Duration) -> Duration { configured * 10 }
    }
    "hotshot-currents-swapped" {
        fn hotshot_currents(&self, hotshot: f64, hold: f64) -> (f64, f64) { (hold, hotshot) }
    }
    "dither-missing" {
        fn dither(&self, _amplitude: f64) -> f64 { 0.0 }
    }
    "dither-of-first-bank" {
        fn dither_bank(&self, _place: usize) -> usize { 0 }
    }
    "polarity-3-blinks" {
        fn blinks(&self, polarity: i64) -> bool { polarity == 3 }
    }
    "hotshot-of-two-seconds" {
        fn hotshot_time(&self, configured: Duration) -> Duration {
            configured.min(Duration::from_secs(2))
        }
    }
    "hotshot-is-delayed" {
        fn hotshot_is_delayed(&self) -> bool { true }
    }
    "dither-of-every-type" {
        fn dithers(&self, _is_current: bool) -> bool { true }
    }
    "dither-by-default" {
        fn dither(&self, amplitude: f64) -> f64 { amplitude.max(100.0) }
    }
};
