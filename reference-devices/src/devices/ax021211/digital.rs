//! The digital output (1.2): polarity, delay and hotshot.

use std::time::Duration;

use canopen::{Instant, Mux};

use super::objects::{
    BLINK_RATE, DELAY_POLARITY, DELAY_TIME, DIGITAL_FAULT_MODE, DIGITAL_FAULT_STATE, DIGITS_FV,
    HOLD_CURRENT, HOTSHOT_CURRENT, HOTSHOT_TIME, POLARITIES, Parameters,
};
use super::output::Command;
use super::rules::Ax021211Rules;

/// How long a command that has ended is still seen, for a deviation.
const MOMENT: Duration = Duration::from_millis(100);

/// The settings of a digital output.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct DigitalSettings {
    /// The drive state is the opposite of the logic state (table 1).
    inverse: bool,
    /// A fault leaves the output as it was instead of bringing it to its fault state (table 2).
    pub(super) keeps_on_fault: bool,
    pub(super) fault_state: bool,
    delay: Duration,
    /// The state that is reached late.
    delayed_state: bool,
    /// In milliamperes.
    hotshot: f64,
    hold: f64,
    hotshot_time: Duration,
    /// How long the output is on, and then off, while it is commanded on.
    blinking: Option<Duration>,
}

impl DigitalSettings {
    pub(super) fn read(od: Parameters<'_>, place: usize) -> Self {
        let digits = od.byte(DIGITS_FV, place);
        let bit = od.rules.place(POLARITIES.index, place);
        // A bit for each output, or in the form of 2.3.2 an entry.
        let has_entries = od.od.int(Mux::new(POLARITIES.index, 2)).is_some();
        let polarity = match has_entries {
            true => od.int(POLARITIES.index, place),
            false => od.int(POLARITIES.index, 0) >> bit & 1,
        };
        let blinks = od.rules.blinks(polarity);
        Self {
            inverse: polarity != 0 && !blinks,
            blinking: blinks.then(|| od.time(BLINK_RATE, place)),
            keeps_on_fault: od.int(DIGITAL_FAULT_MODE, place) == 0,
            fault_state: od.flag(DIGITAL_FAULT_STATE, place),
            delay: od.time(DELAY_TIME, place),
            delayed_state: od.int(DELAY_POLARITY, place) != 0,
            hotshot: od.scaled(HOTSHOT_CURRENT, place, digits),
            hold: od.scaled(HOLD_CURRENT, place, digits),
            hotshot_time: od.time(HOTSHOT_TIME, place),
        }
    }
}

/// A digital output at work.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Digital {
    /// The command of the control input, or of what replaces it.
    pub(super) logic: bool,
    pub(super) drive: bool,
    /// Since when the control input has commanded a state that is reached late.
    waiting: Option<Instant>,
    /// When the hotshot ends.
    hotshot_end: Option<Instant>,
    /// When a blinking output came on.
    blinking_since: Option<Instant>,
    due: Option<Instant>,
}

impl Digital {
    /// The control input commands a state.
    pub(super) fn command(
        &mut self,
        now: Instant,
        on: bool,
        settings: &DigitalSettings,
        is_hotshot: bool,
        rules: &Ax021211Rules,
    ) {
        self.logic = on;
        self.due = None;
        if let Some(rate) = settings.blinking.filter(|_| !is_hotshot) {
            // `blink` divides by the rate, which may be 0.
            return self.blink(now, on, rate.max(Duration::from_millis(1)));
        }
        self.blinking_since = None;
        let wanted = rules.polarity(settings.inverse) != on;
        let late = (!is_hotshot || rules.hotshot_is_delayed())
            && rules.delays(settings.inverse)
            && wanted != self.drive
            && rules.is_delayed_edge(wanted, settings.delayed_state);
        if !late {
            if self.outlasts(now, wanted, settings, rules) {
                return;
            }
            self.waiting = None;
            self.drive = wanted;
            return;
        }
        let due = *self.waiting.get_or_insert(now) + rules.delay(settings.delay);
        if due <= now {
            self.waiting = None;
            self.drive = wanted;
        } else {
            self.due = Some(due);
        }
    }

    /// Whether a delay goes on without its command, for a deviation; at its end the output changes
    /// for a moment.
    fn outlasts(
        &mut self,
        now: Instant,
        wanted: bool,
        settings: &DigitalSettings,
        rules: &Ax021211Rules,
    ) -> bool {
        let Some(since) = self.waiting.filter(|_| !rules.delay_ends_with_its_command()) else {
            return false;
        };
        let end = since + rules.delay(settings.delay);
        if now >= end + MOMENT {
            return false;
        }
        self.drive = wanted != (end <= now);
        self.due = Some(if end <= now { end + MOMENT } else { end });
        true
    }

