//! The plant: a load with a heat capacity that loses heat to the room, a heater, a cooler, and a
//! sensor that lags behind.

/// The load and the sensor in it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Load {
    /// In degrees Celsius, as the next one.
    celsius: f64,
    sensor: f64,
}

/// The drive of the load, as shares of the power of heater and cooler.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Drive {
    pub(crate) heating: f64,
    pub(crate) cooling: f64,
}

impl Default for Load {
    fn default() -> Self {
        Self { celsius: ROOM, sensor: ROOM }
    }
}

impl Load {
    /// Advances by `elapsed` seconds with this drive: the exact solution for a constant one.
    pub(crate) fn advance(&mut self, drive: Drive, elapsed: f64) {
        let end = Self::end(drive);
        let (load_rate, sensor_rate) = (LOSS / CAPACITY, 1.0 / SENSOR_LAG);
        let [load, sensor] = [load_rate, sensor_rate].map(|rate| (-rate * elapsed).exp());
        let away = self.celsius - end;
        // The sensor follows an exponential, itself with one.
        let gain = sensor_rate / (sensor_rate - load_rate);
        let follows = gain * away * (load - sensor);
        self.sensor = end + (self.sensor - end) * sensor + follows;
        self.celsius = end + away * load;
    }

    /// Where the temperature goes in the end.
    fn end(drive: Drive) -> f64 {
        ROOM + (drive.heating * HEATER - drive.cooling * COOLER) / LOSS
    }

    /// The temperature at the sensor in degrees Celsius.
    pub(crate) const fn sensor(&self) -> f64 {
        self.sensor
    }

    /// Whether nothing moves any more with this drive.
    pub(crate) fn rests(&self, drive: Drive) -> bool {
        let end = Self::end(drive);
        [self.celsius, self.sensor].iter().all(|celsius| (celsius - end).abs() < REST)
    }
}

/// In degrees Celsius.
const ROOM: f64 = 25.0;
/// In joules per kelvin: about a pound of steel.
const CAPACITY: f64 = 250.0;
/// In watts per kelvin.
const LOSS: f64 = 2.5;
/// In watts.
const HEATER: f64 = 750.0;
/// In watts.
const COOLER: f64 = 250.0;
/// In seconds.
const SENSOR_LAG: f64 = 2.0;
/// In kelvin: far below a digit.
const REST: f64 = 1e-4;

#[cfg(test)]
mod tests {
    use super::*;

    const HEATS: Drive = Drive { heating: 1.0, cooling: 0.0 };

    #[test]
    fn a_cold_load_warms_up_and_cools_down_again() {
        let mut load = Load::default();
        assert!(load.rests(Drive::default()) && !load.rests(HEATS));
        load.advance(HEATS, 20.0);
        assert!(load.sensor() > 60.0, "{}", load.sensor());
        load.advance(HEATS, 1e5);
        assert!((load.sensor() - 325.0).abs() < 1e-6 && load.rests(HEATS));
        load.advance(Drive { heating: 0.0, cooling: 1.0 }, 1e5);
        assert!((load.sensor() + 75.0).abs() < 1e-6);
    }

    #[test]
    fn many_short_steps_are_one_long_step() {
        let (mut short, mut long) = (Load::default(), Load::default());
        for _ in 0..600 {
            short.advance(HEATS, 0.1);
        }
        long.advance(HEATS, 60.0);
        assert!((short.sensor() - long.sensor()).abs() < 1e-9);
    }
}
