//! Latch-on: a linear input learns the ends of its scale and its zero from the sensor (manual,
//! 7.11).

use super::parameters::Parameters;

/// The learned values, and the procedure under way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Latch {
    pub(super) learned: Learned,
    /// Seconds since the procedure began.
    since: Option<f64>,
}

/// The values that the device keeps when it is switched off: shares of the signal's range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Learned {
    low: f64,
    high: f64,
    zero: Option<f64>,
}

/// The settings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Settings {
    /// Parameter 9.
    kind: i64,
    low: f64,
    high: f64,
    longest: f64,
    zero_keeps_ends: bool,
    needs_enabling: bool,
    /// Whether there are commands with the present sensor.
    is_there: bool,
}

impl Settings {
    pub(super) fn of(parameters: &Parameters, linear: bool) -> Self {
        let kind = parameters.get(9);
        let (low, high) =
            parameters.rules.limits(parameters.get(3) as f64, parameters.get(4) as f64);
        Self {
            kind,
            low,
            high,
            longest: parameters.rules.latch_time(),
            zero_keeps_ends: parameters.rules.zero_keeps_ends(kind),
            needs_enabling: parameters.rules.latch_needs_enabling(),
            is_there: linear || parameters.rules.latch_is_of_any_sensor(),
        }
    }

    /// The limits that parameters 3 and 4 set.
    pub(super) const fn limits(&self) -> (f64, f64) {
        (self.low, self.high)
    }

    const fn has_zero(&self) -> bool {
        self.kind >= 2
    }
}

impl Default for Latch {
    fn default() -> Self {
        Self { learned: Learned { low: 0.0, high: 1.0, zero: None }, since: None }
    }
}

impl Latch {
    /// Whether the procedure is under way, as 4011h sub 1 shows.
    pub(crate) const fn is_enabled(&self) -> bool {
        self.since.is_some()
    }

    /// Whether 4011h `sub` takes `value`.
    pub(crate) fn accepts(&self, sub: u8, value: u8, settings: &Settings) -> bool {
        match (sub, value) {
            (_, 0) => true,
            _ if !settings.is_there => false,
            (1, 1) => settings.kind != 0,
            (2 | 3, 1) => self.is_enabled() || !settings.needs_enabling,
            (4, 1 | 2) => settings.has_zero(),
            _ => false,
        }
    }

    /// 4011h `sub` was written; `share` is the share of its range that the signal has.
    pub(super) fn command(&mut self, sub: u8, value: u8, share: f64) {
        match (sub, value) {
            (1, _) => self.since = (value == 1).then_some(0.0),
            (2, 1) => self.learned.low = share,
            (3, 1) => self.learned.high = share,
            (4, 1) => self.learned.zero = Some(share),
            (4, 2) => self.learned.zero = None,
            _ => {}
        }
    }

    /// Advances the time; the standard procedure ends after a while.
    pub(super) fn advance(&mut self, elapsed: f64, settings: &Settings) {
        if let Some(since) = &mut self.since {
            *since += elapsed;
            if settings.kind == 0 || settings.kind == 1 && *since + ROUNDING >= settings.longest {
                self.since = None;
            }
        }
    }

    /// Only what was learned lasts.
    pub(super) fn restart(&mut self) {
        self.since = None;
    }

    /// The share of the scale at a share of the signal's range.
    pub(super) fn on_scale(&self, share: f64, settings: &Settings) -> f64 {
        let Learned { low, high, .. } = self.learned;
        if settings.kind == 0 || high == low { share } else { (share - low) / (high - low) }
    }

    /// The digits at a share of the scale, with the virtual zero.
    pub(super) fn digits(&self, on_scale: f64, settings: &Settings) -> f64 {
        let (low, high) = (settings.low, settings.high);
        let straight = |at: f64| low + at * (high - low);
        let Some(zero) = self.learned.zero.filter(|_| settings.has_zero()) else {
            return straight(on_scale);
        };
        let zero = self.on_scale(zero, settings);
        if !settings.zero_keeps_ends || zero <= 0.0 || zero >= 1.0 {
            return straight(on_scale) - straight(zero);
        }
        // The ends stay where they are, so the line has a knee at the zero.
        match on_scale {
            at if at < zero => low * (zero - at) / zero,
            at => high * (at - zero) / (1.0 - zero),
        }
    }
}

/// In seconds.
const ROUNDING: f64 = 1e-6;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::drr460::model::rules::Rules;

    fn settings(kind: i64) -> Settings {
        let list = [(3, -100), (4, 100), (9, kind)];
        Settings::of(&Parameters::listed(&list, &Rules::plain()), true)
    }

    fn digits(latch: &Latch, share: f64, settings: &Settings) -> f64 {
        latch.digits(latch.on_scale(share, settings), settings).round()
    }

    #[test]
    fn the_ends_of_the_scale_are_learned() {
        let (mut latch, settings) = (Latch::default(), settings(1));
        assert!(!latch.accepts(2, 1, &settings));
        latch.command(1, 1, 0.0);
        assert!(latch.accepts(2, 1, &settings) && !latch.accepts(4, 1, &settings));
        latch.command(2, 1, 0.2);
        latch.command(3, 1, 0.6);
        for (share, expected) in [(0.2, -100.0), (0.4, 0.0), (0.6, 100.0)] {
            assert_eq!(digits(&latch, share, &settings), expected, "{share}");
        }
        assert_eq!(digits(&latch, 0.5, &self::settings(0)), 0.0);
    }

    #[test]
    fn the_standard_procedure_ends_after_two_minutes() {
        for (kind, goes_on) in [(1, false), (2, true), (3, true)] {
            let (mut latch, settings) = (Latch::default(), settings(kind));
            latch.command(1, 1, 0.0);
            latch.advance(119.9, &settings);
            assert!(latch.is_enabled());
            latch.advance(0.1, &settings);
            assert_eq!(latch.is_enabled(), goes_on, "{kind}");
        }
    }

    #[test]
    fn a_virtual_zero_keeps_the_ends_or_shifts_the_line() {
        let mut latch = Latch::default();
        latch.command(4, 1, 0.75);
        for (kind, expected) in [(2, [-100.0, 0.0, 100.0]), (3, [-150.0, 0.0, 50.0])] {
            let settings = settings(kind);
            assert_eq!([0.0, 0.75, 1.0].map(|at| digits(&latch, at, &settings)), expected);
        }
        latch.command(4, 2, 0.0);
        assert_eq!(digits(&latch, 0.75, &settings(2)), 50.0);
    }
}
