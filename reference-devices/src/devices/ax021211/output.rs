//! The output (1.2, 1.3): its target, computed in the order of figure 6.

use std::time::Duration;

use canopen::Instant;

use super::detect::Detector;
use super::digital::{Digital, DigitalSettings};
use super::load::{Driven, Load, Stage};
use super::network::OUTPUTS;
use super::objects::{
    CONTROL_NUMBER, CONTROL_RESPONSE, CONTROL_SOURCE, DETECTION, DIGITS_FV, DIGITS_PV,
    DITHER_AMPLITUDE, ENABLE_NUMBER, ENABLE_RESPONSE, ENABLE_SOURCE, FAULT_FV, FAULT_MODE,
    HYSTERESIS, OUTPUT_TYPE, OVERRIDE_FV, OVERRIDE_NUMBER, OVERRIDE_RESPONSE, OVERRIDE_SOURCE,
    Parameters, RAMP_DOWN, RAMP_UP, REACTION_DELAY, SCALING_1_FV, SCALING_1_PV, SCALING_2_FV,
    SCALING_2_PV, STATIC_BIAS, digits, power,
};
use super::ramp::Ramp;
use super::rules::Ax021211Rules;
use super::signal::{Link, Signal};

/// The types of table 3.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Kind {
    #[default]
    Disabled,
    Voltage,
    Current,
    Pwm,
    OnOff,
    Hotshot,
}

impl Kind {
    /// The type that a value of 6310h means; `None` when table 3 has no such.
    pub(super) const fn of(code: i64) -> Option<Self> {
        Some(match code {
            0 => Self::Disabled,
            10 => Self::Voltage,
            20 => Self::Current,
            40 => Self::Pwm,
            1000 => Self::OnOff,
            1020 => Self::Hotshot,
            _ => return None,
        })
    }

    pub(super) const fn is_digital(self) -> bool {
        matches!(self, Self::OnOff | Self::Hotshot)
    }

    /// Whether it needs the fixed frequency of the current loop.
    pub(super) const fn is_current(self) -> bool {
        matches!(self, Self::Current | Self::Hotshot)
    }

    /// The largest field value in its unit (table 3).
    pub(super) const fn largest(self) -> f64 {
        match self {
            Self::Disabled => 0.0,
            Self::Voltage => 60.0,
            Self::Current => 2500.0,
            Self::Pwm => 100.0,
            Self::OnOff | Self::Hotshot => 1.0,
        }
    }
}

/// The settings of an output. Values in the units of their axes, decimal digits resolved.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct OutputSettings {
    pub(super) kind: Kind,
    /// The control, enable and override inputs.
    pub(super) links: [Link; 3],
    /// The ends of the PV axis of figure 5.
    pub(super) pv: (f64, f64),
    fv: (f64, f64),
    digits: u8,
    responses: Responses,
    keeps_on_fault: bool,
    fault_fv: f64,
    override_fv: f64,
    static_bias: f64,
    ramp: Ramp,
    digital: DigitalSettings,
    detects: bool,
    hysteresis: f64,
    reaction_delay: Duration,
    /// In milliamperes.
    pub(super) dither: f64,
}

/// The control input of an output of some kind: a message gives a digital output a bit of 6200h.
fn control(od: Parameters<'_>, kind: Kind, link: Link) -> Link {
    let Some(place) = link.message().filter(|place| *place < OUTPUTS) else { return link };
    let numbered = Kind::of(od.int(OUTPUT_TYPE, place)).unwrap_or_default();
    match od.rules.takes_a_bit(kind.is_digital(), numbered.is_digital()) {
        true => Link::state(link.number),
        false => link,
    }
}

/// The responses to the three inputs (tables 7 to 9).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Responses {
    control: u8,
    enable: u8,
    overriding: u8,
}

impl OutputSettings {
    pub(super) fn read(od: Parameters<'_>, place: usize) -> Self {
        let pv_digits = od.byte(DIGITS_PV, place);
        let fv_digits = od.byte(DIGITS_FV, place);
        let pv_digits = od.rules.digits_of_scaling(pv_digits);
        let pv = |index| od.scaled(index, place, pv_digits);
        let fv = |index| od.scaled(index, place, fv_digits);
        let scalings = (fv(SCALING_1_FV), fv(SCALING_2_FV));
        let kind = Kind::of(od.int(OUTPUT_TYPE, place)).unwrap_or_default();
        let link =
            |source, number| od.rules.input_link(od.link(source, number, place), source, place);
        Self {
            kind,
            links: [
                control(od, kind, link(CONTROL_SOURCE, CONTROL_NUMBER)),
                link(ENABLE_SOURCE, ENABLE_NUMBER),
                link(OVERRIDE_SOURCE, OVERRIDE_NUMBER),
            ],
            pv: (pv(SCALING_1_PV), pv(SCALING_2_PV)),
            fv: scalings,
            digits: fv_digits,
            responses: Responses {
                control: od.byte(CONTROL_RESPONSE, place),
                enable: od.byte(ENABLE_RESPONSE, place),
                overriding: od.byte(OVERRIDE_RESPONSE, place),
            },
            keeps_on_fault: od.int(FAULT_MODE, place) == 0,
            fault_fv: fv(FAULT_FV),
            override_fv: fv(OVERRIDE_FV),
            static_bias: fv(STATIC_BIAS),
            ramp: Ramp {
                span: od.rules.ramp_span(scalings.0, scalings.1, kind.largest()),
                up: od.time(RAMP_UP, place),
                down: od.time(RAMP_DOWN, place),
                bias: od.rules.ramp_bias(fv(STATIC_BIAS), scalings.0.min(scalings.1)),
            },
            digital: DigitalSettings::read(od, place),
            detects: od.flag(DETECTION, place),
            hysteresis: fv(HYSTERESIS),
            reaction_delay: od.time(REACTION_DELAY, place),
            dither: od.int(DITHER_AMPLITUDE, place) as f64,
        }
    }

