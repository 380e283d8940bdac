//! Mistakes and oddities of a data sheet, and where they are.

use std::collections::HashMap;
use std::fmt;

use super::codes::{Code, Severity};
use crate::source::Place;

/// One remark about a data sheet. `Display` is one line without the file's name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Diagnostic {
    /// How much it matters.
    pub severity: Severity,
    /// Stable name of the rule, such as `eds-subnumber`; all of them are in
    /// [`CODES`](super::CODES).
    pub code: &'static str,
    /// Line, counted from 1; 0 when the sheet comes from no file.
    pub line: usize,
    /// Column in characters of the decoded line, counted from 1.
    pub column: usize,
    /// The finding, in one sentence.
    pub message: String,
}

impl fmt::Display for Diagnostic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { severity, code, line, column, message } = self;
        write!(f, "{line}:{column}: {severity}: {message} [{code}]")
    }
}

/// Collects diagnostics.
#[derive(Debug, Default)]
pub(super) struct Findings {
    list: Vec<Diagnostic>,
    habits: HashMap<(&'static str, String), Habit>,
}

/// Where in the list a habit stands, and how often it came again.
#[derive(Debug)]
struct Habit {
    first: usize,
    more: usize,
}

impl Findings {
    pub(super) fn add(&mut self, code: &Code, at: Place, message: impl Into<String>) {
        self.list.push(Diagnostic {
            severity: code.severity,
            code: code.name,
            line: at.line,
            column: at.column,
            message: shortened(message.into()),
        });
    }

    /// Reports a habit of the whole file where it first occurs; further diagnostics with the same
    /// message are only counted.
    pub(super) fn habit(&mut self, code: &Code, at: Place, message: impl Into<String>) {
        let message = message.into();
        let Some(habit) = self.habits.get_mut(&(code.name, message.clone())) else {
            let first = self.list.len();
            self.habits.insert((code.name, message.clone()), Habit { first, more: 0 });
            self.add(code, at, message);
            return;
        };
        habit.more += 1;
        // Sections are read in the order of their objects, which need not be that of the file.
        let first = &mut self.list[habit.first];
        let place = (at.line, at.column);
        if place < (first.line, first.column) {
            (first.line, first.column) = place;
        }
    }

    /// The diagnostics in the order of the file.
    pub(super) fn finish(mut self) -> Vec<Diagnostic> {
        for habit in self.habits.values() {
            if habit.more > 0 {
                let more = format!(" ({} more like it)", habit.more);
                self.list[habit.first].message.push_str(&more);
            }
        }
        self.list.sort_by_key(|diagnostic| (diagnostic.line, diagnostic.column));
        self.list
    }
}

/// A message that quotes something endless ends early.
fn shortened(mut message: String) -> String {
    const LONGEST: usize = 1000;
    if message.len() > LONGEST {
        let end = (0..=LONGEST).rev().find(|end| message.is_char_boundary(*end));
        message.truncate(end.unwrap_or_default());
        message.push_str(" ...");
    }
    message
}

#[cfg(test)]
mod tests {
    use super::super::codes;
    use super::*;

    #[test]
    fn a_message_is_no_longer_than_can_be_read() {
        let mut findings = Findings::default();
        findings.add(&codes::SYNTAX, Place::new(1, 1), "é".repeat(100_000));
        findings.habit(&codes::SYNTAX, Place::new(2, 1), "short");
        let lengths = findings.finish().into_iter().map(|it| it.message.len());
        assert_eq!(lengths.collect::<Vec<_>>(), [1004, 5]);
    }

    #[test]
    fn a_habit_is_told_once_and_all_is_in_order() {
        let mut findings = Findings::default();
        findings.habit(&codes::LINE_END, Place::new(8, 2), "later");
        findings.habit(&codes::LINE_END, Place::new(7, 2), "later");
        findings.add(&codes::SYNTAX, Place::new(3, 1), "earlier");
        let lines: Vec<_> = findings.finish().iter().map(ToString::to_string).collect();
        assert_eq!(
            lines,
            [
                "3:1: error: earlier [eds-syntax]",
                "7:2: note: later (1 more like it) [eds-line-end]"
            ]
        );
    }
}
