//! The function blocks and what runs between them (figure 1B).

use std::time::Duration;

use canopen::{Dictionary, Instant, Mux};

use super::graph::{Block, Order};
use super::load::Load;
use super::logic::LogicSettings;
use super::math::{Math, MathSettings};
use super::objects::{
    CONSTANTS, DIGITS_PV, EXTRA, EXTRA_DIGITS, EXTRA_SCALING_1, EXTRA_SCALING_2, FEEDBACK,
    FIELD_VALUE, LOGIC_OUTPUT, MATH_OUTPUT, PID_OUTPUT, PROCESS_VALUE, Parameters, RECEIVED,
    RECEIVED_STATUS, SELECTED_TABLE, WRITE_STATES, show, table, table_of,
};
use super::output::{Output, OutputSettings, OutputView};
use super::pid::{Pid, PidSettings};
use super::rules::Ax021211Rules;
use super::signal::{
    self, COMMANDED, EXTRAS, FEEDBACKS, LOGICS, Link, MATHS, MESSAGES, PIDS, SIGNALS, SUPPLY,
    Signal, TABLES, TEMPERATURE,
};
use super::table::{Table, TableSettings};

/// How many outputs there are.
pub(super) const OUTPUTS: usize = 10;

/// What the blocks are set up for.
#[derive(Clone, Debug, Default)]
struct Settings {
    outputs: [OutputSettings; OUTPUTS],
    tables: [TableSettings; 12],
    maths: [MathSettings; 6],
    logics: [LogicSettings; 4],
    pids: [PidSettings; 4],
}

/// What the blocks see of the world.
#[derive(Clone, Debug)]
pub(super) struct Outside {
    pub(super) loads: [Load; OUTPUTS],
    /// In volts.
    pub(super) supply: f64,
    /// In degrees Celsius.
    pub(super) temperature: f64,
    /// The messages of table 5 that are mapped into an RPDO that has timed out.
    pub(super) timed_out: [bool; 24],
    /// The node is OPERATIONAL.
    pub(super) operational: bool,
}

/// The blocks at work.
#[derive(Clone, Debug)]
pub(super) struct Network {
    settings: Settings,
    order: Order,
    /// What each source hands on, by the places of [`signal`].
    signals: [Signal; SIGNALS],
    /// The same at the end of the last control cycle.
    last: [Signal; SIGNALS],
    outputs: [Output; OUTPUTS],
    views: [Option<OutputView>; OUTPUTS],
    /// What was seen last by the outputs that time alone does not change.
    at_rest: [Option<Seen>; OUTPUTS],
    tables: [Table; 12],
    maths: [Math; 6],
    pids: [Pid; 4],
    /// What the objects of the signals of blocks show, and 3310h.
    shown: Shown,
    /// What they showed last; `None` when that is not known.
    told: Option<Shown>,
}

/// What an output sees beside its settings.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Seen {
    inputs: [Signal; 3],
    load: Load,
    /// In volts.
    supply: f64,
    /// The outputs are off, whatever they are set up for.
    off: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Shown {
    signals: [i64; SIGNALS],
    selected: [u8; 4],
}

impl Network {
    /// Blocks as after power-on.
    pub(super) fn new(od: Parameters<'_>) -> Self {
        let mut network = Self {
            settings: Settings::default(),
            order: Order::default(),
            signals: [Signal::ABSENT; SIGNALS],
            last: [Signal::ABSENT; SIGNALS],
            outputs: [Output::default(); OUTPUTS],
            views: [None; OUTPUTS],
            at_rest: [None; OUTPUTS],
            tables: [Table::default(); 12],
            maths: [Math::default(); 6],
            pids: [Pid::default(); 4],
            shown: Shown { signals: [0; SIGNALS], selected: [0; 4] },
            told: None,
        };
        let settings = &mut network.settings;
        settings.outputs = std::array::from_fn(|place| OutputSettings::read(od, place));
        settings.tables = std::array::from_fn(|place| TableSettings::read(od, place));
        settings.maths = std::array::from_fn(|place| MathSettings::read(od, place));
        settings.logics = std::array::from_fn(|place| LogicSettings::read(od, place));
        settings.pids = std::array::from_fn(|place| PidSettings::read(od, place));
        // Until a block is evaluated, table A is the one that is selected.
        network.shown.selected = settings.logics.each_ref().map(|logic| logic.tables[0]);
        network.order = network.settings.order();
        network.receive(od);
        network
    }

