//! Tables: list entries that differ in some values become one entry, with those values in columns
//! and rows.

use std::collections::BTreeMap;

use super::{At, Node, Place, Tree, formula};
use crate::nearest::is_slip;

/// Names that rows and arguments give a value.
pub type Values = BTreeMap<String, Tree>;

/// The keys of a table: its columns and its rows.
pub const TABLE: [&str; 2] = ["for", "rows"];

/// Columns, and for each row its place and the values.
#[derive(Debug)]
pub struct Table {
    /// The names of the columns.
    pub columns: Vec<At<String>>,
    /// The rows, each with the values around the table.
    pub rows: Vec<(Place, Values)>,
}

impl Table {
    /// Reads `for` and `rows`. All columns are used in `content`; `around` are the values of names
    /// that stand around the table, and `stand` is where its cells are. Mistakes become complaints;
    /// `None` when it is no table.
    pub fn read(
        written: &Tree,
        content: &[Tree],
        around: &Values,
        stand: Stand,
        complain: &mut dyn FnMut(Place, String),
    ) -> Option<Self> {
        let part = |name: &str| {
            let part = written.get(name)?;
            // The rows may be an argument of named steps.
            let given = part.text().and_then(|text| formula::whole(text, around));
            match &given.unwrap_or(part).node {
                Node::List(items) => Some(items),
                _ => None,
            }
        };
        let [columns, rows] = TABLE.map(part);
        let (Some(columns), Some(rows)) = (columns, rows) else {
            let message = "a table has its columns in `for` and its `rows`, each a list";
            complain(written.place, message.to_owned());
            return None;
        };
        let named = columns.iter().filter_map(|column| Some((column.text()?, column.place)));
        let columns: Vec<_> = named.map(|(name, place)| At::new(name.to_owned(), place)).collect();
        for (number, column) in columns.iter().enumerate() {
            let name = &column.value;
            if columns[..number].iter().any(|other| other.value == *name) {
                complain(column.place, format!("a column {name} stands here already"));
            } else if !content.iter().any(|part| part.mentions(name)) {
                match slip_of(name, &columns, content, around) {
                    Some(slip) => complain(
                        slip.place,
                        format!("no column is named {}; did you mean `${name}`?", slip.value),
                    ),
                    None => complain(column.place, format!("nothing uses ${name}")),
                }
            }
        }
        let mut all = Vec::new();
        for row in rows {
            let cells: &[Tree] = match &row.node {
                Node::List(cells) => cells,
                // A table of one column has no need for brackets.
                _ if columns.len() == 1 => std::slice::from_ref(row),
                _ => {
                    complain(row.place, "a row is a list of values".to_owned());
                    continue;
                }
            };
            if cells.len() != columns.len() {
                let wanted = counted(columns.len(), "column");
                let given = counted(cells.len(), "value");
                let message = format!("the table has {wanted}, and this row has {given}");
                complain(row.place, message);
                continue;
            }
            let mut values = around.clone();
            for (name, cell) in columns.iter().zip(cells) {
                let cell = cell.filled(around, stand);
                if let Some(message) = number_in_frame(&name.value, &cell, content) {
                    complain(cell.place, message);
                }
                values.insert(name.value.clone(), cell);
            }
            all.push((row.place, values));
        }
        Some(Self { columns, rows: all })
    }

    /// Names in `content` that no column has, with `$`, each with the place of its text. Names of
    /// another kind, such as `$NODEID`, are in capital letters.
    pub fn strangers(&self, content: &Tree) -> Vec<At<String>> {
        strangers(&self.columns, content)
    }
}

fn strangers(columns: &[At<String>], content: &Tree) -> Vec<At<String>> {
    let mut strangers = Vec::new();
    let mut look = |text: &str, place: Place| {
        for name in formula::names(text) {
            if !columns.iter().any(|column| formula::has(&name, &column.value)) {
                strangers.push(At::new(name, place));
            }
        }
    };
    content.texts(&mut look);
    strangers
}

/// A name in `content` that nothing around the table has, and that differs from a column in one
/// letter.
fn slip_of(
    column: &str,
    columns: &[At<String>],
    content: &[Tree],
    around: &Values,
) -> Option<At<String>> {
    let all = content.iter().flat_map(|part| strangers(columns, part));
    all.into_iter().find(|stranger| {
        let is_known = around.keys().any(|name| formula::has(&stranger.value, name));
        !is_known && is_slip(stranger.value.trim_start_matches('$'), column)
    })
}

/// What is wrong with a number that `content` puts into the data of a frame, where its digits would
/// count as hexadecimal ones. Two digits are one byte, as frames are written.
pub fn number_in_frame(name: &str, value: &Tree, content: &[Tree]) -> Option<String> {
    let Node::Int(100.., digits) = &value.node else { return None };
    let mut any = false;
    let mut look = |text: &str, _| {
        let frame = text.split_once('#').filter(|(id, _)| id.ends_with(is_of_id));
        any |= frame.is_some_and(|(_, data)| formula::has(data, name));
    };
    content.iter().for_each(|part| part.texts(&mut look));
    any.then(|| {
        format!(
            "${name} stands in a frame, whose bytes are hexadecimal: quote the digits if that is \
             meant, \"{digits}\", or write the bytes, such as \"D0 07\" for 2000 of two bytes"
        )
    })
}

/// What the identifier of a frame ends with: `201`, `200+n`, `$pdo`, `${id}`.
fn is_of_id(last: char) -> bool {
    last.is_ascii_alphanumeric() || last == '}'
}

fn counted(count: usize, noun: &str) -> String {
    format!("{count} {noun}{}", if count == 1 { "" } else { "s" })
}

