//! From the temperature of the plant to the process value (manual, 11.3.2, parameters 1 to 8).

use canopen::Dictionary;

use super::objects::parameter;
use super::rules::Drr460Rules;
use crate::devices::pixsys::SENSOR_RANGES;

/// The process value in digits for a temperature; `Err` with the value when the sensor that is
/// selected cannot measure it.
pub(super) fn process_value(
    celsius: f64,
    od: &Dictionary,
    rules: &dyn Drr460Rules,
) -> Result<i64, i64> {
    let degrees = match rules.unit(parameter(od, UNIT)) {
        1 => celsius * 1.8 + 32.0,
        2 => celsius + 273.15,
        _ => celsius,
    };
    let (gain, offset) = rules.calibration(parameter(od, GAIN), parameter(od, OFFSET));
    let digits = (degrees * 10.0 * (1.0 + gain as f64 / 1000.0)).round() as i64 + offset;
    let digits = digits.clamp(i64::from(-i16::MAX), i64::from(i16::MAX));
    let sensor = parameter(od, SENSOR);
    match usize::try_from(sensor).ok().and_then(|sensor| SENSOR_RANGES.get(sensor)) {
        Some((low, high)) if !(*low..=*high).contains(&celsius) => Err(digits),
        _ => Ok(digits),
    }
}

const SENSOR: u8 = 1;
const UNIT: u8 = 2;
const OFFSET: u8 = 7;
const GAIN: u8 = 8;

#[cfg(test)]
mod tests {
    use canopen::Mux;

    use super::*;
    use crate::devices;
    use crate::devices::drr460::rules::Manual;

    type Parameters = &'static [(u8, i64)];

    #[test]
    fn calibration_and_unit() {
        let eds = devices::device("drr460").unwrap().description.eds;
        let table: [(Parameters, f64, Result<i64, i64>); 7] = [
            (&[], 25.0, Ok(250)),
            (&[(UNIT, 1)], 25.0, Ok(770)),
            (&[(UNIT, 2)], 25.0, Ok(2982)),
            (&[(OFFSET, -300)], 25.0, Ok(-50)),
            (&[(GAIN, 100), (OFFSET, 5)], 100.0, Ok(1105)),
            (&[(SENSOR, 7)], 25.0, Err(250)),
            (&[(SENSOR, 18)], 25.0, Ok(250)),
        ];
        for (parameters, celsius, value) in table {
            let mut od = Dictionary::new(&eds, 1).unwrap();
            for (sub, number) in parameters {
                od.set_int(Mux::new(0x3000, *sub), *number);
            }
            assert_eq!(process_value(celsius, &od, &Manual), value, "{parameters:?}");
        }
    }
}
