//! The application of the DRR460-12A-CAN: a temperature controller with two alarms on a simulated
//! plant.
//!
//! `model` holds what the manual describes, as types without objects and without a clock. This
//! module lets them see the objects, the terminals and the time. The controller decides every
//! 100 ms while something moves, at the end of a delay or soft start, and at once when something
//! happens to it; cycles, valves and the plant have exact times. When nothing moves, nothing is
//! computed.
//!
//! Not modelled: USB and RS485 (3000h subs 113 and 114), and the frequency of the mains (sub 90: 1
//! and 2 are the same). Values that survive a loss of supply without a store command are in
//! `memory`.

mod memory;
mod model;
mod objects;
mod panel;
mod terminals;

use std::sync::Arc;
use std::time::Duration;

use canopen::eds::Eds;
use canopen::{Abort, BenchError, Dictionary, Instant, Mux, NmtState, Value};

use crate::decisions::{Otherwise, Set};
use crate::profiles::cia401::IoBlock;
use crate::stack::{Attachment, Behaviour, CommunicationEvent, Errors, earlier};

use super::pixsys::PixsysIo;
use super::pixsys::emergency::{self, Found, Module};

use memory::{Memory, TUNE};
use model::bench::Surroundings;
use model::controller::{Controller, Settings};
use model::decision::{Inputs, Outcome};
use model::expansion::{self, Silence};
use model::flags::MemoryFault;
use model::load::{Drive, Load};
use model::parameters::Parameters;
use model::rules::{FIGURES, Rules};
use model::switches::Switches;
use model::wiring::Terminals;
use objects::{
    ALARMS_RESET, BIT_RATE, COLD_JUNCTION, COLD_OUTPUT, COMMAND_RESET, ERROR_FLAGS, LATCH_ON,
    MANUAL, MASTER_ANALOGUE, MASTER_OUTPUTS, NODE_ID, OUTPUT, OUTPUTS, PARAMETERS, REAL_SET_POINT,
    REMOTE_ALARMS, RESTORE, RETRANSMITTED, SET_POINT, START, STORE, TUNING, parameter,
    set_parameter, value,
};
use panel::{Panel, Shown};

/// The decisions of the application that deviations can override.
pub(super) const DECISIONS: Set = Set::of::<model::rules::Decision>();

/// The application of a DRR460.
#[derive(Clone)]
pub(crate) struct Drr460 {
    rules: Arc<Rules>,
    /// The same with other figures.
    others: Arc<[Arc<Rules>]>,
    io: IoBlock,
    settings: Settings,
    expansion: expansion::Settings,
    controller: Controller,
    inputs: Inputs,
    outcome: Outcome,
    silence: Silence,
    memory: Memory,
    found: Found,
    around: Surroundings,
    /// When the overflow of the buffer ends as an error.
    overflow_ends: Option<Instant>,
    /// Power-on is still to be reported.
    reports_boot: bool,
    /// The switches as they were read.
    read: Switches,
    /// A bench has set the switches.
    switched: bool,
    /// The device restarts because of a bench action.
    restarts: bool,
    /// It loads its defaults since it was switched on (7.1).
    loading: bool,
    load: Load,
    panel: Panel,
    state: NmtState,
    powered: bool,
    /// The code of the bit rate of this bus; `None` before the device was first switched on.
    bus_rate: Option<i64>,
    /// Until when everything is computed.
    at: Instant,
    decided: Instant,
    next_decision: Option<Instant>,
    /// Something happened since the last decision.
    changed: bool,
    /// The objects have something new since the last run.
    news: bool,
}

