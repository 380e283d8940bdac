//! From the kernel's time stamps to time since the bus was opened.

use std::time::{Instant as Monotonic, SystemTime, UNIX_EPOCH};

use canopen::Instant;

/// The clock of a bus, and the place of the kernel's stamps on it.
///
/// The kernel stamps frames with the wall clock, which anybody may set while a test runs; our time
/// is the monotonic clock. Both run at the same rate (the kernel slews them together), so their
/// distance changes only when the wall clock is *set*. The distance is measured once and kept,
/// which makes spans between stamps exact. With every stamp it is measured again, but for frames of
/// one burst, which came before a measurement that is not older than [`RECENT`]: when it jumped,
/// stamps move over to the new distance as soon as that puts them between the last stamp and now,
/// so that frames that were stamped before the jump are still placed with the old one. A jump of
/// less than [`JUMP`] goes unseen and shifts stamps by that little; one of less than the time that
/// a frame waited to be read may misplace that frame by as much. The two clocks are read one after
/// the other, so that the distance, and with it every stamp, may be off by [`INEXACT`].
///
/// In every case, stamps never decrease and never lie in the future.
#[derive(Debug)]
pub(super) struct Clock {
    opened: Monotonic,
    /// Wall clock minus monotonic clock.
    distance: i64,
    last: i64,
    sampled: Sample,
}

/// Both clocks at one moment, in nanoseconds.
#[derive(Clone, Copy, Debug)]
struct Sample {
    now: i64,
    /// `None` when something came between the two readings.
    distance: Option<i64>,
}

impl Clock {
    /// A clock that reads zero now.
    #[expect(clippy::disallowed_methods, reason = "a bus backend may read a clock")]
    pub(super) fn start() -> Self {
        let sampled = Sample { now: i64::MIN, distance: None };
        let mut clock = Self { opened: Monotonic::now(), distance: 0, last: 0, sampled };
        let samples = (0..8).map(|_| {
            let before = clock.now();
            let sample = clock.sample(before);
            (sample.now - before.0 as i64, sample.distance)
        });
        // The reading that took least is the most exact one.
        let (_, distance) = samples.min_by_key(|(took, _)| *took).unwrap_or_default();
        clock.distance = distance.unwrap_or_else(|| {
            // Always disturbed: take what there is.
            nanos(SystemTime::now()) - clock.elapsed()
        });
        clock
    }

    /// Time since the bus was opened.
    pub(super) fn now(&self) -> Instant {
        Instant(self.elapsed() as u64)
    }

    /// The place of a frame that the kernel stamped with `wall`; now, when it has no stamp.
    /// `before` is a time a moment ago.
    pub(super) fn stamp(&mut self, wall: Option<SystemTime>, before: Instant) -> Instant {
        let wall = wall.map(nanos);
        // Reading clocks is most of the work of a frame where the kernel is asked for each.
        let is_older = |wall: i64| wall - self.distance <= self.sampled.now;
        if !wall.is_some_and(is_older) || before.0 as i64 > self.sampled.now + RECENT {
            self.sampled = self.sample(before);
        }
        let sample = self.sampled;
        let wall = wall.unwrap_or(sample.now + self.distance);
        Instant(self.place(wall, &sample) as u64)
    }

    fn place(&mut self, wall: i64, sample: &Sample) -> i64 {
        if let Some(distance) = sample.distance
            && distance.abs_diff(self.distance) > JUMP
            && (self.last..=sample.now).contains(&(wall - distance))
        {
            self.distance = distance;
        }
        self.last = (wall - self.distance).min(sample.now).max(self.last);
        self.last
    }

    #[expect(clippy::disallowed_methods, reason = "a bus backend may read a clock")]
    fn sample(&self, before: Instant) -> Sample {
        let before = before.0 as i64;
        let wall = nanos(SystemTime::now());
        let now = self.elapsed();
        let undisturbed = now - before <= 2 * INEXACT as i64;
        Sample { now, distance: undisturbed.then(|| wall - (before + (now - before) / 2)) }
    }