    /// The field value for a process value (figure 5, table 7), with the static bias at zero
    /// command (1.3).
    fn field_value(&self, pv: f64, rules: &Ax021211Rules) -> f64 {
        let (low, high) = self.pv;
        if rules.is_off(self.responses.control, pv, self.pv) {
            return 0.0;
        }
        let part = rules.held_part(rules.share(pv, low, high));
        let fv = self.fv.0 + part * (self.fv.1 - self.fv.0);
        rules.biased(fv, pv, self.static_bias).clamp(0.0, self.kind.largest())
    }
}

/// The inputs of a decision about an output.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Command {
    /// An input is in an error state.
    Fault,
    Override,
    Disabled(Disabled),
    /// The control input decides.
    Control(Signal),
}

/// How an output that is not enabled behaves (table 8).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Disabled {
    ShutOff,
    RampOff,
    KeepLast,
}

/// The inputs that say something else than the control input does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Interventions {
    pub(super) fault: bool,
    pub(super) overrides: bool,
    pub(super) disabled: Option<Disabled>,
}

/// Figure 6: a fault comes before the override, and that before the enable input (1.2).
pub(super) fn decide(found: Interventions, control: Signal) -> Command {
    match found {
        Interventions { fault: true, .. } => Command::Fault,
        Interventions { overrides: true, .. } => Command::Override,
        Interventions { disabled: Some(how), .. } => Command::Disabled(how),
        _ => Command::Control(control),
    }
}

/// Table 8: `None` when the output is enabled.
pub(super) fn disabled(response: u8, on: bool) -> Option<Disabled> {
    let enabled = on == (response <= 2);
    match response % 3 {
        _ if enabled => None,
        0 => Some(Disabled::ShutOff),
        1 => Some(Disabled::RampOff),
        _ => Some(Disabled::KeepLast),
    }
}

/// The result of a control cycle for an output.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct OutputView {
    /// 7330h.
    pub(super) commanded: (i64, Signal),
    /// 2370h.
    pub(super) feedback: (i64, Signal),
    pub(super) driven: Driven,
    /// The load sees a dither.
    pub(super) dithers: bool,
    pub(super) drives_digital: bool,
}

/// An output at work.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Output {
    kind: Kind,
    /// The field value that is applied, in its unit.
    level: f64,
    /// The field value that the ramps lead to.
    target: f64,
    /// The field value that the control input last asked for, whichever input decided.
    asked: f64,
    digital: Digital,
    detector: Detector,
    moves: bool,
}

impl Output {
    /// A control cycle, `elapsed` after the one before; `inputs` are those of the links.
    pub(super) fn evaluate(
        &mut self,
        (now, elapsed): (Instant, Duration),
        settings: &OutputSettings,
        inputs: [Signal; 3],
        (load, supply): (&Load, f64),
        rules: &Ax021211Rules,
    ) -> OutputView {
        if self.kind != settings.kind {
            *self = Self { kind: settings.kind, ..Self::default() };
        }
        self.moves = false;
        if inputs[0].is_valid() {
            self.asked = settings.field_value(inputs[0].value, rules);
        }
        let command = settings.command(inputs, rules);
        let stage = if self.kind.is_digital() {
            self.drive_digital(now, command, settings, rules)
        } else {
            self.drive_analogue(elapsed, command, settings, rules)
        };
        let driven = load.driven(rules.stage(stage, settings.dither), supply);
        let view = self.view(settings, driven, rules);
        let applied = digits(self.level, settings.digits);
        let fv = applied as f64 / power(settings.digits);
        let (feedback, seen) = (view.feedback.1.value, (driven, settings.dither));
        let difference = rules.difference(fv, self.target, feedback, seen);
        let drives = applied != 0 || view.drives_digital;
        let wrong = rules.is_wrong(drives, driven.shorted, difference, settings.hysteresis);
        let watched = rules.watches(self.kind == Kind::Current) && settings.detects;
        self.detector.watch(now, watched && wrong, settings.reaction_delay, rules);
        view
    }