impl Drr460 {
    /// The controller that keeps to its manual but for these decisions.
    pub(crate) fn with_deviations(eds: &Eds, otherwise: &[Otherwise<'_>]) -> Self {
        let of_io = PixsysIo::default().rules().with(otherwise);
        let rules = || Rules::default().with(otherwise);
        let others = Arc::new(FIGURES.map(|figures| Arc::new(figures.of(rules()))));
        Self { others, ..Self::with(rules(), IoBlock::new(eds, of_io)) }
    }

    fn with(rules: Rules, io: IoBlock) -> Self {
        let parameters = Parameters::none(&rules);
        Self {
            settings: Settings::of(&parameters),
            expansion: expansion::Settings::of(&parameters),
            rules: Arc::new(rules),
            others: Arc::default(),
            io,
            controller: Controller::default(),
            inputs: Inputs::default(),
            outcome: Outcome::default(),
            silence: Silence::default(),
            memory: Memory::default(),
            found: Found::default(),
            around: Surroundings::default(),
            overflow_ends: None,
            reports_boot: false,
            read: Surroundings::default().switches,
            switched: false,
            restarts: false,
            loading: false,
            load: Load::default(),
            panel: Panel::default(),
            state: NmtState::INITIALISING,
            powered: true,
            bus_rate: None,
            at: Instant::ZERO,
            decided: Instant::ZERO,
            next_decision: None,
            changed: true,
            news: true,
        }
    }

    /// Reads the parameters again.
    fn configure(&mut self, od: &Dictionary) {
        let lasts = self.expansion.enabled && self.rules.expansion_lasts();
        let parameters = Parameters::of(od, &self.rules);
        self.settings = Settings::of(&parameters);
        self.expansion = expansion::Settings::of(&parameters);
        self.expansion.enabled |= lasts;
    }

    /// Reads the parameters at power-on.
    fn configure_at_power_on(&mut self, od: &mut Dictionary) {
        if self.rules.presets_at_power_on() {
            self.preset(parameter(od, COOLING_FLUID), od);
        }
        let parameters = Parameters::of(od, &self.rules).stored();
        self.settings = Settings::of(&parameters);
        self.expansion = expansion::Settings::of(&parameters);
    }

    /// Multiplier and cycle time as a cooling fluid needs them.
    fn preset(&self, fluid: i64, od: &mut Dictionary) {
        let (multiplier, cycle) = self.rules.fluid(fluid);
        set_parameter(od, COOLING_MULTIPLIER, multiplier);
        set_parameter(od, COOLING_CYCLE, cycle);
    }

    /// Lets time pass up to `now`, with the decisions that come due on the way.
    fn follow(&mut self, now: Instant, od: &mut Dictionary) {
        while self.at < now {
            let until = self.next_step().filter(|due| *due < now).unwrap_or(now);
            self.pass(until);
            if self.next_decision.is_some_and(|due| due <= until) {
                self.decide(od);
            }
            self.show_outputs(od);
        }
    }

    /// Plant and outputs go on without a decision.
    fn pass(&mut self, until: Instant) {
        let elapsed = until.since(self.at).as_secs_f64();
        self.load.advance(self.controller.drive(&self.settings), elapsed);
        self.controller.advance(elapsed, &self.settings, &self.rules);
        self.at = until;
        if self.silence.advance(elapsed, &self.expansion) {
            self.next_decision = Some(until);
        }
    }

    /// When an output changes by itself, or a decision is due; later than now.
    fn next_step(&self) -> Option<Instant> {
        let edge = self.controller.next(&self.settings, &self.rules);
        let silence = self.silence.next(&self.expansion);
        // At least 1 ns later, or `follow` would not advance.
        let after = |seconds: f64| self.at + Duration::from_nanos((seconds * 1e9).max(1.0) as u64);
        [edge.map(after), silence.map(after)].into_iter().fold(self.next_decision, earlier)
    }

    /// Looks at all inputs and decides again.
    fn decide(&mut self, od: &mut Dictionary) {
        let elapsed = self.at.since(self.decided).as_secs_f64();
        (self.decided, self.next_decision) = (self.at, None);
        if std::mem::take(&mut self.changed) {
            self.hear(od);
        }
        self.look();
        self.obey(od);
        let (settings, rules) = (&self.settings, &*self.rules);
        let mut outcome = self.controller.decide(&self.inputs, settings, elapsed, rules);
        if let Some(found) = outcome.found {
            self.memory.tuned(found, od, &self.rules);
            od.set_int(TUNING, self.controller.tuning(&self.settings));
            self.configure(od);
            // It controls with what was found from now on, and not by the old parameters once more.
            outcome = self.controller.decide(&self.inputs, &self.settings, 0.0, &self.rules);
        }
        self.show_outcome(outcome, od);
        self.memory.keep(od);
        // What was measured belongs to an output that has changed since.
        self.changed |= self.controller.switched_load(&self.settings);
        let between = self.rules.control_cycle();
        let wait = match self.is_settled() {
            true => self
                .controller
                .left(&self.settings)
                .map(|left| Duration::from_secs_f64(left.max(0.0))),
            false => Some(between),
        };
        self.next_decision = wait.map(|wait| self.at + wait.max(between));
    }

    /// Takes the values that the network has written.
    fn hear(&mut self, od: &Dictionary) {
        let number = |mux| value(od, mux);
        let limit = |alarm| number(self.rules.alarm_set_point(alarm));
        self.inputs = Inputs {
            set_point: number(SET_POINT),
            limits: [limit(0), limit(1)],
            running: self.rules.controls(number(START) == 1),
            manual: number(MANUAL) == 1,
            output: number(OUTPUT) as f64 / FULL_OUTPUT,
            remote: REMOTE_ALARMS.map(|mux| self.rules.remote_alarm(number(mux))),
            retransmitted: number(RETRANSMITTED),
            ..self.inputs
        };
    }

    /// Takes the inputs at the terminals.
    fn look(&mut self) {
        let mut connected = self.around.connected;
        if self.around.in_process {
            connected.celsius = self.load.sensor();
        }
        let around = &self.around;
        self.inputs = Inputs {
            connected,
            terminals: around.terminals,
            milliamperes: around.milliamperes,
            faults: around.faults,
            offline: self.silence.is_offline(&self.expansion),
            test: self.panel.is_pressed() && self.rules.key_enables(),
            ..self.inputs
        };
    }

    /// In expansion mode the master has the outputs, until it is lost.
    fn obey(&mut self, od: &mut Dictionary) {
        self.inputs.master = self.expansion.enabled.then(|| {
            self.io.drive(od);
            let (outputs, analogue) = self.commanded();
            self.expansion.connect(outputs, analogue, &self.rules)
        });
    }

    /// 6200h and 6411h as the outputs of an expansion module follow them.
    fn commanded(&self) -> (i64, i64) {
        let outputs = self.rules.driven(self.io.digital_output(0));
        (outputs, self.io.analogue_output(0).unwrap_or(0))
    }

    /// An error of the device or silence sets the outputs of an expansion module.
    fn commute(&mut self, od: &mut Dictionary) {
        if !self.expansion.enabled {
            return;
        }
        self.io.drive(od);
        let (outputs, analogue) = self.expansion.in_error(self.commanded(), &self.rules);
        for (mux, value) in [(MASTER_OUTPUTS, outputs), (MASTER_ANALOGUE, analogue)] {
            od.set_int(mux, value);
            self.io.written(self.at, mux, od);
        }
    }

    /// Whether nothing changes until something happens outside.
    fn is_settled(&self) -> bool {
        let rests = self.load.rests(self.controller.drive(&self.settings));
        (rests || !self.around.in_process)
            && self.controller.is_settled(&self.settings, &self.rules)
    }

    /// The objects of what was decided.
    fn show_outcome(&mut self, outcome: Outcome, od: &mut Dictionary) {
        let share = |share: f64| (share * FULL_OUTPUT).round() as i64;
        self.io.measure(PROCESS_INPUT, outcome.process, od);
        let (command, alarms) = self.controller.resettable(&self.rules);
        let shown = [
            (COLD_OUTPUT, share(outcome.cooling)),
            (COLD_JUNCTION, (self.around.terminals * 10.0).round() as i64),
            (ERROR_FLAGS, outcome.flags),
            (REAL_SET_POINT, outcome.set_point),
            (COMMAND_RESET, command),
            (ALARMS_RESET, alarms),
            (Mux::new(LATCH_ON, 1), self.controller.latch().is_enabled().into()),
        ];
        shown.into_iter().for_each(|(mux, value)| od.set_int(mux, value));
        // Without tuning, 400Eh has no meaning.
        if parameter(od, TUNE) != 0 {
            od.set_int(TUNING, self.controller.tuning(&self.settings));
        }
        if outcome.manual {
            od.set_int(MANUAL, 1);
        }
        if outcome.manual || self.rules.sets_output() {
            od.set_int(OUTPUT, share(outcome.output));
        }
        (self.inputs.manual, self.inputs.output) = (value(od, MANUAL) == 1, outcome.output);
        let commutes = outcome.error && !self.outcome.error && self.rules.errors_commute();
        let falls_silent = self.inputs.offline && !self.outcome.offline;
        self.outcome = outcome;
        if commutes || falls_silent {
            self.commute(od);
            self.changed = true;
        }
        self.news = true;
    }

    /// 4009h follows the outputs between two decisions as well.
    fn show_outputs(&mut self, od: &mut Dictionary) {
        let [q1, q2] = self.controller.terminals().contacts;
        let outputs = self.rules.outputs_status(q1, q2);
        if value(od, OUTPUTS) != outputs {
            od.set_int(OUTPUTS, outputs);
            self.news = true;
        }
    }

    /// The states of the output terminals.
    fn terminals(&self) -> Terminals {
        if self.powered { self.controller.terminals() } else { Terminals::default() }
    }

    /// The network had to do with the device.
    fn meet(&mut self, reads: bool) {
        if self.rules.ends_silence(reads) {
            self.changed |= self.silence.is_offline(&self.expansion);
            self.silence.end();
        }
    }

    /// Handles the objects with a special effect that the network has written.
    fn take(&mut self, mux: Mux, od: &mut Dictionary) {
        let written = value(od, mux);
        match mux {
            COMMAND_RESET if self.rules.resets(written) => self.controller.reset_command(),
            ALARMS_RESET if self.rules.resets(written) => self.controller.reset_alarms(&self.rules),
            TUNING if self.rules.obeys_tuning(written) => {
                let sight = (self.outcome.process, value(od, SET_POINT));
                self.controller.command_tuning(written, sight, &self.settings);
            }
            STORE => {
                self.found.not_stored = !self.controller.store(self.around.faults);
                self.found.changed_hardware = false;
                self.memory.module = self.around.module;
            }
            RESTORE => {
                self.memory.forget();
                self.controller.forget();
            }
            Mux { index: LATCH_ON, sub } if !self.rules.learns(sub) => {}
            Mux { index: LATCH_ON, sub } => {
                self.controller.command_latch(sub, written as u8, &self.rules);
                od.set_int(mux, self.rules.latch_command_reads(written));
            }
            Mux { index: PARAMETERS, sub } => {
                if sub == COOLING_FLUID {
                    self.preset(written, od);
                }
                if sub == TUNE {
                    self.memory.tune_again();
                }
                if !self.rules.same_parameter_changes_nothing(sub) {
                    self.controller.select_again(sub);
                }
                self.configure(od);
            }
            _ => {}
        }
    }

    /// The key was pressed long enough: the present current becomes the threshold.
    fn teach(&mut self, od: &mut Dictionary) {
        if self.panel.teaches(self.at, &self.rules) {
            let threshold = self.controller.taught(&self.rules);
            if let Some(threshold) = threshold {
                set_parameter(od, HEATER_BREAK, threshold);
                self.configure(od);
                self.changed = true;
            }
            self.panel.taught(threshold.is_some());
        }
    }

    /// Raises the errors that are present, and ends the others.
    fn report(&mut self, now: Instant, errors: &mut Errors) {
        let is_event = !self.rules.overflow_lasts() && self.overflow_ends.take().is_some();
        self.overflow_ends = self.overflow_ends.filter(|end| now < *end);
        let module = match self.rules.reports_module() {
            true => self.around.module,
            false => Module::Fitted,
        };
        let bus = self.around.bus.present(self.overflow_ends);
        let found = Found {
            no_process: self.outcome.error && self.rules.reports_sensor(),
            unread: self.found.unread.filter(|_| self.rules.reports_memory()),
            ..self.found
        };
        if std::mem::take(&mut self.reports_boot) {
            let boot = emergency::BOOT;
            errors.raise(boot.error, boot.code, boot.register, boot.vendor);
            errors.clear(boot.error);
        }
        emergency::tell(found, bus, module, errors);
        if is_event {
            emergency::mention(self.around.bus, errors);
        }
    }

    fn light(&mut self, now: Instant, error: bool) {
        let shown = Shown {
            node: (self.state, error),
            contacts: self.controller.terminals().contacts,
            error: self.outcome.flags != 0,
            command_on_q1: Controller::command_is_on_q1(&self.settings),
            loads_defaults: self.rules.shows_loading(self.loading, self.loads_defaults()),
        };
        self.panel.show(now, &shown, &self.rules);
    }

    /// Before a bench sets them, the switches are as the device was given its node-ID and its bit
    /// rate.
    fn set_switches(&mut self, od: &mut Dictionary) {
        if self.bus_rate.is_none() {
            let rate = value(od, BIT_RATE);
            let address = value(od, NODE_ID) as u8;
            self.around.switches = Switches { address, rate: (rate + 1) as u8 };
            self.read = self.around.switches;
            self.bus_rate = Some(rate);
        }
        let code = Parameters::of(od, &self.rules).get(BIT_RATE_CODE);
        let rate = self.switches().rate(code);
        od.set_int(BIT_RATE, rate);
    }

    /// The switches as they are in force, or will be at the power-on under way.
    fn switches(&self) -> Switches {
        let reads = !self.powered || self.rules.reset_reads_switches();
        if reads { self.around.switches } else { self.read }
    }
}

impl Behaviour for Drr460 {
    fn reset(&mut self, now: Instant, od: &mut Dictionary) {
        if !self.powered || self.rules.switches_act_at_once() {
            self.read = self.around.switches;
        }
        let compares = !self.powered || self.rules.reset_node_compares_boards();
        if std::mem::replace(&mut self.powered, true) {
            self.follow(now, od);
        } else {
            self.load.advance(Drive::default(), now.since(self.at).as_secs_f64());
        }
        (self.at, self.decided) = (now, now);
        self.io.reset(now, od);
        self.set_switches(od);
        self.loading = self.loads_defaults();
        if self.loading {
            self.memory.forget();
            self.controller.forget();
        }
        self.memory.give_back(od, &self.rules);
        self.configure_at_power_on(od);
        self.controller.restart(&self.settings, self.around.faults, &self.rules);
        self.found = Found {
            changed_hardware: compares && self.around.module.differs(self.memory.module),
            not_stored: false,
            unread: match self.around.faults.memory {
                MemoryFault::AtPowerOn(bit) => {
                    bit.checked_sub(FIRST_PART - 1).filter(|part| *part > 0)
                }
                _ => None,
            },
            ..Found::default()
        };
        if self.rules.sets_initial_values(self.expansion.enabled) {
            od.set_int(MASTER_OUTPUTS, self.expansion.initial_outputs);
            od.set_int(MASTER_ANALOGUE, self.expansion.initial_analogue);
        }
        self.silence.end();
        self.state = NmtState::INITIALISING;
        self.outcome = Outcome::default();
        self.changed = true;
        self.decide(od);
        self.show_outputs(od);
    }

