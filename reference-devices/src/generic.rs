//! What the generic device does: the small application that lets every service be tried.
//!
//! The inputs and outputs of CiA 401 stand on simulated terminals. The manufacturer area makes
//! visible what no profile has an object for: a value that is refused because of the state of the
//! device (2F04h), an abort code of the application (2F05h) and errors that appear and go on
//! demand (2F40h). Everything else in the data sheet is the business of the stack.

mod rules;

use canopen::emcy::EmcyCode;
use canopen::{Abort, Dictionary, Instant, Mux, NmtState};

use crate::behaviour::{Behaviour, Event};
use crate::errors::Errors;

pub use rules::{GenericRules, Profile, named, names};

/// The application of the generic device.
pub struct Generic {
    rules: Box<dyn GenericRules>,
    state: NmtState,
    /// The codes of the simulated errors that are present.
    simulated: [i64; SIMULATED],
}

impl Generic {
    /// A device that decides in this manner.
    pub fn new(rules: Box<dyn GenericRules>) -> Self {
        Self { rules, state: NmtState::INITIALISING, simulated: [0; SIMULATED] }
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
    }

    fn check(&self, mux: Mux, bytes: &[u8], od: &Dictionary) -> Result<(), Abort> {
        match (mux, bytes) {
            (PARAMETER, _) => self.rules.parameter_change(value(od, MODE)),
            (REFUSED_WITH, &[a, b, c, d]) => match u32::from_le_bytes([a, b, c, d]) {
                0 => Ok(()),
                code => Err(Abort(code)),
            },
            _ => Ok(()),
        }
    }

    fn event(&mut self, _now: Instant, event: Event, _od: &mut Dictionary) {
        if let Event::Entered(state) = event {
            self.state = state;
        }
    }

    fn run(&mut self, _now: Instant, od: &mut Dictionary, errors: &mut Errors) {
        self.simulate(od, errors);
        let faulty = i64::from(errors.register() != 0);
        let running = i64::from(self.state == NmtState::OPERATIONAL);
        od.set_int(STATUS, faulty | running << 1);
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
/// What does not change then.
const PARAMETER: Mux = Mux::new(0x2F04, 2);
/// Takes an abort code and answers with it.
const REFUSED_WITH: Mux = Mux::new(0x2F05, 0);
/// The codes of errors that are to be present.
const SIMULATED_ERROR: u16 = 0x2F40;
const SIMULATED: usize = 4;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices;
    use crate::testing::{Rig, mux};

    fn rig() -> Rig {
        let device = devices::device("generic").unwrap();
        let mut rig = Rig::with(
            &device.description.eds,
            device.settings(),
            Box::new(crate::Specification),
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
