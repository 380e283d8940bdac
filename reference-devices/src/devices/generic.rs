//! What the generic device does: the small application that lets every service be tried.
//!
//! The inputs and outputs of CiA 401 stand on simulated terminals, which a bench can see and turn.
//! Outputs take their error values when the node is stopped or a communication error appears, and
//! follow the network again when a value is written or the node is started. The manufacturer area
//! makes visible what no profile has an object for: a value that is refused because of the state
//! of the device (2F04h), an abort code of the application (2F05h) and errors that appear and go
//! on demand (2F40h). Everything else in the data sheet is the business of the stack.

mod inputs;
mod outputs;
mod rules;
mod sdo_client;

use canopen::emcy::EmcyCode;
use canopen::{Abort, BenchError, Dictionary, Instant, Mux, NmtState, Value};

use crate::stack::{Behaviour, Errors, Event, SdoJob, earlier};

use inputs::{ANALOGUE_INPUT, DigitalBlock};
use outputs::{ANALOGUE_OUTPUT, DIGITAL_OUTPUT, Output};
use sdo_client::ClientRecord;

pub(crate) use rules::{GenericRules, Profile, named, names};

/// The application of the generic device.
pub(crate) struct Generic {
    rules: Box<dyn GenericRules>,
    state: NmtState,
    /// The codes of the simulated errors that are present.
    simulated: [i64; SIMULATED],
    digital_inputs: [DigitalBlock; 2],
    /// Field values.
    analogue_inputs: [i64; 4],
    /// The analogue inputs that transmitted since 6422h was read, a bit each.
    source: u32,
    digital_outputs: [Output; 2],
    analogue_outputs: [Output; 2],
    client: ClientRecord,
    faults: [Fault; 2],
}

/// A terminal of one kind that can break.
#[derive(Clone, Copy, Debug)]
struct Fault {
    name: &'static str,
    code: EmcyCode,
    /// Its class in 1029h.
    class: u8,
    wanted: bool,
    present: bool,
}

impl Generic {
    /// A device that decides in this manner.
    pub(crate) fn new(rules: Box<dyn GenericRules>) -> Self {
        Self {
            rules,
            state: NmtState::INITIALISING,
            simulated: [0; SIMULATED],
            digital_inputs: Default::default(),
            analogue_inputs: [0; 4],
            source: 0,
            digital_outputs: Default::default(),
            analogue_outputs: Default::default(),
            client: ClientRecord::default(),
            faults: [
                Fault::new("output-fault", EmcyCode(0x2300), 2),
                Fault::new("input-fault", EmcyCode(0x2100), 3),
            ],
        }
    }

    fn sample(&mut self, now: Instant, od: &mut Dictionary) {
        for (block, sub) in self.digital_inputs.iter_mut().zip(1..) {
            block.sample(now, sub, od, &*self.rules);
        }
        for (field, sub) in self.analogue_inputs.iter().zip(1..) {
            inputs::convert(*field, sub, od, &*self.rules);
        }
    }

    fn drive(&mut self, od: &Dictionary) {
        for (output, sub) in self.digital_outputs.iter_mut().zip(1..) {
            output.drive_digital(sub, od, &*self.rules);
        }
        for (output, sub) in self.analogue_outputs.iter_mut().zip(1..) {
            output.drive_analogue(sub, od, &*self.rules);
        }
    }

    /// What the outputs do when the network cannot be relied upon.
    fn fail(&mut self, od: &Dictionary) {
        for (output, sub) in self.digital_outputs.iter_mut().zip(1..) {
            output.fail_digital(sub, od, &*self.rules);
        }
        for (output, sub) in self.analogue_outputs.iter_mut().zip(1..) {
            output.fail_analogue(sub, od, &*self.rules);
        }
    }

    fn outputs(&mut self) -> impl Iterator<Item = &mut Output> {
        self.digital_outputs.iter_mut().chain(&mut self.analogue_outputs)
    }

    /// Lets the errors appear and go that 2F40h asks for.
    fn simulate(&mut self, od: &Dictionary, errors: &mut Errors) {
        for (present, sub) in self.simulated.iter_mut().zip(1u8..) {
            let wanted = value(od, Mux::new(SIMULATED_ERROR, sub));
            if *present == wanted {
                continue;
            }
            if *present != 0 {
                errors.clear(sub.into());
            }
            if wanted != 0 {
                let code = EmcyCode(wanted as u16);
                errors.raise(sub.into(), code, register_bit(code), [sub, 0, 0, 0, 0]);
            }
            *present = wanted;
        }
    }
}

