//! The application of the EUROMAP 66-2 heating/cooling device: it brings a medium to a temperature
//! and pumps it through a mould.
//!
//! Data flows one way, every 100 ms and after each write and each stimulus. The process becomes
//! [`Sensed`], unless the bench overrides a sensor. That and the errors become [`Duty`], the task
//! of the device. The controller turns it into [`Drive`], which acts on the process. The alarms
//! look at the resulting objects.

mod alarm;
mod alarm_kinds;
mod bench;
mod codes;
mod controller;
mod faults;
mod objects;
mod operation;
mod process;
mod rules;
mod suction;
mod switch_off;

use std::sync::Arc;
use std::time::Duration;

use canopen::{Abort, BenchError, Dictionary, Instant, Mux, Value};

use crate::decisions::{Otherwise, Set};
use crate::describe::Description;
use crate::stack::{Behaviour, Errors};

use alarm::Alarms;
use bench::Stimuli;
use codes::Codes;
use controller::Controller;
use faults::Faults;
use objects::{DIFFERENCE, EXTERNAL_SENSOR, FLOW, INTAKE_PRESSURE, MAIN_LINE, RETURN_LINE, set};
use operation::Operation;
use process::Process;

use rules::Em66Rules;

/// The decisions of the application that deviations can override.
pub(super) const DECISIONS: Set = Set::of::<rules::Decision>();

/// The application of a heating/cooling device.
#[derive(Clone)]
pub(super) struct Em66 {
    rules: Arc<Em66Rules>,
    options: Options,
    codes: Codes,
    process: Process,
    stimuli: Stimuli,
    faults: Faults,
    operation: Operation,
    controller: Controller,
    alarms: Alarms,
    drive: Drive,
    next_sample: Instant,
    /// Something came from outside since the last decision.
    touched: bool,
}

/// The options of this device that a dictionary cannot express.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Options {
    suction: bool,
    evacuation: bool,
    cool_down: bool,
    self_optimisation: bool,
    return_line_control: bool,
    external_sensor_control: bool,
}

/// The measurements of the sensors. Temperatures in tenths of a degree Celsius.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Sensed {
    main: i64,
    return_line: i64,
    external: External,
    /// In tenths of a litre a minute.
    flow: i64,
    /// Pressure at the intake of the pump, in tenths of a bar.
    intake_pressure: i64,
    /// The level in the tank, in tenths of a percent.
    medium_level: i64,
    /// The contents of the mould, in tenths of a percent.
    mould_contents: i64,
    limiter_tripped: bool,
    machine_fault: bool,
}

impl Sensed {
    /// Shows what the sensors measure (3.4.9 to 3.4.15).
    fn show(&self, od: &mut Dictionary, rules: &Em66Rules) {
        let (main, return_line) = rules.lines(self.main, self.return_line);
        let difference = rules.difference(self.main, self.return_line);
        let external = match self.external {
            External::Reads(celsius) => rules.external_value(celsius),
            External::Unplugged | External::Broken => rules.no_sensor(),
        };
        for (mux, tenths) in [
            (MAIN_LINE, main),
            (RETURN_LINE, return_line),
            (DIFFERENCE, difference),
            (EXTERNAL_SENSOR, external),
            (FLOW, self.flow),
            (INTAKE_PRESSURE, self.intake_pressure),
        ] {
            set(od, mux, rules.shown(mux, tenths));
        }
    }
}

/// The sensor in the mould.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum External {
    /// It measures a temperature, in tenths of a degree Celsius.
    Reads(i64),
    /// Nothing is plugged in.
    #[default]
    Unplugged,
    /// It is plugged in and gives no value.
    Broken,
}

/// The task of the device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Duty {
    /// The controller works (6427h, on): also while it cools down and evacuates before it is off.
    on: bool,
    /// Which temperature is controlled, as 2004h says.
    mode: Mode,
    /// Cooling down before switching off.
    cooling_down: bool,
    /// Emptying the mould before switching off.
    evacuating: bool,
    /// Suction mode is on.
    suction: bool,
    /// An error forbids to heat and to cool.
    blocked: bool,
}

/// Which temperature is controlled (3.4.4).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Mode {
    #[default]
    MainLine,
    ReturnLine,
    ExternalSensor,
}

/// The commands for the actuators.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Drive {
    /// In tenths of a percent: heating is positive, cooling negative.
    output: i64,
    pump: Pump,
    /// The valve is open through which the mould empties.
    draining: bool,
}

