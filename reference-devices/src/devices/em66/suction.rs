//! Suction mode, the emergency operation in case of leaks (3.4.2, 3.4.3, 3.4.8).

use super::rules::Em66Rules;

/// The state of the request.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Suction {
    active: bool,
    /// The request has to wait.
    waits: bool,
    /// The error that is shown.
    error: bool,
    /// A request that was not fulfilled at once, by a device that does not come back to it.
    given_up: bool,
}

/// The conditions that the request meets. Temperatures in tenths of a degree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Situation {
    pub(super) requested: bool,
    pub(super) supported: bool,
    /// The set point in force, whether or not a ramp has reached it.
    pub(super) set_point: i64,
    /// `None` if the sensor gives no value.
    pub(super) effective: Option<i64>,
    /// The controller is on and does not switch off.
    pub(super) running: bool,
    /// It is off.
    pub(super) off: bool,
}

impl Suction {
    /// Takes what is asked for as far as it goes.
    pub(super) fn decide(&mut self, situation: &Situation, rules: &Em66Rules) {
        let Situation { requested, set_point, effective, running, .. } = *situation;
        let supported = rules.suction_supported(situation.supported);
        let conflict = !supported || rules.suction_conflict(set_point);
        let delayed = !running || effective.is_none_or(|value| rules.suction_delayed(value));
        let wanted = requested || (self.active || self.waits) && !rules.suction_ends();
        self.waits = wanted && !conflict && delayed;

        let late = self.waits && rules.suction_delay_is_error();
        let off = situation.off && rules.suction_while_off_is_error();
        let hindered = conflict || late || off;
        self.error =
            rules.suction_error(requested, hindered) || self.error && rules.suction_error_stays();
        let interrupted = self.active && delayed && !rules.suction_resumes(situation.off);
        let given_up = self.waits && !rules.suction_comes_later() || interrupted;
        self.given_up = requested && (self.given_up || given_up);
        self.active = wanted && !conflict && !delayed && !self.given_up;
    }

    /// Whether suction is on.
    pub(super) const fn is_active(self) -> bool {
        self.active
    }

    /// Whether the request cannot be fulfilled (2009h, bit 0).
    pub(super) const fn is_error(self) -> bool {
        self.error
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::em66::rules::Em66Rules;

    const EASY: Situation = Situation {
        requested: true,
        supported: true,
        set_point: 400,
        effective: Some(300),
        running: true,
        off: false,
    };

    /// Active and error after a situation that nothing came before.
    fn outcome(situation: Situation) -> (bool, bool) {
        let mut suction = Suction::default();
        suction.decide(&situation, &Em66Rules::plain());
        (suction.is_active(), suction.is_error())
    }

    #[test]
    fn the_four_situations() {
        let table = [
            ("activated", EASY, (true, false)),
            ("not supported", Situation { supported: false, ..EASY }, (false, true)),
            ("conflict", Situation { set_point: 901, ..EASY }, (false, true)),
            (
                "at the limit",
                Situation { set_point: 900, effective: Some(900), ..EASY },
                (true, false),
            ),
            ("too warm", Situation { effective: Some(901), ..EASY }, (false, false)),
            ("no sensor", Situation { effective: None, ..EASY }, (false, false)),
            ("switching off", Situation { running: false, ..EASY }, (false, false)),
            ("both", Situation { set_point: 901, running: false, ..EASY }, (false, true)),
        ];
        for (name, situation, expected) in table {
            assert_eq!(outcome(situation), expected, "{name}");
            let silent = Situation { requested: false, ..situation };
            assert_eq!(outcome(silent), (false, false), "{name}, not requested");
        }
    }

    #[test]
    fn the_present_situation_counts() {
        let mut suction = Suction::default();
        let mut after = |situation: Situation| {
            suction.decide(&situation, &Em66Rules::plain());
            (suction.is_active(), suction.is_error())
        };
        assert_eq!(after(Situation { set_point: 901, ..EASY }), (false, true));
        assert_eq!(after(Situation { effective: Some(901), ..EASY }), (false, false));
        assert_eq!(after(EASY), (true, false));
        assert_eq!(after(Situation { set_point: 901, ..EASY }), (false, true));
        assert_eq!(after(Situation { requested: false, ..EASY }), (false, false));
    }
}
