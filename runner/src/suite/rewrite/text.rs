//! The text of a file, and the places of the values of its tree.

use std::ops::Range;
use std::sync::Arc;

use canopen::source::Node;

use super::Edit;
use crate::source::{Place, Source, Tree};
use crate::suite::same::same;

/// A text cut into lines.
pub(super) struct Text<'s> {
    text: &'s str,
    /// Each without its end.
    lines: Vec<Range<usize>>,
    end_of_line: &'static str,
}

/// A step of a list whose items begin with a dash.
pub(super) struct Item<'t> {
    /// The step.
    pub step: &'t Tree,
    /// Its lines, counted from 0.
    pub lines: Range<usize>,
    /// How many blanks are before the dash.
    pub indent: usize,
    /// A comment behind it.
    pub comment: Option<&'t str>,
    /// Only the step and that comment are on its lines.
    pub is_whole: bool,
}

impl<'s> Text<'s> {
    /// The lines of a text; `None` when some end in a way that is not edited.
    pub(super) fn of(text: &'s str) -> Option<Self> {
        let two = text.contains("\r\n");
        let (mut lines, mut from) = (Vec::new(), 0);
        for line in text.split_inclusive('\n') {
            let content = line.strip_suffix('\n').unwrap_or(line);
            let content = if two { content.strip_suffix('\r').unwrap_or(content) } else { content };
            if content.contains('\r') {
                return None;
            }
            lines.push(from..from + content.len());
            from += line.len();
        }
        Some(Self { text, lines, end_of_line: if two { "\r\n" } else { "\n" } })
    }

    /// The text after these edits, which are in its order.
    pub(super) fn edited(&self, edits: &[Edit]) -> String {
        let (mut edited, mut from) = (String::new(), 0);
        for Edit { bytes, text, .. } in edits {
            edited.push_str(&self.text[from..bytes.start]);
            edited.push_str(&text.replace('\n', self.end_of_line));
            from = bytes.end;
        }
        edited.push_str(&self.text[from..]);
        edited
    }

    /// The text in this range, with plain line ends.
    pub(super) fn slice(&self, bytes: &Range<usize>) -> String {
        self.text[bytes.clone()].replace("\r\n", "\n")
    }

    /// The bytes of these lines, without the end of the last one.
    pub(super) fn bytes_of(&self, lines: Range<usize>) -> Range<usize> {
        self.lines[lines.start].start..self.lines[lines.end - 1].end
    }

    /// How wide the line is in which they stand.
    pub(super) fn width_around(&self, bytes: &Range<usize>) -> usize {
        self.line_around(bytes.start).map_or(0, |line| self.text[line.clone()].chars().count())
    }

    /// The scalar as it is written; `None` when it is not on one line, or written in a way that is
    /// not understood.
    pub(super) fn scalar(&self, tree: &Tree) -> Option<Range<usize>> {
        let from = self.offset(tree.place)?;
        let rest = self.rest_of_line(from)?;
        let text = tree.text()?;
        let length = match rest.chars().next()? {
            quote @ ('"' | '\'') => {
                let inside = rest[1..].find(quote)?;
                // Escaped text is not understood.
                (rest[1..].starts_with(text) && inside == text.len()).then_some(inside + 2)?
            }
            _ => {
                let after = rest.strip_prefix(text)?.trim_start();
                let ends = after.is_empty() || after.starts_with([',', ']', '}', ':', '#']);
                ends.then_some(text.len())?
            }
        };
        Some(from..from + length)
    }

    /// A value as it is written, if it is on one line: also a list or a map in brackets.
    pub(super) fn on_one_line(&self, tree: &Tree) -> Option<Range<usize>> {
        if tree.text().is_some() {
            return self.scalar(tree);
        }
        let from = self.offset(tree.place)?;
        let rest = self.rest_of_line(from)?;
        let (mut depth, mut quote) = (0, None);
        for (at, c) in rest.char_indices() {
            match (c, quote) {
                ('"' | '\'', None) => quote = Some(c),
                (_, Some(open)) if c == open => quote = None,
                ('[' | '{', None) => depth += 1,
                (']' | '}', None) => {
                    depth -= 1;
                    if depth == 0 {
                        return Some(from..from + at + 1);
                    }
                }
                _ if depth == 0 => return None,
                _ => {}
            }
        }
        None
    }

