//! The physical side: names of terminals, and what a bench may put there.

use canopen::{BenchError, Value};

use super::sensor::{Connected, Wiring};
use crate::devices::terminal::{flag, number, place, said, split, word};

/// The bench's settings for the module as a whole.
#[derive(Clone, Copy, Debug)]
pub(super) struct Surroundings {
    /// Volts at the terminals of the supply.
    pub(super) supply: f64,
    /// Degrees Celsius at the terminals of the sensors.
    pub(super) terminals: f64,
    /// Whether the groups of outputs have their supply.
    pub(super) groups: [bool; 2],
    /// The last manual choice of the communication interface: 0 is CAN, 1 is RS485.
    pub(super) interface: i64,
}

impl Default for Surroundings {
    fn default() -> Self {
        Self { supply: 24.0, terminals: 25.0, groups: [true; 2], interface: 0 }
    }
}

impl Surroundings {
    /// Takes a stimulus.
    ///
    /// # Errors
    /// When there is none of that name, or it does not take the value.
    pub(super) fn set(&mut self, name: &str, value: &Value) -> Result<(), BenchError> {
        let number = |low, high, unit| number(name, value, (low, high), unit);
        match name {
            SUPPLY => self.supply = number(0.0, 30.0, "V")?,
            TERMINALS => self.terminals = number(-40.0, 100.0, "degrees Celsius")?,
            INTERFACE => self.interface = word(name, value, &INTERFACES)?,
            _ => {
                let group = place(name, GROUPS).and_then(|place| self.groups.get_mut(place));
                *group.ok_or_else(|| BenchError::unknown(name))? = flag(name, value)?;
            }
        }
        Ok(())
    }

    /// The value that was set.
    pub(super) fn observe(&self, name: &str) -> Option<Value> {
        Some(match name {
            SUPPLY => Value::Real(self.supply),
            TERMINALS => Value::Real(self.terminals),
            INTERFACE => said(&self.interface, &INTERFACES)?,
            _ => Value::Int((*self.groups.get(place(name, GROUPS)?)?).into()),
        })
    }
}

impl Connected {
    /// Takes a stimulus at an analogue input; `None` when the name is none of those.
    pub(super) fn set(&mut self, name: &str, value: &Value) -> Option<Result<(), BenchError>> {
        let (prefix, _) = split(name)?;
        let number = |low, high, unit| number(name, value, (low, high), unit);
        let outcome = match prefix {
            VOLTAGES | FIELDS => {
                number(-20_000.0, 30_000.0, "mV").map(|number| self.millivolts = number)
            }
            CURRENTS => number(-5000.0, 40_000.0, "uA").map(|number| self.microamperes = number),
            TEMPERATURES => {
                number(-300.0, 2500.0, "degrees Celsius").map(|number| self.celsius = number)
            }
            WIPERS => number(0.0, 100.0, "%").map(|number| self.percent = number),
            RESISTANCES => number(0.0, 1000.0, "kilohms").map(|number| self.kilohms = number),
            WIRINGS => word(name, value, &WIRES).map(|wiring| self.wiring = wiring),
            _ => return None,
        };
        Some(outcome)
    }

    /// The value that was set.
    pub(super) fn observe(&self, name: &str) -> Option<Value> {
        let (prefix, _) = split(name)?;
        Some(match prefix {
            VOLTAGES => Value::Real(self.millivolts),
            FIELDS => Value::Int(self.millivolts.round() as i128),
            CURRENTS => Value::Real(self.microamperes),
            TEMPERATURES => Value::Real(self.celsius),
            WIPERS => Value::Real(self.percent),
            RESISTANCES => Value::Real(self.kilohms),
            WIRINGS => said(&self.wiring, &WIRES)?,
            _ => return None,
        })
    }
}

