//! The outputs of CiA 401: from the object to the terminal, and what a failure does to them.

use canopen::{Dictionary, Mux};

use super::rules::GenericRules;
use super::value;

/// A block of eight digital outputs, or an analogue output: what is at the terminals.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Output {
    pub(super) terminal: i64,
    /// The network failed, so the terminals keep what they have until it is back.
    pub(super) failed: bool,
}

impl Output {
    /// Lets the terminals of a digital block follow 6200h where 6208h lets them.
    pub(super) fn drive_digital(&mut self, sub: u8, od: &Dictionary, rules: &dyn GenericRules) {
        if self.failed {
            return;
        }
        let setting = |index| rules.setting(index, value(od, Mux::new(index, sub)));
        let wanted = value(od, Mux::new(DIGITAL_OUTPUT, sub)) ^ setting(0x6202);
        let mask = setting(0x6208);
        self.terminal = wanted & mask | self.terminal & !mask & 0xFF;
    }

    /// Lets those terminals that 6206h names take their value of 6207h.
    pub(super) fn fail_digital(&mut self, sub: u8, od: &Dictionary, rules: &dyn GenericRules) {
        let setting = |index| rules.setting(index, value(od, Mux::new(index, sub)));
        let mode = setting(0x6206);
        self.failed = true;
        self.terminal = setting(0x6207) & mode | self.terminal & !mode & 0xFF;
    }

    /// Converts 6411h into the field value.
    pub(super) fn drive_analogue(&mut self, sub: u8, od: &Dictionary, rules: &dyn GenericRules) {
        if self.failed {
            return;
        }
        let setting = |index| rules.setting(index, value(od, Mux::new(index, sub)));
        let written = value(od, Mux::new(ANALOGUE_OUTPUT, sub));
        let field = written.saturating_mul(setting(0x6447)).saturating_add(setting(0x6446));
        self.terminal = field.clamp(i16::MIN.into(), i16::MAX.into());
    }

    /// Takes the value of 6444h when 6443h says so.
    pub(super) fn fail_analogue(&mut self, sub: u8, od: &Dictionary, rules: &dyn GenericRules) {
        let setting = |index| rules.setting(index, value(od, Mux::new(index, sub)));
        self.failed = true;
        if setting(0x6443) != 0 {
            self.terminal = setting(0x6444);
        }
    }
}

/// Write output 8-bit.
pub(super) const DIGITAL_OUTPUT: u16 = 0x6200;
/// Write analogue output 16-bit.
pub(super) const ANALOGUE_OUTPUT: u16 = 0x6411;
