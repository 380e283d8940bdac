//! The lookup table (1.5): up to ten slopes over data or over time.

use std::time::Duration;

use canopen::Instant;

use super::objects::{Parameters, digits, power, table};
use super::rules::Ax021211Rules;
use super::signal::{Link, PERCENT, Signal};

/// The points of a table.
pub(super) const POINTS: usize = 11;

/// The settings of a table.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct TableSettings {
    pub(super) x: Link,
    repeats: bool,
    /// The X-axis is time.
    timed: bool,
    y_digits: u8,
    responses: [Response; POINTS],
    x_points: [f64; POINTS],
    y_points: [f64; POINTS],
    limits: (f64, f64),
}

/// How a point is reached (table 12).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Response {
    /// This point and all that follow are not there.
    Ignore,
    #[default]
    Ramp,
    Jump,
}

impl TableSettings {
    pub(super) fn read(od: Parameters<'_>, place: usize) -> Self {
        let place = od.rules.block(table(0, 0), place);
        let index = |item| table(place, item);
        let x_digits = od.var(index(3)) as u8;
        let y_digits = od.var(index(4)) as u8;
        let timed = od.int(index(5), 0) == 1;
        // In a time response the X-axis has no digits (1.5.4).
        let x_digits = if timed { od.rules.digits_of_time(x_digits) } else { x_digits };
        let response = |point| match od.rules.point_response(od.byte(index(5), point)) {
            0 => Response::Ignore,
            2 => Response::Jump,
            _ => Response::Ramp,
        };
        let settings = Self {
            x: Link::new(od.var(index(0)) as u8, od.var(index(1)) as u8),
            repeats: od.rules.repeats(od.var(index(2)) != 0),
            timed,
            y_digits,
            responses: std::array::from_fn(response),
            x_points: std::array::from_fn(|point| od.scaled(index(6), point, x_digits)),
            y_points: std::array::from_fn(|point| od.scaled(index(7), point, y_digits)),
            limits: PERCENT,
        };
        let mut settings = Self { limits: settings.limits(od.rules), ..settings };
        if timed && od.rules.first_point(7).is_none() {
            settings.y_points[0] = 0.0;
        }
        settings
    }

    /// The limits of the output (1.5.2): those of a percentage as long as every point is within
    /// them, ignored points among them, or else the lowest and the highest point.
    fn limits(&self, rules: &Ax021211Rules) -> (f64, f64) {
        let counted = rules.points_of_limits(self.points());
        let points = &self.y_points[..counted];
        let low = points.iter().copied().fold(f64::INFINITY, f64::min);
        let high = points.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        rules.table_limits(low, high)
    }

    /// How many points there are before the first ignored one.
    fn points(&self) -> usize {
        let ignored = |point: &usize| self.responses[*point] == Response::Ignore;
        (1..POINTS).find(ignored).unwrap_or(POINTS)
    }

    /// The output over data (1.5.1 to 1.5.3).
    pub(super) fn over_data(&self, x: f64, rules: &Ax021211Rules) -> f64 {
        let last = rules.points_in_use(self.points());
        if rules.is_before_table(x, self.x_points[0]) {
            return rules.below_table(x, (self.x_points[0], self.y_points[0]));
        }
        let reached = |point: &usize| rules.within_segment(x, self.x_points[*point]);
        match (1..last).find(reached) {
            Some(point) => {
                let from = self.x_points[point - 1];
                self.towards(point, x - from, self.x_points[point] - from, rules)
            }
            None => {
                let end = rules.end_of_table(last, x > self.x_points[POINTS - 1]);
                rules.beyond_table(self.y_points[end - 1])
            }
        }
    }

    /// The output between the point before and this one, a part of the way on.
    fn towards(&self, point: usize, gone: f64, way: f64, rules: &Ax021211Rules) -> f64 {
        let (from, to) = (self.y_points[point - 1], self.y_points[point]);
        match self.responses[point] {
            Response::Jump => rules.jump(from, to),
            _ if way <= 0.0 => to,
            _ => from + (to - from) * gone / way,
        }
    }

    /// The output `millis` after the input came on (1.5.4), and when it is another one next.
    fn over_time(&self, millis: f64, rules: &Ax021211Rules) -> (f64, Next) {
        let last = rules.points_in_use(self.points());
        let whole: f64 = (1..last).map(|point| self.interval(point, rules)).sum();
        let done = millis >= whole;
        if done && !(self.repeats && whole > 0.0) {
            return (rules.after_sequence(self.y_points[last - 1]), Next::Never);
        }
        let turn = if done { (millis / whole).floor() * whole } else { 0.0 };
        let mut gone = millis - turn;
        for point in 1..last {
            let interval = self.interval(point, rules);
            if gone < interval {
                let moves = self.responses[point] == Response::Ramp
                    && self.y_points[point] != self.y_points[point - 1];
                let next = match moves {
                    true => Next::AtOnce,
                    false => Next::After(millis - gone + interval),
                };
                return (self.towards(point, gone, interval, rules), next);
            }
            gone -= interval;
        }
        (self.y_points[last - 1], Next::AtOnce)
    }