    fn supply_lost(&mut self) {
        self.powered = false;
        self.panel.go_dark();
        self.io.supply_lost();
    }

    fn attachment(&self, od: &Dictionary) -> Attachment {
        let parameters = Parameters::of(od, &self.rules);
        let configured = [ADDRESS, BIT_RATE_CODE].map(|sub| parameters.get(sub));
        match self.bus_rate {
            Some(bus) if self.switched => {
                self.rules.attachment(self.switches(), configured.into(), bus)
            }
            _ => Attachment::AsIs,
        }
    }

    fn loads_defaults(&self) -> bool {
        self.rules.loads_defaults(self.switches())
    }

    fn takes_restart(&mut self) -> bool {
        std::mem::take(&mut self.restarts)
    }

    fn show(&mut self, now: Instant, od: &mut Dictionary) {
        self.follow(now, od);
    }

    fn check(&self, mux: Mux, bytes: &[u8], od: &Dictionary) -> Result<(), Abort> {
        match (mux, bytes) {
            (TUNING, [value]) => {
                let soft_start = parameter(od, SOFT_START) != 0;
                self.rules.tuning_accepts(parameter(od, TUNE), soft_start, *value)
            }
            (OUTPUT, _) if !self.rules.output_accepts(value(od, MANUAL) == 1) => {
                Err(Abort::DEVICE_STATE)
            }
            (BOOT_STATE, [low, high]) => {
                let state = i16::from_le_bytes([*low, *high]).into();
                if self.rules.takes_boot_state(state) { Ok(()) } else { Err(Abort::VALUE) }
            }
            (Mux { index: LATCH_ON, sub }, [value]) => {
                let accepted = self.controller.latch().accepts(sub, *value, self.settings.latch());
                if accepted { Ok(()) } else { Err(Abort::DEVICE_STATE) }
            }
            (STORE, _) if self.around.faults.memory == MemoryFault::Write => Err(Abort::HARDWARE),
            _ => Ok(()),
        }
    }

