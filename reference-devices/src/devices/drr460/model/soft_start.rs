//! The way to the set point after a START (manual, 7.9 and 11.3.2, parameters 80 to 84).

use super::parameters::{NO_KIND, Parameters};
use super::rules::Rules;

/// The settings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Settings {
    kind: i64,
    /// Digits in a second.
    gradient: f64,
    /// A share of full output.
    held: f64,
    threshold: i64,
    /// In seconds; 0 is without end.
    longest: f64,
}

impl Settings {
    pub(super) fn of(parameters: &Parameters) -> Self {
        Self {
            kind: parameters.get(80),
            gradient: parameters.rules.gradient(parameters.get(81)),
            held: parameters.get(82) as f64 / 100.0,
            threshold: parameters.get(83),
            longest: parameters.rules.minutes(parameters.get(84)),
        }
    }
}

/// A soft start under way, or none.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct SoftStart {
    phase: Phase,
    kind: i64,
    /// Seconds since it began.
    since: f64,
    /// Seconds since the set point moved.
    not_moved: f64,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
enum Phase {
    #[default]
    Done,
    /// The set point in force moves towards the one that is wanted.
    Gradient { at: f64 },
    /// The output is held until the process reaches the threshold.
    Percentage,
}

impl SoftStart {
    /// The controller starts with this process value.
    pub(super) fn begin(process: i64, settings: &Settings) -> Self {
        let phase = match settings.kind {
            1 => Phase::Gradient { at: process as f64 },
            2 => Phase::Percentage,
            _ => Phase::Done,
        };
        Self { phase, kind: settings.kind, since: 0.0, not_moved: 0.0 }
    }

    /// The kind is selected, even if it is the same one.
    pub(super) const fn select_again(&mut self) {
        self.kind = NO_KIND;
    }

    /// The set point in force. A soft start that is no longer selected is over.
    pub(super) fn set_point(
        &mut self,
        wanted: i64,
        process: i64,
        settings: &Settings,
        rules: &Rules,
    ) -> i64 {
        let over = settings.longest > 0.0 && self.since + ROUNDING >= settings.longest;
        if over || settings.kind != self.kind {
            self.phase = Phase::Done;
        }
        match self.phase {
            Phase::Gradient { at } => {
                let step = settings.gradient * std::mem::take(&mut self.not_moved);
                let left = wanted as f64 - at;
                if left.abs() <= step || left < 0.0 && !rules.gradient_falls() {
                    self.phase = match rules.gradient_ends() {
                        true => Phase::Done,
                        false => Phase::Gradient { at: wanted as f64 },
                    };
                    return wanted;
                }
                let at = at + step.copysign(left);
                self.phase = Phase::Gradient { at };
                at.round() as i64
            }
            Phase::Percentage if process >= settings.threshold => {
                self.phase = Phase::Done;
                wanted
            }
            Phase::Percentage | Phase::Done => wanted,
        }
    }

    /// The set point in force while STOP interrupts it.
    pub(super) fn interrupted(&mut self, wanted: i64, settings: &Settings, rules: &Rules) -> i64 {
        if rules.stop_ends_soft_start() || settings.kind != self.kind {
            *self = Self::default();
        }
        match self.phase {
            Phase::Gradient { at } => at.round() as i64,
            Phase::Percentage | Phase::Done => wanted,
        }
    }

    /// Advances the time.
    pub(super) fn advance(&mut self, elapsed: f64) {
        self.since += elapsed;
        self.not_moved += elapsed;
    }

    /// The share of full output that is held; `None` when the controller decides.
    pub(super) fn output(&self, settings: &Settings) -> Option<f64> {
        (self.phase == Phase::Percentage).then_some(settings.held)
    }

    /// Whether it moves the set point.
    pub(super) const fn moves(&self) -> bool {
        matches!(self.phase, Phase::Gradient { .. })
    }

    /// Seconds up to the end of its time, if it is under way and ends by time.
    pub(super) fn left(&self, settings: &Settings) -> Option<f64> {
        let ends = self.phase != Phase::Done && settings.longest > 0.0;
        ends.then_some(settings.longest - self.since)
    }
}

/// In seconds.
const ROUNDING: f64 = 1e-6;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::drr460::model::rules::Rules;

    fn settings(list: &[(u8, i64)]) -> Settings {
        Settings::of(&Parameters::listed(list, &Rules::plain()))
    }

    #[test]
    fn a_gradient_is_so_many_digits_in_an_hour() {
        let settings = settings(&[(80, 1), (81, 3600)]);
        let mut start = SoftStart::begin(250, &settings);
        let wanted = [1000, 1000, 0, 251, 9000].map(|set| {
            start.advance(1.0);
            start.set_point(set, 0, &settings, &Rules::plain())
        });
        assert_eq!(wanted, [251, 252, 251, 251, 9000]);
    }

    #[test]
    fn a_percentage_is_held_up_to_the_threshold() {
        let settings = settings(&[(80, 2), (82, 30), (83, 500)]);
        let mut start = SoftStart::begin(250, &settings);
        for (process, held) in [(499, Some(0.3)), (500, None), (0, None)] {
            assert_eq!(start.set_point(900, process, &settings, &Rules::plain()), 900);
            assert_eq!(start.output(&settings), held, "{process}");
        }
    }

    #[test]
    fn a_soft_start_ends_after_its_time_or_when_it_is_not_selected() {
        let timed = settings(&[(80, 1), (81, 60), (84, 1)]);
        let mut start = SoftStart::begin(0, &timed);
        start.advance(59.0);
        assert_eq!(start.set_point(9000, 0, &timed, &Rules::plain()), 1);
        assert_eq!(start.left(&timed), Some(1.0));
        start.advance(1.0);
        assert_eq!(start.set_point(9000, 0, &timed, &Rules::plain()), 9000);
        assert_eq!(start.left(&timed), None);
        let endless = settings(&[(80, 1), (81, 60)]);
        let mut start = SoftStart::begin(0, &endless);
        start.advance(60.0);
        assert_eq!(start.left(&endless), None);
        assert_eq!(start.set_point(9000, 0, &endless, &Rules::plain()), 1);
        assert_eq!(start.set_point(9000, 0, &settings(&[]), &Rules::plain()), 9000);
    }
}
