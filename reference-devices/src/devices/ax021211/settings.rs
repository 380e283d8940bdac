//! The settings of the blocks. A write concerns few blocks, and only those read it.

use canopen::{Dictionary, Mux};

use super::graph::{self, BLOCKS, Block, Blocks, Order, Taken, Wiring};
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
use super::signal::Link;
use super::table::TableSettings;

/// The settings of the blocks, and the part that they have not read.
#[derive(Clone, Debug)]
pub(super) struct Settings {
    pub(super) outputs: [OutputSettings; OUTPUTS],
    pub(super) tables: [TableSettings; 12],
    pub(super) maths: [MathSettings; 6],
    pub(super) logics: [LogicSettings; 4],
    pub(super) pids: [PidSettings; 4],
    /// The graph that the links define.
    wiring: Wiring,
    /// The readers that have not yet seen a change of the dictionary.
    unread: Readers,
    /// How many changes of the dictionary are in `unread`.
    noticed: u64,
}

/// A set of readers of objects: blocks, and the values from outside.
pub(super) type Readers = Blocks;

/// Messages 1 to 10, extra received values, constants.
pub(super) const OF_MESSAGES: Readers = 1 << BLOCKS;
pub(super) const OF_EXTRAS: Readers = 2 << BLOCKS;
pub(super) const OF_CONSTANTS: Readers = 4 << BLOCKS;
pub(super) const OF_VALUES: Readers = OF_MESSAGES | OF_EXTRAS | OF_CONSTANTS;
const EVERYONE: Readers = graph::ALL | OF_VALUES;

/// The result of reading settings again.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Renewed {
    /// The blocks that are set up for something else than before.
    pub(super) blocks: Blocks,
    /// A block takes another signal than before.
    pub(super) rewired: bool,
}

impl Settings {
    /// The settings of blocks that have read nothing yet.
    pub(super) fn unread(rules: &Ax021211Rules) -> Self {
        let mut settings = Self {
            outputs: [OutputSettings::default(); OUTPUTS],
            tables: [TableSettings::default(); 12],
            maths: [MathSettings::default(); 6],
            logics: [LogicSettings::default(); 4],
            pids: [PidSettings::default(); 4],
            wiring: [graph::taken([]); BLOCKS],
            unread: EVERYONE,
            noticed: 0,
        };
        for block in graph::members(graph::ALL) {
            settings.wiring[block.number()] = settings.taken(block, rules);
        }
        settings
    }

    /// Reads all settings and values again where something has changed.
    pub(super) fn restart(&mut self, od: Parameters<'_>) -> Renewed {
        self.notice(od);
        let renewed = self.renew(graph::ALL, od);
        // A reader that restarts has no values yet.
        self.unread |= OF_VALUES;
        renewed
    }

    /// Notes which blocks read the changed entries of the dictionary.
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

    /// Skips the changes that come from the blocks' own results, which no block reads.
    pub(super) const fn pass_over(&mut self, od: &Dictionary) {
        self.noticed = od.changes();
    }

    /// The readers among `readers` with something to read; they count as having read it from now
    /// on.
    pub(super) fn take_unread(&mut self, readers: Readers) -> Readers {
        let due = self.unread & readers;
        self.unread &= !readers;
        due
    }

    /// Reads the settings of these blocks where something has changed.
    pub(super) fn renew(&mut self, blocks: Blocks, od: Parameters<'_>) -> Renewed {
        let mut renewed = Renewed::default();
        for block in graph::members(self.take_unread(blocks)) {
            let differs = match block {
                Block::Math(place) => {
                    replace(&mut self.maths[place], MathSettings::read(od, place))
                }
                Block::Table(place) => {
                    replace(&mut self.tables[place], TableSettings::read(od, place))
                }
                Block::Pid(place) => replace(&mut self.pids[place], PidSettings::read(od, place)),
                Block::Logic(place) => {
                    replace(&mut self.logics[place], LogicSettings::read(od, place))
                }
                Block::Output(place) => {
                    replace(&mut self.outputs[place], OutputSettings::read(od, place))
                }
            };
            if differs {
                let taken = self.taken(block, od.rules);
                renewed.blocks |= block.bit();
                renewed.rewired |= replace(&mut self.wiring[block.number()], taken);
            }
        }
        // A message has the type and the scaling of its output.
        if renewed.blocks & graph::ALL_OUTPUTS != 0 {
            self.unread |= OF_MESSAGES;
            renewed.rewired |= od.rules.others_take_a_bit(true) && self.rewire(od.rules);
        }
        renewed
    }

