//! The task of the device: on or off, by which sensor, in suction or not (3.4.2 to 3.4.6).

use canopen::{Abort, Dictionary, Mux};

use super::codes::Codes;
use super::objects::{
    CONTROL_BYTE, CONTROL_ERRORS, CONTROL_WORD, CONTROLLER_MODE, CONTROLLER_MODE_DISPLAY,
    EXTERNAL_SENSOR, FAILURE_RESET, RETURN_LINE, SECOND_SET_POINT, SET_POINT, STATUS_INFORMATION,
    SWITCH_OFF_MODE, SWITCH_OFF_MODE_DISPLAY, SWITCH_OFF_STATUS, set, value,
};
use super::rules::Em66Rules;
use super::suction::{Situation, Suction};
use super::switch_off::SwitchOff;
use super::{Duty, External, Mode, Options, Sensed};

/// The requests and their state.
#[derive(Clone, Copy, Debug)]
pub(super) struct Operation {
    codes: Codes,
    mode: Mode,
    /// A mode was chosen since the reset.
    chosen: bool,
    switch_off: SwitchOff,
    suction: Suction,
}

impl Operation {
    /// A device that was asked for nothing.
    pub(super) fn new(codes: Codes) -> Self {
        let (mode, switch_off, suction) = Default::default();
        Self { codes, mode, chosen: false, switch_off, suction }
    }

    /// Whether the device takes what is about to be written: it refuses what it has not got.
    pub(super) fn check(
        mux: Mux,
        bytes: &[u8],
        options: Options,
        od: &Dictionary,
        rules: &Em66Rules,
    ) -> Result<(), Abort> {
        let has = |mux| od.entry(mux).is_some();
        let return_line = has(RETURN_LINE) && options.return_line_control;
        let external = has(EXTERNAL_SENSOR) && options.external_sensor_control;
        let taken = match (mux, bytes) {
            (CONTROLLER_MODE, [mode]) => rules.mode_accepted(*mode, return_line, external),
            (SWITCH_OFF_MODE, [mode]) => {
                rules.switch_off_mode_accepted(*mode, options.cool_down, options.evacuation)
            }
            _ => true,
        };
        if taken { Ok(()) } else { Err(Abort::VALUE) }
    }

    /// The network has written the object at `mux`.
    pub(super) fn written(&mut self, mux: Mux, od: &mut Dictionary, rules: &Em66Rules) {
        match mux {
            CONTROLLER_MODE
                if self.switch_off.is_busy() && !rules.mode_changes_while_switching_off() => {}
            CONTROLLER_MODE if rules.mode_changes(self.switch_off.is_running()) => {
                self.mode = Mode::of(value(od, CONTROLLER_MODE));
                self.chosen = true;
            }
            SWITCH_OFF_MODE => self.switch_off.choose(value(od, SWITCH_OFF_MODE) as u8, rules),
            CONTROL_WORD if value(od, CONTROL_WORD) & FAILURE_RESET != 0 => {
                let byte = rules.control_byte_after_failure_reset(value(od, CONTROL_BYTE));
                set(od, CONTROL_BYTE, byte);
            }
            _ => {}
        }
    }

    /// The device has refused a write at `mux`.
    pub(super) fn refused(&mut self, mux: Mux, rules: &Em66Rules) {
        if mux == CONTROLLER_MODE {
            self.mode = Mode::of(rules.mode_after_refusal(self.mode.code()));
        }
    }

    /// Which temperature is controlled, or will be.
    pub(super) const fn mode(&self) -> Mode {
        self.mode
    }

    /// The present task of the device; shows it in 2002h, 2004h, 2006h, 2007h and 2009h.
    pub(super) fn decide(
        &mut self,
        sensed: &Sensed,
        blocked: bool,
        options: Options,
        od: &mut Dictionary,
        rules: &Em66Rules,
    ) -> Duty {
        let asked = value(od, CONTROL_BYTE) & self.codes.control_on != 0;
        self.switch_off.decide(asked, sensed, rules);
        self.suction.decide(&self.situation(sensed, options, od, rules), rules);
        self.show(od, rules);
        let switch_off = &self.switch_off;
        let busy = switch_off.is_busy();
        Duty {
            on: switch_off.is_running() || busy && rules.on_while_switching_off(),
            mode: Mode::of(rules.controlled_mode(self.mode.code())),
            cooling_down: switch_off.is_cooling_down(),
            evacuating: switch_off.is_evacuating(),
            suction: rules.suction_acts(self.suction.is_active()),
            blocked,
        }
    }

    fn situation(
        &self,
        sensed: &Sensed,
        options: Options,
        od: &Dictionary,
        rules: &Em66Rules,
    ) -> Situation {
        let second = value(od, CONTROL_BYTE) & self.codes.control_second != 0;
        let first = value(od, SET_POINT);
        let chosen = if second { value(od, SECOND_SET_POINT) } else { first };
        let off = !self.switch_off.is_running() && !self.switch_off.is_busy();
        Situation {
            requested: rules.suction_requested(value(od, CONTROL_WORD)),
            supported: options.suction,
            set_point: rules.suction_set_point(chosen, first),
            effective: sensed.effective(self.mode),
            running: self.switch_off.is_running() || off && rules.suction_while_off(),
            off,
        }
    }

    fn show(&self, od: &mut Dictionary, rules: &Em66Rules) {
        let Self { switch_off, suction, .. } = self;
        let requested = rules.suction_requested(value(od, CONTROL_WORD));
        let mode = self.mode.code();
        let mode = if self.chosen { mode } else { rules.mode_before_choice(mode) };
        let status = rules.suction_status(requested, suction.is_active());
        set(od, STATUS_INFORMATION, rules.status_information(status, switch_off.is_busy()));
        set(od, CONTROL_ERRORS, rules.control_errors(suction.is_error()));
        set(od, CONTROLLER_MODE_DISPLAY, rules.mode_shown(mode, switch_off.is_running()));
        set(od, SWITCH_OFF_MODE_DISPLAY, switch_off.display(rules).into());
        let (cools, evacuates) = (switch_off.is_cooling_down(), switch_off.is_evacuating());
        let actions = rules.switch_off_status(cools, evacuates, switch_off.is_running());
        set(od, SWITCH_OFF_STATUS, actions);
    }
}

impl Mode {
    /// By its code in 2003h.
    const fn of(code: i64) -> Self {
        match code {
            2 => Self::ReturnLine,
            3 => Self::ExternalSensor,
            _ => Self::MainLine,
        }
    }

    /// Its code in 2004h.
    const fn code(self) -> i64 {
        match self {
            Self::MainLine => 1,
            Self::ReturnLine => 2,
            Self::ExternalSensor => 3,
        }
    }
}

impl Sensed {
    /// The value that is controlled (3.4.4), in tenths of a degree; `None` when its sensor tells
    /// nothing.
    pub(super) const fn effective(&self, mode: Mode) -> Option<i64> {
        match (mode, self.external) {
            (Mode::MainLine, _) => Some(self.main),
            (Mode::ReturnLine, _) => Some(self.return_line),
            (Mode::ExternalSensor, External::Reads(celsius)) => Some(celsius),
            (Mode::ExternalSensor, External::Unplugged | External::Broken) => None,
        }
    }
}

#[cfg(test)]
mod tests;
