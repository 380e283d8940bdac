//! LEDs and display (manual, 5.2, chapters 9, 10 and 12).

use std::time::Duration;

use canopen::{Instant, NmtState};

/// What makes the RUN LED flash.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Phase {
    /// It has no supply.
    #[default]
    Dark,
    /// It starts.
    BootUp,
    /// It is a node in this state, with an error or without one.
    Node(NmtState, bool),
    /// It works with Modbus RTU, and is off-line there or not.
    Modbus(bool),
}

/// How long an LED is on and off in turns, in milliseconds; nothing for one that is steady.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Pattern {
    first: bool,
    spans: &'static [u64],
}

impl Pattern {
    /// The pattern of the RUN LED (chapters 9 and 10).
    pub(super) const fn of(phase: Phase) -> Self {
        match phase {
            Phase::Dark => STEADY_OFF,
            Phase::BootUp => BLINK_FAST,
            Phase::Node(NmtState::OPERATIONAL, false) | Phase::Modbus(false) => STEADY_ON,
            Phase::Node(NmtState::OPERATIONAL, true) => BLINK_3_ON,
            Phase::Node(NmtState::STOPPED, false) => BLINK_1_OFF,
            Phase::Node(NmtState::STOPPED, true) => BLINK_3_OFF,
            Phase::Node(_, false) => BLINK_SLOW,
            Phase::Node(_, true) | Phase::Modbus(true) => BLINK_MEDIUM,
        }
    }

    /// Whether it is lit so long after its beginning, and how long it stays so; `None` for ever.
    fn after(self, time: Duration) -> (bool, Option<Duration>) {
        let period = Duration::from_millis(self.spans.iter().sum());
        if period.is_zero() {
            return (self.first, None);
        }
        let mut rest = Duration::from_nanos((time.as_nanos() % period.as_nanos()) as u64);
        let mut lit = self.first;
        for span in self.spans {
            let span = Duration::from_millis(*span);
            if rest < span {
                return (lit, Some(span - rest));
            }
            rest -= span;
            lit = !lit;
        }
        (self.first, Some(Duration::ZERO))
    }
}

/// An LED. It begins each pattern anew.
#[derive(Clone, Copy, Debug)]
pub(super) struct Led {
    pattern: Pattern,
    since: Instant,
    pub(super) lit: bool,
    next: Option<Instant>,
}

impl Default for Led {
    fn default() -> Self {
        Self { pattern: STEADY_OFF, since: Instant::ZERO, lit: false, next: None }
    }
}

impl Led {
    /// Shows a pattern.
    pub(super) fn show(&mut self, now: Instant, pattern: Pattern) {
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
    pub(super) const fn poll_at(&self) -> Option<Instant> {
        self.next
    }
}

/// The display: dark in normal operation, else the number of the first error of 4007h.
pub(super) fn display(flags: i64) -> String {
    match flags & 0xFFFF {
        0 => String::new(),
        flags => format!("E-{:02}", flags.trailing_zeros() + 1),
    }
}

pub(super) const STEADY_OFF: Pattern = Pattern { first: false, spans: &[] };
pub(super) const STEADY_ON: Pattern = Pattern { first: true, spans: &[] };
const BLINK_FAST: Pattern = Pattern { first: true, spans: &[50, 50] };
pub(super) const BLINK_MEDIUM: Pattern = Pattern { first: true, spans: &[200, 200] };
const BLINK_SLOW: Pattern = Pattern { first: true, spans: &[600, 600] };
/// On for 1 s, then three flashes of 150 ms.
const BLINK_3_ON: Pattern = Pattern { first: true, spans: &[1000, 150, 150, 150, 150, 150] };
/// Off but for a flash of 40 ms every 1.2 s.
const BLINK_1_OFF: Pattern = Pattern { first: true, spans: &[40, 1160] };
/// Off for 1 s, then three flashes of 150 ms.
const BLINK_3_OFF: Pattern = Pattern { first: false, spans: &[1000, 150, 150, 150, 150, 150] };

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_state_has_its_pattern() {
        let table = [
            (Phase::Dark, STEADY_OFF),
            (Phase::BootUp, BLINK_FAST),
            (Phase::Node(NmtState::PRE_OPERATIONAL, false), BLINK_SLOW),
            (Phase::Node(NmtState::PRE_OPERATIONAL, true), BLINK_MEDIUM),
            (Phase::Node(NmtState::OPERATIONAL, false), STEADY_ON),
            (Phase::Node(NmtState::OPERATIONAL, true), BLINK_3_ON),
            (Phase::Node(NmtState::STOPPED, false), BLINK_1_OFF),
            (Phase::Node(NmtState::STOPPED, true), BLINK_3_OFF),
            (Phase::Modbus(false), STEADY_ON),
            (Phase::Modbus(true), BLINK_MEDIUM),
        ];
        for (phase, pattern) in table {
            assert_eq!(Pattern::of(phase), pattern, "{phase:?}");
        }
    }

    /// The times in milliseconds at which the LED changes, up to 4 s.
    fn changes(pattern: Pattern) -> Vec<u64> {
        let mut led = Led::default();
        let (mut now, mut lit, mut changes) = (Instant::ZERO, !pattern.first, Vec::new());
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
        assert_eq!(changes(STEADY_ON), [0]);
        assert_eq!(changes(BLINK_SLOW), [0, 600, 1200, 1800, 2400, 3000, 3600]);
        assert_eq!(changes(BLINK_1_OFF), [0, 40, 1200, 1240, 2400, 2440, 3600, 3640]);
        let three = [0, 1000, 1150, 1300, 1450, 1600, 1750, 2750, 2900, 3050, 3200, 3350, 3500];
        assert_eq!(changes(BLINK_3_OFF), three);
        assert_eq!(changes(BLINK_3_ON), three);
        assert_eq!(changes(BLINK_FAST).len(), 81);
    }

    #[test]
    fn the_display_shows_the_first_error() {
        let table = [(0, ""), (1, "E-01"), (1 << 11, "E-12"), (1 << 15 | 1 << 13, "E-14")];
        for (flags, shown) in table {
            assert_eq!(display(flags), shown);
        }
    }
}