pub(super) const SUPPLY: &str = "supply-voltage";
pub(super) const TERMINALS: &str = "terminal-temperature";
pub(super) const INTERFACE: &str = canopen::bench::INTERFACE;
pub(super) const GROUPS: &str = "output-supply-";
pub(super) const DIGITAL_INPUTS: &str = "digital-inputs-";
pub(super) const DIGITAL_OUTPUTS: &str = "digital-outputs-";
pub(super) const ANALOGUE_OUTPUTS: &str = "analogue-output-";
pub(super) const OUTPUT_VOLTAGES: &str = "output-voltage-";
pub(super) const OUTPUT_CURRENTS: &str = "output-current-";
pub(super) const STEPS: &str = "encoder-steps-";
pub(super) const FREQUENCIES: &str = "encoder-frequency-";
pub(super) const INDICES: &str = "encoder-index-";
pub(super) const LINES: &str = "encoder-lines-";
/// In millivolts, which are the digits of an input for 0 to 10 V.
pub(super) const FIELDS: &str = "analogue-input-";
pub(super) const VOLTAGES: &str = "input-voltage-";
pub(super) const CURRENTS: &str = "input-current-";
pub(super) const TEMPERATURES: &str = "input-temperature-";
pub(super) const WIPERS: &str = "input-potentiometer-";
pub(super) const RESISTANCES: &str = "input-resistance-";
pub(super) const WIRINGS: &str = "input-wiring-";
pub(super) const STATUS_LEDS: &str = "status-leds-";
pub(super) const INPUT_LEDS: &str = "input-led-";
pub(super) const OUTPUT_LEDS: &str = "output-led-";
pub(super) const RUN_LED: &str = "run-led";
pub(super) const COM_LED: &str = "com-led";
pub(super) const DISPLAY: &str = "display";

const INTERFACES: [(&str, i64); 2] = [("can", 0), ("rs485", 1)];
const WIRES: [(&str, Wiring); 3] =
    [("connected", Wiring::Connected), ("broken", Wiring::Broken), ("shorted", Wiring::Shorted)];

#[cfg(test)]
mod tests {
    use super::*;

    fn text(text: &str) -> Value {
        Value::Text(text.to_owned())
    }

    #[test]
    fn what_is_connected_reads_back_and_has_bounds() {
        let mut connected = Connected::default();
        let table = [
            ("input-voltage-1", Value::Real(-2.5), Value::Int(30_001)),
            ("analogue-input-2", Value::Int(7000), text("5 V")),
            ("input-current-3", Value::Real(12_000.0), Value::Int(-5001)),
            ("input-temperature-4", Value::Real(250.5), text("warm")),
            ("input-potentiometer-1", Value::Real(40.0), Value::Int(101)),
            ("input-resistance-1", Value::Real(4.7), Value::Int(-1)),
            ("input-wiring-1", text("broken"), text("open")),
        ];
        for (name, value, wrong) in table {
            connected.set(name, &value).unwrap().unwrap();
            assert_eq!(connected.observe(name), Some(value));
            assert!(connected.set(name, &wrong).unwrap().is_err(), "{name}");
        }
        assert!(connected.set("wind-1", &Value::Int(1)).is_none());
        assert_eq!(connected.observe("input-wind-1"), None);
    }

    #[test]
    fn the_surroundings_read_back_and_have_bounds() {
        let mut surroundings = Surroundings::default();
        let table = [
            (SUPPLY, Value::Real(9.5), Value::Int(31), "0 to 30 V"),
            (TERMINALS, Value::Real(60.0), text("warm"), "-40 to 100"),
            (INTERFACE, text("rs485"), Value::Int(1), "`can` or `rs485`"),
            ("output-supply-2", Value::Int(0), Value::Int(2), "0 or 1"),
        ];
        for (name, value, wrong, expected) in table {
            surroundings.set(name, &value).unwrap();
            assert_eq!(surroundings.observe(name), Some(value));
            let error = surroundings.set(name, &wrong).unwrap_err();
            assert!(error.0.contains(expected), "{error}");
        }
        assert!(surroundings.set("output-supply-3", &Value::Int(1)).is_err());
        assert_eq!(surroundings.observe("wind"), None);
    }
}
