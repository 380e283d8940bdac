//! The function blocks and what runs between them (figure 1B).

use std::time::Duration;

use canopen::{Dictionary, Instant, Mux};

use super::graph::{self, Block, Blocks, Order};
use super::load::Load;
use super::math::Math;
use super::objects::{
    CONSTANTS, DIGITS_PV, EXTRA, EXTRA_DIGITS, EXTRA_SCALING_1, EXTRA_SCALING_2, FEEDBACK,
    FIELD_VALUE, LOGIC_OUTPUT, MATH_OUTPUT, PID_OUTPUT, PROCESS_VALUE, Parameters, RECEIVED,
    RECEIVED_STATUS, SELECTED_TABLE, WRITE_STATES, table, table_of,
};
use super::output::{Output, OutputSettings, OutputView};
use super::pid::Pid;
use super::rules::Ax021211Rules;
use super::settings::{OF_CONSTANTS, OF_EXTRAS, OF_MESSAGES, OF_VALUES, Settings};
use super::signal::{
    self, COMMANDED, EXTRAS, FEEDBACKS, LOGICS, Link, MATHS, MESSAGES, PIDS, SIGNALS, STATES,
    SUPPLY, Signal, TABLES, TEMPERATURE,
};
use super::table::Table;

/// How many outputs there are.
pub(super) const OUTPUTS: usize = 10;

/// The blocks' view of the outside.
#[derive(Clone, Debug)]
pub(super) struct Outside {
    pub(super) loads: [Load; OUTPUTS],
    /// In volts.
    pub(super) supply: f64,
    /// In degrees Celsius.
    pub(super) temperature: f64,
    /// What is mapped into an RPDO that has timed out.
    pub(super) timed_out: Missing,
    /// The node is OPERATIONAL.
    pub(super) operational: bool,
}

/// Which messages of table 5, and after them which bits of 6200h, are missing.
pub(super) type Missing = [bool; MESSAGES_OF_TABLE_5 + OUTPUTS];

pub(super) const NOTHING_MISSING: Missing = [false; MESSAGES_OF_TABLE_5 + OUTPUTS];

pub(super) const MESSAGES_OF_TABLE_5: usize = 24;

/// The blocks at work.
#[derive(Clone, Debug)]
pub(super) struct Network {
    settings: Settings,
    order: Order,
    /// The signal of each source, by the places of [`signal`].
    signals: [Signal; SIGNALS],
    /// The same at the end of the last control cycle.
    last: [Signal; SIGNALS],
    outputs: [Output; OUTPUTS],
    views: [Option<OutputView>; OUTPUTS],
    /// The blocks that must be evaluated: time alone may change them, or their inputs have changed.
    awake: Blocks,
    /// The signals that have changed in this control cycle.
    moved: Signals,
    /// The outputs' last view of the outside.
    around: Around,
    /// The messages that were missing when they were looked at last; `None` after new values.
    timed_out: Option<Missing>,
    /// The outputs have an open or short circuit that was recognised, a bit each.
    faults: u16,
    tables: [Table; 12],
    maths: [Math; 6],
    pids: [Pid; 4],
    /// The values of the objects that show the signals of blocks.
    shown: [i64; SIGNALS],
    /// The signals of which the objects do not show it yet.
    untold: Signals,
    /// The values of 3310h, and whether it shows them yet.
    selected: [u8; 4],
    selection_told: bool,
}

/// A set of signals, each with the bit of its place.
type Signals = u128;

/// The outputs' view of the outside.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Around {
    loads: [Load; OUTPUTS],
    /// In volts.
    supply: f64,
    /// The outputs are off, regardless of their settings.
    off: bool,
}

impl Network {
    /// Blocks that are not set up.
    pub(super) fn new(rules: &Ax021211Rules) -> Self {
        let settings = Settings::unread(rules);
        Self::fresh(settings.order(), settings)
    }

    /// Blocks as after power-on.
    pub(super) fn restart(&mut self, od: Parameters<'_>) {
        let mut settings = self.settings.clone();
        let order = match settings.restart(od).rewired {
            true => settings.order(),
            false => self.order.clone(),
        };
        let (pids, tables) = (self.pids, self.tables);
        *self = Self::fresh(order, settings);
        if !od.rules.forgets() {
            (self.pids, self.tables) = (pids, tables);
        }
        self.receive(od);
    }

