//! On/off control with hysteresis, delay and manual reset (manual, 11.3.2, parameters 19, 22 and
//! 23).

use super::delay::Delayed;
use super::parameters::Parameters;
use super::rules::Rules;

/// The settings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Settings {
    hysteresis: i64,
    latches: bool,
    delay: f64,
    kept: bool,
}

impl Settings {
    pub(super) fn of(parameters: &Parameters) -> Self {
        let reset = parameters.get(22);
        Self {
            hysteresis: parameters.get(19),
            latches: parameters.rules.latches(reset),
            delay: parameters.seconds(23),
            kept: parameters.rules.kept_over_power_off(reset),
        }
    }
}

/// The memory of on/off control.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct OnOff {
    wanted: bool,
    switched: Delayed,
    /// Waits to be reset by hand.
    latched: bool,
    /// Is off until it is reset by hand.
    held_off: bool,
    was_on: bool,
}

impl OnOff {
    /// Whether the command is on, with `missing` digits to the set point. It goes off at the set
    /// point, and on when `missing` reaches the hysteresis; a negative hysteresis lies beyond the
    /// set point.
    pub(super) fn step(&mut self, missing: i64, settings: &Settings, rules: &Rules) -> bool {
        let (off, on) = rules.on_off(settings.hysteresis);
        if missing <= off {
            self.wanted = false;
        } else if missing >= on {
            self.wanted = true;
        }
        let on = self.switched.follow(self.wanted, settings.delay, rules);
        let was_on = std::mem::replace(&mut self.was_on, on);
        if rules.reset_holds_on() {
            self.latched = settings.latches && (self.latched || on);
            return on || self.latched;
        }
        self.held_off = settings.latches && (self.held_off || was_on && !on);
        on && !self.held_off
    }

    /// Advances the time.
    pub(super) fn advance(&mut self, elapsed: f64) {
        self.switched.advance(elapsed);
    }

    /// Seconds up to the end of its delay, if it waits for that.
    pub(super) fn left(&self) -> Option<f64> {
        self.switched.left()
    }

    /// Whether it can be reset by hand, as 400Ah shows.
    pub(super) fn resettable(&self, rules: &Rules) -> bool {
        self.held_off || rules.resettable(self.latched, self.switched.is_on())
    }

    /// Resets it by hand; nothing happens while control wants it on.
    pub(super) const fn reset(&mut self) {
        self.latched &= self.switched.is_on();
        self.held_off = false;
    }

    /// The device was switched on, or the controller was stopped.
    pub(super) fn restart(&mut self, settings: &Settings) {
        let (latched, held_off) = (self.latched && settings.kept, self.held_off && settings.kept);
        *self = Self { latched, held_off, ..Self::default() };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::drr460::model::rules::Rules;

    fn settings(list: &[(u8, i64)]) -> Settings {
        Settings::of(&Parameters::listed(list, &Rules::plain()))
    }

    #[test]
    fn it_keeps_its_state_within_the_hysteresis() {
        let table = [
            (20, [(19, false), (20, true), (1, true), (0, false)]),
            (-20, [(-1, false), (0, true), (-19, true), (-20, false)]),
        ];
        for (hysteresis, steps) in table {
            let (settings, mut control) = (settings(&[(19, hysteresis)]), OnOff::default());
            for (missing, on) in steps {
                assert_eq!(
                    control.step(missing, &settings, &Rules::plain()),
                    on,
                    "{hysteresis} {missing}"
                );
            }
        }
    }

    #[test]
    fn a_reset_by_hand_ends_what_control_wants_no_more() {
        for (reset, kept) in [(1, false), (2, true)] {
            let (settings, mut control) = (settings(&[(22, reset)]), OnOff::default());
            assert!(
                control.step(10, &settings, &Rules::plain())
                    && !control.resettable(&Rules::plain())
            );
            control.reset();
            assert!(
                control.step(-10, &settings, &Rules::plain())
                    && control.resettable(&Rules::plain())
            );
            let mut restarted = control;
            restarted.restart(&settings);
            assert_eq!(restarted.step(-10, &settings, &Rules::plain()), kept);
            control.reset();
            assert!(
                !control.step(-10, &settings, &Rules::plain())
                    && !control.resettable(&Rules::plain())
            );
        }
    }

    #[test]
    fn a_delay_has_its_side() {
        let (settings, mut control) = (settings(&[(23, 2)]), OnOff::default());
        assert!(!control.step(10, &settings, &Rules::plain()));
        control.advance(1.9);
        assert!(!control.step(10, &settings, &Rules::plain()));
        control.advance(0.1);
        assert!(
            control.step(10, &settings, &Rules::plain())
                && !control.step(-10, &settings, &Rules::plain())
        );
    }
}
