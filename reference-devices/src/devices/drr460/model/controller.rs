//! The controller: everything between the terminals of the inputs and those of the outputs.
//!
//! It decides once in a period. Between two decisions only cycles and valves move.

use super::alarm::{self, Alarm};
use super::current::{self, Transformer};
use super::cycle::{Cycle, Wanted};
use super::flags::{self, Faults, Flags};
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
use crate::devices::pixsys::sensor::Connected;

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
        let cools = parameters.get(18) == 1;
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

/// What the controller sees when it decides.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Inputs {
    pub(crate) connected: Connected,
    /// Degrees Celsius at the terminals.
    pub(crate) terminals: f64,
    /// Of the current transformer.
    pub(crate) milliamperes: f64,
    pub(crate) faults: Faults,
    pub(crate) set_point: i64,
    pub(crate) limits: [i64; 2],
    pub(crate) running: bool,
    /// The master asks for manual mode.
    pub(crate) manual: bool,
    /// What 4004h holds, as a share of full output.
    pub(crate) output: f64,
    pub(crate) remote: [bool; 2],
    /// What 4010h holds.
    pub(crate) retransmitted: i64,
    pub(crate) offline: bool,
}

/// What a decision says, for the objects.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Outcome {
    pub(crate) process: i64,
    pub(crate) flags: i64,
    pub(crate) set_point: i64,
    /// Shares of full output.
    pub(crate) output: f64,
    pub(crate) cooling: f64,
    /// The controller is in manual mode, maybe by itself.
    pub(crate) manual: bool,
    pub(crate) found: Option<Found>,
}

/// The controller.
#[derive(Clone, Debug, Default)]
pub(crate) struct Controller {
    pub(super) input: Input,
    pub(super) alarms: [Alarm; 2],
    pub(super) on_off: OnOff,
    pub(super) tuning: Tuning,
    pub(super) transformer: Transformer,
    pub(super) flags: Flags,
    pid: Pid,
    soft_start: SoftStart,
    valve: Valve,
    cycles: Cycles,
    running: bool,
    last_set_point: i64,
    last_real_set_point: i64,
    /// A share of full output.
    output: f64,
    cooling: f64,
    was_manual: bool,
    functions: Option<Functions>,
    terminals: Terminals,
}

/// The cycles of the command and of the alarms.
#[derive(Clone, Copy, Debug, Default)]
struct Cycles {
    command: Cycle,
    alarms: Cycle,
}

impl Controller {
    /// Decides anew; `elapsed` are the seconds since the last decision.
    pub(crate) fn decide(
        &mut self,
        inputs: &Inputs,
        settings: &Settings,
        elapsed: f64,
        rules: &dyn Rules,
    ) -> Outcome {
        let connected = (inputs.connected, inputs.terminals);
        let reading = self.input.sample(connected, &settings.reading, rules);
        self.input.latch.advance(elapsed, &settings.reading.latch);
        let on = self.terminals.contacts[settings.current.output];
        self.transformer.step((inputs.milliamperes, on), &settings.current, elapsed, rules);
        let flags = self.flags.shown(inputs.faults, reading.is_error, inputs.terminals)
            | self.transformer.flags();
        let error = flags::is_error(flags, settings.is_thermocouple);
        let set_point = self.set_point(inputs, reading.process, settings, elapsed, rules);

        let sight = Sight { process: reading.process, set_point, error };
        let (command, manual, found) = self.command(inputs, &sight, settings, elapsed);
        let seen = |number: usize| alarm::Sight {
            process: reading.process,
            set_point,
            limit: inputs.limits[number],
            error,
            sensor_error: reading.is_error,
            running: inputs.running,
            remote: inputs.remote[number],
            current_error: self.transformer.is_error(),
            cooling: self.cooling,
        };
        let seen = [seen(0), seen(1)];
        let [first, second] = &mut self.alarms;
        let alarms = [
            first.step(&seen[0], &settings.alarms[0], elapsed, rules),
            second.step(&seen[1], &settings.alarms[1], elapsed, rules),
        ];
        let sources = Sources {
            process: reading.process,
            set_point,
            alarms: inputs.limits,
            amperes: self.transformer.amperes(),
            remote: inputs.retransmitted,
            error,
            running: inputs.running,
        };
        self.functions = Some(Functions {
            command,
            command_closed: false,
            valve: self.valve.motion(),
            alarms,
            alarms_closed: [false; 2],
            retransmitted: retransmission::microamperes(&sources, &settings.retransmission, rules),
        });
        self.connect(settings, rules);
        Outcome {
            process: reading.process,
            flags,
            set_point,
            output: self.output,
            cooling: self.cooling,
            manual,
            found,
        }
    }