    fn written(&mut self, now: Instant, mux: Mux, od: &mut Dictionary) {
        self.changed = true;
        self.meet(false);
        self.take(mux, od);
        // A value for an output ends the effect of a communication error on it.
        self.io.written(now, mux, od);
    }

    fn refused(&mut self, _now: Instant, mux: Mux, _bytes: &[u8], _od: &mut Dictionary) {
        self.meet(false);
        if mux == STORE && self.around.faults.memory == MemoryFault::Write {
            self.found.not_stored = !self.controller.store(self.around.faults);
            self.changed = true;
        }
    }

    fn uploaded(&mut self, mux: Mux, od: &mut Dictionary) {
        self.meet(true);
        if mux == TUNING {
            self.controller.tuning_read();
        }
        self.io.uploaded(mux, od);
    }

    fn event(&mut self, now: Instant, event: CommunicationEvent, od: &mut Dictionary) {
        self.follow(now, od);
        self.changed = true;
        if event == CommunicationEvent::Reset {
            let differs = self.around.module.differs(self.memory.module);
            self.found.changed_hardware |=
                differs && self.rules.reset_communication_compares_boards();
        }
        if let CommunicationEvent::Entered(state) = event {
            if self.state == NmtState::INITIALISING && self.rules.reports_boot() {
                self.reports_boot = true;
            }
            self.state = state;
            self.meet(false);
        }
        // Otherwise the outputs are the controller's own, and the network does not control them.
        if self.expansion.enabled {
            self.io.event(now, event, od);
        }
    }

