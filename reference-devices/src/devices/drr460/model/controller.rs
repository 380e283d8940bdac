//! The controller: everything between the terminals of the inputs and those of the outputs.
//!
//! It decides once in a period. Between two decisions only cycles and valves move.

use super::alarm::{self, Alarm};
use super::current::{self, Transformer};
use super::cycle::{Cycle, Wanted};
use super::decision::{Inputs, Outcome};
use super::flags::{self, Faults, Flags};
use super::latch::{self, Latch};
use super::load::Drive;
use super::on_off::{self, OnOff};
use super::parameters::Parameters;
use super::pid::{self, Pid};
use super::reading::{self, Input};
use super::retransmission::{self, Sources};
use super::rules::Rules;
use super::soft_start::{self, SoftStart};
use super::state::State;
use super::tuning::{self, Found, Tuning};
use super::valve::Valve;
use super::wiring::{Command, Functions, Terminals, Wiring};

/// Every parameter, ready for use.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Settings {
    reading: reading::Settings,
    wiring: Wiring,
    on_off: on_off::Settings,
    /// `None` selects on/off control.
    pid: Option<pid::Settings>,
    alarms: [alarm::Settings; 2],
    soft_start: soft_start::Settings,
    tuning: tuning::Settings,
    current: current::Settings,
    retransmission: retransmission::Settings,
    cools: bool,
    error: State,
    stop: State,
    /// Parameter 25.
    manual: i64,
    /// In seconds: of the command, of cooling, and of the valve from end to end.
    cycle: f64,
    cooling_cycle: f64,
    travel: f64,
    is_thermocouple: bool,
}

impl Settings {
    pub(crate) fn of(parameters: &Parameters) -> Self {
        let alarms = [0, 1].map(|number| alarm::Settings::of(number, parameters));
        let cools = parameters.cools();
        let double_loop = !cools && alarms.iter().any(alarm::Settings::cools);
        let is_on_off = pid::Settings::is_on_off(parameters);
        let reading = reading::Settings::of(parameters);
        Self {
            reading,
            wiring: Wiring::of(parameters),
            on_off: on_off::Settings::of(parameters),
            pid: (!is_on_off).then(|| pid::Settings::of(parameters, double_loop)),
            alarms,
            soft_start: soft_start::Settings::of(parameters),
            tuning: tuning::Settings::of(parameters),
            current: current::Settings::of(parameters),
            retransmission: retransmission::Settings::of(parameters),
            cools,
            error: State(parameters.get(20)),
            stop: State(parameters.get(21)),
            manual: parameters.get(25),
            cycle: parameters.seconds(40).max(1.0),
            cooling_cycle: parameters.seconds(44).max(1.0),
            travel: parameters.seconds(24).max(1.0),
            is_thermocouple: reading.sensor.is_thermocouple(),
        }
    }
}

impl Settings {
    /// Those of latch-on.
    pub(crate) const fn latch(&self) -> &latch::Settings {
        &self.reading.latch
    }
}

/// The measured values.
#[derive(Clone, Copy, Debug)]
struct Measured {
    process: i64,
    sensor_error: bool,
    flags: i64,
    error: bool,
}

/// The controller.
#[derive(Clone, Debug, Default)]
pub(crate) struct Controller {
    input: Input,
    alarms: [Alarm; 2],
    on_off: OnOff,
    tuning: Tuning,
    transformer: Transformer,
    flags: Flags,
    pid: Pid,
    soft_start: SoftStart,
    valve: Valve,
    cycles: Cycles,
    running: bool,
    /// It has been in START since power-on.
    has_run: bool,
    last_set_point: i64,
    last_real_set_point: i64,
    /// A share of full output.
    output: f64,
    cooling: f64,
    was_manual: bool,
    /// The sensor was broken at the last decision.
    was_broken: bool,
    /// The sensor is broken, as 4007h shows it.
    broken: bool,
    /// PID control has the command.
    is_automatic: bool,
    functions: Option<Functions>,
    terminals: Terminals,
    /// The output of the load that is measured is on, with the wiring that the terminals have.
    load_is_on: bool,
}

/// The cycles of the command and of the alarms.
#[derive(Clone, Copy, Debug, Default)]
struct Cycles {
    command: Cycle,
    alarms: Cycle,
}

