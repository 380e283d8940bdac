//! The controller block (3.2): set points, ramps, output, self-optimisation.

mod pid;
mod ramp;
mod relay;

use std::time::Duration;

use canopen::{Abort, Dictionary, Mux};

use super::codes::Codes;
use super::objects::{
    CONTROL_BYTE, COOLING_RAMP, EFFECTIVE_SET_POINT, EFFECTIVE_VALUE, HEATING_RAMP, LOWER_LIMIT,
    NO_SENSOR, OPERATING_MODE, OUTPUT, SECOND_SET_POINT, SET_POINT, STATUS, UPPER_LIMIT, set,
    value,
};
use super::rules::{Activity, Em66Rules};
use super::{Drive, Duty, Options, Pump, Sensed};

use pid::Pid;
use ramp::{Ramp, Rates};
use relay::{Relay, Step};

/// The memory of the controller.
#[derive(Clone, Copy, Debug)]
pub(super) struct Controller {
    codes: Codes,
    ramp: Ramp,
    /// The set point that was chosen last.
    chosen: i64,
    pid: Pid,
    /// The self-optimisation that is going on.
    relay: Option<Relay>,
    /// Whether the request for a self-optimisation that is present has been answered.
    answered: bool,
    /// The second set point was selected at the last decision.
    second: bool,
    /// The first set point, since it was selected again.
    returned_to: Option<i64>,
    /// In tenths of a percent: heating is positive, cooling negative.
    output: i64,
}

/// The inputs of a decision about the output.
struct Sight<'a> {
    duty: &'a Duty,
    /// Time went by since the last decision.
    sampled: bool,
    /// Tenths of a kelvin from the effective value to the set point in force; `None` when the
    /// sensor that is controlled by tells nothing.
    missing: Option<f64>,
    manual: bool,
    /// Limits of the output in tenths of a percent.
    low: i64,
    high: i64,
}

impl Controller {
    /// A controller as it was commissioned.
    pub(super) const fn new(codes: Codes) -> Self {
        Self {
            codes,
            ramp: Ramp::new(),
            chosen: 0,
            pid: Pid::new(),
            relay: None,
            answered: false,
            second: false,
            returned_to: None,
            output: 0,
        }
    }

    /// Restarts after a reset. The parameters stay: they are stored in the device (3.2).
    pub(super) const fn restart(&mut self) {
        let gains = self.pid.gains;
        *self = Self::new(self.codes);
        self.pid.gains = gains;
    }

    /// Whether the device takes what is about to be written: units and digits are fixed (3.2).
    pub(super) fn check(
        mux: Mux,
        bytes: &[u8],
        od: &Dictionary,
        rules: &Em66Rules,
    ) -> Result<(), Abort> {
        let fixed = FIXED.contains(&mux.index) && rules.is_fixed(mux);
        let other = od.get(mux).is_some_and(|present| present != bytes);
        if fixed && other { Err(Abort::VALUE) } else { Ok(()) }
    }

    /// The commands for the actuators; shows 6410h, 6427h, 7400h and 7401h.
    pub(super) fn drive(
        &mut self,
        elapsed: Duration,
        sensed: &Sensed,
        duty: &Duty,
        options: Options,
        od: &mut Dictionary,
        rules: &Em66Rules,
    ) -> Drive {
        let codes = self.codes;
        let control = value(od, CONTROL_BYTE);
        let second = rules.second_set_point(control & codes.control_second != 0);
        let manual = rules.is_manual(value(od, OPERATING_MODE) == codes.manual, second);
        let chosen = value(od, if second { SECOND_SET_POINT } else { SET_POINT });
        let effective = sensed.effective(duty.mode);
        if effective.is_none() && !rules.goes_on_without_sensor() {
            return Drive { output: self.output, pump: pump(duty), draining: duty.evacuating };
        }
        let shown = rules.effective_value(effective.unwrap_or(NO_SENSOR));
        let waiting = rules.set_point_while_off(chosen, value(od, SET_POINT));
        let chosen_now = if duty.on { chosen } else { waiting };
        self.returned_to = match (std::mem::replace(&mut self.second, second), second) {
            (_, true) => None,
            (true, false) => Some(chosen),
            (false, false) => self.returned_to.filter(|first| *first == chosen),
        };
        let rates = rates((second, self.returned_to.is_some()), od, rules);
        self.move_set_point(elapsed, duty.on, chosen_now, effective, rates, rules);

        let (low, high) = limits(od, rules);
        let missing = effective.map(|effective| self.ramp.present() - effective as f64);
        let missing = missing.map(|missing| rules.missing(missing));
        let asked = options.self_optimisation && control & codes.control_tune != 0;
        self.tune(asked, duty, manual, missing, rules);
        let sampled = !elapsed.is_zero();
        let sight = Sight { duty, sampled, missing, manual, low, high };
        self.output = self.decide(&sight, rules);

        set(od, EFFECTIVE_VALUE, shown);
        let in_force = rules.set_point_shown(self.ramp.present(), chosen, duty.on);
        set(od, EFFECTIVE_SET_POINT, in_force);
        set(od, OUTPUT, rules.output_shown(self.output) & 0xFFFF);
        let tunes = self.relay.is_some();
        let bits = [
            (duty.on, codes.status_on),
            (tunes, codes.status_tune),
            (manual, codes.status_manual),
            (second, codes.status_second),
        ];
        let status = bits.iter().filter(|(is_set, _)| *is_set).map(|(_, bit)| bit).sum();
        set(od, STATUS, rules.status_shown(status, &codes));
        Drive { output: self.output, pump: pump(duty), draining: duty.evacuating }
    }

