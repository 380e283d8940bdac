//! The order in which blocks are evaluated. A block comes after the blocks that it takes signals
//! from. Where blocks form a circle, there is no such order. Then the block that the walk meets
//! first comes last, and a block takes the signal of the last control cycle from any block that
//! comes later.

use super::signal::{COMMANDED, FEEDBACKS, LOGICS, Link, MATHS, PIDS, SIGNALS, SUPPLY, TABLES};

/// A set of blocks, each with the bit of its [number](Block::number).
pub(super) type Blocks = u64;

/// A function block, by its place from 0 on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Block {
    Math(usize),
    Table(usize),
    Pid(usize),
    Logic(usize),
    Output(usize),
}

/// The order of evaluation.
#[derive(Clone, Debug)]
pub(super) struct Order {
    pub(super) blocks: Vec<Block>,
    /// For each signal the turn of the block that it comes from, counted from 1 on; 0 for what
    /// comes from outside.
    turns: [u8; SIGNALS],
    /// For each signal the blocks that come after it and take it.
    takers: [Blocks; SIGNALS],
    /// For each signal the blocks that take what it was in the last control cycle.
    late_takers: [Blocks; SIGNALS],
}

/// How many blocks there are.
pub(super) const BLOCKS: usize = 36;

/// The places of the signals that a block takes, in the order of its links; [`NOTHING`] where a
/// link names none.
pub(super) type Taken = [u8; LINKS];

/// The inputs of the blocks, by the blocks' numbers.
pub(super) type Wiring = [Taken; BLOCKS];

/// The most links of a block: a logic block has 18 arguments and 3 tables.
const LINKS: usize = 21;
pub(super) const NOTHING: u8 = u8::MAX;

/// The signals that links name.
pub(super) fn taken(links: impl IntoIterator<Item = Link>) -> Taken {
    let mut taken = [NOTHING; LINKS];
    for (place, link) in taken.iter_mut().zip(links) {
        *place = link.place().map_or(NOTHING, |signal| signal as u8);
    }
    taken
}

/// The sets of the blocks of a kind.
pub(super) const ALL_MATHS: Blocks = 0x3F;
pub(super) const ALL_TABLES: Blocks = 0xFFF << 6;
pub(super) const ALL_PIDS: Blocks = 0xF << 18;
pub(super) const ALL_LOGICS: Blocks = 0xF << 22;
pub(super) const ALL_OUTPUTS: Blocks = 0x3FF << 26;
pub(super) const ALL: Blocks = ALL_MATHS | ALL_TABLES | ALL_PIDS | ALL_LOGICS | ALL_OUTPUTS;

/// The blocks of a set, in the order in which the walk begins with them.
pub(super) fn members(mut blocks: Blocks) -> impl Iterator<Item = Block> {
    std::iter::from_fn(move || {
        let number = blocks.trailing_zeros() as usize;
        blocks &= blocks.wrapping_sub(1);
        (number < BLOCKS).then(|| Block::numbered(number))
    })
}

impl Block {
    /// The block that a signal comes from; `None` when it comes from outside.
    pub(super) fn of(signal: usize) -> Option<Self> {
        Some(match signal {
            PIDS..TABLES => Self::Pid(signal - PIDS),
            TABLES..MATHS => Self::Table(signal - TABLES),
            MATHS..LOGICS => Self::Math(signal - MATHS),
            LOGICS..COMMANDED => Self::Logic(signal - LOGICS),
            COMMANDED..FEEDBACKS => Self::Output(signal - COMMANDED),
            FEEDBACKS..SUPPLY => Self::Output(signal - FEEDBACKS),
            _ => return None,
        })
    }

    const fn numbered(number: usize) -> Self {
        match number {
            0..6 => Self::Math(number),
            6..18 => Self::Table(number - 6),
            18..22 => Self::Pid(number - 18),
            22..26 => Self::Logic(number - 22),
            _ => Self::Output(number - 26),
        }
    }

    /// The set of this block alone.
    pub(super) const fn bit(self) -> Blocks {
        1 << self.number()
    }

    /// Its place among all blocks.
    pub(super) const fn number(self) -> usize {
        match self {
            Self::Math(place) => place,
            Self::Table(place) => 6 + place,
            Self::Pid(place) => 18 + place,
            Self::Logic(place) => 22 + place,
            Self::Output(place) => 26 + place,
        }
    }

    /// The signals that come from it. Only an output has two.
    fn signals(self) -> impl Iterator<Item = usize> {
        let (first, second) = match self {
            Self::Pid(place) => (PIDS + place, None),
            Self::Table(place) => (TABLES + place, None),
            Self::Math(place) => (MATHS + place, None),
            Self::Logic(place) => (LOGICS + place, None),
            Self::Output(place) => (COMMANDED + place, Some(FEEDBACKS + place)),
        };
        [first].into_iter().chain(second)
    }
}