impl Behaviour for Generic {
    fn reset(&mut self, _now: Instant, _od: &mut Dictionary) {
        self.simulated = [0; SIMULATED];
        self.faults.iter_mut().for_each(|fault| fault.present = false);
        self.source = 0;
        self.digital_inputs.iter_mut().for_each(DigitalBlock::restart);
        self.outputs().for_each(|output| *output = Output::default());
    }

    fn check(&self, mux: Mux, bytes: &[u8], od: &Dictionary) -> Result<(), Abort> {
        match (mux, bytes) {
            (PARAMETER, _) => self.rules.parameter_change(value(od, MODE)),
            (REFUSED_WITH, &[a, b, c, d]) => match u32::from_le_bytes([a, b, c, d]) {
                0 => Ok(()),
                code => Err(Abort(code)),
            },
            _ => ClientRecord::check(mux, od),
        }
    }

    fn sdo_job(&mut self) -> Option<SdoJob> {
        self.client.take_job()
    }

    fn sdo_done(
        &mut self,
        _now: Instant,
        _client: u8,
        result: Result<Vec<u8>, Abort>,
        od: &mut Dictionary,
    ) {
        ClientRecord::done(result, od);
    }

    fn written(&mut self, _now: Instant, mux: Mux, od: &mut Dictionary) {
        self.client.written(mux, od);
        let place = usize::from(mux.sub.saturating_sub(1));
        let output = match mux.index {
            DIGITAL_OUTPUT => self.digital_outputs.get_mut(place),
            ANALOGUE_OUTPUT => self.analogue_outputs.get_mut(place),
            _ => None,
        };
        if let Some(output) = output.filter(|_| self.rules.follows_after_failure()) {
            output.failed = false;
        }
    }

    fn uploaded(&mut self, mux: Mux, od: &mut Dictionary) {
        if mux == SOURCE && self.rules.reading_clears_source() {
            self.source = 0;
            od.set_int(SOURCE, 0);
        }
    }

    fn event(&mut self, _now: Instant, event: Event, od: &mut Dictionary) {
        if let Event::Entered(state) = event {
            self.state = state;
        }
        if self.rules.fails(event) {
            self.fail(od);
        } else if event == Event::Entered(NmtState::OPERATIONAL) {
            self.outputs().for_each(|output| output.failed = false);
        }
    }

    fn run(&mut self, now: Instant, od: &mut Dictionary, errors: &mut Errors) {
        self.sample(now, od);
        self.drive(od);
        self.simulate(od, errors);
        self.faults.iter_mut().for_each(|fault| fault.show(errors));
        let faulty = i64::from(errors.register() != 0);
        let running = i64::from(self.state == NmtState::OPERATIONAL);
        od.set_int(SOURCE, self.source.into());
        od.set_int(STATUS, faulty | running << 1);
    }

    fn poll_at(&self) -> Option<Instant> {
        self.digital_inputs.iter().map(DigitalBlock::poll_at).fold(None, earlier)
    }

    fn bench_names(&self) -> Vec<String> {
        let counts = [
            (DIGITAL_INPUTS, self.digital_inputs.len()),
            (ANALOGUE_INPUTS, self.analogue_inputs.len()),
            (DIGITAL_OUTPUTS, self.digital_outputs.len()),
            (ANALOGUE_OUTPUTS, self.analogue_outputs.len()),
        ];
        let numbered = |(name, count)| (1..=count).map(move |number| format!("{name}{number}"));
        let faults = self.faults.iter().map(|fault| fault.name.to_owned());
        counts.into_iter().flat_map(numbered).chain(faults).collect()
    }

    fn stimulate(
        &mut self,
        _now: Instant,
        name: &str,
        value: &Value,
        _od: &mut Dictionary,
    ) -> Result<(), BenchError> {
        let number = value.as_int();
        let block = place(name, DIGITAL_INPUTS);
        let field = place(name, ANALOGUE_INPUTS);
        if let Some(block) = block.and_then(|place| self.digital_inputs.get_mut(place)) {
            let levels = number.and_then(|levels| u8::try_from(levels).ok());
            let wrong = || BenchError(format!("{name} is eight levels, 0 to 255, not {value}"));
            block.terminals = levels.ok_or_else(wrong)?;
        } else if let Some(field) = field.and_then(|place| self.analogue_inputs.get_mut(place)) {
            let wrong = || BenchError(format!("{name} is a field value of 16 bits, not {value}"));
            let number = number.and_then(|number| i16::try_from(number).ok());
            *field = number.ok_or_else(wrong)?.into();
        } else if let Some(fault) = self.faults.iter_mut().find(|fault| fault.name == name) {
            let wrong = || BenchError(format!("{name} is 0 or 1, not {value}"));
            let number = number.filter(|number| matches!(number, 0 | 1));
            fault.wanted = number.ok_or_else(wrong)? == 1;
        } else {
            return Err(BenchError::unknown(name));
        }
        Ok(())
    }