    /// Connects all blocks anew. Returns whether one takes another signal than before.
    fn rewire(&mut self, rules: &Ax021211Rules) -> bool {
        let blocks = graph::members(graph::ALL);
        blocks.fold(false, |any, block| {
            let taken = self.taken(block, rules);
            replace(&mut self.wiring[block.number()], taken) || any
        })
    }

    /// The order of evaluation.
    pub(super) fn order(&self) -> Order {
        Order::of(&self.wiring)
    }

    /// The signal that an input of a block takes; `None` without a source.
    pub(super) fn source(&self, block: Block, input: usize) -> Option<usize> {
        let place = self.wiring[block.number()][input];
        (place != graph::NOTHING).then_some(place.into())
    }

    /// The link of an input, other than the control input of an output.
    pub(super) fn named(&self, link: Link, rules: &Ax021211Rules) -> Link {
        let numbered = link.message().filter(|place| *place < OUTPUTS);
        let is_digital = |place: usize| self.outputs[place].kind.is_digital();
        match numbered.is_some_and(|place| rules.others_take_a_bit(is_digital(place))) {
            true => Link::state(link.number),
            false => rules.link(link),
        }
    }

    fn taken(&self, block: Block, rules: &Ax021211Rules) -> Taken {
        let named = |link| self.named(link, rules);
        match block {
            Block::Math(place) => {
                graph::taken(self.maths[place].inputs.map(|input| named(input.link)))
            }
            Block::Table(place) => graph::taken([named(self.tables[place].x)]),
            Block::Pid(place) => {
                let pid = &self.pids[place];
                graph::taken([pid.target, pid.feedback].map(named))
            }
            Block::Logic(place) => {
                let (arguments, tables) = self.logics[place].links();
                // It selects among tables, which are not sources that a user chooses.
                graph::taken(arguments.into_iter().flatten().flatten().map(named).chain(tables))
            }
            Block::Output(place) => {
                let [control, enable, overriding] = self.outputs[place].links;
                graph::taken([rules.link(control), named(enable), named(overriding)])
            }
        }
    }
}

/// Takes over a value. Returns whether it is another one.
fn replace<T: PartialEq>(value: &mut T, new: T) -> bool {
    let differs = *value != new;
    if differs {
        *value = new;
    }
    differs
}

/// Everyone whose settings or values an entry is a part of, and maybe some more.
fn readers(mux: Mux, rules: &Ax021211Rules) -> Readers {
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

#[cfg(test)]
mod tests {
    use super::super::rules::Ax021211Rules;
    use super::*;
    use crate::devices;
    use proptest::prelude::*;

    const RULES: &[&str] = &[
        "bit-of-a-digital-output-for-every-input",
        "math-operator-of-another-function",
        "scaling-of-another-output",
        "polarity-of-another-output",
        "tables-beyond-6-repeat",
        "math-blocks-are-one",
        "logic-blocks-are-two",
        "loops-are-one",
    ];

    fn rules(name: Option<&str>) -> Ax021211Rules {
        match name {
            Some(name) => Ax021211Rules::otherwise(name),
            None => Ax021211Rules::default(),
        }
    }

    fn assert_same(kept: &Settings, read: &Settings) {
        assert_eq!(kept.outputs, read.outputs);
        assert_eq!(kept.tables, read.tables);
        assert_eq!(kept.maths, read.maths);
        assert_eq!(kept.logics, read.logics);
        assert_eq!(kept.pids, read.pids);
        assert_eq!(kept.wiring, read.wiring);
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 32, ..ProptestConfig::default() })]

        #[test]
        fn who_reads_what_has_changed_knows_as_much_as_who_reads_everything(
            name in prop::option::of(prop::sample::select(RULES)),
            writes in prop::collection::vec((any::<prop::sample::Index>(), 0..12_i64, 0..4), 1..80),
        ) {
            let rules = &rules(name);
            let sheet = &devices::device("ax021211").unwrap().description.eds;
            let mut od = Dictionary::new(sheet, 1).unwrap();
            let mut kept = Settings::unread(rules);
            kept.restart(Parameters { od: &od, rules });
            for (place, value, look) in writes {
                let mux = place.get(od.entries_in(0x2000..=0xFFFF)).mux;
                od.set_int(mux, value);
                if look == 0 {
                    kept.restart(Parameters { od: &od, rules });
                    let mut read = Settings::unread(rules);
                    read.restart(Parameters { od: &od, rules });
                    assert_same(&kept, &read);
                } else if look == 1 {
                    kept.notice(Parameters { od: &od, rules });
                }
            }
        }
    }
}
