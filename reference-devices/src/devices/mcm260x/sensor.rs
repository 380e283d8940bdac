//! From the signal at the terminals of an analogue input to digits (manual, chapters 6 to 8).

use super::parameters::{Item, Parameters, TEN_VOLTS};

pub(super) use crate::devices::pixsys::sensor::{Connected, Wiring};
use crate::devices::pixsys::sensor::{Seen, Sensor};

/// The result of a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Sample {
    /// The input is switched off.
    Off,
    /// Digits, not calibrated.
    Valid(f64),
    /// The signal is out of the range of the sensor: the digits of the nearest end of it.
    OutOfRange(f64),
}

/// Samples the signal at an input, counted from 0, whose terminals have this temperature in degrees
/// Celsius.
pub(super) fn sample(
    connected: Connected,
    terminals: f64,
    place: usize,
    parameters: Parameters,
) -> Sample {
    let sensor = parameters.value(Item::SensorType, place);
    let wiring = parameters.rules.wires(sensor, connected.wiring);
    let connected = Connected { wiring, ..connected };
    let error = parameters.rules.input_error();
    let (seen, digits): (Seen, &dyn Fn(f64) -> f64) = match sensor {
        1..=14 => {
            // Beyond its range the compensation of the cold junction lags behind the terminals.
            let lag = parameters.rules.junction_error(terminals);
            let sensor = Sensor::Temperature(sensor as usize - 1);
            let seen = sensor.off_by(sensor.see(connected, terminals, lag), error);
            (seen, &|celsius| degrees(celsius, parameters))
        }
        15..=21 => {
            let kilohms = parameters.value(Item::Potentiometer, place);
            let sensor = linear(sensor, kilohms as f64);
            let seen = sensor.off_by(sensor.see(connected, terminals, 0.0), error);
            (seen, &move |share| scaled(share, place, parameters))
        }
        _ => return Sample::Off,
    };
    match seen {
        Seen::Value(value) if parameters.rules.calibrates_samples() => {
            Sample::Valid(calibrated(digits(value), place, parameters))
        }
        Seen::Value(value) => Sample::Valid(digits(value)),
        Seen::Outside(end) => Sample::OutOfRange(digits(end)),
    }
}

/// Digits of an input, counted from 0, with its gain and offset.
pub(super) fn calibrated(digits: f64, place: usize, parameters: Parameters) -> f64 {
    let gain = parameters.value(Item::Gain, place) as f64;
    let offset = parameters.value(Item::Offset, place) as f64;
    parameters.rules.calibrated(digits, gain, offset)
}

/// The digits of a temperature: tenths of a degree in the unit that is selected.
fn degrees(celsius: f64, parameters: Parameters) -> f64 {
    let degrees = match parameters.common(Item::Degree) {
        1 => celsius * 1.8 + 32.0,
        2 => celsius + 273.15,
        _ => celsius,
    };
    degrees * 10.0
}

/// The linear signal of a code. `kilohms` is what the module takes a potentiometer for.
const fn linear(code: i64, kilohms: f64) -> Sensor {
    match code {
        15 => Sensor::Voltage(1000.0),
        16 => Sensor::Voltage(5000.0),
        TEN_VOLTS => Sensor::Voltage(10_000.0),
        18 => Sensor::Current(0.0),
        19 => Sensor::Current(4000.0),
        20 => Sensor::Voltage(60.0),
        _ => Sensor::Potentiometer(kilohms),
    }
}

