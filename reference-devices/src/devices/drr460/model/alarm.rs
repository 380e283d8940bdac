//! An alarm (manual, chapter 9 and 11.3.2, parameters 56 to 62 and 68 to 74).

use super::cycle::Wanted;
use super::delay::Delayed;
use super::parameters::{NO_KIND, Parameters};
use super::rules::Rules;
use super::state::State;

/// The settings of one alarm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Settings {
    pub(super) kind: i64,
    contact: i64,
    hysteresis: i64,
    error: State,
    stop: State,
    latches: bool,
    kept: bool,
    delay: f64,
}

impl Settings {
    /// The settings of an alarm; alarms are counted from 0.
    pub(super) fn of(number: usize, parameters: &Parameters) -> Self {
        let get = |offset| parameters.get(parameters.rules.alarm_parameter(number, offset));
        Self {
            kind: get(0),
            contact: get(1),
            hysteresis: get(2),
            error: State(get(3)),
            stop: State(get(4)),
            latches: parameters.rules.latches(get(5)),
            kept: parameters.rules.kept_over_power_off(get(5)),
            delay: get(6) as f64,
        }
    }

    /// Whether it is the cooling output of a double loop.
    pub(super) const fn cools(&self) -> bool {
        self.kind == COOLING
    }
}

/// The inputs of an alarm.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Sight {
    /// In digits.
    pub(super) process: i64,
    /// The set point in force, in digits.
    pub(super) set_point: i64,
    /// The set point of the alarm, in digits.
    pub(super) limit: i64,
    /// There is no process value to go by.
    pub(super) error: bool,
    /// The sensor is broken.
    pub(super) sensor_error: bool,
    /// START, not STOP.
    pub(super) running: bool,
    /// The network asks for the alarm.
    pub(super) remote: bool,
    /// The value of 4000h; `set_point` is in force.
    pub(super) wanted: i64,
    /// Too little or too much current flows.
    pub(super) current_error: bool,
    /// The cooling demand of double loop.
    pub(super) cooling: f64,
}

/// One alarm.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Alarm {
    kind: i64,
    /// Hysteresis included.
    condition: bool,
    /// Whether the condition was absent since the start.
    was_absent: bool,
    active: Delayed,
    /// Waits to be reset by hand.
    latched: bool,
}

impl Alarm {
    /// The kind is selected, even if it is the same one.
    pub(super) const fn select_again(&mut self) {
        self.kind = NO_KIND;
    }

    /// The alarm's demand for its output.
    pub(super) fn step(&mut self, sight: &Sight, settings: &Settings, rules: &Rules) -> Wanted {
        if settings.kind != self.kind {
            let was_absent = !rules.selection_disarms();
            *self = Self { kind: settings.kind, was_absent, ..Self::default() };
        }
        if settings.kind == OFF {
            return Wanted::Level(false);
        }
        let fails = sight.error && rules.alarm_knows_errors(settings.kind);
        if !sight.running && settings.stop.0 != WORKS_IN_STOP {
            self.stop();
            let fails = fails && rules.error_goes_before_stop();
            return Wanted::State(if fails { settings.error } else { settings.stop });
        }
        if fails {
            return Wanted::State(settings.error);
        }
        if settings.cools() {
            let error = Wanted::State(settings.error);
            let in_error = sight.error && rules.cooling_knows_errors();
            return if in_error { error } else { Wanted::Share(sight.cooling) };
        }
        self.condition = self.is_met(sight, settings, rules);
        self.was_absent |= !self.condition || !rules.waits_for_absence(settings.contact);
        let condition = self.condition && self.was_absent;
        let closed = rules.normally_closed(settings.kind, settings.contact);
        let delay = rules.alarm_delay(settings.delay, closed);
        let active = self.active.follow(condition, delay, rules);
        self.latched = settings.latches && (self.latched || active);
        let alarm = active || self.latched;
        Wanted::Level(alarm != closed)
    }

    /// The controller is in STOP: the next START finds nothing but what waits for a reset by hand.
    fn stop(&mut self) {
        let Self { kind, latched, .. } = *self;
        *self = Self { kind, latched, ..Self::default() };
    }

