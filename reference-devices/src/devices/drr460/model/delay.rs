//! A state that follows a condition late, one way or the other (manual, 11.3.2, parameters 23, 62
//! and 74).

use super::rules::Rules;

/// Follows a condition with a delay.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Delayed {
    on: bool,
    /// Seconds for which the condition has been otherwise.
    waited: Option<f64>,
    /// The seconds after which the state follows.
    delay: f64,
}

impl Delayed {
    /// Takes the present condition. A `delay` above 0 delays the way to on, one below 0 the way to
    /// off. A condition that ends during the delay starts over.
    pub(super) fn follow(&mut self, condition: bool, delay: f64, rules: &Rules) -> bool {
        if condition == self.on {
            self.waited = self.waited.filter(|_| !rules.delay_starts_over());
            return self.on;
        }
        let waited = *self.waited.get_or_insert(0.0);
        self.delay = rules.delay(condition, delay);
        if waited + ROUNDING >= self.delay {
            *self = Self { on: condition, ..Self::default() };
        }
        self.on
    }

    /// Advances the time.
    pub(super) fn advance(&mut self, elapsed: f64) {
        if let Some(waited) = &mut self.waited {
            *waited += elapsed;
        }
    }

    pub(super) const fn is_on(self) -> bool {
        self.on
    }

    /// Seconds up to the end of its delay, if it waits for that.
    pub(super) fn left(self) -> Option<f64> {
        self.waited.map(|waited| self.delay - waited)
    }
}

/// In seconds.
const ROUNDING: f64 = 1e-6;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::drr460::model::rules::Rules;

    /// Tenths of a second before the state is `to`; the condition appears with the first look.
    fn tenths(state: &mut Delayed, to: bool, delay: f64) -> u32 {
        let mut steps = 0;
        while state.follow(to, delay, &Rules::plain()) != to {
            state.advance(0.1);
            steps += 1;
        }
        steps
    }

    #[test]
    fn the_sign_says_which_way_is_late() {
        let mut state = Delayed::default();
        assert_eq!(tenths(&mut state, true, 2.0), 20);
        assert_eq!(tenths(&mut state, false, 2.0), 0);
        assert_eq!(tenths(&mut state, true, -2.0), 0);
        assert_eq!(tenths(&mut state, false, -2.0), 20);
    }

    #[test]
    fn a_condition_that_goes_meanwhile_starts_over() {
        let mut state = Delayed::default();
        assert!(!state.follow(true, 1.0, &Rules::plain()));
        state.advance(0.9);
        assert!(!state.follow(true, 1.0, &Rules::plain()) && state.left().is_some());
        assert!(!state.follow(false, 1.0, &Rules::plain()) && state.left().is_none());
        assert_eq!(tenths(&mut state, true, 1.0), 10);
    }
}
