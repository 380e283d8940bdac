//! The I/O block of CiA 401: digital and analogue inputs and outputs on terminals, which a bench
//! can observe and set.
//!
//! The dictionary determines the channels: an array 6000h of two entries makes two blocks of eight
//! digital inputs, 6100h blocks of sixteen. Each width has terminals of its own. The channels in
//! floating point (6403h, 6413h) and of the manufacturer (6404h, 6414h) are not modelled.

mod channel;
mod inputs;
mod outputs;
mod rules;
mod setting;
#[cfg(test)]
mod tests;

use canopen::eds::Eds;
use canopen::{BenchError, Dictionary, Instant, Mux, Value};
use std::sync::Arc;

use crate::stack::{Behaviour, CommunicationEvent, Errors, earlier};

use channel::{Channel, Kind};
use inputs::{AnalogueInput, DigitalInput};
use outputs::Output;

pub(crate) use rules::{Cia401Decision, Cia401Rules};
pub(crate) use setting::{EVERY_LEVEL, Setting};

/// The inputs and outputs of a device. It is a complete application for a device that has nothing
/// else.
#[derive(Clone)]
pub(crate) struct IoBlock {
    rules: Arc<Cia401Rules>,
    digital_inputs: Vec<DigitalInput>,
    analogue_inputs: Vec<AnalogueInput>,
    digital_outputs: Vec<Output>,
    analogue_outputs: Vec<Output>,
    /// The analogue inputs that transmitted since their bank of 6422h was read, a bit each.
    sources: Vec<u32>,
    /// Whether a failure has set the outputs.
    failed: bool,
    /// How many changes the dictionary had when a run would have found nothing more to do; `None`
    /// after anything else that a run has to do with.
    settled: Option<u64>,
}

impl IoBlock {
    /// The block of a device with this data sheet, which decides in this manner.
    pub(crate) fn new(eds: &Eds, rules: Cia401Rules) -> Self {
        let channels = |kind| {
            let values = eds.entries().map(|entry| entry.mux);
            values.filter_map(Channel::at).filter(move |channel| channel.kind == kind)
        };
        let banks = eds.entries().filter(|entry| is_source(entry.mux)).count();
        Self {
            rules: Arc::new(rules),
            digital_inputs: channels(Kind::DigitalInput).map(DigitalInput::new).collect(),
            analogue_inputs: channels(Kind::AnalogueInput).map(AnalogueInput::new).collect(),
            digital_outputs: channels(Kind::DigitalOutput).map(Output::new).collect(),
            analogue_outputs: channels(Kind::AnalogueOutput).map(Output::new).collect(),
            sources: vec![0; banks],
            failed: false,
            settled: None,
        }
    }

    /// Puts a field value on an analogue input, counted from 0, and converts it into its object.
    pub(crate) fn measure(&mut self, place: usize, field: i64, od: &mut Dictionary) {
        if let Some(input) = self.analogue_inputs.get_mut(place) {
            input.field = field;
            input.convert(od, &self.rules);
        }
    }

    /// Lets the terminals of the outputs follow the objects.
    pub(crate) fn drive(&mut self, od: &Dictionary) {
        for output in self.digital_outputs.iter_mut().chain(&mut self.analogue_outputs) {
            output.drive(od, &self.rules);
        }
    }

    /// The levels at the terminals of a block of digital outputs, counted from 0.
    pub(crate) fn digital_output(&self, place: usize) -> i64 {
        self.digital_outputs.get(place).map_or(0, |output| output.terminal)
    }

    /// The value at the terminal of an analogue output, counted from 0; `None` if there is none.
    pub(crate) fn analogue_output(&self, place: usize) -> Option<i64> {
        self.analogue_outputs.get(place).map(|output| output.terminal)
    }

    /// The levels at the terminals of a block of digital inputs, counted from 0.
    pub(crate) fn digital_input(&self, place: usize) -> i64 {
        self.digital_inputs.get(place).map_or(0, |block| block.terminals)
    }

    /// Puts levels at the terminals of a block of digital inputs, counted from 0.
    pub(crate) fn put_digital_input(&mut self, place: usize, levels: i64) {
        if let Some(block) = self.digital_inputs.get_mut(place) {
            block.terminals = levels & block.channel.mask();
            self.settled = None;
        }
    }

    /// Drives terminals of a block of digital inputs, counted from 0, high from inside, for a
    /// device of which they are outputs as well.
    pub(crate) fn drive_inputs(&mut self, place: usize, levels: i64) {
        if let Some(input) = self.digital_inputs.get_mut(place) {
            let driven = levels & input.channel.mask();
            if std::mem::replace(&mut input.driven, driven) != driven {
                self.settled = None;
            }
        }
    }

