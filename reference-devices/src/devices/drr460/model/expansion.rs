//! The outputs used as those of an expansion module, and silence on the network (manual, 7.12 and
//! 11.3.2, parameters 115 and 121 to 130).

use super::parameters::Parameters;
use super::rules::Rules;
use super::wiring::Terminals;

/// The settings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Settings {
    pub(crate) enabled: bool,
    /// Q1 and Q2 in bits 0 and 1, as in what follows.
    pub(crate) initial_outputs: i64,
    commutes: i64,
    error_outputs: i64,
    live_zero: bool,
    low: f64,
    high: f64,
    pub(crate) initial_analogue: i64,
    analogue_commutes: bool,
    error_analogue: i64,
    /// In seconds; 0 is never.
    offline: f64,
}

impl Settings {
    pub(crate) fn of(parameters: &Parameters) -> Self {
        Self {
            enabled: parameters.rules.expansion(parameters.get(121)),
            initial_outputs: parameters.get(122),
            commutes: parameters.get(123) & BOTH,
            error_outputs: parameters.get(124),
            live_zero: parameters.is_set(125),
            low: parameters.get(126) as f64,
            high: parameters.get(127) as f64,
            initial_analogue: parameters.get(128),
            analogue_commutes: parameters.is_set(129),
            error_analogue: parameters.get(130),
            offline: parameters.rules.offline_time(parameters.get(115)),
        }
    }

    /// The effect of an error on the values of the master: 6200h and 6411h. They stay so until the
    /// master writes again.
    pub(crate) fn in_error(&self, (outputs, analogue): (i64, i64), rules: &Rules) -> (i64, i64) {
        let outputs = rules.commutes(outputs, self.commutes, self.error_outputs);
        (outputs, if self.analogue_commutes { self.error_analogue } else { analogue })
    }

    /// The terminals for values of 6200h and 6411h.
    pub(crate) fn connect(&self, outputs: i64, analogue: i64, rules: &Rules) -> Terminals {
        let share = rules.share(analogue as f64, self.low, self.high);
        Terminals {
            contacts: [outputs & 1 != 0, outputs & 2 != 0],
            microamperes: rules.microamperes(share, self.live_zero),
        }
    }
}

/// How long the network has had nothing to do with the device.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Silence {
    since: f64,
}

impl Silence {
    /// The network had to do with the device.
    pub(crate) const fn end(&mut self) {
        self.since = 0.0;
    }

    /// Advances the time. Returns whether the device has just become off-line.
    pub(crate) fn advance(&mut self, elapsed: f64, settings: &Settings) -> bool {
        let before = self.is_offline(settings);
        self.since += elapsed;
        self.is_offline(settings) && !before
    }

    pub(crate) fn is_offline(&self, settings: &Settings) -> bool {
        settings.offline > 0.0 && self.since + ROUNDING >= settings.offline
    }

    /// Seconds until the device is off-line.
    pub(crate) fn next(&self, settings: &Settings) -> Option<f64> {
        let waits = settings.offline > 0.0 && !self.is_offline(settings);
        waits.then_some(settings.offline - self.since)
    }
}

const BOTH: i64 = 3;
/// In seconds.
const ROUNDING: f64 = 1e-6;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::drr460::model::parameters::List;
    use crate::devices::drr460::model::rules::Rules;

    fn settings(list: &[(u8, i64)]) -> Settings {
        Settings::of(&Parameters::listed(list, &Rules::plain()))
    }

    #[test]
    fn the_master_drives_the_terminals() {
        let table = [
            (1, 0, 0, [true, false], 0.0),
            (2, 500, 0, [false, true], 10_000.0),
            (3, 500, 1, [true, true], 12_000.0),
            (4, 9000, 1, [false, false], 20_000.0),
        ];
        for (outputs, analogue, kind, contacts, microamperes) in table {
            let settings = settings(&[(121, 1), (125, kind), (127, 1000)]);
            let terminals = settings.connect(outputs, analogue, &Rules::plain());
            assert_eq!(terminals, Terminals { contacts, microamperes }, "{outputs} {analogue}");
        }
    }

    #[test]
    fn in_error_each_output_commutes_or_stays() {
        let table: [(List<'_>, (i64, i64)); 4] = [
            (&[(124, 3), (130, 77)], (1, 500)),
            (&[(123, 1), (130, 77)], (0, 500)),
            (&[(123, 2), (124, 2), (130, 77)], (3, 500)),
            (&[(129, 1), (130, 77)], (1, 77)),
        ];
        for (list, expected) in table {
            assert_eq!(settings(list).in_error((1, 500), &Rules::plain()), expected, "{list:?}");
        }
    }

    #[test]
    fn silence_has_its_time() {
        let (settings, mut silence) = (settings(&[(115, 20)]), Silence::default());
        assert!(!silence.advance(1.9, &settings));
        silence.end();
        assert!(!silence.advance(1.9, &settings));
        assert!(silence.advance(0.1, &settings) && !silence.advance(0.1, &settings));
        assert!(silence.is_offline(&settings));
        assert!(!Silence::default().advance(1e9, &self::settings(&[])));
    }
}
