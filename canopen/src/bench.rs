//! The physical side of a device: what a test bench sets there, and what it sees.

use std::collections::BTreeMap;
use std::fmt;

use crate::mux::Mux;
use crate::value::Value;

/// The stimulus that every simulated device has: the supply, `on` or `off`. A device that is off
/// sends nothing and hears nothing; switched on again, it knows what it stored.
pub const POWER: &str = "power";

/// The stimulus that chooses how a device with two interfaces communicates: `can` or `rs485`.
pub const INTERFACE: &str = "communication-interface";

/// A bench around a device: stimuli that can be set, and what can be observed, each by its name.
pub trait Bench {
    /// The names that can be set or observed.
    ///
    /// # Errors
    /// When the bench fails.
    fn names(&mut self) -> Result<Vec<String>, BenchError>;

    /// Sets a stimulus. It lasts until it is set again, regardless of the bus.
    ///
    /// # Errors
    /// When there is none of that name, it does not take the value, or the bench fails.
    fn set(&mut self, name: &str, value: &Value) -> Result<(), BenchError>;

    /// The present value; for a stimulus, the value that was set.
    ///
    /// # Errors
    /// When there is nothing of that name, or the bench fails.
    fn get(&mut self, name: &str) -> Result<Value, BenchError>;

    /// How a device must be set up for its stimuli to reach it.
    ///
    /// # Errors
    /// When the bench fails.
    fn needs(&mut self) -> Result<Needs, BenchError> {
        Ok(Needs::new())
    }
}

/// How a device must be set up for a stimulus to reach it, by the name of the stimulus: objects and
/// their values. A bench that connects 10 V to an input for many sensors knows which of them that
/// stands for.
pub type Needs = BTreeMap<String, BTreeMap<Mux, i64>>;

/// Whether suites ask for stimuli and observations of that name; the numbered ones end in a dash
/// and a number.
pub fn is_known(name: &str) -> bool {
    let numbered = |known: &str| name.strip_prefix(known).is_some_and(|n| n.parse::<u8>().is_ok());
    NAMES.iter().any(|known| if known.ends_with('-') { numbered(known) } else { *known == name })
}

/// The quantity that a stimulus moves as time passes: a frequency turns the shaft.
pub fn moved_by(name: &str) -> Option<String> {
    name.strip_prefix("encoder-frequency-").map(|shaft| format!("encoder-steps-{shaft}"))
}

/// The names that suites ask for. A number follows a name that ends in a dash.
pub const NAMES: &[&str] = &[
    POWER,
    "digital-inputs-",
    "digital-outputs-",
    "analogue-input-",
    "analogue-output-",
    "output-fault",
    "input-fault",
    "main-line-temperature",
    "return-line-temperature",
    "external-temperature",
    "external-sensor",
    "flow",
    "intake-pressure",
    "medium-level",
    "mould-contents",
    "safety-limiter",
    "machine-fault",
    "heater",
    "cooler",
    "pump",
    "supply-voltage",
    "output-supply-",
    INTERFACE,
    "encoder-steps-",
    "encoder-frequency-",
    "encoder-index-",
    "encoder-lines-",
    "input-voltage-",
    "input-current-",
    "input-temperature-",
    "input-potentiometer-",
    "input-resistance-",
    "input-wiring-",
    "terminal-temperature",
    "output-voltage-",
    "output-current-",
    "output-duty-",
    "output-frequency-",
    "dither-amplitude-",
    "dither-frequency-",
    "load-resistance-",
    "load-inductance-",
    "load-wiring-",
    "board-temperature",
    "status-leds-",
    "input-led-",
    "output-led-",
    "run-led",
    "com-led",
    "display",
    "transformer-current-",
    "dip-switch-",
    "key",
    "memory-fault",
    "terminal-fault",
    "bus-fault",
    "module-",
];

/// Why a bench could not do what it was asked for, in one sentence. Says nothing about the device.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BenchError(pub String);

impl BenchError {
    /// Nothing has that name.
    pub fn unknown(name: &str) -> Self {
        Self(format!("the bench has no `{name}`"))
    }
}

impl fmt::Display for BenchError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for BenchError {}
