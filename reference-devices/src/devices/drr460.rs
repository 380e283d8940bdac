//! What the DRR460-12A-CAN does: a temperature controller with two alarms on a simulated plant.
//!
//! Every 20 ms it samples, decides and drives; what the network writes is seen at the next
//! sample. The plant is a body of the first order: 25.0 degrees ambient, 5 s time constant, 100 K
//! above ambient at full heat.
//!
//! Modelled: on/off, P, PI and PID control with dead band, limits, cycle time and delay; START and
//! STOP with the states in STOP; manual mode; both soft starts; alarms on process value, band,
//! deviation, set point, status, sensor and remote with hysteresis, delay, polarity and manual
//! reset; the outputs in expansion mode; analogue triggers; forcing of the output by synchronised
//! tuning. A temperature outside the range of the selected sensor is the sensor error.
//!
//! Not modelled, so that the objects hold what was written to them: linear inputs, filter and
//! latch-on (3000h subs 3 to 6, 9, 10; 4011h), the calculation of tuning (3000h subs 31 to 50),
//! the valve (codes 2 and 3 of 3000h sub 16 drive nothing), manual reset of the command (sub 22,
//! 400Ah), double action cooling (alarm kind 9, 4005h), the current transformer (alarm kind 10,
//! subs 90 to 94), retransmission (subs 100 to 105, 4010h), silence (sub 115) and the error states
//! of expansion mode (subs 123 to 131). 400Eh never turns to 4 or 5. A sensor error shows in
//! 4007h only, since the manual has no emergency code for it.

mod alarm;
mod control;
mod delay;
mod input;
#[allow(dead_code, reason = "the application changes over to it")]
mod model;
mod objects;
mod plant;
mod rules;
mod soft_start;

use std::time::Duration;

use canopen::eds::Eds;
use canopen::{Abort, Dictionary, Instant, Mux};

use crate::profiles::cia401::{self, IoBlock};
use crate::stack::{Behaviour, CommunicationEvent, Errors};

use super::pixsys::PixsysIo;

use alarm::{Alarm, Sight, is_closed};
use control::{ACTION, Control, FULL_OUTPUT, Wiring};
use objects::{
    ALARMS_RESET, COLD_JUNCTION, ERROR_FLAGS, MANUAL, MASTER_ANALOGUE, MASTER_OUTPUTS, OUTPUT,
    OUTPUTS, REAL_SET_POINT, SET_POINT, START, TUNING, parameter, value,
};
use plant::{AMBIENT, Plant};
use rules::{Drr460Rules, Manual};
use soft_start::SoftStart;

/// The application of a DRR460.
pub(crate) struct Drr460 {
    rules: Box<dyn Drr460Rules>,
    io: IoBlock,
    plant: Plant,
    control: Control,
    soft_start: SoftStart,
    alarms: [Alarm; 2],
    running: bool,
    before_power_off: BeforePowerOff,
    next_sample: Instant,
}

/// What the controller keeps over a loss of supply without a store command.
#[derive(Clone, Copy, Debug)]
struct BeforePowerOff {
    started: bool,
    manual: bool,
    output: i64,
}

/// What the command output does after a sample.
#[derive(Clone, Copy, Debug)]
struct Command {
    closed: bool,
    share: f64,
}

impl Drr460 {
    /// A controller at ambient temperature that keeps to its manual.
    pub(crate) fn new(eds: &Eds) -> Self {
        Self::with(Box::new(Manual), IoBlock::new(eds, Box::new(PixsysIo::default())))
    }

    /// The controller that takes the decision of that name otherwise; `None` when there is none.
    pub(crate) fn deviating(eds: &Eds, name: &str) -> Option<Self> {
        if let Some(rules) = rules::named(name) {
            return Some(Self::with(rules, IoBlock::new(eds, Box::new(PixsysIo::default()))));
        }
        let io = cia401::deviation(name)?.of(Box::new(PixsysIo::default()));
        Some(Self::with(Box::new(Manual), IoBlock::new(eds, io)))
    }

