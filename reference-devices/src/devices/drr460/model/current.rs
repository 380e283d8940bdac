//! The current transformer: heater break and over-current (manual, 7.7 and 11.3.2, parameters 90 to
//! 94 and 131).

use super::parameters::Parameters;
use super::rules::Rules;

/// The settings. Currents are in tenths of an ampere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Settings {
    pub(super) enabled: bool,
    full_scale: i64,
    break_threshold: f64,
    over_threshold: f64,
    delay: f64,
    /// The digital output, counted from 0, that drives the load in expansion mode.
    pub(super) output: usize,
}

impl Settings {
    pub(super) fn of(parameters: &Parameters) -> Self {
        Self {
            enabled: parameters.is_set(90),
            full_scale: parameters.get(91),
            break_threshold: parameters.get(92) as f64,
            over_threshold: parameters.get(93) as f64,
            delay: parameters.seconds(94),
            output: usize::from(parameters.is_set(131)),
        }
    }
}

/// The watched faults, in the order of bits 7 to 10 of 4007h: the switch in short circuit, switch
/// or load open, the load broken in part, too much current.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Transformer {
    watched: [Watched; 4],
    /// In tenths of an ampere.
    amperes: f64,
    /// The output of the load was on.
    on: bool,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Watched {
    is_error: bool,
    /// Whether 4007h shows it.
    is_shown: bool,
    /// Seconds for which the condition has been met.
    waited: f64,
    counts: bool,
}

impl Watched {
    /// `condition` is `None` while it is unknown; the delay then stands still.
    fn follow(&mut self, condition: Option<bool>, delay: f64, rules: &Rules) {
        let goes_on = self.waited > 0.0 && !rules.current_delay_starts_over();
        let condition = condition.map(|met| met || goes_on);
        self.counts = condition == Some(true);
        match condition {
            None if rules.current_delay_stands_still() => {}
            None => self.waited = 0.0,
            Some(false) => {
                let is_shown = self.is_shown && !rules.current_flags_end();
                *self = Self { is_shown, ..Self::default() };
            }
            Some(true) => self.is_error |= self.waited + ROUNDING >= delay,
        }
        self.is_shown |= self.is_error;
    }

    fn advance(&mut self, elapsed: f64) {
        if self.counts {
            self.waited += elapsed;
        }
    }
}

impl Transformer {
    /// The transformer gives this many milliamperes, while its output is on or off.
    pub(super) fn step(
        &mut self,
        (milliamperes, on): (f64, bool),
        settings: &Settings,
        rules: &Rules,
    ) {
        if !settings.enabled {
            *self = Self::default();
            return;
        }
        self.on = on;
        self.amperes = rules.tenths_of_amperes(milliamperes, settings.full_scale);
        let (amperes, threshold) = (self.amperes, settings.break_threshold);
        let nothing = rules.is_no_current(amperes, threshold);
        let watches = threshold > 0.0;
        let weak = amperes < threshold;
        let over = settings.over_threshold;
        // `None` while the output is in a state in which the fault cannot show.
        let conditions = [
            (!on).then_some(watches && rules.is_short(amperes, threshold)),
            on.then_some(watches && nothing),
            on.then_some(watches && !nothing && weak),
            Some(over > 0.0 && amperes > over),
        ];
        for (number, (watched, condition)) in self.watched.iter_mut().zip(conditions).enumerate() {
            watched.follow(condition, rules.current_delay(number, settings.delay), rules);
        }
    }

    /// The flags are reset by hand; those whose cause lasts come again.
    pub(super) fn reset(&mut self) {
        self.watched = Default::default();
    }

    /// Advances the time.
    pub(super) fn advance(&mut self, elapsed: f64) {
        self.watched.iter_mut().for_each(|watched| watched.advance(elapsed));
    }

    /// Bits 7 to 10 of 4007h.
    pub(super) fn flags(&self, rules: &Rules) -> i64 {
        let bits = self.watched.iter().zip(7..);
        bits.map(|(watched, bit)| i64::from(watched.is_shown) << rules.flag(bit)).sum()
    }

    /// Whether alarm kind 10 is met.
    pub(super) fn is_error(&self, rules: &Rules) -> bool {
        rules.current_alarm(self.watched.map(|watched| watched.is_error))
    }

    /// In tenths of an ampere.
    pub(super) const fn amperes(&self) -> f64 {
        self.amperes
    }

    /// Whether the output of the load was on when it was measured last.
    pub(super) const fn was_on(&self) -> bool {
        self.on
    }

    /// The threshold that the key teaches, in tenths of an ampere; `None` without a current (7.7
    /// has no figure).
    pub(super) fn taught(&self, rules: &Rules) -> Option<i64> {
        let threshold = rules.taught(self.amperes).round() as i64;
        (threshold > 0).then_some(threshold)
    }
}

/// In seconds.
const ROUNDING: f64 = 1e-6;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::drr460::model::rules::Rules;

    fn settings(delay: i64) -> Settings {
        let list = [(90, 1), (91, 50), (92, 100), (93, 300), (94, delay)];
        Settings::of(&Parameters::listed(&list, &Rules::plain()))
    }

    #[test]
    fn each_fault_has_its_flag() {
        let table = [
            (true, 20.0, 0),
            (false, 0.0, 0),
            (false, 5.0, 1 << 7),
            (true, 0.5, 1 << 8),
            (true, 5.0, 1 << 9),
            (true, 10.0, 0),
            (true, 30.0, 0),
            (true, 31.0, 1 << 10),
        ];
        for (on, milliamperes, flags) in table {
            let mut transformer = Transformer::default();
            transformer.step((milliamperes, on), &settings(0), &Rules::plain());
            assert_eq!(transformer.flags(&Rules::plain()), flags, "{on} {milliamperes}");
        }
    }

    #[test]
    fn the_delay_stands_still_while_the_output_is_off() {
        let (settings, mut transformer) = (settings(2), Transformer::default());
        let mut step = |on, elapsed| {
            transformer.step((0.0, on), &settings, &Rules::plain());
            transformer.advance(elapsed);
            transformer.step((0.0, on), &settings, &Rules::plain());
            transformer.flags(&Rules::plain())
        };
        assert_eq!([step(true, 1.5), step(false, 9.0), step(true, 0.4)], [0; 3]);
        assert_eq!([step(true, 0.1), step(false, 1.0)], [1 << 8; 2]);
    }

    #[test]
    fn a_threshold_is_taught() {
        let mut transformer = Transformer::default();
        assert_eq!(transformer.taught(&Rules::plain()), None);
        transformer.step((10.0, true), &settings(0), &Rules::plain());
        assert_eq!(transformer.taught(&Rules::plain()), Some(80));
    }
}
