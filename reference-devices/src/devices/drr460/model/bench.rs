//! The physical side: what a bench sets around the controller (manual, chapters 5 and 6).

use canopen::{BenchError, Value};

use super::flags::{Faults, MemoryFault};
use super::switches::Switches;
use crate::devices::pixsys::emergency::{BusFault, Module};
use crate::devices::pixsys::sensor::{Connected, Wiring};
use crate::devices::terminal::{flag, number, said, word};

/// The surroundings of the device.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Surroundings {
    pub(crate) connected: Connected,
    /// The sensor is in the load of the plant.
    pub(crate) in_process: bool,
    /// Degrees Celsius at the terminals of the sensor.
    pub(crate) terminals: f64,
    /// Of the current transformer.
    pub(crate) milliamperes: f64,
    pub(crate) switches: Switches,
    pub(crate) key: bool,
    pub(crate) faults: Faults,
    pub(crate) bus: BusFault,
    pub(crate) module: Module,
}

impl Default for Surroundings {
    fn default() -> Self {
        Self {
            connected: Connected::default(),
            in_process: true,
            terminals: 25.0,
            milliamperes: 0.0,
            switches: Switches { address: 1, rate: 7 },
            key: false,
            faults: Faults::default(),
            bus: BusFault::None,
            module: Module::Fitted,
        }
    }
}

impl Surroundings {
    /// Takes a stimulus.
    ///
    /// # Errors
    /// When there is none of that name, or it does not take the value.
    pub(crate) fn set(&mut self, name: &str, value: &Value) -> Result<(), BenchError> {
        let number = |low, high, unit| number(name, value, (low, high), unit);
        let contacts = |high| number(0.0, high, "as bits").map(|contacts| contacts as u8);
        match name {
            TEMPERATURE if *value == Value::Text(PROCESS.to_owned()) => self.in_process = true,
            TEMPERATURE => {
                self.connected.celsius = number(-400.0, 2500.0, "degrees Celsius, or `process`")?;
                self.in_process = false;
            }
            VOLTAGE => self.connected.millivolts = number(-1000.0, 30_000.0, "mV")?,
            CURRENT => self.connected.microamperes = number(-5000.0, 40_000.0, "uA")?,
            WIPER => self.connected.percent = number(0.0, 100.0, "%")?,
            RESISTANCE => self.connected.kilohms = number(0.0, 1000.0, "kilohms")?,
            WIRING => self.connected.wiring = word(name, value, &WIRES)?,
            TERMINALS => self.terminals = number(-60.0, 150.0, "degrees Celsius")?,
            TRANSFORMER => self.milliamperes = number(0.0, 60.0, "mA")?,
            ADDRESS => self.switches.address = contacts(255.0)?,
            RATE => self.switches.rate = contacts(15.0)?,
            KEY => self.key = flag(name, value)?,
            MEMORY => self.faults.memory = word(name, value, &MemoryFault::WORDS)?,
            MACHINE => self.faults.machine = flag(name, value)?,
            BUS => self.bus = word(name, value, &BusFault::WORDS)?,
            MODULE => {
                self.module = word(name, value, &Module::WORDS)?;
                self.faults.module = matches!(self.module, Module::Broken | Module::Faulty);
            }
            _ => return Err(BenchError::unknown(name)),
        }
        Ok(())
    }

    /// The value that was set.
    pub(crate) fn observe(&self, name: &str) -> Option<Value> {
        Some(match name {
            TEMPERATURE if self.in_process => Value::Text(PROCESS.to_owned()),
            TEMPERATURE => Value::Real(self.connected.celsius),
            VOLTAGE => Value::Real(self.connected.millivolts),
            CURRENT => Value::Real(self.connected.microamperes),
            WIPER => Value::Real(self.connected.percent),
            RESISTANCE => Value::Real(self.connected.kilohms),
            WIRING => said(&self.connected.wiring, &WIRES)?,
            TERMINALS => Value::Real(self.terminals),
            TRANSFORMER => Value::Real(self.milliamperes),
            ADDRESS => Value::Int(self.switches.address.into()),
            RATE => Value::Int(self.switches.rate.into()),
            KEY => Value::Int(self.key.into()),
            MEMORY => said(&self.faults.memory, &MemoryFault::WORDS)?,
            MACHINE => Value::Int(self.faults.machine.into()),
            BUS => said(&self.bus, &BusFault::WORDS)?,
            MODULE => said(&self.module, &Module::WORDS)?,
            _ => return None,
        })
    }

    /// The names of what can be set.
    pub(crate) fn names() -> impl Iterator<Item = &'static str> {
        NAMES.iter().copied()
    }
}

const TEMPERATURE: &str = "input-temperature-1";
/// The sensor is in the load, not in what a bench sets.
const PROCESS: &str = "process";
const VOLTAGE: &str = "input-voltage-1";
const CURRENT: &str = "input-current-1";
const WIPER: &str = "input-potentiometer-1";
const RESISTANCE: &str = "input-resistance-1";
const WIRING: &str = "input-wiring-1";
const TERMINALS: &str = "terminal-temperature";
const TRANSFORMER: &str = "transformer-current-1";
const ADDRESS: &str = "dip-switch-1";
const RATE: &str = "dip-switch-2";
const KEY: &str = "key";
const MEMORY: &str = "memory-fault";
const MACHINE: &str = "machine-fault";
const BUS: &str = "bus-fault";
const MODULE: &str = "module-1";

const NAMES: [&str; 15] = [
    TEMPERATURE,
    VOLTAGE,
    CURRENT,
    WIPER,
    RESISTANCE,
    WIRING,
    TERMINALS,
    TRANSFORMER,
    ADDRESS,
    RATE,
    KEY,
    MEMORY,
    MACHINE,
    BUS,
    MODULE,
];

const WIRES: [(&str, Wiring); 3] =
    [("connected", Wiring::Connected), ("broken", Wiring::Broken), ("shorted", Wiring::Shorted)];
#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_set_reads_back_and_has_bounds() {
        let text = |text: &str| Value::Text(text.to_owned());
        let mut surroundings = Surroundings::default();
        let table = [
            (TEMPERATURE, Value::Real(-399.5), text("warm")),
            (TEMPERATURE, text("process"), Value::Int(2501)),
            (VOLTAGE, Value::Real(7000.0), Value::Int(30_001)),
            (CURRENT, Value::Real(12_000.0), Value::Int(-5001)),
            (WIPER, Value::Real(40.0), Value::Int(101)),
            (RESISTANCE, Value::Real(4.7), Value::Int(-1)),
            (WIRING, text("shorted"), text("open")),
            (TERMINALS, Value::Real(60.0), Value::Int(151)),
            (TRANSFORMER, Value::Real(12.5), Value::Int(61)),
            (ADDRESS, Value::Int(255), Value::Int(256)),
            (RATE, Value::Int(15), Value::Int(16)),
            (KEY, Value::Int(1), Value::Int(2)),
            (MEMORY, text("service-data-b"), text("all")),
            (MACHINE, Value::Int(1), text("yes")),
            (BUS, text("error-passive"), text("off")),
            (MODULE, text("faulty"), text("gone")),
        ];
        for (name, value, wrong) in table {
            surroundings.set(name, &value).unwrap();
            assert_eq!(surroundings.observe(name), Some(value));
            assert!(surroundings.set(name, &wrong).is_err(), "{name}");
        }
        assert!(surroundings.set("wind", &Value::Int(1)).is_err());
        assert_eq!(surroundings.observe("wind"), None);
    }
}
