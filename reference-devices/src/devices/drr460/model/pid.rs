//! P, PI, PD and PID control, with heating and cooling (manual, 7.8 and 11.3.2, parameters 33 to
//! 46).

use super::parameters::Parameters;
use super::rules::Rules;

/// The settings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Settings {
    /// In digits.
    band: f64,
    /// Without a band there is only an integral part (sub 33: on/off needs both to be 0).
    is_proportional: bool,
    integral_time: f64,
    derivative_time: f64,
    dead_band: i64,
    centred: bool,
    /// Digits over the set point from where the output is off.
    off_over: Option<i64>,
    /// In digits; there is a second output that cools.
    cooling_band: Option<f64>,
    /// The share of the band by which heating ends later and cooling begins earlier.
    overlap: (f64, f64),
    limits: (f64, f64),
}

impl Settings {
    /// `double_loop` says that an alarm cools.
    pub(super) fn of(parameters: &Parameters, double_loop: bool) -> Self {
        let rules = parameters.rules;
        let configured = (parameters.get(33) > 0).then(|| parameters.get(33) as f64);
        let band = configured.or_else(|| rules.band_without_one());
        let is_proportional = band.is_some();
        let band = band.unwrap_or(NO_BAND);
        let cooling_band = rules.cooling_band(band, parameters.get(42) as f64 / 100.0).max(1.0);
        let (low, high) = (parameters.get(45) as f64 / 100.0, parameters.get(46) as f64 / 100.0);
        Self {
            band,
            is_proportional,
            integral_time: parameters.tenths(34),
            derivative_time: parameters.tenths(35),
            dead_band: parameters.get(36),
            centred: rules.centred(parameters.is_set(37), double_loop),
            off_over: parameters.is_set(38).then(|| parameters.get(39)),
            cooling_band: double_loop.then_some(cooling_band),
            overlap: rules.overlap(parameters.get(43) as f64 / 1000.0),
            limits: (low, high.max(low)),
        }
    }

    /// Whether the controller is none of these but on/off.
    pub(super) fn is_on_off(parameters: &Parameters) -> bool {
        parameters.rules.is_on_off(parameters.get(33), parameters.get(34))
    }
}

/// The memory of the controller.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Pid {
    /// A share of the full output.
    integral: f64,
    /// The deviation from the set point, through a filter of the first order.
    slow: Option<f64>,
    /// Digits in a second.
    rate: f64,
}

/// Shares of full output.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Outputs {
    pub(super) command: f64,
    pub(super) cooling: f64,
}

impl Pid {
    /// The outputs with `missing` digits to the set point, in the direction of the command. The
    /// derivative looks at the process alone, so `moved` is the movement of the set point in that
    /// direction since the last step.
    pub(super) fn step(
        &mut self,
        (missing, moved): (i64, i64),
        settings: &Settings,
        elapsed: f64,
        rules: &Rules,
    ) -> Outputs {
        let is_dead = settings.dead_band > 0 && rules.in_dead_band(missing, settings.dead_band);
        let counts = match is_dead {
            true => 0,
            false => rules.beyond_dead_band(missing, settings.dead_band),
        };
        let deviation = counts as f64 / settings.band;
        let proportional = if settings.is_proportional { deviation } else { 0.0 };
        let filter = rules.derivative_filter();
        self.approach(missing, rules.set_point_step(moved), elapsed, filter);
        let derivative = self.rate / settings.band * settings.derivative_time;
        let centre = if settings.centred { 0.5 } else { 0.0 };
        let lowest = if settings.cooling_band.is_some() { -1.0 } else { 0.0 };
        let rest = proportional + centre - derivative;
        self.integral = match settings.integral_time {
            0.0 if rules.integral_goes_with_its_time() => 0.0,
            0.0 => self.integral,
            time => {
                let grown = self.integral + deviation * elapsed / time;
                // Demand beyond the limits of the output is not integrated.
                grown.clamp((lowest - rest).min(0.0), (1.0 - rest).max(0.0))
            }
        };
        let wanted = rest + self.integral;
        let over = settings.off_over.is_some_and(|threshold| rules.is_over(-missing, threshold));
        let (low, high) = settings.limits;
        let later = if settings.cooling_band.is_some() { settings.overlap.0 } else { 0.0 };
        let command = match over {
            true => 0.0,
            false => (wanted + later).clamp(0.0, 1.0).clamp(low, high),
        };
        Outputs { command, cooling: self.cooling(wanted, settings) }
    }

    /// How fast the process approaches the set point, through a filter with this time constant in
    /// seconds; with 0, by the difference of two samples.
    fn approach(&mut self, missing: i64, moved: i64, elapsed: f64, filter: f64) {
        let missing = missing as f64;
        let slow = self.slow.map_or(missing, |slow| slow + moved as f64);
        if filter == 0.0 {
            if elapsed > 0.0 {
                (self.slow, self.rate) = (Some(missing), (slow - missing) / elapsed);
            }
            return;
        }
        let slow = missing + (slow - missing) * (-elapsed / filter).exp();
        let distance = slow - missing;
        let slow = if distance.abs() < NOTICED { missing } else { slow };
        (self.slow, self.rate) = (Some(slow), (slow - missing) / filter);
    }