    fn fresh(order: Order, settings: Settings) -> Self {
        Self {
            order,
            signals: [Signal::ABSENT; SIGNALS],
            last: [Signal::ABSENT; SIGNALS],
            outputs: [Output::default(); OUTPUTS],
            views: [None; OUTPUTS],
            awake: graph::ALL,
            moved: 0,
            around: Around { loads: [Load::default(); OUTPUTS], supply: 0.0, off: false },
            timed_out: None,
            faults: 0,
            tables: [Table::default(); 12],
            maths: [Math::default(); 6],
            pids: [Pid::default(); 4],
            shown: [0; SIGNALS],
            untold: (PIDS..SUPPLY).fold(0, |all, place| all | 1 << place),
            // Until a block is evaluated, table A is the one that is selected; this is chosen.
            selected: settings.logics.each_ref().map(|logic| logic.tables[0]),
            selection_told: false,
            settings,
        }
    }

    /// Takes over what was written at an address. Returns whether the blocks see anything of it.
    pub(super) fn written(&mut self, mux: Mux, od: Parameters<'_>) -> bool {
        self.settings.notice(od);
        let index = mux.index;
        let ignored = index < 0x2000 || matches!(index, RECEIVED | RECEIVED_STATUS);
        if ignored || !od.rules.takes_over(index) {
            return false;
        }
        if matches!(index, PROCESS_VALUE | EXTRA..=EXTRA_SCALING_2 | CONSTANTS)
            || index == WRITE_STATES.index
        {
            self.receive(od);
            return true;
        }
        let kind = match (table_of(index), index) {
            (Some((place, _)), _) => Block::Table(place).bit(),
            (_, 0x3300..=0x3799) => graph::ALL_LOGICS,
            (_, 0x4000..=0x4699) => graph::ALL_MATHS,
            (_, 0x2450..=0x2457 | 0x7450..=0x7456 | 0x6458..=0x6459) => graph::ALL_PIDS,
            _ => graph::ALL_OUTPUTS,
        };
        let renewed = self.settings.renew(kind, od);
        self.awake |= renewed.blocks;
        if kind == graph::ALL_OUTPUTS {
            self.receive(od);
        }
        if renewed.rewired {
            self.order = self.settings.order();
            self.awake = graph::ALL;
        }
        true
    }

    /// Takes the values that come from outside the blocks by the network (tables 5 and 6).
    fn receive(&mut self, od: Parameters<'_>) {
        self.timed_out = None;
        let unread = self.settings.take_unread(OF_VALUES);
        if unread & OF_MESSAGES != 0 {
            self.receive_messages(od);
        }
        if unread & OF_EXTRAS != 0 {
            for place in 0..14 {
                let digits = od.byte(EXTRA_DIGITS, place);
                let scaled = |index| od.scaled(index, place, digits);
                let limits = (scaled(EXTRA_SCALING_1), scaled(EXTRA_SCALING_2));
                self.put(EXTRAS + place, Signal::new(scaled(EXTRA), Some(limits)));
            }
        }
        if unread & OF_CONSTANTS != 0 {
            for place in 0..15 {
                self.put(signal::CONSTANTS + place, Signal::new(od.real(CONSTANTS, place), None));
            }
        }
    }

    fn receive_messages(&mut self, od: Parameters<'_>) {
        let states = od.od.int(WRITE_STATES).unwrap_or(0);
        for place in 0..OUTPUTS {
            let state = od.rules.write_state(states, place);
            let state = Signal::new(f64::from(u8::from(state)), Some((0.0, 1.0)));
            self.put(STATES + place, state);
            let digits = od.byte(DIGITS_PV, place);
            let limits = self.settings.outputs[place].pv;
            let value = Signal::new(od.scaled(PROCESS_VALUE, place, digits), Some(limits));
            self.put(MESSAGES + place, value);
        }
    }

