//! The application of the generic device: a small one that lets every service be tried.
//!
//! It has the I/O block of CiA 401. The manufacturer area makes visible what no profile has an
//! object for: a value that is refused because of the state of the device (2F04h), an abort code of
//! the application (2F05h) and errors that come and go on demand (2F40h). The stack handles
//! everything else in the data sheet.

mod rules;
mod sdo_client;

use canopen::eds::Eds;
use canopen::emcy::EmcyCode;
use canopen::{Abort, BenchError, Dictionary, Instant, Mux, NmtState, Value};
use std::sync::Arc;

use crate::decisions::{Otherwise, Set};
use crate::profiles::cia401::{Cia401Rules, IoBlock};
use crate::stack::{Behaviour, CommunicationEvent, Errors, SdoJob};

use rules::GenericRules;
use sdo_client::ClientRecord;

/// The decisions of the application that deviations can override.
pub(super) const DECISIONS: Set = Set::of::<rules::Decision>();

/// The application of the generic device.
#[derive(Clone)]
pub(crate) struct Generic {
    rules: Arc<GenericRules>,
    state: NmtState,
    /// The codes of the simulated errors that are present.
    simulated: [i64; SIMULATED],
    io: IoBlock,
    client: ClientRecord,
    faults: [Fault; 2],
    /// Whether a value at the end of its range is an error now.
    extreme: bool,
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
    /// Whether it has appeared before.
    known: bool,
}