    /// Advances the time.
    pub(super) fn advance(&mut self, elapsed: f64) {
        self.active.advance(elapsed);
    }

    /// Seconds up to the end of its delay, if it waits for that.
    pub(super) fn left(&self) -> Option<f64> {
        self.active.left()
    }

    /// Whether it can be reset by hand, as 400Bh shows.
    pub(super) fn resettable(&self, rules: &Rules) -> bool {
        rules.resettable(self.latched, self.active.is_on())
    }

    /// Resets it by hand; nothing happens while its condition lasts.
    pub(super) const fn reset(&mut self) {
        self.latched &= self.active.is_on();
    }

    /// The device was switched on.
    pub(super) fn restart(&mut self, settings: &Settings) {
        let latched = self.latched && settings.kept;
        *self = Self { kind: settings.kind, latched, ..Self::default() };
    }

    fn is_met(&self, sight: &Sight, settings: &Settings, rules: &Rules) -> bool {
        let deviation = rules.deviation(sight.process, sight.set_point);
        let above = |value, limit| self.above(value, limit, settings, rules);
        let below = |value, limit| self.below(value, limit, settings, rules);
        match settings.kind {
            1 => above(sight.process, sight.limit),
            2 => below(sight.process, sight.limit),
            3 => above(rules.band(deviation), sight.limit),
            4 => above(deviation, sight.limit),
            5 => below(deviation, rules.lower_deviation(sight.limit)),
            6 => above(rules.looked_at(sight.set_point, sight.wanted), sight.limit),
            7 => below(rules.looked_at(sight.set_point, sight.wanted), sight.limit),
            8 => sight.running,
            10 => sight.current_error,
            11 => sight.sensor_error,
            12 => sight.remote,
            _ => false,
        }
    }

    /// Between both thresholds the condition stays what it is.
    fn above(&self, value: i64, limit: i64, settings: &Settings, rules: &Rules) -> bool {
        let other = rules.second_threshold(limit, settings.hysteresis);
        let (on, off) = (value - limit.max(other), value - limit.min(other));
        rules.alarm_begins(on) || self.condition && rules.alarm_lasts(off)
    }

    fn below(&self, value: i64, limit: i64, settings: &Settings, rules: &Rules) -> bool {
        let other = rules.second_threshold(limit, settings.hysteresis);
        let (on, off) = (limit.min(other) - value, limit.max(other) - value);
        rules.alarm_begins(on) || self.condition && rules.alarm_lasts(off)
    }
}