    /// On for the rate, then off for it, as long as the output is commanded on (2.4.4).
    fn blink(&mut self, now: Instant, on: bool, rate: Duration) {
        self.waiting = None;
        if !on {
            (self.blinking_since, self.drive) = (None, false);
            return;
        }
        let since = *self.blinking_since.get_or_insert(now);
        let turns = now.since(since).as_nanos() / rate.as_nanos();
        self.drive = turns.is_multiple_of(2);
        self.due = Some(since + rate * (turns as u32 + 1));
    }

    /// Something else than the control input sets the state at which the output drives.
    pub(super) fn force(
        &mut self,
        on: bool,
        by: Command,
        settings: &DigitalSettings,
        rules: &Ax021211Rules,
    ) {
        self.logic = on;
        self.drive = rules.forced(on, settings.inverse, by);
        self.hold();
    }

    /// The state stays as it is.
    pub(super) const fn hold(&mut self) {
        self.waiting = None;
        self.due = None;
    }

    /// A fault leaves the state as it is.
    pub(super) fn keep(&mut self, now: Instant, rules: &Ax021211Rules) {
        if !rules.hotshot_ends_in_a_fault() {
            let later = |end| if now < end { now + Duration::from_secs(3600) } else { end };
            self.hotshot_end = self.hotshot_end.map(later);
        }
        self.hold();
    }

    /// The current of a hotshot output in milliamperes (figure 3).
    pub(super) fn current(
        &mut self,
        now: Instant,
        settings: &DigitalSettings,
        rules: &Ax021211Rules,
    ) -> f64 {
        if !self.drive {
            self.hotshot_end = self.hotshot_end.filter(|_| !rules.hotshot_is_armed_again());
            return 0.0;
        }
        let time = rules.hotshot_time(settings.hotshot_time);
        let end = *self.hotshot_end.get_or_insert(now + time);
        let (hotshot, hold) = rules.hotshot_currents(settings.hotshot, settings.hold);
        if now < end {
            self.due = Some(end);
            hotshot
        } else {
            hold
        }
    }

    /// When time alone changes the output next.
    pub(super) const fn due(&self) -> Option<Instant> {
        self.due
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::ax021211::rules::Ax021211Rules;

    fn at(millis: u64) -> Instant {
        Instant(millis * 1_000_000)
    }

    fn drive(settings: &DigitalSettings, commands: &[(u64, bool)]) -> Vec<bool> {
        let mut digital = Digital::default();
        let follow = |(millis, on): &(u64, bool)| {
            digital.command(at(*millis), *on, settings, false, &Ax021211Rules::plain());
            digital.drive
        };
        commands.iter().map(follow).collect()
    }

    #[test]
    fn table_1_turns_the_logic_state_round() {
        let normal = DigitalSettings { delayed_state: true, ..DigitalSettings::default() };
        assert_eq!(drive(&normal, &[(0, false), (1, true), (2, false)]), [false, true, false]);
        let inverse = DigitalSettings { inverse: true, ..normal };
        assert_eq!(drive(&inverse, &[(0, false), (1, true), (2, false)]), [true, false, true]);
    }

    #[test]
    fn an_edge_that_is_delayed_must_last() {
        let rising = DigitalSettings {
            delay: Duration::from_millis(100),
            delayed_state: true,
            ..DigitalSettings::default()
        };
        let commands = [(0, true), (99, true), (100, true), (150, false), (160, true)];
        assert_eq!(drive(&rising, &commands), [false, false, true, false, false]);
        let commands = [(0, true), (60, false), (70, true), (169, true), (170, true)];
        assert_eq!(drive(&rising, &commands), [false, false, false, false, true]);
        let falling = DigitalSettings { delayed_state: false, ..rising };
        let commands = [(0, true), (10, false), (109, false), (110, false)];
        assert_eq!(drive(&falling, &commands), [true, true, true, false]);
        let inverse = DigitalSettings { inverse: true, ..rising };
        assert_eq!(drive(&inverse, &[(0, false), (1, true)]), [true, false]);
    }

    #[test]
    fn figure_3_drops_from_hotshot_to_hold() {
        let settings = DigitalSettings {
            hotshot: 2000.0,
            hold: 500.0,
            hotshot_time: Duration::from_millis(1000),
            ..DigitalSettings::default()
        };
        let mut digital = Digital::default();
        let mut see = |millis, on| {
            digital.command(at(millis), on, &settings, true, &Ax021211Rules::plain());
            digital.current(at(millis), &settings, &Ax021211Rules::plain())
        };
        assert_eq!([see(0, false), see(10, true), see(1009, true)], [0.0, 2000.0, 2000.0]);
        assert_eq!([see(1010, true), see(5000, true), see(5001, false)], [500.0, 500.0, 0.0]);
        assert_eq!([see(5002, true), see(6002, true)], [2000.0, 500.0]);
    }
}