    fn run(&mut self, now: Instant, od: &mut Dictionary, errors: &mut Errors) {
        self.follow(now, od);
        self.teach(od);
        for _ in 0..2 {
            // A decision that changes the outputs of the master needs another decision.
            if self.changed {
                self.decide(od);
                self.show_outputs(od);
            }
        }
        self.report(now, errors);
        self.light(now, errors.register() != 0);
        self.news = false;
    }

    fn poll_at(&self) -> Option<Instant> {
        let now = (self.news || self.changed).then_some(self.at);
        let rest = [self.panel.poll_at(&self.rules), self.overflow_ends, now];
        rest.into_iter().fold(self.next_step(), earlier)
    }

    fn bench_names(&self) -> Vec<String> {
        Self::names().map(str::to_owned).collect()
    }

    fn stimulate(
        &mut self,
        now: Instant,
        name: &str,
        value: &Value,
        od: &mut Dictionary,
    ) -> Result<(), BenchError> {
        if self.powered {
            self.follow(now, od);
        }
        self.changed = true;
        self.set(now, name, value)
    }

    fn observe(&self, name: &str, _od: &Dictionary) -> Option<Value> {
        self.see(name)
    }

    fn other_figures(&self) -> usize {
        self.others.len()
    }

    fn take_figures(&mut self, place: usize) {
        self.rules = Arc::clone(&self.others[place]);
    }

