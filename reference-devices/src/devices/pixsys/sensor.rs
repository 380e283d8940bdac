//! The inputs of the Pixsys devices: the sensor signal before it becomes digits.

use super::SENSOR_RANGES;

/// The connection of an analogue input. A sensor sees only what it measures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Connected {
    pub(crate) millivolts: f64,
    pub(crate) microamperes: f64,
    /// For any selected temperature sensor.
    pub(crate) celsius: f64,
    /// The wiper of a potentiometer.
    pub(crate) percent: f64,
    /// The whole of that potentiometer.
    pub(crate) kilohms: f64,
    pub(crate) wiring: Wiring,
}

/// The wires of a sensor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Wiring {
    #[default]
    Connected,
    Broken,
    Shorted,
}

impl Default for Connected {
    fn default() -> Self {
        Self {
            millivolts: 0.0,
            microamperes: 0.0,
            celsius: 25.0,
            percent: 0.0,
            kilohms: 10.0,
            wiring: Wiring::Connected,
        }
    }
}

/// A kind of sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Sensor {
    /// A temperature sensor, by its place in [`SENSOR_RANGES`].
    Temperature(usize),
    /// From 0 to this many millivolts.
    Voltage(f64),
    /// From this many microamperes to 20 mA.
    Current(f64),
    /// A potentiometer of this many kilohms.
    Potentiometer(f64),
}

/// The signal of an input, in the unit of the sensor: degrees Celsius, or the share of a linear
/// signal's range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Seen {
    /// A value of the range.
    Value(f64),
    /// The end of the range that the signal lies beyond.
    Outside(f64),
}

impl Sensor {
    /// Whether the temperature of the terminals has a part in what it gives.
    pub(crate) const fn is_thermocouple(self) -> bool {
        matches!(self, Self::Temperature(..THERMOCOUPLES))
    }

    /// Whether it is a signal that counts as a share of its range.
    pub(crate) const fn is_linear(self) -> bool {
        !matches!(self, Self::Temperature(_))
    }

    /// The signal of the connected sensor. `terminals` are the degrees Celsius of the terminals,
    /// and `lag` is the part of them that the compensation of the cold junction misses.
    pub(crate) fn see(self, connected: Connected, terminals: f64, lag: f64) -> Seen {
        match self {
            Self::Temperature(place) => {
                let Some(range) = SENSOR_RANGES.get(place) else { return Seen::Outside(0.0) };
                temperature(connected, place, *range, (terminals, lag))
            }
            Self::Voltage(high) => self.linear(connected, connected.millivolts / high),
            Self::Current(low) => {
                let share = |microamperes: f64| (microamperes - low) / (FULL_CURRENT - low);
                let flows = connected.wiring == Wiring::Connected;
                let seen = if flows { connected.microamperes } else { 0.0 };
                self.linear(connected, share(seen))
            }
            Self::Potentiometer(kilohms) => {
                self.linear(connected, connected.percent / 100.0 * connected.kilohms / kilohms)
            }
        }
    }

    /// The signal of a linear input that errs only where a wire is certainly broken: below 3.6 mA
    /// of a live zero, or at a potentiometer.
    pub(crate) fn see_without_end(self, connected: Connected) -> Seen {
        let flows = connected.wiring == Wiring::Connected;
        match self {
            Self::Temperature(_) => Seen::Value(connected.celsius),
            Self::Voltage(high) => {
                Seen::Value(if flows { connected.millivolts / high } else { 0.0 })
            }
            Self::Current(low) => {
                let seen = if flows { connected.microamperes } else { 0.0 };
                let broken = low > 0.0 && seen < LIVE_ZERO_BROKEN;
                let share = (seen - low) / (FULL_CURRENT - low);
                if broken { Seen::Outside(-MARGIN) } else { Seen::Value(share) }
            }
            Self::Potentiometer(kilohms) => match flows {
                true => Seen::Value(connected.percent / 100.0 * connected.kilohms / kilohms),
                false => Seen::Outside(1.0 + MARGIN),
            },
        }
    }