    /// The names that [`deviating`](Self::deviating) knows.
    pub(crate) fn deviations() -> impl Iterator<Item = &'static str> {
        rules::names().chain(cia401::names())
    }

    fn with(rules: Box<dyn Drr460Rules>, io: IoBlock) -> Self {
        Self {
            rules,
            io,
            plant: Plant::new(),
            control: Control::default(),
            soft_start: SoftStart::default(),
            alarms: [Alarm::default(); 2],
            running: false,
            before_power_off: BeforePowerOff { started: true, manual: false, output: 0 },
            next_sample: Instant::ZERO + PERIOD,
        }
    }

    fn sample(&mut self, od: &mut Dictionary) {
        let measured = input::process_value(self.plant.celsius(), od, &*self.rules);
        let (Ok(process) | Err(process)) = measured;
        let sensor_error = measured.is_err();
        self.io.measure(PROCESS_INPUT, process, od);
        od.set_int(ERROR_FLAGS, if sensor_error { SENSOR_ERROR } else { 0 });
        od.set_int(COLD_JUNCTION, (AMBIENT * 10.0) as i64);

        if self.is_expansion(od) {
            self.io.drive(od);
            let [q1, q2] = [1, 2].map(|bit| self.io.digital_output(0) & bit != 0);
            self.connect(od, Command { closed: q1, share: f64::from(u8::from(q1)) }, [q1, q2]);
        } else {
            let running = self.rules.controls(value(od, START) == 1);
            let set_point = self.set_point(running, process, od);
            od.set_int(REAL_SET_POINT, set_point);
            self.decide(od, &Sight { process, set_point, sensor_error, running });
        }
        self.before_power_off = BeforePowerOff {
            started: value(od, START) == 1,
            manual: self.is_manual(od),
            output: value(od, OUTPUT),
        };
    }

    /// The set point in force; the controller may just have started.
    fn set_point(&mut self, running: bool, process: i64, od: &Dictionary) -> i64 {
        let wanted = value(od, SET_POINT);
        if running && !self.running {
            let kind = self.rules.soft_start(parameter(od, soft_start::KIND));
            self.soft_start = SoftStart::begin(kind, process);
        }
        self.running = running;
        match running {
            true => self.soft_start.set_point(wanted, process, od),
            false => wanted,
        }
    }

    /// Command, alarms and outputs.
    fn decide(&mut self, od: &mut Dictionary, sight: &Sight) {
        let command = self.command(od, sight);
        let [first, second] = &mut self.alarms;
        let alarms =
            [first.sample(0, sight, od, &*self.rules), second.sample(1, sight, od, &*self.rules)];
        let resettable = self.alarms.map(|alarm| alarm.resettable());
        od.set_int(ALARMS_RESET, i64::from(resettable[0]) | i64::from(resettable[1]) << 1);
        let outputs = match Wiring::of(od) {
            Wiring::Contact => [command.closed, alarms[0]],
            Wiring::Valve => [false, false],
            Wiring::Analogue { .. } => alarms,
        };
        self.connect(od, command, outputs);
    }

    fn command(&mut self, od: &mut Dictionary, sight: &Sight) -> Command {
        let wiring = Wiring::of(od);
        let state = |code| Command { closed: is_closed(code), share: wiring.state_share(code) };
        if !sight.running {
            self.control = Control::default();
            if !self.is_manual(od) {
                od.set_int(OUTPUT, 0);
            }
            return state(self.rules.stop_state(parameter(od, STOP_STATE)));
        }
        if sight.sensor_error && parameter(od, MANUAL_ALLOWED) == MANUAL_WITH_MEMORY {
            // Without a process value the master is left with the output as it was.
            od.set_int(MANUAL, 1);
        }
        if !self.is_manual(od) {
            if sight.sensor_error {
                od.set_int(OUTPUT, 0);
                return state(parameter(od, ERROR_STATE));
            }
            let controlled = self.control.output(sight, od, &*self.rules);
            let forced = self.forced(od).or_else(|| self.soft_start.output(od));
            if self.rules.sets_output() {
                od.set_int(OUTPUT, forced.unwrap_or(controlled));
            }
        }
        let output = value(od, OUTPUT);
        let closed = self.control.contact(output, od);
        let share = match wiring {
            Wiring::Contact => f64::from(u8::from(closed)),
            Wiring::Valve => 0.0,
            Wiring::Analogue { .. } => output as f64 / FULL_OUTPUT as f64,
        };
        Command { closed, share }
    }

    /// Puts the outputs on the terminals and the command on the plant.
    fn connect(&mut self, od: &mut Dictionary, command: Command, [q1, q2]: [bool; 2]) {
        od.set_int(OUTPUTS, self.rules.outputs_status(q1, q2));
        self.plant.drive(command.share, self.rules.cools(parameter(od, ACTION)));
    }

    /// The output that synchronised tuning forces.
    fn forced(&self, od: &Dictionary) -> Option<i64> {
        match value(od, TUNING) {
            _ if !self.rules.tuning_forces(parameter(od, TUNE)) => None,
            1 => Some(0),
            2 => Some(FULL_OUTPUT as i64),
            _ => None,
        }
    }

    fn is_manual(&self, od: &Dictionary) -> bool {
        self.rules.manual(parameter(od, MANUAL_ALLOWED), value(od, MANUAL))
    }

    fn is_expansion(&self, od: &Dictionary) -> bool {
        self.rules.expansion(parameter(od, EXPANSION))
    }
}

