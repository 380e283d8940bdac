//! Tuning: the controller switches its output on and off at a threshold, and derives the parameters
//! of PID control from the swing of the process (manual, 7.2 to 7.5 and 11.3.17).

use super::parameters::{NO_KIND, Parameters};
use super::rules::Rules;

/// The settings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Settings {
    pub(super) kind: i64,
    deviation: i64,
    greatest_gap: i64,
    bands: (f64, f64),
    /// In seconds.
    least_integral_time: f64,
    longest_silence: f64,
    soft_start: bool,
    /// 1 heats, -1 cools.
    direction: i64,
    waits_for_master: bool,
    forces: bool,
    swings: bool,
}

impl Settings {
    pub(super) fn of(parameters: &Parameters) -> Self {
        let rules = parameters.rules;
        let bands = (parameters.get(48) as f64, parameters.get(49) as f64);
        let ((low, high), least_integral_time) = rules.tuning_limits(bands, parameters.tenths(50));
        Self {
            kind: parameters.get(31),
            deviation: rules.tuning_deviation(parameters.get(32)),
            greatest_gap: parameters.get(47),
            bands: (low.max(1.0), high.max(low).max(1.0)),
            least_integral_time,
            longest_silence: rules.longest_silence_in_tuning(),
            soft_start: rules.soft_start_prevents_tuning(parameters.get(80)),
            direction: if parameters.cools() { -1 } else { 1 },
            waits_for_master: rules.tuning_waits_for_master(),
            forces: rules.tuning_forces(),
            swings: rules.swings_to_tune(),
        }
    }
}

/// The values that 400Eh shows and accepts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Status {
    #[default]
    Off,
    /// The master keeps the output off.
    ForcedOff,
    /// The master keeps the output on.
    ForcedOn,
    /// It tunes.
    Active,
    /// It is done, and the output stays off until the master has seen that.
    Completed,
}

/// A tuning.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Tuning {
    /// Another kind ends what is under way.
    kind: i64,
    status: Status,
    swing: Option<Swing>,
    /// Seconds since the last sign of the master.
    silence: f64,
}

/// A swing of the process about the threshold. Everything counts in the direction of the command.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Swing {
    threshold: i64,
    on: bool,
    /// How often the process rose over the threshold.
    crossings: u32,
    /// Seconds since it did so first.
    period: f64,
    lowest: i64,
    highest: i64,
}

/// The parameters that a tuning found, as 3000h has them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Found {
    /// In digits.
    pub(crate) band: i64,
    /// In tenths of a second, as the next one.
    pub(crate) integral_time: i64,
    pub(crate) derivative_time: i64,
}

/// The result of a step of a tuning.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Step {
    /// The output that it wants; `None` when the controller decides.
    pub(super) forced: Option<bool>,
    pub(super) found: Option<Found>,
}

impl Tuning {
    /// The value of 400Eh.
    pub(super) const fn shown(&self, settings: &Settings) -> i64 {
        match (self.status, settings.kind) {
            (_, SYNCHRONISED) if settings.soft_start => 5,
            (Status::Off, _) => 0,
            (Status::Active, SYNCHRONISED) => 3,
            (Status::Active, _) | (Status::ForcedOff, _) => 1,
            (Status::ForcedOn, _) => 2,
            (Status::Completed, _) => 4,
        }
    }

    /// The master has written 400Eh.
    pub(super) fn command(&mut self, value: i64, sight: (i64, i64), settings: &Settings) {
        self.silence = 0.0;
        let status = match (settings.kind, value) {
            // With automatic tuning, only a device that accepts any value gets here.
            (AUTOMATIC | MANUAL | ONCE, 1) | (SYNCHRONISED, 3) => {
                return self.begin(sight, settings);
            }
            (SYNCHRONISED, 1) => Status::ForcedOff,
            (SYNCHRONISED, 2) => Status::ForcedOn,
            _ => Status::Off,
        };
        *self = Self { kind: settings.kind, status, ..Self::default() };
    }

    /// The kind is selected, even if it is the same one.
    pub(super) const fn select_again(&mut self) {
        self.kind = NO_KIND;
    }

    /// The master has read 400Eh.
    pub(super) const fn read(&mut self) {
        self.silence = 0.0;
    }

    /// The controller starts, or its set point has changed: an automatic tuning may begin.
    pub(super) fn started(
        &mut self,
        at_start: bool,
        (process, set_point): (i64, i64),
        settings: &Settings,
        rules: &Rules,
    ) {
        let gap = set_point - process;
        let asked = rules.gap_asks_for_tuning(gap, settings.greatest_gap);
        let begins = match settings.kind {
            AUTOMATIC if rules.any_gap_tunes() => asked && self.status == Status::Off,
            AUTOMATIC => asked && (at_start || rules.set_point_tunes()),
            ONCE => at_start,
            _ => false,
        };
        if begins {
            self.begin((process, set_point), settings);
        }
    }