    fn observe(&self, name: &str, _od: &Dictionary) -> Option<Value> {
        let seen = if let Some(place) = place(name, DIGITAL_INPUTS) {
            self.digital_inputs.get(place).map(|block| block.terminals.into())
        } else if let Some(place) = place(name, ANALOGUE_INPUTS) {
            self.analogue_inputs.get(place).copied()
        } else if let Some(place) = place(name, DIGITAL_OUTPUTS) {
            self.digital_outputs.get(place).map(|output| output.terminal)
        } else if let Some(fault) = self.faults.iter().find(|fault| fault.name == name) {
            Some(fault.wanted.into())
        } else {
            self.analogue_outputs.get(place(name, ANALOGUE_OUTPUTS)?).map(|output| output.terminal)
        };
        seen.map(|number: i64| Value::Int(number.into()))
    }

    fn triggers(&mut self, mux: Mux, last: &[u8], od: &Dictionary) -> bool {
        let event = inputs::triggers(mux, last, od, &*self.rules);
        if event && mux.index == ANALOGUE_INPUT {
            self.source |= 1 << mux.sub.saturating_sub(1);
        }
        event
    }
}

impl Fault {
    const fn new(name: &'static str, code: EmcyCode, class: u8) -> Self {
        Self { name, code, class, wanted: false, present: false }
    }

    /// Lets the error appear or go.
    fn show(&mut self, errors: &mut Errors) {
        if self.present == self.wanted {
            return;
        }
        self.present = self.wanted;
        let number = FAULTS + u16::from(self.class);
        if self.present {
            errors.raise(number, self.code, register_bit(self.code), [0; 5]);
            errors.react(self.class);
        } else {
            errors.clear(number);
        }
    }
}

/// The place of what is called `prefix` and a number from 1 on.
fn place(name: &str, prefix: &str) -> Option<usize> {
    name.strip_prefix(prefix)?.parse::<usize>().ok()?.checked_sub(1)
}

/// The bit of 1001h for errors of this class (CiA 301, 7.2.7.1 and 7.5.2.2).
const fn register_bit(code: EmcyCode) -> u8 {
    match code.0 >> 12 {
        0x2 => 1 << 1,
        0x3 => 1 << 2,
        0x4 => 1 << 3,
        0x8 => 1 << 4,
        0xF => 1 << 7,
        _ => 1 << 0,
    }
}

/// The whole number at `mux`; 0 for what the data sheet does not have.
fn value(od: &Dictionary, mux: Mux) -> i64 {
    od.int(mux).unwrap_or(0)
}

const DIGITAL_INPUTS: &str = "digital-inputs-";
const ANALOGUE_INPUTS: &str = "analogue-input-";
const DIGITAL_OUTPUTS: &str = "digital-outputs-";
const ANALOGUE_OUTPUTS: &str = "analogue-output-";

/// Which analogue inputs transmitted.
const SOURCE: Mux = Mux::new(0x6422, 1);
/// Manufacturer status register.
const STATUS: Mux = Mux::new(0x1002, 0);
/// Whether the device is controlled from its own panel.
const MODE: Mux = Mux::new(0x2F04, 1);
/// What does not change then.
const PARAMETER: Mux = Mux::new(0x2F04, 2);
/// Takes an abort code and answers with it.
const REFUSED_WITH: Mux = Mux::new(0x2F05, 0);
/// The codes of errors that are to be present.
const SIMULATED_ERROR: u16 = 0x2F40;
const SIMULATED: usize = 4;
/// Where the numbers of broken terminals begin, behind those of simulated errors.
const FAULTS: u16 = 0x100;

#[cfg(test)]
mod tests {
    use canopen::Device;

    use super::*;
    use crate::devices;
    use crate::stack::testing::{Rig, mux};

    fn rig() -> Rig {
        let device = devices::device("generic").unwrap();
        let mut rig = Rig::with(
            &device.description.eds,
            device.settings(),
            Box::new(crate::rules::Specification),
            device.behaviour(),
        );
        rig.run_to(10_000);
        rig
    }

