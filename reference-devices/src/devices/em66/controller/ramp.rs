//! The set point in force (7401h), which follows the chosen one as fast as the ramps permit.

use std::time::Duration;

use crate::devices::em66::rules::Em66Rules;

/// The way from one set point to another. Values are tenths of a degree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Ramp {
    present: f64,
    running: bool,
    /// The set point that it makes for.
    chosen: f64,
    /// The one before.
    former: f64,
}

/// How fast the set point may rise and fall, in tenths of a kelvin per minute; 0 is at once.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Rates {
    /// 3060h.
    pub(super) heating: i64,
    /// 3070h.
    pub(super) cooling: i64,
}

impl Ramp {
    /// Of a controller that has not run.
    pub(super) const fn new() -> Self {
        Self { present: 0.0, running: false, chosen: 0.0, former: 0.0 }
    }

    /// The controller is off: nothing to follow.
    pub(super) fn stop(&mut self, chosen: i64) {
        let chosen = chosen as f64;
        *self = Self { present: chosen, running: false, chosen, former: chosen };
    }

    /// The controller is on; one that was off starts where `start` is. Where there is no ramp in
    /// the direction to go, the chosen set point is in force at once.
    pub(super) fn follow(&mut self, chosen: i64, start: i64, rates: Rates, rules: &Em66Rules) {
        let (chosen, start) = (chosen as f64, start as f64);
        if !self.running {
            *self = Self { present: start, running: true, chosen, former: start };
        }
        if chosen != self.chosen {
            self.former = std::mem::replace(&mut self.chosen, chosen);
        }
        if self.rate(chosen, rates, rules) == 0 {
            self.present = chosen;
        }
    }

    /// Advances the time.
    pub(super) fn advance(
        &mut self,
        elapsed: Duration,
        chosen: i64,
        rates: Rates,
        rules: &Em66Rules,
    ) {
        let chosen = chosen as f64;
        let step = self.rate(chosen, rates, rules) as f64 * elapsed.as_secs_f64() / 60.0;
        let missing = chosen - self.present;
        if self.running {
            self.present += rules.ramp_step(missing, step);
        }
    }

    /// The set point in force.
    pub(super) const fn present(&self) -> f64 {
        self.present
    }

    /// Of the direction to go.
    fn rate(&self, chosen: f64, rates: Rates, rules: &Em66Rules) -> i64 {
        let rises = rules.ramp_rises(chosen, self.present, self.former);
        if rises { rates.heating } else { rates.cooling }.max(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::em66::PERIOD;
    use crate::devices::em66::rules::Em66Rules;

    const SLOW: Rates = Rates { heating: 600, cooling: 300 };

    fn after(ramp: &mut Ramp, samples: u32, chosen: i64, rates: Rates) -> f64 {
        for _ in 0..samples {
            ramp.advance(PERIOD, chosen, rates, &Em66Rules::plain());
        }
        (ramp.present() * 1e6).round() / 1e6
    }

    #[test]
    fn it_starts_at_the_effective_value_and_moves_with_the_rate_of_its_direction() {
        let mut ramp = Ramp::new();
        ramp.stop(400);
        assert_eq!(ramp.present(), 400.0);
        ramp.follow(400, 250, SLOW, &Em66Rules::plain());
        assert_eq!(ramp.present(), 250.0);
        assert_eq!(after(&mut ramp, 10, 400, SLOW), 260.0);
        ramp.follow(400, 999, SLOW, &Em66Rules::plain());
        assert_eq!(after(&mut ramp, 600, 400, SLOW), 400.0);
        assert_eq!(after(&mut ramp, 10, 300, SLOW), 395.0);
    }

    #[test]
    fn without_a_ramp_the_chosen_set_point_is_in_force_at_once() {
        let up_only = Rates { heating: 600, cooling: 0 };
        let mut ramp = Ramp::new();
        ramp.follow(400, 250, Rates::default(), &Em66Rules::plain());
        assert_eq!(ramp.present(), 400.0);
        ramp.follow(500, 250, up_only, &Em66Rules::plain());
        assert_eq!(ramp.present(), 400.0);
        ramp.follow(300, 250, up_only, &Em66Rules::plain());
        assert_eq!(ramp.present(), 300.0);
    }

    #[test]
    fn a_fraction_of_a_tenth_is_not_lost() {
        let mut ramp = Ramp::new();
        let rates = Rates { heating: 7, cooling: 7 };
        ramp.follow(400, 0, rates, &Em66Rules::plain());
        assert_eq!(after(&mut ramp, 600, 400, rates), 7.0);
        ramp.stop(100);
        assert_eq!(after(&mut ramp, 600, 400, rates), 100.0);
    }
}