/// The digits of a share of a range, within the limits unless they may be left.
fn scaled(share: f64, place: usize, parameters: Parameters) -> f64 {
    let lower = parameters.value(Item::LowerLimit, place);
    let upper = parameters.value(Item::UpperLimit, place);
    let beyond = parameters.value(Item::BeyondLimits, place) != 0;
    let share = if beyond { share } else { parameters.rules.within_limits(share) };
    let digits = lower as f64 + share * parameters.rules.span(lower, upper) as f64;
    parameters.rules.linear_digits(digits, parameters.common(Item::Degree))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::mcm260x::parameters::{Table, parameters_only};
    use crate::devices::mcm260x::rules::Mcm260xRules;
    use crate::devices::pixsys::SENSOR_RANGES;

    fn sampled(settings: &[(Item, i64)], connected: Connected, terminals: f64) -> Sample {
        let mut od = parameters_only();
        for (item, value) in settings {
            od.set_int(Table::Analogue.address(*item, 1).unwrap(), *value);
        }
        let parameters =
            Parameters { table: Table::Analogue, od: &od, rules: &Mcm260xRules::plain() };
        sample(connected, terminals, 1, parameters)
    }

    fn celsius(celsius: f64) -> Connected {
        Connected { celsius, ..Connected::default() }
    }

    fn millivolts(millivolts: f64) -> Connected {
        Connected { millivolts, ..Connected::default() }
    }

    #[test]
    fn each_temperature_sensor_has_its_range_in_tenths() {
        for (sensor, (low, high)) in (1..).zip(SENSOR_RANGES) {
            let of = |degrees| sampled(&[(Item::SensorType, sensor)], celsius(degrees), 25.0);
            for end in [low, high] {
                assert_eq!(of(end), Sample::Valid(end * 10.0), "{sensor}");
            }
            assert_eq!(of(low - 0.1), Sample::OutOfRange(low * 10.0), "{sensor}");
            assert_eq!(of(high + 0.1), Sample::OutOfRange(high * 10.0), "{sensor}");
        }
        assert_eq!(sampled(&[], celsius(25.0), 25.0), Sample::Off);
    }

    #[test]
    fn linear_signals_are_scaled_between_the_limits() {
        let current = |microamperes| Connected { microamperes, ..Connected::default() };
        let wiper = |percent, kilohms| Connected { percent, kilohms, ..Connected::default() };
        let table = [
            (15, millivolts(250.0), 250.0),
            (16, millivolts(2500.0), 500.0),
            (17, millivolts(10_000.0), 1000.0),
            (18, current(5000.0), 250.0),
            (19, current(12_000.0), 500.0),
            (20, millivolts(30.0), 500.0),
            (21, wiper(40.0, 10.0), 400.0),
            (21, wiper(40.0, 5.0), 200.0),
        ];
        for (sensor, connected, expected) in table {
            let Sample::Valid(digits) = sampled(&[(Item::SensorType, sensor)], connected, 25.0)
            else {
                panic!("{connected:?}")
            };
            assert!((digits - expected).abs() < 1e-6, "{sensor} {connected:?}: {digits}");
        }
    }

    #[test]
    fn limits_hold_unless_they_may_be_left() {
        let of = |beyond, volts: f64| {
            let items = [(Item::SensorType, 17), (Item::BeyondLimits, beyond)];
            match sampled(&items, millivolts(volts * 1000.0), 25.0) {
                Sample::Valid(digits) => Ok(digits.round()),
                Sample::OutOfRange(digits) => Err(digits.round()),
                Sample::Off => panic!("it is on"),
            }
        };
        assert_eq!((of(0, 10.4), of(1, 10.4), of(1, 10.5)), (Ok(1000.0), Ok(1040.0), Ok(1050.0)));
        assert_eq!((of(0, 10.6), of(1, -0.6)), (Err(1000.0), Err(-50.0)));
    }

    #[test]
    fn what_is_broken_goes_to_the_end_that_its_resistance_means() {
        let of = |sensor, wiring| {
            let connected = Connected { wiring, ..Connected::default() };
            sampled(&[(Item::SensorType, sensor)], connected, 25.0)
        };
        let table = [
            (1, Wiring::Broken, Sample::OutOfRange(13600.0)),
            (1, Wiring::Shorted, Sample::Valid(250.0)),
            (9, Wiring::Broken, Sample::OutOfRange(6000.0)),
            (9, Wiring::Shorted, Sample::OutOfRange(-1000.0)),
            (11, Wiring::Broken, Sample::OutOfRange(-400.0)),
            (11, Wiring::Shorted, Sample::OutOfRange(1250.0)),
            (12, Wiring::Broken, Sample::OutOfRange(1500.0)),
            (17, Wiring::Broken, Sample::Valid(0.0)),
            (18, Wiring::Broken, Sample::Valid(0.0)),
            (19, Wiring::Broken, Sample::OutOfRange(0.0)),
            (19, Wiring::Shorted, Sample::OutOfRange(1000.0)),
            (21, Wiring::Broken, Sample::OutOfRange(1000.0)),
            (21, Wiring::Shorted, Sample::Valid(0.0)),
        ];
        for (sensor, wiring, expected) in table {
            assert_eq!(of(sensor, wiring), expected, "{sensor} {wiring:?}");
        }
    }

    #[test]
    fn unit_gain_and_offset() {
        let with = |items: &[(Item, i64)], degrees| {
            let items = [&[(Item::SensorType, 1)], items].concat();
            let mut od = parameters_only();
            for (item, value) in items {
                od.set_int(Table::Analogue.address(item, 1).unwrap(), value);
            }
            let rules = &Mcm260xRules::plain();
            let parameters = Parameters { table: Table::Analogue, od: &od, rules };
            match sample(celsius(degrees), 25.0, 1, parameters) {
                Sample::Valid(digits) => calibrated(digits, 1, parameters).round() as i64,
                other => panic!("{other:?}"),
            }
        };
        assert_eq!(with(&[(Item::Degree, 1)], 100.0), 2120);
        assert_eq!(with(&[(Item::Degree, 2)], 100.0), 3732);
        assert_eq!(with(&[(Item::Gain, -10)], 101.0), 1000);
        assert_eq!(with(&[(Item::Gain, 1000), (Item::Offset, -7)], 100.0), 1993);
    }

    #[test]
    fn cold_junctions_are_compensated_from_0_to_50_degrees() {
        for (terminals, expected) in [(0.0, 1000.0), (50.0, 1000.0), (60.0, 900.0), (-5.0, 1050.0)]
        {
            let seen = sampled(&[(Item::SensorType, 4)], celsius(100.0), terminals);
            assert_eq!(seen, Sample::Valid(expected), "{terminals}");
        }
        let seen = sampled(&[(Item::SensorType, 9)], celsius(100.0), 60.0);
        assert_eq!(seen, Sample::Valid(1000.0));
        let shorted = Connected { wiring: Wiring::Shorted, ..Connected::default() };
        for (terminals, expected) in [(-5.0, 0.0), (31.0, 310.0), (60.0, 500.0)] {
            let seen = sampled(&[(Item::SensorType, 4)], shorted, terminals);
            assert_eq!(seen, Sample::Valid(expected), "a junction at {terminals} degrees");
        }
    }
}
