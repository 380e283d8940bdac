//! Time stamps of another clock, as times of this one.

use std::time::Duration;

use canopen::Instant;

/// Two clocks with the usual crystals part by less than one second in as many, and those that a USB
/// host keeps in step, too.
const DRIFT: u64 = 400;
/// No message takes longer: the other clock was set.
const LONGEST_WAY: u64 = 1_000_000_000;

/// Finds when a message left by the clock of the other side: it took no longer than the quickest
/// ones before, and what it took longer is taken off its time of arrival.
#[derive(Clone, Debug)]
pub(super) struct FarClock {
    /// The step of the other clock, in nanoseconds.
    step: u64,
    /// The least difference of arrival and stamp, in nanoseconds, and when it was looked at.
    least: Option<(i128, Instant)>,
}

impl FarClock {
    /// A clock that counts in this step.
    pub(super) const fn new(step: Duration) -> Self {
        Self { step: step.as_nanos() as u64, least: None }
    }

    /// When a message was sent that came at `arrival` with this stamp, in nanoseconds. It is never
    /// after its arrival.
    pub(super) fn time(&mut self, arrival: Instant, stamp: u64) -> Instant {
        let way = i128::from(arrival.0) - i128::from(stamp);
        let least = self.least.map_or(way, |(least, since)| {
            let parted = arrival.since(since).as_nanos() as u64 / DRIFT;
            way.min(least + i128::from(parted))
        });
        let late = (way - least).max(0) as u64;
        if late > LONGEST_WAY {
            self.least = Some((way, arrival));
            return arrival;
        }
        self.least = Some((least, arrival));
        // A stamp may be older than it says by one step.
        Instant(arrival.0 - late.saturating_sub(self.step).min(arrival.0))
    }
}

/// Counts on where stamps begin again at zero.
#[derive(Clone, Debug)]
pub(super) struct Unwrapped {
    /// After how many nanoseconds stamps begin again.
    period: u64,
    /// The last stamp, and when it came.
    last: Option<(u64, Instant)>,
}

impl Unwrapped {
    /// Stamps that begin again after this time.
    pub(super) const fn new(period: Duration) -> Self {
        Self { period: period.as_nanos() as u64, last: None }
    }

    /// A stamp that came at `arrival`, in nanoseconds, as one that does not begin again.
    pub(super) fn count(&mut self, arrival: Instant, stamp: u64) -> u64 {
        // From here on, so that a stamp a little before the first one is no negative number.
        let start = self.period;
        let counted = match self.last {
            None => start + stamp,
            Some((last, since)) => {
                let expected = last + arrival.since(since).as_nanos() as u64;
                let half = self.period / 2;
                let least = expected.saturating_sub(half);
                let behind = least % self.period;
                let up = (stamp % self.period + self.period - behind) % self.period;
                least + up
            }
        };
        self.last = Some((counted, arrival));
        counted
    }

    /// Stamps begin again after another time than was thought.
    pub(super) fn correct(&mut self, period: Duration) {
        let period = period.as_nanos() as u64;
        if self.period != period {
            *self = Self { period, last: None };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MILLI: u64 = 1_000_000;

    #[test]
    fn what_a_message_took_longer_than_others_is_taken_off() {
        let mut clock = FarClock::new(Duration::from_millis(1));
        // The quickest took 2 ms.
        for (stamp, arrival, time) in [
            (500, 1002, 1002),
            (510, 1015, 1013),
            (520, 1022, 1022),
            // This one waited for 100 ms; the clocks may have parted by a quarter of one.
            (530, 1132, 1033),
            (540, 1133, 1043),
        ] {
            let found = clock.time(Instant(arrival * MILLI), stamp * MILLI);
            let off = found.0.abs_diff(time * MILLI);
            assert!(off < MILLI / 2, "{stamp}: {found:?} instead of {time} ms");
        }
    }

    #[test]
    fn a_clock_that_is_slow_is_followed() {
        let mut clock = FarClock::new(Duration::from_micros(1));
        for second in 0..3600 {
            let arrival = Instant(1_000 * MILLI * second + 5 * MILLI);
            // 2000 ppm.
            let stamp = 998 * MILLI * second;
            assert_eq!(clock.time(arrival, stamp), arrival, "{second}");
        }
    }

    #[test]
    fn a_clock_that_is_set_is_followed() {
        let mut clock = FarClock::new(Duration::from_millis(1));
        let at = |ms: u64| Instant(ms * MILLI);
        assert_eq!(clock.time(at(100), 5_000 * MILLI), at(100));
        assert_eq!(clock.time(at(200), 100 * MILLI), at(200), "back");
        assert_eq!(clock.time(at(300), 9_000 * MILLI), at(300), "forth");
        assert_eq!(clock.time(at(400), 9_100 * MILLI), at(400));
    }

    #[test]
    fn stamps_that_begin_again_are_counted_on() {
        let mut unwrapped = Unwrapped::new(Duration::from_secs(60));
        let mut first = None;
        for step in 0..1000_u64 {
            // A frame comes every 7 s, in turns a little early and late.
            let ms = 7_000 * step + 300 * (step % 3);
            let arrival = Instant((ms + 20 * (step % 2)) * MILLI);
            let counted = unwrapped.count(arrival, (ms + 59_000) % 60_000 * MILLI);
            let first = *first.get_or_insert(counted);
            assert_eq!(counted - first, ms * MILLI);
        }
    }
}