    /// The signal of an input that is off by a share of its full scale.
    pub(crate) fn off_by(self, seen: Seen, share: f64) -> Seen {
        let (low, high) = match self {
            Self::Temperature(place) => SENSOR_RANGES.get(place).copied().unwrap_or_default(),
            _ => (0.0, 1.0),
        };
        match seen {
            Seen::Value(value) if low <= value && value <= high => {
                Seen::Value((value + share * (high - low)).clamp(low, high))
            }
            seen => seen,
        }
    }

    fn linear(self, connected: Connected, share: f64) -> Seen {
        let too_much = Seen::Outside(1.0 + MARGIN);
        let share = match (connected.wiring, self) {
            // A wiper without a track, and a transmitter that only the supply limits.
            (Wiring::Broken, Self::Potentiometer(_)) | (Wiring::Shorted, Self::Current(_)) => {
                return too_much;
            }
            (Wiring::Connected, _) | (Wiring::Broken, Self::Current(_)) => share,
            // No voltage reads as 0, a value like any other.
            _ => 0.0,
        };
        match share {
            // Rounding beyond the margin is no error.
            _ if share < -MARGIN - ROUNDING => Seen::Outside(-MARGIN),
            _ if share > 1.0 + MARGIN + ROUNDING => too_much,
            _ => Seen::Value(share),
        }
    }
}

fn temperature(
    connected: Connected,
    place: usize,
    (low, high): (f64, f64),
    (terminals, lag): (f64, f64),
) -> Seen {
    let (hot, cold) = (Seen::Outside(high), Seen::Outside(low));
    let celsius = match connected.wiring {
        Wiring::Connected if place < THERMOCOUPLES => connected.celsius - lag,
        Wiring::Connected => connected.celsius,
        // A short circuit is a junction at the terminals, compensated like any other.
        Wiring::Shorted if place < THERMOCOUPLES => terminals - lag,
        // The resistance of an NTC falls with the temperature.
        Wiring::Shorted => return if place == NTC { hot } else { cold },
        Wiring::Broken => return if place == NTC { cold } else { hot },
    };
    match celsius {
        _ if celsius < low => cold,
        _ if celsius > high => hot,
        _ => Seen::Value(celsius),
    }
}

/// The first temperature sensors, this many, are thermocouples.
const THERMOCOUPLES: usize = 8;
/// The place of the NTC of 10 kilohms at 25 degrees.
const NTC: usize = 10;
/// In microamperes.
const FULL_CURRENT: f64 = 20_000.0;
/// In microamperes, below which a live zero means a broken wire. The manuals leave it open.
const LIVE_ZERO_BROKEN: f64 = 3600.0;
/// How far a linear signal may leave its range before that is an error, as a share of the range.
/// The manuals leave it open.
const MARGIN: f64 = 0.05;
const ROUNDING: f64 = 1e-9;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn broken_and_shorted_wires_are_seen_by_the_kind_of_sensor() {
        let wired = |wiring| Connected { wiring, ..Connected::default() };
        let table = [
            (Sensor::Temperature(0), Seen::Outside(1360.0), Seen::Value(31.0)),
            (Sensor::Temperature(8), Seen::Outside(600.0), Seen::Outside(-100.0)),
            (Sensor::Temperature(NTC), Seen::Outside(-40.0), Seen::Outside(125.0)),
            (Sensor::Voltage(60.0), Seen::Value(0.0), Seen::Value(0.0)),
            (Sensor::Current(0.0), Seen::Value(0.0), Seen::Outside(1.05)),
            (Sensor::Current(4000.0), Seen::Outside(-0.05), Seen::Outside(1.05)),
            (Sensor::Potentiometer(10.0), Seen::Outside(1.05), Seen::Value(0.0)),
        ];
        for (sensor, broken, shorted) in table {
            let seen = [Wiring::Broken, Wiring::Shorted]
                .map(|wiring| sensor.see(wired(wiring), 31.0, 0.0));
            assert_eq!(seen, [broken, shorted], "{sensor:?}");
        }
    }
}