    /// Takes the state of the outside.
    pub(super) fn look(&mut self, outside: &Outside, rules: &Ax021211Rules) {
        if self.timed_out.replace(outside.timed_out) != Some(outside.timed_out) {
            let places = (MESSAGES..MESSAGES_OF_TABLE_5).chain(STATES..STATES + OUTPUTS);
            for (place, timed_out) in places.zip(&outside.timed_out) {
                let message = Signal { quality: signal::Quality::Valid, ..self.signals[place] };
                self.put(place, message.failing(rules.message_fails(*timed_out)));
            }
        }
        // Both are measured with one digit (table 6).
        let measured = |value: f64| Signal::new((value * 10.0).round() / 10.0, None);
        let (low, high) = rules.supply_errors(outside.supply);
        let (supply, temperature) = rules.measured(outside.supply, outside.temperature);
        self.put(SUPPLY, measured(supply).failing(rules.source_fails(low || high)));
        self.put(TEMPERATURE, measured(temperature));
        let off = rules.outputs_need_operational() && !outside.operational;
        let around = Around { loads: outside.loads, supply: outside.supply, off };
        if self.around != around {
            (self.around, self.awake) = (around, graph::ALL);
        }
    }

    /// Evaluates the blocks, `elapsed` after the last time, but for those that would go on as they
    /// are.
    pub(super) fn evaluate(&mut self, now: Instant, elapsed: Duration, rules: &Ax021211Rules) {
        for turn in 0..self.order.blocks.len() {
            let block = self.order.blocks[turn];
            if self.awake & block.bit() != 0
                && self.evaluate_block(block, turn, (now, elapsed), rules)
            {
                self.awake &= !block.bit();
            }
        }
    }

    /// Evaluates one block. Returns whether it would do the same again.
    fn evaluate_block(
        &mut self,
        block: Block,
        turn: usize,
        (now, elapsed): (Instant, Duration),
        rules: &Ax021211Rules,
    ) -> bool {
        match block {
            Block::Math(place) => {
                let mut math = self.maths[place];
                let read = |link| self.read(link, turn, rules);
                let (shown, signal) =
                    math.evaluate(place, &self.settings.maths[place], read, rules);
                self.maths[place] = math;
                self.keep(MATHS + place, shown, signal);
                true
            }
            Block::Table(place) => {
                let (settings, before) = (&self.settings.tables[place], self.tables[place]);
                let x = self.take(block, 0, turn);
                let (shown, signal) = self.tables[place].evaluate(now, settings, x, rules);
                self.keep(TABLES + place, shown, signal);
                self.tables[place] == before && before.due().is_none()
            }
            Block::Pid(place) => {
                let (settings, before) = (&self.settings.pids[place], self.pids[place]);
                let [target, feedback] = [0, 1].map(|input| self.take(block, input, turn));
                let (shown, signal) =
                    self.pids[place].evaluate(now, settings, target, feedback, rules);
                self.keep(PIDS + place, shown, signal);
                self.pids[place] == before && before.due().is_none()
            }
            Block::Logic(place) => {
                let read = |link| self.read(link, turn, rules);
                let table = |signal| self.see(signal, turn);
                let (settings, before) = (&self.settings.logics[place], self.selected[place]);
                let (selected, shown, signal) = settings.evaluate(before, read, table, rules);
                let rests = selected == before && settings.tables.contains(&selected);
                self.selected[place] = selected;
                self.selection_told &= selected == before;
                self.keep(LOGICS + place, shown, signal);
                rests
            }
            Block::Output(place) => {
                let (own, before) = (&self.settings.outputs[place], self.outputs[place]);
                let inputs = [0, 1, 2].map(|input| self.take(block, input, turn));
                let settings = if self.around.off { &OutputSettings::default() } else { own };
                let outside = (&self.around.loads[place], self.around.supply);
                let output = &mut self.outputs[place];
                let view = output.evaluate((now, elapsed), settings, inputs, outside, rules);
                let rests = *output == before && before.due(now).is_none();
                self.keep(COMMANDED + place, view.commanded.0, view.commanded.1);
                self.keep(FEEDBACKS + place, view.feedback.0, view.feedback.1);
                self.views[place] = Some(view);
                let fault = u16::from(self.outputs[place].has_fault()) << place;
                self.faults = self.faults & !(1 << place) | fault;
                rests
            }
        }
    }

    fn keep(&mut self, place: usize, shown: i64, signal: Signal) {
        if self.shown[place] != shown {
            self.shown[place] = shown;
            self.untold |= 1 << place;
        }
        self.put(place, signal);
    }

