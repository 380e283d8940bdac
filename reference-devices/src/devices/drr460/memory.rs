//! Values that the DRR460 keeps when it is switched off, without a store command.

use canopen::Dictionary;

use super::model::rules::Rules;
use super::model::tuning::Found;
use super::objects::{MANUAL, OUTPUT, START, parameter, set_parameter, value};
use crate::devices::pixsys::emergency::Module;

/// The memory.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Memory {
    started: bool,
    manual: bool,
    /// In hundredths of a per cent.
    output: i64,
    /// The result of the tuning at one start, so that the next start does not tune again.
    once: Option<Found>,
    /// The board inside at the last store command.
    pub(super) module: Module,
}

impl Default for Memory {
    fn default() -> Self {
        let module = Module::Fitted;
        Self { started: true, manual: false, output: 0, once: None, module }
    }
}

impl Memory {
    /// Takes over what lasts.
    pub(super) fn keep(&mut self, od: &Dictionary) {
        self.started = value(od, START) == 1;
        self.manual = value(od, MANUAL) == 1;
        self.output = value(od, OUTPUT);
    }

    /// A tuning is done. That at one start is not to be repeated.
    pub(super) fn tuned(&mut self, found: Found, od: &mut Dictionary, rules: &Rules) {
        if parameter(od, TUNE) == ONCE && rules.tunes_once() {
            self.once = Some(found);
            set_parameter(od, TUNE, 0);
        }
        if rules.takes_found() {
            take(found, od);
        }
    }

    /// The defaults were loaded.
    pub(super) fn forget(&mut self) {
        *self = Self { module: self.module, ..Self::default() };
    }

    /// Another tuning was selected.
    pub(super) const fn tune_again(&mut self) {
        self.once = None;
    }

    /// The device was switched on: the objects have what was stored or their defaults.
    pub(super) fn give_back(&self, od: &mut Dictionary, rules: &Rules) {
        let initial_state = rules.parameter(INITIAL_STATE, parameter(od, INITIAL_STATE));
        let started = rules.starts(initial_state, self.started);
        od.set_int(START, started.into());
        if rules.manual_kept(parameter(od, MANUAL_ALLOWED)) && rules.remembers(self.manual) {
            od.set_int(MANUAL, 1);
            od.set_int(OUTPUT, self.output);
        }
        if parameter(od, TUNE) == ONCE
            && let Some(found) = self.once
        {
            set_parameter(od, TUNE, 0);
            take(found, od);
        }
    }
}

fn take(found: Found, od: &mut Dictionary) {
    let values = [found.band, found.integral_time, found.derivative_time];
    for (sub, value) in (BAND..).zip(values) {
        set_parameter(od, sub, value);
    }
}

const INITIAL_STATE: u8 = 17;
const MANUAL_ALLOWED: u8 = 25;
/// Which tuning is selected.
pub(super) const TUNE: u8 = 31;
const ONCE: i64 = 3;
/// Proportional band, followed by integral and derivative time.
const BAND: u8 = 33;
