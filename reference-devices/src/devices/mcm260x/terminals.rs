//! The terminals, LEDs and the display of a module by their names.

use canopen::bench::Needs;
use canopen::{BenchError, Dictionary, Instant, Mux, Value};

use crate::devices::terminal;
use crate::stack::Behaviour;

use super::bench;
use super::indicators;
use super::inside::Inside;
use super::parameters::{FASTEST, Item, TEN_VOLTS, Table};
use super::{FLAGS, Mcm260x, TERMINAL_FLAGS};

impl Mcm260x {
    /// The names on this module.
    pub(super) fn names(&self) -> Vec<String> {
        let numbered = self
            .numbered()
            .into_iter()
            .flat_map(|(name, count)| (1..=count).map(move |number| format!("{name}{number}")));
        numbered.chain(self.single().map(str::to_owned)).collect()
    }

    /// An input for many sensors is delivered disabled: it has digits that are millivolts, and
    /// shows each of them at once, when it is set up like this.
    pub(super) fn needs(&self) -> Needs {
        let inputs = if self.is_universal() { self.inputs.len() } else { 0 };
        let setup = [
            (Item::SensorType, TEN_VOLTS),
            (Item::LowerLimit, 0),
            (Item::UpperLimit, 10_000),
            (Item::Filter, 1),
            (Item::Frequency, FASTEST),
            (Item::MaximumDifference, i64::from(i16::MAX)),
        ];
        let of_input = |place| {
            let objects = setup
                .iter()
                .filter_map(|(item, value)| Some((self.table.address(*item, place)?, *value)));
            (format!("{}{}", bench::FIELDS, place + 1), objects.collect())
        };
        (0..inputs).map(of_input).collect()
    }

    /// Whether this module has something of that name.
    pub(super) fn offers(&self, name: &str) -> bool {
        match terminal::split(name) {
            _ if Inside::NAMES.contains(&name) => true,
            Some((prefix, place)) => {
                self.numbered().iter().any(|(known, count)| *known == prefix && place < *count)
            }
            None => self.single().any(|known| known == name),
        }
    }

    /// The numbered names, and how many there are of each.
    fn numbered(&self) -> [(&'static str, usize); 20] {
        let counts = self.io.counts();
        let universal = if self.is_universal() { counts.analogue_inputs } else { 0 };
        let encoders = if counts.digital_inputs == 0 { 0 } else { self.encoders.len() };
        let with_z = (0..encoders).filter(|place| self.has_index(*place)).count();
        [
            (bench::DIGITAL_INPUTS, counts.digital_inputs),
            (bench::DIGITAL_OUTPUTS, counts.digital_outputs),
            (bench::GROUPS, self.groups()),
            (bench::FIELDS, counts.analogue_inputs),
            (bench::VOLTAGES, counts.analogue_inputs),
            (bench::CURRENTS, universal),
            (bench::TEMPERATURES, universal),
            (bench::WIPERS, universal),
            (bench::RESISTANCES, universal),
            (bench::WIRINGS, universal),
            (bench::ANALOGUE_OUTPUTS, counts.analogue_outputs),
            (bench::OUTPUT_VOLTAGES, counts.analogue_outputs),
            (bench::OUTPUT_CURRENTS, counts.analogue_outputs),
            (bench::STEPS, encoders),
            (bench::FREQUENCIES, encoders),
            (bench::INDICES, with_z),
            (bench::LINES, with_z),
            (bench::STATUS_LEDS, self.led_blocks()),
            (bench::INPUT_LEDS, universal),
            (bench::OUTPUT_LEDS, counts.analogue_outputs),
        ]
    }

    /// The names without a number.
    fn single(&self) -> impl Iterator<Item = &'static str> {
        let all = [bench::SUPPLY, bench::INTERFACE, bench::RUN_LED, bench::COM_LED, bench::DISPLAY];
        all.into_iter().chain(Inside::NAMES).chain(self.is_universal().then_some(bench::TERMINALS))
    }

