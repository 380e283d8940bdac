//! Encoders and counters: from edges at the terminals to counts (manual, 11.3.3 to 11.3.7).
//!
//! An encoder that turns steadily needs no event per edge: its place follows from the time, and the
//! number of edges between two places follows from the places.

use std::time::Duration;

use canopen::Instant;

use super::rules::Mcm260xRules;

/// The motion of a shaft: it stands, or turns at the same speed until further notice.
///
/// A place is a number of quarter periods: phase A rises at the first, B at the second, A falls at
/// the third and B at the fourth.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Motion {
    /// Periods of phase A in 1000 s; negative backwards.
    pub(super) millihertz: i64,
    /// The level of phase Z that was set by hand.
    pub(super) index_level: bool,
    /// Periods from one pulse of phase Z to the next; 0 is a shaft without phase Z.
    pub(super) turn: i64,
    since: Instant,
    from: i64,
}

impl Motion {
    /// Where the shaft is.
    pub(super) fn at(&self, now: Instant) -> i64 {
        let nanoseconds = now.since(self.since).as_nanos() as i128;
        let quarters = 4 * i128::from(self.millihertz) * nanoseconds;
        self.from + quarters.div_euclid(NANOSECONDS_IN_1000_S) as i64
    }

    /// Turns at another speed from now on.
    pub(super) fn turn_at(&mut self, now: Instant, millihertz: i64) {
        *self = Self { millihertz, since: now, from: self.at(now), ..*self };
    }

    /// The levels of phases A and B at a place.
    pub(super) const fn phases(place: i64) -> (bool, bool) {
        let quarter = place.rem_euclid(4);
        (matches!(quarter, 1 | 2), matches!(quarter, 2 | 3))
    }

    /// The level of phase Z at a place.
    pub(super) const fn index_at(&self, place: i64) -> bool {
        if self.turn > 0 { place.rem_euclid(4 * self.turn) == 0 } else { self.index_level }
    }

    /// When the shaft will be at the next place; `None` while it stands.
    pub(super) fn next_edge(&self, now: Instant) -> Option<Instant> {
        let speed = 4 * i128::from(self.millihertz);
        let gone = i128::from(self.at(now) - self.from);
        let nanoseconds = match speed.signum() {
            0 => return None,
            1 => ((gone + 1) * NANOSECONDS_IN_1000_S + speed - 1) / speed,
            // Backwards a place ends just after it was reached.
            _ => gone * NANOSECONDS_IN_1000_S / speed + 1,
        };
        Some(self.since + Duration::from_nanos(nanoseconds as u64))
    }

    /// Is somewhere else.
    pub(super) fn move_to(&mut self, now: Instant, place: i64) {
        (self.since, self.from) = (now, place);
    }

    /// The first place of phase Z on the way, the start not included.
    fn index(&self, from: i64, to: i64) -> Option<i64> {
        let turn = 4 * self.turn;
        if turn <= 0 {
            return None;
        }
        if to > from {
            let next = (from.div_euclid(turn) + 1) * turn;
            (next <= to).then_some(next)
        } else {
            let next = (from - 1).div_euclid(turn) * turn;
            (next >= to && to < from).then_some(next)
        }
    }
}

/// The inputs of an encoder, and its counts.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Encoder {
    pub(super) motion: Motion,
    /// There is no terminal for phase B.
    pub(super) without_b: bool,
    /// Up to here the edges are counted.
    seen: i64,
    /// 3001h.
    pub(super) count: i32,
    /// Every count since the start; loading does not change it.
    total: i64,
    /// Waits for phase Z to load the preset.
    waits_for_index: bool,
    second: Window,
    tenth: Window,
}

/// Counts in an interval that repeats.
#[derive(Clone, Copy, Debug, Default)]
struct Window {
    begins: i64,
    counted: i64,
}

/// The function of an encoder input: the code of its parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Setup {
    /// The code.
    pub(super) mode: i64,
    /// The value to load on command.
    pub(super) preset: i32,
}

impl Setup {
    /// The same, or that of an encoder which is off.
    pub(super) const fn counting(self, counts: bool) -> Self {
        Self { mode: if counts { self.mode } else { 0 }, ..self }
    }
}

impl Encoder {
    /// Restarts with nothing counted. The shaft stays where it is.
    pub(super) fn restart(&mut self, now: Instant, rules: &Mcm260xRules) {
        let (motion, without_b) = (self.motion, self.without_b);
        let waits_for_index = self.waits_for_index && rules.waits_over_a_start();
        let count = rules.count_at_start(self.count);
        let seen = motion.at(now);
        let kept = if rules.intervals_over_a_start() { *self } else { Self::default() };
        *self = Self { motion, without_b, seen, count, waits_for_index, ..kept };
    }

    /// Counts what has passed until `now`.
    pub(super) fn follow(&mut self, now: Instant, setup: Setup, rules: &Mcm260xRules) {
        let to = self.motion.at(now);
        if to != self.seen {
            self.pass(to, setup, rules);
        }
    }