    /// Takes over what was written at an address. Returns whether the blocks see anything of it.
    pub(super) fn written(&mut self, mux: Mux, od: Parameters<'_>) -> bool {
        let (index, settings) = (mux.index, &mut self.settings);
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
        if let Some((place, _)) = table_of(index) {
            settings.tables[place] = TableSettings::read(od, place);
        } else if let 0x3300..=0x3799 = index {
            settings.logics = std::array::from_fn(|place| LogicSettings::read(od, place));
        } else if let 0x4000..=0x4699 = index {
            settings.maths = std::array::from_fn(|place| MathSettings::read(od, place));
        } else if let 0x2450..=0x2457 | 0x7450..=0x7456 | 0x6458..=0x6459 = index {
            settings.pids = std::array::from_fn(|place| PidSettings::read(od, place));
        } else {
            settings.outputs = std::array::from_fn(|place| OutputSettings::read(od, place));
            self.at_rest = [None; OUTPUTS];
            self.receive(od);
        }
        self.order = self.settings.order();
        true
    }

    /// Takes the values that come from outside the blocks by the network (tables 5 and 6).
    fn receive(&mut self, od: Parameters<'_>) {
        let states = od.od.int(WRITE_STATES).unwrap_or(0);
        for place in 0..OUTPUTS {
            let output = &self.settings.outputs[place];
            self.signals[MESSAGES + place] = match od.rules.message_is_bit(output.kind.is_digital())
            {
                true => {
                    let state = od.rules.write_state(states, place);
                    Signal::new(f64::from(u8::from(state)), Some((0.0, 1.0)))
                }
                false => {
                    let digits = od.byte(DIGITS_PV, place);
                    Signal::new(od.scaled(PROCESS_VALUE, place, digits), Some(output.pv))
                }
            };
        }
        for place in 0..14 {
            let digits = od.byte(EXTRA_DIGITS, place);
            let scaled = |index| od.scaled(index, place, digits);
            let limits = (scaled(EXTRA_SCALING_1), scaled(EXTRA_SCALING_2));
            self.signals[EXTRAS + place] = Signal::new(scaled(EXTRA), Some(limits));
        }
        for place in 0..15 {
            self.signals[signal::CONSTANTS + place] = Signal::new(od.real(CONSTANTS, place), None);
        }
    }

    /// Evaluates all blocks, `elapsed` after the last time.
    pub(super) fn evaluate(
        &mut self,
        now: Instant,
        elapsed: Duration,
        outside: &Outside,
        rules: &dyn Ax021211Rules,
    ) {
        for (place, timed_out) in outside.timed_out.iter().enumerate() {
            let message = Signal { quality: signal::Quality::Valid, ..self.signals[place] };
            self.signals[place] = message.failing(rules.message_fails(*timed_out));
        }
        // Both are measured with one digit (table 6).
        let measured = |value: f64| Signal::new((value * 10.0).round() / 10.0, None);
        let (low, high) = rules.supply_errors(outside.supply);
        let (supply, temperature) = rules.measured(outside.supply, outside.temperature);
        self.signals[SUPPLY] = measured(supply).failing(low || high);
        self.signals[TEMPERATURE] = measured(temperature);
        let off = rules.outputs_need_operational() && !outside.operational;
        for turn in 0..self.order.blocks.len() {
            match self.order.blocks[turn] {
                Block::Math(place) => self.evaluate_math(place, turn, rules),
                Block::Table(place) => {
                    let settings = &self.settings.tables[place];
                    let x = self.read(settings.x, turn, rules);
                    let (shown, signal) = self.tables[place].evaluate(now, settings, x, rules);
                    self.keep(TABLES + place, shown, signal);
                }
                Block::Pid(place) => {
                    let settings = &self.settings.pids[place];
                    let target = self.read(settings.target, turn, rules);
                    let feedback = self.read(settings.feedback, turn, rules);
                    let (shown, signal) =
                        self.pids[place].evaluate(now, settings, target, feedback, rules);
                    self.keep(PIDS + place, shown, signal);
                }
                Block::Logic(place) => {
                    let read = |link| self.read(link, turn, rules);
                    let table = |signal| self.see(signal, turn);
                    let before = self.shown.selected[place];
                    let (selected, shown, signal) =
                        self.settings.logics[place].evaluate(before, read, table, rules);
                    self.shown.selected[place] = selected;
                    self.keep(LOGICS + place, shown, signal);
                }
                Block::Output(place) => {
                    let links = &self.settings.outputs[place].links;
                    let seen = Seen {
                        inputs: links.map(|link| self.read(link, turn, rules)),
                        load: outside.loads[place],
                        supply: outside.supply,
                        off,
                    };
                    self.evaluate_output(place, (now, elapsed), seen, rules);
                }
            }
        }
    }

    fn evaluate_math(&mut self, place: usize, turn: usize, rules: &dyn Ax021211Rules) {
        let mut math = self.maths[place];
        let read = |link| self.read(link, turn, rules);
        let (shown, signal) = math.evaluate(place, &self.settings.maths[place], read, rules);
        self.maths[place] = math;
        self.keep(MATHS + place, shown, signal);
    }