impl Cycles {
    /// The cycle of cooling by an alarm, counted from 0, and its seconds.
    fn of_alarm(&self, place: usize, settings: &Settings, rules: &Rules) -> (Cycle, f64) {
        match rules.cools_in_the_cycle_of_heating(place) {
            true => (self.command, settings.cycle),
            false => (self.alarms, settings.cooling_cycle),
        }
    }
}

impl Controller {
    /// Decides again; `elapsed` are the seconds since the last decision.
    pub(crate) fn decide(
        &mut self,
        inputs: &Inputs,
        settings: &Settings,
        elapsed: f64,
        rules: &Rules,
    ) -> Outcome {
        let measured = self.measure(inputs, settings, elapsed, rules);
        let Measured { process, error, .. } = measured;
        if let Some(master) = inputs.master {
            return self.expand(master, measured, inputs, settings, rules);
        }
        let set_point = self.set_point(inputs, process, settings, rules);
        let broken = rules.is_break(measured.sensor_error, error);
        let sight = Sight { process, set_point, error, broken };
        let (command, manual, found) = self.command(inputs, &sight, settings, elapsed, rules);
        let sources = Sources {
            process,
            set_point,
            alarms: inputs.limits,
            amperes: self.transformer.amperes(),
            remote: inputs.retransmitted,
            error,
            running: inputs.running,
        };
        let works = rules.alarms_work(manual);
        self.functions = Some(Functions {
            command,
            command_closed: false,
            valve: self.valve.motion(),
            alarms: self.alarms(inputs, &sight, (measured.sensor_error, works), settings, rules),
            alarms_closed: [false; 2],
            retransmitted: retransmission::microamperes(&sources, &settings.retransmission, rules),
        });
        self.connect(settings, rules);
        let (output, cooling) = (self.output, self.cooling);
        let (flags, offline) = (measured.flags, inputs.offline);
        Outcome { process, flags, set_point, output, cooling, manual, found, error, offline }
    }

    /// The measured values, whether controller or master has the outputs.
    fn measure(
        &mut self,
        inputs: &Inputs,
        settings: &Settings,
        elapsed: f64,
        rules: &Rules,
    ) -> Measured {
        let connected = (inputs.connected, inputs.terminals);
        let reading = self.input.sample(connected, &settings.reading, elapsed, rules);
        let current = (inputs.milliamperes, self.load_is_on);
        self.transformer.step(current, &settings.current, rules);
        let repaired = rules.repair_is_seen(inputs.running, self.was_manual);
        self.broken = reading.is_error || self.broken && !repaired;
        let seen = (self.broken, settings.is_thermocouple, inputs.terminals);
        let flags = self.flags.shown(inputs.faults, seen, rules) | self.transformer.flags(rules);
        let is_error = flags::is_error(flags, settings.is_thermocouple, rules);
        Measured {
            process: reading.process,
            sensor_error: reading.is_error,
            flags,
            error: is_error,
        }
    }

    /// Whether the output of the load is in another state than when the load was measured last.
    pub(crate) fn switched_load(&self, settings: &Settings) -> bool {
        settings.current.enabled && self.transformer.was_on() != self.load_is_on
    }

    /// The master has the outputs, and nothing is controlled.
    fn expand(
        &mut self,
        master: Terminals,
        measured: Measured,
        inputs: &Inputs,
        settings: &Settings,
        rules: &Rules,
    ) -> Outcome {
        self.functions = None;
        self.terminals = master;
        self.load_is_on = master.contacts[settings.current.output];
        self.running = false;
        self.output = 0.0;
        self.cooling = 0.0;
        self.tuning.abandon();
        let Measured { flags, error, .. } = measured;
        let broken = rules.is_break(measured.sensor_error, error);
        let breaks = self.breaks(broken, false, settings, rules) && rules.break_is_kept();
        let process = if rules.shows_process(true) { measured.process } else { 0 };
        let (set_point, offline) = (inputs.set_point, inputs.offline);
        let manual = inputs.manual || breaks;
        Outcome { process, flags, set_point, manual, error, offline, ..Outcome::default() }
    }

