//! From the terminals of the input to the process value (manual, 11.3.2, parameters 1 to 10).

use super::PERIOD;
use super::filter::Filter;
use super::latch::{self, Latch};
use super::parameters::Parameters;
use super::rules::Rules;
use crate::devices::pixsys::sensor::{Connected, Seen, Sensor, Wiring};

/// The settings of the input.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Settings {
    pub(super) sensor: Sensor,
    unit: i64,
    beyond: bool,
    offset: f64,
    gain: f64,
    samples: i64,
    kilohms: f64,
    pub(super) latch: latch::Settings,
}

impl Settings {
    pub(super) fn of(parameters: &Parameters) -> Self {
        let sensor = sensor(parameters.get(1), parameters.get(5));
        Self {
            sensor,
            unit: parameters.get(2),
            beyond: parameters.is_set(6),
            offset: parameters.get(7) as f64,
            gain: parameters.get(8) as f64,
            samples: parameters.get(10),
            kilohms: parameters.get(5) as f64,
            latch: latch::Settings::of(parameters, sensor.is_linear()),
        }
    }
}

/// The sensor of a code; `kilohms` is the resistance of a potentiometer.
fn sensor(code: i64, kilohms: i64) -> Sensor {
    match code {
        14 => Sensor::Voltage(10_000.0),
        15 => Sensor::Current(0.0),
        16 => Sensor::Current(4000.0),
        17 => Sensor::Voltage(60.0),
        18 => Sensor::Potentiometer(kilohms.max(1) as f64),
        temperature => Sensor::Temperature(usize::try_from(temperature).unwrap_or(0)),
    }
}

/// The input.
#[derive(Clone, Debug, Default)]
pub(super) struct Input {
    pub(super) latch: Latch,
    filter: Filter,
    /// The sensor that the samples are of.
    sensor: Option<Sensor>,
    /// The share of its range that a linear signal has, for latch-on.
    pub(super) share: f64,
    /// The last sample, and its age.
    last: Option<Reading>,
    since: f64,
    /// The process value that was shown last.
    shown: i64,
}

/// The result of a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Reading {
    /// Digits: the process value, or the end of the range that the signal lies beyond.
    pub(super) process: i64,
    /// The signal is out of the range of the sensor.
    pub(super) is_error: bool,
}

impl Input {
    /// Takes a sample of the connection, or shows that at the start of the period; `terminals` is
    /// the temperature of the terminals in degrees Celsius.
    pub(super) fn sample(
        &mut self,
        connected: (Connected, f64),
        settings: &Settings,
        elapsed: f64,
        rules: &Rules,
    ) -> Reading {
        self.since += elapsed;
        let is_early = !rules.samples_at_once() && self.since + ROUNDING < PERIOD;
        if let Some(last) = self.last.filter(|_| is_early) {
            return last;
        }
        let elapsed = std::mem::take(&mut self.since);
        let reading = self.measure(connected, settings, elapsed, rules);
        self.last = Some(reading);
        reading
    }

    fn measure(
        &mut self,
        (connected, terminals): (Connected, f64),
        settings: &Settings,
        elapsed: f64,
        rules: &Rules,
    ) -> Reading {
        let lag = terminals - rules.compensated(terminals);
        let kilohms = rules.track(connected.kilohms, settings.kilohms);
        let connected = Connected { kilohms, ..connected };
        if self.sensor.replace(settings.sensor) != Some(settings.sensor) {
            self.filter.clear();
        }
        let seen = match settings.sensor.is_linear() && !rules.linear_signals_end() {
            true => settings.sensor.see_without_end(connected),
            false => settings.sensor.see(connected, terminals, lag),
        };
        match settings.sensor.off_by(seen, rules.input_error()) {
            Seen::Value(value) => {
                let wires = if settings.sensor.is_linear() { 0.0 } else { rules.wires(terminals) };
                let digits = self.digits(value + wires, settings, rules);
                let digits = rules.calibrated(digits, settings.gain, settings.offset);
                self.shown = whole(self.filter.take(digits, settings.samples, elapsed, rules));
                Reading { process: self.shown, is_error: false }
            }
            Seen::Outside(end) => {
                self.filter.clear();
                let at_end = whole(self.digits(end, settings, rules));
                let shorted = connected.wiring == Wiring::Shorted;
                if rules.shows_end(settings.sensor.is_linear(), shorted) {
                    self.shown = at_end;
                }
                Reading { process: self.shown, is_error: true }
            }
        }
    }