    fn drive_analogue(
        &mut self,
        elapsed: Duration,
        command: Command,
        settings: &OutputSettings,
        rules: &Ax021211Rules,
    ) -> Stage {
        let target = match command {
            Command::Fault if rules.keeps(settings.keeps_on_fault) => {
                rules.kept_on_fault(self.level, self.target, self.asked)
            }
            Command::Fault => settings.fault_fv,
            Command::Override => rules.override_fv(settings.override_fv, self.level),
            Command::Disabled(Disabled::KeepLast) => self.level,
            Command::Disabled(_) => rules.off_fv(settings.fv.0),
            Command::Control(pv) if pv.is_valid() => settings.field_value(pv.value, rules),
            Command::Control(_) => rules.uncontrolled(self.level),
        };
        let target = target.clamp(0.0, self.kind.largest());
        self.level = match rules.is_ramped(command) {
            true => rules.ramp(settings.ramp).step(self.level, target, elapsed),
            false => target,
        };
        self.moves = self.level != target;
        self.target = target;
        let value = digits(self.level, settings.digits) as f64 / power(settings.digits);
        match self.kind {
            Kind::Current => Stage::Current(value),
            Kind::Voltage => Stage::Voltage(value),
            Kind::Pwm => Stage::Duty(value),
            _ => Stage::Off,
        }
    }

    fn drive_digital(
        &mut self,
        now: Instant,
        command: Command,
        settings: &OutputSettings,
        rules: &Ax021211Rules,
    ) -> Stage {
        let is_hotshot = self.kind == Kind::Hotshot;
        let set = &settings.digital;
        match command {
            Command::Fault if rules.keeps(set.keeps_on_fault) => self.digital.keep(now, rules),
            Command::Fault => {
                self.digital.force(rules.fault_state(set.fault_state), command, set, rules);
            }
            Command::Override => {
                self.digital.force(settings.override_fv != 0.0, command, set, rules);
            }
            Command::Disabled(Disabled::KeepLast) => self.digital.hold(),
            Command::Disabled(_) => self.digital.force(false, command, set, rules),
            Command::Control(signal) => {
                let response = settings.responses.control;
                let off = rules.is_digital_off(response, signal.value, settings.pv);
                let on = signal.is_valid() && rules.is_on(signal) && !off;
                self.digital.command(now, on, set, is_hotshot, rules);
            }
        }
        match (self.digital.drive, is_hotshot) {
            (_, true) => Stage::Current(self.digital.current(now, set, rules)),
            (true, false) => Stage::On,
            (false, false) => Stage::Off,
        }
    }

    /// The values of 7330h and 2370h; for a digital output, its logic state and its drive state.
    fn view(&self, settings: &OutputSettings, driven: Driven, rules: &Ax021211Rules) -> OutputView {
        let is_digital = self.kind.is_digital();
        let (commanded, feedback) = match self.kind {
            Kind::OnOff | Kind::Hotshot => {
                let states = rules.digital_states(self.digital.logic, self.digital.drive);
                (i64::from(states.0), i64::from(states.1))
            }
            Kind::Current => {
                let level = digits(rules.shown_fv(self.level, self.target), settings.digits);
                (level, digits(driven.milliamperes, settings.digits))
            }
            Kind::Disabled => (0, 0),
            Kind::Voltage | Kind::Pwm => {
                let level = digits(self.level, settings.digits);
                let shown = digits(rules.shown_fv(self.level, self.target), settings.digits);
                (shown, rules.feedback_without_current(level, driven))
            }
        };
        let places = if is_digital { 0 } else { settings.digits };
        let limits = if is_digital { (0.0, 1.0) } else { settings.pv };
        let signal = |shown: i64| Signal::new(shown as f64 / power(places), Some(limits));
        let fault = self.detector.recognised;
        OutputView {
            commanded: (commanded, signal(commanded)),
            feedback: (feedback, signal(feedback).failing(rules.source_fails(fault))),
            driven,
            dithers: rules.dithers(self.kind == Kind::Current)
                && settings.dither > 0.0
                && driven.milliamperes > 0.0,
            drives_digital: is_digital && self.digital.drive,
        }
    }

    /// The open or short circuit that was recognised.
    pub(super) const fn has_fault(&self) -> bool {
        self.detector.recognised
    }

    /// When time alone changes the output next.
    pub(super) fn due(&self, now: Instant) -> Option<Instant> {
        let ramp = self.moves.then_some(now);
        [ramp, self.digital.due(), self.detector.due()].into_iter().flatten().min()
    }
}

impl OutputSettings {
    fn command(&self, inputs: [Signal; 3], rules: &Ax021211Rules) -> Command {
        let [control, enable, overriding] = inputs;
        let fault = rules.input_fault(inputs.map(Signal::has_failed));
        let on = |signal: Signal| signal.is_valid().then(|| rules.is_on(signal));
        let enabling = on(enable).or_else(|| rules.absent(1));
        let disabled = enabling.and_then(|on| disabled(self.responses.enable, on));
        let overrides = on(overriding)
            .or_else(|| rules.absent(2))
            .is_some_and(|on| on == (self.responses.overriding == 0));
        rules.decide(Interventions { fault, overrides, disabled }, control)
    }
}

#[cfg(test)]
mod tests;