    fn alarms(
        &mut self,
        inputs: &Inputs,
        sight: &Sight,
        (sensor_error, works): (bool, bool),
        settings: &Settings,
        rules: &Rules,
    ) -> [Wanted; 2] {
        let current_error = self.transformer.is_error(rules);
        let cooling = self.cooling;
        [0, 1].map(|number| {
            let seen = alarm::Sight {
                process: sight.process,
                set_point: sight.set_point,
                limit: inputs.limits[number],
                wanted: inputs.set_point,
                error: sight.error,
                sensor_error,
                running: inputs.running && works,
                remote: inputs.remote[number],
                current_error,
                cooling,
            };
            self.alarms[number].step(&seen, &settings.alarms[number], rules)
        })
    }

    /// Advances the time without a decision: cycles and the valve move, and delays run.
    pub(crate) fn advance(&mut self, elapsed: f64, settings: &Settings, rules: &Rules) {
        self.cycles.command.advance(elapsed, settings.cycle);
        self.cycles.alarms.advance(elapsed, settings.cooling_cycle);
        self.valve.advance(elapsed, settings.travel);
        self.input.latch.advance(elapsed, &settings.reading.latch);
        self.alarms.iter_mut().for_each(|alarm| alarm.advance(elapsed));
        self.on_off.advance(elapsed);
        self.soft_start.advance(elapsed);
        self.tuning.advance(elapsed);
        self.transformer.advance(elapsed);
        self.connect(settings, rules);
    }

    /// Seconds up to the end of the delay or soft start that ends first; above 0 or not.
    pub(crate) fn left(&self, settings: &Settings) -> Option<f64> {
        let alarms = self.alarms.iter().filter_map(Alarm::left);
        let start = self.soft_start.left(&settings.soft_start);
        alarms.chain(self.on_off.left()).chain(start).reduce(f64::min)
    }

    /// Whether another decision would be the same as the last one if nothing happens outside,
    /// until a delay or a soft start [ends](Self::left).
    pub(crate) fn is_settled(&self, settings: &Settings, rules: &Rules) -> bool {
        let is_under_way = self.soft_start.moves() || !self.tuning.rests();
        let watches = settings.current.enabled || self.input.latch.is_enabled();
        let controls = settings.pid.as_ref().is_some_and(|pid| !self.pid.is_settled(pid));
        let moves = controls && self.is_automatic;
        self.input.is_settled(&settings.reading, rules) && !is_under_way && !watches && !moves
    }

    /// The states of the terminals.
    pub(crate) const fn terminals(&self) -> Terminals {
        self.terminals
    }

    /// Whether the command is on Q1, or on neither digital output.
    pub(crate) fn command_is_on_q1(settings: &Settings) -> bool {
        settings.wiring.command != Command::Analogue
    }

    /// Seconds until an output changes without a decision.
    pub(crate) fn next(&self, settings: &Settings, rules: &Rules) -> Option<f64> {
        let functions = self.functions.as_ref()?;
        let command = match settings.wiring.command {
            Command::Contact => {
                let wanted = self.cycles.command.held(functions.command);
                self.cycles.command.next(wanted, settings.cycle, rules)
            }
            Command::Valve => {
                let wanted = valve_target(functions.command, rules);
                self.valve.next(wanted, settings.travel)
            }
            Command::Analogue => None,
        };
        let alarms = functions.alarms;
        let cooling = alarms.iter().enumerate().filter_map(|(place, alarm)| {
            let (cycle, period) = self.cycles.of_alarm(place, settings, rules);
            cycle.next(*alarm, period, rules)
        });
        command.into_iter().chain(cooling).reduce(f64::min)
    }

    /// The effect of the outputs on the load.
    pub(crate) fn drive(&self, settings: &Settings) -> Drive {
        let share = |current: f64| {
            let zero = settings.wiring.lowest();
            ((current - zero) / (20_000.0 - zero)).clamp(0.0, 1.0)
        };
        let closed = |contact: usize| f64::from(u8::from(self.terminals.contacts[contact]));
        let analogue = share(self.terminals.microamperes);
        let (command, alarms) = match settings.wiring.command {
            Command::Contact => (closed(0), [closed(1), analogue]),
            Command::Valve => (self.valve.at(), [analogue, 0.0]),
            Command::Analogue => (analogue, [closed(0), closed(1)]),
        };
        if settings.cools {
            return Drive { heating: 0.0, cooling: command };
        }
        let cooling = alarms.iter().zip(&settings.alarms).filter(|(_, alarm)| alarm.cools());
        Drive { heating: command, cooling: cooling.map(|(share, _)| *share).fold(0.0, f64::max) }
    }

