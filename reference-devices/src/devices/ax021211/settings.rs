//! What the blocks are set up for. A write concerns few of them, and only those read it.

use canopen::{Dictionary, Mux};

use super::graph::{self, BLOCKS, Block, Blocks, Order};
use super::logic::LogicSettings;
use super::math::MathSettings;
use super::network::OUTPUTS;
use super::objects::{
    CONSTANTS, DIGITS_PV, EXTRA, EXTRA_SCALING_2, POLARITIES, PROCESS_VALUE, Parameters,
    WRITE_STATES, logic, math, table, table_of,
};
use super::output::OutputSettings;
use super::pid::PidSettings;
use super::rules::Ax021211Rules;
use super::table::TableSettings;

/// What the blocks are set up for, and what of it they have not read.
#[derive(Clone, Debug)]
pub(super) struct Settings {
    pub(super) outputs: [OutputSettings; OUTPUTS],
    pub(super) tables: [TableSettings; 12],
    pub(super) maths: [MathSettings; 6],
    pub(super) logics: [LogicSettings; 4],
    pub(super) pids: [PidSettings; 4],
    /// Who has not read what has changed in the dictionary.
    unread: Readers,
    /// How many changes of the dictionary are in `unread`.
    noticed: u64,
}

/// A set of those who read objects: blocks, and the values that come from outside.
pub(super) type Readers = Blocks;

/// Messages 1 to 10, extra received values, constants.
pub(super) const OF_MESSAGES: Readers = 1 << BLOCKS;
pub(super) const OF_EXTRAS: Readers = 2 << BLOCKS;
pub(super) const OF_CONSTANTS: Readers = 4 << BLOCKS;
pub(super) const OF_VALUES: Readers = OF_MESSAGES | OF_EXTRAS | OF_CONSTANTS;
const EVERYONE: Readers = graph::ALL | OF_VALUES;

/// What came of reading settings anew.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Renewed {
    /// The blocks that are set up for something else than before.
    pub(super) blocks: Blocks,
    /// A block takes another signal than before.
    pub(super) rewired: bool,
}

impl Settings {
    /// All of them.
    pub(super) fn read(od: Parameters<'_>) -> Self {
        Self {
            outputs: std::array::from_fn(|place| OutputSettings::read(od, place)),
            tables: std::array::from_fn(|place| TableSettings::read(od, place)),
            maths: std::array::from_fn(|place| MathSettings::read(od, place)),
            logics: std::array::from_fn(|place| LogicSettings::read(od, place)),
            pids: std::array::from_fn(|place| PidSettings::read(od, place)),
            unread: OF_VALUES,
            noticed: od.od.changes(),
        }
    }

    /// Notes who reads what has changed in the dictionary.
    pub(super) fn notice(&mut self, od: Parameters<'_>) {
        match od.od.changed_since(self.noticed) {
            Some(changed) => {
                let readers = changed.map(|mux| readers(mux, od.rules));
                self.unread = readers.fold(self.unread, |all, some| all | some);
            }
            None => self.unread = EVERYONE,
        }
        self.noticed = od.od.changes();
    }

    /// The blocks have shown what they make, which nobody reads.
    pub(super) const fn pass_over(&mut self, od: &Dictionary) {
        self.noticed = od.changes();
    }

    /// Those of `readers` that have something to read; from now on they have read it.
    pub(super) fn take_unread(&mut self, readers: Readers) -> Readers {
        let due = self.unread & readers;
        self.unread &= !readers;
        due
    }

    /// Reads the settings of these blocks where something has changed.
    pub(super) fn renew(&mut self, blocks: Blocks, od: Parameters<'_>) -> Renewed {
        let mut renewed = Renewed::default();
        for block in graph::members(self.take_unread(blocks)) {
            let links_differ = match block {
                Block::Math(place) => {
                    let links = |math: &MathSettings| math.inputs.map(|input| input.link);
                    replace(&mut self.maths[place], MathSettings::read(od, place), links)
                }
                Block::Table(place) => {
                    replace(&mut self.tables[place], TableSettings::read(od, place), |table| {
                        table.x
                    })
                }
                Block::Pid(place) => {
                    let links = |pid: &PidSettings| (pid.target, pid.feedback);
                    replace(&mut self.pids[place], PidSettings::read(od, place), links)
                }
                Block::Logic(place) => {
                    let read = LogicSettings::read(od, place);
                    replace(&mut self.logics[place], read, LogicSettings::links)
                }
                Block::Output(place) => {
                    let read = OutputSettings::read(od, place);
                    replace(&mut self.outputs[place], read, |output| output.links)
                }
            };
            if let Some(links_differ) = links_differ {
                renewed.blocks |= block.bit();
                renewed.rewired |= links_differ;
            }
        }
        // A message has the type and the scaling of its output.
        if renewed.blocks & graph::ALL_OUTPUTS != 0 {
            self.unread |= OF_MESSAGES;
        }
        renewed
    }

    /// The order of evaluation.
    pub(super) fn order(&self, rules: &dyn Ax021211Rules) -> Order {
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

/// Takes over settings. Returns whether what they link is something else than before; `None` when
/// they are the same.
fn replace<S: PartialEq, L: PartialEq>(
    settings: &mut S,
    read: S,
    links: impl Fn(&S) -> L,
) -> Option<bool> {
    if *settings == read {
        return None;
    }
    let before = std::mem::replace(settings, read);
    Some(links(&before) != links(settings))
}

/// Everyone whose settings or values an entry is a part of, and maybe some more.
fn readers(mux: Mux, rules: &dyn Ax021211Rules) -> Readers {
    let set = |count: usize, block: fn(usize) -> Block, reads: &dyn Fn(usize) -> bool| {
        (0..count).filter(|place| reads(*place)).fold(0, |all, place| all | block(place).bit())
    };
    // A block reads the objects of the block that the rules give it.
    let of_block = |count, block: fn(usize) -> Block, first: u16, at: usize| {
        set(count, block, &|place| rules.block(first, place) == at)
    };
    let since = |first: u16| usize::from(mux.index.wrapping_sub(first) >> 8);
    if let Some((place, _)) = table_of(mux.index) {
        return of_block(12, Block::Table, table(0, 0), place);
    }
    match mux.index {
        0..0x2000 => 0,
        PROCESS_VALUE => OF_MESSAGES,
        index if index == WRITE_STATES.index => OF_MESSAGES,
        EXTRA..=EXTRA_SCALING_2 => OF_EXTRAS,
        CONSTANTS => OF_CONSTANTS,
        0x2450..=0x2457 | 0x7450..=0x7456 | 0x6458..=0x6459 => graph::ALL_PIDS,
        0x3300..=0x33FF => graph::ALL_LOGICS,
        0x3400..=0x3799 => of_block(4, Block::Logic, logic(0, 0), since(logic(0, 0))),
        0x4000..=0x40FF => graph::ALL_MATHS,
        0x4100..=0x4699 => of_block(6, Block::Math, math(0, 0), since(math(0, 0))),
        index if index == POLARITIES.index => graph::ALL_OUTPUTS,
        index => {
            let reads = |place| rules.place(index, place) + 1 == usize::from(mux.sub);
            let messages = if index == DIGITS_PV { OF_MESSAGES } else { 0 };
            set(OUTPUTS, Block::Output, &reads) | messages
        }
    }
}