    /// Passes all edges on the way to a place.
    fn pass(&mut self, to: i64, setup: Setup, rules: &Mcm260xRules) {
        let from = std::mem::replace(&mut self.seen, to);
        let has_no_b = self.without_b;
        let counts = |from, to| match setup.mode {
            1..=4 if has_no_b => without_b(from, to),
            mode => rules.counts(mode, from, to),
        };
        self.total += counts(from, to);
        let sees = rules.sees_index(setup.mode);
        match self.motion.index(from, to).filter(|_| sees) {
            Some(index) => {
                // A load at phase Z lies between edges: count those before and after apart.
                let index = rules.loaded_at(index, to);
                self.count = rules.count(self.count, counts(from, index));
                self.see_index(setup, rules);
                self.count = rules.count(self.count, counts(index, to));
            }
            None => self.count = rules.count(self.count, counts(from, to)),
        }
    }

    /// Phase Z rose.
    pub(super) fn see_index(&mut self, setup: Setup, rules: &Mcm260xRules) {
        if !rules.sees_index(setup.mode) {
            return;
        }
        if self.waits_for_index {
            self.load(setup.preset, rules);
        } else {
            self.count = rules.count_at_index(self.count);
        }
    }

    /// The setup is another one.
    pub(super) fn set_up_anew(&mut self, rules: &Mcm260xRules) {
        self.count = rules.count_in_new_setup(self.count);
    }

    /// A command of 3003h. Returns the value to be read there: the bits that are not done.
    pub(super) fn command(&mut self, command: i64, setup: Setup, rules: &Mcm260xRules) -> i64 {
        if rules.loads_now(command) {
            self.load(setup.preset, rules);
        }
        let kept = self.waits_for_index && !rules.command_replaces_the_last();
        self.waits_for_index = rules.loads_at_index(command) || kept;
        self.open_commands(command, rules)
    }

    /// The bits of 3003h that are not done.
    pub(super) fn open_commands(&self, last: i64, rules: &Mcm260xRules) -> i64 {
        rules.command_left(last, self.waits_for_index)
    }

    /// The end of an interval of 100 ms, which is one of 1 s, too, or not.
    pub(super) fn interval_ends(&mut self, of_second: bool) {
        self.tenth.end(self.total);
        if of_second {
            self.second.end(self.total);
        }
    }

    /// Nothing is counted any more, so the intervals have no counts.
    pub(super) fn forget_intervals(&mut self) {
        let window = Window { begins: self.total, counted: 0 };
        (self.second, self.tenth) = (window, window);
    }

    /// The counts of the last second, 3004h.
    pub(super) const fn in_a_second(&self) -> i64 {
        self.second.counted
    }

    /// The counts of the last 100 ms, 3005h.
    pub(super) const fn in_a_tenth(&self) -> i64 {
        self.tenth.counted
    }

    /// Whether something will change by itself: it turns, or an interval has counts.
    pub(super) fn is_quiet(&self) -> bool {
        let windows = [self.second, self.tenth];
        let quiet = |window: Window| window.counted == 0 && window.begins == self.total;
        let stands = self.motion.millihertz == 0 && self.motion.from == self.seen;
        stands && windows.into_iter().all(quiet)
    }

    fn load(&mut self, preset: i32, rules: &Mcm260xRules) {
        self.total += rules.counted_by_loading(i64::from(preset) - i64::from(self.count));
        self.count = preset;
        self.waits_for_index = false;
    }
}

impl Window {
    fn end(&mut self, total: i64) {
        self.counted = total - std::mem::replace(&mut self.begins, total);
    }
}

/// The counts between two places for a code of the setup parameter: both edges of phase A, all
/// edges, or the rises of A whichever way the shaft turns.
pub(super) const fn counts(mode: i64, from: i64, to: i64) -> i64 {
    match mode {
        1 | 3 => (to + 1).div_euclid(2) - (from + 1).div_euclid(2),
        2 | 4 => to - from,
        5 => rises(from, to),
        6 => -rises(from, to),
        _ => 0,
    }
}

/// Without phase B, the edges of A look like a step forward and a step back.
const fn without_b(from: i64, to: i64) -> i64 {
    const fn a(place: i64) -> i64 {
        Motion::phases(place).0 as i64
    }
    a(to) - a(from)
}

/// How often phase A rises on the way.
const fn rises(from: i64, to: i64) -> i64 {
    if to > from {
        (to + 3).div_euclid(4) - (from + 3).div_euclid(4)
    } else {
        (from + 1).div_euclid(4) - (to + 1).div_euclid(4)
    }
}