    /// The device was switched on; its parts restore the values that it keeps.
    pub(crate) fn restart(&mut self, settings: &Settings, faults: Faults, rules: &Rules) {
        let mut input = std::mem::take(&mut self.input);
        input.restart();
        if !rules.latch_lasts() {
            input.latch = Latch::default();
        }
        let (mut alarms, mut on_off, mut flags) = (self.alarms, self.on_off, self.flags);
        alarms.iter_mut().zip(&settings.alarms).for_each(|(alarm, set)| alarm.restart(set));
        on_off.restart(&settings.on_off);
        flags.restart(faults, rules);
        *self = Self { input, alarms, on_off, flags, valve: self.valve, ..Self::default() };
    }

    /// The set point in force; the controller may just have started, or have a new set point.
    fn set_point(
        &mut self,
        inputs: &Inputs,
        process: i64,
        settings: &Settings,
        rules: &Rules,
    ) -> i64 {
        let wanted = inputs.set_point;
        let starts = inputs.running && !self.running;
        if starts && rules.soft_starts(self.has_run) {
            self.soft_start = SoftStart::begin(process, &settings.soft_start);
        }
        let occasion = wanted != self.last_set_point || rules.any_gap_tunes();
        if starts || inputs.running && occasion {
            self.tuning.started(starts, (process, wanted), &settings.tuning, rules);
        }
        self.running = inputs.running;
        self.has_run |= inputs.running;
        self.last_set_point = wanted;
        if !inputs.running {
            return self.soft_start.interrupted(wanted, &settings.soft_start, rules);
        }
        self.soft_start.set_point(wanted, process, &settings.soft_start, rules)
    }

    /// The demand for the command, whether the mode is manual, and the result of a tuning.
    fn command(
        &mut self,
        inputs: &Inputs,
        sight: &Sight,
        settings: &Settings,
        elapsed: f64,
        rules: &Rules,
    ) -> (Wanted, bool, Option<Found>) {
        let asked = rules.manual(settings.manual, inputs.manual);
        let breaks = self.breaks(sight.broken, inputs.running, settings, rules);
        let manual = asked || breaks;
        (self.cooling, self.is_automatic) = (0.0, false);
        let goes_on = asked && rules.manual_goes_on_in_stop();
        if !inputs.running && !goes_on || inputs.offline {
            self.tuning.abandon();
            self.on_off.restart(&settings.on_off);
            if rules.stop_ends_integral() {
                self.pid = Pid::default();
            }
            self.output = if asked { inputs.output } else { 0.0 };
            let fails = sight.error && rules.error_goes_before_stop();
            let stopped = Wanted::State(if fails { settings.error } else { settings.stop });
            let off = if inputs.running { Wanted::Share(0.0) } else { stopped };
            let shown =
                asked || breaks && rules.break_is_kept() && rules.break_counts_without_control();
            return (if inputs.test { Wanted::Level(true) } else { off }, shown, None);
        }
        let (command, found) = if manual {
            self.tuning.abandon();
            // The network may have written the output; the output left by a broken sensor stays.
            self.output = if asked { inputs.output } else { self.output };
            self.was_manual = true;
            (Wanted::Share(self.output), None)
        } else if sight.error && rules.errors_concern(settings.pid.is_some()) {
            if rules.error_ends_tuning() {
                self.tuning.abandon();
            }
            self.output = 0.0;
            (Wanted::State(settings.error), None)
        } else {
            self.tuned(sight, settings, elapsed, rules)
        };
        let shown = asked || breaks && rules.break_is_kept();
        (if inputs.test { Wanted::Level(true) } else { command }, shown, found)
    }

    /// Whether the sensor breaks and leads to manual mode.
    fn breaks(&mut self, broken: bool, controls: bool, settings: &Settings, rules: &Rules) -> bool {
        let is_new = !std::mem::replace(&mut self.was_broken, broken);
        broken
            && (is_new || rules.lasting_break_counts())
            && rules.break_leads_to_manual(settings.manual)
            && (controls || rules.break_counts_without_control())
    }