    fn digits(&mut self, value: f64, settings: &Settings, rules: &Rules) -> f64 {
        if !settings.sensor.is_linear() {
            let digits = rules.degrees(value, settings.unit) * 10.0;
            return rules.temperature(digits, settings.latch.limits());
        }
        self.share = value;
        let on_scale = self.latch.on_scale(value, &settings.latch);
        let within = if settings.beyond { on_scale } else { on_scale.clamp(0.0, 1.0) };
        rules.linear(self.latch.digits(within, &settings.latch), settings.unit)
    }

    /// The device was switched on: only the learned values remain.
    pub(super) fn restart(&mut self) {
        let mut latch = self.latch;
        latch.restart();
        *self = Self { latch, ..Self::default() };
    }

    /// The sensor is selected, even if it is the same one.
    pub(super) const fn select_again(&mut self) {
        self.sensor = None;
    }

    /// Whether another sample of the same signal would say the same.
    pub(super) fn is_settled(&self, settings: &Settings, rules: &Rules) -> bool {
        self.filter.is_settled(settings.samples, rules) && rules.samples_at_once()
    }
}

/// In seconds.
const ROUNDING: f64 = 1e-6;

fn whole(digits: f64) -> i64 {
    digits.round().clamp(f64::from(-i16::MAX), f64::from(i16::MAX)) as i64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::drr460::model::parameters::List;
    use crate::devices::drr460::model::rules::Rules;
    use crate::devices::pixsys::SENSOR_RANGES;

    fn read(list: &[(u8, i64)], connected: Connected, terminals: f64) -> (i64, bool) {
        let settings = Settings::of(&Parameters::listed(list, &Rules::plain()));
        let reading =
            Input::default().sample((connected, terminals), &settings, 0.1, &Rules::plain());
        (reading.process, reading.is_error)
    }

    fn celsius(celsius: f64) -> Connected {
        Connected { celsius, ..Connected::default() }
    }

    #[test]
    fn each_temperature_sensor_has_its_range() {
        for (code, (low, high)) in (0..).zip(SENSOR_RANGES) {
            let of = |degrees| read(&[(1, code)], celsius(degrees), 25.0);
            let [low_digits, high_digits] = [low, high].map(|end| (end * 10.0) as i64);
            assert_eq!((of(low), of(high)), ((low_digits, false), (high_digits, false)));
            assert_eq!(of(low - 0.1), (low_digits, true), "{code}");
            assert_eq!(of(high + 0.1), (high_digits, true), "{code}");
        }
    }

    #[test]
    fn unit_and_calibration() {
        let table: [(List<'_>, f64, i64); 5] = [
            (&[], 25.0, 250),
            (&[(2, 1)], 25.0, 770),
            (&[(2, 2)], 25.0, 2982),
            (&[(7, -300)], 25.0, -50),
            (&[(8, 100), (7, 5)], 100.0, 1105),
        ];
        for (list, degrees, digits) in table {
            assert_eq!(read(list, celsius(degrees), 25.0), (digits, false), "{list:?}");
        }
    }

    #[test]
    fn linear_signals_have_their_scale_and_its_limits() {
        let millivolts = |millivolts| Connected { millivolts, ..Connected::default() };
        let current = |microamperes| Connected { microamperes, ..Connected::default() };
        let wiper = |percent, kilohms| Connected { percent, kilohms, ..Connected::default() };
        let table = [
            (14, 0, millivolts(5000.0), (500, false)),
            (14, 0, millivolts(10_300.0), (1000, false)),
            (14, 1, millivolts(10_300.0), (1030, false)),
            (14, 1, millivolts(10_600.0), (1050, true)),
            (15, 0, current(5000.0), (250, false)),
            (16, 0, current(12_000.0), (500, false)),
            (16, 1, current(3000.0), (-50, true)),
            (17, 0, millivolts(30.0), (500, false)),
            (18, 0, wiper(40.0, 10.0), (400, false)),
            (18, 0, wiper(40.0, 5.0), (200, false)),
        ];
        for (code, beyond, connected, expected) in table {
            let list = [(1, code), (3, 0), (4, 1000), (5, 10), (6, beyond)];
            assert_eq!(read(&list, connected, 25.0), expected, "{code} {connected:?}");
        }
    }

    #[test]
    fn a_cold_junction_is_compensated_within_its_range() {
        for (terminals, digits) in [(0.0, 1000), (50.0, 1000), (60.0, 900), (-10.0, 1100)] {
            assert_eq!(read(&[], celsius(100.0), terminals), (digits, false), "{terminals}");
        }
        assert_eq!(read(&[(1, 8)], celsius(100.0), 60.0), (1000, false));
        let broken = Connected { wiring: Wiring::Broken, ..Connected::default() };
        assert_eq!(read(&[], broken, 25.0), (13_600, true));
    }
}