    /// So many seconds go by without a decision: cycles and the valve move.
    pub(crate) fn advance(
        &mut self,
        elapsed: f64,
        settings: &Settings,
        rules: &dyn Rules,
    ) -> Terminals {
        self.cycles.command.advance(elapsed, settings.cycle);
        self.cycles.alarms.advance(elapsed, settings.cooling_cycle);
        self.valve.advance(elapsed, settings.travel);
        self.connect(settings, rules);
        self.terminals
    }

    /// Seconds until an output changes without a decision.
    pub(crate) fn next(&self, settings: &Settings, rules: &dyn Rules) -> Option<f64> {
        let functions = self.functions.as_ref()?;
        let command = match settings.wiring.command {
            Command::Contact => self.cycles.command.next(functions.command, settings.cycle),
            Command::Valve => {
                let wanted = valve_target(functions.command, rules);
                self.valve.next(wanted, settings.travel)
            }
            Command::Analogue => None,
        };
        let alarms = functions.alarms;
        let cooling = alarms
            .iter()
            .filter_map(|alarm| self.cycles.alarms.next(*alarm, settings.cooling_cycle));
        command.into_iter().chain(cooling).reduce(f64::min)
    }

    /// What the outputs do to the load.
    pub(crate) fn drive(&self, settings: &Settings) -> Drive {
        let share = |current: f64| {
            let zero = if settings.wiring.live_zero { 4000.0 } else { 0.0 };
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

    /// The device was switched on; what it keeps is given back by its parts.
    pub(crate) fn restart(&mut self, settings: &Settings, faults: Faults) {
        let mut input = std::mem::take(&mut self.input);
        input.restart();
        let (mut alarms, mut on_off, mut flags) = (self.alarms, self.on_off, self.flags);
        alarms.iter_mut().zip(&settings.alarms).for_each(|(alarm, set)| alarm.restart(set));
        on_off.restart(&settings.on_off);
        flags.restart(faults);
        *self = Self { input, alarms, on_off, flags, valve: self.valve, ..Self::default() };
    }

    /// The set point in force; the controller may just have started, or have a new set point.
    fn set_point(
        &mut self,
        inputs: &Inputs,
        process: i64,
        settings: &Settings,
        elapsed: f64,
        rules: &dyn Rules,
    ) -> i64 {
        let wanted = inputs.set_point;
        let starts = inputs.running && !self.running;
        if starts {
            self.soft_start = SoftStart::begin(process, &settings.soft_start);
            self.last_real_set_point = wanted;
        }
        if starts || inputs.running && wanted != self.last_set_point {
            self.tuning.started(starts, (process, wanted), &settings.tuning, rules);
        }
        self.running = inputs.running;
        self.last_set_point = wanted;
        if !inputs.running {
            return wanted;
        }
        self.soft_start.set_point(wanted, process, &settings.soft_start, elapsed)
    }

    /// What is wanted of the command, whether the mode is manual, and what a tuning found.
    fn command(
        &mut self,
        inputs: &Inputs,
        sight: &Sight,
        settings: &Settings,
        elapsed: f64,
    ) -> (Wanted, bool, Option<Found>) {
        let asked = settings.manual != 0 && inputs.manual;
        let breaks = sight.error && settings.manual == WITH_MEMORY && inputs.running;
        let manual = asked || breaks;
        self.cooling = 0.0;
        if !inputs.running || inputs.offline {
            self.tuning.abandon();
            self.on_off.restart(&settings.on_off);
            self.pid = Pid::default();
            self.output = if manual { inputs.output } else { 0.0 };
            let off =
                if inputs.running { Wanted::Share(0.0) } else { Wanted::State(settings.stop) };
            return (off, manual, None);
        }
        if manual {
            self.tuning.abandon();
            // The network may have written the output; what a broken sensor leaves stays.
            self.output = if asked { inputs.output } else { self.output };
            self.was_manual = true;
            return (Wanted::Share(self.output), true, None);
        }
        if sight.error {
            self.tuning.abandon();
            self.output = 0.0;
            return (Wanted::State(settings.error), false, None);
        }
        let step = self.tuning.step(sight.process, &settings.tuning, elapsed);
        self.output = match step.forced {
            Some(on) => f64::from(u8::from(on)),
            None => self.automatic(sight, settings, elapsed),
        };
        self.was_manual = false;
        (Wanted::Share(self.output), false, step.found)
    }

    fn automatic(&mut self, sight: &Sight, settings: &Settings, elapsed: f64) -> f64 {
        let direction = if settings.cools { -1 } else { 1 };
        let missing = direction * (sight.set_point - sight.process);
        let moved = direction * (sight.set_point - self.last_real_set_point);
        self.last_real_set_point = sight.set_point;
        let output = match &settings.pid {
            None => f64::from(u8::from(self.on_off.step(missing, &settings.on_off, elapsed))),
            Some(pid) => {
                if self.was_manual {
                    self.pid.restart(self.output, pid);
                }
                let outputs = self.pid.step((missing, moved), pid, elapsed);
                self.cooling = outputs.cooling;
                outputs.command
            }
        };
        self.soft_start.output(&settings.soft_start).unwrap_or(output)
    }

    /// Puts what is wanted on the terminals, as it is in its cycle now.
    fn connect(&mut self, settings: &Settings, rules: &dyn Rules) {
        let Some(functions) = &mut self.functions else { return };
        let Cycles { command, alarms } = self.cycles;
        functions.command_closed = command.is_closed(functions.command, settings.cycle, rules);
        functions.alarms_closed =
            functions.alarms.map(|alarm| alarms.is_closed(alarm, settings.cooling_cycle, rules));
        if settings.wiring.command == Command::Valve {
            self.valve.go_to(valve_target(functions.command, rules));
        }
        functions.valve = self.valve.motion();
        self.terminals = settings.wiring.connect(functions, rules);
    }
}

/// What the command looks at.
struct Sight {
    process: i64,
    set_point: i64,
    error: bool,
}

/// Where a valve goes for what is wanted of the command.
fn valve_target(command: Wanted, rules: &dyn Rules) -> f64 {
    match command {
        Wanted::Share(share) => share,
        Wanted::Level(on) => f64::from(u8::from(on)),
        Wanted::State(state) => state.valve(rules),
    }
}

const WITH_MEMORY: i64 = 2;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::drr460::model::load::Load;
    use crate::devices::drr460::model::rules::Manual;

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
            let settings = Settings::of(&Parameters::listed(&all, &Manual));
            let inputs = Inputs { terminals: 25.0, running: true, ..Inputs::default() };
            let controller = Controller::default();
            Self { controller, settings, inputs, load: Load::default(), on_plant: false }
        }

