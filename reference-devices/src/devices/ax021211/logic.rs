//! The programmable logic block (1.6): conditions that choose a lookup table.

use super::math::compare;
use super::objects::{LOGIC_ENABLE, Parameters, digits, logic, power};
use super::rules::Ax021211Rules;
use super::signal::{Link, PERCENT, Signal, TABLES};

/// The settings of a logic block.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct LogicSettings {
    enabled: bool,
    /// The lookup tables that are table A, B and C.
    pub(super) tables: [u8; 3],
    operators: [u8; 3],
    conditions: [[Condition; 3]; 3],
}

/// A condition (table 13).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Condition {
    arguments: [Link; 2],
    operator: u8,
}

/// The result of a condition (table 15).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Verdict {
    False,
    True,
    Error,
    NotApplicable,
}

impl LogicSettings {
    pub(super) fn read(od: Parameters<'_>, place: usize) -> Self {
        let place = od.rules.block(logic(0, 0), place);
        let index = |item| logic(place, item);
        let condition = |function: usize, number: usize| {
            let index = index(0x11 + 0x10 * function as u16 + number as u16);
            let part = |sub| od.byte(index, sub);
            Condition {
                arguments: [Link::new(part(0), part(1)), Link::new(part(2), part(3))],
                operator: part(4),
            }
        };
        Self {
            enabled: od.flag(LOGIC_ENABLE, place),
            tables: std::array::from_fn(|function| od.byte(index(0x01), function)),
            operators: std::array::from_fn(|function| od.byte(index(0x02), function)),
            conditions: std::array::from_fn(|function| {
                std::array::from_fn(|number| condition(function, number))
            }),
        }
    }

    /// Its inputs: the arguments of its conditions, and the tables it selects among.
    pub(super) fn links(&self) -> ([[[Link; 2]; 3]; 3], [Link; 3]) {
        let arguments = self.conditions.map(|three| three.map(|condition| condition.arguments));
        (arguments, self.tables.map(|number| Link::new(TABLE_SOURCE, number)))
    }

    /// The number of the table that is selected, after the one that was `selected` before, and what
    /// the block shows in 3320h and hands on. `read` gives the signal of a link, `table` that of a
    /// place.
    pub(super) fn evaluate(
        &self,
        selected: u8,
        read: impl Fn(Link) -> Signal,
        table: impl Fn(usize) -> Signal,
        rules: &Ax021211Rules,
    ) -> (u8, i64, Signal) {
        if !rules.logic_is_enabled(self.enabled) {
            return (rules.selected_while_disabled(selected), 0, Signal::ABSENT);
        }
        let selects = [0, 1, 2].map(|function| self.selects(function, &read, rules));
        let chosen = rules.selection(selects);
        let number = match rules.keeps_selection() && !selects.contains(&true) {
            true => selected,
            false => self.tables[chosen],
        };
        let shown_number = rules.selected_table(number, chosen);
        let link = Link::new(TABLE_SOURCE, number);
        let signal = link.place().filter(|place| *place >= TABLES).map_or(Signal::ABSENT, table);
        if !rules.logic_is_available(signal.is_valid() || signal.has_failed()) {
            return (shown_number, 0, Signal::ABSENT);
        }
        let percent = rules.logic_percent(signal);
        let shown = digits(percent, 1);
        let output = Signal::new(shown as f64 / power(1), Some(PERCENT));
        (shown_number, shown, output.failing(signal.has_failed()))
    }

    /// Whether the conditions of a function select its table (tables 16 and 17).
    fn selects(
        &self,
        function: usize,
        read: impl Fn(Link) -> Signal,
        rules: &Ax021211Rules,
    ) -> bool {
        let results = self.conditions[function].map(|condition| {
            let arguments = condition.arguments.map(&read);
            rules.condition(condition.operator, condition.arguments, arguments)
        });
        combine(self.operators[function], results)
    }
}

/// The result of a condition (tables 14 and 15).
pub(super) fn judge(operator: u8, [a, b]: [Signal; 2]) -> Verdict {
    let usable = |signal: Signal| signal.is_valid() || signal.has_failed();
    if !usable(a) || !usable(b) {
        Verdict::NotApplicable
    } else if a.has_failed() || b.has_failed() {
        Verdict::Error
    } else if compare(operator, a.value, b.value) {
        Verdict::True
    } else {
        Verdict::False
    }
}

/// Whether an operator selects its table (table 17): only for "and" is a condition that does not
/// apply like a true one, and an error is never true.
pub(super) fn combine(operator: u8, results: [Verdict; 3]) -> bool {
    let [a, b, c] = results.map(|result| result == Verdict::True);
    match operator {
        0 => true,
        1 => results.iter().all(|one| matches!(one, Verdict::True | Verdict::NotApplicable)),
        2 => a || b || c,
        3 => a && b || c,
        _ => (a || b) && c,
    }
}