impl Generic {
    /// The device that keeps to its documents but for these decisions.
    pub(crate) fn with_deviations(eds: &Eds, otherwise: &[Otherwise<'_>]) -> Self {
        let of_io = Cia401Rules::default().with(otherwise);
        Self::with(GenericRules::default().with(otherwise), IoBlock::new(eds, of_io))
    }

    fn with(rules: GenericRules, io: IoBlock) -> Self {
        Self {
            rules: Arc::new(rules),
            state: NmtState::INITIALISING,
            simulated: [0; SIMULATED],
            io,
            client: ClientRecord::default(),
            faults: [
                Fault::new("output-fault", EmcyCode(0x2300), 2),
                Fault::new("input-fault", EmcyCode(0x2100), 3),
            ],
            extreme: false,
        }
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

    /// Lets the error of a value at the end of its range appear or go.
    fn show_extreme(&mut self, od: &Dictionary, errors: &mut Errors) {
        let Some(code) = self.rules.extreme_value() else { return };
        let extreme = EXTREMES.contains(&value(od, LIMITED));
        match (self.extreme, extreme) {
            (false, true) => errors.raise(EXTREME, code, register_bit(code), [0; 5]),
            (true, false) => errors.clear(EXTREME),
            _ => {}
        }
        self.extreme = extreme;
    }
}

impl Behaviour for Generic {
    fn reset(&mut self, now: Instant, od: &mut Dictionary) {
        self.simulated = [0; SIMULATED];
        self.extreme = false;
        if self.rules.fault_seen_after_reset() {
            self.faults.iter_mut().for_each(|fault| fault.present = false);
        }
        self.io.reset(now, od);
    }

    fn supply_lost(&mut self) {
        self.io.supply_lost();
    }

    fn check(&self, mux: Mux, bytes: &[u8], od: &Dictionary) -> Result<(), Abort> {
        match (mux, bytes) {
            // Neither under local control, nor in a state that forbids it (2F04h).
            (PARAMETER, _) => match value(od, MODE) {
                1 => Err(Abort::LOCAL_CONTROL),
                2 => Err(Abort::DEVICE_STATE),
                _ => Ok(()),
            },
            (REFUSED_WITH, &[a, b, c, d]) => match u32::from_le_bytes([a, b, c, d]) {
                0 => Ok(()),
                code => Err(Abort(code)),
            },
            (Mux { index: LARGE_DATA, .. }, _) if !self.rules.large_data_taken(bytes) => {
                Err(Abort::VALUE)
            }
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

    fn written(&mut self, now: Instant, mux: Mux, od: &mut Dictionary) {
        self.client.written(mux, od);
        self.io.written(now, mux, od);
    }

    fn uploaded(&mut self, mux: Mux, od: &mut Dictionary) {
        self.io.uploaded(mux, od);
    }

    fn event(&mut self, now: Instant, event: CommunicationEvent, od: &mut Dictionary) {
        if let CommunicationEvent::Entered(state) = event {
            self.state = state;
        }
        self.io.event(now, event, od);
    }

    fn run(&mut self, now: Instant, od: &mut Dictionary, errors: &mut Errors) {
        self.io.run(now, od, errors);
        self.simulate(od, errors);
        self.faults.iter_mut().for_each(|fault| fault.show(errors, &self.rules));
        self.show_extreme(od, errors);
        let faulty = i64::from(errors.register() != 0);
        let running = i64::from(self.state == NmtState::OPERATIONAL);
        od.set_int(STATUS, faulty | running << 1);
    }

    fn poll_at(&self) -> Option<Instant> {
        self.io.poll_at()
    }

    fn bench_names(&self) -> Vec<String> {
        let faults = self.faults.iter().map(|fault| fault.name.to_owned());
        self.io.bench_names().into_iter().chain(faults).collect()
    }

    fn stimulate(
        &mut self,
        now: Instant,
        name: &str,
        value: &Value,
        od: &mut Dictionary,
    ) -> Result<(), BenchError> {
        let Some(fault) = self.faults.iter_mut().find(|fault| fault.name == name) else {
            return self.io.stimulate(now, name, value, od);
        };
        let number = value.as_int().filter(|number| matches!(number, 0 | 1));
        let wrong = || BenchError(format!("{name} is 0 or 1, not {value}"));
        fault.wanted = number.ok_or_else(wrong)? == 1;
        Ok(())
    }

    fn observe(&self, name: &str, od: &Dictionary) -> Option<Value> {
        match self.faults.iter().find(|fault| fault.name == name) {
            Some(fault) => Some(Value::Int(fault.wanted.into())),
            None => self.io.observe(name, od),
        }
    }

    fn has_edges(&self, mux: Mux) -> bool {
        self.io.has_edges(mux)
    }

    fn holds_back(&self, mux: Mux, od: &Dictionary) -> bool {
        self.io.holds_back(mux, od)
    }

    fn triggers(&mut self, mux: Mux, last: &[u8], od: &Dictionary) -> bool {
        self.io.triggers(mux, last, od)
    }
}

impl Fault {
    const fn new(name: &'static str, code: EmcyCode, class: u8) -> Self {
        Self { name, code, class, wanted: false, present: false, known: false }
    }

    /// Lets the error appear or go.
    fn show(&mut self, errors: &mut Errors, rules: &GenericRules) {
        if self.present == self.wanted {
            return;
        }
        self.present = self.wanted;
        let number = FAULTS + u16::from(self.class);
        if self.present {
            errors.raise(number, self.code, register_bit(self.code), [0; 5]);
            if !std::mem::replace(&mut self.known, true) || rules.each_fault_reacts() {
                errors.react(self.class);
            }
        } else {
            errors.clear(number);
        }
    }
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

/// Manufacturer status register.
const STATUS: Mux = Mux::new(0x1002, 0);
/// Whether the device is controlled from its own panel.
const MODE: Mux = Mux::new(0x2F04, 1);
/// Large data.
const LARGE_DATA: u16 = 0x2F20;
/// The parameter that does not change in that state.
const PARAMETER: Mux = Mux::new(0x2F04, 2);
/// Takes an abort code and answers with it.
const REFUSED_WITH: Mux = Mux::new(0x2F05, 0);
/// The codes of the errors to raise.
const SIMULATED_ERROR: u16 = 0x2F40;
const SIMULATED: usize = 4;
/// The first number of broken terminals, above those of simulated errors.
const FAULTS: u16 = 0x100;
/// The number of the error of a value at the end of its range.
const EXTREME: u16 = 0x200;
/// That value, and the ends of its range.
const LIMITED: Mux = Mux::new(0x2F02, 3);
const EXTREMES: [i64; 2] = [-1000, 1000];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices;
    use crate::stack::testing::{Fixture, mux};

    fn fixture() -> Fixture {
        let device = devices::device("generic").unwrap();
        let mut fixture = Fixture::with(
            &device.description.eds,
            device.settings(),
            crate::rules::Rules::default(),
            device.behaviour(),
        );
        fixture.run_to(10_000);
        fixture
    }

    #[test]
    fn the_panel_keeps_the_network_from_the_parameter() {
        let mut fixture = fixture();
        let parameter = mux(0x2F04, 2);
        for (mode, answer) in
            [(1, Err(Abort::LOCAL_CONTROL.0)), (2, Err(Abort::DEVICE_STATE.0)), (0, Ok(()))]
        {
            fixture.write(mux(0x2F04, 1), &[mode]).unwrap();
            assert_eq!(fixture.write(parameter, &[7, 0]), answer);
        }
        assert_eq!(fixture.read(parameter), Ok(vec![7, 0]));
    }

    #[test]
    fn a_code_of_the_application_comes_back() {
        let mut fixture = fixture();
        assert_eq!(fixture.write(mux(0x2F05, 0), &[1, 2, 3, 4]), Err(0x0403_0201));
        assert_eq!(fixture.write(mux(0x2F05, 0), &[0; 4]), Ok(()));
    }

    #[test]
    fn simulated_errors_appear_change_and_go() {
        let mut fixture = fixture();
        let mut told = |sub, code: u16| {
            fixture.until(fixture.now.0 / 1000);
            fixture.write(mux(0x2F40, sub), &code.to_le_bytes()).unwrap();
            let now = fixture.now.0 / 1000;
            fixture.until(now).into_iter().map(|(_, frame)| frame).collect::<Vec<String>>()
        };
        assert_eq!(told(1, 0x4210), ["085#1042090100000000"]);
        assert_eq!(told(2, 0xFF01), ["085#01FF890200000000"]);
        assert_eq!(told(2, 0xFF01), [""; 0]);
        assert_eq!(told(1, 0x3100), ["085#0000810000000000", "085#0031850100000000"]);
        assert_eq!(told(2, 0), ["085#0000050000000000"]);
        assert_eq!(told(1, 0), ["085#0000000000000000"]);
    }
}
