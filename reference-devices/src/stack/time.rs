//! Deadlines that advance by their period, without drift.

use std::time::Duration;

use canopen::Instant;

/// The first instant after `now` of the beat `due`, `due + period`, `due + 2 * period`, ...
///
/// A beat that was served late keeps its phase, and beats that were missed altogether are left
/// out: a burst would be worse than a gap.
pub(crate) fn next_beat(due: Instant, period: Duration, now: Instant) -> Instant {
    let period = (period.as_nanos() as u64).max(1);
    let missed = now.0.saturating_sub(due.0) / period;
    Instant(due.0.saturating_add(period.saturating_mul(missed + 1)))
}

/// The earlier of two deadlines, of which either may not exist.
pub(crate) fn earlier(a: Option<Instant>, b: Option<Instant>) -> Option<Instant> {
    match (a, b) {
        (Some(a), Some(b)) => Some(a.min(b)),
        (a, b) => a.or(b),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_late_beat_keeps_its_phase() {
        let period = Duration::from_nanos(10);
        assert_eq!(next_beat(Instant(100), period, Instant(100)), Instant(110));
        assert_eq!(next_beat(Instant(100), period, Instant(105)), Instant(110));
        assert_eq!(next_beat(Instant(100), period, Instant(137)), Instant(140));
        assert_eq!(next_beat(Instant(100), Duration::ZERO, Instant(100)), Instant(101));
        assert_eq!(next_beat(Instant::NEVER, period, Instant(0)), Instant::NEVER);
    }
}
