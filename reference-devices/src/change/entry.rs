//! Entries of a file of mutants or freedoms in short notation: a table of several, a name with its
//! sentence, a change by its kind, a decision by its name. Each entry is expanded in full before it
//! is read.

use std::sync::Arc;

use canopen::source::{At, Complaint, Node, Place, Source, Stand, TABLE, Table, Tree, Values};

use super::data::Change;
use crate::decisions::Deciding;
use crate::rules;

/// How the entries of a file are written.
pub(crate) struct Form<'f> {
    /// The key of the list.
    pub list: &'f str,
    /// The keys of an entry in full.
    pub keys: &'f [&'f str],
    /// Those of them with a list, of which one item may stand there without brackets.
    pub lists: &'f [&'f str],
    /// The key of what is different.
    pub change: Changes,
    /// The family whose variants `on` names, where an entry stands for one on each of them.
    pub family: Option<&'f str>,
}

/// How many changes an entry has.
#[derive(Clone, Copy)]
pub(crate) enum Changes {
    /// One, under `change`.
    One,
    /// A list of them, under `changes`.
    Several,
}

/// A column with such a name is the value of that key, where an entry does not have the key itself.
const BY_COLUMN: [&str; 11] = [
    "name",
    "why",
    "breaks",
    "allowed-by",
    "on",
    "as",
    "decision",
    "is",
    "rule",
    "behaviour",
    "ignores",
];

/// The key beside `decision`.
const RESULT: &str = "is";

/// The file with each entry in full.
///
/// # Errors
/// What is wrong with its text, or with a table.
pub(crate) fn in_full(source: &Arc<Source>, form: &Form<'_>) -> Result<Tree, Vec<Complaint>> {
    let mut tree = Tree::of(source).map_err(|wrong| vec![wrong])?;
    let mut reader = Reader { source, form, complaints: Vec::new() };
    if let Node::Map(keys) = &mut tree.node {
        for (_, list) in keys.iter_mut().filter(|(key, _)| key.value == form.list) {
            let Node::List(items) = &mut list.node else { continue };
            let each = std::mem::take(items).into_iter().flat_map(|item| reader.rows(item));
            *items = each.collect();
            items.iter_mut().for_each(|item| reader.entry(item));
            if let Some(family) = form.family {
                *items = items.iter().flat_map(|item| reader.each_variant(item, family)).collect();
            }
        }
    }
    if reader.complaints.is_empty() { Ok(tree) } else { Err(reader.complaints) }
}

struct Reader<'s> {
    source: &'s Arc<Source>,
    form: &'s Form<'s>,
    complaints: Vec<Complaint>,
}

type Keys = Vec<(At<String>, Tree)>;