    fn begin(&mut self, (process, set_point): (i64, i64), settings: &Settings) {
        // Cooling mirrors the process, so that one swing serves both directions.
        let direction = settings.direction;
        let threshold = match settings.kind {
            MANUAL => set_point * direction - settings.deviation,
            _ if !settings.swings => set_point * direction,
            _ => (process + set_point) * direction / 2,
        };
        let process = process * direction;
        let swing = Swing {
            threshold,
            on: process < threshold,
            crossings: 0,
            period: 0.0,
            lowest: process,
            highest: process,
        };
        let kind = settings.kind;
        *self = Self { kind, status: Status::Active, swing: Some(swing), silence: 0.0 };
    }

    /// Ends a tuning that cannot go on: the controller stops, or there is no process value.
    pub(super) fn abandon(&mut self) {
        if self.status == Status::Active {
            *self = Self { kind: self.kind, ..Self::default() };
        }
    }

    /// Advances the time without the master.
    pub(super) fn advance(&mut self, elapsed: f64) {
        self.silence += elapsed;
    }

    /// Whether it is neither under way nor waits for the master.
    pub(super) fn rests(&self) -> bool {
        self.status == Status::Off
    }

    /// Looks at the process; `elapsed` are the seconds since the last look.
    pub(super) fn step(&mut self, process: i64, settings: &Settings, elapsed: f64) -> Step {
        if settings.kind != self.kind || settings.kind == SYNCHRONISED && settings.soft_start {
            *self = Self { kind: settings.kind, ..Self::default() };
        }
        if settings.kind == SYNCHRONISED && self.silence > settings.longest_silence + ROUNDING {
            *self = Self { kind: settings.kind, ..Self::default() };
        }
        let forced = match self.status {
            Status::Off => None,
            Status::ForcedOff | Status::ForcedOn if !settings.forces => None,
            Status::ForcedOff | Status::Completed => Some(false),
            Status::ForcedOn => Some(true),
            Status::Active => return self.swing(process, settings, elapsed),
        };
        Step { forced, found: None }
    }

    fn swing(&mut self, process: i64, settings: &Settings, elapsed: f64) -> Step {
        let Some(swing) = &mut self.swing else { return Step::default() };
        let process = process * settings.direction;
        let amplitude = match settings.swings {
            true => swing.follow(process, elapsed),
            false => swing.overshoot(process, elapsed),
        };
        let Some(amplitude) = amplitude else {
            return Step { forced: Some(swing.on), found: None };
        };
        let found = match settings.swings {
            true => found(amplitude, swing.period, settings),
            false => found_by_overshoot(amplitude, swing.period, settings),
        };
        let completed = settings.kind == SYNCHRONISED && settings.waits_for_master;
        let status = if completed { Status::Completed } else { Status::Off };
        *self = Self { status, swing: None, ..*self };
        Step { forced: completed.then_some(false), found: Some(found) }
    }
}

impl Swing {
    /// Follows the process; gives the amplitude at the end of a whole swing.
    fn follow(&mut self, process: i64, elapsed: f64) -> Option<f64> {
        if self.crossings > 0 {
            self.period += elapsed;
            self.lowest = self.lowest.min(process);
            self.highest = self.highest.max(process);
        }
        let above = process >= self.threshold;
        if above && self.on {
            if self.crossings > 0 {
                return Some(((self.highest - self.lowest) as f64 / 2.0).max(0.5));
            }
            self.crossings = 1;
            (self.lowest, self.highest) = (process, process);
        }
        self.on = !above;
        None
    }
}

impl Swing {
    /// Follows the process over the threshold once, and until it turns; gives how far it went.
    fn overshoot(&mut self, process: i64, elapsed: f64) -> Option<f64> {
        self.period += elapsed;
        self.on = self.crossings == 0 && process < self.threshold;
        if self.on {
            return None;
        }
        let before = if self.crossings == 0 { process } else { self.highest };
        self.crossings = 1;
        self.highest = before.max(process);
        let turned = process <= self.highest - TURNED;
        turned.then_some((self.highest - self.threshold).abs() as f64)
    }
}

/// Another rule, for a process that goes over the threshold once.
fn found_by_overshoot(overshoot: f64, period: f64, settings: &Settings) -> Found {
    let (least, greatest) = settings.bands;
    let integral_time = (period.max(settings.least_integral_time).min(2000.0) * 10.0).round();
    Found {
        band: (2.0 * overshoot + 10.0).clamp(least, greatest) as i64,
        integral_time: integral_time as i64,
        derivative_time: (integral_time as i64 / 4).min(10_000),
    }
}

