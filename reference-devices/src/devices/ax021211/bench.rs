//! The physical side: names, and what a bench may connect.

use canopen::{BenchError, Value};

use super::load::{Load, Wiring};
use super::network::{Network, OUTPUTS, Outside};
use super::rules::Ax021211Rules;
use crate::devices::terminal::{number, said, split, word};

/// All names, stimuli first.
pub(super) fn names() -> Vec<String> {
    let numbered = [RESISTANCES, INDUCTANCES, WIRINGS].into_iter().chain(SEEN);
    let numbered = numbered.flat_map(|prefix| (1..=OUTPUTS).map(move |n| format!("{prefix}{n}")));
    let states = (1..=2).map(|block| format!("{STATES}{block}"));
    let single = [SUPPLY, TEMPERATURE].map(str::to_owned);
    single.into_iter().chain(numbered).chain(states).collect()
}

/// Takes a stimulus.
///
/// # Errors
/// When there is none of that name, or it does not take the value.
pub(super) fn set(outside: &mut Outside, name: &str, value: &Value) -> Result<(), BenchError> {
    let number = |low, high, unit| number(name, value, (low, high), unit);
    match name {
        SUPPLY => outside.supply = number(0.0, 70.0, "V")?,
        TEMPERATURE => outside.temperature = number(-50.0, 150.0, "degrees Celsius")?,
        _ => {
            let known = split(name)
                .and_then(|(prefix, place)| Some((prefix, outside.loads.get_mut(place)?)));
            let (prefix, load) = known.ok_or_else(|| BenchError::unknown(name))?;
            match prefix {
                RESISTANCES => load.ohms = number(0.01, 1e6, "ohms")?,
                INDUCTANCES => load.millihenries = number(0.0, 1e4, "mH")?,
                WIRINGS => load.wiring = word(name, value, &WIRES)?,
                prefix if SEEN.contains(&prefix) => {
                    return Err(BenchError(format!("{name} cannot be set")));
                }
                _ => return Err(BenchError::unknown(name)),
            }
        }
    }
    Ok(())
}

/// The bench's view of an output while it has its supply.
pub(super) struct Sight<'a> {
    pub(super) outside: &'a Outside,
    pub(super) network: &'a Network,
    pub(super) rules: &'a Ax021211Rules,
    /// The frequencies in force, in hertz: of the pulses of each output, and of its dither.
    pub(super) pulses: [i64; OUTPUTS],
    pub(super) dithers: [i64; OUTPUTS],
    pub(super) powered: bool,
}

impl Sight<'_> {
    /// The present value; `None` when the name does not exist.
    pub(super) fn observe(&self, name: &str) -> Option<Value> {
        match name {
            SUPPLY => return Some(Value::Real(self.outside.supply)),
            TEMPERATURE => return Some(Value::Real(self.outside.temperature)),
            _ => {}
        }
        let (prefix, place) = split(name)?;
        if prefix == STATES {
            return (place < 2).then(|| Value::Int(self.states(place).into()));
        }
        let load = self.outside.loads.get(place)?;
        Some(match prefix {
            RESISTANCES => Value::Real(load.ohms),
            INDUCTANCES => Value::Real(load.millihenries),
            WIRINGS => said(&load.wiring, &WIRES)?,
            _ => Value::Int(self.output(prefix, place, load)?.into()),
        })
    }

    fn output(&self, prefix: &str, place: usize, load: &Load) -> Option<i64> {
        let settings = self.network.output(place);
        let view = self.network.view(place).filter(|_| self.powered);
        let driven = view.map(|view| view.driven).unwrap_or_default();
        let dithers = view.is_some_and(|view| view.dithers);
        let hertz = if dithers { self.dithers[place] } else { 0 };
        let seen = match prefix {
            CURRENTS => driven.milliamperes * 1000.0,
            VOLTAGES => driven.volts * 1000.0,
            DUTIES => driven.duty * 10_000.0,
            FREQUENCIES if self.powered => self.pulses[place] as f64,
            FREQUENCIES => 0.0,
            DITHERS if dithers => {
                1000.0 * load.dither(self.rules.dither(settings.dither), hertz as f64)
            }
            DITHERS => 0.0,
            DITHER_FREQUENCIES => hertz as f64,
            _ => return None,
        };
        Some(seen.round() as i64)
    }

    /// The driven states of a block of eight digital outputs.
    fn states(&self, block: usize) -> i64 {
        let drives = |place: &usize| {
            self.powered && self.network.view(*place).is_some_and(|view| view.drives_digital)
        };
        let outputs = 8 * block..OUTPUTS.min(8 * block + 8);
        outputs.filter(drives).map(|place| 1 << (place - 8 * block)).sum()
    }
}

const SUPPLY: &str = "supply-voltage";
const TEMPERATURE: &str = "board-temperature";
const RESISTANCES: &str = "load-resistance-";
const INDUCTANCES: &str = "load-inductance-";
const WIRINGS: &str = "load-wiring-";
const CURRENTS: &str = "output-current-";
const VOLTAGES: &str = "output-voltage-";
const DUTIES: &str = "output-duty-";
const FREQUENCIES: &str = "output-frequency-";
const DITHERS: &str = "dither-amplitude-";
const DITHER_FREQUENCIES: &str = "dither-frequency-";
const STATES: &str = "digital-outputs-";
/// The observable values of each output.
const SEEN: [&str; 6] = [CURRENTS, VOLTAGES, DUTIES, FREQUENCIES, DITHERS, DITHER_FREQUENCIES];

const WIRES: [(&str, Wiring); 3] =
    [("connected", Wiring::Connected), ("broken", Wiring::Broken), ("shorted", Wiring::Shorted)];
