//! The PID control (1.4).

use std::time::Duration;

use canopen::Instant;

use super::objects::{
    PID_CYCLE, PID_DERIVATIVE_GAIN, PID_DERIVATIVE_TIME, PID_DIGITS, PID_FEEDBACK_NUMBER,
    PID_FEEDBACK_SOURCE, PID_GAIN, PID_INTEGRAL_GAIN, PID_INTEGRAL_TIME, PID_RESPONSE,
    PID_TARGET_NUMBER, PID_TARGET_SOURCE, PID_TOLERANCE, Parameters, digits, power,
};
use super::rules::Ax021211Rules;
use super::signal::{Link, PERCENT, Signal};

/// The settings of a PID control. Times in seconds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct PidSettings {
    pub(super) target: Link,
    pub(super) feedback: Link,
    gains: Gains,
    cycle: f64,
    /// In per cent.
    tolerance: f64,
    response: u8,
}

/// The gains and times behind the output of figure 8.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Gains {
    pub(super) proportional: f64,
    pub(super) integral: f64,
    pub(super) integral_time: f64,
    pub(super) derivative: f64,
    pub(super) derivative_time: f64,
}

impl Gains {
    /// `P_Gain`, `I_Gain` and `D_Gain` of figure 8 for a cycle in seconds.
    pub(super) fn of_cycle(self, cycle: f64) -> (f64, f64, f64) {
        let integral = match self.integral_time {
            0.0 => 0.0,
            time => self.proportional * self.integral * cycle / time,
        };
        let derivative = self.proportional * self.derivative * self.derivative_time / cycle;
        (self.proportional, integral, derivative)
    }
}

impl PidSettings {
    pub(super) fn read(od: Parameters<'_>, place: usize) -> Self {
        let place = od.rules.block(PID_GAIN, place);
        let digits = od.byte(PID_DIGITS, place);
        let time = |index| od.rules.pid_time(od.scaled(index, place, digits));
        Self {
            target: od.link(PID_TARGET_SOURCE, PID_TARGET_NUMBER, place),
            feedback: od.link(PID_FEEDBACK_SOURCE, PID_FEEDBACK_NUMBER, place),
            gains: Gains {
                proportional: od.scaled(PID_GAIN, place, 1),
                integral: od.scaled(PID_INTEGRAL_GAIN, place, 1),
                integral_time: time(PID_INTEGRAL_TIME),
                derivative: od.scaled(PID_DERIVATIVE_GAIN, place, 1),
                derivative_time: time(PID_DERIVATIVE_TIME),
            },
            cycle: time(PID_CYCLE).max(SHORTEST_CYCLE),
            tolerance: od.scaled(PID_TOLERANCE, place, 1),
            response: od.byte(PID_RESPONSE, place),
        }
    }
}

/// A PID control at work.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Pid {
    /// When the algorithm is called next; `None` while the loop is disabled.
    next: Option<Instant>,
    /// Its sources were taken away, and it does not run again.
    stopped: bool,
    /// The last call changed nothing, and neither would another one with the same inputs.
    idle: bool,
    sum: f64,
    last: f64,
    error: f64,
    /// The last error that was none; its sign is the side of the target.
    side: f64,
    /// In per cent.
    output: f64,
    /// The settings of the last call.
    settings: PidSettings,
}

impl Pid {
    /// The output of the control, which 2460h shows.
    pub(super) fn evaluate(
        &mut self,
        now: Instant,
        settings: &PidSettings,
        target: Signal,
        feedback: Signal,
        rules: &Ax021211Rules,
    ) -> (i64, Signal) {
        let sources = [settings.target, settings.feedback];
        let usable = |signal: Signal| signal.is_valid() || signal.has_failed();
        let chosen = sources.iter().all(|link| link.is_used());
        let enabled = rules.pid_is_enabled(chosen && usable(target) && usable(feedback), sources);
        if !enabled || self.stopped {
            let stopped = self.stopped || self.next.is_some() && !rules.pid_resumes();
            let kept = if rules.forgets() { Self::default() } else { *self };
            *self = Self { output: self.output, stopped, next: None, ..kept };
            return (rules.pid_disabled(digits(self.output, 1)), Signal::ABSENT);
        }
        let failed = target.has_failed() || feedback.has_failed();
        if failed {
            let kept = Self { next: None, idle: false, ..*self };
            *self = if rules.pid_forgets_in_error() { Self::default() } else { kept };
        } else {
            self.follow(now, settings, difference(target, feedback, rules), rules);
        }
        let shown = digits(self.output, 1);
        (shown, Signal::new(shown as f64 / power(1), Some(PERCENT)).failing(failed))
    }