/// Where something stands after names in it became values.
#[derive(Clone, Copy, Debug)]
pub enum Stand {
    /// Where it is written.
    Own,
    /// All of it at this place.
    At(Place),
    /// A value that is a cell where the cell is, a text with a part from the row at the row, and
    /// the rest where it is written.
    Row(Place),
}

impl Tree {
    /// Whether a name is used somewhere in it.
    pub fn mentions(&self, name: &str) -> bool {
        match &self.node {
            Node::Map(entries) => entries
                .iter()
                .any(|(key, value)| formula::has(&key.value, name) || value.mentions(name)),
            Node::List(items) => items.iter().any(|item| item.mentions(name)),
            Node::Text(text) => formula::has(text, name),
            _ => false,
        }
    }

    /// All keys and texts, each with its place.
    fn texts(&self, look: &mut dyn FnMut(&str, Place)) {
        match &self.node {
            Node::Map(entries) => entries.iter().for_each(|(key, value)| {
                look(&key.value, key.place);
                value.texts(look);
            }),
            Node::List(items) => items.iter().for_each(|item| item.texts(look)),
            Node::Text(text) => look(text, self.place),
            _ => {}
        }
    }

    /// A copy with values in place of names, in keys, too.
    #[must_use]
    pub fn filled(&self, values: &Values, stand: Stand) -> Self {
        let own = match stand {
            Stand::At(place) => place,
            Stand::Own | Stand::Row(_) => self.place,
        };
        let node = match &self.node {
            Node::Map(entries) => {
                let entries = entries.iter().map(|(key, value)| {
                    (filled_key(key, values, stand), value.filled(values, stand))
                });
                Node::Map(entries.collect())
            }
            Node::List(items) => {
                Node::List(items.iter().map(|item| item.filled(values, stand)).collect())
            }
            Node::Text(text) => {
                let Some(node) = formula::filled(text, values) else {
                    return Self { node: self.node.clone(), place: own };
                };
                let place = match stand {
                    Stand::Row(row) => formula::whole(text, values).map_or(row, |cell| cell.place),
                    Stand::Own | Stand::At(_) => own,
                };
                return Self { node, place };
            }
            other => other.clone(),
        };
        Self { node, place: own }
    }
}

fn filled_key(key: &At<String>, values: &Values, stand: Stand) -> At<String> {
    let word = match formula::filled(&key.value, values) {
        Some(Node::Text(text) | Node::Int(_, text)) => Some(text),
        _ => None,
    };
    let place = match (stand, &word) {
        (Stand::At(place), _) | (Stand::Row(place), Some(_)) => place,
        (Stand::Own | Stand::Row(_), _) => key.place,
    };
    At::new(word.unwrap_or_else(|| key.value.clone()), place)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::source::Source;

    fn read(text: &str) -> (Option<Table>, Vec<(Place, String)>) {
        let source = Arc::new(Source::new("x", text.to_owned()));
        let tree = Tree::of(&source).unwrap();
        let content = tree.get("content").unwrap().clone();
        let mut wrong = Vec::new();
        let mut complain = |place, message| wrong.push((place, message));
        let table = Table::read(&tree, &[content], &Values::new(), Stand::Own, &mut complain);
        (table, wrong)
    }

    #[test]
    fn rows_give_values_to_columns() {
        let text = "content: { $a: x-$b, $c: $b }\nfor: [a, b, c]\nrows:\n- [k, 0x07, [l]]\n";
        let source = Arc::new(Source::new("x", text.to_owned()));
        let tree = Tree::of(&source).unwrap();
        let (table, wrong) = read(text);
        assert_eq!(wrong, []);
        let (place, values) = &table.unwrap().rows[0];
        let content = tree.get("content").unwrap().filled(values, Stand::Row(*place));
        let [(first, text), (_, whole)] = content.entries() else { panic!("{content:?}") };
        assert_eq!((first.value.as_str(), first.place), ("k", *place));
        assert_eq!((text.text(), text.place), (Some("x-0x07"), *place));
        assert_eq!((&whole.node, whole.place), (&Node::Int(7, "0x07".into()), Place::new(4, 7)));
    }

    #[test]
    fn mistakes_in_tables_have_places() {
        for (text, place, said) in [
            ("content: $a\nfor: [a, b]\nrows: [[1, 2]]\n", (2, 10), "nothing uses $b"),
            (
                "content: $a $thxn\nfor: [a, then]\nrows: [[1, 2]]\n",
                (1, 10),
                "no column is named $thxn; did you mean `$then`?",
            ),
            (
                "content: $a\nfor: [a, a]\nrows: [[1, 2]]\n",
                (2, 10),
                "a column a stands here already",
            ),
            (
                "content: $a\nfor: [a]\nrows: [1, [2, 3]]\n",
                (3, 11),
                "the table has 1 column, and this row has 2 values",
            ),
            (
                "content: $a\nfor: [a]\n",
                (1, 1),
                "a table has its columns in `for` and its `rows`, each a list",
            ),
            ("content: $a $b\nfor: [a, b]\nrows: [x]\n", (3, 8), "a row is a list of values"),
            (
                "content: 201#01 $a\nfor: [a]\nrows: [20, \"2000\", 2000]\n",
                (3, 20),
                "$a stands in a frame, whose bytes are hexadecimal: quote the digits if that is \
                 meant, \"2000\", or write the bytes, such as \"D0 07\" for 2000 of two bytes",
            ),
        ] {
            let (_, wrong) = read(text);
            assert_eq!(wrong, [(Place::new(place.0, place.1), said.to_owned())], "{text}");
        }
    }
}