const OFF: i64 = 0;
const COOLING: i64 = 9;
const WORKS_IN_STOP: i64 = 4;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::drr460::model::rules::Rules;

    /// An alarm with these parameters, as offsets from the first one.
    struct Fixture {
        alarm: Alarm,
        settings: Settings,
        sight: Sight,
    }

    impl Fixture {
        fn new(number: usize, limit: i64, list: &[(u8, i64)]) -> Self {
            let at = |offset| Rules::plain().alarm_parameter(number, offset);
            let list: Vec<_> = list.iter().map(|(offset, value)| (at(*offset), *value)).collect();
            let settings = Settings::of(number, &Parameters::listed(&list, &Rules::plain()));
            let sight = Sight { limit, running: true, ..Sight::default() };
            Self { alarm: Alarm::default(), settings, sight }
        }

        fn step(&mut self) -> Wanted {
            self.alarm.step(&self.sight, &self.settings, &Rules::plain())
        }

        fn at(&mut self, process: i64) -> bool {
            self.sight.process = process;
            self.step() == Wanted::Level(true)
        }
    }

    /// Process values, and whether there is an alarm.
    type Seen = &'static [(i64, bool)];
    type Happens = fn(&mut Sight);

    #[test]
    fn every_kind_has_its_side_of_the_threshold() {
        let table: [(i64, i64, Seen); 6] = [
            (1, 100, &[(99, false), (100, true), (99, false)]),
            (2, 100, &[(101, false), (100, true), (101, false)]),
            (3, 100, &[(0, false), (100, true), (-99, false), (-100, true)]),
            (4, 100, &[(99, false), (100, true), (-200, false)]),
            (5, 100, &[(-99, false), (-100, true), (200, false)]),
            (5, -100, &[(101, false), (100, true)]),
        ];
        for (kind, limit, steps) in table {
            for number in [0, 1] {
                let mut fixture = Fixture::new(number, limit, &[(0, kind)]);
                for (process, alarm) in steps {
                    assert_eq!(fixture.at(*process), *alarm, "{number} kind {kind} at {process}");
                }
            }
        }
    }

    #[test]
    fn the_sign_of_the_hysteresis_says_on_which_side_it_lies() {
        let table = [
            (1, 20, [(110, false), (120, true), (100, true), (99, false)]),
            (1, -20, [(99, false), (100, true), (80, true), (79, false)]),
            (2, 20, [(101, false), (100, true), (120, true), (121, false)]),
            (2, -20, [(81, false), (80, true), (100, true), (101, false)]),
        ];
        for (kind, hysteresis, steps) in table {
            let mut fixture = Fixture::new(0, 100, &[(0, kind), (2, hysteresis)]);
            for (process, alarm) in steps {
                assert_eq!(fixture.at(process), alarm, "kind {kind}, {hysteresis}, at {process}");
            }
        }
    }

    #[test]
    fn contacts_can_be_inverted_and_wait_for_the_first_good_value() {
        let mut fixture = Fixture::new(0, 100, &[(0, 1), (1, 1)]);
        assert!(fixture.at(0) && !fixture.at(200));
        let mut fixture = Fixture::new(0, 100, &[(0, 1), (1, 2)]);
        assert!(!fixture.at(200) && !fixture.at(0) && fixture.at(200));
        let mut fixture = Fixture::new(0, 100, &[(0, 1), (1, 3)]);
        assert!(fixture.at(200) && fixture.at(0) && !fixture.at(200));
    }

    #[test]
    fn a_reset_by_hand_works_when_the_condition_is_gone() {
        for (reset, kept) in [(1, false), (2, true)] {
            let mut fixture = Fixture::new(1, 100, &[(0, 1), (5, reset)]);
            assert!(fixture.at(100) && !fixture.alarm.resettable(&Rules::plain()));
            fixture.alarm.reset();
            assert!(fixture.at(100) && fixture.at(0) && fixture.alarm.resettable(&Rules::plain()));
            let before = fixture.alarm;
            fixture.alarm.restart(&fixture.settings);
            assert_eq!(fixture.at(0), kept);
            fixture.alarm = before;
            fixture.alarm.reset();
            assert!(!fixture.at(0) && !fixture.alarm.resettable(&Rules::plain()));
        }
    }

    #[test]
    fn stop_and_errors_have_their_own_states() {
        let mut fixture = Fixture::new(0, 100, &[(0, 1), (3, 2), (4, 1)]);
        fixture.sight.running = false;
        assert_eq!(fixture.step(), Wanted::State(State(1)));
        fixture.sight = Sight { running: true, error: true, ..fixture.sight };
        assert_eq!(fixture.step(), Wanted::State(State(2)));
        let mut fixture = Fixture::new(0, 100, &[(0, 1), (4, 4)]);
        fixture.sight.running = false;
        assert!(fixture.at(100) && !fixture.at(0));
    }

    #[test]
    fn some_kinds_look_at_something_else() {
        let table: [(i64, Happens); 6] = [
            (6, |sight| sight.set_point = 100),
            (7, |sight| sight.set_point = 99),
            (8, |_| {}),
            (10, |sight| sight.current_error = true),
            (11, |sight| sight.sensor_error = true),
            (12, |sight| sight.remote = true),
        ];
        for (kind, happens) in table {
            let mut fixture = Fixture::new(0, 99 + i64::from(kind == 6), &[(0, kind)]);
            fixture.sight.set_point = if kind == 7 { 100 } else { 0 };
            assert_eq!(fixture.step(), Wanted::Level(kind == 8), "{kind}");
            happens(&mut fixture.sight);
            assert_eq!(fixture.step(), Wanted::Level(true), "{kind}");
        }
    }

    #[test]
    fn one_kind_cools() {
        let mut fixture = Fixture::new(1, 0, &[(0, 9), (1, 1)]);
        fixture.sight.cooling = 0.3;
        assert_eq!(fixture.step(), Wanted::Share(0.3));
    }
}