    fn has_edges(&self, mux: Mux) -> bool {
        self.io.has_edges(mux)
    }

    fn holds_back(&self, mux: Mux, od: &Dictionary) -> bool {
        self.io.holds_back(mux, od)
    }

    fn triggers(&mut self, mux: Mux, last: &[u8], od: &Dictionary) -> bool {
        let any = self.rules.transmits_any_change() || mux.index == ANALOGUE_INPUTS;
        any && self.io.triggers(mux, last, od)
    }
}

/// The state after boot-up.
const BOOT_STATE: Mux = Mux::new(0x2000, 3);
/// The object of the analogue inputs.
const ANALOGUE_INPUTS: u16 = 0x6401;
/// The analogue input of the process value.
const PROCESS_INPUT: usize = 0;
/// 100 % in hundredths of a per cent.
const FULL_OUTPUT: f64 = 10_000.0;
/// The bit of 4007h of the first part of the EEPROM.
const FIRST_PART: u8 = 16;

const COOLING_FLUID: u8 = 41;
const COOLING_MULTIPLIER: u8 = 42;
const COOLING_CYCLE: u8 = 44;
const SOFT_START: u8 = 80;
const HEATER_BREAK: u8 = 92;
const ADDRESS: u8 = 111;
const BIT_RATE_CODE: u8 = 112;

#[cfg(test)]
mod tests;
