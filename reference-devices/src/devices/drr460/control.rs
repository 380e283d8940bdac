//! From the process value to the output (manual, parameters 16 to 46).

use canopen::Dictionary;

use super::PERIOD;
use super::alarm::{Sight, is_closed};
use super::delay::{Delayed, SAMPLES_PER_SECOND};
use super::objects::parameter;
use super::rules::Drr460Rules;

/// The controller's memory.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Control {
    /// On/off control before its delay.
    wanted: bool,
    switched: Delayed,
    /// The integral part, as a share of full output.
    integral: f64,
    last_process: Option<i64>,
    /// Samples since the beginning of the cycle.
    in_cycle: u64,
}

/// Where the command output is connected (parameter 16).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Wiring {
    /// Q1 is the command, Q2 alarm 1.
    Contact,
    /// Q1 opens a valve and Q2 closes it.
    Valve,
    /// The analogue output is the command, Q1 alarm 1 and Q2 alarm 2.
    Analogue {
        /// 4 to 20 mA instead of 0 to 20 mA.
        live_zero: bool,
    },
}

impl Wiring {
    pub(super) fn of(od: &Dictionary) -> Self {
        match parameter(od, COMMAND_OUTPUT) {
            2 | 3 => Self::Valve,
            code @ 4..=5 => Self::Analogue { live_zero: code == 5 },
            _ => Self::Contact,
        }
    }

    /// The share of power for a state of parameters 20 and 21.
    pub(super) fn state_share(self, code: i64) -> f64 {
        let milliamperes = match code {
            0 => 0.0,
            1 => 4.0,
            2 => 20.0,
            _ => 21.5,
        };
        match self {
            Self::Contact => f64::from(u8::from(is_closed(code))),
            Self::Valve => 0.0,
            Self::Analogue { live_zero: false } => f64::min(milliamperes / 20.0, 1.0),
            Self::Analogue { live_zero: true } => ((milliamperes - 4.0) / 16.0).clamp(0.0, 1.0),
        }
    }
}

impl Control {
    /// The output of automatic mode in hundredths of a per cent.
    pub(super) fn output(
        &mut self,
        sight: &Sight,
        od: &Dictionary,
        rules: &dyn Drr460Rules,
    ) -> i64 {
        let cools = rules.cools(parameter(od, ACTION));
        let sign = if cools { -1 } else { 1 };
        let missing = sign * (sight.set_point - sight.process);
        let band = rules.proportional_band(parameter(od, BAND));
        if band == 0 && parameter(od, INTEGRAL_TIME) == 0 {
            return self.on_off(missing, od);
        }
        self.wanted = false;
        let over = parameter(od, OFF_OVER_SET_POINT) == 1 && -missing > parameter(od, OFF_OVER_BY);
        let share = self.pid(missing, sign * sight.process, band, od);
        let limits = (parameter(od, LOWER_LIMIT), parameter(od, UPPER_LIMIT));
        let (low, high) = rules.output_limits(limits.0, limits.1);
        let percent = if over { 0.0 } else { share * 100.0 };
        (percent.clamp(low as f64, high.max(low) as f64) * 100.0).round() as i64
    }

    /// Whether the contact is closed for this output: its share of each cycle.
    pub(super) fn contact(&mut self, output: i64, od: &Dictionary) -> bool {
        let cycle = parameter(od, CYCLE_TIME).max(1).unsigned_abs() * SAMPLES_PER_SECOND;
        self.in_cycle = (self.in_cycle + 1) % cycle;
        self.in_cycle * FULL_OUTPUT < output.max(0).unsigned_abs() * cycle
    }

    /// Heating switches off at the set point and on again when the hysteresis is missing; a
    /// negative hysteresis lies beyond the set point instead.
    fn on_off(&mut self, missing: i64, od: &Dictionary) -> i64 {
        let hysteresis = parameter(od, HYSTERESIS);
        if missing <= hysteresis.min(0) {
            self.wanted = false;
        } else if missing >= hysteresis.max(0) {
            self.wanted = true;
        }
        let on = self.switched.follow(self.wanted, parameter(od, DELAY));
        i64::from(on) * FULL_OUTPUT as i64
    }

    fn pid(&mut self, missing: i64, process: i64, band: i64, od: &Dictionary) -> f64 {
        let seconds = |sub| parameter(od, sub) as f64 / 10.0;
        let band = band.max(1) as f64;
        let in_dead_band = missing.abs() <= parameter(od, DEAD_BAND);
        let part = if in_dead_band { 0.0 } else { missing as f64 / band };
        let centre = if parameter(od, BAND_CENTRED) == 1 { 0.5 } else { 0.0 };
        self.integral = match seconds(INTEGRAL_TIME) {
            0.0 => 0.0,
            time => (self.integral + part * PERIOD.as_secs_f64() / time).clamp(-1.0, 1.0),
        };
        let rise = process - self.last_process.replace(process).unwrap_or(process);
        let rate = rise as f64 / PERIOD.as_secs_f64();
        let derivative = rate * seconds(DERIVATIVE_TIME) / band;
        (part + centre + self.integral - derivative).clamp(0.0, 1.0)
    }
}