    fn follow(
        &mut self,
        now: Instant,
        settings: &PidSettings,
        difference: f64,
        rules: &Ax021211Rules,
    ) {
        let tolerated = rules.is_tolerated(difference.abs(), settings.tolerance);
        let error = rules.counted(difference, settings.tolerance, tolerated);
        let cycle = Duration::from_secs_f64(settings.cycle);
        let mut next = self.next.unwrap_or(now);
        if self.idle && next < now {
            // Nothing was missed: the calls in between would have changed nothing.
            let missed = now.since(next).as_nanos().div_ceil(cycle.as_nanos().max(1));
            next += Duration::from_nanos((cycle.as_nanos() * missed) as u64);
        }
        while next <= now {
            self.call(settings, error, rules);
            next += cycle;
        }
        self.idle &= error == self.error && *settings == self.settings;
        self.next = Some(next);
    }

    /// The algorithm of figure 8.
    fn call(&mut self, settings: &PidSettings, error: f64, rules: &Ax021211Rules) {
        let before = (self.sum, self.last);
        let (p, i, d) = rules.pid_gains(settings.gains, settings.cycle);
        self.sum = rules.error_sum(self.sum, error);
        let output = p * error + i * self.sum + d * rules.error_step(error, self.last);
        (self.last, self.error, self.settings) = (error, error, *settings);
        self.side = rules.pid_side(self.side, error);
        self.output = rules.pid_output(settings.response, output, self.side);
        self.idle = before == (self.sum, self.last);
    }

    /// When time alone changes the output next.
    pub(super) fn due(&self) -> Option<Instant> {
        self.next.filter(|_| !self.idle)
    }
}

/// Target less feedback in per cent, each between the limits of its source; a target without
/// limits has those of the feedback (1.4).
fn difference(target: Signal, feedback: Signal, rules: &Ax021211Rules) -> f64 {
    let of_feedback = feedback.limits.or(target.limits).unwrap_or(PERCENT);
    let of_target = rules.target_limits(target.limits, of_feedback);
    rules.pid_error(rules.percent(target, of_target), rules.percent(feedback, of_feedback))
}

/// The output that a response of table 11 makes of the result of figure 8 on a side of the target,
/// in per cent.
pub(super) fn respond(response: u8, output: f64, side: f64) -> f64 {
    let output = match response {
        1 if side < 0.0 => -output,
        2 if side > 0.0 => output,
        1 | 2 => 0.0,
        _ => output,
    };
    output.clamp(PERCENT.0, PERCENT.1)
}

