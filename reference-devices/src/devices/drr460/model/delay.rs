//! A state that follows a condition late, one way or the other (manual, 11.3.2, parameters 23, 62
//! and 74).

/// Follows a condition with a delay.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Delayed {
    on: bool,
    /// Seconds for which the condition has been otherwise.
    waited: f64,
}

impl Delayed {
    /// So many seconds went by, and this is the condition now: `delay` above 0 is the delay on the
    /// way to on, below 0 on the way to off.
    pub(super) fn follow(&mut self, condition: bool, delay: f64, elapsed: f64) -> bool {
        if condition == self.on {
            self.waited = 0.0;
            return self.on;
        }
        let delay = if condition { delay } else { -delay };
        self.waited += elapsed;
        if self.waited + ROUNDING >= delay {
            *self = Self { on: condition, waited: 0.0 };
        }
        self.on
    }

    pub(super) const fn is_on(self) -> bool {
        self.on
    }
}

/// In seconds.
const ROUNDING: f64 = 1e-6;

#[cfg(test)]
mod tests {
    use super::*;

    /// Tenths of a second before the state is `to`; the condition appears with the first one.
    fn tenths(state: &mut Delayed, to: bool, delay: f64) -> u32 {
        let mut steps = 0;
        while state.follow(to, delay, if steps == 0 { 0.0 } else { 0.1 }) != to {
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
        assert!(!state.follow(true, 1.0, 0.9) && !state.follow(false, 1.0, 0.5));
        assert!(!state.follow(true, 1.0, 0.9) && state.follow(true, 1.0, 0.1));
    }
}