    /// How many channels there are: digital inputs and outputs in blocks, analogue ones.
    pub(crate) const fn counts(&self) -> Counts {
        Counts {
            digital_inputs: self.digital_inputs.len(),
            digital_outputs: self.digital_outputs.len(),
            analogue_inputs: self.analogue_inputs.len(),
            analogue_outputs: self.analogue_outputs.len(),
        }
    }

    fn outputs(&mut self) -> impl Iterator<Item = &mut Output> {
        self.digital_outputs.iter_mut().chain(&mut self.analogue_outputs)
    }

    fn show_sources(&self, od: &mut Dictionary) {
        for (sources, sub) in self.sources.iter().zip(1..) {
            od.set_int(Mux::new(SOURCE, sub), i64::from(*sources));
        }
    }
}

impl Behaviour for IoBlock {
    fn reset(&mut self, _now: Instant, _od: &mut Dictionary) {
        self.settled = None;
        self.sources.fill(0);
        self.digital_inputs.iter_mut().for_each(DigitalInput::restart);
        self.outputs().for_each(Output::restart);
    }

    fn supply_lost(&mut self) {
        self.settled = None;
        self.outputs().for_each(Output::restart);
    }

    fn written(&mut self, _now: Instant, mux: Mux, od: &mut Dictionary) {
        if self.rules.follows_after_failure() {
            let value = od.int(mux).unwrap_or(0);
            for output in self.digital_outputs.iter_mut().chain(&mut self.analogue_outputs) {
                let ends = || !output.followed(value) || self.rules.same_value_ends_failure();
                if output.is_at(mux) && ends() {
                    output.recover();
                    // A write may repeat the old value.
                    self.settled = None;
                }
            }
        }
    }

    fn uploaded(&mut self, mux: Mux, od: &mut Dictionary) {
        if self.rules.upload_clears_sources(mux) {
            self.sources.fill(0);
            self.show_sources(od);
        }
        if is_source(mux)
            && let Some(bank) = self.sources.get_mut(usize::from(mux.sub) - 1)
            && self.rules.reading_clears_source()
        {
            *bank = 0;
            od.set_int(mux, 0);
        }
    }

    fn event(&mut self, _now: Instant, event: CommunicationEvent, od: &mut Dictionary) {
        self.settled = None;
        if self.rules.fails(event) {
            if std::mem::replace(&mut self.failed, true) && !self.rules.fails_again() {
                return;
            }
            // Values written since the last run are among the levels that an output keeps.
            self.drive(od);
            for output in self.digital_outputs.iter_mut().chain(&mut self.analogue_outputs) {
                output.fail(od, &self.rules);
            }
        } else if self.rules.recovers(event) {
            self.outputs().for_each(Output::recover);
        }
    }

    fn run(&mut self, now: Instant, od: &mut Dictionary, _errors: &mut Errors) {
        if self.settled.is_some_and(|then| !has_changed_since(then, od)) {
            self.settled = Some(od.changes());
            return;
        }
        for input in &mut self.digital_inputs {
            input.sample(now, od, &self.rules);
        }
        for input in &self.analogue_inputs {
            input.convert(od, &self.rules);
        }
        self.drive(od);
        self.show_sources(od);
        let waits = self.poll_at().is_some();
        self.settled = (!waits).then(|| od.changes());
    }

    fn poll_at(&self) -> Option<Instant> {
        self.digital_inputs.iter().map(DigitalInput::poll_at).fold(None, earlier)
    }

    fn bench_names(&self) -> Vec<String> {
        let counts = [
            (DIGITAL_INPUTS, self.digital_inputs.len()),
            (ANALOGUE_INPUTS, self.analogue_inputs.len()),
            (DIGITAL_OUTPUTS, self.digital_outputs.len()),
            (ANALOGUE_OUTPUTS, self.analogue_outputs.len()),
        ];
        let numbered = |(name, count)| (1..=count).map(move |number| format!("{name}{number}"));
        counts.into_iter().flat_map(numbered).collect()
    }