/// The shortest cycle in seconds.
const SHORTEST_CYCLE: f64 = 0.001;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::ax021211::rules::Ax021211Rules;
    use crate::devices::ax021211::signal::Quality;

    fn settings(response: u8) -> PidSettings {
        PidSettings {
            target: Link::new(1, 11),
            feedback: Link::new(1, 12),
            gains: Gains {
                proportional: 0.5,
                integral: 1.0,
                integral_time: 0.005,
                derivative: 1.0,
                derivative_time: 0.001,
            },
            cycle: 0.01,
            tolerance: 1.0,
            response,
        }
    }

    fn of(value: f64) -> Signal {
        Signal::new(value, Some((0.0, 200.0)))
    }

    fn run(settings: &PidSettings, inputs: &[(u64, f64, f64)]) -> Vec<i64> {
        let mut pid = Pid::default();
        let see = |(millis, target, feedback): &(u64, f64, f64)| {
            let now = Instant(millis * 1_000_000);
            pid.evaluate(now, settings, of(*target), of(*feedback), &Ax021211Rules::plain()).0
        };
        inputs.iter().map(see).collect()
    }

    #[test]
    fn the_defaults_of_figure_8_in_numbers() {
        // P_Gain 0.5, I_Gain 0.5 * 1 * 0.01 / 0.005 = 1, D_Gain 0.5 * 1 * 0.001 / 0.01 = 0.05.
        let inputs = [(0, 20.0, 0.0), (5, 20.0, 0.0), (10, 20.0, 0.0), (20, 20.0, 0.0)];
        assert_eq!(run(&settings(0), &inputs), [155, 155, 250, 350]);
        let mut without_time = settings(0);
        without_time.gains.integral_time = 0.0;
        assert_eq!(run(&without_time, &inputs), [55, 55, 50, 50]);
    }

    #[test]
    fn a_difference_below_the_tolerance_is_none() {
        // In per cent of 200: 0.9 and 1.0.
        assert_eq!(run(&settings(0), &[(0, 1.8, 0.0), (10, 1.8, 0.0)]), [0, 0]);
        assert_eq!(run(&settings(0), &[(0, 2.0, 0.0)]), [16]);
        // The output stops changing where it was, but for the derivative part.
        let inputs = [(0, 20.0, 0.0), (10, 20.0, 19.0), (20, 20.0, 19.0), (30, 20.0, 20.0)];
        assert_eq!(run(&settings(0), &inputs), [155, 95, 100, 100]);
    }

    #[test]
    fn table_11_has_a_single_output_and_two_sides() {
        let mut gains = settings(0);
        gains.gains.integral = 0.0;
        gains.gains.derivative = 0.0;
        for (response, over, below) in [(0, 0, 200), (1, 200, 0), (2, 0, 200)] {
            let settings = PidSettings { response, ..gains };
            assert_eq!(run(&settings, &[(0, 20.0, 100.0)]), [over], "{response}");
            assert_eq!(run(&settings, &[(0, 100.0, 20.0)]), [below], "{response}");
        }
        assert_eq!(run(&settings(0), &[(0, 200.0, 0.0), (10, 200.0, 0.0)]), [1000, 1000]);
    }

    #[test]
    fn within_the_tolerance_a_push_pull_pair_keeps_its_side_and_its_sum() {
        let mut gains = settings(0);
        gains.gains.derivative = 0.0;
        // 10 % below the target, then 0.5 % below and 0.5 % over it: the sum stays.
        let below = [(0, 20.0, 0.0), (10, 20.0, 19.0), (20, 20.0, 21.0)];
        assert_eq!(run(&PidSettings { response: 2, ..gains }, &below), [150, 100, 100]);
        assert_eq!(run(&PidSettings { response: 1, ..gains }, &below), [0, 0, 0]);
        let over = below.map(|(at, target, feedback)| (at, feedback, target));
        assert_eq!(run(&PidSettings { response: 1, ..gains }, &over), [150, 100, 100]);
        assert_eq!(run(&PidSettings { response: 2, ..gains }, &over), [0, 0, 0]);
    }

    #[test]
    fn a_constant_target_is_scaled_as_the_feedback_is() {
        let target = Signal::new(50.0, None);
        let feedback = Signal::new(0.0, Some((0.0, 500.0)));
        assert_eq!(difference(target, feedback, &Ax021211Rules::plain()), 10.0);
        let target = Signal::new(50.0, Some((0.0, 100.0)));
        assert_eq!(difference(target, feedback, &Ax021211Rules::plain()), 50.0);
    }

    #[test]
    fn it_sleeps_while_nothing_changes_and_keeps_its_pace() {
        let (settings, mut pid) = (settings(0), Pid::default());
        let mut see = |micros: u64, target: f64| {
            let now = Instant(micros * 1000);
            let shown =
                pid.evaluate(now, &settings, of(target), of(0.0), &Ax021211Rules::plain()).0;
            (shown, pid.due().map(|due| due.0 / 1000))
        };
        assert_eq!(see(0, 0.0), (0, None));
        assert_eq!(see(33_000, 20.0), (0, Some(40_000)));
        assert_eq!(see(40_000, 20.0), (155, Some(50_000)));
        assert_eq!(see(50_000, 0.0), (95, Some(60_000)));
        assert_eq!(see(60_000, 0.0), (100, None));
    }

    #[test]
    fn without_both_sources_it_is_disabled_and_an_error_stops_it() {
        let (settings, mut pid) = (settings(0), Pid::default());
        let mut see = |settings: &PidSettings, target| {
            let (shown, signal) =
                pid.evaluate(Instant::ZERO, settings, target, of(0.0), &Ax021211Rules::plain());
            (shown, signal.quality)
        };
        assert_eq!(see(&settings, of(20.0)), (155, Quality::Valid));
        assert_eq!(see(&settings, of(20.0).failing(true)), (0, Quality::Failed));
        assert_eq!(see(&settings, Signal::ABSENT), (0, Quality::Absent));
        let unused = PidSettings { feedback: Link::default(), ..settings };
        assert_eq!(see(&unused, of(20.0)), (0, Quality::Absent));
    }
}