/// The shorter of the two intervals.
pub(super) const TENTH: Duration = Duration::from_millis(100);
/// How many of them are the longer one.
pub(super) const TENTHS_IN_A_SECOND: u128 = 10;
const NANOSECONDS_IN_1000_S: i128 = 1_000_000_000_000;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::mcm260x::rules::Mcm260xRules;

    const fn at(microseconds: u64) -> Instant {
        Instant(microseconds * 1000)
    }

    const fn setup(mode: i64) -> Setup {
        Setup { mode, preset: 0 }
    }

    #[test]
    fn what_is_counted_follows_from_the_places() {
        // One period forward and one back, edge by edge: x2, x4, up.
        let way = [0, 1, 2, 3, 4, 3, 2, 1, 0];
        let expected = [
            (1, [1, 0, 1, 0, 0, -1, 0, -1]),
            (2, [1, 1, 1, 1, -1, -1, -1, -1]),
            (5, [1, 0, 0, 0, 0, 1, 0, 0]),
            (6, [-1, 0, 0, 0, 0, -1, 0, 0]),
            (0, [0; 8]),
        ];
        for (mode, steps) in expected {
            let seen: Vec<i64> = way.windows(2).map(|w| counts(mode, w[0], w[1])).collect();
            assert_eq!(seen, steps, "mode {mode}");
        }
    }

    #[test]
    fn a_long_way_has_the_counts_of_its_steps() {
        for mode in 0..=6 {
            for (from, to) in [(-9, 14), (14, -9), (-3, -3), (0, 1)] {
                let step = if to > from { 1 } else { -1 };
                let (mut place, mut sum) = (from, 0);
                while place != to {
                    sum += counts(mode, place, place + step);
                    place += step;
                }
                assert_eq!(counts(mode, from, to), sum, "mode {mode} from {from} to {to}");
            }
        }
    }

    #[test]
    fn eighty_kilohertz_are_exact() {
        let mut motion = Motion::default();
        motion.turn_at(at(0), 80_000_000);
        assert_eq!(motion.at(at(1_000_000)), 320_000);
        assert_eq!(motion.at(Instant(3_124)), 0);
        assert_eq!(motion.at(Instant(3_125)), 1);
        assert_eq!(motion.at(at(600_000_000)), 192_000_000);
        motion.turn_at(at(1_000_000), -80_000_000);
        assert_eq!(motion.at(at(2_000_000)), 0);
        motion.turn_at(at(2_000_000), 500);
        assert_eq!(motion.at(at(3_999_999)), 3);
        assert_eq!(motion.at(at(4_000_000)), 4);
    }

    #[test]
    fn the_next_edge_is_the_first_instant_at_another_place() {
        let mut motion = Motion::default();
        assert_eq!(motion.next_edge(at(7)), None);
        for millihertz in [3_000, 333_333, -3_000, -777_777] {
            motion.turn_at(at(10), millihertz);
            let mut now = at(10);
            for _ in 0..9 {
                let next = motion.next_edge(now).unwrap();
                let step = millihertz.signum();
                assert_eq!(motion.at(next), motion.at(now) + step, "{millihertz}");
                assert_eq!(motion.at(Instant(next.0 - 1)), motion.at(now), "{millihertz}");
                now = next;
            }
        }
    }

    #[test]
    fn the_preset_is_loaded_just_at_phase_z() {
        let mut motion = Motion { turn: 100, ..Motion::default() };
        motion.move_to(at(0), 10);
        let mut encoder = Encoder { motion, ..Encoder::default() };
        encoder.restart(at(0), &Mcm260xRules::plain());
        let mode = Setup { mode: 4, preset: -5 };
        assert_eq!(encoder.command(2, mode, &Mcm260xRules::plain()), 2);
        encoder.motion.turn_at(at(0), 1_000_000);
        encoder.follow(at(97_499), mode, &Mcm260xRules::plain());
        assert_eq!((encoder.count, encoder.open_commands(2, &Mcm260xRules::plain())), (389, 2));
        encoder.follow(at(100_000), mode, &Mcm260xRules::plain());
        assert_eq!((encoder.count, encoder.open_commands(2, &Mcm260xRules::plain())), (5, 0));
        encoder.follow(at(300_000), mode, &Mcm260xRules::plain());
        assert_eq!(encoder.count, 805);
        encoder.interval_ends(true);
        assert_eq!(encoder.in_a_second(), 1200, "what was loaded was not counted");
    }

    #[test]
    fn phase_z_is_found_in_both_directions_and_not_at_the_start() {
        let motion = Motion { turn: 10, ..Motion::default() };
        let table = [
            ((0, 39), None),
            ((0, 40), Some(40)),
            ((40, 0), Some(0)),
            ((41, 1), Some(40)),
            ((-1, 0), Some(0)),
            ((5, 5), None),
            ((0, -39), None),
        ];
        for ((from, to), index) in table {
            assert_eq!(motion.index(from, to), index, "{from} to {to}");
        }
    }

    #[test]
    fn counts_wrap_and_an_interval_ends_quietly() {
        let mut encoder = Encoder { count: i32::MAX, ..Encoder::default() };
        encoder.motion.move_to(at(0), 1);
        encoder.follow(at(0), setup(2), &Mcm260xRules::plain());
        assert_eq!(encoder.count, i32::MIN);
        assert!(!encoder.is_quiet());
        encoder.interval_ends(true);
        encoder.interval_ends(true);
        assert!(encoder.is_quiet());
    }
}
