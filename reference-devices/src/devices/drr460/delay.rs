//! A state that follows a condition late, one way or the other.

use super::PERIOD;

/// Follows a condition with the delay of parameters 23, 62 and 74 (manual, 11.3.2).
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Delayed {
    on: bool,
    waited: u64,
}

impl Delayed {
    /// One sample: `seconds` above 0 delays the way to on, below 0 the way to off.
    pub(super) fn follow(&mut self, condition: bool, seconds: i64) -> bool {
        if condition == self.on {
            self.waited = 0;
            return self.on;
        }
        let seconds = if condition { seconds } else { -seconds };
        let samples = seconds.max(0).unsigned_abs() * SAMPLES_PER_SECOND;
        if self.waited < samples {
            self.waited += 1;
        } else {
            *self = Self { on: condition, waited: 0 };
        }
        self.on
    }

    pub(super) const fn is_on(self) -> bool {
        self.on
    }
}

/// Samples in a second.
pub(super) const SAMPLES_PER_SECOND: u64 = 1_000_000_000 / PERIOD.as_nanos() as u64;

#[cfg(test)]
mod tests {
    use super::*;

    /// How many samples go by before the state is `to`.
    fn samples(state: &mut Delayed, to: bool, seconds: i64) -> u64 {
        (0..).find(|_| state.follow(to, seconds) == to).unwrap()
    }

    #[test]
    fn the_sign_says_which_way_is_late() {
        let mut state = Delayed::default();
        assert_eq!(samples(&mut state, true, 2), 2 * SAMPLES_PER_SECOND);
        assert_eq!(samples(&mut state, false, 2), 0);
        assert_eq!(samples(&mut state, true, -2), 0);
        assert_eq!(samples(&mut state, false, -2), 2 * SAMPLES_PER_SECOND);
    }

    #[test]
    fn a_condition_that_goes_meanwhile_starts_over() {
        let mut state = Delayed::default();
        for _ in 0..SAMPLES_PER_SECOND {
            assert!(!state.follow(true, 1));
        }
        assert!(!state.follow(false, 1));
        assert_eq!(samples(&mut state, true, 1), SAMPLES_PER_SECOND);
    }
}
