//! The application of the ten-output valve controller AX021211 (UMAX021211, chapters 1 and 2):
//! function blocks that the user connects with each other, and ten outputs.
//!
//! A control cycle takes 1 ms, which is chosen. It evaluates every block once, after the blocks
//! that it takes signals from; in a circle the signal of the last cycle counts. A block whose
//! result cannot change is skipped. While nothing moves there is no cycle: the next one comes with
//! a change from outside, or when a delay, a loop or a profile is due. A change from outside is
//! evaluated at once, as part of the current cycle.
//!
//! Pulses and dither are values, so they cost no event.

mod bench;
mod defaults;
mod detect;
mod diagnosis;
mod digital;
mod graph;
mod limits;
mod load;
mod logic;
mod math;
mod network;
mod objects;
mod output;
mod pid;
mod ramp;
mod rules;
mod settings;
mod signal;
mod table;

use std::sync::Arc;
use std::time::Duration;

use canopen::{Abort, BenchError, Dictionary, Instant, Mux, NmtState, Value};

use crate::decisions::{Otherwise, Set};
use crate::stack::{Behaviour, CommunicationEvent, Errors};

use bench::Sight;
use load::Load;
use network::{NOTHING_MISSING, Network, OUTPUTS, Outside};
use objects::{
    AUTOMATIC_UPDATES, DITHER_FREQUENCY, OUTPUT_FREQUENCY, OUTPUT_TYPE, PROCESS_VALUE, Parameters,
    RECEIVED, RECEIVED_STATUS, SUPPLY, TEMPERATURE, power, show, show_real, table, table_of,
};
use output::Kind;
use rules::Ax021211Rules;

/// The decisions of the application that deviations can override.
pub(super) const DECISIONS: Set = Set::of::<rules::Otherwise>();

/// The application of the controller.
#[derive(Clone)]
pub(super) struct Ax021211 {
    rules: Arc<Ax021211Rules>,
    network: Network,
    outside: Outside,
    powered: bool,
    /// The type of each output before the write that is going on.
    kinds: [i64; OUTPUTS],
    /// When the device started; cycles count from here.
    start: Instant,
    last: Instant,
    /// When the next cycle is due; `None` while nothing moves.
    next: Option<Instant>,
    /// Something came from outside since the last evaluation.
    touched: bool,
}