    /// The value as a text on one line: as it is written where that can be copied.
    pub(super) fn copied(&self, tree: &Tree) -> Option<String> {
        match &tree.node {
            Node::Map(entries) => {
                let entries = entries.iter().map(|(key, value)| {
                    let node = Node::from(key.value.as_str());
                    let key = self.copied(&Tree { node, place: key.place })?;
                    Some(format!("{key}: {}", self.copied(value)?))
                });
                Some(format!("{{ {} }}", entries.collect::<Option<Vec<_>>>()?.join(", ")))
            }
            Node::List(items) => {
                let items = items.iter().map(|item| self.copied(item));
                Some(format!("[{}]", items.collect::<Option<Vec<_>>>()?.join(", ")))
            }
            Node::Null => Some("~".to_owned()),
            _ => {
                let written = &self.text[self.scalar(tree)?];
                // In a line of its own it may have what ends a value in brackets.
                let plain = !written.starts_with(['"', '\'']);
                (!plain || !written.contains([',', '[', ']', '{', '}'])).then(|| written.to_owned())
            }
        }
    }

    /// The steps of a list that begin with a dash each.
    pub(super) fn items<'t>(&'t self, steps: &'t [Tree]) -> Vec<Item<'t>> {
        let starts: Vec<usize> =
            steps.iter().map(|step| step.place.line.saturating_sub(1)).collect();
        let items = steps.iter().enumerate().map(|(place, step)| {
            let next = starts.get(place + 1).copied().unwrap_or(self.lines.len());
            self.item(step, next)
        });
        items.collect()
    }

    fn item<'t>(&'t self, step: &'t Tree, next: usize) -> Item<'t> {
        let start = step.place.line.saturating_sub(1);
        let before: String =
            self.line(start).chars().take(step.place.column.saturating_sub(1)).collect();
        let indent = before.find('-').unwrap_or_default();
        let begins = before.trim() == "-" && before.ends_with(' ') && start < next;
        let mut end = start + 1;
        for line in start + 1..next.max(start + 1) {
            let content = self.line(line).trim_start();
            if content.is_empty() || content.starts_with('#') {
                continue;
            }
            if self.line(line).len() - content.len() <= indent {
                break;
            }
            end = line + 1;
        }
        let mut item = Item { step, lines: start..end, indent, comment: None, is_whole: false };
        if begins {
            (item.comment, item.is_whole) = self.is_whole(&item);
        }
        item
    }

    /// Whether its lines hold nothing but the step, and a comment behind it.
    fn is_whole(&self, item: &Item<'_>) -> (Option<&str>, bool) {
        let text = &self.text[self.bytes_of(item.lines.clone())];
        let comment = text
            .match_indices(" #")
            .map(|(at, _)| at)
            .find(|at| !text[*at..].contains('\n') && self.holds(&text[..*at], item.step));
        let (text, comment) = match comment {
            Some(at) => (text[..at].trim_end(), Some(text[at..].trim())),
            None => (text, None),
        };
        let single = comment.is_none() || item.lines.len() == 1;
        (comment, single && !text.contains(" #") && self.holds(text, item.step))
    }

    fn holds(&self, text: &str, step: &Tree) -> bool {
        let source = Arc::new(Source::new(String::new(), text.to_owned()));
        let list = Tree::of(&source).map(|tree| tree.node);
        matches!(list, Ok(Node::List(items)) if items.len() == 1 && same(&items[0], step))
    }

    fn line(&self, line: usize) -> &str {
        self.lines.get(line).map_or("", |line| &self.text[line.clone()])
    }

    fn rest_of_line(&self, from: usize) -> Option<&str> {
        Some(&self.text[from..self.line_around(from)?.end])
    }

    fn line_around(&self, byte: usize) -> Option<&Range<usize>> {
        self.lines.get(self.lines.partition_point(|line| line.end < byte))
    }

    fn offset(&self, place: Place) -> Option<usize> {
        let line = self.lines.get(place.line.checked_sub(1)?)?;
        let text = &self.text[line.clone()];
        let column = text.char_indices().nth(place.column.checked_sub(1)?)?;
        Some(line.start + column.0)
    }
}