/// Source 4 of table 4.
const TABLE_SOURCE: u8 = 4;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::ax021211::rules::Ax021211Rules;
    use Verdict::{Error, False, NotApplicable, True};

    fn condition(a: Link, operator: u8, b: Link) -> Condition {
        Condition { arguments: [a, b], operator }
    }

    fn block() -> LogicSettings {
        LogicSettings {
            enabled: true,
            tables: [1, 2, 3],
            operators: [1, 1, 0],
            ..LogicSettings::default()
        }
    }

    /// The engine speed is message 11; constants are their tabled defaults.
    fn read(speed: f64) -> impl Fn(Link) -> Signal {
        move |link| match (link.source, link.number) {
            (1, 11) => Signal::new(speed, Some((0.0, 3000.0))),
            (2, 12) => Signal::new(40.0, None),
            (2, 15) => Signal::new(1000.0, None),
            _ => Signal::ABSENT,
        }
    }

    /// Table n stands at 10 n.
    fn table(place: usize) -> Signal {
        Signal::new(10.0 * (place - TABLES + 1) as f64, Some((0.0, 100.0)))
    }

    #[test]
    fn below_a_speed_another_table_drives_the_output() {
        let mut block = block();
        block.conditions[0][0] = condition(Link::new(1, 11), 4, Link::new(2, 15));
        block.operators[1] = 0;
        for (speed, number, shown) in [(999.0, 1, 100), (1000.0, 2, 200), (2500.0, 2, 200)] {
            let (selected, output, signal) =
                block.evaluate(1, read(speed), table, &Ax021211Rules::plain());
            assert_eq!((selected, output), (number, shown), "{speed}");
            assert_eq!(signal.limits, Some(PERCENT));
        }
    }

    #[test]
    fn table_17_row_by_row() {
        let rows = [
            (0, [False, False, False], true),
            (1, [True, True, True], true),
            (1, [True, NotApplicable, True], true),
            (1, [NotApplicable; 3], true),
            (1, [True, True, False], false),
            (1, [True, Error, True], false),
            (2, [False, False, True], true),
            (2, [Error, NotApplicable, False], false),
            (3, [True, True, False], true),
            (3, [False, False, True], true),
            (3, [True, NotApplicable, False], false),
            (3, [True, NotApplicable, Error], false),
            (4, [True, False, True], true),
            (4, [False, True, True], true),
            (4, [True, True, False], false),
            (4, [True, True, NotApplicable], false),
            (4, [False, Error, True], false),
        ];
        for (operator, results, selects) in rows {
            assert_eq!(combine(operator, results), selects, "{operator} {results:?}");
        }
    }

    #[test]
    fn table_14_compares_in_order() {
        let pair = |a, b| [Signal::new(a, None), Signal::new(b, None)];
        for (operator, below, equal, above) in [
            (0, False, True, False),
            (1, True, False, True),
            (2, False, False, True),
            (3, False, True, True),
            (4, True, False, False),
            (5, True, True, False),
        ] {
            let results = [1.0, 2.0, 3.0].map(|a| judge(operator, pair(a, 2.0)));
            assert_eq!(results, [below, equal, above], "{operator}");
        }
    }

    #[test]
    fn table_15_knows_errors_and_what_does_not_apply() {
        let fine = Signal::new(1.0, None);
        assert_eq!(judge(0, [fine, fine.failing(true)]), Error);
        assert_eq!(judge(0, [Signal::ABSENT, fine.failing(true)]), NotApplicable);
        assert_eq!(judge(0, [fine, Signal::ABSENT]), NotApplicable);
    }

    #[test]
    fn without_a_default_table_a_is_the_default() {
        let mut block = block();
        block.operators = [2, 2, 2];
        assert_eq!(block.evaluate(1, read(0.0), table, &Ax021211Rules::plain()).0, 1);
    }

    #[test]
    fn the_output_is_a_percentage_of_the_range_of_its_table() {
        let block = block();
        let wide = |_| Signal::new(125.0, Some((-500.0, 500.0)));
        assert_eq!(block.evaluate(1, read(0.0), wide, &Ax021211Rules::plain()).1, 625);
        let (_, shown, signal) =
            block.evaluate(1, read(0.0), |_| Signal::ABSENT, &Ax021211Rules::plain());
        assert_eq!((shown, signal), (0, Signal::ABSENT));
        let disabled = LogicSettings { enabled: false, ..block };
        let evaluated = disabled.evaluate(2, read(0.0), table, &Ax021211Rules::plain());
        assert_eq!(evaluated, (2, 0, Signal::ABSENT));
    }
}