    /// Takes a stimulus.
    ///
    /// # Errors
    /// When the module has none of that name, or it does not take the value.
    pub(super) fn set(
        &mut self,
        now: Instant,
        name: &str,
        value: &Value,
        od: &mut Dictionary,
    ) -> Result<(), BenchError> {
        if !self.offers(name) {
            return Err(BenchError::unknown(name));
        }
        let (prefix, place) = terminal::split(name).unwrap_or((name, 0));
        match prefix {
            bench::DIGITAL_INPUTS => return self.set_levels(now, name, value, od),
            bench::STEPS | bench::FREQUENCIES | bench::INDICES | bench::LINES => {
                self.turn(now, name, value)?;
                self.show_phases(now);
                return Ok(());
            }
            bench::DIGITAL_OUTPUTS
            | bench::ANALOGUE_OUTPUTS
            | bench::OUTPUT_VOLTAGES
            | bench::OUTPUT_CURRENTS
            | bench::STATUS_LEDS
            | bench::INPUT_LEDS
            | bench::OUTPUT_LEDS
            | bench::RUN_LED
            | bench::COM_LED
            | bench::DISPLAY => {
                return Err(BenchError(format!(
                    "{name} is what the device does, it cannot be set"
                )));
            }
            _ => {}
        }
        if let Some(input) = self.inputs.get_mut(place)
            && let Some(outcome) = input.connected.set(name, value)
        {
            outcome?;
            self.set_voltage(place);
            return Ok(());
        }
        if let Some(outcome) = self.inside.set(now, name, value) {
            return outcome;
        }
        self.surroundings.set(name, value)?;
        if name == bench::INTERFACE {
            self.chosen = Some(self.surroundings.interface);
            self.wants_restart = self.rules.choice_restarts();
        }
        Ok(())
    }

    /// The value seen on the bench: of a stimulus, the value that was set; of a terminal or an LED,
    /// its present state.
    pub(super) fn see(&self, name: &str, od: &Dictionary) -> Option<Value> {
        let int = |number: i64| Some(Value::Int(number.into()));
        let (prefix, place) = terminal::split(name).unwrap_or((name, 0));
        match prefix {
            bench::DIGITAL_INPUTS => self.io.observe(name, od),
            bench::DIGITAL_OUTPUTS => int(self.driven(place)),
            bench::ANALOGUE_OUTPUTS => int(self.given(place, od)),
            bench::OUTPUT_VOLTAGES => {
                let volts = self.powered && !self.is_current(place, od);
                int(if volts { (self.share(place, od) * 10_000.0).round() as i64 } else { 0 })
            }
            bench::OUTPUT_CURRENTS => {
                let current = self.powered && self.is_current(place, od);
                let microamperes = 4000.0 + self.share(place, od) * 16_000.0;
                int(if current { microamperes.round() as i64 } else { 0 })
            }
            bench::STATUS_LEDS => int(self.status_leds(place, od)),
            bench::INPUT_LEDS => int(self.input_leds.get(place)?.lit.into()),
            bench::OUTPUT_LEDS => {
                let active = self.rules.output_led(self.share(place, od) > 0.0);
                int((self.powered && active).into())
            }
            bench::RUN_LED => int(self.run_led.lit.into()),
            bench::COM_LED => int(self.com_led.lit.into()),
            bench::DISPLAY => {
                let [own, terminal] = [FLAGS, TERMINAL_FLAGS].map(|mux| od.int(mux).unwrap_or(0));
                let flags = if self.powered { own & 0xFFFF | terminal << 16 } else { 0 };
                Some(Value::Text(indicators::display(self.rules.displayed(flags))))
            }
            bench::STEPS | bench::FREQUENCIES | bench::INDICES | bench::LINES => {
                let motion = self.encoders.get(place)?.motion;
                match prefix {
                    bench::STEPS => int(motion.at(self.now)),
                    bench::FREQUENCIES => Some(Value::Real(motion.millihertz as f64 / 1000.0)),
                    bench::INDICES => int(motion.index_level.into()),
                    _ => int(motion.turn),
                }
            }
            _ => {
                let connected = self.inputs.get(place).map(|input| input.connected);
                connected
                    .and_then(|connected| connected.observe(name))
                    .or_else(|| self.inside.observe(name))
                    .or_else(|| self.surroundings.observe(name))
            }
        }
    }