impl Ax021211 {
    /// The controller that keeps to its manual but for these decisions.
    pub(super) fn with_deviations(otherwise: &[Otherwise<'_>]) -> Self {
        Self::with(Ax021211Rules::default().with(otherwise))
    }

    fn with(rules: Ax021211Rules) -> Self {
        Self {
            // It is set up when it starts.
            network: Network::new(&rules),
            rules: Arc::new(rules),
            outside: Outside {
                loads: [Load::default(); OUTPUTS],
                supply: 24.0,
                temperature: 25.0,
                timed_out: NOTHING_MISSING,
                operational: false,
            },
            powered: true,
            kinds: [0; OUTPUTS],
            start: Instant::ZERO,
            last: Instant::ZERO,
            next: None,
            touched: true,
        }
    }

    /// Evaluates the blocks within a cycle, because something came from outside.
    fn touch(&mut self, now: Instant) {
        let next = self.cycle_after(now);
        let is_asleep = self.next != Some(next);
        if is_asleep && next == now + CYCLE {
            // It wakes up just in time for a cycle.
            return self.cycle(now);
        }
        self.network.evaluate(now, Duration::ZERO, &self.rules);
        if is_asleep {
            self.last = Instant(next.0.saturating_sub(CYCLE.as_nanos() as u64));
            self.next = Some(next);
        }
    }

    /// A control cycle.
    fn cycle(&mut self, now: Instant) {
        // Nothing moved while there were no cycles, so only the last one counts.
        let elapsed = now.since(self.last).min(CYCLE);
        self.network.evaluate(now, elapsed, &self.rules);
        self.last = now;
        let due = match self.network.finish() {
            true => Some(now),
            false => self.network.due(now),
        };
        self.next = due.map(|due| {
            // A delay that ends between two cycles is seen by the second one.
            let just_before = Instant(due.0.saturating_sub(1));
            self.cycle_after(just_before.max(now))
        });
    }

    /// The first cycle after a time.
    fn cycle_after(&self, time: Instant) -> Instant {
        let cycles = time.since(self.start).as_nanos() / CYCLE.as_nanos() + 1;
        self.start + Duration::from_nanos((cycles * CYCLE.as_nanos()) as u64)
    }

    /// Updates the objects that depend on the one at `mux`, which was the last to change.
    fn follow_up(&mut self, mux: Mux, od: &mut Dictionary) {
        let place = usize::from(mux.sub).wrapping_sub(1);
        match mux.index {
            OUTPUT_TYPE if place < OUTPUTS => self.change_type(mux, od),
            OUTPUT_FREQUENCY if place < OUTPUTS => self.share_frequency(mux, od),
            RECEIVED => {
                if let Some(changed) = self.copy_received(mux.sub, od) {
                    let status = Mux::new(RECEIVED_STATUS, mux.sub);
                    od.set_int(status, self.rules.status_after_copy(changed));
                }
            }
            RECEIVED_STATUS if self.rules.copies_with_the_validation() => {
                let copied = self.copy_received(mux.sub, od);
                if let Some(changed) = copied
                    && self.rules.copy_ends_each_validation()
                {
                    od.set_int(mux, self.rules.status_after_copy(changed));
                }
            }
            index => {
                // A time response begins at 0 for 0 ms, and has no digits (1.5.4).
                if let Some((place, 5)) = table_of(index)
                    && mux.sub == 1
                    && od.int(mux) == Some(1)
                {
                    for (item, sub) in [(3, 0), (6, 1), (7, 1)] {
                        if let Some(value) = self.rules.first_point(item) {
                            od.set_int(Mux::new(table(place, item), sub), value);
                        }
                    }
                }
            }
        }
    }

    /// Spreads the points of an X-axis evenly between the limits of its new source; the address of
    /// the first one if that was done.
    fn spread_points(&self, index: u16, od: &mut Dictionary) -> Option<Mux> {
        let (place, 0 | 1) = table_of(index)? else { return None };
        let (low, high) = self.network.x_limits(place)?;
        let unit = power(od.int(Mux::new(table(place, 3), 0))? as u8);
        for step in 0..=10_u8 {
            let point = low + (high - low) * f64::from(step) / 10.0;
            let mux = Mux::new(table(place, 6), step + 1);
            od.set_int(mux, (point * unit).round() as i64);
        }
        Some(Mux::new(table(place, 6), 1))
    }

    /// 7F50h, if it is valid, into 7300h (2.3.17); if it was, whether that changed 7300h.
    fn copy_received(&self, sub: u8, od: &mut Dictionary) -> Option<bool> {
        let status = od.int(Mux::new(RECEIVED_STATUS, sub)).unwrap_or(0);
        self.rules.takes_received(status).then(|| {
            let value = od.int(Mux::new(RECEIVED, sub)).unwrap_or(0);
            let before = od.int(Mux::new(PROCESS_VALUE, sub));
            od.set_int(Mux::new(PROCESS_VALUE, sub), value);
            before != Some(value)
        })
    }

    /// 6310h (1.3, 1.8).
    fn change_type(&mut self, mux: Mux, od: &mut Dictionary) {
        let code = od.int(mux).unwrap_or(0);
        let known = &mut self.kinds[usize::from(mux.sub) - 1];
        if std::mem::replace(known, code) == code && !self.rules.updates_with_the_same_type() {
            return;
        }
        let enabled = od.int(AUTOMATIC_UPDATES).is_some_and(|enabled| enabled != 0);
        if let Some(kind) = Kind::of(code)
            && self.rules.updates(enabled, kind)
        {
            defaults::update(mux.sub, kind, od, &self.rules);
        }
    }

    /// 2380h: the outputs of a bank share a timer (1.3).
    fn share_frequency(&self, mux: Mux, od: &mut Dictionary) {
        let value = od.int(mux).unwrap_or(0);
        if !self.rules.frequency_is_shared() {
            return;
        }
        let bank = self.rules.bank(usize::from(mux.sub) - 1);
        for place in (0..OUTPUTS).filter(|place| self.rules.bank(*place) == bank) {
            show(od, Mux::new(OUTPUT_FREQUENCY, place as u8 + 1), value);
        }
    }

    /// The frequencies of the pulses and of the dithers in hertz.
    fn frequencies(&self, od: &Dictionary) -> ([i64; OUTPUTS], [i64; OUTPUTS]) {
        let parameters = Parameters { od, rules: &self.rules };
        let pulses = std::array::from_fn(|place| {
            let kind = self.network.output(place).kind;
            if matches!(kind, Kind::Disabled | Kind::OnOff) {
                return 0;
            }
            let bank = self.rules.bank(place);
            let mut others = (0..OUTPUTS).filter(|other| self.rules.bank(*other) == bank);
            let has_loop = others.any(|other| self.network.output(other).kind.is_current());
            self.rules.frequency(parameters.int(OUTPUT_FREQUENCY, place), has_loop)
        });
        let dithers = std::array::from_fn(|place| {
            parameters.int(DITHER_FREQUENCY, self.rules.dither_bank(place))
        });
        (pulses, dithers)
    }
}

impl Behaviour for Ax021211 {
    fn reset(&mut self, now: Instant, od: &mut Dictionary) {
        self.powered = true;
        (self.outside.timed_out, self.outside.operational) = (NOTHING_MISSING, false);
        self.network.restart(Parameters { od, rules: &self.rules });
        for place in (0..OUTPUTS).filter(|_| self.rules.reads_types_at_a_start()) {
            self.kinds[place] = od.int(Mux::new(OUTPUT_TYPE, place as u8 + 1)).unwrap_or(0);
        }
        (self.start, self.last, self.next) = (now, now, None);
        self.touched = true;
    }

