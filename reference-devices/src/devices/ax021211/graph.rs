//! Which block is evaluated when. A block comes after those that it takes signals from. Where
//! blocks take from each other in a circle, there is no such order: then the one that the walk
//! through the blocks meets first comes last, and what it takes from blocks that come later is
//! their signal of the last control cycle.

use super::signal::{COMMANDED, FEEDBACKS, LOGICS, Link, MATHS, PIDS, SIGNALS, SUPPLY, TABLES};

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
#[derive(Clone, Debug, Default)]
pub(super) struct Order {
    pub(super) blocks: Vec<Block>,
    /// For each signal the turn of the block that it comes from, counted from 1 on; 0 for what
    /// comes from outside.
    turns: Vec<usize>,
    /// The signals that the blocks take, block by block, and where those of each one end.
    taken: Vec<usize>,
    ends: Vec<usize>,
}

/// How many blocks there are.
pub(super) const BLOCKS: usize = 36;

/// Hands on each link of a block.
pub(super) type Links<'l> = dyn Fn(Block, &mut dyn FnMut(Link)) + 'l;

/// All blocks, in the order in which the walk begins with them.
pub(super) fn all() -> impl Iterator<Item = Block> {
    let maths = (0..6).map(Block::Math);
    let tables = (0..12).map(Block::Table);
    let pids = (0..4).map(Block::Pid);
    let logics = (0..4).map(Block::Logic);
    maths.chain(tables).chain(pids).chain(logics).chain((0..10).map(Block::Output))
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
    /// The order for blocks that take what `links` says.
    pub(super) fn of(links: &Links) -> Self {
        let blocks = Vec::with_capacity(BLOCKS);
        let mut order = Self { blocks, turns: vec![0; SIGNALS], ..Self::default() };
        let mut met = [false; BLOCKS];
        for block in all() {
            order.visit(block, links, &mut met);
            links(block, &mut |link| order.taken.extend(link.place()));
            order.ends.push(order.taken.len());
        }
        order
    }

    fn visit(&mut self, block: Block, links: &Links, met: &mut [bool; BLOCKS]) {
        if std::mem::replace(&mut met[block.number()], true) {
            return;
        }
        links(block, &mut |link| {
            if let Some(before) = link.place().and_then(Block::of) {
                self.visit(before, links, met);
            }
        });
        self.blocks.push(block);
        for signal in block.signals() {
            self.turns[signal] = self.blocks.len();
        }
    }

    /// The signals that a block takes.
    pub(super) fn taken_by(&self, block: Block) -> &[usize] {
        let number = block.number();
        let start = number.checked_sub(1).map_or(0, |before| self.ends[before]);
        &self.taken[start..self.ends[number]]
    }

    /// Whether a signal is there when it is a block's turn, counted from 1 on.
    pub(super) fn is_before(&self, signal: usize, turn: usize) -> bool {
        self.turns[signal] < turn
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn order(links: impl Fn(Block) -> Vec<Link>) -> Order {
        Order::of(&|block, take| links(block).into_iter().for_each(take))
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
        assert_eq!(order.taken_by(Block::Math(0)), [TABLES + 11]);
        assert_eq!(order.taken_by(Block::Pid(3)), [10, FEEDBACKS + 9]);
        assert!(order.taken_by(Block::Output(9)).is_empty());
        assert!(order.is_before(0, 1));
    }

    #[test]
    fn each_block_has_a_number_and_its_signals() {
        assert!(all().map(Block::number).eq(0..BLOCKS));
        for block in all() {
            assert!(block.signals().all(|signal| Block::of(signal) == Some(block)), "{block:?}");
        }
        assert_eq!(all().flat_map(Block::signals).count(), SUPPLY - PIDS);
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
    }
}