    /// The time from the point before to this one, in milliseconds.
    fn interval(&self, point: usize, rules: &Ax021211Rules) -> f64 {
        rules.interval(self.x_points[point - 1], self.x_points[point]).max(1.0)
    }
}

/// When the output of a sequence changes next.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Next {
    AtOnce,
    /// Milliseconds after its start.
    After(f64),
    Never,
}

/// A table at work.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Table {
    /// Since when the input of a time response has been on.
    on_since: Option<Instant>,
    due: Option<Instant>,
    held: f64,
}

impl Table {
    /// The output of the table, which 3yz8h shows.
    pub(super) fn evaluate(
        &mut self,
        now: Instant,
        settings: &TableSettings,
        x: Signal,
        rules: &Ax021211Rules,
    ) -> (i64, Signal) {
        self.due = None;
        let used = settings.x.is_used() && (x.is_valid() || x.has_failed());
        if !used {
            let held = digits(self.held, settings.y_digits);
            *self = Self { held: self.held, ..Self::default() };
            return (rules.table_without_source(held), Signal::ABSENT);
        }
        let y = match settings.timed {
            _ if x.has_failed() => rules.table_in_error(self.held),
            true => self.sequence(now, settings, rules.sequence_runs(rules.is_on(x)), rules),
            false => settings.over_data(rules.table_input(x.value, settings.repeats), rules),
        };
        self.held = y;
        let shown = digits(y, settings.y_digits);
        let value = shown as f64 / power(settings.y_digits);
        let signal = Signal::new(value, Some(settings.limits));
        (shown, signal.failing(x.has_failed()))
    }

    fn sequence(
        &mut self,
        now: Instant,
        settings: &TableSettings,
        on: bool,
        rules: &Ax021211Rules,
    ) -> f64 {
        if !on {
            self.on_since = self.on_since.filter(|_| !rules.sequence_begins_anew());
            return rules.sequence_off(self.held);
        }
        let start = *self.on_since.get_or_insert(now);
        let millis = now.since(start).as_secs_f64() * 1000.0;
        let (y, next) = settings.over_time(millis, rules);
        self.due = match next {
            Next::AtOnce => Some(now),
            Next::After(millis) => Some(start + Duration::from_secs_f64(millis / 1000.0)),
            Next::Never => None,
        };
        y
    }

    /// When time alone changes the output next.
    pub(super) const fn due(&self) -> Option<Instant> {
        self.due
    }
}

