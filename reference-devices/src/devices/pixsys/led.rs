//! The LEDs of the Pixsys devices and their patterns (DRR460 chapter 10, MCM260X chapters 9 and
//! 10).

use std::time::Duration;

use canopen::{Instant, NmtState};

use crate::decisions::words;

/// How an LED is on and off in turns. Patterns are compared at each look at the module, so they
/// are names and not their times.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Pattern {
    /// Dark.
    SteadyOff,
    /// Lit.
    SteadyOn,
    /// Ten times a second.
    Fast,
    /// Once a second, beginning lit.
    Second,
    /// Once a second, beginning dark.
    SecondOff,
    /// Two and a half times a second.
    Medium,
    /// Every 1.2 s.
    Slow,
    /// On for 1 s, then three flashes of 150 ms.
    ThreeOn,
    /// Off but for a flash of 40 ms every 1.2 s.
    OneOff,
    /// Off for 1 s, then three flashes of 150 ms.
    ThreeOff,
    /// As [`Self::ThreeOn`], with a pause after the third flash.
    ThreeOnThenPause,
    /// As [`Self::ThreeOff`], with a pause after the third flash.
    ThreeOffThenPause,
}

words! { Pattern:
    "steady-off" => Self::SteadyOff,
    "steady-on" => Self::SteadyOn,
    "fast" => Self::Fast,
    "second" => Self::Second,
    "second-off" => Self::SecondOff,
    "medium" => Self::Medium,
    "slow" => Self::Slow,
    "three-on" => Self::ThreeOn,
    "one-off" => Self::OneOff,
    "three-off" => Self::ThreeOff,
    "three-on-then-pause" => Self::ThreeOnThenPause,
    "three-off-then-pause" => Self::ThreeOffThenPause,
}

impl Pattern {
    /// How the RUN LED shows the state of a node, and whether an error is present.
    pub(crate) const fn of_node(state: NmtState, error: bool) -> Self {
        match (state, error) {
            (NmtState::OPERATIONAL, false) => Self::SteadyOn,
            (NmtState::OPERATIONAL, true) => Self::ThreeOn,
            (NmtState::STOPPED, false) => Self::OneOff,
            (NmtState::STOPPED, true) => Self::ThreeOff,
            (_, false) => Self::Slow,
            (_, true) => Self::Medium,
        }
    }

    /// Whether it begins lit, and how long it is one and the other in turns, in milliseconds;
    /// nothing for one that is steady.
    const fn times(self) -> (bool, &'static [u64]) {
        match self {
            Self::SteadyOff => (false, &[]),
            Self::SteadyOn => (true, &[]),
            Self::Fast => (true, &[50, 50]),
            Self::Second => (true, &[500, 500]),
            Self::SecondOff => (false, &[500, 500]),
            Self::Medium => (true, &[200, 200]),
            Self::Slow => (true, &[600, 600]),
            Self::ThreeOn => (true, &[1000, 150, 150, 150, 150, 150]),
            Self::OneOff => (true, &[40, 1160]),
            Self::ThreeOff => (false, &[1000, 150, 150, 150, 150, 150]),
            Self::ThreeOnThenPause => (true, &[1150, 150, 150, 150, 150, 150]),
            Self::ThreeOffThenPause => (false, &[1150, 150, 150, 150, 150, 150]),
        }
    }

    /// Whether it is lit so long after its beginning, and how long it stays so; `None` for ever.
    fn after(self, time: Duration) -> (bool, Option<Duration>) {
        let (first, spans) = self.times();
        let period = Duration::from_millis(spans.iter().sum());
        if period.is_zero() {
            return (first, None);
        }
        let mut rest = Duration::from_nanos((time.as_nanos() % period.as_nanos()) as u64);
        let mut lit = first;
        for span in spans {
            let span = Duration::from_millis(*span);
            if rest < span {
                return (lit, Some(span - rest));
            }
            rest -= span;
            lit = !lit;
        }
        (first, Some(Duration::ZERO))
    }
}

/// An LED. Each pattern starts from its beginning.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Led {
    pattern: Pattern,
    since: Instant,
    pub(crate) lit: bool,
    next: Option<Instant>,
}

impl Default for Led {
    fn default() -> Self {
        Self { pattern: Pattern::SteadyOff, since: Instant::ZERO, lit: false, next: None }
    }
}

impl Led {
    /// Shows a pattern.
    pub(crate) fn show(&mut self, now: Instant, pattern: Pattern) {
        if pattern != self.pattern {
            (self.pattern, self.since) = (pattern, now);
            self.next = Some(now);
        }
        if self.next.is_some_and(|due| due <= now) {
            let (lit, stays) = pattern.after(now.since(self.since));
            self.lit = lit;
            self.next = stays.map(|stays| now + stays);
        }
    }

    /// When it changes by itself.
    pub(crate) const fn poll_at(&self) -> Option<Instant> {
        self.next
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The times in milliseconds at which the LED changes, up to 4 s.
    fn changes(pattern: Pattern) -> Vec<u64> {
        let mut led = Led::default();
        let (mut now, mut lit, mut changes) = (Instant::ZERO, !pattern.times().0, Vec::new());
        while now.0 <= 4_000_000_000 {
            led.show(now, pattern);
            if led.lit != lit {
                changes.push(now.0 / 1_000_000);
                lit = led.lit;
            }
            match led.poll_at() {
                Some(next) => now = next,
                None => break,
            }
        }
        changes
    }

    #[test]
    fn the_patterns_have_the_times_of_the_manual() {
        assert_eq!(changes(Pattern::SteadyOn), [0]);
        assert_eq!(changes(Pattern::SecondOff)[..3], [0, 500, 1000]);
        assert_eq!(changes(Pattern::Slow), [0, 600, 1200, 1800, 2400, 3000, 3600]);
        assert_eq!(changes(Pattern::OneOff), [0, 40, 1200, 1240, 2400, 2440, 3600, 3640]);
        let three = [0, 1000, 1150, 1300, 1450, 1600, 1750, 2750, 2900, 3050, 3200, 3350, 3500];
        assert_eq!(changes(Pattern::ThreeOff), three);
        assert_eq!(changes(Pattern::ThreeOn), three);
        assert_eq!(changes(Pattern::Fast).len(), 81);
    }
}