    fn stimulate(
        &mut self,
        _now: Instant,
        name: &str,
        value: &Value,
        _od: &mut Dictionary,
    ) -> Result<(), BenchError> {
        self.settled = None;
        let number = value.as_int().and_then(|number| i64::try_from(number).ok());
        let block = place(name, DIGITAL_INPUTS);
        let field = place(name, ANALOGUE_INPUTS);
        if let Some(block) = block.and_then(|place| self.digital_inputs.get_mut(place)) {
            block.terminals = block.channel.levels(number).ok_or_else(|| {
                let (bits, highest) = (block.channel.bits, block.channel.mask());
                BenchError(format!("{name} is {bits} levels, 0 to {highest}, not {value}"))
            })?;
        } else if let Some(input) = field.and_then(|place| self.analogue_inputs.get_mut(place)) {
            input.field = input.channel.field(number).ok_or_else(|| {
                let bits = input.channel.bits;
                BenchError(format!("{name} is a field value of {bits} bits, not {value}"))
            })?;
        } else {
            return Err(BenchError::unknown(name));
        }
        Ok(())
    }

    fn observe(&self, name: &str, _od: &Dictionary) -> Option<Value> {
        let seen = if let Some(place) = place(name, DIGITAL_INPUTS) {
            self.digital_inputs.get(place).map(|block| block.terminals)
        } else if let Some(place) = place(name, ANALOGUE_INPUTS) {
            self.analogue_inputs.get(place).map(|input| input.field)
        } else if let Some(place) = place(name, DIGITAL_OUTPUTS) {
            self.digital_outputs.get(place).map(|output| output.terminal)
        } else {
            self.analogue_outputs.get(place(name, ANALOGUE_OUTPUTS)?).map(|output| output.terminal)
        };
        seen.map(|number| Value::Int(number.into()))
    }

    fn has_edges(&self, mux: Mux) -> bool {
        Channel::at(mux).is_some_and(|channel| channel.kind == Kind::DigitalInput)
    }

    fn holds_back(&self, mux: Mux, od: &Dictionary) -> bool {
        let input = Channel::at(mux).filter(|channel| channel.kind == Kind::AnalogueInput);
        let enabled = |channel: Channel| {
            channel.setting(Setting::AnalogueInterruptEnable, od, &self.rules) != 0
        };
        input.is_some_and(|channel| !enabled(channel))
    }

    fn triggers(&mut self, mux: Mux, last: &[u8], od: &Dictionary) -> bool {
        let Some(channel) = Channel::at(mux) else { return true };
        let last = od.entry(mux).and_then(|entry| entry.data_type.decode_int(last));
        let (Some(last), Some(now)) = (last, od.int(mux)) else { return true };
        match channel.kind {
            Kind::DigitalInput => inputs::edge(channel, last, now, od, &self.rules),
            Kind::AnalogueInput => {
                let event = inputs::threshold(channel, last, now, od, &self.rules);
                let (bank, bit) = (usize::from(mux.sub - 1) / 32, (mux.sub - 1) % 32);
                if event && let Some(bank) = self.sources.get_mut(bank) {
                    *bank |= 1 << bit;
                    self.settled = None;
                }
                event
            }
            Kind::DigitalOutput | Kind::AnalogueOutput => true,
        }
    }
}

/// How many channels of each kind a block has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Counts {
    /// Blocks of digital inputs.
    pub(crate) digital_inputs: usize,
    /// Blocks of digital outputs.
    pub(crate) digital_outputs: usize,
    /// Analogue inputs.
    pub(crate) analogue_inputs: usize,
    /// Analogue outputs.
    pub(crate) analogue_outputs: usize,
}

/// The place of what is called `prefix` and a number from 1 on.
fn place(name: &str, prefix: &str) -> Option<usize> {
    name.strip_prefix(prefix)?.parse::<usize>().ok()?.checked_sub(1)
}

/// Whether a value of the application has changed since [`Dictionary::changes`] was `count`.
fn has_changed_since(count: u64, od: &Dictionary) -> bool {
    let mut changed = od.changed_since(count);
    changed.as_mut().is_none_or(|changed| changed.any(|mux| mux.index >= APPLICATION))
}

/// Whether the value is a bank of 32 interrupt sources.
const fn is_source(mux: Mux) -> bool {
    mux.index == SOURCE && mux.sub > 0
}

const DIGITAL_INPUTS: &str = "digital-inputs-";
const ANALOGUE_INPUTS: &str = "analogue-input-";
const DIGITAL_OUTPUTS: &str = "digital-outputs-";
const ANALOGUE_OUTPUTS: &str = "analogue-output-";

/// The first index that is not of the communication profile.
const APPLICATION: u16 = 0x2000;
/// Analogue input interrupt source.
const SOURCE: u16 = 0x6422;
