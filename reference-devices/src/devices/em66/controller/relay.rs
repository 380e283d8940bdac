//! Self-optimisation: a relay makes the process swing, and the swing yields the parameters.
//!
//! The output changes between its limits whenever the value passes the set point (Astrom and
//! Hagglund). The amplitude of the swing is the ultimate gain, its duration the ultimate period.

use std::f64::consts::PI;

use super::pid::Gains;
use crate::devices::em66::PERIOD;

/// A test that is going on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Relay {
    /// Whether the output is at its upper limit.
    high: bool,
    /// Samples since the relay went up the last time.
    samples: u32,
    /// Largest and smallest value since then.
    top: f64,
    bottom: f64,
    /// Swings that are complete.
    swings: u32,
}

/// The result of a sample of the test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Step {
    /// The output in tenths of a percent.
    Output(f64),
    /// The test is done.
    Done(Gains),
}

impl Relay {
    /// The test begins by approaching the set point.
    pub(super) fn begin(missing: f64) -> Self {
        Self { high: missing > 0.0, samples: 0, top: f64::MIN, bottom: f64::MAX, swings: 0 }
    }

    /// One sample: `missing` in tenths of a kelvin, limits of the output in tenths of a percent.
    pub(super) fn advance(&mut self, missing: f64, low: f64, high: f64) -> Step {
        self.samples += 1;
        self.top = self.top.max(-missing);
        self.bottom = self.bottom.min(-missing);
        let goes_up = !self.high && missing > HYSTERESIS;
        if self.high && missing < -HYSTERESIS {
            self.high = false;
        }
        if goes_up {
            self.high = true;
            self.swings += 1;
            // The first swing still holds the approach.
            if self.swings > SWINGS {
                return Step::Done(self.gains(high - low));
            }
            (self.samples, self.top, self.bottom) = (0, -missing, -missing);
        }
        Step::Output(if self.high { high } else { low })
    }

    /// The rules of Tyreus and Luyben, which overshoot little.
    fn gains(&self, span: f64) -> Gains {
        let amplitude = ((self.top - self.bottom) / 2.0).max(HYSTERESIS);
        let ultimate_gain = 4.0 * (span / 2.0) / (PI * amplitude);
        let ultimate_period = f64::from(self.samples) * PERIOD.as_secs_f64();
        Gains { proportional: ultimate_gain / 3.2, integral_time: 2.2 * ultimate_period }
    }
}

/// Swings that count, after the first one.
const SWINGS: u32 = 3;
/// Noise that does not switch the relay, in tenths of a kelvin.
const HYSTERESIS: f64 = 2.0;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_relay_follows_the_sign_and_ends_after_some_swings() {
        let mut relay = Relay::begin(100.0);
        assert_eq!(relay.advance(100.0, -500.0, 1000.0), Step::Output(1000.0));
        let mut ended = None;
        for sample in 0..10_000 {
            // A swing of 20 samples and 10 tenths to each side.
            let missing = if sample % 20 < 10 { -10.0 } else { 10.0 };
            match relay.advance(missing, -500.0, 1000.0) {
                Step::Output(output) => {
                    assert_eq!(output, if missing > 0.0 { 1000.0 } else { -500.0 });
                }
                Step::Done(gains) => {
                    ended = Some(gains);
                    break;
                }
            }
        }
        let gains = ended.expect("an end");
        let ultimate = 4.0 * 750.0 / (PI * 10.0);
        assert!((gains.proportional - ultimate / 3.2).abs() < 1e-9, "{gains:?}");
        assert!((gains.integral_time - 2.2 * 2.0).abs() < 1e-9, "{gains:?}");
    }

    #[test]
    fn noise_does_not_switch_the_relay() {
        let mut relay = Relay::begin(5.0);
        for missing in [1.0, -1.0, 2.0, -2.0] {
            assert_eq!(relay.advance(missing, 0.0, 1000.0), Step::Output(1000.0));
        }
        assert_eq!(relay.advance(-2.1, 0.0, 1000.0), Step::Output(0.0));
    }
}