/// The action of the pump.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Pump {
    #[default]
    Off,
    Forward,
    /// Drawing the medium through the mould instead of pressing it.
    Backward,
}

impl Em66 {
    /// The device that keeps to its documents but for these decisions.
    pub(super) fn with_deviations(device: &Description, otherwise: &[Otherwise<'_>]) -> Self {
        Self::with(Em66Rules::default().with(otherwise), device)
    }

    fn with(rules: Em66Rules, device: &Description) -> Self {
        let has = |option: &str| !device.without.iter().any(|lacking| lacking == option);
        let codes = Codes::of(&device.names);
        let options = Options {
            suction: has("suction"),
            evacuation: has("evacuation"),
            cool_down: has("cool-down"),
            self_optimisation: has("self-optimisation"),
            return_line_control: has("return-line-control"),
            external_sensor_control: has("external-sensor-control"),
        };
        Self {
            rules: Arc::new(rules),
            options,
            codes,
            process: Process::new(),
            stimuli: Stimuli::default(),
            faults: Faults::default(),
            operation: Operation::new(codes),
            controller: Controller::new(codes),
            alarms: Alarms::new(device.blocks.get("alarm"), codes),
            drive: Drive::default(),
            next_sample: Instant::ZERO + PERIOD,
            touched: true,
        }
    }

    /// Senses, decides and drives; `elapsed` went by since the last time, zero for a decision
    /// between two samples.
    fn step(&mut self, elapsed: Duration, od: &mut Dictionary, errors: &mut Errors) {
        let rules = &*self.rules;
        let sensed = self.stimuli.sense(&self.process);
        let blocked = self.faults.judge(&sensed, self.operation.mode(), od, errors, rules);
        let duty = self.operation.decide(&sensed, blocked, self.options, od, rules);
        self.drive = self.controller.drive(elapsed, &sensed, &duty, self.options, od, rules);
        sensed.show(od, rules);
        self.alarms.watch(&duty, od, rules);
    }
}

impl Behaviour for Em66 {
    fn reset(&mut self, _now: Instant, od: &mut Dictionary) {
        self.touched = true;
        self.stimuli.fit(od);
        self.faults.restart(&self.rules);
        self.operation = Operation::new(self.codes);
        self.controller.restart();
        self.alarms.reset(od, &self.rules);
    }

    fn check(&self, mux: Mux, bytes: &[u8], od: &Dictionary) -> Result<(), Abort> {
        let rules = &*self.rules;
        Controller::check(mux, bytes, od, rules)?;
        Operation::check(mux, bytes, self.options, od, rules)?;
        self.alarms.check(mux, bytes, od, rules)
    }

    fn written(&mut self, _now: Instant, mux: Mux, od: &mut Dictionary) {
        let rules = &*self.rules;
        self.touched = true;
        self.operation.written(mux, od, rules);
        self.alarms.written(mux, od, rules);
    }

    fn refused(&mut self, _now: Instant, mux: Mux, bytes: &[u8], od: &mut Dictionary) {
        let rules = &*self.rules;
        self.touched = true;
        self.operation.refused(mux, rules);
        self.alarms.refused(mux, bytes, od, rules);
    }

    fn run(&mut self, now: Instant, od: &mut Dictionary, errors: &mut Errors) {
        while self.next_sample <= now {
            self.process.advance(PERIOD, self.drive);
            self.step(PERIOD, od, errors);
            self.next_sample += PERIOD;
            self.touched = false;
        }
        if std::mem::take(&mut self.touched) && self.rules.evaluates_at_once() {
            self.step(Duration::ZERO, od, errors);
        }
    }

    fn poll_at(&self) -> Option<Instant> {
        Some(self.next_sample)
    }

    fn bench_names(&self) -> Vec<String> {
        self.stimuli.names()
    }

    fn stimulate(
        &mut self,
        _now: Instant,
        name: &str,
        value: &Value,
        _od: &mut Dictionary,
    ) -> Result<(), BenchError> {
        self.touched = true;
        self.stimuli.set(name, value)
    }

    fn observe(&self, name: &str, _od: &Dictionary) -> Option<Value> {
        self.stimuli.observe(name, self.drive)
    }

    fn triggers(&mut self, mux: Mux, last: &[u8], od: &Dictionary) -> bool {
        objects::triggers(mux, last, od)
    }
}

/// Time from one sample to the next.
const PERIOD: Duration = Duration::from_millis(100);