    #[test]
    fn the_panel_keeps_the_network_from_the_parameter() {
        let mut rig = rig();
        let parameter = mux(0x2F04, 2);
        for (mode, answer) in
            [(1, Err(Abort::LOCAL_CONTROL.0)), (2, Err(Abort::DEVICE_STATE.0)), (0, Ok(()))]
        {
            rig.write(mux(0x2F04, 1), &[mode]).unwrap();
            assert_eq!(rig.write(parameter, &[7, 0]), answer);
        }
        assert_eq!(rig.read(parameter), Ok(vec![7, 0]));
    }

    #[test]
    fn a_code_of_the_application_comes_back() {
        let mut rig = rig();
        assert_eq!(rig.write(mux(0x2F05, 0), &[1, 2, 3, 4]), Err(0x0403_0201));
        assert_eq!(rig.write(mux(0x2F05, 0), &[0; 4]), Ok(()));
    }

    fn set(rig: &mut Rig, name: &str, number: i128) {
        let mut out = canopen::Outbox::default();
        rig.node.stimulate(rig.now, name, &Value::Int(number), &mut out).unwrap();
        while let Some(frame) = out.pop() {
            rig.note(&frame.to_string());
        }
    }

    fn seen(rig: &Rig, name: &str) -> i128 {
        rig.node.observe(name).and_then(|value| value.as_int()).unwrap()
    }

    #[test]
    fn digital_inputs_have_a_filter_and_a_polarity() {
        let mut rig = rig();
        set(&mut rig, "digital-inputs-1", 0x05);
        assert_eq!(rig.read(mux(0x6000, 1)), Ok(vec![0x05]));
        rig.write(mux(0x6002, 1), &[0x0F]).unwrap();
        assert_eq!(rig.read(mux(0x6000, 1)), Ok(vec![0x0A]));
        rig.write(mux(0x6002, 1), &[0]).unwrap();
        rig.write(mux(0x6003, 1), &[0x04]).unwrap();
        set(&mut rig, "digital-inputs-1", 0);
        assert_eq!(rig.read(mux(0x6000, 1)), Ok(vec![0x04]));
        rig.run_to(rig.now.0 / 1000 + 60_000);
        assert_eq!(rig.read(mux(0x6000, 1)), Ok(vec![0]));
        set(&mut rig, "digital-inputs-1", 0x04);
        rig.run_to(rig.now.0 / 1000 + 59_000);
        set(&mut rig, "digital-inputs-1", 0);
        rig.run_to(rig.now.0 / 1000 + 100_000);
        assert_eq!(rig.read(mux(0x6000, 1)), Ok(vec![0]));
    }

    #[test]
    fn the_masks_choose_the_edges_that_are_events() {
        let table: [([u8; 3], [u8; 2], bool); 6] = [
            ([0xFF, 0, 0], [0, 1], true),
            ([0, 0, 0], [0, 1], false),
            ([0, 1, 0], [0, 1], true),
            ([0, 1, 0], [1, 0], false),
            ([0, 0, 1], [1, 0], true),
            ([0, 0, 1], [0, 1], false),
        ];
        for (masks, [before, after], event) in table {
            let mut rig = rig();
            for (index, mask) in (0x6006..).zip(masks) {
                rig.write(mux(index, 1), &[mask]).unwrap();
            }
            set(&mut rig, "digital-inputs-1", before.into());
            rig.send("000#0105");
            rig.until(rig.now.0 / 1000);
            set(&mut rig, "digital-inputs-1", after.into());
            let now = rig.now.0 / 1000;
            assert_eq!(!rig.until(now).is_empty(), event, "{masks:?} {before} {after}");
        }
    }

    #[test]
    fn analogue_inputs_are_scaled_and_trigger_when_released() {
        let mut rig = rig();
        rig.write(mux(0x6432, 1), &[3, 0, 0, 0]).unwrap();
        rig.write(mux(0x6431, 1), &[7, 0, 0, 0]).unwrap();
        set(&mut rig, "analogue-input-1", -100);
        assert_eq!(rig.read(mux(0x6401, 1)), Ok((-293i16).to_le_bytes().to_vec()));
        set(&mut rig, "analogue-input-1", 32000);
        assert_eq!(rig.read(mux(0x6401, 1)), Ok(i16::MAX.to_le_bytes().to_vec()));
        set(&mut rig, "analogue-input-1", 100);
        rig.write(mux(0x6421, 1), &[4]).unwrap();
        rig.write(mux(0x6426, 1), &[9, 0, 0, 0]).unwrap();
        rig.send("000#0105");
        let mut told = |released: u8, field| {
            rig.write(mux(0x6423, 0), &[released]).unwrap();
            let now = rig.now.0 / 1000;
            rig.until(now);
            set(&mut rig, "analogue-input-1", field);
            rig.until(now).len()
        };
        assert_eq!((told(0, 200), told(1, 100), told(1, 102), told(1, 110)), (0, 1, 0, 1));
        assert_eq!(rig.read(mux(0x6422, 1)), Ok(vec![1, 0, 0, 0]));
        rig.send("123#");
        assert_eq!(rig.read(mux(0x6422, 1)), Ok(vec![0; 4]));
    }

