//! The faults inside a module, as a bench makes them: of its memory, its terminal, its CAN
//! controller and its board (manual, 11.3.8, 11.9 and chapter 12).

use canopen::{BenchError, Instant, Value};

use super::rules::Mcm260xRules;
use crate::devices::pixsys::emergency::{self, BusFault, Found, Module};
use crate::devices::terminal::{said, word};
use crate::stack::Errors;

/// The parts inside, and what the module has found about them.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Inside {
    memory: MemoryFault,
    terminal: TerminalFault,
    bus: BusFault,
    board: Module,
    /// When the overflow of a buffer ends as an error.
    overflow_ends: Option<Instant>,
    /// The board at the last store command.
    stored: Module,
    found: Found,
    /// The bit of 4007h sub 1 of what could not be read at the start.
    unread: Option<u8>,
}

/// The part of the memory that fails.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum MemoryFault {
    #[default]
    None,
    /// It shows when parameters are stored.
    Write,
    /// The bit of 4007h sub 1 of what is wrong when the module starts.
    AtStart(u8),
}

/// The fault of the terminal, which has display and keys.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum TerminalFault {
    #[default]
    None,
    OffLine,
    /// The bit of 4007h sub 2.
    Flag(u8),
}

impl Inside {
    /// The names on a bench.
    pub(super) const NAMES: [&'static str; 4] = [MEMORY, TERMINAL, BUS, BOARD];

    /// Takes a stimulus; `None` when the name is none of those.
    pub(super) fn set(
        &mut self,
        now: Instant,
        name: &str,
        value: &Value,
    ) -> Option<Result<(), BenchError>> {
        Some(match name {
            MEMORY => word(name, value, &MEMORY_FAULTS).map(|fault| self.memory = fault),
            TERMINAL => word(name, value, &TERMINAL_FAULTS).map(|fault| self.terminal = fault),
            BUS => word(name, value, &BusFault::WORDS).map(|fault| {
                (self.bus, self.overflow_ends) = (fault, fault.ends(now));
            }),
            BOARD => word(name, value, &Module::WORDS).map(|board| self.board = board),
            _ => return None,
        })
    }

    /// The value that was set.
    pub(super) fn observe(&self, name: &str) -> Option<Value> {
        match name {
            MEMORY => said(&self.memory, &MEMORY_FAULTS),
            TERMINAL => said(&self.terminal, &TERMINAL_FAULTS),
            BUS => said(&self.bus, &BusFault::WORDS),
            BOARD => said(&self.board, &Module::WORDS),
            _ => None,
        }
    }

    /// The module starts, and reads its memory.
    pub(super) fn start(&mut self) {
        self.unread = match self.memory {
            MemoryFault::AtStart(bit) => Some(bit),
            MemoryFault::None | MemoryFault::Write => None,
        };
        let part = |bit| PARTS.iter().position(|part| *part == bit);
        self.found = Found {
            unread: self.unread.and_then(part).map(|part| part as u8 + 1),
            ..Found::default()
        };
    }

    /// A start or a reset notices another board than before.
    pub(super) fn compare_boards(&mut self, rules: &Mcm260xRules) {
        self.found.changed_hardware |= rules.board_differs(self.board, self.stored);
    }

    /// Whether nothing can be stored.
    pub(super) fn stores_nothing(&self) -> bool {
        self.memory == MemoryFault::Write
    }

    /// A store command was carried out, or failed.
    pub(super) fn store(&mut self) {
        self.found.not_stored = self.stores_nothing();
        if !self.found.not_stored {
            self.found.changed_hardware = false;
            self.stored = self.board;
        }
    }

    /// The flags of 4007h sub 1 and sub 2.
    pub(super) fn flags(&self, rules: &Mcm260xRules) -> (i64, i64) {
        let memory = self.unread.map_or(0, |bit| 1 << rules.fault_flag(bit));
        match self.terminal {
            TerminalFault::None => (memory, 0),
            TerminalFault::OffLine => (memory | 1 << rules.fault_flag(OFF_LINE), 0),
            TerminalFault::Flag(bit) => (memory, 1 << rules.terminal_flag(bit)),
        }
    }

    /// Reports what is wrong, and what is no more.
    pub(super) fn report(&mut self, now: Instant, errors: &mut Errors, rules: &Mcm260xRules) {
        let is_event = !rules.overflow_lasts() && self.overflow_ends.take().is_some();
        self.overflow_ends = self.overflow_ends.filter(|end| now < *end);
        let bus = self.bus.present(self.overflow_ends);
        let board = if rules.reports_board() { self.board } else { Module::Fitted };
        let unread = self.found.unread.filter(|_| rules.reports_memory());
        emergency::tell(Found { unread, ..self.found }, bus, board, errors);
        if is_event {
            emergency::mention(self.bus, errors);
        }
    }

    /// When an error ends by itself.
    pub(super) const fn poll_at(&self) -> Option<Instant> {
        self.overflow_ends
    }
}

const MEMORY: &str = "memory-fault";
const TERMINAL: &str = "terminal-fault";
const BUS: &str = "bus-fault";
const BOARD: &str = "module-1";

/// The bits of 4007h sub 1 of the parts of the configuration, in the order of their numbers.
const PARTS: [u8; 2] = [0, 5];
/// The bit of 4007h sub 1 of a terminal that is off-line.
const OFF_LINE: u8 = 9;
const MEMORY_FAULTS: [(&str, MemoryFault); 9] = [
    ("none", MemoryFault::None),
    ("write", MemoryFault::Write),
    ("parameters", MemoryFault::AtStart(0)),
    ("encoder-counts", MemoryFault::AtStart(1)),
    ("calibrations", MemoryFault::AtStart(3)),
    ("calibration-constants", MemoryFault::AtStart(4)),
    ("communication-data", MemoryFault::AtStart(5)),
    ("calibration-missing", MemoryFault::AtStart(6)),
    ("read", MemoryFault::AtStart(8)),
];
const TERMINAL_FAULTS: [(&str, TerminalFault); 5] = [
    ("none", TerminalFault::None),
    ("off-line", TerminalFault::OffLine),
    ("read", TerminalFault::Flag(0)),
    ("write", TerminalFault::Flag(1)),
    ("parameters", TerminalFault::Flag(2)),
];

#[cfg(test)]
mod tests {
    use super::*;

