//! Alarms 1 and 2 (manual, chapter 9 and parameters 56 to 62, 68 to 74).

use canopen::{Dictionary, Mux};

use super::delay::Delayed;
use super::objects::{parameter, value};
use super::rules::Drr460Rules;

/// One alarm.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Alarm {
    /// 3000h sub 56 as it was at the last sample: another kind begins anew.
    kind: i64,
    /// The condition, hysteresis included.
    condition: bool,
    /// Whether the condition was absent since the start.
    was_absent: bool,
    active: Delayed,
    /// Waits to be reset by hand.
    latched: bool,
}

/// What the alarms look at.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sight {
    /// Process value in digits.
    pub(super) process: i64,
    /// The set point in force.
    pub(super) set_point: i64,
    /// The process value cannot be measured.
    pub(super) sensor_error: bool,
    /// START, not STOP.
    pub(super) running: bool,
}

/// The settings of one alarm.
struct Settings {
    kind: i64,
    output: i64,
    hysteresis: i64,
    error_state: i64,
    stop_state: i64,
    latches: bool,
    delay: i64,
    set_point: i64,
    remote: bool,
}

impl Settings {
    fn of(number: u16, od: &Dictionary, rules: &dyn Drr460Rules) -> Self {
        let first = FIRST_PARAMETER[usize::from(number)];
        let parameter = |offset| parameter(od, first + offset);
        Self {
            kind: rules.alarm_kind(parameter(0)),
            output: parameter(1),
            hysteresis: rules.hysteresis(parameter(2)),
            error_state: parameter(3),
            stop_state: rules.stop_state(parameter(4)),
            latches: rules.latches(parameter(5)),
            delay: rules.alarm_delay(parameter(6)),
            set_point: value(od, rules.alarm_set_point(number)),
            remote: rules.remote_alarm(value(od, Mux::new(REMOTE + number, 0))),
        }
    }
}

impl Alarm {
    /// One sample of alarm `number`, counted from 0. Returns whether its contact is closed.
    pub(super) fn sample(
        &mut self,
        number: u16,
        sight: &Sight,
        od: &Dictionary,
        rules: &dyn Drr460Rules,
    ) -> bool {
        let settings = Settings::of(number, od, rules);
        if settings.kind != self.kind {
            *self = Self { kind: settings.kind, ..Self::default() };
        }
        if settings.kind == OFF {
            return false;
        }
        if !sight.running && settings.stop_state != WORKS_IN_STOP {
            let Self { kind, latched, .. } = *self;
            *self = Self { kind, latched, ..Self::default() };
            return is_closed(settings.stop_state);
        }
        if sight.sensor_error && COMPARES_PROCESS.contains(&settings.kind) {
            return is_closed(settings.error_state);
        }
        self.condition = self.is_met(&settings, sight, rules);
        self.was_absent |= !self.condition || rules.armed_from_start(settings.output);
        let active = self.active.follow(self.condition && self.was_absent, settings.delay);
        self.latched = settings.latches && (self.latched || active);
        (active || self.latched) != rules.normally_closed(settings.output)
    }

    /// Whether it can be reset by hand: its condition is gone, and it is still there.
    pub(super) const fn resettable(&self) -> bool {
        self.latched && !self.active.is_on()
    }

    /// Resets it by hand; nothing happens while its condition lasts.
    pub(super) const fn reset(&mut self) {
        self.latched &= self.active.is_on();
    }

    /// The device was switched on; what waits to be reset is kept with reset type 2.
    pub(super) fn restart(&mut self, number: u16, od: &Dictionary) {
        let first = FIRST_PARAMETER[usize::from(number)];
        let kept = self.latched && parameter(od, first + 5) == RESET_STORED;
        *self = Self { kind: parameter(od, first), latched: kept, ..Self::default() };
    }

    fn is_met(&self, settings: &Settings, sight: &Sight, rules: &dyn Drr460Rules) -> bool {
        let deviation = rules.deviation(sight.process, sight.set_point);
        let limit = settings.set_point;
        match settings.kind {
            1 => self.above(sight.process, limit, settings),
            2 => self.below(sight.process, limit, settings),
            3 => self.above(rules.band(deviation), limit, settings),
            4 => self.above(deviation, limit, settings),
            5 => self.below(deviation, rules.lower_deviation(limit), settings),
            6 => self.above(sight.set_point, limit, settings),
            7 => self.below(sight.set_point, limit, settings),
            8 => sight.running,
            11 => sight.sensor_error,
            12 => settings.remote,
            _ => false,
        }
    }

    /// Between the limit and the limit plus hysteresis the condition stays what it is.
    fn above(&self, value: i64, limit: i64, settings: &Settings) -> bool {
        let other = limit + settings.hysteresis;
        value >= limit.max(other) || self.condition && value >= limit.min(other)
    }

    fn below(&self, value: i64, limit: i64, settings: &Settings) -> bool {
        let other = limit + settings.hysteresis;
        value <= limit.min(other) || self.condition && value <= limit.max(other)
    }
}

/// How a contact is coded in parameters 20, 21, 59, 60, 71 and 72: odd is closed.
pub(super) const fn is_closed(code: i64) -> bool {
    code % 2 == 1
}