impl Order {
    /// The order for blocks that are wired so.
    pub(super) fn of(wiring: &Wiring) -> Self {
        let blocks = Vec::with_capacity(BLOCKS);
        let (turns, takers, late_takers) = ([0; SIGNALS], [0; SIGNALS], [0; SIGNALS]);
        let mut order = Self { blocks, turns, takers, late_takers };
        let mut met = 0;
        for block in members(ALL) {
            order.visit(block, wiring, &mut met);
        }
        order
    }

    fn visit(&mut self, block: Block, wiring: &Wiring, met: &mut Blocks) {
        if *met & block.bit() != 0 {
            return;
        }
        *met |= block.bit();
        let taken = wiring[block.number()].iter().filter(|place| **place != NOTHING);
        for place in taken.map(|place| usize::from(*place)) {
            let source = Block::of(place);
            if let Some(source) = source {
                self.visit(source, wiring, met);
            }
            // In a circle the walk comes back to a block that has no turn yet.
            let in_time = source.is_none() || self.turns[place] > 0;
            let takers = if in_time { &mut self.takers } else { &mut self.late_takers };
            takers[place] |= block.bit();
        }
        self.blocks.push(block);
        for signal in block.signals() {
            self.turns[signal] = self.blocks.len() as u8;
        }
    }

    /// The blocks that come after a signal and take it.
    pub(super) const fn takers(&self, signal: usize) -> Blocks {
        self.takers[signal]
    }

    /// The blocks that take the signal of the last control cycle.
    pub(super) const fn late_takers(&self, signal: usize) -> Blocks {
        self.late_takers[signal]
    }

    /// Whether a signal is computed before a block's turn, counted from 1 on.
    pub(super) fn is_before(&self, signal: usize, turn: usize) -> bool {
        usize::from(self.turns[signal]) < turn
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn order(links: impl Fn(Block) -> Vec<Link>) -> Order {
        let mut wiring = [taken([]); BLOCKS];
        members(ALL).for_each(|block| wiring[block.number()] = taken(links(block)));
        Order::of(&wiring)
    }

    fn turn(order: &Order, block: Block) -> usize {
        order.blocks.iter().position(|known| *known == block).unwrap() + 1
    }

    #[test]
    fn a_block_comes_after_those_it_takes_from() {
        let order = order(|block| match block {
            Block::Math(0) => vec![Link::new(4, 12)],
            Block::Table(11) => vec![Link::new(3, 4)],
            Block::Pid(3) => vec![Link::new(1, 11), Link::new(8, 10)],
            _ => Vec::new(),
        });
        let turns = [Block::Output(9), Block::Pid(3), Block::Table(11), Block::Math(0)]
            .map(|block| turn(&order, block));
        assert!(turns.is_sorted(), "{turns:?}");
        assert_eq!(order.blocks.len(), BLOCKS);
        assert!(order.is_before(TABLES + 11, turns[3]));
        assert_eq!(order.takers(TABLES + 11), Block::Math(0).bit());
        assert_eq!([10, FEEDBACKS + 9].map(|place| order.takers(place)), [Block::Pid(3).bit(); 2]);
        assert_eq!(order.takers(COMMANDED + 9), 0);
        assert!(order.is_before(0, 1));
    }

    #[test]
    fn each_block_has_a_number_and_its_signals() {
        assert!(members(ALL).map(Block::number).eq(0..BLOCKS));
        for block in members(ALL) {
            assert!(block.signals().all(|signal| Block::of(signal) == Some(block)), "{block:?}");
        }
        assert_eq!(members(ALL).flat_map(Block::signals).count(), SUPPLY - PIDS);
        let kinds = [Block::Math(5), Block::Table(11), Block::Pid(3), Block::Logic(3)];
        let sets = [ALL_MATHS, ALL_TABLES, ALL_PIDS, ALL_LOGICS];
        for (last, set) in kinds.into_iter().zip(sets) {
            assert_eq!(members(set).last(), Some(last));
        }
        assert_eq!(members(ALL_OUTPUTS).count(), 10);
        assert_eq!(members(!ALL).next(), None);
    }

    #[test]
    fn in_a_circle_one_looks_back() {
        let order = order(|block| match block {
            Block::Math(0) => vec![Link::new(5, 2)],
            Block::Math(1) => vec![Link::new(5, 1)],
            Block::Math(2) => vec![Link::new(5, 3)],
            _ => Vec::new(),
        });
        let [first, second, third] = [0, 1, 2].map(|place| turn(&order, Block::Math(place)));
        assert!(order.is_before(MATHS + 1, first) && !order.is_before(MATHS, second));
        assert!(!order.is_before(MATHS + 2, third));
        let bits = [0, 1, 2].map(|place| Block::Math(place).bit());
        assert_eq!([0, 1, 2].map(|place| order.takers(MATHS + place)), [0, bits[0], 0]);
        assert_eq!([0, 1, 2].map(|place| order.late_takers(MATHS + place)), [bits[1], 0, bits[2]]);
    }
}