/// The limits of 1.5.2 for the lowest and the highest point of the Y-axis.
pub(super) fn limits_of(low: f64, high: f64) -> (f64, f64) {
    let within = |y: f64| (PERCENT.0..=PERCENT.1).contains(&y);
    if within(low) && within(high) { PERCENT } else { (low, high) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::ax021211::rules::Ax021211Rules;
    use crate::devices::ax021211::signal::Quality;

    fn table(x: [f64; 11], y: [f64; 11]) -> TableSettings {
        TableSettings { x: Link::new(1, 11), x_points: x, y_points: y, ..TableSettings::default() }
    }

    fn steps_of_ten() -> TableSettings {
        let points = std::array::from_fn(|point| 10.0 * point as f64);
        table(points, points)
    }

    #[test]
    fn figure_10_ramps_or_jumps_from_point_to_point() {
        let ramps = steps_of_ten();
        let mut jumps = ramps;
        jumps.responses = [Response::Jump; 11];
        for (x, ramp, jump) in [
            (-5.0, 0.0, 0.0),
            (0.0, 0.0, 0.0),
            (0.1, 0.1, 10.0),
            (10.0, 10.0, 10.0),
            (10.5, 10.5, 20.0),
            (99.0, 99.0, 100.0),
            (150.0, 100.0, 100.0),
        ] {
            assert_eq!(ramps.over_data(x, &Ax021211Rules::plain()), ramp, "{x}");
            assert_eq!(jumps.over_data(x, &Ax021211Rules::plain()), jump, "{x}");
        }
    }

    #[test]
    fn an_ignored_point_takes_the_rest_with_it() {
        let mut table = steps_of_ten();
        table.responses[4] = Response::Ignore;
        assert_eq!(table.over_data(29.0, &Ax021211Rules::plain()), 29.0);
        assert_eq!(table.over_data(35.0, &Ax021211Rules::plain()), 30.0);
        assert_eq!(table.over_data(100.0, &Ax021211Rules::plain()), 30.0);
    }

    #[test]
    fn figure_11_mirrors_a_joystick_about_its_dead_band() {
        // Centre at 2500 mV, dead-band from 2250 to 2750 mV, two slopes on each side.
        let rest = [5000.0; 7];
        let mut x = [0.0, 1000.0, 2250.0, 2750.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        x[4..].copy_from_slice(&rest);
        let mut y = [100.0, 75.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        let profile_a = table(x, y);
        y = [0.0, 0.0, 0.0, 0.0, 75.0, 100.0, 100.0, 100.0, 100.0, 100.0, 100.0];
        x = [0.0, 1000.0, 2250.0, 2750.0, 4000.0, 5000.0, 5000.0, 5000.0, 5000.0, 5000.0, 5000.0];
        let profile_b = table(x, y);
        for (position, a, b) in [
            (0.0, 100.0, 0.0),
            (500.0, 87.5, 0.0),
            (1000.0, 75.0, 0.0),
            (1625.0, 37.5, 0.0),
            (2250.0, 0.0, 0.0),
            (2500.0, 0.0, 0.0),
            (2750.0, 0.0, 0.0),
            (3375.0, 0.0, 37.5),
            (4500.0, 0.0, 87.5),
            (5000.0, 0.0, 100.0),
        ] {
            assert_eq!(
                profile_a.over_data(position, &Ax021211Rules::plain()),
                a,
                "A at {position}"
            );
            assert_eq!(
                profile_b.over_data(position, &Ax021211Rules::plain()),
                b,
                "B at {position}"
            );
        }
    }

    #[test]
    fn limits_are_those_of_a_percentage_as_long_as_they_hold_all_points() {
        let mut table = steps_of_ten();
        assert_eq!(table.limits(&Ax021211Rules::plain()), (0.0, 100.0));
        table.y_points = [20.0; 11];
        assert_eq!(table.limits(&Ax021211Rules::plain()), (0.0, 100.0));
        table.responses[2] = Response::Ignore;
        table.y_points[10] = 500.0;
        assert_eq!(table.limits(&Ax021211Rules::plain()), (20.0, 500.0));
        table.y_points[9] = -50.0;
        table.y_points[10] = 80.0;
        assert_eq!(table.limits(&Ax021211Rules::plain()), (-50.0, 80.0));
    }

    fn timed(repeats: bool) -> TableSettings {
        // 100 ms up to 50, a jump that holds 80 for 200 ms, 100 ms down to 0; the rest is ignored.
        let mut table = table(
            [0.0, 100.0, 200.0, 100.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0],
            [0.0, 50.0, 80.0, 0.0, 9.0, 9.0, 9.0, 9.0, 9.0, 9.0, 9.0],
        );
        table.responses[2] = Response::Jump;
        table.responses[4] = Response::Ignore;
        (table.timed, table.repeats) = (true, repeats);
        table
    }

    #[test]
    fn a_time_response_runs_while_its_input_is_on() {
        let on = Signal::new(1.0, None);
        let off = Signal::new(0.0, None);
        let at = |millis: u64| Instant(millis * 1_000_000);
        let settings = timed(false);
        let mut table = Table::default();
        let mut see =
            |millis, x| table.evaluate(at(millis), &settings, x, &Ax021211Rules::plain()).0;
        assert_eq!(see(0, off), 0);
        assert_eq!([1000, 1050, 1100, 1101].map(|time| see(time, on)), [0, 25, 80, 80]);
        assert_eq!([1299, 1300, 1350, 1400, 9000].map(|time| see(time, on)), [80, 80, 40, 0, 0]);
        assert_eq!([see(9001, off), see(9500, on), see(9550, on)], [0, 0, 25]);
        assert_eq!([see(9551, off), see(9552, on)], [0, 0]);
    }

    #[test]
    fn auto_repeat_begins_again_and_knows_when_it_changes() {
        let on = Signal::new(1.0, None);
        let at = |millis: u64| Instant(millis * 1_000_000);
        let (settings, mut table) = (timed(true), Table::default());
        let mut see = |millis| {
            let shown = table.evaluate(at(millis), &settings, on, &Ax021211Rules::plain()).0;
            (shown, table.due())
        };
        assert_eq!(see(0), (0, Some(at(0))));
        assert_eq!(see(150), (80, Some(at(300))));
        assert_eq!(see(400), (0, Some(at(400))));
        assert_eq!(see(450), (25, Some(at(450))));
        assert_eq!(see(550), (80, Some(at(700))));
    }

    #[test]
    fn a_table_without_source_is_absent_and_one_in_error_holds_its_value() {
        let (settings, mut table) = (steps_of_ten(), Table::default());
        let mut see = |settings: &TableSettings, x| {
            let (shown, signal) =
                table.evaluate(Instant::ZERO, settings, x, &Ax021211Rules::plain());
            (shown, signal.quality)
        };
        let x = Signal::new(42.0, None);
        assert_eq!(see(&settings, x), (42, Quality::Valid));
        assert_eq!(see(&settings, x.failing(true)), (42, Quality::Failed));
        assert_eq!(see(&settings, Signal::ABSENT), (0, Quality::Absent));
        let unused = TableSettings { x: Link::default(), ..settings };
        assert_eq!(see(&unused, x), (0, Quality::Absent));
    }
}