const FIRST_PARAMETER: [u8; 2] = [56, 68];
/// 400Ch, followed by 400Dh.
const REMOTE: u16 = 0x400C;
const OFF: i64 = 0;
const WORKS_IN_STOP: i64 = 4;
const RESET_STORED: i64 = 2;
/// Kinds that mean nothing without a process value.
const COMPARES_PROCESS: std::ops::RangeInclusive<i64> = 1..=5;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices;
    use crate::devices::drr460::rules::Manual;

    /// Process values, and whether they are in alarm.
    type Steps = &'static [(i64, bool)];

    /// An alarm with these parameters, as offsets from 56, and this set point.
    struct Fixture {
        od: Dictionary,
        alarm: Alarm,
        sight: Sight,
    }

    impl Fixture {
        fn new(set_point: i64, parameters: &[(u8, i64)]) -> Self {
            let eds = devices::device("drr460").unwrap().description.eds;
            let mut od = Dictionary::new(&eds, 1).unwrap();
            od.set_int(Mux::new(0x4001, 0), set_point);
            od.set_int(Mux::new(0x3000, 58), 0);
            for (offset, number) in parameters {
                od.set_int(Mux::new(0x3000, 56 + offset), *number);
            }
            let sight = Sight { process: 0, set_point: 0, sensor_error: false, running: true };
            Self { od, alarm: Alarm::default(), sight }
        }

        fn at(&mut self, process: i64) -> bool {
            self.sight.process = process;
            self.sample()
        }

        fn sample(&mut self) -> bool {
            self.alarm.sample(0, &self.sight, &self.od, &Manual)
        }
    }

    #[test]
    fn every_kind_has_its_side_of_the_threshold() {
        // Kind, alarm set point, and what follows with the set point 0.
        let table: [(i64, i64, Steps); 6] = [
            (1, 100, &[(99, false), (100, true), (99, false)]),
            (2, 100, &[(101, false), (100, true), (101, false)]),
            (3, 100, &[(0, false), (100, true), (-99, false), (-100, true)]),
            (4, 100, &[(99, false), (100, true), (-200, false)]),
            (5, 100, &[(-99, false), (-100, true), (200, false)]),
            (5, -100, &[(101, false), (100, true)]),
        ];
        for (kind, set_point, steps) in table {
            let mut fixture = Fixture::new(set_point, &[(0, kind)]);
            for (process, alarm) in steps {
                assert_eq!(fixture.at(*process), *alarm, "kind {kind} at {process}");
            }
        }
    }

    #[test]
    fn deviations_follow_the_set_point() {
        let mut fixture = Fixture::new(100, &[(0, 4)]);
        fixture.sight.set_point = 500;
        assert!(!fixture.at(599));
        assert!(fixture.at(600));
        let mut fixture = Fixture::new(100, &[(0, 6)]);
        fixture.sight.set_point = 99;
        assert!(!fixture.at(5000));
        fixture.sight.set_point = 100;
        assert!(fixture.at(0));
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
            let mut fixture = Fixture::new(100, &[(0, kind), (2, hysteresis)]);
            for (process, alarm) in steps {
                assert_eq!(fixture.at(process), alarm, "kind {kind}, {hysteresis}, at {process}");
            }
        }
    }

    #[test]
    fn outputs_can_be_inverted_and_wait_for_the_first_good_value() {
        let mut fixture = Fixture::new(100, &[(0, 1), (1, 1)]);
        assert!(fixture.at(0) && !fixture.at(200));
        let mut fixture = Fixture::new(100, &[(0, 1), (1, 2)]);
        assert!(!fixture.at(200) && !fixture.at(0) && fixture.at(200));
        let mut fixture = Fixture::new(100, &[(0, 1), (1, 3)]);
        assert!(fixture.at(200) && fixture.at(0) && !fixture.at(200));
    }

    #[test]
    fn a_manual_reset_works_when_the_condition_is_gone() {
        let mut fixture = Fixture::new(100, &[(0, 1), (5, 1)]);
        assert!(fixture.at(100) && !fixture.alarm.resettable());
        fixture.alarm.reset();
        assert!(fixture.at(100) && fixture.at(0) && fixture.alarm.resettable());
        fixture.alarm.reset();
        assert!(!fixture.at(0) && !fixture.alarm.resettable());
    }

    #[test]
    fn only_a_stored_latch_survives_a_restart() {
        for (reset, kept) in [(1, false), (2, true)] {
            let mut fixture = Fixture::new(100, &[(0, 1), (5, reset)]);
            assert!(fixture.at(100));
            let Fixture { od, alarm, .. } = &mut fixture;
            alarm.restart(0, od);
            assert_eq!(fixture.at(0), kept);
        }
    }

    #[test]
    fn stop_and_errors_have_their_own_states() {
        let mut fixture = Fixture::new(100, &[(0, 1), (3, 1), (4, 1)]);
        fixture.sight.running = false;
        assert!(fixture.at(0));
        fixture.sight = Sight { running: true, sensor_error: true, ..fixture.sight };
        assert!(fixture.at(0));
        let mut fixture = Fixture::new(100, &[(0, 1), (4, 4)]);
        fixture.sight.running = false;
        assert!(fixture.at(100) && !fixture.at(0));
    }

    #[test]
    fn some_kinds_look_at_something_else() {
        let mut fixture = Fixture::new(0, &[(0, 8)]);
        assert!(fixture.sample());
        let mut fixture = Fixture::new(0, &[(0, 11)]);
        assert!(!fixture.sample());
        fixture.sight.sensor_error = true;
        assert!(fixture.sample());
        let mut fixture = Fixture::new(0, &[(0, 12)]);
        assert!(!fixture.sample());
        fixture.od.set_int(Mux::new(0x400C, 0), 1);
        assert!(fixture.sample());
    }
}