    fn supply_lost(&mut self) {
        self.powered = false;
        self.next = None;
    }

    fn check(&self, mux: Mux, bytes: &[u8], od: &Dictionary) -> Result<(), Abort> {
        let checked = limits::check(mux, bytes, od, (&self.network, &*self.rules));
        checked.or_else(|abort| self.rules.refused(mux, abort))
    }

    fn written(&mut self, _now: Instant, mux: Mux, od: &mut Dictionary) {
        self.follow_up(mux, od);
        let parameters = Parameters { od, rules: &self.rules };
        self.touched |= self.network.written(mux, parameters);
        if self.rules.source_spreads_points()
            && let Some(points) = self.spread_points(mux.index, od)
        {
            let parameters = Parameters { od, rules: &self.rules };
            self.touched |= self.network.written(points, parameters);
        }
        let parameters = Parameters { od, rules: &self.rules };
        if matches!(mux.index, RECEIVED | RECEIVED_STATUS) {
            let value = Mux::new(PROCESS_VALUE, mux.sub);
            self.touched |= self.network.written(value, parameters);
        }
    }

    fn event(&mut self, _now: Instant, event: CommunicationEvent, _od: &mut Dictionary) {
        if let CommunicationEvent::Entered(state) = event {
            self.outside.operational = state == NmtState::OPERATIONAL;
            self.touched |= self.rules.outputs_need_operational();
        }
    }

    fn run(&mut self, now: Instant, od: &mut Dictionary, errors: &mut Errors) {
        let timed_out = diagnosis::timed_out(errors, od, &self.rules);
        self.touched |= std::mem::replace(&mut self.outside.timed_out, timed_out) != timed_out;
        if self.touched {
            self.network.look(&self.outside, &self.rules);
        }
        while let Some(due) = self.next.filter(|due| *due <= now) {
            self.cycle(due);
        }
        if std::mem::take(&mut self.touched) {
            self.touch(now);
            let (supply, temperature) =
                self.rules.measured(self.outside.supply, self.outside.temperature);
            show_real(od, SUPPLY, supply);
            show_real(od, TEMPERATURE, temperature);
        }
        self.network.show(od, &self.rules);
        diagnosis::report(&self.network, self.outside.supply, errors, &self.rules);
    }

    fn poll_at(&self) -> Option<Instant> {
        self.next
    }

    fn bench_names(&self) -> Vec<String> {
        bench::names()
    }

    fn stimulate(
        &mut self,
        _now: Instant,
        name: &str,
        value: &Value,
        _od: &mut Dictionary,
    ) -> Result<(), BenchError> {
        self.touched = true;
        bench::set(&mut self.outside, name, value)
    }

    fn observe(&self, name: &str, od: &Dictionary) -> Option<Value> {
        let (pulses, dithers) = self.frequencies(od);
        let (outside, network, rules) = (&self.outside, &self.network, &*self.rules);
        Sight { outside, network, rules, pulses, dithers, powered: self.powered }.observe(name)
    }

    fn triggers(&mut self, _mux: Mux, _last: &[u8], _od: &Dictionary) -> bool {
        self.rules.sends_on_change()
    }
}

/// The time from one evaluation of the blocks to the next. Chosen: the manual names none.
const CYCLE: Duration = Duration::from_millis(1);

#[cfg(test)]
mod model;
#[cfg(test)]
mod tests;