    /// An output that is at rest makes the same of the same.
    fn evaluate_output(
        &mut self,
        place: usize,
        at: (Instant, Duration),
        seen: Seen,
        rules: &dyn Ax021211Rules,
    ) {
        if self.at_rest[place] == Some(seen) {
            return;
        }
        let before = self.outputs[place];
        let own = &self.settings.outputs[place];
        let settings = if seen.off { &OutputSettings::default() } else { own };
        let outside = (&seen.load, seen.supply);
        let output = &mut self.outputs[place];
        let view = output.evaluate(at, settings, seen.inputs, outside, rules);
        let rests = *output == before && output.due(at.0).is_none();
        self.at_rest[place] = rests.then_some(seen);
        self.keep(COMMANDED + place, view.commanded.0, view.commanded.1);
        self.keep(FEEDBACKS + place, view.feedback.0, view.feedback.1);
        self.views[place] = Some(view);
    }

    fn keep(&mut self, place: usize, shown: i64, signal: Signal) {
        self.shown.signals[place] = shown;
        self.signals[place] = signal;
    }

    /// What a link gives to the block whose turn it is.
    fn read(&self, link: Link, turn: usize, rules: &dyn Ax021211Rules) -> Signal {
        rules.link(link).place().map_or(Signal::ABSENT, |place| self.see(place, turn))
    }

    fn see(&self, place: usize, turn: usize) -> Signal {
        match self.order.is_before(place, turn + 1) {
            true => self.signals[place],
            false => self.last[place],
        }
    }

    /// What a unit goes on with that does not forget in a reset.
    pub(super) fn remember(&mut self, before: &Self) {
        (self.pids, self.tables) = (before.pids, before.tables);
    }

    /// A control cycle is over: its signals are what circles see in the next one. Returns whether
    /// anything changed since the end of the one before.
    pub(super) fn finish(&mut self) -> bool {
        let mut changed = self.last != self.signals;
        self.last = self.signals;
        for math in &mut self.maths {
            changed |= math.finish();
        }
        changed
    }

    /// When time alone changes anything next.
    pub(super) fn due(&self, now: Instant) -> Option<Instant> {
        let outputs = self.outputs.iter().filter_map(|output| output.due(now));
        let tables = self.tables.iter().filter_map(Table::due);
        let pids = self.pids.iter().filter_map(Pid::due);
        outputs.chain(tables).chain(pids).min()
    }

    /// Shows what the blocks make in their objects.
    pub(super) fn show(&mut self, od: &mut Dictionary) {
        if self.told == Some(self.shown) {
            return;
        }
        let told = self.told.replace(self.shown);
        for place in PIDS..SUPPLY {
            let number = self.shown.signals[place];
            match told {
                None => show(od, address(place), number),
                Some(told) if told.signals[place] == number => {}
                Some(_) => od.set_int(address(place), number),
            }
        }
        if told.is_none_or(|told| told.selected != self.shown.selected) {
            for (place, number) in self.shown.selected.iter().enumerate() {
                show(od, Mux::new(SELECTED_TABLE, place as u8 + 1), (*number).into());
            }
        }
    }

    /// What the last control cycle made of an output.
    pub(super) const fn view(&self, place: usize) -> Option<&OutputView> {
        self.views[place].as_ref()
    }

    /// What an output is set up for.
    pub(super) const fn output(&self, place: usize) -> &OutputSettings {
        &self.settings.outputs[place]
    }

    /// Whether an output has an open or short circuit that was recognised.
    pub(super) const fn has_fault(&self, place: usize) -> bool {
        self.outputs[place].has_fault()
    }

    /// The limits of the X-axis of a table, which are those of its source (1.5.1).
    pub(super) fn x_limits(&self, place: usize) -> Option<(f64, f64)> {
        self.signals[self.settings.tables[place].x.place()?].limits
    }
}

impl Settings {
    fn order(&self) -> Order {
        Order::of(&|block, take| match block {
            Block::Math(place) => {
                self.maths[place].inputs.iter().map(|input| input.link).for_each(take);
            }
            Block::Table(place) => take(self.tables[place].x),
            Block::Pid(place) => {
                let pid = &self.pids[place];
                [pid.target, pid.feedback].into_iter().for_each(take);
            }
            Block::Logic(place) => {
                let logic = &self.logics[place];
                let conditions = logic.conditions.iter().flatten();
                let arguments = conditions.flat_map(|condition| condition.arguments);
                let tables = logic.tables.map(|number| Link::new(TABLE_SOURCE, number));
                arguments.chain(tables).for_each(take);
            }
            Block::Output(place) => self.outputs[place].links.into_iter().for_each(take),
        })
    }
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

/// Source 4 of table 4.
const TABLE_SOURCE: u8 = 4;