    fn put(&mut self, place: usize, signal: Signal) {
        if self.signals[place] != signal {
            self.signals[place] = signal;
            self.moved |= 1 << place;
            self.awake |= self.order.takers(place);
        }
    }

    /// The signal at an input of the block whose turn it is.
    fn take(&self, block: Block, input: usize, turn: usize) -> Signal {
        self.settings.source(block, input).map_or(Signal::ABSENT, |place| self.see(place, turn))
    }

    /// The signal of a link, for the block whose turn it is.
    fn read(&self, link: Link, turn: usize, rules: &Ax021211Rules) -> Signal {
        self.settings
            .named(link, rules)
            .place()
            .map_or(Signal::ABSENT, |place| self.see(place, turn))
    }

    fn see(&self, place: usize, turn: usize) -> Signal {
        match self.order.is_before(place, turn + 1) {
            true => self.signals[place],
            false => self.last[place],
        }
    }

    /// A control cycle is over: its signals are what circles see in the next one. Returns whether
    /// anything changed since the end of the one before.
    pub(super) fn finish(&mut self) -> bool {
        let mut any = false;
        for place in places(std::mem::take(&mut self.moved)) {
            if self.last[place] != self.signals[place] {
                self.last[place] = self.signals[place];
                self.awake |= self.order.late_takers(place);
                any = true;
            }
        }
        for (place, math) in self.maths.iter_mut().enumerate() {
            if math.finish() {
                self.awake |= Block::Math(place).bit();
                any = true;
            }
        }
        any
    }

    /// When time alone changes anything next.
    pub(super) fn due(&self, now: Instant) -> Option<Instant> {
        let due = |block| match block {
            Block::Table(place) => self.tables[place].due(),
            Block::Pid(place) => self.pids[place].due(),
            Block::Output(place) => self.outputs[place].due(now),
            Block::Math(_) | Block::Logic(_) => None,
        };
        graph::members(self.awake).filter_map(due).min()
    }

    /// Shows what the blocks make in their objects.
    pub(super) fn show(&mut self, od: &mut Dictionary, rules: &Ax021211Rules) {
        if self.untold == 0 && self.selection_told {
            return;
        }
        self.settings.notice(Parameters { od, rules });
        for place in places(std::mem::take(&mut self.untold)) {
            od.set_int(address(place), self.shown[place]);
        }
        if !std::mem::replace(&mut self.selection_told, true) {
            for (place, number) in self.selected.iter().enumerate() {
                od.set_int(Mux::new(SELECTED_TABLE, place as u8 + 1), (*number).into());
            }
        }
        self.settings.pass_over(od);
    }

    /// The result of the last control cycle for an output.
    pub(super) const fn view(&self, place: usize) -> Option<&OutputView> {
        self.views[place].as_ref()
    }

    /// The settings of an output.
    pub(super) const fn output(&self, place: usize) -> &OutputSettings {
        &self.settings.outputs[place]
    }

    /// The outputs with an open or short circuit that was recognised, a bit each.
    pub(super) const fn faults(&self) -> u16 {
        self.faults
    }

    /// The limits of the X-axis of a table, which are those of its source (1.5.1).
    pub(super) fn x_limits(&self, place: usize) -> Option<(f64, f64)> {
        self.signals[self.settings.tables[place].x.place()?].limits
    }
}

/// The places of a set of signals.
fn places(mut signals: Signals) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let place = signals.trailing_zeros() as usize;
        signals &= signals.wrapping_sub(1);
        (place < SIGNALS).then_some(place)
    })
}

/// Where a block shows its signal.
fn address(place: usize) -> Mux {
    let sub = |first: usize| (place - first + 1) as u8;
    match place {
        PIDS..TABLES => Mux::new(PID_OUTPUT, sub(PIDS)),
        TABLES..MATHS => Mux::new(table(place - TABLES, 8), 0),
        MATHS..LOGICS => Mux::new(MATH_OUTPUT, sub(MATHS)),
        LOGICS..COMMANDED => Mux::new(LOGIC_OUTPUT, sub(LOGICS)),
        COMMANDED..FEEDBACKS => Mux::new(FIELD_VALUE, sub(COMMANDED)),
        _ => Mux::new(FEEDBACK, sub(FEEDBACKS)),
    }
}