        fn at(&mut self, celsius: f64) -> Outcome {
            self.inputs.connected.celsius = celsius;
            self.controller.decide(&self.inputs, &self.settings, 0.1, &Manual)
        }

        /// So many tenths of a second on the plant; the last outcome.
        fn tenths(&mut self, tenths: u32) -> Outcome {
            self.on_plant = true;
            let mut outcome = Outcome::default();
            for _ in 0..tenths {
                outcome = self.at(self.load.sensor());
                self.load.advance(self.controller.drive(&self.settings), 0.1);
                self.controller.advance(0.1, &self.settings, &Manual);
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
        fixture.settings = Settings::of(&Parameters::listed(&all, &Manual));
        let outcome = fixture.tenths(18_000);
        assert!((980..=1020).contains(&outcome.process), "{found:?} {outcome:?}");
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
    fn a_valve_travels_to_the_output() {
        let mut fixture = Fixture::new(&[(16, 2), (33, 1000)]);
        fixture.inputs.set_point = 500;
        fixture.at(0.0);
        assert_eq!(fixture.contacts(), [true, false]);
        assert_eq!(fixture.controller.next(&fixture.settings, &Manual), Some(30.0));
        fixture.controller.advance(30.0, &fixture.settings, &Manual);
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
        assert_eq!(fixture.controller.next(&fixture.settings, &Manual), Some(5.0));
        assert_eq!(fixture.controller.drive(&fixture.settings).cooling, 1.0);
    }
}