    fn set(inside: &mut Inside, name: &str, word: &str) {
        inside.set(Instant::ZERO, name, &Value::Text(word.to_owned())).unwrap().unwrap();
        assert_eq!(inside.observe(name), Some(Value::Text(word.to_owned())));
    }

    #[test]
    fn a_memory_is_read_at_the_start_and_a_terminal_all_the_time() {
        let (mut inside, rules) = (Inside::default(), Mcm260xRules::plain());
        set(&mut inside, MEMORY, "calibrations");
        assert_eq!(inside.flags(&rules), (0, 0));
        inside.start();
        set(&mut inside, MEMORY, "none");
        set(&mut inside, TERMINAL, "off-line");
        assert_eq!(inside.flags(&rules), (1 << 3 | 1 << 9, 0));
        set(&mut inside, TERMINAL, "parameters");
        inside.start();
        assert_eq!(inside.flags(&rules), (0, 4));
    }

    #[test]
    fn another_board_is_known_from_the_next_store_command_on() {
        let (mut inside, rules) = (Inside::default(), Mcm260xRules::plain());
        set(&mut inside, BOARD, "other");
        inside.start();
        inside.compare_boards(&rules);
        assert!(inside.found.changed_hardware);
        set(&mut inside, MEMORY, "write");
        inside.store();
        assert!(inside.found.changed_hardware && inside.found.not_stored);
        set(&mut inside, MEMORY, "none");
        inside.store();
        inside.start();
        inside.compare_boards(&rules);
        assert_eq!(inside.found, Found::default());
        set(&mut inside, BOARD, "fitted");
        inside.start();
        inside.compare_boards(&rules);
        assert!(inside.found.changed_hardware, "the first one is another one now");
    }
}