/// 100 % in hundredths of a per cent.
pub(super) const FULL_OUTPUT: u64 = 10_000;

const COMMAND_OUTPUT: u8 = 16;
/// Heating or cooling.
pub(super) const ACTION: u8 = 18;
const HYSTERESIS: u8 = 19;
const DELAY: u8 = 23;
const BAND: u8 = 33;
const INTEGRAL_TIME: u8 = 34;
const DERIVATIVE_TIME: u8 = 35;
const DEAD_BAND: u8 = 36;
const BAND_CENTRED: u8 = 37;
const OFF_OVER_SET_POINT: u8 = 38;
const OFF_OVER_BY: u8 = 39;
const CYCLE_TIME: u8 = 40;
const LOWER_LIMIT: u8 = 45;
const UPPER_LIMIT: u8 = 46;

#[cfg(test)]
mod tests {
    use canopen::Mux;

    use super::*;
    use crate::devices;
    use crate::devices::drr460::rules::Manual;

    type Parameters = &'static [(u8, i64)];

    fn od(parameters: &[(u8, i64)]) -> Dictionary {
        let mut od =
            Dictionary::new(&devices::device("drr460").unwrap().description.eds, 1).unwrap();
        for (sub, number) in parameters {
            od.set_int(Mux::new(0x3000, *sub), *number);
        }
        od
    }

    fn output(control: &mut Control, process: i64, od: &Dictionary) -> i64 {
        let sight = Sight { process, set_point: 500, sensor_error: false, running: true };
        control.output(&sight, od, &Manual)
    }

    #[test]
    fn on_off_keeps_its_state_within_the_hysteresis() {
        let table: [(Parameters, [(i64, i64); 4]); 3] = [
            (&[(19, 20)], [(481, 0), (480, 10_000), (499, 10_000), (500, 0)]),
            (&[(19, -20)], [(501, 0), (500, 10_000), (519, 10_000), (520, 0)]),
            (&[(19, 20), (18, 1)], [(519, 0), (520, 10_000), (501, 10_000), (500, 0)]),
        ];
        for (parameters, steps) in table {
            let (od, mut control) = (od(parameters), Control::default());
            for (process, expected) in steps {
                assert_eq!(
                    output(&mut control, process, &od),
                    expected,
                    "{parameters:?} {process}"
                );
            }
        }
    }

    #[test]
    fn a_proportional_band_divides_the_deviation() {
        let table: [(Parameters, i64, i64); 9] = [
            (&[(33, 200)], 500, 0),
            (&[(33, 200)], 450, 2500),
            (&[(33, 200)], 0, 10_000),
            (&[(33, 200), (37, 1)], 500, 5000),
            (&[(33, 200), (36, 50)], 450, 0),
            (&[(33, 200), (46, 40)], 0, 4000),
            (&[(33, 200), (45, 10)], 900, 1000),
            (&[(33, 200), (18, 1)], 550, 2500),
            (&[(33, 200), (37, 1), (38, 1), (39, 10)], 511, 0),
        ];
        for (parameters, process, expected) in table {
            let mut control = Control::default();
            assert_eq!(output(&mut control, process, &od(parameters)), expected, "{parameters:?}");
        }
    }

    #[test]
    fn an_integral_grows_with_its_time_and_a_derivative_resists() {
        let (od, mut control) = (od(&[(33, 200), (34, 100)]), Control::default());
        let last = (0..10 * SAMPLES_PER_SECOND).map(|_| output(&mut control, 450, &od)).last();
        assert_eq!(last, Some(5000));
        let (od, mut control) = (self::od(&[(33, 200), (35, 10)]), Control::default());
        assert_eq!(output(&mut control, 450, &od), 2500);
        assert_eq!(output(&mut control, 452, &od), 0);
    }

    #[test]
    fn a_contact_is_closed_for_its_share_of_the_cycle() {
        let (od, mut control) = (od(&[(40, 2)]), Control::default());
        let closed = (0..2 * SAMPLES_PER_SECOND).filter(|_| control.contact(2500, &od)).count();
        assert_eq!(closed as u64, SAMPLES_PER_SECOND / 2);
        assert!((0..200).all(|_| control.contact(10_000, &od)));
        assert!(!(0..200).any(|_| control.contact(0, &od)));
    }

    #[test]
    fn states_are_coded_by_the_kind_of_output() {
        assert_eq!(Wiring::of(&od(&[(16, 3)])), Wiring::Valve);
        assert_eq!([0, 1, 2, 3].map(|code| Wiring::Contact.state_share(code)), [0., 1., 0., 1.]);
        let zero = Wiring::of(&od(&[(16, 4)]));
        assert_eq!([0, 1, 2, 3].map(|code| zero.state_share(code)), [0.0, 0.2, 1.0, 1.0]);
        let live = Wiring::of(&od(&[(16, 5)]));
        assert_eq!([0, 1, 2, 3].map(|code| live.state_share(code)), [0.0, 0.0, 1.0, 1.0]);
    }
}