    #[test]
    fn outputs_follow_the_network_until_it_fails() {
        let mut rig = rig();
        rig.write(mux(0x6202, 1), &[0x0F]).unwrap();
        rig.write(mux(0x6200, 1), &[0x3C]).unwrap();
        assert_eq!(seen(&rig, "digital-outputs-1"), 0x33);
        rig.write(mux(0x6208, 1), &[0xF0]).unwrap();
        rig.write(mux(0x6200, 1), &[0xFF]).unwrap();
        assert_eq!(seen(&rig, "digital-outputs-1"), 0xF3);
        rig.write(mux(0x6206, 1), &[0x81]).unwrap();
        rig.write(mux(0x6207, 1), &[0x0E]).unwrap();
        rig.write(mux(0x6411, 1), &[10, 0]).unwrap();
        rig.write(mux(0x6447, 1), &[2, 0, 0, 0]).unwrap();
        rig.write(mux(0x6446, 1), &[1, 0, 0, 0]).unwrap();
        rig.write(mux(0x6444, 1), &[0xFF, 0xFF, 0xFF, 0xFF]).unwrap();
        rig.write(mux(0x6411, 2), &[10, 0]).unwrap();
        rig.write(mux(0x6443, 2), &[0]).unwrap();
        assert_eq!(seen(&rig, "analogue-output-1"), 21);
        rig.send("000#0205");
        assert_eq!(seen(&rig, "digital-outputs-1"), 0x72);
        assert_eq!(seen(&rig, "analogue-output-1"), -1);
        assert_eq!(seen(&rig, "analogue-output-2"), 10);
        rig.send("000#0105");
        assert_eq!(seen(&rig, "digital-outputs-1"), 0xF2);
        assert_eq!(seen(&rig, "analogue-output-1"), 21);
    }

    #[test]
    fn a_lost_heartbeat_is_a_failure_that_the_next_value_ends() {
        let mut rig = rig();
        rig.write(mux(0x1029, 1), &[1]).unwrap();
        rig.write(mux(0x1016, 1), &[20, 0, 10, 0]).unwrap();
        rig.write(mux(0x6200, 1), &[0xFF]).unwrap();
        rig.send("70A#05");
        assert_eq!(seen(&rig, "digital-outputs-1"), 0xFF);
        rig.run_to(rig.now.0 / 1000 + 30_000);
        assert_eq!(seen(&rig, "digital-outputs-1"), 0);
        assert_eq!(rig.read(mux(0x6200, 1)), Ok(vec![0xFF]));
        rig.write(mux(0x6200, 1), &[0x0F]).unwrap();
        assert_eq!(seen(&rig, "digital-outputs-1"), 0x0F);
    }

    #[test]
    fn the_bench_takes_what_terminals_can_carry() {
        let mut rig = rig();
        assert!(rig.node.bench_names().contains(&"analogue-output-2".to_owned()));
        let mut out = canopen::Outbox::default();
        for (name, number) in [
            ("digital-inputs-1", 256),
            ("digital-inputs-3", 0),
            ("analogue-input-1", 40_000),
            ("digital-outputs-1", 1),
            ("nothing", 1),
        ] {
            let taken = rig.node.stimulate(rig.now, name, &Value::Int(number), &mut out);
            assert!(taken.is_err(), "{name}");
        }
    }

    #[test]
    fn simulated_errors_appear_change_and_go() {
        let mut rig = rig();
        let mut told = |sub, code: u16| {
            rig.until(rig.now.0 / 1000);
            rig.write(mux(0x2F40, sub), &code.to_le_bytes()).unwrap();
            let now = rig.now.0 / 1000;
            rig.until(now).into_iter().map(|(_, frame)| frame).collect::<Vec<String>>()
        };
        assert_eq!(told(1, 0x4210), ["085#1042090100000000"]);
        assert_eq!(told(2, 0xFF01), ["085#01FF890200000000"]);
        assert_eq!(told(2, 0xFF01), [""; 0]);
        assert_eq!(told(1, 0x3100), ["085#0000810000000000", "085#0031850100000000"]);
        assert_eq!(told(2, 0), ["085#0000050000000000"]);
        assert_eq!(told(1, 0), ["085#0000000000000000"]);
    }
}