    /// Whether another look at the same process would say the same.
    pub(super) fn is_settled(&self, settings: &Settings) -> bool {
        settings.integral_time == 0.0 && self.rate == 0.0
    }

    /// Cooling begins where heating ends, or earlier by the overlap.
    fn cooling(&self, wanted: f64, settings: &Settings) -> f64 {
        let Some(band) = settings.cooling_band else { return 0.0 };
        // Below 0, `wanted` counts in bands of heating.
        let beyond = settings.overlap.1 - wanted;
        (beyond * settings.band / band).clamp(0.0, 1.0)
    }

    /// Restarts. With an integral action, the output continues from `output`.
    pub(super) fn restart(&mut self, output: f64, settings: &Settings) {
        let integral = if settings.integral_time > 0.0 { output } else { 0.0 };
        *self = Self { integral, ..Self::default() };
    }
}

/// Digits below which the filter has arrived.
const NOTICED: f64 = 0.01;
/// Digits that the integral part takes for a band where there is none. The manual has no figure.
const NO_BAND: f64 = 1000.0;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::drr460::model::parameters::List;
    use crate::devices::drr460::model::rules::Rules;

    fn settings(list: &[(u8, i64)], double_loop: bool) -> Settings {
        let mut all = list.to_vec();
        all.extend([(33, 200), (46, 100), (42, 100)]);
        Settings::of(&Parameters::listed(&all, &Rules::plain()), double_loop)
    }

    fn outputs(list: &[(u8, i64)], double_loop: bool, missing: i64) -> (i64, i64) {
        let mut outputs = Pid::default();
        let outputs =
            outputs.step((missing, 0), &settings(list, double_loop), 0.1, &Rules::plain());
        ((outputs.command * 1e4).round() as i64, (outputs.cooling * 1e4).round() as i64)
    }

    #[test]
    fn a_proportional_band_divides_the_deviation() {
        let table: [(List<'_>, i64, i64); 9] = [
            (&[], 0, 0),
            (&[], 50, 2500),
            (&[], 500, 10_000),
            (&[(37, 1)], 0, 5000),
            (&[(37, 1)], -50, 2500),
            (&[(36, 50)], 50, 0),
            (&[(46, 40)], 500, 4000),
            (&[(45, 10)], -400, 1000),
            (&[(37, 1), (38, 1), (39, 10)], -11, 0),
        ];
        for (list, missing, expected) in table {
            assert_eq!(outputs(list, false, missing).0, expected, "{list:?} {missing}");
        }
    }

    #[test]
    fn cooling_has_a_band_and_an_overlap_of_its_own() {
        let table: [(List<'_>, i64, (i64, i64)); 8] = [
            (&[], 0, (0, 0)),
            (&[], -50, (0, 2500)),
            (&[(42, 250)], -50, (0, 1000)),
            (&[(43, 100)], 0, (0, 1000)),
            (&[(43, 100)], 10, (500, 500)),
            (&[(43, -100)], -20, (0, 0)),
            (&[(43, -100)], -70, (0, 2500)),
            (&[(37, 1)], 0, (0, 0)),
        ];
        for (list, missing, expected) in table {
            // The first of two equal parameters counts.
            assert_eq!(outputs(list, true, missing), expected, "{list:?} {missing}");
        }
    }

    #[test]
    fn an_integral_grows_with_its_time_and_a_derivative_resists() {
        let (integrating, mut pid) = (settings(&[(34, 100)], false), Pid::default());
        let last =
            (0..100).map(|_| pid.step((50, 0), &integrating, 0.1, &Rules::plain()).command).last();
        assert!((last.unwrap() - 0.5).abs() < 1e-6);
        let (resisting, mut pid) = (settings(&[(35, 10)], false), Pid::default());
        assert_eq!(pid.step((50, 0), &resisting, 0.1, &Rules::plain()).command, 0.25);
        // Ten digits nearer, of which the filter has not seen 1/e yet: a share of 200 digits.
        let expected = 0.2 - 10.0 * (-1.0_f64).exp() / 200.0;
        assert!(
            (pid.step((40, 0), &resisting, 1.0, &Rules::plain()).command - expected).abs() < 1e-9
        );
        // A step of the set point has no part in it.
        let (resisting, mut pid) = (settings(&[(35, 10)], false), Pid::default());
        pid.step((50, 0), &resisting, 0.1, &Rules::plain());
        assert_eq!(pid.step((100, 50), &resisting, 1.0, &Rules::plain()).command, 0.5);
    }

    #[test]
    fn an_integral_is_not_saved_up() {
        let (settings, mut pid) = (settings(&[(34, 10)], false), Pid::default());
        for _ in 0..10_000 {
            pid.step((400, 0), &settings, 0.1, &Rules::plain());
        }
        for _ in 0..200 {
            pid.step((-20, 0), &settings, 0.1, &Rules::plain());
        }
        assert_eq!(pid.step((-20, 0), &settings, 0.1, &Rules::plain()).command, 0.0);
    }
}