impl Reader<'_> {
    /// An item for each row of its table; the item itself where it has none.
    fn rows(&mut self, mut item: Tree) -> Vec<Tree> {
        if TABLE.iter().all(|key| item.get(key).is_none()) {
            return vec![item];
        }
        let Node::Map(keys) = &mut item.node else { return vec![item] };
        let is_table = |key: &At<String>| TABLE.contains(&key.value.as_str());
        let (table, mut content): (Keys, Keys) =
            std::mem::take(keys).into_iter().partition(|(key, _)| is_table(key));
        let table = Tree { node: Node::Map(table), place: item.place };
        if let Some(Node::List(columns)) = table.get("for").map(|columns| &columns.node) {
            self.by_column(columns, &mut content);
        }
        let content = Tree { node: Node::Map(content), place: item.place };
        let (source, complaints) = (self.source, &mut self.complaints);
        let mut complain = |place, message| complaints.push(Complaint::at(source, place, message));
        let parts = std::slice::from_ref(&content);
        let none = Values::new();
        let Some(table) = Table::read(&table, parts, &none, Stand::Own, &mut complain) else {
            return Vec::new();
        };
        for stranger in table.strangers(&content) {
            let place = mention(source, &stranger);
            complain(place, format!("no column is called {}", stranger.value));
        }
        let rows = table.rows.iter().map(|(place, values)| {
            let mut row = without_empty(&content, values).filled(values, Stand::Row(*place));
            row.place = *place;
            row
        });
        rows.collect()
    }

    /// Adds the keys that are columns.
    fn by_column(&self, columns: &[Tree], content: &mut Keys) {
        let is_named = self.is_named(content);
        for column in columns {
            let Some(name) = column.text().filter(|name| BY_COLUMN.contains(name)) else {
                continue;
            };
            let is_there = content.iter().any(|(key, _)| key.value == name)
                || is_named && ["name", "why"].contains(&name);
            if self.is_key(name) && !is_there {
                let value = Node::Text(format!("${name}"));
                let key = At::new(name.to_owned(), column.place);
                content.push((key, Tree { node: value, place: column.place }));
            }
        }
    }

    fn is_key(&self, key: &str) -> bool {
        self.form.keys.contains(&key) || is_of_change(key)
    }

    /// Whether the first key is the name of the entry, and its sentence the value.
    fn is_named(&self, keys: &[(At<String>, Tree)]) -> bool {
        let in_full = |key: &At<String>| ["name", "why"].contains(&key.value.as_str());
        keys.first().is_some_and(|(first, _)| !self.is_key(&first.value))
            && !keys.iter().any(|(key, _)| in_full(key))
    }

    /// The entry for each variant in `on`: the first has its name, the others the name and their
    /// own. A map has what the entry breaks there.
    fn each_variant(&mut self, item: &Tree, family: &str) -> Vec<Tree> {
        let names: Vec<(At<String>, Option<&Tree>)> = match item.get("on").map(|on| &on.node) {
            Some(Node::List(names)) => {
                let text = |name: &Tree| Some(At::new(name.text()?.to_owned(), name.place));
                names.iter().filter_map(text).map(|name| (name, None)).collect()
            }
            Some(Node::Map(names)) => {
                names.iter().map(|(name, breaks)| (name.clone(), Some(breaks))).collect()
            }
            _ => Vec::new(),
        };
        if names.is_empty() {
            return vec![item.clone()];
        }
        let own = item.entries().iter().find(|(key, _)| key.value == "breaks");
        if let (Some((key, _)), Some((_, Some(_)))) = (own, names.first()) {
            let message = "`breaks` stands behind each variant in `on` already";
            self.complaints.push(Complaint::at(self.source, key.place, message));
        }
        let each = names.iter().enumerate().map(|(number, (variant, breaks))| {
            let mut item = item.clone();
            let Node::Map(keys) = &mut item.node else { return item };
            for (key, value) in keys.iter_mut() {
                match key.value.as_str() {
                    "on" => value.node = Node::List(vec![text(variant)]),
                    "name" if number > 0 => {
                        let (name, variant) = (value.text().unwrap_or_default(), &variant.value);
                        let end = variant.strip_prefix(family).unwrap_or(variant);
                        let end = end.strip_prefix('-').unwrap_or(end);
                        value.node = Node::Text(format!("{name}-{end}"));
                    }
                    _ => {}
                }
            }
            if let Some(breaks) = breaks {
                let mut breaks = (*breaks).clone();
                as_list(&mut breaks);
                keys.push((At::new("breaks".to_owned(), breaks.place), breaks));
            }
            item
        });
        each.collect()
    }

    fn entry(&mut self, item: &mut Tree) {
        let place = item.place;
        let Node::Map(keys) = &mut item.node else { return };
        if self.is_named(keys) {
            let (name, why) = keys.remove(0);
            let name = Tree { place: name.place, node: Node::Text(name.value) };
            keys.insert(0, (At::new("name".to_owned(), name.place), name));
            keys.insert(1, (At::new("why".to_owned(), why.place), why));
        }
        let (mut kinds, mut rest): (Keys, Keys) =
            std::mem::take(keys).into_iter().partition(|(key, _)| is_of_change(&key.value));
        decision_in_one(&mut kinds);
        match self.form.change {
            Changes::One => add_change(&mut rest, kinds, place),
            Changes::Several => self.add_changes(&mut rest, kinds, place),
        }
        let lists =
            rest.iter_mut().filter(|(key, _)| self.form.lists.contains(&key.value.as_str()));
        lists.for_each(|(_, value)| as_list(value));
        *keys = rest;
    }

    fn add_changes(&mut self, rest: &mut Keys, kinds: Keys, place: Place) {
        let of_kinds = kinds.into_iter().map(|(kind, change)| {
            let place = kind.place;
            Tree { node: Node::Map(vec![(kind, change)]), place }
        });
        let mut of_kinds: Vec<Tree> = of_kinds.collect();
        if let Some(one) = rest.iter().position(|(key, _)| key.value == "change") {
            let (_, mut change) = rest.remove(one);
            decision_in_one_of(&mut change);
            of_kinds.insert(0, change);
        }
        if let Some((_, changes)) = rest.iter_mut().find(|(key, _)| key.value == "changes") {
            let Node::List(changes) = &mut changes.node else { return };
            let each = std::mem::take(changes).into_iter().flat_map(|change| self.rows(change));
            *changes = each.chain(of_kinds).collect();
            changes.iter_mut().for_each(decision_in_one_of);
            return;
        }
        let changes = match (of_kinds.is_empty(), decision(rest)) {
            (true, Some((kind, name))) => {
                let place = name.place;
                vec![Tree { node: Node::Map(vec![(kind, name)]), place }]
            }
            (true, None) => return,
            (false, _) => of_kinds,
        };
        let changes = Tree { node: Node::List(changes), place };
        rest.push((At::new("changes".to_owned(), place), changes));
    }
}

