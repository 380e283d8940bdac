//! The function blocks and what runs between them (figure 1B).

use std::time::Duration;

use canopen::{Dictionary, Instant, Mux};

use super::graph::{BLOCKS, Block, Order};
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
    /// Counts what can change a signal: an evaluation, values from outside, the end of a cycle.
    round: u64,
    /// The round in which each signal changed last.
    changed: [u64; SIGNALS],
    /// The round in which the last control cycle ended.
    finished: u64,
    /// The round in which each block was evaluated that goes on as it is until it takes another
    /// signal; 0 for the others.
    rests_since: [u64; BLOCKS],
    /// What the outputs saw last of the world.
    around: Option<Around>,
    /// The messages that were missing when they were looked at last; `None` after new values.
    timed_out: Option<[bool; 24]>,
    tables: [Table; 12],
    maths: [Math; 6],
    pids: [Pid; 4],
    /// What the objects of the signals of blocks show, and 3310h.
    shown: Shown,
    /// What they showed last; `None` when that is not known.
    told: Option<Shown>,
}

/// What the outputs see of the world.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Around {
    loads: [Load; OUTPUTS],
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
            round: 0,
            changed: [0; SIGNALS],
            finished: 0,
            rests_since: [0; BLOCKS],
            around: None,
            timed_out: None,
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
        network.order = network.settings.order(od.rules);
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
        let rewired = if let Some((place, _)) = table_of(index) {
            let read = TableSettings::read(od, place);
            replaces(&mut settings.tables[place], read, |table| table.x)
        } else if let 0x3300..=0x3799 = index {
            let read = std::array::from_fn(|place| LogicSettings::read(od, place));
            replaces(&mut settings.logics, read, |logics| {
                logics.each_ref().map(LogicSettings::links)
            })
        } else if let 0x4000..=0x4699 = index {
            let read = std::array::from_fn(|place| MathSettings::read(od, place));
            let links = |math: &MathSettings| math.inputs.each_ref().map(|input| input.link);
            replaces(&mut settings.maths, read, |maths| maths.each_ref().map(links))
        } else if let 0x2450..=0x2457 | 0x7450..=0x7456 | 0x6458..=0x6459 = index {
            let read = std::array::from_fn(|place| PidSettings::read(od, place));
            let links = |pid: &PidSettings| (pid.target, pid.feedback);
            replaces(&mut settings.pids, read, |pids| pids.each_ref().map(links))
        } else {
            let read = std::array::from_fn(|place| OutputSettings::read(od, place));
            let links = |output: &OutputSettings| output.links;
            let rewired = replaces(&mut settings.outputs, read, |all| all.each_ref().map(links));
            self.receive(od);
            rewired
        };
        if rewired {
            self.order = self.settings.order(od.rules);
        }
        self.rests_since = [0; BLOCKS];
        true
    }

    /// Takes the values that come from outside the blocks by the network (tables 5 and 6).
    fn receive(&mut self, od: Parameters<'_>) {
        self.round += 1;
        self.timed_out = None;
        let states = od.od.int(WRITE_STATES).unwrap_or(0);
        for place in 0..OUTPUTS {
            let output = &self.settings.outputs[place];
            let message = match od.rules.message_is_bit(output.kind.is_digital()) {
                true => {
                    let state = od.rules.write_state(states, place);
                    Signal::new(f64::from(u8::from(state)), Some((0.0, 1.0)))
                }
                false => {
                    let digits = od.byte(DIGITS_PV, place);
                    Signal::new(od.scaled(PROCESS_VALUE, place, digits), Some(output.pv))
                }
            };
            self.put(MESSAGES + place, message);
        }
        for place in 0..14 {
            let digits = od.byte(EXTRA_DIGITS, place);
            let scaled = |index| od.scaled(index, place, digits);
            let limits = (scaled(EXTRA_SCALING_1), scaled(EXTRA_SCALING_2));
            self.put(EXTRAS + place, Signal::new(scaled(EXTRA), Some(limits)));
        }
        for place in 0..15 {
            self.put(signal::CONSTANTS + place, Signal::new(od.real(CONSTANTS, place), None));
        }
    }

    /// Evaluates the blocks, `elapsed` after the last time, but for those that would go on as they
    /// are.
    pub(super) fn evaluate(
        &mut self,
        now: Instant,
        elapsed: Duration,
        outside: &Outside,
        rules: &dyn Ax021211Rules,
    ) {
        self.round += 1;
        if self.timed_out.replace(outside.timed_out) != Some(outside.timed_out) {
            for (place, timed_out) in outside.timed_out.iter().enumerate() {
                let message = Signal { quality: signal::Quality::Valid, ..self.signals[place] };
                self.put(place, message.failing(rules.message_fails(*timed_out)));
            }
        }
        // Both are measured with one digit (table 6).
        let measured = |value: f64| Signal::new((value * 10.0).round() / 10.0, None);
        let (low, high) = rules.supply_errors(outside.supply);
        let (supply, temperature) = rules.measured(outside.supply, outside.temperature);
        self.put(SUPPLY, measured(supply).failing(low || high));
        self.put(TEMPERATURE, measured(temperature));
        let off = rules.outputs_need_operational() && !outside.operational;
        let around = Around { loads: outside.loads, supply: outside.supply, off };
        if self.around.replace(around) != Some(around) {
            self.rests_since = [0; BLOCKS];
        }
        for turn in 0..self.order.blocks.len() {
            let block = self.order.blocks[turn];
            if !self.rests(block) {
                let rests = self.evaluate_block(block, turn, (now, elapsed), &around, rules);
                self.rests_since[block.number()] = if rests { self.round } else { 0 };
            }
        }
    }

    /// Whether a block goes on as it is: time alone does not change it, and neither does what it
    /// takes.
    fn rests(&self, block: Block) -> bool {
        let since = self.rests_since[block.number()];
        since > 0 && self.order.taken_by(block).iter().all(|place| self.changed[*place] <= since)
    }

    /// Evaluates one block. Returns whether it would do the same again.
    fn evaluate_block(
        &mut self,
        block: Block,
        turn: usize,
        (now, elapsed): (Instant, Duration),
        around: &Around,
        rules: &dyn Ax021211Rules,
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
                let x = self.read(settings.x, turn, rules);
                let (shown, signal) = self.tables[place].evaluate(now, settings, x, rules);
                self.keep(TABLES + place, shown, signal);
                self.tables[place] == before && before.due().is_none()
            }
            Block::Pid(place) => {
                let (settings, before) = (&self.settings.pids[place], self.pids[place]);
                let target = self.read(settings.target, turn, rules);
                let feedback = self.read(settings.feedback, turn, rules);
                let (shown, signal) =
                    self.pids[place].evaluate(now, settings, target, feedback, rules);
                self.keep(PIDS + place, shown, signal);
                self.pids[place] == before && before.due().is_none()
            }
            Block::Logic(place) => {
                let read = |link| self.read(link, turn, rules);
                let table = |signal| self.see(signal, turn);
                let (settings, before) = (&self.settings.logics[place], self.shown.selected[place]);
                let (selected, shown, signal) = settings.evaluate(before, read, table, rules);
                let rests = selected == before && settings.tables.contains(&selected);
                self.shown.selected[place] = selected;
                self.keep(LOGICS + place, shown, signal);
                rests
            }
            Block::Output(place) => {
                let (own, before) = (&self.settings.outputs[place], self.outputs[place]);
                let inputs = own.links.map(|link| self.read(link, turn, rules));
                let settings = if around.off { &OutputSettings::default() } else { own };
                let outside = (&around.loads[place], around.supply);
                let output = &mut self.outputs[place];
                let view = output.evaluate((now, elapsed), settings, inputs, outside, rules);
                let rests = *output == before && before.due(now).is_none();
                self.keep(COMMANDED + place, view.commanded.0, view.commanded.1);
                self.keep(FEEDBACKS + place, view.feedback.0, view.feedback.1);
                self.views[place] = Some(view);
                rests
            }
        }
    }

    fn keep(&mut self, place: usize, shown: i64, signal: Signal) {
        self.shown.signals[place] = shown;
        self.put(place, signal);
    }

    fn put(&mut self, place: usize, signal: Signal) {
        if self.signals[place] != signal {
            (self.signals[place], self.changed[place]) = (signal, self.round);
        }
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
        self.round += 1;
        let mut any = false;
        let before = std::mem::replace(&mut self.finished, self.round);
        for place in 0..SIGNALS {
            if self.changed[place] > before && self.last[place] != self.signals[place] {
                // Whoever looks back sees it from now on.
                (self.last[place], self.changed[place]) = (self.signals[place], self.round);
                any = true;
            }
        }
        for (place, math) in self.maths.iter_mut().enumerate() {
            if math.finish() {
                self.rests_since[Block::Math(place).number()] = 0;
                any = true;
            }
        }
        any
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
    fn order(&self, rules: &dyn Ax021211Rules) -> Order {
        Order::of(&|block, take| {
            let mut link = |link| take(rules.link(link));
            match block {
                Block::Math(place) => {
                    self.maths[place].inputs.iter().for_each(|input| link(input.link));
                }
                Block::Table(place) => link(self.tables[place].x),
                Block::Pid(place) => {
                    let pid = &self.pids[place];
                    [pid.target, pid.feedback].into_iter().for_each(link);
                }
                Block::Logic(place) => {
                    let (arguments, tables) = self.logics[place].links();
                    arguments.into_iter().flatten().flatten().for_each(link);
                    // It selects among tables, which are not sources that a user chooses.
                    tables.into_iter().for_each(take);
                }
                Block::Output(place) => self.outputs[place].links.into_iter().for_each(link),
            }
        })
    }
}

/// Takes over settings. Returns whether what they link is something else than before.
fn replaces<S, L: PartialEq>(settings: &mut S, read: S, links: impl Fn(&S) -> L) -> bool {
    let before = std::mem::replace(settings, read);
    links(&before) != links(settings)
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