    /// The command of automatic mode, which a tuning may have.
    fn tuned(
        &mut self,
        sight: &Sight,
        settings: &Settings,
        elapsed: f64,
        rules: &Rules,
    ) -> (Wanted, Option<Found>) {
        let step = self.tuning.step(sight.process, &settings.tuning, elapsed);
        self.output = match step.forced {
            Some(on) => {
                // It controls anew then, with the parameters that were found.
                if rules.other_control_ends_integral() {
                    self.pid = Pid::default();
                }
                f64::from(u8::from(on))
            }
            None => self.automatic(sight, settings, elapsed, rules),
        };
        self.was_manual = false;
        (Wanted::Share(self.output), step.found)
    }

    fn automatic(
        &mut self,
        sight: &Sight,
        settings: &Settings,
        elapsed: f64,
        rules: &Rules,
    ) -> f64 {
        let direction = if settings.cools { -1 } else { 1 };
        let missing = direction * (sight.set_point - sight.process);
        let moved = direction * (sight.set_point - self.last_real_set_point);
        self.last_real_set_point = sight.set_point;
        let output = match &settings.pid {
            None => {
                if rules.other_control_ends_integral() {
                    self.pid = Pid::default();
                }
                f64::from(u8::from(self.on_off.step(missing, &settings.on_off, rules)))
            }
            Some(pid) => {
                if self.was_manual {
                    self.pid.restart(self.output, pid);
                }
                self.is_automatic = true;
                let outputs = self.pid.step((missing, moved), pid, elapsed, rules);
                self.cooling = outputs.cooling;
                outputs.command
            }
        };
        self.soft_start.output(&settings.soft_start).unwrap_or(output)
    }

    /// The command output is reset by hand, as 400Ah asks for (11.3.13).
    pub(crate) const fn reset_command(&mut self) {
        self.on_off.reset();
    }

    /// What this parameter of 3000h selects begins anew, as if it were selected now.
    pub(crate) fn select_again(&mut self, sub: u8) {
        match sub {
            1 => self.input.select_again(),
            31 => self.tuning.select_again(),
            56 => self.alarms[0].select_again(),
            68 => self.alarms[1].select_again(),
            80 => self.soft_start.select_again(),
            _ => {}
        }
    }

    /// The alarms are reset by hand, as 400Bh asks for (11.3.14).
    pub(crate) fn reset_alarms(&mut self, rules: &Rules) {
        self.alarms.iter_mut().for_each(Alarm::reset);
        if !rules.current_flags_end() {
            self.transformer.reset();
        }
    }

    /// The values of 400Ah and 400Bh.
    pub(crate) fn resettable(&self, rules: &Rules) -> (i64, i64) {
        let [first, second] = self.alarms.map(|alarm| i64::from(alarm.resettable(rules)));
        (self.on_off.resettable(rules).into(), first | second << 1)
    }

    /// The value of 400Eh.
    pub(crate) const fn tuning(&self, settings: &Settings) -> i64 {
        self.tuning.shown(&settings.tuning)
    }

    /// The master has written 400Eh; a tuning begins at this process value.
    pub(crate) fn command_tuning(&mut self, value: i64, sight: (i64, i64), settings: &Settings) {
        self.tuning.command(value, sight, &settings.tuning);
    }

    /// The master has read 400Eh.
    pub(crate) const fn tuning_read(&mut self) {
        self.tuning.read();
    }

    /// Latch-on, and its settings.
    pub(crate) const fn latch(&self) -> &Latch {
        &self.input.latch
    }

    /// 4011h `sub` was written.
    pub(crate) fn command_latch(&mut self, sub: u8, value: u8, rules: &Rules) {
        let share = match sub {
            4 => rules.virtual_zero(self.input.share),
            _ => self.input.share,
        };
        self.input.latch.command(sub, value, share);
    }

    /// Forgets what latch-on learned.
    pub(crate) fn forget(&mut self) {
        self.input.latch = Latch::default();
    }

    /// The device writes its EEPROM. Returns whether it can.
    pub(crate) fn store(&mut self, faults: Faults) -> bool {
        self.flags.write(faults)
    }

    /// The threshold of heater break that the key teaches now, in tenths of an ampere.
    pub(crate) fn taught(&self, rules: &Rules) -> Option<i64> {
        self.transformer.taught(rules)
    }