impl Behaviour for Drr460 {
    fn reset(&mut self, now: Instant, od: &mut Dictionary) {
        self.io.reset(now, od);
        let before = self.before_power_off;
        let started = self.rules.starts(parameter(od, INITIAL_STATE), before.started);
        od.set_int(START, started.into());
        if parameter(od, MANUAL_ALLOWED) == MANUAL_WITH_MEMORY && before.manual {
            od.set_int(MANUAL, 1);
            od.set_int(OUTPUT, before.output);
        }
        if self.is_expansion(od) {
            od.set_int(MASTER_OUTPUTS, parameter(od, INITIAL_OUTPUTS));
            od.set_int(MASTER_ANALOGUE, parameter(od, INITIAL_ANALOGUE));
        }
        self.running = false;
        self.control = Control::default();
        for (number, alarm) in (0..).zip(&mut self.alarms) {
            alarm.restart(number, od);
        }
        self.sample(od);
    }

    fn supply_lost(&mut self) {
        self.io.supply_lost();
    }

    fn check(&self, mux: Mux, bytes: &[u8], od: &Dictionary) -> Result<(), Abort> {
        match (mux, bytes) {
            (TUNING, [value]) => self.rules.tuning_accepts(parameter(od, TUNE), *value),
            _ => Ok(()),
        }
    }

    fn written(&mut self, now: Instant, mux: Mux, od: &mut Dictionary) {
        // A value for an output ends what a communication error made of it.
        self.io.written(now, mux, od);
        if mux == ALARMS_RESET && value(od, ALARMS_RESET) == 0 {
            self.alarms.iter_mut().for_each(Alarm::reset);
        }
    }

    fn event(&mut self, now: Instant, event: CommunicationEvent, od: &mut Dictionary) {
        // Otherwise the outputs are the controller's own, and the network has no part in them.
        if self.is_expansion(od) {
            self.io.event(now, event, od);
        }
    }

    fn run(&mut self, now: Instant, od: &mut Dictionary, _errors: &mut Errors) {
        while self.next_sample <= now {
            self.plant.advance();
            self.sample(od);
            self.next_sample += PERIOD;
        }
    }

    fn poll_at(&self) -> Option<Instant> {
        Some(self.next_sample)
    }

    fn has_edges(&self, mux: Mux) -> bool {
        self.io.has_edges(mux)
    }

    fn triggers(&mut self, mux: Mux, last: &[u8], od: &Dictionary) -> bool {
        self.io.triggers(mux, last, od)
    }
}

/// The analogue input of the process value.
const PROCESS_INPUT: usize = 0;
/// Time from one sample to the next.
const PERIOD: Duration = Duration::from_millis(20);

const INITIAL_STATE: u8 = 17;
const ERROR_STATE: u8 = 20;
const STOP_STATE: u8 = 21;
const MANUAL_ALLOWED: u8 = 25;
const MANUAL_WITH_MEMORY: i64 = 2;
const TUNE: u8 = 31;
const EXPANSION: u8 = 121;
const INITIAL_OUTPUTS: u8 = 122;
const INITIAL_ANALOGUE: u8 = 128;
/// Bit 1 of 4007h.
const SENSOR_ERROR: i64 = 2;

#[cfg(test)]
mod tests;