    fn move_set_point(
        &mut self,
        elapsed: Duration,
        on: bool,
        chosen: i64,
        effective: Option<i64>,
        rates: Rates,
        rules: &Em66Rules,
    ) {
        if !on {
            self.ramp.stop(chosen);
            return;
        }
        let start = rules.ramp_start(effective.unwrap_or(chosen), chosen);
        let changed = std::mem::replace(&mut self.chosen, chosen) != chosen;
        if changed && !rules.ramp_goes_on() {
            self.ramp.stop(chosen);
        }
        self.ramp.follow(chosen, start, rates, rules);
        if !elapsed.is_zero() {
            self.ramp.advance(elapsed, chosen, rates, rules);
        }
    }

    /// Begins and ends self-optimisation. A request is answered once: the next one needs the bit
    /// to go first.
    fn tune(
        &mut self,
        asked: bool,
        duty: &Duty,
        manual: bool,
        missing: Option<f64>,
        rules: &Em66Rules,
    ) {
        let ready = duty.on && !duty.cooling_down && !duty.evacuating && !duty.blocked;
        let wanted = rules.tunes(asked, ready, manual, self.relay.is_some());
        self.answered = rules.tuning_answered(self.answered, wanted, duty.on);
        match missing.filter(|_| wanted) {
            None => self.relay = None,
            Some(missing) if !self.answered => {
                self.relay = Some(Relay::begin(missing));
                self.answered = true;
            }
            Some(_) => {}
        }
    }

    /// The output that follows.
    fn decide(&mut self, sight: &Sight, rules: &Em66Rules) -> i64 {
        let duty = sight.duty;
        if !duty.on {
            self.pid.restart();
            return rules.output_while_off(self.output);
        }
        let Some(missing) = sight.missing.filter(|_| !duty.blocked && !duty.evacuating) else {
            self.pid.restart();
            return 0;
        };
        if duty.cooling_down {
            self.pid.restart();
            return rules.limits_while(Activity::CoolingDown, sight.low, sight.high).0;
        }
        let held = sight.manual && rules.manual_holds();
        let activity =
            if held { Some(Activity::Manual) } else { self.relay.map(|_| Activity::Tuning) };
        let (low, high) = match activity {
            Some(activity) => rules.limits_while(activity, sight.low, sight.high),
            None => (sight.low, sight.high),
        };
        if held || !sight.sampled {
            return self.output.clamp(low, high);
        }
        self.control(missing, low, high)
    }

    /// One sample of the relay or of the controller.
    fn control(&mut self, missing: f64, low: i64, high: i64) -> i64 {
        if let Some(relay) = &mut self.relay {
            match relay.advance(missing, low as f64, high as f64) {
                Step::Output(output) => return output.round() as i64,
                Step::Done(gains) => {
                    self.pid.gains = gains;
                    self.relay = None;
                }
            }
        }
        let output = self.pid.advance(missing, low as f64 / COOLING_SHARE, high as f64);
        let share = if output < 0.0 { COOLING_SHARE } else { 1.0 };
        (output * share).round() as i64
    }
}

/// How fast the set point may move (3.4.14).
fn rates((second, returns): (bool, bool), od: &Dictionary, rules: &Em66Rules) -> Rates {
    if second && !rules.ramps_to_second() || returns && !rules.ramps_back_from_second() {
        return Rates::default();
    }
    let (heating, cooling) = rules.rates(value(od, HEATING_RAMP), value(od, COOLING_RAMP));
    Rates { heating, cooling }
}

/// The limits that 6413h and 6414h set for the output. A device without 6413h cannot cool.
fn limits(od: &Dictionary, rules: &Em66Rules) -> (i64, i64) {
    let (low, high) = (value(od, LOWER_LIMIT), od.int(UPPER_LIMIT).unwrap_or(FULL_OUTPUT));
    let (low, high) = rules.output_limits(low, high);
    (low.clamp(-FULL_OUTPUT, 0), high.clamp(0, FULL_OUTPUT))
}

/// It circulates while the controller is on; while the mould is emptied, it rests. It sucks
/// whenever suction is on.
const fn pump(duty: &Duty) -> Pump {
    match (duty.evacuating, duty.suction, duty.on) {
        (true, _, _) | (false, false, false) => Pump::Off,
        (false, true, _) => Pump::Backward,
        (false, false, true) => Pump::Forward,
    }
}

/// 100 % in tenths of a percent.
const FULL_OUTPUT: i64 = 1000;
/// The cooler is stronger than the heater, so less of it does the same.
const COOLING_SHARE: f64 = 0.4;
/// Objects that can be written but accept one value only: units and digits.
const FIXED: [u16; 4] = [0x6406, 0x6407, 0x6415, 0x6416];

#[cfg(test)]
mod tests;