    fn elapsed(&self) -> i64 {
        self.opened.elapsed().as_nanos() as i64
    }
}

fn nanos(wall: SystemTime) -> i64 {
    wall.duration_since(UNIX_EPOCH).map_or(0, |since| since.as_nanos() as i64)
}

/// In nanoseconds. Well above what reading two clocks takes, well below what matters to CANopen.
const JUMP: u64 = 200_000;
/// In nanoseconds. Longer than a burst of frames takes to be read, and no time for a bus.
const RECENT: i64 = 1_000_000;
/// In nanoseconds. Half of what the two readings of an undisturbed sample take at most.
pub(super) const INEXACT: u64 = JUMP / 4;

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    const MS: i64 = 1_000_000;
    const HOUR: i64 = 3_600_000 * MS;
    const WALL: i64 = 500_000 * HOUR;

    fn clock() -> Clock {
        Clock { distance: WALL, ..Clock::start() }
    }

    fn sample(now: i64, jumped: i64) -> Sample {
        Sample { now, distance: Some(WALL + jumped) }
    }

    #[test]
    fn the_measured_distance_does_not_add_its_jitter() {
        let mut clock = clock();
        for (at, jitter) in [(10 * MS, 90_000), (11 * MS, -90_000), (12 * MS, 5)] {
            assert_eq!(clock.place(WALL + at, &sample(at + MS / 2, jitter)), at);
        }
    }

    #[test]
    fn setting_the_wall_clock_does_not_move_stamps() {
        for jump in [HOUR, -HOUR, 100 * MS, -100 * MS] {
            let mut clock = clock();
            assert_eq!(clock.place(WALL + 10 * MS, &sample(11 * MS, 0)), 10 * MS);
            // Stamped before the wall clock was set, read after it.
            assert_eq!(clock.place(WALL + 20 * MS, &sample(21 * MS, jump)), 20 * MS, "{jump}");
            assert_eq!(clock.place(WALL + jump + 30 * MS, &sample(31 * MS, jump)), 30 * MS);
            assert_eq!(clock.place(WALL + jump + 40 * MS, &sample(41 * MS, jump)), 40 * MS);
        }
    }

    #[test]
    fn stamps_never_decrease_and_never_lie_in_the_future() {
        let mut clock = clock();
        assert_eq!(clock.place(WALL + 10 * MS, &sample(11 * MS, 0)), 10 * MS);
        assert_eq!(clock.place(WALL + 9 * MS, &sample(12 * MS, 0)), 10 * MS);
        assert_eq!(clock.place(WALL + 99 * MS, &sample(13 * MS, 0)), 13 * MS);
    }

    #[test]
    fn a_disturbed_sample_changes_nothing() {
        let mut clock = clock();
        let disturbed = Sample { now: 30 * MS, distance: None };
        assert_eq!(clock.place(WALL + 20 * MS, &disturbed), 20 * MS);
    }

    #[test]
    fn frames_of_one_burst_share_a_measurement() {
        let mut clock = Clock::start();
        let first = clock.now();
        let burst = UNIX_EPOCH + Duration::from_nanos((clock.distance + first.0 as i64) as u64);
        clock.stamp(Some(burst), first);
        let measured = clock.sampled.now;
        clock.stamp(Some(burst), Instant(measured as u64));
        assert_eq!(clock.sampled.now, measured);
        // It could have been set since.
        clock.stamp(Some(burst), Instant((measured + RECENT + 1) as u64));
        assert!(clock.sampled.now > measured);
        // What comes later may have come after the clock was set.
        let measured = clock.sampled.now;
        clock.stamp(Some(burst + Duration::from_secs(1)), Instant(measured as u64));
        assert!(clock.sampled.now > measured);
    }

    #[test]
    fn a_stamp_of_now_is_between_two_readings() {
        let mut clock = Clock::start();
        let before = clock.now();
        let stamp = clock.stamp(None, before);
        assert!(before <= stamp && stamp <= clock.now());
    }
}