    /// Moves the shaft of an encoder. Its motion until now has already been counted.
    fn turn(&mut self, now: Instant, name: &str, value: &Value) -> Result<(), BenchError> {
        let (prefix, place) = terminal::split(name).ok_or_else(|| BenchError::unknown(name))?;
        let unknown = || BenchError::unknown(name);
        let encoder = self.encoders.get_mut(place).ok_or_else(unknown)?;
        let setup = self.setups.get(place).ok_or_else(unknown)?;
        let setup = setup.counting(self.rules.counts_in(self.state));
        let whole = |low: i64, high: i64| {
            let number = value.as_int().and_then(|number| i64::try_from(number).ok());
            number.filter(|number| (low..=high).contains(number)).ok_or_else(|| {
                BenchError(format!("{name} is a whole number, {low} to {high}, not {value}"))
            })
        };
        match prefix {
            bench::STEPS => {
                encoder.motion.move_to(now, whole(i32::MIN.into(), i32::MAX.into())?);
                encoder.follow(now, setup, &self.rules);
            }
            bench::FREQUENCIES => {
                let lines =
                    terminal::number(name, value, (-100_000.0, 100_000.0), "lines a second")?;
                encoder.motion.turn_at(now, (lines * 1000.0).round() as i64);
            }
            bench::INDICES => {
                let level = terminal::flag(name, value)?;
                let rises = level && !encoder.motion.index_level;
                encoder.motion.index_level = level;
                if rises && encoder.motion.turn == 0 {
                    encoder.see_index(setup, &self.rules);
                }
            }
            _ => encoder.motion.turn = whole(0, 1_000_000)?,
        }
        Ok(())
    }

    /// Whether the analogue inputs take sensors of many kinds.
    fn is_universal(&self) -> bool {
        self.table != Table::Small
    }

    /// Whether an encoder has a terminal for phase Z (4.1).
    fn has_index(&self, place: usize) -> bool {
        self.table != Table::Small || self.phases(place).is_some_and(|phases| phases.z.is_some())
    }

    /// The blocks of LEDs for digital inputs and outputs (5.2).
    fn led_blocks(&self) -> usize {
        let counts = self.io.counts();
        match self.table {
            Table::Small => counts.digital_inputs + counts.digital_outputs,
            Table::Analogue | Table::Large => counts.digital_inputs.max(counts.digital_outputs),
        }
    }

    fn status_leds(&self, block: usize, od: &Dictionary) -> i64 {
        let inputs = self.io.counts().digital_inputs;
        let input = |block: usize| od.int(Mux::new(DIGITAL_INPUTS, block as u8 + 1)).unwrap_or(0);
        match self.table {
            _ if !self.powered => 0,
            Table::Small => {
                let blocks = inputs + self.io.counts().digital_outputs;
                let from_inputs = self.rules.inputs_come_first();
                let block = if from_inputs { block } else { (block + inputs) % blocks };
                match block.checked_sub(inputs) {
                    None => self.rules.level_leds(input(block), 0),
                    Some(output) => self.rules.level_leds(0, self.driven(output)),
                }
            }
            Table::Analogue | Table::Large => {
                self.rules.level_leds(input(block), self.driven(block))
            }
        }
    }

    fn is_current(&self, place: usize, od: &Dictionary) -> bool {
        self.parameters(od).value(Item::OutputType, place) == 1
    }

    /// The share of its range that an analogue output gives.
    fn share(&self, place: usize, od: &Dictionary) -> f64 {
        let (lower, upper) = self.limits(place, od);
        let digits = self.io.analogue_output(self.rules.output(place)).unwrap_or(0);
        self.rules.share(digits, lower, upper).clamp(0.0, 1.0)
    }

    /// The value that an analogue output gives, in digits.
    fn given(&self, place: usize, od: &Dictionary) -> i64 {
        let (lower, upper) = self.limits(place, od);
        (lower as f64 + self.share(place, od) * (upper - lower) as f64).round() as i64
    }

    pub(super) fn limits(&self, place: usize, od: &Dictionary) -> (i64, i64) {
        let value = |item| self.parameters(od).value(item, place);
        (value(Item::OutputLower), value(Item::OutputUpper))
    }
}

/// Read input, eight bits.
const DIGITAL_INPUTS: u16 = 0x6000;