fn text(name: &At<String>) -> Tree {
    Tree { node: Node::Text(name.value.clone()), place: name.place }
}

/// A list with a single value that was written without brackets.
fn as_list(value: &mut Tree) {
    if value.text().is_some() {
        let one = Tree { node: std::mem::replace(&mut value.node, Node::Null), ..*value };
        value.node = Node::List(vec![one]);
    }
}

fn is_of_change(key: &str) -> bool {
    key == RESULT || Change::KINDS.contains(&key)
}

/// Puts what stands beside `decision` below it: one key for each change.
fn decision_in_one(kinds: &mut Keys) {
    let Some(decision) = kinds.iter().position(|(key, _)| key.value == "decision") else { return };
    let result = kinds.iter().position(|(key, _)| key.value == RESULT);
    let result = result.map(|result| kinds[result].clone());
    let (key, name) = kinds[decision].clone();
    let both = std::iter::once((key.clone(), name)).chain(result).collect();
    kinds[decision].1 = Tree { place: key.place, node: Node::Map(both) };
    kinds.retain(|(key, _)| key.value != RESULT);
}

fn decision_in_one_of(change: &mut Tree) {
    if let Node::Map(kinds) = &mut change.node {
        decision_in_one(kinds);
    }
}

fn add_change(rest: &mut Keys, mut kinds: Keys, place: Place) {
    if let Some((_, change)) = rest.iter_mut().find(|(key, _)| key.value == "change") {
        decision_in_one_of(change);
        // A second change, which does not belong there.
        if let Node::Map(change) = &mut change.node {
            change.append(&mut kinds);
        }
        return;
    }
    if kinds.is_empty() {
        kinds.extend(decision(rest));
    }
    if let Some((first, _)) = kinds.first() {
        let place = first.place.max(place);
        let change = Tree { node: Node::Map(kinds), place };
        rest.push((At::new("change".to_owned(), place), change));
    }
}

/// The change of an entry that says of none: the decision that has its name, of the stack or else
/// of the application.
fn decision(keys: &[(At<String>, Tree)]) -> Option<(At<String>, Tree)> {
    let (_, name) = keys.iter().find(|(key, _)| key.value == "name")?;
    let is_of_stack = rules::Decision::names().into_iter().any(|known| Some(known) == name.text());
    let kind = if is_of_stack { "rule" } else { "behaviour" };
    Some((At::new(kind.to_owned(), name.place), name.clone()))
}

/// Where the name is mentioned in a text that starts there.
fn mention(source: &Source, name: &At<String>) -> Place {
    let line = source.line(name.place.line);
    let from = line.char_indices().nth(name.place.column.saturating_sub(1));
    let text = from.map_or("", |(from, _)| &line[from..]);
    let before = text.find(&name.value).map_or(0, |at| text[..at].chars().count());
    Place { column: name.place.column + before, ..name.place }
}