    /// Puts what is wanted on the terminals, as it is in its cycle now.
    fn connect(&mut self, settings: &Settings, rules: &Rules) {
        let Some(functions) = &mut self.functions else { return };
        let wanted = self.cycles.command.hold(functions.command, rules);
        functions.command_closed = self.cycles.command.is_closed(wanted, settings.cycle, rules);
        functions.alarms_closed = std::array::from_fn(|place| {
            let (cycle, period) = self.cycles.of_alarm(place, settings, rules);
            cycle.is_closed(functions.alarms[place], period, rules)
        });
        if settings.wiring.command == Command::Valve {
            self.valve.go_to(valve_target(functions.command, rules));
        }
        functions.valve = self.valve.motion();
        self.terminals = settings.wiring.connect(functions, rules);
        self.load_is_on = match settings.wiring.command {
            Command::Contact | Command::Valve => self.terminals.contacts[0],
            Command::Analogue => self.terminals.microamperes > settings.wiring.lowest(),
        };
    }
}

/// The inputs of the command.
struct Sight {
    process: i64,
    set_point: i64,
    error: bool,
    /// The sensor is broken, or its value out of range.
    broken: bool,
}

/// Where a valve goes for what is wanted of the command.
fn valve_target(command: Wanted, rules: &Rules) -> f64 {
    match command {
        Wanted::Share(share) => share,
        Wanted::Level(on) => f64::from(u8::from(on)),
        Wanted::State(state) => state.valve(rules),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::drr460::model::load::Load;
    use crate::devices::drr460::model::rules::Rules;

    const BASE: [(u8, i64); 8] =
        [(4, 10_000), (10, 1), (24, 60), (40, 2), (42, 100), (44, 10), (46, 100), (81, 1000)];

    /// A controller on its plant.
    struct Fixture {
        controller: Controller,
        settings: Settings,
        inputs: Inputs,
        load: Load,
        on_plant: bool,
    }

    impl Fixture {
        fn new(list: &[(u8, i64)]) -> Self {
            let all: Vec<_> = list.iter().copied().chain(BASE).collect();
            let settings = Settings::of(&Parameters::listed(&all, &Rules::plain()));
            let inputs = Inputs { terminals: 25.0, running: true, ..Inputs::default() };
            let controller = Controller::default();
            Self { controller, settings, inputs, load: Load::default(), on_plant: false }
        }

        fn at(&mut self, celsius: f64) -> Outcome {
            self.inputs.connected.celsius = celsius;
            self.controller.decide(&self.inputs, &self.settings, 0.1, &Rules::plain())
        }

        /// Advances the plant by tenths of a second; returns the last outcome.
        fn tenths(&mut self, tenths: u32) -> Outcome {
            self.on_plant = true;
            let mut outcome = Outcome::default();
            for _ in 0..tenths {
                outcome = self.at(self.load.sensor());
                self.load.advance(self.controller.drive(&self.settings), 0.1);
                self.controller.advance(0.1, &self.settings, &Rules::plain());
            }
            outcome
        }

        fn contacts(&self) -> [bool; 2] {
            self.controller.terminals.contacts
        }
    }

    #[test]
    fn on_off_heats_until_the_set_point() {
        let mut fixture = Fixture::new(&[(19, 2)]);
        fixture.inputs.set_point = 500;
        assert_eq!((fixture.at(25.0).output, fixture.contacts()), (1.0, [true, false]));
        assert_eq!((fixture.at(50.0).output, fixture.contacts()), (0.0, [false, false]));
    }

    #[test]
    fn pid_holds_the_set_point_on_the_plant() {
        let mut fixture = Fixture::new(&[(33, 300), (34, 1500), (35, 50)]);
        fixture.inputs.set_point = 1000;
        let outcome = fixture.tenths(18_000);
        assert!((990..=1010).contains(&outcome.process), "{outcome:?}");
    }

    #[test]
    fn a_tuning_finds_parameters_that_hold_the_set_point() {
        let mut fixture = Fixture::new(&[(31, 3), (47, 30), (48, 50), (49, 500), (50, 400)]);
        fixture.inputs.set_point = 1000;
        let found = (0..10_000).find_map(|_| fixture.tenths(1).found).unwrap();
        assert!(found.band >= 50 && found.integral_time >= 400, "{found:?}");
        let list = [(33, found.band), (34, found.integral_time), (35, found.derivative_time)];
        let all: Vec<_> = list.into_iter().chain(BASE).collect();
        fixture.settings = Settings::of(&Parameters::listed(&all, &Rules::plain()));
        let outcome = fixture.tenths(18_000);
        assert!((980..=1020).contains(&outcome.process), "{found:?} {outcome:?}");
    }

    #[test]
    fn what_the_process_did_before_a_tuning_is_no_movement_after_it() {
        let limits = [(47, 30), (48, 50), (49, 500), (50, 400)];
        let list = [(31, 4), (33, 10_000), (35, 100)];
        let mut fixture = Fixture::new(&[&list[..], &limits[..]].concat());
        fixture.inputs.set_point = 1000;
        fixture.at(-20.0);
        fixture.controller.command_tuning(1, (-200, 1000), &fixture.settings);
        assert_eq!(fixture.at(20.0).output, 0.0);
        fixture.controller.command_tuning(0, (200, 1000), &fixture.settings);
        assert_eq!(fixture.at(20.0).output, 0.08);
    }

    #[test]
    fn stop_error_and_silence_take_the_command() {
        let mut fixture = Fixture::new(&[(19, 2), (20, 1), (21, 1)]);
        fixture.inputs.set_point = 500;
        fixture.inputs.offline = true;
        assert_eq!((fixture.at(25.0).output, fixture.contacts()[0]), (0.0, false));
        fixture.inputs.running = false;
        assert_eq!((fixture.at(25.0).output, fixture.contacts()[0]), (0.0, true));
        fixture.inputs = Inputs { running: true, offline: false, ..fixture.inputs };
        assert_eq!((fixture.at(2000.0).flags, fixture.contacts()[0]), (2, true));
        assert_eq!((fixture.at(60.0).flags, fixture.contacts()[0]), (0, false));
    }

    #[test]
    fn a_broken_sensor_leaves_the_output_in_manual_mode_with_memory() {
        let mut fixture = Fixture::new(&[(33, 1000), (25, 2)]);
        fixture.inputs.set_point = 500;
        assert_eq!(fixture.at(25.0).output, 0.25);
        let outcome = fixture.at(2000.0);
        assert_eq!((outcome.output, outcome.manual), (0.25, true));
    }

    #[test]
    fn another_command_output_is_no_short_circuit_of_the_load() {
        let mut list = vec![(19, 2), (90, 1), (91, 50), (92, 100)];
        let mut fixture = Fixture::new(&list);
        fixture.inputs.set_point = 500;
        fixture.at(25.0);
        fixture.inputs.milliamperes = 20.0;
        assert_eq!((fixture.at(25.0).flags, fixture.contacts()[0]), (0, true));
        list.push((16, 4));
        fixture.settings = Fixture::new(&list).settings;
        assert_eq!((fixture.at(25.0).flags, fixture.contacts()[0]), (0, false));
    }

    #[test]
    fn a_valve_travels_to_the_output() {
        let mut fixture = Fixture::new(&[(16, 2), (33, 1000)]);
        fixture.inputs.set_point = 500;
        fixture.at(0.0);
        assert_eq!(fixture.contacts(), [true, false]);
        assert_eq!(fixture.controller.next(&fixture.settings, &Rules::plain()), Some(30.0));
        fixture.controller.advance(30.0, &fixture.settings, &Rules::plain());
        assert_eq!(fixture.contacts(), [false, false]);
        fixture.at(50.0);
        assert_eq!(fixture.contacts(), [false, true]);
    }

    #[test]
    fn an_alarm_cools_what_is_too_warm() {
        let mut fixture = Fixture::new(&[(33, 100), (56, 9)]);
        fixture.inputs.set_point = 500;
        let outcome = fixture.at(55.0);
        assert_eq!((outcome.output, outcome.cooling), (0.0, 0.5));
        assert_eq!(fixture.contacts(), [false, true]);
        assert_eq!(fixture.controller.next(&fixture.settings, &Rules::plain()), Some(5.0));
        assert_eq!(fixture.controller.drive(&fixture.settings).cooling, 1.0);
    }
}