/// The rule of Ziegler and Nichols for a relay that switches between nothing and all.
fn found(amplitude: f64, period: f64, settings: &Settings) -> Found {
    // Half of the output swings, so the critical gain is 2 / (pi * amplitude) of full output.
    let critical_band = std::f64::consts::PI * amplitude / 2.0;
    let (least, greatest) = settings.bands;
    let integral_time = (period / 2.0).max(settings.least_integral_time).min(2000.0);
    Found {
        band: (critical_band / 0.6).clamp(least, greatest).round() as i64,
        integral_time: (integral_time * 10.0).round() as i64,
        derivative_time: (integral_time * 10.0 / 4.0).round() as i64,
    }
}

/// In seconds.
const ROUNDING: f64 = 1e-6;
/// Digits by which a process that has turned has come back.
const TURNED: i64 = 5;

const AUTOMATIC: i64 = 1;
const MANUAL: i64 = 2;
pub(super) const ONCE: i64 = 3;
const SYNCHRONISED: i64 = 4;

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: [(u8, i64); 5] = [(32, 200), (47, 30), (48, 50), (49, 500), (50, 400)];

    fn list(kind: i64) -> Vec<(u8, i64)> {
        [(31, kind)].into_iter().chain(LIMITS).collect()
    }

    fn settings(kind: i64) -> Settings {
        Settings::of(&Parameters::listed(&list(kind), &Rules::plain()))
    }

    /// Lets a process swing that rises and falls by 1 a step of 0.1 s; gives what was found.
    fn tune(tuning: &mut Tuning, settings: &Settings) -> Option<Found> {
        let (mut process, mut speed) = (250_i64, 0_i64);
        for _ in 0..100_000 {
            tuning.advance(0.1);
            let step = tuning.step(process, settings, 0.1);
            if step.found.is_some() {
                return step.found;
            }
            speed = (speed + if step.forced? { 1 } else { -1 }).clamp(-20, 20);
            process += speed;
        }
        None
    }

    #[test]
    fn a_manual_tuning_finds_parameters_within_their_limits() {
        let (settings, mut tuning) = (settings(2), Tuning::default());
        tuning.command(1, (250, 1000), &settings);
        assert_eq!(tuning.shown(&settings), 1);
        let found = tune(&mut tuning, &settings).unwrap();
        assert!((50..=500).contains(&found.band) && found.integral_time >= 400, "{found:?}");
        assert_eq!(found.derivative_time, found.integral_time / 4);
        assert_eq!((tuning.shown(&settings), tuning.step(0, &settings, 0.1).forced), (0, None));
    }

    #[test]
    fn a_synchronised_tuning_waits_for_its_master_when_it_is_done() {
        let (settings, mut tuning) = (settings(4), Tuning::default());
        for (value, forced) in [(1, Some(false)), (2, Some(true)), (0, None)] {
            tuning.command(value, (250, 1000), &settings);
            assert_eq!(tuning.shown(&settings), value);
            assert_eq!(tuning.step(250, &settings, 0.1).forced, forced);
        }
        let patient = Settings { longest_silence: f64::INFINITY, ..settings };
        tuning.command(3, (250, 1000), &patient);
        assert_eq!(tuning.shown(&patient), 3);
        assert!(tune(&mut tuning, &patient).is_some());
        assert_eq!(tuning.shown(&patient), 4);
        assert_eq!(tuning.step(0, &patient, 0.1).forced, Some(false));
    }

    #[test]
    fn the_master_has_to_read_in_time() {
        let (settings, mut tuning) = (settings(4), Tuning::default());
        tuning.command(2, (250, 1000), &settings);
        tuning.advance(9.0);
        tuning.read();
        for (seconds, shown) in [(10.0, 2), (0.1, 0)] {
            tuning.advance(seconds);
            tuning.step(250, &settings, seconds);
            assert_eq!(tuning.shown(&settings), shown);
        }
    }

    #[test]
    fn a_gap_begins_an_automatic_tuning_and_a_start_the_only_one() {
        for (kind, at_start, gap, begins) in [
            (1, false, 31, true),
            (1, true, -31, true),
            (1, true, 30, false),
            (3, true, 0, true),
            (3, false, 500, false),
            (2, true, 500, false),
        ] {
            let (list, mut tuning) = (list(kind), Tuning::default());
            let settings = Settings::of(&Parameters::listed(&list, &Rules::plain()));
            tuning.started(at_start, (500, 500 + gap), &settings, &Rules::plain());
            assert_eq!(tuning.shown(&settings), i64::from(begins), "{kind} {at_start} {gap}");
        }
    }

    #[test]
    fn with_a_soft_start_there_is_no_synchronised_tuning() {
        let mut settings = settings(4);
        settings.soft_start = true;
        assert_eq!(Tuning::default().shown(&settings), 5);
    }
}