/// A copy without keys whose cell is empty, `~`.
fn without_empty(tree: &Tree, values: &Values) -> Tree {
    let is_empty = |value: &Tree| match &value.node {
        Node::Text(text) => {
            let cell = text.strip_prefix('$').and_then(|name| values.get(name));
            cell.is_some_and(|cell| cell.node == Node::Null)
        }
        _ => false,
    };
    let node = match &tree.node {
        Node::Map(keys) => {
            let keys = keys.iter().filter(|(_, value)| !is_empty(value));
            Node::Map(
                keys.map(|(key, value)| (key.clone(), without_empty(value, values))).collect(),
            )
        }
        Node::List(items) => {
            Node::List(items.iter().map(|item| without_empty(item, values)).collect())
        }
        other => other.clone(),
    };
    Tree { node, place: tree.place }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FORM: Form<'static> = Form {
        list: "mutants",
        keys: &["name", "why", "breaks", "on", "as", "change"],
        lists: &["breaks", "on"],
        change: Changes::One,
        family: Some("d"),
    };

    fn read(text: &str) -> Result<Tree, Vec<Complaint>> {
        in_full(&Arc::new(Source::new("x", text.to_owned())), &FORM)
    }

    /// Keys and values in one line each, to compare.
    fn shown(tree: &Tree) -> String {
        match &tree.node {
            Node::Map(keys) => {
                let keys =
                    keys.iter().map(|(key, value)| format!("{}: {}", key.value, shown(value)));
                format!("{{{}}}", keys.collect::<Vec<_>>().join(", "))
            }
            Node::List(items) => {
                format!("[{}]", items.iter().map(shown).collect::<Vec<_>>().join(", "))
            }
            _ => tree.text().unwrap_or("~").to_owned(),
        }
    }

    #[test]
    fn short_entries_are_in_full() {
        for (short, full) in [
            (
                "- a: Why.\n  breaks: R-1\n  rule: b",
                "{name: a, why: Why., breaks: [R-1], change: {rule: b}}",
            ),
            ("- name: a\n  why: Why.", "{name: a, why: Why., change: {behaviour: a}}"),
            (
                "- nmt-broadcast-ignored: Why.",
                "{name: nmt-broadcast-ignored, why: Why., change: {rule: nmt-broadcast-ignored}}",
            ),
            (
                "- a: Why.\n  decision: b\n  is: 0x10",
                "{name: a, why: Why., change: {decision: {decision: b, is: 0x10}}}",
            ),
            (
                "- a: Why.\n  change: { decision: b, is: true }",
                "{name: a, why: Why., change: {decision: {decision: b, is: true}}}",
            ),
            (
                "- why: Why.\n  for: [name, decision, is]\n  rows: [[a, b, none], [c, ~, ~]]",
                "{why: Why., name: a, change: {decision: {decision: b, is: none}}}, \
                 {why: Why., name: c, change: {behaviour: c}}",
            ),
            (
                "- a: Why.\n  on: [d, d-x]\n  rule: b",
                "{name: a, why: Why., on: [d], change: {rule: b}}, \
                 {name: a-x, why: Why., on: [d-x], change: {rule: b}}",
            ),
            (
                "- a: Why.\n  on: { d: R-1, d-x: [R-2] }\n  rule: b",
                "{name: a, why: Why., on: [d], change: {rule: b}, breaks: [R-1]}, \
                 {name: a-x, why: Why., on: [d-x], change: {rule: b}, breaks: [R-2]}",
            ),
            (
                "- m-$rule: $why\n  for: [rule, as, why]\n  rows: [[b, ~, A.], [c, sign, B.]]",
                "{name: m-b, why: A., change: {rule: b}}, \
                 {name: m-c, why: B., as: sign, change: {rule: c}}",
            ),
        ] {
            let tree = read(&format!("mutants:\n{short}\n")).unwrap();
            assert_eq!(shown(&tree), format!("{{mutants: [{full}]}}"), "{short}");
        }
    }

    #[test]
    fn mistakes_have_places() {
        for (text, place, said) in [
            (
                "- a-$n: W\n  for: [n]\n  rows: [[1, 2]]",
                (4, 10),
                "the table has 1 column, and this row has 2 values",
            ),
            ("- a: W\n  for: [n]\n  rows: [1]", (3, 9), "nothing uses $n"),
            ("- a-$n: W $m\n  for: [n]\n  rows: [1]", (2, 11), "no column is called $m"),
            (
                "- a-$n: W\n  for: [n, n]\n  rows: [[1, 2]]",
                (3, 12),
                "a column n stands here already",
            ),
            (
                "- a: W\n  on: { d: R }\n  breaks: R",
                (4, 3),
                "`breaks` stands behind each variant in `on` already",
            ),
        ] {
            let wrong = read(&format!("mutants:\n{text}\n")).unwrap_err();
            assert_eq!(wrong.len(), 1, "{text}");
            assert_eq!(wrong[0].message, said, "{text}");
            assert_eq!(wrong[0].place, Some(Place::new(place.0, place.1)), "{text}");
        }
    }
}
